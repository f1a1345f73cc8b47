//! The simulated CAN bus: frames take their exact time on the wire, in virtual time.
//!
//! A [`SimBus`] carries any number of [`BusNode`]s and one [`Port`], the controller's. Whoever wants
//! to send queues; when the bus is idle the heads of all queues arbitrate by identifier and the
//! winner occupies the wire for its exact length, stuff bits included. Everybody else receives it
//! at its end of frame; the next arbitration takes place an intermission (3 bit times) later.
//!
//! The driver alternates [`SimBus::advance_to`] with its own work at that instant; frames queued
//! by the port and by nodes at one instant all take part in the arbitration of that instant.
//! [`SimBus::next_event`] is when anything can happen next, so a virtual-time loop is
//!
//! ```
//! use syncline_canopen::{Frame, Instant, NodeId, Transmit};
//! use syncline_drives::bus::{Band, BitRate, BusNode, SimBus};
//!
//! /// Answers every frame with one byte on identifier 701h.
//! struct Parrot;
//! impl BusNode for Parrot {
//!     fn on_frame(&mut self, _: Instant, frame: &Frame, tx: &mut dyn Transmit) {
//!         let id = syncline_canopen::CanId::Standard(0x701);
//!         tx.transmit(Frame::new(id, &[frame.dlc()]));
//!     }
//!     fn poll(&mut self, _: Instant, _: &mut dyn Transmit) {}
//!     fn deadline(&self) -> Option<Instant> {
//!         None
//!     }
//! }
//!
//! let mut bus = SimBus::new(BitRate::from_kbit(1000).unwrap());
//! bus.attach(Parrot);
//! bus.send(Band::Sync, Frame::new(syncline_canopen::CobId::SYNC, &[]));
//! while let Some(next) = bus.next_event() {
//!     bus.advance_to(next, &mut |sent| println!("{:?} {:?}", sent.start, sent.frame));
//!     while let Some(received) = bus.receive() {
//!         println!("{:?} {:?} own: {}", received.at, received.frame, received.own);
//!     }
//! }
//! ```
//!
//! Several buses on one clock, with what their devices move, are a
//! [`World`](crate::world::World). Given the same calls the same frames
//! come out at the same nanosecond: nothing here is random.

mod port;
mod wire;

pub use port::{Band, Port, Received};
pub use wire::{BitRate, frame_bits};

use std::cell::Cell;
use std::collections::VecDeque;
use syncline_canopen::time::Duration;
use syncline_canopen::{CanId, Frame, Instant, Transmit};

/// A device on a bus, in simulation and behind a real socket alike.
pub trait BusNode {
    /// A frame that another node sent, at its end of frame.
    fn on_frame(&mut self, now: Instant, frame: &Frame, tx: &mut dyn Transmit);

    /// Time has reached [`BusNode::deadline`]. Afterwards the deadline lies after `now`.
    fn poll(&mut self, now: Instant, tx: &mut dyn Transmit);

    /// When the node wants to be polled next. Frames, polls and disturbances may bring that forward, and what mechanics do to its
    /// shaft may not: a [`World`](crate::world::World) asks again only where something happens on the bus.
    fn deadline(&self) -> Option<Instant>;
}

impl<N: BusNode + ?Sized> BusNode for Box<N> {
    fn on_frame(&mut self, now: Instant, frame: &Frame, tx: &mut dyn Transmit) {
        (**self).on_frame(now, frame, tx);
    }

    fn poll(&mut self, now: Instant, tx: &mut dyn Transmit) {
        (**self).poll(now, tx);
    }

    fn deadline(&self) -> Option<Instant> {
        (**self).deadline()
    }
}

/// Who put a frame on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sender {
    /// The controller's port.
    Port,
    /// The node with this index, as [`SimBus::attach`] returned it.
    Node(usize),
    /// Somebody else, as another master or a tool ([`SimBus::intrude`]).
    Stranger,
}

/// A frame and its place on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Transmission {
    /// First bit.
    pub start: Instant,
    /// Last bit of the end-of-frame field: receivers have the frame.
    pub end: Instant,
    /// Bits from the start of frame through the intermission, stuff bits included.
    pub bits: u32,
    /// Who sent it.
    pub sender: Sender,
    /// What was sent.
    pub frame: Frame,
}

