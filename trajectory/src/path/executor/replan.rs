//! The plan is replaced: from which state on it has to be planned anew, what of it is kept, and how
//! its tail or a whole new plan takes over.

use super::activity::{Activity, Next, StopSearch};
use super::{Executor, LONGEST_LEAD, Step, first_lead};
use crate::path::{PathState, ReplanGoal, ReplanRequest};

/// What the executor knows of its plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PlanStatus {
    /// What comes goes on with it.
    Current,
    /// What comes replaces its steps from that number on.
    ReceivingTail { from: u64 },
    /// It is to be replaced, and what still comes of it is dropped.
    AwaitingReplacement,
    /// Its replacement is coming, for that cycle.
    ReceivingReplacement { takeover: u64 },
}

impl PlanStatus {
    /// It is to be replaced, and is not yet.
    pub(super) fn is_replaced(self) -> bool {
        matches!(
            self,
            PlanStatus::AwaitingReplacement | PlanStatus::ReceivingReplacement { .. }
        )
    }
}

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
        // A stop is soon found.
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
                    // Where its motion begins: it may still wait.
                    let first = match self.steps.get(index + 1) {
                        Some(Step::JerkSegment(first)) => first.distance,
                        _ => 0.0,
                    };
                    departure = PathState {
                        distance: first,
                        ..PathState::default()
                    };
                }
                Step::Mark { .. } => return None,
                Step::Dwell { item: l, .. } | Step::Waypoint { item: l, .. } => item = Some(l),
                Step::JerkSegment(segment) => {
                    let under_way = index == last;
                    let (ds, speed, acceleration) =
                        segment.at(if under_way { t } else { segment.duration });
                    let follows = matches!(
                        self.steps.get(index + 1),
                        Some(Step::JerkSegment(_) | Step::Section { moving: true, .. })
                    ) && index + 1 < self.committed;
                    let rests = !under_way && !follows;
                    departure = PathState {
                        distance: segment.distance + ds,
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
            turns: self.turns,
            single_block: self.single_block,
            goal,
        })
    }

    /// What was handed in since the last commit ends at rest, and may run.
    pub(super) fn commit(&mut self) {
        match std::mem::replace(&mut self.plan, PlanStatus::Current) {
            PlanStatus::ReceivingReplacement { takeover } => {
                if !self.can_take_over(takeover) {
                    self.refuse_replacement(takeover);
                    return;
                }
                self.take_over(takeover);
            }
            PlanStatus::ReceivingTail { from } => {
                // A step that has begun cannot be replaced any more.
                let keep = from as i64 - self.number;
                if keep <= 0 {
                    self.late += 1;
                    self.request_replacement();
                    return;
                }
                self.steps
                    .drain((keep as usize).min(self.committed)..self.committed);
            }
            PlanStatus::Current | PlanStatus::AwaitingReplacement => {
                if self.committed == 0 {
                    self.began = self.now();
                }
            }
        }
        self.settle_sections();
        self.committed = self.steps.len();
        self.committed_path_segments = self.first_path_segment + self.path_segments.len() as u64;
        if let Activity::Stopping { search, .. } = &mut self.activity {
            // That was the shortest stop; a plan from the rest comes after it.
            *search = StopSearch::Found;
            self.request_replacement();
        }
    }

    /// The replacement for that cycle is in time. Who rests since before can begin whenever it comes.
    fn can_take_over(&self, takeover: u64) -> bool {
        let rests = self.committed == 0 && self.place.mark.is_none() && takeover >= self.rested;
        takeover >= self.cycle || rests
    }

    /// The replacement came too late: another one is asked for in the next cycle.
    fn refuse_replacement(&mut self, takeover: u64) {
        if takeover > 0 {
            // From a planner that is slow, further ahead.
            let most = (LONGEST_LEAD / self.period) as u64;
            self.lead = (2 * self.lead).min(most.max(self.lead));
        } else if let Activity::Stopping {
            search: StopSearch::Sought { since, .. },
            ..
        } = self.activity
        {
            // None was found. The planner is awake, and asked again.
            self.search_from(self.unanswered(), since);
        }
        self.request_replacement();
        self.refused = Some(self.cycle);
    }

    /// The uncommitted steps follow the committed ones from that cycle on.
    fn take_over(&mut self, takeover: u64) {
        let cycle = takeover.max(self.cycle);
        let (step, _) = self.step_at(cycle);
        let keep = self.cut(cycle);
        self.steps.drain(keep..self.committed);
        self.lead = first_lead(self.period);
        self.number = -(keep as i64);
        // What the old plan has come to rest with may end at a speed of nothing but rounding.
        let under_way = keep > step
            && matches!(self.steps[step], Step::JerkSegment(p) if p.at(p.duration).1 > 0.0);
        if let Some(Step::Section { moving, .. }) = self.steps.get_mut(keep) {
            *moving = under_way;
        }
        if keep == 0 {
            self.began = self.now();
        }
    }

    /// The plan is to be replaced: nothing more of it is taken.
    pub(super) fn request_replacement(&mut self) {
        let over = matches!(
            self.activity,
            Activity::Ended
                | Activity::Stopping {
                    search: StopSearch::Found,
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
        let path_segments = self
            .committed_path_segments
            .saturating_sub(self.first_path_segment);
        self.path_segments.truncate(path_segments as usize);
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
            Some(Step::JerkSegment(segment)) if index < self.committed => {
                segment.duration = t;
                index + 1
            }
            // A dwell is not cut short.
            Some(Step::Dwell { .. }) if index < self.committed => index + 1,
            _ => index,
        }
    }
}
