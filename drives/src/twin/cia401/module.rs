//! Inputs and outputs behind the CANopen node, and the objects between them.

use crate::twin::device::Course;
use crate::twin::node::Tampering;
use syncline_canopen::Instant;
use syncline_canopen::dictionary::{Dictionary, Row};
use syncline_canopen::emcy::{self, Emergency, register};

/// Analog inputs, and as many outputs.
pub(super) const ANALOG: usize = 4;

/// Objects of digital signals by bytes, each with the one that has the same signals by words.
const TWICE: [(u16, u16); 10] = [
    (0x6000, 0x6100),
    (0x6002, 0x6102),
    (0x6006, 0x6106),
    (0x6007, 0x6107),
    (0x6008, 0x6108),
    (0x6200, 0x6300),
    (0x6202, 0x6302),
    (0x6206, 0x6306),
    (0x6207, 0x6307),
    (0x6208, 0x6308),
];

/// An error of the module, as EMCY tells it: a short circuit at its outputs (CiA 401).
const SHORT_CIRCUIT: u16 = 0x2320;

/// What an analog input has to do to be told (6421h).
const ABOVE_LIMIT: i64 = 1 << 0;
const BELOW_LIMIT: i64 = 1 << 1;
const CHANGED: i64 = 1 << 2;
const FELL: i64 = 1 << 3;
const ROSE: i64 = 1 << 4;

/// Inputs that are to be told.
#[derive(Clone, Copy, Debug, Default)]
struct Events {
    /// One bit each.
    digital: u16,
    /// One bit each.
    analog: u8,
}

/// The module without its bus.
pub struct Module {
    pub(super) objects: Dictionary,
    pub(super) tampering: Tampering,
    /// Levels at the digital inputs.
    inputs: u16,
    /// Values at the analog inputs.
    analog_inputs: [i16; ANALOG],
    /// What they are over time, some of them.
    courses: Vec<(u8, Course)>,
    /// What the inputs were when they were last looked at.
    seen: u16,
    analog_seen: [i16; ANALOG],
    /// What was last told of the analog inputs.
    told: [i16; ANALOG],
    /// What has happened since events were last asked for, and what had before.
    pending: Events,
    events: Events,
    /// The analog inputs of which events were told, one bit each.
    sources: u8,
    pub(super) outputs: u16,
    analog_outputs: [i16; ANALOG],
    /// The device has an error.
    failed: bool,
    emergencies: Vec<Emergency>,
}

impl Module {
    pub(super) fn new(objects: Dictionary, courses: Vec<(u8, Course)>) -> Self {
        Self {
            objects,
            courses,
            tampering: Tampering::default(),
            inputs: 0,
            analog_inputs: [0; ANALOG],
            seen: 0,
            analog_seen: [0; ANALOG],
            told: [0; ANALOG],
            pending: Events::default(),
            events: Events::default(),
            sources: 0,
            outputs: 0,
            analog_outputs: [0; ANALOG],
            failed: false,
            emergencies: Vec::new(),
        }
    }

    fn value(&self, index: u16, sub: usize) -> i64 {
        self.objects.value(index, sub as u8).unwrap_or_default()
    }

    /// The signals of an object by words.
    fn word(&self, index: u16) -> u16 {
        self.value(index, 1) as u16
    }

    // ---- what is wired to it ----

    pub(super) fn set_input(&mut self, input: u8, level: bool) {
        if let Some(bit) = 1u16.checked_shl(input.into()) {
            self.inputs = self.inputs & !bit | if level { bit } else { 0 };
        }
    }

    pub(super) fn set_analog_input(&mut self, input: u8, value: i16) {
        if let Some(own) = self.analog_inputs.get_mut(usize::from(input)) {
            *own = value;
        }
    }

    /// Analog inputs that are wired to something become what that is.
    pub(super) fn advance(&mut self, now: Instant) {
        let seconds = now.as_nanos() as f64 * 1e-9;
        for (input, course) in &self.courses {
            let own = self.analog_inputs.get_mut(usize::from(*input));
            if let (Some(own), Some(value)) = (own, course.at(seconds)) {
                *own = libm::round(value) as i16;
            }
        }
    }

    pub(super) fn analog_outputs(&self) -> [i16; ANALOG] {
        self.analog_outputs
    }

    // ---- inputs ----

    /// Brings the objects of the inputs up to date.
    pub(super) fn publish(&mut self) {
        let inputs = self.inputs ^ self.word(0x6102);
        self.put_word(0x6100, inputs);
        for (place, value) in self.analog_inputs.into_iter().enumerate() {
            self.objects.put(0x6401, place as u8 + 1, value.into());
        }
        self.look(inputs);
    }

    /// Finds what is to be told of the inputs.
    fn look(&mut self, inputs: u16) {
        let changed = inputs ^ core::mem::replace(&mut self.seen, inputs);
        let told = self.word(0x6106) | inputs & self.word(0x6107) | !inputs & self.word(0x6108);
        if self.value(0x6005, 0) != 0 {
            self.pending.digital |= changed & told;
        }
        let tells = self.value(0x6423, 0) != 0;
        for place in 0..ANALOG {
            let value = self.analog_inputs[place];
            let moved = core::mem::replace(&mut self.analog_seen[place], value) != value;
            if tells && moved && self.analog_event(place, value) {
                self.told[place] = value;
                self.pending.analog |= 1 << place;
            }
        }
    }

