//! The object dictionary (CiA 301): a device's table of typed entries and one node's values.
//!
//! A device's table is one `static`, written so that it reads like the manual's:
//!
//! ```
//! use syncline_canopen::NodeId;
//! use syncline_canopen::dictionary::{DataType::*, Dictionary, Entry, ro, rw, table};
//!
//! static TABLE: [Entry; 4] = table([
//!     ro(0x1000, 0, "Device type", U32).default(0x0042_0192),
//!     rw(0x1017, 0, "Producer heartbeat time", U16).default(0).unit("ms"),
//!     rw(0x1800, 1, "COB-ID T_PDO1", U32).default_plus_node(0x4000_0180),
//!     rw(0x6060, 0, "Operating mode", I8).range(-6, 10).r_pdo(),
//! ]);
//!
//! let node = NodeId::new(5).ok_or("node")?;
//! let mut values = Dictionary::new(&TABLE, node);
//! assert_eq!(values.value(0x1800, 1), Some(0x4000_0185));
//! # Ok::<(), &str>(())
//! ```

use crate::id::NodeId;
use crate::sdo::{AbortCode, Objects};
use core::{fmt, str::FromStr};
use thiserror::Error;

/// Where an object stands: index and subindex.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Address {
    /// Index, 0000h…FFFFh.
    pub index: u16,
    /// Subindex, 00h…FFh.
    pub sub: u8,
}

impl Address {
    /// The object at `index`:`sub`.
    #[must_use]
    pub const fn new(index: u16, sub: u8) -> Self {
        Self { index, sub }
    }

    /// Index and subindex as one sortable number.
    const fn key(self) -> u32 {
        (self.index as u32) << 8 | self.sub as u32
    }
}

/// As manuals print it: `60C2h:1`, `3006h:3D`.
impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04X}h:{:X}", self.index, self.sub)
    }
}

/// Not `index:sub` in hexadecimal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("not an object: write index:sub in hexadecimal, such as 3012:6")]
pub struct ParseAddressError;

/// As people write it: `3012:6`, `3012h:6`, `6065` (subindex 0); hexadecimal both.
impl FromStr for Address {
    type Err = ParseAddressError;

    fn from_str(text: &str) -> Result<Self, ParseAddressError> {
        let hex = |digits: &str, most: usize| {
            let digits = digits.strip_suffix(['h', 'H']).unwrap_or(digits);
            ((1..=most).contains(&digits.len()) && digits.bytes().all(|b| b.is_ascii_hexdigit()))
                .then(|| u16::from_str_radix(digits, 16).ok())
                .flatten()
                .ok_or(ParseAddressError)
        };
        let (index, sub) = text.split_once(':').unwrap_or((text, "0"));
        Ok(Self::new(hex(index, 4)?, hex(sub, 2)? as u8))
    }
}

/// A data type of CiA 301; strings and domains with their greatest length in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DataType {
    /// BOOLEAN, one byte in an SDO.
    Bool,
    /// INTEGER8.
    I8,
    /// INTEGER16.
    I16,
    /// INTEGER32.
    I32,
    /// INTEGER64.
    I64,
    /// UNSIGNED8.
    U8,
    /// UNSIGNED16.
    U16,
    /// UNSIGNED32.
    U32,
    /// UNSIGNED64.
    U64,
    /// VISIBLE_STRING of at most so many bytes.
    Text(u16),
    /// OCTET_STRING of at most so many bytes.
    Octets(u16),
    /// DOMAIN of at most so many bytes.
    Domain(u16),
}

impl DataType {
    /// The type's number in CiA 301, as an EDS writes it.
    #[must_use]
    pub const fn code(self) -> u16 {
        match self {
            Self::Bool => 0x01,
            Self::I8 => 0x02,
            Self::I16 => 0x03,
            Self::I32 => 0x04,
            Self::U8 => 0x05,
            Self::U16 => 0x06,
            Self::U32 => 0x07,
            Self::Text(_) => 0x09,
            Self::Octets(_) => 0x0A,
            Self::Domain(_) => 0x0F,
            Self::I64 => 0x15,
            Self::U64 => 0x1B,
        }
    }

