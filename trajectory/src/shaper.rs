//! Input shaping: a command given in a few parts, so timed that the vibrations that they excite cancel.
//!
//! A vibration of natural frequency ω and damping ratio ζ answers an impulse at the time tᵢ with
//! `e^(λ (t − tᵢ))`, λ = −ζω + iω√(1 − ζ²). A command that is split into parts of the shares Aᵢ (all above zero,
//! in sum 1), each delayed by tᵢ, therefore leaves behind its last part the share
//!
//! ```text
//! V(ω, ζ) = | Σ Aᵢ e^(λ (tₙ − tᵢ)) |
//! ```
//!
//! of what it would leave unshaped. That is exact for any command, as vibrations are linear, so the parts are chosen
//! by it alone. They are half a period apart, and what has died away until the next one makes that smaller by
//! K = e^(−πζ/√(1−ζ²)):
//!
//! | kind | shares, but for K and the sum | V |
//! |---|---|---|
//! | ZV | 1, 1 | zero at ω |
//! | ZVD | 1, 2, 1 | zero at ω with its derivative |
//! | EI | 1+v, 2(1−v), 1+v | v = 5 % at ω, zero on either side of it |
//! | two-hump EI | by x³ = v²(1+√(1−v²)): (3x²+2x+3v²)/16x, ½ less that, and back | zero at ω and beside it, v between |
//!
//! Several vibrations are suppressed by as many shapers in a row: their parts' convolution
//! ([`Shaper::new`]). Sources: Singer and Seering, *Preshaping command inputs to reduce system vibration* (1990);
//! Singhose, Seering and Singer, *Residual vibration reduction using vector diagrams to generate shaped inputs* (1994).
//!
//! # What shaping every coordinate does to a motion
//!
//! What comes out is a mean of what went in lately. So wherever the positions, velocities, accelerations or jerks that
//! went in have kept limits of single axes, those that come out do: nothing has to be planned anew. A straight line
//! stays straight. A curve is left: by Taylor's theorem by at most half of the greatest acceleration times the
//! [variance](Spread::variance) of the parts, about κv²σ²/2 where the path has the curvature κ.

use libm::{cbrt, exp, sqrt};
use std::f64::consts::{PI, TAU};

/// What EI shapers leave of a vibration at most, about the frequency that they are made for.
pub const TOLERATED: f64 = 0.05;

/// A vibration to be suppressed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vibration {
    /// Natural frequency, undamped, Hz.
    pub frequency: f64,
    /// Damping ratio, from 0 to less than 1.
    pub damping: f64,
}

impl Vibration {
    /// Half of the damped period, s, and what is left of it after that.
    fn half_period(&self) -> (f64, f64) {
        let root = sqrt(1.0 - self.damping * self.damping);
        (
            0.5 / (self.frequency * root),
            exp(-PI * self.damping / root),
        )
    }
}

/// What of a motion goes through a shaper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// The distance along the path: the path stays exact.
    Clock,
    /// Every coordinate: curves are cut.
    Coordinates,
}

/// By what the parts of a shaper are chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Zero vibration: the shortest, for frequencies that are known well.
    Zv,
    /// Zero vibration and derivative: about 5 % are left where the frequency is 14 % off.
    Zvd,
    /// Extra insensitive: as long as ZVD, 5 % where it is 19 % off.
    Ei,
    /// Extra insensitive with two humps: 5 % where it is 35 % off.
    TwoHumpEi,
}

impl Kind {
    /// The shares of an undamped vibration's shaper, half a period apart.
    fn shares(self) -> Vec<f64> {
        let v = TOLERATED;
        match self {
            Self::Zv => vec![0.5, 0.5],
            Self::Zvd => vec![0.25, 0.5, 0.25],
            Self::Ei => vec![(1.0 + v) / 4.0, (1.0 - v) / 2.0, (1.0 + v) / 4.0],
            Self::TwoHumpEi => {
                let x = cbrt(v * v * (1.0 + sqrt(1.0 - v * v)));
                let outer = (3.0 * x * x + 2.0 * x + 3.0 * v * v) / (16.0 * x);
                vec![outer, 0.5 - outer, 0.5 - outer, outer]
            }
        }
    }
}

