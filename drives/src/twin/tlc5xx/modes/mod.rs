//! The operating modes (2951-2972): profile position, profile velocity, homing, and the
//! manufacturer's own behind 6060h = -1.
//!
//! A mode is chosen by 6060h and takes over when the motor stands; modes never run in parallel
//! (2938-2946). A movement of the profile's modes is started by the controlword or by a new
//! velocity, one of the manufacturer's by the write of its starting object (3006-3008).

mod gear;
mod homing;
mod list;
mod manual;
mod manufacturer;
mod offset;
mod parameters;
mod profile;

pub(super) use gear::CatchUp;
pub(super) use homing::Homing;
pub(super) use list::List;
pub(super) use manual::Manual;
pub(super) use offset::Offset;
pub(super) use profile::Target;

use super::drive::Drive;
use super::motion::Motion;
use crate::twin::node::Firmware;
use syncline_canopen::cia402::{Controlword, State};

/// 6060h and 6061h (15225-15228).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i8)]
pub(super) enum Mode {
    Manufacturer = -1,
    ProfilePosition = 1,
    ProfileVelocity = 3,
    Homing = 6,
}

impl Mode {
    /// The mode with this number, if the device has it.
    pub(super) fn of(number: i64) -> Option<Self> {
        const ALL: [Mode; 4] = [
            Mode::Manufacturer,
            Mode::ProfilePosition,
            Mode::ProfileVelocity,
            Mode::Homing,
        ];
        ALL.into_iter().find(|mode| *mode as i64 == number)
    }
}

/// What moves, and the number by which 2042h shows it. The coding is the device manual's, which is
/// not at hand: these are assumed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Movement {
    None = 0,
    Position = 1,
    Velocity = 2,
    Gear = 3,
    Manual = 4,
    Homing = 5,
}

impl Drive {
    /// Whether movements may be started.
    pub(super) fn may_move(&self) -> bool {
        self.servo.state == State::OperationEnabled
            && !self.servo.controlword.has(Controlword::HALT)
    }

    /// Whether a movement is under way or interrupted.
    pub(super) fn is_moving(&self) -> bool {
        self.motion != Motion::Hold
            || self.halted.is_some()
            || self.homing.is_active()
            || self.manual.is_active()
            || self.next_target.is_some()
    }

    /// The mode's own part of a controlword.
    pub(super) fn command_mode(&mut self, previous: Controlword) {
        let word = self.servo.controlword;
        self.command_halt(previous);
        if !word.has(Controlword::MODE_4) {
            self.setpoint_acknowledged = false;
        }
        let starts = word.has(Controlword::MODE_4) && !previous.has(Controlword::MODE_4);
        if !starts || !self.may_move() {
            return;
        }
        match self.mode {
            Mode::ProfilePosition => self.take_target(),
            Mode::Homing => {
                let number = self.objects.value(0x6098, 0).unwrap_or(0);
                self.start_homing(Homing::of_profile(number));
            }
            Mode::ProfileVelocity | Mode::Manufacturer => {}
        }
    }

    /// Bit 8: it brakes with the ramp of the running command, and goes on when the bit falls
    /// (5342-5349).
    fn command_halt(&mut self, previous: Controlword) {
        if self.servo.state != State::OperationEnabled {
            return;
        }
        let word = self.servo.controlword;
        match (previous.has(Controlword::HALT), word.has(Controlword::HALT)) {
            (false, true) => {
                if let Some(deceleration) = self.motion.deceleration() {
                    self.halted = Some(self.motion);
                    self.motion = Motion::Stop(deceleration);
                }
            }
            (true, false) => self.go_on(),
            _ => {}
        }
    }

    /// Goes on with the movement that Halt interrupted, if there is one.
    fn go_on(&mut self) {
        if let Some(motion) = self.halted.take() {
            self.begin(motion);
        }
    }

    /// The mode's part of a step of the position loop.
    pub(super) fn step_mode(&mut self) {
        self.change_mode();
        self.step_list();
        if self.halted.is_some() {
            return;
        }
        match self.movement {
            Movement::Position => self.step_position(),
            Movement::Manual => self.step_manual(),
            Movement::Homing => self.step_homing(),
            Movement::None | Movement::Velocity | Movement::Gear => {}
        }
    }

    /// Another mode was asked for: it takes over at standstill, and what moves goes on until then
    /// (15191-15193).
    pub(super) fn change_mode(&mut self) {
        let stands = !self.is_moving() && self.is_at_rest();
        if self.wanted_mode == self.mode || self.is_powered() && !stands {
            return;
        }
        self.end_movement();
        self.mode = self.wanted_mode;
    }

    /// Quick stop, an error, or another mode: whatever moved is over.
    pub(super) fn end_movement(&mut self) {
        self.movement = Movement::None;
        self.target = None;
        self.next_target = None;
        self.homing = Homing::default();
        self.manual = Manual::default();
        self.offset.interrupt();
        self.halted = None;
        self.setpoint_acknowledged = false;
    }

    /// Bit 10: target or velocity reached, or at rest after Halt (3065-3068).
    pub(super) fn watch_target(&mut self) {
        if self.halted.is_some() {
            self.target_reached |= self.is_at_rest();
            return;
        }
        match self.movement {
            Movement::Position => self.watch_position(),
            Movement::Velocity => self.watch_velocity(),
            _ => {}
        }
    }

    /// Statusword bits 12 and 13 (3074-3087).
    pub(super) fn mode_bits(&self) -> (bool, bool) {
        match self.mode {
            Mode::ProfilePosition => (self.setpoint_acknowledged, self.following_error),
            Mode::ProfileVelocity => (self.is_at_rest(), self.following_error),
            Mode::Homing => (self.homing.is_attained(), self.homing.has_failed()),
            Mode::Manufacturer => (false, false),
        }
    }
}
