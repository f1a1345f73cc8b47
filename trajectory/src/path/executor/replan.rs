//! The plan is replaced: from which state on it has to be planned anew, and what of it is kept.

use super::activity::{Activity, Next, WayToRest};
use super::{Executor, PlanStatus, Step};
use crate::path::{PathState, ReplanGoal, ReplanRequest};

impl<const N: usize> Executor<N> {
    /// The plan is to be replaced, and what still comes of the old one is dropped.
    pub fn awaits_replacement(&self) -> bool {
        self.plan == PlanStatus::AwaitingReplacement
    }

    /// From where on the plan has to be replaced, if it has. What is handed in before that is done
    /// is dropped. Nowhere at a mark or so shortly before it that it is reached before: what is
    /// replaced begins behind it once it is passed, and the mark itself is not lost.
    pub fn replan_request(&self) -> Option<ReplanRequest> {
        let goal = self.activity.goal()?;
        let rest = goal == ReplanGoal::Rest;
        let waits = self.place.mark.is_some() && !rest;
        if !self.awaits_replacement() || waits || self.refused == Some(self.cycle) {
            return None;
        }
        // A way to rest is soon found.
        let lead = if rest { self.lead * 3 / 4 } else { self.lead };
        let cycle = self.cycle + lead.max(1);
        let mut item = self.place.item;
        let mut departure = PathState {
            distance: self.place.reached,
            ..PathState::default()
        };
        let (last, t) = self.step_at(cycle);
        for (index, step) in self.steps.iter().take(self.committed).enumerate() {
            if index > last {
                break;
            }
            match *step {
                Step::Section { item: l, .. } => {
                    item = Some(l);
                    departure = PathState::default();
                }
                Step::Mark { .. } => return None,
                Step::Dwell { item: l, .. } | Step::Waypoint { item: l, .. } => item = Some(l),
                Step::JerkSegment(piece) => {
                    let under_way = index == last;
                    let (ds, speed, acceleration) =
                        piece.at(if under_way { t } else { piece.duration });
                    let follows = matches!(
                        self.steps.get(index + 1),
                        Some(Step::JerkSegment(_) | Step::Section { moving: true, .. })
                    ) && index + 1 < self.committed;
                    let rests = !under_way && !follows;
                    departure = PathState {
                        distance: piece.distance + ds,
                        speed: if rests { 0.0 } else { speed.max(0.0) },
                        acceleration: if rests { 0.0 } else { acceleration },
                    };
                }
                Step::Hold => {}
            }
        }
        Some(ReplanRequest {
            revision: self.revision,
            cycle,
            item,
            departure,
            overrides: self.overrides,
            goal,
        })
    }

    /// The plan is to be replaced: nothing more of it is taken.
    pub(super) fn request_replacement(&mut self) {
        let over = matches!(
            self.activity,
            Activity::Ended
                | Activity::Stopping {
                    way: WayToRest::Found,
                    next: Next::End,
                }
        );
        if over {
            return;
        }
        self.drop_uncommitted();
        self.revision += 1;
        self.plan = PlanStatus::AwaitingReplacement;
    }

    pub(super) fn drop_uncommitted(&mut self) {
        self.steps.truncate(self.committed);
        let spans = self.committed_spans.saturating_sub(self.first_span);
        self.spans.truncate(spans as usize);
        if self.plan != PlanStatus::AwaitingReplacement {
            self.plan = PlanStatus::Current;
        }
    }

    /// The committed step that is under way at the start of `cycle`, and for how long then; their
    /// number if there is none any more.
    pub(super) fn step_at(&self, cycle: u64) -> (usize, f64) {
        let mut t = self.since(self.began) + (cycle - self.cycle) as f64 * self.period;
        for (index, step) in self.steps.iter().take(self.committed).enumerate() {
            let duration = step.duration();
            if t < duration {
                return (index, t.max(0.0));
            }
            t -= duration;
        }
        (self.committed, 0.0)
    }

    /// Cuts the committed plan at the start of `cycle`; returns how many of its steps remain.
    pub(super) fn cut(&mut self, cycle: u64) -> usize {
        let (index, t) = self.step_at(cycle);
        match self.steps.get_mut(index) {
            Some(Step::JerkSegment(piece)) if index < self.committed => {
                piece.duration = t;
                index + 1
            }
            // A dwell is not cut short.
            Some(Step::Dwell { .. }) if index < self.committed => index + 1,
            _ => index,
        }
    }
}
