//! What an axis answers torque with, over frequency, as a log shows it and without a model.
//!
//! Speed over torque is the mean over stretches of two seconds of the cross spectrum of both by the power spectrum of the
//! torque (Welch, 1967). Stretches lie within motion one way without a rest: there friction and gravity are a
//! constant that goes with the mean. A log tells what it was moved with: the coherence of a frequency is the part of the speed's power
//! that the torque explains, and a frequency of which it explains too little is left out. What is noise in the torque
//! makes the gain too small by as much as coherence lacks of 1, at most.
//!
//! A speed is what the axis moves from the row before to the row behind, and a torque is taken to be the mean over twice the
//! delay with which it is told, which the [estimate](super::estimate) found: both are too little by a factor that is known.

use super::AxisSample;
use super::estimate::{Estimate, Shaft};
use crate::observe::fourier::Window;
use serde::Serialize;
use std::f64::consts::{PI, TAU};

/// How long a stretch is, s.
const LENGTH: f64 = 2.048;
/// Of a torque that varies so fast that its mean hides all but this part of it nothing is told.
const SHOWN: f64 = 0.3;
/// Stretches that have to be there for a mean, and to tell coherence from chance.
const LEAST: usize = 8;
/// A frequency of less coherence is left out.
const COHERENT: f64 = 0.9;
/// The lowest bin: what the window smears of the ones below is no more than the axis' own answer there.
const LOWEST: usize = 5;
/// The highest, as a part of the sampling rate: above it a difference from row to row hides what moves.
const HIGHEST: f64 = 0.3;
/// An axis that moves by less in two cycles may stand still, increments.
const STILL: f64 = 2.5;
/// Over so many cycles a gap is bridged by a straight line.
const BRIDGED: i64 = 3;

/// Speed over torque of the motor's shaft at a frequency.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Response {
    /// Hz.
    pub frequency_hz: f64,
    /// rad/s per N·m.
    pub gain: f64,
    /// Degrees, from −180 to 180.
    pub phase_deg: f64,
    /// Part of the speed's power that the torque explains, 0…1.
    pub coherence: f64,
    /// The gain of an axis as it was estimated.
    pub model_gain: f64,
    /// Its phase.
    pub model_phase_deg: f64,
}

/// Frequencies at which a log shows how the axis answers, ascending; none where it does not move for long enough one way.
#[must_use]
pub fn response(samples: &[AxisSample], shaft: &Shaft, estimate: &Estimate) -> Vec<Response> {
    let window = Window::new((LENGTH / shaft.cycle).round() as usize);
    let rows = window.length();
    let bins = LOWEST..=(HIGHEST * rows as f64) as usize;
    // Of torque, of speed, and of both.
    let mut powers = vec![[0.0; 4]; *bins.end() + 1];
    let mut stretches = 0;
    for stroke in strokes(samples, shaft) {
        let mut first = 0;
        while first + rows <= stroke.len() {
            let column = |of: fn(&Moving) -> f64| -> Vec<f64> {
                stroke[first..first + rows].iter().map(of).collect()
            };
            let torque = window.weighted(&column(|it| it.torque));
            let speed = window.weighted(&column(|it| it.speed));
            for bin in bins.clone() {
                let ([t, u], [v, w]) = (window.bin(&torque, bin), window.bin(&speed, bin));
                let [of_torque, of_speed, re, im] = &mut powers[bin];
                *of_torque += t * t + u * u;
                *of_speed += v * v + w * w;
                // A transform by e^(i ω t) has the other sign in its imaginary part.
                *re += v * t + w * u;
                *im += v * u - w * t;
            }
            stretches += 1;
            first += rows / 2;
        }
    }
    let told = bins.filter(|_| stretches >= LEAST).filter_map(|bin| {
        let [torque, speed, re, im] = powers[bin];
        let coherence = (re * re + im * im) / (torque * speed);
        let frequency = bin as f64 / (rows as f64 * shaft.cycle);
        let late = TAU * frequency * estimate.torque_delay_s;
        let (of_speed, of_torque) = (of_mean(TAU * frequency * shaft.cycle), of_mean(late));
        let phase = im.atan2(re) - late;
        let (model_gain, model_phase) = model(estimate, frequency);
        (coherence >= COHERENT && of_torque >= SHOWN).then(|| Response {
            frequency_hz: frequency,
            gain: re.hypot(im) / torque * of_torque / of_speed,
            phase_deg: degrees(phase),
            coherence,
            model_gain,
            model_phase_deg: degrees(model_phase),
        })
    });
    told.collect()
}

