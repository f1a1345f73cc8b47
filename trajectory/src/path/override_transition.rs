//! From a state in motion to the speed that is asked for now, which may be lower.
//!
//! A window can be planned from any state that the limits leave a way on from. A state that is faster than what is
//! asked for breaks the feed of its window, though, so the feed gives way first: it falls from the state's speed to
//! what is asked for, and the window is planned under that. What falls as hard as the axes allow may not leave
//! room for a corner that comes then; what falls gently leaves room, and takes longer. So both are tried, from the
//! state and from states further on along the old plan, in the order of what they cost and how soon they show:
//!
//! 1. as hard as the axes allow ([`brake`](super::brake)), then on,
//! 2. the same on the cells of the old plan up to where that goes slowest: on those cells there is a time
//!    parametrisation, namely the old one,
//! 3. under a limit of the speed that falls gently ([`lay_transition`]), on either cells. It falls from where the
//!    old plan goes slowest as well, for the speed must not rise again on the far side of a corner
//!    ([`overshoots`]) while it is to come down,
//! 4. along the old plan up to where it goes slowest, or has taken its acceleration back, and from there
//!    as 2 and 3.
//!
//! A plan that brakes for a corner as hard as it can is therefore followed into the corner, and the new one
//! begins there.

use super::brake::instant_at;
use super::plan::PlannedSegment;
use super::{JerkSegment, Limits, PathSegment, PathState};

/// How to plan on from a state in motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Attempt {
    /// So many jerk segments of the old plan are followed first.
    pub(super) followed: usize,
    /// It slows down as the path lets it, under a limit of the speed that falls gently, instead of as soon
    /// as it can.
    pub(super) gently: bool,
    /// The cells are those of the old plan, up to where it goes slowest: on them there is a solution, its own.
    pub(super) keeps: bool,
}

/// What is tried, in this order, to go on from the beginning of the `old` plan; the cheapest and
/// soonest first.
pub(super) fn attempts(old: &[PlannedSegment]) -> impl Iterator<Item = Attempt> + use<> {
    let slope = |k: usize| old[k].segment.acceleration;
    // Up to where it goes slowest, or takes no more of an acceleration back.
    let turns = (1..old.len()).find(|&k| {
        if slope(0) < 0.0 {
            slope(k) >= 0.0
        } else {
            slope(k) < 0.0 || slope(k) >= slope(k - 1)
        }
    });
    let keeps = !old.is_empty();
    let now = [false, true].map(move |gently| (0, gently));
    let then = turns
        .into_iter()
        .flat_map(|k| [false, true].map(|gently| (k, gently)));
    let now = now.into_iter().flat_map(move |(followed, gently)| {
        let cells = [Some(false), keeps.then_some(true)];
        cells.into_iter().flatten().map(move |keeps| Attempt {
            followed,
            gently,
            keeps,
        })
    });
    now.chain(then.map(|(followed, gently)| Attempt {
        followed,
        gently,
        keeps: true,
    }))
}

/// The jerk segments that begin where the plan goes slowest, for now.
pub(super) fn minima(plan: &[PlannedSegment]) -> impl Iterator<Item = usize> {
    let slope = |k: usize| plan[k].segment.acceleration;
    (1..plan.len()).filter(move |&k| slope(k) >= 0.0 && slope(k - 1) < 0.0)
}

/// Whether on the far side of where it goes slowest the speed rises again to more than is asked for.
pub(super) fn overshoots<const N: usize>(
    plan: &[PlannedSegment],
    path_segments: &[PathSegment<N>],
) -> bool {
    minima(plan).next().is_some_and(|low| {
        let [before, at] = [low - 1, low].map(|k| plan[k].segment.speed);
        plan[low..].iter().any(|PlannedSegment { segment, .. }| {
            let asked = path_segment_at(path_segments, segment.distance).speed;
            segment.speed > asked.max(before.min(at)) * (1.0 + OVERSHOOT)
        })
    })
}

/// The part by which a speed may rise that should fall: less does not show.
const OVERSHOOT: f64 = 1e-3;
/// Speeds that may be asked for within one transition, one lower than the other: each takes it further, to
/// path segments with other feeds.
const MOST_TARGETS: usize = 4;

