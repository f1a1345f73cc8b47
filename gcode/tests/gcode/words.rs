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
