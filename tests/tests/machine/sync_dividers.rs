//! An encoder that tells its position at every nth SYNC, beside the drive of the portal's Z or on a shaft of its own; and a
//! drive that is sent velocities and does so, on Y.

use super::point_to_point::PROBE;
use super::velocity;
use proptest::prelude::*;
use std::time::Duration;
use syncline_canopen::{CanId, CobId, Frame, NodeId};
use syncline_controller::bus::Received;
use syncline_controller::control::fault::{AxisCause, DeviceCause};
use syncline_controller::control::loss::Sign;
use syncline_controller::control::{End, Event, Fault};
use syncline_drives::bus::Sender;
use syncline_drives::twin::Disturbance;
use syncline_tests::rig::Rig;

/// The encoder's place behind the drives of the machine file.
const ENCODER: usize = 4;

/// The axis that it sees, and the allowed difference, mm.
const Z: usize = 2;
const LIMIT: f64 = 0.2;

const MODELS: [&str; 2] = ["twk_crn", "cia406"];

const PROGRAM: &str = "G21 G90 G94 G61\nG1 Z-40 X20 F6000\nG4 P0.2\nG1 Z-5 X0\nG4 P0.5\nM2\n";

/// Rows of it.
const ROWS: usize = 600;

/// An encoder that is on Z, or on a shaft of its own.
fn table(model: &str, divider: u32, measured: bool) -> String {
    format!(
        "[[encoder]]\nname = \"screw\"\nbus = \"portal\"\nnode = 5\nmodel = \"{model}\"\npitch = 10.0\n\
         zero = 10_000\nsync_divider = {divider}\nmeasured = {measured}\n\n[[axis]]\nname = \"X\""
    )
}

/// The portal with it.
fn portal(model: &str, divider: u32, measured: bool) -> Rig {
    let table = table(model, divider, measured);
    let feedback = "max_jerk = 80_000.0\nfeedback = \"screw\"\ndifference_limit = 0.2";
    let mut changes = vec![("[[axis]]\nname = \"X\"", &*table)];
    if !measured {
        changes.push(("max_jerk = 80_000.0", feedback));
    }
    Rig::new("portal", &changes, PROGRAM, |_, _| ())
}

fn position() -> CanId {
    // Its second T_PDO, or its first.
    CobId::t_pdo(2, NodeId::new(5).unwrap()).into()
}

/// How many SYNCs apart its positions are on the bus, from the first one on.
fn apart(rig: &Rig, model: &str) -> Vec<usize> {
    let id = match model {
        "cia406" => CobId::t_pdo(1, NodeId::new(5).unwrap()).into(),
        _ => position(),
    };
    let mut apart = vec![];
    let mut syncs = None;
    for it in rig.frames() {
        if it.frame.id() == CobId::SYNC.into() {
            syncs = syncs.map(|syncs: usize| syncs + 1);
        } else if it.frame.id() == id && it.sender != Sender::Port {
            apart.extend(syncs.replace(0));
        }
    }
    apart
}

fn dividers() -> impl Strategy<Value = u32> {
    prop_oneof![Just(1), Just(2), Just(10), 1..=10_u32]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4, ..ProptestConfig::default() })]

    /// One position in so many SYNCs, and none of them is missed: of an axis, and of a shaft of its own.
    #[test]
    fn it_answers_every_nth_sync(
        divider in dividers(),
        model in prop::sample::select(&MODELS[..]),
        measured: bool,
    ) {
        let mut rig = portal(model, divider, measured);
        prop_assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        let missed = |event: &Event| matches!(event, Event::MissedTPdo { device: ENCODER });
        prop_assert!(!rig.events.iter().any(missed));
        let apart = apart(&rig, model);
        // One between is of the set-up, at another SYNC, as is the one on entering Operational.
        let others = apart.iter().filter(|it| **it != divider as usize).count();
        prop_assert!(apart.len() > ROWS / divider as usize && others <= 1, "{apart:?}");
        if measured {
            let ages = rig.rows.iter().map(|row| row.measured[0].expect("it is sampled").age);
            prop_assert_eq!(ages.max(), Some(divider - 1));
        }
    }

    /// What slips is found in the time that start-up tells, and by both positions of one SYNC.
    #[test]
    fn a_slip_is_found_in_time(
        divider in dividers(),
        model in prop::sample::select(&MODELS[..]),
        row in 5..ROWS,
        wake_ups in 0..3usize,
        mm in prop_oneof![-0.9..-0.23f64, 0.23..0.9f64],
    ) {
        let mut rig = portal(model, divider, false);
        rig.run_to_row(row);
        for _ in 0..wake_ups {
            rig.step();
        }
        let (_, within) = rig.layout.comparison(Z).expect("it has an encoder");
        let before = rig.session.timeline().now();
        rig.slip(0, mm / 10.0);
        rig.run_until(|rig| !rig.controller().faults().is_empty());
        let after = rig.session.timeline().now().saturating_since(before);
        let difference = match rig.controller().faults()[0] {
            Fault::Axis(Z, AxisCause::FeedbackDifference { difference }) => difference,
            other => panic!("{other:?}"),
        };
        prop_assert!((difference - mm).abs() < 0.02 && mm.abs() > LIMIT, "{difference}, {mm}");
        prop_assert!(after <= within, "{after:?} of {within:?}");
        prop_assert!(within <= rig.layout.cycle * (divider + 1));
        prop_assert!(matches!(rig.finish(), End::Fault(_)) && rig.ends_at_rest());
    }

    /// One that does not come is ridden out, and two in a row are a loss, told with the cycles and in the time that start-up
    /// tells.
    #[test]
    fn a_loss_is_found_in_time(
        divider in dividers(),
        model in prop::sample::select(&MODELS[..]),
        row in 5..ROWS - 100,
        wake_ups in 0..3usize,
        lost in 1..=2u32,
    ) {
        let mut rig = portal(model, divider, false);
        rig.run_to_row(row);
        for _ in 0..wake_ups {
            rig.step();
        }
        rig.twin(ENCODER).disturb(Disturbance::LoseTPdos(lost));
        if lost == 1 {
            prop_assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
            let missed = |event: &&Event| matches!(event, Event::MissedTPdo { device: ENCODER });
            prop_assert_eq!(rig.events.iter().filter(missed).count(), 1);
            return Ok(());
        }
        let before = rig.session.timeline().now();
        rig.run_until(|rig| !rig.controller().faults().is_empty());
        let after = rig.session.timeline().now().saturating_since(before);
        let cause = DeviceCause::MissingTPdo { misses: 2 * divider };
        prop_assert_eq!(rig.controller().faults()[0], Fault::Device(ENCODER, cause));
        let mut notices = rig.layout.notices(ENCODER);
        let within: Duration = notices.find(|it| it.sign == Sign::TPdos).expect("it has it").within;
        prop_assert!(after <= within, "{after:?} of {within:?}");
        prop_assert!(within <= rig.layout.cycle * (2 * divider + 1));
    }
}

