//! What bounds the time of a program.
//!
//! A bound is worth what raising it saves. So the program is planned as often as there are bounds, each time
//! with another one raised by [`STEP`], by the planner that runs it: nothing of what the planner does is modelled
//! a second time, blends, short segments and windows included.
//!
//! Savings become shares of the time by the law of scaling: with all velocities λ, all accelerations λ² and
//! all jerks λ³ times as high the same path takes 1/λ of the time. With `e` for the part of the time that is saved
//! for a small part by which a bound is raised, that says
//!
//! ```text
//! Σ e of feed and velocities + 2 Σ e of accelerations + 3 Σ e of jerks = 1
//! ```
//!
//! and each term is that bound's share. What is missing of 1 is bound by several together, of which none
//! helps alone: a feed that an axis' velocity just allows. The tolerance, by which corners are as fast as they are, is
//! not in that law; its `e` counts as that of a velocity, and the whole is brought back to 1.

use super::{Program, ProgramError};
use crate::machine::{Machine, Position};
use serde::Serialize;
use syncline_gcode as gcode;

/// By what part a bound is raised.
pub const STEP: f64 = 0.05;

/// A bound is named that saves at least this part of the time by [`STEP`].
const NAMED: f64 = 5e-4;

/// So much of 1 may be missing for other reasons: steps are not small, and small savings not named.
const MISSING: f64 = 0.1;

/// Something that bounds how fast a program runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bound {
    /// What F asks for.
    Feed,
    /// `max_velocity` of an axis.
    Velocity(gcode::AxisLetter),
    /// `max_acceleration` of an axis.
    Acceleration(gcode::AxisLetter),
    /// `max_jerk` of an axis.
    Jerk(gcode::AxisLetter),
    /// How far the path may leave what is programmed, of the machine file and of G64 P and Q alike.
    Tolerance,
}

/// What bounds the time of a program.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TimeBounds {
    /// Its motion as planned, s.
    pub motion_s: f64,
    /// By what part each bound was raised to see what that saves.
    pub raised_by: f64,
    /// The greatest share first.
    pub bounds: Vec<BoundShare>,
}

/// What one bound makes of the time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BoundShare {
    /// `feed`, `velocity`, `acceleration`, `jerk`, `tolerance`; `several` for what several do together.
    pub what: &'static str,
    /// Whose, where it is an axis's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axis: Option<&'static str>,
    /// What part of the time it bounds; all add up to 1.
    pub share: f64,
    /// How much shorter the motion is with this bound alone raised, s.
    pub saves_s: f64,
}

impl Bound {
    /// All that a program on a machine has.
    pub fn all(machine: &Machine) -> impl Iterator<Item = Self> {
        let axes = machine.axes.iter().map(|axis| axis.letter);
        let of_axes = axes.flat_map(|axis| {
            [
                Self::Velocity(axis),
                Self::Acceleration(axis),
                Self::Jerk(axis),
            ]
        });
        [Self::Feed, Self::Tolerance].into_iter().chain(of_axes)
    }

    /// The power of time in its unit.
    fn order(self) -> f64 {
        match self {
            Self::Feed | Self::Velocity(_) | Self::Tolerance => 1.0,
            Self::Acceleration(_) => 2.0,
            Self::Jerk(_) => 3.0,
        }
    }

    fn share(self, share: f64, saves_s: f64) -> BoundShare {
        let (what, axis) = match self {
            Self::Feed => ("feed", None),
            Self::Tolerance => ("tolerance", None),
            Self::Velocity(axis) => ("velocity", Some(axis)),
            Self::Acceleration(axis) => ("acceleration", Some(axis)),
            Self::Jerk(axis) => ("jerk", Some(axis)),
        };
        BoundShare {
            what,
            axis: axis.map(gcode::AxisLetter::name),
            share,
            saves_s,
        }
    }
}

impl Program {
    /// The same program with a bound raised by a part of itself.
    #[must_use]
    pub fn raised(mut self, bound: Bound, by: f64) -> Self {
        let limits = &mut self.limits;
        let value = match bound {
            Bound::Feed => &mut self.scale.feed,
            Bound::Tolerance => &mut self.scale.tolerance,
            Bound::Velocity(axis) => &mut limits.velocity[axis.index()],
            Bound::Acceleration(axis) => &mut limits.acceleration[axis.index()],
            Bound::Jerk(axis) => &mut limits.jerk[axis.index()],
        };
        *value *= 1.0 + by;
        self
    }

    /// How long its motion from `start` is planned to take without all rests, s.
    ///
    /// # Errors
    /// A block cannot be run.
    pub fn motion_time(&self, start: Position) -> Result<f64, ProgramError> {
        Ok(self.timetable(start)?.motion())
    }

    /// What bounds its time on a machine.
    ///
    /// # Errors
    /// A block cannot be run.
    pub fn time_bounds(&self, machine: &Machine) -> Result<TimeBounds, ProgramError> {
        let start = machine.rest();
        let time = self.motion_time(start)?;
        let (mut by_scaling, mut all, mut bounds) = (0.0, 0.0, Vec::new());
        for bound in Bound::all(machine) {
            let raised = self.clone().raised(bound, STEP).motion_time(start)?;
            let saves = time - raised;
            // A plan may be a little longer, as it is optimal up to a tolerance.
            let share = bound.order() * (time / raised).ln().max(0.0) / STEP.ln_1p();
            if bound != Bound::Tolerance {
                by_scaling += share;
            }
            if saves > NAMED * time {
                all += share;
                bounds.push(bound.share(share, saves));
            }
        }
        let missing = 1.0 - by_scaling;
        if time > 0.0 && missing > MISSING {
            all += missing;
            bounds.push(BoundShare {
                what: "several",
                axis: None,
                share: missing,
                saves_s: 0.0,
            });
        }
        for bound in &mut bounds {
            bound.share /= all;
        }
        bounds.sort_by(|one, other| other.share.total_cmp(&one.share));
        Ok(TimeBounds {
            motion_s: time,
            raised_by: STEP,
            bounds,
        })
    }
}
