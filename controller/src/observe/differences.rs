//! What positions at the SYNCs say of the motion between them.
//!
//! # The method
//!
//! Positions x₀, x₁, … are known at instants T apart. Over a stride of m of them, with h = m T, the
//! differences of the first three orders are means of the derivatives:
//!
//! ```text
//! Δ¹ =  x₀ − x₋ₘ                      =  h  · mean of x′ over the last h
//! Δ² =  x₀ − 2 x₋ₘ + x₋₂ₘ             =  h² · weighted mean of x″ over the last 2 h
//! Δ³ =  x₀ − 3 x₋ₘ + 3 x₋₂ₘ − x₋₃ₘ    =  h³ · weighted mean of x‴ over the last 3 h
//! ```
//!
//! The weights are B-splines: nowhere negative, with the integral 1 (Peano's theorem). So a motion inside
//! its limits has |Δⁿ| ≤ hⁿ · limit, at every stride, whatever it does between the instants; and where
//! |Δⁿ| is more, the limit has been exceeded for certain. Nothing of the plan is asked.
//!
//! Positions are known to ±u only. What is sent is rounded to an increment q, so u = q/2. The
//! coefficients of Δⁿ add up to 2ⁿ by magnitude, so that it is off by 2ⁿ u at most: by q, 2 q and 4 q. What
//! is certain is therefore
//!
//! ```text
//! bound = (|Δⁿ| − 2ⁿ u) / hⁿ
//! ```
//!
//! and it never raises a false alarm: no motion inside the limits, rounded to the nearest increment,
//! reaches it. It stays below what the motion does, by up to 2ⁿ⁺¹ u / hⁿ and by what the mean levels out.
//!
//! One stride is not enough. At m = 1 an increment weighs most: with q = 0.15 µm and T = 2 ms, 4 q / T³ is
//! 76,000 mm/s³, more than the jerk that a machine is allowed. But what is uncertain falls with m³: at
//! m = 4 it is 1,200 mm/s³. A jump of a single setpoint shows at the short strides, an excess that lasts
//! shows at the long ones. Of a ladder of strides, each twice the one before, the best bound counts.
//!
//! # The smallest violation that is seen
//!
//! - A jerk that is too great by e for 3 m T shows where e > 8 q / (m T)³ at the latest; an acceleration,
//!   for 2 m T, where e > 4 q / (m T)²; a velocity, for m T, where e > 2 q / (m T).
//! - One setpoint that is off by d, out of an otherwise good motion, appears three times as much in one of
//!   the Δ³: it shows where 3 d > 8 q + 2 J T³ at the latest. Less than that, down to half an increment, no
//!   differences can tell from rounding; it shows against the plan ([`limits`](super::limits)).
//!
//! The plan's own positions are judged in the same way. They are not rounded to increments, but only as
//! numbers are, so that one stride suffices.

use std::collections::VecDeque;

/// Setpoints from one to the next of which differences are taken.
pub(super) const STRIDES: [usize; 7] = [1, 2, 4, 8, 16, 32, 64];
/// Positions that are kept: for the third difference at the longest stride.
const KEPT: usize = 3 * STRIDES[STRIDES.len() - 1] + 1;

/// By how much a position that was rounded to the nearest increment is off, and the conversion before it.
const HALF: f64 = 0.5 + 1e-6;
/// Two curves that go on smoothly one from the other do so to rounding; by this part a difference over
/// their joint may be more than on either.
const JOINTS: f64 = 1e-6;

/// Roundings of a position along its way from a curve's points to a setpoint, in units of its last place.
const ROUNDINGS: f64 = 4.0;

/// The positions of one axis, or drive, at the last SYNCs.
#[derive(Debug)]
pub(super) struct Differences {
    /// Between two positions, s.
    period: f64,
    /// By how much each may be off.
    uncertainty: Uncertainty,
    /// The newest first.
    positions: VecDeque<f64>,
    /// The cycle of the newest.
    cycle: u64,
}

