//! Plans one window of a section: chooses how, solves, and hands over what was found.
//!
//! A window begins at rest, in the midst of the window before, or in the state that the executor asks
//! for, and ends at rest. First it is [chosen](Task::choose) where it begins and what it may be solved
//! by; then those [strategies](Strategy) are tried in turn, the best first. Where none finds anything
//! there are two plans that need no search: what was handed over ends at rest, and from there it can
//! always go on; and from rest a segment is crawled along inside bounds that hold everywhere on it.
//! For a request of the executor neither is an answer: it asks again from another state.
//!
//! These two are also what keeps the work bounded, counted in cells times Newton steps so that it is the
//! same on every host. One call spends no more than an allowance; then none is solved for any more. And all
//! calls along a section together spend no more than the path is [worth](Section::worth), in proportion to
//! its segments and to the time that crawling along them takes, and a credit: windows that come
//! forward by less and less, each with as many cells, run out of it. Then the path rests, is crawled
//! along to the end of the segment, and there is a new credit. So every credit that is used up brings the path to
//! the end of a segment at least.
//!
//! How much of a window is final, and where the next one begins, follows from how far ahead its end
//! is: from there on it would be another one if more of the path were seen.

use std::collections::VecDeque;
use std::mem::{replace, swap, take};

use super::section::{block_end, reach};
use super::{ANSWER_KEPT, Account, Cursor, NOTHING, PlanItem, Planner, RETRACE, Retrace, Section};
use crate::path::brake::{brake, brake_gently};
use crate::path::override_transition::{Attempt, lay_transition, minima, overshoots};
use crate::path::plan::{Plan, PlannedSegment};
use crate::path::window::{Window, room_to_stop};
use crate::path::{Command, JerkSegment, Limits, PathSegment, PathState};

/// Part of the speed that is asked for to which it is brought down, so that rounding stays inside.
const SLOWED: f64 = 1.0 - 1e-4;
/// How often the speed to come down to is lowered at most because less is asked for where it is reached.
const TARGETS: usize = 4;
/// States of the last plan that a window is tried from before the plan is followed to its end.
const ATTEMPTS: usize = 4;
/// What may be spent before it is set against the path, cells times Newton steps.
pub(super) const CREDIT: usize = 1_000_000;
/// How often a limit that falls gently is lowered at most.
const LIMITS_LOWERED: usize = 4;

/// A window begins earlier where the acceleration is less than this part.
const CALMER: f64 = 0.5;

/// A window that is to be planned.
struct Task<'a, const N: usize> {
    /// Those from its departure on.
    path_segments: &'a [PathSegment<N>],
    limits: &'a Limits<N>,
    departure: PathState,
    /// Where the window itself begins: at the departure, or where it has slowed down.
    from: PathState,
    /// From the departure to there.
    slowing: Vec<JerkSegment>,
    /// The path rests there at the latest.
    stop: f64,
    /// Where a limit of the speed that falls gently leads to rest.
    gentle_stop: Option<f64>,
    /// Time that is planned, s, and how often that is halved.
    horizon: f64,
    halvings: u32,
    /// How it answers a request, and the old plan from there.
    answer: Option<(Attempt, &'a [PlannedSegment])>,
    /// The step from which on it replaces the tail of the plan.
    tail_from: Option<u64>,
}

/// How a window may be found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Strategy {
    /// On the straight end of a section there is a closed form, from any state; it is found already.
    ClosedForm,
    /// The slowing down ends at rest.
    Stay,
    /// As far ahead as the horizon; where a short window has no solution a longer one may have.
    Ahead,
    /// It slows down for what lies ahead before it is as slow as is asked for.
    SlowForBends,
    /// From a little later on the last plan.
    Later,
}

impl Strategy {
    fn solve<const N: usize>(self, task: &mut Task<N>, window: &mut Window<N>) -> bool {
        match self {
            Self::ClosedForm => true,
            Self::Stay => {
                window.stay();
                task.from.speed == 0.0
            }
            Self::Ahead => task.plan_ahead(window),
            Self::SlowForBends => task.slow_for_bends(window),
            Self::Later => task.plan_later(window),
        }
    }
}

