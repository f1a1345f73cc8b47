//! What is computed of loops against loops that run, on axes without Coulomb friction and an encoder without noise.

use super::*;
use crate::mechanics::drive_train::Elasticity;
use crate::mechanics::friction::Friction;
use crate::twin::servo::cascade::Reference;
use crate::twin::servo::motor::Motor;
use crate::twin::servo::running::{Running, at};
use proptest::prelude::*;

/// What identified axes are tuned to, and more.
const DISTANCE: Distance = Distance {
    phase: 50.0,
    gain: 9.5,
    peak: 1.1,
};

fn axis(rotor_inertia: f64, load_inertia: f64, spring: Option<(f64, f64)>) -> DriveTrain {
    let viscous = Friction {
        viscous: 1e-3 * (rotor_inertia + load_inertia),
        ..Friction::coulomb(0.0)
    };
    DriveTrain {
        rotor_inertia,
        load_inertia,
        elasticity: spring.map(|(antiresonance, damping)| {
            let stiffness = load_inertia * (TAU * antiresonance).powi(2);
            Elasticity::damped(stiffness, damping, [rotor_inertia, load_inertia])
        }),
        bearing: viscous,
        guide: viscous,
        ..DriveTrain::default()
    }
}

/// Motors and loads of all sizes, stiff ones and such whose antiresonance is from 5 to 300 Hz.
fn axes() -> impl Strategy<Value = DriveTrain> {
    let spring = prop::option::weighted(0.8, (5.0_f64.ln()..300.0_f64.ln(), 0.005..0.2));
    (-5.0..-2.0, -0.7..1.0, spring).prop_map(|(rotor, ratio, spring)| {
        let rotor = 10_f64.powf(rotor);
        let spring = spring.map(|(antiresonance, damping)| (antiresonance.exp(), damping));
        axis(rotor, rotor * 10_f64.powf(ratio), spring)
    })
}

/// A cascade that moves an axis, without limits.
fn running(gains: &Gains, train: &DriveTrain) -> Running {
    let unlimited = Gains {
        torque_limit: f64::MAX,
        speed_limit: f64::MAX,
        ..gains.clone()
    };
    Running::new(unlimited, train.clone())
}

/// What time, motor and load are, step by step, for so long from now on.
fn follow(
    loops: &mut Running,
    seconds: f64,
    reference: impl Fn(f64) -> Reference,
) -> Vec<[f64; 3]> {
    let steps = (seconds / SPEED_STEP) as u32;
    let step = |_| {
        loops.step(&reference);
        [
            loops.time(),
            loops.shaft.velocity(),
            loops.shaft.load_position(),
        ]
    };
    (0..steps).map(step).collect()
}

/// Of the commissioned loops, which suit any axis somehow.
fn commissioned(train: &DriveTrain) -> Gains {
    Gains::commissioned(&Motor::default(), train)
}

