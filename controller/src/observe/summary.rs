//! The result of a run, for programs (`--json`) and for people.

use super::circles::CircleSummary;
use super::cutting::CuttingSummary;
use super::gantry::GantrySummary;
use super::limits::AxisWatches;
use super::loops::LoopSummary;
use super::operations::{Operation, ToolTime};
use super::places::{SlowestPlace, WorstPlace};
use super::positioning::Positioning;
use super::provenance::Provenance;
use super::record::{Place, Violation};
use super::supply::SupplySummary;
use super::switched::SwitchedState;
use crate::counted::counted;
use crate::program::bounds::{BoundShare, STEP, TimeBounds};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;

/// The result of a run, as `--json` writes it.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// `pass`, `fail`, or `interrupted` where nothing was wrong until an operator stopped it.
    pub verdict: &'static str,
    /// How the run ended, in words.
    pub outcome: String,
    /// Where it stopped, if it did not come to its end.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stopped: Option<Stopped>,
    /// The seed of a simulated run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// Where the result is from; of what a command did.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub provenance: Option<Provenance>,
    /// Why an axis did not follow, where that was looked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cause: Option<Cause>,
    /// From the first to the last motion, with all that is between, s.
    pub duration_s: f64,
    /// What the time went into, all of it.
    pub times: Times,
    /// What bounds the time of motion, where that was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_bounds: Option<TimeBounds>,
    /// Cycles while the program ran.
    pub cycles: u64,
    /// Bursts that missed their SYNC.
    pub late_setpoints: u64,
    /// Digest of all frames of the simulated buses; see [`super::frames::FrameLog`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frames_sha256: Option<String>,
    /// The path.
    pub path: PathSummary,
    /// The buses.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub bus: Vec<BusSummary>,
    /// The axes.
    pub axes: Vec<AxisSummary>,
    /// The drives, where all are simulated.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub drives: Vec<DriveSummary>,
    /// The axes with two drives, where those are simulated.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub gantries: Vec<GantrySummary>,
    /// How the structure swayed along axes whose simulation says how it can.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub structures: Vec<StructureSummary>,
    /// How far what the drives move was from where they say, along axes whose simulation says what is between the two.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub transmissions: Vec<TransmissionSummary>,
    /// The circular test on each turn round a full circle of the program: the first 10,000.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub circles: Vec<CircleSummary>,
    /// Further turns.
    #[serde(skip_serializing_if = "is_zero")]
    pub circles_left_off: u64,
    /// With which force tools cut, where the simulation says how they do.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cutting: Option<CuttingSummary>,
    /// The loops of simulated servo drives, as they are set in the end, in a validation.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub loops: Vec<LoopSummary>,
    /// The time of motion with each tool and each speed of the spindle, in order, where there is either: the first
    /// 10,000 operations.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub operations: Vec<Operation>,
    /// Further operations.
    #[serde(skip_serializing_if = "is_zero")]
    pub operations_left_off: u64,
    /// The time of motion with each tool, where there is one or a spindle.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub tools: Vec<ToolTime>,
    /// Where the tool was furthest from the path, worst first: at most 100 places.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub worst_places: Vec<WorstPlace>,
    /// The blocks that lost most time against their programmed feed, worst first: at most 100.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub slowest_places: Vec<SlowestPlace>,
    /// What M-codes switched, in order: the first 10,000 changes.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub switched: Vec<SwitchedState>,
    /// Further changes.
    #[serde(skip_serializing_if = "is_zero")]
    pub switched_left_off: u64,
    /// What must not be: the first 10,000.
    pub violations: Vec<Violation>,
    /// Further violations.
    #[serde(skip_serializing_if = "is_zero")]
    pub violations_left_off: u64,
}

