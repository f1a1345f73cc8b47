//! The cascade in the drive: position loop with velocity and acceleration feed-forward, speed loop, filters, torque limit.
//!
//! ```text
//! position ─►(−)─► Kp ─►(+)─► overshoot ─► filter ─►(−)─► PI ─►(+)─► filter ─► notches ─► limit ─► torque
//!             ▲          ▲  suppression               ▲          ▲
//!          encoder   velocity × share      speed, filtered   acceleration × inertia × share
//!                                                            + friction compensation
//!                                                            + torque offset
//! ```
//!
//! The manual at hand names these parameters (3011h…3013h) without their values; the defaults
//! here are assumptions that let the default [`Rigid`](crate::mechanics::rigid::Rigid) axis follow well.

use super::filter::{Delayed, Notch, NotchShape, OvershootSuppression};
use super::motor::Motor;
use crate::mechanics::drive_train::DriveTrain;
use core::f64::consts::TAU;

/// Steps of the speed loop per step of the position loop.
pub const SPEED_STEPS: u32 = 4;

/// Nominal time between two steps of the position loop, nanoseconds.
pub const POSITION_STEP_NS: u64 = 250_000;

/// The same, s.
pub const POSITION_STEP: f64 = POSITION_STEP_NS as f64 * 1e-9;

/// Nominal time between two steps of the speed loop, nanoseconds.
pub const SPEED_STEP_NS: u64 = POSITION_STEP_NS / SPEED_STEPS as u64;

/// The same, s.
pub const SPEED_STEP: f64 = SPEED_STEP_NS as f64 * 1e-9;

/// Gains and limits of the cascade.
#[derive(Clone, Debug, PartialEq)]
pub struct Gains {
    /// Position loop, 1/s (`CTRL1_KPp`).
    pub position: f64,
    /// Share of the reference's velocity that goes straight to the speed loop (`CTRL1_KFPp`).
    pub velocity_feed_forward: f64,
    /// Share of the torque that the reference's acceleration takes which goes straight to the torque
    /// (`CTRL_KFAcc`).
    pub acceleration_feed_forward: f64,
    /// Inertia of the whole axis as commissioned, kg·m².
    pub inertia: f64,
    /// Suppression of overshoot in the speed reference (`CTRL1_Osupdamp`, `CTRL1_Osupdelay`).
    pub overshoot_suppression: Option<OvershootSuppression>,
    /// Torque against friction, N·m, in the direction of the speed reference (`CTRL1_Kfric`).
    pub friction_compensation: f64,
    /// Speed up to which that grows linearly, rev/s (`CTRL_SpdFric`).
    pub friction_speed: f64,
    /// Speed loop, N·m per rev/s (`CTRL1_KPn`).
    pub speed: f64,
    /// Integral time of the speed loop, s (`CTRL1_TNn`).
    pub speed_integral_time: f64,
    /// Time constant of the filter on the speed reference, s (`CTRL1_TAUnref`).
    pub speed_reference_filter: f64,
    /// Time constant of the filter on the measured speed, s (`CTRL_TAUnact`).
    pub speed_filter: f64,
    /// Time constant of the filter on the wanted torque, s; 0: none (`CTRL1_TAUiref`).
    pub torque_filter: f64,
    /// Notches in the wanted torque (`CTRL1_Nf1…`, `CTRL1_Nf2…`).
    pub notches: [Option<NotchShape>; 2],
    /// Torque of an ampere, N·m/A.
    pub torque_constant: f64,
    /// Continuous stall torque, N·m: 100 % of 6071h and 6077h (`_M_M_0`).
    pub continuous_torque: f64,
    /// Largest torque, N·m (`CTRL_I_max`).
    pub torque_limit: f64,
    /// Largest speed reference, rev/s (`CTRL_v_max`).
    pub speed_limit: f64,
}

