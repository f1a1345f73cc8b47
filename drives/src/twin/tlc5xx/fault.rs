//! Errors: their codes, and how they are told (13.1, 13.3 of the digest).

use crate::twin::ErrorClass;
use crate::twin::servo::errors::ServoError;
use syncline_canopen::emcy::{Emergency, register};

/// An error as the device tells it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriveError {
    /// Reaction.
    pub class: ErrorClass,
    /// EMCY bytes 0 and 1, 603Fh, 1003h:1 and 2400h.
    pub code: u16,
    /// Bits of the error register 1001h besides bit 0 (6833-6851).
    pub register: u8,
}

/// The manual at hand shows two codes, FF22h (15488) and 2212h in a picture (1906); the list is in
/// another one. All others are assumptions: those of CiA 301 and DSP-402.
impl DriveError {
    /// An invalid position value: the target is not taken (15485-15488).
    pub const INVALID_POSITION: Self =
        Self::new(ErrorClass::Warning, 0xFF22, register::MANUFACTURER);
    /// Following error above 2010h; its class is 204Fh.
    pub const FOLLOWING_ERROR: Self = Self::new(ErrorClass::SwitchOff, 0x8611, register::PROFILE);
    /// Guarding requests or a watched heartbeat stay away (7264, 2250).
    pub const CONNECTION_LOST: Self = Self::new(
        ErrorClass::StopAndSwitchOff,
        0x8130,
        register::COMMUNICATION,
    );
    /// A limit switch or the STOP input (5266).
    pub const EXTERNAL_SIGNAL: Self =
        Self::new(ErrorClass::QuickStop, 0xFF01, register::MANUFACTURER);
    /// A software limit (5230).
    pub const SOFTWARE_LIMIT: Self =
        Self::new(ErrorClass::QuickStop, 0xFF02, register::MANUFACTURER);
    /// Homing did not find what it searched for, or cannot be done.
    pub const HOMING_FAILED: Self = Self::new(ErrorClass::QuickStop, 0xFF03, register::PROFILE);

    const fn new(class: ErrorClass, code: u16, register: u8) -> Self {
        Self {
            class,
            code,
            register,
        }
    }

    /// The same with the class that 204Fh asks for, if it names one of 1 to 3 (10597).
    pub(super) fn of_class(self, response: i64) -> Self {
        let class = match response {
            1 => ErrorClass::QuickStop,
            2 => ErrorClass::StopAndSwitchOff,
            3 => ErrorClass::SwitchOff,
            _ => self.class,
        };
        Self { class, ..self }
    }
}

impl ServoError for DriveError {
    const UNDERVOLTAGE: Self = Self::new(ErrorClass::SwitchOff, 0x3120, register::VOLTAGE);
    const OVERVOLTAGE: Self = Self::new(ErrorClass::SwitchOff, 0x3210, register::VOLTAGE);

    fn of(class: ErrorClass) -> Self {
        Self {
            class,
            ..Self::FOLLOWING_ERROR
        }
    }

    fn class(&self) -> ErrorClass {
        self.class
    }

    fn emergency(&self) -> Emergency {
        Emergency {
            code: self.code,
            register: register::GENERIC | self.register,
            vendor: [0; 5],
        }
    }
}
