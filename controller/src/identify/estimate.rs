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
//! That is enough where the load swings well above what the windows see, and where nothing is known of higher frequencies
//! than a window has by itself. Where the load swings within that, the load J₂ and its spring k, with a damper d, are told apart
//! from the motor J₁ by eliminating the load's angle from the equations of both:
//!
//! ```text
//! τ + b₁ τ̇ + b₂ τ̈ = a₂ φ̈ + C sign φ̇ + B φ̇ + G + a₃ φ⃛ + J₁ b₂ φ⁗
//! b₁ = (d + B₂)/k   b₂ = J₂/k = 1/ω²   a₂ = J + B₁ b₁ + B₂ d/k   a₃ = J₁ b₁ + J₂ d/k + B₁ b₂
//! ```
//!
//! with ω the antiresonance, at which the load swings while the motor stands, and `B = B₁ + B₂` the viscous friction of
//! motor and load, of which the motor's is known from its figures. It is linear too, with two columns more, the derivatives of
//! the torque. A torque that is told late by δ has `a₃ − J δ` in the place of a₃, to the first order: δ follows from that,
//! and the windows of the torque are put later by it, until nothing is left. The resonance, at which both swing against each
//! other, is `ω √(J/J₁)`, its damping ratio `d/2k` times that.
//!
//! Of a stiff axis the torque is `J φ̈` and its derivatives are nothing new: the two columns then cost certainty and bring
//! none. Both equations are solved, and the second is told where its intervals are clearly narrower. Antiresonance and resonance are told
//! where the setpoint moves the axis at such frequencies, and they are certain enough.
//!
//! A fit knows only of noise. That the model itself is not the axis shows in what windows of other lengths say, as these see
//! other frequencies: the greatest difference to them counts as uncertainty too.

use super::AxisSample;
use super::fit::{Factors, Fit};
use super::windows::{ELASTIC, Look, STIFF, Sample, View};
use serde::Serialize;
use std::f64::consts::TAU;

/// How long windows are, s: those that are told, and what they are compared with.
const WINDOWS: [f64; 3] = [0.12, 0.06, 0.24];
/// The same where the transmission swings, as its slow swings take longer to see, and the highest frequency that they look at,
/// of the cycle's.
const ELASTIC_WINDOWS: [(f64, f64); 3] = [(0.24, 0.2), (0.18, 0.15), (0.32, 0.1)];
/// So often the delay of the torque is looked for at most.
const DELAYED: usize = 8;
/// When it is found, s.
const FOUND: f64 = 1e-6;
/// A torque is not told later than this, s.
const LATEST: f64 = 0.05;
/// By how much of a cycle position and torque are told at other times than they are taken to be.
const TIMED: f64 = 0.01;
/// How much narrower the intervals of a load that swings have to be than those of a stiff axis, for it to be told.
const NARROWER: f64 = 2.0;
/// A swing whose frequencies are less certain than by this part of them is not identified.
const CERTAIN: f64 = 0.1;
/// The same of its damping.
const DAMPING_CERTAIN: f64 = 0.5;
/// An axis that moves by less in two cycles may stand still, increments.
const STILL: f64 = 2.5;
/// How long behind a rest or a reversal nothing is told of it, s.
const SETTLING: f64 = 0.1;
/// The same where the transmission swings: the load turns round later than the motor.
const ELASTIC_SETTLING: f64 = 0.4;
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
    /// Viscous friction of the motor alone, N·m·s/rad, where its figures are known.
    pub motor_viscous_friction: Option<f64>,
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
    /// How its load swings behind the transmission, if the log shows it.
    pub swing: Option<Swing>,
    /// The highest frequency at which the setpoint moved the axis so that a swing would have shown, Hz.
    pub seen_to_hz: f64,
    /// For how long it moved one way, without rests and reversals, s.
    pub moving_s: f64,
}

/// A load that swings behind its transmission.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Swing {
    /// At which the load swings while the motor stands, Hz.
    pub antiresonance: Figure,
    /// At which both swing against each other, Hz, if that is within what the log shows.
    pub resonance: Option<Figure>,
    /// Damping ratio of that swing, if it shows.
    pub damping: Option<Figure>,
}

