//! What lives from one program, or typed line, to the next.

use proptest::prelude::*;
use proptest::sample::select;
use syncline_gcode::{Action, Command, Interpreter, Memory, Point, Setup, Tables, Tool, Turning};

use super::listing::xyz;

/// A machine with one tool, whose length is 7 mm.
fn setup() -> Setup {
    let mut setup = xyz();
    let tool = Tool {
        offset: Point::xyz(0.0, 0.0, 7.0),
        ..Tool::default()
    };
    setup.tables.tools.insert(1, tool);
    setup.typed = true;
    setup
}

/// Runs lines from where the machine stands; where they lead, and what they leave.
fn run(text: &str, setup: &Setup) -> (Vec<Action>, Point, Memory, Tables) {
    let mut program = Interpreter::from_text("lines", text, setup.clone());
    let actions = program.by_ref().map(|command| {
        let Command { action, .. } = command.unwrap_or_else(|error| panic!("{text}\n{error}"));
        action
    });
    let actions = actions.filter(|action| *action != Action::End).collect();
    let (at, tables) = (program.position(), program.tables().clone());
    (actions, at, program.memory(), tables)
}

const LINES: [&str; 30] = [
    "G0 X1 Y2",
    "G1 X3 F100",
    "Z-1",
    "X4 Z2",
    "G2 X5 Y5 I2",
    "G17",
    "G18",
    "G20",
    "G21",
    "G90",
    "G91",
    "G54",
    "G55",
    "G59.3",
    "G10 L2 P1 X3",
    "G10 L20 P0 X0 Y1",
    "G92 X1",
    "G92.1",
    "G92.2",
    "G92.3",
    "G52 Z2",
    "F300",
    "S1000 M3",
    "M8",
    "M9",
    "T1 M6",
    "G43 H1",
    "G49",
    "G64 P0.1",
    "#1=[#1+1]",
];

proptest! {
    /// Typed one by one, lines do what they do together.
    #[test]
    fn lines_go_on_where_the_ones_before_left(
        lines in prop::collection::vec(select(&LINES[..]), 1..20),
    ) {
        let together = lines.join("\n");
        let mut probe = Interpreter::from_text("lines", together.as_str(), setup());
        prop_assume!(probe.by_ref().all(|it| it.is_ok()));
        let (wanted, at, memory, tables) = run(&together, &setup());
        let mut one_by_one = setup();
        let mut actions = Vec::new();
        for line in &lines {
            let (these, at, memory, tables) = run(line, &one_by_one);
            actions.extend(these);
            one_by_one.start = at;
            one_by_one.memory = memory;
            one_by_one.tables = tables;
        }
        prop_assert_eq!(actions, wanted);
        prop_assert_eq!(one_by_one.start, at);
        prop_assert_eq!(one_by_one.memory.modes(), memory.modes());
        prop_assert_eq!(one_by_one.memory.coordinates(&tables), memory.coordinates(&tables));
        prop_assert_eq!(one_by_one.tables, tables);
    }

    /// A program that names its units, feed, path mode and tool length does the same whatever was typed before; offsets that were set
    /// in the tables are set.
    #[test]
    fn a_program_begins_as_it_does_on_a_machine_that_was_just_switched_on(
        lines in prop::collection::vec(select(&LINES[..]), 0..20),
    ) {
        let mut typed = Interpreter::from_text("lines", lines.join("\n").as_str(), setup());
        prop_assume!(typed.by_ref().all(|it| it.is_ok()));
        let (memory, tables) = (typed.memory(), typed.tables().clone());
        let program = "G21 G49 G64 P0.1 F500 S1000 M3 M9\nG0 X1 Y2\nG1 Z-3\nG2 X3 Y2 I1\nG81 X4 Z-1 R1\nM2";
        let mut behind = Setup { memory, tables, typed: false, ..setup() };
        behind.memory.begin_program();
        behind.memory.stop();
        prop_assert_eq!(behind.memory.unlike_fresh().reset, Vec::<String>::new());
        let fresh = Setup { memory: Memory::default(), ..behind.clone() };
        let tool = |action: &Action| !matches!(action, Action::End);
        let (behind, ..) = run(program, &behind);
        let (fresh, ..) = run(program, &fresh);
        prop_assert_eq!(
            behind.into_iter().filter(tool).collect::<Vec<_>>(),
            fresh.into_iter().filter(tool).collect::<Vec<_>>()
        );
    }
}

