//! What generic devices have in common: who made them, and PDOs that they have or do not have. Of drives of CiA 402, whatever
//! they are sent, their whole set-up with one PDO each way.
//!
//! Positions are encoder increments at the motor's shaft. What a drive does not have of the profile, or does in another
//! way, is an [`Assumption`].

use super::cia402;
use super::communication::{self, HAS_GUARDING, HAS_HEARTBEAT, SDO_RESPONSE, T_PDO_RESPONSE};
use crate::dictionary;
use crate::model::{
    Address, Assumed, Assumption, Data, Identity, Increments, Make, Mapping, Model, Monitoring,
    NODES, NodeSpec, Settings, Write,
};
use core::time::Duration;
use syncline_canopen::dictionary::{Entry, Preset};
use syncline_canopen::{BIT_RATES, CobId, NodeId, pdo::CobIdWord};

pub(in crate::model) const ENCODER_INCREMENTS: Assumption = Assumption {
    name: "encoder_increments",
    default: 1_048_576,
    allowed: 1..=1 << 30,
    meaning: "increments for each motor revolution: what 608Fh:1 has to read, with 608Fh:2 = 1",
};

pub(in crate::model) const HAS_RESOLUTION: Assumption = Assumption {
    name: "has_resolution",
    default: 1,
    allowed: 0..=1,
    meaning: "1: it has 608Fh and 6091h, which are read; 0: it has neither, and counts as encoder_increments says",
};

pub(in crate::model) const HAS_PERIOD: Assumption = Assumption {
    name: "has_period",
    default: 1,
    allowed: 0..=1,
    meaning: "1: 60C2h is set to the cycle; 0: it has no such object, and goes by the time between two SYNCs",
};

pub(in crate::model) const TELLS_FOLLOWING: Assumption = Assumption {
    name: "tells_following",
    default: 1,
    allowed: 0..=1,
    meaning: "1: statusword bit 12 says that it follows; 0: it leaves the bit off, and follows while it is enabled",
};

pub(in crate::model) const VENDOR_ID: Assumption = Assumption {
    name: "vendor_id",
    default: 0,
    allowed: 0..=u32::MAX,
    meaning: "what 1018h:1 has to read; 0: whatever it reads",
};

pub(in crate::model) const PRODUCT_CODE: Assumption = Assumption {
    name: "product_code",
    default: 0,
    allowed: 0..=u32::MAX,
    meaning: "what 1018h:2 has to read; 0: whatever it reads",
};

pub(in crate::model) const PDOS: Assumption = Assumption {
    name: "pdos",
    default: 4,
    allowed: 1..=4,
    meaning: "PDOs that the drive has in each direction; those without use are switched off",
};

pub(in crate::model) const R_PDO: Assumption = Assumption {
    name: "r_pdo",
    default: 1,
    allowed: 1..=4,
    meaning: "number of the R_PDO that brings controlword and target position",
};

pub(in crate::model) const T_PDO: Assumption = Assumption {
    name: "t_pdo",
    default: 1,
    allowed: 1..=4,
    meaning: "number of the T_PDO that brings statusword and actual position",
};

pub(in crate::model) const FIXED_MAPPING: Assumption = Assumption {
    name: "fixed_mapping",
    default: 0,
    allowed: 0..=1,
    meaning: "1: the two PDOs are mapped by the maker, as the data sheet says, which is read; 0: they are mapped by the set-up, if they can be",
};

/// How a drive counts that tells a position.
pub(in crate::model) const COUNTING: &[Assumption] = &[ENCODER_INCREMENTS, HAS_RESOLUTION];

/// What one may leave out of a cyclic synchronous mode.
pub(in crate::model) const SYNCHRONOUS: &[Assumption] = &[HAS_PERIOD, TELLS_FOLLOWING];

/// Who made it, its PDOs, how it is supervised, and how fast it answers.
pub(in crate::model) const DRIVE: &[Assumption] = &[
    VENDOR_ID,
    PRODUCT_CODE,
    PDOS,
    R_PDO,
    T_PDO,
    FIXED_MAPPING,
    HAS_HEARTBEAT,
    HAS_GUARDING,
    T_PDO_RESPONSE,
    SDO_RESPONSE,
];

/// The motor's rated torque, thousandths of N·m.
const RATED_TORQUE: Address = Address::new(0x6076, 0);

/// What generic drives differ in.
#[derive(Clone, Copy, Debug)]
pub(in crate::model) struct Kind {
    /// 6060h.
    pub(in crate::model) mode: u8,
    /// What the R_PDO brings behind the controlword, as it is mapped.
    pub(in crate::model) setpoint: u32,
    /// What the T_PDO brings behind the statusword, likewise.
    pub(in crate::model) actual: u32,
}

