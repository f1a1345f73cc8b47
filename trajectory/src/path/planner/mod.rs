//! Plans the time parametrisation along the path, window by window.
//!
//! Items are joined to sections: stretches of path without a stop. A section is planned in windows
//! that overlap. Each ends at rest, so that whatever has been handed over is complete; the next one
//! begins in the midst of it, at a jerk segment from which the former end is too far ahead to show, and replaces
//! what comes then ([`Command::ReplaceTail`]). Where windows end depends on the path alone, never on the pace
//! at which items come or commands go.
//!
//! What was planned is kept for a while, so that it can be planned again from any state on it: when
//! the speeds that are asked for change, or after a hold ([`Planner::replan`]).
//!
//! # Why windows
//!
//! A section may be as long as a program, and its optimum depends on all of it; but how it begins depends on what
//! lies further ahead than a stop is long by less than shows. So a window goes about half a second of travel beyond the
//! longest stop, and of it is final what has twice the longest stop between it and the window's end
//! (`the_depth_of_the_window_does_not_show`). The plan that the executor holds ends at rest at every instant, whatever
//! becomes of the planner.
//!
//! # In what order
//!
//! - `joining`: moves become sections: short segments are [fitted](super::segment_fitting), corners
//!   [blended](super::blend),
//! - `shaped`: no faster than a shaper behind the executor lets a curve be followed within its tolerance,
//! - `alternatives`: what they become within lesser tolerances, too, and which of it is passed the soonest,
//! - `section`: path without a stop, and how far a window on it may go,
//! - `windows`: one window: how it is solved, what of it is final, and what bounds the work,
//! - `answer`: plans that the executor asks for from a state of its own: after an override, a hold, for a single block, to
//!   retrace, and to rest.

mod alternatives;
mod answer;
mod joining;
mod section;
mod shaped;
#[cfg(test)]
mod tests;
mod windows;

use std::collections::VecDeque;

use thiserror::Error;

use super::brake::MOST_SEGMENTS;
use super::plan::Plan;
use super::segment_fitting::MoveEnd;
use super::window::{Effort, MOST_CELLS, MOST_WORK, TOO_MANY_CELLS, Window};
use super::{Command, JerkSegment, Limits, Overrides, PathItem, PathSegment, PathState};
use crate::limits::PositionLimits;
use crate::shaper::{Method, Spread};
use alternatives::Alternatives;
use joining::{Joiner, Laid, LaidCurve};
use section::Section;
use shaped::Shaped;

/// Why an item cannot be planned.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum PathError {
    /// The curve does not begin where the last one ended.
    #[error("the move begins {0} mm away from the end of the last one")]
    Gap(f64),
    /// The feed is not a positive number.
    #[error("a feed of {0} mm/s moves nothing")]
    Feed(f64),
    /// The dwell is negative or not a number.
    #[error("a dwell of {0} s")]
    Dwell(f64),
}

/// Gaps up to this are rounding of the caller's, mm.
const GAP: f64 = 1e-6;
/// A part of a curve this small (as a part of it) or of a section (in mm) is rounding.
const NOTHING: f64 = 1e-9;
/// Jerk segments of the last plan that are followed before a window, at most.
const MOST_FOLLOWED: usize = 2 * MOST_CELLS;
/// Steps, and path segments, that come in one commit, at most: what is followed, what slows down, the window,
/// its section and a hold. An [`Executor`](super::Executor) has room for that whenever it rests.
pub(super) const MOST_AT_ONCE: usize = MOST_FOLLOWED + MOST_SEGMENTS + TOO_MANY_CELLS + 2;

