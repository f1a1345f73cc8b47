//! `#<_hal[…]>` and `#<_ini[…]…>`: what programs read of the machine by its names, and when.

use proptest::prelude::*;
use proptest::sample::select;
use std::sync::Arc;
use syncline_gcode::{
    Action, AxisLetter, Error, InEffect, Interpreter, MachineNames, Place, Point, Setup,
};

use super::listing::{refusals_with, run_with, xyz};

const SIGNALS: [&str; 5] = ["Part here", "door", "clamp", "twice", "Twice"];

fn named() -> Setup {
    let value = |table: &str, key: &str, value| (table.to_owned(), key.to_owned(), value);
    let values = [
        value("axis.X", "max_velocity", Some(700.0)),
        value("axis.X", "soft_limits[1]", Some(1500.0)),
        value("axis.X", "drive_soft_limits", Some(1.0)),
        value("machine", "name", None),
    ];
    let mut setup = xyz();
    setup.names = Arc::new(MachineNames::new(SIGNALS.into_iter(), values.into_iter()));
    setup
}

/// Runs a program of which each reading finds the next of `found`, and then the last one: where it went, and in which
/// lines it read.
fn read(program: &str, found: &[[f64; 3]]) -> Result<(Vec<[f64; 3]>, Vec<u32>), Error> {
    let mut interpreter = Interpreter::from_text("part.ngc", program, named());
    let (mut went, mut lines) = (Vec::new(), Vec::new());
    loop {
        while let Some(command) = interpreter.next() {
            let command = command?;
            match command.action {
                Action::Rapid { to } => {
                    went.push([to[AxisLetter::X], to[AxisLetter::Y], to[AxisLetter::Z]])
                }
                Action::ReadSignals { .. } => {
                    lines.push(command.span.line);
                    assert!(interpreter.awaits_signals() && interpreter.next().is_none());
                }
                _ => {}
            }
        }
        if !interpreter.awaits_machine() {
            return Ok((went, lines));
        }
        let [part, door, clamp] = found[(lines.len() - 1).min(found.len() - 1)];
        interpreter.signals_read(vec![part, door, clamp, 0.0, 0.0], 0.0);
    }
}

#[test]
fn values_of_the_machine_file_are_known_at_once() {
    let program = "G0 X[#<_ini[axis.X]max_velocity> / 100] Y#<_INI[ Axis.x ]soft_limits[1]>\n\
                   G0 Z[EXISTS[#<_ini[axis.X]drive_soft_limits>] + EXISTS[#<_ini[axis.Y]max_velocity>]]\nM2\n";
    let (went, lines) = read(program, &[]).unwrap();
    assert_eq!(went, [[7.0, 1500.0, 0.0], [7.0, 1500.0, 1.0]]);
    assert_eq!(lines, []);
}

