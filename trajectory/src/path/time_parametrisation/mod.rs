//! The time-optimal parametrisation of a path under third-order limits of every axis.
//!
//! # Model
//!
//! The path is cut into cells; in each the path jerk is constant in time, so that what is optimised
//! is what is executed. With w = ṡ², a = s̈ at the nodes and, for a cell, its length Δs, its
//! duration T, the mean speed σ = (v₀ + v₁)/2 and h = σ T:
//!
//! ```text
//! a₁ = a₀ + m     w₁ = w₀ + h (a₀ + a₁)     Δs = h − m h² / 12 σ²     jerk = m σ / h
//! ```
//!
//! h differs from Δs in second order only (next to a rest: it is 3/2 Δs). Of the limits
//!
//! ```text
//! |q′| √w ≤ V      |q″ w + q′ a| ≤ A      |q‴ v³ + 3 q″ v a + q′ m σ / h| ≤ J
//! ```
//!
//! the first two are linear; the third, divided by σ, is linear but for J/σ, which is convex in w,
//! so that its tangent is a limit on the safe side (as in sequential convex methods for third-order
//! path parametrisation: Debrouwere et al., "Time-Optimal Path Following for Robots with
//! Convex–Concave Constraints Using Sequential Convex Programming", 2013).
//!
//! # Method
//!
//! A primal–dual interior point method in which every iteration is relinearised. The cells form a
//! chain with a state of two numbers and a control of one, so a Newton step is a Riccati recursion:
//! its cost is proportional to the number of cells. The last step of all changes as little as possible to meet
//! the dynamics to 1e-12, so that the cells join to rounding.
//!
//! Only constraints that can bind are laid: of axes that move, and on lines the strictest of all axes.
//!
//! # Why it is right
//!
//! The cells' identities are exact for constant jerk, not a discretisation, so a solution is a motion that can
//! be executed as it is; what it may still break lies within a cell on a curve, between the nodes where the
//! constraints stand, and the [certificate](super::certify) finds that. The duality gap bounds how much longer than the
//! optimum over the cells the motion is.
//!
//! # What was tried
//!
//! - Without the row on the speed in the *middle* of the cells the optimum lets the acceleration alternate from
//!   node to node, which the nodes' speeds do not see.
//! - A sequence of linear programs over even points, linearised anew until the time settles, takes at least 27 times
//!   as long as all of the planner, for motion times within 0.3 % of its (`docs/measured.md`, "Beside copp").

mod constraints;

use super::{Derivatives, Limits};
use constraints::{Aim, CellState, Row, Stage, Sums};

/// A stretch of path between two nodes.
#[derive(Debug, Clone, Copy)]
pub struct Cell<const N: usize> {
    /// Δs, mm.
    pub length: f64,
    /// Geometry where it begins and where it ends, seen from inside.
    pub ends: [Slope<N>; 2],
    /// Greatest path speed by feed and axis velocities, mm/s: at its start (as the cell before
    /// allows, too) and within.
    pub speed: [f64; 2],
    /// What part of the acceleration and jerk limits may be used; 1 or a little less.
    pub share: [f64; 2],
    /// The axes' limits there.
    pub limits: Limits<N>,
}

/// Derivatives by path length, without the position.
#[derive(Debug, Clone, Copy)]
pub struct Slope<const N: usize> {
    /// q′
    pub d1: [f64; N],
    /// q″
    pub d2: [f64; N],
    /// q‴
    pub d3: [f64; N],
}

impl<const N: usize> From<Derivatives<N>> for Slope<N> {
    fn from(d: Derivatives<N>) -> Self {
        Slope {
            d1: d.d1,
            d2: d.d2,
            d3: d.d3,
        }
    }
}

/// Path state at a node: w = ṡ² and a = s̈.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct NodeState {
    /// ṡ², mm²/s²
    pub w: f64,
    /// s̈, mm/s²
    pub a: f64,
}

/// How an optimisation ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// The tolerances were met.
    pub converged: bool,
    /// Newton steps taken.
    pub iterations: usize,
    /// Motion time, s.
    pub time: f64,
    /// Bound on how much longer than the optimum over these cells that is, s.
    pub gap: f64,
    /// Greatest excess over a limit, as a part of it.
    pub excess: f64,
}

