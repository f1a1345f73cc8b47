//! What the estimator gets: one axis at every SYNC, as a file.

use super::AxisSample;
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

/// The names of the columns, with their units.
fn columns(axis: &Axis) -> [String; 4] {
    let (name, unit) = (
        axis.name(),
        if axis.letter.is_linear() { "mm" } else { "deg" },
    );
    [
        "t_s".to_owned(),
        format!("{name}_set_{unit}"),
        format!("{name}_act_{unit}"),
        format!("{name}_torque_permille"),
    ]
}

impl Log {
    /// Writes it as CSV. What is not known is left out.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn write(&self, axis: &Axis, to: &mut impl Write) -> io::Result<()> {
        writeln!(to, "{}", columns(axis).join(","))?;
        for AxisSample {
            time,
            set,
            act,
            torque,
        } in &self.samples
        {
            if let Some(torque) = torque {
                writeln!(to, "{time},{set},{act},{torque}")?;
            }
        }
        to.flush()
    }

    /// Reads one.
    ///
    /// # Errors
    /// It cannot be read, or lacks a column.
    pub fn read(axis: &Axis, file: &Path) -> Result<Self, NotRecorded> {
        let recording = Recording::read(file, None)?;
        let [time, set, act, torque] = columns(axis);
        let [time, set, act, torque] = [
            recording.column(&time)?,
            recording.column(&set)?,
            recording.column(&act)?,
            recording.column(&torque)?,
        ];
        let samples = (0..recording.rows()).map(|row| AxisSample {
            time: time[row],
            set: set[row],
            act: act[row],
            // Floats beyond what it holds become its ends.
            torque: Some(torque[row].round() as i16),
        });
        Ok(Self {
            samples: samples.collect(),
        })
    }
}
