//! The controller's movements: profile position and velocity, homing, the manufacturer's modes.

use crate::common::tlc5xx::{
    ACKNOWLEDGED, BIT_13, DEVICE_STATE, ENDED, FAILED, INVALID, MAXIMUM_BELOW_MINIMUM, TOO_HIGH,
    config, drive, enabled, is_at, of, position, reach, set, switches, until, with,
};
use crate::common::{Bench, HALT, TARGET_REACHED, id, ms, rpm, status};
use proptest::prelude::*;
use syncline_canopen::cia402::State;
use syncline_canopen::nmt::Command;
use syncline_drives::twin::node::Processor;
use syncline_drives::twin::tlc5xx::{
    Bit6, OffsetSpeed, Policies, PositionFactor, Twin, TwinConfig,
};
use syncline_drives::twin::{Disturbance, SimulatedDevice};

// ---- profile position ----

#[test]
fn bit_6_by_the_manual_and_by_the_profile() {
    for (absolute, word_absolute, word_relative) in [
        (Bit6::SetIsAbsolute, 0x5F, 0x1F),
        (Bit6::ClearIsAbsolute, 0x1F, 0x5F),
    ] {
        let mut bench = with(Policies {
            absolute,
            ..Policies::default()
        });
        enabled(&mut bench, 1);
        set(&mut bench, 0x6081, 0, 3000).unwrap();
        set(&mut bench, 0x607A, 0, 20_000).unwrap();
        for (word, expected) in [
            (word_absolute, 20_000),
            (word_absolute, 20_000),
            (word_relative, 40_000),
            (word_relative, 60_000),
        ] {
            bench.controlword(1, 0x0F);
            bench.controlword(1, word);
            assert_ne!(status(&mut bench) & ACKNOWLEDGED, 0);
            reach(&mut bench);
            assert!(is_at(&mut bench, expected), "{}", position(&mut bench));
        }
        bench.controlword(1, 0x0F);
        assert_eq!(status(&mut bench) & ACKNOWLEDGED, 0);
    }
}

#[test]
fn a_target_may_wait_or_take_over() {
    let mut bench = drive(1);
    set(&mut bench, 0x6081, 0, 600).unwrap();
    let start = |bench: &mut Bench<Twin>, target: i32, word: u16| {
        bench.controlword(1, 0x0F);
        set(bench, 0x607A, 0, target).unwrap();
        bench.controlword(1, word);
    };
    start(&mut bench, 100_000, 0x5F);
    bench.wait(ms(100));
    // Bit 5 = 0: after the first; a third finds no place.
    start(&mut bench, 50_000, 0x5F);
    assert_ne!(status(&mut bench) & ACKNOWLEDGED, 0);
    start(&mut bench, 0, 0x5F);
    assert_eq!(status(&mut bench) & ACKNOWLEDGED, 0);
    until(&mut bench, 10, "first target", |bench| {
        position(bench) > 99_000
    });
    reach(&mut bench);
    assert!(is_at(&mut bench, 50_000));
    // Bit 5 = 1: at once.
    start(&mut bench, 150_000, 0x5F);
    bench.wait(ms(200));
    start(&mut bench, 0, 0x7F);
    reach(&mut bench);
    assert!(is_at(&mut bench, 0));
}

/// Bit 8 brakes and keeps the movement, which goes on when it falls (5342-5349).
#[test]
fn halt_and_go_on() {
    let mut bench = drive(1);
    set(&mut bench, 0x6081, 0, 600).unwrap();
    set(&mut bench, 0x607A, 0, 300_000).unwrap();
    bench.controlword(1, 0x5F);
    bench.wait(ms(500));
    bench.controlword(1, 0x5F | HALT);
    bench.wait(ms(500));
    assert!(rpm(&mut bench).abs() < 1.0);
    let stopped = position(&mut bench);
    assert!((1000..299_000).contains(&stopped));
    bench.controlword(1, 0x5F);
    reach(&mut bench);
    assert!(is_at(&mut bench, 300_000));
}

