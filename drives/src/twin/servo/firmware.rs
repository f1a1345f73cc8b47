//! What the firmware of all servo drives here has, and what it answers its node.
//!
//! With it comes the state machine of CiA 402: the way on and off, quick stop, errors by their class and
//! their reset. What makers do each in their own way are the required methods of [`ServoFirmware`] and those
//! that do nothing unless a drive says so.

use super::cascade::{Gains, Reference};
use super::errors::{Errors, ServoError};
use super::lasting::Lasting;
use super::loops::Loops;
use super::power_stage::PowerStage;
use super::shaft::Shaft;
use super::velocity::VelocityMeter;
use crate::twin::cia402::commanded;
use crate::twin::device::{Disturbance, ErrorClass};
use crate::twin::node::{Firmware, Tampering};
use syncline_canopen::Instant;
use syncline_canopen::cia402::{Command, Controlword, State};
use syncline_canopen::node::Application;
use syncline_canopen::time::Duration;

/// The part of a turn per second below which the motor counts as standing (10 r/min).
const STANDSTILL: f64 = 1.0 / 6.0;

/// How long the motor may turn on when what brakes it has led its reference to rest, until its power stage goes off
/// nevertheless: an assumption.
const BRAKING_ENDS: Duration = Duration::from_millis(500);

/// What every servo drive has, whoever made it; `E` are the errors of its maker.
pub struct Servo<E> {
    /// Until when its loops have run.
    pub now: Instant,
    /// Of CiA 402.
    pub state: State,
    /// Since when.
    pub state_since: Instant,
    /// When the power stage is on that is being switched on.
    pub enable_at: Option<Instant>,
    /// From the command to enable until then.
    pub enable_time: Duration,
    /// It brakes by itself: quick stop or fault reaction.
    pub braking: bool,
    /// The reference has come to rest by that.
    rests: Lasting,
    /// Whether an EMCY tells that an error has been reset.
    pub tells_reset: bool,
    /// The last one.
    pub controlword: Controlword,
    /// Whether the power stage has its supply.
    pub has_mains: bool,
    /// Whether the fieldbus has control, not another access channel.
    pub remote: bool,
    /// Whether the cause of an error is still there, so that its reset is in vain.
    pub cause_persists: bool,
    /// What is wrong with it.
    pub errors: Errors<E>,
    /// Its loops, with the shaft that they turn.
    pub loops: Loops,
    /// How fast that turns, as measured.
    pub velocity: VelocityMeter,
    /// The objects do not show the present condition yet.
    pub stale: bool,
    /// What has been changed about its objects.
    pub tampering: Tampering,
}

impl<E: ServoError> Servo<E> {
    /// One that has just been switched on, in the state that it shows first.
    #[must_use]
    pub fn new(loops: Loops, state: State, enable_time: Duration, tells_reset: bool) -> Self {
        Self {
            enable_time,
            braking: false,
            rests: Lasting::default(),
            tells_reset,
            velocity: VelocityMeter::at(loops.encoder),
            now: Instant::ZERO,
            state,
            state_since: Instant::ZERO,
            enable_at: None,
            controlword: Controlword(0),
            has_mains: true,
            remote: true,
            cause_persists: false,
            errors: Errors::new(),
            loops,
            stale: true,
            tampering: Tampering::default(),
        }
    }

    /// Whether the motor stands, as measured.
    #[must_use]
    pub fn stands(&self) -> bool {
        self.velocity.velocity().abs() < STANDSTILL * self.loops.increments_per_revolution
    }

    /// Whether its braking is over, while its reference rests or does not: the motor stands, or nothing stops it.
    pub fn has_braked(&mut self, rests: bool) -> bool {
        let rested = (self.rests).for_time(BRAKING_ENDS, self.now, rests && self.braking);
        self.braking && rests && (self.stands() || rested)
    }

    fn is_stopped_by_error(&self) -> bool {
        matches!(self.state, State::FaultReactionActive | State::Fault)
    }
}

/// The firmware of a servo drive: what makers do each in their own way. The rest of a [`Firmware`] follows
/// from it.
pub trait ServoFirmware: Application {
    /// Its maker's errors.
    type Error: ServoError;

    /// What it has as all of them.
    fn servo(&self) -> &Servo<Self::Error>;

    /// The same, to change it.
    fn servo_mut(&mut self) -> &mut Servo<Self::Error>;

    /// What its loops follow.
    fn loop_reference(&self) -> Reference;

    /// Whether the holding brake is to grip although the power stage is on.
    fn brake_grips(&self) -> bool {
        false
    }