/// Of the default axis with the default motor, by hand; for others see [`Gains::commissioned`].
impl Default for Gains {
    fn default() -> Self {
        Self {
            position: 80.0,
            velocity_feed_forward: 0.0,
            acceleration_feed_forward: 0.0,
            inertia: DEFAULT_INERTIA,
            overshoot_suppression: None,
            friction_compensation: 0.0,
            friction_speed: 5.0 / 60.0,
            speed: 1.6,
            speed_integral_time: 0.009,
            speed_reference_filter: 0.5e-3,
            speed_filter: 0.2e-3,
            torque_filter: 0.0,
            notches: [None; 2],
            torque_constant: Motor::default().torque_constant,
            continuous_torque: 1.4,
            torque_limit: 4.2,
            speed_limit: 110.0,
        }
    }
}

/// Inertia behind the default gains, kg·m²: the default [`Rigid`](crate::mechanics::rigid::Rigid) axis.
const DEFAULT_INERTIA: f64 = 5.1e-4;

/// Bandwidth of the speed loop over the angular frequency at which the load takes up everything, as
/// an engineer sets it who commissions an elastic axis.
const BANDWIDTH_TO_ANTIRESONANCE: f64 = 0.6;

impl Gains {
    /// As this motor is commissioned on this axis: the default loops, as fast as the axis lets them
    /// be. The speed loop's bandwidth is the default one, or what the antiresonance leaves; the other
    /// loops keep their ratio to it.
    #[must_use]
    pub fn commissioned(motor: &Motor, train: &DriveTrain) -> Self {
        let default = Self::default();
        let bandwidth = default.speed / (TAU * DEFAULT_INERTIA);
        let wanted = train.resonances().map_or(bandwidth, |(antiresonance, _)| {
            bandwidth.min(BANDWIDTH_TO_ANTIRESONANCE * TAU * antiresonance)
        });
        let slower = wanted / bandwidth;
        let inertia = train.rotor_inertia + train.load_inertia;
        Self {
            position: default.position * slower,
            speed: default.speed * slower * (inertia / DEFAULT_INERTIA),
            inertia,
            torque_constant: motor.torque_constant,
            speed_integral_time: default.speed_integral_time / slower,
            continuous_torque: motor.continuous_torque,
            torque_limit: motor.peak_torque,
            ..default
        }
    }
}

/// What the loops are to follow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reference {
    /// The power stage is off: no torque.
    Off,
    /// A position in increments with its derivatives.
    Position {
        /// Where, increments from the encoder's zero.
        position: f64,
        /// How fast the reference moves there.
        velocity: f64,
        /// How its velocity changes, increments/s².
        acceleration: f64,
    },
    /// A velocity in rev/s.
    Velocity(f64),
    /// A torque in N·m.
    Torque(f64),
}

/// What a step of the speed loop multiplies by, from its gains: parts of a difference that first-order filters take over in a
/// step, what the integral takes of the error, and what of it becomes torque at once.
#[derive(Clone, Copy, Debug, Default)]
struct Factors {
    speed: f64,
    reference: f64,
    torque: f64,
    integral: f64,
    error: f64,
}

impl Factors {
    fn of(gains: &Gains) -> Self {
        let part = |time: f64| SPEED_STEP / (time + SPEED_STEP);
        let integral = gains.speed / gains.speed_integral_time * SPEED_STEP;
        Self {
            speed: part(gains.speed_filter),
            reference: part(gains.speed_reference_filter),
            torque: part(gains.torque_filter),
            integral,
            error: gains.speed + integral,
        }
    }
}

/// The speed loop apart from the cascade, so that it stays at hand while steps follow one another under one reference.
#[derive(Clone, Copy, Debug)]
pub(super) struct SpeedLoop {
    reference: Reference,
    /// What the position loop wants, rev/s, and what is added to the torque, N·m.
    speed: f64,
    forward: f64,
    limit: f64,
    factors: Factors,
    /// What an increment in a step adds to the measured speed, and what is kept of that, as its filter has it.
    adds: f64,
    keeps: f64,
    encoder: f64,
    filtered_reference: f64,
    filtered_speed: f64,
    integral: f64,
    torque: f64,
}

