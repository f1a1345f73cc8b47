//! Coming to rest as soon as the limits allow.
//!
//! Whatever is committed ends at rest, so that there is always a stop; the search is for a shorter one. It
//! goes in these steps, and ends with the first that finds one:
//!
//! 1. in the cycle of the order: the plan itself where it does nothing but slow down along a line, or the
//!    closed form on a line;
//! 2. the planner is asked, by a [`ReplanRequest`](crate::path::ReplanRequest) for rest; its answer takes over as
//!    any plan does;
//! 3. what it has not answered when its time is over is searched for here, so much work a cycle, from the
//!    state on the plan some cycles ahead, and where there is none from the next one. A search has three
//!    [outcomes](Outcome): found, unfinished, impossible. One that is unfinished when its departure comes is
//!    given up for the next; meanwhile a gentle closed form is followed where the bends leave room for one.
//!
//! Until then the plan is followed. The planner comes first because it has milliseconds where a cycle
//! has a fraction of one, and searches more finely; the cycle's own search is for a planner that is gone, or
//! a host that is crowded.

use super::activity::{Activity, Next, StopSearch};
use super::{Executor, Step, WORK, ahead, first_lead};
use crate::path::brake::{Braking, Outcome, brake_gently};
use crate::path::{Limits, PathState};

impl<const N: usize> Executor<N> {
    /// From this cycle on a stop is to begin that the planner, asked from now on, did not find.
    pub(super) fn unanswered(&self) -> u64 {
        self.cycle + self.lead + ahead(self.period)
    }

    /// Comes to rest as soon as it can, for what is next; at rest it is there already. What is behind
    /// the rest is dropped. A dwell under way is such a rest, and goes on if the path does.
    pub(super) fn stop_for(&mut self, next: Next) {
        // However slow the planner's plans are, a stop is soon found.
        self.lead = first_lead(self.period);
        self.drop_uncommitted();
        let goes_on =
            |s: &Step<N>| matches!(s, Step::JerkSegment(_) | Step::Section { moving: true, .. });
        let stays = matches!(next, Next::Hold | Next::Follow);
        let dwells = stays && matches!(self.current(), Some(Step::Dwell { .. }));
        let motion = self.steps.iter().position(|s| !goes_on(s));
        let kept = if dwells { Some(1) } else { motion };
        self.steps.truncate(kept.unwrap_or(self.steps.len()));
        self.committed = self.steps.len();
        if self.moves() {
            let (departure, since) = (self.cycle, self.cycle);
            let search = StopSearch::Sought { departure, since };
            self.activity = Activity::Stopping { search, next };
            self.search.reset();
            self.seek_stop(departure, since);
        } else {
            self.activity = next.into();
        }
    }

    /// A stop from that cycle on is searched for anew.
    pub(super) fn search_from(&mut self, departure: u64, since: u64) {
        self.search_is(StopSearch::Sought { departure, since });
        self.search.reset();
    }

    fn search_is(&mut self, now: StopSearch) {
        if let Activity::Stopping { search, .. } = &mut self.activity {
            *search = now;
        }
    }

    /// Replaces the plan by a shorter stop from the cycle `departure` on, if there is one.
    ///
    /// A line has a closed form at once. Elsewhere the planner is asked for one; what it does not
    /// answer in time is searched for here from a little ahead, so that the share of several cycles
    /// goes into the same search.
    ///
    /// Apart from the cycle that follows its plan: the search has a large stack.
    #[inline(never)]
    pub(super) fn seek_stop(&mut self, departure: u64, since: u64) {
        let Some(limits) = self.place.limits else {
            return;
        };
        let Some(from) = self.state_at(departure) else {
            self.search_is(StopSearch::Found);
            return;
        };
        let outcome = if self.cycle == since {
            if self.rests_soon(from) {
                self.search_is(StopSearch::Found);
                return;
            }
            self.brake_at_once(from, &limits)
        } else {
            self.search_on(from, &limits, departure)
        };
        match outcome {
            Outcome::Found(braking) => {
                self.rest_sooner(&braking, departure);
                self.search_is(StopSearch::Found);
            }
            Outcome::Unfinished => {}
            Outcome::Impossible => self.search_from(self.next_departure(departure, since), since),
        }
    }

    /// The state on the path at the start of that cycle; none where the plan rests before.
    fn state_at(&self, cycle: u64) -> Option<PathState> {
        let (index, t) = self.step_at(cycle);
        let Some(Step::JerkSegment(segment)) = self.steps.get(index) else {
            return None;
        };
        let (ds, speed, acceleration) = segment.at(t.min(segment.duration));
        Some(PathState {
            distance: segment.distance + ds,
            speed,
            acceleration,
        })
    }

    /// How many of the path segments are passed at that distance.
    fn passed(&self, distance: f64) -> usize {
        let path_segments = &self.path_segments;
        (1..path_segments.len())
            .take_while(|&k| {
                path_segments[k].start > path_segments[k - 1].start
                    && path_segments[k].start <= distance
            })
            .count()
    }

