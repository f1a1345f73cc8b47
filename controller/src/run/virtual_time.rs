//! A machine in virtual time: the real controller against simulated drives.

use super::frames::FrameLog;
use super::{Failure, is_setpoint, receive, wake};
use crate::control::{Controller, Event, Layout, Phase, Row};
use crate::machine::Machine;
use crate::port::sim::SimPort;
use crate::port::{Outbox, PortError};
use crate::program::{COORDINATES, Feeder, Program, ProgramError};
use std::sync::{Arc, Mutex, PoisonError};
use syncline_canopen::Instant;

/// A machine of simulated drives and the controller, with a program to run.
///
/// The same machine, program and seed give the same frames, byte for byte.
pub struct VirtualMachine {
    controller: Controller<COORDINATES>,
    ports: Vec<SimPort>,
    outboxes: Vec<Outbox>,
    frames: Arc<Mutex<FrameLog>>,
    program: Program,
    feeder: Option<Feeder>,
    now: Instant,
}

/// Why a virtual run broke off.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// A bus cannot be simulated.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The program cannot be run from where the machine stands.
    #[error(transparent)]
    Program(#[from] ProgramError),
}

impl VirtualMachine {
    /// A machine that has just been switched on.
    ///
    /// # Errors
    /// If a bus cannot be simulated.
    pub fn new(
        machine: &Machine,
        layout: Arc<Layout>,
        program: Program,
        seed: u64,
    ) -> Result<Self, PortError> {
        let frames = Arc::new(Mutex::new(FrameLog::new(machine)));
        let ports = (0..machine.buses.len())
            .map(|bus| {
                let frames = Arc::clone(&frames);
                SimPort::new(machine, bus, seed, move |frame| {
                    let mut frames = frames.lock().unwrap_or_else(PoisonError::into_inner);
                    frames.record(bus, frame);
                })
            })
            .collect::<Result<Vec<_>, _>>()?;
        Ok(Self {
            controller: Controller::new(layout, Instant::ZERO),
            outboxes: vec![Outbox::default(); ports.len()],
            ports,
            frames,
            program,
            feeder: None,
            now: Instant::ZERO,
        })
    }

    /// Goes on to the next wake-up; false once the machine is at its end.
    ///
    /// # Errors
    /// If the program turns out not to run; the machine comes to its end all the same when this
    /// is called further.
    pub fn step(&mut self) -> Result<bool, RunError> {
        let Some(next) = self.controller.next_wake() else {
            return Ok(false);
        };
        self.now = next.at();
        let mut fed = Ok(());
        if is_setpoint(next) {
            fed = self.feed();
            let received = receive(&mut self.controller, &mut self.ports, self.now);
            self.note(received)?;
        }
        if fed.is_err() {
            self.controller.abandon();
        }
        let sent = wake(
            &mut self.controller,
            &mut self.ports,
            &mut self.outboxes,
            self.now,
        );
        self.note(sent)?;
        fed?;
        Ok(true)
    }

    fn note(&mut self, outcome: Result<(), Failure>) -> Result<(), PortError> {
        outcome.map_err(|(bus, error)| {
            self.controller.bus_failed(bus);
            error
        })
    }

    /// Keeps the controller's plan full.
    fn feed(&mut self) -> Result<(), ProgramError> {
        if self.controller.phase() != Phase::Program {
            return Ok(());
        }
        if self.feeder.is_none()
            && let Some(start) = self.controller.ready()
        {
            self.program.check(start)?;
            self.feeder = Some(self.program.feeder(start)?);
        }
        let Some(feeder) = &mut self.feeder else {
            return Ok(());
        };
        while self.controller.room() > 0
            && let Some(instruction) = feeder.next_instruction()?
        {
            self.controller.accept(instruction);
        }
        Ok(())
    }

    /// The controller.
    pub fn controller(&mut self) -> &mut Controller<COORDINATES> {
        &mut self.controller
    }

    /// The next thing worth a line in the log.
    pub fn event(&mut self) -> Option<Event> {
        self.controller.event()
    }

    /// What happened at the last SYNC, after a step that supervised, and the program's moves that
    /// are not passed yet.
    pub fn row(&mut self) -> (Option<&Row<COORDINATES>>, Option<&mut Feeder>) {
        (self.controller.row(), self.feeder.as_mut())
    }

    /// The simulated bus with this index, to interfere with its drives.
    pub fn bus(&mut self, bus: usize) -> &mut SimPort {
        &mut self.ports[bus]
    }

    /// Virtual time.
    #[must_use]
    pub fn now(&self) -> Instant {
        self.now
    }

    /// What the buses carried: digest and peak utilisation.
    #[must_use]
    pub fn frames(&self) -> (String, Vec<f64>) {
        let mut frames = self.frames.lock().unwrap_or_else(PoisonError::into_inner);
        (frames.sha256(), frames.peak_utilisation())
    }
}