/// Lines that are typed while a program is held on a compensated contour have nothing of it but its modes.
#[test]
fn lines_beside_a_compensated_contour_are_typed() {
    let program = Setup {
        typed: false,
        ..setup()
    };
    let text = "G41.1 D4 G1 X20 F100\nX40\nY20\nX0\nG40 Y30\nM2";
    let mut program = Interpreter::from_text("program", text, program);
    let first = program.next();
    assert!(first.is_some_and(|it| it.is_ok()));
    let held = Setup {
        memory: program.memory(),
        ..setup()
    };
    for text in ["G0 Z5", "G10 L20 P0 X0", "G40 G0 X5", "G91 G1 X1 F50"] {
        run(text, &held);
    }
}

/// The block that follows on a contour is not known where lines are typed.
#[test]
fn typed_lines_end_without_cutter_compensation() {
    for text in [
        "G41.1 D4",
        "G42.1 D4 G1 X20 F100",
        "G41.1 D4 G1 X20 F100\nY20",
    ] {
        let mut lines = Interpreter::from_text("lines", text, setup());
        let error = lines.find_map(Result::err).expect(text);
        assert!(error.to_string().contains("end with G4"), "{error}");
        let program = Setup {
            typed: false,
            ..setup()
        };
        let mut program = Interpreter::from_text("program", text, program);
        assert!(program.all(|it| it.is_ok()), "{text}");
    }
    run("G41.1 D4 G1 X20 F100\nY20\nG40 X30", &setup());
}

#[test]
fn the_end_of_a_program_resets_what_rs_274_says_and_nothing_else() {
    let program = "G18 G20 G91 G55 G64 G93 S900 M3 M8 T1 M6 G43 H1 #5=6\nG92 X1\n";
    for (end, typed, resets) in [
        ("M2", true, true),
        ("M30", true, true),
        ("", false, true),
        ("", true, false),
    ] {
        let setup = Setup { typed, ..setup() };
        let (_, _, memory, tables) = run(&format!("{program}{end}"), &setup);
        let modes = memory.modes().to_string();
        let expected = if resets {
            "G1 G17 G20 G40 G43 G54 G90 G91.1 G94 G98 G64 S900 M5 M9 T1 M6"
        } else {
            "G80 G18 G20 G40 G43 G55 G91 G91.1 G93 G98 G64 S900 M3 M8 T1 M6"
        };
        assert_eq!(modes, expected, "{end:?}");
        let shift = if resets { 0.0 } else { 25.4 };
        let offset = memory.coordinates(&tables).origin[syncline_gcode::AxisLetter::X];
        assert!((offset.abs() - shift).abs() < 1e-9, "{end:?}: {offset}");
        let next = Setup {
            memory,
            tables,
            typed: true,
            ..setup
        };
        let (actions, ..) = run("G90 G21 G53 G0 X#5", &next);
        assert!(
            actions.contains(&Action::Rapid {
                to: Point::xyz(6.0, 0.0, 0.0)
            }),
            "{actions:?}"
        );
    }
}

#[test]
fn another_tool_has_another_length() {
    let (_, _, mut memory, tables) = run("T1 M6 G43 H1 M3 S10", &setup());
    assert_eq!(
        memory.coordinates(&tables).origin,
        Point::xyz(0.0, 0.0, 7.0)
    );
    memory.tool_is(1);
    assert_eq!(
        memory.coordinates(&tables).origin,
        Point::xyz(0.0, 0.0, 7.0)
    );
    memory.tool_is(2);
    assert_eq!(memory.coordinates(&tables).origin, Point::ZERO);
    assert_eq!(
        (memory.modes().tool, memory.modes().tool_length),
        (2, false)
    );
    assert_eq!(memory.modes().spindle.turning, Turning::Clockwise);
}
