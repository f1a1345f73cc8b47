//! A simulated servo drive as the profile has it: CiA 402 in Cyclic Synchronous Position or Velocity, in Interpolated
//! Position, in Profile Velocity or in velocity mode.
//!
//! A CANopen device by CiA 301's strict rules: PDOs are mapped while they are switched off. Its one
//! operating mode is 8, or 2, 3, 7 or 9 as [`TwinConfig::mode`] says. While it is enabled, and in mode 7 while controlword bit 4 is
//! set, each SYNC sends its reference in a straight line from where it is to 607Ah, in mode 7 to 60C1h:1, within the
//! period of 60C2h; there it rests until the next one. The loops
//! run on the drive's own oscillator: nothing is locked to SYNC. Statusword bit 12 is set from the
//! first SYNC in Operation Enabled on.
//!
//! In mode 9 each SYNC sends the velocity of the reference so to 60FFh, where it stays; nothing controls the position. In
//! mode 3 its velocity goes to 60FFh with the ramps of 6083h and 6084h, whenever it is written. In mode 2 it goes to 6042h
//! within 6046h with those of 6048h and 6049h, where controlword bits 4 and 5 are set; without bit 6, or with bit 8, to zero.
//! Without bit 4 or 5 it stays. What 6042h counts 604Ch says.
//!
//! A drive that has no 60C2h takes the time between two SYNCs for it.
//!
//! Positions are encoder increments at the motor's shaft (608Fh), without a gear (6091h is 1 : 1). What velocities count
//! [`TwinConfig::velocity_unit`] says.
//! What the profile leaves to a maker is an option in [`Policies`] or [`TwinConfig`], with a default
//! that is an assumption.
//!
//! Tests interfere with it as with every device, by a [`Disturbance`]; what this one alone has is
//! reached through [`Twin::preset`], [`Twin::raise`] and [`TwinConfig`].
//!
//! [`Disturbance`]: crate::twin::Disturbance

mod application;
mod drive;
mod fault;
mod policy;
mod settings;

pub use fault::DriveError;
pub use policy::Policies;

use super::device::{Config, Kind, Ripple};
use super::node::{Delays, Device, Processor};
use super::servo::axis::ServoAxis;
use super::servo::cascade::Gains;
use super::servo::encoder::EncoderErrors;
use super::servo::firmware::ServoFirmware;
use crate::dictionary::{CIA402_CSP, CIA402_CSV, CIA402_PV, CIA402_VL};
use drive::Drive;
use syncline_canopen::cia402::{State, Statusword};
use syncline_canopen::dictionary::{Dictionary, Entry};
use syncline_canopen::node::{BootUp, Options};
use syncline_canopen::time::Duration;
use syncline_canopen::{Address, BIT_RATES, NodeId};

/// The twin in the registry.
pub(super) static KIND: Kind = Kind {
    name: "cia402_csp",
    title: "CiA 402 CSP",
    bitrates: BIT_RATES,
    dictionary: CIA402_CSP,
    make: |config| {
        Box::new(Twin::new(TwinConfig::in_mode(
            CYCLIC_SYNCHRONOUS_POSITION,
            CIA402_CSP,
            config,
        )))
    },
};

/// The same in Cyclic Synchronous Velocity.
pub(super) static CSV_KIND: Kind = Kind {
    name: "cia402_csv",
    title: "CiA 402 CSV",
    dictionary: CIA402_CSV,
    make: |config| {
        Box::new(Twin::new(TwinConfig::in_mode(
            CYCLIC_SYNCHRONOUS_VELOCITY,
            CIA402_CSV,
            config,
        )))
    },
    ..KIND
};

/// The same in Profile Velocity.
pub(super) static PV_KIND: Kind = Kind {
    name: "cia402_pv",
    title: "CiA 402 PV",
    dictionary: CIA402_PV,
    make: |config| {
        Box::new(Twin::new(TwinConfig::in_mode(
            PROFILE_VELOCITY,
            CIA402_PV,
            config,
        )))
    },
    ..KIND
};

/// The same in velocity mode.
pub(super) static VL_KIND: Kind = Kind {
    name: "cia402_vl",
    title: "CiA 402 VL",
    dictionary: CIA402_VL,
    make: |config| Box::new(Twin::new(TwinConfig::in_mode(VELOCITY, CIA402_VL, config))),
    ..KIND
};

/// 6060h: velocity mode.
const VELOCITY: i64 = 2;
/// 6060h: Profile Velocity.
const PROFILE_VELOCITY: i64 = 3;

/// 6060h: Interpolated Position.
const INTERPOLATED_POSITION: i64 = 7;
/// 6060h: Cyclic Synchronous Position.
const CYCLIC_SYNCHRONOUS_POSITION: i64 = 8;
/// 6060h: Cyclic Synchronous Velocity.
const CYCLIC_SYNCHRONOUS_VELOCITY: i64 = 9;

