//! One axis: from any state to any state as fast as the limits allow, or in a stated time.
//!
//! # What is solved
//!
//! A start and a target, each with position, velocity and acceleration, and limits of velocity,
//! acceleration and jerk that may differ by direction: the shortest sequence of constant-jerk segments
//! from one to the other; optionally inside limits of the position, or in no less than a stated time.
//!
//! # How
//!
//! 1. A start outside the limits, or bound to leave them, is brought back into them (`entry`).
//! 2. From there the shortest plan is a point on the curve of extremal plans, found in closed form but for
//!    Newton's method in one variable (`extremal`).
//! 3. What else may be wanted stands around it (`route`): a stated duration is a cruise at the velocity that makes
//!    the plan last so long or, where there is none, the convex combination of both extremal plans of that
//!    duration; a limit of the position is touched, or rested at.
//! 4. The course becomes segments (`steps`, `profile`), and rounding is set right where a cruise would show it.
//!
//! # Why it is right
//!
//! For a given duration all plans that keep the limits form a convex set, so the displacements that can be had
//! are an interval whose ends are the extremal plans; the shortest plan is the first duration whose interval holds
//! the displacement. No set of candidate profiles is tried out, so none can be forgotten. The certificate
//! ([`verify`](crate::verify)), which shares nothing with this module but double-double numbers, checks plans of
//! every class in the tests and campaigns.
//!
//! Every threshold is a ratio and every operation keeps its dimension, so metres and micrometres,
//! seconds and milliseconds give the same plan.
//!
//! # What is given up
//!
//! With limits of the position, plans that touch one of them once are searched for, not those that touch two.
//! A plan that is made again on the way to a target with a velocity may last longer than what is left of the
//! running one, because the shortest duration jumps between states that differ by a rounding: who plans again
//! keeps the running plan unless the new one arrives earlier.

mod entry;
mod profile;
#[cfg(test)]
mod properties;
mod route;
mod steps;

use crate::limits::{Limits, PositionLimits};
use crate::profile::{Profile, State};
pub(crate) use route::{Course, Route};

/// Where an axis is to arrive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// In this state.
    State(State),
    /// At this velocity and acceleration, wherever: a jog, a stop.
    Velocity {
        /// Velocity (length/s).
        v: f64,
        /// Acceleration (length/s²).
        a: f64,
    },
}

/// What one axis is to do and what it must keep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Problem {
    /// Where it is. A start outside the limits is brought back into them first.
    pub start: State,
    /// Where it goes.
    pub target: Target,
    /// What it keeps on the way.
    pub limits: Limits,
    /// Where it must stay.
    pub bounds: Option<PositionLimits>,
}

/// Why there is no plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PlanError {
    /// A state or a limit is not a finite number, or what leads from one to the other is none.
    #[error("a state, a limit or the plan that follows from them is not a finite number")]
    NotANumber,
    /// A limit leaves no room: each must be on its own side of zero.
    #[error("a limit of velocity, acceleration or jerk is zero or has the wrong sign")]
    ZeroLimit,
    /// The target is outside the velocity or acceleration limits, or can only be reached from outside.
    #[error(
        "the target state breaks a velocity or acceleration limit, or can only be reached by breaking it"
    )]
    TargetBreaksLimit,
    /// The target position is outside the position limits.
    #[error("the target is outside the position limits")]
    TargetOutsidePosition,
    /// The start position is outside the position limits.
    #[error("the start is outside the position limits")]
    StartOutsidePosition,
    /// The axes cannot stay on the straight line between start and target.
    #[error("start and target states do not lie along one straight line")]
    NotStraight,
    /// The minimum duration is not a duration that a plan can have.
    #[error("the minimum duration is negative, not a number, or cannot be kept")]
    MinDuration,
    /// No plan within the position limits leads from the start to the target.
    #[error("the target cannot be reached within the position limits")]
    Unreachable,
}

impl Problem {
    /// A move from `start` to `target` without position limits.
    pub const fn new(start: State, target: State, limits: Limits) -> Self {
        Problem {
            start,
            target: Target::State(target),
            limits,
            bounds: None,
        }
    }

    /// A change to the velocity `v` at acceleration 0.
    pub const fn to_velocity(start: State, v: f64, limits: Limits) -> Self {
        Problem {
            start,
            target: Target::Velocity { v, a: 0.0 },
            limits,
            bounds: None,
        }
    }

    fn target_rates(&self) -> (f64, f64) {
        match self.target {
            Target::State(s) => (s.v, s.a),
            Target::Velocity { v, a } => (v, a),
        }
    }

    fn target_position(&self) -> Option<f64> {
        match self.target {
            Target::State(s) => Some(s.p),
            Target::Velocity { .. } => None,
        }
    }

