//! A recorded run with its jobs: the log, and what of their plans is fed in which wake-up.

use super::log::Log;
use super::state::{State, Waits};
use super::{Difference, Operators, PATIENCE};
use crate::control::{Instruction, Wake};
use crate::machine::COORDINATES;
use crate::program::ProgramError;
use crate::run::inline_planning::InlinePlanning;
use std::collections::VecDeque;
use std::mem::take;
use syncline_canopen::Instant;

/// A log with the jobs of the machine that it is of.
pub(super) struct Recording {
    pub(super) log: Log,
    pub(super) operators: Operators,
    pub(super) planning: InlinePlanning,
    pub(super) tape: Tape,
}

impl std::fmt::Debug for Recording {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Recording")
            .field("frames", &self.log.frames.len())
            .finish_non_exhaustive()
    }
}

/// What the job that is planned feeds to the cycle, kept for as long as a trial may want it again.
#[derive(Default)]
pub(super) struct Tape {
    kept: VecDeque<Instruction<COORDINATES>>,
    /// Place of the first that is kept.
    first: usize,
}

/// What a cycle of a replay came to.
pub(super) enum Step {
    GoesOn,
    Ended,
    Differs(Difference),
}

impl Recording {
    /// One cycle: both wake-ups.
    pub(super) fn cycle(&mut self, state: &mut State) -> Result<Step, ProgramError> {
        let cycle = state.cycle;
        loop {
            let step = self.wake(state)?;
            if !matches!(step, Step::GoesOn) || state.cycle > cycle {
                return Ok(step);
            }
        }
    }

    /// One wake-up.
    pub(super) fn wake(&mut self, state: &mut State) -> Result<Step, ProgramError> {
        let Some(wake) = state.controller.next_wake() else {
            // What it sent last is still to come.
            let until = state.last_wake + PATIENCE * self.log.layout.cycle;
            let taken = self.log.take(state, self.log.until(until));
            let missing = taken.or_else(|| state.overdue(until));
            return Ok(missing.map_or(Step::Ended, |missing| {
                Step::Differs(missing.in_state(state))
            }));
        };
        let due = wake.at();
        let last = self.log.frames.last().map_or(due, |last| last.at);
        // A machine may come to its end without a word.
        if due > last + self.log.layout.cycle && !state.is_met() {
            return Ok(Step::Ended);
        }
        state.last_wake = due;
        match wake {
            Wake::Sync(_) => {
                self.log.sync(state, due);
                Ok(Step::GoesOn)
            }
            Wake::Setpoint(_) => {
                let fed = self.attend(state, due);
                if fed.is_err() && !self.planning.is_at_work() {
                    state.controller.abandon();
                }
                let differs = self.log.setpoints(state, due);
                if !self.log.is_simulated() {
                    self.replan(state);
                }
                state.cycle += 1;
                match differs {
                    Some(difference) => Ok(Step::Differs(difference)),
                    None => fed.map(|()| Step::GoesOn),
                }
            }
        }
    }

    /// Feeds the plan, and does for operators what they did where nobody recorded it.
    fn attend(&mut self, state: &mut State, due: Instant) -> Result<(), ProgramError> {
        if let Some(job) = state.controller.job()
            && state.controller.ready().is_some()
            && state.job.replace(job.number) != Some(job.number)
        {
            state.instruction = 0;
            if self.planning.begin(&state.controller)? {
                self.tape = Tape::default();
            }
            state.waits = Waits::No;
            let cycles = self.rest(state, due, Waits::No)?;
            state.waits = Waits::ForPlan(cycles);
        }
        if take(&mut state.paused) && self.operators == Operators::Unknown {
            let cycles = self.rest(state, due, Waits::ForOperator(0))?;
            state.waits = Waits::ForOperator(cycles);
        }
        match &mut state.waits {
            Waits::ForPlan(0) => state.waits = Waits::No,
            Waits::ForOperator(0) => {
                state.waits = Waits::No;
                state.controller.go_on();
            }
            Waits::ForPlan(cycles) | Waits::ForOperator(cycles) => *cycles -= 1,
            Waits::No => {}
        }
        self.planning.tell_found(&state.controller);
        if self.log.is_simulated() {
            self.replan(state);
        }
        if state.waits == Waits::No {
            while state.controller.room() > 0
                && let Some(instruction) = self.instruction(state.instruction)?
            {
                state.controller.accept(instruction);
                state.instruction += 1;
            }
        }
        Ok(())
    }

    /// Has the plan replaced where what operators did wants that: at the instant at which the cycle
    /// asked for it.
    fn replan(&mut self, state: &State) {
        if !state.trial
            && self.operators == Operators::Recorded
            && let Some(feeder) = self.planning.feeder()
            && let Some(request) = state.controller.replan_request()
            && feeder.replan(&request)
        {
            self.tape.cut(state.instruction);
        }
    }

    /// The instruction at a place of the tape.
    fn instruction(
        &mut self,
        place: usize,
    ) -> Result<Option<Instruction<COORDINATES>>, ProgramError> {
        let Some(feeder) = self.planning.feeder() else {
            return Ok(None);
        };
        while self.tape.end() <= place {
            let Some(instruction) = feeder.next_instruction()? else {
                return Ok(None);
            };
            self.tape.kept.push_back(instruction);
        }
        Ok(self.tape.kept.get(place - self.tape.first).copied())
    }
}

impl Tape {
    /// The place behind the last instruction.
    fn end(&self) -> usize {
        self.first + self.kept.len()
    }

    /// What comes from `place` on is planned anew.
    fn cut(&mut self, place: usize) {
        self.kept.truncate(place - self.first);
    }

    /// Nobody will want instructions before `place` again.
    pub(super) fn forget(&mut self, place: usize) {
        while self.first < place && self.kept.pop_front().is_some() {
            self.first += 1;
        }
    }
}
