//! Errors: their codes as CiA 402 has them, and how they are told.

use crate::twin::ErrorClass;
use crate::twin::servo::errors::ServoError;
use syncline_canopen::emcy::{Emergency, code, register};

/// An error as the drive tells it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriveError {
    /// Reaction. Both stopping classes are one here: the profile has one fault reaction, 605Eh.
    pub class: ErrorClass,
    /// Error code: 603Fh and EMCY bytes 0, 1.
    pub code: u16,
    /// Bits of the error register 1001h besides bit 0.
    pub register: u8,
}

impl DriveError {
    /// The following error was beyond 6065h for longer than 6066h.
    pub const FOLLOWING_ERROR: Self = Self::new(
        ErrorClass::StopAndSwitchOff,
        code::FOLLOWING_ERROR,
        register::PROFILE,
    );
    /// SYNC stays away while setpoints are followed.
    pub const SYNC_LOST: Self = Self::new(
        ErrorClass::StopAndSwitchOff,
        0x8700,
        register::COMMUNICATION,
    );
    /// The connection is lost: heartbeat, or NMT Stop or a reset with the power stage on.
    pub const CONNECTION_LOST: Self = Self::new(
        ErrorClass::StopAndSwitchOff,
        code::LIFE_GUARD_OR_HEARTBEAT,
        register::COMMUNICATION,
    );

    const fn new(class: ErrorClass, code: u16, register: u8) -> Self {
        Self {
            class,
            code,
            register,
        }
    }
}

impl ServoError for DriveError {
    const UNDERVOLTAGE: Self = Self::new(ErrorClass::SwitchOff, 0x3220, register::VOLTAGE);
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
