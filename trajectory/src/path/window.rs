//! Plans a stretch of a section: cuts it into cells, solves for the time parametrisation, turns it into pieces
//! and certifies them.

use std::iter::repeat;

use super::bounds::{Bounds, rest_to_rest};
use super::brake::instant_at;
use super::certify::{ROUNDING, load};
use super::plan::Laid;
use super::time_parametrisation::{Cell, Node, Slope, TimeParametrisation};
use super::{JerkSegment, Limits, PathSegment, PathState};
use crate::profile::State;
use crate::state_to_state::{self, Axis};

impl From<JerkSegment> for PathState {
    fn from(piece: JerkSegment) -> Self {
        PathState {
            distance: piece.distance,
            speed: piece.speed,
            acceleration: piece.acceleration,
        }
    }
}

/// Ramps of the acceleration are cut into this many cells.
const CELLS_PER_RAMP: f64 = 10.0;
/// Cells of a stretch, about.
pub(super) const MOST_CELLS: usize = 600;
/// A law of more is none: limits that differ by too much.
pub(super) const TOO_MANY_CELLS: usize = 16 * MOST_CELLS;
/// Cells shorter than this would be nothing but rounding, mm.
const SHORTEST: f64 = 1e-9;
/// By how much of the time up to them cells may be longer than later ones.
const FINER: f64 = 0.4;
/// Greatest turn of the tangent within a cell, rad.
const CELL_TURN: f64 = 0.1;

/// Barrier of the first solution and of those with tightened limits, in motion times.
const BARRIER_FROM_GUESS: f64 = 0.3;
const BARRIER_FROM_LAST: f64 = 0.01;

/// Tolerance of the optimisation, as a part of the motion time.
const TOLERANCE: f64 = 3e-4;
/// Rounds of solving with limits tightened where the law broke them between nodes.
const ROUNDS: usize = 10;
/// What is taken off a broken limit beyond the excess; twice that in every further round.
const MARGIN: f64 = 5e-4;
/// What may be missing between two pieces, as a part of what changes in one.
const SEAM: f64 = 1e-9;
/// Cells on both sides of one that is too fast in which the speed is lowered, too.
const NEAR_SPEED: usize = 8;
/// Part of its time by which a plan from rest may be stretched instead of being improved.
const SLOWED: f64 = 2e-4;
/// Cells of the last stretch that the next one takes over, at most: time enough to do otherwise
/// than the last one meant to.
const KEPT_CELLS: usize = 40;
/// Part of the way on which cells are taken over from another plan.
const KEPT_WAY: f64 = 0.8;
/// What is kept of the acceleration and jerk limits on curves from the first, for what happens
/// between the nodes.
const CURVE_SHARE: f64 = 5e-4;
/// Part of the speed limit that is planned, so that rounding stays inside.
const SPEED_SHARE: f64 = 1.0 - 2e-5;

/// Part of the path over which the estimate of the speed is one formula.
#[derive(Debug, Clone, Copy)]
struct Stretch {
    from: f64,
    to: f64,
    /// Greatest ṡ² by feed, axis speeds and curvature.
    cap: f64,
    /// Greatest acceleration and jerk along the tangent.
    acceleration: f64,
    jerk: f64,
    /// The part of the path about it over which the cap is the same.
    level: [f64; 2],
    /// Estimate of ṡ² at both ends.
    w: [f64; 2],
    /// Duration of a cell within, and at the end at most, s.
    tick: f64,
    last_tick: f64,
}

/// The law of a stretch could not be found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NoSolution;

