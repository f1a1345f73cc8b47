//! One axis in every cycle: setpoint, actual position and torque, handed on as they come.

pub use crate::control::ToldTorque;

use crate::control::Row;
use crate::machine::COORDINATES;
use crossbeam::channel::{self, Receiver, Sender};
use syncline_gcode::AxisLetter;

/// What an axis did at one SYNC.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisSample {
    /// Since the program could begin, s.
    pub time: f64,
    /// Setpoint, mm or degrees.
    pub set: f64,
    /// Actual position, mm or degrees; of a gantry the mean of its sides.
    pub act: f64,
    /// Actual torque.
    pub torque: ToldTorque,
    /// What its drive was sent for this SYNC, mm/s or °/s, if that is sent velocities; `None` where that or `act` is not known.
    pub velocity: Option<f64>,
}

/// Hands on what one axis does.
#[derive(Debug)]
pub struct AxisLog {
    coordinate: usize,
    to: Sender<AxisSample>,
}

impl AxisLog {
    /// Of the axis with that letter, and where its samples come out. They wait there for who takes them, however many
    /// they are.
    #[must_use]
    pub fn new(letter: AxisLetter) -> (Self, Receiver<AxisSample>) {
        let (to, samples) = channel::unbounded();
        let coordinate = letter.index();
        (Self { coordinate, to }, samples)
    }

    /// Hands on a row. Where nobody takes it any more it is lost.
    pub(super) fn push(&self, time: f64, row: &Row<COORDINATES>) {
        let axis = &row.axes[self.coordinate];
        let _ = self.to.send(AxisSample {
            time,
            set: axis.set,
            act: axis.middle,
            torque: axis.torque,
            velocity: axis.velocity,
        });
    }
}
