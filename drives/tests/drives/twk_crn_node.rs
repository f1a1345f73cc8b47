//! The encoder from the bus: what each object and each frame makes it do.

use crate::common::{Bench, id, ms};
use core::f64::consts::TAU;
use syncline_canopen::nmt::{Command, State};
use syncline_canopen::node::{BootUp, LifeGuarding};
use syncline_drives::bus::{BitRate, SimBus};
use syncline_drives::mechanics::drive_train::{DriveTrain, Elasticity};
use syncline_drives::mechanics::friction::Friction;
use syncline_drives::twin::node::Processor;
use syncline_drives::twin::servo::motor::Motor;
use syncline_drives::twin::twk_crn::{
    Commissioned, EncoderError, Policies, Resolution, Texts, Twin, TwinConfig, Version,
};
use syncline_drives::twin::{Config, Disturbance, DrivenAxis, SimulatedDevice, cia402_csp, lxm32m};
use syncline_drives::world::World;

const INVALID: u32 = 0x0609_0030;
const DEVICE_STATE: u32 = 0x0800_0022;
const HARDWARE: u32 = 0x0606_0000;

const SAVE: u32 = 0x6576_6173;
const LOAD: u32 = 0x6461_6F6C;

/// Node 1, answering at once, its shaft in the middle of the raw step 1000h.
fn config() -> TwinConfig {
    TwinConfig {
        position: (f64::from(0x1000) + 0.5) / 8192.0,
        processor: Processor::prompt(id(1)),
        ..TwinConfig::new(id(1))
    }
}

fn encoder() -> Bench<Twin> {
    Bench::of([Twin::new(config())])
}

fn with(policies: Policies) -> Bench<Twin> {
    Bench::of([Twin::new(TwinConfig {
        policies,
        ..config()
    })])
}

/// Writes a number in the object's own size.
fn set(bench: &mut Bench<Twin>, index: u16, sub: u8, value: u32) -> Result<(), u32> {
    let size = bench.upload(1, index, sub).unwrap().len();
    bench.write(1, index, sub, &value.to_le_bytes()[..size])
}

fn position(bench: &mut Bench<Twin>) -> u32 {
    bench.number(1, 0x6004, 0)
}

/// Turns the shaft on by so many revolutions.
fn turn_by(bench: &mut Bench<Twin>, revolutions: f64) {
    let from = bench.twin().observe().position;
    bench.twin().stand_at(from + revolutions);
    bench.wait(ms(2));
}

/// The positions that come in PDOs with this identifier.
fn positions(bench: &Bench<Twin>, from: usize, id: u16) -> Vec<u32> {
    let frames = bench.received(from, id).into_iter();
    let position = |data: Vec<u8>| u32::from_le_bytes(data.try_into().expect("4 bytes"));
    frames.map(position).collect()
}

// ---- network ----

#[test]
fn three_ways_to_boot() {
    for (boot_up, id, expected) in [
        (BootUp::Silent, 0x701, None),
        (BootUp::Message, 0x701, Some(vec![0])),
        (BootUp::EmptyEmergency, 0x081, Some(vec![])),
    ] {
        let bench = with(Policies {
            boot_up,
            ..Policies::default()
        });
        assert_eq!(bench.received(0, id), Vec::from_iter(expected));
        assert_eq!(bench.log.len(), usize::from(boot_up != BootUp::Silent));
    }
}

#[test]
fn states_and_what_lives_in_them() {
    let mut bench = encoder();
    for (command, byte, speaks) in [
        (Command::Start, 0x05, true),
        (Command::Stop, 0x84, false),
        (Command::EnterPreOperational, 0x7F, true),
    ] {
        bench.nmt(command, 1);
        let from = bench.log.len();
        bench.send(0x601, &[0x40, 0x00, 0x10, 0, 0, 0, 0, 0]);
        bench.wait(ms(1));
        assert_eq!(!bench.received(from, 0x581).is_empty(), speaks);
        assert_eq!(bench.remote(0x701), Some(vec![byte]));
    }
    bench.nmt(Command::Start, 0);
    assert_eq!(bench.twin().observe().nmt_state, State::Operational);
    bench.nmt(Command::ResetCommunication, 1);
    assert_eq!(bench.remote(0x701), Some(vec![0x7F]), "the toggle bit too");
}