    /// Bytes in an SDO: the length of a number, the greatest length of anything else.
    #[must_use]
    pub const fn size(self) -> usize {
        match self {
            Self::Bool | Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 => 4,
            Self::I64 | Self::U64 => 8,
            Self::Text(size) | Self::Octets(size) | Self::Domain(size) => size as usize,
        }
    }

    /// Whether the value is a number and not a string of bytes.
    #[must_use]
    pub const fn is_number(self) -> bool {
        !matches!(self, Self::Text(_) | Self::Octets(_) | Self::Domain(_))
    }

    /// Whether the number has a sign.
    #[must_use]
    pub const fn is_signed(self) -> bool {
        matches!(self, Self::I8 | Self::I16 | Self::I32 | Self::I64)
    }

    /// The value of the low `bits` of `raw`, with its sign if the type has one.
    #[must_use]
    pub const fn extend(self, raw: u64, bits: u32) -> i64 {
        if bits == 0 {
            return 0;
        }
        let unused = 64u32.saturating_sub(bits);
        if self.is_signed() {
            (raw << unused) as i64 >> unused
        } else {
            (raw << unused >> unused) as i64
        }
    }
}

/// How an object may be accessed by SDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Constant, read only.
    Const,
    /// Read only.
    Ro,
    /// Read and write.
    Rw,
    /// Write only.
    Wo,
}

impl Access {
    /// Whether an upload is permitted.
    #[must_use]
    pub const fn readable(self) -> bool {
        !matches!(self, Self::Wo)
    }

    /// Whether a download is permitted.
    #[must_use]
    pub const fn writable(self) -> bool {
        matches!(self, Self::Rw | Self::Wo)
    }
}

/// Into which PDOs an object may be mapped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Mappable {
    /// Into PDOs that the device receives.
    pub r_pdo: bool,
    /// Into PDOs that the device transmits.
    pub t_pdo: bool,
}

/// An object's value after power-on, unless another was stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Preset {
    /// The manual prints none; numbers start at 0, strings empty.
    Unknown,
    /// A number.
    Number(i64),
    /// A number to which the node id is added, as in COB-IDs.
    PlusNode(i64),
    /// A number that the manual does not print and a simulated device assumes.
    Assumed(i64),
    /// A string.
    Bytes(&'static [u8]),
}

/// One row of a device's object dictionary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Index and subindex.
    pub address: Address,
    /// The parameter's name, as the manual has it.
    pub name: &'static str,
    /// Type.
    pub data_type: DataType,
    /// Access by SDO.
    pub access: Access,
    /// Whether the access is only inferred and not printed in the manual at hand.
    pub inferred: bool,
    /// PDO mappability.
    pub mappable: Mappable,
    /// Least and greatest value; `None` is the type's own range.
    pub range: Option<(i64, i64)>,
    /// Value after power-on.
    pub preset: Preset,
    /// Unit, empty if there is none or none is known.
    pub unit: &'static str,
    /// Whether the value can be kept over power-off.
    pub persistent: bool,
}

const fn entry(
    index: u16,
    sub: u8,
    name: &'static str,
    data_type: DataType,
    access: Access,
) -> Entry {
    Entry {
        address: Address::new(index, sub),
        name,
        data_type,
        access,
        inferred: false,
        mappable: Mappable {
            r_pdo: false,
            t_pdo: false,
        },
        range: None,
        preset: Preset::Unknown,
        unit: "",
        persistent: false,
    }
}

/// A read-only row.
#[must_use]
pub const fn ro(index: u16, sub: u8, name: &'static str, data_type: DataType) -> Entry {
    entry(index, sub, name, data_type, Access::Ro)
}

/// A row that can be read and written.
#[must_use]
pub const fn rw(index: u16, sub: u8, name: &'static str, data_type: DataType) -> Entry {
    entry(index, sub, name, data_type, Access::Rw)
}

