//! The rows that CiA 301 has for every device, for those devices that are as a profile has them. A table that
//! reads like a maker's manual prints its own, each with its line.
//!
//! Such a dictionary is joined of parts, in ascending order: parts from here, which are told what the device
//! chooses, and the device's own rows between and behind them.

use syncline_canopen::dictionary::DataType::{Text, U8, U16, U32};
use syncline_canopen::dictionary::{Entry, ro, rw};

/// Bit of a PDO's COB-ID: the PDO is not used (CiA 301, 7.5.2.35).
pub(super) const UNUSED: i64 = 0x8000_0000;

/// Bit of a T_PDO's COB-ID: no remote frame asks for it (CiA 301, 7.5.2.37).
const NO_REMOTE: i64 = 0x4000_0000;

/// A name with each of the numbers from one.
macro_rules! numbered {
    ($before:literal, [$($number:literal),*], $after:literal) => {
        [$(concat!($before, $number, $after)),*]
    };
}

/// How many rows these parts have.
pub(super) const fn rows(parts: &[&[Entry]]) -> usize {
    let (mut rows, mut part) = (0, 0);
    while part < parts.len() {
        rows += parts[part].len();
        part += 1;
    }
    rows
}

/// The rows of these parts, one part behind the other.
pub(super) const fn join<const ROWS: usize>(parts: &[&[Entry]]) -> [Entry; ROWS] {
    let mut joined = [parts[0][0]; ROWS];
    let (mut row, mut part) = (0, 0);
    while part < parts.len() {
        let mut own = 0;
        while own < parts[part].len() {
            joined[row] = parts[part][own];
            row += 1;
            own += 1;
        }
        part += 1;
    }
    assert!(row == ROWS, "as many rows as the parts have");
    joined
}

/// 1000h and 1001h: what the device is, and its error register.
pub(super) const fn device(device_type: i64) -> [Entry; 2] {
    [
        ro(0x1000, 0, "Device type", U32).default(device_type),
        ro(0x1001, 0, "Error register", U8).t_pdo(),
    ]
}

/// 1003h: how many errors there are, and the last of them. `ROWS` is one more than it keeps.
pub(super) const fn errors<const ROWS: usize>() -> [Entry; ROWS] {
    const NAMES: [&str; 4] = numbered!("Error field ", [1, 2, 3, 4], "");
    let mut rows = [rw(0x1003, 0, "Number of errors", U8).default(0); ROWS];
    let mut sub = 1;
    while sub < ROWS {
        rows[sub] = ro(0x1003, sub as u8, NAMES[sub - 1], U32).default(0);
        sub += 1;
    }
    rows
}

/// 1005h and 1008h: the SYNC that the device listens to, and its name.
pub(super) const fn sync_and_name(name: &'static str) -> [Entry; 2] {
    [
        rw(0x1005, 0, "COB-ID SYNC", U32).default(0x80),
        ro(0x1008, 0, "Manufacturer device name", Text(16)).default_text(name),
    ]
}

/// 1014h to 1018h: EMCY, heartbeat as consumer and producer, and an identity of four numbers.
pub(super) const EMCY_HEARTBEAT_IDENTITY: &[Entry] = &[
    rw(0x1014, 0, "COB-ID EMCY", U32).default_plus_node(0x80),
    rw(0x1015, 0, "Inhibit time EMCY", U16)
        .default(0)
        .unit("100 us"),
    ro(0x1016, 0, "Consumer heartbeat time: number", U8).default(1),
    rw(0x1016, 1, "Consumer heartbeat time", U32).default(0),
    rw(0x1017, 0, "Producer heartbeat time", U16)
        .default(0)
        .unit("ms"),
    ro(0x1018, 0, "Identity: number", U8).default(4),
    ro(0x1018, 1, "Vendor ID", U32).default(0),
    ro(0x1018, 2, "Product code", U32).default(0),
    ro(0x1018, 3, "Revision number", U32).default(0),
    ro(0x1018, 4, "Serial number", U32).default(0),
];

/// 1029h: which NMT state an error of communication leads to.
pub(super) const ERROR_BEHAVIOUR: &[Entry] = &[
    ro(0x1029, 0, "Error behaviour: number", U8).default(1),
    rw(0x1029, 1, "Communication error", U8)
        .range(0, 2)
        .default(0),
];

/// 1200h: the SDO server that every device has.
pub(super) const SDO_SERVER: &[Entry] = &[
    ro(0x1200, 0, "SDO server: number", U8).default(2),
    ro(0x1200, 1, "COB-ID client to server", U32).default_plus_node(0x600),
    ro(0x1200, 2, "COB-ID server to client", U32).default_plus_node(0x580),
];

