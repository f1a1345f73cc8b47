//! Node and message identifiers (CiA 301, pre-defined connection set).

use core::fmt;

/// A CANopen node id, 1…127.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct NodeId(u8);

impl NodeId {
    /// The greatest one.
    pub const MAX: Self = Self(127);

    /// A node id, or `None` outside 1…127.
    #[must_use]
    pub const fn new(id: u8) -> Option<Self> {
        if id >= 1 && id <= 127 {
            Some(Self(id))
        } else {
            None
        }
    }

    /// The number, 1…127.
    #[must_use]
    pub const fn get(self) -> u8 {
        self.0
    }
}

impl fmt::Display for NodeId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// A CAN identifier as it stands on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum CanId {
    /// 11 bits (CAN 2.0A).
    Standard(u16),
    /// 29 bits (CAN 2.0B).
    Extended(u32),
}

impl CanId {
    /// A standard identifier, or `None` above 7FFh.
    #[must_use]
    pub const fn standard(id: u16) -> Option<Self> {
        if id <= 0x7FF {
            Some(Self::Standard(id))
        } else {
            None
        }
    }

    /// An extended identifier, or `None` above 1FFF_FFFFh.
    #[must_use]
    pub const fn extended(id: u32) -> Option<Self> {
        if id <= 0x1FFF_FFFF {
            Some(Self::Extended(id))
        } else {
            None
        }
    }

    /// The bare identifier without its kind.
    #[must_use]
    pub const fn raw(self) -> u32 {
        match self {
            Self::Standard(id) => id as u32,
            Self::Extended(id) => id,
        }
    }
}

impl From<CobId> for CanId {
    fn from(cob_id: CobId) -> Self {
        Self::Standard(cob_id.0)
    }
}

/// An 11-bit communication object identifier of CANopen, 000h…7FFh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct CobId(u16);

impl CobId {
    /// NMT commands.
    pub const NMT: Self = Self(0x000);
    /// SYNC at its default identifier.
    pub const SYNC: Self = Self(0x080);

    /// A COB-ID, or `None` above 7FFh.
    #[must_use]
    pub const fn new(id: u16) -> Option<Self> {
        if id <= 0x7FF { Some(Self(id)) } else { None }
    }

    /// EMCY of a node at its default identifier (080h + id).
    #[must_use]
    pub const fn emcy(node: NodeId) -> Self {
        Self(0x080 + node.0 as u16)
    }

    /// T_PDO `n` (1…4) of a node at its default identifier.
    ///
    /// # Panics
    /// If `n` is not 1…4.
    #[must_use]
    pub const fn t_pdo(n: u8, node: NodeId) -> Self {
        assert!(n >= 1 && n <= 4);
        Self(0x080 + 0x100 * n as u16 + node.0 as u16)
    }

    /// R_PDO `n` (1…4) of a node at its default identifier.
    ///
    /// # Panics
    /// If `n` is not 1…4.
    #[must_use]
    pub const fn r_pdo(n: u8, node: NodeId) -> Self {
        assert!(n >= 1 && n <= 4);
        Self(0x100 + 0x100 * n as u16 + node.0 as u16)
    }

    /// SDO answers of a node, server to client (580h + id).
    #[must_use]
    pub const fn t_sdo(node: NodeId) -> Self {
        Self(0x580 + node.0 as u16)
    }

    /// SDO requests to a node, client to server (600h + id).
    #[must_use]
    pub const fn r_sdo(node: NodeId) -> Self {
        Self(0x600 + node.0 as u16)
    }

    /// NMT error control of a node: boot-up, heartbeat, guarding (700h + id).
    #[must_use]
    pub const fn error_control(node: NodeId) -> Self {
        Self(0x700 + node.0 as u16)
    }

    /// The number, 000h…7FFh.
    #[must_use]
    pub const fn get(self) -> u16 {
        self.0
    }
}
