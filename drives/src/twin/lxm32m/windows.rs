//! What is watched: windows and thresholds that are told (lxm32m 2257-2261, 2282) and a deviation of the
//! velocity that is an error (2237, 2288, 2292, 2293). Statusword bit 11 tells what 301Bh:1E chooses
//! (1335, 2486). The manual at hand prints names: units and values are assumptions.

use super::drive::Drive;
use super::fault::DriveError;
use super::units::INCREMENTS_PER_REVOLUTION;
use crate::twin::rounding::nearest;
use crate::twin::servo::lasting::Lasting;
use syncline_canopen::dictionary::Row;
use syncline_canopen::time::Duration;

/// A value of 3006h:19 in revolutions.
const POSITION_WINDOW: f64 = 1e-4;

/// 301Bh:1E chooses one of these, a channel of the position register, or a hardware limit switch.
const CURRENT_BELOW: i64 = 1;
const VELOCITY_BELOW: i64 = 2;
const POSITION_WITHIN: i64 = 3;
const VELOCITY_WITHIN: i64 = 4;
const FIRST_CHANNEL: i64 = 5;
const LAST_CHANNEL: i64 = 8;
const LIMIT_SWITCH: i64 = 9;

/// Where `IOfunc_DQn` has the same four.
const OUTPUTS: [(i64, i64); 4] = [
    (5, POSITION_WITHIN),
    (6, VELOCITY_WITHIN),
    (7, VELOCITY_BELOW),
    (8, CURRENT_BELOW),
];

/// Since when what has been so.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Windows {
    lasting: [Lasting; 4],
    /// For the time of 3006h:1D, in the order of their values in 301Bh:1E, from 1.
    told: [bool; 4],
    too_far: Lasting,
}

impl Drive {
    /// Looks after the windows.
    pub(super) fn watch_windows(&mut self) {
        let rows = self.rows;
        let value = |row: Row| self.objects.get(row);
        let velocity = self.actual_velocity();
        let velocity_unit = self.velocity_of(1);
        let are_so = [
            self.servo.loops.torque().abs()
                <= self.torque_of_current(value(rows.current_threshold)),
            velocity.abs() <= value(rows.velocity_threshold) as f64 * velocity_unit,
            self.deviation().abs() <= self.increments_of(value(rows.deviation_window_user)),
            (self.ramp.velocity - velocity).abs()
                <= value(rows.velocity_deviation_window) as f64 * velocity_unit,
        ];
        let time = Duration::from_millis(value(rows.window_time) as u64);
        for (place, is_so) in are_so.into_iter().enumerate() {
            let windows = &mut self.windows;
            windows.told[place] = windows.lasting[place].for_time(time, self.servo.now, is_so);
        }
    }

    fn is_told(&self, condition: i64) -> bool {
        let told = self.windows.told.get(condition as usize - 1);
        told.is_some_and(|told| *told)
    }

    /// Bit 11, as 301Bh:1E chooses.
    pub(super) fn is_at_internal_limit(&self) -> bool {
        match self.objects.get(self.rows.internal_limit) {
            condition @ CURRENT_BELOW..=VELOCITY_WITHIN => self.is_told(condition),
            channel @ FIRST_CHANNEL..=LAST_CHANNEL => {
                let encoder = self.servo.loops.encoder.saturating_sub(self.zero);
                self.registers(self.user_position(encoder))[(channel - FIRST_CHANNEL) as usize]
            }
            LIMIT_SWITCH => {
                let (negative, positive) = self.limit_switches();
                negative || positive
            }
            _ => false,
        }
    }

    /// Whether a value may be written to 301Bh:1E.
    pub(super) fn is_internal_limit(value: i64) -> bool {
        (0..=LIMIT_SWITCH).contains(&value)
    }

    /// What a digital output of this function tells.
    pub(super) fn tells_window(&self, function: i64) -> bool {
        let mut outputs = OUTPUTS.iter();
        let output = outputs.find(|(of, _)| *of == function);
        output.is_some_and(|(_, condition)| self.is_told(*condition))
    }

    /// Reference minus actual velocity, increments/s.
    pub(super) fn velocity_deviation(&self) -> f64 {
        match self.is_torque_controlled() {
            true => 0.0,
            false => self.ramp.velocity - self.actual_velocity(),
        }
    }

    /// Supervises it: against 3006h:4B for the time of :4C, while it brakes by itself against :48 (0: not),
    /// with the class of 3005h:3C.
    pub(super) fn velocity_error(&mut self) -> Option<DriveError> {
        let rows = self.rows;
        let limit = match self.servo.braking {
            true => rows.velocity_deviation_limit_stopping,
            false => rows.velocity_deviation_limit,
        };
        let limit = self.objects.get(limit);
        let time = Duration::from_millis(self.objects.get(rows.velocity_deviation_time) as u64);
        let is_so = limit > 0 && self.velocity_deviation().abs() > self.velocity_of(limit);
        let too_long = self.windows.too_far.for_time(time, self.servo.now, is_so);
        let response = self.objects.get(rows.velocity_deviation_response);
        too_long.then(|| DriveError::VELOCITY_DEVIATION.of_class(response))
    }

    /// A window that has two objects has been written: the other one shows it as well.
    pub(super) fn window_written(&mut self, row: Row) {
        let rows = self.rows;
        let value = self.objects.get(row);
        let same = [
            (rows.following_error_limit, rows.following_error_limit_user),
            (rows.standstill_window, rows.standstill_window_user),
        ];
        for (one, other) in same {
            if row == one {
                self.objects.set(other, value.min(i32::MAX.into()));
            } else if row == other {
                self.objects.set(one, value.max(0));
            }
        }
        if row == rows.deviation_window {
            let increments = value as f64 * POSITION_WINDOW * INCREMENTS_PER_REVOLUTION;
            let window = self.user_position(nearest(increments));
            self.objects.set(rows.deviation_window_user, window);
        } else if row == rows.deviation_window_user {
            let revolutions = self.increments_of(value) / INCREMENTS_PER_REVOLUTION;
            let window = nearest(revolutions / POSITION_WINDOW);
            self.objects
                .set(rows.deviation_window, window.clamp(0, u16::MAX.into()));
        }
    }
}
