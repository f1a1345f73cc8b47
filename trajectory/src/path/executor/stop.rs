//! The way to rest as soon as the limits allow.
//!
//! Whatever is committed ends at rest, so that there is always one. A shorter one is laid at once where
//! the path is a line; elsewhere the planner is asked for one, and what it does not answer is
//! searched for here, some work a cycle, from a state a little ahead.

use super::{AHEAD, Executor, Step, WORK, first_lead};
use crate::path::brake::{Braking, brake_gently};
use crate::path::{Limits, PathState};

/// How far a stop on the path has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stop {
    /// Nobody asked for one.
    No,
    /// The plan is followed to its rest until a shorter way is found from that cycle on; since this one.
    Sought { departure: u64, since: u64 },
    /// The shorter way is being followed.
    Found,
}

/// What a look for a way to rest comes to.
#[allow(clippy::large_enum_variant)] // it lives for a moment, on the stack
enum Look {
    /// The plan comes to rest as fast as it can already.
    AtRestSoon,
    /// The hardest braking from the departure.
    Found(Braking),
    /// Nothing yet, the search goes on in the next cycle.
    GoesOn,
    /// Nothing from that departure; at its last cycle a gentle braking, if there is one.
    Nothing(Option<Braking>),
}

impl<const N: usize> Executor<N> {
    /// From this cycle on a stop is to begin that the planner, asked from now on, did not find.
    pub(super) fn unanswered(&self) -> u64 {
        self.cycle + self.lead + AHEAD
    }

    /// It is to come to rest as soon as it can, until [`resume`](Self::resume), to turn or for good, and
    /// no way there was found yet.
    pub(super) fn seeks_rest(&self) -> bool {
        let moves = matches!(self.current(), Some(Step::JerkSegment(_)));
        moves && matches!(self.stop, Stop::Sought { .. })
    }

    pub(super) fn begin_stop(&mut self) {
        // However slow its plans are: a way to rest is soon found.
        self.lead = first_lead(self.period);
        self.drop_uncommitted();
        let goes_on =
            |s: &Step<N>| matches!(s, Step::JerkSegment(_) | Step::Section { moving: true, .. });
        let run = self.steps.iter().position(|s| !goes_on(s));
        self.steps.truncate(run.unwrap_or(self.steps.len()));
        self.committed = self.steps.len();
        self.seek_from(self.cycle, self.cycle);
        self.seek_stop(self.cycle, self.cycle);
    }

    /// A way to rest from that cycle on is searched for anew.
    pub(super) fn seek_from(&mut self, departure: u64, since: u64) {
        self.stop = Stop::Sought { departure, since };
        if let Some(search) = &mut self.search {
            search.reset();
        }
    }

    /// Replaces the plan by a shorter way to rest if there is one.
    ///
    /// A line has a closed form at once. Elsewhere the planner is asked for one; what it does not
    /// answer in time is searched for here from a little ahead, so that the share of several cycles
    /// goes into the same law.
    ///
    /// Apart from the cycle that follows its plan: the search has a large stack.
    #[inline(never)]
    pub(super) fn seek_stop(&mut self, departure: u64, since: u64) {
        let (Some(Step::JerkSegment(_)), Some(limits)) = (self.current(), self.limits) else {
            return;
        };
        let (index, t) = self.step_at(departure);
        let Some(Step::JerkSegment(piece)) = self.steps.get(index).copied() else {
            self.stop = Stop::Found;
            return;
        };
        let (ds, speed, acceleration) = piece.at(t.min(piece.duration));
        let from = PathState {
            distance: piece.distance + ds,
            speed,
            acceleration,
        };
        match self.look_for_rest(from, &limits, departure, since) {
            Look::AtRestSoon => self.stop = Stop::Found,
            Look::Found(braking) => {
                self.rest_sooner(&braking, departure);
                self.stop = Stop::Found;
            }
            Look::GoesOn => {}
            Look::Nothing(gentle) => {
                if let Some(gentle) = gentle {
                    self.rest_sooner(&gentle, departure);
                }
                self.seek_from(self.next_departure(departure, since), since);
            }
        }
    }

    /// Looks for the shortest way to rest from a state on the plan, for as long as a cycle allows.
    fn look_for_rest(
        &mut self,
        from: PathState,
        limits: &Limits<N>,
        departure: u64,
        since: u64,
    ) -> Look {
        let spans = &self.spans;
        let passed = (1..spans.len())
            .take_while(|&k| spans[k].start > spans[k - 1].start && spans[k].start <= from.distance)
            .count();
        let span = |k: usize| {
            let span = spans.get(passed + k)?;
            (k == 0 || span.start > spans[passed + k - 1].start).then_some(span)
        };
        let first = self.cycle == since;
        let straight = span(0).is_some_and(|span| span.curve.direction().is_some());
        if first && straight && from.acceleration <= 0.0 && self.steps.iter().all(Step::brakes) {
            return Look::AtRestSoon;
        }
        let gentle = || brake_gently(span(0)?, limits, from, 0.0);
        if straight && let Some(braking) = gentle() {
            return Look::Found(braking);
        }
        if first {
            return Look::Nothing(None);
        }
        // The hardest as soon as it is found, and at last a gentle one.
        let search = self.search.as_mut();
        let searched = search.and_then(|search| search.go_on(span, limits, from, 0.0, WORK));
        match searched {
            Some(Some(braking)) => Look::Found(braking),
            _ if departure == self.cycle => Look::Nothing(gentle()),
            Some(None) => Look::GoesOn,
            None => Look::Nothing(None),
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
