//! What the controller knows of each device: identity, set-up, PDOs, scaling, faults.
//!
//! - [`RemoteNode`]: what every device has
//! - [`Feedback`]: it tells a position
//! - [`Drive`]: it moves an axis
//! - [`Io`]: it has inputs and outputs
//! - [`IoNode`]: it has nothing else
//!
//! A [`Model`] is what is known before a device is made: its name, the cycles and bit rates it
//! takes, and what its manual leaves open ([`Assumption`]). [`MODELS`] is the one list of them. The
//! controller goes by these and never asks which model stands behind them: what is said and told in
//! a model's own words, a controlword or a maker's EMCY bytes, is said and read in its file, or in
//! `profile` where models share it.
//!
//! A new model is a file here with a [`Model`], and a line in [`MODELS`]. One that differs from a generic model in
//! its data sheet and its numbers alone needs neither: it is [described](Model::described).

mod capture;
mod cia401;
mod cia402_csp;
mod cia402_csv;
mod cia402_vl;
mod cia406;
mod described;
mod drive;
mod feedback;
mod io;
mod lxm32m;
mod mapping;
mod node;
mod object;
mod profile;
mod scaling;
mod tlc5xx;
mod torque;
mod tsp10;
mod twk_crn;

pub use capture::{Capture, CaptureInput};
pub use described::{Description, Lack};
pub use drive::{
    Drive, DriveStatus, Dynamics, IndexDistance, LoopGains, ModeDisplay, NotFollowing, OwnHoming,
    PowerCommand, PowerState, Setpoint, StatusWord, Survey,
};
pub use feedback::{Feedback, Sample, unwrapped};
pub use io::{ANALOG_INPUTS, Io, IoNode, IoSettings};
pub use mapping::Mapping;
pub use node::{ClockLock, Identity, Marks, Monitoring, NodeSpec, RemoteNode};
pub use object::{Data, Write};
pub use scaling::{Direction, Increments, OutOfRange, Scaling};
pub use syncline_canopen::Address;
pub use torque::TorqueLimit;

use core::{
    ops::{Deref, RangeInclusive},
    time::Duration,
};
use std::sync::Arc;
use syncline_canopen::{CanId, Frame, NodeId, dictionary::Entry};

/// Every model that a machine file may name, in the order in which messages list them.
pub static MODELS: &[&Model] = &[
    &lxm32m::LXM32M,
    &cia402_csp::CIA402_CSP,
    &cia402_csv::CIA402_CSV,
    &cia402_csv::CIA402_PV,
    &twk_crn::TWK_CRN,
    &tlc5xx::TLC5XX,
    &cia401::CIA401,
    &cia406::CIA406,
    &tsp10::TSP10,
    &cia402_vl::CIA402_VL,
];

/// Node ids of CiA 301.
pub(crate) const NODES: RangeInclusive<u8> = 1..=127;

/// A kind of device: everything that is known before one is made.
#[derive(Clone, Debug)]
pub struct Model {
    /// As a machine file writes it: `lxm32m`.
    pub name: &'static str,
    /// As its maker writes it: `LXM32M`.
    pub title: &'static str,
    /// Who makes it; `None`: whoever follows the profile.
    pub maker: Option<&'static str>,
    /// Bit rates in bit/s, ascending.
    pub bitrates: &'static [u32],
    /// Node ids that it can have.
    pub nodes: RangeInclusive<u8>,
    /// The cycle is a whole multiple of this …
    pub cycle_step: Duration,
    /// … within this range.
    pub cycles: RangeInclusive<Duration>,
    /// How many of the increments in which it takes and tells positions, once it is set up, are one
    /// revolution of its motor; with what the machine file says of the model.
    pub increments_per_revolution: fn(&Assumed) -> u32,
    /// The positions that it can be sent to: what its setpoint's object holds.
    pub positions: RangeInclusive<Increments>,
    /// What it can do besides.
    pub abilities: &'static [Ability],
    /// The model that it is an instance of, if a [`Description`] states it.
    pub generic: Option<&'static Self>,
    /// What its R_PDO is sent for objects that the maker has mapped into it besides what it is driven by, as a
    /// [`Description`] states it.
    pub r_pdo_values: &'static [(Address, i64)],
    /// What the manual leaves open, with the value taken unless the machine file says otherwise: its own, and groups that it
    /// shares with other models.
    pub assumptions: &'static [&'static [Assumption]],
    /// Those of its assumptions of whose range certain values alone make sense, by name.
    pub choices: &'static [(&'static str, &'static [u32])],
    /// Its object dictionary.
    pub dictionary: &'static [Entry],
    /// Whether the controller itself writes or owns the object, so that a user must not.
    pub reserved: fn(Address) -> bool,
    /// Its digital inputs, by the names that its manual has for them.
    pub inputs: &'static [&'static str],
    /// Its digital outputs that the controller can set. Both are its signals: they come with its
    /// T_PDOs where [`Settings::io`] asks for them, the inputs first.
    pub outputs: &'static [&'static str],
    /// Its analog inputs, by the names that its manual has for them.
    pub analog_inputs: &'static [&'static str],
    /// Its analog outputs, likewise.
    pub analog_outputs: &'static [&'static str],
    /// Those of its digital inputs at whose edges it keeps its position.
    pub captures: &'static [CaptureInput],
    /// The methods by which it homes by itself, see [`Drive::homing`], as its manual numbers them.
    pub homing_methods: &'static [u8],
    /// How its torque is limited; `None` if it cannot be.
    pub torque_limit: Option<TorqueLimit>,
    /// Makes the device.
    pub make: Make,
}

