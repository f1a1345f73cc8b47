//! The extremal plans: for every duration the plan that gets furthest.
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
//! walked region by region (no hold, one, the other, both, cruise). By the envelope theorem
//! `dD/dT = H = v + a1·t3/2` at the end of the first hold, so `H` grows and `D` is convex wherever
//! `a2 ≤ 0 ≤ a1`: there the last passage of a displacement is the only one after any point
//! below it.
//! `W < 0` is the same motion backwards in time, so `W ≥ 0` is the only case solved.

use crate::limits::Limits;

/// What is between the ends of a plan, seen from the start: velocities, accelerations, distance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Problem {
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
    /// Duration and displacement at the beginning.
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
    rest: f64,
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

impl NormalisedProblem {
    pub(crate) fn new(problem: &Problem, limits: &Limits, mirrored: bool) -> Self {
        let (l, sign) = if mirrored {
            (limits.mirrored(), -1.0)
        } else {
            (*limits, 1.0)
        };
        let (j_up, j_down) = (l.j_max, -l.j_min);
        let (m, n) = (1.0 / j_up, 1.0 / j_down);
        let k = 0.5 * (m + n);
        let (mut v0, mut a0) = (sign * problem.v0, sign * problem.a0);
        let (mut vf, mut af) = (sign * problem.vf, sign * problem.af);
        let (mut upper, mut lower) = (l.a_max, -l.a_min);
        let w = (vf - v0) + 0.5 * m * (a0 - af) * (a0 + af);
        let rounding = VELOCITY_ROUNDING * (l.v_max - l.v_min);
        // To rounding the single ramp up is a plan of either normalised; it is found where the
        // accelerations are positive.
        let reversed = if w.abs() <= rounding {
            a0 + af < 0.0
        } else {
            w < 0.0
        };
        if reversed {
            (v0, vf) = (vf, v0);
            (a0, af) = (-af, -a0);
            (upper, lower) = (lower, upper);
        }
        let q = if w.abs() <= rounding {
            0.0
        } else {
            w.abs() / k
        };
        let ramp = if af >= a0 { m } else { -n };
        let rest = (vf - v0) - 0.5 * ramp * (af - a0) * (af + a0);
        NormalisedProblem {
            v0,
            a0,
            vf,
            af,
            m,
            n,
            k,
            j_up,
            j_down,
            upper,
            lower,
            v_max: l.v_max,
            q,
            rest: rest.max(0.0),
            valley: rest < -rounding && q < a0 * a0,
            rounding,
            c: 0.5 * ((v0 + vf) - 0.5 * m * (a0 * a0 + af * af)),
            reversed,
            mirrored,
        }
    }

    /// The first plan over `distance`, of which the shortest plan of all falls short; from the blocked interval on
    /// where there is one and no plan before it gets there.
    pub(crate) fn first_over(&self, distance: f64) -> Passage {
        let distance = self.signed(distance);
        let early = !self.valley && self.af > 0.0;
        if !early {
            return Passage::Found(self.cross_over(|| self.begin_crossing(), distance));
        }
        // Without a blocked interval and with mean velocity c ≥ 0, D grows with the duration until a2 = 0.
        if self.c >= 0.0 && (self.a0 <= 0.0 || self.q >= self.a0 * self.a0) {
            let level = self.level();
            if self.reach(&level.plan).d < distance {
                return Passage::Found(self.cross_over(|| level, distance));
            }
        }
        let begin = self.begin();
        for (held, plan, extent) in &begin.early[..begin.len] {
            if let Some(plan) = self.rise_over(*held, plan, *extent, distance) {
                return Passage::Found(self.phases(&plan));
            }
        }
        if begin.blocked {
            if let [.., (held, plan, extent)] = begin.early[..begin.len] {
                let plan = self.stretched(self.plan(held, &plan, extent), distance);
                let miss = distance - self.reach(&plan).d;
                if miss <= DISPLACEMENT_ROUNDING * distance.abs() {
                    return Passage::Found(self.phases(&plan));
                }
            }
            let plan = self.stretched(begin.crossing.plan, distance);
            return Passage::BlockedInterval(self.phases(&plan), self.signed(self.reach(&plan).d));
        }
        Passage::Found(self.cross_over(|| begin.crossing, distance))
    }

