//! The velocity that a drive measures from its encoder.

use super::cascade::POSITION_STEP;

/// Position steps over which it is averaged: 8 ms, an assumption of all drives here.
const WINDOW: usize = 32;

/// A mean over the last 8 ms, renewed with each step of the position loop.
#[derive(Clone, Debug)]
pub struct VelocityMeter {
    readings: [i64; WINDOW],
    oldest: usize,
    velocity: f64,
}

impl VelocityMeter {
    /// At rest where the encoder stands.
    #[must_use]
    pub fn at(encoder: i64) -> Self {
        Self {
            readings: [encoder; WINDOW],
            oldest: 0,
            velocity: 0.0,
        }
    }

    /// Takes the reading of another position step.
    pub(super) fn take(&mut self, encoder: i64) {
        let before = core::mem::replace(&mut self.readings[self.oldest], encoder);
        self.oldest = (self.oldest + 1) % WINDOW;
        self.velocity = (encoder - before) as f64 / (POSITION_STEP * WINDOW as f64);
    }

    /// Increments/s.
    #[must_use]
    pub fn velocity(&self) -> f64 {
        self.velocity
    }
}