/// Scratch space of the planning of a stretch.
#[derive(Debug, Clone)]
pub struct Window<const N: usize> {
    /// Cells of a stretch, about.
    pub(super) most_cells: usize,
    stretches: Vec<Stretch>,
    nodes: Vec<f64>,
    estimate: Vec<f64>,
    cells: Vec<Cell<N>>,
    span_of: Vec<usize>,
    /// By what velocity, acceleration and jerk are to be lowered in every cell.
    cuts: Vec<[f64; 3]>,
    last: Known,
    /// Cells of the last plan that are taken over.
    kept: Vec<KnownCell>,
    law: TimeParametrisation<N>,
    pieces: Vec<JerkSegment>,
    effort: Effort,
    /// A slowing down to the speed that is asked for; where it is faster than that, so may the plan be.
    pub(super) faster: Vec<JerkSegment>,
}

/// The last plan that was found.
#[derive(Debug, Clone, Default)]
struct Known {
    pieces: Vec<JerkSegment>,
    cells: Vec<KnownCell>,
    /// It comes to rest; otherwise it is the beginning of one that does.
    rests: bool,
}

/// Where a cell ends, ṡ² there, and the cell's shares of the limits.
type KnownCell = (f64, f64, [f64; 2]);

/// What planning took so far.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Effort {
    /// Stretches planned.
    pub stretches: usize,
    /// Cells of all of them.
    pub cells: usize,
    /// Laws solved for; more than stretches where limits had to be tightened.
    pub laws: usize,
    /// Newton steps of all of them.
    pub steps: usize,
    /// Stretches for which no law was found.
    pub unsolved: usize,
}

impl<const N: usize> Default for Window<N> {
    fn default() -> Self {
        Window {
            most_cells: MOST_CELLS,
            stretches: Vec::new(),
            nodes: Vec::new(),
            estimate: Vec::new(),
            cells: Vec::new(),
            span_of: Vec::new(),
            cuts: Vec::new(),
            last: Known::default(),
            kept: Vec::new(),
            law: TimeParametrisation::default(),
            pieces: Vec::new(),
            effort: Effort::default(),
            faster: Vec::new(),
        }
    }
}

/// Part of the speed by which a plan may be faster than the slowing down.
const LOOSE: f64 = 1e-3;

/// The speed that is asked for on a span at the distance `s`, while slowing down.
fn asked<const N: usize>(faster: &[JerkSegment], span: &PathSegment<N>, s: f64) -> f64 {
    let begun = faster.partition_point(|piece| piece.distance <= s);
    match faster[..begun].last() {
        Some(piece) if s < piece.distance + piece.at(piece.duration).0 => {
            let (_, speed, _) = piece.at(instant_at(piece, s));
            span.speed.max(speed * (1.0 + LOOSE))
        }
        _ => span.speed,
    }
}

impl<const N: usize> Window<N> {
    /// The result of the last plan.
    pub fn pieces(&self) -> &[JerkSegment] {
        &self.pieces
    }

    /// What planning took so far.
    pub fn effort(&self) -> Effort {
        self.effort
    }

    /// No motion at all.
    pub fn stay(&mut self) {
        self.cells.clear();
        self.pieces.clear();
    }

    /// The fastest motion along a straight span from `departure` to rest at its end, in closed
    /// form; also from a speed beyond what is asked for.
    ///
    /// # Errors
    /// The end comes too soon for that.
    pub fn straight(
        &mut self,
        span: &PathSegment<N>,
        limits: &Limits<N>,
        departure: PathState,
    ) -> Result<(), NoSolution> {
        self.stay();
        let start = State {
            p: departure.distance,
            v: departure.speed,
            a: departure.acceleration,
        };
        let end = State::at_rest(span.start + span.curve.length());
        let axis = Axis::new(start, end, Bounds::along(span, limits).limits());
        let profile = state_to_state::plan(&axis, 0.0).map_err(|_| NoSolution)?;
        let speed = profile.extrema().velocity;
        if speed.min < -ROUNDING * speed.max {
            return Err(NoSolution);
        }
        self.pieces
            .extend(profile.pieces().map(|(at, segment)| JerkSegment {
                duration: segment.duration,
                distance: at.p,
                speed: at.v,
                acceleration: at.a,
                jerk: segment.jerk,
            }));
        Ok(())
    }

