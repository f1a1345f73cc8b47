//! All mistakes of a program: what is found behind the first one.

use proptest::prelude::*;
use syncline_gcode::{Interpreter, MAX_LINE, Setup, Tool};

use super::listing::xyz;

/// Blocks that a program may execute here.
const MAX_BLOCKS: u64 = 2000;

/// The line and the message of every mistake.
fn mistakes_with(mut setup: Setup, text: &str) -> Vec<(u32, String)> {
    setup.max_blocks = Some(MAX_BLOCKS);
    let mut program = Interpreter::from_text("part.ngc", text, setup);
    let mut mistakes = Vec::new();
    for _ in 0..20 * MAX_BLOCKS {
        match program.next() {
            None => return mistakes,
            Some(Ok(_)) => {}
            Some(Err(error)) => {
                mistakes.push((error.line, error.fault.to_string()));
                if !program.go_on(&error) {
                    return mistakes;
                }
            }
        }
    }
    panic!("no end of {text:?}: {:?}", &mistakes[..20]);
}

fn lines_of(text: &str) -> Vec<u32> {
    let mistakes = mistakes_with(xyz(), text);
    mistakes.into_iter().map(|(line, _)| line).collect()
}

#[test]
fn a_line_that_is_too_long_is_told_once() {
    for end in ["\n", "\r\n", "\r"] {
        let text = format!("G0 X1 ({}){end}G0 X1 Q3{end}M2", "x".repeat(3 * MAX_LINE));
        assert_eq!(lines_of(&text), [1, 2], "{end:?}");
    }
    // What has no line ends is no program: nothing is said of what is behind.
    let text = format!("G0 X1 Q3\n{}\nG0 X1 Q3\nM2", "\0".repeat(1 << 21));
    let mistakes = mistakes_with(xyz(), &text);
    assert_eq!(mistakes.len(), 2, "{mistakes:?}");
    assert!(
        mistakes[1].1.contains("is it the right file"),
        "{mistakes:?}"
    );
}

#[test]
fn all_that_a_compensated_contour_refuses_is_told() {
    let mut setup = xyz();
    let tool = Tool {
        diameter: 6.0,
        ..Tool::default()
    };
    setup.tables.tools.insert(1, tool);
    let forbidden = [
        "G18",
        "G55",
        "G28",
        "G53 G0 X1",
        "G81 X1 Z1 R2",
        "G92 X0",
        "G41 D1",
        "G43 H1",
    ];
    let text = format!(
        "F600 G41 D1 G1 X20\nX40\n{}\nY9\nG40 G1 X60\nG55\nG28\nG54\nM2",
        forbidden.join("\n")
    );
    let mistakes = mistakes_with(setup, &text);
    let lines: Vec<u32> = mistakes.iter().map(|(line, _)| *line).collect();
    let expected: Vec<u32> = (3..3 + forbidden.len() as u32).collect();
    assert_eq!(lines, expected, "{mistakes:#?}");
    for (_, message) in mistakes {
        assert!(message.contains("while G41 or G42 is on"), "{message}");
    }
}

#[test]
fn behind_a_mistake_in_the_flow_each_block_is_judged() {
    let behind = "G41.9\nG1 X X\nG0 G1 X1\nX1 X2\nA5\nG0 X1,5\nM[150 + 50]\nG#1 Y1 F100\no9 sub\nM2\nthis is no program";
    for (flow, first) in [
        ("o<x> cal", 1),
        ("o<nowhere> call", 1),
        ("o1 if [0]\nG0 X1\no1 endiff", 3),
        ("o1 endif", 1),
        ("M98 P77", 1),
        ("o1 if [1]\no2 whle [1]", 2),
    ] {
        let text = format!("{flow}\n{behind}");
        let before = flow.lines().count() as u32;
        let mut expected = vec![first];
        expected.extend((1..=7).map(|line| before + line));
        assert_eq!(lines_of(&text), expected, "{flow}");
    }
}

#[test]
fn a_branch_that_is_not_taken_stays_that_behind_a_mistake() {
    let text = "o1 if [0]\nX1,5\nM98 P7\no1 endif\nG41.9\nM2";
    assert_eq!(lines_of(text), [2, 5]);
}

/// Blocks good and bad, which may go together or not.
fn block() -> impl Strategy<Value = String> {
    let plain = prop::sample::select(vec![
        "G1 X1 F100",
        "G0 X1 Q3",
        "G41.5",
        "X1,5",
        "G41.1 D2",
        "G40",
        "G55",
        "G1 Y9",
        "/ G9",
        "%",
        "M2",
        "M99",
        "M98 P7",
        "O7",
        "O8",
        "#1 = [#1 + 1]",
        "G2 X1",
        "(",
        "M66 P77 L3 Q1",
        "G5.2 X1 Y1 F9",
        "G5.3",
        "M70",
        "M72",
    ]);
    let flow = (
        0..3_u32,
        prop::sample::select(vec![
            "if [0]",
            "if [1]",
            "else",
            "endif",
            "while [#1 LT 3]",
            "while [1]",
            "endwhile",
            "do",
            "repeat [3]",
            "endrepeat",
            "break",
            "sub",
            "endsub",
            "call",
            "return",
            "cal",
            "",
        ]),
    );
    prop_oneof![
        3 => plain.prop_map(str::to_owned),
        2 => flow.prop_map(|(label, statement)| format!("o{label} {statement}")),
        1 => Just("x".repeat(MAX_LINE + 1)),
    ]
}

proptest! {
    /// Whatever is written, its mistakes come to an end.
    #[test]
    fn the_mistakes_of_any_program_come_to_an_end(blocks in prop::collection::vec(block(), 1..30)) {
        mistakes_with(xyz(), &blocks.join("\n"));
    }
}

#[test]
fn a_spline_without_an_end_is_told_once() {
    assert_eq!(mistakes_with(xyz(), "G5.2 X1 Y1 F9").len(), 1);
}

#[test]
fn no_advice_about_a_comma_makes_another_number() {
    let meant = |text: &str| {
        let mistakes = mistakes_with(xyz(), &format!("F100 G1 {text}\nM2"));
        assert_eq!(mistakes.len(), 1, "{text}");
        mistakes[0].1.clone()
    };
    for (written, number) in [
        ("X1,5", "1.5"),
        ("X1 ,5", "1.5"),
        ("X 1, 5", "1.5"),
        ("X1 0 , 2 5 Y2", "10.25"),
        ("X,5", "0.5"),
        ("X-,5", "0.5"),
        ("X[1,5]", "1.5"),
        ("X[1 + ,5]", "0.5"),
    ] {
        let message = meant(written);
        assert!(
            message.ends_with(&format!("write `{number}`")),
            "{written}: {message}"
        );
    }
    for several in ["X1.5,3", "X1,000.5", "X1,000,5", "X,5,5"] {
        let message = meant(several);
        assert!(message.contains("no commas"), "{several}: {message}");
    }
    for none in ["X1, Y2", "X1,Y2", ", X1", "X1 ,"] {
        let message = meant(none);
        assert!(message.contains("remove it"), "{none}: {message}");
    }
}
