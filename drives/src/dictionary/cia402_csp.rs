//! The object dictionary of a drive as the profile has it: CiA 402 (IEC 61800-7-201), with Cyclic
//! Synchronous Position, Interpolated Position, Cyclic Synchronous Velocity, Profile Velocity or velocity mode as its only operating
//! mode, on CANopen (CiA 301).
//!
//! `default` is a value that a profile gives; `assumed` one that it leaves to the maker. Positions
//! count encoder increments at the motor's shaft, velocities increments/s unless a machine says otherwise.

use super::cia301::{
    EMCY_HEARTBEAT_IDENTITY, ERROR_BEHAVIOUR, SDO_SERVER, UNUSED, device, errors, join, r_pdo,
    r_pdo_mapping, rows, sync_and_name, t_pdo, t_pdo_mapping,
};
use syncline_canopen::dictionary::DataType::{I8, I16, I32, U8, U16, U32};
use syncline_canopen::dictionary::{Entry, Preset, ro, rw, table};

/// Of a drive in Cyclic Synchronous Position, in ascending order.
pub static CIA402_CSP: &[Entry] = &in_mode(8);
/// The same in Cyclic Synchronous Velocity.
pub static CIA402_CSV: &[Entry] = &in_mode(9);
/// The same in Profile Velocity.
pub static CIA402_PV: &[Entry] = &in_mode(3);
/// The same in velocity mode.
pub static CIA402_VL: &[Entry] = &in_mode(2);

/// The table of a drive whose one operating mode this is, as 6502h tells: bit 0 is mode 1.
const fn in_mode(mode: u8) -> [Entry; rows(PARTS)] {
    let mut table = table(join::<{ rows(PARTS) }>(PARTS));
    let mut row = 0;
    while row < table.len() {
        if table[row].address.index == 0x6502 {
            table[row].preset = Preset::Number(1 << (mode - 1));
        }
        row += 1;
    }
    table
}

/// 1xxxh, communication profile (CiA 301), and what is behind it.
const PARTS: &[&[Entry]] = &[
    &device(0x0002_0192),
    &errors::<5>(),
    &sync_and_name("CiA 402 CSP"),
    &[
        rw(0x100C, 0, "Guard time", U16).default(0).unit("ms"),
        rw(0x100D, 0, "Life time factor", U8).default(0),
    ],
    EMCY_HEARTBEAT_IDENTITY,
    ERROR_BEHAVIOUR,
    SDO_SERVER,
    &r_pdo(1, 0, 255),
    &r_pdo(2, 0, 1),
    &r_pdo(3, UNUSED, 1),
    &r_pdo(4, UNUSED, 1),
    &r_pdo_mapping::<9>(1, &[0x6040_0010]),
    &r_pdo_mapping::<9>(2, &[0x6040_0010, 0x607A_0020]),
    &r_pdo_mapping::<9>(3, &[]),
    &r_pdo_mapping::<9>(4, &[]),
    &t_pdo(1, 0, 255),
    &t_pdo(2, 0, 1),
    &t_pdo(3, UNUSED, 1),
    &t_pdo(4, UNUSED, 1),
    &t_pdo_mapping::<9>(1, &[0x6041_0010]),
    &t_pdo_mapping::<9>(2, &[0x6041_0010, 0x6064_0020]),
    &t_pdo_mapping::<9>(3, &[]),
    &t_pdo_mapping::<9>(4, &[]),
    PROFILE,
];

