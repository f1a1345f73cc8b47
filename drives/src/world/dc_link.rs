//! DC buses of drives that are joined: at each point of the world's grid they have one voltage.

use super::{DeviceId, Devices};
use crate::twin::servo::power_stage::Joined;
use syncline_canopen::Instant;

/// Drives whose DC buses are joined.
pub(super) struct DcLink {
    pub(super) devices: Vec<DeviceId>,
}

impl DcLink {
    /// Their capacitors share what is in them at a point of the grid.
    pub(super) fn step(&self, end: Instant, all: &mut (impl Devices + ?Sized)) {
        let mut joined = Joined::default();
        for &device in &self.devices {
            let device = all.device_mut(device);
            device.run_until(end);
            if let Some(stage) = device.power_stage_mut() {
                joined.add(stage);
            }
        }
        for &device in &self.devices {
            if let Some(stage) = all.device_mut(device).power_stage_mut() {
                stage.join(joined.voltage());
            }
        }
    }
}