/// Crn S11: from every state to Pre-Operational.
#[test]
fn a_lost_master() {
    for command in [Command::Start, Command::Stop, Command::EnterPreOperational] {
        let mut bench = encoder();
        // Crn S7: 100 ms x 5.
        set(&mut bench, 0x100C, 0, 100).unwrap();
        set(&mut bench, 0x100D, 0, 5).unwrap();
        bench.nmt(command, 1);
        bench.wait(ms(5000));
        bench.remote(0x701).unwrap();
        let before = bench.twin().observe().nmt_state;
        bench.wait(ms(490));
        assert_eq!(bench.twin().observe().nmt_state, before);
        let from = bench.log.len();
        bench.wait(ms(20));
        assert_eq!(bench.twin().observe().nmt_state, State::PreOperational);
        assert_eq!(
            bench.received(from, 0x081),
            [[0x00, 0x81, 0x11, 0, 0, 0, 0, 0]]
        );
        assert_eq!(bench.number(1, 0x1003, 1), 0x11_8100);
        bench.nmt(Command::Start, 1);
        assert_eq!(bench.number(1, 0x1001, 0), 0);
    }
}

#[test]
fn a_lost_master_found_by_its_return() {
    let mut bench = with(Policies {
        life_guarding: LifeGuarding::AtLateRequest,
        emcy_on_lost_guarding: false,
        ..Policies::default()
    });
    set(&mut bench, 0x100C, 0, 100).unwrap();
    set(&mut bench, 0x100D, 0, 1).unwrap();
    bench.nmt(Command::Start, 1);
    bench.remote(0x701).unwrap();
    let from = bench.log.len();
    bench.wait(ms(500));
    assert_eq!(bench.twin().observe().nmt_state, State::Operational);
    assert_eq!(bench.remote(0x701), Some(vec![0xFF]));
    assert!(bench.received(from, 0x081).is_empty());
}

/// Crn S44, S29, S18: a changed identifier counts after store and reset.
#[test]
fn identifiers_wait_for_store_and_reset() {
    let mut bench = encoder();
    set(&mut bench, 0x1005, 0, 0x8000_0081).unwrap();
    set(&mut bench, 0x100E, 0, 0x745).unwrap();
    set(&mut bench, 0x1014, 0, 0x095).unwrap();
    // Those of the PDOs count at once.
    set(&mut bench, 0x1802, 1, 0x2A1).unwrap();
    let in_effect = |bench: &mut Bench<Twin>| {
        bench.nmt(Command::Start, 1);
        let from = bench.log.len();
        let guarded = bench.remote(0x745).is_some();
        bench.sync();
        bench.wait(ms(1));
        let old_sync = !bench.received(from, 0x2A1).is_empty();
        bench.twin().set_error(EncoderError::Xram, true);
        bench.wait(ms(2));
        bench.twin().set_error(EncoderError::Xram, false);
        bench.wait(ms(2));
        let emergencies = bench.received(from, 0x095).len();
        (guarded, old_sync, emergencies)
    };
    assert_eq!(in_effect(&mut bench), (false, true, 0));
    set(&mut bench, 0x1010, 1, SAVE).unwrap();
    assert_eq!(in_effect(&mut bench), (false, true, 0));
    bench.nmt(Command::ResetNode, 1);
    assert_eq!(in_effect(&mut bench), (true, false, 2));
}

#[test]
fn sync_only_while_bit_31_says_so() {
    for (sync_by_bit_31, answers) in [(true, 0), (false, 1)] {
        let mut bench = with(Policies {
            sync_by_bit_31,
            ..Policies::default()
        });
        set(&mut bench, 0x1005, 0, 0x80).unwrap();
        set(&mut bench, 0x1010, 1, SAVE).unwrap();
        bench.nmt(Command::ResetNode, 1);
        bench.nmt(Command::Start, 1);
        let from = bench.log.len();
        bench.sync();
        bench.wait(ms(1));
        assert_eq!(bench.received(from, 0x281).len(), answers);
    }
}

