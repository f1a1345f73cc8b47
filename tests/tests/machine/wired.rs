//! A machine's inputs and outputs on its drives: what they do to a run, and when.

use super::homing::{self, state, switched_on};
use proptest::prelude::*;
use proptest::sample::select;
use syncline_canopen::CobId;
use syncline_controller::control::fault::AxisCause;
use syncline_controller::control::{
    End, Event, Fault, Hold, HomingFailure, Pause, Phase, Refusal as OrderRefusal, State, Switch,
};
use syncline_controller::session::{Command, Direction, Jog, Override, Refusal, SwitchChange};
use syncline_drives::twin::{Disturbance, ErrorClass};
use syncline_gcode::AxisLetter;
use syncline_tests::rig::Rig;

/// Outputs on the drive Y, node 3, and inputs on the drive Z, the fourth.
const WIRED: &str = r#"
[[output]]
name = "valve"
drive = "Y"
signal = "DQ0"
number = 1

[[output]]
name = "clamp"
drive = "Y"
signal = "DQ1"
active_low = true
safe = "on"
number = 2

[[output]]
name = "spindle"
drive = "Y"
signal = "DQ2"
function = "spindle"

[[input]]
name = "enable"
drive = "Z"
signal = "DI0"
function = "enable"

[[input]]
name = "part"
drive = "Z"
signal = "DI1"
debounce_ms = 20
number = 5

[[input]]
name = "door"
drive = "Z"
signal = "DI2"
function = "door"

[[input]]
name = "start"
drive = "Z"
signal = "DI3"
function = "cycle_start"

[[input]]
name = "hold"
drive = "Z"
signal = "DI4"
function = "feed_hold"

[machine]
"#;
const INPUTS: usize = 3;
const ENABLE: u8 = 0;
const PART: u8 = 1;
const DOOR: u8 = 2;
const START: u8 = 3;
const HOLD: u8 = 4;

/// The portal with these signals, its enable on.
fn wired(program: &str) -> Rig {
    let mut rig = Rig::new("portal", &[("[machine]\n", WIRED)], program, |_, _| ());
    rig.goes_on = false;
    set(&mut rig, ENABLE, true);
    rig
}

fn set(rig: &mut Rig, input: u8, on: bool) {
    rig.twin(INPUTS).disturb(Disturbance::Input(input, on));
}

/// What IO_DQ_set was in each R_PDO, from the program's first setpoint on, changes only: the number of
/// the R_PDO, and the outputs.
fn set_outputs(rig: &Rig) -> Vec<(usize, u8)> {
    let frames = rig.sent(CobId::r_pdo(2, rig.machine.drives[2].node));
    let mut outputs: Vec<(usize, u8)> = (frames.iter().enumerate())
        .map(|(place, sent)| (place, sent.frame.data()[6]))
        .collect();
    outputs.dedup_by_key(|(_, outputs)| *outputs);
    outputs
}

fn goes_on_after(rig: &mut Rig, cycles: usize) {
    let until = rig.rows.len() + cycles;
    rig.run_to_row(until);
}

fn is_paused(rig: &Rig, reason: Pause) -> bool {
    let paused = |event: &Event| matches!(event, Event::Paused { reason: it, .. } if *it == reason);
    rig.events.iter().any(paused)
}

fn speed(rig: &Rig) -> f64 {
    rig.rows.last().map_or(0.0, |row| row.plan.speed)
}

// --- outputs ---

/// The clamp is on where its drive's output is off, and on as long as no program runs.
const SAFE: u8 = 0b000;

#[test]
fn outputs_follow_the_program_and_are_safe_before_and_behind() {
    let program =
        "G21 G90 F6000\nM64 P1\nG4 P0.5\nM65 P1 \nM3 S1000\nM65 P2\nG1 X20\nM64 P2 M5\nG1 X0\nM2\n";
    let mut rig = wired(program);
    assert_eq!(rig.finish(), End::Finished);
    let outputs = set_outputs(&rig);
    let states: Vec<u8> = outputs.iter().map(|(_, outputs)| *outputs).collect();
    // A program begins with all off, the clamp too, until M64 P2.
    let program = [0b010, 0b011, 0b110, 0b000];
    assert_eq!(states, [&[SAFE], &program[..]].concat(), "{outputs:?}");
    let pulse = outputs[3].0 - outputs[2].0;
    let cycles = (0.5 / rig.machine.cycle.as_secs_f64()) as usize;
    assert!(pulse.abs_diff(cycles) <= 1, "{pulse} cycles");
}

