//! Arcs: both formats, planes, helices, turns, and where they go between their ends.

use std::f64::consts::{PI, TAU};

use proptest::prelude::*;
use syncline_gcode::{Action, Arc, AxisLetter, Direction, Feed, Plane};

use super::listing::{listing, run, run_with, xyz};

#[test]
fn formats_and_planes() {
    insta::assert_snapshot!(listing(
        "G0 Z1 F600
G2 X10 Y0 I5
G3 X0 I-5 J0 Z-2
G2 X10 R5
G3 X0 R-6
G3 I5 (a full circle)
G2 X0 Y0 J5 P3
G18 G2 X8 Z-10 K-8
G19 G3 Y10 Z0 R30
G17 G90.1 G2 X20 Y10 I14 J10
G91.1 G91 G3 X-10 Y10 J10
M2"
    ));
}

fn arc_of(program: &str) -> Arc {
    let commands = run(program).unwrap();
    match commands.iter().rev().nth(1).map(|command| &command.action) {
        Some(Action::Arc { arc, .. }) => *arc,
        other => panic!("{other:?}"),
    }
}

#[test]
fn radii_that_differ_by_rounding_end_exactly() {
    for (start, end, center) in [
        ("X10", "X0.0 Y10.004", "I-10"),
        ("X10", "X0.0 Y10.027", "I-10"),
        // A post-processor's three decimals of an inch, and a short arc of a great radius.
        ("X35.56", "X38.1 Y2.515", "I0.013 J2.54"),
        ("X1000", "X999.99 Y2.0", "I-1000"),
    ] {
        let arc = arc_of(&format!("G0 {start}\nG3 {end} {center} F600\nM2"));
        assert_eq!(arc.at(0.0), arc.from);
        assert_eq!(arc.at(1.0), arc.to);
        assert!((arc.start_radius - arc.end_radius).abs() < 1e-9, "{arc:?}");
        assert!(arc.deviation < 0.028, "{arc:?}");
    }
    // What differs by rounding alone is left as it is.
    assert_eq!(
        arc_of("G0 X10\nG3 Y10.0000001 X0 I-10 F600\nM2").deviation,
        0.0
    );
}

/// All but a full circle: to move the centre would move the far side by much more than the radii
/// differ.
#[test]
fn the_centre_of_nearly_a_circle_stays() {
    let arc = arc_of("G0 X10\nG3 X10.004 Y-0.01 I-10 F600\nM2");
    assert_eq!(arc.center, [0.0, 0.0]);
    assert!((arc.end_radius - 10.004).abs() < 1e-5);
    assert!(run("G0 X10\nG3 X10.02 Y-0.01 I-10 F600\nM2").is_err());
}

/// How far an arc turns about a point, and the least and greatest distance that it has from it: by what is handed out of
/// an arc (ends, centre, whole turns, sense), as whoever follows it takes that.
fn about(arc: &Arc, nominal: [f64; 2], turns: u32) -> (f64, [f64; 2]) {
    let [first, second, _] = arc.plane.axes();
    let ray = |point: [f64; 2], center: [f64; 2]| {
        let [x, y] = [point[0] - center[0], point[1] - center[1]];
        (x.hypot(y), y.atan2(x))
    };
    let (start_radius, start) = ray([arc.from[first], arc.from[second]], arc.center);
    let (end_radius, end) = ray([arc.to[first], arc.to[second]], arc.center);
    let counterclockwise = arc.direction() == Direction::Counterclockwise;
    let between = if counterclockwise {
        end - start
    } else {
        start - end
    };
    let one = match between.rem_euclid(TAU) {
        0.0 => TAU,
        part => part,
    };
    let sweep = one + TAU * f64::from(arc.turns);
    assert_eq!(arc.turns, turns - 1);
    let steps = 720 * turns;
    let (mut turned, mut extremes, mut last) = (0.0, [f64::INFINITY, 0.0_f64], None);
    for k in 0..=steps {
        let part = f64::from(k) / f64::from(steps);
        let angle = start + if counterclockwise { sweep } else { -sweep } * part;
        let radius = start_radius + (end_radius - start_radius) * part;
        let point = [
            arc.center[0] + radius * angle.cos(),
            arc.center[1] + radius * angle.sin(),
        ];
        let (away, here) = ray(point, nominal);
        extremes = [extremes[0].min(away), extremes[1].max(away)];
        let step = here - last.replace(here).unwrap_or(here);
        turned += step - TAU * (step / TAU).round();
    }
    (turned.abs(), extremes)
}

