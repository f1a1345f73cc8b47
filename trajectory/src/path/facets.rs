//! Takes runs of short lines for what they were made from.
//!
//! CAM systems write curves as facets. A path that follows every one of them has the curvature of
//! its joints, not that of the curve. So lines that are short against the tolerance are gathered as
//! long as one line or one arc passes all of them within half of it; what is left of the tolerance
//! is for the blends between the runs. Where a program says within what lines are to be merged, they
//! are, however long they are.

use super::curve::{ArcDefinition, Curve, Plane};
use super::{Exit, Move};

/// Lines up to so many tolerances long are facets.
const SHORT: f64 = 100.0;
/// Least cosine of the turn from one facet to the next.
const GENTLE: f64 = 0.9;
/// Part of the tolerance that a run may stray.
const SHARE: f64 = 0.7;
/// Facets in a run, at most.
const MOST: usize = 64;

/// Moves that one curve stands for.
#[derive(Debug, Clone)]
pub struct Run<const N: usize> {
    /// The curve, with the feed, the exit and the tag of the last move.
    pub motion: Move<N>,
    /// How far it strays from the moves, at most, mm.
    pub astray: f64,
    /// Ends of the moves.
    points: Vec<[f64; N]>,
    /// Direction of the last move.
    heading: [f64; N],
    /// All of them are short, and turn little from one to the next.
    curve_like: bool,
}

impl<const N: usize> Run<N> {
    /// One move; `None` if that is no facet, nor to be merged.
    pub fn begin(motion: &Move<N>) -> Option<Self> {
        let heading = motion.curve.direction()?;
        let short = motion.curve.length() <= SHORT * motion.exit.rounding()?;
        (short || merged_within(motion.exit).is_some()).then(|| Run {
            motion: *motion,
            astray: 0.0,
            points: vec![motion.curve.start(), motion.curve.end()],
            heading,
            curve_like: short,
        })
    }

    /// Goes on with a move; false if there is no curve that passes all of them and `may_be`.
    pub fn extend(&mut self, motion: &Move<N>, may_be: impl Fn(&Curve<N>) -> bool) -> bool {
        let (Some(tolerance), Some(heading)) = (motion.exit.rounding(), motion.curve.direction())
        else {
            return false;
        };
        let turn: f64 = (0..N.min(3)).map(|i| heading[i] * self.heading[i]).sum();
        let curve_like =
            self.curve_like && motion.curve.length() <= SHORT * tolerance && turn >= GENTLE;
        let merged = merged_within(motion.exit);
        if motion.exit != self.motion.exit
            || motion.feed != self.motion.feed
            || !(curve_like || merged.is_some())
            || self.points.len() > MOST
        {
            return false;
        }
        self.points.push(motion.curve.end());
        let within = SHARE * tolerance;
        let mut found = line(&self.points, merged.unwrap_or(within));
        if found.is_none() && curve_like {
            found = [Plane::Xy, Plane::Zx, Plane::Yz]
                .into_iter()
                .find_map(|plane| arc(&self.points, plane, within))
                .filter(|(curve, _)| may_be(curve));
        }
        let Some((curve, astray)) = found else {
            self.points.pop();
            return false;
        };
        self.motion = Move { curve, ..*motion };
        self.astray = astray;
        self.heading = heading;
        self.curve_like = curve_like;
        true
    }
}

fn merged_within(exit: Exit) -> Option<f64> {
    match exit {
        Exit::Merge { within, .. } => Some(within),
        _ => None,
    }
}

/// The line from the first to the last point and how far the others are from it, if that is
/// `within` and they follow one another along it.
fn line<const N: usize>(points: &[[f64; N]], within: f64) -> Option<(Curve<N>, f64)> {
    let (start, end) = (points[0], points[points.len() - 1]);
    let curve = Curve::line(start, end).ok()?;
    let along = curve.direction()?;
    let tool = N.min(3);
    let scale: f64 = along[..tool].iter().map(|d| d * d).sum();
    let mut worst = 0.0_f64;
    let mut before = 0.0;
    for p in &points[1..points.len() - 1] {
        let s = (0..tool).map(|i| (p[i] - start[i]) * along[i]).sum::<f64>() / scale;
        let off: f64 = (0..N)
            .map(|i| {
                let d = p[i] - start[i] - s * along[i];
                d * d
            })
            .sum();
        worst = worst.max(off);
        if s.is_nan() || s <= before || off > within * within {
            return None;
        }
        before = s;
    }
    (before < curve.length()).then(|| (curve, worst.sqrt()))
}

