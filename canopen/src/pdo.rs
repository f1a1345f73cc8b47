//! Process data objects (CiA 301): communication parameters, mapping, packing.

use crate::dictionary::Address;
use crate::{CanId, CobId};
use core::fmt;

/// The COB-ID word of a PDO, SYNC, EMCY or SDO parameter: identifier and flags.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct CobIdWord(pub u32);

impl CobIdWord {
    /// Bit 31 of a PDO or SDO: the object does not exist.
    pub const INVALID: u32 = 1 << 31;
    /// Bit 30 of a PDO: no remote request allowed. Of SYNC: the device generates it.
    pub const NO_RTR: u32 = 1 << 30;
    /// Bit 29: the identifier has 29 bits.
    pub const EXTENDED: u32 = 1 << 29;

    /// An existing object with an 11-bit identifier.
    #[must_use]
    pub const fn valid(cob_id: CobId) -> Self {
        Self(cob_id.get() as u32)
    }

    /// An object switched off, with an 11-bit identifier to keep.
    #[must_use]
    pub const fn invalid(cob_id: CobId) -> Self {
        Self(cob_id.get() as u32 | Self::INVALID)
    }

    /// Whether the PDO or SDO exists (bit 31 is 0).
    #[must_use]
    pub const fn is_valid(self) -> bool {
        self.0 & Self::INVALID == 0
    }

    /// Whether the PDO may be asked for by a remote request (bit 30 is 0).
    #[must_use]
    pub const fn allows_rtr(self) -> bool {
        self.0 & Self::NO_RTR == 0
    }

    /// The identifier, of 11 or of 29 bits as bit 29 says.
    #[must_use]
    pub const fn can_id(self) -> CanId {
        if self.0 & Self::EXTENDED == 0 {
            CanId::Standard((self.0 & 0x7FF) as u16)
        } else {
            CanId::Extended(self.0 & 0x1FFF_FFFF)
        }
    }

    /// The identifier if it has 11 bits.
    #[must_use]
    pub const fn cob_id(self) -> Option<CobId> {
        if self.0 & Self::EXTENDED == 0 {
            CobId::new((self.0 & 0x7FF) as u16)
        } else {
            None
        }
    }
}

impl fmt::Debug for CobIdWord {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:08X}h", self.0)
    }
}

/// When a PDO is sent, or a received one acted on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TransmissionType {
    /// 0: at the SYNC after an event.
    SyncAcyclic,
    /// 1…240: at every so many SYNCs.
    SyncCyclic(u8),
    /// 241…251.
    Reserved(u8),
    /// 252: sampled at SYNC, sent on remote request.
    SyncRtr,
    /// 253: sampled and sent on remote request.
    EventRtr,
    /// 254: at an event that the manufacturer defines.
    EventManufacturer,
    /// 255: at an event that the device profile defines.
    EventProfile,
}

impl TransmissionType {
    /// Whether it is tied to SYNC (0…240, 252).
    #[must_use]
    pub const fn is_synchronous(self) -> bool {
        matches!(
            self,
            Self::SyncAcyclic | Self::SyncCyclic(_) | Self::SyncRtr
        )
    }

    /// Whether events send it (254, 255).
    #[must_use]
    pub const fn is_event_driven(self) -> bool {
        matches!(self, Self::EventManufacturer | Self::EventProfile)
    }
}

impl From<u8> for TransmissionType {
    fn from(number: u8) -> Self {
        match number {
            0 => Self::SyncAcyclic,
            1..=240 => Self::SyncCyclic(number),
            241..=251 => Self::Reserved(number),
            252 => Self::SyncRtr,
            253 => Self::EventRtr,
            254 => Self::EventManufacturer,
            255 => Self::EventProfile,
        }
    }
}

impl From<TransmissionType> for u8 {
    fn from(kind: TransmissionType) -> Self {
        match kind {
            TransmissionType::SyncAcyclic => 0,
            TransmissionType::SyncCyclic(number) | TransmissionType::Reserved(number) => number,
            TransmissionType::SyncRtr => 252,
            TransmissionType::EventRtr => 253,
            TransmissionType::EventManufacturer => 254,
            TransmissionType::EventProfile => 255,
        }
    }
}

/// One entry of a PDO mapping: an object and its length on the wire.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Mapped {
    /// The object.
    pub address: Address,
    /// Its length in bits.
    pub bits: u8,
}

impl Mapped {
    /// The object at `index`:`sub` with `bits`.
    #[must_use]
    pub const fn new(index: u16, sub: u8, bits: u8) -> Self {
        Self {
            address: Address::new(index, sub),
            bits,
        }
    }
}

/// As it stands in 1600h ff. and 1A00h ff.: index, subindex, length in bits.
impl From<u32> for Mapped {
    fn from(entry: u32) -> Self {
        Self::new((entry >> 16) as u16, (entry >> 8) as u8, entry as u8)
    }
}

impl From<Mapped> for u32 {
    fn from(mapped: Mapped) -> Self {
        Self::from(mapped.address.index) << 16
            | Self::from(mapped.address.sub) << 8
            | Self::from(mapped.bits)
    }
}

/// A PDO's payload in the making: values laid end to end, least significant bits first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Packer {
    word: u64,
    bits: u32,
}

impl Packer {
    /// An empty payload.
    #[must_use]
    pub const fn new() -> Self {
        Self { word: 0, bits: 0 }
    }

    /// Appends the low `bits` of `value`; what exceeds 64 bits in all is dropped.
    pub fn push(&mut self, value: i64, bits: u8) {
        let bits = u32::from(bits).min(64 - self.bits);
        if bits > 0 {
            self.word |= (value as u64) << (64 - bits) >> (64 - bits) << self.bits;
            self.bits += bits;
        }
    }

    /// The payload's length in whole bytes.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.bits.div_ceil(8) as usize
    }

    /// Whether nothing is in it.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.bits == 0
    }

    /// The payload in 8 bytes, of which [`Self::len`] count.
    #[must_use]
    pub const fn bytes(&self) -> [u8; 8] {
        self.word.to_le_bytes()
    }
}

/// A PDO's payload taken apart, in the order in which it was packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unpacker {
    word: u64,
    bits: u32,
}

impl Unpacker {
    /// The values in `data`, of which the first 8 bytes count.
    #[must_use]
    pub fn new(data: &[u8]) -> Self {
        let mut bytes = [0; 8];
        let len = data.len().min(8);
        bytes[..len].copy_from_slice(&data[..len]);
        Self {
            word: u64::from_le_bytes(bytes),
            bits: len as u32 * 8,
        }
    }

    /// The next `bits` as an unsigned number, or `None` if there are not that many left.
    pub fn unsigned(&mut self, bits: u8) -> Option<u64> {
        let bits = u32::from(bits);
        if bits > self.bits {
            return None;
        }
        self.bits -= bits;
        let value = match bits {
            0 => 0,
            64 => self.word,
            _ => self.word & ((1 << bits) - 1),
        };
        self.word = self.word.checked_shr(bits).unwrap_or(0);
        Some(value)
    }
}
