//! The object dictionary of the absolute encoder TWK CRN: CiA 406 V2.0 on DS 301 V3.0.
//!
//! Rows, types, access and defaults are those of the manual's overview and default tables (crn S28,
//! S22, S3, S1, S27; S26, S9) unless a row names another place: `crn S12` is the snippet of the
//! manual's text that begins with 12. The device comes with 4096 or 8192 steps per turn.

use syncline_canopen::dictionary::DataType::{I32, Text, U8, U16, U32};
use syncline_canopen::dictionary::{Entry, constant, ro, rw, table};

/// Turns that the encoder tells apart (crn S37).
pub const TWK_CRN_TURNS: u16 = 0x1000;

/// The table with 4096 steps per turn.
pub static TWK_CRN_4096: &[Entry] = &crn(0x1000);

/// The table with 8192 steps per turn.
pub static TWK_CRN_8192: &[Entry] = &crn(0x2000);

#[rustfmt::skip]
const fn crn(steps: i64) -> [Entry; 64] {
    table([
    // 1xxxh: communication profile (DS 301).
    constant(0x1000, 0, "Device type", U32).default(0x0002_0196),
    ro(0x1001, 0, "Error register", U8).default(0),
    ro(0x1002, 0, "Manufacturer status register", U32).default(0),
    // 1 in the default table (crn S26), 0 in the example without an error (crn S17).
    rw(0x1003, 0, "Number of errors", U8).default(0),
    ro(0x1003, 1, "Standard error field", U32).default(0),
    ro(0x1004, 0, "Number of PDOs", U32).default(2),
    ro(0x1004, 1, "Number of synchronous PDOs", U32).default(1),
    ro(0x1004, 2, "Number of asynchronous PDOs", U32).default(1),
    // 80h in the object's own table, this in its example and in the default table (crn S44, S26).
    rw(0x1005, 0, "COB-ID SYNC", U32).default(0x8000_0080).persistent(),
    rw(0x1006, 0, "Communication cycle period", U32).default(0).unit("ms"),
    rw(0x1007, 0, "Synchronous window length", U32).default(0).unit("ms"),
    constant(0x1008, 0, "Manufacturer device name", Text(11)).default_text("Encoder CRN"),
    constant(0x1009, 0, "Manufacturer hardware version", Text(5)).default_text("01.00"),
    constant(0x100A, 0, "Manufacturer software version", Text(5)).default_text("01.40"),
    ro(0x100B, 0, "Node-ID", U32).default_plus_node(0).persistent(),
    // U32 in the overview, these types in the objects' descriptions (crn S7, S29).
    rw(0x100C, 0, "Guard time", U16).default(0).unit("ms"),
    rw(0x100D, 0, "Life time factor", U8).default(0),
    rw(0x100E, 0, "Guarding COB-ID", U32).default_plus_node(0x700).persistent(),
    ro(0x100F, 0, "Number of SDOs", U32).default(1),
    ro(0x1010, 0, "Store parameters: largest subindex", U8).default(1),
    rw(0x1010, 1, "Save all parameters", U32).default(0x6576_6173),
    ro(0x1011, 0, "Restore parameters: largest subindex", U8).default(1),
    rw(0x1011, 1, "Restore all default parameters", U32).default(0x6461_6F6C),
    rw(0x1014, 0, "COB-ID EMCY", U32).default_plus_node(0x80).persistent(),
    ro(0x1800, 0, "T_PDO1: number of entries", U8).default(3),
    rw(0x1800, 1, "COB-ID T_PDO1", U32).default_plus_node(0x180).persistent(),
    rw(0x1800, 2, "Transmission type T_PDO1", U8).default(254).persistent(),
    rw(0x1800, 3, "Inhibit time T_PDO1", U16).default(0).unit("100 us").persistent(),
    // There is no 1801h: the second PDO is the third by its number (crn S39).
    ro(0x1802, 0, "T_PDO2: number of entries", U8).default(3),
    rw(0x1802, 1, "COB-ID T_PDO2", U32).default_plus_node(0x280).persistent(),
    rw(0x1802, 2, "Transmission type T_PDO2", U8).default(1).persistent(),
    rw(0x1802, 3, "Inhibit time T_PDO2", U16).default(0).unit("100 us").persistent(),
    ro(0x1A00, 0, "T_PDO1 mapping: number of objects", U8).default(1),
    ro(0x1A00, 1, "T_PDO1 mapped object", U32).default(0x6004_0020),
    ro(0x1A02, 0, "T_PDO2 mapping: number of objects", U8).default(1),
    ro(0x1A02, 1, "T_PDO2 mapped object", U32).default(0x6004_0020),
    // 2xxxh: of the version with a plug.
    rw(0x2000, 0, "Node-ID", U8).range(1, 64).default(1).persistent(),
    rw(0x2001, 0, "Baud rate", U8).range(0, 3).default(0).persistent(),
    // 6xxxh: encoder profile (CiA 406).
    rw(0x6000, 0, "Operating parameters", U16).default(0).persistent(),
    rw(0x6001, 0, "Measuring units per revolution", U32).default(steps).unit("steps").persistent(),
    rw(0x6002, 0, "Total measuring range", U32).default(steps * TWK_CRN_TURNS as i64).unit("steps").persistent(),
    rw(0x6003, 0, "Preset value", U32).default(0).unit("steps").persistent(),
    ro(0x6004, 0, "Position value", U32).unit("steps").t_pdo(),
    rw(0x6200, 0, "Cyclic timer", U16).default(0).unit("ms").persistent(),
    ro(0x6400, 0, "Area state: number of channels", U8).default(1),
    ro(0x6400, 1, "Work area state", U8).default(0),
    ro(0x6401, 0, "Work area low limit: number of channels", U8).default(1),
    rw(0x6401, 1, "Work area low limit", I32).default(0x000F_FFFF).unit("steps").persistent(),
    ro(0x6402, 0, "Work area high limit: number of channels", U8).default(1),
    rw(0x6402, 1, "Work area high limit", I32).default(0x01F0_0000).unit("steps").persistent(),
    ro(0x6500, 0, "Operating status", U16).default(0),
    ro(0x6501, 0, "Single-turn resolution", U32).default(steps).unit("steps"),
    ro(0x6502, 0, "Number of distinguishable revolutions", U16).default(TWK_CRN_TURNS as i64),
    ro(0x6503, 0, "Alarms", U16).default(0),
    ro(0x6504, 0, "Supported alarms", U16).default(0x7000),
    ro(0x6505, 0, "Warnings", U16).default(0),
    ro(0x6506, 0, "Supported warnings", U16).default(0x0020),
    ro(0x6507, 0, "Profile and software version", U32).default(0x0100_0200),
    ro(0x6508, 0, "Operating time", U32).default(0xFFFF_FFFF),
    ro(0x6509, 0, "Offset value", I32).default(0).unit("steps").persistent(),
    // Its subindex 0 is a value and no count (crn S30).
    ro(0x650A, 0, "Module identification: manufacturer offset", I32).default(0),
    ro(0x650A, 1, "Manufacturer minimum position", I32).default(0x000F_FFFF),
    ro(0x650A, 2, "Manufacturer maximum position", I32).default(0x01F0_0000),
    ro(0x650B, 0, "Serial number", U32).default(0xFFFF_FFFF),
    ])
}