/// 1400h and behind it: the parameters of R_PDO 1 to 4, with the bits of its COB-ID beside the identifier
/// (0 or [`UNUSED`]) and its transmission type.
pub(super) const fn r_pdo(number: u16, bits: i64, transmission_type: i64) -> [Entry; 3] {
    const HIGHEST: [&str; 4] = numbered!("R_PDO", [1, 2, 3, 4], " parameter: highest subindex");
    const COB_ID: [&str; 4] = numbered!("COB-ID R_PDO", [1, 2, 3, 4], "");
    const TYPE: [&str; 4] = numbered!("Transmission type R_PDO", [1, 2, 3, 4], "");
    let (index, at) = (0x1400 + number - 1, number as usize - 1);
    let cob_id = 0x100 + 0x100 * number as i64;
    [
        ro(index, 0, HIGHEST[at], U8).default(2),
        rw(index, 1, COB_ID[at], U32).default_plus_node(bits | cob_id),
        rw(index, 2, TYPE[at], U8).default(transmission_type),
    ]
}

/// 1800h and behind it: the parameters of T_PDO 1 to 4, which no remote frame asks for; as [`r_pdo`].
pub(super) const fn t_pdo(number: u16, bits: i64, transmission_type: i64) -> [Entry; 5] {
    const HIGHEST: [&str; 4] = numbered!("T_PDO", [1, 2, 3, 4], " parameter: highest subindex");
    const COB_ID: [&str; 4] = numbered!("COB-ID T_PDO", [1, 2, 3, 4], "");
    const TYPE: [&str; 4] = numbered!("Transmission type T_PDO", [1, 2, 3, 4], "");
    const INHIBIT: [&str; 4] = numbered!("Inhibit time T_PDO", [1, 2, 3, 4], "");
    const EVENT: [&str; 4] = numbered!("Event timer T_PDO", [1, 2, 3, 4], "");
    let (index, at) = (0x1800 + number - 1, number as usize - 1);
    let cob_id = 0x80 + 0x100 * number as i64;
    [
        ro(index, 0, HIGHEST[at], U8).default(5),
        rw(index, 1, COB_ID[at], U32).default_plus_node(NO_REMOTE | bits | cob_id),
        rw(index, 2, TYPE[at], U8).default(transmission_type),
        rw(index, 3, INHIBIT[at], U16).default(0).unit("100 us"),
        rw(index, 5, EVENT[at], U16).default(0).unit("ms"),
    ]
}

/// What an R_PDO maps unless it is told otherwise: `ROWS` is one more than it can map.
pub(super) const fn r_pdo_mapping<const ROWS: usize>(number: u16, mapped: &[i64]) -> [Entry; ROWS] {
    const NUMBER: [&str; 4] = numbered!("R_PDO", [1, 2, 3, 4], " mapping: number");
    const NAMES: [[&str; 8]; 4] = [
        numbered!("R_PDO1 mapped object ", [1, 2, 3, 4, 5, 6, 7, 8], ""),
        numbered!("R_PDO2 mapped object ", [1, 2, 3, 4, 5, 6, 7, 8], ""),
        numbered!("R_PDO3 mapped object ", [1, 2, 3, 4, 5, 6, 7, 8], ""),
        numbered!("R_PDO4 mapped object ", [1, 2, 3, 4, 5, 6, 7, 8], ""),
    ];
    let at = number as usize - 1;
    mapping(0x1600 + number - 1, NUMBER[at], &NAMES[at], mapped)
}

/// What a T_PDO maps; as [`r_pdo_mapping`].
pub(super) const fn t_pdo_mapping<const ROWS: usize>(number: u16, mapped: &[i64]) -> [Entry; ROWS] {
    const NUMBER: [&str; 4] = numbered!("T_PDO", [1, 2, 3, 4], " mapping: number");
    const NAMES: [[&str; 8]; 4] = [
        numbered!("T_PDO1 mapped object ", [1, 2, 3, 4, 5, 6, 7, 8], ""),
        numbered!("T_PDO2 mapped object ", [1, 2, 3, 4, 5, 6, 7, 8], ""),
        numbered!("T_PDO3 mapped object ", [1, 2, 3, 4, 5, 6, 7, 8], ""),
        numbered!("T_PDO4 mapped object ", [1, 2, 3, 4, 5, 6, 7, 8], ""),
    ];
    let at = number as usize - 1;
    mapping(0x1A00 + number - 1, NUMBER[at], &NAMES[at], mapped)
}

const fn mapping<const ROWS: usize>(
    index: u16,
    number: &'static str,
    names: &[&'static str; 8],
    mapped: &[i64],
) -> [Entry; ROWS] {
    let mut rows = [rw(index, 0, number, U8)
        .range(0, ROWS as i64 - 1)
        .default(mapped.len() as i64); ROWS];
    let mut sub = 1;
    while sub < ROWS {
        let object = if sub <= mapped.len() {
            mapped[sub - 1]
        } else {
            0
        };
        rows[sub] = rw(index, sub as u8, names[sub - 1], U32).default(object);
        sub += 1;
    }
    rows
}
