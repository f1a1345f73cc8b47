//! What follows from single objects of the drive, each by its place in the manual.

use crate::common::lxm32m::drive;
use crate::common::{X_END, ms, rpm, set, status, wait_for};
use syncline_canopen::cia402::Statusword;
use syncline_canopen::sdo::AbortCode;
use syncline_drives::twin::{Disturbance, ErrorClass, SimulatedDevice};

/// usr_p in a revolution.
const REVOLUTION: i32 = 16_384;

/// Bit 7 stays for as long as 301Ch:B has the message, and is 0 at once after a fault reset (lxm32m 1319).
#[test]
fn a_warning_shows_for_as_long_as_it_is_there() {
    let mut bench = drive(1);
    // A blocked shaft, whose deviation stays between the warning's limit and the error's.
    set(&mut bench, 0x6065, 0, 10 * REVOLUTION);
    set(&mut bench, 0x3006, 0x29, 1);
    bench.twin().shaft_mut().unwrap().block(true);
    set(&mut bench, 0x607A, 0, REVOLUTION);
    bench.controlword(1, 0x001F);
    bench.wait(ms(3000));
    for _ in 0..20 {
        assert_ne!(status(&mut bench) & Statusword::WARNING, 0);
        assert_eq!(bench.number(1, 0x301C, 0x0B), 1);
        bench.wait(ms(50));
    }
    bench.twin().shaft_mut().unwrap().block(false);
    wait_for(&mut bench, X_END, 3);
    bench.wait(ms(1000));
    assert_eq!(bench.number(1, 0x301C, 0x0B), 0);
    assert_eq!(status(&mut bench) & Statusword::WARNING, 0);
    assert_eq!(bench.number(1, 0x301C, 0x0C), 1, "it is kept as latched");

    bench.twin().disturb(Disturbance::FaultPersists(true));
    bench
        .twin()
        .disturb(Disturbance::Fault(ErrorClass::Warning));
    bench.wait(ms(500));
    assert_ne!(status(&mut bench) & Statusword::WARNING, 0);
    bench.controlword(1, 0x008F);
    assert_eq!(status(&mut bench) & Statusword::WARNING, 0);
}

/// What starts a mode's movement is kept while the mode before brakes, whatever mode that was (1419, 1453,
/// 1487, 1521); of another mode than the one that is asked for it starts nothing.
#[test]
fn a_target_that_is_written_while_the_mode_before_brakes_is_kept() {
    for (mode, index, sub, value) in [
        (3, 0x60FF, 0, -300),
        (4, 0x6071, 0, -100),
        (-1, 0x301B, 0x09, 2),
        (-2, 0x301B, 0x12, 1),
    ] {
        for asked in [mode, 6] {
            let before = if mode == 3 { -1 } else { 3 };
            let (start, from) = match before {
                3 => ((0x60FF, 0), 600),
                _ => ((0x301B, 0x09), 5),
            };
            let mut bench = drive(before);
            bench.twin().set_pulse_frequency(-50_000.0);
            set(&mut bench, start.0, start.1, from);
            bench.wait(ms(500));
            assert!(rpm(&mut bench) > 100.0);
            set(&mut bench, 0x6060, 0, mode);
            set(&mut bench, index, sub, value);
            set(&mut bench, 0x6060, 0, asked);
            assert!(rpm(&mut bench) > 50.0, "it still brakes");
            bench.wait(ms(2000));
            assert_eq!(bench.read(1, 0x6061, 0).unwrap(), [asked as u8]);
            assert_eq!(rpm(&mut bench) < -10.0, asked == mode, "mode {mode}");
        }
    }
}

/// An identifier that CiA 301 keeps for another service is not taken into use, neither of a PDO nor of
/// SYNC, EMCY or the second SDO server (3528-3536: function code and node address can be written).
#[test]
fn restricted_identifiers_are_refused() {
    let mut bench = drive(1);
    let invalid = Err(AbortCode::InvalidValue.code());
    for (index, sub) in [(0x1400, 1), (0x1803, 1), (0x1201, 1)] {
        for id in [0u32, 0x7F, 0x101, 0x180, 0x581, 0x67F, 0x6E0, 0x701, 0x780] {
            let before = bench.number(1, index, sub);
            assert_eq!(bench.write(1, index, sub, &id.to_le_bytes()), invalid);
            assert_eq!(bench.number(1, index, sub), before);
            // Nobody uses it, nobody minds.
            let unused = 0x8000_0000 | id;
            assert_eq!(bench.write(1, index, sub, &unused.to_le_bytes()), Ok(()));
        }
        for id in [0x80u32, 0x100, 0x181, 0x580, 0x6DF, 0x700] {
            assert_eq!(
                bench.write(1, index, sub, &id.to_le_bytes()),
                Ok(()),
                "{id:X}"
            );
        }
    }
    assert_eq!(bench.write(1, 0x1005, 0, &0u32.to_le_bytes()), invalid);
}
