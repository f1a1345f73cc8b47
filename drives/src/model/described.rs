//! Models that a description states: a generic model with another name, another data sheet and other numbers.
//!
//! A device is made, set up and followed by the generic model's own code. Which objects that needs is asked of
//! the device that it makes: what it writes, reads and maps has to be in the data sheet.

use super::profile::cia402::TORQUE_OFFSET;
use super::{Ability, Address, Data, Device, Increments, MODELS, Mapping, Model, Settings};
use core::fmt;
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};
use syncline_canopen::dictionary::{self, DataType, Entry, Mappable, Preset};
use syncline_canopen::eds::{Access, Eds, Parameter, Value};

/// What a file says of a kind of device, beside its numbers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Description {
    /// Its name, as messages have it.
    pub name: String,
    /// Who makes it, if that is said.
    pub maker: Option<String>,
    /// What is sent for objects that the maker has mapped into its R_PDO, and that the model does not go by.
    pub r_pdo_values: Vec<(Address, i64)>,
    /// Its data sheet.
    pub eds: Eds,
}

/// A description, the name of its generic model, and what was made of them.
type Known = (Description, &'static str, &'static Model);

/// Models live as long as the program, as the built-in ones do: each description becomes one once, however often
/// its file is read.
static KNOWN: Mutex<Vec<Known>> = Mutex::new(Vec::new());

impl Model {
    /// Whether a description may have this model behind it: a drive or an encoder of whoever follows the profile.
    #[must_use]
    pub fn is_generic(&self) -> bool {
        !self.is_io() && self.maker.is_none() && self.generic.is_none()
    }