/// A write-only row.
#[must_use]
pub const fn wo(index: u16, sub: u8, name: &'static str, data_type: DataType) -> Entry {
    entry(index, sub, name, data_type, Access::Wo)
}

/// A constant row.
#[must_use]
pub const fn constant(index: u16, sub: u8, name: &'static str, data_type: DataType) -> Entry {
    entry(index, sub, name, data_type, Access::Const)
}

impl Entry {
    /// With this value after power-on.
    #[must_use]
    pub const fn default(mut self, value: i64) -> Self {
        self.preset = Preset::Number(value);
        self
    }

    /// With this value after power-on, which is an assumption: the manual prints none.
    #[must_use]
    pub const fn assumed(mut self, value: i64) -> Self {
        self.preset = Preset::Assumed(value);
        self
    }

    /// With this value plus the node id after power-on.
    #[must_use]
    pub const fn default_plus_node(mut self, value: i64) -> Self {
        self.preset = Preset::PlusNode(value);
        self
    }

    /// With this string after power-on.
    #[must_use]
    pub const fn default_text(mut self, text: &'static str) -> Self {
        self.preset = Preset::Bytes(text.as_bytes());
        self
    }

    /// Only values from `least` to `greatest`, both included.
    #[must_use]
    pub const fn range(mut self, least: i64, greatest: i64) -> Self {
        self.range = Some((least, greatest));
        self
    }

    /// In this unit.
    #[must_use]
    pub const fn unit(mut self, unit: &'static str) -> Self {
        self.unit = unit;
        self
    }

    /// Mappable into PDOs that the device receives.
    #[must_use]
    pub const fn r_pdo(mut self) -> Self {
        self.mappable.r_pdo = true;
        self
    }

    /// Mappable into PDOs that the device transmits.
    #[must_use]
    pub const fn t_pdo(mut self) -> Self {
        self.mappable.t_pdo = true;
        self
    }

    /// Kept over power-off once stored.
    #[must_use]
    pub const fn persistent(mut self) -> Self {
        self.persistent = true;
        self
    }

    /// With an access that is only inferred.
    #[must_use]
    pub const fn inferred(mut self) -> Self {
        self.inferred = true;
        self
    }
}

/// Passes a table through; does not compile as a `static` if its rows are not in ascending order.
///
/// # Panics
/// If the rows are not in strictly ascending order.
#[must_use]
pub const fn table<const N: usize>(entries: [Entry; N]) -> [Entry; N] {
    let mut row = 1;
    while row < N {
        assert!(
            entries[row - 1].address.key() < entries[row].address.key(),
            "rows in ascending order"
        );
        row += 1;
    }
    entries
}

/// A row's place in its table: looked up once, then used without a search.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Row(u16);

/// Which abort codes a device chooses where CiA 301 leaves the choice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refusals {
    /// A wrong length is 0607 0012h (too long) or 0607 0013h (too short), not 0607 0010h.
    pub long_and_short: bool,
    /// A value outside its range is 0609 0031h (too high) or 0609 0032h (too low), not 0609 0030h.
    pub high_and_low: bool,
}

impl Default for Refusals {
    fn default() -> Self {
        Self {
            long_and_short: true,
            high_and_low: false,
        }
    }
}

/// One node's values of a device's table.
#[derive(Debug)]
pub struct Dictionary {
    entries: &'static [Entry],
    node: NodeId,
    refusals: Refusals,
    keys: Vec<u32>,
    /// Their places, each where its key [begins](slot) or behind that: twice as many as there are keys, so that a place is found
    /// in a step or two.
    places: Vec<Option<u16>>,
    /// By row, 0 of a string: loops of simulated drives read numbers all the time.
    values: Vec<i64>,
    /// By row, at hand for whoever shows numbers all the time.
    widths: Vec<Width>,
    /// What was stored last; power-on values of the rows that were never stored.
    stored: Vec<i64>,
    /// In the order of their rows.
    texts: Vec<Text>,
}

