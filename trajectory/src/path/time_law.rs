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
/// The dynamics are met when they miss by no more than this part of ṡ².
const EXACT: f64 = 1e-12;

/// Slack and multiplier of both sides of |y| ≤ 1.
#[derive(Debug, Clone, Copy, Default)]
struct Pair {
    slack: [f64; 2],
    force: [f64; 2],
    slack_step: [f64; 2],
    force_step: [f64; 2],
}

/// The constraints of one cell.
#[derive(Debug, Clone)]
struct Pairs<const N: usize> {
    jerk: [[Pair; N]; 2],
    acceleration: [Pair; N],
    /// 0 ≤ w ≤ W at the start and in the middle.
    speed: [Pair; 2],
}

/// A cell's state in the current iterate: all that its constraints depend on.
#[derive(Debug, Clone, Copy)]
struct Frame {
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
    /// The start node is given.
    first: bool,
    /// The path rests at one of the ends.
    at_rest: bool,
}

#[derive(Debug, Clone)]
struct Stage<const N: usize> {
    frame: Frame,
    pairs: Pairs<N>,
    /// Δm = gain · (Δw, Δa, 1)
    gain: [f64; 3],
    step: [f64; 3],
    /// The cell's part of the barrier: half by number, half by duration, so that neither many short
    /// cells nor few long ones outweigh the others.
    weight: f64,
}

/// A constraint value with its slope in (Δw, Δa, Δm) and its change at no step.
struct Row {
    value: f64,
    slope: [f64; 3],
    drift: f64,
    /// The bound moves by β with the speed.
    with_beta: bool,
    /// value ≤ bound[0] and −value ≤ bound[1]
    bound: [f64; 2],
}

impl Frame {
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
}

impl<const N: usize> Pairs<N> {
    /// Every constraint of the cell in turn.
    #[inline]
    fn each(
        &mut self,
        frame: &Frame,
        cell: &Cell<N>,
        limits: &Limits<N>,
        mut visit: impl FnMut(&mut Pair, Row),
    ) {
        let Frame {
            w,
            a,
            v,
            h,
            m,
            sigma,
            ..
        } = *frame;
        for end in 0..2 {
            let slope = &cell.ends[end];
            for i in 0..N {
                let scale = 1.0 / (cell.share[1] * limits.jerk[i]);
                let by_w = v[end] * slope.d3[i] * scale;
                let by_a = 3.0 * v[end] * slope.d2[i] * scale;
                let by_m = sigma / h * slope.d1[i] * scale;
                let value = by_w * w[end] + by_a * a[end] + by_m * m;
                let row = [by_w, by_a, by_m];
                let (slope, drift) = if end == 0 {
                    (row, 0.0)
                } else {
                    frame.pull_back(row)
                };
                visit(
                    &mut self.jerk[end][i],
                    Row {
                        value,
                        slope,
                        drift,
                        with_beta: true,
                        bound: [1.0, 1.0],
                    },
                );
            }
        }
        // Half way w is (w₀ + w₁)/2 − m h/4, or less. Without this row a wave of the acceleration from
        // node to node would pass unseen.
        let scale = 1.0 / (cell.speed[1] * cell.speed[1]);
        let half = 0.5 * scale;
        let value = half * (w[0] + w[1] - 0.5 * m * h);
        let (end, drift) = frame.pull_back([half, 0.0, -0.25 * h * scale]);
        let slope = [half + end[0], end[1], end[2]];
        visit(
            &mut self.speed[1],
            Row {
                value,
                slope,
                drift,
                with_beta: false,
                bound: [1.0, 0.0],
            },
        );
        if frame.first {
            return;
        }
        for i in 0..N {
            let scale = 1.0 / (cell.share[0] * limits.acceleration[i]);
            let (by_w, by_a) = (cell.ends[0].d2[i] * scale, cell.ends[0].d1[i] * scale);
            let value = by_w * w[0] + by_a * a[0];
            let slope = [by_w, by_a, 0.0];
            visit(
                &mut self.acceleration[i],
                Row {
                    value,
                    slope,
                    drift: 0.0,
                    with_beta: false,
                    bound: [1.0, 1.0],
                },
            );
        }
        let scale = 1.0 / (cell.speed[0] * cell.speed[0]);
        let slope = [scale, 0.0, 0.0];
        visit(
            &mut self.speed[0],
            Row {
                value: scale * w[0],
                slope,
                drift: 0.0,
                with_beta: false,
                bound: [1.0, 0.0],
            },
        );
    }

