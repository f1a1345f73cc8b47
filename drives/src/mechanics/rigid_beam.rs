//! A rigid beam on two guides, each side moved by a motor of its own: a gantry.
//!
//! The beam has two degrees of freedom, its middle `x` and its angle `θ` (small), so that the sides
//! stand at `x ± θ·span/2`. Both motors feel both: with `r` metres of travel for a radian of a
//! shaft, the kinetic energy ½ m ẋ² + ½ J θ̇² + ½ Σ Jᵣ ω² gives the mass matrix of the two shafts
//!
//! ```text
//! M = | Jᵣ₁ + (m/4 + J/span²) r₁²   (m/4 − J/span²) r₁ r₂       |
//!     | (m/4 − J/span²) r₁ r₂       Jᵣ₂ + (m/4 + J/span²) r₂²   |
//! ```
//!
//! and M ω̇ = torques. Without friction a step is exact for torques that are constant in it, and
//! conserves momentum and energy to rounding.
//!
//! # Racking
//!
//! Where the guides hold the beam square they push back with the *racking torque* k θ + d θ̇. It acts
//! on the shafts as `t = (r₁, −r₂) / span`, which turns their speeds into θ̇. Skew is counted from where the
//! sides stand at the beginning.
//!
//! # A carriage
//!
//! A carriage of mass `m_c` at `y` along the beam, which another axis moves, makes mass and inertia
//! follow it. Across the beam its speed is
//!
//! ```text
//! V = ẋ + y θ̇ + ẏ θ = w·ω + ẏ θ        w = (r₁/2 + y r₁/span, r₂/2 − y r₂/span)
//! ```
//!
//! and Lagrange's equations leave M ω̇ + m_c w V̇ = torques, in which V̇ = w·ω̇ + 2 ẏ θ̇ + ÿ θ has the
//! Coriolis term. A step takes the difference of V between its ends and means of both ends for w, θ and θ̇:
//!
//! ```text
//! M Δω + m_c w ΔV + t (k θ + d θ̇) h = torques h
//! ```
//!
//! two linear equations in Δω. The momentum along the guides, m ẋ + m_c V, is kept to rounding, energy with
//! the square of the step. What the skewed beam does to the carriage's own axis, m_c θ V̇, is left out: a
//! thousandth of the force across at a skew of 1 mm in 1 m.
//!
//! # Viscous friction
//!
//! With the friction `b` of each shaft, M ω̇ + b ω = torques. A step is exact for this, too, however much friction there is: with
//! `X = M⁻¹ b h` the speeds that are there decay as e^(−X), which is
//!
//! ```text
//! M φ(X) Δω = (torques − b ω) h        φ(x) = x / (1 − e^(−x)) = 1 + x/2 + x²/12 − …
//! ```
//!
//! M is that of the beam with its carriage. The positions take the mean of the speeds at both ends, as everything else does.
//!
//! Friction, brakes and blocks are [`reactions`], impulses against each shaft. With a carriage in motion
//! their matrix is symmetric but for `h ẏ`; its symmetric part stands for it where they are chosen.

use super::reactions::reactions;
use super::rigid::Rigid;
use super::{Load, Mechanics, Motion};
use core::f64::consts::TAU;
use nalgebra::{Matrix2, Vector2};

/// The beam itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beam {
    /// kg.
    pub mass: f64,
    /// Rotational inertia about its centre, kg·m².
    pub inertia: f64,
    /// Distance of its two sides, m.
    pub span: f64,
    /// What holds it square.
    pub racking: Racking,
}

/// How guides and frame hold a beam square.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Racking {
    /// N·m/rad.
    pub stiffness: f64,
    /// N·m·s/rad.
    pub damping: f64,
}

/// What another axis moves along a beam.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Carriage {
    /// kg.
    pub mass: f64,
    /// Travel towards the first side for a revolution of its motor, m; negative if away from it.
    pub travel: f64,
    /// Where its motor stands with the carriage in the beam's middle, revolutions.
    pub middle: f64,
}

/// One side's drive train.
#[derive(Clone, Debug, PartialEq)]
pub struct Side {
    /// Travel for a motor revolution, m; negative if the motor turns the other way.
    pub travel: f64,
    /// Rotor, friction and brake; its load is the beam.
    pub rigid: Rigid,
}