    /// Runs what runs as often as its position loop, and before it: state machine, profiles, monitoring.
    /// `step` counts the steps of the speed loop since the cycle began.
    fn position_step(&mut self, step: u32);

    /// The torque that its loops may ask for, Nm.
    fn torque_limit(&self) -> f64 {
        self.servo().loops.torque_source.torque_limit()
    }

    /// The last step of a cycle is done.
    fn end_cycle(&mut self) {}

    /// The power stage has gone on.
    fn switched_on(&mut self);

    /// The power stage has gone off.
    fn switched_off(&mut self);

    /// Brakes with the quick stop ramp; what moves by command is over.
    fn brake(&mut self);

    /// How it reacts to an error of a class.
    fn reaction(&self, class: ErrorClass) -> ErrorClass {
        class
    }

    /// A warning has been raised.
    fn warned(&mut self, warning: Self::Error);

    /// An error stops it: what a maker has besides to show that.
    fn failed(&mut self, _: Self::Error) {}

    /// Warnings are to be forgotten.
    fn forget_warnings(&mut self) {}

    /// An error has been reset.
    fn error_reset(&mut self) {}

    /// The control supply is gone: what not every servo drive has is forgotten as well.
    fn forget_own(&mut self) {}

    /// Interferes with what not every servo drive has, or not in the same way.
    fn disturb_own(&mut self, disturbance: Disturbance);

    /// As [`Firmware::touch`].
    fn touch_own(&mut self, input: u8, on: bool, _place: f64) {
        self.disturb_own(Disturbance::Input(input, on));
    }

    /// As [`Firmware::outputs`].
    fn outputs_own(&self) -> u16 {
        0
    }

    /// Runs the next step of the position loop, if it is due, and those of the speed loop that follow and end until then.
    fn step(&mut self, until: Instant) {
        if self.servo().loops.clock.is_position_step() {
            let servo = self.servo_mut();
            let (step, _) = servo.loops.clock.step();
            servo.now = servo.loops.clock.step_end();
            servo.velocity.take(servo.loops.encoder);
            self.position_step(step);
            let (reference, limit) = (self.loop_reference(), self.torque_limit());
            self.servo_mut().loops.position_step(reference, limit);
        }
        // What kind the reference is of, and which torque it is, stays until the position loop's next step.
        let (reference, grips) = (self.loop_reference(), self.brake_grips());
        let loops = &mut self.servo_mut().loops;
        if loops.speed_steps(reference, grips, until) {
            self.end_cycle();
        }
    }

    /// Enters a state, with all that goes with it.
    fn enter(&mut self, state: State) {
        let servo = self.servo_mut();
        let before = core::mem::replace(&mut servo.state, state);
        if state == before {
            return;
        }
        servo.state_since = servo.now;
        servo.enable_at = None;
        match (before.is_powered(), state.is_powered()) {
            (false, true) => {
                servo.loops.cascade.reset();
                self.switched_on();
            }
            (true, false) => {
                servo.braking = false;
                self.switched_off();
            }
            _ => {}
        }
    }

    /// The changes that need no command: the power stage is on (T4), or its supply fails.
    fn watch_power(&mut self) {
        let servo = self.servo();
        if servo.state.is_powered() {
            let power_stage = servo.loops.torque_source.power_stage();
            if !servo.has_mains {
                self.raise(Self::Error::UNDERVOLTAGE);
            } else if power_stage.is_some_and(PowerStage::has_overvoltage) {
                self.raise(Self::Error::OVERVOLTAGE);
            }
        } else if servo.state == State::SwitchedOn {
            if !servo.has_mains {
                self.servo_mut().enable_at = None;
            } else if servo.enable_at.is_some_and(|at| servo.now >= at) {
                self.enter(State::OperationEnabled);
            }
        }
    }

    /// Takes a controlword, whose rising bit 7 resets an error. Gives the word before, or `None` while an
    /// error stops the drive, so that it follows no command.
    fn take(&mut self, word: Controlword) -> Option<Controlword> {
        let previous = core::mem::replace(&mut self.servo_mut().controlword, word);
        if word.resets_fault(previous) {
            self.reset_error();
        }
        (!self.servo().is_stopped_by_error()).then_some(previous)
    }

    /// Follows a command, where it means something. Without a supply the power stage is not switched on.
    fn follow(&mut self, command: Command) {
        let servo = self.servo();
        let Some(to) = commanded(servo.state, command) else {
            return;
        };
        match (servo.state, to) {
            (_, State::QuickStopActive) => self.quick_stop(),
            (State::QuickStopActive, State::OperationEnabled) => {
                if servo.errors.active().is_none() {
                    self.enter(to);
                    self.servo_mut().braking = false;
                }
            }
            (_, State::OperationEnabled) => {
                self.enter(State::SwitchedOn);
                let servo = self.servo_mut();
                if servo.has_mains {
                    let enabled = servo.now + servo.enable_time;
                    servo.enable_at.get_or_insert(enabled);
                }
            }
            _ => self.enter(to),
        }
    }

