//! A simulated Twin Line positioning controller TLC53x with its CANopen module.
//!
//! ```
//! use syncline_canopen::NodeId;
//! use syncline_drives::bus::{BitRate, SimBus};
//! use syncline_drives::twin::SimulatedDevice;
//! use syncline_drives::twin::tlc5xx::{Twin, TwinConfig};
//!
//! let mut bus = SimBus::new(BitRate::from_kbit(500).ok_or("bit rate")?);
//! let y = bus.attach(Twin::new(TwinConfig {
//!     position: 10.0,
//!     ..TwinConfig::new(NodeId::new(2).ok_or("node id")?)
//! })?);
//! // … bring it up over the bus, then ask what a master cannot know:
//! assert_eq!(bus.node(y).observe().position, 10.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! What the manual tells is modelled as it tells it; numbers in comments (`3493`) are lines of its
//! text, D-02 and the like the doubts listed in `docs/tlc5xx.md`. What it leaves open is an option in
//! [`Policies`] or [`TwinConfig`], with a default that is an assumption.
//!
//! It takes no interpolated positions: its movements are those of its own profile generator, to a
//! position or with a velocity, started at once or at a SYNC as the transmission type of the R_PDO
//! says.

mod application;
mod drive;
mod fault;
mod modes;
mod motion;
mod policy;
mod settings;
mod signals;
mod state;

pub use fault::DriveError;
pub use policy::{Bit6, Bit9, FaultBits, OffsetSpeed, Policies, PositionFactor};
pub use signals::Switches;

use super::device::{Config, Kind};
use super::node::{Delays, Device, Processor};
use super::servo::axis::ServoAxis;
use super::servo::firmware::ServoFirmware;
use crate::dictionary::TLC5XX;
use drive::Drive;
use syncline_canopen::NodeId;
use syncline_canopen::cia402::{State, Statusword};
use syncline_canopen::dictionary::Dictionary;
use syncline_canopen::node::{Options, ParameterRules};
use syncline_canopen::time::Duration;
use thiserror::Error;

/// The twin in the registry. The manual prints the factory's 125 kbit/s (2353), and 100 kbit/s and
/// 1 Mbit/s as values for cables (2444); which others there are is assumed.
pub(super) static KIND: Kind = Kind {
    name: "tlc5xx",
    title: "Twin Line TLC53x",
    bitrates: &[100_000, 125_000, 250_000, 500_000, 1_000_000],
    dictionary: TLC5XX,
    make: |config| Box::new(Twin::with_can_open(config.into())),
};

/// What the module speaks (2378-2387).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Profile {
    /// Inputs MODE1 = 1 and MODE2 = 0, or parameter 24:23 = 1.
    CanOpen,
    /// Inputs 0 and 0, or parameter 24:23 = 0.
    SigPositec,
}

/// The module is set to the maker's own fieldbus profile.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error(
    "the SIG Positec profile has an online command layer of its own and another manual, and one bus \
     segment carries one profile only: set MODE1 = 1, MODE2 = 0 or M4.profilCan = 1 for CANopen"
)]
pub struct SigProfileError;

/// What a twin is made of.
#[derive(Clone, Debug)]
pub struct TwinConfig {
    /// Its processor.
    pub processor: Processor,
    /// What the module speaks.
    pub profile: Profile,
    /// Where the shaft stands, revolutions from the encoder's zero.
    pub position: f64,
    /// Motor, axis, encoder and gains. 60FBh keeps what is written to it: its scales are doubtful (D-30).
    pub servo: ServoAxis,
    /// The switches along it.
    pub switches: Switches,
    /// What the manual leaves open.
    pub policies: Policies,
}

impl TwinConfig {
    /// The controller with all defaults; delays, oscillator and boot time are assumptions.
    #[must_use]
    pub fn new(node: NodeId) -> Self {
        let delays = Delays {
            t_pdo: Duration::from_micros(200)..Duration::from_micros(600),
            sdo: Duration::from_micros(1000)..Duration::from_micros(4000),
        };
        Self {
            processor: Processor::new(node, delays, Duration::from_millis(50)),
            profile: Profile::CanOpen,
            position: 0.0,
            servo: ServoAxis::default(),
            switches: Switches::default(),
            policies: Policies::default(),
        }
    }
}

impl From<&Config> for TwinConfig {
    fn from(config: &Config) -> Self {
        let own = Self::new(config.node);
        Self {
            servo: own.servo.configured(config),
            position: config.position,
            processor: own.processor.configured(config),
            policies: own.policies.assumed(config),
            ..own
        }
    }
}

/// A TLC53x on a bus; see the [module](self).
pub type Twin = Device<Drive>;

impl Device<Drive> {
    /// A controller that has just been powered on, at the origin of time.
    ///
    /// # Errors
    /// If its module is set to the SIG Positec profile.
    pub fn new(config: TwinConfig) -> Result<Self, SigProfileError> {
        match config.profile {
            Profile::CanOpen => Ok(Self::with_can_open(config)),
            Profile::SigPositec => Err(SigProfileError),
        }
    }

    fn with_can_open(config: TwinConfig) -> Self {
        let objects = Dictionary::new(TLC5XX, config.processor.node);
        let options = Options {
            parameters: ParameterRules::Lenient {
                // Bit 31 and the function code (7659-7681).
                pdo: 0x8000_0780,
                // The function code (7015, 7323).
                sync_and_emcy: 0x0000_0780,
            },
            dummy_mapping: false,
            block_transfer: false,
            boot_up: config.policies.boot_up,
            // 7729-7730
            r_pdos_count_syncs: true,
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
        self.firmware.servo.state
    }

    /// Statusword of the drive.
    #[must_use]
    pub fn statusword(&self) -> Statusword {
        self.firmware.statusword()
    }

    /// The outputs as 60FEh numbers them, bits 22 to 16 (16548-16585).
    #[must_use]
    pub fn outputs(&self) -> u32 {
        self.firmware.outputs()
    }

    // ---- interference ----

    /// Raises an error, as if the drive's monitoring had found one.
    pub fn raise(&mut self, error: DriveError) {
        self.firmware.raise(error);
    }

    /// Levels of the inputs 31 to 16 of 60FDh (16458-16492).
    pub fn set_inputs(&mut self, levels: u32) {
        self.firmware.inputs.levels = levels;
    }

    /// Whether the input STOP is active.
    pub fn set_stop(&mut self, active: bool) {
        self.firmware.inputs.stop = active;
    }

    /// Pulses/s at the pulse interface of module M1, the reference of the electronic gear.
    pub fn set_pulse_frequency(&mut self, frequency: f64) {
        self.firmware.pulse_frequency = frequency;
    }

    /// Presets statusword bit 10, which the manual's examples find as an earlier movement left it.
    pub fn preset_target_reached(&mut self, reached: bool) {
        self.firmware.target_reached = reached;
    }
}
