//! A simulated device: the CANopen node in front of a twin as the device's processor runs it, and the
//! twin's own [`Firmware`] behind it.
//!
//! [`canopen::node`](syncline_canopen::node) is the protocol: dictionary, SDO, PDO, NMT,
//! heartbeat, EMCY. A [`Device`] adds what makes it a device: answers leave after the time
//! that a processor takes, events are looked for once a millisecond, power fails and returns,
//! frames get lost.

mod outbox;
mod processor;
mod tampering;

pub use processor::Processor;
pub use tampering::Tampering;

use super::device::{Disturbance, Observation, SimulatedDevice};
use super::random::Random;
use super::servo::cascade::Gains;
use super::servo::power_stage::PowerStage;
use super::servo::shaft::Shaft;

use crate::bus::BusNode;
use core::ops::Range;
use outbox::Outbox;
use syncline_canopen::dictionary::Dictionary;
use syncline_canopen::node::{Application, LocalNode, Options};
use syncline_canopen::pdo::TransmissionType;
use syncline_canopen::time::Duration;
use syncline_canopen::{CobId, Frame, Instant, NodeId, Transmit, nmt};

/// How often a device looks after its state without being addressed.
const TASK: Duration = Duration::from_millis(1);

/// What a device's processor runs behind its CANopen interface.
pub trait Firmware: Application {
    /// Lets the device's loops run up to `now`.
    fn run_until(&mut self, now: Instant);

    /// The control supply is gone: nothing drives anything any more, and what is not stored is
    /// forgotten.
    fn power_off(&mut self);

    /// The shaft that its motor turns, or that turns its encoder, if it has one.
    fn shaft(&self) -> Option<&Shaft> {
        None
    }

    /// The same, to be turned by something else.
    fn shaft_mut(&mut self) -> Option<&mut Shaft> {
        None
    }

    /// Whether the power stage is on.
    fn is_powered(&self) -> bool {
        false
    }

    /// Torque of the motor, N·m.
    fn torque(&self) -> f64 {
        0.0
    }

    /// The gains of its loops, as its objects set them; of a servo drive.
    fn gains(&self) -> Option<&Gains> {
        None
    }

    /// Its power stage, where one is simulated.
    fn power_stage(&self) -> Option<&PowerStage> {
        None
    }

    /// The same, to be joined to those of others.
    fn power_stage_mut(&mut self) -> Option<&mut PowerStage> {
        None
    }

    /// Interferes with what is behind the node and the shaft; what it does not have is left alone.
    fn disturb(&mut self, disturbance: Disturbance);

    /// A digital input of it is on or off from now on, as something touches where its shaft was at `place`,
    /// revolutions, which matters to what captures positions alone.
    fn touch(&mut self, input: u8, on: bool, _place: f64) {
        self.disturb(Disturbance::Input(input, on));
    }

    /// The levels of its digital outputs, one bit each from the first one on; 0 without any that a controller may set.
    fn outputs(&self) -> u16 {
        0
    }

    /// Whether the node takes a frame from the bus.
    fn hears(&self, _: &Frame) -> bool {
        true
    }

    /// Whether what the node sends can be understood on the bus.
    fn is_heard(&self) -> bool {
        true
    }
}

/// The times that a device's processor takes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Delays {
    /// From SYNC or event until a T_PDO, heartbeat or EMCY is handed to the CAN controller.
    pub t_pdo: Range<Duration>,
    /// From a request to its SDO answer.
    pub sdo: Range<Duration>,
}

impl Delays {
    /// None at all.
    pub const NONE: Self = Self {
        t_pdo: Duration::ZERO..Duration::ZERO,
        sdo: Duration::ZERO..Duration::ZERO,
    };
}

/// A node with its firmware; see the [module](self).
#[derive(Debug)]
pub struct Device<F> {
    node: LocalNode,
    /// The node's deadline, which is asked for at every event of the bus and changes only where the node acts.
    node_due: Option<Instant>,
    pub(super) firmware: F,
    delays: Delays,
    boot_time: Duration,
    outbox: Outbox,
    /// What the node has just sent.
    sent: Vec<Frame>,
    next_task: Instant,
    power_cycle: bool,
    lost_t_pdos: u32,
    is_deaf: bool,
}

impl<F: Firmware> Device<F> {
    /// A device that is switched on at the origin of time; it sends its boot-up then.
    ///
    /// `options` are those of the node but for its boot time, and `random` makes the delays.
    pub(super) fn switched_on(
        processor: Processor,
        firmware: F,
        options: Options,
        random: Random,
    ) -> Self {
        let Processor {
            delays, boot_time, ..
        } = processor;
        let options = Options {
            boot_time,
            ..options
        };
        let mut node = LocalNode::new(processor.node, firmware.objects(), options);
        node.power_on(Instant::ZERO);
        Self {
            node_due: node.deadline(),
            node,
            firmware,
            delays,
            boot_time,
            outbox: Outbox::new(random),
            sent: Vec::with_capacity(16),
            next_task: Instant::ZERO,
            power_cycle: false,
            lost_t_pdos: 0,
            is_deaf: false,
        }
    }

    /// Whether a frame is lost on its way to the device.
    fn misses(&self, frame: &Frame) -> bool {
        let r_pdo = |number| frame.id() == CobId::r_pdo(number, self.node.id()).into();
        self.is_deaf && (1..=4).any(r_pdo)
    }