/// A beam between two shafts; see the [module](self).
#[derive(Clone, Debug)]
pub struct RigidBeam {
    sides: [Side; 2],
    carriage: Option<Carriage>,
    racking: Racking,
    mass: Matrix2<f64>,
    /// Of a radian of each shaft, rad of skew.
    turning: Vector2<f64>,
    /// Viscous friction of each shaft, N·m·s/rad.
    viscous: Vector2<f64>,
    span: f64,
    /// rad.
    skew: f64,
    /// rad/s.
    skew_rate: f64,
    /// Of the carriage at the end of the last step; `None` before the first.
    carried: Option<Carried>,
}

/// Where the carriage is.
#[derive(Clone, Copy, Debug)]
struct Carried {
    /// Of each shaft's speed, metres across the beam.
    across: Vector2<f64>,
    /// Along the beam, m/s.
    along: f64,
}

/// A step's equation: `mass Δω = push + impulses`.
struct Equation {
    mass: Matrix2<f64>,
    push: Vector2<f64>,
}

impl RigidBeam {
    /// A beam on two sides; `None` if mass, inertia, span, rotor inertias or travels are not such
    /// that every motion has kinetic energy.
    #[must_use]
    pub fn new(beam: Beam, sides: [Side; 2]) -> Option<Self> {
        let [r1, r2] = [sides[0].travel / TAU, sides[1].travel / TAU];
        let rotation = beam.inertia / (beam.span * beam.span);
        let own = 0.25 * beam.mass + rotation;
        let shared = (0.25 * beam.mass - rotation) * r1 * r2;
        let mass = Matrix2::new(
            sides[0].rigid.motor_inertia + own * r1 * r1,
            shared,
            shared,
            sides[1].rigid.motor_inertia + own * r2 * r2,
        );
        let definite = mass.m11 > 0.0 && mass.determinant() > 0.0;
        mass.try_inverse().filter(|_| definite)?;
        Some(Self {
            mass,
            viscous: Vector2::from(sides.each_ref().map(|side| side.rigid.viscous_friction)),
            sides,
            carriage: None,
            racking: beam.racking,
            turning: Vector2::new(r1, -r2) / beam.span,
            span: beam.span,
            skew: 0.0,
            skew_rate: 0.0,
            carried: None,
        })
    }

    /// The same with a carriage, whose shaft's motion comes after those of the sides.
    #[must_use]
    pub fn carrying(self, carriage: Carriage) -> Self {
        Self {
            carriage: Some(carriage),
            ..self
        }
    }

    /// Skew of the beam, rad: positive with the first side ahead.
    #[must_use]
    pub fn skew(&self) -> f64 {
        self.skew
    }

    /// Where a carriage is whose motor moves so.
    fn carried(&self, carriage: &Carriage, motor: &Motion) -> Carried {
        let along = (motor.position - carriage.middle) * carriage.travel;
        let side = |side: usize, sign: f64| {
            let travel = self.sides[side].travel / TAU;
            travel * (0.5 + sign * along / self.span)
        };
        Carried {
            across: Vector2::new(side(0, 1.0), side(1, -1.0)),
            along: motor.velocity * carriage.travel,
        }
    }

    /// What friction, guides and carriage make of a step of `dt` seconds from these speeds.
    fn equation(&mut self, dt: f64, before: Vector2<f64>, carriage: Option<&Motion>) -> Equation {
        let Racking { stiffness, damping } = self.racking;
        let turning = self.turning;
        let rate = turning.dot(&before);
        let mut mass = self.mass;
        let mut push = self.viscous.component_mul(&before) * -dt;
        if let (Some(carriage), Some(motor)) = (self.carriage, carriage) {
            let now = self.carried(&carriage, motor);
            let then = self.carried.unwrap_or(now);
            let across = 0.5 * (then.across + now.across);
            // ΔV is linear in Δω: what of it Δω makes, and what is there without.
            let made = now.across + turning * (0.5 * dt * now.along);
            let there = (now.across - then.across).dot(&before)
                + now.along * dt * rate
                + (now.along - then.along) * self.skew;
            mass += across * made.transpose() * carriage.mass;
            push -= across * (carriage.mass * there);
            self.carried = Some(now);
        }
        mass = dragged(&mass, &(self.viscous * dt));
        if stiffness != 0.0 || damping != 0.0 {
            let softness = 0.5 * dt * (damping + 0.5 * dt * stiffness);
            mass += turning * turning.transpose() * softness;
            let held = stiffness * (self.skew + 0.5 * dt * rate) + damping * rate;
            push -= turning * (held * dt);
        }
        Equation { mass, push }
    }
}

