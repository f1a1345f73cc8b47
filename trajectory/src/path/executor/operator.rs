//! What an operator does with the path: overrides, feed hold, single block, retrace, jogging, the stop.
//!
//! Each acts on what is committed at once and asks for a plan that goes with it.

use super::activity::{Activity, Next, StopSearch};
use super::{Executor, Setpoint, Step, part};
use crate::path::Overrides;
use crate::path::jog::{Jog, JogError, Jogging, Leg, Retraction, Travel};
use crate::profile::State;

impl<const N: usize> Executor<N> {
    /// From now on these parts of the programmed speeds are asked for; values outside of the ranges
    /// are brought into them, to rest where they are next to nothing or no number.
    pub fn set_overrides(&mut self, overrides: Overrides) {
        let overrides = Overrides {
            feed: part(overrides.feed, 2.0),
            rapid: part(overrides.rapid, 1.0),
        };
        if overrides != self.overrides {
            // A rest for want of speed ends; one that an operator asked for does not, and what ends it
            // has the path planned anew.
            let asked = self.rests_at_hold() && !self.wants_speed();
            if !asked {
                self.leave_hold();
            }
            if overrides.rapid != self.overrides.rapid
                && let Activity::Jogging { axes, .. } = &mut self.activity
            {
                axes.change_speed();
            }
            self.overrides = overrides;
            if !asked {
                self.request_replacement();
            }
        }
    }

    /// From now on feeds [by turns](crate::path::Feed::PerTurn) are at so many turns a second, above 0; `None`: at those
    /// that each was programmed with. It is asked for by a plan, so that it is to change in steps that are worth one.
    pub fn set_turns(&mut self, turns: Option<f64>) {
        if turns == self.turns {
            return;
        }
        self.turns = turns;
        // What ends a rest has the path planned anew.
        if !self.rests_at_hold() {
            self.request_replacement();
        }
    }

    /// How many turns a second are planned for the feed by turns with which the path moves; `None`: it rests, or moves with
    /// another feed.
    pub fn planned_turns(&self) -> Option<f64> {
        let programmed = self.path_segments.front().filter(|_| self.moves())?.turns?;
        Some(self.turns.unwrap_or(programmed))
    }

    /// What parts of the programmed speeds are asked for.
    pub fn overrides(&self) -> Overrides {
        self.overrides
    }

    /// Comes to rest on the path as soon as the limits allow and waits for
    /// [`resume`](Self::resume). Effective from the current cycle on; the next setpoints lead to
    /// rest. A dwell is rest already, and its time goes on.
    ///
    /// On a line that is the closed form. On curves the [`replan_request`](Self::replan_request) asks the planner
    /// for the hardest braking that the axes allow, and where it does not answer in time one is
    /// searched for here, over several cycles; until there is one the plan, which ends at rest, too,
    /// is followed.
    pub fn feed_hold(&mut self) {
        let rests = self.rests_at_hold();
        match &mut self.activity {
            Activity::Jogging { axes, next } => {
                axes.hold();
                if *next != Next::End {
                    *next = Next::Hold;
                }
            }
            // To turn it comes to rest already.
            Activity::Stopping {
                next: next @ (Next::Follow | Next::Retrace { .. }),
                ..
            } => {
                *next = Next::Hold;
                self.request_replacement();
            }
            Activity::Following | Activity::Retracing { .. } if rests => {
                self.activity = Activity::Holding;
            }
            Activity::Following | Activity::Retracing { .. } => {
                self.request_replacement();
                self.stop_for(Next::Hold);
            }
            Activity::Stopping { .. } | Activity::Holding | Activity::Ended => {}
        }
    }

    /// Ends a [`feed_hold`](Self::feed_hold), also one that a [single block](Self::set_single_block) came
    /// to.
    pub fn resume(&mut self) {
        if self.activity.ends() {
            return;
        }
        if let Activity::Jogging { .. } = self.activity {
            self.return_to_path(Next::Follow);
        } else if self.is_held() || self.retraces() {
            self.turn_to(Next::Follow);
        }
    }

