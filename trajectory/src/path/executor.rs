//! Executes the plan on the path's own clock, one setpoint a cycle.

use std::collections::VecDeque;
use std::iter::repeat_n;
use std::mem::take;

use super::{Command, Curve, Derivatives, Limits, Piece, Span};

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
    /// Path travelled since the beginning, mm.
    pub distance: f64,
    /// Path speed, mm/s.
    pub speed: f64,
    /// Programmed path speed, mm/s; infinite for rapid, 0 at rest.
    pub feed: f64,
    /// A move or a dwell is at work.
    pub busy: bool,
}

#[derive(Debug, Clone, Copy)]
enum Step<const N: usize> {
    Section(Limits<N>),
    Piece(Piece),
    Dwell { duration: f64, tag: u32 },
}

/// An instant on the cycle's grid: `cycle` periods and `offset` seconds, so that no sum of
/// durations ever loses precision.
#[derive(Debug, Clone, Copy)]
struct Clock {
    cycle: u64,
    offset: f64,
}

/// How far a stop on the path has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stop {
    /// Nobody asked for one.
    No,
    /// The plan is followed to its rest until a shorter way is found, so many tries ago.
    Sought(u32),
    /// The shorter way is being followed.
    Found,
}
/// Holds the plan and samples it. Allocates only in [`Executor::new`].
///
/// The setpoint of a cycle is a function of its number and of the plan alone: polynomials are
/// evaluated from their piece's start, never summed up from cycle to cycle.
#[derive(Debug, Clone)]
pub struct Executor<const N: usize> {
    period: f64,
    cycle: u64,
    limits: Option<Limits<N>>,
    spans: VecDeque<Span<N>>,
    steps: VecDeque<Step<N>>,
    /// How many of `steps` end at rest and may run.
    committed: usize,
    /// Number of the first of `steps`.
    number: u64,
    /// The step that the uncommitted ones replace.
    splice: Option<u64>,
    late: bool,
    /// When the first of `steps` began; meaningless when idle.
    began: Clock,
    /// Path distance before the current section, and where on it the path came to rest last.
    passed: f64,
    reached: f64,
    /// The first of `spans` belongs to a section that has begun.
    entered: bool,
    rest: [f64; N],
    tag: u32,
    stop: Stop,
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
fn some_span<const N: usize>() -> Option<Span<N>> {
    Some(Span {
        start: 0.0,
        curve: Curve::line([0.0; N], [1.0; N]).ok()?,
        feed: 0.0,
        tag: 0,
    })
}

impl<const N: usize> Executor<N> {
    /// At rest in `position`, with a cycle of `period` s and room for `capacity` commands; a
    /// planner's windows need 4,096.
    pub fn new(position: [f64; N], period: f64, capacity: usize) -> Self {
        Executor {
            period,
            cycle: 0,
            limits: None,
            spans: touched(capacity, some_span()),
            steps: touched(
                capacity,
                Some(Step::Dwell {
                    duration: 0.0,
                    tag: 0,
                }),
            ),
            committed: 0,
            number: 0,
            splice: None,
            late: false,
            began: Clock {
                cycle: 0,
                offset: 0.0,
            },
            passed: 0.0,
            reached: 0.0,
            entered: false,
            rest: position,
            tag: 0,
            stop: Stop::No,
        }
    }

    /// Forgets the plan and rests in `position`, its cycle number zero; allocates nothing.
    pub fn restart(&mut self, position: [f64; N]) {
        let (mut spans, mut steps) = (take(&mut self.spans), take(&mut self.steps));
        spans.clear();
        steps.clear();
        *self = Executor {
            spans,
            steps,
            ..Executor::new(position, self.period, 0)
        };
    }

    /// How many commands can be accepted now.
    pub fn room(&self) -> usize {
        (self.spans.capacity() - self.spans.len()).min(self.steps.capacity() - self.steps.len())
    }

