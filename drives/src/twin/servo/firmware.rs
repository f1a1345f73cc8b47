//! What the firmware of all servo drives here has, and what it answers its node.

use super::loops::Loops;
use super::shaft::Shaft;
use crate::twin::device::{Disturbance, ErrorClass};
use crate::twin::node::{Firmware, Tampering};
use syncline_canopen::Instant;
use syncline_canopen::cia402::{Controlword, State};
use syncline_canopen::node::Application;

/// What every servo drive has, whoever made it.
pub struct Servo {
    /// Until when its loops have run.
    pub now: Instant,
    /// Of CiA 402.
    pub state: State,
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
    /// Its loops, with the shaft that they turn.
    pub loops: Loops,
    /// The objects do not show the present condition yet.
    pub stale: bool,
    /// What has been changed about its objects.
    pub tampering: Tampering,
}

impl Servo {
    /// One that has just been switched on, in the state that it shows first.
    #[must_use]
    pub fn new(loops: Loops, state: State) -> Self {
        Self {
            now: Instant::ZERO,
            state,
            enable_at: None,
            controlword: Controlword(0),
            has_mains: true,
            remote: true,
            cause_persists: false,
            loops,
            stale: true,
            tampering: Tampering::default(),
        }
    }
}

/// The firmware of a servo drive: what makers do each in their own way. The rest of a [`Firmware`] follows
/// from it.
pub trait ServoFirmware: Application {
    /// What it has as all of them.
    fn servo(&self) -> &Servo;

    /// The same, to change it.
    fn servo_mut(&mut self) -> &mut Servo;

    /// Runs the next step of the speed loop.
    fn step(&mut self);

    /// Enters a state, with all that goes with it.
    fn enter(&mut self, state: State);

    /// Its monitoring finds an error of this class.
    fn raise_class(&mut self, class: ErrorClass);

    /// No error is active or to be told any more.
    fn forget_errors(&mut self);

    /// Interferes with what not every servo drive has, or not in the same way.
    fn disturb_own(&mut self, disturbance: Disturbance);
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
        self.forget_errors();
        self.servo_mut().cause_persists = false;
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
            Disturbance::Fault(class) => self.raise_class(class),
            Disturbance::FoundEnabled => {
                servo.controlword = Controlword::ENABLE_OPERATION;
                self.enter(State::OperationEnabled);
            }
            own => self.disturb_own(own),
        }
    }
}
