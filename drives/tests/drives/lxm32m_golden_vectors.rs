//! Every frame that the manual prints, executed over the bus.
//!
//! Answers have to come as an ordered subsequence of what the node sends: T_PDOs in between are
//! allowed, SDO answers are not.

use crate::common::lxm32m::Bench;
use crate::common::{id, ms};
use std::collections::BTreeMap;
use syncline_canopen::CanId;
use syncline_canopen::cia402::State;
use syncline_drives::twin::lxm32m::{Switches, TwinConfig};

const TABLE: &str = include_str!("data/lxm32m_golden_vectors.txt");

struct Vector {
    id: String,
    to_drive: bool,
    cob_id: u16,
    significant: usize,
    data: Vec<u8>,
    suspect: bool,
}

struct Block {
    name: String,
    preset: (bool, bool),
    vectors: Vec<Vector>,
}

fn hex<T: TryFrom<u32>>(text: &str) -> T {
    let number = u32::from_str_radix(text, 16).unwrap();
    T::try_from(number).ok().unwrap()
}

fn blocks() -> Vec<Block> {
    let mut blocks: Vec<Block> = vec![];
    let mut name = String::new();
    for line in TABLE.lines().filter(|line| !line.is_empty()) {
        if let Some(title) = line.strip_prefix("# ") {
            name = title.into();
        } else if let Some(bits) = line.strip_prefix("preset ") {
            blocks.push(Block {
                name: name.clone(),
                preset: (bits.starts_with('1'), bits.ends_with('1')),
                vectors: vec![],
            });
        } else if !line.starts_with('#') {
            let (frame, comment) = line.split_once('|').unwrap();
            let fields: Vec<&str> = frame.split_whitespace().collect();
            blocks.last_mut().unwrap().vectors.push(Vector {
                id: fields[0].into(),
                to_drive: fields[1] == ">",
                cob_id: hex(fields[2]),
                significant: hex::<u8>(fields[3]).into(),
                data: fields[4..].iter().map(|byte| hex(byte)).collect(),
                suspect: comment.contains("SUSPECT"),
            });
        }
    }
    blocks
}

/// Runs a block; the ids that passed, and what went wrong.
fn run(block: &Block) -> Result<usize, String> {
    let mut bench = Bench::new([TwinConfig {
        switches: Switches {
            negative_limit: Some(-0.5),
            ..Switches::default()
        },
        ..TwinConfig::new(id(1))
    }]);
    assert_eq!(bench.twin().state(), State::ReadyToSwitchOn);
    let (bit_10, bit_13) = block.preset;
    bench.twin().preset_status(bit_10, bit_13);
    let mut cursor = bench.log.len();
    let mut passed = 0;
    let mut expected_sdos = 0;
    for vector in &block.vectors {
        if vector.to_drive {
            bench.send(vector.cob_id, &vector.data);
            bench.wait(ms(if vector.suspect { 20 } else { 1 }));
        } else if vector.suspect {
            bench.wait(ms(20));
        } else {
            expected_sdos += usize::from(vector.cob_id == 0x581);
            let end = bench.now() + ms(8000);
            let matches = |frame: &syncline_canopen::Frame| {
                frame.id() == CanId::Standard(vector.cob_id)
                    && frame.data().len() == vector.data.len()
                    && frame.data()[..vector.significant] == vector.data[..vector.significant]
            };
            loop {
                let found = bench.log[cursor..]
                    .iter()
                    .position(|received| matches(&received.frame));
                if let Some(place) = found {
                    cursor += place + 1;
                    break;
                }
                if bench.now() >= end {
                    let sent: Vec<_> = bench.log[cursor..].iter().map(|r| r.frame).collect();
                    return Err(format!(
                        "{} not seen; since the last match {sent:?}",
                        vector.id
                    ));
                }
                bench.wait(ms(1));
            }
        }
        passed += usize::from(!vector.suspect);
    }
    let answers =
        |received: &&syncline_drives::bus::Received| received.frame.id() == CanId::Standard(0x581);
    let sdos = bench.log.iter().filter(answers).count();
    if sdos != expected_sdos {
        return Err(format!("{sdos} SDO answers, {expected_sdos} expected"));
    }
    Ok(passed)
}

#[test]
fn the_table_holds_the_106_frames_and_6_of_them_are_suspect() {
    let blocks = blocks();
    let vectors = || blocks.iter().flat_map(|block| &block.vectors);
    assert_eq!(vectors().count(), 106);
    assert_eq!(vectors().filter(|vector| vector.to_drive).count(), 55);
    let suspects: Vec<&str> = vectors()
        .filter(|vector| vector.suspect)
        .map(|vector| vector.id.as_str())
        .collect();
    assert_eq!(suspects, ["T-06", "V-08", "V-09", "V-10", "V-11", "V-12"]);
}

#[test]
fn a_hundred_frames_pass() {
    let results: BTreeMap<String, _> = blocks()
        .iter()
        .map(|block| (block.name.clone(), run(block)))
        .collect();
    for (name, result) in &results {
        if let Err(why) = result {
            panic!("{name}: {why}");
        }
    }
    assert_eq!(results.values().flatten().sum::<usize>(), 100);
}

#[test]
fn a_wrong_frame_is_found() {
    let mut block = blocks().remove(0);
    block.vectors.last_mut().unwrap().data[0] ^= 1;
    assert!(run(&block).is_err());
}
