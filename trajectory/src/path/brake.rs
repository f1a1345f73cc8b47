//! Slowing down along a given path as hard as the axes allow: to rest, or to a lower speed.
//!
//! On a line that is a closed form. On curves the law is laid in steps of constant jerk: each
//! brakes as hard as the axes allow at both of its ends and as the landing on the target speed
//! permits, and is checked in between. The steps are few and of fixed number, so that the cycle
//! can afford them.

use super::{Curve, Departure, Derivatives, Limits, Piece, Span};

/// Pieces of a braking law at most.
pub(super) const MOST_PIECES: usize = 80;
/// Steps that a law on a curve is laid in, about.
const STEPS: f64 = 32.0;
/// Greatest turn of the tangent in a step, rad.
const STEP_TURN: f64 = 0.1;
/// Pieces that are tried at most for one law.
const MOST_CHECKS: usize = 100;
/// Part of the jerk limit that a curve must leave for braking in closed form.
const RESERVE: f64 = 0.4;
/// Parts of the limits that are tried in turn where a step breaks one between its ends.
const FORCES: [f64; 5] = [0.9995, 0.995, 0.97, 0.9, 0.75];
/// Parts of the jerk limit with which a law on a curve lands, at most and at least, tried in turn;
/// the rest is for the curvature and for what the landing turns.
const LANDINGS: [(f64, f64); 4] = [(0.97, 0.8), (0.9, 0.7), (0.7, 0.5), (0.99, 0.975)];
/// Excess over a limit that is rounding, as a part of it.
const ROUNDING: f64 = 1e-9;

/// A law that slows down, and where it ends: at the target speed, without acceleration.
#[derive(Debug, Clone)]
pub(super) struct Braking {
    pieces: [Piece; MOST_PIECES],
    count: usize,
    pub(super) end: Departure,
}

impl Braking {
    fn new(from: Departure) -> Self {
        let nothing = Piece {
            duration: 0.0,
            distance: 0.0,
            speed: 0.0,
            acceleration: 0.0,
            jerk: 0.0,
        };
        Braking {
            pieces: [nothing; MOST_PIECES],
            count: 0,
            end: from,
        }
    }

    pub(super) fn pieces(&self) -> &[Piece] {
        &self.pieces[..self.count]
    }

    fn push(&mut self, duration: f64, jerk: f64) -> Option<()> {
        let piece = self.next(duration, jerk);
        *self.pieces.get_mut(self.count)? = piece;
        self.count += 1;
        let (ds, speed, acceleration) = piece.at(duration);
        self.end = Departure {
            distance: self.end.distance + ds,
            speed,
            acceleration,
        };
        Some(())
    }

    fn next(&self, duration: f64, jerk: f64) -> Piece {
        Piece {
            duration,
            distance: self.end.distance,
            speed: self.end.speed,
            acceleration: self.end.acceleration,
            jerk,
        }
    }
}

/// Geometry under way: the spans of one section from some distance on.
struct Road<'a, const N: usize, S: Fn(usize) -> Option<&'a Span<N>>> {
    span: S,
    index: usize,
}

impl<'a, const N: usize, S: Fn(usize) -> Option<&'a Span<N>>> Road<'a, N, S> {
    /// The span at `distance`, no earlier than the last one asked for.
    fn span_at(&mut self, distance: f64) -> Option<&'a Span<N>> {
        while let Some(next) = (self.span)(self.index + 1)
            && next.start <= distance
        {
            self.index += 1;
        }
        (self.span)(self.index)
    }

    fn at(&mut self, distance: f64) -> Option<Derivatives<N>> {
        let span = self.span_at(distance)?;
        Some(span.curve.at(distance - span.start))
    }
}

/// The hardest slowing down found from `from` to the path speed `target` along the spans that
/// `span` counts out. None if a limit breaks on the way.
pub(super) fn brake<'a, const N: usize>(
    span: impl Fn(usize) -> Option<&'a Span<N>>,
    limits: &Limits<N>,
    from: Departure,
    target: f64,
) -> Option<Braking> {
    (0..LANDINGS.len()).find_map(|attempt| brake_once(&span, limits, from, target, attempt))
}

