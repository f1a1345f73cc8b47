//! Emergency messages (CiA 301).

use crate::{CanId, CobId, Frame, Instant, NodeId, Transmit, time::Duration};

/// Bits of the error register 1001h.
pub mod register {
    /// Any error.
    pub const GENERIC: u8 = 1 << 0;
    /// Current.
    pub const CURRENT: u8 = 1 << 1;
    /// Voltage.
    pub const VOLTAGE: u8 = 1 << 2;
    /// Communication.
    pub const COMMUNICATION: u8 = 1 << 4;
    /// What the device profile defines.
    pub const PROFILE: u8 = 1 << 5;
    /// What the manufacturer defines.
    pub const MANUFACTURER: u8 = 1 << 7;
}

/// Error codes of CiA 301 that a node raises by itself.
pub mod code {
    /// All errors are gone.
    pub const NO_ERROR: u16 = 0x0000;
    /// Anything without a code of its own.
    pub const GENERIC: u16 = 0x1000;
    /// A guarding request or a heartbeat is missing.
    pub const LIFE_GUARD_OR_HEARTBEAT: u16 = 0x8130;
    /// A PDO was too short to be processed.
    pub const PDO_TOO_SHORT: u16 = 0x8210;
    /// A drive's position does not follow its demand value (CiA 402).
    pub const FOLLOWING_ERROR: u16 = 0x8611;
}

/// An emergency message's content.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Emergency {
    /// Error code of CiA 301 or of the device profile.
    pub code: u16,
    /// The error register 1001h.
    pub register: u8,
    /// What the manufacturer adds.
    pub vendor: [u8; 5],
}

impl Emergency {
    /// What its code is about: by CiA 301's classes, and those codes that CiA 402 and CiA 301 give drives; `None` where that is the
    /// maker's affair.
    #[must_use]
    pub fn meaning(&self) -> Option<&'static str> {
        Some(match self.code {
            code::LIFE_GUARD_OR_HEARTBEAT => "life guarding or heartbeat",
            code::FOLLOWING_ERROR => "following error, by the drive's own limit",
            0x8612 => "reference limit",
            0x7121 => "motor blocked",
            code => match code >> 8 {
                0x20..=0x23 => "current",
                0x30 | 0x32 | 0x33 => "voltage",
                0x31 => "mains voltage",
                0x40..=0x43 => "temperature",
                0x50..=0x5F => "hardware",
                0x60..=0x63 => "software or its data",
                0x71 => "brake or motor",
                0x73 => "sensor",
                0x81 => "communication",
                0x82 => "protocol",
                0x86 => "position control",
                0x90 => "external error",
                _ => return None,
            },
        })
    }

    /// The message on the wire.
    #[must_use]
    pub fn encode(self, cob_id: CobId) -> Frame {
        let mut data = [0; 8];
        data[..2].copy_from_slice(&self.code.to_le_bytes());
        data[2] = self.register;
        data[3..].copy_from_slice(&self.vendor);
        Frame::new(cob_id, &data)
    }

    /// The content of 8 data bytes; `None` for any other number.
    #[must_use]
    pub fn decode(data: &[u8]) -> Option<Self> {
        let &[low, high, register, ref vendor @ ..] = data else {
            return None;
        };
        Some(Self {
            code: u16::from_le_bytes([low, high]),
            register,
            vendor: vendor.try_into().ok()?,
        })
    }

    /// Whose emergency a frame at a default identifier (080h + id) is, and its content.
    #[must_use]
    pub fn from_frame(frame: &Frame) -> Option<(NodeId, Self)> {
        let CanId::Standard(id) = frame.id() else {
            return None;
        };
        let node = NodeId::new(id.checked_sub(0x080)?.try_into().ok()?)?;
        Some((node, Self::decode(frame.data())?))
    }
}

/// Emergencies that may wait for the inhibit time to pass.
const QUEUE: usize = 8;

/// A node's side: sends emergencies no closer together than the inhibit time (1015h).
#[derive(Clone, Debug, Default)]
pub struct Producer {
    inhibit: Duration,
    allowed: Option<Instant>,
    queue: [Emergency; QUEUE],
    waiting: usize,
}

impl Producer {
    /// A producer without inhibit time.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets the least time between two messages.
    pub fn set_inhibit_time(&mut self, inhibit: Duration) {
        self.inhibit = inhibit;
    }

    /// Forgets what waits.
    pub fn reset(&mut self) {
        self.waiting = 0;
        self.allowed = None;
    }

    /// Sends an emergency now or as soon as the inhibit time permits. The newest is dropped
    /// when too many wait.
    pub fn raise(
        &mut self,
        now: Instant,
        cob_id: CobId,
        emergency: Emergency,
        tx: &mut (impl Transmit + ?Sized),
    ) {
        if let Some(place) = self.queue.get_mut(self.waiting) {
            *place = emergency;
            self.waiting += 1;
        }
        self.poll(now, cob_id, tx);
    }

    /// Whether a message waits for its time.
    pub(crate) fn waits(&self) -> bool {
        self.waiting > 0
    }

    /// When [`Self::poll`] wants to be called.
    #[must_use]
    pub fn deadline(&self) -> Option<Instant> {
        self.allowed.filter(|_| self.waiting > 0)
    }

    /// Sends what waits and may go.
    pub fn poll(&mut self, now: Instant, cob_id: CobId, tx: &mut (impl Transmit + ?Sized)) {
        while self.waiting > 0 && self.allowed.is_none_or(|allowed| now >= allowed) {
            tx.transmit(self.queue[0].encode(cob_id));
            self.queue.copy_within(1..self.waiting, 0);
            self.waiting -= 1;
            self.allowed = (!self.inhibit.is_zero()).then(|| now + self.inhibit);
        }
    }
}