    /// On a line, and nothing is planned but to slow down: no stop is shorter.
    fn rests_soon(&self, from: PathState) -> bool {
        let here = self.path_segments.get(self.passed(from.distance));
        here.is_some_and(|path_segment| path_segment.direction().is_some())
            && from.acceleration <= 0.0
            && self.steps.iter().all(Step::brakes)
    }

    /// The closed form on a line.
    fn brake_at_once(&self, from: PathState, limits: &Limits<N>) -> Outcome {
        let here = self.path_segments.get(self.passed(from.distance));
        here.filter(|path_segment| path_segment.direction().is_some())
            .and_then(|path_segment| brake_gently(path_segment, limits, from, 0.0))
            .map_or(Outcome::Impossible, Outcome::Found)
    }

    /// Goes on with the search for the hardest braking, for as long as a cycle allows. Where it is not
    /// found in the last cycle before its departure, a gentle one is followed meanwhile.
    fn search_on(&mut self, from: PathState, limits: &Limits<N>, departure: u64) -> Outcome {
        let passed = self.passed(from.distance);
        let path_segments = &self.path_segments;
        let path_segment = |k: usize| {
            let path_segment = path_segments.get(passed + k)?;
            (k == 0 || path_segment.start > path_segments[passed + k - 1].start)
                .then_some(path_segment)
        };
        let work = WORK / ahead(self.period) as usize;
        match self.search.go_on(path_segment, limits, from, 0.0, work) {
            Outcome::Unfinished | Outcome::Impossible if departure == self.cycle => {
                let gentle = path_segment(0)
                    .and_then(|path_segment| brake_gently(path_segment, limits, from, 0.0));
                if let Some(gentle) = gentle {
                    self.rest_sooner(&gentle, departure);
                }
                Outcome::Impossible
            }
            outcome => outcome,
        }
    }

    /// Follows a stop from that cycle on, if the plan does not rest as soon.
    fn rest_sooner(&mut self, braking: &Braking, departure: u64) {
        let last = self.committed.checked_sub(1);
        let plan_ends = match last.and_then(|last| self.steps.get(last)) {
            Some(Step::JerkSegment(last)) => last.end(),
            _ => f64::INFINITY,
        };
        if braking.end.distance < plan_ends {
            self.request_replacement();
            let keep = self.cut(departure);
            self.steps.truncate(keep);
            let braking = braking.segments().iter().copied();
            self.steps.extend(braking.map(Step::JerkSegment));
            self.committed = self.steps.len();
        }
    }

    /// From which cycle on a stop is searched for next.
    fn next_departure(&self, departure: u64, since: u64) -> u64 {
        let next = if self.cycle == since {
            self.unanswered()
        } else {
            (departure + 1).max(self.cycle + ahead(self.period))
        };
        // Another section may begin before.
        let (index, _) = self.step_at(next);
        let mut until = self.steps.iter().take(index + 1);
        if until.all(|step| matches!(step, Step::JerkSegment(_))) {
            next
        } else {
            self.cycle + 1
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::{
        Curve, Feed, Move, PathControlMode, PathItem, Plane, Planner, curve::ArcDefinition,
    };
    use proptest::prelude::*;

    /// On an arc at 200 mm/s, after half a second, without a planner from then on: after how long the path slows, s.
    fn alone_on_an_arc(period: f64) -> f64 {
        let limits = Limits::<2> {
            velocity: [300.0; 2],
            acceleration: [3_000.0; 2],
            jerk: [60_000.0; 2],
        };
        let arc = ArcDefinition {
            start: [0.0; 2],
            end: [100.0, 0.0],
            plane: Plane::Xy,
            centre: (50.0, 0.0),
            clockwise: true,
            turns: 1,
        };
        let mut planner = Planner::new(limits, [0.0; 2]);
        let item = PathItem::Move(Move {
            curve: Curve::arc(arc).unwrap(),
            feed: Feed::Rate(200.0),
            mode: PathControlMode::Stop,
            tag: 0,
        });
        planner.push(item).unwrap();
        planner.finish();
        let mut executor = Executor::new([0.0; 2], period);
        while let Some(command) = planner.pop() {
            assert!(executor.accept(command));
        }
        while executor.cycle() as f64 * period < 0.5 {
            executor.advance();
        }
        let (speed, ordered) = (executor.setpoint().speed, executor.cycle());
        executor.feed_hold();
        while executor.advance().speed > 0.999 * speed {}
        (executor.cycle() - ordered) as f64 * period
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..ProptestConfig::default() })]

        /// However long a cycle is, a path that no planner helps to stop slows soon.
        #[test]
        fn a_stop_without_a_planner_begins_soon_whatever_the_cycle(period in 0.0005..0.02_f64) {
            let after = alone_on_an_arc(period);
            // 10 ms for the planner, 24 ms ahead and the first cycles of a stop.
            prop_assert!(after <= 0.034 + 3.0 * period, "{after} s");
        }
    }
}
