//! Objects as a set-up writes them.

use core::{fmt, str::FromStr};
use thiserror::Error;

/// Where an object stands in a device's dictionary.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Address {
    /// 0000h…FFFFh.
    pub index: u16,
    /// 00h…FFh.
    pub sub: u8,
}

impl Address {
    /// The object `index:sub`.
    #[must_use]
    pub const fn new(index: u16, sub: u8) -> Self {
        Self { index, sub }
    }
}

/// `60C2h:1`, as manuals and people write it.
impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04X}h:{:X}", self.index, self.sub)
    }
}

impl fmt::Debug for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// Not `index:sub` in hexadecimal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("not an object: write index:sub in hexadecimal, such as \"3012:6\"")]
pub struct ParseAddressError;

/// `3012:6`, `3012h:6`, `6065` (subindex 0): hexadecimal both.
impl FromStr for Address {
    type Err = ParseAddressError;

    fn from_str(text: &str) -> Result<Self, ParseAddressError> {
        let hex = |digits: &str, most: usize| {
            let digits = digits.strip_suffix(['h', 'H']).unwrap_or(digits);
            ((1..=most).contains(&digits.len()) && digits.bytes().all(|b| b.is_ascii_hexdigit()))
                .then(|| u16::from_str_radix(digits, 16).ok())
                .flatten()
                .ok_or(ParseAddressError)
        };
        let (index, sub) = text.split_once(':').unwrap_or((text, "0"));
        Ok(Self::new(hex(index, 4)?, hex(sub, 2)? as u8))
    }
}

/// The type of an object of at most four bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ObjectType {
    /// INTEGER8.
    I8,
    /// INTEGER16.
    I16,
    /// INTEGER32.
    I32,
    /// UNSIGNED8.
    U8,
    /// UNSIGNED16.
    U16,
    /// UNSIGNED32.
    U32,
}

impl ObjectType {
    /// Every type with its name in a machine file.
    pub const NAMES: [(&'static str, Self); 6] = [
        ("i8", Self::I8),
        ("i16", Self::I16),
        ("i32", Self::I32),
        ("u8", Self::U8),
        ("u16", Self::U16),
        ("u32", Self::U32),
    ];

    /// The least and the greatest value.
    #[must_use]
    pub const fn range(self) -> (i64, i64) {
        match self {
            Self::I8 => (i8::MIN as i64, i8::MAX as i64),
            Self::I16 => (i16::MIN as i64, i16::MAX as i64),
            Self::I32 => (i32::MIN as i64, i32::MAX as i64),
            Self::U8 => (0, u8::MAX as i64),
            Self::U16 => (0, u16::MAX as i64),
            Self::U32 => (0, u32::MAX as i64),
        }
    }

    /// The bytes of `value`, or `None` outside [`range`](Self::range).
    #[must_use]
    pub fn encode(self, value: i64) -> Option<Data> {
        let (least, most) = self.range();
        let len = match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 => 4,
        };
        (least..=most).contains(&value).then(|| Data {
            // Two's complement: the low bytes of a value in range are its own.
            bytes: (value as u32).to_le_bytes(),
            len,
        })
    }
}

/// One to four bytes of an object, little-endian.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Data {
    bytes: [u8; 4],
    len: u8,
}

impl Data {
    /// UNSIGNED8.
    #[must_use]
    pub const fn u8(value: u8) -> Self {
        Self {
            bytes: [value, 0, 0, 0],
            len: 1,
        }
    }

    /// UNSIGNED16.
    #[must_use]
    pub const fn u16(value: u16) -> Self {
        let [a, b] = value.to_le_bytes();
        Self {
            bytes: [a, b, 0, 0],
            len: 2,
        }
    }

    /// UNSIGNED32.
    #[must_use]
    pub const fn u32(value: u32) -> Self {
        Self {
            bytes: value.to_le_bytes(),
            len: 4,
        }
    }

    /// INTEGER32.
    #[must_use]
    pub const fn i32(value: i32) -> Self {
        Self {
            bytes: value.to_le_bytes(),
            len: 4,
        }
    }

    /// The bytes as they travel.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.bytes[..self.len as usize]
    }

    /// The bits, zero-extended.
    #[must_use]
    pub const fn bits(&self) -> u32 {
        u32::from_le_bytes(self.bytes)
    }
}

/// As hexadecimal of the object's width: `0002h`.
impl fmt::Display for Data {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{:0width$X}h",
            self.bits(),
            width = 2 * self.len as usize
        )
    }
}

impl fmt::Debug for Data {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// One SDO download.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Write {
    /// Where to.
    pub address: Address,
    /// What.
    pub data: Data,
}

impl Write {
    /// `index:sub` := `data`.
    #[must_use]
    pub const fn new(index: u16, sub: u8, data: Data) -> Self {
        Self {
            address: Address::new(index, sub),
            data,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_read_as_people_write_them() {
        for (text, index, sub) in [
            ("3012:6", 0x3012, 6),
            ("60C2h:1", 0x60C2, 1),
            ("6065", 0x6065, 0),
            ("3006:3D", 0x3006, 0x3D),
            ("3006:3Dh", 0x3006, 0x3D),
        ] {
            assert_eq!(text.parse(), Ok(Address::new(index, sub)), "{text}");
        }
        for text in [
            "", ":", "3012:", ":6", "30122:6", "3012:100", "+301:1", "x", "3012:6:1",
        ] {
            assert_eq!(text.parse::<Address>(), Err(ParseAddressError), "{text}");
        }
    }

    #[test]
    fn every_type_keeps_to_its_range() {
        for (_, kind) in ObjectType::NAMES {
            let (least, most) = kind.range();
            assert_eq!(kind.encode(least - 1), None);
            assert_eq!(kind.encode(most + 1), None);
            assert!(kind.encode(least).is_some());
        }
        assert_eq!(ObjectType::I16.encode(-2).unwrap().bytes(), [0xFE, 0xFF]);
        assert_eq!(
            ObjectType::U32.encode(0x8000_0201).unwrap().bytes(),
            [1, 2, 0, 0x80]
        );
    }
}
