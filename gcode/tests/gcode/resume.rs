//! Beginning in the middle of a program.

use syncline_gcode::{Action, Command, Interpreter, Point, Setup};

use super::listing::{show_all, xyz};

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
    match program.start_at_line(line) {
        Ok(()) => {
            let state = format!("{}\n{:?}\n", program.modes(), &program.position().0[..3]);
            state + &show_all(program)
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

fn motions(commands: &[Command]) -> Vec<&Command> {
    let moves = |command: &&Command| {
        matches!(
            command.action,
            Action::Rapid { .. } | Action::Feed { .. } | Action::Arc { .. }
        )
    };
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
        begun.start_at_line(line).unwrap();
        let position = begun.position();
        let commands: Vec<Command> = begun.collect::<Result<_, _>>().unwrap();
        let rest = whole.partition_point(|command| command.span.line < line);
        let (rest, commands) = (motions(&whole[rest..]), motions(&commands));
        let approach = commands.len() - rest.len();
        assert_eq!(commands[approach..], rest, "line {line}");
        assert!(approach <= 2, "line {line}");
        if let Some(last) = commands[..approach].last() {
            let to = match &last.action {
                Action::Rapid { to } | Action::Feed { to, .. } => *to,
                other => panic!("line {line}: {other:?}"),
            };
            assert_eq!(to, position, "line {line}");
        }
    }
}
