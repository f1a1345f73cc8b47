//! How far the loops of the simulated drives are from swinging by themselves, as they are set and as their axes are.
//!
//! What is computed is [`stability`](syncline_drives::twin::servo::stability): linear, with the axis as
//! `[axis.simulation]` describes it. Of a gantry it is what each motor feels of a beam that goes straight; that its skew may swing is
//! not told.

use super::record::Violation;
use crate::machine::{Machine, Simulation, Validation};
use serde::Serialize;
use std::f64::consts::TAU;
use std::fmt;
use syncline_drives::mechanics::drive_train::DriveTrain;
use syncline_drives::model::Setpoints;
use syncline_drives::twin::servo::cascade::Gains;
use syncline_drives::twin::servo::power_stage::CURRENT_BANDWIDTH;
use syncline_drives::twin::servo::stability::{Margins, Tuning};

/// Frequencies that are told, Hz.
const TOLD: (f64, f64) = (0.5, 5000.0);
/// Of those that are computed one in so many is told.
const EVERY: usize = 20;

/// The loops of a drive.
#[derive(Clone, Debug, Serialize)]
pub struct LoopSummary {
    /// The drive.
    pub drive: String,
    /// Whether the loops that it closes come to rest by themselves.
    pub stable: bool,
    /// How far the speed loop is from swinging; nothing of one that swings.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed: Option<Margins>,
    /// The same of the position loop; nothing where the controller closes it, either.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position: Option<Margins>,
    /// The open loops over frequency.
    pub response: Vec<Response>,
}

/// Open loops at a frequency.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Response {
    /// Hz.
    pub frequency: f64,
    /// Of the speed loop.
    pub speed: Gain,
    /// Of the position loop, where the drive closes it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position: Option<Gain>,
}

/// What an open loop makes of a sine.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Gain {
    /// dB.
    pub decibels: f64,
    /// Degrees, without jumps of a whole turn.
    pub phase: f64,
}

impl LoopSummary {
    /// Of a drive of a machine with such gains.
    pub(super) fn of(machine: &Machine, drive: usize, gains: &Gains) -> Self {
        let spec = &machine.drives[drive];
        let axis = &machine.axes[spec.axis];
        let simulation = axis.simulation.as_ref();
        let train = match simulation {
            Some(simulation) => machine.at_shaft(drive, &simulation.felt()).train,
            None => DriveTrain::default(),
        };
        let has_power_stage = simulation.and_then(Simulation::driven).is_some();
        let current = match has_power_stage {
            true => CURRENT_BANDWIDTH,
            false => f64::INFINITY,
        };
        let tuning = Tuning::new(train, current);
        let tuning = match simulation.and_then(|it| it.scale) {
            Some(_) => tuning.by_scale(),
            None => tuning,
        };
        let own_position = !spec.model.is_sent(Setpoints::Velocities);
        let (speed, position) = match own_position {
            true => (tuning.stability(gains))
                .map(|it| (it.speed, it.position))
                .unzip(),
            false => (tuning.speed_margins(gains), None),
        };
        let mut turned = [0.0; 2];
        let all = tuning.open_loops(gains, TOLD);
        let response =
            all.into_iter()
                .enumerate()
                .filter_map(|(n, (frequency, speed, position))| {
                    let mut gain = |at: usize, re: f64, im: f64| {
                        let angle = im.atan2(re);
                        turned[at] = angle + TAU * ((turned[at] - angle) / TAU).round();
                        Gain {
                            decibels: 20.0 * re.hypot(im).log10(),
                            phase: turned[at].to_degrees(),
                        }
                    };
                    let speed = gain(0, speed.re, speed.im);
                    let position = gain(1, position.re, position.im);
                    (n % EVERY == 0).then_some(Response {
                        frequency,
                        speed,
                        position: own_position.then_some(position),
                    })
                });
        Self {
            drive: spec.name.clone(),
            response: response.collect(),
            stable: speed.is_some(),
            speed,
            position,
        }
    }
}

impl LoopSummary {
    /// Its loops with their names.
    fn named(&self) -> impl Iterator<Item = (&'static str, &Margins)> {
        let loops = [("speed", &self.speed), ("position", &self.position)];
        loops
            .into_iter()
            .filter_map(|(name, margins)| Some((name, margins.as_ref()?)))
    }

    /// What must not be, at the beginning, as loops are as they are all the time: that they swing, and what is less than
    /// `[validation]` asks for.
    pub(super) fn short_of(&self, tolerance: &Validation) -> Vec<Violation> {
        let (phase, gain) = (tolerance.phase_margin, tolerance.gain_margin);
        let violation = |what: String, value, limit, unit| Violation {
            what: format!("{what} loop of drive {}", self.drive),
            axis: None,
            time: 0.0,
            line: 0,
            value,
            limit,
            unit,
        };
        if !self.stable {
            return vec![violation("unstable".to_owned(), 1.0, 0.0, "")];
        }
        let margins = self.named().flat_map(|(name, it)| {
            [
                (format!("phase_margin, {name}"), it.phase, phase, "°"),
                (format!("gain_margin, {name}"), it.gain, gain, "dB"),
            ]
        });
        margins
            .filter(|(_, value, least, _)| value < least)
            .map(|(what, value, least, unit)| violation(what, value, least, unit))
            .collect()
    }
}

/// As a person reads it, but for the drive.
impl fmt::Display for LoopSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.stable {
            return write!(f, "swing by themselves");
        }
        for (n, (name, it)) in self.named().enumerate() {
            let comma = if n > 0 { "; " } else { "" };
            write!(
                f,
                "{comma}{name} {:.0}° and {:.1} dB from swinging, to {:.1} Hz",
                it.phase, it.gain, it.crossover
            )?;
        }
        Ok(())
    }
}
