//! Inertia, friction and gravity from a log.
//!
//! With everything at the motor's shaft, torque in N·m and the angle φ in rad, an axis that moves obeys
//!
//! ```text
//! τ = J φ̈ + C sign φ̇ + B φ̇ + G
//! ```
//!
//! which is linear in the four unknowns; the module `windows` says how it is solved without differentiating
//! anything. An axis that rests does not obey it, as friction then is whatever holds, and for a while behind a
//! reversal the load may not have turned round while the motor has: what is told of those times is left out.
//!
//! Two more columns take up what is not looked for, the first and second derivative of φ̈. A drive tells its torque later
//! than its position, by half of the time over which it takes the mean and more: of `J φ̈ + B φ̇` it tells
//! `(J − B δ) φ̈ + B φ̇ − J δ φ⃛`, to the first order of that delay δ. And a load behind a spring swings at low
//! frequencies by `φ̈/ω²` further than the motor.
//!
//! A fit knows only of noise. That the model itself is not the axis shows in what windows of other lengths say, as these see
//! other frequencies: the greatest difference to them counts as uncertainty too. So an axis whose transmission swings
//! within what the windows see has wide intervals.

use super::AxisSample;
use super::windows::{Factors, Sample, factors};
use serde::Serialize;

/// How long windows are, s: those that are told, and what they are compared with.
const WINDOWS: [f64; 3] = [0.12, 0.06, 0.24];
/// Samples in a window at least.
const SHORTEST: usize = 24;
/// An axis that moves by less in two cycles may stand still, increments.
const STILL: f64 = 2.5;
/// How long behind a rest or a reversal nothing is told of it, s.
const SETTLING: f64 = 0.1;
/// Time in motion from which something can be told, s.
const LEAST: f64 = 2.0;
/// Over so many cycles a gap is bridged by a straight line.
const BRIDGED: f64 = 3.0;
/// Cycles from sample to sample at most.
const LONGEST_GAP: f64 = 1e5;

/// What is known of an axis beside its log.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shaft {
    /// Time from sample to sample, s.
    pub cycle: f64,
    /// By which angle the motor turns for each mm or degree of the axis, rad.
    pub radians: f64,
    /// What an increment of its encoder is, mm or degrees.
    pub resolution: f64,
    /// The motor's rated torque, N·m.
    pub rated_torque: f64,
}

/// A number that was measured.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Figure {
    /// The number.
    pub value: f64,
    /// Half of the interval about it that holds the truth with 95 %.
    pub uncertainty: f64,
}

/// An axis as it moves, everything at the motor's shaft, torques in the axis's positive direction.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// Of all that turns and moves, kg·m².
    pub inertia: Figure,
    /// Coulomb friction, N·m.
    pub friction: Figure,
    /// Viscous friction, N·m·s/rad.
    pub viscous_friction: Figure,
    /// What it takes to hold the axis against gravity, N·m; of a negative one, gravity pulls in positive direction.
    pub holding_torque: Figure,
    /// By how much the torque is told later than the position, s.
    pub torque_delay_s: f64,
    /// For how long it moved one way, without rests and reversals, s.
    pub moving_s: f64,
}

/// Why a log says nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NotEstimated {
    /// The samples have no place in time.
    #[error(
        "the log's times do not go on in steps of the machine's cycle, {} ms, at {time} s: take the machine file of the \
         run, and a log as it was written",
        1e3 * .cycle
    )]
    Times {
        /// Where, s.
        time: f64,
        /// What they should go on by, s.
        cycle: f64,
    },
    /// It hardly moves.
    #[error(
        "in the log the axis moves for {moves:.3} s, without rests and reversals: at least {LEAST} s are needed"
    )]
    Rests {
        /// How long, s.
        moves: f64,
    },
    /// All of its motion is alike.
    #[error(
        "inertia, friction and gravity cannot be told apart: the log needs motion in both directions, at several speeds"
    )]
    Alike,
}