/// Why a log says nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NotEstimated {
    /// The samples have no place in time.
    #[error(
        "the log's times do not go on in steps of the machine's cycle, {} ms, at {time} s: take the machine file of the \
         run, and a log as it was written, with times in seconds",
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
    /// There is no torque in it.
    #[error(
        "the log's torque is 0 all along, which moves nothing: the drive tells none in 6077h, or the column is that of \
         something else"
    )]
    Torqueless,
    /// The torque goes against what it moves.
    #[error(
        "the inertia comes out below 0, at {inertia:.3e} kg·m²: the torque is counted against the axis's positive direction, \
         or it is that of another axis"
    )]
    Backwards {
        /// What comes out, kg·m².
        inertia: f64,
    },
    /// All of its motion is alike.
    #[error(
        "inertia, friction and gravity cannot be told apart: the log needs motion in both directions, at several speeds, that \
         takes torque to speed up; it goes no faster than {speed:.3} mm/s or °/s"
    )]
    Alike {
        /// The greatest speed of the setpoints, mm/s or °/s.
        speed: f64,
    },
}

/// What a log says of its axis.
///
/// # Errors
/// It says nothing.
pub fn estimate(samples: &[AxisSample], shaft: &Shaft) -> Result<Estimate, NotEstimated> {
    let sampled = sampled(samples, shaft)?;
    let motion = |settling| motion(&sampled, shaft, settling);
    let stiff = motion(SETTLING);
    let moving = stiff
        .iter()
        .filter(|sample| sample.direction != 0.0)
        .count();
    let moves = moving as f64 * shaft.cycle;
    if moves < LEAST {
        return Err(NotEstimated::Rests { moves });
    }
    if sampled.iter().all(|sample| sample.torque == 0.0) {
        return Err(NotEstimated::Torqueless);
    }
    let stiff = compared(WINDOWS, |window| undelayed(&stiff, shaft, window));
    let elastic = motion(ELASTIC_SETTLING);
    let elastic = compared(ELASTIC_WINDOWS, |window| swinging(&elastic, shaft, window));
    let swing = elastic.as_ref().and_then(swing);
    // A window shows what swings through it once.
    let seen_to_hz = elastic.map_or(WINDOWS[0].recip(), |it| it[8].value);
    let elastic = elastic.map(|[one, two, three, four, delay, ..]| [one, two, three, four, delay]);
    let is_narrower =
        |elastic: &[Figure; 5]| stiff.is_none_or(|stiff| NARROWER * width(elastic) < width(&stiff));
    let found = elastic.filter(is_narrower).or(stiff);
    let Some([inertia, friction, viscous_friction, holding_torque, delay]) = found else {
        let steps = sampled
            .windows(2)
            .map(|two| (two[1].set - two[0].set).abs());
        let speed = steps.fold(0.0, f64::max) / shaft.radians.abs() / shaft.cycle;
        return Err(NotEstimated::Alike { speed });
    };
    let is_below_nothing = |it: Figure| it.value < -it.uncertainty;
    if is_below_nothing(inertia) || (is_below_nothing(friction) && !inertia.differs_from_nothing())
    {
        let inertia = inertia.value;
        return Err(NotEstimated::Backwards { inertia });
    }
    Ok(Estimate {
        inertia,
        friction,
        viscous_friction,
        holding_torque,
        torque_delay_s: delay.value,
        swing,
        seen_to_hz,
        moving_s: moves,
    })
}

/// Figures by the first of three windows, and how uncertain they are: by the noise within it, and by what the other two say.
fn compared<W, const FIGURES: usize>(
    windows: [W; 3],
    read: impl Fn(W) -> Option<[Figure; FIGURES]>,
) -> Option<[Figure; FIGURES]> {
    let [Some(told), Some(one), Some(other)] = windows.map(read) else {
        return None;
    };
    Some(std::array::from_fn(|at| {
        let model = [&one, &other].map(|it| (it[at].value - told[at].value).abs());
        told[at].widened(model[0].max(model[1]))
    }))
}

/// How uncertain inertia and both frictions are, in parts of them.
fn width(figures: &[Figure; 5]) -> f64 {
    let parts = figures[..3].iter().map(Figure::part);
    // Not known at all where one is not a number.
    parts.fold(0.0, |widest, part| {
        if part > widest || part.is_nan() {
            part
        } else {
            widest
        }
    })
}

