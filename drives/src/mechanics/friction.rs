//! Friction of a guide, a bearing or a nut.

/// Friction over speed, after Stribeck: what it takes to break away, falling to the Coulomb
/// friction as a film of lubricant builds up, and a viscous part that grows with speed.
///
/// The falling part follows Hess and Soom (1990), `1 / (1 + (v/vₛ)²)`, which needs no function
/// whose rounding differs between machines.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Friction {
    /// Of sliding, N·m.
    pub coulomb: f64,
    /// Of breaking away, N·m; at least `coulomb`.
    pub breakaway: f64,
    /// Speed at which half of the difference between both is left, rad/s; above 0 where they differ.
    pub stribeck_speed: f64,
    /// N·m·s/rad.
    pub viscous: f64,
}

impl Friction {
    /// Coulomb friction alone, N·m.
    #[must_use]
    pub fn coulomb(coulomb: f64) -> Self {
        Self {
            coulomb,
            breakaway: coulomb,
            ..Self::default()
        }
    }

    /// Most that it holds against at a speed in rad/s, N·m, without the viscous part.
    #[must_use]
    pub fn level(&self, speed: f64) -> f64 {
        let extra = self.breakaway - self.coulomb;
        if extra == 0.0 {
            return self.coulomb;
        }
        let share = speed * (1.0 / self.stribeck_speed);
        self.coulomb + extra / (1.0 + share * share)
    }

    /// Whether it falls with speed.
    #[must_use]
    pub fn falls(&self) -> bool {
        self.breakaway != self.coulomb
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn falls_from_breakaway_to_coulomb() {
        let friction = Friction {
            coulomb: 0.1,
            breakaway: 0.3,
            stribeck_speed: 2.0,
            viscous: 0.0,
        };
        assert!((friction.level(0.0) - 0.3).abs() < 1e-15);
        assert!((friction.level(-2.0) - 0.2).abs() < 1e-15);
        assert!((friction.level(1e6) - 0.1).abs() < 1e-9);
        assert_eq!(Friction::coulomb(0.1).level(0.0), 0.1);
    }
}
