//! Several axes at once: on a line, at the same instant, or each as fast as it can.
//!
//! *On a line* there is one problem: the limits of all axes projected on the line, solved once; every axis gets
//! the solution times its share, so that it stays on the line to rounding. States that do not lie along the line
//! are refused.
//!
//! *At the same instant* every axis is planned on its own first. The longest of the shortest durations is not yet
//! the answer, because durations that an axis can have may have gaps, the blocked intervals of `extremal`: an
//! axis that cannot last so long moves the duration on to the end of its gap, and all others are asked again.
//! Each axis has at most two gaps, so that ends.

use crate::limits::{Limits, PositionLimits};
use crate::profile::{Profile, State};
use crate::state_to_state::{Course, PlanError, Problem, Route, Target, check_duration};

/// The most axes that are planned together.
pub const MAX_AXES: usize = 16;

/// How several axes belong together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Synchronisation {
    /// The tool stays on the straight line from start to target.
    #[default]
    Line,
    /// All arrive at the same instant.
    Time,
    /// Each as fast as it can.
    None,
}

/// Solves the problems of all axes, at least `min_duration` (s) long. `profiles` receives one for each axis; the
/// result is the duration of the longest.
///
/// `problems` and `profiles` are equally long and at most [`MAX_AXES`].
pub fn plan(
    problems: &[Problem],
    synchronisation: Synchronisation,
    min_duration: f64,
    profiles: &mut [Profile],
) -> Result<f64, PlanError> {
    assert!(
        problems.len() == profiles.len() && problems.len() <= MAX_AXES,
        "one profile for each problem"
    );
    for problem in problems {
        problem.check()?;
    }
    check_duration(min_duration)?;
    match synchronisation {
        Synchronisation::Line => line(problems, min_duration, profiles),
        Synchronisation::Time => time(problems, min_duration, profiles),
        Synchronisation::None => {
            let mut longest = 0.0_f64;
            for (problem, profile) in problems.iter().zip(profiles) {
                *profile = crate::state_to_state::plan(problem, min_duration)?;
                longest = longest.max(profile.duration());
            }
            Ok(longest)
        }
    }
}

/// The shortest duration that every axis can have: the longest of the shortest ones, moved on over
/// the intervals of durations that some axis cannot have.
fn time(
    problems: &[Problem],
    min_duration: f64,
    profiles: &mut [Profile],
) -> Result<f64, PlanError> {
    const NONE: Option<(Route, Course, f64)> = None;
    let mut routes = [NONE; MAX_AXES];
    let mut duration = min_duration;
    for (slot, problem) in routes.iter_mut().zip(problems) {
        let route = Route::new(problem);
        let course = route.fastest()?;
        let shortest = route.duration(&course);
        duration = duration.max(shortest);
        *slot = Some((route, course, shortest));
    }
    // Each axis has at most two such intervals, so this ends.
    let mut settled = false;
    while !settled {
        settled = true;
        for (route, course, time) in routes.iter_mut().flatten() {
            if *time < duration * (1.0 - 4.0 * f64::EPSILON) {
                *course = route.no_shorter(duration)?;
                *time = route.duration(course);
                if *time > duration * (1.0 + 1e-14) {
                    duration = *time;
                    settled = false;
                } else {
                    *time = duration;
                }
            }
        }
    }
    for ((route, course, _), profile) in routes.iter().flatten().zip(profiles) {
        *profile = route.profile(course);
    }
    Ok(duration)
}

type Part = fn(&(State, State)) -> f64;

/// What tells a direction, in this order: the displacement, or else any rate that there is.
const PARTS: [Part; 5] = [|e| e.1.p, |e| e.0.v, |e| e.1.v, |e| e.0.a, |e| e.1.a];

/// Relative difference of direction that is taken for rounding.
const STRAIGHT: f64 = 1e-13;

