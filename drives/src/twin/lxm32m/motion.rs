//! What the drive's profile generator is asked for.

use crate::twin::servo::ramp::Limits;

/// What the profile generator does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Motion {
    /// The reference rests.
    Hold,
    /// It brakes with this deceleration, increments/s².
    Stop(f64),
    /// It runs from setpoint to setpoint, one a SYNC cycle.
    Interpolate,
    /// It approaches a velocity and keeps it.
    Velocity(f64, Limits),
    /// It goes to a position and rests there.
    Position(f64, Limits),
    /// It goes to a position and passes it with its velocity.
    Through(f64, Limits),
    /// It follows the pulse source.
    Gear,
    /// There is none: the motor delivers a torque, N·m.
    Torque(f64),
}
