//! A simulated Lexium 32M with its CANopen module.
//!
//! ```
//! use syncline_canopen::NodeId;
//! use syncline_drives::bus::{BitRate, SimBus};
//! use syncline_drives::twin::SimulatedDevice;
//! use syncline_drives::twin::lxm32m::{Twin, TwinConfig};
//!
//! let mut bus = SimBus::new(BitRate::from_kbit(1000).ok_or("bit rate")?);
//! let x = bus.attach(Twin::new(TwinConfig {
//!     initial_position: 131_072 * 10,
//!     ..TwinConfig::new(NodeId::new(1).ok_or("node id")?)
//! }));
//! // … bring it up over the bus, then ask what a master cannot know:
//! assert_eq!(bus.node(x).observe().position, 10.0);
//! # Ok::<(), &str>(())
//! ```
//!
//! What the manual tells is modelled as it tells it; line numbers in comments (`lxm32m 1634`) are
//! those of the manual's text. What it leaves open is an option in [`Policies`] or
//! [`TwinConfig`], with a default that is an assumption.
//!
//! The node is Pre-Operational from the origin of time and sends its boot-up then. Time passes
//! inside it whenever it is called; its state is polled every millisecond.
//!
//! In Interpolated Position a setpoint that is put into effect at SYNC *k* is reached at
//! SYNC *k* + 1 by linear interpolation at the position loop's rate: the interpolation delay is
//! one cycle, an assumption.
//!
//! Tests interfere with it as with every device, by a [`Disturbance`]; what this drive alone has is
//! reached through [`Twin::raise`], [`Twin::set_pulse_frequency`], [`Twin::preset_status`] and
//! [`TwinConfig`].
//!
//! [`Disturbance`]: crate::twin::Disturbance

mod application;
mod drive;
mod fault;
mod limits;
mod measured;
mod modes;
mod motion;
mod parameter_sets;
mod policy;
mod rows;
mod signals;
mod state;
mod switches;
mod synchronisation;
mod units;
mod windows;

pub use fault::DriveError;
pub use policy::{Policies, SetpointGap};
pub use rows::storage_only;
pub use switches::Switches;
pub use synchronisation::SyncStatus;

use super::device::{Config, Kind};
use super::node::{Delays, Device, Processor};
use super::servo::axis::ServoAxis;
use super::servo::encoder::EncoderErrors;
use super::servo::firmware::ServoFirmware;
use crate::dictionary::LXM32M;
use drive::Drive;
use syncline_canopen::NodeId;
use syncline_canopen::cia402::{State, Statusword};
use syncline_canopen::dictionary::Dictionary;
use syncline_canopen::node::{Options, ParameterRules};
use syncline_canopen::time::Duration;
use units::INCREMENTS_PER_REVOLUTION;

/// The twin in the registry.
pub(super) static KIND: Kind = Kind {
    name: "lxm32m",
    title: "LXM32M",
    bitrates: &[50_000, 125_000, 250_000, 500_000, 1_000_000], // (1266, 1279)
    dictionary: LXM32M,
    make: |config| Box::new(Twin::new(config.into())),
};

/// What a twin is made of.
#[derive(Clone, Debug)]
pub struct TwinConfig {
    /// Its processor.
    pub processor: Processor,
    /// Where the absolute multi-turn encoder stands, increments (131072 a revolution).
    pub initial_position: i64,
    /// Motor, axis, encoder and gains.
    pub servo: ServoAxis,
    /// The switches along it.
    pub switches: Switches,
    /// What the manual leaves open.
    pub policies: Policies,
    /// Who the drive says it is.
    pub identity: Identity,
}

impl TwinConfig {
    /// The drive with all defaults; delays, oscillator and boot time are assumptions.
    #[must_use]
    pub fn new(node: NodeId) -> Self {
        let delays = Delays {
            t_pdo: Duration::from_micros(30)..Duration::from_micros(90),
            sdo: Duration::from_micros(200)..Duration::from_micros(900),
        };
        Self {
            processor: Processor::new(node, delays, Duration::from_millis(20)),
            initial_position: 0,
            servo: ServoAxis {
                encoder: EncoderErrors {
                    noise: 0.6,
                    ..EncoderErrors::default()
                },
                ..ServoAxis::default()
            },
            switches: Switches::default(),
            policies: Policies::default(),
            identity: Identity::default(),
        }
    }
}

