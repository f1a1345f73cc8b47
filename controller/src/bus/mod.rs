//! One CAN bus as the controller sees it: what it is handed, and what it wants sent.
//!
//! - [`Received`]: a frame that came
//! - [`Outbox`]: what is to leave after one wake-up, by priority
//! - [`Burst`]: what became of a cycle's setpoints
//! - [`BusFault`]: what the adapter reports of the bus itself
//!
//! Plain values: a [`Port`](crate::port::Port) carries them over a bus that there is.

mod fault;

pub use fault::{BusFault, FaultCounts, Severity};

use syncline_canopen::{CobId, Frame, Instant, Transmit};

/// Most frames in one burst: every R_PDO of a bus in one cycle.
pub const BURST_CAPACITY: usize = 64;

/// A frame that came in, or one of our own that left (transmit echo).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Received {
    /// End of frame, as well as the port can tell.
    pub at: Instant,
    /// The frame.
    pub frame: Frame,
    /// Whether this is the echo of a frame that we sent.
    pub echo: bool,
}

/// What the controller wants sent on one bus after one wake-up, by priority band.
#[derive(Clone, Debug, Default)]
pub struct Outbox {
    /// SYNC: leaves first, on its own.
    pub sync: Option<Frame>,
    /// The R_PDOs of one cycle: all leave, or none.
    pub burst: FrameBuf,
    /// SDO, NMT, heartbeat: in order, behind everything else.
    pub acyclic: FrameBuf,
}

impl Outbox {
    /// Forgets everything.
    pub fn clear(&mut self) {
        self.sync = None;
        self.burst.clear();
        self.acyclic.clear();
    }
}

/// A fixed-capacity run of frames; nothing allocates.
#[derive(Clone, Debug)]
pub struct FrameBuf {
    frames: [Frame; BURST_CAPACITY],
    len: usize,
}

impl FrameBuf {
    /// Forgets everything.
    pub fn clear(&mut self) {
        self.len = 0;
    }

    /// The frames in order.
    #[must_use]
    pub fn as_slice(&self) -> &[Frame] {
        &self.frames[..self.len]
    }

    /// Room left, in frames.
    #[must_use]
    pub fn room(&self) -> usize {
        BURST_CAPACITY - self.len
    }
}

impl Default for FrameBuf {
    fn default() -> Self {
        Self {
            frames: [Frame::new(CobId::SYNC, &[]); BURST_CAPACITY],
            len: 0,
        }
    }
}

/// Frames beyond the capacity are a defect of the caller.
impl Transmit for FrameBuf {
    fn transmit(&mut self, frame: Frame) {
        self.frames[self.len] = frame;
        self.len += 1;
    }
}

/// What became of a burst.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Burst {
    /// Every frame is in the transmit queue.
    Queued,
    /// The queue was full: no frame of it was queued.
    Dropped,
    /// Only the first `queued` frames fitted.
    Torn {
        /// Frames queued.
        queued: usize,
    },
}
