//! A machine in virtual time: the real controller against simulated drives.

use super::driver::Driver;
use super::inline_planning::InlinePlanning;
use super::{CycleReport, Orders, Progress, RunError, Timeline, Work};
use crate::control::{Controller, Layout, Order, Row};
use crate::machine::{COORDINATES, Machine};
use crate::observe::flight_recorder::Carried;
use crate::observe::frames::SharedFrames;
use crate::port::sim::{SimPort, Simulated};
use crate::port::{Port, PortError};
use crate::program::{Moves, Program, ProgramError};
use rtrb::Consumer;
use std::mem::{replace, take};
use std::sync::Arc;
use syncline_canopen::Instant;
use syncline_canopen::time::Duration;
use syncline_drives::twin::Observation;
use syncline_drives::twin::servo::cascade::Gains;
use syncline_drives::world::{DeviceId, Observer, World};

/// What a brake takes to grip, 1 s at the most (`brake_closing_ms`), and to stop what has fallen until then.
const BRAKES: Duration = Duration::from_secs(2);

/// A machine of simulated drives and the controller, with programs to run.
///
/// The same machine, programs and seed give the same frames, byte for byte.
pub struct VirtualMachine<P = SimPort> {
    driver: Driver<COORDINATES, P>,
    /// The twin of each drive.
    drives: Vec<Option<DeviceId>>,
    frames: SharedFrames,
    carried: Consumer<Carried>,
    planning: InlinePlanning,
    orders: Orders,
    now: Instant,
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
        let (world, ports, frames) = simulated(machine, seed)?;
        let (mut virtual_machine, moves) =
            Self::on(world, ports, Arc::clone(&layout), program, frames);
        virtual_machine.driver.cut(machine, &layout);
        Ok((virtual_machine, moves))
    }

    /// One that has just been switched on and stays on, and whose jobs come one by one.
    ///
    /// # Errors
    /// If a bus cannot be simulated.
    pub fn switched_on(
        machine: &Machine,
        layout: Arc<Layout>,
        seed: u64,
    ) -> Result<Self, PortError> {
        let (world, ports, frames) = simulated(machine, seed)?;
        let mut virtual_machine = Self::staying_on(world, ports, Arc::clone(&layout), frames);
        virtual_machine.driver.cut(machine, &layout);
        Ok(virtual_machine)
    }
}

/// The simulated world of a machine, with the controller's ports, and what its buses carry.
fn simulated(
    machine: &Machine,
    seed: u64,
) -> Result<(World, Vec<SimPort>, SharedFrames), PortError> {
    let frames = SharedFrames::new(machine);
    let observers =
        (0..machine.buses.len()).map(|bus| Some(Box::new(frames.observer(bus)) as Observer));
    let simulated = Simulated::new(machine, seed, observers, |_, _| ())?;
    let ports = simulated.buses.iter().flatten();
    let ports = ports.map(|bus| SimPort::new(*bus)).collect();
    Ok((simulated.world, ports, frames))
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
        machine.driver.controller.works_on(program.only_job());
        if let Some(samples) = program.samples() {
            machine.driver.controller.go_along(Arc::clone(samples));
        }
        machine.prepare(Work {
            number: 0,
            program,
            upcoming,
        });
        (machine, moves)
    }

    /// The same, but it stays on, and its jobs come one by one. Its plans go round in their memory, all of which it takes at once: a
    /// process then takes no more of it the longer it lasts.
    #[must_use]
    pub fn staying_on(
        world: World,
        ports: Vec<P>,
        layout: Arc<Layout>,
        frames: SharedFrames,
    ) -> Self {
        let mut machine = Self::with(world, ports, layout, frames);
        machine.driver.controller.touch();
        machine.driver.controller.stay_on();
        machine
    }

    fn with(world: World, ports: Vec<P>, layout: Arc<Layout>, frames: SharedFrames) -> Self {
        let mut driver = Driver::new(Arc::clone(&layout), world, ports, Instant::ZERO);
        Self {
            carried: driver.tap(),
            drives: driver.twins(&layout),
            driver,
            frames,
            planning: InlinePlanning::default(),
            orders: Orders::default(),
            now: Instant::ZERO,
            bus_failed: false,
            late: Duration::ZERO,
            starved: 0,
        }
    }

    /// Goes on to the next wake-up; false once the machine is at its end. Orders are obeyed and the plan
    /// is fed where the cycle of a machine in real time does so, before the setpoints.
    fn step(&mut self, report: &mut dyn FnMut(CycleReport)) -> Result<bool, RunError> {
        let Some(next) = self.driver.controller.next_wake() else {
            self.orders.obey(&mut self.driver.controller, report);
            return Ok(false);
        };
        // Behind a late one come those that are due since.
        self.now = self.now.max(next.at()) + take(&mut self.late);
        let plans = self.starved == 0;
        self.starved = self.starved.saturating_sub(1);
        let mut fed = Ok(());
        let supervises = self.driver.setpoints_are_next();
        if supervises {
            self.orders.obey(&mut self.driver.controller, report);
            if plans {
                fed = self.feed();
            }
        }
        if fed.is_err() && !self.planning.is_at_work() {
            self.driver.controller.abandon();
        }
        let stepped = self.driver.step(self.now);
        if supervises {
            self.driver.push_tool();
        }
        // What fails once fails in every cycle: the first time is news.
        let failed = replace(&mut self.bus_failed, stepped.is_err());
        stepped.or_else(|error| if failed { Ok(()) } else { Err(error) })?;
        fed?;
        Ok(true)
    }

    /// Keeps the controller's plan full.
    fn feed(&mut self) -> Result<(), ProgramError> {
        let controller = &mut self.driver.controller;
        self.planning.begin(controller)?;
        self.planning.tell_found(controller);
        let Some(feeder) = self.planning.feeder() else {
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

    /// Lets time pass for the devices alone, behind the end of the machine: until brakes have gripped and nothing moves. How
    /// the drives are then, by their index, where they are simulated.
    #[must_use]
    pub fn come_to_rest(&mut self) -> Vec<Option<Observation>> {
        self.driver.leave_tool();
        self.driver.world.advance_to(self.now + BRAKES);
        let drives = 0..self.drives.len();
        drives.map(|drive| self.observe_drive(drive)).collect()
    }

    /// The gains of the drive with this index, if it is a servo drive.
    #[must_use]
    pub fn gains(&self, drive: usize) -> Option<&Gains> {
        self.driver.world.device(self.drives[drive]?).gains()
    }
}

impl<P: Port> Timeline for VirtualMachine<P> {
    fn prepare(&mut self, work: Work) {
        self.planning.prepare(work);
    }

    fn order(&mut self, number: u64, order: Order) {
        self.orders.push(number, order);
    }

    /// One wake-up.
    fn advance(&mut self, report: &mut dyn FnMut(CycleReport)) -> Result<Progress, RunError> {
        let stepped = self.step(report);
        while let Some(event) = self.driver.controller.event() {
            report(CycleReport::Event(event));
        }
        if let Some(row) = self.row() {
            report(CycleReport::Row(*row));
        }
        self.planning.report_over(&self.driver.controller, report)?;
        Ok(match stepped? {
            true => Progress::More,
            false => Progress::Ended,
        })
    }

    fn carried(&mut self) -> Option<Carried> {
        self.carried.pop().ok()
    }

    fn observe_drive(&self, drive: usize) -> Option<Observation> {
        let device = self.driver.world.device(self.drives[drive]?);
        Some(device.observe())
    }
}
