//! The CiA 402 state machine (lxm32m 1295-1393) and what errors do to it.

use super::drive::Drive;
use super::fault::DriveError;
use crate::twin::ErrorClass;
use crate::twin::cia402::commanded;
use crate::twin::node::Firmware;
use crate::twin::servo::firmware::ServoFirmware;
use syncline_canopen::cia402::{Command, Controlword, State};
use syncline_canopen::node::Origin;
use syncline_canopen::time::Duration;

/// Least time that statusword bit 7 stays (lxm32m 1319).
const WARNING_TIME: Duration = Duration::from_millis(100);

/// 3006h:18 `LIM_QStopReact`, which takes the place of 605Ah (lxm32m 2256), coded as that is: with
/// the profile's deceleration, to stay in state 7. Anything else: with the quick stop ramp.
const BY_PROFILE_AND_STAY: i64 = 5;

/// Time in state 3 before the automatic change to 4.
const SELF_TEST: Duration = Duration::from_millis(1);

impl Drive {
    /// The changes that need no command.
    pub(super) fn change_state(&mut self) {
        match self.servo.state {
            State::ReadyToSwitchOn | State::SwitchedOn if !self.servo.has_mains => {
                self.enter(State::SwitchOnDisabled);
            }
            state if state.is_powered() && !self.servo.has_mains => {
                self.raise(DriveError::UNDERVOLTAGE);
            }
            // Factory setting of 301Bh:13: the examples show state 4 before any controlword (D-28).
            State::SwitchOnDisabled
                if self.becomes_ready_alone()
                    && self.servo.has_mains
                    && self.servo.now.saturating_since(self.servo.state_since) >= SELF_TEST =>
            {
                self.enter(State::ReadyToSwitchOn);
            }
            State::SwitchedOn if self.servo.enable_at.is_some_and(|at| self.servo.now >= at) => {
                self.enter(State::OperationEnabled);
                if let Some(error) = self.limit_at_enabling() {
                    self.raise(error);
                }
            }
            _ => {}
        }
    }

    fn becomes_ready_alone(&self) -> bool {
        self.objects.get(self.rows.ds402_compatible) == 0
    }

    /// A controlword (lxm32m 1360-1393).
    pub(super) fn command(&mut self, word: Controlword, origin: Origin) {
        let previous = core::mem::replace(&mut self.servo.controlword, word);
        if word.resets_fault(previous) {
            self.reset_errors();
        }
        if matches!(self.servo.state, State::FaultReactionActive | State::Fault) {
            return;
        }
        let Some(command) = word.command() else {
            return;
        };
        match (command, self.servo.state) {
            // T7, and back at once.
            (Command::DisableVoltage, State::ReadyToSwitchOn) if self.becomes_ready_alone() => {}
            // Without DC bus voltage state 3 is not left (lxm32m 1315).
            (Command::Shutdown, State::SwitchOnDisabled) if !self.servo.has_mains => {}
            (Command::EnableOperation, State::QuickStopActive)
                if self.servo.errors.active().is_some() => {}
            (Command::SwitchOn, State::SwitchedOn) => self.servo.enable_at = None,
            (command, state) => {
                if let Some(to) = commanded(state, command) {
                    self.follow(to);
                }
            }
        }
        self.mode_command(previous, origin);
    }

    /// A commanded transition, with what the drive does on the way.
    fn follow(&mut self, to: State) {
        match (self.servo.state, to) {
            (_, State::QuickStopActive) => {
                self.enter(to);
                self.x_err = true;
                self.quick_stop();
            }
            (State::QuickStopActive, State::OperationEnabled) => {
                self.enter(to);
                self.quick_stopping = false;
                self.x_err = false;
            }
            (_, State::OperationEnabled) => {
                self.enter(State::SwitchedOn);
                let enabled = self.servo.now + self.policies.enable_time;
                self.servo.enable_at.get_or_insert(enabled);
            }
            _ => self.enter(to),
        }
    }

    /// Brakes with the quick stop ramp; the mode is ended.
    fn quick_stop(&mut self) {
        self.end_mode();
        self.quick_stopping = true;
        match self.objects.get(self.rows.quick_stop_option) {
            BY_PROFILE_AND_STAY => self.stop(self.profile_deceleration()),
            _ => self.stop(self.quick_stop_deceleration()),
        }
    }

    /// 3006h:12 in increments/s².
    pub(super) fn quick_stop_deceleration(&self) -> f64 {
        self.acceleration_of(self.objects.get(self.rows.quick_stop_ramp))
    }

    /// The application starts with the objects as they were stored; an error stays.
    pub(super) fn restart(&mut self) {
        if !matches!(self.servo.state, State::Fault | State::FaultReactionActive) {
            self.enter(State::NotReadyToSwitchOn);
            self.enter(State::SwitchOnDisabled);
            self.x_err = false;
        }
        self.servo.controlword = Controlword(0);
        self.zero = 0;
        self.ref_ok = false;
        self.change_mode();
        self.sync.stop(&mut self.servo.loops.clock, self.servo.now);
        self.select_at_power_up();
        self.written(self.rows.velocity_limit, Origin::Sdo);
    }

    /// Raises an error and reacts as its class says.
    pub(super) fn raise(&mut self, error: DriveError) {
        let rows = self.rows;
        if error.class == ErrorClass::Warning {
            self.objects.set(rows.last_warning, error.number.into());
            self.objects.set(rows.warnings_active, 1);
            self.objects.set(rows.warnings_latched, 1);
            self.warning_until = self.servo.now + WARNING_TIME;
            return;
        }
        // The first error is the one to tell, unless a worse one follows.
        if self.servo.errors.active_class() >= Some(error.class) {
            return;
        }
        self.servo.errors.begin(error);
        self.objects.set(rows.last_error, error.number.into());
        self.remember(error.number.into(), error.class as i64);
        self.x_err = true;
        let powered = self.is_powered();
        match error.class {
            ErrorClass::QuickStop if powered => {
                self.enter(State::QuickStopActive);
                self.quick_stop();
            }
            ErrorClass::StopAndSwitchOff if powered => {
                self.enter(State::FaultReactionActive);
                self.quick_stop();
            }
            _ => self.enter(State::Fault),
        }
    }

    /// Enters an error in the error memory, whose newest entry alone can be read here: how the
    /// others are reached is not in the manual at hand.
    pub(super) fn remember(&mut self, number: i64, class: i64) {
        let rows = self.rows;
        self.objects.set(rows.memory_number, number);
        self.objects.set(rows.memory_class, class);
        let seconds = self.servo.now.as_nanos() / 1_000_000_000;
        self.objects.set(rows.memory_time, seconds as i64);
    }

    fn reset_errors(&mut self) {
        self.warning_until = self.servo.now;
        self.objects.set(self.rows.warnings_active, 0);
        let Some(class) = self.servo.errors.active_class() else {
            return;
        };
        if class == ErrorClass::Fatal
            || self.servo.cause_persists
            || self.servo.state == State::FaultReactionActive
        {
            return;
        }
        self.servo.errors.reset(self.policies.emcy_on_reset);
        self.x_err = false;
        if self.servo.state == State::Fault {
            self.enter(State::SwitchOnDisabled);
        }
    }
}