// ---- process data ----

#[test]
fn transmission_types_of_sync() {
    let mut bench = encoder();
    set(&mut bench, 0x1800, 1, 0x8000_0181).unwrap();
    let mut answers = |kind: u8, turns: bool| {
        bench.nmt(Command::EnterPreOperational, 1);
        bench.write(1, 0x1802, 2, &[kind]).unwrap();
        bench.nmt(Command::Start, 1);
        bench.sync();
        bench.wait(ms(1));
        let from = bench.log.len();
        for _ in 0..6 {
            if turns {
                turn_by(&mut bench, 0.25);
            }
            bench.sync();
            bench.wait(ms(1));
        }
        bench.received(from, 0x281).len()
    };
    // The divider is well on its way when counting begins.
    for (kind, turns, expected) in [
        (1, false, 6),
        (2, false, 3),
        (3, false, 2),
        (240, false, 0),
        (0, false, 0),
        (0, true, 6),
        (252, true, 0),
        (253, true, 0),
        (254, false, 0),
    ] {
        assert_eq!(answers(kind, turns), expected, "type {kind}, turns {turns}");
    }
    for kind in [241u8, 251, 255] {
        assert_eq!(bench.write(1, 0x1802, 2, &[kind]), Err(INVALID), "{kind}");
    }
}

#[test]
fn type_255_where_it_is_taken() {
    let mut bench = with(Policies {
        takes_type_255: true,
        ..Policies::default()
    });
    bench.write(1, 0x1802, 2, &[255]).unwrap();
    bench.nmt(Command::Start, 1);
    assert_eq!(positions(&bench, 0, 0x281), [0x1000]);
}

/// Crn S18: 252 tells the position at SYNC, 253 that at the request.
#[test]
fn remote_requests() {
    let mut bench = encoder();
    bench.write(1, 0x1800, 2, &[253]).unwrap();
    bench.write(1, 0x1802, 2, &[252]).unwrap();
    bench.nmt(Command::Start, 1);
    bench.sync();
    bench.wait(ms(1));
    turn_by(&mut bench, 1.0);
    let there = 0x1000_u32.to_le_bytes().to_vec();
    let here = 0x3000_u32.to_le_bytes().to_vec();
    assert_eq!(bench.remote(0x281), Some(there));
    assert_eq!(bench.remote(0x181), Some(here.clone()));
    bench.sync();
    bench.wait(ms(1));
    assert_eq!(bench.remote(0x281), Some(here));
}

/// Crn S18, S31, S24.
#[test]
fn t_pdo1_by_change_by_clock_and_not_at_all() {
    let mut bench = encoder();
    bench.nmt(Command::Start, 1);
    let from = bench.log.len();
    bench.wait(ms(50));
    assert!(bench.received(from, 0x181).is_empty(), "at rest");
    bench.twin().turn(1.0);
    bench.wait(ms(50));
    let flood = positions(&bench, from, 0x181);
    assert!(flood.len() >= 45, "{}: a turning shaft floods", flood.len());
    assert!(flood.is_sorted());
    // Inhibit time, 100 us.
    set(&mut bench, 0x1800, 3, 100).unwrap();
    let from = bench.log.len();
    bench.wait(ms(100));
    assert!((9..=11).contains(&bench.received(from, 0x181).len()));
    set(&mut bench, 0x1800, 3, 0).unwrap();
    // The clock, turning or not.
    set(&mut bench, 0x6200, 0, 20).unwrap();
    for velocity in [1.0, 0.0] {
        bench.twin().turn(velocity);
        bench.wait(ms(20));
        let from = bench.log.len();
        bench.wait(ms(100));
        assert_eq!(bench.received(from, 0x181).len(), 5);
    }
    set(&mut bench, 0x1800, 1, 0x8000_0181).unwrap();
    bench.twin().turn(1.0);
    let from = bench.log.len();
    bench.wait(ms(100));
    assert!(bench.received(from, 0x181).is_empty());
}

