//! The CiA 402 state machine (lxm32m 1295-1393) and what errors do to it.

use super::drive::Drive;
use crate::twin::cia402::commanded;
use crate::twin::servo::firmware::ServoFirmware;
use crate::twin::servo::velocity::VelocityMeter;
use syncline_canopen::Instant;
use syncline_canopen::cia402::{Command, Controlword, State};
use syncline_canopen::dictionary::Row;
use syncline_canopen::node::Origin;
use syncline_canopen::time::Duration;

/// 3006h:18 `LIM_QStopReact`, which takes the place of 605Ah (lxm32m 2256), coded as that is: with
/// the profile's deceleration, to stay in state 7. Anything else: with the quick stop ramp.
pub(super) const BY_PROFILE_AND_STAY: i64 = 5;

/// Time in state 3 before the automatic change to 4.
const SELF_TEST: Duration = Duration::from_millis(1);

/// 605Bh as CiA 402 has it: what moves is braked with 6084h before the power stage goes off (lxm32m 2903).
/// Anything else: it goes off at once.
const BRAKE_BEFORE: i64 = 1;

/// A command that switches the power stage off waits for the motor to stand and the brake to close.
#[derive(Clone, Copy, Debug)]
pub(super) struct SwitchingOff {
    command: Command,
    /// When the brake is closed.
    closed_at: Option<Instant>,
}

impl SwitchingOff {
    /// Whether the brake has been told to close, under the torque that still holds the motor.
    pub(super) fn brake_closes(&self) -> bool {
        self.closed_at.is_some()
    }
}

impl Drive {
    /// Whether a command has to wait that switches the power stage off: for braking, or at rest for the time
    /// that the holding brake takes to close (lxm32m 2205). The last command counts.
    fn postpones(&mut self, command: Command) -> bool {
        if self.switching_off.is_some_and(|it| it.command == command) {
            return true;
        }
        self.switching_off = None;
        let to = commanded(self.servo.state, command);
        if !self.servo.state.is_powered() || to.is_none_or(State::is_powered) {
            return false;
        }
        if self.is_at_rest() {
            if self.closing_time().is_zero() {
                return false;
            }
        } else {
            if self.objects.get(self.rows.shutdown_option) != BRAKE_BEFORE {
                return false;
            }
            if !self.servo.braking {
                self.end_mode();
                self.stop(self.profile_deceleration());
            }
        }
        self.switching_off = Some(SwitchingOff {
            command,
            closed_at: None,
        });
        true
    }

    /// Switches off what has waited for long enough.
    pub(super) fn finish_switching_off(&mut self) {
        if self.switching_off.is_none() {
            return;
        }
        let at_rest = self.is_at_rest();
        let closing = self.closing_time();
        if at_rest && let Some(off) = &mut self.switching_off {
            let closed_at = *off.closed_at.get_or_insert(self.servo.now + closing);
            let command = off.command;
            if self.servo.now >= closed_at {
                self.follow(command);
            }
        }
    }

    /// How long the motor is held at rest before its power stage goes off: until its brake grips, as the motor's name plate
    /// says (300Dh:21), and for what 3005h:8 adds to that.
    fn closing_time(&self) -> Duration {
        self.brake_closing + self.brake_time(self.rows.brake_apply_time)
    }

    /// What a row adds to the time of the holding brake; ms.
    fn brake_time(&self, row: Row) -> Duration {
        Duration::from_millis(self.objects.get(row).max(0) as u64)
    }

    /// The changes that need no command.
    pub(super) fn change_state(&mut self) {
        match self.servo.state {
            State::ReadyToSwitchOn | State::SwitchedOn if !self.servo.has_mains => {
                self.enter(State::SwitchOnDisabled);
            }
            // Factory setting of 301Bh:13: the examples show state 4 before any controlword (D-28).
            State::SwitchOnDisabled
                if self.becomes_ready_alone()
                    && self.servo.has_mains
                    && self.servo.now.saturating_since(self.servo.state_since) >= SELF_TEST =>
            {
                self.enter(State::ReadyToSwitchOn);
            }
            before => {
                self.watch_power();
                if before == State::SwitchedOn
                    && self.servo.state == State::OperationEnabled
                    && let Some(error) = self.limit_at_enabling()
                {
                    self.raise(error);
                }
            }
        }
    }

