//! Jogging: what an operator does with single axes while the path rests, and the return to it.
//!
//! Off the path every axis has a plan of its own, from state to state, that ends at rest inside
//! its travel. An order changes where an axis is to come to rest; the plan to there begins in the
//! state that the axis has in that cycle, whatever it is. Orders only note what is wanted; a cycle
//! plans every stop, but no more than two plans to a position, and one more where a line begins, so that its work is
//! bounded.
//!
//! # Why no plan leaves the travel
//!
//! No plan is searched for limits of the position, and yet none goes beyond them. Let S be where the fastest
//! stop from the present state ends. Of all plans that do not turn around that one reaches least far. The
//! fastest plan to a rest beyond S reaches that rest and no further; the fastest one to a rest before S turns
//! around earlier than S. On all of them S moves towards the target. So with the target and S inside the travel,
//! the whole plan is, and S stays inside for the next order.
//!
//! The exception is a speed that is lowered in motion: to slow down to it may take more distance than to
//! stop. Such a plan is measured by the exact extrema of its position, and where it goes beyond its end the axis
//! stops first and goes on from there.
//!
//! # Lines
//!
//! On a line there is one motion for all axes, inside what the line leaves of their limits and
//! travels; every axis follows it by its share, so that they stay on the line whatever becomes of the
//! speed. A line begins in motion only where the axes move along it already.

mod order;
mod stopping;
#[cfg(test)]
mod tests;
mod way_back;

pub use way_back::{Leg, Retraction};

pub use order::{Jog, JogError};

use super::Setpoint;
use crate::limits::{Limits, PositionLimits};
use crate::profile::{Extrema, Profile, State};
use crate::state_to_state::{self, Problem};

/// Where an axis may be, and how it may move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Travel {
    /// Of velocity (mm/s), acceleration (mm/s²) and jerk (mm/s³).
    pub limits: Limits,
    /// The soft limits, mm, finite.
    pub bounds: PositionLimits,
}

/// Where an axis is to come to rest.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Aim {
    /// Wherever it can soonest.
    Anywhere,
    /// At a position.
    At(f64),
    /// At the soft limit, where no order stops it before.
    Limit(f64),
}

/// When a plan is to be made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Due {
    No,
    Now,
    /// There was none that goes no further than it has to.
    AtRest,
}

#[derive(Clone, Copy, Debug)]
struct Clock {
    cycle: u64,
    period: f64,
}

/// What one axis does, or all of them along a line.
#[derive(Clone, Copy, Debug)]
struct Motion {
    plan: Profile,
    /// The cycle in which the plan began …
    began: u64,
    /// … and how much later than its start, s: when the motion before was in the state that the plan begins in.
    later: f64,
    aim: Aim,
    /// The highest towards the aim, mm/s.
    speed: f64,
    due: Due,
}

/// Where a motion is in a cycle.
#[derive(Clone, Copy, Debug)]
struct Sample {
    state: State,
    jerk: f64,
    /// How much later than the cycle's start it is in that state, s ([`Profile::sample`]).
    later: f64,
}

/// All axes from one place to another, in one motion along a straight line.
#[derive(Clone, Copy, Debug)]
struct Line<const N: usize> {
    from: [f64; N],
    to: [f64; N],
    /// Of length 1.
    direction: [f64; N],
    /// What that leaves of the axes' travels.
    travel: Travel,
    motion: Motion,
}

/// A line that has not begun.
#[derive(Clone, Copy, Debug)]
struct NextLine<const N: usize> {
    to: [Option<f64>; N],
    /// The highest along it, mm/s.
    speed: f64,
    due: Due,
}

impl<const N: usize> NextLine<N> {
    fn to(to: [Option<f64>; N], speed: f64) -> Option<Self> {
        let due = Due::Now;
        Some(Self { to, speed, due })
    }
}

/// The axes off the path.
#[derive(Clone, Copy, Debug)]
pub(super) struct Jogging<const N: usize> {
    clock: Clock,
    travel: [Option<Travel>; N],
    motions: [Motion; N],
    /// What the axes are on together.
    line: Option<Line<N>>,
    next_line: Option<NextLine<N>>,
    /// They go back to the path by a leg of that, once they rest.
    back_by: Option<Retraction>,
    /// Where the path was left.
    home: [f64; N],
}

/// A plan goes no further than it may if by rounding it goes further by less, mm.
const ROUNDING: f64 = 1e-9;

/// The jerk of a plan is inside its limits but for such a part of them.
const JERK: f64 = 1e-9;

