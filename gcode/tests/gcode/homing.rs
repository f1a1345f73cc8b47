//! Homing from a program: what it asks for, where the program goes on, and what is refused.

use proptest::prelude::*;
use syncline_gcode::{Action, AxisLetter, AxisSet, Homed, Interpreter, Output, Point, Setup};

use super::listing::{begun_at, xyz};

/// X is homed to 4, Y by hand where it is named; Z knows where it is.
fn setup() -> Setup {
    let mut setup = xyz();
    setup.homed[AxisLetter::X.index()] = Some(Homed {
        at: Some(4.0),
        unnamed: true,
    });
    setup.homed[AxisLetter::Y.index()] = Some(Homed {
        at: Some(-7.0),
        unnamed: false,
    });
    setup
}

fn point(x: f64, y: f64, z: f64) -> Point {
    let mut point = Point::ZERO;
    point.0[..3].copy_from_slice(&[x, y, z]);
    point
}

/// Goes on to the next homing: which axes, and where they are expected to be; or where rapids lead up to the end.
fn next_homing(program: &mut Interpreter) -> (Option<(AxisSet, Point)>, Vec<Point>) {
    let mut rapids = Vec::new();
    while let Some(command) = program.next() {
        match command.unwrap().action {
            Action::Home { axes, to } => {
                assert!(program.awaits_homing() && program.next().is_none());
                return (Some((axes, to)), rapids);
            }
            Action::Rapid { to } => rapids.push(to),
            _ => {}
        }
    }
    (None, rapids)
}

#[test]
fn the_program_goes_on_from_where_the_axes_are() {
    let text = "G21 G90 G54\n#5221 = 10\nG0 X1 Y2 Z3\nG28.2\nG0 X1\nG28.2 X0 Y0\nG91 G0 X1 Y1\nG90 G53 G0 X#5420\nM2\n";
    let mut program = Interpreter::from_text("part.ngc", text, setup());
    let (homed, rapids) = next_homing(&mut program);
    let x: AxisSet = [AxisLetter::X].into_iter().collect();
    assert_eq!(homed, Some((x, point(4.0, 2.0, 3.0))));
    assert_eq!(rapids, [point(11.0, 2.0, 3.0)]);
    // It is not quite where it was expected.
    program.homed(point(4.001, 2.0, 3.0));
    assert_eq!(program.position(), point(4.001, 2.0, 3.0));
    let (homed, rapids) = next_homing(&mut program);
    assert_eq!(rapids, [point(11.0, 2.0, 3.0)]);
    let both: AxisSet = [AxisLetter::X, AxisLetter::Y].into_iter().collect();
    assert_eq!(homed, Some((both, point(4.0, -7.0, 3.0))));
    program.homed(point(4.0, -7.0, 3.0));
    let (homed, rapids) = next_homing(&mut program);
    assert_eq!(homed, None);
    // #5420 is X in the program's coordinates.
    assert_eq!(rapids, [point(5.0, -6.0, 3.0), point(-5.0, -6.0, 3.0)]);
}

#[test]
fn what_cannot_be_homed_is_refused() {
    let refused = |setup: Setup, text: &str| {
        let mut program = Interpreter::from_text("part.ngc", text, setup);
        program
            .find_map(Result::err)
            .map_or_else(String::new, |error| error.to_string())
    };
    let told = refused(setup(), "G28.2 X0 Z0\n");
    assert!(
        told.contains("1:10") && told.contains("G28.2 does not home Z"),
        "{told}"
    );
    let told = refused(
        setup(),
        "T1 M61 Q1 G10 L1 P1 R2\nG41 D1 G1 X50 F100\nG28.2 X0\n",
    );
    assert!(
        told.contains("3:1") && told.contains("while G41 or G42 is on"),
        "{told}"
    );
    let told = refused(
        setup(),
        "T1 M61 Q1 G10 L1 P1 R2\nG41 D1 G1 X50 F100\nG40\nG28.2 X0\n",
    );
    assert!(told.contains("4:1"), "{told}");
    let mut by_hand = setup();
    by_hand.homed[AxisLetter::X.index()] = None;
    let told = refused(by_hand, "G28.2\n");
    assert!(
        told.contains("G28.2 homes no axis without its name"),
        "{told}"
    );
    let told = refused(setup(), "G28.2 A0\n");
    assert!(told.contains("A"), "{told}");
    let told = refused(setup(), "G28.2 G28\n");
    assert!(told.contains("G28"), "{told}");
}

