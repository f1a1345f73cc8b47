//! The stepper controller from the bus: network, states, movements, switches, and what its motor
//! loses.

use crate::common::{Bench, TARGET_REACHED, id, ms};
use proptest::prelude::*;
use syncline_canopen::cia402::State;
use syncline_canopen::nmt::Command;
use syncline_canopen::node::BootUp;
use syncline_canopen::{CanId, Frame};
use syncline_drives::bus::Band;
use syncline_drives::twin::node::Processor;
use syncline_drives::twin::servo::shaft::Shaft;
use syncline_drives::twin::tsp10::{
    HaltedTarget, Policies, RelativeTo, SecondTarget, StandbyUnit, Switches, TPdoTrigger, Twin,
    TwinConfig,
};
use syncline_drives::twin::{Disturbance, ErrorClass, SimulatedDevice};

const INVALID: u32 = 0x0609_0030;
const DEVICE_STATE: u32 = 0x0800_0022;
const BIT_12: u16 = 1 << 12;
const BIT_13: u16 = 1 << 13;
const REFERENCED: u32 = 1 << 8;

fn config() -> TwinConfig {
    TwinConfig {
        processor: Processor::prompt(id(1)),
        ..TwinConfig::new(id(1))
    }
}

fn of(config: TwinConfig) -> Bench<Twin> {
    Bench::of([Twin::new(config)])
}

fn with(policies: Policies) -> Bench<Twin> {
    of(TwinConfig {
        policies,
        ..config()
    })
}

fn set(bench: &mut Bench<Twin>, index: u16, sub: u8, value: i32) -> Result<(), u32> {
    let entries = syncline_drives::dictionary::TSP10.iter();
    let mut entries = entries.filter(|it| (it.address.index, it.address.sub) == (index, sub));
    let size = entries.next().unwrap().data_type.size();
    bench.write(1, index, sub, &value.to_le_bytes()[..size])
}

fn status(bench: &mut Bench<Twin>) -> u16 {
    bench.read_u16(1, 0x6041, 0)
}

/// In Operation Enabled with this mode, 3 A, 10 rev/s at most and ramps that suit the motor.
fn enabled(bench: &mut Bench<Twin>, mode: i32) {
    for (index, value) in [
        (0x6075, 3000),
        (0x6081, 20_000),
        (0x6083, 100_000),
        (0x6084, 100_000),
        (0x6085, 200_000),
        (0x609A, 100_000),
    ] {
        set(bench, index, 0, value).unwrap();
    }
    set(bench, 0x6099, 1, 10_000).unwrap();
    set(bench, 0x6060, 0, mode).unwrap();
    for word in [0x06, 0x07, 0x0F] {
        bench.controlword(1, word);
    }
    assert_eq!(bench.twin().state(), State::OperationEnabled);
    assert_eq!(bench.read(1, 0x6061, 0).unwrap(), [mode as u8]);
}

fn drive(mode: i32) -> Bench<Twin> {
    let mut bench = of(config());
    enabled(&mut bench, mode);
    bench
}

fn until(bench: &mut Bench<Twin>, what: &str, holds: impl Fn(&mut Bench<Twin>) -> bool) {
    for _ in 0..4000 {
        if holds(bench) {
            return;
        }
        bench.wait(ms(5));
    }
    panic!("not within 20 s: {what}; statusword {:04X}", status(bench));
}

fn reach(bench: &mut Bench<Twin>) {
    until(bench, "target", |bench| status(bench) & TARGET_REACHED != 0);
}

fn position(bench: &mut Bench<Twin>) -> i32 {
    bench.read_i32(1, 0x6064, 0)
}

/// Starts to go to a target; bit 6 set is relative.
fn go(bench: &mut Bench<Twin>, target: i32, word: u16) {
    bench.controlword(1, 0x0F);
    set(bench, 0x607A, 0, target).unwrap();
    bench.controlword(1, word);
}

// ---- network ----

#[test]
fn it_boots_and_is_neither_guarded_nor_emergent() {
    for (boot_up, answers_guarding) in [(BootUp::Message, false), (BootUp::Silent, true)] {
        let mut bench = with(Policies {
            boot_up,
            answers_guarding,
            ..Policies::default()
        });
        let said = bench.received(0, 0x701);
        assert_eq!(said.len(), usize::from(boot_up == BootUp::Message));
        assert_eq!(bench.remote(0x701).is_some(), answers_guarding);
        bench
            .twin()
            .disturb(Disturbance::Fault(ErrorClass::SwitchOff));
        bench.wait(ms(10));
        assert!(bench.received(0, 0x081).is_empty());
        assert_eq!(bench.number(1, 0x1001, 0), 0x81);
    }
}

