//! How far the loops of a cascade are from swinging by themselves, and gains that keep a distance.
//!
//! Everything is linear here: the axis of two inertias on a spring ([`DriveTrain`]), its friction but the viscous one left out, and
//! the cascade as it computes, sample by sample, with its filters, notches and the current loop. A response is
//! computed at a complex `s`, so that the same formula says what a sine comes to (`s = jω`) and where a
//! loop swings (`1 + L(s) = 0`).
//!
//! A loop that is sampled every `h` sees the axis through a hold, `(1 − e^(−sh)) / sh`, and takes the speed from the
//! difference of two positions, which is the same factor once more. Aliases are left out: the axis takes nothing up at
//! half the sampling rate.
//!
//! Margins are read off the response of the open loop, where its magnitude is 1 and where it is real and negative, each at the crossing that
//! is nearest to −1, as an elastic axis has several. Whether the closed loop is stable is not told by margins alone, so
//! that `1 + L` is followed from low frequencies to the highest: without a pole of the open loop on the right it has to turn by what
//! its integrators turned it at the beginning (Nyquist).
//!
//! Gains are sought for the stiffest position loop. The integral time keeps its ratio to the speed loop's
//! bandwidth; of each bandwidth, the greatest gain of the position loop that [`Distance`] allows is found by bisection, and of the
//! bandwidths the fastest that allows nearly the most: near the best one it hardly matters for that gain, and does for all that pushes
//! the axis. Margins alone would not do for a load on a soft spring: loops that hold
//! the motor firmly have them all, and the load swings on as if the motor were clamped. So the load's own answer to the
//! setpoint may have no peak beyond a bound. (Tried before, and worse: the fixed part of the antiresonance at which
//! simulated axes are commissioned. It wastes a third of the gain on well damped axes, and leaves loads that are heavier than the
//! motor's by far with hardly any damping.)

use super::cascade::{Gains, POSITION_STEP, SPEED_STEP};
use super::filter::NotchShape;
use crate::mechanics::drive_train::DriveTrain;
use core::f64::consts::{PI, TAU};
use nalgebra::{Complex, ComplexField};
use serde::Serialize;

/// Frequencies that are looked at, Hz.
const FREQUENCIES: (f64, f64) = (0.02, 7000.0);
/// How many of them, each by the same part above the one before.
const COUNT: usize = 2400;

/// How far loops are to be from swinging.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distance {
    /// Phase margin of both loops, degrees.
    pub phase: f64,
    /// Gain margin of both loops, dB.
    pub gain: f64,
    /// The greatest that a swinging setpoint of amplitude 1 makes of the load.
    pub peak: f64,
}

/// How far a loop is from swinging.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Margins {
    /// What its phase may lose where its magnitude is 1, degrees.
    pub phase: f64,
    /// By what its gain may change, dB.
    pub gain: f64,
    /// The highest frequency at which its magnitude is 1, Hz.
    pub crossover: f64,
}

/// Both loops of a cascade, each with what it contains closed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Stability {
    /// Of the speed loop.
    pub speed: Margins,
    /// Of the position loop.
    pub position: Margins,
    /// The greatest that a swinging setpoint of amplitude 1 makes of the load.
    pub peak: f64,
}

impl Stability {
    /// The lesser margins of both, and the greater peak.
    #[must_use]
    pub fn least(&self, other: &Self) -> Self {
        let least = |one: Margins, other: Margins| Margins {
            phase: one.phase.min(other.phase),
            gain: one.gain.min(other.gain),
            crossover: one.crossover.max(other.crossover),
        };
        Self {
            speed: least(self.speed, other.speed),
            position: least(self.position, other.position),
            peak: self.peak.max(other.peak),
        }
    }

    /// Whether they are as far from swinging as is wanted.
    #[must_use]
    pub fn keeps(&self, distance: &Distance) -> bool {
        let keeps = |it: &Margins| it.phase >= distance.phase && it.gain >= distance.gain;
        keeps(&self.speed) && keeps(&self.position) && self.peak <= distance.peak
    }
}

/// A swing that dies out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Mode {
    /// Of the undamped one, Hz.
    pub frequency: f64,
    /// Damping ratio.
    pub damping: f64,
}

impl Mode {
    /// How fast it dies out, 1/s over 2 π.
    #[must_use]
    pub fn rate(&self) -> f64 {
        self.damping * self.frequency
    }
}

