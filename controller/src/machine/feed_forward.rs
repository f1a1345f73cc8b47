//! `feed_forward` of an axis: what its motors take to move it, which its drives are sent with each setpoint.

use serde::Serialize;
use std::ops::{Range, RangeInclusive};
use syncline_strict_toml::{Log, Table};
use toml::Spanned;

/// What a motor takes to move its axis, at its shaft; of a gantry each of both. As [`identify`](crate::identify) finds it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FeedForward {
    /// The motor's rated torque, N·m: what 6076h says, and what offsets are parts of.
    pub rated_torque: f64,
    /// Inertia of all that moves, kg·m².
    pub inertia: f64,
    /// What of that turns while the backlash of its axis is taken up, kg·m²: no more than all.
    pub motor_inertia: f64,
    /// Coulomb friction, N·m.
    pub coulomb_friction: f64,
    /// Viscous friction, N·m·s/rad.
    pub viscous_friction: f64,
    /// The torque that holds the axis against gravity, N·m: positive where it pushes in the axis's positive direction.
    pub gravity: f64,
}

/// The key.
pub(super) const KEY: &str = "feed_forward";

/// The rated torque of a motor, N·m: 6076h counts thousandths of it with 32 bits.
const RATED: RangeInclusive<f64> = 0.01..=4e6;

/// So many times its rated torque no plan takes: more is a slip of a figure.
const MOST: f64 = 3.0;

impl FeedForward {
    /// What is beyond a motor of an axis with that greatest speed, rad/s, and acceleration, rad/s², and what it may be, N·m.
    pub(super) fn excess(&self, speed: f64, acceleration: f64) -> Option<(&'static str, f64, f64)> {
        let held = self.gravity.abs() + self.coulomb_friction;
        let most = held + self.viscous_friction * speed + self.inertia * acceleration;
        if held > self.rated_torque {
            return Some(("to hold it up and break away", held, self.rated_torque));
        }
        let allowed = MOST * self.rated_torque;
        (most > allowed).then_some(("at its greatest speed and acceleration", most, allowed))
    }

    /// What 6076h has to read, thousandths of N·m.
    pub(super) fn rated(&self) -> u32 {
        (self.rated_torque * 1000.0).round() as u32
    }
}

/// Reads it, and where the file says so.
pub(super) fn read(
    log: &mut Log<'_>,
    axis: &mut Table<'_, '_>,
) -> Option<(FeedForward, Range<usize>)> {
    let allowed = "a table: { rated_torque = 1.4, inertia = 5e-4 }";
    let mut table = axis.table_if(log, KEY, allowed)?;
    let span = axis.span_of(KEY)?;
    table.title = format!("{}: {KEY}", axis.title);
    let mut number = |key, default: Option<f64>, range: RangeInclusive<f64>, unit: &str| {
        let allowed = format!("a number from {} to {} {unit}", range.start(), range.end());
        let accept = |number: f64| range.contains(&number);
        let found = match default {
            None => table.number(log, key, &allowed, accept),
            Some(_) => table.number_if(log, key, &allowed, accept),
        };
        found.map(Spanned::into_inner).or(default)
    };
    let rated_torque = number("rated_torque", None, RATED, "(N·m)");
    let inertia = number(
        "inertia",
        Some(0.0),
        0.0..=1e4,
        "(kg·m², at the motor's shaft)",
    );
    let motor_inertia = number(
        "motor_inertia",
        Some(0.0),
        0.0..=inertia.unwrap_or(1e4),
        "(kg·m², no more than `inertia`)",
    );
    let coulomb_friction = number("coulomb_friction", Some(0.0), 0.0..=1e6, "(N·m)");
    let viscous_friction = number("viscous_friction", Some(0.0), 0.0..=1e6, "(N·m·s/rad)");
    let gravity = number("gravity", Some(0.0), -1e6..=1e6, "(N·m)");
    table.finish(log);
    let feed_forward = FeedForward {
        rated_torque: rated_torque?,
        inertia: inertia?,
        motor_inertia: motor_inertia?,
        coulomb_friction: coulomb_friction?,
        viscous_friction: viscous_friction?,
        gravity: gravity?,
    };
    Some((feed_forward, span))
}
