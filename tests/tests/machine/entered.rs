//! Programs that are begun in their middle: until an operator confirms it nothing moves and nothing is switched, and then
//! outputs are as the program has them there, also those that were switched by hand before it.

use super::day::{go, mdi, settle, state};
use super::io_nodes::{WIRED, output, outputs, staying_on, staying_on_with};
use proptest::prelude::*;
use proptest::sample::select;
use std::fmt::Write as _;
use syncline_controller::control::{Event, State};
use syncline_controller::session::{Command, Jog, Override, Refusal};
use syncline_drives::twin::{Disturbance, ErrorClass};
use syncline_gcode::AxisLetter;
use syncline_tests::command::{Folder, ended, machine_with, syncline};
use syncline_tests::rig::Rig;

/// The valve is on, the clamp, which is active low, is off, the flood is on.
const VALVE: u16 = 0x0002;
const CLAMP_IS_OFF: u16 = 0x0200;
const FLOOD: u16 = 0x0020;
const MIST: u16 = 0x0040;

/// The outputs by name, of which the clamp is safe where it is on.
const NAMES: [&str; 3] = ["valve", "clamp", "flood"];

/// A machine that has all of them.
fn cooled() -> Rig {
    const FLOOD: &str = "[[output]]\nname = \"flood\"\nio = \"cabinet\"\nsignal = \"DO5\"\nfunction = \"flood\"\n\n";
    let mut rig = staying_on_with(FLOOD);
    rig.goes_on = false;
    rig
}

/// Switches some of them by hand.
fn switch_by_hand(rig: &mut Rig, by_hand: [Option<bool>; 3]) {
    for (name, on) in NAMES.into_iter().zip(by_hand) {
        if let Some(on) = on {
            go(rig, output(name, on));
        }
    }
}

/// What is done by hand before a program.
fn by_hand() -> impl Strategy<Value = [Option<bool>; 3]> {
    prop::array::uniform3(prop::option::of(any::<bool>()))
}

/// What switches one of them, by its number from 1 on.
fn code(number: u8, on: bool) -> String {
    match (number, on) {
        (3, true) => "M8".to_owned(),
        (3, false) => "M9".to_owned(),
        (number, true) => format!("M64 P{number}"),
        (number, false) => format!("M65 P{number}"),
    }
}

