//! Profile position (3151-3273) and profile velocity (3545-3614), and the manufacturer's movements
//! that are like them.

use super::{Mode, Movement};
use crate::twin::servo::firmware::ServoFirmware;
use crate::twin::servo::ramp::Limits;
use crate::twin::tlc5xx::drive::Drive;
use crate::twin::tlc5xx::fault::DriveError;
use crate::twin::tlc5xx::motion::Motion;
use crate::twin::tlc5xx::policy::Bit6;
use crate::twin::tlc5xx::settings::{RPM, Settings};
use syncline_canopen::cia402::Controlword;

/// A target with the values that were taken over with it (3391-3394), in increments from the
/// encoder's zero.
#[derive(Clone, Copy, Debug)]
pub(in crate::twin::tlc5xx) struct Target {
    position: f64,
    limits: Limits,
}

impl Drive {
    /// Controlword bit 4 rose in mode 1.
    pub(super) fn take_target(&mut self) {
        let word = self.servo.controlword;
        let absolute = match self.policies.absolute {
            Bit6::SetIsAbsolute => word.has(Controlword::MODE_6),
            Bit6::ClearIsAbsolute => !word.has(Controlword::MODE_6),
        };
        let limits = Settings::at_most(self.settings.profile, self.settings.profile_velocity);
        let target = self.objects.value(0x607A, 0).unwrap_or(0);
        let taken = self.position_to(target, absolute, limits, word.has(Controlword::MODE_5));
        self.setpoint_acknowledged |= taken;
    }

    /// Goes to a position or by a distance in user units, at once or after the target that is under
    /// way. Whether it is taken: beyond the limits it is not, and EMCY FF22h says so (15485-15488).
    pub(super) fn position_to(
        &mut self,
        target: i64,
        absolute: bool,
        limits: Limits,
        at_once: bool,
    ) -> bool {
        // A relative target adds to the one before (3256-3259).
        let before = self.next_target.or(self.target);
        let base = match (absolute, before) {
            (true, _) => self.zero as f64,
            (false, Some(before)) => before.position,
            (false, None) => self.ramp.position,
        };
        let position = libm::round(base + target as f64 * self.settings.position);
        let lacks_reference =
            absolute && !self.is_referenced && !self.policies.absolute_without_reference;
        if lacks_reference || !self.is_permitted(position) {
            self.raise(DriveError::INVALID_POSITION);
            return false;
        }
        let target = Target { position, limits };
        let is_under_way = self.movement == Movement::Position && self.target.is_some();
        if !is_under_way || at_once {
            self.next_target = None;
            self.go(target);
            true
        } else if self.next_target.is_none() {
            self.next_target = Some(target);
            true
        } else {
            false
        }
    }

    /// Whether a position is within the travel range and the software limits (5215-5264).
    fn is_permitted(&self, position: f64) -> bool {
        let from_zero = position - self.zero as f64;
        let (user, _) = self.settings.user(from_zero);
        let range = f64::from(i32::MIN)..=f64::from(i32::MAX);
        range.contains(&from_zero)
            && self
                .settings
                .positive_limit
                .is_none_or(|limit| user <= limit)
            && self
                .settings
                .negative_limit
                .is_none_or(|limit| user >= limit)
    }

    fn go(&mut self, target: Target) {
        self.movement = Movement::Position;
        self.target = Some(target);
        self.begin(Motion::Position(target.position, target.limits));
    }

    pub(super) fn step_position(&mut self) {
        if self.motion == Motion::Hold
            && let Some(next) = self.next_target.take()
        {
            self.go(next);
        }
    }

    /// Bit 10: within the window of 2011h for its time (15363-15390).
    pub(super) fn watch_position(&mut self) {
        if self.target.is_some() && self.next_target.is_none() && self.has_settled() {
            self.target = None;
            self.target_reached = true;
        }
    }

    // ---- velocity ----

    /// 60FFh was written: it starts or changes the movement (3545-3547).
    pub(super) fn set_profile_velocity(&mut self) {
        if self.mode == Mode::ProfileVelocity && self.may_move() {
            let target = self.objects.value(0x60FF, 0).unwrap_or(0);
            self.turn_at(target, self.settings.profile);
        }
    }

    /// Turns with a velocity in user units, and with these ramps.
    pub(super) fn turn_at(&mut self, velocity: i64, limits: Limits) {
        let wanted = velocity as f64 * self.settings.velocity;
        let velocity = wanted.clamp(-limits.velocity, limits.velocity);
        if self.movement == Movement::None && velocity == 0.0 {
            return;
        }
        self.movement = Movement::Velocity;
        self.begin(Motion::Velocity(velocity, limits));
    }

    /// Bit 10: the ramp is over and the motor turns so within a hundredth and a revolution a minute,
    /// an assumption.
    pub(super) fn watch_velocity(&mut self) {
        let target = match self.motion {
            Motion::Velocity(target, _) => target,
            _ => 0.0,
        };
        let tolerance = 0.01 * target.abs() + RPM;
        let deviation = (self.actual_velocity() - target).abs();
        self.target_reached = self.ramp.velocity == target && deviation <= tolerance;
        if self.target_reached && self.motion == Motion::Hold {
            self.movement = Movement::None;
        }
    }
}
