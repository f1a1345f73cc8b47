//! A problem of one axis, split into what brings it inside the limits and what is left, and the courses that
//! solve it: the fastest one, and one of a stated duration.

use super::entry::{Entry, enter};
use super::steps::Steps;
use super::{PlanError, Problem, Target, before};
use crate::extremal::{
    BoundaryConditions, Change, Curve, NormalisedProblem, Passage, Phases, fastest_change,
};
use crate::limits::{Limits, PositionLimits};
use crate::profile::State;

/// A problem of one axis, split into the return into the limits and what is left to plan.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Route {
    pub(super) start: State,
    pub(super) limits: Limits,
    pub(super) entry: Entry,
    pub(super) conditions: BoundaryConditions,
    /// The target, where the displacement matters.
    pub(super) target: Option<State>,
    /// The position limits, as displacements from the start.
    pub(super) bounds: Option<PositionLimits>,
}

/// A solution of the problem.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Course {
    /// An extremal plan.
    Extremal(Phases),
    /// To a velocity, a cruise, and from it to the end.
    Cruise(Change, f64, Change),
    /// An extremal plan to a state without velocity, a hold there, and another to the end.
    Via {
        first: Phases,
        hold: f64,
        second: Phases,
    },
    /// The convex combination of two extremal plans of one duration, `(1 + mix)/2` of the first: as
    /// the limits are convex, it keeps them too.
    Between { up: Phases, down: Phases, mix: f64 },
}

impl Route {
    pub(crate) fn new(problem: &Problem) -> Self {
        let (entry, reached) = enter(problem.start, &problem.limits);
        let (vf, af) = problem.target_rates();
        let target = match problem.target {
            Target::State(state) => Some(state),
            Target::Velocity { .. } => None,
        };
        let conditions = BoundaryConditions {
            v0: reached.v,
            a0: reached.a,
            vf,
            af,
            distance: target.map_or(0.0, |t| (t.p - problem.start.p) - reached.p),
        };
        let bounds = problem.bounds.map(|b| PositionLimits {
            min: b.min - problem.start.p,
            max: b.max - problem.start.p,
        });
        Route {
            start: problem.start,
            limits: problem.limits,
            entry,
            conditions,
            target,
            bounds,
        }
    }

    pub(crate) fn duration(&self, course: &Course) -> f64 {
        self.entry.duration
            + match course {
                Course::Extremal(phases) => phases.duration(),
                Course::Cruise(into, cruise, out) => into.duration() + cruise + out.duration(),
                Course::Via {
                    first,
                    hold,
                    second,
                } => first.duration() + hold + second.duration(),
                Course::Between { up, .. } => up.duration(),
            }
    }

    /// The shortest course.
    pub(crate) fn fastest(&self) -> Result<Course, PlanError> {
        let free = Course::Extremal(if self.target.is_some() {
            fastest(&self.conditions, &self.limits)
        } else {
            fastest_change(
                self.conditions.v0,
                self.conditions.a0,
                self.conditions.vf,
                self.conditions.af,
                &self.limits,
            )
            .phases()
        });
        match self.bounds {
            Some(bounds) if !self.stays(&free) => {
                self.touching(&bounds).ok_or(PlanError::Unreachable)
            }
            _ => Ok(free),
        }
    }

    /// A course of this duration, or the shortest of those that last longer where there is none.
    /// `duration` is more than that of the fastest.
    pub(crate) fn no_shorter(&self, duration: f64) -> Result<Course, PlanError> {
        let time = duration - self.entry.duration;
        if let Some(course) = self.cruise(time)
            && self.stays(&course)
        {
            return Ok(course);
        }
        let course = self.extremes(time);
        if self.stays(&course) {
            return Ok(course);
        }
        self.resting(time).ok_or(PlanError::MinDuration)
    }

    /// A course between the two extremal ones of this duration, or the shortest of those that last
    /// longer.
    pub(super) fn extremes(&self, time: f64) -> Course {
        let conditions = &self.conditions;
        let up = Curve::new(conditions, &self.limits, false);
        let (first, _) = up.first();
        let down = Curve::new(conditions, &self.limits, true);
        let (highest, lowest) = (up.at(time), down.at(time));
        let mut longer = None;
        if let (Some((high, most)), Some((low, least))) = (highest, lowest) {
            let rounding = slack(conditions, most).max(slack(conditions, least));
            if self.target.is_none() {
                return Course::Between {
                    up: high,
                    down: low,
                    mix: 0.0,
                };
            } else if conditions.distance > most + rounding {
                longer = up.next_over(conditions.distance, time);
            } else if conditions.distance < least - rounding {
                longer = down.next_over(conditions.distance, time);
            } else {
                return self.between(high, most, low, least);
            }
        }
        // Otherwise the duration is one that no change of velocity and acceleration has.
        let phases = longer.unwrap_or_else(|| match up.first_after_blocked() {
            None => first,
            Some((second, _)) if self.target.is_none() => second,
            Some((second, d)) => after_blocked(conditions, &self.limits, second, d),
        });
        Course::Extremal(phases)
    }

