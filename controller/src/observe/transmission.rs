//! By how much what the drives move is not where their motors say: twist, play, lead error and expansion between the two.
//!
//! The tool is at the load, and a drive's encoder is at its motor. Both are seen once a cycle, shortly behind its SYNC; what
//! the load is off by at a SYNC is what was seen behind the one before, and how it changed by then. It counts from the first
//! SYNC on, and from where the axis is referenced: where it stands then is where it is known to be. What the controller
//! compensates is on both sides: its drive goes further by that, and the axis says that it did not. Where a scale or an encoder sees the load, what the axis says
//! is the load's.

use super::record::{Greatest, Place};
use super::summary::TransmissionSummary;
use crate::control::AxisSample;
use crate::machine::{Axis, COORDINATES, Machine, Position};
use syncline_drives::twin::Observation;

/// The transmission of one axis.
#[derive(Debug)]
pub(super) struct TransmissionWatch {
    axis: &'static str,
    unit: &'static str,
    coordinate: usize,
    /// Its drives, each with mm of a revolution in the axis's direction.
    drives: Vec<(usize, f64)>,
    /// s.
    cycle: f64,
    /// What the load was off by at first, mm.
    first: Option<f64>,
    /// How far it is from its drives at the next SYNC, mm.
    ahead: f64,
    /// How far its drives are beyond where the axis says that it is, mm.
    correction: f64,
    greatest: Greatest,
}

impl TransmissionWatch {
    /// Of an axis; `None`: its load is taken to be where it says.
    pub(super) fn new(machine: &Machine, axis: &Axis) -> Option<Self> {
        let simulation = axis.simulation.as_ref()?;
        let drive = |&drive: &usize| {
            let travel = machine.drives[drive].scaling.travel_per_revolution();
            (drive, travel)
        };
        (simulation.scale.is_none() && axis.feedback.is_none()).then(|| Self {
            axis: axis.name(),
            unit: axis.units()[0],
            coordinate: axis.letter.index(),
            drives: axis.drives.iter().map(drive).collect(),
            cycle: machine.cycle.as_secs_f64(),
            first: None,
            ahead: 0.0,
            correction: 0.0,
            greatest: Greatest::default(),
        })
    }

    /// Takes how the drives are at one SYNC, by their index.
    pub(super) fn observe(&mut self, at: Place, seen: &[Observation]) {
        let mean = |of: &dyn Fn(&Observation) -> f64| {
            let each = self.drives.iter();
            let sum: f64 = each.map(|(drive, travel)| travel * of(&seen[*drive])).sum();
            sum / self.drives.len() as f64
        };
        let off = mean(&|it| it.load_position - it.position);
        let rate = mean(&|it| it.load_velocity - it.velocity);
        self.ahead = off + rate * self.cycle;
        let off = off + self.correction;
        let off = off - *self.first.get_or_insert(off);
        self.greatest.look(off.abs(), at);
    }

    /// It stands where it is known to be.
    pub(super) fn count_anew(&mut self, coordinate: usize) {
        if coordinate == self.coordinate {
            self.first = None;
        }
    }

    /// Takes what the axes say at one SYNC, before it is seen how the drives are.
    pub(super) fn correct(&mut self, axes: &[AxisSample; COORDINATES]) {
        self.correction = axes[self.coordinate].correction;
    }

    /// Moves the tool by what the load is off at the next SYNC.
    pub(super) fn give(&self, tool: &mut Position) {
        let off = |first| self.ahead + self.correction - first;
        tool[self.coordinate] += self.first.map_or(0.0, off);
    }

    /// What was seen; `None` where the load never was off.
    pub(super) fn summary(&self) -> Option<TransmissionSummary> {
        (self.greatest.value > 0.0).then_some(TransmissionSummary {
            axis: self.axis,
            unit: self.unit,
            max_off_mm: self.greatest.value,
            max_off_at: self.greatest.at,
        })
    }
}