    fn becomes_ready_alone(&self) -> bool {
        self.objects.get(self.rows.ds402_compatible) == 0
    }

    /// A controlword (lxm32m 1360-1393).
    pub(super) fn command(&mut self, word: Controlword, origin: Origin) {
        let Some(previous) = self.take(word) else {
            return;
        };
        let Some(command) = word.command() else {
            return;
        };
        match (command, self.servo.state) {
            // T7, and back at once.
            (Command::DisableVoltage, State::ReadyToSwitchOn) if self.becomes_ready_alone() => {}
            // Without DC bus voltage state 3 is not left (lxm32m 1315).
            (Command::Shutdown, State::SwitchOnDisabled) if !self.servo.has_mains => {}
            (Command::SwitchOn, State::SwitchedOn) => self.servo.enable_at = None,
            (command, _) if self.postpones(command) => {}
            (command, before) => {
                let waits = self.servo.enable_at.is_some();
                self.follow(command);
                let release = self.brake_time(self.rows.brake_release_time);
                if let Some(enable_at) = self.servo.enable_at.as_mut().filter(|_| !waits) {
                    *enable_at += release;
                }
                if before == State::QuickStopActive && self.servo.state == State::OperationEnabled {
                    self.x_err = false;
                }
            }
        }
        self.mode_command(previous, origin);
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
        self.turn_as_stored();
        self.servo.controlword = Controlword(0);
        self.zero = 0;
        self.ref_ok = false;
        self.change_mode();
        self.sync.stop(&mut self.servo.loops.clock, self.servo.now);
        self.select_at_power_up();
        self.written(self.rows.velocity_limit, Origin::Sdo);
    }

    /// 3006h:C turns the direction of movement (lxm32m 2246), from the start on; the switches stay where they
    /// are wired.
    fn turn_as_stored(&mut self) {
        let is_turned = self.objects.get(self.rows.direction_inverted) != 0;
        let direction = if is_turned { -1.0 } else { 1.0 };
        let servo = &mut self.servo;
        if direction != servo.loops.direction() && !servo.state.is_powered() {
            servo.loops.turn_to(direction);
            servo.velocity = VelocityMeter::at(servo.loops.encoder);
        }
    }

    /// Enters an error in the error memory, with what is measured at that instant (lxm32m 2677-2687). Its newest entry
    /// alone can be read here: how the others are reached is not in the manual at hand.
    pub(super) fn remember(&mut self, number: i64, class: i64) {
        self.publish_measured();
        let rows = self.rows;
        let seconds = |time: Duration| (time.as_nanos() / 1_000_000_000) as i64;
        let since_enabled = self.enabled_at.map_or(0, |at| seconds(self.servo.now - at));
        let most = i64::from(u16::MAX);
        let velocity = self.user_velocity(self.actual_velocity());
        let measured = |row| self.objects.get(row);
        let entry = [
            number,
            class,
            seconds(self.servo.now - Instant::ZERO),
            self.enable_cycles.min(most),
            since_enabled.min(most),
            measured(rows.bus_voltage),
            velocity,
            measured(rows.current),
            measured(rows.stage_temperature),
            measured(rows.device_temperature),
        ];
        self.set_error_memory(entry);
    }

    /// Clears the error memory (303Bh:4).
    pub(super) fn forget_errors(&mut self) {
        self.set_error_memory([0; 10]);
    }

    fn set_error_memory(&mut self, entry: [i64; 10]) {
        let rows = self.rows;
        let rows = [
            rows.memory_number,
            rows.memory_class,
            rows.memory_time,
            rows.memory_enable_cycles,
            rows.memory_enable_time,
            rows.memory_bus_voltage,
            rows.memory_velocity,
            rows.memory_current,
            rows.memory_stage_temperature,
            rows.memory_device_temperature,
        ];
        for (row, value) in rows.into_iter().zip(entry) {
            self.objects.set(row, value);
        }
    }
}
