//! A data sheet read from a file: INI sections to objects, each mistake with its line.

use super::{Access, Eds, Object, ObjectType, Parameter, Value, is_integer};
use std::collections::BTreeMap;
use thiserror::Error;

/// Why a text is no EDS, and where.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("line {line}: {problem}")]
pub struct ParseError {
    /// The line, counted from 1: the one at fault, or the head of its section.
    pub line: usize,
    /// What is wrong there.
    pub problem: Problem,
}

/// What is wrong with an EDS.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum Problem {
    /// A line is neither a section's head nor a key with a value.
    #[error("neither [section] nor key=value")]
    Line,
    /// A key stands before the first section.
    #[error("a key before the first section")]
    NoSection,
    /// A section appears twice.
    #[error("section [{0}] appears twice")]
    SectionTwice(String),
    /// A section lacks a key.
    #[error("section [{section}] has no {key}")]
    NoKey {
        /// The section.
        section: String,
        /// The key.
        key: &'static str,
    },
    /// A value is none of those that its key allows.
    #[error("{key}={value}: expected {expected}")]
    Value {
        /// The key.
        key: String,
        /// The value.
        value: String,
        /// What the key allows.
        expected: &'static str,
    },
    /// A list of objects names one that has no section.
    #[error("object {0:04X}h is listed but has no section")]
    NotDescribed(u16),
    /// A subindex has a section but its object has none, or is a single value.
    #[error("[{0}] belongs to no object with subindices")]
    StraySub(String),
}

impl Problem {
    fn at(self, line: usize) -> ParseError {
        ParseError {
            line,
            problem: self,
        }
    }
}

/// A section as it stands in the file: keys with values and lines.
struct Section<'a> {
    name: &'a str,
    line: usize,
    pairs: Vec<(&'a str, &'a str, usize)>,
}

impl<'a> Section<'a> {
    fn get(&self, key: &str) -> Option<(&'a str, usize)> {
        let mut pairs = self.pairs.iter();
        pairs
            .find(|(name, ..)| name.eq_ignore_ascii_case(key))
            .map(|&(_, value, line)| (value, line))
    }

    fn required(&self, key: &'static str) -> Result<(&'a str, usize), ParseError> {
        self.get(key).ok_or_else(|| {
            Problem::NoKey {
                section: self.name.into(),
                key,
            }
            .at(self.line)
        })
    }

    /// A key's value as a number; `None` if the key is missing or empty.
    fn number(&self, key: &'static str) -> Result<Option<i64>, ParseError> {
        match self.get(key) {
            None | Some(("", _)) => Ok(None),
            Some((value, line)) => match number(value) {
                Some(number) => Ok(Some(number)),
                None => Err(unexpected(key, value, "a number").at(line)),
            },
        }
    }

    fn flag(&self, key: &'static str) -> Result<bool, ParseError> {
        Ok(self.number(key)?.unwrap_or(0) != 0)
    }

    fn to_pairs(&self) -> Vec<(String, String)> {
        let pairs = self.pairs.iter();
        pairs
            .map(|&(key, value, _)| (key.into(), value.into()))
            .collect()
    }
}

fn unexpected(key: &str, value: &str, expected: &'static str) -> Problem {
    Problem::Value {
        key: key.into(),
        value: value.into(),
        expected,
    }
}

/// A number as CiA 306 writes it: decimal, 0x…, or octal with a leading 0.
fn number(text: &str) -> Option<i64> {
    let (negative, digits) = match text.strip_prefix('-') {
        Some(digits) => (true, digits),
        None => (false, text),
    };
    let magnitude = if let Some(hex) = digits
        .strip_prefix("0x")
        .or_else(|| digits.strip_prefix("0X"))
    {
        unsigned(hex, 16)
    } else {
        let octal = digits.strip_prefix('0').filter(|rest| !rest.is_empty());
        octal
            .and_then(|rest| unsigned(rest, 8))
            .or_else(|| unsigned(digits, 10))
    }?;
    // A 64-bit pattern with its highest bit set is kept as such.
    let value = magnitude as i64;
    Some(if negative {
        value.wrapping_neg()
    } else {
        value
    })
}

/// Digits alone: no sign, not empty.
fn unsigned(digits: &str, radix: u32) -> Option<u64> {
    let plain = digits.chars().all(|digit| digit.is_digit(radix));
    plain
        .then(|| u64::from_str_radix(digits, radix).ok())
        .flatten()
}

