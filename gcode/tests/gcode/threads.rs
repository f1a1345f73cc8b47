//! Threads: G33, and what it needs.

use syncline_gcode::{Action, Feed, Interpreter, Point, Setup, Spindle, Turning};

use super::listing::{refusals_with, run_with, xyz};

pub(super) fn measured() -> Setup {
    let mut setup = xyz();
    setup.has_spindle_angle = true;
    setup.sets_spindle_speed = true;
    setup.spindle_speeds = Some((60.0, 3000.0));
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

/// Where taps lead, with their leads, and where each begins.
fn taps(text: &str) -> Vec<(Point, Point, f64)> {
    let commands = run_with(measured(), text).unwrap();
    let mut at = Point::ZERO;
    let mut taps = Vec::new();
    for command in &commands {
        match command.action {
            Action::Rapid { to } | Action::Feed { to, .. } => at = to,
            Action::Tap { to, lead } => taps.push((at, to, lead)),
            _ => {}
        }
    }
    taps
}

/// It is back where it began.
#[test]
fn a_tap_leads_there_and_back() {
    let text =
        "G21 G90 M3 S300\nG0 X1 Z5\nG33.1 Z-10 K1.5\nZ-12 K1.25\nG0 X3\nG91 G33.1 Z-4 K0.5\nM2\n";
    let expected = [
        (point(1.0, 5.0), point(1.0, -10.0), 1.5),
        (point(1.0, 5.0), point(1.0, -12.0), 1.25),
        (point(3.0, 5.0), point(3.0, 1.0), 0.5),
    ];
    assert_eq!(taps(text), expected);
    let mut program = Interpreter::from_text("part.ngc", text, measured());
    let entry = program.enter_at_line(5).unwrap();
    assert_eq!(entry.at, point(1.0, 5.0));
}

/// K holds for the series, F over S stands for it, and M4 makes it left-handed.
#[test]
fn cycles_tap_at_each_place() {
    let text = "G21 G90 M3 S600 F100\nG0 Z20\nG99 G84 X1 Z-10 R3 K1.5\nX2\nX3 K1 F600\nG80 M4\n\
                F750 G98 G74 X4 Z-5 R3\nG20 G84 M3 X1 Z-0.5 R0.1 S400 F20\nM2\n";
    let mut found = taps(text);
    let (_, _, inch) = found.last_mut().unwrap();
    assert!((*inch - 1.27).abs() < 1e-12, "{inch}");
    *inch = 1.27;
    let last = found.pop().unwrap();
    assert!((last.0.0[0] - 25.4).abs() < 1e-9 && (last.1.0[2] + 12.7).abs() < 1e-9);
    let expected = [
        (point(1.0, 3.0), point(1.0, -10.0), 1.5),
        (point(2.0, 3.0), point(2.0, -10.0), 1.5),
        (point(3.0, 3.0), point(3.0, -10.0), 1.0),
        (point(4.0, 3.0), point(4.0, -5.0), 1.25),
    ];
    assert_eq!(found, expected);
}

/// How deep each pass is, from the crest, where along Z it begins, and where it ends.
fn passes(text: &str) -> Vec<[f64; 3]> {
    let commands = run_with(measured(), text).unwrap();
    let (mut at, mut passes) = (Point::ZERO, Vec::new());
    for command in &commands {
        match command.action {
            Action::Rapid { to } => at = to,
            Action::Thread { to, lead } => {
                assert_eq!(lead, 1.5);
                assert_eq!(at.0[0], to.0[0]);
                passes.push([at.0[0], at.0[2], to.0[2]]);
                at = to;
            }
            _ => {}
        }
    }
    passes
}

/// As deep as LinuxCNC has them: J times the R-th root of the pass's number, the last as deep as K, springs as the last.
#[test]
fn a_threading_cycle_is_a_sequence_of_passes() {
    let begin = "G21 G90 G18 M3 S300\nG0 X12 Z5\n";
    let constant = passes(&format!("{begin}G76 P1.5 Z-20 I-2 J0.3 K0.8\nM2\n"));
    let expected = [9.7, 9.4, 9.2].map(|x| [x, 5.0, -20.0]);
    assert_eq!(constant.len(), 3);
    for (pass, expected) in constant.iter().flatten().zip(expected.iter().flatten()) {
        assert!((pass - expected).abs() < 1e-9, "{constant:?}");
    }
    // Of constant area, along a flank of 30°, with two springs, inside.
    let flank = passes(&format!(
        "{begin}G76 P1.5 Z-20 I2 J0.4 K0.8 R2 Q30 H2\nM2\n"
    ));
    let depths = [0.4, 0.4 * 2f64.sqrt(), 0.4 * 3f64.sqrt(), 0.8, 0.8, 0.8];
    assert_eq!(flank.len(), depths.len());
    for ([x, from, to], depth) in flank.iter().zip(depths) {
        assert!((x - (14.0 + depth)).abs() < 1e-9, "{flank:?}");
        assert!((from - (5.0 - depth * 30f64.to_radians().tan())).abs() < 1e-9);
        assert_eq!(*to, -20.0);
    }
    // It ends on the line on which it began, at Z.
    let text = format!("{begin}G76 P1.5 Z-20 I-2 J0.3 K0.8\nG0 X20\nM2\n");
    let mut program = Interpreter::from_text("part.ngc", &text, measured());
    let entry = program.enter_at_line(4).unwrap();
    assert_eq!(entry.at, point(12.0, -20.0));
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
            ("G33.1 Z-10 K1", "1:1"),
            ("M3 S300 G33.1 Z-10", "1:9"),
            ("M3 S300 G33.1 Z-60 K1", "1:15"),
            ("M3 S300 G33.1 K1", "1:9"),
            ("G18 G76 P1 Z-9 I-1 J0.1 K0.5", "1:5"),
            ("M3 S300 G76 P1 Z-9 I-1 J0.1 K0.5", "1:9"),
            ("G18 M3 S300 G76 Z-9 I-1 J0.1 K0.5", "1:13"),
            ("G18 M3 S300 G76 P1 Z-9 J0.1 K0.5", "1:13"),
            ("G18 M3 S300 G76 P1 Z-9 I-1 K0.5", "1:13"),
            ("G18 M3 S300 G76 P1 Z-9 I-1 J0.1", "1:13"),
            ("G18 M3 S300 G76 P1 X1 Z-9 I-1 J0.1 K0.5", "1:20"),
            ("G18 M3 S300 G76 P1 Z0 I-1 J0.1 K0.5", "1:13"),
            ("G18 M3 S300 G76 P1 Z-9 I0 J0.1 K0.5", "1:24"),
            ("G18 M3 S300 G76 P1 Z-9 I-1 J0 K0.5", "1:28"),
            ("G18 M3 S300 G76 P1 Z-9 I-1 J0.1 K0", "1:33"),
            ("G18 M3 S300 G76 P1 Z-9 I-1 J0.1 K0.5 R0.5", "1:38"),
            ("G18 M3 S300 G76 P1 Z-9 I-1 J0.1 K0.5 Q90", "1:38"),
            ("G18 M3 S300 G76 P1 Z-9 I-1 J0.1 K0.5 H0.5", "1:38"),
            ("G18 M3 S300 G76 P1 Z-9 I-1 J0.1 K0.5 E1 L1", "1:38"),
            ("G18 M3 S300 G76 P1 Z-9 I-1 J0.0001 K0.5", "1:13"),
            ("G18 M3 S300 G76 P1 Z-60 I-1 J0.1 K0.5", "1:20"),
            ("G84 Z-10 R1 K1", "1:1"),
            ("M4 S300 G84 Z-10 R1 K1", "1:9"),
            ("M3 S300 G74 Z-10 R1 K1", "1:9"),
            ("M3 S300 G84 Z-10 R1", "1:9"),
            ("M3 S300 F301 G84 Z-10 R1 K1", "1:9"),
            ("M3 S300 G84 Z-10 K1", "1:9"),
            ("M3 S300 G84 Z-10 R1 K0", "1:21"),
            ("M3 S300 G84 Z-10 R1 K1 P1", "1:24"),
            ("M3 S300 G84 Z-60 R1 K1", "1:13"),
        ],
    );
    insta::assert_snapshot!(told);
}

