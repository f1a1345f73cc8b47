//! The machine file: buses, drives, axes, limits and supervision times of one machine, in TOML.
//!
//! Reading is strict, see [`syncline_strict_toml`]. `docs/machine-file.md` is the reference of
//! all keys.

mod axis;
mod compensation;
mod cross_coupling;
mod cutting;
mod dc_bus;
mod described;
mod encoder;
mod feed_forward;
mod files;
mod fits;
mod homing;
mod io_node;
mod limit_inputs;
mod names;
mod node;
mod path_forces;
mod probing;
mod read;
mod retraction;
mod shaper;
mod signals;
mod simulation;
mod spindle;
mod state_file;
mod user_code;
mod validation;

pub use compensation::{Compensation, LeadError};
pub use cross_coupling::CrossCoupling;
pub use cutting::Cut;
pub use encoder::{Encoder, Feedback, MEASURED};
pub use feed_forward::FeedForward;
pub use homing::{
    DriveHoming, HardStopSearch, Homing, HomingMethod, HomingPolicy, Square, SwitchSearch, TestMove,
};
pub use io_node::IoNode;
pub use node::{Node, Seat};
pub use path_forces::PathForces;
pub use probing::{ProbeCaptures, Probing, Touched};
pub(crate) use read::TURN;
pub use signals::{
    AnalogInput, AnalogOutput, AnalogSource, Input, InputMeaning, MOST_INPUTS, Output, OutputSwitch,
};
pub use simulation::{Carriage, FeedAxis, Gantry, HomeSwitches, Simulation};
pub(crate) use spindle::degrees_per_second;
pub use spindle::{SpinUp, Spindle, SpindleDrive};
pub use state_file::{Kept, MachineState, NotKept, OtherMark, StateError};
pub use user_code::UserCode;
pub use validation::Validation;

use std::{
    io,
    path::{Path, PathBuf},
    time::Duration,
};
use syncline_canopen::NodeId;
use syncline_drives::model::{
    Ability, Assumed, Device, Direction, Heartbeat, Increments, IoSettings, Model, Scaling,
    Settings, Write,
};
use syncline_drives::twin;
use syncline_gcode as gcode;
use syncline_strict_toml::{Invalid, SetError};
use syncline_trajectory::path::Retraction;
use syncline_trajectory::shaper::{Method, Shaper};
use thiserror::Error;