/// PI on an inertia, so slow that it is continuous: tan φ = ω Tᵢ.
#[test]
fn the_phase_margin_of_an_inertia_is_that_of_its_integral() {
    for integral_time in [0.05, 0.2, 1.0] {
        let train = axis(1e-3, 1e-3, None);
        let gains = Gains {
            speed: TAU * 20.0 * 2e-3,
            speed_integral_time: integral_time,
            speed_filter: 0.0,
            speed_reference_filter: 0.0,
            ..commissioned(&train)
        };
        let tuning = Tuning::new(train, f64::INFINITY);
        let margins = tuning.stability(&gains).unwrap().speed;
        let turned = (TAU * margins.crossover * integral_time).atan();
        let error = margins.phase - turned.to_degrees();
        // The loop's own delay is a step: 0.07° at 20 rad/s.
        assert!(error.abs() < 0.3, "{integral_time} s: {margins:?}, {error}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    /// A sine that the position loop is to follow: the load does what is computed, in size.
    #[test]
    fn a_load_follows_a_sine_as_computed(train in axes(), hertz in 1.0_f64.ln()..60.0_f64.ln(), slower in 0.3..1.0, by_scale: bool) {
        let gains = Gains { position: commissioned(&train).position * slower, ..commissioned(&train) };
        let tuning = Tuning::new(train.clone(), f64::INFINITY);
        let tuning = if by_scale { tuning.by_scale() } else { tuning };
        prop_assume!(tuning.stability(&gains).is_some());
        // A whole number of steps of the position loop in a period.
        let period = (hertz.exp() * POSITION_STEP).recip().round() * POSITION_STEP;
        let s = Complex::new(0.0, TAU / period);
        let expected = OpenLoops::at(&gains, &tuning.response(s), f64::INFINITY).load;
        let mut loops = running(&gains, &train).by_scale(by_scale);
        loops.run(4.0, |t| at(0.01 * (TAU * t / period).sin(), 0.0, 0.0));
        let periods = (0.5 / period).ceil();
        let seen = follow(&mut loops, periods * period + 0.5 * SPEED_STEP, |t| at(0.01 * (TAU * t / period).sin(), 0.0, 0.0));
        let sum = seen.iter().fold(Complex::from(0.0), |sum, [t, _, load]| {
            sum + (-s * *t).exp() * *load
        });
        let found = sum * (2.0 / (0.01 * seen.len() as f64)) * Complex::i();
        let error = (found - expected).modulus() / expected.modulus().max(0.01);
        prop_assert!(error < 0.02, "{found} instead of {expected} at {} Hz", period.recip());
    }

    /// A gain that is greater by less than the margin lets the speed loop rest, one that is greater by more does not.
    #[test]
    fn a_loop_swings_beyond_its_gain_margin(train in axes(), is_beyond: bool) {
        let gains = commissioned(&train);
        let tuning = Tuning::new(train.clone(), f64::INFINITY);
        // Up to where it is not stable any more.
        let more = |decibels: f64| Gains {
            speed: gains.speed * 10_f64.powf(decibels / 20.0),
            ..gains.clone()
        };
        prop_assume!(tuning.stability(&gains).is_some());
        let mut edge = 0.0;
        while tuning.stability(&more(edge + 0.25)).is_some() {
            edge += 0.25;
            prop_assume!(edge < 60.0);
        }
        let margin = tuning.stability(&more(edge)).unwrap().speed.gain;
        prop_assert!(margin < 0.5, "{margin} dB at the edge of {edge} dB");
        let mut loops = running(&more(edge + if is_beyond { 1.0 } else { -1.0 }), &train);
        let kick = follow(&mut loops, 0.02, |_| Reference::Velocity(0.01));
        let most = |seen: &[[f64; 3]]| seen.iter().map(|it| it[1].abs()).fold(0.0, f64::max);
        let later = follow(&mut loops, 1.0, |_| Reference::Velocity(0.0));
        let (early, late) = (most(&kick), most(&later[later.len() * 3 / 4..]));
        prop_assert_eq!(late > early, is_beyond, "{} dB: from {} to {}", edge, early, late);
    }

    /// Gains that are found keep the distance, and more of the position loop's would not.
    #[test]
    fn tuned_loops_keep_their_distance(train in axes()) {
        let tuning = Tuning::new(train.clone(), f64::INFINITY);
        let gains = tuning.tuned(&commissioned_like(&train), &DISTANCE);
        let gains = gains.expect("every axis can be held slowly");
        let found = tuning.stability(&gains).unwrap();
        prop_assert!(found.keeps(&DISTANCE), "{found:?}");
        let stiffer = Gains { position: 1.03 * gains.position, ..gains.clone() };
        let keeps = tuning.stability(&stiffer).is_some_and(|it| it.keeps(&DISTANCE));
        prop_assert!(!keeps, "{gains:?} could be stiffer");
        // And the load comes to rest.
        let mut loops = running(&gains, &train);
        let seen = follow(&mut loops, 20.0 / gains.position, |_| at(0.01, 0.0, 0.0));
        let end = &seen[seen.len() * 9 / 10..];
        let off = end.iter().map(|it| (it[2] - 0.01).abs()).fold(0.0, f64::max);
        prop_assert!(off < 5e-4, "{off} of 0.01 revolutions left");
    }

    /// A load that rings does so as its slowest swing does.
    #[test]
    fn a_load_rings_as_its_slowest_swing(antiresonance in 5.0..40.0, damping in 0.005..0.05, ratio in 0.5..4.0) {
        let train = axis(1e-4, ratio * 1e-4, Some((antiresonance, damping)));
        // Held firmly, so that the load swings as if the motor were clamped.
        let fast = commissioned(&axis(1e-4, ratio * 1e-4, None));
        let gains = Gains { position: 0.3 * TAU * antiresonance, ..fast };
        let tuning = Tuning::new(train.clone(), f64::INFINITY);
        prop_assume!(tuning.stability(&gains).is_some());
        let Some(mode) = tuning.slowest_swing(&gains) else { return Ok(()) };
        prop_assume!(mode.damping < 0.1);
        let mut loops = running(&gains, &train);
        loops.run(4.0 / gains.position, |_| at(0.01, 0.0, 0.0));
        let seen = follow(&mut loops, 12.0 / mode.frequency, |_| at(0.01, 0.0, 0.0));
        // Where it turns round, as far as that is seen.
        let turns: Vec<[f64; 2]> = seen
            .windows(3)
            .filter(|it| (it[1][2] - it[0][2]) * (it[2][2] - it[1][2]) < 0.0)
            .map(|it| [it[1][0], (it[1][2] - 0.01).abs()])
            .filter(|[_, off]| *off > 1e-6)
            .collect();
        prop_assume!(turns.len() > 6);
        let (first, last) = (turns[2], turns[turns.len() - 1]);
        let halves = (turns.len() - 3) as f64;
        let turn = PI * halves / (last[0] - first[0]);
        let decay = (first[1] / last[1]).ln() / (last[0] - first[0]);
        let expected = TAU * mode.frequency;
        let seen = (decay * decay + turn * turn).sqrt();
        prop_assert!((seen / expected - 1.0).abs() < 0.02, "{} instead of {} Hz", seen / TAU, mode.frequency);
        prop_assert!((decay / (mode.damping * expected) - 1.0).abs() < 0.1, "{decay} instead of {mode:?}");
    }
}

/// As fast as axes may be made.
fn commissioned_like(train: &DriveTrain) -> Gains {
    let stiff = DriveTrain {
        elasticity: None,
        ..train.clone()
    };
    commissioned(&stiff)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    /// The position loop by a scale: a gain that is greater by less than its margin lets the load rest, one that is greater by
    /// more does not.
    #[test]
    fn a_loop_by_a_scale_swings_beyond_its_gain_margin(train in axes(), is_beyond: bool) {
        prop_assume!(train.elasticity.is_some());
        let gains = commissioned(&train);
        let tuning = Tuning::new(train.clone(), f64::INFINITY).by_scale();
        let more = |decibels: f64| Gains {
            position: gains.position * 10_f64.powf(decibels / 20.0),
            ..gains.clone()
        };
        let mut edge = -40.0;
        prop_assume!(tuning.stability(&more(edge)).is_some());
        while tuning.stability(&more(edge + 0.25)).is_some() {
            edge += 0.25;
            prop_assume!(edge < 40.0);
        }
        let margin = tuning.stability(&more(edge)).unwrap().position.gain;
        prop_assert!(margin < 0.5, "{} dB at the edge of {} dB", margin, edge);
        let mut loops = running(&more(edge + if is_beyond { 1.5 } else { -1.5 }), &train).by_scale(true);
        let kick = follow(&mut loops, 0.5, |_| at(0.001, 0.0, 0.0));
        let most = |seen: &[[f64; 3]]| seen.iter().map(|it| it[1].abs()).fold(0.0, f64::max);
        // What is left once it rests is the encoder's last digit.
        let early = most(&kick[kick.len() / 2..]).max(1e-5);
        // What swings is seen before it has become too large to count.
        let mut late = early;
        for _ in 0..120 {
            late = most(&follow(&mut loops, 0.05, |_| at(0.001, 0.0, 0.0)));
            if late > 10.0 * early {
                break;
            }
        }
        prop_assert_eq!(late > early, is_beyond, "{} dB: from {} to {}", edge, early, late);
    }

    /// What is calmed keeps the distance and is no slower than it takes; on a stiff axis nothing changes.
    #[test]
    fn a_position_loop_is_calmed_as_far_as_it_takes(train in axes()) {
        let gains = Gains { position: 4.0 * commissioned(&train).position, ..commissioned(&train) };
        let tuning = Tuning::new(train.clone(), f64::INFINITY).by_scale();
        let calmed = tuning.calmed(&gains, &DISTANCE);
        let keeps = |gains: &Gains| tuning.stability(gains).is_some_and(|it| {
            let position = it.position;
            position.phase >= DISTANCE.phase && position.gain >= DISTANCE.gain && it.peak <= DISTANCE.peak
        });
        if keeps(&gains) {
            prop_assert_eq!(calmed, gains);
        } else if calmed != gains {
            prop_assert!(keeps(&calmed));
            let more = Gains { position: 1.01 * calmed.position, ..calmed.clone() };
            prop_assert!(!keeps(&more), "{:?}", calmed.position);
        }
    }
}
