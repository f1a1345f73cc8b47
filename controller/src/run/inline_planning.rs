//! Programs' way into a cycle whose time is not the host's: they are planned where the cycle takes
//! them, so that the same machine, programs and commands give the same motion.

use super::{CycleReport, RunError, Work};
use crate::control::{Controller, Outcome};
use crate::machine::COORDINATES;
use crate::program::{Feeder, ProgramError};
use std::collections::VecDeque;

/// The jobs of a timeline, one after the other.
#[derive(Default)]
pub(super) struct InlinePlanning {
    /// Jobs that have not begun.
    work: VecDeque<Work>,
    /// The job that is planned.
    planned: Option<(u64, Feeder)>,
    /// The last job that was reported to be over.
    over: Option<u64>,
}

impl InlinePlanning {
    /// Hands over a job; it waits for its begin.
    pub(super) fn prepare(&mut self, work: Work) {
        self.work.push_back(work);
    }

    /// Begins the controller's job where the machine stands, as soon as it is ready for it; whether it
    /// began now. A job that cannot begin is not planned.
    ///
    /// # Errors
    /// Why it cannot begin; told once.
    pub(super) fn begin(
        &mut self,
        controller: &Controller<COORDINATES>,
    ) -> Result<bool, ProgramError> {
        let (Some(job), Some(start)) = (controller.job(), controller.ready()) else {
            return Ok(false);
        };
        if (self.planned.as_ref()).is_some_and(|(number, _)| *number == job.number) {
            return Ok(false);
        }
        self.planned = None;
        self.work.retain(|work| work.number >= job.number);
        let Some(Work {
            number,
            program,
            upcoming,
        }) = self.work.pop_front()
        else {
            return Ok(false);
        };
        program.check(start)?;
        self.planned = Some((number, program.feeder(start, upcoming)?));
        Ok(true)
    }

    /// Tells the job that is planned what came of its probing or homing, and what the inputs and outputs are that it reads.
    pub(super) fn tell_found(&mut self, controller: &Controller<COORDINATES>) {
        let Some(feeder) = self.feeder() else {
            return;
        };
        if let Some(found) = controller.found() {
            feeder.found(found);
        }
        if let Some(levels) = controller.signals_read() {
            feeder.signals_read(levels);
        }
    }

    /// The job that is planned.
    pub(super) fn feeder(&mut self) -> Option<&mut Feeder> {
        self.planned.as_mut().map(|(_, feeder)| feeder)
    }

    /// Whether a job is planned.
    pub(super) fn is_at_work(&self) -> bool {
        self.planned.is_some()
    }

    /// Reports a job that is over, once, with what it has left if it finished.
    ///
    /// # Errors
    /// What it changed in the tables cannot be written.
    pub(super) fn report_over(
        &mut self,
        controller: &Controller<COORDINATES>,
        report: &mut dyn FnMut(CycleReport),
    ) -> Result<(), RunError> {
        let Some((job, outcome)) = controller.over() else {
            return Ok(());
        };
        if self.over.replace(job) == Some(job) {
            return Ok(());
        }
        let planned = self.planned.take_if(|(number, _)| *number == job);
        let finished = planned.filter(|_| outcome == Outcome::Finished);
        let (left, kept) = finished.map(|(_, feeder)| feeder.finish()).unzip();
        report(CycleReport::JobOver { job, outcome, left });
        kept.unwrap_or(Ok(()))?;
        Ok(())
    }
}