/// As [`brake`], at a fraction of its cost: one attempt of several that differ in how they land.
pub(super) fn brake_once<'a, const N: usize>(
    span: impl Fn(usize) -> Option<&'a Span<N>>,
    limits: &Limits<N>,
    from: Departure,
    target: f64,
    attempt: usize,
) -> Option<Braking> {
    let landing = LANDINGS[attempt % LANDINGS.len()];
    lay(span, limits, from, target, landing)
}

/// As [`brake`], landing with that part of the jerk limit.
fn lay<'a, const N: usize>(
    span: impl Fn(usize) -> Option<&'a Span<N>>,
    limits: &Limits<N>,
    from: Departure,
    target: f64,
    (most, fewest): (f64, f64),
) -> Option<Braking> {
    let mut checks = 0;
    let mut road = Road { span, index: 0 };
    let mut law = Braking::new(from);
    while law.count < MOST_PIECES - 3 {
        let Departure {
            distance,
            speed,
            acceleration,
        } = law.end;
        let span = road.span_at(distance)?;
        if span.curve.direction().is_some()
            && let Some(closed) = gentle(span, limits, &law, target)
        {
            return Some(closed);
        }
        let here = span.curve.at(distance - span.start);
        let above = speed - target;
        let mut scout = Road {
            span: &road.span,
            index: road.index,
        };
        let along = least(&limits.jerk, &here.d1);
        let duration = pace(&here, limits, law.end, target);
        let ahead = distance + duration * (speed + 0.5 * duration * acceleration);
        let there = Road {
            span: &road.span,
            index: road.index,
        }
        .at(ahead)?;
        // Where it will land the axes may allow less than here.
        let brisk = least(&limits.acceleration, &here.d1).min((along * above.max(0.0)).sqrt());
        let left = 0.5 * speed * above / brisk.max(1e-9);
        let mut allowed = along;
        for part in [0.25, 0.5, 0.75, 1.0] {
            let span = scout.span_at(distance + part * left)?;
            let at = span.curve.at(distance + part * left - span.start);
            allowed = allowed.min(least(&limits.jerk, &at.d1));
        }
        let landing = most * allowed;
        if acceleration < 0.0 {
            let duration = -2.0 * above / acceleration;
            let jerk = -acceleration / duration;
            checks += 1;
            if jerk >= fewest * allowed && keeps(&road, &law.next(duration, jerk), limits) {
                law.push(duration, jerk)?;
                law.end.speed = target;
                law.end.acceleration = 0.0;
                return Some(law);
            }
        }
        let jerk = FORCES.iter().find_map(|&force| {
            let jerk = hardest(
                limits, force, &here, &there, law.end, target, duration, landing,
            );
            let piece = law.next(duration, jerk);
            checks += 1;
            let slows = piece.at(duration).1 > target && checks <= MOST_CHECKS;
            (slows && keeps(&road, &piece, limits)).then_some(jerk)
        })?;
        law.push(duration, jerk)?;
    }
    None
}

/// A slowing down that leaves room for whatever the span's bends ask of the axes; on a straight span
/// it is the hardest. None if the span leaves too little room, or ends before.
pub(super) fn brake_gently<const N: usize>(
    span: &Span<N>,
    limits: &Limits<N>,
    from: Departure,
    target: f64,
) -> Option<Braking> {
    gentle(span, limits, &Braking::new(from), target)
}

fn gentle<const N: usize>(
    span: &Span<N>,
    limits: &Limits<N>,
    law: &Braking,
    target: f64,
) -> Option<Braking> {
    let (limit, jerk) = reserve(&span.curve, limits, law.end.speed, law.end.acceleration)?;
    let closed = closed_form(law, target, limit, jerk)?;
    (closed.end.distance <= span.start + span.curve.length()).then_some(closed)
}

/// Duration of the next step, s.
fn pace<const N: usize>(
    here: &Derivatives<N>,
    limits: &Limits<N>,
    at: Departure,
    target: f64,
) -> f64 {
    let (a, j) = (
        least(&limits.acceleration, &here.d1),
        least(&limits.jerk, &here.d1),
    );
    let above = (at.speed - target).max(0.0);
    let ramp = (a / j).min((above / j).sqrt());
    let whole = above / a + ramp + (at.acceleration.max(0.0) / j);
    // Where the bends take most of what the axes can, it takes longer.
    let slow = whole.max(above / at.acceleration.min(-0.2 * a).abs());
    let bend = (0..N).map(|i| here.d2[i].abs()).fold(0.0, f64::max);
    (slow / STEPS)
        .min(STEP_TURN / (bend * at.speed))
        .max(slow / (2.0 * STEPS))
}

