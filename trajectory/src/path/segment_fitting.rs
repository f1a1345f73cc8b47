//! Takes runs of short lines for what they were made from.
//!
//! CAM systems write curves as short segments. A path that follows every one of them has the curvature of
//! its joints, not that of the curve, and where coordinates are rounded that of the rounding. So
//! lines that are short against the tolerance are gathered. Those that follow one line become that;
//! the others become polynomials of degree five that go on one from the other with tangent and
//! curvature, each the best (by least squares) for points far beyond its own end: the next one starts
//! from where data on both sides held the curve, not from where it was let go. Every point and every
//! short segment is measured. Lines that are shorter still turn by whatever they like, as a zigzag within the tolerance
//! does: they are one curve as far as that stays within it: it is measured. Where no curve can be, at a corner above all, a line takes the place
//! of as many as it stays near: what is shorter than a rounding can be would be two stops. Where a program says within what lines are to be merged, they
//! are, however long they are.
//!
//! # Why it is right
//!
//! Measured are every point and, from the second derivative, all between two points. Less than all of the
//! tolerance is used: what is left is for the blends with what comes before and behind. Where a fit strays,
//! fewer short segments are tried. As each polynomial is fitted to twice the segments that are kept of it, errors
//! do not build up from one to the next.

use super::blend::distance;
use super::curve::{Curve, Poly, Quintic};
use super::{Move, PathControlMode};

/// Lines up to so many tolerances long are short segments.
const SHORT: f64 = 100.0;
/// Least cosine of the turn from one short segment to the next, …
const GENTLE: f64 = 0.9;
/// … unless all are no longer than this part of the tolerance: whatever they turn by stays within that.
const TINY: f64 = 0.5;
/// Lines of up to so many mm are also tried as a curve, whatever they turn by, where they are no longer than two tolerances: on each
/// of them all axes would stop and start, so that nearly any curve is sooner. (Of any length, with tolerances of millimetres, moves of
/// centimetres became curves that took up to 3 % longer.)
const FINE: f64 = 0.2;
/// Part of the tolerance that a polynomial may stray between two others, …
const SHARE: f64 = 0.97;
/// … where what is left is for a blend with what comes before or after, …
const OUTER_SHARE: f64 = 0.7;
/// … and that a line through short segments may, unless lines are to be merged.
const STRAIGHT: f64 = 1e-3;
/// Short segments that are looked at, at most, and at least where the curve is to go on.
const MOST: usize = 96;
const FEWEST: usize = 6;
/// Degree of the polynomials.
const DEGREE: usize = 5;
/// What curves stay within, in mm, is the greatest of these that is no more than the tolerance, which is left to the blends
/// beside them. So of two tolerances the greater one is tried with every curve that the lesser one is good for.
const GRADES: [f64; 22] = [
    10.0, 5.0, 2.0, 1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5,
    2e-5, 1e-5, 5e-6, 2e-6, 1e-6,
];
/// What has to be left of a column of the normal equations, as a part of it, when what the ones before explain is taken off:
/// less is rounding, and the points do not determine the polynomial.
const INDEPENDENT: f64 = 1e-13;

/// Moves that are gathered.
#[derive(Debug, Clone)]
pub struct ShortSegments<const N: usize> {
    /// The last of them.
    last: Move<N>,
    /// What curves stay within, mm.
    tolerance: f64,
    /// Where the first begins, and the ends of all, with their tags.
    points: Vec<([f64; N], u32)>,
    /// Direction of the last one.
    heading: [f64; N],
    /// All of them are short, and turn little from one to the next.
    gentle: bool,
    /// All of them are so short that they are tried as a curve whatever they turn by.
    tiny: bool,
    /// The line that stands for all of them, if one does, and how far it strays.
    line: Option<(Curve<N>, f64)>,
    /// What the curve goes on from at the first point.
    knot: Option<Knot<N>>,
    /// Short segments that the last polynomial was good for.
    reach: usize,
}

/// What curves stand for.
#[derive(Debug, Clone)]
pub struct Part<const N: usize> {
    /// The curve, with the feed, the mode and the tag of the last move.
    pub motion: Move<N>,
    /// Where on it the moves before the last one end.
    pub ends: Vec<MoveEnd>,
    /// How far it strays from the moves, at most, mm.
    pub deviation: f64,
    /// It goes on from the one before with tangent and curvature.
    pub goes_on: bool,
}

