//! The test move of axes whose drives are sent velocities: before anything trusts one, it shows slowly that it goes as fast as
//! it is sent.

use super::described::velocity_models;
use super::homing::{ALL, go, home, is_referenced, settle, state};
use super::stepper;
use super::velocity;
use proptest::prelude::*;
use syncline_canopen::{CanId, CobId, Frame};
use syncline_controller::control::fault::AxisCause;
use syncline_controller::control::{End, Event, Fault, Refusal as OrderRefusal, State};
use syncline_controller::machine::TestMove;
use syncline_controller::session::{Command, Direction, Jog, Refusal};
use syncline_gcode::AxisLetter;
use syncline_tests::rig::Rig;

const X: usize = 0;
const Y: usize = 1;

/// How far both axes of the example go, mm.
const MOVE: f64 = 2.0;

/// Of a turn of both screws, mm.
const PITCH: f64 = 10.0;

const HOMED: [(&str, &str); 3] = [
    ("[[bus]]", "[homing]\nat_start = true\n\n[[bus]]"),
    (
        "position_loop = \"encoder\"",
        "position_loop = \"encoder\"\nhoming = { kind = \"encoder\", test_move = 2.0 }",
    ),
    (
        "soft_limits = [0.0, 200.0]",
        "soft_limits = [0.0, 200.0]\nhoming = { kind = \"encoder\", test_move = 2.0 }",
    ),
];

const PROGRAM: &str = "G21 G90 G94 G61\nG1 X20 Y10 F6000\nG1 X0 Y0\nM2\n";

