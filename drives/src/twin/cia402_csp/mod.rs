//! A simulated servo drive as the profile has it: CiA 402 in Cyclic Synchronous Position.
//!
//! A CANopen device by CiA 301's strict rules: PDOs are mapped while they are switched off. Its one
//! operating mode is 8. While it is enabled, each SYNC sends its reference in a straight line from
//! where it is to 607Ah, within the period of 60C2h; there it rests until the next one. The loops
//! run on the drive's own oscillator: nothing is locked to SYNC. Statusword bit 12 is set from the
//! first SYNC in Operation Enabled on.
//!
//! Positions are encoder increments at the motor's shaft (608Fh), without a gear (6091h is 1 : 1).
//! What the profile leaves to a maker is an option in [`Policies`] or [`TwinConfig`], with a default
//! that is an assumption.
//!
//! Tests interfere with it as with every device, by a [`Disturbance`]; what this one alone has is
//! reached through [`Twin::preset`], [`Twin::raise`] and [`TwinConfig`].

mod application;
mod drive;
mod fault;
mod policy;
mod settings;
mod state;

pub use fault::DriveError;
pub use policy::Policies;

use super::device::{Axis, Config, Disturbance, Kind, Observation, SimulatedDevice};
use super::node::{Delays, DeviceNode, Firmware};
use super::random::Random;
use super::servo::cascade::Gains;
use super::servo::clock::Clock;
use super::servo::encoder::{Encoder, EncoderErrors};
use super::servo::power_stage::{DcBus, PowerStage, TorqueSource};
use super::servo::shaft::{Plant, Shaft};
use crate::bus::Node;
use crate::dictionary::CIA402_CSP;
use drive::Drive;
use syncline_canopen::cia402::{State, Statusword};
use syncline_canopen::dictionary::Dictionary;
use syncline_canopen::node::Options;
use syncline_canopen::time::Duration;
use syncline_canopen::{Address, Frame, Instant, NodeId, Transmit};

/// The twin in the registry.
pub(super) static KIND: Kind = Kind {
    name: "cia402_csp",
    title: "CiA 402 CSP",
    bitrates: &[
        10_000, 20_000, 50_000, 125_000, 250_000, 500_000, 800_000, 1_000_000,
    ],
    dictionary: &CIA402_CSP,
    make: |config| Box::new(Twin::new(config.into())),
};

/// 6060h: Cyclic Synchronous Position.
const MODE: i64 = 8;

/// What a twin is made of.
#[derive(Clone, Debug)]
pub struct TwinConfig {
    /// Node id.
    pub node: NodeId,
    /// Seed of encoder noise, delays and oscillator.
    pub seed: u64,
    /// Where the shaft stands, revolutions from the encoder's zero.
    pub position: f64,
    /// Encoder increments per motor revolution: 608Fh:1.
    pub encoder_increments: u32,
    /// What makes the encoder's reading wrong.
    pub encoder: EncoderErrors,
    /// The axis behind the motor.
    pub mechanics: Plant,
    /// What turns it.
    pub torque_source: TorqueSource,
    /// Gains of the control loops.
    pub gains: Gains,
    /// What the profile leaves open.
    pub policies: Policies,
    /// What its processor takes.
    pub delays: Delays,
    /// Greatest error of the oscillator, parts per million; the seed picks one within.
    pub oscillator_ppm: f64,
    /// Time from a reset to the boot-up message.
    pub boot_time: Duration,
}

impl TwinConfig {
    /// The drive with all defaults; resolution, noise, delays, oscillator and boot time are
    /// assumptions.
    #[must_use]
    pub fn new(node: NodeId) -> Self {
        Self {
            node,
            seed: 0,
            position: 0.0,
            encoder_increments: 1_048_576,
            encoder: EncoderErrors {
                noise: 2.0,
                ..EncoderErrors::default()
            },
            mechanics: Plant::default(),
            torque_source: TorqueSource::Ideal,
            gains: Gains {
                velocity_feed_forward: 1.0,
                ..Gains::default()
            },
            policies: Policies::default(),
            delays: Delays {
                t_pdo: Duration::from_micros(30)..Duration::from_micros(90),
                sdo: Duration::from_micros(200)..Duration::from_micros(900),
            },
            oscillator_ppm: 50.0,
            boot_time: Duration::from_millis(20),
        }
    }
}

impl From<&Config> for TwinConfig {
    fn from(config: &Config) -> Self {
        let own = Self::new(config.node);
        let (mechanics, torque_source, gains) = match &config.axis {
            None => (own.mechanics, own.torque_source, own.gains),
            Some(Axis { motor, train }) => (
                train.clone().into(),
                PowerStage::new(*motor, DcBus::default()).into(),
                Gains {
                    velocity_feed_forward: own.gains.velocity_feed_forward,
                    ..Gains::commissioned(motor, train)
                },
            ),
        };
        Self {
            mechanics,
            torque_source,
            gains,
            encoder: config.encoder.unwrap_or(own.encoder),
            seed: config.seed,
            position: config.position,
            encoder_increments: config
                .assumed("encoder_increments")
                .unwrap_or(own.encoder_increments),
            policies: match config.tolerant {
                true => Policies::tolerant(),
                false => own.policies,
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

/// A drive on a bus; see the [module](self).
pub struct Twin {
    node: DeviceNode,
    drive: Drive,
}

impl Twin {
    /// A drive that has just been powered on, at the origin of time.
    #[must_use]
    pub fn new(config: TwinConfig) -> Self {
        let stream =
            |purpose: u64| Random::new(config.seed, u64::from(config.node.get()) << 8 | purpose);
        let objects = Dictionary::new(&CIA402_CSP, config.node);
        let options = Options {
            boot_time: config.boot_time,
            ..Options::default()
        };
        let delays = config.delays.clone();
        let node = DeviceNode::new(config.node, &objects, options, delays, stream(2));
        let ppm = stream(0).between(-config.oscillator_ppm, config.oscillator_ppm);
        let clock = Clock::new(Instant::ZERO, ppm);
        let counts = f64::from(config.encoder_increments);
        let encoder = Encoder::new(counts, config.encoder, stream(1));
        Self {
            node,
            drive: Drive::new(objects, config, clock, encoder),
        }
    }

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

    /// Gives an object another value than the table's, now and after each reset: as another maker's
    /// drive may have it.
    pub fn preset(&mut self, address: Address, value: i64) {
        self.drive.preset(address, value);
    }

    /// Raises an error, as if the drive's monitoring had found one.
    pub fn raise(&mut self, error: DriveError) {
        self.drive.raise(error);
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
            Disturbance::Fault(class) => drive.raise(DriveError {
                class,
                ..DriveError::FOLLOWING_ERROR
            }),
            Disturbance::FaultPersists(persists) => drive.errors.cause_persists = persists,
            Disturbance::FoundEnabled => drive.start_enabled(),
            Disturbance::EnableTime(time) => drive.policies.enable_time = time,
            Disturbance::Remote(remote) => drive.remote = remote,
            Disturbance::RefuseWrite(address, code) => drive.refusals.push((address, code)),
            // It has none.
            Disturbance::Input(..) => {}
            Disturbance::Vendor(id) => drive.preset(Address::new(0x1018, 1), id.into()),
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
        self.node.on_frame(now, frame, &mut self.drive, tx);
    }

    fn poll(&mut self, now: Instant, tx: &mut dyn Transmit) {
        self.node.poll(now, &mut self.drive, tx);
    }

    fn deadline(&self) -> Option<Instant> {
        self.node.deadline()
    }
}
