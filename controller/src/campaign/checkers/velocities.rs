//! Drives that are sent velocities turn only where they are told to, and no faster than their axis' loop has reason to.
//!
//! The bound is the plan's greatest velocity, what leads the drive's lag at the greatest acceleration, and what the loop makes of
//! a following error that is no fault yet.

use super::scene::{AT_REST, DISTURBED, FOLLOWS, SETTLES};
use super::{Checker, Found, Scene};
use crate::machine::Machine;
use syncline_canopen::Instant;
use syncline_drives::bus::Transmission;
use syncline_drives::model::Dynamics;

const NAME: &str = "velocities";

/// See the module.
pub(super) struct Velocities(Vec<Watched>);

/// A drive.
struct Watched {
    /// How it moves, if it is sent velocities.
    dynamics: Option<Dynamics>,
    /// Since when it is sent none.
    rests: Instant,
}

impl Velocities {
    pub(super) fn new(machine: &Machine) -> Self {
        let watched = |drive: usize| Watched {
            dynamics: (machine.device(drive).drive()).and_then(|drive| drive.dynamics()),
            rests: Instant::ZERO,
        };
        Self((0..machine.drives.len()).map(watched).collect())
    }
}

impl Checker for Velocities {
    fn frame(&mut self, scene: &Scene<'_>, _: usize, _: &Transmission, found: &mut Found) {
        let Some((drive, word)) = scene.told_controlword else {
            return;
        };
        let Some(dynamics) = self.0[drive].dynamics else {
            return;
        };
        let sent = scene.drives[drive].velocity.unwrap_or(0);
        let spec = &scene.machine.drives[drive];
        if sent != 0 && word & FOLLOWS != FOLLOWS {
            found.violate(
                NAME,
                scene,
                "a velocity for a drive that is not to follow",
                || format!("drive {}: {sent} with {word:04X}h", spec.name),
            );
        }
        let limits = &scene.machine.axes[spec.axis].sent_limits;
        let leads = limits.acceleration * dynamics.lag;
        let allowed = limits.velocity + leads + dynamics.gain * limits.following_error;
        let increment = spec.scaling.resolution();
        let velocity = (f64::from(sent).abs() - 1.0) * dynamics.quantum * increment;
        if velocity > allowed && !scene.is_disturbed(DISTURBED) && !scene.faulted {
            found.violate(NAME, scene, "a velocity without a reason", || {
                format!("drive {}: {velocity} mm/s, allowed {allowed}", spec.name)
            });
        }
    }

    fn woken(&mut self, scene: &Scene<'_>, found: &mut Found) {
        for (drive, watched) in self.0.iter_mut().enumerate() {
            let sent = scene.drives[drive].velocity.unwrap_or(0);
            let plant = &scene.plants[drive];
            // As its power stage comes on a weight pulls it away until its loop has the torque.
            if watched.dynamics.is_none() || sent != 0 || !plant.is_powered {
                watched.rests = scene.now;
                continue;
            }
            let settled = scene.since(watched.rests) > SETTLES;
            let turns = plant.velocity.abs() > AT_REST;
            if settled && turns && !scene.is_disturbed(DISTURBED) {
                found.violate(NAME, scene, "turns although it is sent no velocity", || {
                    let name = &scene.machine.drives[drive].name;
                    format!("drive {name}: {} rev/s", plant.velocity)
                });
            }
        }
    }
}
