//! Probing: simulated work pieces touched by programs, by each way in which a contact is known, and what fails.

use super::replayed::again;
use proptest::prelude::*;
use proptest::sample::select;
use std::process::Stdio;
use syncline_controller::control::fault::BlockCause;
use syncline_controller::control::{End, Event, Fault, KnownBy, ProbeFailure, Row, State};
use syncline_controller::machine::{COORDINATES, Position};
use syncline_controller::session::{Command, Jog, Override};
use syncline_drives::mechanics::touch_probe::{Place, TouchProbe};
use syncline_drives::twin::Disturbance;
use syncline_gcode::AxisLetter;
use syncline_tests::command::{Folder, ended, machine_with, syncline};
use syncline_tests::rig::Rig;

/// Where the example machine gets its probe and its work pieces.
pub(super) const HERE: &str = "[model.lxm32m]";

/// A box of 40 × 30 mm with its corner at X0 Y0 and its top at Z-20, and beside it a cylinder of 50 mm; a ball of 4 mm.
const PIECES: &str = r#"
[simulation]
ball = 4.0

[[simulation.workpiece]]
name = "box"
shape = "box"
x = [0.0, 40.0]
y = [0.0, 30.0]
z = [-60.0, -20.0]

[[simulation.workpiece]]
name = "cylinder"
shape = "cylinder"
x = 120.0
y = 60.0
z = [-60.0, -20.0]
diameter = 50.0
"#;

/// The probe at inputs of these drives.
pub(super) fn wired(drives: &[&str]) -> String {
    let wired = drives.iter().map(|drive| {
        format!(
            "[[input]]\nname = \"probe at {drive}\"\ndrive = \"{drive}\"\nsignal = \"DI0\"\nfunction = \"probe\"\n"
        )
    });
    wired.collect()
}

pub(super) const ALL: [&str; 3] = ["left-right", "front-back", "up-down"];

/// What a machine adds to the example.
pub(super) fn with(extra: &str) -> String {
    format!("{extra}\n{PIECES}\n{HERE}")
}

/// A contact that a run came to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Contact {
    pub(super) at: Position,
    pub(super) uncertainty: f64,
    by: KnownBy,
}

/// Runs to the end; every contact on the way, and how far the probe went behind each before the next motion.
pub(super) fn contacts(rig: &mut Rig) -> Vec<Contact> {
    let mut found = Vec::new();
    let mut seen = 0;
    loop {
        let goes_on = rig.step();
        let told: Vec<Event> = rig.events[seen..].into();
        for event in told {
            if let Event::Probed {
                found: Some((uncertainty, by)),
                ..
            } = event
            {
                let probed = *rig.controller().found().expect("there was contact");
                found.push(Contact {
                    at: probed.contact.expect("there was contact"),
                    uncertainty,
                    by,
                });
            }
        }
        seen = rig.events.len();
        if !goes_on {
            return found;
        }
    }
}

pub(super) fn probe(rig: &Rig) -> TouchProbe {
    rig.machine
        .touched
        .workpieces
        .clone()
        .expect("it has work pieces")
}

