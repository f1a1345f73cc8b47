//! Errors: their classes and codes, how they are told, and the memory of them.

/// How the drive reacts to an error (lxm32m 997, 1319, 2900; classes 1, 3 and 4 are described in
/// the drive's own manual, which is not at hand: assumptions).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ErrorClass {
    /// A warning; the movement goes on.
    Warning = 0,
    /// Quick Stop, the power stage stays on (state 7).
    QuickStop = 1,
    /// Quick Stop, then power stage off (states 8, 9).
    StopAndSwitchOff = 2,
    /// Power stage off at once (state 9).
    SwitchOff = 3,
    /// As class 3, and only a power cycle leaves state 9.
    Fatal = 4,
}

/// An error as the drive tells it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriveError {
    /// Reaction.
    pub class: ErrorClass,
    /// Vendor error number: 603Fh and EMCY bytes 6, 7.
    pub number: u16,
    /// CiA 301 error code: EMCY bytes 0, 1 and 1003h:1.
    pub emcy_code: u16,
    /// Bits of the error register 1001h besides bit 0.
    pub register: u8,
}

/// Bit 4 of 1001h: communication (lxm32m 1941-1949).
const COMMUNICATION: u8 = 1 << 4;
/// Bit 5 of 1001h: device profile.
const DEVICE_PROFILE: u8 = 1 << 5;
/// Bit 7 of 1001h: vendor.
const VENDOR: u8 = 1 << 7;

/// The errors that the twin raises of its own. Their numbers are not in the manual at hand
/// (B404h alone is vouched for, by a vendor FAQ): assumptions, to be told apart by.
impl DriveError {
    /// NMT Reset with the power stage on (lxm32m 1002).
    pub const NMT_RESET: Self = Self::new(ErrorClass::StopAndSwitchOff, 0xB400, 0x1000, VENDOR);
    /// NMT Stop with the power stage on (lxm32m 997).
    pub const NMT_STOP: Self = Self::new(ErrorClass::StopAndSwitchOff, 0xB401, 0x1000, VENDOR);
    /// SYNC missing or out of tolerance.
    pub const SYNC_LOST: Self =
        Self::new(ErrorClass::StopAndSwitchOff, 0xB404, 0x8700, COMMUNICATION);
    /// A watched heartbeat or the guarding requests stay away (lxm32m 1083, 3184).
    pub const CONNECTION_LOST: Self =
        Self::new(ErrorClass::StopAndSwitchOff, 0xB408, 0x8130, COMMUNICATION);
    /// No setpoints while interpolating.
    pub const SETPOINTS_MISSING: Self =
        Self::new(ErrorClass::StopAndSwitchOff, 0xA060, 0x1000, DEVICE_PROFILE);
    /// The first setpoint is too far from the actual position.
    pub const SETPOINT_JUMP: Self =
        Self::new(ErrorClass::StopAndSwitchOff, 0xA061, 0x1000, DEVICE_PROFILE);
    /// Following error above 6065h.
    pub const FOLLOWING_ERROR: Self =
        Self::new(ErrorClass::SwitchOff, 0xA320, 0x8611, DEVICE_PROFILE);

    /// A limit switch was reached.
    pub const LIMIT_SWITCH: Self = Self::new(ErrorClass::QuickStop, 0xA302, 0x1000, DEVICE_PROFILE);
    /// Homing did not find what it searched for, or cannot be done.
    pub const HOMING_FAILED: Self =
        Self::new(ErrorClass::QuickStop, 0xA30F, 0x1000, DEVICE_PROFILE);
    /// A received PDO is shorter than its mapping.
    pub(super) const SHORT_PDO: Self = Self::new(ErrorClass::Warning, 0, 0x8210, COMMUNICATION);

    const fn new(class: ErrorClass, number: u16, emcy_code: u16, register: u8) -> Self {
        Self {
            class,
            number,
            emcy_code,
            register,
        }
    }
}

/// EMCY payloads that may wait for the bus; more are dropped.
const EMCY_CAPACITY: usize = 8;

/// What is wrong with a drive now, and what it still has to tell.
#[derive(Clone, Debug)]
pub(super) struct Errors {
    /// The error that stopped the drive, until it is reset.
    pub(super) active: Option<DriveError>,
    /// Whether the cause is still there, so that a Fault Reset is in vain (lxm32m 4616).
    pub(super) cause_persists: bool,
    /// The only entry of 1003h (D-23), 0 if there is none.
    pub(super) history: u32,
    emcy: Vec<[u8; 8]>,
}

impl Errors {
    pub(super) fn new() -> Self {
        Self {
            active: None,
            cause_persists: false,
            history: 0,
            emcy: Vec::with_capacity(EMCY_CAPACITY),
        }
    }

    /// 1001h: bit 0 while any error exists (lxm32m 952, 1941-1949).
    pub(super) fn register(&self) -> u8 {
        self.active.map_or(0, |error| 1 | error.register)
    }

    /// The next EMCY payload to be sent.
    pub(super) fn next_emcy(&mut self) -> Option<[u8; 8]> {
        (!self.emcy.is_empty()).then(|| self.emcy.remove(0))
    }

    /// Queues an EMCY (lxm32m 926-940) and enters it in 1003h (lxm32m 3045-3047).
    pub(super) fn tell(&mut self, error: DriveError, pdo: u8) {
        let [low, high] = error.emcy_code.to_le_bytes();
        let [vendor_low, vendor_high] = error.number.to_le_bytes();
        let register = 1 | error.register;
        self.queue([low, high, register, 0, 0, pdo, vendor_low, vendor_high]);
        let vendor = if error.emcy_code == 0x1000 {
            u32::from(error.number) << 16
        } else {
            0
        };
        self.history = vendor | u32::from(error.emcy_code);
    }

    /// Queues the EMCY that says that no error is left.
    pub(super) fn tell_reset(&mut self) {
        self.queue([0; 8]);
    }

    fn queue(&mut self, payload: [u8; 8]) {
        if self.emcy.len() < EMCY_CAPACITY {
            self.emcy.push(payload);
        }
    }
}
