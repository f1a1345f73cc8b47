//! Certifies a plan without trusting the planner.
//!
//! Shares nothing with it but double-double numbers: in those a profile is integrated here, and
//! limits are compared at the exact extrema between switches, not at samples.

use crate::double::Double;
use crate::profile::{Profile, Segment, State};
use crate::state_to_state::{Problem, Target};

/// What was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Certificate {
    /// The greatest of the three errors at the end, each relative: the position error to
    /// `max(|pf − p0|, path travelled)`, the velocity error to `max(|v_max|, |v_min|, |v0|, |vf|)`,
    /// the acceleration error alike. Infinite for a profile that is none (a duration that is
    /// negative or not a number, another start).
    pub end_error: f64,
    /// The greatest excess over a limit of position, velocity, acceleration or jerk, relative as
    /// above. Only what the start state does not force counts: a start outside a limit, or on the
    /// way over it, may go on to where full jerk turns it around; once back inside, the limit holds.
    pub limit_excess: f64,
    /// Path travelled (length).
    pub path: f64,
}

impl Certificate {
    const BROKEN: Certificate = Certificate {
        end_error: f64::INFINITY,
        limit_excess: f64::INFINITY,
        path: 0.0,
    };

    /// Whether both errors are at most `tolerance`.
    pub fn holds(&self, tolerance: f64) -> bool {
        self.end_error <= tolerance && self.limit_excess <= tolerance
    }
}

/// Certifies the profile of one axis.
pub fn axis(profile: &Profile, problem: &Problem) -> Certificate {
    let start = problem.start;
    let l = &problem.limits;
    let (vf, af) = match problem.target {
        Target::State(s) => (s.v, s.a),
        Target::Velocity { v, a } => (v, a),
    };
    let v_scale = greatest([l.v_max, l.v_min, start.v, vf]);
    let a_scale = greatest([l.a_max, l.a_min, start.a, af]);
    let j_scale = greatest([l.j_max, l.j_min]);

    // The velocities at which full jerk turns the start acceleration around: far outside the limits
    // the rounding of one would be an excess.
    let turn = |j: f64| {
        let gain = 0.5 * start.a * start.a / j;
        let rest = Double::product(start.a, start.a) - Double::product(2.0 * j, gain);
        Double::from(start.v) - gain.into() - (rest.value() / (2.0 * j)).into()
    };
    let forced_top = if start.a > 0.0 {
        turn(l.j_min)
    } else {
        start.v.into()
    };
    let forced_bottom = if start.a < 0.0 {
        turn(l.j_max)
    } else {
        start.v.into()
    };
    let mut v_top = Ceiling::new(l.v_max, forced_top, v_scale);
    let mut v_bottom = Ceiling::new(-l.v_min, -forced_bottom, v_scale);
    let mut a_top = Ceiling::new(l.a_max, start.a.into(), a_scale);
    let mut a_bottom = Ceiling::new(-l.a_min, (-start.a).into(), a_scale);

    let mut excess = 0.0_f64;
    if profile.start() != start {
        return Certificate::BROKEN;
    }
    let mut state = Exact {
        p: Double::ZERO,
        v: start.v.into(),
        a: start.a.into(),
    };
    let mut path = Double::ZERO;
    let (mut lowest, mut highest) = (0.0_f64, 0.0_f64);
    for &Segment { duration, jerk } in profile.segments() {
        if !(duration >= 0.0 && duration.is_finite() && jerk.is_finite()) {
            return Certificate::BROKEN;
        }
        excess = excess
            .max((jerk - l.j_max) / j_scale)
            .max((l.j_min - jerk) / j_scale);
        let end = state.after(duration, jerk);
        // Velocity is monotone between the zeros of the acceleration, position between those of
        // the velocity.
        let turn = -state.a.value() / jerk;
        let turns = turn > 0.0 && turn < duration;
        let middle = if turns { state.after(turn, jerk) } else { end };
        for (from, to) in [(state, middle), (middle, end)]
            .into_iter()
            .take(1 + usize::from(turns))
        {
            let (a, b) = (from.v, to.v);
            excess = excess.max(v_top.over(a, b)).max(v_bottom.over(-a, -b));
        }
        let (a, b) = (state.a, end.a);
        excess = excess.max(a_top.over(a, b)).max(a_bottom.over(-a, -b));

        let mut last = state;
        for t in velocity_zeros(&state, jerk).into_iter().chain([duration]) {
            if t > 0.0 && t <= duration {
                let next = if t < duration {
                    state.after(t, jerk)
                } else {
                    end
                };
                path = path + (next.p - last.p).abs();
                lowest = lowest.min(next.p.value());
                highest = highest.max(next.p.value());
                last = next;
            }
        }
        state = end;
    }
    let path = path.value();
    let mut end_error = ((state.v - vf.into()).abs().value() / v_scale)
        .max((state.a - af.into()).abs().value() / a_scale);
    let mut p_scale = path;
    if let Target::State(target) = problem.target {
        let distance = Double::from(target.p) - start.p.into();
        p_scale = p_scale.max(distance.abs().value());
        let miss = (state.p - distance).abs().value();
        if miss > 0.0 {
            end_error = end_error.max(miss / p_scale);
        }
    }
    if let Some(bounds) = problem.bounds {
        let over = (highest - (bounds.max - start.p)).max((bounds.min - start.p) - lowest);
        if over > 0.0 {
            excess = excess.max(over / p_scale);
        }
    }
    Certificate {
        end_error,
        limit_excess: excess,
        path,
    }
}

