//! G5, G5.1, and G5.2 to G5.3.

use proptest::prelude::*;
use syncline_gcode::{Action, Axis, Interpreter, Spline};

use super::listing::{listing, listing_with, refusals_with, run, xyz};

fn splines(program: &str) -> Vec<Spline> {
    let commands = run(program).unwrap_or_else(|error| panic!("{program}\n{error}"));
    let splines = commands.iter().filter_map(|command| match &command.action {
        Action::Spline { spline, .. } => Some(*spline),
        _ => None,
    });
    splines.collect()
}

#[test]
fn each_kind() {
    insta::assert_snapshot!(listing(
        "F600 G5 X10 Y0 I2 J3 P-2 Q3
X20 P-1 Q-1
G91 G5.1 X10 I5 J5
G20 G90 G5.1 X2 Y0 I-1
G21 G0 X0 Y0
G5.2 P1 L3 X0 Y1
X2 Y2
X2 Y0
F300
X0 P1
G5.3
G1 X3
M2"
    ));
}

#[test]
fn in_the_coordinates_of_the_work() {
    let mut setup = xyz();
    setup.tables.work_offsets[0].0 = [100.0, 50.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    insta::assert_snapshot!(listing_with(
        setup,
        "F600 G1 X0 Y0 Z0
G5.1 @10 ^90 I5
G91 G5.2 X1 Y1
X1 Y1
^30
G5.3
M2"
    ));
}

#[test]
fn soft_limits_hold_for_the_whole_curve() {
    let mut setup = xyz();
    setup.limits[0] = Some((-10.0, 30.0));
    setup.limits[1] = Some((-2.0, 3.0));
    let inside = "F600 G5 X10 Y0 I3 J4 P-3 Q4\nM2";
    let commands: Result<Vec<_>, _> =
        Interpreter::from_text("part.ngc", inside, setup.clone()).collect();
    assert!(commands.is_ok());
    let programs = [
        ("F600 G5 X10 Y0 I3 J4.1 P-3 Q4", "1:13"),
        ("F600 G5.1 X10 Y0 I5 J-4.1", "1:15"),
        ("F600 G5.2 X10 Y7\nX30\nX40\nG5.3", "4:1"),
    ];
    insta::assert_snapshot!(refusals_with(&setup, &programs));
}

#[test]
fn beginning_between_points_is_refused() {
    let program = "F600 G5.2 X1\nX2 Y1\nX3\nG5.3\nG1 X0\nM2";
    for (line, right) in [(1, true), (2, false), (4, false), (5, true)] {
        let mut program = Interpreter::from_text("part.ngc", program, xyz());
        assert_eq!(program.start_at_line(line).is_ok(), right, "{line}");
    }
}

/// The basis of B-splines by its recursion, over knots at whole numbers that both ends have `order` times.
fn basis(order: usize, points: usize, index: usize, degree: usize, t: f64) -> f64 {
    let spans = (points + 1 - order) as f64;
    let knot = |k: usize| (k as f64 - (order as f64 - 1.0)).clamp(0.0, spans);
    if degree == 0 {
        let last = t == spans && knot(index) < spans && knot(index + 1) == spans;
        let inside = knot(index) <= t && t < knot(index + 1);
        return f64::from(u8::from(inside || last));
    }
    let part = |value: f64, from: usize, to: usize| {
        let whole = knot(to) - knot(from);
        if whole == 0.0 { 0.0 } else { value / whole }
    };
    let rising = part(t - knot(index), index, index + degree);
    let falling = part(knot(index + degree + 1) - t, index + 1, index + degree + 1);
    rising * basis(order, points, index, degree - 1, t)
        + falling * basis(order, points, index + 1, degree - 1, t)
}

proptest! {
    /// Between any two of its knots a B-spline is the polynomial that comes of it.
    #[test]
    fn b_splines_are_their_polynomials(
        points in prop::collection::vec(prop::array::uniform2(-50.0..50.0_f64), 2..12),
        order in 3..7_usize,
    ) {
        let count = points.len() + 1;
        prop_assume!(count >= order);
        let mut program = format!("F100 G5.2 L{order}\n");
        for [x, y] in &points {
            program += &format!("X{x} Y{y}\n");
        }
        let pieces = splines(&(program + "G5.3\nM2"));
        prop_assert_eq!(pieces.len(), count + 1 - order);
        let mut controls = vec![[0.0, 0.0]];
        controls.extend(&points);
        for (span, piece) in pieces.iter().enumerate() {
            for k in 0..=10 {
                let part = f64::from(k) / 10.0;
                let t = span as f64 + part;
                for (axis, index) in [(Axis::X, 0), (Axis::Y, 1)] {
                    let expected: f64 = (0..count)
                        .map(|i| basis(order, count, i, order - 1, t) * controls[i][index])
                        .sum();
                    let found = piece.at(part)[axis];
                    prop_assert!((found - expected).abs() < 1e-9, "{t}: {found} {expected}");
                }
            }
        }
    }

    /// G5 and G5.1 are Bezier's curves of their control points; what they cover holds them and no more.
    #[test]
    fn cubics_and_quadratics_are_beziers(
        numbers in prop::array::uniform6(-50.0..50.0_f64),
        quadratic in any::<bool>(),
    ) {
        let [x, y, i, j, p, q] = numbers;
        let (program, controls) = if quadratic {
            (format!("F100 G5.1 X{x} Y{y} I{i} J{j}\nM2"), vec![[0.0, 0.0], [i, j], [x, y]])
        } else {
            let program = format!("F100 G5 X{x} Y{y} I{i} J{j} P{p} Q{q}\nM2");
            (program, vec![[0.0, 0.0], [i, j], [x + p, y + q], [x, y]])
        };
        let spline = splines(&program)[0];
        let binomial = |n: usize, k: usize| (1..=k).fold(1.0, |c, m| c * (n + 1 - m) as f64 / m as f64);
        let n = controls.len() - 1;
        for (axis, index) in [(Axis::X, 0), (Axis::Y, 1)] {
            let at = |u: f64| -> f64 {
                (0..=n).map(|k| {
                    binomial(n, k) * u.powi(k as i32) * (1.0 - u).powi((n - k) as i32) * controls[k][index]
                }).sum()
            };
            let (mut least, mut greatest) = (f64::INFINITY, f64::NEG_INFINITY);
            for k in 0..=2000 {
                let u = f64::from(k) / 2000.0;
                let value = at(u);
                (least, greatest) = (least.min(value), greatest.max(value));
                prop_assert!((spline.at(u)[axis] - value).abs() < 1e-10);
            }
            let (low, high) = spline.extent(axis);
            prop_assert!(low <= least + 1e-10 && low > least - 1e-3);
            prop_assert!(high >= greatest - 1e-10 && high < greatest + 1e-3);
        }
    }
}
