//! Classical CAN frames (CAN 2.0A/B).

use crate::id::CanId;
use core::fmt;

/// A classical CAN frame: data, or a remote request.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Frame {
    id: CanId,
    remote: bool,
    len: u8,
    data: [u8; 8],
}

impl Frame {
    /// A data frame.
    ///
    /// # Panics
    /// If `data` is longer than 8 bytes; frames from outside go through [`Frame::try_new`].
    #[must_use]
    pub fn new(id: impl Into<CanId>, data: &[u8]) -> Self {
        Self::try_new(id, data).expect("at most 8 data bytes")
    }

    /// A data frame, or `None` if `data` is longer than 8 bytes.
    #[must_use]
    pub fn try_new(id: impl Into<CanId>, data: &[u8]) -> Option<Self> {
        let mut bytes = [0; 8];
        bytes.get_mut(..data.len())?.copy_from_slice(data);
        Some(Self {
            id: id.into(),
            remote: false,
            len: data.len() as u8,
            data: bytes,
        })
    }

    /// A remote transmission request with data length code `dlc` (at most 8), or `None`.
    #[must_use]
    pub fn remote(id: impl Into<CanId>, dlc: u8) -> Option<Self> {
        (dlc <= 8).then(|| Self {
            id: id.into(),
            remote: true,
            len: dlc,
            data: [0; 8],
        })
    }

    /// The identifier.
    #[must_use]
    pub const fn id(&self) -> CanId {
        self.id
    }

    /// Whether this is a remote transmission request.
    #[must_use]
    pub const fn is_remote(&self) -> bool {
        self.remote
    }

    /// The data length code, 0…8.
    #[must_use]
    pub const fn dlc(&self) -> u8 {
        self.len
    }

    /// The data bytes; empty for a remote request.
    #[must_use]
    pub fn data(&self) -> &[u8] {
        if self.remote {
            &[]
        } else {
            &self.data[..self.len as usize]
        }
    }
}

/// As candump prints it: `181#3162`, `701#R1`.
impl fmt::Debug for Frame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.id {
            CanId::Standard(id) => write!(f, "{id:03X}#")?,
            CanId::Extended(id) => write!(f, "{id:08X}#")?,
        }
        if self.remote {
            return write!(f, "R{}", self.len);
        }
        self.data()
            .iter()
            .try_for_each(|byte| write!(f, "{byte:02X}"))
    }
}

/// Where a state machine puts the frames that it wants sent, in order.
pub trait Transmit {
    /// Takes one frame for transmission.
    fn transmit(&mut self, frame: Frame);
}

impl Transmit for Vec<Frame> {
    fn transmit(&mut self, frame: Frame) {
        self.push(frame);
    }
}
