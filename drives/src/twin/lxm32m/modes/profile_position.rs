//! Profile Position (lxm32m 1554-1594).

use crate::twin::lxm32m::drive::Drive;
use crate::twin::lxm32m::motion::Motion;
use crate::twin::servo::ramp::Limits;
use syncline_canopen::cia402::Controlword;

/// 60F2h as CiA 402 has it: what a relative target counts from. 0: the target before.
const FROM_REFERENCE: i64 = 1;
pub(super) const FROM_ACTUAL: i64 = 2;

/// A target with the values that were taken over with it (lxm32m 1576).
#[derive(Clone, Copy, Debug)]
struct Target {
    position: f64,
    limits: Limits,
}

/// The target under way, until the motor stands at it, and one more.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::twin::lxm32m) struct ProfilePosition {
    active: Option<Target>,
    next: Option<Target>,
    /// The first is passed on the way to the next (controlword bit 9).
    passes: bool,
}

impl ProfilePosition {
    pub(super) fn is_busy(&self) -> bool {
        self.next.is_some()
    }
}

impl Drive {
    /// Bits 4, 5, 6 and 9 (lxm32m 1568-1576).
    pub(super) fn command_position(&mut self, start: bool) {
        let word = self.servo.controlword;
        if !word.has(Controlword::MODE_4) && self.position.next.is_none() {
            self.bit_12 = false;
        }
        if !start || !self.may_move() {
            return;
        }
        let absolute = !word.has(Controlword::MODE_6);
        if absolute && !self.ref_ok && self.objects.get(self.rows.absolute_needs_reference) != 0 {
            // 3006h:16 (lxm32m 2255): not taken over.
            return;
        }
        let mut position = self.objects.get(self.rows.position_target);
        let base = match self.objects.get(self.rows.position_option) {
            _ if absolute => self.zero as f64,
            FROM_REFERENCE => self.ramp.position,
            FROM_ACTUAL => self.servo.loops.encoder as f64,
            _ => {
                let before = self.position.next.or(self.position.active);
                before.map_or(self.ramp.position, |target| target.position)
            }
        };
        position = position.clamp(i32::MIN.into(), i32::MAX.into());
        let target = Target {
            position: base + self.increments_of(position),
            limits: self.profile_limits(self.objects.get(self.rows.profile_velocity)),
        };
        let moving = self.position.active.is_some();
        if !moving || word.has(Controlword::MODE_5) {
            self.go(target);
        } else if self.position.next.is_none() {
            self.position.next = Some(target);
            self.position.passes = word.has(Controlword::MODE_9);
            if self.position.passes
                && let Motion::Position(position, limits) = self.motion
            {
                self.motion = Motion::Through(position, limits);
            }
        } else {
            return;
        }
        self.bit_12 = true;
    }

    fn go(&mut self, target: Target) {
        self.position = ProfilePosition {
            active: Some(target),
            next: None,
            passes: false,
        };
        self.begin(Motion::Position(target.position, target.limits));
    }

    /// The next target's turn comes where the first is passed, or where the motor is stopped at it: it stands within
    /// the window there (lxm32m 1569).
    pub(super) fn step_position(&mut self) {
        let ProfilePosition {
            active,
            next: Some(next),
            passes,
        } = self.position
        else {
            return;
        };
        let over = match passes {
            true => self.motion == Motion::Hold,
            false => active.is_none(),
        };
        if over {
            self.go(next);
            self.bit_12 = self.servo.controlword.has(Controlword::MODE_4);
        }
    }

    /// Bit 10: target position reached.
    pub(super) fn watch_position(&mut self) {
        let arrived = self.position.active.is_some() && self.is_at_rest() && self.is_in_window();
        if self.settled(arrived, self.rows.standstill_window_time) {
            self.position.active = None;
            self.target_reached = !self.position.is_busy();
        }
    }
}