/// Turns items into commands. Everything that it has given out up to a [`Command::Commit`] ends
/// at rest.
#[derive(Debug, Clone)]
pub struct Planner<const N: usize> {
    limits: Limits<N>,
    /// Time that is planned beyond what is final, and in all, s of travel at the programmed feed.
    lookahead: f64,
    horizon: f64,
    /// What planning may take until there is a command, cells times Newton steps.
    most_work: usize,
    position: [f64; N],
    /// What moves become within their tolerances.
    joiner: Joiner<N>,
    /// What they become within lesser ones, from where that is not the same.
    alternatives: Alternatives<N>,
    /// What a shaper asks of what is laid, where there is one.
    shaped: Option<Shaped<N>>,
    /// By what method, where that is not each mode's own, and by how much that may leave moves without a tolerance, mm.
    method: Option<Method>,
    exact: f64,
    /// What was planned lately, is under way, and is to be planned.
    items: VecDeque<PlanItem<N>>,
    /// Number of the first of them.
    first: u64,
    /// How many path segments they hold.
    kept: usize,
    /// How many waypoints have their place in `items`.
    placed: u32,
    /// Path length of all sections.
    length: f64,
    /// Of moves that end in the midst of a curve, and are not told yet: where along the path.
    move_ends: VecDeque<MoveEnd>,
    cursor: Cursor,
    account: Account,
    window: Window<N>,
    /// What is followed of the plan that the window's replaces.
    followed: Vec<JerkSegment>,
    /// The plan that the executor was on by the last request, and the one that was its answer.
    plans: [Plan; 2],
    out: VecDeque<Command<N>>,
    /// The retrace that the executor is on, and behind it the one that was planned last.
    retraces: Vec<Retrace<N>>,
    overrides: Overrides,
    /// How many turns a second the spindle makes, where that is known.
    turns: Option<f64>,
    single_block: bool,
    /// The last plan made.
    revision: u64,
}

#[derive(Debug, Clone)]
enum PlanItem<const N: usize> {
    Section(Section<N>),
    Dwell {
        duration: f64,
        tag: u32,
        block: Option<u32>,
    },
    Mark {
        mark: u32,
        /// No retrace leads back over it.
        one_way: bool,
    },
    /// At rest; how many waypoints there are up to here.
    Waypoint(u32),
}

/// A retrace along a section.
#[derive(Debug, Clone)]
struct Retrace<const N: usize> {
    /// Its number.
    number: u64,
    /// The number under which it was asked for.
    asked: u64,
    /// The item that it goes back along, and where on that it begins.
    item: u64,
    from: f64,
    /// The path segments from there, the other way round.
    section: Section<N>,
}

/// Numbers of retraces have this bit set.
const RETRACE: u64 = 1 << 63;

/// How far planning has come.
#[derive(Debug, Clone, Copy, Default)]
struct Cursor {
    /// The item that is being planned.
    item: u64,
    /// Where the next window begins.
    departure: PathState,
    /// The step from which on it replaces the tail of the plan, if it does; steps are counted as the executor counts them.
    tail_from: Option<u64>,
    /// The next step's number.
    step: u64,
    /// The section was announced.
    begun: bool,
    /// Where the last path segment that was handed over begins.
    sent: Option<f64>,
    /// Where the last window came to rest.
    rest: f64,
    /// There the executor holds.
    holds: bool,
    /// How often the next window is halved, so that it comes soon.
    halvings: u32,
}

/// What planning has taken since the path was last seen to be worth it.
#[derive(Debug, Clone, Copy, Default)]
struct Account {
    /// The place on the section then, mm.
    distance: f64,
    /// What planning had taken up to then, as [`Effort::work`].
    work: usize,
}

impl Cursor {
    /// The next window begins where the last one rests.
    fn begin_at_rest(&mut self) {
        self.departure = PathState {
            distance: self.rest,
            ..PathState::default()
        };
        self.tail_from = None;
    }
}

/// How often the window that answers a request is halved; those behind it are ever longer.
const ANSWER_HALVINGS: u32 = 2;
/// So much of such a window is kept, s: time to plan the next one. Its own end is too far ahead to show until then.
const ANSWER_KEPT: f64 = 0.06;

/// See [`Planner::KEPT`]; it does not depend on the number of axes.
const KEPT: usize = Planner::<0>::KEPT;

impl<const N: usize> Planner<N> {
    /// Path segments, dwells and marks that are kept at least: what an executor and the queue to it may
    /// hold, and what can be stepped back. Of those passed no more than that are kept.
    pub const KEPT: usize = 16_384;

