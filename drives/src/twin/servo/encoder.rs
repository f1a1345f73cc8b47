//! The encoder on the motor's shaft.

use super::shaft::Shaft;
use crate::twin::random::Random;

/// A position encoder with noise.
///
/// Noise is drawn once for each reading that the drive itself makes, so that whoever merely looks
/// on changes nothing: observers ask the [`Shaft`].
#[derive(Clone, Debug)]
pub struct Encoder {
    increments_per_revolution: f64,
    /// Standard deviation, increments.
    noise: f64,
    random: Random,
}

impl Encoder {
    /// An encoder whose noise has this standard deviation in increments.
    #[must_use]
    pub fn new(increments_per_revolution: f64, noise: f64, random: Random) -> Self {
        Self {
            increments_per_revolution,
            noise,
            random,
        }
    }

    /// What it reads `ahead` seconds after the shaft's last step: increments from its zero.
    pub fn read(&mut self, shaft: &Shaft, ahead: f64) -> i64 {
        let noise = self.random.bell() * self.noise;
        let revolutions = shaft.position() + shaft.velocity() * ahead;
        (revolutions * self.increments_per_revolution + noise).floor() as i64
    }
}
