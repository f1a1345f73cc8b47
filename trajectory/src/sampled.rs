//! Motion that is known by positions at a fixed step, as others have planned or measured it.
//!
//! Between its samples each axis goes along the cubic spline through all of them, at rest at both ends: its velocity
//! and acceleration are continuous, its jerk is constant from sample to sample. Where a cycle is as long as the step, the
//! setpoints are the samples themselves.

use crate::profile::State;

/// By this part of a step an instant may be beside a sample and still be at it.
const WHOLE: f64 = 1e-6;

/// Positions of axes at a fixed step.
#[derive(Clone, Debug, PartialEq)]
pub struct Sampled<const N: usize> {
    /// s.
    step: f64,
    /// From the first sample to the last, s.
    duration: f64,
    axes: [Option<Spline>; N],
}

/// Why positions are no motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoMotion {
    /// No axis has two of them, or some have more than others.
    #[error("every axis needs as many samples, at least two")]
    Count,
    /// A position or the step is no finite number, or the step is none.
    #[error("positions must be finite, and the step above 0 s")]
    NotFinite,
}

/// One axis by positions and velocities at its samples.
#[derive(Clone, Debug, PartialEq)]
struct Spline {
    positions: Vec<f64>,
    /// By step.
    slopes: Vec<f64>,
}

impl<const N: usize> Sampled<N> {
    /// The motion through samples that are `step` seconds apart; an axis without any rests.
    ///
    /// # Errors
    /// There is no such motion.
    pub fn through(positions: [Option<Vec<f64>>; N], step: f64) -> Result<Self, NoMotion> {
        let mut counts = positions.iter().flatten().map(Vec::len);
        let count = counts.next().filter(|&count| count > 1);
        let count = count.ok_or(NoMotion::Count)?;
        if counts.any(|other| other != count) {
            return Err(NoMotion::Count);
        }
        let mut all = positions.iter().flatten().flatten();
        if !(step > 0.0 && step.is_finite() && all.all(|position| position.is_finite())) {
            return Err(NoMotion::NotFinite);
        }
        Ok(Self {
            step,
            duration: (count - 1) as f64 * step,
            axes: positions.map(|it| it.map(Spline::through)),
        })
    }

    /// Seconds from sample to sample.
    #[must_use]
    pub fn step(&self) -> f64 {
        self.step
    }

    /// Seconds from the first sample to the last.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.duration
    }

    /// Whether no axis is elsewhere at the sample before than at the one behind.
    #[must_use]
    pub fn rests(&self, time: f64) -> bool {
        let at = time / self.step;
        let is_still = |spline: &Spline| {
            let last = spline.positions.len() - 1;
            let [before, behind] = [at - WHOLE, at + WHOLE];
            let [before, behind] =
                [before.floor(), behind.ceil()].map(|it| (it.max(0.0) as usize).min(last));
            spline.positions[before] == spline.positions[behind]
        };
        self.axes.iter().flatten().all(is_still)
    }

    /// Where an axis is so many seconds from the first sample, and its jerk: at rest before that and behind the last
    /// one. Nothing of an axis without samples.
    #[must_use]
    pub fn at(&self, axis: usize, time: f64) -> Option<(State, f64)> {
        let spline = self.axes[axis].as_ref()?;
        let at = (time / self.step).clamp(0.0, (spline.positions.len() - 1) as f64);
        let (state, jerk) = spline.at(at);
        if time <= 0.0 || time >= self.duration {
            let rest = State {
                p: state.p,
                v: 0.0,
                a: 0.0,
            };
            return Some((rest, 0.0));
        }
        let State { p, v, a } = state;
        let by = 1.0 / self.step;
        let state = State {
            p,
            v: v * by,
            a: a * by * by,
        };
        Some((state, jerk * by * by * by))
    }
}

impl Spline {
    /// The slopes with which velocity and acceleration are continuous, by the elimination of a matrix of three diagonals:
    /// m₋ + 4 m + m₊ = 3 (p₊ − p₋), with 0 at both ends.
    fn through(positions: Vec<f64>) -> Self {
        let count = positions.len();
        let (mut slopes, mut upper) = (vec![0.0; count], vec![0.0; count]);
        for k in 1..count - 1 {
            let pivot = 4.0 - upper[k - 1];
            upper[k] = 1.0 / pivot;
            slopes[k] = (3.0 * (positions[k + 1] - positions[k - 1]) - slopes[k - 1]) / pivot;
        }
        for k in (1..count - 1).rev() {
            slopes[k] -= upper[k] * slopes[k + 1];
        }
        Self { positions, slopes }
    }