    /// A motion from rest at `from` to rest at the end of the span there that needs no search.
    pub fn crawl(&mut self, spans: &[PathSegment<N>], from: f64, limits: &Limits<N>) {
        self.stay();
        let ahead = |s: &&PathSegment<N>| s.start + s.curve.length() > from + 1e-9;
        if let Some(span) = spans.iter().find(ahead) {
            let length = span.start + span.curve.length() - from;
            self.pieces
                .extend(rest_to_rest(from, length, Bounds::along(span, limits)));
        }
    }

    /// The fastest motion along `spans` from `departure`, best a piece's start in the last plan, to rest
    /// at `end` or, where that takes too many cells, before it, though not before the last plan's
    /// end; inside `limits` and each span's feed. For `halvings` the cells are halved that often and once
    /// more.
    ///
    /// # Errors
    /// No law was found that the certificate passes.
    pub fn plan(
        &mut self,
        spans: &[PathSegment<N>],
        limits: &Limits<N>,
        departure: PathState,
        end: f64,
        halvings: u32,
    ) -> Result<(), NoSolution> {
        self.effort.stretches += 1;
        // No way leads to where no speed is asked for.
        let slow = (self.faster.last()).map_or(departure.distance, JerkSegment::end);
        let reached = spans.iter().take_while(|s| s.start < end);
        if slow < end && reached.last().is_some_and(|s| s.speed <= 0.0) {
            return Err(NoSolution);
        }
        let room = departure.distance + room_to_stop(spans, limits, departure);
        let rest = self.keep(departure, end).max(room).min(end);
        let most = if halvings > 0 {
            self.most_cells >> (halvings + 1)
        } else {
            self.most_cells
        };
        let planned = self.search(spans, limits, departure, (end, rest), most);
        if planned.is_ok() {
            self.last.rests = true;
            self.last.pieces.clone_from(&self.pieces);
            self.last.cells.clear();
            let cells = self.nodes[1..].iter().zip(&self.law.nodes()[1..]);
            let cells = cells.zip(&self.cells);
            self.last
                .cells
                .extend(cells.map(|((&s, node), cell)| (s, node.w, cell.share)));
        } else {
            self.effort.unsolved += 1;
        }
        planned
    }

    /// The result of the last plan, with its cells' shares of the limits.
    pub(super) fn laid(&self) -> Vec<Laid> {
        let shares = self.cells.iter().map(|cell| cell.share);
        let shares = shares.chain(repeat([1.0; 2]));
        let laid = self.pieces.iter().zip(shares);
        laid.map(|(&piece, share)| Laid { piece, share }).collect()
    }

    /// A beginning of a plan whose cells are taken over by one from a state on it.
    pub(super) fn recall(&mut self, plan: &[Laid]) {
        self.last.rests = false;
        self.last.pieces.clear();
        self.last.cells.clear();
        for &Laid { piece, share } in plan {
            let (_, v, _) = piece.at(piece.duration);
            self.last.pieces.push(piece);
            self.last.cells.push((piece.end(), v * v, share));
        }
    }

    /// A state of the last plan some way on from `departure`, and how many pieces there are in
    /// between.
    pub fn later(&self, departure: PathState) -> Option<(u64, PathState)> {
        let pieces = &self.last.pieces;
        let now = pieces
            .iter()
            .position(|p| PathState::from(*p) == departure)?;
        let next = now + (pieces.len() - now) / 4;
        (next > now).then(|| ((next - now) as u64, pieces[next].into()))
    }

