//! Plans the time parametrisation along the path, window by window.
//!
//! Items are joined to sections: stretches of path without a stop. A section is planned in windows
//! that overlap. Each ends at rest, so that whatever has been handed over is complete; the next one
//! begins in the midst of it, at a piece from which the former end is out of sight, and replaces
//! the rest ([`Command::ReplaceTail`]). Where windows end depends on the path alone, never on the pace
//! at which items come or commands go.
//!
//! What was planned is kept for a while, so that it can be planned again from any state on it: when
//! the speeds that are asked for change, or after a hold ([`Planner::replan`]).

use std::collections::VecDeque;
use std::mem::take;

use thiserror::Error;

use crate::limits::PositionLimits;

use super::blend::{Blend, blend};
use super::brake::{MOST_PIECES, brake, brake_gently};
use super::override_transition::{Attempt, attempts, lay_transition, minima, overshoots};
use super::plan::{Laid, Plan, follow};
use super::segment_fitting::{Part, ShortSegments};
use super::window::{Effort, MOST_CELLS, TOO_MANY_CELLS, Window, room_to_stop};
use super::{
    Command, Curve, JerkSegment, Limits, Move, Overrides, PathItem, PathSegment, PathState,
    ReplanRequest,
};

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
/// Tangents, and curvatures by the mm or as parts of the greater, that differ by no more are equal.
const SMOOTH: f64 = 1e-10;
/// A part of a curve this small (as a part of it) or of a section (in mm) is rounding.
const NOTHING: f64 = 1e-9;
/// Parts of the tolerance that a rounding is tried with, so that it stays between the positions
/// allowed.
const LESSER: [f64; 4] = [1.0, 0.25, 0.0625, 0.015625];
/// States of the last plan that a window is tried from before the plan is followed to its end.
const ATTEMPTS: usize = 4;
/// States of the last plan from which a way to rest is tried, and the time between them, s.
const RESTS: usize = 4;
const FOLLOWED: f64 = 0.002;
/// How often a limit that falls gently is lowered at most.
const LIMITS_LOWERED: usize = 4;
/// Pieces of the last plan that are followed before a window, at most.
const MOST_FOLLOWED: usize = 2 * MOST_CELLS;
/// Steps, and spans, that come in one commit, at most: what is followed, what slows down, the window,
/// its section and a hold. An [`Executor`](super::Executor) has room for that whenever it rests.
pub(super) const MOST_AT_ONCE: usize = MOST_FOLLOWED + MOST_PIECES + TOO_MANY_CELLS + 2;
/// Spans in a window, at most.
const WINDOW_SPANS: usize = 1024;

/// Turns items into commands. Everything that it has given out up to a [`Command::Commit`] ends
/// at rest.
#[derive(Debug, Clone)]
pub struct Planner<const N: usize> {
    limits: Limits<N>,
    /// Positions that curves of its own stay between.
    bounds: [PositionLimits; N],
    /// Time that is planned beyond what is final, and in all, s of travel at the programmed feed.
    lookahead: f64,
    horizon: f64,
    position: [f64; N],
    /// Short segments that may go on.
    short_segments: Option<ShortSegments<N>>,
    /// The last move, and how much of its start a blend took.
    pending: Option<(Move<N>, f64)>,
    /// How far that strays from what was programmed, mm.
    deviation: f64,
    /// What was planned lately, is under way, and is to be planned.
    items: VecDeque<PlanItem<N>>,
    /// Number of the first of them.
    first: u64,
    /// How many spans they hold.
    kept: usize,
    /// Path length of all sections.
    length: f64,
    cursor: Cursor,
    window: Window<N>,
    /// Slowing down that precedes the window.
    slowing: Vec<JerkSegment>,
    /// What is followed of the plan that the window's replaces.
    followed: Vec<JerkSegment>,
    /// The plan that the executor was on by the last request, and the one that was its answer.
    plans: [Plan; 2],
    out: VecDeque<Command<N>>,
    /// The way back that the executor is on, and behind it the one that was planned last.
    ways_back: Vec<Back<N>>,
    overrides: Overrides,
    single_block: bool,
    /// The last plan made.
    revision: u64,
}

#[derive(Debug, Clone)]
enum PlanItem<const N: usize> {
    Section(Section<N>),
    Dwell { duration: f64, tag: u32 },
    Mark(u32),
}

/// Path without a stop.
#[derive(Debug, Clone)]
struct Section<const N: usize> {
    /// Those not forgotten yet.
    spans: Vec<PathSegment<N>>,
    /// Path length from the beginning of everything.
    origin: f64,
    length: f64,
    /// No more spans come.
    closed: bool,
}

/// A way back along a section.
#[derive(Debug, Clone)]
struct Back<const N: usize> {
    /// Its number.
    number: u64,
    /// The number under which it was asked for.
    asked: u64,
    /// The item that it goes back along, and where on that it begins.
    item: u64,
    from: f64,
    /// The spans from there, the other way round.
    section: Section<N>,
}

/// Numbers of ways back have this bit set.
const BACK: u64 = 1 << 63;

/// How far planning has come.
#[derive(Debug, Clone, Copy, Default)]
struct Cursor {
    /// The item that is being planned.
    item: u64,
    /// Where the next window begins.
    departure: PathState,
    /// The step that it replaces, if one; steps are counted as the executor counts them.
    splice: Option<u64>,
    /// The next step's number.
    step: u64,
    /// The section was announced.
    begun: bool,
    /// Up to where spans were handed over.
    sent: f64,
    /// Where the last window came to rest.
    rest: f64,
    /// There the executor holds.
    holds: bool,
    /// How often the next window is halved, so that it comes soon.
    halvings: u32,
}

