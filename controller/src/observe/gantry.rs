//! How the sides of a gantry went together.

use super::drives::root_mean;
use super::kept::Kept;
use super::limits::Watch;
use super::record::{Greatest, Place, Violation};
use crate::control::AxisSample;
use crate::machine::{Axis, COORDINATES, Machine};
use serde::Serialize;
use std::fmt;
use syncline_drives::model::Increments;
use syncline_drives::twin::Observation;

/// How the sides of a gantry agreed, as they truly were.
#[derive(Clone, Debug, Serialize)]
pub struct GantrySummary {
    /// The axis.
    pub axis: &'static str,
    /// How far apart they were at most, mm.
    pub max_skew_mm: f64,
    /// Where that was.
    pub max_skew_at: Place,
    /// Root mean square of how far apart they were, mm.
    pub rms_skew_mm: f64,
    /// How far their setpoints were moved against each other at most, mm, where they are coupled.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_coupling_mm: Option<f64>,
    /// Where that was, if they were moved at all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_coupling_at: Option<Place>,
    /// And how far they may be, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coupling_limit_mm: Option<f64>,
    /// Greatest torque with which the beam's guides held it square, N·m, if there is a beam.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_racking_torque: Option<f64>,
    /// Greatest torque with which each motor worked against the other, N·m: half of their difference.
    pub max_torque_fight: f64,
    /// Where that was.
    pub max_torque_fight_at: Place,
    /// Its root mean square, N·m.
    pub rms_torque_fight: f64,
}

/// As a person reads it, but for the axis.
impl fmt::Display for GantrySummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (most, at, rms) = (self.max_skew_mm, self.max_skew_at, self.rms_skew_mm);
        write!(f, "skew max {most:.4} mm in {at}, rms {rms:.4} mm")?;
        if let Some((most, limit)) = self.max_coupling_mm.zip(self.coupling_limit_mm) {
            write!(f, "; cross-coupling max {most:.4} of {limit} mm")?;
            if let Some(at) = self.max_coupling_at {
                write!(f, " in {at}")?;
            }
        }
        if let Some(torque) = self.max_racking_torque {
            write!(f, "; racking torque max {torque:.1} N·m")?;
        }
        write!(
            f,
            "; torque against each other max {:.3} N·m in {}, rms {:.3} N·m",
            self.max_torque_fight, self.max_torque_fight_at, self.rms_torque_fight
        )
    }
}

/// The two sides of a gantry.
#[derive(Debug)]
pub(super) struct GantryWatch {
    axis: &'static str,
    sides: [Side; 2],
    /// Stiffness, N·m/rad, and damping, N·m·s/rad, of what holds its beam square, for a mm that the
    /// second side is ahead.
    racking: Option<[f64; 2]>,
    /// How far the second side was ahead at first, mm: there its beam is square.
    square: Option<f64>,
    tolerance: f64,
    skew: Greatest,
    /// Sum of the squares of the skew, mm².
    skew_squares: f64,
    /// Of an axis whose sides are coupled: how far they were sent apart, mm.
    coupled: Option<Greatest>,
    /// And how far they may be, mm.
    coupling_limit: Option<f64>,
    /// Its place in the plan's coordinates.
    coordinate: usize,
    torque: Greatest,
    fight: Greatest,
    /// Sum of the squares of half of the difference of both torques.
    squares: f64,
    watch: Watch,
}

/// Where a side of a gantry is by its motor.
#[derive(Debug)]
struct Side {
    drive: usize,
    /// Machine position of the encoder's zero, mm.
    zero: f64,
    /// Of a revolution, with its sign, mm.
    travel: f64,
}

impl GantryWatch {
    pub(super) fn new(machine: &Machine, axis: &Axis) -> Self {
        let side = |drive: usize| {
            let scaling = &machine.drives[drive].scaling;
            Side {
                drive,
                zero: scaling.to_mm(Increments::ZERO),
                travel: scaling.travel_per_revolution(),
            }
        };
        let simulation = axis.simulation.as_ref();
        let beam = simulation.and_then(|it| Some(it.gantry.as_ref()?.beam));
        Self {
            axis: axis.name(),
            sides: [side(axis.drives[0]), side(axis.drives[1])],
            racking: beam.map(|beam| {
                [beam.racking.stiffness, beam.racking.damping].map(|it| it * 1e-3 / beam.span)
            }),
            square: None,
            tolerance: machine.validation.skew,
            skew: Greatest::default(),
            skew_squares: 0.0,
            coupled: axis.cross_coupling.map(|_| Greatest::default()),
            coupling_limit: axis.cross_coupling.map(|it| it.limit),
            coordinate: axis.letter.index(),
            torque: Greatest::default(),
            fight: Greatest::default(),
            squares: 0.0,
            watch: Watch::default(),
        }
    }

    /// Takes what the axes say at one SYNC.
    pub(super) fn correct(&mut self, at: Place, axes: &[AxisSample; COORDINATES]) {
        if let Some(greatest) = &mut self.coupled {
            greatest.look(axes[self.coordinate].coupled.abs(), at);
        }
    }

    /// Takes what the drives did at one SYNC.
    pub(super) fn observe(
        &mut self,
        at: Place,
        seen: &[Observation],
        violations: &mut Kept<Violation>,
    ) {
        let [first, second] = [0, 1].map(|side| {
            let Side {
                drive,
                zero,
                travel,
            } = self.sides[side];
            let seen = &seen[drive];
            [
                zero + travel * seen.position,
                travel * seen.velocity,
                travel.signum() * seen.torque,
            ]
        });
        let [skew, rate, fight] = [0, 1, 2].map(|of| second[of] - first[of]);
        let square = *self.square.get_or_insert(skew);
        if let Some([stiffness, damping]) = self.racking {
            let torque = stiffness * (skew - square) + damping * rate;
            self.torque.look(torque.abs(), at);
        }
        let (skew, fight) = (skew.abs(), 0.5 * fight.abs());
        self.skew.look(skew, at);
        self.skew_squares += skew * skew;
        self.fight.look(fight, at);
        self.squares += fight * fight;
        self.watch
            .look(violations, at, skew, self.tolerance, |_| Violation {
                what: "skew".to_owned(),
                axis: Some(self.axis.to_owned()),
                time: at.time,
                line: at.line,
                value: skew,
                limit: self.tolerance,
                unit: "mm",
            });
    }

    /// Ends a stretch that goes on.
    pub(super) fn close(&mut self, violations: &mut Kept<Violation>) {
        self.watch.close(violations);
    }

    pub(super) fn summary(&self, rows: u64) -> GantrySummary {
        GantrySummary {
            axis: self.axis,
            max_skew_mm: self.skew.value,
            max_skew_at: self.skew.at,
            rms_skew_mm: root_mean(self.skew_squares, rows),
            max_coupling_mm: self.coupled.map(|it| it.value),
            max_coupling_at: self.coupled.filter(|it| it.value > 0.0).map(|it| it.at),
            coupling_limit_mm: self.coupling_limit,
            max_racking_torque: self.racking.map(|_| self.torque.value),
            max_torque_fight: self.fight.value,
            max_torque_fight_at: self.fight.at,
            rms_torque_fight: root_mean(self.squares, rows),
        }
    }
}