/// What an axis makes of a torque, at one frequency.
#[derive(Clone, Copy, Debug)]
struct Response {
    s: Complex<f64>,
    /// Speed of the motor, rad/s, by torque, N·m.
    motor: Complex<f64>,
    /// Of the load by that of the motor.
    load: Complex<f64>,
    /// What the position loop sees, by that of the motor: its own position, or the load's.
    fed_back: Complex<f64>,
}

impl Response {
    fn at(train: &DriveTrain, s: Complex<f64>) -> Self {
        let rotor = s * train.rotor_inertia + train.bearing.viscous;
        let load = s * train.load_inertia + train.guide.viscous;
        let (coupled, follows) = match train.elasticity {
            Some(spring) => {
                let between = s.inv() * spring.stiffness + spring.damping;
                (
                    between * load / (between + load),
                    between / (between + load),
                )
            }
            None => (load, Complex::from(1.0)),
        };
        Self {
            s,
            motor: (rotor + coupled).inv(),
            load: follows,
            fed_back: Complex::from(1.0),
        }
    }
}

/// What is held over steps of `h`, or the mean over one.
fn hold(s: Complex<f64>, h: f64) -> Complex<f64> {
    (-(-s * h).exp() + 1.0) / (s * h)
}

/// A filter of a time constant, as it is computed every [`SPEED_STEP`].
fn low_pass(s: Complex<f64>, time_constant: f64) -> Complex<f64> {
    let share = SPEED_STEP / (time_constant + SPEED_STEP);
    (-(-s * SPEED_STEP).exp() * (1.0 - share) + 1.0).inv() * share
}

fn notch(s: Complex<f64>, shape: &NotchShape) -> Complex<f64> {
    let turn = TAU * shape.frequency;
    let wide = s * turn * shape.bandwidth;
    let square = s * s + turn * turn;
    (square + wide * (1.0 - shape.depth)) / (square + wide)
}

/// Loops and what they move, at one frequency.
#[derive(Clone, Copy, Debug)]
struct OpenLoops {
    speed: Complex<f64>,
    position: Complex<f64>,
    /// What the position of the load is of the setpoint, with the position loop closed.
    load: Complex<f64>,
}

impl OpenLoops {
    /// `current` is the bandwidth of the current loop, rad/s.
    fn at(gains: &Gains, axis: &Response, current: f64) -> Self {
        let s = axis.s;
        let delayed = (-s * SPEED_STEP).exp();
        let integral = (-delayed + 1.0).inv() * (SPEED_STEP / gains.speed_integral_time);
        let mut torque = (integral + 1.0) * (gains.speed / TAU);
        if gains.torque_filter > 0.0 {
            torque *= low_pass(s, gains.torque_filter);
        }
        for shape in gains.notches.iter().flatten() {
            torque *= notch(s, shape);
        }
        let forward = torque * hold(s, SPEED_STEP) * axis.motor / (s / current + 1.0);
        let speed = forward * hold(s, SPEED_STEP) * low_pass(s, gains.speed_filter);
        let reference = hold(s, POSITION_STEP) * low_pass(s, gains.speed_reference_filter);
        let motor = reference * forward / (speed + 1.0) / s * gains.position;
        let position = motor * axis.fed_back;
        Self {
            speed,
            position,
            load: motor / (position + 1.0) * axis.load,
        }
    }
}

/// An axis whose loops are looked at.
#[derive(Clone, Debug)]
pub struct Tuning {
    train: DriveTrain,
    current: f64,
    /// The position loop is closed by a scale at the load.
    by_scale: bool,
    responses: Vec<Response>,
}

impl Tuning {
    /// Of an axis behind a current loop of this bandwidth, rad/s; infinite where torque follows at once.
    #[must_use]
    pub fn new(train: DriveTrain, current: f64) -> Self {
        let (first, last) = FREQUENCIES;
        let step = (last / first).ln() / (COUNT - 1) as f64;
        let at = |n: usize| {
            let turn = TAU * first * (step * n as f64).exp();
            Response::at(&train, Complex::new(0.0, turn))
        };
        Self {
            responses: (0..COUNT).map(at).collect(),
            train,
            current,
            by_scale: false,
        }
    }

    /// The same where a scale at the load closes the position loop.
    #[must_use]
    pub fn by_scale(mut self) -> Self {
        self.by_scale = true;
        for it in &mut self.responses {
            it.fed_back = it.load;
        }
        self
    }

    /// What the axis makes of a torque, and the position loop sees of that.
    fn response(&self, s: Complex<f64>) -> Response {
        let response = Response::at(&self.train, s);
        match self.by_scale {
            true => Response {
                fed_back: response.load,
                ..response
            },
            false => response,
        }
    }

