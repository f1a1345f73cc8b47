//! What the CANopen node asks of the drive behind it.

use super::drive::Drive;
use super::settings::Settings;
use crate::twin::node::Firmware;
use crate::twin::servo::option_codes::ByOptionCodes;
use syncline_canopen::cia402::Controlword;
use syncline_canopen::dictionary::{Dictionary, Row};
use syncline_canopen::emcy::{Emergency, code, register};
use syncline_canopen::node::{Application, CommunicationError, Origin};
use syncline_canopen::sdo::AbortCode;
use syncline_canopen::sync::Sync;
use syncline_canopen::{Instant, nmt};

impl Application for Drive {
    fn objects(&self) -> &Dictionary {
        &self.objects
    }

    fn objects_mut(&mut self) -> &mut Dictionary {
        &mut self.objects
    }

    fn refresh(&mut self, now: Instant, row: Option<Row>) {
        // What can be written is what was written.
        let settled = row.is_some_and(|row| self.objects.entry(row).access.writable());
        if !settled && core::mem::take(&mut self.servo.stale) {
            self.publish(now);
        }
    }

    fn check_write(&self, row: Row, value: i64, origin: Origin) -> Result<(), AbortCode> {
        let address = self.objects.entry(row).address;
        self.servo.tampering.check_write(address, origin)?;
        match address.index {
            0x6040 if !self.servo.remote => Err(AbortCode::LocalControl),
            0x6060 if value != 0 && value != self.mode => Err(AbortCode::InvalidValue),
            0x60C2 if self.is_operational && self.policies.period_before_operational => {
                Err(AbortCode::DeviceState)
            }
            _ => Ok(()),
        }
    }

    fn written(&mut self, _: Instant, row: Row, _: Origin) {
        self.servo.stale = true;
        self.settings = Settings::of(&self.objects);
        match self.objects.entry(row).address.index {
            0x6040 => self.command(Controlword(self.objects.get(row) as u16)),
            0x6060 => self.mode_changed(),
            _ => {}
        }
    }

    fn on_sync(&mut self, now: Instant, _: Sync) {
        self.servo.stale = true;
        Drive::on_sync(self, now);
    }

    fn on_nmt(&mut self, _: Instant, event: nmt::Event) {
        self.is_operational = event == nmt::Event::Entered(nmt::State::Operational);
        let aborts = match event {
            nmt::Event::Entered(state) => state == nmt::State::Stopped,
            nmt::Event::ResetNode | nmt::Event::ResetCommunication => true,
        };
        if aborts && self.is_powered() {
            self.abort_connection();
        }
    }

    fn on_reset(&mut self, _: Instant, reset: nmt::Event) {
        self.servo.tampering.show(&mut self.objects);
        self.settings = Settings::of(&self.objects);
        if reset == nmt::Event::ResetNode {
            self.restart();
        }
    }

    fn on_communication_error(
        &mut self,
        _: Instant,
        error: CommunicationError,
    ) -> Option<Emergency> {
        match error {
            CommunicationError::ShortPdo(number) => Some(Emergency {
                code: code::PDO_TOO_SHORT,
                register: register::GENERIC | register::COMMUNICATION,
                vendor: [0, 0, number as u8, 0, 0],
            }),
            CommunicationError::Heartbeat(_) | CommunicationError::LifeGuarding => {
                self.abort_connection();
                None
            }
        }
    }

    fn next_emergency(&mut self) -> Option<Emergency> {
        self.servo.errors.next_emergency()
    }
}
