//! Polynomials of the fifth degree by a parameter, measured by their length.

use super::length::{GAUSS8, Growth, Jet, ORDERS, by_length, growth};
use super::{CLOSE, Derivatives};

/// A polynomial of degree five in a parameter from 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Poly<const N: usize> {
    pub(super) start: [f64; N],
    /// Coefficients of u, u² … u⁵.
    pub(super) terms: [[f64; N]; 5],
    /// Parameters between which the path length is integrated: closer in the middle, where a
    /// sharp corner's rate dips.
    pub(super) knots: [f64; PARTS + 1],
    /// Path length up to every knot.
    pub(super) lengths: [f64; PARTS + 1],
}

/// Parts of a polynomial's parameter whose lengths are known.
pub(super) const PARTS: usize = 8;

/// Slowest rate of the path length by the parameter, as a part of the faster one at its ends: a curve that is slower in the middle
/// nearly stands still there or turns back, and knots are placed for a dip that is no deeper.
const LEAST_RATE: f64 = 1e-3;

/// What rounding may bring a parameter outside of a range, as a part of the range, and beside.
const ROUNDING: f64 = 1e-9;
const ROUNDING_NEAR_ZERO: f64 = 1e-12;

impl<const N: usize> Poly<N> {
    /// The curve that leaves `from` and reaches `to` with their tangents and curvatures. The
    /// parameter runs at `rate` at both ends and slows by `brake` per parameter towards the
    /// middle. `None` if it would stand still or turn back on the way.
    pub fn joining(
        from: &Derivatives<N>,
        to: &Derivatives<N>,
        rate: f64,
        brake: f64,
    ) -> Option<Self> {
        let mut terms = [[0.0; N]; 5];
        for i in 0..N {
            let (v, a) = (
                rate * from.d1[i],
                0.5 * (rate * rate * from.d2[i] - brake * from.d1[i]),
            );
            // What the end wants beyond that.
            let p = (to.q[i] - from.q[i]) - (v + a);
            let dv = rate * to.d1[i] - (v + 2.0 * a);
            let da = rate * rate * to.d2[i] + brake * to.d1[i] - 2.0 * a;
            terms[0][i] = v;
            terms[1][i] = a;
            terms[2][i] = 10.0 * p - 4.0 * dv + 0.5 * da;
            terms[3][i] = -15.0 * p + 7.0 * dv - da;
            terms[4][i] = 6.0 * p - 3.0 * dv + 0.5 * da;
        }
        Self::new(from.q, terms)
    }

    /// The curve with these coefficients of u, u² … u⁵. `None` if it would stand still or turn back
    /// on the way.
    pub(in crate::path) fn new(start: [f64; N], terms: [[f64; N]; 5]) -> Option<Self> {
        let mut poly = Poly {
            start,
            terms,
            knots: [0.0; PARTS + 1],
            lengths: [0.0; PARTS + 1],
        };
        // The rate is the root of a polynomial with a zero about so far from the middle in the
        // complex plane; parts shorter than their distance from it are integrated to rounding.
        let most = poly.rate(0.0).max(poly.rate(1.0));
        let dip = 0.5 * (poly.rate(0.5) / most).clamp(LEAST_RATE, 1.0);
        let scale = libm::asinh(0.5 / dip);
        let middle = PARTS / 2;
        for k in 0..=middle {
            let aside = if k == middle {
                0.5
            } else {
                dip * libm::sinh(scale * k as f64 / middle as f64)
            };
            poly.knots[middle + k] = 0.5 + aside;
            poly.knots[middle - k] = 0.5 - aside;
        }
        for k in 0..PARTS {
            let [from, to] = [poly.knots[k], poly.knots[k + 1]];
            let least = poly.rate(from).min(poly.rate(0.5 * (from + to)));
            if least.is_nan() || least < LEAST_RATE * most {
                return None;
            }
            poly.lengths[k + 1] = poly.lengths[k] + poly.length_between(from, to);
        }
        Some(poly)
    }

    /// The point at the parameter `u`.
    pub fn point(&self, u: f64) -> [f64; N] {
        std::array::from_fn(|i| {
            self.start[i] + u * self.terms.iter().rev().fold(0.0, |sum, c| sum * u + c[i])
        })
    }

