//! The controller's whole object dictionary over the bus, against a table that a script of its own
//! (`data/extract_tlc5xx_dictionary.py`) took from the reference: the 342 entries that the manual
//! prints.

use crate::common::dictionary::{
    self, Differences, INVALID, NO_ACCESS, NOT_MAPPABLE, READ_ONLY, UNKNOWN_OBJECT,
    UNKNOWN_SUBINDEX, WRITE_ONLY, assert_none,
};
use crate::common::{Bench, id};
use syncline_drives::dictionary::{TLC5XX, TLC5XX_PRINTED};
use syncline_drives::twin::node::Processor;
use syncline_drives::twin::tlc5xx::{Twin, TwinConfig};

const TABLE: &str = include_str!("data/tlc5xx_dictionary.csv");

/// Not the printed default, and why.
const OTHER_DEFAULTS: [(u16, &str); 4] = [
    (0x1003, "1 error although there is none (D-31)"),
    (0x2041, "0 is no state: the number of the present one"),
    (0x2062, "0 with the power stage off: bit 15 (11019)"),
    (0x606C, "1 at standstill: the present velocity"),
];

/// Printed ranges that another rule narrows or widens, and why.
const OTHER_RANGES: [(u16, &str); 3] = [
    (0x6060, "the four modes alone (15225)"),
    (
        0x6098,
        "the nine methods alone, and 0 to 255 is no I8 (D-26)",
    ),
    (0x6081, "negative values of an U32 (D-26)"),
];

struct Row {
    index: u16,
    sub: u8,
    bytes: usize,
    access: String,
    pdo: String,
    range: Option<(i64, i64)>,
    default: String,
}

fn rows() -> Vec<Row> {
    dictionary::rows(TABLE, |fields| {
        let limits = fields[5].parse().ok().zip(fields[6].parse().ok());
        Row {
            index: u16::from_str_radix(fields[0], 16).unwrap(),
            sub: u8::from_str_radix(fields[1], 16).unwrap(),
            bytes: fields[2].parse().unwrap(),
            access: fields[3].into(),
            pdo: fields[4].into(),
            range: limits,
            default: fields[7].into(),
        }
    })
}

fn bench() -> Bench<Twin> {
    let config = TwinConfig {
        processor: Processor::prompt(id(1)),
        ..TwinConfig::new(id(1))
    };
    Bench::of([Twin::new(config).unwrap()])
}

impl Row {
    /// Whether it is the entry of a PDO record that answers with an error (7750-7751).
    fn is_compatibility_entry(&self) -> bool {
        matches!(self.index, 0x1400..=0x1403 | 0x1800..=0x1803) && self.sub == 4
    }

    fn bytes_of(&self, value: i64) -> Vec<u8> {
        value.to_le_bytes()[..self.bytes.min(4)].to_vec()
    }

    /// The whole numbers just outside of its range that its bytes can hold.
    fn outside(&self) -> Vec<i64> {
        let Some((least, greatest)) = self.range else {
            return vec![];
        };
        let signed = least < 0;
        let bits = self.bytes as u32 * 8;
        let (lowest, highest) = match signed {
            true => (-(1_i64 << (bits - 1)), (1_i64 << (bits - 1)) - 1),
            false => (0, (1_i64 << bits) - 1),
        };
        let around = [least - 1, greatest + 1].into_iter();
        around
            .filter(|value| (lowest..=highest).contains(value))
            .collect()
    }
}