/// Whether a plan stays between two positions, but for rounding: its own, and that of positions so far out. And whether it
/// keeps the jerk, which no start forces it over: nobody certifies what a jog plans.
fn stays(plan: &Profile, limits: &Limits, min: f64, max: f64) -> bool {
    let Extrema { position, jerk, .. } = plan.extrema();
    let rounding = |p: f64| ROUNDING + 2.0 * f64::EPSILON * p.abs();
    position.min >= min - rounding(position.min)
        && position.max <= max + rounding(position.max)
        && jerk.min >= limits.j_min * (1.0 + JERK)
        && jerk.max <= limits.j_max * (1.0 + JERK)
}

/// Plans to a position that a cycle has time for, of up to sixteen axes; what is more begins a cycle later.
const PLANS: usize = 2;

/// Rates across a line that are taken for rounding, by their limits.
const STRAIGHT: f64 = 1e-12;

/// The fastest stop.
fn stop(start: State, limits: Limits) -> Option<Profile> {
    state_to_state::plan(&Problem::to_velocity(start, 0.0, limits), 0.0).ok()
}

impl Travel {
    /// The plan to the aim, and whether it leads there; otherwise the fastest stop.
    fn plan(&self, start: State, aim: Aim, speed: f64) -> Option<(Profile, bool)> {
        let stop = stop(start, self.limits)?;
        let (Aim::At(position) | Aim::Limit(position)) = aim else {
            return Some((stop, true));
        };
        // Only what is braked goes against the direction of the aim.
        let (mut limits, mut bounds) = (self.limits, self.bounds);
        if position >= stop.end().p {
            limits.v_max = limits.v_max.min(speed);
            bounds.max = position.max(start.p);
        } else {
            limits.v_min = limits.v_min.max(-speed);
            bounds.min = position.min(start.p);
        }
        let problem = Problem::new(start, State::at_rest(position), limits);
        // From rest to rest nothing goes anywhere but between them; who stands waits for nothing else.
        let rests = start.v == 0.0 && start.a == 0.0;
        let direct = state_to_state::plan(&problem, 0.0)
            .ok()
            .filter(|plan| rests || stays(plan, &limits, bounds.min, bounds.max));
        Some(direct.map_or((stop, false), |plan| (plan, true)))
    }

    /// With that position, too.
    fn with(self, position: f64) -> Self {
        let PositionLimits { min, max } = self.bounds;
        let bounds = PositionLimits {
            min: min.min(position),
            max: max.max(position),
        };
        Self { bounds, ..self }
    }

    fn contains(&self, position: f64) -> bool {
        (self.bounds.min..=self.bounds.max).contains(&position)
    }
}

impl Motion {
    fn resting(position: f64) -> Self {
        Motion {
            plan: Profile::new(State::at_rest(position)),
            began: 0,
            later: 0.0,
            aim: Aim::Anywhere,
            speed: f64::INFINITY,
            due: Due::No,
        }
    }

    fn aim(&mut self, aim: Aim, speed: f64) {
        self.aim = aim;
        self.speed = speed;
        self.due = Due::Now;
    }

    /// Where it comes to rest.
    fn end(&self) -> f64 {
        self.plan.at(f64::INFINITY).p
    }

    fn since(&self, now: Clock) -> f64 {
        (now.cycle - self.began) as f64 * now.period - self.later
    }

    fn is_at_rest(&self, now: Clock) -> bool {
        self.since(now) >= self.plan.duration()
    }

    fn at(&self, now: Clock) -> Sample {
        if self.is_at_rest(now) {
            // Exactly, which a stop wherever it may be is only to rounding.
            return Sample {
                state: State::at_rest(self.end()),
                jerk: 0.0,
                later: 0.0,
            };
        }
        let t = self.since(now);
        let (state, later) = self.plan.sample(t);
        Sample {
            state,
            jerk: self.plan.jerk_at(t),
            later,
        }
    }

    /// Makes a plan if one is due, with this part of the velocity; whether there is a new one.
    fn go_on(&mut self, travel: &Travel, now: Clock, rapid: f64) -> bool {
        if self.due == Due::No || self.due == Due::AtRest && !self.is_at_rest(now) {
            return false;
        }
        let Sample { state, later, .. } = self.at(now);
        self.plan((state, later), travel, now, rapid)
    }

    /// A plan from a state that the motion is in so much later than the cycle's start.
    fn plan(&mut self, start: (State, f64), travel: &Travel, now: Clock, rapid: f64) -> bool {
        let Limits { v_max, v_min, .. } = travel.limits;
        let speed = self.speed.min(rapid * v_max.max(-v_min));
        let Some((plan, leads_there)) = travel.plan(start.0, self.aim, speed) else {
            self.due = Due::No;
            return false;
        };
        self.plan = plan;
        (self.began, self.later) = (now.cycle, start.1);
        self.due = if leads_there { Due::No } else { Due::AtRest };
        true
    }
}

