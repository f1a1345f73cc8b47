//! A simulated absolute encoder TWK CRN with its CANopen interface.
//!
//! ```
//! use syncline_canopen::NodeId;
//! use syncline_drives::bus::{BitRate, SimBus};
//! use syncline_drives::twin::SimulatedDevice;
//! use syncline_drives::twin::twk_crn::{Twin, TwinConfig};
//!
//! let mut bus = SimBus::new(BitRate::from_kbit(1000).ok_or("bit rate")?);
//! let beam = bus.attach(Twin::new(TwinConfig {
//!     position: 10.5,
//!     ..TwinConfig::new(NodeId::new(5).ok_or("node id")?)
//! }));
//! // … bring it up over the bus, and turn its shaft meanwhile:
//! bus.node_mut(beam).turn(2.0);
//! # Ok::<(), &str>(())
//! ```
//!
//! What the manual tells is modelled as it tells it; `crn S12` in comments is the snippet of the
//! manual's text that begins with 12. What it leaves open is an option in [`Policies`] or
//! [`TwinConfig`], with a default that is an assumption.
//!
//! It has no loop of its own: its shaft is turned by [`Twin::turn`], or with another device's by
//! [`Ties::follow`](crate::world::Ties::follow), and the position is taken at the instant of the
//! SYNC, the request or the event that asks for it.
//!
//! An encoder whose bit rate is not that of its bus hears nothing and says nothing there. A real
//! one would disturb the others as well.

mod application;
mod encoder;
mod fault;
mod policy;

pub use fault::EncoderError;
pub use policy::{Policies, Texts};

use super::device::{Config, Kind};
use super::node::{Delays, Device, Processor};

use crate::bus::BitRate;
use crate::dictionary::{TWK_CRN_4096, TWK_CRN_8192};
use crate::mechanics::Motion;
use encoder::{BIT_RATES, Encoder};
use syncline_canopen::NodeId;
use syncline_canopen::dictionary::Dictionary;
use syncline_canopen::node::{Options, ParameterRules};
use syncline_canopen::time::Duration;

/// The twin in the registry.
pub(super) static KIND: Kind = Kind {
    name: "twk_crn",
    title: "TWK CRN",
    bitrates: &BIT_RATES,
    dictionary: TWK_CRN_8192,
    make: |config| Box::new(Twin::new(config.into())),
};

/// How many steps the disc has (crn S37, S6, S9).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resolution {
    /// 4096 steps per turn, 24 bits in all.
    Steps4096,
    /// 8192 steps per turn, 25 bits in all: that in which the printed work area lies.
    Steps8192,
}

/// How it is connected (crn S35, S15).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Version {
    /// By a plug: node id and bit rate are objects 2000h and 2001h.
    Plug,
    /// By a cap with switches for node id and bit rate.
    ConnectingCap,
}

/// What whoever puts it on a bus has set beforehand, by switches or by objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Commissioned {
    /// Number of the bit rate: 0 is 20 kbit/s, 1 is 125, 2 is 500, 3 is 1000 (crn S35, S15, S26).
    pub bit_rate: u8,
    /// The bus's own rate; `None` is whatever the encoder has.
    pub bus: Option<BitRate>,
}

/// What a twin is made of.
#[derive(Clone, Debug)]
pub struct TwinConfig {
    /// Its processor; the node id is 1…64.
    pub processor: Processor,
    /// Where the shaft stands, revolutions from the disc's zero, positive clockwise.
    pub position: f64,
    /// Its disc.
    pub resolution: Resolution,
    /// Its connection.
    pub version: Version,
    /// Its bit rate, and that of its bus.
    pub commissioned: Commissioned,
    /// What the manual leaves open.
    pub policies: Policies,
}