/// Beyond a limit there is no movement but EMCY FF22h (15485-15488); the pair has two names.
#[test]
fn software_limits() {
    let mut bench = drive(1);
    assert_eq!(
        set(&mut bench, 0x2052, 0, -2_147_483_648),
        Err(MAXIMUM_BELOW_MINIMUM)
    );
    set(&mut bench, 0x2052, 0, 50_000).unwrap();
    set(&mut bench, 0x607D, 1, -50_000).unwrap();
    assert_eq!(bench.read_i32(1, 0x607D, 2), 50_000);
    assert_eq!(bench.read_i32(1, 0x2053, 0), -50_000);
    assert_eq!(
        set(&mut bench, 0x607D, 2, -50_000),
        Err(MAXIMUM_BELOW_MINIMUM)
    );
    set(&mut bench, 0x2054, 0, 0x60).unwrap();
    for target in [50_001, -50_001] {
        bench.controlword(1, 0x0F);
        set(&mut bench, 0x607A, 0, target).unwrap();
        let from = bench.log.len();
        bench.controlword(1, 0x5F);
        assert_eq!(status(&mut bench) & ACKNOWLEDGED, 0);
        assert_eq!(bench.received(from, 0x081)[0][..2], [0x22, 0xFF]);
        assert_eq!(bench.twin().state(), State::OperationEnabled);
    }
    // In speed a limit stops the motor.
    bench.write(1, 0x6060, 0, &[3]).unwrap();
    bench.wait(ms(5));
    set(&mut bench, 0x60FF, 0, 300).unwrap();
    until(&mut bench, 5, "stop", |bench| {
        bench.twin().state() == State::QuickStopActive
    });
    assert_eq!(bench.number(1, 0x2062, 0), 1 << 5);
    assert_ne!(status(&mut bench) & 0x0800, 0, "internal limit");
}

#[test]
fn a_profile_velocity_above_the_greatest_is_refused() {
    let mut bench = drive(1);
    assert_eq!(set(&mut bench, 0x6081, 0, 3001), Err(TOO_HIGH));
    set(&mut bench, 0x607F, 0, 5000).unwrap();
    assert_eq!(set(&mut bench, 0x6081, 0, 3001), Ok(()));
}

/// 204Fh chooses the class (10597-10600); bit 13 says it (3267-3273).
#[test]
fn following_error() {
    for (response, state) in [
        (1, State::QuickStopActive),
        (2, State::Fault),
        (3, State::Fault),
    ] {
        let mut bench = drive(1);
        set(&mut bench, 0x204F, 0, response).unwrap();
        set(&mut bench, 0x607A, 0, 200_000).unwrap();
        bench.controlword(1, 0x5F);
        bench.wait(ms(100));
        bench.twin().disturb(Disturbance::Block(true));
        until(&mut bench, 5, "error", |bench| {
            bench.twin().state() == state
        });
        assert_ne!(status(&mut bench) & BIT_13, 0);
        assert!(bench.read_i32(1, 0x2013, 0) >= 16_384);
        bench.write(1, 0x2013, 0, &[0; 4]).unwrap();
    }
}

/// The start of two drives at one SYNC (1773-1775): R_PDO2 of type 0.
#[test]
fn two_drives_start_at_one_sync() {
    let twins = [1, 2].map(|node| {
        Twin::new(TwinConfig {
            processor: Processor::prompt(id(node)),
            ..config()
        })
        .unwrap()
    });
    let mut bench = Bench::of(twins);
    for node in [1_u8, 2] {
        let cob_id = 0x300 + u32::from(node);
        bench.write(node, 0x1401, 1, &cob_id.to_le_bytes()).unwrap();
        bench
            .write(node, 0x6081, 0, &600_u32.to_le_bytes())
            .unwrap();
        for word in [0x06, 0x0F] {
            bench.controlword(node, word);
        }
    }
    bench.nmt(Command::Start, 0);
    for cob_id in [0x301, 0x302] {
        bench.send(cob_id, &[0x1F, 0, 0x40, 0x9C, 0, 0]);
        bench.wait(ms(20));
    }
    let velocities =
        |bench: &Bench<Twin>| [0, 1].map(|node| bench.bus.node(node).observe().velocity);
    assert_eq!(velocities(&bench), [0.0, 0.0]);
    bench.sync();
    bench.wait(ms(100));
    let [one, two] = velocities(&bench);
    assert!(one > 0.5 && (one - two).abs() < 1e-3, "{one} {two}");
}

