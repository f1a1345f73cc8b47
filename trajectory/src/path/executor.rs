//! Executes the plan on the path's own clock, one setpoint a cycle.

use std::collections::VecDeque;

use super::{Command, Piece, Span};

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
enum Step {
    Section,
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

/// Holds the plan and samples it. Allocates only in [`Executor::new`].
///
/// The setpoint of a cycle is a function of its number and of the plan alone: polynomials are
/// evaluated from their piece's start, never summed up from cycle to cycle.
#[derive(Debug, Clone)]
pub struct Executor<const N: usize> {
    period: f64,
    cycle: u64,
    spans: VecDeque<Span<N>>,
    steps: VecDeque<Step>,
    /// How many of `steps` end at rest and may run.
    committed: usize,
    /// When the first of `steps` began; meaningless when idle.
    began: Clock,
    /// Path distance before the current section.
    passed: f64,
    rest: [f64; N],
    tag: u32,
    stopping: bool,
}

impl<const N: usize> Executor<N> {
    /// At rest in `position`, with a cycle of `period` s and room for `capacity` commands.
    pub fn new(position: [f64; N], period: f64, capacity: usize) -> Self {
        Executor {
            period,
            cycle: 0,
            spans: VecDeque::with_capacity(capacity),
            steps: VecDeque::with_capacity(capacity),
            committed: 0,
            began: Clock {
                cycle: 0,
                offset: 0.0,
            },
            passed: 0.0,
            rest: position,
            tag: 0,
            stopping: false,
        }
    }

    /// How many commands can be accepted now.
    pub fn room(&self) -> usize {
        (self.spans.capacity() - self.spans.len()).min(self.steps.capacity() - self.steps.len())
    }

    /// Takes the next command of the plan; false, and nothing taken, if there is no room for it.
    /// After [`stop`](Self::stop) commands are taken and dropped.
    pub fn accept(&mut self, command: Command<N>) -> bool {
        if self.stopping {
            return true;
        }
        if self.room() == 0 {
            return false;
        }
        match command {
            Command::Section => self.steps.push_back(Step::Section),
            Command::Span(span) => self.spans.push_back(span),
            Command::Piece(piece) => self.steps.push_back(Step::Piece(piece)),
            Command::Dwell { duration, tag } => self.steps.push_back(Step::Dwell { duration, tag }),
            Command::Commit => {
                if self.committed == 0 {
                    self.began = Clock {
                        cycle: self.cycle,
                        offset: 0.0,
                    };
                }
                self.committed = self.steps.len();
            }
        }
        true
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
        let at_rest = |tag, distance, busy| Setpoint {
            position: self.rest,
            velocity: [0.0; N],
            acceleration: [0.0; N],
            jerk: [0.0; N],
            tag,
            distance,
            speed: 0.0,
            feed: 0.0,
            busy,
        };
        let (Some(Step::Piece(piece)), Some(span)) = (self.current(), self.spans.front()) else {
            return at_rest(self.tag, self.passed, !self.is_idle());
        };
        let t = self.since(self.began).clamp(0.0, piece.duration);
        let (ds, v, a) = piece.at(t);
        let v = v.max(0.0);
        let j = piece.jerk;
        // The two starts first: they are large and constant, the rest is small and exact.
        let local = (piece.distance - span.start) + ds;
        let at = span.curve.at(local);
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
                Step::Section => 0.0,
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
        }
        self.setpoint()
    }

    fn current(&self) -> Option<Step> {
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

    fn finish_step(&mut self, step: Step, duration: f64) {
        let offset = self.began.offset + duration;
        let cycles = (offset / self.period).floor();
        self.began.cycle += cycles as u64;
        self.began.offset = (offset - cycles * self.period).max(0.0);
        self.steps.pop_front();
        self.committed -= 1;
        let next = self.current();
        if let Step::Piece(piece) = step
            && !matches!(next, Some(Step::Piece(_)))
        {
            self.finish_section(piece.distance + piece.at(duration).0);
        }
        if let Some(Step::Dwell { tag, .. }) = next {
            self.tag = tag;
        }
    }

    /// The axes have come to rest at `end` on the section.
    fn finish_section(&mut self, end: f64) {
        self.enter_span_at(end);
        if let Some(span) = self.spans.pop_front() {
            let whole = span.start + span.curve.length();
            let stopped_short = self.stopping && end < whole;
            self.rest = if stopped_short {
                span.curve.at(end - span.start).q
            } else {
                span.curve.end()
            };
            self.passed += if stopped_short { end } else { whole };
            self.tag = span.tag;
        }
        if self.stopping {
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
    pub fn stop(&mut self) {
        if self.stopping {
            return;
        }
        self.stopping = true;
        let (Some(Step::Piece(piece)), Some(&span)) = (self.current(), self.spans.front()) else {
            self.steps.clear();
            self.spans.clear();
            self.committed = 0;
            return;
        };
        let (ds, v, a) = piece.at(self.since(self.began).clamp(0.0, piece.duration));
        let section_end = self
            .steps
            .iter()
            .position(|s| !matches!(s, Step::Piece(_)))
            .unwrap_or(self.steps.len());
        let plan_end = match self.steps.get(section_end - 1) {
            Some(Step::Piece(last)) => last.distance + last.at(last.duration).0,
            _ => piece.distance,
        };
        self.steps.truncate(section_end);
        let brake = span.brake;
        let from = piece.distance + ds;
        if let Some(pieces) = brake_from(from, v, a, brake.acceleration, brake.jerk) {
            let last = &pieces[2];
            // Otherwise the plan is already braking as hard as it can: leave it.
            if last.distance + last.at(last.duration).0 < plan_end - 1e-9 {
                self.steps.clear();
                self.steps.extend(pieces.map(Step::Piece));
                self.began = Clock {
                    cycle: self.cycle,
                    offset: 0.0,
                };
            }
        }
        self.committed = self.steps.len();
    }
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
