//! What a person does with the path: overrides, feed hold, single block, retrace, jogs, the stop.
//!
//! Each acts on what is committed at once and asks for a plan that goes with it.

use std::mem::take;

use super::stop::Stop;
use super::{Executor, PlanStatus, Step, part};
use crate::path::Overrides;
use crate::path::jog::{Jog, JogError, Jogging, Then, Travel};

impl<const N: usize> Executor<N> {
    /// From now on these parts of the programmed speeds are asked for; values outside of the ranges
    /// are brought into them, to rest where they are next to nothing or no number.
    pub fn set_overrides(&mut self, overrides: Overrides) {
        let overrides = Overrides {
            feed: part(overrides.feed, 2.0),
            rapid: part(overrides.rapid, 1.0),
        };
        if overrides != self.overrides {
            // A rest for want of speed ends; one that a person asked for does not, and what ends it
            // has the path planned anew.
            let rests = matches!(self.current(), Some(Step::Hold));
            let asked = rests && !self.wants_speed();
            if rests && !asked {
                self.finish_step(Step::Hold, 0.0);
            }
            if overrides.rapid != self.overrides.rapid
                && let Some(jogging) = &mut self.jogging
            {
                jogging.change_speed();
            }
            self.overrides = overrides;
            if !asked {
                self.request_replacement();
            }
        }
    }

    /// What parts of the programmed speeds are asked for.
    pub fn overrides(&self) -> Overrides {
        self.overrides
    }

    /// Comes to rest on the path as soon as the limits allow and waits for
    /// [`resume`](Self::resume). Effective from the current cycle on; the next setpoints lead to
    /// rest. A dwell is broken off, and begins anew.
    ///
    /// On a line that is the closed form. On curves the [`replan_request`](Self::replan_request) asks the planner
    /// for a law that brakes as hard as the axes allow, and where it does not answer in time one is
    /// searched for here, over several cycles; until there is one the plan, which ends at rest, too,
    /// is followed.
    pub fn feed_hold(&mut self) {
        if let Some(jogging) = &mut self.jogging {
            jogging.hold();
            return;
        }
        let begun = self.held || self.stopped;
        let rests = matches!(self.current(), Some(Step::Hold));
        if rests {
            self.held |= !self.stopped;
        } else if !begun {
            self.request_replacement();
            self.held = true;
            // To turn it comes to rest already.
            if self.stop == Stop::No {
                self.begin_stop();
            }
        }
    }

    /// Ends a [`feed_hold`](Self::feed_hold), also one that a stop after the block came to.
    pub fn resume(&mut self) {
        if self.stopped {
            return;
        }
        let goes_on = take(&mut self.single_block);
        if let Some(jogging) = &mut self.jogging {
            jogging.go_home(Then::Resume);
            return;
        }
        if !(self.is_held() || self.retraces()) {
            if goes_on {
                self.request_replacement();
            }
            return;
        }
        self.retrace = None;
        self.leave_hold();
        if self.backward && self.stop != Stop::Found {
            self.begin_stop();
        } else if !self.backward {
            self.stop = Stop::No;
        }
        self.request_replacement();
    }

    /// Comes to rest, goes back along the path to the beginning of the block, or from there to that
    /// of the block before, and waits for [`resume`](Self::resume). On the way back it changes
    /// nothing.
    pub fn retrace(&mut self) {
        let under_way = self.retraces() && !self.is_held();
        if self.stopped || under_way {
            return;
        }
        if let Some(jogging) = &mut self.jogging {
            jogging.go_home(Then::Retrace);
            return;
        }
        self.single_block = false;
        // It comes again.
        self.mark = None;
        self.retrace = Some(self.revision + 1);
        self.leave_hold();
        if self.backward {
            self.stop = Stop::No;
        } else if self.stop != Stop::Found {
            self.begin_stop();
        }
        self.request_replacement();
    }

    /// Goes back along the path, or rests where that led, until [`resume`](Self::resume).
    pub fn retraces(&self) -> bool {
        self.retrace.is_some()
    }

    pub(super) fn leave_hold(&mut self) {
        self.held = false;
        if let Some(Step::Hold) = self.current() {
            self.finish_step(Step::Hold, 0.0);
        }
    }

