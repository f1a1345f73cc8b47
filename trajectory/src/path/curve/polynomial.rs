//! Polynomials of the fifth degree by a parameter, measured by their length.
//!
//! The planner moves by path length s, the polynomial by its parameter u. The rate ds/du = |q′(u)| has no integral in
//! closed form, so lengths are integrated by Gauss's rule with eight nodes, part by part, and [`Poly::parameter`]
//! solves for u within one part. That is as precise as the rate is smooth: it is the root of a polynomial of degree
//! eight, and how far that polynomial's complex zeros are from a part limits the rule. Where the tool turns
//! sharply the rate dips, and a zero is about as far from there as the dip is deep. A blend's dip is in the middle, so parts
//! are shorter there from the first. A curve that is fitted to points dips anywhere, and more than once: parts that the same rule
//! measures otherwise when they are cut are halved. (Lengths were 2 % off where parts were short in the middle only and
//! turns tighter than the tolerance, and setpoints had 1.4 times the jerk that was planned; where such fits were
//! refused instead, programs took up to five times as long.)

use super::quintic::Quintic;
use super::{CLOSE, Derivatives};

/// A polynomial of degree five whose path lengths are known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Poly<const N: usize> {
    pub(in crate::path) quintic: Quintic<N>,
    /// How many parts its length is integrated in.
    pub(super) parts: usize,
    /// Parameters at which they begin and end: closer where the rate dips.
    knots: [f64; MOST_PARTS + 1],
    /// Path length up to every knot.
    lengths: [f64; MOST_PARTS + 1],
}

/// Parts that a polynomial is integrated in at first, …
const PARTS: usize = 8;
/// … and at most. (Of curves through turns of a tenth of the tolerance nine of ten need 20 or fewer.)
const MOST_PARTS: usize = 24;

/// Slowest rate of the path length by the parameter, as a part of the faster one at its ends: a curve that is slower in the middle
/// nearly stands still there or turns back, and knots are placed for a dip that is no deeper.
const LEAST_RATE: f64 = 1e-3;

/// What a part's length and those of its two parts may differ by, as a part of it, at three cuts. (Of 100,000 curves that dip
/// anywhere none was off by more than 1e-5 then.)
const PRECISE: f64 = 1e-8;

/// Times that a part is halved, at most.
const HALVINGS: u32 = 16;