impl Eds {
    /// Reads an EDS. Keys and section names are taken in any case; sections that describe
    /// neither the device nor an object are passed over.
    ///
    /// # Errors
    /// Where and why the text is no EDS.
    pub fn parse(text: &str) -> Result<Self, ParseError> {
        let sections = sections(text)?;
        let mut eds = Self::default();
        let mut subs = Vec::new();
        for section in &sections {
            let name = section.name;
            if name.eq_ignore_ascii_case("FileInfo") {
                eds.file = section.to_pairs();
            } else if name.eq_ignore_ascii_case("DeviceInfo") {
                eds.device = section.to_pairs();
            } else if name.eq_ignore_ascii_case("DummyUsage") {
                const KEYS: [&str; 7] = [
                    "Dummy0001",
                    "Dummy0002",
                    "Dummy0003",
                    "Dummy0004",
                    "Dummy0005",
                    "Dummy0006",
                    "Dummy0007",
                ];
                for (used, key) in eds.dummies.iter_mut().zip(KEYS) {
                    *used = section.flag(key)?;
                }
            } else if let Some(index) = object_index(name) {
                eds.objects.insert(index, object(section)?);
            } else if let Some((index, sub)) = sub_index(name) {
                subs.push((index, sub, section));
            }
        }
        for section in &sections {
            eds.name_compact_subs(section);
        }
        for (index, sub, section) in subs {
            match eds.objects.get_mut(&index) {
                Some(object) if object.object_type.has_subs() => {
                    object.subs.insert(sub, parameter(section)?);
                }
                _ => return Err(Problem::StraySub(section.name.into()).at(section.line)),
            }
        }
        for section in &sections {
            eds.check_listed(section)?;
        }
        Ok(eds)
    }

    /// `[1234Name]`: names of subindices that `CompactSubObj` described.
    fn name_compact_subs(&mut self, section: &Section<'_>) {
        let Some((index, rest)) = section.name.split_at_checked(4) else {
            return;
        };
        if !rest.eq_ignore_ascii_case("Name") {
            return;
        }
        let Some(object) = object_index(index).and_then(|index| self.objects.get_mut(&index))
        else {
            return;
        };
        for &(key, name, _) in &section.pairs {
            let sub = key.parse().ok().and_then(|sub| object.subs.get_mut(&sub));
            if let Some(parameter) = sub {
                parameter.name = name.into();
            }
        }
    }

    /// What `[MandatoryObjects]` and its like list has to be described.
    fn check_listed(&self, section: &Section<'_>) -> Result<(), ParseError> {
        let is_list = ["MandatoryObjects", "OptionalObjects", "ManufacturerObjects"]
            .iter()
            .any(|name| section.name.eq_ignore_ascii_case(name));
        if !is_list {
            return Ok(());
        }
        for &(key, value, line) in &section.pairs {
            if key.parse::<u16>().is_err() || value.is_empty() {
                continue;
            }
            let index = number(value)
                .and_then(|index| u16::try_from(index).ok())
                .ok_or_else(|| unexpected(key, value, "an index").at(line))?;
            if !self.objects.contains_key(&index) {
                return Err(Problem::NotDescribed(index).at(line));
            }
        }
        Ok(())
    }
}

fn sections(text: &str) -> Result<Vec<Section<'_>>, ParseError> {
    let mut sections: Vec<Section<'_>> = Vec::new();
    let mut names = BTreeMap::new();
    let text = text.strip_prefix('\u{FEFF}').unwrap_or(text);
    for (line, content) in (1..).zip(text.lines()) {
        let content = content.trim();
        if content.is_empty() || content.starts_with(';') || content.starts_with('#') {
            continue;
        }
        if let Some(rest) = content.strip_prefix('[') {
            let Some(name) = rest.strip_suffix(']') else {
                return Err(Problem::Line.at(line));
            };
            if names.insert(name.to_ascii_lowercase(), ()).is_some() {
                return Err(Problem::SectionTwice(name.into()).at(line));
            }
            sections.push(Section {
                name,
                line,
                pairs: Vec::new(),
            });
        } else if let Some((key, value)) = content.split_once('=') {
            let Some(section) = sections.last_mut() else {
                return Err(Problem::NoSection.at(line));
            };
            section.pairs.push((key.trim(), value.trim(), line));
        } else {
            return Err(Problem::Line.at(line));
        }
    }
    Ok(sections)
}

/// The index that a section describes: four hexadecimal digits.
fn object_index(name: &str) -> Option<u16> {
    (name.len() == 4)
        .then(|| unsigned(name, 16))
        .flatten()
        .map(|index| index as u16)
}

/// Index and subindex that a section describes: `1018sub1`.
fn sub_index(name: &str) -> Option<(u16, u8)> {
    let (index, rest) = name.split_at_checked(4)?;
    let (word, sub) = rest.split_at_checked(3)?;
    if !word.eq_ignore_ascii_case("sub") || sub.is_empty() {
        return None;
    }
    let sub = u8::try_from(unsigned(sub, 16)?).ok()?;
    Some((object_index(index)?, sub))
}