    /// A plan beside the blocked interval so much longer that it covers `distance`, where that changes the end
    /// velocity by rounding only: where `a2` is close to zero, rounding of the velocities moves the
    /// duration by much more.
    fn stretched(&self, mut plan: Plan, distance: f64) -> Plan {
        let turned = if self.af > 0.0 { self.m } else { -self.n };
        let v = self.vf - 0.5 * (turned * self.af * self.af - self.m * plan.a2 * plan.a2);
        let fall = (distance - self.reach(&plan).d) / (2.0 * self.k * v);
        let change = 2.0 * self.k * (plan.a2.abs() + fall.abs()) * fall.abs();
        if plan.t[5] == 0.0 && change <= 32.0 * self.rounding && plan.t[6] + self.m * fall >= 0.0 {
            plan.t[2] += self.n * fall;
            plan.t[6] += self.m * fall;
            plan.a2 -= fall;
        }
        plan
    }

    /// Where a curve begins that has `a2 ≤ 0` from the start.
    fn begin_crossing(&self) -> Crossing {
        if self.valley {
            self.after_valley()
        } else {
            self.after_peak()
        }
    }

    /// The first plan after the blocked interval over `distance`, of which the shortest after the blocked interval falls short.
    pub(crate) fn after_blocked_over(&self, distance: f64) -> Phases {
        self.cross_over(|| self.begin().crossing, self.signed(distance))
    }

    /// The plan with `a2 ≤ 0 ≤ a1` over `distance`. As `D` is convex there, it is the only one.
    fn cross_over(&self, begin: impl FnOnce() -> Crossing, distance: f64) -> Phases {
        let mut cruise = self.cruising();
        let d = self.reach(&cruise).d;
        if d <= distance {
            cruise.t[3] = (distance - d) / self.v_max;
            return self.phases(&cruise);
        }
        let mut crossing = begin();
        let mut at = self.reach(&crossing.plan);
        while let Some((held, extent)) = crossing.next(self) {
            let (gain, h) = self.growth(held, &crossing.plan, at.h).at(extent);
            let mut end = crossing;
            end.advance(self, held, extent);
            if at.d + gain >= distance || end.done {
                let plan = self.solve(held, &crossing.plan, extent, distance, at);
                return self.phases(&plan);
            }
            crossing = end;
            at.d += gain;
            at.h = h;
        }
        self.phases(&cruise)
    }

    /// The regions before the crossing, and where it begins.
    fn begin(&self) -> Begin {
        let NormalisedProblem {
            a0, af, m, n, k, q, ..
        } = *self;
        let none = (
            Held::Neither,
            Plan {
                t: [0.0; 7],
                a1: 0.0,
                a2: 0.0,
            },
            0.0,
        );
        let mut begin = Begin {
            early: [none; 2],
            len: 0,
            blocked: false,
            crossing: self.begin_crossing(),
        };
        if self.valley || af <= 0.0 {
            return begin;
        }
        let mut plan = self.peak();
        begin.blocked = q < a0 * a0 && a0 > 0.0;
        let valley = if begin.blocked {
            ((a0 - q.sqrt()) * (a0 + q.sqrt())).sqrt()
        } else {
            0.0
        };
        // Otherwise the single ramp itself, to rounding.
        if valley < af {
            if plan.t[1] > 0.0 {
                let released = plan.a2 * plan.a2 - self.upper * plan.t[1] / k;
                let a2 = if released > 0.0 { released.sqrt() } else { 0.0 };
                let fall = plan.a2 - a2;
                if fall > 0.0 {
                    begin.push(Held::Upper, plan, fall);
                    plan = self.plan(Held::Upper, &plan, fall);
                }
                if a2 > 0.0 {
                    plan.t[1] = 0.0;
                }
            }
            if plan.a2 > valley && plan.t[1] == 0.0 {
                let a1 = if begin.blocked {
                    a0
                } else {
                    q.sqrt().min(plan.a1)
                };
                let growth =
                    if begin.blocked { q / (a0 + valley) } else { a1 } - self.spread(&plan);
                if growth > 0.0 {
                    begin.push(Held::Neither, plan, growth);
                }
                plan.t[0] = (plan.t[0] + m * (a1 - plan.a1)).max(0.0);
                plan.t[2] = n * a1;
                plan.t[6] += m * (plan.a2 - valley);
                plan.a1 = a1;
            }
        }
        begin.crossing = if begin.blocked {
            self.after_valley()
        } else {
            plan.a2 = 0.0;
            Crossing::new(plan, self.v_max - (self.vf - 0.5 * m * af * af))
        };
        begin
    }