#[test]
fn a_circle_that_does_not_quite_close_is_a_circle() {
    for (program, nominal, radius, turns) in [
        ("G0 X0\nG3 X0.001 Y0 I5", [5.0, 0.0], 5.0, 1),
        ("G0 X0\nG3 X0.00001 Y0 I5", [5.0, 0.0], 5.0, 1),
        ("G0 X0\nG3 X0.005 Y0 I5", [5.0, 0.0], 5.0, 1),
        ("G0 X10\nG2 X10.001 Y0 I-5 Z-1 P3", [5.0, 0.0], 5.0, 3),
        (
            "G0 X0\nG3 X0.0012 Y-0.0087 I1.3511 J-9.9685",
            [1.3511, -9.9685],
            10.06,
            1,
        ),
        ("G0 X0\nG2 X0.1 Y0 I100", [100.0, 0.0], 100.0, 1),
    ] {
        let arc = arc_of(&format!("F600\n{program}\nM2"));
        let (turned, [least, greatest]) = about(&arc, nominal, turns);
        assert!(
            (turned - TAU * f64::from(turns)).abs() < 2e-3,
            "{program}: {turned} {arc:?}"
        );
        assert!(greatest - least < 0.1001, "{program}: {arc:?}");
        assert!((least - radius).abs() < 0.2, "{program}: {arc:?}");
    }
    // Too far off to be one.
    assert!(run("G3 X0.027 Y0 I5 F600\nM2").is_err());
}

