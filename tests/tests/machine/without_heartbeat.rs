//! Drives that a file describes and that have no heartbeat: guarded by remote requests, or watched by their T_PDOs alone.

use super::described::sheet;
use proptest::prelude::*;
use syncline_canopen::time::Duration;
use syncline_canopen::{CanId, CobId, Frame, Instant, NodeId};
use syncline_controller::control::fault::DeviceCause;
use syncline_controller::control::loss::Sign;
use syncline_controller::control::{End, Fault};
use syncline_controller::machine::Machine;
use syncline_drives::twin::Disturbance;
use syncline_tests::command::{Folder, root};
use syncline_tests::rig::Rig;

const PROGRAM: &str = "G21 G90\nG0 X30 Y10\nG1 F9000 X40\nG3 X50 Y20 J10\nG0 X0 Y0\nM2\n";

/// The drive of X.
const X: usize = 0;

/// Between two requests: a quarter of `heartbeat_timeout_ms`.
const EVERY: Duration = Duration::from_millis(75);

/// The description of a drive without 1016h and 1017h; without guarding it has no 100Ch and 100Dh either.
fn describe(folder: &Folder, generic: &str, mode: u8, guarded: bool) -> String {
    let mut eds = sheet(mode, 4, [1, 1], None);
    let absent: &[u16] = match guarded {
        true => &[0x1016, 0x1017],
        false => &[0x1016, 0x1017, 0x100C, 0x100D],
    };
    eds.objects.retain(|index, _| !absent.contains(index));
    let _sheet = folder.file("old.eds", &eds.to_string());
    let text = format!(
        "name = \"old\"\ngeneric = \"{generic}\"\neds = \"old.eds\"\nhas_heartbeat = 0\nhas_guarding = {}\n",
        u8::from(guarded)
    );
    folder.file("old.toml", &text).display().to_string()
}

/// The example with that drive on X.
fn rig_of(guarded: bool, more: &[(&str, &str)], program: &str) -> Rig {
    let folder = Folder::new();
    let old = describe(&folder, "cia402_csp", 8, guarded);
    let servo = root().join("examples/described/servo.toml");
    let [old, servo] = [old, servo.display().to_string()].map(|file| format!("model = {file:?}"));
    let model = "model = \"servo.toml\"";
    let mut replacements = vec![(model, &*old), (model, &*servo)];
    replacements.extend(more);
    Rig::new("described", &replacements, program, |_, _| ())
}

fn rig(guarded: bool) -> Rig {
    rig_of(guarded, &[], PROGRAM)
}

/// The signs by which its loss shows, each with its time.
fn stated(rig: &Rig) -> Vec<(Sign, Duration)> {
    let notices = rig.layout.notices(X);
    notices.map(|it| (it.sign, it.within)).collect()
}

fn node() -> NodeId {
    NodeId::new(1).unwrap()
}

/// When it was asked for a sign of life, each time.
fn requests(rig: &Rig) -> Vec<Instant> {
    let id = CanId::from(CobId::error_control(node()));
    let frames = rig.frames();
    let requests = (frames.iter()).filter(|it| it.frame.is_remote() && it.frame.id() == id);
    requests.map(|it| it.end).collect()
}

/// It is asked every 75 ms, and never while the controller's own heartbeat stands in the same cycle.
#[test]
fn one_with_guarding_is_guarded() {
    let mut rig = rig(true);
    let timeout = rig.machine.controller.heartbeat_timeout;
    assert_eq!(
        stated(&rig),
        [
            (Sign::TPdos, rig.layout.cycle * 3),
            (Sign::Guarding, timeout + rig.layout.cycle),
        ]
    );
    let told = rig.layout.supervision(X);
    assert!(
        told.contains("or guarding without an answer within 302 ms; "),
        "{told}"
    );
    assert!(
        told.contains("300 ms after the last guarding request that it hears"),
        "{told}"
    );
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    let frames = rig.frames();
    let error_control = CanId::from(CobId::error_control(node()));
    let at = requests(&rig);
    assert!(at.len() > 10, "{}", at.len());
    for pair in at.windows(2) {
        let apart = pair[1].saturating_since(pair[0]);
        assert!(
            apart >= EVERY - rig.layout.cycle && apart <= EVERY + rig.layout.cycle * 2,
            "{apart:?}"
        );
    }
    let answers = frames
        .iter()
        .filter(|it| !it.frame.is_remote() && it.frame.id() == error_control);
    assert_eq!(answers.count(), at.len());
    // What it was set to is taken back: it does not miss the controller afterwards.
    let end = rig.session.timeline().now() + Duration::from_secs(1);
    rig.session.timeline().world().advance_to(end);
    let emcy = CanId::from(CobId::emcy(node()));
    assert!(rig.frames().iter().all(|it| it.frame.id() != emcy));
}