/// A CAN bus in virtual time; see the [module](self).
pub struct SimBus<N> {
    bit_rate: BitRate,
    now: Instant,
    nodes: Vec<Attached<N>>,
    port: Port,
    strangers: Mailboxes,
    on_wire: Option<Transmission>,
    idle_from: Instant,
    /// The bits of the frame that was measured last: the next one to be sent, as a rule.
    measured: Cell<Option<(Frame, u32)>>,
}

struct Attached<N> {
    node: N,
    queue: Mailboxes,
}

impl<N: BusNode> SimBus<N> {
    /// An idle bus at the origin of time, with nobody but the port on it.
    #[must_use]
    pub fn new(bit_rate: BitRate) -> Self {
        Self {
            bit_rate,
            now: Instant::ZERO,
            nodes: Vec::new(),
            port: Port::new(),
            strangers: Mailboxes(VecDeque::new()),
            on_wire: None,
            idle_from: Instant::ZERO,
            measured: Cell::new(None),
        }
    }

    /// Puts a node on the bus and returns its index.
    pub fn attach(&mut self, node: N) -> usize {
        self.nodes.push(Attached {
            node,
            queue: Mailboxes(VecDeque::with_capacity(16)),
        });
        self.nodes.len() - 1
    }

    /// The nodes, in the order in which they were attached.
    pub fn nodes(&self) -> impl ExactSizeIterator<Item = &N> {
        self.nodes.iter().map(|attached| &attached.node)
    }

    /// A node, to look into it.
    ///
    /// # Panics
    /// If nothing was attached under this index.
    #[must_use]
    pub fn node(&self, index: usize) -> &N {
        &self.nodes[index].node
    }

    /// A node, to interfere with it (faults in tests).
    ///
    /// # Panics
    /// If nothing was attached under this index.
    pub fn node_mut(&mut self, index: usize) -> &mut N {
        &mut self.nodes[index].node
    }

    /// The bit rate.
    #[must_use]
    pub fn bit_rate(&self) -> BitRate {
        self.bit_rate
    }

    /// The instant that the bus has been advanced to.
    #[must_use]
    pub fn now(&self) -> Instant {
        self.now
    }

    /// Queues a frame of the controller at the present instant.
    pub fn send(&mut self, band: Band, frame: Frame) {
        self.port.queue(band, frame);
    }

    /// Queues a frame of nobody that is attached, as of another master, at the present instant.
    pub fn intrude(&mut self, frame: Frame) {
        self.strangers.transmit(frame);
    }

    /// The next frame that the port received, its own included, or `None`.
    pub fn receive(&mut self) -> Option<Received> {
        self.port.receive()
    }

    /// The earliest instant after which something may have changed: a frame ends or a node acts.
    /// `None` if nothing will happen until somebody sends.
    #[must_use]
    pub fn next_event(&self) -> Option<Instant> {
        let wake = self.next_wake();
        let frame = match &self.on_wire {
            Some(on_wire) => Some(on_wire.end),
            // What begins behind a wake ends behind it.
            None if wake.is_some_and(|wake| wake <= self.next_start()) => None,
            None => self.next_winner().map(|(_, frame)| {
                let (occupied, _) = self.occupation(&frame);
                self.next_start() + occupied
            }),
        };
        [frame, wake].into_iter().flatten().min()
    }

    /// Lets virtual time pass up to and including `until`: nodes act, frames travel, and
    /// `observer` sees every frame of the bus at its end, in bus order. An arbitration that falls
    /// on `until` itself stays open for frames that are queued at that instant.
    ///
    /// # Panics
    /// If `until` lies before [`SimBus::now`], or a node breaks the contract of [`BusNode::poll`].
    pub fn advance_to(&mut self, until: Instant, observer: &mut dyn FnMut(&Transmission)) {
        assert!(until >= self.now, "virtual time does not run backwards");
        let mut wake = self.next_wake();
        loop {
            let end = self.on_wire.as_ref().map(|on_wire| on_wire.end);
            let event = [end, wake].into_iter().flatten().min();
            if self.on_wire.is_none()
                && let start = self.next_start()
                && start < until
                && event.is_none_or(|event| start < event)
                && let Some((sender, frame)) = self.next_winner()
            {
                self.put_on_wire(start, sender, frame);
                continue;
            }
            let Some(event) = event.filter(|&event| event <= until) else {
                self.now = until;
                return;
            };
            self.now = self.now.max(event);
            if end == Some(event) {
                self.deliver(observer);
            } else {
                self.wake();
            }
            wake = self.next_wake();
        }
    }