/// What a twin is made of.
#[derive(Clone, Debug)]
pub struct TwinConfig {
    /// Its processor.
    pub processor: Processor,
    /// Where the shaft stands, revolutions from the encoder's zero.
    pub position: f64,
    /// Its object dictionary. What the loops go by and it does not have is as in [`CIA402_CSP`].
    pub dictionary: &'static [Entry],
    /// What its maker has mapped into its PDOs where the dictionary does not have it.
    pub mapped: Vec<(Address, i64)>,
    /// 1018h:1 and :2, where they are not the dictionary's.
    pub identity: [Option<u32>; 2],
    /// Its operating mode: 2, 3, 7, 8 or 9.
    pub mode: u32,
    /// What 60FFh and 606Ch count, and 6083h and 6084h in a second: so many units at so many revolutions a minute.
    /// `None`: increments/s, in velocity mode 1/min.
    pub velocity_unit: Option<[u32; 2]>,
    /// Encoder increments per motor revolution: 608Fh:1.
    pub encoder_increments: u32,
    /// It says that it has booted; one without a heartbeat does not.
    pub tells_boot_up: bool,
    /// How unevenly it turns in Profile Velocity.
    pub ripple: Option<Ripple>,
    /// Motor, axis, encoder and gains.
    pub servo: ServoAxis,
    /// What the profile leaves open.
    pub policies: Policies,
}

impl TwinConfig {
    /// The drive with all defaults; resolution, noise, delays, oscillator and boot time are
    /// assumptions.
    #[must_use]
    pub fn new(node: NodeId) -> Self {
        let delays = Delays {
            t_pdo: Duration::from_micros(30)..Duration::from_micros(90),
            sdo: Duration::from_micros(200)..Duration::from_micros(900),
        };
        Self {
            processor: Processor::new(node, delays, Duration::from_millis(20)),
            position: 0.0,
            dictionary: CIA402_CSP,
            mapped: Vec::new(),
            identity: [None; 2],
            mode: CYCLIC_SYNCHRONOUS_POSITION as u32,
            velocity_unit: None,
            encoder_increments: 1_048_576,
            tells_boot_up: true,
            ripple: None,
            servo: ServoAxis {
                encoder: EncoderErrors {
                    noise: 2.0,
                    ..EncoderErrors::default()
                },
                gains: Gains {
                    velocity_feed_forward: 1.0,
                    ..Gains::default()
                },
                ..ServoAxis::default()
            },
            policies: Policies::default(),
        }
    }
}

impl TwinConfig {
    /// As it was asked for, in that mode and with that dictionary unless another one was.
    fn in_mode(mode: i64, dictionary: &'static [Entry], config: &Config) -> Self {
        let own = Self::new(config.node);
        Self {
            servo: own.servo.configured(config),
            ripple: config.ripple,
            position: config.position,
            encoder_increments: config
                .assumed("encoder_increments")
                .unwrap_or(own.encoder_increments),
            tells_boot_up: config.assumed("has_heartbeat") != Some(0),
            dictionary: config.dictionary.unwrap_or(dictionary),
            mapped: config.mapped.clone(),
            identity: ["vendor_id", "product_code"].map(|name| config.assumed(name)),
            mode: config.assumed("mode").unwrap_or(mode as u32),
            velocity_unit: config
                .assumed("velocity_units")
                .filter(|units| *units != 0)
                .map(|units| [units, config.assumed("velocity_rpm").unwrap_or(1)]),
            policies: Policies {
                tells_following: config.assumed("tells_following") != Some(0),
                interpolates: config.assumed("interpolates") != Some(0),
                has_dimension_factor: config.assumed("has_dimension_factor") != Some(0),
                ..match config.tolerant {
                    true => Policies::tolerant(),
                    false => own.policies,
                }
            },
            processor: own.processor.configured(config),
        }
    }
}

/// A drive on a bus; see the [module](self).
pub type Twin = Device<Drive>;

impl Device<Drive> {
    /// A drive that has just been powered on, at the origin of time.
    #[must_use]
    pub fn new(config: TwinConfig) -> Self {
        let objects = Dictionary::new(config.dictionary, config.processor.node);
        let options = Options {
            boot_up: match config.tells_boot_up {
                true => Options::default().boot_up,
                false => BootUp::Silent,
            },
            ..Options::default()
        };
        let processor = config.processor.clone();
        let random = processor.random(2);
        let drive = Drive::new(objects, config);
        Self::switched_on(processor, drive, options, random)
    }

    /// State of the drive.
    #[must_use]
    pub fn state(&self) -> State {
        self.firmware.servo.state
    }

    /// Statusword of the drive.
    #[must_use]
    pub fn statusword(&self) -> Statusword {
        self.firmware.statusword()
    }

    /// Gives an object another value than the table's, now and after each reset: as another maker's
    /// drive may have it.
    pub fn preset(&mut self, address: Address, value: i64) {
        self.firmware.preset(address, value);
    }

    /// Raises an error, as if the drive's monitoring had found one.
    pub fn raise(&mut self, error: DriveError) {
        self.firmware.raise(error);
    }
}