    /// The first plan of a region before the crossing over `distance`; there `D` may rise, fall and
    /// rise again.
    fn rise_over(&self, held: Held, plan: &Plan, extent: f64, distance: f64) -> Option<Plan> {
        let start = self.reach(plan);
        if let Some(top) = self.growth(held, plan, start.h).top()
            && top < extent
            && self.reach(&self.plan(held, plan, top)).d >= distance
        {
            return Some(self.solve(held, plan, top, distance, start));
        }
        let end = self.plan(held, plan, extent);
        let d = self.reach(&end).d;
        if d >= distance {
            Some(self.solve(held, plan, extent, distance, start))
        } else if d >= distance - DISPLACEMENT_ROUNDING * distance.abs() {
            Some(end)
        } else {
            None
        }
    }

    /// The shortest plan that reaches the highest velocity, in two parts for a cruise between.
    fn cruising(&self) -> Plan {
        let (a0, af, k) = (self.a0, self.af, self.k);
        // The square of the peak acceleration, and how far it is from `a` (≥ 0 towards the peak).
        let ramp = |v: f64, a: f64, limit: f64| {
            let turned = if a > 0.0 {
                v + 0.5 * self.n * a * a
            } else {
                v - 0.5 * self.m * a * a
            };
            let room = (self.v_max - turned).max(0.0) / k;
            let square = if a > 0.0 { a * a + room } else { room };
            let peak = square.sqrt();
            if peak > limit {
                (limit, limit - a, k * (square - limit * limit) / limit)
            } else if a > 0.0 {
                (peak, if room > 0.0 { room / (peak + a) } else { 0.0 }, 0.0)
            } else {
                (peak, peak - a, 0.0)
            }
        };
        let (a1, rise, t2) = ramp(self.v0, a0, self.upper);
        let (a2, fall, t6) = ramp(self.vf, -af, self.lower);
        let (m, n) = (self.m, self.n);
        Plan {
            t: [
                m * rise.max(0.0),
                t2,
                n * a1,
                0.0,
                n * a2,
                t6,
                m * fall.max(0.0),
            ],
            a1,
            a2: -a2,
        }
    }

    /// The plan of a curve that begins with `af > 0` at which `a2 = 0`.
    fn level(&self) -> Crossing {
        let (a0, q) = (self.a0, self.q);
        let (mut a1, mut t2) = (q.sqrt(), 0.0);
        if a1 > self.upper {
            a1 = self.upper;
            t2 = self.k * (q - a1 * a1) / a1;
        }
        let t = [
            (a1 - a0).max(0.0) * self.m,
            t2,
            a1 * self.n,
            0.0,
            0.0,
            0.0,
            self.af * self.m,
        ];
        let v_peak = self.vf - 0.5 * self.m * self.af * self.af;
        Crossing::new(Plan { t, a1, a2: 0.0 }, self.v_max - v_peak)
    }

    /// From the plan without a first ramp (down, hold, up) on.
    fn after_valley(&self) -> Crossing {
        let (a0, k, root) = (self.a0, self.k, self.q.sqrt());
        let mut valley = ((a0 - root) * (a0 + root)).max(0.0).sqrt();
        let mut t6 = 0.0;
        if valley > self.lower {
            t6 = k * (valley - self.lower) * (valley + self.lower) / self.lower;
            valley = self.lower;
        }
        let (down, up) = ((a0 + valley) * self.n, (self.af + valley).max(0.0) * self.m);
        let plan = Plan {
            t: [0.0, 0.0, down, 0.0, 0.0, t6, up],
            a1: a0,
            a2: -valley,
        };
        Crossing::new(plan, self.v_max - (self.v0 + 0.5 * self.n * a0 * a0))
    }

    /// From the plan without a last ramp (up, hold, down) on, where it ends with `af ≤ 0`.
    fn after_peak(&self) -> Crossing {
        Crossing::new(
            self.peak(),
            self.v_max - (self.vf + 0.5 * self.n * self.af * self.af),
        )
    }

    /// The plan without a last ramp: up, hold, down to `af`.
    fn peak(&self) -> Plan {
        let NormalisedProblem {
            a0, af, k, rest, ..
        } = *self;
        let base = a0.max(af);
        let extra = rest / k;
        let root = (base * base + extra).sqrt();
        let mut above = if base > 0.0 {
            extra / (base + root)
        } else {
            root - base
        };
        let mut t2 = 0.0;
        let mut a1 = base + above;
        if a1 > self.upper {
            above = (self.upper - base).max(0.0);
            t2 = (rest - k * above * (above + 2.0 * base)).max(0.0) / self.upper;
            a1 = self.upper;
        }
        let (up, down) = if a0 >= af {
            (above, above + (a0 - af))
        } else {
            (above + (af - a0), above)
        };
        Plan {
            t: [up * self.m, t2, down * self.n, 0.0, 0.0, 0.0, 0.0],
            a1,
            a2: af,
        }
    }