impl<const N: usize> Task<'_, N> {
    /// Where the window begins and rests at the latest, and what is tried to find it. None if an
    /// answer cannot slow down as it should.
    fn choose(
        &mut self,
        section: &Section<N>,
        blocks: Blocks,
        window: &mut Window<N>,
    ) -> Option<&'static [Strategy]> {
        let no_speed = self.path_segments.iter().find(|s| s.speed <= 0.0);
        self.stop = no_speed.map_or(f64::INFINITY, |s| s.start);
        let one_block = blocks != Blocks::Single
            || block_end(section, self.path_segments, self.from, self.limits) >= section.length;
        let straight = self.path_segments.len() == 1
            && section.closed
            && one_block
            && no_speed.is_none()
            && self.path_segments[0].direction().is_some()
            && (window.straight(&self.path_segments[0], self.limits, self.departure)).is_ok();
        if !straight && !self.slow_down(window) {
            return None;
        }
        self.stop = self.stop.min(match blocks {
            Blocks::Backward => section.length,
            Blocks::Single => block_end(section, self.path_segments, self.from, self.limits),
            Blocks::All => f64::INFINITY,
        });
        Some(if straight {
            &[Strategy::ClosedForm]
        } else if self.is_there() {
            &[Strategy::Stay]
        } else if self.answer.is_some() {
            &[Strategy::Ahead, Strategy::SlowForBends]
        } else {
            &[Strategy::Ahead, Strategy::Later]
        })
    }

    /// An answer may begin faster than is asked for: it slows down first, or under a limit that falls
    /// gently. False if it cannot.
    fn slow_down(&mut self, window: &mut Window<N>) -> bool {
        let Some((attempt, old)) = self.answer else {
            return true;
        };
        if attempt.gently {
            let limit = &mut window.faster;
            self.gentle_stop =
                lay_transition(self.path_segments, self.limits, self.departure, old, limit);
            !limit.is_empty()
        } else {
            lay_slowing(
                self.path_segments,
                self.limits,
                &mut self.from,
                &mut self.slowing,
            )
        }
    }

    /// Where the window ends if its time is halved so often.
    fn end(&self, halvings: u32) -> f64 {
        let known = (self.path_segments.last()).map_or(0.0, |s| s.start + s.curve.length());
        let time = self.horizon / f64::from(1_u32 << halvings);
        let room = self.from.distance + room_to_stop(self.path_segments, self.limits, self.from);
        let end = reach(self.path_segments, self.from.distance, time, self.limits).max(room);
        (self.gentle_stop).unwrap_or(end.min(self.stop)).min(known)
    }

    /// The window begins where it ends, or before that by no more than distances along the path are rounded by.
    fn is_there(&self) -> bool {
        self.end(self.halvings) <= self.from.distance + NOTHING
    }

    /// The path rests where the window is to begin, and does not go on.
    fn is_over(&self) -> bool {
        let rests = self.slowing.is_empty() && self.from.speed == 0.0;
        rests && self.is_there()
    }

    fn plan(&self, window: &mut Window<N>, halvings: u32) -> bool {
        let end = self.end(halvings);
        window
            .plan(self.path_segments, self.limits, self.from, end, halvings)
            .is_ok()
    }

    fn plan_ahead(&mut self, window: &mut Window<N>) -> bool {
        // An answer has to come soon: it is not tried longer.
        let shortest = match self.answer {
            Some(_) => self.halvings,
            None => 0,
        };
        let mut halvings = (shortest..=self.halvings).rev();
        let planned = halvings.any(|halvings| self.plan(window, halvings));
        let gently = self.answer.is_some_and(|(attempt, _)| attempt.gently);
        if planned && gently {
            self.keep_falling(window)
        } else {
            planned
        }
    }

    /// Where it goes slower for a bend it must not rise again to the limit that falls: that is lowered
    /// to what was found. False if nothing is left of it.
    fn keep_falling(&mut self, window: &mut Window<N>) -> bool {
        for _ in 0..LIMITS_LOWERED {
            let found = window.planned();
            if !overshoots(&found, self.path_segments) {
                break;
            }
            let kept = &found[..minima(&found).next().unwrap_or(0)];
            let mut limit = Vec::new();
            let lower = lay_transition(
                self.path_segments,
                self.limits,
                self.departure,
                &found,
                &mut limit,
            );
            swap(&mut window.faster, &mut limit);
            window.recall(kept);
            let before = replace(&mut self.gentle_stop, lower);
            if !self.plan(window, self.halvings) {
                self.gentle_stop = before;
                window.faster = limit;
                window.recall(kept);
                return self.plan(window, self.halvings);
            }
        }
        true
    }

    fn slow_for_bends(&mut self, window: &mut Window<N>) -> bool {
        if self.slowing.is_empty() {
            return false;
        }
        self.from = self.departure;
        window.faster.clone_from(&self.slowing);
        self.slowing.clear();
        self.plan(window, self.halvings)
    }

    fn plan_later(&mut self, window: &mut Window<N>) -> bool {
        for _ in 1..ATTEMPTS {
            let Some(step) = &mut self.tail_from else {
                return false;
            };
            let Some((segments, later)) = window.later(self.from) else {
                return false;
            };
            *step += segments;
            self.from = later;
            if self.end(0) > later.distance && self.plan(window, 0) {
                return true;
            }
        }
        false
    }
}

