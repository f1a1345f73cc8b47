//! Plans a stretch of a section: cuts it into cells, solves for the time parametrisation, turns it into jerk segments
//! and certifies them.
//!
//! # How
//!
//! 1. A survey estimates the speed along the stretch by closed forms, for the grid and the first guess only; the
//!    grid puts cells about equal times apart by it, finer where the path bends and towards ramps, longer
//!    in a cruise.
//! 2. The [time parametrisation](super::time_parametrisation) is solved over the cells.
//! 3. Every jerk segment is bounded at every instant by the [certificate](super::certify). Where a limit breaks, its
//!    share is taken back in the cell and in its neighbours, by more from round to round, and the problem is solved
//!    again from the solution; a plan from rest may be stretched in time as a whole instead.
//! 4. What breaks a limit still, or does not join to 1e-9, is not handed over.
//!
//! # Going on in motion
//!
//! A stretch that begins in the midst of the last plan takes over the first cells of that, with their shares of the
//! limits: on those cells the last plan's own motion is a solution, so there is one. On cells of its own there might
//! be none, for a state between the nodes of other cells is allowed by them and may not be by these.

mod grid;

use std::iter::repeat;
use std::ops::Add;

use grid::{SHORTEST, Stretch};

use super::bounds::{Bounds, rest_to_rest};
use super::brake::instant_at;
use super::certify::{ROUNDING, load};
use super::plan::PlannedSegment;
use super::time_parametrisation::{Cell, NodeState, TimeParametrisation};
use super::{JerkSegment, Limits, PathSegment, PathState};
use crate::profile::State;
use crate::state_to_state::{self, Problem};

impl From<JerkSegment> for PathState {
    fn from(segment: JerkSegment) -> Self {
        PathState {
            distance: segment.distance,
            speed: segment.speed,
            acceleration: segment.acceleration,
        }
    }
}

/// Cells of a stretch, about.
pub(super) const MOST_CELLS: usize = 600;
/// With more there is no solution: the limits differ by too much.
pub(super) const TOO_MANY_CELLS: usize = 16 * MOST_CELLS;

/// What one call of the planner may spend on time parametrisations, cells times Newton steps; the one that is being
/// solved for then is solved. Windows take a hundredth of it.
pub(super) const MOST_WORK: usize = 2_000_000;

/// Barrier of the first solution and of those with tightened limits, in motion times.
const BARRIER_FROM_GUESS: f64 = 0.3;
const BARRIER_FROM_LAST: f64 = 0.01;

/// Tolerance of the optimisation, as a part of the motion time.
const TOLERANCE: f64 = 3e-4;
/// Rounds of solving with limits tightened where the solution broke them between nodes.
const ROUNDS: usize = 10;
/// Parts of a curve that are crawled along by themselves are no shorter, mm.
const SHORTEST_CRAWL: f64 = 1e-3;
/// What is taken off a broken limit beyond the excess; twice that in every further round.
const MARGIN: f64 = 5e-4;
/// What may be missing between two jerk segments, as a part of what changes in one.
const SEAM: f64 = 1e-9;
/// Cells on both sides of one that is too fast in which the speed is lowered, too.
const NEAR_SPEED: usize = 8;
/// Part of its time by which a plan from rest may be stretched instead of being improved.
const SLOWED: f64 = 2e-4;
/// Cells of the last stretch that the next one takes over, at most: time enough to do otherwise
/// than the last one meant to.
const KEPT_CELLS: usize = 40;
/// Part of the distance on which cells are taken over from another plan.
const KEPT_PART: f64 = 0.8;
/// What is kept of the acceleration and jerk limits on curves from the first, for what happens
/// between the nodes.
const CURVE_SHARE: f64 = 5e-4;
/// Part of the speed limit that is planned, so that rounding stays inside.
const SPEED_SHARE: f64 = 1.0 - 2e-5;

/// No time parametrisation of a stretch was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NoSolution;

