//! Devices with digital inputs and outputs.

use super::RemoteNode;

/// A device that tells the levels of its digital inputs and outputs, its signals, and takes those of
/// its outputs.
pub trait Io: RemoteNode {
    /// What the data of a T_PDO, all its mapped bytes, say of the signals: bit n is the level of the
    /// [n-th](super::Model::signal). `None` if that PDO carries none.
    fn signals(&self, t_pdo: usize, data: &[u8]) -> Option<u32>;

    /// Sets the outputs that the R_PDOs carry from the next ones on: bit n is the n-th of
    /// [`Model::outputs`](super::Model::outputs).
    fn set_outputs(&mut self, on: u32);
}
