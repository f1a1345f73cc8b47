//! Profile Torque (lxm32m 1483-1515).

use super::Mode;
use crate::twin::lxm32m::drive::Drive;
use crate::twin::lxm32m::motion::Motion;
use crate::twin::lxm32m::units::INCREMENTS_PER_REVOLUTION;
use crate::twin::servo::cascade::POSITION_STEP;

impl Drive {
    /// 6071h was written, in 0.1 % of the continuous stall torque.
    pub(super) fn set_torque(&mut self) {
        let moving = matches!(self.motion, Motion::Torque(_));
        if !self.starts(Mode::ProfileTorque) {
            return;
        }
        if !moving && self.torque_target() != 0.0 {
            self.begin(Motion::Torque(0.0));
        }
    }

    /// Brings the torque to its target: at once, or along the slope of 6087h if 3006h:2C is set.
    /// At the velocity limit nothing drives further.
    pub(super) fn step_torque(&mut self) {
        let Motion::Torque(torque) = self.motion else {
            return;
        };
        let target = self.torque_target();
        let mut next = target;
        if self.objects.get(self.rows.torque_ramp_enabled) != 0 {
            let slope = self.torque_of(self.objects.get(self.rows.torque_slope));
            let change = slope * POSITION_STEP;
            next = torque + (target - torque).clamp(-change, change);
        }
        let velocity = self.actual_velocity() / INCREMENTS_PER_REVOLUTION;
        let limit = self.servo.loops.cascade.gains().speed_limit;
        if velocity.abs() > limit && velocity * next > 0.0 {
            next = 0.0;
        }
        self.motion = Motion::Torque(next);
    }

    /// Bit 10: target torque reached within the window of 3006h:2D.
    pub(super) fn watch_torque(&mut self) {
        if let Motion::Torque(torque) = self.motion {
            let window = self.torque_of(self.objects.get(self.rows.torque_window));
            let reached = (torque - self.torque_target()).abs() <= window;
            self.target_reached = self.settled(reached, self.rows.torque_window_time);
        }
    }

    fn torque_target(&self) -> f64 {
        let rows = &self.rows;
        self.torque_of(self.target_by(rows.torque_source, rows.torque_target))
    }

    /// 0.1 % of the continuous stall torque as N·m.
    fn torque_of(&self, tenths: i64) -> f64 {
        tenths as f64 * 1e-3 * self.servo.loops.cascade.gains().continuous_torque
    }
}
