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

use nalgebra::{SMatrix, SVector};

/// Columns of the equation.
pub(super) const COLUMNS: usize = 6;
/// A window is (1 − x²) to this power, from −1 to 1.
const POWER: usize = 6;
/// Derivatives of it that are needed.
const DERIVATIVES: usize = 5;
/// From one window to the next, of its length.
const HOP: usize = 4;
/// Parts of the whole that are left out in turn.
const PARTS: usize = 20;
/// How much of a column the others have to leave, to be told apart from them.
const SEPARATE: f64 = 1e-6;
/// Of Student's distribution with one degree of freedom less than there are parts, half of the interval that holds 95 %.
const STUDENT_95: f64 = 2.093;

/// A sample at the motor's shaft.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    /// rad.
    pub(super) angle: f64,
    /// N·m.
    pub(super) torque: f64,
    /// Which way the axis has been moving for a while, 1 or −1; 0 if it has not.
    pub(super) way: f64,
}

/// The factor of each column, and half of the interval about it that holds the truth with 95 % as far as that is a matter of
/// noise.
pub(super) type Factors = [(f64, f64); COLUMNS];

/// Sums of products, of one part of the motion.
#[derive(Clone, Copy, Debug)]
struct Normal {
    matrix: SMatrix<f64, COLUMNS, COLUMNS>,
    right: SVector<f64, COLUMNS>,
}

/// What torque is made of, by windows of `length` samples that are `cycle` seconds apart: acceleration, direction, speed, a
/// constant, and the first and second derivative of the acceleration. `None` where these cannot be told apart.
///
/// What the factors are uncertain by is what they change by as parts of the motion are left out (the jackknife of Quenouille
/// and Tukey), so that it is right also where noise is neither white nor the same everywhere.
pub(super) fn factors(samples: &[Sample], cycle: f64, length: usize) -> Option<Factors> {
    let window = Window::new(length, cycle);
    let seen = samples.windows(length).step_by((length / HOP).max(1));
    let rows: Vec<_> = seen.filter_map(|samples| window.row(samples)).collect();
    let size = rows.len().div_ceil(PARTS);
    if size < 2 {
        return None;
    }
    let parts: Vec<Normal> = rows.chunks(size).map(Normal::of).collect();
    let whole = parts
        .iter()
        .fold(Normal::ZERO, |sum, part| sum.with(part, 1.0));
    let found = whole.solve()?;
    let left_out = parts.iter().map(|part| whole.with(part, -1.0).solve());
    let left_out: Vec<_> = left_out.collect::<Option<_>>()?;
    let count = left_out.len() as f64;
    Some(std::array::from_fn(|at| {
        let mean = left_out.iter().map(|it| it[at]).sum::<f64>() / count;
        let squares: f64 = left_out.iter().map(|it| (it[at] - mean).powi(2)).sum();
        let deviation = (squares * (count - 1.0) / count).sqrt();
        (found[at], STUDENT_95 * deviation)
    }))
}

/// A window and its derivatives at its samples.
struct Window([Vec<f64>; DERIVATIVES]);

impl Window {
    fn new(length: usize, cycle: f64) -> Self {
        // Between two samples of the window's own x.
        let step = 2.0 / (length - 1) as f64;
        let mut polynomial = vec![1.0];
        for _ in 0..POWER {
            polynomial = times_one_less_square(&polynomial);
        }
        Self(std::array::from_fn(|derivative| {
            let values = (0..length).map(|at| value(&polynomial, step * at as f64 - 1.0));
            let scale = (step / cycle).powi(derivative as i32);
            let values = values.map(|value| value * scale).collect();
            let powers = polynomial.iter().enumerate().skip(1);
            polynomial = powers
                .map(|(power, factor)| power as f64 * factor)
                .collect();
            values
        }))
    }

    /// Columns and torque, seen through the window; `None` where the axis does not move one way all the time.
    fn row(&self, samples: &[Sample]) -> Option<(SVector<f64, COLUMNS>, f64)> {
        let way = samples[0].way;
        if way == 0.0 || samples.iter().any(|sample| sample.way != way) {
            return None;
        }
        let [window, first, second, third, fourth] = &self.0;
        let start = samples[0].angle;
        let angle = |by: &[f64]| -> f64 {
            let terms = samples.iter().zip(by);
            terms.map(|(sample, by)| (sample.angle - start) * by).sum()
        };
        let area: f64 = window.iter().sum();
        let torques = samples.iter().zip(window);
        let torque: f64 = torques.map(|(sample, by)| sample.torque * by).sum();
        let columns = [
            angle(second),
            way * area,
            -angle(first),
            area,
            -angle(third),
            angle(fourth),
        ];
        Some((SVector::from(columns), torque))
    }
}

