//! Executes the plan on the path's own clock, one setpoint a cycle.
//!
//! The plan is a queue of steps: sections, segments of constant jerk along them, dwells, marks,
//! waypoints and holds. Those up to the last commit may run, and end at rest; what came since waits for the next
//! commit, as the tail of the plan goes on ([`Command::ReplaceTail`]), or as a whole new plan that takes
//! over in a cycle of its own ([`Command::ReplacePlan`]). So there is a stop at
//! every instant, whatever becomes of the planner.
//!
//! A setpoint is a function of the cycle's number: it is evaluated from the beginning of its step on
//! a clock that counts cycles, never summed up from setpoint to setpoint.
//!
//! A dwell and a mark are never cut: a new plan that takes over while one is under way begins behind
//! the dwell, and at a mark only once that is [passed](Executor::pass), or left by a retrace. What is replaced before
//! them brings them again, and so does a retrace, also where nothing leads back. Waypoints are counted from the beginning of everything, so that each counts
//! once, however often the path goes over it. Nothing that an operator does can lose one.
//!
//! What it is doing is one activity: following the path, retracing it, stopping, holding, jogging or
//! ended; what it knows of its plan is another enum.
//!
//! - `activity`: what it is doing, and what follows from that,
//! - `operator`: what an operator does,
//! - `settled`: how the path waits for setpoints that come later,
//! - `stop`: the shortest stop,
//! - `replan`: what it knows of its plan, from which state on it asks for another, and how that takes over.

mod activity;
mod operator;
mod replan;
mod settled;
mod stop;

use std::collections::VecDeque;
use std::iter::repeat_n;

use super::brake::Search;
use super::jog::Retraction;
use super::planner::MOST_AT_ONCE;
use super::{Command, Curve, JerkSegment, Limits, Overrides, PathSegment};
use activity::{Activity, Next, StopSearch};
use replan::PlanStatus;
pub use settled::PathTime;
use settled::Settled;

/// Where every axis has to be, and what the path does there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setpoint<const N: usize> {
    /// mm
    pub position: [f64; N],
    /// mm/s
    pub velocity: [f64; N],
    /// mm/s²
    pub acceleration: [f64; N],
    /// mm/s³
    pub jerk: [f64; N],
    /// The mark of the move or dwell at work; of the last one when idle.
    pub tag: u32,
    /// Where on the path, mm from its beginning; less where it is stepped back.
    pub distance: f64,
    /// Path speed, mm/s.
    pub speed: f64,
    /// Path speed that is asked for, after overrides, mm/s; infinite for rapid, 0 at rest.
    pub feed: f64,
    /// A move or a dwell is at work.
    pub busy: bool,
    /// Jogging has moved the axes off the path, and they are not back yet.
    pub off_path: bool,
}

/// A dwell in which the path rests.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dwell {
    /// How long it still takes, s.
    pub left: f64,
    /// As [`PathItem::Dwell`](super::PathItem::Dwell) has it.
    pub block: Option<u32>,
}

#[derive(Debug, Clone, Copy)]
enum Step<const N: usize> {
    Section {
        item: u64,
        origin: f64,
        backward: bool,
        limits: Limits<N>,
        /// Number of its first path segment.
        path_segments: u64,
        /// It goes on with one that is under way.
        moving: bool,
        /// It begins so much later, s, as the axes have to rest before; known once it is committed.
        settle: Option<f64>,
    },
    JerkSegment(JerkSegment),
    Dwell {
        item: u64,
        duration: f64,
        tag: u32,
        block: Option<u32>,
    },
    Mark {
        item: u64,
        mark: u32,
    },
    Waypoint {
        item: u64,
        waypoints: u32,
    },
    Hold,
}

impl<const N: usize> Step<N> {
    /// Does nothing but come to rest.
    fn brakes(&self) -> bool {
        let Step::JerkSegment(p) = self else {
            return false;
        };
        let cruises = p.acceleration.abs() <= NOTHING && p.jerk >= 0.0;
        !cruises && p.at(p.duration).2 <= NOTHING
    }

    fn duration(&self) -> f64 {
        match *self {
            Step::Section { settle, .. } => settle.unwrap_or(0.0),
            Step::Mark { .. } | Step::Waypoint { .. } => 0.0,
            Step::JerkSegment(JerkSegment { duration, .. }) | Step::Dwell { duration, .. } => {
                duration
            }
            Step::Hold => f64::INFINITY,
        }
    }
}