/// Where a run stopped that did not come to its end.
#[derive(Clone, Debug, Serialize)]
pub struct Stopped {
    /// The line of the block at work; 0 before the first.
    pub line: u32,
    /// The axis whose fault it was, or a drive of it had.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axis: Option<&'static str>,
    /// It may have been that this axis did not follow.
    #[serde(skip)]
    pub may_lag: bool,
    /// A setpoint of samples that others have planned was beyond a limit, and was not sent.
    #[serde(skip_serializing_if = "is_zero")]
    pub sample_refused: bool,
    /// Where each axis was seen last that has a reference, machine coordinates, mm or degrees.
    pub position: BTreeMap<&'static str, f64>,
    /// The axes that have none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unreferenced: Vec<&'static str>,
    /// What is left of the program, as F counts it, mm; nothing where it was not read before.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left_mm: Option<f64>,
    /// What is left where A, B and C turn alone, degrees.
    #[serde(skip_serializing_if = "is_zero")]
    pub left_deg: f64,
}

impl Summary {
    /// Whether all that is wrong is that the controller refused a sample that others have planned.
    #[must_use]
    pub fn refused_a_sample_alone(&self) -> bool {
        let refused = self.stopped.as_ref().is_some_and(|it| it.sample_refused);
        refused && (self.violations.iter()).all(|it| it.what.starts_with("fault: "))
    }
}

/// Why an axis did not follow: what alone lets it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cause {
    /// `gains`, `structure`, `motor`, `transmission` or `load`; `several` where none of them alone helps.
    pub what: &'static str,
    /// The axis.
    pub axis: String,
    /// What there is, in words with its figures.
    pub now: String,
    /// Values of keys of the machine file with which it follows, as `--set` takes them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub follows_with: Vec<String>,
    /// Greatest torque of a drive of the axis then, N·m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_torque_then: Option<f64>,
}

/// What the time of a run went into, s. A cycle in which a move begins or ends is motion.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Times {
    /// The path moved, or a thread was cut.
    pub motion_s: f64,
    /// Dwells of the program (G4).
    pub dwell_s: f64,
    /// Rest until an operator went on: feed holds, program stops, tool changes.
    pub waiting_s: f64,
    /// Rest until the machine was as a block asked for: its spindle at speed, oriented or even enough for a thread, an input there, a command of the
    /// user's ended.
    pub awaiting_s: f64,
    /// Axes were off the path, but for threads.
    pub jogging_s: f64,
    /// Rest before the first motion or in between, until there was a plan.
    pub planning_s: f64,
    /// Rest in the end of a job, until the axes were in position, or before it, until what they are sent beside the plan had come to rest.
    pub settling_s: f64,
    /// Rest while no job was at work.
    pub idle_s: f64,
}

impl Times {
    /// All of it, s.
    #[must_use]
    pub fn sum(&self) -> f64 {
        let moving = self.motion_s + self.jogging_s;
        let resting = self.dwell_s + self.waiting_s + self.awaiting_s;
        moving + resting + self.planning_s + self.settling_s + self.idle_s
    }

    /// All but motion, as a person reads it; nothing where there is none.
    #[must_use]
    pub fn others(&self) -> String {
        let others = [
            ("dwells", self.dwell_s),
            ("waiting for an operator", self.waiting_s),
            ("waiting for the machine", self.awaiting_s),
            ("jogging", self.jogging_s),
            ("waiting for a plan", self.planning_s),
            ("settling", self.settling_s),
            ("without a job", self.idle_s),
        ];
        let others = others.into_iter().filter(|(_, time)| *time > 0.0);
        let others: Vec<_> = others
            .map(|(what, time)| format!("{what} {time:.3} s"))
            .collect();
        others.join(", ")
    }
}

/// The path of a run.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct PathSummary {
    /// Programmed length run, as F counts it, mm.
    pub length_mm: f64,
    /// Angle run where A, B and C turned alone, degrees.
    #[serde(skip_serializing_if = "is_zero")]
    pub turned_deg: f64,
    /// Greatest distance of a setpoint from the programmed geometry, mm.
    pub max_deviation_mm: f64,
    /// Where that was.
    pub max_deviation_at: Place,
    /// Greatest distance of an actual position from the programmed geometry, mm.
    pub max_contour_error_mm: f64,
    /// Where that was.
    pub max_contour_error_at: Place,
    /// Greatest distance of an actual position from the path of the setpoints, mm: what the drives add to
    /// what rounding makes.
    pub max_drive_deviation_mm: f64,
    /// Where that was.
    pub max_drive_deviation_at: Place,
    /// Greatest circular deviation of a turn round a full circle of the program, mm; nothing of one that has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_circular_deviation_mm: Option<f64>,
}