    fn search(
        &mut self,
        spans: &[PathSegment<N>],
        limits: &Limits<N>,
        departure: PathState,
        (end, rest): (f64, f64),
        most_cells: usize,
    ) -> Result<(), NoSolution> {
        // The last stretch's law comes to rest, so one that ends no sooner exists.
        self.survey(spans, limits, departure, end);
        if !self.cut(departure, most_cells) {
            let end = self.nodes[most_cells * 9 / 10].max(rest);
            self.survey(spans, limits, departure, end);
            if !self.cut(departure, TOO_MANY_CELLS) {
                return Err(NoSolution);
            }
        }
        self.fill(spans, limits);
        self.effort.cells += self.cells.len();
        let start = Node {
            w: departure.speed * departure.speed,
            a: departure.acceleration,
        };

        let mut known = Vec::new();
        for round in 0..ROUNDS {
            known.clear();
            known.extend_from_slice(self.law.nodes());
            let mut solve = |guess: &mut dyn Iterator<Item = Node>, barrier| {
                let outcome =
                    (self.law).solve(&self.cells, limits, start, guess, barrier, TOLERANCE);
                self.effort.laws += 1;
                self.effort.steps += outcome.iterations;
                outcome.converged
            };
            // From the law before, unless that leads nowhere.
            let solved = round > 0 && solve(&mut known.iter().copied(), BARRIER_FROM_LAST) || {
                let kept = self.kept.len();
                solve(
                    &mut guess(&self.nodes, &self.estimate, start, kept),
                    BARRIER_FROM_GUESS,
                )
            };
            if !solved {
                return Err(NoSolution);
            }
            self.read();
            if !self.continuous() {
                return Err(NoSolution);
            }
            let excess = self.tighten(spans, limits, round);
            if excess <= 1.0 {
                return Ok(());
            }
            // From rest the whole may be slowed down.
            if departure.speed == 0.0 && (excess <= 1.0 + SLOWED || round + 1 == ROUNDS) {
                for piece in &mut self.pieces {
                    piece.duration *= excess;
                    piece.speed /= excess;
                    piece.acceleration /= excess * excess;
                    piece.jerk /= excess * excess * excess;
                }
                return Ok(());
            }
        }
        Err(NoSolution)
    }

    /// Sets aside the cells of the last plan that follow on `departure`: on them the law goes on as
    /// it did, so there is one. Returns where it ended.
    fn keep(&mut self, departure: PathState, end: f64) -> f64 {
        self.kept.clear();
        let pieces = &self.last.pieces;
        match pieces.iter().position(|p| PathState::from(*p) == departure) {
            Some(first) if departure.speed > 0.0 => {
                let after = &self.last.cells[first..];
                let (most, until) = if self.last.rests {
                    (after.len() / 2, f64::INFINITY)
                } else {
                    (
                        after.len(),
                        departure.distance + KEPT_WAY * (end - departure.distance),
                    )
                };
                let kept = after[..most.min(KEPT_CELLS)].iter();
                self.kept.extend(kept.take_while(|(s, ..)| *s < until));
                after[after.len() - 1].0
            }
            _ => departure.distance,
        }
    }

