//! The controller from the bus: network, states, signals, what is kept.

use crate::common::tlc5xx::{
    DEVICE_STATE, FAILED, INCOMPATIBLE, INVALID, LOCAL_CONTROL, config, drive, enabled, is_at, of,
    position, reach, set, switches, until, with,
};
use crate::common::{Bench, ms, status};
use syncline_canopen::cia402::State;
use syncline_canopen::nmt::{self, Command};
use syncline_canopen::node::BootUp;
use syncline_drives::mechanics::rigid::Rigid;
use syncline_drives::twin::servo::cascade::Gains;
use syncline_drives::twin::tlc5xx::{
    Bit9, DriveError, FaultBits, Policies, Profile, SigProfileError, Twin, TwinConfig,
};
use syncline_drives::twin::{Disturbance, ErrorClass, SimulatedDevice};

// ---- network ----

#[test]
fn both_forms_of_boot_up() {
    for (boot_up, id, data) in [
        (BootUp::EmptyEmergency, 0x081, vec![]),
        (BootUp::Message, 0x701, vec![0]),
    ] {
        let bench = with(Policies {
            boot_up,
            ..Policies::default()
        });
        assert_eq!(bench.received(0, id), [data]);
    }
}

#[test]
fn the_makers_own_profile_is_refused_with_the_reason() {
    let refused = Twin::new(TwinConfig {
        profile: Profile::SigPositec,
        ..config()
    });
    let Err(error) = refused else {
        panic!("taken");
    };
    assert_eq!(error, SigProfileError);
    assert!(error.to_string().contains("M4.profilCan = 1"), "{error}");
}

/// Heartbeat and guarding must not be used at the same time (2237-2245).
#[test]
fn guarding_or_heartbeat() {
    let mut bench = of(config());
    set(&mut bench, 0x1017, 0, 50).unwrap();
    set(&mut bench, 0x100C, 0, 100).unwrap();
    assert_eq!(set(&mut bench, 0x100D, 0, 2), Err(INCOMPATIBLE));
    assert_eq!(bench.remote(0x701).map(|data| data.len()), None);
    set(&mut bench, 0x1017, 0, 0).unwrap();
    set(&mut bench, 0x100D, 0, 2).unwrap();
    assert_eq!(set(&mut bench, 0x1017, 0, 50), Err(INCOMPATIBLE));
    assert_eq!(bench.remote(0x701), Some(vec![0x7F]));
}

/// Either loss is an error of the device; what it does to the NMT state is not described.
#[test]
fn a_lost_master() {
    for by_heartbeat in [true, false] {
        let mut bench = drive(1);
        bench.nmt(Command::Start, 1);
        if by_heartbeat {
            set(&mut bench, 0x1016, 1, 0x007F_0064).unwrap();
            bench.send(0x77F, &[5]);
        } else {
            set(&mut bench, 0x100C, 0, 50).unwrap();
            set(&mut bench, 0x100D, 0, 2).unwrap();
            bench.remote(0x701).unwrap();
        }
        bench.wait(ms(80));
        assert_eq!(bench.twin().state(), State::OperationEnabled);
        let from = bench.log.len();
        bench.wait(ms(100));
        assert_eq!(bench.twin().state(), State::Fault);
        assert_eq!(
            bench.received(from, 0x081),
            [[0x30, 0x81, 0x11, 0, 0, 0, 0, 0]]
        );
        assert_eq!(bench.twin().observe().nmt_state, nmt::State::Operational);
    }
}

#[test]
fn identifiers_and_mappings_are_changed_in_pre_operational() {
    let mut bench = of(config());
    bench.nmt(Command::Start, 1);
    for (index, sub, value) in [
        (0x1005, 0, 0x100),
        (0x1014, 0, 0x181),
        (0x1800, 1, 0x281),
        (0x1A00, 0, 0),
    ] {
        assert_eq!(
            set(&mut bench, index, sub, value),
            Err(DEVICE_STATE),
            "{index:04X}"
        );
    }
    // Switching a PDO is no change of its identifier.
    assert_eq!(set(&mut bench, 0x1801, 1, 0x281), Ok(()));
    bench.nmt(Command::EnterPreOperational, 1);
    // The node's part of an identifier is read only (7679).
    set(&mut bench, 0x1800, 1, 0x2FF).unwrap();
    assert_eq!(bench.number(1, 0x1800, 1), 0x281);
    let mut lax = with(Policies {
        parameters_in_operational: true,
        ..Policies::default()
    });
    lax.nmt(Command::Start, 1);
    assert_eq!(set(&mut lax, 0x1A00, 0, 0), Ok(()));
}