fn is_zero<T: Default + PartialEq>(number: &T) -> bool {
    *number == T::default()
}

/// Says how many of a list are left off, if any are.
fn left_off(f: &mut fmt::Formatter<'_>, count: u64, of: &str) -> fmt::Result {
    if count > 0 {
        writeln!(f, "{:<18} {count} more {of}", "")?;
    }
    Ok(())
}

impl PathSummary {
    /// How long it was, as a person reads it.
    #[must_use]
    pub fn length(&self) -> String {
        let turned = match self.turned_deg {
            0.0 => String::new(),
            degrees => format!(" and {degrees:.3} °"),
        };
        format!("{:.3} mm{turned}", self.length_mm)
    }

    /// The contour error and its parts, as a person reads it.
    #[must_use]
    pub fn contour_error(&self) -> String {
        // What is none has no place.
        let part = |value: f64, at: Place| match value {
            0.0 => "none".to_owned(),
            _ => format!("{value:.4} mm in {at}"),
        };
        format!(
            "max {}; of rounding {}, of the drives {}",
            part(self.max_contour_error_mm, self.max_contour_error_at),
            part(self.max_deviation_mm, self.max_deviation_at),
            part(self.max_drive_deviation_mm, self.max_drive_deviation_at)
        )
    }
}

/// A bus during a run.
#[derive(Clone, Debug, Serialize)]
pub struct BusSummary {
    /// As the machine file names it.
    pub name: String,
    /// Bits of the busiest interval from SYNC to SYNC by the bits of a cycle.
    pub peak_utilisation: f64,
}

/// An axis during a run: how it was moved, mm/s, mm/s², mm/s³, and how the drives followed.
#[derive(Clone, Debug, Serialize)]
pub struct AxisSummary {
    /// As the machine file names it.
    pub name: String,
    /// Of its positions: `mm`, or `°`, as which every mm below counts then.
    pub unit: &'static str,
    /// Greatest velocity, as planned and as sent, at the cycles and by differences between them, mm/s.
    pub max_velocity: f64,
    /// The same of acceleration, mm/s².
    pub max_acceleration: f64,
    /// The same of jerk, mm/s³.
    pub max_jerk: f64,
    /// mm/s
    pub velocity_limit: f64,
    /// mm/s²
    pub acceleration_limit: f64,
    /// mm/s³
    pub jerk_limit: f64,
    /// Following error at which the run is stopped, mm.
    pub following_error_limit_mm: f64,
    /// Greatest absolute following error, mm.
    pub max_following_error_mm: f64,
    /// Where that was.
    pub max_following_error_at: Place,
    /// Root mean square of the following error, mm.
    pub rms_following_error_mm: f64,
    /// Its moves, if it goes point to point and made one. Its following error is that at rest then.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub positioning: Option<PositioningSummary>,
}

/// The moves of an axis that goes point to point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PositioningSummary {
    /// How many came to their target.
    pub moves: u64,
    /// The longest, from where it set off until it was seen to rest at its target, s.
    pub longest_s: f64,
    /// Where that ended.
    pub longest_at: Place,
    /// Greatest distance from the target where it rested, mm.
    pub max_error_mm: f64,
    /// Where that was.
    pub max_error_at: Place,
    /// Where it came to rest last, mm.
    pub position_mm: f64,
}