/// Where a stretch has too many cells it is planned up to this part of them, so that those of a survey that ends
/// there are not too many again.
const SHORTENED: (usize, usize) = (9, 10);
/// The state to go on from that is tried after one that failed: this part of the last plan further on.
const LATER: usize = 4;
/// Times that the margin is doubled from round to round, at most.
const MOST_DOUBLINGS: usize = 5;
/// The margin of speeds, as a part of the others: they are exact but for what happens next door.
const SPEED_MARGIN: f64 = 0.1;
/// The distance to rest along an axis, with half as much again: bends need some of the limits.
const ROOM: f64 = 0.75;
/// ṡ² of the first iterate, as a part of the estimate's: inside of all limits.
const SLOW: f64 = 0.3;
/// ṡ² of the first iterate at least, mm²/s²: it has to be positive.
const LEAST_GUESS: f64 = 1e-12;

/// Scratch space of the planning of a stretch.
#[derive(Debug, Clone)]
pub struct Window<const N: usize> {
    /// Cells of a stretch, about.
    pub(super) most_cells: usize,
    stretches: Vec<Stretch>,
    nodes: Vec<f64>,
    estimate: Vec<f64>,
    cells: Vec<Cell<N>>,
    path_segment_of: Vec<usize>,
    /// By what velocity, acceleration and jerk are to be lowered in every cell.
    cuts: Vec<[f64; 3]>,
    last: Known,
    /// Cells of the last plan that are taken over.
    kept: Vec<KnownCell>,
    solver: TimeParametrisation<N>,
    segments: Vec<JerkSegment>,
    effort: Effort,
    /// Cells times Newton steps that may still be spent; nothing is found once it is.
    allowance: usize,
    /// A slowing down to the speed that is asked for; where it is faster than that, so may the plan be.
    pub(super) faster: Vec<JerkSegment>,
}

/// The last plan that was found.
#[derive(Debug, Clone, Default)]
struct Known {
    segments: Vec<JerkSegment>,
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
    /// Time parametrisations solved for; more than stretches where limits had to be tightened.
    pub solves: usize,
    /// Newton steps of all of them.
    pub steps: usize,
    /// Cells times Newton steps of all of them: what planning takes time for.
    pub work: usize,
    /// Stretches for which none was found.
    pub unsolved: usize,
}

impl Add for Effort {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Effort {
            stretches: self.stretches + other.stretches,
            cells: self.cells + other.cells,
            solves: self.solves + other.solves,
            steps: self.steps + other.steps,
            work: self.work + other.work,
            unsolved: self.unsolved + other.unsolved,
        }
    }
}

impl<const N: usize> Default for Window<N> {
    fn default() -> Self {
        Window {
            most_cells: MOST_CELLS,
            stretches: Vec::new(),
            nodes: Vec::new(),
            estimate: Vec::new(),
            cells: Vec::new(),
            path_segment_of: Vec::new(),
            cuts: Vec::new(),
            last: Known::default(),
            kept: Vec::new(),
            solver: TimeParametrisation::default(),
            segments: Vec::new(),
            effort: Effort::default(),
            allowance: MOST_WORK,
            faster: Vec::new(),
        }
    }
}

/// Part of the speed by which a plan may be faster than the slowing down.
const LOOSE: f64 = 1e-3;

/// The speed that is asked for on a path segment at the distance `s`, while slowing down.
fn asked<const N: usize>(faster: &[JerkSegment], path_segment: &PathSegment<N>, s: f64) -> f64 {
    let begun = faster.partition_point(|segment| segment.distance <= s);
    match faster[..begun].last() {
        Some(segment) if s < segment.distance + segment.at(segment.duration).0 => {
            let (_, speed, _) = segment.at(instant_at(segment, s));
            path_segment.speed.max(speed * (1.0 + LOOSE))
        }
        _ => path_segment.speed,
    }
}

impl<const N: usize> Window<N> {
    /// The result of the last plan.
    pub fn segments(&self) -> &[JerkSegment] {
        &self.segments
    }

    /// What planning took so far.
    pub fn effort(&self) -> Effort {
        self.effort
    }

    /// So much may be spent from now on, cells times Newton steps.
    pub(super) fn grant(&mut self, work: usize) {
        self.allowance = work;
    }

    /// No motion at all.
    pub fn stay(&mut self) {
        self.cells.clear();
        self.segments.clear();
    }

