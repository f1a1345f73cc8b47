//! Parameters as the loops want them: increments, increments/s, increments/s².

use super::policy::{Policies, PositionFactor};
use crate::twin::rounding::nearest;
use crate::twin::servo::ramp::Limits;
use syncline_canopen::dictionary::Dictionary;

/// Increments of a motor with a Sincoder (4982).
pub(super) const INCREMENTS_PER_REVOLUTION: f64 = 16_384.0;

/// Increments/s of one r/min.
pub(super) const RPM: f64 = INCREMENTS_PER_REVOLUTION / 60.0;

/// What is derived from objects whenever one is written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Settings {
    /// Increments of a user unit (6093h).
    pub(super) position: f64,
    /// Increments/s of a user unit: r/min times 6094h, or a part of that (D-53).
    pub(super) velocity: f64,
    /// Increments/s² of a user unit: r/(min·s) times 6097h (D-53).
    pub(super) acceleration: f64,
    /// 6083h, 6084h with the least of 607Fh, 205Ah and 60FBh:3.
    pub(super) profile: Limits,
    /// 205Eh, 205Fh with the same velocity (5043).
    pub(super) manufacturer: Limits,
    /// 6081h as the profile's velocity.
    pub(super) profile_velocity: f64,
    /// 6085h.
    pub(super) quick_stop: f64,
    /// 2010h.
    pub(super) following_error: f64,
    /// 2011h and the longer of 2012h and 6068h.
    pub(super) window: f64,
    pub(super) window_ms: u64,
    /// 2052h and 2053h as far as 2054h enables them, user units.
    pub(super) positive_limit: Option<i64>,
    pub(super) negative_limit: Option<i64>,
    /// 2045h: 1, or -1 where the direction of rotation is reversed.
    pub(super) direction: f64,
}

impl Settings {
    pub(super) fn of(objects: &Dictionary, policies: &Policies) -> Self {
        let value = |index| objects.value(index, 0).unwrap_or(0) as f64;
        let whole = |index| objects.value(index, 0).unwrap_or(0);
        let factor = |index| {
            let part = |sub| objects.value(index, sub).unwrap_or(1) as f64;
            let (numerator, denominator) = (part(1), part(2));
            // A zero can only come where the manual prints no range: as good as no factor.
            match numerator != 0.0 && denominator != 0.0 {
                true => numerator / denominator,
                false => 1.0,
            }
        };
        let velocity = RPM * factor(0x6094) / f64::from(policies.units_per_rpm);
        let acceleration = RPM * factor(0x6097);
        let most_rpm = value(0x205A).min(objects.value(0x60FB, 3).unwrap_or(0) as f64);
        let limits = |up, down| Limits {
            velocity: (value(0x607F) * velocity).min(most_rpm * RPM),
            acceleration: value(up) * acceleration,
            deceleration: value(down) * acceleration,
        };
        let profile = limits(0x6083, 0x6084);
        let limit = |index, bit: i64| (whole(0x2054) & bit != 0).then(|| whole(index));
        Self {
            position: match policies.position_factor {
                PositionFactor::RevolutionsPerUnit => INCREMENTS_PER_REVOLUTION * factor(0x6093),
                PositionFactor::UnitsPerIncrement => 1.0 / factor(0x6093),
            },
            velocity,
            acceleration,
            profile,
            manufacturer: limits(0x205E, 0x205F),
            // Without one the manufacturer's default (205Ch): the manual prints none.
            profile_velocity: match value(0x6081) {
                0.0 => value(0x205C),
                set => set,
            } * velocity,
            // In rev/(min·s), not in user units.
            quick_stop: value(0x6085) * RPM,
            following_error: value(0x2010),
            window: value(0x2011),
            window_ms: whole(0x2012).max(whole(0x6068)) as u64,
            positive_limit: limit(0x2052, 1 << 5),
            negative_limit: limit(0x2053, 1 << 6),
            direction: if whole(0x2045) == 1 { -1.0 } else { 1.0 },
        }
    }

    /// A profile that is no faster than `velocity` increments/s.
    pub(super) fn at_most(limits: Limits, velocity: f64) -> Limits {
        Limits {
            velocity: velocity.abs().min(limits.velocity),
            ..limits
        }
    }

    /// Whole user units of a position in increments, and the increments left over (208Ch).
    pub(super) fn user(&self, increments: f64) -> (i64, i64) {
        let units = (increments / self.position).floor();
        (units as i64, nearest(increments - units * self.position))
    }
}
