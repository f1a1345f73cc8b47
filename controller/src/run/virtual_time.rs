//! A machine in virtual time: the real controller against simulated drives.

use super::driver::Driver;
use super::{CycleReport, Progress, RunError, Timeline};
use crate::control::{Controller, Layout, Order, Row};
use crate::machine::{COORDINATES, Machine};
use crate::observe::frames::SharedFrames;
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
    now: Instant,
    /// The last order that was obeyed and is not reported, and the cycle.
    obeyed: Option<(u64, u64)>,
}

impl VirtualMachine {
    /// A machine that has just been switched on, and where its program's moves come up.
    ///
    /// # Errors
    /// If a bus cannot be simulated.
    pub fn new(
        machine: &Machine,
        layout: Arc<Layout>,
        program: Program,
        seed: u64,
    ) -> Result<(Self, Moves), PortError> {
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
    /// they carry, and where its program's moves come up.
    #[must_use]
    pub fn on(
        world: World,
        ports: Vec<P>,
        layout: Arc<Layout>,
        program: Program,
        frames: SharedFrames,
    ) -> (Self, Moves) {
        let (upcoming, moves) = Moves::new();
        let machine = Self {
            driver: Driver::new(layout, world, ports, Instant::ZERO),
            frames,
            program,
            upcoming: Some(upcoming),
            feeder: None,
            now: Instant::ZERO,
            obeyed: None,
        };
        (machine, moves)
    }

    /// Goes on to the next wake-up; false once the machine is at its end.
    fn step(&mut self) -> Result<bool, RunError> {
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

    /// What happened at the last SYNC, after a wake-up that supervised.
    #[must_use]
    pub fn row(&self) -> Option<&Row<COORDINATES>> {
        self.driver.controller.row()
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

impl<P: Port> Timeline for VirtualMachine<P> {
    fn order(&mut self, number: u64, order: Order) {
        let controller = &mut self.driver.controller;
        self.obeyed = Some((number, controller.cycle()));
        controller.obey(order);
    }

    /// One wake-up.
    fn advance(&mut self, report: &mut dyn FnMut(CycleReport)) -> Result<Progress, RunError> {
        if let Some((number, cycle)) = self.obeyed.take() {
            report(CycleReport::Obeyed { number, cycle });
        }
        let stepped = self.step();
        while let Some(event) = self.driver.controller.event() {
            report(CycleReport::Event(event));
        }
        if let Some(row) = self.row() {
            report(CycleReport::Row(*row));
        }
        Ok(match stepped? {
            true => Progress::More,
            false => Progress::Ended,
        })
    }
}
