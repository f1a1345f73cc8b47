use super::super::rigid::Rigid;
use super::*;
use proptest::prelude::*;

const DT: f64 = 62.5e-6;

/// A rotor and a load of these inertias on a spring; no friction.
fn two_masses(rotor: f64, load: f64, stiffness: f64, damping: f64) -> DriveTrain {
    DriveTrain {
        rotor_inertia: rotor,
        load_inertia: load,
        elasticity: Some(Elasticity {
            stiffness,
            damping,
            play: 0.0,
        }),
        bearing: Friction::default(),
        ..DriveTrain::default()
    }
}

/// The default rotor and load, resonating at 64.6 Hz and, from the motor, at 137.7 Hz.
fn elastic() -> DriveTrain {
    two_masses(1.1e-4, 4.0e-4, 66.0, 0.0)
}

fn with_play(train: DriveTrain, play: f64) -> DriveTrain {
    let elasticity = train.elasticity.map(|it| Elasticity { play, ..it });
    DriveTrain {
        elasticity,
        ..train
    }
}

/// An axis in motion with its shaft.
struct Running {
    axis: FeedAxis,
    shaft: [Motion; 1],
    blocked: bool,
    brake_open: bool,
}

impl Running {
    fn new(train: DriveTrain) -> Self {
        Self {
            axis: FeedAxis::new(train),
            shaft: [Motion::default()],
            blocked: false,
            brake_open: true,
        }
    }

    fn step(&mut self, dt: f64, torque: f64) {
        let load = Load {
            torque,
            outside: 0.0,
            brake_open: self.brake_open,
            blocked: self.blocked,
        };
        self.axis.step(dt, &[load], &mut self.shaft);
    }

    fn run(&mut self, steps: usize, torque: f64) {
        for _ in 0..steps {
            self.step(DT, torque);
        }
    }

    /// Rad.
    fn rotor(&self) -> f64 {
        self.shaft[0].position * TAU
    }

    fn energy(&self) -> f64 {
        let (train, speeds) = (&self.axis.train, self.axis.speeds);
        let kinetic = 0.5
            * (train.rotor_inertia * speeds.x * speeds.x
                + train.load_inertia * speeds.y * speeds.y);
        let elasticity = train.elasticity.expect("an elastic axis");
        let wound = (self.axis.twist.abs() - 0.5 * elasticity.play).max(0.0);
        kinetic + 0.5 * elasticity.stiffness * wound * wound
    }
}

fn assert_close(found: f64, expected: f64, share: f64) {
    let error = (found / expected - 1.0).abs();
    assert!(error < share, "{found}, expected {expected}");
}

#[test]
fn a_stiff_axis_runs_up_against_viscous_friction_as_the_exponential() {
    let mut stiff = Running::new(DriveTrain {
        bearing: Friction {
            viscous: 0.03,
            ..Friction::coulomb(0.1)
        },
        ..DriveTrain::default()
    });
    stiff.run(800, 1.0);
    let time_constant = 5.1e-4 / 0.03;
    let (t, end) = (800.0 * DT, 0.9 / 0.03);
    let grown = 1.0 - libm::exp(-t / time_constant);
    assert_close(stiff.shaft[0].velocity * TAU, end * grown, 1e-9);
    assert_close(stiff.rotor(), end * (t - time_constant * grown), 1e-9);
}

/// With the default rigid axis' figures, the same motion as that one's.
#[test]
fn a_stiff_axis_agrees_with_the_rigid_one() {
    let mut stiff = Running::new(DriveTrain::default());
    let mut rigid = (Rigid::default(), [Motion::default()]);
    for k in 0..16_000 {
        let torque = libm::sin(TAU * 3.0 * f64::from(k) * DT);
        stiff.step(DT, torque);
        let load = Load {
            torque,
            outside: 0.0,
            brake_open: true,
            blocked: false,
        };
        rigid.0.step(DT, &[load], &mut rigid.1);
        let error = stiff.shaft[0].position - rigid.1[0].position;
        assert!(error.abs() < 2e-3, "step {k}: {error} revolutions");
    }
}

