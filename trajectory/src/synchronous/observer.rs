//! Where a turning shaft will be, from samples of where it was.
//!
//! A Kalman filter whose state is the shaft's mean motion (angle, speed and acceleration, the last of which wanders) and
//! three harmonics of the turn: what makes a spindle uneven comes from poles, belts and cutters and so is a function
//! of its angle. Harmonics that are estimated as such are told ahead without a lag, whatever the speed; a filter
//! of the mean motion alone would tell them late, by more than their size where they are fast.
//!
//! They are estimated while one turn is as fast as the one before. What else moves the shaft, as it comes to its speed,
//! would pass for them, and be told again and again; and a harmonic that is slow is followed as mean motion as well.
//!
//! Where the shaft is told to change its speed, the change is [expected](AngleObserver::expect): the filter then estimates
//! what the shaft does beside it, so that a change that comes as it was told is not late by what the filter takes to
//! see one.

use crate::profile::{Profile, State};
use core::f64::consts::TAU;

/// Harmonics of a turn that are estimated.
const HARMONICS: usize = 3;
/// Angle, speed, acceleration, and of each harmonic the amplitudes of cosine and sine, turns.
const STATES: usize = 3 + 2 * HARMONICS;

/// How fast the mean motion is followed, rad/s.
const BANDWIDTH: f64 = 120.0;
/// What a sample may be off by beside the resolution, turns: 1 µs at 1,200 1/min.
const JITTER: f64 = 2e-5;
/// Variance by which an amplitude changes in a turn, turns².
const WANDERING: f64 = 1e-9;
/// The same while the shaft changes its speed, with which its drive's loops follow what makes it uneven otherwise: so many
/// times the variance of a sample, as what is told more finely is also told apart sooner.
const WANDERING_MEANWHILE: f64 = 2.0;
/// A harmonic is estimated from this rate on, rad/s.
const FAST: f64 = 30.0;
/// Harmonics are estimated once the mean speeds of two turns differ by no more than this part, and until they differ by
/// more than that.
const EVEN: f64 = 0.005;
const UNEVEN: f64 = 0.02;
/// From the mean speed of a turn the speed differs by this part.
const RIPPLED: f64 = 0.02;
/// So many turns after the first even one the harmonics are known.
const KNOWN_AFTER: u32 = 2;
/// What is known of an amplitude at first, turns.
const AMPLITUDE: f64 = 3e-3;
/// What is known of speed and acceleration at first: they are less, turns/s and turns/s².
const AT_FIRST: [f64; 2] = [50.0, 500.0];

/// How a shaft turns at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Turning {
    /// Turns, whole ones too.
    pub turns: f64,
    /// Turns/s.
    pub speed: f64,
    /// Turns/s².
    pub acceleration: f64,
    /// Turns/s³.
    pub jerk: f64,
}

/// How much of a shaft's harmonics is told: what goes beyond is made smaller, the fastest first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RippleLimits {
    /// Turns/s².
    pub acceleration: f64,
    /// Turns/s³.
    pub jerk: f64,
}

impl RippleLimits {
    /// The mean motion alone.
    pub const NONE: Self = Self {
        acceleration: 0.0,
        jerk: 0.0,
    };
}

/// A change of the speed that a shaft is told to make.
#[derive(Clone, Copy, Debug)]
struct Change {
    /// From rest: turns, turns/s and turns/s² that come on top.
    profile: Profile,
    /// It began so long ago, s; below 0: it is yet to come.
    elapsed: f64,
}

impl Change {
    /// What it has come to so many seconds from now, and the jerk there, turns/s³.
    fn after(&self, time: f64) -> (State, f64) {
        let (at, duration) = (self.elapsed + time, self.profile.duration());
        match at {
            ..=0.0 => (State::default(), 0.0),
            _ if at < duration => (self.profile.at(at), self.profile.jerk_at(at)),
            _ => (self.profile.end().after(at - duration, 0.0), 0.0),
        }
    }

    fn is_over(&self) -> bool {
        self.elapsed >= self.profile.duration()
    }
}

/// Estimates how a shaft turns.
#[derive(Clone, Debug)]
pub struct AngleObserver {
    /// Without what is expected.
    state: [f64; STATES],
    covariance: [[f64; STATES]; STATES],
    /// Of a sample, turns².
    variance: f64,
    /// Of the jerk that the mean motion is taken to have, turns²/s⁵.
    noise: f64,
    is_known: bool,
    /// By harmonic: it is estimated.
    estimated: [bool; HARMONICS],
    /// So many turns have been as fast as the ones before.
    even_turns: u32,
    /// Where the present turn began, turns, how long ago, s, and the mean speed of the one before, turns/s, where that
    /// is known.
    mark: f64,
    since_mark: f64,
    last_turn: Option<f64>,
    expected: Option<Change>,
}

