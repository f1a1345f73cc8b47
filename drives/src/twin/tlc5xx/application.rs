//! What the CANopen node asks of the drive.

use super::drive::Drive;
use super::fault::DriveError;
use crate::twin::servo::firmware::ServoFirmware;
use syncline_canopen::cia402::{Controlword, State};
use syncline_canopen::dictionary::{Dictionary, Row};
use syncline_canopen::emcy::Emergency;
use syncline_canopen::node::{Application, CommunicationError, Origin};
use syncline_canopen::sdo::AbortCode;
use syncline_canopen::{Address, Instant, nmt};

impl Application for Drive {
    fn objects(&self) -> &Dictionary {
        &self.objects
    }

    fn objects_mut(&mut self) -> &mut Dictionary {
        &mut self.objects
    }

    fn refresh(&mut self, now: Instant, _: Option<Row>) {
        if core::mem::take(&mut self.servo.stale) {
            self.publish(now);
        }
    }

    fn check_read(&self, row: Row) -> Result<(), AbortCode> {
        match self.objects.entry(row).address {
            // The "compatibility entry" (7750-7751).
            Address {
                index: 0x1400..=0x1403 | 0x1800..=0x1803,
                sub: 4,
            } => Err(AbortCode::UnsupportedAccess),
            _ => Ok(()),
        }
    }

    fn check_write(&self, row: Row, value: i64, origin: Origin) -> Result<(), AbortCode> {
        let address = self.objects.entry(row).address;
        self.servo.tampering.check_write(address, origin)?;
        self.check_read(row)?;
        self.check_communication(address, value)?;
        self.check_parameter(address, value)
    }

    fn written(&mut self, _: Instant, row: Row, origin: Origin) {
        self.servo.stale = true;
        let address = self.objects.entry(row).address;
        if address.index >= 0x2000 {
            self.parameter_written(address, origin);
        }
    }

    fn on_nmt(&mut self, _: Instant, event: nmt::Event) {
        self.nmt_state = match event {
            nmt::Event::Entered(state) => state,
            nmt::Event::ResetNode | nmt::Event::ResetCommunication => nmt::State::Initialising,
        };
    }

    fn on_reset(&mut self, _: Instant, reset: nmt::Event) {
        self.nmt_state = nmt::State::PreOperational;
        self.servo.tampering.show(&mut self.objects);
        // The default printed is 1 (D-31), but there is no error.
        self.objects.put(0x1003, 0, 0);
        if reset == nmt::Event::ResetNode {
            self.restart();
        }
        self.settle_parameters();
        self.servo.stale = true;
    }

    fn on_communication_error(
        &mut self,
        _: Instant,
        error: CommunicationError,
    ) -> Option<Emergency> {
        match error {
            // Not described.
            CommunicationError::ShortPdo(_) => {}
            CommunicationError::Heartbeat(_) | CommunicationError::LifeGuarding => {
                self.raise(DriveError::CONNECTION_LOST);
            }
        }
        None
    }

    /// The manual names no change of the NMT state (7264-7266, D-40).
    fn state_after_loss(&self, state: nmt::State) -> nmt::State {
        state
    }

    fn next_emergency(&mut self) -> Option<Emergency> {
        self.servo.errors.next_emergency()
    }

    /// T_PDO4 is sent on a change of the state word, its third object (1532).
    fn event_mask(&self, number: u16) -> u64 {
        if number == 4 { 1 << 2 } else { u64::MAX }
    }
}

impl Drive {
    /// The application starts anew; an error stays.
    fn restart(&mut self) {
        if !matches!(self.servo.state, State::Fault | State::FaultReactionActive) {
            self.enter(State::NotReadyToSwitchOn);
        }
        self.servo.controlword = Controlword(0);
        self.zero = 0;
        self.is_referenced = false;
        self.latched_signals = 0;
        self.overrun = false;
        self.has_warning = false;
        self.movement_failed = false;
        self.begun = 0;
    }

    /// 1xxxh: what the state of the node and of other objects permits.
    fn check_communication(&self, address: Address, value: i64) -> Result<(), AbortCode> {
        let Address { index, sub } = address;
        let in_pre_operational = match index {
            0x1005 | 0x1014 => true,
            // Switching a PDO on or off has no such rule (1577).
            0x1400..=0x1403 | 0x1800..=0x1803 if sub == 1 => {
                let before = self.objects.value(index, 1).unwrap_or(0);
                (before ^ value) & 0x780 != 0
            }
            0x1600..=0x1603 | 0x1A00..=0x1A03 => true,
            _ => false,
        };
        if in_pre_operational
            && self.nmt_state == nmt::State::Operational
            && !self.policies.parameters_in_operational
        {
            return Err(AbortCode::DeviceState);
        }
        // Heartbeat and guarding must not be used at the same time (2237-2245).
        let is_on = |index| self.objects.value(index, 0).unwrap_or(0) > 0;
        let excluded = match index {
            0x1017 => is_on(0x100C) && is_on(0x100D),
            0x100C => is_on(0x100D) && is_on(0x1017),
            0x100D => is_on(0x100C) && is_on(0x1017),
            _ => false,
        };
        if excluded && value > 0 {
            return Err(AbortCode::ParameterIncompatible);
        }
        Ok(())
    }
}