    /// The gains with that of the position loop as much lower as it takes for this distance of that loop from swinging; as
    /// they are where nothing helps.
    #[must_use]
    pub fn calmed(&self, gains: &Gains, distance: &Distance) -> Gains {
        let slower = |by: f64| Gains {
            position: gains.position * by.exp(),
            ..gains.clone()
        };
        let keeps = |by: f64| {
            let stability = self.stability(&slower(by));
            stability.is_some_and(|it| {
                let Margins { phase, gain, .. } = it.position;
                phase >= distance.phase && gain >= distance.gain && it.peak <= distance.peak
            })
        };
        let (mut low, mut high) = (SLOWEST.ln(), 0.0);
        if keeps(high) || !keeps(low) {
            return gains.clone();
        }
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            match keeps(middle) {
                true => low = middle,
                false => high = middle,
            }
        }
        slower(low)
    }

    /// How far both loops are from swinging; `None` if one of them is not stable.
    #[must_use]
    pub fn stability(&self, gains: &Gains) -> Option<Stability> {
        let all = self.responses.iter();
        let loops: Vec<_> = all
            .map(|it| OpenLoops::at(gains, it, self.current))
            .collect();
        Some(Stability {
            speed: self.margins(loops.iter().map(|it| it.speed))?,
            position: self.margins(loops.iter().map(|it| it.position))?,
            peak: loops.iter().map(|it| it.load.modulus()).fold(0.0, f64::max),
        })
    }

    /// How far the speed loop is from swinging, whatever closes a loop about it; `None` if it is not stable.
    #[must_use]
    pub fn speed_margins(&self, gains: &Gains) -> Option<Margins> {
        let all = self.responses.iter();
        let open: Vec<_> = all
            .map(|it| OpenLoops::at(gains, it, self.current).speed)
            .collect();
        self.margins(open.iter().copied())
    }

    /// Whether both loops are as far from swinging as is wanted.
    #[must_use]
    pub fn keeps(&self, gains: &Gains, distance: &Distance) -> bool {
        self.stability(gains).is_some_and(|it| it.keeps(distance))
    }

    /// Of an open loop; `None` if it is not stable once it is closed.
    fn margins(&self, open: impl Iterator<Item = Complex<f64>> + Clone) -> Option<Margins> {
        let mut margins = Margins {
            phase: f64::INFINITY,
            gain: f64::INFINITY,
            crossover: 0.0,
        };
        let first = open.clone().next()?;
        let mut turned = (first + 1.0).argument();
        let pairs = open.clone().zip(open.skip(1)).zip(&self.responses);
        for ((one, next), response) in pairs {
            turned += ((next + 1.0) / (one + 1.0)).argument();
            let over = |it: Complex<f64>| it.modulus().ln();
            if (over(one) > 0.0) != (over(next) > 0.0) {
                let part = over(one) / (over(one) - over(next));
                let phase = (-(one + (next - one) * part)).argument().abs().to_degrees();
                margins.phase = margins.phase.min(phase);
                margins.crossover = margins.crossover.max(response.s.im / TAU);
            }
            if (one.im > 0.0) != (next.im > 0.0) {
                let part = one.im / (one.im - next.im);
                let real = one.re + (next.re - one.re) * part;
                if real < 0.0 {
                    margins.gain = margins.gain.min((20.0 * (-real).log10()).abs());
                }
            }
        }
        (turned.abs() < PI).then_some(margins)
    }

    /// The open loops at so many frequencies from `from` to `to`, Hz: frequency, speed loop, position loop.
    #[must_use]
    pub fn open_loops(
        &self,
        gains: &Gains,
        (from, to): (f64, f64),
    ) -> Vec<(f64, Complex<f64>, Complex<f64>)> {
        let hertz = |it: &&Response| (from..=to).contains(&(it.s.im / TAU));
        let seen = self.responses.iter().filter(hertz);
        seen.map(|it| {
            let loops = OpenLoops::at(gains, it, self.current);
            (it.s.im / TAU, loops.speed, loops.position)
        })
        .collect()
    }

    /// The gains, others being as they are in `like`, with which the position loop is as stiff as the distance from swinging allows;
    /// its speed loop is not faster than that of `like`. `None` if there are none.
    #[must_use]
    pub fn tuned(&self, like: &Gains, distance: &Distance) -> Option<Gains> {
        Self::tuned_for(&[self], like, distance)
    }

    /// The same of an axis that may be any of these, which have the inertia of the first.
    #[must_use]
    pub fn tuned_for(axes: &[&Self], like: &Gains, distance: &Distance) -> Option<Gains> {
        let train = &axes.first()?.train;
        let inertia = train.rotor_inertia + train.load_inertia;
        let fastest = like.speed / (TAU * like.inertia);
        let ratio = like.speed_integral_time * fastest;
        let of = |bandwidth: f64, position: f64| Gains {
            position,
            speed: TAU * bandwidth * inertia,
            speed_integral_time: ratio / bandwidth,
            inertia,
            ..like.clone()
        };
        let keeps = |gains: &Gains| axes.iter().all(|axis| axis.keeps(gains, distance));
        // The greatest gain of the position loop at a bandwidth, in parts of the fastest.
        let stiffest = |slower: f64| {
            let bandwidth = fastest * slower.exp();
            let (mut low, mut high) = (1e-3_f64.ln(), 0.0_f64);
            if !keeps(&of(bandwidth, bandwidth * low.exp())) {
                return f64::NEG_INFINITY;
            }
            for _ in 0..HALVINGS {
                let middle = 0.5 * (low + high);
                match keeps(&of(bandwidth, bandwidth * middle.exp())) {
                    true => low = middle,
                    false => high = middle,
                }
            }
            slower + low
        };
        let step = -SLOWEST.ln() / (BANDWIDTHS - 1) as f64;
        let coarse: Vec<f64> = (0..BANDWIDTHS).map(|n| -step * n as f64).collect();
        let found: Vec<f64> = coarse.iter().map(|&slower| stiffest(slower)).collect();
        let at = (0..BANDWIDTHS).max_by(|&one, &other| found[one].total_cmp(&found[other]))?;
        let (mut best, mut most, mut reach) = (coarse[at], found[at], step);
        for _ in 0..REFINED {
            reach *= 0.5;
            for slower in [best - reach, (best + reach).min(0.0)] {
                let stiffness = stiffest(slower);
                if stiffness > most {
                    (best, most) = (slower, stiffness);
                }
            }
        }
        if !most.is_finite() {
            return None;
        }
        // The stiffness hardly depends on the bandwidth near the best one.
        let enough = most - STIFFNESS_FOR_BANDWIDTH;
        let fast = (0..BANDWIDTHS).find(|&n| found[n] >= enough);
        let mut slow = fast.map_or(best, |n| coarse[n]);
        let mut faster = (slow + step).min(0.0);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (slow + faster);
            match stiffest(middle) >= enough {
                true => slow = middle,
                false => faster = middle,
            }
        }
        Some(of(fastest * slow.exp(), fastest * enough.exp()))
    }

    /// The swing of the closed position loop that takes longest to die out; `None` if none has less than [`DAMPED`] damping.
    #[must_use]
    pub fn slowest_swing(&self, gains: &Gains) -> Option<Mode> {
        let characteristic =
            |s: Complex<f64>| OpenLoops::at(gains, &self.response(s), self.current).position + 1.0;
        let starts = self.responses.iter().step_by(24).map(|it| it.s);
        let roots = starts.filter_map(|start| {
            let (mut s, mut before) = (start, start * Complex::new(-0.05, 1.01));
            let mut last = characteristic(before);
            for _ in 0..60 {
                let value = characteristic(s);
                let step = value * (s - before) / (value - last);
                (before, last) = (s, value);
                s -= step;
                if !s.is_finite() {
                    return None;
                }
                if step.modulus() < 1e-9 * s.modulus() {
                    break;
                }
            }
            let damping = -s.re / s.modulus();
            let found = characteristic(s).modulus() < 1e-6 && s.im > 0.0;
            (found && damping < DAMPED).then(|| Mode {
                frequency: s.modulus() / TAU,
                damping,
            })
        });
        roots.min_by(|one, other| one.rate().total_cmp(&other.rate()))
    }
}

/// Bandwidths of the speed loop that are tried, down to this part of the fastest; then so often between the best one and its neighbours.
const BANDWIDTHS: usize = 24;
const SLOWEST: f64 = 1e-3;
const REFINED: usize = 6;
/// What of its stiffness the position loop gives for a faster speed loop: 2 %.
const STIFFNESS_FOR_BANDWIDTH: f64 = 0.02;
/// How often the range of a gain is halved: to 0.2 %.
const HALVINGS: usize = 12;
/// A swing of this damping ratio is gone after one and a half periods.
pub const DAMPED: f64 = 0.3;

#[cfg(test)]
mod tests;