/// To a SYNC that it does not answer nothing is owed: what comes a second time to the next one is of another device.
#[test]
fn a_second_device_is_found_beside_it() {
    for divider in [1, 2, 5] {
        let mut rig = portal("twk_crn", divider, false);
        rig.run_to_row(100);
        let answer = |rig: &Rig| {
            let frames = rig.frames();
            let last = frames.iter().rev().map(|it| it.frame);
            last.take_while(|it| it.id() != CobId::SYNC.into())
                .find(|it| it.id() == position())
        };
        rig.run_until(|rig| answer(rig).is_some());
        let mut data = answer(&rig).expect("it has answered").data().to_vec();
        data[0] ^= 1;
        let received = Received {
            at: rig.session.timeline().now(),
            frame: Frame::new(position(), &data),
            echo: false,
        };
        rig.controller().receive(0, &received);
        let fault = rig.finish_with_fault();
        assert_eq!(
            fault,
            Fault::Device(ENCODER, DeviceCause::SecondTPdo),
            "{divider}"
        );
    }
}

/// A contact is seen at the next SYNC, whichever of them the encoder answers.
#[test]
fn it_holds_up_no_probing() {
    let deepest = |divider: u32| {
        let table = table("twk_crn", divider, true);
        let changes = [("[[axis]]\nname = \"X\"", &*table), ("[machine]", PROBE)];
        let program = "G21 G90 G94\nG38.2 Z-40 F1200\nM2\n";
        let mut rig = Rig::new("portal", &changes, program, |_, _| ());
        assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        let found = |event: &Event| matches!(event, Event::Probed { found: Some(_), .. });
        assert!(rig.events.iter().any(found));
        rig.rows
            .iter()
            .map(|row| row.axes[Z].act)
            .fold(0.0, f64::min)
    };
    let [each, seldom] = [1, 10].map(deepest);
    // 20 mm/s go 0.36 mm in 9 cycles.
    assert!((each - seldom).abs() < 0.06, "{each}, {seldom}");
}

#[test]
fn start_up_tells_how_often_it_answers() {
    let told = |divider: u32| {
        portal("twk_crn", divider, false)
            .layout
            .supervision(ENCODER)
    };
    assert!(!told(1).contains("tells its position"));
    let told = told(5);
    assert!(
        told.contains("): it tells its position every 5 SYNCs; "),
        "{told}"
    );
    assert!(told.contains("missing T_PDOs within 22 ms"), "{told}");
    assert!(told.contains("counts within 12 ms"), "{told}");
}

// --- a drive ---

/// Its place in the machine file, and its axis.
const DRIVE: usize = 2;
const Y: usize = 1;

/// The portal with a drive on Y that is sent velocities.
fn streamed(model: &str, divider: u32, program: &str) -> Rig {
    let zero = match model {
        "tlc5xx" => 50_266,
        _ => 402_131 * 8,
    };
    // A panel may take a TLC53x.
    let sdo = match model {
        "tlc5xx" => "\nsdo = [[\"2060:0\", 0]]",
        _ => "",
    };
    let drive =
        format!("node = 3\nmodel = \"{model}\"\nsync_divider = {divider}\nzero = {zero}{sdo}");
    let changes = [
        ("node = 3\nmodel = \"lxm32m\"\nzero = 402_131", &*drive),
        velocity::CHANGES[1],
    ];
    Rig::new("portal", &changes, program, |_, _| ())
}

