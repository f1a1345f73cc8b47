//! Motion along a programmed path: geometry, the time parametrisation along it, and its execution.
//!
//! ```text
//! PathItem (curve, feed, mode) ──► Planner ──► Command ──► Executor ──► Setpoint, one a cycle
//! ```
//!
//! - [`curve`]: lines, arcs and helices with their derivatives by arc length,
//! - [`planner`]: turns items into [`JerkSegment`]s of constant jerk along the path; whatever it has
//!   handed over ends at rest,
//! - [`executor`]: what the cycle calls: where every axis has to be at the path's own clock, and a
//!   stop on the path at any instant.
//!
//! What the planner is made of, in the order of its work:
//!
//! - [`segment_fitting`]: short lines are taken for the curve that they were made from; [`blend`]: joints are rounded,
//! - `bounds`: what the path allows along a whole segment; `override_transition`: down to a speed that is asked for now,
//! - [`window`]: a stretch is planned, by [`time_parametrisation`] over its cells, and passed by [`certify`],
//! - `plan`: what was handed over,
//! - `brake`: the hardest slowing down along a path, for planner and executor.
//!
//! Beside the path:
//!
//! - [`jog`]: single axes in machine coordinates, from any state, and back to the path,
//! - [`shaping`]: the setpoints through an input shaper, against vibrations.
//!
//! # Override, feed hold, retrace
//!
//! An operator acts on the [`Executor`] alone, in the cycle: [`Executor::set_overrides`],
//! [`feed_hold`](Executor::feed_hold), [`resume`](Executor::resume),
//! [`set_single_block`](Executor::set_single_block), [`retrace`](Executor::retrace). The
//! executor brakes by itself on a line and where no planner answers; for everything else it wants the
//! path ahead, or the shortest stop, planned anew and says from where on:
//! [`Executor::replan_request`], once a cycle. Whoever feeds it hands that to [`Planner::replan`], and the planner's commands go the usual way:
//!
//! ```text
//! Executor ──► ReplanRequest ──► Planner ──┐
//!    ▲                                     │
//!    └─ ReplacePlan, Section, PathSegment …, JerkSegment …, Commit
//! ```
//!
//! Until then the executor follows the old plan, which ends at rest, and drops what still comes of
//! it. A new plan that comes after its cycle is dropped, too, and the request is given again.
//!
//! While the path rests an operator can move single axes away from it ([`jog`]); the path goes on from
//! where it was left.
//!
//! Units: mm (or deg for rotary axes), s, and their quotients.

// Most loops over the axes walk several arrays at once.
#![allow(clippy::needless_range_loop)]

pub mod blend;
mod bounds;
mod brake;
pub mod certify;
pub mod curve;
pub mod executor;
pub mod jog;
mod override_transition;
mod plan;
pub mod planner;
pub mod segment_fitting;
pub mod shaping;
pub mod time_parametrisation;
pub mod window;

use crate::limits;
use crate::shaper::Method;
use time_parametrisation::Slope;

pub use curve::{Arc, Curve, CurveError, Derivatives, Line, Plane, Poly};
pub use executor::{Dwell, Executor, PathTime, Setpoint};
pub use jog::{Jog, JogError, Leg, Retraction, Travel};
pub use planner::{PathError, Planner};
pub use shaping::Shaping;

/// What every axis is allowed, symmetric in both directions, all positive and finite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits<const N: usize> {
    /// mm/s
    pub velocity: [f64; N],
    /// mm/s²
    pub acceleration: [f64; N],
    /// mm/s³
    pub jerk: [f64; N],
}

impl<const N: usize> Limits<N> {
    /// What they leave of a motion along a line in a direction of length 1.
    pub fn along(&self, direction: &[f64; N]) -> limits::Limits {
        let least = |of: &[f64; N]| {
            let shares = of.iter().zip(direction).filter(|(_, share)| **share != 0.0);
            shares
                .map(|(limit, share)| limit / share.abs())
                .fold(f64::INFINITY, f64::min)
        };
        let [v, a, j] = [&self.velocity, &self.acceleration, &self.jerk].map(least);
        limits::Limits::symmetric(v, a, j)
    }
}