/// An instant on the cycle's grid: `cycle` periods and `offset` seconds, so that no sum of
/// durations ever loses precision.
#[derive(Debug, Clone, Copy)]
struct Clock {
    cycle: u64,
    offset: f64,
}

/// An acceleration, mm/s², a speed, mm/s, or a way, mm, that is this small is what rounding leaves of none.
const NOTHING: f64 = 1e-9;

/// What an operator does shows after this long, s: at most a cycle passes until it is heard, and what is
/// left is for the planner.
const RESPONSE: f64 = 0.010;
/// A planner that is slow is asked for a state this far ahead, at most, s.
const LONGEST_LEAD: f64 = 0.5;
/// So many cycles after a request the new plan takes over.
fn first_lead(period: f64) -> u64 {
    ((RESPONSE / period) as u64).saturating_sub(1).max(1)
}

/// Steps, and path segments, of the plan that is followed: what is left of one commit and the next one, which
/// comes when half of that was followed at the latest.
const CAPACITY: usize = MOST_AT_ONCE + MOST_AT_ONCE / 2;
/// Room beyond that, for a new plan that comes while the old one is complete.
const RESERVE: usize = MOST_AT_ONCE;

/// Less of the programmed speed is none: a path that takes for ever cannot be planned.
const LEAST_OVERRIDE: f64 = 1e-3;

/// From so far ahead a stop is searched for that the planner does not find, s; and the fewest and the most cycles that
/// this may be.
const AHEAD: f64 = 0.024;
const FEWEST_AHEAD: u64 = 2;
const MOST_AHEAD: u64 = 12;
/// Work on the search for a stop on a curve, in all the cycles until its departure; see `brake.rs`. A short cycle has time
/// for its share among the most cycles, a longer one for more.
const WORK: usize = 1_800;
/// How many cycles ahead a stop is searched for.
fn ahead(period: f64) -> u64 {
    // A period that divides the time but for rounding does.
    ((AHEAD / period - 1e-9).ceil() as u64).clamp(FEWEST_AHEAD, MOST_AHEAD)
}

/// Where on the path the executor is.
#[derive(Debug, Clone, Copy)]
struct Place<const N: usize> {
    /// Those of the section under way.
    limits: Option<Limits<N>>,
    /// The item under way, or the last one, and the path distance from the beginning of everything
    /// to the section's.
    item: Option<u64>,
    origin: f64,
    /// The section leads back.
    backward: bool,
    /// How many sections began from rest, where on its own the last did, and whether its clock is shaped.
    sections: u64,
    from: f64,
    clock: bool,
    /// Where on the section the path came to rest last, and where the axes are there.
    reached: f64,
    position: [f64; N],
    tag: u32,
    /// The mark at which the path rests until it is passed; then there are no steps.
    mark: Option<u32>,
    /// How many waypoints the path has come to.
    waypoints: u32,
}

impl<const N: usize> Place<N> {
    /// On no path yet.
    fn before_the_path(position: [f64; N]) -> Self {
        Place {
            limits: None,
            item: None,
            origin: 0.0,
            backward: false,
            sections: 0,
            from: 0.0,
            clock: false,
            reached: 0.0,
            position,
            tag: 0,
            mark: None,
            waypoints: 0,
        }
    }
}

/// Holds the plan and samples it. Allocates only in [`Executor::new`] and [`Executor::settle`].
///
/// The setpoint of a cycle is a function of its number and of the plan alone: polynomials are
/// evaluated from their jerk segment's start, never summed up from cycle to cycle.
#[derive(Debug)]
pub struct Executor<const N: usize> {
    period: f64,
    cycle: u64,
    /// How many cycles after a request the new plan takes over.
    lead: u64,
    /// Those of the section under way first; where `start` falls, others begin.
    path_segments: VecDeque<PathSegment<N>>,
    /// Number of the first of `path_segments`, and of the first that is not committed.
    first_path_segment: u64,
    committed_path_segments: u64,
    steps: VecDeque<Step<N>>,
    /// How many of `steps` end at rest and may run.
    committed: usize,
    /// Number of the first of `steps`, counted from the last revision's first.
    number: i64,
    plan: PlanStatus,
    /// How often the plan was to be replaced.
    revision: u64,
    /// In this cycle a new plan came too late.
    refused: Option<u64>,
    /// How often a part of the plan came too late.
    late: u64,
    /// Nothing was left to execute from this cycle on; meaningless when there is.
    rested: u64,
    /// When the first of `steps` began; meaningless when idle.
    began: Clock,
    place: Place<N>,
    /// When the axes moved last.
    moved: Option<Clock>,
    settled: Settled<N>,
    overrides: Overrides,
    /// How many turns a second the spindle makes, where that is known.
    turns: Option<f64>,
    single_block: bool,
    retraction: Option<Retraction>,
    activity: Activity<N>,
    /// For the shortest stop; apart, for it is large.
    search: Box<Search<N>>,
}

