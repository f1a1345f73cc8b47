//! What follows from single objects of the drive, each by its place in the manual.

use crate::common::lxm32m::{Bench, drive, enabled};
use crate::common::{X_END, id, ms, rpm, set, status, wait_for};
use syncline_canopen::cia402::{State, Statusword};
use syncline_canopen::sdo::AbortCode;
use syncline_canopen::time::Duration;
use syncline_drives::twin::lxm32m::{Switches, TwinConfig};
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

/// Where a movement of another mode follows at once, x_end does not rise in between (1347), and does where none follows:
/// its T_PDO1 shows that every 250 µs.
#[test]
fn x_end_does_not_rise_between_two_modes() {
    for (mode, index, sub, value) in [
        (3, 0x60FF, 0, -300),
        (4, 0x6071, 0, -100),
        (-1, 0x301B, 0x09, 2),
        (-2, 0x301B, 0x12, 1),
    ] {
        for follows in [true, false] {
            let before = if mode == 3 { -1 } else { 3 };
            let (start, from) = match before {
                3 => ((0x60FF, 0), 600),
                _ => ((0x301B, 0x09), 5),
            };
            let mut bench = drive(before);
            bench.twin().set_pulse_frequency(-50_000.0);
            set(&mut bench, 0x1800, 2, 1);
            bench.send(0, &[1, 1]);
            set(&mut bench, start.0, start.1, from);
            bench.wait(ms(500));
            let told = bench.log.len();
            set(&mut bench, 0x6060, 0, mode);
            if follows {
                set(&mut bench, index, sub, value);
            }
            for _ in 0..8000 {
                bench.sync();
                bench.wait(Duration::from_micros(250));
            }
            let words = bench.received(told, 0x181);
            let rises = |word: &Vec<u8>| u16::from_le_bytes([word[0], word[1]]) & X_END != 0;
            assert!(!words.is_empty());
            assert_eq!(
                words.iter().any(rises),
                !follows,
                "mode {mode}: {words:02X?}"
            );
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

fn bit_11(bench: &mut Bench) -> bool {
    status(bench) & Statusword::INTERNAL_LIMIT != 0
}

/// Statusword bit 11 tells what 301Bh:1E chooses (1335), digital outputs tell the same (2257-2261, 2300).
#[test]
fn windows_are_told_by_bit_11_and_by_outputs() {
    let outputs = |bench: &mut Bench| bench.number(1, 0x3008, 0x10) & 1;
    // Which window, which output, which object, a value that takes in a run at 60 rpm and one that does not.
    for (chosen, output, sub, wide, narrow) in [
        (1, 8, 0x1C, 300, 1),
        (2, 7, 0x1B, 70, 50),
        (3, 5, 0x3F, REVOLUTION, 20),
        (4, 6, 0x1A, 70, 0),
    ] {
        let mut bench = drive(3);
        set(&mut bench, 0x3007, 0x09, output);
        set(&mut bench, 0x60FF, 0, 60);
        bench.wait(ms(1000));
        set(&mut bench, 0x3006, sub, wide);
        bench.wait(ms(1));
        assert!(!bit_11(&mut bench), "nothing is chosen");
        set(&mut bench, 0x301B, 0x1E, chosen);
        assert!(bit_11(&mut bench), "{chosen} within");
        assert_eq!(outputs(&mut bench), 1);
        set(&mut bench, 0x3006, sub, narrow);
        // The noise of a current or a velocity may be within for an instant.
        set(&mut bench, 0x3006, 0x1D, 20);
        bench.wait(ms(100));
        assert!(!bit_11(&mut bench), "{chosen} beyond");
        assert_eq!(outputs(&mut bench), 0);
        // Within it is for the time of 3006h:1D before it is told.
        set(&mut bench, 0x3006, 0x1D, 200);
        set(&mut bench, 0x3006, sub, wide);
        bench.wait(ms(190));
        assert!(!bit_11(&mut bench), "{chosen} not yet");
        bench.wait(ms(20));
        assert!(bit_11(&mut bench), "{chosen} long enough");
    }
    let mut bench = drive(1);
    let invalid = Err(AbortCode::InvalidValue.code());
    assert_eq!(bench.write(1, 0x301B, 0x1E, &[10, 0]), invalid);
}

/// A channel of the position register, and a limit switch, at bit 11 (2486).
#[test]
fn bit_11_tells_positions_and_switches() {
    let mut bench = enabled(
        TwinConfig {
            switches: Switches {
                positive_limit: Some(0.5),
                ..Switches::default()
            },
            ..TwinConfig::new(id(1))
        },
        1,
    );
    set(&mut bench, 0x300B, 3, 1);
    set(&mut bench, 0x300B, 0x0A, REVOLUTION / 4);
    let mut told = |target: i32, chosen: i32| {
        set(&mut bench, 0x301B, 0x1E, chosen);
        set(&mut bench, 0x607A, 0, target);
        bench.controlword(1, 0x000F);
        bench.controlword(1, 0x001F);
        bench.wait(ms(2000));
        bit_11(&mut bench)
    };
    assert_eq!((told(0, 6), told(REVOLUTION / 3, 6)), (false, true));
    assert_eq!((told(0, 9), told(REVOLUTION, 9)), (false, true));
}

/// What has two objects has one value (2257, 2281-2283, 2909, 2910).
#[test]
fn a_window_is_the_same_in_both_of_its_objects() {
    let mut bench = drive(1);
    for (index, sub, user) in [(0x6065, 0, 0x3E), (0x6067, 0, 0x40)] {
        assert_eq!(bench.number(1, index, sub), bench.number(1, 0x3006, user));
        set(&mut bench, index, sub, 321);
        assert_eq!(bench.number(1, 0x3006, user), 321);
        set(&mut bench, 0x3006, user, 123);
        assert_eq!(bench.number(1, index, sub), 123);
    }
    set(&mut bench, 0x3006, 0x19, 5000);
    assert_eq!(bench.read_i32(1, 0x3006, 0x3F), REVOLUTION / 2);
    set(&mut bench, 0x3006, 0x3F, REVOLUTION / 4);
    assert_eq!(bench.number(1, 0x3006, 0x19), 2500);
}

/// A velocity that stays behind is an error of the class that 3005h:3C says (2237, 2288, 2292, 2293).
#[test]
fn a_velocity_that_stays_behind_is_an_error() {
    for (response, state) in [
        (0, State::OperationEnabled),
        (1, State::QuickStopActive),
        (3, State::Fault),
    ] {
        let mut bench = drive(3);
        set(&mut bench, 0x6065, 0, 100 * REVOLUTION);
        set(&mut bench, 0x3006, 0x4B, 100);
        set(&mut bench, 0x3006, 0x4C, 50);
        set(&mut bench, 0x3005, 0x3C, response);
        set(&mut bench, 0x60FF, 0, 150);
        bench.wait(ms(1000));
        assert_eq!(bench.twin().state(), State::OperationEnabled);
        bench.twin().shaft_mut().unwrap().block(true);
        bench.wait(ms(40));
        assert!((100..=150).contains(&bench.read_i32(1, 0x301E, 0x2C)));
        assert_eq!(bench.twin().state(), State::OperationEnabled, "not yet");
        bench.wait(ms(40));
        assert_eq!(bench.twin().state(), state);
        assert_eq!(status(&mut bench) & Statusword::WARNING != 0, response == 0);
    }
}