/// Lays a limit of the speed that falls gently to what is asked for from a state, and from where the
/// `old` plan goes slowest on its way; nothing if the speed is no higher. Where nothing is asked for, that is
/// to rest: returns where the path can rest then.
pub(super) fn lay_transition<const N: usize>(
    path_segments: &[PathSegment<N>],
    limits: &Limits<N>,
    from: PathState,
    old: &[PlannedSegment],
    segments: &mut Vec<JerkSegment>,
) -> Option<f64> {
    let slope = Slope::along(path_segments, limits, from);
    let mut target = path_segments[0].speed;
    // The speed must come down to what is asked for where it has come down.
    for _ in 0..MOST_TARGETS {
        segments.clear();
        let mut at = from;
        let mut minima = minima(old).peekable();
        let (a, above) = (from.acceleration, from.speed - target);
        if a < 0.0
            && above > 0.0
            && 2.0 * slope.jerk * above < a * a
            && let Some(low) = minima.next()
        {
            // It falls faster than that already.
            segments.extend(old[..low].iter().map(|planned| planned.segment));
            at = lowest(old, low);
        }
        at = slope.descend(at, target, segments);
        for low in minima {
            let low = lowest(old, low);
            if low.distance >= at.distance {
                break;
            }
            let passed = segments.partition_point(|segment| segment.distance < low.distance);
            let Some(last) = segments[..passed].last_mut() else {
                continue;
            };
            let t = instant_at(last, low.distance);
            if low.speed < last.at(t).1 {
                last.duration = t;
                segments.truncate(passed);
                at = slope.descend(low, target, segments);
            }
        }
        let under_way = path_segments.iter().take_while(|s| s.start <= at.distance);
        let least = under_way.map(|s| s.speed).fold(target, f64::min);
        if least >= target {
            break;
        }
        target = least;
    }
    let last = segments.last().filter(|_| target <= 0.0)?;
    Some(from.distance + SOONER * (last.end() - from.distance))
}

/// The path comes to rest on this part of the distance on which such a limit does: it has to be below
/// the limit all along.
const SOONER: f64 = 0.97;

/// Where the plan goes slowest.
fn lowest(plan: &[PlannedSegment], low: usize) -> PathState {
    PathState {
        acceleration: 0.0,
        ..plan[low].segment.into()
    }
}

fn path_segment_at<const N: usize>(
    path_segments: &[PathSegment<N>],
    distance: f64,
) -> &PathSegment<N> {
    &path_segments[path_segments
        .partition_point(|s| s.start <= distance)
        .max(1)
        - 1]
}

/// How a limit of the speed falls.
#[derive(Debug, Clone, Copy)]
struct Slope {
    acceleration: f64,
    jerk: f64,
}

/// Part of the axes' accelerations and jerks with which it does: the rest is for the bends.
const GENTLY: f64 = 0.4;
/// Parts of the distance to rest at which the path's direction is looked up.
const PLACES: [f64; 4] = [0.25, 0.5, 0.75, 1.0];

impl Slope {
    /// Gently wherever the path leads from a state.
    fn along<const N: usize>(
        path_segments: &[PathSegment<N>],
        limits: &Limits<N>,
        from: PathState,
    ) -> Self {
        let at = |s: f64| {
            let path_segment = path_segment_at(path_segments, s);
            let limits = path_segment.limits(limits);
            let along = (s - path_segment.start).min(path_segment.curve.length());
            let part = path_segment.slope(along).d1.map(f64::abs);
            let least = |limit: &[f64; N]| {
                (0..N)
                    .map(|i| GENTLY * limit[i] / part[i])
                    .fold(f64::INFINITY, f64::min)
            };
            Slope {
                acceleration: least(&limits.acceleration),
                jerk: least(&limits.jerk),
            }
        };
        let here = at(from.distance);
        let time = 0.5 * from.speed / here.acceleration + here.acceleration / here.jerk;
        PLACES.iter().fold(here, |least, part| {
            let there = at(from.distance + part * time * from.speed);
            Slope {
                acceleration: least.acceleration.min(there.acceleration),
                jerk: least.jerk.min(there.jerk),
            }
        })
    }

    /// Lays the closed form from a state down to the speed `target`, nothing if it is no higher;
    /// returns where that ends.
    fn descend(self, from: PathState, target: f64, segments: &mut Vec<JerkSegment>) -> PathState {
        let (a, j) = (from.acceleration, self.jerk);
        let above = from.speed - target;
        let reached = above + a * a / (2.0 * j);
        let shape = if above <= 0.0 && (a <= 0.0 || reached <= 0.0) {
            [(0.0, 0.0); 3]
        } else if a < 0.0 && 2.0 * j * above <= a * a {
            [
                (2.0 * above / -a, 0.5 * a * a / above),
                (0.0, 0.0),
                (0.0, 0.0),
            ]
        } else {
            let peak = (j * reached).sqrt().min(self.acceleration.max(-a));
            let hold = (reached - peak * peak / j) / peak;
            [((a + peak) / j, -j), (hold, 0.0), (peak / j, j)]
        };
        let mut at = from;
        for (duration, jerk) in shape {
            if duration <= 0.0 {
                continue;
            }
            let segment = JerkSegment {
                duration,
                distance: at.distance,
                speed: at.speed,
                acceleration: at.acceleration,
                jerk,
            };
            segments.push(segment);
            let (ds, speed, acceleration) = segment.at(duration);
            at = PathState {
                distance: at.distance + ds,
                speed: speed.max(0.0),
                acceleration,
            };
        }
        at
    }
}
