//! Millimetres to increments and back: the one place where this happens.

use core::{
    fmt,
    ops::{Add, AddAssign, Sub},
};
use thiserror::Error;

/// A drive's position in encoder increments. 64 bits, so that sums and differences of what a
/// drive can send (32 bits) are exact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Increments(i64);

impl Increments {
    /// Zero.
    pub const ZERO: Self = Self(0);
    /// The least position that a drive's INTEGER32 holds.
    pub const MIN: Self = Self(i32::MIN as i64);
    /// The greatest position that a drive's INTEGER32 holds.
    pub const MAX: Self = Self(i32::MAX as i64);

    /// `count` increments.
    #[must_use]
    pub const fn new(count: i64) -> Self {
        Self(count)
    }

    /// The count.
    #[must_use]
    pub const fn get(self) -> i64 {
        self.0
    }

    /// The nearest position that a drive's INTEGER32 holds.
    #[must_use]
    pub fn saturating_i32(self) -> i32 {
        self.clamp(Self::MIN, Self::MAX).0 as i32
    }
}

impl From<i32> for Increments {
    fn from(count: i32) -> Self {
        Self(count.into())
    }
}

impl Add for Increments {
    type Output = Self;

    fn add(self, rhs: Self) -> Self {
        Self(self.0 + rhs.0)
    }
}

impl AddAssign for Increments {
    fn add_assign(&mut self, rhs: Self) {
        self.0 += rhs.0;
    }
}

impl Sub for Increments {
    type Output = Self;

    fn sub(self, rhs: Self) -> Self {
        Self(self.0 - rhs.0)
    }
}

impl fmt::Display for Increments {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// A position that is none of a drive's, see [`Model::positions`](super::Model::positions).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("position outside the drive's range")]
pub struct OutOfRange;

/// Which way the motor turns when the axis moves in its positive direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Direction {
    /// The encoder counts up.
    #[default]
    Positive,
    /// The encoder counts down, as on the mirrored side of a gantry.
    Negative,
}

impl Direction {
    /// 1 or −1: what a speed or a torque of the axis is multiplied by to be the drive's, and one of the drive's to be the
    /// axis's.
    #[must_use]
    pub fn sign(self) -> f64 {
        match self {
            Self::Positive => 1.0,
            Self::Negative => -1.0,
        }
    }
}

/// How an axis's millimetres and a drive's increments belong together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scaling {
    increments_per_revolution: f64,
    /// Signed by the direction.
    mm_per_revolution: f64,
    zero: Increments,
}

impl Scaling {
    /// `zero` is what the drive reports at machine position 0.
    ///
    /// # Panics
    /// If `mm_per_revolution` is not positive and finite.
    #[must_use]
    pub fn new(
        increments_per_revolution: u32,
        mm_per_revolution: f64,
        direction: Direction,
        zero: Increments,
    ) -> Self {
        assert!(mm_per_revolution > 0.0 && mm_per_revolution.is_finite());
        Self {
            increments_per_revolution: increments_per_revolution.into(),
            mm_per_revolution: direction.sign() * mm_per_revolution,
            zero,
        }
    }

    /// The drive's position at machine position `mm`, to the nearest increment. Halves go away
    /// from zero, so that the two sides of a mirrored gantry round alike.
    ///
    /// Every call converts an absolute position: nothing accumulates.
    ///
    /// # Errors
    /// If the position is not finite or so far away that an f64 has no single increments there.
    pub fn to_increments(&self, mm: f64) -> Result<Increments, OutOfRange> {
        // A power of two per revolution: the product is exact, so that only the quotient rounds.
        let from_zero = (mm * self.increments_per_revolution / self.mm_per_revolution).round();
        // Beyond 2⁵³ an f64 has no single increments left; NaN fails the comparison too.
        if from_zero.abs() < 9_007_199_254_740_992.0 {
            Ok(Increments(from_zero as i64) + self.zero)
        } else {
            Err(OutOfRange)
        }
    }

    /// A velocity as the drive counts, increments/s, of one in mm/s.
    #[must_use]
    pub fn to_increments_per_second(&self, mm_per_second: f64) -> f64 {
        mm_per_second * self.increments_per_revolution / self.mm_per_revolution
    }

