//! Rational curves as polynomials: what the weights of a B-spline ask for.
//!
//! A rational curve N(t)/W(t) is no polynomial, and the path has polynomials of the fifth degree only. So each stretch gets
//! the quintic Q that meets it at both ends in place, derivative and second derivative, and is halved until Q is near
//! enough; neighbours then meet as smoothly as the curve itself does, and the distance falls to a 64th with each halving.
//!
//! How near Q is needs no samples: N − W·Q is a polynomial, of which the greatest control point in Bernstein's form
//! bounds the value, and |N/W − Q| = |N − W·Q| / W is no more than that by the least weight.

use super::spline::{DEGREE, Vector, between};

/// How far the polynomials may be from the curve, mm: a nanometre, far below an increment of any drive.
pub(crate) const RATIONAL_TOLERANCE: f64 = 1e-6;
/// Halvings of one stretch, at most.
const HALVINGS: u32 = 24;
/// Degree of N − W·Q.
const PRODUCT: usize = 2 * DEGREE;

/// A control point in homogeneous coordinates: w·x, w·y, w.
pub(crate) type Weighted = [f64; 3];

/// Hands out quintics within [`RATIONAL_TOLERANCE`] of the rational curve with these control points, at most
/// degree five of it, whose weights are above 0; `false` if halving does not lead there.
pub(crate) fn approximate(
    controls: &[Weighted],
    hand_out: &mut impl FnMut([Vector; DEGREE + 1]),
) -> bool {
    halve(controls, HALVINGS, hand_out)
}

fn halve(
    controls: &[Weighted],
    halvings: u32,
    hand_out: &mut impl FnMut([Vector; DEGREE + 1]),
) -> bool {
    let quintic = quintic(controls);
    if distance(controls, &quintic) <= RATIONAL_TOLERANCE {
        hand_out(quintic);
        return true;
    }
    if halvings == 0 {
        return false;
    }
    let count = controls.len();
    let mut left = controls.to_vec();
    let mut right = controls.to_vec();
    for level in 1..count {
        for k in (level..count).rev() {
            left[k] = between(left[k - 1], left[k], 0.5);
        }
        right[count - 1 - level] = left[count - 1];
    }
    halve(&left, halvings - 1, hand_out) && halve(&right, halvings - 1, hand_out)
}

/// The quintic with the place and the first two derivatives of the curve at both ends.
fn quintic(controls: &[Weighted]) -> [Vector; DEGREE + 1] {
    let [a, b, c] = end(controls.iter());
    let [f, e, d] = end(controls.iter().rev());
    [a, b, c, d, e, f]
}

/// Three control points of the quintic from one end of the curve inwards.
fn end<'a>(controls: impl ExactSizeIterator<Item = &'a Weighted>) -> [Vector; 3] {
    let degree = controls.len() as f64 - 1.0;
    let mut controls = controls.copied();
    let [h, i, j] = [(); 3].map(|()| controls.next().unwrap_or_default());
    let weight = h[2];
    let place = [h[0] / weight, h[1] / weight];
    // The quotient's derivatives, by those of N = P·W.
    let first: Weighted = [0, 1, 2].map(|k| degree * (i[k] - h[k]));
    let second: Weighted = [0, 1, 2].map(|k| degree * (degree - 1.0) * (j[k] - 2.0 * i[k] + h[k]));
    let velocity = [0, 1].map(|k| (first[k] - first[2] * place[k]) / weight);
    let bend =
        [0, 1].map(|k| (second[k] - 2.0 * first[2] * velocity[k] - second[2] * place[k]) / weight);
    [
        place,
        [0, 1].map(|k| place[k] + velocity[k] / 5.0),
        [0, 1].map(|k| place[k] + velocity[k] * 0.4 + bend[k] / 20.0),
    ]
}

/// A bound of the distance between the curve and a quintic at each parameter, mm.
fn distance(controls: &[Weighted], quintic: &[Vector; DEGREE + 1]) -> f64 {
    let degree = controls.len() - 1;
    let mut apart = [[0.0; 2]; PRODUCT + 1];
    for (i, [x, y, weight]) in controls.iter().enumerate() {
        for (j, point) in quintic.iter().enumerate() {
            let share =
                binomial(degree, i) * binomial(DEGREE, j) / binomial(degree + DEGREE, i + j);
            apart[i + j][0] += share * (x - weight * point[0]);
            apart[i + j][1] += share * (y - weight * point[1]);
        }
    }
    let least = controls
        .iter()
        .fold(f64::INFINITY, |a, [.., weight]| a.min(*weight));
    let greatest = apart
        .iter()
        .fold(0.0_f64, |a, [x, y]| a.max(libm::hypot(*x, *y)));
    greatest / least
}

fn binomial(n: usize, k: usize) -> f64 {
    (1..=k).fold(1.0, |value, m| value * (n + 1 - m) as f64 / m as f64)
}
