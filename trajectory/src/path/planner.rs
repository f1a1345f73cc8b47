//! Plans the time law along the path, window by window.
//!
//! Items are joined to sections: stretches of path without a stop. A section is planned in windows
//! that overlap. Each ends at rest, so that whatever has been handed over is complete; the next one
//! begins in the midst of it, at a piece from which the former end is out of sight, and replaces
//! the rest ([`Command::Splice`]). Where windows end depends on the path alone, never on the pace
//! at which items come or commands go.

use std::collections::VecDeque;

use thiserror::Error;

use super::blend::{Blend, blend};
use super::window::{Departure, Window};
use super::{Command, Curve, Exit, Item, Limits, Move, Piece, Span};

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
/// Tangents (and curvatures times their radius) that differ by no more are equal.
const SMOOTH: f64 = 1e-10;
/// A part of a curve this small is rounding.
const NOTHING: f64 = 1e-9;
/// Spans in a window, at most.
const WINDOW_SPANS: usize = 1024;

/// Turns items into commands. Everything that it has given out up to a [`Command::Commit`] ends
/// at rest.
#[derive(Debug, Clone)]
pub struct Planner<const N: usize> {
    limits: Limits<N>,
    /// Time that is planned beyond what is final, and in all, s of travel at the programmed feed.
    sight: f64,
    horizon: f64,
    position: [f64; N],
    /// The last move, and how much of its start a blend took.
    pending: Option<(Move<N>, f64)>,
    /// What is to be planned; the first is under way.
    legs: VecDeque<Leg<N>>,
    cursor: Cursor,
    window: Window<N>,
    out: VecDeque<Command<N>>,
}

#[derive(Debug, Clone)]
enum Leg<const N: usize> {
    Section(Section<N>),
    Dwell { duration: f64, tag: u32 },
}

/// Path without a stop.
#[derive(Debug, Clone)]
struct Section<const N: usize> {
    /// Those not left behind yet.
    spans: VecDeque<Span<N>>,
    length: f64,
    /// No more spans come.
    closed: bool,
}

/// How far planning has come in the first leg.
#[derive(Debug, Clone, Copy, Default)]
struct Cursor {
    /// Where the next window begins.
    departure: Departure,
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
}

impl<const N: usize> Planner<N> {
    /// For a machine with `limits` that rests in `position`.
    pub fn new(limits: Limits<N>, position: [f64; N]) -> Self {
        let stop = (0..N)
            .map(|i| {
                limits.velocity[i] / limits.acceleration[i]
                    + limits.acceleration[i] / limits.jerk[i]
            })
            .fold(0.0, f64::max);
        let sight = SIGHT * stop;
        Planner {
            limits,
            sight,
            horizon: sight + sight.max(0.5),
            position,
            pending: None,
            legs: VecDeque::new(),
            cursor: Cursor::default(),
            window: Window::default(),
            out: VecDeque::new(),
        }
    }

    /// Takes the next item.
    ///
    /// # Errors
    /// See [`PathError`]; the item is not taken then.
    pub fn push(&mut self, item: Item<N>) -> Result<(), PathError> {
        match item {
            Item::Dwell { duration, .. } if !(duration >= 0.0 && duration.is_finite()) => {
                return Err(PathError::Dwell(duration));
            }
            Item::Dwell { duration, tag } => {
                self.close();
                self.legs.push_back(Leg::Dwell { duration, tag });
            }
            Item::Move(motion) => self.push_move(motion)?,
        }
        Ok(())
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
        self.lay_pending(0.0);
        self.stop_here();
    }