    /// A course of this duration with a cruise, where there is one. Its displacement grows with the
    /// cruise's velocity, as the velocity does at every instant.
    pub(super) fn cruise(&self, time: f64) -> Option<Course> {
        let BoundaryConditions {
            v0,
            a0,
            vf,
            af,
            distance,
            ..
        } = self.conditions;
        let l = &self.limits;
        let change = |v: f64| {
            let into = fastest_change(v0, a0, v, 0.0, l);
            let out = fastest_change(v, 0.0, vf, af, l);
            (into, time - into.duration() - out.duration(), out)
        };
        if self.target.is_none() {
            // At the velocity from which a single ramp leads to the end.
            let (into, cruise, out) = change(before(vf, af, l));
            return (cruise >= 0.0).then_some(Course::Cruise(into, cruise, out));
        }
        let (mut low, mut high) = (l.v_min, l.v_max);
        let mut v = (distance / time).clamp(low, high);
        for _ in 0..CRUISE_ROUNDS {
            let (into, cruise, out) = change(v);
            let length = v * cruise;
            let d = into.displacement(v0, a0) + length + out.displacement(v, 0.0);
            let miss = distance - d;
            let rounding = SUM_ROUNDING * (distance.abs() + length.abs());
            let slope = time
                - (into.t[0] + into.t[1] + 0.5 * into.t[2])
                - (0.5 * out.t[0] + out.t[1] + out.t[2]);
            if miss > 0.0 {
                low = v;
            } else {
                high = v;
            }
            let mut next = v + miss / slope;
            if !(next > low && next < high) {
                next = 0.5 * (low + high);
            }
            if miss.abs() <= rounding || next == v || !(next > low && next < high) {
                let met = miss.abs() <= MET * (distance.abs() + length.abs());
                return (cruise >= 0.0 && met).then_some(Course::Cruise(into, cruise, out));
            }
            v = next;
        }
        None
    }

    /// Whether a course keeps the position limits.
    pub(super) fn stays(&self, course: &Course) -> bool {
        self.bounds.is_none_or(|bounds| {
            let start = State {
                p: 0.0,
                ..self.start
            };
            let range = self
                .profile_along(course, start, self.distance(), 1.0, None)
                .extrema()
                .position;
            let slack = MET * (range.max - range.min);
            range.min >= bounds.min - slack && range.max <= bounds.max + slack
        })
    }

    pub(super) fn distance(&self) -> f64 {
        self.conditions.distance + self.entry.displacement
    }

    /// Through the displacement `by`, at velocity zero and acceleration `a`.
    pub(super) fn via(&self, by: f64, a: f64, hold: f64) -> Course {
        let to_there = by - self.entry.displacement;
        let first = BoundaryConditions {
            vf: 0.0,
            af: a,
            distance: to_there,
            ..self.conditions
        };
        let distance = self.conditions.distance - to_there;
        let second = BoundaryConditions {
            v0: 0.0,
            a0: a,
            distance,
            ..self.conditions
        };
        let second = if self.target.is_some() {
            fastest(&second, &self.limits)
        } else {
            fastest_change(second.v0, second.a0, second.vf, second.af, &self.limits).phases()
        };
        Course::Via {
            first: fastest(&first, &self.limits),
            hold,
            second,
        }
    }

    /// The shortest course that touches a position limit: there the velocity is zero, and what is
    /// free is the acceleration, which points inwards.
    pub(super) fn touching(&self, bounds: &PositionLimits) -> Option<Course> {
        let l = &self.limits;
        let mut best: Option<(Course, f64)> = None;
        for (by, deepest) in [
            (
                bounds.max,
                -(-l.a_min)
                    .min((-2.0 * l.j_min * l.v_max).sqrt())
                    .min((-2.0 * l.j_max * l.v_min).sqrt()),
            ),
            (
                bounds.min,
                l.a_max
                    .min((-2.0 * l.j_max * l.v_min).sqrt())
                    .min((-2.0 * l.j_min * l.v_max).sqrt()),
            ),
        ] {
            if !by.is_finite() {
                continue;
            }
            let mut take = |share: f64| {
                let course = self.via(by, deepest * share, 0.0);
                let duration = self.duration(&course);
                let better = best.is_none_or(|(_, d)| duration < d) && self.stays(&course);
                if better {
                    best = Some((course, duration));
                }
                better
            };
            let mut at = None;
            for i in 0..=TOUCHES {
                let share = f64::from(i) / f64::from(TOUCHES);
                if take(share) {
                    at = Some(share);
                }
            }
            // Closer, by halving steps around the best.
            if let Some(mut share) = at {
                let mut step = 0.5 / f64::from(TOUCHES);
                for _ in 0..TOUCH_HALVINGS {
                    for next in [share - step, share + step] {
                        if (0.0..=1.0).contains(&next) && take(next) {
                            share = next;
                            break;
                        }
                    }
                    step *= 0.5;
                }
            }
        }
        best.map(|(course, _)| course)
    }