/// What is told of an axis that is stiff within what the windows see: inertia, both frictions, what holds it, and the delay
/// of its torque, s.
fn undelayed(motion: &[Sample], shaft: &Shaft, window: f64) -> Option<[Figure; 5]> {
    let look = Look {
        window,
        highest: 0.0,
        delay: 0.0,
    };
    let fit = Fit::new(&View::new(motion, shaft.cycle, &look)?, STIFF)?;
    // To the first order: what the delay takes off the inertia is little.
    let delay = |factors: &Factors| -factors[4] / factors[0];
    Some([
        fit.figure(|it| it[0] + it[2] * delay(it)),
        fit.figure(|it| it[1]),
        fit.figure(|it| it[2]),
        fit.figure(|it| it[3]),
        fit.figure(delay),
    ])
}

/// The same where the load swings, and behind it antiresonance and resonance, Hz, damping ratio, and the highest frequency that
/// was seen, Hz.
fn swinging(
    motion: &[Sample],
    shaft: &Shaft,
    (window, highest): (f64, f64),
) -> Option<[Figure; 9]> {
    let mut look = Look {
        window,
        highest: highest / shaft.cycle,
        // A mean over a cycle is that late.
        delay: 0.5 * shaft.cycle,
    };
    let mut tries = 0;
    let (fit, later) = loop {
        let fit = Fit::new(&View::new(motion, shaft.cycle, &look)?, ELASTIC)?;
        let later = two_masses(&fit, shaft, |it| it.delay);
        tries += 1;
        if later.value.abs() < FOUND || tries == DELAYED {
            break (fit, later);
        }
        look.delay += later.value;
        // Not a number is none either.
        let is_possible = look.delay.abs() < LATEST;
        if !is_possible {
            return None;
        }
    };
    let resonance = two_masses(&fit, shaft, |it| it.resonance);
    let damping = two_masses(&fit, shaft, |it| 0.5 * it.damper * TAU * it.resonance);
    Some([
        two_masses(&fit, shaft, |it| it.inertia),
        fit.figure(|it| it[1]),
        fit.figure(|it| it[2]),
        fit.figure(|it| it[3]),
        later.plus(look.delay),
        fit.figure(|it| it[7].sqrt().recip() / TAU),
        resonance,
        damping.widened(0.5 * TAU * resonance.value * TIMED * shaft.cycle),
        Figure {
            value: fit.highest,
            uncertainty: 0.0,
        },
    ])
}

/// A number that follows from motor and load; where it is not known what of the friction is the motor's, it may be all or
/// nothing.
fn two_masses(fit: &Fit, shaft: &Shaft, read: fn(&TwoMasses) -> f64) -> Figure {
    let [least, most] = [0.0, 1.0].map(|part| {
        let of_motor = |viscous: f64| shaft.motor_viscous_friction.unwrap_or(part * viscous);
        fit.figure(|it| read(&TwoMasses::of(it, of_motor(it[2]))))
    });
    let half = 0.5 * (most.value - least.value);
    least.plus(half).widened(half)
}

/// A motor and a load with a spring between them, from the factors of their equation.
struct TwoMasses {
    /// Of both, kg·m².
    inertia: f64,
    /// Damper over spring, s.
    damper: f64,
    /// Hz.
    resonance: f64,
    /// By how much later than the windows have it the torque is told, s.
    delay: f64,
}

/// So often viscous friction is taken off the inertia.
const CORRECTED: usize = 3;

impl TwoMasses {
    /// Of whose viscous friction so much is the motor's, N·m·s/rad.
    fn of(factors: &Factors, of_motor: f64) -> Self {
        let [second, viscous, third, fourth, b1, b2] = [0, 2, 4, 5, 6, 7].map(|at| factors[at]);
        let of_load = viscous - of_motor;
        let motor = fourth / b2;
        let mut inertia = second;
        let mut damper = b1;
        for _ in 0..CORRECTED {
            let stiffness = (inertia - motor) / b2;
            damper = b1 - of_load / stiffness;
            inertia = second - of_motor * b1 - of_load * damper;
        }
        let load = inertia - motor;
        Self {
            inertia,
            damper,
            resonance: (inertia / (motor * b2)).sqrt() / TAU,
            delay: (motor * b1 + load * damper + of_motor * b2 - third) / inertia,
        }
    }
}

