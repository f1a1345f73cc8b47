//! The loops of a servo drive put together: clock, cascade, power stage, motor and encoder.

use super::axis::ServoAxis;
use super::cascade::{Cascade, Gains, Reference, SPEED_STEP};
use super::clock::Clock;
use super::encoder::{Encoder, Scale};
use super::power_stage::TorqueSource;
use super::shaft::Shaft;
use crate::twin::node::Processor;
use syncline_canopen::Instant;

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
    /// The last reading of where the axis is: the encoder's, or that of the scale at the load.
    pub encoder: i64,
    /// The last reading of the encoder, from which the speed is taken.
    motor: i64,
    /// Of the encoder.
    pub increments_per_revolution: f64,
    sensor: Encoder,
    scale: Option<Scale>,
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
        let loops = Self::new(
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
        );
        match axis.scale {
            Some(scale) => loops.by_scale(scale),
            None => loops,
        }
    }

    /// With a scale at the load, by which they close the position loop; the speed loop stays the motor's.
    #[must_use]
    pub fn by_scale(mut self, scale: Scale) -> Self {
        self.scale = Some(scale);
        self.encoder = self.read(0.0);
        self
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
            motor: encoder,
            sensor,
            scale: None,
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

    /// What says where the axis is reads `ahead` seconds after the last step.
    pub fn read(&mut self, ahead: f64) -> i64 {
        let counts = self.increments_per_revolution;
        let reading = match self.scale {
            Some(scale) => scale.read(&self.shaft, ahead, counts),
            None => self.sensor.read(&self.shaft, ahead),
        };
        self.seen(reading)
    }

    /// Takes what is read now.
    fn look(&mut self) {
        let reading = self.sensor.read(&self.shaft, 0.0);
        self.motor = self.seen(reading);
        self.encoder = match self.scale {
            Some(_) => self.read(0.0),
            None => self.motor,
        };
    }

    /// A reading as the loops see it.
    fn seen(&self, reading: i64) -> i64 {
        if self.direction < 0.0 {
            -reading
        } else {
            reading
        }
    }

    /// Sees the motor turn this way from now on, 1 or -1, standing where it is.
    pub fn turn_to(&mut self, direction: f64) {
        self.direction = direction;
        self.look();
        self.cascade = Cascade::new(self.cascade.gains().clone(), self.motor);
    }

    /// One step of the position loop, within this torque in N·m.
    pub fn position_step(&mut self, reference: Reference, torque_limit: f64) {
        self.cascade.limit_torque(torque_limit);
        let counts = self.increments_per_revolution;
        self.cascade.position_step(reference, self.encoder, counts);
    }

    /// The clock's steps of the speed loop that end until an instant, up to one with which the position loop's next one is due or
    /// the clock's cycle ends. The power stage is on unless the reference is [`Reference::Off`]. The holding brake is open with
    /// it, unless it `grips`. Whether the cycle has ended.
    pub fn speed_steps(&mut self, reference: Reference, grips: bool, until: Instant) -> bool {
        let ends = match self.plain_steps(reference, grips, until) {
            Some(ends) => ends,
            None => self.any_steps(reference, grips, until),
        };
        // A SYNC that stays away paces nothing any more.
        self.is_synced &= self.steps < SYNC_LOST;
        if ends && !self.is_synced {
            self.latch_torque();
        }
        ends
    }

    /// Whatever they move, and by whatever they see it.
    fn any_steps(&mut self, reference: Reference, grips: bool, until: Instant) -> bool {
        let is_on = reference != Reference::Off;
        let mut sensor = self.sensor.plain();
        let mut speed_loop = (self.cascade).speed_loop(reference, self.increments_per_revolution);
        let mut reading = self.motor as f64;
        let ends = self.clock.take_steps(until, |end, dt| {
            let is_held = self.torque_source.is_limited();
            let filters = |wanted| self.cascade.filtered(wanted);
            let wanted = speed_loop.step(reading, is_held, filters) * self.direction;
            self.torque = (self.torque_source).step(wanted, is_on, &self.shaft, SPEED_STEP);
            self.shaft.step(end, dt, self.torque, is_on && !grips);
            let seen = match &mut sensor {
                Some(sensor) => sensor.read(self.shaft.position()),
                None => self.sensor.read(&self.shaft, 0.0) as f64,
            };
            reading = seen * self.direction;
            self.impulse += self.torque;
            self.steps += 1;
        });
        self.cascade.go_on(&speed_loop);
        if let Some(sensor) = sensor {
            self.sensor.go_on(sensor);
        }
        self.motor = reading as i64;
        self.encoder = match self.scale {
            Some(_) => self.read(0.0),
            None => self.motor,
        };
        ends
    }

    /// The same steps, where all that they go by is at hand: an inertia with friction, which has what torque is asked for at once,
    /// and an encoder with nothing but noise. `None`, and no step, where there is more.
    fn plain_steps(&mut self, reference: Reference, grips: bool, until: Instant) -> Option<bool> {
        let is_on = reference != Reference::Off;
        let (rigid, mut load, mut motion) = self.shaft.rigid(is_on && !grips)?;
        let is_plain = matches!(self.torque_source, TorqueSource::Ideal)
            && self.scale.is_none()
            && !self.cascade.has_filters();
        let mut sensor = self.sensor.plain().filter(|_| is_plain)?;
        let mut speed_loop = (self.cascade).speed_loop(reference, self.increments_per_revolution);
        let (direction, reaches) = (self.direction, self.shaft.has_torque());
        let (mut reading, mut at) = (self.motor as f64, self.shaft.at());
        let (mut torque, mut impulse, mut steps) = (self.torque, self.impulse, self.steps);
        let ends = self.clock.take_steps(until, |end, dt| {
            at = end;
            torque = speed_loop.step(reading, false, |wanted| wanted) * direction;
            load.torque = if reaches { torque } else { 0.0 };
            motion = rigid.moved(dt, &load, motion);
            reading = sensor.read(motion.position) * direction;
            impulse += torque;
            steps += 1;
        });
        self.shaft.go_on(at, motion);
        self.cascade.go_on(&speed_loop);
        self.sensor.go_on(sensor);
        (self.torque, self.impulse, self.steps) = (torque, impulse, steps);
        self.motor = reading as i64;
        self.encoder = self.motor;
        Some(ends)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mechanics::drive_train::{DriveTrain, Elasticity, LeadError};
    use crate::twin::random::Random;
    use crate::twin::servo::encoder::EncoderErrors;

    const COUNTS: f64 = 131_072.0;

    /// A vertical axis on a screw with play whose lead is wrong.
    fn train() -> DriveTrain {
        let train = DriveTrain {
            rotor_inertia: 3e-4,
            load_inertia: 5e-4,
            load_torque: -0.4,
            lead_error: LeadError::new(vec![(0.0, 0.0), (4.0, 0.02)]),
            ..DriveTrain::default()
        };
        let spring = Elasticity::damped(400.0, 0.05, [3e-4, 5e-4]);
        let play = 0.01;
        DriveTrain {
            elasticity: Some(Elasticity { play, ..spring }),
            ..train
        }
    }

    fn loops(scale: Option<f64>, direction: f64) -> Loops {
        let sensor = Encoder::new(COUNTS, EncoderErrors::default(), Random::new(0, 0));
        let (clock, shaft) = (Clock::new(Instant::ZERO, 0.0), Shaft::new(train(), 0.0));
        let gains = Gains {
            position: 40.0,
            ..Gains::default()
        };
        let mut loops = Loops::new(clock, shaft, sensor, COUNTS, gains, TorqueSource::Ideal);
        if let Some(step) = scale {
            loops = loops.by_scale(Scale { step });
        }
        if direction < 0.0 {
            loops.turn_to(direction);
        }
        loops
    }

    /// Goes to a position, revolutions as the loops see it, and rests there; where the load is then.
    fn go_to(loops: &mut Loops, turns: f64) -> f64 {
        for step in 0..64_000 {
            // In two seconds, smoothly.
            let u = (f64::from(step) / 32_000.0).min(1.0);
            let share = u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
            let reference = Reference::Position {
                position: turns * COUNTS * share,
                velocity: 0.0,
                acceleration: 0.0,
            };
            if step % 4 == 0 {
                loops.position_step(reference, 4.0);
            }
            let end = loops.clock.step_end();
            loops.speed_steps(reference, false, end);
        }
        loops.shaft.load_position()
    }

    #[test]
    fn a_scale_sees_what_the_encoder_does_not() {
        let twisted = 0.4 / 400.0 + 0.5 * 0.01;
        for (direction, turns) in [(1.0, 3.0), (1.0, 1.5), (-1.0, -3.0)] {
            let place = turns * direction;
            // The encoder is where it is to be: the load is off by the lead error there, and by twist and play, as it hangs.
            let load = go_to(&mut loops(None, direction), turns);
            let hangs = place - twisted / core::f64::consts::TAU;
            let expected = hangs + 0.005 * hangs;
            assert!(
                (load - expected).abs() < 2e-5,
                "{load} instead of {expected}"
            );
            // With a scale it is the load that is there, up to a step of it; the motor makes up for all that.
            for step in [1e-5, 1e-3] {
                let load = go_to(&mut loops(Some(step), direction), turns);
                assert!(
                    (load - place).abs() < 1.2 * step + 2e-5,
                    "{step}: {load} of {place}"
                );
            }
        }
    }

    /// Without the speed loop's integral a servo is a spring: a torque M on the load turns it by M / (K Kp), with the gain K
    /// of the speed loop and Kp of the position loop. With the integral it is where it was.
    #[test]
    fn a_force_from_outside_deflects_a_servo_by_its_stiffness() {
        for (integral_time, deflects) in [(1e9, 1.0), (0.009, 0.0)] {
            let sensor = Encoder::new(COUNTS, EncoderErrors::default(), Random::new(0, 0));
            let train = DriveTrain {
                bearing: crate::mechanics::friction::Friction::default(),
                ..DriveTrain::default()
            };
            let (clock, shaft) = (Clock::new(Instant::ZERO, 0.0), Shaft::new(train, 0.0));
            let gains = Gains {
                speed_integral_time: integral_time,
                ..Gains::default()
            };
            let stiffness = gains.speed * gains.position;
            let mut loops = Loops::new(clock, shaft, sensor, COUNTS, gains, TorqueSource::Ideal);
            go_to(&mut loops, 0.0);
            loops.shaft.push(-0.8);
            let place = go_to(&mut loops, 0.0);
            let expected = -0.8 / stiffness * deflects;
            assert!(
                (place - expected).abs() < 2.0 / COUNTS,
                "{place} instead of {expected}"
            );
        }
    }

    /// Where nothing gives way and no lead is wrong both say the same, and so the loops do.
    #[test]
    fn a_scale_on_a_stiff_axis_changes_nothing() {
        let of = |scale| {
            let sensor = Encoder::new(COUNTS, EncoderErrors::default(), Random::new(0, 0));
            let (clock, shaft) = (
                Clock::new(Instant::ZERO, 0.0),
                Shaft::new(DriveTrain::default(), 0.0),
            );
            let gains = Gains::default();
            let loops = Loops::new(clock, shaft, sensor, COUNTS, gains, TorqueSource::Ideal);
            let mut loops = match scale {
                true => loops.by_scale(Scale { step: 1.0 / COUNTS }),
                false => loops,
            };
            go_to(&mut loops, 2.0);
            (loops.shaft.position(), loops.encoder, loops.torque())
        };
        assert_eq!(of(true), of(false));
    }
}
