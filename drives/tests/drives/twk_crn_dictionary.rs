//! The encoder's whole object dictionary over the bus, against a table that a script of its own
//! (`data/extract_twk_crn_dictionary.py`) took from the reference.

use crate::common::dictionary::{
    self, Differences, READ_ONLY, UNKNOWN_OBJECT, UNKNOWN_SUBINDEX, assert_none, default_bytes,
};
use crate::common::{Bench, id};
use syncline_drives::dictionary::{TWK_CRN_4096, TWK_CRN_8192};
use syncline_drives::twin::node::Processor;
use syncline_drives::twin::twk_crn::{Resolution, Twin, TwinConfig, Version};

const TABLE: &str = include_str!("data/twk_crn_dictionary.csv");

struct Row {
    index: u16,
    sub: u8,
    bytes: usize,
    signed: bool,
    access: String,
    t_pdo: bool,
    /// With 4096 and with 8192 steps.
    defaults: [String; 2],
}

fn rows() -> Vec<Row> {
    dictionary::rows(TABLE, |fields| Row {
        index: u16::from_str_radix(fields[0], 16).unwrap(),
        sub: u8::from_str_radix(fields[1], 16).unwrap(),
        bytes: fields[2].parse().unwrap(),
        signed: fields[3] == "1",
        access: fields[4].into(),
        t_pdo: fields[5] == "1",
        defaults: [fields[6].into(), fields[7].into()],
    })
}

fn bench(node: u8, resolution: Resolution, version: Version) -> Bench<Twin> {
    Bench::of([Twin::new(TwinConfig {
        resolution,
        version,
        // Within the work area with either disc.
        position: 500.0,
        processor: Processor::prompt(id(node)),
        ..TwinConfig::new(id(node))
    })])
}

/// What a row answers that the expected table does not say; each a line.
fn differences(bench: &mut Bench<Twin>, node: u8, row: &Row, default: &str) -> Vec<String> {
    let mut differences = Differences::of(row.index, row.sub);
    let value = bench.upload(node, row.index, row.sub);
    let size = value.clone().map(|bytes| bytes.len());
    differences.check("size", size, Ok(row.bytes));
    // Of the node id the version with a plug has another one already.
    let default = default_bytes(default, node, 16, row.bytes);
    if let Some(expected) = default.filter(|_| row.index != 0x2000) {
        differences.check("default", value.clone(), Ok(expected));
    }
    let read_only = row.access != "rw";
    for (length, refusal) in dictionary::one_byte_off(row.bytes) {
        let refusal = if read_only { READ_ONLY } else { refusal };
        let got = bench.write(node, row.index, row.sub, &[1; 4][..length]);
        differences.check("one byte off", got, Err(refusal));
    }
    let access = match (row.access.as_str(), &value) {
        // What it holds it takes as well.
        ("rw", Ok(bytes)) => bench.write(node, row.index, row.sub, bytes),
        _ => bench.write(node, row.index, row.sub, &[0; 4][..row.bytes.min(4)]),
    };
    let expected = if read_only { Err(READ_ONLY) } else { Ok(()) };
    differences.check("access", access, expected);
    differences.found()
}

#[test]
fn every_row_answers_as_the_manual_lists_it() {
    let rows = rows();
    assert_eq!(rows.len(), 64);
    let mut found = vec![];
    for (version, node) in [(Version::Plug, 1), (Version::ConnectingCap, 5)] {
        for (place, resolution) in [Resolution::Steps4096, Resolution::Steps8192]
            .into_iter()
            .enumerate()
        {
            for row in &rows {
                // A row at a time: some of what is written has effects.
                let mut bench = bench(node, resolution, version);
                found.extend(differences(&mut bench, node, row, &row.defaults[place]));
            }
        }
    }
    assert_none(&found);
}

/// What the bus does not tell: signs, and which rows may be mapped (the mapping is read only).
#[test]
fn signs_and_mappability() {
    for table in [TWK_CRN_4096, TWK_CRN_8192] {
        assert_eq!(table.len(), rows().len());
        for (entry, row) in table.iter().zip(rows()) {
            let address = entry.address;
            assert_eq!((address.index, address.sub), (row.index, row.sub));
            assert_eq!(entry.data_type.is_signed(), row.signed, "{address}");
            assert_eq!(entry.mappable.t_pdo, row.t_pdo, "{address}");
            assert!(!entry.mappable.r_pdo, "{address}");
        }
    }
}

#[test]
fn what_is_not_in_the_table_does_not_answer() {
    let mut bench = bench(1, Resolution::Steps8192, Version::Plug);
    // No heartbeat, no identity, no second PDO at 1801h.
    for index in [
        0x1016, 0x1017, 0x1018, 0x1200, 0x1400, 0x1801, 0x6030, 0x6300,
    ] {
        assert_eq!(bench.read(1, index, 0), Err(UNKNOWN_OBJECT), "{index:04X}");
    }
    for row in rows() {
        let subs = rows().into_iter().filter(|other| other.index == row.index);
        let beyond = subs.map(|row| row.sub).max().unwrap_or(0) + 1;
        let answer = bench.read(1, row.index, beyond);
        assert_eq!(answer, Err(UNKNOWN_SUBINDEX), "{:04X}", row.index);
    }
}

#[test]
fn a_difference_is_found() {
    let mut bench = bench(1, Resolution::Steps8192, Version::Plug);
    let mut row = rows().remove(0);
    row.bytes = 2;
    row.access = "rw".into();
    let found = differences(&mut bench, 1, &row, "1234");
    assert_eq!(found.len(), 5, "{found:#?}");
}
