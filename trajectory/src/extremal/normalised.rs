//! A problem seen so that the greatest displacement is wanted and `W ≥ 0`, and its solution: on which region of
//! the curve the distance is passed first, and where on that.

use super::regions::Crossing;
use super::{
    BoundaryConditions, DISPLACEMENT_ROUNDING, Held, NormalisedProblem, Passage, Phases, Plan,
    REGIONS, Reach, VELOCITY_ROUNDING,
};
use crate::limits::Limits;

/// By how many roundings of a velocity a plan beside the blocked interval may be stretched.
const STRETCH: f64 = 32.0;
/// Rounds of Newton's method, secured by bisection; each is content with a larger miss than the one before.
const MOST_ROUNDS: u32 = 100;
/// A miss of so many roundings of the phases' lengths is none in the first round; one of so many more in
/// each later one, so that nobody chases rounding.
const ROUNDINGS: u32 = 2;
const MORE_ROUNDINGS: u32 = 6;
/// A step that is smaller, relative to the parameter, does not move it any more …
const STEP_ROUNDING: f64 = 64.0 * f64::EPSILON;
/// … and one that is smaller, relative to the region, is the last.
const LAST_STEP: f64 = 1e-12;

impl NormalisedProblem {
    pub(crate) fn new(conditions: &BoundaryConditions, limits: &Limits, mirrored: bool) -> Self {
        let (l, sign) = if mirrored {
            (limits.mirrored(), -1.0)
        } else {
            (*limits, 1.0)
        };
        let (j_up, j_down) = (l.j_max, -l.j_min);
        let (m, n) = (1.0 / j_up, 1.0 / j_down);
        let k = 0.5 * (m + n);
        let (mut v0, mut a0) = (sign * conditions.v0, sign * conditions.a0);
        let (mut vf, mut af) = (sign * conditions.vf, sign * conditions.af);
        let (mut upper, mut lower) = (l.a_max, -l.a_min);
        let w = (vf - v0) + 0.5 * m * (a0 - af) * (a0 + af);
        let rounding = VELOCITY_ROUNDING * (l.v_max - l.v_min);
        // To rounding the single ramp up is a plan seen either way round; it is found where the
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
        let to_gain = (vf - v0) - 0.5 * ramp * (af - a0) * (af + a0);
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
            to_gain: to_gain.max(0.0),
            valley: to_gain < -rounding && q < a0 * a0,
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
    pub(super) fn stretched(&self, mut plan: Plan, distance: f64) -> Plan {
        let turned = if self.af > 0.0 { self.m } else { -self.n };
        let v = self.vf - 0.5 * (turned * self.af * self.af - self.m * plan.a2 * plan.a2);
        let fall = (distance - self.reach(&plan).d) / (2.0 * self.k * v);
        let change = 2.0 * self.k * (plan.a2.abs() + fall.abs()) * fall.abs();
        if plan.t[5] == 0.0 && change <= STRETCH * self.rounding && plan.t[6] + self.m * fall >= 0.0
        {
            plan.t[2] += self.n * fall;
            plan.t[6] += self.m * fall;
            plan.a2 -= fall;
        }
        plan
    }

    /// Where a curve begins that has `a2 ≤ 0` from the start.
    pub(super) fn begin_crossing(&self) -> Crossing {
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
    pub(super) fn cross_over(&self, begin: impl FnOnce() -> Crossing, distance: f64) -> Phases {
        let mut cruise = self.cruising();
        let d = self.reach(&cruise).d;
        if d <= distance {
            cruise.t[3] = (distance - d) / self.v_max;
            return self.phases(&cruise);
        }
        let mut crossing = begin();
        let mut at = self.reach(&crossing.plan);
        for _ in 0..REGIONS {
            let Some((held, extent)) = crossing.next(self) else {
                break;
            };
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
    pub(super) fn begin(&self) -> Begin {
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
    pub(super) fn rise_over(
        &self,
        held: Held,
        plan: &Plan,
        extent: f64,
        distance: f64,
    ) -> Option<Plan> {
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

    /// The plan of a region at which `D` rises over `distance`: Newton's method, first on the
    /// polynomial that `D` is there, then on the plan itself.
    pub(super) fn solve(
        &self,
        held: Held,
        start: &Plan,
        extent: f64,
        distance: f64,
        at: Reach,
    ) -> Plan {
        let growth = self.growth(held, start, at.h);
        let mut y = growth.solve(distance - at.d, extent);
        let (mut low, mut high) = (0.0, extent);
        let mut plan = self.plan(held, start, y);
        for round in 0..MOST_ROUNDS {
            let reach = self.reach(&plan);
            let over = reach.d - distance;
            let step = over / (reach.h * growth.pace(y));
            // Where the phases' own rounding is more than that, do not chase it.
            if over.abs()
                <= f64::from(ROUNDINGS + MORE_ROUNDINGS * round) * f64::EPSILON * reach.length
                || round > 0 && step.abs() <= STEP_ROUNDING * y
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
            let last = step.abs() <= LAST_STEP * extent;
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

    pub(super) fn phases(&self, plan: &Plan) -> Phases {
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

    pub(super) fn signed(&self, d: f64) -> f64 {
        if self.mirrored { -d } else { d }
    }
}

/// The beginning of a curve.
pub(super) struct Begin {
    /// Regions with `a2 > 0`: what is held, the first plan, the extent.
    pub(super) early: [(Held, Plan, f64); 2],
    pub(super) len: usize,
    /// Whether durations follow that no plan has.
    pub(super) blocked: bool,
    pub(super) crossing: Crossing,
}

impl Begin {
    fn push(&mut self, held: Held, plan: Plan, extent: f64) {
        self.early[self.len] = (held, plan, extent);
        self.len += 1;
    }
}
