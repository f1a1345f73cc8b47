//! A simulated Lexium 32M with its CANopen module.
//!
//! ```
//! use syncline_canopen::NodeId;
//! use syncline_drives::bus::{BitRate, SimBus};
//! use syncline_drives::twin::lxm32m::{Twin, TwinConfig};
//!
//! let mut bus = SimBus::new(BitRate::from_kbit(1000).ok_or("bit rate")?);
//! let x = bus.attach(Twin::new(TwinConfig {
//!     initial_position: 131_072 * 10,
//!     seed: 7,
//!     ..TwinConfig::new(NodeId::new(1).ok_or("node id")?)
//! }));
//! // … bring it up over the bus, then ask what a master cannot know:
//! assert_eq!(bus.node(x).position(), 10.0);
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
//! Tests interfere with it through [`Twin::raise`], [`Twin::mute`], [`Twin::drop_t_pdos`],
//! [`Twin::block_axis`], [`Twin::set_mains`], [`Twin::set_remote`], [`Twin::start_enabled`], [`Twin::refuse_write`], [`Twin::reboot`] and
//! [`TwinConfig::identity`].

mod application;
mod drive;
mod fault;
mod limits;
mod modes;
mod motion;
mod outbox;
mod parameter_sets;
mod policy;
mod rows;
mod signals;
mod state;
mod switches;
mod synchronisation;
mod units;

pub use fault::{DriveError, ErrorClass};
pub use policy::{Policies, SetpointGap};
pub use rows::storage_only;
pub use switches::Switches;
pub use synchronisation::SyncStatus;

use super::clock::Clock;
use super::control::{Cascade, Gains};
use super::plant::{INCREMENTS_PER_REVOLUTION, Mechanics, Plant};
use super::random::Random;
use crate::bus::Node;
use crate::dictionary::LXM32M;
use core::ops::Range;
use drive::Drive;
use outbox::Outbox;
use syncline_canopen::cia402::{State, Statusword};
use syncline_canopen::dictionary::Dictionary;
use syncline_canopen::node::{Node as CanopenNode, Options, ParameterRules};
use syncline_canopen::pdo::TransmissionType;
use syncline_canopen::sdo::AbortCode;
use syncline_canopen::time::Duration;
use syncline_canopen::{Address, Frame, Instant, NodeId, Transmit, nmt};

/// How often the drive looks after its state without being addressed.
const TASK: Duration = Duration::from_millis(1);

/// What a twin is made of.
#[derive(Clone, Debug)]
pub struct TwinConfig {
    /// Node id.
    pub node: NodeId,
    /// Seed of encoder noise, delays and oscillator.
    pub seed: u64,
    /// Where the absolute multi-turn encoder stands, increments (131072 a revolution).
    pub initial_position: i64,
    /// The axis behind the motor.
    pub mechanics: Mechanics,
    /// Gains of the control loops.
    pub gains: Gains,
    /// The switches along it.
    pub switches: Switches,
    /// What the manual leaves open.
    pub policies: Policies,
    /// Who the drive says it is.
    pub identity: Identity,
    /// Time from SYNC or event until a T_PDO, heartbeat or EMCY is handed to the CAN controller.
    pub t_pdo_delay: Range<Duration>,
    /// Time from a request to its SDO answer.
    pub sdo_delay: Range<Duration>,
    /// Greatest error of the oscillator, parts per million; the seed picks one within.
    pub oscillator_ppm: f64,
    /// Time from a reset to the boot-up message.
    pub boot_time: Duration,
}

impl TwinConfig {
    /// The drive with all defaults; delays, oscillator and boot time are assumptions.
    #[must_use]
    pub fn new(node: NodeId) -> Self {
        Self {
            node,
            seed: 0,
            initial_position: 0,
            mechanics: Mechanics::default(),
            gains: Gains::default(),
            switches: Switches::default(),
            policies: Policies::default(),
            identity: Identity::default(),
            t_pdo_delay: Duration::from_micros(30)..Duration::from_micros(90),
            sdo_delay: Duration::from_micros(200)..Duration::from_micros(900),
            oscillator_ppm: 50.0,
            boot_time: Duration::from_millis(20),
        }
    }
}