/// A part of a command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Impulse {
    /// How much later than the command, s.
    pub at: f64,
    /// Its share of the command.
    pub share: f64,
}

/// The parts of a command, by time, the first at 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Shaper {
    impulses: Vec<Impulse>,
}

/// How far a shaper spreads setpoints in time: what a path has to know of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// From the first part to the last, s.
    pub duration: f64,
    /// How long a motion rests, s, until its setpoints rest there, too, wherever between two of them its rest begins.
    pub settling: f64,
    /// Of the parts' delays, s².
    pub variance: f64,
}

impl Spread {
    /// The speed, mm/s, at which a path of that curvature, 1/mm, is left by no more than `off` mm: κv²σ²/2.
    #[must_use]
    pub fn speed(&self, curvature: f64, off: f64) -> f64 {
        sqrt(2.0 * off / (curvature * self.variance))
    }
}

impl Shaper {
    /// What leaves commands as they are.
    #[must_use]
    pub fn none() -> Self {
        Self {
            impulses: vec![Impulse {
                at: 0.0,
                share: 1.0,
            }],
        }
    }

    /// For all of these vibrations.
    #[must_use]
    pub fn new(kind: Kind, vibrations: &[Vibration]) -> Self {
        let shapers = vibrations.iter().map(|it| Self::of_one(kind, it));
        shapers.fold(Self::none(), |all, one| all.convolved(&one))
    }

    fn of_one(kind: Kind, vibration: &Vibration) -> Self {
        let (apart, left) = vibration.half_period();
        let mut decay = 1.0;
        let mut impulses = Vec::new();
        for (place, share) in kind.shares().into_iter().enumerate() {
            let at = place as f64 * apart;
            let share = share * decay;
            impulses.push(Impulse { at, share });
            decay *= left;
        }
        let sum: f64 = impulses.iter().map(|it| it.share).sum();
        impulses.iter_mut().for_each(|it| it.share /= sum);
        Self { impulses }
    }

    /// One behind the other.
    fn convolved(&self, other: &Self) -> Self {
        let each = self.impulses.iter().flat_map(|one| {
            other.impulses.iter().map(|other| Impulse {
                at: one.at + other.at,
                share: one.share * other.share,
            })
        });
        let mut impulses: Vec<_> = each.collect();
        impulses.sort_by(|one, other| one.at.total_cmp(&other.at));
        Self { impulses }
    }

    /// The parts.
    #[must_use]
    pub fn impulses(&self) -> &[Impulse] {
        &self.impulses
    }

