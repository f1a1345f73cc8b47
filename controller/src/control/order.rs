//! What the session, or the program's feeder, orders.

use super::{Controller, Event, Phase};
use crate::machine::COORDINATES;
use std::mem::take;
use syncline_trajectory::limits::{Limits, PositionLimits};
use syncline_trajectory::path::{Jog, JogError, Overrides, Travel};

/// An order to the controller; it is obeyed in the next cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Order<const N: usize = COORDINATES> {
    /// Ends a pause: program stop, tool change.
    CycleStart,
    /// Rests on the path.
    FeedHold,
    /// Ends a feed hold, also one that a single block came to.
    Resume,
    /// [`Order::Resume`] while held, otherwise, also at rest for want of speed, [`Order::FeedHold`].
    ToggleFeedHold,
    /// Whether the path rests at the end of every block.
    SingleBlock(bool),
    /// Whether the program waits for an operator at M1.
    OptionalStop(bool),
    /// Goes back to the beginning of the block and rests there.
    Retrace,
    /// Moves axes while the path rests: held, or at a pause.
    Jog(Jog<N>),
    /// Part of the programmed feeds, 0…2.
    FeedOverride(f64),
    /// Part of the rapids' speed, 0…1.
    RapidOverride(f64),
    /// Stops on the path and ends the run.
    Interrupt,
    /// The program cannot go on.
    Abandon,
}

impl<const N: usize> Controller<N> {
    /// Does what is ordered.
    pub fn obey(&mut self, order: Order<N>) {
        match order {
            Order::CycleStart => self.go_on(),
            Order::FeedHold => self.executor.feed_hold(),
            Order::Resume => self.executor.resume(),
            Order::ToggleFeedHold => {
                if self.executor.is_held() && !self.executor.wants_speed() {
                    self.executor.resume();
                } else {
                    self.executor.feed_hold();
                }
            }
            Order::SingleBlock(on) => self.executor.set_single_block(on),
            Order::OptionalStop(on) => self.optional_stop = on,
            Order::Retrace => {
                // A pause that is told comes again when the path has come back to it.
                if take(&mut self.pause_told) {
                    self.tell(Event::Retracing);
                }
                self.executor.retrace();
            }
            Order::Jog(jog) => self.jog(jog),
            Order::FeedOverride(feed) => {
                let overrides = self.executor.overrides();
                (self.executor).set_overrides(Overrides { feed, ..overrides });
            }
            Order::RapidOverride(rapid) => {
                let overrides = self.executor.overrides();
                (self.executor).set_overrides(Overrides { rapid, ..overrides });
            }
            Order::Interrupt => self.interrupt(),
            Order::Abandon => self.abandon(),
        }
    }

    /// Moves axes inside their soft limits; what cannot be is told.
    fn jog(&mut self, jog: Jog<N>) {
        let mut travel = [None; N];
        for axis in &self.layout.axes {
            let limits = &axis.limits;
            let (min, max) = limits.position;
            travel[axis.coordinate] = Some(Travel {
                limits: Limits::symmetric(limits.velocity, limits.acceleration, limits.jerk),
                bounds: PositionLimits { min, max },
            });
        }
        let mut taken = Err(JogError::Moving);
        if self.phase == Phase::Program {
            taken = self.executor.jog(jog, &travel);
        }
        if let Err(error) = taken {
            self.tell(Event::NoJog(error));
        }
    }
}
