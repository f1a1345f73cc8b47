//! The controller's attachment to a simulated bus.

use super::{Sender, Transmission};
use std::collections::VecDeque;
use syncline_canopen::{Frame, Instant};

/// The priority bands of the controller's transmit queue, most urgent first. A frame waits for
/// all frames of more urgent bands and for those queued before it in its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Band {
    /// SYNC.
    Sync,
    /// The cycle's burst of R_PDOs.
    Pdo,
    /// SDO, NMT, heartbeat.
    Acyclic,
}

/// A frame as the port received it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Received {
    /// The end of the frame on the wire.
    pub at: Instant,
    /// Whether this is the echo of a frame that the port itself sent: it has left.
    pub own: bool,
    /// The frame.
    pub frame: Frame,
}

/// Queues of frames to send and of frames received.
pub struct Port {
    bands: [VecDeque<Frame>; 3],
    received: VecDeque<Received>,
}

impl Port {
    pub(super) fn new() -> Self {
        Self {
            bands: core::array::from_fn(|_| VecDeque::with_capacity(128)),
            received: VecDeque::with_capacity(256),
        }
    }

    pub(super) fn queue(&mut self, band: Band, frame: Frame) {
        self.bands[band as usize].push_back(frame);
    }

    pub(super) fn head(&self) -> Option<&Frame> {
        self.bands.iter().find_map(VecDeque::front)
    }

    pub(super) fn take_head(&mut self) {
        if let Some(band) = self.bands.iter_mut().find(|band| !band.is_empty()) {
            band.pop_front();
        }
    }

    pub(super) fn deliver(&mut self, sent: &Transmission) {
        self.received.push_back(Received {
            at: sent.end,
            own: sent.sender == Sender::Port,
            frame: sent.frame,
        });
    }

    pub(super) fn receive(&mut self) -> Option<Received> {
        self.received.pop_front()
    }
}
