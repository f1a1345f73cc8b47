//! The object dictionary of an absolute rotary encoder as the profile has it: CiA 406, on CANopen (CiA 301).
//!
//! `default` is a value that a profile gives; `assumed` one that it leaves to the maker.

use super::cia301::{
    EMCY_HEARTBEAT_IDENTITY, SDO_SERVER, UNUSED, device, errors, join, rows, sync_and_name, t_pdo,
    t_pdo_mapping,
};
use syncline_canopen::dictionary::DataType::{U16, U32};
use syncline_canopen::dictionary::{Entry, ro, rw, table};

/// The table, in ascending order.
pub static CIA406: &[Entry] = &table(join::<{ rows(PARTS) }>(PARTS));

/// 1xxxh, communication profile (CiA 301), and what is behind it.
const PARTS: &[&[Entry]] = &[
    &device(0x0002_0196),
    &errors::<2>(),
    &sync_and_name("CiA 406"),
    EMCY_HEARTBEAT_IDENTITY,
    SDO_SERVER,
    &t_pdo(1, 0, 254),
    &t_pdo(2, 0, 1),
    &t_pdo(3, UNUSED, 1),
    &t_pdo(4, UNUSED, 1),
    &t_pdo_mapping::<3>(1, &[0x6004_0020]),
    &t_pdo_mapping::<3>(2, &[0x6004_0020]),
    &t_pdo_mapping::<3>(3, &[]),
    &t_pdo_mapping::<3>(4, &[]),
    PROFILE,
];

/// 6xxxh: encoder profile (CiA 406).
#[rustfmt::skip]
const PROFILE: &[Entry] = &[
    rw(0x6000, 0, "Operating parameters", U16).default(0),
    rw(0x6001, 0, "Measuring units per revolution", U32).assumed(8192).unit("steps"),
    rw(0x6002, 0, "Total measuring range", U32).assumed(8192 * 4096).unit("steps"),
    rw(0x6003, 0, "Preset value", U32).default(0).unit("steps"),
    ro(0x6004, 0, "Position value", U32).unit("steps").t_pdo(),
    ro(0x6500, 0, "Operating status", U16).default(0),
    ro(0x6501, 0, "Single-turn resolution", U32).assumed(8192).unit("steps"),
    ro(0x6502, 0, "Number of distinguishable revolutions", U16).assumed(4096),
    ro(0x6503, 0, "Alarms", U16).default(0).t_pdo(),
];
