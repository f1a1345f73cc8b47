//! The controller behind the CANopen node: field and rotor, states, what its objects show.

use super::TwinConfig;
use super::homing::Homing;
use super::modes::{Mode, Motion};
use super::motor::Motor;
use super::policy::{Policies, StandbyUnit};
use super::signals::{LOWER_LIMIT, Switches, UPPER_LIMIT};
use crate::twin::ErrorClass;
use crate::twin::cia402::commanded;
use crate::twin::node::{Firmware, Tampering};
use crate::twin::rounding::nearest;
use crate::twin::servo::cascade::{POSITION_STEP_NS, SPEED_STEPS};
use crate::twin::servo::clock::Clock;
use crate::twin::servo::ramp::{Limits, Ramp};
use crate::twin::servo::shaft::Shaft;
use syncline_canopen::cia402::{Command, Controlword, State, Statusword};
use syncline_canopen::dictionary::Dictionary;
use syncline_canopen::emcy::register;
use syncline_canopen::time::Duration;
use syncline_canopen::{Instant, NodeId};

/// Nominal seconds per step of the profile.
pub(super) const PROFILE_STEP: f64 = POSITION_STEP_NS as f64 * 1e-9;

/// A controller without its bus. Positions of its profile are steps, as the objects have them.
pub struct Drive {
    pub(super) objects: Dictionary,
    pub(super) policies: Policies,
    pub(super) node: NodeId,
    pub(super) now: Instant,

    pub(super) state: State,
    pub(super) controlword: Controlword,
    /// It brakes by itself: quick stop or fault reaction.
    pub(super) braking: bool,
    pub(super) has_mains: bool,
    /// 1001h; 0 without an error.
    pub(super) error_register: u8,
    pub(super) cause_persists: bool,

    clock: Clock,
    motor: Motor,
    pub(super) shaft: Shaft,
    pub(super) torque: f64,
    /// The demand.
    pub(super) ramp: Ramp,
    pub(super) motion: Motion,
    /// Where the field is while the demand is 0, revolutions.
    origin: f64,
    /// Where the encoder is while the position is 0, revolutions.
    encoder_zero: f64,
    stands_since: Instant,

    pub(super) switches: Switches,
    /// Levels of DE1 to DE10 from bit 0, but for those that the switches along the axis drive.
    pub(super) inputs: u16,
    pub(super) homing_input: bool,
    pub(super) is_referenced: bool,

    pub(super) mode: Mode,
    pub(super) homing: Homing,
    /// What goes on when bit 8 of the controlword falls.
    pub(super) halted: Option<Motion>,
    pub(super) target: f64,
    pub(super) acknowledged: bool,
    pub(super) target_reached: bool,
    pub(super) limit_reached: bool,

    /// When a T_PDO is sent by the clock next.
    pub(super) next_period: Instant,
    /// The objects do not show the present condition yet.
    pub(super) stale: bool,
    pub(super) tampering: Tampering,
}

impl Drive {
    pub(super) fn new(objects: Dictionary, config: TwinConfig, clock: Clock) -> Self {
        Self {
            objects,
            policies: config.policies,
            node: config.processor.node,
            now: Instant::ZERO,
            state: State::NotReadyToSwitchOn,
            controlword: Controlword(0),
            braking: false,
            has_mains: true,
            error_register: 0,
            cause_persists: false,
            clock,
            motor: config.motor,
            shaft: Shaft::new(config.mechanics, config.position),
            torque: 0.0,
            ramp: Ramp::at(0.0),
            motion: Motion::Hold,
            origin: config.position,
            encoder_zero: config.position,
            stands_since: Instant::ZERO,
            switches: config.switches,
            inputs: 0,
            homing_input: false,
            is_referenced: false,
            mode: Mode::ProfilePosition,
            homing: Homing::default(),
            halted: None,
            target: 0.0,
            acknowledged: false,
            target_reached: false,
            limit_reached: false,
            next_period: Instant::ZERO,
            stale: true,
            tampering: Tampering::default(),
        }
    }

    pub(super) fn value(&self, index: u16, sub: u8) -> f64 {
        self.objects.value(index, sub).unwrap_or(0) as f64
    }

    // ---- units ----

    /// Steps of a revolution, with the direction of 2002h bit 0 (510-536, 572-584). Clockwise, seen
    /// looking at the shaft, is positive as delivered.
    fn steps_per_revolution(&self) -> f64 {
        let steps = self.value(0x6092, 1) / self.value(0x6092, 2);
        match self.value(0x2002, 0) as i64 & 1 {
            0 => steps,
            _ => -steps,
        }
    }

    /// Steps/s of a unit of 60FFh and 606Ch.
    pub(super) fn velocity_unit(&self) -> f64 {
        let steps = self.steps_per_revolution().abs();
        (self.policies.velocity_unit).map_or(1.0, |[units, rpm]| {
            f64::from(rpm) / 60.0 * steps / f64::from(units)
        })
    }

