//! Axes that a program homes by G28.2: in a program and in typed lines, from nowhere known and from where they are.

use super::homing::{ALL, Y, errors, failure, go, home, is_referenced, settle, state, switched_on};
use proptest::prelude::*;
use syncline_controller::control::fault::AxisCause;
use syncline_controller::control::{
    Event, Fault, HomingFailure, Refusal as OrderRefusal, Row, State,
};
use syncline_controller::machine::COORDINATES;
use syncline_controller::session::{Command, Refusal, SwitchChange};
use syncline_drives::twin::{Disturbance, ErrorClass};
use syncline_gcode::AxisLetter;
use syncline_tests::command::{Folder, ended, machine_file, syncline};
use syncline_tests::rig::Rig;

const NOT_AT_START: (&str, &str) = ("at_start = true", "at_start = false");

/// Loads and runs a program on a machine that stays on.
fn run(rig: &mut Rig, text: &str) {
    let file = rig.folder.file("part.ngc", text);
    go(rig, Command::Load(file));
    go(rig, Command::Run { from_line: None });
}

fn positions(rig: &Rig) -> [f64; 3] {
    let status = rig.session.status();
    [0, 1, 2].map(|axis| status.setpoint[axis])
}

#[test]
fn a_program_homes_before_it_moves() {
    let mut rig = switched_on(&[]);
    run(&mut rig, "G28.2\nG90 G0 X20 Y30 Z-5\nG1 X40 F6000\nM2\n");
    assert_eq!(rig.refused, []);
    assert_eq!(rig.problems, [""; 0]);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    assert_eq!(positions(&rig), [40.0, 30.0, -5.0]);
    for axis in [AxisLetter::X, AxisLetter::Y, AxisLetter::Z] {
        assert!(is_referenced(&rig, axis));
        for error in errors(&mut rig, axis) {
            assert!(error.abs() < 0.004, "{axis}: {error}");
        }
    }
    let told = rig
        .events
        .iter()
        .filter(|it| matches!(it, Event::ProgramHomed { line: 1 }));
    assert_eq!(told.count(), 1);
}

/// A homing leads off the program's path to where the switches are, wherever in the program it is; that is no deviation from it.
#[test]
fn a_homing_in_the_middle_of_a_program_is_no_violation() {
    for text in [
        "G21 G90 G61 F3000\nG1 X50\nG28.2 Y0\nG1 X60\nM2\n",
        "G21 G90 G61 F3000\nG28.2\nG1 X30 Y10\nG28.2 Z0\nG1 Y20\nM2\n",
        "G21 G90 G64 P0.1 F3000\nG1 X30\nG1 X40 Y5\nG28.2 X0 Y0\nG1 X10\nG28.2 Y0\nM2\n",
    ] {
        let folder = Folder::new();
        let program = folder.file("part.ngc", text);
        let output = syncline()
            .arg("validate")
            .arg(machine_file("router"))
            .args([program])
            .output()
            .unwrap();
        let (code, printed, told) = ended(&output);
        assert_eq!(code, 0, "{text}{printed}{told}");
    }
}

/// What a hand has switched on, as what holds a part, stays on while the machine is homed.
#[test]
fn a_homing_leaves_outputs_as_a_hand_has_switched_them() {
    let mut rig = switched_on(&[CLAMP]);
    go(&mut rig, home(AxisLetter::Z));
    let clamp = |on| Command::Output {
        name: "clamp".to_owned(),
        on,
    };
    go(&mut rig, clamp(true));
    let since = rig.events.len();
    go(&mut rig, ALL);
    assert!(is_referenced(&rig, AxisLetter::X), "{:?}", rig.events);
    let changes = |rig: &Rig| {
        let told = rig.events[since..].iter();
        told.filter(|it| matches!(it, Event::Output { .. })).count()
    };
    assert_eq!(changes(&rig), 0, "{:?}", rig.events);
    assert!(rig.session.status().outputs[0]);
    // A stop in the midst of it makes safe.
    rig.command(ALL);
    rig.run_until(|rig| state(rig) == State::Homing);
    go(&mut rig, Command::Stop);
    assert!(!rig.session.status().outputs[0], "{:?}", rig.events);
    assert_eq!(changes(&rig), 1);
}

/// An output that programs read by its name.
const CLAMP: (&str, &str) = (
    "[machine]\n",
    "[[output]]\nname = \"clamp\"\ndrive = \"Y\"\nsignal = \"DQ0\"\nnumber = 1\n\n[machine]\n",
);

#[test]
fn a_program_reads_outputs_behind_a_homing() {
    let mut rig = switched_on(&[CLAMP]);
    run(
        &mut rig,
        "G28.2\nM64 P1\nG90 G0 X[20 + #<_hal[clamp]>]\nG28.2 Y0\nG0 X[30 + #<_hal[clamp]>] Y10\nM2\n",
    );
    assert_eq!(rig.refused, []);
    assert_eq!(rig.problems, [""; 0]);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    assert_eq!(positions(&rig)[..2], [31.0, 10.0]);
}