/// How a device of a model is made, by what it does for a machine.
#[derive(Clone, Copy, Debug)]
pub enum Make {
    /// It moves an axis or turns a spindle, and is sent this in every cycle. The model, here and below, is the one whose device is made.
    Drive(Setpoints, fn(&'static Model, &Settings) -> Box<dyn Drive>),
    /// It tells where something is, and no more.
    Encoder(fn(&'static Model, &Settings) -> Arc<dyn Feedback>),
    /// It has inputs and outputs, and no more.
    Io(fn(&Settings) -> Box<dyn IoNode>),
}

/// A device, by what it does for a machine.
#[derive(Clone, Debug)]
pub enum Device {
    /// It moves an axis.
    Drive(Box<dyn Drive>),
    /// It tells where something is, and no more.
    Encoder(Arc<dyn Feedback>),
    /// It has inputs and outputs, and no more.
    Io(Box<dyn IoNode>),
}

impl Device {
    /// The device as a drive, if it is one.
    #[must_use]
    pub fn drive(&self) -> Option<&dyn Drive> {
        match self {
            Self::Drive(drive) => Some(&**drive),
            Self::Encoder(_) | Self::Io(_) => None,
        }
    }

    /// The same, to tell it something.
    pub fn drive_mut(&mut self) -> Option<&mut dyn Drive> {
        match self {
            Self::Drive(drive) => Some(&mut **drive),
            Self::Encoder(_) | Self::Io(_) => None,
        }
    }

    /// What tells where something is, if it does.
    #[must_use]
    pub fn feedback(&self) -> Option<&dyn Feedback> {
        match self {
            Self::Drive(drive) => Some(&**drive),
            Self::Encoder(encoder) => Some(&**encoder),
            Self::Io(_) => None,
        }
    }

    /// Whether its T_PDOs tell its torque, as they do where [`Settings::torque`] asks for it and they can.
    #[must_use]
    pub fn tells_torque(&self) -> bool {
        let Some(drive) = self.drive() else {
            return false;
        };
        let mut t_pdos = drive.spec().t_pdos.iter().enumerate();
        t_pdos.any(|(at, pdo)| drive.torque(at, &vec![0; pdo.bytes.into()]).is_some())
    }

    /// Whether it is sent torques with its setpoints, as it is where [`Settings::torque_offset`] asks for it and its R_PDO
    /// has room for them.
    #[must_use]
    pub fn takes_torque(&self) -> bool {
        let mapped = self.mapped().into_iter();
        let mut objects = mapped
            .filter(|it| it.is_received())
            .flat_map(Mapping::needed);
        self.drive().is_some() && objects.any(|it| it == profile::cia402::TORQUE_OFFSET)
    }

    /// An R_PDO of it without the torque that it brings, if it does; `None` if the frame is none.
    #[must_use]
    pub fn without_torque(&self, frame: &Frame) -> Option<Frame> {
        let received = self.mapped().into_iter().filter(|it| it.is_received());
        let mut r_pdos = self.spec().r_pdos.iter().zip(received);
        let (r_pdo, mapping) = r_pdos.find(|(it, _)| frame.id() == CanId::from(it.cob_id))?;
        let data = mapping.without(profile::cia402::TORQUE_OFFSET, frame.data());
        Some(Frame::new(r_pdo.cob_id, &data[..frame.data().len()]))
    }

    /// Its inputs and outputs, if its PDOs carry them.
    #[must_use]
    pub fn io(&self) -> Option<&dyn Io> {
        match self {
            Self::Drive(drive) => drive.io(),
            Self::Encoder(_) => None,
            Self::Io(io) => Some(&**io),
        }
    }

    /// The same, to set its outputs.
    pub fn io_mut(&mut self) -> Option<&mut dyn Io> {
        match self {
            Self::Drive(drive) => drive.io_mut(),
            Self::Encoder(_) => None,
            Self::Io(io) => Some(&mut **io),
        }
    }
}

/// What all have in common.
impl Deref for Device {
    type Target = dyn RemoteNode;

    fn deref(&self) -> &Self::Target {
        match self {
            Self::Drive(drive) => &**drive,
            Self::Encoder(encoder) => &**encoder,
            Self::Io(io) => &**io,
        }
    }
}

/// What drives are sent in every cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Setpoints {
    /// Where to be.
    Positions,
    /// How fast to turn, see [`Dynamics`].
    Velocities,
    /// How fast to turn a spindle, by ramps of its own. It tells how fast it turns ([`Drive::speed`]), and no position.
    Speeds,
}

/// Something that some drives can do and others cannot, which a machine file may ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ability {
    /// It faults at a following error of its own limit, [`Settings::following_error_limit`].
    FollowingErrorLimit,
    /// It faults beyond positions of its own, [`Settings::soft_limits`].
    SoftLimits,
    /// It goes to targets by a profile of its own, [`Settings::point_to_point`].
    PointToPoint,
    /// Its T_PDOs can tell its torque, [`Settings::torque`].
    Torque,
    /// Its loops add a torque that it is sent with its setpoints, [`Settings::torque_offset`].
    TorqueOffset,
    /// Its T_PDOs can answer every so many SYNCs while its setpoints come with each, [`Settings::sync_divider`]. What has to be
    /// seen to take each of its setpoints cannot.
    SyncDivider,
    /// It turns at the velocities that it is sent, to which it goes by ramps of its own, [`Settings::profile_velocity`].
    ProfileVelocity,
    /// Its encoder may tell its place within a turn from power-on, so that its count is a whole number of turns at the index. No
    /// manual says so: a machine file states it with `index`.
    CountsWithinTurn,
}

/// The model that measurements are made with where none is named, so that they can be compared.
pub static REFERENCE: &Model = &lxm32m::LXM32M;

impl Model {
    /// The model of that name.
    #[must_use]
    pub fn by_name(name: &str) -> Option<&'static Self> {
        MODELS.iter().copied().find(|model| model.name == name)
    }

    /// Its assumption of that name.
    #[must_use]
    pub fn assumption(&self, name: &str) -> Option<&'static Assumption> {
        let mut assumptions = self.assumptions.iter().copied().flatten();
        assumptions.find(|assumption| assumption.name == name)
    }