/// Part of a speed that is asked for, at most `most`.
fn part(asked: f64, most: f64) -> f64 {
    if asked >= LEAST_OVERRIDE {
        asked.min(most)
    } else {
        0.0
    }
}

/// Writes once to all the memory of a queue that is empty.
fn touch<T: Clone>(queue: &mut VecDeque<T>, filling: Option<T>) {
    let room = queue.capacity() - queue.len();
    if queue.is_empty() {
        queue.extend(filling.into_iter().flat_map(|it| repeat_n(it, room)));
        queue.clear();
    }
}

/// Any path segment at all.
fn any_path_segment<const N: usize>() -> Option<PathSegment<N>> {
    Some(PathSegment {
        start: 0.0,
        curve: Curve::line([0.0; N], [1.0; N]).ok()?,
        feed: 0.0,
        turns: None,
        most: 0.0,
        clock: None,
        asked: 0.0,
        speed: 0.0,
        tag: 0,
        waypoints: 0,
    })
}

/// A copy has the room of the original.
impl<const N: usize> Clone for Executor<N> {
    fn clone(&self) -> Self {
        fn copied<T: Copy>(queue: &VecDeque<T>) -> VecDeque<T> {
            let mut copy = VecDeque::with_capacity(queue.capacity());
            copy.extend(queue);
            copy
        }
        Executor {
            path_segments: copied(&self.path_segments),
            steps: copied(&self.steps),
            search: self.search.clone(),
            settled: Settled {
                passed: copied(&self.settled.passed),
                ..self.settled
            },
            ..*self
        }
    }
}

impl<const N: usize> Executor<N> {
    /// Steps of a plan that it holds at most: those before them are not replaced any more.
    pub const MOST_STEPS: usize = CAPACITY + RESERVE;

    /// At rest in `position`, with a cycle of `period` s and room for whatever a planner commits.
    pub fn new(position: [f64; N], period: f64) -> Self {
        Executor {
            period,
            cycle: 0,
            lead: first_lead(period),
            path_segments: VecDeque::with_capacity(CAPACITY + RESERVE),
            first_path_segment: 0,
            committed_path_segments: 0,
            steps: VecDeque::with_capacity(CAPACITY + RESERVE),
            committed: 0,
            number: 0,
            plan: PlanStatus::Current,
            revision: 0,
            refused: None,
            late: 0,
            rested: 0,
            began: Clock {
                cycle: 0,
                offset: 0.0,
            },
            place: Place::before_the_path(position),
            moved: None,
            settled: Settled::default(),
            overrides: Overrides::default(),
            turns: None,
            single_block: false,
            retraction: None,
            activity: Activity::Following,
            search: Box::default(),
        }
    }

    /// Writes once to all the memory that is for its plan, before there is one, so that a cycle in real time is never the first
    /// to touch a page of it.
    pub fn touch(&mut self) {
        touch(&mut self.path_segments, any_path_segment());
        touch(&mut self.steps, Some(Step::Hold));
        self.settled.touch();
    }

    /// Forgets the plan and rests in `position`, its cycle number zero; overrides, single block and retraction stay
    /// as they are. Allocates nothing.
    pub fn restart(&mut self, position: [f64; N]) {
        self.path_segments.clear();
        self.settled.passed.clear();
        self.moved = None;
        self.steps.clear();
        self.search.reset();
        (self.first_path_segment, self.committed_path_segments) = (0, 0);
        (self.committed, self.number) = (0, 0);
        (self.cycle, self.rested) = (0, 0);
        self.began = self.now();
        (self.refused, self.late) = (None, 0);
        self.lead = first_lead(self.period);
        self.plan = PlanStatus::Current;
        self.place = Place::before_the_path(position);
        self.activity = Activity::Following;
        self.turns = None;
        if self.overrides != Overrides::default() || self.single_block {
            self.request_replacement();
        }
    }

