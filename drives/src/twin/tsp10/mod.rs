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
pub use policy::{Policies, RelativeTo, SecondTarget, StandbyUnit, TPdoTrigger};
pub use signals::Switches;

use super::device::{Axis, Config, Disturbance, Kind, Observation, SimulatedDevice};
use super::node::{Delays, DeviceNode, Firmware};
use super::random::Random;
use super::servo::clock::Clock;
use super::servo::shaft::{Plant, Shaft};
use crate::bus::Node;
use crate::dictionary::TSP10;
use drive::Drive;
use syncline_canopen::cia402::{State, Statusword};
use syncline_canopen::dictionary::Dictionary;
use syncline_canopen::emcy::register;
use syncline_canopen::node::Options;
use syncline_canopen::time::Duration;
use syncline_canopen::{Address, CobId, Frame, Instant, NodeId, Transmit};

/// The twin in the registry; its bit rate is set by its maker's tool alone (116-127).
pub(super) static KIND: Kind = Kind {
    name: "tsp10",
    title: "TSP10-CBE",
    bitrates: &[
        50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000,
    ],
    dictionary: &TSP10,
    make: |config| Box::new(Twin::new(config.into())),
};

/// What a twin is made of.
#[derive(Clone, Debug)]
pub struct TwinConfig {
    /// Node id, as two rotary switches have it.
    pub node: NodeId,
    /// Seed of delays and oscillator.
    pub seed: u64,
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
    /// What its processor takes.
    pub delays: Delays,
    /// Greatest error of the oscillator, parts per million; the seed picks one within.
    pub oscillator_ppm: f64,
    /// Time from a reset to the boot-up message.
    pub boot_time: Duration,
}

impl TwinConfig {
    /// The controller with all defaults; delays, oscillator and boot time are assumptions.
    #[must_use]
    pub fn new(node: NodeId) -> Self {
        Self {
            node,
            seed: 0,
            position: 0.0,
            motor: Motor::default(),
            mechanics: Plant::default(),
            switches: Switches::default(),
            policies: Policies::default(),
            delays: Delays {
                t_pdo: Duration::from_micros(100)..Duration::from_micros(400),
                sdo: Duration::from_micros(500)..Duration::from_micros(2000),
            },
            oscillator_ppm: 50.0,
            boot_time: Duration::from_millis(50),
        }
    }
}

impl From<&Config> for TwinConfig {
    fn from(config: &Config) -> Self {
        let own = Self::new(config.node);
        Self {
            seed: config.seed,
            position: config.position,
            mechanics: match &config.axis {
                None => own.mechanics,
                Some(Axis { train, .. }) => train.clone().into(),
            },
            delays: match config.prompt {
                true => Delays::NONE,
                false => own.delays,
            },
            boot_time: config.boot_time.unwrap_or(own.boot_time),
            ..own
        }
    }
}

/// A TSP10-CBE on a bus; see the [module](self).
pub struct Twin {
    node: DeviceNode,
    drive: Drive,
    answers_guarding: bool,
}

impl Twin {
    /// A controller that has just been powered on, at the origin of time.
    #[must_use]
    pub fn new(config: TwinConfig) -> Self {
        let stream =
            |purpose: u64| Random::new(config.seed, u64::from(config.node.get()) << 8 | purpose);
        let objects = Dictionary::new(&TSP10, config.node);
        let options = Options {
            dummy_mapping: false,
            block_transfer: false,
            boot_time: config.boot_time,
            boot_up: config.policies.boot_up,
            ..Options::default()
        };
        let delays = config.delays.clone();
        let node = DeviceNode::new(config.node, &objects, options, delays, stream(1));
        let ppm = stream(0).between(-config.oscillator_ppm, config.oscillator_ppm);
        let clock = Clock::new(Instant::ZERO, ppm);
        let answers_guarding = config.policies.answers_guarding;
        Self {
            node,
            drive: Drive::new(objects, config, clock),
            answers_guarding,
        }
    }

    // ---- what a master cannot know ----

    /// State of the drive.
    #[must_use]
    pub fn state(&self) -> State {
        self.drive.state
    }

    /// Statusword of the drive.
    #[must_use]
    pub fn statusword(&self) -> Statusword {
        self.drive.statusword()
    }

    /// How far the rotor is behind its field, in steps of 6092h: whole pole pairs of it are lost.
    #[must_use]
    pub fn lost_steps(&self) -> f64 {
        self.drive.lag()
    }

    // ---- interference ----

    /// Levels of DE1 to DE10 from bit 0, but for those that the switches along the axis drive.
    pub fn set_inputs(&mut self, levels: u16) {
        self.drive.inputs = levels;
    }
}

impl SimulatedDevice for Twin {
    fn node(&self) -> NodeId {
        self.node.id()
    }

    fn observe(&self) -> Observation {
        Observation {
            nmt_state: self.node.state(),
            is_powered: self.drive.is_powered(),
            position: self.drive.shaft().position(),
            velocity: self.drive.shaft().velocity(),
            torque: self.drive.torque(),
        }
    }

    fn disturb(&mut self, disturbance: Disturbance) {
        let drive = &mut self.drive;
        match disturbance {
            Disturbance::Mains(on) => drive.has_mains = on,
            Disturbance::Block(blocked) => drive.shaft_mut().block(blocked),
            Disturbance::LoseTorque(lost) => drive.shaft_mut().lose_torque(lost),
            Disturbance::Mute(muted) => self.node.mute(muted),
            Disturbance::LoseTPdos(count) => self.node.lose_t_pdos(count),
            Disturbance::Reset => self.node.power_cycle(),
            Disturbance::Fault(class) => drive.raise(class, register::MANUFACTURER),
            Disturbance::FaultPersists(persists) => drive.cause_persists = persists,
            Disturbance::FoundEnabled => drive.enter(State::OperationEnabled),
            Disturbance::RefuseWrite(address, code) => drive.refusals.push((address, code)),
            Disturbance::Vendor(id) => {
                drive.presets.push((Address::new(0x1018, 1), id.into()));
                drive.show_presets();
            }
            // It has no other channel and no inputs to be told here, and switches on at once.
            Disturbance::EnableTime(_) | Disturbance::Remote(_) | Disturbance::Input(..) => {}
        }
    }

    fn shaft_mut(&mut self) -> Option<&mut Shaft> {
        Some(self.drive.shaft_mut())
    }

    fn run_until(&mut self, now: Instant) {
        self.drive.run_until(now);
    }
}

impl Node for Twin {
    fn on_frame(&mut self, now: Instant, frame: &Frame, tx: &mut dyn Transmit) {
        let guards = frame.is_remote() && frame.id() == CobId::error_control(self.node.id()).into();
        if guards && !self.answers_guarding {
            self.drive.run_until(now);
        } else {
            self.node.on_frame(now, frame, &mut self.drive, tx);
        }
    }

    fn poll(&mut self, now: Instant, tx: &mut dyn Transmit) {
        self.node.poll(now, &mut self.drive, tx);
    }

    fn deadline(&self) -> Option<Instant> {
        self.node.deadline()
    }
}
