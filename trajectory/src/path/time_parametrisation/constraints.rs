//! The constraints of a cell, each with slack and multiplier of both sides, and what they come to in a
//! Newton step.

use super::REACH;

/// A cell's state in the current iterate: all that its constraints depend on.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct CellState {
    /// At both ends.
    pub(super) w: [f64; 2],
    pub(super) a: [f64; 2],
    pub(super) v: [f64; 2],
    /// σ T and the control, m.
    pub(super) h: f64,
    pub(super) m: f64,
    pub(super) sigma: f64,
    /// ∂h/∂w at both ends, ∂h/∂m.
    pub(super) h_by: [f64; 3],
    /// σ ∂(1/σ)/∂w at both ends.
    pub(super) beta: [f64; 2],
    /// Δw at the end node = ahead · (Δw, Δa, Δm, 1).
    pub(super) ahead: [f64; 4],
    /// By what Δa misses the end node.
    pub(super) defect: f64,
    /// The path rests at one of the ends.
    pub(super) at_rest: bool,
}

/// One constraint −floor ≤ y ≤ 1 with slack and multiplier of both sides.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row {
    /// What y is made of, next to the iterate: of w, a and m.
    pub(super) terms: [f64; 3],
    /// 1, or 0 for a speed.
    pub(super) floor: f64,
    /// Slope in (Δw, Δa, Δm) of the start node, and change at no step.
    pub(super) slope: [f64; 3],
    pub(super) drift: f64,
    /// y − 1 and −y − floor.
    pub(super) over: [f64; 2],
    pub(super) slack: [f64; 2],
    pub(super) force: [f64; 2],
    /// 1 / slack
    pub(super) inverse: [f64; 2],
    /// What the product of slack and multiplier comes to beyond the linear model.
    pub(super) product: [f64; 2],
    pub(super) slack_step: [f64; 2],
    pub(super) force_step: [f64; 2],
}

/// A cell: its state and where its constraints are.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stage {
    pub(super) state: CellState,
    /// First row of the jerk at the start, of the jerk at the end, of the others (the speed in the
    /// middle, then what depends on the start node alone), and of the next cell.
    pub(super) rows: [usize; 4],
    /// The cell's part of the barrier: half by number, half by duration, so that neither many short
    /// cells nor few long ones outweigh the others.
    pub(super) weight: f64,
    /// Greatest part of an axis's jerk limit that a path jerk of 1 takes.
    pub(super) along: f64,
    /// The cost's gradient in (Δw, Δa, Δm) of the start node.
    pub(super) gradient: [f64; 3],
    /// Of the cost with that to go: wm, am, mm.
    pub(super) cross: [f64; 3],
    /// The cost to go from the end node, ½ xᵀPx: ww, wa, aa.
    pub(super) to_go: [f64; 3],
    /// Δm = gain · (Δw, Δa, 1)
    pub(super) gain: [f64; 3],
    pub(super) step: [f64; 3],
}

/// What a step is for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Aim {
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
    pub(super) fn pull_back(&self, [w, a, m]: [f64; 3]) -> ([f64; 3], f64) {
        let [by_w, by_a, by_m, one] = self.ahead;
        (
            [w * by_w, w * by_a + a, w * by_m + a + m],
            w * one + a * self.defect,
        )
    }

    /// β as a slope.
    #[inline]
    pub(super) fn beta_slope(&self) -> ([f64; 3], f64) {
        let ([w, a, m], drift) = self.pull_back([self.beta[1], 0.0, 0.0]);
        ([w + self.beta[0], a, m], drift)
    }

    /// The state of the end node after a step.
    #[inline]
    pub(super) fn follow(&self, [dw, da, dm]: [f64; 3]) -> (f64, f64) {
        let [ew, ea, em, e1] = self.ahead;
        (ew * dw + ea * da + em * dm + e1, da + dm + self.defect)
    }
}

