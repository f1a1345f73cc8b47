//! Each bus as its devices need it: SYNC on time, a setpoint of each cycle to each drive, nothing that is not
//! cyclic while axes move, never more frames than it can carry.
//!
//! A frame that is on its way is not interrupted. So beside a request by SDO and its answer the last
//! setpoint of a cycle may come behind its SYNC where a bus is nearly full, which is why none is sent
//! while anything moves: in a cycle with a request the setpoints are those of the cycle before, so that one
//! that comes late changes nothing. An answer comes when its device likes, also in a cycle in which a move
//! begins; no setpoint may be late for it then. What SYNC waits for is carried on top of a cycle. Where a drive
//! is asked for its position all the time the bus has to have room for that in each cycle.

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
    acyclic: Vec<[bool; 2]>,
    /// By bus: a request was carried on any of the buses since the last SYNC.
    asked: Vec<bool>,
}

/// The function code of an SDO's frame: what a client requests, and what a server answers (CiA 301, 7.3.3).
const REQUEST: u16 = 0xC;
const ANSWER: u16 = 0xB;

/// The function code of a frame to or of a device that is not asked all the time.
fn function_code(scene: &Scene<'_>, bus: usize, sent: &Transmission) -> Option<u16> {
    let CanId::Standard(id) = sent.frame.id() else {
        return None;
    };
    let device = scene.drive_with(bus, (id & 0x7F) as u8);
    (!device.is_some_and(|drive| scene.is_polled(drive))).then_some(id >> 7)
}

impl Bus {
    pub(super) fn new(machine: &Machine) -> Self {
        Self {
            syncs: vec![None; machine.buses.len()],
            acyclic: vec![[false; 2]; machine.buses.len()],
            asked: vec![false; machine.buses.len()],
        }
    }

    /// A request by SDO was carried since the last SYNC: then no setpoint of this one is another.
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
        let function = function_code(scene, bus, sent);
        if let Some(REQUEST | ANSWER) = function {
            self.acyclic[bus][0] = true;
        }
        if function == Some(REQUEST) {
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
        let Some(before) = before.filter(|_| scene.is_untroubled) else {
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
        let [now, before] = self.acyclic[bus];
        self.acyclic[bus] = [false, now];
        if std::mem::take(&mut self.asked[bus]) && scene.is_untroubled {
            Self::requested(scene, bus, found);
        }
        if !scene.is_untroubled {
            return;
        }
        let drives = scene.drives_of(bus);
        let moves = drives.iter().any(|drive| scene.drives[*drive].moves);
        for &drive in drives {
            let it = &scene.drives[drive];
            let excused = (now || before) && !(moves && it.latched_of == 0);
            if it.in_effect && it.latched_of != 1 && !excused {
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
            if bus.peak_utilisation > allowed && scene.is_untroubled {
                found.violate(NAME, scene, "more frames than fit a cycle", || {
                    let (name, share) = (&bus.name, bus.peak_utilisation);
                    format!("bus {name}: {share}, allowed {allowed}")
                });
            }
        }
    }
}
