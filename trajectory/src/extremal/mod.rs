//! The extremal plans: for every duration the plan that gets furthest.
//!
//! # The curve
//!
//! Among all plans of duration `T` between two states, those of greatest displacement `D(T)` have
//! the jerk pattern *up, hold, down, (cruise,) down, hold, up* (Pontryagin: the adjoint of the
//! acceleration is a convex parabola, so at most two switches; a limit on the acceleration or the
//! velocity only inserts a hold). For a given duration all plans form a convex set, so every
//! displacement between the smallest and the greatest can be had, and the shortest plan over a
//! given displacement is the first point where `D(T)` of the one or the other direction passes it.
//! The smallest displacement is the greatest of the mirrored axis.
//!
//! With `m = 1/j_max`, `n = 1/|j_min|`, `k = (m + n)/2`, peak accelerations `a1 ≥ a2` and holds
//! `t2` (at `a_max`) and `t6` (at `a_min`), the end velocity demands
//!
//! ```text
//! k (a1² − a2²) + a_max t2 + a_min t6 = v_f − v_0 + m (a_0² − a_f²)/2 =: W
//! ```
//!
//! which leaves a curve of plans, ordered by duration: `T = 2k (a1 − a2) + t2 + t6 + const`. It is
//! walked region by region (no hold, one, the other, both, cruise); in each region `D` is a polynomial of low
//! degree in a parameter that grows with `T`, or one with a part in `1/u`. `W < 0` is the same motion
//! backwards in time, so `W ≥ 0` is the only case solved.
//!
//! # Where it passes a displacement
//!
//! By the envelope theorem `dD/dT = H = v + a1·t3/2` at the end of the first hold, so `H` grows and `D`
//! is convex wherever `a2 ≤ 0 ≤ a1`: there the last passage of a displacement is the only one after any
//! point below it. Before, with both peak accelerations positive, `D` may rise, fall and rise again; its
//! one maximum is in closed form. Between the two parts there may be a *blocked interval* of durations that no plan
//! has at all, where `a1` would be below `a_0`. At each of its sides the greatest displacement is the smallest one, so
//! comparing the distance with that one value tells which curve to follow. So it takes two comparisons and one
//! region, then Newton's method on the region's polynomial and on the plan itself.
//!
//! # Rounding
//!
//! Parameters are offsets from the beginning of a region, not absolute values: a short move at large rates would
//! lose its digits in them. A state within rounding of a surface between two kinds of plan is taken to be on
//! it, as far as the end is still met to 1e-12. Beside a blocked interval rounding of the velocities moves the duration
//! by much more than itself; there the duration gives way, not the kind of plan.
//!
//! - `change`: the fastest change of velocity and acceleration, wherever it leads: where all curves begin,
//! - `normalised`: the problem turned so that `D` is wanted great and `W ≥ 0`, and its solution,
//! - `ends`: the plans at which regions begin and end,
//! - `regions`: plans, displacement and duration along a region,
//! - `curve`: the whole curve, for durations that are stated.

mod change;
mod curve;
mod ends;
mod normalised;
mod regions;

use crate::limits::Limits;
pub(crate) use change::{Change, fastest_change};

/// What is between the ends of a plan, seen from the start: velocities, accelerations, distance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BoundaryConditions {
    pub(crate) v0: f64,
    pub(crate) a0: f64,
    pub(crate) vf: f64,
    pub(crate) af: f64,
    /// Displacement wanted.
    pub(crate) distance: f64,
}

/// Durations of *up, hold, down, cruise, down, hold, up*, where up is positive jerk, or negative
/// where `mirrored`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Phases {
    pub(crate) t: [f64; 7],
    pub(crate) mirrored: bool,
}

impl Phases {
    pub(crate) fn duration(&self) -> f64 {
        self.t.iter().sum()
    }

    /// The jerk of each phase.
    pub(crate) fn jerks(&self, limits: &Limits) -> [f64; 7] {
        let (up, down) = if self.mirrored {
            (limits.j_min, limits.j_max)
        } else {
            (limits.j_max, limits.j_min)
        };
        [up, 0.0, down, 0.0, down, 0.0, up]
    }
}

/// Which accelerations are held at their limits along a region of the curve of plans.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Held {
    Neither,
    Upper,
    Lower,
    Both,
    Cruise,
}

/// A plan on the curve.
#[derive(Clone, Copy, Debug)]
struct Plan {
    t: [f64; 7],
    /// Acceleration after the first and before the last ramp.
    a1: f64,
    a2: f64,
}

impl Plan {
    fn duration(&self) -> f64 {
        self.t.iter().sum()
    }
}

/// A stretch of the curve: from `plan` on, parameter 0 to `extent`.
#[derive(Clone, Copy, Debug)]
struct Region {
    held: Held,
    plan: Plan,
    extent: f64,
    /// Duration at the beginning.
    time: f64,
}

/// The displacement of a plan, its derivative by duration, and the sum of the phases' lengths.
#[derive(Clone, Copy)]
struct Reach {
    d: f64,
    h: f64,
    length: f64,
}

const REGIONS: usize = 7;

/// A problem seen so that the greatest displacement is wanted and `W ≥ 0`.
#[derive(Clone, Copy)]
pub(crate) struct NormalisedProblem {
    v0: f64,
    a0: f64,
    vf: f64,
    af: f64,
    m: f64,
    n: f64,
    k: f64,
    j_up: f64,
    j_down: f64,
    /// Acceleration limits, both positive.
    upper: f64,
    lower: f64,
    v_max: f64,
    /// `W / k`.
    q: f64,
    /// What a single ramp from `a0` to `af` leaves to be gained.
    to_gain: f64,
    /// Whether the shortest plan has no first ramp up: down, hold, up.
    valley: bool,
    /// A difference of velocities that is taken for rounding.
    rounding: f64,
    /// Mean of the velocities at which the first and the last ramp, prolonged, have acceleration 0.
    c: f64,
    reversed: bool,
    mirrored: bool,
}

/// The curve of extremal plans for one direction.
pub(crate) struct Curve {
    normalised: NormalisedProblem,
    regions: [Region; REGIONS],
    len: usize,
    /// Index of the first region after the interval of durations that no plan has.
    after_blocked: Option<usize>,
}

/// A difference of velocities, relative to the limits, that is taken for rounding.
pub(crate) const VELOCITY_ROUNDING: f64 = 4e-15;

/// A difference of displacements, relative to the displacement, that is taken for rounding.
const DISPLACEMENT_ROUNDING: f64 = 1e-13;

/// Where a curve first passes a displacement.
pub(crate) enum Passage {
    Found(Phases),
    /// Not before the blocked interval: the first plan after it, and its displacement.
    BlockedInterval(Phases, f64),
}