    /// Ramps of the objects with these indices, and a velocity in steps/s.
    pub(super) fn limits(&self, velocity: f64, up: u16, down: u16) -> Limits {
        Limits {
            velocity,
            acceleration: self.value(up, 0),
            deceleration: self.value(down, 0),
        }
    }

    // ---- time ----

    /// Lets profile, field and rotor run up to `now`.
    pub(super) fn advance(&mut self, now: Instant) {
        while self.clock.step_end() <= now {
            self.step();
        }
        self.now = now;
    }

    fn step(&mut self) {
        let (step, dt) = self.clock.step();
        let end = self.clock.step_end();
        if step % SPEED_STEPS == 0 {
            self.now = end;
            self.profile_step();
        }
        let scale = 1.0 / self.steps_per_revolution();
        // The field goes in whole steps of 6092h: few a revolution shake the rotor.
        let field = self.origin + libm::round(self.ramp.position) * scale;
        let field_velocity = self.ramp.velocity * scale;
        let (position, velocity) = (self.shaft.position(), self.shaft.velocity());
        let (current, rated) = (self.current(), self.rated_current());
        let motor = &self.motor;
        self.torque = motor.torque(current, rated, field, field_velocity, position, velocity);
        self.shaft.step(end, dt, self.torque, self.is_powered());
        self.clock.next_step();
    }

    /// Current of the windings, A rms: 6075h, or 2001h of it after the delay at standstill.
    fn current(&self) -> f64 {
        if !self.is_powered() {
            return 0.0;
        }
        let rated = self.rated_current();
        let delay = Duration::from_millis(self.value(0x2001, 2) as u64);
        if self.now.saturating_since(self.stands_since) < delay {
            return rated;
        }
        let unit = match self.policies.standby_unit {
            StandbyUnit::Percent => 0.01,
            StandbyUnit::Thousandths => 0.001,
        };
        rated * self.value(0x2001, 1) * unit
    }

    /// 6075h, A rms.
    fn rated_current(&self) -> f64 {
        self.value(0x6075, 0) * 1e-3
    }

    fn profile_step(&mut self) {
        self.change_state();
        self.watch_homing_input();
        self.limit_reached = self.is_active(LOWER_LIMIT) || self.is_active(UPPER_LIMIT);
        if self.is_powered() {
            self.step_mode();
            self.move_demand();
            self.monitor();
        }
        if self.motion != Motion::Hold {
            self.stands_since = self.now;
        }
    }

    fn move_demand(&mut self) {
        let ramp = &mut self.ramp;
        let has_arrived = match self.motion {
            Motion::Hold => {
                ramp.velocity = 0.0;
                false
            }
            Motion::Stop(deceleration) => ramp.brake(deceleration, PROFILE_STEP),
            Motion::Velocity(velocity, limits) => {
                ramp.towards_velocity(velocity, &limits, PROFILE_STEP) && velocity == 0.0
            }
            Motion::Position(target, limits) => {
                ramp.towards_position(target, &limits, PROFILE_STEP)
            }
        };
        if has_arrived {
            self.motion = Motion::Hold;
        }
    }

    fn monitor(&mut self) {
        if self.braking && self.motion == Motion::Hold {
            self.braking = false;
            if self.state == State::FaultReactionActive {
                self.enter(State::Fault);
            }
        } else if !self.braking {
            self.watch_switches();
        }
    }

    /// Brings the demand to rest with a deceleration in steps/s².
    pub(super) fn stop(&mut self, deceleration: f64) {
        if self.motion != Motion::Hold {
            self.motion = Motion::Stop(deceleration);
        }
    }

    /// The present position becomes `position` steps: demand and encoder count from there.
    pub(super) fn count_from(&mut self, position: f64) {
        let scale = 1.0 / self.steps_per_revolution();
        self.origin += (self.ramp.position - position) * scale;
        self.encoder_zero = self.shaft.position() - position * scale;
        self.ramp = Ramp::at(position);
        self.target = position;
    }

    /// Scale or direction have changed, which makes every position invalid (518): it is 0.
    pub(super) fn rescale(&mut self) {
        self.ramp = Ramp::at(0.0);
        self.origin = self.shaft.position();
        self.encoder_zero = self.shaft.position();
        self.is_referenced = false;
        self.target = 0.0;
    }

    /// Steps that the rotor is behind its field; whole pole pairs of it are lost.
    pub(super) fn lag(&self) -> f64 {
        let steps = self.steps_per_revolution();
        let field = self.origin + self.ramp.position / steps;
        (field - self.shaft.position()) * steps
    }

    // ---- states (141-180) ----

    pub(super) fn enter(&mut self, state: State) {
        if state == self.state {
            return;
        }
        let was_powered = self.is_powered();
        self.state = state;
        if self.is_powered() && !was_powered {
            // The windings take the rotor as they find it: what it was turned by meanwhile nobody
            // knows without an encoder.
            self.origin = self.shaft.position() - self.ramp.position / self.steps_per_revolution();
            self.motion = Motion::Hold;
            self.stands_since = self.now;
        }
        if was_powered && !self.is_powered() {
            self.end_movement();
            self.motion = Motion::Hold;
            self.ramp.velocity = 0.0;
            self.braking = false;
        }
    }