/// How a program is interrupted.
#[derive(Clone, Copy, Debug)]
enum Interruption {
    Stop,
    Fault,
    /// Held, and left for a line that switches something.
    Lines(&'static str),
}

/// A program that goes on in steps of 10 mm, with switches before each.
fn program(switches: &[Vec<(u8, bool)>]) -> String {
    let mut text = "G21 G90 G61 F3000\nG1 X1\n".to_owned();
    for (place, switches) in (1..).zip(switches) {
        for (number, on) in switches {
            let _ = writeln!(text, "{}", code(*number, *on));
        }
        let _ = writeln!(text, "G1 X{}", 10 * place);
    }
    text + "G1 X0\nM2\n"
}

/// The outputs as the program has them in a line.
fn programmed(text: &str, line: u32, by_hand: [Option<bool>; 3]) -> [bool; 3] {
    let mut on = by_hand.map(|on| on.unwrap_or(false));
    for block in text.lines().take(line as usize - 1) {
        for (number, on) in (1..).zip(&mut on) {
            if block == code(number, true) {
                *on = true;
            } else if block == code(number, false) {
                *on = false;
            }
        }
    }
    on
}

fn digital([valve, clamp, flood]: [bool; 3]) -> u16 {
    u16::from(valve) * VALVE + u16::from(!clamp) * CLAMP_IS_OFF + u16::from(flood) * FLOOD
}

/// Until the path goes on in a line.
fn run_to(rig: &mut Rig, line: u32) {
    rig.run_until(|rig| {
        let row = rig.rows.last();
        let moves = row.is_some_and(|row| row.plan.speed > 0.0 && !row.plan.off_path);
        (moves && rig.session.status().line == line) || state(rig) == State::Ready
    });
}

fn switches() -> impl Strategy<Value = Vec<Vec<(u8, bool)>>> {
    let one = (1u8..=3, any::<bool>());
    prop::collection::vec(prop::collection::vec(one, 0..3), 3..6)
}

fn interruption() -> impl Strategy<Value = Interruption> {
    select(vec![
        Interruption::Stop,
        Interruption::Fault,
        Interruption::Lines("M64 P2"),
        Interruption::Lines("M65 P2\nM64 P1"),
        Interruption::Lines("M9"),
        Interruption::Lines("M8\nM64 P2"),
        Interruption::Lines("G91 G1 Y5"),
    ])
}

proptest! {
    #![proptest_config(ProptestConfig { max_shrink_iters: 40, ..ProptestConfig::with_cases(10) })]

    /// The way back to a program switches nothing before cycle start, and then what the program has there, whatever was
    /// closed by hand before it began.
    #[test]
    fn a_program_that_is_resumed_has_the_outputs_that_it_had(
        by_hand in by_hand(), switches in switches(), interruption in interruption(), share in 0.05..0.95f64,
    ) {
        let mut rig = cooled();
        switch_by_hand(&mut rig, by_hand);
        let text = program(&switches);
        let file = rig.folder.file("part.ngc", &text);
        rig.command(Command::Load(file));
        rig.command(Command::Run { from_line: None });
        let there = share * 10.0 * switches.len() as f64;
        rig.run_until(|rig| rig.session.status().setpoint[0] > there);
        match interruption {
            Interruption::Stop => go(&mut rig, Command::Stop),
            Interruption::Fault => {
                rig.twin(2).disturb(Disturbance::Fault(ErrorClass::StopAndSwitchOff));
                settle(&mut rig);
                go(&mut rig, Command::Reset);
            }
            Interruption::Lines(lines) => {
                go(&mut rig, Command::FeedHold);
                mdi(&mut rig, lines);
            }
        }
        let line = rig.session.status().interrupted;
        let line = line.ok_or_else(|| TestCaseError::fail(format!("{:?}", rig.events)))?;
        let before = outputs(&mut rig).0;
        let position = rig.session.status().setpoint;
        go(&mut rig, Command::Resume);
        prop_assert_eq!(state(&rig), State::Held, "{:?}", rig.problems);
        prop_assert_eq!(outputs(&mut rig).0, before, "nothing is switched before cycle start");
        prop_assert_eq!(rig.session.status().setpoint, position);
        let expected = digital(programmed(&text, line, by_hand));
        // What goes off is listed as well.
        let told = rig.messages.last().map(|(_, told)| told.clone()).unwrap_or_default();
        for (name, bit) in [(" P1", VALVE), (" P2", CLAMP_IS_OFF), (" flood ", FLOOD)] {
            let changes = (before ^ expected) & bit != 0;
            prop_assert_eq!(told.contains(name), changes, "{}", told);
        }
        let since = rig.events.len();
        rig.command(Command::CycleStart);
        run_to(&mut rig, line);
        prop_assert_eq!(state(&rig), State::Running);
        prop_assert_eq!(outputs(&mut rig).0, expected);
        // Each goes there at once, and not by way of another state.
        let outputs = rig.events[since..].iter().filter(|it| matches!(it, Event::Output { .. }));
        prop_assert_eq!(outputs.count(), (before ^ expected).count_ones() as usize);
    }

    /// A program that is begun at a line leaves what it has not switched before as it is, and switches nothing before it is
    /// confirmed.
    #[test]
    fn a_program_that_begins_at_a_line_switches_once_that_is_confirmed(
        by_hand in by_hand(), switches in switches(), share in 0.0..1.0f64, at_once: bool, stopped: bool,
    ) {
        let mut rig = cooled();
        if !at_once {
            switch_by_hand(&mut rig, by_hand);
        }
        let text = program(&switches);
        let moves: Vec<_> = (1..).zip(text.lines()).filter(|(_, block)| block.starts_with("G1 X")).collect();
        let (line, _) = moves[1 + (share * (moves.len() - 2) as f64) as usize];
        let file = rig.folder.file("part.ngc", &text);
        rig.command(Command::Load(file));
        // All that is ordered in one cycle is so in its order.
        let ordered = NAMES.into_iter().zip(by_hand).filter(|_| at_once);
        for (name, on) in ordered.filter_map(|(name, on)| Some((name, on?))) {
            rig.command(output(name, on));
        }
        // It makes safe what was switched by hand.
        if stopped {
            rig.command(Command::Stop);
        }
        go(&mut rig, Command::Run { from_line: Some(line) });
        prop_assert_eq!(state(&rig), State::Held, "{:?}", rig.problems);
        let [valve, clamp, flood] = if stopped { [None; 3] } else { by_hand };
        let as_it_is = [valve.unwrap_or(false), clamp.unwrap_or(true), flood.unwrap_or(false)];
        prop_assert_eq!(outputs(&mut rig).0, digital(as_it_is));
        let expected = digital(programmed(&text, line, as_it_is.map(Some)));
        rig.command(Command::CycleStart);
        run_to(&mut rig, line);
        prop_assert_eq!(outputs(&mut rig).0, expected);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(10))]