/// What a row keeps of a number.
#[derive(Clone, Copy, Debug)]
enum Width {
    /// Nothing: it is a string.
    Text,
    /// All but so many bits.
    Signed(u8),
    Unsigned(u8),
}

impl Width {
    fn of(data_type: DataType) -> Self {
        let unused = || 64 - 8 * data_type.size() as u8;
        match (data_type.is_number(), data_type.is_signed()) {
            (false, _) => Self::Text,
            (true, true) => Self::Signed(unused()),
            (true, false) => Self::Unsigned(unused()),
        }
    }
}

/// A string of a table.
#[derive(Debug)]
struct Text {
    row: Row,
    bytes: Vec<u8>,
    /// What was stored last.
    stored: Vec<u8>,
}

impl Text {
    /// As it is after the first power-on; it never allocates after that.
    fn new(row: Row, entry: &Entry) -> Self {
        let [bytes, stored] = [(); 2].map(|()| {
            let mut bytes = Vec::with_capacity(entry.data_type.size());
            bytes.extend_from_slice(preset_bytes(entry));
            bytes
        });
        Self { row, bytes, stored }
    }
}

/// Where a key's place is looked for first, of so many, a power of two above 1.
fn slot(key: u32, places: usize) -> usize {
    // Fibonacci hashing: neighbours, as most keys are, come far from each other. All bits of a key count in the upper ones
    // of the product.
    (key.wrapping_mul(0x9E37_79B9) >> (u32::BITS - places.ilog2())) as usize
}

/// The places of keys, each at its slot or at the next one that is free.
fn places_of(keys: &[u32]) -> Vec<Option<u16>> {
    let mut places = vec![None; 2 * keys.len().next_power_of_two()];
    for (place, key) in keys.iter().enumerate() {
        let mut slot = slot(*key, places.len());
        while places[slot].is_some() {
            slot = (slot + 1) & (places.len() - 1);
        }
        places[slot] = Some(place as u16);
    }
    places
}

impl Dictionary {
    /// The values of `node` after its first power-on.
    ///
    /// # Panics
    /// If the rows are not in ascending order (see [`table`]) or more than 65 536.
    #[must_use]
    pub fn new(entries: &'static [Entry], node: NodeId) -> Self {
        let keys: Vec<u32> = entries.iter().map(|entry| entry.address.key()).collect();
        assert!(keys.is_sorted_by(|a, b| a < b), "rows in ascending order");
        assert!(entries.len() <= 1 << 16);
        let mut values = vec![0; entries.len()];
        let mut texts = Vec::new();
        for (place, entry) in entries.iter().enumerate() {
            if entry.data_type.is_number() {
                values[place] = preset_number(entry, node);
            } else {
                texts.push(Text::new(Row(place as u16), entry));
            }
        }
        Self {
            entries,
            node,
            refusals: Refusals::default(),
            places: places_of(&keys),
            keys,
            stored: values.clone(),
            values,
            widths: (entries.iter().map(|entry| Width::of(entry.data_type))).collect(),
            texts,
        }
    }

    /// With other abort codes where the standard leaves the choice.
    #[must_use]
    pub const fn refusing(mut self, refusals: Refusals) -> Self {
        self.refusals = refusals;
        self
    }

    /// Gives the values to another node: those that were stored with its id, as COB-IDs are, follow
    /// it; present ones stay until they are [restored](Self::restore).
    pub fn move_to(&mut self, node: NodeId) {
        for (stored, entry) in self.stored.iter_mut().zip(self.entries) {
            if let Preset::PlusNode(_) = entry.preset
                && *stored == preset_number(entry, self.node)
            {
                *stored = preset_number(entry, node);
            }
        }
        self.node = node;
    }

