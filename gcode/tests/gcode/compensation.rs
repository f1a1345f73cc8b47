//! Cutter compensation: words, joints, refusals, and proof by an independent sweep of the tool.

use std::collections::BTreeMap;
use std::fmt::Write;

use proptest::prelude::*;
use syncline_gcode::{Action, InEffect, Interpreter, Place, Point, Setup, Tool};

use super::listing::{listing_with, places, refusals_with, run_with, xyz};

/// Tools of 6 mm: T1, T2 with its sign, T3 that has worn to 5.8 mm.
fn with_cutters() -> Setup {
    let mut setup = xyz();
    for (number, diameter, diameter_wear) in [(1, 6.0, 0.0), (2, -6.0, 0.0), (3, 6.0, -0.2)] {
        let tool = Tool {
            diameter,
            diameter_wear,
            ..Tool::default()
        };
        setup.tables.tools.insert(number, tool);
    }
    setup
}

#[test]
fn lines_and_arcs_left_and_right() {
    let contour = "X40\nY20\nG3 X20 Y40 I-20\nG1 Z-2\nM8\nG1 X0\nY60\nG2 X10 Y50 I0 J-10 Z-3\nG40 G1 X30 Y30\nM2";
    let mut text = String::new();
    for on in [
        "G41 D1",
        "G42 D1",
        "G41 D2",
        "G42 D3",
        "G41.1 D6",
        "G42.1 D-6",
        "T1 M6 G41",
        "G41 D0",
    ] {
        writeln!(text, "{on}").unwrap();
        let program = format!("F600\n{on}\nG1 X20 Y0\n{contour}");
        text += &listing_with(with_cutters(), &program);
    }
    insta::assert_snapshot!(text);
}

#[test]
fn the_other_planes() {
    insta::assert_snapshot!(listing_with(
        with_cutters(),
        "G18 F600 G41 D1
G1 X20 Z0
X40
Z20
G2 X20 Z40 K20
G40 G1 X0
G19 G42 D1
G1 Y20 Z40
Y40
Z60
G3 Y60 Z80 K20
G40 G0 Y80 Z80
M2"
    ));
}

/// A rapid goes around a corner on lines; what stands between two moves stays there.
#[test]
fn rapids_and_what_stands_between() {
    insta::assert_snapshot!(listing_with(
        with_cutters(),
        "G42 D1 G0 X20 Y0
Z-5
G1 X40 F600
M0
Z-6
S100 M3
X39.999 Y20
G0 X20 Y40
G1 X0
G4 P1
M2"
    ));
}

#[test]
fn what_a_compensated_contour_refuses() {
    let on = "F600\nG41 D1 G1 X20\nX40\n";
    let programs = [
        // The words.
        ("G41".to_owned(), "1:1"),
        ("G41 D9".to_owned(), "1:5"),
        ("T9 M6 G41".to_owned(), "1:7"),
        ("G41.1".to_owned(), "1:1"),
        ("G41 G42 D1".to_owned(), "1:5"),
        ("G41 D1 G93".to_owned(), "1:1"),
        ("G40 D1".to_owned(), "1:5"),
        // The entry.
        ("F600 G41 D1\nG1 X3".to_owned(), "2:1"),
        ("F600 G41 D1\nG2 X30 I15".to_owned(), "2:1"),
        // Meanwhile.
        (format!("{on}G18"), "4:1"),
        (format!("{on}G41 D1"), "4:1"),
        (format!("{on}G43 H1"), "4:1"),
        (format!("{on}G55"), "4:1"),
        (format!("{on}T2 M6"), "4:4"),
        (format!("{on}G10 L2 P1 X3"), "4:1"),
        (format!("{on}G92 X0"), "4:1"),
        (format!("{on}G52 X0"), "4:1"),
        (format!("{on}G28"), "4:1"),
        (format!("{on}G30 X0"), "4:1"),
        (format!("{on}G53 G0 X0"), "4:1"),
        (format!("{on}G93"), "4:1"),
        (format!("{on}G81 X50 Z-5 R2"), "4:1"),
        (format!("{on}G5.1 X50 I5 J5"), "4:1"),
        (format!("{on}#5221 = 3"), "4:1"),
        (format!("{on}#5211 = 3"), "4:1"),
        // Behind G40.
        (format!("{on}G40 G2 X50 I5"), "4:5"),
        (format!("{on}G40\nG81 X50 Z-5 R2"), "5:1"),
        (format!("{on}G40\nG28"), "5:1"),
        (format!("{on}G40\nG5.1 X50 I5 J5"), "5:1"),
        // What the tool does not fit into.
        (format!("{on}G3 X40 Y4 J2"), "4:1"),
        (format!("{on}Y2\nX60"), "4:1"),
        (format!("{on}Y4\nX30"), "5:1"),
        // Saved modes.
        (
            "F600\nG41 D1 G1 X20\nX40\nM70\nG40 Y20\nM72".to_owned(),
            "6:1",
        ),
        (
            "F600\nG41 D1 G1 X20\nX40\nM70\nG40 X60\nG55\nG41 D1 X80\nX99\nM72".to_owned(),
            "9:1",
        ),
        // The neck of a bottle.
        (format!("{on}Y-20\nX80\nY-10\nX44\nY10\nX50"), "7:1"),
        (format!("{on}X60 Y20\nX30 Y0\nX10 Y-3"), "5:1"),
    ];
    let programs: Vec<_> = programs
        .iter()
        .map(|(text, at)| (text.as_str(), *at))
        .collect();
    insta::assert_snapshot!(refusals_with(&with_cutters(), &programs));
}

