//! The operating modes (lxm32m 1395-1746).
//!
//! A mode is chosen by 6060h; it takes over when the motor stands. Its movement is started by
//! what the manual names for it: a controlword bit, or the write of a target.

mod electronic_gear;
mod homing;
mod interpolated_position;
mod jog;
mod motion_sequence;
mod profile_position;
mod profile_torque;
mod profile_velocity;

pub(super) use electronic_gear::Gear;
pub(super) use homing::Homing;
pub(super) use interpolated_position::Interpolation;
pub(super) use jog::Jog;
pub(super) use motion_sequence::Sequence;
pub(super) use profile_position::ProfilePosition;

use super::drive::Drive;
use super::motion::Motion;
use super::synchronisation;
use super::units::INCREMENTS_PER_REVOLUTION;
use crate::twin::node::Firmware;
use syncline_canopen::cia402::{Controlword, State};
use syncline_canopen::dictionary::Row;
use syncline_canopen::node::Origin;
use syncline_canopen::sdo::AbortCode;

/// The modes that the manual describes for CANopen (lxm32m 1405).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i8)]
pub(super) enum Mode {
    None = 0,
    MotionSequence = -3,
    ElectronicGear = -2,
    Jog = -1,
    ProfilePosition = 1,
    ProfileVelocity = 3,
    ProfileTorque = 4,
    Homing = 6,
    InterpolatedPosition = 7,
}

impl Mode {
    /// The mode with this number in 6060h, if the twin has it.
    fn of(number: i64) -> Option<Self> {
        const ALL: [Mode; 9] = [
            Mode::None,
            Mode::MotionSequence,
            Mode::ElectronicGear,
            Mode::Jog,
            Mode::ProfilePosition,
            Mode::ProfileVelocity,
            Mode::ProfileTorque,
            Mode::Homing,
            Mode::InterpolatedPosition,
        ];
        ALL.into_iter().find(|mode| *mode as i64 == number)
    }
}

/// 605Dh as CiA 402 has it: with the quick stop ramp. Anything else: with 6084h.
const HALT_BY_QUICK_STOP_RAMP: i64 = 2;

/// A value of 3006h:1 in usr_a.
const RAMP_UNIT: i64 = 10;

/// 301Bh:38 and :39: the target comes from the parameter (lxm32m 1487, 1521). From another source none
/// comes here.
const BY_PARAMETER: i64 = 1;

impl Drive {
    /// The target in a row, as far as the row of its source says so.
    fn target_by(&self, source: Row, target: Row) -> i64 {
        match self.objects.get(source) {
            BY_PARAMETER => self.objects.get(target),
            _ => 0,
        }
    }

    /// Whether an object that starts movements of a mode, and has just been written, does so now. While
    /// the mode before still moves, its value is kept until this one takes over.
    fn starts(&mut self, mode: Mode) -> bool {
        let awaited = self.mode != mode && self.objects.get(self.rows.mode) == mode as i64;
        if awaited {
            self.start_waits = Some(mode);
        }
        self.mode == mode && self.may_move()
    }

    /// Whether movements may be commanded.
    fn may_move(&self) -> bool {
        self.servo.state == State::OperationEnabled
            && self.switching_off.is_none()
            && !self.servo.controlword.has(Controlword::HALT)
    }

    /// The mode's own part of a controlword.
    pub(super) fn mode_command(&mut self, previous: Controlword, origin: Origin) {
        let word = self.servo.controlword;
        let enabled = self.servo.state == State::OperationEnabled;
        if enabled && word.has(Controlword::HALT) && !previous.has(Controlword::HALT) {
            self.end_mode();
            match self.objects.get(self.rows.halt_option) {
                HALT_BY_QUICK_STOP_RAMP => self.stop(self.quick_stop_deceleration()),
                _ => self.stop(self.profile_deceleration()),
            }
        }
        let start = word.has(Controlword::MODE_4) && !previous.has(Controlword::MODE_4);
        self.command_interpolation(start, origin);
        match self.mode {
            Mode::ProfilePosition => self.command_position(start),
            Mode::Homing if start && self.may_move() => self.start_homing(),
            Mode::MotionSequence if start && self.may_move() => self.start_sequence(),
            _ => {}
        }
    }

    /// The mode's part of a step of the position loop.
    pub(super) fn step_mode(&mut self) {
        self.change_mode();
        match self.mode {
            Mode::Jog => self.step_jog(),
            Mode::ProfilePosition => self.step_position(),
            Mode::ProfileTorque => self.step_torque(),
            Mode::Homing => self.step_homing(),
            Mode::MotionSequence => self.step_sequence(),
            _ => {}
        }
    }

    /// Whether more comes after the present movement: of the mode, or at once of the mode that takes over from it, so
    /// that x_end does not rise in between (lxm32m 1347).
    pub(super) fn is_busy(&self) -> bool {
        let follows =
            |mode: Mode| self.mode != mode && self.objects.get(self.rows.mode) == mode as i64;
        self.start_waits.is_some_and(follows)
            || self.jog.is_busy()
            || self.position.is_busy()
            || self.homing.is_active()
            || self.sequence.is_moving()
    }

    /// Bit 10 while a movement is under way or just over.
    pub(super) fn watch_target(&mut self) {
        match self.mode {
            Mode::ProfileVelocity => self.watch_velocity(),
            Mode::ProfileTorque => self.watch_torque(),
            Mode::InterpolatedPosition => self.watch_interpolation(),
            Mode::ProfilePosition => self.watch_position(),
            _ => {}
        }
    }

