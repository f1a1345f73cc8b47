//! `#5399`: what the last M66 found, known where the machine has come to the block that asks.

use proptest::prelude::*;
use proptest::sample::select;
use syncline_gcode::{
    Action, AxisLetter, Error, InEffect, Interpreter, Memory, Place, Point, Setup, TakenInput,
};

use super::listing::{refusals_with, xyz};

/// A machine with P5 and E1.
fn wired() -> Setup {
    let mut setup = xyz();
    setup.inputs = 1 << 5;
    setup.analog_inputs = 1 << 1;
    setup
}

/// What a program did with a machine on which the n-th M66 found the n-th of `found`.
#[derive(Debug, Default, PartialEq)]
struct Run {
    /// X of each rapid.
    went: Vec<f64>,
    /// For each M66, whether the program asked at once what came of it.
    asked: Vec<bool>,
    /// How often the path came to rest to be asked.
    readings: usize,
}

fn run(program: &str, setup: Setup, found: &[f64]) -> Result<(Run, Memory), Error> {
    let mut interpreter = Interpreter::from_text("part.ngc", program, setup);
    let mut done = Run::default();
    let mut waits = false;
    loop {
        for command in interpreter.by_ref() {
            let action = command?.action;
            let asks = matches!(action, Action::ReadSignals { input_result: true });
            if std::mem::take(&mut waits) {
                done.asked.push(asks);
            }
            match action {
                Action::Rapid { to } => done.went.push(to[AxisLetter::X]),
                Action::AwaitInput(_) | Action::TakeInput(_) => waits = true,
                Action::ReadSignals { .. } => done.readings += 1,
                _ => {}
            }
        }
        if !interpreter.awaits_machine() {
            return Ok((done, interpreter.memory()));
        }
        let known = done.asked.len().checked_sub(1);
        interpreter.signals_read(Vec::new(), known.map_or(0.0, |at| found[at]));
    }
}

fn went(program: &str, found: &[f64]) -> Run {
    run(program, wired(), found).unwrap().0
}

#[test]
fn each_form_tells_what_it_found() {
    let done = went(
        "G0 X#5399\nM66 P5 L0\nG0 X[10 + #5399]\nM66 E1\nG0 X[20 + #5399]\nM66 E1 L0\n(debug, #5399)\n\
         M66 P5 L3 Q1\no1 if [#5399 EQ -1]\nG0 X40\no1 endif\nM66 P5 L4 Q0.5\nG0 X50\nG0 X[60 + #5399]\nM2\n",
        &[1.0, 2.5, 3.0, -1.0, 0.0],
    );
    assert_eq!(done.went, [0.0, 11.0, 22.5, 40.0, 50.0, 60.0]);
    // What comes before the block that asks is done whatever was found.
    assert_eq!(done.asked, [true, true, true, true, false]);
    assert_eq!(done.readings, 5);
}

/// It is asked for once, and by each kind of statement where it stands.
#[test]
fn it_is_known_until_the_next_one() {
    let program = "M66 P5 L0\n#1 = [#5399 + 1]\nG0 X#5399\no1 while [#5399 LT 3]\nG0 X[10 * #5399]\n\
                   M66 P5 L0\no1 endwhile\no2 repeat [#5399]\nG91 G0 X1\nG90\no2 endrepeat\nM2\n";
    let done = went(program, &[1.0, 2.0, 3.0]);
    assert_eq!(done.went, [1.0, 10.0, 20.0, 21.0, 22.0, 23.0]);
    assert_eq!(done.readings, 3);
}

#[test]
fn the_next_job_knows_it() {
    let (_, memory) = run("M66 P5 L0\nM2\n", wired(), &[1.0]).unwrap();
    let mut setup = wired();
    setup.memory = memory;
    let mut program = Interpreter::from_text("next.ngc", "G0 X#5399\nM2\n", setup);
    let asks = Action::ReadSignals { input_result: true };
    assert_eq!(program.next().unwrap().unwrap().action, asks);
    program.signals_read(Vec::new(), 1.0);
    let Action::Rapid { to } = program.next().unwrap().unwrap().action else {
        panic!("it moves")
    };
    assert_eq!(to[AxisLetter::X], 1.0);
}