    /// Estimates the speed along the stretch, for the grid and the first guess only.
    fn survey(
        &mut self,
        spans: &[PathSegment<N>],
        limits: &Limits<N>,
        departure: PathState,
        end: f64,
    ) {
        self.stretches.clear();
        for span in spans {
            let length = span.curve.length();
            let (from, to) = (
                (departure.distance - span.start).max(0.0),
                (end - span.start).min(length),
            );
            if from >= to {
                continue;
            }
            let straight = span.curve.direction().is_some();
            let speed = |s: f64| asked(&self.faster, span, span.start + s);
            let mut before = Rates::at(&span.curve.at(from).into(), limits, speed(from));
            let mut s0 = from;
            while s0 < to {
                // A part that is nearly all there is is all there is.
                let next = span.curve.next_cut(s0, CELL_TURN);
                let s1 = if next < to - 0.1 * (next - s0) {
                    next
                } else {
                    to
                };
                let after = if straight && self.faster.is_empty() {
                    before
                } else {
                    Rates::at(&span.curve.at(s1).into(), limits, speed(s1))
                };
                let rates = before.least(after);
                self.stretches.push(Stretch {
                    from: span.start + s0,
                    to: span.start + s1,
                    cap: rates.cap,
                    acceleration: rates.acceleration,
                    jerk: rates.jerk,
                    level: [span.start + s0, span.start + s1],
                    w: [rates.cap; 2],
                    tick: 0.0,
                    last_tick: f64::INFINITY,
                });
                before = after;
                s0 = s1;
            }
        }
        let level = |a: f64, b: f64| (a - b).abs() <= 1e-3 * b;
        for k in 1..self.stretches.len() {
            if level(self.stretches[k - 1].cap, self.stretches[k].cap) {
                self.stretches[k].level[0] = self.stretches[k - 1].level[0];
            }
        }
        for k in (1..self.stretches.len()).rev() {
            if level(self.stretches[k - 1].cap, self.stretches[k].cap) {
                self.stretches[k - 1].level[1] = self.stretches[k].level[1];
            }
        }
        let mut w = departure.speed * departure.speed;
        for s in &mut self.stretches {
            s.w[0] = s.w[0].min(w);
            w = s.climb(w, s.to - s.from).min(s.cap);
            s.w[1] = w;
        }
        let mut w = 0.0;
        for s in self.stretches.iter_mut().rev() {
            s.w[1] = s.w[1].min(w);
            w = s.climb(s.w[1], s.to - s.from).min(s.w[0]);
            s.w[0] = w;
        }
        let mut next = f64::INFINITY;
        for s in self.stretches.iter_mut().rev() {
            let middle = s.estimate(0.5 * (s.from + s.to));
            let top = s.w[0].max(s.w[1]).max(middle);
            s.tick = s.ramp(top) / CELLS_PER_RAMP;
            s.last_tick = next;
            let duration = 2.0 * (s.to - s.from) / (s.w[0].sqrt() + s.w[1].sqrt());
            next = s.tick.min(next + FINER * duration);
        }
    }
    /// Lays the nodes: about equal times apart, by the estimate. False where they are more than so many,
    /// and those behind are missing.
    fn cut(&mut self, departure: PathState, most: usize) -> bool {
        self.nodes.clear();
        self.estimate.clear();
        let mut s = departure.distance;
        self.nodes.push(s);
        self.estimate.push(departure.speed * departure.speed);
        for &(next, w, _) in &self.kept {
            s = next;
            self.nodes.push(s);
            self.estimate.push(w);
        }
        let last = self.stretches.len() - 1;
        let mut pace = f64::INFINITY;
        for k in 0..self.stretches.len() {
            let stretch = self.stretches[k];
            if stretch.to <= s && k < last {
                continue;
            }
            let tick = stretch.tick;
            let ramp = CELLS_PER_RAMP * tick;
            loop {
                if self.nodes.len() > most {
                    return false;
                }
                let rest = stretch.to - s;
                let v = stretch.estimate(s).sqrt();
                let left = rest / (0.5 * (v + stretch.w[1].sqrt()));
                pace = tick.min(1.5 * pace).min(stretch.last_tick + FINER * left);
                // What is travelled in that time from rest, and to rest.
                let tip = (stretch.jerk * pace * pace * pace / 6.0).max(SHORTEST);
                let ahead = stretch.estimate(s + (v * pace).max(tip)).sqrt();
                let mut step = (0.5 * (v + ahead) * pace).max(tip);
                // Far from where the speed has to change, long cells do.
                let cruise = v * ramp;
                let [from, to] = stretch.level;
                let clear = (s - from).min(to - s - step) - 3.0 * cruise;
                if clear > 0.0 && v * v >= 0.999 * stretch.cap {
                    step = step.max(clear.min(cruise));
                }
                if k == last && rest <= 27.0 * tip * 1.01 {
                    // t³ apart from the end: 27, 8, 1.
                    for cubes in [8.0, 1.0] {
                        let next = stretch.to - cubes * tip;
                        if next > s + 0.2 * tip {
                            self.push(next, stretch.estimate(next));
                            s = next;
                        }
                    }
                }
                if rest <= 1.5 * step || k == last && rest <= 27.0 * tip * 1.01 {
                    self.push(stretch.to, stretch.w[1]);
                    s = stretch.to;
                    break;
                }
                if rest < 2.0 * step && k != last {
                    step = 0.5 * rest;
                }
                s += step;
                self.push(s, stretch.estimate(s));
            }
        }
        self.lead_over();
        // Three cells at least.
        while self.nodes.len() < 5 {
            let (i, _) = (0..self.nodes.len() - 1)
                .map(|i| (i, self.nodes[i + 1] - self.nodes[i]))
                .fold((0, 0.0), |best, x| if x.1 > best.1 { x } else { best });
            let middle = 0.5 * (self.nodes[i] + self.nodes[i + 1]);
            let w = 0.5 * (self.estimate[i] + self.estimate[i + 1]);
            self.nodes.insert(i + 1, middle);
            self.estimate.insert(i + 1, w);
        }
        self.nodes.len() <= most
    }

