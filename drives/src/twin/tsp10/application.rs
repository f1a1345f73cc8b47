//! What the CANopen node asks of the controller.

use super::drive::Drive;
use super::homing::is_method;
use super::modes::Mode;
use super::policy::TPdoTrigger;
use crate::twin::device::Disturbance;
use crate::twin::node::Firmware;
use crate::twin::servo::shaft::Shaft;
use syncline_canopen::cia402::{Controlword, State};
use syncline_canopen::dictionary::{Dictionary, Row};
use syncline_canopen::emcy::{Emergency, register};
use syncline_canopen::node::{Application, CommunicationError, Origin};
use syncline_canopen::sdo::AbortCode;
use syncline_canopen::{CobId, Frame, Instant, nmt};

impl Application for Drive {
    fn objects(&self) -> &Dictionary {
        &self.objects
    }

    fn objects_mut(&mut self) -> &mut Dictionary {
        &mut self.objects
    }

    fn refresh(&mut self, _: Instant, _: Option<Row>) {
        if core::mem::take(&mut self.stale) {
            self.publish();
        }
    }

    fn check_write(&self, row: Row, value: i64, origin: Origin) -> Result<(), AbortCode> {
        let address = self.objects.entry(row).address;
        self.tampering.check_write(address, origin)?;
        match address.index {
            0x6060 if Mode::of(value).is_none() => Err(AbortCode::InvalidValue),
            0x6098 if !is_method(value) => Err(AbortCode::InvalidValue),
            0x6092 if value == 0 => Err(AbortCode::InvalidValue),
            // What the profile counts by does not change under it, an assumption.
            0x2002 | 0x6092 if self.is_powered() => Err(AbortCode::DeviceState),
            _ => Ok(()),
        }
    }

    fn written(&mut self, _: Instant, row: Row, _: Origin) {
        self.stale = true;
        let value = self.objects.get(row);
        match self.objects.entry(row).address.index {
            0x2002 | 0x6092 => self.rescale(),
            0x6040 => self.command(Controlword(value as u16)),
            0x6060 => self.change_mode(),
            // Its second subindex is the same (888).
            0x6099 => {
                self.objects.put(0x6099, 2, value);
            }
            0x60FF => self.run(),
            _ => {}
        }
    }

    fn on_reset(&mut self, _: Instant, reset: nmt::Event) {
        self.tampering.show(&mut self.objects);
        if reset == nmt::Event::ResetNode {
            self.restart();
        }
        self.stale = true;
    }

    /// No emergency is described.
    fn on_communication_error(&mut self, _: Instant, _: CommunicationError) -> Option<Emergency> {
        None
    }

    fn next_event(&mut self) -> Option<Row> {
        let TPdoTrigger::Period(period) = self.policies.t_pdo else {
            return None;
        };
        if self.now < self.next_period {
            return None;
        }
        self.next_period = self.now + period;
        self.objects.row(0x6041, 0)
    }

    /// The statusword is the first object of both.
    fn event_mask(&self, _: u16) -> u64 {
        match self.policies.t_pdo {
            TPdoTrigger::Value => u64::MAX,
            TPdoTrigger::Status | TPdoTrigger::Period(_) => 1,
        }
    }
}

impl Firmware for Drive {
    fn run_until(&mut self, now: Instant) {
        self.advance(now);
        self.stale = true;
    }

    /// Nothing holds the shaft, and every error is forgotten.
    fn power_off(&mut self) {
        self.enter(State::NotReadyToSwitchOn);
        self.error_register = 0;
    }

    fn shaft(&self) -> Option<&Shaft> {
        Some(&self.shaft)
    }

    fn shaft_mut(&mut self) -> Option<&mut Shaft> {
        Some(&mut self.shaft)
    }

    fn is_powered(&self) -> bool {
        self.state.is_powered()
    }

    fn torque(&self) -> f64 {
        self.torque
    }

    fn disturb(&mut self, disturbance: Disturbance) {
        match disturbance {
            Disturbance::Mains(on) => self.has_mains = on,
            Disturbance::Fault(class) => self.raise(class, register::MANUFACTURER),
            Disturbance::FaultPersists(persists) => self.cause_persists = persists,
            Disturbance::FoundEnabled => self.enter(State::OperationEnabled),
            Disturbance::RefuseWrite(address, code) => self.tampering.refuse(address, code),
            Disturbance::AcceptWrites => self.tampering.accept(),
            Disturbance::Vendor(id) => self.tampering.preset_vendor(&mut self.objects, id),
            Disturbance::Input(input, on) => {
                let bit = 1u16.checked_shl(input.into()).unwrap_or(0);
                self.inputs = self.inputs & !bit | if on { bit } else { 0 };
            }
            // It has no other channel, and switches on at once.
            _ => {}
        }
    }

    fn hears(&self, frame: &Frame) -> bool {
        let guards = frame.is_remote() && frame.id() == CobId::error_control(self.node).into();
        !guards || self.policies.answers_guarding
    }
}
