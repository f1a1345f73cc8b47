//! Differences between two distributions that were measured in turn, with confidence intervals.

/// Resamples behind an interval.
const RESAMPLES: usize = 1000;

/// Neighbouring samples depend on each other (a busy host stays busy for a while): they are drawn
/// in blocks of this many.
const BLOCK: usize = 50;

/// A difference with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// As measured.
    pub estimate: f64,
    /// 2.5 % of the resamples lie below …
    pub low: f64,
    /// … and 2.5 % above.
    pub high: f64,
}

/// The difference of a quantile (0…1) between `ours` and `theirs`, whose samples were taken in
/// pairs, by a paired block bootstrap: percentile interval of 1,000 resamples, the same ones for
/// the same data. `None` without at least two blocks.
#[must_use]
pub fn quantile_difference(ours: &[u32], theirs: &[u32], quantile: f64) -> Option<Difference> {
    let pairs = ours.len().min(theirs.len());
    let blocks = pairs / BLOCK;
    if blocks < 2 {
        return None;
    }
    let mut sample = (Vec::with_capacity(pairs), Vec::with_capacity(pairs));
    let mut random = Random(0x9E37_79B9_7F4A_7C15);
    let mut differences: Vec<f64> = (0..RESAMPLES)
        .map(|_| {
            sample.0.clear();
            sample.1.clear();
            for _ in 0..blocks {
                let start = random.below(pairs - BLOCK + 1);
                sample.0.extend_from_slice(&ours[start..start + BLOCK]);
                sample.1.extend_from_slice(&theirs[start..start + BLOCK]);
            }
            quantile_of(&mut sample.0, quantile) - quantile_of(&mut sample.1, quantile)
        })
        .collect();
    differences.sort_by(f64::total_cmp);
    let estimate = quantile_of(&mut ours[..pairs].to_vec(), quantile)
        - quantile_of(&mut theirs[..pairs].to_vec(), quantile);
    Some(Difference {
        estimate,
        low: differences[RESAMPLES / 40],
        high: differences[RESAMPLES - 1 - RESAMPLES / 40],
    })
}

/// The sample that `quantile` of the samples do not exceed; reorders them.
fn quantile_of(samples: &mut [u32], quantile: f64) -> f64 {
    let rank = (samples.len() as f64 * quantile).ceil() as usize;
    let index = rank.clamp(1, samples.len()) - 1;
    let (_, value, _) = samples.select_nth_unstable(index);
    f64::from(*value)
}

/// Splitmix64.
struct Random(u64);

impl Random {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((u128::from(z ^ (z >> 31)) * bound as u128) >> 64) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(seed: u64, count: usize, shift: u32) -> Vec<u32> {
        let mut random = Random(seed);
        (0..count)
            .map(|_| 1000 + shift + random.below(500) as u32)
            .collect()
    }

    #[test]
    fn a_shift_is_found_and_lies_in_its_interval() {
        let (ours, theirs) = (noise(1, 5000, 120), noise(2, 5000, 0));
        for quantile in [0.5, 0.99] {
            let difference = quantile_difference(&ours, &theirs, quantile).unwrap();
            assert!(
                difference.low <= 120.0 && 120.0 <= difference.high,
                "{difference:?}"
            );
            assert!(difference.high - difference.low < 60.0, "{difference:?}");
        }
    }

    #[test]
    fn without_a_shift_zero_lies_in_the_interval() {
        let difference = quantile_difference(&noise(3, 5000, 0), &noise(4, 5000, 0), 0.5).unwrap();
        assert!(
            difference.low <= 0.0 && 0.0 <= difference.high,
            "{difference:?}"
        );
    }

    #[test]
    fn too_few_samples_give_no_interval() {
        assert_eq!(quantile_difference(&[1; 99], &[1; 99], 0.5), None);
    }
}