    /// Comes to rest, goes back along the path to the beginning of the block, or from there to that
    /// of the block before, and waits for [`resume`](Self::resume). On the way back it changes
    /// nothing.
    pub fn retrace(&mut self) {
        let under_way = self.retraces() && !self.is_held();
        if self.activity.ends() || under_way {
            return;
        }
        let next = Next::Retrace {
            asked: self.revision + 1,
        };
        if let Activity::Jogging { .. } = self.activity {
            self.return_to_path(next);
            return;
        }
        self.turn_to(next);
    }

    /// Goes back along the path, or rests where that led, until [`resume`](Self::resume).
    pub fn retraces(&self) -> bool {
        self.activity.retraces()
    }

    /// Ends a rest that the plan came to.
    fn leave_hold(&mut self) {
        if self.rests_at_hold() {
            self.finish_step(Step::Hold, 0.0);
        }
    }

    /// Follows or retraces the path from where it is: at once where it moves that way already, otherwise
    /// it comes to rest before.
    fn turn_to(&mut self, turn: Next) {
        let back = matches!(turn, Next::Retrace { .. });
        if back && self.place.mark.take().is_some() {
            // It comes again, also where nothing leads back: the path is before it.
            self.place.item = self.place.item.and_then(|item| item.checked_sub(1));
        }
        self.leave_hold();
        if self.moves() && self.place.backward == back {
            self.activity = turn.into();
        } else if let Activity::Stopping {
            search: StopSearch::Found,
            next,
        } = &mut self.activity
        {
            *next = turn;
        } else {
            self.stop_for(turn);
        }
        self.request_replacement();
    }

    /// While this is on, the path comes to rest at the end of every block, or of the first one behind it
    /// where that is possible, and waits for [`resume`](Self::resume). What is held, retraces or jogs
    /// goes by it once it goes on.
    pub fn set_single_block(&mut self, on: bool) {
        if on == self.single_block {
            return;
        }
        self.single_block = on;
        let follows = matches!(
            self.activity,
            Activity::Following
                | Activity::Stopping {
                    next: Next::Follow,
                    ..
                }
        );
        if follows && !self.rests_at_hold() {
            self.request_replacement();
        } else if follows && !on {
            // It rests because that was asked for, and goes on when it is asked for.
            self.activity = Activity::Holding;
        }
    }

    /// Whether [`set_single_block`](Self::set_single_block) is on.
    pub fn is_single_block(&self) -> bool {
        self.single_block
    }

    /// Rests, or is coming to rest, until [`resume`](Self::resume).
    pub fn is_held(&self) -> bool {
        !self.activity.returns() && (self.activity.holds() || self.rests_at_hold())
    }

    /// Rests because nothing is left of the programmed speed; nobody asked for it.
    pub fn wants_speed(&self) -> bool {
        let free = matches!(self.activity, Activity::Following) && !self.single_block;
        free && self.rests_at_hold()
    }

    /// Nothing of the path is missing: what is committed leads to a rest that somebody has to end.
    pub fn leads_to_hold(&self) -> bool {
        let last = self.committed.checked_sub(1);
        let last = last.and_then(|last| self.steps.get(last));
        !self.plan.is_replaced() && matches!(last, Some(Step::Hold))
    }

    /// Comes to rest on the path as soon as the limits allow, as [`feed_hold`](Self::feed_hold) does, also by
    /// what a planner answers, and drops the rest of the plan for good.
    pub fn stop(&mut self) {
        if self.activity.ends() {
            return;
        }
        match &mut self.activity {
            // The stop is searched for already, or followed.
            Activity::Stopping { search, next } => {
                *next = Next::End;
                if *search == StopSearch::Found {
                    self.drop_uncommitted();
                }
            }
            Activity::Jogging { axes, next } => {
                axes.hold();
                *next = Next::End;
                self.drop_plan();
            }
            _ => {
                self.request_replacement();
                self.stop_for(Next::End);
            }
        }
        if self.committed == 0 {
            self.forget_path();
        }
    }