#[test]
fn a_fault_makes_outputs_safe_within_two_cycles() {
    for class in [ErrorClass::QuickStop, ErrorClass::SwitchOff] {
        let mut rig = wired("G21 G90 F6000\nM64 P1 M3 S500\nG1 X400\nM2\n");
        rig.run_until(|rig| speed(rig) > 50.0);
        let before = rig.sent(CobId::r_pdo(2, rig.machine.drives[2].node)).len();
        assert_eq!(set_outputs(&rig).last().map(|it| it.1), Some(0b111));
        rig.twin(0).disturb(Disturbance::Fault(class));
        rig.run_until(|rig| rig.end().is_some());
        let told = rig.sent(CobId::r_pdo(2, rig.machine.drives[2].node)).len();
        assert!(told > before);
        let _ = rig.finish_with_fault();
        let (safe, outputs) = *set_outputs(&rig).last().expect("outputs");
        assert_eq!(outputs, SAFE);
        assert!(safe <= told + 2, "safe in burst {safe}, told behind {told}");
    }
}

// --- inputs ---

#[test]
fn without_its_enable_a_machine_enables_nothing() {
    let mut rig = wired("G21 G90\nG0 X10\nM2\n");
    set(&mut rig, ENABLE, false);
    let Fault::NotEnabled { input } = rig.finish_with_fault() else {
        panic!("{:?}", rig.events);
    };
    assert_eq!(rig.machine.inputs[input].name, "enable");
    let enabled = |(phase, _): &(Phase, _)| *phase == Phase::OperationEnabled;
    assert!(!rig.phases.iter().any(enabled));
}

#[test]
fn an_enable_that_is_lost_stops_and_its_return_starts_nothing() {
    let mut rig = wired("G21 G90 F6000\nM3 S100\nG1 X400\nM2\n");
    rig.run_until(|rig| speed(rig) > 50.0);
    set(&mut rig, ENABLE, false);
    let lost = rig.session.timeline().now();
    rig.run_until(|rig| rig.end().is_some());
    set(&mut rig, ENABLE, true);
    assert!(matches!(rig.finish_with_fault(), Fault::NotEnabled { .. }));
    rig.trace().assert_within_limits();
    assert!(rig.ends_at_rest());
    let cycle = rig.machine.cycle;
    for drive in 0..rig.machine.drives.len() {
        let frames = rig.sent(CobId::r_pdo(2, rig.machine.drives[drive].node));
        let frames = frames.iter().filter(|it| it.start > lost);
        let mut words: Vec<_> = frames.map(|it| (it.frame.data()[0], it.start)).collect();
        words.dedup_by_key(|(word, _)| *word);
        words.retain(|(word, _)| *word != 0x1F);
        let [(0x0B, at), (0x00, _)] = words[..] else {
            panic!("drive {drive}: {words:?}");
        };
        // The T_PDO of the next SYNC tells it.
        assert!(
            at < lost + 3 * cycle,
            "drive {drive}: {at:?}, lost {lost:?}"
        );
    }
    assert_eq!(set_outputs(&rig).last().map(|it| it.1), Some(SAFE));
}