#[test]
fn what_sends_a_t_pdo() {
    let count = |t_pdo: TPdoTrigger| {
        let mut bench = with(Policies {
            t_pdo,
            ..Policies::default()
        });
        enabled(&mut bench, 3);
        bench.nmt(Command::Start, 1);
        set(&mut bench, 0x60FF, 0, 5000).unwrap();
        bench.wait(ms(500));
        let from = bench.log.len();
        bench.sync();
        bench.wait(ms(100));
        let sent = bench.received(from, 0x181).len();
        let asked = bench.remote(0x181);
        if sent == 0 {
            assert_eq!(asked, None, "bit 30: no remote request");
        }
        sent
    };
    assert_eq!(count(TPdoTrigger::Status), 0);
    assert!((90..=110).contains(&count(TPdoTrigger::Value)));
    assert!((9..=12).contains(&count(TPdoTrigger::Period(ms(10)))));
}

/// R_PDOs act as they come (307-345).
#[test]
fn r_pdos_on_arrival() {
    let mut bench = drive(3);
    bench.nmt(Command::Start, 1);
    bench.send(0x301, &[0x0F, 0, 0xE8, 0x03, 0, 0]);
    bench.wait(ms(200));
    assert_eq!(bench.read_i32(1, 0x606C, 0), 1000);
    bench.send(0x301, &[0x0F, 0x01, 0xE8, 0x03, 0, 0]);
    bench.wait(ms(200));
    assert_eq!(bench.read_i32(1, 0x606C, 0), 0);
    // Its ramp is over: bit 8 = 0 runs again.
    bench.send(0x301, &[0x0F, 0, 0x18, 0xFC, 0xFF, 0xFF]);
    bench.wait(ms(200));
    assert_eq!(bench.read_i32(1, 0x606C, 0), -1000);
}

// ---- states ----

/// 141-180.
#[test]
fn states_and_their_patterns() {
    let mut bench = of(config());
    assert_eq!(status(&mut bench) & 0x6F, 0x40);
    for (word, state, pattern) in [
        (0x06, State::ReadyToSwitchOn, 0x21),
        // Two transitions, two words.
        (0x0F, State::ReadyToSwitchOn, 0x21),
        (0x07, State::SwitchedOn, 0x23),
        (0x0F, State::OperationEnabled, 0x27),
        (0x02, State::QuickStopActive, 0x07),
        (0x0F, State::OperationEnabled, 0x27),
        (0x07, State::SwitchedOn, 0x23),
        (0x06, State::ReadyToSwitchOn, 0x21),
        (0x02, State::SwitchOnDisabled, 0x40),
    ] {
        bench.controlword(1, word);
        assert_eq!(bench.twin().state(), state, "{word:02X}");
        assert_eq!(status(&mut bench) & 0x6F, pattern);
    }
    bench
        .twin()
        .disturb(Disturbance::Fault(ErrorClass::SwitchOff));
    assert_eq!(status(&mut bench) & 0x6F, 0x28);
    bench.twin().disturb(Disturbance::FaultPersists(true));
    bench.controlword(1, 0x80);
    assert_eq!(bench.twin().state(), State::Fault);
    bench.twin().disturb(Disturbance::FaultPersists(false));
    bench.controlword(1, 0x00);
    bench.controlword(1, 0x80);
    assert_eq!(bench.twin().state(), State::SwitchOnDisabled);
    let mut bench = with(Policies {
        enables_at_once: true,
        ..Policies::default()
    });
    bench.controlword(1, 0x06);
    bench.controlword(1, 0x0F);
    assert_eq!(bench.twin().state(), State::OperationEnabled);
}

/// An input with the function of enabling has to be active (596-621).
#[test]
fn the_enable_input_and_the_rotary_switches() {
    let mut bench = of(config());
    set(&mut bench, 0x2003, 6, 10).unwrap();
    for word in [0x06, 0x07, 0x0F] {
        bench.controlword(1, word);
    }
    assert_eq!(bench.twin().state(), State::SwitchedOn);
    bench.twin().disturb(Disturbance::Input(5, true));
    assert_eq!(bench.number(1, 0x1002, 0) >> 23 & 0x21, 0x21);
    bench.controlword(1, 0x0F);
    assert_eq!(bench.twin().state(), State::OperationEnabled);
    assert_eq!(bench.number(1, 0x1002, 0) & 0xFF, 1);
}

