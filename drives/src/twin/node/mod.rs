//! The CANopen node in front of a twin, as the device's processor runs it.
//!
//! [`canopen::node`](syncline_canopen::node) is the protocol: dictionary, SDO, PDO, NMT,
//! heartbeat, EMCY. A [`DeviceNode`] adds what makes it a device: answers leave after the time
//! that a processor takes, events are looked for once a millisecond, power fails and returns,
//! frames get lost. What stands behind it is the twin's [`Firmware`].

mod outbox;

use super::random::Random;
use core::ops::Range;
use outbox::Outbox;
use syncline_canopen::dictionary::Dictionary;
use syncline_canopen::node::{Application, Node, Options};
use syncline_canopen::pdo::TransmissionType;
use syncline_canopen::time::Duration;
use syncline_canopen::{Frame, Instant, NodeId, Transmit, nmt};

/// How often a device looks after its state without being addressed.
const TASK: Duration = Duration::from_millis(1);

/// What a device's processor runs behind its CANopen interface.
pub trait Firmware: Application {
    /// Lets the device's loops run up to `now`.
    fn run_until(&mut self, now: Instant);

    /// The control supply is gone: nothing drives anything any more, and what is not stored is
    /// forgotten.
    fn power_off(&mut self);
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

/// A node with its delays; see the [module](self).
#[derive(Debug)]
pub struct DeviceNode {
    node: Node,
    delays: Delays,
    boot_time: Duration,
    outbox: Outbox,
    /// What the node has just sent.
    sent: Vec<Frame>,
    next_task: Instant,
    power_cycle: bool,
    lost_t_pdos: u32,
}

impl DeviceNode {
    /// The node of a device that is switched on at the origin of time; it sends its boot-up then.
    #[must_use]
    pub fn new(
        id: NodeId,
        objects: &Dictionary,
        options: Options,
        delays: Delays,
        random: Random,
    ) -> Self {
        let mut node = Node::new(id, objects, options);
        node.power_on(Instant::ZERO);
        Self {
            node,
            delays,
            boot_time: options.boot_time,
            outbox: Outbox::new(random),
            sent: Vec::with_capacity(16),
            next_task: Instant::ZERO,
            power_cycle: false,
            lost_t_pdos: 0,
        }
    }

    /// The node id.
    #[must_use]
    pub fn id(&self) -> NodeId {
        self.node.id()
    }

    /// The NMT state.
    #[must_use]
    pub fn state(&self) -> nmt::State {
        self.node.state()
    }

    // ---- interference ----

    /// While true, nothing that the node sends reaches the bus.
    pub fn mute(&mut self, muted: bool) {
        self.outbox.mute(muted);
    }

    /// Loses the next `count` T_PDOs.
    pub fn lose_t_pdos(&mut self, count: u32) {
        self.lost_t_pdos = count;
    }

    /// Power fails and returns; the boot-up message comes after the boot time.
    pub fn power_cycle(&mut self) {
        self.power_cycle = true;
    }

    // ---- on the bus ----

    /// A frame from the bus.
    pub fn on_frame(
        &mut self,
        now: Instant,
        frame: &Frame,
        firmware: &mut impl Firmware,
        tx: &mut dyn Transmit,
    ) {
        self.run_until(now, firmware);
        self.node.on_frame(now, frame, firmware, &mut self.sent);
        self.dispatch(now, firmware);
        self.outbox.flush(now, tx);
    }

    /// Does what is due.
    pub fn poll(&mut self, now: Instant, firmware: &mut impl Firmware, tx: &mut dyn Transmit) {
        self.run_until(now, firmware);
        let task = self.next_task <= now;
        // Events are looked for by the task, not whenever a frame leaves: noise that is mapped
        // into an event-driven T_PDO would fill the bus otherwise.
        if task || self.node.deadline().is_some_and(|due| due <= now) {
            self.node.poll(now, firmware, &mut self.sent);
            self.dispatch(now, firmware);
        }
        self.outbox.flush(now, tx);
        if task {
            self.next_task = now + TASK;
        }
    }

    /// When [`Self::poll`] wants to be called at the latest.
    #[must_use]
    pub fn deadline(&self) -> Option<Instant> {
        let due = [
            self.node.deadline(),
            self.outbox.deadline(),
            Some(self.next_task),
        ];
        due.into_iter().flatten().min()
    }

    fn run_until(&mut self, now: Instant, firmware: &mut impl Firmware) {
        firmware.run_until(now);
        if core::mem::take(&mut self.power_cycle) {
            self.outbox.clear();
            firmware.power_off();
            self.node.power_on(now + self.boot_time);
        }
    }

    /// Passes on what the node has sent: delayed as a drive's processor delays it.
    fn dispatch(&mut self, now: Instant, firmware: &impl Firmware) {
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
            } else if t_pdo.is_some_and(|number| is_synchronous(firmware.objects(), number)) {
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