/// The example whose drives are sent velocities, with test moves.
fn changes(more: &[(&'static str, &str)]) -> Vec<(&'static str, String)> {
    let mut changes = velocity_models();
    changes.extend(
        HOMED
            .iter()
            .chain(more)
            .map(|(from, to)| (*from, (*to).to_owned())),
    );
    changes
}

fn machine(more: &[(&'static str, &str)], program: &str) -> Rig {
    let changes = changes(more);
    let changes: Vec<_> = changes.iter().map(|(from, to)| (*from, &**to)).collect();
    Rig::new("velocity", &changes, program, |_, _| ())
}

fn staying_on(more: &[(&'static str, &str)]) -> Rig {
    let changes = changes(more);
    let changes: Vec<_> = changes.iter().map(|(from, to)| (*from, &**to)).collect();
    Rig::staying_on("velocity", &changes, |_, _| ())
}

/// From now on a drive goes so many times as fast as it is sent, by an R_PDO of that number.
fn count(rig: &mut Rig, drive: usize, number: u8, factor: f64) {
    let node = rig.machine.drives[drive].node;
    let id = CanId::from(CobId::r_pdo(number, node));
    // What is rounded off is made up for in the next cycle.
    let mut left = 0.0;
    rig.bus().forger = Some(Box::new(move |frames| {
        for frame in frames.iter_mut().filter(|it| it.id() == id) {
            let data = frame.data();
            let Some((word, velocity)) = data.split_at_checked(2) else {
                continue;
            };
            let Ok(velocity) = velocity.try_into() else {
                continue;
            };
            let velocity = f64::from(i32::from_le_bytes(velocity)) * factor + left;
            left = velocity - velocity.round();
            let bytes = [word, &(velocity.round() as i32).to_le_bytes()].concat();
            *frame = Frame::new(id, &bytes);
        }
    }));
}

/// How far a drive has been from where it was, mm, until the machine is at its end.
fn farthest(rig: &mut Rig, drive: usize, pitch: f64) -> f64 {
    let at = |rig: &mut Rig| rig.twin(drive).observe().position * pitch;
    let began = at(rig);
    let mut most = 0.0_f64;
    while rig.step() {
        most = most.max((at(rig) - began).abs());
    }
    most
}

/// Where a side of the gantry is, mm: both turn the other way round.
fn place(rig: &mut Rig, drive: usize) -> f64 {
    let turns = rig.twin(drive).observe().position;
    if drive == Y {
        -PITCH * turns
    } else {
        PITCH * turns
    }
}

fn told(rig: &Rig) -> Vec<(usize, f64)> {
    let factors = rig.events.iter().filter_map(|event| match event {
        Event::Tested { axis, factor } => Some((*axis, *factor)),
        _ => None,
    });
    factors.collect()
}

// --- the unit is right ---

#[test]
fn an_axis_that_goes_as_fast_as_it_is_sent_is_trusted() {
    let mut rig = machine(&[], PROGRAM);
    let is_over = |event: &Event| matches!(event, Event::Referenced { axis: Y, .. });
    rig.run_until(|rig| rig.events.iter().any(is_over));
    // It went out and came back, slowly.
    let speeds = rig.rows.iter().map(|row| row.plan.velocity[X].abs());
    assert!(speeds.fold(0.0, f64::max) <= MOVE / 2.0 + 1e-9);
    let went = rig.rows.iter().map(|row| row.axes[X].act);
    assert!((went.fold(0.0, f64::max) - MOVE).abs() < 0.05);
    assert!(rig.rows.last().unwrap().axes[X].act.abs() < 0.01);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    let told = told(&rig);
    assert_eq!(told.iter().map(|it| it.0).collect::<Vec<_>>(), [X, Y]);
    assert!(told.iter().all(|it| (it.1 - 1.0).abs() < 0.01), "{told:?}");
    rig.trace().assert_within_limits();
}

/// A TLC53x in a portal, and a stepper whose loop an encoder closes.
#[test]
fn drives_of_other_makers_are_trusted_as_well() {
    let at_start = ("[[bus]]", "[homing]\nat_start = true\n\n[[bus]]");
    let y = (
        "following_error_limit = 2.0\nstandstill_window = 0.05\n\n[[axis]]\nname = \"Z\"",
        "following_error_limit = 2.0\nstandstill_window = 0.05\nhoming = { kind = \"encoder\", test_move = 4.0 }\n\n\
         [[axis]]\nname = \"Z\"",
    );
    let z = (
        "position_loop = \"encoder\"",
        "position_loop = \"encoder\"\nhoming = { kind = \"encoder\", test_move = -2.0 }",
    );
    let tlc = [&velocity::CHANGES[..], &[at_start, y]].concat();
    let slow = ("cycle_us = 2000", "cycle_us = 4000");
    let tsp = [&stepper::CHANGES[..], &[at_start, z, slow]].concat();
    let program = "G21 G90\nG1 X20 Y10 Z-20 F3000\nM2\n";
    for changes in [tlc, tsp] {
        let mut rig = Rig::new("portal", &changes, program, |_, _| ());
        assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        let told = told(&rig);
        assert!(
            told.len() == 1 && (told[0].1 - 1.0).abs() < 0.02,
            "{told:?}"
        );
        rig.trace().assert_within_limits();
    }
}

/// Where its soft limits do not allow it, it goes to the other side.
#[test]
fn a_test_move_stays_inside_the_soft_limits() {
    let backward = ("test_move = 2.0", "test_move = -2.0");
    let mut rig = machine(&[backward], PROGRAM);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    assert!(rig.rows.iter().all(|row| row.plan.position[X] >= -0.01));
}

// --- before it ---

fn refusals(rig: &Rig) -> Vec<OrderRefusal> {
    let reasons = rig.refused.iter().map(|it| &it.reason);
    let orders = reasons.map(|it| match it {
        Refusal::Machine(order) => *order,
        other => panic!("{other}"),
    });
    orders.collect()
}

#[test]
fn nothing_moves_an_axis_before_its_test_move() {
    let jobs = ("[homing]", "[homing]\nunreferenced_jobs = true");
    let mut rig = staying_on(&[jobs]);
    settle(&mut rig);
    let step = Command::Jog(Jog::Step {
        axis: AxisLetter::X,
        direction: Direction::Positive,
    });
    go(&mut rig, step.clone());
    go(&mut rig, Command::Mdi("G1 X1 F60".into()));
    assert_eq!(refusals(&rig), [OrderRefusal::Untested(X); 2]);
    go(&mut rig, home(AxisLetter::X));
    assert!(is_referenced(&rig, AxisLetter::X) && !is_referenced(&rig, AxisLetter::Y));
    go(&mut rig, step);
    go(&mut rig, Command::Mdi("G1 X1 F60".into()));
    assert_eq!(rig.refused.len(), 2, "it leaves Y where it is");
    go(&mut rig, Command::Mdi("G1 Y1 F60".into()));
    assert_eq!(refusals(&rig)[2..], [OrderRefusal::Untested(Y)]);
    go(&mut rig, ALL);
    go(&mut rig, Command::Mdi("G1 X1 Y1 F60".into()));
    assert_eq!(rig.refused.len(), 3);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    assert!((rig.session.status().setpoint[Y] - 1.0).abs() < 1e-9);
}

#[test]
fn a_program_does_not_begin_before_it() {
    let not_at_start = ("at_start = true", "unreferenced_jobs = true");
    let mut rig = machine(&[not_at_start], PROGRAM);
    assert_eq!(
        rig.finish_with_fault(),
        Fault::Axis(X, AxisCause::Unreferenced)
    );
}

/// One that was stopped within its move is not trusted, and neither is one that had been before.
#[test]
fn a_test_move_that_is_cut_off_is_none() {
    let mut rig = staying_on(&[]);
    settle(&mut rig);
    for again in [false, true] {
        if again {
            go(&mut rig, ALL);
            assert!(is_referenced(&rig, AxisLetter::X), "{:?}", rig.events);
        }
        rig.command(home(AxisLetter::X));
        for _ in 0..1000 {
            rig.step();
        }
        assert_eq!(state(&rig), State::Homing);
        go(&mut rig, Command::Stop);
        assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
        assert!(!is_referenced(&rig, AxisLetter::X));
    }
    go(&mut rig, ALL);
    assert!(is_referenced(&rig, AxisLetter::X), "{:?}", rig.events);
}

// --- the unit is wrong ---

/// The factor that a fault tells.
fn factor(fault: Fault) -> (usize, f64) {
    match fault {
        Fault::Axis(axis, AxisCause::TestMove { factor }) => (axis, factor),
        other => panic!("another fault: {other:?}"),
    }
}

/// How far an axis goes at the most whose drive goes `factor` times as fast as it is sent, mm, as docs/homing.md has it.
fn bound(factor: f64) -> f64 {
    let factor = factor.abs();
    let (off, speed, ramp) = (0.25 * MOVE, MOVE / 2.0, MOVE / 2.0 / 0.5);
    let far = match factor > 1.0 {
        true => off * factor / (factor - 1.0),
        false => MOVE,
    };
    let seen_at = factor * (2.0 * far / factor * ramp).sqrt().min(speed);
    far.min(MOVE + off) + seen_at * 0.02 + seen_at * seen_at / 2.0 / QUICK_STOP
}

/// What the twins brake by, mm/s².
const QUICK_STOP: f64 = 500.0;

/// A drive that goes so many times as fast as it is sent is told with that, and is not trusted.
fn is_told(drive: usize, by: f64) {
    let mut rig = machine(&[], PROGRAM);
    count(&mut rig, drive, 2, by);
    let far = farthest(&mut rig, drive, PITCH);
    let Some(End::Fault(fault)) = rig.end() else {
        panic!("{by}: no fault");
    };
    let (axis, factor) = factor(fault);
    println!("{by}: {factor}, {far} mm of {}", bound(by));
    assert_eq!(axis, drive);
    // Where it is stopped early, it is told by a few cycles of its way.
    assert!(
        (factor - by).abs() <= 0.25 * by.abs() + 0.02,
        "{by}: {factor}"
    );
    assert!(far <= bound(by), "{by}: {far} mm of {}", bound(by));
    let text = fault.describe(&*rig.layout);
    assert!(
        text.contains("times as far as its drive was sent"),
        "{text}"
    );
}

#[test]
fn another_unit_of_the_velocity_is_told_by_its_factor() {
    for drive in [X, Y] {
        for by in [10.0, 60.0, 1.0 / 60.0, -1.0, 1.1, 0.9, 0.0] {
            is_told(drive, by);
        }
    }
}

/// What a description says and the drive does not.
#[test]
fn a_drive_that_counts_otherwise_than_is_described_is_told() {
    for (drive, units, by) in [(X, 20, 0.5), (X, 600, 1.0 / 60.0), (Y, 60, 1.0 / 60.0)] {
        let changes = changes(&[]);
        let changes: Vec<_> = changes.iter().map(|(from, to)| (*from, &**to)).collect();
        let mut rig = Rig::new("velocity", &changes, PROGRAM, |device, config| {
            if device == drive {
                config.assumed.retain(|(name, _)| *name != "velocity_units");
                config.assumed.push(("velocity_units", units));
            }
        });
        let (axis, factor) = factor(rig.finish_with_fault());
        assert!(
            axis == drive && (factor - by).abs() < 0.02 + 0.1 * by,
            "{drive}: {factor}"
        );
    }
}

/// Z on a stepper controller, whose manual has no unit for 60FFh.
#[test]
fn a_stepper_controller_counts_as_the_machine_file_says_or_is_told() {
    let counts = |units: &str| format!("[model.tsp10]\n{units}\n\n[[bus]]");
    let homed = "position_loop = \"encoder\"\nhoming = { kind = \"encoder\", test_move = -2.0 }";
    let run = |stated: &str, units: Option<u32>| {
        let counts = counts(stated);
        let changes = [
            &[("cycle_us = 2000", "cycle_us = 4000")],
            &stepper::CHANGES[..],
            &[
                ("position_loop = \"encoder\"", homed),
                ("[[bus]]", &counts),
                HOMED[0],
            ],
        ];
        let program = "G21 G90 G94 G61\nG1 Z-20 F1200\nM2\n";
        let mut rig = Rig::new("portal", &changes.concat(), program, |_, config| {
            if let Some(units) = units {
                config.assumed.retain(|(name, _)| *name != "velocity_units");
                config.assumed.push(("velocity_units", units));
            }
        });
        rig.finish();
        rig
    };
    // Steps/s, and tenths of 1/min.
    for stated in ["", "velocity_units = 10"] {
        let mut rig = run(stated, None);
        let end = rig.end();
        assert_eq!(end, Some(End::Finished), "{stated}: {:?}", rig.events);
        let [(_, factor)] = told(&rig)[..] else {
            panic!("{stated}: one test move");
        };
        assert!((factor - 1.0).abs() < 0.03, "{stated}: {factor}");
    }
    for (units, by) in [(0, 1.0 / 1000.0 * 60.0), (1, 10.0)] {
        let mut rig = run("velocity_units = 10", Some(units));
        let Some(End::Fault(fault)) = rig.end() else {
            panic!("{units}: no fault");
        };
        let (_, factor) = factor(fault);
        assert!(
            (factor - by).abs() < 0.02 + 0.1 * by,
            "{units}: {factor}, {by}"
        );
    }
}

// --- a gantry ---

/// Y on two drives, behind that of X and its encoder's.
const GANTRY: [(&str, &str); 2] = [
    (
        "[[encoder]]",
        "[[drive]]\nname = \"Y2\"\nbus = \"table\"\nnode = 4\nmodel = \"inverter.toml\"\nzero = 150_000\n\n[[encoder]]",
    ),
    (
        "drives = [\"Y\"]",
        "drives = [\"Y\", \"Y2\"]\nskew_limit = 1.0",
    ),
];
const Y2: usize = 2;

/// The example with Y on two drives that are sent velocities.
fn gantry(program: &str) -> Rig {
    let mut models = velocity_models();
    models.push(models[1].clone());
    let changes: Vec<_> = models.iter().map(|(from, to)| (*from, &**to)).collect();
    // The model that both sides have is replaced once for each of them.
    let changes = [&GANTRY[..], &HOMED, &changes].concat();
    Rig::new("velocity", &changes, program, |_, _| ())
}

/// Both sides go out and back side by side, and each is measured.
#[test]
fn a_gantry_makes_its_test_move_on_both_sides() {
    let mut rig = gantry(PROGRAM);
    let began = [Y, Y2].map(|drive| place(&mut rig, drive));
    let mut apart = 0.0_f64;
    while rig.step() {
        let [one, other] =
            [(Y, began[0]), (Y2, began[1])].map(|(drive, from)| place(&mut rig, drive) - from);
        apart = apart.max((one - other).abs());
    }
    assert_eq!(rig.end(), Some(End::Finished), "{:?}", rig.events);
    let told = told(&rig);
    assert_eq!(told.iter().map(|it| it.0).collect::<Vec<_>>(), [X, Y]);
    assert!(told.iter().all(|it| (it.1 - 1.0).abs() < 0.01), "{told:?}");
    assert!(apart < 0.05, "{apart}");
}

/// One side that goes otherwise than it is sent is told, where its `skew_limit` is more than a quarter of the move.
#[test]
fn a_side_of_a_gantry_that_goes_otherwise_is_told() {
    for side in [Y, Y2] {
        for by in [10.0, 1.1, 0.9, -1.0, 0.0] {
            let mut rig = gantry(PROGRAM);
            count(&mut rig, side, 2, by);
            let (axis, factor) = factor(rig.finish_with_fault());
            println!("{side} {by}: {factor}");
            assert_eq!(axis, Y);
            assert!(
                (factor - by).abs() <= 0.25 * by.abs() + 0.02,
                "{side} {by}: {factor}"
            );
        }
    }
}

/// Behind the fault and its reset the axis is as untested as before, and stays where it is.
#[test]
fn an_axis_that_fails_its_test_move_is_refused() {
    // It goes to the other side.
    let room = ("soft_limits = [0.0, 300.0]", "soft_limits = [-20.0, 300.0]");
    let mut rig = staying_on(&[room]);
    settle(&mut rig);
    count(&mut rig, X, 2, -1.0);
    go(&mut rig, home(AxisLetter::X));
    assert_eq!(state(&rig), State::Faulted);
    go(&mut rig, Command::Reset);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    assert!(!is_referenced(&rig, AxisLetter::X));
    let stood = rig.twin(X).observe().position;
    for _ in 0..2000 {
        rig.step();
    }
    let stands = rig.twin(X).observe().position;
    assert!((stands - stood).abs() * PITCH < 0.01, "{stood}, {stands}");
    go(&mut rig, Command::Mdi("G1 X1 F60".into()));
    assert_eq!(refusals(&rig), [OrderRefusal::Untested(X)]);
    // Once it is mended it goes on.
    rig.bus().forger = None;
    go(&mut rig, ALL);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    assert!(is_referenced(&rig, AxisLetter::X));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    /// Whatever a drive makes of its velocities: what is off by more than the tolerance is told, and none gets further
    /// than is stated.
    #[test]
    fn every_factor_is_told(drive in 0..2usize, power in -6.0..6.5f64, backward: bool) {
        let by = power.exp2() * if backward { -1.0 } else { 1.0 };
        // What lies at its tolerance may be either.
        prop_assume!((by - 1.0).abs() > 1.2 * TestMove::TOLERANCE);
        is_told(drive, by);
    }

    #[test]
    fn what_is_within_the_tolerance_is_trusted(drive in 0..2usize, off in -0.015..0.015f64) {
        let mut rig = machine(&[], "G21 G90\nG1 X5 Y5 F600\nM2\n");
        count(&mut rig, drive, 2, 1.0 + off);
        prop_assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    }
}
