//! Errors: their classes and codes, and how they are told.
//!
//! The manual at hand tells what classes 0 and 2 do (lxm32m 997, 1319, 2900); 1, 3 and 4 are
//! described in the drive's own, which is not at hand: assumptions.

use crate::twin::ErrorClass;
use crate::twin::servo::errors::ServoError;
use syncline_canopen::emcy::{Emergency, register};

/// An error as the drive tells it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriveError {
    /// Reaction.
    pub class: ErrorClass,
    /// Vendor error number: 603Fh and EMCY bytes 6, 7.
    pub number: u16,
    /// CiA 301 error code: EMCY bytes 0, 1 and 1003h:1.
    pub emcy_code: u16,
    /// Bits of the error register 1001h besides bit 0 (lxm32m 1941-1949).
    pub register: u8,
}

/// The errors that the twin raises of its own. Their numbers are not in the manual at hand
/// (B404h alone is vouched for, by a vendor FAQ): assumptions, to be told apart by.
impl DriveError {
    /// NMT Reset with the power stage on (lxm32m 1002).
    pub const NMT_RESET: Self = Self::new(
        ErrorClass::StopAndSwitchOff,
        0xB400,
        0x1000,
        register::MANUFACTURER,
    );
    /// NMT Stop with the power stage on (lxm32m 997).
    pub const NMT_STOP: Self = Self::new(
        ErrorClass::StopAndSwitchOff,
        0xB401,
        0x1000,
        register::MANUFACTURER,
    );
    /// SYNC missing or out of tolerance.
    pub const SYNC_LOST: Self = Self::new(
        ErrorClass::StopAndSwitchOff,
        0xB404,
        0x8700,
        register::COMMUNICATION,
    );
    /// A watched heartbeat or the guarding requests stay away (lxm32m 1083, 3184).
    pub const CONNECTION_LOST: Self = Self::new(
        ErrorClass::StopAndSwitchOff,
        0xB408,
        0x8130,
        register::COMMUNICATION,
    );
    /// No setpoints while interpolating.
    pub const SETPOINTS_MISSING: Self = Self::new(
        ErrorClass::StopAndSwitchOff,
        0xA060,
        0x1000,
        register::PROFILE,
    );
    /// The first setpoint is too far from the actual position.
    pub const SETPOINT_JUMP: Self = Self::new(
        ErrorClass::StopAndSwitchOff,
        0xA061,
        0x1000,
        register::PROFILE,
    );
    /// Following error above 6065h.
    pub const FOLLOWING_ERROR: Self =
        Self::new(ErrorClass::SwitchOff, 0xA320, 0x8611, register::PROFILE);

    /// A limit switch was reached.
    pub const LIMIT_SWITCH: Self =
        Self::new(ErrorClass::QuickStop, 0xA302, 0x1000, register::PROFILE);
    /// A software limit switch was reached.
    pub const SOFTWARE_LIMIT: Self =
        Self::new(ErrorClass::QuickStop, 0xA307, 0x1000, register::PROFILE);
    /// Following error above 3006h:29 percent of 6065h.
    pub const FOLLOWING_WARNING: Self =
        Self::new(ErrorClass::Warning, 0xA321, 0x8611, register::PROFILE);
    /// Velocity away from its reference by more than 3006h:4B.
    pub const VELOCITY_DEVIATION: Self =
        Self::new(ErrorClass::SwitchOff, 0xA322, 0x8400, register::PROFILE);
    /// Homing did not find what it searched for, or cannot be done.
    pub const HOMING_FAILED: Self =
        Self::new(ErrorClass::QuickStop, 0xA30F, 0x1000, register::PROFILE);
    /// A received PDO is shorter than its mapping.
    pub(super) const SHORT_PDO: Self =
        Self::new(ErrorClass::Warning, 0, 0x8210, register::COMMUNICATION);

    /// The same with the class that an error response object asks for, if it names one of 0…3.
    pub(super) fn of_class(self, response: i64) -> Self {
        let class = match response {
            0 => ErrorClass::Warning,
            1 => ErrorClass::QuickStop,
            2 => ErrorClass::StopAndSwitchOff,
            3 => ErrorClass::SwitchOff,
            _ => self.class,
        };
        Self { class, ..self }
    }

    const fn new(class: ErrorClass, number: u16, emcy_code: u16, register: u8) -> Self {
        Self {
            class,
            number,
            emcy_code,
            register,
        }
    }
}

impl ServoError for DriveError {
    const UNDERVOLTAGE: Self = Self::new(
        ErrorClass::SwitchOff,
        0x3206,
        0x3120,
        register::MANUFACTURER,
    );
    const OVERVOLTAGE: Self = Self::new(
        ErrorClass::SwitchOff,
        0x3207,
        0x3110,
        register::MANUFACTURER,
    );

    fn of(class: ErrorClass) -> Self {
        Self {
            class,
            ..Self::FOLLOWING_ERROR
        }
    }

    fn class(&self) -> ErrorClass {
        self.class
    }

    /// As in lxm32m 926-940.
    fn emergency(&self) -> Emergency {
        let [low, high] = self.number.to_le_bytes();
        Emergency {
            code: self.emcy_code,
            register: register::GENERIC | self.register,
            vendor: [0, 0, 0, low, high],
        }
    }
}
