//! M19: where the spindle is held, until it turns again.

use std::time::Duration;

use proptest::prelude::*;
use syncline_gcode::{Action, Interpreter, Orientation, Turning, Way};

use super::listing::{begun_at, refusal_with, xyz};
use super::threads::{measured, spindles};

#[test]
fn it_turns_or_is_held_and_never_both() {
    let told = spindles("M3 S500\nM19 R90\nM4\nM19 R360 P1 Q2.5\nM5\nM19\nM2\n");
    let held = |angle, way, within| {
        let orientation = Some(Orientation { angle, way, within });
        (Turning::Off, orientation)
    };
    let in_time = Some(Duration::from_millis(2500));
    let expected = [
        (Turning::Clockwise, None),
        held(90.0, Way::Shorter, None),
        (Turning::Counterclockwise, None),
        held(0.0, Way::Clockwise, in_time),
        (Turning::Off, None),
        held(0.0, Way::Shorter, None),
    ];
    let found: Vec<_> = told.iter().map(|it| (it.turning, it.orientation)).collect();
    assert_eq!(found, expected);
    assert!(told.iter().all(|it| it.speed == 500.0));
}

#[test]
fn what_it_cannot_be_told_is_refused_at_its_word() {
    for (block, place) in [
        ("M19 R-0.1", "1:5"),
        ("M19 R360.1", "1:5"),
        ("M19 R90 P3", "1:9"),
        ("M19 R90 P0.5", "1:9"),
        ("M19 R90 Q0", "1:9"),
        ("M19 R90 Q1000001", "1:9"),
        ("M19 M3", "1:5"),
    ] {
        let refusal = refusal_with(measured(), block);
        assert!(
            refusal.starts_with(&format!("part.ngc:{place}: ")),
            "{block}: {refusal}"
        );
    }
    let refusal = refusal_with(xyz(), "M19 R90");
    assert!(
        refusal.contains("name the `drive` that turns it"),
        "{refusal}"
    );
}

/// A program that is begun behind it orients the spindle, the shorter way, and its end lets it go.
#[test]
fn it_is_a_mode() {
    let text = "M19 R45 P2\nG0 X1\nX2\nM2\n";
    let mut program = Interpreter::from_text("part.ngc", text, measured());
    let set_up = begun_at(&mut program, 3).unwrap();
    let orientation = Orientation {
        angle: 45.0,
        way: Way::Shorter,
        within: None,
    };
    let held = |action: &Action| match action {
        Action::Spindle(spindle) => spindle.orientation == Some(orientation),
        _ => false,
    };
    assert!(set_up.iter().any(held), "{set_up:?}");
    assert!(program.modes().to_string().contains(" M19 R45 P2"));
    assert!(program.by_ref().all(|command| command.is_ok()));
    let left = program.memory();
    let spindle = left.modes().spindle;
    assert_eq!(spindle.orientation, None);
}

proptest! {
    /// Each way leads to the same place, by no more than a turn, and none is shorter than the shorter one.
    #[test]
    fn every_way_leads_there(from in -20.0..20.0_f64, angle in 0.0..1.0_f64) {
        let [shorter, clockwise, back] =
            [Way::Shorter, Way::Clockwise, Way::Counterclockwise].map(|way| way.turns(angle - from));
        for turns in [shorter, clockwise, back] {
            let there = from + turns - angle;
            prop_assert!((there - there.round()).abs() < 1e-9);
            prop_assert!(shorter.abs() <= turns.abs());
        }
        prop_assert!((0.0..1.0).contains(&clockwise) && back <= 0.0 && back > -1.0);
        prop_assert!(shorter.abs() <= 0.5);
    }

    /// What is told of it is what asks for it.
    #[test]
    fn its_code_asks_for_the_same(angle in 0.0..360.0_f64, way in 0..3_u32, seconds in prop::option::of(0.001..1e3_f64)) {
        let within = seconds.map_or(String::new(), |seconds| format!(" Q{seconds}"));
        let asked = spindles(&format!("M19 R{angle} P{way}{within}\nM2\n"))[0].orientation;
        prop_assert_eq!(spindles(&format!("{}\nM2\n", asked.unwrap()))[0].orientation, asked);
    }
}
