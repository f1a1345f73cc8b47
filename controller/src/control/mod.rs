//! The controller: bring-up, SYNC cycle, supervision and end, without I/O.
//!
//! It is handed frames ([`Controller::receive`]) and woken at two instants a cycle
//! ([`Controller::next_wake`]); it fills one [`Outbox`] a bus. Nothing here asks what time it is,
//! so that real time and virtual time drive the same code.
//!
//! ```text
//!  t_k             t_k + d                                            t_k+1
//!   │ SYNC k │ T_PDO × N │ R_PDO × N (for SYNC k+1) │ SDO … │ quiet │ SYNC k+1
//!  Wake::Sync      Wake::Setpoint: supervise, sample, send the burst
//! ```
//!
//! - [`layout`]: the machine as the controller needs it
//! - `phases`: bring-up, program, end, in their order, each a [`Phase`]
//! - [`fault`], [`event`]: why it stopped, what it tells
//! - [`functions`]: what M-codes switch, at their place on the path
//! - `homing`: how axes come to know where they are
//! - `inputs`: the machine's inputs that mean something
//! - `limit_switches`: those beyond which no axis is sent
//! - `beside_path`: what probings, homings and threads have in common: what came of them, holding and going on
//! - `threading`: lines in step with the spindle
//! - `rest`: why a job rests
//! - `sampled`: motion that others have planned, sample by sample
//! - `probing`: towards what a probe touches, and where that was
//! - `jogs`: how far, how fast and how long axes are jogged
//! - `node`, `sdo_sequence`, `polls`: a device over its bus; what it is asked by SDO, and what instead of its T_PDOs
//! - `setpoint_misses`: bursts that missed their SYNC; [`loss`]: in what time it is noticed that a device is gone
//! - [`state`]: what operators may ask for, and when; `order`: what session and feeder order
//! - [`job`]: what the machine works on, one after the other
//! - `instruction`: what the program feeds to the cycle, and where the path rests for it
//! - `user_codes`: M-codes that run a command outside
//! - `point_to_point`: axes that go to targets beside the path
//! - [`spindle`]: a spindle that a drive turns; `orientation`: one that is held at an angle
//! - `axis`: planned position to increments, following error
//! - [`reaction`], `supervision`: what is done about what happens, the table and its execution
//! - [`measured`]: encoders on shafts of their own
//! - `burst`: what is sent behind each SYNC, setpoints for the next one and requests
//! - `survey`: drives that are found with power
//! - `setpoint_guard`: the last look at a setpoint before it is sent

mod axis;
mod beside_path;
mod burst;
pub mod event;
pub mod fault;
pub mod functions;
mod homing;
mod inputs;
mod instruction;
pub mod job;
mod jogs;
pub mod layout;
mod limit_switches;
pub mod loss;
pub mod measured;
mod node;
mod order;
mod orientation;
mod phases;
mod point_to_point;
mod polls;
mod probing;
pub mod reaction;
mod rest;
mod sampled;
mod sdo_sequence;
mod setpoint_guard;
mod setpoint_misses;
pub mod spindle;
pub mod state;
mod supervision;
mod survey;
#[cfg(test)]
mod tests;
mod threading;
mod user_codes;

pub use axis::{AxisSample, AxisTorque, SidesApart, ToldTorque};
pub use beside_path::Found;
pub use event::{Event, Phase};
pub use fault::Fault;
pub use functions::{MachineFunctions, Switch};
pub use homing::{HomingFailure, LostReference, NotRecalled};
pub use inputs::{InputIndex, InputWait, Signal, SignalLevels};
pub use instruction::{Instruction, StopPoint};
pub use job::{Job, JobKind, Outcome};
pub use jogs::HOLD_TO_RUN;
pub use layout::Layout;
pub use measured::MeasuredSample;
pub use order::{Order, Refusal};
pub use point_to_point::PointToPoint;
pub use probing::{KnownBy, ProbeFailure, ProbeMove};
pub use reaction::{Cause, Clearing, Reaction};
pub use rest::{Hold, Pause, Waiting, ZeroOverrides};
pub use setpoint_guard::Quantity;
pub use spindle::SpindleSample;
pub use state::{NotNow, Request, State};
pub use threading::{ThreadFailure, ThreadMove};
pub use user_codes::UserCall;

