//! What the drives were sent, as the buses carried it.
//!
//! A verdict on the plan's own samples trusts whom it judges: a position that is converted, encoded or
//! sent wrongly passes. So a judge listens to the buses as an analyser beside the machine would, and
//! shares nothing with the sender but the machine file and the standard:
//!
//! 1. *Which bytes are a setpoint* it learns from the bus. CiA 301 has a device told by SDO under which
//!    COB-ID an R_PDO comes (1400h and on, subindex 1) and which objects lie in it, in their order (1600h
//!    and on); what the device has confirmed holds, until its communication is reset. Of the objects two
//!    are positions to go to: 60C1h:1, the interpolation data record, and 607Ah, the target position.
//! 2. *Which setpoint counts* SYNC decides: a drive latches what came before it last. A frame that was
//!    lost, repeated, late or somebody else's is thereby judged as the drive takes it.
//! 3. *Which row of the run it belongs to* the number of the SYNC says ([`Row::sync`]).
//!
//! Units stay the drive's: increments, as the frame has them. What becomes of them is told in
//! `differences` and [`limits`](super::limits).
//!
//! [`Row::sync`]: crate::control::Row::sync

use crate::machine::Machine;
use crossbeam::channel::{self, Receiver, Sender};
use std::collections::{BTreeMap, VecDeque};
use syncline_canopen::{CanId, Frame};

/// Objects that are a position to go to, as a mapping names them: index, subindex, 32 bits.
const POSITIONS: [u32; 2] = [0x60C1_0120, 0x607A_0020];

/// Communication and mapping parameters of the first R_PDO; those of the others follow.
const COMMUNICATION: u16 = 0x1400;
const MAPPING: u16 = 0x1600;
/// R_PDOs that a device can have.
const MOST_R_PDOS: u16 = 0x200;
/// Set in a COB-ID: the PDO does not exist.
const INVALID: u32 = 1 << 31;

/// A setpoint that a drive has latched.
#[derive(Clone, Copy, Debug)]
struct Latched {
    drive: usize,
    /// The number of the SYNC on its bus, from 1.
    sync: u64,
    /// As the frame had it, increments.
    position: i32,
}

/// Hears the frames of a machine's buses, and tells what drives latch.
#[derive(Debug)]
pub(super) struct Hearing {
    buses: Vec<Bus>,
    tell: Sender<Latched>,
}

#[derive(Debug, Default)]
struct Bus {
    syncs: u64,
    nodes: Vec<Node>,
}

/// A drive as its bus shows it.
#[derive(Debug)]
struct Node {
    drive: usize,
    id: u16,
    /// An SDO download that is not confirmed.
    asked: Option<Download>,
    /// By number, from 0: what is confirmed of each R_PDO.
    r_pdos: BTreeMap<u16, RPdo>,
    /// The setpoint that came last.
    position: Option<i32>,
}

/// An expedited SDO download.
#[derive(Clone, Copy, Debug)]
struct Download {
    /// Index and subindex, as they travel.
    address: [u8; 3],
    value: u32,
}

#[derive(Debug, Default)]
struct RPdo {
    cob_id: Option<u32>,
    /// How many of the objects count.
    count: usize,
    objects: [u32; 8],
}

impl Hearing {
    /// Ears for a machine's buses, and what they hear.
    pub(super) fn new(machine: &Machine) -> (Self, SentSetpoints) {
        let mut buses: Vec<Bus> = machine.buses.iter().map(|_| Bus::default()).collect();
        for (index, drive) in machine.drives.iter().enumerate() {
            buses[drive.bus].nodes.push(Node {
                drive: index,
                id: drive.node.get().into(),
                asked: None,
                r_pdos: BTreeMap::new(),
                position: None,
            });
        }
        let (tell, told) = channel::unbounded();
        let sent = SentSetpoints {
            told,
            drives: vec![VecDeque::new(); machine.drives.len()],
        };
        (Self { buses, tell }, sent)
    }

