//! Node guarding and life guarding (CiA 301): a master asks for a node's state, and the node
//! notices when it no longer does.

use crate::nmt::State;
use crate::{CanId, CobId, Frame, Instant, NodeId, Transmit, time::Duration};

/// A master's question for a node's state.
#[must_use]
pub fn request(node: NodeId) -> Option<Frame> {
    Frame::remote(CobId::error_control(node), 1)
}

/// A node's side: answers requests, and misses them after the life time (100Ch × 100Dh).
#[derive(Clone, Debug, Default)]
pub struct Slave {
    life_time: Duration,
    toggle: bool,
    expires: Option<Instant>,
}

impl Slave {
    /// Not guarded yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            life_time: Duration::ZERO,
            toggle: false,
            expires: None,
        }
    }

    /// Sets the life time; zero is no life guarding. It starts with the next request.
    pub fn set_life_time(&mut self, life_time: Duration) {
        self.life_time = life_time;
        self.disarm();
    }

    /// Misses no request until another one has come.
    pub const fn disarm(&mut self) {
        self.expires = None;
    }

    /// Answers a guarding request, which came on the same identifier, with state and toggle bit.
    pub fn answer(
        &mut self,
        now: Instant,
        id: CobId,
        state: State,
        tx: &mut (impl Transmit + ?Sized),
    ) {
        let byte = state as u8 | u8::from(self.toggle) << 7;
        tx.transmit(Frame::new(id, &[byte]));
        self.toggle = !self.toggle;
        self.expires = (!self.life_time.is_zero()).then(|| now + self.life_time);
    }

    /// When [`Self::poll`] wants to be called.
    #[must_use]
    pub const fn deadline(&self) -> Option<Instant> {
        self.expires
    }

    /// Whether the master has fallen silent: true once, then again only after another request.
    pub fn poll(&mut self, now: Instant) -> bool {
        self.expires.take_if(|expires| now >= *expires).is_some()
    }
}

/// What a master learns of a guarded node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Event {
    /// The node has started anew.
    BootUp,
    /// The node has entered this state, or answers for the first time.
    State(State),
    /// The node answered with the wrong toggle bit.
    Toggle,
    /// The node has not answered for its life time.
    Lost,
}

/// A master's side: asks one node at every guard time.
#[derive(Clone, Debug)]
pub struct Master {
    node: NodeId,
    guard_time: Duration,
    life_time_factor: u8,
    toggle: bool,
    state: Option<State>,
    /// More than any factor, once it is lost.
    unanswered: u16,
    next: Instant,
}

impl Master {
    /// Guards `node` from `now` on: lost after `life_time_factor` requests without an answer; 0 is never.
    #[must_use]
    pub const fn new(
        node: NodeId,
        guard_time: Duration,
        life_time_factor: u8,
        now: Instant,
    ) -> Self {
        Self {
            node,
            guard_time,
            life_time_factor,
            toggle: false,
            state: None,
            unanswered: 0,
            next: now,
        }
    }

    /// When [`Self::poll`] wants to be called.
    #[must_use]
    pub const fn deadline(&self) -> Instant {
        self.next
    }

    /// Asks when it is time to; tells once when the node is lost.
    pub fn poll(&mut self, now: Instant, tx: &mut (impl Transmit + ?Sized)) -> Option<Event> {
        if now < self.next {
            return None;
        }
        self.next = now + self.guard_time;
        let factor = self.life_time_factor.into();
        let lost = factor > 0 && self.unanswered == factor;
        self.unanswered = self.unanswered.saturating_add(1);
        if lost {
            self.state = None;
        }
        if let Some(request) = request(self.node) {
            tx.transmit(request);
        }
        lost.then_some(Event::Lost)
    }

    /// Takes a frame if it comes from the node; tells only what is new.
    pub fn on_frame(&mut self, frame: &Frame) -> Option<Event> {
        if frame.id() != CanId::from(CobId::error_control(self.node)) {
            return None;
        }
        let &[byte] = frame.data() else {
            return None;
        };
        let state = State::from_byte(byte & 0x7F)?;
        if state == State::Initialising {
            self.toggle = false;
            self.state = None;
            self.unanswered = 0;
            return Some(Event::BootUp);
        }
        let toggle = byte & 0x80 != 0;
        if toggle != self.toggle && self.state.is_some() {
            return Some(Event::Toggle);
        }
        self.unanswered = 0;
        self.toggle = !toggle;
        (self.state.replace(state) != Some(state)).then_some(Event::State(state))
    }
}
