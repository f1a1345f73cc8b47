//! Samples of a motion against limits, over the space of motions, steps, resolutions and limits.

use proptest::prelude::*;
use syncline_controller::observe::sampled::{Judged, Judgement, SampledMotion, Samples};
use syncline_trajectory::limits::Limits;
use syncline_trajectory::profile::{Profile, State};
use syncline_trajectory::state_to_state::{self, Problem};

/// Instants in a sample's step at which the motion is looked at.
const FINE: usize = 16;

/// By this part of a limit more is no excess that can be told, as the page says.
const TELLS: f64 = 1e-3;

/// A move of ours from rest to rest.
fn plan(distance: f64, limits: [f64; 3]) -> Profile {
    let [velocity, acceleration, jerk] = limits;
    let limits = Limits::symmetric(velocity, acceleration, jerk);
    let problem = Problem::new(State::at_rest(0.0), State::at_rest(distance), limits);
    state_to_state::plan(&problem, 0.0).unwrap()
}

/// Its velocity, acceleration and jerk.
fn derivatives(profile: &Profile, t: f64) -> [f64; 3] {
    let mut begin = 0.0;
    for segment in profile.segments() {
        if t < begin + segment.duration {
            let State { v, a, .. } = profile.at(t);
            return [v, a, segment.jerk];
        }
        begin += segment.duration;
    }
    [0.0; 3]
}

/// Whether a derivative is above a threshold, in one direction, for all of some time, s.
fn lasts(profile: &Profile, step: f64, order: usize, threshold: f64, time: f64) -> bool {
    let fine = step / FINE as f64;
    let rows = (profile.duration() / fine) as usize + 1;
    [-1.0, 1.0].iter().any(|sign| {
        let mut run = 0.0;
        (0..rows).any(|row| {
            let value = sign * derivatives(profile, row as f64 * fine)[order];
            run = if value > threshold { run + fine } else { 0.0 };
            // One that is cut off by the grid may be shorter by a part of it at either end.
            run > time + 2.0 * fine
        })
    })
}

/// The greatest magnitude of a derivative in a window.
fn greatest(profile: &Profile, order: usize, [from, to]: [f64; 2]) -> f64 {
    let parts = 4000;
    let at = |part: usize| from + (to - from) * part as f64 / parts as f64;
    (0..=parts)
        .map(|part| derivatives(profile, at(part))[order].abs())
        .fold(0.0, f64::max)
}

fn samples(
    name: usize,
    profile: &Profile,
    step: f64,
    resolution: f64,
    limits: [f64; 3],
) -> Samples {
    let rows = (profile.duration() / step) as usize + 3;
    let rounded = |p: f64| (p / resolution).round() * resolution;
    Samples {
        name: name.to_string(),
        units: ["mm", "mm/s", "mm/s²", "mm/s³"],
        positions: (0..rows)
            .map(|row| rounded(profile.at((row as f64 * step).min(profile.duration())).p))
            .collect(),
        uncertainty: 0.5 * resolution,
        range: (-1e6, 1e6),
        limits,
    }
}

fn of(judged: &SampledMotion, axis: usize, order: usize) -> &Judged {
    let what = ["velocity", "acceleration", "jerk"][order];
    let axis = axis.to_string();
    let mut limits = judged.limits.iter();
    limits
        .find(|it| it.axis == axis && it.what == what)
        .unwrap()
}