/// The arc or helix in `plane` through the first and the last point that passes the others best, and
/// how far it is from the lines between the points, if that is `within`.
fn arc<const N: usize>(points: &[[f64; N]], plane: Plane, within: f64) -> Option<(Curve<N>, f64)> {
    let (a, b) = plane.axes();
    if a >= N || b >= N || points.len() < 4 {
        return None;
    }
    let (start, end) = (points[0], points[points.len() - 1]);
    let (ex, ey) = (end[a] - start[a], end[b] - start[b]);
    let chord = libm::hypot(ex, ey);
    // In coordinates along and across the chord the circle through both ends is
    // x (x − chord) + y² = c y; c by least squares.
    let (mut down, mut square) = (0.0, 0.0);
    for p in &points[1..points.len() - 1] {
        let (px, py) = (p[a] - start[a], p[b] - start[b]);
        let (x, y) = ((px * ex + py * ey) / chord, (py * ex - px * ey) / chord);
        down += (x * (x - chord) + y * y) * y;
        square += y * y;
    }
    let c = down / square;
    if !c.is_finite() || c.abs() > 1e9 * chord {
        return None;
    }
    let clockwise = c < 0.0;
    // From the start.
    let (cx, cy) = (0.5 * (ex - c * ey / chord), 0.5 * (ey + c * ex / chord));
    let centre = (start[a] + cx, start[b] + cy);
    let radius = libm::hypot(cx, cy);
    let side = if clockwise { -1.0 } else { 1.0 };
    let arm = |p: &[f64; N]| (p[a] - centre.0, p[b] - centre.1);
    let flat = (0..N)
        .filter(|&i| i != a && i != b)
        .all(|i| points.iter().all(|p| p[i] == start[i]));
    // Angle from the start, counted in the sense of rotation.
    let (sx, sy) = arm(&start);
    let angle = |p: &[f64; N]| {
        let (x, y) = arm(p);
        side * libm::atan2(sx * y - sy * x, sx * x + sy * y)
    };
    let sweep = angle(&end);
    // Less than half a turn, so that angles are not ambiguous.
    if sweep.is_nan() || sweep <= 0.0 || sweep > 2.5 {
        return None;
    }
    let mut worst = 0.0_f64;
    for pair in points.windows(2) {
        let ((x0, y0), (x1, y1)) = (arm(&pair[0]), arm(&pair[1]));
        let chord = (x1 - x0) * (x1 - x0) + (y1 - y0) * (y1 - y0);
        // How far the circle is off the point, and the chord off the circle.
        let radial = (libm::hypot(x1, y1) - radius).abs();
        let least = radius - radial;
        let sagitta = chord / (8.0 * least) * (1.0 + chord / (4.0 * least * least));
        let mut off = radial + sagitta;
        if !flat {
            let part = angle(&pair[1]) / sweep;
            let others: f64 = (0..N)
                .filter(|&i| i != a && i != b)
                .map(|i| {
                    let d = pair[1][i] - start[i] - part * (end[i] - start[i]);
                    d * d
                })
                .sum();
            off = (off * off + others).sqrt();
        }
        worst = worst.max(off);
        if side * (x0 * y1 - y0 * x1) <= 0.0
            || off.is_nan()
            || off > within
            || radial > 0.5 * radius
        {
            return None;
        }
    }
    let curve = Curve::arc(ArcDefinition {
        start,
        end,
        plane,
        centre,
        clockwise,
        turns: 0,
    });
    Some((curve.ok()?, worst))
}
