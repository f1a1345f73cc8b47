//! What a run leaves: statistics, violations, trace, report.

use super::deviation::distance;
use crate::control::layout::{self, Layout};
use crate::control::{Controller, End, Row};
use crate::machine::{AxisLimits, COORDINATES, Machine, Position};
use crate::program::{Moves, ProgramMove, Switch, counted_speed, moved};
use crate::report::{AxisReport, Report, Violation};
use serde::Serialize;
use std::collections::VecDeque;
use std::fmt::{self, Write as _};
use std::io::{self, Write};
use std::time::Duration;
use syncline_gcode::{Coolant, Output, Spindle, Turning};

/// A plan may exceed a limit by this part of it: rounding.
const ROUNDING: f64 = 1e-9;
/// Moves kept behind the setpoint's: the tool follows later than the setpoint.
const BEHIND: u32 = 8;
/// Stretches of the plan kept behind the setpoint's, for the same reason. Many short moves may be
/// one stretch, under the tag of the last.
const STRETCHES: usize = 3;

/// The result of a run, as `--json` writes it.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// `pass` or `fail`.
    pub verdict: &'static str,
    /// How the run ended, in words.
    pub outcome: String,
    /// From the first to the last motion, s.
    pub duration_s: f64,
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
    /// Everything that must not be.
    pub violations: Vec<Violation>,
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
    /// Greatest distance of an actual position from the programmed geometry, mm.
    pub max_contour_error_mm: f64,
}

fn is_zero(number: &f64) -> bool {
    *number == 0.0
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
}

/// A bus during a run.
#[derive(Clone, Debug, Serialize)]
pub struct BusSummary {
    /// As the machine file names it.
    pub name: String,
    /// Bits of the busiest interval from SYNC to SYNC by the bits of a cycle.
    pub peak_utilisation: f64,
}

/// An axis during a run: of the plan, mm/s, mm/s², mm/s³, and how the drives followed it.
#[derive(Clone, Debug, Serialize)]
pub struct AxisSummary {
    /// As the machine file names it.
    pub name: String,
    /// Of its positions: `mm`, or `°`, as which every mm below counts then.
    pub unit: &'static str,
    /// Greatest velocity, mm/s.
    pub max_velocity: f64,
    /// Greatest acceleration, mm/s².
    pub max_acceleration: f64,
    /// Greatest jerk, mm/s³.
    pub max_jerk: f64,
    /// mm/s
    pub velocity_limit: f64,
    /// mm/s²
    pub acceleration_limit: f64,
    /// mm/s³
    pub jerk_limit: f64,
    /// Greatest absolute following error, mm.
    pub max_following_error_mm: f64,
    /// Root mean square of the following error, mm.
    pub rms_following_error_mm: f64,
}

/// As a person reads it.
impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { path, .. } = self;
        writeln!(f, "verdict            {}", self.verdict)?;
        writeln!(f, "outcome            {}", self.outcome)?;
        writeln!(f, "motion time        {:.3} s", self.duration_s)?;
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
        for bus in &self.bus {
            writeln!(
                f,
                "bus {:<14} busiest cycle {:.1} %",
                bus.name,
                bus.peak_utilisation * 100.0
            )?;
        }
        for axis in &self.axes {
            writeln!(
                f,
                "axis {:<13} velocity {:.1} of {} {unit}/s, acceleration {:.0} of {} {unit}/s², jerk \
                 {:.0} of {} {unit}/s³, following error max {:.4} rms {:.4} {unit}",
                axis.name,
                axis.max_velocity,
                axis.velocity_limit,
                axis.max_acceleration,
                axis.acceleration_limit,
                axis.max_jerk,
                axis.jerk_limit,
                axis.max_following_error_mm,
                axis.rms_following_error_mm,
                unit = axis.unit
            )?;
        }
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
                    // To the nanometre.
                    (violation.value * 1e6).round() / 1e6,
                    violation.unit,
                    violation.limit
                )?;
            }
        }
        if let Some(digest) = &self.frames_sha256 {
            writeln!(f, "frames SHA-256     {digest}")?;
        }
        Ok(())
    }
}

/// A violation that may be going on.
#[derive(Debug, Default)]
struct Watch {
    worst: Option<Violation>,
}

