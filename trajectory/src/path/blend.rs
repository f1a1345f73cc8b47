//! Rounds the joints between moves.
//!
//! A joint whose tangent or curvature breaks is replaced by a polynomial of degree five that takes
//! over position, tangent and curvature on both sides (G2). Both curves give up the same length d
//! for it, at most half of what they have, so that neighbouring blends never meet; the length is the
//! greatest that keeps the blend within the tolerance.
//!
//! Between lines that meet in C the polynomial is C + (A − C)(1 − u)³ + (B − C) u³: what axes do that
//! stop and start under constant jerk, one into the other. It is passed in half the time of a stop.
//! Where d is bounded by the length of the moves and not by the tolerance there is the choice of a
//! gentler polynomial with an even parameter. It bends half as much at most, but its jerk is twice as high: it
//! is passed sooner where accelerations or the feed are the limit, and later where jerks are
//! ([`passing_time`]).
//!
//! # Why it is right
//!
//! The deviation is measured, not estimated, and counts both ways: of the blend from the moves, and of the
//! programmed point from the blend; at 32 points, and between them by what the curvatures allow at most. Turns
//! beyond 160° are left to a stop: a blend saves nothing there. Below, a blend takes no longer than a stop in the joint,
//! also between moves of a thousandth of a millimetre.
//!
//! # What was tried
//!
//! A blend that takes over the change of curvature as well (G3, fourth powers in place of the third ones) does not
//! pay: where the limits are on the axes' jerk a jerk may jump. From rest to rest over two moves of 100 mm the motion
//! with it was between 0.4 % shorter and 2.7 % longer, on average 0.1 % longer (`cargo bench -p syncline-benches --bench
//! blends`, 60 cases; the table is in `docs/path.md`). The gentle shape wherever the tolerance allows it made motion
//! up to 7 % slower with more tolerance.

use super::Limits;
use super::curve::{Curve, Derivatives, Poly};

/// Points at which the deviation of a blend is measured.
const SAMPLES: usize = 32;
/// Part of the tolerance that is aimed at.
const USED: f64 = 0.98;
/// Blends shorter than this would be nothing but rounding, mm.
const SHORTEST: f64 = 1e-4;
/// Greatest cosine between the tangents of a joint that counts as a reversal.
const REVERSAL: f64 = -0.94;

/// Cosines of tangents that differ by less from 1 are those of one direction.
const TANGENT: f64 = 1e-9;
/// Rounds in which a cut that is too long is shortened; each does so by these parts, at least and at most.
const MOST_ROUNDS: usize = 40;
const SHRINK: [f64; 2] = [0.02, 0.95];
/// Times that a stretch is halved, at most, to bound its curvature.
const HALVINGS: usize = 6;

/// A rounded joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blend<const N: usize> {
    /// What goes in between.
    pub curve: Curve<N>,
    /// The same with an even parameter, where the tolerance leaves the choice.
    pub gentle: Option<Curve<N>>,
    /// What both neighbours give up, mm.
    pub cut: f64,
}

/// The blend between two curves that meet, of which both give up `most` mm at most and no more than half, nowhere
/// further than `tolerance` from them and no further from the point where they meet; `None` where there is none, as in
/// a reversal.
pub fn blend<const N: usize>(
    before: &Curve<N>,
    after: &Curve<N>,
    most: f64,
    tolerance: f64,
) -> Option<Blend<N>> {
    let (b, a) = (before.at(before.length()), after.at(0.0));
    let tool = N.min(3);
    let along: f64 = (0..tool).map(|i| b.d1[i] * a.d1[i]).sum();
    let unit = |d: &Derivatives<N>| (0..tool).map(|i| d.d1[i] * d.d1[i]).sum::<f64>() > 0.5;
    if along < REVERSAL || !unit(&b) || !unit(&a) {
        return None;
    }
    let most = most.min(0.5 * before.length().min(after.length()));
    let mut cut = most;
    // Corners deviate in proportion to the cut, steps of the curvature with its square.
    let power = if along < 1.0 - TANGENT { 1.0 } else { 0.5 };
    for _ in 0..MOST_ROUNDS {
        if cut < SHORTEST {
            return None;
        }
        let fit = |shape| {
            let poly = join(before, after, cut, shape);
            let off = poly
                .as_ref()
                .map_or(f64::INFINITY, |poly| deviation(poly, before, after, cut));
            (poly, off)
        };
        let (poly, off) = fit(SHARP);
        if off <= tolerance {
            let gentle = (cut == most).then(|| fit(EVEN));
            let gentle = gentle.filter(|(_, off)| *off <= tolerance);
            return poly.map(|poly| Blend {
                curve: Curve::Poly(poly),
                gentle: gentle.and_then(|(poly, _)| poly).map(Curve::Poly),
                cut,
            });
        }
        let shrink = if off.is_finite() {
            libm::pow(USED * tolerance / off, power)
        } else {
            0.5
        };
        cut *= shrink.clamp(SHRINK[0], SHRINK[1]);
    }
    None
}