impl<const N: usize> Jogging<N> {
    /// Has axes keep other travels and limits from now on, as those of a search differ from those of the move before it.
    /// What moves keeps the travel inside which its plan ends at rest; limits it takes that are no less than its own, as with
    /// those it comes to rest sooner.
    pub(super) fn allow(&mut self, travel: &[Option<Travel>; N]) {
        if self
            .line
            .is_some_and(|line| !line.motion.is_at_rest(self.clock))
        {
            return;
        }
        for (i, motion) in self.motions.iter().enumerate() {
            if motion.is_at_rest(self.clock) {
                let here = motion.at(self.clock).state.p;
                self.travel[i] = travel[i].map(|it| it.with(self.home[i]).with(here));
            } else if let (Some(own), Some(wider)) = (&mut self.travel[i], &travel[i])
                && wider.limits.intersection(&own.limits) == own.limits
            {
                own.limits = wider.limits;
            }
        }
    }

    /// At rest in `home`. An axis that is outside of its travel may be there and come back.
    pub(super) fn new(home: [f64; N], period: f64, travel: &[Option<Travel>; N]) -> Self {
        Jogging {
            clock: Clock { cycle: 0, period },
            travel: std::array::from_fn(|i| travel[i].map(|it| it.with(home[i]))),
            motions: home.map(Motion::resting),
            line: None,
            next_line: None,
            back_by: None,
            home,
        }
    }

    /// Takes an order, or refuses it and changes nothing; it is followed from the next cycle on.
    pub(super) fn order(&mut self, jog: Jog<N>, rapid: f64) -> Result<(), JogError> {
        let travel = |axis: usize| {
            let travel = self.travel.get(axis).copied().flatten();
            travel.ok_or(JogError::NoAxis(axis))
        };
        let check = |number: f64, speed: f64| {
            if !number.is_finite() || speed.is_nan() {
                Err(JogError::NotANumber)
            } else if speed.min(rapid) > 0.0 {
                Ok(())
            } else {
                Err(JogError::NoSpeed)
            }
        };
        match jog {
            Jog::Continuous { axis, velocity } => {
                let Travel { bounds, .. } = travel(axis)?;
                let limit = if velocity > 0.0 {
                    bounds.max
                } else {
                    bounds.min
                };
                check(limit, velocity.abs())?;
                self.leave_line();
                self.motions[axis].aim(Aim::Limit(limit), velocity.abs());
            }
            Jog::Step {
                axis,
                distance,
                speed,
            } => {
                let Travel { bounds, limits } = travel(axis)?;
                check(distance, speed)?;
                let from = match self.motions[axis].aim {
                    Aim::At(position) => position,
                    _ => {
                        let now = self.motions[axis].at(self.clock).state;
                        stop(now, limits).map_or(now.p, |stop| stop.end().p)
                    }
                };
                let to = (from + distance).clamp(bounds.min, bounds.max);
                self.leave_line();
                self.motions[axis].aim(Aim::At(to), speed);
            }
            Jog::To(to) | Jog::Line { to, .. } => {
                let along = match jog {
                    Jog::Line { speed, .. } => Some(speed),
                    _ => None,
                };
                for (axis, position) in to.iter().enumerate() {
                    let Some(position) = *position else { continue };
                    let travel = travel(axis)?;
                    check(position, along.unwrap_or(f64::INFINITY))?;
                    if !travel.contains(position) {
                        let PositionLimits { min, max } = travel.bounds;
                        let to = position;
                        return Err(JogError::OutsideTravel { axis, to, min, max });
                    }
                }
                if let Some(speed) = along {
                    self.back_by = None;
                    self.next_line = NextLine::to(to, speed);
                } else {
                    self.leave_line();
                    for (motion, position) in self.motions.iter_mut().zip(to) {
                        if let Some(position) = position {
                            motion.aim(Aim::At(position), f64::INFINITY);
                        }
                    }
                }
            }
        }
        Ok(())
    }

    /// Every axis goes on by its own.
    fn leave_line(&mut self) {
        (self.next_line, self.back_by) = (None, None);
        if let Some(Line { motion: along, .. }) = self.line.take()
            && along.due == Due::Now
        {
            for motion in &mut self.motions {
                motion.due = Due::Now;
                if along.aim == Aim::Anywhere {
                    motion.aim = Aim::Anywhere;
                }
            }
        }
    }

