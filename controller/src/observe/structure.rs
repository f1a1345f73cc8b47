//! How the simulated machine's structure sways as its axes accelerate, and what the tool is off by.
//!
//! The loads of the drives are seen once a cycle, shortly behind its SYNC; the structure is
//! [swayed](syncline_drives::mechanics::structure) by what their momentum has changed by, and by what pushes at the tool. What the tool is off by at a SYNC
//! is a cycle ahead of what was seen behind the one before.

use super::record::{Greatest, Place};
use super::summary::{Compliance, StructureSummary};
use crate::machine::{Axis, Machine, Position};
use std::f64::consts::TAU;
use std::time::Duration;
use syncline_canopen::Instant;
use syncline_drives::mechanics::structure::{Structure, StructureMode};
use syncline_drives::twin::Observation;

/// An axis whose loads are all slower than this rests, mm/s. Once that has lasted for a period of the slowest mode, what remains is
/// vibration: a shaper's parts are less than that apart.
const RESTS: f64 = 0.1;

/// Frequencies of each decade at which the compliance is told.
const A_DECADE: u32 = 160;

/// The structure along one axis.
#[derive(Debug)]
pub(super) struct StructureWatch {
    axis: &'static str,
    coordinate: usize,
    loads: Vec<Load>,
    modes: Vec<StructureMode>,
    structure: Structure,
    /// When the loads were seen last, and their momentum, N·s.
    last: Option<(Instant, f64)>,
    /// Since when the axis rests.
    rests: Option<Instant>,
    /// A period of the slowest mode.
    period: Duration,
    sway: Greatest,
    residual: Greatest,
}

/// What a drive moves.
#[derive(Debug)]
struct Load {
    drive: usize,
    /// mm of a revolution, in the axis's direction.
    travel: f64,
    /// kg.
    mass: f64,
    /// m for a radian of the shaft, in the axis's direction.
    lever: f64,
}

impl StructureWatch {
    /// Of an axis; `None`: nothing sways along it.
    pub(super) fn new(machine: &Machine, axis: &Axis) -> Option<Self> {
        let simulation = axis.simulation.as_ref()?;
        let modes = simulation.structure.clone();
        let load = |&drive: &usize| {
            let travel = machine.drives[drive].scaling.travel_per_revolution();
            // m for a radian of the shaft.
            let lever = travel / 1e3 / TAU;
            let train = machine.at_shaft(drive, &simulation.felt()).train;
            Load {
                drive,
                travel,
                lever,
                mass: train.load_inertia / (lever * lever),
            }
        };
        (!modes.is_empty()).then(|| Self {
            axis: axis.name(),
            coordinate: axis.letter.index(),
            loads: axis.drives.iter().map(load).collect(),
            structure: Structure::new(&modes),
            period: Duration::from_secs_f64(1.0 / modes[0].frequency),
            modes,
            last: None,
            rests: None,
            sway: Greatest::default(),
            residual: Greatest::default(),
        })
    }

    /// Takes how the drives are at one SYNC, by their index.
    pub(super) fn observe(&mut self, at: Place, seen: &[Observation]) {
        let speed = |load: &Load| load.travel * seen[load.drive].load_velocity;
        let momentum = |load: &Load| load.mass * speed(load) * 1e-3;
        let momentum: f64 = self.loads.iter().map(momentum).sum();
        let Some(now) = self.loads.first().and_then(|it| seen[it.drive].at) else {
            return;
        };
        if let Some((before, had)) = self.last.replace((now, momentum))
            && now > before
        {
            let dt = (now - before).as_secs_f64();
            let pushed = |load: &Load| seen[load.drive].outside / load.lever;
            let pushed: f64 = self.loads.iter().map(pushed).sum();
            self.structure.step(dt, (had - momentum) / dt + pushed);
        }
        self.sway.look(self.structure.sway().abs() * 1e3, at);
        let rests = self.loads.iter().all(|load| speed(load).abs() < RESTS);
        self.rests = rests.then(|| self.rests.unwrap_or(now));
        if self.rests.is_some_and(|since| now - since >= self.period) {
            self.residual.look(self.structure.amplitude() * 1e3, at);
        }
    }

    /// Moves the tool by what it is off at the next SYNC.
    pub(super) fn sway(&self, tool: &mut Position) {
        tool[self.coordinate] += self.structure.sway_ahead() * 1e3;
    }

    pub(super) fn summary(&self) -> StructureSummary {
        let compliance = |frequency: f64| {
            let modes = self.modes.iter().map(|mode| mode.compliance(frequency));
            let (re, im) = modes.fold((0.0, 0.0), |sum, it| (sum.0 + it.0, sum.1 + it.1));
            Compliance {
                frequency,
                um_per_n: 1e6 * f64::hypot(re, im),
            }
        };
        let own = self.modes.iter().map(|mode| mode.frequency);
        let [least, most] = [0, self.modes.len() - 1].map(|at| self.modes[at].frequency);
        let decades = (0.1 * least).log10()..=(10.0 * most).log10();
        let steps = (f64::from(A_DECADE) * (decades.end() - decades.start())).ceil() as u32;
        let places = (0..=steps).map(|n| {
            let share = f64::from(n) / f64::from(steps);
            10f64.powf(decades.start() + share * (decades.end() - decades.start()))
        });
        let mut frequencies: Vec<f64> = places.chain(own).collect();
        frequencies.sort_by(f64::total_cmp);
        let response: Vec<_> = frequencies.into_iter().map(compliance).collect();
        let worst = response
            .iter()
            .max_by(|one, other| one.um_per_n.total_cmp(&other.um_per_n));
        StructureSummary {
            axis: self.axis,
            max_sway_mm: self.sway.value,
            max_sway_at: self.sway.at,
            max_residual_mm: self.residual.value,
            max_residual_at: self.residual.at,
            static_compliance: compliance(0.0).um_per_n,
            worst_compliance: worst.copied().unwrap_or(compliance(0.0)),
            response,
        }
    }
}