// ---- profile position ----

#[test]
fn absolute_and_relative() {
    for (relative_to, ends) in [(RelativeTo::Demand, 12_000), (RelativeTo::Target, 12_000)] {
        let mut bench = with(Policies {
            relative_to,
            ..Policies::default()
        });
        enabled(&mut bench, 1);
        for (target, word, expected) in [(10_000, 0x1F, 10_000), (2000, 0x5F, ends)] {
            go(&mut bench, target, word);
            assert_ne!(status(&mut bench) & BIT_12, 0);
            reach(&mut bench);
            assert_eq!(position(&mut bench), expected);
        }
        bench.wait(ms(300));
        assert!((bench.twin().observe().position - 1.2).abs() < 5e-3);
    }
    let mut strict = with(Policies {
        absolute_without_reference: false,
        ..Policies::default()
    });
    enabled(&mut strict, 1);
    go(&mut strict, 10_000, 0x1F);
    assert_eq!(status(&mut strict) & BIT_12, 0);
}

#[test]
fn a_second_target_while_moving() {
    for (second_target, expected) in [
        (SecondTarget::AtOnce, -5000),
        (SecondTarget::Ignored, 40_000),
    ] {
        let mut bench = with(Policies {
            second_target,
            ..Policies::default()
        });
        enabled(&mut bench, 1);
        go(&mut bench, 40_000, 0x1F);
        bench.wait(ms(300));
        go(&mut bench, -5000, 0x1F);
        reach(&mut bench);
        assert_eq!(position(&mut bench), expected);
    }
}

#[test]
fn units_and_direction() {
    let mut bench = of(config());
    set(&mut bench, 0x6092, 1, 400).unwrap();
    set(&mut bench, 0x6092, 2, 2).unwrap();
    set(&mut bench, 0x2002, 0, 1).unwrap();
    assert_eq!(set(&mut bench, 0x6092, 1, 0), Err(INVALID));
    enabled(&mut bench, 1);
    for (index, value) in [(0x6081, 400), (0x6083, 2000), (0x6084, 2000)] {
        set(&mut bench, index, 0, value).unwrap();
    }
    go(&mut bench, 300, 0x1F);
    reach(&mut bench);
    bench.wait(ms(300));
    assert!((bench.twin().observe().position + 1.5).abs() < 5e-3);
    assert_eq!(set(&mut bench, 0x2002, 0, 0), Err(DEVICE_STATE));
    // The slow homing speed is the fast one (888).
    set(&mut bench, 0x6099, 1, 77).unwrap();
    assert_eq!(bench.number(1, 0x6099, 2), 77);
}

// ---- homing ----

#[test]
fn every_method() {
    let switches = Switches {
        lower_limit: Some(-2.0),
        upper_limit: Some(2.0),
        reference: Some(0.75..1.25),
    };
    for (method, start, expected) in [
        (17, 0.0, -2.0),
        (18, 0.0, 2.0),
        (24, 0.0, 0.75),
        (25, 0.0, 1.25),
        (28, 1.5, 1.25),
        (29, 1.5, 0.75),
        (35, 0.3, 0.3),
        (37, -0.3, -0.3),
        // From the switch, and by way of a limit switch (914-923).
        (24, 1.0, 0.75),
        (25, 1.5, 1.25),
        (28, 0.0, 1.25),
        (17, -2.5, -2.0),
    ] {
        let mut bench = of(TwinConfig {
            position: start,
            switches: switches.clone(),
            ..config()
        });
        enabled(&mut bench, 6);
        set(&mut bench, 0x607C, 0, 5000).unwrap();
        set(&mut bench, 0x6098, 0, method).unwrap();
        bench.controlword(1, 0x1F);
        until(&mut bench, "referenced", |bench| {
            bench.number(1, 0x1002, 0) & REFERENCED != 0
        });
        assert_eq!(status(&mut bench) & (BIT_12 | BIT_13), BIT_12);
        // At home the position is 607Ch (912).
        assert_eq!(position(&mut bench), 5000);
        bench.wait(ms(500));
        let at = bench.twin().observe().position;
        assert!(
            (at - expected).abs() < 0.02,
            "method {method}: {at}, {expected}"
        );
    }
    let mut bench = of(config());
    for method in [0, 1, 2, 19, 23, 26, 33, 34, 36] {
        assert_eq!(set(&mut bench, 0x6098, 0, method), Err(INVALID), "{method}");
    }
}