    /// T11.
    fn quick_stop(&mut self) {
        self.brake_in(State::QuickStopActive);
    }

    /// Enters a state in which it brakes by itself.
    fn brake_in(&mut self, state: State) {
        self.enter(state);
        self.servo_mut().braking = true;
        self.brake();
    }

    /// What brakes by itself has come to rest (T14).
    fn end_braking(&mut self) {
        self.servo_mut().braking = false;
        if self.servo().state == State::FaultReactionActive {
            self.enter(State::Fault);
        }
    }

    /// Raises an error and reacts as its class says (T13). The first one is the one to tell, unless a worse
    /// one follows.
    fn raise(&mut self, error: Self::Error) {
        if error.class() == ErrorClass::Warning {
            self.warned(error);
            return;
        }
        let servo = self.servo_mut();
        if servo.errors.active_class() >= Some(error.class()) {
            return;
        }
        servo.errors.begin(error);
        self.failed(error);
        let is_powered = self.servo().state.is_powered();
        match self.reaction(error.class()) {
            ErrorClass::QuickStop if is_powered => self.quick_stop(),
            ErrorClass::StopAndSwitchOff if is_powered => self.brake_in(State::FaultReactionActive),
            _ => self.enter(State::Fault),
        }
    }

    /// Resets warnings, and the error whose cause is gone (T15).
    fn reset_error(&mut self) {
        self.forget_warnings();
        let servo = self.servo_mut();
        let is_in_vain = servo.cause_persists || servo.state == State::FaultReactionActive;
        match servo.errors.active_class() {
            None | Some(ErrorClass::Fatal) => return,
            Some(_) if is_in_vain => return,
            Some(_) => servo.errors.reset(servo.tells_reset),
        }
        self.error_reset();
        if self.servo().state == State::Fault {
            self.enter(State::SwitchOnDisabled);
        }
    }
}

impl<D: ServoFirmware> Firmware for D {
    fn run_until(&mut self, now: Instant) {
        while self.servo().loops.clock.step_end() <= now {
            self.step(now);
        }
        let servo = self.servo_mut();
        servo.now = now;
        servo.stale = true;
    }

    /// Nothing drives the shaft, and every error is forgotten.
    fn power_off(&mut self) {
        self.enter(State::NotReadyToSwitchOn);
        let servo = self.servo_mut();
        servo.errors = Errors::new();
        servo.cause_persists = false;
        self.forget_own();
    }

    fn shaft(&self) -> Option<&Shaft> {
        Some(&self.servo().loops.shaft)
    }

    fn shaft_mut(&mut self) -> Option<&mut Shaft> {
        Some(&mut self.servo_mut().loops.shaft)
    }

    fn is_powered(&self) -> bool {
        self.servo().state.is_powered()
    }

    fn torque(&self) -> f64 {
        self.servo().loops.torque()
    }

    fn gains(&self) -> Option<&Gains> {
        Some(self.servo().loops.cascade.gains())
    }

    fn power_stage(&self) -> Option<&PowerStage> {
        self.servo().loops.torque_source.power_stage()
    }

    fn power_stage_mut(&mut self) -> Option<&mut PowerStage> {
        self.servo_mut().loops.torque_source.power_stage_mut()
    }

    fn disturb(&mut self, disturbance: Disturbance) {
        let servo = self.servo_mut();
        match disturbance {
            Disturbance::Mains(on) => {
                servo.has_mains = on;
                servo.loops.torque_source.feed(on);
            }
            Disturbance::FaultPersists(persists) => servo.cause_persists = persists,
            Disturbance::RefuseWrite(address, code) => servo.tampering.refuse(address, code),
            Disturbance::AcceptWrites => servo.tampering.accept(),
            Disturbance::FoundEnabled => {
                servo.controlword = Controlword::ENABLE_OPERATION;
                self.enter(State::OperationEnabled);
            }
            Disturbance::Fault(class) => self.raise(D::Error::of(class)),
            Disturbance::EnableTime(time) => servo.enable_time = time,
            own => self.disturb_own(own),
        }
    }

    fn touch(&mut self, input: u8, on: bool, place: f64) {
        self.touch_own(input, on, place);
    }

    fn outputs(&self) -> u16 {
        self.outputs_own()
    }
}
