//! What a report is made of; whoever ran the machine fills it in.

use crate::machine::AxisLimits;
use crate::timing::Distribution;
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
    /// `true` if nothing was wrong.
    pub passed: bool,
    /// The verdict's reason in a sentence: `finished`, or what stopped it.
    pub outcome: String,
    /// Every violation, in order of time.
    pub violations: Vec<Violation>,
    /// Name and value of what else there is to say, in order: motion time, cycles, late
    /// setpoints, path length, deviation, bus load, frame hash, seed …
    pub facts: Vec<(String, String)>,
    /// Time of each cycle's SYNC from the first motion, s.
    pub time: Vec<f64>,
    /// Line of the program in each cycle; 0 where none.
    pub line: Vec<u32>,
    /// Speed of the tool along the path in each cycle, mm/s.
    pub feed: Vec<f64>,
    /// Speed in each cycle in which A, B and C turn alone, °/s.
    pub turning: Vec<f64>,
    /// Whether the tool moved at a programmed feed in each cycle, not in rapid or at rest.
    pub cutting: Vec<bool>,
    /// In the machine's order. X, Y and Z make the tool path.
    pub axes: Vec<AxisReport>,
    /// Distributions of times: cycle time, wake-up latency, SYNC jitter.
    pub distributions: Vec<Distribution>,
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
    /// Greatest of the plan, between the cycles too; mm/s.
    pub max_velocity: f64,
    /// Greatest of the plan; mm/s².
    pub max_acceleration: f64,
    /// Greatest of the plan; mm/s³.
    pub max_jerk: f64,
    /// Greatest absolute following error, mm.
    pub max_following_error: f64,
    /// Root mean square of the following error, mm.
    pub rms_following_error: f64,
    /// Setpoint, mm.
    pub set: Vec<f64>,
    /// Actual position, mm.
    pub act: Vec<f64>,
    /// Of the plan, mm/s.
    pub velocity: Vec<f64>,
    /// Of the plan, mm/s².
    pub acceleration: Vec<f64>,
    /// Of the plan, mm/s³.
    pub jerk: Vec<f64>,
    /// Setpoint minus actual position after the drive's delay, the worse side of a gantry; mm.
    pub following_error: Vec<f64>,
}