#[test]
fn hold_and_start_act_when_they_come_on() {
    let mut rig = wired("G21 G90 F6000\nG1 X100\nM0\nG1 X0\nM2\n");
    // On from the beginning, the one lets nothing begin and the other starts nothing.
    set(&mut rig, HOLD, true);
    set(&mut rig, START, true);
    rig.run_to(Phase::Program);
    goes_on_after(&mut rig, 100);
    let held = rig.layout.inputs.iter().position(|it| it.name == "hold");
    let held = Event::Held(Hold::Input(held.expect("it is wired")));
    assert_eq!((speed(&rig), rig.events.last()), (0.0, Some(&held)));
    // Pressed meanwhile, the one for cycle start says why nothing moves.
    set(&mut rig, START, false);
    goes_on_after(&mut rig, 10);
    let told = rig.events.len();
    set(&mut rig, START, true);
    goes_on_after(&mut rig, 100);
    assert_eq!(speed(&rig), 0.0);
    assert!(rig.events[told..].contains(&held), "{:?}", rig.events);
    rig.command(Command::Resume);
    goes_on_after(&mut rig, 10);
    let refused = Refusal::Machine(OrderRefusal::FeedHoldOn);
    assert_eq!(rig.refused.pop().map(|it| it.reason), Some(refused));
    // Off again it starts nothing either.
    set(&mut rig, HOLD, false);
    goes_on_after(&mut rig, 20);
    assert_eq!(speed(&rig), 0.0);
    set(&mut rig, START, false);
    goes_on_after(&mut rig, 10);
    set(&mut rig, START, true);
    rig.run_until(|rig| speed(rig) > 50.0);
    set(&mut rig, HOLD, true);
    goes_on_after(&mut rig, 500);
    assert_eq!(speed(&rig), 0.0);
    set(&mut rig, HOLD, false);
    for _ in 0..2 {
        set(&mut rig, START, false);
        goes_on_after(&mut rig, 10);
        assert_eq!(speed(&rig), 0.0);
        set(&mut rig, START, true);
        goes_on_after(&mut rig, 10);
        assert!(speed(&rig) > 0.0);
        // To the end of the move, where M0 is.
        rig.run_until(|rig| speed(rig) == 0.0);
        if rig.end().is_some() {
            break;
        }
        goes_on_after(&mut rig, 10);
    }
    assert_eq!(rig.finish(), End::Finished);
    assert!(is_paused(&rig, Pause::ProgramStop));
}

#[test]
fn nothing_goes_on_while_a_door_is_open() {
    let mut rig = wired("G21 G90 F6000\nG1 X100\nM2\n");
    set(&mut rig, DOOR, true);
    rig.run_to(Phase::Program);
    goes_on_after(&mut rig, 100);
    assert_eq!(speed(&rig), 0.0);
    rig.command(Command::Resume);
    set(&mut rig, START, true);
    goes_on_after(&mut rig, 100);
    assert_eq!(speed(&rig), 0.0);
    assert_eq!(rig.refused.len(), 1);
    set(&mut rig, DOOR, false);
    goes_on_after(&mut rig, 100);
    assert_eq!(speed(&rig), 0.0, "closing it starts nothing");
    rig.command(Command::Resume);
    rig.run_until(|rig| speed(rig) > 50.0);
    set(&mut rig, DOOR, true);
    rig.run_until(|rig| speed(rig) == 0.0);
    assert_eq!(rig.end(), None);
    set(&mut rig, DOOR, false);
    goes_on_after(&mut rig, 10);
    rig.command(Command::Resume);
    assert_eq!(rig.finish(), End::Finished);
}

/// What moves no axis, turns no spindle and runs no command of the user's is done under an open door, in ready and in a hold.
#[test]
fn typed_lines_that_move_nothing_are_done_while_a_door_is_open() {
    let lines = [
        ("M5", true),
        ("M9", true),
        ("M64 P1", true),
        ("(MSG, closed)", true),
        ("G10 L2 P2 X1", true),
        ("G4 P0.01", true),
        ("G0 X100", true),
        ("G0 X101", false),
        ("G91 G1 Y0.1 F100", false),
        ("G2 I5 F1000", false),
        ("G3 J-5 Z0 F1000", false),
        ("G91 G1 Y0.1 F100\nG1 Y-0.1", false),
        ("G5 I1 J1 P1 Q-1 X0 Y0 F100", false),
        ("G1 X", false),
        ("M3 S100", false),
        ("M5\nM4 S100", false),
    ];
    for held in [false, true] {
        let mut rig = Rig::staying_on("portal", &[("[machine]\n", WIRED)], |_, _| ());
        rig.goes_on = false;
        set(&mut rig, ENABLE, true);
        homing::settle(&mut rig);
        let end = if held { "M0" } else { "M2" };
        let text = format!("G21 G90 F6000\nM3 S500\nG1 X100\n{end}\nG1 X0\nM2\n");
        let file = rig.folder.file("part.ngc", &text);
        homing::go(&mut rig, Command::Load(file));
        homing::go(&mut rig, Command::Run { from_line: None });
        let rests = state(&rig);
        assert_eq!(rests, if held { State::Held } else { State::Ready });
        set(&mut rig, DOOR, true);
        goes_on_after(&mut rig, 10);
        for (line, is_done) in lines {
            let (before, rows) = (rig.refused.len(), rig.rows.len());
            let problems = rig.problems.len();
            homing::go(&mut rig, Command::Mdi(line.to_owned()));
            let refused = rig.refused[before..].to_vec();
            assert_eq!(
                refused.is_empty(),
                is_done,
                "{line}, held {held}: {refused:?}"
            );
            assert_eq!(rig.problems.len(), problems, "{line}: {:?}", rig.problems);
            assert!(
                rig.rows[rows..]
                    .iter()
                    .all(|row| row.plan.velocity == [0.0; 9]),
                "{line}"
            );
            assert_eq!(state(&rig), rests, "{line}");
        }
    }
}