/// One machine, checked.
#[derive(Clone, Debug)]
pub struct Machine {
    /// For reports and messages.
    pub name: String,
    /// Base cycle: the SYNC period, and the time between two setpoints.
    pub cycle: Duration,
    /// The controller itself: its place on the bus, time-outs, supervision.
    pub controller: Controller,
    /// How closely programmed paths are followed.
    pub path: PathTolerances,
    /// How they are followed until a program says otherwise.
    pub path_mode: gcode::PathMode,
    /// In the order of the file, at least one.
    pub buses: Vec<Bus>,
    /// In the order of the file, at least one; each belongs to one axis.
    pub drives: Vec<Drive>,
    /// In the order of the file; each belongs to one axis.
    pub encoders: Vec<Encoder>,
    /// In the order of the file.
    pub io_nodes: Vec<IoNode>,
    /// In the order of the file, at least one.
    pub axes: Vec<Axis>,
    /// If the file says anything of it.
    pub spindle: Option<Spindle>,
    /// What holds for the homing of all axes.
    pub homing: HomingPolicy,
    /// What holds for probing.
    pub probing: Probing,
    /// What a simulated probe touches, if there is anything.
    pub touched: Touched,
    /// How its tools cut in a simulation, in the order of the file.
    pub cuts: Vec<Cut>,
    /// What comes upon the tool along the path of a program in a simulation, if a file says so.
    pub path_forces: Option<PathForces>,
    /// Drives whose DC buses are joined in a simulation, by their index.
    pub dc_buses: Vec<Vec<usize>>,
    /// What its setpoints go through on their way from the path to the drives.
    pub shaper: Shaper,
    /// What of a motion it shapes; `None`: what the mode of each move says.
    pub shaper_method: Option<Method>,
    /// How its axes go back to a path that they were jogged off; `None`: on a straight line.
    pub retraction: Option<Retraction>,
    /// What a run has to keep to pass.
    pub validation: Validation,
    /// In the order of the file.
    pub inputs: Vec<Input>,
    /// In the order of the file.
    pub analog_inputs: Vec<AnalogInput>,
    /// In the order of the file.
    pub outputs: Vec<Output>,
    /// In the order of the file.
    pub analog_outputs: Vec<AnalogOutput>,
    /// In the order of the file, each code once.
    pub user_codes: Vec<UserCode>,
    /// What the file says: each value by its table and its key, a number or none.
    pub values: Vec<(String, String, Option<f64>)>,
    /// All files that were read because its own names them, in the order of the file, each once: of each device that is
    /// described a description, then its data sheet; behind them the one with the forces upon the tool.
    pub files: Vec<PathBuf>,
    assumptions: Vec<(&'static Model, Assumed)>,
}

/// The controller's own settings.
#[derive(Clone, Debug)]
pub struct Controller {
    /// Its node id on every bus.
    pub node: NodeId,
    /// Time between two heartbeats, its own and the drives' alike.
    pub heartbeat: Duration,
    /// Time without a heartbeat after which the other side is lost, for both.
    pub heartbeat_timeout: Duration,
    /// Time for one SDO answer.
    pub sdo_timeout: Duration,
    /// How often an SDO without an answer is tried again.
    pub sdo_retries: u32,
    /// Time from reset communication to boot-up.
    pub boot_timeout: Duration,
    /// Time for a drive's clock to follow SYNC.
    pub sync_lock_timeout: Duration,
    /// Time for one change of a drive's state.
    pub state_timeout: Duration,
    /// T_PDOs missing in a row that are a fault.
    pub t_pdo_misses: u32,
    /// Where one axis is quick-stopped, all are.
    pub stop_together: bool,
    /// Time from SYNC to the setpoint burst; `None` takes it from the bus budget.
    pub setpoint_offset: Option<Duration>,
    /// How long before a fault the flight recorder keeps; zero: there is none.
    pub flight_recorder: Duration,
}

/// How far a path may leave what is programmed, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathTolerances {
    /// Under G61.
    pub exact: f64,
    /// Under G64 without P.
    pub blend: f64,
}

/// A CAN bus.
#[derive(Clone, Debug)]
pub struct Bus {
    /// As drives name it.
    pub name: String,
    /// bit/s.
    pub bitrate: u32,
    /// `sim`, or what to open.
    pub port: String,
}

/// A drive on a bus.
#[derive(Clone, Debug)]
pub struct Drive {
    /// As axes and messages name it.
    pub name: String,
    /// Index of its bus in [`Machine::buses`].
    pub bus: usize,
    /// Its node id, unique on the bus.
    pub node: NodeId,
    /// What it is.
    pub model: &'static Model,
    /// Index of its axis in [`Machine::axes`].
    pub axis: usize,
    /// Its axis's millimetres and its own increments.
    pub scaling: Scaling,
    /// Whether its digital inputs and outputs come with its position, and changes are told.
    pub signals: bool,
    /// It tells its position at every so many SYNCs.
    pub sync_divider: u8,
    /// Its T_PDOs tell its torque too, as no machine file asks: see [`Machine::tell_torque`].
    pub(crate) torque: bool,
    /// Written after the standard set-up, in this order.
    pub objects: Vec<Write>,
}

/// The longest cycle that a machine can have.
pub(crate) const LONGEST_CYCLE: Duration = Duration::from_secs(1);

/// Coordinates of a machine: one for each letter that a program has for an axis, in the order of
/// [`gcode::AxisLetter::ALL`].
pub const COORDINATES: usize = gcode::AxisLetter::ALL.len();

/// From one request for the position of a device that is asked by SDO to the next. Short against the time for which axes are
/// looked at to tell that they stand, so that what moves is not taken to rest.
pub(crate) const POLL: Duration = Duration::from_millis(20);

/// From one request for the state of such a drive to the next, which goes before one for its position.
pub(crate) const STATE_POLL: Duration = Duration::from_millis(50);

/// A place in machine coordinates, mm and degrees; 0 for the axes that the machine does not have.
pub type Position = [f64; COORDINATES];

