//! Electronic Gear (lxm32m 1449-1481): the motor follows the pulse source.

use super::Mode;
use crate::twin::lxm32m::drive::Drive;
use crate::twin::lxm32m::motion::Motion;
use crate::twin::servo::cascade::POSITION_STEP;
use crate::twin::servo::ramp::Ramp;

/// 301Bh:12 `GEARreference` (lxm32m 1461).
const WITHOUT_COMPENSATION: i64 = 1;
const WITH_COMPENSATION: i64 = 2;
const VELOCITY: i64 = 3;

/// 3026h:5 `GEARdir_enabl`; anything else is both.
const ONLY_POSITIVE: i64 = 1;
const ONLY_NEGATIVE: i64 = 2;

/// What the gear is engaged with.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::twin::lxm32m) struct Gear {
    /// Pulses, and the reference's position that belongs to them.
    pulses: f64,
    position: f64,
    /// What the reference lags behind the pulses, increments.
    difference: f64,
}

impl Gear {
    pub(in crate::twin::lxm32m) fn difference(&self) -> f64 {
        self.difference
    }
}

impl Drive {
    /// 301Bh:12 was written.
    pub(super) fn set_gear(&mut self) {
        if !self.starts(Mode::ElectronicGear) {
            return;
        }
        match self.objects.get(self.rows.gear_reference) {
            WITHOUT_COMPENSATION => {
                self.engage();
                self.begin(Motion::Gear);
            }
            WITH_COMPENSATION | VELOCITY => self.begin(Motion::Gear),
            _ => self.stop(self.profile_deceleration()),
        }
    }

    fn engage(&mut self) {
        self.gear = Gear {
            pulses: self.pulses.position,
            position: self.ramp.position,
            difference: 0.0,
        };
    }

    /// The reference goes where the pulses say; what it lags behind it makes up for along the
    /// profile's ramps, no faster than 3026h:9 (0: as 607Fh says).
    pub(in crate::twin::lxm32m) fn follow_pulses(&mut self) {
        let ratio = self.gear_ratio();
        let mut velocity = self.pulses.frequency * ratio;
        // 3026h:5: pulses in the other direction are lost.
        let barred = match self.objects.get(self.rows.gear_direction) {
            ONLY_POSITIVE => velocity < 0.0,
            ONLY_NEGATIVE => velocity > 0.0,
            _ => false,
        };
        if barred {
            self.gear.pulses += self.pulses.frequency * POSITION_STEP;
            velocity = 0.0;
        }
        let most = match self.objects.get(self.rows.gear_velocity_limit) {
            0 => i64::MAX,
            limit => limit,
        };
        let limits = self.profile_limits(most);
        let velocity = velocity.clamp(-limits.velocity, limits.velocity);
        if self.objects.get(self.rows.gear_reference) == VELOCITY {
            self.ramp.towards_velocity(velocity, &limits, POSITION_STEP);
            self.engage();
            return;
        }
        let pulses = self.pulses.position - self.gear.pulses;
        let target = self.gear.position + pulses * ratio;
        // Seen from the target, which moves with the pulses, the lag goes to rest at 0.
        let mut lag = Ramp {
            position: self.ramp.position - (target - velocity * POSITION_STEP),
            velocity: self.ramp.velocity - velocity,
        };
        lag.towards_position(0.0, &limits, POSITION_STEP);
        self.ramp = Ramp {
            position: target + lag.position,
            velocity: velocity + lag.velocity,
        };
        self.gear.difference = -lag.position;
    }

    /// Motor increments per pulse: 3026h:4 over 3026h:3, or the second pair if 3026h:E picks it.
    fn gear_ratio(&self) -> f64 {
        let rows = &self.rows;
        let (numerator, denominator) = match self.objects.get(rows.gear_select) {
            1 => (rows.gear_numerator_2, rows.gear_denominator_2),
            _ => (rows.gear_numerator, rows.gear_denominator),
        };
        let numerator = self.objects.get(numerator);
        let numerator = if numerator == 0 { 1 } else { numerator };
        numerator as f64 / self.objects.get(denominator).max(1) as f64
    }
}
