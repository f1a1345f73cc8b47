//! A simulated absolute rotary encoder as the profile has it: CiA 406 on a CANopen device by CiA 301's strict rules.
//!
//! Its shaft is turned with another device's by [`Ties::follow`](crate::world::Ties::follow), and the position value is taken
//! at the instant of the SYNC, the request or the event that asks for it. Code sequence, scaling and preset make of it what
//! they make in a TWK CRN; nothing is stored.
//!
//! What the profile leaves to a maker is an option in [`TwinConfig`], with a default that is an assumption.

pub(super) mod position;

use super::device::{Config, Disturbance, ErrorClass, Kind};
use super::node::{Delays, Device, Firmware, Processor, Tampering};
use super::servo::shaft::Shaft;
use crate::dictionary::CIA406;
use crate::mechanics::rigid::Rigid;
use position::Measure;
use syncline_canopen::dictionary::{Dictionary, Entry, Row};
use syncline_canopen::emcy::{Emergency, register};
use syncline_canopen::node::{Application, BootUp, Options, Origin};
use syncline_canopen::sdo::AbortCode;
use syncline_canopen::time::Duration;
use syncline_canopen::{Address, BIT_RATES, Instant, NodeId, nmt};

/// The twin in the registry.
pub(super) static KIND: Kind = Kind {
    name: "cia406",
    title: "CiA 406",
    bitrates: BIT_RATES,
    dictionary: CIA406,
    make: |config| Box::new(Twin::new(config.into())),
};

/// EMCY of an error in the hardware (CiA 301).
const HARDWARE: u16 = 0x5000;
/// Bit of 6503h: the position value means nothing.
const POSITION_ERROR: i64 = 1 << 0;

/// What a twin is made of.
#[derive(Clone, Debug)]
pub struct TwinConfig {
    /// Its processor.
    pub processor: Processor,
    /// Where the shaft stands, revolutions from the disc's zero, positive clockwise.
    pub position: f64,
    /// Its object dictionary.
    pub dictionary: &'static [Entry],
    /// What its maker has mapped into its PDOs where the dictionary does not have it.
    pub mapped: Vec<(Address, i64)>,
    /// 1018h:1 and :2, where they are not the dictionary's.
    pub identity: [Option<u32>; 2],
    /// Steps of its disc, 6501h, above zero.
    pub steps_per_turn: u32,
    /// Turns that it tells apart, 6502h, above zero.
    pub turns: u32,
    /// Whether a message says that it has booted.
    pub tells_boot_up: bool,
}

impl TwinConfig {
    /// The encoder with all defaults; disc, delays and boot time are assumptions.
    #[must_use]
    pub fn new(node: NodeId) -> Self {
        let delays = Delays {
            t_pdo: Duration::from_micros(30)..Duration::from_micros(90),
            sdo: Duration::from_micros(200)..Duration::from_micros(900),
        };
        Self {
            processor: Processor::new(node, delays, Duration::from_millis(50)),
            position: 0.0,
            dictionary: CIA406,
            mapped: Vec::new(),
            identity: [None; 2],
            steps_per_turn: 8192,
            turns: 4096,
            tells_boot_up: true,
        }
    }
}

impl From<&Config> for TwinConfig {
    fn from(config: &Config) -> Self {
        let own = Self::new(config.node);
        let number = |name, own| config.assumed(name).unwrap_or(own);
        Self {
            position: config.position,
            dictionary: config.dictionary.unwrap_or(own.dictionary),
            mapped: config.mapped.clone(),
            identity: ["vendor_id", "product_code"].map(|name| config.assumed(name)),
            steps_per_turn: number("steps_per_turn", own.steps_per_turn),
            turns: number("turns", own.turns),
            tells_boot_up: number("has_heartbeat", 1) != 0,
            processor: own.processor.configured(config),
        }
    }
}

/// An encoder on a bus; see the [module](self).
pub type Twin = Device<Encoder>;

impl Device<Encoder> {
    /// An encoder that has just been powered on, at the origin of time.
    #[must_use]
    pub fn new(config: TwinConfig) -> Self {
        let options = Options {
            boot_up: match config.tells_boot_up {
                true => Options::default().boot_up,
                false => BootUp::Silent,
            },
            ..Options::default()
        };
        let random = config.processor.random(0);
        let encoder = Encoder::new(&config);
        Self::switched_on(config.processor, encoder, options, random)
    }
}

/// An encoder without its bus.
pub struct Encoder {
    objects: Dictionary,
    disc: [u32; 2],
    shaft: Shaft,
    /// What the preset adds to the position value.
    offset: u64,
    now: Instant,
    /// The objects do not show the present position yet.
    stale: bool,
    /// It has an error.
    fails: bool,
    untold: Option<Emergency>,
    tampering: Tampering,
}