/// Rate of the parameter at the ends and how it slows, both per cut: as axes stop and start …
const SHARP: (f64, f64) = (3.0, 6.0);
/// … and as evenly as can be.
const EVEN: (f64, f64) = (2.0, 0.0);

/// Parts between the points at which a blend's derivatives are looked at to tell how soon it is passed.
const LOOKS: usize = 8;

/// How long it takes to pass a blend at an even rate of its parameter, s: what tells two blends between the
/// same moves apart.
pub fn passing_time<const N: usize>(blend: &Curve<N>, feed: f64, limits: &Limits<N>) -> f64 {
    let Curve::Poly(poly) = blend else {
        return f64::INFINITY;
    };
    let quintic = &poly.quintic;
    let mut time = 0.0_f64;
    for k in 0..=LOOKS {
        let u = k as f64 / LOOKS as f64;
        let [first, second, third] = [quintic.first(u), quintic.second(u), quintic.third(u)];
        time = time.max(quintic.rate(u) / feed);
        for i in 0..N {
            time = time
                .max(first[i].abs() / limits.velocity[i])
                .max((second[i].abs() / limits.acceleration[i]).sqrt())
                .max(libm::cbrt(third[i].abs() / limits.jerk[i]));
        }
    }
    time
}

/// What part of a blend between lines is enough to be passed at a constant path speed: accelerations go with its
/// inverse, jerks with the inverse of its square.
pub fn needed_part<const N: usize>(blend: &Curve<N>, speed: f64, limits: &Limits<N>) -> f64 {
    let step = blend.length() / LOOKS as f64;
    let mut part = 0.0_f64;
    for k in 0..=LOOKS {
        let Derivatives { d2, d3, .. } = blend.at(k as f64 * step);
        for i in 0..N {
            let acceleration = d2[i].abs() * speed * speed;
            let jerk = d3[i].abs() * speed * speed * speed;
            part = part
                .max(acceleration / limits.acceleration[i])
                .max((jerk / limits.jerk[i]).sqrt());
        }
    }
    part
}

fn join<const N: usize>(
    before: &Curve<N>,
    after: &Curve<N>,
    cut: f64,
    (rate, brake): (f64, f64),
) -> Option<Poly<N>> {
    Poly::joining(
        &before.at(before.length() - cut),
        &after.at(cut),
        rate * cut,
        brake * cut,
    )
}
/// How far the blend strays from the two curves, and the joint from the blend, at most. The
/// distance from a curve is no greater between two samples than on the line through them but for an
/// eighth of the square of the way in between times both curvatures.
fn deviation<const N: usize>(poly: &Poly<N>, before: &Curve<N>, after: &Curve<N>, cut: f64) -> f64 {
    let joint = after.start();
    let curve = Curve::Poly(*poly);
    let length = curve.length();
    let step = length / SAMPLES as f64;
    let [before_bend, after_bend] =
        [before, after].map(|c| curvature(c, 0.0, c.length(), HALVINGS));
    let mut deviation = 0.0_f64;
    let mut missed = f64::INFINITY;
    let mut last = [0.0, distance(&curve.start(), &joint)];
    for k in 1..=SAMPLES {
        let part = k as f64 / SAMPLES as f64;
        let p = curve.at(part * length).q;
        let here = [
            before.distance_near(&p, before.length() - cut * (1.0 - 2.0 * part).max(0.0)),
            after.distance_near(&p, cut * (2.0 * part - 1.0).max(0.0)),
        ];
        let own = curvature(&curve, part * length - step, part * length, HALVINGS);
        let rise = |other: f64| step * step / 8.0 * (own + 2.0 * other);
        // Of the lines over the interval the lower one; where they cross, both are that high.
        let [f0, f1] = [last[0], here[0]].map(|d| d + rise(before_bend));
        let [g0, g1] = [last[1], here[1]].map(|d| d + rise(after_bend));
        let crossing = (f0 - g0) / ((f0 - g0) - (f1 - g1));
        let between = if crossing > 0.0 && crossing < 1.0 {
            f0 + crossing * (f1 - f0)
        } else {
            0.0
        };
        deviation = deviation.max(f0.min(g0)).max(f1.min(g1)).max(between);
        missed = missed.min(distance(&p, &joint));
        last = here;
    }
    deviation.max(missed)
}

/// Upper bound of the curvature between two path lengths, followers included.
fn curvature<const N: usize>(curve: &Curve<N>, from: f64, to: f64, halvings: usize) -> f64 {
    let d2 = curve.growth(from.max(0.0), to)[1];
    let bound = d2.iter().map(|x| x * x).sum::<f64>().sqrt();
    if bound.is_finite() || halvings == 0 {
        return bound;
    }
    let middle = 0.5 * (from + to);
    curvature(curve, from, middle, halvings - 1).max(curvature(curve, middle, to, halvings - 1))
}

/// Distance between two points; a follower's degree counts as a millimetre.
pub(super) fn distance<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    (0..N)
        .map(|i| (a[i] - b[i]) * (a[i] - b[i]))
        .sum::<f64>()
        .sqrt()
}
