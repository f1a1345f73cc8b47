//! What the controller knows of each device: identity, set-up, PDO image, scaling, faults.
//!
//! Three traits, from the general to the special: [`Device`], [`Feedback`] (it has a position),
//! [`Actuator`] (it takes setpoints). A [`Model`] is what is known before a device is made: its
//! name, the cycles and bit rates it takes, and what its manual leaves open ([`Assumption`]).
//! The controller goes by these and never asks which model stands behind them.

mod lxm32m;
mod object;
mod scaling;

pub use lxm32m::LXM32M;
pub use object::{Data, Write};
pub use scaling::{Direction, Increments, OutOfRange, Scaling};
pub use syncline_canopen::Address;

use core::{fmt, ops::RangeInclusive, time::Duration};
use syncline_canopen::{
    Frame, NodeId,
    budget::{NodeTraffic, Pdo},
    cia402::{Controlword, Statusword},
    dictionary::Entry,
};

/// Every model, by which a machine file may name a drive.
pub static MODELS: [&Model; 1] = [&LXM32M];

/// A kind of device: everything that is known before one is made.
#[derive(Debug)]
pub struct Model {
    /// As a machine file writes it: `lxm32m`.
    pub name: &'static str,
    /// As its maker writes it: `LXM32M`.
    pub title: &'static str,
    /// Bit rates in bit/s, ascending.
    pub bitrates: &'static [u32],
    /// The cycle is a whole multiple of this …
    pub cycle_step: Duration,
    /// … within this range.
    pub cycles: RangeInclusive<Duration>,
    /// Encoder increments per motor revolution.
    pub increments_per_revolution: u32,
    /// What the manual leaves open, with the value taken unless the machine file says otherwise.
    pub assumptions: &'static [Assumption],
    /// Its object dictionary.
    pub dictionary: &'static [Entry],
    /// Whether the controller itself writes or owns the object, so that a user must not.
    pub reserved: fn(Address) -> bool,
    /// Makes the device.
    pub actuator: fn(&Settings) -> Box<dyn Actuator>,
}

impl Model {
    /// The model of that name.
    #[must_use]
    pub fn by_name(name: &str) -> Option<&'static Self> {
        MODELS.iter().copied().find(|model| model.name == name)
    }

    /// Whether the drive takes setpoints in this cycle.
    #[must_use]
    pub fn takes_cycle(&self, cycle: Duration) -> bool {
        self.cycles.contains(&cycle) && cycle.as_nanos().is_multiple_of(self.cycle_step.as_nanos())
    }
}

/// A fact that the manual at hand leaves open: it has a name, so that a machine file can state it
/// as the real drive has it.
#[derive(Debug)]
pub struct Assumption {
    /// The key in the machine file's `[model.<name>]` table.
    pub name: &'static str,
    /// The value taken where the machine file is silent.
    pub default: u32,
    /// The values that make sense.
    pub allowed: RangeInclusive<u32>,
    /// What it says, in few words.
    pub meaning: &'static str,
}

/// One machine's choices for one device.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The device's node id.
    pub node: NodeId,
    /// Time between two setpoints, one that [`Model::takes_cycle`] takes.
    pub cycle: Duration,
    /// Connection monitoring both ways.
    pub heartbeat: Heartbeat,
    /// Following error at which the drive itself faults; `None` leaves the drive's own.
    pub following_error_limit: Option<Increments>,
    /// Positions beyond which the drive itself faults; `None` leaves the drive's own.
    pub soft_limits: Option<(Increments, Increments)>,
    /// Written after the standard set-up, in this order.
    pub objects: Vec<Write>,
    /// Values of [`Model::assumptions`] that differ from the default, by name.
    pub assumptions: Vec<(&'static str, u32)>,
}

impl Settings {
    /// The value that holds for `assumption`.
    #[must_use]
    pub fn assumed(&self, assumption: &Assumption) -> u32 {
        self.assumptions
            .iter()
            .find(|(name, _)| *name == assumption.name)
            .map_or(assumption.default, |(_, value)| *value)
    }
}

/// Connection monitoring by heartbeat, both ways (CiA 301, 1016h and 1017h).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heartbeat {
    /// The controller's node id, which the device watches.
    pub controller: NodeId,
    /// Time between two heartbeats, of device and controller alike; 1…65535 ms.
    pub producer: Duration,
    /// Time without one after which the other side is lost; more than `producer`, ≤ 65535 ms.
    pub consumer: Duration,
}

/// An object that must read as stated, or this is another device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identity {
    /// Where it stands.
    pub address: Address,
    /// Its name.
    pub name: &'static str,
    /// Its value.
    pub value: u32,
}