/// An axis: one drive, or two for a gantry pair. Of A, B and C every mm is a degree.
#[derive(Clone, Debug)]
pub struct Axis {
    /// The program's letter, which is its name everywhere.
    pub letter: gcode::AxisLetter,
    /// Indices of its drives in [`Machine::drives`]; one, or two for a gantry pair.
    pub drives: Vec<usize>,
    /// mm per motor revolution.
    pub mm_per_revolution: f64,
    /// What it may be planned to do, and what is a fault.
    pub limits: AxisLimits,
    /// What its drives may be sent: what is planned, and what [compensating](Self::compensation) adds to it.
    pub sent_limits: AxisLimits,
    /// What its setpoints are corrected by.
    pub compensation: Option<Compensation>,
    /// How the sides of a gantry are coupled.
    pub cross_coupling: Option<CrossCoupling>,
    /// Whether the drives supervise [`AxisLimits::following_error`] too.
    pub drive_following_error: bool,
    /// Whether the drives supervise [`AxisLimits::position`] too.
    pub drive_soft_limits: bool,
    /// How it comes to know where it is.
    pub homing: Homing,
    /// The limit switches at its negative and at its positive end, by their places in [`Machine::inputs`].
    pub limit_inputs: [Vec<usize>; 2],
    /// What says where it is, beside its drives.
    pub feedback: Option<Feedback>,
    /// How its drives bring it to where it is sent.
    pub motion: Motion,
    /// What its drives are sent of the torque that they take, if they are.
    pub feed_forward: Option<FeedForward>,
    /// By how much its setpoints come later than they are planned, in the mean, by the `[shaper]`: s.
    pub shaped_by: f64,
    /// `unsupervised_stop = "hardware"`: the enable chain stops its drives where the controller dies and they
    /// do not notice.
    pub hardware_stops: bool,
    /// `position_loss_ms`: its position may be missing for so long, where the controller closes a loop about it; `None`:
    /// as long as any T_PDO may.
    pub position_loss: Option<Duration>,
    /// What its drives move when they are simulated; `None`: what each drive's model has.
    pub simulation: Option<Simulation>,
}

/// `motion`: how an axis gets to where a program sends it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// Along the path, setpoint by setpoint.
    Path,
    /// From rest to rest by a profile of its drive's own, while the path waits.
    PointToPoint,
}

/// The limits of an axis, as the machine file has them. Of A, B and C every mm is a degree.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisLimits {
    /// `soft_limits`: the machine positions that no setpoint leaves, least and greatest, mm.
    pub position: (f64, f64),
    /// `max_velocity`, mm/s.
    pub velocity: f64,
    /// `max_acceleration`, mm/s².
    pub acceleration: f64,
    /// `max_jerk`, mm/s³.
    pub jerk: f64,
    /// `following_error_limit`: between setpoint and actual position at the greatest velocity; more is a
    /// fault. mm.
    pub following_error: f64,
    /// `following_error_limit_at_rest`: the same at rest. mm.
    pub following_error_at_rest: f64,
    /// `skew_limit`: between the two sides of a gantry pair, `Some` for two drives; more is a
    /// fault. mm.
    pub skew: Option<f64>,
    /// `standstill_window`: how far an actual position may leave its place before the program
    /// starts, mm.
    pub standstill: f64,
}

impl AxisLimits {
    /// What the following error may be at a speed, mm: from that at rest in proportion to that at the greatest
    /// velocity.
    #[must_use]
    pub fn following_error_at(&self, speed: f64) -> f64 {
        let part = (speed / self.velocity).min(1.0);
        let at_rest = self.following_error_at_rest;
        at_rest + (self.following_error - at_rest) * part
    }

    /// How far the plan of the axis goes from a steady speed, mm/s, until it rests, mm: it slows down as it speeds up,
    /// on average at half of that speed.
    #[must_use]
    pub fn stopping_distance(&self, speed: f64) -> f64 {
        stopping_distance(speed, self.acceleration, self.jerk)
    }
}

/// The way from a steady speed, mm/s, to rest within an acceleration, mm/s², and a jerk, mm/s³: mm.
#[must_use]
pub fn stopping_distance(speed: f64, acceleration: f64, jerk: f64) -> f64 {
    let time = match speed * jerk < acceleration * acceleration {
        true => 2.0 * (speed / jerk).sqrt(),
        false => speed / acceleration + acceleration / jerk,
    };
    speed * time / 2.0
}

