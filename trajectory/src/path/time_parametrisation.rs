//! The time-optimal law along a path under third-order limits of every axis.
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
//! its cost is proportional to the number of cells.

use super::{Derivatives, Limits};

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
pub struct Node {
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

/// A cell's state in the current iterate: all that its constraints depend on.
#[derive(Debug, Clone, Copy, Default)]
struct CellState {
    /// At both ends.
    w: [f64; 2],
    a: [f64; 2],
    v: [f64; 2],
    /// σ T and the control, m.
    h: f64,
    m: f64,
    sigma: f64,
    /// ∂h/∂w at both ends, ∂h/∂m.
    h_by: [f64; 3],
    /// σ ∂(1/σ)/∂w at both ends.
    beta: [f64; 2],
    /// Δw at the end node = ahead · (Δw, Δa, Δm, 1).
    ahead: [f64; 4],
    /// By what Δa misses the end node.
    defect: f64,
    /// The path rests at one of the ends.
    at_rest: bool,
}

/// One constraint −floor ≤ y ≤ 1 with slack and multiplier of both sides.
#[derive(Debug, Clone, Copy)]
struct Row {
    /// What y is made of, next to the iterate: of w, a and m.
    terms: [f64; 3],
    /// 1, or 0 for a speed.
    floor: f64,
    /// Slope in (Δw, Δa, Δm) of the start node, and change at no step.
    slope: [f64; 3],
    drift: f64,
    /// y − 1 and −y − floor.
    over: [f64; 2],
    slack: [f64; 2],
    force: [f64; 2],
    /// 1 / slack
    inverse: [f64; 2],
    /// What the product of slack and multiplier comes to beyond the linear model.
    product: [f64; 2],
    slack_step: [f64; 2],
    force_step: [f64; 2],
}

/// A cell: its state and where its constraints are.
#[derive(Debug, Clone, Copy)]
struct Stage {
    state: CellState,
    /// First row of the jerk at the start, of the jerk at the end, of the others (the speed in the
    /// middle, then what depends on the start node alone), and of the next cell.
    rows: [usize; 4],
    /// The cell's part of the barrier: half by number, half by duration, so that neither many short
    /// cells nor few long ones outweigh the others.
    weight: f64,
    /// Greatest part of an axis's jerk limit that a path jerk of 1 takes.
    along: f64,
    /// The cost's gradient in (Δw, Δa, Δm) of the start node.
    gradient: [f64; 3],
    /// Of the cost with that to go: wm, am, mm.
    cross: [f64; 3],
    /// The cost to go from the end node, ½ xᵀPx: ww, wa, aa.
    to_go: [f64; 3],
    /// Δm = gain · (Δw, Δa, 1)
    gain: [f64; 3],
    step: [f64; 3],
}

/// What a step is for.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Aim {
    /// Straight for the optimum.
    Optimum,
    /// For products of slacks and multipliers of so much, with the steps' own products in mind.
    Target(f64),
    /// For the dynamics alone, by the smallest change in the metric of the barrier.
    Dynamics,
}

impl CellState {
    /// A slope in terms of the end node, in terms of the start node; and its drift.
    #[inline]
    fn pull_back(&self, [w, a, m]: [f64; 3]) -> ([f64; 3], f64) {
        let [by_w, by_a, by_m, one] = self.ahead;
        (
            [w * by_w, w * by_a + a, w * by_m + a + m],
            w * one + a * self.defect,
        )
    }

    /// β as a slope.
    #[inline]
    fn beta_slope(&self) -> ([f64; 3], f64) {
        let ([w, a, m], drift) = self.pull_back([self.beta[1], 0.0, 0.0]);
        ([w + self.beta[0], a, m], drift)
    }

    /// The state of the end node after a step.
    #[inline]
    fn follow(&self, [dw, da, dm]: [f64; 3]) -> (f64, f64) {
        let [ew, ea, em, e1] = self.ahead;
        (ew * dw + ea * da + em * dm + e1, da + dm + self.defect)
    }
}

impl Row {
    fn new(terms: [f64; 3], floor: f64) -> Self {
        Row {
            terms,
            floor,
            slope: [0.0; 3],
            drift: 0.0,
            over: [0.0; 2],
            slack: [0.0; 2],
            force: [0.0; 2],
            inverse: [0.0; 2],
            product: [0.0; 2],
            slack_step: [0.0; 2],
            force_step: [0.0; 2],
        }
    }

    #[inline]
    fn set(&mut self, value: f64, slope: [f64; 3], drift: f64) {
        self.over = [value - 1.0, -value - self.floor];
        self.slope = slope;
        self.drift = drift;
    }

