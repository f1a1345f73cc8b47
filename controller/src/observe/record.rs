//! A run row by row, as its report shows it, and what must not be in it.

use super::deviation::OffPath;
use super::summary::Summary;
use super::timing::Distribution;
use crate::control::Row;
use crate::machine::{AxisLimits, COORDINATES, Machine, Position};
use serde::Serialize;

/// One run or validation.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// The machine's name.
    pub machine: String,
    /// The program's file name.
    pub program: String,
    /// What was done: `validated in virtual time`, `run in real time`.
    pub mode: String,
    /// `pass`, `fail` or `interrupted`.
    pub verdict: &'static str,
    /// The verdict's reason in a sentence: `finished`, or what stopped it.
    pub outcome: String,
    /// The violations, in order of time.
    pub violations: Vec<Violation>,
    /// Further violations.
    pub violations_left_off: u64,
    /// Name and value of what there is to say at once, in order: motion time, cycles, late setpoints, path length, bus
    /// load …
    pub facts: Vec<(String, String)>,
    /// Time of each cycle's SYNC from the first motion, s.
    pub time: Vec<f64>,
    /// Line of the program in each cycle; 0 where none.
    pub line: Vec<u32>,
    /// Speed of the tool along the path in each cycle, mm/s.
    pub feed: Vec<f64>,
    /// What was asked for, after overrides, mm/s; not a number in rapids, at rest, and where A, B and C turn alone.
    pub programmed: Vec<f64>,
    /// Speed in each cycle in which A, B and C turn alone, °/s.
    pub turning: Vec<f64>,
    /// Whether the tool moved at a programmed feed in each cycle, not in rapid or at rest.
    pub cutting: Vec<bool>,
    /// How far the setpoint was from the programmed geometry in each cycle, mm; not a number while the axes are
    /// off the path.
    pub deviation: Vec<f64>,
    /// The same of the actual position, mm.
    pub contour_error: Vec<f64>,
    /// From the programmed geometry to the actual position in X, Y and Z, mm.
    pub off_path: Vec<[f64; 3]>,
    /// In the machine's order. X, Y and Z make the tool path.
    pub axes: Vec<AxisReport>,
    /// The program's text.
    pub source: String,
    /// Distributions of times: cycle time, wake-up latency, SYNC jitter.
    pub distributions: Vec<Distribution>,
}

/// When something was, and in which line of the program.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Place {
    /// s on [`Report::time`].
    #[serde(rename = "time_s")]
    pub time: f64,
    /// 0 where none.
    pub line: u32,
}

/// The greatest of values, and where it was.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Greatest {
    /// 0 where all are.
    pub(crate) value: f64,
    pub(crate) at: Place,
}

impl Greatest {
    /// Takes a value.
    pub(crate) fn look(&mut self, value: f64, at: Place) {
        if value > self.value {
            *self = Self { value, at };
        }
    }
}

/// Something that must not be.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Violation {
    /// What: `following error`, `velocity`.
    pub what: String,
    /// Whose, where it is an axis's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axis: Option<String>,
    /// When, s on [`Report::time`].
    #[serde(rename = "time_s")]
    pub time: f64,
    /// Line of the program; 0 where none.
    pub line: u32,
    /// What it was …
    pub value: f64,
    /// … and what it may be at most.
    pub limit: f64,
    /// Of both.
    pub unit: &'static str,
}