/// A machine file that cannot be used.
#[derive(Debug, Error)]
pub enum MachineError {
    /// It cannot be read.
    #[error("cannot read {}", file.display())]
    Read {
        /// The file as it was named.
        file: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// It is something else.
    #[error(
        "{} is no machine file, which is TOML: name the machine file first, then the program",
        file.display()
    )]
    NotToml {
        /// The file as it was named.
        file: PathBuf,
    },
    /// It does not describe a machine.
    #[error(transparent)]
    Invalid(#[from] Invalid),
    /// A value cannot be set in it.
    #[error("--set {0}")]
    Set(SetError),
}

impl Axis {
    /// How far it goes from a steady speed, mm/s, until it rests, mm: as far as its limits say, and by what the shaper has
    /// still to bring.
    #[must_use]
    pub fn stopping_distance(&self, speed: f64) -> f64 {
        self.limits.stopping_distance(speed) + speed * self.shaped_by
    }

    /// The limits as the machine file states them.
    #[must_use]
    pub fn stated_limits(&self) -> AxisLimits {
        AxisLimits {
            position: self.limits.position,
            ..self.sent_limits
        }
    }

    /// As programs and messages name it.
    #[must_use]
    pub fn name(&self) -> &'static str {
        self.letter.name()
    }

    /// Units of its position, velocity, acceleration and jerk.
    #[must_use]
    pub fn units(&self) -> [&'static str; 4] {
        self.letter.units()
    }

    /// The highest speed of its jogs, mm/s.
    #[must_use]
    pub fn fastest_jog(&self, referenced: bool) -> f64 {
        self.homing.fastest_jog(&self.limits, referenced)
    }

    /// Where its homing ends, mm; where that is not stated, the machine position nearest to zero that
    /// its soft limits allow.
    #[must_use]
    pub fn rest(&self) -> f64 {
        let (least, most) = self.limits.position;
        let homed = self.homing.final_position();
        homed.unwrap_or_else(|| 0f64.clamp(least, most))
    }

    /// Whether its drives cross play where it turns round.
    #[must_use]
    pub fn has_backlash(&self) -> bool {
        let compensation = self.compensation.as_ref();
        compensation.is_some_and(|it| it.backlash > 0.0)
    }

    /// Where a side of it, by its place in `drives`, stands when it is simulated with this seed and switched on, mm.
    #[must_use]
    pub fn stands(&self, side: usize, seed: u64) -> f64 {
        let simulation = self.simulation.as_ref();
        let stream = self.letter.index() as u64;
        let start = simulation.and_then(|simulation| simulation.start);
        let start = start.map_or_else(|| self.rest(), |it| it.drawn(seed, stream));
        let skew = simulation.filter(|_| side != 0);
        let skew = skew.map(|it| it.skew.drawn(seed, COORDINATES as u64 + stream));
        start + skew.unwrap_or_default()
    }

    /// Where the drive of that side stands then, mm: the side is where [`Self::stands`] says, its backlash aside.
    #[must_use]
    pub fn drive_stands(&self, side: usize, seed: u64) -> f64 {
        let there = self.stands(side, seed);
        let compensation = self.compensation.as_ref();
        there - compensation.map_or(0.0, |it| it.lead_error.at(there).0)
    }
}

impl Machine {
    /// By coordinate: whether its axis goes point to point.
    #[must_use]
    pub fn point_to_point(&self) -> [bool; COORDINATES] {
        let goes = |axis: &&Axis| axis.motion == Motion::PointToPoint;
        let mut point_to_point = [false; COORDINATES];
        for axis in self.axes.iter().filter(goes) {
            point_to_point[axis.letter.index()] = true;
        }
        point_to_point
    }

    /// Where the axes stand before the first program: where programs are checked from.
    #[must_use]
    pub fn rest(&self) -> Position {
        let mut rest = Position::default();
        for axis in &self.axes {
            rest[axis.letter.index()] = axis.rest();
        }
        rest
    }

    /// Reads and checks a machine file.
    ///
    /// # Errors
    /// If it cannot be read, or with everything that is wrong in it.
    pub fn load(file: &Path) -> Result<Self, MachineError> {
        Self::load_with(file, &[])
    }

