//! Polynomials of the fifth degree by a parameter: points, derivatives and their bounds.

use super::Derivatives;
use super::length::{GAUSS8, Growth, Jet, ORDERS, by_length, growth};

/// A polynomial of degree five in a parameter from 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::path) struct Quintic<const N: usize> {
    pub(in crate::path) start: [f64; N],
    /// Coefficients of u, u² … u⁵.
    pub(in crate::path) terms: [[f64; N]; 5],
}

/// What rounding may bring a parameter outside of a range, as a part of the range, and beside.
const ROUNDING: f64 = 1e-9;
const ROUNDING_NEAR_ZERO: f64 = 1e-12;

impl<const N: usize> Quintic<N> {
    /// The point at the parameter `u`.
    pub(in crate::path) fn point(&self, u: f64) -> [f64; N] {
        std::array::from_fn(|i| {
            self.start[i] + u * self.terms.iter().rev().fold(0.0, |sum, c| sum * u + c[i])
        })
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

    /// Coefficients of 1, u, u² … u⁵ of an axis.
    fn coefficients(&self, axis: usize) -> [f64; 6] {
        let mut all = [self.start[axis]; 6];
        for (c, terms) in all[1..].iter_mut().zip(&self.terms) {
            *c = terms[axis];
        }
        all
    }

    /// The same curve with the parameter 1 − u.
    pub(super) fn reversed(&self) -> Self {
        // Coefficients by powers of 1 − u, by dividing again and again (Horner's scheme).
        let mut terms = [[0.0; N]; 5];
        let mut start = self.start;
        for i in 0..N {
            let mut c = self.coefficients(i);
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
        Quintic { start, terms }
    }

    /// The curve between two parameters.
    pub(super) fn part(&self, from: f64, to: f64) -> Self {
        let mut terms = self.terms;
        for i in 0..N {
            // Taylor's shift.
            let mut c = self.coefficients(i);
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
        Quintic {
            start: self.point(from),
            terms,
        }
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

    /// The path length between two parameters by Gauss's rule with eight nodes.
    pub(super) fn length_between(&self, from: f64, to: f64) -> f64 {
        let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
        half * GAUSS8
            .iter()
            .map(|&(x, w)| w * (self.rate(middle - x * half) + self.rate(middle + x * half)))
            .sum::<f64>()
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
        let mut taylor = self.terms;
        for (k, terms) in taylor.iter_mut().enumerate() {
            for c in terms {
                *c *= (k + 1) as f64;
            }
        }
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
            &std::array::from_fn(|i| {
                let taylor = [0, 1, 2, 3, 4].map(|k: usize| taylor[k][i]);
                // Of an axis that stands everything is 0.
                match taylor == [0.0; 5] {
                    true => [0.0; ORDERS],
                    false => spread(&taylor, half),
                }
            }),
            square[0] - rest,
            &spread(&square, half),
        )
    }
}

/// Bounds of a polynomial's first Taylor coefficients at any point no further than `half` from the
/// one about which it has the coefficients `taylor`.
fn spread<const TERMS: usize>(taylor: &[f64; TERMS], half: f64) -> Jet {
    let mut powers = taylor.map(f64::abs);
    // Taylor's shift by `half`, all terms of one sign.
    for low in 0..ORDERS {
        for k in (low..TERMS - 1).rev() {
            powers[k] += half * powers[k + 1];
        }
    }
    std::array::from_fn(|k| powers.get(k).copied().unwrap_or(0.0))
}