    /// The plan at parameter `y` of a region that begins at `start`.
    #[inline]
    fn plan(&self, held: Held, start: &Plan, y: f64) -> Plan {
        let (m, n, k) = (self.m, self.n, self.k);
        let mut p = *start;
        match held {
            // y = growth of a1 − a2 along a1² − a2² = const.
            Held::Neither => {
                let u = self.spread(start) + y;
                let skew = if y > 0.0 {
                    (start.a1 + start.a2) / u
                } else {
                    0.0
                };
                let fall = 0.5 * y * (1.0 + skew);
                let rise = 0.5 * y * (1.0 - skew);
                p.t[0] = (p.t[0] + m * rise).max(0.0);
                p.t[2] += n * y;
                p.t[6] += m * fall;
                p.a1 += rise;
                p.a2 -= fall;
            }
            // y = fall of a2.
            Held::Upper => {
                p.t[1] = (p.t[1] + k * y * (y - 2.0 * start.a2) / self.upper).max(0.0);
                p.t[2] += n * y;
                p.t[6] += m * y;
                p.a2 -= y;
            }
            // y = rise of a1.
            Held::Lower => {
                p.t[0] += m * y;
                p.t[2] += n * y;
                p.t[5] += k * y * (y + 2.0 * start.a1) / self.lower;
                p.a1 += y;
            }
            // y = rise of the peak velocity.
            Held::Both => {
                p.t[1] += y / self.upper;
                p.t[5] += y / self.lower;
            }
            // y = duration of the cruise.
            Held::Cruise => p.t[3] += y,
        }
        p
    }

    /// `a1 − a2` of a plan without holds. Beside a single ramp both are equal to rounding; the ramp
    /// between them keeps its digits.
    #[inline]
    fn spread(&self, plan: &Plan) -> f64 {
        if plan.a2 > 0.0 {
            plan.t[2] * self.j_down
        } else {
            plan.a1 - plan.a2
        }
    }

    /// How displacement and duration grow along a region that begins at `start` with `dD/dT = h`.
    #[inline]
    fn growth(&self, held: Held, start: &Plan, h: f64) -> Growth {
        let NormalisedProblem {
            m,
            n,
            k,
            upper,
            lower,
            ..
        } = *self;
        let (a1, a2) = (start.a1, start.a2);
        match held {
            Held::Neither => {
                let u = self.spread(start);
                let q = u * (a1 + a2);
                Growth::Free {
                    u,
                    pace: 2.0 * k,
                    a: 0.125 * (m + 2.0 * n),
                    b: self.c,
                    c: 0.125 * m * q * q,
                }
            }
            Held::Upper => Growth::Held {
                h: [h, 0.5 * upper * n - 2.0 * k * a2, k],
                pace: [2.0 * k * (1.0 - a2 / upper), 2.0 * k / upper],
            },
            Held::Lower => Growth::Held {
                h: [h, m * a1 + 0.5 * (start.t[2] + n * a1), k],
                pace: [2.0 * k * (1.0 + a1 / lower), 2.0 * k / lower],
            },
            Held::Both => Growth::Held {
                h: [h, 1.0, 0.0],
                pace: [1.0 / upper + 1.0 / lower, 0.0],
            },
            Held::Cruise => Growth::Held {
                h: [self.v_max, 0.0, 0.0],
                pace: [1.0, 0.0],
            },
        }
    }

    /// The parameter at which a region's duration has grown by `time`.
    fn parameter(&self, region: &Region, time: f64) -> f64 {
        let k = self.k;
        let y = match region.held {
            Held::Neither => time / (2.0 * k),
            Held::Upper => {
                let b = k * (1.0 - region.plan.a2 / self.upper);
                time / (b + (b * b + k * time / self.upper).max(0.0).sqrt())
            }
            Held::Lower => {
                let b = k * (1.0 + region.plan.a1 / self.lower);
                time / (b + (b * b + k * time / self.lower).max(0.0).sqrt())
            }
            Held::Both => time / (1.0 / self.upper + 1.0 / self.lower),
            Held::Cruise => time,
        };
        if y > 0.0 { y.min(region.extent) } else { 0.0 }
    }