#[test]
fn what_is_behind_a_reading_counts_as_moved() {
    // The file is not read further than to the reading: Y may move behind it.
    let mut rig = switched_on(&[CLAMP]);
    run(&mut rig, "G28.2 X0\n#1 = #<_hal[clamp]>\nG0 Y1\nM2\n");
    assert!(
        matches!(
            rig.refused[..],
            [ref it] if matches!(it.reason, Refusal::Machine(OrderRefusal::Unreferenced(_)))
        ),
        "{:?}",
        rig.refused
    );
    assert!(!is_referenced(&rig, AxisLetter::X));
}

#[test]
fn what_a_program_does_not_home_first_has_to_be_referenced() {
    let mut rig = switched_on(&[]);
    // Y is moved without, X before.
    for text in ["G28.2 X0 Z0\nG0 Y1\nM2\n", "G0 X1\nG28.2\nM2\n"] {
        let refused = rig.refused.len();
        run(&mut rig, text);
        assert_eq!(rig.refused.len(), refused + 1, "{text}");
        let reason = &rig.refused[refused].reason;
        let is_unreferenced = matches!(reason, Refusal::Machine(OrderRefusal::Unreferenced(_)));
        assert!(is_unreferenced, "{reason}");
        assert_eq!(state(&rig), State::Ready);
    }
    // Typed, one after the other: such lines move nothing else, and set nothing.
    for (line, axis) in [("G28.2 Z0", AxisLetter::Z), ("G28.2 X0", AxisLetter::X)] {
        go(&mut rig, Command::Mdi(line.to_owned()));
        assert!(is_referenced(&rig, axis), "{:?}", rig.events);
    }
    let refused = rig.refused.len();
    go(&mut rig, Command::Mdi("G28.2 X0\nG10 L20 P1 Y0".to_owned()));
    go(&mut rig, Command::Mdi("G0 X10 Y1".to_owned()));
    assert_eq!(rig.refused.len(), refused + 2);
    go(&mut rig, Command::Mdi("G28.2 Y0\nG0 Y10".to_owned()));
    assert_eq!(rig.refused.len(), refused + 2);
    assert_eq!(positions(&rig), [0.0, 10.0, 0.0]);
}

#[test]
fn a_run_homes_by_its_program() {
    let program = "G28.2\nG0 X20 Y30 Z-5\nG1 X40 F3000\nM2\n";
    let rig = Rig::new("router", &[NOT_AT_START], program, |_, _| ());
    let summary = rig.judge();
    assert_eq!(summary.verdict, "pass", "{:?}", summary.violations);
    let twice = || {
        let mut rig = Rig::new("router", &[], program, |_, _| ());
        rig.finish();
        rig.session.timeline().frames().result().0
    };
    assert_eq!(twice(), twice());
    let mut rig = Rig::new(
        "router",
        &[NOT_AT_START],
        "G28.2 X0 Y0\nG0 X1\nM2\n",
        |_, _| (),
    );
    assert_eq!(
        rig.finish_with_fault(),
        Fault::Axis(2, AxisCause::Unreferenced)
    );
}

#[test]
fn a_program_homes_in_its_middle_and_goes_on_from_there() {
    let mut rig = switched_on(&[]);
    go(&mut rig, ALL);
    // Work offsets stay, incremental moves count from where the axis is.
    run(
        &mut rig,
        "G10 L2 P1 X5 Y0 Z0\nG90 G1 X100 Y30 F12000\nM64 P0\nG28.2 X0\nG91 G1 X10 F6000\nG90 G0 Y50\nM2\n",
    );
    assert_eq!(rig.refused, []);
    assert_eq!(rig.problems, [""; 0], "{:?}", rig.events);
    assert_eq!(positions(&rig), [10.0, 50.0, 0.0]);
    for axis in [AxisLetter::X, AxisLetter::Y] {
        assert!(
            errors(&mut rig, axis)
                .iter()
                .all(|error| error.abs() < 0.004)
        );
    }
}

#[test]
fn a_homing_of_a_program_that_fails_ends_it() {
    let mut rig = switched_on(&[]);
    let from = positions(&rig)[1];
    rig.command(Command::Mdi("G28.2\nG0 X20 Y30".to_owned()));
    rig.run_until(|rig| (positions(rig)[1] - from).abs() > 60.0);
    // It stays on once it has come on.
    rig.twin(Y).disturb(Disturbance::Input(0, true));
    settle(&mut rig);
    assert_eq!(failure(&rig), Some(HomingFailure::StaysOn));
    assert_eq!(state(&rig), State::Ready);
    assert!(!is_referenced(&rig, AxisLetter::Y));
    // Homed by hand afterwards, the machine belongs to nobody's program.
    rig.twin(Y).disturb(Disturbance::Input(0, false));
    for _ in 0..4 {
        rig.step();
    }
    go(&mut rig, ALL);
    assert!(is_referenced(&rig, AxisLetter::Y));
    go(&mut rig, Command::Mdi("G0 X20 Y30".to_owned()));
    assert_eq!(positions(&rig)[..2], [20.0, 30.0]);
}

