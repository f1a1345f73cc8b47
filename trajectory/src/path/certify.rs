//! What a jerk segment of the plan asks of the axes, between the samples too.
//!
//! The planner's constraints stand at the nodes of its cells, and samples stand where they are taken; a limit is
//! a limit at every instant. So what is handed over is bounded in between, too: a function is no higher than the
//! parabola through three samples a time h apart, plus h³/9√3 of its third derivative. The third derivatives of
//! velocity, acceleration and jerk by time are polynomials in ṡ, s̈, the path jerk and the path's first six
//! derivatives by length, and those are bounded on the stretch by Taylor coefficients. Where the bound is above
//! a limit that the parabolas keep, both halves are looked at: h³ makes each an eighth as wide of the mark.

use super::curve::Place;
use super::{JerkSegment, Limits, PathSegment};

/// The greatest values as parts of their limits: 1 is the limit.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Load {
    /// Path speed against the feed and axis velocities against theirs.
    pub velocity: f64,
    /// Axis accelerations.
    pub acceleration: f64,
    /// Axis jerks.
    pub jerk: f64,
}

impl Load {
    /// Of both.
    pub fn max(self, other: Load) -> Load {
        Load {
            velocity: self.velocity.max(other.velocity),
            acceleration: self.acceleration.max(other.acceleration),
            jerk: self.jerk.max(other.jerk),
        }
    }
}

/// Times that a jerk segment is halved, at most, to come to a closer bound.
const HALVINGS: usize = 6;
/// Excess over a limit that is rounding, as a part of it.
pub const ROUNDING: f64 = 1e-9;
/// A bound this close above what the samples tell is close enough.
const CLOSE: f64 = 2e-5;
/// 1/9√3: what a parabola through three points can be off, by the third derivative and h³.
const BEND: f64 = 0.064_150_029_909_958_42;

/// Upper bounds of what `segment` on `path_segment` asks of the axes at any instant; infinite for a segment that is none.
///
/// On a line they are exact. On a curve: a function is no higher than the parabola through three samples
/// a time h apart, and h³/9√3 of its third derivative. The third derivatives of velocity,
/// acceleration and jerk by time follow from the path's first six derivatives, which are bounded on
/// the stretch ([`Curve::growth`](super::Curve::growth)). Where that comes out above a limit that
/// the parabolas keep, both halves are looked at.
pub fn load<const N: usize>(
    segment: &JerkSegment,
    path_segment: &PathSegment<N>,
    limits: &Limits<N>,
) -> Load {
    // What is compared below drops what is no number.
    let &JerkSegment {
        duration,
        distance,
        speed,
        acceleration,
        jerk,
    } = segment;
    if ![duration, distance, speed, acceleration, jerk]
        .into_iter()
        .all(f64::is_finite)
    {
        return Load {
            velocity: f64::INFINITY,
            acceleration: f64::INFINITY,
            jerk: f64::INFINITY,
        };
    }
    let mut top = segment.speed.max(segment.at(segment.duration).1);
    if segment.acceleration * segment.jerk < 0.0 {
        let turn = -segment.acceleration / segment.jerk;
        if turn < segment.duration {
            top = top.max(segment.at(turn).1);
        }
    }
    let mut load = Load {
        velocity: top / path_segment.speed,
        ..Load::default()
    };
    let limits = path_segment.limits(limits);
    if let Some(direction) = path_segment.direction() {
        let last = segment.at(segment.duration).2;
        let steepest = segment.acceleration.abs().max(last.abs());
        for i in 0..N {
            let d = direction[i].abs();
            load.velocity = load.velocity.max(d * top / limits.velocity[i]);
            load.acceleration = load.acceleration.max(d * steepest / limits.acceleration[i]);
            load.jerk = load.jerk.max(d * segment.jerk.abs() / limits.jerk[i]);
        }
        return load;
    }
    let whole = Stretch {
        segment,
        path_segment,
        limits,
    };
    let [first, last] = [0.0, segment.duration].map(|t| whole.sample(t));
    load.max(whole.bound([0.0, segment.duration], top, [&first, &last], HALVINGS))
}

