//! Devices with inputs and outputs.

use super::{RemoteNode, Write};
use core::fmt;
use syncline_canopen::Frame;

/// Analog inputs of a device at most.
pub const ANALOG_INPUTS: usize = 4;

/// A device that tells the levels of its digital inputs and outputs, its signals, and takes those of
/// its outputs.
pub trait Io: RemoteNode {
    /// What the data of a T_PDO, all its mapped bytes, say of the signals: bit n is the level of the
    /// [n-th](super::Model::signal). `None` if that PDO carries none.
    fn signals(&self, t_pdo: usize, data: &[u8]) -> Option<u32>;

    /// What the data of a T_PDO say of the analog inputs, in the order of
    /// [`Model::analog_inputs`](super::Model::analog_inputs): from -32768 to 32767 it is from the least to the greatest
    /// that they can take in. `None` if that PDO carries none.
    fn analog_inputs(&self, _t_pdo: usize, _data: &[u8]) -> Option<[i16; ANALOG_INPUTS]> {
        None
    }

    /// Sets the outputs that the R_PDOs carry from the next ones on: bit n is the n-th of
    /// [`Model::outputs`](super::Model::outputs).
    fn set_outputs(&mut self, on: u32);

    /// Sets an analog output by its place among [`Model::analog_outputs`](super::Model::analog_outputs), from the
    /// next R_PDOs on: from -32768 to 32767 it is from the least to the greatest that it can put out.
    fn set_analog_output(&mut self, _output: usize, _value: i16) {}

    /// Gives the writes by SDO that say of the outputs what the R_PDOs of this cycle do, for a device that hears none.
    fn write(&self, write: &mut dyn FnMut(Write));
}

/// A device that has inputs and outputs, and nothing to move or to measure: an I/O node.
pub trait IoNode: Io + fmt::Debug {
    /// A copy in the same state.
    fn clone_box(&self) -> Box<dyn IoNode>;

    /// Its R_PDOs of this cycle, one each in `frames`.
    fn encode(&self, frames: &mut [Frame]);
}

impl Clone for Box<dyn IoNode> {
    fn clone(&self) -> Self {
        self.clone_box()
    }
}

/// What a machine uses of a device's inputs and outputs. Of bits the n-th is the n-th of those that its
/// [`Model`](super::Model) has.
#[derive(Clone, Debug, Default)]
pub struct IoSettings {
    /// Whether the levels of all of them are to be told, also of those that mean nothing to the machine.
    pub signals: bool,
    /// The digital inputs that mean something.
    pub inputs: u32,
    /// The digital outputs that the controller sets with its R_PDOs.
    pub outputs: u32,
    /// The levels that those outputs take by themselves where the device no longer hears the controller, if it can
    /// do that.
    pub safe: u32,
    /// The analog inputs that mean something.
    pub analog_inputs: u32,
    /// The analog outputs that the controller sets, each by its place, with the value that it takes likewise.
    pub analog_outputs: Vec<(usize, i16)>,
    /// The T_PDOs come when what they tell changes, not at every SYNC, where the device can do both.
    pub by_event: bool,
}

impl IoSettings {
    /// Whether levels have to come with the device's T_PDOs.
    #[must_use]
    pub fn tells(&self) -> bool {
        self.signals || self.inputs != 0
    }
}