/// 1000h, Objects 1000h, 1008h…100Ah and 1018h. Product code, revision and texts are not in the
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
            name: "LXM32M".into(),
            hardware: String::new(),
            software: "V01.00".into(),
        }
    }
}

/// A Lexium 32M on a bus; see the [module](self).
pub struct Twin {
    config: TwinConfig,
    node: CanopenNode,
    drive: Drive,
    outbox: Outbox,
    /// What the node has just sent.
    sent: Vec<Frame>,
    next_task: Instant,
    power_cycle: bool,
    dropped_t_pdos: u32,
}

impl Twin {
    /// A drive that has just been powered on, at the origin of time.
    #[must_use]
    pub fn new(config: TwinConfig) -> Self {
        let stream =
            |purpose: u64| Random::new(config.seed, u64::from(config.node.get()) << 8 | purpose);
        let objects = Dictionary::new(&LXM32M, config.node).refusing(config.policies.refusals);
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
            boot_time: config.boot_time,
        };
        let mut node = CanopenNode::new(config.node, &objects, options);
        node.power_on(Instant::ZERO);
        let ppm = stream(0).between(-config.oscillator_ppm, config.oscillator_ppm);
        let revolutions = config.initial_position as f64 / INCREMENTS_PER_REVOLUTION;
        Self {
            node,
            drive: Drive::new(
                objects,
                config.identity.clone(),
                config.policies.clone(),
                config.switches.clone(),
                Clock::new(Instant::ZERO, ppm),
                Plant::new(config.mechanics.clone(), revolutions, stream(1)),
                Cascade::new(config.gains.clone(), config.initial_position),
            ),
            outbox: Outbox::new(stream(2)),
            sent: Vec::with_capacity(16),
            next_task: Instant::ZERO,
            power_cycle: false,
            dropped_t_pdos: 0,
            config,
        }
    }

    // ---- what a master cannot know ----

    /// True position of the shaft, revolutions from the encoder's zero.
    #[must_use]
    pub fn position(&self) -> f64 {
        self.drive.plant().position()
    }

    /// True velocity of the shaft, rev/s.
    #[must_use]
    pub fn velocity(&self) -> f64 {
        self.drive.plant().velocity()
    }

    /// Torque of the motor, N·m.
    #[must_use]
    pub fn torque(&self) -> f64 {
        self.drive.torque()
    }

    /// State of the drive.
    #[must_use]
    pub fn state(&self) -> State {
        self.drive.state()
    }

    /// Statusword of the drive.
    #[must_use]
    pub fn statusword(&self) -> Statusword {
        self.drive.statusword()
    }

    /// NMT state of the node.
    #[must_use]
    pub fn nmt_state(&self) -> nmt::State {
        self.node.state()
    }

    /// Node id.
    #[must_use]
    pub fn node(&self) -> NodeId {
        self.config.node
    }

    // ---- interference ----

    /// Raises an error, as if the drive's monitoring had found one.
    pub fn raise(&mut self, error: DriveError) {
        self.drive.raise(error);
    }

    /// While true, the cause of an error is still there: Fault Reset is in vain.
    pub fn cause_persists(&mut self, persists: bool) {
        self.drive.errors.cause_persists = persists;
    }

    /// While true, nothing that the node sends reaches the bus.
    pub fn mute(&mut self, muted: bool) {
        self.outbox.mute(muted);
    }

    /// Loses the next `count` T_PDOs.
    pub fn drop_t_pdos(&mut self, count: u32) {
        self.dropped_t_pdos = count;
    }

    /// While true, the axis is blocked mechanically.
    pub fn block_axis(&mut self, blocked: bool) {
        self.drive.plant_mut().block(blocked);
    }

    /// Whether the DC bus has its voltage; without it state 3 is not left (lxm32m 1315).
    pub fn set_mains(&mut self, on: bool) {
        self.drive.has_mains = on;
    }

    /// Whether the fieldbus has control of the drive; while another access channel has it,
    /// parameters can be read and written, commands are not executed (lxm32m 1327).
    pub fn set_remote(&mut self, remote: bool) {
        self.drive.remote = remote;
    }

    /// Operation Enabled, as a master that crashed may have left the drive.
    pub fn start_enabled(&mut self) {
        self.drive.start_enabled();
    }

    /// Refuses every SDO write to an object.
    pub fn refuse_write(&mut self, address: Address, code: AbortCode) {
        self.drive.refusals.push((address, code));
    }

    /// Power fails and returns; the boot-up message comes after the boot time.
    pub fn reboot(&mut self) {
        self.power_cycle = true;
    }

    /// Pulses/s at the PTI interface, the reference of Electronic Gear.
    pub fn set_pulse_frequency(&mut self, frequency: f64) {
        self.drive.pulses.frequency = frequency;
    }

    /// Presets statusword bits 10 and 13, which the manual's examples find set without a cause.
    pub fn preset_status(&mut self, target_reached: bool, x_err: bool) {
        self.drive.target_reached = target_reached;
        self.drive.x_err = x_err;
    }

    // ---- the node ----

    fn advance(&mut self, now: Instant) {
        self.drive.advance(now);
        self.drive.stale = true;
        if core::mem::take(&mut self.power_cycle) {
            self.outbox.clear();
            self.drive.power_off();
            self.node.power_on(now + self.config.boot_time);
        }
    }

    /// Passes on what the node has sent: delayed as a drive's processor delays it.
    fn dispatch(&mut self, now: Instant) {
        if self.node.state() == nmt::State::Initialising {
            self.outbox.clear();
        }
        let config = &self.config;
        for frame in self.sent.drain(..) {
            let t_pdo = self.node.t_pdo(frame.id());
            if t_pdo.is_some() && self.dropped_t_pdos > 0 {
                self.dropped_t_pdos -= 1;
            } else if self.node.is_sdo_answer(frame.id()) {
                self.outbox.send_within(now, &config.sdo_delay, frame);
            } else if t_pdo.is_some_and(|number| is_synchronous(&self.drive.objects, number)) {
                self.outbox.send_within(now, &config.t_pdo_delay, frame);
            } else {
                self.outbox.send_behind(now, &config.t_pdo_delay, frame);
            }
        }
    }
}