/// Which blocks a window may go along.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Blocks {
    /// Those of a retrace.
    Backward,
    /// The one under way.
    Single,
    /// All.
    All,
}

/// What was found, to be handed over.
struct Found {
    /// Where it begins on the section.
    begin: f64,
    /// Where the path rests at the latest.
    stop: f64,
    /// What precedes the window: followed of the plan before, and slowing down.
    ahead: Vec<JerkSegment>,
    /// The window's.
    planned: Vec<PlannedSegment>,
    halvings: u32,
}

impl<const N: usize> Planner<N> {
    /// Plans the next window of the section under way; the first that is asked for anew as that attempt
    /// says, from a state that may be faster than what is asked for and on the old plan from there. True
    /// if that reaches the section's end.
    pub(super) fn plan_window(&mut self, answer: Option<(Attempt, &[PlannedSegment])>) -> bool {
        let followed = take(&mut self.followed);
        let number = self.cursor.item;
        let blocks = match number {
            RETRACE.. => Blocks::Backward,
            _ if self.single_block => Blocks::Single,
            _ => Blocks::All,
        };
        let index = number.checked_sub(self.first);
        let item = index.and_then(|index| self.items.get_mut(index as usize));
        let Some(section) = section_of(item, &mut self.retraces, number) else {
            return true;
        };
        let departure = self.cursor.departure;
        if departure.distance >= section.length - NOTHING {
            return section.closed;
        }
        let begin = (followed.first()).map_or(departure.distance, |segment| segment.distance);
        if blocks != Blocks::Backward {
            self.kept -= section.forget_before(begin);
        }
        let section = &*section;
        let mut task = Task {
            path_segments: section.from(departure.distance),
            limits: &self.limits,
            departure,
            from: departure,
            slowing: Vec::new(),
            stop: f64::INFINITY,
            gentle_stop: None,
            horizon: self.horizon,
            halvings: self.cursor.halvings,
            answer,
            tail_from: self.cursor.tail_from,
        };
        let Some(strategies) = task.choose(section, blocks, &mut self.window) else {
            return false;
        };
        self.cursor.halvings = 0;
        if task.is_over() {
            self.out.extend([Command::Hold, Command::Commit]);
            self.cursor.step += 1;
            self.cursor.holds = true;
            return false;
        }
        let window = &mut self.window;
        let at = departure.distance;
        if answer.is_none() && !(self.account).is_worth(section, at, window, &self.limits) {
            window.grant(0);
        }
        let planned = (strategies.iter()).any(|strategy| strategy.solve(&mut task, window));
        self.cursor.tail_from = task.tail_from;
        if !planned {
            if answer.is_some() {
                return false;
            }
            if departure.speed > 0.0 {
                // What was handed over ends at rest further on.
                self.cursor.begin_at_rest();
                return section.ends_at(self.cursor.rest);
            }
            window.crawl(task.path_segments, departure.distance, &self.limits);
            self.account = Account::open(at, window);
        }
        let mut ahead = followed;
        ahead.append(&mut task.slowing);
        let found = Found {
            begin,
            stop: task.stop,
            ahead,
            planned: window.planned(),
            halvings: task.halvings,
        };
        let Some(first) = found.hand_over(
            section,
            &self.limits,
            &mut self.cursor,
            &mut self.plans[1],
            &mut self.out,
        ) else {
            return false;
        };
        let over = section.ends_at(self.cursor.rest);
        if !over {
            found.go_on_from(first, self.lookahead, &mut self.cursor);
        }
        over
    }
}

impl Account {
    /// What is planned from there on is set against the path from there on.
    pub(super) fn open<const N: usize>(distance: f64, window: &Window<N>) -> Self {
        Account {
            distance,
            work: window.effort().work,
        }
    }

    /// Whether the path up to a distance is worth what planning has taken for it, or that is still little.
    fn is_worth<const N: usize>(
        &mut self,
        section: &Section<N>,
        distance: f64,
        window: &Window<N>,
        limits: &Limits<N>,
    ) -> bool {
        let spent = window.effort().work - self.work;
        if spent < CREDIT {
            return true;
        }
        let worth = section.worth(self.distance, distance, limits);
        let is_worth = (spent as f64) < worth;
        if is_worth {
            *self = Account::open(distance, window);
        }
        is_worth
    }
}

/// The section with that number: an item of the plan, or a retrace.
fn section_of<'a, const N: usize>(
    item: Option<&'a mut PlanItem<N>>,
    retraces: &'a mut [Retrace<N>],
    number: u64,
) -> Option<&'a mut Section<N>> {
    match item {
        Some(PlanItem::Section(section)) => Some(section),
        Some(_) => None,
        None => {
            let retrace = retraces.iter_mut().find(|it| it.number == number)?;
            Some(&mut retrace.section)
        }
    }
}

