//! The force with which tools cut in a simulation, as the drives' loads feel it.

use super::record::{Greatest, Place};
use crate::machine::Machine;
use serde::Serialize;
use std::f64::consts::TAU;
use std::fmt;
use syncline_drives::twin::Observation;

/// With which force tools cut.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct CuttingSummary {
    /// At most, on the tool, N.
    pub max_force_n: f64,
    /// Where that was.
    pub max_force_at: Place,
}

impl fmt::Display for CuttingSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.max_force_n {
            0.0 => write!(f, "no force"),
            force => write!(f, "force max {force:.1} N in {}", self.max_force_at),
        }
    }
}

/// What is watched of it.
#[derive(Debug)]
pub(super) struct CuttingWatch {
    /// The drives of each axis with what a N·m at their shafts is along it, N.
    axes: Vec<Vec<(usize, f64)>>,
    force: Greatest,
}

impl CuttingWatch {
    /// Of a machine; `None`: nothing cuts.
    pub(super) fn new(machine: &Machine) -> Option<Self> {
        let linear = machine.axes.iter().filter(|it| it.letter.is_linear());
        let of = |&drive: &usize| {
            let travel = machine.drives[drive].scaling.travel_per_revolution();
            (drive, TAU * 1e3 / travel)
        };
        machine.is_cutting().then(|| Self {
            axes: linear
                .map(|it| it.drives.iter().map(of).collect())
                .collect(),
            force: Greatest::default(),
        })
    }

    /// Takes how the drives are at one SYNC, by their index.
    pub(super) fn observe(&mut self, at: Place, seen: &[Observation]) {
        let along = |axis: &Vec<(usize, f64)>| -> f64 {
            axis.iter()
                .map(|(drive, part)| seen[*drive].outside * part)
                .sum()
        };
        let squares: f64 = self.axes.iter().map(|axis| along(axis).powi(2)).sum();
        self.force.look(squares.sqrt(), at);
    }

    pub(super) fn summary(&self) -> CuttingSummary {
        CuttingSummary {
            max_force_n: self.force.value,
            max_force_at: self.force.at,
        }
    }
}
