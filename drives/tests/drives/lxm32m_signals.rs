//! What else is wired to the drive, and what watches it: limits, capture inputs, position
//! registers, digital signals, parameter sets, windows.

use crate::common::lxm32m::{Bench, drive, enabled};
use crate::common::{
    BIT_12, REF_OK, TARGET_REACHED, X_END, X_ERR, id, ms, rpm, set, status, wait_for,
};
use std::fmt::Write;
use syncline_canopen::cia402::{State, Statusword};
use syncline_drives::twin::lxm32m::{Policies, Switches, TwinConfig, storage_only};
use syncline_drives::twin::{Disturbance, SimulatedDevice};

/// usr_p in a revolution.
const REVOLUTION: i32 = 16_384;

fn position(bench: &mut Bench) -> i32 {
    bench.read_i32(1, 0x6064, 0)
}

fn last_error(bench: &mut Bench) -> u16 {
    bench.read_u16(1, 0x603F, 0)
}

/// Steep ramps; user position 0 is where the axis stands, and a valid zero point.
fn referenced(bench: &mut Bench) {
    for index in [0x6083, 0x6084] {
        set(bench, index, 0, 6000);
    }
    set(bench, 0x6060, 0, 6);
    set(bench, 0x6098, 0, 35);
    bench.controlword(1, 0x000F);
    bench.controlword(1, 0x001F);
    bench.controlword(1, 0x000F);
    assert_ne!(status(bench) & REF_OK, 0);
}

fn reset(bench: &mut Bench) {
    for word in [0x0000, 0x0080, 0x0006, 0x000F] {
        bench.controlword(1, word);
    }
    assert_eq!(bench.twin().state(), State::OperationEnabled);
}

// ---- limits ----

/// -2…3 revolutions.
fn within_software_limits(watched: i32, at_limit: bool) -> Bench {
    let mut bench = drive(6);
    referenced(&mut bench);
    set(&mut bench, 0x607D, 1, -2 * REVOLUTION);
    set(&mut bench, 0x607D, 2, 3 * REVOLUTION);
    set(&mut bench, 0x3006, 0x03, watched);
    set(&mut bench, 0x3006, 0x47, i32::from(at_limit));
    bench
}

#[test]
fn software_limits_stop_every_movement() {
    for (at_limit, mode) in [(false, 3), (true, 3), (false, 4), (true, -1)] {
        let mut bench = within_software_limits(0b11, at_limit);
        set(&mut bench, 0x6060, 0, mode);
        set(&mut bench, 0x3029, 5, 1200);
        let run = |bench: &mut Bench, forward: bool| {
            let sign = if forward { 1 } else { -1 };
            match mode {
                3 => set(bench, 0x60FF, 0, sign * 1200),
                4 => set(bench, 0x6071, 0, sign * 200),
                _ => set(bench, 0x301B, 9, if forward { 5 } else { 6 }),
            }
        };
        run(&mut bench, true);
        wait_for(&mut bench, X_ERR | X_END, 10);
        assert_eq!(bench.twin().state(), State::QuickStopActive);
        assert_eq!(last_error(&mut bench), 0xA307);
        bench.wait(ms(200));
        let rest = position(&mut bench);
        let limit = 3 * REVOLUTION;
        if at_limit {
            assert!(
                (limit - 2000..limit + 200).contains(&rest),
                "{mode}: {rest}"
            );
        } else {
            assert!(
                (limit..limit + 3 * REVOLUTION).contains(&rest),
                "{mode}: {rest}"
            );
        }
        // Away from it the axis may move.
        reset(&mut bench);
        run(&mut bench, false);
        bench.wait(ms(100));
        assert_eq!(bench.twin().state(), State::OperationEnabled);
        assert!(bench.twin().observe().velocity < 0.0);
        wait_for(&mut bench, X_ERR | X_END, 10);
        bench.wait(ms(200));
        assert!(position(&mut bench) < -2 * REVOLUTION + 2000);
    }
}