    /// So many steps from the first sample, with derivatives by step.
    fn at(&self, at: f64) -> (State, f64) {
        let k = (at as usize).min(self.positions.len() - 2);
        let u = at - k as f64;
        let step = self.positions[k + 1] - self.positions[k];
        let [from, to] = [self.slopes[k], self.slopes[k + 1]];
        let (square, cube) = (3.0 * step - 2.0 * from - to, from + to - 2.0 * step);
        // From the nearer end, so that both samples are met.
        let p = match u < 0.5 {
            true => self.positions[k] + u * (from + u * (square + u * cube)),
            false => {
                let (back, bent) = (1.0 - u, square + 3.0 * cube);
                self.positions[k + 1] - back * (to - back * (bent - back * cube))
            }
        };
        let state = State {
            p,
            v: from + u * (2.0 * square + 3.0 * u * cube),
            a: 2.0 * square + 6.0 * u * cube,
        };
        (state, 6.0 * cube)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn samples(positions: Vec<f64>, step: f64) -> Sampled<2> {
        Sampled::through([Some(positions), None], step).unwrap()
    }

    #[test]
    fn a_cubic_from_rest_to_rest_is_met_everywhere() {
        let (step, whole) = (0.004, 0.4);
        let exact = |t: f64| {
            let u = t / whole;
            let by = 20.0 / whole;
            let (p, v) = (20.0 * u * u * (3.0 - 2.0 * u), by * 6.0 * u * (1.0 - u));
            let (a, j) = (by / whole * (6.0 - 12.0 * u), -12.0 * by / whole / whole);
            [p, v, a, j]
        };
        let positions = (0..=100).map(|k| exact(f64::from(k) * step)[0]).collect();
        let motion = samples(positions, step);
        assert!((motion.duration() - whole).abs() < 1e-12);
        assert_eq!(motion.at(1, 0.1), None);
        for k in 1..1000 {
            let t = whole * f64::from(k) / 1000.0;
            let ([p, v, a, j], (state, jerk)) = (exact(t), motion.at(0, t).unwrap());
            for (is, should, most) in [
                (state.p, p, 1e-11),
                (state.v, v, 1e-9),
                (state.a, a, 1e-6),
                (jerk, j, 1e-2),
            ] {
                assert!((is - should).abs() < most, "{t}: {is} {should}");
            }
        }
    }

    #[test]
    fn what_is_no_motion_is_refused() {
        let through = |positions, step| Sampled::<2>::through(positions, step).err();
        for (positions, step, why) in [
            ([None, None], 1.0, NoMotion::Count),
            ([Some(vec![1.0]), None], 1.0, NoMotion::Count),
            (
                [Some(vec![1.0, 2.0]), Some(vec![0.0; 3])],
                1.0,
                NoMotion::Count,
            ),
            ([Some(vec![1.0, f64::NAN]), None], 1.0, NoMotion::NotFinite),
            ([Some(vec![1.0, 2.0]), None], 0.0, NoMotion::NotFinite),
            ([Some(vec![1.0, 2.0]), None], f64::NAN, NoMotion::NotFinite),
        ] {
            assert_eq!(through(positions, step), Some(why));
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(1000) })]

        /// Through each sample, with velocity and acceleration the same on both of its sides, and at rest at both ends.
        #[test]
        fn it_goes_through_every_sample_smoothly(
            positions in proptest::collection::vec(-1e3..1e3_f64, 2..40),
            step in 1e-4..1e-1_f64,
        ) {
            let motion = samples(positions.clone(), step);
            let near = |is: f64, should: f64, scale: f64| (is - should).abs() <= 1e-5 * scale;
            for (k, position) in positions.iter().enumerate() {
                let t = k as f64 * step;
                let (state, _) = motion.at(0, t).unwrap();
                prop_assert!(near(state.p, *position, 1e-3), "{k}: {} {position}", state.p);
                if k == 0 || k + 1 == positions.len() {
                    prop_assert_eq!((state.v, state.a), (0.0, 0.0));
                    continue;
                }
                let [before, behind] = [-1e-9, 1e-9].map(|by| motion.at(0, t + by * step).unwrap().0);
                prop_assert!(near(before.v, behind.v, 1e3 / step), "{k}: {before:?} {behind:?}");
                prop_assert!(near(before.a, behind.a, 1e3 / (step * step)), "{k}: {before:?} {behind:?}");
            }
            for t in [-1.0, 0.0, motion.duration(), motion.duration() + 1.0] {
                let (state, jerk) = motion.at(0, t).unwrap();
                prop_assert_eq!((state.v, state.a, jerk), (0.0, 0.0, 0.0));
            }
        }
    }
}