use crate::bus::{Burst, BusFault, Outbox, Received, Severity};
use crate::machine::MEASURED;
use axis::AxisControl;
use beside_path::BesidePath;
use fault::{BusCause, BusIndex, DeviceCause, DeviceIndex, Names};
use functions::Switches;
use homing::Homing;
use inputs::{Awaited, Inputs};
use job::Aside;
use limit_switches::LimitSwitches;
use node::DeviceNode;
use orientation::Orienter;
use probing::Probing;
use reaction::RULES;
use rest::RestsFor;
use sampled::AlongSamples;
use setpoint_misses::SetpointMisses;
use spindle::SpindleWatch;
use std::collections::VecDeque;
use std::hint::black_box;
use std::mem::replace;
use std::sync::Arc;
use syncline_canopen::response_time::{bit_time, worst_case_bits};
use syncline_canopen::time::Duration;
use syncline_canopen::{CobId, Frame, Instant, Transmit, nmt};
use syncline_gcode::ANALOG_INPUTS;
use syncline_trajectory::path::{Executor, Leg, Setpoint, Shaping};
use syncline_trajectory::shaper::Method;
use threading::Threading;
use user_codes::UserCalls;

/// Events that wait to be fetched at most; more are dropped, newest first.
const EVENT_CAPACITY: usize = 1024;
/// How long a drive has to stand still before its setpoint is frozen, an axis has to be in
/// position before its mode ends, and a spindle has to turn at its speed before a cut; at least [`STILL_CYCLES`].
const STILL: Duration = Duration::from_millis(50);
/// See [`STILL`].
const STILL_CYCLES: u32 = 5;
/// Cycles after the first side of a gantry within which the other one has to be enabled, too.
const SIDES_ENABLE: u32 = 50;
/// How long a path that could go on rests until a plan that does not come is a fault. A planner, and
/// a program that computes before it moves, may take a while in real time; none takes so long.
const NO_PLAN: Duration = Duration::from_secs(30);
/// Cycles that a command stands at least, so that its effect is seen in a T_PDO.
const COMMAND_CYCLES: u64 = 3;

/// When the controller wants to be woken, and for what.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wake {
    /// To send SYNC.
    Sync(Instant),
    /// To supervise and to send the setpoints for the next SYNC.
    Setpoint(Instant),
}

impl Wake {
    /// The instant.
    #[must_use]
    pub fn at(self) -> Instant {
        match self {
            Self::Sync(at) | Self::Setpoint(at) => at,
        }
    }
}

/// What happened at one SYNC of the program: a row of the trace.
#[derive(Clone, Copy, Debug)]
pub struct Row<const N: usize> {
    /// Cycles since the mode was started.
    pub cycle: u64,
    /// The number of this SYNC on each bus, from 1.
    pub sync: u64,
    /// When it was due.
    pub at: Instant,
    /// The plan at the setpoint that this SYNC latched.
    pub plan: Setpoint<N>,
    /// By coordinate of the plan.
    pub axes: [AxisSample; N],
    /// What the program has switched by then.
    pub functions: MachineFunctions,
    /// The same, but outputs that are wired as they are at their terminals: also safe ones, and those that were switched by hand.
    pub put_out: MachineFunctions,
    /// What the drive of the spindle measures, if one turns it.
    pub spindle: Option<SpindleSample>,
    /// What the analog inputs are, in the order of the machine file.
    pub analog_inputs: [f64; ANALOG_INPUTS],
    /// What the encoders on shafts of their own measure, in the order of the machine file.
    pub measured: [Option<MeasuredSample>; MEASURED],
    /// Program line of the block that is at work while the path rests for it.
    pub rests_for: Option<u32>,
    /// Program line of the block that is served while the path dwells.
    pub dwells_for: Option<u32>,
    /// A thread is cut, or begins: the axes are with the spindle, or wait for it.
    pub threads: bool,
    /// What the job waits for, where nothing moves and no operator holds it.
    pub waiting: Option<Waiting>,
    /// How many cycles ago the axes were at the first of the samples that they go along.
    pub along: Option<u64>,
}

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum End {
    /// The program finished.
    Finished,
    /// It was told to stop.
    Interrupted,
    /// A machine that stays on was switched off.
    SwitchedOff,
    /// A fault.
    Fault(Fault),
}