/// Whatever would set something going is refused with the reason, in every state in which it could, and neither that nor the
/// input's going off begins anything. A refused command leaves no trace in the states that are told.
#[test]
fn nothing_begins_while_an_input_holds() {
    let step = Command::Jog(Jog::Step {
        axis: AxisLetter::X,
        direction: Direction::Positive,
    });
    let from_ready = [
        Command::Run { from_line: None },
        Command::CycleStart,
        Command::Mdi("G0 X5".to_owned()),
        step.clone(),
    ];
    let from_held = [
        Command::Resume,
        Command::CycleStart,
        Command::ToggleFeedHold,
        Command::Retrace,
        Command::Mdi("G0 X5".to_owned()),
        step,
    ];
    for (input, reason) in [
        (DOOR, OrderRefusal::DoorOpen),
        (HOLD, OrderRefusal::FeedHoldOn),
    ] {
        let mut rig = Rig::staying_on("portal", &[("[machine]\n", WIRED)], |_, _| ());
        rig.goes_on = false;
        set(&mut rig, ENABLE, true);
        homing::settle(&mut rig);
        let file = rig
            .folder
            .file("part.ngc", "G21 G90 G1 X100 F6000\nM0\nX0\nM2\n");
        homing::go(&mut rig, Command::Load(file));
        let refuses = |rig: &mut Rig, commands: &[Command]| {
            let (state, told) = (state(rig), rig.states.len());
            let there = rig.session.status().setpoint;
            for command in commands {
                rig.command(command.clone());
                for _ in 0..100 {
                    rig.step();
                }
                let refused = rig.refused.pop().map(|it| it.reason);
                assert_eq!(refused, Some(reason.into()), "{command:?} while {state}");
            }
            assert_eq!(rig.states.len(), told, "{:?}", rig.states);
            set(rig, input, false);
            for _ in 0..100 {
                rig.step();
            }
            assert_eq!(rig.session.status().setpoint, there, "{state}");
            assert_eq!(homing::state(rig), state);
        };
        let set_on = |rig: &mut Rig| {
            set(rig, input, true);
            for _ in 0..20 {
                rig.step();
            }
        };
        set_on(&mut rig);
        refuses(&mut rig, &from_ready);
        // Held by an operator before, at M0, for want of speed, and by the input itself.
        rig.command(Command::Run { from_line: None });
        rig.run_until(|rig| rig.session.status().setpoint[0] > 20.0);
        homing::go(&mut rig, Command::FeedHold);
        set_on(&mut rig);
        refuses(&mut rig, &from_held);
        homing::go(&mut rig, Command::Resume);
        assert!(is_paused(&rig, Pause::ProgramStop));
        set_on(&mut rig);
        refuses(&mut rig, &from_held);
        homing::go(&mut rig, Command::Resume);
        rig.command(Command::CycleStart);
        rig.run_until(|rig| rig.session.status().setpoint[0] < 80.0);
        rig.command(Command::FeedOverride(Override::To(0.0)));
        homing::settle(&mut rig);
        assert_eq!(state(&rig), State::Held);
        set_on(&mut rig);
        // Raised meanwhile it moves nothing either.
        homing::go(&mut rig, Command::FeedOverride(Override::To(100.0)));
        refuses(&mut rig, &from_held);
        rig.command(Command::Resume);
        rig.run_until(|rig| rig.session.status().setpoint[0] < 50.0);
        set_on(&mut rig);
        homing::settle(&mut rig);
        let place = rig
            .layout
            .inputs
            .iter()
            .position(|it| it.signal == usize::from(input));
        let held = Event::Held(Hold::Input(place.expect("it is wired")));
        assert!(rig.events.contains(&held), "{:?}", rig.events);
        refuses(&mut rig, &from_held);
        homing::go(&mut rig, Command::Resume);
        assert_eq!(state(&rig), State::Ready);
    }
}