/// Whether every axis provably keeps its limits on `segment` but for that excess, at any feed; as
/// [`load`], with so many halvings at most. Some that do are not found to.
pub(super) fn keeps<const N: usize>(
    segment: &JerkSegment,
    path_segment: &PathSegment<N>,
    limits: &Limits<N>,
    excess: f64,
    halvings: usize,
) -> bool {
    let stretch = Stretch {
        segment,
        path_segment,
        limits,
    };
    let top = segment.speed.max(segment.at(segment.duration).1);
    let [first, last] = [0.0, segment.duration].map(|t| stretch.sample(t));
    stretch.is_inside(
        [0.0, segment.duration],
        (top, 1.0 + excess),
        [&first, &last],
        halvings,
    )
}

/// A jerk segment on a curve.
struct Stretch<'a, const N: usize> {
    segment: &'a JerkSegment,
    path_segment: &'a PathSegment<N>,
    limits: &'a Limits<N>,
}

/// Velocity, acceleration and jerk of every axis as parts of their limits, at an instant; and where
/// that is, and the path's acceleration.
struct Sample<const N: usize> {
    parts: [[f64; N]; 3],
    place: Place,
    a: f64,
}

impl<const N: usize> Stretch<'_, N> {
    fn sample(&self, t: f64) -> Sample<N> {
        let Stretch {
            segment,
            path_segment,
            limits,
        } = self;
        let (ds, v, a) = segment.at(t);
        let place = path_segment
            .curve
            .place((segment.distance - path_segment.start) + ds);
        let at = path_segment.curve.at_place(place);
        let mut parts = [[0.0; N]; 3];
        for i in 0..N {
            parts[0][i] = at.d1[i] * v / limits.velocity[i];
            parts[1][i] = (at.d2[i] * v * v + at.d1[i] * a) / limits.acceleration[i];
            parts[2][i] = (at.d3[i] * v * v * v + 3.0 * at.d2[i] * v * a + at.d1[i] * segment.jerk)
                / limits.jerk[i];
        }
        Sample { parts, place, a }
    }

    /// Upper bounds between two instants; nowhere there is the path faster than `top`.
    fn bound(&self, [t0, t1]: [f64; 2], top: f64, ends: [&Sample<N>; 2], halvings: usize) -> Load {
        let middle = 0.5 * (t0 + t1);
        let between = self.sample(middle);
        let (seen, most) = self.estimate(t1 - t0, top, [ends[0], &between, ends[1]]);
        let open = (0..3).any(|w| most[w] > 1.0 + ROUNDING && most[w] > seen[w] + CLOSE);
        if open && halvings > 0 {
            let first = self.bound([t0, middle], top, [ends[0], &between], halvings - 1);
            return first.max(self.bound([middle, t1], top, [&between, ends[1]], halvings - 1));
        }
        Load {
            velocity: most[0],
            acceleration: most[1],
            jerk: most[2],
        }
    }
    /// Whether the bounds are inside of what is allowed; a sample beyond that ends the search.
    fn is_inside(
        &self,
        [t0, t1]: [f64; 2],
        (top, allowed): (f64, f64),
        ends: [&Sample<N>; 2],
        halvings: usize,
    ) -> bool {
        let middle = 0.5 * (t0 + t1);
        let between = self.sample(middle);
        let (seen, most) = self.estimate(t1 - t0, top, [ends[0], &between, ends[1]]);
        let inside = |parts: [f64; 3]| parts.iter().all(|part| *part <= allowed);
        let half = |time: [f64; 2], ends: [&Sample<N>; 2]| {
            self.is_inside(time, (top, allowed), ends, halvings - 1)
        };
        inside(most)
            || inside(seen)
                && halvings > 0
                && half([t0, middle], [ends[0], &between])
                && half([middle, t1], [&between, ends[1]])
    }

    /// What three samples, evenly spread over `time`, tell, and upper bounds between them.
    fn estimate(&self, time: f64, top: f64, samples: [&Sample<N>; 3]) -> ([f64; 3], [f64; 3]) {
        let growth = (self.path_segment.curve).growth_between(samples[0].place, samples[2].place);
        let [_, d2, d3, d4, d5, d6] = &growth;
        let (v, a, j) = (
            top,
            samples[0].a.abs().max(samples[2].a.abs()),
            self.segment.jerk.abs(),
        );
        let (v2, a2) = (v * v, a * a);
        let h = 0.5 * time;
        let bend = h * h * h * BEND;
        let limits = [
            &self.limits.velocity,
            &self.limits.acceleration,
            &self.limits.jerk,
        ];
        let mut seen = [0.0_f64; 3];
        let mut most = [0.0_f64; 3];
        // An axis that stands adds nothing.
        let moves = |i: &usize| {
            growth.iter().any(|d| d[*i] != 0.0)
                || samples
                    .iter()
                    .any(|s| s.parts.iter().any(|part| part[*i] != 0.0))
        };
        for i in (0..N).filter(moves) {
            let third = [
                d4[i] * v2 * v2 + 6.0 * d3[i] * v2 * a + d2[i] * (3.0 * a2 + 4.0 * v * j),
                v2 * v * (d5[i] * v2 + 10.0 * d4[i] * a)
                    + d3[i] * v * (15.0 * a2 + 10.0 * v * j)
                    + 10.0 * d2[i] * a * j,
                v2 * v2 * (d6[i] * v2 + 15.0 * d5[i] * a)
                    + d4[i] * v2 * (45.0 * a2 + 20.0 * v * j)
                    + d3[i] * a * (15.0 * a2 + 60.0 * v * j)
                    + 10.0 * d2[i] * j * j,
            ];
            for what in 0..3 {
                let peak = crest(samples.map(|s| s.parts[what][i]));
                seen[what] = seen[what].max(peak);
                most[what] = most[what].max(peak + bend * third[what] / limits[what][i]);
            }
        }
        (seen, most)
    }
}

