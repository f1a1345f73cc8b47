//! Where a turning shaft will be, from samples of where it was.
//!
//! A Kalman filter whose state is the shaft's mean motion (angle, speed and acceleration, the last of which wanders) and
//! three harmonics of the turn: what makes a spindle uneven comes from poles, belts and cutters and so is a function
//! of its angle. Harmonics that are estimated as such are told ahead without a lag, whatever the speed; a filter
//! of the mean motion alone would tell them late, by more than their size where they are fast.
//!
//! They are estimated while one turn is as fast as the one before. What else moves the shaft, as it comes to its speed,
//! would pass for them, and be told again and again; and a harmonic that is slow is followed as mean motion as well.

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

/// Estimates how a shaft turns.
#[derive(Clone, Debug)]
pub struct AngleObserver {
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
    /// Where the present turn began, turns, how long ago, s, and the mean speed of the one before, turns/s.
    mark: f64,
    since_mark: f64,
    last_turn: f64,
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
            last_turn: 0.0,
        }
    }

    /// Forgets all that was sampled.
    pub fn reset(&mut self) {
        self.is_known = false;
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
        for at in (3..STATES).filter(|at| self.estimated[(at - 3) / 2]) {
            p[at][at] += WANDERING * (x[1] * t).abs();
        }
        self.since_mark += time;
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
        if (turns - self.mark).abs() < 1.0 {
            return;
        }
        let speed = (turns - self.mark) / self.since_mark;
        let change = (speed - self.last_turn).abs() / speed.abs();
        (self.mark, self.since_mark, self.last_turn) = (turns, 0.0, speed);
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
            (self.mark, self.since_mark, self.last_turn) = (turns, 0.0, 0.0);
            return self.begin(turns, [0.0; 2], AT_FIRST);
        }
        self.end_turn(turns);
        let mut sees = [0.0; STATES];
        sees[0] = 1.0;
        for (harmonic, pair) in sees[3..].chunks_exact_mut(2).enumerate() {
            pair.copy_from_slice(&phase(harmonic, self.state[0]));
        }
        let p = &mut self.covariance;
        let spread: [f64; STATES] =
            core::array::from_fn(|row| p[row].iter().zip(sees).map(|(p, h)| p * h).sum());
        let dot = |of: &[f64; STATES]| of.iter().zip(sees).map(|(x, h)| x * h).sum::<f64>();
        let innovation = turns - dot(&self.state);
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
        let [turns, speed, acceleration, ..] = self.state;
        let mean = Turning {
            turns: turns + time * (speed + 0.5 * time * acceleration),
            speed: speed + time * acceleration,
            acceleration,
            jerk: 0.0,
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