    /// By how much a shaped command ends later, s.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.impulses.last().map_or(0.0, |last| last.at)
    }

    /// How far it spreads setpoints that are `period` s apart; `None` where they are as they were.
    #[must_use]
    pub fn spread(&self, period: f64) -> Option<Spread> {
        let weights = self.weights(period);
        let cycles = weights.last().map(|last| last.0).filter(|last| *last > 0)?;
        let mean: f64 = weights.iter().map(|it| it.1 * it.0 as f64).sum();
        let away = |it: &(usize, f64)| it.1 * (it.0 as f64 - mean) * (it.0 as f64 - mean);
        Some(Spread {
            duration: cycles as f64 * period,
            settling: (cycles + 1) as f64 * period,
            variance: weights.iter().map(away).sum::<f64>() * period * period,
        })
    }

    /// By how much a shaped command is later in the mean, s.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.impulses.iter().map(|it| it.share * it.at).sum()
    }

    /// What part of a vibration is left at the end of a shaped command, of what an unshaped one leaves at its own.
    #[must_use]
    pub fn residual(&self, of: &Vibration) -> f64 {
        let natural = TAU * of.frequency;
        let turning = natural * sqrt(1.0 - of.damping * of.damping);
        let (mut cos, mut sin) = (0.0, 0.0);
        for Impulse { at, share } in &self.impulses {
            let since = self.duration() - at;
            let part = share * exp(-of.damping * natural * since);
            cos += part * libm::cos(turning * since);
            sin += part * libm::sin(turning * since);
        }
        sqrt(cos * cos + sin * sin)
    }

    /// How many cycles of `period` s ago counts with which weight, ascending: a delay that falls between two
    /// cycles takes from both, so that the mean stays. Of a vibration of frequency f that takes at most (2πf period)²/8.
    pub(crate) fn weights(&self, period: f64) -> Vec<(usize, f64)> {
        let mut weights: Vec<(usize, f64)> = Vec::new();
        let mut add = |ago: usize, weight: f64| match weights.iter_mut().find(|it| it.0 == ago) {
            Some(found) => found.1 += weight,
            None if weight > 0.0 => weights.push((ago, weight)),
            None => {}
        };
        for Impulse { at, share } in &self.impulses {
            let ago = at / period;
            let whole = ago.floor();
            add(whole as usize, share * (1.0 - (ago - whole)));
            add(whole as usize + 1, share * (ago - whole));
        }
        weights.sort_by_key(|it| it.0);
        weights
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const KINDS: [Kind; 4] = [Kind::Zv, Kind::Zvd, Kind::Ei, Kind::TwoHumpEi];

    fn vibration(frequency: f64, damping: f64) -> Vibration {
        Vibration { frequency, damping }
    }

    /// The greatest residual where the vibration's frequency is up to that part off.
    fn worst(kind: Kind, damping: f64, off: f64) -> f64 {
        let shaper = Shaper::new(kind, &[vibration(8.0, damping)]);
        let frequencies = (-100..=100).map(|part| 8.0 * (1.0 + off * f64::from(part) / 100.0));
        let residuals = frequencies.map(|it| shaper.residual(&vibration(it, damping)));
        residuals.fold(0.0, f64::max)
    }

    #[test]
    fn each_kind_keeps_five_per_cent_as_far_as_the_literature_says() {
        for damping in [0.0, 0.02, 0.1] {
            for (kind, off) in [
                (Kind::Zv, 0.03),
                (Kind::Zvd, 0.14),
                (Kind::Ei, 0.19),
                (Kind::TwoHumpEi, 0.34),
            ] {
                let worst = worst(kind, damping, off);
                assert!(worst <= 0.0505, "{kind:?} {damping}: {worst}");
            }
        }
        assert!(worst(Kind::Zv, 0.02, 0.04) > 0.05);
        assert!(worst(Kind::Zvd, 0.02, 0.16) > 0.05);
        assert!(worst(Kind::Ei, 0.02, 0.22) > 0.05);
    }

    #[test]
    fn an_undamped_shaper_has_the_known_variance() {
        let period = 1.0 / 8.0_f64;
        for (kind, variance) in [
            (Kind::Zv, period * period / 16.0),
            (Kind::Zvd, period * period / 8.0),
        ] {
            let shaper = Shaper::new(kind, &[vibration(8.0, 0.0)]);
            let spread = shaper.spread(period / 2.0).unwrap();
            assert!((spread.variance - variance).abs() < 1e-15, "{kind:?}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        /// Shares above zero and in sum 1, on the grid too, where the mean delay stays; each vibration is left as
        /// little as by its own shaper.
        #[test]
        fn shapers_of_several_vibrations_are_means_that_suppress_each(
            kind in prop::sample::select(KINDS.to_vec()),
            modes in prop::collection::vec((0.5..100.0_f64, 0.0..0.3_f64), 1..4),
            period in 0.0005..0.02_f64,
        ) {
            let modes: Vec<_> = modes.into_iter().map(|(f, z)| vibration(f, z)).collect();
            let shaper = Shaper::new(kind, &modes);
            let shares = shaper.impulses().iter().map(|it| it.share);
            prop_assert!(shares.clone().all(|share| share > 0.0));
            prop_assert!((shares.sum::<f64>() - 1.0).abs() < 1e-12);
            for mode in &modes {
                let most = if matches!(kind, Kind::Zv | Kind::Zvd) { 1e-12 } else { TOLERATED + 1e-12 };
                prop_assert!(shaper.residual(mode) <= most, "{}", shaper.residual(mode));
            }
            let weights = shaper.weights(period);
            prop_assert!(weights.iter().all(|it| it.1 > 0.0));
            prop_assert!((weights.iter().map(|it| it.1).sum::<f64>() - 1.0).abs() < 1e-12);
            let mean: f64 = weights.iter().map(|&(ago, weight)| ago as f64 * period * weight).sum();
            prop_assert!((mean - shaper.mean()).abs() < 1e-9);
        }
    }
}
