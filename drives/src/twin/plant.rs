//! What the power stage moves: a rigid rotary axis with friction, and its encoder.

use super::random::Random;
use core::f64::consts::TAU;

/// Encoder increments per motor revolution, the drive's internal resolution (lxm32m 1602).
pub const INCREMENTS_PER_REVOLUTION: f64 = 131_072.0;

/// The mechanics behind a motor, seen at its shaft. The defaults are those of a 1.4 N·m motor
/// that moves about 40 kg over a 20 mm pitch: assumptions, no manual's figures.
#[derive(Clone, Debug, PartialEq)]
pub struct Mechanics {
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
    /// Standard deviation of the encoder's noise, increments.
    pub encoder_noise: f64,
}

impl Default for Mechanics {
    fn default() -> Self {
        Self {
            motor_inertia: 1.1e-4,
            load_inertia: 4.0e-4,
            viscous_friction: 5.0e-4,
            coulomb_friction: 0.08,
            load_torque: 0.0,
            brake_torque: 3.0,
            encoder_noise: 0.6,
        }
    }
}

/// A shaft in motion. Positions are revolutions from the encoder's zero.
#[derive(Clone, Debug)]
pub struct Plant {
    mechanics: Mechanics,
    position: f64,
    velocity: f64,
    noise: Random,
    blocked: bool,
}

impl Plant {
    /// A shaft at rest at `position` revolutions.
    #[must_use]
    pub fn new(mechanics: Mechanics, position: f64, noise: Random) -> Self {
        Self {
            mechanics,
            position,
            velocity: 0.0,
            noise,
            blocked: false,
        }
    }

    /// True position, revolutions.
    #[must_use]
    pub fn position(&self) -> f64 {
        self.position
    }

    /// True velocity, rev/s.
    #[must_use]
    pub fn velocity(&self) -> f64 {
        self.velocity
    }

    /// Blocks the shaft mechanically where it is, or frees it.
    pub fn block(&mut self, blocked: bool) {
        self.blocked = blocked;
    }

    /// Lets `dt` seconds pass under a motor torque in N·m, with the brake open or closed.
    pub fn step(&mut self, dt: f64, torque: f64, brake_open: bool) {
        let m = &self.mechanics;
        if self.blocked {
            self.velocity = 0.0;
            return;
        }
        let friction = m.coulomb_friction + if brake_open { 0.0 } else { m.brake_torque };
        let inertia = m.motor_inertia + m.load_inertia;
        let driving = torque + m.load_torque - m.viscous_friction * self.velocity * TAU;
        if self.velocity == 0.0 && driving.abs() <= friction {
            return;
        }
        let direction = if self.velocity == 0.0 {
            driving
        } else {
            self.velocity
        };
        let net = driving - friction.copysign(direction);
        let mut velocity = self.velocity + net / (inertia * TAU) * dt;
        // Friction stops a shaft; it does not turn it round.
        if velocity * direction < 0.0 && driving.abs() <= friction {
            velocity = 0.0;
        }
        self.position += 0.5 * (self.velocity + velocity) * dt;
        self.velocity = velocity;
    }

    /// What the encoder reads `ahead` seconds after the last step: increments from its zero.
    pub fn encoder(&mut self, ahead: f64) -> i64 {
        let noise = self.noise.bell() * self.mechanics.encoder_noise;
        ((self.position + self.velocity * ahead) * INCREMENTS_PER_REVOLUTION + noise).floor() as i64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: f64 = 62.5e-6;

    fn plant(mechanics: Mechanics) -> Plant {
        Plant::new(mechanics, 0.0, Random::new(1, 0))
    }

    #[test]
    fn a_constant_torque_accelerates_as_newton_says() {
        let mut shaft = plant(Mechanics {
            viscous_friction: 0.0,
            ..Mechanics::default()
        });
        for _ in 0..1600 {
            shaft.step(DT, 1.0, true);
        }
        let acceleration = (1.0 - 0.08) / (5.1e-4 * TAU);
        assert!((shaft.velocity() / (acceleration * 0.1) - 1.0).abs() < 1e-9);
        assert!((shaft.position() / (0.5 * acceleration * 0.01) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn friction_holds_a_shaft_at_rest_and_stops_a_coasting_one() {
        let mut shaft = plant(Mechanics::default());
        shaft.step(DT, 0.07, true);
        assert_eq!(shaft.velocity(), 0.0);
        for _ in 0..100 {
            shaft.step(DT, 0.5, true);
        }
        assert!(shaft.velocity() > 0.0);
        for _ in 0..16_000 {
            shaft.step(DT, 0.0, true);
        }
        assert_eq!(shaft.velocity(), 0.0);
    }

    #[test]
    fn gravity_pulls_a_free_axis_and_a_brake_holds_it() {
        let hanging = |brake_open| {
            let mut shaft = plant(Mechanics {
                load_torque: -0.3,
                ..Mechanics::default()
            });
            for _ in 0..160 {
                shaft.step(DT, 0.0, brake_open);
            }
            shaft.position()
        };
        assert!(hanging(true) < -1e-3);
        assert_eq!(hanging(false), 0.0);
    }
}