#[test]
fn another_mapping() {
    let mut bench = of(config());
    for (sub, value) in [
        (0, 0),
        (1, 0x6064_0020),
        (2, 0x2075_0010),
        (3, 0x6061_0008),
        (0, 3),
    ] {
        set(&mut bench, 0x1A00, sub, value).unwrap();
    }
    assert_eq!(set(&mut bench, 0x1A02, 0, 0), Ok(()));
    for sub in 1..=3 {
        set(&mut bench, 0x1A02, sub, 0x6064_0020).unwrap();
    }
    assert_eq!(set(&mut bench, 0x1A02, 0, 3), Err(0x0604_0042), "12 bytes");
    let from = bench.log.len();
    bench.nmt(Command::Start, 1);
    assert_eq!(bench.received(from, 0x181), [[0, 0, 0, 0, 0, 0, 1]]);
}

// ---- states ----

/// 2641-2677, by the controlwords of 2709-2728.
#[test]
fn every_transition_and_its_pattern() {
    const WORDS: [(u16, &str); 6] = [
        (0x0006, "shutdown"),
        (0x0007, "switch on"),
        (0x0000, "disable voltage"),
        (0x0002, "quick stop"),
        (0x000F, "enable"),
        (0x0080, "reset"),
    ];
    let bring = |state: State| {
        let mut bench = of(config());
        let words: &[u16] = match state {
            State::ReadyToSwitchOn => &[0x06],
            State::SwitchedOn => &[0x06, 0x07],
            State::OperationEnabled => &[0x06, 0x0F],
            State::QuickStopActive => &[0x06, 0x0F, 0x02],
            _ => &[],
        };
        for word in words {
            bench.controlword(1, *word);
        }
        if state == State::Fault {
            bench.twin().raise(DriveError::CONNECTION_LOST);
        }
        assert_eq!(bench.twin().state(), state);
        bench
    };
    use State::{
        Fault, OperationEnabled, QuickStopActive, ReadyToSwitchOn, SwitchOnDisabled, SwitchedOn,
    };
    for (from, pattern, leads) in [
        (SwitchOnDisabled, 0x40, [(0x06, ReadyToSwitchOn)].as_slice()),
        (
            ReadyToSwitchOn,
            0x21,
            &[
                (0x07, SwitchedOn),
                (0x00, SwitchOnDisabled),
                (0x02, SwitchOnDisabled),
                (0x0F, OperationEnabled),
            ],
        ),
        (
            SwitchedOn,
            0x23,
            &[
                (0x06, ReadyToSwitchOn),
                (0x00, SwitchOnDisabled),
                (0x02, SwitchOnDisabled),
                (0x0F, OperationEnabled),
            ],
        ),
        (
            OperationEnabled,
            0x27,
            &[
                (0x06, ReadyToSwitchOn),
                (0x07, SwitchedOn),
                (0x00, SwitchOnDisabled),
                (0x02, QuickStopActive),
            ],
        ),
        (
            QuickStopActive,
            0x07,
            &[(0x00, SwitchOnDisabled), (0x0F, OperationEnabled)],
        ),
        (Fault, 0x0F, &[(0x80, SwitchOnDisabled)]),
    ] {
        for (word, what) in WORDS {
            let mut bench = bring(from);
            assert_eq!(status(&mut bench) & 0x6F, pattern, "{from}");
            let number = u32::from(bench.twin().state() != SwitchOnDisabled);
            assert!(bench.number(1, 0x2041, 0) & 0xF >= 3 + number);
            bench.controlword(1, word);
            let leads = leads.iter().find(|(by, _)| *by == word);
            let expected = leads.map_or(from, |(_, to)| *to);
            assert_eq!(bench.twin().state(), expected, "{what} in {from}");
        }
    }
}

