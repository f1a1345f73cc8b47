//! The motor's shaft as its drive knows it.
//!
//! A shaft that nothing couples to another is moved by the drive: its [`Plant`] takes the drive's own
//! speed steps. A [coupled](Shaft::couple) shaft is moved by the
//! [world](crate::world), on the world's grid, together with the shafts that it is tied to. Between
//! two points of the grid the drive reads it as if its acceleration lasted, and the motor's torque
//! is gathered for the next step. What that costs is told in [`mechanics`](crate::mechanics).

use crate::mechanics::drive_train::{DriveTrain, FeedAxis};
use crate::mechanics::rigid::Rigid;
use crate::mechanics::{Load, Mechanics, Motion};
use core::f64::consts::TAU;
use syncline_canopen::Instant;

/// What a motor moves alone.
#[derive(Clone, Debug, PartialEq)]
pub enum Plant {
    /// An inertia with friction: where nothing is known of the axis.
    Rigid(Rigid),
    /// A feed axis.
    FeedAxis(Box<FeedAxis>),
}

impl Default for Plant {
    fn default() -> Self {
        Self::Rigid(Rigid::default())
    }
}

impl From<Rigid> for Plant {
    fn from(rigid: Rigid) -> Self {
        Self::Rigid(rigid)
    }
}

impl From<DriveTrain> for Plant {
    fn from(train: DriveTrain) -> Self {
        Self::FeedAxis(Box::new(FeedAxis::new(train)))
    }
}