/// Newton steps before it is given up.
const MAX_ITERATIONS: usize = 80;
/// Excess over a limit that is left to another solution with tightened limits.
const PATIENT: f64 = 0.01;
/// Part of the way to the boundary that a step goes.
const REACH: f64 = 0.98;
/// Duality gap, in motion times, at which it is given up.
const LOST: f64 = 1e3;
/// The dynamics are met when they miss by no more than this part of ṡ².
const EXACT: f64 = 1e-12;
/// Newton steps on the dynamics alone that bring them there from a solution: each squares the miss.
const MEETING_STEPS: usize = 6;
/// Slack of the first iterate's constraints, broken ones among them, by the barrier, at least.
const FIRST_SLACK: f64 = 0.3;
/// Part of the duality gap that a step aims at, at least, also where one straight for the optimum would get
/// further: the model is not exact.
const LEAST_CENTRING: f64 = 1e-3;
/// Steps shorter than this are damped more in the next iteration, by a factor and from a part of the barrier on …
const SHORT_STEP: f64 = 0.2;
const MORE_DAMPING: f64 = 3.0;
const FIRST_DAMPING: f64 = 0.1;
/// … and steps longer than this less, by a factor.
const LONG_STEP: f64 = 0.6;
const LESS_DAMPING: f64 = 0.2;
/// The root of 1 − 4 Δs m/12σ², which is positive in every cell that there is; iterates far from one are kept
/// from dividing by less.
const LEAST_ROOT: f64 = 0.2;
const LEAST_ROOT_SQUARE: f64 = 0.04;
/// Part of ṡ² that one step may take off.
const FURTHEST_DOWN: f64 = 0.8;

/// Solver with its scratch space; reused from window to window.
#[derive(Debug, Clone, Default)]
pub struct TimeParametrisation<const N: usize> {
    stages: Vec<Stage>,
    rows: Vec<Row>,
    nodes: Vec<NodeState>,
}

impl<const N: usize> TimeParametrisation<N> {
    /// Duration and jerk of every cell in turn.
    pub fn motions(&self) -> impl Iterator<Item = (f64, f64)> {
        self.stages.iter().map(|Stage { state, .. }| {
            (
                state.h / state.sigma,
                (state.a[1] - state.a[0]) * state.sigma / state.h,
            )
        })
    }

    /// The solution: a state for every node, one more than there are cells.
    pub fn nodes(&self) -> &[NodeState] {
        &self.nodes
    }

    /// Fastest time parametrisation over `cells` from `start` to rest at the end, to the relative `tolerance` of its
    /// time. `guess` gives the first iterate, a state for every node with w > 0 inside; `barrier` tells
    /// how good it is: 0.3 for one that has only the shape, less for a solution of nearly the same
    /// problem.
    pub fn solve(
        &mut self,
        cells: &[Cell<N>],
        start: NodeState,
        guess: impl Iterator<Item = NodeState>,
        barrier: f64,
        tolerance: f64,
    ) -> Outcome {
        let n = cells.len();
        debug_assert!(n >= 3, "too few cells to come to rest");
        self.nodes.clear();
        self.nodes.extend(guess.take(n + 1));
        debug_assert_eq!(self.nodes.len(), n + 1);
        self.nodes[0] = start;
        self.nodes[n] = NodeState::default();

        self.lay_rows(cells);
        let (time, _) = self.relinearise(cells);
        for Stage { state, weight, .. } in &mut self.stages {
            *weight = 0.5 * (state.h / state.sigma / time + 1.0 / n as f64);
        }
        // Constraints, by weight.
        let pairs: f64 = self
            .stages
            .iter()
            .map(|s| s.weight * (2 * (s.rows[3] - s.rows[0])) as f64)
            .sum();
        let target = barrier * time / pairs;
        for stage in &self.stages {
            for row in &mut self.rows[stage.rows[0]..stage.rows[3]] {
                row.slack = row.over.map(|over| (-over).max(FIRST_SLACK * barrier));
                row.force = row.slack.map(|slack| target * stage.weight / slack);
            }
        }
        let mut outcome = Outcome {
            converged: false,
            iterations: 0,
            time,
            gap: barrier * time,
            excess: 1.0,
        };
        let mut damping = 0.0_f64;
        while outcome.iterations < MAX_ITERATIONS {
            outcome.iterations += 1;
            outcome.excess = self.factorise(damping);
            // Where would a step straight for the optimum lead? That tells how far to aim now, and
            // what the products of the steps will come to (Mehrotra, "On the Implementation of a
            // Primal-Dual Interior Point Method", 1992).
            self.direct(Aim::Optimum);
            let sums = self.substitute::<false>(0.0);
            let left = (sums.gap_after(sums.steps()) / outcome.gap).min(1.0);
            let target = (left * left * left).max(LEAST_CENTRING) * outcome.gap / pairs;
            self.direct(Aim::Target(target));
            let sums = self.substitute::<true>(target);
            let [primal, dual] = sums.steps();
            outcome.gap = sums.gap_after([primal, dual]);
            self.go(primal, dual);
            // Short steps: the model is good for nearby only.
            if primal < SHORT_STEP {
                damping = (MORE_DAMPING * damping).max(FIRST_DAMPING * outcome.gap / pairs);
            } else if primal > LONG_STEP {
                damping *= LESS_DAMPING;
            }
            let miss;
            (outcome.time, miss) = self.relinearise(cells);
            // Where there is no solution the multipliers grow without bound.
            if !outcome.time.is_finite()
                || outcome.gap.is_nan()
                || outcome.gap > LOST * outcome.time
            {
                break;
            }
            // Out of patience, what nearly keeps the limits will do.
            let last = outcome.iterations == MAX_ITERATIONS;
            let allowed = if last { PATIENT } else { tolerance };
            if (last || outcome.gap <= tolerance * outcome.time) && outcome.excess < allowed {
                outcome.converged = self.meet(cells, miss);
                break;
            }
        }
        outcome
    }

