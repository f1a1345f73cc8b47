//! Work that is turned in X and Y: G10 L2 R.

use proptest::prelude::*;
use proptest::sample::select;
use syncline_gcode::{
    Action, AxisLetter, Command, Interpreter, Point, Setup, Tool, WorkCoordinates,
};

use super::listing::{listing, refusal_with, refusals_with, run_with, xyz};

fn turned(origin: Point, degrees: f64) -> Setup {
    let mut setup = xyz();
    setup.tables.work_offsets[0] = origin;
    setup.tables.rotations[0] = degrees;
    let tool = Tool {
        offset: Point::xyz(0.0, 0.0, 12.0),
        ..Tool::default()
    };
    setup.tables.tools.insert(1, tool);
    setup
}

/// A point of the plane turned about another.
fn about(center: &Point, degrees: f64, point: [f64; 2]) -> [f64; 2] {
    let [x, y] = [
        point[0] - center[AxisLetter::X],
        point[1] - center[AxisLetter::Y],
    ];
    let (sine, cosine) = degrees.to_radians().sin_cos();
    [
        center[AxisLetter::X] + x * cosine - y * sine,
        center[AxisLetter::Y] + x * sine + y * cosine,
    ]
}

/// What a command says of places: points of the plane, then values that do not turn.
fn places(command: &Command) -> (Vec<[f64; 2]>, Vec<f64>) {
    let plane = |point: &Point| [point[AxisLetter::X], point[AxisLetter::Y]];
    match &command.action {
        Action::Rapid { to } | Action::Feed { to, .. } => {
            (vec![plane(to)], vec![to[AxisLetter::Z]])
        }
        Action::Arc { arc, .. } => (
            vec![plane(&arc.from), plane(&arc.to), arc.center],
            vec![arc.to[AxisLetter::Z], arc.sweep],
        ),
        Action::Spline { spline, .. } => {
            (spline.controls().to_vec(), vec![spline.to[AxisLetter::Z]])
        }
        _ => (Vec::new(), Vec::new()),
    }
}

#[test]
fn each_way_to_write_it() {
    insta::assert_snapshot!(listing(
        "G10 L2 P1 X100 Y50 R90
G0 X10 Y0 Z0
X20
G91 Y5
G90 G53 X0 Y0
F600 G1 X10 Y0
G2 X20 Y0 I5
G90.1 G2 X10 Y0 I15 J0
G91.1 G3 X20 R5
G1 @30 ^90
G81 X1 Y2 R1 Z-3
G80
G5 X11 Y2 I3 J0 P-3 Q0
G92 X0 Y0
G1 X1
#5230=0
X1
G92.1
G10 L2 P2 X5 R-90
G55 X1 Y0
G10 L20 P2 X0 Y0 R180
X3 Y4
G10 L2 P0 R0
X3 Y4
M2"
    ));
}

#[test]
fn what_is_refused() {
    let mut setup = turned(Point::ZERO, 30.0);
    setup.tables.work_offsets[1] = Point::ZERO;
    let programs = [
        ("G18 F100 G2 X1 Z1 I1 K0", "1:10"),
        ("G19 G81 Y1 Z1 R1 X-1 F100", "1:5"),
        ("G18 G41.1 D1", "1:5"),
        ("G10 L2 P1 R361", "1:11"),
        ("#5230 = 400", "1:1"),
        ("G41.1 D1\n#5250 = 40", "2:1"),
    ];
    insta::assert_snapshot!(refusals_with(&setup, &programs));
    // Straight moves have no plane, and work that is not turned has all of them.
    for right in [
        "G18 F100 G1 X1 Z1",
        "G55 G18 F100 G2 X2 Z0 I1 K0",
        "G10 L2 P1 R0 G18",
    ] {
        let ended = run_with(setup.clone(), &format!("{right}\nM2"));
        assert!(ended.is_ok(), "{right}: {ended:?}");
    }
    let mut setup = Setup::new([AxisLetter::X, AxisLetter::Z].into_iter().collect());
    setup.limits = [None; 9];
    insta::assert_snapshot!(refusals_with(&setup, &[("G10 L2 P1 R5", "1:11")]));
}