impl End {
    /// How a run ended, in words.
    #[must_use]
    pub fn describe(&self, names: &impl Names) -> String {
        match self {
            Self::Finished => "program finished".to_owned(),
            Self::Interrupted => "interrupted by a stop".to_owned(),
            Self::SwitchedOff => "switched off".to_owned(),
            Self::Fault(fault) => format!("stopped: {}", fault.describe(names)),
        }
    }
}

/// What the machine is going to, and stays at.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Goal {
    /// Drives enabled, their setpoints follow the plan.
    Ready,
    /// Drives disabled.
    Disabled,
    /// Off, and this is how the run ended.
    Off(End),
}

/// Controls one machine along plans of `N` coordinates.
#[derive(Clone, Debug)]
pub struct Controller<const N: usize> {
    layout: Arc<Layout>,
    nodes: Vec<DeviceNode>,
    axes: Vec<AxisControl>,
    events: VecDeque<Event>,

    /// SYNC of the running cycle, as scheduled.
    sync_at: Instant,
    cycle: u64,
    setpoint_is_next: bool,
    sync_on: bool,
    /// NMT commands were sent, so that its nodes are this controller's to take out of Operational again.
    commands_nodes: bool,
    /// Another controller was heard before any node was commanded: all stay as they are.
    left_to_another: bool,
    /// SYNCs sent.
    syncs: u64,
    /// When the running cycle's SYNC left.
    sync_sent: Option<Instant>,
    heartbeat_due: Instant,
    misses: Vec<SetpointMisses>,
    /// By bus: the R_PDOs of a burst, by identifier: drive, and which of its own.
    bursts: Vec<Vec<(DeviceIndex, usize)>>,
    /// By bus: it failed, and no drive has been heard on it since.
    lost: Vec<bool>,
    /// By bus: the drive whose turn it is to use the acyclic room.
    turn: Vec<usize>,

    phase: Phase,
    phase_cycle: u64,
    /// What the phase does once, after its entry, has been done.
    acted: bool,
    goal: Goal,
    /// The drives are brought back after a fault, which moves nothing.
    resets: bool,
    /// What stopped the machine, the first cause first, until it is reset.
    faults: Vec<Fault>,
    /// Also without a job.
    stays_on: bool,
    job: Option<Job>,
    /// The last job that is over.
    over: Option<(u64, Outcome)>,
    aside: Aside,

