//! A braking in the making: its cells, and what is done to them from round to round.
//!
//! It has two parts. In the rising cells an acceleration is taken back, step by step in time, as fast as the
//! axes' jerks allow at both ends of each. In the falling cells the speed comes down: their nodes keep
//! their speeds from round to round, and a round finds the accelerations at them, and so the places.

use super::node::{BrakingNode, PathCursor, accelerations, jerks};
use super::{Braking, ROUNDING, instant_at};
use crate::path::{Curve, Limits, PathSegment, PathState};

/// Falling cells, at most: room for those of the finer search.
pub(super) const MOST_FALLING: usize = 160;
/// Rising cells, at most.
pub(super) const MOST_RISING: usize = 120;
/// Parts of a polynomial that deserve a cell of their own: a blend's second derivative rises and falls once,
/// its third changes its sign twice.
pub(super) const POLY_CELLS: f64 = 6.0;

/// How finely a braking is searched for.
#[derive(Debug, Clone, Copy)]
pub(super) struct Resolution {
    /// Falling cells at first, and at most where the path changes quickly.
    falling: usize,
    most_falling: usize,
    /// Rising cells at most.
    most_rising: usize,
    /// Cells at whose ends the jerks that are allowed differ by more, as a part of what they are where
    /// nothing bends, are cut; and the same for rising ones.
    uneven: f64,
    uneven_rise: f64,
    /// A braking whose nodes move by no more in a round, as a part of its length, has settled.
    settled: f64,
    /// Times that a jerk segment on a polynomial is halved, at most, to prove that it keeps the limits.
    halvings: usize,
}

/// Between two setpoints, where an answer is wanted within cycles.
pub(super) const QUICK: Resolution = Resolution {
    falling: 24,
    most_falling: 72,
    most_rising: 60,
    uneven: 0.05,
    uneven_rise: 0.02,
    settled: 1e-2,
    halvings: 3,
};
/// For a planner, which has milliseconds.
pub(super) const FINE: Resolution = Resolution {
    falling: 32,
    most_falling: MOST_FALLING,
    most_rising: MOST_RISING,
    uneven: 0.03,
    uneven_rise: 0.02,
    settled: 5e-3,
    halvings: 5,
};

/// Rising cells where nothing bends …
const RISING_STEPS: f64 = 8.0;
/// … and the shortest ones as a part of those.
const SHORTEST: f64 = 0.03;
/// A step that was even enough is followed by one longer by this.
const LONGER: f64 = 1.4;
/// Where rising cells are used before their time, by the share of the acceleration that is gone, they may be
/// less even: by a power of two for each of so many parts of them.
const LOOSER: f64 = 8.0;
/// An acceleration that is a smaller part of the first one is gone.
const NO_ACCELERATION: f64 = 1e-9;
/// Where the E that is allowed is a smaller part of the one where nothing bends, the path cannot be passed at
/// that speed; meanwhile it is taken not to bend.
const IMPASSABLE: f64 = 4e-4;

/// Rounds after which places that have not settled will not.
const MOST_ROUNDS: usize = 40;
/// Range of Anderson's mixing: how much of the step before is taken back, or gone once more. Steps that
/// go the same way may be lengthened threefold; one that alternates is never taken back whole.
const MIXING: [f64; 2] = [-2.0, 0.9];
/// Times that cells are cut where the path changes quickly.
const MOST_REFINEMENTS: usize = 2;
/// Parts that one is cut into at most.
const MOST_PARTS: f64 = 4.0;
/// Cells that are shorter than the first ones, by these parts, are not cut any more: about a joint, and
/// anywhere.
const SHORTEST_AT_JOINT: f64 = 0.5;
const SHORTEST_CUT: f64 = 0.1;
/// A limit that is broken is undercut by this part, so that the next round is inside of it.
const UNDERCUT: f64 = 1e-3;
/// Rising steps are halved where that proves something, down to this part of the first ones.
const SHORTEST_STEP: f64 = 0.1;