#[test]
fn a_position_beyond_a_software_limit_is_refused() {
    let mut bench = within_software_limits(0b11, true);
    set(&mut bench, 0x6060, 0, 1);
    let target = |bench: &mut Bench, target: i32| bench.write(1, 0x607A, 0, &target.to_le_bytes());
    assert_eq!(target(&mut bench, 3 * REVOLUTION + 1), Err(0x0609_0030));
    assert_eq!(target(&mut bench, -2 * REVOLUTION - 1), Err(0x0609_0030));
    // Up to the limit it goes, and there is no error.
    assert_eq!(target(&mut bench, 3 * REVOLUTION), Ok(()));
    bench.controlword(1, 0x001F);
    wait_for(&mut bench, X_END | TARGET_REACHED, 5);
    assert!((position(&mut bench) - 3 * REVOLUTION).abs() < 16);
    // What a relative target leads to shows in motion only.
    bench.controlword(1, 0x004F);
    assert_eq!(target(&mut bench, -6 * REVOLUTION), Ok(()));
    bench.controlword(1, 0x005F);
    wait_for(&mut bench, X_ERR | X_END, 10);
    bench.wait(ms(200));
    assert!((position(&mut bench) + 2 * REVOLUTION).abs() < 2000);
}

/// An end that is not watched is none, and without a valid zero point none is, unless the policy
/// says otherwise.
#[test]
fn software_limits_that_do_not_count() {
    let run = |bench: &mut Bench| {
        set(bench, 0x6060, 0, 3);
        set(bench, 0x60FF, 0, 1200);
        bench.wait(ms(1000));
        bench.twin().state()
    };
    let unwatched = |watched| run(&mut within_software_limits(watched, false));
    assert_eq!(unwatched(0), State::OperationEnabled);
    assert_eq!(unwatched(0b10), State::OperationEnabled);
    assert_eq!(unwatched(0b01), State::QuickStopActive);
    for (needed, state) in [
        (true, State::OperationEnabled),
        (false, State::QuickStopActive),
    ] {
        let policies = Policies {
            software_limits_need_reference: needed,
            ..Policies::default()
        };
        let mut bench = enabled(
            TwinConfig {
                policies,
                ..TwinConfig::new(id(1))
            },
            3,
        );
        set(&mut bench, 0x6083, 0, 6000);
        set(&mut bench, 0x607D, 2, REVOLUTION);
        set(&mut bench, 0x3006, 0x03, 1);
        assert_eq!(run(&mut bench), state);
    }
}

/// 3006h:6 suppresses the error at enabling (lxm32m 1634), 3006h:11 the switch itself.
#[test]
fn a_limit_switch_at_enabling() {
    let on_switch = || TwinConfig {
        switches: Switches {
            positive_limit: Some(-0.1),
            ..Switches::default()
        },
        ..TwinConfig::new(id(1))
    };
    let enable = |bench: &mut Bench| {
        bench.controlword(1, 0x0006);
        bench.controlword(1, 0x000F);
        bench.twin().state()
    };
    let mut bench = Bench::new([on_switch()]);
    assert_eq!(enable(&mut bench), State::QuickStopActive);
    assert_eq!(last_error(&mut bench), 0xA302);

    let mut bench = Bench::new([on_switch()]);
    set(&mut bench, 0x3006, 0x06, 1);
    assert_eq!(enable(&mut bench), State::OperationEnabled);
    set(&mut bench, 0x6060, 0, 3);
    set(&mut bench, 0x60FF, 0, 100);
    bench.wait(ms(100));
    assert_eq!(bench.twin().state(), State::QuickStopActive);

    let mut bench = Bench::new([on_switch()]);
    set(&mut bench, 0x3006, 0x11, 1);
    assert_eq!(enable(&mut bench), State::OperationEnabled);
    set(&mut bench, 0x6060, 0, 3);
    set(&mut bench, 0x60FF, 0, 100);
    bench.wait(ms(100));
    assert_eq!(bench.twin().state(), State::OperationEnabled);
}

