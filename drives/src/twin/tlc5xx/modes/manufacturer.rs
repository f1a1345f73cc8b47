//! The manufacturer's modes (3006-3025): their starting objects and what they show.

use super::{Homing, Mode, Movement};
use crate::twin::servo::ramp::Limits;
use crate::twin::tlc5xx::drive::Drive;
use crate::twin::tlc5xx::settings::Settings;
use syncline_canopen::node::Origin;

/// Bits of the states of the modes (12056-12292).
pub(super) const REACHED: u16 = 1 << 13;
pub(super) const ENDED: u16 = 1 << 14;
pub(super) const FAILED: u16 = 1 << 15;

impl Drive {
    /// A starting object of a mode was written. Outside of the manufacturer's mode and of state 6
    /// nothing starts, an assumption.
    pub(super) fn start_manufacturer(&mut self, index: u16, origin: Origin) {
        if self.mode != Mode::Manufacturer || !self.may_move() {
            return;
        }
        let value = self.objects.value(index, 0).unwrap_or(0);
        match index {
            0x2090 | 0x2092 => {
                let limits = self.point_to_point(origin);
                // Whether a new target may follow one that is under way is not said: at once.
                self.position_to(value, index == 0x2090, limits, true);
            }
            0x2095 => self.turn_at(value, self.settings.manufacturer),
            0x209D => self.start_gear(value),
            0x20A4 | 0x20A6 => self.start_offset(value, index == 0x20A4),
            0x20A8 => self.set_offset(value),
            0x20A9 => self.start_manual(value),
            0x20F0 => self.start_homing(Homing::of_manufacturer(value)),
            0x20F6 => self.set_zero(value),
            _ => {}
        }
    }

    /// Velocity and ramps of a positioning: 2094h, or 205Ch where that is not set (12159), with 205Eh
    /// and 205Fh; R_PDO4 brings 20E8h and 20E9h with its target (8379-8386).
    fn point_to_point(&self, origin: Origin) -> Limits {
        let value = |index| self.objects.value(index, 0).unwrap_or(0) as f64;
        let mut limits = self.settings.manufacturer;
        let velocity = if origin == Origin::Pdo(4) {
            // A ramp of 0 is none.
            let ramp = value(0x20E9).max(1.0) * self.settings.acceleration;
            limits.acceleration = ramp;
            limits.deceleration = ramp;
            value(0x20E8)
        } else if value(0x2094) != 0.0 {
            value(0x2094)
        } else {
            value(0x205C)
        };
        Settings::at_most(limits, velocity * self.settings.velocity)
    }

    // ---- what they show ----

    /// 2091h, 2096h, 209Eh, 20A5h, 20F1h, 20F5h (11.9 of the digest), and the captures.
    pub(in crate::twin::tlc5xx) fn publish_states(&mut self) {
        for (index, movement) in [
            (0x2091, Movement::Position),
            (0x2096, Movement::Velocity),
            (0x209E, Movement::Gear),
            (0x20F1, Movement::Homing),
            (0x20F5, Movement::Manual),
        ] {
            let has_target = matches!(movement, Movement::Position | Movement::Velocity);
            let is_under_way = self.movement == movement && self.is_moving();
            let has_begun = self.begun & 1 << movement as u8 != 0;
            let mut state = self.latched_signals;
            for (set, bit) in [
                (has_begun && !is_under_way, ENDED),
                (has_begun && self.movement_failed, FAILED),
                (has_begun && has_target && self.target_reached, REACHED),
            ] {
                state |= if set { bit } else { 0 };
            }
            self.objects.put(index, 0, state.into());
        }
        self.objects.put(0x20A5, 0, self.offset.state().into());
        self.publish_captures();
    }
}
