//! Electronic data sheets (CiA 306): a device's object dictionary as a file.
//!
//! - [`Eds::of`] makes one of a built-in table, `Display` writes it, [`Eds::parse`] reads one
//! - [`Eds::compare`] says where a user's EDS and a built-in one differ
//!
//! ```
//! use syncline_canopen::dictionary::{DataType::*, Entry, ro, rw, table};
//! use syncline_canopen::eds::Eds;
//!
//! static TABLE: [Entry; 2] = table([
//!     ro(0x1000, 0, "Device type", U32).default(0x0042_0192),
//!     rw(0x6060, 0, "Mode", I8).range(-6, 10).r_pdo(),
//! ]);
//! let ours = Eds::of(&TABLE);
//! let theirs = Eds::parse(&ours.to_string().replace("HighLimit=10", "HighLimit=7"))?;
//! let differences = ours.compare(&theirs);
//! assert_eq!(differences[0].to_string(), "6060h:0 HighLimit: 7, built in 10");
//! # Ok::<(), syncline_canopen::eds::ParseError>(())
//! ```

mod compare;
mod read;
mod write;

pub use compare::{Aspect, Difference};
pub use read::{ParseError, Problem};

use crate::dictionary::{self, Address, DataType, Entry, Preset};
use core::fmt;
use std::collections::BTreeMap;

/// An electronic data sheet.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Eds {
    /// `[FileInfo]`: keys and values in order.
    pub file: Vec<(String, String)>,
    /// `[DeviceInfo]`: keys and values in order.
    pub device: Vec<(String, String)>,
    /// `[DummyUsage]`: whether data type 0001h…0007h can be mapped as a gap.
    pub dummies: [bool; 7],
    /// The objects by index.
    pub objects: BTreeMap<u16, Object>,
}

/// What kind of object stands at an index.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum ObjectType {
    /// 0h: no value.
    Null = 0x0,
    /// 2h: a large amount of data.
    Domain = 0x2,
    /// 5h: the definition of a data type.
    DefType = 0x5,
    /// 6h: the definition of a record.
    DefStruct = 0x6,
    /// 7h: a single value.
    Var = 0x7,
    /// 8h: values of one type.
    Array = 0x8,
    /// 9h: values of several types.
    Record = 0x9,
}

impl ObjectType {
    const fn from_number(number: i64) -> Option<Self> {
        match number {
            0x0 => Some(Self::Null),
            0x2 => Some(Self::Domain),
            0x5 => Some(Self::DefType),
            0x6 => Some(Self::DefStruct),
            0x7 => Some(Self::Var),
            0x8 => Some(Self::Array),
            0x9 => Some(Self::Record),
            _ => None,
        }
    }

    /// Whether the object consists of subindices with a section each.
    const fn has_subs(self) -> bool {
        matches!(self, Self::DefStruct | Self::Array | Self::Record)
    }
}

/// The object at an index.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Object {
    /// `ParameterName`.
    pub name: String,
    /// `ObjectType`.
    pub object_type: ObjectType,
    /// The values by subindex; a single value has subindex 0.
    pub subs: BTreeMap<u8, Parameter>,
}

/// One value of an object.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parameter {
    /// `ParameterName`.
    pub name: String,
    /// `DataType`, a number of CiA 301.
    pub data_type: u16,
    /// `AccessType`.
    pub access: Access,
    /// `PDOMapping`.
    pub pdo_mapping: bool,
    /// `DefaultValue`.
    pub default: Option<Value>,
    /// `LowLimit`.
    pub low: Option<Value>,
    /// `HighLimit`.
    pub high: Option<Value>,
}

/// An access type; CiA 306 tells by it the direction in which a value can be mapped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Access {
    /// Constant.
    Const,
    /// Read only.
    Ro,
    /// Write only.
    Wo,
    /// Read and write.
    Rw,
    /// Read and write, read by T_PDOs.
    Rwr,
    /// Read and write, written by R_PDOs.
    Rww,
}

impl Access {
    const ALL: [(&'static str, Self); 6] = [
        ("const", Self::Const),
        ("ro", Self::Ro),
        ("wo", Self::Wo),
        ("rw", Self::Rw),
        ("rwr", Self::Rwr),
        ("rww", Self::Rww),
    ];

    /// Whether an SDO may read it, whether an SDO may write it.
    #[must_use]
    pub const fn by_sdo(self) -> (bool, bool) {
        match self {
            Self::Const | Self::Ro => (true, false),
            Self::Wo => (false, true),
            Self::Rw | Self::Rwr | Self::Rww => (true, true),
        }
    }
}

impl fmt::Display for Access {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = Self::ALL.iter().find(|(_, access)| access == self);
        f.write_str(name.map_or("", |(name, _)| name))
    }
}

/// A value in an EDS.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Value {
    /// A number.
    Number(i64),
    /// A number to which the node id is added (`$NODEID+…`).
    PlusNode(i64),
    /// What is no number: strings, reals, hexadecimal bytes.
    Text(String),
}

/// Data types whose values are whole numbers of at most 64 bits (CiA 301).
const fn is_integer(data_type: u16) -> bool {
    matches!(data_type, 0x01..=0x07 | 0x10 | 0x12..=0x16 | 0x18..=0x1B)
}

/// Objects that CiA 301 makes arrays; what else has subindices is a record.
const fn is_array(index: u16) -> bool {
    matches!(
        index,
        0x1003 | 0x1010 | 0x1011 | 0x1016 | 0x1028 | 0x1029 | 0x1F80..=0x1F8F
    )
}

