//! The operating modes from the bus: start, monitoring bits, ending, Halt, Quick Stop.

use crate::common::lxm32m::{Bench, drive, enabled};
use crate::common::{
    BIT_12, HALT, REF_OK, TARGET_REACHED, X_END, X_ERR, id, ms, rpm, set, status, wait_for,
};
use proptest::prelude::*;
use syncline_canopen::cia402::State;
use syncline_drives::twin::SimulatedDevice;
use syncline_drives::twin::lxm32m::{Switches, TwinConfig};

#[test]
fn velocity_reaches_its_target_along_its_ramp_and_halts() {
    let mut bench = drive(3);
    set(&mut bench, 0x6083, 0, 1000);
    set(&mut bench, 0x60FF, 0, -600);
    bench.wait(ms(300));
    assert!(
        (-330.0..-270.0).contains(&rpm(&mut bench)),
        "{}",
        rpm(&mut bench)
    );
    assert_eq!(status(&mut bench) & (TARGET_REACHED | X_END), 0);
    wait_for(&mut bench, TARGET_REACHED, 2);
    bench.wait(ms(100));
    assert!((rpm(&mut bench) + 600.0).abs() < 3.0);
    bench.controlword(1, 0x000F | HALT);
    assert_ne!(status(&mut bench) & HALT, 0);
    wait_for(&mut bench, X_END | TARGET_REACHED, 3);
    assert!(rpm(&mut bench).abs() < 3.0);
    assert_eq!(bench.twin().state(), State::OperationEnabled);
}

#[test]
fn velocity_is_capped_by_both_limits() {
    let mut bench = drive(3);
    for (index, sub) in [(0x607F, 0), (0x3011, 0x10)] {
        set(&mut bench, index, sub, 200);
        set(&mut bench, 0x60FF, 0, 3000);
        bench.wait(ms(1500));
        assert!((rpm(&mut bench) - 200.0).abs() < 3.0, "{}", rpm(&mut bench));
        set(&mut bench, 0x60FF, 0, 0);
        wait_for(&mut bench, X_END, 3);
        set(&mut bench, index, sub, 13_200);
    }
}

#[test]
fn torque_drives_and_quick_stop_holds() {
    let mut bench = drive(4);
    set(&mut bench, 0x6071, 0, -200);
    bench.wait(ms(100));
    let actual = bench.read(1, 0x6077, 0).unwrap();
    assert_eq!(i16::from_le_bytes(actual.try_into().unwrap()), -200);
    assert!(rpm(&mut bench) < -100.0);
    bench.controlword(1, 0x000B);
    wait_for(&mut bench, X_END | X_ERR, 3);
    bench.wait(ms(100));
    assert_eq!(bench.twin().state(), State::QuickStopActive);
    assert!(rpm(&mut bench).abs() < 3.0);
    bench.controlword(1, 0x000F);
    assert_eq!(status(&mut bench) & (X_ERR | 0x6F), 0x27);
}

#[test]
fn positions_absolute_relative_queued_and_at_once() {
    let mut bench = drive(1);
    for (index, value) in [(0x6081, 600), (0x6083, 6000), (0x6084, 6000)] {
        set(&mut bench, index, 0, value);
    }
    let go = |bench: &mut Bench, target: i32, bits: u16| {
        bench.controlword(1, 0x000F);
        set(bench, 0x607A, 0, target);
        bench
            .write(1, 0x6040, 0, &(0x001F | bits).to_le_bytes())
            .unwrap();
        bench.wait(ms(1));
        assert_ne!(status(bench) & BIT_12, 0);
    };
    let at = |bench: &mut Bench| {
        wait_for(bench, X_END | TARGET_REACHED, 10);
        bench.read_i32(1, 0x6064, 0)
    };
    go(&mut bench, 40_000, 0);
    assert_eq!(status(&mut bench) & (TARGET_REACHED | X_END), 0);
    assert!((at(&mut bench) - 40_000).abs() <= 16);
    go(&mut bench, -10_000, 0x40);
    assert!((at(&mut bench) - 30_000).abs() <= 16);
    // One target more is taken over and executed at the first one's end.
    go(&mut bench, 60_000, 0);
    go(&mut bench, 50_000, 0);
    assert!((at(&mut bench) - 50_000).abs() <= 16);
    // Immediately: the axis never gets near the first target.
    go(&mut bench, 500_000, 0);
    bench.wait(ms(200));
    go(&mut bench, 20_000, 0x20);
    assert!((at(&mut bench) - 20_000).abs() <= 16);
    // Bit 12 follows bit 4.
    bench.controlword(1, 0x000F);
    assert_eq!(status(&mut bench) & BIT_12, 0);
}