/// Whether every axis keeps its limits on the piece: at instants spread over what it takes of each
/// span, and between them as far as what is asked bends no more than there.
fn keeps<'a, const N: usize>(
    road: &Road<'a, N, impl Fn(usize) -> Option<&'a Span<N>>>,
    piece: &Piece,
    limits: &Limits<N>,
) -> bool {
    const INTERVALS: usize = 4;
    let end = piece.distance + piece.at(piece.duration).0;
    let mut begin = 0.0;
    let mut index = road.index;
    while let Some(span) = (road.span)(index) {
        let next = (road.span)(index + 1).filter(|next| next.start < end);
        // Beyond what is known of the path nothing can be kept.
        if next.is_none() && end > span.start + span.curve.length() + ROUNDING {
            return false;
        }
        let until = next.map_or(piece.duration, |next| instant_at(piece, next.start));
        // What a short part asks changes little.
        let intervals = if until - begin < 0.2 * piece.duration {
            2
        } else {
            INTERVALS
        };
        let mut asked = [[[0.0; N]; 3]; INTERVALS + 1];
        for (k, asked) in asked.iter_mut().enumerate().take(intervals + 1) {
            let t = begin + (until - begin) * k as f64 / intervals as f64;
            let (ds, v, a) = piece.at(t);
            let at = span.curve.at((piece.distance - span.start) + ds);
            for i in 0..N {
                asked[0][i] = (at.d2[i] * v * v + at.d1[i] * a) / limits.acceleration[i];
                let bend = (at.d3[i] * v * v + 3.0 * at.d2[i] * a) * v;
                asked[1][i] = (bend + at.d1[i] * piece.jerk) / limits.jerk[i];
                asked[2][i] = at.d1[i] * v / limits.velocity[i];
            }
        }
        let kept = (0..3).all(|what| {
            (0..N).all(|i| {
                let top = (1..intervals)
                    .map(|k| crest([-1, 0, 1].map(|d| asked[k.wrapping_add_signed(d)][what][i])));
                top.fold(0.0, f64::max) <= 1.0 + ROUNDING
            })
        });
        if !kept {
            return false;
        }
        if next.is_none() {
            return true;
        }
        begin = until;
        index += 1;
    }
    false
}

/// Greatest magnitude of the parabola through three points the same way apart.
fn crest([before, here, after]: [f64; 3]) -> f64 {
    let ends = before.abs().max(after.abs()).max(here.abs());
    let (slope, bend) = (0.5 * (after - before), before + after - 2.0 * here);
    if slope.abs() < bend.abs() {
        ends.max((here - 0.5 * slope * slope / bend).abs())
    } else {
        ends
    }
}

/// When the piece reaches a distance, s from its start, between its start and its end.
fn instant_at(piece: &Piece, distance: f64) -> f64 {
    let way = distance - piece.distance;
    let mut t = 0.0;
    // The speed changes little within a step: Newton's method is there at once.
    for _ in 0..4 {
        let (ds, v, _) = piece.at(t);
        t = (t + (way - ds) / v.max(1e-9)).clamp(0.0, piece.duration);
    }
    t
}

/// The least of what the axes allow along the path.
fn least<const N: usize>(limit: &[f64; N], along: &[f64; N]) -> f64 {
    (0..N)
        .map(|i| limit[i] / along[i].abs())
        .fold(f64::INFINITY, f64::min)
}

