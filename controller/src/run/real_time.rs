//! A machine on the host's clock: the cycle and the planner in threads of their own, everything else
//! outside.
//!
//! ```text
//!  orders ──► cycle thread ──► reports
//!              ▲       │
//!   instructions       plan requests
//!              │       ▼
//!            planner thread
//! ```
//!
//! One bounded queue of orders goes in, one of reports comes out; cycle and planner have a pair of
//! their own. Nothing else is shared, and nobody who prints or writes stands in between.
//!
//! SYNC leaves in every cycle, whatever the planner does: what was planned ends at rest, and a path that
//! rests for long without a plan is a fault ([`NoPlan`](crate::control::Fault::NoPlan)). On the host's clock the cycle
//! waits for nobody. Where every bus is simulated its time goes with the cycle, which, while the path rests for want of
//! a plan or another one was asked for, looks for it
//! until half of the time from the setpoints to the next SYNC is over. A plan that has come by then takes effect in the same cycle as
//! in virtual time. One that comes later makes the machine rest for longer before it; while the path moves, it comes to rest
//! where its plan ends, and goes on from there.
//!
//! Whoever needs the frames of virtual time on every host has such a machine's time stand still for the
//! planner ([`Pace::LockstepWithPlanner`]); orders are heard meanwhile. It waits for at most `PLAN_PATIENCE` for
//! an instruction and, once it is to stop, for at most `PATIENCE`, each time anew: then SYNC goes on.
//!
//! A simulated machine waits for whoever takes its reports for at most `REPORT_PATIENCE`, until they are taken
//! again: then reports are lost, and counted.

use super::driver::Driver;
use super::ends::{Ends, HandedOver};
use super::planning::{PlanQueues, PlanRequest, Planning, Told};
use super::{CycleReport, Progress, RunError, Timeline, Work};
use crate::control::{Controller, Event, Instruction, Layout, Order, Outcome, Phase};
use crate::machine::{COORDINATES, Machine};
use crate::observe::flight_recorder::Carried;
use crate::observe::timing::{Distribution, Stage, Stages};
use crate::port::{Port, Ports};
use crate::program::{Feeder, Moves, Program};
use crate::realtime::{self, Granted};
use rtrb::{Consumer, Producer, RingBuffer};
use std::collections::VecDeque;
use std::io;
use std::mem::replace;
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::Duration;
use syncline_canopen::Instant;
use syncline_drives::world::World;
use syncline_trajectory::path::ReplanRequest;

/// Instructions on their way into the cycle.
const INSTRUCTIONS: usize = 1024;
/// Most of them that one wake-up takes on the host's clock: far more than a cycle uses up.
const TAKEN_AT_ONCE: usize = 128;
/// Orders on their way into the cycle.
const ORDERS: usize = 64;
/// Reports on their way out of the cycle.
const REPORTS: usize = 16_384;
/// Requests on their way to the planner.
const REQUESTS: usize = 64;
/// Reports that are taken at once, so that orders are heard in between.
const REPORTS_AT_ONCE: usize = 64;
/// The number of the timeline's own orders; no session comes that far.
const OWN: u64 = u64::MAX;
/// How long the cycle of a simulated machine waits for its plan at a time.
const NAP: Duration = Duration::from_micros(200);
/// How long it waits for an instruction: longer than any call of the planner takes.
const PLAN_PATIENCE: Duration = Duration::from_secs(5);
/// How long a simulated machine waits for one way to rest, in all.
const PATIENCE: Duration = Duration::from_millis(200);
/// How long it waits for who takes its reports, until they are taken again.
const REPORT_PATIENCE: Duration = Duration::from_secs(1);

/// Whose time the machine's is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// The host's.
    HostClock,
    /// The cycle's, as every bus is simulated: a late wake-up delays controller and drives together.
    Lockstep,
    /// The same, and time stands still while the planner works.
    LockstepWithPlanner,
}

impl Pace {
    /// Whether the machine's time goes with the cycle.
    #[must_use]
    pub fn is_lockstep(self) -> bool {
        self != Self::HostClock
    }
}