    /// Leads the estimate over from what is kept of the last law to the survey's, within what is
    /// travelled in two ramps of the acceleration.
    fn lead_over(&mut self) {
        let Some(&(from, w, _)) = self.kept.last() else {
            return;
        };
        let Some(stretch) = self.stretches.iter().find(|s| s.to >= from) else {
            return;
        };
        let above = w / stretch.estimate(from) - 1.0;
        let way = 2.0 * w.sqrt() * stretch.ramp(stretch.cap);
        if !above.is_finite() {
            return;
        }
        let first = self.kept.len() + 1;
        for (s, estimate) in self.nodes[first..].iter().zip(&mut self.estimate[first..]) {
            let left = 1.0 - (s - from) / way;
            if left.is_nan() || left <= 0.0 {
                break;
            }
            *estimate *= 1.0 + above * left * left;
        }
    }

    /// Takes the geometry and the limits of every cell.
    fn fill(&mut self, spans: &[PathSegment<N>], limits: &Limits<N>) {
        self.cells.clear();
        self.span_of.clear();
        let mut index = 0;
        let mut before = f64::INFINITY;
        for ends in self.nodes.windows(2) {
            // By the middle: the ends may be off by rounding.
            let middle = 0.5 * (ends[0] + ends[1]);
            while middle >= spans[index].start + spans[index].curve.length()
                && index + 1 < spans.len()
            {
                index += 1;
            }
            let span = &spans[index];
            let slopes: [Slope<N>; 2] =
                [ends[0], ends[1]].map(|s| span.curve.at(s - span.start).into());
            let [first, second] =
                slopes.map(|slope| Rates::at(&slope, limits, f64::INFINITY).fast.sqrt());
            let [begin, within] = [ends[0], middle].map(|s| asked(&self.faster, span, s));
            self.cells.push(Cell {
                length: ends[1] - ends[0],
                ends: slopes,
                speed: [
                    SPEED_SHARE * before.min(first).min(begin),
                    SPEED_SHARE * first.min(second).min(within),
                ],
                share: if span.curve.direction().is_some() {
                    [1.0; 2]
                } else {
                    [1.0 - CURVE_SHARE; 2]
                },
            });
            self.span_of.push(index);
            before = second.min(asked(&self.faster, span, ends[1]));
        }
        for (cell, &(_, _, share)) in self.cells.iter_mut().zip(&self.kept) {
            cell.share = share;
        }
    }

    /// Reads the pieces off the solution.
    fn read(&mut self) {
        self.pieces.clear();
        for ((&distance, node), (duration, jerk)) in self
            .nodes
            .iter()
            .zip(self.law.nodes())
            .zip(self.law.motions())
        {
            self.pieces.push(JerkSegment {
                duration,
                distance,
                speed: node.w.sqrt(),
                acceleration: node.a,
                jerk,
            });
        }
    }