    /// The values that alone make sense of its assumption of that name; `None`: all of its range do.
    #[must_use]
    pub fn choices(&self, name: &str) -> Option<&'static [u32]> {
        let mut choices = self.choices.iter();
        choices
            .find(|(of, _)| *of == name)
            .map(|(_, values)| *values)
    }

    /// A device of this model.
    #[must_use]
    pub fn device(&'static self, settings: &Settings) -> Device {
        match self.make {
            Make::Drive(_, make) => Device::Drive(make(self, settings)),
            Make::Encoder(make) => Device::Encoder(make(self, settings)),
            Make::Io(make) => Device::Io(make(settings)),
        }
    }

    /// Whether its devices are drives.
    #[must_use]
    pub fn is_drive(&self) -> bool {
        matches!(self.make, Make::Drive(..))
    }

    /// Whether its devices can move an axis.
    #[must_use]
    pub fn moves_axes(&self) -> bool {
        self.is_drive() && !self.is_sent(Setpoints::Speeds)
    }

    /// Whether its devices can turn a spindle.
    #[must_use]
    pub fn turns_spindles(&self) -> bool {
        self.is_sent(Setpoints::Speeds) || self.abilities.contains(&Ability::ProfileVelocity)
    }

    /// Whether its devices are drives that are sent that in every cycle.
    #[must_use]
    pub fn is_sent(&self, setpoints: Setpoints) -> bool {
        matches!(self.make, Make::Drive(sent, _) if sent == setpoints)
    }

    /// Whether its devices tell where something is, and no more.
    #[must_use]
    pub fn is_encoder(&self) -> bool {
        matches!(self.make, Make::Encoder(_))
    }

    /// Whether its devices have inputs and outputs, and no more.
    #[must_use]
    pub fn is_io(&self) -> bool {
        matches!(self.make, Make::Io(_))
    }

    /// The name of its signal at that place.
    #[must_use]
    pub fn signal(&self, place: usize) -> Option<&'static str> {
        self.inputs.iter().chain(self.outputs).nth(place).copied()
    }

    /// How its devices keep their position where the input at that place comes on, or goes off; `None` if none of
    /// their captures sees it.
    #[must_use]
    pub fn capture(&self, input: usize, rising: bool) -> Option<&'static Capture> {
        let capture = self.captures.iter().find(|it| it.input == input)?;
        Some(match rising {
            true => &capture.rising,
            false => &capture.falling,
        })
    }

    /// Whether the drive takes setpoints in this cycle.
    #[must_use]
    pub fn takes_cycle(&self, cycle: Duration) -> bool {
        self.cycles.contains(&cycle) && cycle.as_nanos().is_multiple_of(self.cycle_step.as_nanos())
    }
}

