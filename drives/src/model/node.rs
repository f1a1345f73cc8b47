//! What every CANopen device of a machine has, whatever it does.

use super::{Address, Io, Model, Write};
use core::{fmt, time::Duration};
use syncline_canopen::NodeId;
use syncline_canopen::budget::{NodeTraffic, Pdo};

/// A device on a bus as the controller knows it: who it is, how it is set up, what it sends and
/// takes in every cycle.
///
/// A PDO of the device is named by its place in [`RemoteNode::t_pdos`] or [`RemoteNode::r_pdos`].
pub trait RemoteNode: fmt::Debug + Send + Sync {
    /// Its kind.
    fn model(&self) -> &'static Model;

    /// Its node id.
    fn node(&self) -> NodeId;

    /// The objects that tell this device from another, in the order to read them.
    fn identity(&self) -> &[Identity];

    /// The objects to log before a reset, which would wipe them: what stopped the device last.
    fn history(&self) -> &[Address];

    /// The set-up writes, in order, to a device in NMT Pre-Operational after a reset of its
    /// communication.
    fn setup(&self) -> &[Write];

    /// The objects to read back after the set-up, with the value that each must have. One that
    /// refuses to be read is worth a log line, no more.
    fn read_back(&self) -> &[Write];

    /// Whether what was read is what `written` set, in the bits that the device has to keep.
    fn agrees(&self, written: &Write, read: &[u8]) -> bool;

    /// How to tell that the device's clock follows SYNC, if it has one that does.
    fn clock_lock(&self) -> Option<ClockLock>;

    /// The writes that take the set-up's cyclic part back, after the device is disabled.
    fn release(&self) -> &[Write];

    /// The PDOs that the device sends in answer to every SYNC.
    fn t_pdos(&self) -> &[Pdo];

    /// The PDOs that the controller sends to the device in every cycle.
    fn r_pdos(&self) -> &[Pdo];

    /// Longest time from the end of SYNC until the T_PDOs stand in the device's transmit queue.
    fn t_pdo_response(&self) -> Duration;

    /// Longest time from the end of an SDO request until its answer stands in the device's
    /// transmit queue.
    fn sdo_response(&self) -> Duration;

    /// What the five bytes that its maker adds to an EMCY say, for a message: `vendor error
    /// B404h: SYNC signal missing`. `None` if the maker says nothing by them.
    fn vendor_error(&self, bytes: [u8; 5]) -> Option<String>;

    /// Its digital inputs and outputs, if its PDOs carry them.
    fn io(&self) -> Option<&dyn Io> {
        None
    }

    /// The same, to set its outputs.
    fn io_mut(&mut self) -> Option<&mut dyn Io> {
        None
    }

    /// What the device adds to a cycle of its bus.
    fn traffic(&self) -> NodeTraffic {
        NodeTraffic {
            node: self.node(),
            divider: 1,
            response: self.t_pdo_response(),
            pdos: [self.t_pdos(), self.r_pdos()].concat(),
        }
    }
}

/// An object that must read as stated, or this is another device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identity {
    /// Where it stands.
    pub address: Address,
    /// Its name.
    pub name: &'static str,
    /// The bits that count.
    pub mask: u32,
    /// Their value.
    pub value: u32,
}

/// An object to poll after SYNC has started, until the device's clock follows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClockLock {
    /// Where the status stands.
    pub address: Address,
    /// What it reads once the device's clock follows SYNC.
    pub locked: u32,
    /// The name of the [`Assumption`](super::Assumption) that says so.
    pub assumption: &'static str,
}