#[test]
fn homing_that_does_not_end() {
    let switches = Switches {
        lower_limit: Some(-2.0),
        upper_limit: Some(2.0),
        reference: None,
    };
    let mut bench = of(TwinConfig {
        switches,
        ..config()
    });
    enabled(&mut bench, 6);
    set(&mut bench, 0x6098, 0, 24).unwrap();
    // Bit 4 = 0 stops it (905).
    bench.controlword(1, 0x1F);
    bench.wait(ms(300));
    bench.controlword(1, 0x0F);
    bench.wait(ms(500));
    assert!(bench.twin().observe().velocity.abs() < 0.05);
    assert_eq!(bench.twin().state(), State::OperationEnabled);
    // The stop switch as well, without alarm (912).
    bench.controlword(1, 0x1F);
    bench.wait(ms(300));
    bench.twin().disturb(Disturbance::Input(4, true));
    bench.wait(ms(500));
    assert_eq!(bench.twin().state(), State::OperationEnabled);
    assert!(bench.twin().observe().velocity.abs() < 0.05);
    bench.twin().disturb(Disturbance::Input(4, false));
    // The second limit switch is an alarm.
    bench.controlword(1, 0x0F);
    bench.controlword(1, 0x1F);
    until(&mut bench, "alarm", |bench| {
        bench.twin().state() == State::Fault
    });
    assert_ne!(status(&mut bench) & BIT_13, 0);
}

// ---- inputs ----

/// DE2 = -1 is the lower limit switch, active high (619-621).
#[test]
fn functions_and_their_inversion() {
    let mut bench = of(config());
    let flags = |bench: &mut Bench<Twin>| bench.number(1, 0x1002, 0) >> 9 & 0xF;
    assert_eq!(flags(&mut bench), 0);
    set(&mut bench, 0x2003, 2, -1).unwrap();
    assert_eq!(flags(&mut bench), 1, "its input rests high");
    set(&mut bench, 0x2003, 2, 0).unwrap();
    set(&mut bench, 0x2003, 7, 1).unwrap();
    assert_eq!(flags(&mut bench), 1, "open is active");
    bench.twin().disturb(Disturbance::Input(6, true));
    assert_eq!(flags(&mut bench), 0);
    bench.twin().disturb(Disturbance::Input(4, true));
    assert_eq!(flags(&mut bench), 8);
}

#[test]
fn a_limit_switch_stops_what_runs_towards_it() {
    for limit_is_fault in [false, true] {
        let mut bench = of(TwinConfig {
            switches: Switches {
                upper_limit: Some(0.5),
                ..Switches::default()
            },
            policies: Policies {
                limit_is_fault,
                ..Policies::default()
            },
            ..config()
        });
        enabled(&mut bench, 3);
        set(&mut bench, 0x60FF, 0, 10_000).unwrap();
        bench.wait(ms(1000));
        assert!(bench.twin().observe().velocity.abs() < 0.05);
        assert_ne!(status(&mut bench) & 0x0800, 0);
        assert_eq!(bench.twin().state() == State::Fault, limit_is_fault);
        if !limit_is_fault {
            set(&mut bench, 0x60FF, 0, -10_000).unwrap();
            bench.wait(ms(500));
            assert!(bench.twin().observe().velocity < -0.5);
        }
    }
}

// ---- the motor ----

/// Holding torque by current: in standby less (548-566), whose unit is in doubt.
#[test]
fn a_blocked_rotor_loses_steps_that_only_an_encoder_sees() {
    for counts in [0, 4000] {
        let mut bench = of(config());
        set(&mut bench, 0x608F, 1, counts).unwrap();
        enabled(&mut bench, 1);
        bench.twin().disturb(Disturbance::Block(true));
        go(&mut bench, 20_000, 0x1F);
        reach(&mut bench);
        bench.twin().disturb(Disturbance::Block(false));
        bench.wait(ms(500));
        let lost = bench.twin().lost_steps();
        // Four full steps of 50 at a time: 200 of 10 000.
        assert!(lost > 19_000.0, "{lost}");
        let off = lost - (lost / 200.0).round() * 200.0;
        assert!(off.abs() < 30.0, "{lost}");
        assert_eq!(bench.read_i32(1, 0x6062, 0), 20_000);
        let seen = position(&mut bench);
        if counts == 0 {
            assert_eq!(seen, 20_000, "nothing shows it");
        } else {
            assert!(seen.abs() < 700, "{seen}");
        }
    }
}

