//! What the drive tells of its motor and power stage, against what is true of them.

use crate::common::id;
use crate::common::lxm32m::{Bench, drive, enabled};
use crate::common::{ms, set};
use proptest::prelude::*;
use syncline_drives::mechanics::drive_train::DriveTrain;
use syncline_drives::twin::lxm32m::TwinConfig;
use syncline_drives::twin::servo::motor::{MOTORS, Motor};
use syncline_drives::twin::{Config, Disturbance, DrivenAxis, ErrorClass, SimulatedDevice};

fn signed(bench: &mut Bench, index: u16, sub: u8) -> f64 {
    let bytes = bench.read(1, index, sub).unwrap();
    match *bytes {
        [low, high] => i16::from_le_bytes([low, high]).into(),
        _ => i32::from_le_bytes(bytes.try_into().unwrap()).into(),
    }
}

/// One with this motor and its power stage, in Profile Torque.
fn with(motor: Motor) -> Bench {
    let config = Config {
        axis: Some(DrivenAxis {
            motor,
            train: DriveTrain::default(),
        }),
        ..Config::new(id(1))
    };
    enabled(TwinConfig::from(&config), 4)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// 100 % of the target torque is _M_M_0 (1492, 2392); current, load and torque that are told belong
    /// together, whatever the motor.
    #[test]
    fn figures_and_measured_values_are_those_of_the_motor(
        which in 0..MOTORS.len(),
        tenths in -1400i32..1400,
    ) {
        let motor = MOTORS[which];
        let mut bench = with(motor);
        bench.twin().shaft_mut().unwrap().block(true);
        set(&mut bench, 0x6071, 0, tenths);
        bench.wait(ms(20));
        let share = f64::from(tenths) / 1000.0;
        let stall = f64::from(bench.number(1, 0x300D, 0x16)) * 0.01;
        prop_assert!((stall - motor.continuous_torque).abs() < 0.006);
        let torque = bench.twin().observe().torque;
        // The torque's ripple and cogging besides.
        prop_assert!((torque - share * stall).abs() <= 0.02 * stall + 0.006, "{torque}");
        let amperes = share * motor.continuous_torque / motor.torque_constant;
        for (sub, expected) in [(1, amperes), (3, amperes.abs()), (0x10, amperes)] {
            let current = 0.01 * signed(&mut bench, 0x301E, sub);
            prop_assert!((current - expected).abs() < 0.0151, "301Eh:{sub:X} {current} {expected}");
        }
        let load = signed(&mut bench, 0x301C, 0x1A);
        prop_assert!((load - 100.0 * share.abs()).abs() <= 1.0, "{load} %");
        prop_assert!((signed(&mut bench, 0x301C, 0x17) - load / 1.5).abs() <= 1.0);
        // At rest the voltage is that on the winding.
        let voltage = 0.1 * signed(&mut bench, 0x301E, 4);
        prop_assert!((voltage - amperes * motor.resistance).abs() < 0.3, "{voltage}");
        prop_assert_eq!(bench.number(1, 0x300D, 0x0D), (200.0 * motor.resistance).round() as u32);
        prop_assert_eq!(bench.number(1, 0x300D, 0x0C), (motor.rotor_inertia * 1e7).round() as u32);
        let most = motor.peak_torque / motor.torque_constant;
        for (index, sub) in [(0x300D, 6), (0x3010, 2), (0x301C, 0x27), (0x301C, 0x28)] {
            prop_assert_eq!(bench.number(1, index, sub), (100.0 * most).round() as u32);
        }
    }
}

/// Temperatures follow I²t (2511-2513, 2517-2522); power is torque times speed (2508).
#[test]
fn a_loaded_motor_grows_warm_and_a_turning_one_gives_power() {
    let mut bench = with(Motor::default());
    let read = |bench: &mut Bench, sub| signed(bench, 0x301C, sub);
    assert_eq!(
        [0x10, 0x11, 0x12].map(|sub| read(&mut bench, sub)),
        [25.0; 3]
    );
    set(&mut bench, 0x6071, 0, 300);
    bench.wait(ms(50));
    let seen = bench.twin().observe();
    let power = seen.torque * seen.velocity * std::f64::consts::TAU;
    assert!(power > 5.0 && (read(&mut bench, 0x0D) - power).abs() < 0.2 * power);
    bench.twin().shaft_mut().unwrap().block(true);
    set(&mut bench, 0x6071, 0, 2000);
    bench.wait(ms(8000));
    let overload = read(&mut bench, 0x19);
    assert!(overload > 50.0);
    let warm = 25.0 + 1.05 * overload;
    assert!((read(&mut bench, 0x11) - warm).abs() <= 1.5);
    assert!(read(&mut bench, 0x10) > 80.0);
    assert_eq!(read(&mut bench, 0x12), 25.0);
}

/// The limits that hold now (2529-2531), of current and velocity.
#[test]
fn limits_that_hold_are_told() {
    let mut bench = drive(3);
    set(&mut bench, 0x3011, 0x0C, 100);
    set(&mut bench, 0x3011, 0x10, 321);
    assert_eq!(bench.number(1, 0x301C, 0x28), 100);
    assert_eq!(bench.number(1, 0x301C, 0x29), 321);
    // 1 A at 0.8 N·m/A, of 1.4 N·m.
    assert_eq!(bench.number(1, 0x301C, 0x1E), 571);
    assert_eq!(bench.number(1, 0x301C, 0x27), 525);
    assert_eq!(bench.number(1, 0x300D, 0x16), 140);
}

