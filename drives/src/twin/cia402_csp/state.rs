//! The state machine of CiA 402, as far as the profile lets its objects say how. Transitions bear the profile's
//! numbers.

use super::drive::Drive;
use super::fault::DriveError;
use super::settings::{BRAKE_AND_STAY, SWITCH_OFF};
use crate::twin::node::Firmware;
use crate::twin::servo::firmware::ServoFirmware;
use syncline_canopen::cia402::{Command, Controlword, State};
use syncline_canopen::time::Duration;

/// Time of the self-test after power-on (T1).
const SELF_TEST: Duration = Duration::from_millis(1);

/// 6007h, what a lost connection does besides nothing.
const FAULT: i64 = 1;
const DISABLE_VOLTAGE: i64 = 2;
const QUICK_STOP: i64 = 3;

impl Drive {
    /// The changes that need no command.
    pub(super) fn change_state(&mut self) {
        let in_state = self.servo.now.saturating_since(self.servo.state_since);
        if self.servo.state == State::NotReadyToSwitchOn && in_state >= SELF_TEST {
            self.enter(State::SwitchOnDisabled); // T1
        }
        self.watch_power();
    }

    /// A controlword.
    pub(super) fn command(&mut self, word: Controlword) {
        if self.take(word).is_none() {
            return;
        }
        match (word.command(), self.servo.state) {
            (None, _) => {}
            (Some(Command::QuickStop), State::OperationEnabled) => self.stop_quickly(),
            (Some(command), _) => self.follow(command),
        }
    }

    /// T11, by 605Ah.
    fn stop_quickly(&mut self) {
        if self.settings.quick_stop == SWITCH_OFF {
            self.enter(State::SwitchOnDisabled);
        } else {
            self.quick_stop();
        }
    }

    /// Quick stop or fault reaction has come to rest: T12 by 605Ah, T14.
    pub(super) fn stopped(&mut self) {
        self.end_braking();
        let stays = self.settings.quick_stop == BRAKE_AND_STAY;
        if self.servo.state == State::QuickStopActive && !stays {
            self.enter(State::SwitchOnDisabled);
        }
    }

    /// The application starts anew; an error stays.
    pub(super) fn restart(&mut self) {
        if !matches!(self.servo.state, State::Fault | State::FaultReactionActive) {
            self.enter(State::NotReadyToSwitchOn);
        }
        self.servo.controlword = Controlword(0);
    }

    /// Another mode than the one that follows setpoints: what moves comes to rest.
    pub(super) fn mode_changed(&mut self) {
        if self.settings.mode != self.mode {
            self.brake();
        }
    }

    /// The connection is lost: 6007h.
    pub(super) fn abort_connection(&mut self) {
        match self.settings.abort_connection {
            FAULT => self.raise(DriveError::CONNECTION_LOST),
            DISABLE_VOLTAGE if self.is_powered() => self.enter(State::SwitchOnDisabled),
            QUICK_STOP if self.servo.state == State::OperationEnabled => self.stop_quickly(),
            _ => {}
        }
    }
}