/// Where a move ends in the midst of a curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MoveEnd {
    /// [`Move::tag`]
    pub tag: u32,
    /// Path length from the beginning of what it lies on, mm.
    pub at: f64,
}

/// A point of the curve: derivatives by the length of the short segments.
#[derive(Debug, Clone, Copy)]
struct Knot<const N: usize> {
    q: [f64; N],
    d1: [f64; N],
    d2: [f64; N],
}

/// A polynomial for some short segments.
struct Fit<const N: usize> {
    curve: Curve<N>,
    /// For how many.
    lines: usize,
    deviation: f64,
    end: Knot<N>,
}

impl<const N: usize> ShortSegments<N> {
    /// One move, of those that become curves within the grade of their tolerance and `most` mm; `None` if that is no
    /// short segment, nor to be merged.
    pub fn begin(motion: &Move<N>, most: f64) -> Option<Self> {
        let heading = motion.curve.direction()?;
        let rounding = motion.mode.rounding().unwrap_or(0.0);
        let tolerance = grades(rounding).next().unwrap_or(rounding).min(most);
        let gentle = is_short(motion, &heading, SHORT * tolerance);
        (gentle || merged_within(motion.mode).is_some()).then(|| ShortSegments {
            last: *motion,
            tolerance,
            points: vec![
                (motion.curve.start(), motion.tag),
                (motion.curve.end(), motion.tag),
            ],
            heading,
            gentle,
            tiny: is_short(motion, &heading, tiny(tolerance)),
            line: Some((motion.curve, 0.0)),
            knot: None,
            reach: MOST,
        })
    }

    /// Whether there is one line only, which is no short segment: it may be merged with the next one.
    pub fn is_long_line(&self) -> bool {
        !self.gentle && self.points.len() == 2
    }

    /// What they are with a move that may be one with the others: gentle, and tiny. None where it is not.
    fn with(&self, motion: &Move<N>) -> Option<(bool, bool)> {
        let heading = motion.curve.direction()?;
        let turn: f64 = (0..N.min(3)).map(|i| heading[i] * self.heading[i]).sum();
        let gentle =
            self.gentle && turn >= GENTLE && is_short(motion, &heading, SHORT * self.tolerance);
        let tiny = self.tiny && is_short(motion, &heading, tiny(self.tolerance));
        let [mode, last] = [motion.mode, self.last.mode];
        let merged = merged_within(mode);
        let alike = mode.rounding() == last.rounding() && merged == merged_within(last);
        let is_one = gentle || tiny || self.line.is_some() && merged.is_some();
        (alike && motion.feed == self.last.feed && is_one).then_some((gentle, tiny))
    }

    /// Whether a move may be one with the others.
    pub fn may_go_on(&self, motion: &Move<N>) -> bool {
        self.with(motion).is_some()
    }

    /// Goes on with a move; false if that is not one with the others.
    pub fn extend(&mut self, motion: &Move<N>) -> bool {
        let Some((gentle, tiny)) = self.with(motion) else {
            return false;
        };
        let curve_like = gentle || tiny;
        self.points.push((motion.curve.end(), motion.tag));
        if self.line.is_some() {
            let most = self.points.len() <= MOST;
            self.line = line(&self.points, self.within()).filter(|_| most);
            if self.line.is_none() && !(curve_like && most) {
                self.points.pop();
                self.line = line(&self.points, f64::INFINITY);
                return false;
            }
        }
        self.last = *motion;
        self.heading = motion.curve.direction().unwrap_or(self.heading);
        (self.gentle, self.tiny) = (gentle, tiny);
        true
    }

