//! The real-time cycle on this host, stage by stage.
//!
//! ```text
//!  t_k: wake ► compute ► SYNC out      t_k + d: wake ► receive ► compute ► burst out
//!                                      later, with --control: wake, and nothing else
//! ```

use super::compare::{Difference, quantile_difference};
use super::rig::{Shape, Shuttle, ready_machine};
use crate::bus::Received;
use crate::control::{End, Instruction, Wake};
use crate::drive_host;
use crate::observe::timing::{Distribution, Stages};
use crate::port::socketcan::{DriveSocket, Options as SocketOptions, SocketCan, StampSource};
use crate::port::{Port, PortError, Ports};
use crate::realtime::{self, Granted, Settings};
use crate::run::driver::Driver;
use std::hint::black_box;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;
use syncline_canopen::{CanId, CobId, Instant};
use syncline_drives::world::{Hosted, World};

/// A wake-up later than this share of the period is late.
const LATE_SHARE: u32 = 10;

/// Instructions under way from the planner's thread to the cycle.
const PLAN_QUEUE: usize = 1024;

/// SCHED_FIFO priority of simulated drives.
const DRIVES_PRIORITY: u8 = 50;

/// Bring-up on a bus that lives in real time.
const BRING_UP: Duration = Duration::from_secs(30);

/// What to measure.
#[derive(Clone, Debug)]
pub struct Options {
    /// The machine.
    pub shape: Shape,
    /// SocketCAN interfaces, one a bus of the shape; none for simulated buses.
    pub interfaces: Vec<String>,
    /// Cycles to measure.
    pub cycles: u64,
    /// Interleave a bare wake-up loop.
    pub control: bool,
    /// What the thread asks for.
    pub realtime: Settings,
    /// Awake that long before each instant.
    pub spin: Duration,
}

