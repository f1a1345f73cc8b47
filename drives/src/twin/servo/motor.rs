//! Servo motors by their figures: generic sets by torque and inertia, none a product's.

/// A synchronous servo motor.
///
/// The figures of [`MOTORS`] are assumptions, such as data sheets of motors of that torque at a 400 V
/// supply have them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motor {
    /// As a machine file names it.
    pub name: &'static str,
    /// Continuous stall torque, N·m.
    pub continuous_torque: f64,
    /// Largest torque, N·m.
    pub peak_torque: f64,
    /// Inertia of the rotor, kg·m².
    pub rotor_inertia: f64,
    /// Coulomb friction of bearings and seals, N·m.
    pub friction: f64,
    /// Viscous friction of them, N·m·s/rad.
    pub viscous_friction: f64,
    /// What its holding brake holds, N·m.
    pub brake_torque: f64,
    /// Torque of an ampere (effective), N·m/A.
    pub torque_constant: f64,
    /// Of a phase, Ω.
    pub resistance: f64,
    /// Of a phase, H.
    pub inductance: f64,
    /// Time constant with which it grows warm, s.
    pub thermal_time: f64,
    /// Pairs of poles.
    pub pole_pairs: u32,
    /// Amplitude of the torque with which magnets and slots hold it without current, N·m …
    pub cogging: f64,
    /// … so many times in a revolution.
    pub cogging_periods: u32,
    /// Amplitude of the torque's ripple under current, of 1.
    pub ripple: f64,
}

/// The generic sets, in ascending order of torque. The second is what simulated drives have where
/// nothing is known.
pub static MOTORS: [Motor; 6] = [
    motor(
        "generic-0.4",
        0.4,
        1.3e-5,
        [0.02, 1.0e-4],
        1.0,
        [0.5, 10.0, 15e-3, 15.0],
    ),
    motor(
        "generic-1.4",
        1.4,
        1.1e-4,
        [0.08, 5.0e-4],
        3.0,
        [0.8, 4.3, 12e-3, 25.0],
    ),
    motor(
        "generic-3",
        3.0,
        2.8e-4,
        [0.1, 8.0e-4],
        5.5,
        [1.2, 4.0, 16e-3, 35.0],
    ),
    motor(
        "generic-6",
        6.0,
        7.5e-4,
        [0.15, 1.5e-3],
        9.0,
        [1.5, 2.3, 12e-3, 45.0],
    ),
    motor(
        "generic-12",
        12.0,
        2.2e-3,
        [0.25, 3.0e-3],
        18.0,
        [1.6, 1.0, 7e-3, 60.0],
    ),
    motor(
        "generic-25",
        25.0,
        8.0e-3,
        [0.4, 6.0e-3],
        36.0,
        [1.8, 0.5, 5e-3, 80.0],
    ),
];

/// A set: torque, inertia, Coulomb and viscous friction, brake; torque constant, resistance,
/// inductance, thermal time constant.
const fn motor(
    name: &'static str,
    continuous_torque: f64,
    rotor_inertia: f64,
    friction: [f64; 2],
    brake_torque: f64,
    winding: [f64; 4],
) -> Motor {
    Motor {
        name,
        continuous_torque,
        peak_torque: 3.0 * continuous_torque,
        rotor_inertia,
        friction: friction[0],
        viscous_friction: friction[1],
        brake_torque,
        torque_constant: winding[0],
        resistance: winding[1],
        inductance: winding[2],
        thermal_time: winding[3],
        pole_pairs: 5,
        cogging: 0.005 * continuous_torque,
        cogging_periods: 60,
        ripple: 0.01,
    }
}

impl Motor {
    /// The set of that name.
    #[must_use]
    pub fn by_name(name: &str) -> Option<&'static Self> {
        MOTORS.iter().find(|motor| motor.name == name)
    }

    /// Speed at which a DC bus of so many volts is used up by the voltage that the rotation induces, rev/s.
    #[must_use]
    pub fn no_load_speed(&self, voltage: f64) -> f64 {
        voltage / 6.0_f64.sqrt() / (self.torque_constant / 3.0) / core::f64::consts::TAU
    }
}

impl Default for Motor {
    fn default() -> Self {
        MOTORS[1]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mechanics::rigid::Rigid;
    use crate::twin::servo::cascade::Gains;

    #[test]
    fn the_default_motor_is_that_of_the_default_axis_and_loops() {
        let (motor, rigid, gains) = (Motor::default(), Rigid::default(), Gains::default());
        let figures = [
            (motor.continuous_torque, gains.continuous_torque),
            (motor.peak_torque, gains.torque_limit),
            (motor.rotor_inertia, rigid.motor_inertia),
            (motor.friction, rigid.coulomb_friction),
            (motor.viscous_friction, rigid.viscous_friction),
            (motor.brake_torque, rigid.brake_torque),
        ];
        for (motor, default) in figures {
            assert!((motor / default - 1.0).abs() < 1e-12, "{motor} {default}");
        }
    }
}
