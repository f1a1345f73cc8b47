//! Executes the plan on the path's own clock, one setpoint a cycle.

use std::collections::VecDeque;
use std::iter::repeat_n;
use std::mem::take;

use super::brake::{Search, brake_gently};
use super::jog::{Jog, JogError, Jogging, Then, Travel};
use super::planner::MOST_AT_ONCE;
use super::{
    Command, Curve, JerkSegment, Limits, Overrides, PathSegment, PathState, ReplanRequest,
};

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
    /// A person moved the axes away from the path, and they are not back yet.
    pub off_path: bool,
}

#[derive(Debug, Clone, Copy)]
enum Step<const N: usize> {
    Section {
        item: u64,
        origin: f64,
        backward: bool,
        limits: Limits<N>,
        /// Number of its first span.
        spans: u64,
        /// It goes on with one that is under way.
        moving: bool,
    },
    JerkSegment(JerkSegment),
    Dwell {
        item: u64,
        duration: f64,
        tag: u32,
    },
    Mark {
        item: u64,
        mark: u32,
    },
    Hold,
}

impl<const N: usize> Step<N> {
    fn duration(&self) -> f64 {
        match *self {
            Step::Section { .. } | Step::Mark { .. } => 0.0,
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

/// What a person does shows after this long, s: at most a cycle passes until it is heard, the rest is
/// for the planner.
const RESPONSE: f64 = 0.010;
/// A planner that is slow is asked for a state this far ahead, at most, s.
const LONGEST_LEAD: f64 = 0.5;
/// So many cycles after an request the new plan takes over.
fn first_lead(period: f64) -> u64 {
    ((RESPONSE / period) as u64).saturating_sub(1).max(1)
}

/// Steps, and spans, of the plan that is followed: what is left of one commit and the next one, which
/// comes when half of that was followed at the latest.
const CAPACITY: usize = MOST_AT_ONCE + MOST_AT_ONCE / 2;
/// Room beyond that, for a new plan that comes while the old one is complete.
const RESERVE: usize = MOST_AT_ONCE;

/// Less of the programmed speed is none: a path that takes for ever cannot be planned.
const LEAST_OVERRIDE: f64 = 1e-3;

/// From so many cycles ahead a stop is searched for that the planner does not find.
const AHEAD: u64 = 12;
/// Work on the search for a stop on a curve in a cycle; see `brake.rs`.
const WORK: usize = 150;

/// How far a stop on the path has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stop {
    /// Nobody asked for one.
    No,
    /// The plan is followed to its rest until a shorter way is found from that cycle on; since this one.
    Sought { departure: u64, since: u64 },
    /// The shorter way is being followed.
    Found,
}

/// Holds the plan and samples it. Allocates only in [`Executor::new`].
///
/// The setpoint of a cycle is a function of its number and of the plan alone: polynomials are
/// evaluated from their piece's start, never summed up from cycle to cycle.
#[derive(Debug)]
pub struct Executor<const N: usize> {
    period: f64,
    cycle: u64,
    /// How many cycles after an request the new plan takes over.
    lead: u64,
    limits: Option<Limits<N>>,
    /// Those of the section under way first; where `start` falls, others begin.
    spans: VecDeque<PathSegment<N>>,
    /// Number of the first of `spans`, and of the first that is not committed.
    first_span: u64,
    committed_spans: u64,
    steps: VecDeque<Step<N>>,
    /// How many of `steps` end at rest and may run.
    committed: usize,
    /// Number of the first of `steps`, counted from the last revision's first.
    number: i64,
    /// The step that the uncommitted ones replace.
    splice: Option<u64>,
    /// The uncommitted steps are a new plan; it takes over in this cycle.
    takeover: Option<u64>,
    /// How often the plan was to be replaced.
    revision: u64,
    /// It is to be replaced, and what still comes of the old one is dropped.
    awaits_replacement: bool,
    /// In this cycle a new plan came too late.
    refused: Option<u64>,
    /// How often a part of the plan came too late.
    late: u64,
    /// Nothing was left to execute from this cycle on; meaningless when there is.
    rested: u64,
    /// When the first of `steps` began; meaningless when idle.
    began: Clock,
    /// The mark at which the path rests until it is passed; then there are no steps.
    mark: Option<u32>,
    /// The item under way, or the last one, and the path distance from the beginning of everything
    /// to the section's.
    item: Option<u64>,
    origin: f64,
    /// The section leads back.
    backward: bool,
    /// Where on the section the path came to rest last.
    reached: f64,
    rest: [f64; N],
    tag: u32,
    stop: Stop,
    /// Apart, for it is large; always there.
    search: Option<Box<Search<N>>>,
    overrides: Overrides,
    single_block: bool,
    /// The way back is asked for; the revision that the person asked for with it.
    retrace: Option<u64>,
    /// Rest until `resume`.
    held: bool,
    /// Rest for good.
    stopped: bool,
    /// What a person does with the axes while the path rests.
    jogging: Option<Jogging<N>>,
}

/// Part of a speed that is asked for, at most `most`.
fn part(asked: f64, most: f64) -> f64 {
    if asked >= LEAST_OVERRIDE {
        asked.min(most)
    } else {
        0.0
    }
}

/// An empty queue whose memory has been written to once, so that the cycle is never the first to
/// touch a page of it.
fn touched<T: Clone>(capacity: usize, filling: Option<T>) -> VecDeque<T> {
    let mut queue = VecDeque::with_capacity(capacity);
    queue.extend(filling.into_iter().flat_map(|it| repeat_n(it, capacity)));
    queue.clear();
    queue
}

/// Any span at all.
fn some_span<const N: usize>() -> Option<PathSegment<N>> {
    Some(PathSegment {
        start: 0.0,
        curve: Curve::line([0.0; N], [1.0; N]).ok()?,
        feed: 0.0,
        speed: 0.0,
        tag: 0,
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
            spans: copied(&self.spans),
            steps: copied(&self.steps),
            search: self.search.clone(),
            ..*self
        }
    }
}

impl<const N: usize> Executor<N> {
    /// At rest in `position`, with a cycle of `period` s and room for whatever a planner commits.
    pub fn new(position: [f64; N], period: f64) -> Self {
        Executor {
            spans: touched(CAPACITY + RESERVE, some_span()),
            steps: touched(CAPACITY + RESERVE, Some(Step::Hold)),
            search: Some(Box::default()),
            ..Executor::empty(position, period)
        }
    }

    fn empty(position: [f64; N], period: f64) -> Self {
        Executor {
            period,
            cycle: 0,
            lead: first_lead(period),
            limits: None,
            spans: VecDeque::new(),
            first_span: 0,
            committed_spans: 0,
            steps: VecDeque::new(),
            committed: 0,
            number: 0,
            splice: None,
            takeover: None,
            revision: 0,
            awaits_replacement: false,
            refused: None,
            late: 0,
            rested: 0,
            began: Clock {
                cycle: 0,
                offset: 0.0,
            },
            mark: None,
            item: None,
            origin: 0.0,
            backward: false,
            reached: 0.0,
            rest: position,
            tag: 0,
            stop: Stop::No,
            search: None,
            overrides: Overrides::default(),
            single_block: false,
            retrace: None,
            held: false,
            stopped: false,
            jogging: None,
        }
    }

    /// Forgets the plan and rests in `position`, its cycle number zero; the overrides stay as they
    /// are. Allocates nothing.
    pub fn restart(&mut self, position: [f64; N]) {
        let (mut spans, mut steps) = (take(&mut self.spans), take(&mut self.steps));
        spans.clear();
        steps.clear();
        *self = Executor {
            spans,
            steps,
            search: take(&mut self.search),
            overrides: self.overrides,
            revision: self.revision,
            ..Executor::empty(position, self.period)
        };
        if self.overrides != Overrides::default() {
            self.request_replacement();
        }
    }

    /// How many commands can be accepted now.
    pub fn room(&self) -> usize {
        let room = (self.spans.capacity() - self.spans.len())
            .min(self.steps.capacity() - self.steps.len());
        let held =
            self.held || self.stopped || self.turns() || self.is_held() && !self.awaits_replacement;
        if held && !self.seeks_rest() || self.refused == Some(self.cycle) {
            0
        } else if self.awaits_replacement || self.takeover.is_some() {
            room
        } else if self.leads_to_mark() {
            0
        } else {
            room.saturating_sub(RESERVE)
        }
    }

    /// Takes the next command of the plan; false, and nothing taken, if there is no room for it.
    /// After [`stop`](Self::stop), but for the way to rest, and while the plan is to be replaced,
    /// commands are taken and dropped.
    pub fn accept(&mut self, command: Command<N>) -> bool {
        if self.stopped && !self.seeks_rest() {
            return true;
        }
        if self.room() == 0 {
            return false;
        }
        if self.awaits_replacement {
            if let Command::ReplacePlan { revision, cycle } = command
                && revision == self.revision
            {
                self.awaits_replacement = false;
                self.takeover = Some(cycle);
            }
            return true;
        }
        let spans = self.first_span + self.spans.len() as u64;
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
                spans,
                moving: false,
            }),
            Command::ReplaceTail(step) => self.splice = Some(step),
            Command::PathSegment(span) => self.spans.push_back(span),
            Command::JerkSegment(piece) => self.steps.push_back(Step::JerkSegment(piece)),
            Command::Dwell {
                item,
                duration,
                tag,
            } => {
                self.steps.push_back(Step::Dwell {
                    item,
                    duration,
                    tag,
                });
            }
            Command::Mark { item, mark } => self.steps.push_back(Step::Mark { item, mark }),
            Command::Hold => self.steps.push_back(Step::Hold),
            Command::Commit => self.commit(),
        }
        true
    }

    fn commit(&mut self) {
        if let Some(cycle) = self.takeover.take() {
            // Who rests since before can begin whenever the plan comes.
            let rests = self.committed == 0 && self.mark.is_none() && cycle >= self.rested;
            if cycle < self.cycle && !rests {
                // Too late: another one is asked for in the next cycle, and from a planner that
                // is slow further ahead. None was found where the cycle is 0.
                if cycle > 0 {
                    let most = (LONGEST_LEAD / self.period) as u64;
                    self.lead = (2 * self.lead).min(most.max(self.lead));
                } else if let Stop::Sought { since, .. } = self.stop {
                    // It is awake, and asked again.
                    self.seek_from(self.unanswered(), since);
                }
                self.request_replacement();
                self.refused = Some(self.cycle);
                return;
            }
            let keep = self.cut(cycle.max(self.cycle));
            self.steps.drain(keep..self.committed);
            self.stop = Stop::No;
            self.lead = first_lead(self.period);
            self.number = -(keep as i64);
            let under_way = keep.checked_sub(1).is_some_and(
                |last| matches!(self.steps[last], Step::JerkSegment(p) if p.at(p.duration).1 > 0.0),
            );
            if let Some(Step::Section { moving, .. }) = self.steps.get_mut(keep) {
                *moving = under_way;
            }
            if keep == 0 {
                self.began = self.now();
            }
        } else if let Some(step) = self.splice.take() {
            // A step that has begun cannot be replaced any more.
            let keep = step as i64 - self.number;
            if keep <= 0 {
                self.late += 1;
                self.request_replacement();
                return;
            }
            self.steps
                .drain((keep as usize).min(self.committed)..self.committed);
        } else if self.committed == 0 {
            self.began = self.now();
        }
        self.committed = self.steps.len();
        self.committed_spans = self.first_span + self.spans.len() as u64;
        if self.held || self.stopped || self.turns() {
            // That was the way to rest; a way on comes after it.
            self.stop = Stop::Found;
            self.request_replacement();
        }
    }

    /// How often a part of the plan came after the path had gone past the point from where it
    /// applied. The plan before is followed, which ends at rest, until a new one takes over.
    pub fn late_plans(&self) -> u64 {
        self.late
    }

    /// Nothing is left to execute, and nothing is waited for; the axes rest.
    pub fn is_idle(&self) -> bool {
        let moved = self
            .jogging
            .as_ref()
            .is_some_and(|jogging| !jogging.rests());
        // Behind a mark nothing is planned before it is passed.
        let replaced = self.mark.is_none() && (self.awaits_replacement || self.takeover.is_some());
        let waits = !self.stopped && (self.held || replaced);
        self.committed == 0 && !waits && !moved
    }

    /// The mark at which the path rests; it goes on behind it once that is passed.
    pub fn mark(&self) -> Option<u32> {
        self.mark
    }

    /// Lets the path go on behind the [`mark`](Self::mark) at which it rests.
    pub fn pass(&mut self) {
        self.mark = None;
    }

    /// What is committed ends at a mark, or the path rests at one: there is no more to follow before
    /// that is passed.
    fn leads_to_mark(&self) -> bool {
        let whole = self.committed == self.steps.len();
        self.mark.is_some() || whole && matches!(self.steps.back(), Some(Step::Mark { .. }))
    }

    /// Rests, and only more of the plan gets it on: nobody holds it, at no mark, and a speed is
    /// asked for.
    pub fn wants_plan(&self) -> bool {
        let rests = match self.current() {
            None => self.mark.is_none(),
            Some(Step::Hold) => {
                let Overrides { feed, rapid } = self.overrides;
                self.wants_speed() && feed > 0.0 && rapid > 0.0
            }
            Some(_) => false,
        };
        rests && !self.held && !self.stopped && self.jogging.is_none()
    }

    /// Number of the cycle that the last setpoint belongs to.
    pub fn cycle(&self) -> u64 {
        self.cycle
    }

    /// The current setpoint.
    pub fn setpoint(&self) -> Setpoint<N> {
        let (Some(Step::JerkSegment(piece)), Some(span)) = (self.current(), self.spans.front())
        else {
            let rest = Setpoint {
                position: self.rest,
                velocity: [0.0; N],
                acceleration: [0.0; N],
                jerk: [0.0; N],
                tag: self.tag,
                distance: self.path_distance(self.reached),
                speed: 0.0,
                feed: 0.0,
                busy: !self.is_idle(),
                off_path: false,
            };
            return (self.jogging.as_ref()).map_or(rest, |jogging| jogging.setpoint(rest));
        };
        let t = self.since(self.began).clamp(0.0, piece.duration);
        let (ds, v, a) = piece.at(t);
        let v = v.max(0.0);
        let j = piece.jerk;
        // The two starts first: they are large and constant, the rest is small and exact.
        let at = span.curve.at((piece.distance - span.start) + ds);
        Setpoint {
            position: at.q,
            velocity: at.d1.map(|x| x * v),
            acceleration: std::array::from_fn(|i| at.d2[i] * v * v + at.d1[i] * a),
            jerk: std::array::from_fn(|i| {
                at.d3[i] * v * v * v + 3.0 * at.d2[i] * v * a + at.d1[i] * j
            }),
            tag: span.tag,
            distance: self.path_distance(piece.distance + ds),
            speed: v,
            feed: span.speed,
            busy: true,
            off_path: false,
        }
    }

    fn path_distance(&self, on_section: f64) -> f64 {
        if self.backward {
            self.origin - on_section
        } else {
            self.origin + on_section
        }
    }

    /// Goes on by one cycle.
    pub fn advance(&mut self) -> Setpoint<N> {
        self.cycle += 1;
        if let Some(jogging) = &mut self.jogging {
            jogging.advance(self.overrides.rapid);
            self.come_back();
            return self.setpoint();
        }
        while let Some(step) = self.current() {
            let duration = step.duration();
            // What takes no time is over at once, also where rounding puts its beginning later.
            if duration > 0.0 && self.since(self.began) < duration {
                break;
            }
            self.finish_step(*step, duration);
        }
        if let Some(Step::JerkSegment(piece)) = self.current() {
            let (ds, _, _) = piece.at(self.since(self.began));
            self.enter_span_at(piece.distance + ds);
            if let Stop::Sought { departure, since } = self.stop
                && departure <= self.cycle + AHEAD
            {
                self.seek_stop(departure, since);
            }
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
                spans,
                moving,
            } => {
                self.limits = Some(limits);
                let passed = spans.saturating_sub(self.first_span) as usize;
                self.spans.drain(..passed.min(self.spans.len()));
                self.first_span = spans;
                self.item = Some(item);
                self.origin = origin;
                self.backward = backward;
                if !moving && let Some(Step::JerkSegment(piece)) = self.current() {
                    self.reached = piece.distance;
                }
            }
            Step::JerkSegment(piece) => {
                if !matches!(self.current(), Some(Step::JerkSegment(_))) {
                    self.finish_run(piece.distance + piece.at(duration).0);
                }
            }
            Step::Dwell { item, .. } => self.item = Some(item),
            Step::Mark { item, mark } => {
                self.item = Some(item);
                self.mark = Some(mark);
            }
            Step::Hold => self.began = self.now(),
        }
        if self.committed == 0 {
            self.rested = self.cycle;
        }
        if let Some(Step::Dwell { tag, .. }) = self.current() {
            self.tag = *tag;
        }
    }

    /// The axes have come to rest at `end` on the section, or another law takes over there.
    fn finish_run(&mut self, end: f64) {
        self.enter_span_at(end);
        if let Some(span) = self.spans.front() {
            let whole = span.start + span.curve.length();
            let complete = end >= whole - 1e-9;
            self.rest = if complete {
                span.curve.end()
            } else {
                span.curve.at(end - span.start).q
            };
            self.tag = span.tag;
            self.reached = end;
        }
        if self.stopped && self.committed == 0 {
            self.spans.clear();
        }
    }

    /// Drops the spans that end before `distance`, but never the last of the section.
    fn enter_span_at(&mut self, distance: f64) {
        while let (Some(span), Some(next)) = (self.spans.front(), self.spans.get(1)) {
            if next.start <= span.start || distance < span.start + span.curve.length() {
                break;
            }
            self.spans.pop_front();
            self.first_span += 1;
        }
    }

    // --- what a person does ---

    /// From now on these parts of the programmed speeds are asked for; values outside of the ranges
    /// are brought into them, to rest where they are next to nothing or no number.
    pub fn set_overrides(&mut self, overrides: Overrides) {
        let overrides = Overrides {
            feed: part(overrides.feed, 2.0),
            rapid: part(overrides.rapid, 1.0),
        };
        if overrides != self.overrides {
            // A rest for want of speed ends; one that a person asked for does not, and what ends it
            // has the path planned anew.
            let rests = matches!(self.current(), Some(Step::Hold));
            let asked = rests && !self.wants_speed();
            if rests && !asked {
                self.finish_step(Step::Hold, 0.0);
            }
            if overrides.rapid != self.overrides.rapid
                && let Some(jogging) = &mut self.jogging
            {
                jogging.change_speed();
            }
            self.overrides = overrides;
            if !asked {
                self.request_replacement();
            }
        }
    }

    /// What parts of the programmed speeds are asked for.
    pub fn overrides(&self) -> Overrides {
        self.overrides
    }

    /// Comes to rest on the path as soon as the limits allow and waits for
    /// [`resume`](Self::resume). Effective from the current cycle on; the next setpoints lead to
    /// rest. A dwell is broken off, and begins anew.
    ///
    /// On a line that is the closed form. On curves the [`replan_request`](Self::replan_request) asks the planner
    /// for a law that brakes as hard as the axes allow, and where it does not answer in time one is
    /// searched for here, over several cycles; until there is one the plan, which ends at rest, too,
    /// is followed.
    pub fn feed_hold(&mut self) {
        if let Some(jogging) = &mut self.jogging {
            jogging.hold();
            return;
        }
        let begun = self.held || self.stopped;
        let rests = matches!(self.current(), Some(Step::Hold));
        if rests {
            self.held |= !self.stopped;
        } else if !begun {
            self.request_replacement();
            self.held = true;
            // To turn it comes to rest already.
            if self.stop == Stop::No {
                self.begin_stop();
            }
        }
    }

    /// Ends a [`feed_hold`](Self::feed_hold), also one that a stop after the block came to.
    pub fn resume(&mut self) {
        if self.stopped {
            return;
        }
        let goes_on = take(&mut self.single_block);
        if let Some(jogging) = &mut self.jogging {
            jogging.go_home(Then::Resume);
            return;
        }
        if !(self.is_held() || self.retraces()) {
            if goes_on {
                self.request_replacement();
            }
            return;
        }
        self.retrace = None;
        self.leave_hold();
        if self.backward && self.stop != Stop::Found {
            self.begin_stop();
        } else if !self.backward {
            self.stop = Stop::No;
        }
        self.request_replacement();
    }

    /// Comes to rest, goes back along the path to the beginning of the block, or from there to that
    /// of the block before, and waits for [`resume`](Self::resume). On the way back it changes
    /// nothing.
    pub fn retrace(&mut self) {
        let under_way = self.retraces() && !self.is_held();
        if self.stopped || under_way {
            return;
        }
        if let Some(jogging) = &mut self.jogging {
            jogging.go_home(Then::Retrace);
            return;
        }
        self.single_block = false;
        // It comes again.
        self.mark = None;
        self.retrace = Some(self.revision + 1);
        self.leave_hold();
        if self.backward {
            self.stop = Stop::No;
        } else if self.stop != Stop::Found {
            self.begin_stop();
        }
        self.request_replacement();
    }

    /// Goes back along the path, or rests where that led, until [`resume`](Self::resume).
    pub fn retraces(&self) -> bool {
        self.retrace.is_some()
    }

    fn leave_hold(&mut self) {
        self.held = false;
        if let Some(Step::Hold) = self.current() {
            self.finish_step(Step::Hold, 0.0);
        }
    }

    /// It has to come to rest before the new plan begins: that goes the other way.
    fn turns(&self) -> bool {
        self.retraces() != self.backward && matches!(self.current(), Some(Step::JerkSegment(_)))
    }

    /// Comes to rest at the end of the block that is under way, or of the first one where that is
    /// possible, and waits for [`resume`](Self::resume). On the way back from a jog: of the block that
    /// then goes on.
    pub fn single_block(&mut self) {
        if let Some(jogging) = &self.jogging {
            self.single_block |= jogging.returns();
        } else if !self.is_held() && !self.retraces() {
            self.single_block = true;
            self.request_replacement();
        }
    }

    /// Rests, or is coming to rest, until [`resume`](Self::resume).
    pub fn is_held(&self) -> bool {
        let returns = self
            .jogging
            .as_ref()
            .is_some_and(|jogging| jogging.returns());
        !returns && (self.held || matches!(self.current(), Some(Step::Hold)))
    }

    /// Rests because nothing is left of the programmed speed; nobody asked for it.
    pub fn wants_speed(&self) -> bool {
        let asked = self.held || self.single_block || self.retrace.is_some();
        !asked && matches!(self.current(), Some(Step::Hold))
    }

    /// Nothing of the path is missing: what is committed leads to a rest that somebody has to end.
    pub fn leads_to_hold(&self) -> bool {
        let last = self.committed.checked_sub(1);
        let changes = self.awaits_replacement || self.takeover.is_some();
        !changes && matches!(last.and_then(|last| self.steps.get(last)), Some(Step::Hold))
    }

    /// Comes to rest on the path as soon as the limits allow, as [`feed_hold`](Self::feed_hold) does, also by
    /// what a planner answers, and drops the rest of the plan for good.
    pub fn stop(&mut self) {
        if !self.stopped {
            self.stopped = true;
            self.held = false;
            match self.stop {
                Stop::No => {
                    self.request_replacement();
                    self.begin_stop();
                }
                // A hold looks for the way already, or is on it.
                Stop::Sought { .. } => {}
                Stop::Found => self.drop_uncommitted(),
            }
            if self.committed == 0 {
                self.spans.clear();
            }
            if let Some(jogging) = &mut self.jogging {
                jogging.hold();
            }
        }
    }

    /// Moves axes while the path rests: after a [`feed_hold`](Self::feed_hold), or where nothing is left of it;
    /// then nothing of it begins before [`resume`](Self::resume). That, and
    /// [`retrace`](Self::retrace), lead the axes back to where the path was left, on a straight
    /// line, before they take effect; [`feed_hold`](Self::feed_hold) and [`stop`](Self::stop) bring them to rest
    /// where they are. Whatever moves an order comes to, it is followed from the state of this cycle on.
    ///
    /// # Errors
    /// Why the order is refused; nothing changes then.
    pub fn jog(&mut self, jog: Jog<N>, travel: &[Option<Travel>; N]) -> Result<(), JogError> {
        let moves = matches!(self.current(), Some(Step::JerkSegment(_)));
        let rests = self.is_idle() || self.is_held() && !moves;
        if self.stopped || !rests && self.jogging.is_none() {
            return Err(JogError::Moving);
        }
        let new = || Jogging::new(self.rest, self.period, travel);
        let mut jogging = self.jogging.unwrap_or_else(new);
        jogging.order(jog, self.overrides.rapid)?;
        self.jogging = Some(jogging);
        if !self.held {
            self.request_replacement();
            self.held = true;
        }
        Ok(())
    }

    /// A person moved the axes away from the path, and they are not back yet.
    pub fn is_off_path(&self) -> bool {
        self.jogging.is_some()
    }

    /// Goes on with what the axes came back for.
    fn come_back(&mut self) {
        let Some(then) = self.jogging.as_ref().and_then(Jogging::arrived) else {
            return;
        };
        self.jogging = None;
        match then {
            Then::Resume => {
                let stop = self.single_block;
                self.resume();
                if stop {
                    self.single_block();
                }
            }
            Then::Retrace => self.retrace(),
        }
    }

    /// The plan is to be replaced, and what still comes of the old one is dropped.
    pub fn awaits_replacement(&self) -> bool {
        self.awaits_replacement
    }

    /// From where on the plan has to be replaced, if it has. What is handed in before that is done
    /// is dropped. Nowhere at a mark or so shortly before it that it is reached before: what is
    /// replaced begins behind it once it is passed, and the mark itself is not lost.
    pub fn replan_request(&self) -> Option<ReplanRequest> {
        let rest = self.seeks_rest();
        let held = self.held || self.stopped || self.turns() || self.mark.is_some();
        if !self.awaits_replacement || held && !rest || self.refused == Some(self.cycle) {
            return None;
        }
        // A way to rest is soon found.
        let lead = if rest { self.lead * 3 / 4 } else { self.lead };
        let cycle = self.cycle + lead.max(1);
        let mut item = self.item;
        let mut departure = PathState {
            distance: self.reached,
            ..PathState::default()
        };
        let (last, t) = self.step_at(cycle);
        for (index, step) in self.steps.iter().take(self.committed).enumerate() {
            if index > last {
                break;
            }
            match *step {
                Step::Section { item: l, .. } => {
                    item = Some(l);
                    departure = PathState::default();
                }
                Step::Mark { .. } => return None,
                Step::Dwell { item: l, .. } => item = Some(l),
                Step::JerkSegment(piece) => {
                    let under_way = index == last;
                    let (ds, speed, acceleration) =
                        piece.at(if under_way { t } else { piece.duration });
                    let follows = matches!(
                        self.steps.get(index + 1),
                        Some(Step::JerkSegment(_) | Step::Section { moving: true, .. })
                    ) && index + 1 < self.committed;
                    let rests = !under_way && !follows;
                    departure = PathState {
                        distance: piece.distance + ds,
                        speed: if rests { 0.0 } else { speed.max(0.0) },
                        acceleration: if rests { 0.0 } else { acceleration },
                    };
                }
                Step::Hold => {}
            }
        }
        Some(ReplanRequest {
            revision: self.revision,
            cycle,
            item,
            departure,
            overrides: self.overrides,
            single_block: self.single_block,
            retrace: self.retrace,
            rest,
        })
    }

    /// From this cycle on a stop is to begin that the planner, asked from now on, did not find.
    fn unanswered(&self) -> u64 {
        self.cycle + self.lead + AHEAD
    }

    /// It is to come to rest as soon as it can, until [`resume`](Self::resume), to turn or for good, and
    /// no way there was found yet.
    fn seeks_rest(&self) -> bool {
        let moves = matches!(self.current(), Some(Step::JerkSegment(_)));
        moves && matches!(self.stop, Stop::Sought { .. })
    }

    /// The plan is to be replaced: nothing more of it is taken.
    fn request_replacement(&mut self) {
        if self.stopped && self.stop == Stop::Found {
            return;
        }
        self.drop_uncommitted();
        self.revision += 1;
        self.awaits_replacement = true;
    }

    fn drop_uncommitted(&mut self) {
        self.steps.truncate(self.committed);
        let spans = self.committed_spans.saturating_sub(self.first_span);
        self.spans.truncate(spans as usize);
        self.splice = None;
        self.takeover = None;
    }

    /// The committed step that is under way at the start of `cycle`, and for how long then; their
    /// number if there is none any more.
    fn step_at(&self, cycle: u64) -> (usize, f64) {
        let mut t = self.since(self.began) + (cycle - self.cycle) as f64 * self.period;
        for (index, step) in self.steps.iter().take(self.committed).enumerate() {
            let duration = step.duration();
            if t < duration {
                return (index, t.max(0.0));
            }
            t -= duration;
        }
        (self.committed, 0.0)
    }

    /// Cuts the committed plan at the start of `cycle`; returns how many of its steps remain.
    fn cut(&mut self, cycle: u64) -> usize {
        let (index, t) = self.step_at(cycle);
        match self.steps.get_mut(index) {
            Some(Step::JerkSegment(piece)) if index < self.committed => {
                piece.duration = t;
                index + 1
            }
            // A dwell is not cut short.
            Some(Step::Dwell { .. }) if index < self.committed => index + 1,
            _ => index,
        }
    }

    fn begin_stop(&mut self) {
        // However slow its plans are: a way to rest is soon found.
        self.lead = first_lead(self.period);
        self.drop_uncommitted();
        let goes_on =
            |s: &Step<N>| matches!(s, Step::JerkSegment(_) | Step::Section { moving: true, .. });
        let run = self.steps.iter().position(|s| !goes_on(s));
        self.steps.truncate(run.unwrap_or(self.steps.len()));
        self.committed = self.steps.len();
        self.seek_from(self.cycle, self.cycle);
        self.seek_stop(self.cycle, self.cycle);
    }

    /// A way to rest from that cycle on is searched for anew.
    fn seek_from(&mut self, departure: u64, since: u64) {
        self.stop = Stop::Sought { departure, since };
        if let Some(search) = &mut self.search {
            search.reset();
        }
    }

    /// Replaces the plan by a shorter way to rest if there is one.
    ///
    /// A line has a closed form at once. Elsewhere the planner is asked for one; what it does not
    /// answer in time is searched for here from a little ahead, so that the share of several cycles
    /// goes into the same law.
    ///
    /// Apart from the cycle that follows its plan: the search has a large stack.
    #[inline(never)]
    fn seek_stop(&mut self, departure: u64, since: u64) {
        let (Some(Step::JerkSegment(_)), Some(limits)) = (self.current(), self.limits) else {
            return;
        };
        let (index, t) = self.step_at(departure);
        let Some(Step::JerkSegment(piece)) = self.steps.get(index).copied() else {
            self.stop = Stop::Found;
            return;
        };
        let (ds, speed, acceleration) = piece.at(t.min(piece.duration));
        let first = self.cycle == since;
        let from = PathState {
            distance: piece.distance + ds,
            speed,
            acceleration,
        };
        let spans = &self.spans;
        let passed = (1..spans.len())
            .take_while(|&k| spans[k].start > spans[k - 1].start && spans[k].start <= from.distance)
            .count();
        let span = |k: usize| {
            let span = spans.get(passed + k)?;
            (k == 0 || span.start > spans[passed + k - 1].start).then_some(span)
        };
        let gentle = || brake_gently(span(0)?, &limits, from, 0.0);
        let straight = span(0).is_some_and(|span| span.curve.direction().is_some());
        // Where the plan does nothing but come to rest on a line, it does so as fast as it can.
        let brakes = |s: &Step<N>| {
            let Step::JerkSegment(p) = s else {
                return false;
            };
            let cruises = p.acceleration.abs() <= 1e-9 && p.jerk >= 0.0;
            !cruises && p.at(p.duration).2 <= 1e-9
        };
        if first && straight && acceleration <= 0.0 && self.steps.iter().all(brakes) {
            self.stop = Stop::Found;
            return;
        }
        let last = departure == self.cycle && !first;
        // The hardest as soon as it is found, and at last a gentle one.
        let searched = match straight.then(gentle).flatten() {
            None if first => Some(None),
            None => (self.search.as_mut())
                .and_then(|search| search.go_on(span, &limits, from, 0.0, WORK)),
            law => Some(law),
        };
        let (lost, hardest) = (searched.is_none(), searched.flatten());
        let found = hardest.is_some();
        let gentle = || last.then(gentle).flatten();
        let plan_ends = self.committed.checked_sub(1).map_or(f64::INFINITY, |last| {
            match self.steps.get(last) {
                Some(Step::JerkSegment(last)) => last.distance + last.at(last.duration).0,
                _ => f64::INFINITY,
            }
        });
        if let Some(law) = hardest.or_else(gentle)
            && law.end.distance < plan_ends
        {
            self.request_replacement();
            let keep = self.cut(departure);
            self.steps.truncate(keep);
            self.steps
                .extend(law.pieces().iter().copied().map(Step::JerkSegment));
            self.committed = self.steps.len();
        }
        if found {
            self.stop = Stop::Found;
        } else if first || lost || departure == self.cycle {
            let next = if first {
                self.unanswered()
            } else {
                (departure + 1).max(self.cycle + AHEAD)
            };
            // Another section may begin before.
            let (index, _) = self.step_at(next);
            let mut until = self.steps.iter().take(index + 1);
            let same = until.all(|s| matches!(s, Step::JerkSegment(_)));
            let departure = if same { next } else { self.cycle + 1 };
            self.seek_from(departure, since);
        }
    }
}
