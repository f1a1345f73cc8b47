//! Profile Velocity (lxm32m 1517-1552).

use super::Mode;
use crate::twin::lxm32m::drive::Drive;
use crate::twin::lxm32m::motion::Motion;

/// 3006h:D counts in ms (assumed).
const JERK_TIME: f64 = 1e-3;

impl Drive {
    /// How long the acceleration of Profile Velocity takes to come to 6083h or 6084h, s: 3006h:D, which the manual
    /// names the jerk limit of the velocity profile (lxm32m 2249). 0 where it is off.
    pub(in crate::twin::lxm32m) fn ramp_jerk_time(&self) -> f64 {
        match self.mode {
            Mode::ProfileVelocity => self.objects.get(self.rows.ramp_jerk_time) as f64 * JERK_TIME,
            _ => 0.0,
        }
    }

    /// 60FFh was written. A target of 0 ends a movement and starts none (lxm32m 1795).
    pub(super) fn set_velocity(&mut self) {
        if !self.starts(Mode::ProfileVelocity) {
            return;
        }
        let rows = &self.rows;
        let target = self.target_by(rows.velocity_source, rows.velocity_target);
        let mut limits = self.profile_limits(target.saturating_abs());
        if self.objects.get(rows.velocity_ramp_enabled) == 0 {
            limits.acceleration = f64::INFINITY;
            limits.deceleration = f64::INFINITY;
        }
        let velocity = limits.velocity.copysign(target as f64);
        match self.motion {
            Motion::Velocity(same, _) if same == velocity => {}
            Motion::Hold if target == 0 => {}
            Motion::Velocity(..) => {
                self.motion = Motion::Velocity(velocity, limits);
                self.note_status();
            }
            _ => self.begin(Motion::Velocity(velocity, limits)),
        }
    }

    /// Bit 10: target velocity reached, within the window of 606Dh. Bit 12, velocity 0, stays 0
    /// as in the examples (D-31).
    pub(super) fn watch_velocity(&mut self) {
        if let Motion::Velocity(target, _) = self.motion {
            let window = self.velocity_of(self.objects.get(self.rows.velocity_window));
            let reached = (self.actual_velocity() - target).abs() <= window;
            let reached = reached && self.ramp.velocity == target;
            self.target_reached = self.settled(reached, self.rows.velocity_window_time);
        }
    }
}