    /// For a machine with `limits` that rests in `position`.
    pub fn new(limits: Limits<N>, position: [f64; N]) -> Self {
        let stop = (0..N)
            .map(|i| {
                limits.velocity[i] / limits.acceleration[i]
                    + limits.acceleration[i] / limits.jerk[i]
            })
            .fold(0.0, f64::max);
        let lookahead = LOOKAHEAD * stop;
        Planner {
            limits,
            lookahead,
            horizon: lookahead + lookahead.max(LEAST_TRAVEL),
            most_work: MOST_WORK,
            position,
            joiner: Joiner::new(limits),
            shaped: None,
            method: None,
            exact: 0.0,
            alternatives: Alternatives::default(),
            items: VecDeque::new(),
            first: 0,
            kept: 0,
            placed: 0,
            length: 0.0,
            move_ends: VecDeque::new(),
            cursor: Cursor::default(),
            account: Account::default(),
            window: Window::default(),
            followed: Vec::new(),
            plans: <[Plan; 2]>::default(),
            out: VecDeque::new(),
            retraces: Vec::new(),
            overrides: Overrides::default(),
            turns: None,
            single_block: false,
            revision: 0,
        }
    }

    /// From now on no rounding, and no curve in place of short segments, leaves these positions; where one
    /// would, the path follows what is programmed and stops if need be. The moves themselves are the
    /// caller's to check.
    pub fn keep_within(&mut self, bounds: [PositionLimits; N]) {
        self.joiner.bounds = bounds;
    }

    /// From now on the setpoints are shaped, by that method, or by that of each [mode](super::PathControlMode::method); where it
    /// changes the path stops. Before the first item.
    ///
    /// - By coordinates they leave the path, and that, together with what the planner rounds off, stays within each move's
    ///   tolerance; moves without one, as those that end at rest, may be left by `exact` mm. Curves are followed no faster than
    ///   that takes, and where the path stops between two moves it rests until the axes do.
    /// - By the clock they stay on it, and the axes keep their limits where they are then. That the path does not go on
    ///   behind a stop before the axes rest is the executor's affair ([`Executor::settle`](super::Executor::settle)).
    pub fn shape_by(&mut self, spread: Spread, method: Option<Method>, exact: f64) {
        let first = method.unwrap_or(Method::Coordinates);
        self.joiner.shaper = Some((spread, first));
        self.shaped = Some(Shaped::new(spread, first));
        (self.method, self.exact) = (method, exact);
    }

    /// Takes the next item.
    ///
    /// # Errors
    /// See [`PathError`]; the item is not taken then.
    pub fn push(&mut self, item: PathItem<N>) -> Result<(), PathError> {
        match item {
            PathItem::Dwell { duration, .. } if !(duration >= 0.0 && duration.is_finite()) => {
                return Err(PathError::Dwell(duration));
            }
            PathItem::Dwell {
                duration,
                tag,
                block,
            } => {
                self.close();
                self.items.push_back(PlanItem::Dwell {
                    duration,
                    tag,
                    block,
                });
            }
            PathItem::Move(motion) => {
                let feed = motion.feed.speed();
                if feed.is_nan() || feed <= 0.0 {
                    return Err(PathError::Feed(feed));
                }
                let start = motion.curve.start();
                let gap = (0..N)
                    .map(|i| (start[i] - self.position[i]).abs())
                    .fold(0.0, f64::max);
                if gap.is_nan() || gap > GAP {
                    return Err(PathError::Gap(gap));
                }
                self.position = motion.curve.end();
                self.push_move(motion);
            }
        }
        Ok(())
    }

    /// The path rests here until [`mark`](super::Executor::mark) is [passed](super::Executor::pass).
    pub fn mark(&mut self, mark: u32) {
        self.close();
        let one_way = false;
        self.items.push_back(PlanItem::Mark { mark, one_way });
    }

    /// As [`mark`](Self::mark), and no [retrace](super::Executor::retrace) leads back over it. While the path rests at
    /// it none may be asked for.
    pub fn one_way_mark(&mut self, mark: u32) {
        self.close();
        let one_way = true;
        self.items.push_back(PlanItem::Mark { mark, one_way });
    }

    /// A place that the path passes without a stop, between the items before and those to come: it
    /// counts in [`Executor::waypoints`](super::Executor::waypoints) once the path has come to it. Moves
    /// before and behind it do not become one.
    pub fn waypoint(&mut self) {
        self.for_each_joiner(|joiner| {
            joiner.join_short_segments();
            joiner.waypoints += 1;
        });
        self.take_laid();
        if self.joiner.pending.is_none() {
            self.place_waypoints();
        }
    }