/// By how much positions may be off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Uncertainty {
    /// Whole increments: by half of one.
    Increments,
    /// As numbers are rounded.
    Numbers,
    /// By so much, and as numbers are rounded.
    Within(f64),
}

/// A difference of positions.
#[derive(Clone, Copy, Debug)]
pub(super) struct Difference {
    /// Its magnitude.
    size: f64,
    /// By how much that may be off.
    off: f64,
    /// What makes a mean of it: hⁿ.
    time: f64,
}

impl Difference {
    /// The magnitude of the mean.
    pub(super) fn mean(self) -> f64 {
        self.size / self.time
    }

    /// By how much that may be off.
    pub(super) fn off(self) -> f64 {
        self.off / self.time
    }

    /// What magnitude the derivative has certainly reached.
    fn certain(self) -> f64 {
        (self.size - self.off) / self.time
    }
}

impl Differences {
    /// Of positions with so many seconds from cycle to cycle.
    pub(super) fn new(period: f64, uncertainty: Uncertainty) -> Self {
        Self {
            period,
            uncertainty,
            positions: VecDeque::with_capacity(KEPT),
            cycle: 0,
        }
    }

    /// Takes the position of a cycle; returns what magnitudes of velocity, acceleration and jerk have
    /// certainly been reached lately. Before the first one, and where cycles were left out, it is taken to
    /// have rested.
    pub(super) fn push(&mut self, cycle: u64, position: f64) -> [f64; 3] {
        self.take(cycle, position);
        let strides = match self.uncertainty {
            Uncertainty::Increments | Uncertainty::Within(_) => &STRIDES[..],
            Uncertainty::Numbers => &STRIDES[..1],
        };
        let mut reached = [0.0_f64; 3];
        for &stride in strides {
            for (reached, difference) in reached.iter_mut().zip(self.at_stride(stride)) {
                // Most are certainly no more than what was reached at another stride, which is seen without a division.
                if difference.size - difference.off > *reached * difference.time {
                    *reached = reached.max(difference.certain() * (1.0 - JOINTS));
                }
            }
        }
        reached
    }

    /// Takes the position of a cycle, as [`push`](Self::push) does.
    pub(super) fn take(&mut self, cycle: u64, position: f64) {
        if self.positions.is_empty() || cycle != self.cycle + 1 {
            self.positions.clear();
            self.positions.resize(KEPT, position);
        }
        self.positions.truncate(KEPT - 1);
        self.positions.push_front(position);
        self.cycle = cycle;
    }

