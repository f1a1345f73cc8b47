//! Network management (CiA 301): the master's commands and a node's state.

use crate::{CanId, CobId, Frame, NodeId};
use core::fmt;

/// What an NMT master commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Command {
    /// Start remote node: go to Operational.
    Start = 0x01,
    /// Stop remote node: go to Stopped.
    Stop = 0x02,
    /// Go to Pre-Operational.
    EnterPreOperational = 0x80,
    /// Reset the application and the communication.
    ResetNode = 0x81,
    /// Reset the communication alone.
    ResetCommunication = 0x82,
}

impl Command {
    /// The command with this byte, if there is one.
    #[must_use]
    pub const fn from_byte(byte: u8) -> Option<Self> {
        match byte {
            0x01 => Some(Self::Start),
            0x02 => Some(Self::Stop),
            0x80 => Some(Self::EnterPreOperational),
            0x81 => Some(Self::ResetNode),
            0x82 => Some(Self::ResetCommunication),
            _ => None,
        }
    }
}

impl fmt::Display for Command {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Start => "Start",
            Self::Stop => "Stop",
            Self::EnterPreOperational => "Enter Pre-operational",
            Self::ResetNode => "Reset node",
            Self::ResetCommunication => "Reset communication",
        })
    }
}

/// An NMT message: a command to one node or to all.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Request {
    /// What to do.
    pub command: Command,
    /// The node addressed; `None` is every node.
    pub node: Option<NodeId>,
}

impl Request {
    /// The message on the wire.
    #[must_use]
    pub fn encode(self) -> Frame {
        let node = self.node.map_or(0, NodeId::get);
        Frame::new(CobId::NMT, &[self.command as u8, node])
    }

    /// The request that a frame carries; `None` if it is no well-formed NMT message.
    #[must_use]
    pub fn decode(frame: &Frame) -> Option<Self> {
        if frame.id() != CanId::from(CobId::NMT) {
            return None;
        }
        let &[command, node] = frame.data() else {
            return None;
        };
        let node = match node {
            0 => None,
            node => Some(NodeId::new(node)?),
        };
        Some(Self {
            command: Command::from_byte(command)?,
            node,
        })
    }

    /// Whether `node` is addressed.
    #[must_use]
    pub fn addresses(self, node: NodeId) -> bool {
        self.node.is_none_or(|addressed| addressed == node)
    }
}

impl fmt::Display for Request {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.node {
            None => write!(f, "{} to all nodes", self.command),
            Some(node) => write!(f, "{} to node {node}", self.command),
        }
    }
}

/// An NMT state, as heartbeat and guarding carry it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum State {
    /// Starting; on the wire the boot-up message.
    Initialising = 0x00,
    /// NMT and error control only.
    Stopped = 0x04,
    /// Everything.
    Operational = 0x05,
    /// Everything but PDO.
    PreOperational = 0x7F,
}

impl State {
    /// The state with this number, if there is one.
    #[must_use]
    pub const fn from_byte(byte: u8) -> Option<Self> {
        match byte {
            0x00 => Some(Self::Initialising),
            0x04 => Some(Self::Stopped),
            0x05 => Some(Self::Operational),
            0x7F => Some(Self::PreOperational),
            _ => None,
        }
    }

    /// Whether SDO, SYNC and EMCY are alive.
    #[must_use]
    pub const fn communicates(self) -> bool {
        matches!(self, Self::PreOperational | Self::Operational)
    }
}

/// What an NMT command makes of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Event {
    /// The node is in this state now.
    Entered(State),
    /// The owner resets application and communication objects, then [enters](Slave::enter) Pre-Operational.
    ResetNode,
    /// The owner resets communication objects, then [enters](Slave::enter) Pre-Operational.
    ResetCommunication,
}

/// A node's side of NMT.
#[derive(Clone, Debug)]
pub struct Slave {
    node: NodeId,
    state: State,
}

impl Slave {
    /// A node before its boot-up.
    #[must_use]
    pub const fn new(node: NodeId) -> Self {
        Self {
            node,
            state: State::Initialising,
        }
    }

    /// The node's id.
    #[must_use]
    pub const fn node(&self) -> NodeId {
        self.node
    }

    /// The node's state.
    #[must_use]
    pub const fn state(&self) -> State {
        self.state
    }

    /// Changes the state without a command: at the end of the initialisation, by 1029h.
    pub fn enter(&mut self, state: State) {
        self.state = state;
    }

    /// Obeys a frame if it is an NMT command to this node; tells only what is new.
    pub fn on_frame(&mut self, frame: &Frame) -> Option<Event> {
        let request = Request::decode(frame)?;
        if !request.addresses(self.node) || self.state == State::Initialising {
            return None;
        }
        let (state, event) = match request.command {
            Command::Start => (State::Operational, Event::Entered(State::Operational)),
            Command::Stop => (State::Stopped, Event::Entered(State::Stopped)),
            Command::EnterPreOperational => {
                (State::PreOperational, Event::Entered(State::PreOperational))
            }
            Command::ResetNode => (State::Initialising, Event::ResetNode),
            Command::ResetCommunication => (State::Initialising, Event::ResetCommunication),
        };
        (core::mem::replace(&mut self.state, state) != state).then_some(event)
    }
}
