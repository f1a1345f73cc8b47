//! The loops against their closed forms, on axes without friction and an encoder without noise.

use super::*;
use crate::mechanics::drive_train::{DriveTrain, Elasticity};
use crate::mechanics::friction::Friction;
use crate::mechanics::mode::Mode;
use crate::mechanics::rigid::Rigid;
use crate::twin::servo::motor::MOTORS;
use crate::twin::servo::running::{Running, at};
use nalgebra::Vector2;
use proptest::prelude::*;

/// Gains without filters.
fn bare() -> Gains {
    Gains {
        speed_reference_filter: 0.0,
        speed_filter: 0.0,
        torque_limit: 1e3,
        speed_limit: 1e3,
        ..Gains::default()
    }
}

/// Loops of an axis without friction.
fn smooth(gains: Gains) -> Running {
    let rigid = Rigid {
        viscous_friction: 0.0,
        coulomb_friction: 0.0,
        ..Rigid::default()
    };
    Running::new(gains, rigid)
}

#[test]
fn the_lag_at_constant_velocity_is_what_feed_forward_leaves() {
    for (gain, share) in [
        (80.0, 0.0),
        (40.0, 0.5),
        (80.0, 0.9),
        (80.0, 1.0),
        (60.0, 1.1),
    ] {
        let mut loops = smooth(Gains {
            position: gain,
            velocity_feed_forward: share,
            ..Gains::default()
        });
        let velocity = 12.0;
        loops.run(3.0, |t| at(velocity * t, velocity, 0.0));
        // Read where the position loop reads it.
        let lag = velocity * loops.time() - loops.shaft.position();
        let expected = velocity * (1.0 - share) / gain;
        let error = (lag - expected).abs() / (velocity / gain);
        assert!(
            error < 1e-3,
            "{gain} 1/s, {share}: {lag}, expected {expected}"
        );
    }
}

/// With all of the velocity fed forward, what a constant acceleration leaves is the difference of
/// both filters' delays; with all of the acceleration too, the torque need not come from an error.
#[test]
fn acceleration_feed_forward_takes_the_error_of_a_run_up() {
    let peak = |share: f64| {
        let mut loops = smooth(Gains {
            velocity_feed_forward: 1.0,
            acceleration_feed_forward: share,
            ..Gains::default()
        });
        let (acceleration, mut most) = (150.0, 0.0_f64);
        for _ in 0..1600 {
            loops.step(|t| at(0.5 * acceleration * t * t, acceleration * t, acceleration));
            let t = loops.time();
            most = most.max((0.5 * acceleration * t * t - loops.shaft.position()).abs());
        }
        most
    };
    let [without, with] = [peak(0.0), peak(1.0)];
    assert!(with < 0.5 * without, "{with} and {without} revolutions");
}

/// PI on an inertia: second order. s² + (K/J) s + K/(J Tᵢ), whose zero adds the derivative.
#[test]
fn the_speed_loops_step_is_that_of_its_second_order() {
    for (speed, integral_time) in [(0.16, 0.05), (0.32, 0.02), (0.08, 1e9)] {
        let mut loops = smooth(Gains {
            speed,
            speed_integral_time: integral_time,
            ..bare()
        });
        let bandwidth = speed / (TAU * 5.1e-4);
        let error = Mode {
            stiffness: bandwidth / integral_time,
            decay: 0.5 * bandwidth,
        };
        for _ in 0..1600 {
            loops.step(|_| Reference::Velocity(1.0));
            // e(0) = 1 and ė(0) = −K/J; half a step goes by until a torque shows in a speed.
            let t = loops.time() - 0.5 * SPEED_STEP;
            let begin = Vector2::new(1.0, -bandwidth);
            let expected = 1.0 - error.after(t).apply(begin, 0.0).x;
            let found = loops.shaft.velocity();
            assert!((found - expected).abs() < 0.02, "{t}: {found}, {expected}");
        }
    }
}

/// P over P on an inertia: s² + (K/J) s + (K/J) Kp.
#[test]
fn the_position_loops_step_is_that_of_its_second_order() {
    for position in [10.0, 30.0, 60.0] {
        let speed = 0.8;
        let mut loops = smooth(Gains {
            position,
            speed,
            speed_integral_time: 1e9,
            ..bare()
        });
        let bandwidth = speed / (TAU * 5.1e-4);
        let error = Mode {
            stiffness: bandwidth * position,
            decay: 0.5 * bandwidth,
        };
        for _ in 0..3200 {
            loops.step(|_| at(0.01, 0.0, 0.0));
            let expected = 1.0
                - error
                    .after(loops.time())
                    .apply(Vector2::new(1.0, 0.0), 0.0)
                    .x;
            let found = loops.shaft.position() / 0.01;
            assert!((found - expected).abs() < 0.02, "{found}, {expected}");
        }
    }
}

#[test]
fn a_limited_torque_does_not_wind_up() {
    let mut loops = smooth(Gains {
        torque_limit: 0.2,
        ..Gains::default()
    });
    let mut most = 0.0_f64;
    for _ in 0..16_000 {
        loops.step(|_| Reference::Velocity(20.0));
        assert!(loops.cascade.torque().abs() <= 0.2);
        most = most.max(loops.shaft.velocity());
    }
    assert!(most < 20.5, "{most} rev/s");
    assert!((loops.shaft.velocity() - 20.0).abs() < 1e-3);
    loops.cascade.limit_torque(0.1);
    loops.run(0.01, |_| Reference::Velocity(30.0));
    assert_eq!(loops.cascade.torque(), 0.1);
}