    /// The device's table.
    #[must_use]
    pub const fn entries(&self) -> &'static [Entry] {
        self.entries
    }

    /// The row of an object, if the table has it.
    #[must_use]
    pub fn row(&self, index: u16, sub: u8) -> Option<Row> {
        self.find(Address::new(index, sub)).ok()
    }

    /// The row of an object.
    ///
    /// # Errors
    /// 0602 0000h for an unknown index, 0609 0011h for an unknown subindex.
    pub fn find(&self, address: Address) -> Result<Row, AbortCode> {
        let mut slot = slot(address.key(), self.places.len());
        while let Some(place) = self.places[slot] {
            if self.keys[usize::from(place)] == address.key() {
                return Ok(Row(place));
            }
            slot = (slot + 1) & (self.places.len() - 1);
        }
        let place = self.keys.partition_point(|&key| key < address.key());
        let at = |place: usize| self.keys.get(place).copied();
        let same_index =
            |key: Option<u32>| key.is_some_and(|key| (key >> 8) as u16 == address.index);
        if same_index(at(place)) || same_index(place.checked_sub(1).and_then(at)) {
            Err(AbortCode::UnknownSubindex)
        } else {
            Err(AbortCode::UnknownObject)
        }
    }

    /// What the table says of a row.
    #[must_use]
    pub fn entry(&self, row: Row) -> &'static Entry {
        &self.entries[usize::from(row.0)]
    }

    /// A number's value; 0 for a string.
    #[inline]
    #[must_use]
    pub fn get(&self, row: Row) -> i64 {
        self.values[usize::from(row.0)]
    }

    /// Sets a number without any check but its width; does nothing to a string.
    #[inline]
    pub fn set(&mut self, row: Row, value: i64) {
        let place = usize::from(row.0);
        self.values[place] = match self.widths[place] {
            Width::Text => return,
            Width::Signed(unused) => value << unused >> unused,
            Width::Unsigned(unused) => ((value as u64) << unused >> unused) as i64,
        };
    }

    /// A string's bytes; empty for a number.
    #[must_use]
    pub fn bytes(&self, row: Row) -> &[u8] {
        let place = self.text_place(row);
        place.map_or(&[], |place| &self.texts[place].bytes)
    }

    fn text_place(&self, row: Row) -> Option<usize> {
        self.texts.binary_search_by_key(&row, |text| text.row).ok()
    }

    /// Sets a string, cut to its greatest length; does nothing to a number.
    pub fn set_bytes(&mut self, row: Row, bytes: &[u8]) {
        if let Some(place) = self.text_place(row) {
            let most = self.entry(row).data_type.size();
            let text = &mut self.texts[place].bytes;
            text.clear();
            text.extend_from_slice(&bytes[..bytes.len().min(most)]);
        }
    }

    /// The number at an address, if the table has one there.
    #[must_use]
    pub fn value(&self, index: u16, sub: u8) -> Option<i64> {
        self.number_row(index, sub).map(|row| self.get(row))
    }

    /// Sets the number at an address without any check; whether the table has one there.
    pub fn put(&mut self, index: u16, sub: u8, value: i64) -> bool {
        let row = self.number_row(index, sub);
        if let Some(row) = row {
            self.set(row, value);
        }
        row.is_some()
    }

    fn number_row(&self, index: u16, sub: u8) -> Option<Row> {
        let row = self.row(index, sub);
        row.filter(|row| self.entry(*row).data_type.is_number())
    }

    /// The number that `data` means, little-endian.
    ///
    /// # Errors
    /// The abort codes for a wrong length (see [`Refusals`]).
    pub fn number(&self, row: Row, data: &[u8]) -> Result<i64, AbortCode> {
        let entry = self.entry(row);
        self.check_length(entry, data.len())?;
        let mut raw = [0; 8];
        let size = data.len().min(8);
        raw[..size].copy_from_slice(&data[..size]);
        Ok(entry
            .data_type
            .extend(u64::from_le_bytes(raw), size as u32 * 8))
    }

    /// Checks a number against a row's range.
    ///
    /// # Errors
    /// The abort code for a value outside the range.
    pub fn check_range(&self, row: Row, value: i64) -> Result<(), AbortCode> {
        match self.entry(row).range {
            Some((least, _)) if value < least => Err(if self.refusals.high_and_low {
                AbortCode::ValueTooLow
            } else {
                AbortCode::InvalidValue
            }),
            Some((_, greatest)) if value > greatest => Err(if self.refusals.high_and_low {
                AbortCode::ValueTooHigh
            } else {
                AbortCode::InvalidValue
            }),
            _ => Ok(()),
        }
    }

    fn check_length(&self, entry: &Entry, length: usize) -> Result<(), AbortCode> {
        let size = entry.data_type.size();
        let fits = if entry.data_type.is_number() {
            length == size
        } else {
            length <= size
        };
        match length {
            _ if fits => Ok(()),
            _ if !self.refusals.long_and_short => Err(AbortCode::LengthMismatch),
            _ if length > size => Err(AbortCode::TooLong),
            _ => Err(AbortCode::TooShort),
        }
    }

    /// Writes a row's value into `buffer`, little-endian, and returns its length.
    ///
    /// # Errors
    /// 0504 0005h if the buffer is too small.
    pub fn encode(&self, row: Row, buffer: &mut [u8]) -> Result<usize, AbortCode> {
        let data_type = self.entry(row).data_type;
        let raw;
        let bytes = if data_type.is_number() {
            raw = self.get(row).to_le_bytes();
            &raw[..data_type.size()]
        } else {
            self.bytes(row)
        };
        buffer
            .get_mut(..bytes.len())
            .ok_or(AbortCode::OutOfMemory)?
            .copy_from_slice(bytes);
        Ok(bytes.len())
    }

    /// Checks whether a download may begin, and returns how many bytes the row takes at most.
    ///
    /// # Errors
    /// 0601 0002h for a read-only row; the abort codes for a wrong length if `size` is known.
    pub fn check_download(&self, row: Row, size: Option<usize>) -> Result<usize, AbortCode> {
        let entry = self.entry(row);
        if !entry.access.writable() {
            return Err(AbortCode::ReadOnly);
        }
        if let Some(size) = size {
            self.check_length(entry, size)?;
        }
        Ok(entry.data_type.size())
    }

    /// Keeps the present values of those persistent rows that `which` picks, for the next power-on.
    pub fn store(&mut self, which: impl Fn(&Entry) -> bool) {
        let kept = |entry: &Entry| entry.persistent && which(entry);
        for (row, entry) in self.entries.iter().enumerate() {
            if kept(entry) {
                self.stored[row] = self.values[row];
            }
        }
        for text in &mut self.texts {
            if kept(&self.entries[usize::from(text.row.0)]) {
                text.stored.clone_from(&text.bytes);
            }
        }
    }

    /// Forgets what was stored of the rows that `which` picks: defaults from the next power-on.
    pub fn forget(&mut self, which: impl Fn(&Entry) -> bool) {
        for (row, entry) in self.entries.iter().enumerate() {
            if entry.data_type.is_number() && which(entry) {
                self.stored[row] = preset_number(entry, self.node);
            }
        }
        for text in &mut self.texts {
            let entry = &self.entries[usize::from(text.row.0)];
            if which(entry) {
                text.stored.clear();
                text.stored.extend_from_slice(preset_bytes(entry));
            }
        }
    }

    /// Gives the rows that `which` picks the values they have after power-on.
    pub fn restore(&mut self, which: impl Fn(&Entry) -> bool) {
        for (row, entry) in self.entries.iter().enumerate() {
            if which(entry) {
                self.values[row] = self.stored[row];
            }
        }
        for text in &mut self.texts {
            if which(&self.entries[usize::from(text.row.0)]) {
                text.bytes.clone_from(&text.stored);
            }
        }
    }
}

