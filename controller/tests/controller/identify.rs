//! Identification without a machine: the excitation's bounds, logs, and what is made of synthetic ones.

use proptest::prelude::*;
use std::f64::consts::TAU;
use std::path::Path;
use syncline_controller::budget::MachineBudget;
use syncline_controller::identify::estimate::{
    Estimate, Figure, NotEstimated, Shaft, Swing, estimate,
};
use syncline_controller::identify::excitation::{Bounds, program};
use syncline_controller::identify::log::{Beside, Log};
use syncline_controller::identify::response::response;
use syncline_controller::identify::{AxisSample, Subject, ToldTorque, Unfit};
use syncline_controller::machine::Machine;
use syncline_controller::program::Programs;
use syncline_gcode::Tables;

/// A machine of one axis with these limits: velocity, acceleration, jerk, and half of its travel.
fn machine(name: &str, [velocity, acceleration, jerk, travel]: [f64; 4]) -> Machine {
    let text = format!(
        "[machine]\nname = \"one\"\ncycle_us = 2000\n[[bus]]\nname = \"main\"\nbitrate = 1_000_000\n\
         [[drive]]\nname = \"D\"\nbus = \"main\"\nnode = 1\nmodel = \"lxm32m\"\nzero = 0\n\
         [[axis]]\nname = \"{name}\"\ndrives = [\"D\"]\npitch = 10.0\ngear = 1.0\nmax_velocity = {velocity:e}\n\
         max_acceleration = {acceleration:e}\nmax_jerk = {jerk:e}\nsoft_limits = [-{travel:e}, {travel:e}]\n\
         following_error_limit = 10.0\n[axis.simulation]\nmotor = \"generic-3\"\n"
    );
    Machine::parse(Path::new("one.toml"), &text).unwrap_or_else(|error| panic!("{error}"))
}