    /// Takes the next command of the plan; false, and nothing taken, if there is no room for it.
    /// After [`stop`](Self::stop) commands are taken and dropped.
    pub fn accept(&mut self, command: Command<N>) -> bool {
        if self.stop != Stop::No || self.late {
            return true;
        }
        if self.room() == 0 {
            return false;
        }
        match command {
            Command::Section(limits) => self.steps.push_back(Step::Section(limits)),
            Command::Splice(step) => self.splice = Some(step),
            Command::Span(span) => self.spans.push_back(span),
            Command::Piece(piece) => self.steps.push_back(Step::Piece(piece)),
            Command::Dwell { duration, tag } => self.steps.push_back(Step::Dwell { duration, tag }),
            Command::Commit => self.commit(),
        }
        true
    }

    fn commit(&mut self) {
        if let Some(step) = self.splice.take() {
            // A step that has begun cannot be replaced any more.
            if step <= self.number {
                self.steps.truncate(self.committed);
                self.late = true;
                return;
            }
            let keep = (step - self.number) as usize;
            self.steps.drain(keep.min(self.committed)..self.committed);
        } else if self.committed == 0 {
            self.began = Clock {
                cycle: self.cycle,
                offset: 0.0,
            };
        }
        self.committed = self.steps.len();
    }

    /// A part of the plan came after the path had gone past the point from where it applied. The
    /// path comes to rest as planned before, and no more commands are taken.
    pub fn is_late(&self) -> bool {
        self.late
    }

    /// Nothing is left to execute; the axes rest.
    pub fn is_idle(&self) -> bool {
        self.committed == 0
    }

    /// Number of the cycle that the last setpoint belongs to.
    pub fn cycle(&self) -> u64 {
        self.cycle
    }

    /// The current setpoint.
    pub fn setpoint(&self) -> Setpoint<N> {
        let (Some(Step::Piece(piece)), Some(span)) = (self.current(), self.spans.front()) else {
            return Setpoint {
                position: self.rest,
                velocity: [0.0; N],
                acceleration: [0.0; N],
                jerk: [0.0; N],
                tag: self.tag,
                distance: self.passed + self.reached,
                speed: 0.0,
                feed: 0.0,
                busy: !self.is_idle(),
            };
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
            distance: self.passed + piece.distance + ds,
            speed: v,
            feed: span.feed,
            busy: true,
        }
    }

    /// Goes on by one cycle.
    pub fn advance(&mut self) -> Setpoint<N> {
        self.cycle += 1;
        while let Some(step) = self.current() {
            let duration = match step {
                Step::Section(_) => 0.0,
                Step::Piece(Piece { duration, .. }) | Step::Dwell { duration, .. } => duration,
            };
            if self.since(self.began) < duration {
                break;
            }
            self.finish_step(step, duration);
        }
        if let Some(Step::Piece(piece)) = self.current() {
            let (ds, _, _) = piece.at(self.since(self.began));
            self.enter_span_at(piece.distance + ds);
            self.seek_stop();
        }
        self.setpoint()
    }

    fn current(&self) -> Option<Step<N>> {
        if self.committed > 0 {
            self.steps.front().copied()
        } else {
            None
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
            Step::Section(limits) => {
                self.limits = Some(limits);
                self.passed += std::mem::take(&mut self.reached);
                while self.entered
                    && self
                        .spans
                        .front()
                        .is_some_and(|s| s.start > 0.0 || self.spans.len() > 1)
                {
                    self.spans.pop_front();
                    if self.spans.front().is_none_or(|s| s.start == 0.0) {
                        break;
                    }
                }
                self.entered = true;
            }

            Step::Piece(piece) if !matches!(self.current(), Some(Step::Piece(_))) => {
                self.finish_run(piece.distance + piece.at(duration).0);
            }
            _ => {}
        }
        if let Some(Step::Dwell { tag, .. }) = self.current() {
            self.tag = tag;
        }
    }

    /// The axes have come to rest at `end` on the section.
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
        if self.stop != Stop::No {
            self.spans.clear();
        }
    }
    /// Drops the spans that end before `distance`, but never the last of the section.
    fn enter_span_at(&mut self, distance: f64) {
        while let (Some(span), Some(next)) = (self.spans.front(), self.spans.get(1)) {
            if next.start == 0.0 || distance < span.start + span.curve.length() {
                break;
            }
            self.spans.pop_front();
        }
    }