/// For an absolute target a reference point must be defined (3154).
#[test]
fn an_absolute_target_needs_a_reference_point() {
    for absolute_without_reference in [false, true] {
        let mut bench = with(Policies {
            absolute_without_reference,
            ..Policies::default()
        });
        for word in [0x06, 0x0F] {
            bench.controlword(1, word);
        }
        set(&mut bench, 0x607A, 0, 1000).unwrap();
        let from = bench.log.len();
        bench.controlword(1, 0x5F);
        let is_taken = status(&mut bench) & ACKNOWLEDGED != 0;
        assert_eq!(is_taken, absolute_without_reference);
        assert_eq!(bench.received(from, 0x081).is_empty(), is_taken);
        // A relative one is taken anyway.
        bench.controlword(1, 0x0F);
        bench.controlword(1, 0x1F);
        assert_ne!(status(&mut bench) & ACKNOWLEDGED, 0);
    }
}

// ---- profile velocity ----

#[test]
fn profile_velocity() {
    let mut bench = drive(3);
    assert_ne!(status(&mut bench) & ACKNOWLEDGED, 0, "speed is 0");
    for target in [300, -600, 100] {
        set(&mut bench, 0x60FF, 0, target).unwrap();
        bench.wait(ms(5));
        assert_eq!(status(&mut bench) & TARGET_REACHED, 0);
        reach(&mut bench);
        bench.wait(ms(200));
        assert!((rpm(&mut bench) - f64::from(target)).abs() < 2.0);
        assert!((bench.read_i32(1, 0x606C, 0) - target).abs() <= 2);
        assert_eq!(status(&mut bench) & ACKNOWLEDGED, 0);
    }
    // A mode takes over at standstill (15191-15193).
    bench.write(1, 0x6060, 0, &[1]).unwrap();
    bench.wait(ms(100));
    assert_eq!(bench.read(1, 0x6061, 0).unwrap(), [3]);
    set(&mut bench, 0x60FF, 0, 0).unwrap();
    until(&mut bench, 5, "mode 1", |bench| {
        bench.read(1, 0x6061, 0).unwrap() == [1]
    });
    assert!(rpm(&mut bench).abs() < 10.0);
}

/// 6094h refines the unit: tenths of a revolution a minute.
#[test]
fn normalisation() {
    let mut bench = drive(3);
    set(&mut bench, 0x6094, 2, 10).unwrap();
    set(&mut bench, 0x60FF, 0, 1234).unwrap();
    reach(&mut bench);
    bench.wait(ms(200));
    assert!((rpm(&mut bench) - 123.4).abs() < 1.0);
    assert!((bench.read_i32(1, 0x606C, 0) - 1234).abs() <= 10);
    assert_eq!(set(&mut bench, 0x6093, 1, 5), Err(DEVICE_STATE), "powered");
    // Positions: 1/100 revolution, or 100 units for a revolution; the same by both readings.
    for (position_factor, numerator, denominator) in [
        (PositionFactor::RevolutionsPerUnit, 1, 100),
        (PositionFactor::UnitsPerIncrement, 100, 16_384),
    ] {
        let mut bench = with(Policies {
            position_factor,
            ..Policies::default()
        });
        set(&mut bench, 0x6093, 1, numerator).unwrap();
        set(&mut bench, 0x6093, 2, denominator).unwrap();
        assert_eq!(set(&mut bench, 0x6093, 2, 0), Err(INVALID));
        enabled(&mut bench, 1);
        set(&mut bench, 0x607A, 0, 250).unwrap();
        bench.controlword(1, 0x5F);
        reach(&mut bench);
        assert!((bench.twin().observe().position - 2.5).abs() < 1e-3);
        assert!((249..=250).contains(&position(&mut bench)));
    }
}