    /// Brings the dynamics from missing by `miss` down to rounding; false if that fails.
    fn meet(&mut self, cells: &[Cell<N>], mut miss: f64) -> bool {
        for _ in 0..MEETING_STEPS {
            if miss < EXACT {
                return true;
            }
            self.factorise(0.0);
            self.direct(Aim::Dynamics);
            let (mut dw, mut da) = (0.0, 0.0);
            for (stage, node) in self.stages.iter_mut().zip(&mut self.nodes) {
                let Stage { state, gain, .. } = stage;
                let dm = gain[0] * dw + gain[1] * da + gain[2];
                node.w += dw;
                node.a += da;
                state.m += dm;
                (dw, da) = state.follow([dw, da, dm]);
            }
            miss = self.relinearise(cells).1;
        }
        miss < EXACT
    }

    /// Lays every constraint that can be one: of axes that move, and of several that ask for the
    /// same the strictest.
    fn lay_rows(&mut self, cells: &[Cell<N>]) {
        self.stages.clear();
        self.rows.clear();
        let last = cells.len() - 1;
        // The one of the rows in m alone (or a alone) that comes first to its bound.
        let strictest = |d: &[f64; N], limit: &[f64; N]| {
            (0..N).map(|i| d[i].abs() / limit[i]).fold(0.0, f64::max)
        };
        for (k, cell) in cells.iter().enumerate() {
            let mut rows = [self.rows.len(); 4];
            let ([start, end], limits) = (&cell.ends, &cell.limits);
            let is_flat = |slope: &Slope<N>, i: usize| slope.d2[i] == 0.0 && slope.d3[i] == 0.0;
            let flat = |slope: &Slope<N>| (0..N).all(|i| is_flat(slope, i));
            let straight = flat(start) && flat(end) && start.d1 == end.d1;
            let along = strictest(&start.d1, &limits.jerk);
            for (at, slope) in cell.ends.iter().enumerate() {
                if straight {
                    if at == 0 {
                        let term = along / cell.share[1];
                        self.rows.push(Row::new([0.0, 0.0, term], 1.0));
                    }
                } else {
                    let moves = |i: &usize| slope.d1[*i] != 0.0 || !is_flat(slope, *i);
                    for i in (0..N).filter(moves) {
                        let scale = 1.0 / (cell.share[1] * limits.jerk[i]);
                        let terms = [slope.d3[i], 3.0 * slope.d2[i], slope.d1[i]];
                        let terms = terms.map(|d| d * scale);
                        if terms != [0.0; 3] {
                            self.rows.push(Row::new(terms, 1.0));
                        }
                    }
                }
                rows[at + 1] = self.rows.len();
            }
            // Half way w is (w₀ + w₁)/2 − m h/4, or less. Without this row a wave of the acceleration
            // from node to node would pass unseen.
            let scale = 1.0 / (cell.speed[1] * cell.speed[1]);
            self.rows.push(Row::new([0.5 * scale; 3], 0.0));
            if k > 0 {
                if flat(start) {
                    let term = strictest(&start.d1, &limits.acceleration) / cell.share[0];
                    self.rows.push(Row::new([0.0, term, 0.0], 1.0));
                } else {
                    let moves = |i: &usize| start.d1[*i] != 0.0 || !is_flat(start, *i);
                    for i in (0..N).filter(moves) {
                        let scale = 1.0 / (cell.share[0] * limits.acceleration[i]);
                        let terms = [start.d2[i] * scale, start.d1[i] * scale, 0.0];
                        if terms != [0.0; 3] {
                            self.rows.push(Row::new(terms, 1.0));
                        }
                    }
                }
                let scale = 1.0 / (cell.speed[0] * cell.speed[0]);
                self.rows.push(Row::new([scale, 0.0, 0.0], 0.0));
            }
            rows[3] = self.rows.len();
            self.stages.push(Stage {
                state: CellState {
                    m: self.nodes[k + 1].a - self.nodes[k].a,
                    at_rest: (k == 0 && self.nodes[0].w == 0.0) || k == last,
                    ..CellState::default()
                },
                rows,
                weight: 0.0,
                along,
                gradient: [0.0; 3],
                cross: [0.0; 3],
                to_go: [0.0; 3],
                gain: [0.0; 3],
                step: [0.0; 3],
            });
        }
    }