/// It is the tool that has to stay inside the soft limits, not the contour.
#[test]
fn soft_limits_hold_for_the_tool() {
    let mut setup = with_cutters();
    setup.limits[1] = Some((-2.0, 50.0));
    let inside = "F600 G42 D1\nG1 X20 Y1\nX40\nY20\nG40 X60\nM2";
    assert!(run_with(setup.clone(), inside).is_ok());
    let programs = [
        ("F600 G42 D1\nG1 X20 Y0\nX40\nY20", "2:1"),
        ("F600 G42 D1\nG1 X20 Y5\nX40\nX60 Y-1\nX80", "4:1"),
    ];
    insta::assert_snapshot!(refusals_with(&setup, &programs));
}

#[test]
fn beginning_on_a_contour_is_refused() {
    let program = "F600 G41 D1\nG1 X20\nX40\nY20\nG40 X0\nX1\nM2";
    let begun = |line| {
        let mut program =
            syncline_gcode::Interpreter::from_text("part.ngc", program, with_cutters());
        program
            .enter_at_line(line)
            .map(|_| ())
            .map_err(|error| error.to_string())
    };
    assert_eq!(begun(1), Ok(()));
    assert_eq!(begun(6), Ok(()));
    for line in 2..=5 {
        let message = begun(line).unwrap_err();
        assert!(
            message.contains(&format!("line {line} is on a compensated contour")),
            "{message}"
        );
        // It is that line which is shown.
        let block = program.lines().nth(line as usize - 1).unwrap();
        assert!(
            message.starts_with(&format!("part.ngc:{line}:1: ")),
            "{message}"
        );
        assert!(message.contains(&format!("\n  {block}\n")), "{message}");
    }
}

/// A contour behind a lone G40 begins where the tool is, whatever stands between.
#[test]
fn a_contour_behind_a_lone_g40_begins_where_the_tool_is() {
    let first = "F600\nG0 X0 Y0\nG41.1 D2 G1 X10\nX20\nY20\n";
    let second = "G41.1 D2 G1 X20 Y40\nX0\nG40 G1 X-10 Y60\nM2";
    for between in ["G40\n", "G40\nM8\nG4 P1\n", "G40 M9\nM64 P1\n"] {
        let all = places(xyz(), &format!("{first}{between}{second}"));
        assert_eq!(all[3], [19.0, 20.0, 0.0], "{between}: {all:?}");
        let alone = places(xyz(), &format!("F600\nG0 X19 Y20\n{second}"));
        assert_eq!(all[4..], alone[1..], "{between}");
    }
    // From where the tool is the way on has to be longer than its radius.
    let short = format!("{first}G40\nG41.1 D2 G1 X19.5\nX0\nM2");
    assert!(run_with(xyz(), &short).is_err());
}