/// What a simulated drive was asked for, once a cycle.
#[derive(Clone, Debug, Serialize)]
pub struct DriveSummary {
    /// As the machine file names it.
    pub name: String,
    /// Greatest torque, N·m.
    pub max_torque: f64,
    /// Where that was.
    pub max_torque_at: Place,
    /// Most that its motor has, N·m.
    pub peak_torque: f64,
    /// What part of that was left.
    pub torque_reserve: f64,
    /// Root mean square of the torque, N·m: what the motor is heated by where the program runs over and over.
    pub rms_torque: f64,
    /// What the motor stands forever, N·m.
    pub continuous_torque: f64,
    /// After which time its torque is limited to that, from cold, where the program runs over and over, s; nothing where it
    /// never is, or where the motor is not described.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub limited_after_s: Option<f64>,
    /// What its power stage was loaded with, if it is simulated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub supply: Option<SupplySummary>,
    /// Greatest speed, 1/min.
    pub max_speed_rpm: f64,
    /// What part was left of the speed at which its voltage is used up, if its power stage is simulated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed_reserve: Option<f64>,
    /// How far its axis fell as it was switched off in the end, mm or degrees; in a validation, of an axis with a weight.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drop: Option<f64>,
    /// Of that: `mm`, or `°`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drop_unit: Option<&'static str>,
}

/// How the structure of the machine swayed along an axis, between tool and workpiece.
#[derive(Clone, Debug, Serialize)]
pub struct StructureSummary {
    /// The axis.
    pub axis: &'static str,
    /// How far the tool was off by it at most, mm.
    pub max_sway_mm: f64,
    /// Where that was.
    pub max_sway_at: Place,
    /// Greatest amplitude with which the tool swung on once the axis had rested for a period of the slowest mode, mm.
    pub max_residual_mm: f64,
    /// Where that was.
    pub max_residual_at: Place,
    /// How far a steady force at the tool bends it, µm/N.
    pub static_compliance: f64,
    /// Where a force that swings bends it most.
    pub worst_compliance: Compliance,
    /// The compliance over frequency.
    pub response: Vec<Compliance>,
}

/// How far what the drives of an axis move was from where they say, by twist, play, lead error and expansion.
#[derive(Clone, Debug, Serialize)]
pub struct TransmissionSummary {
    /// The axis.
    pub axis: &'static str,
    /// `mm`, or `°`.
    pub unit: &'static str,
    /// At most, from where it was at the first SYNC, mm or degrees.
    pub max_off_mm: f64,
    /// Where that was.
    pub max_off_at: Place,
}

impl fmt::Display for TransmissionSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            unit,
            max_off_mm: off,
            max_off_at: at,
            ..
        } = self;
        write!(f, "load up to {off:.4} {unit} off its motor in {at}")
    }
}

/// How far a force that swings with a frequency bends a structure.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Compliance {
    /// Hz.
    pub frequency: f64,
    /// µm/N.
    pub um_per_n: f64,
}

/// So many circles are told to a person.
const CIRCLES: usize = 10;

