//! The object dictionary of the stepper controller TSP10-CBE: CiA 402 without store, heartbeat,
//! emergencies or SYNC.
//!
//! Numbers beside the rows are lines of the manual's text. It prints no subindex 0 of a record or an
//! array; those here are inferred, for nothing could be mapped without.

use syncline_canopen::dictionary::DataType::{I8, I16, I32, Text, U8, U16, U32};
use syncline_canopen::dictionary::{Entry, constant, ro, rw, table};

/// The table, in ascending order.
#[rustfmt::skip]
pub static TSP10: &[Entry] = &table([
    // 1xxxh: communication profile.
    constant(0x1000, 0, "Device type", U32).default(0x0004_0192), // 201
    ro(0x1001, 0, "Error register", U8), // 213
    ro(0x1002, 0, "Manufacturer status register", U32), // 231
    constant(0x1008, 0, "Manufacturer device name", Text(3)).default_text("TSP"), // 243
    constant(0x1009, 0, "Manufacturer hardware version", Text(3)).default_text("513"), // 253
    constant(0x100A, 0, "Manufacturer software version", Text(3)).default_text("060"), // 263
    ro(0x1018, 0, "Identity: number", U8).default(4).inferred(),
    constant(0x1018, 1, "Vendor ID", U32).default(0x0041_4853), // 284
    constant(0x1018, 2, "Product code", U32).default(21), // 290
    constant(0x1018, 3, "Revision number", U32).assumed(0), // 295
    constant(0x1018, 4, "Serial number", U32).assumed(0), // 302
    ro(0x1400, 0, "R_PDO1 parameter: number", U8).default(2).inferred(),
    ro(0x1400, 1, "COB-ID R_PDO1", U32).default_plus_node(0x200), // 317
    ro(0x1400, 2, "Transmission type R_PDO1", U8).default(255), // 322
    ro(0x1401, 0, "R_PDO2 parameter: number", U8).default(2).inferred(),
    ro(0x1401, 1, "COB-ID R_PDO2", U32).default_plus_node(0x300), // 337
    ro(0x1401, 2, "Transmission type R_PDO2", U8).default(255), // 342
    ro(0x1600, 0, "R_PDO1 mapping: number", U8).default(2).inferred(),
    constant(0x1600, 1, "R_PDO1 mapped object 1", U32).default(0x6040_0010), // 355
    constant(0x1600, 2, "R_PDO1 mapped object 2", U32).default(0x607A_0020), // 355
    ro(0x1601, 0, "R_PDO2 mapping: number", U8).default(2).inferred(),
    constant(0x1601, 1, "R_PDO2 mapped object 1", U32).default(0x6040_0010), // 373
    constant(0x1601, 2, "R_PDO2 mapped object 2", U32).default(0x60FF_0020), // 373
    ro(0x1800, 0, "T_PDO1 parameter: number", U8).default(2).inferred(),
    ro(0x1800, 1, "COB-ID T_PDO1", U32).default_plus_node(0x4000_0180), // 393
    ro(0x1800, 2, "Transmission type T_PDO1", U8).default(255), // 398
    ro(0x1801, 0, "T_PDO2 parameter: number", U8).default(2).inferred(),
    ro(0x1801, 1, "COB-ID T_PDO2", U32).default_plus_node(0x4000_0280), // 413
    ro(0x1801, 2, "Transmission type T_PDO2", U8).default(255), // 418
    ro(0x1A00, 0, "T_PDO1 mapping: number", U8).default(2).inferred(),
    constant(0x1A00, 1, "T_PDO1 mapped object 1", U32).default(0x6041_0010), // 431
    constant(0x1A00, 2, "T_PDO1 mapped object 2", U32).default(0x6064_0020), // 431
    ro(0x1A01, 0, "T_PDO2 mapping: number", U8).default(2).inferred(),
    constant(0x1A01, 1, "T_PDO2 mapped object 1", U32).default(0x6041_0010), // 449
    constant(0x1A01, 2, "T_PDO2 mapped object 2", U32).default(0x606C_0020), // 449
    // 2xxxh: the maker's own.
    ro(0x2001, 0, "Standby: number", U8).default(2).inferred(),
    rw(0x2001, 1, "Standby current", U16).range(0, 100).default(50).unit("%"), // 558
    rw(0x2001, 2, "Standby delay", U16).range(0, 1500).default(100).unit("ms"), // 550
    rw(0x2002, 0, "Common settings", U16).range(0, 3).default(0), // 572
    ro(0x2003, 0, "Functions of digital inputs: number", U8).default(10).inferred(),
    rw(0x2003, 1, "Function of DE1", I16).range(-14, 14).default(0), // 586
    rw(0x2003, 2, "Function of DE2", I16).range(-14, 14).default(1), // 605
    rw(0x2003, 3, "Function of DE3", I16).range(-14, 14).default(2), // 606
    rw(0x2003, 4, "Function of DE4", I16).range(-14, 14).default(3), // 607
    rw(0x2003, 5, "Function of DE5", I16).range(-14, 14).default(4), // 608
    rw(0x2003, 6, "Function of DE6", I16).range(-14, 14).default(0),
    rw(0x2003, 7, "Function of DE7", I16).range(-14, 14).default(0),
    rw(0x2003, 8, "Function of DE8", I16).range(-14, 14).default(0),
    rw(0x2003, 9, "Function of DE9", I16).range(-14, 14).default(0),
    rw(0x2003, 10, "Function of DE10", I16).range(-14, 14).default(0),
    // 6xxxh: drive profile (CiA 402).
    rw(0x6040, 0, "Controlword", U16).r_pdo(), // 631
    ro(0x6041, 0, "Statusword", U16).t_pdo(), // 645
    rw(0x6060, 0, "Modes of operation", I8).default(1), // 659
    ro(0x6061, 0, "Modes of operation display", I8), // 672
    ro(0x6062, 0, "Position demand value", I32).unit("steps"), // 691
    ro(0x6064, 0, "Position actual value", I32).unit("steps").t_pdo(), // 701
    ro(0x606C, 0, "Velocity actual value", I32).unit("steps/s").t_pdo(), // 783
    rw(0x6075, 0, "Motor rated current", U32).range(400, 7000).default(400).unit("mA"), // 474
    rw(0x607A, 0, "Target position", I32).unit("steps").r_pdo(), // 711
    rw(0x607C, 0, "Home offset", I32).default(0).unit("steps"), // 843
    rw(0x6081, 0, "Profile velocity", U32).range(1, 0xFFFF_FFFF).default(1).unit("steps/s"), // 721
    rw(0x6083, 0, "Profile acceleration", U32).range(23, 0xFFFF_FFFF).default(23).unit("steps/s^2"), // 731
    rw(0x6084, 0, "Profile deceleration", U32).range(23, 0xFFFF_FFFF).default(23).unit("steps/s^2"), // 741
    rw(0x6085, 0, "Quick stop deceleration", U32).unit("steps/s^2"), // 751
    ro(0x608F, 0, "Position encoder resolution: number", U8).default(2).inferred(),
    rw(0x608F, 1, "Encoder increments", U32).default(0), // 496
    constant(0x608F, 2, "Motor revolutions", U32).default(1), // 502
    ro(0x6092, 0, "Feed constant: number", U8).default(2).inferred(),
    rw(0x6092, 1, "Feed", U32).default(10_000).unit("steps"), // 520
    rw(0x6092, 2, "Shaft revolutions", U32).default(1), // 526
    rw(0x6098, 0, "Homing method", I8).default(35), // 853
    ro(0x6099, 0, "Homing speeds: number", U8).default(2).inferred(),
    rw(0x6099, 1, "Fast homing speed", U32).range(1, 0xFFFF_FFFF).default(1).unit("steps/s"), // 881
    ro(0x6099, 2, "Slow homing speed", U32).default(1).unit("steps/s"), // 887
    rw(0x609A, 0, "Homing acceleration", U32).range(23, 0xFFFF_FFFF).default(23).unit("steps/s^2"), // 892
    rw(0x60A8, 0, "SI unit position", U32).default(0x00AC_0000), // 538
    rw(0x60FF, 0, "Target velocity", I32).unit("steps/s").r_pdo(), // 791
]);