    #[inline]
    fn reach(&self, plan: &Plan) -> Reach {
        let t = &plan.t;
        let (mut v, mut a) = (self.v0, self.a0);
        let mut d = 0.0;
        let mut length = 0.0;
        let mut phase = |t: f64, a0: Option<f64>, j: f64| {
            a = a0.unwrap_or(a);
            let jt = j * t;
            let step = t * (v + t * (0.5 * a + (1.0 / 6.0) * jt));
            v += t * (a + 0.5 * jt);
            a += jt;
            d += step;
            length += step.abs();
            v
        };
        phase(t[0], None, self.j_up);
        let v1 = phase(t[1], None, 0.0);
        phase(t[2], None, -self.j_down);
        if t[3] > 0.0 || t[4] > 0.0 {
            phase(t[3], Some(0.0), 0.0);
            phase(t[4], None, -self.j_down);
        }
        phase(t[5], None, 0.0);
        phase(t[6], None, self.j_up);
        Reach {
            d,
            h: v1 + 0.5 * plan.a1 * t[2],
            length,
        }
    }

    fn phases(&self, plan: &Plan) -> Phases {
        let mut t = plan.t;
        if t[3] == 0.0 {
            t[2] += t[4];
            t[4] = 0.0;
        }
        if self.reversed {
            t.reverse();
        }
        Phases {
            t,
            mirrored: self.mirrored,
        }
    }

    fn signed(&self, d: f64) -> f64 {
        if self.mirrored { -d } else { d }
    }

    /// The plan of a region at which `D` rises over `distance`: Newton's method, first on the
    /// polynomial that `D` is there, then on the plan itself.
    fn solve(&self, held: Held, start: &Plan, extent: f64, distance: f64, at: Reach) -> Plan {
        let growth = self.growth(held, start, at.h);
        let mut y = growth.solve(distance - at.d, extent);
        let (mut low, mut high) = (0.0, extent);
        let mut plan = self.plan(held, start, y);
        for round in 0..100 {
            let reach = self.reach(&plan);
            let over = reach.d - distance;
            let step = over / (reach.h * growth.pace(y));
            // Where the phases' own rounding is more than that, do not chase it.
            if over.abs() <= f64::from(2 + 6 * round) * f64::EPSILON * reach.length
                || round > 0 && step.abs() <= 64.0 * f64::EPSILON * y
            {
                break;
            }
            if over > 0.0 {
                high = y;
            } else {
                low = y;
            }
            let mut next = y - step;
            // A small step out of the bracket is rounding too; a large one is not Newton's to take.
            let last = step.abs() <= 1e-12 * extent;
            let inside = next > low && next < high;
            if !(inside || last) {
                next = 0.5 * (low + high);
                if !(next > low && next < high) {
                    break;
                }
            }
            y = next.clamp(0.0, extent);
            plan = self.plan(held, start, y);
            if last {
                break;
            }
        }
        plan
    }
}

/// `D` and `T` along a region as functions of its parameter `y`.
#[derive(Clone, Copy)]
enum Growth {
    /// `dD/dT = a u² + b + c/u²`, where `u = a1 − a2` has grown by `y`; `dT/dy = pace`.
    Free {
        u: f64,
        pace: f64,
        a: f64,
        b: f64,
        c: f64,
    },
    /// `dD/dT` a quadratic and `dT/dy` a linear function of `y`.
    Held { h: [f64; 3], pace: [f64; 2] },
}

impl Growth {
    /// The displacement gained since `y = 0`, and `dD/dT`.
    #[inline]
    fn at(&self, y: f64) -> (f64, f64) {
        match *self {
            Growth::Free {
                u: u0,
                pace,
                a,
                b,
                c,
            } => {
                let u = u0 + y;
                let (part, slope) = if c > 0.0 {
                    (c / (u0 * u), c / (u * u))
                } else {
                    (0.0, 0.0)
                };
                let cube = u0 * u0 + (u0 + y * (1.0 / 3.0)) * y;
                (pace * y * (a * cube + b + part), a * u * u + b + slope)
            }
            Growth::Held {
                h: [h0, h1, h2],
                pace: [p0, p1],
            } => {
                let second = 0.5 * (h1 * p0 + h0 * p1);
                let third = (h2 * p0 + h1 * p1) * (1.0 / 3.0);
                let gain = y * (h0 * p0 + y * (second + y * (third + y * 0.25 * h2 * p1)));
                (gain, h0 + y * (h1 + y * h2))
            }
        }
    }

    /// Where the displacement is greatest before it falls, if it does: the first zero of `dD/dT`,
    /// which is a parabola or, in `u²`, one over `u²`.
    fn top(&self) -> Option<f64> {
        let first_zero = |a: f64, b: f64, c: f64| {
            let discriminant = b * b - 4.0 * a * c;
            (b < 0.0 && c > 0.0 && discriminant > 0.0).then(|| 2.0 * c / (discriminant.sqrt() - b))
        };
        match *self {
            Growth::Free { u, a, b, c, .. } => first_zero(a, b, c).map(|square| square.sqrt() - u),
            Growth::Held {
                h: [h0, h1, h2], ..
            } => first_zero(h2, h1, h0),
        }
        .filter(|&y| y > 0.0)
    }