#[test]
fn change_on_set_point_does_not_stop_at_the_first_target() {
    let slowest = |bit_9: u16| {
        let mut bench = drive(1);
        for (index, value) in [(0x6081, 600), (0x6083, 6000), (0x6084, 6000)] {
            set(&mut bench, index, 0, value);
        }
        for target in [40_000, 80_000] {
            bench.controlword(1, 0x000F);
            set(&mut bench, 0x607A, 0, target);
            bench.controlword(1, 0x001F | bit_9);
        }
        let mut slowest = f64::MAX;
        while bench.twin().observe().position * 16384.0 < 70_000.0 {
            if (bench.twin().observe().position * 16384.0 - 40_000.0).abs() < 2_000.0 {
                slowest = slowest.min(rpm(&mut bench));
            }
            bench.wait(ms(1));
        }
        wait_for(&mut bench, X_END | TARGET_REACHED, 5);
        assert!((bench.read_i32(1, 0x6064, 0) - 80_000).abs() <= 16);
        slowest
    };
    assert!(slowest(0x0200) > 500.0);
    assert!(slowest(0) < 50.0);
}

#[test]
fn jog_by_step_then_on() {
    let mut bench = drive(-1);
    set(&mut bench, 0x3029, 3, 1);
    set(&mut bench, 0x3029, 7, 1000);
    set(&mut bench, 0x3029, 8, 300);
    set(&mut bench, 0x301B, 9, 2);
    bench.wait(ms(400));
    assert!((bench.read_i32(1, 0x6064, 0) + 1000).abs() <= 16);
    assert_eq!(
        status(&mut bench) & X_END,
        0,
        "the pause is part of the movement"
    );
    bench.wait(ms(800));
    assert!((rpm(&mut bench) + 60.0).abs() < 3.0, "{}", rpm(&mut bench));
    set(&mut bench, 0x301B, 9, 0);
    wait_for(&mut bench, X_END, 2);
}

/// D-51.
#[test]
fn both_directions_of_jog_at_once_are_none() {
    let mut bench = drive(-1);
    set(&mut bench, 0x301B, 9, 5);
    bench.wait(ms(300));
    assert!(rpm(&mut bench) > 100.0);
    set(&mut bench, 0x301B, 9, 7);
    wait_for(&mut bench, X_END, 2);
    set(&mut bench, 0x301B, 9, 3);
    bench.wait(ms(300));
    assert!(rpm(&mut bench).abs() < 3.0);
}

#[test]
fn gear_follows_the_pulse_source() {
    let mut bench = drive(-2);
    bench.twin().set_pulse_frequency(1000.0);
    set(&mut bench, 0x3026, 4, 100);
    set(&mut bench, 0x301B, 0x12, 1);
    bench.wait(ms(1000));
    let (start, at) = (bench.twin().observe().position, bench.now());
    bench.wait(ms(1000));
    let moved = (bench.twin().observe().position - start) * 131_072.0;
    let seconds = (bench.now() - at).as_secs_f64();
    assert!((moved - 100_000.0 * seconds).abs() < 300.0, "{moved}");
    set(&mut bench, 0x301B, 0x12, 0);
    wait_for(&mut bench, X_END, 2);
    // Compensated: pulses that came meanwhile are made up for.
    let before = bench.twin().observe().position;
    bench.wait(ms(500));
    set(&mut bench, 0x301B, 0x12, 2);
    bench.wait(ms(50));
    bench.twin().set_pulse_frequency(0.0);
    bench.wait(ms(2000));
    let moved = (bench.twin().observe().position - before) * 131_072.0;
    assert!(moved > 50_000.0, "{moved}, {:?}", bench.twin().state());
}

