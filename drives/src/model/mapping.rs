//! Which objects lie in the PDO of a device by the profile alone, and where.
//!
//! What a set-up maps has the objects that a model needs, in the model's order. What the maker has mapped has them anywhere, among
//! others: those of a T_PDO are passed over, those of an R_PDO are sent a value that is stated.

use super::{Address, Data, Identity, Lack, Model, Write};
use syncline_canopen::dictionary::{DataType, Entry, Preset};
use syncline_canopen::pdo::{Mapped, Packer, Unpacker};
use syncline_canopen::{CobId, Frame};

/// What a PDO carries.
#[derive(Clone, Debug)]
pub struct Mapping {
    /// Its mapping parameter: 1600h, 1A00h, and on.
    index: u16,
    /// What it carries, in this order.
    objects: Vec<Mapped>,
    /// What a model needs of it, in the model's order.
    needed: Vec<Mapped>,
    /// The first bit of each of those, as far as they are there.
    places: Vec<u32>,
    /// What an R_PDO is sent for the others.
    values: Vec<(Address, i64)>,
    /// All its bits where the needed ones are 0.
    rest: u64,
    is_fixed: bool,
}

/// What a model needs of a PDO, in the model's order.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arranged([u8; 8], usize);

impl Arranged {
    pub(super) fn data(&self) -> &[u8] {
        &self.0[..self.1]
    }
}

impl Mapping {
    /// A PDO that is mapped by the set-up with what is `needed`.
    pub(super) fn new(index: u16, needed: &[u32]) -> Self {
        let needed: Vec<_> = needed.iter().copied().map(Mapped::from).collect();
        Self::of(index, needed.clone(), needed, Vec::new(), false)
    }

    /// The same, unless the maker has mapped it, as is said or shows in a data sheet by its mapping being read-only: then it carries what
    /// the data sheet has there; where that has no values, what is needed. What is `wanted` besides is part of what is needed unless the
    /// maker has left it out. An R_PDO is sent these `values` for whatever else it has.
    pub(super) fn by_maker(
        model: &Model,
        is_said: bool,
        index: u16,
        [needed, wanted]: [&[u32]; 2],
        values: Vec<(Address, i64)>,
    ) -> Self {
        let rows = model.generic.map_or(&[][..], |_| model.dictionary);
        let mut own = rows.iter().filter(|row| row.address.index == index);
        let is_fixed = is_said || own.any(|row| !row.access.writable());
        let mapped = |objects: &[u32]| -> Vec<Mapped> {
            objects.iter().copied().map(Mapped::from).collect()
        };
        let (mut needed, wanted) = (mapped(needed), mapped(wanted));
        let stated = is_fixed.then(|| stated(rows, index));
        let objects = match stated {
            Some(stated) => stated.unwrap_or(needed.clone()),
            None => [&needed[..], &wanted].concat(),
        };
        needed.extend(wanted.iter().filter(|it| objects.contains(it)));
        Self::of(index, objects, needed, values, is_fixed)
    }

    fn of(
        index: u16,
        objects: Vec<Mapped>,
        needed: Vec<Mapped>,
        values: Vec<(Address, i64)>,
        is_fixed: bool,
    ) -> Self {
        let begin = |wanted: &Mapped| {
            let place = objects.iter().position(|it| it == wanted)?;
            Some(bits(&objects[..place]))
        };
        let places = needed.iter().map_while(begin).collect();
        let mut rest = Packer::new();
        for object in &objects {
            let mut values = values.iter().filter(|_| !needed.contains(object));
            let value = values.find(|(address, _)| *address == object.address);
            rest.push(value.map_or(0, |(_, value)| *value), object.bits);
        }
        Self {
            index,
            objects,
            needed,
            places,
            values,
            rest: u64::from_le_bytes(rest.bytes()),
            is_fixed,
        }
    }

    /// Its length; more than eight bytes are none that it can have.
    pub(super) fn bytes(&self) -> u8 {
        bits(&self.objects).div_ceil(8).min(8) as u8
    }

    /// What is needed, one behind the other in the model's order, out of the data of a frame; as much as they have of it.
    pub(super) fn arranged(&self, data: &[u8]) -> Arranged {
        let mut arranged = Packer::new();
        for (&place, object) in self.places.iter().zip(&self.needed) {
            let mut left = Unpacker::new(data);
            let value = skip(&mut left, place).and_then(|()| left.unsigned(object.bits));
            let Some(value) = value else { break };
            arranged.push(value as i64, object.bits);
        }
        Arranged(arranged.bytes(), arranged.len())
    }

