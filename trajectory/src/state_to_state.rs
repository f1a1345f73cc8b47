//! One axis: from any state to any state as fast as the limits allow, or in a stated time.
//!
//! Every threshold is a ratio and every operation keeps its dimension, so metres and micrometres,
//! seconds and milliseconds give the same plan.

use crate::double::Double;
use crate::extremal::{
    Change, Curve, NormalisedProblem, Passage, Phases, Problem, VELOCITY_ROUNDING, fastest_change,
};
use crate::limits::{Limits, PositionLimits};
use crate::profile::{Exact, Profile, Segment, State};

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
pub struct Axis {
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
    /// A state or a limit is not a finite number.
    #[error("a state or a limit is not a finite number")]
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

impl Axis {
    /// A move from `start` to `target` without position limits.
    pub const fn new(start: State, target: State, limits: Limits) -> Self {
        Axis {
            start,
            target: Target::State(target),
            limits,
            bounds: None,
        }
    }

    /// A change to the velocity `v` at acceleration 0.
    pub const fn to_velocity(start: State, v: f64, limits: Limits) -> Self {
        Axis {
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

    /// Refuses what cannot be planned whatever the way.
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

/// A target this far over a limit, relative, is on it.
const TARGET_SLACK: f64 = 1e-13;

/// The fastest plan of one axis that lasts at least `min_duration` (s).
pub fn plan(axis: &Axis, min_duration: f64) -> Result<Profile, PlanError> {
    axis.check()?;
    check_duration(min_duration)?;
    let route = Route::new(axis);
    let mut course = route.fastest()?;
    if route.duration(&course) < min_duration {
        course = route.no_shorter(min_duration)?;
    }
    Ok(route.profile(&course))
}

/// Plans again from `elapsed` s into a `running` plan to the target and inside the limits of `axis`,
/// which are those of the running plan; where `axis` starts does not count. The new plan, if it
/// arrives earlier than the running one; `None` if that one is to be kept.
///
/// With a velocity at the target the shortest duration jumps between states that differ by a
/// rounding, so that a new plan may last longer than what is left of the old one.
///
/// # Errors
/// As [`plan`].
pub fn plan_again(
    running: &Profile,
    elapsed: f64,
    axis: &Axis,
) -> Result<Option<Profile>, PlanError> {
    let start = running.at(elapsed);
    let again = plan(&Axis { start, ..*axis }, 0.0)?;
    let left = running.duration() - elapsed;
    Ok((again.duration() < left).then_some(again))
}

pub(crate) fn check_duration(min_duration: f64) -> Result<(), PlanError> {
    let sound = min_duration >= 0.0 && min_duration.is_finite();
    if sound {
        Ok(())
    } else {
        Err(PlanError::MinDuration)
    }
}

/// A problem of one axis, split into the way back into the limits and what is left to plan.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Route {
    start: State,
    limits: Limits,
    entry: Entry,
    problem: Problem,
    /// The target, where the displacement matters.
    target: Option<State>,
    /// The position limits, as displacements from the start.
    bounds: Option<PositionLimits>,
}

/// A way over the problem.
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

/// The segments that lead back into the limits.
#[derive(Clone, Copy, Debug)]
struct Entry {
    segments: [Segment; 6],
    duration: f64,
    displacement: f64,
}

impl Route {
    pub(crate) fn new(axis: &Axis) -> Self {
        let (entry, reached) = enter(axis.start, &axis.limits);
        let (vf, af) = axis.target_rates();
        let target = match axis.target {
            Target::State(state) => Some(state),
            Target::Velocity { .. } => None,
        };
        let problem = Problem {
            v0: reached.v,
            a0: reached.a,
            vf,
            af,
            distance: target.map_or(0.0, |t| (t.p - axis.start.p) - reached.p),
        };
        let bounds = axis.bounds.map(|b| PositionLimits {
            min: b.min - axis.start.p,
            max: b.max - axis.start.p,
        });
        Route {
            start: axis.start,
            limits: axis.limits,
            entry,
            problem,
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
            fastest(&self.problem, &self.limits)
        } else {
            fastest_change(
                self.problem.v0,
                self.problem.a0,
                self.problem.vf,
                self.problem.af,
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
    fn extremes(&self, time: f64) -> Course {
        let problem = &self.problem;
        let up = Curve::new(problem, &self.limits, false);
        let (first, _) = up.first();
        let down = Curve::new(problem, &self.limits, true);
        let (highest, lowest) = (up.at(time), down.at(time));
        let mut longer = None;
        if let (Some((high, most)), Some((low, least))) = (highest, lowest) {
            let rounding = slack(problem, most).max(slack(problem, least));
            if self.target.is_none() {
                return Course::Between {
                    up: high,
                    down: low,
                    mix: 0.0,
                };
            } else if problem.distance > most + rounding {
                longer = up.next_over(problem.distance, time);
            } else if problem.distance < least - rounding {
                longer = down.next_over(problem.distance, time);
            } else {
                return self.between(high, most, low, least);
            }
        }
        // Otherwise the duration is one that no change of velocity and acceleration has.
        let phases = longer.unwrap_or_else(|| match up.first_after_blocked() {
            None => first,
            Some((second, _)) if self.target.is_none() => second,
            Some((second, d)) => after_blocked(problem, &self.limits, second, d),
        });
        Course::Extremal(phases)
    }

    /// A course of this duration with a cruise, where there is one. Its displacement grows with the
    /// cruise's velocity, as the velocity does at every instant.
    fn cruise(&self, time: f64) -> Option<Course> {
        let Problem {
            v0,
            a0,
            vf,
            af,
            distance,
            ..
        } = self.problem;
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
        for _ in 0..60 {
            let (into, cruise, out) = change(v);
            let length = v * cruise;
            let d = into.displacement(v0, a0) + length + out.displacement(v, 0.0);
            let miss = distance - d;
            let rounding = 4.0 * f64::EPSILON * (distance.abs() + length.abs());
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
                let met = miss.abs() <= 1e-13 * (distance.abs() + length.abs());
                return (cruise >= 0.0 && met).then_some(Course::Cruise(into, cruise, out));
            }
            v = next;
        }
        None
    }

    /// Whether a course keeps the position limits.
    fn stays(&self, course: &Course) -> bool {
        self.bounds.is_none_or(|bounds| {
            let start = State {
                p: 0.0,
                ..self.start
            };
            let range = self
                .profile_along(course, start, self.distance(), 1.0, None)
                .extrema()
                .position;
            let slack = 1e-13 * (range.max - range.min);
            range.min >= bounds.min - slack && range.max <= bounds.max + slack
        })
    }

    fn distance(&self) -> f64 {
        self.problem.distance + self.entry.displacement
    }

    /// By way of the displacement `by`, velocity zero and acceleration `a`.
    fn via(&self, by: f64, a: f64, hold: f64) -> Course {
        let on_the_way = by - self.entry.displacement;
        let first = Problem {
            vf: 0.0,
            af: a,
            distance: on_the_way,
            ..self.problem
        };
        let distance = self.problem.distance - on_the_way;
        let second = Problem {
            v0: 0.0,
            a0: a,
            distance,
            ..self.problem
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
    fn touching(&self, bounds: &PositionLimits) -> Option<Course> {
        const STEPS: i32 = 64;
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
            for i in 0..=STEPS {
                let share = f64::from(i) / f64::from(STEPS);
                if take(share) {
                    at = Some(share);
                }
            }
            // Closer, by halving steps around the best.
            if let Some(mut share) = at {
                let mut step = 0.5 / f64::from(STEPS);
                for _ in 0..45 {
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

    /// A course that rests on the way: where the axis can stop soonest, or at a position limit.
    fn resting(&self, time: f64) -> Option<Course> {
        let Problem { v0, a0, .. } = self.problem;
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

    fn between(&self, up: Phases, most: f64, down: Phases, least: f64) -> Course {
        let half = 0.5 * (most - least);
        if half <= 0.0 {
            return Course::Extremal(up);
        }
        let bound = |mix: f64| mix.clamp(-1.0, 1.0);
        let mut mix =
            bound(0.5 * ((self.problem.distance - least) - (most - self.problem.distance)) / half);
        // The displacement is linear in the mix, but for rounding.
        for _ in 0..2 {
            let steps = Steps::between(&up, &down, mix, &self.limits);
            let miss = self.problem.distance - steps.displacement(self.problem.v0, self.problem.a0);
            mix = bound(mix + miss / half);
        }
        Course::Between { up, down, mix }
    }

    pub(crate) fn profile(&self, course: &Course) -> Profile {
        self.profile_along(course, self.start, self.distance(), 1.0, self.target)
    }

    /// The profile of an axis that moves `factor` times as far as this one does, from a start of
    /// its own over a `distance` of its own.
    pub(crate) fn profile_along(
        &self,
        course: &Course,
        start: State,
        distance: f64,
        factor: f64,
        target: Option<State>,
    ) -> Profile {
        let mut profile = Profile::towards(start, target);
        if self.entry.duration > 0.0 {
            for segment in self.entry.segments {
                profile.append(segment.duration, factor * segment.jerk);
            }
        }
        if let Course::Extremal(phases) = course
            && !self.is_long(phases)
        {
            for (duration, jerk) in phases.t.into_iter().zip(phases.jerks(&self.limits)) {
                profile.append(duration, factor * jerk);
            }
            return profile;
        }
        let steps = match course {
            Course::Extremal(phases) => Steps::extremal(phases, &self.limits),
            Course::Cruise(into, cruise, out) => Steps::cruise(into, *cruise, out),
            Course::Via {
                first,
                hold,
                second,
            } => Steps::via(first, *hold, second, &self.limits),
            Course::Between { up, down, mix } => Steps::between(up, down, *mix, &self.limits),
        };
        let slow = !matches!(course, Course::Extremal(_));
        let settles = !slow || self.drifts(&steps);
        // Ramps from far outside the limits are rounded more coarsely than a slow cruise after them is.
        let meets = (slow || self.entry.duration > 0.0) && self.target.is_some();
        let share = if meets { SETTLE_AND_MEET } else { SETTLE };
        let mut settled = None;
        for step in steps.iter() {
            let mut duration = step.duration;
            if step.cruise && settles {
                let part = duration * share;
                settle(&mut profile, part);
                duration -= 2.0 * part;
                settled = Some((profile.segments().len() - 2, part, duration));
            }
            profile.append(duration, factor * step.jerk);
        }
        // A cruise slower than the rates around it multiplies their rounding: set its velocity by
        // what it leaves of the distance.
        if let Some((first, part, cruise)) = settled.filter(|_| meets) {
            let miss = Double::from(distance) - displacement(&profile);
            let jerk = miss.value() / ((cruise + part) * part * part);
            profile.bend(first, jerk);
            profile.bend(first + 1, -jerk);
        }
        profile
    }

    /// Whether an extremal plan cruises so long that the rounding of the ramps before it shows.
    fn is_long(&self, phases: &Phases) -> bool {
        let speed = if phases.mirrored {
            -self.limits.v_min
        } else {
            self.limits.v_max
        };
        8.0 * f64::EPSILON * self.limits.a_max * phases.t[3] > 1e-13 * speed
    }

    /// Whether the rounding of the rates before a cruise shows in the position after it.
    fn drifts(&self, steps: &Steps) -> bool {
        let mut state = State {
            p: 0.0,
            v: self.problem.v0,
            a: self.problem.a0,
        };
        let mut length = self.entry.displacement.abs();
        let mut cruise = 0.0_f64;
        for step in steps.iter() {
            if step.cruise {
                cruise = step.duration;
                state.a = 0.0;
            }
            let next = state.after(step.duration, step.jerk);
            length += (next.p - state.p).abs();
            state = next;
        }
        let speed = self.start.v.abs().max(self.problem.vf.abs());
        let drift = cruise * (0.5 * cruise * self.limits.a_max + speed);
        4.0 * f64::EPSILON * drift > 1e-13 * length
    }
}

/// Phases with their jerks; `cruise` where the acceleration is to be zero.
#[derive(Clone, Copy, Default)]
struct Step {
    duration: f64,
    jerk: f64,
    cruise: bool,
}

struct Steps {
    steps: [Step; 15],
    len: usize,
}

impl Steps {
    fn iter(&self) -> impl Iterator<Item = &Step> {
        self.steps[..self.len].iter()
    }

    /// Returns `true`, to go on.
    fn push(&mut self, duration: f64, jerk: f64, cruise: bool) -> bool {
        if duration > 0.0 {
            self.steps[self.len] = Step {
                duration,
                jerk,
                cruise,
            };
            self.len += 1;
        }
        true
    }

    fn extremal(phases: &Phases, limits: &Limits) -> Self {
        let mut steps = Steps {
            steps: [Step::default(); 15],
            len: 0,
        };
        for (i, (duration, jerk)) in phases.t.into_iter().zip(phases.jerks(limits)).enumerate() {
            steps.push(duration, jerk, i == 3);
        }
        steps
    }

    fn via(first: &Phases, hold: f64, second: &Phases, limits: &Limits) -> Self {
        let mut steps = Self::extremal(first, limits);
        for step in &mut steps.steps {
            step.cruise = false;
        }
        steps.push(hold, 0.0, true);
        for (duration, jerk) in second.t.into_iter().zip(second.jerks(limits)) {
            steps.push(duration, jerk, false);
        }
        steps
    }

    fn cruise(into: &Change, cruise: f64, out: &Change) -> Self {
        let mut steps = Steps {
            steps: [Step::default(); 15],
            len: 0,
        };
        for (duration, jerk) in into.t.into_iter().zip(into.j) {
            steps.push(duration, jerk, false);
        }
        steps.push(cruise, 0.0, true);
        for (duration, jerk) in out.t.into_iter().zip(out.j) {
            steps.push(duration, jerk, false);
        }
        steps
    }

    fn between(up: &Phases, down: &Phases, mix: f64, limits: &Limits) -> Self {
        let mut steps = Steps {
            steps: [Step::default(); 15],
            len: 0,
        };
        let (up_jerks, down_jerks) = (up.jerks(limits), down.jerks(limits));
        let jerk = |i: usize, k: usize| {
            let (x, y) = (up_jerks[i], down_jerks[k]);
            0.5 * ((x + y) + mix * (x - y))
        };
        let sum = |t: &[f64]| t.iter().sum::<f64>();
        let before = sum(&up.t[..3]).max(sum(&down.t[..3]));
        let after = sum(&up.t[4..]).max(sum(&down.t[4..]));
        let cruise = up.duration() - before - after;
        let whole = up.t[3] > 0.0 && down.t[3] > 0.0 && cruise > 0.0;
        if !whole {
            merge(&up.t, &down.t, |i, k, duration| {
                steps.push(duration, jerk(i, k), false)
            });
            return steps;
        }
        // Durations beside a long cruise keep their digits: up to it from the start, after it from
        // the end.
        merge(&up.t, &down.t, |i, k, duration| {
            if i < 3 || k < 3 {
                steps.push(duration, jerk(i, k), false);
            }
            i < 3 || k < 3
        });
        steps.push(cruise, 0.0, true);
        let first = steps.len;
        let reverse = |t: &[f64; 7]| {
            let mut t = *t;
            t.reverse();
            t
        };
        merge(&reverse(&up.t), &reverse(&down.t), |i, k, duration| {
            if i < 3 || k < 3 {
                steps.push(duration, jerk(6 - i, 6 - k), false);
            }
            i < 3 || k < 3
        });
        steps.steps[first..steps.len].reverse();
        steps
    }

    fn displacement(&self, v0: f64, a0: f64) -> f64 {
        let mut state = State {
            p: 0.0,
            v: v0,
            a: a0,
        };
        for step in self.iter() {
            if step.cruise {
                state.a = 0.0;
            }
            state = state.after(step.duration, step.jerk);
        }
        state.p
    }
}

/// Hands on each stretch in which neither of two sequences changes: both indices and the duration,
/// until one of them ends or `take` returns `false`.
fn merge(a: &[f64; 7], b: &[f64; 7], mut take: impl FnMut(usize, usize, f64) -> bool) {
    let mut elapsed = 0.0;
    let (mut i, mut k) = (0, 0);
    let (mut rest_a, mut rest_b) = (a[0], b[0]);
    while i < 7 && k < 7 {
        let duration = rest_a.min(rest_b);
        if !take(i, k, duration) {
            break;
        }
        rest_a -= duration;
        rest_b -= duration;
        elapsed += duration;
        let together = 4.0 * f64::EPSILON * elapsed;
        if rest_a <= together {
            i += 1;
            rest_a = if i < 7 { a[i] } else { 0.0 };
        }
        if rest_b <= together {
            k += 1;
            rest_b = if k < 7 { b[k] } else { 0.0 };
        }
    }
}

/// The part of a cruise in which its acceleration is brought to zero: short, so that the velocity
/// stays; longer where the velocity too is to be adjusted.
const SETTLE: f64 = 1.0 / (1_u32 << 30) as f64;
const SETTLE_AND_MEET: f64 = 1.0 / (1_u32 << 20) as f64;

/// What the ramps leave of the acceleration by rounding, a long cruise would integrate to a wrong
/// velocity. Brings it to zero in two first small parts of the cruise.
fn settle(profile: &mut Profile, part: f64) {
    let mut left = Double::from(profile.start().a);
    for s in profile.segments() {
        left = left + Double::product(s.jerk, s.duration);
    }
    // From a to zero with no change of velocity.
    let jerk = -0.5 * left.value() / part;
    profile.append(part, 3.0 * jerk);
    profile.append(part, -jerk);
}

fn exact_velocity(start: State, segments: &[Segment]) -> f64 {
    let state = Exact::leaving(start);
    let end = segments
        .iter()
        .fold(state, |state, s| state.after(s.duration, s.jerk));
    end.v.value()
}

fn displacement(profile: &Profile) -> Double {
    let start = Exact::leaving(profile.start());
    profile
        .segments()
        .iter()
        .fold(start, |state, s| state.after(s.duration, s.jerk))
        .p
}

/// The fastest phases of a problem whose ends are inside the limits.
fn fastest(problem: &Problem, limits: &Limits) -> Phases {
    let change = fastest_change(problem.v0, problem.a0, problem.vf, problem.af, limits);
    let d = change.displacement(problem.v0, problem.a0);
    let miss = problem.distance - d;
    // Where the velocity turns around, rounding is that of the path travelled.
    let rounding = 16.0 * f64::EPSILON;
    let furthest = (limits.v_max - limits.v_min) * change.duration();
    if miss.abs() <= slack(problem, d)
        || miss.abs() <= rounding * furthest
            && miss.abs() <= rounding * change.path(problem.v0, problem.a0)
    {
        return change.phases();
    }
    let normalised = NormalisedProblem::new(problem, limits, miss < 0.0);
    match normalised.first_over(problem.distance) {
        Passage::Found(phases) => phases,
        Passage::BlockedInterval(second, d) => after_blocked(problem, limits, second, d),
    }
}

/// The fastest phases from the first ones after the blocked interval on, whose displacement is `d`.
fn after_blocked(problem: &Problem, limits: &Limits, first: Phases, d: f64) -> Phases {
    let miss = problem.distance - d;
    if miss.abs() <= slack(problem, d) {
        return first;
    }
    NormalisedProblem::new(problem, limits, miss < 0.0).after_blocked_over(problem.distance)
}

/// A miss of the distance, relative to it, that is taken for rounding where meeting it would need
/// another kind of plan: below what a plan is certified to.
const SNAP: f64 = 9e-13;

/// By how much a plan of displacement `d` may miss the distance and still be taken for it.
fn slack(problem: &Problem, d: f64) -> f64 {
    SNAP * d.abs().max(problem.distance.abs())
}

/// Brings a start outside the limits, or bound to leave them, back into them: the acceleration at
/// full jerk, then the velocity to its limit at acceleration 0, as fast as the limits allow. The
/// state that is reached, with the displacement for its position.
fn enter(start: State, limits: &Limits) -> (Entry, State) {
    let l = limits;
    let mut entry = Entry {
        segments: [Segment::default(); 6],
        duration: 0.0,
        displacement: 0.0,
    };
    let mut state = State { p: 0.0, ..start };
    let a_slack = VELOCITY_ROUNDING * (l.a_max - l.a_min);
    let mut ramp = |to: f64, jerk: f64| {
        let duration = (to - state.a) / jerk;
        entry.segments[0] = Segment { duration, jerk };
        state = State {
            a: to,
            ..state.after(duration, jerk)
        };
    };
    if start.a > l.a_max + a_slack {
        ramp(l.a_max, l.j_min);
    } else if start.a < l.a_min - a_slack {
        ramp(l.a_min, l.j_max);
    }
    // The velocity at which full jerk makes the acceleration zero.
    let stop = state.v - 0.5 * state.a * state.a / if state.a > 0.0 { l.j_min } else { l.j_max };
    let v_slack = VELOCITY_ROUNDING * (l.v_max - l.v_min);
    let limit = if stop > l.v_max + v_slack {
        Some(l.v_max)
    } else if stop < l.v_min - v_slack {
        Some(l.v_min)
    } else {
        None
    };
    if let Some(v) = limit {
        let change = fastest_change(state.v, state.a, v, 0.0, l);
        let segments = &mut entry.segments;
        for i in 0..3 {
            segments[1 + i] = Segment {
                duration: change.t[i],
                jerk: change.j[i],
            };
        }
        // From far outside, the rounding of the durations is more than the limit is to be met by:
        // what the hold, or both ramps, are a little short of, a very short hold in the last ramp makes
        // up for.
        let miss = v - exact_velocity(start, segments);
        let [up, hold, down] = change.t;
        let held = state.a + up * change.j[0];
        let short = 4.0 * (miss / held).abs() + 4.0 * f64::EPSILON * up.max(hold).max(down);
        if miss.abs() > 2e-15 * (l.v_max - l.v_min) && hold.max(up) > short {
            let last = down / 4.0;
            if hold > 0.0 {
                segments[2].duration = (hold - short).max(0.0);
            } else {
                segments[1].duration -= short;
                segments[3].duration += short * change.j[0] / change.j[2];
            }
            segments[3].duration -= last;
            segments[5] = Segment {
                duration: last,
                jerk: change.j[2],
            };
            let miss = v - exact_velocity(start, segments);
            segments[4].duration = (miss / (-last * change.j[2])).max(0.0);
        }
        for segment in &segments[1..] {
            state = state.after(segment.duration, segment.jerk);
        }
        state = State {
            p: state.p,
            v,
            a: 0.0,
        };
    }
    entry.duration = entry.segments.iter().map(|s| s.duration).sum();
    entry.displacement = state.p;
    (entry, state)
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
        let axis = Axis::new(start, State::at_rest(6.896_574_314_072_619), limits);
        let plan = plan(&axis, 0.0).unwrap();
        assert!(
            (plan.duration() - 66.89).abs() < 0.01,
            "{}",
            plan.duration()
        );
        assert!(verify::axis(&plan, &axis).holds(1e-12));
    }

    #[test]
    fn lowering_the_velocity_limit_in_motion_neither_dips_nor_turns_back() {
        for lowered in [0.1, 0.05] {
            let limits = Limits::symmetric(lowered, 2.0, 20.0);
            let axis = Axis::new(moving(0.0, 1.0, 2.0), State::at_rest(50.0), limits);
            let plan = plan(&axis, 0.0).unwrap();
            assert!(verify::axis(&plan, &axis).holds(1e-12));
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
        let axis = Axis::to_velocity(moving(3.0, 0.9, 0.4), 0.0, limits);
        let plan = plan(&axis, 0.0).unwrap();
        assert!(verify::axis(&plan, &axis).holds(1e-12));
        assert!(plan.duration() < 1.0);
    }
}
