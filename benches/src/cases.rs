//! Random planning problems for one axis, in twelve classes; the same seed gives the same problems.

use syncline_trajectory::limits::Limits;
use syncline_trajectory::profile::State;
use syncline_trajectory::state_to_state::{Problem, plan};

/// A problem for one axis.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    /// Where the axis is.
    pub start: State,
    /// Where it is to be.
    pub target: State,
    /// What it keeps.
    pub limits: Limits,
}

/// The kinds of problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// Both ends at rest.
    RestToRest,
    /// Any start, any target.
    Generic,
    /// From rest to a moving target.
    TargetVelocity,
    /// From rest to a target with velocity and acceleration.
    TargetAcceleration,
    /// Ends on a limit, or bound to touch it.
    AtLimits,
    /// Starts beyond a limit.
    OutsideLimits,
    /// Distances of 1e-9 … 1e-6.
    Tiny,
    /// Distances of 1e6.
    Huge,
    /// Jerk limits from 1e-3 to 1e8 times the others.
    JerkRange,
    /// Limits that differ by direction.
    Asymmetric,
    /// Some limit close to zero.
    NearZeroLimits,
    /// Starts on a plan to the same target.
    Sampled,
}

impl Class {
    /// All of them.
    pub const ALL: [Class; 12] = [
        Class::RestToRest,
        Class::Generic,
        Class::TargetVelocity,
        Class::TargetAcceleration,
        Class::AtLimits,
        Class::OutsideLimits,
        Class::Tiny,
        Class::Huge,
        Class::JerkRange,
        Class::Asymmetric,
        Class::NearZeroLimits,
        Class::Sampled,
    ];

    /// Draws a problem.
    pub fn draw(self, rng: &mut Rng) -> Case {
        let mut limits =
            Limits::symmetric(rng.log(0.1, 10.0), rng.log(0.1, 10.0), rng.log(0.1, 10.0));
        let distance = rng.log(1e-3, 1e3) * rng.sign();
        let mut case = Case {
            start: State::default(),
            target: State::default(),
            limits,
        };
        let place = |case: &mut Case, distance: f64, rng: &mut Rng| {
            case.start.p = rng.uniform(-10.0, 10.0);
            case.target.p = case.start.p + distance;
        };
        let moving_target = |case: &mut Case, rng: &mut Rng, a: f64| {
            let s = inside(&backwards(&case.limits), rng, a);
            (case.target.v, case.target.a) = (s.v, -s.a);
        };
        match self {
            Class::RestToRest => {}
            Class::Generic | Class::Sampled => {
                case.start = inside(&limits, rng, 1.0);
                moving_target(&mut case, rng, 1.0);
            }
            Class::TargetVelocity => moving_target(&mut case, rng, 0.0),
            Class::TargetAcceleration => moving_target(&mut case, rng, 1.0),
            Class::AtLimits => {
                case.start = on_limit(&limits, rng);
                let s = on_limit(&backwards(&limits), rng);
                (case.target.v, case.target.a) = (s.v, -s.a);
            }
            Class::OutsideLimits => {
                case.start.v = rng.uniform(-3.0, 3.0) * limits.v_max;
                case.start.a = rng.uniform(-3.0, 3.0) * limits.a_max;
                moving_target(&mut case, rng, 1.0);
            }
            Class::Tiny => {
                if rng.chance(0.5) {
                    let small = rng.log(1e-6, 1.0);
                    case.start = inside(&limits, rng, 1.0);
                    moving_target(&mut case, rng, 1.0);
                    case.start.v *= small;
                    case.start.a *= small;
                    case.target.v *= small;
                    case.target.a *= small;
                }
                place(&mut case, rng.log(1e-9, 1e-6) * rng.sign(), rng);
                return case;
            }
            Class::Huge => {
                case.start = inside(&limits, rng, 1.0);
                moving_target(&mut case, rng, 1.0);
                place(&mut case, rng.uniform(-1e6, 1e6), rng);
                return case;
            }
            Class::JerkRange => {
                let j = rng.log(1e-3, 1e8);
                limits.j_max = j;
                limits.j_min = -j;
                case.limits = limits;
                case.start = inside(&limits, rng, 1.0);
                moving_target(&mut case, rng, 1.0);
            }
            Class::Asymmetric => {
                limits.v_min = -rng.log(0.1, 10.0);
                limits.a_min = -rng.log(0.1, 10.0);
                case.limits = limits;
                case.start = inside(&limits, rng, 1.0);
                moving_target(&mut case, rng, 1.0);
            }
            Class::NearZeroLimits => {
                let small = rng.log(1e-6, 1e-2);
                match rng.below(3) {
                    0 => (limits.v_max, limits.v_min) = (small, -small),
                    1 => (limits.a_max, limits.a_min) = (small, -small),
                    _ => (limits.j_max, limits.j_min) = (small, -small),
                }
                case.limits = limits;
                case.start = inside(&limits, rng, 1.0);
                moving_target(&mut case, rng, 1.0);
            }
        }
        place(&mut case, distance, rng);
        if self == Class::Sampled {
            if rng.chance(0.5) {
                (case.target.v, case.target.a) = (0.0, 0.0);
            }
            let problem = Problem::new(case.start, case.target, case.limits);
            if let Ok(plan) = plan(&problem, 0.0) {
                case.start = plan.at(plan.duration() * rng.unit());
            }
        }
        case
    }
}

