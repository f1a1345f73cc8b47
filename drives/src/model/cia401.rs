//! An I/O node as the profile CiA 401 has it, on CANopen (CiA 301).
//!
//! - R_PDO1 carries digital outputs, R_PDO2 analog ones, both in effect with SYNC, as the setpoints of the axes are;
//!   T_PDO1 carries digital inputs and T_PDO2 analog ones, at every SYNC or when one of them changes. Each has the bytes that the machine uses
//!   and no more, so that a node with less inputs and outputs than the profile names will do, too. What is not used is
//!   left as it is.
//! - Outputs that the machine uses have their safe values as error values, so that the node falls back to them by
//!   itself as soon as it misses the controller's heartbeat.
//! - Digital signals are taken by bytes (6000h, 6200h) or, for nodes that have them so only, by words (6100h, 6300h).

use super::profile::communication;
use super::{
    ANALOG_INPUTS, Address, Assumption, Data, Identity, Increments, Io, IoNode, IoSettings, Make,
    Model, NODES, NodeSpec, RemoteNode, Settings, Write,
};
use crate::dictionary;
use core::time::Duration;
use syncline_canopen::{BIT_RATES, CobId, Frame, pdo::CobIdWord};

/// The I/O node.
pub(super) static CIA401: Model = Model {
    name: "cia401",
    title: "CiA 401",
    maker: None,
    bitrates: BIT_RATES,
    nodes: NODES,
    // It follows any SYNC that its answer fits between.
    cycle_step: Duration::from_micros(1),
    cycles: Duration::from_micros(500)..=Duration::from_secs(1),
    increments_per_revolution: |_| 1,
    positions: Increments::MIN..=Increments::MAX,
    abilities: &[],
    generic: None,
    r_pdo_values: &[],
    assumptions: &[
        &[DIGITAL_WORDS, ANALOG_ERROR_SHIFT],
        &communication::responses(300, 3000),
    ],
    choices: &[],
    dictionary: dictionary::CIA401,
    reserved,
    inputs: &INPUTS,
    outputs: &OUTPUTS,
    analog_inputs: &["AI0", "AI1", "AI2", "AI3"],
    analog_outputs: &["AO0", "AO1", "AO2", "AO3"],
    captures: &[],
    homing_methods: &[],
    torque_limit: None,
    make: Make::Io(|settings| Box::new(Cia401::new(settings))),
};

const INPUTS: [&str; 16] = [
    "DI0", "DI1", "DI2", "DI3", "DI4", "DI5", "DI6", "DI7", "DI8", "DI9", "DI10", "DI11", "DI12",
    "DI13", "DI14", "DI15",
];

const OUTPUTS: [&str; 16] = [
    "DO0", "DO1", "DO2", "DO3", "DO4", "DO5", "DO6", "DO7", "DO8", "DO9", "DO10", "DO11", "DO12",
    "DO13", "DO14", "DO15",
];

const DIGITAL_WORDS: Assumption = Assumption {
    name: "digital_words",
    default: 0,
    allowed: 0..=1,
    meaning: "1: digital signals by words (6100h, 6300h), 0: by bytes (6000h, 6200h)",
};

const ANALOG_ERROR_SHIFT: Assumption = Assumption {
    name: "analog_error_shift",
    default: 0,
    allowed: 0..=16,
    meaning: "bits by which 6444h, of 32 bits, has a value further left than 6411h, of 16",
};

/// Transmission types: at every SYNC, and by the events that the profile defines (CiA 301).
const AT_SYNC: u8 = 1;
const BY_EVENT: u8 = 255;

/// What of an analog input is an event: that it has changed (6421h).
const CHANGED: u8 = 1 << 2;

/// How a node has its digital signals: by bytes or by words.
#[derive(Clone, Copy, Debug)]
struct Width {
    /// Bits of one object.
    bits: u8,
    inputs: u16,
    outputs: u16,
    error_mode: u16,
    error_value: u16,
}

impl Width {
    const BYTES: Self = Self {
        bits: 8,
        inputs: 0x6000,
        outputs: 0x6200,
        error_mode: 0x6206,
        error_value: 0x6207,
    };
    const WORDS: Self = Self {
        bits: 16,
        inputs: 0x6100,
        outputs: 0x6300,
        error_mode: 0x6306,
        error_value: 0x6307,
    };

    /// How many objects hold the signals up to the last one in use.
    fn count(self, used: u32) -> u8 {
        (u32::BITS - used.leading_zeros()).div_ceil(self.bits.into()) as u8
    }

