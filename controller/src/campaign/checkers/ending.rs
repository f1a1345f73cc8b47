//! A case comes to its end: virtual time goes on, the machine goes off, its drives without power; and where
//! nothing went wrong the observers' verdict has nothing to say.

use super::super::stage::Played;
use super::{Checker, Found, Scene};
use crate::control::State;
use syncline_canopen::Instant;

const NAME: &str = "ending";

/// Wake-ups at one instant: a late one, and what is due since.
const AT_ONCE: u32 = 8;

/// See the module.
#[derive(Default)]
pub(super) struct Ending {
    last: Option<Instant>,
    at_once: u32,
}

impl Checker for Ending {
    fn woken(&mut self, scene: &Scene<'_>, found: &mut Found) {
        let goes_on = self.last.replace(scene.now) != Some(scene.now);
        self.at_once = if goes_on { 0 } else { self.at_once + 1 };
        if self.at_once > AT_ONCE {
            found.violate(NAME, scene, "virtual time stands still", || {
                format!("{} wake-ups", self.at_once)
            });
        }
    }

    fn ended(&mut self, scene: &Scene<'_>, played: &Played, found: &mut Found) {
        let (summary, period) = (&played.summary, scene.period());
        let (told, took) = (summary.times.sum(), summary.cycles as f64 * period);
        if (told - took).abs() > 0.01 * period {
            found.violate(NAME, scene, "the times do not make up the cycles", || {
                format!("{told} s of {took} s: {:?}", summary.times)
            });
        }
        if !played.ended {
            found.violate(NAME, scene, "it does not go off", || {
                format!("phase: {}, machine {}", scene.phase, scene.state)
            });
            return;
        }
        if scene.state != State::Off {
            found.violate(NAME, scene, "it ends and is not off", || {
                format!("machine {}", scene.state)
            });
        }
        if !scene.is_untroubled {
            return;
        }
        for (drive, plant) in scene.plants.iter().enumerate() {
            if plant.is_powered {
                found.violate(NAME, scene, "a power stage stays on", || {
                    format!("drive {}", scene.machine.drives[drive].name)
                });
            }
        }
        if let Some(first) = played.summary.violations.first() {
            found.violate(NAME, scene, "the observers find something wrong", || {
                format!("{first:?}, of {}", played.summary.violations.len())
            });
        }
    }
}