/// An object to poll after SYNC has started, until the device's clock follows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClockLock {
    /// Where the status stands.
    pub address: Address,
    /// What it reads once the device's clock follows SYNC.
    pub locked: u32,
}

/// What a T_PDO brought.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sample {
    /// 6041h.
    pub statusword: Statusword,
    /// 6064h, as sampled by the device.
    pub position: Increments,
}

/// Why a statusword is not that of a drive that follows its setpoints.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotFollowing {
    /// State 8 or 9: the drive has an error and stops or has stopped.
    Fault,
    /// State 7: a quick stop that the controller did not ask for.
    QuickStop,
    /// States 2…5: the power stage is off.
    PowerStageOff,
    /// Bit 9 = 0: another access channel has control.
    NotRemote,
    /// The operating mode has ended.
    ModeEnded,
    /// Bit 13: an error has to be fixed before going on.
    Error,
}

impl fmt::Display for NotFollowing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Fault => "fault",
            Self::QuickStop => "quick stop active",
            Self::PowerStageOff => "power stage off",
            Self::NotRemote => "not under fieldbus control (statusword bit 9 = 0)",
            Self::ModeEnded => "operating mode ended (statusword bit 12 = 0)",
            Self::Error => "error pending (statusword bit 13)",
        })
    }
}

/// What every device on the bus has.
pub trait Device: fmt::Debug + Send + Sync {
    /// Its kind.
    fn model(&self) -> &'static Model;

    /// Its node id.
    fn node(&self) -> NodeId;

    /// The objects that tell this device from another, in the order to read them.
    fn identity(&self) -> &[Identity];

    /// The objects to log before a reset, which would wipe them: what stopped the drive last.
    fn history(&self) -> &[Address];

    /// The set-up writes, in order, to a device in NMT Pre-Operational after a reset of its
    /// communication.
    fn setup(&self) -> &[Write];

    /// The objects to read back after the set-up, with the value that each must have. One that
    /// refuses to be read is worth a log line, no more.
    fn read_back(&self) -> &[Write];

    /// Whether what was read is what `written` set, in the bits that the device has to keep.
    fn agrees(&self, written: &Write, read: &[u8]) -> bool;

    /// How to tell that the device's clock follows SYNC, if it has one that does.
    fn clock_lock(&self) -> Option<ClockLock>;

    /// The writes that take the set-up's cyclic part back, after the device is disabled.
    fn release(&self) -> &[Write];

    /// What the device adds to a cycle of its bus.
    fn traffic(&self) -> NodeTraffic;

    /// Longest time from the end of an SDO request until its answer stands in the device's
    /// transmit queue.
    fn sdo_response(&self) -> Duration;

    /// What a vendor error code (603Fh; EMCY bytes 6 and 7) means, where it is known.
    fn error_meaning(&self, code: u16) -> Option<&'static str>;
}

/// A device with a position.
pub trait Feedback: Device {
    /// The PDO that carries it.
    fn t_pdo(&self) -> Pdo;

    /// Decodes its data; `None` if they are too short.
    fn sample(&self, data: &[u8]) -> Option<Sample>;
}

/// A device that takes a position setpoint every cycle, latched at SYNC.
pub trait Actuator: Feedback {
    /// The operating mode that 6061h must show before motion.
    fn mode(&self) -> i8;

    /// The controlword bits that start the mode, on top of Enable Operation.
    fn start_mode(&self) -> u16;

    /// Whether the statusword says that the mode runs.
    fn mode_started(&self, statusword: Statusword) -> bool;

    /// Whether a drive that was enabled, in its mode if `started`, still follows.
    ///
    /// # Errors
    /// Why it does not.
    fn follows(&self, statusword: Statusword, started: bool) -> Result<(), NotFollowing>;

    /// The PDO that carries controlword and setpoint.
    fn r_pdo(&self) -> Pdo;

    /// Encodes controlword (6040h) and setpoint.
    ///
    /// # Errors
    /// If the setpoint does not fit the drive's 32 bits.
    fn command(&self, controlword: Controlword, setpoint: Increments) -> Result<Frame, OutOfRange>;

    /// Its T_PDO and R_PDO of one cycle in motion, at `position`: what the bus typically carries.
    ///
    /// # Errors
    /// If the position does not fit the drive's 32 bits.
    fn in_motion(&self, position: Increments) -> Result<[Frame; 2], OutOfRange>;

    /// Cycles from the SYNC that latches a setpoint until the drive's position reference has
    /// reached it.
    fn interpolation_delay(&self) -> u32;
}