    /// Brings every state and its rows up to date with the iterate; returns the motion time and by
    /// what part of itself the dynamics miss w at most.
    fn relinearise(&mut self, cells: &[Cell<N>]) -> (f64, f64) {
        let (mut time, mut miss) = (0.0, 0.0_f64);
        let mut v0 = self.nodes[0].w.sqrt();
        for (k, (stage, cell)) in self.stages.iter_mut().zip(cells).enumerate() {
            let (x0, x1) = (self.nodes[k], self.nodes[k + 1]);
            let v1 = x1.w.sqrt();
            let state = &mut stage.state;
            let sigma = 0.5 * (v0 + v1);
            let slope = |v: f64| if v > 0.0 { -0.25 / (v * sigma) } else { 0.0 };
            state.beta = [slope(v0), slope(v1)];
            if state.at_rest {
                state.h = 1.5 * cell.length;
                state.h_by = [0.0; 3];
            } else {
                let bend = state.m / (12.0 * sigma * sigma);
                let root = (1.0 - 4.0 * cell.length * bend)
                    .max(LEAST_ROOT_SQUARE)
                    .sqrt();
                let h = 2.0 * cell.length / (1.0 + root);
                // h − bend h² = Δs, and bend goes with m/σ².
                let by = h * h / (1.0 - 2.0 * h * bend).max(LEAST_ROOT);
                state.h = h;
                state.h_by = [
                    by * 2.0 * bend * state.beta[0],
                    by * 2.0 * bend * state.beta[1],
                    by / (12.0 * sigma * sigma),
                ];
            }
            state.sigma = sigma;
            state.v = [v0, v1];
            state.w = [x0.w, x1.w];
            state.a = [x0.a, x1.a];
            state.defect = x0.a + state.m - x1.a;
            // w₁ = w₀ + h (2 a₀ + m)
            let sum = 2.0 * x0.a + state.m;
            let own = 1.0 / (1.0 - sum * state.h_by[1]);
            state.ahead = [
                (1.0 + sum * state.h_by[0]) * own,
                2.0 * state.h * own,
                (state.h + sum * state.h_by[2]) * own,
                (x0.w + state.h * sum - x1.w) * own,
            ];
            miss = miss.max((state.ahead[3] / x0.w.max(x1.w)).abs());
            time += state.h / sigma;
            v0 = v1;
            stage.evaluate(&mut self.rows);
        }
        (time, miss)
    }

    /// Assembles the Newton step's matrices and eliminates them from the end to the start. Returns
    /// the greatest excess over a limit.
    fn factorise(&mut self, damping: f64) -> f64 {
        let mut worst = 0.0_f64;
        let last = self.stages.len() - 1;
        // Cost to go ½ xᵀPx: ww, wa, aa.
        let mut to_go = [0.0; 3];
        // The last node is at rest: w + h a = miss at the node before.
        let mut landing = (0.0, 0.0);
        for (k, stage) in self.stages.iter_mut().enumerate().rev() {
            let mut q = stage.weigh(&mut self.rows, &mut worst);
            let state = &stage.state;
            state.add_time(&mut q);
            let along = state.sigma / state.h * stage.along;
            q.square(damping * stage.weight, [0.0, 0.0, along]);
            stage.gradient = q.gradient;
            let [ww, wa, wm, aa, am, mm] = q.hessian;
            if k == last {
                // a + m = 0 and w + h a = 0 at the end.
                stage.gain = [0.0, -1.0, -state.a[0] - state.m];
                stage.cross = [wm, am, mm];
                to_go = [ww, wa - wm, aa - 2.0 * am + mm];
                landing = (state.h, -(state.w[0] + state.h * state.a[0]));
                continue;
            }
            stage.to_go = to_go;
            // Add the cost to go from x⁺: Δw⁺ = ahead · (Δw, Δa, Δm, 1), Δa⁺ = Δa + Δm + defect.
            let [pww, pwa, paa] = to_go;
            let [ew, ea, em, e1] = state.ahead;
            // P [A B], column by column.
            let w_w = pww * ew;
            let (a_w, a_a) = (pww * ea + pwa, pwa * ea + paa);
            let (m_w, m_a) = (pww * em + pwa, pwa * em + paa);
            let ww = ww + ew * w_w;
            let wa = wa + ew * a_w;
            let wm = wm + ew * m_w;
            let aa = aa + ea * a_w + a_a;
            let am = am + ea * m_w + m_a;
            let mm = mm + em * m_w + m_a;
            stage.cross = [wm, am, mm];
            stage.gain = if k + 1 == last {
                // Here the control has to meet the landing w + l a = miss.
                let (l, miss) = landing;
                let by_m = em + l;
                [
                    -ew / by_m,
                    -(ea + l) / by_m,
                    (miss - e1 - l * state.defect) / by_m,
                ]
            } else {
                [-wm / mm, -am / mm, 0.0]
            };
            let [kw, ka, _] = stage.gain;
            to_go = [
                ww + kw * (2.0 * wm + mm * kw),
                wa + kw * am + ka * wm + mm * kw * ka,
                aa + ka * (2.0 * am + mm * ka),
            ];
        }
        worst
    }