    /// dT/dy.
    #[inline]
    fn pace(&self, y: f64) -> f64 {
        match *self {
            Growth::Free { pace, .. } => pace,
            Growth::Held { pace: [p0, p1], .. } => p0 + p1 * y,
        }
    }

    /// The parameter in 0 … `extent` at which the displacement has grown by `gain`, to about ten
    /// digits.
    fn solve(&self, gain: f64, extent: f64) -> f64 {
        let (mut low, mut high) = (0.0, extent);
        let whole = self.at(extent).0;
        let ratio = gain / whole;
        let mut y = if ratio > 0.0 && ratio < 1.0 {
            extent * ratio.sqrt()
        } else {
            extent
        };
        for _ in 0..30 {
            let (d, h) = self.at(y);
            let over = d - gain;
            if over > 0.0 {
                high = y;
            } else {
                low = y;
            }
            let mut next = y - over / (h * self.pace(y));
            if !(next > low && next < high) {
                next = 0.5 * (low + high);
            }
            let step = (next - y).abs();
            y = next;
            if step <= 1e-9 * y {
                break;
            }
        }
        y
    }
}

/// Where a curve first passes a displacement.
pub(crate) enum Passage {
    Found(Phases),
    /// Not before the blocked interval: the first plan after it, and its displacement.
    BlockedInterval(Phases, f64),
}

/// The beginning of a curve.
struct Begin {
    /// Regions with `a2 > 0`: what is held, the first plan, the extent.
    early: [(Held, Plan, f64); 2],
    len: usize,
    /// Whether durations follow that no plan has.
    blocked: bool,
    crossing: Crossing,
}

impl Begin {
    fn push(&mut self, held: Held, plan: Plan, extent: f64) {
        self.early[self.len] = (held, plan, extent);
        self.len += 1;
    }
}

/// A walk along the plans with `a2 ≤ 0 ≤ a1`, region by region.
#[derive(Clone, Copy)]
struct Crossing {
    plan: Plan,
    /// What the peak velocity may still gain.
    room: f64,
    done: bool,
}

impl Crossing {
    fn new(plan: Plan, room: f64) -> Self {
        Crossing {
            plan,
            room: room.max(0.0),
            done: false,
        }
    }

    /// The region that begins here and its extent; `None` where the peak velocity is the highest.
    fn next(&self, f: &NormalisedProblem) -> Option<(Held, f64)> {
        if self.done {
            return None;
        }
        let (a1, a2) = (self.plan.a1, self.plan.a2);
        let up = (f.upper - a1) * (f.upper + a1);
        let down = (f.lower + a2) * (f.lower - a2);
        let room = self.room / f.k;
        // A parameter that moves by the growth of a square.
        let rise = |a: f64, square: f64| {
            if square > 0.0 {
                square / (a + (a * a + square).sqrt())
            } else {
                0.0
            }
        };
        Some(match (up <= 0.0, down <= 0.0) {
            (false, false) => {
                let square = up.min(down).min(room);
                (Held::Neither, rise(a1, square) + rise(-a2, square))
            }
            (true, false) => (Held::Upper, rise(-a2, down.min(room))),
            (false, true) => (Held::Lower, rise(a1, up.min(room))),
            (true, true) => (Held::Both, self.room),
        })
    }

    /// Goes on to the end of the region.
    fn advance(&mut self, f: &NormalisedProblem, held: Held, extent: f64) {
        let (a1, a2) = (self.plan.a1, self.plan.a2);
        let up = (f.upper - a1) * (f.upper + a1);
        let down = (f.lower + a2) * (f.lower - a2);
        if extent > 0.0 {
            self.plan = f.plan(held, &self.plan, extent);
        }
        let square = match held {
            Held::Neither => up.min(down),
            Held::Upper => down,
            Held::Lower => up,
            Held::Both | Held::Cruise => f64::INFINITY,
        };
        self.done = f.k * square >= self.room;
        if self.done {
            self.room = 0.0;
            return;
        }
        self.room -= f.k * square;
        if matches!(held, Held::Neither | Held::Lower) && up <= square {
            self.plan.a1 = f.upper;
        }
        if matches!(held, Held::Neither | Held::Upper) && down <= square {
            self.plan.a2 = -f.lower;
        }
    }
}