    /// What the object with that subindex holds of `signals`.
    fn part(self, signals: u32, sub: u8) -> Data {
        let part = signals >> (self.bits * (sub - 1));
        match self.bits {
            8 => Data::u8(part as u8),
            _ => Data::u16(part as u16),
        }
    }
}

/// One I/O node.
#[derive(Clone, Debug)]
struct Cia401 {
    spec: NodeSpec,
    /// Digital outputs, as R_PDO1 carries them.
    outputs: u16,
    width: Width,
    /// Analog outputs, as R_PDO2 carries them.
    analog_outputs: [i16; 4],
    /// The places of T_PDO2 and R_PDO2 among its own.
    analog: [usize; 2],
}

impl Cia401 {
    fn new(settings: &Settings) -> Self {
        let assumed = &settings.assumed;
        let width = match assumed.value(&DIGITAL_WORDS) {
            0 => Width::BYTES,
            _ => Width::WORDS,
        };
        let io = &settings.io;
        let bytes = |used| width.count(used) * (width.bits / 8);
        let node = settings.node;
        let t_pdo = (io.inputs != 0).then(|| communication::t_pdo(1, node, bytes(io.inputs)));
        let analog_inputs = analog_input_count(io);
        let t_pdo2 = (analog_inputs > 0).then(|| communication::t_pdo(2, node, 2 * analog_inputs));
        let digital = (io.outputs != 0).then(|| communication::r_pdo(1, node, bytes(io.outputs)));
        let analog = analog_output_count(io);
        let r_pdo2 = (analog > 0).then(|| communication::r_pdo(2, node, 2 * analog));
        let setup = setup(settings, width);
        Self {
            spec: NodeSpec {
                identity: vec![device_type(io)],
                // Last error.
                history: vec![Address::new(0x1003, 1)],
                answers_sync: t_pdo.or(t_pdo2).is_some() && !io.by_event,
                t_pdos: t_pdo.into_iter().chain(t_pdo2).collect(),
                r_pdos: digital.into_iter().chain(r_pdo2).collect(),
                ..NodeSpec::new(&CIA401, settings, setup, |_| false)
            },
            outputs: 0,
            width,
            analog_outputs: [0; 4],
            analog: [t_pdo.is_some().into(), digital.is_some().into()],
        }
    }
}

/// Analog inputs up to the last one in use.
fn analog_input_count(io: &IoSettings) -> u8 {
    (u32::BITS - io.analog_inputs.leading_zeros()) as u8
}

/// Analog outputs up to the last one in use.
fn analog_output_count(io: &IoSettings) -> u8 {
    let places = io.analog_outputs.iter().map(|(place, _)| *place as u8 + 1);
    places.max().unwrap_or_default()
}

/// That it is an I/O node, with that of inputs and outputs which is used (CiA 401).
fn device_type(io: &IoSettings) -> Identity {
    let used = [
        io.inputs != 0,
        io.outputs != 0,
        io.analog_inputs != 0,
        !io.analog_outputs.is_empty(),
    ];
    let used =
        (used.iter().enumerate()).fold(0, |bits, (kind, used)| bits | u32::from(*used) << kind);
    Identity::new(0x1000, 0, "device type", 0x0191 | used << 16).in_bits(0xFFFF | used << 16)
}

/// Turns a PDO off, maps objects of so many bits into it and turns it on. `behind` is written before it is on.
fn pdo(
    (parameter, word): (u16, CobIdWord),
    (index, bits, count): (u16, u8, u8),
    behind: impl IntoIterator<Item = Write>,
) -> Vec<Write> {
    let w = Write::new;
    let mapping = parameter + 0x200;
    let mut writes = vec![
        w(parameter, 1, Data::u32(word.0 | CobIdWord::INVALID)),
        w(mapping, 0, Data::u8(0)),
    ];
    writes.extend((1..=count).map(|sub| {
        let object = u32::from(index) << 16 | u32::from(sub) << 8 | u32::from(bits);
        w(mapping, sub, Data::u32(object))
    }));
    writes.push(w(mapping, 0, Data::u8(count)));
    writes.extend(behind);
    writes.push(w(parameter, 1, Data::u32(word.0)));
    writes
}

/// When a T_PDO of inputs comes.
fn kind_of_t_pdo(parameter: u16, settings: &Settings) -> Vec<Write> {
    let w = Write::new;
    let by_event = settings.io.by_event;
    let mut writes = vec![w(
        parameter,
        2,
        Data::u8(if by_event { BY_EVENT } else { AT_SYNC }),
    )];
    if by_event {
        // At most once in a cycle, and from time to time without a change, should one be lost.
        let cycle = settings
            .cycle
            .as_micros()
            .div_ceil(100)
            .min(u16::MAX.into()) as u16;
        let again = settings.heartbeat.producer.as_millis().min(u16::MAX.into()) as u16;
        writes.push(w(parameter, 3, Data::u16(cycle)));
        writes.push(w(parameter, 5, Data::u16(again)));
    }
    writes
}