/// The greatest distance of a motion of several axes from the straight line between its ends, over
/// `max(length of the line, |p|)`.
///
/// Every switch of any axis and, between switches, a few instants more are looked at: a deviation
/// is a cubic there, and one that vanishes at enough instants vanishes throughout. Infinite for more than sixteen axes.
pub fn straightness(profiles: &[Profile], targets: &[State]) -> f64 {
    let distances = || profiles.iter().zip(targets).map(|(p, t)| t.p - p.start().p);
    // Without a distance the line is that of the greatest excursion.
    let length2: f64 = distances().map(|d| d * d).sum();
    let scale = profiles
        .iter()
        .zip(targets)
        .fold(length2.sqrt(), |s, (p, t)| {
            s.max(p.start().p.abs()).max(t.p.abs())
        });
    let mut worst = 0.0_f64;
    let mut reference = [0.0; 16];
    if profiles.len() > reference.len() {
        return f64::INFINITY;
    }
    if length2 > 0.0 {
        for (r, d) in reference.iter_mut().zip(distances()) {
            *r = d / length2.sqrt();
        }
    } else {
        let mut furthest = 0.0;
        for profile in profiles {
            for t in instants(profile) {
                let offsets = || profiles.iter().map(|p| p.at(t).p - p.start().p);
                let norm = offsets().map(|x| x * x).sum::<f64>().sqrt();
                if norm > furthest {
                    furthest = norm;
                    for (r, x) in reference.iter_mut().zip(offsets()) {
                        *r = x / norm;
                    }
                }
            }
        }
    }
    for profile in profiles {
        for t in instants(profile) {
            let offsets = || {
                let axes = profiles.iter().zip(reference);
                axes.map(|(axis, part)| (exact_at(axis, t).p, Double::from(part)))
            };
            let along = offsets().fold(Double::ZERO, |along, (offset, part)| along + offset * part);
            let off2: f64 = offsets()
                .map(|(offset, part)| (offset - along * part).value())
                .map(|off| off * off)
                .sum();
            worst = worst.max(off2.sqrt());
        }
    }
    if worst > 0.0 { worst / scale } else { 0.0 }
}

fn instants(profile: &Profile) -> impl Iterator<Item = f64> + '_ {
    let mut begin = 0.0;
    profile.segments().iter().flat_map(move |s| {
        let b = begin;
        begin += s.duration;
        [0.25, 0.5, 0.75, 1.0].map(|x| b + x * s.duration)
    })
}

fn exact_at(profile: &Profile, t: f64) -> Exact {
    let start = profile.start();
    let mut state = Exact {
        p: Double::ZERO,
        v: start.v.into(),
        a: start.a.into(),
    };
    let mut rest = t;
    for s in profile.segments() {
        state = state.after(s.duration.min(rest), s.jerk);
        rest -= s.duration;
        if rest <= 0.0 {
            break;
        }
    }
    state
}

/// A limit that a start state may be beyond, or be bound to go beyond, until it first is inside.
struct Ceiling {
    limit: f64,
    allowed: Double,
    scale: f64,
}

impl Ceiling {
    fn new(limit: f64, forced: Double, scale: f64) -> Self {
        let beyond = (forced - limit.into()).value() > 0.0;
        Ceiling {
            limit,
            allowed: if beyond { forced } else { limit.into() },
            scale,
        }
    }

    /// The relative excess of a monotone stretch from `from` to `to`.
    fn over(&mut self, from: Double, to: Double) -> f64 {
        let falls = (to - from).value() <= 0.0;
        let top = if falls { from } else { to };
        let excess = (top - self.allowed).value() / self.scale;
        if falls && (to - self.limit.into()).value() <= 1e-12 * self.scale {
            self.allowed = self.limit.into();
        }
        excess
    }
}

#[derive(Clone, Copy)]
struct Exact {
    p: Double,
    v: Double,
    a: Double,
}

impl Exact {
    fn after(&self, t: f64, j: f64) -> Exact {
        let (t, j) = (Double::from(t), Double::from(j));
        let jt = j * t;
        Exact {
            p: self.p + t * (self.v + t * (self.a.half() + jt * Double::SIXTH)),
            v: self.v + t * (self.a + jt.half()),
            a: self.a + jt,
        }
    }
}

/// The times at which the velocity is zero, in order; a rounded one costs the position nothing,
/// which stands still there.
fn velocity_zeros(state: &Exact, jerk: f64) -> [f64; 2] {
    let (v, a) = (state.v.value(), state.a.value());
    let discriminant = a * a - 2.0 * jerk * v;
    if discriminant < 0.0 {
        return [f64::NAN; 2];
    }
    let q = -(a + discriminant.sqrt().copysign(a));
    let (x, y) = (q / jerk, 2.0 * v / q);
    if x < y { [x, y] } else { [y, x] }
}

fn greatest<const N: usize>(xs: [f64; N]) -> f64 {
    xs.into_iter().fold(0.0, |m, x| m.max(x.abs()))
}
