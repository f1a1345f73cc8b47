//! A motion seen through windows, so that nothing has to be differentiated.
//!
//! A window is a function of time that is zero, with its first derivatives, at both of its ends. Whatever is multiplied by
//! it and integrated, a derivative can be moved over to it by parts:
//!
//! ```text
//! ∫ φ̈ w dt = ∫ φ ẅ dt
//! ```
//!
//! so that an equation of the motion becomes one of sums of samples for each window, in which noise of an angle counts as
//! little as the window is smooth (Shinbrot, 1957: modulating functions).
//!
//! Multiplied by `e^{−jωt}` a window sees what happens about one frequency, its real part and its imaginary one; with
//! several frequencies, bands, all that the motion has is seen, and noise is told from it band by band.
//!
//! The torque is the mean over a cycle, which is less than its value by `(ωT)²/24` at a frequency; the second derivative of
//! the window makes up for that.

use nalgebra::{SMatrix, SVector};
use std::f64::consts::TAU;

/// Columns of the equation of an axis behind a transmission that is stiff within what windows see.
pub(super) const STIFF: usize = 6;
/// Those of an axis whose transmission swings: two more.
pub(super) const ELASTIC: usize = 8;
/// Where the torque stands, behind the columns.
pub(super) const TORQUE: usize = ELASTIC;
/// Columns and torque.
pub(super) const SEEN: usize = ELASTIC + 1;
/// Windows of the setpoint: one with that of the axis, the others earlier.
const SETPOINTS: usize = 3;
/// What is known without noise: direction and constant, and real and imaginary part of each window of the setpoint.
pub(super) const INSTRUMENTS: usize = 2 + 2 * SETPOINTS;
/// From one window of the setpoint to the next, s.
const EARLIER: f64 = 0.06;
/// A window is (1 − x²) to this power, from −1 to 1.
const POWER: usize = 6;
/// Derivatives of it that are needed, with itself.
const DERIVATIVES: usize = 5;
/// From one window to the next, of its length.
const HOP: usize = 4;
/// Samples in a window at least.
const SHORTEST: usize = 24;
/// From one band to the next, Hz.
const STEP: f64 = 6.0;
/// Parts into which a motion is divided.
const PARTS: usize = 20;

/// A sample at the motor's shaft.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    /// rad.
    pub(super) angle: f64,
    /// Its setpoint, rad.
    pub(super) set: f64,
    /// N·m.
    pub(super) torque: f64,
    /// Which way the axis has been moving for a while, 1 or −1; 0 if it has not.
    pub(super) direction: f64,
}

/// What is looked at.
#[derive(Clone, Copy, Debug)]
pub(super) struct Look {
    /// How long a window is, s.
    pub(super) window: f64,
    /// The highest frequency that a window may be at, Hz; the lowest is 0.
    pub(super) highest: f64,
    /// By how much the torque is told late, s.
    pub(super) delay: f64,
}

/// What a window sees: columns and torque, then instruments.
type Row = SVector<f64, { SEEN + INSTRUMENTS }>;

/// Sums of products of what windows see of one part of a motion in one band.
#[derive(Clone, Copy, Debug)]
pub(super) struct Products {
    /// Of each with each.
    pub(super) sums: SMatrix<f64, { SEEN + INSTRUMENTS }, { SEEN + INSTRUMENTS }>,
    /// Rows that they are of.
    pub(super) rows: f64,
}

/// A motion as its windows see it.
#[derive(Debug)]
pub(super) struct View {
    /// In the middle of its bands, Hz.
    pub(super) bands: Vec<f64>,
    /// By band, of each part of the motion.
    pub(super) parts: Vec<Vec<Products>>,
}

impl Products {
    pub(super) const ZERO: Self = Self {
        sums: SMatrix::from_array_storage(nalgebra::ArrayStorage(
            [[0.0; SEEN + INSTRUMENTS]; SEEN + INSTRUMENTS],
        )),
        rows: 0.0,
    };

    pub(super) fn with(&self, other: &Self, times: f64) -> Self {
        Self {
            sums: self.sums + other.sums * times,
            rows: self.rows + other.rows * times,
        }
    }

    fn add(&mut self, row: &Row) {
        self.sums += row * row.transpose();
        self.rows += 1.0;
    }
}