    /// The same with other values of keys, each as [`set`](syncline_strict_toml::set) takes it:
    /// `axis.X.max_jerk=40000`. Messages show the text as it was changed.
    ///
    /// # Errors
    /// As [`load`](Self::load), or if a value cannot be set.
    pub fn load_with(file: &Path, settings: &[String]) -> Result<Self, MachineError> {
        let mut source = syncline_strict_toml::read(file).map_err(|source| MachineError::Read {
            file: file.into(),
            source,
        })?;
        // A person who takes one for the other does not want to hear of TOML's grammar.
        let named = file.extension().is_some_and(|name| name == "toml");
        if !named && source.parse::<toml::Table>().is_err() {
            return Err(MachineError::NotToml { file: file.into() });
        }
        for setting in settings {
            let set = syncline_strict_toml::set(&source, setting);
            source = set.map_err(MachineError::Set)?;
        }
        Ok(Self::parse(file, &source)?)
    }

    /// Checks a machine file's text; `file` names it in messages, and descriptions of devices are read from its
    /// folder.
    ///
    /// # Errors
    /// Everything that is wrong in it.
    pub fn parse(file: &Path, source: &str) -> Result<Self, Invalid> {
        let folder = file.parent().unwrap_or(Path::new(""));
        read::machine(folder, source).map_err(|diagnostics| Invalid {
            file: file.into(),
            diagnostics,
        })
    }

    /// Whether forces come upon the tool in a simulation.
    #[must_use]
    pub fn is_cutting(&self) -> bool {
        !self.cuts.is_empty() || self.path_forces.is_some()
    }

    /// All files that its own names, to be read or to be run.
    pub fn named_files(&self) -> impl Iterator<Item = &Path> {
        let commands = self.user_codes.iter().flat_map(|it| &it.command);
        let programs = commands.map(Path::new).filter(|it| it.is_absolute());
        self.files.iter().map(PathBuf::as_path).chain(programs)
    }