    /// The frame with what is needed, in the model's order.
    pub(super) fn frame(&self, cob_id: CobId, arranged: &[u8]) -> Frame {
        let mut values = Unpacker::new(arranged);
        let mut word = self.rest;
        for (&place, object) in self.places.iter().zip(&self.needed) {
            let value = values.unsigned(object.bits).unwrap_or(0);
            word |= value.checked_shl(place).unwrap_or(0);
        }
        Frame::new(cob_id, &word.to_le_bytes()[..self.bytes().into()])
    }

    /// A frame's data with 0 in place of an object that is needed.
    pub(super) fn without(&self, address: Address, data: &[u8]) -> [u8; 8] {
        let mut word = [0; 8];
        let length = data.len().min(8);
        word[..length].copy_from_slice(&data[..length]);
        let mut bits = u64::from_le_bytes(word);
        for (&place, object) in self.places.iter().zip(&self.needed) {
            if object.address == address {
                let mask = u64::MAX
                    .checked_shr(64 - u32::from(object.bits))
                    .unwrap_or(0);
                bits &= !mask.checked_shl(place).unwrap_or(0);
            }
        }
        bits.to_le_bytes()
    }

    /// Maps it while it is off; nothing where the maker has.
    pub(super) fn writes(&self) -> Vec<Write> {
        if self.is_fixed {
            return Vec::new();
        }
        let mut writes = vec![Write::new(self.index, 0, Data::u8(0))];
        for (sub, object) in (1..).zip(&self.objects) {
            writes.push(Write::new(self.index, sub, Data::u32((*object).into())));
        }
        let count = self.objects.len() as u8;
        writes.push(Write::new(self.index, 0, Data::u8(count)));
        writes
    }

    /// What tells that the maker has mapped it so; nothing where the set-up maps it.
    pub(super) fn identity(&self) -> Vec<Identity> {
        if !self.is_fixed {
            return Vec::new();
        }
        let count = self.objects.len() as u32;
        let mut identity = vec![Identity::new(self.index, 0, "mapped objects", count)];
        for (sub, object) in (1..).zip(&self.objects) {
            let object = (*object).into();
            identity.push(Identity::new(self.index, sub, "mapped object", object));
        }
        identity
    }

    /// Whether it is an R_PDO.
    pub(super) fn is_received(&self) -> bool {
        self.index < 0x1800
    }

    /// The objects of it that a model goes by.
    pub(super) fn needed(&self) -> impl Iterator<Item = Address> {
        self.needed.iter().map(|it| it.address)
    }

    /// Whether an object is in it.
    pub(super) fn has(&self, address: Address) -> bool {
        self.objects.iter().any(|it| it.address == address)
    }

    /// `R_PDO2`
    pub(super) fn name(&self) -> String {
        let direction = if self.is_received() { 'R' } else { 'T' };
        format!("{direction}_PDO{}", (self.index & 0x1FF) + 1)
    }

    /// What of it, as the maker has mapped it, cannot be used so, by the data sheet of a model.
    pub(super) fn lacks(&self, model: &Model) -> Vec<Lack> {
        let lack = |address, problem, help| model.lack(address, problem, help);
        let mut lacks = Vec::new();
        let length = bits(&self.objects);
        if length > 64 {
            lacks.push(lack(
                Address::new(self.index, 0),
                format!("maps {length} bits into {}", self.name()),
                "a PDO has 64".to_owned(),
            ));
        }
        for missing in &self.needed[self.places.len()..] {
            lacks.push(lack(
                missing.address,
                format!("is not in {} with {} bits", self.name(), missing.bits),
                "nobody but its maker can map it, by the data sheet or by `fixed_mapping`".into(),
            ));
        }
        for (place, object) in self.objects.iter().enumerate() {
            let is_again = self.objects[..place].contains(object);
            if self.needed.contains(object) {
                if is_again && self.is_received() {
                    let problem = format!("is in {} twice", self.name());
                    let help = "the controller sends it once".to_owned();
                    lacks.push(lack(object.address, problem, help));
                }
                continue;
            }
            if let Some((problem, help)) = self.unfit(*object, model.dictionary) {
                lacks.push(lack(object.address, problem, help));
            }
        }
        lacks
    }

