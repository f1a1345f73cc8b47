//! The time parametrisation as it was handed over: what the executor follows, or will.

use std::collections::VecDeque;

use super::{JerkSegment, PathState};

/// Jerk segments that are kept: what an executor and the queue to it may hold.
const KEPT: usize = 8192;
/// By how much a state may be off that the plan leads to, as a part of the speed, or of the
/// acceleration that is reached and of what it changes by in a jerk segment.
const SAME: f64 = 1e-6;
/// What changes by less in a jerk segment, as a part of itself, is the same throughout.
const STEADY: f64 = 1e-9;
/// Steps of Newton's method from an instant that is known to 1e-3 to rounding.
const NEWTON_STEPS: usize = 2;

/// A jerk segment of a plan, and what shares of the acceleration and jerk limits were used for it.
#[derive(Debug, Clone, Copy)]
pub(super) struct PlannedSegment {
    pub(super) segment: JerkSegment,
    pub(super) share: [f64; 2],
}

impl From<JerkSegment> for PlannedSegment {
    fn from(segment: JerkSegment) -> Self {
        PlannedSegment {
            segment,
            share: [1.0; 2],
        }
    }
}

/// The latest jerk segments, each with its item and the number of its step, in order.
#[derive(Debug, Clone, Default)]
pub(super) struct Plan(VecDeque<(u64, u64, PlannedSegment)>);

impl Plan {
    /// Forgets all that was handed over.
    pub(super) fn clear(&mut self) {
        self.0.clear();
    }

    /// The plan goes on with a jerk segment, which replaces all from its step on.
    pub(super) fn push(&mut self, item: u64, step: u64, planned: PlannedSegment) {
        while self.0.back().is_some_and(|last| last.1 >= step) {
            self.0.pop_back();
        }
        if self.0.len() >= KEPT {
            self.0.pop_front();
        }
        self.0.push_back((item, step, planned));
    }

    /// How the plan goes on from a state, to rest at most: the first jerk segment is what is left of the one
    /// that the state lies in. Nothing if the plan does not lead there.
    pub(super) fn from(&self, item: u64, state: PathState) -> impl Iterator<Item = PlannedSegment> {
        let begun = (self.0).partition_point(|(l, _, planned)| {
            (*l, planned.segment.distance) <= (item, state.distance)
        });
        let here = begun.checked_sub(1).and_then(|here| self.0.get(here));
        let rest = here
            .filter(|here| here.0 == item)
            .and_then(|(.., planned)| {
                let segment = remainder(&planned.segment, state)?;
                Some(PlannedSegment {
                    segment,
                    ..*planned
                })
            });
        let goes_on = move |(l, _, planned): &&(u64, u64, PlannedSegment)| {
            *l == item && planned.segment.speed > 0.0
        };
        let after = self.0.iter().skip(begun).take_while(goes_on);
        let after = after.map(|(.., planned)| *planned);
        rest.into_iter()
            .flat_map(move |rest| [rest].into_iter().chain(after.clone()))
    }
}

/// The jerk segments of a plan that are followed for so long, s, from a state, and where that leads; nothing if it
/// ends before.
pub(super) fn follow(
    plan: &[PlannedSegment],
    from: PathState,
    time: f64,
) -> Option<(Vec<JerkSegment>, PathState)> {
    let (mut followed, mut left) = (Vec::new(), time);
    let mut segments = plan.iter().map(|planned| planned.segment);
    while left > 0.0 {
        let segment = segments.next()?;
        let duration = segment.duration.min(left);
        followed.push(JerkSegment {
            duration,
            ..segment
        });
        left -= duration;
    }
    let end = followed.last().map_or(from, |last| {
        let (ds, speed, acceleration) = last.at(last.duration);
        PathState {
            distance: last.distance + ds,
            speed,
            acceleration,
        }
    });
    Some((followed, end))
}

/// What is left of a jerk segment from a state on, if it leads there.
fn remainder(segment: &JerkSegment, state: PathState) -> Option<JerkSegment> {
    let JerkSegment {
        duration,
        speed,
        acceleration,
        jerk,
        ..
    } = *segment;
    // What changes most surely tells when that is.
    let t = if (jerk * duration).abs() > SAME * acceleration.abs()
        && (jerk * duration * duration).abs() > STEADY * speed
    {
        (state.acceleration - acceleration) / jerk
    } else if (acceleration * duration).abs() > STEADY * speed {
        (state.speed - speed) / acceleration
    } else {
        (state.distance - segment.distance) / speed
    };
    // That misses what the others change meanwhile. Newton's method by the one that rounding blurs least: what
    // is off here is a jump of the path where the rest of the segment ends.
    let t = (0..NEWTON_STEPS).fold(t, |t, _| {
        let (ds, v, a) = segment.at(t);
        let blur = [(state.distance, v), (v, a), (a, jerk)].map(|(of, by)| (of / by).abs());
        let [far, fast, steep] = blur;
        if steep <= far.min(fast) {
            t + (state.acceleration - a) / jerk
        } else if fast <= far {
            t + (state.speed - v) / a
        } else {
            t + (state.distance - segment.distance - ds) / v
        }
    });
    let t = t.clamp(0.0, duration);
    let (ds, v, a) = segment.at(t);
    let near = |is: f64, should: f64, by: f64| (is - should).abs() <= SAME * by;
    let same = near(segment.distance + ds, state.distance, 1.0)
        && near(v, state.speed, state.speed)
        && near(a, state.acceleration, a.abs() + (jerk * duration).abs());
    same.then_some(JerkSegment {
        duration: duration - t,
        distance: state.distance,
        speed: state.speed,
        acceleration: state.acceleration,
        jerk,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn log(least: f64, most: f64) -> impl Strategy<Value = f64> {
        (least.ln()..most.ln()).prop_map(libm::exp)
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(10_000) })]

        #[test]
        fn what_is_left_of_a_segment_ends_where_the_segment_does(
            (duration, part) in (log(1e-5, 1.0), 0.0..1.0_f64),
            speed in log(1e-3, 1e3),
            (acceleration, jerk) in (log(1e-12, 0.4), log(1e-12, 0.4)),
            (up, rising) in (any::<bool>(), any::<bool>()),
        ) {
            let sign = |is: bool| if is { 1.0 } else { -1.0 };
            let segment = JerkSegment {
                duration,
                distance: 100.0,
                speed,
                acceleration: sign(up) * acceleration * speed / duration,
                jerk: sign(rising) * jerk * speed / (duration * duration),
            };
            let (ds, v, a) = segment.at(part * duration);
            let state = PathState { distance: 100.0 + ds, speed: v, acceleration: a };
            let left = remainder(&segment, state).unwrap();
            let gap = left.end() - segment.end();
            prop_assert!(gap.abs() <= 1e-12, "{gap} mm, {left:?}");
        }
    }
}
