//! All mistakes of a program: what is found behind the first one.

use proptest::prelude::*;
use syncline_gcode::{Interpreter, MAX_LINE, Setup, Tool};

use super::listing::xyz;
use super::mistake_cases::machine;

/// Blocks that a program may execute here.
const MAX_BLOCKS: u64 = 2000;

/// The line and the message of every mistake.
pub(crate) fn mistakes_with(mut setup: Setup, text: &str) -> Vec<(u32, String)> {
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

/// What a comment says is no word that could not be read, and of the others the most is known.
#[test]
fn what_can_be_read_of_a_block_takes_effect() {
    let mut setup = xyz();
    setup.limits[0] = Some((-9.0, 9.0));
    for begins in [
        "G90 G54 G0 X0 Y0 Q3 (GROSS, XFY; S#7=)",
        "G90 G0 X0 Y0 F1,5 ; GO",
        "G0 X0 Y0 (",
        "G91 G0 X0 Y0 X1\nG90",
    ] {
        let text = format!("F600\n{begins}\nG1 X10\nX20\nM2");
        let told = mistakes_with(setup.clone(), &text);
        let limits = told.iter().filter(|(_, it)| it.contains("its soft limits"));
        assert_eq!(limits.count(), 2, "{text}: {told:?}");
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
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever is written, its mistakes come to an end.
    #[test]
    fn the_mistakes_of_any_program_come_to_an_end(blocks in prop::collection::vec(block(), 1..30)) {
        mistakes_with(xyz(), &blocks.join("\n"));
    }
}

/// How far the axes of a good program go, mm.
const TRAVEL: f64 = 100.0;

/// What a good program does next.
#[derive(Clone, Debug)]
enum Step {
    /// To a place: by which code if it is written, and which axes.
    Line(Option<&'static str>, [Option<f64>; 3]),
    /// A part of the way to a place, as increments.
    Increments([f64; 3]),
    /// About a centre that lies there from the start, by so many radians.
    Arc([f64; 2], f64, bool),
    /// A parameter, and a line to it.
    Parameter(f64),
    /// The present place is called that.
    Shift(f64),
    Unshift,
    Drill([f64; 2]),
    /// Twice forth and back.
    Repeat(f64),
    /// What is true.
    If,
    /// A full circle in a plane.
    Circle(&'static str),
    /// Holes, of which only the first has the cycle's words.
    Holes(&'static str, Vec<[f64; 2]>),
    /// A feed, a speed, a centre or a radius by a parameter.
    By(&'static str),
    Nurbs,
    Cubics,
    /// With G41 to G40.
    Contour,
    /// A tool and its length.
    Tool(bool, f64),
    /// A work offset of its own.
    Offset(f64),
    /// What is executed elsewhere sets the feed.
    Call(&'static str),
    /// Of a name with letters of words.
    Named(f64),
    /// Blanks within words, and a comment.
    Blanks(f64),
    Other(&'static str),
}

fn step() -> impl Strategy<Value = Step> {
    let place = -90.0..90.0_f64;
    let maybe = || prop::option::of(-90.0..90.0_f64);
    let code = prop::option::of(prop::sample::select(vec!["G0", "G1"]));
    let others = prop::sample::select(vec![
        "F700",
        "S900 M3",
        "M5",
        "G4 P0.1",
        "G64 P0.01",
        "G61",
        "M8",
        "M9",
        "G55",
        "G54",
        "G21",
        "G17",
        "M64 P1",
        "T2",
        "/ G91 X1.5 Y900",
        "/ G40 G1 Z500",
        "M70",
        "F650 (Go; Fx)",
    ]);
    prop_oneof![
        4 => (code, [maybe(), maybe(), maybe()]).prop_map(|(code, to)| Step::Line(code, to)),
        3 => [-0.9..0.9_f64, -0.9..0.9_f64, -0.9..0.9_f64].prop_map(Step::Increments),
        3 => ([-9.0..9.0_f64, 1.0..9.0_f64], 0.5..6.0_f64, any::<bool>())
            .prop_map(|(centre, by, turns)| Step::Arc(centre, by, turns)),
        2 => place.clone().prop_map(Step::Parameter),
        1 => place.prop_map(Step::Shift),
        1 => Just(Step::Unshift),
        1 => [-80.0..80.0_f64, -80.0..80.0_f64].prop_map(Step::Drill),
        1 => (1.0..9.0_f64).prop_map(Step::Repeat),
        1 => Just(Step::If),
        1 => prop::sample::select(vec!["G17", "G18", "G19"]).prop_map(Step::Circle),
        1 => (
            prop::sample::select(vec!["G81", "G82 P0.5", "G83 Q4.5", "G99 G81", "G73 Q3"]),
            prop::collection::vec([-80.0..80.0_f64, -80.0..80.0_f64], 1..4),
        )
            .prop_map(|(cycle, holes)| Step::Holes(cycle, holes)),
        2 => prop::sample::select(vec!["F", "S", "I", "R"]).prop_map(Step::By),
        1 => Just(Step::Nurbs),
        1 => Just(Step::Cubics),
        1 => Just(Step::Contour),
        1 => (any::<bool>(), 0.0..60.0_f64).prop_map(|(by_number, z)| Step::Tool(by_number, z)),
        1 => (-90.0..90.0_f64).prop_map(Step::Offset),
        1 => prop::sample::select(vec!["M98 P100", "o50 call [1]", "M98 P100 L2"]).prop_map(Step::Call),
        1 => (-90.0..90.0_f64).prop_map(Step::Named),
        1 => (-90.0..90.0_f64).prop_map(Step::Blanks),
        3 => others.prop_map(Step::Other),
    ]
}

/// A program without a mistake.
struct Good {
    blocks: Vec<String>,
    /// In the machine.
    at: [f64; 3],
    /// Where the program has its zero.
    zero: [f64; 3],
    is_incremental: bool,
    /// Which lines a block without a code goes along.
    is_line: bool,
}

impl Good {
    fn of(steps: &[Step]) -> Vec<String> {
        let mut good = Self {
            blocks: vec!["G21 G17 G90 G94 G40 G49 G80 F500 G0 X0 Y0 Z0".to_owned()],
            at: [0.0; 3],
            zero: [0.0; 3],
            is_incremental: false,
            is_line: true,
        };
        for (number, step) in steps.iter().enumerate() {
            good.go(number, step);
        }
        good.blocks
    }

    /// What stands behind each of them.
    const BEHIND: [&str; 7] = ["M2", "O100", "F300", "M99", "o50 sub", "F400", "o50 endsub"];

    /// A block to places in the machine, in the distance mode that is asked for.
    fn block(&mut self, code: &str, to: [Option<f64>; 3], is_incremental: bool) {
        let mut block = String::new();
        if is_incremental != self.is_incremental {
            block += if is_incremental { "G91 " } else { "G90 " };
            self.is_incremental = is_incremental;
        }
        block += code;
        for (axis, to) in to.into_iter().enumerate() {
            let Some(to) = to else { continue };
            let from = if is_incremental {
                self.at[axis]
            } else {
                self.zero[axis]
            };
            let written = ((to - from) * 1e4).round() / 1e4;
            self.at[axis] = from + written;
            block += &format!(" {}{written}", ["X", "Y", "Z"][axis]);
        }
        self.blocks.push(block);
    }

    fn go(&mut self, number: usize, step: &Step) {
        match *step {
            Step::Line(code, to) => {
                let to = match to {
                    [None, None, None] => [Some(0.0), None, None],
                    to => to,
                };
                let code = code.unwrap_or(if self.is_line { "" } else { "G1" });
                self.block(code, to, false);
                self.is_line = true;
            }
            Step::Increments(parts) => {
                let at = self.at;
                let to = std::array::from_fn(|axis| {
                    // A part of what is left of the travel.
                    let room = if parts[axis] > 0.0 {
                        TRAVEL - at[axis]
                    } else {
                        TRAVEL + at[axis]
                    };
                    Some(at[axis] + 0.1 * parts[axis] * room)
                });
                let code = if self.is_line { "" } else { "G1" };
                self.block(code, to, true);
                self.is_line = true;
            }
            Step::Arc([i, j], by, turns_left) => {
                let (centre, radius) = ([self.at[0] + i, self.at[1] + j], i.hypot(j));
                if centre.iter().any(|it| it.abs() + radius > TRAVEL - 1.0) {
                    return;
                }
                let angle = (-j).atan2(-i) + if turns_left { by } else { -by };
                let to = [
                    Some(centre[0] + radius * angle.cos()),
                    Some(centre[1] + radius * angle.sin()),
                    None,
                ];
                self.block(
                    if turns_left { "G3" } else { "G2" },
                    to,
                    self.is_incremental,
                );
                let last = self.blocks.last_mut().unwrap();
                *last += &format!(" I{i:.4} J{j:.4}");
                self.is_line = false;
            }
            Step::Parameter(to) => {
                let value = ((to - self.zero[0]) * 1e4).round() / 1e4;
                self.blocks.push(format!("#7 = {value}"));
                self.block("G1", [Some(value + self.zero[0]), None, None], false);
                let last = self.blocks.last_mut().unwrap();
                let end = last.rfind('X').unwrap();
                last.replace_range(end.., "X#7");
                self.is_line = true;
            }
            Step::Shift(called) => {
                let called = called.round();
                self.zero[0] = self.at[0] - called;
                self.blocks.push(format!("G92 X{called}"));
            }
            Step::Unshift => {
                self.zero = [0.0; 3];
                self.blocks.push("G92.1".to_owned());
            }
            Step::Drill([x, y]) => {
                self.block("G0", [Some(x), Some(y), Some(50.0)], false);
                self.block("G81 R20", [None, None, Some(-20.0)], false);
                self.at[2] = 50.0;
                self.blocks.push("G80".to_owned());
                self.is_line = false;
            }
            Step::Repeat(way) => {
                self.block("G1", [Some(0.0), None, None], false);
                self.blocks.push(format!("o{number} repeat [2]"));
                self.block("G1", [None, Some(way), None], false);
                self.block("", [None, Some(0.0), None], false);
                self.blocks.push(format!("o{number} endrepeat"));
                self.is_line = true;
            }
            Step::If => {
                self.blocks.push(format!("o{number} if [#7 LT 1000]"));
                self.block("G1", [Some(1.0), None, None], false);
                self.blocks.push(format!("o{number} endif"));
                self.is_line = true;
            }
            Step::Circle(plane) => {
                let at = [0.0; 3].map(Some);
                self.block("G0", at, false);
                self.blocks.push(plane.to_owned());
                let centre = match plane {
                    "G17" => "I5.5 J0",
                    "G18" => "I5.5 K0",
                    _ => "J5.5 K0",
                };
                self.blocks.push(format!("G2 {centre}"));
                self.blocks.push("G17".to_owned());
                self.is_line = false;
            }
            Step::Holes(cycle, ref holes) => {
                self.block("G0", [None, None, Some(50.0)], false);
                for (index, [x, y]) in holes.iter().enumerate() {
                    let to = [Some(*x), Some(*y), None];
                    if index > 0 {
                        self.block("", to, false);
                        continue;
                    }
                    self.block(
                        &format!("G98 {cycle} R20.5"),
                        [Some(*x), Some(*y), Some(-20.0)],
                        false,
                    );
                    if cycle.starts_with("G99") {
                        let last = self.blocks.last_mut().unwrap();
                        *last = last.replacen("G98 ", "", 1);
                    }
                    self.at[2] = if cycle.starts_with("G99") {
                        20.5 + self.zero[2]
                    } else {
                        50.0
                    };
                }
                self.blocks.push("G80".to_owned());
                self.is_line = false;
            }
            Step::By("F") => {
                self.blocks.push("#3 = 510".to_owned());
                self.block("G1 F#3", [Some(1.5), None, None], false);
                self.is_line = true;
            }
            Step::By("S") => {
                self.blocks.push("#3 = 510".to_owned());
                self.blocks.push("S#3 M3".to_owned());
                self.block("G0", [None, None, Some(50.0)], false);
                self.block("G86 R20", [Some(1.5), Some(2.5), Some(-20.0)], false);
                self.at[2] = 50.0;
                self.blocks.push("G80 M5".to_owned());
                self.is_line = false;
            }
            Step::By(by) => {
                self.block("G1", [Some(0.0), Some(0.0), None], false);
                self.blocks.push("#5 = 10.5".to_owned());
                self.block("G2", [Some(21.0), Some(0.0), None], false);
                let last = self.blocks.last_mut().unwrap();
                *last += if by == "I" { " I#5 J0" } else { " R[#5 + 1]" };
                self.is_line = false;
            }
            Step::Nurbs => {
                self.block("G1", [Some(0.0), Some(0.0), None], false);
                self.block("G5.2", [Some(5.5), Some(5.0), None], false);
                self.block("", [Some(10.5), Some(0.0), None], false);
                self.block("", [Some(15.5), None, None], false);
                self.blocks.push("G5.3".to_owned());
                self.is_line = false;
            }
            Step::Cubics => {
                self.block("G1", [Some(0.0), Some(0.0), None], false);
                self.block("G5 I2.5 J2 P-2.5 Q2", [Some(10.5), Some(0.0), None], false);
                self.block("G5 P-2.5 Q2", [Some(20.5), Some(0.0), None], false);
                self.is_line = false;
            }
            Step::Contour => {
                self.block("G0", [Some(-50.0), Some(0.0), None], false);
                self.block("G41 D2 G1", [Some(-20.5), Some(0.0), None], false);
                self.block("", [Some(20.5), None, None], false);
                self.block("", [None, Some(30.5), None], false);
                self.block("G40 G1", [None, Some(60.5), None], false);
                self.is_line = true;
            }
            Step::Tool(by_number, z) => {
                self.blocks.push("T2 M6".to_owned());
                self.blocks
                    .push(if by_number { "G43 H2" } else { "G43" }.to_owned());
                self.zero[2] += 12.5;
                self.block("G1", [None, None, Some(z)], false);
                self.blocks.push("G49".to_owned());
                self.zero[2] -= 12.5;
                self.is_line = true;
            }
            Step::Offset(x) => {
                self.blocks.push("G10 L2 P3 X15.5".to_owned());
                self.blocks.push("G56".to_owned());
                let shift = std::mem::replace(&mut self.zero[0], 0.0);
                self.zero[0] = shift + 15.5;
                self.block("G1", [Some(x), None, None], false);
                self.zero[0] = shift;
                self.blocks.push("G54".to_owned());
                self.is_line = true;
            }
            Step::Call(call) => {
                self.blocks.push(call.to_owned());
                self.block("G1", [Some(1.5), None, None], false);
                self.is_line = true;
            }
            Step::Named(to) => {
                let value = ((to - self.zero[0]) * 1e4).round() / 1e4;
                self.blocks.push(format!("#<length_of_g> = {value}"));
                self.block("G1", [Some(value + self.zero[0]), None, None], false);
                let last = self.blocks.last_mut().unwrap();
                let end = last.rfind('X').unwrap();
                last.replace_range(end.., "X#<length_of_g>");
                self.is_line = true;
            }
            Step::Blanks(to) => {
                self.block("G1", [Some(to), None, None], false);
                let last = self.blocks.last_mut().unwrap();
                let apart = last.chars().flat_map(|it| [it, ' ']);
                *last = apart.collect::<String>() + "(Go; Fx)";
                self.is_line = true;
            }
            Step::Other(block) => self.blocks.push(block.to_owned()),
        }
    }
}

/// A block with one mistake.
fn spoilt(block: &str, how: usize) -> String {
    let appended = [
        " Z.0.", " E5", " S-1", " G16", " G999", " X", " ?", " [", " F-5", " T-1", " G41.5",
        " P1 P1", " Y1,5", " F1,5", " H7",
    ];
    match appended.get(how) {
        Some(appended) => format!("{block}{appended}"),
        // A comma for a point, or a letter for a digit.
        None if how.is_multiple_of(2) && block.contains('.') => block.replacen('.', ",", 1),
        None if block.contains(['0', '1', '5']) => block.replacen(['0', '1', '5'], "o", 1),
        None => format!("{block} $"),
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(ProptestConfig::default().cases.max(1000)) })]

    /// What is right of a program is not told to be a mistake, wherever and whatever the one is that it has; a second one that is one
    /// whatever comes before it is told, too.
    #[test]
    fn all_mistakes_are_told_and_nothing_else(
        steps in prop::collection::vec(step(), 1..25),
        (place, how) in (any::<prop::sample::Index>(), 0..18_usize),
        (second, written) in (any::<prop::sample::Index>(), prop::option::of(0..4_usize)),
    ) {
        let setup = machine();
        let mut blocks = Good::of(&steps);
        let whole = |blocks: &[String]| [&blocks.join("\n"), &Good::BEHIND.join("\n")].map(String::as_str).join("\n");
        let good = mistakes_with(setup.clone(), &whole(&blocks));
        prop_assert_eq!(good, [], "{:#?}", blocks);
        let [place, second] = [place, second].map(|it| it.index(blocks.len()));
        let was = blocks[place].clone();
        blocks[place] = spoilt(&blocks[place], how);
        let mut expected = vec![place + 1];
        let mut may_be_missed = vec![];
        // What is skipped is only parsed.
        if was.starts_with('/') {
            may_be_missed.push(place + 1);
        }
        // Behind a branch that is broken, or goes by what is not known, each block is judged by itself, where it may be none.
        let leads = |block: &str| block.starts_with(['o', '#']) || block.contains("M98");
        if let Some(written) = written.filter(|_| second != place) {
            // Which words a block uses hangs on the motion.
            let by_motion = matches!(how, 1 | 14);
            if second < place && (leads(&blocks[second]) || by_motion) {
                may_be_missed.push(place + 1);
            }
            if blocks[second].starts_with('/') {
                may_be_missed.push(second + 1);
            }
            // In a contour nothing goes by machine coordinates.
            blocks[second] += [" Z.0.", " ?", " G999", " X"][written];
            expected.push(second + 1);
        }
        // What hangs on a place is told where that is known.
        let limit = blocks.len() + 1;
        blocks.push("G90 G53 G0 X9999".to_owned());
        let hides = |block: &String| leads(block) || block.contains('#') || ["G21", "G4", "G10", "M7"].iter().any(|it| block.contains(it));
        expected.push(limit);
        let touched = expected.iter().filter(|it| **it < limit).any(|line| hides(&blocks[line - 1]));
        if touched || hides(&was) {
            may_be_missed.push(limit);
        }
        expected.sort_unstable();
        let told = mistakes_with(setup, &whole(&blocks));
        let mut lines: Vec<usize> = told.iter().map(|(line, _)| *line as usize).collect();
        // A loop makes it twice.
        lines.sort_unstable();
        lines.dedup();
        expected.retain(|line| !may_be_missed.contains(line) || lines.contains(line));
        prop_assert!(lines == expected, "{:#?}\n{}", told, blocks.join("\n"));
    }
}

#[test]
fn a_spline_without_an_end_is_told_once() {
    assert_eq!(mistakes_with(xyz(), "G5.2 X1 Y1 F9").len(), 1);
}

/// The letter O for a 0, which is the usual slip of the finger, is no O-word, and a statement that is given something without brackets is
/// one all the same.
#[test]
fn a_letter_for_a_digit_is_told_as_that() {
    for text in [
        "G0 X1O Y10",
        "G9O",
        "GO X5",
        "G1 XO F100",
        "G0 YO.5",
        "MO",
        "S1OOO",
        "X1.O",
    ] {
        let told = mistakes_with(xyz(), &format!("{text}\nM2"));
        assert!(
            told[0].1.starts_with("`O` is a letter here: write 0"),
            "{text}: {told:?}"
        );
    }
    for text in ["G0 X1 O5 sub", "G0 X1 o<x> call"] {
        let told = mistakes_with(xyz(), &format!("{text}\nM2"));
        assert!(told[0].1.contains("stands alone"), "{text}: {told:?}");
    }
    for text in ["o1 call 5", "o1 if 1", "o1 while 1", "o1 repeat 3"] {
        let told = mistakes_with(xyz(), &format!("{text}\nM2"));
        assert!(told[0].1.contains("in brackets, `[…]`"), "{text}: {told:?}");
    }
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
