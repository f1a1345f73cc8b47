//! The factors of an equation of the motion, from what windows see of it.
//!
//! Least squares is wrong where noise is in the columns themselves and goes round the loop: the drive answers to the noise of
//! its encoder with torque, so that at frequencies at which nothing was asked for the log shows the drive's gains, not
//! the axis. The setpoint knows nothing of noise. So each band's columns are first replaced by what the setpoint, with
//! windows of a while before, explains of them (instrumental variables, in two stages of least squares: Theil 1953), and
//! a band of which it explains less than half is not used. At 0 Hz, where the motion is by far greater than any noise, the
//! columns are used as they are.
//!
//! A band counts by what its equation leaves over. That depends on the factors, so that both are found in turn. Where
//! that ends depends on where it begins, though: the noise of high frequencies, which is the drive's law, can be fitted so
//! well that the motion at low ones counts for nothing. So it begins with the lowest band alone, the lowest two and so on, and
//! that end is taken which leaves the least of what the setpoint explains, measured by what it does not (limited information
//! maximum likelihood: Anderson and Rubin 1949).
//!
//! How certain a factor is shows in what it is when a part of the motion is left out, each in turn (jackknife). Parts are
//! seconds long, so that it does not matter whether what is left over is white. They do not all tell as much of a factor,
//! and Student's distribution takes as many as there are in effect, `(Σ s²)²/Σ s⁴` of their deviations s.

use super::estimate::Figure;
use super::windows::{ELASTIC, INSTRUMENTS, Products, SEEN, TORQUE, View};
use nalgebra::{SMatrix, SVector};

/// How much of a column the others have to leave, to be told apart from them.
const SEPARATE: f64 = 1e-7;
/// Of a column's and a torque's squares, what the setpoint has to explain in a band.
const EXPLAINED: f64 = 0.5;
/// How often bands are weighed anew; with the first bands alone, and with all.
const WEIGHED: [usize; 2] = [6, 14];
/// Factors of the columns, and −1 of the torque.
pub(super) type Factors = SVector<f64, SEEN>;
/// Sums of products of columns and torque.
type Normal = SMatrix<f64, SEEN, SEEN>;

/// Factors with which the columns come nearest to the torque.
#[derive(Debug)]
pub(super) struct Fit {
    factors: Factors,
    /// The same without one part of the motion, each in turn.
    left_out: Vec<Factors>,
    /// The highest frequency that was used, Hz.
    pub(super) highest: f64,
}

/// One band of the whole motion.
struct Band {
    /// As it was seen.
    whole: Normal,
    /// As the setpoint explains it.
    explained: Normal,
    rows: f64,
    /// Whether it is of any use.
    is_used: bool,
    is_lowest: bool,
}

impl Fit {
    /// With the first so many columns; `None` if they cannot be told apart.
    pub(super) fn new(view: &View, columns: usize) -> Option<Self> {
        let whole: Vec<Products> = view.parts.iter().map(|parts| sum(parts)).collect();
        let bands: Vec<Band> = whole.iter().enumerate().map(Band::new).collect();
        let weights = weighed(&bands, columns)?;
        let factors = solved(bands.iter().map(|band| &band.explained), &weights, columns)?;
        let count = view.parts.first()?.len();
        let left_out = (0..count).map(|part| {
            let rest = view.parts.iter().zip(&whole).enumerate();
            let rest =
                rest.map(|(at, (parts, whole))| explained(&whole.with(&parts[part], -1.0), at));
            let rest: Vec<Normal> = rest.collect();
            solved(rest.iter(), &weights, columns)
        });
        let used = view
            .bands
            .iter()
            .zip(&bands)
            .filter(|(_, band)| band.is_used);
        Some(Self {
            factors,
            left_out: left_out.collect::<Option<_>>()?,
            highest: used.map(|(hertz, _)| *hertz).fold(0.0, f64::max),
        })
    }

    /// A number that follows from the factors, with half of the interval about it that holds the truth with 95 % as far as
    /// that is a matter of noise.
    pub(super) fn figure(&self, read: impl Fn(&Factors) -> f64) -> Figure {
        let left_out: Vec<f64> = self.left_out.iter().map(&read).collect();
        jackknife(read(&self.factors), &left_out)
    }
}

/// A number with half of the interval about it that holds the truth with 95 %, from what it is without one part of the data,
/// each in turn (the jackknife).
pub(super) fn jackknife(value: f64, left_out: &[f64]) -> Figure {
    let count = left_out.len() as f64;
    let mean = left_out.iter().sum::<f64>() / count;
    let squares: Vec<f64> = left_out.iter().map(|it| (it - mean).powi(2)).collect();
    let sum: f64 = squares.iter().sum();
    let fourth: f64 = squares.iter().map(|it| it * it).sum();
    let uncertainty = student_95(sum * sum / fourth) * (sum * (count - 1.0) / count).sqrt();
    Figure { value, uncertainty }
}

/// Of Student's distribution with so many degrees of freedom, half of the interval that holds 95 %: the first terms of its
/// expansion about the normal distribution's (Cornish and Fisher 1938).
fn student_95(freedom: f64) -> f64 {
    1.96 + 2.37 / freedom + 2.82 / (freedom * freedom)
}

