//! Every axis against its limits: velocity, acceleration and jerk of the plan, following error,
//! travel.

use super::record::Violation;
use crate::control::Row;
use crate::machine::{Axis, AxisLimits, COORDINATES};

/// A plan may exceed a limit by this part of it: rounding.
const ROUNDING: f64 = 1e-9;

/// A setpoint so far beyond a soft limit, mm, is still on it.
const BEYOND: f64 = 1e-6;

/// What is watched for each axis.
const WATCHED: [&str; 5] = [
    "velocity",
    "acceleration",
    "jerk",
    "following_error",
    "beyond soft_limits",
];

/// A value that has a limit. A stretch above the limit is one violation, told at its worst.
#[derive(Debug, Default)]
pub(super) struct Watch {
    /// Of the stretch that goes on.
    worst: Option<Violation>,
}

impl Watch {
    /// Looks at a value.
    pub(super) fn look(
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

    /// Ends a stretch that goes on.
    pub(super) fn close(&mut self, violations: &mut Vec<Violation>) {
        violations.extend(self.worst.take());
    }
}

/// What is seen of one axis; arrays in the order of [`WATCHED`].
#[derive(Debug)]
pub(super) struct AxisWatches {
    pub(super) name: &'static str,
    pub(super) coordinate: usize,
    pub(super) units: [&'static str; 5],
    /// The machine file's; its positions widened by where the axis stood at first.
    pub(super) limits: AxisLimits,
    pub(super) max: [f64; 5],
    watches: [Watch; 5],
    began: bool,
}

impl AxisWatches {
    /// Nothing yet of an axis of the machine.
    pub(super) fn new(axis: &Axis) -> Self {
        let [position, velocity, acceleration, jerk] = axis.units();
        Self {
            name: axis.name(),
            coordinate: axis.letter.index(),
            units: [velocity, acceleration, jerk, position, position],
            limits: axis.limits,
            max: [0.0; 5],
            watches: Default::default(),
            began: false,
        }
    }

    /// Takes what happened at one SYNC.
    pub(super) fn observe(
        &mut self,
        row: &Row<COORDINATES>,
        time: f64,
        line: u32,
        violations: &mut Vec<Violation>,
    ) {
        let at = self.coordinate;
        let position = row.plan.position[at];
        let (mut min, mut max) = self.limits.position;
        if !self.began {
            // The encoder's noise of a machine that stands at a limit is no violation.
            (min, max) = (min.min(position), max.max(position));
            self.limits.position = (min, max);
            self.began = true;
        }
        let values = [
            row.plan.velocity[at],
            row.plan.acceleration[at],
            row.plan.jerk[at],
            row.axes[at].following_error,
            (min - position).max(position - max).max(0.0),
        ];
        let limits = [
            self.limits.velocity,
            self.limits.acceleration,
            self.limits.jerk,
            self.limits.following_error,
            BEYOND,
        ];
        for (place, (value, limit)) in values.map(f64::abs).into_iter().zip(limits).enumerate() {
            self.max[place] = self.max[place].max(value);
            self.watches[place].look(violations, value, limit, || Violation {
                what: WATCHED[place].to_owned(),
                axis: Some(self.name.to_owned()),
                time,
                line,
                value,
                limit,
                unit: self.units[place],
            });
        }
    }

    /// Ends the stretches that go on.
    pub(super) fn close(&mut self, violations: &mut Vec<Violation>) {
        for watch in &mut self.watches {
            watch.close(violations);
        }
    }
}
