//! Objects as a set-up writes them.

use core::fmt;
use syncline_canopen::{Address, dictionary::DataType};

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

    /// All bits that are set here or in `other`.
    fn or(mut self, other: Self) -> Self {
        for (byte, more) in self.bytes.iter_mut().zip(other.bytes) {
            *byte |= more;
        }
        self
    }

    /// The least and the greatest value of a number of at most four bytes; `None` for another
    /// type.
    #[must_use]
    pub const fn range(data_type: DataType) -> Option<(i64, i64)> {
        if !data_type.is_number() || data_type.size() > 4 {
            return None;
        }
        let bits = 8 * data_type.size();
        Some(if data_type.is_signed() {
            (-1 << (bits - 1), (1 << (bits - 1)) - 1)
        } else {
            (0, (1 << bits) - 1)
        })
    }

    /// `value` as an object of that type holds it, if it is in its [`range`](Self::range).
    #[must_use]
    pub fn encode(data_type: DataType, value: i64) -> Option<Self> {
        let (least, most) = Self::range(data_type)?;
        (least..=most).contains(&value).then(|| Self {
            // Two's complement: the low bytes of a value in range are its own.
            bytes: (value as u32).to_le_bytes(),
            len: data_type.size() as u8,
        })
    }

    /// The bytes as they travel.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.bytes[..self.len as usize]
    }

    /// The value, of an object of that type.
    #[must_use]
    pub const fn value(&self, data_type: DataType) -> i64 {
        let above = 32 - 8 * self.len as u32;
        match data_type.is_signed() {
            true => (self.bits().cast_signed() << above >> above) as i64,
            false => self.bits() as i64,
        }
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
    /// The same, with the bits of `other` set as well, where that is the same object.
    pub(super) fn with_bits_of(mut self, other: &Self) -> Self {
        if self.address == other.address {
            self.data = self.data.or(other.data);
        }
        self
    }

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
    fn every_type_keeps_to_its_range() {
        use DataType::{I8, I16, I32, U8, U16, U32};
        for data_type in [I8, I16, I32, U8, U16, U32] {
            let (least, most) = Data::range(data_type).unwrap();
            assert_eq!(Data::encode(data_type, least - 1), None);
            assert_eq!(Data::encode(data_type, most + 1), None);
            for end in [least, most] {
                let data = Data::encode(data_type, end).unwrap();
                assert_eq!(data.bytes().len(), data_type.size());
                let bits = 8 * data_type.size() as u32;
                assert_eq!(data_type.extend(data.bits().into(), bits), end);
            }
        }
        assert_eq!(Data::encode(DataType::I64, 0), None);
        assert_eq!(Data::encode(DataType::Text(4), 0), None);
        assert_eq!(
            Data::encode(DataType::I16, -2).unwrap().bytes(),
            [0xFE, 0xFF]
        );
    }
}