/// Every position is that at its SYNC: over 3 ms at 10 rev/s they differ by 245.76 steps.
#[test]
fn the_position_at_sync() {
    let mut bench = encoder();
    set(&mut bench, 0x1800, 1, 0x8000_0181).unwrap();
    bench.nmt(Command::Start, 1);
    bench.twin().turn(10.0);
    let from = bench.log.len();
    for _ in 0..50 {
        bench.sync();
        bench.wait(ms(3));
    }
    let positions = positions(&bench, from, 0x281);
    assert_eq!(positions.len(), 50);
    for pair in positions.windows(2) {
        let steps = f64::from(pair[1] - pair[0]);
        assert!((steps - 245.76).abs() < 1.0, "{steps}");
    }
    let all = f64::from(positions[49] - positions[0]);
    assert!((all - 49.0 * 245.76).abs() < 1.0, "{all}");
}

// ---- position ----

#[test]
fn code_sequence_scaling_and_preset() {
    let mut bench = encoder();
    assert_eq!(position(&mut bench), 0x1000);
    // CCW: the same turn counts down.
    set(&mut bench, 0x6000, 0, 1).unwrap();
    let before = position(&mut bench);
    assert_eq!(before, 0x1FF_FFFF - 0x1000);
    turn_by(&mut bench, 1.0);
    assert_eq!(position(&mut bench), before - 8192);
    // 1000 steps per turn, in 16 turns.
    set(&mut bench, 0x6001, 0, 1000).unwrap();
    set(&mut bench, 0x6002, 0, 16_000).unwrap();
    assert_eq!(position(&mut bench), before - 8192, "not released yet");
    set(&mut bench, 0x6000, 0, 4).unwrap();
    assert_eq!(position(&mut bench), 1500);
    assert_eq!(bench.number(1, 0x6500, 0), 4);
    set(&mut bench, 0x6003, 0, 15_900).unwrap();
    assert_eq!(position(&mut bench), 15_900);
    turn_by(&mut bench, 0.25);
    assert_eq!(position(&mut bench), 150);
    turn_by(&mut bench, 16.0);
    assert_eq!(position(&mut bench), 150);
}

/// Crn S40, S31; the same value again is no change.
#[test]
fn what_deletes_the_preset() {
    for (index, same, other) in [
        (0x6000, 0, 1),
        (0x6001, 8192, 500),
        (0x6002, 0x200_0000, 8192),
    ] {
        let mut bench = encoder();
        set(&mut bench, 0x6003, 0, 77).unwrap();
        set(&mut bench, index, 0, same).unwrap();
        assert_eq!((position(&mut bench), bench.number(1, 0x6003, 0)), (77, 77));
        set(&mut bench, index, 0, other).unwrap();
        assert_eq!(bench.number(1, 0x6003, 0), 0, "{index:04X}");
        assert_eq!(bench.number(1, 0x6509, 0), 0, "{index:04X}");
        assert_ne!(position(&mut bench), 77, "{index:04X}");
    }
}

#[test]
fn values_that_make_no_sense() {
    let strict = Policies {
        scales_beyond_disc: false,
        ..Policies::default()
    };
    let lax = Policies {
        preset_wraps: true,
        ..Policies::default()
    };
    let mut default = encoder();
    for value in [2, 3, 6, 7, 8, 0xFFFF] {
        assert_eq!(set(&mut default, 0x6000, 0, value), Err(INVALID), "{value}");
    }
    for index in [0x6001, 0x6002] {
        assert_eq!(set(&mut default, index, 0, 0), Err(INVALID));
        assert_eq!(set(&mut default, index, 0, u32::MAX), Ok(()));
    }
    assert_eq!(set(&mut default, 0x6003, 0, 0x200_0000), Err(INVALID));
    let mut strict = with(strict);
    assert_eq!(set(&mut strict, 0x6001, 0, 8193), Err(INVALID));
    assert_eq!(set(&mut strict, 0x6002, 0, 0x200_0001), Err(INVALID));
    assert_eq!(set(&mut strict, 0x6002, 0, 0x200_0000), Ok(()));
    let mut lax = with(lax);
    set(&mut lax, 0x6003, 0, 0x200_0005).unwrap();
    assert_eq!(position(&mut lax), 5);
    // Limits of node id and bit rate.
    for (index, value) in [(0x2000, 0), (0x2000, 65), (0x2001, 4)] {
        assert_eq!(set(&mut default, index, 0, value), Err(INVALID));
    }
}