#[test]
fn friction_compensation_takes_the_dip_of_a_reversal() {
    let dip = |compensation: f64| {
        let mut loops = Running::new(
            Gains {
                velocity_feed_forward: 1.0,
                friction_compensation: compensation,
                ..Gains::default()
            },
            Rigid::default(),
        );
        let (amplitude, frequency) = (0.5, TAU * 0.5);
        let reference = |t: f64| {
            let (sine, cosine) = libm::sincos(frequency * t);
            at(
                amplitude * (1.0 - cosine),
                amplitude * frequency * sine,
                amplitude * frequency * frequency * cosine,
            )
        };
        loops.run(0.5, reference);
        let mut most = 0.0_f64;
        for _ in 0..16_000 {
            loops.step(reference);
            let wanted = amplitude * (1.0 - libm::cos(frequency * loops.time()));
            most = most.max((wanted - loops.shaft.position()).abs());
        }
        most
    };
    let [without, with] = [dip(0.0), dip(0.08)];
    assert!(with < 0.5 * without, "{with} and {without} revolutions");
}

/// A notch where rotor and load swing against each other lets a gain stand that would not without.
#[test]
fn a_notch_calms_a_resonance() {
    let train = DriveTrain {
        elasticity: Some(Elasticity {
            stiffness: 400.0,
            damping: 0.004,
            play: 0.0,
        }),
        bearing: Friction::default(),
        ..DriveTrain::default()
    };
    let (_, frequency) = train.resonances().unwrap();
    let swing = |notch: bool| {
        let shape = NotchShape {
            frequency,
            bandwidth: 0.8,
            depth: 0.95,
        };
        let gains = Gains {
            speed: 1.0,
            speed_integral_time: 0.02,
            // So late that the resonance gets its own swing back, to swing more.
            speed_filter: 1e-3,
            torque_filter: 1e-3,
            torque_limit: 1e3,
            notches: [notch.then_some(shape), None],
            ..Gains::default()
        };
        let mut loops = Running::new(gains, train.clone());
        loops.run(0.4, |_| at(0.001, 0.0, 0.0));
        let mut most = 0.0_f64;
        for _ in 0..1600 {
            loops.step(|_| at(0.001, 0.0, 0.0));
            most = most.max(loops.shaft.velocity().abs());
        }
        most
    };
    assert!(swing(false) > 0.1, "{} rev/s", swing(false));
    assert!(swing(true) < 1e-3, "{} rev/s", swing(true));
}

#[test]
fn overshoot_suppression_leaves_no_swing_of_its_period() {
    let bandwidth: f64 = 0.2 / (TAU * 5.1e-4);
    let frequency = (bandwidth / 0.008 - 0.25 * bandwidth * bandwidth).sqrt();
    let half_period = core::f64::consts::PI / frequency;
    let decays = libm::exp(-0.5 * bandwidth * half_period);
    // What is left of the swing behind the delay.
    let swing = |suppression| {
        let mut loops = smooth(Gains {
            speed: 0.2,
            speed_integral_time: 0.008,
            overshoot_suppression: suppression,
            ..bare()
        });
        let mut most = 0.0_f64;
        for _ in 0..4800 {
            loops.step(|_| Reference::Velocity(1.0));
            if loops.time() > half_period + 1e-3 {
                most = most.max((loops.shaft.velocity() - 1.0).abs());
            }
        }
        most
    };
    let (without, with) = (
        swing(None),
        swing(Some(OvershootSuppression {
            share: decays / (1.0 + decays),
            delay: half_period,
        })),
    );
    assert!(without > 0.15, "{without}");
    assert!(with < 0.03 * without, "{with} and {without}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// Whatever the axis: as it is commissioned, it goes where it should, and rests there.
    #[test]
    fn a_commissioned_axis_settles(
        motor in 0..MOTORS.len(),
        ratio in 0.3..10.0,
        frequency in prop_oneof![Just(None), (8.0..300.0).prop_map(Some)],
        damping in 0.01..0.1_f64,
        friction in 0.0..0.2,
    ) {
        let motor = MOTORS[motor];
        let (rotor, load) = (motor.rotor_inertia, ratio * motor.rotor_inertia);
        let reduced = rotor * load / (rotor + load);
        let elasticity = frequency.map(|frequency: f64| {
            let stiffness = load * (TAU * frequency) * (TAU * frequency);
            let damping = 2.0 * damping * f64::sqrt(stiffness * reduced);
            Elasticity { stiffness, damping, play: 0.0 }
        });
        let train = DriveTrain {
            rotor_inertia: rotor,
            load_inertia: load,
            elasticity,
            bearing: Friction::coulomb(motor.friction),
            guide: Friction::coulomb(friction * motor.continuous_torque),
            ..DriveTrain::default()
        };
        let gains = Gains::commissioned(&motor, &train);
        let mut loops = Running::new(gains, train);
        // 0.1 revolutions in 0.5 s, without a jump.
        let reference = |t: f64| {
            let (s, over) = ((t / 0.5).min(1.0), t > 0.5);
            let speed = if over { 0.0 } else { 0.6 * s * (1.0 - s) / 0.5 };
            at(0.1 * s * s * (3.0 - 2.0 * s), speed, 0.0)
        };
        loops.run(4.0, reference);
        let error = (loops.shaft.position() - 0.1).abs();
        prop_assert!(error < 2e-3, "{error} revolutions");
        let mut most = 0.0_f64;
        for _ in 0..1600 {
            loops.step(reference);
            most = most.max(loops.shaft.velocity().abs());
        }
        prop_assert!(most < 0.02, "{most} rev/s");
    }
}