/// What a log says of its axis.
///
/// # Errors
/// It says nothing.
pub fn estimate(samples: &[AxisSample], shaft: &Shaft) -> Result<Estimate, NotEstimated> {
    let motion = motion(samples, shaft)?;
    let moving = motion.iter().filter(|sample| sample.way != 0.0).count();
    let moves = moving as f64 * shaft.cycle;
    if moves < LEAST {
        return Err(NotEstimated::Rests { moves });
    }
    let found = WINDOWS.map(|time| {
        let length = (time / shaft.cycle).round() as usize;
        factors(&motion, shaft.cycle, length.max(SHORTEST))
    });
    let [Some(told), Some(one), Some(other)] = found else {
        return Err(NotEstimated::Alike);
    };
    let [told, one, other] = [told, one, other].map(undelayed);
    let figure = |at: usize| {
        let value = |factors: &Factors| factors[at].0;
        let model = [one, other].map(|it| (value(&it) - value(&told)).abs());
        Figure {
            value: value(&told),
            uncertainty: told[at].1.hypot(model[0].max(model[1])),
        }
    };
    Ok(Estimate {
        inertia: figure(0),
        friction: figure(1),
        viscous_friction: figure(2),
        holding_torque: figure(3),
        torque_delay_s: told[4].0,
        moving_s: moves,
    })
}

/// Of factors of a torque that is told late, those of the torque itself, and in place of the fifth the delay, s.
fn undelayed(mut factors: Factors) -> Factors {
    let [inertia, _, viscous, _, jerk, _] = factors.map(|(factor, _)| factor);
    // To the first order: what the delay takes off the inertia is little.
    let delay = -jerk / inertia;
    factors[0].0 += viscous * delay;
    factors[4].0 = delay;
    factors
}

/// A log at the shaft, a sample every cycle.
fn motion(samples: &[AxisSample], shaft: &Shaft) -> Result<Vec<Sample>, NotEstimated> {
    let mut motion = sampled(samples, shaft)?;
    let still = STILL * shaft.resolution * shaft.radians;
    let settling = (SETTLING / shaft.cycle).ceil() as usize;
    let (mut way, mut lasts) = (0.0, 0);
    for at in 1..motion.len().saturating_sub(1) {
        let moved = motion[at + 1].angle - motion[at - 1].angle;
        // NaN, of what is not known, is no motion.
        let goes = match moved.abs() > still {
            true => moved.signum(),
            false => 0.0,
        };
        lasts = if goes == way { lasts + 1 } else { 0 };
        way = goes;
        motion[at].way = if lasts >= settling { way } else { 0.0 };
    }
    Ok(motion)
}

/// The same before it is known which way it goes. Of the cycles of a longer gap there is no angle.
fn sampled(samples: &[AxisSample], shaft: &Shaft) -> Result<Vec<Sample>, NotEstimated> {
    let Shaft { cycle, radians, .. } = *shaft;
    let mut motion: Vec<Sample> = Vec::with_capacity(samples.len());
    let mut last: Option<f64> = None;
    for sample in samples {
        let Some(torque) = sample.torque else {
            continue;
        };
        let steps = last.map_or(1.0, |last| (sample.time - last) / cycle);
        let whole = steps.round();
        if !((1.0..=LONGEST_GAP).contains(&whole) && (steps - whole).abs() < 0.1) {
            let time = sample.time;
            return Err(NotEstimated::Times { time, cycle });
        }
        last = Some(sample.time);
        let next = Sample {
            angle: sample.act * radians,
            torque: f64::from(torque) * 1e-3 * shaft.rated_torque,
            way: 0.0,
        };
        let before = motion.last().copied().unwrap_or(next);
        let unknown = if whole > BRIDGED { f64::NAN } else { 0.0 };
        for step in 1..whole as usize {
            let part = step as f64 / whole;
            motion.push(Sample {
                angle: before.angle + part * (next.angle - before.angle) + unknown,
                torque: before.torque + part * (next.torque - before.torque),
                way: 0.0,
            });
        }
        motion.push(next);
    }
    Ok(motion)
}
