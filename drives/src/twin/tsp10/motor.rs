//! The stepping motor: its field turns, and the rotor is drawn after it.
//!
//! A rotor with `p` pole pairs that stands off its field by the angle `δ` feels the torque
//! `T sin(p δ)`. That is all: within a quarter of a pole pair it is a spring, so the motor holds with
//! at most `T`, which grows with the current, and swings about its field with the frequency
//! `√(T p / J) / 2π`, its resonance; damping comes from what turns against the field, and never makes more than `T` of it. Steps that come about as often shake
//! it most, whole ones by more than a step, micro-steps hardly. Beyond half a
//! pole pair the torque draws the rotor to the next place that is like the one it left, a whole pole
//! pair on: steps are lost, four full ones at a time, and nothing in the drive notices. Above its
//! corner speed the windings' inductance keeps the current from rising, and `T` falls with the speed.

use core::f64::consts::TAU;

/// Figures of a motor; assumptions, no manual's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motor {
    /// Pole pairs: 50 of a motor with 200 full steps.
    pub pole_pairs: f64,
    /// Holding torque of an ampere (rms), N·m.
    pub torque_constant: f64,
    /// Torque for a difference in speed between rotor and field at the rated current, N·m·s/rad; it goes with the current.
    pub damping: f64,
    /// Speed from which the torque falls, rev/s.
    pub corner_speed: f64,
}

impl Default for Motor {
    fn default() -> Self {
        Self {
            pole_pairs: 50.0,
            torque_constant: 0.6,
            damping: 0.02,
            corner_speed: 8.0,
        }
    }
}

impl Motor {
    /// Torque on a rotor at `position` revolutions and `velocity` rev/s, by a field at `field`
    /// revolutions that turns with `field_velocity`, at a current in A rms of so much rated one.
    #[must_use]
    pub fn torque(
        &self,
        current: f64,
        rated: f64,
        field: f64,
        field_velocity: f64,
        position: f64,
        velocity: f64,
    ) -> f64 {
        let falls = (self.corner_speed / field_velocity.abs().max(f64::MIN_POSITIVE)).min(1.0);
        let most = self.torque_constant * current * falls;
        let behind = (field - position) * self.pole_pairs;
        let angle = TAU * (behind - behind.floor());
        let damping = self.damping * current / rated * (field_velocity - velocity) * TAU;
        (most * libm::sin(angle) + damping).clamp(-most, most)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn torque_by_angle_current_and_speed() {
        let motor = Motor::default();
        let quarter = 0.25 / 50.0;
        let at = |current, behind, speed| motor.torque(current, 2.0, behind, speed, 0.0, speed);
        assert_eq!(at(2.0, 0.0, 0.0), 0.0);
        assert!((at(2.0, quarter, 0.0) - 1.2).abs() < 1e-9);
        assert!((at(1.0, quarter, 0.0) - 0.6).abs() < 1e-9);
        assert!((at(2.0, -quarter, 0.0) + 1.2).abs() < 1e-9);
        // Half a pole pair on it is drawn the other way, a whole one on not at all.
        assert!(at(2.0, 3.0 * quarter, 0.0) < -1.1);
        assert!(at(2.0, 4.0 * quarter, 0.0).abs() < 1e-9);
        assert!((at(2.0, quarter, 16.0) - 0.6).abs() < 1e-9);
        // Damping draws it along.
        assert!(motor.torque(2.0, 2.0, 0.0, 1.0, 0.0, 0.0) > 0.0);
        assert_eq!(motor.torque(0.0, 2.0, quarter, 0.0, 0.0, 1.0), 0.0);
    }

    proptest! {
        /// However fast the rotor turns against its field.
        #[test]
        fn no_torque_is_greater_than_the_current_makes(
            current in 0.0..7.0_f64,
            rated in 0.4..7.0_f64,
            field in -10.0..10.0_f64,
            speeds in [-100.0..100.0_f64, -100.0..100.0_f64],
        ) {
            let motor = Motor::default();
            let torque = motor.torque(current.min(rated), rated, field, speeds[0], 0.0, speeds[1]);
            prop_assert!(torque.abs() <= motor.torque_constant * current.min(rated), "{torque}");
        }
    }

    #[test]
    fn damping_goes_with_the_current() {
        let motor = Motor::default();
        let at = |current| motor.torque(current, 4.0, 0.0, 0.1, 0.0, 0.0);
        assert!((at(4.0) / (0.02 * 0.1 * TAU) - 1.0).abs() < 1e-12);
        assert!((at(2.0) / at(4.0) - 0.5).abs() < 1e-12);
        assert_eq!(at(0.0), 0.0);
    }
}