/// 3026h:5 bars a direction; 301Fh:D shows what is still to be made up for.
#[test]
fn gear_may_be_barred_in_one_direction() {
    let mut bench = drive(-2);
    set(&mut bench, 0x3026, 4, 100);
    set(&mut bench, 0x3026, 5, 1);
    set(&mut bench, 0x301B, 0x12, 1);
    bench.twin().set_pulse_frequency(-1000.0);
    bench.wait(ms(500));
    assert!(bench.twin().observe().position.abs() < 0.01);
    // What was barred is lost, not made up for.
    bench.twin().set_pulse_frequency(1000.0);
    bench.wait(ms(30));
    assert!(bench.read_i32(1, 0x301F, 0x0D) > 0);
    bench.wait(ms(970));
    let moved = bench.twin().observe().position * 131_072.0;
    assert!((80_000.0..120_000.0).contains(&moved), "{moved}");
    assert_eq!(bench.read_i32(1, 0x301F, 0x0D), 0);
}

/// A logical operator joins two conditions; 302Dh:6, :7, :B and :1F tell where the sequence is.
#[test]
fn a_sequence_waits_for_two_conditions() {
    for (operator, both) in [(1, true), (2, false)] {
        let mut bench = drive(-3);
        let mut data_set = |number: i32, fields: [i32; 9], second: [i32; 3]| {
            set(&mut bench, 0x302D, 0x10, number);
            let subs = [0x11, 0x12, 0x13, 0x14, 0x15, 0x16, 0x17, 0x18, 0x19];
            for (sub, value) in subs.into_iter().zip(fields) {
                set(&mut bench, 0x302D, sub, value);
            }
            for (sub, value) in [0x1A, 0x1C, 0x1D].into_iter().zip(second) {
                set(&mut bench, 0x302D, sub, value);
            }
        };
        // After 100 ms, and or or at an edge of bit 4.
        let first = [2, 6000, 600, 1000, 6000, 1, 2, 1, 100];
        data_set(1, first, [operator, 2, 0]);
        data_set(2, [3, 6000, 300, 0, 6000, 1, 1, 9, 0], [0, 0, 0]);
        let number = |bench: &mut Bench, sub: u8| bench.read_u16(1, 0x302D, sub) as i16;
        assert_eq!(
            (number(&mut bench, 0x1F), number(&mut bench, 0x0F)),
            (2, 128)
        );
        set(&mut bench, 0x301B, 0x0A, 1);
        assert_eq!(number(&mut bench, 6), -1);
        bench.controlword(1, 0x007F);
        assert_eq!((number(&mut bench, 6), number(&mut bench, 7)), (1, 2));
        bench.wait(ms(1000));
        assert_eq!(number(&mut bench, 6), if both { 1 } else { 2 });
        bench.controlword(1, 0x000F);
        bench.controlword(1, 0x007F);
        bench.wait(ms(200));
        assert_eq!(number(&mut bench, 6), 2);
        bench.controlword(1, 0x000F | HALT);
        wait_for(&mut bench, X_END, 3);
        assert_eq!((number(&mut bench, 6), number(&mut bench, 0x0B)), (-1, 2));
    }
}