fn preset_number(entry: &Entry, node: NodeId) -> i64 {
    match entry.preset {
        Preset::Number(value) | Preset::Assumed(value) => value,
        Preset::PlusNode(value) => value + i64::from(node.get()),
        Preset::Unknown | Preset::Bytes(_) => 0,
    }
}

const fn preset_bytes(entry: &Entry) -> &'static [u8] {
    match entry.preset {
        Preset::Bytes(bytes) => bytes,
        _ => &[],
    }
}

/// A passive node: every access that the table permits reads or writes the values.
impl Objects for Dictionary {
    fn upload(&mut self, address: Address, buffer: &mut [u8]) -> Result<usize, AbortCode> {
        let row = self.find(address)?;
        if !self.entry(row).access.readable() {
            return Err(AbortCode::WriteOnly);
        }
        self.encode(row, buffer)
    }

    fn begin_download(
        &mut self,
        address: Address,
        size: Option<usize>,
    ) -> Result<usize, AbortCode> {
        self.check_download(self.find(address)?, size)
    }

    fn download(&mut self, address: Address, data: &[u8]) -> Result<(), AbortCode> {
        let row = self.find(address)?;
        self.check_download(row, Some(data.len()))?;
        if self.entry(row).data_type.is_number() {
            let value = self.number(row, data)?;
            self.check_range(row, value)?;
            self.set(row, value);
        } else {
            self.set_bytes(row, data);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_number_is_one() {
        static TABLE: [Entry; 3] = table([
            ro(0x1001, 0, "Error register", DataType::U8).default(3),
            ro(0x1008, 0, "Device name", DataType::Text(4)).default_text("name"),
            rw(0x2000, 0, "Program", DataType::Domain(4)),
        ]);
        let mut objects = Dictionary::new(&TABLE, NodeId::MAX);
        assert_eq!(objects.value(0x1001, 0), Some(3));
        assert!(objects.put(0x1001, 0, 4));
        for index in [0x1008, 0x2000, 0x3000] {
            assert_eq!(objects.value(index, 0), None, "{index:04X}h");
            assert!(!objects.put(index, 0, 1), "{index:04X}h");
        }
    }

    /// Objects as devices have them: some of the communication profile, a maker's own by groups, and those of a device profile.
    #[test]
    fn a_key_is_found_in_a_step_or_two() {
        for (groups, subs) in [(1, 4), (10, 3), (40, 8), (200, 12)] {
            let indices = (0x1000..0x1003)
                .chain([
                    0x1018, 0x1400, 0x1401, 0x1600, 0x1601, 0x1800, 0x1801, 0x1A00,
                ])
                .chain((0..groups).map(|group| 0x2000 + 0x11 * group))
                .chain((0..groups).map(|group| 0x6040 + group));
            let keys = indices.flat_map(|index| (0..subs).map(move |sub| index << 8 | sub));
            let keys: Vec<u32> = keys.collect();
            let places = places_of(&keys);
            let steps = |(place, key): (usize, &u32)| {
                let found = places.iter().position(|it| *it == Some(place as u16));
                let from = slot(*key, places.len());
                (found.unwrap() + places.len() - from) % places.len() + 1
            };
            let all: usize = keys.iter().enumerate().map(steps).sum();
            let mean = all as f64 / keys.len() as f64;
            assert!(mean < 1.6, "{mean} steps for {} keys", keys.len());
        }
    }

    #[test]
    fn addresses_are_read_as_people_write_them() {
        for (text, index, sub) in [
            ("3012:6", 0x3012, 6),
            ("60C2h:1", 0x60C2, 1),
            ("6065", 0x6065, 0),
            ("3006:3D", 0x3006, 0x3D),
            ("3006:3Dh", 0x3006, 0x3D),
        ] {
            assert_eq!(text.parse(), Ok(Address::new(index, sub)), "{text}");
        }
        for text in [
            "", ":", "3012:", ":6", "30122:6", "3012:100", "+301:1", "x", "3012:6:1",
        ] {
            assert_eq!(text.parse::<Address>(), Err(ParseAddressError), "{text}");
        }
    }
}