/// The line of a program that all of the language's ways of naming a place can be in.
fn line() -> impl Strategy<Value = String> {
    let number = || (-400..400_i32).prop_map(|it| f64::from(it) / 16.0);
    let arcs = (select(vec!["G2", "G3"]), number(), number());
    prop_oneof![
        (number(), number()).prop_map(|(x, y)| format!("G0 X{x} Y{y}")),
        number().prop_map(|x| format!("G1 X{x}")),
        (number(), number()).prop_map(|(y, z)| format!("G1 Y{y} Z{z}")),
        (number(), number()).prop_map(|(r, a)| format!("G90 G1 @{} ^{a}", 60.0 + r)),
        number().prop_map(|a| format!("G1 ^{a}")),
        arcs.prop_map(|(code, i, j)| format!("{code} I{i} J{} Z1", j + 30.0)),
        (number(), number()).prop_map(|(x, y)| format!("G91 G3 X{x} Y{y} R{}\nG90", 100.0)),
        (number(), number()).prop_map(|(x, y)| format!("G81 X{x} Y{y} R2 Z-3\nG80")),
        number().prop_map(|x| format!("G91 G82 X{x} R2 Z-3 P1 L3\nG80 G90")),
        (number(), number()).prop_map(|(x, y)| format!("G5.1 X{x} Y{y} I30 J{}", 30.0 + x)),
        (number(), number()).prop_map(|(x, y)| format!("G5 X{x} Y{y} I30 J1 P-30 Q2")),
        (number(), number()).prop_map(|(x, y)| format!("G5.2 X{x} Y{y}\nX50 Y1\nX60\nG5.3")),
        (number(), number()).prop_map(|(x, y)| format!("G52 X{x} Y{y}")),
        number().prop_map(|x| format!("G92 X{x}")),
        number().prop_map(|y| format!("G92 Y{y}")),
        Just("G92.2".to_owned()),
        Just("G92.3".to_owned()),
        Just("G43 H1".to_owned()),
        Just("G91".to_owned()),
        Just("G90".to_owned()),
        Just("G0 X#5421 Y#5420 Z#<_z>".to_owned()),
    ]
}

