//! Manual movement by 20A9h (4029-4161).

use super::Movement;
use crate::twin::tlc5xx::drive::Drive;
use crate::twin::tlc5xx::motion::Motion;
use crate::twin::tlc5xx::settings::Settings;
use syncline_canopen::Instant;
use syncline_canopen::time::Duration;

/// Bits of 20A9h (12738-12742).
const CLOCKWISE: i64 = 1 << 0;
const ANTICLOCKWISE: i64 = 1 << 1;
const FAST: i64 = 1 << 2;

/// A manual movement under way.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::twin::tlc5xx) struct Manual {
    /// Direction, 0 for none.
    direction: f64,
    fast: bool,
    /// When the first step of classic inching turns into a continuous run.
    runs_from: Option<Instant>,
}

impl Manual {
    pub(super) fn is_active(&self) -> bool {
        self.direction != 0.0
    }
}

impl Drive {
    /// 20A9h was written. Both directions at once are none, an assumption.
    pub(super) fn start_manual(&mut self, bits: i64) {
        let direction = match bits & (CLOCKWISE | ANTICLOCKWISE) {
            CLOCKWISE => 1.0,
            ANTICLOCKWISE => -1.0,
            _ => 0.0,
        };
        if direction == 0.0 {
            if self.movement == Movement::Manual {
                self.manual = Manual::default();
                self.stop(self.settings.manufacturer.deceleration);
            }
            return;
        }
        let value = |index| self.objects.value(index, 0).unwrap_or(0);
        let is_united = value(0x20AA) == 1;
        let distance = value(if is_united { 0x20AD } else { 0x20AE });
        let delay = Duration::from_millis(value(0x20AF) as u64);
        self.movement = Movement::Manual;
        self.manual = Manual {
            direction,
            fast: bits & FAST != 0,
            runs_from: (!is_united).then(|| self.servo.now + delay),
        };
        let travel = direction * distance as f64 * self.settings.position;
        let limits = Settings::at_most(self.settings.manufacturer, self.manual_velocity());
        self.begin(Motion::Position(self.ramp.position + travel, limits));
    }

    pub(super) fn step_manual(&mut self) {
        if self
            .manual
            .runs_from
            .is_some_and(|from| self.servo.now >= from)
        {
            self.manual.runs_from = None;
            let limits = Settings::at_most(self.settings.manufacturer, self.manual_velocity());
            self.motion = Motion::Velocity(self.manual.direction * limits.velocity, limits);
        }
        // A united step ends by itself.
        if self.manual.runs_from.is_none() && self.motion == Motion::Hold {
            self.manual = Manual::default();
            self.movement = Movement::None;
            self.target_reached = true;
        }
    }

    fn manual_velocity(&self) -> f64 {
        let index = if self.manual.fast { 0x20AC } else { 0x20AB };
        self.objects.value(index, 0).unwrap_or(0) as f64 * self.settings.velocity
    }
}