    /// All devices: the drives of axes, behind them the encoders, behind those the I/O nodes, behind all the drive of
    /// the spindle. Where all are alike, an index means a place in this list.
    pub fn nodes(&self) -> impl Iterator<Item = Node<'_>> {
        let drives = self.drives.iter().map(Node::from);
        let encoders = self.encoders.iter().map(Node::from);
        drives
            .chain(encoders)
            .chain(self.io_nodes.iter().map(Node::from))
            .chain(self.spindle_drive().map(|(_, drive)| Node::from(drive)))
    }

    /// The drive of the spindle, and its place among the [devices](Self::nodes).
    #[must_use]
    pub fn spindle_drive(&self) -> Option<(usize, &SpindleDrive)> {
        let place = self.drives.len() + self.encoders.len() + self.io_nodes.len();
        let drive = self.spindle.as_ref()?.drive.as_ref()?;
        Some((place, drive))
    }

    /// The [device](Self::nodes) with that index.
    ///
    /// # Panics
    /// If there is none.
    #[must_use]
    pub fn node(&self, index: usize) -> Node<'_> {
        self.nodes().nth(index).expect("an index of a device")
    }

    /// Has those drives of an axis that can tell their torque do so with their positions, which makes room for it in every cycle.
    pub fn tell_torque(&mut self, axis: usize) {
        for &drive in &self.axes[axis].drives {
            let drive = &mut self.drives[drive];
            drive.torque = drive.model.abilities.contains(&Ability::Torque);
        }
    }

    /// The output that closes the enable chain.
    #[must_use]
    pub fn enable_chain(&self) -> Option<&Output> {
        let mut outputs = self.outputs.iter();
        outputs.find(|output| output.switch == OutputSwitch::EnableChain)
    }

    /// What the motor of a drive feels of what it moves.
    #[must_use]
    pub fn at_shaft(&self, drive: usize, driven: &FeedAxis) -> twin::DrivenAxis {
        let spec = &self.drives[drive];
        let axis = &self.axes[spec.axis];
        let rotary = !axis.letter.is_linear();
        driven.at_shaft(&spec.scaling, axis.mm_per_revolution, rotary)
    }

    /// What the controller needs to know of the [device](Self::nodes) with that index.
    #[must_use]
    pub fn device(&self, index: usize) -> Device {
        self.device_in(index, self.cycle)
    }

    /// The same in another cycle.
    pub(crate) fn device_in(&self, index: usize, cycle: Duration) -> Device {
        let node = self.node(index);
        let common = Settings {
            node: node.id,
            cycle,
            velocity: 0.0,
            acceleration: 0.0,
            heartbeat: Heartbeat {
                controller: self.controller.node,
                producer: self.controller.heartbeat,
                consumer: self.controller.heartbeat_timeout,
            },
            following_error_limit: None,
            soft_limits: None,
            point_to_point: false,
            torque: false,
            torque_offset: None,
            profile_velocity: false,
            sync_divider: (index.checked_sub(self.drives.len()))
                .and_then(|encoder| self.encoders.get(encoder))
                .map_or(1, |encoder| encoder.sync_divider),
            io: self.io_settings(index),
            objects: node.objects.to_vec(),
            assumed: self.assumed(node.model),
        };
        node.model
            .device(&match (self.drives.get(index), &self.spindle) {
                (Some(drive), _) => self.drive_settings(drive, common),
                (None, Some(spindle))
                    if self.spindle_drive().is_some_and(|(at, _)| at == index) =>
                {
                    spindle.settings(common)
                }
                (None, _) => common,
            })
    }

    /// What is used of a device's inputs and outputs.
    fn io_settings(&self, index: usize) -> IoSettings {
        let bits =
            |signals: &mut dyn Iterator<Item = usize>| signals.fold(0, |bits, it| bits | 1 << it);
        let outputs = self.outputs.iter().filter(|output| output.node == index);
        let inputs = self.inputs.iter().filter(|input| input.node == index);
        let analog_inputs = (self.analog_inputs.iter()).filter(|input| input.node == index);
        let analog = (self.analog_outputs.iter()).filter(|output| output.node == index);
        let safe = outputs
            .clone()
            .filter(|output| output.safe != output.active_low);
        let io_node = index.checked_sub(self.drives.len() + self.encoders.len());
        IoSettings {
            signals: self.drives.get(index).is_some_and(|drive| drive.signals),
            inputs: bits(&mut inputs.map(|input| input.signal)),
            outputs: bits(&mut outputs.map(|output| output.signal)),
            safe: bits(&mut safe.map(|output| output.signal)),
            analog_inputs: bits(&mut analog_inputs.map(|input| input.place)),
            analog_outputs: analog
                .map(|output| (output.place, output.scaled(output.safe)))
                .collect(),
            by_event: (io_node.and_then(|io| self.io_nodes.get(io))).is_some_and(|io| io.by_event),
        }
    }

    fn drive_settings(&self, drive: &Drive, common: Settings) -> Settings {
        let axis = &self.axes[drive.axis];
        let scaling = &drive.scaling;
        Settings {
            velocity: scaling
                .to_increments_per_second(axis.sent_limits.velocity)
                .abs(),
            acceleration: scaling
                .to_increments_per_second(axis.sent_limits.acceleration)
                .abs(),
            following_error_limit: axis
                .drive_following_error
                .then(|| scaling.magnitude(axis.limits.following_error)),
            soft_limits: axis
                .drive_soft_limits
                .then(|| drive_soft_limits(&axis.sent_limits, scaling)),
            point_to_point: axis.motion == Motion::PointToPoint,
            torque: drive.torque,
            torque_offset: axis.feed_forward.as_ref().map(FeedForward::rated),
            sync_divider: drive.sync_divider,
            ..common
        }
    }

    /// What this machine's file says of a model where its manual is silent.
    #[must_use]
    pub fn assumed(&self, model: &Model) -> Assumed {
        assumed(&self.assumptions, model)
    }
}

/// What the file says of a model.
fn assumed(assumptions: &[(&'static Model, Assumed)], model: &Model) -> Assumed {
    let mut models = assumptions.iter();
    let found = models.find(|(of, _)| of.name == model.name);
    found.map_or_else(Assumed::default, |(_, assumed)| assumed.clone())
}

/// The soft limits as a drive supervises them: its actual position follows the setpoint only to
/// within the following error, so they stand that much further out.
fn drive_soft_limits(limits: &AxisLimits, scaling: &Scaling) -> (Increments, Increments) {
    let (least, most) = limits.position;
    let widened = [
        least - limits.following_error,
        most + limits.following_error,
    ];
    // Beyond what the drive can count there is nothing to supervise.
    let end = |mm, otherwise| scaling.to_increments(mm).unwrap_or(otherwise);
    let (least, most) = match scaling.direction() {
        Direction::Positive => (widened[0], widened[1]),
        Direction::Negative => (widened[1], widened[0]),
    };
    (end(least, Increments::MIN), end(most, Increments::MAX))
}
