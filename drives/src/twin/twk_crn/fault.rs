//! Errors and how the encoder tells them: EMCY, 1001h, 1003h, 6503h.

use syncline_canopen::emcy::{self, Emergency, register};

/// An error of the encoder (crn S35).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EncoderError {
    /// MSA or expander: EMCY 5000h.
    Hardware,
    /// ROM: EMCY 5100h.
    Memory,
    /// The guarding master is gone: EMCY 8100h.
    Communication,
    /// EEPROM: EMCY FFFFh, bit 12 of 6503h.
    Eeprom,
    /// Checksum of the EEPROM: EMCY FFFFh, bit 13 of 6503h.
    EepromCrc,
    /// External RAM: EMCY FFFFh, bit 14 of 6503h.
    Xram,
}

impl EncoderError {
    const ALL: [Self; 6] = [
        Self::Hardware,
        Self::Memory,
        Self::Communication,
        Self::Eeprom,
        Self::EepromCrc,
        Self::Xram,
    ];

    const fn code(self) -> u16 {
        match self {
            Self::Hardware => 0x5000,
            Self::Memory => 0x5100,
            Self::Communication => 0x8100,
            Self::Eeprom | Self::EepromCrc | Self::Xram => 0xFFFF,
        }
    }

    /// Its bit in 6503h (crn S35, S43).
    const fn alarm(self) -> u16 {
        match self {
            Self::Hardware | Self::Memory | Self::Communication => 0,
            Self::Eeprom => 1 << 12,
            Self::EepromCrc => 1 << 13,
            Self::Xram => 1 << 14,
        }
    }

    /// Its bits in 1001h: 81h of the EEPROM is printed (crn S17), the others are assumed.
    const fn register(self) -> u8 {
        match self {
            Self::Hardware | Self::Memory => register::GENERIC,
            Self::Communication => register::GENERIC | register::COMMUNICATION,
            Self::Eeprom | Self::EepromCrc | Self::Xram => {
                register::GENERIC | register::MANUFACTURER
            }
        }
    }

    const fn bit(self) -> u8 {
        1 << self as u8
    }
}

/// The errors whose cause is there, and what is still to be told of them.
#[derive(Clone, Debug, Default)]
pub(super) struct Errors {
    present: u8,
    /// In the order in which they came.
    untold: Vec<EncoderError>,
    /// The last cause has gone.
    is_over: bool,
}

impl Errors {
    fn present(&self) -> impl Iterator<Item = EncoderError> {
        let all = EncoderError::ALL.into_iter();
        all.filter(|error| self.present & error.bit() != 0)
    }

    pub(super) fn any(&self) -> bool {
        self.present != 0
    }

    pub(super) fn has(&self, error: EncoderError) -> bool {
        self.present & error.bit() != 0
    }

    /// The cause is there from now on, or gone.
    pub(super) fn set(&mut self, error: EncoderError, is_there: bool) {
        if self.has(error) == is_there {
            return;
        }
        self.present ^= error.bit();
        if is_there {
            self.untold.push(error);
        } else {
            self.is_over = !self.any();
        }
    }

    /// After a reset everything that is there is told anew.
    pub(super) fn restart(&mut self) {
        self.set(EncoderError::Communication, false);
        self.untold = self.present().collect();
        self.is_over = false;
    }

    /// 6503h.
    pub(super) fn alarms(&self) -> u16 {
        self.present().fold(0, |bits, error| bits | error.alarm())
    }

    /// 1001h.
    pub(super) fn register(&self) -> u8 {
        self.present()
            .fold(0, |bits, error| bits | error.register())
    }

    /// What is to be told next.
    pub(super) fn next_emergency(&mut self) -> Option<Emergency> {
        let code = if self.untold.is_empty() {
            core::mem::take(&mut self.is_over).then_some(emcy::code::NO_ERROR)?
        } else {
            self.untold.remove(0).code()
        };
        Some(Emergency {
            code,
            register: self.register(),
            vendor: [0; 5],
        })
    }
}
