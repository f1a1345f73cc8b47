//! A motion to be compared: what a validation did, or what a trace has recorded.

use crate::observe::record::Report;
use crate::recording::{NotRecorded, Recording};
use std::path::Path;

/// A place of a motion: setpoints that stood still count once.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Station {
    /// When it was come to, s.
    pub(super) arrived: f64,
    /// When it was left, s.
    pub(super) left: f64,
    /// Of the program; 0 where none.
    pub(super) line: u32,
    /// Setpoint of each axis, mm or degrees.
    pub(super) set: Vec<f64>,
    /// Actual position when it was left, mm or degrees.
    pub(super) act: Vec<f64>,
    /// Where the tool was then, mm or degrees.
    pub(super) tool: Vec<f64>,
    /// Length of the setpoints' path up to here, all axes together.
    pub(super) along: f64,
}

/// A motion, place by place.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// What it is of.
    pub name: String,
    /// Names of its axes.
    pub axes: Vec<String>,
    pub(super) stations: Vec<Station>,
}

/// Why a motion cannot be compared.
#[derive(Debug, thiserror::Error)]
pub enum NotATrace {
    /// The file is no trace, as `--trace` writes it.
    #[error(transparent)]
    Recording(#[from] NotRecorded),
    /// Nothing moves in it.
    #[error("{name} has no motion to compare: its setpoints never change")]
    Still {
        /// What it is of.
        name: String,
    },
}

impl Motion {
    /// Of a validation, whose rows were kept.
    ///
    /// # Errors
    /// Nothing moved.
    pub fn of(name: String, report: &Report) -> Result<Self, NotATrace> {
        let axes = report.axes.iter().map(|axis| axis.name.clone());
        let mut motion = Self::new(name, axes.collect());
        for (row, (&time, &line)) in report.time.iter().zip(&report.line).enumerate() {
            let set = report.axes.iter().map(|axis| axis.set[row]).collect();
            let act = report.axes.iter().map(|axis| axis.act[row]).collect();
            let tool = report.axes.iter().map(|axis| axis.tool[row]).collect();
            motion.push(time, line, set, [act, tool]);
        }
        motion.moving()
    }

    /// Of a trace, as `run` and `validate` write it.
    ///
    /// # Errors
    /// It is none, or nothing moves in it.
    pub fn read(file: &Path) -> Result<Self, NotATrace> {
        let recording = Recording::read(file, None)?;
        let axes = recording.names().filter_map(|it| it.strip_suffix("_set"));
        let axes: Vec<String> = axes.map(str::to_owned).collect();
        let (time, line) = (recording.column("t_s")?, recording.column("line")?);
        let columns = |of: &str| -> Result<Vec<&[f64]>, NotRecorded> {
            let names = axes.iter().map(|axis| format!("{axis}_{of}"));
            names.map(|name| recording.column(&name)).collect()
        };
        let (set, act) = (columns("set")?, columns("act")?);
        // Of a run on drives that were not simulated, or that nothing gives way of, it is where the axes are.
        let tool = columns("tool").unwrap_or_else(|_| act.clone());
        let mut motion = Self::new(file.display().to_string(), axes.clone());
        for (row, (&time, &line)) in time.iter().zip(line).enumerate() {
            let of = |columns: &[&[f64]]| columns.iter().map(|column| column[row]).collect();
            motion.push(time, line as u32, of(&set), [of(&act), of(&tool)]);
        }
        motion.moving()
    }

    pub(super) fn new(name: String, axes: Vec<String>) -> Self {
        Self {
            name,
            axes,
            stations: Vec::new(),
        }
    }

    /// Appends a row.
    pub(super) fn push(&mut self, time: f64, line: u32, set: Vec<f64>, [act, tool]: [Vec<f64>; 2]) {
        let along = match self.stations.last_mut() {
            Some(last) if last.set == set => {
                (last.left, last.act, last.tool) = (time, act, tool);
                return;
            }
            Some(last) => last.along + apart(&last.set, &set),
            None => 0.0,
        };
        self.stations.push(Station {
            arrived: time,
            left: time,
            line,
            set,
            act,
            tool,
            along,
        });
    }

    fn moving(self) -> Result<Self, NotATrace> {
        let name = self.name.clone();
        (self.stations.len() > 1)
            .then_some(self)
            .ok_or(NotATrace::Still { name })
    }

    /// The same with these axes only, in this order, as far as it has them.
    pub(super) fn with_axes(&self, names: &[String]) -> Self {
        let places = names
            .iter()
            .filter_map(|name| self.axes.iter().position(|own| own == name));
        let places: Vec<usize> = places.collect();
        let of = |values: &[f64]| places.iter().map(|&at| values[at]).collect();
        let mut motion = Self::new(self.name.clone(), names.to_vec());
        for it in &self.stations {
            motion.push(
                it.arrived,
                it.line,
                of(&it.set),
                [of(&it.act), of(&it.tool)],
            );
            if let Some(last) = motion.stations.last_mut() {
                last.left = it.left;
            }
        }
        motion
    }

    /// When the motion is done with a place, s: left it, or in the end come to it.
    pub(super) fn time(&self, station: usize) -> f64 {
        let it = &self.stations[station];
        match station + 1 < self.stations.len() {
            true => it.left,
            false => it.arrived,
        }
    }
}

/// Distance of two positions.
pub(super) fn apart(one: &[f64], other: &[f64]) -> f64 {
    let squares = one.iter().zip(other).map(|(a, b)| (a - b) * (a - b));
    squares.sum::<f64>().sqrt()
}
