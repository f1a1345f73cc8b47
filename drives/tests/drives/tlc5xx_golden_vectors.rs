//! Every frame that the controller's manual prints, executed over the bus.
//!
//! Answers have to come as an ordered subsequence of what the node sends: T_PDOs in between are
//! allowed, SDO answers are not. What the manual does not print, but an example needs, is marked `?`.

use crate::common::{Bench, id, ms};
use std::collections::BTreeSet;
use syncline_canopen::cia402::State;
use syncline_canopen::{CanId, Frame};
use syncline_drives::bus::Band;
use syncline_drives::twin::SimulatedDevice;
use syncline_drives::twin::tlc5xx::{Twin, TwinConfig};

const TABLE: &str = include_str!("data/tlc5xx_golden_vectors.txt");

#[derive(Clone, Copy, PartialEq)]
enum Direction {
    To,
    From,
    /// To it, not printed.
    Helper,
}

struct Vector {
    name: String,
    direction: Direction,
    cob_id: u16,
    /// `None` for a remote request.
    data: Option<Vec<Option<u8>>>,
    suspect: bool,
    /// As far as its bytes are given; a suspect only where its line says so.
    compared: bool,
}

#[derive(Default)]
struct Block {
    node: u8,
    /// Found in state 4 with bit 10.
    found_ready: bool,
    /// Where the shaft is, increments.
    at: i64,
    vectors: Vec<Vector>,
}

fn blocks() -> Vec<Block> {
    let mut blocks: Vec<Block> = vec![];
    for line in TABLE.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words[..] {
            [] | ["#", ..] => {}
            ["node", node] => blocks.push(Block {
                node: node.parse().unwrap(),
                ..Block::default()
            }),
            ["found", ..] => blocks.last_mut().unwrap().found_ready = true,
            ["at", position] => blocks.last_mut().unwrap().at = position.parse().unwrap(),
            _ => {
                let (frame, comment) = line.split_once('|').unwrap();
                let fields: Vec<&str> = frame.split_whitespace().collect();
                let byte = |text: &&str| u8::from_str_radix(text, 16).ok();
                blocks.last_mut().unwrap().vectors.push(Vector {
                    name: fields[0].into(),
                    direction: match fields[1] {
                        ">" => Direction::To,
                        "<" => Direction::From,
                        _ => Direction::Helper,
                    },
                    cob_id: u16::from_str_radix(fields[2], 16).unwrap(),
                    data: match fields[3] {
                        "R" => None,
                        "(none)" => Some(vec![]),
                        _ => Some(fields[3..].iter().map(byte).collect()),
                    },
                    suspect: comment.contains("SUSPECT"),
                    compared: !comment.contains("SUSPECT") || comment.contains("is compared"),
                });
            }
        }
    }
    blocks
}

fn is_match(frame: &Frame, vector: &Vector) -> bool {
    let data = vector.data.as_deref().unwrap_or_default();
    frame.id() == CanId::Standard(vector.cob_id)
        && frame.data().len() >= data.len()
        && (data.len() == frame.data().len() || data.len() == 5)
        && data
            .iter()
            .zip(frame.data())
            .all(|(expected, byte)| expected.is_none_or(|expected| expected == *byte))
}

/// Runs a block; how many printed items passed, and what went wrong.
fn run(block: &Block) -> Result<usize, String> {
    let config = TwinConfig {
        // The middle of an increment.
        position: (block.at as f64 + 0.5) / 16_384.0,
        ..TwinConfig::new(id(block.node))
    };
    let mut bench = Bench::of([Twin::new(config).unwrap()]);
    bench.wait(ms(100));
    if block.found_ready {
        bench.controlword(block.node, 0x0006);
        bench.twin().preset_target_reached(true);
        assert_eq!(bench.twin().state(), State::ReadyToSwitchOn);
    }
    let mut cursor = if block.found_ready {
        bench.log.len()
    } else {
        0
    };
    let mut passed = 0;
    for vector in &block.vectors {
        let printed = vector.direction != Direction::Helper;
        if vector.direction != Direction::From {
            let id = CanId::Standard(vector.cob_id);
            let frame = match &vector.data {
                None => Frame::remote(id, 1).unwrap(),
                Some(data) => {
                    let bytes: Vec<u8> = data.iter().map(|byte| byte.unwrap_or(0)).collect();
                    Frame::new(id, &bytes)
                }
            };
            bench.bus.send(Band::Acyclic, frame);
            bench.wait(ms(10));
        } else if vector.compared {
            let end = bench.now() + ms(3000);
            loop {
                let frames = bench.log[cursor..].iter();
                let found = frames
                    .map(|it| it.frame)
                    .position(|it| is_match(&it, vector));
                if let Some(place) = found {
                    cursor += place + 1;
                    break;
                }
                if bench.now() >= end {
                    let sent: Vec<_> = bench.log[cursor..].iter().map(|it| it.frame).collect();
                    return Err(format!("{} not seen; sent {sent:?}", vector.name));
                }
                bench.wait(ms(1));
            }
        }
        passed += usize::from(printed && !vector.suspect);
    }
    Ok(passed)
}

#[test]
fn the_table_holds_the_66_items_and_6_of_them_are_suspect() {
    let blocks = blocks();
    let printed = blocks.iter().flat_map(|block| &block.vectors);
    let printed: Vec<&Vector> = printed
        .filter(|vector| vector.direction != Direction::Helper && vector.name != "VD25")
        .collect();
    let names: BTreeSet<&str> = printed.iter().map(|vector| &*vector.name).collect();
    assert_eq!((printed.len(), names.len()), (66, 66));
    let suspects = printed.iter().filter(|vector| vector.suspect);
    let suspects: Vec<&str> = suspects.map(|vector| &*vector.name).collect();
    assert_eq!(suspects, ["VA3", "VA5", "VB1", "VB2", "VB5", "VD24"]);
}

#[test]
fn sixty_items_pass() {
    let mut passed = 0;
    for block in blocks() {
        match run(&block) {
            Ok(count) => passed += count,
            Err(why) => panic!("{why}"),
        }
    }
    // And VD25, what VD24 means.
    assert_eq!(passed, 61);
}

/// VB4's bytes are the target that the figure names, 2560, and VE17's the velocity, 133.
#[test]
fn what_the_pdos_bring() {
    let blocks = blocks();
    let value = |block: &Block, index| {
        let mut bench = Bench::of([Twin::new(TwinConfig::new(id(1))).unwrap()]);
        bench.wait(ms(100));
        for vector in &block.vectors {
            if vector.direction != Direction::From {
                let bytes = vector.data.iter().flatten();
                let bytes: Vec<u8> = bytes.map(|byte| byte.unwrap_or(0)).collect();
                bench.send(vector.cob_id, &bytes);
                bench.wait(ms(10));
            }
        }
        bench.wait(ms(500));
        (bench.read_i32(1, index, 0), bench.twin().observe().velocity)
    };
    assert_eq!(value(&blocks[4], 0x607A).0, 2560);
    let (target, velocity) = value(&blocks[7], 0x60FF);
    assert_eq!(target, 133);
    assert!((velocity * 60.0 - 133.0).abs() < 2.0, "{velocity}");
}

#[test]
fn a_wrong_frame_is_found() {
    let mut block = blocks().remove(0);
    let data = block.vectors[1].data.as_mut().unwrap();
    data[0] = Some(0x42);
    assert!(run(&block).is_err());
}