/// The PDOs that are used, what outputs do without the controller, heartbeats.
fn setup(settings: &Settings, width: Width) -> Vec<Write> {
    let w = Write::new;
    let (node, io) = (settings.node, &settings.io);
    let mut setup = Vec::new();
    if io.inputs != 0 {
        let word = CobIdWord::valid(CobId::t_pdo(1, node));
        let inputs = (width.inputs, width.bits, width.count(io.inputs));
        setup.extend(pdo((0x1800, word), inputs, kind_of_t_pdo(0x1800, settings)));
    }
    if io.analog_inputs != 0 {
        let word = CobIdWord::valid(CobId::t_pdo(2, node));
        let inputs = (0x6401, 16, analog_input_count(io));
        setup.extend(pdo((0x1801, word), inputs, kind_of_t_pdo(0x1801, settings)));
        if io.by_event {
            for sub in 1..=inputs.2 {
                // Each change of what is used, however small.
                let is_used = io.analog_inputs >> (sub - 1) & 1 != 0;
                setup.push(w(0x6421, sub, Data::u8(if is_used { CHANGED } else { 0 })));
                setup.push(w(0x6426, sub, Data::u32(0)));
            }
            setup.push(w(0x6423, 0, Data::u8(1)));
        }
    }
    if io.outputs != 0 {
        let word = CobIdWord::valid(CobId::r_pdo(1, node));
        let outputs = (width.outputs, width.bits, width.count(io.outputs));
        let kind = [w(0x1400, 2, Data::u8(AT_SYNC))];
        setup.extend(pdo((0x1400, word), outputs, kind));
        for sub in 1..=width.count(io.outputs) {
            setup.push(w(width.error_mode, sub, width.part(io.outputs, sub)));
            setup.push(w(width.error_value, sub, width.part(io.safe, sub)));
        }
    }
    if !io.analog_outputs.is_empty() {
        let word = CobIdWord::valid(CobId::r_pdo(2, node));
        let kind = [w(0x1401, 2, Data::u8(AT_SYNC))];
        setup.extend(pdo(
            (0x1401, word),
            (0x6411, 16, analog_output_count(io)),
            kind,
        ));
    }
    let shift = settings.assumed.value(&ANALOG_ERROR_SHIFT);
    for &(place, safe) in &io.analog_outputs {
        let sub = place as u8 + 1;
        setup.push(w(0x6443, sub, Data::u8(1)));
        setup.push(w(0x6444, sub, Data::i32(i32::from(safe) << shift)));
    }
    setup.extend(&settings.objects);
    setup.extend(communication::heartbeats(&settings.heartbeat));
    setup
}

/// Communication, and what outputs do without the controller.
fn reserved(Address { index, .. }: Address) -> bool {
    matches!(
        index,
        0x1000
            ..=0x1FFF
                | 0x6200
                | 0x6206
                | 0x6207
                | 0x6300
                | 0x6306
                | 0x6307
                | 0x6411
                | 0x6421
                | 0x6423
                | 0x6426
                | 0x6443
                | 0x6444
    )
}

impl RemoteNode for Cia401 {
    fn spec(&self) -> &NodeSpec {
        &self.spec
    }
}

impl Io for Cia401 {
    fn signals(&self, t_pdo: usize, data: &[u8]) -> Option<u32> {
        if t_pdo == self.analog[0] {
            return None;
        }
        let mut inputs = [0; 4];
        let told = data.len().min(2);
        inputs[..told].copy_from_slice(&data[..told]);
        Some(u32::from_le_bytes(inputs))
    }

    fn analog_inputs(&self, t_pdo: usize, data: &[u8]) -> Option<[i16; ANALOG_INPUTS]> {
        let mut inputs = [0; ANALOG_INPUTS];
        for (input, bytes) in inputs.iter_mut().zip(data.chunks_exact(2)) {
            *input = i16::from_le_bytes([bytes[0], bytes[1]]);
        }
        (t_pdo == self.analog[0]).then_some(inputs)
    }

    fn set_outputs(&mut self, on: u32) {
        self.outputs = on as u16;
    }

    fn set_analog_output(&mut self, output: usize, value: i16) {
        if let Some(own) = self.analog_outputs.get_mut(output) {
            *own = value;
        }
    }

