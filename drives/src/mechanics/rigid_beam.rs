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

    /// What the guides and the carriage make of a step of `dt` seconds from these speeds.
    fn equation(&mut self, dt: f64, before: Vector2<f64>, carriage: Option<&Motion>) -> Equation {
        let Racking { stiffness, damping } = self.racking;
        let turning = self.turning;
        let rate = turning.dot(&before);
        let mut mass = self.mass;
        let mut push = Vector2::zeros();
        if stiffness != 0.0 || damping != 0.0 {
            let softness = 0.5 * dt * (damping + 0.5 * dt * stiffness);
            mass += turning * turning.transpose() * softness;
            let held = stiffness * (self.skew + 0.5 * dt * rate) + damping * rate;
            push -= turning * (held * dt);
        }
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
        Equation { mass, push }
    }
}

impl Mechanics for RigidBeam {
    /// `loads` are those of the two sides, in their order, `motions` too, and of the carriage's motor if
    /// there is one.
    fn step(&mut self, dt: f64, loads: &[Load], motions: &mut [Motion]) {
        let ([load1, load2], [motion1, motion2, others @ ..]) = (loads, motions) else {
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
        let Equation { mass, push } = self.equation(dt, before, others.first());
        let inverse = mass.try_inverse().unwrap_or_else(Matrix2::zeros);
        let free = before + inverse * torques * dt + inverse * push;
        let reactions = symmetric_reactions(&mass, &inverse, &free, &bounds);
        let after = free + inverse * reactions;
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
mod tests {
    use super::super::mode::Mode;
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
        racking: Racking {
            stiffness: 0.0,
            damping: 0.0,
        },
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
                    racking: Racking::default(),
                },
                sides,
            )
            .is_some()
        };
        assert!(light(40.0, 6.0, 1.25));
        assert!(!light(0.0, 0.0, 1.25) && !light(40.0, 0.0, 1.25) && !light(f64::NAN, 1.0, 1.0));
    }

    // ---- racking, and a carriage ----

    const RACKING: Racking = Racking {
        stiffness: 4e5,
        damping: 60.0,
    };
    const CARRIAGE: Carriage = Carriage {
        mass: 25.0,
        travel: 0.02,
        middle: 3.0,
    };

    fn held_square() -> RigidBeam {
        let racking = RACKING;
        RigidBeam::new(Beam { racking, ..BEAM }, [side(0.02, 0.0), side(0.02, 0.0)]).unwrap()
    }

    /// Both rotors as mass along the guides and as inertia about the beam's middle.
    fn rotors() -> (f64, f64) {
        let reduced = ROTOR / (RADIUS * RADIUS);
        (2.0 * reduced, 0.5 * BEAM.span * BEAM.span * reduced)
    }

    /// The carriage at `y` metres from the middle.
    fn carriage_at(y: f64, speed: f64) -> Motion {
        Motion {
            position: CARRIAGE.middle + y / CARRIAGE.travel,
            velocity: speed / CARRIAGE.travel,
            acceleration: 0.0,
        }
    }

    /// A torque of each motor: middle and angle are two oscillators that know nothing of each other.
    #[test]
    fn a_beam_moves_as_its_two_degrees_of_freedom() {
        let mut beam = held_square();
        let (mass, inertia) = rotors();
        let skewing = Mode {
            stiffness: RACKING.stiffness / (BEAM.inertia + inertia),
            decay: 0.5 * RACKING.damping / (BEAM.inertia + inertia),
        };
        let mut motions = [Motion::default(); 2];
        let torques = [0.7, 0.2];
        for step in 1..=3200 {
            beam.step(DT, &loads(torques), &mut motions);
            let t = f64::from(step) * DT;
            let force = (torques[0] + torques[1]) / RADIUS;
            let along = 0.5 * force / (BEAM.mass + mass) * t * t;
            let moment = 0.5 * BEAM.span * (torques[0] - torques[1]) / RADIUS;
            let skew = skewing
                .after(t)
                .apply(Vector2::zeros(), moment / (BEAM.inertia + inertia));
            let [one, two] = motions.map(|it| it.position * TAU * RADIUS);
            assert!((0.5 * (one + two) / along - 1.0).abs() < 1e-9);
            let rest = moment / RACKING.stiffness;
            assert!((beam.skew() - skew.x).abs() < 1e-3 * rest, "{t} s");
            assert!(((one - two) / BEAM.span - beam.skew()).abs() < 1e-12);
        }
        let moment = 0.5 * BEAM.span * 0.5 / RADIUS;
        let settled = (0..200_000).map(|_| {
            beam.step(DT, &loads(torques), &mut motions);
            beam.racking.stiffness * beam.skew + beam.racking.damping * beam.skew_rate
        });
        assert_close(settled.last().unwrap(), moment);
    }

    /// A carriage that stands beside the middle ties both degrees of freedom together: their one
    /// vibration has the frequency of the closed form.
    #[test]
    fn a_carriage_off_the_middle_shifts_the_resonance() {
        for y in [-0.5, 0.0, 0.3] {
            let mut beam = RigidBeam {
                racking: Racking {
                    damping: 0.0,
                    ..RACKING
                },
                ..held_square().carrying(CARRIAGE)
            };
            let mut motions = [Motion::default(), Motion::default(), carriage_at(y, 0.0)];
            motions[0].velocity = 1.0;
            motions[1].velocity = -1.0;
            let (mut crossings, mut last) = (Vec::new(), 0.0);
            for step in 0..16_000 {
                beam.step(DT, &loads([0.0; 2]), &mut motions);
                let skew = beam.skew();
                if last < 0.0 && skew >= 0.0 {
                    crossings.push((f64::from(step) - skew / (skew - last)) * DT);
                }
                last = skew;
            }
            let periods = (crossings.len() - 1) as f64;
            let found = periods * TAU / (crossings[crossings.len() - 1] - crossings[0]);
            let (mass, inertia) = rotors();
            let mass = BEAM.mass + mass + CARRIAGE.mass;
            let inertia = BEAM.inertia + inertia + CARRIAGE.mass * y * y;
            let lever = CARRIAGE.mass * y;
            let expected = (RACKING.stiffness * mass / (mass * inertia - lever * lever)).sqrt();
            assert!((found / expected - 1.0).abs() < 1e-4, "{found} {expected}");
        }
    }

    /// A free beam that turns while its carriage runs along it: momentum, angular momentum and,
    /// with the work of what moves the carriage, energy are kept.
    #[test]
    fn a_free_beam_with_a_moving_carriage_keeps_momentum_and_energy() {
        let mut beam = smooth().carrying(CARRIAGE);
        let speed = 0.8;
        let mut y = -0.4;
        let mut motions = [Motion::default(), Motion::default(), carriage_at(y, speed)];
        motions[0].velocity = 0.3;
        motions[1].velocity = 0.1;
        let (mass, inertia) = rotors();
        let (mass, inertia) = (BEAM.mass + mass, BEAM.inertia + inertia);
        // Of the carriage across the beam, where it is and how fast.
        let state = |motions: &[Motion; 3], y: f64| {
            let (along, around) = rates(&[motions[0], motions[1]]);
            let at = [motions[0], motions[1]].map(|it| it.position * TAU * RADIUS);
            let (x, skew) = (0.5 * (at[0] + at[1]), (at[0] - at[1]) / BEAM.span);
            let across = along + y * around + speed * skew;
            let momentum = mass * along + CARRIAGE.mass * across;
            let position = x + y * skew;
            let angular = inertia * around + CARRIAGE.mass * (y * across - position * speed);
            let energy = 0.5
                * (mass * along * along
                    + inertia * around * around
                    + CARRIAGE.mass * across * across);
            ([momentum, angular, energy], skew, across)
        };
        // The first step finds out where the carriage is.
        beam.step(DT, &loads([0.0; 2]), &mut motions);
        let (kept, mut skew, mut across) = state(&motions, y);
        let (mut work, mut most_turned) = (0.0, 0.0_f64);
        for _ in 0..12_800 {
            y += speed * DT;
            motions[2] = carriage_at(y, speed);
            beam.step(DT, &loads([0.0; 2]), &mut motions);
            let (now, skew_now, across_now) = state(&motions, y);
            work += CARRIAGE.mass * 0.5 * (skew + skew_now) * (across_now - across) * speed;
            (skew, across) = (skew_now, across_now);
            most_turned = most_turned.max((rates(&[motions[0], motions[1]]).1).abs());
            assert!((now[0] / kept[0] - 1.0).abs() < 1e-9, "momentum");
            assert!((now[1] / kept[1] - 1.0).abs() < 1e-6, "angular momentum");
            assert!(((now[2] - work) / kept[2] - 1.0).abs() < 1e-6, "energy");
        }
        let (_, around) = rates(&[motions[0], motions[1]]);
        assert!(around.abs() < 0.95 * most_turned, "the carriage mattered");
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
            let inverse = beam.mass.try_inverse().unwrap();
            let speeds = Vector2::new(speeds.0, speeds.1);
            let bounds = Vector2::new(bounds.0, bounds.1);
            let reactions = reactions(&beam.mass, &inverse, &speeds, &-bounds, &bounds);
            let after = speeds + inverse * reactions;
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