/// Loses what `lost` says of the frames that arrive, from a row on; the fault, and in what time it is found.
fn silent(mut rig: Rig, row: usize, lost: fn(&Frame) -> bool) -> (Rig, Fault, Duration) {
    rig.run_to_row(row);
    let before = rig.session.timeline().now();
    rig.bus().doctor = Some(Box::new(move |it| !lost(&it.frame)));
    rig.run_until(|rig| !rig.controller().faults().is_empty());
    let after = rig.session.timeline().now().saturating_since(before);
    let fault = rig.controller().faults()[0];
    (rig, fault, after)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(ProptestConfig::default().cases.min(6)))]

    /// Whenever its answers stay away that is a fault, in the time that start-up tells.
    #[test]
    fn one_that_answers_no_guarding_is_found_in_time(row in 5..300usize) {
        let is_answer = |frame: &Frame| frame.id() == CanId::from(CobId::error_control(node()));
        let (mut rig, fault, after) = silent(rig(true), row, is_answer);
        prop_assert_eq!(fault, Fault::Device(X, DeviceCause::GuardingUnanswered));
        let [_, (_, within)] = stated(&rig)[..] else { panic!() };
        prop_assert!(after <= within, "{:?} of {:?}", after, within);
        prop_assert!(after >= within / 2, "{:?} of {:?}", after, within);
        prop_assert!(matches!(rig.finish(), End::Fault(_)));
        prop_assert!(rig.ends_at_rest());
    }

    /// One answer alone may get lost, and with it the next one, whose toggle bit does not follow.
    #[test]
    fn an_answer_that_gets_lost_is_no_fault(row in 5..300usize) {
        let mut rig = rig(true);
        rig.run_to_row(row);
        let mut left = 1;
        rig.bus().doctor = Some(Box::new(move |it| {
            let is_answer = it.frame.id() == CanId::from(CobId::error_control(node()));
            if is_answer && left > 0 {
                left -= 1;
                return false;
            }
            true
        }));
        prop_assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    }
}

/// It is told its life time, and stops where the controller dies. (Here SYNC stays away first; `cia402_csp` of the drives'
/// tests has guarding alone.)
#[test]
fn a_guarded_drive_notices_that_the_controller_is_gone() {
    let mut rig = rig_of(true, &[], "G21 G90\nG1 X250 F3000\nM2\n");
    rig.run_to_row(400);
    let requests = rig.sent(CobId::r_sdo(node()));
    let writes = |data: &[u8]| requests.iter().any(|it| it.frame.data().starts_with(data));
    assert!(writes(&[0x2B, 0x0C, 0x10, 0, 75, 0]) && writes(&[0x2F, 0x0D, 0x10, 0, 4]));
    assert!(rig.twin(X).observe().velocity.abs() > 0.5);
    let end = rig.session.timeline().now() + Duration::from_secs(1);
    rig.session.timeline().world().advance_to(end);
    let seen = rig.twin(X).observe();
    assert!(seen.velocity.abs() < 0.01 && !seen.is_powered, "{seen:?}");
}

/// Without guarding it is watched by its T_PDOs alone, and start-up says what that leaves open.
#[test]
fn one_without_guarding_is_watched_by_its_t_pdos() {
    let mut rig = rig(false);
    assert_eq!(stated(&rig), [(Sign::TPdos, rig.layout.cycle * 3)]);
    let told = rig.layout.supervision(X);
    assert!(
        told.contains("a dead controller it does not notice, and rests where it was sent last"),
        "{told}"
    );
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    for disturbance in [Disturbance::Mute(true), Disturbance::Reset] {
        let mut rig = self::rig(false);
        rig.run_to_row(200);
        let before = rig.session.timeline().now();
        rig.twin(X).disturb(disturbance);
        rig.run_until(|rig| !rig.controller().faults().is_empty());
        let after = rig.session.timeline().now().saturating_since(before);
        let fault = rig.controller().faults()[0];
        assert!(
            matches!(fault, Fault::Device(X, DeviceCause::MissingTPdo { .. })),
            "{fault:?}"
        );
        assert!(after <= rig.layout.cycle * 3, "{after:?}");
        assert!(
            fault
                .describe(&*rig.layout)
                .contains("no T_PDO in 2 cycles in a row")
        );
        assert!(matches!(rig.finish(), End::Fault(_)));
        assert!(rig.ends_at_rest());
    }
}