impl SpeedLoop {
    /// One step over an encoder that reads a whole number; the torque in N·m, which goes through the filters that there are.
    #[inline(always)]
    pub(super) fn step(
        &mut self,
        encoder: f64,
        is_held: bool,
        filters: impl FnOnce(f64) -> f64,
    ) -> f64 {
        // All that hangs on the reading is as short as it can be: the next reading waits for it.
        let moved = encoder - self.encoder;
        self.encoder = encoder;
        self.filtered_speed = self.filtered_speed * self.keeps + moved * self.adds;
        self.torque = match self.reference {
            Reference::Off => 0.0,
            Reference::Torque(torque) => torque.clamp(-self.limit, self.limit),
            Reference::Position { .. } | Reference::Velocity(_) => {
                self.filtered_reference +=
                    (self.speed - self.filtered_reference) * self.factors.reference;
                let error = self.filtered_reference - self.filtered_speed;
                let integral = self.integral + error * self.factors.integral;
                let before = self.integral + self.forward;
                let wanted = filters(before + error * self.factors.error);
                let torque = wanted.clamp(-self.limit, self.limit);
                // A saturated loop does not wind up.
                if torque == wanted && !is_held {
                    self.integral = integral;
                }
                torque
            }
        };
        self.torque
    }
}

/// What the wanted torque goes through.
#[derive(Clone, Debug, Default)]
struct Filters {
    torque: f64,
    notches: [Option<Notch>; 2],
}

impl Filters {
    fn reset(&mut self) {
        self.torque = 0.0;
        self.notches.iter_mut().flatten().for_each(Notch::reset);
    }

    /// `part` is what the low-pass takes over of a difference, if there is one.
    fn next(&mut self, mut wanted: f64, part: Option<f64>) -> f64 {
        if let Some(part) = part {
            self.torque += (wanted - self.torque) * part;
            wanted = self.torque;
        }
        for notch in self.notches.iter_mut().flatten() {
            wanted = notch.next(wanted);
        }
        wanted
    }
}

/// The state of the cascade.
#[derive(Clone, Debug)]
pub struct Cascade {
    gains: Gains,
    factors: Factors,
    /// Most torque at present, N·m, where it is less than the gains' limit.
    torque_limit: f64,
    speed_reference: f64,
    delayed: Delayed,
    /// What the drive is sent besides, N·m.
    torque_offset: f64,
    /// Feed-forward, friction compensation and what is sent, N·m.
    torque_forward: f64,
    filtered_reference: f64,
    filtered_speed: f64,
    integral: f64,
    filters: Filters,
    /// The last reading, a whole number.
    encoder: f64,
    torque: f64,
}

impl Cascade {
    /// Loops at rest over an encoder that reads `encoder`.
    #[must_use]
    pub fn new(gains: Gains, encoder: i64) -> Self {
        let mut cascade = Self {
            gains: Gains::default(),
            factors: Factors::default(),
            torque_limit: f64::INFINITY,
            speed_reference: 0.0,
            delayed: Delayed::default(),
            torque_offset: 0.0,
            torque_forward: 0.0,
            filtered_reference: 0.0,
            filtered_speed: 0.0,
            integral: 0.0,
            filters: Filters::default(),
            encoder: encoder as f64,
            torque: 0.0,
        };
        cascade.retune(gains);
        cascade
    }

    /// Gains in force.
    #[must_use]
    pub fn gains(&self) -> &Gains {
        &self.gains
    }

    /// Other gains from now on. Filters that stay the same go on.
    pub fn retune(&mut self, gains: Gains) {
        for (index, shape) in gains.notches.iter().enumerate() {
            if self.gains.notches[index] != *shape {
                self.filters.notches[index] = shape.map(|shape| Notch::new(shape, SPEED_STEP));
            }
        }
        if self.gains.overshoot_suppression.is_none() {
            self.delayed.reset(self.speed_reference);
        }
        self.factors = Factors::of(&gains);
        self.gains = gains;
    }

    /// The largest speed reference from now on, rev/s.
    pub fn limit_speed(&mut self, limit: f64) {
        self.gains.speed_limit = limit;
    }

    /// The largest torque from now on, N·m, if it is less than the gains' limit.
    pub fn limit_torque(&mut self, limit: f64) {
        self.torque_limit = limit;
    }