impl Normal {
    const ZERO: Self = Self {
        matrix: SMatrix::from_array_storage(nalgebra::ArrayStorage([[0.0; COLUMNS]; COLUMNS])),
        right: SVector::from_array_storage(nalgebra::ArrayStorage([[0.0; COLUMNS]])),
    };

    fn of(rows: &[(SVector<f64, COLUMNS>, f64)]) -> Self {
        rows.iter().fold(Self::ZERO, |sum, (columns, torque)| Self {
            matrix: sum.matrix + columns * columns.transpose(),
            right: sum.right + columns * *torque,
        })
    }

    fn with(self, other: &Self, times: f64) -> Self {
        Self {
            matrix: self.matrix + other.matrix * times,
            right: self.right + other.right * times,
        }
    }

    /// The factors with which the columns come nearest to the torque.
    fn solve(&self) -> Option<SVector<f64, COLUMNS>> {
        let scales = SVector::<f64, COLUMNS>::from_fn(|at, _| self.matrix[(at, at)].sqrt());
        if !scales.iter().all(|scale| *scale > 0.0 && scale.is_finite()) {
            return None;
        }
        let scaled = SMatrix::<f64, COLUMNS, COLUMNS>::from_fn(|row, column| {
            self.matrix[(row, column)] / (scales[row] * scales[column])
        });
        let lower = scaled.cholesky()?;
        if lower.l_dirty().diagonal().min() < SEPARATE {
            return None;
        }
        let found = lower.solve(&self.right.component_div(&scales));
        Some(found.component_div(&scales))
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

fn value(polynomial: &[f64], x: f64) -> f64 {
    let powers = polynomial.iter().rev();
    powers.fold(0.0, |value, factor| value * x + factor)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sines have derivatives that everybody knows.
    #[test]
    fn derivatives_go_over_to_the_window() {
        let (length, cycle) = (80, 1e-3);
        let window = Window::new(length, cycle);
        let omega = 40.0;
        let sample = |at: usize| Sample {
            angle: (omega * cycle * at as f64).sin(),
            torque: -omega * omega * (omega * cycle * at as f64).sin(),
            way: 1.0,
        };
        let samples: Vec<_> = (0..length).map(sample).collect();
        let (columns, torque) = window.row(&samples).unwrap();
        // The sine starts at zero, so that nothing is taken off.
        assert!(
            (columns[0] / torque - 1.0).abs() < 1e-6,
            "{columns} {torque}"
        );
        assert!(
            (columns[5] / (-omega * omega * torque) - 1.0).abs() < 1e-3,
            "{columns}"
        );
    }

    /// What goes in comes out.
    #[test]
    fn factors_are_those_that_made_the_torque() {
        let cycle = 1e-3;
        let mut samples = Vec::new();
        for stroke in 0..8 {
            let way = if stroke % 2 == 0 { 1.0 } else { -1.0 };
            let swing = 10.0 + 2.0 * f64::from(stroke);
            for at in 0..1500 {
                let t = cycle * f64::from(at);
                let speed = way * (40.0 + 5.0 * f64::from(stroke) + 20.0 * (swing * t).sin());
                let turned = (1.0 - (swing * t).cos()) / swing;
                let angle = way * ((40.0 + 5.0 * f64::from(stroke)) * t + 20.0 * turned);
                let acceleration = way * 20.0 * swing * (swing * t).cos();
                samples.push(Sample {
                    angle,
                    torque: 3e-4 * acceleration + 0.2 * way + 1e-3 * speed - 0.05,
                    way: if at == 0 { 0.0 } else { way },
                });
            }
        }
        let found = factors(&samples, cycle, 120).unwrap();
        for ((value, _), expected) in found.into_iter().zip([3e-4, 0.2, 1e-3, -0.05]) {
            assert!((value / expected - 1.0).abs() < 1e-4, "{value} {expected}");
        }
    }

    #[test]
    fn motion_of_one_kind_tells_nothing() {
        let steady = |at: i32| Sample {
            angle: 0.05 * f64::from(at),
            torque: 0.2,
            way: 1.0,
        };
        let samples: Vec<_> = (0..5000).map(steady).collect();
        assert!(factors(&samples, 1e-3, 120).is_none());
        assert!(factors(&samples[..100], 1e-3, 120).is_none());
    }
}