    executor: Executor<N>,
    /// By coordinate: in which cycle its continuous jog ends unless it is renewed.
    jogs_until: [u64; N],
    /// By coordinate: where the travel of an axis ends in the direction of its last jog, 1 or -1, until that is over.
    jogs_towards: [Option<(f64, f64)>; N],
    shaping: Shaping<N>,
    /// The plan, shaped, at the setpoint that the next SYNC latches.
    planned: Setpoint<N>,
    /// Cycle of the first row.
    mode_cycle: Option<u64>,
    /// The axes are where the plan says; before, setpoints follow the actual positions.
    frozen: bool,
    /// A SYNC was left out: its setpoint is skipped.
    left_out: bool,
    row: Option<Row<N>>,
    /// The last cycle in which setpoints moved.
    moved: u64,
    /// Axes are sent other setpoints for the next SYNC than for the last one: those that wait for a later drive go on
    /// where the plan rests.
    setpoints_change: bool,
    in_position: u32,
    /// The last mark of the plan; there is never another one behind it before it is passed.
    stop_point: Option<(u32, StopPoint)>,
    homing: Homing,
    /// The move that the path waits for.
    positioning: Option<point_to_point::Progress>,
    probing: Probing<N>,
    beside_path: BesidePath<N>,
    /// What the job's last reading of inputs and outputs found.
    signals_read: Option<SignalLevels>,
    /// What the last M66 found, of any job.
    input_result: f64,
    threading: Threading<N>,
    along_samples: AlongSamples<N>,
    switches: Switches,
    spindle: SpindleWatch,
    orienter: Orienter,
    inputs: Inputs,
    limit_switches: LimitSwitches,
    /// While the path rests at an M66.
    awaited: Option<Awaited>,
    calls: UserCalls,
    pause_told: bool,
    /// M1 is a stop.
    optional_stop: bool,
    /// Something of the job's plan was handed in.
    begun: bool,
    /// For so many cycles the path has rested for want of a plan.
    unplanned: u64,
    /// At rest until an operator goes on.
    held: bool,
    /// What asked for the hold.
    held_by: Hold,
    /// What holds it, as told.
    told_hold: Hold,
    rests_for: RestsFor,
    /// The leg of the way back to the path that was told last, while it is next.
    told_leg: Option<Leg<N>>,
    /// As told.
    told_state: State,
    /// As told.
    late_plans: u64,
    /// Where the path rested as it was to go back, if it did: as [`Setpoint::distance`].
    retraced_from: Option<f64>,
}

impl<const N: usize> Controller<N> {
    /// A controller that wants to be woken first at `start`, for one job; see
    /// [`stay_on`](Self::stay_on).
    ///
    /// # Panics
    /// If an axis of the layout is beyond `N` coordinates.
    #[must_use]
    pub fn new(layout: Arc<Layout>, start: Instant) -> Self {
        assert!(layout.axes.iter().all(|axis| axis.coordinate < N));
        let period = layout.cycle.as_secs_f64();
        let mut executor = Executor::new([0.0; N], period);
        executor.set_retraction(layout.retraction);
        if layout.shaper_method != Some(Method::Coordinates)
            && let Some(spread) = layout.shaper.spread(period)
        {
            executor.settle(spread);
        }
        let bursts: Vec<_> = layout.buses.iter().map(|bus| layout.burst(bus)).collect();
        Self {
            nodes: (0..layout.devices.len())
                .map(|drive| DeviceNode::new(drive, &layout))
                .collect(),
            axes: (0..layout.axes.len())
                .map(|axis| AxisControl::new(axis, &layout))
                .collect(),
            events: VecDeque::with_capacity(EVENT_CAPACITY),
            sync_at: start,
            cycle: 0,
            setpoint_is_next: false,
            sync_on: false,
            commands_nodes: false,
            left_to_another: false,
            syncs: 0,
            sync_sent: None,
            heartbeat_due: start,
            misses: (bursts.iter().enumerate())
                .map(|(bus, burst)| SetpointMisses::new(bus, burst.len()))
                .collect(),
            bursts,
            lost: vec![false; layout.buses.len()],
            turn: vec![0; layout.buses.len()],
            phase: Phase::Survey,
            phase_cycle: 0,
            acted: false,
            goal: Goal::Ready,
            resets: false,
            faults: Vec::with_capacity(most_faults(&layout)),
            stays_on: false,
            job: Some(Job::ONLY),
            over: None,
            aside: Aside::None,
            planned: executor.setpoint(),
            shaping: Shaping::new(&layout.shaper, period, executor.setpoint()),
            executor,
            jogs_until: [0; N],
            jogs_towards: [None; N],
            mode_cycle: None,
            frozen: false,
            left_out: false,
            row: None,
            moved: 0,
            setpoints_change: false,
            in_position: 0,
            stop_point: None,
            homing: Homing::new(layout.axes.iter().map(|axis| axis.drives.len())),
            positioning: None,
            probing: Probing::new(),
            beside_path: BesidePath::new(),
            signals_read: None,
            input_result: 0.0,
            threading: Threading::new(),
            along_samples: AlongSamples::default(),
            switches: Switches::new(&layout),
            spindle: SpindleWatch::new(&layout),
            orienter: Orienter::default(),
            inputs: Inputs::new(&layout.inputs, layout.cycle),
            limit_switches: LimitSwitches::new(&layout),
            awaited: None,
            calls: UserCalls::default(),
            pause_told: false,
            optional_stop: false,
            begun: false,
            unplanned: 0,
            held: false,
            held_by: Hold::Operator,
            told_hold: Hold::Operator,
            rests_for: RestsFor::default(),
            told_leg: None,
            told_state: State::Starting,
            late_plans: 0,
            retraced_from: None,
            layout,
        }
    }