impl View {
    /// Of samples that are `cycle` seconds apart; `None` where the axis does not move one way for long enough.
    pub(super) fn new(samples: &[Sample], cycle: f64, look: &Look) -> Option<Self> {
        let length = ((look.window / cycle).round() as usize).max(SHORTEST);
        let earlier = (EARLIER / cycle).round() as usize;
        let hop = (length / HOP).max(1);
        let last = samples.len().checked_sub(length)?;
        let starts = (earlier * (SETPOINTS - 1)..=last).step_by(hop);
        let starts: Vec<usize> = starts
            .filter(|&start| goes_one_way(&samples[start..start + length]))
            .collect();
        let size = starts.len().div_ceil(PARTS);
        if size < 2 {
            return None;
        }
        let count = (look.highest / STEP).floor() as usize + 1;
        let bands: Vec<f64> = (0..count).map(|band| STEP * band as f64).collect();
        let windows = bands.iter().map(|hertz| {
            let window = Window::new(length, cycle, look.delay, *hertz);
            let parts = starts.chunks(size);
            let products = parts.map(|starts| window.products(samples, starts, earlier));
            products.collect()
        });
        let parts = windows.collect();
        Some(Self { bands, parts })
    }
}

fn goes_one_way(samples: &[Sample]) -> bool {
    let direction = samples[0].direction;
    direction != 0.0 && samples.iter().all(|sample| sample.direction == direction)
}

/// Real and imaginary part.
type Complex = [f64; 2];

/// A window at a frequency.
struct Window {
    /// Of each sample, the window and its derivatives.
    at: Vec<[Complex; DERIVATIVES]>,
    /// The same for the torque: later by the delay, and for a mean over a cycle.
    late: Vec<[Complex; 3]>,
    /// The whole of it.
    area: Complex,
    /// Whether it has an imaginary part.
    is_complex: bool,
}

impl Window {
    fn new(length: usize, cycle: f64, delay: f64, hertz: f64) -> Self {
        let half = 0.5 * (length - 1) as f64 * cycle;
        let shape = Shape::new(half - delay.abs());
        let omega = TAU * hertz;
        let mean = cycle * cycle / 24.0;
        let times = (0..length).map(|at| at as f64 * cycle - half);
        let at: Vec<[Complex; DERIVATIVES]> = times
            .clone()
            .map(|time| std::array::from_fn(|of| shape.derivative(of, omega, time)))
            .collect();
        let late = times.map(|time| {
            std::array::from_fn(|of| {
                let told = shape.derivative(of, omega, time - delay);
                let bent = shape.derivative(of + 2, omega, time - delay);
                [0, 1].map(|part| told[part] - mean * bent[part])
            })
        });
        let area = [0, 1].map(|part| at.iter().map(|it| it[0][part]).sum());
        Self {
            late: late.collect(),
            at,
            area,
            is_complex: hertz > 0.0,
        }
    }

    /// What it sees from these samples on.
    fn products(&self, samples: &[Sample], starts: &[usize], earlier: usize) -> Products {
        let mut products = Products::ZERO;
        for &start in starts {
            let [real, imaginary] = self.rows(samples, start, earlier);
            products.add(&real);
            if self.is_complex {
                products.add(&imaginary);
            }
        }
        products
    }

    /// Columns, torque and instruments: acceleration, direction, speed, a constant, the first and second derivative of the
    /// acceleration, and minus the first and the second of the torque; then the torque, direction and constant once more, and
    /// accelerations of the setpoint, each with what it is a quarter of a swing later.
    fn rows(&self, samples: &[Sample], start: usize, earlier: usize) -> [Row; 2] {
        let from = |start: usize| &samples[start..start + self.at.len()];
        let seen = from(start);
        let angle = |of: usize| {
            let window = self.at.iter().map(|it| it[of]);
            integral(seen.iter().map(|it| it.angle - seen[0].angle), window)
        };
        let torque = |of: usize| {
            let window = self.late.iter().map(|it| it[of]);
            integral(seen.iter().map(|it| it.torque), window)
        };
        let sets: [Complex; SETPOINTS] = std::array::from_fn(|at| {
            let sets = from(start - at * earlier);
            let window = self.at.iter().map(|it| it[2]);
            integral(sets.iter().map(|it| it.set - sets[0].set), window)
        });
        let minus = |[real, imaginary]: Complex| [-real, -imaginary];
        let directed = self.area.map(|area| seen[0].direction * area);
        let equation: [Complex; SEEN + 2] = [
            angle(2),
            directed,
            minus(angle(1)),
            self.area,
            minus(angle(3)),
            angle(4),
            torque(1),
            minus(torque(2)),
            torque(0),
            directed,
            self.area,
        ];
        let [real, imaginary] = [0, 1].map(|part| equation.iter().map(move |it| it[part]));
        let real = real.chain(sets.iter().flat_map(|&[re, im]| [re, -im]));
        let imaginary = imaginary.chain(sets.iter().flat_map(|&[re, im]| [im, re]));
        [Row::from_iterator(real), Row::from_iterator(imaginary)]
    }
}