#[test]
fn the_direction_of_rotation_can_be_reversed() {
    let mut bench = of(config());
    set(&mut bench, 0x2045, 0, 1).unwrap();
    enabled(&mut bench, 1);
    set(&mut bench, 0x607A, 0, 16_384).unwrap();
    bench.controlword(1, 0x5F);
    reach(&mut bench);
    assert!(is_at(&mut bench, 16_384));
    assert!((bench.twin().observe().position + 1.0).abs() < 1e-3);
    assert_eq!(set(&mut bench, 0x2045, 0, 0), Err(DEVICE_STATE));
}

// ---- homing ----

/// Where user position 0 is after homing, revolutions.
fn homed(start: f64, prepare: impl Fn(&mut Bench<Twin>)) -> f64 {
    let mut bench = of(TwinConfig {
        position: start,
        switches: switches(),
        ..config()
    });
    prepare(&mut bench);
    until(&mut bench, 60, "homed", |bench| {
        status(bench) & TARGET_REACHED != 0
    });
    assert_eq!(bench.twin().state(), State::OperationEnabled);
    bench.twin().observe().position - f64::from(position(&mut bench)) / 16_384.0
}

/// 3824-3844: without an index pulse 200 increments from the edge, with one on a whole revolution.
#[test]
fn every_method_of_the_profile() {
    let beyond = 200.0 / 16_384.0;
    for (method, start, expected) in [
        (17, 0.0, -2.25 + beyond),
        (18, 0.0, 2.25 - beyond),
        (23, 0.0, 0.75 - beyond),
        (27, 2.0, 1.25 + beyond),
        (1, 0.0, -2.0),
        (2, 0.0, 2.0),
        (7, 0.0, 0.0),
        (11, 2.0, 2.0),
        (35, 0.4, 0.4),
        // From the switch itself, and after a turn at the limit switch.
        (18, 2.5, 2.25 - beyond),
        (23, 1.5, 0.75 - beyond),
    ] {
        let zero = homed(start, |bench| {
            enabled(bench, 6);
            set(bench, 0x6099, 1, 300).unwrap();
            set(bench, 0x6099, 2, 30).unwrap();
            set(bench, 0x6098, 0, method).unwrap();
            bench.controlword(1, 0x1F);
        });
        assert!(
            (zero - expected).abs() < 2e-3,
            "method {method}: {zero}, {expected}"
        );
    }
    for method in [0, 3, 16, 33, 34, 36] {
        let mut bench = of(config());
        assert_eq!(set(&mut bench, 0x6098, 0, method), Err(INVALID), "{method}");
    }
}

/// 13924-13939.
#[test]
fn every_method_of_the_manufacturer() {
    let beyond = 200.0 / 16_384.0;
    for (method, start, expected) in [
        (1, 0.0, 2.25 - beyond),
        (2, 0.0, -2.25 + beyond),
        (3, 2.0, 1.25 + beyond),
        (4, 0.0, 0.75 - beyond),
        (5, 0.0, 2.0),
        (6, 0.0, -2.0),
        (7, 2.0, 2.0),
        (8, 0.0, 0.0),
    ] {
        let zero = homed(start, |bench| {
            enabled(bench, -1);
            set(bench, 0x6099, 1, 300).unwrap();
            set(bench, 0x6099, 2, 30).unwrap();
            set(bench, 0x20F0, 0, method).unwrap();
            bench.wait(ms(5));
            assert_eq!(bench.number(1, 0x20F1, 0) & ENDED, 0);
        });
        assert!(
            (zero - expected).abs() < 2e-3,
            "method {method}: {zero}, {expected}"
        );
    }
}

