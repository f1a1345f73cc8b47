//! Ends of the range of movement: limit switches and positions (lxm32m 375-388, 1563, 1634, 2242,
//! 2243, 2253, 2287, 2919). What the manual prints of them are names: values are assumptions.

use super::drive::Drive;
use super::fault::DriveError;
use super::motion::Motion;
use crate::twin::servo::cascade::POSITION_STEP;

/// 3006h:47 `MON_SWLimMode`: to rest at the limit; anything else, from the limit on.
const STANDSTILL_AT_LIMIT: i64 = 1;

/// The positive end in 3006h:3 `MON_SW_Limits` and 3006h:11 `MON_HW_Limits`.
const POSITIVE: i64 = 1;
/// The negative end.
const NEGATIVE: i64 = 2;

impl Drive {
    /// An end of the range in the direction of movement. Homing may run onto the switches.
    pub(super) fn limit_hit(&self) -> Option<DriveError> {
        if self.homing.is_active() || self.servo.braking {
            return None;
        }
        let velocity = self.direction();
        let (negative, positive) = self.limit_switches();
        if velocity < 0.0 && negative || velocity > 0.0 && positive {
            return Some(DriveError::LIMIT_SWITCH);
        }
        let valid = self.ref_ok || !self.policies.software_limits_need_reference;
        (valid && self.is_beyond_software_limit()).then_some(DriveError::SOFTWARE_LIMIT)
    }

    /// Velocity of the reference; a measured one, as in Profile Torque, is never quite 0.
    fn direction(&self) -> f64 {
        let velocity = self.ramp.velocity;
        match self.motion {
            Motion::Torque(_) if self.servo.stands() => 0.0,
            _ => velocity,
        }
    }

    /// A limit switch is active when the power stage goes on, unless 3006h:6 suppresses that
    /// (lxm32m 1634).
    pub(super) fn limit_at_enabling(&self) -> Option<DriveError> {
        let (negative, positive) = self.limit_switches();
        let suppressed = self.objects.get(self.rows.limit_at_enabling) != 0;
        ((negative || positive) && !suppressed).then_some(DriveError::LIMIT_SWITCH)
    }

    /// The negative and the positive switch, as far as 3006h:11 leaves them on.
    pub(super) fn limit_switches(&self) -> (bool, bool) {
        let off = self.objects.get(self.rows.hardware_limits_off);
        let position = self.carriage();
        (
            off & NEGATIVE == 0 && self.switches.negative_limit_active(position),
            off & POSITIVE == 0 && self.switches.positive_limit_active(position),
        )
    }

    /// 607Dh in usr_p, as far as 3006h:3 has it watched: the least and the greatest position.
    pub(super) fn software_limits(&self) -> (Option<i64>, Option<i64>) {
        let rows = &self.rows;
        let watched = self.objects.get(rows.software_limits);
        let limit = |end, row| (watched & end != 0).then(|| self.objects.get(row));
        (
            limit(NEGATIVE, rows.software_limit_negative),
            limit(POSITIVE, rows.software_limit_positive),
        )
    }

    /// Whether the reference is beyond, or has to brake now not to get there.
    fn is_beyond_software_limit(&self) -> bool {
        let (least, most) = self.software_limits();
        let velocity = self.direction();
        let stop = match self.objects.get(self.rows.software_limit_mode) {
            STANDSTILL_AT_LIMIT => {
                let brake = 0.5 * velocity * velocity / self.quick_stop_deceleration();
                // A profile that comes to rest at the limit is none of its business.
                brake - velocity.abs() * POSITION_STEP
            }
            _ => 0.0,
        };
        let position = self.ramp.position;
        velocity < 0.0 && least.is_some_and(|least| position - stop < self.target_of(least))
            || velocity > 0.0 && most.is_some_and(|most| position + stop > self.target_of(most))
    }
}