    /// The model that a description states, with this generic one behind it.
    ///
    /// Bit rates are those of `[DeviceInfo]` that this model takes, or all of them where the data sheet says of none
    /// that the device has it. What the data sheet gives no value after power-on has this model's.
    #[must_use]
    pub fn described(&'static self, description: Description) -> &'static Self {
        let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
        let mut before = known.iter();
        if let Some((.., model)) =
            before.find(|(said, generic, _)| *said == description && *generic == self.name)
        {
            return model;
        }
        let leaked = |text: &str| -> &'static str { text.to_owned().leak() };
        let name = leaked(&description.name);
        let eds = &description.eds;
        let dictionary = eds.parameters().map(|(address, parameter)| {
            let mut usual = self.dictionary.iter();
            let usual = usual.find(|entry| entry.address == address);
            entry(address, parameter, usual, leaked)
        });
        let dictionary: &'static [Entry] = Vec::leak(dictionary.collect());
        let has = |address| dictionary.iter().any(|entry| entry.address == address);
        let abilities = self.abilities.iter().copied();
        let abilities = abilities.filter(|ability| objects_of(*ability).iter().copied().all(has));
        let abilities = abilities.filter(|ability| match ability {
            Ability::Torque => is_mapped(dictionary, TORQUE, |by| by.t_pdo),
            Ability::TorqueOffset => is_mapped(dictionary, TORQUE_OFFSET, |by| by.r_pdo),
            _ => true,
        });
        let model: &'static Self = Box::leak(Box::new(Self {
            name,
            title: name,
            maker: description.maker.as_deref().map(leaked),
            bitrates: Vec::leak(bitrates(eds, self.bitrates)),
            abilities: Vec::leak(abilities.collect()),
            generic: Some(self),
            r_pdo_values: Vec::leak(description.r_pdo_values.clone()),
            dictionary,
            ..self.clone()
        }));
        known.push((description, self.name, model));
        model
    }

    /// What a device with these settings needs and the dictionary of this model does not have, in the order of the
    /// objects; nothing of a built-in model.
    #[must_use]
    pub fn lacks(&'static self, settings: &Settings) -> Vec<Lack> {
        let able = |ability| self.abilities.contains(&ability);
        let settings = Settings {
            following_error_limit: able(Ability::FollowingErrorLimit).then_some(Increments::MAX),
            soft_limits: able(Ability::SoftLimits).then_some((Increments::MIN, Increments::MAX)),
            ..settings.clone()
        };
        let device = self.device(&settings);
        let uses = uses(&device);
        let generic = self.generic.unwrap_or(self);
        let wrong = |uses: &BTreeMap<Address, Uses>| {
            let wrong = uses.iter().filter_map(|(&address, uses)| {
                let problem = self.problem(address, uses)?;
                Some((address, problem))
            });
            wrong.collect::<BTreeMap<_, _>>()
        };
        let found = wrong(&uses);
        let unmapped = |device: &Device| {
            let mapped = device.mapped();
            mapped.iter().map(|it| it.lacks(self).len()).sum::<usize>()
        };
        // Keys that bring nothing else that is wrong.
        let others = self
            .with_other_values(&settings)
            .filter_map(|(key, other)| {
                let left = wrong(&self::uses(&other));
                let is_better = left.keys().all(|address| found.contains_key(address))
                    && unmapped(&other) <= unmapped(&device);
                is_better.then_some((key, left))
            });
        let others: Vec<_> = others.collect();
        let lacks = found.iter().map(|(&address, problem)| {
            let mut keys = others.iter();
            let key = keys.find(|(_, left)| !left.contains_key(&address));
            let mend = match key {
                Some((key, _)) => format!("with `{key}` it does not"),
                None => "no key of a description changes that".to_owned(),
            };
            let mend = self.other_mode(address).unwrap_or(mend);
            let help = format!("{} goes by this object; {mend}", generic.title);
            self.lack(address, problem.clone(), help)
        });
        let mut lacks: Vec<_> = lacks.collect();
        for mapping in device.mapped() {
            lacks.extend(mapping.lacks(self));
        }
        lacks.extend(self.idle_values(&device));
        lacks
    }

    /// The devices that these settings make with one of the generic model's choices made otherwise, and the key that
    /// does that.
    fn with_other_values(
        &'static self,
        settings: &Settings,
    ) -> impl Iterator<Item = (String, Device)> {
        let choices = self.assumptions.iter().copied().flatten();
        let choices = choices.filter(|it| it.allowed.end() - it.allowed.start() < MOST_CHOICES);
        choices.flat_map(move |choice| {
            let is_other = |value: &u32| *value != settings.assumed.value(choice);
            let others = choice.allowed.clone().filter(is_other);
            let others: Vec<_> = others.map(|value| (choice.name, value)).collect();
            others.into_iter().map(move |(name, value)| {
                let mut settings = settings.clone();
                settings.assumed.0.retain(|(stated, _)| *stated != name);
                settings.assumed.0.push((name, value));
                (format!("{name} = {value}"), self.device(&settings))
            })
        })
    }

    /// Which other generic models have the modes that it tells (6502h), if any.
    fn other_mode(&self, address: Address) -> Option<String> {
        let mut rows = self.dictionary.iter();
        let is_told = address == MODES && self.is_drive();
        let row = rows.find(|row| is_told && row.address == address)?;
        let Preset::Number(modes) = row.preset else {
            return None;
        };
        let tells = |model: &Model| {
            let mut rows = model.dictionary.iter();
            let own = rows.find(|row| row.address == MODES);
            matches!(own.map(|own| own.preset), Some(Preset::Number(own)) if own & modes != 0)
        };
        let generic = self.generic.unwrap_or(self);
        let mut drives: Vec<_> = MODELS
            .iter()
            .filter(|it| it.is_generic() && it.is_drive())
            .collect();
        drives.retain(|it| it.name != generic.name && tells(it));
        let named = drives.iter();
        let named: Vec<_> = named
            .map(|it| format!("`generic = \"{}\"`", it.name))
            .collect();
        (!named.is_empty()).then(|| format!("it tells the mode of {}", named.join(" and of ")))
    }

    /// The values stated for an R_PDO that it does not carry, or that are not for a description to state.
    fn idle_values(&self, device: &Device) -> Vec<Lack> {
        let spec = device.spec();
        let mapped = device.mapped();
        let received: Vec<&Mapping> = mapped.into_iter().filter(|it| it.is_received()).collect();
        let own = |address: Address| {
            let mut needed = received.iter().flat_map(|it| it.needed());
            // Of two drives of a description one may be sent torques, and the other the value.
            needed.any(|it| it == address && it != TORQUE_OFFSET)
                || spec.setup.iter().any(|it| it.address == address)
        };
        let problem = |address: Address| {
            if own(address) {
                let help = "the controller writes or sends it: leave its value out";
                return Some(("is the controller's own", help));
            }
            let help = "allowed: objects that its maker has mapped there, by the data sheet";
            let is_sent = received.iter().any(|it| it.has(address));
            (!is_sent).then_some(("is not in its R_PDO", help))
        };
        let stated = self.r_pdo_values.iter();
        let lacks = stated.filter_map(|&(address, _)| {
            let (problem, help) = problem(address)?;
            let problem = format!("has a value in `r_pdo_values`, and {problem}");
            Some(self.lack(address, problem, help.to_owned()))
        });
        lacks.collect()
    }

    /// An object by its name in the profile, or in the data sheet where the profile does not have it.
    pub(super) fn lack(&self, address: Address, problem: String, help: String) -> Lack {
        let generic = self.generic.unwrap_or(self);
        let mut usual = generic.dictionary.iter().chain(self.dictionary);
        let usual = usual.find(|entry| entry.address == address);
        Lack {
            address,
            name: usual.map_or("", |entry| entry.name),
            problem,
            help,
        }
    }

    /// Why an object cannot be used so.
    fn problem(&self, address: Address, uses: &Uses) -> Option<String> {
        let mut rows = self.dictionary.iter();
        let Some(row) = rows.find(|row| row.address == address) else {
            return Some("is not there".into());
        };
        let generic = self.generic.unwrap_or(self);
        let mut usual = generic.dictionary.iter();
        let usual = usual.find(|entry| entry.address == address);
        if let Some(usual) = usual.filter(|usual| usual.data_type != row.data_type) {
            let (is, wanted) = (row.data_type, usual.data_type);
            return Some(format!("is of type {is:?}, not {wanted:?}"));
        }
        if uses.read && !row.access.readable() {
            return Some("cannot be read".into());
        }
        if uses.written && !row.access.writable() {
            return Some("cannot be written".into());
        }
        if uses.received && !row.mappable.r_pdo {
            return Some("cannot be mapped into an R_PDO".into());
        }
        if uses.transmitted && !row.mappable.t_pdo {
            return Some("cannot be mapped into a T_PDO".into());
        }
        match (uses.reads_as, row.preset) {
            (Some((mask, value)), Preset::Number(number)) if number as u32 & mask != value => {
                let number = number as u32 & mask;
                Some(format!("is {number:X}h, not {value:X}h"))
            }
            _ => None,
        }
    }
}