    /// When the next frame starts if one is waiting and none is on the wire.
    fn next_start(&self) -> Instant {
        self.now.max(self.idle_from)
    }

    /// Time from the start of a frame to its last bit, and its bits through the intermission.
    fn occupation(&self, frame: &Frame) -> (Duration, u32) {
        let measured = self.measured.get().filter(|(last, _)| last == frame);
        let bits = measured.map_or_else(|| wire::frame_bits(frame), |(_, bits)| bits);
        self.measured.set(Some((*frame, bits)));
        (self.bit_rate.time(bits - wire::INTERMISSION_BITS), bits)
    }

    fn next_wake(&self) -> Option<Instant> {
        self.nodes
            .iter()
            .filter_map(|attached| attached.node.deadline())
            .min()
    }

    /// The arbitration among the heads of all queues; the port wins a tie.
    fn next_winner(&self) -> Option<(Sender, Frame)> {
        let nodes = self.nodes.iter().enumerate();
        let nodes = nodes.filter_map(|(index, it)| Some((Sender::Node(index), it.queue.head()?)));
        let port = self.port.head().map(|frame| (Sender::Port, frame));
        let stranger = self.strangers.head();
        let stranger = stranger.map(|frame| (Sender::Stranger, frame));
        let mut winner: Option<(u32, Sender, &Frame)> = None;
        for (sender, frame) in port.into_iter().chain(nodes).chain(stranger) {
            let field = arbitration_field(frame);
            if winner.is_none_or(|(least, ..)| field < least) {
                winner = Some((field, sender, frame));
            }
        }
        winner.map(|(_, sender, frame)| (sender, *frame))
    }

    fn put_on_wire(&mut self, start: Instant, sender: Sender, frame: Frame) {
        match sender {
            Sender::Port => self.port.take_head(),
            Sender::Node(index) => self.nodes[index].queue.take_head(),
            Sender::Stranger => self.strangers.take_head(),
        };
        let (occupied, bits) = self.occupation(&frame);
        let end = start + occupied;
        self.idle_from = start + self.bit_rate.time(bits);
        self.on_wire = Some(Transmission {
            start,
            end,
            bits,
            sender,
            frame,
        });
    }

    fn deliver(&mut self, observer: &mut dyn FnMut(&Transmission)) {
        let Some(sent) = self.on_wire.take() else {
            return;
        };
        observer(&sent);
        self.port.deliver(&sent);
        for (index, attached) in self.nodes.iter_mut().enumerate() {
            if sent.sender != Sender::Node(index) {
                attached
                    .node
                    .on_frame(sent.end, &sent.frame, &mut attached.queue);
            }
        }
    }

    fn wake(&mut self) {
        for attached in &mut self.nodes {
            if attached.node.deadline().is_some_and(|due| due <= self.now) {
                attached.node.poll(self.now, &mut attached.queue);
                assert!(
                    attached.node.deadline().is_none_or(|due| due > self.now),
                    "a polled node's next deadline lies in the future"
                );
            }
        }
    }
}

/// A device's transmit buffers: the most urgent frame first, as a CAN controller with a mailbox
/// for each object sends them; frames of one identifier stay in their order.
struct Mailboxes(VecDeque<Frame>);

impl Mailboxes {
    fn head(&self) -> Option<&Frame> {
        self.0.front()
    }

    fn take_head(&mut self) {
        self.0.pop_front();
    }
}

impl Transmit for Mailboxes {
    fn transmit(&mut self, frame: Frame) {
        let urgency = arbitration_field(&frame);
        let place = self
            .0
            .partition_point(|queued| arbitration_field(queued) <= urgency);
        self.0.insert(place, frame);
    }
}

/// What decides arbitration, lowest first: base identifier, RTR or SRR, IDE, extension, RTR.
fn arbitration_field(frame: &Frame) -> u32 {
    let remote = u32::from(frame.is_remote());
    match frame.id() {
        CanId::Standard(id) => u32::from(id) << 21 | remote << 20,
        CanId::Extended(id) => (id >> 18) << 21 | 0b11 << 19 | (id & 0x3_FFFF) << 1 | remote,
    }
}
