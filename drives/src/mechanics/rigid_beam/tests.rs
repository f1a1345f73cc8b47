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
        outside: 0.0,
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
    let travel = motions[0].position * 0.02;
    assert_close(travel, 0.5 * acceleration * 0.01);
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

// ---- viscous friction ----

/// Of each side's shaft, N·m·s/rad.
fn with_friction(viscous: [f64; 2]) -> RigidBeam {
    let sides = viscous.map(|viscous_friction| {
        let mut side = side(0.02, 0.0);
        side.rigid.viscous_friction = viscous_friction;
        side
    });
    RigidBeam::new(BEAM, sides).unwrap()
}

fn turning(speeds: [f64; 2]) -> [Motion; 2] {
    speeds.map(|velocity| Motion {
        velocity,
        ..Motion::default()
    })
}

/// From a hundredth of what a machine file allows up to much more than the step of the grid can follow: both degrees of
/// freedom decay as `exp(−b t / m)`.
#[test]
fn a_dragged_beam_decays_as_the_exponential() {
    let rotors = 2.0 * ROTOR / (RADIUS * RADIUS);
    let mass = BEAM.mass + rotors;
    let inertia = BEAM.inertia + 0.25 * BEAM.span * BEAM.span * rotors;
    for force in [1e2, 1e4, 1e6, 1e7, 1e9] {
        // N·s/m of each side.
        let mut beam = with_friction([force * RADIUS * RADIUS; 2]);
        let mut motions = turning([3.0, 1.0]);
        let (along, around) = rates(&motions);
        for step in 1..=100 {
            beam.step(DT, &loads([0.0; 2]), &mut motions);
            let t = f64::from(step) * DT;
            let fades = libm::exp(-2.0 * force / mass * t);
            let turns = libm::exp(-0.5 * force * BEAM.span * BEAM.span / inertia * t);
            let now = rates(&motions);
            assert!(
                (now.0 - along * fades).abs() < 1e-11,
                "{force} N·s/m, {t} s: {now:?}"
            );
            assert!(
                (now.1 - around * turns).abs() < 1e-11,
                "{force} N·s/m, {t} s: {now:?}"
            );
        }
    }
}

/// Whatever the friction: in the end it carries the motors' torques.
#[test]
fn a_dragged_beam_comes_to_the_speed_of_its_torques() {
    for viscous in [[0.05, 0.02], [10.0, 1e-3], [1e4, 1e4], [0.0, 3.0]] {
        let mut beam = with_friction(viscous);
        let torques = [0.3 * f64::from(viscous[0] > 0.0), -0.2];
        let motions = run(&mut beam, torques, 400_000);
        for side in 0..2 {
            let carried = viscous[side] * motions[side].velocity * TAU;
            assert!(
                (carried - torques[side]).abs() < 1e-6,
                "{viscous:?} {motions:?}"
            );
        }
    }
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
            * (mass * along * along + inertia * around * around + CARRIAGE.mass * across * across);
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

/// What a machine file allows: mass and inertia of the beam, its rotors, friction, racking and a carriage.
fn any_beam() -> impl Strategy<Value = (RigidBeam, [f64; 2])> {
    let tens = |least: f64, most: f64| (least..=most).prop_map(libm::exp10);
    let some = |least, most| prop_oneof![Just(0.0), tens(least, most)];
    (
        (tens(-3.0, 6.0), tens(-6.0, 9.0), tens(-3.0, 3.0)),
        (
            tens(-4.0, 0.0),
            any::<[bool; 2]>(),
            [tens(-7.0, 1.0), tens(-7.0, 1.0)],
        ),
        [some(-6.0, 1.0), some(-6.0, 1.0)],
        [some(-6.0, 6.0), some(-3.0, 6.0)],
        [some(-3.0, 12.0), some(-3.0, 9.0)],
        prop::option::of((tens(-3.0, 6.0), -0.02..0.02, -2.0..2.0)),
        [-20.0..20.0, -20.0..20.0],
    )
        .prop_filter_map("beyond what can be counted with", |drawn| {
            let (beam, shafts, motor, guide, racking, carriage, speeds) = drawn;
            let (mass, inertia, span) = beam;
            let (pitch, turned, rotors) = shafts;
            let side = |side: usize| {
                let radius = pitch / TAU;
                Side {
                    travel: if turned[side] { -pitch } else { pitch },
                    rigid: Rigid {
                        motor_inertia: rotors[side],
                        viscous_friction: motor[side] + guide[1] * radius * radius,
                        coulomb_friction: guide[0] * radius,
                        ..Rigid::default()
                    },
                }
            };
            let beam = Beam {
                mass,
                inertia,
                span,
                racking: Racking {
                    stiffness: racking[0],
                    damping: racking[1],
                },
            };
            let mut beam = RigidBeam::new(beam, [side(0), side(1)])?;
            if let Some((mass, travel, middle)) = carriage {
                beam = beam.carrying(Carriage {
                    mass,
                    travel,
                    middle,
                });
            }
            Some((beam, speeds))
        })
}

proptest! {
    /// Over the whole range of a machine file: without a torque no beam has more energy than it had, but for what
    /// friction takes in a step. Where guides are stiffer than the grid can follow and Coulomb friction brings a side to rest
    /// that they would have turned round within the step, some comes of that, and it does not grow without end.
    #[test]
    fn no_beam_gains_energy((mut beam, speeds) in any_beam()) {
        let mut motions = [turning(speeds).as_slice(), &[Motion::default()]].concat();
        let energy = |beam: &RigidBeam, motions: &[Motion], drag: f64| {
            let speeds = Vector2::new(motions[0].velocity, motions[1].velocity) * TAU;
            let across = beam.carriage.map_or(0.0, |carriage| {
                let across = beam.carried(&carriage, &motions[2]).across;
                carriage.mass * across.dot(&speeds).powi(2)
            });
            let kinetic = 0.5 * (speeds.dot(&(beam.mass * speeds)) + across);
            let dragging = speeds.dot(&beam.viscous.component_mul(&speeds));
            kinetic + 0.5 * beam.racking.stiffness * beam.skew * beam.skew + drag * DT * dragging
        };
        let is_jerked = beam.sides[0].rigid.coulomb_friction > 0.0 && beam.racking != Racking::default();
        // A beam that is heavy to turn and hardly has a span is nearly singular at its shafts.
        let rounding = 1e-12 * beam.mass.trace().powi(2) / beam.mass.determinant();
        let more = rounding + if is_jerked { 10.0 } else { 1e-6 };
        let first = energy(&beam, &motions, 0.25);
        for _ in 0..400 {
            beam.step(DT, &loads([0.0; 2]), &mut motions);
            let now = energy(&beam, &motions, 0.0);
            prop_assert!(now <= first * (1.0 + more), "{now} J of {first} J: {beam:?}");
        }
    }

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
