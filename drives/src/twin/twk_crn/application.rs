//! What the CANopen node asks of the encoder.

use super::encoder::Encoder;
use super::fault::EncoderError;
use crate::twin::device::{Disturbance, ErrorClass};
use crate::twin::node::Firmware;
use crate::twin::servo::shaft::Shaft;
use syncline_canopen::dictionary::{Dictionary, Row};
use syncline_canopen::emcy::Emergency;
use syncline_canopen::node::{Application, CommunicationError, Origin};
use syncline_canopen::sdo::AbortCode;
use syncline_canopen::{Frame, Instant, NodeId, nmt};

impl Application for Encoder {
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

    fn node_id(&self) -> Option<NodeId> {
        Encoder::node_id(self)
    }

    fn check_read(&self, row: Row) -> Result<(), AbortCode> {
        Encoder::check_read(self, row)
    }

    fn check_write(&self, row: Row, value: i64, origin: Origin) -> Result<(), AbortCode> {
        Encoder::check_write(self, row, value, origin)
    }

    fn written(&mut self, _: Instant, row: Row, _: Origin) {
        Encoder::written(self, row);
    }

    fn on_nmt(&mut self, _: Instant, event: nmt::Event) {
        // A master that starts the node is there again.
        if event == nmt::Event::Entered(nmt::State::Operational) {
            self.errors.set(EncoderError::Communication, false);
        }
    }

    fn on_reset(&mut self, _: Instant, reset: nmt::Event) {
        self.show_texts();
        self.errors.restart();
        if reset == nmt::Event::ResetNode {
            self.restart();
        }
    }

    fn on_communication_error(
        &mut self,
        _: Instant,
        error: CommunicationError,
    ) -> Option<Emergency> {
        if error == CommunicationError::LifeGuarding && self.policies.emcy_on_lost_guarding {
            self.errors.set(EncoderError::Communication, true);
        }
        None
    }

    /// From Prepared as well (crn S11).
    fn state_after_loss(&self, _: nmt::State) -> nmt::State {
        nmt::State::PreOperational
    }

    fn next_emergency(&mut self) -> Option<Emergency> {
        self.errors.next_emergency()
    }

    /// The error register (crn S17).
    fn error_field_info(&self, emergency: &Emergency) -> u16 {
        emergency.register.into()
    }

    /// With a cyclic timer (6200h) no change sends a T_PDO (crn S18).
    fn event_mask(&self, _: u16) -> u64 {
        if self.sends_by_clock() { 0 } else { u64::MAX }
    }
}

impl Firmware for Encoder {
    fn run_until(&mut self, now: Instant) {
        self.advance(now);
    }

    fn power_off(&mut self) {}

    fn shaft(&self) -> Option<&Shaft> {
        Some(&self.shaft)
    }

    fn shaft_mut(&mut self) -> Option<&mut Shaft> {
        Some(&mut self.shaft)
    }

    fn disturb(&mut self, disturbance: Disturbance) {
        match disturbance {
            Disturbance::Fault(class) if class > ErrorClass::Warning => {
                self.errors.set(EncoderError::Eeprom, true);
            }
            Disturbance::FaultPersists(persists) if !persists => {
                self.errors.set(EncoderError::Eeprom, false);
            }
            Disturbance::RefuseWrite(address, code) => self.tampering.refuse(address, code),
            Disturbance::AcceptWrites => self.tampering.accept(),
            // It has no power stage, no motor, no other channel, no inputs and no identity object.
            _ => {}
        }
    }

    fn hears(&self, _: &Frame) -> bool {
        self.is_understood()
    }

    fn is_heard(&self) -> bool {
        self.is_understood()
    }
}