/// What a person reads of a number that was computed: of mm the nanometre.
pub(crate) fn to_the_millionth(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

/// As a person reads it.
impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { path, .. } = self;
        writeln!(f, "verdict            {}", self.verdict)?;
        writeln!(f, "outcome            {}", self.outcome)?;
        if let Some(stopped) = &self.stopped {
            writeln!(f, "stopped            {stopped}")?;
        }
        if let Some(cause) = &self.cause {
            writeln!(f, "cause              {cause}")?;
        }
        writeln!(f, "motion time        {:.3} s", self.times.motion_s)?;
        for bound in self.time_bounds.iter().flat_map(|it| &it.bounds) {
            writeln!(f, "bound by           {bound}")?;
        }
        let others = self.times.others();
        if !others.is_empty() {
            writeln!(f, "other times        {others}")?;
        }
        writeln!(
            f,
            "cycles             {}, late setpoints {}",
            self.cycles, self.late_setpoints
        )?;
        writeln!(
            f,
            "path               {}; setpoints within {:.4} mm, tool within {:.4} mm of it",
            path.length(),
            path.max_deviation_mm,
            path.max_contour_error_mm
        )?;
        writeln!(f, "contour error      {}", path.contour_error())?;
        for bus in &self.bus {
            writeln!(
                f,
                "bus {:<14} busiest cycle {:.1} %",
                bus.name,
                bus.peak_utilisation * 100.0
            )?;
        }
        for axis in &self.axes {
            writeln!(f, "axis {:<13} {axis}", axis.name)?;
        }
        for drive in &self.drives {
            writeln!(f, "drive {:<12} {drive}", drive.name)?;
        }
        for gantry in &self.gantries {
            writeln!(f, "gantry {:<11} {gantry}", gantry.axis)?;
        }
        for structure in &self.structures {
            writeln!(f, "structure {:<8} {structure}", structure.axis)?;
        }
        for transmission in &self.transmissions {
            writeln!(f, "transmission {:<5} {transmission}", transmission.axis)?;
        }
        for circle in self.circles.iter().take(CIRCLES) {
            writeln!(f, "circle             line {}: {circle}", circle.at.line)?;
        }
        let more = self.circles.len().saturating_sub(CIRCLES) as u64;
        left_off(f, more + self.circles_left_off, "circles")?;
        if let Some(cutting) = &self.cutting {
            writeln!(f, "cutting            {cutting}")?;
        }
        for loops in &self.loops {
            writeln!(f, "loops {:<12} {loops}", loops.drive)?;
        }
        for tool in &self.tools {
            writeln!(f, "tool {:<13} {tool}", tool.tool)?;
        }
        for operation in &self.operations {
            writeln!(f, "operation          line {}: {operation}", operation.line)?;
        }
        left_off(f, self.operations_left_off, "operations")?;
        for violation in &self.violations {
            write!(f, "VIOLATION          {}", violation.what)?;
            if let Some(axis) = &violation.axis {
                write!(f, " of axis {axis}")?;
            }
            write!(f, ", line {} at {:.3} s", violation.line, violation.time)?;
            if violation.unit.is_empty() {
                writeln!(f)?;
            } else {
                writeln!(
                    f,
                    ": {} {}, allowed {}",
                    to_the_millionth(violation.value),
                    violation.unit,
                    to_the_millionth(violation.limit)
                )?;
            }
        }
        left_off(f, self.violations_left_off, "violations")?;
        if let Some(digest) = &self.frames_sha256 {
            writeln!(f, "frames SHA-256     {digest}")?;
        }
        Ok(())
    }
}

/// As a person reads it, but for the name.
impl fmt::Display for AxisSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "velocity {:.1} of {} {unit}/s, acceleration {:.0} of {} {unit}/s², jerk {:.0} of {} {unit}/s³, following \
             error max {:.4} rms {:.4} {unit}, greatest in {}",
            self.max_velocity,
            self.velocity_limit,
            self.max_acceleration,
            self.acceleration_limit,
            self.max_jerk,
            self.jerk_limit,
            self.max_following_error_mm,
            self.rms_following_error_mm,
            self.max_following_error_at,
            unit = self.unit
        )?;
        match &self.positioning {
            Some(moves) => write!(f, "\n{:<18} {}", "", moves.told(self.unit)),
            None => Ok(()),
        }
    }
}

/// As a person reads it.
impl fmt::Display for BoundShare {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let share = 100.0 * self.share;
        match (self.what, self.axis) {
            ("several", _) => {
                return write!(
                    f,
                    "{share:.1} %: several bounds at once, of which none helps alone"
                );
            }
            (what, Some(axis)) => write!(f, "{share:.1} %: {what} of {axis}")?,
            (what, None) => write!(f, "{share:.1} %: {what}")?,
        }
        let step = 100.0 * STEP;
        write!(f, "; {step} % more of it saves {:.3} s", self.saves_s)
    }
}

/// As a person reads it.
impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            what, axis, now, ..
        } = self;
        write!(f, "{what} of axis {axis}: {now}")?;
        if !self.follows_with.is_empty() {
            write!(f, "; it follows with {}", self.follows_with.join(" "))?;
        }
        match self.max_torque_then {
            Some(torque) => write!(f, ", torque then at most {torque:.2} N·m"),
            None => Ok(()),
        }
    }
}

/// As a person reads it.
impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {} at {:.3} s", self.line, self.time)
    }
}