// --- G95 ---

/// The feeds of a program's lines and arcs.
fn feeds(text: &str) -> Vec<Feed> {
    let commands = run_with(measured(), text).unwrap();
    let feeds = commands.iter().filter_map(|command| match command.action {
        Action::Feed { feed, .. } | Action::Arc { feed, .. } => Some(feed),
        _ => None,
    });
    feeds.collect()
}

#[test]
fn a_feed_by_turns_is_in_the_units_of_its_block_and_has_the_speed_that_is_told() {
    let by = |travel, turns| Feed::PerTurn { travel, turns };
    let text = "M3 S600 G95 F0.5\nG1 X1\nG2 X3 R5\nS300 G1 X4\nG20 F0.01 X1\nM4 X2\nG94 F60 X3\nG93 X4 F2\nG95 F0.1 X5";
    assert_eq!(
        feeds(text),
        [
            by(0.5, 10.0),
            by(0.5, 10.0),
            by(0.5, 5.0),
            by(0.254, 5.0),
            by(0.254, 5.0),
            Feed::Rate(25.4),
            Feed::Duration(30.0),
            by(2.54, 5.0),
        ]
    );
    // Drilled, and for a turn about an axis.
    assert_eq!(feeds("M3 S600 G95 F0.2 G81 Z-5 R1"), [by(0.2, 10.0)]);
    // Tapped, F is the lead.
    assert_eq!(taps("M3 S600 G95 F1.25 G84 Z-5 R1")[0].2, 1.25);
    // Saved and restored.
    assert_eq!(
        feeds("M3 S60 G95 F2\nM70\nG94 F60 G1 X1\nM72\nX2"),
        [Feed::Rate(1.0), by(2.0, 1.0)]
    );
}