fn line(
    problems: &[Problem],
    min_duration: f64,
    profiles: &mut [Profile],
) -> Result<f64, PlanError> {
    let mut direction = [0.0; MAX_AXES];
    let direction = &mut direction[..problems.len()];
    let mut ends = [(State::default(), State::default()); MAX_AXES];
    for (end, problem) in ends.iter_mut().zip(problems) {
        let target = match problem.target {
            Target::State(s) => s,
            Target::Velocity { v, a } => State {
                p: problem.start.p,
                v,
                a,
            },
        };
        *end = (
            State {
                p: 0.0,
                ..problem.start
            },
            State {
                p: target.p - problem.start.p,
                ..target
            },
        );
    }
    let ends = &ends[..problems.len()];
    let position = matches!(
        problems.first(),
        Some(Problem {
            target: Target::State(_),
            ..
        })
    );
    if problems
        .iter()
        .any(|a| matches!(a.target, Target::State(_)) != position)
    {
        return Err(PlanError::NotStraight);
    }
    let Some(lead) = direct(ends, direction) else {
        for (problem, profile) in problems.iter().zip(profiles) {
            *profile = Profile::new(problem.start);
            profile.append(min_duration, 0.0);
        }
        return Ok(min_duration);
    };
    for part in PARTS {
        let along = part(&ends[lead]);
        for (d, end) in direction.iter().zip(ends) {
            if (part(end) - d * along).abs() > STRAIGHT * along.abs() {
                return Err(PlanError::NotStraight);
            }
        }
    }
    let projected = project(problems, direction, lead);
    projected.check()?;
    let route = Route::new(&projected);
    let mut course = route.fastest()?;
    if route.duration(&course) < min_duration {
        course = route.no_shorter(min_duration)?;
    }
    for (((problem, profile), &d), end) in problems
        .iter()
        .zip(profiles)
        .zip(direction.iter())
        .zip(ends)
    {
        let target = match problem.target {
            Target::State(state) => Some(state),
            Target::Velocity { .. } => None,
        };
        *profile = route.profile_along(&course, problem.start, end.1.p, d, target);
    }
    Ok(route.duration(&course))
}

/// Takes the direction from the start and target of every axis, by the axis that goes furthest, which leads;
/// none where nothing moves.
fn direct(ends: &[(State, State)], direction: &mut [f64]) -> Option<usize> {
    for part in PARTS {
        let longest =
            (0..ends.len()).max_by(|&i, &k| part(&ends[i]).abs().total_cmp(&part(&ends[k]).abs()));
        if let Some(i) = longest.filter(|&i| part(&ends[i]) != 0.0) {
            for (d, end) in direction.iter_mut().zip(ends) {
                *d = part(end) / part(&ends[i]);
            }
            return Some(i);
        }
    }
    None
}

/// The problem of the leading axis, inside what the line leaves of all axes' limits.
fn project(problems: &[Problem], direction: &[f64], lead: usize) -> Problem {
    let mut limits: Option<Limits> = None;
    for (problem, &d) in problems.iter().zip(direction.iter()) {
        if d != 0.0 {
            let own = problem.limits.projected(d);
            limits = Some(limits.map_or(own, |l| l.intersection(&own)));
        }
    }
    // Position limits as seen by the leading axis.
    let mut bounds = PositionLimits {
        min: f64::NEG_INFINITY,
        max: f64::INFINITY,
    };
    for (problem, &d) in problems.iter().zip(direction.iter()) {
        if let (Some(b), true) = (problem.bounds, d != 0.0) {
            let (x, y) = ((b.min - problem.start.p) / d, (b.max - problem.start.p) / d);
            bounds.min = bounds.min.max(x.min(y));
            bounds.max = bounds.max.min(x.max(y));
        }
    }
    let at = problems[lead].start.p;
    let bounded = problems.iter().any(|a| a.bounds.is_some());
    Problem {
        start: problems[lead].start,
        target: problems[lead].target,
        limits: limits.unwrap_or(problems[lead].limits),
        bounds: bounded.then_some(PositionLimits {
            min: at + bounds.min,
            max: at + bounds.max,
        }),
    }
}