#[test]
fn a_sequence_of_data_sets() {
    let mut bench = drive(-3);
    let mut data_set = |number: i32, fields: [i32; 9]| {
        set(&mut bench, 0x302D, 0x10, number);
        for (sub, value) in (0x11..).zip(fields) {
            set(&mut bench, 0x302D, sub, value);
        }
    };
    // type, acceleration, velocity, target, deceleration, transition, next, condition, value
    data_set(5, [1, 6000, 600, 20_000, 6000, 1, 6, 1, 200]);
    data_set(6, [2, 6000, 600, 10_000, 6000, 0, 0, 0, 0]);
    set(&mut bench, 0x302D, 0x10, 5);
    assert_eq!(bench.read_i32(1, 0x302D, 0x14), 20_000);
    set(&mut bench, 0x301B, 0x0A, 5);
    // The single data set, then the sequence from it.
    bench.controlword(1, 0x001F);
    wait_for(&mut bench, X_END, 5);
    assert!((bench.read_i32(1, 0x6064, 0) - 20_000).abs() <= 16);
    assert_eq!(status(&mut bench) & TARGET_REACHED, 0);
    bench.controlword(1, 0x000F);
    bench.controlword(1, 0x007F);
    wait_for(&mut bench, X_END | TARGET_REACHED, 5);
    let at = bench.read_i32(1, 0x6064, 0);
    assert!((at - 30_000).abs() <= 16, "{at}");
}

#[test]
fn another_mode_takes_over_at_standstill() {
    let mut bench = drive(3);
    set(&mut bench, 0x60FF, 0, 300);
    bench.wait(ms(1000));
    bench.write(1, 0x6060, 0, &[1]).unwrap();
    assert_eq!(bench.read(1, 0x6061, 0).unwrap(), [3]);
    wait_for(&mut bench, X_END, 2);
    bench.wait(ms(10));
    assert_eq!(bench.read(1, 0x6061, 0).unwrap(), [1]);
    assert!(rpm(&mut bench).abs() < 3.0);
}

// ---- homing ----

/// Switches: LIMN below -3, REF 0.3…0.8, LIMP above 3.4; index pulses at whole revolutions.
fn homing(method: u8, start: f64) -> Bench {
    let mut bench = enabled(
        TwinConfig {
            initial_position: (start * 131_072.0) as i64,
            switches: Switches {
                negative_limit: Some(-3.3),
                positive_limit: Some(3.4),
                reference: Some(0.3..0.8),
                ..Switches::default()
            },
            ..TwinConfig::new(id(1))
        },
        6,
    );
    for (index, sub, value) in [
        (0x6099, 1, 300),
        (0x6099, 2, 60),
        (0x6083, 0, 6000),
        (0x6084, 0, 6000),
        (0x3028, 7, 1024),
        (0x3028, 0x0B, 5000),
    ] {
        set(&mut bench, index, sub, value);
    }
    bench.write(1, 0x6098, 0, &[method]).unwrap();
    bench.controlword(1, 0x001F);
    bench
}

/// Where each method has its reference point, revolutions: an edge and the 1024/16384 beyond it,
/// or the index pulse beyond it.
const REFERENCE_POINTS: [(u8, f64); 22] = [
    (1, -3.0),
    (2, 3.0),
    (7, 0.0),
    (8, 1.0),
    (9, 0.0),
    (10, 1.0),
    (11, 1.0),
    (12, 0.0),
    (13, 1.0),
    (14, 0.0),
    (17, -3.3 + 0.0625),
    (18, 3.4 - 0.0625),
    (23, 0.3 - 0.0625),
    (24, 0.3 + 0.0625),
    (25, 0.8 - 0.0625),
    (26, 0.8 + 0.0625),
    (27, 0.8 + 0.0625),
    (28, 0.8 - 0.0625),
    (29, 0.3 + 0.0625),
    (30, 0.3 - 0.0625),
    (33, 0.0),
    (34, 0.0),
];

#[test]
fn every_method_finds_its_reference_point_from_everywhere() {
    for (method, point) in REFERENCE_POINTS {
        for start in [-1.6, 0.55, 2.2] {
            let point = match method {
                33 => f64::floor(start),
                34 => f64::ceil(start),
                _ => point,
            };
            let mut bench = homing(method, start);
            assert_eq!(
                status(&mut bench) & (X_END | BIT_12 | REF_OK),
                0,
                "{method}"
            );
            wait_for(&mut bench, X_END | BIT_12 | TARGET_REACHED | REF_OK, 30);
            let user = f64::from(bench.read_i32(1, 0x6064, 0)) - 5000.0;
            let actual = bench.twin().observe().position;
            let referenced = actual - user / 16384.0;
            assert!(
                (referenced - point).abs() < 2e-3,
                "method {method} from {start}: {referenced}, expected {point}"
            );
            assert!(
                (actual - point).abs() < 5e-3,
                "method {method}: it rests there"
            );
        }
    }
}