    /// A course that rests in between: where the axis can stop soonest, or at a position limit.
    pub(super) fn resting(&self, time: f64) -> Option<Course> {
        let BoundaryConditions { v0, a0, .. } = self.conditions;
        let stop = self.entry.displacement
            + fastest_change(v0, a0, 0.0, 0.0, &self.limits).displacement(v0, a0);
        let bounds = self.bounds?;
        let mut best: Option<(Course, f64)> = None;
        for by in [stop, bounds.max, bounds.min] {
            if by.is_finite()
                && let Course::Via { first, second, .. } = self.via(by, 0.0, 0.0)
            {
                let moving = first.duration() + second.duration();
                let course = Course::Via {
                    first,
                    hold: (time - moving).max(0.0),
                    second,
                };
                let whole = moving.max(time);
                if best.is_none_or(|(_, d)| whole < d) && self.stays(&course) {
                    best = Some((course, whole));
                }
            }
        }
        best.map(|(course, _)| course)
    }

    pub(super) fn between(&self, up: Phases, most: f64, down: Phases, least: f64) -> Course {
        let half = 0.5 * (most - least);
        if half <= 0.0 {
            return Course::Extremal(up);
        }
        let bound = |mix: f64| mix.clamp(-1.0, 1.0);
        let mut mix = bound(
            0.5 * ((self.conditions.distance - least) - (most - self.conditions.distance)) / half,
        );
        // The displacement is linear in the mix, but for rounding.
        for _ in 0..MIX_ROUNDS {
            let steps = Steps::between(&up, &down, mix, &self.limits);
            let miss = self.conditions.distance
                - steps.displacement(self.conditions.v0, self.conditions.a0);
            mix = bound(mix + miss / half);
        }
        Course::Between { up, down, mix }
    }
}

/// The fastest phases of a problem whose ends are inside the limits.
pub(super) fn fastest(conditions: &BoundaryConditions, limits: &Limits) -> Phases {
    let change = fastest_change(
        conditions.v0,
        conditions.a0,
        conditions.vf,
        conditions.af,
        limits,
    );
    let d = change.displacement(conditions.v0, conditions.a0);
    let miss = conditions.distance - d;
    // Where the velocity turns around, rounding is that of the path travelled.
    let rounding = PATH_ROUNDING;
    let furthest = (limits.v_max - limits.v_min) * change.duration();
    if miss.abs() <= slack(conditions, d)
        || miss.abs() <= rounding * furthest
            && miss.abs() <= rounding * change.path(conditions.v0, conditions.a0)
    {
        return change.phases();
    }
    let normalised = NormalisedProblem::new(conditions, limits, miss < 0.0);
    match normalised.first_over(conditions.distance) {
        Passage::Found(phases) => phases,
        Passage::BlockedInterval(second, d) => after_blocked(conditions, limits, second, d),
    }
}

/// The fastest phases from the first ones after the blocked interval on, whose displacement is `d`.
pub(super) fn after_blocked(
    conditions: &BoundaryConditions,
    limits: &Limits,
    first: Phases,
    d: f64,
) -> Phases {
    let miss = conditions.distance - d;
    if miss.abs() <= slack(conditions, d) {
        return first;
    }
    NormalisedProblem::new(conditions, limits, miss < 0.0).after_blocked_over(conditions.distance)
}

/// A miss of the distance, relative to it, that is taken for rounding where meeting it would need
/// another kind of plan: below what a plan is certified to.
const SNAP: f64 = 9e-13;

/// Rounds of Newton's method or bisection that bring a cruise's velocity to rounding from anywhere between
/// the limits.
const CRUISE_ROUNDS: usize = 60;
/// Rounding of a sum of the three parts around a cruise.
const SUM_ROUNDING: f64 = 4.0 * f64::EPSILON;
/// A miss that a cruise may have, relative: below what a plan is certified to.
const MET: f64 = 1e-13;
/// Accelerations at the touch of a position limit that are tried first …
const TOUCHES: i32 = 64;
/// … and halvings around the best of them, to rounding.
const TOUCH_HALVINGS: usize = 45;
/// The displacement is linear in the mix of two plans: one round meets it, the second one what that rounded.
const MIX_ROUNDS: usize = 2;
/// Rounding of a displacement, relative to the path travelled.
const PATH_ROUNDING: f64 = 16.0 * f64::EPSILON;

/// By how much a plan of displacement `d` may miss the distance and still be taken for it.
pub(super) fn slack(conditions: &BoundaryConditions, d: f64) -> f64 {
    SNAP * d.abs().max(conditions.distance.abs())
}