    fn all(&mut self, first: bool) -> impl Iterator<Item = &mut Pair> {
        let node = if first { 0 } else { N };
        self.jerk
            .iter_mut()
            .flatten()
            .chain(self.acceleration[..node].iter_mut())
            .chain(&mut self.speed[usize::from(first)..])
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
        for (g, r) in self.gradient.iter_mut().zip(row) {
            *g += by * r;
        }
    }
}

impl Pair {
    fn new(row: &Row, target: f64, least: f64) -> Self {
        let slack = [
            (row.bound[0] - row.value).max(least),
            (row.bound[1] + row.value).max(least),
        ];
        Pair {
            slack,
            force: slack.map(|s| target / s),
            ..Pair::default()
        }
    }

    /// Weights z/s and pulls of both sides. Slack that is really there is taken.
    #[inline]
    fn weigh(
        &mut self,
        over: [f64; 2],
        drift: [f64; 2],
        target: f64,
        second: bool,
    ) -> ([f64; 2], [f64; 2]) {
        let mut weight = [0.0; 2];
        let mut pull = [0.0; 2];
        for side in 0..2 {
            let slack = self.slack[side].max(-over[side]);
            self.slack[side] = slack;
            let target = if second {
                target - self.slack_step[side] * self.force_step[side]
            } else {
                target
            };
            let inverse = 1.0 / slack;
            weight[side] = self.force[side] * inverse;
            pull[side] = target * inverse + weight[side] * (over[side] + drift[side] + slack);
        }
        (weight, pull)
    }

    /// Steps of slack and force when the constraints come to `linear`; `reach` grows to the
    /// reciprocal of the longest step that leaves both positive.
    #[inline]
    fn aim(&mut self, linear: [f64; 2], target: f64, second: bool, reach: &mut [f64; 2]) {
        for side in 0..2 {
            let (s, z) = (self.slack[side], self.force[side]);
            let ds = -linear[side] - s;
            let target = if second {
                target - self.slack_step[side] * self.force_step[side]
            } else {
                target
            };
            let dz = (target - z * ds) / s - z;
            self.slack_step[side] = ds;
            self.force_step[side] = dz;
            reach[0] = reach[0].max(-ds / s);
            reach[1] = reach[1].max(-dz / z);
        }
    }

    fn gap(&self) -> f64 {
        self.slack[0] * self.force[0] + self.slack[1] * self.force[1]
    }
}

/// Solver with its scratch space; reused from window to window.
#[derive(Debug, Clone, Default)]
pub struct TimeLaw<const N: usize> {
    stages: Vec<Stage<N>>,
    nodes: Vec<Node>,
}

impl<const N: usize> TimeLaw<N> {
    /// Duration and jerk of every cell in turn.
    pub fn motions(&self) -> impl Iterator<Item = (f64, f64)> {
        self.stages.iter().map(|Stage { frame, .. }| {
            (
                frame.h / frame.sigma,
                (frame.a[1] - frame.a[0]) * frame.sigma / frame.h,
            )
        })
    }