/// Too steep a ramp, and too little current, for what the motor moves.
#[test]
fn steps_are_lost_when_the_torque_is_exceeded_and_none_within_it() {
    let lost = |current: i32, acceleration: i32, velocity: i32| {
        let mut bench = drive(1);
        set(&mut bench, 0x6075, 0, current).unwrap();
        set(&mut bench, 0x6083, 0, acceleration).unwrap();
        set(&mut bench, 0x6084, 0, acceleration).unwrap();
        set(&mut bench, 0x6081, 0, velocity).unwrap();
        go(&mut bench, 50_000, 0x1F);
        reach(&mut bench);
        bench.wait(ms(500));
        bench.twin().lost_steps().abs()
    };
    assert!(lost(3000, 100_000, 20_000) < 30.0);
    // The same ramps within what the field can draw at once, and beyond.
    assert!(lost(3000, 20_000_000, 20_000) < 30.0);
    assert!(lost(3000, 20_000_000, 200_000) > 150.0);
    assert!(lost(400, 1_000_000, 100_000) > 150.0);
}

/// How far the rotor is off its field at the most while that makes so many full steps in a second, of 200 in a revolution and
/// each in so many micro-steps; full steps.
fn swing(rate: i32, micro_steps: i32) -> f64 {
    let mut bench = of(config());
    set(&mut bench, 0x6092, 1, 200 * micro_steps).unwrap();
    enabled(&mut bench, 3);
    set(&mut bench, 0x6083, 0, 10_000 * micro_steps).unwrap();
    set(&mut bench, 0x60FF, 0, rate * micro_steps).unwrap();
    bench.wait(ms(500));
    let mut most = 0.0_f64;
    for _ in 0..700 {
        bench.wait(ms(1));
        most = most.max(bench.twin().lost_steps().abs());
    }
    most / f64::from(micro_steps)
}

/// With 3 A and this inertia the rotor swings 67 times a second.
#[test]
fn whole_steps_have_a_region_of_resonance_and_micro_steps_have_none() {
    for rate in [63, 67, 71] {
        let [whole, micro] = [1, 50].map(|micro_steps| swing(rate, micro_steps));
        assert!(whole > 0.7 && micro < 0.05, "{rate}: {whole}, {micro}");
    }
    for rate in [160, 200, 300] {
        let [whole, micro] = [1, 50].map(|micro_steps| swing(rate, micro_steps));
        assert!(whole < 0.2 && micro < 0.05, "{rate}: {whole}, {micro}");
    }
}

#[test]
fn standby_current_holds_by_its_share() {
    let sags = |standby_unit: StandbyUnit| {
        let mechanics = syncline_drives::mechanics::rigid::Rigid {
            load_torque: 0.3,
            coulomb_friction: 0.0,
            ..syncline_drives::mechanics::rigid::Rigid::default()
        };
        let mut bench = of(TwinConfig {
            mechanics: mechanics.into(),
            policies: Policies {
                standby_unit,
                ..Policies::default()
            },
            ..config()
        });
        enabled(&mut bench, 1);
        bench.wait(ms(1000));
        bench.twin().lost_steps().abs()
    };
    // 1.5 A hold 0.9 N·m, 0.15 A only 0.09.
    assert!(sags(StandbyUnit::Percent) < 50.0);
    assert!(sags(StandbyUnit::Thousandths) > 1000.0);
}

// ---- properties ----