    /// The next part, if enough of the short segments behind it are known or there come no more. A curve of its
    /// own is one that `may_be`, in place of the segments between those points.
    pub fn next(
        &mut self,
        ended: bool,
        may_be: impl Fn(&Curve<N>, &[([f64; N], u32)]) -> bool,
    ) -> Option<Part<N>> {
        let lines = self.points.len() - 1;
        if lines == 0 || !ended && (self.line.is_some() || lines < self.wanted()) {
            return None;
        }
        if let Some((curve, deviation)) = self.line {
            return Some(self.part(curve, lines, deviation, None));
        }
        let may_be = |fit: &Fit<N>, it: &Self| may_be(&fit.curve, &it.points[..=fit.lines]);
        let most = lines.min(self.wanted());
        let mut ahead = most;
        loop {
            // Segments that turn by anything go up to where they stop being within the tolerance of a curve.
            let whole = ended && ahead == lines || !self.gentle && ahead < most;
            if let Some(fit) = self.fit(ahead, whole).filter(|fit| may_be(fit, self)) {
                self.reach = ahead;
                let end = (!whole).then_some(fit.end);
                return Some(self.part(fit.curve, fit.lines, fit.deviation, end));
            }
            if ahead <= FEWEST {
                break;
            }
            ahead = if self.gentle {
                (ahead * 7 / 10).max(FEWEST)
            } else {
                ahead - 1
            };
        }
        // The curve ends in a corner.
        self.reach = MOST;
        let (chord, straight, deviation) = self.chord()?;
        for ahead in (straight + 1..FEWEST.min(lines)).rev() {
            if let Some(fit) = self.fit(ahead, true).filter(|fit| may_be(fit, self)) {
                return Some(self.part(fit.curve, fit.lines, fit.deviation, None));
            }
        }
        let part = self.part(chord, straight, deviation, None);
        Some(Part {
            goes_on: false,
            ..part
        })
    }

    /// The line in place of as many short segments as it stays near, for how many, and how far it strays from
    /// them. Each is no further from it than its ends are, and as they lead from one end of the line to the other,
    /// no place on it is further from them.
    fn chord(&self) -> Option<(Curve<N>, usize, f64)> {
        let start = self.start().q;
        let within = OUTER_SHARE * self.tolerance;
        let mut chord = None;
        for last in 1..self.points.len() {
            let Ok(line) = Curve::line(start, self.points[last].0) else {
                continue;
            };
            let off =
                |(point, _): &([f64; N], u32)| line.distance_near(point, nearest(&line, point));
            let deviation = self.points[..last].iter().map(off).fold(0.0, f64::max);
            if chord.is_some() && deviation > within {
                break;
            }
            chord = Some((line, last, deviation));
        }
        chord
    }

    /// The path speed that is programmed on them, mm/s.
    pub fn feed(&self) -> f64 {
        self.last.feed.speed()
    }

    /// How far a line may stray from the short segments.
    fn within(&self) -> f64 {
        let mode = self.last.mode;
        merged_within(mode).unwrap_or(STRAIGHT * self.tolerance)
    }

    /// Short segments that are looked at for the next polynomial.
    fn wanted(&self) -> usize {
        (self.reach + self.reach / 2 + 1).min(MOST)
    }

    fn start(&self) -> Knot<N> {
        self.knot.unwrap_or(Knot {
            q: self.points[0].0,
            d1: [0.0; N],
            d2: [0.0; N],
        })
    }

    /// Takes the part that stands for so many short segments out of what was gathered, which goes on from `end`.
    fn part(
        &mut self,
        curve: Curve<N>,
        lines: usize,
        deviation: f64,
        end: Option<Knot<N>>,
    ) -> Part<N> {
        let ends = self.ends(&curve, lines);
        self.points.drain(..lines);
        self.line = match end {
            None if self.points.len() > 1 => line(&self.points, self.within()),
            _ => None,
        };
        let goes_on = self.knot.is_some();
        self.knot = end;
        Part {
            motion: Move {
                curve,
                tag: self.points[0].1,
                ..self.last
            },
            ends,
            deviation,
            goes_on,
        }
    }

    /// Where the first of so many short segments end on the curve that stands for them, but for the last. On
    /// a line that is beside them, on a polynomial where it was measured against them: its parameter is
    /// their length.
    fn ends(&self, curve: &Curve<N>, lines: usize) -> Vec<MoveEnd> {
        let points = &self.points[..=lines];
        let whole: f64 = points
            .windows(2)
            .map(|pair| length_between(&pair[0].0, &pair[1].0))
            .sum();
        let mut done = 0.0;
        let place = |(k, (point, _)): (usize, &([f64; N], u32))| {
            done += length_between(&points[k].0, point);
            match curve {
                Curve::Poly(poly) => poly.length_to(done / whole),
                _ => nearest(curve, point),
            }
        };
        let places: Vec<f64> = points[1..lines].iter().enumerate().map(place).collect();
        let mut reached = 0.0_f64;
        let moves = points[1..lines].iter().zip(places);
        moves
            .map(|((_, tag), at)| {
                // Lines to and fro have their places on one line in their order.
                reached = reached.max(at);
                MoveEnd {
                    tag: *tag,
                    at: reached,
                }
            })
            .collect()
    }