    /// It has to come to rest before the new plan begins: that goes the other way.
    pub(super) fn turns(&self) -> bool {
        self.retraces() != self.backward && matches!(self.current(), Some(Step::JerkSegment(_)))
    }

    /// Comes to rest at the end of the block that is under way, or of the first one where that is
    /// possible, and waits for [`resume`](Self::resume). On the way back from a jog: of the block that
    /// then goes on.
    pub fn single_block(&mut self) {
        if let Some(jogging) = &self.jogging {
            self.single_block |= jogging.returns();
        } else if !self.is_held() && !self.retraces() {
            self.single_block = true;
            self.request_replacement();
        }
    }

    /// Rests, or is coming to rest, until [`resume`](Self::resume).
    pub fn is_held(&self) -> bool {
        let returns = self
            .jogging
            .as_ref()
            .is_some_and(|jogging| jogging.returns());
        !returns && (self.held || matches!(self.current(), Some(Step::Hold)))
    }

    /// Rests because nothing is left of the programmed speed; nobody asked for it.
    pub fn wants_speed(&self) -> bool {
        let asked = self.held || self.single_block || self.retrace.is_some();
        !asked && matches!(self.current(), Some(Step::Hold))
    }

    /// Nothing of the path is missing: what is committed leads to a rest that somebody has to end.
    pub fn leads_to_hold(&self) -> bool {
        let last = self.committed.checked_sub(1);
        let changes = self.plan != PlanStatus::Current;
        !changes && matches!(last.and_then(|last| self.steps.get(last)), Some(Step::Hold))
    }

    /// Comes to rest on the path as soon as the limits allow, as [`feed_hold`](Self::feed_hold) does, also by
    /// what a planner answers, and drops the rest of the plan for good.
    pub fn stop(&mut self) {
        if !self.stopped {
            self.stopped = true;
            self.held = false;
            match self.stop {
                Stop::No => {
                    self.request_replacement();
                    self.begin_stop();
                }
                // A hold looks for the way already, or is on it.
                Stop::Sought { .. } => {}
                Stop::Found => self.drop_uncommitted(),
            }
            if self.committed == 0 {
                self.spans.clear();
            }
            if let Some(jogging) = &mut self.jogging {
                jogging.hold();
            }
        }
    }

    /// Moves axes while the path rests: after a [`feed_hold`](Self::feed_hold), or where nothing is left of it;
    /// then nothing of it begins before [`resume`](Self::resume). That, and
    /// [`retrace`](Self::retrace), lead the axes back to where the path was left, on a straight
    /// line, before they take effect; [`feed_hold`](Self::feed_hold) and [`stop`](Self::stop) bring them to rest
    /// where they are. Whatever moves an order comes to, it is followed from the state of this cycle on.
    ///
    /// # Errors
    /// Why the order is refused; nothing changes then.
    pub fn jog(&mut self, jog: Jog<N>, travel: &[Option<Travel>; N]) -> Result<(), JogError> {
        let moves = matches!(self.current(), Some(Step::JerkSegment(_)));
        let rests = self.is_idle() || self.is_held() && !moves;
        if self.stopped || !rests && self.jogging.is_none() {
            return Err(JogError::Moving);
        }
        let new = || Jogging::new(self.rest, self.period, travel);
        let mut jogging = self.jogging.unwrap_or_else(new);
        jogging.order(jog, self.overrides.rapid)?;
        self.jogging = Some(jogging);
        if !self.held {
            self.request_replacement();
            self.held = true;
        }
        Ok(())
    }

    /// A person moved the axes away from the path, and they are not back yet.
    pub fn is_off_path(&self) -> bool {
        self.jogging.is_some()
    }

    /// Goes on with what the axes came back for.
    pub(super) fn come_back(&mut self) {
        let Some(then) = self.jogging.as_ref().and_then(Jogging::arrived) else {
            return;
        };
        self.jogging = None;
        match then {
            Then::Resume => {
                let stop = self.single_block;
                self.resume();
                if stop {
                    self.single_block();
                }
            }
            Then::Retrace => self.retrace(),
        }
    }
}
