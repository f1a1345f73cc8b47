//! What the firmware of all servo drives here has, and what it answers its node.

use super::cascade::{Reference, SPEED_STEPS};
use super::errors::{Errors, ServoError};
use super::loops::Loops;
use super::shaft::Shaft;
use crate::twin::device::Disturbance;
use crate::twin::node::{Firmware, Tampering};
use syncline_canopen::Instant;
use syncline_canopen::cia402::{Controlword, State};
use syncline_canopen::node::Application;

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
    /// The objects do not show the present condition yet.
    pub stale: bool,
    /// What has been changed about its objects.
    pub tampering: Tampering,
}

impl<E: ServoError> Servo<E> {
    /// One that has just been switched on, in the state that it shows first.
    #[must_use]
    pub fn new(loops: Loops, state: State) -> Self {
        Self {
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

    /// Runs its position loop and what runs as often: state machine, profiles, monitoring. `step` counts
    /// the steps of the speed loop since the cycle began.
    fn position_step(&mut self, step: u32);

    /// The last step of a cycle is done.
    fn end_cycle(&mut self) {}

    /// The power stage has gone on.
    fn switched_on(&mut self);

    /// The power stage has gone off.
    fn switched_off(&mut self);

    /// The control supply is gone: what not every servo drive has is forgotten as well.
    fn forget_own(&mut self) {}

    /// Interferes with what not every servo drive has, or not in the same way.
    fn disturb_own(&mut self, disturbance: Disturbance);

    /// Runs the next step of the speed loop.
    fn step(&mut self) {
        let (step, _) = self.servo().loops.clock.step();
        if step % SPEED_STEPS == 0 {
            let servo = self.servo_mut();
            servo.now = servo.loops.clock.step_end();
            self.position_step(step);
        }
        let reference = self.loop_reference();
        if self.servo_mut().loops.speed_step(reference) {
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
            (true, false) => self.switched_off(),
            _ => {}
        }
    }
}

impl<D: ServoFirmware> Firmware for D {
    fn run_until(&mut self, now: Instant) {
        while self.servo().loops.clock.step_end() <= now {
            self.step();
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

    fn disturb(&mut self, disturbance: Disturbance) {
        let servo = self.servo_mut();
        match disturbance {
            Disturbance::Mains(on) => servo.has_mains = on,
            Disturbance::FaultPersists(persists) => servo.cause_persists = persists,
            Disturbance::RefuseWrite(address, code) => servo.tampering.refuse(address, code),
            Disturbance::FoundEnabled => {
                servo.controlword = Controlword::ENABLE_OPERATION;
                self.enter(State::OperationEnabled);
            }
            own => self.disturb_own(own),
        }
    }
}