/// The manufacturer's own control word (10028-10040) reads as 0, and its bits are edges.
#[test]
fn the_manufacturers_control_and_status() {
    let mut bench = of(config());
    let state = |bench: &mut Bench<Twin>| bench.number(1, 0x2041, 0) & 0xF;
    assert_eq!(state(&mut bench), 3);
    for (bits, expected) in [(2, 6), (4, 7), (2, 6), (1, 3)] {
        set(&mut bench, 0x2040, 0, bits).unwrap();
        bench.wait(ms(10));
        assert_eq!(bench.number(1, 0x2040, 0), 0);
        assert_eq!(state(&mut bench), expected, "{bits}");
    }
    bench.twin().raise(DriveError::CONNECTION_LOST);
    assert_eq!(bench.number(1, 0x2041, 0) & 0x802F, 0x8029);
    set(&mut bench, 0x2040, 0, 8).unwrap();
    assert_eq!(state(&mut bench), 3);
}

#[test]
fn statusword_policies() {
    let mut bench = with(Policies {
        remote: Bit9::SetIsFieldbus,
        fault: FaultBits::OfProfile,
        ..Policies::default()
    });
    assert_eq!(status(&mut bench), 0x0240);
    bench.twin().raise(DriveError::CONNECTION_LOST);
    assert_eq!(status(&mut bench), 0x0208);
    bench.twin().disturb(Disturbance::Remote(false));
    assert_eq!(status(&mut bench), 0x0008);
    bench.twin().disturb(Disturbance::Mains(false));
    assert_eq!(status(&mut bench), 0x0018);
}

#[test]
fn errors_by_their_class_and_the_last_twenty() {
    for (class, state) in [
        (ErrorClass::Warning, State::OperationEnabled),
        (ErrorClass::QuickStop, State::QuickStopActive),
        (ErrorClass::StopAndSwitchOff, State::Fault),
        (ErrorClass::SwitchOff, State::Fault),
        (ErrorClass::Fatal, State::Fault),
    ] {
        let mut bench = drive(1);
        bench.twin().disturb(Disturbance::Fault(class));
        bench.wait(ms(50));
        assert_eq!(bench.twin().state(), state, "{class:?}");
    }
    let mut bench = of(config());
    for number in 0..25_u16 {
        bench.twin().raise(DriveError {
            class: ErrorClass::Warning,
            code: 0x1000 + number,
            register: 0,
        });
    }
    bench.wait(ms(50));
    let newest: Vec<u32> = (1..=20).map(|sub| bench.number(1, 0x2400, sub)).collect();
    let expected: Vec<u32> = (0..20).map(|age| 0x1018 - age).collect();
    assert_eq!(newest, expected);
    assert_eq!(bench.number(1, 0x603F, 0), 0x1018);
    assert_eq!(bench.number(1, 0x1003, 1), 0x1018);
    assert_eq!(bench.number(1, 0x1003, 0), 1);
}

#[test]
fn a_fault_is_reset_once_its_cause_is_gone() {
    for emcy_on_reset in [false, true] {
        let mut bench = with(Policies {
            emcy_on_reset,
            ..Policies::default()
        });
        bench.twin().raise(DriveError::CONNECTION_LOST);
        bench.twin().disturb(Disturbance::FaultPersists(true));
        bench.wait(ms(5));
        assert_eq!(bench.number(1, 0x1001, 0), 0x11);
        bench.controlword(1, 0x80);
        assert_eq!(bench.twin().state(), State::Fault);
        bench.twin().disturb(Disturbance::FaultPersists(false));
        let from = bench.log.len();
        bench.controlword(1, 0x00);
        bench.controlword(1, 0x80);
        assert_eq!(bench.twin().state(), State::SwitchOnDisabled);
        assert_eq!(bench.number(1, 0x1001, 0), 0);
        assert_eq!(
            bench.received(from, 0x081).len(),
            usize::from(emcy_on_reset)
        );
    }
}