fn frame() -> impl Strategy<Value = Frame> {
    let ids = prop_oneof![
        5 => Just(0x601u16),
        3 => prop::sample::select(vec![0x201u16, 0x301]),
        1 => Just(0x000),
        1 => 0u16..0x800,
    ];
    let indices = prop::sample::select(vec![
        0x6040u16, 0x6060, 0x6075, 0x607A, 0x607C, 0x6081, 0x6083, 0x6084, 0x6085, 0x608F, 0x6092,
        0x6098, 0x6099, 0x609A, 0x60FF, 0x2001, 0x2002, 0x2003, 0x1002, 0x1008, 0x1A00,
    ]);
    let commands = prop::sample::select(vec![0x22u8, 0x23, 0x2B, 0x2F, 0x40, 0x60]);
    let data = prop_oneof![
        2 => (0u32..0x100).prop_map(u32::to_le_bytes),
        1 => (0u32..0x10_0000).prop_map(u32::to_le_bytes),
        1 => any::<[u8; 4]>(),
    ];
    let sdo = (commands, indices, 0u8..5, data).prop_map(|(command, index, sub, data)| {
        let [low, high] = index.to_le_bytes();
        [&[command, low, high, sub][..], &data].concat()
    });
    let words = prop::sample::select(vec![0x00u8, 0x02, 0x06, 0x07, 0x0F, 0x1F, 0x5F, 0x80]);
    let pdo = (words, 0u8..2, any::<[u8; 4]>())
        .prop_map(|(low, high, data)| [&[low, high][..], &data].concat());
    let data = prop_oneof![4 => sdo, 3 => pdo, 1 => prop::collection::vec(any::<u8>(), 0..9)];
    (ids, data).prop_map(|(id, data)| Frame::new(CanId::Standard(id), &data))
}

proptest! {
    /// Whatever comes: no panic, finite motion, a legal state, and none without an enable.
    #[test]
    fn random_frames(
        mode in prop::sample::select(vec![1, 3, 6]),
        is_enabled in any::<bool>(),
        frames in prop::collection::vec((frame(), 0u64..3000), 1..80),
    ) {
        let mut bench = of(config());
        if is_enabled {
            enabled(&mut bench, mode);
        }
        bench.nmt(Command::Start, 1);
        let rest = bench.twin().observe().position;
        let mut may_move = is_enabled;
        for (frame, wait) in frames {
            may_move |= frame.data().windows(2).any(|word| word[0] & 0x8F == 0x0F);
            bench.bus.send(Band::Acyclic, frame);
            bench.wait(std::time::Duration::from_micros(wait));
            let seen = bench.twin().observe();
            prop_assert!(seen.position.is_finite() && seen.velocity.is_finite());
            prop_assert!(bench.twin().statusword().state().is_some());
            if !may_move {
                prop_assert!(!seen.is_powered);
                prop_assert_eq!(seen.position, rest);
            }
        }
    }
}

/// Bit 10 tells that 60FFh has been reached, 0 as every other velocity, and after a Halt nothing.
#[test]
fn a_velocity_of_zero_is_reached_too() {
    let mut bench = drive(3);
    for velocity in [5_000, 0, -5_000, 0] {
        set(&mut bench, 0x60FF, 0, velocity).unwrap();
        bench.wait(ms(10));
        assert_eq!(status(&mut bench) & TARGET_REACHED, 0, "{velocity}");
        bench.wait(ms(500));
        assert_ne!(status(&mut bench) & TARGET_REACHED, 0, "{velocity}");
    }
    set(&mut bench, 0x60FF, 0, 5_000).unwrap();
    bench.wait(ms(500));
    bench.controlword(1, 0x10F);
    bench.wait(ms(500));
    assert_eq!(status(&mut bench) & TARGET_REACHED, 0);
}

/// Bit 11 follows the limit switches, whether the power stage is on or off.
#[test]
fn a_limit_switch_is_told_with_the_power_stage_off() {
    let mut bench = of(TwinConfig {
        switches: Switches {
            upper_limit: Some(0.5),
            ..Switches::default()
        },
        ..config()
    });
    enabled(&mut bench, 3);
    set(&mut bench, 0x60FF, 0, 10_000).unwrap();
    bench.wait(ms(1000));
    assert_ne!(status(&mut bench) & 0x0800, 0);
    bench.controlword(1, 0x06);
    assert_ne!(status(&mut bench) & 0x0800, 0);
    // Somebody turns it back by hand.
    let shaft = bench.twin().shaft_mut().unwrap();
    *shaft = Shaft::new(syncline_drives::mechanics::rigid::Rigid::default(), 0.0);
    bench.wait(ms(10));
    assert_eq!(status(&mut bench) & 0x0800, 0);
}

// ---- halt ----

/// How far it goes from the word with bit 8 until it stands, steps.
fn halts(bench: &mut Bench<Twin>, word: u16) -> i32 {
    let before = position(bench);
    bench.controlword(1, word);
    until(bench, "standstill", |bench| {
        bench.twin().observe().velocity.abs() < 0.01
    });
    bench.wait(ms(300));
    (position(bench) - before).abs()
}

