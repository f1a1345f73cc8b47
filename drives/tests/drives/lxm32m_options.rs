//! Options of the drive that change how it moves and how it is switched off, each by its place in the manual.

use crate::common::lxm32m::{Bench, drive, enabled};
use crate::common::{TARGET_REACHED, X_END, id, ms, rpm, set, wait_for};
use proptest::prelude::*;
use syncline_canopen::cia402::State;
use syncline_canopen::nmt::Command;
use syncline_canopen::sdo::AbortCode;
use syncline_drives::twin::SimulatedDevice;
use syncline_drives::twin::lxm32m::{Switches, TwinConfig};

/// usr_p in a revolution.
const REVOLUTION: i32 = 16_384;

/// A movement is started by the parameter if the source is set to it (1487, 1521).
#[test]
fn a_target_counts_while_the_parameter_is_its_source() {
    for (mode, source, target, value) in [(3, 0x39, 0x60FF, 600), (4, 0x38, 0x6071, 200)] {
        let mut bench = drive(mode);
        assert_eq!(bench.number(1, 0x301B, source), 1);
        for other in [0, 2, 3] {
            set(&mut bench, 0x301B, source, other);
            set(&mut bench, target, 0, value);
            bench.wait(ms(200));
            assert!(rpm(&mut bench).abs() < 1.0, "mode {mode} source {other}");
        }
        set(&mut bench, 0x301B, source, 1);
        set(&mut bench, target, 0, value);
        bench.wait(ms(300));
        let before = rpm(&mut bench);
        assert!(before > 100.0);
        // In motion another source takes the target away.
        set(&mut bench, 0x301B, source, 2);
        bench.wait(ms(500));
        assert!(rpm(&mut bench) < 0.8 * before, "mode {mode}");
    }
}

