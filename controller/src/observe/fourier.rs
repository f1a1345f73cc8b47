//! Transforms of stretches of rows under a window (Hann), bin by bin.

use std::f64::consts::TAU;

/// What transforms of one length share.
#[derive(Debug)]
pub(crate) struct Window {
    weights: Vec<f64>,
    sines: Vec<f64>,
    cosines: Vec<f64>,
}

impl Window {
    /// For stretches of so many rows.
    pub(crate) fn new(length: usize) -> Self {
        let turn = |n: usize| TAU * n as f64 / length as f64;
        let (sines, cosines) = (0..length).map(|n| turn(n).sin_cos()).unzip();
        Self {
            weights: (0..length).map(|n| 0.5 - 0.5 * turn(n).cos()).collect(),
            sines,
            cosines,
        }
    }

    /// Rows of a stretch.
    pub(crate) fn length(&self) -> usize {
        self.weights.len()
    }

    /// Sum of the squares of the weights.
    pub(crate) fn power(&self) -> f64 {
        self.weights.iter().map(|it| it * it).sum()
    }

    /// A stretch of that length, without its mean and weighted.
    pub(crate) fn weighted(&self, stretch: &[f64]) -> Vec<f64> {
        let mean = stretch.iter().sum::<f64>() / stretch.len() as f64;
        let rows = stretch.iter().zip(&self.weights);
        rows.map(|(value, weight)| (value - mean) * weight)
            .collect()
    }

    /// Real and imaginary part of what a weighted stretch has so many times in its length: Σ x e^(i ω t).
    pub(crate) fn bin(&self, weighted: &[f64], bin: usize) -> [f64; 2] {
        let mut sum = [0.0; 2];
        for (n, value) in weighted.iter().enumerate() {
            let turn = bin * n % self.length();
            sum[0] += value * self.cosines[turn];
            sum[1] += value * self.sines[turn];
        }
        sum
    }
}
