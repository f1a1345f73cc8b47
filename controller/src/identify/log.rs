//! What the estimator gets: one axis at every SYNC, as a file.

use super::{AxisSample, ToldTorque};
use crate::machine::Axis;
use crate::recording::{NotRecorded, Recording};
use std::io::{self, Write};
use std::path::Path;

/// One axis over time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Log {
    /// In the order of time; at one whose torque did not come nothing is known.
    pub samples: Vec<AxisSample>,
}

/// What a log has of an axis beside where it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Beside {
    /// Its torque.
    Torque,
    /// The velocity that its drive was sent.
    Velocity,
}

/// The names of the columns, with their units.
fn columns(axis: &Axis, beside: Beside) -> [String; 4] {
    let (name, unit) = (
        axis.name(),
        if axis.letter.is_linear() { "mm" } else { "deg" },
    );
    [
        "t_s".to_owned(),
        format!("{name}_set_{unit}"),
        format!("{name}_act_{unit}"),
        match beside {
            Beside::Torque => format!("{name}_torque_permille"),
            Beside::Velocity => format!("{name}_sent_{unit}_s"),
        },
    ]
}

impl Log {
    /// Writes it as CSV. What is not known is left out.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn write(&self, axis: &Axis, beside: Beside, to: &mut impl Write) -> io::Result<()> {
        writeln!(to, "{}", columns(axis, beside).join(","))?;
        for sample in &self.samples {
            let AxisSample { time, set, act, .. } = sample;
            let value = match beside {
                Beside::Torque => sample.torque.mean,
                Beside::Velocity => sample.velocity,
            };
            if let Some(value) = value {
                writeln!(to, "{time},{set},{act},{value}")?;
            }
        }
        to.flush()
    }

    /// Reads one.
    ///
    /// # Errors
    /// It cannot be read, or lacks a column.
    pub fn read(axis: &Axis, beside: Beside, file: &Path) -> Result<Self, NotRecorded> {
        let recording = Recording::read(file, None)?;
        let [time, set, act, value] = columns(axis, beside);
        let [time, set, act, value] = [
            recording.column(&time)?,
            recording.column(&set)?,
            recording.column(&act)?,
            recording.column(&value)?,
        ];
        let samples = (0..recording.rows()).map(|row| AxisSample {
            time: time[row],
            set: set[row],
            act: act[row],
            torque: match beside {
                Beside::Torque => ToldTorque::alike(value[row]),
                Beside::Velocity => ToldTorque::default(),
            },
            velocity: (beside == Beside::Velocity).then_some(value[row]),
        });
        Ok(Self {
            samples: samples.collect(),
        })
    }
}
