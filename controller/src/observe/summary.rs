//! The result of a run, for programs (`--json`) and for people.

use super::limits::AxisWatches;
use super::record::Violation;
use crate::control::Following;
use serde::Serialize;
use std::fmt;

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

impl AxisSummary {
    /// What was seen of an axis.
    pub(super) fn new(axis: &AxisWatches, following: &Following) -> Self {
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
            max_following_error_mm: following.max,
            rms_following_error_mm: following.rms(),
        }
    }
}
