//! The motion that shows what an axis is: a part program of moves of that axis alone.
//!
//! As it is a program, the planner keeps every limit of the axis in it, and a stop is possible at every instant as in
//! any other. Three things are needed to tell the parts of a plant apart:
//!
//! - **strokes at several speeds**, both ways: what remains of the torque at steady speed is friction over speed, and
//!   what is the same both ways is gravity;
//! - **fast strokes**: what the torque is while the speed changes is inertia;
//! - **sweeps**: on the way in one direction the feed changes from block to block, ever more often, so that the speed
//!   swings about a mean with a frequency that rises. The direction stays, so that friction does not turn round and the
//!   axis does not stick, as it would with small moves to and fro.

use crate::machine::{Axis, AxisLimits};
use std::fmt::Write;

/// Parts of the greatest speed that the strokes have.
const SPEEDS: [f64; 4] = [1.0, 0.55, 0.3, 0.15];
/// How long a stroke at least has its speed, s, where there is room.
const STEADY: f64 = 0.6;
/// Strokes to and fro at the greatest speed, one after the other.
const FAST: usize = 6;
/// How long a sweep takes, s.
const SWEEP: f64 = 3.0;
/// Where sweeps begin, Hz.
const SLOWEST: f64 = 2.0;
/// Where they end, of the cycle's frequency: a slow frequency needs as many swings as a fast one. Each is made to and
/// fro.
const FASTEST: [f64; 3] = [0.02, 0.08, 0.25];
/// The feeds of a sweep, of its mean.
const FEEDS: [f64; 2] = [1.6, 0.6];
/// The axis rests so long at both ends, s.
const REST: f64 = 0.5;

/// What the excitation keeps to, beside the limits of its axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// From where to where it goes, mm or degrees.
    pub travel: (f64, f64),
    /// How fast at most, mm/s or °/s.
    pub speed: f64,
}

/// Bounds that an axis does not have.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OutOfBounds {
    /// Its ends are one place.
    #[error(
        "--travel {at} {at}: the axis has nowhere to move between one position and the same: write two, the lesser one first"
    )]
    Nowhere {
        /// The position.
        at: f64,
    },
    /// It goes backwards.
    #[error("--travel {} {}: write the lesser position first, as in --travel {} {}", travel.0, travel.1, travel.1, travel.0)]
    Order {
        /// What is asked for.
        travel: (f64, f64),
    },
    /// It goes beyond the soft limits.
    #[error("--travel {} to {}: the soft limits of axis {axis} are {} to {}", travel.0, travel.1, limits.0, limits.1)]
    Travel {
        /// The axis.
        axis: &'static str,
        /// What is asked for.
        travel: (f64, f64),
        /// What there is.
        limits: (f64, f64),
    },
    /// It is none.
    #[error(
        "--speed {speed}: allowed for axis {axis}: above 0, up to its velocity limit of {limit} {unit}"
    )]
    Speed {
        /// The axis.
        axis: &'static str,
        /// What is asked for.
        speed: f64,
        /// What there is.
        limit: f64,
        /// Of both.
        unit: &'static str,
    },
    /// Nothing can be told from so small a motion.
    #[error(
        "axis {axis}: in {length:.3} at {speed:.3} per second there is no room to speed up and slow down, which takes \
         {needed:.3}: allow more travel or less speed"
    )]
    Short {
        /// The axis.
        axis: &'static str,
        /// The travel.
        length: f64,
        /// The speed.
        speed: f64,
        /// What it would need.
        needed: f64,
    },
}

