//! User units: usr_p, usr_v, usr_a are fractions of a revolution, of an rpm, of an rpm/s, as the
//! scaling objects say (lxm32m 1602, 2244, 2263, 2274; the meaning of the last two assumed).

use super::drive::Drive;
use crate::twin::rounding::nearest;
use crate::twin::servo::ramp::Limits;
use syncline_canopen::dictionary::Row;

/// Encoder increments per motor revolution, the drive's internal resolution (lxm32m 1602).
pub(super) const INCREMENTS_PER_REVOLUTION: f64 = 131_072.0;

/// Increments/s in an rpm.
const RPM: f64 = INCREMENTS_PER_REVOLUTION / 60.0;

impl Drive {
    fn scale(&self, numerator: Row, denominator: Row) -> f64 {
        let numerator = self.objects.get(numerator).max(1) as f64;
        numerator / self.objects.get(denominator).max(1) as f64
    }

    /// A distance in usr_p as increments.
    pub(super) fn increments_of(&self, position: i64) -> f64 {
        let rows = &self.rows;
        let scale = self.scale(rows.position_numerator, rows.position_denominator);
        position as f64 * (scale * INCREMENTS_PER_REVOLUTION)
    }

    /// A position in usr_p as increments from the encoder's zero.
    pub(super) fn target_of(&self, position: i64) -> f64 {
        self.increments_of(position) + self.zero as f64
    }

    /// Increments as usr_p, to the nearest.
    pub(super) fn user_position(&self, increments: i64) -> i64 {
        let numerator = self.objects.get(self.rows.position_numerator).max(1);
        let denominator = self.objects.get(self.rows.position_denominator).max(1);
        // Both are 32 bits wide; the product may not be within 64.
        let unit = numerator * INCREMENTS_PER_REVOLUTION as i64;
        match increments.checked_mul(denominator) {
            // Most units are a power of two: the same without a division.
            Some(product) if product < i64::MAX / 2 && unit.count_ones() == 1 => {
                (product + unit / 2) >> unit.trailing_zeros()
            }
            Some(product) if product < i64::MAX / 2 => (product + unit / 2).div_euclid(unit),
            _ => {
                let product = i128::from(increments) * i128::from(denominator);
                (product + i128::from(unit / 2)).div_euclid(unit.into()) as i64
            }
        }
    }

    /// A velocity in usr_v as increments/s.
    pub(super) fn velocity_of(&self, velocity: i64) -> f64 {
        let rows = &self.rows;
        velocity as f64 * (self.scale(rows.velocity_numerator, rows.velocity_denominator) * RPM)
    }

    /// Increments/s as usr_v, to the nearest.
    pub(super) fn user_velocity(&self, velocity: f64) -> i64 {
        let rows = &self.rows;
        let unit = self.scale(rows.velocity_numerator, rows.velocity_denominator) * RPM;
        nearest(velocity / unit)
    }

    /// An acceleration in usr_a as increments/s².
    pub(super) fn acceleration_of(&self, acceleration: i64) -> f64 {
        let rows = &self.rows;
        let scale = self.scale(rows.ramp_numerator, rows.ramp_denominator);
        acceleration.max(1) as f64 * (scale * RPM)
    }

    /// The greatest position, velocity and ramp in user units: those whose increments, increments/s and increments/s²
    /// are within 32 bits (assumed), as those of 6063h are, if the objects can tell them.
    pub(super) fn scale_most(&self) -> [i64; 3] {
        let most = f64::from(i32::MAX);
        let units = [
            self.increments_of(1),
            self.velocity_of(1),
            self.acceleration_of(1),
        ];
        units.map(|unit| (most / unit).min(most) as i64)
    }

    /// A profile's limits at a velocity in usr_v: capped by 607Fh and 3011h:10 (lxm32m 1529),
    /// with the ramps of 6083h and 6084h.
    pub(super) fn profile_limits(&self, velocity: i64) -> Limits {
        let rows = &self.rows;
        let most = self
            .objects
            .get(rows.profile_velocity_limit)
            .min(self.objects.get(rows.velocity_limit));
        Limits {
            velocity: self.velocity_of(velocity.clamp(0, most)),
            acceleration: self.acceleration_of(self.objects.get(rows.profile_acceleration)),
            deceleration: self.profile_deceleration(),
        }
    }

    /// 6084h in increments/s².
    pub(super) fn profile_deceleration(&self) -> f64 {
        self.acceleration_of(self.objects.get(self.rows.profile_deceleration))
    }
}
