//! Devices with digital inputs and outputs.

use super::RemoteNode;

/// A device that tells the levels of its digital inputs and outputs, its signals.
pub trait Io: RemoteNode {
    /// The names of its signals, as its manual has them.
    fn names(&self) -> &'static [&'static str];

    /// What the data of a T_PDO, all its mapped bytes, say of the signals: bit n is the level of the
    /// n-th name. `None` if that PDO carries none.
    fn signals(&self, t_pdo: usize, data: &[u8]) -> Option<u32>;
}