/// The names that CiA 301 gives to objects with subindices.
fn standard_name(index: u16) -> Option<String> {
    let numbered = |name: &str, from: u16| format!("{name} {}", index - from + 1);
    Some(match index {
        0x1003 => "Pre-defined error field".into(),
        0x1010 => "Store parameters".into(),
        0x1011 => "Restore default parameters".into(),
        0x1016 => "Consumer heartbeat time".into(),
        0x1018 => "Identity object".into(),
        0x1029 => "Error behaviour".into(),
        0x1200..=0x127F => numbered("SDO server parameter", 0x1200),
        0x1280..=0x12FF => numbered("SDO client parameter", 0x1280),
        0x1400..0x1600 => numbered("RPDO communication parameter", 0x1400),
        0x1600..0x1800 => numbered("RPDO mapping parameter", 0x1600),
        0x1800..0x1A00 => numbered("TPDO communication parameter", 0x1800),
        0x1A00..0x1C00 => numbered("TPDO mapping parameter", 0x1A00),
        _ => return None,
    })
}

impl Eds {
    /// The data sheet of a built-in table. What only the caller knows goes into
    /// [`Self::file`], [`Self::device`] and [`Self::dummies`] afterwards: a table does not say whether
    /// gaps can be mapped.
    #[must_use]
    pub fn of(entries: &[Entry]) -> Self {
        let mut objects = BTreeMap::new();
        for of_index in entries.chunk_by(|a, b| a.address.index == b.address.index) {
            let first = &of_index[0];
            let index = first.address.index;
            let object_type = match of_index {
                [single] if single.address.sub == 0 => match single.data_type {
                    DataType::Domain(_) => ObjectType::Domain,
                    _ => ObjectType::Var,
                },
                _ if is_array(index) => ObjectType::Array,
                _ => ObjectType::Record,
            };
            let name = if object_type.has_subs() {
                standard_name(index).unwrap_or_else(|| format!("{index:04X}h"))
            } else {
                first.name.into()
            };
            let subs = of_index
                .iter()
                .map(|entry| (entry.address.sub, entry.into()));
            objects.insert(
                index,
                Object {
                    name,
                    object_type,
                    subs: subs.collect(),
                },
            );
        }
        let count = |range: core::ops::Range<u16>| objects.range(range).count().to_string();
        let identity = |sub| {
            let mut entries = entries.iter();
            let entry = entries.find(|entry| entry.address == Address::new(0x1018, sub));
            match entry.map(|entry| entry.preset) {
                Some(Preset::Number(number)) => format!("0x{number:08X}"),
                _ => "0".into(),
            }
        };
        let device = [
            ("VendorNumber", identity(1)),
            ("ProductNumber", identity(2)),
            ("RevisionNumber", identity(3)),
            ("SimpleBootUpMaster", "0".into()),
            ("SimpleBootUpSlave", "1".into()),
            ("Granularity", "8".into()),
            ("DynamicChannelsSupported", "0".into()),
            ("GroupMessaging", "0".into()),
            ("NrOfRXPDO", count(0x1400..0x1600)),
            ("NrOfTXPDO", count(0x1800..0x1A00)),
            ("LSS_Supported", "0".into()),
        ];
        let device = device.map(|(key, value)| (key.to_owned(), value)).to_vec();
        Self {
            file: Vec::new(),
            device,
            dummies: [false; 7],
            objects,
        }
    }

    /// A value of `[DeviceInfo]`, whatever the case of its key.
    #[must_use]
    pub fn device_info(&self, key: &str) -> Option<&str> {
        let mut pairs = self.device.iter();
        pairs
            .find(|(name, _)| name.eq_ignore_ascii_case(key))
            .map(|(_, value)| value.as_str())
    }

    /// Every value with its address.
    pub fn parameters(&self) -> impl Iterator<Item = (Address, &Parameter)> {
        self.objects.iter().flat_map(|(&index, object)| {
            let subs = object.subs.iter();
            subs.map(move |(&sub, parameter)| (Address::new(index, sub), parameter))
        })
    }
}

impl From<&Entry> for Parameter {
    fn from(entry: &Entry) -> Self {
        let mappable = entry.mappable;
        let access = match entry.access {
            dictionary::Access::Const => Access::Const,
            dictionary::Access::Ro => Access::Ro,
            dictionary::Access::Wo => Access::Wo,
            dictionary::Access::Rw => match (mappable.r_pdo, mappable.t_pdo) {
                (true, false) => Access::Rww,
                (false, true) => Access::Rwr,
                _ => Access::Rw,
            },
        };
        let default = match entry.preset {
            Preset::Number(value) => Some(Value::Number(value)),
            Preset::PlusNode(value) => Some(Value::PlusNode(value)),
            Preset::Bytes(bytes) => {
                let text = String::from_utf8_lossy(bytes);
                Some(Value::Text(text.trim().into()))
            }
            Preset::Unknown | Preset::Assumed(_) => None,
        };
        Self {
            name: entry.name.into(),
            data_type: entry.data_type.code(),
            access,
            pdo_mapping: mappable.r_pdo || mappable.t_pdo,
            default,
            low: entry.range.map(|(low, _)| Value::Number(low)),
            high: entry.range.map(|(_, high)| Value::Number(high)),
        }
    }
}