    pub(super) fn length(&self) -> f64 {
        self.lengths[PARTS]
    }

    /// The same curve with the parameter 1 − u.
    pub(super) fn reversed(&self) -> Self {
        // Coefficients by powers of 1 − u, by dividing again and again (Horner's scheme).
        let mut terms = [[0.0; N]; 5];
        let mut start = self.start;
        for i in 0..N {
            let mut c = [0.0; 6];
            c[0] = self.start[i];
            for k in 0..5 {
                c[k + 1] = self.terms[k][i];
            }
            for k in 0..5 {
                for n in (k..5).rev() {
                    c[n] += c[n + 1];
                }
            }
            start[i] = c[0];
            for k in 0..5 {
                terms[k][i] = if k % 2 == 0 { -c[k + 1] } else { c[k + 1] };
            }
        }
        let whole = self.length();
        Poly {
            start,
            terms,
            knots: std::array::from_fn(|k| 1.0 - self.knots[PARTS - k]),
            lengths: std::array::from_fn(|k| whole - self.lengths[PARTS - k]),
        }
    }

    /// The derivative by the parameter.
    pub(in crate::path) fn first(&self, u: f64) -> [f64; N] {
        let mut d = [0.0; N];
        for k in (0..5).rev() {
            let by = (k + 1) as f64;
            for i in 0..N {
                d[i] = d[i] * u + by * self.terms[k][i];
            }
        }
        d
    }

    /// The second derivative by the parameter.
    pub(in crate::path) fn second(&self, u: f64) -> [f64; N] {
        let mut d = [0.0; N];
        for k in (1..5).rev() {
            let by = (k * (k + 1)) as f64;
            for i in 0..N {
                d[i] = d[i] * u + by * self.terms[k][i];
            }
        }
        d
    }

    /// The third derivative by the parameter.
    pub(in crate::path) fn third(&self, u: f64) -> [f64; N] {
        let mut d = [0.0; N];
        for k in (2..5).rev() {
            let by = ((k - 1) * k * (k + 1)) as f64;
            for i in 0..N {
                d[i] = d[i] * u + by * self.terms[k][i];
            }
        }
        d
    }

    /// The curve between two parameters.
    pub(super) fn part(&self, from: f64, to: f64) -> Option<Self> {
        let mut terms = self.terms;
        for i in 0..N {
            // Taylor's shift.
            let mut c = [0.0; 6];
            c[0] = self.start[i];
            for k in 0..5 {
                c[k + 1] = self.terms[k][i];
            }
            for low in 0..5 {
                for k in (low..5).rev() {
                    c[k] += from * c[k + 1];
                }
            }
            let mut scale = 1.0;
            for k in 0..5 {
                scale *= to - from;
                terms[k][i] = scale * c[k + 1];
            }
        }
        Self::new(self.point(from), terms)
    }

    /// The tangent at a knot.
    pub(super) fn tangent(&self, k: usize) -> [f64; N] {
        let u = self.knots[k];
        let rate = self.rate(u);
        self.first(u).map(|d| d / rate)
    }

    /// Path length per parameter.
    pub(in crate::path) fn rate(&self, u: f64) -> f64 {
        let mut square = 0.0;
        for i in 0..N.min(3) {
            let mut first = 0.0;
            for k in (0..5).rev() {
                first = first * u + (k + 1) as f64 * self.terms[k][i];
            }
            square += first * first;
        }
        square.sqrt()
    }

    /// First and second derivative of the parameter by path length.
    pub(super) fn pace(&self, u: f64) -> [f64; 2] {
        let (mut square, mut along) = (0.0, 0.0);
        for i in 0..N.min(3) {
            let (mut first, mut second) = (0.0, 0.0);
            for k in (0..5).rev() {
                second = second * u + first;
                first = first * u + (k + 1) as f64 * self.terms[k][i];
            }
            square += first * first;
            along += first * second;
        }
        [1.0 / square.sqrt(), -along / (square * square)]
    }

    pub(super) fn length_between(&self, from: f64, to: f64) -> f64 {
        let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
        half * GAUSS8
            .iter()
            .map(|&(x, w)| w * (self.rate(middle - x * half) + self.rate(middle + x * half)))
            .sum::<f64>()
    }