    /// Gives the step its direction: eliminates the gradient from the end to the start.
    fn direct(&mut self, aim: Aim) {
        let last = self.stages.len() - 1;
        // The gradient of the cost to go: w, a.
        let mut to_go = [0.0; 2];
        for (k, stage) in self.stages.iter_mut().enumerate().rev() {
            let [mut gw, mut ga, mut gm] = match aim {
                Aim::Optimum => stage.gradient,
                Aim::Target(target) => stage.corrected(&self.rows, target * stage.weight),
                Aim::Dynamics => [0.0; 3],
            };
            let [wm, am, mm] = stage.cross;
            if k == last {
                let one = stage.gain[2];
                to_go = [gw + wm * one, ga - gm + (am - mm) * one];
                continue;
            }
            let [pww, pwa, paa] = stage.to_go;
            let [ew, ea, em, e1] = stage.state.ahead;
            let defect = stage.state.defect;
            let rw = to_go[0] + pww * e1 + pwa * defect;
            let ra = to_go[1] + pwa * e1 + paa * defect;
            gw += ew * rw;
            ga += ea * rw + ra;
            gm += em * rw + ra;
            if k + 1 < last {
                stage.gain[2] = -gm / mm;
            }
            let [kw, ka, k1] = stage.gain;
            to_go = [
                gw + kw * gm + k1 * (wm + mm * kw),
                ga + ka * gm + k1 * (am + mm * ka),
            ];
        }
    }

    /// Goes through the step from the start to the end; with a target, or straight for the optimum.
    fn substitute<const HAS_TARGET: bool>(&mut self, target: f64) -> Sums {
        let mut sums = Sums::default();
        let (mut dw, mut da) = (0.0, 0.0);
        for (k, stage) in self.stages.iter_mut().enumerate() {
            let Stage { state, gain, .. } = stage;
            let step = [dw, da, gain[0] * dw + gain[1] * da + gain[2]];
            if k > 0 {
                // The tangent of 1/σ is worth little much further down.
                sums.reach[0] = sums.reach[0].max(-dw / (FURTHEST_DOWN * state.w[0]));
            }
            let (beta, beta_drift) = state.beta_slope();
            let beta_step = beta[0] * step[0] + beta[1] * step[1] + beta[2] * step[2] + beta_drift;
            let target = target * stage.weight;
            let [first, _, others, end] = stage.rows;
            for row in &mut self.rows[first..others] {
                row.aim::<HAS_TARGET>(step, beta_step, target, &mut sums);
            }
            for row in &mut self.rows[others..end] {
                row.aim::<HAS_TARGET>(step, 0.0, target, &mut sums);
            }
            (dw, da) = state.follow(step);
            stage.step = step;
        }
        sums
    }

    /// Takes the step.
    fn go(&mut self, primal: f64, dual: f64) {
        for (stage, node) in self.stages.iter_mut().zip(&mut self.nodes) {
            let [dw, da, dm] = stage.step;
            node.w += primal * dw;
            node.a += primal * da;
            stage.state.m += primal * dm;
        }
        for row in &mut self.rows {
            for side in 0..2 {
                row.slack[side] += primal * row.slack_step[side];
                row.force[side] += dual * row.force_step[side];
            }
        }
    }
}