#[test]
fn what_a_feed_by_turns_lacks_is_told() {
    insta::assert_snapshot!(refusals_with(
        &measured(),
        &[
            ("G95 F0.5 G1 X1", "1:10"),
            ("M3 G95 F0.5 G1 X1", "1:13"),
            ("M3 S600 G95 F0.5 G1 X1\nM5\nX2", "3:1"),
            ("F100 M3 S600\nG95 G1 X1", "2:5"),
            ("M3 S600 G95 F0.5 G1 X1\nG94 X2", "2:1"),
        ]
    ));
}

// --- G96 ---

/// What a program tells its spindle.
pub(super) fn spindles(text: &str) -> Vec<Spindle> {
    let commands = run_with(measured(), text).unwrap();
    let told = commands.iter().filter_map(|command| match command.action {
        Action::Spindle(spindle) => Some(spindle),
        _ => None,
    });
    told.collect()
}

#[test]
fn a_surface_speed_is_of_the_radius_about_x0() {
    let text = "M3 G96 S120 D2500\nG92 X10\nG20 S300\nG97 S500";
    let told = spindles(text);
    let surfaces: Vec<_> = told.iter().map(|it| it.surface).collect();
    let [first, moved, feet, none] = surfaces[..] else {
        panic!("{told:?}");
    };
    let (first, moved, feet) = (first.unwrap(), moved.unwrap(), feet.unwrap());
    let near = |speed: f64, wanted: f64| assert!((speed - wanted).abs() < 1e-9, "{speed}");
    near(first.speed, 2000.0);
    assert_eq!(first.centre, 0.0);
    assert_eq!(first.within, (60.0, 2500.0));
    near(moved.speed, 2000.0);
    near(feet.speed, 1524.0);
    assert_eq!((moved.centre, feet.centre), (-10.0, -10.0));
    assert_eq!(none, None);
    assert_eq!(told[3].speed, 500.0);
    for (x, speed) in [
        (0.0, 2500.0),
        (1e4, 60.0),
        (-20.0, 60_000.0 / 20.0 / core::f64::consts::PI),
    ] {
        assert!((first.speed_at(x) - speed).abs() < 1e-9, "{x}");
    }
    // M2 ends it.
    let mut program =
        Interpreter::from_text("part.ngc", text.split("\nG97").next().unwrap(), measured());
    assert!(program.by_ref().all(|command| command.is_ok()));
    let left = program.memory();
    let spindle = left.modes().spindle;
    assert_eq!(
        spindle,
        Spindle {
            turning: Turning::Off,
            speed: 0.0,
            ..Spindle::default()
        }
    );
}

/// With both the feed's time is that of the least speed on its way.
#[test]
fn a_feed_by_turns_at_a_surface_speed() {
    let pi = core::f64::consts::PI;
    let turns = |radius: f64| 1000.0 / (2.0 * pi * radius);
    let by = feeds("M3 G96 S60 G95 F0.2\nG0 X10\nG1 X40\nX20");
    for (feed, radius) in by.iter().zip([40.0, 40.0]) {
        let Feed::PerTurn {
            travel,
            turns: told,
        } = *feed
        else {
            panic!("{feed:?}");
        };
        assert_eq!(travel, 0.2);
        assert!((told - turns(radius)).abs() < 1e-9, "{told}");
    }
    assert_eq!(by.len(), 2);
}

#[test]
fn what_a_surface_speed_lacks_is_told() {
    insta::assert_snapshot!(refusals_with(
        &measured(),
        &[
            ("G96 D2000", "1:1"),
            ("G96 S100 D-1", "1:10"),
            ("G96 S100 D50", "1:10"),
            ("G96 S200000", "1:5"),
            ("G96 S100\nG97", "2:1"),
            ("M3 G96 S100\nG33 Z-5 K1", "2:1"),
            ("M3 G96 S100\nG10 L2 P1 R10", "2:1"),
        ]
    ));
    let mut unlimited = measured();
    unlimited.spindle_speeds = None;
    insta::assert_snapshot!(refusals_with(&unlimited, &[("G96 S100", "1:1")]));
}