    /// Why an object that is no part of what is needed cannot stay there.
    fn unfit(&self, object: Mapped, dictionary: &[Entry]) -> Option<(String, String)> {
        let is_gap = object.address.sub == 0 && matches!(object.address.index, 1..=7);
        if is_gap && self.is_received() {
            return None;
        }
        let name = self.name();
        let said = |problem: String| {
            let help = format!("{name} has it by the data sheet");
            Some((problem, help))
        };
        let mut rows = dictionary.iter();
        let Some(row) = rows.find(|row| row.address == object.address) else {
            return said("is not there".into());
        };
        let bits = 8 * row.data_type.size();
        let is_whole = bits == object.bits.into() || is_bit(row, object);
        // What is passed over may be of any type.
        if !is_whole || self.is_received() && !row.data_type.is_number() {
            let (is, with) = (row.data_type, object.bits);
            return said(format!("is of type {is:?}, and mapped with {with} bits"));
        }
        if !self.is_received() {
            return None;
        }
        if !row.access.writable() {
            return said("cannot be written".into());
        }
        let mut values = self.values.iter();
        let Some((_, value)) = values.find(|(address, _)| *address == object.address) else {
            let Address { index, sub } = object.address;
            let problem = format!("is in {name}, and nothing states what it is sent");
            let help = format!("state it: r_pdo_values = [[\"{index:04X}:{sub:X}\", 0]]");
            return Some((problem, help));
        };
        let range = row.range.or_else(|| Data::range(row.data_type));
        let (least, most) = range.unwrap_or((0, 1));
        if !(least..=most).contains(value) {
            let help = format!("allowed: a whole number {least}…{most}");
            return Some((format!("takes no {value}"), help));
        }
        None
    }
}

/// One bit of a truth value.
fn is_bit(row: &Entry, object: Mapped) -> bool {
    row.data_type == DataType::Bool && object.bits == 1
}

fn bits(objects: &[Mapped]) -> u32 {
    objects.iter().map(|it| u32::from(it.bits)).sum()
}

/// Passes so many bits over, if there are so many.
fn skip(left: &mut Unpacker, bits: u32) -> Option<()> {
    left.unsigned(u8::try_from(bits).ok()?).map(|_| ())
}

/// What a data sheet has mapped there; `None` where it does not say so of all.
fn stated(rows: &[Entry], index: u16) -> Option<Vec<Mapped>> {
    let value = |sub| {
        let mut rows = rows.iter();
        let row = rows.find(|row| row.address == Address::new(index, sub))?;
        match row.preset {
            Preset::Number(value) => Some(value),
            _ => None,
        }
    };
    let count = u8::try_from(value(0)?).ok()?;
    (1..=count)
        .map(|sub| Some(Mapped::from(value(sub)? as u32)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Objects of any lengths that fill at most a PDO, with a value for each.
    fn objects() -> impl Strategy<Value = Vec<(Mapped, i64)>> {
        prop::collection::vec((1..=32u8, any::<i64>()), 1..12).prop_map(|drawn| {
            let mut left = 64;
            let fits = drawn.into_iter().take_while(|(bits, _)| {
                left -= i32::from(*bits);
                left >= 0
            });
            let objects = (0x2000..).zip(fits).map(|(index, (bits, value))| {
                let object = Mapped {
                    address: Address::new(index, 0),
                    bits,
                };
                (object, value)
            });
            objects.collect()
        })
    }

    fn cut(value: i64, bits: u8) -> u64 {
        value as u64 & ((1 << bits) - 1)
    }

    proptest! {
        /// Whatever else a maker has mapped about it: what is needed lies where the mapping says and is found there again, and the
        /// rest has its values.
        #[test]
        fn each_object_has_its_own_bits(objects in objects(), order in any::<prop::sample::Index>(), is_needed: u16) {
            let is_needed = |place: usize| is_needed >> place & 1 != 0;
            let parted = (0..objects.len()).partition::<Vec<_>, _>(|place| is_needed(*place));
            let (mut needed, others) = parted;
            if !needed.is_empty() {
                let first = order.index(needed.len());
                needed.rotate_left(first);
            }
            let values = others.iter().map(|&place| (objects[place].0.address, objects[place].1));
            let mapping = Mapping::of(
                0x1600,
                objects.iter().map(|(object, _)| *object).collect(),
                needed.iter().map(|&place| objects[place].0).collect(),
                values.collect(),
                true,
            );
            let mut arranged = Packer::new();
            for &place in &needed {
                arranged.push(objects[place].1, objects[place].0.bits);
            }
            let arranged = &arranged.bytes()[..arranged.len()];
            let frame = mapping.frame(CobId::SYNC, arranged);
            let word = frame.data().iter().rev().fold(0u128, |word, byte| word << 8 | u128::from(*byte));
            let mut begin = 0;
            for (object, value) in &objects {
                let found = (word >> begin) as u64 & ((1 << object.bits) - 1);
                prop_assert_eq!(found, cut(*value, object.bits), "{:?}", object);
                begin += object.bits;
            }
            prop_assert!(frame.data().len() == usize::from(begin.div_ceil(8)) && word >> begin == 0);
            let found = mapping.arranged(frame.data());
            prop_assert_eq!(found.data(), arranged);
        }
    }
}
