//! Loops that run, for tests: a cascade with what it moves and an encoder without noise.

use super::cascade::{Cascade, Gains, Reference, SPEED_STEP, SPEED_STEPS};
use super::encoder::{Encoder, EncoderErrors, Scale};
use super::shaft::{Plant, Shaft};
use crate::twin::random::Random;
use syncline_canopen::Instant;

/// Increments of a turn: so fine that it is nearly continuous.
const COUNTS: f64 = 1e9;

/// A cascade and what it moves.
pub(super) struct Running {
    pub(super) cascade: Cascade,
    pub(super) shaft: Shaft,
    encoder: Encoder,
    reading: i64,
    /// A scale at the load closes the position loop.
    by_scale: bool,
    steps: u32,
}

impl Running {
    pub(super) fn new(gains: Gains, plant: impl Into<Plant>) -> Self {
        Self {
            cascade: Cascade::new(gains, 0),
            shaft: Shaft::new(plant, 0.0),
            encoder: Encoder::new(COUNTS, EncoderErrors::default(), Random::new(0, 0)),
            reading: 0,
            by_scale: false,
            steps: 0,
        }
    }

    /// The same with a scale at the load, as fine as the encoder.
    pub(super) fn by_scale(self, by_scale: bool) -> Self {
        Self { by_scale, ..self }
    }

    /// Seconds since the beginning.
    pub(super) fn time(&self) -> f64 {
        f64::from(self.steps) * SPEED_STEP
    }

    /// One step of the speed loop after what is wanted at each time, s.
    pub(super) fn step(&mut self, reference: impl Fn(f64) -> Reference) {
        let (reference, reading) = (reference(self.time()), self.reading);
        if self.steps.is_multiple_of(SPEED_STEPS) {
            let scale = Scale { step: 1.0 / COUNTS };
            let seen = match self.by_scale {
                true => scale.read(&self.shaft, 0.0, COUNTS),
                false => reading,
            };
            self.cascade.position_step(reference, seen, COUNTS);
        }
        let torque = (self.cascade).speed_step(reference, reading, COUNTS, false);
        self.shaft.step(Instant::ZERO, SPEED_STEP, torque, true);
        self.reading = self.encoder.read(&self.shaft, 0.0);
        self.steps += 1;
    }

    /// The same for so many seconds.
    pub(super) fn run(&mut self, seconds: f64, reference: impl Fn(f64) -> Reference) {
        for _ in 0..(seconds / SPEED_STEP) as usize {
            self.step(&reference);
        }
    }
}

/// A position in revolutions, with velocity and acceleration.
pub(super) fn at(position: f64, velocity: f64, acceleration: f64) -> Reference {
    Reference::Position {
        position: position * COUNTS,
        velocity: velocity * COUNTS,
        acceleration: acceleration * COUNTS,
    }
}