/// How the cycle treats time.
#[derive(Clone, Copy, Debug)]
pub struct Timing {
    /// What the thread asks of the kernel.
    pub settings: realtime::Settings,
    /// Time before each wake-up that is spent spinning.
    pub spin: Duration,
    /// Whose time the machine's is.
    pub pace: Pace,
    /// A late wake-up is a fault.
    pub strict: bool,
}

/// What the cycle measured.
#[derive(Clone, Debug)]
pub struct Measured {
    /// From the instant asked for to waking up.
    pub wake_up: Distribution,
    /// |From SYNC to SYNC − cycle|.
    pub sync_jitter: Distribution,
    /// From waking up for the setpoints until they are sent, without the time for which the plan is waited for.
    pub compute: Distribution,
    /// Wake-ups later than [`late_after`].
    pub late: u64,
    /// The same by what made them late, in the order of [`Stage::ALL`]: the kernel, or the longest
    /// stage of the wake-up before, which was not over in time.
    pub late_by: [u64; 4],
    /// The wake-up that was over latest.
    pub worst: Stages,
    /// Reports that nobody fetched in time.
    pub lost: u64,
    /// When the cycle began.
    pub start: Instant,
}

impl Measured {
    /// All distributions.
    #[must_use]
    pub fn distributions(&self) -> [Distribution; 3] {
        [&self.wake_up, &self.sync_jitter, &self.compute].map(Distribution::clone)
    }
}

/// A wake-up later than this counts as late: a quarter of the cycle.
#[must_use]
pub fn late_after(cycle: Duration) -> Duration {
    cycle / 4
}

/// The outer ends of the cycle's queues.
pub struct CycleHandle {
    orders: Producer<(u64, Order)>,
    /// Orders that found no room yet.
    waiting: VecDeque<(u64, Order)>,
    reports: Consumer<CycleReport>,
    carried: Consumer<Carried>,
}

impl CycleHandle {
    /// Orders something. None gets lost: what finds no room goes with the next order or
    /// [`CycleHandle::report`].
    pub fn order(&mut self, number: u64, order: Order) {
        self.waiting.push_back((number, order));
        self.hand_over();
    }

    fn hand_over(&mut self) {
        while !self.orders.is_full()
            && let Some(order) = self.waiting.pop_front()
        {
            let given = self.orders.push(order);
            debug_assert!(given.is_ok(), "there is room");
        }
    }

    /// The next report.
    pub fn report(&mut self) -> Option<CycleReport> {
        self.hand_over();
        self.reports.pop().ok()
    }
}

/// The cycle, to be run in a thread of its own.
pub struct Cycle {
    driver: Driver<COORDINATES, Box<dyn Port + Send>>,
    timing: Timing,
    period: Duration,
    /// How long after the instant of its setpoints a simulated machine looks for the plan.
    slack: Duration,
    instructions: Consumer<(u64, Instruction<COORDINATES>)>,
    orders: Consumer<(u64, Order)>,
    reports: Producer<CycleReport>,
    requests: Producer<PlanRequest>,
    /// The last job that the planner was asked to begin.
    asked_to_begin: Option<u64>,
    /// The last job that it was told to be over.
    told_over: Option<(u64, Outcome)>,
    asked: Option<ReplanRequest>,
    /// The number of the last probing, homing or thread that it was told of.
    told_found: Option<u32>,
    /// The reading of inputs and outputs that the planner was told last.
    told_read: Option<u32>,
    /// How much longer a simulated machine waits for the next instruction.
    plan_patience: Duration,
    /// How much longer it waits for its way to rest.
    patience: Duration,
    /// How much longer it waits for who takes its reports.
    report_patience: Duration,
    measured: Measured,
}