/// 60B2h, mapped.
const TORQUE_OFFSET_MAPPED: u32 = 0x60B2_0010;

/// 6064h, mapped.
pub(in crate::model) const POSITION: u32 = 0x6064_0020;

/// The two PDOs that are used.
#[derive(Clone, Debug)]
pub(in crate::model) struct Pdos {
    /// Controlword and setpoint.
    pub(in crate::model) receive: Mapping,
    /// Statusword and actual value, and the torque where it is told.
    pub(in crate::model) transmit: Mapping,
}

impl Pdos {
    /// What the maker has in the R_PDO is sent as the set-up writes it: as the kind has it of its `own`, or else as is stated.
    fn new(model: &Model, settings: &Settings, kind: Kind, own: &[Write]) -> Self {
        let assumed = &settings.assumed;
        let [r_pdo, t_pdo] = [&R_PDO, &T_PDO].map(|pdo| number(assumed, pdo));
        let is_said = is_mapped_by_the_maker(assumed);
        let mut values = vec![(MODE, kind.mode.into())];
        values.extend(own.iter().filter_map(|write| {
            let mut rows = model.dictionary.iter();
            let row = rows.find(|row| row.address == write.address)?;
            Some((write.address, write.data.value(row.data_type)))
        }));
        values.extend(model.r_pdo_values);
        let torque: &[u32] = if settings.torque { &[0x6077_0010] } else { &[] };
        let offset: &[u32] = match settings.torque_offset {
            Some(_) => &[TORQUE_OFFSET_MAPPED],
            None => &[],
        };
        let receive = [&[0x6040_0010, kind.setpoint][..], offset];
        let transmit = [&[0x6041_0010, kind.actual][..], torque];
        let mapped =
            |index, needed, values| Mapping::by_maker(model, is_said, index, needed, values);
        Self {
            receive: mapped(parameter(0x1600, r_pdo), receive, values),
            transmit: mapped(parameter(0x1A00, t_pdo), transmit, Vec::new()),
        }
    }

    /// Both.
    pub(in crate::model) fn all(&self) -> Vec<&Mapping> {
        vec![&self.receive, &self.transmit]
    }
}

/// 6060h, which is sent as it is set up where the maker has it in an R_PDO.
const MODE: Address = Address::new(0x6060, 0);

/// What is known of every generic drive before it is made; one has abilities and assumptions of its own beside.
///
/// Cycles are those that 60C2h holds in milliseconds or tenths of them.
pub(in crate::model) const fn drive(name: &'static str, title: &'static str, make: Make) -> Model {
    Model {
        name,
        title,
        maker: None,
        bitrates: BIT_RATES,
        nodes: NODES,
        cycle_step: Duration::from_micros(500),
        cycles: Duration::from_micros(500)..=Duration::from_millis(20),
        increments_per_revolution: |assumed| assumed.value(&ENCODER_INCREMENTS),
        positions: Increments::MIN..=Increments::MAX,
        abilities: &[],
        generic: None,
        r_pdo_values: &[],
        assumptions: &[],
        choices: &[],
        dictionary: dictionary::CIA402_CSP,
        reserved,
        inputs: &[],
        outputs: &[],
        analog_inputs: &[],
        analog_outputs: &[],
        captures: &[],
        homing_methods: &[],
        torque_limit: None,
        make,
    }
}

/// Whether an object of every generic drive is the controller's: the communication profile, the words of the state machine,
/// mode, cycle and scaling.
pub(in crate::model) fn reserved(Address { index, .. }: Address) -> bool {
    matches!(
        index,
        0x1000..=0x1FFF | 0x6040 | 0x6060 | 0x608F | 0x6091 | 0x60C2
    )
}