/// One axis: its limits, and a value for each cycle of [`Report::time`].
#[derive(Clone, Debug, Default)]
pub struct AxisReport {
    /// `X`.
    pub name: String,
    /// Of its position, velocity, acceleration and jerk; below it says mm for all axes.
    pub units: [&'static str; 4],
    /// What it was held against.
    pub limits: AxisLimits,
    /// Greatest, as planned and as sent, at the cycles and by differences between them; mm/s.
    pub max_velocity: f64,
    /// The same; mm/s².
    pub max_acceleration: f64,
    /// The same; mm/s³.
    pub max_jerk: f64,
    /// Greatest absolute following error, mm.
    pub max_following_error: f64,
    /// Root mean square of the following error, mm.
    pub rms_following_error: f64,
    /// Setpoint, mm.
    pub set: Vec<f64>,
    /// Actual position, mm.
    pub act: Vec<f64>,
    /// Where the tool is along it: what twists, has play or a lead error, grows with warmth or sways is no part of the actual
    /// position; mm.
    pub tool: Vec<f64>,
    /// Of the plan, mm/s.
    pub velocity: Vec<f64>,
    /// Of the plan, mm/s².
    pub acceleration: Vec<f64>,
    /// Of the plan, mm/s³.
    pub jerk: Vec<f64>,
    /// Setpoint minus actual position after the drive's delay, the worse side of a gantry; mm.
    pub following_error: Vec<f64>,
}

impl Report {
    /// About a machine that has not moved yet.
    pub(super) fn of(machine: &Machine) -> Self {
        Self {
            machine: machine.name.clone(),
            axes: (machine.axes.iter())
                .map(|axis| AxisReport {
                    name: axis.name().to_owned(),
                    units: axis.units(),
                    limits: axis.stated_limits(),
                    ..AxisReport::default()
                })
                .collect(),
            ..Self::default()
        }
    }

    /// Appends a row: its time, the program's line, the speed as F counts it and whether that is
    /// of a turn, how far setpoint and tool are off the path, and where the tool is; `coordinates` are those of the axes.
    pub(super) fn push(
        &mut self,
        Place { time, line }: Place,
        row: &Row<COORDINATES>,
        (speed, turns): (f64, bool),
        off_path: Option<OffPath>,
        tool: &Position,
        coordinates: impl Iterator<Item = usize>,
    ) {
        self.time.push(time);
        self.line.push(line);
        self.feed.push(if turns { 0.0 } else { speed });
        self.turning.push(if turns { speed } else { 0.0 });
        let feed = row.plan.feed;
        let cuts = feed > 0.0 && feed.is_finite();
        self.cutting.push(cuts);
        // As F counts it, as the speed is.
        let counted = speed / row.plan.speed;
        let asked = cuts && !turns && counted.is_finite();
        let programmed = if asked { feed * counted } else { f64::NAN };
        self.programmed.push(programmed);
        let off_path = off_path.unwrap_or(OffPath {
            setpoint: f64::NAN,
            tool: f64::NAN,
            by: [f64::NAN; 3],
        });
        self.deviation.push(off_path.setpoint);
        self.contour_error.push(off_path.tool);
        self.off_path.push(off_path.by);
        for (axis, at) in self.axes.iter_mut().zip(coordinates) {
            axis.set.push(row.axes[at].set);
            axis.act.push(row.axes[at].act);
            axis.tool.push(tool[at]);
            axis.velocity.push(row.plan.velocity[at]);
            axis.acceleration.push(row.plan.acceleration[at]);
            axis.jerk.push(row.plan.jerk[at]);
            axis.following_error.push(row.axes[at].following_error);
        }
    }

    /// Adds the result to the rows.
    pub(super) fn conclude(&mut self, summary: &Summary) {
        self.verdict = summary.verdict;
        self.outcome.clone_from(&summary.outcome);
        self.violations.clone_from(&summary.violations);
        self.violations_left_off = summary.violations_left_off;
        for (axis, sum) in self.axes.iter_mut().zip(&summary.axes) {
            axis.max_velocity = sum.max_velocity;
            axis.max_acceleration = sum.max_acceleration;
            axis.max_jerk = sum.max_jerk;
            axis.max_following_error = sum.max_following_error_mm;
            axis.rms_following_error = sum.rms_following_error_mm;
        }
        let mut fact = |name: &str, value: String| self.facts.push((name.to_owned(), value));
        if let Some(stopped) = &summary.stopped {
            fact("stopped", stopped.to_string());
        }
        fact("motion time", format!("{:.3} s", summary.times.motion_s));
        let others = summary.times.others();
        if !others.is_empty() {
            fact("other times", others);
        }
        fact("cycles", summary.cycles.to_string());
        fact("late setpoints", summary.late_setpoints.to_string());
        fact("path length", summary.path.length());
        fact("contour error", summary.path.contour_error());
        for bus in &summary.bus {
            fact(
                &format!("busiest cycle, {}", bus.name),
                format!("{:.1} %", bus.peak_utilisation * 100.0),
            );
        }
    }
}
