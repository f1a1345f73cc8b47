//! The random choices of a case.

use std::ops::RangeInclusive;
use syncline_drives::twin::random::Random;

/// Powers of ten that [`Dice::decades`] draws from, the first being 10⁻⁶.
const POWERS: [f64; 13] = [
    1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6,
];

/// A stream of random choices; the same seed and stream give the same ones on every machine.
#[derive(Clone, Debug)]
pub(super) struct Dice(Random);

impl Dice {
    /// Of a seed, a stream of its own, so that one part of a case can change without the others.
    pub(super) fn new(seed: u64, stream: u64) -> Self {
        Self(Random::new(seed, stream))
    }

    /// A number below `count`, which is not 0.
    pub(super) fn below(&mut self, count: usize) -> usize {
        (self.0.next_u64() % count.max(1) as u64) as usize
    }

    /// A whole number.
    pub(super) fn whole(&mut self, range: RangeInclusive<u32>) -> u32 {
        let count = u64::from(range.end() - range.start()) + 1;
        range.start() + (self.0.next_u64() % count) as u32
    }

    /// Whether it happens, with that probability.
    pub(super) fn chance(&mut self, probability: f64) -> bool {
        self.0.unit() < probability
    }

    /// Uniform between two numbers.
    pub(super) fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0.between(low, high)
    }

    /// From 10 to the power `low` up to 10 to the power `high`, every decade alike; to three digits,
    /// as people write numbers.
    pub(super) fn decades(&mut self, low: i32, high: i32) -> f64 {
        let decade = low + self.below((high - low) as usize) as i32;
        let digits = f64::from(self.whole(100..=999));
        // Of the two the one that gives the nearest number to what the digits say.
        match decade - 2 {
            shift @ 0.. => digits * POWERS[(6 + shift) as usize],
            shift => digits / POWERS[(6 - shift) as usize],
        }
    }

    /// One of several.
    pub(super) fn pick<'a, T>(&mut self, from: &'a [T]) -> &'a T {
        &from[self.below(from.len())]
    }

    /// The place of one of several that come as often as their weights say.
    pub(super) fn weighted(&mut self, weights: &[u32]) -> usize {
        let mut left = self.whole(1..=weights.iter().sum::<u32>().max(1));
        for (place, &weight) in weights.iter().enumerate() {
            if left <= weight {
                return place;
            }
            left -= weight;
        }
        weights.len() - 1
    }

    /// A direction in a plane, as a unit vector: rational points of the circle, which need no
    /// function whose rounding differs between machines.
    pub(super) fn direction(&mut self) -> [f64; 2] {
        let t = self.between(-1.0, 1.0);
        let (x, y) = ((1.0 - t * t) / (1.0 + t * t), 2.0 * t / (1.0 + t * t));
        if self.chance(0.5) { [x, y] } else { [-x, y] }
    }

    /// A seed for something with randomness of its own.
    pub(super) fn seed(&mut self) -> u64 {
        self.0.next_u64()
    }
}

/// A number to so many decimals, as a program or a machine file has it.
pub(super) fn rounded(value: f64, decimals: usize) -> f64 {
    let scale = POWERS[6 + decimals];
    (value * scale).round() / scale
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decades_come_alike_and_are_where_they_should_be() {
        let mut dice = Dice::new(1, 0);
        let mut seen = [0; 4];
        for _ in 0..4000 {
            let value = dice.decades(-2, 2);
            assert!((0.01..100.0).contains(&value), "{value}");
            let decade = [0.1, 1.0, 10.0].iter().filter(|it| value >= **it).count();
            seen[decade] += 1;
        }
        assert!(
            seen.iter().all(|count| (900..1100).contains(count)),
            "{seen:?}"
        );
    }

    #[test]
    fn a_direction_has_length_one_and_goes_everywhere() {
        let mut dice = Dice::new(2, 0);
        let mut quadrants = [0; 4];
        for _ in 0..1000 {
            let [x, y] = dice.direction();
            assert!((x * x + y * y - 1.0).abs() < 1e-12);
            quadrants[usize::from(x < 0.0) * 2 + usize::from(y < 0.0)] += 1;
        }
        assert!(quadrants.iter().all(|count| *count > 150), "{quadrants:?}");
    }

    #[test]
    fn weights_are_heeded() {
        let mut dice = Dice::new(3, 0);
        let mut seen = [0; 3];
        for _ in 0..4000 {
            seen[dice.weighted(&[1, 0, 3])] += 1;
        }
        assert_eq!(seen[1], 0);
        assert!((850..1150).contains(&seen[0]), "{seen:?}");
    }
}
