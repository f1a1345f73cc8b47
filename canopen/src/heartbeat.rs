//! Heartbeat (CiA 301): a node tells its state at a fixed pace, others watch for it.

use crate::nmt::State;
use crate::{CanId, CobId, Frame, Instant, NodeId, Transmit, time::Duration};

/// A node's heartbeat or boot-up message.
#[must_use]
pub fn encode(node: NodeId, state: State) -> Frame {
    Frame::new(CobId::error_control(node), &[state as u8])
}

/// Whose heartbeat, boot-up ([`State::Initialising`]) or guarding answer a frame is, and the
/// state in it.
#[must_use]
pub fn decode(frame: &Frame) -> Option<(NodeId, State)> {
    let (node, state) = state_byte(frame)?;
    Some((node, State::from_byte(state)?))
}

/// As [`decode`], but the state as a number, without the toggle bit of guarding: there are only four
/// that CiA 301 defines.
#[must_use]
pub fn state_byte(frame: &Frame) -> Option<(NodeId, u8)> {
    let CanId::Standard(id) = frame.id() else {
        return None;
    };
    let node = NodeId::new((id.checked_sub(0x700)?).try_into().ok()?)?;
    let &[byte] = frame.data() else {
        return None;
    };
    Some((node, byte & 0x7F))
}

/// A node's own heartbeat (1017h).
#[derive(Clone, Debug, Default)]
pub struct Producer {
    period: Duration,
    next: Option<Instant>,
}

impl Producer {
    /// No heartbeat yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            period: Duration::ZERO,
            next: None,
        }
    }

    /// Starts anew with the first heartbeat at `first`; a period of zero is no heartbeat.
    pub fn start(&mut self, first: Instant, period: Duration) {
        self.period = period;
        self.next = (!period.is_zero()).then_some(first);
    }

    /// Whether heartbeats are sent.
    #[must_use]
    pub const fn is_on(&self) -> bool {
        self.next.is_some()
    }

    /// When the next heartbeat is due.
    #[must_use]
    pub const fn deadline(&self) -> Option<Instant> {
        self.next
    }

    /// Sends the heartbeat that is due; after a long silence one, not several.
    pub fn poll(
        &mut self,
        now: Instant,
        id: CobId,
        state: State,
        tx: &mut (impl Transmit + ?Sized),
    ) {
        let Some(due) = self.next.filter(|&due| now >= due) else {
            return;
        };
        tx.transmit(Frame::new(id, &[state as u8]));
        let next = due + self.period;
        self.next = Some(if next > now { next } else { now + self.period });
    }
}

/// What a watched node's messages tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Event {
    /// The node has started anew.
    BootUp,
    /// The node has entered this state, or is heard for the first time.
    State(State),
}

/// One node watched by its heartbeat (one entry of 1016h).
///
/// It serves both ways to supervise. Who wants an event when time is up waits for
/// [`Self::deadline`] and calls [`Self::poll`], as a device does: time is up at that instant. Who
/// looks once a cycle asks [`Self::is_alive`], as a controller does: it has taken every frame up to
/// the instant at which it looks, so that a heartbeat on the very limit would not have been late.
#[derive(Clone, Debug)]
pub struct Consumer {
    node: NodeId,
    time: Duration,
    /// What it said last.
    byte: Option<u8>,
    heard: Option<Instant>,
    expires: Option<Instant>,
}

impl Consumer {
    /// Watches `node`: from its first heartbeat on, none may be later than `time`.
    #[must_use]
    pub const fn new(node: NodeId, time: Duration) -> Self {
        Self {
            node,
            time,
            byte: None,
            heard: None,
            expires: None,
        }
    }

    /// The node watched.
    #[must_use]
    pub const fn node(&self) -> NodeId {
        self.node
    }

    /// How late a heartbeat may be.
    #[must_use]
    pub const fn time(&self) -> Duration {
        self.time
    }

    /// The state last heard, [`State::Initialising`] after a boot-up message; `None` before the
    /// first message, after a missed heartbeat, and after a byte that is no state.
    #[must_use]
    pub const fn state(&self) -> Option<State> {
        match self.byte {
            Some(byte) => State::from_byte(byte),
            None => None,
        }
    }

    /// The byte last heard, whether or not it is a [`State`]; `None` before the first message and after
    /// a missed heartbeat.
    #[must_use]
    pub const fn byte(&self) -> Option<u8> {
        self.byte
    }

    /// When [`Self::poll`] wants to be called.
    #[must_use]
    pub const fn deadline(&self) -> Option<Instant> {
        self.expires
    }

    /// Forgets what was heard, as before the node is reset.
    pub const fn forget(&mut self) {
        self.byte = None;
        self.heard = None;
        self.expires = None;
    }

    /// Takes a frame if it comes from the node; tells only what is new.
    ///
    /// A byte that is no state, also one with the toggle bit of an answer to node guarding, is a
    /// sign of life of a node whose state is not known; it is no heartbeat.
    pub fn on_frame(&mut self, now: Instant, frame: &Frame) -> Option<Event> {
        let &[byte] = frame.data() else {
            return None;
        };
        if frame.id() != CanId::from(CobId::error_control(self.node)) {
            return None;
        }
        self.on_byte(now, byte)
    }

    /// Takes what the node says of its state: the byte of its heartbeat, or that of its answer to node guarding without the
    /// toggle bit; otherwise as [`Self::on_frame`].
    pub fn on_byte(&mut self, now: Instant, byte: u8) -> Option<Event> {
        self.heard = Some(now);
        let before = self.byte.replace(byte);
        match State::from_byte(byte)? {
            State::Initialising => {
                // A boot-up message is not a heartbeat: watching starts with the first of those.
                self.expires = None;
                Some(Event::BootUp)
            }
            state => {
                self.expires = Some(now + self.time);
                (before != Some(byte)).then_some(Event::State(state))
            }
        }
    }

    /// Whether the heartbeat is missing: true once, then again only after another heartbeat.
    pub fn poll(&mut self, now: Instant) -> bool {
        let missing = self.expires.is_some_and(|expires| now >= expires);
        if missing {
            self.byte = None;
            self.expires = None;
        }
        missing
    }

    /// Whether the node has been heard, by a boot-up message too, and not longer ago than the
    /// time, so long still allowed. One that was never heard is not alive.
    #[must_use]
    pub fn is_alive(&self, now: Instant) -> bool {
        self.heard
            .is_some_and(|heard| now.saturating_since(heard) <= self.time)
    }
}
