//! Threads: G33, and what it needs.

use syncline_gcode::{Action, Interpreter, Point, Setup};

use super::listing::{refusals_with, run_with, xyz};

fn measured() -> Setup {
    let mut setup = xyz();
    setup.has_spindle_angle = true;
    setup.limits[2] = Some((-50.0, 50.0));
    setup
}

/// Where threads lead, with their leads.
fn threads(text: &str) -> Vec<(Point, f64)> {
    let commands = run_with(measured(), text).unwrap();
    let threads = commands.iter().filter_map(|command| match command.action {
        Action::Thread { to, lead } => Some((to, lead)),
        _ => None,
    });
    threads.collect()
}

fn point(x: f64, z: f64) -> Point {
    let mut point = Point::ZERO;
    (point.0[0], point.0[2]) = (x, z);
    point
}

#[test]
fn lead_and_end_are_in_the_units_and_coordinates_of_the_block() {
    let text =
        "G21 G90 M3 S300\nG33 Z-10 K1.5\nX1 Z-20 K2\nG91 G33 Z5 K0.5\nG20 G90 G33 Z-1 K0.1\nM2\n";
    let found = threads(text);
    let expected = [
        (point(0.0, -10.0), 1.5),
        (point(1.0, -20.0), 2.0),
        (point(1.0, -15.0), 0.5),
        (point(1.0, -25.4), 2.54),
    ];
    assert_eq!(found.len(), expected.len());
    for ((at, lead), (to, expected)) in found.iter().zip(&expected) {
        assert!((lead - expected).abs() < 1e-12);
        let off = at.0.iter().zip(to.0).map(|(at, to)| (at - to).abs());
        assert!(off.fold(0.0, f64::max) < 1e-9, "{at:?} for {to:?}");
    }
}

/// A program that is begun behind a thread stands at its end.
#[test]
fn a_program_is_begun_behind_a_thread() {
    let text = "G21 G90 M3 S300\nG33 Z-10 K1.5\nG0 X5\nM2\n";
    let mut program = Interpreter::from_text("part.ngc", text, measured());
    let entry = program.enter_at_line(3).unwrap();
    assert_eq!(entry.at, point(0.0, -10.0));
}

#[test]
fn what_cannot_be_is_refused_with_its_place() {
    let told = refusals_with(
        &measured(),
        &[
            ("G33 Z-10 K1", "1:1"),
            ("M3 G33 Z-10 K1", "1:4"),
            ("M3 S300 G33 Z-10", "1:9"),
            ("M3 S300 G33 Z-10 K0", "1:18"),
            ("M3 S300 G33 Z-10 K-1", "1:18"),
            ("M3 S300 G33 K1", "1:9"),
            ("M3 S300 G33 Z0 K1", "1:9"),
            ("M3 S300 G33 Z-60 K1", "1:13"),
            ("M3 S300\nG41.1 D2\nG1 X10 F100\nG33 Z-10 K1", "4:1"),
            ("M3 S300 G53 G33 Z-10 K1", "1:9"),
        ],
    );
    insta::assert_snapshot!(told);
}