    /// Whether every piece ends where and as the next one begins, the last one at rest, and none goes back.
    fn continuous(&self) -> bool {
        let ends = self.nodes[1..].iter().zip(&self.law.nodes()[1..]);
        self.pieces.iter().zip(ends).all(|(piece, (&s, node))| {
            let (ds, v, a) = piece.at(piece.duration);
            let fast = piece.speed.max(v);
            let turn = -piece.acceleration / piece.jerk;
            let slow = if turn > 0.0 && turn < piece.duration {
                piece.at(turn).1
            } else {
                0.0
            };
            piece.duration > 0.0
                && slow >= -SEAM * fast
                && piece.duration.is_finite()
                && piece.jerk.is_finite()
                && (piece.distance + ds - s).abs() <= SEAM * (s - piece.distance)
                && (v - node.w.sqrt()).abs() <= SEAM * fast
                && (a - node.a).abs() * piece.duration <= SEAM * fast
        })
    }

    /// Lowers the shares of the limits in and about the cells that break one, by the excess and
    /// more from round to round. Returns by what the time would have to be stretched for none to be
    /// broken; 1 if none is.
    fn tighten(&mut self, spans: &[PathSegment<N>], limits: &Limits<N>, round: usize) -> f64 {
        self.cuts.clear();
        self.cuts.resize(self.pieces.len(), [1.0; 3]);
        let margin = MARGIN * (1_usize << round.min(5)) as f64;
        let mut stretch = 1.0_f64;
        for k in 0..self.pieces.len() {
            let (piece, span) = (&self.pieces[k], &spans[self.span_of[k]]);
            let ends = [self.nodes[k], self.nodes[k + 1]];
            let [begin, end] = ends.map(|s| asked(&self.faster, span, s));
            let speed = begin.max(end);
            let load = if speed > span.speed {
                load(piece, &PathSegment { speed, ..*span }, limits)
            } else {
                load(piece, span, limits)
            };
            // What is cut off here shows up next door, above all where a plateau is reached.
            let near = [
                (load.velocity, load.velocity, NEAR_SPEED),
                (load.acceleration, load.acceleration.sqrt(), round),
                (load.jerk, libm::cbrt(load.jerk), round),
            ];
            for (what, (load, root, near)) in near.into_iter().enumerate() {
                if load > 1.0 + ROUNDING {
                    stretch = stretch.max(root);
                    let by = load * (1.0 + if what == 0 { 0.1 * margin } else { margin });
                    let last = (k + near).min(self.pieces.len() - 1);
                    for cuts in &mut self.cuts[k.saturating_sub(near)..=last] {
                        cuts[what] = cuts[what].max(by);
                    }
                }
            }
        }
        if stretch > 1.0 {
            let mut before = [1.0; 3];
            for (cell, &cuts) in self.cells.iter_mut().zip(&self.cuts) {
                // The node belongs to both of its cells.
                cell.speed[0] /= cuts[0].max(before[0]);
                cell.speed[1] /= cuts[0];
                cell.share[0] /= cuts[1].max(before[1]);
                cell.share[1] /= cuts[2];
                before = cuts;
            }
        }
        stretch
    }

    fn push(&mut self, s: f64, w: f64) {
        self.nodes.push(s);
        self.estimate.push(w);
    }
}

/// What the axes allow at a point of the path.
#[derive(Debug, Clone, Copy)]
struct Rates {
    fast: f64,
    cap: f64,
    acceleration: f64,
    jerk: f64,
}