#[test]
fn the_other_disc() {
    let mut bench = Bench::of([Twin::new(TwinConfig {
        resolution: Resolution::Steps4096,
        ..config()
    })]);
    assert_eq!(position(&mut bench), 0x800);
    turn_by(&mut bench, -1.0);
    assert_eq!(position(&mut bench), 0x100_0000 - 0x800, "turns over");
    assert_eq!(set(&mut bench, 0x6003, 0, 0x100_0000), Err(INVALID));
}

/// Crn S41.
#[test]
fn work_area() {
    for (limit_is_outside, on_limit) in [(true, [5, 3]), (false, [0, 0])] {
        let mut bench = with(Policies {
            limit_is_outside,
            ..Policies::default()
        });
        let mut at = |position: u32| {
            set(&mut bench, 0x6003, 0, position).unwrap();
            bench.number(1, 0x6400, 1)
        };
        assert_eq!(
            [0xF_FFFE, 0x10_0000, 0x1EF_FFFF, 0x1F0_0001].map(&mut at),
            [5, 0, 0, 3]
        );
        assert_eq!([0xF_FFFF, 0x1F0_0000].map(&mut at), on_limit);
        bench.write(1, 0x6401, 1, &(-5_i32).to_le_bytes()).unwrap();
        assert_eq!(bench.number(1, 0x6400, 1) & 4, 0);
    }
}

// ---- what is kept ----

/// The stored set (crn S9, S21): object, another value. Then what is not in it.
const STORED: [(u16, u8, u32); 17] = [
    (0x1005, 0, 0x8000_0081),
    (0x100E, 0, 0x745),
    (0x1014, 0, 0x095),
    (0x1800, 1, 0x8000_01A1),
    (0x1800, 2, 7),
    (0x1800, 3, 50),
    (0x1802, 1, 0x2A1),
    (0x1802, 2, 9),
    (0x1802, 3, 60),
    (0x2001, 0, 2),
    (0x6000, 0, 4),
    (0x6001, 0, 1000),
    (0x6002, 0, 16_000),
    (0x6003, 0, 555),
    (0x6200, 0, 30),
    (0x6401, 1, 11),
    (0x6402, 1, 22),
];
const FORGOTTEN: [(u16, u8, u32); 4] = [
    (0x1006, 0, 10),
    (0x1007, 0, 11),
    (0x100C, 0, 100),
    (0x100D, 0, 3),
];

#[test]
fn save_load_and_what_each_keeps() {
    let values = |bench: &mut Bench<Twin>, set: &[(u16, u8, u32)]| -> Vec<u32> {
        let objects = set.iter();
        objects
            .map(|&(index, sub, _)| bench.number(1, index, sub))
            .collect()
    };
    let written =
        |set: &[(u16, u8, u32)]| -> Vec<u32> { set.iter().map(|&(_, _, value)| value).collect() };
    let mut bench = encoder();
    let defaults = values(&mut bench, &STORED);
    let forgotten = values(&mut bench, &FORGOTTEN);
    let write = |bench: &mut Bench<Twin>| {
        for (index, sub, value) in STORED.into_iter().chain(FORGOTTEN) {
            set(bench, index, sub, value).unwrap();
        }
    };
    write(&mut bench);
    assert_eq!(values(&mut bench, &STORED), written(&STORED));
    // Not saved.
    bench.nmt(Command::ResetNode, 1);
    assert_eq!(values(&mut bench, &STORED), defaults);
    // Saved: over a reset, and over a loss of power.
    write(&mut bench);
    let before = position(&mut bench);
    assert_eq!(before, 555);
    set(&mut bench, 0x1010, 1, SAVE).unwrap();
    for power in [false, true] {
        if power {
            bench.twin().disturb(Disturbance::Reset);
            bench.wait(ms(2));
        } else {
            bench.nmt(Command::ResetNode, 1);
        }
        assert_eq!(values(&mut bench, &STORED), written(&STORED));
        assert_eq!(values(&mut bench, &FORGOTTEN), forgotten);
        assert_eq!(position(&mut bench), before, "with the preset's offset");
    }
    // Loaded: after the reset only.
    set(&mut bench, 0x1011, 1, LOAD).unwrap();
    assert_eq!(values(&mut bench, &STORED), written(&STORED));
    bench.nmt(Command::ResetNode, 1);
    assert_eq!(values(&mut bench, &STORED), defaults);
    assert_eq!(position(&mut bench), 0x1000);
    // Not the words that are wanted.
    for index in [0x1010, 0x1011] {
        assert_eq!(set(&mut bench, index, 1, 1), Err(0x0800_0020));
    }
}