    /// Weights z/s of both sides and their pulls straight for the optimum. Slack that is really there
    /// is taken.
    #[inline]
    fn weigh(&mut self, by_beta: f64) -> ([f64; 2], [f64; 2]) {
        let mut weight = [0.0; 2];
        let mut pull = [0.0; 2];
        let drift = [self.drift - by_beta, -self.drift - by_beta];
        for side in 0..2 {
            let slack = self.slack[side].max(-self.over[side]);
            self.slack[side] = slack;
            self.inverse[side] = 1.0 / slack;
            weight[side] = self.force[side] * self.inverse[side];
            pull[side] = weight[side] * (self.over[side] + drift[side] + slack);
        }
        (weight, pull)
    }

    /// What the pulls of both sides become for the target.
    #[inline]
    fn correct(&self, target: f64) -> [f64; 2] {
        std::array::from_fn(|side| (target - self.product[side]) * self.inverse[side])
    }

    /// Steps of slack and multiplier for the node's step.
    #[inline]
    fn aim(
        &mut self,
        [dw, da, dm]: [f64; 3],
        beta_step: f64,
        target: Option<f64>,
        sums: &mut Sums,
    ) {
        let [w, a, m] = self.slope;
        let change = self.drift + (w * dw + a * da + m * dm);
        let change = [change - beta_step, -change - beta_step];
        let pull = target.map_or([0.0; 2], |target| self.correct(target));
        for side in 0..2 {
            let (s, z) = (self.slack[side], self.force[side]);
            let ds = -(self.over[side] + change[side]) - s;
            let part = ds * self.inverse[side];
            let dz = pull[side] - z * (1.0 + part);
            self.slack_step[side] = ds;
            self.force_step[side] = dz;
            self.product[side] = ds * dz;
            sums.reach[0] = sums.reach[0].max(-part);
            let back = if target.is_some() {
                1.0 + part - pull[side] / z
            } else {
                1.0 + part
            };
            sums.reach[1] = sums.reach[1].max(back);
            sums.gap[0] += s * z;
            sums.gap[1] += ds * z;
            sums.gap[2] += s * dz;
            sums.gap[3] += ds * dz;
        }
    }
}

/// What the rows' steps come to.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    /// Reciprocals of the longest steps that keep slacks (and speeds) and multipliers positive.
    reach: [f64; 2],
    /// Σ s z, Σ Δs z, Σ s Δz, Σ Δs Δz
    gap: [f64; 4],
}

impl Sums {
    /// The longest steps to take, of the primal and of the dual.
    fn steps(&self) -> [f64; 2] {
        self.reach.map(|reach| (REACH / reach).min(1.0))
    }

    /// The duality gap after these steps.
    fn gap_after(&self, [primal, dual]: [f64; 2]) -> f64 {
        let [gap, by_primal, by_dual, by_both] = self.gap;
        gap + primal * by_primal + dual * by_dual + primal * dual * by_both
    }
}

/// A quadratic in (Δw, Δa, Δm): Hessian ww, wa, wm, aa, am, mm and gradient.
#[derive(Clone, Copy, Default)]
struct Quadratic {
    hessian: [f64; 6],
    gradient: [f64; 3],
}

impl Quadratic {
    #[inline]
    fn square(&mut self, weight: f64, [w, a, c]: [f64; 3]) {
        let [sw, sa, sc] = [weight * w, weight * a, weight * c];
        let h = &mut self.hessian;
        h[0] += sw * w;
        h[1] += sw * a;
        h[2] += sw * c;
        h[3] += sa * a;
        h[4] += sa * c;
        h[5] += sc * c;
    }

    #[inline]
    fn product(&mut self, weight: f64, [w, a, c]: [f64; 3], [x, b, d]: [f64; 3]) {
        let h = &mut self.hessian;
        h[0] += weight * 2.0 * w * x;
        h[1] += weight * (w * b + a * x);
        h[2] += weight * (w * d + c * x);
        h[3] += weight * 2.0 * a * b;
        h[4] += weight * (a * d + c * b);
        h[5] += weight * 2.0 * c * d;
    }

    #[inline]
    fn pull(&mut self, by: f64, row: [f64; 3]) {
        raise(&mut self.gradient, by, row);
    }
}

#[inline]
fn raise(gradient: &mut [f64; 3], by: f64, row: [f64; 3]) {
    for (g, r) in gradient.iter_mut().zip(row) {
        *g += by * r;
    }
}