#[test]
fn single_block_rests_behind_it() {
    let mut rig = switched_on(&[]);
    go(&mut rig, ALL);
    rig.command(Command::SingleBlock(SwitchChange::To(true)));
    run(&mut rig, "G28.2 Y0\nG0 Y30\nM2\n");
    assert_eq!(state(&rig), State::Held);
    assert_eq!(positions(&rig)[1], 0.0);
    rig.command(Command::SingleBlock(SwitchChange::To(false)));
    go(&mut rig, Command::Resume);
    assert_eq!(positions(&rig)[1], 30.0);
}

/// Resumes the program that was interrupted, and goes on where it waits.
fn resume(rig: &mut Rig) {
    go(rig, Command::Resume);
    while state(rig) == State::Held {
        go(rig, Command::CycleStart);
    }
}

/// After a stop and after a fault within it: the axes have no places to go to, and are homed from where they are.
#[test]
fn a_program_is_resumed_with_the_homing_that_was_stopped() {
    let program = "G90 G28.2\nM64 P0\nG0 X20 Y30 Z-5\nG1 X40 F6000\nM2\n";
    for fault in [false, true] {
        let mut rig = switched_on(&[]);
        rig.goes_on = false;
        let from = positions(&rig)[1];
        let file = rig.folder.file("part.ngc", program);
        rig.command(Command::Load(file));
        rig.command(Command::Run { from_line: None });
        rig.run_until(|rig| (positions(rig)[1] - from).abs() > 30.0);
        if fault {
            rig.twin(Y)
                .disturb(Disturbance::Fault(ErrorClass::StopAndSwitchOff));
            settle(&mut rig);
            assert_eq!(state(&rig), State::Faulted, "{:?}", rig.events);
            let stopped = rig.session.status().stopped.clone();
            assert_eq!(stopped.and_then(|it| it.line), Some(1));
            go(&mut rig, Command::Reset);
        } else {
            go(&mut rig, Command::Stop);
        }
        assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
        assert!(!is_referenced(&rig, AxisLetter::Y));
        assert_eq!(rig.session.status().interrupted, Some(1));
        // Nothing else may move it before.
        go(&mut rig, Command::Mdi("G0 Y1".to_owned()));
        assert_eq!(rig.refused.len(), 1);
        let rows = rig.rows.len();
        go(&mut rig, Command::Resume);
        assert_eq!(state(&rig), State::Held, "{:?}", rig.refused);
        assert!(rig.rows[rows..].iter().all(|row| row.plan.speed == 0.0));
        resume(&mut rig);
        let moves = |row: &&Row<COORDINATES>| row.plan.velocity.iter().any(|it| *it != 0.0);
        let first = rig.rows[rows..].iter().find(moves);
        assert!(first.is_some_and(|row| row.plan.off_path), "a way before");
        assert_eq!(rig.refused.len(), 1, "{:?}", rig.refused);
        assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
        assert_eq!(positions(&rig), [40.0, 30.0, -5.0]);
        for axis in [AxisLetter::X, AxisLetter::Y, AxisLetter::Z] {
            let errors = errors(&mut rig, axis);
            assert!(
                errors.iter().all(|it| it.abs() < 0.004),
                "{axis} {errors:?}"
            );
        }
        assert_eq!(rig.session.status().interrupted, None);
    }
}