    /// The fastest motion along a straight path segment from `departure` to rest at its end, in closed
    /// form; also from a speed beyond what is asked for.
    ///
    /// # Errors
    /// The end comes too soon for that.
    pub fn straight(
        &mut self,
        path_segment: &PathSegment<N>,
        limits: &Limits<N>,
        departure: PathState,
    ) -> Result<(), NoSolution> {
        self.stay();
        let start = State {
            p: departure.distance,
            v: departure.speed,
            a: departure.acceleration,
        };
        let end = State::at_rest(path_segment.start + path_segment.curve.length());
        let problem = Problem::new(start, end, Bounds::of(path_segment, limits).limits());
        let profile = state_to_state::plan(&problem, 0.0).map_err(|_| NoSolution)?;
        let speed = profile.extrema().velocity;
        if speed.min < -ROUNDING * speed.max {
            return Err(NoSolution);
        }
        self.segments
            .extend(profile.pieces().map(|(at, segment)| JerkSegment {
                duration: segment.duration,
                distance: at.p,
                speed: at.v,
                acceleration: at.a,
                jerk: segment.jerk,
            }));
        Ok(())
    }

    /// A motion from rest at `from` to rest in the path segment there that needs no search: at its end, or before that where
    /// the rest of it is passed sooner by itself, as of a curve that bends sharply in one place.
    pub fn crawl(&mut self, path_segments: &[PathSegment<N>], from: f64, limits: &Limits<N>) {
        self.stay();
        let ahead = |s: &&PathSegment<N>| s.start + s.curve.length() > from + SHORTEST;
        if let Some(path_segment) = path_segments.iter().find(ahead) {
            let PathSegment {
                start,
                curve,
                speed,
                clock,
                ..
            } = path_segment;
            let bounds = |from, to| match (from, to) {
                (0.0, to) if to == curve.length() => Bounds::of(path_segment, limits),
                (from, to) if clock.is_none() => {
                    Bounds::along(&curve.part(from, to), *speed, limits)
                }
                _ => Bounds::of(path_segment, limits),
            };
            let begin = (from - start).max(0.0);
            let mut end = curve.length();
            let passed = |begin: f64, end: f64| -> f64 {
                let segments = rest_to_rest(begin, end - begin, bounds(begin, end));
                segments.iter().map(|segment| segment.duration).sum()
            };
            while end - begin > SHORTEST_CRAWL {
                let middle = 0.5 * (begin + end);
                if passed(begin, middle) + passed(middle, end) >= passed(begin, end) {
                    break;
                }
                end = middle;
            }
            self.segments
                .extend(rest_to_rest(from, end - begin, bounds(begin, end)));
        }
    }