/// What is refused of the example with such a drive.
fn refused(
    example: &str,
    generic: &str,
    mode: u8,
    guarded: bool,
    changes: &[(&str, &str)],
) -> String {
    let folder = Folder::new();
    let old = describe(&folder, generic, mode, guarded);
    let file = root().join("examples").join(example).join("machine.toml");
    let mut text = std::fs::read_to_string(&file).unwrap();
    let old = format!("model = {old:?}");
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, &to.replace("OLD", &old), 1);
    }
    match Machine::parse(&file, &text) {
        Ok(_) => String::new(),
        Err(wrong) => wrong.to_string(),
    }
}

/// One that would go on with its last velocity has to be stopped by something else.
#[test]
fn one_that_would_go_on_without_the_controller_is_refused() {
    let x = [("model = \"wheel.toml\"", "OLD")];
    let wrong = refused("velocity", "cia402_csv", 9, false, &x);
    let told = "is sent velocities, and goes on with the last one where the controller dies";
    assert!(wrong.contains(told), "{wrong}");
    let wrong = refused("velocity", "cia402_csv", 9, true, &x);
    assert!(!wrong.contains(told), "{wrong}");
    let spindle = [("model = \"inverter.toml\"", "OLD")];
    let wrong = refused("inverter", "cia402_vl", 2, false, &spindle);
    let told = "does not notice that the controller is gone, and would turn on";
    assert!(wrong.contains(told), "{wrong}");
    assert!(!refused("inverter", "cia402_vl", 2, true, &spindle).contains(told));
}

/// A guarded drive has to have its turn often enough.
#[test]
fn guarding_that_takes_too_long_is_refused() {
    let x = [
        ("model = \"servo.toml\"", "OLD"),
        ("cycle_us = 2000", "cycle_us = 20000"),
    ];
    let wrong = refused("described", "cia402_csp", 8, true, &x);
    assert!(
        wrong.contains(
            "drive \"X\" (old): it is guarded every 75 ms, a quarter of `heartbeat_timeout_ms`"
        ),
        "{wrong}"
    );
    assert!(wrong.contains("`heartbeat_timeout_ms` from 480"), "{wrong}");
}

/// The controller's heartbeat stands in the place of a request: where each cycle has one a guarded drive is refused, and where
/// every second one has it the drive is asked as often as ever.
#[test]
fn guarding_has_its_turn_between_heartbeats() {
    let heartbeats = |ms: u32| format!("cycle_us = 2000\n\n[controller]\nheartbeat_ms = {ms}\n");
    for ms in [1, 2] {
        let cycle = ("cycle_us = 2000", &*heartbeats(ms));
        let x = [("model = \"servo.toml\"", "OLD"), cycle];
        let wrong = refused("described", "cia402_csp", 8, true, &x);
        assert!(
            wrong.contains("`heartbeat_ms` of more than a cycle: from 3"),
            "{ms}: {wrong}"
        );
        assert_eq!(refused("described", "cia402_csp", 8, true, &x[1..]), "");
    }
    for ms in [3, 4] {
        let heartbeats = heartbeats(ms);
        let mut rig = rig_of(true, &[("cycle_us = 2000", &heartbeats)], PROGRAM);
        assert_eq!(rig.finish(), End::Finished, "{ms}: {:?}", rig.events);
        let at = requests(&rig);
        assert!(at.len() > 10, "{ms}: {}", at.len());
        for pair in at.windows(2) {
            let apart = pair[1].saturating_since(pair[0]);
            assert!(apart <= EVERY + rig.layout.cycle * 2, "{ms}: {apart:?}");
        }
    }
}