/// A homing that is behind the program is not done again, neither in the pause behind it nor in a move.
#[test]
fn what_was_homed_before_a_stop_is_not_homed_again() {
    let program = "G90 G28.2\nM0\nG1 Y30 F6000\nM2\n";
    for moves in [false, true] {
        let mut rig = switched_on(&[]);
        rig.goes_on = false;
        run(&mut rig, program);
        assert_eq!(state(&rig), State::Held);
        if moves {
            rig.command(Command::CycleStart);
            rig.run_until(|rig| positions(rig)[1] > 10.0);
        }
        go(&mut rig, Command::Stop);
        assert_eq!(state(&rig), State::Ready);
        let line = if moves { 3 } else { 2 };
        assert_eq!(rig.session.status().interrupted, Some(line));
        resume(&mut rig);
        assert_eq!(positions(&rig)[1], 30.0, "{:?}", rig.refused);
        let homed = |event: &&Event| matches!(event, Event::ProgramHomed { .. });
        assert_eq!(rig.events.iter().filter(homed).count(), 1);
        assert_eq!(rig.refused, []);
    }
    // Held directly behind it, typed lines find the program there.
    let mut rig = switched_on(&[]);
    rig.goes_on = false;
    rig.command(Command::SingleBlock(SwitchChange::To(true)));
    run(&mut rig, "G90 G28.2\nG1 Y30 F6000\nM2\n");
    assert_eq!(state(&rig), State::Held);
    rig.command(Command::SingleBlock(SwitchChange::To(false)));
    go(&mut rig, Command::Mdi("G10 L20 P1 Y-10".to_owned()));
    resume(&mut rig);
    assert_eq!(rig.refused, []);
    assert_eq!(positions(&rig)[1], 40.0, "{:?}", rig.events);
    let homed = |event: &&Event| matches!(event, Event::ProgramHomed { .. });
    assert_eq!(rig.events.iter().filter(homed).count(), 1);
}

/// Begun in its middle, a program goes to its line first: that takes references, whatever it homes from there on.
#[test]
fn the_way_to_a_line_takes_references() {
    let mut rig = switched_on(&[]);
    rig.goes_on = false;
    let file = rig.folder.file("part.ngc", "G90 G0 X20\nG28.2\nM2\n");
    go(&mut rig, Command::Load(file));
    go(&mut rig, Command::Run { from_line: Some(2) });
    assert_eq!(rig.refused.len(), 1, "{:?}", rig.events);
    let reason = &rig.refused[0].reason;
    assert!(
        matches!(reason, Refusal::Machine(OrderRefusal::Unreferenced(_))),
        "{reason}"
    );
}

/// A block of a program that homes, moves and switches.
#[derive(Clone, Copy, Debug)]
enum Block {
    Home([bool; 3]),
    Move([f64; 3]),
    Dwell,
}

fn block() -> impl Strategy<Value = Block> {
    let places = (1.0..300.0, 1.0..300.0, -60.0..-1.0_f64);
    prop_oneof![
        any::<[bool; 3]>().prop_map(Block::Home),
        places.prop_map(|(x, y, z)| Block::Move([x, y, z])),
        Just(Block::Dwell),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4, ..ProptestConfig::default() })]

    /// Wherever homings stand in a program that begins with one: it ends where its last moves and homings lead, with every
    /// axis where it is shown, and whatever stops it on its way leaves a machine that is homed as ever.
    #[test]
    fn programs_with_homings_end_where_they_lead(
        blocks in prop::collection::vec(block(), 1..5), stop in prop::option::of(0..9000usize),
    ) {
        let mut text = "G28.2\nG90\n".to_owned();
        let mut at = [0.0; 3];
        for block in &blocks {
            match block {
                Block::Home(axes) => {
                    text += "G28.2";
                    for (axis, name) in axes.iter().zip(["X0", "Y0", "Z0"]) {
                        if *axis {
                            text += &format!(" {name}");
                        }
                    }
                    text += "\n";
                    let all = *axes == [false; 3];
                    for (at, axis) in at.iter_mut().zip(axes) {
                        if *axis || all {
                            *at = 0.0;
                        }
                    }
                }
                Block::Move([x, y, z]) => {
                    at = [x, y, z].map(|it| (it * 1e3).round() / 1e3);
                    text += &format!("G1 X{:.3} Y{:.3} Z{:.3} F20000\n", at[0], at[1], at[2]);
                }
                Block::Dwell => text += "G4 P0.05\n",
            }
        }
        text += "M2\n";
        let mut rig = switched_on(&[]);
        if let Some(wake_ups) = stop {
            let file = rig.folder.file("part.ngc", &text);
            go(&mut rig, Command::Load(file));
            rig.command(Command::Run { from_line: None });
            for _ in 0..wake_ups {
                rig.step();
            }
            go(&mut rig, Command::Stop);
            prop_assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
            go(&mut rig, home(AxisLetter::Z));
            go(&mut rig, ALL);
            at = [0.0; 3];
        } else {
            run(&mut rig, &text);
        }
        prop_assert_eq!(rig.refused.len(), 0);
        prop_assert_eq!(rig.problems.len(), 0, "{:?}", rig.problems);
        prop_assert_eq!(rig.session.faults(), []);
        prop_assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
        for (axis, at) in [AxisLetter::X, AxisLetter::Y, AxisLetter::Z].into_iter().zip(at) {
            let shown = rig.session.status().setpoint[axis.index()];
            prop_assert!((shown - at).abs() < 1e-6, "{}: {} {}", axis, shown, at);
            let errors = errors(&mut rig, axis);
            prop_assert!(errors.iter().all(|error| error.abs() < 0.01), "{:?}", errors);
        }
    }
}