/// A door and an input for feed hold on the router, whose axes are homed.
const HOMED: (&str, &str) = (
    "[[bus]]\nname = \"main\"",
    "[[input]]\nname = \"door\"\ndrive = \"Z\"\nsignal = \"DI2\"\nfunction = \"door\"\n\n\
     [[input]]\nname = \"hold\"\ndrive = \"Z\"\nsignal = \"DI3\"\nfunction = \"feed_hold\"\n\n\
     [[bus]]\nname = \"main\"",
);
const HOLD_OF_HOMED: u8 = 3;

#[test]
fn a_run_that_homes_does_not_begin_while_a_door_is_open() {
    let program = "G0 X20 Y30 Z-5\nM2\n";
    let mut rig = Rig::new("router", &[HOMED], program, |_, _| ());
    rig.twin(INPUTS).disturb(Disturbance::Input(DOOR, true));
    assert!(matches!(
        rig.finish_with_fault(),
        Fault::Axis(_, AxisCause::Homing(HomingFailure::DoorOpen))
    ));
    assert!(rig.rows.iter().all(|row| row.plan.velocity == [0.0; 9]));
}

/// What ends a homing.
#[derive(Clone, Copy, Debug, PartialEq)]
enum By {
    Door,
    HoldInput,
    FeedHold,
    Override,
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    /// A homing does not wait and go on: it ends at rest, nothing moves while the door is open, and a second one finds
    /// its place.
    #[test]
    fn a_door_or_a_hold_ends_a_homing(
        after in 0..2500usize, by in select(vec![By::Door, By::HoldInput, By::FeedHold, By::Override]), at_start: bool,
    ) {
        let (input, failure) = match by {
            By::Door => (Some(DOOR), HomingFailure::DoorOpen),
            By::HoldInput => (Some(HOLD_OF_HOMED), HomingFailure::FeedHold),
            By::FeedHold => (None, HomingFailure::Held),
            By::Override => (None, HomingFailure::NoSpeed),
        };
        let program = "G0 X20 Y30 Z-5\nM2\n";
        let mut rig = match at_start {
            true => Rig::new("router", &[HOMED], program, |_, _| ()),
            false => switched_on(&[HOMED]),
        };
        if !at_start {
            rig.command(homing::ALL);
        }
        rig.run_until(|rig| state(rig) == State::Homing);
        for _ in 0..after {
            rig.step();
        }
        prop_assume!(state(&rig) == State::Homing);
        match (input, by) {
            (Some(input), _) => rig.twin(INPUTS).disturb(Disturbance::Input(input, true)),
            (None, By::Override) => rig.command(Command::RapidOverride(Override::To(0.0))),
            (None, _) => rig.command(Command::FeedHold),
        }
        rig.run_until(|rig| rig.events.iter().any(|it| matches!(it, Event::HomingFailed { .. })));
        prop_assert_eq!(homing::failure(&rig), Some(failure));
        if at_start {
            prop_assert!(matches!(rig.finish_with_fault(), Fault::Axis(_, AxisCause::Homing(it)) if it == failure));
            prop_assert!(rig.ends_at_rest());
            return Ok(());
        }
        homing::settle(&mut rig);
        prop_assert_eq!(state(&rig), State::Ready);
        if input.is_some() {
            homing::go(&mut rig, homing::ALL);
            prop_assert_eq!(rig.refused.len(), 1);
        }
        rig.command(Command::RapidOverride(Override::To(100.0)));
        if let Some(input) = input {
            rig.twin(INPUTS).disturb(Disturbance::Input(input, false));
        }
        for _ in 0..20 {
            rig.step();
        }
        homing::go(&mut rig, homing::ALL);
        for axis in [AxisLetter::X, AxisLetter::Y, AxisLetter::Z] {
            prop_assert!(homing::is_referenced(&rig, axis), "{:?}", rig.events);
            let errors = homing::errors(&mut rig, axis);
            prop_assert!(errors.iter().all(|error| error.abs() < 0.01), "{:?}", errors);
        }
    }
}

