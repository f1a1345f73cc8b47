//! Program stops (M0, M1, M6, single block) where nobody is there to go on.

use super::{Command, Event, NotTaken, Operator};
use crate::control;

/// An operator who goes on at every program stop at once.
#[derive(Debug)]
pub struct PassesStops(Operator);

impl PassesStops {
    /// In the name of an operator.
    #[must_use]
    pub const fn new(operator: Operator) -> Self {
        Self(operator)
    }

    /// Goes on if the event is a program stop.
    ///
    /// # Errors
    /// The session does not take the command.
    pub fn hear(&self, event: &Event) -> Result<(), NotTaken> {
        if let Event::Machine(control::Event::Paused { .. }) = event {
            self.0.command(Command::CycleStart)?;
        }
        Ok(())
    }
}