impl TwinConfig {
    /// As delivered (crn S15), but for the node id and on a bus of its own rate; delays and boot
    /// time are assumptions.
    #[must_use]
    pub fn new(node: NodeId) -> Self {
        let delays = Delays {
            t_pdo: Duration::from_micros(100)..Duration::from_micros(300),
            sdo: Duration::from_micros(500)..Duration::from_micros(3000),
        };
        Self {
            processor: Processor::new(node, delays, Duration::from_millis(200)),
            position: 0.0,
            resolution: Resolution::Steps8192,
            version: Version::Plug,
            commissioned: Commissioned {
                bit_rate: 0,
                bus: None,
            },
            policies: Policies::default(),
        }
    }
}

/// On a bus with a known rate it has been set to that, if it has it.
impl From<&Config> for TwinConfig {
    fn from(config: &Config) -> Self {
        let own = Self::new(config.node);
        let is_of_bus =
            |rate: &u32| (config.bit_rate).is_some_and(|bus| bus.kbit() * 1000 == *rate);
        Self {
            position: config.position,
            resolution: match config.assumed("steps_per_turn") {
                Some(0x1000) => Resolution::Steps4096,
                _ => own.resolution,
            },
            commissioned: Commissioned {
                bit_rate: BIT_RATES.iter().position(is_of_bus).unwrap_or(0) as u8,
                bus: config.bit_rate,
            },
            processor: own.processor.configured(config),
            ..own
        }
    }
}

/// A TWK CRN on a bus; see the [module](self).
pub type Twin = Device<Encoder>;

impl Device<Encoder> {
    /// An encoder that has just been powered on, at the origin of time.
    #[must_use]
    pub fn new(config: TwinConfig) -> Self {
        let table = match config.resolution {
            Resolution::Steps4096 => TWK_CRN_4096,
            Resolution::Steps8192 => TWK_CRN_8192,
        };
        let objects = Dictionary::new(table, config.processor.node);
        let policies = config.policies;
        let options = Options {
            parameters: ParameterRules::Lenient {
                // Bit 31 and the identifier (crn S24, S39).
                pdo: 0x8000_07FF,
                // Of SYNC bits 31 and 30 as well (crn S44).
                sync_and_emcy: 0xC000_07FF,
            },
            dummy_mapping: false,
            block_transfer: false,
            sdo_echo: policies.sdo_echo,
            boot_up: policies.boot_up,
            life_guarding: policies.life_guarding,
            // Crn S44, S29, S18.
            identifiers_at_reset: true,
            sync_by_bit_31: policies.sync_by_bit_31,
            // Crn S44, S13.
            cycle_period_unit: Duration::from_millis(1),
            // Crn S31.
            event_timer: Some(0x6200),
            ..Options::default()
        };
        let random = config.processor.random(0);
        let encoder = Encoder::new(objects, &config);
        Self::switched_on(config.processor, encoder, options, random)
    }

    /// The bit rate at which it listens and sends.
    #[must_use]
    pub fn bit_rate(&self) -> Option<BitRate> {
        self.firmware.bit_rate()
    }

    // ---- interference ----

    /// Puts it on a bus of another rate.
    pub fn connect(&mut self, bus: BitRate) {
        self.firmware.commissioned.bus = Some(bus);
    }

    /// Turns the shaft from where it is at `velocity` rev/s, clockwise if positive, until told
    /// otherwise.
    pub fn turn(&mut self, velocity: f64) {
        self.move_shaft(self.firmware.shaft.position(), velocity);
    }

    /// Puts the shaft at so many revolutions, at rest.
    pub fn stand_at(&mut self, position: f64) {
        self.move_shaft(position, 0.0);
    }

    fn move_shaft(&mut self, position: f64, velocity: f64) {
        let motion = Motion {
            position,
            velocity,
            acceleration: 0.0,
        };
        let encoder = &mut self.firmware;
        encoder.shaft.moved(encoder.now, motion);
    }

    /// The cause of an error is there from now on, or gone.
    pub fn set_error(&mut self, error: EncoderError, is_there: bool) {
        self.firmware.errors.set(error, is_there);
    }
}
