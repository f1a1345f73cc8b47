//! A machine in virtual time: the real controller against simulated drives.

use super::driver::Driver;
use super::frames::SharedFrames;
use crate::control::{Controller, Event, Layout, Row};
use crate::machine::{COORDINATES, Machine};
use crate::port::sim::{SimPort, Simulated};
use crate::port::{Port, PortError};
use crate::program::{Feeder, Moves, Program, ProgramError, Upcoming};
use std::sync::Arc;
use syncline_canopen::Instant;
use syncline_drives::world::{Observer, World};

/// A machine of simulated drives and the controller, with a program to run.
///
/// The same machine, program and seed give the same frames, byte for byte.
pub struct VirtualMachine<P = SimPort> {
    driver: Driver<COORDINATES, P>,
    frames: SharedFrames,
    program: Program,
    /// Until the program starts.
    upcoming: Option<Upcoming>,
    feeder: Option<Feeder>,
    moves: Moves,
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
        let frames = SharedFrames::new(machine);
        let observers =
            (0..machine.buses.len()).map(|bus| Some(Box::new(frames.observer(bus)) as Observer));
        let simulated = Simulated::new(machine, seed, observers, |_, _| ())?;
        let ports = simulated.buses.iter().flatten();
        let ports = ports.map(|bus| SimPort::new(*bus)).collect();
        Ok(Self::on(simulated.world, ports, layout, program, frames))
    }
}

impl<P: Port> VirtualMachine<P> {
    /// A machine on ports of the caller's, one a bus of `world`, whose buses tell `frames` what
    /// they carry.
    #[must_use]
    pub fn on(
        world: World,
        ports: Vec<P>,
        layout: Arc<Layout>,
        program: Program,
        frames: SharedFrames,
    ) -> Self {
        let (upcoming, moves) = Moves::new();
        Self {
            driver: Driver::new(layout, world, ports, Instant::ZERO),
            frames,
            program,
            upcoming: Some(upcoming),
            feeder: None,
            moves,
            now: Instant::ZERO,
        }
    }

    /// Goes on to the next wake-up; false once the machine is at its end.
    ///
    /// # Errors
    /// If the program turns out not to run; the machine comes to its end all the same when this
    /// is called further.
    pub fn step(&mut self) -> Result<bool, RunError> {
        let Some(next) = self.driver.controller.next_wake() else {
            return Ok(false);
        };
        self.now = next.at();
        let fed = self.feed();
        if fed.is_err() && self.feeder.is_none() {
            self.driver.controller.abandon();
        }
        self.driver.step(self.now)?;
        fed?;
        Ok(true)
    }

    /// Keeps the controller's plan full.
    fn feed(&mut self) -> Result<(), ProgramError> {
        let controller = &mut self.driver.controller;
        if let Some(start) = controller.ready()
            && let Some(upcoming) = self.upcoming.take()
        {
            self.program.check(start)?;
            self.feeder = Some(self.program.feeder(start, upcoming)?);
        }
        let Some(feeder) = &mut self.feeder else {
            return Ok(());
        };
        if let Some(request) = controller.replan_request() {
            feeder.replan(&request);
        }
        while controller.room() > 0
            && let Some(instruction) = feeder.next_instruction()?
        {
            controller.accept(instruction);
        }
        Ok(())
    }

    /// The controller.
    pub fn controller(&mut self) -> &mut Controller<COORDINATES> {
        &mut self.driver.controller
    }

    /// The next thing worth a line in the log.
    pub fn event(&mut self) -> Option<Event> {
        self.driver.controller.event()
    }

    /// What happened at the last SYNC, after a step that supervised, and the program's moves that
    /// are not passed yet.
    pub fn row(&mut self) -> (Option<&Row<COORDINATES>>, &mut Moves) {
        (self.driver.controller.row(), &mut self.moves)
    }

    /// The port of the bus with this index, to interfere with it.
    pub fn bus(&mut self, bus: usize) -> &mut P {
        &mut self.driver.ports[bus]
    }

    /// The simulated world, to look at it and to interfere with it.
    pub fn world(&mut self) -> &mut World {
        &mut self.driver.world
    }

    /// Virtual time.
    #[must_use]
    pub fn now(&self) -> Instant {
        self.now
    }

    /// What the buses carry.
    #[must_use]
    pub fn frames(&self) -> &SharedFrames {
        &self.frames
    }
}