/// Greatest magnitude of the parabola through three points the same way apart, between the outer
/// ones.
pub(super) fn crest([before, here, after]: [f64; 3]) -> f64 {
    let ends = before.abs().max(after.abs()).max(here.abs());
    let (slope, bend) = (0.5 * (after - before), before + after - 2.0 * here);
    if slope.abs() < bend.abs() {
        ends.max((here - 0.5 * slope * slope / bend).abs())
    } else {
        ends
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::Curve;

    #[test]
    fn what_is_no_number_is_beyond_every_limit() {
        let limits = Limits {
            velocity: [50.0; 2],
            acceleration: [500.0; 2],
            jerk: [5_000.0; 2],
        };
        let path_segment = PathSegment {
            start: 0.0,
            curve: Curve::line([0.0; 2], [10.0, 0.0]).unwrap(),
            feed: 50.0,
            turns: None,
            most: f64::INFINITY,
            clock: None,
            asked: 50.0,
            speed: 50.0,
            tag: 0,
            waypoints: 0,
        };
        let sound = JerkSegment {
            duration: 0.1,
            distance: 0.0,
            speed: 10.0,
            acceleration: 1.0,
            jerk: 2.0,
        };
        assert!(load(&sound, &path_segment, &limits).velocity < 1.0);
        for broken in [
            JerkSegment {
                duration: f64::NAN,
                ..sound
            },
            JerkSegment {
                jerk: f64::NAN,
                ..sound
            },
            JerkSegment {
                speed: f64::NAN,
                ..sound
            },
            JerkSegment {
                acceleration: f64::INFINITY,
                ..sound
            },
        ] {
            let load = load(&broken, &path_segment, &limits);
            let beyond = |part: f64| part.is_nan() || part > 1.0 + ROUNDING;
            assert!(
                [load.velocity, load.acceleration, load.jerk]
                    .into_iter()
                    .any(beyond),
                "{load:?}"
            );
        }
    }
}