#[test]
fn homing_without_its_switch_fails() {
    let mut bench = drive(6);
    bench.controlword(1, 0x1F);
    assert_eq!(status(&mut bench) & (ACKNOWLEDGED | BIT_13), BIT_13);
    assert_eq!(bench.twin().state(), State::QuickStopActive);
    // 20F3h bounds the way off the switch.
    let mut bench = of(TwinConfig {
        position: 3.0,
        switches: switches(),
        ..config()
    });
    set(&mut bench, 0x20F3, 0, 100).unwrap();
    enabled(&mut bench, 6);
    set(&mut bench, 0x6099, 2, 30).unwrap();
    bench.controlword(1, 0x1F);
    until(&mut bench, 10, "failure", |bench| {
        status(bench) & BIT_13 != 0
    });
}

// ---- the manufacturer's modes ----

#[test]
fn point_to_point_of_the_manufacturer() {
    let mut bench = drive(-1);
    assert_eq!(bench.number(1, 0x2091, 0), 0);
    set(&mut bench, 0x2094, 0, 600).unwrap();
    set(&mut bench, 0x2090, 0, 100_000).unwrap();
    bench.wait(ms(200));
    assert_eq!(bench.number(1, 0x2091, 0) & ENDED, 0);
    reach(&mut bench);
    assert_eq!(bench.number(1, 0x2091, 0), 0x6000);
    assert!(is_at(&mut bench, 100_000));
    set(&mut bench, 0x2092, 0, -30_000).unwrap();
    reach(&mut bench);
    assert!(is_at(&mut bench, 70_000));
    set(&mut bench, 0x20F6, 0, 5).unwrap();
    assert!(is_at(&mut bench, 5));
    // In the profile's mode it starts nothing.
    bench.write(1, 0x6060, 0, &[1]).unwrap();
    bench.wait(ms(5));
    set(&mut bench, 0x2090, 0, 100_000).unwrap();
    bench.wait(ms(100));
    assert!(is_at(&mut bench, 5));
}

/// R_PDO4 brings target, speed and ramp, and starts by coming (8379-8386); T_PDO4 tells of changes of
/// the state word (1532).
#[test]
fn pdo_4() {
    let mut bench = drive(-1);
    set(&mut bench, 0x1403, 1, 0x501).unwrap();
    set(&mut bench, 0x1803, 1, 0x481).unwrap();
    set(&mut bench, 0x1803, 5, 0).unwrap();
    bench.nmt(Command::Start, 1);
    let from = bench.log.len();
    let [b0, b1, b2, b3] = 50_000_i32.to_le_bytes();
    bench.send(0x501, &[b0, b1, b2, b3, 0x58, 0x02, 0xE8, 0x03]);
    bench.wait(ms(300));
    // 1000 r/(min·s): 300 r/min after 0.3 s.
    assert!(
        (rpm(&mut bench) - 290.0).abs() < 20.0,
        "{}",
        rpm(&mut bench)
    );
    reach(&mut bench);
    assert!(is_at(&mut bench, 50_000));
    let told = bench.received(from, 0x481);
    let states: Vec<u8> = told.iter().map(|data| data[7]).collect();
    assert_eq!(states, [0x40, 0x60], "{told:X?}");
    assert_eq!(told[1][..4], bench.read(1, 0x2089, 0).unwrap());
    // By the clock as well, 1000 ms as delivered.
    set(&mut bench, 0x1803, 5, 1000).unwrap();
    bench.wait(ms(1));
    let from = bench.log.len();
    bench.wait(ms(3500));
    assert_eq!(bench.received(from, 0x481).len(), 3);
}