    /// Comes to rest on the path as soon as the limits allow and drops the rest of the plan.
    /// Effective from the current cycle on; the next setpoints lead to rest.
    ///
    /// On a line that is the closed form. On curves it is tried cycle by cycle whether braking as
    /// hard as the axes allow from here on leads to rest inside all limits; until that is so, the
    /// plan, which ends at rest, too, is followed.
    pub fn stop(&mut self) {
        if self.stop != Stop::No {
            return;
        }
        self.steps.truncate(self.committed);
        let run = self.steps.iter().position(|s| !matches!(s, Step::Piece(_)));
        self.steps.truncate(run.unwrap_or(self.steps.len()));
        self.committed = self.steps.len();
        self.stop = Stop::Sought(0);
        self.seek_stop();
        if self.is_idle() {
            self.spans.clear();
        }
    }

    /// Replaces the plan by a shorter way to rest if there is one.
    fn seek_stop(&mut self) {
        let (Stop::Sought(tries), Some(Step::Piece(piece))) = (self.stop, self.current()) else {
            return;
        };
        self.stop = Stop::Sought(tries + 1);
        let (ds, v, a) = piece.at(self.since(self.began).clamp(0.0, piece.duration));
        // Where the plan does nothing but come to rest, it does so as fast as it can.
        let brakes = |s: &Step<N>| {
            let Step::Piece(p) = s else { return false };
            let cruises = p.acceleration.abs() <= 1e-9 && p.jerk >= 0.0;
            !cruises && p.at(p.duration).2 <= 1e-9
        };
        if a <= 0.0 && self.steps.iter().all(brakes) {
            self.stop = Stop::Found;
            return;
        }
        let thorough = (tries as usize).is_multiple_of(THOROUGH);
        let force = FORCES[tries as usize / THOROUGH % FORCES.len()];
        let from = piece.distance + ds;
        if self.lay_brake(from, v, a, force, thorough).is_some() {
            self.steps.drain(..self.committed);
            self.number += self.committed as u64;
            self.began = Clock {
                cycle: self.cycle,
                offset: 0.0,
            };
            self.stop = Stop::Found;
            self.committed = self.steps.len();
        } else {
            self.steps.truncate(self.committed);
        }
    }

    /// Appends pieces that brake with the part `force` of the limits down to rest; None if a limit
    /// breaks on the way.
    fn lay_brake(
        &mut self,
        mut distance: f64,
        mut v: f64,
        mut a: f64,
        force: f64,
        thorough: bool,
    ) -> Option<()> {
        let limits = self.limits?;
        let mut index = 0;
        for step in 0..MOST_STEPS {
            while self
                .spans
                .get(index + 1)
                .is_some_and(|s| s.start > 0.0 && s.start <= distance)
            {
                index += 1;
            }
            let span = self.spans.get(index)?;
            if (step % AGAIN == 0 || span.curve.direction().is_some())
                && let Some((acceleration, jerk)) = reserve(&span.curve, &limits, v, a)
                && let Some(pieces) = brake_from(distance, v, a, acceleration, jerk)
                && pieces[2].distance + pieces[2].at(pieces[2].duration).0
                    <= span.start + span.curve.length()
            {
                self.steps.extend(pieces.map(Step::Piece));
                return Some(());
            }
            // Beyond that, cycle by cycle; that takes its time, so that it is tried now and then.
            if !thorough {
                return None;
            }
            let least = |limit: &[f64; N], along: &[f64; N]| {
                (0..N)
                    .map(|i| limit[i] / along[i].abs())
                    .fold(f64::INFINITY, f64::min)
            };
            let here = span.curve.at(distance - span.start);
            let landing = force * LANDING * least(&limits.jerk, &here.d1);
            if a < 0.0 && a * a >= 2.0 * v * landing {
                let piece = Piece {
                    duration: -2.0 * v / a,
                    distance,
                    speed: v,
                    acceleration: a,
                    jerk: a * a / (2.0 * v),
                };
                let complete =
                    distance + piece.at(piece.duration).0 <= span.start + span.curve.length();
                if !complete || !self.inside(&piece, index, &limits) {
                    return None;
                }
                self.steps.push_back(Step::Piece(piece));
                return Some(());
            }
            let t = self.period;
            let ahead = distance + t * (v + 0.5 * t * a);
            let next = self
                .spans
                .get(index + 1)
                .filter(|s| s.start > 0.0 && s.start <= ahead)
                .unwrap_or(span);
            let there = next.curve.at(ahead - next.start);
            let jerk = braking_jerk(&limits, force, &here, &there, v, a, t, landing);
            let piece = Piece {
                duration: t,
                distance,
                speed: v,
                acceleration: a,
                jerk,
            };
            if !self.inside(&piece, index, &limits) || self.steps.len() == self.steps.capacity() {
                return None;
            }
            self.steps.push_back(Step::Piece(piece));
            let (ds, speed, acceleration) = piece.at(t);
            if speed <= 0.0 {
                return None;
            }
            (distance, v, a) = (distance + ds, speed, acceleration);
        }
        None
    }

