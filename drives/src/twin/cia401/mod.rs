//! A simulated I/O node as the profile CiA 401 has it: 16 digital inputs and outputs, 4 analog inputs and outputs
//! of 16 bit.
//!
//! ```
//! use syncline_canopen::NodeId;
//! use syncline_drives::bus::{BitRate, SimBus};
//! use syncline_drives::twin::SimulatedDevice;
//! use syncline_drives::twin::cia401::{Twin, TwinConfig};
//!
//! let mut bus = SimBus::new(BitRate::from_kbit(1000).ok_or("bit rate")?);
//! let io = bus.attach(Twin::new(TwinConfig::new(NodeId::new(9).ok_or("node id")?)));
//! // … bring it up over the bus, and wire something to it meanwhile:
//! bus.node_mut(io).set_input(3, true);
//! bus.node_mut(io).set_analog_input(0, 12_000);
//! assert_eq!(bus.node_mut(io).outputs(), 0);
//! # Ok::<(), &str>(())
//! ```
//!
//! Digital signals stand in the dictionary twice, by bytes (6000h, 6200h) and by words (6100h, 6300h), as do their
//! polarities, masks, error modes and error values: what is written to one is read from the other.
//!
//! What the profile leaves open is decided so, and marked *assumed* where it is done: a change of an input is told
//! within a millisecond; while an analog input is beyond a limit each change of it is an event; an output with an
//! error value takes it when the node is stopped, at an error of the device and when a heartbeat or a guarding
//! request is missing, and gives it up at the next value that is written in Pre-Operational or Operational.

mod application;
mod module;

use super::device::{Config, Course, Kind};
use super::node::{Delays, Device, Processor};
use crate::dictionary::CIA401;
use module::Module;
use syncline_canopen::dictionary::Dictionary;
use syncline_canopen::node::Options;
use syncline_canopen::time::Duration;
use syncline_canopen::{BIT_RATES, NodeId};

/// The twin in the registry.
pub(super) static KIND: Kind = Kind {
    name: "cia401",
    title: "CiA 401",
    bitrates: BIT_RATES,
    dictionary: CIA401,
    make: |config| Box::new(Twin::new(config.into())),
};

/// What a twin is made of.
#[derive(Clone, Debug)]
pub struct TwinConfig {
    /// Its processor.
    pub processor: Processor,
    /// What analog inputs are over time, by their numbers from 0 on; the others are what they are set to.
    pub analog_inputs: Vec<(u8, Course)>,
}

impl TwinConfig {
    /// As the profile has it by default; delays and boot time are assumptions.
    #[must_use]
    pub fn new(node: NodeId) -> Self {
        let delays = Delays {
            t_pdo: Duration::from_micros(50)..Duration::from_micros(250),
            sdo: Duration::from_micros(300)..Duration::from_micros(2000),
        };
        Self {
            processor: Processor::new(node, delays, Duration::from_millis(100)),
            analog_inputs: Vec::new(),
        }
    }
}

impl From<&Config> for TwinConfig {
    fn from(config: &Config) -> Self {
        let own = Self::new(config.node);
        Self {
            processor: own.processor.configured(config),
            analog_inputs: config.analog_inputs.clone(),
        }
    }
}

/// An I/O node on a bus; see the [module](self).
pub type Twin = Device<Module>;

impl Device<Module> {
    /// A node that has just been powered on, at the origin of time; nothing is wired to its inputs but what was asked for.
    #[must_use]
    pub fn new(config: TwinConfig) -> Self {
        let objects = Dictionary::new(CIA401, config.processor.node);
        let module = Module::new(objects, config.analog_inputs);
        let random = config.processor.random(0);
        Self::switched_on(config.processor, module, Options::default(), random)
    }

    /// What its analog outputs put out.
    #[must_use]
    pub fn analog_outputs(&self) -> [i16; module::ANALOG] {
        self.firmware.analog_outputs()
    }

    /// Gives a digital input, from 0 on, a level.
    pub fn set_input(&mut self, input: u8, level: bool) {
        self.firmware.set_input(input, level);
    }

    /// Gives an analog input, from 0 on, a value.
    pub fn set_analog_input(&mut self, input: u8, value: i16) {
        self.firmware.set_analog_input(input, value);
    }
}
