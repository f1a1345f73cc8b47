//! How the torque of a drive is limited, for a search that presses against a hard stop.
//!
//! Drives limit a current or a torque, and count it in units of their own. Both objects here count alike, so that a share
//! of the motor's continuous torque needs no unit. They are read and written by SDO, while the axes rest.

use super::Address;

/// The objects that limit a drive's torque, 16 bits each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TorqueLimit {
    /// The most that it takes; 0 leaves the drive's own.
    pub limit: Address,
    /// What that is for the continuous stall torque of its motor.
    pub continuous: Address,
}