    /// Halt, Quick Stop, an error or another mode: whatever the mode was doing is over.
    pub(super) fn end_mode(&mut self) {
        self.bit_12 = false;
        self.interpolation.end();
        self.position = ProfilePosition::default();
        self.jog = Jog::default();
        self.homing = Homing::default();
        if let Some(number) = self.sequence.abort() {
            self.objects.set(self.rows.sequence_aborted, number);
        }
        if self.mode == Mode::ElectronicGear {
            self.objects.set(self.rows.gear_reference, 0);
        }
    }

    /// Another mode was asked for: it takes over at standstill; what moves is stopped.
    pub(super) fn change_mode(&mut self) {
        let asked = self.objects.get(self.rows.mode);
        if asked == self.mode as i64 {
            return;
        }
        let Some(wanted) = Mode::of(asked) else {
            return;
        };
        if self.is_powered() && !self.is_at_rest() {
            if !self.servo.braking {
                self.end_mode();
                self.stop(self.profile_deceleration());
            }
            return;
        }
        self.end_mode();
        self.mode = wanted;
        if self.start_waits.take() != Some(wanted) {
            return;
        }
        match wanted {
            Mode::ProfileVelocity => self.set_velocity(),
            Mode::ProfileTorque => self.set_torque(),
            Mode::Jog => self.set_jog(),
            Mode::ElectronicGear => self.set_gear(),
            _ => {}
        }
    }

    // ---- objects ----

    /// Whether the drive's state permits this write.
    pub(super) fn check_write(
        &self,
        row: Row,
        value: i64,
        origin: Origin,
    ) -> Result<(), AbortCode> {
        let rows = &self.rows;
        let scaling = [
            rows.position_denominator,
            rows.position_numerator,
            rows.velocity_denominator,
            rows.velocity_numerator,
            rows.ramp_denominator,
            rows.ramp_numerator,
        ];
        if scaling.contains(&row) {
            if value < 1 {
                return Err(AbortCode::InvalidValue);
            }
            if self.is_powered() {
                return Err(AbortCode::DeviceState);
            }
        }
        if row == rows.controlword && !self.servo.remote {
            return Err(AbortCode::LocalControl);
        }
        if row == rows.mode {
            self.objects.check_range(row, value)?;
            if Mode::of(value).is_none() {
                return Err(AbortCode::InvalidValue);
            }
        }
        // A PDO may bring the bit that makes it relative with it.
        let absolute = origin == Origin::Sdo && !self.servo.controlword.has(Controlword::MODE_6);
        if row == rows.position_target && absolute {
            // Its least and greatest value depend on the software limits (lxm32m 1563).
            let (least, most) = self.software_limits();
            if least.is_some_and(|least| value < least) || most.is_some_and(|most| value > most) {
                return Err(AbortCode::InvalidValue);
            }
        }
        if row == rows.probe_function {
            Self::check_probe_function(value)?;
        }
        if row == rows.position_option && !(0..=profile_position::FROM_ACTUAL).contains(&value) {
            return Err(AbortCode::InvalidValue);
        }
        if row == rows.internal_limit && !Self::is_internal_limit(value) {
            return Err(AbortCode::InvalidValue);
        }
        if row == rows.period_value && !self.policies.periods.contains(&value) {
            return Err(AbortCode::InvalidValue);
        }
        if row == rows.data_set_number && !(0..128).contains(&value) {
            return Err(AbortCode::InvalidValue);
        }
        Ok(())
    }

    /// A value has been written that the tables and [`Self::check_write`] permit.
    pub(super) fn written(&mut self, row: Row, origin: Origin) {
        let rows = self.rows;
        let value = self.objects.get(row);
        if row == rows.setpoint {
            self.interpolation.offer();
        } else if row == rows.controlword {
            self.command(Controlword(value as u16), origin);
        } else if row == rows.mode {
            self.change_mode();
        } else if row == rows.velocity_target {
            self.set_velocity();
        } else if row == rows.torque_target {
            self.set_torque();
        } else if row == rows.velocity_source {
            if matches!(self.motion, Motion::Velocity(..)) {
                self.set_velocity();
            }
        } else if row == rows.ramp_symmetric {
            for ramp in [rows.profile_acceleration, rows.profile_deceleration] {
                self.objects.set(ramp, RAMP_UNIT * value);
            }
        } else if row == rows.jog_activate {
            self.set_jog();
        } else if row == rows.gear_reference {
            self.set_gear();
        } else if row == rows.velocity_limit {
            let limit = self.velocity_of(value);
            self.servo
                .loops
                .cascade
                .limit_speed(limit / INCREMENTS_PER_REVOLUTION);
        } else if row == rows.sync_start {
            if value == synchronisation::START {
                let unit = self.policies.sync_tolerance_unit.as_nanos() as u64;
                let tolerance = self.objects.get(rows.sync_tolerance) as u64 * unit;
                self.sync.start(self.period_ns(), tolerance);
            } else {
                self.sync.stop(&mut self.servo.loops.clock, self.servo.now);
            }
        } else if row == rows.store_parameters && value == 1 {
            self.objects.set(row, 0);
            self.objects.store(|_| true);
        } else if row == rows.reset_parameters && value == 1 {
            self.objects.set(row, 0);
            self.objects.forget(|entry| entry.persistent);
        } else if row == rows.clear_error_memory && value == 1 {
            self.objects.set(row, 0);
            self.forget_errors();
        } else {
            self.data_set_written(row);
            self.parameter_written(row);
            self.signal_written(row);
            self.window_written(row);
        }
    }
}
