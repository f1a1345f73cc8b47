//! The state machine of DSP-402 V1.0 (2613-2690) and what errors do to it.

use super::drive::Drive;
use super::fault::DriveError;
use super::policy::{Bit9, FaultBits};
use super::signals::{LIMN, LIMP, REF, STOP};
use crate::twin::servo::firmware::ServoFirmware;
use syncline_canopen::cia402::{Command, Controlword, State, Statusword};

/// Errors that 2400h keeps (14855).
const ERROR_MEMORY: usize = 20;

impl Drive {
    /// The changes that need no command (T0, T1, T14).
    pub(super) fn change_state(&mut self) {
        match self.servo.state {
            State::NotReadyToSwitchOn => self.enter(State::SwitchOnDisabled),
            State::ReadyToSwitchOn | State::SwitchedOn if !self.servo.has_mains => {
                self.enter(State::SwitchOnDisabled);
            }
            _ => self.watch_power(),
        }
    }

    /// A controlword (2709-2728). From 4 to 6 in one word, as the examples do (3493).
    pub(super) fn command(&mut self, word: Controlword) {
        let Some(previous) = self.take(word) else {
            return;
        };
        if let Some(command) = word.command() {
            self.transit(command);
        }
        self.command_mode(previous);
    }

    /// 2040h of the manufacturer's modes (10028-10040): a bit is a command by itself.
    pub(super) fn command_manufacturer(&mut self, bits: i64) {
        if bits & 1 << 3 != 0 {
            self.reset_error();
        }
        if matches!(self.servo.state, State::FaultReactionActive | State::Fault) {
            return;
        }
        if bits & 1 << 0 != 0 {
            self.transit(Command::DisableVoltage);
        } else if bits & 1 << 2 != 0 {
            self.transit(Command::QuickStop);
        } else if bits & 1 << 1 != 0 {
            if self.servo.state == State::SwitchOnDisabled {
                self.transit(Command::Shutdown);
            }
            self.transit(Command::EnableOperation);
        }
    }

    /// Without DC bus voltage state 3 is not left.
    fn transit(&mut self, command: Command) {
        if self.servo.state != State::SwitchOnDisabled || self.servo.has_mains {
            self.follow(command);
        }
    }

    /// A local unit takes control, or the fieldbus has it (again): free access is granted unless
    /// 2060h keeps it for the fieldbus (566-589, 10944). A movement goes on.
    pub(super) fn take_control(&mut self, remote: bool) {
        let is_reserved = self.objects.value(0x2060, 0) == Some(1);
        self.servo.remote = remote || is_reserved;
    }

    /// 603Fh and 2400h, whose order the manual does not state: the newest first.
    pub(super) fn show_error(&mut self, error: DriveError) {
        self.error_memory.truncate(ERROR_MEMORY - 1);
        self.error_memory.push_front(error.code);
        self.objects.put(0x603F, 0, error.code.into());
        for (place, &code) in self.error_memory.iter().enumerate() {
            self.objects.put(0x2400, place as u8 + 1, code.into());
        }
    }

    // ---- what it shows ----

    /// 6041h (10.4 of the digest). Bit 10 is not shown in state 3, where the examples have 0040h
    /// between two words with it (2847-2853).
    pub(super) fn statusword(&self) -> Statusword {
        let state = match (self.servo.state, self.policies.fault) {
            (State::NotReadyToSwitchOn, _) => 0x0000,
            // Bit 5 is open there (2782); the examples have it clear.
            (State::SwitchOnDisabled, _) => 0x0040,
            (State::FaultReactionActive, _) | (State::Fault, FaultBits::AllFour) => 0x000F,
            (State::Fault, FaultBits::OfProfile) => 0x0008,
            (state, _) => state.bits(),
        };
        let remote = match self.policies.remote {
            Bit9::ClearIsFieldbus => !self.servo.remote,
            Bit9::SetIsFieldbus => self.servo.remote,
        };
        let reached = self.target_reached && self.servo.state != State::SwitchOnDisabled;
        let (bit_12, bit_13) = self.mode_bits();
        let flags = [
            // "Voltage switched off" (15115): clear in all examples of switching (D-04).
            (!self.servo.has_mains, Statusword::VOLTAGE_ENABLED),
            (remote, Statusword::REMOTE),
            (reached, Statusword::TARGET_REACHED),
            (self.limit_signals() != 0, Statusword::INTERNAL_LIMIT),
            (bit_12, Statusword::MODE_12),
            (bit_13, Statusword::BIT_13),
        ];
        Statusword::of(state, &flags)
    }

    /// 2041h (2877-2903).
    pub(super) fn drive_status(&self) -> u16 {
        let number = match self.servo.state {
            State::NotReadyToSwitchOn => 2,
            State::SwitchOnDisabled => 3,
            State::ReadyToSwitchOn => 4,
            State::SwitchedOn => 5,
            State::OperationEnabled => 6,
            State::QuickStopActive => 7,
            State::FaultReactionActive => 8,
            State::Fault => 9,
        };
        let bit = |set: bool, bit: u16| if set { 1 << bit } else { 0 };
        let error = self.servo.errors.active();
        let is_internal = error.is_some_and(|error| error != DriveError::EXTERNAL_SIGNAL);
        // Of what the inputs have stopped 2048h tells (10099-10105).
        let is_external = self.latched_signals & (LIMP | LIMN | REF | STOP) != 0;
        number
            | bit(is_internal || self.overrun, 5)
            | bit(is_external, 6)
            | bit(self.has_warning, 7)
            | bit(self.target_reached, 13)
            | bit(!self.is_moving(), 14)
            | bit(self.movement_failed, 15)
    }
}
