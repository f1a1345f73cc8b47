//! What the drives were sent, as the buses carried it.
//!
//! A verdict on the plan's own samples trusts whom it judges: a position that is converted, encoded or
//! sent wrongly passes. So a judge listens to the buses as an analyser beside the machine would, and
//! shares nothing with the sender but the machine file and the standard:
//!
//! 1. *Which bytes are a setpoint* it learns from the bus (`mapping`): of the objects that a device has been
//!    told to find in its R_PDOs, or has there by its data sheet, its model names those that are a position
//!    to go to ([`Drive::position_objects`]).
//! 2. *Which setpoint counts* SYNC decides: a drive latches what came before it last. A frame that was
//!    lost, repeated, late or somebody else's is thereby judged as the drive takes it.
//! 3. *Which row of the run it belongs to* the number of the SYNC says ([`Row::sync`]).
//!
//! Units stay the drive's: increments, as the frame has them, be they a whole position or its low bits. What
//! becomes of them is told in `differences` and [`limits`](super::limits).
//!
//! [`Row::sync`]: crate::control::Row::sync
//! [`Drive::position_objects`]: syncline_drives::model::Drive::position_objects

use super::frames::SharedFrames;
use super::mapping::{Heard, PdoMappings};
use crate::machine::Machine;
use crossbeam::channel::{self, Receiver, Sender};
use std::collections::VecDeque;
use syncline_canopen::dictionary::{DataType, Entry};
use syncline_canopen::{Address, CanId, CobId, Frame};
use syncline_drives::model::{self, Increments};

/// A setpoint that a drive has latched.
#[derive(Clone, Copy, Debug)]
struct Latched {
    drive: usize,
    /// The number of the SYNC on its bus, from 1.
    sync: u64,
    /// As the frame had it.
    position: Increments,
}

/// Hears the frames of a machine's buses, and tells what drives latch.
#[derive(Debug)]
pub(super) struct Hearing {
    buses: Vec<Bus>,
    tell: Sender<Latched>,
}

#[derive(Debug)]
struct Bus {
    syncs: u64,
    mappings: PdoMappings,
    nodes: Vec<DriveHeard>,
}

#[derive(Debug)]
struct DriveHeard {
    drive: usize,
    positions: PositionObjects,
    /// The setpoint that came last.
    position: Option<Increments>,
}

/// The objects of a drive's R_PDOs that are a position to go to, each with its type.
#[derive(Debug)]
pub(crate) struct PositionObjects(Vec<(Address, DataType)>);

impl PositionObjects {
    /// Of a machine's drive.
    pub(crate) fn of(machine: &Machine, drive: usize) -> Self {
        let device = machine.device(drive);
        let positions = (device.drive()).map_or(&[][..], model::Drive::position_objects);
        Self::new(positions, machine.drives[drive].model.dictionary)
    }

    /// Those that a dictionary does not have are numbers with a sign.
    fn new(positions: &[Address], dictionary: &[Entry]) -> Self {
        let data_type = |address| {
            let entry = dictionary.iter().find(|entry| entry.address == address);
            entry.map_or(DataType::I32, |entry| entry.data_type)
        };
        let typed = (positions.iter()).map(|&address| (address, data_type(address)));
        Self(typed.collect())
    }

    /// The position in an object, which is named as a mapping does, by index, subindex and bits; `None` if it is
    /// none to go to.
    pub(crate) fn read(&self, object: u32, value: u32) -> Option<Increments> {
        let [bits, sub, low, high] = object.to_le_bytes();
        let address = Address::new(u16::from_le_bytes([low, high]), sub);
        let (_, data_type) = self.0.iter().find(|(own, _)| *own == address)?;
        let position = data_type.extend(value.into(), bits.into());
        Some(Increments::new(position))
    }
}

impl Bus {
    /// Of nodes, each with its id and its dictionary.
    fn new(nodes: impl IntoIterator<Item = (DriveHeard, u16, &'static [Entry])>) -> Self {
        let mut data_sheets = Vec::new();
        let mut of = |(node, id, dictionary)| {
            data_sheets.push((id, dictionary));
            node
        };
        let nodes = nodes.into_iter().map(&mut of).collect();
        Self {
            syncs: 0,
            mappings: PdoMappings::new(data_sheets),
            nodes,
        }
    }
}

impl DriveHeard {
    fn new(drive: usize, positions: PositionObjects) -> Self {
        Self {
            drive,
            positions,
            position: None,
        }
    }

    /// Takes an object of one of its PDOs, named as a mapping does.
    fn take(&mut self, object: u32, value: u32) {
        if let Some(position) = self.positions.read(object, value) {
            self.position = Some(position);
        }
    }
}

impl Hearing {
    /// Ears for a machine's buses, and what they hear.
    pub(super) fn new(machine: &Machine) -> (Self, SentSetpoints) {
        let drives = machine.drives.iter().enumerate();
        let on = |bus| drives.clone().filter(move |(_, drive)| drive.bus == bus);
        let node = |(index, drive): (usize, &crate::machine::Drive)| {
            let node = DriveHeard::new(index, PositionObjects::of(machine, index));
            (node, drive.node.get().into(), drive.model.dictionary)
        };
        let buses = (0..machine.buses.len()).map(|bus| Bus::new(on(bus).map(node)));
        let (tell, told) = channel::unbounded();
        let sent = SentSetpoints {
            told,
            relayed: None,
            drives: vec![VecDeque::new(); machine.drives.len()],
        };
        let buses = buses.collect();
        (Self { buses, tell }, sent)
    }