    /// The polynomial that goes on from the knot and is the best for that many short segments: for all of them,
    /// with the last one's end as its own, or for the first half of them. `None` if it strays.
    fn fit(&self, ahead: usize, whole: bool) -> Option<Fit<N>> {
        let lines = if whole { ahead } else { ahead / 2 };
        let outer = whole || self.knot.is_none();
        let within = self.tolerance * if outer { OUTER_SHARE } else { SHARE };
        let from = self.start();
        // The lengths of the short segments, from the first point on.
        let mut at = [0.0; MOST + 1];
        for k in 1..=ahead {
            at[k] = at[k - 1] + length_between(&self.points[k - 1].0, &self.points[k].0);
        }
        let length = at[ahead];
        // Coefficients by powers of the part of the length. What the knot gives is not free.
        let mut terms = [[0.0; N]; DEGREE];
        let mut first = 0;
        if self.knot.is_some() {
            terms[0] = from.d1.map(|d| d * length);
            terms[1] = from.d2.map(|d| 0.5 * d * length * length);
            first = 2;
        }
        let free = (DEGREE - first).min(ahead);
        let last = first + free - 1;
        // The end is the last point's: one coefficient is what the others leave.
        let bound = usize::from(whole);
        let left = |x: f64, p: &[f64; N]| -> [f64; N] {
            std::array::from_fn(|i| p[i] - from.q[i] - x * (terms[0][i] + x * terms[1][i]))
        };
        let end = left(1.0, &self.points[ahead].0);
        let mut normal = [[0.0; DEGREE]; DEGREE];
        let mut right = [[0.0; N]; DEGREE];
        for k in 1..=ahead - bound {
            let x = at[k] / length;
            let mut powers = [x; DEGREE];
            for n in 1..DEGREE {
                powers[n] = powers[n - 1] * x;
            }
            let highest = powers[last];
            let mut target = left(x, &self.points[k].0);
            if whole {
                powers.iter_mut().for_each(|power| *power -= highest);
                for i in 0..N {
                    target[i] -= highest * end[i];
                }
            }
            for n in 0..free - bound {
                let power = powers[first + n];
                for m in 0..=n {
                    normal[n][m] += power * powers[first + m];
                }
                for i in 0..N {
                    right[n][i] += power * target[i];
                }
            }
        }
        solve(&mut normal, &mut right, free - bound)?;
        terms[first..first + free - bound].copy_from_slice(&right[..free - bound]);
        if whole {
            terms[last] =
                std::array::from_fn(|i| end[i] - (0..free - 1).map(|n| right[n][i]).sum::<f64>());
        }
        // The part of it that is kept.
        let mut scale = 1.0;
        for term in &mut terms {
            scale *= at[lines] / length;
            *term = term.map(|c| c * scale);
        }
        let quintic = Quintic {
            start: from.q,
            terms,
        };
        let deviation = self.deviation(&quintic, &at[..=lines]);
        if deviation > within {
            return None;
        }
        let [q, d1, d2] = [quintic.point(1.0), quintic.first(1.0), quintic.second(1.0)];
        let by = 1.0 / at[lines];
        Some(Fit {
            curve: Curve::Poly(Poly::new(quintic)?),
            lines,
            deviation,
            end: Knot {
                q,
                d1: d1.map(|d| d * by),
                d2: d2.map(|d| d * by * by),
            },
        })
    }

    /// How far the polynomial strays from the short segments that end at these lengths, and they from it, at
    /// most: no further than it does at the ends of each, and an eighth of the square of the parameter
    /// in between times the second derivative.
    fn deviation(&self, quintic: &Quintic<N>, at: &[f64]) -> f64 {
        let terms = &quintic.terms;
        let norm = |d: [f64; N]| d.iter().map(|x| x * x).sum::<f64>().sqrt();
        let third = 6.0 * norm(terms[2]) + 24.0 * norm(terms[3]) + 60.0 * norm(terms[4]);
        let length = at[at.len() - 1];
        let mut worst = 0.0_f64;
        let mut before = distance(&quintic.point(0.0), &self.points[0].0);
        for k in 1..at.len() {
            let [x0, x1] = [at[k - 1], at[k]].map(|at| at / length);
            let off = distance(&quintic.point(x1), &self.points[k].0);
            let step = x1 - x0;
            let bend = norm(quintic.second(0.5 * (x0 + x1))) + 0.5 * step * third;
            let most = before.max(off) + 0.125 * step * step * bend;
            if most.is_nan() {
                return f64::INFINITY;
            }
            worst = worst.max(most);
            before = off;
        }
        worst
    }
}