/// A drive that runs in the mode of `kind`, and its PDOs. Behind it its set-up has `own` of the kind, before the user's objects.
pub(in crate::model) fn spec(
    model: &'static Model,
    settings: &Settings,
    kind: Kind,
    own: Vec<Write>,
) -> (NodeSpec, Pdos) {
    let pdos = Pdos::new(model, settings, kind, &own);
    let (node, assumed) = (settings.node, &settings.assumed);
    let [r_pdo, t_pdo] = [&R_PDO, &T_PDO].map(|pdo| number(assumed, pdo));
    let monitoring = communication::monitoring(assumed, &settings.heartbeat);
    let mut setup = setup(model, settings, kind, &pdos, own);
    setup.extend(communication::supervision(monitoring, &settings.heartbeat));
    let spec = NodeSpec {
        identity: identity(model, settings, kind, &pdos),
        // The serial number (CiA 301, 7.5.2.24), which a device need not have.
        marks: [Some(Address::new(0x1018, 4)), None],
        history: cia402::HISTORY.to_vec(),
        // Older devices, which have no heartbeat, need not say that they have booted.
        tells_boot_up: monitoring == Monitoring::Heartbeat,
        monitoring,
        release: communication::end_of_supervision(monitoring),
        t_pdos: vec![communication::t_pdo(t_pdo, node, pdos.transmit.bytes())],
        sync_divider: settings.sync_divider.into(),
        r_pdos: vec![communication::r_pdo(r_pdo, node, pdos.receive.bytes())],
        ..NodeSpec::new(model, settings, setup, cia402::is_command)
    };
    (spec, pdos)
}

/// What tells a drive that does as is assumed.
fn identity(model: &Model, settings: &Settings, kind: Kind, pdos: &Pdos) -> Vec<Identity> {
    let (reads, assumed) = (Identity::new, &settings.assumed);
    // Bit 0 of 6502h is mode 1.
    let mode = 1 << (kind.mode - 1);
    // What stands above CiA 402 tells a servo from other drives.
    let mut identity = vec![reads(0x1000, 0, "device type", 402).in_bits(0xFFFF)];
    identity.extend(maker(assumed));
    identity.push(reads(0x6502, 0, "supported drive modes", mode).in_bits(mode));
    // What tells no position counts none.
    if kind.actual == POSITION && assumed.value(&HAS_RESOLUTION) != 0 {
        let encoder_increments = assumed.value(&ENCODER_INCREMENTS);
        identity.extend([
            reads(0x608F, 1, "encoder increments", encoder_increments),
            reads(0x608F, 2, "motor revolutions", 1),
            reads(0x6091, 1, "gear ratio, motor shaft", 1),
            reads(0x6091, 2, "gear ratio, driving shaft", 1),
        ]);
    }
    // What the offsets are parts of, where the drive tells it.
    let tells = |row: &Entry| row.address == RATED_TORQUE;
    if let Some(rated) = settings
        .torque_offset
        .filter(|_| model.dictionary.iter().any(tells))
    {
        let Address { index, sub } = RATED_TORQUE;
        let rated = reads(index, sub, "motor rated torque", rated);
        identity.push(rated.if_absent(
            "the drive does not tell its motor's rated torque: describe it by a file of its own (docs/described.md), with a \
             data sheet that lacks this object, or leave `feed_forward` out",
        ));
    }
    identity.extend(pdos.all().into_iter().flat_map(Mapping::identity));
    identity
}

/// Who made it and what it is, where that is stated.
pub(in crate::model) fn maker(assumed: &Assumed) -> impl Iterator<Item = Identity> {
    let stated = [
        (1, "vendor ID", &VENDOR_ID),
        (2, "product code", &PRODUCT_CODE),
    ];
    let stated = stated.map(|(sub, name, it)| Identity::new(0x1018, sub, name, assumed.value(it)));
    stated.into_iter().filter(|it| it.value != 0)
}

pub(in crate::model) fn is_mapped_by_the_maker(assumed: &Assumed) -> bool {
    assumed.value(&FIXED_MAPPING) != 0
}

/// What the T_PDO of a drive that tells its torque says of that.
pub(in crate::model) fn torque(data: &[u8]) -> Option<i16> {
    let &[_, _, _, _, _, _, low, high] = data else {
        return None;
    };
    Some(i16::from_le_bytes([low, high]))
}

/// The COB-ID of a T_PDO that is on. It is not to be asked for by remote requests, which many devices do not know.
pub(in crate::model) fn t_pdo_word(number: u8, node: NodeId) -> u32 {
    CobIdWord::valid(CobId::t_pdo(number, node)).0 | CobIdWord::NO_RTR
}

fn off(word: u32) -> Data {
    Data::u32(word | CobIdWord::INVALID)
}

/// Switches off every T_PDO, of which `used` is one.
pub(in crate::model) fn t_pdos_off(
    model: &'static Model,
    node: NodeId,
    assumed: &Assumed,
    used: u8,
) -> Vec<Write> {
    let reached = number(assumed, &PDOS).max(used);
    let known = (1..=reached).map(|n| {
        let word = off(t_pdo_word(n, node));
        Write::new(parameter(0x1800, n), 1, word)
    });
    known
        .chain(others_off(model, node, 0x1800, reached))
        .collect()
}