/// A setpoint so far beyond a soft limit, mm, is still on it.
const BEYOND: f64 = 1e-6;

/// What is watched for each axis.
const AXIS_WATCHES: [&str; 5] = [
    "velocity",
    "acceleration",
    "jerk",
    "following_error",
    "beyond soft_limits",
];

#[derive(Debug)]
struct AxisRecord {
    name: &'static str,
    coordinate: usize,
    /// The machine file's; its positions widened by where the axis stood at first.
    limits: AxisLimits,
    /// In the order of [`AXIS_WATCHES`].
    units: [&'static str; 5],
    max: [f64; 5],
    watches: [Watch; 5],
}

/// Where the last row was.
#[derive(Debug, Default)]
struct Passed {
    distance: f64,
    position: Position,
    /// What of the distance was length then, and what angle.
    shares: [f64; 2],
}

/// Records a run row by row.
pub struct Recorder {
    cycle: Duration,
    axes: Vec<AxisRecord>,
    deviation: Watch,
    violations: Vec<Violation>,
    path: PathSummary,
    /// What of the last row's distance was no length of the tool's path.
    besides: f64,
    passed: Passed,
    line: u32,
    /// The move of the last row, and the distance at its first.
    tag: (u32, f64),
    /// Of the last stretches, the newest first.
    tags: [u32; STRETCHES],
    spindle: Spindle,
    coolant: Coolant,
    tool: u32,
    /// Outputs that were due and nobody took.
    outputs: VecDeque<(u32, Output)>,
    cycles: u64,
    motion: Option<(u64, u64)>,
    trace: Option<Box<dyn Write>>,
    text: String,
    report: Option<Report>,
}

impl Recorder {
    /// A recorder for a machine; `trace` takes the CSV rows, `report` says whether a report will
    /// be wanted.
    ///
    /// # Errors
    /// The trace's header cannot be written.
    pub fn new(
        machine: &Machine,
        mut trace: Option<Box<dyn Write>>,
        report: bool,
    ) -> io::Result<Self> {
        if let Some(trace) = &mut trace {
            write!(trace, "t_s,line")?;
            for axis in &machine.axes {
                write!(trace, ",{0}_set,{0}_act", axis.name())?;
            }
            writeln!(trace, ",spindle,coolant,tool")?;
        }
        Ok(Self {
            cycle: machine.cycle,
            axes: (machine.axes.iter())
                .map(|axis| AxisRecord {
                    name: axis.name(),
                    coordinate: axis.letter.index(),
                    units: {
                        let [position, velocity, acceleration, jerk] = axis.units();
                        [velocity, acceleration, jerk, position, position]
                    },
                    limits: axis.limits,
                    max: [0.0; 5],
                    watches: Default::default(),
                })
                .collect(),
            deviation: Watch::default(),
            violations: Vec::new(),
            path: PathSummary::default(),
            besides: 0.0,
            passed: Passed::default(),
            line: 0,
            tag: (0, 0.0),
            tags: [0; STRETCHES],
            spindle: Spindle::default(),
            coolant: Coolant::default(),
            tool: 0,
            outputs: VecDeque::new(),
            cycles: 0,
            motion: None,
            trace,
            text: String::new(),
            report: report.then(|| new_report(machine)),
        })
    }