#[test]
fn speed_and_manual_movement() {
    let mut bench = drive(-1);
    set(&mut bench, 0x2095, 0, -120).unwrap();
    reach(&mut bench);
    assert!((rpm(&mut bench) + 120.0).abs() < 2.0);
    assert_eq!(bench.number(1, 0x2096, 0), 0x2000);
    set(&mut bench, 0x2095, 0, 0).unwrap();
    until(&mut bench, 5, "rest", |bench| rpm(bench).abs() < 0.5);
    bench.wait(ms(50));
    set(&mut bench, 0x20F6, 0, 0).unwrap();
    // Classic: a step of 20, and after 500 ms a run, here the fast one.
    set(&mut bench, 0x20A9, 0, 5).unwrap();
    bench.wait(ms(400));
    assert!(
        (position(&mut bench) - 20).abs() <= 3,
        "{}",
        position(&mut bench)
    );
    bench.wait(ms(600));
    assert!((rpm(&mut bench) - 180.0).abs() < 2.0);
    set(&mut bench, 0x20A9, 0, 0).unwrap();
    until(&mut bench, 5, "rest", |bench| rpm(bench).abs() < 0.5);
    bench.wait(ms(50));
    set(&mut bench, 0x20F6, 0, 0).unwrap();
    // United: one distance a start.
    set(&mut bench, 0x20AA, 0, 1).unwrap();
    set(&mut bench, 0x20AD, 0, 5000).unwrap();
    for expected in [-5000, -10_000] {
        set(&mut bench, 0x20A9, 0, 2).unwrap();
        reach(&mut bench);
        bench.wait(ms(100));
        assert!(is_at(&mut bench, expected), "{}", position(&mut bench));
    }
    assert_eq!(bench.number(1, 0x20F5, 0), ENDED);
}

#[test]
fn electronic_gear() {
    let mut bench = drive(-1);
    set(&mut bench, 0x20A1, 0, 1).unwrap();
    set(&mut bench, 0x20A2, 0, 2).unwrap();
    bench.twin().set_pulse_frequency(32_768.0);
    set(&mut bench, 0x209D, 0, 1).unwrap();
    bench.wait(ms(1000));
    assert!((rpm(&mut bench) - 60.0).abs() < 1.0);
    // Anticlockwise only, then off.
    set(&mut bench, 0x209C, 0, 2).unwrap();
    bench.wait(ms(300));
    assert!(rpm(&mut bench).abs() < 1.0);
    bench.twin().set_pulse_frequency(-32_768.0);
    bench.wait(ms(500));
    assert!((rpm(&mut bench) + 60.0).abs() < 1.0);
    set(&mut bench, 0x209D, 0, 0).unwrap();
    until(&mut bench, 5, "rest", |bench| rpm(bench).abs() < 0.5);
}

/// Pulses that came while the gear was off are made up for by 209Dh = 2 (12384-12392), no faster than 209Fh, and left alone by 1.
#[test]
fn the_gear_catches_up_with_what_it_missed() {
    for (start, pulses, makes_up) in [
        (2, 16_384.0, true),
        (2, -16_384.0, true),
        (1, 16_384.0, false),
    ] {
        let mut bench = drive(-1);
        set(&mut bench, 0x209F, 0, 180).unwrap();
        let reference = |bench: &mut Bench<Twin>| f64::from(bench.read_i32(1, 0x2071, 0));
        bench.twin().set_pulse_frequency(pulses);
        // What came before it was on for the first time is nothing to it.
        bench.wait(ms(200));
        let (from, began) = (reference(&mut bench), bench.now());
        set(&mut bench, 0x209D, 0, 2).unwrap();
        bench.wait(ms(500));
        set(&mut bench, 0x209D, 0, 0).unwrap();
        until(&mut bench, 5, "rest", |bench| rpm(bench).abs() < 0.5);
        bench.wait(ms(400));
        set(&mut bench, 0x209D, 0, start).unwrap();
        let mut fastest = 0.0_f64;
        for _ in 0..100 {
            bench.wait(ms(20));
            fastest = fastest.max(rpm(&mut bench).abs());
        }
        let due = pulses * (bench.now() - began).as_secs_f64();
        let behind = (due - (reference(&mut bench) - from)).abs();
        println!("{start}, {pulses}: {behind} behind, {fastest} r/min");
        assert_eq!(
            behind < 600.0,
            makes_up,
            "{start}, {pulses}: {behind} behind"
        );
        assert!(
            fastest < 185.0 && (fastest > 100.0) == makes_up,
            "{fastest} r/min"
        );
    }
}