#[test]
fn position_setting_moves_nothing() {
    let mut bench = homing(35, 1.25);
    set(&mut bench, 0x301B, 0x16, 777);
    bench.controlword(1, 0x000F);
    bench.controlword(1, 0x001F);
    wait_for(&mut bench, X_END | BIT_12 | TARGET_REACHED | REF_OK, 1);
    assert!((bench.read_i32(1, 0x6064, 0) - 777).abs() <= 1);
    // Bit 15 outlives the power stage (1351).
    bench.controlword(1, 0x0000);
    assert_ne!(status(&mut bench) & REF_OK, 0);
    assert!((bench.twin().observe().position - 1.25).abs() < 1e-3);
}

#[test]
fn methods_that_the_manual_does_not_define_or_that_find_nothing_fail() {
    for method in [3, 15, 19, 31] {
        let mut bench = homing(method, 0.0);
        assert_eq!(bench.twin().state(), State::QuickStopActive, "{method}");
        assert_eq!(status(&mut bench) & (X_ERR | REF_OK), X_ERR);
    }
    let mut bench = drive(6);
    bench.write(1, 0x6098, 0, &[17]).unwrap();
    bench.controlword(1, 0x001F);
    assert_eq!(
        bench.twin().state(),
        State::QuickStopActive,
        "no switch is fitted"
    );
    bench.controlword(1, 0x0000);
    bench.controlword(1, 0x0080);
    bench.controlword(1, 0x0000);
    assert_eq!(bench.twin().state(), State::ReadyToSwitchOn);
}

#[test]
fn a_limit_switch_stops_a_profile_movement() {
    let mut bench = homing(35, 1.0);
    bench.controlword(1, 0x000F);
    bench.write(1, 0x6060, 0, &[3]).unwrap();
    set(&mut bench, 0x60FF, 0, 300);
    wait_for(&mut bench, X_ERR | X_END, 5);
    assert_eq!(bench.twin().state(), State::QuickStopActive);
    assert!((3.3..3.9).contains(&bench.twin().observe().position));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    /// However far the motor stays behind, it is stopped at the first of two targets before the second one begins (1569),
    /// and only the second one counts as reached.
    #[test]
    fn a_target_that_waits_begins_where_the_motor_stands_at_the_first(
        first in 5_000i32..30_000,
        back in 2_000i32..30_000,
        speed in 100i32..900,
        gain in 60i32..400,
        velocity_feed_forward in 1i32..900,
    ) {
        let mut bench = drive(1);
        for (index, sub, value) in [
            (0x6081, 0, speed),
            (0x6083, 0, 6000),
            (0x6084, 0, 6000),
            (0x3012, 3, gain),
            (0x3012, 6, velocity_feed_forward),
        ] {
            set(&mut bench, index, sub, value);
        }
        for target in [first, first - back] {
            bench.controlword(1, 0x000F);
            set(&mut bench, 0x607A, 0, target);
            bench.controlword(1, 0x001F);
        }
        bench.controlword(1, 0x000F);
        let mut nearest = f64::MAX;
        for _ in 0..20_000 {
            let off = bench.twin().observe().position * 16384.0 - f64::from(first);
            nearest = nearest.min(off.abs());
            bench.wait(ms(1));
            let shown = status(&mut bench);
            if shown & TARGET_REACHED != 0 {
                prop_assert_ne!(shown & X_END, 0);
                break;
            }
        }
        // The window of 6067h, by what the encoder tells, which has noise.
        prop_assert!(nearest <= 17.0, "{} usr_p off", nearest);
        let end = bench.read_i32(1, 0x6064, 0);
        prop_assert!((end - (first - back)).abs() <= 16, "{}", end);
    }
}