#[test]
fn a_program_may_begin_behind_a_homing() {
    let text = "G28.2 X0\nG0 Y5\nG1 X9 F100\nM2\n";
    let mut program = Interpreter::from_text("part.ngc", text, setup());
    let set_up = begun_at(&mut program, 3).unwrap();
    assert_eq!(program.position(), point(4.0, 5.0, 0.0));
    let to = point(4.0, 5.0, 0.0);
    assert_eq!(set_up.last(), Some(&Action::Rapid { to }));
    let (homed, rapids) = next_homing(&mut program);
    assert_eq!((homed, rapids), (None, Vec::new()));
}

proptest! {
    /// Wherever the homings stand, whatever they name and wherever the axes are then: what follows counts from there,
    /// and nothing that follows is handed out before that is told.
    #[test]
    fn moves_behind_a_homing_count_from_where_the_axes_are(
        blocks in prop::collection::vec((0..4u8, -50.0..50.0_f64, -50.0..50.0_f64), 1..12),
        places in prop::collection::vec((-9.0..9.0_f64, -9.0..9.0_f64), 12),
    ) {
        let mut text = String::from("G91\n");
        for (kind, x, y) in &blocks {
            text += &match kind {
                0 => "G28.2\n".to_owned(),
                1 => "G28.2 X0 Y0\n".to_owned(),
                2 => "G28.2 Y3\n".to_owned(),
                _ => format!("G0 X{x:.3} Y{y:.3}\n"),
            };
        }
        text += "M2\n";
        let mut program = Interpreter::from_text("part.ngc", text, setup());
        let mut at = Point::ZERO;
        let mut places = places.into_iter();
        for (kind, x, y) in &blocks {
            let action = program.find_map(|command| match command.unwrap().action {
                action @ (Action::Home { .. } | Action::Rapid { .. }) => Some(action),
                _ => None,
            });
            match action {
                Some(Action::Home { axes, .. }) => {
                    prop_assert!(*kind < 3);
                    prop_assert!(program.next().is_none());
                    let (x, y) = places.next().unwrap();
                    for (axis, place) in [(AxisLetter::X, x), (AxisLetter::Y, y)] {
                        if axes.contains(axis) {
                            at[axis] = place;
                        }
                    }
                    program.homed(at);
                }
                Some(Action::Rapid { to }) => {
                    prop_assert_eq!(*kind, 3);
                    let round = |value: f64| (value * 1e3).round() / 1e3;
                    at[AxisLetter::X] += round(*x);
                    at[AxisLetter::Y] += round(*y);
                    let off = to.0.iter().zip(at.0).map(|(to, at)| (to - at).abs());
                    prop_assert!(off.fold(0.0, f64::max) < 1e-9, "{:?} {:?}", to, at);
                    at = to;
                }
                other => prop_assert!(false, "{:?}", other),
            }
        }
        prop_assert_eq!(next_homing(&mut program), (None, vec![]));
    }
}

/// A homing switches what waits for a motion, as a run does there: begun behind it, the output is on already.
#[test]
fn a_passed_homing_has_switched_what_waits_for_a_motion() {
    for homing in ["G28.2 X0", "G28.2"] {
        let text = format!("M62 P1\n{homing}\n(MSG, here)\nG0 X9\nM2");
        let mut program = Interpreter::from_text("part.ngc", text, setup());
        let entry = program.enter_at_line(3).unwrap();
        assert!(entry.with_motion.is_empty(), "{:?}", entry.with_motion);
        let on = |action: &Action| {
            matches!(
                action,
                Action::Output(Output::Digital {
                    number: 1,
                    on: true,
                    with_motion: false
                })
            )
        };
        assert_eq!(entry.set_up.iter().filter(|action| on(action)).count(), 1);
    }
}