/// How far the reference goes in 0.9 s beside what so many pulses/s make of it, increments.
fn beside(bench: &mut Bench<Twin>, pulses: f64) -> f64 {
    let before = bench.read_i32(1, 0x2071, 0);
    let from = bench.now();
    bench.wait(ms(900));
    let seconds = (bench.now() - from).as_secs_f64();
    f64::from(bench.read_i32(1, 0x2071, 0) - before) - pulses * seconds
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    /// Offset positioning adds to the gear what it is sent, absolute from the reference point that 20A8h sets or relative,
    /// no faster than 20A7h, and 20A5h tells its end (4500-4535, 12563-12700).
    #[test]
    fn offset_positioning_on_top_of_the_gear(
        pulses in -20_000.0..20_000.0f64,
        reference in -5000..5000i32,
        way in prop_oneof![-4000..-200i32, 200..4000i32],
        is_absolute: bool,
        in_rpm: bool,
        again in -3000..3000i32,
    ) {
        let offset_speed = match in_rpm {
            true => OffsetSpeed::RevolutionsPerMinute,
            false => OffsetSpeed::IncrementsPerSecond,
        };
        let mut bench = with(Policies { offset_speed, ..Policies::default() });
        enabled(&mut bench, -1);
        bench.twin().set_pulse_frequency(pulses);
        // 12 000 inc/s and 60 r/min: the way takes a third of a second at most.
        set(&mut bench, 0x20A7, 0, if in_rpm { 60 } else { 12_000 }).unwrap();
        for index in [0x20F8, 0x20F9] {
            set(&mut bench, index, 0, 60_000).unwrap();
        }
        // Without the gear nothing starts.
        set(&mut bench, 0x20A6, 0, 1000).unwrap();
        prop_assert!(beside(&mut bench, 0.0).abs() <= 1.0);
        prop_assert_eq!(bench.number(1, 0x20A5, 0), 0);
        set(&mut bench, 0x209D, 0, 1).unwrap();
        bench.wait(ms(50));
        set(&mut bench, 0x20A8, 0, reference).unwrap();
        let (index, sent) = if is_absolute { (0x20A4, reference + way) } else { (0x20A6, way) };
        set(&mut bench, index, 0, sent).unwrap();
        bench.wait(ms(5));
        prop_assert_eq!(bench.number(1, 0x20A5, 0), 0, "under way");
        // A few ms of it are over, at 19 increments a ms at most.
        let near = |is: f64, due: i32| (is - f64::from(due)).abs() <= 0.02 * f64::from(due.abs()) + 130.0;
        let moved = beside(&mut bench, pulses);
        prop_assert!(near(moved, way), "{moved}, {way}");
        prop_assert_eq!(bench.number(1, 0x20A5, 0), 0x6000, "reached");
        // From where it is now to another place, counted from the reference point.
        set(&mut bench, 0x20A4, 0, reference + again).unwrap();
        let moved = beside(&mut bench, pulses);
        prop_assert!(near(moved, again - way), "{moved}, {again} - {way}");
        // Off: what is under way ends there.
        set(&mut bench, 0x20A6, 0, 30_000).unwrap();
        bench.wait(ms(20));
        set(&mut bench, 0x209D, 0, 0).unwrap();
        bench.wait(ms(20));
        prop_assert_eq!(bench.number(1, 0x20A5, 0), 0xC000, "error, ended");
        bench.wait(ms(800));
        prop_assert!(beside(&mut bench, 0.0).abs() <= 1.0);
    }
}

#[test]
fn offset_positioning_is_no_faster_than_it_is_told() {
    let mut bench = drive(-1);
    set(&mut bench, 0x209D, 0, 1).unwrap();
    for index in [0x20F8, 0x20F9] {
        set(&mut bench, index, 0, 60_000).unwrap();
    }
    // 60 increments/s by default.
    set(&mut bench, 0x20A6, 0, 1000).unwrap();
    bench.wait(ms(100));
    let moved = beside(&mut bench, 0.0);
    assert!((moved - 54.0).abs() <= 2.0, "{moved}");
    // While it goes its reference point is left alone, and so is it under local control.
    set(&mut bench, 0x20A8, 0, 5).unwrap();
    bench.twin().disturb(Disturbance::Remote(false));
    for index in [0x20A4, 0x20A6, 0x20A8] {
        assert_eq!(
            set(&mut bench, index, 0, 1),
            Err(0x0800_0021),
            "{index:04X}"
        );
    }
}

