//! What the path allows everywhere along a segment, and the motion from rest to rest that needs no
//! search.

use super::{Curve, JerkSegment, Limits, PathSegment};

/// Parts of an axis's limits that the curvature's own terms may take: q″ṡ² of the acceleration, q‴ṡ³ and
/// 3q″ṡs̈ of the jerk. What is left is for speeding up and slowing down; that it is enough for any combination is
/// what counts here, not that it is the best.
const CENTRIPETAL: f64 = 0.7;
const OWN_JERK: f64 = 0.3;
const MIXED_JERK: f64 = 0.35;

/// Path speed, acceleration and jerk that, together and in any combination, keep every axis inside
/// its limits.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bounds {
    pub(super) speed: f64,
    pub(super) acceleration: f64,
    pub(super) jerk: f64,
}

impl Bounds {
    /// Along a path segment, at the speed that is asked for.
    pub(super) fn of<const N: usize>(path_segment: &PathSegment<N>, limits: &Limits<N>) -> Self {
        let asked = path_segment.speed;
        match path_segment.clock {
            Some(clock) => Self {
                speed: clock.velocity[0].min(asked),
                acceleration: clock.acceleration[0],
                jerk: clock.jerk[0],
            },
            None => Self::along(&path_segment.curve, asked, limits),
        }
    }

    pub(super) fn along<const N: usize>(curve: &Curve<N>, speed: f64, limits: &Limits<N>) -> Self {
        // |q′|, |q″|, |q‴| of every axis, at most.
        let [d1, d2, d3] = curve.derivative_bounds();
        let least = |f: &dyn Fn(usize) -> f64| (0..N).map(f).fold(f64::INFINITY, f64::min);
        let speed = least(&|i| {
            (limits.velocity[i] / d1[i])
                .min((CENTRIPETAL * limits.acceleration[i] / d2[i]).sqrt())
                .min(libm::cbrt(OWN_JERK * limits.jerk[i] / d3[i]))
        })
        .min(speed);
        let acceleration = least(&|i| {
            let left = limits.acceleration[i] - d2[i] * speed * speed;
            (left / d1[i]).min(MIXED_JERK * limits.jerk[i] / (3.0 * d2[i] * speed))
        });
        let jerk = least(&|i| {
            let used = d3[i] * speed * speed * speed + 3.0 * d2[i] * speed * acceleration;
            (limits.jerk[i] - used) / d1[i]
        });
        Bounds {
            speed,
            acceleration,
            jerk,
        }
    }

    /// Each the lesser of both.
    pub(super) fn least(self, other: Self) -> Self {
        Self {
            speed: self.speed.min(other.speed),
            acceleration: self.acceleration.min(other.acceleration),
            jerk: self.jerk.min(other.jerk),
        }
    }

    /// No less than that part of others.
    pub(super) fn are_at_least(self, part: f64, of: Self) -> bool {
        self.speed >= part * of.speed
            && self.acceleration >= part * of.acceleration
            && self.jerk >= part * of.jerk
    }

    /// As those of one axis.
    pub(super) fn limits(self) -> crate::limits::Limits {
        crate::limits::Limits::symmetric(self.speed, self.acceleration, self.jerk)
    }
}

/// How long it takes along a curve from rest to rest without a search, s; not finite where nothing
/// bounds what the curve asks of the axes.
pub(super) fn crawling_time<const N: usize>(
    curve: &Curve<N>,
    speed: f64,
    limits: &Limits<N>,
) -> f64 {
    time_inside(curve.length(), Bounds::along(curve, speed, limits))
}

/// How long it takes over that length from rest to rest inside bounds, s.
pub(super) fn time_inside(length: f64, bounds: Bounds) -> f64 {
    let segments = rest_to_rest(0.0, length, bounds);
    segments.iter().map(|segment| segment.duration).sum()
}

/// The shortest profile over `length` from rest to rest: seven jerk segments, some of no duration.
pub(super) fn rest_to_rest(from: f64, length: f64, bounds: Bounds) -> [JerkSegment; 7] {
    let Bounds {
        speed: vmax,
        acceleration: amax,
        jerk: j,
    } = bounds;
    // Time of constant jerk and of constant acceleration on the way to the speed `v`.
    let ramp = |v: f64| {
        if v * j >= amax * amax {
            (amax / j, v / amax - amax / j)
        } else {
            ((v / j).sqrt(), 0.0)
        }
    };
    let ramps = |v: f64| {
        let (tj, ta) = ramp(v);
        v * (2.0 * tj + ta) // up and down again
    };
    let mut v = vmax;
    if ramps(v) > length {
        // Without constant acceleration: length = 2 v √(v/j); with it: length = v (a/j + v/a).
        let short = libm::cbrt(length * length * j / 4.0);
        v = if short * j <= amax * amax {
            short
        } else {
            let b = amax * amax / j;
            ((b * b + 4.0 * amax * length).sqrt() - b) / 2.0
        };
        v = v.min(vmax);
    }
    let (tj, ta) = ramp(v);
    let cruise = ((length - ramps(v)) / v).max(0.0);
    let a = j * tj;
    let shape = [
        (tj, j, 0.0),
        (ta, 0.0, a),
        (tj, -j, a),
        (cruise, 0.0, 0.0),
        (tj, -j, 0.0),
        (ta, 0.0, -a),
        (tj, j, -a),
    ];
    let mut distance = from;
    let mut speed = 0.0;
    shape.map(|(duration, jerk, acceleration)| {
        let segment = JerkSegment {
            duration,
            distance,
            speed,
            acceleration,
            jerk,
        };
        let (ds, v, _) = segment.at(duration);
        distance += ds;
        speed = v;
        segment
    })
}
