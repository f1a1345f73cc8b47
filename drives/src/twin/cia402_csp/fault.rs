//! Errors: their codes as CiA 402 has them, and how they are told.

use crate::twin::ErrorClass;
use std::collections::VecDeque;
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
    pub const FOLLOWING_ERROR: Self =
        Self::new(ErrorClass::StopAndSwitchOff, 0x8611, register::PROFILE);
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
    /// The DC link lost its voltage with the power stage on.
    pub const UNDERVOLTAGE: Self = Self::new(ErrorClass::SwitchOff, 0x3220, register::VOLTAGE);
    /// Braking brought more into the DC link than its resistor takes.
    pub const OVERVOLTAGE: Self = Self::new(ErrorClass::SwitchOff, 0x3210, register::VOLTAGE);

    const fn new(class: ErrorClass, code: u16, register: u8) -> Self {
        Self {
            class,
            code,
            register,
        }
    }

    fn emergency(self) -> Emergency {
        Emergency {
            code: self.code,
            register: self.register(),
            vendor: [0; 5],
        }
    }

    fn register(self) -> u8 {
        register::GENERIC | self.register
    }
}

/// EMCYs that may wait for the bus; more are dropped.
const EMCY_CAPACITY: usize = 8;

/// What is wrong with a drive now, and what it still has to tell.
#[derive(Clone, Debug)]
pub(super) struct Errors {
    /// The error that stopped the drive, until it is reset.
    pub(super) active: Option<DriveError>,
    /// A warning is pending.
    pub(super) warning: bool,
    untold: VecDeque<Emergency>,
}

impl Errors {
    pub(super) fn new() -> Self {
        Self {
            active: None,
            warning: false,
            untold: VecDeque::with_capacity(EMCY_CAPACITY),
        }
    }

    /// 1001h.
    pub(super) fn register(&self) -> u8 {
        self.active.map_or(0, DriveError::register)
    }

    /// 603Fh.
    pub(super) fn code(&self) -> u16 {
        self.active.map_or(0, |error| error.code)
    }

    /// Keeps an error, unless one is there already: the first one is to be told.
    pub(super) fn begin(&mut self, error: DriveError) -> bool {
        let first = self.active.is_none();
        if first {
            self.active = Some(error);
            self.tell(error.emergency());
        }
        first
    }

    /// Forgets it, if it can be; whether it could.
    pub(super) fn reset(&mut self, told: bool) -> bool {
        let resettable = |error: DriveError| error.class != ErrorClass::Fatal;
        let reset = self.active.is_some_and(resettable);
        if reset {
            self.active = None;
            if told {
                self.tell(Emergency::default());
            }
        }
        reset
    }

    /// The next EMCY to be sent.
    pub(super) fn next_emergency(&mut self) -> Option<Emergency> {
        self.untold.pop_front()
    }

    fn tell(&mut self, emergency: Emergency) {
        if self.untold.len() < EMCY_CAPACITY {
            self.untold.push_back(emergency);
        }
    }
}