/// Solver with its scratch space; reused from window to window.
#[derive(Debug, Clone, Default)]
pub struct TimeParametrisation<const N: usize> {
    stages: Vec<Stage>,
    rows: Vec<Row>,
    nodes: Vec<Node>,
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
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// Fastest law over `cells` from `start` to rest at the end, to the relative `tolerance` of its
    /// time. `guess` gives the first iterate, a state for every node with w > 0 inside; `barrier` tells
    /// how good it is: 0.3 for one that has only the shape, less for a solution of nearly the same
    /// problem.
    pub fn solve(
        &mut self,
        cells: &[Cell<N>],
        limits: &Limits<N>,
        start: Node,
        guess: impl Iterator<Item = Node>,
        barrier: f64,
        tolerance: f64,
    ) -> Outcome {
        let n = cells.len();
        debug_assert!(n >= 3, "too few cells for a law to rest");
        self.nodes.clear();
        self.nodes.extend(guess.take(n + 1));
        debug_assert_eq!(self.nodes.len(), n + 1);
        self.nodes[0] = start;
        self.nodes[n] = Node::default();

        self.lay_rows(cells, limits);
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
                row.slack = row.over.map(|over| (-over).max(0.3 * barrier));
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
            let sums = self.substitute(None);
            let left = (sums.gap_after(sums.steps()) / outcome.gap).min(1.0);
            let target = (left * left * left).max(1e-3) * outcome.gap / pairs;
            self.direct(Aim::Target(target));
            let sums = self.substitute(Some(target));
            let [primal, dual] = sums.steps();
            outcome.gap = sums.gap_after([primal, dual]);
            self.go(primal, dual);
            // Short steps: the model is good for nearby only.
            if primal < 0.2 {
                damping = (3.0 * damping).max(0.1 * outcome.gap / pairs);
            } else if primal > 0.6 {
                damping *= 0.2;
            }
            let miss;
            (outcome.time, miss) = self.relinearise(cells);
            // Where nothing leads to a law the multipliers grow without bound.
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
        for _ in 0..6 {
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
    fn lay_rows(&mut self, cells: &[Cell<N>], limits: &Limits<N>) {
        self.stages.clear();
        self.rows.clear();
        let last = cells.len() - 1;
        // The one of the rows in m alone (or a alone) that comes first to its bound.
        let strictest = |d: &[f64; N], limit: &[f64; N]| {
            (0..N).map(|i| d[i].abs() / limit[i]).fold(0.0, f64::max)
        };
        for (k, cell) in cells.iter().enumerate() {
            let mut rows = [self.rows.len(); 4];
            let [start, end] = &cell.ends;
            let flat = |slope: &Slope<N>| slope.d2 == [0.0; N] && slope.d3 == [0.0; N];
            let straight = flat(start) && flat(end) && start.d1 == end.d1;
            let along = strictest(&start.d1, &limits.jerk);
            for (at, slope) in cell.ends.iter().enumerate() {
                if straight {
                    if at == 0 {
                        let term = along / cell.share[1];
                        self.rows.push(Row::new([0.0, 0.0, term], 1.0));
                    }
                } else {
                    for i in 0..N {
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
                    for i in 0..N {
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
                let root = (1.0 - 4.0 * cell.length * bend).max(0.04).sqrt();
                let h = 2.0 * cell.length / (1.0 + root);
                // h − bend h² = Δs, and bend goes with m/σ².
                let by = h * h / (1.0 - 2.0 * h * bend).max(0.2);
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

    /// Goes through the step from the start to the end.
    fn substitute(&mut self, target: Option<f64>) -> Sums {
        let mut sums = Sums::default();
        let (mut dw, mut da) = (0.0, 0.0);
        for (k, stage) in self.stages.iter_mut().enumerate() {
            let Stage { state, gain, .. } = stage;
            let step = [dw, da, gain[0] * dw + gain[1] * da + gain[2]];
            if k > 0 {
                // The tangent of 1/σ is worth little much further down.
                sums.reach[0] = sums.reach[0].max(-dw / (0.8 * state.w[0]));
            }
            let (beta, beta_drift) = state.beta_slope();
            let beta_step = beta[0] * step[0] + beta[1] * step[1] + beta[2] * step[2] + beta_drift;
            let target = target.map(|target| target * stage.weight);
            let [first, _, others, end] = stage.rows;
            for row in &mut self.rows[first..others] {
                row.aim(step, beta_step, target, &mut sums);
            }
            for row in &mut self.rows[others..end] {
                row.aim(step, 0.0, target, &mut sums);
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

impl Stage {
    /// Values and slopes of the rows in the iterate.
    #[inline]
    fn evaluate(&self, rows: &mut [Row]) {
        let state = &self.state;
        let CellState { w, a, v, h, m, .. } = *state;
        let rate = state.sigma / h;
        let [first, second, others, end] = self.rows;
        for row in &mut rows[first..second] {
            let slope = [
                v[0] * row.terms[0],
                v[0] * row.terms[1],
                rate * row.terms[2],
            ];
            row.set(slope[0] * w[0] + slope[1] * a[0] + slope[2] * m, slope, 0.0);
        }
        for row in &mut rows[second..others] {
            let slope = [
                v[1] * row.terms[0],
                v[1] * row.terms[1],
                rate * row.terms[2],
            ];
            let value = slope[0] * w[1] + slope[1] * a[1] + slope[2] * m;
            let (slope, drift) = state.pull_back(slope);
            row.set(value, slope, drift);
        }
        let half = rows[others].terms[0];
        let (by_end, drift) = state.pull_back([half, 0.0, -0.5 * h * half]);
        let value = half * (w[0] + w[1] - 0.5 * m * h);
        rows[others].set(value, [half + by_end[0], by_end[1], by_end[2]], drift);
        for row in &mut rows[others + 1..end] {
            row.set(row.terms[0] * w[0] + row.terms[1] * a[0], row.terms, 0.0);
        }
    }

    /// The barrier as a quadratic; `worst` grows to the greatest excess over a limit.
    #[inline]
    fn weigh(&self, rows: &mut [Row], worst: &mut f64) -> Quadratic {
        let mut q = Quadratic::default();
        let (beta, beta_drift) = self.state.beta_slope();
        let (mut beta_weight, mut beta_pull) = (0.0, 0.0);
        let mut beta_cross = [0.0; 3];
        let [first, _, others, end] = self.rows;
        // The bound of the jerk moves by β with the speed.
        for row in &mut rows[first..others] {
            *worst = worst.max(row.over[0]).max(row.over[1]);
            let (weight, pull) = row.weigh(beta_drift);
            q.square(weight[0] + weight[1], row.slope);
            q.pull(pull[0] - pull[1], row.slope);
            beta_weight += weight[0] + weight[1];
            beta_pull += pull[0] + pull[1];
            raise(&mut beta_cross, weight[0] - weight[1], row.slope);
        }
        q.square(beta_weight, beta);
        q.pull(-beta_pull, beta);
        q.product(-1.0, beta_cross, beta);
        for row in &mut rows[others..end] {
            *worst = worst.max(row.over[0]).max(row.over[1]);
            let (weight, pull) = row.weigh(0.0);
            q.square(weight[0] + weight[1], row.slope);
            q.pull(pull[0] - pull[1], row.slope);
        }
        q
    }

    /// The gradient for a target.
    #[inline]
    fn corrected(&self, rows: &[Row], target: f64) -> [f64; 3] {
        let mut gradient = self.gradient;
        let [first, _, others, end] = self.rows;
        let mut beta_pull = 0.0;
        for row in &rows[first..others] {
            let pull = row.correct(target);
            raise(&mut gradient, pull[0] - pull[1], row.slope);
            beta_pull += pull[0] + pull[1];
        }
        raise(&mut gradient, -beta_pull, self.state.beta_slope().0);
        for row in &rows[others..end] {
            let pull = row.correct(target);
            raise(&mut gradient, pull[0] - pull[1], row.slope);
        }
        gradient
    }
}

impl CellState {
    /// Adds the cell's duration h/σ, which is convex in w at both ends.
    fn add_time(&self, q: &mut Quadratic) {
        let time = self.h / self.sigma;
        let (end, drift) = self.pull_back([1.0, 0.0, 0.0]);
        let start = [1.0, 0.0, 0.0];
        let [b0, b1] = self.beta;
        // ∂²(1/σ)/∂w² · σ = 2 β² + 1/(8 v³ σ)
        let curve = |v: f64, b: f64| {
            if v > 0.0 {
                time * (2.0 * b * b + 0.125 / (v * v * v * self.sigma))
            } else {
                0.0
            }
        };
        let (c0, c1, cross) = (
            curve(self.v[0], b0),
            curve(self.v[1], b1),
            time * 2.0 * b0 * b1,
        );

        q.square(c0, start);
        q.square(c1, end);
        q.product(cross, start, end);
        q.pull(time * b0 + cross * drift, start);
        q.pull(time * b1 + c1 * drift, end);
        // h changes, too.
        let [h0, h1, by_m] = self.h_by.map(|h| h / self.sigma);
        q.pull(1.0, [h0, 0.0, by_m]);
        q.pull(h1, end);
    }
}