    /// The objects that its R_PDOs carry.
    fn write(&self, write: &mut dyn FnMut(Write)) {
        for (place, r_pdo) in self.spec.r_pdos.iter().enumerate() {
            if place == self.analog[1] {
                let values = self
                    .analog_outputs
                    .iter()
                    .take(usize::from(r_pdo.bytes) / 2);
                for (sub, value) in (1..).zip(values) {
                    write(Write::new(0x6411, sub, Data::u16(*value as u16)));
                }
            } else {
                for sub in 1..=r_pdo.bytes / (self.width.bits / 8) {
                    let part = self.width.part(self.outputs.into(), sub);
                    write(Write::new(self.width.outputs, sub, part));
                }
            }
        }
    }
}

impl IoNode for Cia401 {
    fn clone_box(&self) -> Box<dyn IoNode> {
        Box::new(self.clone())
    }

    fn encode(&self, frames: &mut [Frame]) {
        let mut data = [0; 8];
        for (place, r_pdo) in self.spec.r_pdos.iter().enumerate() {
            if place == self.analog[1] {
                for (bytes, value) in data.chunks_exact_mut(2).zip(self.analog_outputs) {
                    bytes.copy_from_slice(&value.to_le_bytes());
                }
            } else {
                data[..2].copy_from_slice(&self.outputs.to_le_bytes());
            }
            frames[place] = Frame::new(r_pdo.cob_id, &data[..r_pdo.bytes.into()]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Assumed;
    use super::*;
    use proptest::prelude::*;
    use syncline_canopen::NodeId;

    fn node(io: IoSettings, assumed: &[(&'static str, u32)]) -> Cia401 {
        let (node, cycle) = (NodeId::new(9).unwrap(), Duration::from_millis(2));
        Cia401::new(&Settings {
            io,
            objects: vec![Write::new(0x6202, 1, Data::u8(5))],
            assumed: Assumed(assumed.to_vec()),
            ..Settings::new(node, cycle)
        })
    }

    fn shown(writes: &[Write]) -> String {
        let shown = writes
            .iter()
            .map(|write| format!("{} = {}", write.address, write.data));
        shown.collect::<Vec<_>>().join(", ")
    }

    fn all() -> IoSettings {
        IoSettings {
            signals: false,
            inputs: 0b10_0000_0001,
            outputs: 0b110,
            safe: 0b100,
            analog_inputs: 0b101,
            analog_outputs: vec![(1, -5)],
            by_event: false,
        }
    }

    #[test]
    fn the_setup_by_bytes_at_sync() {
        assert_eq!(
            shown(&node(all(), &[]).spec.setup),
            "1800h:1 = 80000189h, 1A00h:0 = 00h, 1A00h:1 = 60000108h, 1A00h:2 = 60000208h, 1A00h:0 = 02h, \
             1800h:2 = 01h, 1800h:1 = 00000189h, \
             1801h:1 = 80000289h, 1A01h:0 = 00h, 1A01h:1 = 64010110h, 1A01h:2 = 64010210h, 1A01h:3 = 64010310h, \
             1A01h:0 = 03h, 1801h:2 = 01h, 1801h:1 = 00000289h, \
             1400h:1 = 80000209h, 1600h:0 = 00h, 1600h:1 = 62000108h, 1600h:0 = 01h, 1400h:2 = 01h, \
             1400h:1 = 00000209h, 6206h:1 = 06h, 6207h:1 = 04h, \
             1401h:1 = 80000309h, 1601h:0 = 00h, 1601h:1 = 64110110h, 1601h:2 = 64110210h, 1601h:0 = 02h, \
             1401h:2 = 01h, 1401h:1 = 00000309h, 6443h:2 = 01h, 6444h:2 = FFFFFFFBh, \
             6202h:1 = 05h, 1017h:0 = 0064h, 1016h:1 = 007F00FAh"
        );
    }

    #[test]
    fn the_setup_by_words_by_events() {
        let io = IoSettings {
            by_event: true,
            analog_outputs: Vec::new(),
            ..all()
        };
        assert_eq!(
            shown(&node(io, &[("digital_words", 1)]).spec.setup),
            "1800h:1 = 80000189h, 1A00h:0 = 00h, 1A00h:1 = 61000110h, 1A00h:0 = 01h, 1800h:2 = FFh, \
             1800h:3 = 0014h, 1800h:5 = 0064h, 1800h:1 = 00000189h, \
             1801h:1 = 80000289h, 1A01h:0 = 00h, 1A01h:1 = 64010110h, 1A01h:2 = 64010210h, 1A01h:3 = 64010310h, \
             1A01h:0 = 03h, 1801h:2 = FFh, 1801h:3 = 0014h, 1801h:5 = 0064h, 1801h:1 = 00000289h, \
             6421h:1 = 04h, 6426h:1 = 00000000h, 6421h:2 = 00h, 6426h:2 = 00000000h, 6421h:3 = 04h, 6426h:3 = 00000000h, 6423h:0 = 01h, \
             1400h:1 = 80000209h, 1600h:0 = 00h, 1600h:1 = 63000110h, 1600h:0 = 01h, 1400h:2 = 01h, \
             1400h:1 = 00000209h, 6306h:1 = 0006h, 6307h:1 = 0004h, \
             6202h:1 = 05h, 1017h:0 = 0064h, 1016h:1 = 007F00FAh"
        );
    }

    #[test]
    fn what_is_used_has_to_be_there() {
        let [all, outputs] = [
            all(),
            IoSettings {
                outputs: 1,
                ..IoSettings::default()
            },
        ]
        .map(|io| node(io, &[]).spec.identity[0]);
        assert_eq!((all.mask, all.value), (0x000F_FFFF, 0x000F_0191));
        assert_eq!((outputs.mask, outputs.value), (0x0002_FFFF, 0x0002_0191));
    }

    #[test]
    fn an_error_value_may_stand_further_left() {
        let node = node(all(), &[("analog_error_shift", 16)]);
        assert!(shown(&node.spec.setup).contains("6444h:2 = FFFB0000h"));
    }

    proptest! {
        /// Whatever is used: each PDO is as long as its mapping, outputs are where the mapping has them, inputs are
        /// told as they came.
        #[test]
        fn pdos_carry_what_their_mapping_says(
            inputs in prop_oneof![1 => Just(0), 3 => any::<u16>()],
            outputs: u16,
            set: u16,
            analog in prop::collection::vec((0usize..4, any::<i16>()), 0..4),
            analog_inputs in 0u32..16,
            taken: [i16; 4],
            words: bool,
            by_event: bool,
        ) {
            let io = IoSettings {
                signals: false,
                inputs: inputs.into(),
                outputs: outputs.into(),
                safe: 0,
                analog_inputs,
                analog_outputs: analog.clone(),
                by_event,
            };
            let mut node = node(io, &[("digital_words", words.into())]);
            let bits = |mapping: u16| {
                let mapped = node.spec.setup.iter().filter(|it| it.address.index == mapping && it.address.sub > 0);
                mapped.map(|it| it.data.bits() & 0xFF).sum::<u32>()
            };

            // Whatever comes at every SYNC is awaited there, of either kind.
            prop_assert_eq!(node.spec.answers_sync, inputs.max(analog_inputs as u16) != 0 && !by_event);
            prop_assert_eq!(bits(0x1A00) + bits(0x1A01), node.spec.t_pdos.iter().map(|it| u32::from(it.bytes) * 8).sum::<u32>());
            prop_assert_eq!(bits(0x1600) + bits(0x1601), node.spec.r_pdos.iter().map(|it| u32::from(it.bytes) * 8).sum::<u32>());

            node.set_outputs(set.into());
            for (place, value) in &analog {
                node.set_analog_output(*place, *value);
            }
            let mut frames = vec![Frame::new(CobId::SYNC, &[]); node.spec.r_pdos.len()];
            node.encode(&mut frames);
            for (frame, r_pdo) in frames.iter().zip(&node.spec.r_pdos) {
                prop_assert_eq!(frame.data().len(), usize::from(r_pdo.bytes));
                if r_pdo.cob_id == CobId::r_pdo(1, node.spec.node) {
                    let carried = set.to_le_bytes();
                    prop_assert_eq!(frame.data(), &carried[..frame.data().len()]);
                } else {
                    for (place, value) in node.analog_outputs.iter().enumerate().take(frame.data().len() / 2) {
                        prop_assert_eq!(&frame.data()[2 * place..2 * place + 2], value.to_le_bytes());
                    }
                }
            }
            for (place, t_pdo) in node.spec.t_pdos.iter().enumerate() {
                let digital = t_pdo.cob_id == CobId::t_pdo(1, node.spec.node);
                let data = match digital {
                    true => inputs.to_le_bytes().to_vec(),
                    false => taken.iter().flat_map(|it| it.to_le_bytes()).collect(),
                };
                let data = &data[..t_pdo.bytes.into()];
                prop_assert_eq!(node.signals(place, data), digital.then_some(inputs.into()));
                let told = node.analog_inputs(place, data);
                prop_assert_eq!(told.is_none(), digital);
                for input in (0..4).filter(|input| analog_inputs >> input & 1 != 0) {
                    prop_assert!(told.is_none_or(|told| told[input] == taken[input]));
                }
            }
        }
    }
}
