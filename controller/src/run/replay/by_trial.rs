//! What operators did, and when the plan came, where nobody recorded it: it is found by trial, from what
//! setpoints the log has.

use super::PATIENCE;
use super::recording::{Recording, Step};
use super::state::{State, Waits};
use crate::program::ProgramError;
use std::collections::VecDeque;
use syncline_canopen::Instant;

/// Cycles from an interruption until it shows, at most.
const LATENCY: u64 = 24;

impl Recording {
    /// The latest cycle an interruption in which explains what the log has until beyond
    /// `difference`, with the state there.
    pub(super) fn interruption(
        &mut self,
        checkpoints: &VecDeque<State>,
        difference: u64,
    ) -> Result<Option<(u64, State)>, ProgramError> {
        for cycle in (difference.saturating_sub(LATENCY)..=difference).rev() {
            let Some(before) = checkpoints.iter().find(|state| state.cycle <= cycle) else {
                break;
            };
            let mut state = before.trial();
            let mut agrees = true;
            while agrees && state.cycle < difference + u64::from(2 * PATIENCE) {
                if state.cycle == cycle {
                    state.controller.interrupt();
                }
                match self.cycle(&mut state)? {
                    Step::GoesOn => {}
                    Step::Ended => break,
                    Step::Differs(_) => agrees = false,
                }
            }
            if agrees {
                state.trial = false;
                // Most of it was told before.
                state.told.clear();
                return Ok(Some((cycle, state)));
            }
        }
        Ok(None)
    }

    /// How many cycles the machine, at rest now, rests before `then`: as many as the log's
    /// setpoints stay, less those that the plan takes to show in them.
    pub(super) fn rest(
        &mut self,
        state: &State,
        due: Instant,
        then: Waits,
    ) -> Result<u64, ProgramError> {
        let Some(moves) = self.log.next_change(state.next) else {
            return Ok(u64::MAX);
        };
        let still = moves.saturating_since(due).as_nanos() / self.log.layout.cycle.as_nanos();
        let mut trial = state.trial();
        trial.waits = then;
        for cycles in 0..=still as u64 {
            let ended = matches!(self.cycle(&mut trial)?, Step::Ended);
            if ended || trial.paused {
                return Ok(0);
            }
            let aims = |of: &State| {
                of.burst
                    .iter()
                    .map(|it| self.log.aim(*it))
                    .collect::<Vec<_>>()
            };
            if aims(&trial) != aims(state) {
                return Ok((still as u64).saturating_sub(cycles));
            }
        }
        Ok(0)
    }
}
