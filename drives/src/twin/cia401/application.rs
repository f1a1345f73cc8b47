//! What the CANopen node asks of the module.

use super::module::Module;
use crate::twin::device::{Disturbance, ErrorClass};
use crate::twin::node::Firmware;
use syncline_canopen::dictionary::{Dictionary, Row};
use syncline_canopen::emcy::{self, Emergency, register};
use syncline_canopen::node::{Application, CommunicationError, Origin};
use syncline_canopen::sdo::AbortCode;
use syncline_canopen::{Instant, nmt};

impl Application for Module {
    fn objects(&self) -> &Dictionary {
        &self.objects
    }

    fn objects_mut(&mut self) -> &mut Dictionary {
        &mut self.objects
    }

    fn refresh(&mut self, now: Instant, row: Option<Row>) {
        self.advance(now);
        self.publish();
        if row.is_some_and(|row| self.objects.entry(row).address.index == 0x6422) {
            self.show_sources();
        }
    }

    fn check_write(&self, row: Row, _: i64, origin: Origin) -> Result<(), AbortCode> {
        let address = self.objects.entry(row).address;
        self.tampering.check_write(address, origin)
    }

    fn written(&mut self, _: Instant, row: Row, _: Origin) {
        Module::written(self, row);
    }

    fn on_nmt(&mut self, _: Instant, event: nmt::Event) {
        if event == nmt::Event::Entered(nmt::State::Stopped) {
            self.fall_back();
        }
    }

    fn on_reset(&mut self, _: Instant, reset: nmt::Event) {
        if reset == nmt::Event::ResetNode {
            self.power_off();
        }
        self.tampering.show(&mut self.objects);
    }

    fn on_communication_error(
        &mut self,
        _: Instant,
        error: CommunicationError,
    ) -> Option<Emergency> {
        let (code, number) = match error {
            CommunicationError::ShortPdo(number) => (emcy::code::PDO_TOO_SHORT, number as u8),
            CommunicationError::Heartbeat(_) | CommunicationError::LifeGuarding => {
                self.fall_back();
                (emcy::code::LIFE_GUARD_OR_HEARTBEAT, 0)
            }
        };
        Some(Emergency {
            code,
            register: register::GENERIC | register::COMMUNICATION,
            vendor: [0, 0, number, 0, 0],
        })
    }

    fn next_emergency(&mut self) -> Option<Emergency> {
        Module::next_emergency(self)
    }

    fn next_event(&mut self) -> Option<Row> {
        Module::next_event(self)
    }

    fn event_mask(&self, number: u16) -> u64 {
        Module::event_mask(self, number)
    }
}

impl Firmware for Module {
    fn run_until(&mut self, now: Instant) {
        self.advance(now);
    }

    fn outputs(&self) -> u16 {
        self.outputs
    }

    fn power_off(&mut self) {
        Module::power_off(self);
    }

    fn disturb(&mut self, disturbance: Disturbance) {
        match disturbance {
            Disturbance::Input(input, level) => self.set_input(input, level),
            Disturbance::Fault(class) if class > ErrorClass::Warning => self.fail(true),
            Disturbance::FaultPersists(false) => self.fail(false),
            Disturbance::RefuseWrite(address, code) => self.tampering.refuse(address, code),
            Disturbance::AcceptWrites => self.tampering.accept(),
            Disturbance::Vendor(id) => self.tampering.preset_vendor(&mut self.objects, id),
            // It has no power stage, no motor and no other channel.
            _ => {}
        }
    }
}