/// While a local unit has control the fieldbus reads, and commands nothing (2813-2815, 589).
#[test]
fn local_control_lost_and_regained() {
    let mut bench = drive(1);
    bench.nmt(Command::Start, 1);
    bench.twin().disturb(Disturbance::Remote(false));
    assert_eq!(status(&mut bench) & 0x0200, 0x0200);
    assert_eq!(set(&mut bench, 0x6040, 0, 0), Err(LOCAL_CONTROL));
    bench.send(0x201, &[0, 0]);
    bench.wait(ms(5));
    assert_eq!(bench.twin().state(), State::OperationEnabled);
    assert_eq!(set(&mut bench, 0x6083, 0, 700), Ok(()));
    bench.twin().disturb(Disturbance::Remote(true));
    bench.send(0x201, &[0, 0]);
    bench.wait(ms(5));
    assert_eq!(bench.twin().state(), State::SwitchOnDisabled);
    // 2060h keeps it for the fieldbus (10944).
    set(&mut bench, 0x2060, 0, 1).unwrap();
    bench.twin().disturb(Disturbance::Remote(false));
    assert_eq!(status(&mut bench) & 0x0200, 0);
}

// ---- signals ----

#[test]
fn limit_switches_and_stop() {
    for (target, signal) in [(100_000, 1), (-100_000, 2)] {
        let mut bench = of(TwinConfig {
            switches: switches(),
            ..config()
        });
        enabled(&mut bench, 1);
        set(&mut bench, 0x607A, 0, target).unwrap();
        bench.controlword(1, 0x5F);
        until(&mut bench, 10, "limit", |bench| {
            bench.twin().state() == State::QuickStopActive
        });
        assert_eq!(bench.number(1, 0x2048, 0), signal);
        assert_ne!(bench.number(1, 0x2091, 0) & FAILED, 0);
        // Back from it, after the reset.
        bench.wait(ms(500));
        bench.controlword(1, 0x80);
        bench.controlword(1, 0x0F);
        set(&mut bench, 0x607A, 0, 0).unwrap();
        bench.controlword(1, 0x5F);
        reach(&mut bench);
        assert!(is_at(&mut bench, 0));
    }
    let mut bench = drive(3);
    set(&mut bench, 0x60FF, 0, 300).unwrap();
    bench.wait(ms(100));
    bench.twin().set_stop(true);
    bench.wait(ms(500));
    assert_eq!(bench.twin().state(), State::QuickStopActive);
    assert_eq!(bench.number(1, 0x2048, 0), 8);
    // Not where 2046h does not enable it.
    let mut bench = drive(3);
    set(&mut bench, 0x2046, 0, 7).unwrap();
    bench.twin().set_stop(true);
    set(&mut bench, 0x60FF, 0, 300).unwrap();
    bench.wait(ms(500));
    assert_eq!(bench.twin().state(), State::OperationEnabled);
}

#[test]
fn inputs_and_outputs() {
    let mut bench = of(TwinConfig {
        position: 3.0,
        switches: switches(),
        ..config()
    });
    // Active low as delivered: LIMP (bit 1) is active.
    assert_eq!(bench.number(1, 0x60FD, 0) & 0xF, 0b1101);
    set(&mut bench, 0x2047, 0, 15).unwrap();
    assert_eq!(bench.number(1, 0x60FD, 0) & 0xF, 0b0010);
    bench.twin().set_inputs(0xFFFF_FFFF);
    assert_eq!(bench.number(1, 0x60FD, 0), 0xFFFF_0002);
    set(&mut bench, 0x60FE, 1, 0x0015_0000).unwrap();
    assert_eq!(bench.twin().outputs(), 0);
    set(&mut bench, 0x60FE, 2, 0x0004_0000).unwrap();
    assert_eq!(bench.twin().outputs(), 0x0004_0000);
}

#[test]
fn fast_capture() {
    let mut bench = drive(3);
    // Channel 1 at the rising edge of CAPTURE1, channel 2 at the index pulse.
    set(&mut bench, 0x2016, 0, 0b1100).unwrap();
    set(&mut bench, 0x2018, 0, 0b11).unwrap();
    set(&mut bench, 0x2019, 0, 0b11).unwrap();
    set(&mut bench, 0x60FF, 0, 60).unwrap();
    bench.wait(ms(500));
    bench.twin().set_inputs(1 << 21);
    bench.wait(ms(2));
    assert_eq!(bench.number(1, 0x202A, 0) & 1, 1);
    let (captured, now) = (bench.read_i32(1, 0x202B, 0), position(&mut bench));
    assert!((0..100).contains(&(now - captured)), "{captured} {now}");
    until(&mut bench, 5, "index", |bench| {
        bench.number(1, 0x202A, 0) & 2 != 0
    });
    assert_eq!(bench.read_i32(1, 0x202C, 0) % 16_384, 0);
    // Once: the next edge is not taken; armed again, it is.
    bench.twin().set_inputs(0);
    bench.wait(ms(5));
    bench.twin().set_inputs(1 << 21);
    bench.wait(ms(5));
    assert_eq!(bench.read_i32(1, 0x202B, 0), captured);
    set(&mut bench, 0x2019, 0, 1).unwrap();
    assert_eq!(bench.number(1, 0x202A, 0) & 1, 0);
}