/// Crn S36: 82h reloads 1xxxh alone.
#[test]
fn reset_communication_leaves_the_profile() {
    let mut bench = encoder();
    set(&mut bench, 0x1802, 2, 9).unwrap();
    set(&mut bench, 0x6003, 0, 555).unwrap();
    bench.nmt(Command::ResetCommunication, 1);
    assert_eq!(bench.number(1, 0x1802, 2), 1);
    assert_eq!(position(&mut bench), 555);
}

// ---- errors ----

/// Crn S2, S17: the values of the manual's example.
#[test]
fn an_eeprom_error_and_its_end() {
    let mut bench = encoder();
    let told = |bench: &mut Bench<Twin>| {
        [(0x1001, 0), (0x1003, 0), (0x1003, 1), (0x6503, 0)]
            .map(|(index, sub)| bench.number(1, index, sub))
    };
    assert_eq!(told(&mut bench), [0, 0, 0, 0]);
    let from = bench.log.len();
    bench.twin().set_error(EncoderError::Eeprom, true);
    bench.wait(ms(2));
    assert_eq!(told(&mut bench), [0x81, 1, 0x81_FFFF, 0x1000]);
    assert_eq!(bench.write(1, 0x1003, 0, &[0]), Err(DEVICE_STATE));
    assert_eq!(set(&mut bench, 0x1010, 1, SAVE), Err(HARDWARE));
    // Another overwrites it; both alarms stay.
    bench.twin().set_error(EncoderError::Memory, true);
    bench.wait(ms(2));
    assert_eq!(told(&mut bench), [0x81, 1, 0x81_5100, 0x1000]);
    bench.twin().set_error(EncoderError::Eeprom, false);
    bench.wait(ms(2));
    assert_eq!(bench.number(1, 0x6503, 0), 0, "clears with its cause");
    assert_eq!(bench.write(1, 0x1003, 0, &[0]), Err(DEVICE_STATE));
    bench.twin().set_error(EncoderError::Memory, false);
    bench.wait(ms(2));
    assert_eq!(told(&mut bench), [0, 1, 0x81_5100, 0]);
    assert_eq!(bench.write(1, 0x1003, 0, &[0]), Ok(()));
    assert_eq!(told(&mut bench), [0, 0, 0, 0]);
    assert_eq!(
        bench.received(from, 0x081),
        [
            [0xFF, 0xFF, 0x81, 0, 0, 0, 0, 0],
            [0x00, 0x51, 0x81, 0, 0, 0, 0, 0],
            [0x00, 0x00, 0x00, 0, 0, 0, 0, 0]
        ]
    );
}

#[test]
fn every_error_has_its_code_and_its_alarm() {
    for (error, code, register, alarms) in [
        (EncoderError::Hardware, 0x5000, 0x01, 0),
        (EncoderError::Memory, 0x5100, 0x01, 0),
        (EncoderError::Communication, 0x8100, 0x11, 0),
        (EncoderError::Eeprom, 0xFFFF, 0x81, 0x1000),
        (EncoderError::EepromCrc, 0xFFFF, 0x81, 0x2000),
        (EncoderError::Xram, 0xFFFF, 0x81, 0x4000),
    ] {
        let mut bench = encoder();
        bench.twin().set_error(error, true);
        bench.wait(ms(2));
        assert_eq!(
            bench.number(1, 0x1003, 1),
            register << 16 | code,
            "{error:?}"
        );
        assert_eq!(bench.number(1, 0x1001, 0), register, "{error:?}");
        assert_eq!(bench.number(1, 0x6503, 0), alarms, "{error:?}");
        let supported = bench.number(1, 0x6504, 0);
        assert_eq!(alarms & !supported, 0, "{error:?}");
    }
}