impl Cycle {
    /// The cycle of a machine whose buses are open, and the outer ends of its queues.
    #[must_use]
    pub fn new(
        layout: &Arc<Layout>,
        world: World,
        ports: Ports,
        timing: Timing,
    ) -> (Self, CycleHandle, PlanQueues) {
        let (give, instructions) = RingBuffer::new(INSTRUCTIONS);
        let (order, orders) = RingBuffer::new(ORDERS);
        let (report, reports) = RingBuffer::new(REPORTS);
        let (ask, requests) = RingBuffer::new(REQUESTS);
        let mut driver = Driver::new(Arc::clone(layout), world, ports, Instant::ZERO);
        driver.controller.touch();
        let carried = driver.tap();
        let cycle = Self {
            driver,
            timing,
            period: layout.cycle,
            slack: layout.cycle.saturating_sub(layout.setpoint_offset) / 2,
            instructions,
            orders,
            reports: report,
            requests: ask,
            asked_to_begin: None,
            told_over: None,
            asked: None,
            told_found: None,
            told_read: None,
            plan_patience: PLAN_PATIENCE,
            patience: PATIENCE,
            report_patience: REPORT_PATIENCE,
            measured: Measured {
                wake_up: Distribution::new("wake-up latency"),
                sync_jitter: Distribution::new("SYNC jitter"),
                compute: Distribution::new("setpoint wake-up"),
                late: 0,
                late_by: [0; 4],
                worst: Stages::default(),
                lost: 0,
                start: realtime::now(),
            },
        };
        let handle = CycleHandle {
            orders: order,
            waiting: VecDeque::new(),
            reports,
            carried,
        };
        let queues = PlanQueues {
            requests,
            instructions: give,
        };
        (cycle, handle, queues)
    }

    /// Runs the machine to its end; `started` is told what the kernel granted.
    pub fn run(mut self, started: impl FnOnce(&Granted)) -> (Controller<COORDINATES>, Measured) {
        let granted = realtime::enter(&self.timing.settings);
        started(&granted);
        // The first wake-up is as punctual as all others: locking memory can take longer than cycles.
        let begin = realtime::now() + self.period;
        // Where the simulated machine's time stands on the host's clock.
        let mut origin = Duration::ZERO;
        if self.timing.pace.is_lockstep() {
            origin = Duration::from_nanos(begin.as_nanos());
        } else {
            self.driver.controller.begin_at(begin);
        }
        let mut bus_failed = false;
        let mut last_sync = None;
        let mut before = (Instant::ZERO, Stages::default());
        while let Some(next) = self.driver.controller.next_wake() {
            let due = next.at() + origin;
            let controller = &self.driver.controller;
            realtime::sleep_until(due, self.timing.spin, || controller.rehearse());
            let woke = realtime::now();
            let late = woke.saturating_since(due);
            self.measured.wake_up.record(late, woke);
            if late > late_after(self.period) {
                self.measured.late += 1;
                let (over, stages) = before;
                let stage = if over > due {
                    stages.longest()
                } else {
                    Stage::WakeUp
                };
                self.measured.late_by[stage as usize] += 1;
                if self.timing.pace.is_lockstep() {
                    origin += late;
                }
                if self.timing.strict {
                    self.driver.controller.woke_late(late);
                }
            }
            let now = if self.timing.pace.is_lockstep() {
                next.at()
            } else {
                woke
            };
            let setpoints = self.driver.setpoints_are_next();
            let mut waited = Duration::ZERO;
            if setpoints {
                self.obey();
                bus_failed &= !self.driver.controller.faults().is_empty();
                waited = match self.timing.pace {
                    Pace::HostClock => Duration::ZERO,
                    Pace::Lockstep => self.look_for_plan(due + self.slack),
                    Pace::LockstepWithPlanner => {
                        let stood = self.wait_for_plan();
                        origin += stood;
                        stood
                    }
                };
            }
            let begun = realtime::now();
            let collected = self.driver.collect(now).map(|_| ());
            let received = realtime::now();
            self.driver.compute(now);
            let computed = realtime::now();
            let sent = self.driver.send();
            let over = realtime::now();
            let stages = Stages {
                at: woke.saturating_since(self.measured.start),
                wake: late,
                receive: received.saturating_since(begun),
                compute: computed.saturating_since(received),
                send: over.saturating_since(computed),
            };
            before = (over, stages);
            if stages.total() > self.measured.worst.total() {
                self.measured.worst = stages;
            }
            // What fails once fails in every cycle until the end or a reset: the first time is news.
            if let Err(error) = collected.and(sent)
                && !replace(&mut bus_failed, true)
            {
                self.report(CycleReport::BusFailed(error));
            }
            if setpoints {
                let took = over.saturating_since(woke).saturating_sub(waited);
                self.measured.compute.record(took, woke);
                self.report_all();
                self.driver.push_tool();
                // Behind the setpoints, which nothing is to delay.
                if !self.timing.pace.is_lockstep() {
                    self.ask_planner();
                    self.take_plan(TAKEN_AT_ONCE);
                }
            } else if let Some(last) = last_sync.replace(woke) {
                let jitter = woke.saturating_since(last).abs_diff(self.period);
                self.measured.sync_jitter.record(jitter, woke);
            }
        }
        (self.driver.controller, self.measured)
    }