/// 301Ch:7 while an error or a message is there, 301Ch:8 from then on until it is reset (2500, 2501).
#[test]
fn what_is_monitored_is_told_until_it_is_reset() {
    let mut bench = drive(3);
    let signals = |bench: &mut Bench| [7, 8].map(|sub| bench.number(1, 0x301C, sub));
    assert_eq!(signals(&mut bench), [0, 0]);
    bench.twin().disturb(Disturbance::Mains(false));
    bench.wait(ms(5));
    assert_eq!(signals(&mut bench), [1, 1]);
    bench.twin().disturb(Disturbance::Mains(true));
    bench.wait(ms(100));
    assert_eq!(signals(&mut bench), [1, 1]);
    bench.controlword(1, 0x0080);
    assert_eq!(signals(&mut bench), [0, 0]);
    // A message goes by itself, and stays remembered: a blocked shaft away from its reference.
    let mut bench = drive(3);
    set(&mut bench, 0x3006, 0x29, 1);
    bench.twin().shaft_mut().unwrap().block(true);
    set(&mut bench, 0x60FF, 0, 60);
    bench.wait(ms(200));
    assert_eq!(signals(&mut bench), [1, 1]);
    set(&mut bench, 0x60FF, 0, 0);
    bench.twin().shaft_mut().unwrap().block(false);
    bench.wait(ms(2000));
    assert_eq!(signals(&mut bench), [0, 1]);
    bench.controlword(1, 0x008F);
    assert_eq!(signals(&mut bench), [0, 0]);
}

/// A heavy load is driven and braked: its power, and what the braking resistor takes of it (2509, 2514-2516).
#[test]
fn the_braking_resistor_takes_what_a_heavy_load_gives_back() {
    let load = 0.012;
    let config = Config {
        axis: Some(DrivenAxis {
            motor: Motor::default(),
            train: DriveTrain {
                load_inertia: load,
                ..DriveTrain::default()
            },
        }),
        ..Config::new(id(1))
    };
    let mut bench = enabled(TwinConfig::from(&config), 3);
    let read = |bench: &mut Bench, sub| signed(bench, 0x301C, sub);
    set(&mut bench, 0x6083, 0, 2000);
    set(&mut bench, 0x6084, 0, 2000);
    set(&mut bench, 0x60FF, 0, 2000);
    bench.wait(ms(1000));
    assert!(read(&mut bench, 0x0E) > 20.0);
    assert_eq!(
        [0x13, 0x14, 0x15].map(|sub| read(&mut bench, sub)),
        [0.0; 3]
    );
    bench.wait(ms(1000));
    set(&mut bench, 0x60FF, 0, 0);
    let (mut most, mut loaded) = (0.0_f64, 0.0_f64);
    for _ in 0..150 {
        bench.wait(ms(10));
        most = most.max(read(&mut bench, 0x13));
        loaded = loaded.max(read(&mut bench, 0x14));
    }
    // The energy of the load, over what it takes 20 s to shed.
    let speed = 2000.0 / 60.0 * std::f64::consts::TAU;
    let expected = 100.0 * 0.5 * load * speed * speed / (100.0 * 20.0);
    assert!(
        most > 0.3 * expected && most < expected,
        "{most} % of at most {expected} %"
    );
    assert!(loaded > 50.0, "{loaded} %");
    assert_eq!(read(&mut bench, 0x15), most);
    assert_eq!(bench.number(1, 0x3010, 9), 100);
    bench.wait(ms(60_000));
    assert_eq!(read(&mut bench, 0x13), 0.0);
    assert_eq!(read(&mut bench, 0x15), most);
}

/// The error memory has what was measured as the error came (2677-2687), until it is cleared (2669).
#[test]
fn an_error_is_remembered_with_what_was_measured() {
    let mut bench = drive(3);
    let entry =
        |bench: &mut Bench| [1, 2, 5, 6, 7, 8, 9, 0xA, 0xB].map(|sub| bench.number(1, 0x303C, sub));
    assert_eq!(entry(&mut bench), [0; 9]);
    bench.controlword(1, 0x0000);
    bench.wait(ms(2000));
    for word in [0x0006, 0x000F] {
        bench.controlword(1, word);
    }
    set(&mut bench, 0x60FF, 0, 1000);
    bench.wait(ms(3500));
    let current = bench.twin().observe().torque.abs() / 0.8;
    bench
        .twin()
        .disturb(Disturbance::Fault(ErrorClass::SwitchOff));
    bench.wait(ms(1));
    let bus = bench.number(1, 0x301C, 0x0F);
    let [
        number,
        class,
        cycles,
        time,
        voltage,
        velocity,
        amperes,
        stage,
        device,
    ] = entry(&mut bench);
    assert_eq!((number, class, cycles), (0xA320, 3, 2));
    assert_eq!((time, voltage, stage, device), (3, bus, 25, 25));
    assert!(velocity.abs_diff(1000) <= 1, "{velocity}");
    let amperes = 0.01 * f64::from(amperes);
    assert!((amperes - current).abs() < 0.03, "{amperes} {current}");
    set(&mut bench, 0x303B, 4, 1);
    assert_eq!(entry(&mut bench), [0; 9]);
    assert_eq!(bench.number(1, 0x303C, 3), 0);
}

/// The reference's velocity and acceleration that are fed forward (2572, 2573).
#[test]
fn what_is_fed_forward_is_told() {
    let mut bench = drive(3);
    set(&mut bench, 0x6083, 0, 3000);
    set(&mut bench, 0x60FF, 0, 1500);
    bench.wait(ms(300));
    let told = |bench: &mut Bench, sub| signed(bench, 0x301F, sub);
    let velocity = told(&mut bench, 7);
    assert!((velocity - 900.0).abs() <= 10.0, "{velocity}");
    assert!((told(&mut bench, 9) - 3000.0).abs() <= 30.0);
    bench.wait(ms(500));
    assert_eq!([7, 9].map(|sub| told(&mut bench, sub)), [1500.0, 0.0]);
}
