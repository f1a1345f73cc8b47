//! A rigid rotary axis with friction, for one shaft alone.

use super::{Load, Mechanics, Motion};
use core::f64::consts::TAU;

/// An axis behind a motor, seen at its shaft. The defaults are those of a 1.4 N·m motor
/// that moves about 40 kg over a 20 mm pitch: assumptions, no manual's figures.
#[derive(Clone, Debug, PartialEq)]
pub struct Rigid {
    /// Inertia of the rotor, kg·m².
    pub motor_inertia: f64,
    /// Inertia of everything it drives, kg·m².
    pub load_inertia: f64,
    /// Viscous friction, N·m·s/rad.
    pub viscous_friction: f64,
    /// Coulomb friction, N·m.
    pub coulomb_friction: f64,
    /// Constant torque of the load on the shaft, N·m: gravity.
    pub load_torque: f64,
    /// Torque of the holding brake, N·m, that grips while the power stage is off; 0 without one.
    pub brake_torque: f64,
}

impl Default for Rigid {
    fn default() -> Self {
        Self {
            motor_inertia: 1.1e-4,
            load_inertia: 4.0e-4,
            viscous_friction: 5.0e-4,
            coulomb_friction: 0.08,
            load_torque: 0.0,
            brake_torque: 3.0,
        }
    }
}

impl Rigid {
    /// Most torque with which friction and brake hold the shaft, N·m.
    #[must_use]
    pub fn grip(&self, brake_open: bool) -> f64 {
        self.coulomb_friction + if brake_open { 0.0 } else { self.brake_torque }
    }
}

impl Rigid {
    /// How the shaft moves `dt` seconds later under a load.
    #[inline(always)]
    pub(crate) fn moved(&self, dt: f64, load: &Load, shaft: Motion) -> Motion {
        let (position, velocity) = (shaft.position, shaft.velocity);
        let rests = Motion {
            velocity: 0.0,
            acceleration: 0.0,
            ..shaft
        };
        if load.blocked {
            return rests;
        }
        // Whoever closes a loop waits for what is made of the torque: all else is made before.
        let friction = self.grip(load.brake_open);
        let inertia = self.motor_inertia + self.load_inertia;
        let gain = dt / (inertia * TAU);
        let rest = load.outside + self.load_torque - self.viscous_friction * velocity * TAU;
        let driving = load.torque + rest;
        if velocity == 0.0 && driving.abs() <= friction {
            return rests;
        }
        let (direction, net) = if velocity == 0.0 {
            (driving, driving - friction.copysign(driving))
        } else {
            (velocity, load.torque + (rest - friction.copysign(velocity)))
        };
        let mut after = velocity + net * gain;
        // Friction stops a shaft; it does not turn it round.
        if after * direction < 0.0 && driving.abs() <= friction {
            after = 0.0;
        }
        Motion {
            position: position + (velocity + after) * (0.5 * dt),
            velocity: after,
            acceleration: 0.0,
        }
    }
}

impl Mechanics for Rigid {
    /// `loads` and `motions` are those of one shaft.
    fn step(&mut self, dt: f64, loads: &[Load], motions: &mut [Motion]) {
        if let ([load], [shaft]) = (loads, motions) {
            *shaft = self.moved(dt, load, *shaft);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: f64 = 62.5e-6;

    /// The shaft after so many steps from rest.
    fn pushed(
        rigid: &mut Rigid,
        from: Motion,
        steps: usize,
        torque: f64,
        brake_open: bool,
    ) -> Motion {
        let load = Load {
            torque,
            outside: 0.0,
            brake_open,
            blocked: false,
        };
        let mut shaft = [from];
        for _ in 0..steps {
            rigid.step(DT, &[load], &mut shaft);
        }
        shaft[0]
    }

    #[test]
    fn a_constant_torque_accelerates_as_newton_says() {
        let mut rigid = Rigid {
            viscous_friction: 0.0,
            ..Rigid::default()
        };
        let shaft = pushed(&mut rigid, Motion::default(), 1600, 1.0, true);
        let acceleration = (1.0 - 0.08) / (5.1e-4 * TAU);
        assert!((shaft.velocity / (acceleration * 0.1) - 1.0).abs() < 1e-9);
        assert!((shaft.position / (0.5 * acceleration * 0.01) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn friction_holds_a_shaft_at_rest_and_stops_a_coasting_one() {
        let mut rigid = Rigid::default();
        let mut shaft = pushed(&mut rigid, Motion::default(), 1, 0.07, true);
        assert_eq!(shaft.velocity, 0.0);
        shaft = pushed(&mut rigid, shaft, 100, 0.5, true);
        assert!(shaft.velocity > 0.0);
        shaft = pushed(&mut rigid, shaft, 16_000, 0.0, true);
        assert_eq!(shaft.velocity, 0.0);
    }

    #[test]
    fn gravity_pulls_a_free_axis_and_a_brake_holds_it() {
        let mut hanging = Rigid {
            load_torque: -0.3,
            ..Rigid::default()
        };
        let mut fallen =
            |brake_open| pushed(&mut hanging, Motion::default(), 160, 0.0, brake_open).position;
        assert!(fallen(true) < -1e-3);
        assert_eq!(fallen(false), 0.0);
    }
}
