//! Thermal expansion of a screw, rack or belt: what the load's position is off by where it is warmer than where its
//! lead is right.
//!
//! It grows from where it is held, its fixed bearing: there nothing moves, and everywhere else the load is off by
//! α ΔT (x − x₀). Warmth comes as of one body that a constant power heats: ΔT (1 − e^(−t/T)), from switching on. What
//! heats it, and that a screw is warmest where its nut runs most, is not modelled.

/// A uniform expansion along the travel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Expansion {
    /// Part of its length by which it grows once warm, α ΔT.
    pub strain: f64,
    /// Where it does not move, revolutions of the shaft.
    pub fixed: f64,
    /// Time constant of its warming, s; 0: it is warm from the beginning.
    pub time: f64,
}

impl Expansion {
    /// By how much the load is off at a position, both in revolutions, so many seconds after switching on.
    #[must_use]
    pub fn at(&self, position: f64, age: f64) -> f64 {
        let warm = match self.time > 0.0 {
            true => -libm::expm1(-age / self.time),
            false => 1.0,
        };
        self.strain * warm * (position - self.fixed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_screw_grows_from_its_fixed_bearing_as_it_warms() {
        let cold = Expansion::default();
        let warm = Expansion {
            strain: 230e-6,
            fixed: -20.0,
            time: 0.0,
        };
        let warming = Expansion {
            time: 600.0,
            ..warm
        };
        for position in [-20.0, 0.0, 30.0] {
            assert_eq!(cold.at(position, 1e9), 0.0);
            let grown = 230e-6 * (position + 20.0);
            assert_eq!(warm.at(position, 0.0), grown);
            assert_eq!(warming.at(position, 0.0), 0.0);
            let after = |part: f64| warming.at(position, -600.0 * libm::log(1.0 - part));
            for part in [0.1, 0.5, 0.9] {
                assert!(
                    (after(part) - part * grown).abs() <= 1e-12 * grown,
                    "{position} {part}"
                );
            }
            assert!((warming.at(position, 1e6) - grown).abs() <= 1e-12 * grown);
        }
    }
}