/// Numbers as machines have them, of each order of magnitude as often.
fn limits() -> impl Strategy<Value = [f64; 4]> {
    let power = |range: std::ops::Range<f64>| range.prop_map(|power: f64| 10_f64.powf(power));
    [
        power(0.5..3.0),
        power(1.5..4.3),
        power(2.5..6.0),
        power(0.3..3.3),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Whatever the limits of an axis and the bounds of its user are: what is to be moved stays in both.
    #[test]
    fn the_excitation_stays_in_its_bounds(
        limits in limits(),
        ends in prop::option::of([-1.0..1.0f64, -1.0..1.0]),
        speed in prop::option::of(0.01..1.0f64),
        rotary in any::<bool>(),
    ) {
        let machine = machine(if rotary { "B" } else { "Y" }, limits);
        let (axis, [velocity, .., half]) = (&machine.axes[0], limits);
        let travel = ends.map(|[one, other]| (half * one.min(other), half * one.max(other)));
        let speed = speed.map(|part| part * velocity);
        let Ok(bounds) = Bounds::of(axis, travel, speed) else {
            return Ok(());
        };
        let room = travel.unwrap_or((-half, half));
        // The middle of the travel less half of it is rounded.
        prop_assert!(room.0 - 1e-9 <= bounds.travel.0 && bounds.travel.0 < bounds.travel.1);
        prop_assert!(bounds.travel.1 <= room.1 + 1e-9 && bounds.speed <= speed.unwrap_or(velocity));
        let text = program(axis, &bounds, 0.002);
        for line in text.lines().filter(|line| line.starts_with("G1")) {
            let words: Vec<&str> = line.split(' ').collect();
            let [position, feed] = [1, 2].map(|at| words[at][1..].parse::<f64>().unwrap());
            // As many digits as the program is written with.
            prop_assert!(bounds.travel.0 - 1e-6 <= position && position <= bounds.travel.1 + 1e-6);
            prop_assert!(feed / 60.0 <= bounds.speed + 1e-5, "{line}");
        }
        let programs = Programs::with_tables(&machine, Tables::default());
        let checked = programs.text("excitation", text.as_bytes()).check(machine.rest());
        prop_assert!(checked.is_ok(), "{:?}", checked.err().map(|error| error.to_string()));
    }

    #[test]
    fn a_log_is_read_as_it_was_written(
        values in prop::collection::vec((-1e4..1e4f64, -1e4..1e4f64, any::<i16>()), 1..50),
    ) {
        let machine = machine("Y", [100.0, 1000.0, 1e4, 100.0]);
        let samples = values.into_iter().enumerate().map(|(at, (set, act, torque))| AxisSample {
            time: at as f64 * 0.002,
            set,
            act,
            torque: ToldTorque::alike(torque.into()),
            velocity: None,
        });
        let log = Log { samples: samples.collect() };
        let sent = |it: &AxisSample| AxisSample {
            velocity: it.torque.mean.map(|it| it / 7.0),
            torque: ToldTorque::default(),
            ..*it
        };
        let sent = Log { samples: log.samples.iter().map(sent).collect() };
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("log.csv");
        for (beside, log) in [(Beside::Torque, log), (Beside::Velocity, sent)] {
            let mut bytes = Vec::new();
            log.write(&machine.axes[0], beside, &mut bytes).unwrap();
            std::fs::write(&file, bytes).unwrap();
            prop_assert_eq!(Log::read(&machine.axes[0], beside, &file).unwrap(), log);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// Of an axis that is what the estimator takes it for, the numbers come out, with cycles that are missing, and with a
    /// torque that is told late.
    #[test]
    fn an_axis_is_found(
        inertia in 1e-4..1e-2f64,
        friction in 0.03..0.2f64,
        viscous in 1e-4..2e-3f64,
        held in -0.1..0.1f64,
        late in 0.0..1e-3f64,
        seed in any::<u64>(),
    ) {
        let truth = [inertia, 10.0 * friction, viscous, 10.0 * held];
        let samples = moved(truth, late, seed, |_| true);
        let found = estimate(&samples, &SHAFT).unwrap();
        let figures = [found.inertia, found.friction, found.viscous_friction, found.holding_torque];
        let whole = [inertia, truth[1], 0.1 * truth[1] / SPEED, truth[1]];
        for (at, figure) in figures.iter().enumerate() {
            let error = (figure.value - truth[at]).abs();
            prop_assert!(error < 0.03 * truth[at].abs() || error < 0.02 * whole[at], "{at}: {found:?}, {truth:?}");
        }
        prop_assert!((found.torque_delay_s - late).abs() < 2e-4, "{found:?}");
    }
}

/// A motor of 10 N·m rated torque on 10 mm a revolution.
const SHAFT: Shaft = Shaft {
    cycle: 1e-3,
    radians: TAU / 10.0,
    resolution: 10.0 / 131_072.0,
    rated_torque: 10.0,
    motor_viscous_friction: None,
};

/// Mean speed of the synthetic motion, rad/s.
const SPEED: f64 = 60.0;

/// Strokes both ways whose speed swings, seen by an axis of that inertia, friction, viscous friction and held torque, with one
/// of some fifty samples missing; those rows whose direction `keeps`.
fn moved(
    [inertia, friction, viscous, held]: [f64; 4],
    late: f64,
    seed: u64,
    keeps: impl Fn(f64) -> bool,
) -> Vec<AxisSample> {
    let (mut samples, mut state) = (Vec::new(), seed);
    let mut time = 0.0;
    for stroke in 0..12 {
        let way = if stroke % 2 == 0 { 1.0 } else { -1.0 };
        let mean = SPEED * (0.4 + 0.1 * f64::from(stroke));
        let swing = 15.0 + 3.0 * f64::from(stroke);
        for at in 0..1000 {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            let at = SHAFT.cycle * f64::from(at);
            time += SHAFT.cycle;
            if !keeps(way) || (state >> 33) % 50 == 0 {
                continue;
            }
            let motion = |t: f64| {
                let (sine, cosine) = (swing * t).sin_cos();
                let angle = mean * t + 0.3 * mean * (1.0 - cosine) / swing;
                let speed = mean + 0.3 * mean * sine;
                [angle, speed, 0.3 * mean * swing * cosine].map(|it| way * it)
            };
            let [angle, ..] = motion(at);
            let [_, speed, acceleration] = motion(at - late);
            let torque = inertia * acceleration + friction * way + viscous * speed + held;
            let act = angle / SHAFT.radians;
            let counted = (act / SHAFT.resolution).round() * SHAFT.resolution;
            samples.push(AxisSample {
                time,
                set: act,
                act: counted,
                torque: ToldTorque::alike((torque / SHAFT.rated_torque * 1e3).round()),
                velocity: None,
            });
        }
    }
    samples
}

#[test]
fn a_log_that_says_nothing_is_refused() {
    let truth = [1e-3, 1.0, 1e-3, 0.3];
    let samples = moved(truth, 0.0, 1, |_| true);
    let rests = estimate(&samples[..500], &SHAFT);
    assert!(
        matches!(rests, Err(NotEstimated::Rests { .. })),
        "{rests:?}"
    );
    let one_way = estimate(&moved(truth, 0.0, 1, |way| way > 0.0), &SHAFT);
    // Friction and gravity are one then.
    assert!(
        matches!(one_way, Err(NotEstimated::Alike { speed }) if speed > 1.0),
        "{one_way:?}"
    );
    let with_torque = |change: fn(f64) -> f64| {
        let changed = samples.iter().map(|it| AxisSample {
            torque: ToldTorque::alike(change(it.torque.mean.unwrap())),
            ..*it
        });
        estimate(&changed.collect::<Vec<_>>(), &SHAFT)
    };
    let backwards = with_torque(|torque| -torque);
    assert!(
        matches!(backwards, Err(NotEstimated::Backwards { inertia }) if inertia < -0.9e-3),
        "{backwards:?}"
    );
    assert_eq!(with_torque(|_| 0.0), Err(NotEstimated::Torqueless));
    let other_cycle = Shaft {
        cycle: 1.5e-3,
        ..SHAFT
    };
    let uneven = estimate(&samples, &other_cycle);
    assert!(
        matches!(uneven, Err(NotEstimated::Times { .. })),
        "{uneven:?}"
    );
    assert!(estimate(&[], &SHAFT).is_err());
    let never = AxisSample {
        time: f64::NAN,
        ..samples[1]
    };
    assert!(estimate(&[samples[0], never], &SHAFT).is_err());
}

#[test]
fn the_torque_is_in_the_budget_and_a_drive_without_is_named() {
    let limits = [100.0, 1000.0, 1e4, 100.0];
    let mut one = machine("Y", limits);
    let bits = |machine: &Machine| MachineBudget::of(machine).buses[0].budget.t_pdo_bits;
    let before = bits(&one);
    Subject::of(&mut one, "Y", None).unwrap();
    assert!(
        bits(&one) > before + 60,
        "{before} bits, then {}",
        bits(&one)
    );
    // A drive whose EDS has its current in the place of its torque.
    let folder = tempfile::tempdir().unwrap();
    for name in ["machine.toml", "servo.toml", "servo.eds"] {
        let text = std::fs::read_to_string(Path::new("../examples/described").join(name)).unwrap();
        std::fs::write(folder.path().join(name), text.replace("6077", "6078")).unwrap();
    }
    let mut silent = Machine::load(&folder.path().join("machine.toml")).unwrap();
    let refused = Subject::of(&mut silent, "Y", Some(1.0));
    assert!(
        matches!(refused, Err(Unfit::NoTorque { .. })),
        "{refused:?}"
    );
}

/// A motor and a load behind a spring with a damper, at the motor's shaft: inertias, stiffness, damping.
#[derive(Clone, Copy, Debug)]
struct Sprung {
    motor: f64,
    load: f64,
    stiffness: f64,
    damping: f64,
}

impl Sprung {
    fn inertia(&self) -> f64 {
        self.motor + self.load
    }

    /// Speed of the motor over its torque: gain, and phase in rad.
    fn answers(&self, omega: f64) -> (f64, f64) {
        let spring = [self.stiffness, self.damping * omega];
        let above = [spring[0] - self.load * omega * omega, spring[1]];
        let both = self.motor * self.load * omega * omega;
        let below = [
            self.inertia() * spring[0] - both,
            self.inertia() * spring[1],
        ];
        let size = |[re, im]: [f64; 2]| re.hypot(im);
        let phase = |[re, im]: [f64; 2]| im.atan2(re);
        let turned = phase(above) - phase(below) - TAU / 4.0;
        (size(above) / (omega * size(below)), turned)
    }

    /// What an estimator would find that makes no mistake.
    fn estimate(&self, torque_delay_s: f64) -> Estimate {
        let exact = |value| Figure {
            value,
            uncertainty: 0.0,
        };
        let free = (self.stiffness / self.load).sqrt();
        let both = free * (self.inertia() / self.motor).sqrt();
        Estimate {
            inertia: exact(self.inertia()),
            friction: exact(0.5),
            viscous_friction: exact(0.0),
            holding_torque: exact(0.2),
            torque_delay_s,
            swing: Some(Swing {
                antiresonance: exact(free / TAU),
                resonance: Some(exact(both / TAU)),
                damping: Some(exact(0.5 * self.damping / self.stiffness * both)),
            }),
            seen_to_hz: 100.0,
            moving_s: 10.0,
        }
    }
}

/// How strong a tone is, N·m, that is answered by that gain: none has the axis turn round.
fn strength(gain: f64) -> f64 {
    (4.0 / gain).min(0.3)
}

/// Torques of these frequencies, Hz, that go on for so long, s, and what an axis has answered them with since ever; it goes on one
/// way, with friction and gravity, and turns round each `way` s.
fn answering(
    axis: &Sprung,
    frequencies: &[f64],
    late: f64,
    length: f64,
    way: f64,
) -> Vec<AxisSample> {
    // Angle of the motor, and torque as the mean over twice its delay.
    let mean = |angle: f64| {
        if angle == 0.0 {
            1.0
        } else {
            angle.sin() / angle
        }
    };
    let swings = |at: f64| {
        let tones = frequencies.iter().enumerate().map(|(n, hertz)| {
            let (omega, begins) = (TAU * hertz, (n * n) as f64);
            let (gain, phase) = axis.answers(omega);
            let turn = omega * at + begins;
            let torque = strength(gain);
            [
                torque * gain / omega * (turn + phase).sin(),
                torque * mean(omega * late) * turn.cos(),
            ]
        });
        tones.fold([0.0; 2], |sum, it| [sum[0] + it[0], sum[1] + it[1]])
    };
    let rows = (length / SHAFT.cycle) as usize;
    let row = |n: usize| {
        let time = n as f64 * SHAFT.cycle;
        let (turn, into) = ((time / way).floor(), time.rem_euclid(way));
        let [sign, from] = match turn % 2.0 == 0.0 {
            true => [1.0, 0.0],
            false => [-1.0, way],
        };
        let angle = 2.0 * SPEED * (from + sign * into) + swings(time)[0];
        let torque = swings(time - late)[1] + 0.5 * sign + 0.2;
        let act = angle / SHAFT.radians;
        AxisSample {
            time,
            set: act,
            act: (act / SHAFT.resolution).round() * SHAFT.resolution,
            torque: ToldTorque::alike((torque / SHAFT.rated_torque * 1e3).round()),
            velocity: None,
        }
    };
    (0..rows).map(row).collect()
}

/// Of 2.048 s each, which a log that is looked at has.
const STRETCHES: f64 = 7.0;

fn sprung() -> impl Strategy<Value = Sprung> {
    (5e-4..5e-3_f64, 0.3..4.0_f64, 8.0..80.0_f64, 0.01..0.1_f64).prop_map(
        |(motor, more, hertz, damping)| {
            let load = more * motor;
            let stiffness = load * (TAU * hertz).powi(2);
            Sprung {
                motor,
                load,
                stiffness,
                damping: 2.0 * damping * (stiffness * load).sqrt(),
            }
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(24) })]

    /// At each frequency that an axis is moved with, its response is the closed form's, and so is that of its estimate, however late
    /// the torque is told; and of one that turns round again and again before a stretch is over nothing is told.
    #[test]
    fn a_response_is_that_of_the_axis(axis in sprung(), late in 0.0..2e-3_f64, first in 5..10_usize) {
        // In the middle of bins of 2.048 s, and apart from each other.
        let frequencies: Vec<f64> = (0..12).map(|n| (first + 14 * n) as f64 / 2.048).collect();
        let samples = answering(&axis, &frequencies, late, STRETCHES * 2.048, 100.0);
        let estimate = axis.estimate(late);
        let told = response(&samples, &SHAFT, &estimate);
        for hertz in &frequencies {
            let (gain, phase) = axis.answers(TAU * hertz);
            let at = told.iter().find(|it| (it.frequency_hz - hertz).abs() < 1e-9);
            let Some(at) = at else {
                // What an increment hides is not told.
                let shown = [gain / (TAU * hertz) / (SHAFT.resolution * SHAFT.radians), 1e3 / SHAFT.rated_torque];
                prop_assert!(shown.iter().any(|it| strength(gain) * it < 2.0), "{hertz} Hz: {shown:?}");
                continue;
            };
            // What is not coherent is spread over both by √(lacks/2n) in n stretches (Bendat and Piersol, Random Data, 9.2), and
            // takes so much off the gain where it is in the torque.
            let lacks = 1.0 - at.coherence;
            let spread = 3.0 * (lacks / (2.0 * STRETCHES)).sqrt();
            prop_assert!((at.gain / gain - 1.0).abs() < 0.01 + lacks + spread, "{at:?}, not {gain}");
            let off = (at.phase_deg - phase.to_degrees() + 540.0).rem_euclid(360.0) - 180.0;
            prop_assert!(off.abs() < 1.0 + (lacks + spread).to_degrees(), "{at:?}, not {}", phase.to_degrees());
            prop_assert!((at.model_gain / gain - 1.0).abs() < 1e-9, "{at:?}, not {gain}");
            let off = (at.model_phase_deg - phase.to_degrees() + 540.0).rem_euclid(360.0) - 180.0;
            prop_assert!(off.abs() < 1e-6, "{at:?}, not {}", phase.to_degrees());
        }
        let turning = answering(&axis, &frequencies, late, 30.0, 1.9);
        prop_assert_eq!(response(&turning, &SHAFT, &estimate), []);
        let mut torn = samples;
        torn.retain(|it| (it.time / 1.9).fract() > 0.01);
        prop_assert_eq!(response(&torn, &SHAFT, &estimate), []);
    }
}
