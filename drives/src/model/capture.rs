//! Capture inputs: at an edge of theirs a drive keeps its position by itself, to be read later.
//!
//! Of an edge that is looked for in the samples of SYNC no more is known than between which two of them it was,
//! which is the further apart the faster the axis moves. What the drive captures is as good as its encoder and
//! the jitter of the capture ([`NodeSpec::capture_jitter`](super::NodeSpec::capture_jitter)). Captures are armed and
//! read by SDO, while the axes rest, so that no cycle has a frame more for them.

use super::{Address, Assumption, Write};

/// A digital input at whose edges a drive keeps its position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CaptureInput {
    /// Its place among [`Model::inputs`](super::Model::inputs).
    pub input: usize,
    /// How it captures where the input comes on.
    pub rising: Capture,
    /// How it captures where the input goes off.
    pub falling: Capture,
}

/// How a drive keeps its position at one kind of edge of an input, and how that is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Capture {
    /// Written in this order, it forgets what it kept, and waits for the next edge.
    pub arm: [Write; 2],
    /// The object that tells whether an edge has come since …
    pub status: Address,
    /// … by these bits.
    pub stored: u32,
    /// The object that then holds the position of the first one, as the drive counts.
    pub position: Address,
}

impl Capture {
    /// The writes after which the drive waits for the next edge of this and of `other`, which both arm by the same
    /// objects: what one of them sets stays where the other is set.
    #[must_use]
    pub fn armed_with(&self, other: &Self) -> [Write; 2] {
        core::array::from_fn(|place| self.arm[place].with_bits_of(&other.arm[place]))
    }
}

/// How exactly a drive captures.
pub(super) const CAPTURE_JITTER: Assumption = Assumption {
    name: "capture_jitter_us",
    default: 10,
    allowed: 0..=1_000_000,
    meaning: "longest time in µs between an edge of a capture input and the instant whose position is kept",
};