#[test]
fn each_block_that_reads_inputs_waits_for_them() {
    let program = "\
#1 = #<_hal[Part Here]>
G0 X#1 Y[#<_hal[door]> + #<_hal[clamp]>]
o1 if [#<_hal[door]>]
  G0 Z1
o1 elseif [#<_hal[clamp]>]
  G0 Z2
o1 else
  G0 Z3
o1 endif
o2 if [#1 EQ 0]
  G0 Z4
o2 elseif [#<_hal[clamp]>]
  G0 Z5
o2 else
  G0 Z6
o2 endif
o3 while [#<_hal[part here]>]
  G0 Z7
o3 endwhile
o4 do
  G0 Z8
  o5 if [#<_hal[door]>]
    o4 continue
  o5 endif
  G0 Z9
o4 while [#<_hal[clamp]>]
o6 repeat [#<_hal[door]> + 1]
  G0 Z10
o6 endrepeat
(debug, clamp #<_hal[clamp]>)
G0 Z[EXISTS[#<_hal[door]>] + EXISTS[#<_hal[dor]>]]
M2
";
    let off = [0.0; 3];
    let found = [
        [1.0, 0.0, 0.0],
        [0.0, 2.0, 3.0],
        [0.0, 0.0, 1.0],
        [1.0, 0.0, 1.0],
        [1.0, 0.0, 0.0],
        off,
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        off,
        off,
        [0.0, 1.0, 0.0],
        off,
    ];
    let (went, lines) = read(program, &found).unwrap();
    let heights: Vec<f64> = went.iter().map(|point| point[2]).collect();
    assert_eq!(went[0], [1.0, 5.0, 0.0]);
    // The ELSEIF of o1 hangs on what its IF read, that of o2 reads for itself.
    let climbed = [0.0, 2.0, 5.0, 7.0, 8.0, 8.0, 9.0, 10.0, 10.0, 1.0];
    assert_eq!(heights, climbed, "{lines:?}");
    assert_eq!(lines, [1, 2, 3, 12, 17, 17, 22, 26, 22, 26, 27, 30]);
}

#[test]
fn a_message_shows_what_was_found() {
    let text = "(debug, door #<_hal[door]>, #<_hal[dor]>)\n(msg, #<_hal[door]>)\nM2\n";
    let mut program = Interpreter::from_text("part.ngc", text, named());
    assert!(
        matches!(program.next(), Some(Ok(it)) if matches!(it.action, Action::ReadSignals { .. }))
    );
    program.signals_read(vec![0.0, 1.0, 0.0, 0.0, 0.0], 0.0);
    let told: Vec<String> = program
        .filter_map(|command| match command.unwrap().action {
            Action::Message(text) => Some(text),
            _ => None,
        })
        .collect();
    assert_eq!(told, ["door 1, #<_hal[dor]>", "#<_hal[door]>"]);
}

#[test]
fn what_cannot_be_is_refused() {
    let refused = refusals_with(
        &named(),
        &[
            ("G0 X#<_hal[dor]>", "1:5"),
            ("G0 X#<_hal[twice]>", "1:5"),
            ("G0 X#<_ini[axis.X]max_velocty>", "1:5"),
            ("G0 X#<_ini[machine]name>", "1:5"),
            ("#<_hal[clamp]> = 1", "1:1"),
            ("#<_ini[axis.X]max_velocity> = 1", "1:1"),
            ("G41.1 D2 G0 X5\nG0 X#<_hal[door]>", "2:1"),
        ],
    );
    insta::assert_snapshot!(refused);
    // A machine without any has no nearest one.
    let refused = refusals_with(&xyz(), &[("G0 X#<_hal[door]>", "1:5")]);
    assert!(
        refused.contains("there is nothing of the kind"),
        "{refused}"
    );
    // Behind a reading nothing is known; at it everything is.
    let text = "G0 X1\nG0 X#<_hal[door]>\nM2\n";
    let mut program = Interpreter::from_text("part.ngc", text, named());
    let error = program.enter_at_line(3).unwrap_err().to_string();
    assert!(
        error.contains("line 3 is behind a block with #<_hal"),
        "{error}"
    );
    let mut program = Interpreter::from_text("part.ngc", text, named());
    assert!(program.enter_at_line(2).is_ok());

    // So it is where the program was interrupted.
    let mut program = Interpreter::from_text("part.ngc", text, named());
    let read = program.by_ref().take_while(|it| it.is_ok()).last();
    assert!(matches!(read, Some(Ok(it)) if matches!(it.action, Action::ReadSignals { .. })));
    let reading = program.passed() - 1;
    let enter = |passed| {
        let mut program = Interpreter::from_text("part.ngc", text, named());
        let known = None;
        program.enter_at(
            &Place { passed, known },
            Point::default(),
            &InEffect::default(),
            &[],
        )?;
        program.next().expect("more comes")
    };
    assert!(matches!(
        enter(reading).unwrap().action,
        Action::ReadSignals { .. }
    ));
    let error = enter(reading + 1).unwrap_err().to_string();
    assert!(error.contains("behind a block with #<_hal"), "{error}");
}

/// Blocks that may read, in all statements that do, with a mark for each name.
fn blocks() -> impl Strategy<Value = String> {
    let value = select(vec!["@part here@", "@door@", "@clamp@", "#1", "2"]);
    let values = (value.clone(), value).prop_map(|(a, b)| format!("[{a} + {b} EQ 2]"));
    let plain = prop_oneof![
        values.clone().prop_map(|it| format!("G0 X{it}\n")),
        values
            .clone()
            .prop_map(|it| format!("G0 Y{it} Z[1 + {it}] (debug, @door@)\n")),
        values.clone().prop_map(|it| format!("#1 = {it}\n")),
        values.clone().prop_map(|it| format!("/G0 X[3 + {it}]\n")),
        values.clone().prop_map(|it| format!("o<f> call {it}\n")),
    ];
    let body = move |inner: BoxedStrategy<String>| {
        let several = prop::collection::vec(inner, 0..4).prop_map(|blocks| blocks.concat());
        (
            several.clone(),
            several,
            values.clone(),
            values.clone(),
            0..6u8,
        )
            .prop_map(|(one, other, first, second, kind)| match kind {
                0 => format!("@o if {first}\n{one}@o else\n{other}@o endif\n"),
                1 => format!("@o if {first}\n{one}@o elseif {second}\n{other}@o endif\n"),
                2 => format!(
                    "@o if [0]\n@o elseif {first}\n{one}@o elseif {second}\n{other}@o endif\n"
                ),
                3 => format!("@o repeat [1 + {first}]\n{one}@o endrepeat\n"),
                4 => format!(
                    "@o while [[#31 LT 40] AND {first}]\n#31 = [#31 + 1]\n{one}@o endwhile\n"
                ),
                _ => format!(
                    "@o do\n#31 = [#31 + 1]\n{one}@x if {second}\n@o continue\n@x endif\n\
                     @e while [[#31 LT 40] AND {first}]\n"
                ),
            })
    };
    let nested = plain.prop_recursive(3, 24, 4, move |inner| body(inner.boxed()));
    prop::collection::vec(nested, 1..6).prop_map(|blocks| blocks.concat())
}

/// Every O-word with a label of its own: `@o` begins or ends what is innermost, `@e` ends a DO, `@x` the branch in it.
fn labelled(text: &str) -> String {
    let (mut open, mut next, mut labelled) = (Vec::new(), 10, String::new());
    for line in text.lines() {
        let Some((mark, statement)) = line.strip_prefix('@').and_then(|it| it.split_once(' '))
        else {
            labelled += &format!("{line}\n");
            continue;
        };
        let begins = ["if ", "repeat ", "do", "while "].into_iter();
        if mark != "e" && begins.into_iter().any(|it| statement.starts_with(it)) {
            open.push(next);
            next += 1;
        }
        let outer = usize::from(statement == "continue");
        labelled += &format!("o{} {statement}\n", open[open.len() - 1 - outer]);
        if mark == "e" || ["endif", "endrepeat", "endwhile"].contains(&statement) {
            open.pop();
        }
    }
    labelled
}

proptest! {
    /// A program that reads goes where it would go if what it reads stood in it, whatever stands in the way: loops,
    /// branches, subroutines.
    #[test]
    fn what_is_read_is_as_good_as_written(
        text in blocks(),
        levels in prop::array::uniform3(select(vec![0.0, 1.0])),
    ) {
        let text = labelled(&text) + "o<f> sub\nG0 Y[5 + #1]\no<f> endsub\nM2\n";
        let (mut reads, mut says) = (text.clone(), text);
        for (name, level) in ["part here", "door", "clamp"].into_iter().zip(levels) {
            let mark = format!("@{name}@");
            reads = reads.replace(&mark, &format!("#<_hal[{name}]>"));
            says = says.replace(&mark, &format!("{level}"));
        }
        let (went, lines) = read(&reads, &[levels])?;
        let (meant, none) = read(&says, &[levels])?;
        prop_assert_eq!(went, meant, "{}", reads);
        prop_assert!(none.is_empty());
        prop_assert!(lines.is_empty() || reads.contains("_hal"));
        prop_assert!(run_with(named(), &says).is_ok());
    }
}