/// When the part comes, in cycles, and how the program goes on.
#[test]
fn a_program_waits_for_its_input() {
    for (level, first, then) in [
        (1, false, true),
        (2, true, false),
        (3, false, true),
        (4, true, false),
    ] {
        let program = format!("G21 G90 F6000\nG1 X10\nM66 P5 L{level} Q3\nG1 X20\nM2\n");
        let mut rig = wired(&program);
        set(&mut rig, PART, first);
        rig.run_until(|rig| speed(rig) > 0.0);
        rig.run_until(|rig| speed(rig) == 0.0);
        goes_on_after(&mut rig, 300);
        assert_eq!(speed(&rig), 0.0, "L{level} has not come");
        // Shorter than the input is debounced for.
        set(&mut rig, PART, then);
        goes_on_after(&mut rig, 5);
        set(&mut rig, PART, first);
        goes_on_after(&mut rig, 100);
        assert_eq!(speed(&rig), 0.0, "L{level} has bounced");
        set(&mut rig, PART, then);
        goes_on_after(&mut rig, 20);
        assert!(speed(&rig) > 0.0, "L{level} has come");
        assert_eq!(rig.finish(), End::Finished);
        assert!(!is_paused(&rig, Pause::NoInput(5)));
    }
}

#[test]
fn an_input_that_does_not_come_in_time_is_the_operators() {
    let mut rig = wired("G21 G90 F6000\nG1 X10\nM66 P5 L3 Q0.5\nG1 X20\nM2\n");
    rig.run_until(|rig| is_paused(rig, Pause::NoInput(5)));
    goes_on_after(&mut rig, 500);
    assert_eq!(speed(&rig), 0.0);
    rig.command(Command::CycleStart);
    assert_eq!(rig.finish(), End::Finished);
}

/// Each wait has its own time, and its own edge, whatever came of the one before.
#[test]
fn waits_in_a_row_are_each_for_themselves() {
    let mut rig = wired("G21 G90 F6000\nG1 X10\nM66 P5 L3 Q0.5\nM66 P5 L3 Q0.5\nG1 X20\nM2\n");
    let pauses = |rig: &Rig| {
        let told = |event: &&Event| {
            matches!(
                event,
                Event::Paused {
                    reason: Pause::NoInput(5),
                    ..
                }
            )
        };
        rig.events.iter().filter(told).count()
    };
    rig.run_until(|rig| pauses(rig) == 1);
    let first = rig.rows.len();
    rig.command(Command::CycleStart);
    rig.run_until(|rig| pauses(rig) == 2);
    let waited = rig.rows.len() - first;
    assert!((248..=260).contains(&waited), "{waited} cycles");
    rig.command(Command::CycleStart);
    assert_eq!(rig.finish(), End::Finished);
    // One edge is for one wait.
    let mut rig = wired("G21 G90 F6000\nG1 X10\nM66 P5 L1 Q0.5\nM66 P5 L1 Q0.5\nG1 X20\nM2\n");
    rig.run_until(|rig| speed(rig) > 0.0);
    rig.run_until(|rig| speed(rig) == 0.0);
    goes_on_after(&mut rig, 100);
    set(&mut rig, PART, true);
    rig.run_until(|rig| pauses(rig) == 1);
    rig.command(Command::CycleStart);
    assert_eq!(rig.finish(), End::Finished);
}

// --- the spindle ---

const AT_SPEED: &str = r#"
[spindle]
max_speed = 3000
ramp_ms = 1000

[[input]]
name = "at speed"
drive = "Z"
signal = "DI1"
function = "at_speed"

[machine]
"#;

fn spindle(program: &str) -> Rig {
    let mut rig = Rig::new("portal", &[("[machine]\n", AT_SPEED)], program, |_, _| ());
    rig.goes_on = false;
    rig
}