    /// How many commands can be accepted now.
    pub fn room(&self) -> usize {
        let kept = self.path_segments.len() + self.settled.passed.len();
        let room = (self.path_segments.capacity().saturating_sub(kept))
            .min(self.steps.capacity() - self.steps.len());
        // While it rests nothing is taken, but for the plan that ends the rest.
        let waits = self.rests_at_hold() && !self.awaits_replacement();
        if self.activity.goal().is_none() || waits || self.refused == Some(self.cycle) {
            0
        } else if self.plan.is_replaced() {
            room
        } else if self.leads_to_mark() {
            0
        } else {
            room.saturating_sub(RESERVE)
        }
    }

    /// Takes the next command of the plan; false, and nothing taken, if there is no room for it.
    /// After [`stop`](Self::stop), but for the shortest stop, and while the plan is to be replaced,
    /// commands are taken and dropped.
    pub fn accept(&mut self, command: Command<N>) -> bool {
        if self.activity.ends() && !self.activity.seeks_stop() {
            return true;
        }
        if self.room() == 0 {
            return false;
        }
        if self.awaits_replacement() {
            if let Command::ReplacePlan { revision, cycle } = command
                && revision == self.revision
            {
                self.plan = PlanStatus::ReceivingReplacement { takeover: cycle };
            }
            return true;
        }
        let path_segments = self.first_path_segment + self.path_segments.len() as u64;
        match command {
            Command::ReplacePlan { .. } => {}
            Command::Section {
                item,
                origin,
                backward,
                limits,
            } => self.steps.push_back(Step::Section {
                item,
                origin,
                backward,
                limits,
                path_segments,
                moving: false,
                settle: None,
            }),
            Command::ReplaceTail(step) => self.plan = PlanStatus::ReceivingTail { from: step },
            Command::PathSegment(path_segment) => self.path_segments.push_back(path_segment),
            Command::JerkSegment(segment) => self.steps.push_back(Step::JerkSegment(segment)),
            Command::Dwell {
                item,
                duration,
                tag,
                block,
            } => {
                self.steps.push_back(Step::Dwell {
                    item,
                    duration,
                    tag,
                    block,
                });
            }
            Command::Mark { item, mark } => self.steps.push_back(Step::Mark { item, mark }),
            Command::Waypoint { item, waypoints } => {
                self.steps.push_back(Step::Waypoint { item, waypoints });
            }
            Command::Hold => self.steps.push_back(Step::Hold),
            Command::Commit => self.commit(),
        }
        true
    }

    /// How often a part of the plan came after the path had gone past the point from where it
    /// applied. The plan before is followed, which ends at rest, until a new one takes over.
    pub fn late_plans(&self) -> u64 {
        self.late
    }

    /// Nothing is left to execute, and nothing is waited for; the axes rest.
    pub fn is_idle(&self) -> bool {
        let moved = self.activity.jogging().is_some_and(|axes| !axes.rests());
        // Behind a mark nothing is planned before it is passed.
        let replaced = self.place.mark.is_none() && self.plan.is_replaced();
        let waits = match self.activity {
            Activity::Ended => false,
            Activity::Following | Activity::Retracing { .. } => replaced,
            Activity::Stopping { next, .. } => match next {
                Next::End => false,
                Next::Hold => true,
                Next::Follow | Next::Retrace { .. } => replaced,
            },
            Activity::Holding => true,
            Activity::Jogging { next, .. } => next != Next::End,
        };
        self.committed == 0 && !waits && !moved
    }

    /// The mark at which the path rests; it goes on behind it once that is passed.
    pub fn mark(&self) -> Option<u32> {
        self.place.mark
    }

    /// Lets the path go on behind the [`mark`](Self::mark) at which it rests.
    pub fn pass(&mut self) {
        self.place.mark = None;
    }

    /// How many [waypoints](super::Planner::waypoint) the path has come to. It grows only: on a path that is
    /// gone over again they do not count again.
    pub fn waypoints(&self) -> u32 {
        self.place.waypoints
    }

    /// What is committed ends at a mark, or the path rests at one: there is no more to follow before
    /// that is passed.
    fn leads_to_mark(&self) -> bool {
        let whole = self.committed == self.steps.len();
        self.place.mark.is_some() || whole && matches!(self.steps.back(), Some(Step::Mark { .. }))
    }

