//! An axis whose drive is sent velocities: how it follows them, and the settings that say so.
//!
//! The controller closes the position loop of such an axis. It sends what the plan has, led by the drive's lag and in time by its
//! delay, and what it allows the loop as gain follows from both ([`Dynamics`]). What a manual says of
//! them is for a drive as delivered; with other gains, and another load, it is another time.

use super::estimate::Figure;
use super::lag::{Following, NotSeen, Parts, following};
use super::{AxisSample, row};
use crate::machine::Machine;
use serde::Serialize;
use std::fmt;
use syncline_drives::model::{Assumption, Drive, Dynamics, Model};

/// An axis whose drive is sent velocities.
#[derive(Clone, Copy, Debug)]
pub struct Streamed {
    /// Its index in [`Machine::axes`].
    pub axis: usize,
}

/// How an axis follows the velocities that its drive is sent.
#[derive(Clone, Debug, Serialize)]
pub struct Followed {
    /// The axis.
    pub axis: &'static str,
    /// What the log says.
    pub following: Following,
    /// What the machine file has of delay and lag, s: one that the drive does not have is 0.
    pub told_s: [f64; 2],
    /// Keys of the drive's `[model.…]` table with what they have to be, µs.
    pub settings: Vec<Setting>,
    /// Gain of the position loop by the machine file, and with those keys, 1/s.
    pub gains: [f64; 2],
    /// Its drive's model.
    #[serde(skip)]
    model: &'static Model,
}

/// A key of a `[model.…]` table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Setting {
    /// Its name.
    pub key: &'static str,
    /// What it has to be.
    pub value: u32,
}

impl Streamed {
    /// The model of its drive, if a file describes that: the machine file has no table for its keys.
    #[must_use]
    pub fn described(self, machine: &Machine) -> Option<&'static Model> {
        let drive = machine.axes[self.axis].drives[0];
        Some(machine.drives[drive].model).filter(|model| model.generic.is_some())
    }

    /// What a log says of it. `latency`: cycles from the SYNC that latches a setpoint until the drive is taken to be there.
    ///
    /// # Errors
    /// It shows too little.
    pub fn find(
        self,
        machine: &Machine,
        latency: f64,
        samples: &[AxisSample],
    ) -> Result<Followed, NotSeen> {
        let cycle = machine.cycle.as_secs_f64();
        let following = following(samples, cycle)?;
        let axis = &machine.axes[self.axis];
        let drive = axis.drives[0];
        let device = machine.device(drive);
        let dynamics = device.drive().and_then(Drive::dynamics);
        let dynamics = dynamics.ok_or(NotSeen)?;
        let model = machine.drives[drive].model;
        let assumed = machine.assumed(model);
        let told = |of: &Assumption| 1e-6 * f64::from(assumed.value(of));
        let allowed = |of: &Assumption, seconds: f64| {
            let (least, most) = (*of.allowed.start(), *of.allowed.end());
            (1e6 * seconds)
                .round()
                .clamp(f64::from(least), f64::from(most)) as u32
        };
        // A velocity that is followed at once leads to where the plan has the axis a cycle later. Not all of the delay is told
        // by its key.
        let delay = (latency - 1.0) * cycle;
        let by_itself = delay - told(dynamics.told_delay);
        let lag = dynamics.told_lag.map_or(0.0, told);
        // What the delay cannot be is lag. Where they are not told apart the file's delay stays, unless the drive has no lag.
        let part = match (dynamics.told_lag, following.parts) {
            (None, _) => following.in_all.value,
            (_, Some(parts)) => parts.delay.value,
            (_, None) => f64::min(delay, following.in_all.value),
        };
        let setting = |of: &'static Assumption, seconds| Setting {
            key: of.name,
            value: allowed(of, seconds),
        };
        let mut settings = vec![setting(dynamics.told_delay, part - by_itself)];
        if let Some(of) = dynamics.told_lag {
            let later = by_itself + 1e-6 * f64::from(settings[0].value);
            settings.push(setting(of, following.in_all.value - later));
        }
        let then: f64 = settings.iter().map(|it| 1e-6 * f64::from(it.value)).sum();
        // The gain is a part of the inverse of all delays, of which these are some.
        let more = (by_itself + then - delay - lag) / Dynamics::gain(1.0);
        Ok(Followed {
            axis: axis.name(),
            told_s: [delay, lag],
            settings,
            gains: [dynamics.gain, 1.0 / (1.0 / dynamics.gain + more)],
            model,
            following,
        })
    }
}

impl Followed {
    /// What changes the machine file so, key by key.
    pub fn changes(&self) -> impl Iterator<Item = String> {
        let keys = self.settings.iter();
        keys.map(|Setting { key, value }| format!("model.{}.{key}={value}", self.model.name))
    }
}

impl fmt::Display for Followed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Following {
            in_all,
            parts,
            factor,
            moving_s,
        } = &self.following;
        writeln!(f, "axis {}: {moving_s:.1} s of motion", self.axis)?;
        writeln!(
            f,
            "\nhow it follows the velocities that its drive is sent, with 95 %"
        )?;
        let [told_delay, told_lag] = self.told_s.map(|told| 1e3 * told);
        let mut tell = |name, figure: &Figure, told: f64| {
            let unit = format!("ms, taken to be {told:.3}");
            row(f, name, &figure.times(1e3), &unit)
        };
        tell("delay and lag", in_all, told_delay + told_lag)?;
        match parts {
            Some(Parts { delay, lag }) => {
                tell("delay", delay, told_delay)?;
                tell("lag", lag, told_lag)?;
            }
            None => writeln!(f, "  which of both it is cannot be told from this log")?,
        }
        row(f, "way, of what is sent", factor, "")?;
        if (factor.value - 1.0).abs() > UNIT {
            return writeln!(
                f,
                "\nits unit of velocity is not what the machine file has it to be: with the right one, do this again"
            );
        }
        let Model { name, .. } = self.model;
        match self.model.generic {
            None => writeln!(f, "\n[model.{name}]  # of all drives of this model")?,
            Some(_) => writeln!(f, "\n# in the file that describes {name}")?,
        }
        for Setting { key, value } in &self.settings {
            writeln!(f, "{key} = {value}")?;
        }
        let [now, then] = self.gains;
        writeln!(
            f,
            "\ngain of the position loop: {now:.1} 1/s now, {then:.1} 1/s with these"
        )
    }
}

/// A way that differs by more from what is sent is another unit.
const UNIT: f64 = 0.02;