/// Where X is to be.
fn x(rig: &Rig) -> f64 {
    rig.rows.last().map_or(0.0, |row| row.plan.position[0])
}

#[test]
fn no_cut_begins_before_the_spindle_has_its_speed() {
    let mut rig =
        spindle("G21 G90 F6000\nM3 S1000\nG0 X10\nG1 X20\nG0 X25\nS500\nG1 X30\nM5\nG1 X0\nM2\n");
    rig.run_until(|rig| x(rig) > 9.999);
    goes_on_after(&mut rig, 400);
    assert_eq!(x(&rig), 10.0, "it does not turn yet");
    set(&mut rig, PART, true);
    rig.run_until(|rig| x(rig) > 24.999);
    let arrived = rig.rows.len();
    rig.run_until(|rig| x(rig) > 25.01);
    let rested = (rig.rows.len() - arrived) as f64 * rig.machine.cycle.as_secs_f64();
    // What it says of the speed before does not count.
    assert!((0.1..0.2).contains(&rested), "{rested} s");
    assert_eq!(rig.finish(), End::Finished);
    assert!(!is_paused(&rig, Pause::NotAtSpeed));
}

#[test]
fn a_spindle_that_does_not_reach_its_speed_is_the_operators() {
    let mut rig = spindle("G21 G90 F6000\nM4 S1000\nG1 X20\nM2\n");
    rig.run_until(|rig| is_paused(rig, Pause::NotAtSpeed));
    assert!(
        (495..=510).contains(&rig.rows.len()),
        "{} cycles",
        rig.rows.len()
    );
    assert_eq!(x(&rig), 0.0);
    rig.command(Command::CycleStart);
    assert_eq!(rig.finish(), End::Finished);
}

/// In a cut that is a feed hold, in a rapid it is nothing; who goes on without it does so until it comes again.
#[test]
fn a_spindle_that_loses_its_speed_in_a_cut_holds_the_path() {
    let mut rig = spindle("G21 G90 F6000\nM3 S1000\nG1 X300\nG0 X0\nM2\n");
    let told = |rig: &Rig| {
        let lost = rig
            .events
            .iter()
            .filter(|event| **event == Event::SpeedLost);
        lost.count()
    };
    set(&mut rig, PART, true);
    rig.run_until(|rig| x(rig) > 50.0);
    let cycle = rig.machine.cycle.as_secs_f64();
    // What is over within 200 ms is nothing.
    set(&mut rig, PART, false);
    goes_on_after(&mut rig, (0.19 / cycle) as usize);
    set(&mut rig, PART, true);
    rig.run_until(|rig| x(rig) > 80.0);
    assert_eq!(told(&rig), 0);
    set(&mut rig, PART, false);
    let lost = rig.rows.len();
    rig.run_until(|rig| told(rig) == 1);
    let waited = (rig.rows.len() - lost) as f64 * cycle;
    assert!((0.2..0.21).contains(&waited), "{waited} s");
    rig.run_until(|rig| speed(rig) == 0.0);
    assert!(
        rig.events.contains(&Event::Held(Hold::Spindle)),
        "{:?}",
        rig.events
    );
    goes_on_after(&mut rig, 200);
    assert_eq!(speed(&rig), 0.0);
    // It goes on without, and is watched again from where the input came.
    rig.command(Command::Resume);
    rig.run_until(|rig| x(rig) > 150.0);
    set(&mut rig, PART, true);
    goes_on_after(&mut rig, 10);
    set(&mut rig, PART, false);
    rig.run_until(|rig| told(rig) == 2);
    // Who goes on while the path still slows down ends that hold, too: the next one is its own.
    set(&mut rig, PART, true);
    rig.command(Command::Resume);
    goes_on_after(&mut rig, 100);
    rig.command(Command::SingleBlock(SwitchChange::To(true)));
    rig.run_until(|rig| speed(rig) == 0.0);
    assert!(x(&rig) > 299.999);
    let held = rig.events.iter().rfind(|it| matches!(it, Event::Held(_)));
    assert_eq!(held, Some(&Event::Held(Hold::Operator)));
    rig.command(Command::SingleBlock(SwitchChange::To(false)));
    rig.command(Command::Resume);
    set(&mut rig, PART, false);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    assert_eq!(told(&rig), 2);
}

