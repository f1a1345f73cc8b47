//! `[validation]`: what a run has to keep, beside its limits, to pass.

use super::simulation::number_or;
use syncline_strict_toml::{Log, Table};

/// Tolerances of a run; infinite where the file says nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Validation {
    /// `contour_error`: the greatest distance of the tool from the programmed path, mm.
    pub contour_error: f64,
    /// `circular_deviation`: the greatest of any full circle, mm.
    pub circular_deviation: f64,
    /// `following_error`: the greatest of any axis, mm.
    pub following_error: f64,
    /// `skew`: how far the sides of a gantry may be apart, mm.
    pub skew: f64,
    /// What part of its peak torque a drive may use: all but `torque_reserve`.
    pub torque: f64,
    /// What part of the speed at which its voltage ends a motor may have: all but `speed_reserve`.
    pub speed: f64,
    /// `rms_torque`: the greatest root mean square of a drive's torque, as a part of the continuous one.
    pub rms_torque: f64,
    /// `phase_margin`: the least of any loop of a simulated drive, degrees; 0 where none is asked for.
    pub phase_margin: f64,
    /// `gain_margin`: the same of its gain, dB.
    pub gain_margin: f64,
}

impl Default for Validation {
    fn default() -> Self {
        Self {
            contour_error: f64::INFINITY,
            circular_deviation: f64::INFINITY,
            following_error: f64::INFINITY,
            skew: f64::INFINITY,
            torque: f64::INFINITY,
            speed: f64::INFINITY,
            rms_torque: f64::INFINITY,
            phase_margin: 0.0,
            gain_margin: 0.0,
        }
    }
}

pub(super) fn read(log: &mut Log<'_>, mut table: Table<'_, '_>) -> Validation {
    let mut most = |key| table.positive_or(log, key, f64::INFINITY, "(mm)");
    let [contour_error, circular_deviation, following_error, skew] = [
        "contour_error",
        "circular_deviation",
        "following_error",
        "skew",
    ]
    .map(&mut most);
    let rms_torque = table.positive_or(log, "rms_torque", f64::INFINITY, "(of the continuous one)");
    let phase_margin = number_or(
        log,
        &mut table,
        "phase_margin",
        0.0,
        0.0..=90.0,
        "(degrees)",
    );
    let gain_margin = number_or(log, &mut table, "gain_margin", 0.0, 0.0..=60.0, "(dB)");
    let mut all_but = |key| {
        1.0 - number_or(
            log,
            &mut table,
            key,
            f64::NEG_INFINITY,
            0.0..=1.0,
            "(of the greatest)",
        )
    };
    let [torque, speed] = ["torque_reserve", "speed_reserve"].map(&mut all_but);
    table.finish(log);
    Validation {
        contour_error,
        circular_deviation,
        following_error,
        skew,
        torque,
        speed,
        rms_torque,
        phase_margin,
        gain_margin,
    }
}