    /// Refuses what has no plan of any kind.
    pub(crate) fn check(&self) -> Result<(), PlanError> {
        let l = &self.limits;
        let (vf, af) = self.target_rates();
        let numbers = [l.v_max, l.v_min, l.a_max, l.a_min, l.j_max, l.j_min, vf, af];
        let finite = numbers.iter().all(|x| x.is_finite())
            && self.start.is_finite()
            && self.target_position().is_none_or(f64::is_finite)
            && self
                .bounds
                .is_none_or(|b| !b.min.is_nan() && !b.max.is_nan());
        if !finite {
            return Err(PlanError::NotANumber);
        }
        let room = l.v_max > 0.0 && l.a_max > 0.0 && l.j_max > 0.0;
        if !(room && l.v_min < 0.0 && l.a_min < 0.0 && l.j_min < 0.0) {
            return Err(PlanError::ZeroLimit);
        }
        let before = before(vf, af, l);
        let v_slack = TARGET_SLACK * (l.v_max - l.v_min);
        let a_slack = TARGET_SLACK * (l.a_max - l.a_min);
        let v_fits = |v: f64| v <= l.v_max + v_slack && v >= l.v_min - v_slack;
        if !(v_fits(vf) && v_fits(before) && af <= l.a_max + a_slack && af >= l.a_min - a_slack) {
            return Err(PlanError::TargetBreaksLimit);
        }
        if let Some(bounds) = self.bounds {
            let within = |p: f64| p >= bounds.min && p <= bounds.max;
            if self.target_position().is_some_and(|p| !within(p)) {
                return Err(PlanError::TargetOutsidePosition);
            }
            if !within(self.start.p) {
                return Err(PlanError::StartOutsidePosition);
            }
        }
        Ok(())
    }
}

/// The velocity from which a single ramp from acceleration zero leads to `v` and `a`.
fn before(v: f64, a: f64, limits: &Limits) -> f64 {
    v - 0.5 * a * a / if a > 0.0 { limits.j_max } else { limits.j_min }
}

/// A target this far over a limit, relative, is on it, so that no rounding of the caller's refuses it.
const TARGET_SLACK: f64 = 1e-13;

/// The fastest plan of one axis that lasts at least `min_duration` (s).
///
/// Both to rounding: with limits like a machine's a stated duration, and the end, are met to some 1e-14; where limits lie
/// decades apart, or next to nothing is travelled, a duration by some 1e-10 of itself, and the end of a plan of a stated
/// duration not always to 1e-12. [`verify`](crate::verify) tells how well a plan does.
pub fn plan(problem: &Problem, min_duration: f64) -> Result<Profile, PlanError> {
    problem.check()?;
    check_duration(min_duration)?;
    let route = Route::new(problem);
    let mut course = route.fastest()?;
    if route.duration(&course) < min_duration {
        course = route.no_shorter(min_duration)?;
    }
    // Limits hundreds of decades apart leave durations that no number can tell.
    if !route.duration(&course).is_finite() {
        return Err(PlanError::NotANumber);
    }
    Ok(route.profile(&course))
}

pub(crate) fn check_duration(min_duration: f64) -> Result<(), PlanError> {
    let sound = min_duration >= 0.0 && min_duration.is_finite();
    if sound {
        Ok(())
    } else {
        Err(PlanError::MinDuration)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verify;

    fn moving(p: f64, v: f64, a: f64) -> State {
        State { p, v, a }
    }

    #[test]
    fn the_known_trap_at_the_velocity_limit_takes_67_seconds() {
        let limits = Limits::symmetric(
            0.103_282_156_590_749_05,
            11.396_041_595_944_988,
            8.609_394_122_614_317,
        );
        let start = moving(0.0, 0.085_420_196_882_301_74, 0.554_582_096_595_770_2);
        let problem = Problem::new(start, State::at_rest(6.896_574_314_072_619), limits);
        let plan = plan(&problem, 0.0).unwrap();
        assert!(
            (plan.duration() - 66.89).abs() < 0.01,
            "{}",
            plan.duration()
        );
        assert!(verify::axis(&plan, &problem).holds(1e-12));
    }

    #[test]
    fn lowering_the_velocity_limit_in_motion_neither_dips_nor_turns_back() {
        for lowered in [0.1, 0.05] {
            let limits = Limits::symmetric(lowered, 2.0, 20.0);
            let problem = Problem::new(moving(0.0, 1.0, 2.0), State::at_rest(50.0), limits);
            let plan = plan(&problem, 0.0).unwrap();
            assert!(verify::axis(&plan, &problem).holds(1e-12));
            let braking = plan.segments().last().unwrap().duration + 2.0;
            let lowest = (0..1000)
                .map(|i| plan.at(i as f64 / 1000.0 * (plan.duration() - braking)).v)
                .fold(f64::INFINITY, f64::min);
            assert!(lowest >= lowered * (1.0 - 1e-12), "{lowest} < {lowered}");
        }
    }

    #[test]
    fn a_stop_needs_no_position() {
        let limits = Limits::symmetric(1.0, 2.0, 10.0);
        let problem = Problem::to_velocity(moving(3.0, 0.9, 0.4), 0.0, limits);
        let plan = plan(&problem, 0.0).unwrap();
        assert!(verify::axis(&plan, &problem).holds(1e-12));
        assert!(plan.duration() < 1.0);
    }
}