    /// Rests, and only more of the plan gets it on: nobody holds it, at no mark, and a speed is
    /// asked for.
    pub fn wants_plan(&self) -> bool {
        let rests = match self.current() {
            None => self.place.mark.is_none(),
            Some(Step::Hold) => {
                let Overrides { feed, rapid } = self.overrides;
                self.wants_speed() && feed > 0.0 && rapid > 0.0
            }
            Some(_) => false,
        };
        rests && self.activity.takes_plans()
    }

    /// The dwell in which the path rests.
    pub fn dwell(&self) -> Option<Dwell> {
        match *self.current()? {
            Step::Dwell {
                duration, block, ..
            } => Some(Dwell {
                left: (duration - self.since(self.began)).max(0.0),
                block,
            }),
            _ => None,
        }
    }

    /// Number of the cycle that the last setpoint belongs to.
    pub fn cycle(&self) -> u64 {
        self.cycle
    }

    /// The current setpoint.
    pub fn setpoint(&self) -> Setpoint<N> {
        let (Some(Step::JerkSegment(segment)), Some(path_segment)) =
            (self.current(), self.path_segments.front())
        else {
            let rest = Setpoint {
                position: self.place.position,
                velocity: [0.0; N],
                acceleration: [0.0; N],
                jerk: [0.0; N],
                tag: self.place.tag,
                distance: self.path_distance(self.place.reached),
                speed: 0.0,
                feed: 0.0,
                busy: !self.is_idle(),
                off_path: false,
            };
            let axes = self.activity.jogging();
            return axes.map_or(rest, |axes| axes.setpoint(rest));
        };
        let (ds, v, a) = self.under_way(segment);
        let j = segment.jerk;
        // The two starts first: they are large and constant, the rest is small and exact.
        let at = path_segment
            .curve
            .at((segment.distance - path_segment.start) + ds);
        Setpoint {
            position: at.q,
            velocity: at.d1.map(|x| x * v),
            acceleration: std::array::from_fn(|i| at.d2[i] * v * v + at.d1[i] * a),
            jerk: std::array::from_fn(|i| {
                at.d3[i] * v * v * v + 3.0 * at.d2[i] * v * a + at.d1[i] * j
            }),
            tag: path_segment.tag,
            distance: self.path_distance(segment.distance + ds),
            speed: v,
            feed: path_segment.asked,
            busy: true,
            off_path: false,
        }
    }

    /// Where a jerk segment is from its start, with what speed, and acceleration.
    fn under_way(&self, segment: &JerkSegment) -> (f64, f64, f64) {
        let t = self.since(self.began).clamp(0.0, segment.duration);
        let (ds, v, a) = segment.at(t);
        (ds, v.max(0.0), a)
    }

    fn path_distance(&self, on_section: f64) -> f64 {
        if self.place.backward {
            self.place.origin - on_section
        } else {
            self.place.origin + on_section
        }
    }

    /// Goes on by one cycle.
    pub fn advance(&mut self) -> Setpoint<N> {
        self.cycle += 1;
        self.settled.forget(self.cycle);
        // Also a dwell in which the axes are jogged: what comes behind it begins when it is over, or later.
        while let Some(step) = self.current() {
            let duration = step.duration();
            // What takes no time is over at once, also where rounding puts its beginning later.
            if duration > 0.0 && self.since(self.began) < duration {
                break;
            }
            self.finish_step(*step, duration);
        }
        if let Activity::Jogging { axes, .. } = &mut self.activity {
            axes.advance(self.overrides.rapid);
            self.moved = Some(self.now());
            self.come_back();
            return self.setpoint();
        }
        if let Some(Step::JerkSegment(segment)) = self.current() {
            let (ds, _, _) = segment.at(self.since(self.began));
            self.enter_path_segment_at(segment.distance + ds);
            self.pass_waypoints();
            if let Activity::Stopping {
                search: StopSearch::Sought { departure, since },
                ..
            } = self.activity
                && departure <= self.cycle + ahead(self.period)
            {
                self.seek_stop(departure, since);
            }
        } else if let Activity::Stopping { next, .. } = self.activity {
            self.activity = next.into();
        }
        self.setpoint()
    }

    fn current(&self) -> Option<&Step<N>> {
        if self.committed > 0 {
            self.steps.front()
        } else {
            None
        }
    }

