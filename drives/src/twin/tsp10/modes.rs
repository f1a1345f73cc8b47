//! Profile position (721-772) and profile velocity (791-833).

use super::drive::Drive;
use super::homing::Homing;
use super::policy::{HaltedTarget, RelativeTo, SecondTarget};
use super::signals::{LOWER_LIMIT, STOP, UPPER_LIMIT};
use crate::twin::ErrorClass;
use crate::twin::node::Firmware;
use crate::twin::servo::ramp::Limits;
use syncline_canopen::cia402::{Controlword, State};
use syncline_canopen::emcy::register;

/// 6060h and 6061h (659-678).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i8)]
pub(super) enum Mode {
    ProfilePosition = 1,
    ProfileVelocity = 3,
    Homing = 6,
}

impl Mode {
    /// The mode with this number, if the device has it.
    pub(super) fn of(number: i64) -> Option<Self> {
        const ALL: [Mode; 3] = [Mode::ProfilePosition, Mode::ProfileVelocity, Mode::Homing];
        ALL.into_iter().find(|mode| *mode as i64 == number)
    }
}

/// What the demand does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Motion {
    /// It rests.
    Hold,
    /// It brakes with this deceleration, steps/s².
    Stop(f64),
    /// It approaches a velocity, steps/s, and keeps it.
    Velocity(f64, Limits),
    /// It goes to a position, steps, and rests there.
    Position(f64, Limits),
}

impl Drive {
    fn may_move(&self) -> bool {
        self.state == State::OperationEnabled
            && !self.controlword.has(Controlword::HALT)
            && !self.is_active(STOP)
    }

    /// The mode's own part of a controlword.
    pub(super) fn command_mode(&mut self, previous: Controlword) {
        let word = self.controlword;
        let rises = |bit| word.has(bit) && !previous.has(bit);
        let goes_on = previous.has(Controlword::HALT) && !word.has(Controlword::HALT);
        if !word.has(Controlword::MODE_4) {
            self.acknowledged = false;
        }
        if self.state != State::OperationEnabled {
            return;
        }
        if rises(Controlword::HALT) {
            self.halt();
        }
        match self.mode {
            Mode::ProfilePosition if rises(Controlword::MODE_4) => self.take_target(),
            Mode::ProfilePosition => {}
            Mode::ProfileVelocity => self.run(),
            Mode::Homing if rises(Controlword::MODE_4) => self.start_homing(),
            // Bit 4 = 0 stops it (905).
            Mode::Homing if !word.has(Controlword::MODE_4) && self.homing.is_active() => {
                self.abandon_homing();
                self.stop(self.value(0x609A, 0));
            }
            Mode::Homing => {}
        }
        if goes_on && let Some(motion) = self.halted.take() {
            self.motion = motion;
        }
    }

    /// Bit 8: it brakes with its ramp, and stands. What goes on when the bit falls: homing (907-908); a movement to a target by
    /// a policy, as the bit is named there and not explained (640); a velocity by itself (829-833).
    fn halt(&mut self) {
        let homes = self.homing.is_active();
        let goes_on = homes
            || self.policies.halted_target == HaltedTarget::Kept
                && matches!(self.motion, Motion::Position(..));
        let moves = !matches!(self.motion, Motion::Hold | Motion::Stop(_));
        self.halted = Some(self.motion).filter(|_| goes_on && moves);
        self.stop(self.value(if homes { 0x609A } else { 0x6084 }, 0));
    }

    /// It is over, and nothing of it goes on.
    pub(super) fn abandon_homing(&mut self) {
        self.homing = Homing::default();
        self.halted = None;
    }