#[test]
fn an_error_outlives_a_reset() {
    let mut bench = encoder();
    bench.twin().set_error(EncoderError::Xram, true);
    bench.wait(ms(2));
    let from = bench.log.len();
    bench.nmt(Command::ResetNode, 1);
    bench.wait(ms(2));
    assert_eq!(
        bench.received(from, 0x081),
        [[0xFF, 0xFF, 0x81, 0, 0, 0, 0, 0]]
    );
    assert_eq!(bench.number(1, 0x6503, 0), 0x4000);
}

// ---- commissioning ----

fn rate(kbit: u32) -> BitRate {
    BitRate::from_kbit(kbit).unwrap()
}

/// Crn S15: as delivered at 20 kbit/s, node 1; by objects, store and reset to 500 kbit/s, node 5.
#[test]
fn commissioning_by_objects() {
    let mut config = config();
    config.commissioned.bus = Some(rate(20));
    let mut bench = Bench {
        bus: SimBus::new(rate(20)),
        log: vec![],
    };
    bench.bus.attach(Twin::new(config));
    bench.wait(ms(5));
    set(&mut bench, 0x2000, 0, 5).unwrap();
    set(&mut bench, 0x2001, 0, 2).unwrap();
    bench.nmt(Command::ResetNode, 1);
    bench.wait(ms(20));
    assert_eq!(bench.number(1, 0x2000, 0), 1, "not stored");
    set(&mut bench, 0x2000, 0, 5).unwrap();
    set(&mut bench, 0x2001, 0, 2).unwrap();
    set(&mut bench, 0x1010, 1, SAVE).unwrap();
    bench.nmt(Command::ResetNode, 1);
    bench.wait(ms(20));
    assert_eq!(bench.twin().bit_rate(), Some(rate(500)));
    let from = bench.log.len();
    bench.send(0x605, &[0x40, 0x00, 0x10, 0, 0, 0, 0, 0]);
    bench.wait(ms(100));
    assert_eq!(bench.log.len(), from, "at another rate than the bus");
    bench.twin().connect(rate(20));
    bench.wait(ms(50));
    assert_eq!(bench.log.len(), from);
    bench.twin().connect(rate(500));
    assert_eq!(bench.read(5, 0x1000, 0), Ok(vec![0x96, 0x01, 0x02, 0x00]));
    // The COB-IDs have followed the node id.
    assert_eq!(bench.number(5, 0x100B, 0), 5);
    assert_eq!(bench.number(5, 0x1800, 1), 0x185);
    assert_eq!(bench.number(5, 0x1014, 0), 0x085);
    // The defaults are those of an encoder as delivered.
    bench.write(5, 0x1011, 1, &LOAD.to_le_bytes()).unwrap();
    bench.nmt(Command::ResetNode, 5);
    bench.wait(ms(20));
    assert_eq!(bench.twin().bit_rate(), Some(rate(20)));
    bench.twin().connect(rate(20));
    assert_eq!(bench.number(1, 0x1800, 1), 0x181);
}

/// Crn S1, S26: on a cap the switches win.
#[test]
fn a_connecting_caps_switches_win() {
    let mut bench = Bench::of([Twin::new(TwinConfig {
        version: Version::ConnectingCap,
        commissioned: Commissioned {
            bit_rate: 3,
            bus: Some(rate(1000)),
        },
        ..config()
    })]);
    assert_eq!(set(&mut bench, 0x2000, 0, 9), Ok(()));
    assert_eq!(set(&mut bench, 0x2001, 0, 0), Ok(()));
    set(&mut bench, 0x1010, 1, SAVE).unwrap();
    bench.nmt(Command::ResetNode, 1);
    assert_eq!(bench.number(1, 0x2000, 0), 1);
    assert_eq!(bench.number(1, 0x2001, 0), 3);
    assert_eq!(bench.twin().bit_rate(), Some(rate(1000)));
}