/// A fact that the manual at hand leaves open: it has a name, so that a machine file can state it
/// as the real drive has it.
#[derive(Debug, PartialEq)]
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
    /// Greatest velocity that the plan has for its axis, or a program for its spindle, increments/s.
    pub velocity: f64,
    /// Greatest acceleration that it has, increments/s².
    pub acceleration: f64,
    /// Connection monitoring both ways.
    pub heartbeat: Heartbeat,
    /// Following error at which the drive itself faults; `None` leaves the drive's own. Asked of
    /// those with [`Ability::FollowingErrorLimit`] only.
    pub following_error_limit: Option<Increments>,
    /// Positions beyond which the drive itself faults; `None` leaves the drive's own. Asked of those
    /// with [`Ability::SoftLimits`] only.
    pub soft_limits: Option<(Increments, Increments)>,
    /// Its axis goes point to point: the drive is sent targets, to which it goes by a profile of its own
    /// ([`Drive::profile`]). Asked of those with [`Ability::PointToPoint`] only.
    pub point_to_point: bool,
    /// Its T_PDOs tell its actual torque too ([`Drive::torque`]). Asked of those with [`Ability::Torque`] only.
    pub torque: bool,
    /// What its loops ask for is sent it in advance, with each setpoint, where its motor has that rated torque,
    /// thousandths of N·m ([`Setpoint::torque`]). Asked of those with [`Ability::TorqueOffset`] only.
    pub torque_offset: Option<u32>,
    /// It turns a spindle: the drive goes to the velocities that it is sent by ramps of its own with
    /// [`acceleration`](Self::acceleration), and counts on as long as it turns. Asked of those with
    /// [`Ability::ProfileVelocity`] only.
    pub profile_velocity: bool,
    /// It answers every so many SYNCs, the transmission type of its T_PDOs: 1…240. Asked of encoders, and of
    /// drives with [`Ability::SyncDivider`].
    pub sync_divider: u8,
    /// What is used of its inputs and outputs.
    pub io: IoSettings,
    /// Written after the standard set-up, in this order.
    pub objects: Vec<Write>,
    /// What the machine file says of the model.
    pub assumed: Assumed,
}

impl Settings {
    /// The standard set-up and nothing else, for a device that is asked for a heartbeat every 100 ms by a
    /// controller with node id 127.
    ///
    /// # Panics
    /// Never: 127 is a node id.
    #[must_use]
    pub fn new(node: NodeId, cycle: Duration) -> Self {
        Self {
            node,
            cycle,
            velocity: 0.0,
            acceleration: 0.0,
            heartbeat: Heartbeat {
                controller: NodeId::new(127).expect("a node id"),
                producer: Duration::from_millis(100),
                consumer: Duration::from_millis(250),
            },
            following_error_limit: None,
            soft_limits: None,
            point_to_point: false,
            torque: false,
            torque_offset: None,
            profile_velocity: false,
            sync_divider: 1,
            io: IoSettings::default(),
            objects: Vec::new(),
            assumed: Assumed::default(),
        }
    }
}

/// Values of a model's [`Assumption`]s that differ from the default, by name.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Assumed(pub Vec<(&'static str, u32)>);

impl Assumed {
    /// The value that holds for `assumption`.
    #[must_use]
    pub fn value(&self, assumption: &Assumption) -> u32 {
        self.0
            .iter()
            .find(|(name, _)| *name == assumption.name)
            .map_or(assumption.default, |(_, value)| *value)
    }

    /// The time that holds for `assumption`, which counts in microseconds.
    fn time(&self, assumption: &Assumption) -> Duration {
        Duration::from_micros(self.value(assumption).into())
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