fn is_synchronous(objects: &Dictionary, t_pdo: u16) -> bool {
    let kind = objects.value(0x1800 + t_pdo - 1, 2).unwrap_or(255);
    TransmissionType::from(kind as u8).is_synchronous()
}

impl Node for Twin {
    fn on_frame(&mut self, now: Instant, frame: &Frame, tx: &mut dyn Transmit) {
        self.advance(now);
        self.node
            .on_frame(now, frame, &mut self.drive, &mut self.sent);
        self.dispatch(now);
        self.outbox.flush(now, tx);
    }

    fn poll(&mut self, now: Instant, tx: &mut dyn Transmit) {
        self.advance(now);
        let task = self.next_task <= now;
        // Events are looked for by the task, not whenever a frame leaves: noise that is mapped
        // into an event-driven T_PDO would fill the bus otherwise.
        if task || self.node.deadline().is_some_and(|due| due <= now) {
            self.node.poll(now, &mut self.drive, &mut self.sent);
            self.dispatch(now);
        }
        self.outbox.flush(now, tx);
        if task {
            self.next_task = now + TASK;
        }
    }

    fn deadline(&self) -> Option<Instant> {
        let due = [
            self.node.deadline(),
            self.outbox.deadline(),
            Some(self.next_task),
        ];
        due.into_iter().flatten().min()
    }
}