// ---- signals ----

/// Capture input 1 is active from 0.5 to 0.75 revolutions, input 2 from 1.25 on.
fn captures() -> Bench {
    let mut bench = enabled(
        TwinConfig {
            switches: Switches {
                captures: [Some(0.5..0.75), Some(1.25..100.0)],
                positive_limit: Some(50.0),
                reference: Some(-0.5..0.25),
                ..Switches::default()
            },
            ..TwinConfig::new(id(1))
        },
        1,
    );
    for (index, value) in [(0x6081, 600), (0x6083, 6000), (0x6084, 6000)] {
        set(&mut bench, index, 0, value);
    }
    bench
}

fn go(bench: &mut Bench, revolutions: f64) {
    bench.controlword(1, 0x000F);
    set(
        bench,
        0x607A,
        0,
        (revolutions * f64::from(REVOLUTION)) as i32,
    );
    bench.controlword(1, 0x003F);
    wait_for(bench, X_END | TARGET_REACHED, 10);
}

/// CiA 402: 60B8h arms, 60B9h tells, 60BAh…60BDh hold where the edges are.
#[test]
fn touch_probes_hold_where_their_edges_are() {
    let mut bench = captures();
    let (first, all) = (0b0011_0001, 0b0001_0011);
    set(&mut bench, 0x60B8, 0, first | all << 8);
    assert_eq!(bench.read_u16(1, 0x60B9, 0), 0x0101);
    go(&mut bench, 2.0);
    assert_eq!(bench.read_u16(1, 0x60B9, 0), 0x0307);
    let edges = |bench: &mut Bench| [0x60BA, 0x60BB, 0x60BC].map(|at| bench.read_i32(1, at, 0));
    assert_eq!(edges(&mut bench), [8192, 12_288, 20_480]);
    // Back and forth: the first event stays, where every event counts there is a new one. Seen
    // from there the rising edge is the other one.
    go(&mut bench, 0.0);
    go(&mut bench, 2.0);
    assert_eq!(edges(&mut bench), [8192, 12_288, 20_480]);
    let counts = |bench: &mut Bench| {
        [0x2B, 0x2C, 0x2D, 0x2E, 0x2F].map(|sub| bench.read_u16(1, 0x300A, sub))
    };
    assert_eq!(counts(&mut bench), [1, 1, 2, 0, 0x0211]);
    // Armed again, from the other side.
    set(&mut bench, 0x60B8, 0, 0);
    assert_eq!(bench.read_u16(1, 0x60B9, 0), 0);
    set(&mut bench, 0x60B8, 0, first);
    go(&mut bench, 0.0);
    assert_eq!(edges(&mut bench)[..2], [12_288, 8192]);
    assert_eq!(bench.read_u16(1, 0x60B9, 0), 0x0007);
    // There is no other source than the input.
    assert_eq!(bench.write(1, 0x60B8, 0, &[0x05, 0]), Err(0x0609_0030));
}

#[test]
fn captures_of_the_drives_own() {
    let mut bench = captures();
    set(&mut bench, 0x300A, 0x02, 1); // input 1: rising edge, once
    set(&mut bench, 0x300A, 0x04, 1);
    set(&mut bench, 0x300A, 0x03, 2); // input 2: both edges, always
    set(&mut bench, 0x300A, 0x05, 2);
    assert_eq!(bench.read_u16(1, 0x300A, 1), 0);
    for revolutions in [2.0, 0.0, 2.0] {
        go(&mut bench, revolutions);
    }
    assert_eq!(bench.read_u16(1, 0x300A, 1), 0b11);
    assert_eq!(bench.read_i32(1, 0x300A, 6), 8192);
    assert_eq!(bench.read_u16(1, 0x300A, 8), 1);
    assert_eq!(bench.read_i32(1, 0x300A, 0x1A), 20_480);
    assert_eq!(bench.read_u16(1, 0x300A, 0x19), 3);
    set(&mut bench, 0x300A, 0x04, 1);
    assert_eq!(bench.read_u16(1, 0x300A, 1), 0b10, "armed again");
}

