//! Jog (lxm32m 1415-1447).

use super::Mode;
use crate::twin::lxm32m::drive::Drive;
use crate::twin::lxm32m::motion::Motion;
use syncline_canopen::Instant;
use syncline_canopen::time::Duration;

/// 3029h:3 `JOGmethod` for a step, a pause, then continuous movement; anything else is continuous
/// from the start (assumption).
const STEP_MOVEMENT: i64 = 1;

/// What a step movement does after the present motion.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::twin::lxm32m) enum Jog {
    /// Nothing.
    #[default]
    Idle,
    /// The step is under way.
    Step,
    /// It pauses until then.
    Pause(Instant),
}

impl Jog {
    pub(super) fn is_busy(self) -> bool {
        self != Self::Idle
    }
}

impl Drive {
    /// 301Bh:9 was written: bits 0, 1 direction, bit 2 fast. Both directions at once stop (D-51).
    pub(super) fn set_jog(&mut self) {
        if !self.starts(Mode::Jog) {
            return;
        }
        let (direction, limits) = self.jog_command();
        let moving = self.motion != Motion::Hold;
        if direction == 0.0 {
            self.jog = Jog::Idle;
            self.stop(limits.deceleration);
        } else if self.objects.get(self.rows.jog_method) == STEP_MOVEMENT && !moving {
            let step = self.increments_of(self.objects.get(self.rows.jog_step));
            self.jog = Jog::Step;
            self.begin(Motion::Position(
                self.ramp.position + direction * step,
                limits,
            ));
        } else {
            self.begin(Motion::Velocity(direction * limits.velocity, limits));
        }
    }

    fn jog_command(&self) -> (f64, crate::twin::servo::ramp::Limits) {
        let command = self.objects.get(self.rows.jog_activate);
        let fast = command & 0b100 != 0;
        let velocity = if fast {
            self.rows.jog_fast
        } else {
            self.rows.jog_slow
        };
        let direction = match command & 0b11 {
            0b01 => 1.0,
            0b10 => -1.0,
            _ => 0.0,
        };
        (direction, self.profile_limits(self.objects.get(velocity)))
    }

    pub(super) fn step_jog(&mut self) {
        match self.jog {
            Jog::Step if self.motion == Motion::Hold => {
                let pause = self.objects.get(self.rows.jog_time) as u64;
                self.jog = Jog::Pause(self.servo.now + Duration::from_millis(pause));
            }
            Jog::Pause(until) if self.servo.now >= until => {
                self.jog = Jog::Idle;
                let (direction, limits) = self.jog_command();
                self.motion = Motion::Velocity(direction * limits.velocity, limits);
            }
            _ => {}
        }
    }
}