/// The swing among these figures, where it is certain enough: one that the log does not show has factors that mean nothing.
fn swing(&[.., antiresonance, resonance, damping, highest]: &[Figure; 9]) -> Option<Swing> {
    let is_seen = |it: &Figure| it.value <= highest.value && it.part() < CERTAIN;
    // A motor and a load that swing as one do not swing.
    let apart = resonance.value - antiresonance.value;
    let is_swing = apart > resonance.uncertainty.hypot(antiresonance.uncertainty);
    if !(is_swing && is_seen(&antiresonance)) {
        return None;
    }
    let resonance = Some(resonance).filter(is_seen);
    let damping = Some(damping).filter(|it| it.value > 0.0 && it.part() < DAMPING_CERTAIN);
    Some(Swing {
        antiresonance,
        resonance,
        damping: resonance.and(damping),
    })
}

impl Figure {
    /// Whether the log tells it from nothing.
    pub(super) fn differs_from_nothing(self) -> bool {
        self.value.abs() > self.uncertainty
    }

    /// In another unit.
    pub(super) fn times(self, scale: f64) -> Self {
        Self {
            value: scale * self.value,
            uncertainty: scale * self.uncertainty,
        }
    }

    fn plus(self, more: f64) -> Self {
        Self {
            value: self.value + more,
            ..self
        }
    }

    /// Uncertain by this too.
    pub(super) fn widened(self, more: f64) -> Self {
        Self {
            uncertainty: self.uncertainty.hypot(more),
            ..self
        }
    }

    /// Its uncertainty in parts of it.
    pub(super) fn part(&self) -> f64 {
        self.uncertainty / self.value.abs()
    }
}

/// Which way the axis moves, where it has moved that way for so many seconds.
fn motion(samples: &[Sample], shaft: &Shaft, settling: f64) -> Vec<Sample> {
    let mut motion = samples.to_vec();
    let still = STILL * shaft.resolution * shaft.radians;
    let settling = (settling / shaft.cycle).ceil() as usize;
    let (mut direction, mut lasts) = (0.0, 0);
    for at in 1..motion.len().saturating_sub(1) {
        let moved = motion[at + 1].angle - motion[at - 1].angle;
        // NaN, of what is not known, is no motion.
        let goes = match moved.abs() > still {
            true => moved.signum(),
            false => 0.0,
        };
        lasts = if goes == direction { lasts + 1 } else { 0 };
        direction = goes;
        motion[at].direction = if lasts >= settling { direction } else { 0.0 };
    }
    motion
}

/// A log at the shaft, a sample every cycle, before it is known which way it goes. Of the cycles of a longer gap there is no
/// angle.
fn sampled(samples: &[AxisSample], shaft: &Shaft) -> Result<Vec<Sample>, NotEstimated> {
    let Shaft { cycle, radians, .. } = *shaft;
    let mut motion: Vec<Sample> = Vec::with_capacity(samples.len());
    let mut last: Option<f64> = None;
    let (mut gaps, mut first_gap) = (0, None);
    for sample in samples {
        let Some(torque) = sample.torque.mean else {
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
            set: sample.set * radians,
            torque: torque * 1e-3 * shaft.rated_torque,
            direction: 0.0,
        };
        let before = motion.last().copied().unwrap_or(next);
        let mut unknown = 0.0;
        if whole > BRIDGED {
            unknown = f64::NAN;
            gaps += 1;
            first_gap.get_or_insert(sample.time);
        }
        for step in 1..whole as usize {
            let part = step as f64 / whole;
            motion.push(Sample {
                angle: before.angle + part * (next.angle - before.angle) + unknown,
                set: before.set + part * (next.set - before.set),
                torque: before.torque + part * (next.torque - before.torque),
                direction: 0.0,
            });
        }
        motion.push(next);
    }
    // Times in another unit have a gap behind each sample.
    match first_gap {
        Some(time) if 2 * gaps > samples.len() => Err(NotEstimated::Times { time, cycle }),
        _ => Ok(motion),
    }
}