/// What a row answers that the expected table does not say; each a line.
fn differences(bench: &mut Bench<Twin>, row: &Row) -> Vec<String> {
    let mut differences = Differences::of(row.index, row.sub);
    let value = bench.upload(1, row.index, row.sub);
    let refusal = match row.access.as_str() {
        _ if row.is_compatibility_entry() => Some(NO_ACCESS),
        "wo" => Some(WRITE_ONLY),
        _ => None,
    };
    match refusal {
        Some(refusal) => differences.check("read", value.clone(), Err(refusal)),
        None => {
            let size = value.clone().map(|bytes| vec![bytes.len() as u8]);
            // Texts have their printed length at most.
            if row.bytes <= 4 {
                differences.check("size", size, Ok(vec![row.bytes as u8]));
            }
            let is_other = OTHER_DEFAULTS.iter().any(|(index, _)| *index == row.index);
            if let Some(default) = dictionary::default_bytes(&row.default, 1, 10, row.bytes.min(4))
                .filter(|_| !is_other)
            {
                differences.check("default", value.clone(), Ok(default));
            }
        }
    }
    let read_only = row.access == "ro";
    for (length, refusal) in dictionary::one_byte_off(row.bytes) {
        let refusal = if read_only { READ_ONLY } else { refusal };
        let got = bench.write(1, row.index, row.sub, &[1; 4][..length]);
        differences.check("one byte off", got, Err(refusal));
    }
    let zeros = vec![0; row.bytes.min(4)];
    let kept = value.unwrap_or(zeros);
    let expected = match row.access.as_str() {
        "ro" => Err(READ_ONLY),
        _ if row.is_compatibility_entry() => Err(NO_ACCESS),
        // It takes no number but those of modes.
        _ if row.index == 0x6060 => Err(INVALID),
        _ => Ok(()),
    };
    // Entries of a mapping are changed while its count is 0 (1721).
    let is_mapping = matches!(row.index, 0x1600..=0x1603 | 0x1A00..=0x1A03);
    if is_mapping && row.sub > 0 && !read_only {
        bench.write(1, row.index, 0, &[0]).unwrap();
    }
    if row.bytes <= 4 || read_only {
        let got = bench.write(1, row.index, row.sub, &kept[..kept.len().min(4)]);
        differences.check("write", got, expected);
    }
    let is_other = OTHER_RANGES.iter().any(|(index, _)| *index == row.index);
    // The count of a dynamic mapping is 0 while it is changed (1721), and more than it has places is
    // a mapping error.
    let is_count = matches!(row.index, 0x1600..=0x1602 | 0x1A00..=0x1A02) && row.sub == 0;
    if row.access != "ro" && !is_other && !is_count {
        for value in row.outside() {
            let got = bench.write(1, row.index, row.sub, &row.bytes_of(value));
            differences.check(&format!("{value}"), got, Err(INVALID));
        }
    }
    let entry = (u32::from(row.index) << 16) | (u32::from(row.sub) << 8) | (row.bytes as u32 * 8);
    for (mapping, letter) in [(0x1602, "R"), (0x1A02, "T")] {
        bench.write(1, mapping, 0, &[0]).unwrap();
        let got = bench.write(1, mapping, 1, &entry.to_le_bytes());
        let expected = match row.pdo == letter {
            true => Ok(()),
            false => Err(NOT_MAPPABLE),
        };
        differences.check(&format!("mapping {mapping:X}"), got, expected);
    }
    differences.found()
}

#[test]
fn every_row_answers_as_the_manual_lists_it() {
    let rows = rows();
    assert_eq!(rows.len(), 342);
    let mut found = vec![];
    for row in &rows {
        // A row at a time: some of what is written has effects.
        found.extend(differences(&mut bench(), row));
    }
    assert_none(&found);
}

#[test]
fn the_table_has_a_row_for_each_and_for_all_of_an_array() {
    let rows = rows();
    assert_eq!(TLC5XX_PRINTED.len(), rows.len());
    for (entry, row) in TLC5XX_PRINTED.iter().zip(&rows) {
        let address = entry.address;
        assert_eq!((address.index, address.sub), (row.index, row.sub));
    }
    let subs = |index: u16| {
        let rows = TLC5XX.iter().filter(|entry| entry.address.index == index);
        rows.map(|entry| entry.address.sub).collect::<Vec<u8>>()
    };
    for index in 0x2100..=0x2104 {
        assert_eq!(subs(index), Vec::from_iter(0..=40));
    }
    for index in (0x2200..=0x2203).chain(0x2300..=0x2303) {
        assert_eq!(subs(index), Vec::from_iter(0..=64));
    }
    assert_eq!(subs(0x2400), Vec::from_iter(0..=20));
    for index in (0x1600..=0x1602).chain(0x1A00..=0x1A02) {
        assert_eq!(subs(index), Vec::from_iter(0..=8));
    }
}

/// Named in the text, without an entry (D-25), and what this device has not.
#[test]
fn what_is_not_in_the_table_does_not_answer() {
    let mut bench = bench();
    for index in [
        0x1004, 0x100E, 0x1010, 0x1011, 0x1029, 0x1200, 0x2051, 0x6066, 0x60C1, 0x60C2, 0x6502,
    ] {
        assert_eq!(bench.read(1, index, 0), Err(UNKNOWN_OBJECT), "{index:04X}");
    }
    assert_eq!(bench.read(1, 0x6040, 1), Err(UNKNOWN_SUBINDEX));
    assert_eq!(bench.read(1, 0x6410, 2), Err(UNKNOWN_SUBINDEX));
}

#[test]
fn a_difference_is_found() {
    let mut row = rows().remove(0);
    row.bytes = 2;
    row.access = "rw".into();
    row.pdo = "T".into();
    row.range = Some((1, 5));
    let found = differences(&mut bench(), &row);
    assert_eq!(found.len(), 8, "{found:#?}");
}