    /// The next move that ends in the midst of a curve, of one that stands for many or of a rounding: where,
    /// by [`Setpoint::distance`]. A setpoint on it has the tag of another one of its moves, so that this
    /// tells which of them it is on. It is known before the [`pop`](Self::pop) that hands over that curve.
    ///
    /// [`Setpoint::distance`]: super::Setpoint::distance
    pub fn move_end(&mut self) -> Option<MoveEnd> {
        self.move_ends.pop_front()
    }

    /// What planning took so far.
    pub fn effort(&self) -> Effort {
        self.window.effort() + self.alternatives.effort()
    }

    /// No further item comes for now: whatever was taken is planned to rest.
    pub fn finish(&mut self) {
        self.close();
    }

    /// The next command; plans a window if none is ready. None where the next window needs more
    /// items, or [`finish`](Self::finish).
    pub fn pop(&mut self) -> Option<Command<N>> {
        if self.out.is_empty() {
            self.window.grant(self.most_work);
            self.plan_on();
        }
        self.out.pop_front()
    }

    fn close(&mut self) {
        self.for_each_joiner(|joiner| {
            joiner.join_short_segments();
            joiner.rest_here();
        });
        self.take_laid();
        self.place_waypoints();
    }

    /// What the moves became, as fast as a shaper allows.
    fn lay(&mut self, laid: Laid<N>) {
        let Some(shaped) = &mut self.shaped else {
            return self.extend(laid);
        };
        shaped.take(laid, &self.limits);
        while let Some(laid) = self.shaped.as_mut().and_then(Shaped::next) {
            self.extend(laid);
        }
    }

    /// The section goes on; if there is none, one begins.
    fn extend(&mut self, laid: Laid<N>) {
        match laid {
            Laid::Curve(curve) => self.lay_curve(curve),
            Laid::Ends(length, ends) => {
                let start = self.length - length;
                self.tell_move_ends(start, &ends);
                if let Some(PlanItem::Section(section)) = self.items.back_mut() {
                    section.end_in_rounding(length, &ends);
                }
            }
            Laid::Rest => {
                if let Some(PlanItem::Section(section)) = self.items.back_mut() {
                    section.close();
                }
            }
            Laid::Settle(tag) => {
                let duration = self.shaped.as_ref().map_or(0.0, Shaped::settling);
                self.items.push_back(PlanItem::Dwell {
                    duration,
                    tag,
                    block: None,
                });
            }
        }
    }

    fn lay_curve(&mut self, laid: LaidCurve<N>) {
        if !matches!(self.items.back(), Some(PlanItem::Section(section)) if !section.closed) {
            self.items.push_back(PlanItem::Section(Section {
                path_segments: Vec::new(),
                ends: VecDeque::new(),
                origin: self.length,
                length: 0.0,
                closed: false,
            }));
        }
        self.tell_move_ends(self.length, &laid.ends);
        self.placed = laid.waypoints;
        let mut path_segment = PathSegment::from(&laid);
        if self.overrides != Overrides::default() || self.turns.is_some() {
            ask(&mut path_segment, self.overrides, self.turns, &self.limits);
        }
        if let Some(PlanItem::Section(section)) = self.items.back_mut() {
            section.push(path_segment, &laid.ends);
            self.length = section.origin + section.length;
            self.kept += 1;
        }
    }

    /// Moves that end at these distances from a place of the path.
    fn tell_move_ends(&mut self, from: f64, ends: &[MoveEnd]) {
        self.move_ends.extend(ends.iter().map(|end| MoveEnd {
            at: from + end.at,
            ..*end
        }));
    }

    /// Waypoints behind which no move came are passed at rest.
    fn place_waypoints(&mut self) {
        let waypoints = self.joiner.waypoints;
        if self.placed < waypoints {
            self.placed = waypoints;
            self.items.push_back(PlanItem::Waypoint(waypoints));
        }
    }

    /// The section with that number, of the plan or of a retrace.
    fn section(&self, number: u64) -> Option<&Section<N>> {
        if let Some(retrace) = self
            .retraces
            .iter()
            .find(|retrace| retrace.number == number)
        {
            return Some(&retrace.section);
        }
        match self.item(number) {
            Some(PlanItem::Section(section)) => Some(section),
            _ => None,
        }
    }