    /// Writes once to the memory that is for its plan, as [`Executor::touch`], for cycles in real time.
    pub fn touch(&mut self) {
        self.executor.touch();
    }

    /// Puts the first wake-up off to `start`, as long as it has not come.
    pub fn begin_at(&mut self, start: Instant) {
        debug_assert!(self.cycle == 0 && !self.setpoint_is_next);
        self.sync_at = start;
        self.heartbeat_due = start;
    }

    // --- the two instants of the cycle ---

    /// When to call [`Controller::wake`] next; `None` once the machine is at its end.
    #[must_use]
    pub fn next_wake(&self) -> Option<Wake> {
        match self.phase {
            Phase::Done => None,
            _ if self.setpoint_is_next => {
                Some(Wake::Setpoint(self.sync_at + self.layout.setpoint_offset))
            }
            _ => Some(Wake::Sync(self.sync_at)),
        }
    }

    /// The wake-up that [`Controller::next_wake`] asked for, at the instant at which it came.
    /// Every frame that arrived until then has been handed in; `out` has one outbox a bus.
    pub fn wake(&mut self, now: Instant, out: &mut [Outbox]) {
        if self.setpoint_is_next {
            self.on_setpoint(now, out);
            self.cycle += 1;
            self.sync_at += self.layout.cycle;
        } else {
            self.leave_out_lost_cycles(now);
            self.on_sync(now, out);
        }
        self.setpoint_is_next = !self.setpoint_is_next;
    }

    /// After a wake-up so late that whole cycles are over: their SYNCs are not made up for, the
    /// next one comes at its own instant. One lost cycle is a dropped setpoint, the next is again
    /// that of its own instant; more are a fault, and the stop begins where the plan was left, so
    /// that no drive sees a setpoint far from its last one.
    fn leave_out_lost_cycles(&mut self, now: Instant) {
        let late = now.saturating_since(self.sync_at);
        let lost = whole_nanos(late) / whole_nanos(self.layout.cycle);
        if lost > 0 && self.streams() {
            self.tell(Event::LostCycles { lost, late });
            for cycle in (self.cycle..).take(lost.min(2) as usize) {
                (0..self.misses.len()).for_each(|bus| self.miss(bus, cycle));
            }
            if self.frozen {
                // The next SYNC latches what the lost ones would have.
                for axis in &mut self.axes {
                    axis.lose_cycles(self.cycle, lost);
                }
                self.left_out = lost == 1;
            }
        }
        self.cycle += lost;
        self.sync_at += self.layout.cycle * u32::try_from(lost).unwrap_or(u32::MAX);
    }

    fn on_sync(&mut self, now: Instant, out: &mut [Outbox]) {
        self.row = None;
        if self.phase == Phase::Survey && !self.acted {
            self.enter(Phase::Survey, out);
            self.acted = true;
        }
        if self.sync_on {
            for outbox in out.iter_mut() {
                outbox.sync = Some(Frame::new(CobId::SYNC, &[]));
            }
            self.syncs += 1;
            self.sync_sent = Some(now);
            for node in &mut self.nodes {
                node.on_sync();
            }
        }
        self.show_life(out);
    }

