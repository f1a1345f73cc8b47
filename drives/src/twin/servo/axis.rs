//! What stands behind a servo drive's bus interface, as it is put together and commissioned.

use super::cascade::Gains;
use super::encoder::{EncoderErrors, Scale};
use super::power_stage::{CURRENT_BANDWIDTH, DcBus, PowerStage, TorqueSource};
use super::shaft::Plant;
use super::stability::{Distance, Tuning};
use crate::twin::device::{Config, DrivenAxis};

/// How far from swinging a position loop by a scale at the load is left, as an engineer leaves it: an assumption.
const BY_SCALE: Distance = Distance {
    phase: 45.0,
    gain: 8.0,
    peak: 1.25,
};

/// A servo drive's motor and axis, its encoder and the gains of its loops.
#[derive(Clone, Debug)]
pub struct ServoAxis {
    /// The axis behind the motor.
    pub mechanics: Plant,
    /// What turns it.
    pub torque_source: TorqueSource,
    /// What makes the encoder's reading wrong.
    pub encoder: EncoderErrors,
    /// What sees the load, and closes the position loop.
    pub scale: Option<Scale>,
    /// Gains of the control loops.
    pub gains: Gains,
}

/// A rigid one with an ideal motor, whose encoder reads without noise.
impl Default for ServoAxis {
    fn default() -> Self {
        Self {
            mechanics: Plant::default(),
            torque_source: TorqueSource::Ideal,
            encoder: EncoderErrors::default(),
            scale: None,
            gains: Gains::default(),
        }
    }
}

impl ServoAxis {
    /// The axis and the encoder that were asked for, with gains as the drive is commissioned on it; the same as far as
    /// nothing was. How much of the velocity is fed forward is the model's affair.
    pub(in crate::twin) fn configured(self, config: &Config) -> Self {
        let encoder = config.encoder.unwrap_or(self.encoder);
        let Some(DrivenAxis { motor, train }) = &config.axis else {
            return Self {
                encoder,
                scale: config.scale,
                ..self
            };
        };
        let gains = Gains::commissioned(motor, train);
        let gains = match config.scale {
            Some(_) => Tuning::new(train.clone(), CURRENT_BANDWIDTH)
                .by_scale()
                .calmed(&gains, &BY_SCALE),
            None => gains,
        };
        Self {
            mechanics: train.clone().into(),
            torque_source: PowerStage::new(*motor, DcBus::default()).into(),
            encoder,
            scale: config.scale,
            gains: Gains {
                velocity_feed_forward: self.gains.velocity_feed_forward,
                ..gains
            },
        }
    }
}