    fn obey(&mut self) {
        if self.orders.is_abandoned() {
            self.driver.controller.interrupt();
            // A machine that stays on would stay on for nobody; one that is off refuses it.
            let _ = self.driver.controller.obey(Order::SwitchOff);
        }
        // As many as there is room for: whoever goes on ordering does not keep the cycle.
        for _ in 0..ORDERS {
            let Ok((number, order)) = self.orders.pop() else {
                break;
            };
            let outcome = super::obey(&mut self.driver.controller, number, order);
            if number != OWN {
                self.report(outcome);
            }
        }
    }

    /// Takes what has come of the plan, at most so many instructions and what there is room for; whether any came.
    fn take_plan(&mut self, most: usize) -> bool {
        let mut taken = 0;
        while taken < most && self.driver.controller.room() > 0 {
            let Ok((number, instruction)) = self.instructions.pop() else {
                break;
            };
            // What is left of a job that is over is of no use.
            let job = self.driver.controller.job();
            if job.is_some_and(|job| job.number == number) {
                self.driver.controller.accept(instruction);
            }
            taken += 1;
            self.ask_planner();
        }
        taken > 0
    }

    /// Fills the controller's plan with what has come, and looks for more while it lacks one and it is not `until`; how long
    /// that was waited for.
    fn look_for_plan(&mut self, until: Instant) -> Duration {
        let begun = realtime::now();
        self.ask_planner();
        self.take_plan(usize::MAX);
        let mut now = begun;
        while self.driver.controller.lacks_plan() && now < until {
            thread::sleep(NAP.min(until.saturating_since(now)));
            self.obey();
            self.ask_planner();
            self.take_plan(usize::MAX);
            now = realtime::now();
        }
        now.saturating_since(begun)
    }

    /// Fills the controller's plan, and waits until it is full for as long as it has patience; how long that was.
    fn wait_for_plan(&mut self) -> Duration {
        let begun = realtime::now();
        if self.driver.controller.phase() != Phase::Stop {
            self.patience = PATIENCE;
        }
        let mut now = begun;
        loop {
            self.ask_planner();
            if self.take_plan(usize::MAX) {
                self.plan_patience = PLAN_PATIENCE;
            }
            let patient = !self.plan_patience.is_zero() && !self.patience.is_zero();
            if self.driver.controller.room() == 0 || !patient {
                return now.saturating_since(begun);
            }
            // Interrupted if the other side is gone, so that this ends.
            thread::sleep(NAP);
            let napped = realtime::now().saturating_since(now);
            now = realtime::now();
            self.plan_patience = self.plan_patience.saturating_sub(napped);
            if self.driver.controller.phase() == Phase::Stop {
                self.patience = self.patience.saturating_sub(napped);
            }
            self.obey();
        }
    }

    /// Asks the planner for what is wanted of it and was not asked for yet. Where there is no room
    /// for a request, the next wake-up asks.
    fn ask_planner(&mut self) {
        let over = self.driver.controller.over();
        if over != self.told_over
            && let Some((number, outcome)) = over
        {
            let told = self.requests.push(PlanRequest::Over(number, outcome));
            self.told_over = over.filter(|_| told.is_ok()).or(self.told_over);
        }
        let job = self.driver.controller.job().map(|job| job.number);
        if job != self.asked_to_begin
            && let Some(number) = job
            && let Some(start) = self.driver.controller.ready()
        {
            let begun = self.requests.push(PlanRequest::Begin(number, start));
            self.asked_to_begin = job.filter(|_| begun.is_ok()).or(self.asked_to_begin);
            self.asked = None;
            self.told_found = None;
            self.told_read = None;
        }
        let found = self.driver.controller.found();
        if let Some(found) = found.filter(|it| Some(it.number) != self.told_found) {
            if self.requests.push(PlanRequest::Found(*found)).is_err() {
                return;
            }
            self.told_found = Some(found.number);
            self.asked = None;
        }
        let read = self.driver.controller.signals_read();
        if let Some(levels) = read.filter(|it| Some(it.number) != self.told_read) {
            if self
                .requests
                .push(PlanRequest::SignalsRead(*levels))
                .is_err()
            {
                return;
            }
            self.told_read = Some(levels.number);
        }
        let wanted = self.driver.controller.replan_request();
        if wanted == self.asked {
            return;
        }
        let asked = wanted.is_none_or(|from| self.requests.push(PlanRequest::Replan(from)).is_ok());
        if asked {
            self.asked = wanted;
        }
    }