impl Encoder {
    fn new(config: &TwinConfig) -> Self {
        // Somebody else turns it.
        let mut shaft = Shaft::new(Rigid::default(), config.position);
        shaft.couple(Instant::ZERO);
        let mut encoder = Self {
            objects: Dictionary::new(config.dictionary, config.processor.node),
            disc: [config.steps_per_turn, config.turns],
            shaft,
            offset: 0,
            now: Instant::ZERO,
            stale: true,
            fails: false,
            untold: None,
            tampering: Tampering::default(),
        };
        let [vendor_id, product_code] = config.identity;
        for (address, value) in [
            (Address::new(0x1018, 1), vendor_id),
            (Address::new(0x1018, 2), product_code),
            (Address::new(0x6501, 0), Some(config.steps_per_turn)),
            (Address::new(0x6502, 0), Some(config.turns)),
        ] {
            if let Some(value) = value {
                let tampering = &mut encoder.tampering;
                tampering.preset(&mut encoder.objects, address, value.into());
            }
        }
        for &(address, value) in &config.mapped {
            let tampering = &mut encoder.tampering;
            tampering.preset(&mut encoder.objects, address, value);
        }
        encoder
    }

    /// What makes a position value of the disc's.
    fn measure(&self) -> Measure {
        let [resolution, turns] = self.disc;
        Measure {
            resolution,
            turns,
            ..Measure::of(&self.objects)
        }
    }

    fn publish(&mut self) {
        let measure = self.measure();
        let unshifted = measure.unshifted(self.shaft.position());
        let position = measure.position(unshifted, self.offset);
        let alarms = if self.fails { POSITION_ERROR } else { 0 };
        for (index, value) in [
            (0x1001, i64::from(self.fails)),
            (0x6004, position.into()),
            (0x6500, measure.parameters.into()),
            (0x6503, alarms),
        ] {
            self.objects.put(index, 0, value);
        }
    }

    fn fail(&mut self, fails: bool) {
        if fails != self.fails {
            self.fails = fails;
            self.untold = Some(match fails {
                true => Emergency {
                    code: HARDWARE,
                    register: register::GENERIC,
                    vendor: [0; 5],
                },
                false => Emergency::default(),
            });
        }
    }
}

impl Application for Encoder {
    fn objects(&self) -> &Dictionary {
        &self.objects
    }

    fn objects_mut(&mut self) -> &mut Dictionary {
        &mut self.objects
    }

    fn refresh(&mut self, _: Instant, _: Option<Row>) {
        if core::mem::take(&mut self.stale) {
            self.publish();
        }
    }

    fn check_write(&self, row: Row, value: i64, origin: Origin) -> Result<(), AbortCode> {
        let address = self.objects.entry(row).address;
        self.tampering.check_write(address, origin)?;
        match address.index {
            // Nothing can be measured in steps of which none makes a turn.
            0x6001 | 0x6002 if value == 0 => Err(AbortCode::InvalidValue),
            0x6003 if value as u64 >= self.measure().modulus() => Err(AbortCode::InvalidValue),
            _ => Ok(()),
        }
    }

    /// Another measure deletes the preset; one that is written is the present position from now on.
    fn written(&mut self, _: Instant, row: Row, _: Origin) {
        match self.objects.entry(row).address.index {
            0x6000..=0x6002 => self.offset = 0,
            0x6003 => {
                let preset = self.objects.get(row) as u32;
                let measure = self.measure();
                let unshifted = measure.unshifted(self.shaft.position());
                self.offset = measure.offset(unshifted, preset);
            }
            _ => {}
        }
        self.stale = true;
    }

    fn on_reset(&mut self, _: Instant, _: nmt::Event) {
        self.tampering.show(&mut self.objects);
        self.stale = true;
    }

    fn next_emergency(&mut self) -> Option<Emergency> {
        self.untold.take()
    }
}

impl Firmware for Encoder {
    fn run_until(&mut self, now: Instant) {
        let dt = now.saturating_since(self.now).as_nanos() as f64 * 1e-9;
        self.shaft.step(now, dt, 0.0, true);
        self.now = now;
        self.stale = true;
    }

    fn power_off(&mut self) {
        (self.offset, self.fails, self.untold) = (0, false, None);
    }

    fn shaft(&self) -> Option<&Shaft> {
        Some(&self.shaft)
    }

    fn shaft_mut(&mut self) -> Option<&mut Shaft> {
        Some(&mut self.shaft)
    }

    fn disturb(&mut self, disturbance: Disturbance) {
        match disturbance {
            Disturbance::Fault(class) if class > ErrorClass::Warning => self.fail(true),
            Disturbance::FaultPersists(persists) if !persists => self.fail(false),
            Disturbance::RefuseWrite(address, code) => self.tampering.refuse(address, code),
            Disturbance::AcceptWrites => self.tampering.accept(),
            Disturbance::Vendor(id) => self.tampering.preset_vendor(&mut self.objects, id),
            // It has no power stage, no motor, no other channel and no inputs.
            _ => {}
        }
    }
}
