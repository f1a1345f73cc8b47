//! A machine in virtual time: the real controller against simulated drives.

use super::driver::Driver;
use super::{CycleReport, Progress, RunError, Timeline, Work};
use crate::control::{Controller, Layout, Order, Outcome, Row};
use crate::machine::{COORDINATES, Machine};
use crate::observe::frames::SharedFrames;
use crate::port::sim::{SimPort, Simulated};
use crate::port::{Port, PortError};
use crate::program::{Feeder, Moves, Program, ProgramError};
use std::collections::VecDeque;
use std::mem::{replace, take};
use std::sync::Arc;
use syncline_canopen::Instant;
use syncline_canopen::time::Duration;
use syncline_drives::world::{Observer, World};

/// A machine of simulated drives and the controller, with programs to run.
///
/// The same machine, programs and seed give the same frames, byte for byte.
pub struct VirtualMachine<P = SimPort> {
    driver: Driver<COORDINATES, P>,
    frames: SharedFrames,
    /// Jobs that have not begun.
    work: VecDeque<Work>,
    /// The job that is planned.
    feeder: Option<(u64, Feeder)>,
    /// The last job that was reported to be over.
    over: Option<u64>,
    now: Instant,
    /// What became of orders and is not reported.
    answers: VecDeque<CycleReport>,
    /// A bus failed, which was reported.
    bus_failed: bool,
    /// By so much the next wake-up comes late.
    late: Duration,
    /// For so many wake-ups the planner does nothing.
    starved: u32,
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
        let mut machine = Self::with(world, ports, layout, frames);
        machine.work.push_back(Work {
            number: 0,
            program,
            upcoming,
        });
        (machine, moves)
    }

    /// The same, but it stays on, and its jobs come one by one.
    #[must_use]
    pub fn staying_on(
        world: World,
        ports: Vec<P>,
        layout: Arc<Layout>,
        frames: SharedFrames,
    ) -> Self {
        let mut machine = Self::with(world, ports, layout, frames);
        machine.driver.controller.stay_on();
        machine
    }

    fn with(world: World, ports: Vec<P>, layout: Arc<Layout>, frames: SharedFrames) -> Self {
        Self {
            driver: Driver::new(layout, world, ports, Instant::ZERO),
            frames,
            work: VecDeque::new(),
            feeder: None,
            over: None,
            now: Instant::ZERO,
            answers: VecDeque::new(),
            bus_failed: false,
            late: Duration::ZERO,
            starved: 0,
        }
    }

    /// Goes on to the next wake-up; false once the machine is at its end.
    fn step(&mut self) -> Result<bool, RunError> {
        let Some(next) = self.driver.controller.next_wake() else {
            return Ok(false);
        };
        // Behind a late one come those that are due since.
        self.now = self.now.max(next.at()) + take(&mut self.late);
        let fed = self.feed();
        if fed.is_err() && self.feeder.is_none() {
            self.driver.controller.abandon();
        }
        let stepped = self.driver.step(self.now);
        // What fails once fails in every cycle: the first time is news.
        let failed = replace(&mut self.bus_failed, stepped.is_err());
        stepped.or_else(|error| if failed { Ok(()) } else { Err(error) })?;
        fed?;
        Ok(true)
    }

    /// Keeps the controller's plan full.
    fn feed(&mut self) -> Result<(), ProgramError> {
        if self.starved > 0 {
            self.starved -= 1;
            return Ok(());
        }
        let controller = &mut self.driver.controller;
        let Some(job) = controller.job() else {
            return Ok(());
        };
        let is_planned = |(number, _): &(u64, Feeder)| *number == job.number;
        if let Some(start) = controller.ready()
            && !self.feeder.as_ref().is_some_and(is_planned)
        {
            self.feeder = None;
            self.work.retain(|work| work.number >= job.number);
            if let Some(Work {
                number,
                program,
                upcoming,
            }) = self.work.pop_front()
            {
                program.check(start)?;
                self.feeder = Some((number, program.feeder(start, upcoming)?));
            }
        }
        let Some((_, feeder)) = &mut self.feeder else {
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

    /// Reports a job that is over.
    fn report_over(&mut self, report: &mut dyn FnMut(CycleReport)) -> Result<(), RunError> {
        let Some((job, outcome)) = self.driver.controller.over() else {
            return Ok(());
        };
        if self.over.replace(job) == Some(job) {
            return Ok(());
        }
        let feeder = self.feeder.take_if(|(number, _)| *number == job);
        let finished = feeder.filter(|_| outcome == Outcome::Finished);
        let (left, kept) = finished.map(|(_, feeder)| feeder.finish()).unzip();
        report(CycleReport::JobOver { job, outcome, left });
        kept.unwrap_or(Ok(()))?;
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

    /// Lets the next wake-up come so much late, as those of a host that has other things to do.
    pub fn wake_late(&mut self, by: Duration) {
        self.late = by;
    }

    /// Lets the planner do nothing for so many wake-ups, as one that gets no processor time.
    pub fn starve_planner(&mut self, wake_ups: u32) {
        self.starved = wake_ups;
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
    fn prepare(&mut self, work: Work) {
        self.work.push_back(work);
    }

    fn order(&mut self, number: u64, order: Order) {
        let controller = &mut self.driver.controller;
        let cycle = controller.cycle();
        self.answers.push_back(match controller.obey(order) {
            Ok(()) => CycleReport::Obeyed { number, cycle },
            Err(refusal) => CycleReport::Refused {
                number,
                cycle,
                refusal,
            },
        });
    }

    /// One wake-up.
    fn advance(&mut self, report: &mut dyn FnMut(CycleReport)) -> Result<Progress, RunError> {
        self.answers.drain(..).for_each(&mut *report);
        let stepped = self.step();
        while let Some(event) = self.driver.controller.event() {
            report(CycleReport::Event(event));
        }
        if let Some(row) = self.row() {
            report(CycleReport::Row(*row));
        }
        self.report_over(report)?;
        Ok(match stepped? {
            true => Progress::More,
            false => Progress::Ended,
        })
    }
}