fn sum(parts: &[Products]) -> Products {
    let all = parts.iter();
    all.fold(Products::ZERO, |sum, part| sum.with(part, 1.0))
}

/// What the setpoint explains of a band; all of the lowest.
fn explained(products: &Products, band: usize) -> Normal {
    let sums = &products.sums;
    let whole: Normal = sums.fixed_view::<SEEN, SEEN>(0, 0).into_owned();
    if band == 0 {
        return whole;
    }
    let scale = |at: usize| match sums[(SEEN + at, SEEN + at)].sqrt() {
        0.0 => 0.0,
        root => root.recip(),
    };
    // Windows of the setpoint that hardly differ are no obstacle.
    let among = SMatrix::<f64, INSTRUMENTS, INSTRUMENTS>::from_fn(|row, column| {
        let ridge = if row == column { 1e-9 } else { 0.0 };
        sums[(SEEN + row, SEEN + column)] * scale(row) * scale(column) + ridge
    });
    let with = SMatrix::<f64, INSTRUMENTS, SEEN>::from_fn(|row, column| {
        sums[(SEEN + row, column)] * scale(row)
    });
    match among.cholesky() {
        Some(lower) => with.transpose() * lower.solve(&with),
        None => Normal::zeros(),
    }
}

impl Band {
    fn new((at, products): (usize, &Products)) -> Self {
        let whole: Normal = products.sums.fixed_view::<SEEN, SEEN>(0, 0).into_owned();
        let explained = explained(products, at);
        let is_explained = |of: usize| explained[(of, of)] >= EXPLAINED * whole[(of, of)];
        Self {
            whole,
            explained,
            rows: products.rows,
            is_used: is_explained(0) && is_explained(TORQUE),
            is_lowest: at == 0,
        }
    }

    /// What it counts with these factors, and how unlikely it makes them.
    fn weighed(&self, factors: &Factors) -> (f64, f64) {
        if !self.is_used {
            return (0.0, 0.0);
        }
        let over = |of: &Normal| (factors.transpose() * of * factors)[0].max(f64::MIN_POSITIVE);
        let whole = over(&self.whole);
        let unexplained = if self.is_lowest {
            self.rows
        } else {
            (whole - over(&self.explained)).max(1e-9 * whole)
        };
        (self.rows / whole, self.rows * (whole / unexplained).ln())
    }
}

/// What each band counts.
fn weighed(bands: &[Band], columns: usize) -> Option<Vec<f64>> {
    let normals = || bands.iter().map(|band| &band.explained);
    let mut best: Option<(f64, Vec<f64>)> = None;
    for first in 1..=bands.len() {
        let mut weights: Vec<f64> = bands
            .iter()
            .map(|band| f64::from(u8::from(band.is_used)) / band.whole[(TORQUE, TORQUE)])
            .collect();
        let mut unlikely = None;
        for time in 0..WEIGHED[0] + WEIGHED[1] {
            if time < WEIGHED[0] {
                weights[first..].fill(0.0);
            }
            unlikely = solved(normals(), &weights, columns).map(|factors| {
                let found = bands.iter().map(|band| band.weighed(&factors));
                let (counts, logarithms): (Vec<f64>, Vec<f64>) = found.unzip();
                weights = counts;
                logarithms.iter().sum::<f64>()
            });
            if unlikely.is_none() {
                break;
            }
        }
        let Some(unlikely) = unlikely else { continue };
        if best.as_ref().is_none_or(|(least, _)| unlikely < *least) {
            best = Some((unlikely, weights));
        }
    }
    best.map(|(_, weights)| weights)
}

/// The factors of the first so many columns with which these come nearest to the torque.
fn solved<'a>(
    normals: impl Iterator<Item = &'a Normal>,
    weights: &[f64],
    columns: usize,
) -> Option<Factors> {
    let all = normals.zip(weights);
    let sum = all.fold(Normal::zeros(), |sum, (normal, weight)| {
        sum + normal * *weight
    });
    let scale = |at: usize| sum[(at, at)].sqrt();
    if !(0..columns).all(|at| scale(at) > 0.0 && scale(at).is_finite()) {
        return None;
    }
    // Columns that are left out have no part in it.
    let scaled = SMatrix::<f64, ELASTIC, ELASTIC>::from_fn(|row, column| {
        if row < columns && column < columns {
            sum[(row, column)] / (scale(row) * scale(column))
        } else {
            f64::from(u8::from(row == column))
        }
    });
    let right = SVector::<f64, ELASTIC>::from_fn(|at, _| match at < columns {
        true => sum[(at, TORQUE)] / scale(at),
        false => 0.0,
    });
    let lower = scaled.cholesky()?;
    if lower.l_dirty().diagonal().min() < SEPARATE {
        return None;
    }
    let found = lower.solve(&right);
    let mut factors = Factors::zeros();
    for at in 0..columns {
        factors[at] = found[at] / scale(at);
    }
    factors[TORQUE] = -1.0;
    Some(factors)
}