impl Rates {
    fn at<const N: usize>(slope: &Slope<N>, limits: &Limits<N>, feed: f64) -> Self {
        let mut r = Rates {
            fast: feed * feed,
            cap: f64::INFINITY,
            acceleration: f64::INFINITY,
            jerk: f64::INFINITY,
        };
        for i in 0..N {
            let (d1, d2, d3) = (slope.d1[i].abs(), slope.d2[i].abs(), slope.d3[i].abs());
            let v = limits.velocity[i] / d1;
            r.fast = r.fast.min(v * v);
            let bend = libm::cbrt(limits.jerk[i] / d3);
            r.cap = r.cap.min(limits.acceleration[i] / d2).min(bend * bend);
            r.acceleration = r.acceleration.min(limits.acceleration[i] / d1);
            r.jerk = r.jerk.min(limits.jerk[i] / d1);
        }
        r.cap = r.cap.min(r.fast);
        r
    }

    fn least(self, other: Rates) -> Rates {
        Rates {
            fast: self.fast.min(other.fast),
            cap: self.cap.min(other.cap),
            acceleration: self.acceleration.min(other.acceleration),
            jerk: self.jerk.min(other.jerk),
        }
    }
}

impl Stretch {
    /// Time in which an axis builds up the acceleration that it comes to where ṡ² is `top` at most.
    fn ramp(&self, top: f64) -> f64 {
        (self.acceleration / self.jerk).min((top.sqrt() / self.jerk).sqrt())
    }

    /// Estimate of ṡ² at the distance `s`.
    fn estimate(&self, s: f64) -> f64 {
        let up = self.climb(self.w[0], (s - self.from).max(0.0));
        let down = self.climb(self.w[1], (self.to - s).max(0.0));
        up.min(down).min(self.cap)
    }

    /// ṡ² a distance `s` after it was `w`, at most: under constant jerk ṡ^(3/2) goes in proportion
    /// to the distance (from rest, s = j t³/6 and ṡ = j t²/2), from ṡ = a²/2j on ṡ² does.
    fn climb(&self, w: f64, s: f64) -> f64 {
        let knee = self.acceleration * self.acceleration / (2.0 * self.jerk);
        let rate = (4.5 * self.jerk).sqrt();
        let v = w.sqrt();
        let to_knee = (knee * knee.sqrt() - v * v.sqrt()) / rate;
        if s < to_knee {
            let x = v * v.sqrt() + rate * s;
            x * libm::cbrt(x)
        } else {
            w.max(knee * knee) + 2.0 * self.acceleration * (s - to_knee.max(0.0))
        }
    }
}

/// More than the way to rest in the direction that the path has at `from`.
pub(super) fn room_to_stop<const N: usize>(
    spans: &[PathSegment<N>],
    limits: &Limits<N>,
    from: PathState,
) -> f64 {
    let here = spans.iter().rev().find(|s| s.start <= from.distance);
    let along = here.map(|s| s.curve.at(from.distance - s.start).d1);
    let least = |limit: &[f64; N]| {
        let part = along.unwrap_or([1.0; N]);
        (0..N)
            .map(|i| limit[i] / part[i].abs())
            .fold(f64::INFINITY, f64::min)
    };
    let (a, j) = (least(&limits.acceleration), least(&limits.jerk));
    let rising = from.acceleration.max(0.0);
    let peak = from.speed + rising * rising / (2.0 * j);
    0.75 * peak * (peak / a + a / j).max(2.0 * (peak / j).sqrt())
}

/// First iterate: a slow motion of the shape of the estimate; over the first `kept` nodes it slows
/// down from the estimate itself.
fn guess(nodes: &[f64], estimate: &[f64], start: Node, kept: usize) -> impl Iterator<Item = Node> {
    const SLOW: f64 = 0.3;
    let last = nodes.len() - 1;
    (0..=last).map(move |k| {
        if k == 0 {
            return start;
        }
        if k == last {
            return Node::default();
        }
        let w = |k: usize| {
            let part = if k < kept {
                k as f64 / kept as f64
            } else {
                1.0
            };
            (1.0 - (1.0 - SLOW) * part) * estimate[k]
        };
        let a = 0.5 * (w(k + 1) - w(k - 1)) / (nodes[k + 1] - nodes[k - 1]);
        Node {
            w: w(k).max(1e-12),
            a,
        }
    })
}