proptest! {
    /// A program on turned work is the program turned about the work's origin: everything but G53, G28 and G30.
    #[test]
    fn a_program_is_turned_as_a_whole(
        lines in prop::collection::vec(line(), 1..12),
        origin in prop::array::uniform3(-100.0..100.0_f64),
        degrees in prop_oneof![-360.0..360.0_f64, select(vec![90.0, -90.0, 180.0])],
        contour in any::<bool>(),
    ) {
        let [x, y, z] = origin;
        let origin = Point::xyz(x, y, z);
        let start = "G17 F600 G0 X0 Y0 Z0\n";
        let contour = if contour {
            "G91.1 G90 G92.1 G0 X-500 Y-500\nG41.1 D3 G1 X0 Y0\nX40\nY20\nG3 X20 Y40 I-20\nG40 G1 X0 Y60\n"
        } else {
            ""
        };
        let program = format!("{start}{}\n{contour}M2", lines.join("\n"));
        let straight = run_with(turned(origin, 0.0), &program);
        prop_assume!(straight.is_ok());
        let all_turned = run_with(turned(origin, degrees), &program).unwrap();
        let straight = straight.unwrap();
        prop_assert_eq!(straight.len(), all_turned.len());
        for (straight, turned) in straight.iter().zip(&all_turned) {
            prop_assert_eq!(straight.span, turned.span);
            let ((expected, same), (found, still)) = (places(straight), places(turned));
            prop_assert_eq!(expected.len(), found.len());
            for (point, found) in expected.into_iter().zip(found) {
                let expected = about(&origin, degrees, point);
                let off = (expected[0] - found[0]).hypot(expected[1] - found[1]);
                prop_assert!(off < 1e-7, "{turned:?}: {expected:?}, {found:?}\n{program}");
            }
            for (a, b) in same.into_iter().zip(still) {
                prop_assert!((a - b).abs() < 1e-7, "{turned:?}\n{program}");
            }
        }
    }

    /// Behind G92, G10 L20 and G10 L10 the position has the coordinates that they gave, and those that they did not
    /// give stay.
    #[test]
    fn a_position_gets_its_coordinates(
        origin in prop::array::uniform3(-100.0..100.0_f64),
        degrees in -360.0..360.0_f64,
        shift in prop::option::of(-20.0..20.0_f64),
        code in select(vec!["G92", "G10 L20 P0", "G10 L20 P0 R17", "G10 L10 P1"]),
        words in prop::array::uniform3(prop::option::of(-4000..4000_i32)),
    ) {
        let words = words.map(|word| word.map(|it| f64::from(it) / 16.0));
        prop_assume!(words.iter().any(Option::is_some));
        // A tool's length is in effect by G43.
        prop_assume!(code != "G10 L10 P1" || (words[0].is_some() == words[1].is_some()));
        let [x, y, z] = origin;
        let mut program = String::from("G0 X7 Y8 Z9\n");
        if let Some(shift) = shift {
            program += &format!("G52 X{shift} Y1\n");
        }
        program += "#1=#5420 #2=#5421 #3=#5422\n";
        program += code;
        for (letter, word) in ["X", "Y", "Z"].into_iter().zip(words) {
            program += &word.map_or_else(String::new, |it| format!(" {letter}{it}"));
        }
        program += "\n";
        if code.contains("L10") {
            program += "G43 H1\n";
        }
        program += "#4=#5420 #5=#5421 #6=#5422\nG53 G0 X#1 Y#2 Z#3\nG53 X#4 Y#5 Z#6\n";
        let mut setup = turned(Point::xyz(x, y, z), degrees);
        setup.tables.tools.clear();
        let mut program = Interpreter::from_text("part.ngc", program, setup);
        let rapids: Vec<Point> = program
            .by_ref()
            .map(Result::unwrap)
            .filter_map(|command| match command.action {
                Action::Rapid { to } => Some(to),
                _ => None,
            })
            .collect();
        let (before, after) = (rapids[1], rapids[2]);
        let turned_anew = code.contains('R');
        for (axis, word) in [AxisLetter::X, AxisLetter::Y, AxisLetter::Z].into_iter().zip(words) {
            // Under another angle the same place has other coordinates.
            let expected = match word {
                Some(word) => word,
                None if turned_anew => continue,
                None => before[axis],
            };
            prop_assert!((after[axis] - expected).abs() < 1e-6, "{axis}: {after:?}, {words:?}");
        }
    }

    /// Where single coordinates lead: those that are given are met, others stay, and so do axes that neither moves.
    #[test]
    fn single_coordinates_lead_to_their_place(
        origin in prop::array::uniform9(-100.0..100.0_f64),
        rotation in prop_oneof![Just(0.0), -360.0..360.0_f64],
        from in prop::array::uniform9(-100.0..100.0_f64),
        given in prop::array::uniform9(prop::option::of(-100.0..100.0_f64)),
    ) {
        let coordinates = WorkCoordinates { origin: Point(origin), rotation };
        let mut to = Point(from);
        for (value, place) in to.0.iter_mut().zip(coordinates.place(&given, Point(from))) {
            *value = place.unwrap_or(*value);
        }
        let [before, after] = [Point(from), to].map(|point| coordinates.to_program(point).0);
        for k in 0..9 {
            let expected = given[k].unwrap_or(before[k]);
            prop_assert!((after[k] - expected).abs() < 1e-9, "{k}");
            if k > 1 && given[k].is_none() {
                prop_assert_eq!(to.0[k], from[k]);
            }
        }
    }
}

/// Tables turn work on a machine that has no Y, or no X: nothing that counts by its coordinates can go right.
#[test]
fn tables_turn_no_work_of_a_machine_without_both_axes() {
    for (axes, word) in [("XZ", "X20"), ("XZ", "Z2"), ("YZ", "Y20"), ("ZA", "A20")] {
        let axes = axes.chars().filter_map(AxisLetter::from_letter).collect();
        let mut setup = Setup::new(axes);
        setup.tables.rotations[0] = 30.0;
        for motion in ["G1", "G0", "G28", "G92", "G38.2"] {
            let message = refusal_with(setup.clone(), &format!("F1000\n{motion} {word}\nM2"));
            assert!(message.contains("turn"), "{message}");
        }
        // It can be put right, and the other offsets are.
        for right in ["G10 L2 P1 R0\nG1", "G10 L2 P0 R0\nG0", "G55 G1"] {
            let ended = run_with(setup.clone(), &format!("F1000\n{right} {word}\nM2"));
            assert!(ended.is_ok(), "{right} {word}: {ended:?}");
        }
    }
}
