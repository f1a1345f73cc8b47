//! What a simulated device's processor is: its number on the bus, how quick it is, and what is random about it.

use super::Delays;
use crate::twin::device::Config;
use crate::twin::random::Random;
use crate::twin::servo::clock::Clock;
use syncline_canopen::NodeId;
use syncline_canopen::time::Duration;

/// The streams of random numbers of a drive that pick its oscillator and make its encoder's errors.
const OSCILLATOR: u8 = 0;
const ENCODER: u8 = 1;

/// A device's processor.
#[derive(Clone, Debug)]
pub struct Processor {
    /// Node id.
    pub node: NodeId,
    /// Seed of what is random in the device: its delays, its oscillator, the errors of its encoder.
    pub seed: u64,
    /// The times that it takes.
    pub delays: Delays,
    /// Greatest error of the oscillator that paces control loops, parts per million; the seed picks one within.
    pub oscillator_ppm: f64,
    /// Time from a reset until the node is Pre-Operational.
    pub boot_time: Duration,
}

impl Processor {
    /// One with the oscillator of an ordinary crystal, which is an assumption as the times are.
    pub(in crate::twin) fn new(node: NodeId, delays: Delays, boot_time: Duration) -> Self {
        Self {
            node,
            seed: 0,
            delays,
            oscillator_ppm: 50.0,
            boot_time,
        }
    }

    /// One that boots and answers at once.
    #[must_use]
    pub fn prompt(node: NodeId) -> Self {
        Self::new(node, Delays::NONE, Duration::ZERO)
    }

    /// The same as far as nothing else was asked for.
    pub(in crate::twin) fn configured(self, config: &Config) -> Self {
        Self {
            seed: config.seed,
            delays: match config.prompt {
                true => Delays::NONE,
                false => self.delays,
            },
            boot_time: config.boot_time.unwrap_or(self.boot_time),
            ..self
        }
    }

    /// Random numbers for one purpose in the device.
    pub(in crate::twin) fn random(&self, purpose: u8) -> Random {
        Random::of_node(self.seed, self.node, purpose)
    }

    /// What paces the control loops.
    pub(in crate::twin) fn clock(&self) -> Clock {
        Clock::within(self.oscillator_ppm, self.random(OSCILLATOR))
    }

    /// What makes the errors of the encoder of a servo drive.
    pub(in crate::twin) fn encoder_noise(&self) -> Random {
        self.random(ENCODER)
    }
}