/// An object that is not in a data sheet as a device of the described model has to have it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lack {
    /// The object.
    pub address: Address,
    /// Its name in the profile, or in the data sheet.
    pub name: &'static str,
    /// `cannot be written`
    pub problem: String,
    /// Why it matters, or what to do.
    pub help: String,
}

impl fmt::Display for Lack {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.name {
            // Neither the profile nor the data sheet has it.
            "" => write!(f, "{} {}", self.address, self.problem),
            name => write!(f, "{} ({name}) {}", self.address, self.problem),
        }
    }
}

/// What an object is used for.
#[derive(Default)]
struct Uses {
    read: bool,
    written: bool,
    received: bool,
    transmitted: bool,
    /// What it reads in these bits in every device of the kind.
    reads_as: Option<(u32, u32)>,
}

/// What a device goes by of its dictionary.
fn uses(device: &Device) -> BTreeMap<Address, Uses> {
    let mut uses: BTreeMap<Address, Uses> = BTreeMap::new();
    let spec = device.spec();
    for mapping in device.mapped() {
        for object in mapping.needed() {
            let used = uses.entry(object).or_default();
            match mapping.is_received() {
                true => used.received = true,
                false => used.transmitted = true,
            }
        }
    }
    for write in &spec.setup {
        uses.entry(write.address).or_default().written = true;
    }
    for write in &spec.ensured {
        let used = uses.entry(write.address).or_default();
        (used.read, used.written) = (true, true);
    }
    for write in &spec.read_back {
        uses.entry(write.address).or_default().read = true;
    }
    for identity in &spec.identity {
        let used = uses.entry(identity.address).or_default();
        used.read = true;
        // A resolution is what a device was ordered or set with.
        if matches!(identity.address.index, 0x1000..0x2000 | 0x6502) {
            used.reads_as = Some((identity.mask, identity.value));
        }
    }
    let drive = device.drive();
    let survey = drive.and_then(|drive| drive.survey()).map(|it| it.address);
    let mode = drive.and_then(|drive| drive.mode()).map(|it| it.address);
    for address in survey.into_iter().chain(mode) {
        uses.entry(address).or_default().read = true;
    }
    uses
}

/// Values that an assumption has at the most that is a choice between kinds of devices, not a number.
const MOST_CHOICES: u32 = 4;

/// Supported drive modes: bit 0 is mode 1.
const MODES: Address = Address::new(0x6502, 0);

/// The objects by which a drive of CiA 402 has an ability.
const TORQUE: Address = Address::new(0x6077, 0);