    /// Takes what happened at one SYNC; returns its time, s.
    ///
    /// # Errors
    /// The trace cannot be written.
    pub fn record(&mut self, row: &Row<COORDINATES>, moves: &mut Moves) -> io::Result<f64> {
        let time = self.seconds(row.cycle);
        self.cycles += 1;
        if row.plan.speed > 0.0 {
            let (first, _) = self.motion.unwrap_or((row.cycle.saturating_sub(1), 0));
            self.motion = Some((first, row.cycle));
        } else if let Some((first, last)) = self.motion
            && last + 1 == row.cycle
        {
            // The move's last step ends at rest.
            self.motion = Some((first, row.cycle));
        }
        let counted = counted_speed(&row.plan.velocity);
        self.measure(row, counted);
        moves.take_up();
        self.follow_path(time, row, moves);
        for axis in &mut self.axes {
            let at = axis.coordinate;
            let position = row.plan.position[at];
            if self.cycles == 1 {
                // The encoder's noise of a machine that stands at a limit is no violation.
                let (min, max) = axis.limits.position;
                axis.limits.position = (min.min(position), max.max(position));
            }
            let (min, max) = axis.limits.position;
            let values = [
                row.plan.velocity[at],
                row.plan.acceleration[at],
                row.plan.jerk[at],
                row.axes[at].following_error,
                (min - position).max(position - max).max(0.0),
            ];
            let limits = [
                axis.limits.velocity,
                axis.limits.acceleration,
                axis.limits.jerk,
                axis.limits.following_error,
                BEYOND,
            ];
            for (watch, (value, limit)) in values.map(f64::abs).into_iter().zip(limits).enumerate()
            {
                axis.max[watch] = axis.max[watch].max(value);
                axis.watches[watch].look(&mut self.violations, value, limit, || Violation {
                    what: AXIS_WATCHES[watch].to_owned(),
                    axis: Some(axis.name.to_owned()),
                    time,
                    line: self.line,
                    value,
                    limit,
                    unit: axis.units[watch],
                });
            }
        }
        if let Some(report) = &mut self.report {
            report.time.push(time);
            report.line.push(self.line);
            let (speed, turns) = counted;
            report.feed.push(if turns { 0.0 } else { speed });
            report.turning.push(if turns { speed } else { 0.0 });
            let feed = row.plan.feed;
            report.cutting.push(feed > 0.0 && feed.is_finite());
            for (axis, record) in report.axes.iter_mut().zip(&self.axes) {
                let at = record.coordinate;
                axis.set.push(row.axes[at].set);
                axis.act.push(row.axes[at].act);
                axis.velocity.push(row.plan.velocity[at]);
                axis.acceleration.push(row.plan.acceleration[at]);
                axis.jerk.push(row.plan.jerk[at]);
                axis.following_error.push(row.axes[at].following_error);
            }
        }
        if let Some(trace) = &mut self.trace {
            self.text.clear();
            // Writing to a string does not fail.
            let _ = write!(self.text, "{time},{}", self.line);
            for axis in &self.axes {
                let sample = &row.axes[axis.coordinate];
                let _ = write!(self.text, ",{},{}", sample.set, sample.act);
            }
            let spindle = match self.spindle.turning {
                Turning::Clockwise => self.spindle.speed,
                Turning::Counterclockwise => -self.spindle.speed,
                Turning::Off => 0.0,
            };
            let coolant = u8::from(self.coolant.mist) + 2 * u8::from(self.coolant.flood);
            let _ = writeln!(self.text, ",{spindle},{coolant},{}", self.tool);
            trace.write_all(self.text.as_bytes())?;
        }
        Ok(time)
    }

    /// The nearest number of seconds to so many cycles.
    fn seconds(&self, cycles: u64) -> f64 {
        (u128::from(cycles) * self.cycle.as_nanos()) as f64 / 1e9
    }

    /// How far the program has come, mm and degrees.
    #[must_use]
    pub fn passed(&self) -> f64 {
        self.path.length_mm + self.path.turned_deg
    }

    /// Adds up the path as F counts it. The plan's own distance also counts what other axes move.
    fn measure(&mut self, row: &Row<COORDINATES>, (speed, turns): (f64, bool)) {
        let Passed {
            distance,
            position,
            shares: before,
        } = self.passed;
        let distance = row.plan.distance - distance;
        let mut shares = before;
        if row.plan.speed > 0.0 {
            let share = speed / row.plan.speed;
            let all = (share - 1.0).abs() < 1e-9;
            shares = match (turns, all) {
                (true, _) => [0.0, share],
                (false, true) => [1.0, 0.0],
                (false, false) => [share, 0.0],
            };
        }
        let [mut length, mut angle] = shares.map(|share| share * distance);
        if (shares[1] > 0.0) != (before[1] > 0.0) && distance != 0.0 {
            // The end of one and the beginning of the other, with a rest between.
            let at = row.plan.position;
            let [tool, other, turn] = moved(&std::array::from_fn(|i| at[i] - position[i]));
            length = if tool > 0.0 { tool } else { other };
            angle = turn;
        }
        self.besides += distance - length;
        self.path.length_mm = row.plan.distance - self.besides;
        self.path.turned_deg += angle;
        self.passed = Passed {
            distance: row.plan.distance,
            position: row.plan.position,
            shares,
        };
    }