    /// The path length at a parameter.
    pub(in crate::path) fn length_to(&self, u: f64) -> f64 {
        let part = (1..PARTS).find(|&k| u < self.knots[k]).unwrap_or(PARTS) - 1;
        self.lengths[part] + self.length_between(self.knots[part], u)
    }

    pub(super) fn parameter(&self, s: f64) -> f64 {
        let part = (1..PARTS).find(|&k| s < self.lengths[k]).unwrap_or(PARTS) - 1;
        let [u0, u1] = [self.knots[part], self.knots[part + 1]];
        let (s0, length) = (
            self.lengths[part],
            self.lengths[part + 1] - self.lengths[part],
        );
        let x = (s - s0) / length;
        // Hermite's quintic of the parameter over the length, then Newton's method.
        let [[m0, n0], [m1, n1]] = [u0, u1].map(|u| {
            let [first, second] = self.pace(u);
            [first * length, 0.5 * second * length * length]
        });
        // What the end wants beyond the parabola from the start.
        let p = (u1 - u0) - m0 - n0;
        let (dm, dn) = (m1 - m0 - 2.0 * n0, n1 - n0);
        let (c3, c4, c5) = (
            10.0 * p - 4.0 * dm + dn,
            -15.0 * p + 7.0 * dm - 2.0 * dn,
            6.0 * p - 3.0 * dm + dn,
        );
        let mut u = u0 + x * (m0 + x * (n0 + x * (c3 + x * (c4 + x * c5))));
        for _ in 0..4 {
            let step = (s0 + self.length_between(u0, u) - s) / self.rate(u);
            u -= step;
            if step.abs() < CLOSE * (u1 - u0) {
                break;
            }
        }
        u
    }

    pub(super) fn at(&self, u: f64) -> Derivatives<N> {
        let [u1, u2, u3] = [self.first(u), self.second(u), self.third(u)];
        let dot = |a: &[f64; N], b: &[f64; N]| (0..N.min(3)).map(|i| a[i] * b[i]).sum::<f64>();
        let sigma = dot(&u1, &u1).sqrt();
        let sigma1 = dot(&u1, &u2) / sigma;
        let sigma2 = (dot(&u2, &u2) + dot(&u1, &u3) - sigma1 * sigma1) / sigma;
        by_length(self.point(u), &u1, &u2, &u3, sigma, sigma1, sigma2)
    }

    /// See [`Curve::growth`]; between two parameters.
    pub(super) fn growth(&self, u0: f64, u1: f64) -> Growth<N> {
        let (middle, half) = (
            0.5 * (u0 + u1),
            0.5 * (u1 - u0) * (1.0 + ROUNDING) + ROUNDING_NEAR_ZERO,
        );
        // Taylor's coefficients of the derivative by the parameter, about the middle.
        let mut taylor: [[f64; N]; 5] =
            std::array::from_fn(|k| self.terms[k].map(|c| (k + 1) as f64 * c));
        for low in 0..4 {
            for k in (low..4).rev() {
                for i in 0..N {
                    taylor[k][i] += middle * taylor[k + 1][i];
                }
            }
        }
        // The same of σ² = |q′|², a polynomial of degree eight.
        let mut square = [0.0; 9];
        for j in 0..5 {
            for k in 0..5 {
                square[j + k] += (0..N.min(3))
                    .map(|i| taylor[j][i] * taylor[k][i])
                    .sum::<f64>();
            }
        }
        let rest: f64 = square[1..]
            .iter()
            .rev()
            .fold(0.0, |sum, c| (sum + c.abs()) * half);
        growth(
            &std::array::from_fn(|i| spread(&taylor.map(|c| c[i]), half)),
            square[0] - rest,
            &spread(&square, half),
        )
    }
}

/// Bounds of a polynomial's first Taylor coefficients at any point no further than `half` from the
/// one about which it has the coefficients `taylor`.
fn spread(taylor: &[f64], half: f64) -> Jet {
    let mut powers = [0.0; 9];
    for (power, c) in powers.iter_mut().zip(taylor) {
        *power = c.abs();
    }
    // Taylor's shift by `half`, all terms of one sign.
    for low in 0..ORDERS {
        for k in (low..taylor.len() - 1).rev() {
            powers[k] += half * powers[k + 1];
        }
    }
    std::array::from_fn(|k| powers[k])
}
