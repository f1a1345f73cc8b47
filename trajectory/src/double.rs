//! Double-double arithmetic: sums and products of two `f64` that keep about 106 bits.
//!
//! Error-free transformations after Knuth (sum) and Dekker (product), without fused operations, so
//! that every machine computes the same.

use core::ops::{Add, Mul, Neg, Sub};

/// An unevaluated sum `hi + lo` with `|lo| ≤ ulp(hi)/2`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Double {
    hi: f64,
    lo: f64,
}

impl Double {
    pub(crate) const ZERO: Double = Double { hi: 0.0, lo: 0.0 };
    /// One sixth.
    pub(crate) const SIXTH: Double = Double {
        hi: 1.0 / 6.0,
        lo: 9.25185853854297e-18,
    };

    fn quick(a: f64, b: f64) -> Self {
        let hi = a + b;
        Double {
            hi,
            lo: b - (hi - a),
        }
    }

    /// The exact sum of two numbers.
    fn sum(a: f64, b: f64) -> Self {
        let hi = a + b;
        let bb = hi - a;
        Double {
            hi,
            lo: (a - (hi - bb)) + (b - bb),
        }
    }

    /// The exact product of two numbers.
    pub(crate) fn product(a: f64, b: f64) -> Self {
        let split = |x: f64| {
            let c = 134_217_729.0 * x;
            let high = c - (c - x);
            (high, x - high)
        };
        let hi = a * b;
        let ((ah, al), (bh, bl)) = (split(a), split(b));
        Double {
            hi,
            lo: ((ah * bh - hi) + ah * bl + al * bh) + al * bl,
        }
    }

    pub(crate) fn half(self) -> Self {
        Double {
            hi: 0.5 * self.hi,
            lo: 0.5 * self.lo,
        }
    }

    pub(crate) fn abs(self) -> Self {
        if self.hi < 0.0 { -self } else { self }
    }

    /// The nearest `f64`.
    pub(crate) fn value(self) -> f64 {
        self.hi
    }
}

impl From<f64> for Double {
    fn from(x: f64) -> Self {
        Double { hi: x, lo: 0.0 }
    }
}

impl Neg for Double {
    type Output = Double;
    fn neg(self) -> Double {
        Double {
            hi: -self.hi,
            lo: -self.lo,
        }
    }
}

impl Add for Double {
    type Output = Double;
    fn add(self, other: Double) -> Double {
        let high = Double::sum(self.hi, other.hi);
        let low = Double::sum(self.lo, other.lo);
        let s = Double::quick(high.hi, high.lo + low.hi);
        Double::quick(s.hi, s.lo + low.lo)
    }
}

impl Sub for Double {
    type Output = Double;
    fn sub(self, other: Double) -> Double {
        self + -other
    }
}

impl Mul for Double {
    type Output = Double;
    fn mul(self, other: Double) -> Double {
        let p = Double::product(self.hi, other.hi);
        Double::quick(p.hi, p.lo + (self.hi * other.lo + self.lo * other.hi))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_single_f64_rounds_away_is_kept() {
        let tiny = Double::from(1e-25);
        let one = Double::from(1.0);
        assert_eq!(((one + tiny) - one).value(), 1e-25);
        let x = Double::from(1.0 + f64::EPSILON);
        assert_eq!(
            (x * x - one - Double::from(2.0 * f64::EPSILON)).value(),
            f64::EPSILON.powi(2)
        );
        let sixth = Double::SIXTH * Double::from(6.0) - one;
        assert!(sixth.abs().value() < 1e-31, "{sixth:?}");
    }
}