    /// Compares setpoint and actual position with the programmed geometry.
    fn follow_path(&mut self, time: f64, row: &Row<COORDINATES>, moves: &mut Moves) {
        if row.plan.off_path {
            return;
        }
        let tag = row.plan.tag;
        if self.tag.0 != tag {
            self.tag = (tag, row.plan.distance);
            self.tags.rotate_right(1);
            self.tags[0] = tag;
        }
        let along = row.plan.distance - self.tag.1;
        while let Some(switch) = moves.switched(tag, &row.plan.position, along) {
            match switch {
                Switch::Spindle(spindle) => self.spindle = spindle,
                Switch::Coolant(coolant) => self.coolant = coolant,
                Switch::Tool(tool) => self.tool = tool,
                Switch::Output(line, output) => self.outputs.push_back((line, output)),
            }
        }
        let last = self.tags.iter().fold(tag, |last, &of| last.max(of));
        let first = self.tags.iter().fold(tag, |first, &of| first.min(of));
        let first = first.min(tag.saturating_sub(BEHIND));
        moves.passed(first);
        let Some(motion) = moves.motion(tag) else {
            return;
        };
        self.line = motion.line;
        let near = |point: &Position, good_enough: f64| {
            let mut nearest = f64::INFINITY;
            let mut farther = 0;
            // Where this stretch passes into the next one it may be near to any move of that.
            for tag in (first..=last).rev().chain(last + 1..) {
                let Some(ProgramMove { curve, .. }) = moves.motion(tag) else {
                    if tag > last {
                        break;
                    }
                    continue;
                };
                let away = distance(curve, point);
                // Counted among those only that are ahead.
                let nearer = away < nearest || tag <= last;
                farther = if nearer { 0 } else { farther + 1 };
                nearest = nearest.min(away);
                if nearest <= good_enough || farther > BEHIND {
                    break;
                }
            }
            nearest
        };
        let deviation = near(&row.plan.position, 1e-9);
        let mut actual = row.plan.position;
        for axis in &self.axes {
            actual[axis.coordinate] = row.axes[axis.coordinate].act;
        }
        self.path.max_deviation_mm = self.path.max_deviation_mm.max(deviation);
        let contour_error = near(&actual, 0.0);
        self.path.max_contour_error_mm = self.path.max_contour_error_mm.max(contour_error);
        self.deviation
            .look(&mut self.violations, deviation, motion.tolerance, || {
                Violation {
                    what: "path_deviation".to_owned(),
                    axis: None,
                    time,
                    line: motion.line,
                    value: deviation,
                    limit: motion.tolerance,
                    unit: "mm",
                }
            });
    }

    /// The next M-code for the machine's outputs whose time has come, and its program line.
    pub fn output(&mut self) -> Option<(u32, Output)> {
        self.outputs.pop_front()
    }

    /// The program line of the last row.
    #[must_use]
    pub fn line(&self) -> u32 {
        self.line
    }

