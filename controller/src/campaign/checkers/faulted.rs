//! A machine that a fault has stopped, or that was disabled, is without power and its outputs are safe: as its drives and
//! terminals are, whatever the buses carried. So a device that hears no R_PDO any more, as another master took it out of
//! NMT Operational, has to be told otherwise.
//!
//! Outputs are judged once all devices are known to be of the kind that is expected, as they were started: before that they
//! are told nothing, and their outputs are as the devices themselves set them. So they are of a drive whose control supply
//! failed, until it is set up again: its outputs have functions of its own then. And nobody sees that another master enables
//! a drive that tells nothing of itself, as it is not in NMT Operational, or there is no SYNC: the next survey does.

use super::super::interference::{Interference, ToBus, ToDrive};
use super::{Checker, Found, Scene};
use crate::control::{Phase, State};
use std::collections::BTreeSet;
use syncline_drives::bus::Transmission;

const NAME: &str = "faulted";

/// How long that may take in these states, and after what happened last, s: requests by SDO that get no answer are
/// repeated behind NMT commands.
const WITHIN: f64 = 2.0;

/// See the module.
#[derive(Default)]
pub(super) struct Faulted {
    /// Its devices were started.
    was_started: bool,
    /// Where the controller was, and the drives whose control supply has failed since it began to set them up.
    phase: Option<Phase>,
    restarted: Vec<usize>,
    /// Drives that somebody has enabled, and that have not said since what they do.
    unseen: BTreeSet<usize>,
}

/// Whether the controller can be heard on all buses.
fn is_heard(scene: &Scene<'_>) -> bool {
    let mut all = scene.interferences.iter();
    all.all(|(_, what)| match what {
        Interference::Bus(_, what) => matches!(what, ToBus::Nmt(..)),
        Interference::Drive(..)
        | Interference::Slip(..)
        | Interference::Part(_)
        | Interference::Join(_)
        | Interference::Align(_)
        | Interference::Mended
        | Interference::Late(_)
        | Interference::StarvePlanner(_) => true,
    })
}

/// Whether a drive obeys the bus: no other channel has had control of it.
fn obeys(scene: &Scene<'_>, drive: usize) -> bool {
    let mut all = scene.interferences.iter();
    !all.any(|(_, what)| *what == Interference::Drive(drive, ToDrive::Remote(false)))
}

impl Checker for Faulted {
    fn interfered(&mut self, scene: &Scene<'_>, what: &Interference, _: &mut Found) {
        match *what {
            Interference::Drive(device, ToDrive::Reset) if device < scene.drives.len() => {
                self.restarted.push(device);
            }
            Interference::Drive(drive, ToDrive::FoundEnabled) => {
                self.unseen.insert(drive);
            }
            _ => {}
        }
    }

    fn frame(&mut self, scene: &Scene<'_>, _: usize, _: &Transmission, _: &mut Found) {
        if let Some(drive) = scene.told_status {
            self.unseen.remove(&drive);
        }
    }

    fn woken(&mut self, scene: &Scene<'_>, found: &mut Found) {
        // A machine that comes to be disabled before this phase was reached has started none.
        self.was_started |= scene.phase == Phase::Start;
        if self.phase.replace(scene.phase) != Some(Phase::SetUp) && scene.phase == Phase::SetUp {
            self.restarted.clear();
        }
        let rests = matches!(scene.state, State::Faulted | State::Disabled);
        let last = scene.interferences.last();
        let is_over = last.is_none_or(|(at, _)| scene.since(*at) > WITHIN);
        if !rests || scene.since(scene.state_since) <= WITHIN || !is_over || !is_heard(scene) {
            return;
        }
        for (drive, plant) in scene.plants.iter().enumerate() {
            if plant.is_powered && obeys(scene, drive) && !self.unseen.contains(&drive) {
                found.violate(NAME, scene, "a drive has power", || {
                    let name = &scene.machine.drives[drive].name;
                    format!("drive {name}, machine {}", scene.state)
                });
            }
        }
        for output in scene.machine.outputs.iter().filter(|_| self.was_started) {
            if self.restarted.contains(&output.node) {
                continue;
            }
            let levels = scene.outputs.get(output.node).copied().unwrap_or(0);
            let is_on = levels >> output.signal & 1 != 0;
            if is_on != (output.safe != output.active_low) {
                found.violate(NAME, scene, "an output is not safe", || {
                    let name = &output.name;
                    format!(
                        "{name} is {}, machine {}",
                        if is_on { "on" } else { "off" },
                        scene.state
                    )
                });
            }
        }
    }
}