    /// The solution: a state for every node, one more than there are cells.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// Fastest law over `cells` from `start` to rest at the end, to the relative `tolerance` of its
    /// time. `guess` gives the first iterate, a state for every node with w > 0 inside; `heat` tells
    /// how good it is: 0.3 for one that has only the shape, less for a solution of nearly the same
    /// problem.
    pub fn solve(
        &mut self,
        cells: &[Cell<N>],
        limits: &Limits<N>,
        start: Node,
        guess: impl Iterator<Item = Node>,
        heat: f64,
        tolerance: f64,
    ) -> Outcome {
        let n = cells.len();
        debug_assert!(n >= 3, "too few cells for a law to rest");
        self.nodes.clear();
        self.nodes.extend(guess.take(n + 1));
        debug_assert_eq!(self.nodes.len(), n + 1);
        self.nodes[0] = start;
        self.nodes[n] = Node::default();

        let rows = (6 * N + 4) as f64;
        let (time, _) = self.begin(cells);
        let target = heat * time / rows;
        for (stage, cell) in self.stages.iter_mut().zip(cells) {
            let Stage {
                frame,
                pairs,
                weight,
                ..
            } = stage;
            *weight = 0.5 * (frame.h / frame.sigma / time + 1.0 / n as f64);
            pairs.each(frame, cell, limits, |pair, row| {
                *pair = Pair::new(&row, target * *weight, 0.3 * heat)
            });
        }
        let length = |reach: f64| if reach > REACH { REACH / reach } else { 1.0 };
        let gap = self.gap_after(0.0, 0.0);
        let mut outcome = Outcome {
            converged: false,
            iterations: 0,
            time,
            gap,
            excess: 1.0,
        };
        let mut damping = 0.0_f64;
        while outcome.iterations < MAX_ITERATIONS {
            outcome.iterations += 1;
            // Where would a step straight for the optimum lead? That tells how far to aim now, and
            // what the products of the steps will come to (Mehrotra, "On the Implementation of a
            // Primal-Dual Interior Point Method", 1992).
            outcome.excess = self.eliminate(cells, limits, Some(0.0), false, damping);
            let [primal, dual] = self.substitute(cells, limits, 0.0, false).map(length);
            let left = (self.gap_after(primal, dual) / outcome.gap).min(1.0);
            let target = (left * left * left).max(1e-3) * outcome.gap / rows;
            self.eliminate(cells, limits, Some(target), true, damping);
            let [primal, dual] = self.substitute(cells, limits, target, true).map(length);
            outcome.gap = self.go(primal, dual);
            // Short steps: the model is good for nearby only.
            if primal < 0.2 {
                damping = (3.0 * damping).max(0.1 * outcome.gap / rows);
            } else if primal > 0.6 {
                damping *= 0.2;
            }
            let miss;
            (outcome.time, miss) = self.relinearise(cells);
            if !outcome.time.is_finite() || !outcome.gap.is_finite() {
                break;
            }
            // Out of patience, what nearly keeps the limits will do.
            let last = outcome.iterations == MAX_ITERATIONS;
            let allowed = if last { PATIENT } else { tolerance };
            if (last || outcome.gap <= tolerance * outcome.time) && outcome.excess < allowed {
                outcome.converged = self.meet(cells, limits, miss);
                break;
            }
        }
        outcome
    }

    /// Brings the dynamics from missing by `miss` down to rounding; false if that fails.
    fn meet(&mut self, cells: &[Cell<N>], limits: &Limits<N>, mut miss: f64) -> bool {
        for _ in 0..6 {
            if miss < EXACT {
                return true;
            }
            self.eliminate(cells, limits, None, false, 0.0);
            let (mut dw, mut da) = (0.0, 0.0);
            for (stage, node) in self.stages.iter_mut().zip(&mut self.nodes) {
                let Stage { frame, gain, .. } = stage;
                let dm = gain[0] * dw + gain[1] * da + gain[2];
                node.w += dw;
                node.a += da;
                frame.m += dm;
                let [ew, ea, em, e1] = frame.ahead;
                (dw, da) = (ew * dw + ea * da + em * dm + e1, da + dm + frame.defect);
            }
            miss = self.relinearise(cells).1;
        }
        miss < EXACT
    }

    fn begin(&mut self, cells: &[Cell<N>]) -> (f64, f64) {
        self.stages.clear();
        let last = cells.len() - 1;
        for k in 0..cells.len() {
            self.stages.push(Stage {
                frame: Frame {
                    w: [0.0; 2],
                    a: [0.0; 2],
                    v: [0.0; 2],
                    h: cells[k].length,
                    m: self.nodes[k + 1].a - self.nodes[k].a,
                    sigma: 0.0,
                    h_by: [0.0; 3],
                    beta: [0.0; 2],
                    ahead: [0.0; 4],
                    defect: 0.0,
                    first: k == 0,
                    at_rest: (k == 0 && self.nodes[0].w == 0.0) || k == last,
                },
                pairs: Pairs {
                    jerk: [[Pair::default(); N]; 2],
                    acceleration: [Pair::default(); N],
                    speed: [Pair::default(); 2],
                },
                gain: [0.0; 3],
                step: [0.0; 3],
                weight: 0.0,
            });
        }
        self.relinearise(cells)
    }