    /// Ends the record: writes what is still to be written and sums up.
    ///
    /// # Errors
    /// The trace cannot be written.
    pub fn finish(
        mut self,
        machine: &Machine,
        layout: &Layout,
        controller: &Controller<COORDINATES>,
        frames: Option<(String, Vec<f64>)>,
    ) -> io::Result<(Summary, Option<Report>)> {
        if let Some(trace) = &mut self.trace {
            trace.flush()?;
        }
        for axis in &mut self.axes {
            for watch in &mut axis.watches {
                watch.close(&mut self.violations);
            }
        }
        self.deviation.close(&mut self.violations);
        if let Some(End::Fault(fault)) = controller.end() {
            self.violations.push(Violation {
                what: format!("fault: {}", fault.describe(layout)),
                axis: None,
                time: self.seconds(self.cycles.saturating_sub(1)),
                line: self.line,
                value: 1.0,
                limit: 0.0,
                unit: "",
            });
        }
        let late_setpoints = controller.late_setpoints();
        if late_setpoints > 0 {
            self.violations.push(Violation {
                what: "late_setpoints".to_owned(),
                axis: None,
                time: self.seconds(self.cycles.saturating_sub(1)),
                line: self.line,
                value: late_setpoints as f64,
                limit: 0.0,
                unit: "bursts",
            });
        }
        let passed = self.violations.is_empty() && controller.end() == Some(End::Finished);
        let (digest, loads) = frames.unzip();
        let following = |coordinate| {
            let at = |axis: &layout::AxisSpec| axis.coordinate == coordinate;
            let axis = layout.axes.iter().position(at);
            axis.map(|axis| controller.following(axis))
                .unwrap_or_default()
        };
        let summary = Summary {
            verdict: if passed { "pass" } else { "fail" },
            outcome: (controller.end())
                .map_or_else(|| "not ended".to_owned(), |end| end.describe(layout)),
            duration_s: (self.motion).map_or(0.0, |(first, last)| self.seconds(last - first)),
            cycles: self.cycles,
            late_setpoints,
            frames_sha256: digest,
            path: self.path,
            bus: (machine.buses.iter().zip(loads.unwrap_or_default()))
                .map(|(bus, peak_utilisation)| BusSummary {
                    name: bus.name.clone(),
                    peak_utilisation,
                })
                .collect(),
            axes: (self.axes.iter())
                .map(|axis| AxisSummary {
                    name: axis.name.to_owned(),
                    unit: axis.units[3],
                    max_velocity: axis.max[0],
                    max_acceleration: axis.max[1],
                    max_jerk: axis.max[2],
                    velocity_limit: axis.limits.velocity,
                    acceleration_limit: axis.limits.acceleration,
                    jerk_limit: axis.limits.jerk,
                    max_following_error_mm: following(axis.coordinate).max,
                    rms_following_error_mm: following(axis.coordinate).rms(),
                })
                .collect(),
            violations: self.violations,
        };
        if let Some(report) = &mut self.report {
            fill(report, &summary);
        }
        Ok((summary, self.report))
    }
}

impl Watch {
    /// Looks at a value: a stretch above the limit is one violation, at its worst.
    fn look(
        &mut self,
        violations: &mut Vec<Violation>,
        value: f64,
        limit: f64,
        violation: impl FnOnce() -> Violation,
    ) {
        if value <= limit * (1.0 + ROUNDING) {
            self.close(violations);
        } else if self.worst.as_ref().is_none_or(|worst| value > worst.value) {
            self.worst = Some(violation());
        }
    }

    fn close(&mut self, violations: &mut Vec<Violation>) {
        violations.extend(self.worst.take());
    }
}

/// A report about a machine that has not moved yet.
fn new_report(machine: &Machine) -> Report {
    Report {
        machine: machine.name.clone(),
        axes: (machine.axes.iter())
            .map(|axis| AxisReport {
                name: axis.name().to_owned(),
                units: axis.units(),
                limits: axis.limits,
                ..AxisReport::default()
            })
            .collect(),
        ..Report::default()
    }
}

/// Adds the result to a report that has the rows.
fn fill(report: &mut Report, summary: &Summary) {
    report.passed = summary.verdict == "pass";
    report.outcome.clone_from(&summary.outcome);
    report.violations.clone_from(&summary.violations);
    for (axis, sum) in report.axes.iter_mut().zip(&summary.axes) {
        axis.max_velocity = sum.max_velocity;
        axis.max_acceleration = sum.max_acceleration;
        axis.max_jerk = sum.max_jerk;
        axis.max_following_error = sum.max_following_error_mm;
        axis.rms_following_error = sum.rms_following_error_mm;
    }
    let mut fact = |name: &str, value: String| report.facts.push((name.to_owned(), value));
    fact("motion time", format!("{:.3} s", summary.duration_s));
    fact("cycles", summary.cycles.to_string());
    fact("late setpoints", summary.late_setpoints.to_string());
    fact("path length", summary.path.length());
    fact(
        "setpoints off the path",
        format!("{:.4} mm", summary.path.max_deviation_mm),
    );
    fact(
        "tool off the path",
        format!("{:.4} mm", summary.path.max_contour_error_mm),
    );
    for bus in &summary.bus {
        fact(
            &format!("busiest cycle, {}", bus.name),
            format!("{:.1} %", bus.peak_utilisation * 100.0),
        );
    }
    if let Some(digest) = &summary.frames_sha256 {
        fact("frames, SHA-256", digest.clone());
    }
}