impl Row {
    pub(super) fn new(terms: [f64; 3], floor: f64) -> Self {
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
    pub(super) fn set(&mut self, value: f64, slope: [f64; 3], drift: f64) {
        self.over = [value - 1.0, -value - self.floor];
        self.slope = slope;
        self.drift = drift;
    }

    /// Weights z/s of both sides and their pulls straight for the optimum. Slack that is really there
    /// is taken.
    #[inline]
    pub(super) fn weigh(&mut self, by_beta: f64) -> ([f64; 2], [f64; 2]) {
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
    pub(super) fn correct(&self, target: f64) -> [f64; 2] {
        std::array::from_fn(|side| (target - self.product[side]) * self.inverse[side])
    }

    /// Steps of slack and multiplier for the node's step; with a target, or straight for the optimum.
    #[inline]
    pub(super) fn aim<const HAS_TARGET: bool>(
        &mut self,
        [dw, da, dm]: [f64; 3],
        beta_step: f64,
        target: f64,
        sums: &mut Sums,
    ) {
        let [w, a, m] = self.slope;
        let change = self.drift + (w * dw + a * da + m * dm);
        let change = [change - beta_step, -change - beta_step];
        let pull = match HAS_TARGET {
            true => self.correct(target),
            false => [0.0; 2],
        };
        let (mut ahead, mut back) = ([0.0; 2], [0.0; 2]);
        for side in 0..2 {
            let (s, z) = (self.slack[side], self.force[side]);
            let ds = -(self.over[side] + change[side]) - s;
            let part = ds * self.inverse[side];
            let dz = pull[side] - z * (1.0 + part);
            self.slack_step[side] = ds;
            self.force_step[side] = dz;
            self.product[side] = ds * dz;
            ahead[side] = -part;
            back[side] = match HAS_TARGET {
                true => 1.0 + part - pull[side] / z,
                false => 1.0 + part,
            };
            sums.gap[0] += s * z;
            sums.gap[1] += ds * z;
            sums.gap[2] += s * dz;
            sums.gap[3] += ds * dz;
        }
        sums.reach[0] = greater(sums.reach[0], greater(ahead[0], ahead[1]));
        sums.reach[1] = greater(sums.reach[1], greater(back[0], back[1]));
    }
}

/// The greater one. Unlike `f64::max` it takes no care of what is no number, of which the gap is none either.
#[inline]
fn greater(one: f64, other: f64) -> f64 {
    if other > one { other } else { one }
}

/// What the rows' steps come to.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sums {
    /// Reciprocals of the longest steps that keep slacks (and speeds) and multipliers positive.
    pub(super) reach: [f64; 2],
    /// Σ s z, Σ Δs z, Σ s Δz, Σ Δs Δz
    pub(super) gap: [f64; 4],
}

impl Sums {
    /// The longest steps to take, of the primal and of the dual.
    pub(super) fn steps(&self) -> [f64; 2] {
        self.reach.map(|reach| (REACH / reach).min(1.0))
    }

    /// The duality gap after these steps.
    pub(super) fn gap_after(&self, [primal, dual]: [f64; 2]) -> f64 {
        let [gap, by_primal, by_dual, by_both] = self.gap;
        gap + primal * by_primal + dual * by_dual + primal * dual * by_both
    }
}

/// A quadratic in (Δw, Δa, Δm): Hessian ww, wa, wm, aa, am, mm and gradient.
#[derive(Clone, Copy, Default)]
pub(super) struct Quadratic {
    pub(super) hessian: [f64; 6],
    pub(super) gradient: [f64; 3],
}

impl Quadratic {
    #[inline]
    pub(super) fn square(&mut self, weight: f64, [w, a, c]: [f64; 3]) {
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
    pub(super) fn product(&mut self, weight: f64, [w, a, c]: [f64; 3], [x, b, d]: [f64; 3]) {
        let h = &mut self.hessian;
        h[0] += weight * 2.0 * w * x;
        h[1] += weight * (w * b + a * x);
        h[2] += weight * (w * d + c * x);
        h[3] += weight * 2.0 * a * b;
        h[4] += weight * (a * d + c * b);
        h[5] += weight * 2.0 * c * d;
    }

    #[inline]
    pub(super) fn pull(&mut self, by: f64, row: [f64; 3]) {
        raise(&mut self.gradient, by, row);
    }
}

#[inline]
pub(super) fn raise(gradient: &mut [f64; 3], by: f64, row: [f64; 3]) {
    for (g, r) in gradient.iter_mut().zip(row) {
        *g += by * r;
    }
}

impl Stage {
    /// Values and slopes of the rows in the iterate.
    #[inline]
    pub(super) fn evaluate(&self, rows: &mut [Row]) {
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
    pub(super) fn weigh(&self, rows: &mut [Row], worst: &mut f64) -> Quadratic {
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
    pub(super) fn corrected(&self, rows: &[Row], target: f64) -> [f64; 3] {
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
    pub(super) fn add_time(&self, q: &mut Quadratic) {
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