/// Amplitude of the rotor's speed for a torque that swings with 1 N·m at that frequency.
fn response(train: &DriveTrain, frequency: f64) -> f64 {
    let mut running = Running::new(train.clone());
    let (settle, measure) = (24_000, 32_000);
    let (mut sine, mut cosine) = (0.0, 0.0);
    for k in 0..settle + measure {
        let phase = TAU * frequency * f64::from(k) * DT;
        running.step(DT, libm::sin(phase));
        if k >= settle {
            // Hann's window leaves the slow swing out that the start has left.
            let window = 1.0 - libm::cos(TAU * f64::from(k - settle) / f64::from(measure));
            let phase = phase + TAU * frequency * DT;
            sine += window * running.axis.speeds.x * libm::sin(phase);
            cosine += window * running.axis.speeds.x * libm::cos(phase);
        }
    }
    libm::hypot(sine, cosine)
}

#[test]
fn resonance_and_antiresonance_are_those_of_the_closed_form() {
    let train = two_masses(1.1e-4, 4.0e-4, 66.0, 0.004);
    let (antiresonance, resonance) = train.resonances().unwrap();
    assert_close(antiresonance, (66.0_f64 / 4.0e-4).sqrt() / TAU, 1e-12);
    let extreme = |around: f64, sign: f64| {
        let tried = (-20..=20).map(|k| around * (1.0 + 1e-3 * f64::from(k)));
        let found = tried.map(|it| (sign * response(&train, it), it));
        found
            .max_by(|one, other| one.0.total_cmp(&other.0))
            .unwrap()
            .1
    };
    assert_close(extreme(resonance, 1.0), resonance, 5e-3);
    assert_close(extreme(antiresonance, -1.0), antiresonance, 5e-3);
}

#[test]
fn a_vibration_dies_away_as_its_damping_says() {
    let mut running = Running::new(two_masses(1.1e-4, 4.0e-4, 66.0, 0.002));
    running.axis.twist = 0.01;
    let reduced = 1.1e-4 * 4.0e-4 / 5.1e-4;
    let begin = running.energy();
    running.run(1600, 0.0);
    // Averaged over a period the energy falls with twice the amplitude's decay, d / 2Jᵣ.
    let expected = begin * libm::exp(-0.002 / reduced * 0.1);
    assert_close(running.energy(), expected, 0.02);
}

/// Twist, while the rotor turns with a constant speed and the load sticks and slips on its guide.
fn stick_slip(guide: Friction, damping: f64, speed: f64, seconds: f64) -> Running {
    let mut train = two_masses(1e6, 4.0e-4, 66.0, damping);
    train.guide = guide;
    let mut running = Running::new(train);
    running.axis.speeds = Vector2::new(speed, speed);
    running.axis.twist = guide.level(speed) / 66.0;
    // A small push, to see whether it grows.
    running.axis.speeds.y *= 1.01;
    running.run((seconds / DT) as usize, 0.0);
    running
}

/// Slow: the spring winds until the load breaks away, and is left unwound by as much.
#[test]
fn a_sticking_load_breaks_away_and_slips_as_far_as_the_friction_falls() {
    let guide = Friction {
        coulomb: 0.1,
        breakaway: 0.2,
        stribeck_speed: 1e-3,
        viscous: 0.0,
    };
    let mut running = stick_slip(guide, 0.0, 0.02, 0.5);
    let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
    for _ in 0..16_000 {
        running.step(DT, 0.0);
        least = least.min(running.axis.twist);
        most = most.max(running.axis.twist);
    }
    // It slips until 2 Fc − Fs is left; what the rotor moves meanwhile is below 0.1 %.
    assert_close(most, 0.2 / 66.0, 5e-3);
    assert!(least.abs() < 0.01 * most, "{least} of {most}");
}