    /// The fastest motion along `path_segments` from `departure`, best a jerk segment's start in the last plan, to rest
    /// at `end` or, where that takes too many cells, before it, though not before the last plan's
    /// end; inside `limits` and each path segment's feed. For `halvings` the cells are halved that often and once
    /// more.
    ///
    /// # Errors
    /// None was found that the certificate passes.
    pub fn plan(
        &mut self,
        path_segments: &[PathSegment<N>],
        limits: &Limits<N>,
        departure: PathState,
        end: f64,
        halvings: u32,
    ) -> Result<(), NoSolution> {
        self.effort.stretches += 1;
        if self.allowance == 0 {
            return Err(NoSolution);
        }
        // The path does not get to where no speed is asked for.
        let slow = (self.faster.last()).map_or(departure.distance, JerkSegment::end);
        let reached = path_segments.iter().take_while(|s| s.start < end);
        if slow < end && reached.last().is_some_and(|s| s.speed <= 0.0) {
            return Err(NoSolution);
        }
        let room = departure.distance + room_to_stop(path_segments, limits, departure);
        let rest = self.keep(departure, end).max(room).min(end);
        let most = if halvings > 0 {
            self.most_cells >> (halvings + 1)
        } else {
            self.most_cells
        };
        let planned = self.search(path_segments, limits, departure, (end, rest), most);
        if planned.is_ok() {
            self.last.rests = true;
            self.last.segments.clone_from(&self.segments);
            self.last.cells.clear();
            let cells = self.nodes[1..].iter().zip(&self.solver.nodes()[1..]);
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
    pub(super) fn planned(&self) -> Vec<PlannedSegment> {
        let shares = self.cells.iter().map(|cell| cell.share);
        let shares = shares.chain(repeat([1.0; 2]));
        let planned = self.segments.iter().zip(shares);
        planned
            .map(|(&segment, share)| PlannedSegment { segment, share })
            .collect()
    }

    /// A beginning of a plan whose cells are taken over by one from a state on it.
    pub(super) fn recall(&mut self, plan: &[PlannedSegment]) {
        self.last.rests = false;
        self.last.segments.clear();
        self.last.cells.clear();
        for &PlannedSegment { segment, share } in plan {
            let (_, v, _) = segment.at(segment.duration);
            self.last.segments.push(segment);
            self.last.cells.push((segment.end(), v * v, share));
        }
    }

    /// A state of the last plan some way on from `departure`, and how many jerk segments there are in
    /// between.
    pub fn later(&self, departure: PathState) -> Option<(u64, PathState)> {
        let segments = &self.last.segments;
        let now = segments
            .iter()
            .position(|p| PathState::from(*p) == departure)?;
        let next = now + (segments.len() - now) / LATER;
        (next > now).then(|| ((next - now) as u64, segments[next].into()))
    }

    fn search(
        &mut self,
        path_segments: &[PathSegment<N>],
        limits: &Limits<N>,
        departure: PathState,
        (end, rest): (f64, f64),
        most_cells: usize,
    ) -> Result<(), NoSolution> {
        // The last stretch's solution comes to rest, so one that ends no sooner exists.
        self.survey(path_segments, limits, departure, end);
        if !self.cut(departure, most_cells) {
            let end = self.nodes[most_cells * SHORTENED.0 / SHORTENED.1].max(rest);
            self.survey(path_segments, limits, departure, end);
            if !self.cut(departure, TOO_MANY_CELLS) {
                return Err(NoSolution);
            }
        }
        self.fill(path_segments, limits);
        self.effort.cells += self.cells.len();
        let start = NodeState {
            w: departure.speed * departure.speed,
            a: departure.acceleration,
        };

        let mut known = Vec::new();
        for round in 0..ROUNDS {
            if self.allowance == 0 {
                return Err(NoSolution);
            }
            known.clear();
            known.extend_from_slice(self.solver.nodes());
            let mut solve = |guess: &mut dyn Iterator<Item = NodeState>, barrier| {
                let outcome = (self.solver).solve(&self.cells, start, guess, barrier, TOLERANCE);
                let work = outcome.iterations * self.cells.len();
                self.allowance = self.allowance.saturating_sub(work);
                self.effort.solves += 1;
                self.effort.steps += outcome.iterations;
                self.effort.work += work;
                outcome.converged
            };
            // From the solution before, unless that leads nowhere.
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
            let excess = self.tighten(path_segments, limits, round);
            if excess <= 1.0 {
                return Ok(());
            }
            // From rest the whole may be slowed down.
            if departure.speed == 0.0 && (excess <= 1.0 + SLOWED || round + 1 == ROUNDS) {
                for segment in &mut self.segments {
                    segment.duration *= excess;
                    segment.speed /= excess;
                    segment.acceleration /= excess * excess;
                    segment.jerk /= excess * excess * excess;
                }
                return Ok(());
            }
        }
        Err(NoSolution)
    }

    /// Sets aside the cells of the last plan that follow on `departure`: on them that plan goes on as
    /// it did, so there is a solution. Returns where it ended.
    fn keep(&mut self, departure: PathState, end: f64) -> f64 {
        self.kept.clear();
        let segments = &self.last.segments;
        match segments
            .iter()
            .position(|p| PathState::from(*p) == departure)
        {
            Some(first) if departure.speed > 0.0 => {
                let after = &self.last.cells[first..];
                let (most, until) = if self.last.rests {
                    (after.len() / 2, f64::INFINITY)
                } else {
                    (
                        after.len(),
                        departure.distance + KEPT_PART * (end - departure.distance),
                    )
                };
                let kept = after[..most.min(KEPT_CELLS)].iter();
                self.kept.extend(kept.take_while(|(s, ..)| *s < until));
                after[after.len() - 1].0
            }
            _ => departure.distance,
        }
    }

    /// Reads the jerk segments off the solution.
    fn read(&mut self) {
        self.segments.clear();
        for ((&distance, node), (duration, jerk)) in self
            .nodes
            .iter()
            .zip(self.solver.nodes())
            .zip(self.solver.motions())
        {
            self.segments.push(JerkSegment {
                duration,
                distance,
                speed: node.w.sqrt(),
                acceleration: node.a,
                jerk,
            });
        }
    }

    /// Whether every jerk segment ends where and as the next one begins, the last one at rest, and none goes back.
    fn continuous(&self) -> bool {
        let ends = self.nodes[1..].iter().zip(&self.solver.nodes()[1..]);
        self.segments.iter().zip(ends).all(|(segment, (&s, node))| {
            let (ds, v, a) = segment.at(segment.duration);
            let fast = segment.speed.max(v);
            let turn = -segment.acceleration / segment.jerk;
            let slow = if turn > 0.0 && turn < segment.duration {
                segment.at(turn).1
            } else {
                0.0
            };
            segment.duration > 0.0
                && slow >= -SEAM * fast
                && segment.duration.is_finite()
                && segment.jerk.is_finite()
                && (segment.distance + ds - s).abs() <= SEAM * (s - segment.distance)
                && (v - node.w.sqrt()).abs() <= SEAM * fast
                && (a - node.a).abs() * segment.duration <= SEAM * fast
        })
    }

    /// Lowers the shares of the limits in and about the cells that break one, by the excess and
    /// more from round to round. Returns by what the time would have to be stretched for none to be
    /// broken; 1 if none is.
    fn tighten(
        &mut self,
        path_segments: &[PathSegment<N>],
        limits: &Limits<N>,
        round: usize,
    ) -> f64 {
        self.cuts.clear();
        self.cuts.resize(self.segments.len(), [1.0; 3]);
        let margin = MARGIN * (1_usize << round.min(MOST_DOUBLINGS)) as f64;
        let mut stretch = 1.0_f64;
        for k in 0..self.segments.len() {
            let (segment, path_segment) =
                (&self.segments[k], &path_segments[self.path_segment_of[k]]);
            let ends = [self.nodes[k], self.nodes[k + 1]];
            let [begin, end] = ends.map(|s| asked(&self.faster, path_segment, s));
            let speed = begin.max(end);
            let load = if speed > path_segment.speed {
                load(
                    segment,
                    &PathSegment {
                        speed,
                        ..*path_segment
                    },
                    limits,
                )
            } else {
                load(segment, path_segment, limits)
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
                    let by = load
                        * (1.0
                            + if what == 0 {
                                SPEED_MARGIN * margin
                            } else {
                                margin
                            });
                    let last = (k + near).min(self.segments.len() - 1);
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
}

/// More than the distance to rest in the direction that the path has at `from`.
pub(super) fn room_to_stop<const N: usize>(
    path_segments: &[PathSegment<N>],
    limits: &Limits<N>,
    from: PathState,
) -> f64 {
    let here = path_segments
        .iter()
        .rev()
        .find(|s| s.start <= from.distance);
    let along = here.map(|s| s.slope(from.distance - s.start).d1);
    let limits = here.map_or(limits, |s| s.limits(limits));
    let least = |limit: &[f64; N]| {
        let part = along.unwrap_or([1.0; N]);
        (0..N)
            .map(|i| limit[i] / part[i].abs())
            .fold(f64::INFINITY, f64::min)
    };
    let (a, j) = (least(&limits.acceleration), least(&limits.jerk));
    let rising = from.acceleration.max(0.0);
    let peak = from.speed + rising * rising / (2.0 * j);
    ROOM * peak * (peak / a + a / j).max(2.0 * (peak / j).sqrt())
}

/// First iterate: a slow motion of the shape of the estimate; over the first `kept` nodes it slows
/// down from the estimate itself.
fn guess(
    nodes: &[f64],
    estimate: &[f64],
    start: NodeState,
    kept: usize,
) -> impl Iterator<Item = NodeState> {
    let last = nodes.len() - 1;
    (0..=last).map(move |k| {
        if k == 0 {
            return start;
        }
        if k == last {
            return NodeState::default();
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
        NodeState {
            w: w(k).max(LEAST_GUESS),
            a,
        }
    })
}