/// How often the window that answers a request is halved; those behind it are ever longer.
const ANSWER_HALVINGS: u32 = 2;
/// So much of such a window is kept, s: time to plan the next one. Its own end is out of sight until then.
const ANSWER_KEPT: f64 = 0.06;

/// See [`Planner::KEPT`]; it does not depend on the number of axes.
const KEPT: usize = Planner::<0>::KEPT;

impl<const N: usize> Planner<N> {
    /// Spans, dwells and marks that are kept at least: what an executor and the queue to it may
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
            bounds: [PositionLimits {
                min: f64::NEG_INFINITY,
                max: f64::INFINITY,
            }; N],
            lookahead,
            horizon: lookahead + lookahead.max(0.5),
            position,
            short_segments: None,
            pending: None,
            deviation: 0.0,
            items: VecDeque::new(),
            first: 0,
            kept: 0,
            length: 0.0,
            cursor: Cursor::default(),
            window: Window::default(),
            slowing: Vec::new(),
            followed: Vec::new(),
            plans: <[Plan; 2]>::default(),
            out: VecDeque::new(),
            ways_back: Vec::new(),
            overrides: Overrides::default(),
            single_block: false,
            revision: 0,
        }
    }

    /// From now on no rounding, and no curve in place of short segments, leaves these positions; where one
    /// would, the path follows what is programmed and stops if need be. The moves themselves are the
    /// caller's to check.
    pub fn keep_within(&mut self, bounds: [PositionLimits; N]) {
        self.bounds = bounds;
    }

    /// Windows are so many times as deep from now on. That changes what planning takes, and hardly the
    /// motion time: it is for measuring how hardly.
    pub fn deepen(&mut self, times: u32) {
        self.lookahead *= f64::from(times);
        self.horizon *= f64::from(times);
        self.window.most_cells *= times as usize;
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
            PathItem::Dwell { duration, tag } => {
                self.close();
                self.items.push_back(PlanItem::Dwell { duration, tag });
            }
            PathItem::Move(motion) => self.push_move(motion)?,
        }
        Ok(())
    }

    /// The path rests here until [`mark`](super::Executor::mark) is [passed](super::Executor::pass).
    pub fn mark(&mut self, mark: u32) {
        self.close();
        self.items.push_back(PlanItem::Mark(mark));
    }

    /// Moves to come do not become one with those that were pushed.
    pub fn keep_joint(&mut self) {
        self.join_short_segments();
    }

    /// What planning took so far.
    pub fn effort(&self) -> Effort {
        self.window.effort()
    }

    /// No further item comes for now: whatever was taken is planned to rest.
    pub fn finish(&mut self) {
        self.close();
    }

    /// The next command; plans a window if none is ready. None where the next window needs more
    /// items, or [`finish`](Self::finish).
    pub fn pop(&mut self) -> Option<Command<N>> {
        if self.out.is_empty() {
            self.plan_on();
        }
        self.out.pop_front()
    }

    fn close(&mut self) {
        self.join_short_segments();
        self.rest_here();
    }

    /// The path rests where what was joined so far ends.
    fn rest_here(&mut self) {
        self.lay_pending(0.0);
        self.stop_here();
    }

    /// The path stops where it is.
    fn stop_here(&mut self) {
        if let Some(PlanItem::Section(section)) = self.items.back_mut() {
            section.closed = true;
        }
    }
    fn push_move(&mut self, motion: Move<N>) -> Result<(), PathError> {
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
        if let Some(segments) = &mut self.short_segments
            && segments.extend(&motion)
        {
            self.join_parts(false);
            return Ok(());
        }
        self.join_short_segments();
        self.short_segments = ShortSegments::begin(&motion);
        if self.short_segments.is_none() {
            self.join(Part {
                motion,
                deviation: 0.0,
                goes_on: false,
            });
        }
        Ok(())
    }

    /// Joins the short segments that were gathered.
    fn join_short_segments(&mut self) {
        self.join_parts(true);
        self.short_segments = None;
    }

    /// Joins what the short segments that were gathered give, all of it if there come no more.
    fn join_parts(&mut self, ended: bool) {
        let bounds = self.bounds;
        let may_be = |curve: &Curve<N>| inside(curve, &bounds);
        while let Some(part) = self
            .short_segments
            .as_mut()
            .and_then(|segments| segments.next(ended, may_be))
        {
            self.join(part);
        }
    }

    /// Joins a part of the path to the last one.
    fn join(&mut self, part: Part<N>) {
        let Part {
            motion,
            deviation,
            goes_on,
        } = part;
        let feed = motion.feed.speed();
        let mut taken = 0.0;
        if let Some((before, _)) = self.pending {
            match before.mode.rounding() {
                Some(_) if goes_on || smooth(&before.curve, &motion.curve) => self.lay_pending(0.0),
                Some(rounding) => {
                    let deviation = deviation.max(self.deviation);
                    let left = rounding.min(before.mode.tolerance() - deviation);
                    let rounded = LESSER.iter().find_map(|part| {
                        blend(&before.curve, &motion.curve, left * part)
                            .filter(|blend| inside(&blend.curve, &self.bounds))
                    });
                    if let Some(Blend { curve, cut }) = rounded {
                        self.lay_pending(cut);
                        self.lay(curve, before.feed.speed().min(feed), before.tag);
                        taken = cut;
                    } else {
                        self.rest_here();
                    }
                }
                None => self.rest_here(),
            }
        }
        self.pending = Some((motion, taken));
        self.deviation = deviation;
    }

    /// Lays the pending move but for the last `cut` of it.
    fn lay_pending(&mut self, cut: f64) {
        if let Some((motion, taken)) = self.pending.take() {
            let length = motion.curve.length();
            // Where blends have taken both halves nothing is left.
            if length - taken - cut > NOTHING * length {
                let whole = taken == 0.0 && cut == 0.0;
                let curve = if whole {
                    motion.curve
                } else {
                    motion.curve.part(taken, length - cut)
                };
                self.lay(curve, motion.feed.speed(), motion.tag);
            }
        }
    }

    /// The section goes on with `curve`; if there is none, one begins.
    fn lay(&mut self, curve: Curve<N>, feed: f64, tag: u32) {
        if !matches!(self.items.back(), Some(PlanItem::Section(section)) if !section.closed) {
            self.items.push_back(PlanItem::Section(Section {
                spans: Vec::new(),
                origin: self.length,
                length: 0.0,
                closed: false,
            }));
        }
        let mut span = PathSegment {
            start: 0.0,
            curve,
            feed,
            speed: feed,
            tag,
        };
        if self.overrides != Overrides::default() {
            span.speed = asked_speed(&span, self.overrides, &self.limits);
        }
        if let Some(PlanItem::Section(section)) = self.items.back_mut() {
            section.push(span);
            self.length = section.origin + section.length;
            self.kept += 1;
        }
    }

    /// Plans the rest of the path anew from the state that the executor asks for; the commands
    /// come next. Where no law is found from there, the answer is a plan that is too late, and the
    /// executor, which follows its old plan meanwhile, will ask for one from another state. A request
    /// that was answered is passed over; false then.
    pub fn replan(&mut self, request: &ReplanRequest) -> bool {
        let news = request.revision > self.revision;
        if news {
            self.answer(request);
        }
        news
    }

    fn answer(&mut self, request: &ReplanRequest) {
        self.revision = request.revision;
        self.override_speeds(request.overrides);
        self.single_block = request.single_block;
        // The executor is on one of them, or on none.
        self.ways_back
            .retain(|way| request.item == Some(way.number));
        if request.rest {
            self.come_to_rest(request);
            return;
        }
        // The last of the way is less than lengths tell apart, but takes time.
        let from = request.departure;
        let under_way = request.item.and_then(|item| self.section(item));
        if from.speed > 0.0 && under_way.is_some_and(|section| section.ends_at(from.distance)) {
            self.find_nothing();
            return;
        }
        let (item, departure) = match request.retrace {
            Some(asked) => self.way_back(request, asked),
            None => self.way_on(request),
        };
        if departure.speed > 0.0 && self.section(item).is_some() {
            self.go_on(request.cycle, item, departure);
            return;
        }
        self.begin_answer(request.cycle, item, departure);
        self.plans[1].clear();
        match self.section(item) {
            Some(_) => {
                let ended = self.plan_window(None);
                if self.out.len() == 1 {
                    self.out.push_back(Command::Commit);
                }
                if ended {
                    self.begin_item(item + 1);
                }
            }
            None if request.retrace.is_some() => {
                // There is no way further back.
                self.out.extend([Command::Hold, Command::Commit]);
                self.cursor.step += 1;
                self.cursor.holds = true;
            }
            None => self.out.push_back(Command::Commit),
        }
    }

    /// What comes next replaces the old plan in that cycle, and begins from that state.
    fn begin_answer(&mut self, cycle: u64, item: u64, departure: PathState) {
        self.cursor = Cursor {
            item,
            departure,
            sent: f64::NEG_INFINITY,
            rest: departure.distance,
            halvings: ANSWER_HALVINGS,
            ..Cursor::default()
        };
        self.followed.clear();
        self.window.faster.clear();
        self.replace_from(cycle);
    }

    /// Plans on from a state in motion, or from where the old plan leads to from there.
    fn go_on(&mut self, cycle: u64, item: u64, departure: PathState) {
        if self.plans[1].from(item, departure).next().is_some() {
            self.plans.swap(0, 1);
        }
        self.plans[1].clear();
        let old: Vec<_> = self.plans[0].from(item, departure).collect();
        let before = self.cursor;
        for attempt in attempts(&old).filter(|attempt| attempt.followed <= MOST_FOLLOWED) {
            let (followed, ahead) = old.split_at(attempt.followed);
            let from = match ahead.first() {
                Some(next) => next.piece.into(),
                None => departure,
            };
            self.begin_answer(cycle, item, from);
            self.followed.extend(followed.iter().map(|laid| laid.piece));
            let kept = minima(ahead).next().unwrap_or(ahead.len());
            self.window
                .recall(if attempt.keeps { &ahead[..kept] } else { &[] });
            let ended = self.plan_window(Some((attempt, ahead)));
            if self.out.len() > 1 {
                if ended {
                    self.begin_item(item + 1);
                }
                return;
            }
        }
        self.find_nothing();
        self.cursor = before;
    }

    /// What comes next replaces the old plan in that cycle.
    fn replace_from(&mut self, cycle: u64) {
        self.out.clear();
        self.out.push_back(Command::ReplacePlan {
            revision: self.revision,
            cycle,
        });
    }

    /// Nothing was found: what comes too late is asked for again.
    fn find_nothing(&mut self) {
        self.replace_from(0);
        self.out.push_back(Command::Commit);
    }

    /// Plans the shortest way to rest, and nothing beyond until the next request.
    fn come_to_rest(&mut self, request: &ReplanRequest) {
        self.cursor.holds = true;
        let ways = (request.item).and_then(|item| Some((item, self.section(item)?)));
        let found = ways.and_then(|(item, section)| {
            let plans = self.plans.iter().rev();
            let old = plans.map(|plan| plan.from(item, request.departure).collect::<Vec<_>>());
            let old = old
                .into_iter()
                .find(|old| !old.is_empty())
                .unwrap_or_default();
            let spans = section.from(request.departure.distance);
            let (followed, law) = (0..RESTS).find_map(|k| {
                let (followed, from) = follow(&old, request.departure, FOLLOWED * k as f64)?;
                let ahead = section.from(from.distance);
                let law = brake(|k| ahead.get(k), &self.limits, from, 0.0)?;
                Some((followed, law))
            })?;
            let begin = Command::Section {
                item,
                origin: section.origin,
                backward: item >= BACK,
                limits: self.limits,
            };
            let under_way = spans.iter().take_while(|s| s.start < law.end.distance);
            let mut plan = vec![begin];
            plan.extend(under_way.copied().map(Command::PathSegment));
            plan.extend(followed.into_iter().map(Command::JerkSegment));
            plan.extend(law.pieces().iter().copied().map(Command::JerkSegment));
            Some(plan)
        });
        let Some(plan) = found else {
            self.find_nothing();
            return;
        };
        self.replace_from(request.cycle);
        self.out.extend(plan);
        self.out.push_back(Command::Commit);
    }

    /// From where the path goes on.
    fn way_on(&self, request: &ReplanRequest) -> (u64, PathState) {
        let (item, departure) = match (request.item, self.ways_back.first()) {
            (None, _) => return (self.first, PathState::default()),
            (Some(_), Some(back)) => {
                let distance = back.from - request.departure.distance;
                (
                    back.item,
                    PathState {
                        distance: distance.max(0.0),
                        ..PathState::default()
                    },
                )
            }
            (Some(item), None) => (item, request.departure),
        };
        match self.section(item) {
            Some(section) if !section.ends_at(departure.distance) => (item, departure),
            _ => (item + 1, PathState::default()),
        }
    }

    /// From where the path goes back: on a way back that is under way, or on a new one to the
    /// beginning of a block.
    fn way_back(&mut self, request: &ReplanRequest, asked: u64) -> (u64, PathState) {
        let nowhere = (BACK, PathState::default());
        let mut number = BACK;
        let (mut item, mut from) = match (request.item, self.ways_back.first()) {
            (None, _) => return nowhere,
            (Some(at), Some(back)) => {
                if !back.section.reaches_end(request.departure.distance) {
                    return (at, request.departure);
                }
                if back.asked == asked {
                    return nowhere;
                }
                number = at;
                (back.item, back.from - back.section.length)
            }
            (Some(item), None) => (item, request.departure.distance),
        };
        // From the beginning of a section, or a rest between two, into the one before.
        while self.section(item).is_none() || from <= NOTHING {
            let items = self.first..self.first + self.items.len() as u64;
            let Some(before) = item.checked_sub(1).filter(|before| items.contains(before)) else {
                return nowhere;
            };
            item = before;
            from = self.section(item).map_or(0.0, |section| section.length);
        }
        let Some(section) = self.section(item) else {
            return nowhere;
        };
        let last = (section.spans)
            .partition_point(|s| s.start < from - NOTHING)
            .saturating_sub(1);
        let end = section.spans[last].start + section.spans[last].curve.length();
        let mut way = Section {
            spans: Vec::new(),
            origin: section.origin + end,
            length: 0.0,
            closed: true,
        };
        let tag = section.spans[last].tag;
        for span in section.spans[..=last]
            .iter()
            .rev()
            .take_while(|s| s.tag == tag)
        {
            way.push(PathSegment {
                curve: span.curve.reversed(),
                ..*span
            });
        }
        number += 1;
        self.ways_back.push(Back {
            number,
            asked,
            item,
            from: end,
            section: way,
        });
        let departure = PathState {
            distance: (end - from).max(0.0),
            ..PathState::default()
        };
        (number, departure)
    }

    /// The section with that number, on the way or back.
    fn section(&self, number: u64) -> Option<&Section<N>> {
        if let Some(way) = self.ways_back.iter().find(|way| way.number == number) {
            return Some(&way.section);
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

    /// From now on these parts of the programmed speeds are asked for.
    fn override_speeds(&mut self, overrides: Overrides) {
        if overrides == self.overrides {
            return;
        }
        self.overrides = overrides;
        let sections = self.items.iter_mut().filter_map(|item| match item {
            PlanItem::Section(section) => Some(section),
            _ => None,
        });
        let back = self.ways_back.iter_mut().map(|way| &mut way.section);
        for section in sections.chain(back) {
            for span in &mut section.spans {
                span.speed = asked_speed(span, overrides, &self.limits);
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
        while self.kept + self.items.len() > KEPT && self.first + 1 < item && item < BACK {
            if let Some(PlanItem::Section(section)) = self.items.pop_front() {
                self.kept -= section.spans.len();
            }
            self.first += 1;
        }
    }

    /// Plans until there is a command, as far as the path is known.
    fn plan_on(&mut self) {
        while self.out.is_empty() && !self.cursor.holds {
            let number = self.cursor.item;
            match self.item(number) {
                Some(&PlanItem::Dwell { duration, tag }) => {
                    self.out.extend([
                        Command::Dwell {
                            item: number,
                            duration,
                            tag,
                        },
                        Command::Commit,
                    ]);
                    self.cursor.step += 1;
                    self.begin_item(number + 1);
                }
                Some(&PlanItem::Mark(mark)) => {
                    self.out
                        .extend([Command::Mark { item: number, mark }, Command::Commit]);
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

    /// Plans the next window of the section under way; the first that is asked for anew as that attempt
    /// says, from a state that may be faster than what is asked for and on the old plan from there. True
    /// if that reaches the section's end.
    fn plan_window(&mut self, anew: Option<(Attempt, &[Laid])>) -> bool {
        let followed = take(&mut self.followed);
        let item = self.cursor.item;
        let index = item.checked_sub(self.first).map(|index| index as usize);
        let backward = item >= BACK;
        let way = self.ways_back.iter_mut().find(|way| way.number == item);
        let section = match (index.and_then(|index| self.items.get_mut(index)), way) {
            (Some(PlanItem::Section(section)), _) => section,
            (None, Some(way)) => &mut way.section,
            _ => return true,
        };
        let departure = self.cursor.departure;
        if departure.distance >= section.length - NOTHING {
            return section.closed;
        }
        let begin = (followed.first()).map_or(departure.distance, |piece| piece.distance);
        if !backward {
            self.kept -= section.forget_before(begin);
        }
        let spans = section.from(departure.distance);
        let mut way = spans
            .iter()
            .find(|s| s.speed <= 0.0)
            .map_or(f64::INFINITY, |s| s.start);
        self.slowing.clear();
        let mut from = departure;
        // A straight end of a section has a closed form from any state.
        let straight = spans.len() == 1
            && section.closed
            && way == f64::INFINITY
            && spans[0].curve.direction().is_some()
            && self
                .window
                .straight(&spans[0], &self.limits, departure)
                .is_ok();
        let mut rest = None;
        let mut gently = false;
        if let Some((attempt, old)) = anew
            && !straight
        {
            gently = attempt.gently;
            if gently {
                let limit = &mut self.window.faster;
                rest = lay_transition(spans, &self.limits, departure, old, limit);
                if limit.is_empty() {
                    return false;
                }
            } else if !lay_slowing(spans, &self.limits, &mut from, &mut self.slowing) {
                return false;
            }
        }
        if backward {
            way = way.min(section.length);
        } else if self.single_block {
            way = way.min(block_end(spans, section.closed, from, &self.limits));
        }
        let halvings = take(&mut self.cursor.halvings);
        let known = spans.last().map_or(0.0, |s| s.start + s.curve.length());
        let far = |from: PathState, halvings, rest: Option<f64>| {
            let time = self.horizon / f64::from(1_u32 << halvings);
            let room = from.distance + room_to_stop(spans, &self.limits, from);
            let end = reach(spans, from.distance, time, &self.limits).max(room);
            rest.unwrap_or(end.min(way)).min(known)
        };
        let end = far(from, halvings, rest);
        if end <= from.distance && self.slowing.is_empty() && from.speed == 0.0 {
            // There is no way on.
            self.out.extend([Command::Hold, Command::Commit]);
            self.cursor.step += 1;
            self.cursor.holds = true;
            return false;
        }
        let planned = if straight {
            true
        } else if end <= from.distance {
            self.window.stay();
            from.speed == 0.0
        } else {
            let plan = |window: &mut Window<N>, from, halvings, rest| {
                let end = far(from, halvings, rest);
                window
                    .plan(spans, &self.limits, from, end, halvings)
                    .is_ok()
            };
            // Where a short window has no law a longer one may have.
            let shortest = if anew.is_some() { halvings } else { 0 };
            let mut planned = (shortest..=halvings)
                .rev()
                .any(|halvings| plan(&mut self.window, from, halvings, rest));
            // Where it goes slower for a bend it must not rise to the limit again.
            for _ in 0..LIMITS_LOWERED {
                if !gently || !planned {
                    break;
                }
                let law = self.window.laid();
                if !overshoots(&law, spans) {
                    break;
                }
                let kept = &law[..minima(&law).next().unwrap_or(0)];
                let mut limit = Vec::new();
                let lower = lay_transition(spans, &self.limits, departure, &law, &mut limit);
                std::mem::swap(&mut self.window.faster, &mut limit);
                self.window.recall(kept);
                if plan(&mut self.window, from, halvings, lower) {
                    rest = lower;
                } else {
                    self.window.faster = limit;
                    self.window.recall(kept);
                    planned = plan(&mut self.window, from, halvings, rest);
                    break;
                }
            }
            // Or one that slows down for what lies ahead before it is as slow as is asked for.
            if !planned && !self.slowing.is_empty() {
                from = departure;
                self.window.faster.clone_from(&self.slowing);
                self.slowing.clear();
                planned = plan(&mut self.window, from, halvings, rest);
            }
            for _ in 1..ATTEMPTS {
                // Where no law is found there may be one from a little later on.
                if !planned
                    && anew.is_none()
                    && let Some(step) = &mut self.cursor.splice
                    && let Some((pieces, later)) = self.window.later(from)
                {
                    *step += pieces;
                    from = later;
                    let end = far(from, 0, None);
                    planned = end > from.distance
                        && self.window.plan(spans, &self.limits, from, end, 0).is_ok();
                }
            }
            planned
        };
        if !planned {
            if anew.is_some() {
                return false;
            }
            if departure.speed > 0.0 {
                // What was handed over ends at rest further on: from there it can always go on.
                self.cursor.departure = PathState {
                    distance: self.cursor.rest,
                    ..PathState::default()
                };
                self.cursor.splice = None;
                return section.ends_at(self.cursor.rest);
            }
            self.window.crawl(spans, departure.distance, &self.limits);
        }
        let before = followed.len() + self.slowing.len();
        let pieces = self.window.pieces();
        let Some(last) = pieces.last().or(self.slowing.last()) else {
            return false;
        };
        let rest = last.distance + last.at(last.duration).0;
        if !self.cursor.begun {
            self.out.push_back(Command::Section {
                item,
                origin: section.origin,
                backward,
                limits: self.limits,
            });
            self.cursor.begun = true;
            self.cursor.step += 1;
        }
        if let Some(step) = self.cursor.splice {
            self.out.push_back(Command::ReplaceTail(step));
            self.cursor.step = step;
        }
        for span in section
            .from(begin)
            .iter()
            .filter(|s| s.start >= self.cursor.sent && s.start < rest)
        {
            self.out.push_back(Command::PathSegment(*span));
        }
        self.cursor.sent = self.cursor.sent.max(rest);
        let ahead = followed.iter().chain(&self.slowing);
        let ahead = ahead
            .map(|&piece| Laid::from(piece))
            .chain(self.window.laid());
        for (step, laid) in (self.cursor.step..).zip(ahead) {
            self.out.push_back(Command::JerkSegment(laid.piece));
            self.plans[1].lay(item, step, laid);
        }
        self.cursor.holds = rest >= way - NOTHING;
        if self.cursor.holds {
            self.out.push_back(Command::Hold);
        }
        self.out.push_back(Command::Commit);
        self.cursor.rest = rest;
        let first = self.cursor.step + before as u64;
        self.cursor.step = first + pieces.len() as u64;
        // The end of a section is met to rounding.
        if section.ends_at(rest) {
            return true;
        }
        if pieces.is_empty() {
            self.cursor.departure = PathState {
                distance: rest,
                ..PathState::default()
            };
            self.cursor.splice = None;
            return false;
        }
        // From where is the window's end out of sight? Half of it is kept in any case, of a short
        // one less.
        let half = pieces.len() / 2;
        let ahead = followed.iter().chain(&self.slowing);
        let mut time = ahead.map(|piece| piece.duration).sum::<f64>();
        let soon = pieces.iter().position(|piece| {
            time += piece.duration;
            time >= ANSWER_KEPT
        });
        let least = match soon {
            Some(soon) if halvings > 0 => half.min(soon + 1),
            _ => half,
        };
        let mut left = 0.0;
        let mut keep = pieces.len() - 1;
        while keep > least && left < self.lookahead {
            left += pieces[keep].duration;
            keep -= 1;
        }
        // The calmer the state, the easier it is to go on from.
        for k in (least..keep).rev() {
            if pieces[k].acceleration.abs() < 0.5 * pieces[keep].acceleration.abs() {
                keep = k;
            }
        }
        self.cursor.departure = PathState::from(pieces[keep]);
        self.cursor.splice = Some(first + keep as u64);
        self.cursor.halvings = halvings.saturating_sub(1);
        false
    }
}

/// The end of the block that is under way at `from`, or of the first one where it is likely that
/// the path can rest from there.
fn block_end<const N: usize>(
    spans: &[PathSegment<N>],
    closed: bool,
    from: PathState,
    limits: &Limits<N>,
) -> f64 {
    let room = room_to_stop(spans, limits, from);
    let last = spans.len() - 1;
    (0..=last)
        .filter(|&k| {
            if k < last {
                spans[k + 1].tag != spans[k].tag
            } else {
                closed
            }
        })
        .map(|k| spans[k].start + spans[k].curve.length())
        .find(|end| end - from.distance >= 0.8 * room)
        .unwrap_or(f64::INFINITY)
}

/// The path speed that is asked for on a span after overrides.
fn asked_speed<const N: usize>(
    span: &PathSegment<N>,
    overrides: Overrides,
    limits: &Limits<N>,
) -> f64 {
    if span.feed.is_finite() {
        span.feed * overrides.feed
    } else if overrides.rapid < 1.0 {
        let [d1, _, _] = span.curve.derivative_bounds();
        let axes = (0..N)
            .map(|i| limits.velocity[i] / d1[i])
            .fold(f64::INFINITY, f64::min);
        axes * overrides.rapid
    } else {
        f64::INFINITY
    }
}

/// Lays the pieces that bring `from` down to a state from where the way goes on at the speeds that
/// are asked for; none if it is one. False if no law was found.
fn lay_slowing<const N: usize>(
    spans: &[PathSegment<N>],
    limits: &Limits<N>,
    from: &mut PathState,
    pieces: &mut Vec<JerkSegment>,
) -> bool {
    let mut target = spans[0].speed;
    let along = spans[0].curve.at(from.distance - spans[0].start).d1;
    let jerk = (0..N)
        .map(|i| limits.jerk[i] / along[i].abs())
        .fold(f64::INFINITY, f64::min);
    // The speed must come down to what is asked for where it has come down.
    for _ in 0..4 {
        let goal = target * SLOWED;
        let rising = from.acceleration.max(0.0);
        if from.speed + rising * rising / (2.0 * jerk) <= target {
            return true;
        }
        let law = brake(|k| spans.get(k), limits, *from, goal)
            .or_else(|| brake_gently(&spans[0], limits, *from, goal));
        let Some(law) = law else {
            return false;
        };
        let lowest = spans
            .iter()
            .take_while(|s| s.start <= law.end.distance)
            .map(|s| s.speed)
            .fold(target, f64::min);
        if lowest >= target {
            pieces.extend_from_slice(law.pieces());
            *from = law.end;
            return true;
        }
        target = lowest;
    }
    false
}

/// Part of the speed that is asked for to which it is brought down, so that rounding stays inside.
const SLOWED: f64 = 1.0 - 1e-4;

/// A window sees this many times the longest stop of an axis beyond what is final.
const LOOKAHEAD: f64 = 2.0;

impl<const N: usize> Section<N> {
    fn push(&mut self, span: PathSegment<N>) {
        self.spans.push(PathSegment {
            start: self.length,
            ..span
        });
        self.length += span.curve.length();
    }

    /// Forgets what is long passed at `distance`; returns how many spans.
    fn forget_before(&mut self, distance: f64) -> usize {
        let passed = self.spans.partition_point(|s| s.start <= distance);
        let surplus = passed.saturating_sub(KEPT);
        if surplus < KEPT {
            return 0;
        }
        self.spans.drain(..surplus);
        surplus
    }

    /// The spans from the one at `distance` on.
    fn from(&self, distance: f64) -> &[PathSegment<N>] {
        let passed = self.spans.partition_point(|s| s.start <= distance);
        &self.spans[passed.saturating_sub(1)..]
    }

    /// The path rests there.
    fn ends_at(&self, distance: f64) -> bool {
        self.closed && self.reaches_end(distance)
    }

    fn reaches_end(&self, distance: f64) -> bool {
        distance >= self.length - NOTHING
    }

    /// Least time of travel from `distance` to the end of what is known, s.
    fn time_from(&self, distance: f64, limits: &Limits<N>) -> f64 {
        let spans = self.from(distance);
        if spans.len() > WINDOW_SPANS {
            return f64::INFINITY;
        }
        let left = |span: &PathSegment<N>| {
            let end = span.start + span.curve.length();
            (end - span.start.max(distance)).max(0.0) / top_speed(span, limits)
        };
        spans.iter().map(left).sum()
    }
}

/// The distance that is reached from `from` within `time`, at the earliest.
fn reach<const N: usize>(
    spans: &[PathSegment<N>],
    from: f64,
    time: f64,
    limits: &Limits<N>,
) -> f64 {
    let mut left = time;
    let mut at = from;
    for span in spans.iter().take(WINDOW_SPANS) {
        let end = span.start + span.curve.length();
        if end <= at {
            continue;
        }
        let speed = top_speed(span, limits);
        let needed = (end - at) / speed;
        // A rest of the span that is not worth a window of its own goes with it.
        if needed > 1.25 * left {
            return at + left * speed;
        }
        at = end;
        left -= needed;
        if left <= 0.0 {
            break;
        }
    }
    at
}

fn top_speed<const N: usize>(span: &PathSegment<N>, limits: &Limits<N>) -> f64 {
    let axes = (0..N)
        .map(|i| limits.velocity[i] * limits.velocity[i])
        .sum::<f64>()
        .sqrt();
    let along = span.curve.direction().map_or(axes, |d| {
        (0..N)
            .map(|i| limits.velocity[i] / d[i].abs())
            .fold(f64::INFINITY, f64::min)
    });
    along.min(span.speed)
}

/// Whether a curve stays between these positions, but for rounding.
fn inside<const N: usize>(curve: &Curve<N>, bounds: &[PositionLimits; N]) -> bool {
    let (low, high) = curve.bounds();
    (0..N).all(|i| low[i] >= bounds[i].min - NOTHING && high[i] <= bounds[i].max + NOTHING)
}

/// Whether tangent and curvature go on unbroken from one curve to the next.
fn smooth<const N: usize>(before: &Curve<N>, after: &Curve<N>) -> bool {
    let (b, a) = (before.at(before.length()), after.at(0.0));
    let bend = (0..N)
        .map(|i| b.d2[i].abs().max(a.d2[i].abs()))
        .fold(1.0, f64::max);
    (0..N)
        .all(|i| (b.d1[i] - a.d1[i]).abs() <= SMOOTH && (b.d2[i] - a.d2[i]).abs() <= SMOOTH * bend)
}

/// Path speed, acceleration and jerk that, together and in any combination, keep every axis inside
/// its limits.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bounds {
    speed: f64,
    acceleration: f64,
    jerk: f64,
}

impl Bounds {
    pub(super) fn along<const N: usize>(span: &PathSegment<N>, limits: &Limits<N>) -> Self {
        // |q′|, |q″|, |q‴| of every axis, at most.
        let [d1, d2, d3] = span.curve.derivative_bounds();
        let least = |f: &dyn Fn(usize) -> f64| (0..N).map(f).fold(f64::INFINITY, f64::min);
        // Curved paths: 0.7 of the acceleration and 0.3 of the jerk for the curvature's own terms.
        let speed = least(&|i| {
            (limits.velocity[i] / d1[i])
                .min((0.7 * limits.acceleration[i] / d2[i]).sqrt())
                .min(libm::cbrt(0.3 * limits.jerk[i] / d3[i]))
        })
        .min(span.speed);
        let acceleration = least(&|i| {
            let left = limits.acceleration[i] - d2[i] * speed * speed;
            (left / d1[i]).min(0.35 * limits.jerk[i] / (3.0 * d2[i] * speed))
        });
        let jerk = least(&|i| {
            let used = d3[i] * speed * speed * speed + 3.0 * d2[i] * speed * acceleration;
            (limits.jerk[i] - used) / d1[i]
        });
        Bounds {
            speed,
            acceleration,
            jerk,
        }
    }

    /// As those of one axis.
    pub(super) fn limits(self) -> crate::limits::Limits {
        crate::limits::Limits::symmetric(self.speed, self.acceleration, self.jerk)
    }
}

/// The shortest profile over `length` from rest to rest: seven pieces, some of no duration.
pub(super) fn rest_to_rest(from: f64, length: f64, bounds: Bounds) -> [JerkSegment; 7] {
    let Bounds {
        speed: vmax,
        acceleration: amax,
        jerk: j,
    } = bounds;
    // Time of constant jerk and of constant acceleration on the way to the speed `v`.
    let ramp = |v: f64| {
        if v * j >= amax * amax {
            (amax / j, v / amax - amax / j)
        } else {
            ((v / j).sqrt(), 0.0)
        }
    };
    let way = |v: f64| {
        let (tj, ta) = ramp(v);
        v * (2.0 * tj + ta) // up and down again
    };
    let mut v = vmax;
    if way(v) > length {
        // Without constant acceleration: length = 2 v √(v/j); with it: length = v (a/j + v/a).
        let short = libm::cbrt(length * length * j / 4.0);
        v = if short * j <= amax * amax {
            short
        } else {
            let b = amax * amax / j;
            ((b * b + 4.0 * amax * length).sqrt() - b) / 2.0
        };
        v = v.min(vmax);
    }
    let (tj, ta) = ramp(v);
    let cruise = ((length - way(v)) / v).max(0.0);
    let a = j * tj;
    let shape = [
        (tj, j, 0.0),
        (ta, 0.0, a),
        (tj, -j, a),
        (cruise, 0.0, 0.0),
        (tj, -j, 0.0),
        (ta, 0.0, -a),
        (tj, j, -a),
    ];
    let mut distance = from;
    let mut speed = 0.0;
    shape.map(|(duration, jerk, acceleration)| {
        let piece = JerkSegment {
            duration,
            distance,
            speed,
            acceleration,
            jerk,
        };
        let (ds, v, _) = piece.at(duration);
        distance += ds;
        speed = v;
        piece
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::{Executor, Feed, PathControlMode, Plane, curve::ArcDefinition};

    const LIMITS: Limits<3> = Limits {
        velocity: [500.0, 400.0, 200.0],
        acceleration: [5_000.0, 3_000.0, 2_000.0],
        jerk: [80_000.0, 50_000.0, 40_000.0],
    };

    /// Motion time when windows are so many times deeper, and how many there were.
    fn time(curves: &[Curve<3>], feed: f64, depth: u32) -> (f64, usize) {
        let mut planner = Planner::new(LIMITS, curves[0].start());
        planner.deepen(depth);
        let (mut steps, mut windows) = (Vec::new(), 0);
        let mut take = |planner: &mut Planner<3>| {
            while let Some(command) = planner.pop() {
                match command {
                    Command::ReplaceTail(step) => steps.truncate(step as usize),
                    Command::Section { .. } => steps.push(0.0),
                    Command::JerkSegment(piece) => steps.push(piece.duration),
                    Command::Commit => windows += 1,
                    _ => {}
                }
            }
        };
        for &curve in curves {
            planner
                .push(PathItem::Move(Move {
                    curve,
                    feed: Feed::Rate(feed),
                    mode: PathControlMode::Blend(0.02),
                    tag: 0,
                }))
                .unwrap();
            take(&mut planner);
        }
        planner.finish();
        take(&mut planner);
        (steps.iter().sum(), windows)
    }

    #[test]
    fn the_depth_of_the_window_does_not_show() {
        let lines = |points: Vec<[f64; 3]>| -> Vec<Curve<3>> {
            points
                .windows(2)
                .map(|p| Curve::line(p[0], p[1]).unwrap())
                .collect()
        };
        let zigzag = (0..12).map(|k| [4.0 * f64::from(k), 14.0 * f64::from(k % 2), 0.0]);
        let facets = (0..3_000).map(|k| {
            let angle = 0.005 * f64::from(k);
            let radius = 10.0 + angle;
            [radius * libm::cos(angle), radius * libm::sin(angle), 0.0]
        });
        let waves = (0..10).map(|k| {
            let x = 20.0 * f64::from(k);
            Curve::arc(ArcDefinition {
                start: [x, 0.0, 0.0],
                end: [x + 20.0, 0.0, 0.0],
                plane: Plane::Xy,
                centre: (x + 10.0, 0.0),
                clockwise: k % 2 == 0,
                turns: 0,
            })
            .unwrap()
        });
        for (curves, feed) in [
            (lines(zigzag.collect()), 300.0),
            (lines(facets.collect()), 120.0),
            (waves.collect(), 200.0),
        ] {
            let (once, windows) = time(&curves, feed, 1);
            let (twice, fewer) = time(&curves, feed, 2);
            assert!(
                windows > 2 && fewer < windows,
                "{windows} and {fewer} windows"
            );
            println!("{once} s in {windows} windows, {twice} s in {fewer}");
            let longer = once / twice - 1.0;
            assert!(longer < 1e-3, "{once} s instead of {twice} s");
        }
    }

    /// Executes a zigzag; at the given cycle a person changes nothing worth mentioning. Returns
    /// how many cycles it took, and of how many pieces each window was from then on.
    fn execute(points: &[[f64; 3]], acts: u64) -> (u64, Vec<usize>) {
        let mut planner = Planner::new(LIMITS, points[0]);
        for ends in points.windows(2) {
            let motion = Move {
                curve: Curve::line(ends[0], ends[1]).unwrap(),
                feed: Feed::Rate(150.0),
                mode: PathControlMode::Blend(0.02),
                tag: 0,
            };
            planner.push(PathItem::Move(motion)).unwrap();
        }
        planner.finish();
        let mut executor = Executor::new(points[0], 0.001);
        let (mut windows, mut pieces) = (Vec::new(), 0);
        loop {
            if executor.cycle() == acts {
                let feed = 1.0 + 1e-9;
                executor.set_overrides(Overrides { feed, rapid: 1.0 });
            }
            if let Some(request) = executor.replan_request() {
                planner.replan(&request);
                windows.clear();
            }
            while executor.room() > 0
                && let Some(command) = planner.pop()
            {
                match command {
                    Command::JerkSegment(_) => pieces += 1,
                    Command::Commit => windows.push(take(&mut pieces)),
                    _ => {}
                }
                assert!(executor.accept(command));
            }
            if executor.is_idle() {
                assert_eq!(executor.late_plans(), 0);
                return (executor.cycle(), windows);
            }
            executor.advance();
        }
    }

    #[test]
    fn a_short_window_answers_a_person_and_costs_little_time() {
        let points: Vec<_> = (0..12)
            .map(|k| [4.0 * f64::from(k), 25.0 * f64::from(k % 2), 0.0])
            .collect();
        let (cycles, _) = execute(&points, u64::MAX);
        for acts in [100, 400, 700] {
            let (with, windows) = execute(&points, acts);
            assert!(windows[0] < MOST_CELLS / 3, "{windows:?}");
            assert!(with <= cycles + cycles / 300, "{with}, not {cycles}");
        }
    }
}