/// Sliding is steady where the damping outweighs the fall of the friction with speed.
#[test]
fn stick_slip_begins_where_friction_falls_faster_than_damping_grows() {
    let guide = Friction {
        coulomb: 0.1,
        breakaway: 0.15,
        stribeck_speed: 2.0,
        viscous: 0.0,
    };
    let speed = 3.0;
    let share = speed / guide.stribeck_speed;
    let falling = (guide.breakaway - guide.coulomb) * 2.0 * speed
        / (guide.stribeck_speed * guide.stribeck_speed * (1.0 + share * share).powi(2));
    let swing = |damping: f64| {
        let mut running = stick_slip(guide, damping, speed, 6.0);
        let speeds = (0..800).map(|_| {
            running.step(DT, 0.0);
            (running.axis.speeds.y - speed).abs()
        });
        speeds.fold(0.0, f64::max)
    };
    // The push is 0.03 rad/s; in 6 s it has grown or died away by much more than half.
    assert!(swing(1.05 * falling) < 0.02);
    assert!(swing(0.95 * falling) > 0.06);
}

#[test]
fn what_is_held_is_still_without_chatter_or_creep() {
    let mut train = elastic();
    train.guide = Friction::coulomb(0.2);
    train.bearing = Friction::coulomb(0.05);
    train.load_torque = -0.15;
    let mut running = Running::new(train);
    running.run(4_000, 0.0);
    running.run(160, 0.6);
    running.run(16_000, 0.02);
    let rest = running.shaft[0];
    assert!(rest.position.abs() > 1e-3 && rest.velocity == 0.0);
    assert_eq!(running.axis.speeds.y, 0.0);
    running.run(160_000, 0.02);
    assert_eq!(running.shaft[0].position, rest.position);
}

/// Pushed to and fro slowly, the load lags by the play and by what friction winds the spring.
#[test]
fn a_reversal_loses_play_and_windup() {
    let mut train = with_play(elastic(), 2e-3);
    train.guide = Friction::coulomb(0.1);
    train.bearing.viscous = 0.3;
    let mut running = Running::new(train);
    let ends = [1.0, -1.0].map(|direction| {
        running.run(16_000, 0.3 * direction);
        running.axis.twist
    });
    assert_close(ends[0] - ends[1], 2e-3 + 2.0 * 0.1 / 66.0, 1e-3);
}

#[test]
fn the_rotor_crosses_its_play_freely() {
    let mut running = Running::new(with_play(elastic(), 4e-3));
    // 2 mrad to the flank at 1 N·m on 1.1e-4 kg·m²: 663 µs.
    let until = (2.0 * 2e-3 * 1.1e-4_f64).sqrt();
    let steps = (until / DT) as usize;
    running.run(steps, 1.0);
    assert!(running.axis.load_speed().abs() < 1e-12);
    let t = steps as f64 * DT;
    assert_close(running.rotor(), 0.5 * t * t / 1.1e-4, 1e-9);
    running.run(2, 1.0);
    assert!(running.axis.load_speed() > 1e-3);
}

#[test]
fn gravity_hangs_on_the_brake_while_it_takes_its_time() {
    let mut train = elastic();
    train.load_torque = -0.3;
    train.brake = Brake {
        torque: 3.0,
        opening: 0.03,
        closing: 0.01,
    };
    let mut running = Running::new(train);
    running.run(479, 0.0);
    assert_eq!(running.rotor(), 0.0);
    assert_close(running.axis.twist, 0.3 / 66.0, 1e-9);
    running.run(160, 0.0);
    let falling = running.axis.speeds.x;
    assert!(falling < -1.0);
    running.brake_open = false;
    running.run(150, 0.0);
    assert!(running.axis.speeds.x < falling);
    running.run(1_600, 0.0);
    assert_eq!(running.axis.speeds.x, 0.0);
}

