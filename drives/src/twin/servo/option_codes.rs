//! What CiA 402's option codes say of a servo drive: how it stops quickly (605Ah), reacts to an error (605Eh) and to a lost
//! connection (6007h). Transitions bear the profile's numbers.

use super::firmware::ServoFirmware;
use crate::twin::device::ErrorClass;
use syncline_canopen::cia402::{Command, Controlword, State};
use syncline_canopen::time::Duration;

/// Time of the self-test after power-on (T1): assumed.
const SELF_TEST: Duration = Duration::from_millis(1);

/// 605Ah and 605Eh: off at once.
const SWITCH_OFF: i64 = 0;
/// 605Ah: brake with the quick stop ramp and stay in Quick Stop Active.
const BRAKE_AND_STAY: i64 = 6;

/// 6007h, what a lost connection does besides nothing.
const FAULT: i64 = 1;
const DISABLE_VOLTAGE: i64 = 2;
const QUICK_STOP: i64 = 3;

/// What its objects say.
#[derive(Clone, Copy, Debug)]
pub struct OptionCodes {
    /// 605Ah: 0 off at once, 6 brake and stay in Quick Stop Active; else brake and switch off.
    pub quick_stop: i64,
    /// 605Eh: 0 off at once, else brake.
    pub fault_reaction: i64,
    /// 6007h: 1 fault, 2 off, 3 quick stop; else nothing.
    pub abort_connection: i64,
}

impl OptionCodes {
    /// How it reacts to an error of a class. Both stopping classes are one here: the profile has one fault reaction.
    #[must_use]
    pub fn reaction(&self, class: ErrorClass) -> ErrorClass {
        if class > ErrorClass::StopAndSwitchOff || self.fault_reaction == SWITCH_OFF {
            ErrorClass::SwitchOff
        } else {
            ErrorClass::StopAndSwitchOff
        }
    }
}

/// A drive whose state machine goes by them.
pub trait ByOptionCodes: ServoFirmware {
    /// The error that a lost connection is, where it is one.
    const CONNECTION_LOST: Self::Error;

    /// As they are now.
    fn option_codes(&self) -> OptionCodes;

    /// The changes that need no command.
    fn change_state(&mut self) {
        let servo = self.servo();
        let in_state = servo.now.saturating_since(servo.state_since);
        if servo.state == State::NotReadyToSwitchOn && in_state >= SELF_TEST {
            self.enter(State::SwitchOnDisabled); // T1
        }
        self.watch_power();
    }

    /// A controlword.
    fn command(&mut self, word: Controlword) {
        if self.take(word).is_none() {
            return;
        }
        match (word.command(), self.servo().state) {
            (None, _) => {}
            (Some(Command::QuickStop), State::OperationEnabled) => self.stop_quickly(),
            (Some(command), _) => self.follow(command),
        }
    }

    /// T11.
    fn stop_quickly(&mut self) {
        if self.option_codes().quick_stop == SWITCH_OFF {
            self.enter(State::SwitchOnDisabled);
        } else {
            self.quick_stop();
        }
    }

    /// Quick stop or fault reaction has come to rest: T12, T14.
    fn stopped(&mut self) {
        self.end_braking();
        let stays = self.option_codes().quick_stop == BRAKE_AND_STAY;
        if self.servo().state == State::QuickStopActive && !stays {
            self.enter(State::SwitchOnDisabled);
        }
    }

    /// The application starts anew; an error stays.
    fn restart(&mut self) {
        if !matches!(
            self.servo().state,
            State::Fault | State::FaultReactionActive
        ) {
            self.enter(State::NotReadyToSwitchOn);
        }
        self.servo_mut().controlword = Controlword(0);
    }

    /// The connection is lost.
    fn abort_connection(&mut self) {
        let state = self.servo().state;
        match self.option_codes().abort_connection {
            FAULT => self.raise(Self::CONNECTION_LOST),
            DISABLE_VOLTAGE if state.is_powered() => self.enter(State::SwitchOnDisabled),
            QUICK_STOP if state == State::OperationEnabled => self.stop_quickly(),
            _ => {}
        }
    }
}