const CIRCLES: &str = "G21 G90 G94 G61\nG0 X300 Y300\nG1 X320 Y300 F6000\n\
    G3 X320 Y300 I-20\nG3 X320 Y300 I-20\nM2\n";

fn y_pdos(rig: &Rig, id: CobId) -> Vec<usize> {
    let (mut apart, mut syncs) = (vec![], None);
    for it in rig.frames() {
        if it.frame.id() == CobId::SYNC.into() {
            syncs = syncs.map(|syncs: usize| syncs + 1);
        } else if it.frame.id() == id.into() {
            apart.extend(syncs.replace(0));
        }
    }
    apart
}

/// By how much Y is off its plan at the most.
fn worst(rig: &Rig) -> f64 {
    let errors = rig.rows.iter().map(|row| row.axes[Y].following_error.abs());
    errors.fold(0.0, f64::max)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    /// It answers every nth SYNC and is sent a velocity at each; what its axis is off grows no more than the loop gets slower,
    /// and between two answers the trace has it where it is.
    #[test]
    fn a_drive_that_answers_every_nth_sync_follows(
        divider in 2..=10_u32,
        model in prop::sample::select(&["tlc5xx", "cia402_csv"][..]),
    ) {
        let mut each = streamed(model, 1, CIRCLES);
        prop_assert_eq!(each.finish(), End::Finished, "{:?}", each.events);
        let mut rig = streamed(model, divider, CIRCLES);
        prop_assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        let missed = |event: &Event| matches!(event, Event::MissedTPdo { device: DRIVE });
        prop_assert!(!rig.events.iter().any(missed));
        let node = NodeId::new(3).unwrap();
        let t_pdo = CobId::t_pdo(if model == "tlc5xx" { 2 } else { 1 }, node);
        let r_pdo = CobId::r_pdo(if model == "tlc5xx" { 3 } else { 1 }, node);
        let told = y_pdos(&rig, t_pdo);
        let others = told.iter().filter(|it| **it != divider as usize).count();
        prop_assert!(told.len() > 100 && others <= 1, "{told:?}");
        prop_assert!(y_pdos(&rig, r_pdo).iter().all(|it| *it == 1));
        let gain = |rig: &Rig| rig.layout.devices[DRIVE].device.drive().unwrap().dynamics().unwrap().gain;
        let slower = gain(&each) / gain(&rig);
        let (least, most) = (worst(&each), worst(&rig));
        println!("{model} {divider}: {most:.4} of {least:.4} mm, loop {slower:.2} times as slow");
        prop_assert!(most <= slower * least + 0.01, "{most}, {least}, {slower}");
        // No step where an answer comes: 100 mm/s go 0.2 mm in a cycle.
        let act: Vec<f64> = rig.rows.iter().map(|row| row.axes[Y].act).collect();
        let set: Vec<f64> = rig.rows.iter().map(|row| row.axes[Y].set).collect();
        for at in 1..act.len() {
            let odd = (act[at] - act[at - 1]) - (set[at] - set[at - 1]);
            prop_assert!(odd.abs() < 0.08, "row {at}: {odd}");
        }
    }

    /// A loss, and what it tells, is found in the time that start-up tells.
    #[test]
    fn what_such_a_drive_tells_is_seen_in_time(
        divider in 2..=10_u32,
        row in 5..ROWS,
        wake_ups in 0..3usize,
        silent: bool,
    ) {
        let mut rig = streamed("tlc5xx", divider, CIRCLES);
        rig.run_to_row(row);
        for _ in 0..wake_ups {
            rig.step();
        }
        let within = match silent {
            true => rig.layout.notices(DRIVE).find(|it| it.sign == Sign::TPdos).unwrap().within,
            false => rig.layout.tells_within(DRIVE),
        };
        rig.twin(DRIVE).disturb(match silent {
            true => Disturbance::LoseTPdos(3),
            false => Disturbance::Remote(false),
        });
        let before = rig.session.timeline().now();
        rig.run_until(|rig| !rig.controller().faults().is_empty());
        let after = rig.session.timeline().now().saturating_since(before);
        let fault = rig.controller().faults()[0];
        let is_it = match fault {
            Fault::Device(DRIVE, DeviceCause::MissingTPdo { misses }) => silent && misses == 2 * divider,
            Fault::Device(DRIVE, DeviceCause::NotFollowing { .. }) => !silent,
            _ => false,
        };
        prop_assert!(is_it, "{fault:?}");
        prop_assert!(after <= within, "{after:?} of {within:?}");
        prop_assert!(within <= rig.layout.cycle * (2 * divider + 1));
        prop_assert!(matches!(rig.finish(), End::Fault(_)) && rig.ends_at_rest());
    }
}