    /// Takes a frame of a bus, in the order in which the bus carries them.
    pub(super) fn hear(&mut self, bus: usize, frame: &Frame) {
        let CanId::Standard(id) = frame.id() else {
            return;
        };
        let Bus { syncs, nodes } = &mut self.buses[bus];
        match id {
            0x000 => nodes.iter_mut().for_each(|node| node.command(frame.data())),
            0x080 => {
                *syncs += 1;
                for node in nodes {
                    if let Some(position) = node.position {
                        // Nobody judging is fine.
                        let _ = self.tell.send(Latched {
                            drive: node.drive,
                            sync: *syncs,
                            position,
                        });
                    }
                }
            }
            _ => {
                for node in nodes {
                    match id.checked_sub(node.id) {
                        Some(0x600) => node.request(frame.data()),
                        Some(0x580) => node.answer(frame.data()),
                        _ => node.r_pdo(id, frame.data()),
                    }
                }
            }
        }
    }
}

impl Node {
    /// An NMT command: a reset takes back what was written.
    fn command(&mut self, data: &[u8]) {
        if let [0x81 | 0x82, node, ..] = *data
            && (node == 0 || u16::from(node) == self.id)
        {
            self.r_pdos.clear();
            self.position = None;
        }
    }

    /// An SDO request: of interest is an expedited download.
    fn request(&mut self, data: &[u8]) {
        let &[specifier, a, b, c, d0, d1, d2, d3] = data else {
            return;
        };
        self.asked = (specifier & 0xE2 == 0x22).then_some(Download {
            address: [a, b, c],
            value: u32::from_le_bytes([d0, d1, d2, d3]),
        });
    }

    /// An SDO answer: what it confirms holds.
    fn answer(&mut self, data: &[u8]) {
        if let Some(Download { address, value }) = self.asked
            && let [0x60, a, b, c, ..] = *data
            && [a, b, c] == address
        {
            self.asked = None;
            self.written(u16::from_le_bytes([a, b]), c, value);
        }
    }

    fn written(&mut self, index: u16, sub: u8, value: u32) {
        let number = |first| index.checked_sub(first).filter(|n| *n < MOST_R_PDOS);
        if let Some(number) = number(MAPPING) {
            let r_pdo = self.r_pdos.entry(number).or_default();
            match usize::from(sub).checked_sub(1) {
                None => r_pdo.count = (value as usize & 0xFF).min(r_pdo.objects.len()),
                Some(place) if place < r_pdo.objects.len() => r_pdo.objects[place] = value,
                Some(_) => {}
            }
        } else if let Some(number) = number(COMMUNICATION)
            && sub == 1
        {
            let exists = value & INVALID == 0;
            self.r_pdos.entry(number).or_default().cob_id = exists.then_some(value);
        }
    }

    /// A frame that may be one of its R_PDOs.
    fn r_pdo(&mut self, id: u16, data: &[u8]) {
        let own = |r_pdo: &&RPdo| r_pdo.cob_id == Some(id.into());
        for RPdo { count, objects, .. } in self.r_pdos.values().filter(own) {
            let mut bit = 0;
            for object in &objects[..*count] {
                let byte = bit / 8;
                if POSITIONS.contains(object)
                    && let Some(&[a, b, c, d]) = data.get(byte..byte + 4)
                {
                    self.position = Some(i32::from_le_bytes([a, b, c, d]));
                }
                bit += (object & 0xFF) as usize;
            }
        }
    }
}

/// The setpoints that drives have latched, SYNC by SYNC.
#[derive(Debug)]
pub struct SentSetpoints {
    told: Receiver<Latched>,
    /// By drive: of SYNCs that were not asked for yet.
    drives: Vec<VecDeque<(u64, i32)>>,
}

impl SentSetpoints {
    /// Goes on to the SYNC with this number, behind those before.
    pub(super) fn go_on_to(&mut self, sync: u64) {
        for latched in self.told.try_iter() {
            self.drives[latched.drive].push_back((latched.sync, latched.position));
        }
        for drive in &mut self.drives {
            while drive.front().is_some_and(|(of, _)| *of < sync) {
                drive.pop_front();
            }
        }
    }