/// 3006h:1 sets both ramps (2240), 3006h:2B takes them away (2269).
#[test]
fn ramps_of_velocity_can_be_set_together_and_taken_away() {
    let mut bench = drive(3);
    set(&mut bench, 0x3006, 0x01, 30);
    assert_eq!(
        (bench.number(1, 0x6083, 0), bench.number(1, 0x6084, 0)),
        (300, 300)
    );
    let after_50_ms = |bench: &mut Bench| {
        set(bench, 0x60FF, 0, 100);
        bench.wait(ms(50));
        let reference = bench.read_i32(1, 0x606B, 0);
        set(bench, 0x60FF, 0, 0);
        wait_for(bench, X_END, 2);
        reference
    };
    assert!((10..=20).contains(&after_50_ms(&mut bench)));
    set(&mut bench, 0x3006, 0x2B, 0);
    assert_eq!(after_50_ms(&mut bench), 100);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// 3006h:D limits the jerk of Profile Velocity (2249): in ms, as long as the acceleration takes to come, the ramp takes
    /// longer.
    #[test]
    fn the_jerk_of_a_velocity_ramp_can_be_limited(time in 0i32..128, speed in 100i32..1000, ramp in 500i32..2000) {
        let mut bench = drive(3);
        set(&mut bench, 0x3006, 0x0D, time);
        set(&mut bench, 0x6083, 0, ramp);
        set(&mut bench, 0x60FF, 0, speed);
        let begun = bench.now();
        while bench.read_i32(1, 0x606B, 0) != speed {
            bench.wait(ms(1));
            prop_assert!(bench.now() - begun < ms(5000));
        }
        let took = (bench.now() - begun).as_secs_f64() * 1000.0;
        let [speed, ramp, time] = [speed, ramp, time].map(f64::from);
        let alone = speed / ramp * 1000.0;
        let expected = if alone >= time { alone + time } else { 2.0 * (alone * time).sqrt() };
        // Half a usr_v before its end it shows the speed, and answers take a while.
        let early = if time > 0.0 { (2.0 * 0.5 / ramp * 1000.0 * time).sqrt() } else { 1.0 };
        prop_assert!(took <= expected + 3.0 && took >= expected - early - 1.0, "{took} of {expected} ms");
    }

    /// 301Fh:A to C tell the greatest user values as the scales have them (2574-2576): their increments are within 32
    /// bits, and no more are.
    #[test]
    fn the_greatest_user_values_follow_the_scales(numerator in 1i32..1000, denominator in 1i32..1_000_000) {
        let mut bench = Bench::one();
        let scale = f64::from(numerator) / f64::from(denominator);
        for (sub, [of, over], unit) in [
            (0x0A, [0x08, 0x07], 131_072.0),
            (0x0B, [0x22, 0x21], 131_072.0 / 60.0),
            (0x0C, [0x31, 0x30], 131_072.0 / 60.0),
        ] {
            set(&mut bench, 0x3006, of, numerator);
            set(&mut bench, 0x3006, over, denominator);
            let most = f64::from(bench.read_i32(1, 0x301F, sub));
            let within = |value: f64| value * scale * unit <= f64::from(i32::MAX);
            prop_assert!(within(most), "301Fh:{sub:X} {most}");
            prop_assert!(!within(most + 1.0) || most == f64::from(i32::MAX), "301Fh:{sub:X} {most}");
        }
    }

    /// 60F2h says what a relative target counts from (2940), wherever the axis is on its way to another.
    #[test]
    fn a_relative_target_counts_from_what_is_chosen(
        option in 0i32..3,
        first in 10_000i32..100_000,
        second in -50_000i32..50_000,
        wait in 100u64..600,
    ) {
        let mut bench = drive(1);
        set(&mut bench, 0x60F2, 0, option);
        set(&mut bench, 0x6065, 0, 10 * REVOLUTION);
        for (index, value) in [(0x6081, 120), (0x6083, 2000), (0x6084, 2000)] {
            set(&mut bench, index, 0, value);
        }
        set(&mut bench, 0x607A, 0, first);
        bench.controlword(1, 0x001F);
        bench.wait(ms(wait));
        bench.controlword(1, 0x000F);
        set(&mut bench, 0x607A, 0, second);
        let (before, reference) = (bench.read_i32(1, 0x6064, 0), bench.read_i32(1, 0x301E, 0x0C));
        bench.write(1, 0x6040, 0, &0x007Fu16.to_le_bytes()).unwrap();
        let from = [first, reference, before][option as usize];
        wait_for(&mut bench, X_END | TARGET_REACHED, 20);
        let found = bench.read_i32(1, 0x6064, 0) - second;
        // Between reading and writing it goes on, 33 usr_p in a millisecond.
        let slack = if option == 0 { 16 } else { 150 };
        prop_assert!((found - from).abs() <= slack, "{found} from {from}, option {option}");
    }
}

#[test]
fn an_option_of_profile_position_that_is_not_there_is_refused() {
    let mut bench = drive(1);
    for option in [3u16, 4, 0x8000] {
        let refused = bench.write(1, 0x60F2, 0, &option.to_le_bytes());
        assert_eq!(refused, Err(AbortCode::InvalidValue.code()));
    }
}