/// What is left of a sine in the mean over that angle to both sides of it.
fn of_mean(angle: f64) -> f64 {
    match angle == 0.0 {
        true => 1.0,
        false => angle.sin() / angle,
    }
}

fn degrees(phase: f64) -> f64 {
    ((phase + PI).rem_euclid(TAU) - PI).to_degrees()
}

/// A row in motion.
struct Moving {
    /// N·m.
    torque: f64,
    /// rad/s.
    speed: f64,
}

/// The rows of a log in motion, a run of them for each stretch one way without a rest or a gap.
fn strokes(samples: &[AxisSample], shaft: &Shaft) -> Vec<Vec<Moving>> {
    let mut strokes = Vec::new();
    for [angles, torques] in without_gaps(samples, shaft) {
        let mut stroke: Vec<Moving> = Vec::new();
        for row in 1..angles.len().saturating_sub(1) {
            let moved = angles[row + 1] - angles[row - 1];
            let speed = moved / (2.0 * shaft.cycle);
            let rests = moved.abs() < STILL * shaft.resolution * shaft.radians;
            let turns = stroke.last().is_some_and(|it| it.speed * speed < 0.0);
            if rests || turns {
                strokes.push(std::mem::take(&mut stroke));
            }
            if !rests {
                let torque = torques[row];
                stroke.push(Moving { torque, speed });
            }
        }
        strokes.push(stroke);
    }
    strokes
}

/// Angles and torques at every cycle, a pair of columns from each gap to the next; short ones are bridged.
fn without_gaps(samples: &[AxisSample], shaft: &Shaft) -> Vec<[Vec<f64>; 2]> {
    let mut parts: Vec<[Vec<f64>; 2]> = Vec::new();
    let mut before: Option<(f64, [f64; 2])> = None;
    for sample in samples {
        let Some(torque) = sample.torque.mean else {
            continue;
        };
        let now = [
            sample.act * shaft.radians,
            torque * 1e-3 * shaft.rated_torque,
        ];
        let gap = before.map(|(time, last)| (((sample.time - time) / shaft.cycle).round(), last));
        match (gap, parts.last_mut()) {
            (Some((cycles, last)), Some(part)) if (1..=BRIDGED).contains(&(cycles as i64)) => {
                for cycle in 1..=cycles as i64 {
                    let share = cycle as f64 / cycles;
                    for (column, values) in part.iter_mut().enumerate() {
                        values.push(last[column] + share * (now[column] - last[column]));
                    }
                }
            }
            _ => parts.push(now.map(|value| vec![value])),
        }
        before = Some((sample.time, now));
    }
    parts
}

/// Gain, rad/s per N·m, and phase, rad, of an axis as it was estimated: rigid, or with a load that swings, where its resonance is
/// known.
fn model(estimate: &Estimate, frequency: f64) -> (f64, f64) {
    let omega = TAU * frequency;
    let of = |hertz: f64, damping: f64| {
        let part = frequency / hertz;
        [1.0 - part * part, 2.0 * damping * part]
    };
    let rigid = [
        estimate.viscous_friction.value,
        estimate.inertia.value * omega,
    ];
    let (mut above, mut below) = ([1.0, 0.0], [1.0, 0.0]);
    if let Some(swing) = &estimate.swing
        && let Some(resonance) = &swing.resonance
    {
        let (free, both) = (swing.antiresonance.value, resonance.value);
        let damping = swing.damping.map_or(0.0, |it| it.value);
        above = of(free, damping * free / both);
        below = of(both, damping);
    }
    let size = |[re, im]: [f64; 2]| re.hypot(im);
    let phase = |[re, im]: [f64; 2]| im.atan2(re);
    (
        size(above) / (size(rigid) * size(below)),
        phase(above) - phase(rigid) - phase(below),
    )
}
