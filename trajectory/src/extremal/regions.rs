//! The regions of the curve of plans: within each the same accelerations are held, and displacement and duration
//! are polynomials, or nearly so, of one parameter that grows with the duration.

use super::{Held, NormalisedProblem, Plan, Reach, Region};

/// Rounds of Newton's method, secured by bisection, on a region's polynomial …
const MOST_ROUNDS: usize = 30;
/// … which end with a step that is smaller, relative: the plan itself is solved next.
const CLOSE: f64 = 1e-9;

impl NormalisedProblem {
    /// The plan at parameter `y` of a region that begins at `start`.
    #[inline]
    pub(super) fn plan(&self, held: Held, start: &Plan, y: f64) -> Plan {
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
    pub(super) fn spread(&self, plan: &Plan) -> f64 {
        if plan.a2 > 0.0 {
            plan.t[2] * self.j_down
        } else {
            plan.a1 - plan.a2
        }
    }

    /// How displacement and duration grow along a region that begins at `start` with `dD/dT = h`.
    #[inline]
    pub(super) fn growth(&self, held: Held, start: &Plan, h: f64) -> Growth {
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
    pub(super) fn parameter(&self, region: &Region, time: f64) -> f64 {
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
    pub(super) fn reach(&self, plan: &Plan) -> Reach {
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
}

/// `D` and `T` along a region as functions of its parameter `y`.
#[derive(Clone, Copy)]
pub(super) enum Growth {
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
    pub(super) fn at(&self, y: f64) -> (f64, f64) {
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
    pub(super) fn top(&self) -> Option<f64> {
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
    pub(super) fn pace(&self, y: f64) -> f64 {
        match *self {
            Growth::Free { pace, .. } => pace,
            Growth::Held { pace: [p0, p1], .. } => p0 + p1 * y,
        }
    }

    /// The parameter in 0 … `extent` at which the displacement has grown by `gain`, to about ten
    /// digits.
    pub(super) fn solve(&self, gain: f64, extent: f64) -> f64 {
        let (mut low, mut high) = (0.0, extent);
        let whole = self.at(extent).0;
        let ratio = gain / whole;
        let mut y = if ratio > 0.0 && ratio < 1.0 {
            extent * ratio.sqrt()
        } else {
            extent
        };
        for _ in 0..MOST_ROUNDS {
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
            if step <= CLOSE * y {
                break;
            }
        }
        y
    }
}

/// A walk along the plans with `a2 ≤ 0 ≤ a1`, region by region.
#[derive(Clone, Copy)]
pub(super) struct Crossing {
    pub(super) plan: Plan,
    /// What the peak velocity may still gain.
    pub(super) room: f64,
    pub(super) done: bool,
}

impl Crossing {
    pub(super) fn new(plan: Plan, room: f64) -> Self {
        Crossing {
            plan,
            room: room.max(0.0),
            done: false,
        }
    }

    /// The region that begins here and its extent; `None` where the peak velocity is the highest.
    pub(super) fn next(&self, f: &NormalisedProblem) -> Option<(Held, f64)> {
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
    pub(super) fn advance(&mut self, f: &NormalisedProblem, held: Held, extent: f64) {
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