    /// The controller's heartbeat, right behind SYNC: there it is the one frame in the way of the
    /// T_PDOs that the budget counts on, and never on its way when the next SYNC is due.
    fn show_life(&mut self, out: &mut [Outbox]) {
        if self.sync_at < self.heartbeat_due {
            return self.guard(out);
        }
        self.heartbeat_due = self.sync_at + self.layout.heartbeat;
        let state = nmt::State::Operational as u8;
        let heartbeat = Frame::new(CobId::error_control(self.layout.node), &[state]);
        for outbox in out {
            outbox.acyclic.transmit(heartbeat);
        }
    }

    /// In a cycle without the controller's heartbeat its place on each bus goes to one guarding request, if one is due.
    fn guard(&mut self, out: &mut [Outbox]) {
        for (bus, outbox) in self.layout.buses.iter().zip(out) {
            let mut devices = bus.devices.iter();
            devices.any(|&device| self.nodes[device].guard(self.sync_at, &mut outbox.acyclic));
        }
    }

    /// What is decided here is decided by the instant that was asked for, so that it does not
    /// depend on how late the thread woke; `now` only tells whether the burst comes too late.
    fn on_setpoint(&mut self, now: Instant, out: &mut [Outbox]) {
        let due = self.sync_at + self.layout.setpoint_offset;
        self.row = None;
        for bus in 0..self.misses.len() {
            if self.misses[bus].has_missed() {
                self.miss(bus, self.cycle);
            }
        }
        self.watch_references();
        if let Err(fault) = self.take_references() {
            self.fail(fault);
        }
        if let Err(fault) = self.watch_inputs() {
            self.fail(fault);
        }
        self.watch_contact();
        if let Err(fault) = self.watch_limit_switches() {
            self.fail(fault);
        }
        self.supervise(due);
        self.end_lost_jogs();
        self.tell_travel_ends();
        if let Err(fault) = self.step(out) {
            self.fail(fault);
        }
        let waiting = self.waits_for();
        if let Some(row) = &mut self.row {
            row.waiting = waiting;
        }
        self.command(now, out);
        self.send_acyclic(due, out);
        let state = self.state();
        if replace(&mut self.told_state, state) != state {
            self.tell(Event::State(state));
        }
    }

    /// Goes through what the wake-up for the setpoints of a moving machine works with, so that the
    /// processor's caches have it; changes nothing.
    pub fn rehearse(&self) {
        if !self.setpoint_is_next || !(Phase::Square..=Phase::Stop).contains(&self.phase) {
            return;
        }
        black_box(self.executor.setpoint());
        for axis in &self.axes {
            black_box(axis.sample(self.cycle, &self.nodes));
        }
        for node in &self.nodes {
            black_box(node.check(node.setpoint).is_ok());
            black_box(node.check_follows(true).is_ok());
        }
    }

    /// Takes a frame of a bus, before the wake-up for the setpoints that follows its arrival.
    pub fn receive(&mut self, bus: BusIndex, received: &Received) {
        let Received { at, frame, echo } = received;
        if !echo && let Some(cause) = self.layout.second_master(frame) {
            self.fail(Fault::Bus(bus, cause));
            return;
        }
        let Some(drive) = self.layout.buses[bus].node_of(frame) else {
            return;
        };
        let node = &mut self.nodes[drive];
        // What was on its way when SYNC was due has left before it; behind SYNC it would come later than by its own length.
        let in_time = || {
            let bits = worst_case_bits(frame.id(), frame.dlc());
            let own = bit_time(bits, self.layout.buses[bus].bit_rate);
            self.sync_sent.is_none_or(|sync| *at <= sync + own)
        };
        if *echo {
            if in_time() && node.r_pdos().iter().any(|sent| sent.id() == frame.id()) {
                let unsent = &mut self.misses[bus].unsent;
                *unsent = unsent.saturating_sub(1);
            }
            return;
        }
        self.lost[bus] = false;
        self.misses[bus].answered |= node.is_answer(frame) && in_time();
        let mut events = event_sink(&mut self.events);
        let outcome = node.receive(*at, frame, self.sync_sent, &mut events);
        drop(events);
        match outcome {
            // The set-up resets what was wrong before; what is wrong still shows after it.
            Err(Fault::Device(device, DeviceCause::Emergency { emergency }))
                if self.phase < Phase::SetUp =>
            {
                self.tell(Event::Emergency { device, emergency });
            }
            Err(fault) => self.fail(fault),
            Ok(()) => {}
        }
    }

