//! What a write to 2xxxh and 6xxxh is permitted to be, and what it does.

use super::{Homing, Mode};
use crate::twin::node::Firmware;
use crate::twin::tlc5xx::drive::Drive;
use crate::twin::tlc5xx::settings::Settings;
use syncline_canopen::Address;
use syncline_canopen::cia402::Controlword;
use syncline_canopen::dictionary::Entry;
use syncline_canopen::node::Origin;
use syncline_canopen::sdo::AbortCode;

/// Objects that command the drive, which a local unit alone may do while it has control.
const COMMANDS: [u16; 16] = [
    0x2040, 0x2090, 0x2092, 0x2093, 0x2095, 0x209D, 0x20A4, 0x20A6, 0x20A8, 0x20A9, 0x20F0, 0x20F6,
    0x6040, 0x6060, 0x607A, 0x60FF,
];

/// Bits of 2008h (9199-9217).
const SAVE_DEVICE: i64 = 1 << 0;
const SAVE_LIST_1: i64 = 1 << 2;
const SAVE_LIST_2: i64 = 1 << 3;
const SAVE_USER: i64 = 1 << 4;

/// Which bit of 2008h keeps a row.
fn kept_by(entry: &Entry) -> i64 {
    match entry.address.index {
        0x2200..=0x2203 => SAVE_LIST_1,
        0x2300..=0x2303 => SAVE_LIST_2,
        0x2020 => SAVE_USER,
        _ => SAVE_DEVICE,
    }
}

impl Drive {
    pub(in crate::twin::tlc5xx) fn check_parameter(
        &self,
        address: Address,
        value: i64,
    ) -> Result<(), AbortCode> {
        let Address { index, sub } = address;
        if !self.servo.remote && COMMANDS.contains(&index) {
            return Err(AbortCode::LocalControl);
        }
        let number = |index| self.objects.value(index, 0).unwrap_or(0);
        match (index, sub) {
            (0x6060, 0) if Mode::of(value).is_none() => Err(AbortCode::InvalidValue),
            (0x6098, 0) if value != 35 && Homing::of_profile(value).is_none() => {
                Err(AbortCode::InvalidValue)
            }
            // 15584-15589.
            (0x6081, 0) if value > number(0x607F) => Err(AbortCode::ValueTooHigh),
            // 10625-10650; 607Dh is the same pair.
            (0x2052, 0) | (0x607D, 2) if value <= number(0x2053) => {
                Err(AbortCode::MaximumBelowMinimum)
            }
            (0x2053, 0) | (0x607D, 1) if value >= number(0x2052) => {
                Err(AbortCode::MaximumBelowMinimum)
            }
            // A factor of nothing means nothing.
            (0x6093, 1 | 2) if value == 0 => Err(AbortCode::InvalidValue),
            // What the loops count by does not change under them, an assumption.
            (0x2045 | 0x6093, _) if self.is_powered() => Err(AbortCode::DeviceState),
            _ => Ok(()),
        }
    }

    /// A value has been written that the tables and [`Self::check_parameter`] permit.
    pub(in crate::twin::tlc5xx) fn parameter_written(&mut self, address: Address, origin: Origin) {
        let Address { index, sub } = address;
        let value = self.objects.value(index, sub).unwrap_or(0);
        self.write_through(address, value);
        self.settle_parameters();
        match index {
            0x2008 => {
                self.objects.put(index, 0, 0);
                self.objects.store(|entry| value & kept_by(entry) != 0);
            }
            0x2009 => self.restore_defaults(value),
            0x2013 => self.forget_peak(),
            0x2019 => self.start_capture(value as u16),
            // It reads as 0: each bit written acts as an edge (10028).
            0x2040 => {
                self.objects.put(index, 0, 0);
                self.command_manufacturer(value);
            }
            0x2043 => {
                self.objects.put(0x2070, 0, value.max(1));
            }
            // Any write continues an interrupted positioning (12142).
            0x2093 if self.may_move() => self.go_on(),
            0x20B0 => self.teach(value),
            0x20B4 => self.start_list(value),
            0x6040 => self.command(Controlword(value as u16)),
            0x6060 => {
                self.wanted_mode = Mode::of(value).unwrap_or(self.wanted_mode);
                self.change_mode();
            }
            0x60FF => self.set_profile_velocity(),
            index => self.start_manufacturer(index, origin),
        }
    }

    /// What the loops take from the objects.
    pub(in crate::twin::tlc5xx) fn settle_parameters(&mut self) {
        let before = self.settings;
        self.settings = Settings::of(&self.objects, &self.policies);
        if before.direction != self.settings.direction {
            self.turn_round();
        }
    }

    /// Objects that are one: 607Dh and 2053h with 2052h (15527-15538), and types that are set for
    /// all entries that follow (14276, 14507).
    fn write_through(&mut self, address: Address, value: i64) {
        let (index, sub) = match (address.index, address.sub) {
            (0x2052, 0) => (0x607D, 2),
            (0x2053, 0) => (0x607D, 1),
            (0x607D, 1) => (0x2053, 0),
            (0x607D, 2) => (0x2052, 0),
            (index @ (0x2100 | 0x2200 | 0x2300), first @ 1..) => {
                let mut following = first..=u8::MAX;
                while following
                    .next()
                    .is_some_and(|sub| self.objects.put(index, sub, value))
                {}
                return;
            }
            _ => return,
        };
        self.objects.put(index, sub, value);
    }

    /// 2009h: 1 the controller's parameters, 2 the device's (9219-9256, D-33), both in RAM and in
    /// EEPROM.
    fn restore_defaults(&mut self, value: i64) {
        self.objects.put(0x2009, 0, 0);
        let of_controller = |entry: &Entry| entry.address.index == 0x60FB;
        let chosen = |entry: &Entry| {
            entry.persistent
                && match value {
                    1 => of_controller(entry),
                    2 => !of_controller(entry),
                    _ => false,
                }
        };
        self.objects.forget(chosen);
        self.objects.restore(chosen);
        self.servo.tampering.show(&mut self.objects);
        self.settle_parameters();
    }
}
