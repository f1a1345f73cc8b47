//! What the profile generator is asked for.

use crate::twin::servo::ramp::Limits;

/// What the position reference does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Motion {
    /// It rests.
    Hold,
    /// It brakes with this deceleration, increments/s².
    Stop(f64),
    /// It approaches a velocity, increments/s, and keeps it.
    Velocity(f64, Limits),
    /// It goes to a position, increments, and rests there.
    Position(f64, Limits),
    /// It follows the pulse source.
    Gear,
}

impl Motion {
    /// The deceleration of the running command (5342), if it has one.
    pub(super) fn deceleration(self) -> Option<f64> {
        match self {
            Self::Hold | Self::Gear => None,
            Self::Stop(deceleration) => Some(deceleration),
            Self::Velocity(_, limits) | Self::Position(_, limits) => Some(limits.deceleration),
        }
    }
}