/// What work counts, roughly 0.2 µs each with six axes: a look at the path in a place …
pub(super) const LOOKING: usize = 2;
/// … a node in a round …
const RELAXING: usize = 1;
/// … and a proof for a cell on a polynomial.
pub(super) const PROVING: usize = 12;

/// A braking in the making.
#[derive(Debug, Clone, Copy)]
pub(super) struct SearchState<const N: usize> {
    resolution: Resolution,
    target: f64,
    /// First the acceleration is taken back, in so many cells.
    rising: [BrakingNode<N>; MOST_RISING + 1],
    pub(super) rising_cells: usize,
    /// Then the speed comes down.
    pub(super) falling: [BrakingNode<N>; MOST_FALLING + 1],
    falling_cells: usize,
    /// What was done since the search goes on, in units of [`RELAXING`].
    pub(super) work: usize,
    /// Duration of its cells in the first guess, and how often some were cut.
    tick: f64,
    /// Part of the longest step in which an acceleration is taken back, that step and the next one.
    step: f64,
    longest: f64,
    stride: f64,
    rounds: usize,
    refined: usize,
    /// By how far the nodes went in the last round, at most, mm.
    moved: f64,
}

/// Part of a cell that is cut off on either side of a joint.
const SHORT: f64 = 0.05;
/// The plan that is left may be at its limits, so that nothing proves that the first cells keep them
/// closer than this.
const ENTRY: usize = 2;
const ENTRY_SLACK: f64 = 1e-6;
/// What is used of the limits where a braking that is closer to them is not certain to keep them.
const UNCERTAIN: f64 = 0.985;
/// What is kept of the limits from the first, for what happens between the nodes.
pub(super) const SHARE: f64 = 0.9992;

impl<const N: usize> SearchState<N> {
    pub(super) fn new(resolution: Resolution) -> Self {
        let node = BrakingNode::nowhere();
        SearchState {
            resolution,
            target: 0.0,
            rising: [node; MOST_RISING + 1],
            rising_cells: 0,
            falling: [node; MOST_FALLING + 1],
            falling_cells: 0,
            work: 0,
            tick: 0.0,
            step: 1.0,
            longest: f64::INFINITY,
            stride: f64::INFINITY,
            rounds: 0,
            refined: 0,
            moved: f64::INFINITY,
        }
    }

    /// In units of [`RELAXING`].
    pub(super) fn work_of_a_round(&self) -> usize {
        (self.falling_cells + 1) * (LOOKING + RELAXING)
    }

    pub(super) fn begin(&mut self, target: f64) {
        (self.target, self.rising_cells, self.refined) = (target, 0, 0);
        (self.falling_cells, self.rounds) = (self.resolution.falling, 0);
        self.moved = f64::INFINITY;
        self.step = 1.0;
        for node in self.rising.iter_mut().chain(&mut self.falling) {
            node.share = [SHARE; 2];
            node.off = 0.0;
        }
    }

