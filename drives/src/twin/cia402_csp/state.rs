//! The state machine of CiA 402, and what errors do to it. Transitions bear the profile's numbers.

use super::MODE;
use super::drive::Drive;
use super::fault::DriveError;
use super::settings::{BRAKE_AND_STAY, SWITCH_OFF};
use crate::twin::ErrorClass;
use crate::twin::cia402::commanded;
use crate::twin::node::Firmware;
use crate::twin::servo::firmware::ServoFirmware;
use syncline_canopen::cia402::{Controlword, State};
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
        match self.servo.state {
            // T1
            State::NotReadyToSwitchOn
                if self.servo.now.saturating_since(self.servo.state_since) >= SELF_TEST =>
            {
                self.enter(State::SwitchOnDisabled);
            }
            // T4
            State::SwitchedOn if self.servo.enable_at.is_some_and(|at| self.servo.now >= at) => {
                self.enter(State::OperationEnabled);
            }
            state if state.is_powered() && !self.servo.has_mains => {
                self.raise(DriveError::UNDERVOLTAGE);
            }
            _ => {}
        }
    }

    /// A controlword.
    pub(super) fn command(&mut self, word: Controlword) {
        let previous = core::mem::replace(&mut self.servo.controlword, word);
        if word.resets_fault(previous) && self.servo.state != State::FaultReactionActive {
            self.reset_fault();
        }
        if matches!(self.servo.state, State::FaultReactionActive | State::Fault) {
            return;
        }
        let to = word
            .command()
            .and_then(|it| commanded(self.servo.state, it));
        match (self.servo.state, to) {
            (_, None) => {}
            (_, Some(State::QuickStopActive)) => self.quick_stop(),
            (State::QuickStopActive, Some(State::OperationEnabled)) => {
                self.enter(State::OperationEnabled);
                self.braking = false;
            }
            // T3, and T4 once the power stage is on: without DC link voltage never.
            (_, Some(State::OperationEnabled)) => {
                self.enter(State::SwitchedOn);
                if self.servo.has_mains {
                    let enabled = self.servo.now + self.policies.enable_time;
                    self.servo.enable_at.get_or_insert(enabled);
                }
            }
            (_, Some(to)) => self.enter(to),
        }
    }

    /// T11, by 605Ah.
    fn quick_stop(&mut self) {
        if self.settings.quick_stop == SWITCH_OFF {
            self.enter(State::SwitchOnDisabled);
        } else {
            self.enter(State::QuickStopActive);
            self.braking = true;
            self.brake();
        }
    }

    /// Quick stop or fault reaction has come to rest: T12, T14.
    pub(super) fn end_braking(&mut self) {
        self.braking = false;
        match self.servo.state {
            State::FaultReactionActive => self.enter(State::Fault),
            _ if self.settings.quick_stop == BRAKE_AND_STAY => {}
            _ => self.enter(State::SwitchOnDisabled),
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
        if self.settings.mode != MODE {
            self.brake();
        }
    }

    /// Raises an error and reacts as its class says (T13).
    pub(super) fn raise(&mut self, error: DriveError) {
        if error.class == ErrorClass::Warning {
            self.warning = true;
            return;
        }
        // The first error is the one to tell.
        if self.servo.errors.active().is_some() {
            return;
        }
        self.servo.errors.begin(error);
        let brakes = error.class <= ErrorClass::StopAndSwitchOff
            && self.settings.fault_reaction != SWITCH_OFF;
        if self.is_powered() && brakes {
            self.enter(State::FaultReactionActive);
            self.braking = true;
            self.brake();
        } else {
            self.enter(State::Fault);
        }
    }

    /// T15.
    fn reset_fault(&mut self) {
        self.warning = false;
        let class = self.servo.errors.active_class();
        if class.is_none_or(|class| class == ErrorClass::Fatal) || self.servo.cause_persists {
            return;
        }
        self.servo.errors.reset(self.policies.emcy_on_reset);
        if self.servo.state == State::Fault {
            self.enter(State::SwitchOnDisabled);
        }
    }

    /// The connection is lost: 6007h.
    pub(super) fn abort_connection(&mut self) {
        match self.settings.abort_connection {
            FAULT => self.raise(DriveError::CONNECTION_LOST),
            DISABLE_VOLTAGE if self.is_powered() => self.enter(State::SwitchOnDisabled),
            QUICK_STOP if self.servo.state == State::OperationEnabled => self.quick_stop(),
            _ => {}
        }
    }
}
