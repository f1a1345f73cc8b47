//! A simulated stepper controller TSP10-CBE with its motor.
//!
//! What the manual tells is modelled as it tells it; numbers in comments are lines of its text. It is
//! an appendix of 900 lines: what it leaves open, which is much, is an option in [`Policies`] or
//! [`TwinConfig`], with a default that is an assumption.
//!
//! Behind the node a profile moves the field of a stepping [`Motor`], whose rotor follows as its
//! torque lets it. Without an encoder the bus shows the demand, and steps that the rotor loses are
//! seen by nobody: [`Twin::lost_steps`] tells them to tests.

mod application;
mod drive;
mod homing;
mod modes;
mod motor;
mod policy;
mod signals;

pub use motor::Motor;
pub use policy::{HaltedTarget, Policies, RelativeTo, SecondTarget, StandbyUnit, TPdoTrigger};
pub use signals::Switches;

use super::device::{Config, DrivenAxis, Kind};
use super::node::{Delays, Device, Processor};
use super::servo::shaft::Plant;
use crate::dictionary::TSP10;
use drive::Drive;
use syncline_canopen::NodeId;
use syncline_canopen::cia402::{State, Statusword};
use syncline_canopen::dictionary::Dictionary;
use syncline_canopen::node::Options;
use syncline_canopen::time::Duration;

/// The twin in the registry; its bit rate is set by its maker's tool alone (116-127).
pub(super) static KIND: Kind = Kind {
    name: "tsp10",
    title: "TSP10-CBE",
    bitrates: &[
        50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000,
    ],
    dictionary: TSP10,
    make: |config| Box::new(Twin::new(config.into())),
};

/// What a twin is made of.
#[derive(Clone, Debug)]
pub struct TwinConfig {
    /// Its processor; the node id is that of two rotary switches.
    pub processor: Processor,
    /// Where the shaft stands, revolutions.
    pub position: f64,
    /// The motor.
    pub motor: Motor,
    /// What it moves.
    pub mechanics: Plant,
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
            t_pdo: Duration::from_micros(100)..Duration::from_micros(400),
            sdo: Duration::from_micros(500)..Duration::from_micros(2000),
        };
        Self {
            processor: Processor::new(node, delays, Duration::from_millis(50)),
            position: 0.0,
            motor: Motor::default(),
            mechanics: Plant::default(),
            switches: Switches::default(),
            policies: Policies::default(),
        }
    }
}

impl From<&Config> for TwinConfig {
    fn from(config: &Config) -> Self {
        let own = Self::new(config.node);
        Self {
            position: config.position,
            mechanics: match &config.axis {
                None => own.mechanics,
                Some(DrivenAxis { train, .. }) => train.clone().into(),
            },
            policies: Policies {
                velocity_unit: config
                    .assumed("velocity_units")
                    .filter(|units| *units != 0)
                    .map(|units| [units, config.assumed("velocity_rpm").unwrap_or(1)]),
                ..own.policies
            },
            processor: own.processor.configured(config),
            ..own
        }
    }
}

/// A TSP10-CBE on a bus; see the [module](self).
pub type Twin = Device<Drive>;

impl Device<Drive> {
    /// A controller that has just been powered on, at the origin of time.
    #[must_use]
    pub fn new(config: TwinConfig) -> Self {
        let objects = Dictionary::new(TSP10, config.processor.node);
        let options = Options {
            dummy_mapping: false,
            block_transfer: false,
            boot_up: config.policies.boot_up,
            ..Options::default()
        };
        let processor = config.processor.clone();
        let (clock, random) = (processor.clock(), processor.random(1));
        let drive = Drive::new(objects, config, clock);
        Self::switched_on(processor, drive, options, random)
    }

    // ---- what a master cannot know ----

    /// State of the drive.
    #[must_use]
    pub fn state(&self) -> State {
        self.firmware.state
    }

    /// Statusword of the drive.
    #[must_use]
    pub fn statusword(&self) -> Statusword {
        self.firmware.statusword()
    }

    /// How far the rotor is behind its field, in steps of 6092h: whole pole pairs of it are lost.
    #[must_use]
    pub fn lost_steps(&self) -> f64 {
        self.firmware.lag()
    }
}