impl Bounds {
    /// What suits an axis: the middle of its travel, as much of it as strokes at its greatest speed take, and the
    /// greatest speed that has room there. `travel` and `speed` are bounds of the user's.
    ///
    /// # Errors
    /// The axis has no such travel or speed, or no room for a stroke.
    pub fn of(
        axis: &Axis,
        travel: Option<(f64, f64)>,
        speed: Option<f64>,
    ) -> Result<Self, OutOfBounds> {
        let limits = &axis.limits;
        let (least, most) = limits.position;
        let name = axis.name();
        match travel {
            Some((at, to)) if at == to => return Err(OutOfBounds::Nowhere { at }),
            Some(travel) if travel.0 > travel.1 => return Err(OutOfBounds::Order { travel }),
            _ => {}
        }
        if let Some(travel) = travel
            && !(least <= travel.0 && travel.0 < travel.1 && travel.1 <= most)
        {
            return Err(OutOfBounds::Travel {
                axis: name,
                travel,
                limits: limits.position,
            });
        }
        if let Some(speed) = speed
            && !(speed > 0.0 && speed <= limits.velocity)
        {
            return Err(OutOfBounds::Speed {
                axis: name,
                speed,
                limit: limits.velocity,
                unit: axis.units()[1],
            });
        }
        // Away from the ends, unless a user says otherwise.
        let margin = 0.05 * (most - least);
        let room = travel.unwrap_or((least + margin, most - margin));
        let length = room.1 - room.0;
        let mut fastest = speed.unwrap_or(limits.velocity);
        while speed.is_none() && stroke(limits, fastest) > length && fastest > 1e-3 {
            fastest *= 0.95;
        }
        let needed = 2.0 * limits.stopping_distance(fastest);
        if needed >= length {
            return Err(OutOfBounds::Short {
                axis: name,
                length,
                speed: fastest,
                needed,
            });
        }
        let half = 0.5 * stroke(limits, fastest).min(length);
        let middle = 0.5 * (room.0 + room.1);
        Ok(Self {
            travel: (middle - half, middle + half),
            speed: fastest,
        })
    }
}

/// The length of a stroke at a speed.
fn stroke(limits: &AxisLimits, speed: f64) -> f64 {
    STEADY * speed + 2.0 * limits.stopping_distance(speed)
}

/// The program, for a cycle of so many seconds. It begins and ends in the middle of the travel.
#[must_use]
pub fn program(axis: &Axis, bounds: &Bounds, cycle: f64) -> String {
    let (from, to) = bounds.travel;
    let (middle, length) = (0.5 * (from + to), to - from);
    let mut program = Program {
        name: axis.name(),
        text: "G21 G17 G90 G94 G61\n".to_owned(),
    };
    program.line(middle, bounds.speed);
    program.rest();
    for part in SPEEDS {
        let speed = part * bounds.speed;
        let half = 0.5 * stroke(&axis.limits, speed).min(length);
        for _ in 0..2 {
            program.line(middle - half, speed);
            program.line(middle + half, speed);
        }
    }
    for _ in 0..FAST {
        program.line(from, bounds.speed);
        program.line(to, bounds.speed);
    }
    let mean = (length / SWEEP).min(bounds.speed / FEEDS[0]);
    for fastest in FASTEST {
        program.sweep(to, from, mean, fastest / cycle);
        program.sweep(from, to, mean, fastest / cycle);
    }
    program.line(middle, bounds.speed);
    program.rest();
    program.text += "M2\n";
    program.text
}

/// A program that is being written.
struct Program {
    name: &'static str,
    text: String,
}

impl Program {
    fn rest(&mut self) {
        // Writing to a string does not fail.
        let _ = writeln!(self.text, "G4 P{REST}");
    }

    fn line(&mut self, to: f64, speed: f64) {
        let _ = writeln!(self.text, "G1 {}{to:.6} F{:.4}", self.name, 60.0 * speed);
    }

    /// From one end to the other with feeds that change ever more often: the frequency rises evenly over time.
    fn sweep(&mut self, from: f64, to: f64, mean: f64, fastest: f64) {
        let (mut at, mut frequency) = (0.0, SLOWEST);
        let length = (to - from).abs();
        self.line(from, mean);
        loop {
            for feed in FEEDS {
                at += 0.5 * mean / frequency;
                if at >= length {
                    self.line(to, mean);
                    return;
                }
                self.line(from + (to - from) * at / length, feed * mean);
            }
            frequency += (fastest - SLOWEST).max(0.0) / (SWEEP * frequency);
        }
    }
}