/// Path acceleration and jerk that slowing down from speed `v` and acceleration `a` may use
/// anywhere on the curve, whatever its bends ask of the axes meanwhile; `None` if they leave too
/// little.
fn reserve<const N: usize>(
    curve: &Curve<N>,
    limits: &Limits<N>,
    v: f64,
    a: f64,
) -> Option<(f64, f64)> {
    let [d1, d2, d3] = match curve.direction() {
        Some(along) => [along.map(f64::abs), [0.0; N], [0.0; N]],
        None => curve.derivative_bounds(),
    };
    let least = |left: &dyn Fn(usize) -> f64| {
        (0..N)
            .filter(|&i| d1[i] > 0.0)
            .map(|i| left(i) / d1[i])
            .fold(f64::INFINITY, f64::min)
    };
    // The speed still rises while an acceleration is taken back.
    let rising = a.max(0.0);
    let highest = |jerk: f64| v + rising * rising / (2.0 * jerk);
    let bent = d2.iter().any(|d| *d > 0.0);
    let whole = least(&|i| limits.jerk[i]);
    let v = highest(if bent { whole * RESERVE } else { whole });
    let acceleration = least(&|i| limits.acceleration[i] - d2[i] * v * v);
    let top = acceleration.max(a.abs());
    let jerk = least(&|i| limits.jerk[i] - d3[i] * v * v * v - 3.0 * d2[i] * v * top);
    // Also what the bends ask where an axis has no part in the path's direction.
    let kept = (0..N).all(|i| {
        d2[i] * v * v <= limits.acceleration[i]
            && d3[i] * v * v * v + 3.0 * d2[i] * v * top <= limits.jerk[i]
    });
    let enough = acceleration * (1.0 + 1e-9) >= a.abs() && jerk >= whole * RESERVE && kept;
    (enough && acceleration > 0.0).then_some((acceleration, jerk))
}

/// The shortest way from `law`'s end down to the speed `target`: jerk −j, deceleration `limit`
/// held if it is reached, jerk +j. `None` where jerk +j alone would be there no earlier.
fn closed_form(law: &Braking, target: f64, limit: f64, j: f64) -> Option<Braking> {
    let a = law.end.acceleration;
    let above = law.end.speed - target;
    // The speed above the target where the acceleration was, or will be, nothing.
    let reached = above + a * a / (2.0 * j);
    if above <= 0.0 && a <= 0.0 || reached <= 0.0 {
        return None;
    }
    let peak = (j * reached).sqrt().min(limit);
    if a + peak < -1e-9 * peak {
        return None;
    }
    let hold = (reached - peak * peak / j) / peak;
    let mut law = law.clone();
    law.push(((a + peak) / j).max(0.0), -j)?;
    law.end.acceleration = -peak;
    law.push(hold.max(0.0), 0.0)?;
    law.push(peak / j, j)?;
    law.end.speed = target;
    law.end.acceleration = 0.0;
    Some(law)
}

/// The hardest braking jerk for the next `t` seconds that, with the part `force` of them, keeps
/// every axis inside its limits at both ends and can still land with the path jerk `landing`.
#[allow(clippy::too_many_arguments)] // the law's own
fn hardest<const N: usize>(
    limits: &Limits<N>,
    force: f64,
    here: &Derivatives<N>,
    there: &Derivatives<N>,
    at: Departure,
    target: f64,
    t: f64,
    landing: f64,
) -> f64 {
    let (v, a) = (at.speed, at.acceleration);
    // Acceleration at the end of the step, from what its end and its landing allow …
    let speed = (v + a * t).max(target);
    let mut low_a = f64::NEG_INFINITY;
    let mut high_a = f64::INFINITY;
    for i in 0..N {
        let d = there.d1[i].abs();
        if d > 0.0 {
            let curve = there.d2[i] * there.d1[i].signum() * speed * speed;
            low_a = low_a.max((-force * limits.acceleration[i] - curve) / d);
            high_a = high_a.min((force * limits.acceleration[i] - curve) / d);
        }
    }
    // a₁² = 2 j (v₁ − target) with v₁ = v + (a + a₁) t / 2
    let jt = landing * t;
    let under = 0.25 * jt * jt + landing * (2.0 * (v - target) + a * t);
    let land = 0.5 * jt - under.max(0.0).sqrt();
    // … and jerk, from what both ends allow.
    let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
    for (at, v, a) in [(here, v, a), (there, speed, a.min(0.0))] {
        for i in 0..N {
            let d = at.d1[i].abs();
            if d > 0.0 {
                let curve = (at.d3[i] * v * v + 3.0 * at.d2[i] * a) * v * at.d1[i].signum();
                low = low.max((-force * limits.jerk[i] - curve) / d);
                high = high.min((force * limits.jerk[i] - curve) / d);
            }
        }
    }
    let wish = low_a.max(land).min(high_a).max(a + low * t);
    ((wish - a) / t).min(high).max(low.min(high))
}
