//! What motors move.
//!
//! A [`Mechanics`] takes the load on each of its shafts, lets a step of time pass, and leaves the
//! motion of each. [`rigid`] and [`drive_train`] have one shaft and step with the speed loop of the one
//! drive that moves it: an inertia with friction, which is taken where nothing is known, and a feed
//! axis with all that its data sheets say. What ties several shafts together ([`rigid_beam`]) cannot step with any of their
//! drives, whose oscillators differ: the [world](crate::world) steps it on a grid of its own, and
//! each drive reads its shaft in between. What no shaft feels is the machine's [`structure`], which sways between
//! tool and workpiece.
//!
//! # What the grid costs
//!
//! Between two points of the grid, `h` seconds apart, a shaft is taken to go on with the
//! acceleration of the step before ([`Motion::ahead`]). If the acceleration then changes by `Δa`,
//! the reading is wrong by at most `Δa h²/2` until the next point sets it right. For a motor of
//! 1.4 N·m on 5·10⁻⁴ kg·m² whose whole torque comes at once that is 8.7·10⁻⁷ revolutions with the
//! world's 62.5 µs, a ninth of an increment of 131072.
//!
//! The motor's torque acts on the mechanics as its mean over the speed steps that ended in a step
//! of the grid: later by at most a step of the grid, and by a speed step where the grid is the
//! finer of the two. Under a torque that swings by ±1 N·m at 100 Hz all this together makes
//! 1.3·10⁻⁷ revolutions at 62.5 µs and falls with the square of the step, which a test holds.

pub mod drive_train;
pub mod friction;
pub mod mode;
pub mod reactions;
pub mod rigid;
pub mod rigid_beam;
pub mod structure;
pub mod touch_probe;

/// What acts on a shaft during a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    /// Torque of the motor, N·m.
    pub torque: f64,
    /// Torque from outside on what it moves, N·m at the shaft: a cutting force.
    pub outside: f64,
    /// Whether the holding brake is open.
    pub brake_open: bool,
    /// Whether the shaft is blocked where it is.
    pub blocked: bool,
}

/// How a shaft moves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// Revolutions from the encoder's zero.
    pub position: f64,
    /// rev/s.
    pub velocity: f64,
    /// rev/s² during the last step, to extrapolate with; 0 from what steps with its drive.
    pub acceleration: f64,
}

impl Motion {
    /// The motion `dt` seconds later if the acceleration lasts.
    #[must_use]
    pub fn ahead(self, dt: f64) -> Self {
        Self {
            position: self.position + (self.velocity + 0.5 * self.acceleration * dt) * dt,
            velocity: self.velocity + self.acceleration * dt,
            ..self
        }
    }

    /// At rest, so many revolutions further.
    #[must_use]
    pub fn displaced(self, by: f64) -> Self {
        Self {
            position: self.position + by,
            ..Self::default()
        }
    }
}

/// Masses, springs and friction behind one or several shafts.
pub trait Mechanics: Send {
    /// Lets `dt` seconds pass. Each shaft has its place in both slices; behind them `motions` has those
    /// of shafts that are only looked at.
    fn step(&mut self, dt: f64, loads: &[Load], motions: &mut [Motion]);

    /// One of its shafts, by its place, was brought so many revolutions further by hand.
    fn displaced(&mut self, _shaft: usize, _by: f64) {}
}