#[test]
fn without_an_input_a_cut_waits_for_the_ramp() {
    let ramp = (
        "[machine]\n",
        "[spindle]\nmax_speed = 3000\nramp_ms = 400\n[machine]\n",
    );
    let program = "G21 G90 F6000\nM3 S1000\nG0 X10\nG1 X20\nM5\nG1 X0\nM2\n";
    let mut rig = Rig::new("portal", &[ramp], program, |_, _| ());
    rig.run_until(|rig| x(rig) > 9.999);
    let arrived = rig.rows.len();
    rig.run_until(|rig| x(rig) > 10.01);
    let rested = (rig.rows.len() - arrived) as f64 * rig.machine.cycle.as_secs_f64();
    assert!((0.4..0.45).contains(&rested), "{rested} s");
    rig.run_until(|rig| x(rig) > 19.999);
    let arrived = rig.rows.len();
    rig.run_until(|rig| x(rig) < 19.9);
    assert!(rig.rows.len() - arrived < 50, "M5 is not waited for");
    assert_eq!(rig.finish(), End::Finished);
}

// --- any levels, at any time ---

/// Lines, arcs, blends, dwells, a stop and an input to wait for, with M-codes between all of them.
const LONG: &str = "\
G21 G90 G64 P0.1 F9000
M64 P1
G1 X30 Y40
M3 S1000
G3 X50 Y40 R10
M65 P1
G4 P0.05
M64 P1
G1 X80
M66 P5 L3 Q0.2
Y60 M62 P2
X100
M0
M65 P1
G1 X0 Y0
M2
";
const EXECUTED: [&str; 5] = ["M64 P1", "M65 P1", "M64 P1", "M62 P2", "M65 P1"];

/// A sensor, its level, and how many cycles after the one before.
fn change() -> impl Strategy<Value = (u8, bool, usize)> {
    (PART..=HOLD, any::<bool>(), 0..150_usize)
}

/// Runs [`LONG`] while sensors change; an operator goes on where it rests.
fn runs_through(changes: Vec<(u8, bool, usize)>) {
    let mut rig = wired(LONG);
    let mut changes = changes.into_iter();
    let mut next = changes.next();
    let (mut since, mut rested, mut held) = (0, 0, 0);
    let mut on = [false; HOLD as usize + 1];
    while rig.step() {
        if rig.rows.is_empty() {
            continue;
        }
        since += 1;
        let holds = on[usize::from(DOOR)] || on[usize::from(HOLD)];
        held = if holds { held + 1 } else { 0 };
        let moves = speed(&rig) > 0.0;
        // It takes its T_PDO, and a cycle until a setpoint is latched.
        assert!(
            !moves || rested == 0 || held < 4,
            "it sets off, {held} cycles after the door was opened, or the hold came on"
        );
        rested = if moves { 0 } else { rested + 1 };
        if rested > 200 && rested % 20 == 0 {
            rig.command(Command::CycleStart);
            rig.command(Command::Resume);
        }
        match next {
            Some((sensor, level, after)) if since >= after => {
                set(&mut rig, sensor, level);
                on[usize::from(sensor)] = level;
                next = changes.next();
                since = 0;
            }
            None if holds && since > 100 => {
                for sensor in [DOOR, HOLD] {
                    set(&mut rig, sensor, false);
                    on[usize::from(sensor)] = false;
                }
            }
            _ => {}
        }
    }
    assert_eq!(rig.end(), Some(End::Finished), "{:?}", rig.events);
    rig.trace().assert_within_limits();
    let executed = rig.switches.iter().filter_map(|switch| match switch {
        Switch::Output(output) => Some(output.to_string()),
        _ => None,
    });
    assert!(
        executed.eq(EXECUTED.map(str::to_owned)),
        "{:?}",
        rig.switches
    );
    assert_eq!(set_outputs(&rig).last().map(|it| it.1), Some(SAFE));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    #[test]
    fn whatever_sensors_say_the_program_is_done_and_an_open_door_is_heeded(
        changes in prop::collection::vec(change(), 0..12),
    ) {
        runs_through(changes);
    }
}
