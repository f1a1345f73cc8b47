//! Devices that tell a position.

use super::{Increments, RemoteNode};

/// A device with a position, which it samples at SYNC and sends in one of its T_PDOs.
pub trait Feedback: RemoteNode {
    /// What the data of a T_PDO, all its mapped bytes, say of the position; `None` if that PDO
    /// carries none.
    fn sample(&self, t_pdo: usize, data: &[u8]) -> Option<Sample>;
}

/// Where a device was at a SYNC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sample {
    /// As the device counts.
    pub position: Increments,
}