impl Curve {
    /// The curve of greatest displacements, or of smallest ones where `mirrored`.
    pub(crate) fn new(problem: &Problem, limits: &Limits, mirrored: bool) -> Self {
        let normalised = NormalisedProblem::new(problem, limits, mirrored);
        let plan = Plan {
            t: [0.0; 7],
            a1: 0.0,
            a2: 0.0,
        };
        let region = Region {
            held: Held::Neither,
            plan,
            extent: 0.0,
            time: 0.0,
        };
        let mut curve = Curve {
            normalised,
            regions: [region; REGIONS],
            len: 0,
            after_blocked: None,
        };
        let begin = curve.normalised.begin();
        for &(held, plan, extent) in &begin.early[..begin.len] {
            curve.push(Region {
                held,
                plan,
                extent,
                time: plan.duration(),
            });
        }
        if begin.blocked {
            curve.after_blocked = Some(curve.len);
        }
        curve.cross(begin.crossing);
        curve
    }

    fn cross(&mut self, mut crossing: Crossing) {
        while let Some((held, extent)) = crossing.next(&self.normalised) {
            if extent > 0.0 {
                let (plan, time) = (crossing.plan, crossing.plan.duration());
                self.push(Region {
                    held,
                    plan,
                    extent,
                    time,
                });
            }
            crossing.advance(&self.normalised, held, extent);
        }
        // From here on both ends of the cruise are ramps of their own.
        let mut plan = crossing.plan;
        let whole = plan.t[2];
        plan.t[4] = (-plan.a2 * self.normalised.n).min(whole);
        plan.t[2] = whole - plan.t[4];
        let time = plan.duration();
        self.push(Region {
            held: Held::Cruise,
            plan,
            extent: f64::INFINITY,
            time,
        });
    }

    fn push(&mut self, region: Region) {
        self.regions[self.len] = region;
        self.len += 1;
    }

    fn regions(&self) -> &[Region] {
        &self.regions[..self.len]
    }

    /// The shortest plan of the curve: the fastest change of velocity and acceleration alone.
    pub(crate) fn first(&self) -> (Phases, f64) {
        let plan = &self.regions[0].plan;
        (
            self.normalised.phases(plan),
            self.normalised.signed(self.normalised.reach(plan).d),
        )
    }

    /// The first plan after the blocked interval, where there is one.
    pub(crate) fn first_after_blocked(&self) -> Option<(Phases, f64)> {
        let plan = &self.regions[self.after_blocked?].plan;
        Some((
            self.normalised.phases(plan),
            self.normalised.signed(self.normalised.reach(plan).d),
        ))
    }

    /// The first plan over `distance` that lasts longer than `time`, where the plan of that duration
    /// falls short of it; `None` where there is none before the problem.
    pub(crate) fn next_over(&self, distance: f64, time: f64) -> Option<Phases> {
        let distance = self.normalised.signed(distance);
        let mut index = self.index_at(time)?;
        let mut first = self.regions[index];
        let skip = self.normalised.parameter(&first, time - first.time);
        if skip > 0.0 {
            first.plan = self.normalised.plan(first.held, &first.plan, skip);
            first.extent -= skip;
        }
        let crossing = self.crossing();
        while index < crossing {
            let Region {
                held, plan, extent, ..
            } = &first;
            if let Some(plan) = self.normalised.rise_over(*held, plan, *extent, distance) {
                return Some(self.normalised.phases(&plan));
            }
            index += 1;
            if self.after_blocked == Some(index) {
                return None;
            }
            first = self.regions[index];
        }
        // From here on D is convex: the last region that begins below holds the only passage.
        for i in (index..self.len).rev() {
            let region = if i == index { first } else { self.regions[i] };
            let reach = self.normalised.reach(&region.plan);
            if reach.d <= distance || i == index {
                let plan = self.solve(&region, distance, reach);
                return Some(self.normalised.phases(&plan));
            }
        }
        None
    }

    fn solve(&self, region: &Region, distance: f64, at: Reach) -> Plan {
        if region.held == Held::Cruise {
            let y = ((distance - at.d) / self.normalised.v_max).max(0.0);
            return self.normalised.plan(region.held, &region.plan, y);
        }
        self.normalised
            .solve(region.held, &region.plan, region.extent, distance, at)
    }

    /// Index of the first region with `a2 ≤ 0 ≤ a1` throughout.
    fn crossing(&self) -> usize {
        if let Some(i) = self.after_blocked {
            return i;
        }
        self.regions()
            .iter()
            .position(|r| r.plan.a2 <= 0.0)
            .unwrap_or(self.len)
    }