    /// Takes a frame of a bus, in the order in which the bus carries them.
    pub(super) fn hear(&mut self, bus: usize, frame: &Frame) {
        let Bus {
            syncs,
            mappings,
            nodes,
        } = &mut self.buses[bus];
        if frame.id() == CanId::from(CobId::SYNC) {
            *syncs += 1;
            for node in &*nodes {
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
        mappings.hear(frame, &mut |node, heard| match heard {
            Heard::Reset => nodes[node].position = None,
            Heard::Object { object, value } => nodes[node].take(object, value),
        });
    }
}

/// The setpoints that drives have latched, SYNC by SYNC.
#[derive(Debug)]
pub struct SentSetpoints {
    told: Receiver<Latched>,
    /// What is told of frames that are heard only as somebody asks for them.
    relayed: Option<SharedFrames>,
    /// By drive: of SYNCs that were not asked for yet.
    drives: Vec<VecDeque<(u64, Increments)>>,
}

impl SentSetpoints {
    /// Hears the frames as it is asked for them.
    pub(super) fn hear_from(&mut self, relayed: SharedFrames) {
        self.relayed = Some(relayed);
    }

    /// Goes on to the SYNC with this number, behind those before.
    pub(super) fn go_on_to(&mut self, sync: u64) {
        if let Some(relayed) = &self.relayed {
            relayed.catch_up();
        }
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
    pub(super) fn latched(&self, drive: usize, sync: u64) -> Option<Increments> {
        let (of, position) = self.drives[drive].front()?;
        (*of == sync).then_some(*position)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use syncline_canopen::dictionary::DataType::{U8, U32};
    use syncline_canopen::dictionary::{ro, rw, table};

    const NODE: u16 = 3;

    fn hearing() -> (Hearing, SentSetpoints) {
        let (tell, told) = channel::unbounded();
        static POSITIONS: [Address; 2] = [Address::new(0x60C1, 1), Address::new(0x607A, 0)];
        let positions = PositionObjects::new(&POSITIONS, &[]);
        let buses = vec![Bus::new([(DriveHeard::new(0, positions), NODE, &[][..])])];
        let sent = SentSetpoints {
            told,
            relayed: None,
            drives: vec![VecDeque::new()],
        };
        (Hearing { buses, tell }, sent)
    }

    fn frame(id: u16, data: &[u8]) -> Frame {
        let id = syncline_canopen::CobId::new(id).unwrap();
        Frame::new(id, data)
    }

    /// Its R_PDO is fixed: a byte, and its own target of 16 bits.
    #[test]
    fn a_data_sheet_tells_what_nobody_writes() {
        static TARGET: [Address; 1] = [Address::new(0x2001, 0)];
        static DICTIONARY: [Entry; 4] = table([
            rw(0x1400, 1, "COB-ID", U32).default_plus_node(0x200),
            ro(0x1600, 0, "number", U8).default(2),
            ro(0x1600, 1, "first", U32).default(0x2000_0008),
            ro(0x1600, 2, "second", U32).default(0x2001_0010),
        ]);
        let (mut ears, mut sent) = hearing();
        let positions = PositionObjects::new(&TARGET, &DICTIONARY);
        ears.buses = vec![Bus::new([(
            DriveHeard::new(0, positions),
            NODE,
            &DICTIONARY[..],
        )])];
        for reset in [false, true] {
            if reset {
                ears.hear(0, &frame(0x000, &[0x82, 0]));
            }
            ears.hear(0, &frame(0x200 + NODE, &[0x81, 0xFE, 0xFF]));
            ears.hear(0, &frame(0x080, &[]));
            let sync = 1 + u64::from(reset);
            assert_eq!(at(&mut sent, sync), Some(-2));
        }
    }

    #[test]
    fn a_position_has_the_sign_that_its_type_has() {
        static DICTIONARY: [Entry; 2] = table([
            rw(0x2001, 0, "a signed one", DataType::I16),
            rw(0x2001, 1, "an unsigned one", DataType::U16),
        ]);
        let addresses = [0, 1, 2].map(|sub| Address::new(0x2001, sub));
        let positions = PositionObjects::new(&addresses, &DICTIONARY);
        for (object, expected) in [
            (0x2001_0010, Some(-2)),
            (0x2001_0110, Some(0xFFFE)),
            (0x2001_0210, Some(-2)),
            (0x2001_0310, None),
        ] {
            let read = positions.read(object, 0xFFFE).map(Increments::get);
            assert_eq!(read, expected, "{object:08X}");
        }
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
        sent.latched(0, sync).map(Increments::get)
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
                write(&mut ears, 0x1402, 1, 0x8000_0403, true);
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