/// How fast the tool may go along the path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Feed {
    /// As fast as the axes' limits allow (G0).
    Rapid,
    /// Path speed in mm/s (G1, G2, G3).
    Rate(f64),
    /// By the turns of a spindle (G95); as fast as it is [measured](Executor::set_turns).
    PerTurn {
        /// Path length in a turn, mm.
        travel: f64,
        /// How many turns a second the spindle makes where nothing else is known, above 0.
        turns: f64,
    },
}

impl Feed {
    /// The path speed that is asked for, mm/s; infinite for [`Feed::Rapid`].
    pub fn speed(self) -> f64 {
        match self {
            Feed::Rapid => f64::INFINITY,
            Feed::Rate(speed) => speed,
            Feed::PerTurn { travel, turns } => travel * turns,
        }
    }

    /// The turns a second at which it is that path speed, where it is by turns.
    pub(super) fn turns(self) -> Option<f64> {
        match self {
            Feed::PerTurn { turns, .. } => Some(turns),
            Feed::Rapid | Feed::Rate(_) => None,
        }
    }
}

/// How the tool leaves a move for the next one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PathControlMode {
    /// At rest in the end point (G61.1, and every move before a dwell or a tool change).
    Stop,
    /// Through the end point within the tolerance in mm, without a stop where the path is smooth (G61).
    Exact(f64),
    /// Round the corner, nowhere further from the programmed path than the tolerance in mm (G64 P).
    Blend(f64),
    /// The same, and moves along lines are one where all ends in between are near that (G64 P Q).
    Merge {
        /// For the corners between what is left, mm.
        tolerance: f64,
        /// How near, mm.
        within: f64,
    },
}

/// What a shaper may leave a curve by, whatever its tolerance, mm: less is beyond what setpoints and encoders show, and with the
/// root of it curves would be followed ever more slowly.
pub const LEAST_SPARE: f64 = 1e-5;

impl PathControlMode {
    /// How far a corner may be rounded off, mm; `None` where the path stops.
    pub fn rounding(self) -> Option<f64> {
        match self {
            PathControlMode::Stop => None,
            PathControlMode::Exact(tolerance)
            | PathControlMode::Blend(tolerance)
            | PathControlMode::Merge { tolerance, .. } => Some(tolerance),
        }
    }

    /// What is left of it to the planner where a [shaper](Planner::shape_by) has its half of the tolerance, and that, mm;
    /// where there is none, as at moves that end at rest, that is `exact`. It is [`LEAST_SPARE`] at least.
    pub fn shared(self, exact: f64) -> (Self, f64) {
        let mode = match self {
            PathControlMode::Stop => self,
            PathControlMode::Exact(tolerance) => PathControlMode::Exact(0.5 * tolerance),
            PathControlMode::Blend(tolerance) => PathControlMode::Blend(0.5 * tolerance),
            PathControlMode::Merge { tolerance, within } => PathControlMode::Merge {
                tolerance: 0.5 * tolerance,
                within: 0.5 * within,
            },
        };
        let spare = Some(mode.tolerance()).filter(|spare| *spare > 0.0);
        (mode, spare.unwrap_or(exact).max(LEAST_SPARE))
    }

    /// What of a motion goes through a [shaper](Planner::shape_by) where nobody chooses: where curves are to be exact, the clock.
    pub fn method(self) -> Method {
        match self {
            PathControlMode::Stop | PathControlMode::Exact(_) => Method::Clock,
            PathControlMode::Blend(_) | PathControlMode::Merge { .. } => Method::Coordinates,
        }
    }

    /// How far the path may leave what is programmed, mm.
    pub fn tolerance(self) -> f64 {
        match self {
            PathControlMode::Merge { tolerance, within } => tolerance + within,
            _ => self.rounding().unwrap_or(0.0),
        }
    }
}

