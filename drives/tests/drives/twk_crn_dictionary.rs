//! The encoder's whole object dictionary over the bus, against a table that a script of its own
//! (`data/extract_twk_crn_dictionary.py`) took from the reference.

use crate::common::{Bench, id};
use syncline_drives::dictionary::{TWK_CRN_4096, TWK_CRN_8192};
use syncline_drives::twin::node::Delays;
use syncline_drives::twin::twk_crn::{Resolution, Twin, TwinConfig, Version};

const TABLE: &str = include_str!("data/twk_crn_dictionary.csv");

const READ_ONLY: u32 = 0x0601_0002;
const UNKNOWN_OBJECT: u32 = 0x0602_0000;
const TOO_LONG: u32 = 0x0607_0012;
const TOO_SHORT: u32 = 0x0607_0013;
const UNKNOWN_SUBINDEX: u32 = 0x0609_0011;

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
    let parse = |line: &str| {
        let fields: Vec<&str> = line.split(',').collect();
        Row {
            index: u16::from_str_radix(fields[0], 16).unwrap(),
            sub: u8::from_str_radix(fields[1], 16).unwrap(),
            bytes: fields[2].parse().unwrap(),
            signed: fields[3] == "1",
            access: fields[4].into(),
            t_pdo: fields[5] == "1",
            defaults: [fields[6].into(), fields[7].into()],
        }
    };
    let lines = TABLE.lines().filter(|line| !line.starts_with('#'));
    lines.map(parse).collect()
}

fn bench(node: u8, resolution: Resolution, version: Version) -> Bench<Twin> {
    Bench::of([Twin::new(TwinConfig {
        resolution,
        version,
        // Within the work area with either disc.
        position: 500.0,
        delays: Delays::NONE,
        boot_time: core::time::Duration::ZERO,
        ..TwinConfig::new(id(node))
    })])
}

/// The bytes that a default of the table stands for, if it has one.
fn bytes(row: &Row, node: u8, default: &str) -> Option<Vec<u8>> {
    if let Some(text) = default.strip_prefix('"') {
        return Some(text.trim_end_matches('"').into());
    }
    let number = match default.strip_prefix("id+") {
        Some(base) => u32::from_str_radix(base, 16).unwrap() + u32::from(node),
        None => u32::from_str_radix(default, 16).ok()?,
    };
    Some(number.to_le_bytes()[..row.bytes].to_vec())
}

/// What a row answers that the expected table does not say; each a line.
fn differences(bench: &mut Bench<Twin>, node: u8, row: &Row, default: &str) -> Vec<String> {
    let mut found = vec![];
    let mut check = |what: &str, got: String, expected: String| {
        if got != expected {
            found.push(format!(
                "{:04X}:{:X} {what}: {got}, expected {expected}",
                row.index, row.sub
            ));
        }
    };
    let value = bench.upload(node, row.index, row.sub);
    let size = value.clone().map(|bytes| bytes.len());
    check("size", format!("{size:X?}"), format!("Ok({:X})", row.bytes));
    // Of the node id the version with a plug has another one already.
    if let Some(expected) = bytes(row, node, default).filter(|_| row.index != 0x2000) {
        check(
            "default",
            format!("{value:X?}"),
            format!("{:X?}", Ok::<_, u32>(expected)),
        );
    }
    let read_only = row.access != "rw";
    let mut lengths = vec![];
    if row.bytes < 4 {
        lengths.push((row.bytes + 1, TOO_LONG));
    }
    if (2..=4).contains(&row.bytes) {
        lengths.push((row.bytes - 1, TOO_SHORT));
    }
    for (length, refusal) in lengths {
        let refusal = if read_only { READ_ONLY } else { refusal };
        let got = bench.write(node, row.index, row.sub, &[1; 4][..length]);
        check(
            "one byte off",
            format!("{got:X?}"),
            format!("{:X?}", Err::<(), _>(refusal)),
        );
    }
    let access = match (row.access.as_str(), &value) {
        // What it holds it takes as well.
        ("rw", Ok(bytes)) => bench.write(node, row.index, row.sub, bytes),
        _ => bench.write(node, row.index, row.sub, &[0; 4][..row.bytes.min(4)]),
    };
    let expected = if read_only { Err(READ_ONLY) } else { Ok(()) };
    check("access", format!("{access:X?}"), format!("{expected:X?}"));
    found
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
    assert!(
        found.is_empty(),
        "{} differences:\n{}",
        found.len(),
        found.join("\n")
    );
}

/// What the bus does not tell: signs, and which rows may be mapped (the mapping is read only).
#[test]
fn signs_and_mappability() {
    for table in [&TWK_CRN_4096, &TWK_CRN_8192] {
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