    /// Whether an axis goes on and on, until an order or its soft limit stops it.
    pub(super) fn is_continuous(&self, axis: usize) -> bool {
        let motion = self.motions.get(axis);
        motion.is_some_and(|motion| matches!(motion.aim, Aim::Limit(_)))
    }

    /// Where an axis rests that went there by itself; `None` while it moves, and of one that was stopped on its way.
    pub(super) fn reached(&self, axis: usize) -> Option<f64> {
        let motion = self.motions.get(axis).filter(|_| self.line.is_none())?;
        let rests = motion.due == Due::No && motion.is_at_rest(self.clock);
        match motion.aim {
            Aim::At(position) | Aim::Limit(position) if rests => Some(position),
            _ => None,
        }
    }

    /// Brings an axis that goes on and on to rest as fast as it can; any other does what it did.
    pub(super) fn end_continuous(&mut self, axis: usize) {
        if self.is_continuous(axis) {
            self.motions[axis].aim(Aim::Anywhere, f64::INFINITY);
        }
    }

    /// Comes to rest as fast as the axes can: on their line, or each on its own.
    pub(super) fn hold(&mut self) {
        (self.next_line, self.back_by) = (None, None);
        self.halt();
    }

    fn halt(&mut self) {
        let own = match &mut self.line {
            Some(line) => std::slice::from_mut(&mut line.motion),
            None => self.motions.as_mut_slice(),
        };
        for motion in own {
            motion.aim(Aim::Anywhere, f64::INFINITY);
        }
    }

    /// Another part of the axes' velocities is asked for: what moves goes on with that.
    pub(super) fn change_speed(&mut self) {
        let now = self.clock;
        let own = match &mut self.line {
            Some(line) => std::slice::from_mut(&mut line.motion),
            None => self.motions.as_mut_slice(),
        };
        for motion in own {
            if motion.aim != Aim::Anywhere && !motion.is_at_rest(now) {
                motion.due = Due::Now;
            }
        }
    }

    /// Back to where the path was left: on a straight line, or by the next leg of the way with that retraction.
    pub(super) fn go_home(&mut self, retraction: Option<Retraction>) {
        if retraction.is_none() {
            self.next_line = NextLine::to(self.home.map(Some), f64::INFINITY);
        } else {
            self.hold();
            self.back_by = retraction;
        }
    }

    /// By what the axes go back next, where they rest.
    pub(super) fn next_leg(&self, retraction: &Retraction) -> Option<Leg<N>> {
        let places = self.motions.each_ref().map(Motion::end);
        retraction.leg(&places, &self.home)
    }

    /// They rest where the path was left.
    pub(super) fn is_home(&self) -> bool {
        let mut motions = self.motions.iter().zip(&self.home);
        self.rests() && motions.all(|(motion, home)| motion.end() == *home)
    }

    /// No axis moves, and none is going to.
    pub(super) fn rests(&self) -> bool {
        let along = self.line.iter().map(|line| &line.motion);
        let due = along.chain(&self.motions).any(|it| it.due != Due::No);
        let begins = self.next_line.is_some() || self.back_by.is_some();
        !begins && !due && self.is_at_rest()
    }

    fn is_at_rest(&self) -> bool {
        self.motions.iter().all(|it| it.is_at_rest(self.clock))
    }

    /// Goes on by one cycle, with this part of the axes' velocities.
    pub(super) fn advance(&mut self, rapid: f64) {
        if self.is_at_rest()
            && let Some(retraction) = self.back_by.take()
        {
            let leg = self.next_leg(&retraction);
            self.next_line = leg.and_then(|leg| NextLine::to(leg.to, leg.speed));
        }
        if let Some(next) = self.next_line
            && (next.due == Due::Now || self.is_at_rest())
        {
            if let Some(line) = self.line_to(&next.to, next.speed, rapid) {
                self.motions = line.motions();
                self.line = Some(line);
                self.next_line = None;
            } else if next.due == Due::Now {
                self.halt();
                let due = Due::AtRest;
                self.next_line = Some(NextLine { due, ..next });
            }
        }
        if let Some(line) = &mut self.line {
            if line.motion.go_on(&line.travel, self.clock, rapid) {
                self.motions = line.motions();
            }
        } else {
            let mut plans = 0;
            for (motion, travel) in self.motions.iter_mut().zip(&self.travel) {
                let stops = motion.aim == Aim::Anywhere;
                match travel {
                    Some(_) if plans == PLANS && !stops => {}
                    Some(travel) => {
                        let planned = motion.go_on(travel, self.clock, rapid);
                        plans += usize::from(planned && !stops);
                    }
                    None => motion.due = Due::No,
                }
            }
        }
        self.clock.cycle += 1;
    }