/// A state inside the limits that full jerk keeps inside; its acceleration is `share` of what that
/// allows.
pub fn inside(l: &Limits, rng: &mut Rng, share: f64) -> State {
    let v = rng.uniform(l.v_min, l.v_max);
    let top = (2.0 * -l.j_min * (l.v_max - v)).sqrt().min(l.a_max);
    let bottom = -(2.0 * l.j_max * (v - l.v_min)).sqrt().min(-l.a_min);
    let a = share * rng.uniform(bottom, top);
    State { p: 0.0, v, a }
}

/// The limits of a motion run backwards in time: a target is a start there, with the sign of its
/// acceleration changed.
fn backwards(l: &Limits) -> Limits {
    Limits {
        a_max: -l.a_min,
        a_min: -l.a_max,
        ..*l
    }
}

fn on_limit(l: &Limits, rng: &mut Rng) -> State {
    let s = inside(l, rng, 1.0);
    match rng.below(6) {
        0 => State {
            v: l.v_max,
            a: 0.0,
            ..s
        },
        1 => State {
            v: l.v_min,
            a: 0.0,
            ..s
        },
        // Bound to touch the velocity limit exactly, to rounding.
        2 => State {
            v: l.v_max - 0.5 * s.a * s.a / -l.j_min,
            a: s.a.abs().min(l.a_max),
            ..s
        },
        3 => State {
            v: l.v_min + 0.5 * s.a * s.a / l.j_max,
            a: -s.a.abs().min(-l.a_min),
            ..s
        },
        4 => {
            let a = l.a_max.min((-l.j_min * (l.v_max - l.v_min)).sqrt());
            State {
                v: rng.uniform(l.v_min, l.v_max - 0.5 * a * a / -l.j_min),
                a,
                ..s
            }
        }
        _ => {
            let a = -(-l.a_min).min((l.j_max * (l.v_max - l.v_min)).sqrt());
            State {
                v: rng.uniform(l.v_min + 0.5 * a * a / l.j_max, l.v_max),
                a,
                ..s
            }
        }
    }
}

/// Whether a state is inside the limits and full jerk keeps it there, within rounding.
pub fn is_inside(s: &State, l: &Limits) -> bool {
    let stop = s.v + 0.5 * s.a * s.a / if s.a > 0.0 { -l.j_min } else { -l.j_max };
    let slack = 1e-13 * (l.v_max - l.v_min);
    let inside = |v: f64| v <= l.v_max + slack && v >= l.v_min - slack;
    s.a <= l.a_max && s.a >= l.a_min && inside(s.v) && inside(stop)
}

/// A small seeded generator (SplitMix64).
#[derive(Clone, Debug)]
pub struct Rng(u64);

impl Rng {
    /// A generator for `seed`.
    pub fn new(seed: u64) -> Self {
        Rng(seed)
    }

    /// The next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in 0 … 1.
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Uniform in `low` … `high`.
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Uniform by magnitude in `low` … `high`.
    pub fn log(&mut self, low: f64, high: f64) -> f64 {
        (self.uniform(low.ln(), high.ln())).exp()
    }

    /// 1 or −1.
    pub fn sign(&mut self) -> f64 {
        if self.bits() & 1 == 0 { 1.0 } else { -1.0 }
    }

    /// `true` with this probability.
    pub fn chance(&mut self, p: f64) -> bool {
        self.unit() < p
    }

    /// Uniform in 0 … n − 1.
    pub fn below(&mut self, n: u64) -> u64 {
        self.bits() % n
    }
}