/// M φ(X) of the [module](self), for the friction of each shaft in a step, N·m·s²/rad. A function of a matrix of two rows is linear in
/// it, through its values at both eigenvalues.
fn dragged(mass: &Matrix2<f64>, drag: &Vector2<f64>) -> Matrix2<f64> {
    if *drag == Vector2::zeros() {
        return *mass;
    }
    let determinant = mass.determinant();
    let half = 0.5 * (mass.m22 * drag.x + mass.m11 * drag.y) / determinant;
    let product = drag.x * drag.y / determinant;
    let greater = half + (half * half - product).max(0.0).sqrt();
    let less = product / greater;
    let phi = |x: f64| if x == 0.0 { 1.0 } else { x / -libm::expm1(-x) };
    let slope = match greater - less {
        0.0 => 0.0,
        apart => (phi(greater) - phi(less)) / apart,
    };
    mass * (phi(less) - slope * less) + Matrix2::from_diagonal(drag) * slope
}

impl Mechanics for RigidBeam {
    /// `loads` are those of the two sides, in their order, `motions` too, and of the carriage's motor if
    /// there is one.
    fn step(&mut self, dt: f64, loads: &[Load], motions: &mut [Motion]) {
        let ([load1, load2], [motion1, motion2, others @ ..]) = (loads, motions) else {
            return;
        };
        let before = Vector2::new(motion1.velocity, motion2.velocity) * TAU;
        let torque = |load: &Load, side: &Side| load.torque + load.outside + side.rigid.load_torque;
        let torques = Vector2::new(torque(load1, &self.sides[0]), torque(load2, &self.sides[1]));
        let bound = |load: &Load, side: &Side| match load.blocked {
            true => f64::INFINITY,
            false => side.rigid.grip(load.brake_open) * dt,
        };
        let mut bounds = Vector2::new(bound(load1, &self.sides[0]), bound(load2, &self.sides[1]));
        let Equation { mass, push } = self.equation(dt, before, others.first());
        let inverse = mass.try_inverse().unwrap_or_else(Matrix2::zeros);
        let free = before + inverse * torques * dt + inverse * push;
        let (reactions, after) = loop {
            let reactions = symmetric_reactions(&mass, &inverse, &free, &bounds);
            let after = free + inverse * reactions;
            // What turns round within the step has friction one way and then the other.
            let turns = [0, 1].map(|side: usize| {
                let is_held = reactions[side].abs() < bounds[side];
                !is_held && bounds[side] > 0.0 && before[side] * after[side] < 0.0
            });
            if turns == [false; 2] {
                break (reactions, after);
            }
            for side in 0..2 {
                bounds[side] *= f64::from(!turns[side]);
            }
        };
        let mut speeds = [0.0; 2];
        for (index, motion) in [motion1, motion2].into_iter().enumerate() {
            // What friction holds is at rest, not only nearly.
            let held = reactions[index].abs() < bounds[index];
            let speed = if held { 0.0 } else { after[index] / TAU };
            motion.acceleration = if held {
                0.0
            } else {
                (speed - motion.velocity) / dt
            };
            motion.position += 0.5 * (motion.velocity + speed) * dt;
            motion.velocity = speed;
            speeds[index] = speed * TAU;
        }
        let rate = self.turning.dot(&Vector2::from(speeds));
        self.skew += 0.5 * (self.turning.dot(&before) + rate) * dt;
        self.skew_rate = rate;
    }

    fn displaced(&mut self, shaft: usize, by: f64) {
        self.skew += self.turning[shaft] * by * TAU;
    }
}

/// [`reactions`] for matrices that are symmetric but for a little.
fn symmetric_reactions(
    mass: &Matrix2<f64>,
    inverse: &Matrix2<f64>,
    speeds: &Vector2<f64>,
    bounds: &Vector2<f64>,
) -> Vector2<f64> {
    if inverse.m12 == inverse.m21 {
        return reactions(mass, inverse, speeds, &-bounds, bounds);
    }
    let inverse = 0.5 * (inverse + inverse.transpose());
    let mass = 0.5 * (mass + mass.transpose());
    reactions(&mass, &inverse, speeds, &-bounds, bounds)
}

#[cfg(test)]
mod tests;