/// As a person reads it, but for the name.
impl fmt::Display for DriveSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "torque max {:.2} of {:.2} N·m in {}, {:.0} % in reserve; rms {:.2} of {:.2} N·m",
            self.max_torque,
            self.peak_torque,
            self.max_torque_at,
            100.0 * self.torque_reserve,
            self.rms_torque,
            self.continuous_torque,
        )?;
        if let Some(after) = self.limited_after_s {
            write!(
                f,
                ", over and over its torque is limited after {after:.0} s"
            )?;
        }
        if let Some(supply) = &self.supply {
            write!(f, "; {supply}")?;
        }
        write!(f, "; speed max {:.0} 1/min", self.max_speed_rpm)?;
        if let Some(reserve) = self.speed_reserve {
            write!(f, ", {:.0} % in reserve", 100.0 * reserve)?;
        }
        match self.drop {
            Some(drop) => {
                let unit = self.drop_unit.unwrap_or_default();
                write!(f, "; falls by {drop:.2} {unit} as it is switched off")
            }
            None => Ok(()),
        }
    }
}

/// As a person reads it, but for the axis.
impl fmt::Display for StructureSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "tool sways max {:.4} mm in {}; swings on by {:.4} mm at rest in {}; compliance {:.3} µm/N, at most \
             {:.3} µm/N at {:.1} Hz",
            self.max_sway_mm,
            self.max_sway_at,
            self.max_residual_mm,
            self.max_residual_at,
            self.static_compliance,
            self.worst_compliance.um_per_n,
            self.worst_compliance.frequency
        )
    }
}

/// As a person reads it.
impl fmt::Display for Stopped {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            0 => f.write_str("before the first line")?,
            line => write!(f, "in line {line}")?,
        }
        let position = self.position.iter();
        let position: Vec<_> = position
            .map(|(axis, at)| format!("{axis}{at:.4}"))
            .collect();
        if !position.is_empty() {
            write!(f, " at {}", position.join(" "))?;
        }
        if !self.unreferenced.is_empty() {
            write!(
                f,
                ", without a reference of {}",
                self.unreferenced.join(", ")
            )?;
        }
        if let Some(left) = self.left_mm {
            let left = PathSummary {
                length_mm: left,
                turned_deg: self.left_deg,
                ..PathSummary::default()
            };
            write!(f, ", setpoints had {} left", left.length())?;
        }
        Ok(())
    }
}

impl PositioningSummary {
    /// As a person reads it, of an axis with that unit.
    fn told(&self, unit: &str) -> String {
        format!(
            "{} point to point, the longest {:.3} s in {}; at rest within {:.4} {unit} of the target, greatest in {}; \
             the last one to {:.4} {unit}",
            counted(self.moves, "move", "moves"),
            self.longest_s,
            self.longest_at,
            self.max_error_mm,
            self.max_error_at,
            self.position_mm
        )
    }
}

impl AxisSummary {
    /// What was seen of an axis.
    pub(super) fn new(axis: &AxisWatches) -> Self {
        let [max_following, rms_following] = axis.following();
        let [max_velocity, max_acceleration, max_jerk] = axis.max();
        Self {
            name: axis.name.to_owned(),
            unit: axis.unit(),
            max_velocity,
            max_acceleration,
            max_jerk,
            velocity_limit: axis.limits.velocity,
            acceleration_limit: axis.limits.acceleration,
            jerk_limit: axis.limits.jerk,
            following_error_limit_mm: axis.limits.following_error,
            max_following_error_mm: max_following,
            max_following_error_at: axis.following_at(),
            rms_following_error_mm: rms_following,
            positioning: (axis.positioning.as_ref()).and_then(Positioning::summary),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A deviation that is none is at no place.
    #[test]
    fn what_is_none_has_no_place() {
        let path = PathSummary {
            max_contour_error_mm: 0.0012,
            max_contour_error_at: Place { time: 0.5, line: 3 },
            ..PathSummary::default()
        };
        assert_eq!(
            path.contour_error(),
            "max 0.0012 mm in line 3 at 0.500 s; of rounding none, of the drives none"
        );
    }
}
