//! What is told behind a mistake, case by case: programs with a mistake, and without.

use syncline_gcode::{AxisLetter, MAX_LINE, Point, Setup, Tool};

use super::listing::xyz;
use super::mistakes::mistakes_with;

/// A machine of 200 mm each way, with two tools.
pub(crate) fn machine() -> Setup {
    let mut setup = xyz();
    for limits in setup.limits.iter_mut().take(3) {
        *limits = Some((-100.0, 100.0));
    }
    for (number, diameter, length) in [(1, 8.0, 0.0), (2, 5.0, 12.5)] {
        let mut offset = Point::ZERO;
        offset[AxisLetter::Z] = length;
        let tool = Tool {
            diameter,
            offset,
            ..Tool::default()
        };
        setup.tables.tools.insert(number, tool);
    }
    setup.block_delete = true;
    setup
}

/// What most of the programs begin with.
const BEGIN: &str = "G21 G17 G90 G94 G40 G49 G80 F500 G0 X0 Y0 Z0\n";

/// A program, the lines that are told of it, and the same without a mistake.
type Case = (&'static str, &'static [u32], Option<&'static str>);

const CASES: &[Case] = &[
    (
        "G1 X 1,5\nG1 Y500\nM2\n",
        &[2, 3],
        Some("G1 X 1.5\nG1 Y50\nM2\n"),
    ),
    ("G1 X[1 GT 3] Q3\nG1 Y500\nM2\n", &[2, 3], None),
    ("G80 G0 X5 Q3\nG1 Y500\nM2\n", &[2, 3], None),
    (
        "/ G91 X1,5\nG1 Y60\nY60\nM2\n",
        &[2],
        Some("/ G91 X1.5\nG1 Y60\nY60\nM2\n"),
    ),
    ("S500 M3.5\nG86 X1 Y1 Z-5 R2 P1\nM2\n", &[2], None),
    (
        "G18, \nG1 X10 Z10\nG2 X20 Z20 I0 K10\nM2\n",
        &[2],
        Some("G18\nG1 X10 Z10\nG2 X20 Z20 I0 K10\nM2\n"),
    ),
    (
        "G41 D1 G1 X-20 Y0\nX40\nG40, G1 X60\nG55\nG28\nM2\n",
        &[4],
        Some("G41 D1 G1 X20 Y0\nX40\nG40 G1 X60\nG55\nG28\nM2\n"),
    ),
    (
        "G5.2 X1 Y1 F100\nX1,5\nX4 Y0\nG5.3\nG5.2 X5 Y1\nX?\nG5.3\nM2\n",
        &[3, 7],
        Some("G5.2 X1 Y1 F100\nX1.5\nX4 Y0\nG5.3\nG5.2 X5 Y1\nX6\nG5.3\nM2\n"),
    ),
    (
        "G5,2 X1 Y1\nX4 Y0\nX6\nG5.3\nM2\n",
        &[2],
        Some("G5.2 X1 Y1\nX4 Y0\nX6\nG5.3\nM2\n"),
    ),
    (
        "G5 X50 Y50 I1 J1 P-1 Q?\nG2 X60 Y50 I5 J0\nM2\n",
        &[2],
        Some("G5 X50 Y50 I1 J1 P-1 Q-1\nG2 X60 Y50 I5 J0\nM2\n"),
    ),
    (
        "G5 X50 Y50 I1 J1 P-1 Q?\nG5 X60 Y60 P-1 Q-1\nM2\n",
        &[2],
        Some("G5 X50 Y50 I1 J1 P-1 Q-1\nG5 X60 Y60 P-1 Q-1\nM2\n"),
    ),
    (
        "G81 X50 Y50 Z-5\nG80\nG2 X60 Y50 I5 J0\nM2\n",
        &[2],
        Some("G81 X50 Y50 Z-5 R2\nG80\nG2 X60 Y50 I5 J0\nM2\n"),
    ),
    (
        "G81 X50 Y50 Z-5 R2,5\nX60\nX70\nG80\nM2\n",
        &[2],
        Some("G81 X50 Y50 Z-5 R2.5\nX60\nX70\nG80\nM2\n"),
    ),
    (
        "G43.2 H2 Q3\nG0 Z80\nM2\n",
        &[2],
        Some("G43.2 H2\nG0 Z80\nM2\n"),
    ),
    (
        "G91 G81 X60 Y0 Z-5 R2 Q3\nG80\nG0 X30\nM2\n",
        &[2],
        Some("G91 G81 X60 Y0 Z-5 R2\nG80\nG0 X30\nM2\n"),
    ),
    (
        "G0 (a; b) X1,5 Y2\nG2 X15 Y2 I5 J0\nM2\n",
        &[2],
        Some("G0 (a; b) X5 Y2\nG2 X15 Y2 I5 J0\nM2\n"),
    ),
    (
        "G0 X1\nM30 Q3\nO100\nG0 X5\nM99\n",
        &[3],
        Some("G0 X1\nM30\nO100\nG0 X5\nM99\n"),
    ),
    (
        "#1 = 1O0\no#1 call\nM2\no100 sub\no100 endsub\n",
        &[2],
        None,
    ),
    ("#1 = 1O0\nM98 P#1\nM2\nO100\nM99\n", &[2], None),
    (
        "#3 = 5OO\nG1 X10 F#3\nM2\n",
        &[2],
        Some("#3 = 500\nG1 X10 F#3\nM2\n"),
    ),
    (
        "#1 = 2O\nG2 X#1 Y0 R10\nM2\n",
        &[2],
        Some("#1 = 20\nG2 X#1 Y0 R10\nM2\n"),
    ),
    (
        "#1 = 1O\nG2 X20 Y0 I#1 J0\nM2\n",
        &[2],
        Some("#1 = 10\nG2 X20 Y0 I#1 J0\nM2\n"),
    ),
    (
        "#1 = -1O\nG81 X20 Y0 R-5 Z#1\nM2\n",
        &[2],
        Some("#1 = -10\nG81 X20 Y0 R-5 Z#1\nM2\n"),
    ),
    (
        "G10 L2 P2 X-100\nG55?\nG90 G81 X150 Y50 Z-5 R2\nG80\nM2\n",
        &[3],
        Some("G10 L2 P2 X-100\nG55\nG90 G81 X150 Y50 Z-5 R2\nG80\nM2\n"),
    ),
    ("G55?\nG90 G53 G0 X500\nM2\n", &[2, 3], None),
    (
        "G0 X1,5\nG28\nG90 G0 X0 Y0 Z0\nG0 X500\nM2\n",
        &[2, 5],
        None,
    ),
    ("G28 Q3\nG90 G0 X0 Y0 Z0\nG0 X500\nM2\n", &[2, 4], None),
    (
        "T,1 M6\nG41 G1 X20\nX40\nG40 G1 X60\nM2\n",
        &[2],
        Some("T1 M6\nG41 G1 X20\nX40\nG40 G1 X60\nM2\n"),
    ),
    (
        "G91\nG43 H99 G90 G0 X60\nX50\nX-50\nX90\nM2\n",
        &[3],
        Some("G91\nG43 H2 G90 G0 X60\nX50\nX-50\nX90\nM2\n"),
    ),
    ("G0 Z1,5\nG81 X1 Y1 Z5 R2\nG80\nM2\n", &[2, 3], None),
    (
        "G0 Z50 X0 Y0\nG91,\nG81 X0 Y0 R-10 Z-5\nG80\nM2\n",
        &[3],
        Some("G0 Z50 X0 Y0\nG91\nG81 X0 Y0 R-10 Z-5\nG80\nM2\n"),
    ),
    (
        "G0 X-20,5 Y0\nG41 D1 G1 X0 Y0\nX50\nG40 G1 X70\nM2\n",
        &[2],
        Some("G0 X-20.5 Y0\nG41 D1 G1 X0 Y0\nX50\nG40 G1 X70\nM2\n"),
    ),
    (
        "#7 = 9O\nG91 G1 X#7\nX-150\nM2\n",
        &[2],
        Some("#7 = 90\nG91 G1 X#7\nX-150\nM2\n"),
    ),
    (
        "G1 X10 X20\nG2 X20 Y20 I5 J0\nM2\n",
        &[2],
        Some("G1 X10 Y20\nG2 X20 Y20 I5 J0\nM2\n"),
    ),
    ("G1 X5(foo\nG1 X500\nM2\n", &[2, 3], None),
    ("Finishing pass)\nG90 G1 X500\nM2\n", &[2, 3], None),
    (
        "MAX 50 RPM\nG2 X10 Y0 I5 J0\nM2\n",
        &[2],
        Some("G2 X10 Y0 I5 J0\nM2\n"),
    ),
    ("M70 ?\nM72\nM2\n", &[2], None),
    (
        "G10 L2 P2 X-100\nG55?\nG90 G1 @150 ^0\nM2\n",
        &[3],
        Some("G10 L2 P2 X-100\nG55\nG90 G1 @150 ^0\nM2\n"),
    ),
    (
        "G0 X-20,5 Y0\nG41 D1 G1 X1 Y0\nX50\nG40 G1 X70\nM2\n",
        &[2],
        Some("G0 X-20.5 Y0\nG41 D1 G1 X1 Y0\nX50\nG40 G1 X70\nM2\n"),
    ),
    (
        "G91 G81 X30 Y0 Z-5 R2 Q3\nG80\nG0 X50\nM2\n",
        &[2],
        Some("G91 G81 X30 Y0 Z-5 R2\nG80\nG0 X50\nM2\n"),
    ),
    ("G43 H99\nG0 Z95\nM2\n", &[2], None),
    (
        "M98 P7\nG1 X9\nM2\nO7\nG1 X5\nM99 Q3\nO8\nG1 X6\nM99\n",
        &[7],
        None,
    ),
    ("G4 X1\nG2 X10 Y0 I5 J0\nM2\n", &[2], None),
    (
        "G5.2 X1 Y1 F100\nG1 X2 Y2\nX4 Y0\nG5.3\nG1 X9\nM2\n",
        &[3],
        None,
    ),
    (
        "G0 X1,5\nG0 X[#5420+1]\nG2 X12.5 Y0 I5 J0\nM2\n",
        &[2],
        Some("G0 X1.5\nG0 X[#5420+1]\nG2 X12.5 Y0 I5 J0\nM2\n"),
    ),
    (
        "#1 = 5 G1 X1 Q3\no1 if [#1 GT 3]\nG1 X500\no1 endif\nG0 Y500\nM2\n",
        &[2, 4, 6],
        None,
    ),
    (
        "G41 D1 G1 X20\nG18\nX40\nG40 G1 X60\nG1 X500\nM2\n",
        &[3, 6],
        None,
    ),
    (
        "o1 sub\nG1 X1,5\no1 endsub\no1 call\nG1 Y500\nM2\n",
        &[3, 6],
        None,
    ),
    // By an unread G28 all axes may have gone.
    (
        "G0 X50\nG28,\nG17 G90 G54 G2 X10 Y0 I5 J0\nM2\n",
        &[3],
        Some("G0 X50\nG28\nG2 X10 Y0 I5 J0\nM2\n"),
    ),
    // A depth that later holes go by.
    (
        "G81 X1 Y1 Z-5 R2\nX50 Z-9,5\nX60 R-7\nG80\nM2\n",
        &[3],
        Some("G81 X1 Y1 Z-5 R2\nX50 Z-9.5\nX60 R-7\nG80\nM2\n"),
    ),
];

/// Without that beginning.
const WHOLE: &[Case] = &[
    (
        "G90 G0 X0 F1,5\nG1 X10\nM2\n",
        &[1],
        Some("G90 G0 X0 F1.5\nG1 X10\nM2\n"),
    ),
    (
        "#<length>=5\nG21 G17 G90 G94 G40 G49 G80 F500 G0 X0 Y0 Z0\nG1 X#<length> Q3\nG1 Y500\nM2\n",
        &[3, 4],
        None,
    ),
    (
        "G21 G90 G0 X0 Y0 Z0\nM98 P100 Z.0.\nG1 X5\nM2\nO100\nF500\nM99\n",
        &[2],
        Some("G21 G90 G0 X0 Y0 Z0\nM98 P100\nG1 X5\nM2\nO100\nF500\nM99\n"),
    ),
    (
        "G90 G0 X0 F-5\nG1 X10\nM2\n",
        &[1],
        Some("G90 G0 X0 F5\nG1 X10\nM2\n"),
    ),
    (
        "G21 G90 G0 X0 Y0 Z0\nG93\nG1 X1 F2\nG94, F500\nG1 X5\nX6\nM2\n",
        &[4],
        None,
    ),
    (
        "%\nG21 G17 G90 G94 G40 G49 G80 F500 G0 X0 Y0 Z0\nG0 X1\n% end of part\nnotes of the shift\n",
        &[4],
        None,
    ),
];

fn judge(begin: &str, (bad, expected, good): &Case, wrong: &mut Vec<String>) {
    let program = |text: &str| format!("{begin}{text}");
    if let Some(good) = good {
        let told = mistakes_with(machine(), &program(good));
        assert_eq!(told, [], "{good}");
    }
    let told = mistakes_with(machine(), &program(bad));
    let mut lines: Vec<u32> = told.iter().map(|(line, _)| *line).collect();
    lines.dedup();
    if lines != *expected {
        wrong.push(format!("{bad:?}: expected {expected:?}, {told:#?}"));
    }
}

#[test]
fn behind_a_mistake_what_is_wrong_is_told_and_nothing_else() {
    let mut wrong = Vec::new();
    for case in CASES {
        judge(BEGIN, case, &mut wrong);
    }
    for case in WHOLE {
        judge("", case, &mut wrong);
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_line_that_is_too_long_for_its_comment_does_what_stands_before_that() {
    let comment = "x".repeat(MAX_LINE);
    let told =
        |block: &str| mistakes_with(machine(), &format!("{block}\nG1 X10\nG1 X500\nM2")).len();
    assert_eq!(told(&format!("G21 G90 F500 G0 X0 ({comment})")), 2);
    assert_eq!(told(&format!("F500 G0 X0 G21{comment}")), 1);
}