fn object(section: &Section<'_>) -> Result<Object, ParseError> {
    let (name, _) = section.required("ParameterName")?;
    let number = section.number("ObjectType")?;
    let object_type = match number {
        None => ObjectType::Var,
        Some(number) => ObjectType::from_number(number).ok_or_else(|| {
            let line = section
                .get("ObjectType")
                .map_or(section.line, |(_, line)| line);
            unexpected("ObjectType", &number.to_string(), "0, 2 or 5 to 9").at(line)
        })?,
    };
    let mut subs = BTreeMap::new();
    match object_type {
        ObjectType::Null | ObjectType::DefType => {}
        ObjectType::Var | ObjectType::Domain => {
            subs.insert(0, parameter(section)?);
        }
        ObjectType::Array | ObjectType::Record | ObjectType::DefStruct => {
            if let Some(count) = section.number("CompactSubObj")?.filter(|&count| count > 0) {
                subs = compact_subs(section, name, count)?;
            }
        }
    }
    Ok(Object {
        name: name.into(),
        object_type,
        subs,
    })
}

/// Subindices that are all alike, described together.
fn compact_subs(
    section: &Section<'_>,
    name: &str,
    count: i64,
) -> Result<BTreeMap<u8, Parameter>, ParseError> {
    let count = u8::try_from(count).ok().filter(|&count| count < 255);
    let count = count.ok_or_else(|| {
        let (value, line) = section.get("CompactSubObj").unwrap_or(("", section.line));
        unexpected("CompactSubObj", value, "0 to 254").at(line)
    })?;
    let alike = parameter(section)?;
    let numbers = Parameter {
        name: "NrOfObjects".into(),
        data_type: 0x05,
        access: Access::Ro,
        pdo_mapping: false,
        default: Some(Value::Number(count.into())),
        low: None,
        high: None,
    };
    let mut subs = BTreeMap::from([(0, numbers)]);
    subs.extend((1..=count).map(|sub| {
        let name = format!("{name}{sub}");
        let alike = alike.clone();
        (sub, Parameter { name, ..alike })
    }));
    Ok(subs)
}

fn parameter(section: &Section<'_>) -> Result<Parameter, ParseError> {
    let (name, _) = section.required("ParameterName")?;
    let data_type = match section.number("DataType")? {
        Some(number) => u16::try_from(number).map_err(|_| {
            let (value, line) = section.get("DataType").unwrap_or(("", section.line));
            unexpected("DataType", value, "0000h to FFFFh").at(line)
        })?,
        // A domain needs no data type.
        None if section.number("ObjectType")? == Some(0x2) => 0x0F,
        None => {
            section.required("DataType")?;
            0
        }
    };
    let access = match section.get("AccessType") {
        Some((value, line)) => {
            let mut known = Access::ALL.iter();
            known
                .find(|(name, _)| name.eq_ignore_ascii_case(value))
                .map(|&(_, access)| access)
                .ok_or_else(|| {
                    unexpected("AccessType", value, "const, ro, wo, rw, rwr or rww").at(line)
                })?
        }
        None if data_type == 0x0F => Access::Rw,
        None => {
            section.required("AccessType")?;
            Access::Rw
        }
    };
    let value = |key| parameter_value(section, key, data_type);
    Ok(Parameter {
        name: name.into(),
        data_type,
        access,
        pdo_mapping: section.flag("PDOMapping")?,
        default: value("DefaultValue")?,
        low: value("LowLimit")?,
        high: value("HighLimit")?,
    })
}

fn parameter_value(
    section: &Section<'_>,
    key: &'static str,
    data_type: u16,
) -> Result<Option<Value>, ParseError> {
    let Some((text, line)) = section.get(key).filter(|(text, _)| !text.is_empty()) else {
        return Ok(None);
    };
    if !is_integer(data_type) {
        return Ok(Some(Value::Text(text.into())));
    }
    let value = match plus_node(text) {
        Some(rest) => number(rest).map(Value::PlusNode),
        None => number(text).map(|number| Value::Number(signed(number, data_type))),
    };
    match value {
        Some(value) => Ok(Some(value)),
        None => Err(unexpected(key, text, "a number").at(line)),
    }
}

/// The number in `$NODEID+number` or `number+$NODEID`; 0 for `$NODEID` alone.
fn plus_node(text: &str) -> Option<&str> {
    const NODE_ID: &str = "$NODEID";
    let head = text.get(..NODE_ID.len());
    if head.is_some_and(|head| head.eq_ignore_ascii_case(NODE_ID)) {
        let rest = text[NODE_ID.len()..].trim_start();
        return Some(match rest.strip_prefix('+') {
            Some(number) => number.trim_start(),
            None if rest.is_empty() => "0",
            None => rest,
        });
    }
    let place = text.len().checked_sub(NODE_ID.len())?;
    let tail = text.get(place..)?;
    if !tail.eq_ignore_ascii_case(NODE_ID) {
        return None;
    }
    Some(text[..place].trim_end().strip_suffix('+')?.trim_end())
}

/// A negative number may stand as the bit pattern of its type: FFh in an INTEGER8.
fn signed(number: i64, data_type: u16) -> i64 {
    let bits = match data_type {
        0x02 => 8,
        0x03 => 16,
        0x10 => 24,
        0x04 => 32,
        0x12 => 40,
        0x13 => 48,
        0x14 => 56,
        _ => return number,
    };
    if (1 << (bits - 1)..1 << bits).contains(&number) {
        number - (1 << bits)
    } else {
        number
    }
}