/// What was measured.
#[derive(Debug)]
pub struct Outcome {
    /// What the thread was granted, and what not.
    pub granted: Granted,
    /// Where the stamps of received frames come from.
    pub stamps: &'static str,
    /// What is worth knowing about the buses.
    pub notes: Vec<String>,
    /// When measuring began.
    pub start: Instant,
    /// Each stage's times.
    pub distributions: Vec<Distribution>,
    /// Cycles measured.
    pub cycles: u64,
    /// Wake-ups later than a tenth of the period.
    pub late: u64,
    /// Bursts that missed their SYNC, as the controller counted them.
    pub dropped: u64,
    /// Cycles left out of the compute times since the processor was taken away in them.
    pub preempted: u64,
    /// What reading the thread's clock takes at least; it is taken off the compute times.
    pub clock: Duration,
    /// Processor time of the cycle's thread while measuring.
    pub processor: Duration,
    /// The cycle whose setpoints were ready latest.
    pub worst: Stages,
    /// Controller minus bare loop, wake-up latency in ns: median and p99.
    pub control: Option<[(&'static str, Difference); 2]>,
}

/// The names of all distributions that there may be.
pub fn names() -> impl Iterator<Item = &'static str> {
    let all = Record::new(0).into_distributions().into_iter();
    all.map(|distribution| distribution.name())
}

/// The interfaces, open: the controller's side of each and the drives'.
pub struct Buses(Vec<(SocketCan, DriveSocket)>);

impl Buses {
    /// Opens them.
    ///
    /// # Errors
    /// One cannot be used.
    pub fn open(options: &Options) -> Result<Self, PortError> {
        let open = |(bus, interface): (usize, &String)| {
            let (receive, burst) = options.shape.identifiers(bus);
            let bit_rate = 1_000_000;
            let socket_options = SocketOptions {
                bit_rate,
                receive,
                heartbeat: options.shape.heartbeat(),
                burst,
            };
            let port = SocketCan::open(interface, &socket_options)?;
            Ok((port, DriveSocket::open(interface, bit_rate)?))
        };
        let interfaces = options.interfaces.iter().enumerate();
        Ok(Self(interfaces.map(open).collect::<Result<_, _>>()?))
    }
}

/// Measures on a thread of its own.
///
/// # Errors
/// A bus failed, or the machine on it.
///
/// # Panics
/// If the measuring thread does.
pub fn measure(options: &Options, buses: Buses) -> Result<Outcome, PortError> {
    let axes = options.shape.axes;
    // The plan of `run` has nine coordinates, the letters of a program.
    match axes {
        ..=9 => measure_with::<9>(options, buses),
        10..=16 => measure_with::<16>(options, buses),
        _ => measure_with::<64>(options, buses),
    }
}

fn measure_with<const N: usize>(options: &Options, buses: Buses) -> Result<Outcome, PortError> {
    let stop = Arc::new(AtomicBool::new(false));
    let (ports, sockets): (Vec<_>, Vec<_>) = buses.0.into_iter().unzip();
    let start = realtime::now();
    let hosts: Vec<_> = sockets
        .into_iter()
        .enumerate()
        .map(|(bus, mut socket)| {
            let mut devices = Hosted::new(options.shape.twins(bus).collect());
            let stop = Arc::clone(&stop);
            thread::spawn(move || {
                // Drives answer at once, whatever else runs; the cycle stays above them.
                let _granted = realtime::enter(&Settings {
                    priority: DRIVES_PRIORITY,
                    core: None,
                });
                drive_host::host(&mut socket, &mut devices, start, &stop)
            })
        })
        .collect();
    let (mut plan_in, plan_out) = rtrb::RingBuffer::<Instruction<N>>::new(PLAN_QUEUE);
    let planner = {
        let stop = Arc::clone(&stop);
        let mut shuttle = Shuttle::<N>::new(options.shape.axes);
        thread::spawn(move || {
            while !stop.load(Ordering::Relaxed) {
                while !plan_in.is_full() {
                    let _ = plan_in.push(shuttle.instruction());
                }
                thread::sleep(Duration::from_millis(10));
            }
        })
    };
    let cycle = {
        let options = options.clone();
        thread::spawn(move || {
            // First: it takes longer than a cycle.
            let record = Record::new(if options.control { options.cycles } else { 0 });
            Cycle::<N>::new(options, ports, plan_out).run(record)
        })
    };
    let outcome = cycle.join();
    stop.store(true, Ordering::Relaxed);
    let _ = planner.join();
    for host in hosts {
        if let Ok(ended) = host.join() {
            ended?;
        }
    }
    match outcome {
        Ok(outcome) => outcome,
        Err(panic) => std::panic::resume_unwind(panic),
    }
}

/// The measuring thread.
struct Cycle<const N: usize> {
    options: Options,
    driver: Driver<N, Box<dyn Port + Send>>,
    plan: rtrb::Consumer<Instruction<N>>,
    granted: Granted,
    stamps: &'static str,
    notes: Vec<String>,
    /// The host's clock minus the controller's, ns; zero on real buses.
    ahead: u64,
}

/// All that is recorded while measuring.
struct Record {
    start: Instant,
    sync_wake: Distribution,
    sync_sent: Distribution,
    sync_stamped: Distribution,
    setpoint_wake: Distribution,
    receive: Distribution,
    compute: Distribution,
    compute_axis: Distribution,
    send: Distribution,
    arrival: Distribution,
    margin: Distribution,
    bare: Distribution,
    bare_compute: Distribution,
    ours: Vec<u32>,
    theirs: Vec<u32>,
    late: u64,
    /// Late setpoints before measuring began.
    dropped_before: u64,
    preempted: u64,
    clock: Duration,
    processor_before: Duration,
    worst: Stages,
}

impl Record {
    /// For so many wake-ups that are compared.
    fn new(compared: u64) -> Self {
        // Filled and emptied, so that no sample touches a page for the first time.
        let samples = || {
            let mut samples = vec![u32::MAX; compared as usize];
            samples.clear();
            samples
        };
        Self {
            start: Instant::ZERO,
            sync_wake: Distribution::new("wake-up for SYNC"),
            sync_sent: Distribution::new("SYNC handed over"),
            sync_stamped: Distribution::new("SYNC stamped"),
            setpoint_wake: Distribution::new("wake-up for setpoints"),
            receive: Distribution::new("receive"),
            compute: Distribution::new("compute per cycle"),
            compute_axis: Distribution::new("compute per axis"),
            send: Distribution::new("send"),
            arrival: Distribution::new("T_PDO after SYNC"),
            margin: Distribution::new("setpoints before SYNC"),
            bare: Distribution::new("bare wake-up"),
            bare_compute: Distribution::new("bare compute"),
            ours: samples(),
            theirs: samples(),
            late: 0,
            dropped_before: 0,
            preempted: 0,
            clock: clock_reading(),
            processor_before: Duration::ZERO,
            worst: Stages::default(),
        }
    }