/// Whether PDOs can carry an object as the profile has it, 16 bits signed.
fn is_mapped(dictionary: &[Entry], address: Address, by: impl Fn(Mappable) -> bool) -> bool {
    let mut rows = dictionary.iter();
    let row = rows.find(|row| row.address == address);
    row.is_some_and(|row| by(row.mappable) && row.data_type == DataType::I16)
}

fn objects_of(ability: Ability) -> &'static [Address] {
    match ability {
        Ability::FollowingErrorLimit => const { &[Address::new(0x6065, 0)] },
        Ability::SoftLimits => const { &[Address::new(0x607D, 1), Address::new(0x607D, 2)] },
        Ability::ProfileVelocity => const { &[Address::new(0x6083, 0), Address::new(0x6084, 0)] },
        Ability::PointToPoint | Ability::SyncDivider | Ability::CountsWithinTurn => &[],
        Ability::Torque => const { &[TORQUE] },
        Ability::TorqueOffset => const { &[TORQUE_OFFSET] },
    }
}

fn bitrates(eds: &Eds, taken: &[u32]) -> Vec<u32> {
    let says = |rate: &u32| {
        let said = eds.device_info(&format!("BaudRate_{}", rate / 1000));
        said.is_some_and(|said| said != "0")
    };
    let said: Vec<u32> = taken.iter().copied().filter(says).collect();
    if said.is_empty() {
        taken.to_vec()
    } else {
        said
    }
}

/// A row of a data sheet. Types that a dictionary does not have are strings of bytes.
fn entry(
    address: Address,
    parameter: &Parameter,
    usual: Option<&Entry>,
    leaked: impl Fn(&str) -> &'static str,
) -> Entry {
    let (readable, writable) = parameter.access.by_sdo();
    let data_type = data_type(parameter);
    let number = |value: &Option<Value>| match value {
        Some(Value::Number(number)) => Some(*number),
        _ => None,
    };
    let (least, most) = Data::range(data_type).unwrap_or((i64::MIN, i64::MAX));
    let range = match (number(&parameter.low), number(&parameter.high)) {
        (None, None) => None,
        (low, high) => Some((low.unwrap_or(least), high.unwrap_or(most))),
    };
    let preset = match &parameter.default {
        Some(Value::Number(value)) if data_type.is_number() => Preset::Number(*value),
        Some(Value::PlusNode(value)) if Data::encode(DataType::U32, *value).is_some() => {
            Preset::PlusNode(*value)
        }
        Some(Value::Text(text)) if !data_type.is_number() => Preset::Bytes(leaked(text).as_bytes()),
        _ => match usual.filter(|usual| usual.data_type == data_type) {
            Some(usual) => match usual.preset {
                Preset::Number(value) => Preset::Assumed(value),
                other => other,
            },
            None => Preset::Unknown,
        },
    };
    Entry {
        address,
        name: leaked(&parameter.name),
        data_type,
        access: match (parameter.access, readable, writable) {
            (Access::Const, ..) => dictionary::Access::Const,
            (_, true, false) => dictionary::Access::Ro,
            (_, false, _) => dictionary::Access::Wo,
            (_, true, true) => dictionary::Access::Rw,
        },
        inferred: false,
        mappable: Mappable {
            r_pdo: parameter.pdo_mapping && writable && parameter.access != Access::Rwr,
            t_pdo: parameter.pdo_mapping && readable && parameter.access != Access::Rww,
        },
        range,
        preset,
        unit: usual.map_or("", |usual| usual.unit),
        persistent: false,
    }
}

/// Bytes that a string or a domain may have where only its type is known.
const STRING: u16 = 64;

fn data_type(parameter: &Parameter) -> DataType {
    use DataType::{Bool, Domain, I8, I16, I32, I64, Octets, Text, U8, U16, U32, U64};
    match parameter.data_type {
        0x09 | 0x0B => Text(STRING),
        0x0A => Octets(STRING),
        0x0F => Domain(STRING),
        // INTEGER24 to UNSIGNED56, REAL and the times by their size.
        0x10 | 0x16 => Octets(3),
        0x08 => Octets(4),
        0x12 | 0x18 => Octets(5),
        0x13 | 0x19 | 0x0C | 0x0D => Octets(6),
        0x14 | 0x1A => Octets(7),
        0x11 => Octets(8),
        code => {
            let numbers = [Bool, I8, I16, I32, I64, U8, U16, U32, U64];
            let mut numbers = numbers.into_iter();
            numbers
                .find(|it| it.code() == code)
                .unwrap_or(Octets(STRING))
        }
    }
}