/// Both kinds of places, in the background of a movement, both ways (4649-4665).
#[test]
fn lists_and_teach_in() {
    let mut bench = drive(-1);
    // Places 3 to 5 of list 1: TRIGGER from 10 000 to 30 000, of which the last is taught.
    for (place, level) in [(4, 1), (5, 0), (6, 1)] {
        set(&mut bench, 0x2202, place, level).unwrap();
        set(
            &mut bench,
            0x2201,
            place,
            i32::from(place) * 20_000 - 70_000,
        )
        .unwrap();
    }
    set(&mut bench, 0x20B8, 0, 3).unwrap();
    set(&mut bench, 0x20B9, 0, 5).unwrap();
    set(&mut bench, 0x2094, 0, 600).unwrap();
    set(&mut bench, 0x2090, 0, 60_000).unwrap();
    reach(&mut bench);
    set(&mut bench, 0x20B0, 0, 5).unwrap();
    assert_eq!(bench.number(1, 0x20B1, 0), ENDED);
    assert!((bench.read_i32(1, 0x2201, 6) - 60_000).abs() <= 10);
    set(&mut bench, 0x2090, 0, 0).unwrap();
    reach(&mut bench);
    assert_eq!(bench.twin().outputs(), 0, "not started");
    set(&mut bench, 0x20B4, 0, 1).unwrap();
    assert_eq!(bench.number(1, 0x20B5, 0), 1);
    assert_eq!(bench.read(1, 0x20BA, 0).unwrap(), [0xFF, 0xFF]);
    set(&mut bench, 0x2090, 0, 100_000).unwrap();
    for (level, place) in [(1, 3), (0, 4), (1, 5)] {
        until(&mut bench, 5, "TRIGGER", |bench| {
            bench.twin().outputs() >> 22 == level
        });
        assert_eq!(bench.number(1, 0x20BA, 0), place);
        let passed = i32::from(place as u16) * 20_000 - 50_000;
        let expected = if place == 5 { 60_000 } else { passed };
        let beyond = position(&mut bench) - expected;
        // 10 rev/s in the 5 ms between two looks.
        assert!((-20..1200).contains(&beyond), "{beyond}");
    }
    assert_eq!(bench.number(1, 0x20B5, 0), ENDED);
    reach(&mut bench);
    // List 2: on the way back with another velocity.
    set(&mut bench, 0x2300, 1, 2).unwrap();
    set(&mut bench, 0x2301, 1, 50_000).unwrap();
    set(&mut bench, 0x2303, 1, 60).unwrap();
    set(&mut bench, 0x20BF, 0, 0).unwrap();
    set(&mut bench, 0x20B4, 0, 2).unwrap();
    set(&mut bench, 0x2090, 0, 0).unwrap();
    until(&mut bench, 5, "place", |bench| position(bench) < 50_000);
    until(&mut bench, 5, "slow", |bench| {
        (rpm(bench) + 60.0).abs() < 2.0
    });
    assert!((0..50_000).contains(&position(&mut bench)));
    // The first place behind the last is an error, and so are records.
    set(&mut bench, 0x20B8, 0, 9).unwrap();
    set(&mut bench, 0x20B4, 0, 1).unwrap();
    assert_eq!(bench.number(1, 0x20B5, 0), ENDED | FAILED);
    set(&mut bench, 0x20B2, 0, 3).unwrap();
    set(&mut bench, 0x20B0, 0, 0).unwrap();
    assert_eq!(bench.number(1, 0x20B1, 0), ENDED | FAILED);
}
