//! G5, G5.1, and G5.2 to G5.3.

use proptest::prelude::*;
use syncline_gcode::{Action, AxisLetter, Interpreter, Spline};

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
        assert_eq!(program.enter_at_line(line).is_ok(), right, "{line}");
    }
}

/// A quarter of a circle is the rational curve of second degree whose middle weight is the cosine of 45°.
#[test]
fn weights_make_circles() {
    let weight = std::f64::consts::FRAC_1_SQRT_2;
    let program = format!("F100 G0 X20 Y0\nG5.2 P1\nX20 Y20 P{weight}\nX0 Y20 P1\nG5.3\nM2");
    let pieces = splines(&program);
    assert!(pieces.len() > 1 && pieces.len() <= 16, "{}", pieces.len());
    for k in 0..=100 {
        let part = f64::from(k) / 100.0;
        for piece in &pieces {
            let point = piece.at(part);
            let radius = point[AxisLetter::X].hypot(point[AxisLetter::Y]);
            assert!((radius - 20.0).abs() < 1e-6, "{radius}");
        }
    }
    // By curvature too, they meet as the circle does.
    for pair in pieces.windows(2) {
        let [a, b] = [&pair[0], &pair[1]].map(|piece| piece.controls());
        let bend = |p: [f64; 2], q: [f64; 2], r: [f64; 2]| {
            let ([ux, uy], [vx, vy]) = ([q[0] - p[0], q[1] - p[1]], [r[0] - q[0], r[1] - q[1]]);
            0.8 * (ux * vy - uy * vx) / ux.hypot(uy).powi(3)
        };
        let curvatures = [bend(a[5], a[4], a[3]).abs(), bend(b[0], b[1], b[2]).abs()];
        for curvature in curvatures {
            assert!((curvature - 0.05).abs() < 1e-9, "{curvatures:?}");
        }
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
                for (axis, index) in [(AxisLetter::X, 0), (AxisLetter::Y, 1)] {
                    let expected: f64 = (0..count)
                        .map(|i| basis(order, count, i, order - 1, t) * controls[i][index])
                        .sum();
                    let found = piece.at(part)[axis];
                    prop_assert!((found - expected).abs() < 1e-9, "{t}: {found} {expected}");
                }
            }
        }
    }

    /// With weights it is a rational curve, which the polynomials follow to a nanometre, each from where the one before
    /// it ends, in its direction and with its curvature.
    #[test]
    fn weighted_b_splines_are_followed_to_a_nanometre(
        points in prop::collection::vec(prop::array::uniform2(-50.0..50.0_f64), 2..9),
        magnitude in 0.0..3.0_f64,
        exponents in prop::collection::vec(-1.0..1.0_f64, 9),
        order in 3..7_usize,
        start_has_weight in any::<bool>(),
    ) {
        let count = points.len() + 1;
        prop_assume!(count >= order);
        let mut weights: Vec<f64> = exponents.iter().map(|it| 10.0_f64.powf(it * magnitude)).collect();
        let mut program = format!("F100 G5.2 L{order}");
        if start_has_weight {
            program += &format!(" P{}\n", weights[0]);
        } else {
            weights[0] = 1.0;
        }
        for ([x, y], weight) in points.iter().zip(&weights[1..]) {
            program += &format!(" X{x} Y{y} P{weight}\n");
        }
        let pieces = splines(&(program + "G5.3\nM2"));
        let mut controls = vec![[0.0, 0.0]];
        controls.extend(&points);
        let on_curve = |t: f64| -> [f64; 2] {
            let mut sums = [0.0; 3];
            for i in 0..count {
                let share = weights[i] * basis(order, count, i, order - 1, t);
                sums[0] += share * controls[i][0];
                sums[1] += share * controls[i][1];
                sums[2] += share;
            }
            [sums[0] / sums[2], sums[1] / sums[2]]
        };
        // Each stretch between two knots is halved as often as it needs: find the parameters by the ends.
        let spans = count + 1 - order;
        let (mut span, mut from) = (0, 0.0);
        for (number, piece) in pieces.iter().enumerate() {
            let off = |part: f64, t: f64| {
                let found = piece.at(part);
                let [x, y] = on_curve(t);
                (found[AxisLetter::X] - x).hypot(found[AxisLetter::Y] - y)
            };
            prop_assert!(off(0.0, span as f64 + from) < 1e-8);
            // The widest stretch that begins here and whose end is the piece's.
            let mut step = 1.0;
            while from % step != 0.0 || off(1.0, span as f64 + from + step) > 1e-8 {
                step /= 2.0;
                prop_assert!(step > 1e-8, "piece {number} ends nowhere on the curve");
            }
            for k in 0..=20 {
                let part = f64::from(k) / 20.0;
                let off = off(part, span as f64 + from + part * step);
                prop_assert!(off <= 1.001e-6, "piece {number}: {off} mm at {part}");
            }
            from += step;
            if from == 1.0 {
                (span, from) = (span + 1, 0.0);
            }
        }
        prop_assert_eq!((span, from), (spans, 0.0));
        prop_assert!(pieces.len() <= spans * 512, "{} pieces", pieces.len());
        let end = pieces.last().unwrap().to;
        prop_assert_eq!([end[AxisLetter::X], end[AxisLetter::Y]], points[points.len() - 1]);
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
        for (axis, index) in [(AxisLetter::X, 0), (AxisLetter::Y, 1)] {
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