// ---- what is kept ----

#[test]
fn save_restore_and_reset() {
    let mut bench = of(config());
    set(&mut bench, 0x205E, 0, 1234).unwrap();
    set(&mut bench, 0x6083, 0, 4321).unwrap();
    set(&mut bench, 0x60FB, 15, 55).unwrap();
    set(&mut bench, 0x2202, 3, 1).unwrap();
    bench.nmt(Command::ResetNode, 1);
    assert_eq!(bench.number(1, 0x205E, 0), 600, "RAM alone");
    set(&mut bench, 0x205E, 0, 1234).unwrap();
    set(&mut bench, 0x6083, 0, 4321).unwrap();
    set(&mut bench, 0x60FB, 15, 55).unwrap();
    set(&mut bench, 0x2202, 3, 1).unwrap();
    // Device parameters, not list 1.
    set(&mut bench, 0x2008, 0, 1).unwrap();
    bench.twin().disturb(Disturbance::Reset);
    bench.wait(ms(5));
    assert_eq!(bench.number(1, 0x205E, 0), 1234);
    assert_eq!(bench.number(1, 0x6083, 0), 600, "never stored");
    assert_eq!(bench.number(1, 0x60FB, 15), 55);
    assert_eq!(bench.number(1, 0x2202, 3), 0);
    set(&mut bench, 0x2009, 0, 1).unwrap();
    assert_eq!(bench.number(1, 0x60FB, 15), 14);
    assert_eq!(bench.number(1, 0x205E, 0), 1234);
    set(&mut bench, 0x2009, 0, 2).unwrap();
    assert_eq!(bench.number(1, 0x205E, 0), 600);
    // A type is set for all entries that follow (14507).
    set(&mut bench, 0x2200, 10, 2).unwrap();
    let types: Vec<u32> = [9, 10, 64].map(|sub| bench.number(1, 0x2200, sub)).into();
    assert_eq!(types, [1, 2, 2]);
}

// ---- process data ----

/// Types 0, 1 to 240 and 252 to 255 of a T_PDO (7703-7743), its inhibit time and event timer.
#[test]
fn transmission_types_and_times() {
    let mut bench = of(config());
    set(&mut bench, 0x1801, 1, 0x281).unwrap();
    let mut answers = |kind: i32, changes: bool| {
        bench.nmt(Command::EnterPreOperational, 1);
        set(&mut bench, 0x1801, 2, kind).unwrap();
        bench.nmt(Command::Start, 1);
        bench.sync();
        bench.wait(ms(2));
        let from = bench.log.len();
        for step in 0..6 {
            if changes {
                let word = [0x06, 0x00][step % 2];
                bench.controlword(1, word);
            }
            bench.sync();
            bench.wait(ms(2));
        }
        bench.received(from, 0x281).len()
    };
    for (kind, changes, expected) in [
        (0, false, 0),
        (0, true, 6),
        (1, false, 6),
        (2, false, 3),
        (240, false, 0),
        (252, true, 0),
        (253, true, 0),
        (254, true, 6),
        (255, true, 6),
        (255, false, 0),
    ] {
        assert_eq!(answers(kind, changes), expected, "type {kind}, {changes}");
    }
    for kind in [241, 251] {
        assert_eq!(set(&mut bench, 0x1801, 2, kind), Err(INVALID), "{kind}");
    }
    // 253 is told when asked for (1310-1330).
    set(&mut bench, 0x1801, 2, 253).unwrap();
    assert_eq!(bench.remote(0x281).map(|data| data.len()), Some(6));
    // Every 20 ms, and no more often than every 50 ms.
    set(&mut bench, 0x1801, 2, 255).unwrap();
    set(&mut bench, 0x1801, 5, 20).unwrap();
    let counted = |bench: &mut Bench<Twin>| {
        bench.wait(ms(100));
        let from = bench.log.len();
        bench.wait(ms(1000));
        bench.received(from, 0x281).len()
    };
    assert!((49..=50).contains(&counted(&mut bench)));
    set(&mut bench, 0x1801, 3, 500).unwrap();
    assert!((19..=20).contains(&counted(&mut bench)));
}

