//! An enable chain in the world: a contactor that an output of a device closes, with the supply of power stages behind it.

use super::{DeviceId, Devices};
use crate::twin::Disturbance;
use syncline_canopen::Instant;

/// A contactor, what closes it, and what it feeds.
#[derive(Clone, Debug)]
pub struct EnableChain {
    /// The device that closes it.
    pub device: DeviceId,
    /// By this digital output, from 0 on.
    pub output: u8,
    /// It is closed while the output is off.
    pub inverted: bool,
    /// The devices whose power stages have their supply through it.
    pub feeds: Vec<DeviceId>,
}

/// A chain, and whether it was closed at the last point of the grid.
pub(super) struct Chain {
    chain: EnableChain,
    closed: Option<bool>,
}

impl Chain {
    pub(super) fn new(chain: EnableChain) -> Self {
        Self {
            chain,
            closed: None,
        }
    }

    /// Opens or closes as its output is at a point of the grid.
    pub(super) fn step(&mut self, end: Instant, all: &mut (impl Devices + ?Sized)) {
        let EnableChain {
            device,
            output,
            inverted,
            ref feeds,
        } = self.chain;
        let device = all.device_mut(device);
        device.run_until(end);
        let closed = (device.outputs() >> output & 1 != 0) != inverted;
        if self.closed.replace(closed) == Some(closed) {
            return;
        }
        for &fed in feeds {
            all.device_mut(fed).disturb(Disturbance::Mains(closed));
        }
    }
}