    fn into_distributions(self) -> [Distribution; 12] {
        [
            self.sync_wake,
            self.sync_sent,
            self.sync_stamped,
            self.setpoint_wake,
            self.receive,
            self.compute,
            self.compute_axis,
            self.send,
            self.arrival,
            self.margin,
            self.bare,
            self.bare_compute,
        ]
    }
}

impl<const N: usize> Cycle<N> {
    fn new(
        options: Options,
        sockets: Vec<SocketCan>,
        plan: rtrb::Consumer<Instruction<N>>,
    ) -> Self {
        let granted = realtime::enter(&options.realtime);
        let mut stamps = "simulated bus";
        let mut notes = Vec::new();
        let mut ports = Ports::new();
        for port in sockets {
            notes.extend_from_slice(port.notes());
            stamps = match port.stamps() {
                StampSource::Hardware => "adapter",
                StampSource::Software => "kernel",
            };
            ports.push(Box::new(port));
        }
        let (driver, ahead) = if ports.is_empty() {
            let driver = ready_machine(&options.shape);
            let next = driver
                .controller
                .next_wake()
                .map_or(Instant::ZERO, Wake::at);
            let start = realtime::now() + Duration::from_millis(1);
            (driver, start.as_nanos() - next.as_nanos())
        } else {
            let start = realtime::now() + options.shape.period;
            let layout = Arc::new(options.shape.layout());
            let mut driver = Driver::new(layout, World::new(), ports, start);
            driver.controller.touch();
            (driver, 0)
        };
        Self {
            options,
            driver,
            plan,
            granted,
            stamps,
            notes,
            ahead,
        }
    }

    fn run(mut self, mut record: Record) -> Result<Outcome, PortError> {
        self.bring_up()?;
        record.start = realtime::now();
        record.processor_before = realtime::thread_time();
        record.dropped_before = self.driver.controller.late_setpoints();
        for _ in 0..self.options.cycles {
            let sync_at = self.sync(&mut record)?;
            self.setpoints(sync_at, &mut record)?;
            if self.options.control {
                self.bare(sync_at, &mut record);
            }
            if let Some(End::Fault(fault)) = self.driver.controller.end() {
                return Err(PortError {
                    bus: "bench".into(),
                    what: format!("the machine stopped: {fault:?}"),
                });
            }
        }
        Ok(self.outcome(record))
    }

    fn bring_up(&mut self) -> Result<(), PortError> {
        let give_up = realtime::now() + BRING_UP;
        while self.driver.controller.ready().is_none() {
            let wake = self
                .driver
                .controller
                .next_wake()
                .filter(|_| realtime::now() < give_up);
            let Some(wake) = wake else {
                return Err(PortError {
                    bus: "bench".into(),
                    what: format!("no bring-up: {:?}", self.driver.controller.end()),
                });
            };
            realtime::sleep_until(wake.at(), self.options.spin, || ());
            self.driver.step(realtime::now())?;
        }
        while matches!(self.driver.controller.next_wake(), Some(Wake::Setpoint(_))) {
            let wake = self
                .driver
                .controller
                .next_wake()
                .map_or(Instant::ZERO, Wake::at);
            let (_, now) = self.sleep_until(wake);
            self.driver.step(now)?;
        }
        Ok(())
    }

    /// Sleeps to an instant of the controller's clock. Gives the lateness, and the instant of the
    /// controller's clock at which it woke. Simulated buses live by the cycle: there it wakes in
    /// time, and a late wake-up delays controller and drives together.
    fn sleep_until(&mut self, instant: Instant) -> (Duration, Instant) {
        let due = instant + Duration::from_nanos(self.ahead);
        let controller = &self.driver.controller;
        realtime::sleep_until(due, self.options.spin, || controller.rehearse());
        let late = realtime::now().saturating_since(due);
        if !self.options.interfaces.is_empty() {
            return (late, instant + late);
        }
        if late > self.options.shape.period / LATE_SHARE {
            self.ahead += late.as_nanos() as u64;
        }
        (late, instant)
    }

    fn sync(&mut self, record: &mut Record) -> Result<Instant, PortError> {
        let due = self
            .driver
            .controller
            .next_wake()
            .map_or(Instant::ZERO, Wake::at);
        // A late wake-up delays simulated buses, and is none the less late for that.
        let due_here = due + Duration::from_nanos(self.ahead);
        let (late, now) = self.sleep_until(due);
        record.late += u64::from(late > self.options.shape.period / LATE_SHARE);
        self.driver.step(now)?;
        let sent = realtime::now().saturating_since(due_here);
        let at = realtime::now();
        record.sync_wake.record(late, at);
        record.sync_sent.record(sent, at);
        if self.options.control {
            record
                .ours
                .push(late.as_nanos().min(u32::MAX.into()) as u32);
        }
        Ok(due)
    }