    /// The path stops where it is.
    fn stop_here(&mut self) {
        if let Some(Leg::Section(section)) = self.legs.back_mut() {
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
        let mut taken = 0.0;
        if let Some((before, _)) = self.pending {
            let tolerance = match before.exit {
                Exit::Stop => None,
                Exit::Exact(tolerance) | Exit::Blend(tolerance) => Some(tolerance),
            };
            match tolerance {
                Some(_) if smooth(&before.curve, &motion.curve) => self.lay_pending(0.0),
                Some(tolerance) => {
                    if let Some(Blend { curve, cut }) =
                        blend(&before.curve, &motion.curve, tolerance)
                    {
                        self.lay_pending(cut);
                        self.lay(curve, before.feed.speed().min(feed), before.tag);
                        taken = cut;
                    } else {
                        self.close();
                    }
                }
                None => self.close(),
            }
        }
        self.pending = Some((motion, taken));
        Ok(())
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
        if !matches!(self.legs.back(), Some(Leg::Section(section)) if !section.closed) {
            self.legs.push_back(Leg::Section(Section {
                spans: VecDeque::new(),
                length: 0.0,
                closed: false,
            }));
        }
        if let Some(Leg::Section(section)) = self.legs.back_mut() {
            section.push(Span {
                start: 0.0,
                curve,
                feed,
                tag,
            });
        }
    }

    /// Plans until there is a command, as far as the path is known.
    fn plan_on(&mut self) {
        while self.out.is_empty() {
            match self.legs.front() {
                None => return,
                Some(&Leg::Dwell { duration, tag }) => {
                    self.out
                        .extend([Command::Dwell { duration, tag }, Command::Commit]);
                    self.cursor = Cursor {
                        step: self.cursor.step + 1,
                        ..Cursor::default()
                    };
                    self.legs.pop_front();
                }
                Some(Leg::Section(section)) => {
                    let ahead = section.time_from(self.cursor.departure.distance, &self.limits);
                    if !section.closed && (ahead == 0.0 || ahead < self.horizon) {
                        return;
                    }
                    if self.plan_window() {
                        self.cursor = Cursor {
                            step: self.cursor.step,
                            ..Cursor::default()
                        };
                        self.legs.pop_front();
                    }
                }
            }
        }
    }

    /// Plans the next window of the section under way; true if that reaches its end.
    fn plan_window(&mut self) -> bool {
        let Some(Leg::Section(section)) = self.legs.front_mut() else {
            return true;
        };
        let departure = self.cursor.departure;
        if departure.distance >= section.length {
            return section.closed;
        }
        section.forget_before(departure.distance);
        let spans = section.spans.make_contiguous();
        let end = reach(spans, departure.distance, self.horizon, &self.limits);
        let planned = if let [span] = spans
            && section.closed
            && departure == Departure::default()
            && span.curve.direction().is_some()
        {
            self.window.straight(span, &self.limits);
            true
        } else {
            self.window
                .plan(spans, &self.limits, departure, end)
                .is_ok()
        };
        if !planned {
            if departure.speed > 0.0 {
                // What was handed over ends at rest further on: from there it can always go on.
                self.cursor.departure = Departure {
                    distance: self.cursor.rest,
                    ..Departure::default()
                };
                self.cursor.splice = None;
                return section.closed && self.cursor.rest >= section.length;
            }
            self.window.crawl(spans, departure.distance, &self.limits);
        }
        let pieces = self.window.pieces();
        let Some(last) = pieces.last() else {
            return true;
        };
        let rest = last.distance + last.at(last.duration).0;
        if !self.cursor.begun {
            self.out.push_back(Command::Section(self.limits));
            self.cursor.begun = true;
            self.cursor.step += 1;
        }
        if let Some(step) = self.cursor.splice {
            self.out.push_back(Command::Splice(step));
            self.cursor.step = step;
        }
        for span in spans
            .iter()
            .filter(|s| s.start >= self.cursor.sent && s.start < rest)
        {
            self.out.push_back(Command::Span(*span));
        }
        self.cursor.sent = self.cursor.sent.max(rest);
        self.out.extend(pieces.iter().copied().map(Command::Piece));
        self.out.push_back(Command::Commit);
        self.cursor.rest = rest;
        let first = self.cursor.step;
        self.cursor.step += pieces.len() as u64;
        // The end of a section is met to rounding.
        if section.closed && rest >= section.length * (1.0 - 1e-12) {
            return true;
        }
        // From where is the window's end out of sight? Half of it is kept in any case.
        let mut left = 0.0;
        let mut keep = pieces.len() - 1;
        while keep > pieces.len() / 2 && left < self.sight {
            left += pieces[keep].duration;
            keep -= 1;
        }
        let next = pieces[keep];
        self.cursor.departure = Departure {
            distance: next.distance,
            speed: next.speed,
            acceleration: next.acceleration,
        };
        self.cursor.splice = Some(first + keep as u64);
        false
    }
}

/// A window sees this many times the longest stop of an axis beyond what is final.
const SIGHT: f64 = 2.0;

impl<const N: usize> Section<N> {
    fn push(&mut self, span: Span<N>) {
        self.spans.push_back(Span {
            start: self.length,
            ..span
        });
        self.length += span.curve.length();
    }

    fn forget_before(&mut self, distance: f64) {
        while self.spans.len() > 1 && self.spans[1].start <= distance {
            self.spans.pop_front();
        }
    }

    /// Least time of travel from `distance` to the end of what is known, s.
    fn time_from(&self, distance: f64, limits: &Limits<N>) -> f64 {
        let mut time = 0.0;
        for span in self.spans.iter().rev() {
            let end = span.start + span.curve.length();
            if end <= distance {
                break;
            }
            time += (end - span.start.max(distance)) / top_speed(span, limits);
        }
        if self.spans.len() > WINDOW_SPANS {
            f64::INFINITY
        } else {
            time
        }
    }
}

/// The distance that is reached from `from` within `time`, at the earliest.
fn reach<const N: usize>(spans: &[Span<N>], from: f64, time: f64, limits: &Limits<N>) -> f64 {
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
        left -= needed;
        at = end;
    }
    at
}

fn top_speed<const N: usize>(span: &Span<N>, limits: &Limits<N>) -> f64 {
    let axes = (0..N)
        .map(|i| limits.velocity[i] * limits.velocity[i])
        .sum::<f64>()
        .sqrt();
    let along = span.curve.direction().map_or(axes, |d| {
        (0..N)
            .map(|i| limits.velocity[i] / d[i].abs())
            .fold(f64::INFINITY, f64::min)
    });
    along.min(span.feed)
}

/// Whether tangent and curvature go on unbroken from one curve to the next.
fn smooth<const N: usize>(before: &Curve<N>, after: &Curve<N>) -> bool {
    let (b, a) = (before.at(before.length()), after.at(0.0));
    let bend = (0..N)
        .map(|i| b.d2[i].abs().max(a.d2[i].abs()))
        .fold(0.0, f64::max);
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
    pub(super) fn along<const N: usize>(span: &Span<N>, limits: &Limits<N>) -> Self {
        // |q′|, |q″|, |q‴| of every axis, at most.
        let [d1, d2, d3] = span.curve.derivative_bounds();
        let least = |f: &dyn Fn(usize) -> f64| (0..N).map(f).fold(f64::INFINITY, f64::min);
        // Curved paths: 0.7 of the acceleration and 0.3 of the jerk for the curvature's own terms.
        let speed = least(&|i| {
            (limits.velocity[i] / d1[i])
                .min((0.7 * limits.acceleration[i] / d2[i]).sqrt())
                .min(libm::cbrt(0.3 * limits.jerk[i] / d3[i]))
        })
        .min(span.feed);
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
}

/// The shortest profile over `length` from rest to rest: seven pieces, some of no duration.
pub(super) fn rest_to_rest(from: f64, length: f64, bounds: Bounds) -> [Piece; 7] {
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
        let piece = Piece {
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
