//! Filters of the loops: low-pass, notch, and a delayed share of the signal.

use core::f64::consts::PI;

/// A notch by its shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NotchShape {
    /// Of its middle, Hz.
    pub frequency: f64,
    /// Width over frequency, where it takes away half of what it takes in its middle.
    pub bandwidth: f64,
    /// What it takes away in its middle, of 1.
    pub depth: f64,
}

/// A second-order filter `(s² + 2 ζz ω s + ω²) / (s² + 2 ζp ω s + ω²)`, `ζp` half the bandwidth and
/// `ζz` what the depth leaves of it. It is made discrete by the bilinear transform, prewarped so that
/// its middle is where it should be.
#[derive(Clone, Copy, Debug)]
pub struct Notch {
    /// Of the last inputs, newest first, and of the last outputs.
    input: [f64; 3],
    output: [f64; 2],
    state: [f64; 2],
}

impl Notch {
    /// A notch for samples `step` seconds apart; a frequency beyond half of theirs is brought to
    /// just below it.
    #[must_use]
    pub fn new(shape: NotchShape, step: f64) -> Self {
        let frequency = shape.frequency.min(0.49 / step);
        let warped = libm::tan(PI * frequency * step);
        let pole = shape.bandwidth * warped;
        let zero = pole * (1.0 - shape.depth);
        let square = warped * warped;
        let scale = 1.0 / (1.0 + pole + square);
        let middle = 2.0 * (square - 1.0) * scale;
        Self {
            input: [
                (1.0 + zero + square) * scale,
                middle,
                (1.0 - zero + square) * scale,
            ],
            output: [middle, (1.0 - pole + square) * scale],
            state: [0.0; 2],
        }
    }

    /// The output for the next input (direct form II, transposed).
    pub fn next(&mut self, input: f64) -> f64 {
        let output = self.input[0] * input + self.state[0];
        self.state[0] = self.input[1] * input - self.output[0] * output + self.state[1];
        self.state[1] = self.input[2] * input - self.output[1] * output;
        output
    }

    /// Forgets what has been.
    pub fn reset(&mut self) {
        self.state = [0.0; 2];
    }
}

/// A share of the signal comes later, so that what vibrates with half a period of that delay is
/// excited twice, in opposite directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OvershootSuppression {
    /// What comes later, of 1.
    pub share: f64,
    /// By how much, s.
    pub delay: f64,
}

/// Samples of the longest delay.
const LONGEST: usize = 320;

/// The last samples of a signal.
#[derive(Clone, Debug)]
pub struct Delayed {
    samples: Vec<f64>,
    place: usize,
}

impl Default for Delayed {
    fn default() -> Self {
        Self {
            samples: vec![0.0; LONGEST],
            place: 0,
        }
    }
}

impl Delayed {
    /// Everything has always been `value`.
    pub fn reset(&mut self, value: f64) {
        self.samples.fill(value);
    }

    /// The signal with a share of it delayed, linear between samples `step` seconds apart. A delay
    /// beyond the longest one, 318 steps, is that one.
    pub fn next(&mut self, input: f64, shape: OvershootSuppression, step: f64) -> f64 {
        self.place = (self.place + 1) % LONGEST;
        self.samples[self.place] = input;
        let back = (shape.delay / step).min((LONGEST - 2) as f64);
        let whole = back as usize;
        let ago = |steps: usize| self.samples[(self.place + LONGEST - steps) % LONGEST];
        let part = back - whole as f64;
        let delayed = ago(whole) + (ago(whole + 1) - ago(whole)) * part;
        input + (delayed - input) * shape.share
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::TAU;

    const STEP: f64 = 62.5e-6;

    /// Amplitude of the output for a sine of 1.
    fn gain(notch: &mut Notch, frequency: f64) -> f64 {
        let (mut sine, mut cosine) = (0.0, 0.0);
        for k in 0..32_000 {
            let phase = TAU * frequency * f64::from(k) * STEP;
            let output = notch.next(libm::sin(phase));
            if k >= 16_000 {
                sine += output * libm::sin(phase);
                cosine += output * libm::cos(phase);
            }
        }
        libm::hypot(sine, cosine) / 8_000.0
    }

    #[test]
    fn a_notch_takes_its_depth_in_its_middle_and_nothing_far_from_it() {
        for (frequency, bandwidth, depth) in [(100.0, 0.5, 0.9), (430.0, 0.7, 0.6)] {
            let mut notch = Notch::new(
                NotchShape {
                    frequency,
                    bandwidth,
                    depth,
                },
                STEP,
            );
            assert!((gain(&mut notch, frequency) - (1.0 - depth)).abs() < 1e-3);
            assert!(gain(&mut notch, 0.05 * frequency) > 0.99);
            assert!(gain(&mut notch, 5.0 * frequency) > 0.98);
            // |H|² between both, at the edge of its band: (1 + (1 − depth)²) / 2.
            let root = libm::sqrt(1.0 + 0.25 * bandwidth * bandwidth);
            let edge = frequency * (root - 0.5 * bandwidth);
            let expected = libm::sqrt(0.5 * (1.0 + (1.0 - depth) * (1.0 - depth)));
            let found = gain(&mut notch, edge);
            assert!((found - expected).abs() < 0.01, "{found} {expected}");
        }
    }

    #[test]
    fn half_the_signal_half_a_period_later_leaves_nothing_of_that_frequency() {
        let mut delayed = Delayed::default();
        let shape = OvershootSuppression {
            share: 0.5,
            delay: 12.6e-3,
        };
        let step = 250e-6;
        let most = (0..2000).map(|k| {
            let phase = TAU * f64::from(k) * step / (2.0 * shape.delay);
            let output = delayed.next(libm::sin(phase), shape, step);
            if k < 400 { 0.0 } else { output.abs() }
        });
        assert!(most.fold(0.0, f64::max) < 1e-3);
        delayed.reset(3.0);
        assert_eq!(delayed.next(3.0, shape, step), 3.0);
    }
}