    /// The differences of the first three orders up to the newest position, over a stride of [`STRIDES`]; at
    /// least one position was taken.
    pub(super) fn at_stride(&self, stride: usize) -> [Difference; 3] {
        let at = |k: usize| self.positions[k * stride];
        let (a, b, c, d) = (at(0), at(1), at(2), at(3));
        let rounding = || ROUNDINGS * (a.abs().next_up() - a.abs());
        let off = match self.uncertainty {
            Uncertainty::Increments => HALF,
            Uncertainty::Numbers => rounding(),
            Uncertainty::Within(off) => off + rounding(),
        };
        let h = stride as f64 * self.period;
        let of = |difference: f64, off: f64, time: f64| Difference {
            size: difference.abs(),
            off,
            time,
        };
        [
            of(a - b, 2.0 * off, h),
            of(a - 2.0 * b + c, 4.0 * off, h * h),
            of(a - 3.0 * (b - c) - d, 8.0 * off, h * h * h),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A motion of constant jerk from phase to phase, sampled each `period`; the greatest magnitudes of
    /// its derivatives.
    fn motion(period: f64, phases: &[(f64, f64)]) -> (Vec<f64>, [f64; 3]) {
        let (mut p, mut v, mut a, mut next) = (0.0, 0.0_f64, 0.0_f64, 0.0);
        let (mut samples, mut most) = (Vec::new(), [0.0_f64; 3]);
        for &(jerk, duration) in phases {
            while next < duration {
                let t = next;
                samples.push(p + t * (v + t * (a / 2.0 + t * jerk / 6.0)));
                next += period;
            }
            next -= duration;
            let turn = (-a / jerk).clamp(0.0, duration);
            for t in [0.0, turn, duration] {
                most[0] = most[0].max((v + t * (a + t * jerk / 2.0)).abs());
                most[1] = most[1].max((a + t * jerk).abs());
            }
            most[2] = most[2].max(jerk.abs());
            p += duration * (v + duration * (a / 2.0 + duration * jerk / 6.0));
            v += duration * (a + duration * jerk / 2.0);
            a += duration * jerk;
        }
        (samples, most)
    }

    fn greatest(of: &mut Differences, samples: &[f64]) -> [f64; 3] {
        let mut most = [0.0_f64; 3];
        for (cycle, sample) in samples.iter().enumerate() {
            let reached = of.push(cycle as u64, *sample);
            for (most, reached) in most.iter_mut().zip(reached) {
                *most = most.max(reached);
            }
        }
        most
    }

    proptest! {
        /// No motion is said to do more than it does, rounded to increments or not.
        #[test]
        fn nothing_is_claimed_that_was_not(
            period in 0.001..0.02_f64,
            increment in 1e-5..1e-2_f64,
            phases in prop::collection::vec((-1e5..1e5_f64, 1e-4..0.3), 1..12),
        ) {
            let (samples, most) = motion(period, &phases);
            let counts: Vec<f64> = samples.iter().map(|p| (p / increment).round()).collect();
            let mut rounded = Differences::new(period, Uncertainty::Increments);
            let claimed = greatest(&mut rounded, &counts).map(|it| it * increment);
            let mut exact = Differences::new(period, Uncertainty::Numbers);
                let told = greatest(&mut exact, &samples);
            for order in 0..3 {
                prop_assert!(claimed[order] <= most[order] * (1.0 + 1e-9), "{claimed:?} {most:?}");
                prop_assert!(told[order] <= most[order] * (1.0 + 1e-6) + 1e-3, "{told:?} {most:?}");
            }
        }

        /// A jerk that lasts is seen as far as the head of this module says.
        #[test]
        fn what_lasts_is_seen(increment in 1e-5..1e-3_f64, jerk in 1e3..1e5_f64) {
            let period = 0.002;
            let (samples, _) = motion(period, &[(jerk, 0.05), (-jerk, 0.1), (jerk, 0.05)]);
            let counts: Vec<f64> = samples.iter().map(|p| (p / increment).round()).collect();
            let mut rounded = Differences::new(period, Uncertainty::Increments);
            let claimed = greatest(&mut rounded, &counts)[2] * increment;
            // Eight cycles three times fit into the reversal in the middle.
            let least = jerk - 8.0 * increment / (8.0 * period).powi(3);
            prop_assert!(claimed >= least * (1.0 - 1e-5), "{claimed} of {jerk}, at least {least}");
        }
    }

    #[test]
    fn one_setpoint_that_is_off_is_seen_from_the_stated_size_on() {
        let (period, increment, jerk) = (0.002, 1.5e-4, 60_000.0_f64);
        let (samples, _) = motion(period, &[(jerk, 0.05), (-jerk, 0.1), (jerk, 0.05)]);
        let jerk_in_increments = jerk * period.powi(3) / increment;
        let size = ((8.0 + 2.0 * jerk_in_increments) / 3.0).ceil();
        for place in 5..samples.len() - 5 {
            let mut counts: Vec<f64> = samples.iter().map(|p| (p / increment).round()).collect();
            counts[place] += size;
            let mut rounded = Differences::new(period, Uncertainty::Increments);
            let claimed = greatest(&mut rounded, &counts)[2] * increment;
            assert!(claimed > jerk, "{place}: {claimed}");
        }
    }

    #[test]
    fn cycles_that_were_left_out_are_no_jump() {
        let mut of = Differences::new(0.002, Uncertainty::Increments);
        of.push(0, 0.0);
        assert_eq!(of.push(5, 1000.0), [0.0; 3]);
        assert!(of.push(6, 2000.0)[0] > 0.0);
    }
}
