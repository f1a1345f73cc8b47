//! The motor's shaft as its drive knows it.
//!
//! A shaft that nothing couples to another is moved by the drive: its [`Rigid`] mechanics take the
//! drive's own speed steps. A [coupled](Shaft::couple) shaft is moved by the
//! [world](crate::world), on the world's grid, together with the shafts that it is tied to. Between
//! two points of the grid the drive reads it as if its acceleration lasted, and the motor's torque
//! is gathered for the next step. What that costs is told in [`mechanics`](crate::mechanics).

use crate::mechanics::rigid::Rigid;
use crate::mechanics::{Load, Mechanics, Motion};
use syncline_canopen::Instant;

/// A shaft in motion. Positions are revolutions from the encoder's zero.
#[derive(Clone, Debug)]
pub struct Shaft {
    rigid: Rigid,
    motion: Motion,
    blocked: bool,
    powerless: bool,
    /// Somebody else moves it.
    coupled: Option<Coupled>,
}

/// What drive and world hand to each other.
#[derive(Clone, Debug)]
struct Coupled {
    /// A point of the world's grid …
    at: Instant,
    /// … and the motion there.
    motion: Motion,
    /// Of the motor since then, N·m·s, in so many seconds.
    impulse: f64,
    time: f64,
    /// Mean torque of the step of the grid before, N·m.
    torque: f64,
    brake_open: bool,
}

impl Shaft {
    /// A shaft at rest at `position` revolutions.
    #[must_use]
    pub fn new(rigid: Rigid, position: f64) -> Self {
        Self {
            rigid,
            motion: Motion {
                position,
                ..Motion::default()
            },
            blocked: false,
            powerless: false,
            coupled: None,
        }
    }

    /// True position at the last step, revolutions.
    #[must_use]
    pub fn position(&self) -> f64 {
        self.motion.position
    }

    /// True velocity, rev/s.
    #[must_use]
    pub fn velocity(&self) -> f64 {
        self.motion.velocity
    }

    /// What it moves while nothing couples it.
    #[must_use]
    pub fn rigid(&self) -> &Rigid {
        &self.rigid
    }

    /// Blocks the shaft mechanically where it is, or frees it.
    pub fn block(&mut self, blocked: bool) {
        self.blocked = blocked;
    }

    /// Whether the motor delivers no torque, whatever its drive asks for.
    pub fn lose_torque(&mut self, lost: bool) {
        self.powerless = lost;
    }

    /// Lets `dt` seconds pass that end at `end`, under a motor torque in N·m, with the brake open
    /// or closed.
    pub fn step(&mut self, end: Instant, dt: f64, torque: f64, brake_open: bool) {
        let torque = if self.powerless { 0.0 } else { torque };
        match &mut self.coupled {
            None => {
                let load = Load {
                    torque,
                    brake_open,
                    blocked: self.blocked,
                };
                let motion = core::slice::from_mut(&mut self.motion);
                self.rigid.step(dt, &[load], motion);
            }
            Some(coupled) => {
                coupled.impulse += torque * dt;
                coupled.time += dt;
                coupled.brake_open = brake_open;
                self.motion = coupled.motion.ahead(seconds(coupled.at, end));
            }
        }
    }

    // ---- coupled ----

    /// From now on, `now`, the world moves it.
    pub fn couple(&mut self, now: Instant) {
        self.coupled = Some(Coupled {
            at: now,
            motion: self.motion,
            impulse: 0.0,
            time: 0.0,
            torque: 0.0,
            brake_open: false,
        });
    }

    /// What a coupled shaft has been loaded with since this was asked last.
    pub fn take_load(&mut self) -> Load {
        let blocked = self.blocked;
        let Some(coupled) = &mut self.coupled else {
            return Load {
                blocked,
                ..Load::default()
            };
        };
        let time = core::mem::take(&mut coupled.time);
        let impulse = core::mem::take(&mut coupled.impulse);
        // Where no speed step has ended since, the torque before lasts.
        if time > 0.0 {
            coupled.torque = impulse / time;
        }
        Load {
            torque: coupled.torque,
            brake_open: coupled.brake_open,
            blocked,
        }
    }

    /// Where a coupled shaft is at a point of the world's grid.
    pub fn moved(&mut self, at: Instant, motion: Motion) {
        if let Some(coupled) = &mut self.coupled {
            coupled.at = at;
            coupled.motion = motion;
            self.motion = motion;
        }
    }
}

/// From one instant to another, negative if that comes first.
fn seconds(from: Instant, to: Instant) -> f64 {
    let forth = to.saturating_since(from).as_nanos() as f64;
    let back = from.saturating_since(to).as_nanos() as f64;
    (forth - back) * 1e-9
}