/// One move along a curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Move<const N: usize> {
    /// Where it goes.
    pub curve: Curve<N>,
    /// How fast.
    pub feed: Feed,
    /// How it joins the next move.
    pub mode: PathControlMode,
    /// The caller's mark, as a rule the program line; comes back in [`Setpoint::tag`].
    pub tag: u32,
}

/// What the program feeds to the [`Planner`], one by one.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(clippy::large_enum_variant)] // nearly all are moves
pub enum PathItem<const N: usize> {
    /// Motion.
    Move(Move<N>),
    /// Rest in place (G4); a duration of zero is an exact stop.
    Dwell {
        /// s
        duration: f64,
        /// As [`Move::tag`].
        tag: u32,
        /// What the caller calls it, as a rule the program line; comes back in [`Executor::dwell`].
        block: Option<u32>,
    },
}

/// A stretch of constant jerk on the path's clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JerkSegment {
    /// s
    pub duration: f64,
    /// Path distance at its start, from the start of its section (the last rest), mm.
    pub distance: f64,
    /// Path speed at its start, mm/s.
    pub speed: f64,
    /// Path acceleration at its start, mm/s².
    pub acceleration: f64,
    /// Path jerk throughout, mm/s³.
    pub jerk: f64,
}

impl JerkSegment {
    /// Distance since the segment's start, speed and acceleration at `t` seconds into it.
    pub fn at(&self, t: f64) -> (f64, f64, f64) {
        let &JerkSegment {
            speed: v,
            acceleration: a,
            jerk: j,
            ..
        } = self;
        (
            t * (v + t * (a / 2.0 + t * (j / 6.0))),
            v + t * (a + t * (j / 2.0)),
            a + t * j,
        )
    }

    /// Path distance at its end, mm.
    pub fn end(&self) -> f64 {
        self.distance + self.at(self.duration).0
    }
}

/// What the [`Planner`] hands to the [`Executor`], in order. It can travel through a bounded queue.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(clippy::large_enum_variant)] // a ring's slots are all of one size
pub enum Command<const N: usize> {
    /// What follows, up to the commit, replaces all that is later than the start of the cycle, as
    /// the [`ReplanRequest`] of that revision asked.
    ReplacePlan {
        /// [`ReplanRequest::revision`]
        revision: u64,
        /// [`ReplanRequest::cycle`]
        cycle: u64,
    },
    /// A section begins, from rest, at distance 0, inside these limits; after a [`ReplacePlan`](Self::ReplacePlan) one goes
    /// on where it was. Its path segments follow.
    Section {
        /// Items are the sections, dwells, marks and waypoints at rest in the order in which they were pushed.
        item: u64,
        /// Path distance from the beginning of everything to the section's, mm.
        origin: f64,
        /// The section leads back along the path.
        backward: bool,
        /// Of the axes.
        limits: Limits<N>,
    },
    /// What follows replaces the step of that number and all after it. Steps are the sections,
    /// jerk segments, dwells, marks and waypoints that were not replaced, counted from 0, and again after a
    /// [`ReplacePlan`](Self::ReplacePlan).
    ReplaceTail(u64),
    /// The section's geometry goes on with this curve.
    PathSegment(PathSegment<N>),
    /// The section's time parametrisation goes on with this.
    JerkSegment(JerkSegment),
    /// Rest for `duration` s, under `tag`.
    Dwell {
        /// As in [`Section`](Self::Section).
        item: u64,
        /// s
        duration: f64,
        /// As [`Move::tag`].
        tag: u32,
        /// As [`PathItem::Dwell`] has it.
        block: Option<u32>,
    },
    /// The place of a [`Planner::mark`]: rest until [`Executor::pass`]. What comes behind it is
    /// taken then.
    Mark {
        /// As in [`Section`](Self::Section).
        item: u64,
        /// The caller's.
        mark: u32,
    },
    /// [Waypoints](Planner::waypoint) that the path comes to at rest.
    Waypoint {
        /// As in [`Section`](Self::Section).
        item: u64,
        /// How many there are up to here.
        waypoints: u32,
    },
    /// Rest until [`Executor::resume`].
    Hold,
    /// What was handed over so far ends at rest and may be executed.
    Commit,
}

