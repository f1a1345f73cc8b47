//! The plans at which regions of the curve begin and end, each in closed form.

use super::change::Rise;
use super::regions::Crossing;
use super::{NormalisedProblem, Plan};

impl NormalisedProblem {
    /// The shortest plan that reaches the highest velocity, in two parts for a cruise between.
    pub(super) fn cruising(&self) -> Plan {
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
    pub(super) fn level(&self) -> Crossing {
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
    pub(super) fn after_valley(&self) -> Crossing {
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
    pub(super) fn after_peak(&self) -> Crossing {
        Crossing::new(
            self.peak(),
            self.v_max - (self.vf + 0.5 * self.n * self.af * self.af),
        )
    }

    /// The plan without a last ramp: up, hold, down to `af`.
    pub(super) fn peak(&self) -> Plan {
        let NormalisedProblem {
            a0, af, k, to_gain, ..
        } = *self;
        let Rise {
            up,
            hold,
            down,
            peak,
        } = Rise::new([a0, af], k, to_gain, self.upper);
        Plan {
            t: [up * self.m, hold, down * self.n, 0.0, 0.0, 0.0, 0.0],
            a1: peak,
            a2: af,
        }
    }
}
