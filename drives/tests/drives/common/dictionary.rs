//! What the tests of all object dictionaries share: a table that a script took from the reference, and
//! what a device answers differently.

use core::fmt::Debug;

pub(crate) const NO_ACCESS: u32 = 0x0601_0000;
pub(crate) const WRITE_ONLY: u32 = 0x0601_0001;
pub(crate) const READ_ONLY: u32 = 0x0601_0002;
pub(crate) const UNKNOWN_OBJECT: u32 = 0x0602_0000;
pub(crate) const NOT_MAPPABLE: u32 = 0x0604_0041;
pub(crate) const TOO_LONG: u32 = 0x0607_0012;
pub(crate) const TOO_SHORT: u32 = 0x0607_0013;
pub(crate) const UNKNOWN_SUBINDEX: u32 = 0x0609_0011;
pub(crate) const INVALID: u32 = 0x0609_0030;

/// The rows of a table, from their fields.
pub(crate) fn rows<R>(table: &str, row: impl Fn(&[&str]) -> R) -> Vec<R> {
    let lines = table.lines().filter(|line| !line.starts_with('#'));
    let fields = |line: &str| row(&line.split(',').collect::<Vec<_>>());
    lines.map(fields).collect()
}

/// The bytes that a default of a table stands for, if it is one: a text in quotation marks, a number
/// in this radix, or `id+` and a number.
pub(crate) fn default_bytes(text: &str, node: u8, radix: u32, bytes: usize) -> Option<Vec<u8>> {
    if let Some(text) = text.strip_prefix('"') {
        return Some(text.trim_end_matches('"').into());
    }
    let number = match text.strip_prefix("id+") {
        Some(base) => i64::from_str_radix(base, radix).unwrap() + i64::from(node),
        None => i64::from_str_radix(text, radix).ok()?,
    };
    Some(number.to_le_bytes()[..bytes].to_vec())
}

/// Lengths that are one byte off, as far as an expedited transfer has them, and the refusal of each.
pub(crate) fn one_byte_off(bytes: usize) -> Vec<(usize, u32)> {
    let mut lengths = vec![];
    if bytes < 4 {
        lengths.push((bytes + 1, TOO_LONG));
    }
    if (2..=4).contains(&bytes) {
        lengths.push((bytes - 1, TOO_SHORT));
    }
    lengths
}

/// What one row answers that the expected table does not say, a line each.
pub(crate) struct Differences {
    row: (u16, u8),
    found: Vec<String>,
}

impl Differences {
    pub(crate) fn of(index: u16, sub: u8) -> Self {
        Self {
            row: (index, sub),
            found: vec![],
        }
    }

    pub(crate) fn check<T: Debug + PartialEq>(&mut self, what: &str, got: T, expected: T) {
        if got != expected {
            let (index, sub) = self.row;
            self.found.push(format!(
                "{index:04X}:{sub:X} {what}: {got:X?}, expected {expected:X?}"
            ));
        }
    }

    pub(crate) fn found(self) -> Vec<String> {
        self.found
    }
}

/// Fails with what has been found.
pub(crate) fn assert_none(found: &[String]) {
    let count = found.len();
    assert!(
        found.is_empty(),
        "{count} differences:\n{}",
        found.join("\n")
    );
}