    /// Whether a change of an analog input to `value` is an event (6421h, 6424h to 6428h). *Assumed*: beyond a limit
    /// each change is one, and deltas count from what was told last.
    fn analog_event(&self, place: usize, value: i16) -> bool {
        let of = |index| self.value(index, place + 1);
        let triggers = of(0x6421);
        let value = i64::from(value);
        let rise = value - i64::from(self.told[place]);
        let is = |trigger| triggers & trigger != 0;
        is(ABOVE_LIMIT) && value >= of(0x6424)
            || is(BELOW_LIMIT) && value < of(0x6425)
            || is(CHANGED) && rise.abs() > of(0x6426)
            || is(FELL) && -rise > of(0x6427)
            || is(ROSE) && rise > of(0x6428)
    }

    /// What has happened up to now is told from now on; one of the objects that it happened to.
    pub(super) fn next_event(&mut self) -> Option<Row> {
        self.publish();
        self.events = core::mem::take(&mut self.pending);
        let Events { digital, analog } = self.events;
        self.sources |= analog;
        let digital = (digital != 0).then_some((0x6000, if digital & 0xFF != 0 { 1 } else { 2 }));
        let analog = (analog != 0).then_some((0x6401, analog.trailing_zeros() as u8 + 1));
        let (index, sub) = digital.or(analog)?;
        self.objects.row(index, sub)
    }

    /// Which mapped objects of a T_PDO are to be told of.
    pub(super) fn event_mask(&self, number: u16) -> u64 {
        let mapping = 0x1A00 + number - 1;
        let mut mask = 0;
        for place in 0..self.value(mapping, 0) {
            let object = self.value(mapping, place as usize + 1);
            let (index, sub) = (object >> 16 & 0xFFFF, object >> 8 & 0xFF);
            let Events { digital, analog } = self.events;
            let happened = match (index, sub) {
                (0x6000, 1) => digital & 0xFF != 0,
                (0x6000, 2) => digital >> 8 != 0,
                (0x6100, 1) => digital != 0,
                (0x6401, 1..=4) => analog >> (sub - 1) & 1 != 0,
                // What is no input is told as it changes.
                _ => true,
            };
            mask |= u64::from(happened) << place;
        }
        mask
    }

    /// 6422h is about to be read, and tells what has happened since it last was.
    pub(super) fn show_sources(&mut self) {
        let sources = core::mem::take(&mut self.sources);
        self.objects.put(0x6422, 1, sources.into());
    }

    // ---- outputs ----

    /// An object has been written.
    pub(super) fn written(&mut self, row: Row) {
        let address = self.objects.entry(row).address;
        for (bytes, words) in TWICE {
            if address.index == bytes {
                let [low, high] = [1, 2].map(|sub| self.value(bytes, sub) as u8);
                self.objects
                    .put(words, 1, u16::from_le_bytes([low, high]).into());
            } else if address.index == words {
                self.put_word(words, self.word(words));
            }
        }
        match address.index {
            0x6200 | 0x6202 | 0x6208 | 0x6300 | 0x6302 | 0x6308 => self.put_out(),
            0x6411 => self.put_out_analog(address.sub.into()),
            _ => {}
        }
    }

    /// Puts signals into their object by words and into the one by bytes.
    fn put_word(&mut self, words: u16, signals: u16) {
        self.objects.put(words, 1, signals.into());
        if let Some((bytes, _)) = TWICE.into_iter().find(|twice| twice.1 == words) {
            for (place, byte) in signals.to_le_bytes().into_iter().enumerate() {
                self.objects.put(bytes, place as u8 + 1, byte.into());
            }
        }
    }

    /// Digital outputs take what was written, those that the filter lets through; none while the device has an
    /// error.
    fn put_out(&mut self) {
        if self.failed {
            return;
        }
        let filter = self.word(0x6308);
        let written = self.word(0x6300) ^ self.word(0x6302);
        self.outputs = self.outputs & !filter | written & filter;
    }

    /// The same of an analog output, by its subindex.
    fn put_out_analog(&mut self, sub: usize) {
        if let 1..=ANALOG = sub
            && !self.failed
        {
            self.analog_outputs[sub - 1] = self.value(0x6411, sub) as i16;
        }
    }

    /// Outputs take their error values, those whose error mode says so; the others stay as they are.
    pub(super) fn fall_back(&mut self) {
        let mode = self.word(0x6306);
        let value = self.word(0x6307) ^ self.word(0x6302);
        self.outputs = self.outputs & !mode | value & mode;
        for place in 0..ANALOG {
            if self.value(0x6443, place + 1) == 1 {
                let value = self.value(0x6444, place + 1);
                let range = i64::from(i16::MIN)..=i64::from(i16::MAX);
                self.analog_outputs[place] = value.clamp(*range.start(), *range.end()) as i16;
            }
        }
    }

    /// The supply has failed: nothing puts anything out.
    pub(super) fn power_off(&mut self) {
        self.outputs = 0;
        self.analog_outputs = [0; ANALOG];
        self.failed = false;
        self.emergencies.clear();
    }

    // ---- errors ----

    /// The device has an error from now on, or no longer.
    pub(super) fn fail(&mut self, failed: bool) {
        if core::mem::replace(&mut self.failed, failed) == failed {
            return;
        }
        match failed {
            true => self.fall_back(),
            false => {
                self.put_out();
                (1..=ANALOG).for_each(|sub| self.put_out_analog(sub));
            }
        }
        let (code, register) = match failed {
            true => (SHORT_CIRCUIT, register::GENERIC | register::CURRENT),
            false => (emcy::code::NO_ERROR, 0),
        };
        self.emergencies.push(Emergency {
            code,
            register,
            vendor: [0; 5],
        });
    }

    pub(super) fn next_emergency(&mut self) -> Option<Emergency> {
        (!self.emergencies.is_empty()).then(|| self.emergencies.remove(0))
    }
}