#[test]
fn position_registers_compare() {
    let mut bench = captures();
    let channels = [
        (4, 8, 9),
        (5, 0x0A, 0x0B),
        (0x0E, 0x12, 0x13),
        (0x0F, 0x14, 0x15),
    ];
    for (mode, (mode_at, a, b)) in (0..).zip(channels) {
        set(&mut bench, 0x300B, mode_at, mode);
        set(&mut bench, 0x300B, a, REVOLUTION);
        set(&mut bench, 0x300B, b, 2 * REVOLUTION);
    }
    let mut met = |revolutions| {
        go(&mut bench, revolutions);
        set(&mut bench, 0x300B, 0x16, 0);
        assert_eq!(bench.read_u16(1, 0x300B, 1), 0);
        set(&mut bench, 0x300B, 0x16, 0b1111);
        bench.read_u16(1, 0x300B, 1)
    };
    // From A on, up to A, between A and B, not between them.
    assert_eq!(met(0.0), 0b1010);
    assert_eq!(met(1.5), 0b0101);
    assert_eq!(met(2.5), 0b1001);
    set(&mut bench, 0x300B, 2, 0);
    assert_eq!(bench.read_u16(1, 0x300B, 1), 0b1000);
}

#[test]
fn digital_signals_are_shown() {
    let mut bench = captures();
    let inputs = |bench: &mut Bench| bench.read_u16(1, 0x3008, 0x0F);
    assert_eq!(inputs(&mut bench), 0b10000, "REF");
    go(&mut bench, 0.6);
    assert_eq!(inputs(&mut bench), 0b00001, "capture input 1");
    go(&mut bench, 2.0);
    assert_eq!(inputs(&mut bench), 0b00010, "capture input 2");
    bench.twin().disturb(Disturbance::Input(5, true));
    assert_eq!(inputs(&mut bench), 0b10_0010, "what is wired to DI5");
    bench.twin().disturb(Disturbance::Input(5, false));
    // DQ0 no fault, DQ1 power stage on, DQ2 to be set.
    let outputs = |bench: &mut Bench| bench.read_u16(1, 0x3008, 0x10);
    assert_eq!(outputs(&mut bench), 0b011);
    set(&mut bench, 0x3008, 0x11, 0b100);
    assert_eq!(outputs(&mut bench), 0b111);
    assert_eq!(bench.read_u16(1, 0x3008, 1), 0x0702);
    bench.controlword(1, 0x0000);
    assert_eq!(outputs(&mut bench), 0b101);
    bench
        .twin()
        .raise(syncline_drives::twin::lxm32m::DriveError::SYNC_LOST);
    assert_eq!(outputs(&mut bench), 0b100);
}

// ---- control ----