#[test]
fn a_load_stops_at_its_end_stop_and_winds_the_rotor() {
    let mut train = elastic();
    train.stops = Some((-1.0, 2.0));
    train.elasticity = train.elasticity.map(|it| Elasticity {
        damping: 0.02,
        ..it
    });
    let mut running = Running::new(train.clone());
    running.run(16_000, 0.5);
    let load = running.rotor() - running.axis.twist;
    assert!((load - 2.0).abs() < 3e-3, "{load} rad");
    assert_eq!(running.axis.load_speed(), 0.0);
    assert_close(running.axis.twist, 0.5 / 66.0, 1e-6);
    running.run(16_000, -0.5);
    let load = running.rotor() - running.axis.twist;
    assert!((load + 1.0).abs() < 3e-3, "{load} rad");

    train.elasticity = None;
    let mut stiff = Running::new(train);
    stiff.run(16_000, 0.5);
    assert!((stiff.rotor() - 2.0).abs() < 3e-3);
}

#[test]
fn a_blocked_rotor_lets_the_load_swing_at_the_antiresonance() {
    let mut running = Running::new(elastic());
    running.blocked = true;
    running.axis.twist = 0.01;
    let (mut crossings, mut last) = (Vec::new(), 0.01);
    for k in 0..16_000 {
        running.step(DT, 0.7);
        assert_eq!(running.shaft[0].position, 0.0);
        let twist = running.axis.twist;
        if (twist < 0.0) != (last < 0.0) {
            crossings.push((f64::from(k) + last / (last - twist)) * DT);
        }
        last = twist;
    }
    let half_periods = (crossings.len() - 1) as f64;
    let period = 2.0 * (crossings[crossings.len() - 1] - crossings[0]) / half_periods;
    assert_close(1.0 / period, elastic().resonances().unwrap().0, 1e-3);
}

/// Everything at once: friction of every kind, play, gravity, an elastic screw.
fn everything() -> DriveTrain {
    let mut train = with_play(two_masses(1.1e-4, 4.0e-4, 66.0, 0.01), 1e-3);
    train.bearing = Friction {
        coulomb: 0.02,
        breakaway: 0.03,
        stribeck_speed: 3.0,
        viscous: 5e-4,
    };
    train.guide = Friction {
        coulomb: 0.05,
        breakaway: 0.08,
        stribeck_speed: 5.0,
        viscous: 1e-3,
    };
    train.load_torque = -0.05;
    train
}

/// Rotor and load, rad, at every millisecond of half a second, with steps of `1 ms / parts`.
fn trajectory(train: &DriveTrain, parts: u32) -> Vec<[f64; 2]> {
    let mut running = Running::new(train.clone());
    let dt = 1e-3 / f64::from(parts);
    let at = |k: u32| {
        // The torque of each quarter of a millisecond is the same whatever the step.
        let torque = 0.6 * libm::sin(TAU * 5.0 * (f64::from(k) + 0.5) * 0.25e-3);
        for _ in 0..parts / 4 {
            running.step(dt, torque);
        }
        [running.rotor(), running.rotor() - running.axis.twist]
    };
    (0..2000).map(at).collect()
}

