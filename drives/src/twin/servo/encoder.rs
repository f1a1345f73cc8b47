//! The encoder on the motor's shaft, and the scale at the load.

use super::shaft::Shaft;
use crate::twin::random::Random;
use crate::twin::rounding::{floor, floor_soon};
use core::f64::consts::TAU;

/// What makes an encoder's reading wrong, besides that it is a whole number of increments.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EncoderErrors {
    /// Standard deviation of the noise, increments.
    pub noise: f64,
    /// Steps of a revolution that the encoder itself tells apart; 0 for one in each increment.
    pub steps: u32,
    /// Signals of a revolution between which it interpolates, such as the sine periods of its disc.
    pub periods: u32,
    /// Amplitude of the error of that interpolation, which repeats with each signal, increments.
    pub interpolation: f64,
}

/// A position encoder with its errors.
///
/// Noise is drawn once for each reading that the drive itself makes, so that whoever merely looks
/// on changes nothing: observers ask the [`Shaft`].
#[derive(Clone, Debug)]
pub struct Encoder {
    increments_per_revolution: f64,
    errors: EncoderErrors,
    random: Random,
}

impl Encoder {
    /// An encoder that counts so many increments a revolution.
    #[must_use]
    pub fn new(increments_per_revolution: f64, errors: EncoderErrors, random: Random) -> Self {
        Self {
            increments_per_revolution,
            errors,
            random,
        }
    }

    /// What it reads `ahead` seconds after the shaft's last step: increments from its zero.
    pub fn read(&mut self, shaft: &Shaft, ahead: f64) -> i64 {
        let EncoderErrors {
            noise,
            steps,
            periods,
            interpolation,
        } = self.errors;
        let mut error = drawn(&mut self.random, noise);
        let revolutions = shaft.position() + shaft.velocity() * ahead;
        if interpolation != 0.0 {
            let phase = revolutions * f64::from(periods);
            error += interpolation * libm::sin(TAU * (phase - floor(phase)));
        }
        let increments = revolutions * self.increments_per_revolution + error;
        if steps == 0 {
            return whole(increments);
        }
        let step = self.increments_per_revolution / f64::from(steps);
        whole(floor(increments / step) * step)
    }
}

/// What an encoder without errors but noise goes by, apart, so that it stays at hand while readings follow one another.
#[derive(Clone, Debug)]
pub(super) struct PlainEncoder {
    increments_per_revolution: f64,
    noise: f64,
    random: Random,
}

impl PlainEncoder {
    /// What it reads at a position, as [`Encoder::read`]: a whole number.
    #[inline(always)]
    pub(super) fn read(&mut self, revolutions: f64) -> f64 {
        let noise = drawn(&mut self.random, self.noise);
        floor_soon(revolutions * self.increments_per_revolution + noise)
    }
}

impl Encoder {
    /// The same encoder while it has no errors but noise, until it goes on with [`Self::go_on`].
    pub(super) fn plain(&self) -> Option<PlainEncoder> {
        let is_plain = self.errors.interpolation == 0.0 && self.errors.steps == 0;
        is_plain.then(|| PlainEncoder {
            increments_per_revolution: self.increments_per_revolution,
            noise: self.errors.noise,
            random: self.random.clone(),
        })
    }

    /// Goes on where that one is.
    pub(super) fn go_on(&mut self, from: PlainEncoder) {
        self.random = from.random;
    }
}

/// Noise of that standard deviation; where there is none, nothing is drawn.
#[inline(always)]
fn drawn(random: &mut Random, noise: f64) -> f64 {
    match noise != 0.0 {
        true => random.bell() * noise,
        false => 0.0,
    }
}

/// The greatest whole number that is no more than this one, without a call where the processor has no instruction for it.
fn whole(increments: f64) -> i64 {
    let towards_zero = increments as i64;
    towards_zero.saturating_sub(i64::from(increments < towards_zero as f64))
}

/// A scale at the load: a second feedback, by which a drive closes its position loop.
///
/// It sees what the encoder does not: twist and play of the transmission, and its lead error and expansion. In between of two steps of
/// the axis it goes on with the load's speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// What it tells apart, revolutions of the motor's shaft; above 0.
    pub step: f64,
}

impl Scale {
    /// What it reads `ahead` seconds after the shaft's last step, in increments of an encoder that counts so many a
    /// revolution.
    #[must_use]
    pub fn read(&self, shaft: &Shaft, ahead: f64, increments_per_revolution: f64) -> i64 {
        let load = shaft.load_motion();
        let steps = floor((load.position + load.velocity * ahead) / self.step);
        whole(steps * self.step * increments_per_revolution)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mechanics::rigid::Rigid;

    fn read(errors: EncoderErrors, position: f64) -> i64 {
        let mut encoder = Encoder::new(131_072.0, errors, Random::new(0, 0));
        encoder.read(&Shaft::new(Rigid::default(), position), 0.0)
    }

    #[test]
    fn a_coarse_encoder_reads_its_own_steps() {
        let errors = EncoderErrors {
            steps: 4096,
            ..EncoderErrors::default()
        };
        for increment in [0, 31, 32, 1000, -1] {
            let position = (f64::from(increment) + 0.5) / 131_072.0;
            let expected = i64::from(increment).div_euclid(32) * 32;
            assert_eq!(read(errors, position), expected);
            let exact = read(EncoderErrors::default(), position);
            assert_eq!(exact, i64::from(increment));
        }
    }

    #[test]
    fn the_error_of_interpolation_repeats_with_each_signal() {
        let errors = EncoderErrors {
            periods: 128,
            interpolation: 10.0,
            ..EncoderErrors::default()
        };
        // A quarter into a signal of 1024 increments the sine is at its greatest.
        for signal in [0, 1, 77, -3] {
            let quarter = (f64::from(signal) + 0.25) / 128.0;
            let exact = i64::from(signal) * 1024 + 256;
            assert_eq!(read(errors, quarter) - exact, 10);
            assert_eq!(read(errors, quarter + 0.5 / 128.0) - exact - 512, -10);
        }
    }
}