proptest! {
    /// A full circle, or a helix of several, whose end misses its start by up to what radii may differ, or lies short of it,
    /// goes around as often as it says, and as near to the programmed circle as radii may differ; or it is refused.
    #[test]
    fn a_circle_that_misses_its_start_goes_around(
        radius in prop_oneof![0.5f64..5.0, 5.0f64..1000.0],
        start in prop_oneof![(0u8..4).prop_map(|k| f64::from(k) * PI / 2.0), 0.0..TAU],
        off in -1.0f64..1.0,
        speck in prop_oneof![Just(0.0), -6.0f64..0.0],
        short in prop_oneof![Just(0.0), 0.0f64..1.0],
        clockwise: bool,
        turns in 1u32..6,
        plane in 0usize..3,
        origin in prop_oneof![Just([0.0, 0.0]), [-500.0f64..500.0, -500.0f64..500.0]],
    ) {
        let (code, plane) = [(17usize, Plane::Xy), (18, Plane::Zx), (19, Plane::Yz)][plane];
        let [first, second, third] = plane.axes();
        let letters = [["I", "J"], ["K", "I"], ["J", "K"]][code - 17];
        let allowed = f64::max(0.028, 0.001 * radius);
        let slight = f64::max(0.005, 0.001 * radius);
        // From a nanometre to all that is allowed.
        let off = off * allowed * 10f64.powf(speck);
        let back = short * slight / radius;
        let end = if clockwise { start + back } else { start - back };
        let at = |radius: f64, angle: f64| [
            origin[0] + radius * angle.cos(),
            origin[1] + radius * angle.sin(),
        ];
        let ([a, b], [c, d]) = (at(radius, start), at(radius + off, end));
        let program = format!(
            "G{code} G0 {first}{a:.12} {second}{b:.12}\nG{} {first}{c:.12} {second}{d:.12} {third}-7 {}{:.12} {}{:.12} P{turns} F100\nM2",
            if clockwise { 2 } else { 3 },
            letters[0], origin[0] - a, letters[1], origin[1] - b,
        );
        if run(&program).is_err() {
            prop_assert!(off.abs() > slight - 1e-9, "{program}");
            return Ok(());
        }
        let arc = arc_of(&program);
        let (turned, [least, greatest]) = about(&arc, origin, turns);
        let whole = TAU * f64::from(turns) - back;
        prop_assert!((turned - whole).abs() < 1e-9 + 2e-6 / radius, "{program}: {turned} {arc:?}");
        let fine = 1e-6;
        prop_assert!(least > radius - allowed - fine && greatest < radius + allowed + fine, "{program}: {arc:?}");
    }

    /// Where axes stand beside what is shown, as encoders have it, a circle that begins there is the whole circle, or it is
    /// refused where it may be either. Once the axes were sent to its start, it ends where the program says.
    #[test]
    fn a_circle_from_where_the_axes_were_found_is_whole(
        radius in 2.0f64..100.0,
        angle in 0.0..TAU,
        beside in (-5.0f64..-1.0).prop_map(|digits| 10f64.powf(digits)),
        way in 0.0..TAU,
        named in 0usize..3,
        clockwise: bool,
        turns in 1u32..4,
        plane in 0usize..3,
        sent: bool,
    ) {
        let (code, plane) = [(17usize, Plane::Xy), (18, Plane::Zx), (19, Plane::Yz)][plane];
        let [first, second, _] = plane.axes();
        let [i, j] = [["I", "J"], ["K", "I"], ["J", "K"]][code - 17];
        let mut setup = xyz();
        // One axis or both are beside 0.
        let off = [beside * way.cos(), beside * way.sin()];
        let off = [if named == 1 { 0.0 } else { off[0] }, if named == 2 { 0.0 } else { off[1] }];
        (setup.start[first], setup.start[second]) = (off[0], off[1]);
        let circle = format!(
            "G{} {first}0 {second}0 {i}{:.12} {j}{:.12} P{turns}",
            if clockwise { 2 } else { 3 }, radius * angle.cos(), radius * angle.sin(),
        );
        let first_move = if sent { format!("G0 {first}{:.12} {second}{:.12}\n", off[0], off[1]) } else { String::new() };
        let program = format!(
            "G{code} F100\n{first_move}{circle}\n{circle}\nM2",
        );
        let apart = off[0].hypot(off[1]);
        let commands = match run_with(setup, &program) {
            Ok(commands) => commands,
            Err(error) => {
                let is_near = !sent && apart > 0.002 && apart < 0.05;
                let told = error.to_string();
                let is_beside = told.contains("where the axes stand");
                prop_assert!(if is_beside { is_near } else { apart > 0.0049 }, "{told}");
                return Ok(());
            }
        };
        let arcs: Vec<Arc> = commands.iter().filter_map(|command| match &command.action {
            Action::Arc { arc, .. } => Some(*arc),
            _ => None,
        }).collect();
        let [arc, again] = arcs[..] else { panic!("{program}") };
        // The second pass is no speck either.
        prop_assert!(again.sweep.abs() > TAU * f64::from(turns) - 0.2 || sent && apart > 1e-6, "{again:?}");
        let whole = TAU * f64::from(turns);
        if !sent && apart < 0.05 {
            // It ends short of its start, or at it.
            prop_assert!(apart < 0.002 || arc.to[first].abs() < 1e-9 && arc.to[second].abs() < 1e-9);
            prop_assert!((arc.sweep.abs() - whole).abs() < 1.1 * apart / radius + 1e-6, "{arc:?}");
        } else if apart > 1e-6 {
            prop_assert!(arc.to[first].abs() < 2e-6 && arc.to[second].abs() < 2e-6, "{arc:?}");
        }
    }

    /// The tolerance holds at its edge, and the arc stays within its deviation of the program's.
    #[test]
    fn a_moved_centre_keeps_the_arc(sweep in 0.01f64..6.2, radius in 1f64..100.0, off in -0.06f64..0.06) {
        let end = [(radius + off) * sweep.cos(), (radius + off) * sweep.sin()];
        let program = format!("G0 X{radius} Y0\nG3 X{} Y{} I-{radius} F600\nM2", end[0], end[1]);
        let allowed = 0.028f64.max(0.001 * radius);
        match run(&program) {
            Ok(_) => {
                prop_assert!(off.abs() < allowed + 1e-9);
                let arc = arc_of(&program);
                for k in 0..=100 {
                    let point = arc.at(f64::from(k) / 100.0);
                    let away = point[AxisLetter::X].hypot(point[AxisLetter::Y]) - radius;
                    prop_assert!(away.abs() < off.abs() + arc.deviation + 1e-6, "{}", away);
                }
            }
            Err(_) => prop_assert!(off.abs() > 0.005, "{}", off),
        }
    }
}