/// A synchronous R_PDO takes effect at the SYNC after it, an asynchronous one at once (7720-7743).
#[test]
fn a_target_waits_for_sync_or_does_not() {
    for (kind, waits) in [(0, true), (1, true), (254, false), (255, false)] {
        let mut bench = of(config());
        set(&mut bench, 0x1401, 1, 0x301).unwrap();
        set(&mut bench, 0x1401, 2, kind).unwrap();
        bench.nmt(Command::Start, 1);
        bench.send(0x301, &[0, 0, 0x39, 0x05, 0, 0]);
        bench.wait(ms(5));
        assert_eq!(bench.read_i32(1, 0x607A, 0) == 0, waits, "type {kind}");
        bench.sync();
        bench.wait(ms(5));
        assert_eq!(bench.read_i32(1, 0x607A, 0), 1337);
    }
}

/// A motor that has lost its torque does not come to rest by braking: the power stage goes off, and the brake stops what hangs
/// on it.
#[test]
fn a_fault_reaction_that_does_not_stop_the_motor_ends() {
    let mut config = config();
    config.servo.mechanics = Rigid {
        load_torque: -0.4,
        ..Rigid::default()
    }
    .into();
    let mut bench = of(config);
    enabled(&mut bench, 1);
    bench.twin().disturb(Disturbance::LoseTorque(true));
    bench.wait(ms(50));
    let twin = bench.twin();
    twin.disturb(Disturbance::Fault(ErrorClass::StopAndSwitchOff));
    bench.wait(ms(2000));
    assert_eq!(bench.twin().state(), State::Fault);
    assert_eq!(bench.twin().observe().velocity, 0.0);
}

// ---- how signals brake, and what tells of them ----

/// Increments from the signal until it stands, at 300 r/min: with the input STOP, or by command.
fn brakes(settings: &[(u16, i32)], by_signal: bool) -> f64 {
    let mut bench = drive(3);
    for &(index, value) in [(0x6084, 6000), (0x6085, 60_000)].iter().chain(settings) {
        set(&mut bench, index, 0, value).unwrap();
    }
    set(&mut bench, 0x60FF, 0, 300).unwrap();
    until(&mut bench, 5, "speed", |bench| {
        (bench.twin().observe().velocity - 5.0).abs() < 0.02
    });
    bench.wait(ms(200));
    let before = bench.twin().observe().position;
    match by_signal {
        true => bench.twin().set_stop(true),
        false => bench.controlword(1, 0x0B),
    }
    bench.wait(ms(1500));
    assert_eq!(bench.twin().state(), State::QuickStopActive);
    let seen = bench.twin().observe();
    assert!(seen.velocity.abs() < 0.01, "{seen:?}");
    seen.position - before
}

/// 204Ch chooses between the ramp of the movement and the quick stop current of 204Dh (10516-10560); the command has 6085h.
#[test]
fn what_a_signal_brakes_by() {
    // v²/2a in revolutions, at 5 rev/s, and what it goes until its loops have it.
    let way = |ramp: f64| 12.5 / ramp;
    let gains = Gains::default();
    let by_current = |amperes: f64| {
        way(amperes * gains.torque_constant / gains.inertia / core::f64::consts::TAU)
    };
    for (settings, by_signal, expected) in [
        (&[][..], true, way(100.0)),
        (&[(0x204C, 0b011)], true, way(100.0)),
        (&[(0x204C, 0b100), (0x204D, 50)], true, by_current(0.5)),
        (&[(0x204C, 0b100), (0x204D, 100)], true, by_current(1.0)),
        (&[(0x204C, 0b100), (0x204D, 50)], false, way(1000.0)),
    ] {
        let went = brakes(settings, by_signal);
        // A position loop of 1/80 s lags by that at 5 rev/s, and catches up.
        let lag = 5.0 / gains.position;
        println!(
            "{settings:X?} {by_signal}: {went:.4} of {:.4} rev",
            expected + lag
        );
        assert!(
            (went - expected - lag).abs() < 0.02 + 0.1 * expected,
            "{settings:X?}: {went}, {expected}"
        );
    }
}