impl Found {
    /// Hands it over; the number of the window's first step, none if there is nothing.
    fn hand_over<const N: usize>(
        &self,
        section: &Section<N>,
        limits: &Limits<N>,
        cursor: &mut Cursor,
        plan: &mut Plan,
        out: &mut VecDeque<Command<N>>,
    ) -> Option<u64> {
        let last =
            (self.planned.last()).map_or(self.ahead.last(), |planned| Some(&planned.segment));
        let rest = last?.end();
        if !cursor.begun {
            out.push_back(Command::Section {
                item: cursor.item,
                origin: section.origin,
                backward: cursor.item >= RETRACE,
                limits: *limits,
            });
            cursor.begun = true;
            cursor.step += 1;
        }
        if let Some(step) = cursor.tail_from {
            out.push_back(Command::ReplaceTail(step));
            cursor.step = step;
        }
        // What begins where the path was known to end is at one place with that rest but for rounding.
        let path_segments = section.from(self.begin).iter();
        for path_segment in path_segments.take_while(|s| s.start < rest) {
            if cursor.sent.is_none_or(|last| path_segment.start > last) {
                out.push_back(Command::PathSegment(*path_segment));
                cursor.sent = Some(path_segment.start);
            }
        }
        let ahead = self
            .ahead
            .iter()
            .map(|&segment| PlannedSegment::from(segment));
        for (step, planned) in (cursor.step..).zip(ahead.chain(self.planned.iter().copied())) {
            out.push_back(Command::JerkSegment(planned.segment));
            plan.push(cursor.item, step, planned);
        }
        cursor.holds = rest >= self.stop - NOTHING;
        if cursor.holds {
            out.push_back(Command::Hold);
        }
        out.push_back(Command::Commit);
        cursor.rest = rest;
        let first = cursor.step + self.ahead.len() as u64;
        cursor.step = first + self.planned.len() as u64;
        Some(first)
    }

    /// The next window begins where this one's end is too far ahead to show. Half of it is kept in any case, of
    /// a short one less.
    fn go_on_from(&self, first: u64, lookahead: f64, cursor: &mut Cursor) {
        let segments = &self.planned;
        if segments.is_empty() {
            cursor.begin_at_rest();
            return;
        }
        let half = segments.len() / 2;
        let mut time = (self.ahead.iter())
            .map(|segment| segment.duration)
            .sum::<f64>();
        let soon = segments.iter().position(|PlannedSegment { segment, .. }| {
            time += segment.duration;
            time >= ANSWER_KEPT
        });
        let least = match soon {
            Some(soon) if self.halvings > 0 => half.min(soon + 1),
            _ => half,
        };
        let mut left = 0.0;
        let mut keep = segments.len() - 1;
        while keep > least && left < lookahead {
            left += segments[keep].segment.duration;
            keep -= 1;
        }
        // The calmer the state, the easier it is to go on from.
        let acceleration = |k: usize| segments[k].segment.acceleration.abs();
        for k in (least..keep).rev() {
            if acceleration(k) < CALMER * acceleration(keep) {
                keep = k;
            }
        }
        cursor.departure = PathState::from(segments[keep].segment);
        cursor.tail_from = Some(first + keep as u64);
        cursor.halvings = self.halvings.saturating_sub(1);
    }
}

/// Lays the jerk segments that bring `from` down to a state from where the path goes on at the speeds that
/// are asked for; none if it is one. False if none were found.
fn lay_slowing<const N: usize>(
    path_segments: &[PathSegment<N>],
    limits: &Limits<N>,
    from: &mut PathState,
    segments: &mut Vec<JerkSegment>,
) -> bool {
    let mut target = path_segments[0].speed;
    let first = &path_segments[0];
    let along = first.slope(from.distance - first.start).d1;
    let jerk = (0..N)
        .map(|i| first.limits(limits).jerk[i] / along[i].abs())
        .fold(f64::INFINITY, f64::min);
    // The speed must come down to what is asked for where it has come down.
    for _ in 0..TARGETS {
        let goal = target * SLOWED;
        let rising = from.acceleration.max(0.0);
        if from.speed + rising * rising / (2.0 * jerk) <= target {
            return true;
        }
        let braking = brake(|k| path_segments.get(k), limits, *from, goal)
            .or_else(|| brake_gently(&path_segments[0], limits, *from, goal));
        let Some(braking) = braking else {
            return false;
        };
        let lowest = path_segments
            .iter()
            .take_while(|s| s.start <= braking.end.distance)
            .map(|s| s.speed)
            .fold(target, f64::min);
        if lowest >= target {
            segments.extend_from_slice(braking.segments());
            *from = braking.end;
            return true;
        }
        target = lowest;
    }
    false
}
