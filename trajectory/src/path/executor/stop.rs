//! The way to rest as soon as the limits allow.
//!
//! Whatever is committed ends at rest, so that there is always one. A shorter one is laid at once where
//! the path is a line; elsewhere the planner is asked for one, and what it does not answer is
//! searched for here, some work a cycle, from a state a little ahead.

use super::activity::{Activity, Next, WayToRest};
use super::{AHEAD, Executor, Step, WORK, first_lead};
use crate::path::brake::{Braking, Outcome, brake_gently};
use crate::path::{Limits, PathState};

impl<const N: usize> Executor<N> {
    /// From this cycle on a stop is to begin that the planner, asked from now on, did not find.
    pub(super) fn unanswered(&self) -> u64 {
        self.cycle + self.lead + AHEAD
    }

    /// Comes to rest as soon as it can, for what is next; at rest it is there already. What is behind
    /// the rest is dropped, a dwell is broken off.
    pub(super) fn stop_for(&mut self, next: Next) {
        // However slow its plans are: a way to rest is soon found.
        self.lead = first_lead(self.period);
        self.drop_uncommitted();
        let goes_on =
            |s: &Step<N>| matches!(s, Step::JerkSegment(_) | Step::Section { moving: true, .. });
        let motion = self.steps.iter().position(|s| !goes_on(s));
        self.steps.truncate(motion.unwrap_or(self.steps.len()));
        self.committed = self.steps.len();
        if self.moves() {
            let (departure, since) = (self.cycle, self.cycle);
            let way = WayToRest::Sought { departure, since };
            self.activity = Activity::Stopping { way, next };
            self.search.reset();
            self.seek_rest(departure, since);
        } else {
            self.activity = next.into();
        }
    }

    /// A way to rest from that cycle on is searched for anew.
    pub(super) fn seek_from(&mut self, departure: u64, since: u64) {
        self.way_is(WayToRest::Sought { departure, since });
        self.search.reset();
    }

    fn way_is(&mut self, now: WayToRest) {
        if let Activity::Stopping { way, .. } = &mut self.activity {
            *way = now;
        }
    }

    /// Replaces the plan by a shorter way to rest from the cycle `departure` on, if there is one.
    ///
    /// A line has a closed form at once. Elsewhere the planner is asked for one; what it does not
    /// answer in time is searched for here from a little ahead, so that the share of several cycles
    /// goes into the same search.
    ///
    /// Apart from the cycle that follows its plan: the search has a large stack.
    #[inline(never)]
    pub(super) fn seek_rest(&mut self, departure: u64, since: u64) {
        let Some(limits) = self.place.limits else {
            return;
        };
        let Some(from) = self.state_at(departure) else {
            self.way_is(WayToRest::Found);
            return;
        };
        let outcome = if self.cycle == since {
            if self.rests_soon(from) {
                self.way_is(WayToRest::Found);
                return;
            }
            self.brake_at_once(from, &limits)
        } else {
            self.search_on(from, &limits, departure)
        };
        match outcome {
            Outcome::Found(braking) => {
                self.rest_sooner(&braking, departure);
                self.way_is(WayToRest::Found);
            }
            Outcome::Unfinished => {}
            Outcome::Impossible => self.seek_from(self.next_departure(departure, since), since),
        }
    }

    /// The state on the path at the start of that cycle; none where the plan rests before.
    fn state_at(&self, cycle: u64) -> Option<PathState> {
        let (index, t) = self.step_at(cycle);
        let Some(Step::JerkSegment(piece)) = self.steps.get(index) else {
            return None;
        };
        let (ds, speed, acceleration) = piece.at(t.min(piece.duration));
        Some(PathState {
            distance: piece.distance + ds,
            speed,
            acceleration,
        })
    }

    /// How many of the spans are passed at that distance.
    fn passed(&self, distance: f64) -> usize {
        let spans = &self.spans;
        (1..spans.len())
            .take_while(|&k| spans[k].start > spans[k - 1].start && spans[k].start <= distance)
            .count()
    }

    /// On a line, and nothing is planned but to slow down: no stop is shorter.
    fn rests_soon(&self, from: PathState) -> bool {
        let here = self.spans.get(self.passed(from.distance));
        here.is_some_and(|span| span.curve.direction().is_some())
            && from.acceleration <= 0.0
            && self.steps.iter().all(Step::brakes)
    }

    /// The closed form on a line.
    fn brake_at_once(&self, from: PathState, limits: &Limits<N>) -> Outcome {
        let here = self.spans.get(self.passed(from.distance));
        here.filter(|span| span.curve.direction().is_some())
            .and_then(|span| brake_gently(span, limits, from, 0.0))
            .map_or(Outcome::Impossible, Outcome::Found)
    }

    /// Goes on with the search for the hardest braking, for as long as a cycle allows. Where it is not
    /// found in the last cycle before its departure, a gentle one is followed meanwhile.
    fn search_on(&mut self, from: PathState, limits: &Limits<N>, departure: u64) -> Outcome {
        let passed = self.passed(from.distance);
        let spans = &self.spans;
        let span = |k: usize| {
            let span = spans.get(passed + k)?;
            (k == 0 || span.start > spans[passed + k - 1].start).then_some(span)
        };
        match self.search.go_on(span, limits, from, 0.0, WORK) {
            Outcome::Unfinished | Outcome::Impossible if departure == self.cycle => {
                let gentle = span(0).and_then(|span| brake_gently(span, limits, from, 0.0));
                if let Some(gentle) = gentle {
                    self.rest_sooner(&gentle, departure);
                }
                Outcome::Impossible
            }
            outcome => outcome,
        }
    }

    /// Follows a way to rest from that cycle on, if the plan does not rest as soon.
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
            let braking = braking.pieces().iter().copied();
            self.steps.extend(braking.map(Step::JerkSegment));
            self.committed = self.steps.len();
        }
    }

    /// From which cycle on a way to rest is searched for next.
    fn next_departure(&self, departure: u64, since: u64) -> u64 {
        let next = if self.cycle == since {
            self.unanswered()
        } else {
            (departure + 1).max(self.cycle + AHEAD)
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