    fn report_all(&mut self) {
        while let Some(event) = self.driver.controller.event() {
            self.report(CycleReport::Event(event));
        }
        if let Some(row) = self.driver.controller.row() {
            let row = CycleReport::Row(*row);
            self.report(row);
        }
    }

    /// Reports something; what finds no room is lost and counted, but a simulated machine waits
    /// for a while. Rows leave room for what the session has to know.
    fn report(&mut self, report: CycleReport) {
        let kept_free = match report {
            CycleReport::Row(_) => REPORTS / 2,
            _ => 0,
        };
        let mut waited = false;
        while self.reports.slots() <= kept_free {
            let waits = self.timing.pace.is_lockstep() && self.report_patience > Duration::ZERO;
            if !waits || self.reports.is_abandoned() {
                self.measured.lost += 1;
                return;
            }
            thread::sleep(NAP);
            self.report_patience = self.report_patience.saturating_sub(NAP);
            waited = true;
        }
        // They are taken: now, or there was far more room than rows may fill.
        if waited || self.reports.slots() > REPORTS / 2 {
            self.report_patience = REPORT_PATIENCE;
        }
        let given = self.reports.push(report);
        debug_assert!(given.is_ok(), "there is room");
    }
}

/// A machine with its program on the host's clock.
pub struct RealTime {
    /// Goes first: without it the cycle stops.
    handle: Option<CycleHandle>,
    cycle: Option<JoinHandle<(Controller<COORDINATES>, Measured)>>,
    planning: Option<Planning>,
    /// The jobs that were handed over and are not over.
    jobs: HandedOver,
    ends: Ends,
}

/// The cycle itself panicked: the drives' own supervision stops them.
#[derive(Debug, thiserror::Error)]
#[error("the cycle failed: this is a defect of syncline; the drives stop by lost heartbeat")]
pub struct CyclePanic;

/// A machine at its end.
pub struct Ended {
    /// The controller as it was left.
    pub controller: Controller<COORDINATES>,
    /// What the cycle measured.
    pub measured: Measured,
    /// The program as it was left, if it began and its planner did not fail.
    pub feeder: Option<Feeder>,
}

impl RealTime {
    /// Starts the threads of a machine and its layout, and says where the program's moves come up; `started` is told what the
    /// kernel granted the cycle, in its thread.
    ///
    /// # Errors
    /// There is no thread for it.
    pub fn start(
        machine: &Machine,
        layout: &Arc<Layout>,
        world: World,
        ports: Ports,
        timing: Timing,
        program: Program,
        started: impl FnOnce(&Granted) + Send + 'static,
    ) -> io::Result<(Self, Moves)> {
        let (mut cycle, handle, queues) = Cycle::new(layout, world, ports, timing);
        cycle.driver.cut(machine, layout);
        cycle.driver.controller.works_on(program.only_job());
        let (upcoming, moves) = Moves::new();
        let mut running = Self::of(handle, queues)?;
        running.prepare(Work {
            number: 0,
            program,
            upcoming,
        });
        running.begin(cycle, started)?;
        Ok((running, moves))
    }

    /// The same, but the machine stays on, and its jobs come one by one.
    ///
    /// # Errors
    /// There is no thread for it.
    pub fn stay_on(
        machine: &Machine,
        layout: &Arc<Layout>,
        world: World,
        ports: Ports,
        timing: Timing,
        started: impl FnOnce(&Granted) + Send + 'static,
    ) -> io::Result<Self> {
        let (mut cycle, handle, queues) = Cycle::new(layout, world, ports, timing);
        cycle.driver.cut(machine, layout);
        cycle.driver.controller.stay_on();
        let mut running = Self::of(handle, queues)?;
        running.begin(cycle, started)?;
        Ok(running)
    }

