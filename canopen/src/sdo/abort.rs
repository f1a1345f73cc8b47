//! SDO abort codes (CiA 301, SDO abort transfer).

use core::fmt;

macro_rules! abort_codes {
    ($($name:ident = $code:literal, $text:literal;)*) => {
        /// Why an SDO transfer was refused.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum AbortCode {
            $(#[doc = $text] $name,)*
            /// A code that CiA 301 does not define.
            Unknown(u32),
        }

        impl AbortCode {
            /// Every code that CiA 301 defines.
            pub const ALL: &[Self] = &[$(Self::$name),*];

            /// The code on the wire.
            #[must_use]
            pub const fn code(self) -> u32 {
                match self {
                    $(Self::$name => $code,)*
                    Self::Unknown(code) => code,
                }
            }

            /// What the standard says of it.
            #[must_use]
            pub const fn text(self) -> &'static str {
                match self {
                    $(Self::$name => $text,)*
                    Self::Unknown(_) => "unknown abort code",
                }
            }
        }

        impl From<u32> for AbortCode {
            fn from(code: u32) -> Self {
                match code {
                    $($code => Self::$name,)*
                    _ => Self::Unknown(code),
                }
            }
        }
    };
}

abort_codes! {
    ToggleBit = 0x0503_0000, "toggle bit not alternated";
    TimedOut = 0x0504_0000, "SDO protocol timed out";
    CommandSpecifier = 0x0504_0001, "client/server command specifier not valid or unknown";
    BlockSize = 0x0504_0002, "invalid block size";
    SequenceNumber = 0x0504_0003, "invalid sequence number";
    Crc = 0x0504_0004, "CRC error";
    OutOfMemory = 0x0504_0005, "out of memory";
    UnsupportedAccess = 0x0601_0000, "unsupported access to an object";
    WriteOnly = 0x0601_0001, "attempt to read a write only object";
    ReadOnly = 0x0601_0002, "attempt to write a read only object";
    UnknownObject = 0x0602_0000, "object does not exist in the object dictionary";
    NotMappable = 0x0604_0041, "object cannot be mapped to the PDO";
    PdoLength = 0x0604_0042, "number and length of the objects to be mapped would exceed PDO length";
    ParameterIncompatible = 0x0604_0043, "general parameter incompatibility";
    InternalIncompatible = 0x0604_0047, "general internal incompatibility in the device";
    Hardware = 0x0606_0000, "access failed due to a hardware error";
    LengthMismatch = 0x0607_0010, "data type does not match, length of service parameter does not match";
    TooLong = 0x0607_0012, "data type does not match, length of service parameter too high";
    TooShort = 0x0607_0013, "data type does not match, length of service parameter too low";
    UnknownSubindex = 0x0609_0011, "subindex does not exist";
    InvalidValue = 0x0609_0030, "invalid value for parameter";
    ValueTooHigh = 0x0609_0031, "value of parameter written too high";
    ValueTooLow = 0x0609_0032, "value of parameter written too low";
    MaximumBelowMinimum = 0x0609_0036, "maximum value is less than minimum value";
    NoConnection = 0x060A_0023, "resource not available: SDO connection";
    General = 0x0800_0000, "general error";
    NotStored = 0x0800_0020, "data cannot be transferred or stored to the application";
    LocalControl = 0x0800_0021, "data cannot be transferred or stored to the application because of local control";
    DeviceState = 0x0800_0022, "data cannot be transferred or stored to the application because of the present device state";
    NoDictionary = 0x0800_0023, "object dictionary dynamic generation fails or no object dictionary is present";
    NoData = 0x0800_0024, "no data available";
}

/// As manuals print it: `0609 0030h "invalid value for parameter"`.
impl fmt::Display for AbortCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let code = self.code();
        write!(
            f,
            "{:04X} {:04X}h \"{}\"",
            code >> 16,
            code & 0xFFFF,
            self.text()
        )
    }
}

impl core::error::Error for AbortCode {}
