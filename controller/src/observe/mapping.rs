//! Which bytes of a PDO are which object, as a bus tells it to whoever listens.
//!
//! CiA 301 has a device told by SDO under which COB-ID a PDO comes or goes (1400h and on for R_PDOs,
//! 1800h and on for T_PDOs, subindex 1) and which objects lie in it, in their order (1600h and on,
//! 1A00h and on); what the device has confirmed holds, until its communication is reset. Where it is told
//! nothing, what its data sheet says holds: the values of its dictionary after a reset. So a listener
//! reads setpoints, controlwords and statuswords off the frames, and shares nothing with who sends
//! them but the standard and the data sheet.

use std::collections::BTreeMap;
use syncline_canopen::dictionary::{Entry, Preset};
use syncline_canopen::{CanId, Frame};

/// Communication and mapping parameters of the first R_PDO and the first T_PDO; those of the others follow.
const PARAMETERS: [(u16, u16); 2] = [(0x1400, 0x1600), (0x1800, 0x1A00)];
/// Objects that a PDO can carry, of one bit each.
const MOST_OBJECTS: usize = 64;
/// PDOs that a device can have in each direction.
const MOST_PDOS: u16 = 0x200;
/// Set in a COB-ID: the PDO does not exist.
const INVALID: u32 = 1 << 31;
/// Identifiers of CiA 301, the latter two with a node's id on top.
const NMT: u16 = 0;
const SDO_ANSWER: u16 = 0x580;
const SDO_REQUEST: u16 = 0x600;
/// Of a COB-ID, the identifier.
const IDENTIFIER: u32 = 0x7FF;

/// The PDOs of the nodes of a bus, as far as they were heard being set up.
#[derive(Debug)]
pub(crate) struct PdoMappings {
    nodes: Vec<MappedNode>,
    /// By identifier, the PDOs that come under it, node by node.
    carried: Vec<Vec<Place>>,
}

/// Which PDO: the node's place, its direction as in [`PARAMETERS`], and its number from 0.
type Place = (usize, usize, u16);

/// What a frame said of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Heard {
    /// Its communication was reset: what it was told before no longer holds.
    Reset,
    /// A PDO carried this object, index, subindex and bits as a mapping has them, with this value.
    Object {
        /// As a mapping names it: index, subindex, bits.
        object: u32,
        /// Its bits.
        value: u32,
    },
}

#[derive(Debug)]
struct MappedNode {
    id: u16,
    dictionary: &'static [Entry],
    /// An SDO download that is not confirmed.
    asked: Option<Download>,
    /// By direction, and by number from 0: what is confirmed of each PDO.
    pdos: [BTreeMap<u16, Pdo>; 2],
}

/// An expedited SDO download.
#[derive(Clone, Copy, Debug)]
struct Download {
    /// Index and subindex, as they travel.
    address: [u8; 3],
    value: u32,
}

#[derive(Debug, Default)]
struct Pdo {
    identifier: Option<u32>,
    /// How many of the objects count.
    count: usize,
    objects: Vec<u32>,
}