    fn item(&self, number: u64) -> Option<&PlanItem<N>> {
        let index = number.checked_sub(self.first)?;
        self.items.get(index as usize)
    }

    /// From now on these parts of the programmed speeds are asked for, at so many turns a second of the spindle.
    fn override_speeds(&mut self, overrides: Overrides, turns: Option<f64>) {
        if (overrides, turns) == (self.overrides, self.turns) {
            return;
        }
        (self.overrides, self.turns) = (overrides, turns);
        let sections = self.items.iter_mut().filter_map(|item| match item {
            PlanItem::Section(section) => Some(section),
            _ => None,
        });
        let back = self.retraces.iter_mut().map(|retrace| &mut retrace.section);
        for section in sections.chain(back) {
            for path_segment in &mut section.path_segments {
                ask(path_segment, overrides, turns, &self.limits);
            }
        }
    }

    /// Planning goes on with that item; items long passed are forgotten.
    fn begin_item(&mut self, item: u64) {
        self.window.faster.clear();
        self.cursor = Cursor {
            item,
            step: self.cursor.step,
            holds: self.cursor.holds,
            ..Cursor::default()
        };
        self.account = Account::open(0.0, &self.window);
        while self.kept + self.items.len() > KEPT && self.first + 1 < item && item < RETRACE {
            if let Some(PlanItem::Section(section)) = self.items.pop_front() {
                self.kept -= section.path_segments.len();
            }
            self.first += 1;
        }
    }

    /// Plans until there is a command, as far as the path is known.
    fn plan_on(&mut self) {
        while self.out.is_empty() && !self.cursor.holds {
            let number = self.cursor.item;
            match self.item(number) {
                Some(&PlanItem::Dwell {
                    duration,
                    tag,
                    block,
                }) => {
                    self.out.extend([
                        Command::Dwell {
                            item: number,
                            duration,
                            tag,
                            block,
                        },
                        Command::Commit,
                    ]);
                    self.cursor.step += 1;
                    self.begin_item(number + 1);
                }
                Some(&PlanItem::Mark { mark, .. }) => {
                    self.out
                        .extend([Command::Mark { item: number, mark }, Command::Commit]);
                    self.cursor.step += 1;
                    self.begin_item(number + 1);
                }
                Some(&PlanItem::Waypoint(waypoints)) => {
                    let waypoint = Command::Waypoint {
                        item: number,
                        waypoints,
                    };
                    self.out.extend([waypoint, Command::Commit]);
                    self.cursor.step += 1;
                    self.begin_item(number + 1);
                }
                Some(PlanItem::Section(_)) | None => {
                    let Some(section) = self.section(number) else {
                        return;
                    };
                    let ahead = section.time_from(self.cursor.departure.distance, &self.limits);
                    if !section.closed && (ahead == 0.0 || ahead < self.horizon) {
                        return;
                    }
                    if self.plan_window(None) {
                        self.begin_item(number + 1);
                    }
                }
            }
        }
    }
}

/// Asks for a path speed on a path segment after overrides, at so many turns a second of the spindle.
fn ask<const N: usize>(
    path_segment: &mut PathSegment<N>,
    overrides: Overrides,
    turns: Option<f64>,
    limits: &Limits<N>,
) {
    path_segment.asked = if path_segment.feed.is_finite() {
        let part = turns.zip(path_segment.turns);
        path_segment.feed * overrides.feed * part.map_or(1.0, |(is, told)| is / told)
    } else if overrides.rapid < 1.0 {
        let [d1, _, _] = path_segment.curve.derivative_bounds();
        let axes = (0..N)
            .map(|i| limits.velocity[i] / d1[i])
            .fold(f64::INFINITY, f64::min);
        axes * overrides.rapid
    } else {
        f64::INFINITY
    };
    path_segment.speed = path_segment.asked.min(path_segment.most);
}

/// Travel that a window plans beyond its lookahead, s, at least: time to plan the next one meanwhile.
const LEAST_TRAVEL: f64 = 0.5;
/// A window sees this many times the longest stop of an axis beyond what is final.
const LOOKAHEAD: f64 = 2.0;