impl From<&Config> for TwinConfig {
    fn from(config: &Config) -> Self {
        let own = Self::new(config.node);
        Self {
            servo: own.servo.configured(config),
            initial_position: (config.position * INCREMENTS_PER_REVOLUTION) as i64,
            switches: Switches {
                along: config.sensors.clone(),
                reference: config.reference_switch.clone(),
                negative_limit: config.limit_switches.as_ref().map(|it| it.start),
                positive_limit: config.limit_switches.as_ref().map(|it| it.end),
                ..own.switches
            },
            policies: match config.tolerant {
                true => Policies::tolerant(),
                false => own.policies,
            },
            processor: own.processor.configured(config),
            ..own
        }
    }
}

/// Objects 1000h, 1008h…100Ah and 1018h. Product code, revision and texts are not in the
/// manual at hand.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Identity {
    /// 1000h (lxm32m 2965).
    pub device_type: u32,
    /// 1018h:1 (lxm32m 3353).
    pub vendor_id: u32,
    /// 1018h:2.
    pub product_code: u32,
    /// 1018h:3.
    pub revision: u32,
    /// 300Dh:3, of the motor's encoder (lxm32m 2373).
    pub encoder_type: u16,
    /// 1008h; padded with spaces to 8 bytes like the next two.
    pub name: String,
    /// 1009h.
    pub hardware: String,
    /// 100Ah.
    pub software: String,
}

impl Default for Identity {
    fn default() -> Self {
        Self {
            device_type: 0x0042_0192,
            vendor_id: 0x0800_005A,
            product_code: 0,
            revision: 0,
            encoder_type: 0,
            name: "LXM32M".into(),
            hardware: String::new(),
            software: "V01.00".into(),
        }
    }
}

/// A Lexium 32M on a bus; see the [module](self).
pub type Twin = Device<Drive>;

impl Device<Drive> {
    /// A drive that has just been powered on, at the origin of time.
    #[must_use]
    pub fn new(config: TwinConfig) -> Self {
        let objects =
            Dictionary::new(LXM32M, config.processor.node).refusing(config.policies.refusals);
        let options = Options {
            parameters: ParameterRules::Lenient {
                // Bit 31 and the identifier (lxm32m 3528-3536, D-05).
                pdo: 0x8000_07FF,
                // The function code (lxm32m 3079-3085, 3228-3236).
                sync_and_emcy: 0x0000_0780,
            },
            dummy_mapping: false,
            block_transfer: false,
            sdo_timeout: None,
            ..Options::default()
        };
        let processor = config.processor.clone();
        let random = processor.random(2);
        let drive = Drive::new(objects, config);
        Self::switched_on(processor, drive, options, random)
    }

    // ---- what a master cannot know ----

    /// State of the drive.
    #[must_use]
    pub fn state(&self) -> State {
        self.firmware.state()
    }

    /// Statusword of the drive.
    #[must_use]
    pub fn statusword(&self) -> Statusword {
        self.firmware.statusword()
    }

    // ---- interference ----

    /// Raises an error, as if the drive's monitoring had found one.
    pub fn raise(&mut self, error: DriveError) {
        self.firmware.raise(error);
    }

    /// Pulses/s at the PTI interface, the reference of Electronic Gear.
    pub fn set_pulse_frequency(&mut self, frequency: f64) {
        self.firmware.pulses.frequency = frequency;
    }

    /// Presets statusword bits 10 and 13, which the manual's examples find set without a cause.
    pub fn preset_status(&mut self, target_reached: bool, x_err: bool) {
        self.firmware.target_reached = target_reached;
        self.firmware.x_err = x_err;
    }
}