/// Switches off the PDOs behind the first `reached` in the block from `first` on that a data sheet has on after power-on.
fn others_off(
    model: &'static Model,
    node: NodeId,
    first: u16,
    reached: u8,
) -> impl Iterator<Item = Write> {
    let rows = model.generic.map_or(&[][..], |_| model.dictionary);
    let behind = first + u16::from(reached)..first + 0x200;
    rows.iter()
        .filter(move |row| behind.contains(&row.address.index) && row.address.sub == 1)
        .filter_map(move |row| {
            let word = match row.preset {
                Preset::Number(word) | Preset::Assumed(word) => word as u32,
                Preset::PlusNode(word) => word as u32 + u32::from(node.get()),
                Preset::Bytes(_) | Preset::Unknown => return None,
            };
            let Address { index, sub } = row.address;
            CobIdWord(word)
                .is_valid()
                .then(|| Write::new(index, sub, off(word)))
        })
}

/// The number of a PDO, 1…4.
pub(in crate::model) fn number(assumed: &Assumed, assumption: &Assumption) -> u8 {
    assumed.value(assumption) as u8
}

/// Every PDO off, of a drive with a data sheet also those that it alone knows; the mode and what is the kind's own; the two that are used mapped, and on.
fn setup(
    model: &'static Model,
    settings: &Settings,
    kind: Kind,
    pdos: &Pdos,
    own: Vec<Write>,
) -> Vec<Write> {
    let (node, assumed) = (settings.node, &settings.assumed);
    let w = Write::new;
    let [r_pdo, t_pdo, has] = [&R_PDO, &T_PDO, &PDOS].map(|pdo| number(assumed, pdo));
    let r_pdo_word = |n| CobIdWord::valid(CobId::r_pdo(n, node)).0;
    let reached = has.max(r_pdo);
    let r_pdos = (1..=reached).map(|n| w(parameter(0x1400, n), 1, off(r_pdo_word(n))));
    let mut setup: Vec<Write> = r_pdos.collect();
    setup.extend(others_off(model, node, 0x1400, reached));
    setup.extend(t_pdos_off(model, node, assumed, t_pdo));
    setup.extend(cia402::FAULT_RESET);
    setup.push(w(0x6060, 0, Data::u8(kind.mode)));
    setup.extend(own);
    setup.extend(&settings.objects);
    setup.extend(pdos.all().into_iter().flat_map(Mapping::writes));
    let (receive, transmit) = (parameter(0x1400, r_pdo), parameter(0x1800, t_pdo));
    setup.push(w(receive, 2, Data::u8(1))); // at every SYNC
    setup.push(w(transmit, 2, Data::u8(settings.sync_divider)));
    setup.push(w(receive, 1, Data::u32(r_pdo_word(r_pdo))));
    setup.push(w(transmit, 1, Data::u32(t_pdo_word(t_pdo, node))));
    setup
}

/// The index of PDO `n`'s object in the block that begins with PDO 1's.
pub(in crate::model) const fn parameter(first: u16, n: u8) -> u16 {
    first + n as u16 - 1
}

/// The cycle, where the drive has an object for it.
pub(in crate::model) fn period(settings: &Settings) -> Vec<Write> {
    let has_period = settings.assumed.value(&HAS_PERIOD) != 0;
    let (mantissa, exponent) = interpolation_period(settings.cycle);
    let period = [
        Write::new(0x60C2, 1, Data::u8(mantissa)),
        Write::new(0x60C2, 2, Data::u8(exponent as u8)),
    ];
    period.into_iter().filter(|_| has_period).collect()
}

/// 60C2h, mantissa and power of ten in seconds: of a whole millisecond -3, which every drive knows,
/// otherwise -4. A cycle of tenths of milliseconds, 25.5 ms at most, fits.
fn interpolation_period(cycle: Duration) -> (u8, i8) {
    let tenths = cycle.as_micros() / 100;
    if tenths.is_multiple_of(10) {
        ((tenths / 10) as u8, -3)
    } else {
        (tenths as u8, -4)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_period_is_a_mantissa_and_a_power_of_ten() {
        for (micros, expected) in [
            (500, (5, -4)),
            (1000, (1, -3)),
            (1500, (15, -4)),
            (2000, (2, -3)),
            (10_000, (10, -3)),
            (19_500, (195, -4)),
            (20_000, (20, -3)),
        ] {
            let cycle = Duration::from_micros(micros);
            assert_eq!(interpolation_period(cycle), expected, "{micros} µs");
        }
    }
}
