//! Each bus as its devices need it: SYNC on time, the setpoints of a cycle to all drives or to none, never
//! more frames than it can carry.

use super::super::stage::Played;
use super::{Checker, Found, Scene};
use crate::machine::Machine;
use syncline_canopen::{CanId, CobId, Instant};
use syncline_drives::bus::{Sender, Transmission};

const NAME: &str = "bus";

/// Bits of the frame that may be on its way when SYNC is due, with intermission.
const BLOCKING: f64 = 135.0;

/// See the module.
pub(super) struct Bus {
    /// By bus: when the last SYNC began.
    syncs: Vec<Option<Instant>>,
}

impl Bus {
    pub(super) fn new(machine: &Machine) -> Self {
        Self {
            syncs: vec![None; machine.buses.len()],
        }
    }
}

impl Checker for Bus {
    fn frame(&mut self, scene: &Scene<'_>, bus: usize, sent: &Transmission, found: &mut Found) {
        if sent.frame.id() != CanId::from(CobId::SYNC) {
            return;
        }
        if sent.sender != Sender::Port {
            found.violate(NAME, scene, "somebody else sends SYNC", || {
                format!("bus {bus}")
            });
        }
        let before = self.syncs[bus].replace(sent.start);
        let Some(before) = before.filter(|_| scene.case.is_untroubled()) else {
            return;
        };
        let apart = sent.start.saturating_since(before).as_nanos() as f64 * 1e-9;
        let off = (apart - scene.period()).abs();
        let allowed = BLOCKING / f64::from(scene.machine.buses[bus].bitrate);
        // After it was switched off it begins anew.
        if off > allowed && apart < 20.0 * scene.period() {
            found.violate(NAME, scene, "SYNC is off", || {
                format!("bus {bus}: {apart} s after the one before, allowed {allowed} s off")
            });
        }
    }

    fn sync(&mut self, scene: &Scene<'_>, bus: usize, found: &mut Found) {
        if !scene.case.is_untroubled() {
            return;
        }
        for &drive in scene.drives_of(bus) {
            let it = &scene.drives[drive];
            if it.in_effect && it.latched_of != 1 {
                found.violate(NAME, scene, "not one setpoint to a SYNC", || {
                    let name = &scene.machine.drives[drive].name;
                    format!("drive {name}: {} came", it.latched_of)
                });
            }
        }
    }

    fn ended(&mut self, scene: &Scene<'_>, played: &Played, found: &mut Found) {
        for bus in &played.summary.bus {
            if bus.peak_utilisation > 1.0 && scene.case.is_untroubled() {
                found.violate(NAME, scene, "more frames than fit a cycle", || {
                    format!("bus {}: {}", bus.name, bus.peak_utilisation)
                });
            }
        }
    }
}