/// A shaft in motion. Positions are revolutions from the encoder's zero.
#[derive(Clone, Debug)]
pub struct Shaft {
    plant: Plant,
    motion: Motion,
    /// When that was.
    at: Instant,
    blocked: bool,
    powerless: bool,
    /// On what it moves from outside, N·m.
    outside: f64,
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
    pub fn new(plant: impl Into<Plant>, position: f64) -> Self {
        Self {
            plant: plant.into(),
            motion: Motion {
                position,
                ..Motion::default()
            },
            at: Instant::ZERO,
            blocked: false,
            powerless: false,
            outside: 0.0,
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

    /// When its last step ended.
    #[must_use]
    pub fn at(&self) -> Instant {
        self.at
    }

    /// What it moves while nothing couples it.
    #[must_use]
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// True position of the load, revolutions of the shaft: behind it by twist and play, off by
    /// lead error and expansion. Of a coupled shaft that of the shaft itself.
    #[must_use]
    pub fn load_position(&self) -> f64 {
        match (&self.plant, &self.coupled) {
            (Plant::FeedAxis(axis), None) => axis.load_position(self.motion.position),
            _ => self.motion.position,
        }
    }

    /// How the load moves at the last step, in revolutions of the shaft; its lead error and expansion are in the position alone.
    #[must_use]
    pub fn load_motion(&self) -> Motion {
        let velocity = match (&self.plant, &self.coupled) {
            (Plant::FeedAxis(axis), None) => axis.load_speed() * (1.0 / TAU),
            _ => self.motion.velocity,
        };
        Motion {
            position: self.load_position(),
            velocity,
            ..self.motion
        }
    }

    /// How it moves at an instant near the last step.
    #[must_use]
    pub fn motion_at(&self, at: Instant) -> Motion {
        self.motion.ahead(seconds(self.at, at))
    }

    /// How the load moves then, as [`load_motion`](Self::load_motion) has it.
    #[must_use]
    pub fn load_motion_at(&self, at: Instant) -> Motion {
        self.load_motion().ahead(seconds(self.at, at))
    }

    /// Blocks the shaft mechanically where it is, or frees it.
    pub fn block(&mut self, blocked: bool) {
        self.blocked = blocked;
    }

    /// Somebody brings it so many revolutions further by hand, where it rests with what it moves.
    pub fn displace(&mut self, by: f64) {
        self.motion = self.motion.displaced(by);
        if let Some(coupled) = &mut self.coupled {
            coupled.motion = coupled.motion.displaced(by);
        }
    }

    /// Pushes at what it moves with a torque, N·m at the shaft, from now on.
    pub fn push(&mut self, torque: f64) {
        self.outside = torque;
    }

    /// With what it is pushed so, N·m.
    #[must_use]
    pub fn pushed(&self) -> f64 {
        self.outside
    }

    /// Whether the motor delivers no torque, whatever its drive asks for.
    pub fn lose_torque(&mut self, lost: bool) {
        self.powerless = lost;
    }

    /// Lets `dt` seconds pass that end at `end`, under a motor torque in N·m, with the brake open
    /// or closed.
    pub fn step(&mut self, end: Instant, dt: f64, torque: f64, brake_open: bool) {
        let torque = if self.powerless { 0.0 } else { torque };
        self.at = end;
        match &mut self.coupled {
            None => {
                let load = Load {
                    torque,
                    outside: self.outside,
                    brake_open,
                    blocked: self.blocked,
                };
                let motion = core::slice::from_mut(&mut self.motion);
                match &mut self.plant {
                    Plant::Rigid(rigid) => rigid.step(dt, &[load], motion),
                    Plant::FeedAxis(axis) => axis.step(dt, &[load], motion),
                }
            }
            Some(coupled) => {
                coupled.impulse += torque * dt;
                coupled.time += dt;
                coupled.brake_open = brake_open;
                self.motion = coupled.motion.ahead(seconds(coupled.at, end));
            }
        }
    }

    /// What is rigid and moved by its drive alone: what moves it but for the motor's torque, and how it moves, to
    /// [go on](Self::go_on) from.
    #[inline]
    pub(super) fn rigid(&self, brake_open: bool) -> Option<(&Rigid, Load, Motion)> {
        let (Plant::Rigid(rigid), None) = (&self.plant, &self.coupled) else {
            return None;
        };
        let load = Load {
            torque: 0.0,
            outside: self.outside,
            brake_open,
            blocked: self.blocked,
        };
        Some((rigid, load, self.motion))
    }

    /// How it moves from an instant on.
    #[inline]
    pub(super) fn go_on(&mut self, at: Instant, motion: Motion) {
        self.at = at;
        self.motion = motion;
    }

    /// Whether the motor's torque reaches it.
    #[inline]
    pub(super) fn has_torque(&self) -> bool {
        !self.powerless
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
        let (blocked, outside) = (self.blocked, self.outside);
        let Some(coupled) = &mut self.coupled else {
            return Load {
                outside,
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
            outside,
            brake_open: coupled.brake_open,
            blocked,
        }
    }

    /// Where a coupled shaft is at a point of the world's grid.
    pub fn moved(&mut self, at: Instant, motion: Motion) {
        if let Some(coupled) = &mut self.coupled {
            coupled.at = at;
            coupled.motion = motion;
            // Its drive has lived up to its last step, before that point.
            self.motion = motion.ahead(seconds(at, self.at));
        }
    }
}

/// From one instant to another, negative if that comes first.
fn seconds(from: Instant, to: Instant) -> f64 {
    let forth = to.saturating_since(from).as_nanos() as f64;
    let back = from.saturating_since(to).as_nanos() as f64;
    (forth - back) * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::TAU;
    use syncline_canopen::time::Duration;

    /// Steps of the drive's speed loop.
    const SPEED_STEP: Duration = Duration::from_nanos(15_625);

    /// Of the torque, rad/s.
    const RATE: f64 = 100.0 * TAU;

    /// A torque of 100 Hz, N·m, and how a free shaft without friction moves under it from rest.
    fn torque(t: f64) -> f64 {
        libm::sin(RATE * t)
    }

    fn exact(rigid: &Rigid, t: f64) -> f64 {
        let acceleration = 1.0 / ((rigid.motor_inertia + rigid.load_inertia) * TAU);
        acceleration * (t / RATE - libm::sin(RATE * t) / (RATE * RATE))
    }

    /// The worst reading of a coupled shaft in 20 ms on a grid of `step`, revolutions.
    fn worst_reading(step: Duration) -> f64 {
        let rigid = Rigid {
            viscous_friction: 0.0,
            coulomb_friction: 0.0,
            ..Rigid::default()
        };
        let mut mechanics = rigid.clone();
        let mut shaft = Shaft::new(rigid.clone(), 0.0);
        shaft.couple(Instant::ZERO);
        let (mut motion, mut worst) = ([Motion::default()], 0_f64);
        let (mut now, mut grid) = (Instant::ZERO, Instant::ZERO + step);
        let dt = SPEED_STEP.as_secs_f64();
        while now < Instant::from_nanos(20_000_000) {
            let t = now.as_nanos() as f64 * 1e-9;
            now += SPEED_STEP;
            shaft.step(now, dt, torque(t + 0.5 * dt), true);
            worst = worst.max((shaft.position() - exact(&rigid, t + dt)).abs());
            if now >= grid {
                let loads = [shaft.take_load()];
                let before = motion[0].velocity;
                mechanics.step(step.as_secs_f64(), &loads, &mut motion);
                motion[0].acceleration = (motion[0].velocity - before) / step.as_secs_f64();
                shaft.moved(grid, motion[0]);
                grid += step;
            }
        }
        worst
    }

    /// Half the step, a quarter of the error.
    #[test]
    fn a_reading_between_points_of_the_grid_errs_with_the_square_of_its_step() {
        let errors =
            [250_000, 125_000, 62_500].map(|step| worst_reading(Duration::from_nanos(step)));
        for pair in errors.windows(2) {
            let order = libm::log2(pair[0] / pair[1]);
            assert!((1.8..2.2).contains(&order), "order {order}: {errors:?}");
        }
        // Much less than if the shaft were taken to go on with its velocity alone: a h²/2.
        let rigid = Rigid::default();
        let acceleration = 1.0 / ((rigid.motor_inertia + rigid.load_inertia) * TAU);
        let by_velocity = 0.5 * acceleration * 62.5e-6 * 62.5e-6;
        assert!(errors[2] < by_velocity / 3.0, "{errors:?}");
    }

    #[test]
    fn a_shaft_without_torque_coasts() {
        let mut shaft = Shaft::new(Rigid::default(), 0.0);
        shaft.lose_torque(true);
        shaft.step(Instant::ZERO, 62.5e-6, 1.4, true);
        assert_eq!((shaft.position(), shaft.velocity()), (0.0, 0.0));
        shaft.lose_torque(false);
        shaft.step(Instant::ZERO, 62.5e-6, 1.4, true);
        assert!(shaft.velocity() > 0.0);
    }

    /// A step of the grid in which no speed step ended has the torque of the one before.
    #[test]
    fn a_coupled_shafts_load_is_its_mean_torque_since_it_was_asked_last() {
        let mut shaft = Shaft::new(Rigid::default(), 0.0);
        shaft.couple(Instant::ZERO);
        shaft.step(Instant::from_nanos(100), 100e-9, 1.0, true);
        shaft.step(Instant::from_nanos(400), 300e-9, 2.0, true);
        assert!((shaft.take_load().torque - 1.75).abs() < 1e-12);
        assert!((shaft.take_load().torque - 1.75).abs() < 1e-12);
        shaft.step(Instant::from_nanos(500), 100e-9, -1.0, false);
        let load = shaft.take_load();
        assert!((load.torque + 1.0).abs() < 1e-12 && !load.brake_open);
    }
}