    /// The first guess: the closed form with what the axes allow along the path here.
    pub(super) fn guess<'a>(
        &mut self,
        path: impl Fn(usize) -> Option<&'a PathSegment<N>>,
        limits: &Limits<N>,
    ) -> Option<()> {
        let (cells, target) = (self.falling_cells, self.target);
        let top = self.falling[0];
        let [limit, j] = top.along(path(top.index)?.limits(limits));
        let above = top.v - target;
        if above <= 0.0 {
            return None;
        }
        let a = top.a;
        let reached = above + a * a / (2.0 * j);
        let peak = (j * reached).sqrt().min(limit);
        // Durations of the parts; in the last one the rest of the acceleration goes.
        let (down, hold, landing, peak) = if a + peak > 0.0 {
            let hold = (reached - peak * peak / j) / peak;
            ((a + peak) / j, hold.max(0.0), peak / j, peak)
        } else {
            (0.0, 0.0, -2.0 * above / a, -a)
        };
        let whole = down + hold + landing;
        let tick = whole / cells as f64;
        self.tick = tick;
        for (k, node) in self.falling[..=cells].iter_mut().enumerate().skip(1) {
            let gone = tick * k as f64;
            let left = whole - gone;
            // From the end, from the start, or in between.
            (node.v, node.a) = if k == cells {
                (target, 0.0)
            } else if left < landing {
                let jerk = peak / landing;
                (target + 0.5 * jerk * left * left, -jerk * left)
            } else if gone < down {
                (top.v + gone * (a - 0.5 * j * gone), a - j * gone)
            } else {
                (target + peak * (left - 0.5 * landing), -peak)
            };
        }
        for k in 0..cells {
            let (now, next) = (self.falling[k], self.falling[k + 1]);
            let t = -2.0 * (now.v - next.v) / (now.a + next.a);
            self.falling[k].t = t;
            self.falling[k].jerk = (next.a - now.a) / t;
            self.falling[k + 1].s = self.falling[k].end()?.distance;
        }
        for node in &mut self.falling[..=cells] {
            node.looked = [node.s; 2];
        }
        Some(())
    }

    /// Spreads the speeds over what is between the target and another greatest speed than `before`.
    pub(super) fn begin_at_another_speed(&mut self, before: f64) -> Option<()> {
        let above = self.falling[0].v - self.target;
        for node in &mut self.falling[1..=self.falling_cells] {
            node.v = self.target + (node.v - self.target) * (above / (before - self.target));
        }
        (above > 0.0).then_some(())
    }

    /// Takes back the acceleration as fast as the axes allow, step by step; true when it is gone.
    pub(super) fn rise<'a>(
        &mut self,
        path: impl Fn(usize) -> Option<&'a PathSegment<N>>,
        limits: &Limits<N>,
        from: PathState,
        work: usize,
    ) -> Option<bool> {
        let mut cursor = PathCursor { path, index: 0 };
        let mut now = from;
        if self.rising_cells == 0 {
            (self.longest, self.stride) = (f64::INFINITY, f64::INFINITY);
        } else {
            let last = &self.rising[self.rising_cells - 1];
            now = last.end()?;
            cursor.index = last.index;
        }
        while now.acceleration > NO_ACCELERATION * from.acceleration.max(0.0) {
            if self.work >= work {
                return Some(false);
            }
            // Cells that are used before their time make the others longer.
            let used = self.rising_cells as f64 / self.resolution.most_rising as f64;
            let gone = 1.0 - now.acceleration / from.acceleration;
            let early = (LOOSER * (used - gone).clamp(0.0, 1.0)) as u32;
            let loose = self.resolution.uneven_rise * f64::from(1_u32 << early);
            let node = self.rising[..self.resolution.most_rising].get_mut(self.rising_cells)?;
            node.take(now);
            node.look(&mut cursor, limits, now.distance)?;
            self.work += LOOKING + RELAXING;
            if self.longest.is_infinite() {
                let limits = (cursor.path)(node.index)?.limits(limits);
                self.longest = self.step * now.acceleration / node.along(limits)[1] / RISING_STEPS;
            }
            self.stride = self.stride.min(self.longest);
            loop {
                self.work += 2 * (LOOKING + RELAXING);
                let uneven = node.ease(&cursor, limits, self.stride)?;
                if uneven <= loose || self.stride < SHORTEST * self.longest {
                    break;
                }
                self.stride *= 0.5;
            }
            self.stride *= LONGER;
            now = node.end()?;
            self.rising_cells += 1;
        }
        now.acceleration = now.acceleration.min(0.0);
        let top = &mut self.falling[0];
        top.take(now);
        top.look(&mut cursor, limits, now.distance)?;
        top.looked = [now.distance; 2];
        Some(true)
    }

    /// The nodes are where the path was looked up.
    pub(super) fn is_settled(&self) -> bool {
        self.moved
            <= self.resolution.settled * (self.falling[self.falling_cells].s - self.falling[0].s)
    }

    /// Looks the path up where the nodes are, or where they seem to be going (Anderson, "Iterative
    /// Procedures for Nonlinear Integral Equations", 1965).
    pub(super) fn look<'a>(
        &mut self,
        path: impl Fn(usize) -> Option<&'a PathSegment<N>>,
        limits: &Limits<N>,
    ) -> Option<()> {
        let mut cursor = PathCursor {
            path,
            index: self.falling[0].index,
        };
        self.rounds += 1;
        if self.rounds > MOST_ROUNDS {
            return None;
        }
        let (mut along, mut whole) = (0.0, 0.0);
        for node in &self.falling[..=self.falling_cells] {
            let off = node.s - node.looked[1];
            let change = off - node.off;
            along += off * change;
            whole += change * change;
        }
        let part = if self.moved.is_finite() && !self.is_settled() && whole > 0.0 {
            (along / whole).clamp(MIXING[0], MIXING[1])
        } else {
            0.0
        };
        let mut least = self.falling[0].s;
        for node in &mut self.falling[1..=self.falling_cells] {
            let off = node.s - node.looked[1];
            let before = node.looked[0] + node.off;
            let next = (node.s - part * (node.s - before)).max(least);
            least = next;
            node.looked = [node.looked[1], next];
            node.off = off;
            node.look(&mut cursor, limits, next)?;
        }
        Some(())
    }

    /// The accelerations and places anew, for the path where it was looked up: the two passes.
    pub(super) fn relax<'a>(
        &mut self,
        path: impl Fn(usize) -> Option<&'a PathSegment<N>>,
        limits: &Limits<N>,
    ) -> Option<()> {
        let last = self.falling_cells;
        let nodes = &mut self.falling[..=last];
        // Back from the end: the greatest E from where the end is reached.
        let mut most = [0.0; MOST_FALLING + 1];
        for k in (0..last).rev() {
            let (now, next) = (&nodes[k], &nodes[k + 1]);
            let a = -(2.0_f64 * most[k + 1]).sqrt();
            let highs = [
                jerks(next, now.share[1], a, 0.0)[1],
                jerks(now, now.share[1], a, -now.t)[1],
            ];
            let high = highs[0].min(highs[1]);
            let limits = path(now.index)?.limits(limits);
            let low = accelerations(now, limits)[0].min(0.0);
            let down = now.v - next.v;
            let mut by_jerk = (most[k + 1] + high * down).max(0.0);
            let mut by_acceleration = 0.5 * low * low;
            // Where the path is not passed at that speed it is soon reached elsewhere.
            let [straight, jerk] = now.unbent(limits);
            if by_jerk < (IMPASSABLE * straight).min(most[k + 1]) {
                by_jerk = most[k + 1] + jerk * down;
            }
            if by_acceleration < IMPASSABLE * straight {
                by_acceleration = straight;
            }
            most[k] = by_jerk.min(by_acceleration);
            nodes[k].uneven = if most[k] < by_jerk {
                0.0
            } else {
                (highs[0] - highs[1]).abs()
            };
        }
        // On from the start: the greatest that the jerk allows.
        let mut e = 0.5 * nodes[0].a * nodes[0].a;
        let mut moved = 0.0_f64;
        for k in 0..last {
            let (now, next) = (&nodes[k], &nodes[k + 1]);
            let down = now.v - next.v;
            let lows = [
                jerks(now, now.share[1], now.a, 0.0)[0],
                jerks(next, now.share[1], now.a, now.t)[0],
            ];
            let low = lows[0].max(lows[1]);
            let [straight, jerk] = now.unbent(path(now.index)?.limits(limits));
            let mut by_jerk = e - low * down;
            if by_jerk < (IMPASSABLE * straight).min(e) {
                by_jerk = e + jerk * down;
            }
            let e1 = by_jerk.min(most[k + 1]).max(0.0);
            let a1 = -(2.0 * e1).sqrt();
            let now = &mut nodes[k];
            now.t = -2.0 * down / (now.a + a1);
            now.jerk = (e - e1) / down;
            if e1 < most[k + 1] {
                now.uneven = (lows[0] - lows[1]).abs();
            }
            let end = now.end()?;
            let next = &mut nodes[k + 1];
            next.a = a1;
            next.s = end.distance;
            moved = moved.max((next.s - next.looked[1]).abs());
            e = e1;
        }
        self.moved = moved;
        Some(())
    }

    /// Cuts cells where the path changes quickly: about the joints of path segments, and on polynomials.
    /// False where there is nothing to cut.
    pub(super) fn refine<'a>(
        &mut self,
        path: impl Fn(usize) -> Option<&'a PathSegment<N>>,
        limits: &Limits<N>,
    ) -> Option<bool> {
        if self.refined >= MOST_REFINEMENTS {
            return Some(false);
        }
        self.refined += 1;
        // The old nodes wait at the end of the room, where the new ones do not come before they went.
        let apart = MOST_FALLING - self.falling_cells;
        self.falling.copy_within(..=self.falling_cells, apart);
        let (mut from, mut to) = (0, 0);
        while from < self.falling_cells {
            let (now, next) = (self.falling[apart + from], self.falling[apart + from + 1]);
            let left = self.resolution.most_falling - to - (self.falling_cells - from);
            let mut cuts = [0.0; MOST_PARTS as usize];
            let mut count = 0;
            if next.index > now.index {
                // A short cell holds the joint.
                let joint = instant_at(&now.segment(), path(now.index + 1)?.start);
                let short = SHORT * now.t;
                if now.t > SHORTEST_AT_JOINT * self.tick {
                    for cut in [joint - short, joint + short] {
                        if cut > short && cut < now.t - short {
                            cuts[count] = cut;
                            count += 1;
                        }
                    }
                }
            } else if now.t > SHORTEST_CUT * self.tick {
                let here = path(now.index)?;
                let quick = match here.curve {
                    ref curve @ Curve::Poly(_) if here.clock.is_none() => {
                        (next.s - now.s) / curve.length() * POLY_CELLS
                    }
                    _ => 0.0,
                };
                let limits = here.limits(limits);
                let uneven = now.uneven / now.along(limits)[1] / self.resolution.uneven;
                let parts = quick.max(uneven).ceil().clamp(1.0, MOST_PARTS);
                for k in 1..parts as usize {
                    cuts[count] = now.t * k as f64 / parts;
                    count += 1;
                }
            }
            self.falling[to] = now;
            to += 1;
            if count <= left {
                let mut begin = 0.0;
                for &cut in &cuts[..count] {
                    self.falling[to - 1].t = cut - begin;
                    let mut node = now;
                    let (ds, speed, acceleration) = now.segment().at(cut);
                    let distance = now.s + ds;
                    node.take(PathState {
                        distance,
                        speed,
                        acceleration,
                    });
                    node.looked = [node.s; 2];
                    node.off = 0.0;
                    node.t = now.t - cut;
                    self.falling[to] = node;
                    begin = cut;
                    to += 1;
                }
            }
            from += 1;
        }
        self.falling[to] = self.falling[MOST_FALLING];
        let cut = to > self.falling_cells;
        self.falling_cells = to;
        Some(cut)
    }

    /// How many cells there are.
    pub(super) fn cells(&self) -> usize {
        self.rising_cells + self.falling_cells
    }

    /// The nodes at the ends of a cell.
    fn cell(&self, cell: usize) -> [BrakingNode<N>; 2] {
        if cell + 1 < self.rising_cells {
            [self.rising[cell], self.rising[cell + 1]]
        } else if cell < self.rising_cells {
            [self.rising[cell], self.falling[0]]
        } else {
            let cell = cell - self.rising_cells;
            [self.falling[cell], self.falling[cell + 1]]
        }
    }

    fn node(&mut self, node: usize) -> &mut BrakingNode<N> {
        if node < self.rising_cells {
            &mut self.rising[node]
        } else {
            &mut self.falling[node - self.rising_cells]
        }
    }

    /// Whether every axis keeps its limits in the cell: at both ends and in the middle, and
    /// between them as far as what is asked bends no more than there. Where one does not, less is
    /// used of it.
    pub(super) fn keeps<'a>(
        &mut self,
        cell: usize,
        path: impl Fn(usize) -> Option<&'a PathSegment<N>>,
        limits: &Limits<N>,
    ) -> Option<bool> {
        let [now, next] = self.cell(cell);
        let over = now.asks(&next, &path, limits, &mut self.work)?;
        let kept = over.iter().all(|over| *over <= 1.0 + ROUNDING);
        if over[1] > 1.0 + ROUNDING {
            for node in [cell, cell + 1] {
                let share = &mut self.node(node).share[0];
                *share /= over[1] * (1.0 + UNDERCUT);
            }
        }
        if over[2] > 1.0 + ROUNDING {
            self.node(cell).share[1] /= over[2] * (1.0 + UNDERCUT);
        }
        Some(kept)
    }

    /// Beyond what is known of the path nothing can be kept.
    pub(super) fn ends_beyond<'a>(
        &self,
        path: impl Fn(usize) -> Option<&'a PathSegment<N>>,
    ) -> Option<bool> {
        let end = &self.falling[self.falling_cells];
        let path_segment = path(end.index)?;
        Some(end.s > path_segment.start + path_segment.curve.length() + ROUNDING)
    }

    /// Whether that holds between the samples, too, where they may miss something. Where it is not
    /// certain the cell is cut, or less is used of the limits.
    pub(super) fn is_certain<'a>(
        &mut self,
        cell: usize,
        path: impl Fn(usize) -> Option<&'a PathSegment<N>>,
        limits: &Limits<N>,
    ) -> Option<bool> {
        let [now, next] = self.cell(cell);
        let slack = if cell < ENTRY { ENTRY_SLACK } else { ROUNDING };
        let proof = (slack, self.resolution.halvings);
        let certain = now.is_certain(&next, &path, limits, proof, &mut self.work)?;
        if !certain {
            if cell < self.rising_cells && self.step > SHORTEST_STEP {
                self.step *= 0.5;
            } else if cell >= self.rising_cells
                && now.t > SHORTEST_CUT * self.tick
                && self.falling_cells < self.resolution.most_falling
            {
                self.halve(cell - self.rising_cells);
            } else {
                self.node(cell).share = now.share.map(|share| share * UNCERTAIN);
            }
        }
        Some(certain)
    }

    /// Cuts a falling cell in two.
    fn halve(&mut self, cell: usize) {
        let mut middle = self.falling[cell];
        let t = 0.5 * middle.t;
        let (ds, speed, acceleration) = middle.segment().at(t);
        middle.take(PathState {
            distance: middle.s + ds,
            speed,
            acceleration,
        });
        middle.t = t;
        middle.looked = [middle.s; 2];
        middle.off = 0.0;
        self.falling[cell].t = t;
        self.falling
            .copy_within(cell + 1..=self.falling_cells, cell + 2);
        self.falling[cell + 1] = middle;
        self.falling_cells += 1;
    }

    pub(super) fn braking(&self, from: PathState) -> Option<Braking> {
        let mut braking = Braking::new(from);
        for node in self.rising[..self.rising_cells]
            .iter()
            .chain(&self.falling[..self.falling_cells])
        {
            braking.push(node.t, node.jerk)?;
        }
        braking.end.speed = self.target;
        braking.end.acceleration = 0.0;
        Some(braking)
    }
}