    /// Lets the loops run up to `now`, where power may have failed meanwhile.
    fn advance(&mut self, now: Instant) {
        self.firmware.run_until(now);
        if core::mem::take(&mut self.power_cycle) {
            self.outbox.clear();
            self.firmware.power_off();
            self.node.power_on(now + self.boot_time);
            self.node_due = self.node.deadline();
        }
    }

    /// The node has acted. Passes on what it has sent, delayed as a device's processor delays it.
    fn dispatch(&mut self, now: Instant) {
        self.node_due = self.node.deadline();
        if self.node.state() == nmt::State::Initialising {
            self.outbox.clear();
        }
        let delays = &self.delays;
        for frame in self.sent.drain(..) {
            let t_pdo = self.node.t_pdo(frame.id());
            if t_pdo.is_some() && self.lost_t_pdos > 0 {
                self.lost_t_pdos -= 1;
            } else if self.node.is_sdo_answer(frame.id()) {
                self.outbox.send_within(now, &delays.sdo, frame);
            } else if t_pdo.is_some_and(|number| is_synchronous(self.firmware.objects(), number)) {
                self.outbox.send_within(now, &delays.t_pdo, frame);
            } else {
                self.outbox.send_behind(now, &delays.t_pdo, frame);
            }
        }
    }
}

fn is_synchronous(objects: &Dictionary, t_pdo: u16) -> bool {
    let kind = objects.value(0x1800 + t_pdo - 1, 2).unwrap_or(255);
    TransmissionType::from(kind as u8).is_synchronous()
}

impl<F: Firmware> BusNode for Device<F> {
    fn on_frame(&mut self, now: Instant, frame: &Frame, tx: &mut dyn Transmit) {
        if !self.firmware.hears(frame) || self.misses(frame) {
            return self.firmware.run_until(now);
        }
        self.advance(now);
        if (self.node).on_frame(now, frame, &mut self.firmware, &mut self.sent) {
            self.dispatch(now);
        }
        self.outbox.flush(now, tx);
    }

    fn poll(&mut self, now: Instant, tx: &mut dyn Transmit) {
        let mut unheard = Vec::new();
        let tx = match self.firmware.is_heard() {
            true => tx,
            false => &mut unheard,
        };
        self.advance(now);
        let task = self.next_task <= now;
        // Events are looked for by the task, not whenever a frame leaves: noise that is mapped
        // into an event-driven T_PDO would fill the bus otherwise.
        if task || self.node_due.is_some_and(|due| due <= now) {
            self.node.poll(now, &mut self.firmware, &mut self.sent);
            self.dispatch(now);
        }
        self.outbox.flush(now, tx);
        if task {
            self.next_task = now + TASK;
        }
    }

    fn deadline(&self) -> Option<Instant> {
        let due = self
            .node_due
            .map_or(self.next_task, |due| due.min(self.next_task));
        Some(self.outbox.deadline().map_or(due, |leaves| leaves.min(due)))
    }
}

impl<F: Firmware + Send + 'static> SimulatedDevice for Device<F> {
    fn node(&self) -> NodeId {
        self.node.id()
    }

    fn observe(&self) -> Observation {
        let shaft = self.firmware.shaft();
        Observation {
            nmt_state: self.node.state(),
            is_powered: self.firmware.is_powered(),
            position: shaft.map_or(0.0, Shaft::position),
            velocity: shaft.map_or(0.0, Shaft::velocity),
            load_position: shaft.map_or(0.0, Shaft::load_position),
            load_velocity: shaft.map_or(0.0, |shaft| shaft.load_motion().velocity),
            at: shaft.map(Shaft::at),
            torque: self.firmware.torque(),
            outside: shaft.map_or(0.0, Shaft::pushed),
            supply: self.firmware.power_stage().map(PowerStage::supply_now),
        }
    }

    fn gains(&self) -> Option<&Gains> {
        self.firmware.gains()
    }

    fn disturb(&mut self, disturbance: Disturbance) {
        match disturbance {
            Disturbance::Mute(muted) => self.outbox.mute(muted),
            Disturbance::Deaf(deaf) => self.is_deaf = deaf,
            Disturbance::LoseTPdos(count) => self.lost_t_pdos = count,
            Disturbance::Reset => self.power_cycle = true,
            Disturbance::Block(blocked) => {
                if let Some(shaft) = self.firmware.shaft_mut() {
                    shaft.block(blocked);
                }
            }
            Disturbance::LoseTorque(lost) => {
                if let Some(shaft) = self.firmware.shaft_mut() {
                    shaft.lose_torque(lost);
                }
            }
            other => self.firmware.disturb(other),
        }
    }

    fn touch(&mut self, input: u8, on: bool, place: f64) {
        self.firmware.touch(input, on, place);
    }

    fn outputs(&self) -> u16 {
        self.firmware.outputs()
    }

    fn shaft_mut(&mut self) -> Option<&mut Shaft> {
        self.firmware.shaft_mut()
    }

    fn power_stage_mut(&mut self) -> Option<&mut PowerStage> {
        self.firmware.power_stage_mut()
    }

    fn run_until(&mut self, now: Instant) {
        self.firmware.run_until(now);
    }
}