#[test]
fn the_step_s_length_does_not_matter() {
    let train = everything();
    let finest = trajectory(&train, 1024);
    let travel = finest
        .iter()
        .fold(0.0_f64, |most, at| most.max(at[1].abs()));
    assert!(travel > 1.0, "{travel} rad");
    let error = |parts: u32| {
        let found = trajectory(&train, parts);
        let errors = found.iter().zip(&finest);
        let errors =
            errors.map(|(one, other)| (one[0] - other[0]).abs().max((one[1] - other[1]).abs()));
        errors.fold(0.0, f64::max) / travel
    };
    let errors = [8, 16, 32, 64].map(error);
    // At the drives' own step, the second; and four times as good with each half of it.
    assert!(errors[1] < 1e-6, "{errors:?}");
    assert!(errors[3] < errors[1] / 16.0, "{errors:?}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// Without friction: what the motor puts in is what moves and swings, with play and without.
    #[test]
    fn energy_is_what_the_motor_put_in(
        rotor in 1e-5..1e-2,
        ratio in 0.1..10.0,
        frequency in 5.0..800.0,
        play in prop_oneof![Just(0.0), 1e-5..1e-2],
        torques in prop::collection::vec(-1.0..1.0, 1..60),
        load_torque in -0.5..0.5,
    ) {
        let load = rotor * ratio;
        let reduced = rotor * load / (rotor + load);
        let stiffness = reduced * (TAU * frequency) * (TAU * frequency);
        let mut train = with_play(two_masses(rotor, load, stiffness, 0.0), play);
        train.load_torque = load_torque * rotor * 1e3;
        let mut running = Running::new(train);
        let begin = running.energy();
        let (mut work, mut size, mut impulse) = (0.0, begin, 0.0);
        for torque in torques {
            let torque = torque * rotor * 1e4;
            for _ in 0..16 {
                let (rotor_before, twist_before) = (running.rotor(), running.axis.twist);
                running.step(DT, torque);
                let turned = running.rotor() - rotor_before;
                let load_turned = turned - (running.axis.twist - twist_before);
                let load_torque = running.axis.train.load_torque;
                work += torque * turned + load_torque * load_turned;
                size += (torque * turned).abs() + (load_torque * load_turned).abs();
                impulse += (torque + load_torque) * DT;
            }
        }
        let balance = running.energy() - begin - work;
        prop_assert!(balance.abs() <= 1e-6 * size, "{balance} J of {size} J");
        let speeds = running.axis.speeds;
        let momentum = rotor * speeds.x + load * speeds.y;
        prop_assert!((momentum - impulse).abs() <= 1e-9 * (1.0 + impulse.abs()));
    }

    /// Friction takes energy, whatever it is like, and ends at rest.
    #[test]
    fn friction_only_takes_energy(
        coulomb in 0.01..0.2,
        more in 0.0..0.2,
        stribeck_speed in 0.1..20.0,
        speeds in (-50.0..50.0, -50.0..50.0),
        play in prop_oneof![Just(0.0), 1e-5..1e-2],
    ) {
        let mut train = with_play(elastic(), play);
        train.bearing = Friction::coulomb(0.02);
        train.guide = Friction { coulomb, breakaway: coulomb + more, stribeck_speed, viscous: 0.0 };
        let mut running = Running::new(train);
        running.axis.speeds = Vector2::new(speeds.0, speeds.1);
        let mut last = running.energy();
        // A reaction is constant in its step: what it holds may swing a little meanwhile.
        let rounding = (coulomb + more) * (coulomb + more) * DT * DT / 1.1e-4;
        for _ in 0..48_000 {
            running.step(DT, 0.0);
            let now = running.energy();
            prop_assert!(now <= last + rounding, "{now} J after {last} J");
            last = now;
        }
        prop_assert_eq!(running.axis.speeds, Vector2::zeros());
    }
}

/// What pushes at the load winds the spring, and the motor has to hold it.
#[test]
fn a_force_from_outside_winds_the_spring() {
    let spring = Elasticity::damped(400.0, 0.1, [3e-4, 5e-4]);
    let train = DriveTrain {
        rotor_inertia: 3e-4,
        load_inertia: 5e-4,
        elasticity: Some(spring),
        bearing: Friction::default(),
        ..DriveTrain::default()
    };
    let mut axis = FeedAxis::new(train);
    let mut shaft = [Motion::default()];
    for _ in 0..16_000 {
        let load = Load {
            torque: 0.7,
            outside: -0.7,
            brake_open: true,
            ..Load::default()
        };
        axis.step(DT, &[load], &mut shaft);
    }
    assert!(
        (axis.twist() - 0.7 / 400.0).abs() < 1e-9,
        "{}",
        axis.twist()
    );
}
