//! The whole object dictionary over the bus, against a table that a script of its own
//! (`data/extract_lxm32m_dictionary.py`) took from the reference.

use crate::common::dictionary::{
    self, Differences, NOT_MAPPABLE, READ_ONLY, TOO_LONG, TOO_SHORT, UNKNOWN_OBJECT,
    UNKNOWN_SUBINDEX, assert_none,
};
use crate::common::lxm32m::Bench;
use std::collections::BTreeMap;

const TABLE: &str = include_str!("data/lxm32m_dictionary.csv");

struct Row {
    index: u16,
    sub: u8,
    bytes: usize,
    read_only: bool,
    known: String,
    r_pdo: bool,
    t_pdo: bool,
}

fn rows() -> Vec<Row> {
    dictionary::rows(TABLE, |fields| Row {
        index: u16::from_str_radix(fields[0], 16).unwrap(),
        sub: u8::from_str_radix(fields[1], 16).unwrap(),
        bytes: fields[2].parse().unwrap(),
        read_only: fields[3] == "RO",
        known: fields[4].into(),
        r_pdo: fields[5] == "1",
        t_pdo: fields[6] == "1",
    })
}

/// Downloads zeros of `bytes` length; more than 4 bytes are only announced.
fn downloaded(bench: &mut Bench, row: &Row, bytes: usize) -> Result<(), u32> {
    if bytes <= 4 {
        return bench.write(1, row.index, row.sub, &[0; 4][..bytes]);
    }
    let [low, high] = row.index.to_le_bytes();
    let answer = bench.request(1, [0x21, low, high, row.sub, bytes as u8, 0, 0, 0]);
    match answer[0] {
        0x80 => Err(u32::from_le_bytes(answer[4..].try_into().unwrap())),
        _ => Ok(()),
    }
}

/// What a row answers that the expected table does not say; each a line.
fn differences(bench: &mut Bench, row: &Row) -> Vec<String> {
    let mut differences = Differences::of(row.index, row.sub);
    let size = bench.upload(1, row.index, row.sub).map(|bytes| bytes.len());
    differences.check("upload", size, Ok(row.bytes));
    let mut lengths = vec![(row.bytes + 1, TOO_LONG)];
    if row.bytes > 1 {
        lengths.push((row.bytes - 1, TOO_SHORT));
    }
    for (bytes, refusal) in lengths {
        let refusal = if row.read_only { READ_ONLY } else { refusal };
        let got = downloaded(bench, row, bytes);
        differences.check("one byte off", got, Err(refusal));
    }
    if row.read_only {
        let got = downloaded(bench, row, row.bytes);
        differences.check("download", got, Err(READ_ONLY));
    }
    let entry = (u32::from(row.index) << 16) | (u32::from(row.sub) << 8) | (row.bytes as u32 * 8);
    for (mapping, mappable) in [(0x1603, row.r_pdo), (0x1A03, row.t_pdo)] {
        let got = bench.write(1, mapping, 1, &entry.to_le_bytes());
        let expected = if mappable { Ok(()) } else { Err(NOT_MAPPABLE) };
        differences.check(&format!("mapping {mapping:X}"), got, expected);
    }
    differences.found()
}

#[test]
fn every_row_answers_as_the_manual_lists_it() {
    let rows = rows();
    assert_eq!(rows.len(), 846);
    let mut bench = Bench::one();
    let mut counted: BTreeMap<&str, usize> = BTreeMap::new();
    let mut found = vec![];
    for row in &rows {
        *counted.entry(row.known.as_str()).or_default() += 1;
        found.extend(differences(&mut bench, row));
    }
    // Rows whose access is only inferred from the name, or on which overview and detail of the
    // manual differ, are counted apart.
    println!("rows by how their access is known: {counted:?}");
    assert_none(&found);
}

#[test]
fn what_is_not_in_the_table_does_not_answer() {
    let mut bench = Bench::one();
    // Named in the text, absent from the dictionary (D-03).
    assert_eq!(bench.read(1, 0x1006, 0), Err(UNKNOWN_OBJECT));
    assert_eq!(bench.read(1, 0x1010, 1), Err(UNKNOWN_OBJECT));
    assert_eq!(bench.read(1, 0x6040, 5), Err(UNKNOWN_SUBINDEX));
    let known: Vec<(u16, u8)> = rows().iter().map(|row| (row.index, row.sub)).collect();
    let own = [(0x3006, 0x3D), (0x607D, 0)];
    let mut bench = Bench::one();
    for &(index, _) in &known {
        let next = known
            .iter()
            .filter(|row| row.0 == index)
            .map(|row| row.1)
            .max();
        let beyond = next.unwrap_or(0) + 1;
        if !own.contains(&(index, beyond)) {
            assert_eq!(
                bench.read(1, index, beyond),
                Err(UNKNOWN_SUBINDEX),
                "{index:04X}"
            );
        }
    }
}

#[test]
fn a_difference_is_found() {
    let mut bench = Bench::one();
    let mut row = rows().remove(0);
    row.bytes = 2;
    row.read_only = false;
    row.t_pdo = true;
    assert_eq!(differences(&mut bench, &row).len(), 4);
}