/// Around the box, from above, and about the cylinder.
pub(super) const AROUND: &str = "\
G21 G90 G94
G0 X-10 Y15 Z-15
G0 Z-30
G38.2 X10 F300
#1 = #5061
G0 X-10
G0 Y-10
G0 X20
G38.2 Y10 F300
#2 = #5062
G0 Y-10
G0 X55
G0 Y15
G38.3 X30 F300
#3 = #5061
G0 X55
G0 Y45
G0 X20
G38.2 Y20
#4 = #5062
G0 Y45
G0 Z0
G0 Y15
G38.2 Z-30 F200
#5 = #5063
G38.4 Z0 F50
G0 Z0
(PRINT, the box is [#3 - #1 - 4] by [#4 - #2 - 4])
G0 X85 Y60
G0 Z-30
G38.2 X120 F300
G0 X85 Y25
G38.2 X120 Y60 F300
G0 X85 Y25
G0 Z0
M2
";

/// Increments of the example's drives, mm: the coarsest.
const INCREMENT: f64 = 20.0 / 1.5 / 131_072.0;

/// The three of a place that a probe has.
pub(super) fn tip(at: &Position) -> Place {
    [at[0], at[1], at[2]]
}

#[test]
fn a_box_and_a_cylinder_are_found() {
    use KnownBy::{Captured, Inferred, Sampled};
    let only_x = [
        Captured, Sampled, Captured, Sampled, Sampled, Sampled, Captured, Inferred,
    ];
    let ways = [
        (true, &ALL[..], [Captured; 8]),
        (false, &ALL[..], [Sampled; 8]),
        (true, &ALL[..1], only_x),
    ];
    for (latch, drives, by) in ways {
        let mut extra = wired(drives);
        if !latch {
            extra += "[probing]\nlatch = false\n";
        }
        let mut rig = Rig::new("xyz", &[(HERE, &with(&extra))], AROUND, |_, _| ());
        let found = contacts(&mut rig);
        assert_eq!(rig.problems, [""; 0], "{:?}", rig.events);
        assert_eq!(rig.end(), Some(End::Finished), "{:?}", rig.events);
        let known: Vec<KnownBy> = found.iter().map(|contact| contact.by).collect();
        assert_eq!(known, by, "{found:?}");
        let probe = probe(&rig);
        for (place, contact) in found.iter().enumerate() {
            let off = probe.clearance(tip(&contact.at)).abs();
            // Two axes of the last one move, each of which may be off by as much.
            let axes: f64 = if place == 7 { 2.0 } else { 1.0 };
            assert!(
                off <= axes.sqrt() * contact.uncertainty,
                "{off} {contact:?}"
            );
            if contact.by == Captured {
                assert!(off <= 2.0 * INCREMENT, "{off} {contact:?}");
            }
        }
        // The program goes on with what it found.
        let (_, told) = &rig.messages[0];
        let numbers: Vec<f64> = told
            .split(['[', ']', ' '])
            .filter_map(|it| it.parse().ok())
            .collect();
        let (across, along) = (numbers[0] - numbers[1] - 4.0, numbers[3] - numbers[4] - 4.0);
        let told_off = found.iter().map(|it| it.uncertainty).fold(0.0, f64::max);
        let off = found.iter().map(|it| probe.clearance(tip(&it.at)).abs());
        let off = off.fold(0.0, f64::max);
        println!(
            "latch {latch}, {} drives: box {across:.4} x {along:.4} mm, off by {off:.5} mm, told {told_off:.5} mm",
            drives.len()
        );
        let most = 2.0 * told_off;
        assert!(
            (across - 40.0).abs() <= most && (along - 30.0).abs() <= most,
            "{told}"
        );
    }
}

/// The example with its probe at every drive.
pub(super) fn rig(program: &str) -> Rig {
    Rig::new("xyz", &[(HERE, &with(&wired(&ALL)))], program, |_, _| ())
}

/// The same, staying on.
fn staying_on() -> Rig {
    let mut rig = Rig::staying_on("xyz", &[(HERE, &with(&wired(&ALL)))], |_, _| ());
    settle(&mut rig);
    rig
}

fn state(rig: &Rig) -> State {
    rig.session.status().state
}

/// Goes on until the machine rests and waits for an operator.
fn settle(rig: &mut Rig) {
    let mut since = 0;
    while since < 6 && rig.step() {
        let rests = matches!(state(rig), State::Ready | State::Held | State::Faulted);
        since = if rests { since + 1 } else { 0 };
    }
}

fn go(rig: &mut Rig, command: Command) {
    rig.command(command);
    settle(rig);
}

fn failure(rig: &mut Rig) -> ProbeFailure {
    match rig.finish_with_fault() {
        Fault::Block(_, BlockCause::Probing(failure)) => failure,
        other => panic!("{other:?}"),
    }
}

#[test]
fn what_fails_is_told_by_name() {
    let before = "G21 G90 G94\nG0 X-10 Y15 Z-15\nG0 Z-30\n";
    let program = |block: &str| format!("{before}{block}\nM2\n");
    assert_eq!(
        failure(&mut rig(&program("G38.2 X-5 F300"))),
        ProbeFailure::NoContact
    );
    assert_eq!(
        failure(&mut rig(&program("G38.4 X-5 F300"))),
        ProbeFailure::Open
    );
    let touched = program("G38.2 X5 F300\nG38.2 X-5");
    assert_eq!(failure(&mut rig(&touched)), ProbeFailure::Closed);
    let stuck = program("G38.2 X5 F300\nG38.4 X-2.5 F50");
    let mut probed = rig(&stuck);
    probed.run_until(|rig| (rig.events.iter()).any(|it| matches!(it, Event::Probed { .. })));
    for drive in 0..3 {
        probed.twin(drive).disturb(Disturbance::Input(0, true));
    }
    probed.run_until(|rig| !rig.controller().faults().is_empty() || rig.end().is_some());
    // The world lets it go, as it knows nothing of the stuck contact; then a contact at another drive stays.
    let mut stays = rig(&stuck);
    stays.run_until(|rig| (rig.events.iter()).any(|it| matches!(it, Event::Probed { .. })));
    stays.run_until(|rig| {
        rig.twin(1).disturb(Disturbance::Input(0, true));
        rig.end().is_some()
    });
    assert!(
        matches!(
            stays.end(),
            Some(End::Fault(Fault::Block(
                _,
                BlockCause::Probing(ProbeFailure::Stuck)
            )))
        ),
        "{:?}",
        stays.end()
    );
    let fast = failure(&mut rig(&program("G38.2 X5 F20000")));
    assert!(
        matches!(fast, ProbeFailure::TooFast { overtravel, allowed } if overtravel > allowed),
        "{fast:?}"
    );
    // G38.3 and G38.5 go on.
    let goes_on = program("G38.3 X-5 F300\n(PRINT, #5070 #5061)");
    let mut rig = rig(&goes_on);
    assert_eq!(rig.finish(), End::Finished);
    assert_eq!(rig.messages, [(5, "0 -5".to_owned())]);
}

// --- beside axes that go point to point ---

const BUS: (&str, &str) = ("bitrate = 500_000", "bitrate = 1_000_000");

/// U on a TLC53x.
const BESIDE: (&str, &str) = (
    "[[axis]]\nname = \"Z\"",
    r#"[[drive]]
name = "feeder"
bus = "main"
node = 5
model = "tlc5xx"

[[axis]]
name = "U"
drives = ["feeder"]
motion = "point_to_point"
pitch = 20.0
max_velocity = 300.0
max_acceleration = 3000.0
max_jerk = 1e6
soft_limits = [-300.0, 300.0]
following_error_limit = 1.0
standstill_window = 0.05

[[axis]]
name = "Z""#,
);
const FEEDER: usize = 3;
const U: usize = 6;

proptest! {
    #![proptest_config(ProptestConfig { cases: 4, ..ProptestConfig::default() })]

    /// Wherever one stands, it stays there, and the contact is where it is without it.
    #[test]
    fn an_axis_that_goes_point_to_point_stays_while_others_probe(
        place in -200.0..200.0_f64, feed in 60.0..600.0_f64, held in prop::option::of(0..300usize),
    ) {
        let program = format!(
            "G21 G90\nG0 X-10 Y15 Z-15\nG0 Z-30\nG0 U{place:.3}\nG38.2 X5 F{feed:.0}\nG0 X-10\nG38.3 X-2.5\n\
             G0 X-20\nM2\n"
        );
        let machine = with(&wired(&ALL));
        let mut rig = Rig::new("xyz", &[BUS, BESIDE, (HERE, &machine)], &program, |_, _| ());
        let probes = |row: &Row<COORDINATES>| row.axes[0].act > -9.9 && row.axes[2].act < -29.9;
        rig.run_until(|rig| rig.rows.last().is_some_and(probes));
        prop_assert_eq!(rig.session.status().line, 5);
        if let Some(wake_ups) = held {
            for _ in 0..wake_ups {
                rig.step();
            }
            rig.command(Command::FeedHold);
            for _ in 0..200 {
                rig.step();
            }
            rig.command(Command::Resume);
        }
        let found = contacts(&mut rig);
        prop_assert_eq!(rig.end(), Some(End::Finished), "{:?}", rig.events);
        // The ball has a radius of 2 mm.
        prop_assert_eq!(found.len(), 1);
        prop_assert!((found[0].at[0] + 2.0).abs() <= 2.0 * INCREMENT + found[0].uncertainty, "{:?}", found[0]);
        let probing = rig.rows.iter().filter(|row| probes(row));
        let beside: Vec<f64> = probing.map(|row| row.axes[U].act).collect();
        prop_assert!(beside.iter().all(|at| (at - place).abs() < 0.05), "{:?}", beside);
    }

    /// Contact that comes while it goes to its target stops it.
    #[test]
    fn contact_stops_one_that_goes_point_to_point(wake_ups in 0..900usize, stays_on: bool) {
        let machine = with(&wired(&ALL));
        let changes = [BUS, BESIDE, (HERE, &machine)];
        let mut rig = match stays_on {
            true => Rig::staying_on("xyz", &changes, |_, _| ()),
            false => Rig::new("xyz", &changes, "G21 G90\nG0 U200\nG4 P1\nM2\n", |_, _| ()),
        };
        if stays_on {
            settle(&mut rig);
            rig.command(Command::Mdi("G0 U200".into()));
        }
        rig.run_until(|rig| rig.twin(FEEDER).observe().velocity.abs() > 1.0);
        for _ in 0..wake_ups {
            rig.step();
        }
        let moves = rig.twin(FEEDER).observe().velocity.abs() > 1.0;
        rig.twin(0).disturb(Disturbance::Input(0, true));
        let before = rig.twin(FEEDER).observe().position;
        for _ in 0..400 {
            rig.step();
        }
        let after = rig.twin(FEEDER).observe();
        if moves {
            prop_assert!(rig.events.contains(&Event::Touched), "{:?}", rig.events);
            // 300 mm/s and 3000 mm/s² on 20 mm a revolution, and the cycles of the reaction.
            prop_assert!((after.position - before).abs() < 1.2, "{} {:?}", before, after);
            prop_assert!(after.velocity.abs() < 0.05, "{:?}", after);
        }
        match rig.end() {
            Some(end) if moves => prop_assert_eq!(end, End::Fault(Fault::Touched)),
            // Before that it creeps up to its target.
            Some(end) if wake_ups > 600 => prop_assert_eq!(end, End::Finished),
            Some(_) => {}
            None => prop_assert!(!stays_on || state(&rig) == State::Ready, "{}", state(&rig)),
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { max_shrink_iters: 20, ..ProptestConfig::with_cases(6) })]

    /// What a shaper has still to bring behind the contact counts, too: a probing goes no further than is allowed, or is
    /// refused.
    #[test]
    fn a_shaped_probing_stays_within_its_overtravel(
        kind in select(vec!["zv", "zvd", "ei", "two_hump_ei"]),
        frequency in 3.0..20.0f64, overtravel in 0.3..4.0f64, feed in 60.0..2000.0f64,
    ) {
        let machine = with(&wired(&ALL)).replace(
            "[model.lxm32m]",
            &format!(
                "[probing]\novertravel = {overtravel:.3}\n\n[shaper]\nkind = \"{kind}\"\nmodes = [[{frequency:.3}, 0.02]]\n\n[model.lxm32m]"
            ),
        );
        let program = format!("G21 G90\nG0 X-10 Y15 Z-15\nG0 Z-30\nG38.2 X25 F{feed:.1}\nM2\n");
        let mut rig = Rig::new("xyz", &[(HERE, &*machine)], &program, |_, _| ());
        match rig.finish() {
            End::Finished => {
                // Before it is down there it comes from further on.
                let down = rig.rows.iter().filter(|row| row.plan.position[2] < -29.9);
                let far = down.map(|row| row.plan.position[0]).fold(f64::MIN, f64::max);
                // The ball of 4 mm touches the face at X0.
                prop_assert!(far + 2.0 <= overtravel + 0.01, "{far}");
            }
            End::Fault(Fault::Block(_, BlockCause::Probing(ProbeFailure::TooFast { overtravel: told, .. }))) => {
                prop_assert!(told > overtravel);
            }
            end => prop_assert!(false, "{end:?}"),
        }
    }
}

/// Behind the contact an axis is held back, outside of its window.
#[test]
fn one_that_does_not_settle_ends_it() {
    for stays_on in [false, true] {
        let lines = "G21 G90\nG0 X-10 Y15 Z-15\nG0 Z-30\nG38.2 X5 F300\nG4 P5\n";
        let machine = with(&wired(&ALL)).replace(
            "[model.lxm32m]",
            "[probing]\novertravel = 5.0\n\n[model.lxm32m]",
        );
        let tight = (
            "soft_limits = [-250.0, 250.0]",
            "soft_limits = [-250.0, 250.0]\nstandstill_window = 0.02",
        );
        let changes = [tight, (HERE, &*machine)];
        let mut rig = match stays_on {
            true => Rig::staying_on("xyz", &changes, |_, _| ()),
            false => Rig::new("xyz", &changes, &format!("{lines}M2\n"), |_, _| ()),
        };
        if stays_on {
            settle(&mut rig);
            rig.command(Command::Mdi(lines.into()));
        }
        rig.run_until(|rig| {
            let actual = rig.session.status().actual;
            actual[2] < -29.9 && actual[0] > -1.99
        });
        rig.twin(0).disturb(Disturbance::Block(true));
        let failure = match stays_on {
            false => failure(&mut rig),
            true => {
                settle(&mut rig);
                assert_eq!(state(&rig), State::Ready);
                let failed = |event: &Event| match event {
                    Event::ProbingFailed { failure, .. } => Some(*failure),
                    _ => None,
                };
                rig.events.iter().find_map(failed).expect("it failed")
            }
        };
        assert_eq!(failure, ProbeFailure::NotSettled { axis: 1 });
    }
}

/// Where the path rests for a few cycles its axes, which lag behind, do not.
#[test]
fn contact_at_a_turn_of_the_path_stops() {
    for wake_ups in 0..30 {
        let mut rig = rig("G21 G90\nG0 X20\nG4 P0.01\nG0 X0\nM2\n");
        rig.run_until(|rig| {
            rig.rows
                .last()
                .is_some_and(|row| row.plan.position[0] > 19.9)
        });
        for _ in 0..wake_ups {
            rig.step();
        }
        rig.twin(0).disturb(Disturbance::Input(0, true));
        assert_eq!(rig.finish_with_fault(), Fault::Touched, "{wake_ups}");
        let x = rig.rows.last().expect("it moved").plan.position[0];
        assert!(x > 15.0, "{wake_ups}: {x}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { max_shrink_iters: 20, ..ProptestConfig::with_cases(8) })]

    /// A jog, or a typed line, that begins in contact goes no further into the work than a probing may, and away from it, also
    /// behind that, as far as it is to.
    #[test]
    fn a_probe_that_touches_is_not_driven_further(
        axis in select(vec![AxisLetter::X, AxisLetter::Y, AxisLetter::Z]),
        way in 3.0..9.0f64, back: bool, speed in 5.0..60.0f64, typed: bool, again in 0..3,
    ) {
        let mut rig = staying_on();
        go(&mut rig, Command::Mdi("G21 G90\nG0 X-10 Y15 Z-15\nG0 Z-30".into()));
        go(&mut rig, Command::Jog(Jog::By { axis: AxisLetter::X, distance: 25.0, speed: Some(10.0) }));
        let touches = |rig: &Rig| rig.session.status().inputs.contains(&true);
        let contact = rig.session.status().setpoint;
        prop_assert!(touches(&rig));
        let from = |rig: &Rig| {
            let at = rig.session.status().setpoint;
            (0..3).map(|axis| (at[axis] - contact[axis]).powi(2)).sum::<f64>().sqrt()
        };
        let distance = if back { -way } else { way };
        // Beside and above the face, and along it, there is the same work.
        let into = axis != AxisLetter::X || !back;
        for _ in 0..=again {
            let told = rig.events.len();
            go(&mut rig, match typed {
                true => Command::Mdi(format!("G91 G1 {axis}{distance:.3} F{:.1}\nG90", speed * 60.0)),
                false => Command::Jog(Jog::By { axis, distance, speed: Some(speed) }),
            });
            let stopped = rig.events[told..].contains(&Event::Pressed);
            prop_assert_eq!(stopped, into, "{:?}", rig.events);
            prop_assert_eq!(touches(&rig), into);
            if !into {
                // Lines are typed with three decimals.
                prop_assert!((from(&rig) - way).abs() < 6e-4, "{}", from(&rig));
                break;
            }
            // What the axes go on for as they stop, each time that it is tried.
            let stops = speed * speed / 500.0 + speed * 0.08 + 0.1;
            prop_assert!(from(&rig) < 2.0 + stops * f64::from(again + 2), "{}", from(&rig));
        }
        let before = rig.events.len();
        let home = Jog::By { axis: AxisLetter::X, distance: -10.0, speed: Some(speed) };
        if into && axis == AxisLetter::X {
            go(&mut rig, Command::Jog(home));
            let stops = |event: &Event| matches!(event, Event::Touched | Event::Pressed);
            prop_assert!(!rig.events[before..].iter().any(stops));
            prop_assert!(!touches(&rig));
        }
    }
}

#[test]
fn contact_that_nobody_looks_for_stops() {
    let into = "G21 G90\nG0 X-10 Y15 Z-15\nG0 Z-30\nG0 X20\nM2\n";
    let mut one = rig(into);
    assert_eq!(one.finish_with_fault(), Fault::Touched);
    let mut rig = staying_on();
    go(&mut rig, Command::Mdi("G0 X-10 Y15 Z-15\nG0 Z-30".into()));
    for motion in [
        Command::Mdi("G1 X20 F2000".into()),
        Command::Jog(Jog::By {
            axis: AxisLetter::X,
            distance: 25.0,
            speed: Some(30.0),
        }),
    ] {
        let told = rig.events.len();
        rig.command(motion);
        rig.run_until(|rig| {
            assert_ne!(state(rig), State::Faulted, "{:?}", rig.session.faults());
            rig.events[told..].contains(&Event::Touched)
        });
        settle(&mut rig);
        assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
        // Each of the drives that the probe is wired to hears of it.
        let told = rig.events[told..].iter();
        assert_eq!(told.filter(|it| **it == Event::Touched).count(), 1);
        let x = rig.session.status().setpoint[0];
        assert!((-2.0..1.5).contains(&x), "{x}");
        // Away from there is no contact that comes.
        go(&mut rig, Command::Mdi("G0 X-5".into()));
        assert_eq!(rig.session.status().setpoint[0], -5.0);
    }
    // A typed line probes as a program does.
    go(
        &mut rig,
        Command::Mdi("G38.2 X5 F300\n(PRINT, #5070 #5061)".into()),
    );
    assert_eq!(rig.messages.len(), 1, "{:?}", rig.events);
    assert!(
        rig.messages[0].1.starts_with("1 -2.000"),
        "{:?}",
        rig.messages
    );
    go(&mut rig, Command::Mdi("G38.2 X5".into()));
    let failed = |event: &Event| {
        matches!(
            event,
            Event::ProbingFailed {
                failure: ProbeFailure::Closed,
                ..
            }
        )
    };
    assert!(rig.events.iter().any(failed), "{:?}", rig.events);
    assert_eq!(state(&rig), State::Ready);
}

#[test]
fn an_operator_holds_a_probing_and_has_it_go_on() {
    let retraction =
        "[retraction]\naxis = \"Z\"\nclearance = -5.0\napproach_speed = 10.0\n".to_owned();
    for extra in [String::new(), retraction] {
        hold_and_go_on(&(wired(&ALL) + &extra));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 8, ..ProptestConfig::default() })]

    /// Whenever a hold comes, also behind the contact, and although the probe is touched by hand meanwhile: nothing sets
    /// off before a resume.
    #[test]
    fn a_hold_outlasts_the_probing(wake_ups in 0..1800usize, by_hand: bool, door: bool) {
        let door_of = "[[input]]\nname = \"door\"\ndrive = \"up-down\"\nsignal = \"DI2\"\nfunction = \"door\"\n";
        let program = "G21 G90 G94\nG0 X-10 Y15 Z-15\nG0 Z-30\nG38.2 X5 F300\nG0 X-10\nM2\n";
        // An input without a capture, as nothing but the probe's ball makes a simulated drive capture.
        let extra = with(&(wired(&ALL).replace("DI0", "DI3") + door_of));
        let mut rig = Rig::new("xyz", &[(HERE, &extra)], program, |_, _| ());
        let at = |rig: &Rig| rig.rows.last().map(|row| row.plan.position);
        rig.run_until(|rig| at(rig).is_some_and(|at| at[2] == -30.0 && at[0] > -9.99));
        for _ in 0..wake_ups {
            rig.step();
        }
        prop_assume!(state(&rig) == State::Running);
        if door {
            rig.twin(2).disturb(Disturbance::Input(2, true));
        } else {
            rig.command(Command::FeedHold);
        }
        for _ in 0..400 {
            rig.step();
        }
        prop_assume!(rig.end().is_none());
        prop_assert_eq!(state(&rig), State::Held);
        let held = at(&rig).unwrap()[0];
        for on in [true, false] {
            for drive in 0..3 {
                rig.twin(drive).disturb(Disturbance::Input(3, on && by_hand));
            }
            for _ in 0..300 {
                rig.step();
            }
            let moved = (at(&rig).unwrap()[0] - held).abs();
            prop_assert!(moved < 1e-9 && state(&rig) == State::Held, "{:?}", rig.session.faults());
        }
        rig.twin(2).disturb(Disturbance::Input(2, false));
        for _ in 0..20 {
            rig.step();
        }
        rig.command(Command::Resume);
        prop_assert_eq!(rig.finish(), End::Finished);
        prop_assert_eq!(at(&rig).map(|at| at[0]), Some(-10.0));
        prop_assert_eq!(contacts_told(&rig), 1);
    }
}

/// Where a probing turns round that is disturbed so many rows before it does so otherwise, and its contact.
fn turns_at(before: usize, disturb: impl Fn(&mut Rig)) -> (usize, f64, Contact) {
    let program = "G21 G90 G94\nG0 X-10 Y15 Z-15\nG0 Z-30\nG38.2 X5 F600\nM2\n";
    let patient = ("[controller]\n", "[controller]\nt_pdo_misses = 5\n");
    let extra = with(&wired(&ALL));
    let mut rig = Rig::new("xyz", &[(HERE, &extra), patient], program, |_, _| ());
    rig.run_to_row(before);
    disturb(&mut rig);
    let found = contacts(&mut rig);
    let [contact] = found[..] else {
        panic!("{:?}", rig.events);
    };
    let speed = |row: &Row<COORDINATES>| row.plan.velocity[0];
    let cruises = rig.rows.iter().rposition(|row| speed(row) > 9.999_999);
    let far = rig.rows.iter().map(|row| row.plan.position[0]);
    (cruises.unwrap(), far.fold(f64::MIN, f64::max), contact)
}

/// The probe alone stops the axes: whoever else is not heard meanwhile, they go no further for it, and where the contact was
/// is known to what was heard.
#[test]
fn a_contact_stops_whoever_is_not_heard() {
    let (row, far, clean) = turns_at(100, |_| ());
    for device in [1, 2] {
        for before in [0, 1, 2, 4] {
            let lose = |rig: &mut Rig| rig.twin(device).disturb(Disturbance::LoseTPdos(4));
            let (_, without, contact) = turns_at(row - before, lose);
            assert!(
                without <= far + 1e-9,
                "{device}, {before}: {without} beyond {far}"
            );
            let off = (contact.at[0] - clean.at[0]).abs();
            assert!(
                off <= contact.uncertainty + clean.uncertainty,
                "{device}, {before}: {contact:?}"
            );
        }
    }
}

/// How many contacts were told.
fn contacts_told(rig: &Rig) -> usize {
    let probed = |event: &&Event| matches!(event, Event::Probed { found: Some(_), .. });
    rig.events.iter().filter(probed).count()
}

/// A probing that is held rests where it is, whatever else brings a path back; it goes on when that is asked for.
fn hold_and_go_on(extra: &str) {
    let program = "G21 G90 G94\nG0 X-10 Y15 Z-15\nG0 Z-30\nG38.2 X5 F300\nG0 X-10\nM2\n";
    let mut rig = Rig::new("xyz", &[(HERE, &with(extra))], program, |_, _| ());
    let below = |x: f64| {
        move |rig: &mut Rig| {
            rig.rows
                .last()
                .is_some_and(|row| row.plan.position[0] > x && row.plan.position[2] == -30.0)
        }
    };
    rig.run_until(below(-8.0));
    rig.command(Command::FeedHold);
    rig.run_until(|rig| state(rig) == State::Held);
    let held = rig.rows.last().unwrap().plan.position[0];
    assert!((-8.0..-7.0).contains(&held), "{held}");
    rig.command(Command::Retrace);
    for _ in 0..200 {
        rig.step();
    }
    assert_eq!(rig.refused.len(), 1);
    rig.command(Command::CycleStart);
    for _ in 0..200 {
        rig.step();
    }
    assert_eq!(rig.rows.last().unwrap().plan.position[0], held);
    rig.command(Command::Resume);
    rig.run_until(below(-6.0));
    // The feed override slows it down, to rest, and lets it go on.
    rig.command(Command::FeedOverride(Override::To(0.0)));
    for _ in 0..400 {
        rig.step();
    }
    assert_eq!(rig.rows.last().unwrap().plan.velocity[0], 0.0);
    rig.command(Command::FeedOverride(Override::To(150.0)));
    for _ in 0..100 {
        rig.step();
    }
    assert!((rig.rows.last().unwrap().plan.velocity[0] - 5.0).abs() < 1e-9);
    let found = contacts(&mut rig);
    assert!((found[0].at[0] + 2.0).abs() < 2.0 * INCREMENT, "{found:?}");
    assert_eq!(rig.end(), Some(End::Finished));
    let at = rig.rows.last().unwrap().plan.position[0];
    assert_eq!(at, -10.0);
}

#[test]
fn a_run_with_probings_is_judged_and_replayed() {
    let mut rig = rig(AROUND);
    assert_eq!(rig.finish(), End::Finished);
    assert_eq!(again(&mut rig, Some(AROUND), &[]), []);
    let summary = self::rig(AROUND).judge();
    assert_eq!(summary.verdict, "pass", "{:?}", summary.violations);
}

/// As a user has it: in a thread of its own, beside that of the planner, and in virtual time.
#[test]
fn commands_probe() {
    let folder = Folder::new();
    let machine = folder.file(
        "machine.toml",
        &machine_with("xyz", &[(HERE, &with(&wired(&ALL)))]),
    );
    let text = "G21 G90 G94\nG0 X-6 Y15 Z-15\nG0 Z-30\nG38.2 X10 F300\nG0 X[#5061 - 4]\nM2\n";
    let program = folder.file("touch.ngc", text);
    let log = folder.path("run.log").display().to_string();
    for (verb, arguments) in [
        ("run", &["--wait-for-plan", "--candump", &log][..]),
        ("validate", &[]),
        ("check", &[]),
    ] {
        let output = syncline()
            .stdin(Stdio::null())
            .arg(verb)
            .arg(&machine)
            .arg(&program)
            .args(arguments)
            .output();
        let output = output.unwrap();
        let (code, printed, told) = ended(&output);
        assert_eq!(code, 0, "{verb}: {printed}{told}");
        let probes = verb != "run" || told.contains("line 4: contact, known to 0.0002 mm");
        assert!(probes, "{verb}: {printed}{told}");
    }
    let output = syncline()
        .arg("replay")
        .arg(&log)
        .arg(&machine)
        .arg(&program)
        .output();
    let output = output.unwrap();
    let (code, printed, told) = ended(&output);
    assert_eq!(code, 0, "{printed}{told}");
}

/// A work piece, a way to it and how it is wired.
#[derive(Clone, Debug)]
struct Case {
    piece: String,
    ball: f64,
    /// Where it begins, outside of the piece, and a place inside of it.
    from: Place,
    inside: Place,
    /// The part of the way there that is programmed.
    part: f64,
    /// mm/min
    feed: f64,
    required: bool,
    latch: bool,
    drives: [bool; 3],
    seed: u64,
}

fn piece() -> impl Strategy<Value = (String, Place)> {
    let middle = (
        -60.0..60.0_f64,
        -60.0..60.0_f64,
        5.0..40.0_f64,
        5.0..40.0_f64,
    );
    prop_oneof![
        middle.clone().prop_map(|(x, y, w, d)| {
            let text = format!(
                "shape = \"box\"\nx = [{:.3}, {:.3}]\ny = [{:.3}, {:.3}]\nz = [-80.0, -30.0]",
                x - w, x + w, y - d, y + d
            );
            (text, [x, y, -45.0])
        }),
        middle.clone().prop_map(|(x, y, r, _)| {
            let text = format!(
                "shape = \"cylinder\"\nx = {x:.3}\ny = {y:.3}\ndiameter = {:.3}\nz = [-80.0, -30.0]",
                2.0 * r
            );
            (text, [x, y, -45.0])
        }),
        middle.prop_map(|(x, y, ..)| {
            ("shape = \"plane\"\nfacing = \"+Z\"\nat = -30.0".to_owned(), [x, y, -45.0])
        }),
    ]
}

fn case() -> impl Strategy<Value = Case> {
    let way = (
        0.0..std::f64::consts::TAU,
        -1.0..1.0_f64,
        60.0..110.0_f64,
        0.02..1.0_f64,
    );
    let how = (
        any::<bool>(),
        prop::bool::weighted(0.8),
        any::<[bool; 3]>(),
        any::<u64>(),
    );
    let kinds = (prop::sample::select(vec![0.0, 2.0, 6.0]), 20.0..2500.0_f64);
    (piece(), way, kinds, how).prop_map(|((piece, inside), way, (ball, feed), how)| {
        let (angle, up, far, part) = way;
        let flat = (1.0 - up * up).sqrt();
        let out = [flat * angle.cos(), flat * angle.sin(), up.abs()];
        let from = [0, 1, 2].map(|axis: usize| inside[axis] + far * out[axis]);
        let (required, latch, mut drives, seed) = how;
        if drives == [false; 3] {
            drives[0] = true;
        }
        Case {
            piece,
            ball,
            from,
            inside,
            part,
            feed,
            required,
            latch,
            drives,
            seed,
        }
    })
}

impl Case {
    fn rig(&self) -> Rig {
        let wired_at = ALL.iter().zip(self.drives).filter(|(_, wired)| *wired);
        let drives: Vec<&str> = wired_at.map(|(drive, _)| *drive).collect();
        let machine = format!(
            "{}\n[probing]\nlatch = {}\n[simulation]\nball = {}\n[[simulation.workpiece]]\nname = \"it\"\n{}\n{HERE}",
            wired(&drives),
            self.latch,
            self.ball,
            self.piece
        );
        let [x, y, z] = self.from;
        let to = [0, 1, 2]
            .map(|axis: usize| self.from[axis] + self.part * (self.inside[axis] - self.from[axis]));
        let code = if self.required { "G38.2" } else { "G38.3" };
        let program = format!(
            "G21 G90 G94\nG0 Z20\nG0 X{x} Y{y}\nG0 Z{z}\n{code} X{} Y{} Z{} F{}\nM2\n",
            to[0], to[1], to[2], self.feed
        );
        let seed = self.seed;
        Rig::new(
            "xyz",
            &[(HERE, &machine)],
            &program,
            move |drive, config| {
                config.seed = seed.wrapping_add(drive as u64);
            },
        )
    }
}

/// A bounce between two samples that count: the drive captures it, and the contact comes later.
#[test]
fn an_edge_that_no_sample_saw_is_another_one() {
    let mut rig = rig("G21 G90 G94\nG0 X-10 Y15 Z-15\nG0 Z-30\nG38.2 X5 F300\nM2\n");
    rig.run_until(|rig| {
        let row = rig.rows.last();
        row.is_some_and(|row| row.plan.position[0] > -8.0 && row.plan.position[2] == -30.0)
    });
    rig.twin(1).disturb(Disturbance::LoseTPdos(1));
    rig.twin(0).disturb(Disturbance::Input(0, true));
    rig.step();
    rig.twin(0).disturb(Disturbance::Input(0, false));
    assert_eq!(failure(&mut rig), ProbeFailure::OtherEdge { axis: 1 });
    let at = rig.rows.last().unwrap().plan.position[0];
    assert!((-2.0..-1.0).contains(&at), "{at}");
}

/// What an axis captures that hardly moves lies between none of its samples, and tells no instant.
#[test]
fn an_axis_that_hardly_moves_is_no_other_edge() {
    let case = Case {
        piece: "shape = \"plane\"\nfacing = \"+Z\"\nat = -30.0".to_owned(),
        ball: 0.0,
        from: [-23.652379541441242, -32.86093220308962, -7.137694523565109],
        inside: [45.29724627321733, -34.289711569956694, -45.0],
        part: 0.7863640323607872,
        feed: 1461.9813573385009,
        required: false,
        latch: true,
        drives: [false, true, false],
        seed: 1412443464539988734,
    };
    let mut rig = case.rig();
    let found = contacts(&mut rig);
    assert_eq!(rig.end(), Some(End::Finished), "{:?}", rig.events);
    let off = probe(&rig).clearance(tip(&found[0].at)).abs();
    assert!(
        off <= 3.0_f64.sqrt() * found[0].uncertainty,
        "{off} {found:?}"
    );
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    #[test]
    fn a_contact_is_where_it_is_said_to_be_or_told_to_be_missing(case in case()) {
        let mut rig = case.rig();
        let probe = probe(&rig);
        // It begins above all, and comes down beside the piece.
        let [x, y, z] = case.from;
        prop_assume!((-150.0..=20.0).contains(&z) && x.abs() < 200.0 && y.abs() < 190.0);
        let above = (0..=100).map(|step| z + (20.0 - z) * f64::from(step) / 100.0);
        prop_assume!(above.map(|z| probe.clearance([x, y, z])).fold(f64::INFINITY, f64::min) > 1.0);
        let found = contacts(&mut rig);
        let end = rig.end();
        if let Some(End::Fault(Fault::Block(_, BlockCause::Probing(ProbeFailure::TooFast { .. })))) = end {
            prop_assert!(case.feed > 1000.0 && found.is_empty());
            return Ok(());
        }
        // Where the line meets the piece.
        let whole = probe.crossing(case.from, case.inside);
        let length = [0, 1, 2].map(|axis: usize| (case.inside[axis] - case.from[axis]).powi(2)).iter().sum::<f64>().sqrt();
        let margin = (whole - case.part) * length;
        if margin.abs() < 0.2 {
            // The axes are off the line by what they lag.
            return Ok(());
        }
        if margin > 0.0 {
            prop_assert_eq!(found.len(), 0);
            match end {
                Some(End::Fault(Fault::Block(_, BlockCause::Probing(ProbeFailure::NoContact)))) => prop_assert!(case.required),
                end => prop_assert!(!case.required && end == Some(End::Finished), "{end:?}"),
            }
            return Ok(());
        }
        prop_assert_eq!(end, Some(End::Finished), "{:?}", rig.events);
        let contact = found[0];
        // Of each axis, so of a place as far as three of them are off.
        let off = probe.clearance(tip(&contact.at)).abs();
        prop_assert!(off <= 3.0_f64.sqrt() * contact.uncertainty, "{off} {contact:?}");
        // No further than the bound, nor beyond what was programmed.
        let deepest = rig.rows.iter().map(|row| tip(&row.plan.position));
        let mut gone = deepest.map(|at| {
            let from_start = [0, 1, 2].map(|axis: usize| (at[axis] - case.from[axis]).powi(2));
            from_start.iter().sum::<f64>().sqrt()
        });
        let last = gone.next_back().unwrap_or_default();
        prop_assert!(last <= whole * length + 2.0, "{last} {}", whole * length);
        prop_assert!(last <= case.part * length + 1e-6);
        if !case.latch {
            prop_assert_eq!(contact.by, KnownBy::Sampled);
        } else if case.drives == [true; 3] {
            prop_assert_eq!(contact.by, KnownBy::Captured);
        }
        // Once more, and it is the same.
        if case.seed % 8 == 0 {
            let mut again = case.rig();
            again.finish();
            let frames = |rig: &mut Rig| rig.session.timeline().frames().result().0;
            prop_assert_eq!(frames(&mut rig), frames(&mut again));
        }
    }
}

/// The edge of the box is touched, set as X0, and gone to behind a stop at which something else is done.
const TOUCHED_OFF: &str = "\
G21 G90 G94 F3000
G0 X-10 Y15 Z-15
G0 Z-30
G38.2 X10 F300
#1 = #5061
G0 X-10
G10 L20 P1 X[-10 - #1]
M0
G1 X-7
G1 Y20
M2
";

/// What a program has found it knows where it goes on, behind lines that are typed in, a stop and a fault alike.
#[test]
fn a_program_that_has_probed_is_resumed_with_what_it_found() {
    #[derive(Clone, Copy, Debug)]
    enum By {
        Nothing,
        Lines,
        Stop,
        Fault,
    }
    let mut ends = Vec::new();
    for by in [By::Nothing, By::Lines, By::Stop, By::Fault] {
        let mut rig = staying_on();
        rig.goes_on = false;
        let go = |rig: &mut Rig, command| {
            rig.command(command);
            settle(rig);
        };
        let file = rig.folder.file("part.ngc", TOUCHED_OFF);
        go(&mut rig, Command::Load(file));
        go(&mut rig, Command::Run { from_line: None });
        assert_eq!(state(&rig), State::Held, "{:?}", rig.events);
        match by {
            By::Nothing => {}
            By::Lines => go(&mut rig, Command::Mdi("(MSG, looked at)".into())),
            By::Stop => go(&mut rig, Command::Stop),
            By::Fault => {
                let fault = Disturbance::Fault(syncline_drives::twin::ErrorClass::StopAndSwitchOff);
                rig.twin(0).disturb(fault);
                settle(&mut rig);
                go(&mut rig, Command::Reset);
            }
        }
        let probed = |rig: &Rig| {
            rig.events
                .iter()
                .filter(|it| matches!(it, Event::Probed { .. }))
                .count()
        };
        assert_eq!(probed(&rig), 1);
        if !matches!(by, By::Nothing) {
            go(&mut rig, Command::Resume);
            assert_eq!(state(&rig), State::Held, "{by:?}: {:?}", rig.problems);
        }
        for _ in 0..4 {
            if state(&rig) == State::Held {
                go(&mut rig, Command::CycleStart);
            }
        }
        assert_eq!(state(&rig), State::Ready, "{by:?}");
        assert_eq!(probed(&rig), 1, "nothing is probed once more");
        ends.push(rig.session.status().setpoint);
    }
    assert!(ends.iter().all(|end| *end == ends[0]), "{ends:?}");
    // The ball touches 2 mm before the edge at X0, from where X-7 is counted.
    assert!(
        (ends[0][0] + 9.0).abs() < 0.05 && (ends[0][1] - 20.0).abs() < 1e-9,
        "{ends:?}"
    );
}