/// 605Bh says what becomes of a movement when the power stage is switched off (2903).
#[test]
fn a_movement_is_braked_before_switching_off_if_that_is_chosen() {
    for (word, state) in [
        (0x0006, State::ReadyToSwitchOn),
        (0x0007, State::SwitchedOn),
        (0x0000, State::ReadyToSwitchOn),
    ] {
        for option in [0, 1] {
            let mut bench = drive(3);
            set(&mut bench, 0x605B, 0, option);
            set(&mut bench, 0x6084, 0, 600);
            set(&mut bench, 0x60FF, 0, 120);
            wait_for(&mut bench, TARGET_REACHED, 3);
            bench.controlword(1, word);
            assert_eq!(bench.twin().observe().is_powered, option == 1);
            // Half of the 200 ms that the ramp takes; the command may come again.
            bench.wait(ms(80));
            bench.controlword(1, word);
            assert_eq!(bench.twin().observe().is_powered, option == 1);
            if option == 1 {
                assert!(
                    (40.0..80.0).contains(&rpm(&mut bench)),
                    "{}",
                    rpm(&mut bench)
                );
                // No target starts a movement meanwhile.
                set(&mut bench, 0x60FF, 0, 500);
            }
            bench.wait(ms(200));
            assert_eq!(bench.twin().state(), state);
        }
    }
    // A command to enable takes it back, a quick stop goes before it.
    for (word, state) in [
        (0x000F, State::OperationEnabled),
        (0x000B, State::QuickStopActive),
    ] {
        let mut bench = drive(3);
        set(&mut bench, 0x605B, 0, 1);
        set(&mut bench, 0x60FF, 0, 120);
        wait_for(&mut bench, TARGET_REACHED, 3);
        bench.controlword(1, 0x0006);
        bench.controlword(1, word);
        bench.wait(ms(1000));
        assert_eq!(bench.twin().state(), state);
    }
}

/// Times that come to those of the holding brake (2204, 2205).
#[test]
fn the_holding_brake_takes_its_time_to_open_and_to_close() {
    for (time, waits) in [(-300, false), (0, false), (300, true)] {
        let mut bench = drive(1);
        set(&mut bench, 0x3005, 7, time);
        set(&mut bench, 0x3005, 8, time);
        bench.controlword(1, 0x0006);
        bench.wait(ms(250));
        assert_eq!(bench.twin().observe().is_powered, waits);
        bench.wait(ms(60));
        assert_eq!(bench.twin().state(), State::ReadyToSwitchOn);
        bench.controlword(1, 0x000F);
        bench.wait(ms(250));
        assert_eq!(bench.twin().observe().is_powered, !waits);
        bench.wait(ms(60));
        assert_eq!(bench.twin().state(), State::OperationEnabled);
    }
}

/// 3006h:C turns the direction of movement (2246) from the start after it was stored: position, velocity,
/// torque, and what is captured.
#[test]
fn the_direction_of_movement_can_be_turned() {
    let mut bench = enabled(
        TwinConfig {
            initial_position: 131_072 * 3,
            switches: Switches {
                captures: [Some(1.0..2.5), None],
                ..Switches::default()
            },
            ..TwinConfig::new(id(1))
        },
        3,
    );
    set(&mut bench, 0x3006, 0x0C, 1);
    assert!((bench.read_i32(1, 0x6064, 0) - 3 * REVOLUTION).abs() < 20);
    bench.controlword(1, 0x0006);
    set(&mut bench, 0x3004, 1, 1);
    bench.nmt(Command::ResetNode, 1);
    bench.wait(ms(50));
    assert!((bench.read_i32(1, 0x6064, 0) + 3 * REVOLUTION).abs() < 20);
    assert_eq!(bench.read_i32(1, 0x606C, 0), 0);
    set(&mut bench, 0x6060, 0, 3);
    set(&mut bench, 0x300A, 2, 1);
    set(&mut bench, 0x300A, 4, 1);
    bench.controlword(1, 0x000F);
    set(&mut bench, 0x6083, 0, 6000);
    set(&mut bench, 0x60FF, 0, 120);
    bench.wait(ms(10));
    let signed = |bench: &mut Bench, index| {
        let bytes = bench.read(1, index, 0).unwrap();
        i16::from_le_bytes(bytes.try_into().unwrap())
    };
    assert!(signed(&mut bench, 0x6077) > 100, "it speeds up");
    bench.wait(ms(500));
    assert!((rpm(&mut bench) + 120.0).abs() < 3.0, "{}", rpm(&mut bench));
    assert!((115..=125).contains(&bench.read_i32(1, 0x606C, 0)));
    assert!(bench.twin().observe().position < 2.5);
    let captured = bench.read_i32(1, 0x300A, 6);
    assert!((captured + 5 * REVOLUTION / 2).abs() <= 1, "{captured}");
}