    /// The machine position in mm at the drive's `position`.
    #[must_use]
    pub fn to_mm(&self, position: Increments) -> f64 {
        self.length((position - self.zero).0)
    }

    /// One increment in mm.
    #[must_use]
    pub fn resolution(&self) -> f64 {
        self.length(1).abs()
    }

    /// What the drive reports at machine position 0.
    #[must_use]
    pub fn zero(&self) -> Increments {
        self.zero
    }

    /// How far a revolution in the direction in which the device counts up moves the axis, mm.
    #[must_use]
    pub fn travel_per_revolution(&self) -> f64 {
        self.mm_per_revolution
    }

    /// Which way the drive counts.
    #[must_use]
    pub fn direction(&self) -> Direction {
        if self.mm_per_revolution > 0.0 {
            Direction::Positive
        } else {
            Direction::Negative
        }
    }

    /// A revolution of the motor.
    #[must_use]
    pub fn revolution(&self) -> Increments {
        Increments(self.increments_per_revolution as i64)
    }

    /// Where the motor's shaft stands at a position of the drive, revolutions.
    #[must_use]
    pub fn to_revolutions(&self, position: Increments) -> f64 {
        position.get() as f64 / self.increments_per_revolution
    }

    /// A length in increments, rounded up, at least one and at most what an INTEGER32 holds.
    #[must_use]
    pub fn magnitude(&self, mm: f64) -> Increments {
        let count = (mm * self.increments_per_revolution / self.mm_per_revolution).abs();
        Increments(count.ceil().clamp(1.0, i32::MAX.into()) as i64)
    }

    fn length(&self, increments: i64) -> f64 {
        increments as f64 * self.mm_per_revolution / self.increments_per_revolution
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn scaling(direction: Direction, zero: i64) -> Scaling {
        Scaling::new(131_072, 10.0, direction, Increments::new(zero))
    }

    #[test]
    fn a_revolution_is_131072_increments_of_ten_millimetres() {
        let axis = scaling(Direction::Positive, 1000);
        assert_eq!(axis.to_increments(0.0), Ok(Increments::new(1000)));
        assert_eq!(axis.to_increments(10.0), Ok(Increments::new(132_072)));
        assert_eq!(axis.to_mm(Increments::new(132_072)), 10.0);
        let mirrored = scaling(Direction::Negative, 1000);
        assert_eq!(mirrored.to_increments(10.0), Ok(Increments::new(-130_072)));
        assert_eq!(mirrored.to_mm(Increments::new(-130_072)), 10.0);
    }

    #[test]
    fn halves_round_away_from_zero_on_both_sides() {
        let half = 10.0 / 131_072.0 / 2.0;
        for direction in [Direction::Positive, Direction::Negative] {
            let axis = scaling(direction, 0);
            let up = axis.to_increments(half).unwrap().get();
            let down = axis.to_increments(-half).unwrap().get();
            assert_eq!((up.abs(), down), (1, -up));
        }
    }

    #[test]
    fn what_has_no_single_increments_is_refused() {
        let axis = scaling(Direction::Positive, 0);
        let last = 10.0 * 68_719_476_735.0;
        let counts = 68_719_476_735 << 17;
        assert_eq!(axis.to_increments(last), Ok(Increments::new(counts)));
        assert_eq!(axis.to_increments(-last), Ok(Increments::new(-counts)));
        for mm in [last + 10.0, f64::NAN, f64::INFINITY, 1e300] {
            assert_eq!(axis.to_increments(mm), Err(OutOfRange), "{mm}");
        }
    }

    proptest! {
        #[test]
        fn every_increment_comes_back(
            position: i32, zero in -1_000_000i64..1_000_000, pitch in 0.1..500.0, mirrored: bool,
        ) {
            let direction = if mirrored { Direction::Negative } else { Direction::Positive };
            let axis = Scaling::new(131_072, pitch, direction, Increments::new(zero));
            let position = Increments::from(position);
            prop_assert_eq!(axis.to_increments(axis.to_mm(position)), Ok(position));
        }

        #[test]
        fn no_position_is_off_by_more_than_half_an_increment(mm in -100_000.0..100_000.0) {
            let axis = scaling(Direction::Positive, 77);
            let back = axis.to_mm(axis.to_increments(mm).unwrap());
            prop_assert!((back - mm).abs() <= axis.resolution() * 0.500_001);
        }
    }
}