fn integral(values: impl Iterator<Item = f64>, window: impl Iterator<Item = Complex>) -> Complex {
    let terms = values.zip(window);
    terms.fold([0.0; 2], |[real, imaginary], (value, window)| {
        [real + value * window[0], imaginary + value * window[1]]
    })
}

/// A window as a function of time, and its derivatives.
struct Shape {
    /// Factors by power, of each derivative.
    derivatives: [Vec<f64>; DERIVATIVES],
    /// Half of its length, s.
    half: f64,
}

impl Shape {
    fn new(half: f64) -> Self {
        let mut polynomial = vec![1.0];
        for _ in 0..POWER {
            polynomial = times_one_less_square(&polynomial);
        }
        let derivatives = std::array::from_fn(|_| {
            let powers = polynomial.iter().enumerate().skip(1);
            let next = powers
                .map(|(power, factor)| power as f64 * factor)
                .collect();
            std::mem::replace(&mut polynomial, next)
        });
        Self { derivatives, half }
    }

    /// A derivative of the window alone, so many seconds from its middle.
    fn value(&self, of: usize, time: f64) -> f64 {
        let x = time / self.half;
        if x.abs() >= 1.0 {
            return 0.0;
        }
        let powers = self.derivatives[of].iter().rev();
        powers.fold(0.0, |value, factor| value * x + factor) / self.half.powi(of as i32)
    }

    /// A derivative of the window times `e^{−jωt}`, by Leibniz' rule.
    fn derivative(&self, of: usize, omega: f64, time: f64) -> Complex {
        let (mut real, mut imaginary, mut binomial) = (0.0, 0.0, 1.0);
        for by in 0..=of {
            let turns = of - by;
            let term = binomial * self.value(by, time) * omega.powi(turns as i32);
            // (−j)ⁿ goes round.
            match turns % 4 {
                0 => real += term,
                1 => imaginary -= term,
                2 => real -= term,
                _ => imaginary += term,
            }
            binomial *= turns as f64 / (by + 1) as f64;
        }
        let (sine, cosine) = (-omega * time).sin_cos();
        [
            real * cosine - imaginary * sine,
            real * sine + imaginary * cosine,
        ]
    }
}

/// The factors of a polynomial by power, multiplied by 1 − x².
fn times_one_less_square(polynomial: &[f64]) -> Vec<f64> {
    let mut product = polynomial.to_vec();
    product.extend([0.0; 2]);
    for (power, factor) in polynomial.iter().enumerate() {
        product[power + 2] -= factor;
    }
    product
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sines have derivatives that everybody knows.
    #[test]
    fn derivatives_go_over_to_the_window() {
        let (length, cycle, omega) = (240, 1e-3, 40.0);
        let sample = |at: usize| {
            let sine = (omega * cycle * at as f64).sin();
            Sample {
                angle: sine,
                set: sine,
                torque: -omega * omega * sine,
                direction: 1.0,
            }
        };
        let samples: Vec<_> = (0..length).map(sample).collect();
        for hertz in [0.0, 6.0, 12.0] {
            let window = Window::new(length, cycle, 0.0, hertz);
            for row in window.rows(&samples, 0, 0) {
                if row[0] == 0.0 {
                    continue;
                }
                let told = [row[0] / row[TORQUE], row[5] / row[0] / -omega.powi(2)];
                // The torque is taken for a mean, which it is not: (ωT)²/24.
                assert!(told.iter().all(|it| (it - 1.0).abs() < 2e-4), "{told:?}");
                let instrument = row[SEEN + 2] / row[0] - 1.0;
                assert!(instrument.abs() < 1e-9, "{instrument}");
            }
        }
    }

    /// What is told late counts where it belongs.
    #[test]
    fn a_delay_is_made_up_for() {
        let (length, cycle, omega, delay) = (240, 1e-3, 60.0, 2e-3);
        let sample = |at: usize| {
            let time = cycle * at as f64;
            Sample {
                angle: (omega * time).sin(),
                set: 0.0,
                torque: -omega * omega * (omega * (time - delay)).sin(),
                direction: 1.0,
            }
        };
        let samples: Vec<_> = (0..length).map(sample).collect();
        let window = Window::new(length, cycle, delay, 9.0);
        for row in window.rows(&samples, 0, 0) {
            assert!((row[0] / row[TORQUE] - 1.0).abs() < 3e-4, "{row}");
        }
    }
}