    /// What a drive latched at a SYNC that was [gone on to](Self::go_on_to), increments; `None` if it
    /// had been sent no setpoint, or there was no such SYNC on its bus.
    pub(super) fn latched(&self, drive: usize, sync: u64) -> Option<i64> {
        let (of, position) = self.drives[drive].front()?;
        (*of == sync).then_some((*position).into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NODE: u16 = 3;

    fn hearing() -> (Hearing, SentSetpoints) {
        let (tell, told) = channel::unbounded();
        let node = Node {
            drive: 0,
            id: NODE,
            asked: None,
            r_pdos: BTreeMap::new(),
            position: None,
        };
        let bus = Bus {
            syncs: 0,
            nodes: vec![node],
        };
        let sent = SentSetpoints {
            told,
            drives: vec![VecDeque::new()],
        };
        let buses = vec![bus];
        (Hearing { buses, tell }, sent)
    }

    fn frame(id: u16, data: &[u8]) -> Frame {
        let id = syncline_canopen::CobId::new(id).unwrap();
        Frame::new(id, data)
    }

    /// Writes an object of so many bytes; the node confirms it, or aborts.
    fn write(ears: &mut Hearing, index: u16, sub: u8, value: u32, confirmed: bool) {
        let [a, b] = index.to_le_bytes();
        let [d0, d1, d2, d3] = value.to_le_bytes();
        let request = [0x23, a, b, sub, d0, d1, d2, d3];
        ears.hear(0, &frame(0x600 + NODE, &request));
        let specifier = if confirmed { 0x60 } else { 0x80 };
        ears.hear(0, &frame(0x580 + NODE, &[specifier, a, b, sub, 0, 0, 0, 0]));
    }

    /// Maps a byte and two objects of 16 and 32 bits into the third R_PDO, which comes under 403h.
    fn map(ears: &mut Hearing) {
        write(ears, 0x1402, 1, 0x403, true);
        write(ears, 0x1602, 0, 0, true);
        for (sub, object) in [(1, 0x2000_0108), (2, 0x6040_0010), (3, 0x607A_0020)] {
            write(ears, 0x1602, sub, object, true);
        }
        write(ears, 0x1602, 0, 3, true);
    }

    fn at(sent: &mut SentSetpoints, sync: u64) -> Option<i64> {
        sent.go_on_to(sync);
        sent.latched(0, sync)
    }

    #[test]
    fn a_setpoint_is_where_the_mapping_says_and_counts_at_sync() {
        let (mut ears, mut sent) = hearing();
        map(&mut ears);
        let sync = frame(0x080, &[]);
        let [a, b, c, d] = (-70_000_i32).to_le_bytes();
        ears.hear(0, &sync);
        ears.hear(0, &frame(0x403, &[9, 15, 0, a, b, c, d]));
        ears.hear(0, &frame(0x403, &[9, 15]));
        ears.hear(0, &frame(0x303, &[0; 8]));
        ears.hear(0, &sync);
        ears.hear(0, &sync);
        ears.hear(0, &frame(0x403, &[9, 15, 0, 5, 0, 0, 0]));
        assert_eq!(at(&mut sent, 1), None);
        assert_eq!(at(&mut sent, 2), Some(-70_000));
        assert_eq!(at(&mut sent, 3), Some(-70_000));
        assert_eq!(at(&mut sent, 4), None);
        ears.hear(0, &sync);
        assert_eq!(at(&mut sent, 4), Some(5));
    }

    #[test]
    fn what_is_refused_or_reset_does_not_hold() {
        for (reset, aborted, heard) in [
            (None, false, Some(7)),
            (None, true, None),
            (Some([0x82, NODE as u8]), false, None),
            (Some([0x81, 0]), false, None),
            (Some([0x82, 9]), false, Some(7)),
            (Some([0x01, 0]), false, Some(7)),
        ] {
            let (mut ears, mut sent) = hearing();
            map(&mut ears);
            if aborted {
                write(&mut ears, 0x1402, 1, 0x403, true);
                write(&mut ears, 0x1402, 1, INVALID | 0x403, true);
                write(&mut ears, 0x1402, 1, 0x403, false);
            }
            if let Some(reset) = reset {
                ears.hear(0, &frame(0x000, &reset));
            }
            ears.hear(0, &frame(0x403, &[0, 0, 0, 7, 0, 0, 0]));
            ears.hear(0, &frame(0x080, &[]));
            assert_eq!(at(&mut sent, 1), heard, "{reset:?} {aborted}");
        }
    }
}