#[test]
fn texts_and_confirmations_as_policies() {
    for (texts, expected) in [
        (Texts::Segmented, Ok(b"Encoder CRN".to_vec())),
        (Texts::Cut, Ok(b"Enco".to_vec())),
        (Texts::Refused, Err(0x0601_0000)),
    ] {
        let mut bench = with(Policies {
            texts,
            ..Policies::default()
        });
        assert_eq!(bench.upload(1, 0x1008, 0), expected);
    }
    for (sdo_echo, expected) in [(true, [1, 0, 0, 0]), (false, [0; 4])] {
        let mut bench = with(Policies {
            sdo_echo,
            ..Policies::default()
        });
        let answer = bench.request(1, [0x2B, 0x00, 0x60, 0, 1, 0, 0, 0]);
        assert_eq!(answer[4..], expected);
    }
}

// ---- on another device's shaft ----

/// A drive at constant speed, and the encoder on its screw.
#[test]
fn an_encoder_follows_a_drives_shaft() {
    let ahead = ahead_of_its_encoder(&Config::new(id(2)));
    // A step of the grid at this speed is 3·10⁻⁴ revolutions.
    assert!(ahead.abs() < 5e-4, "{ahead}");
}

/// The guide's friction winds a soft screw, and the encoder is behind it.
#[test]
fn an_encoder_on_the_load_is_behind_what_gives_way() {
    let (friction, stiffness) = (0.5, 10.0);
    let train = DriveTrain {
        elasticity: Some(Elasticity {
            stiffness,
            damping: 0.02,
            play: 0.0,
        }),
        guide: Friction::coulomb(friction),
        ..DriveTrain::default()
    };
    let ahead = ahead_of_its_encoder(&Config {
        axis: Some(DrivenAxis {
            motor: Motor::default(),
            train,
        }),
        ..Config::new(id(2))
    });
    let twist = friction / stiffness / TAU;
    assert!((ahead - twist).abs() < 0.1 * twist, "{ahead}, not {twist}");
}

/// How far a drive at 5 rev/s is ahead of the encoder on its axis, revolutions.
fn ahead_of_its_encoder(leader: &Config) -> f64 {
    let mut world = World::new();
    let bus = world.add_bus(rate(1000), |_| ());
    let drive = world.attach(bus, Box::new(lxm32m::Twin::new(leader.into())));
    let encoder = world.attach(
        bus,
        Box::new(Twin::new(TwinConfig {
            position: 100.0,
            ..config()
        })),
    );
    let idle = world.attach(
        bus,
        Box::new(cia402_csp::Twin::new(cia402_csp::TwinConfig::new(id(3)))),
    );
    world.ties().follow(encoder, drive, -2.0);
    let write = |index: u16, data: &[u8]| {
        let [low, high] = index.to_le_bytes();
        let mut bytes = [0x23 | (4 - data.len() as u8) << 2, low, high, 0, 0, 0, 0, 0];
        bytes[4..4 + data.len()].copy_from_slice(data);
        syncline_canopen::Frame::new(syncline_canopen::CobId::new(0x602).unwrap(), &bytes)
    };
    let mut now = syncline_canopen::Instant::ZERO;
    for frame in [
        write(0x6040, &[0x06, 0x00]),
        write(0x6040, &[0x0F, 0x00]),
        write(0x6060, &[3]),
        write(0x60FF, &300_i32.to_le_bytes()),
    ] {
        now += ms(30);
        world.advance_to(now);
        world.send(bus, syncline_drives::bus::Band::Acyclic, frame);
    }
    now += ms(2000);
    world.advance_to(now);
    let turned = world.device(drive).observe();
    let seen = world.device(encoder).observe();
    assert!((turned.velocity - 5.0).abs() < 0.1, "{turned:?}");
    assert!((seen.velocity + 2.0 * turned.velocity).abs() < 0.05);
    assert_eq!(world.device(idle).observe().position, 0.0);
    turned.position - (100.0 - seen.position) / 2.0
}
