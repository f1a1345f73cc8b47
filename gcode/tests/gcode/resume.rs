//! Beginning in the middle of a program.

use proptest::prelude::*;
use proptest::sample::select;
use syncline_gcode::{
    Action, Answer, Command, InEffect, Interpreter, Output, Place, Point, Probed, Setup,
};

use super::listing::{begun_at, show_actions, show_all, xyz};

const PROGRAM: &str = "\
G21 G90 G17 G61
T4 M6
S9000 M3 M8
G0 X10 Y20
Z-2
#1 = 0
o1 while [#1 LT 3]
  #1 = [#1 + 1]
  G1 X[10 * #1] F600
o1 endwhile
G20 G91 G55
G1 X1
M2
o9 sub
G0 X0
o9 endsub
";

fn started_at(line: u32, setup: Setup) -> String {
    let mut program = Interpreter::from_text("part.ngc", PROGRAM, setup);
    match begun_at(&mut program, line) {
        Ok(first) => {
            let state = format!("{}\n{:?}\n", program.modes(), &program.position().0[..3]);
            state + &show_actions(line, &first) + &show_all(program)
        }
        Err(error) => format!("{error}\n"),
    }
}

#[test]
fn the_state_is_rebuilt() {
    let mut text = String::new();
    for line in [1, 5, 9, 10, 12] {
        text += &format!("line {line}\n{}", started_at(line, xyz()));
    }
    insta::assert_snapshot!(text);
}

#[test]
fn the_way_there_goes_up_first_and_down_last() {
    let mut setup = xyz();
    setup.start = Point::xyz(1.0, 1.0, -5.0);
    let up = started_at(12, setup.clone());
    setup.start = Point::xyz(1.0, 1.0, 5.0);
    insta::assert_snapshot!(up + &started_at(12, setup));
}

#[test]
fn a_line_that_is_not_met() {
    let mut text = String::new();
    for line in [14, 15, 99] {
        text += &started_at(line, xyz());
    }
    insta::assert_snapshot!(text);
}

fn is_motion(action: &Action) -> bool {
    matches!(
        action,
        Action::Rapid { .. } | Action::Feed { .. } | Action::Arc { .. }
    )
}

fn motions(commands: &[Command]) -> Vec<&Command> {
    let moves = |command: &&Command| is_motion(&command.action);
    commands.iter().filter(moves).collect()
}

/// Begun at any line of a whole part, the rest of the program is what it is from the beginning.
#[test]
fn what_follows_is_the_rest_of_the_program() {
    let text = include_str!("../../../examples/portal/bracket.ngc");
    let part = || Interpreter::from_text("bracket.ngc", text, xyz());
    let whole: Vec<Command> = part().collect::<Result<_, _>>().unwrap();
    let lines = text.lines().count() as u32;
    for line in (1..lines - 2).step_by(7) {
        let mut begun = part();
        let mut approach = begun_at(&mut begun, line).unwrap();
        approach.retain(is_motion);
        let position = begun.position();
        let commands: Vec<Command> = begun.collect::<Result<_, _>>().unwrap();
        let rest = whole.partition_point(|command| command.span.line < line);
        assert_eq!(motions(&commands), motions(&whole[rest..]), "line {line}");
        assert!(approach.len() <= 2, "line {line}");
        if let Some(last) = approach.last() {
            let to = match last {
                Action::Rapid { to } | Action::Feed { to, .. } => *to,
                other => panic!("line {line}: {other:?}"),
            };
            assert_eq!(to, position, "line {line}");
        }
    }
}

/// What a machine has switched.
#[derive(Clone, Debug, Default, PartialEq)]
struct Switched {
    digital: [bool; 3],
    analog: [f64; 2],
    with_motion: Vec<Output>,
    at: Point,
}

impl Switched {
    fn obey(&mut self, action: &Action) {
        let set = |it: &mut Self, output: &Output| match *output {
            Output::Digital { number, on, .. } => it.digital[usize::from(number)] = on,
            Output::Analog { number, value, .. } => it.analog[usize::from(number)] = value,
            Output::User { .. } => {}
        };
        match action {
            Action::Output(output) if output.is_with_motion() => self.with_motion.push(*output),
            Action::Output(output) => set(self, output),
            Action::Rapid { to } | Action::Feed { to, .. } if *to != self.at => {
                self.at = *to;
                for output in std::mem::take(&mut self.with_motion) {
                    set(self, &output);
                }
            }
            _ => {}
        }
    }

    /// After each command behind the message, of a program that is set up by these actions.
    fn behind_message(set_up: Vec<Action>, program: Interpreter) -> Vec<([bool; 3], [f64; 2])> {
        let (mut switched, mut met, mut behind) = (Self::default(), false, Vec::new());
        let commands = program.map(|command| command.expect("a right program").action);
        for action in set_up.into_iter().chain(commands) {
            switched.obey(&action);
            met |= matches!(action, Action::Message(_));
            if met {
                behind.push((switched.digital, switched.analog));
            }
        }
        behind
    }
}

fn blocks() -> impl Strategy<Value = Vec<String>> {
    let output = prop_oneof![
        (62..=65, 0..3).prop_map(|(code, number)| format!("M{code} P{number}")),
        (67..=68, 0..2, -9..9).prop_map(|(code, number, to)| format!("M{code} E{number} Q{to}")),
    ];
    // Also moves to where the machine is already, with which nothing is switched.
    let other = select(
        &[
            "G1 X1 F600",
            "X2",
            "G0 X0",
            "G0 Z1 Y2",
            "G4 P1",
            "M100 P1",
            "M3 S7",
        ][..],
    );
    let block = prop_oneof![3 => output, 2 => other.prop_map(str::to_owned)];
    prop::collection::vec(block, 1..40)
}

proptest! {
    /// Outputs are, at the line and behind it, what they are in a whole run, also those that wait for a motion.
    #[test]
    fn outputs_are_what_a_whole_run_makes_of_them(mut blocks in blocks(), part in 0.0..1.0_f64) {
        let line = (part * blocks.len() as f64) as usize;
        blocks.insert(line, "(MSG, here)".to_owned());
        let text = "G1 F600\n".to_owned() + &blocks.join("\n");
        let program = || Interpreter::from_text("part.ngc", text.as_str(), xyz());
        let mut begun = program();
        let set_up = begun_at(&mut begun, line as u32 + 2).expect("a line of the program");
        let whole = Switched::behind_message(Vec::new(), program());
        prop_assert_eq!(Switched::behind_message(set_up, begun), whole);
    }
}

/// A subroutine above the main program, and a branch that is not taken: the line counts where it is met, not where it is read
/// over.
#[test]
fn a_line_that_is_read_over_is_not_met() {
    let subroutine = "G21 G90 G0 X-50 F300\no<hole> sub\nG0 X#1 Y0\nG1 Z-5 F300\nG0 Z5\no<hole> endsub\n\
                      G0 X0 Y0 Z5\nG1 X40\no<hole> call [10]\nM2";
    let branch = "o1 if [0]\nG0 X1\no1 else\nG0 X2\no1 endif\nG0 X3\nM2";
    let late = "#1 = 0\no1 while [#1 LT 2]\no2 if [#1 EQ 1]\nG0 X7\no2 endif\n#1 = [#1 + 1]\nG0 X[#1]\no1 endwhile\nM2";
    let lines = |text: &str, line: u32| -> Result<(Vec<u32>, Point), String> {
        let mut program = Interpreter::from_text("part.ngc", text, xyz());
        begun_at(&mut program, line).map_err(|error| error.to_string())?;
        let at = program.position();
        let commands: Vec<Command> = program.collect::<Result<_, _>>().unwrap();
        Ok((
            commands.iter().map(|command| command.span.line).collect(),
            at,
        ))
    };
    assert_eq!(
        lines(subroutine, 4).unwrap(),
        (vec![4, 5, 10], Point::xyz(10.0, 0.0, 5.0))
    );
    assert_eq!(lines(subroutine, 8).unwrap().0, [8, 3, 4, 5, 10]);
    // Where reading over ends it goes on behind.
    assert_eq!(lines(subroutine, 6).unwrap().0, [7, 8, 3, 4, 5, 10]);
    assert_eq!(lines(branch, 3).unwrap().0, [4, 6, 7]);
    assert!(lines(branch, 2).unwrap_err().contains("comes to"));
    assert_eq!(
        lines(late, 4).unwrap(),
        (vec![4, 7, 9], Point::xyz(1.0, 0.0, 0.0))
    );
}

/// A machine with a probe and the input P5.
fn asked() -> Setup {
    let mut setup = xyz();
    setup.has_probe = true;
    setup.inputs = 1 << 5;
    setup
}

/// The commands of a program to its end, of a machine that answers so, from the first of these answers on.
fn told(program: &mut Interpreter, answers: &[Answer]) -> Vec<Action> {
    let mut answers = answers.iter();
    let mut actions = Vec::new();
    loop {
        if program.awaits_machine() {
            match answers.next().expect("as many as are asked for") {
                Answer::Probed(probed) => program.probed(*probed),
                Answer::Signals {
                    signals,
                    input_result,
                } => program.signals_read(signals.clone(), *input_result),
            }
        }
        match program.next() {
            Some(command) => actions.push(command.unwrap().action),
            None if program.awaits_machine() => {}
            None => return actions,
        }
    }
}

fn is_question(action: &&Action) -> bool {
    matches!(action, Action::Probe { .. } | Action::ReadSignals { .. })
}

proptest! {
    /// What a machine has answered before it is told again: from any place the rest of the program is as it was.
    #[test]
    fn what_was_answered_is_not_asked_again(
        lines in prop::collection::vec(select(vec![
            "G91 G38.3 X5 F100", "G91 G38.3 Y-4 F100", "#1 = [#1 + #5061]", "M66 P5 L0", "G90 G0 Z[#5399]",
            "G90 G0 X#1 Y[#5062 / 2]", "G10 L20 P1 X0", "G90 G1 Z-1 F200", "M64 P1", "M62 P2", "o1 if [#5070 EQ 1]\nG0 Z1\no1 endif",
        ]), 1..14),
        results in prop::collection::vec((any::<bool>(), -3.0..3.0f64), 28),
    ) {
        // Each conditional has a number of its own.
        let lines = lines.iter().enumerate().map(|(at, line)| line.replace("o1", &format!("o{}", at + 1)));
        let text = format!("G21 G94 G90\n{}\nM2\n", lines.collect::<Vec<_>>().join("\n"));
        let part = || Interpreter::from_text("part.ngc", text.as_str(), asked());
        let mut answers = Vec::new();
        let mut whole = Vec::new();
        let mut program = part();
        let mut results = results.into_iter().cycle();
        loop {
            match program.next() {
                Some(command) => whole.push(command.unwrap().action),
                None if program.awaits_search() => {
                    let (touches, at) = results.next().expect("without end");
                    let at = Point::xyz(at, at / 2.0, 0.0);
                    let probed = Probed { contact: touches.then_some(at), at };
                    program.probed(probed);
                    answers.push(Answer::Probed(probed));
                }
                None if program.awaits_signals() => {
                    let (on, _) = results.next().expect("without end");
                    let input_result = f64::from(u8::from(on));
                    program.signals_read(Vec::new(), input_result);
                    answers.push(Answer::Signals { signals: Vec::new(), input_result });
                }
                None => break,
            }
        }
        for passed in 0..whole.len() {
            let mut program = part();
            let place = Place { passed: passed as u64, known: None };
            let entry = program.enter_at(&place, Point::ZERO, &InEffect::default(), &answers).unwrap();
            let asked = whole[..passed].iter().filter(is_question).count();
            prop_assert_eq!(entry.answered, asked);
            prop_assert_eq!(&told(&mut program, &answers[asked..]), &whole[passed..], "{}", text);
            // With one answer less it cannot be known.
            if let Some(fewer) = asked.checked_sub(1) {
                let entered = part().enter_at(&place, Point::ZERO, &InEffect::default(), &answers[..fewer]);
                prop_assert!(entered.is_err());
            }
        }
    }
}