/// Solves the normal equations of that many unknowns, given by their lower half, in place (Cholesky's
/// way); `None` if they do not determine them.
fn solve<const N: usize>(
    normal: &mut [[f64; DEGREE]; DEGREE],
    right: &mut [[f64; N]; DEGREE],
    unknowns: usize,
) -> Option<()> {
    for n in 0..unknowns {
        for m in 0..=n {
            let done: f64 = (0..m).map(|k| normal[n][k] * normal[m][k]).sum();
            let left = normal[n][m] - done;
            if m < n {
                normal[n][m] = left / normal[m][m];
            } else if left > INDEPENDENT * normal[n][n] {
                normal[n][n] = left.sqrt();
            } else {
                return None;
            }
        }
    }
    for n in 0..unknowns {
        for i in 0..N {
            let done: f64 = (0..n).map(|k| normal[n][k] * right[k][i]).sum();
            right[n][i] = (right[n][i] - done) / normal[n][n];
        }
    }
    for n in (0..unknowns).rev() {
        for i in 0..N {
            let done: f64 = (n + 1..unknowns).map(|k| normal[k][n] * right[k][i]).sum();
            right[n][i] = (right[n][i] - done) / normal[n][n];
        }
    }
    Some(())
}

/// Length of the line between two points, by the tool's axes.
fn length_between<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    let squares = (0..N.min(3)).map(|i| (b[i] - a[i]) * (b[i] - a[i]));
    squares.sum::<f64>().sqrt()
}

/// Tolerances of curves in place of short segments where so much is allowed, mm, the greatest first.
pub fn grades(tolerance: f64) -> impl Iterator<Item = f64> {
    GRADES.into_iter().filter(move |it| *it <= tolerance)
}

/// How long lines may be that turn by anything, mm.
fn tiny(tolerance: f64) -> f64 {
    (TINY * tolerance).max(FINE.min(2.0 * tolerance))
}

/// Whether a line is no longer than `most` mm, and the tool's.
fn is_short<const N: usize>(motion: &Move<N>, heading: &[f64; N], most: f64) -> bool {
    let led: f64 = heading[..N.min(3)].iter().map(|d| d * d).sum();
    led > 0.5 && motion.curve.length() <= most
}

fn merged_within(mode: PathControlMode) -> Option<f64> {
    match mode {
        PathControlMode::Merge { within, .. } => Some(within),
        _ => None,
    }
}

/// How far along a line a point is beside it, by the tool's axes.
fn along<const N: usize>(start: &[f64; N], direction: &[f64; N], point: &[f64; N]) -> f64 {
    let tool = 0..N.min(3);
    let scale: f64 = tool.clone().map(|i| direction[i] * direction[i]).sum();
    tool.map(|i| (point[i] - start[i]) * direction[i])
        .sum::<f64>()
        / scale
}

/// The place on a line that is nearest to a point.
fn nearest<const N: usize>(line: &Curve<N>, point: &[f64; N]) -> f64 {
    along(&line.start(), &line.at(0.0).d1, point).clamp(0.0, line.length())
}

/// The line from the first to the last point and how far the others are from it, if that is
/// `within` and they follow one another along it.
fn line<const N: usize>(points: &[([f64; N], u32)], within: f64) -> Option<(Curve<N>, f64)> {
    let (start, end) = (points[0].0, points[points.len() - 1].0);
    let curve = Curve::line(start, end).ok()?;
    let direction = curve.direction()?;
    let mut worst = 0.0_f64;
    let mut before = 0.0;
    for (p, _) in &points[1..points.len() - 1] {
        let s = along(&start, &direction, p);
        let off: f64 = (0..N)
            .map(|i| {
                let d = p[i] - start[i] - s * direction[i];
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
