//! What stands behind a servo drive's bus interface, as it is put together and commissioned.

use super::cascade::Gains;
use super::encoder::EncoderErrors;
use super::power_stage::{DcBus, PowerStage, TorqueSource};
use super::shaft::Plant;
use crate::twin::device::{Config, DrivenAxis};

/// A servo drive's motor and axis, its encoder and the gains of its loops.
#[derive(Clone, Debug)]
pub struct ServoAxis {
    /// The axis behind the motor.
    pub mechanics: Plant,
    /// What turns it.
    pub torque_source: TorqueSource,
    /// What makes the encoder's reading wrong.
    pub encoder: EncoderErrors,
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
            return Self { encoder, ..self };
        };
        Self {
            mechanics: train.clone().into(),
            torque_source: PowerStage::new(*motor, DcBus::default()).into(),
            encoder,
            gains: Gains {
                velocity_feed_forward: self.gains.velocity_feed_forward,
                ..Gains::commissioned(motor, train)
            },
        }
    }
}