/// In homing bit 8 brakes with 609Ah, and the movement goes on when it falls (907-908).
#[test]
fn halt_interrupts_homing() {
    // From rest, at speed, on the way off the switch: 10 000 steps/s, and ramps of 20 000 steps/s².
    for halted_after in [20, 400, 1100, 1350] {
        let mut bench = of(TwinConfig {
            position: 0.0,
            switches: Switches {
                lower_limit: Some(-2.0),
                upper_limit: Some(2.0),
                reference: Some(0.75..1.25),
            },
            ..config()
        });
        enabled(&mut bench, 6);
        set(&mut bench, 0x609A, 0, 20_000).unwrap();
        set(&mut bench, 0x607C, 0, 5000).unwrap();
        set(&mut bench, 0x6098, 0, 24).unwrap();
        bench.controlword(1, 0x1F);
        bench.wait(ms(halted_after));
        let velocity = bench.twin().observe().velocity.abs() * 10_000.0;
        let went = f64::from(halts(&mut bench, 0x011F));
        let braking = velocity * velocity / 2.0 / 20_000.0;
        assert!(
            (went - braking).abs() < 150.0,
            "{halted_after} ms: {went}, {braking}"
        );
        assert_eq!(bench.number(1, 0x1002, 0) & REFERENCED, 0);
        assert_eq!(bench.twin().state(), State::OperationEnabled);
        let at = position(&mut bench);
        bench.wait(ms(500));
        assert_eq!(position(&mut bench), at);
        bench.controlword(1, 0x1F);
        until(&mut bench, "referenced", |bench| {
            bench.number(1, 0x1002, 0) & REFERENCED != 0
        });
        bench.wait(ms(500));
        let at = bench.twin().observe().position;
        assert!((at - 0.75).abs() < 0.02, "{halted_after} ms: {at}");
        assert_eq!(position(&mut bench), 5000);
    }
    // One that begins while bit 8 is set stands until it falls, and one that is stopped meanwhile is over.
    for (stopped, found) in [(false, REFERENCED), (true, 0)] {
        let mut bench = drive(6);
        set(&mut bench, 0x6098, 0, 24).unwrap();
        bench.controlword(1, 0x011F);
        bench.wait(ms(500));
        assert_eq!(position(&mut bench), 0);
        if stopped {
            bench.controlword(1, 0x010F);
        }
        bench.controlword(1, if stopped { 0x0F } else { 0x1F });
        bench.wait(ms(500));
        assert_eq!(position(&mut bench) != 0, found != 0);
    }
}

/// On the way to a target it brakes with 6084h; whether it goes on there is a policy.
#[test]
fn halt_on_the_way_to_a_target() {
    for (halted_target, ends) in [(HaltedTarget::Kept, true), (HaltedTarget::Dropped, false)] {
        let mut bench = with(Policies {
            halted_target,
            ..Policies::default()
        });
        enabled(&mut bench, 1);
        go(&mut bench, 40_000, 0x1F);
        bench.wait(ms(500));
        let velocity = bench.twin().observe().velocity.abs() * 10_000.0;
        let went = f64::from(halts(&mut bench, 0x011F));
        let braking = velocity * velocity / 2.0 / 100_000.0;
        assert!((went - braking).abs() < 200.0, "{went}, {braking}");
        assert_eq!(status(&mut bench) & TARGET_REACHED, 0);
        let at = position(&mut bench);
        // No edge of bit 4.
        bench.controlword(1, 0x1F);
        bench.wait(ms(3000));
        let to = if ends { 40_000 } else { at };
        assert_eq!(position(&mut bench), to);
        assert_eq!(status(&mut bench) & TARGET_REACHED != 0, ends);
        // A target that comes as the halt ends counts, and nothing else.
        go(&mut bench, 0, 0x1F);
        bench.wait(ms(300));
        halts(&mut bench, 0x011F);
        go(&mut bench, 20_000, 0x010F);
        bench.controlword(1, 0x1F);
        reach(&mut bench);
        assert_eq!(position(&mut bench), 20_000);
        // What was halted is over with the power stage off.
        go(&mut bench, 0, 0x1F);
        bench.wait(ms(300));
        halts(&mut bench, 0x011F);
        for word in [0x06, 0x07, 0x0F] {
            bench.controlword(1, word);
        }
        let at = position(&mut bench);
        bench.wait(ms(1000));
        assert_eq!(position(&mut bench), at);
    }
}