#[test]
fn what_cannot_be_is_refused() {
    let refused = refusals_with(
        &wired(),
        &[
            ("M66 P5 L5", "1:8"),
            ("M66 P5 L0 Q1", "1:11"),
            ("M66 E0 L0", "1:5"),
            ("M66 E8", "1:5"),
            ("M66 E1 L1 Q1", "1:8"),
            ("M66 P5 L0\nG0 X#[5000 + 399]", "2:5"),
            ("M66 P5 L0\n#1 = 5399\nG0 X##1", "3:5"),
            ("G41.1 D2 G0 X5\nM66 P5 L0\nG0 X#5399", "3:1"),
            ("#5399 = 1", "1:1"),
        ],
    );
    insta::assert_snapshot!(refused);
}

/// An M66 that was passed has found nothing; one that was executed before the program was interrupted has.
#[test]
fn a_program_that_is_begun_behind_an_m66() {
    let text = "G0 X1\nM66 P5 L0\nG0 X2\nG0 X[3 + #5399]\nM2\n";
    let begun = |line| {
        let mut program = Interpreter::from_text("part.ngc", text, wired());
        program.enter_at_line(line).map(|_| program)
    };
    let mut program = begun(3).unwrap();
    program.next().unwrap().unwrap();
    let error = program.next().unwrap().unwrap_err().to_string();
    assert!(error.contains("before the line at which"), "{error}");
    let mut program = begun(2).unwrap();
    let takes = Action::TakeInput(TakenInput::Digital(5));
    assert_eq!(program.next().unwrap().unwrap().action, takes);

    let mut program = Interpreter::from_text("part.ngc", text, wired());
    let place = Place {
        passed: 2,
        known: None,
    };
    let entered = program.enter_at(&place, Point::default(), &InEffect::default(), &[]);
    entered.unwrap();
    program.next().unwrap().unwrap();
    let asks = Action::ReadSignals { input_result: true };
    assert_eq!(program.next().unwrap().unwrap().action, asks);
}

#[derive(Clone, Copy, Debug)]
enum Line {
    Take,
    Await,
    Read(&'static str),
    Move,
    Message,
}

fn line() -> impl Strategy<Value = Line> {
    prop_oneof![
        2 => Just(Line::Take),
        2 => Just(Line::Await),
        4 => select(vec![
            "G0 X[#1 + #5399]",
            "#2 = #5399\nG0 X[#1 + #2]",
            "o# if [#5399 GE 0]\nG0 X[#1 + #5399]\no# else\nG0 X[#1 - 1]\no# endif",
            "(debug, #5399) G0 X[#1 + #5399]",
        ]).prop_map(Line::Read),
        2 => Just(Line::Move),
        1 => Just(Line::Message),
    ]
}

proptest! {
    /// Wherever a program asks, it is told what the last M66 before found, and the path rests for it once.
    #[test]
    fn each_block_is_told_what_the_last_one_found(
        lines in prop::collection::vec(line(), 0..20),
        found in prop::collection::vec(select(vec![-1.0, 0.0, 1.0]), 20),
    ) {
        let mut text = String::new();
        let (mut wanted, mut asked, mut last) = (Vec::new(), Vec::<bool>::new(), 0.0);
        let (mut readings, mut is_known, mut directly) = (0, true, false);
        for (number, line) in lines.iter().enumerate() {
            let base = 100.0 * (number + 1) as f64;
            text += &format!("#1 = {base}\n");
            match line {
                Line::Take | Line::Await => {
                    last = found[asked.len()];
                    asked.push(false);
                    (is_known, directly) = (false, true);
                    text += if matches!(line, Line::Take) { "M66 P5 L0\n" } else { "M66 P5 L1 Q2\n" };
                }
                Line::Read(how) => {
                    text += &how.replace("o#", &format!("o{}", number + 1));
                    text += "\n";
                    readings += usize::from(!is_known);
                    if let Some(asked) = asked.last_mut().filter(|_| directly && !is_known) {
                        *asked = true;
                    }
                    (is_known, directly) = (true, false);
                    wanted.push(base + last);
                }
                Line::Move => {
                    directly = false;
                    wanted.push(base);
                    text += "G0 X#1\n";
                }
                Line::Message => {
                    directly = false;
                    text += "(msg, on)\n";
                }
            }
        }
        let done = went(&(text.clone() + "M2\n"), &found);
        prop_assert_eq!(done, Run { went: wanted, asked, readings }, "{}", text);
    }
}