    /// Brings every frame up to date with the iterate; returns the motion time and by what part
    /// of itself the dynamics miss w at most.
    fn relinearise(&mut self, cells: &[Cell<N>]) -> (f64, f64) {
        let (mut time, mut miss) = (0.0, 0.0_f64);
        let mut v0 = self.nodes[0].w.sqrt();
        for (k, (stage, cell)) in self.stages.iter_mut().zip(cells).enumerate() {
            let (x0, x1) = (self.nodes[k], self.nodes[k + 1]);
            let v1 = x1.w.sqrt();
            let frame = &mut stage.frame;
            let sigma = 0.5 * (v0 + v1);
            let slope = |v: f64| if v > 0.0 { -0.25 / (v * sigma) } else { 0.0 };
            frame.beta = [slope(v0), slope(v1)];
            if frame.at_rest {
                frame.h = 1.5 * cell.length;
                frame.h_by = [0.0; 3];
            } else {
                let bend = frame.m / (12.0 * sigma * sigma);
                let root = (1.0 - 4.0 * cell.length * bend).max(0.04).sqrt();
                let h = 2.0 * cell.length / (1.0 + root);
                // h − bend h² = Δs, and bend goes with m/σ².
                let by = h * h / (1.0 - 2.0 * h * bend).max(0.2);
                frame.h = h;
                frame.h_by = [
                    by * 2.0 * bend * frame.beta[0],
                    by * 2.0 * bend * frame.beta[1],
                    by / (12.0 * sigma * sigma),
                ];
            }
            frame.sigma = sigma;
            frame.v = [v0, v1];
            frame.w = [x0.w, x1.w];
            frame.a = [x0.a, x1.a];
            frame.defect = x0.a + frame.m - x1.a;
            // w₁ = w₀ + h (2 a₀ + m)
            let sum = 2.0 * x0.a + frame.m;
            let own = 1.0 / (1.0 - sum * frame.h_by[1]);
            frame.ahead = [
                (1.0 + sum * frame.h_by[0]) * own,
                2.0 * frame.h * own,
                (frame.h + sum * frame.h_by[2]) * own,
                (x0.w + frame.h * sum - x1.w) * own,
            ];
            miss = miss.max((frame.ahead[3] / x0.w.max(x1.w)).abs());
            time += frame.h / sigma;
            v0 = v1;
        }
        (time, miss)
    }

    /// Assembles the Newton step's equations and eliminates them from the end to the start.
    /// Without a target the step only meets the dynamics, by the smallest change in the metric of
    /// the barrier. Returns the greatest excess over a limit.
    fn eliminate(
        &mut self,
        cells: &[Cell<N>],
        limits: &Limits<N>,
        target: Option<f64>,
        second: bool,
        damping: f64,
    ) -> f64 {
        let mut worst = 0.0_f64;
        let last = cells.len() - 1;
        // Cost to go ½ xᵀPx + px: ww, wa, aa; w, a.
        let mut to_go = ([0.0; 3], [0.0; 2]);
        // The last node is at rest: w + h a = miss at the node before.
        let mut landing = (0.0, 0.0);
        for (k, (stage, cell)) in self.stages.iter_mut().zip(cells).enumerate().rev() {
            let Stage {
                frame,
                pairs,
                gain,
                weight: share,
                ..
            } = stage;
            let aim = target.unwrap_or(0.0) * *share;
            let mut q = Quadratic::default();
            let (beta, beta_drift) = frame.beta_slope();
            let (mut beta_weight, mut beta_pull) = (0.0, 0.0);
            let mut beta_cross = [0.0; 3];
            pairs.each(frame, cell, limits, |pair, row| {
                let over = [row.value - row.bound[0], -row.value - row.bound[1]];
                worst = worst.max(over[0]).max(over[1]);
                let b = if row.with_beta { beta_drift } else { 0.0 };
                let (weight, pull) = pair.weigh(over, [row.drift - b, -row.drift - b], aim, second);
                q.square(weight[0] + weight[1], row.slope);
                q.pull(pull[0] - pull[1], row.slope);
                if row.with_beta {
                    beta_weight += weight[0] + weight[1];
                    beta_pull += pull[0] + pull[1];
                    for (cross, slope) in beta_cross.iter_mut().zip(row.slope) {
                        *cross += (weight[0] - weight[1]) * slope;
                    }
                }
            });
            q.square(beta_weight, beta);
            q.pull(-beta_pull, beta);
            q.product(-1.0, beta_cross, beta);
            frame.add_time(&mut q);
            let along = (0..N)
                .map(|i| cell.ends[0].d1[i].abs() / limits.jerk[i])
                .fold(0.0, f64::max);
            q.square(damping * *share, [0.0, 0.0, frame.sigma / frame.h * along]);
            if target.is_none() {
                q.gradient = [0.0; 3];
            }
            let [ww, wa, wm, aa, am, mm] = q.hessian;
            let [gw, ga, gm] = q.gradient;
            if k == last {
                // a + m = 0 and w + h a = 0 at the end.
                let one = -frame.a[0] - frame.m;
                *gain = [0.0, -1.0, one];
                to_go = (
                    [ww, wa - wm, aa - 2.0 * am + mm],
                    [gw + wm * one, ga - gm + (am - mm) * one],
                );
                landing = (frame.h, -(frame.w[0] + frame.h * frame.a[0]));
                continue;
            }
            // Add the cost to go from x⁺: Δw⁺ = ahead · (Δw, Δa, Δm, 1), Δa⁺ = Δa + Δm + defect.
            let ([pww, pwa, paa], [pw, pa]) = to_go;
            let [ew, ea, em, e1] = frame.ahead;
            let (rw, ra) = (
                pw + pww * e1 + pwa * frame.defect,
                pa + pwa * e1 + paa * frame.defect,
            );
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
            let gw = gw + ew * rw;
            let ga = ga + ea * rw + ra;
            let gm = gm + em * rw + ra;
            *gain = if k + 1 == last {
                // Here the control has to meet the landing w + l a = miss.
                let (l, miss) = landing;
                let by_m = em + l;
                [
                    -ew / by_m,
                    -(ea + l) / by_m,
                    (miss - e1 - l * frame.defect) / by_m,
                ]
            } else {
                [-wm / mm, -am / mm, -gm / mm]
            };
            let [kw, ka, k1] = *gain;
            to_go = (
                [
                    ww + kw * (2.0 * wm + mm * kw),
                    wa + kw * am + ka * wm + mm * kw * ka,
                    aa + ka * (2.0 * am + mm * ka),
                ],
                [
                    gw + kw * gm + k1 * (wm + mm * kw),
                    ga + ka * gm + k1 * (am + mm * ka),
                ],
            );
        }
        worst
    }