    fn change_state(&mut self) {
        match self.state {
            State::NotReadyToSwitchOn => self.enter(State::SwitchOnDisabled),
            State::ReadyToSwitchOn | State::SwitchedOn if !self.has_mains => {
                self.enter(State::SwitchOnDisabled);
            }
            state if state.is_powered() && !self.has_mains => {
                self.raise(ErrorClass::SwitchOff, register::VOLTAGE);
            }
            _ => {}
        }
    }

    pub(super) fn command(&mut self, word: Controlword) {
        let previous = core::mem::replace(&mut self.controlword, word);
        if word.resets_fault(previous) && self.state == State::Fault && !self.cause_persists {
            self.error_register = 0;
            self.enter(State::SwitchOnDisabled);
        }
        if matches!(self.state, State::FaultReactionActive | State::Fault) {
            return;
        }
        if let Some(command) = word.command() {
            self.transit(command);
        }
        self.command_mode(previous);
    }

    fn transit(&mut self, command: Command) {
        let lacks_enable =
            self.is_assigned(super::signals::ENABLE) && !self.is_active(super::signals::ENABLE);
        let to = match (command, self.state) {
            (Command::Shutdown, State::SwitchOnDisabled) if !self.has_mains => None,
            (Command::EnableOperation, _) if lacks_enable => None,
            (Command::EnableOperation, State::ReadyToSwitchOn)
                if !self.policies.enables_at_once =>
            {
                None
            }
            (command, state) => commanded(state, command),
        };
        match (self.state, to) {
            (_, None) => {}
            // It stays in Quick Stop Active until commanded (transitions 11, 12, 16).
            (_, Some(State::QuickStopActive)) => {
                self.enter(State::QuickStopActive);
                self.quick_stop();
            }
            (_, Some(to)) => {
                self.braking = false;
                self.enter(to);
            }
        }
    }

    /// Brakes with 6085h, or with 6084h where that is 0.
    fn quick_stop(&mut self) {
        self.end_movement();
        self.braking = true;
        let deceleration = match self.value(0x6085, 0) {
            0.0 => self.value(0x6084, 0),
            own => own,
        };
        self.stop(deceleration);
    }

    /// An error that the register 1001h tells by a bit besides its first.
    pub(super) fn raise(&mut self, class: ErrorClass, bit: u8) {
        if class == ErrorClass::Warning || self.error_register != 0 {
            return;
        }
        self.error_register = register::GENERIC | bit;
        if self.is_powered() && class <= ErrorClass::StopAndSwitchOff {
            self.enter(State::FaultReactionActive);
            self.quick_stop();
        } else {
            self.enter(State::Fault);
        }
    }

    /// The control supply was gone or the node was reset: nothing is kept but an error.
    pub(super) fn restart(&mut self) {
        if !matches!(self.state, State::Fault | State::FaultReactionActive) {
            self.enter(State::NotReadyToSwitchOn);
        }
        self.controlword = Controlword(0);
        self.mode = Mode::ProfilePosition;
        self.rescale();
    }

    // ---- objects ----

    /// 6041h (645-657).
    pub(super) fn statusword(&self) -> Statusword {
        let state = match self.state {
            State::NotReadyToSwitchOn => 0x0000,
            State::SwitchOnDisabled => 0x0040,
            state => state.bits(),
        };
        let (bit_12, bit_13) = self.mode_bits();
        let flags = [
            (self.is_powered(), Statusword::VOLTAGE_ENABLED),
            (true, Statusword::REMOTE),
            (self.target_reached, Statusword::TARGET_REACHED),
            (self.limit_reached, Statusword::INTERNAL_LIMIT),
            (bit_12, Statusword::MODE_12),
            (bit_13, Statusword::BIT_13),
        ];
        Statusword::of(state, &flags)
    }

    /// Actual position and velocity: the rotor's where 608Fh:1 says that there is an encoder, the
    /// demand's otherwise (508, 709).
    fn actual(&self) -> (f64, f64) {
        let counts = self.value(0x608F, 1);
        if counts == 0.0 {
            return (self.ramp.position, self.ramp.velocity);
        }
        let steps = self.steps_per_revolution();
        let turned = self.shaft.position() - self.encoder_zero;
        let counted = (turned * counts).floor() / counts;
        (counted * steps, self.shaft.velocity() * steps)
    }

    /// Brings the objects that show the controller's condition up to date.
    pub(super) fn publish(&mut self) {
        let (position, velocity) = self.actual();
        for (index, sub, value) in [
            (0x1001, 0, self.error_register.into()),
            (0x1002, 0, self.manufacturer_status().into()),
            (0x6041, 0, self.statusword().0.into()),
            (0x6061, 0, self.mode as i64),
            (0x6062, 0, nearest(self.ramp.position)),
            (0x6064, 0, nearest(position)),
            (0x606C, 0, nearest(velocity / self.velocity_unit())),
        ] {
            self.objects.put(index, sub, value);
        }
    }
}
