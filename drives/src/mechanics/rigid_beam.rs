//! A rigid beam on two guides, each side moved by a motor of its own: a gantry.
//!
//! The beam has two degrees of freedom, its centre `x` and its angle `θ` (small), so that the sides
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
//! Friction, brakes and blocks are [`reactions`], impulses against each shaft.

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
    mass: Matrix2<f64>,
    inverse_mass: Matrix2<f64>,
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
        Some(Self {
            inverse_mass: mass.try_inverse().filter(|_| definite)?,
            mass,
            sides,
        })
    }
}

impl Mechanics for RigidBeam {
    /// `loads` and `motions` are those of the two sides, in their order.
    fn step(&mut self, dt: f64, loads: &[Load], motions: &mut [Motion]) {
        let ([load1, load2], [motion1, motion2]) = (loads, motions) else {
            return;
        };
        let before = Vector2::new(motion1.velocity, motion2.velocity) * TAU;
        let torque = |load: &Load, side: &Side, speed: f64| {
            load.torque + side.rigid.load_torque - side.rigid.viscous_friction * speed
        };
        let torques = Vector2::new(
            torque(load1, &self.sides[0], before.x),
            torque(load2, &self.sides[1], before.y),
        );
        let bound = |load: &Load, side: &Side| match load.blocked {
            true => f64::INFINITY,
            false => side.rigid.grip(load.brake_open) * dt,
        };
        let bounds = Vector2::new(bound(load1, &self.sides[0]), bound(load2, &self.sides[1]));
        let free = before + self.inverse_mass * torques * dt;
        let reactions = reactions(&self.mass, &self.inverse_mass, &free, &-bounds, &bounds);
        let after = free + self.inverse_mass * reactions;
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
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const DT: f64 = 62.5e-6;
    /// A radian of either shaft moves its side so many metres.
    const RADIUS: f64 = 0.02 / TAU;
    const ROTOR: f64 = 1.1e-4;

    const BEAM: Beam = Beam {
        mass: 40.0,
        inertia: 6.0,
        span: 1.25,
    };

    fn side(travel: f64, coulomb_friction: f64) -> Side {
        Side {
            travel,
            rigid: Rigid {
                motor_inertia: ROTOR,
                viscous_friction: 0.0,
                coulomb_friction,
                ..Rigid::default()
            },
        }
    }

    fn smooth() -> RigidBeam {
        RigidBeam::new(BEAM, [side(0.02, 0.0), side(0.02, 0.0)]).unwrap()
    }

    fn loads(torques: [f64; 2]) -> [Load; 2] {
        torques.map(|torque| Load {
            torque,
            brake_open: true,
            blocked: false,
        })
    }

    fn run(beam: &mut RigidBeam, torques: [f64; 2], steps: usize) -> [Motion; 2] {
        let mut motions = [Motion::default(); 2];
        for _ in 0..steps {
            beam.step(DT, &loads(torques), &mut motions);
        }
        motions
    }

    fn assert_close(value: f64, expected: f64) {
        assert!(
            (value / expected - 1.0).abs() < 1e-9,
            "{value}, not {expected}"
        );
    }

    /// Speeds of the centre, m/s, and of the rotation, rad/s.
    fn rates(motions: &[Motion; 2]) -> (f64, f64) {
        let [one, two] = motions.map(|motion| motion.velocity * TAU * RADIUS);
        (0.5 * (one + two), (one - two) / BEAM.span)
    }

    fn energy(motions: &[Motion; 2]) -> f64 {
        let (along, around) = rates(motions);
        let rotors = motions.map(|motion| ROTOR * (motion.velocity * TAU).powi(2));
        let sum = BEAM.mass * along * along + BEAM.inertia * around * around;
        0.5 * (sum + rotors[0] + rotors[1])
    }

    #[test]
    fn equal_torques_move_the_whole_mass_and_turn_nothing() {
        let motions = run(&mut smooth(), [0.5, 0.5], 1600);
        let mass = BEAM.mass + 2.0 * ROTOR / (RADIUS * RADIUS);
        let acceleration = 2.0 * 0.5 / RADIUS / mass;
        let (along, around) = rates(&motions);
        assert_close(along, acceleration * 0.1);
        assert!(around.abs() < 1e-12, "{around}");
        let way = motions[0].position * 0.02;
        assert_close(way, 0.5 * acceleration * 0.01);
    }

    #[test]
    fn opposite_torques_turn_the_beam_about_its_centre() {
        let motions = run(&mut smooth(), [0.5, -0.5], 1600);
        let rotors = 0.5 * BEAM.span * BEAM.span * ROTOR / (RADIUS * RADIUS);
        let acceleration = BEAM.span * 0.5 / RADIUS / (BEAM.inertia + rotors);
        let (along, around) = rates(&motions);
        assert!(along.abs() < 1e-12, "{along}");
        assert_close(around, acceleration * 0.1);
    }

    /// The mirrored motor of a gantry: it turns the other way for the same motion.
    #[test]
    fn a_mirrored_motor_moves_the_same_beam() {
        let sides = [side(0.02, 0.0), side(-0.02, 0.0)];
        let mut mirrored = RigidBeam::new(BEAM, sides).unwrap();
        let [one, two] = run(&mut mirrored, [0.5, -0.5], 1600);
        let [same, _] = run(&mut smooth(), [0.5, 0.5], 1600);
        assert_close(one.velocity, same.velocity);
        assert_close(two.velocity, -same.velocity);
    }

    #[test]
    fn a_motor_without_torque_feels_the_other() {
        let [driven, dragged] = run(&mut smooth(), [0.5, 0.0], 1600);
        // m/4 > J/span²: pushed at one end, a free beam swings back at the other.
        let mass = &smooth().mass;
        assert_close(dragged.velocity / driven.velocity, -mass.m12 / mass.m22);
    }

    #[test]
    fn friction_holds_what_it_can_and_stops_what_coasts() {
        let sides = [side(0.02, 0.08), side(0.02, 0.08)];
        let mut beam = RigidBeam::new(BEAM, sides).unwrap();
        let held = run(&mut beam, [0.07, -0.07], 100);
        assert!(
            held.iter()
                .all(|it| it.velocity == 0.0 && it.position == 0.0)
        );
        let mut motions = run(&mut beam, [0.5, 0.4], 400);
        assert!(motions.iter().all(|it| it.velocity != 0.0));
        let mut last = energy(&motions);
        for _ in 0..16_000 {
            beam.step(DT, &loads([0.0; 2]), &mut motions);
            let now = energy(&motions);
            assert!(now <= last, "friction gives nothing");
            last = now;
        }
        assert_eq!(motions.map(|it| it.velocity), [0.0; 2]);
    }

    #[test]
    fn a_blocked_side_stays_and_the_other_turns_about_it() {
        let mut loads = loads([0.0, 0.5]);
        loads[0].blocked = true;
        let mut motions = [Motion::default(); 2];
        for _ in 0..1600 {
            smooth().step(DT, &loads, &mut motions);
        }
        assert_eq!((motions[0].position, motions[0].velocity), (0.0, 0.0));
        // About that side: J + m (span/2)², and one rotor.
        let about = BEAM.inertia + 0.25 * BEAM.mass * BEAM.span * BEAM.span;
        let about = about + BEAM.span * BEAM.span * ROTOR / (RADIUS * RADIUS);
        let acceleration = -BEAM.span * 0.5 / RADIUS / about;
        let (_, around) = rates(&motions);
        assert_close(around, acceleration * 0.1);
    }

    #[test]
    fn what_has_no_mass_is_no_beam() {
        let sides = || [side(0.02, 0.0), side(0.02, 0.0)];
        let light = |mass, inertia, span| {
            let mut sides = sides();
            sides[0].rigid.motor_inertia = 0.0;
            sides[1].rigid.motor_inertia = 0.0;
            RigidBeam::new(
                Beam {
                    mass,
                    inertia,
                    span,
                },
                sides,
            )
            .is_some()
        };
        assert!(light(40.0, 6.0, 1.25));
        assert!(!light(0.0, 0.0, 1.25) && !light(40.0, 0.0, 1.25) && !light(f64::NAN, 1.0, 1.0));
    }

    proptest! {
        /// Without friction: what the torques put in is what moves, and a free beam keeps its
        /// momenta and its energy.
        #[test]
        fn momentum_and_energy_are_conserved(
            torques in prop::collection::vec((-1.4..1.4, -1.4..1.4), 1..40),
            coasting in 1..400_usize,
        ) {
            let mut beam = smooth();
            let mut motions = [Motion::default(); 2];
            let mut put_in = [0.0; 2];
            let mut work = 0.0;
            for (one, two) in torques {
                let before = motions;
                beam.step(DT, &loads([one, two]), &mut motions);
                put_in[0] += (one + two) / RADIUS * DT;
                put_in[1] += 0.5 * BEAM.span * (one - two) / RADIUS * DT;
                for (index, torque) in [one, two].into_iter().enumerate() {
                    work += torque * (motions[index].position - before[index].position) * TAU;
                }
            }
            let reduced = ROTOR / (RADIUS * RADIUS);
            let momenta = |motions: &[Motion; 2]| {
                let (along, around) = rates(motions);
                let rotors = 0.5 * BEAM.span * BEAM.span * reduced;
                [(BEAM.mass + 2.0 * reduced) * along, (BEAM.inertia + rotors) * around]
            };
            for (now, put_in) in momenta(&motions).into_iter().zip(put_in) {
                prop_assert!((now - put_in).abs() < 1e-9, "{now}, put in {put_in}");
            }
            prop_assert!((energy(&motions) - work).abs() < 1e-9 * (1.0 + work));
            let (kept, moved) = (energy(&motions), momenta(&motions));
            for _ in 0..coasting {
                beam.step(DT, &loads([0.0; 2]), &mut motions);
            }
            prop_assert!((energy(&motions) - kept).abs() <= 1e-12 * (1.0 + kept));
            for (now, then) in momenta(&motions).into_iter().zip(moved) {
                prop_assert!((now - then).abs() < 1e-12 * (1.0 + then.abs()));
            }
        }

        /// What friction does is right whatever comes: it is within its bounds, it brings a side to
        /// rest or acts against it with all it has, and it takes energy.
        #[test]
        fn friction_is_complementary(
            speeds in (-50.0..50.0, -50.0..50.0),
            bounds in (0.0..0.02, 0.0..0.02),
        ) {
            let beam = smooth();
            let speeds = Vector2::new(speeds.0, speeds.1);
            let bounds = Vector2::new(bounds.0, bounds.1);
            let reactions = reactions(&beam.mass, &beam.inverse_mass, &speeds, &-bounds, &bounds);
            let after = speeds + beam.inverse_mass * reactions;
            for side in 0..2 {
                let (reaction, bound, speed) = (reactions[side], bounds[side], after[side]);
                prop_assert!(reaction.abs() <= bound);
                let at_rest = speed.abs() < 1e-9;
                let against = reaction == -bound.copysign(speed);
                prop_assert!(at_rest || against, "{reaction} of {bound} against {speed}");
            }
        }
    }
}