prop_compose! {
    fn moves()(
        distance in 0.5..500.0_f64,
        velocity in 5.0..1000.0_f64,
        acceleration in 50.0..10_000.0_f64,
        jerk in 500.0..100_000.0_f64,
        margins in [0.6..1.6_f64, 0.6..1.6_f64, 0.6..1.6_f64],
    ) -> (f64, [f64; 3], [f64; 3]) {
        let limits = [velocity, acceleration, jerk];
        (distance, limits, [0, 1, 2].map(|order| margins[order] * limits[order]))
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// What is told is so: an excess is one, in its window; what is kept is kept by all that lasts as long as is told;
    /// an excess that is greater than the uncertainty and lasts longer than the window is found.
    #[test]
    fn what_is_told_of_samples_is_so(
        moves in prop::collection::vec(moves(), 1..4),
        step in 0.0005..0.01_f64,
        resolution in (-9.0..-2.0_f64).prop_map(|it| 10_f64.powf(it)),
    ) {
        let profiles: Vec<Profile> = moves.iter().map(|it| plan(it.0, it.1)).collect();
        let each = profiles.iter().zip(&moves).enumerate();
        let mut axes: Vec<Samples> = each
            .map(|(axis, (profile, it))| samples(axis, profile, step, resolution, it.2))
            .collect();
        let rows = axes.iter().map(|it| it.positions.len()).max().unwrap();
        for axis in &mut axes {
            let last = *axis.positions.last().unwrap();
            axis.positions.resize(rows, last);
        }
        let judged = SampledMotion::judge(&axes, step);
        let mut worst = Judgement::Kept;
        for (axis, (profile, it)) in profiles.iter().zip(&moves).enumerate() {
            for order in 0..3 {
                let limit = it.2[order];
                let told = of(&judged, axis, order);
                worst = worst.max(told.judgement);
                let window = (order + 2) as f64 * step;
                let off = 2_f64.powi(order as i32) * resolution / step.powi(order as i32 + 1);
                let excess = limit * (1.0 + TELLS) + 2.0 * off;
                if lasts(profile, step, order, excess, window) {
                    prop_assert_eq!(told.judgement, Judgement::Exceeded, "{}", told);
                }
                match told.judgement {
                    Judgement::Exceeded => {
                        let reached = greatest(profile, order, told.window_s);
                        prop_assert!(reached > limit, "{}: {}", told, reached);
                    }
                    Judgement::Undecidable => {
                        prop_assert!(told.value + told.uncertainty > limit, "{}", told);
                        prop_assert!(told.value - told.uncertainty <= limit * (1.0 + TELLS), "{}", told);
                    }
                    Judgement::Kept => prop_assert!(told.kept_from_s.is_some(), "{}", told),
                }
                if let Some(from) = told.kept_from_s {
                    prop_assert!(!lasts(profile, step, order, limit * (1.0 + TELLS), from), "{}", told);
                }
            }
        }
        let verdict = match worst {
            Judgement::Kept => "pass",
            Judgement::Undecidable => "undecidable",
            Judgement::Exceeded => "fail",
        };
        prop_assert_eq!(judged.verdict, verdict);
    }

}

proptest! {
    /// A plan of ours passes against the limits that it was planned with, where its samples are fine enough, and fails
    /// nowhere however coarse they are.
    #[test]
    fn our_own_plans_pass(it in moves(), step in 0.0005..0.01_f64, coarse in -7.0..-1.0_f64) {
        let profile = plan(it.0, it.1);
        let least = [0, 1, 2].map(|order| it.1[order] * step.powi(order as i32 + 1));
        let fine = 1e-4 * least.into_iter().fold(f64::INFINITY, f64::min);
        let judged = SampledMotion::judge(&[samples(0, &profile, step, fine, it.1)], step);
        prop_assert_eq!(judged.verdict, "pass", "{}", judged);
        let coarse = samples(0, &profile, step, 10_f64.powf(coarse), it.1);
        prop_assert_ne!(SampledMotion::judge(&[coarse], step).verdict, "fail");
    }

    /// Soft limits, to what a position is uncertain by.
    #[test]
    fn positions_are_held_against_soft_limits(
        it in moves(),
        beyond in -1.0..1.0_f64,
        resolution in 1e-6..0.5_f64,
    ) {
        let profile = plan(it.0, it.1);
        let mut axis = samples(0, &profile, 0.004, resolution, it.1);
        let reached = axis.positions.iter().copied().fold(0.0, f64::max);
        axis.range.1 = reached - beyond;
        let judged = SampledMotion::judge(&[axis], 0.004);
        let expected = match beyond {
            _ if beyond > 0.5 * resolution + 1e-6 => Judgement::Exceeded,
            _ if beyond + 0.5 * resolution > 1e-6 => Judgement::Undecidable,
            _ => Judgement::Kept,
        };
        prop_assert_eq!(judged.limits[0].judgement, expected, "{}", judged);
    }
}