    fn of(handle: CycleHandle, queues: PlanQueues) -> io::Result<Self> {
        Ok(Self {
            handle: Some(handle),
            cycle: None,
            planning: Some(Planning::new(queues)?),
            jobs: HandedOver::default(),
            ends: Ends::default(),
        })
    }

    fn begin(
        &mut self,
        cycle: Cycle,
        started: impl FnOnce(&Granted) + Send + 'static,
    ) -> io::Result<()> {
        // The session's own stack, too: where memory has run out it goes on to its end.
        realtime::touch_stack();
        realtime::keep_memory();
        let thread = thread::Builder::new().name("cycle".into());
        self.cycle = Some(thread.spawn(move || cycle.run(started))?);
        Ok(())
    }

    /// Waits for the threads, which end with [`Progress::Ended`].
    ///
    /// # Errors
    /// The cycle panicked.
    pub fn end(mut self) -> Result<Ended, CyclePanic> {
        self.jobs.over(u64::MAX);
        let cycle = self.cycle.take().ok_or(CyclePanic)?;
        let (controller, measured) = cycle.join().map_err(|_| CyclePanic)?;
        // Why it failed was told when it did.
        let feeder = self.planning.take().and_then(|it| it.end().ok().flatten());
        Ok(Ended {
            controller,
            measured,
            feeder,
        })
    }
}

/// Also where a panic ends the session: the cycle stops and is waited for.
impl Drop for RealTime {
    fn drop(&mut self) {
        self.handle = None;
        self.jobs.over(u64::MAX);
        if let Some(cycle) = self.cycle.take() {
            let _ = cycle.join();
        }
    }
}

impl Timeline for RealTime {
    fn prepare(&mut self, work: Work) {
        self.jobs.hand_over(work.number, work.program.clone());
        if let Some(planning) = &self.planning {
            planning.prepare(work);
        }
    }

    fn order(&mut self, number: u64, order: Order) {
        self.jobs.ordered(number, &order);
        if let Some(handle) = &mut self.handle {
            handle.order(number, order);
        }
    }

    fn advance(&mut self, report: &mut dyn FnMut(CycleReport)) -> Result<Progress, RunError> {
        let over = self.cycle.as_ref().is_none_or(JoinHandle::is_finished);
        let (Some(handle), Some(planning)) = (&mut self.handle, &mut self.planning) else {
            return Ok(Progress::Ended);
        };
        if over {
            self.ends.all_reported();
        }
        if let Some((job, outcome, left)) = self.ends.next() {
            report(CycleReport::JobOver { job, outcome, left });
        }
        match planning.told() {
            Some(Told::Over(job, outcome, left)) => self.ends.left(job, outcome, left),
            Some(Told::NoBegin(job, error)) => {
                handle.order(OWN, Order::Abandon(job));
                return Err(error.into());
            }
            Some(Told::Block(error)) => return Err(error.into()),
            Some(Told::Problem(error)) => return Err(error),
            None => {}
        }
        planning.check().inspect_err(|_| {
            // Without a planner the machine comes to rest and goes off.
            if let Some(job) = self.jobs.last() {
                handle.order(OWN, Order::Abandon(job));
            }
            handle.order(OWN, Order::SwitchOff);
        })?;
        for _ in 0..REPORTS_AT_ONCE {
            match handle.report() {
                Some(it) => {
                    if let CycleReport::Event(Event::JobOver { job, .. }) = &it {
                        self.ends.reported(*job);
                    }
                    self.jobs.reported(&it);
                    report(it);
                }
                None if over && self.ends.is_empty() => return Ok(Progress::Ended),
                None => return Ok(Progress::Idle),
            }
        }
        Ok(Progress::More)
    }

    fn carried(&mut self) -> Option<Carried> {
        self.handle.as_mut()?.carried.pop().ok()
    }
}

#[cfg(test)]
mod slow_planner;
#[cfg(test)]
mod tests;