    fn take_target(&mut self) {
        let is_busy = self.motion != Motion::Hold;
        let is_absolute = !self.controlword.has(Controlword::MODE_6);
        let lacks_reference =
            is_absolute && !self.is_referenced && !self.policies.absolute_without_reference;
        let is_ignored = is_busy && self.policies.second_target == SecondTarget::Ignored;
        if !self.may_move() || lacks_reference || is_ignored {
            return;
        }
        let base = match (is_absolute, self.policies.relative_to) {
            (true, _) => 0.0,
            (false, RelativeTo::Target) => self.target,
            (false, RelativeTo::Demand) => libm::round(self.ramp.position),
        };
        let range = f64::from(i32::MIN)..=f64::from(i32::MAX);
        let target = base + self.value(0x607A, 0);
        if !range.contains(&target) {
            return;
        }
        self.target = target;
        self.halted = None;
        let limits = self.limits(self.value(0x6081, 0), 0x6083, 0x6084);
        self.motion = Motion::Position(target, limits);
        self.target_reached = false;
        self.acknowledged = true;
    }

    /// 60FFh counts as it comes, while bit 8 is 0 (829-833).
    pub(super) fn run(&mut self) {
        if self.mode != Mode::ProfileVelocity || !self.may_move() {
            return;
        }
        let velocity = self.value(0x60FF, 0) * self.velocity_unit();
        if self.motion == Motion::Hold && velocity == 0.0 {
            return;
        }
        let limits = self.limits(velocity.abs(), 0x6083, 0x6084);
        self.motion = Motion::Velocity(velocity, limits);
    }

    /// The mode's part of a step of the profile.
    pub(super) fn step_mode(&mut self) {
        self.change_mode();
        if self.braking {
            return;
        }
        if self.homing.is_active() {
            self.step_homing();
        } else {
            self.target_reached = match (self.motion, self.mode) {
                (Motion::Velocity(velocity, _), _) => self.ramp.velocity == velocity,
                (Motion::Hold, Mode::ProfileVelocity) => self.value(0x60FF, 0) == 0.0,
                (motion, _) => {
                    motion == Motion::Hold && (self.target_reached || self.has_arrived())
                }
            };
        }
    }

    /// Whether the demand stands where the last target was (770).
    fn has_arrived(&self) -> bool {
        self.mode == Mode::ProfilePosition && self.ramp.position == self.target
    }

    /// 6060h takes over at standstill.
    pub(super) fn change_mode(&mut self) {
        let wanted = Mode::of(self.objects.value(0x6060, 0).unwrap_or(0)).unwrap_or(self.mode);
        if wanted != self.mode && (self.motion == Motion::Hold || !self.is_powered()) {
            self.end_movement();
            self.target_reached = false;
            self.mode = wanted;
        }
    }

    /// Quick stop, an error or another mode: whatever moved is over.
    pub(super) fn end_movement(&mut self) {
        self.homing = self.homing.ended();
        self.halted = None;
        self.acknowledged = false;
    }

    /// A limit switch stops a movement towards it, the stop switch every one.
    pub(super) fn watch_switches(&mut self) {
        let direction = self.ramp.velocity;
        let is_limit = direction < 0.0 && self.is_active(LOWER_LIMIT)
            || direction > 0.0 && self.is_active(UPPER_LIMIT);
        if self.is_active(STOP) {
            // No alarm, not even in homing (912).
            self.abandon_homing();
            self.stop(self.value(0x6084, 0));
        } else if is_limit && !self.homing.is_active() && !matches!(self.motion, Motion::Stop(_)) {
            self.halted = None;
            self.stop(self.value(0x6084, 0));
            if self.policies.limit_is_fault {
                self.raise(ErrorClass::StopAndSwitchOff, register::PROFILE);
            }
        }
    }

    /// Statusword bits 12 and 13: named for profile position (645-657), in homing by CiA 402.
    pub(super) fn mode_bits(&self) -> (bool, bool) {
        match self.mode {
            Mode::ProfilePosition => (self.acknowledged, false),
            Mode::Homing if self.policies.homing_bits => {
                (self.homing.is_attained(), self.homing.has_failed())
            }
            Mode::ProfileVelocity | Mode::Homing => (false, false),
        }
    }
}