    fn setpoints(&mut self, sync_at: Instant, record: &mut Record) -> Result<(), PortError> {
        let due = self
            .driver
            .controller
            .next_wake()
            .map_or(Instant::ZERO, Wake::at);
        let next_sync = sync_at + self.options.shape.period + Duration::from_nanos(self.ahead);
        let (late, now) = self.sleep_until(due);
        record.late += u64::from(late > self.options.shape.period / LATE_SHARE);
        let woken = realtime::now();
        for (_, received) in self.driver.collect(now)? {
            arrived(received, sync_at, woken, record);
        }
        let received = realtime::now();
        while self.driver.controller.room() > 0
            && let Ok(instruction) = self.plan.pop()
        {
            self.driver.controller.accept(instruction);
        }
        let (used, compute) = timed(record.clock, || self.driver.compute(now));
        if let Some(used) = used {
            record.compute.record(used, woken);
            let per_axis = used / self.options.shape.axes as u32;
            record.compute_axis.record(per_axis, woken);
        } else {
            record.preempted += 1;
        }
        let before_send = realtime::now();
        self.driver.send()?;
        let done = realtime::now();

        record.setpoint_wake.record(late, woken);
        let stages = Stages {
            at: woken.saturating_since(record.start),
            wake: late,
            receive: received.saturating_since(woken),
            compute,
            send: done.saturating_since(before_send),
        };
        record.receive.record(stages.receive, woken);
        record.send.record(stages.send, woken);
        if stages.total() > record.worst.total() {
            record.worst = stages;
        }
        record
            .margin
            .record(next_sync.saturating_since(done), woken);
        Ok(())
    }

    /// Wakes between the setpoints and the next SYNC: what cyclictest measures. Then times a
    /// computation that needs no memory: what it takes beyond its median is the host's.
    fn bare(&mut self, sync_at: Instant, record: &mut Record) {
        let sync_at = sync_at + Duration::from_nanos(self.ahead);
        let passed = realtime::now().saturating_since(sync_at);
        let free = self.options.shape.period.saturating_sub(passed);
        let due = sync_at + passed + free / 2;
        realtime::sleep_until(due, self.options.spin, || ());
        let late = realtime::now().saturating_since(due);
        record.bare.record(late, due);
        if let (Some(used), _) = timed(record.clock, multiply) {
            record.bare_compute.record(used, due);
        }
        record
            .theirs
            .push(late.as_nanos().min(u32::MAX.into()) as u32);
    }

    fn outcome(self, record: Record) -> Outcome {
        let processor = realtime::thread_time().saturating_sub(record.processor_before);
        let control = self.options.control.then(|| {
            let difference = |quantile| quantile_difference(&record.ours, &record.theirs, quantile);
            Some([("median", difference(0.5)?), ("p99", difference(0.99)?)])
        });
        Outcome {
            granted: self.granted,
            stamps: self.stamps,
            notes: self.notes,
            start: record.start,
            cycles: self.options.cycles,
            late: record.late,
            dropped: self.driver.controller.late_setpoints() - record.dropped_before,
            preempted: record.preempted,
            clock: record.clock,
            processor,
            worst: record.worst,
            control: control.flatten(),
            distributions: (record.into_distributions().into_iter())
                .filter(|distribution| distribution.count() > 0)
                .collect(),
        }
    }
}

/// The processor time that `work` takes, less what reading the clock takes at least, and how long it
/// took; no processor time if the processor was taken away meanwhile.
fn timed(clock: Duration, work: impl FnOnce()) -> (Option<Duration>, Duration) {
    let switches = realtime::usage().involuntary_switches;
    // Once for nothing: after a sleep the kernel's way there is cold.
    let _ = realtime::thread_time();
    let before = realtime::thread_time();
    let began = realtime::now();
    work();
    let took = realtime::now().saturating_since(began);
    let used = realtime::thread_time().saturating_sub(before);
    let undisturbed = realtime::usage().involuntary_switches == switches;
    (undisturbed.then(|| used.saturating_sub(clock)), took)
}

/// Some µs of multiplications, each of which waits for the one before.
fn multiply() {
    let mut number = black_box(1_u64);
    for _ in 0..1000 {
        number = black_box(number.wrapping_mul(6_364_136_223_846_793_005));
    }
}

/// The least of many times that reading the thread's clock takes.
fn clock_reading() -> Duration {
    let reading = |_| {
        let began = realtime::thread_time();
        realtime::thread_time().saturating_sub(began)
    };
    (0..1000).map(reading).min().unwrap_or_default()
}

/// Records how long after SYNC's instant a frame came.
fn arrived(received: &Received, sync_at: Instant, now: Instant, record: &mut Record) {
    let after = received.at.saturating_since(sync_at);
    let id = received.frame.id();
    if received.echo {
        if id == CobId::SYNC.into() {
            record.sync_stamped.record(after, now);
        }
    } else if matches!(id, CanId::Standard(id) if id & 0x780 == 0x280) {
        record.arrival.record(after, now);
    }
}