    /// Goes through the step from the start to the end; returns the reciprocals of the longest
    /// steps that keep slacks (and speeds) and multipliers positive.
    fn substitute(
        &mut self,
        cells: &[Cell<N>],
        limits: &Limits<N>,
        target: f64,
        second: bool,
    ) -> [f64; 2] {
        let mut reach = [0.0_f64; 2];
        let (mut dw, mut da) = (0.0, 0.0);
        for (stage, cell) in self.stages.iter_mut().zip(cells) {
            let Stage {
                frame,
                pairs,
                gain,
                step,
                weight: share,
            } = stage;
            let target = target * *share;
            let dm = gain[0] * dw + gain[1] * da + gain[2];
            *step = [dw, da, dm];
            if !frame.first {
                // The tangent of 1/σ is worth little much further down.
                reach[0] = f64::max(reach[0], -dw / (0.8 * frame.w[0]));
            }
            let along = |row: [f64; 3]| row[0] * dw + row[1] * da + row[2] * dm;
            let (beta, beta_drift) = frame.beta_slope();
            let beta_step = along(beta) + beta_drift;
            pairs.each(frame, cell, limits, |pair, row| {
                let change = row.drift + along(row.slope);
                let b = if row.with_beta { beta_step } else { 0.0 };
                let linear = [
                    row.value - row.bound[0] + change - b,
                    -row.value - row.bound[1] - change - b,
                ];
                pair.aim(linear, target, second, &mut reach);
            });
            let [ew, ea, em, e1] = frame.ahead;
            (dw, da) = (ew * dw + ea * da + em * dm + e1, da + dm + frame.defect);
        }
        reach
    }

    /// The duality gap after the step.
    fn gap_after(&mut self, primal: f64, dual: f64) -> f64 {
        let mut gap = 0.0;
        for stage in &mut self.stages {
            for pair in stage.pairs.all(stage.frame.first) {
                for side in 0..2 {
                    gap += (pair.slack[side] + primal * pair.slack_step[side])
                        * (pair.force[side] + dual * pair.force_step[side]);
                }
            }
        }
        gap
    }

    /// Takes the step; returns the new duality gap.
    fn go(&mut self, primal: f64, dual: f64) -> f64 {
        let mut gap = 0.0;
        for (stage, node) in self.stages.iter_mut().zip(&mut self.nodes) {
            let [dw, da, dm] = stage.step;
            node.w += primal * dw;
            node.a += primal * da;
            stage.frame.m += primal * dm;
            for pair in stage.pairs.all(stage.frame.first) {
                for side in 0..2 {
                    pair.slack[side] += primal * pair.slack_step[side];
                    pair.force[side] += dual * pair.force_step[side];
                }
                gap += pair.gap();
            }
        }
        gap
    }
}

impl Frame {
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
