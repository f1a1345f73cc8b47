//! The stepper controller's whole object dictionary over the bus, against a table that a script of
//! its own (`data/extract_tsp10_dictionary.py`) took from the reference.

use crate::common::dictionary::{
    self, Differences, INVALID, READ_ONLY, TOO_LONG, TOO_SHORT, UNKNOWN_OBJECT, UNKNOWN_SUBINDEX,
    assert_none,
};
use crate::common::{Bench, id};
use syncline_drives::dictionary::TSP10;
use syncline_drives::twin::node::Processor;
use syncline_drives::twin::tsp10::{Twin, TwinConfig};

const TABLE: &str = include_str!("data/tsp10_dictionary.csv");

struct Row {
    index: u16,
    sub: u8,
    bytes: usize,
    writable: bool,
    mappable: bool,
    range: Option<(i64, i64)>,
    default: String,
}

fn rows() -> Vec<Row> {
    dictionary::rows(TABLE, |fields| Row {
        index: u16::from_str_radix(fields[0], 16).unwrap(),
        sub: fields[1].parse().unwrap(),
        bytes: fields[2].parse().unwrap(),
        writable: fields[3] == "rw",
        mappable: fields[4] == "1",
        range: fields[5].parse().ok().zip(fields[6].parse().ok()),
        default: fields[7].into(),
    })
}

fn bench() -> Bench<Twin> {
    Bench::of([Twin::new(TwinConfig {
        processor: Processor::prompt(id(1)),
        ..TwinConfig::new(id(1))
    })])
}

impl Row {
    fn bytes_of(&self, value: i64) -> Vec<u8> {
        value.to_le_bytes()[..self.bytes].to_vec()
    }
}

/// What a row answers that the expected table does not say; each a line.
fn differences(bench: &mut Bench<Twin>, row: &Row) -> Vec<String> {
    let mut differences = Differences::of(row.index, row.sub);
    let value = bench.upload(1, row.index, row.sub);
    let size = value.clone().map(|bytes| vec![bytes.len() as u8]);
    differences.check("size", size, Ok(vec![row.bytes as u8]));
    if let Some(default) = dictionary::default_bytes(&row.default, 1, 10, row.bytes) {
        differences.check("default", value.clone(), Ok(default));
    }
    let refused = |refusal: u32| Err(if row.writable { refusal } else { READ_ONLY });
    if row.bytes < 4 {
        let got = bench.write(1, row.index, row.sub, &[1; 4][..row.bytes + 1]);
        differences.check("too long", got, refused(TOO_LONG));
    }
    if row.bytes > 1 {
        let got = bench.write(1, row.index, row.sub, &[1; 4][..row.bytes - 1]);
        differences.check("too short", got, refused(TOO_SHORT));
    }
    let kept = value.unwrap_or_default();
    let got = bench.write(1, row.index, row.sub, &kept[..kept.len().clamp(1, 4)]);
    let expected = if row.writable { Ok(()) } else { Err(READ_ONLY) };
    differences.check("write", got, expected);
    if let Some((least, greatest)) = row.range.filter(|_| row.writable) {
        let edges = [
            (least - 1, least != 0),
            (greatest + 1, greatest < 0xFFFF_FFFF),
        ];
        for (outside, _) in edges.into_iter().filter(|(_, fits)| *fits) {
            let got = bench.write(1, row.index, row.sub, &row.bytes_of(outside));
            differences.check("outside", got, Err(INVALID));
        }
    }
    differences.found()
}

#[test]
fn every_row_answers_as_the_manual_lists_it() {
    let rows = rows();
    assert_eq!(rows.len(), 63);
    let mut found = vec![];
    for row in &rows {
        found.extend(differences(&mut bench(), row));
    }
    assert_none(&found);
}

/// Besides the printed rows there is the subindex 0 of each record and array, which the manual never
/// prints; mappings are constant, so what may be mapped is not told over the bus.
#[test]
fn the_table_has_the_printed_rows_and_the_counts() {
    let rows = rows();
    let mut printed = rows.iter();
    for entry in TSP10.iter().filter(|entry| !entry.inferred) {
        let row = printed.next().unwrap();
        let address = entry.address;
        assert_eq!((address.index, address.sub), (row.index, row.sub));
        let mappable = entry.mappable.r_pdo || entry.mappable.t_pdo;
        assert_eq!(mappable, row.mappable, "{address}");
    }
    assert!(printed.next().is_none());
    let counts = TSP10.iter().filter(|entry| entry.inferred);
    assert!(counts.clone().all(|entry| entry.address.sub == 0));
    assert_eq!(counts.count(), 14);
}

/// No heartbeat, no guarding, no SYNC, no emergency, no store.
#[test]
fn what_is_not_in_the_table_does_not_answer() {
    let mut bench = bench();
    for index in [
        0x1003, 0x1005, 0x1006, 0x100C, 0x100D, 0x1010, 0x1014, 0x1016, 0x1017, 0x603F, 0x605A,
        0x6065, 0x607D, 0x6502,
    ] {
        assert_eq!(bench.read(1, index, 0), Err(UNKNOWN_OBJECT), "{index:04X}");
    }
    assert_eq!(bench.read(1, 0x1800, 3), Err(UNKNOWN_SUBINDEX));
}

#[test]
fn a_difference_is_found() {
    let mut row = rows().remove(0);
    row.bytes = 2;
    row.writable = true;
    let found = differences(&mut bench(), &row);
    assert_eq!(found.len(), 5, "{found:#?}");
}