    /// The path is in motion.
    fn moves(&self) -> bool {
        matches!(self.current(), Some(Step::JerkSegment(_)))
    }

    /// The plan came to a rest that somebody has to end.
    fn rests_at_hold(&self) -> bool {
        matches!(self.current(), Some(Step::Hold))
    }

    fn now(&self) -> Clock {
        Clock {
            cycle: self.cycle,
            offset: 0.0,
        }
    }

    /// Seconds from `then` to now.
    fn since(&self, then: Clock) -> f64 {
        (self.cycle - then.cycle) as f64 * self.period - then.offset
    }

    fn finish_step(&mut self, step: Step<N>, duration: f64) {
        let offset = self.began.offset + duration;
        let cycles = (offset / self.period).floor();
        self.began.cycle += cycles as u64;
        self.began.offset = (offset - cycles * self.period).max(0.0);
        self.steps.pop_front();
        self.number += 1;
        self.committed -= 1;
        match step {
            Step::Section {
                item,
                origin,
                backward,
                limits,
                path_segments,
                moving,
                ..
            } => {
                self.place.limits = Some(limits);
                let passed = path_segments.saturating_sub(self.first_path_segment) as usize;
                self.settled
                    .begin(&self.path_segments, passed, moving, self.cycle);
                self.path_segments
                    .drain(..passed.min(self.path_segments.len()));
                self.first_path_segment = path_segments;
                self.place.item = Some(item);
                self.place.origin = origin;
                self.place.backward = backward;
                if !moving && let Some(Step::JerkSegment(segment)) = self.current() {
                    self.place.reached = segment.distance;
                    self.place.from = self.place.reached;
                    self.place.sections += 1;
                    let first = self.path_segments.front();
                    self.place.clock = first.is_some_and(|it| it.clock.is_some());
                }
            }
            Step::JerkSegment(segment) => {
                self.moved = Some(self.began);
                if !matches!(self.current(), Some(Step::JerkSegment(_))) {
                    self.finish_run(segment.distance + segment.at(duration).0);
                }
            }
            Step::Dwell { item, .. } => self.place.item = Some(item),
            Step::Mark { item, mark } => {
                self.place.item = Some(item);
                self.place.mark = Some(mark);
            }
            Step::Waypoint { item, waypoints } => {
                self.place.item = Some(item);
                self.place.waypoints = self.place.waypoints.max(waypoints);
            }
            Step::Hold => self.began = self.now(),
        }
        if self.committed == 0 {
            self.rested = self.cycle;
        }
        if let Some(Step::Dwell { tag, .. }) = self.current() {
            self.place.tag = *tag;
        }
    }

    /// The axes have come to rest at `end` on the section, or another plan takes over there.
    fn finish_run(&mut self, end: f64) {
        self.enter_path_segment_at(end);
        self.pass_waypoints();
        if let Some(path_segment) = self.path_segments.front() {
            let whole = path_segment.start + path_segment.curve.length();
            let complete = end >= whole - NOTHING;
            self.place.position = if complete {
                path_segment.curve.end()
            } else {
                path_segment.curve.at(end - path_segment.start).q
            };
            self.place.tag = path_segment.tag;
            self.place.reached = end;
        }
        if self.activity.ends() && self.committed == 0 {
            self.forget_path();
        }
    }

    /// Nothing is left of the path ahead.
    pub(super) fn forget_path(&mut self) {
        if let Some(last) = self.path_segments.front() {
            self.settled.pass(*last, self.cycle);
        }
        self.path_segments.clear();
    }

    /// The path is on its first path segment, and has come to all waypoints before that.
    fn pass_waypoints(&mut self) {
        if let Some(path_segment) = self.path_segments.front() {
            self.place.waypoints = self.place.waypoints.max(path_segment.waypoints);
        }
    }

    /// Drops the path segments that end before `distance`, but never the last of the section. Where a path rests at the end of
    /// one, the next has not begun.
    fn enter_path_segment_at(&mut self, distance: f64) {
        while let (Some(path_segment), Some(next)) =
            (self.path_segments.front(), self.path_segments.get(1))
        {
            if next.start <= path_segment.start
                || distance < path_segment.start + path_segment.curve.length() + NOTHING
            {
                break;
            }
            self.settled.pass(*path_segment, self.cycle);
            self.path_segments.pop_front();
            self.first_path_segment += 1;
        }
    }
}
