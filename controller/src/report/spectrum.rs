//! What frequencies a following error has, by the mean of the squares of short transforms (Welch, 1967).

use crate::observe::fourier::Window;

/// Rows to a transform.
const LENGTH: usize = 1024;
/// Transforms at most, spread evenly over a run.
const MOST: usize = 100;

/// Frequency, Hz, and density of the amplitude, of values in a unit: the unit by the root of a Hz. `period` is
/// that of the rows, s. Nothing of a run that is too short for one transform.
pub(super) fn of(values: &[f64], period: f64) -> Vec<(f64, f64)> {
    let Some(starts) = values.len().checked_sub(LENGTH) else {
        return Vec::new();
    };
    let window = Window::new(LENGTH);
    let transforms = (2 * starts / LENGTH + 1).min(MOST);
    let mut sums = vec![0.0; LENGTH / 2];
    for transform in 0..transforms {
        let start = starts * transform / transforms.saturating_sub(1).max(1);
        let seen = window.weighted(&values[start..start + LENGTH]);
        for (bin, sum) in sums.iter_mut().enumerate().skip(1) {
            let [re, im] = window.bin(&seen, bin);
            *sum += re * re + im * im;
        }
    }
    let density = |sum: f64| (2.0 * sum * period / window.power() / transforms as f64).sqrt();
    sums.iter()
        .enumerate()
        .skip(1)
        .map(|(bin, sum)| (bin as f64 / (LENGTH as f64 * period), density(*sum)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::TAU;

    proptest! {
        /// The square of the density over all frequencies is the mean square of the values.
        #[test]
        fn a_sine_is_at_its_frequency_with_its_power(
            bin in 8..500_usize, amplitude in 0.01..10.0_f64, phase in 0.0..6.0_f64, rows in 1024..5000_usize,
        ) {
            let period = 0.002;
            let frequency = bin as f64 / (LENGTH as f64 * period);
            let values: Vec<f64> = (0..rows)
                .map(|n| 3.0 + amplitude * (TAU * frequency * n as f64 * period + phase).sin())
                .collect();
            let found = of(&values, period);
            let greatest = found.iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
            prop_assert!((greatest.0 - frequency).abs() < 1e-9);
            let width = found[1].0 - found[0].0;
            let power: f64 = found.iter().map(|it| it.1 * it.1 * width).sum();
            prop_assert!((power / (0.5 * amplitude * amplitude) - 1.0).abs() < 0.01, "{power}");
        }
    }

    #[test]
    fn a_short_run_has_none() {
        assert_eq!(of(&[0.0; LENGTH - 1], 0.002), []);
    }
}