impl PdoMappings {
    /// Of nodes with these ids and dictionaries, of which nothing is heard yet.
    pub(crate) fn new(nodes: impl IntoIterator<Item = (u16, &'static [Entry])>) -> Self {
        let node = |(id, dictionary)| {
            let mut node = MappedNode {
                id,
                dictionary,
                asked: None,
                pdos: Default::default(),
            };
            node.reset();
            node
        };
        let mut mappings = Self {
            nodes: nodes.into_iter().map(node).collect(),
            carried: vec![Vec::new(); IDENTIFIER as usize + 1],
        };
        mappings.order_by_identifier();
        mappings
    }

    /// Most frames are PDOs, and no node has to be searched for those of theirs.
    fn order_by_identifier(&mut self) {
        self.carried.iter_mut().for_each(Vec::clear);
        for (place, node) in self.nodes.iter().enumerate() {
            for (direction, pdos) in node.pdos.iter().enumerate() {
                for (&number, pdo) in pdos {
                    if let Some(identifier) = pdo.identifier {
                        self.carried[identifier as usize].push((place, direction, number));
                    }
                }
            }
        }
    }

    /// Takes a frame, in the order in which the bus carries them, and tells what it says of which node.
    pub(crate) fn hear(&mut self, frame: &Frame, tell: &mut impl FnMut(usize, Heard)) {
        let CanId::Standard(id) = frame.id() else {
            return;
        };
        if id == NMT || id >= SDO_ANSWER {
            let mut changes = false;
            for (place, node) in self.nodes.iter_mut().enumerate() {
                match id.checked_sub(node.id) {
                    _ if id == NMT && node.is_reset(frame.data()) => {
                        node.reset();
                        changes = true;
                        tell(place, Heard::Reset);
                    }
                    Some(SDO_REQUEST) => node.request(frame.data()),
                    Some(SDO_ANSWER) => changes |= node.answer(frame.data()),
                    _ => {}
                }
            }
            if changes {
                self.order_by_identifier();
            }
            if id == NMT {
                return;
            }
        }
        for &(place, direction, number) in &self.carried[usize::from(id)] {
            let pdo = &self.nodes[place].pdos[direction][&number];
            pdo.values(frame.data(), &mut |heard| tell(place, heard));
        }
    }
}

impl MappedNode {
    /// Whether an NMT command resets it.
    fn is_reset(&self, data: &[u8]) -> bool {
        matches!(*data, [0x81 | 0x82, node, ..] if node == 0 || u16::from(node) == self.id)
    }

    /// A reset takes back what was written: the values of its data sheet hold.
    fn reset(&mut self) {
        self.pdos = Default::default();
        for entry in self.dictionary {
            let value = match entry.preset {
                Preset::Number(value) | Preset::Assumed(value) => value,
                Preset::PlusNode(value) => value + i64::from(self.id),
                Preset::Unknown | Preset::Bytes(_) => continue,
            };
            self.written(entry.address.index, entry.address.sub, value as u32);
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

    /// An SDO answer: what it confirms holds. Whether it confirms under which identifier a PDO comes.
    fn answer(&mut self, data: &[u8]) -> bool {
        if let Some(Download { address, value }) = self.asked
            && let [0x60, a, b, c, ..] = *data
            && [a, b, c] == address
        {
            self.asked = None;
            return self.written(u16::from_le_bytes([a, b]), c, value);
        }
        false
    }

    /// An object has this value. Whether it says under which identifier a PDO comes.
    fn written(&mut self, index: u16, sub: u8, value: u32) -> bool {
        let number = |first| index.checked_sub(first).filter(|n| *n < MOST_PDOS);
        for (pdos, (communication, mapping)) in self.pdos.iter_mut().zip(PARAMETERS) {
            if let Some(number) = number(mapping) {
                let pdo = pdos.entry(number).or_default();
                match usize::from(sub).checked_sub(1) {
                    None => pdo.count = (value as usize & 0xFF).min(MOST_OBJECTS),
                    Some(place) if place < MOST_OBJECTS => {
                        let length = pdo.objects.len().max(place + 1);
                        pdo.objects.resize(length, 0);
                        pdo.objects[place] = value;
                    }
                    Some(_) => {}
                }
            } else if let Some(number) = number(communication)
                && sub == 1
            {
                let exists = value & INVALID == 0;
                pdos.entry(number).or_default().identifier = exists.then_some(value & IDENTIFIER);
                return true;
            }
        }
        false
    }
}

impl Pdo {
    /// What a frame of it carries.
    fn values(&self, data: &[u8], tell: &mut impl FnMut(Heard)) {
        let bytes = data.iter().rev();
        let mut word = bytes.fold(0, |word: u64, byte| word << 8 | u64::from(*byte));
        let mut left = 8 * data.len() as u32;
        for &object in self.objects.iter().take(self.count) {
            let bits = object & 0xFF;
            let Some(rest) = left.checked_sub(bits) else {
                return;
            };
            if bits <= 32 {
                let value = (word & ((1 << bits) - 1)) as u32;
                tell(Heard::Object { object, value });
            }
            word = word.checked_shr(bits).unwrap_or(0);
            left = rest;
        }
    }
}