    /// What became of the burst of the last wake-up on a bus.
    pub fn burst_sent(&mut self, bus: BusIndex, frames: usize, burst: Burst, echoes: bool) {
        match burst {
            Burst::Queued if echoes => self.misses[bus].unsent = frames as u32,
            Burst::Queued => {}
            Burst::Dropped => {
                self.misses[bus].forget_burst();
                self.miss(bus, self.cycle);
            }
            Burst::Torn { .. } => self.fail(Fault::Bus(bus, BusCause::TornBurst)),
        }
    }

    /// A wake-up came so late that a strict run ends.
    pub fn woke_late(&mut self, late: Duration) {
        let late_ns = late.as_nanos() as u64;
        self.fail(Fault::LateWakeUp { late_ns });
    }

    /// A bus' interface failed.
    pub fn bus_failed(&mut self, bus: BusIndex) {
        self.lost[bus] = true;
        for &device in &self.layout.buses[bus].devices {
            self.nodes[device].lose_count();
        }
        self.fail(Fault::Bus(bus, BusCause::Failed));
    }

    /// The adapter of a bus reported something although the bus can be used on.
    pub fn bus_reports(&mut self, bus: BusIndex, fault: BusFault) {
        match fault.severity() {
            Severity::Stop => self.fail(Fault::Bus(bus, BusCause::ErrorPassive)),
            _ => self.tell(Event::BusWarning { bus, fault }),
        }
    }

    /// Before and behind the path the setpoints do not change, so that the ones before are as good;
    /// and there answers to SDO requests may be in their way.
    fn miss(&mut self, bus: BusIndex, cycle: u64) {
        if !(Phase::Square..=Phase::Stop).contains(&self.phase) {
            return;
        }
        self.tell(Event::LateSetpoint { bus, cycle });
        if let Err(fault) = self.misses[bus].miss(cycle) {
            self.fail(fault);
        }
    }

    fn tell(&mut self, event: Event) {
        event_sink(&mut self.events)(event);
    }

    // --- what it tells ---

    /// The next thing worth a line in the log.
    pub fn event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    /// What happened at the SYNC before the last setpoint wake-up, while a program runs.
    #[must_use]
    pub fn row(&self) -> Option<&Row<N>> {
        self.row.as_ref()
    }

    /// The running cycle, counted from the first one.
    #[must_use]
    pub fn cycle(&self) -> u64 {
        self.cycle
    }

    /// Where the machine is.
    #[must_use]
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// How the run ends, as soon as that is decided.
    #[must_use]
    pub fn end(&self) -> Option<End> {
        match self.goal {
            Goal::Off(end) => Some(end),
            Goal::Ready | Goal::Disabled => None,
        }
    }

    /// What stopped the machine, the first cause first, until it is reset.
    #[must_use]
    pub fn faults(&self) -> &[Fault] {
        &self.faults
    }

    /// Bursts that missed their SYNC, of all buses.
    #[must_use]
    pub fn late_setpoints(&self) -> u64 {
        self.misses.iter().map(|bus| bus.count).sum()
    }
}

/// As many faults as there can be that do not repeat one another: for each cause one of each subject. So their list takes no
/// memory in the cycle.
fn most_faults(layout: &Layout) -> usize {
    let subjects = [
        layout.devices.len(),
        layout.axes.len(),
        layout.buses.len(),
        layout.inputs.len(),
    ];
    (subjects.iter().sum::<usize>() + 1) * RULES.len()
}

/// As a processor divides them: 64 bits are 584 years.
fn whole_nanos(time: Duration) -> u64 {
    time.as_nanos() as u64
}

fn event_sink(events: &mut VecDeque<Event>) -> impl FnMut(Event) {
    |event| {
        if events.len() < EVENT_CAPACITY {
            events.push_back(event);
        }
    }
}