/// 6xxxh: drive profile (CiA 402).
#[rustfmt::skip]
const PROFILE: &[Entry] = &[
    rw(0x6007, 0, "Abort connection option code", I16).range(0, 3).default(1),
    ro(0x603F, 0, "Error code", U16).default(0).t_pdo(),
    rw(0x6040, 0, "Controlword", U16).default(0).r_pdo(),
    ro(0x6041, 0, "Statusword", U16).t_pdo(),
    rw(0x6042, 0, "vl target velocity", I16).default(0).unit("1/min").r_pdo(),
    ro(0x6043, 0, "vl velocity demand", I16).unit("1/min").t_pdo(),
    ro(0x6044, 0, "vl control effort", I16).unit("1/min").t_pdo(),
    ro(0x6046, 0, "vl velocity min max amount: number", U8).default(2),
    rw(0x6046, 1, "vl velocity min amount", U32).assumed(0).unit("1/min").r_pdo(),
    rw(0x6046, 2, "vl velocity max amount", U32).assumed(3000).unit("1/min").r_pdo(),
    ro(0x6048, 0, "vl velocity acceleration: number", U8).default(2),
    rw(0x6048, 1, "vl acceleration delta speed", U32).assumed(3000).unit("1/min").r_pdo(),
    rw(0x6048, 2, "vl acceleration delta time", U16).assumed(3).unit("s").r_pdo(),
    ro(0x6049, 0, "vl velocity deceleration: number", U8).default(2),
    rw(0x6049, 1, "vl deceleration delta speed", U32).assumed(3000).unit("1/min").r_pdo(),
    rw(0x6049, 2, "vl deceleration delta time", U16).assumed(3).unit("s").r_pdo(),
    ro(0x604A, 0, "vl velocity quick stop: number", U8).default(2),
    rw(0x604A, 1, "vl quick stop delta speed", U32).assumed(6000).unit("1/min").r_pdo(),
    rw(0x604A, 2, "vl quick stop delta time", U16).assumed(1).unit("s").r_pdo(),
    ro(0x604C, 0, "vl dimension factor: number", U8).default(2),
    rw(0x604C, 1, "vl dimension factor numerator", I32).default(1),
    rw(0x604C, 2, "vl dimension factor denominator", I32).default(1),
    rw(0x605A, 0, "Quick stop option code", I16).range(0, 6).default(2),
    rw(0x605E, 0, "Fault reaction option code", I16).range(0, 2).default(2),
    rw(0x6060, 0, "Modes of operation", I8).default(0).r_pdo(),
    ro(0x6061, 0, "Modes of operation display", I8).default(0).t_pdo(),
    ro(0x6064, 0, "Position actual value", I32).unit("increments").t_pdo(),
    rw(0x6065, 0, "Following error window", U32).assumed(0xFFFF_FFFF).unit("increments").r_pdo(),
    rw(0x6066, 0, "Following error time out", U16).assumed(0).unit("ms"),
    rw(0x6067, 0, "Position window", U32).assumed(1000).unit("increments").r_pdo(),
    rw(0x6068, 0, "Position window time", U16).assumed(0).unit("ms"),
    ro(0x606C, 0, "Velocity actual value", I32).unit("increments/s").t_pdo(),
    ro(0x6076, 0, "Motor rated torque", U32).assumed(1400).unit("mNm"),
    ro(0x6077, 0, "Torque actual value", I16).unit("0.1 %").t_pdo(),
    rw(0x607A, 0, "Target position", I32).default(0).unit("increments").r_pdo(),
    ro(0x607D, 0, "Software position limit: number", U8).default(2),
    rw(0x607D, 1, "Min position limit", I32).assumed(-2_147_483_648).unit("increments"),
    rw(0x607D, 2, "Max position limit", I32).assumed(2_147_483_647).unit("increments"),
    rw(0x6083, 0, "Profile acceleration", U32).range(1, 0xFFFF_FFFF).assumed(1_048_576_000).unit("increments/s^2").r_pdo(),
    rw(0x6084, 0, "Profile deceleration", U32).range(1, 0xFFFF_FFFF).assumed(1_048_576_000).unit("increments/s^2").r_pdo(),
    rw(0x6085, 0, "Quick stop deceleration", U32).range(1, 0xFFFF_FFFF).assumed(1_048_576_000).unit("increments/s^2"),
    ro(0x608F, 0, "Position encoder resolution: number", U8).default(2),
    ro(0x608F, 1, "Encoder increments", U32).assumed(1_048_576),
    ro(0x608F, 2, "Motor revolutions", U32).assumed(1),
    ro(0x6091, 0, "Gear ratio: number", U8).default(2),
    ro(0x6091, 1, "Motor shaft revolutions", U32).default(1),
    ro(0x6091, 2, "Driving shaft revolutions", U32).default(1),
    rw(0x60B2, 0, "Torque offset", I16).default(0).unit("0.1 %").r_pdo(),
    ro(0x60C1, 0, "Interpolation data record: number", U8).default(1),
    rw(0x60C1, 1, "Interpolation data record 1", I32).default(0).unit("increments").r_pdo(),
    ro(0x60C2, 0, "Interpolation time period: number", U8).default(2),
    rw(0x60C2, 1, "Interpolation time period value", U8).range(1, 255).default(1),
    rw(0x60C2, 2, "Interpolation time index", I8).range(-6, 0).default(-3),
    ro(0x60F4, 0, "Following error actual value", I32).unit("increments").t_pdo(),
    rw(0x60FF, 0, "Target velocity", I32).default(0).unit("increments/s").r_pdo(),
    ro(0x6502, 0, "Supported drive modes", U32).t_pdo(),
];
