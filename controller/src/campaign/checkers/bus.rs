//! Each bus as its devices need it: SYNC on time, a setpoint of each cycle to each drive, nothing that is not
//! cyclic while axes move, never more frames than it can carry.
//!
//! A frame that is on its way is not interrupted. So beside a request by SDO and its answer the last
//! setpoint of a cycle may come behind its SYNC where a bus is nearly full, which is why none is sent
//! while anything moves: in a cycle with such a frame the setpoints are those of the cycle before, so that one
//! that comes late changes nothing. What SYNC waits for is carried on top of a cycle. Where a drive is asked for
//! its position all the time the bus has to have room for that in each cycle.

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
    /// By bus: a request by SDO, or an answer, was carried since the last SYNC, and before it since the one
    /// before.
    requests: Vec<[bool; 2]>,
    /// By bus: one was carried on any of the buses since the last SYNC.
    asked: Vec<bool>,
}

/// Whether a frame is a request by SDO, or an answer to one, to or of a device that is not asked all the time.
fn is_request(scene: &Scene<'_>, bus: usize, sent: &Transmission) -> bool {
    let CanId::Standard(id) = sent.frame.id() else {
        return false;
    };
    let asked = scene.drive_with(bus, (id & 0x7F) as u8);
    matches!(id >> 7, 0xB | 0xC) && !asked.is_some_and(|drive| scene.is_polled(drive))
}

impl Bus {
    pub(super) fn new(machine: &Machine) -> Self {
        Self {
            syncs: vec![None; machine.buses.len()],
            requests: vec![[false; 2]; machine.buses.len()],
            asked: vec![false; machine.buses.len()],
        }
    }

    /// There was a request by SDO, or an answer, since the last SYNC: then no setpoint of this one is another.
    fn requested(scene: &Scene<'_>, bus: usize, found: &mut Found) {
        let mut drives = scene.drives_of(bus).iter();
        if let Some(&drive) = drives.find(|drive| scene.drives[**drive].moves) {
            found.violate(NAME, scene, "a request by SDO while axes move", || {
                let name = &scene.machine.drives[drive].name;
                format!("bus {bus}: drive {name} moves")
            });
        }
    }
}

impl Checker for Bus {
    fn frame(&mut self, scene: &Scene<'_>, bus: usize, sent: &Transmission, found: &mut Found) {
        if is_request(scene, bus, sent) {
            self.requests[bus][0] = true;
            self.asked.fill(true);
        }
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
        let [now, before] = self.requests[bus];
        self.requests[bus] = [false, now];
        if std::mem::take(&mut self.asked[bus]) && scene.case.is_untroubled() {
            Self::requested(scene, bus, found);
        }
        if !scene.case.is_untroubled() || now || before {
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
        for (bus, spec) in played.summary.bus.iter().zip(&scene.machine.buses) {
            let allowed = 1.0 + BLOCKING / f64::from(spec.bitrate) / scene.period();
            if bus.peak_utilisation > allowed && scene.case.is_untroubled() {
                found.violate(NAME, scene, "more frames than fit a cycle", || {
                    let (name, share) = (&bus.name, bus.peak_utilisation);
                    format!("bus {name}: {share}, allowed {allowed}")
                });
            }
        }
    }
}
