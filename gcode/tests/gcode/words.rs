//! The small words that programs of other controllers bring along.

use syncline_gcode::{Action, PathMode, Tool};

use super::listing::{listing, listing_with, run, xyz};

#[test]
fn words_that_change_nothing_here() {
    assert_eq!(
        listing("G8 M50\nM51 P1\nM52\nM53 P1\nG10 L2 P1 X1 R0\nG0 X1\nM2"),
        "  6: rapid X2 Y0 Z0\n  7: End\n"
    );
}

#[test]
fn a_blend_of_nothing_is_the_machines_own() {
    let commands = run("G64 P0\nM2").unwrap();
    let plain = run("G64\nM2").unwrap();
    assert_eq!(commands[0].action, plain[0].action);
    assert!(matches!(
        commands[0].action,
        Action::PathMode(PathMode::Blend {
            tolerance: None,
            ..
        })
    ));
}

#[test]
fn feeds_from_nothing_to_anything() {
    assert!(run("F0\nG0 X1\nF100 G1 X2\nM2").is_ok());
    insta::assert_snapshot!(listing("F1000000000000 G1 X1\nG93 F1000000000 X2\nM2"));
}

#[test]
fn tools_without_a_change_and_offsets_on_offsets() {
    let mut setup = xyz();
    for (number, length) in [(1, 50.0), (2, 0.5)] {
        let mut tool = Tool::default();
        tool.offset.0[2] = length;
        setup.tables.tools.insert(number, tool);
    }
    insta::assert_snapshot!(listing_with(
        setup,
        "T2\nM61 Q1\nG43\nG0 Z0 X#5400\nG43.2 H2\nZ0\nM61 Q0\nX#5400\nM2"
    ));
}

/// How far a corner may be rounded, and lines be merged, has an end: micrometres for millimetres, or inches.
#[test]
fn a_path_mode_keeps_to_the_contour() {
    for letter in ["P", "Q"] {
        for (units, most) in [("G21", 10.0), ("G20", 10.0 / 25.4)] {
            for (written, right) in [
                (format!("{most}"), true),
                ("0".to_owned(), true),
                (format!("{}", most * 1.0001), false),
                ("50".to_owned(), false),
                ("-1".to_owned(), false),
                ("[10**308]".to_owned(), false),
            ] {
                let first = if letter == "Q" { "P0.1 " } else { "" };
                let program = format!("{units} G64 {first}{letter}{written}\nM2");
                let ended = run(&program);
                assert_eq!(ended.is_ok(), right, "{program}: {ended:?}");
                if let Err(error) = ended {
                    assert!(error.to_string().contains("10 mm"), "{error}");
                }
            }
        }
    }
}

/// As LinuxCNC's interpreter has it: EQ and NE within 0.0001, the others to the last digit.
#[test]
fn equal_is_what_is_equal_in_linuxcnc() {
    for (condition, truth) in [
        ("1.00009 EQ 1", 1),
        ("1.00011 EQ 1", 0),
        ("1.00009 NE 1", 0),
        ("1.00011 NE 1", 1),
        ("1.00009 GT 1", 1),
        ("0.99991 GE 1", 0),
        ("1.00009 LE 1", 0),
    ] {
        let text = listing(&format!("G0 X[{condition}]\nM2"));
        assert!(text.contains(&format!("X{truth} ")), "{condition}: {text}");
    }
}