    /// A program that is wrong in its first lines switches nothing: not what is safe on, what was switched by hand, or what typed
    /// lines have left on. What comes after begins with that.
    #[test]
    fn a_program_that_is_wrong_switches_nothing(
        by_hand in prop::array::uniform3(prop::option::of(any::<bool>())), left_on in prop::option::of(select(vec!["M64 P1", "M65 P2", "M8", "M3 S500"])),
        wrong in select(vec!["G1 X9000 F100", "G1 X", "G64 P-1\nG1 X5 F100", "#<a> = [1/0]", "o<nowhere> call", "M64 P99", "G2 X5 F100"]),
        typed: bool,
    ) {
        let mut rig = cooled();
        switch_by_hand(&mut rig, by_hand);
        if let Some(line) = left_on {
            mdi(&mut rig, line);
        }
        let before = outputs(&mut rig);
        let since = rig.events.len();
        if typed {
            go(&mut rig, Command::Mdi(wrong.to_owned()));
        } else {
            let file = rig.folder.file("part.ngc", &format!("G21 G90\n{wrong}\nM2\n"));
            go(&mut rig, Command::Load(file));
            go(&mut rig, Command::Run { from_line: None });
        }
        prop_assert!(!rig.problems.is_empty(), "{:?}", rig.events);
        prop_assert_eq!(state(&rig), State::Ready);
        prop_assert_eq!(outputs(&mut rig), before);
        let switched = |event: &&Event| matches!(event, Event::Output { .. } | Event::AnalogOutput { .. });
        prop_assert_eq!(rig.events[since..].iter().filter(switched).count(), 0);
        let file = rig.folder.file("right.ngc", "G21 G90\nG1 X10 F3000\nM0\nM2\n");
        go(&mut rig, Command::Load(file));
        go(&mut rig, Command::Run { from_line: None });
        let begins = programmed(left_on.unwrap_or_default(), 2, by_hand);
        prop_assert_eq!(outputs(&mut rig).0 & (VALVE | CLAMP_IS_OFF | FLOOD), digital(begins));
        prop_assert_eq!(state(&rig), State::Held);
    }
}

