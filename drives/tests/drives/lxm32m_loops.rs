//! The loops' objects: what is written to them changes the motion, and nothing else does.

use crate::common::lxm32m::{Bench, drive, enabled};
use crate::common::{HALT, X_END, id, ms, set, wait_for};
use syncline_canopen::Instant;
use syncline_canopen::cia402::State;
use syncline_drives::mechanics::drive_train::{DriveTrain, Elasticity};
use syncline_drives::mechanics::friction::Friction;
use syncline_drives::mechanics::rigid::Rigid;
use syncline_drives::twin::lxm32m::TwinConfig;
use syncline_drives::twin::servo::motor::Motor;
use syncline_drives::twin::{Config, Disturbance, DrivenAxis, ErrorClass, SimulatedDevice};

/// Where the shaft is at each 2 ms of a run-up with a Halt and of one with a Quick Stop.
fn motion(writes: &[(u16, u8, i32)]) -> Vec<f64> {
    let mut bench = drive(3);
    set(&mut bench, 0x6083, 0, 6000);
    set(&mut bench, 0x6084, 0, 60_000);
    // As many writes each time, and then the same instant: nothing but the values differs.
    let nothing = (0x3011, 0x14, 0);
    for write in 0..3 {
        let (index, sub, value) = *writes.get(write).unwrap_or(&nothing);
        set(&mut bench, index, sub, value);
    }
    bench.run_to(Instant::from_nanos(500_000_000));
    let mut positions = Vec::new();
    let mut watch = |bench: &mut Bench| {
        for _ in 0..60 {
            bench.wait(ms(2));
            positions.push(bench.twin().observe().position);
        }
    };
    for stop in [0x000F | HALT, 0x000B] {
        set(&mut bench, 0x60FF, 0, 600);
        watch(&mut bench);
        bench.controlword(1, stop);
        watch(&mut bench);
        wait_for(&mut bench, X_END, 3);
        set(&mut bench, 0x60FF, 0, 0);
        bench.controlword(1, 0x000F);
    }
    positions
}

#[test]
fn every_object_of_the_loops_changes_the_motion() {
    let notch = |of: u8, frequency: i32| {
        [
            (0x3012, of, 900),
            (0x3012, of + 1, frequency),
            (0x3012, of + 2, 700),
        ]
    };
    let suppression = [(0x3012, 0x0E, 300), (0x3012, 0x0F, 1000)];
    let all: [&[(u16, u8, i32)]; 18] = [
        &[(0x3011, 0x08, 200)],
        &[(0x3011, 0x09, 600), (0x3012, 0x10, 10)],
        &[(0x3012, 0x10, 10)],
        &[(0x3011, 0x0A, 1000)],
        &[(0x3011, 0x0C, 80)],
        &[(0x3011, 0x0D, 20)],
        &[(0x3011, 0x0E, 60)],
        &[(0x3011, 0x15, 700)],
        &[(0x3012, 0x01, 250)],
        &[(0x3012, 0x02, 2000)],
        &[(0x3012, 0x03, 500)],
        &[(0x3012, 0x04, 300)],
        &[(0x3012, 0x05, 60)],
        &[(0x3012, 0x06, 1000)],
        &notch(0x08, 200),
        &notch(0x0B, 300),
        &suppression,
        &[(0x3012, 0x03, 500), (0x3011, 0x15, 500)],
    ];
    let before = motion(&[]);
    let mut seen = vec![before.clone()];
    for writes in all {
        let after = motion(writes);
        assert!(after.iter().all(|position| position.is_finite()));
        assert!(!seen.contains(&after), "{writes:X?} moves as another did");
        seen.push(after);
    }
    // What has no value takes no part: a notch without a frequency, a suppression without a delay;
    // and nothing of the set that is not selected.
    for writes in [
        &notch(0x08, 0)[..1],
        &suppression[..1],
        &[(0x3013, 0x03, 500)],
    ] {
        assert!(
            motion(writes) == before,
            "{writes:X?} moves as nothing should"
        );
    }
}

#[test]
fn a_current_limit_is_the_torque_at_its_constant() {
    let mut bench = drive(4);
    set(&mut bench, 0x3011, 0x0C, 100);
    set(&mut bench, 0x6071, 0, 3000);
    bench.wait(ms(5));
    // 1 A on 0.8 N·m/A.
    assert!((bench.twin().observe().torque - 0.8).abs() < 1e-12);
}

/// A twin on an axis of data sheets, with a power stage.
fn on_an_axis() -> TwinConfig {
    let config = Config {
        axis: Some(DrivenAxis {
            motor: Motor::default(),
            train: DriveTrain {
                elasticity: Some(Elasticity {
                    stiffness: 200.0,
                    damping: 0.01,
                    play: 0.0,
                }),
                guide: Friction::coulomb(0.05),
                ..DriveTrain::default()
            },
        }),
        ..Config::new(id(1))
    };
    TwinConfig::from(&config)
}

#[test]
fn a_blocked_motor_grows_warm_until_its_current_is_limited() {
    let mut bench = enabled(on_an_axis(), 4);
    bench.twin().shaft_mut().unwrap().block(true);
    set(&mut bench, 0x6071, 0, 2500);
    bench.wait(ms(200));
    assert!((bench.twin().observe().torque - 3.5).abs() < 1e-3);
    assert_eq!(bench.read_u16(1, 0x301C, 0x0F), 5600);
    // The drive stands 2.5 times the motor's continuous current for some seconds.
    bench.wait(ms(4_000));
    assert!(bench.twin().observe().torque < 2.2);
    let overload = bench.read_u16(1, 0x301C, 0x16);
    assert!((90..=101).contains(&overload), "{overload} %");
    assert!(bench.read_u16(1, 0x301C, 0x18) >= 100);
    assert!(bench.read_u16(1, 0x301C, 0x19) > 20);
}

/// A motor that has lost its torque does not come to rest by braking: the power stage goes off, and the brake stops what hangs
/// on it.
#[test]
fn a_fault_reaction_that_does_not_stop_the_motor_ends() {
    let mut config = TwinConfig::new(id(1));
    config.servo.mechanics = Rigid {
        load_torque: -0.4,
        ..Rigid::default()
    }
    .into();
    let mut bench = enabled(config, 3);
    set(&mut bench, 0x6065, 0, i32::MAX);
    bench.twin().disturb(Disturbance::LoseTorque(true));
    bench.wait(ms(50));
    let twin = bench.twin();
    twin.disturb(Disturbance::Fault(ErrorClass::StopAndSwitchOff));
    bench.wait(ms(300));
    assert_eq!(bench.twin().state(), State::FaultReactionActive);
    bench.wait(ms(1500));
    assert_eq!(bench.twin().state(), State::Fault);
    assert_eq!(bench.twin().observe().velocity, 0.0);
}
