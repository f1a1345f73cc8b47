//! The loops of a servo drive put together: clock, cascade, power stage, motor and encoder.

use super::axis::ServoAxis;
use super::cascade::{Cascade, Gains, Reference, SPEED_STEP_NS};
use super::clock::Clock;
use super::encoder::Encoder;
use super::power_stage::TorqueSource;
use super::shaft::Shaft;
use crate::twin::node::Processor;

/// Nominal seconds per step of the speed loop.
const SPEED_STEP: f64 = SPEED_STEP_NS as f64 * 1e-9;

/// Steps without SYNC after which it has stayed away: 50 ms.
const SYNC_LOST: u32 = 800;

/// Loops in motion. Positions are increments of the encoder, as the loops see it.
pub struct Loops {
    /// What paces them.
    pub clock: Clock,
    /// What they move.
    pub shaft: Shaft,
    /// What turns a reading into a torque.
    pub cascade: Cascade,
    /// What the cascade's torque becomes.
    pub torque_source: TorqueSource,
    /// The encoder's last reading.
    pub encoder: i64,
    /// Of the encoder.
    pub increments_per_revolution: f64,
    sensor: Encoder,
    /// 1, or -1 where the loops see the motor turn the other way.
    direction: f64,
    torque: f64,
    /// Torques of the steps since the clock's cycle began, or since SYNC, and how many these are.
    impulse: f64,
    steps: u32,
    /// Their mean over the last whole cycle.
    mean_torque: f64,
    /// SYNC says when a cycle begins, not the clock.
    is_synced: bool,
}

impl Loops {
    /// Those of a drive with that axis, which stands so many revolutions from the encoder's zero.
    pub(in crate::twin) fn of(
        processor: &Processor,
        axis: ServoAxis,
        position: f64,
        increments_per_revolution: f64,
    ) -> Self {
        Self::new(
            processor.clock(),
            Shaft::new(axis.mechanics, position),
            Encoder::new(
                increments_per_revolution,
                axis.encoder,
                processor.encoder_noise(),
            ),
            increments_per_revolution,
            axis.gains,
            axis.torque_source,
        )
    }

    /// Loops at rest.
    #[must_use]
    pub fn new(
        clock: Clock,
        shaft: Shaft,
        mut sensor: Encoder,
        increments_per_revolution: f64,
        gains: Gains,
        torque_source: TorqueSource,
    ) -> Self {
        let encoder = sensor.read(&shaft, 0.0);
        Self {
            cascade: Cascade::new(gains, encoder),
            clock,
            shaft,
            torque_source,
            encoder,
            sensor,
            increments_per_revolution,
            direction: 1.0,
            torque: 0.0,
            impulse: 0.0,
            steps: 0,
            mean_torque: 0.0,
            is_synced: false,
        }
    }

    /// Torque of the motor, N·m.
    #[must_use]
    pub fn torque(&self) -> f64 {
        self.torque
    }

    /// Torque of the motor as a drive shows it: its mean over the last whole cycle of its clock, N·m, or since SYNC, where
    /// [`begin_cycle`](Self::begin_cycle) says when that was. Within a cycle it goes up and down with the steps of the
    /// reference, of which samples at SYNC would see always the same part.
    #[must_use]
    pub fn mean_torque(&self) -> f64 {
        match self.steps {
            1.. if self.is_synced => self.impulse / f64::from(self.steps),
            _ => self.mean_torque,
        }
    }

    /// SYNC begins a cycle, of a drive whose clock is free.
    pub fn begin_cycle(&mut self) {
        self.is_synced = true;
        self.latch_torque();
    }

    fn latch_torque(&mut self) {
        if self.steps > 0 {
            self.mean_torque = self.impulse / f64::from(self.steps);
        }
        (self.impulse, self.steps) = (0.0, 0);
    }

    /// 1, or -1 where the loops see the motor turn the other way.
    #[must_use]
    pub fn direction(&self) -> f64 {
        self.direction
    }

    /// What the encoder reads `ahead` seconds after the last step.
    pub fn read(&mut self, ahead: f64) -> i64 {
        let reading = self.sensor.read(&self.shaft, ahead);
        if self.direction < 0.0 {
            -reading
        } else {
            reading
        }
    }

    /// Sees the motor turn this way from now on, 1 or -1, standing where it is.
    pub fn turn_to(&mut self, direction: f64) {
        self.direction = direction;
        self.encoder = self.read(0.0);
        self.cascade = Cascade::new(self.cascade.gains().clone(), self.encoder);
    }

    /// One step of the position loop, within this torque in N·m.
    pub fn position_step(&mut self, reference: Reference, torque_limit: f64) {
        self.cascade.limit_torque(torque_limit);
        let counts = self.increments_per_revolution;
        self.cascade.position_step(reference, self.encoder, counts);
    }

    /// The clock's next step, one of the speed loop; the power stage is on unless the reference is
    /// [`Reference::Off`]. The holding brake is open with it, unless it `grips`. Whether the clock's cycle ends with it.
    pub fn speed_step(&mut self, reference: Reference, grips: bool) -> bool {
        let (_, dt) = self.clock.step();
        let end = self.clock.step_end();
        let (counts, is_on) = (self.increments_per_revolution, reference != Reference::Off);
        let is_held = self.torque_source.is_limited();
        let wanted =
            (self.cascade).speed_step(reference, self.encoder, counts, SPEED_STEP, is_held);
        let wanted = wanted * self.direction;
        self.torque = (self.torque_source).step(wanted, is_on, &self.shaft, SPEED_STEP);
        self.shaft.step(end, dt, self.torque, is_on && !grips);
        self.encoder = self.read(0.0);
        self.impulse += self.torque;
        self.steps += 1;
        let ends = self.clock.next_step();
        // A SYNC that stays away paces nothing any more.
        self.is_synced &= self.steps < SYNC_LOST;
        if ends && !self.is_synced {
            self.latch_torque();
        }
        ends
    }
}