    /// Comes to rest from the motion of a setpoint that need not be on the path, inside the axes' limits and travels,
    /// and leaves the path for good.
    pub fn stop_beside(&mut self, from: &Setpoint<N>, travel: &[Option<Travel>; N]) {
        let states = std::array::from_fn(|axis| State {
            p: from.position[axis],
            v: from.velocity[axis],
            a: from.acceleration[axis],
        });
        let axes = Jogging::stopping(states, self.period, travel);
        let next = Next::End;
        self.activity = Activity::Jogging { axes, next };
        self.drop_plan();
    }

    /// Nothing is left of the plan.
    fn drop_plan(&mut self) {
        self.drop_uncommitted();
        self.steps.clear();
        self.forget_path();
        self.committed = 0;
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
        let rests = (self.is_idle() || self.is_held() && !self.moves()) && !self.is_settling();
        if self.activity.ends() || !rests && !self.is_off_path() {
            return Err(JogError::Moving);
        }
        let new = || Jogging::new(self.place.position, self.period, travel);
        let mut axes = self.activity.jogging().copied().unwrap_or_else(new);
        axes.allow(travel);
        axes.order(jog, self.overrides.rapid)?;
        if let Activity::Following | Activity::Retracing { .. } = self.activity {
            self.request_replacement();
        }
        let next = Next::Hold;
        self.activity = Activity::Jogging { axes, next };
        Ok(())
    }

    /// Whether an axis is jogged on and on ([`Jog::Continuous`]), and no order has stopped it.
    pub fn is_jogged_on(&self, axis: usize) -> bool {
        let jogging = self.activity.jogging();
        jogging.is_some_and(|axes| axes.is_continuous(axis))
    }

    /// Where an axis rests that a jog has taken there; `None` while it moves, and of one that was stopped on its way.
    pub fn jogged_to(&self, axis: usize) -> Option<f64> {
        self.activity.jogging()?.reached(axis)
    }

    /// Brings an axis to rest that is jogged on and on, whatever the rapid override; any other does what it
    /// did.
    pub fn end_jog(&mut self, axis: usize) {
        if let Activity::Jogging { axes, .. } = &mut self.activity {
            axes.end_continuous(axis);
        }
    }

    /// Jogging has moved the axes off the path, and they are not back yet.
    pub fn is_off_path(&self) -> bool {
        self.activity.jogging().is_some()
    }

    /// Axes off the path move, or are about to.
    pub fn is_jogged(&self) -> bool {
        let jogging = self.activity.jogging();
        jogging.is_some_and(|axes| !axes.rests())
    }

    /// From now on axes that were jogged go back to the path with that, leg by leg: they rest after each for
    /// [`resume`](Self::resume) or [`retrace`](Self::retrace), and behind the last the path goes on. `None`: on a
    /// straight line, at once.
    ///
    /// # Panics
    /// There is no such axis.
    pub fn set_retraction(&mut self, retraction: Option<Retraction>) {
        assert!(retraction.is_none_or(|it| it.axis < N));
        self.retraction = retraction;
    }

    /// The next leg of the way back to the path, which somebody has to begin.
    pub fn next_leg(&self) -> Option<Leg<N>> {
        let rests = |axes: &&Jogging<N>| self.activity.holds() && axes.rests();
        let axes = self.activity.jogging().filter(rests)?;
        axes.next_leg(self.retraction.as_ref()?)
    }

    /// The axes go back to the path, for that.
    fn return_to_path(&mut self, then: Next) {
        if let Activity::Jogging { axes, next } = &mut self.activity {
            // They may be on their way for something else already.
            if *next == Next::Hold {
                axes.go_home(self.retraction);
            }
            *next = then;
        }
    }

    /// Nothing moves, and nothing is going to without an order or a plan.
    pub fn is_at_rest(&self) -> bool {
        let jogging = self.activity.jogging();
        self.committed == 0 && jogging.is_none_or(Jogging::rests)
    }

    /// Goes on with what the axes came back for, or rests behind a leg of the way there.
    pub(super) fn come_back(&mut self) {
        if let Activity::Jogging { axes, next } = &mut self.activity
            && matches!(next, Next::Follow | Next::Retrace { .. })
            && axes.rests()
        {
            let then = std::mem::replace(next, Next::Hold);
            if axes.is_home() {
                self.activity = Activity::Holding;
                self.turn_to(then);
            }
        }
    }
}