/// Steps towards a length's parameter: where every one of them halves what is left, this many reach what rounding leaves.
const MOST_STEPS: u32 = 48;

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
        Self::new(Quintic {
            start: from.q,
            terms,
        })
    }

    /// The curve with its path lengths. `None` if it would stand still or turn back on the way, or turns so often and so
    /// sharply that it needs more than [`MOST_PARTS`].
    pub(in crate::path) fn new(quintic: Quintic<N>) -> Option<Self> {
        let mut poly = Self::unmeasured(quintic);
        let least = LEAST_RATE * quintic.rate(0.0).max(quintic.rate(1.0));
        let is_measured = knots_about_the_middle(&quintic).windows(2).all(|part| {
            let length = quintic.length_between(part[0], part[1]);
            poly.measure(part[0], part[1], length, least, HALVINGS)
        });
        (is_measured && quintic.rate(1.0) >= least).then_some(poly)
    }

    fn unmeasured(quintic: Quintic<N>) -> Self {
        Poly {
            quintic,
            parts: 0,
            knots: [0.0; MOST_PARTS + 1],
            lengths: [0.0; MOST_PARTS + 1],
        }
    }

    /// Goes on with a part up to a parameter, of this length.
    fn add(&mut self, to: f64, length: f64) {
        self.lengths[self.parts + 1] = self.lengths[self.parts] + length;
        self.parts += 1;
        self.knots[self.parts] = to;
    }

    /// Goes on with the part between two parameters, halved until its length is precise. False where the curve is
    /// slower than `least`, or there are too many parts.
    fn measure(&mut self, from: f64, to: f64, length: f64, least: f64, halvings: u32) -> bool {
        let middle = 0.5 * (from + to);
        let slow = self.quintic.rate(from).min(self.quintic.rate(middle));
        if slow.is_nan() || slow < least || self.parts == MOST_PARTS {
            return false;
        }
        let cut = |share: f64| {
            let at = from + share * (to - from);
            [(from, at), (at, to)].map(|(from, to)| self.quintic.length_between(from, to))
        };
        let [before, behind] = cut(0.5);
        let is_precise =
            |[before, behind]: [f64; 2]| (before + behind - length).abs() <= PRECISE * length;
        if is_precise([before, behind]) && is_precise(cut(0.25)) && is_precise(cut(0.75)) {
            self.add(to, length);
            return true;
        }
        halvings > 0
            && self.measure(from, middle, before, least, halvings - 1)
            && self.measure(middle, to, behind, least, halvings - 1)
    }

    pub(super) fn length(&self) -> f64 {
        self.lengths[self.parts]
    }

    /// The same curve with the parameter 1 − u.
    pub(super) fn reversed(&self) -> Self {
        let whole = self.length();
        let mut back = Self::unmeasured(self.quintic.reversed());
        back.parts = self.parts;
        for k in 0..=self.parts {
            back.knots[k] = 1.0 - self.knots[self.parts - k];
            back.lengths[k] = whole - self.lengths[self.parts - k];
        }
        back
    }

    /// The curve between two parameters.
    pub(super) fn part(&self, from: f64, to: f64) -> Self {
        let quintic = self.quintic.part(from, to);
        Self::new(quintic).unwrap_or_else(|| {
            let inside = self.knots[1..self.parts]
                .iter()
                .filter(|&&u| from < u && u < to);
            let mut part = Self::unmeasured(quintic);
            for knot in inside.map(|u| (u - from) / (to - from)).chain([1.0]) {
                let before = part.knots[part.parts];
                part.add(knot, quintic.length_between(before, knot));
            }
            part
        })
    }

    /// The tangent at a knot.
    pub(super) fn tangent(&self, k: usize) -> [f64; N] {
        let u = self.knots[k];
        let rate = self.quintic.rate(u);
        self.quintic.first(u).map(|d| d / rate)
    }

    /// The part that a place is on, by the places at which parts end.
    fn part_of(&self, ends: &[f64; MOST_PARTS + 1], place: f64) -> usize {
        let passed = ends[1..self.parts].iter().take_while(|&&end| end <= place);
        passed.count()
    }

    /// The path length at a parameter.
    pub(in crate::path) fn length_to(&self, u: f64) -> f64 {
        let part = self.part_of(&self.knots, u);
        self.lengths[part] + self.quintic.length_between(self.knots[part], u)
    }

    pub(super) fn parameter(&self, s: f64) -> f64 {
        let part = self.part_of(&self.lengths, s);
        let [u0, u1] = [self.knots[part], self.knots[part + 1]];
        let (s0, length) = (
            self.lengths[part],
            self.lengths[part + 1] - self.lengths[part],
        );
        let x = (s - s0) / length;
        // Hermite's quintic of the parameter over the length, then Newton's method.
        let [[m0, n0], [m1, n1]] = [u0, u1].map(|u| {
            let [first, second] = self.quintic.pace(u);
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
        // Where the rate changes much within a part, what Newton's step leaves the bracket by is halved away.
        let [mut low, mut high] = [u0, u1];
        for _ in 0..MOST_STEPS {
            let over = s0 + self.quintic.length_between(u0, u) - s;
            if over > 0.0 {
                high = high.min(u);
            } else {
                low = low.max(u);
            }
            let step = over / self.quintic.rate(u);
            u -= step;
            if step.abs() < CLOSE * (u1 - u0) {
                break;
            }
            if !(low..=high).contains(&u) {
                u = 0.5 * (low + high);
            }
        }
        u
    }
}

/// Knots that are the closer the nearer they are to a dip of the rate in the middle, where a blend's is.
fn knots_about_the_middle<const N: usize>(quintic: &Quintic<N>) -> [f64; PARTS + 1] {
    let most = quintic.rate(0.0).max(quintic.rate(1.0));
    // A zero is about so far from there in the complex plane; parts shorter than their distance from it are
    // integrated to rounding.
    let dip = 0.5 * (quintic.rate(0.5) / most).clamp(LEAST_RATE, 1.0);
    let scale = libm::asinh(0.5 / dip);
    let middle = 0.5 * PARTS as f64;
    let mut knots =
        std::array::from_fn(|k| 0.5 + dip * libm::sinh(scale * (k as f64 - middle) / middle));
    (knots[0], knots[PARTS]) = (0.0, 1.0);
    knots
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Polynomials that dip anywhere, also twice and to nothing: given by their derivative's values at five parameters, some of them
    /// small.
    fn quintic() -> impl Strategy<Value = Quintic<3>> {
        let rate = (prop::array::uniform3(-1.0..1.0_f64), -3.5..0.5_f64)
            .prop_map(|(direction, size)| direction.map(|d| d * libm::exp10(size.min(0.0))));
        (prop::array::uniform5(rate), -3.0..3.0_f64).prop_map(|(rates, size)| {
            // Newton's divided differences, then powers of u.
            let mut terms = [[0.0; 3]; 5];
            for i in 0..3 {
                let at = [0.0, 0.25, 0.5, 0.75, 1.0];
                let mut divided = rates.map(|rate| rate[i] * libm::exp10(size));
                for level in 1..5 {
                    for k in (level..5).rev() {
                        divided[k] = (divided[k] - divided[k - 1]) / (at[k] - at[k - level]);
                    }
                }
                let mut powers = [0.0; 5];
                for k in (0..5).rev() {
                    for n in (1..5).rev() {
                        powers[n] = powers[n - 1] - at[k] * powers[n];
                    }
                    powers[0] = divided[k] - at[k] * powers[0];
                }
                for k in 0..5 {
                    terms[k][i] = powers[k] / (k + 1) as f64;
                }
            }
            Quintic {
                start: [100.0, -3.0, 0.0],
                terms,
            }
        })
    }

    /// The path length between two parameters by so many parts that no dip is too narrow for them.
    fn length(quintic: &Quintic<3>, from: f64, to: f64) -> f64 {
        let step = (to - from) / 4000.0;
        (0..4000)
            .map(|k| from + step * f64::from(k))
            .map(|u| quintic.length_between(u, u + step))
            .sum()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(500))]

        /// Wherever a polynomial dips, its lengths are precise or it is refused; a length's parameter has that
        /// length; a part of it, and it the other way round, are the same curve.
        #[test]
        fn lengths_are_precise_wherever_the_rate_dips(
            quintic in quintic(),
            places in prop::array::uniform3(0.0..1.0_f64),
        ) {
            let Some(poly) = Poly::new(quintic) else {
                let rates = (0..=1000).map(|k| quintic.rate(f64::from(k) / 1000.0));
                let [least, most] = [f64::min, f64::max].map(|of| rates.clone().reduce(of).unwrap());
                prop_assert!(least < 0.1 * most, "refused at {least} of {most}");
                return Ok(());
            };
            let whole = poly.length();
            let most = 1e-5 * whole;
            let back = poly.reversed();
            for u in places {
                let s = poly.length_to(u);
                let off = (s - length(&quintic, 0.0, u)).abs();
                prop_assert!(off <= most, "length {off} of {whole} at {u}");
                let off = (poly.length_to(poly.parameter(s)) - s).abs();
                prop_assert!(off <= most, "parameter {off} of {whole} at {u}");
                let [p, q] = [
                    quintic.point(u),
                    back.quintic.point(back.parameter(whole - s)),
                ];
                for (p, q) in p.iter().zip(q) {
                    prop_assert!((p - q).abs() <= most + 1e-12, "back {p} {q}");
                }
            }
            let [from, to, _] = places;
            let (from, to) = (from.min(to), from.max(to));
            if to - from > 1e-3 {
                let part = poly.part(from, to);
                let off = (part.length() - length(&quintic, from, to)).abs();
                prop_assert!(off <= most, "part {off} of {whole} from {from} to {to}");
                let s = poly.length_to(from) + 0.5 * part.length();
                let [p, q] = [
                    quintic.point(poly.parameter(s)),
                    part.quintic.point(part.parameter(0.5 * part.length())),
                ];
                for (p, q) in p.iter().zip(q) {
                    prop_assert!((p - q).abs() <= 2.0 * most + 1e-12, "part {p} {q}");
                }
            }
        }
    }
}