    /// The straight line from where the axes are; none if they move otherwise.
    fn line_to(&self, to: &[Option<f64>; N], speed: f64, rapid: f64) -> Option<Line<N>> {
        let samples = self.motions.each_ref().map(|it| it.at(self.clock));
        let states = samples.map(|sample| sample.state);
        let from = states.map(|state| state.p);
        let to: [f64; N] = std::array::from_fn(|i| to[i].unwrap_or(from[i]));
        let displacement: [f64; N] = std::array::from_fn(|i| to[i] - from[i]);
        let dot = |a: &[f64; N], b: &[f64; N]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let length = dot(&displacement, &displacement).sqrt();
        // Of no length: at rest, any direction does.
        let direction = displacement.map(|d| if length > 0.0 { d / length } else { 0.0 });
        let start = State {
            p: 0.0,
            v: dot(&direction, &states.map(|state| state.v)),
            a: dot(&direction, &states.map(|state| state.a)),
        };
        // Every axis is in its state at an instant of its own, if only by its position's rounding.
        let later = dot(
            &direction.map(|d| d * d),
            &samples.map(|sample| sample.later),
        );
        let mut along: Option<Travel> = None;
        for (i, travel) in self.travel.iter().enumerate() {
            let Some(Travel { limits, bounds }) = *travel else {
                continue;
            };
            let d = direction[i];
            let across = (states[i].v - d * start.v).abs() > STRAIGHT * limits.v_max
                || (states[i].a - d * start.a).abs() > STRAIGHT * limits.a_max;
            if across {
                return None;
            }
            if d == 0.0 {
                continue;
            }
            let limits = limits.projected(d);
            // An axis that moves by a rounding keeps nobody from anything.
            let to = |bound: f64, rounding: f64| (bound - from[i] + rounding) / d;
            let (one, other) = (to(bounds.min, -ROUNDING), to(bounds.max, ROUNDING));
            let bounds = PositionLimits {
                min: one.min(other).min(0.0),
                max: one.max(other).max(0.0),
            };
            along = Some(along.map_or(Travel { limits, bounds }, |all| Travel {
                limits: all.limits.intersection(&limits),
                bounds: PositionLimits {
                    min: all.bounds.min.max(bounds.min),
                    max: all.bounds.max.min(bounds.max),
                },
            }));
        }
        // Where nothing moves any do.
        let travel = along.unwrap_or(Travel {
            limits: Limits::symmetric(1.0, 1.0, 1.0),
            bounds: PositionLimits { min: 0.0, max: 0.0 },
        });
        let mut motion = Motion::resting(0.0);
        motion.aim(Aim::At(length), speed);
        motion
            .plan((start, later), &travel, self.clock, rapid)
            .then_some(Line {
                from,
                to,
                direction,
                travel,
                motion,
            })
    }

    /// The setpoint of this cycle; of the path it takes where that rests.
    pub(super) fn setpoint(&self, path: Setpoint<N>) -> Setpoint<N> {
        let samples = self.motions.each_ref().map(|it| it.at(self.clock));
        let velocity = samples.map(|sample| sample.state.v);
        let norm = |part: &[f64]| part.iter().map(|v| v * v).sum::<f64>().sqrt();
        let (tool, others) = velocity.split_at(N.min(3));
        let speed = if norm(tool) > 0.0 {
            norm(tool)
        } else {
            norm(others)
        };
        Setpoint {
            position: samples.map(|sample| sample.state.p),
            velocity,
            acceleration: samples.map(|sample| sample.state.a),
            jerk: samples.map(|sample| sample.jerk),
            speed,
            feed: if speed > 0.0 { f64::INFINITY } else { 0.0 },
            busy: !self.rests(),
            off_path: true,
            ..path
        }
    }
}

impl<const N: usize> Line<N> {
    /// What every axis does by the motion along the line.
    fn motions(&self) -> [Motion; N] {
        std::array::from_fn(|i| {
            // What it does not move rests at once, whatever becomes of the others.
            if self.direction[i] == 0.0 {
                return Motion::resting(self.from[i]);
            }
            let (leads_there, aim) = match self.motion.aim {
                Aim::At(_) if self.motion.due == Due::No => (true, Aim::At(self.to[i])),
                _ => (false, Aim::Anywhere),
            };
            let target = leads_there.then_some(State::at_rest(self.to[i]));
            let plan = &self.motion.plan;
            Motion {
                plan: plan.scaled(self.from[i], self.direction[i], target),
                aim,
                due: Due::No,
                ..self.motion
            }
        })
    }
}