#[test]
fn a_great_circle_may_differ_by_a_thousandth() {
    assert!(run("G0 X1000\nG3 X0 Y1000.9 I-1000 F600\nM2").is_ok());
    assert!(run("G0 X1000\nG3 X0 Y1001.1 I-1000 F600\nM2").is_err());
}

#[test]
fn feed_is_per_second() {
    let commands = run("G2 I5 F90\nM2").unwrap();
    let Action::Arc { feed, .. } = commands[0].action else {
        panic!("{commands:?}")
    };
    assert_eq!(feed, Feed::Rate(1.5));
}

proptest! {
    /// The whole arc lies within its extents and touches them.
    #[test]
    fn extents_hold_the_arc(
        radius in 0.02f64..1000.0,
        start in 0.0f64..360.0,
        swept in 1.0f64..359.0,
        stretch in -0.9f64..0.9,
        clockwise: bool,
        turns in 1u32..4,
        plane in 0usize..3,
    ) {
        let (code, plane) = [(17, Plane::Xy), (18, Plane::Zx), (19, Plane::Yz)][plane];
        let allowed = f64::max(0.005, 0.001 * radius);
        let end_radius = radius + stretch * allowed;
        let end = if clockwise { start - swept } else { start + swept };
        let [first, second, third] = plane.axes();
        let offsets = match plane {
            Plane::Xy => ["I", "J"],
            Plane::Zx => ["K", "I"],
            Plane::Yz => ["J", "K"],
        };
        let (a, b) = (start.to_radians(), end.to_radians());
        let arc = arc_of(&format!(
            "G{code} G0 {first}{:.6} {second}{:.6}\nG{} {first}{:.6} {second}{:.6} {third}7 {}{:.6} {}{:.6} P{turns} F100\nM2",
            radius * a.cos(), radius * a.sin(),
            if clockwise { 2 } else { 3 },
            end_radius * b.cos(), end_radius * b.sin(),
            offsets[0], -radius * a.cos(), offsets[1], -radius * a.sin(),
        ));
        let expected = (swept + 360.0 * f64::from(turns - 1)).to_radians();
        prop_assert!((arc.sweep.abs() - expected).abs() < 1e-3 + 1e-5 / radius, "{arc:?}");
        for axis in [first, second, third] {
            let (least, greatest) = arc.extent(axis);
            let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
            let samples = 4000 * turns;
            for k in 0..=samples {
                let value = arc.at(f64::from(k) / f64::from(samples))[axis];
                low = low.min(value);
                high = high.max(value);
            }
            let fine = 1e-9 * radius.max(1.0);
            prop_assert!(least <= low + fine && greatest >= high - fine, "{axis} {arc:?}");
            // A sample lies within half a step of the extreme: r·(step/2)²/2.
            let coarse = 4e-7 * radius + 1e-5;
            prop_assert!(least >= low - coarse && greatest <= high + coarse, "{axis} {arc:?}");
        }
        prop_assert_eq!(arc.at(0.0), arc.from);
        prop_assert_eq!(arc.at(1.0), arc.to);
        let near = arc.at(1.0 - 1e-12);
        for axis in [first, second] {
            prop_assert!((near[axis] - arc.to[axis]).abs() < 1e-7 * radius.max(1.0), "{arc:?}");
        }
    }

    /// A radius arc passes through its ends with the radius asked for, and turns the shorter way
    /// for R > 0.
    #[test]
    fn radius_arcs(
        x in -100.0f64..100.0,
        y in 1.0f64..100.0,
        excess in 1.001f64..10.0,
        long: bool,
        clockwise: bool,
    ) {
        let radius = x.hypot(y) / 2.0 * excess;
        let arc = arc_of(&format!(
            "G{} X{x:.6} Y{y:.6} R{}{radius:.6} F100\nM2",
            if clockwise { 2 } else { 3 },
            if long { "-" } else { "" },
        ));
        prop_assert!((arc.start_radius - radius).abs() < 1e-5);
        prop_assert!((arc.end_radius - radius).abs() < 1e-5);
        prop_assert_eq!(arc.sweep < 0.0, clockwise);
        prop_assert_eq!(arc.sweep.abs() > std::f64::consts::PI, long);
    }
}