/// 2041h tells internal, external and warning apart (10099-10105), 2062h which internal one (11015-11021).
#[test]
fn internal_and_external_signals_are_told_apart() {
    const INTERNAL: u32 = 1 << 5;
    const EXTERNAL: u32 = 1 << 6;
    const WARNING: u32 = 1 << 7;
    let bits = |bench: &mut Bench<Twin>| {
        let status = bench.number(1, 0x2041, 0) & (INTERNAL | EXTERNAL | WARNING);
        (status, bench.number(1, 0x2062, 0))
    };
    let mut bench = of(config());
    assert_eq!(bits(&mut bench), (0, 1 << 15));
    let mut bench = drive(3);
    assert_eq!(bits(&mut bench), (0, 0));
    // By command.
    bench.controlword(1, 0x0B);
    assert_eq!(bits(&mut bench), (0, 1 << 7));
    bench.controlword(1, 0x0F);
    assert_eq!(bits(&mut bench), (0, 0));
    // By an input.
    set(&mut bench, 0x60FF, 0, 300).unwrap();
    bench.wait(ms(100));
    bench.twin().set_stop(true);
    bench.wait(ms(100));
    assert_eq!(bits(&mut bench), (EXTERNAL, 0));
    bench.twin().set_stop(false);
    bench.wait(ms(1500));
    bench.controlword(1, 0x80);
    assert_eq!(bits(&mut bench).0, 0);
    // By a software limit.
    let mut bench = drive(3);
    for (index, sub, value) in [(0x2052, 0, 5000), (0x2053, 0, -5000), (0x2054, 0, 0x60)] {
        set(&mut bench, index, sub, value).unwrap();
    }
    set(&mut bench, 0x60FF, 0, 300).unwrap();
    until(&mut bench, 5, "stop", |bench| {
        bench.twin().state() == State::QuickStopActive
    });
    assert_eq!(bits(&mut bench), (INTERNAL, 1 << 5));
    // A target that is not taken warns.
    let mut bench = drive(1);
    set(&mut bench, 0x2052, 0, 5000).unwrap();
    set(&mut bench, 0x2053, 0, -5000).unwrap();
    set(&mut bench, 0x2054, 0, 0x60).unwrap();
    set(&mut bench, 0x607A, 0, 6000).unwrap();
    bench.controlword(1, 0x5F);
    assert_eq!(bits(&mut bench).0, WARNING);
}

/// What an R_PDO of type n brings takes effect at the nth SYNC (7729-7730), the last of several that come meanwhile.
#[test]
fn an_r_pdo_waits_for_as_many_syncs_as_its_type() {
    for kind in [0, 1, 2, 5, 240] {
        let mut bench = of(config());
        set(&mut bench, 0x1401, 1, 0x301).unwrap();
        set(&mut bench, 0x1401, 2, kind).unwrap();
        let read = |bench: &mut Bench<Twin>| bench.read_i32(1, 0x607A, 0);
        bench.nmt(Command::Start, 1);
        let syncs = kind.max(1);
        for (target, again) in [(1000, false), (2000, true)] {
            let before = read(&mut bench);
            let send = |bench: &mut Bench<Twin>, target: i32| {
                let [a, b, c, d] = target.to_le_bytes();
                bench.send(0x301, &[0, 0, a, b, c, d]);
                bench.wait(ms(1));
            };
            send(&mut bench, if again { -7 } else { target });
            for sync in 1..=syncs {
                assert_eq!(read(&mut bench), before, "type {kind}, SYNC {sync}");
                if again && sync == syncs {
                    send(&mut bench, target);
                }
                bench.sync();
                bench.wait(ms(1));
            }
            assert_eq!(read(&mut bench), target, "type {kind}");
        }
    }
}
