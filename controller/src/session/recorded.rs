//! A session once more: the commands that took effect in it, each handed in in its cycle.

use super::{Accepted, Session};
use crate::run::Timeline;
use std::collections::VecDeque;

/// The commands of a recorded session that have not been handed in.
#[derive(Clone, Debug, Default)]
pub struct Recorded(VecDeque<Accepted>);

impl Recorded {
    /// The commands in the order in which they took effect.
    #[must_use]
    pub fn new(accepted: impl IntoIterator<Item = Accepted>) -> Self {
        Self(accepted.into_iter().collect())
    }

    /// Hands in what took effect up to `cycle`, whose setpoints are next, in the name of whoever commanded
    /// it and in the order in which it did.
    pub fn hand_in<T: Timeline>(&mut self, session: &mut Session<T>, cycle: u64) {
        while let Some(accepted) = self.0.front()
            && accepted.cycle <= cycle
        {
            session.repeat(accepted.clone());
            self.0.pop_front();
        }
    }

    /// How many are left, and the cycle of the first.
    #[must_use]
    pub fn left(&self) -> Option<(u64, usize)> {
        let Accepted { cycle, .. } = self.0.front()?;
        Some((*cycle, self.0.len()))
    }
}