/// The deviation at 600 rpm is the velocity by the gain of the position loop, less velocity feed-forward.
#[test]
fn the_selected_parameter_set_is_in_effect() {
    let mut bench = drive(3);
    let mut deviation = |sub: u8, index: u16, value: i32| {
        set(&mut bench, index, sub, value);
        set(&mut bench, 0x60FF, 0, 600);
        bench.wait(ms(3000));
        assert!((rpm(&mut bench) - 600.0).abs() < 10.0);
        let set = bench.read_u16(1, 0x3011, 0x17);
        (
            set,
            bench.read_i32(1, 0x60F4, 0),
            bench.read_i32(1, 0x301E, 0x14),
        )
    };
    let near = |(set, deviation, again): (u16, i32, i32), wanted_set, wanted: i32| {
        assert!(
            set == wanted_set && (deviation - wanted).abs() < 100,
            "{set}: {deviation}"
        );
        assert!((deviation - again).abs() < 100);
    };
    let at = |gain: i32| 10 * REVOLUTION / gain;
    near(deviation(6, 0x3012, 0), 1, at(80));
    near(deviation(3, 0x3012, 400), 1, at(40));
    near(deviation(3, 0x3013, 1600), 1, at(40));
    near(deviation(0x19, 0x3011, 2), 2, at(160));
    near(deviation(6, 0x3013, 1000), 2, 0);
    near(deviation(0x19, 0x3011, 1), 1, at(40));
    near(deviation(0x16, 0x3011, 2), 1, 0);
}

#[test]
fn targets_count_as_reached_after_the_windows_time() {
    for (mode, target, time) in [(1, 0x607A, 0x6068), (3, 0x60FF, 0x606E)] {
        let reached = |wanted: i32| {
            let mut bench = drive(mode);
            set(&mut bench, 0x6083, 0, 60_000);
            set(&mut bench, 0x6067, 0, 1000);
            set(&mut bench, 0x606D, 0, 50);
            set(&mut bench, time, 0, wanted);
            set(&mut bench, target, 0, 100);
            bench.controlword(1, 0x001F);
            let from = bench.now();
            while status(&mut bench) & TARGET_REACHED == 0 {
                bench.wait(ms(1));
                assert!(bench.now() < from + ms(5000), "{mode}");
            }
            (bench.now() - from).as_millis()
        };
        let (at_once, later) = (reached(0), reached(500));
        assert!(
            (490..520).contains(&(later - at_once)),
            "{mode}: {at_once} {later}"
        );
    }
}

/// 3006h:29 warns, 3005h:B says how the drive reacts to the error.
#[test]
fn a_load_is_warned_of_and_then_an_error() {
    for (class, state) in [
        (1, State::QuickStopActive),
        (2, State::Fault),
        (3, State::Fault),
    ] {
        let mut bench = drive(1);
        set(&mut bench, 0x6065, 0, REVOLUTION);
        set(&mut bench, 0x3006, 0x29, 20);
        set(&mut bench, 0x3005, 0x0B, class);
        set(&mut bench, 0x6081, 0, 10);
        set(&mut bench, 0x607A, 0, 100 * REVOLUTION);
        bench.controlword(1, 0x001F);
        bench.twin().disturb(Disturbance::Block(true));
        wait_for(&mut bench, Statusword::WARNING, 5);
        assert_eq!(bench.twin().state(), State::OperationEnabled);
        assert_eq!(bench.read_u16(1, 0x301C, 9), 0xA321);
        let load = bench.read_i32(1, 0x301E, 0x16);
        assert!((REVOLUTION / 5..REVOLUTION / 4).contains(&load), "{load}");
        wait_for(&mut bench, X_ERR, 10);
        bench.wait(ms(1000));
        assert_eq!(last_error(&mut bench), 0xA320);
        assert_eq!(bench.twin().state(), state, "class {class}");
        assert!(bench.read_i32(1, 0x301E, 0x15) >= REVOLUTION);
    }
}

/// 605Dh and 3006h:18 choose between the profile's deceleration and the quick stop ramp.
#[test]
fn halt_and_quick_stop_brake_as_chosen() {
    for (option, sub, steep, gentle, word) in
        [(0x605D, 0, 2, 1, 0x010F), (0x3006, 0x18, 6, 5, 0x000B)]
    {
        let time_to_rest = |choice: i32| {
            let mut bench = drive(3);
            set(&mut bench, 0x6083, 0, 6000);
            set(&mut bench, 0x6084, 0, 600);
            set(&mut bench, 0x3006, 0x12, 6000);
            set(&mut bench, option, sub, choice);
            set(&mut bench, 0x60FF, 0, 600);
            wait_for(&mut bench, TARGET_REACHED, 2);
            let from = bench.now();
            bench.controlword(1, word);
            wait_for(&mut bench, X_END, 5);
            (bench.now() - from).as_millis()
        };
        assert!((80..300).contains(&time_to_rest(steep)), "{option:X}");
        assert!((900..1300).contains(&time_to_rest(gentle)), "{option:X}");
    }
}