/// What parts of the programmed speeds are asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Overrides {
    /// Of feeds, 0 to 2.
    pub feed: f64,
    /// Of rapids, 0 to 1.
    pub rapid: f64,
}

impl Default for Overrides {
    fn default() -> Self {
        Overrides {
            feed: 1.0,
            rapid: 1.0,
        }
    }
}

/// From where on, and how, the executor wants its plan replaced.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReplanRequest {
    /// Number of the new plan.
    pub revision: u64,
    /// At the start of this cycle it takes over; it has to be committed before.
    pub cycle: u64,
    /// The item that is under way then, or over; none before the first.
    pub item: Option<u64>,
    /// The state on it then.
    pub departure: PathState,
    /// What an operator set.
    pub overrides: Overrides,
    /// How many turns a second the spindle makes, where that is known.
    pub turns: Option<f64>,
    /// Rest is asked for at the end of every block.
    pub single_block: bool,
    /// What is wanted from there on.
    pub goal: ReplanGoal,
}

/// What a new plan is to lead to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReplanGoal {
    /// On along the path.
    Ahead,
    /// Back along the path, to the beginning of the block or, from there, of the one before.
    Retrace {
        /// Another number each time that an operator asks.
        asked: u64,
    },
    /// To rest as soon as the limits allow, and nothing beyond.
    Rest,
}

/// A state on a section of the path.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PathState {
    /// mm
    pub distance: f64,
    /// mm/s
    pub speed: f64,
    /// mm/s²
    pub acceleration: f64,
}

impl<const N: usize> PathSegment<N> {
    /// Path distance of its end from the start of the section, mm.
    pub fn end(&self) -> f64 {
        self.start + self.curve.length()
    }

    /// Its direction where its motion is planned as along a line: always where its clock is shaped.
    pub(crate) fn direction(&self) -> Option<[f64; N]> {
        match self.clock {
            Some(_) => Some(along_the_first()),
            None => self.curve.direction(),
        }
    }

    /// What its motion is planned by at a distance from its start: the curve, or a line along the first axis.
    pub(crate) fn slope(&self, at: f64) -> Slope<N> {
        match self.clock {
            Some(_) => Slope {
                d1: along_the_first(),
                d2: [0.0; N],
                d3: [0.0; N],
            },
            None => self.curve.at(at).into(),
        }
    }

    /// The limits that its motion keeps by that: the axes', or its own.
    pub(crate) fn limits<'a>(&'a self, axes: &'a Limits<N>) -> &'a Limits<N> {
        self.clock.as_ref().unwrap_or(axes)
    }
}

/// The direction of what stands for a path whose clock is shaped.
fn along_the_first<const N: usize>() -> [f64; N] {
    std::array::from_fn(|axis| if axis == 0 { 1.0 } else { 0.0 })
}

/// A curve in its place along the section.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathSegment<const N: usize> {
    /// Path distance of its start from the start of the section, mm.
    pub start: f64,
    /// The geometry.
    pub curve: Curve<N>,
    /// The programmed path speed, mm/s; infinite for rapid.
    pub feed: f64,
    /// Where it is by the turns of a spindle: how many a second make that speed.
    pub turns: Option<f64>,
    /// The path speed that a [shaper](Planner::shape_by) of coordinates allows, mm/s; infinite without.
    pub most: f64,
    /// What one of the clock allows of path speed, acceleration and jerk; none without. Its motion is planned as that of
    /// the first axis along a line, with these as the axes' limits.
    pub clock: Option<Limits<N>>,
    /// The path speed that is asked for after overrides, mm/s; infinite for rapid.
    pub asked: f64,
    /// As much of that as is allowed, mm/s.
    pub speed: f64,
    /// As [`Move::tag`].
    pub tag: u32,
    /// How many [waypoints](Planner::waypoint) come before it.
    pub waypoints: u32,
}