/// Of a stop and a start at a line that are ordered in one cycle the start switches on again what the stop makes safe.
#[test]
fn what_a_stop_makes_safe_a_start_behind_it_switches() {
    let mut rig = cooled();
    go(&mut rig, output("valve", true));
    let text = "G21 G90 G61 F3000\nG1 X1\nM64 P1\nG1 X10\nG1 X20\nM2\n";
    let file = rig.folder.file("part.ngc", text);
    go(&mut rig, Command::Load(file));
    rig.command(Command::Stop);
    go(&mut rig, Command::Run { from_line: Some(5) });
    assert_eq!(outputs(&mut rig).0, digital([false, true, false]));
    rig.command(Command::CycleStart);
    run_to(&mut rig, 5);
    assert_eq!(outputs(&mut rig).0, digital([true, true, false]));
}

/// A stop switches off what was switched on by hand also where the program has not said anything yet.
#[test]
fn a_stop_before_the_first_instruction_makes_safe() {
    for wake_ups in 0..4 {
        let mut rig = cooled();
        go(&mut rig, output("flood", true));
        let file = rig.folder.file("part.ngc", "G1 X10 F3000\nM2\n");
        go(&mut rig, Command::Load(file));
        rig.command(Command::Run { from_line: None });
        (0..wake_ups).for_each(|_| {
            rig.step();
        });
        go(&mut rig, Command::Stop);
        assert_eq!(state(&rig), State::Ready);
        assert_eq!(outputs(&mut rig).0, 0, "{wake_ups}");
    }
}

/// M9 is off, whoever switched the coolant on.
#[test]
fn m9_switches_off_what_was_switched_on_by_hand() {
    for typed in [true, false] {
        let mut rig = cooled();
        go(&mut rig, output("flood", true));
        assert_eq!(outputs(&mut rig).0, FLOOD);
        let file = rig.folder.file("part.ngc", "M0\nM9\nM0\nM2\n");
        if typed {
            mdi(&mut rig, "M9");
        } else {
            go(&mut rig, Command::Load(file));
            go(&mut rig, Command::Run { from_line: None });
            assert_eq!(outputs(&mut rig).0 & FLOOD, FLOOD);
            go(&mut rig, Command::CycleStart);
            assert_eq!(state(&rig), State::Held);
        }
        assert_eq!(outputs(&mut rig).0 & FLOOD, 0);
    }
}

/// M8 is on, whoever switched the coolant off, also while a program is held.
#[test]
fn m8_switches_on_what_was_switched_off_by_hand() {
    for held in [false, true] {
        let mut rig = cooled();
        if held {
            let file = rig
                .folder
                .file("part.ngc", "M8\nG1 X10 F3000\nM0\nG1 X20\nM2\n");
            go(&mut rig, Command::Load(file));
            go(&mut rig, Command::Run { from_line: None });
            assert_eq!(state(&rig), State::Held);
        } else {
            mdi(&mut rig, "M8");
        }
        assert_eq!(outputs(&mut rig).0 & FLOOD, FLOOD);
        go(&mut rig, output("flood", false));
        assert_eq!(outputs(&mut rig).0 & FLOOD, 0);
        mdi(&mut rig, "M8");
        assert_eq!(outputs(&mut rig).0 & FLOOD, FLOOD, "{held}");
    }
}