    /// The plan of duration `time`, with its displacement; `None` where no plan lasts so long.
    pub(crate) fn at(&self, time: f64) -> Option<(Phases, f64)> {
        let index = self.index_at(time)?;
        let region = &self.regions[index];
        let y = self.normalised.parameter(region, time - region.time);
        let plan = self.normalised.plan(region.held, &region.plan, y);
        Some((
            self.normalised.phases(&plan),
            self.normalised.signed(self.normalised.reach(&plan).d),
        ))
    }

    fn index_at(&self, time: f64) -> Option<usize> {
        let time = time * (1.0 + 4.0 * f64::EPSILON);
        let index = self.regions().iter().rposition(|r| r.time <= time)?;
        let region = &self.regions[index];
        if self.after_blocked == Some(index + 1) {
            let end = self
                .normalised
                .plan(region.held, &region.plan, region.extent)
                .duration();
            if time > end {
                return None;
            }
        }
        Some(index)
    }
}

/// The fastest change of velocity and acceleration, regardless of the position.
pub(crate) fn fastest_change(v0: f64, a0: f64, vf: f64, af: f64, limits: &Limits) -> Change {
    let base_down = af < a0;
    let ramp = 0.5 * (af - a0) * (af + a0)
        / if base_down {
            limits.j_min
        } else {
            limits.j_max
        };
    let rest = (vf - v0) - ramp;
    if rest.abs() <= VELOCITY_ROUNDING * (limits.v_max - limits.v_min) {
        let jerk = if base_down {
            limits.j_min
        } else {
            limits.j_max
        };
        return Change {
            t: [(af - a0) / jerk, 0.0, 0.0],
            j: [jerk, 0.0, -jerk],
        };
    }
    // Seen with the axis's direction such that more has to be gained.
    let s = 1.0_f64.copysign(rest);
    let (a0, af, rest) = (s * a0, s * af, s * rest);
    let (j_up, j_down, top) = if s > 0.0 {
        (limits.j_max, -limits.j_min, limits.a_max)
    } else {
        (-limits.j_min, limits.j_max, -limits.a_min)
    };
    let (m, n) = (1.0 / j_up, 1.0 / j_down);
    let k = 0.5 * (m + n);
    let base = a0.max(af);
    let extra = rest / k;
    let root = (base * base + extra).sqrt();
    let mut above = if base > 0.0 {
        extra / (base + root)
    } else {
        root - base
    };
    let mut hold = 0.0;
    if base + above > top {
        above = (top - base).max(0.0);
        hold = (rest - k * above * (above + 2.0 * base)).max(0.0) / top;
    }
    let (up, down) = if a0 >= af {
        (above, above + (a0 - af))
    } else {
        (above + (af - a0), above)
    };
    Change {
        t: [up * m, hold, down * n],
        j: [s * j_up, 0.0, -s * j_down],
    }
}

/// A change of velocity and acceleration in three phases.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Change {
    pub(crate) t: [f64; 3],
    pub(crate) j: [f64; 3],
}

impl Change {
    /// The same as phases of an extremal plan.
    pub(crate) fn phases(&self) -> Phases {
        let [up, hold, down] = self.t;
        Phases {
            t: [up, hold, down, 0.0, 0.0, 0.0, 0.0],
            mirrored: self.j[0] < 0.0,
        }
    }

    pub(crate) fn duration(&self) -> f64 {
        self.t[0] + self.t[1] + self.t[2]
    }

    /// The path travelled.
    pub(crate) fn path(&self, v0: f64, a0: f64) -> f64 {
        let (mut path, mut v, mut a) = (0.0, v0, a0);
        for (t, j) in self.t.into_iter().zip(self.j) {
            let begin = crate::profile::State { p: 0.0, v, a };
            let mut last = 0.0;
            let mut turns = crate::profile::zeros(v, a, 0.5 * j);
            turns.sort_unstable_by(f64::total_cmp);
            for turn in turns.into_iter().chain([t]) {
                if turn > 0.0 && turn <= t {
                    let p = begin.displacement(turn, j);
                    path += (p - last).abs();
                    last = p;
                }
            }
            let end = begin.after(t, j);
            (v, a) = (end.v, end.a);
        }
        path
    }

    pub(crate) fn displacement(&self, v0: f64, a0: f64) -> f64 {
        let mut state = crate::profile::State {
            p: 0.0,
            v: v0,
            a: a0,
        };
        for (t, j) in self.t.into_iter().zip(self.j) {
            state = state.after(t, j);
        }
        state.p
    }
}