impl AngleObserver {
    /// Of a shaft that is sampled every `period` s with a resolution of so many turns.
    pub fn new(period: f64, resolution: f64) -> Self {
        let variance = resolution * resolution / 12.0 + JITTER * JITTER;
        Self {
            state: [0.0; STATES],
            covariance: [[0.0; STATES]; STATES],
            variance,
            noise: libm::pow(BANDWIDTH, 6.0) * variance * period,
            is_known: false,
            estimated: [false; HARMONICS],
            even_turns: 0,
            mark: 0.0,
            since_mark: 0.0,
            last_turn: None,
            expected: None,
        }
    }

    /// Forgets all that was sampled.
    pub fn reset(&mut self) {
        self.is_known = false;
        self.expected = None;
    }

    /// So many seconds after the last sample the shaft begins to change its speed as it is told: a profile from rest of
    /// turns that come on top. One that is under way is taken for done.
    pub fn expect(&mut self, profile: Profile, within: f64) {
        self.end_change();
        self.expected = Some(Change {
            profile,
            elapsed: -within,
        });
    }

    /// The change is over: it is part of the mean motion from now on.
    fn end_change(&mut self) {
        let Some((change, _)) = self.expected.take().map(|change| change.after(0.0)) else {
            return;
        };
        for (state, change) in self.state.iter_mut().zip([change.p, change.v, change.a]) {
            *state += change;
        }
        // Turns before that are no measure of those behind it.
        (self.mark, self.since_mark, self.last_turn) = (self.state[0], 0.0, None);
    }

    /// The mean motion so many seconds from now, and its jerk.
    fn mean(&self, time: f64) -> (State, f64) {
        let [p, v, a, ..] = self.state;
        let beside = State { p, v, a }.after(time, 0.0);
        let (change, jerk) = self
            .expected
            .map_or_else(Default::default, |it| it.after(time));
        let mean = State {
            p: beside.p + change.p,
            v: beside.v + change.v,
            a: beside.a + change.a,
        };
        (mean, jerk)
    }

    /// So many seconds pass.
    pub fn advance(&mut self, time: f64) {
        let [t, t2, t3] = [time, time * time, time * time * time];
        let x = &mut self.state;
        x[0] += t * x[1] + 0.5 * t2 * x[2];
        x[1] += t * x[2];
        let p = &mut self.covariance;
        // F P Fᵀ: rows, then columns.
        let [angles, speeds, accelerations, ..] = p;
        for ((angle, speed), acceleration) in angles.iter_mut().zip(speeds).zip(accelerations) {
            *angle += t * *speed + 0.5 * t2 * *acceleration;
            *speed += t * *acceleration;
        }
        for row in p.iter_mut() {
            row[0] += t * row[1] + 0.5 * t2 * row[2];
            row[1] += t * row[2];
        }
        let mean = [
            [t2 * t3 / 20.0, t2 * t2 / 8.0, t3 / 6.0],
            [t2 * t2 / 8.0, t3 / 3.0, t2 / 2.0],
            [t3 / 6.0, t2 / 2.0, t],
        ];
        for (row, noise) in p.iter_mut().zip(mean) {
            for (value, noise) in row.iter_mut().zip(noise) {
                *value += self.noise * noise;
            }
        }
        self.since_mark += time;
        if let Some(change) = &mut self.expected {
            change.elapsed += time;
            if change.is_over() {
                self.end_change();
            }
        }
        let (mean, _) = self.mean(0.0);
        let wandering = match self.expected {
            Some(_) => (WANDERING_MEANWHILE * self.variance).max(WANDERING),
            None => WANDERING,
        };
        let p = &mut self.covariance;
        for at in (3..STATES).filter(|at| self.estimated[(at - 3) / 2]) {
            p[at][at] += wandering * (mean.v * t).abs();
        }
    }

    /// Begins anew with an angle, a speed and an acceleration, the last two of which may be off by so much; no harmonics.
    fn begin(&mut self, turns: f64, [speed, acceleration]: [f64; 2], off: [f64; 2]) {
        self.state = [0.0; STATES];
        self.state[..3].copy_from_slice(&[turns, speed, acceleration]);
        self.covariance = [[0.0; STATES]; STATES];
        self.covariance[0][0] = self.variance;
        for (at, off) in (1..).zip(off) {
            self.covariance[at][at] = off * off;
        }
        self.estimated = [false; HARMONICS];
    }

    /// Estimates the harmonics that are fast at that speed.
    fn estimate_harmonics(&mut self, speed: f64) {
        for harmonic in 0..HARMONICS {
            if TAU * (harmonic + 1) as f64 * speed.abs() > FAST {
                self.estimated[harmonic] = true;
                for at in pair(harmonic) {
                    self.covariance[at][at] = AMPLITUDE * AMPLITUDE;
                }
            }
        }
    }

