//! The electronic gear (4411-4498, 12326-12440): the reference follows pulses.

use super::Movement;
use crate::twin::servo::cascade::POSITION_STEP;
use crate::twin::servo::ramp::{Limits, Ramp};
use crate::twin::tlc5xx::drive::Drive;
use crate::twin::tlc5xx::motion::Motion;
use crate::twin::tlc5xx::settings::RPM;

/// What the gear has missed, and how it makes up for it.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::twin::tlc5xx) struct CatchUp {
    /// Pulses since it was switched off; none before it was on for the first time.
    missed: Option<f64>,
    /// What is left of it, down to 0, increments.
    ramp: Ramp,
}

impl Drive {
    /// 209Dh: 0 off, 1 from here on, 2 with what was missed since (12384-12392).
    pub(super) fn start_gear(&mut self, value: i64) {
        match value {
            1 | 2 => {
                self.movement = Movement::Gear;
                self.begin(Motion::Gear);
                let missed = self.catch_up.missed.replace(0.0);
                let behind = missed.filter(|_| value == 2).unwrap_or(0.0) * self.gear_ratio();
                self.catch_up.ramp = Ramp::at(-behind);
            }
            _ if self.movement == Movement::Gear => {
                self.movement = Movement::None;
                self.offset.interrupt();
                self.motion = Motion::Stop(self.settings.manufacturer.deceleration);
            }
            _ => {}
        }
    }

    /// Position steps of a gear that was on once and is off: its pulses are missed. What it had not caught up with yet
    /// is missed as well. That both count from when it was switched off last is an assumption.
    pub(in crate::twin::tlc5xx) fn miss_pulses(&mut self) {
        let left = core::mem::replace(&mut self.catch_up.ramp, Ramp::at(0.0)).position;
        let ratio = self.gear_ratio();
        let pulses = self.pulse_frequency * POSITION_STEP;
        if let Some(missed) = &mut self.catch_up.missed {
            *missed += pulses;
            if ratio != 0.0 {
                *missed -= left / ratio;
            }
        }
    }

    fn gear_ratio(&self) -> f64 {
        let value = |index| self.objects.value(index, 0).unwrap_or(0);
        value(0x20A1) as f64 / value(0x20A2).max(1) as f64
    }

    /// How far, in increments, and how fast the gear goes in a step to catch up, beside pulses that take it along with
    /// `velocity`: with the manufacturer's ramps, and no faster with both than `most`.
    fn step_catch_up(&mut self, velocity: f64, most: f64) -> (f64, f64) {
        let limits = Limits {
            velocity: most - velocity.abs(),
            ..self.settings.manufacturer
        };
        let ramp = &mut self.catch_up.ramp;
        if ramp.position == 0.0 || limits.velocity <= 0.0 {
            ramp.velocity = 0.0;
            return (0.0, 0.0);
        }
        let before = ramp.position;
        ramp.towards_position(0.0, &limits, POSITION_STEP);
        (ramp.position - before, ramp.velocity)
    }

    /// The reference follows the pulses by 20A1h / 20A2h, no faster than 209Fh, in the directions of
    /// 209Ch, which 2045h swaps (12326-12336), and what moves beside them.
    pub(in crate::twin::tlc5xx) fn follow_pulses(&mut self) {
        let value = |index| self.objects.value(index, 0).unwrap_or(0);
        let most = value(0x209F) as f64 * RPM;
        let velocity = (self.pulse_frequency * self.gear_ratio()).clamp(-most, most);
        let directions = (value(0x209C), self.settings.direction < 0.0);
        let released = |travel: f64| match directions {
            (1, false) | (2, true) => travel.max(0.0),
            (2, false) | (1, true) => travel.min(0.0),
            _ => travel,
        };
        let velocity = released(velocity);
        // What would lead in the other direction is not made up for.
        if released(-self.catch_up.ramp.position) == 0.0 {
            self.catch_up.ramp = Ramp::at(0.0);
        }
        let (made_up, faster) = self.step_catch_up(velocity, most);
        let (beside, speed) = self.step_offset();
        self.ramp.velocity = velocity + faster + speed;
        self.ramp.position += velocity * POSITION_STEP + made_up + beside;
    }
}