/// A cycle that goes on is refused on a contour, as its code is.
#[test]
fn no_cycle_goes_on_along_a_contour() {
    let on = ["G41.1 D2", "G42.1 D2", "G41.1 D0"];
    for cycle in ["G81", "G82 P1", "G83 Q1", "G73 Q1", "G85", "G89 P1"] {
        for on in on {
            let begun = format!("G0 Z5 F600\n{cycle} X0 Y0 Z-1 R1\n{on}");
            for program in [
                format!("{begun} X10 Y0\nX20\nM2"),
                format!("{begun}\nX10\nM2"),
            ] {
                let error = run_with(xyz(), &program).unwrap_err().to_string();
                let code = cycle.split(' ').next().unwrap();
                let says = format!("{code} is not possible while G41 or G42 is on");
                assert!(error.contains(&says), "{program}: {error}");
            }
            // Words of no axis are none of its business.
            let error = run_with(xyz(), &format!("{begun}\nM8\nG1 X10\nG40 G1 X20 Y20\nM2"));
            assert!(error.is_ok(), "{error:?}");
        }
    }
}

/// What is in effect at each command, by its line, with where the work lies.
fn in_effect(program: &str) -> BTreeMap<u32, Vec<String>> {
    let mut interpreter = Interpreter::from_text("part.ngc", program, with_cutters());
    let mut lines = BTreeMap::<_, Vec<_>>::new();
    for passed in 0.. {
        let Some(command) = interpreter.next() else {
            break;
        };
        let command = command.unwrap_or_else(|error| panic!("{error}\n{program}"));
        let modes = interpreter.modes().to_string();
        if command.action != Action::End {
            // Lines that are typed there begin with that.
            let mut held = Interpreter::from_text("part.ngc", program, with_cutters());
            let place = Place {
                passed,
                known: Some((passed, command.span.line)),
            };
            let entered = held.enter_at(&place, Point::ZERO, &InEffect::default(), &[]);
            entered.unwrap_or_else(|error| panic!("{error}\n{program}"));
            assert_eq!(
                held.memory().modes().to_string(),
                modes,
                "{passed}\n{program}"
            );
        }
        // Without the code of compensation itself.
        let modes = modes.replace("G41.1", "G40").replace("G42.1", "G40");
        let told = format!("{modes} {:?}", interpreter.coordinates());
        let of_line = lines.entry(command.span.line).or_default();
        if of_line.last() != Some(&told) {
            of_line.push(told);
        }
    }
    lines
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(200) })]

    /// A compensated block is known with the one behind it, and what is in effect in it is what stands in it.
    #[test]
    fn what_is_in_effect_in_a_block_does_not_come_from_the_next(
        blocks in prop::collection::vec(
            (5.0..20.0_f64, -10.0..10.0_f64, any::<bool>(), any::<bool>(), prop::option::of(100..2000_u32), 0..6_usize), 1..12,
        ),
        is_right: bool,
    ) {
        // From the side on which the tool goes, and back to it.
        let (on, aside) = if is_right { ("G42.1 D1", -1.0) } else { ("G41.1 D1", 1.0) };
        let mut lines = format!("G21 G17 G90 F600\nG0 X0 Y{}\n", 20.0 * aside);
        lines += &format!("{on} G1 X0 Y0\n");
        let mut at = [0.0, 0.0];
        for (x, y, is_relative, is_rapid, feed, beside) in blocks {
            at = [at[0] + x, at[1] + y];
            let to = if is_relative { [x, y] } else { at };
            let _ = write!(lines, "G9{} G{} X{:.6} Y{:.6}", u8::from(is_relative), u8::from(!is_rapid), to[0], to[1]);
            if let Some(feed) = feed {
                let _ = write!(lines, " F{feed}");
            }
            lines += match beside {
                0 => "\nM8\n",
                1 => "\nS500 M3\n",
                2 => "\nG64 P0.02\n",
                3 => "\nF333\n",
                4 => "\nM0\n",
                _ => "\n",
            };
        }
        let _ = write!(lines, "G90 G40 G1 X{:.6} Y{:.6}\nG55 G0 X0\nM2\n", at[0] + 5.0, at[1] + 60.0 * aside);
        let plain = lines.replace(on, "");
        prop_assert_eq!(in_effect(&lines), in_effect(&plain), "{}", lines);
    }
}