#[test]
fn absolute_targets_can_be_made_to_need_a_zero_point() {
    let mut bench = drive(1);
    set(&mut bench, 0x3006, 0x16, 1);
    set(&mut bench, 0x607A, 0, 1000);
    let taken = |bench: &mut Bench, word: u16| {
        bench.controlword(1, 0x000F);
        bench.controlword(1, word);
        status(bench) & BIT_12 != 0
    };
    assert!(!taken(&mut bench, 0x001F));
    assert!(taken(&mut bench, 0x005F), "relative");
    wait_for(&mut bench, TARGET_REACHED, 5);
    referenced(&mut bench);
    set(&mut bench, 0x6060, 0, 1);
    assert!(taken(&mut bench, 0x001F));
}

/// 3041h:11: the error class of a lost heartbeat.
#[test]
fn a_lost_heartbeat_is_of_the_class_asked_for() {
    for (class, state) in [
        (0, State::OperationEnabled),
        (1, State::QuickStopActive),
        (2, State::Fault),
        (3, State::Fault),
    ] {
        let mut bench = drive(3);
        set(&mut bench, 0x3041, 0x11, class);
        set(&mut bench, 0x1016, 1, 0x7F_0032);
        bench.send(0x77F, &[5]);
        bench.wait(ms(100));
        assert_eq!(bench.twin().state(), state, "class {class}");
    }
}

#[test]
fn the_profile_generator_shows_where_it_goes() {
    let mut bench = drive(1);
    set(&mut bench, 0x6081, 0, 60);
    set(&mut bench, 0x607A, 0, 5 * REVOLUTION);
    bench.controlword(1, 0x001F);
    bench.wait(ms(500));
    assert_eq!(bench.read_i32(1, 0x301F, 1), 5 * REVOLUTION);
    assert_eq!(bench.read_i32(1, 0x301F, 5), 60);
    let (reference, actual) = (bench.read_i32(1, 0x301F, 2), position(&mut bench));
    assert!(actual > 1000 && (reference - actual).abs() < 1000);
    let speed = i16::from_le_bytes(bench.read(1, 0x301E, 0x28).unwrap().try_into().unwrap());
    assert!((55..=65).contains(&speed), "{speed}");
}

/// `docs/lxm32m-storage.md` lists them all; SYNCLINE_BLESS=1 writes it.
#[test]
fn the_rows_without_effect_are_listed() {
    let mut list = String::from(
        "# Objects that only store\n\nThe simulated Lexium 32M keeps what is written to these objects, or shows what they began \
         with; nothing follows\nfrom it. All others have an effect ([what is modelled](lxm32m.md)).\n\n",
    );
    let (mut index, mut count) = (0, 0);
    for entry in storage_only() {
        let (sub, name) = (entry.address.sub, entry.name);
        if entry.address.index == index {
            write!(list, ", {sub:X} {name}").unwrap();
        } else {
            index = entry.address.index;
            let before = if count == 0 { "" } else { "\n" };
            write!(list, "{before}- {index:04X}h: {sub:X} {name}").unwrap();
        }
        count += 1;
    }
    writeln!(list, "\n\n{count} of 848 objects.").unwrap();
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/lxm32m-storage.md");
    if std::env::var_os("SYNCLINE_BLESS").is_some() {
        std::fs::write(file, &list).unwrap();
    }
    assert!(
        std::fs::read_to_string(file).unwrap() == list,
        "not as in {file}"
    );
}