    /// Whether every axis keeps its limits at the start, in the middle and at the end of what the
    /// piece takes of each span, from the one with this index on.
    fn inside(&self, piece: &Piece, index: usize, limits: &Limits<N>) -> bool {
        let end = piece.distance + piece.at(piece.duration).0;
        let section = self.spans.range(index..).enumerate();
        section
            .take_while(|(i, span)| *i == 0 || (span.start > 0.0 && span.start <= end))
            .all(|(_, span)| {
                let from = instant_at(piece, span.start);
                let to = instant_at(piece, span.start + span.curve.length());
                [from, 0.5 * (from + to), to].iter().all(|&t| {
                    let (ds, v, a) = piece.at(t);
                    let at = span.curve.at(piece.distance - span.start + ds);
                    (0..N).all(|i| {
                        let acceleration = at.d2[i] * v * v + at.d1[i] * a;
                        let jerk =
                            (at.d3[i] * v * v + 3.0 * at.d2[i] * a) * v + at.d1[i] * piece.jerk;
                        acceleration.abs() <= limits.acceleration[i] && jerk.abs() <= limits.jerk[i]
                    })
                })
            })
    }
}

/// When the piece reaches a distance, s from its start, between its start and its end.
fn instant_at(piece: &Piece, distance: f64) -> f64 {
    let way = distance - piece.distance;
    let (mut low, mut high) = (0.0, piece.duration);
    if way <= 0.0 || way >= piece.at(high).0 {
        return if way <= 0.0 { low } else { high };
    }
    // A millionth of a cycle is near enough to see the limits.
    for _ in 0..20 {
        let middle = 0.5 * (low + high);
        if piece.at(middle).0 < way {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// Path acceleration and jerk that braking from speed `v` and acceleration `a` may use anywhere on
/// the curve, whatever its bends ask of the axes meanwhile; `None` if they leave too little.
fn reserve<const N: usize>(
    curve: &Curve<N>,
    limits: &Limits<N>,
    v: f64,
    a: f64,
) -> Option<(f64, f64)> {
    let [d1, d2, d3] = match curve.direction() {
        Some(along) => [along.map(f64::abs), [0.0; N], [0.0; N]],
        None => curve.derivative_bounds(),
    };
    let least = |left: &dyn Fn(usize) -> f64| {
        (0..N)
            .filter(|&i| d1[i] > 0.0)
            .map(|i| left(i) / d1[i])
            .fold(f64::INFINITY, f64::min)
    };
    // The speed still rises while an acceleration is taken back.
    let rising = a.max(0.0);
    let highest = |jerk: f64| v + rising * rising / (2.0 * jerk);
    let bent = d2.iter().any(|d| *d > 0.0);
    let whole = least(&|i| limits.jerk[i]);
    let v = highest(if bent { whole * RESERVE } else { whole });
    let acceleration = least(&|i| limits.acceleration[i] - d2[i] * v * v);
    let top = acceleration.max(a.abs());
    let jerk = least(&|i| limits.jerk[i] - d3[i] * v * v * v - 3.0 * d2[i] * v * top);
    // Also what the bends ask where an axis has no part in the path's direction.
    let kept = (0..N).all(|i| {
        d2[i] * v * v <= limits.acceleration[i]
            && d3[i] * v * v * v + 3.0 * d2[i] * v * top <= limits.jerk[i]
    });
    let enough = acceleration * (1.0 + 1e-9) >= a.abs() && jerk >= whole * RESERVE && kept;
    (enough && acceleration > 0.0).then_some((acceleration, jerk))
}

/// Parts of the limits that a stop on a curve tries to use, in turn. What is left is for what
/// happens within a cycle.
const FORCES: [f64; 3] = [0.98, 0.7, 0.4];
/// Part of the jerk limit that a curve must leave for braking in closed form.
const RESERVE: f64 = 0.4;
/// Steps of a search after which the closed form is tried again.
const AGAIN: usize = 8;
/// Cycles from one search for a stop cycle by cycle to the next.
const THOROUGH: usize = 5;
/// Cycles of a stop that are laid out at most.
const MOST_STEPS: usize = 400;
/// Part of the jerk limit with which a stop on a curve lands; the rest is for the curvature.
const LANDING: f64 = 0.9;

/// The hardest braking for the next `t` seconds that, with the part `force` of them, keeps every axis inside its limits and can
/// still land with the path jerk `landing`.
#[allow(clippy::too_many_arguments)] // the law's own
fn braking_jerk<const N: usize>(
    limits: &Limits<N>,
    force: f64,
    here: &Derivatives<N>,
    there: &Derivatives<N>,
    v: f64,
    a: f64,
    t: f64,
    landing: f64,
) -> f64 {
    // Acceleration at the end of the step, from what its end and its landing allow …
    let speed = (v + a * t).max(0.0);
    let mut least = -(2.0 * landing * speed).sqrt();
    let mut most = f64::INFINITY;
    for i in 0..N {
        let d = there.d1[i].abs();
        if d > 0.0 {
            let curve = there.d2[i] * there.d1[i].signum() * speed * speed;
            least = least.max((-force * limits.acceleration[i] - curve) / d);
            most = most.min((force * limits.acceleration[i] - curve) / d);
        }
    }
    // … and jerk, from what both ends allow.
    let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
    for (at, v, a) in [(here, v, a), (there, speed, a.min(0.0))] {
        for i in 0..N {
            let d = at.d1[i].abs();
            if d > 0.0 {
                let curve = (at.d3[i] * v * v + 3.0 * at.d2[i] * a) * v * at.d1[i].signum();
                low = low.max((-force * limits.jerk[i] - curve) / d);
                high = high.min((force * limits.jerk[i] - curve) / d);
            }
        }
    }
    let wish = least.min(most).max(a + low * t);
    ((wish - a) / t).min(high).max(low.min(high))
}

/// The shortest way to rest from path speed `v` ≥ 0 and acceleration `a`: jerk −j, deceleration
/// `limit` held if it is reached, jerk +j. `None` where jerk +j alone would come to rest no earlier.
fn brake_from(distance: f64, v: f64, a: f64, limit: f64, j: f64) -> Option<[Piece; 3]> {
    let reached = v + a * a / (2.0 * j);
    let peak = (j * reached).sqrt().min(limit);
    let down = (a + peak) / j;
    if down < 0.0 || v <= 0.0 {
        return None;
    }
    let hold = (reached - peak * peak / j) / peak;
    let first = Piece {
        duration: down,
        distance,
        speed: v,
        acceleration: a,
        jerk: -j,
    };
    let (d, speed, _) = first.at(down);
    let second = Piece {
        duration: hold.max(0.0),
        distance: distance + d,
        speed,
        acceleration: -peak,
        jerk: 0.0,
    };
    let (d, speed, _) = second.at(second.duration);
    let third = Piece {
        duration: peak / j,
        distance: second.distance + d,
        speed,
        acceleration: -peak,
        jerk: j,
    };
    Some([first, second, third])
}