/// What an operator does about the coolant.
#[derive(Clone, Copy, Debug)]
enum Cooling {
    /// Switches an output by hand.
    ByHand(&'static str, bool),
    /// Types a line.
    Typed(&'static str),
}

fn cooling() -> impl Strategy<Value = Cooling> {
    prop_oneof![
        (select(&["mist", "flood"][..]), any::<bool>())
            .prop_map(|(it, on)| Cooling::ByHand(it, on)),
        select(&["M7", "M8", "M9", "M7 M8"][..]).prop_map(Cooling::Typed),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Each code switches the coolant that it names, whoever has switched it before, and leaves the other one as it is.
    #[test]
    fn each_code_switches_the_coolant_that_it_names(steps in prop::collection::vec(cooling(), 1..8)) {
        let table = |name: &str, signal: &str| {
            format!("[[output]]\nname = \"{name}\"\nio = \"cabinet\"\nsignal = \"{signal}\"\nfunction = \"{name}\"\n\n")
        };
        let mut rig = staying_on_with(&(table("flood", "DO5") + &table("mist", "DO6")));
        rig.goes_on = false;
        let mut expected = 0;
        for step in steps {
            match step {
                Cooling::ByHand(name, on) => {
                    go(&mut rig, output(name, on));
                    let bit = if name == "mist" { MIST } else { FLOOD };
                    expected = if on { expected | bit } else { expected & !bit };
                }
                Cooling::Typed(line) => {
                    mdi(&mut rig, line);
                    expected = match line {
                        "M7" => expected | MIST,
                        "M8" => expected | FLOOD,
                        "M9" => 0,
                        _ => MIST | FLOOD,
                    };
                }
            }
            prop_assert_eq!(outputs(&mut rig).0 & (MIST | FLOOD), expected);
        }
    }
}

const STOPS: &str = "G21 G90 F3000\nM64 P1\nG1 X10\nM0\nG1 X20\nM2\n";

fn held_at_m0() -> Rig {
    let mut rig = staying_on();
    rig.goes_on = false;
    let file = rig.folder.file("part.ngc", STOPS);
    rig.command(Command::Load(file));
    go(&mut rig, Command::Run { from_line: None });
    assert_eq!(state(&rig), State::Held);
    rig
}

/// What cannot be taken up is left as it was: it can still be mended and resumed, and no Enter begins at the first line.
#[test]
fn a_program_that_cannot_be_taken_up_stays_where_it_was() {
    let mut rig = held_at_m0();
    mdi(&mut rig, "M3 S500");
    // By the offset the next move is beyond the limits.
    mdi(&mut rig, "G10 L2 P1 X-9000");
    let before = outputs(&mut rig).0;
    for command in [Command::Resume, Command::CycleStart] {
        go(&mut rig, command);
        assert_eq!(state(&rig), State::Held, "{:?}", rig.problems);
        assert_eq!(rig.session.status().interrupted, Some(4));
        assert_eq!(outputs(&mut rig).0, before, "nothing is switched off");
        assert!(
            rig.session.status().modes.contains("S500"),
            "{}",
            rig.session.status().modes
        );
    }
    assert_eq!(rig.problems.len(), 2, "{:?}", rig.problems);
    mdi(&mut rig, "G10 L2 P1 X0");
    go(&mut rig, Command::Resume);
    go(&mut rig, Command::CycleStart);
    assert_eq!(state(&rig), State::Ready, "behind its stop to the end");
    assert!((rig.session.status().setpoint[0] - 20.0).abs() < 1e-6);
}

/// Enter does not choose between going on and beginning anew, and a program that is wrong takes nothing from the one before.
#[test]
fn cycle_start_chooses_nothing_where_a_program_was_interrupted() {
    let mut rig = held_at_m0();
    go(&mut rig, Command::Stop);
    assert_eq!(rig.session.status().interrupted, Some(4));
    go(&mut rig, Command::CycleStart);
    let refused = rig.refused.pop().expect("it is refused").reason;
    assert!(
        matches!(refused, Refusal::Interrupted { line: 4 }),
        "{refused}"
    );
    assert_eq!(state(&rig), State::Ready);
    let _ = rig.folder.file("part.ngc", "G1 X9000 F100\nM2\n");
    go(&mut rig, Command::Run { from_line: None });
    assert_eq!(rig.problems.len(), 1);
    assert_eq!(
        rig.session.status().interrupted,
        Some(4),
        "nothing of the other has begun"
    );
    let _ = rig.folder.file("part.ngc", STOPS);
    go(&mut rig, Command::Resume);
    assert_eq!(state(&rig), State::Held, "{:?}", rig.problems);
    go(&mut rig, Command::Stop);
    go(&mut rig, Command::Run { from_line: None });
    assert_eq!(state(&rig), State::Held);
    go(&mut rig, Command::CycleStart);
    assert_eq!(rig.session.status().interrupted, None);
    go(&mut rig, Command::CycleStart);
    assert_eq!(state(&rig), State::Held, "begun, and at M0");
}

/// A tool change counts once it is confirmed, or once lines are typed for the tool that was loaded.
#[test]
fn a_tool_change_that_is_given_up_is_none() {
    for (typed, retraced, tool) in [
        (None, false, 1),
        (None, true, 1),
        (Some("G4 P0.01"), false, 2),
    ] {
        let mut rig = staying_on();
        rig.goes_on = false;
        mdi(&mut rig, "M61 Q1");
        assert_eq!(rig.session.status().tool, 1);
        let file = rig
            .folder
            .file("part.ngc", "G21 F3000\nG1 X10\nT2 M6\nG1 X20\nM2\n");
        rig.command(Command::Load(file));
        go(&mut rig, Command::Run { from_line: None });
        assert_eq!(rig.session.status().tool, 2, "it is asked for");
        if let Some(lines) = typed {
            mdi(&mut rig, lines);
        }
        if retraced {
            go(&mut rig, Command::Retrace);
            assert!(rig.session.status().setpoint[0] < 10.0);
        }
        go(&mut rig, Command::Stop);
        assert_eq!(rig.session.status().tool, tool);
        let told = Event::ToolNotChanged { asked: 2, tool: 1 };
        assert_eq!(rig.events.contains(&told), typed.is_none());
        mdi(&mut rig, "G4 P0.01");
        assert_eq!(rig.session.status().tool, tool, "typed lines begin with it");
        mdi(&mut rig, "G90 G0 X#5400");
        assert_eq!(
            rig.session.status().setpoint[0],
            f64::from(tool),
            "and count it"
        );
    }
}

/// An axis that rests on its way for want of speed says so.
#[test]
fn a_rapid_override_of_0_is_told_of_a_jog() {
    let mut rig = staying_on();
    rig.command(Command::Jog(Jog::By {
        axis: AxisLetter::X,
        distance: 100.0,
        speed: Some(10.0),
    }));
    (0..20).for_each(|_| assert!(rig.step()));
    rig.command(Command::RapidOverride(Override::To(0.0)));
    (0..100).for_each(|_| assert!(rig.step()));
    let waiting = rig.session.status().waiting;
    let waiting = waiting.map(|it| it.describe(|_| "")).unwrap_or_default();
    assert_eq!(waiting, "the rapid override is 0: raise it to go on");
}

/// Also of a machine that is switched on for it: what is safe where it is on stays on.
#[test]
fn the_one_program_of_a_machine_begins_at_a_line_with_what_is_safe() {
    let (enable, rest) = WIRED
        .split_once("[[input]]\nname = \"enable\"")
        .expect("it has one");
    let (_, rest) = rest.split_once("[[input]]").expect("and another one");
    let wired = format!("{enable}[[input]]{rest}");
    let folder = Folder::new();
    let machine = folder.file(
        "machine.toml",
        &machine_with("portal", &[("[machine]\n", &wired)]),
    );
    let program = folder.file(
        "part.ngc",
        "G21 G90 F3000\nM64 P2\nG1 X10\nM65 P1\nG1 X20\nG1 X30\nM2\n",
    );
    for (from, goes_off) in [(None, true), (Some("6"), false)] {
        let mut validate = syncline();
        validate
            .args(["validate", "--verbose"])
            .args([&machine, &program]);
        validate.args(from.map(|line| ["--from-line", line]).into_iter().flatten());
        let output = validate.output().unwrap();
        let (code, told, errors) = ended(&output);
        let told = format!("{told}{errors}");
        assert_eq!(code, 0, "{told}");
        assert_eq!(told.contains("output \"clamp\" off"), goes_off, "{told}");
    }
}