    /// The torque that the speed loop adds to its own from the next step of the position loop on, N·m.
    pub fn offset_torque(&mut self, offset: f64) {
        self.torque_offset = offset;
    }

    /// Torque that the loops ask for now, N·m.
    #[must_use]
    pub fn torque(&self) -> f64 {
        self.torque
    }

    /// Starts again from the measured speed, without stored torque: the power stage goes on.
    pub fn reset(&mut self) {
        self.speed_reference = self.filtered_speed;
        self.filtered_reference = self.filtered_speed;
        self.delayed.reset(self.filtered_speed);
        self.integral = 0.0;
        self.torque = 0.0;
        self.torque_forward = 0.0;
        self.filters.reset();
    }

    /// One step of the position loop.
    pub fn position_step(&mut self, reference: Reference, encoder: i64, increments_per_rev: f64) {
        let gains = &self.gains;
        let limit = gains.speed_limit;
        let mut forward_torque = self.torque_offset;
        let mut speed = match reference {
            Reference::Position {
                position,
                velocity,
                acceleration,
            } => {
                let error = (position - encoder as f64) / increments_per_rev;
                let forward = velocity / increments_per_rev * gains.velocity_feed_forward;
                let radians = acceleration / increments_per_rev * TAU;
                forward_torque += gains.acceleration_feed_forward * gains.inertia * radians;
                (forward + gains.position * error).clamp(-limit, limit)
            }
            Reference::Velocity(velocity) => velocity.clamp(-limit, limit),
            Reference::Off | Reference::Torque(_) => 0.0,
        };
        if let Some(shape) = gains.overshoot_suppression {
            speed = self.delayed.next(speed, shape, POSITION_STEP);
        }
        if gains.friction_compensation != 0.0 {
            let share = (speed / gains.friction_speed).clamp(-1.0, 1.0);
            forward_torque += gains.friction_compensation * share;
        }
        self.torque_forward = forward_torque;
        self.speed_reference = speed;
    }

    /// Its speed loop under a reference, which [goes on](Self::go_on) in its place.
    #[inline]
    pub(super) fn speed_loop(&self, reference: Reference, increments_per_rev: f64) -> SpeedLoop {
        SpeedLoop {
            reference,
            speed: self.speed_reference,
            forward: self.torque_forward,
            limit: self.gains.torque_limit.min(self.torque_limit),
            factors: self.factors,
            adds: self.factors.speed / (increments_per_rev * SPEED_STEP),
            keeps: 1.0 - self.factors.speed,
            encoder: self.encoder,
            filtered_reference: self.filtered_reference,
            filtered_speed: self.filtered_speed,
            integral: self.integral,
            torque: self.torque,
        }
    }

    /// Its speed loop has come that far.
    #[inline]
    pub(super) fn go_on(&mut self, from: &SpeedLoop) {
        self.encoder = from.encoder;
        self.filtered_reference = from.filtered_reference;
        self.filtered_speed = from.filtered_speed;
        self.integral = from.integral;
        self.torque = from.torque;
    }

    /// Whether the wanted torque goes through filters.
    pub(super) fn has_filters(&self) -> bool {
        self.gains.torque_filter > 0.0 || self.filters.notches.iter().any(Option::is_some)
    }

    /// One step of the speed loop; returns the torque in N·m. The integral
    /// part rests while the torque is limited, here or, if `is_held`, behind.
    pub fn speed_step(
        &mut self,
        reference: Reference,
        encoder: i64,
        increments_per_rev: f64,
        is_held: bool,
    ) -> f64 {
        let mut speed_loop = self.speed_loop(reference, increments_per_rev);
        speed_loop.step(encoder as f64, is_held, |wanted| self.filtered(wanted));
        self.go_on(&speed_loop);
        self.torque
    }

    /// What becomes of the wanted torque on its way through the filters.
    #[inline]
    pub(super) fn filtered(&mut self, wanted: f64) -> f64 {
        if !self.has_filters() {
            return wanted;
        }
        let part = (self.gains.torque_filter > 0.0).then_some(self.factors.torque);
        self.filters.next(wanted, part)
    }
}

#[cfg(test)]
mod tests;