    /// Where another turn is over: begins or ceases to estimate harmonics.
    fn end_turn(&mut self, turns: f64) {
        if (turns - self.mark).abs() < 1.0 || self.expected.is_some() {
            return;
        }
        let speed = (turns - self.mark) / self.since_mark;
        (self.mark, self.since_mark) = (turns, 0.0);
        let Some(last_turn) = self.last_turn.replace(speed) else {
            return;
        };
        let change = (speed - last_turn).abs() / speed.abs();
        if self.even_turns > 0 && change > UNEVEN {
            self.even_turns = 0;
            (0..HARMONICS).for_each(|harmonic| self.drop_harmonic(harmonic));
        } else if self.even_turns > 0 {
            self.even_turns = self.even_turns.saturating_add(1);
        } else if change < EVEN {
            self.even_turns = 1;
            self.begin(turns, [speed, 0.0], [RIPPLED * speed, EVEN * speed * speed]);
            self.estimate_harmonics(speed);
        }
    }

    /// What a harmonic has is mean motion from now on.
    fn drop_harmonic(&mut self, harmonic: usize) {
        let [cos, sin] = phase(harmonic, self.state[0]);
        let [a, b] = pair(harmonic).map(|at| self.state[at]);
        let rate = TAU * (harmonic + 1) as f64 * self.state[1];
        self.state[0] += a * cos + b * sin;
        self.state[1] += rate * (b * cos - a * sin);
        for at in pair(harmonic) {
            self.state[at] = 0.0;
            self.covariance[at] = [0.0; STATES];
            self.covariance.iter_mut().for_each(|row| row[at] = 0.0);
        }
        self.estimated[harmonic] = false;
    }

    /// The shaft is there now.
    pub fn measure(&mut self, turns: f64) {
        if !self.is_known {
            self.is_known = true;
            self.even_turns = 0;
            (self.mark, self.since_mark, self.last_turn) = (turns, 0.0, None);
            return self.begin(turns, [0.0; 2], AT_FIRST);
        }
        self.end_turn(turns);
        let (mean, _) = self.mean(0.0);
        let expected = mean.p - self.state[0];
        let mut sees = [0.0; STATES];
        sees[0] = 1.0;
        for (harmonic, pair) in sees[3..].chunks_exact_mut(2).enumerate() {
            pair.copy_from_slice(&phase(harmonic, mean.p));
        }
        let p = &mut self.covariance;
        let spread: [f64; STATES] =
            core::array::from_fn(|row| p[row].iter().zip(sees).map(|(p, h)| p * h).sum());
        let dot = |of: &[f64; STATES]| of.iter().zip(sees).map(|(x, h)| x * h).sum::<f64>();
        let innovation = turns - expected - dot(&self.state);
        let variance = dot(&spread) + self.variance;
        for row in 0..STATES {
            self.state[row] += spread[row] / variance * innovation;
            for column in 0..=row {
                p[row][column] -= spread[row] * spread[column] / variance;
                p[column][row] = p[row][column];
            }
        }
    }

    /// How it will turn so many seconds from now, with its harmonics within limits.
    pub fn after(&self, time: f64, ripple: RippleLimits) -> Turning {
        let (mean, jerk) = self.mean(time);
        let mean = Turning {
            turns: mean.p,
            speed: mean.v,
            acceleration: mean.a,
            jerk,
        };
        let (mut told, mut left) = (mean, ripple);
        for (harmonic, pair) in self.state[3..].chunks_exact(2).enumerate() {
            let [cos, sin] = phase(harmonic, mean.turns);
            let (value, turned) = (pair[0] * cos + pair[1] * sin, pair[1] * cos - pair[0] * sin);
            let [rate, change] =
                [mean.speed, mean.acceleration].map(|by| TAU * (harmonic + 1) as f64 * by);
            let amplitude = libm::hypot(pair[0], pair[1]);
            let most = [
                amplitude * rate * rate,
                amplitude * (rate * rate * rate).abs(),
            ];
            let part = |left: f64, most: f64| if most > left { left / most } else { 1.0 };
            let part = part(left.acceleration, most[0]).min(part(left.jerk, most[1]));
            left.acceleration -= part * most[0];
            left.jerk -= part * most[1];
            told.turns += part * value;
            told.speed += part * rate * turned;
            told.acceleration += part * (change * turned - rate * rate * value);
            told.jerk -= part * (3.0 * rate * change * value + rate * rate * rate * turned);
        }
        told
    }

    /// Whether it turns evenly from turn to turn, and has done so for long enough for its harmonics to be known.
    pub fn is_settled(&self) -> bool {
        self.is_known && self.even_turns >= KNOWN_AFTER
    }
}

/// The places of a harmonic's amplitudes among the states.
const fn pair(harmonic: usize) -> [usize; 2] {
    [3 + 2 * harmonic, 4 + 2 * harmonic]
}

/// Cosine and sine of a harmonic where the shaft has turned so far.
fn phase(harmonic: usize, turns: f64) -> [f64; 2] {
    let angle = TAU * (harmonic + 1) as f64 * (turns - turns.floor());
    [libm::cos(angle), libm::sin(angle)]
}
