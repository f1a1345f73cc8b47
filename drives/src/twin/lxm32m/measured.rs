//! What the drive knows of its motor and power stage, and what it measures of them (lxm32m 2372-2406, 2505-2567).
//! The manual at hand prints names: units are assumptions, the figures those of the simulated motor and its
//! supply.

use super::drive::Drive;
use super::units::INCREMENTS_PER_REVOLUTION;
use crate::dictionary::lxm32m_units::CURRENT;
use crate::twin::rounding::nearest;
use crate::twin::servo::firmware::ServoFirmware;
use crate::twin::servo::motor::Motor;
use crate::twin::servo::power_stage::{DcBus, PowerStage};
use core::f64::consts::TAU;
use syncline_canopen::Instant;
use syncline_canopen::dictionary::Row;

/// Units: 0.1 V, 0.01 Ω, 0.01 mH, 0.01 N·m, g·cm², rev/s of an rpm, a millisecond, of 1 %.
const VOLTAGE: f64 = 0.1;
const RESISTANCE: f64 = 0.01;
const INDUCTANCE: f64 = 1e-5;
const TORQUE: f64 = 0.01;
const INERTIA: f64 = 1e-7;
const RPM: f64 = 1.0 / 60.0;
const TIME: f64 = 1e-3;
const PERCENT: f64 = 0.01;

/// Temperatures, °C: of what is cold, and of motor and power stage whose I²t is at 100 %; the power stage
/// warns before.
const AMBIENT: f64 = 25.0;
const MOTOR_MOST: f64 = 130.0;
const STAGE_MOST: f64 = 100.0;
const STAGE_WARNING: f64 = 90.0;

/// Revolutions that the encoder tells apart.
const TURNS: i64 = 4096;

/// What the braking resistor stands for ever, W, and in how long it grows warm, s: assumptions, of a small built-in one.
const RESISTOR_POWER: f64 = 100.0;
const RESISTOR_TIME: f64 = 20.0;

/// The time constant of the mean output power and of the resistor's load, s: an assumption.
const POWER_TIME: f64 = 1.0;

/// What is a mean over time, as of an instant.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Means {
    at: Instant,
    /// What the braking resistor had taken by then, J.
    braked: f64,
    /// What it takes in the mean, W, and its I²t, of 1.
    resistor_power: f64,
    resistor_overload: f64,
    /// Mean output power, W.
    power: f64,
}

impl Means {
    /// Comes to an instant, at which the motor gives that power, and the resistor has taken so much.
    fn advance(&mut self, now: Instant, power: f64, braked: f64) {
        if now <= self.at {
            return;
        }
        let dt = (now - self.at).as_secs_f64();
        self.at = now;
        let braking = (braked - self.braked) / dt;
        self.braked = braked;
        let share = |time: f64| 1.0 - libm::exp(-dt / time);
        let lately = share(POWER_TIME);
        self.power += (power - self.power) * lately;
        // Most resistors have nothing to do, and had nothing.
        if braking != 0.0 || self.resistor_power != 0.0 || self.resistor_overload != 0.0 {
            self.resistor_power += (braking - self.resistor_power) * lately;
            let load = braking / RESISTOR_POWER;
            self.resistor_overload += (load - self.resistor_overload) * share(RESISTOR_TIME);
        }
    }
}

impl Drive {
    fn stage(&self) -> Option<&PowerStage> {
        self.servo.loops.torque_source.power_stage()
    }

    /// The figures of motor and power stage: those of the default motor where nothing is known of it.
    pub(super) fn publish_figures(&mut self) {
        let rows = self.rows;
        let (motor, bus) = self.stage().map_or_else(
            || (Motor::default(), DcBus::default()),
            |stage| (*stage.motor(), *stage.bus()),
        );
        let gains = &self.own_gains;
        let constant = gains.torque_constant;
        let [continuous, peak] = [gains.continuous_torque, gains.torque_limit];
        let speed = |resistive: f64| {
            let drop = motor.resistance * resistive / constant * 6.0_f64.sqrt();
            motor.no_load_speed((bus.nominal - drop).max(0.0))
        };
        // Of a phase, between two terminals, of 1000 rpm.
        let induced = constant / 3.0 * 3.0_f64.sqrt() * TAU * 1000.0 * RPM;
        let share = continuous / peak;
        let peak_time = -motor.thermal_time * libm::log(1.0 - share * share);
        let braked = i64::from(motor.brake_torque > 0.0);
        let closing = self.brake_closing.as_millis() as f64;
        let figures = [
            (rows.motor_speed_most, speed(0.0), RPM),
            (rows.motor_speed_nominal, speed(continuous), RPM),
            (rows.motor_current_most, peak / constant, CURRENT),
            (rows.motor_current_nominal, continuous / constant, CURRENT),
            (rows.motor_torque_nominal, continuous, TORQUE),
            (rows.motor_torque_most, peak, TORQUE),
            (rows.motor_voltage_nominal, bus.nominal, VOLTAGE),
            (rows.motor_voltage_constant, induced, VOLTAGE),
            (rows.motor_inertia, motor.rotor_inertia, INERTIA),
            (rows.motor_resistance, 2.0 * motor.resistance, RESISTANCE),
            (rows.motor_inductance_q, motor.inductance, INDUCTANCE),
            (rows.motor_inductance_d, motor.inductance, INDUCTANCE),
            (rows.motor_temperature_most, MOTOR_MOST, 1.0),
            (rows.motor_peak_time, peak_time, TIME),
            (rows.motor_current_stall, continuous / constant, CURRENT),
            (rows.motor_pole_pairs, motor.pole_pairs.into(), 1.0),
            (rows.motor_torque_stall, continuous, TORQUE),
            (rows.motor_voltage_most, bus.most, VOLTAGE),
            (rows.motor_brake, braked as f64, 1.0),
            (rows.motor_brake_closing, closing, 1.0),
            (
                rows.stage_current_nominal,
                PowerStage::CONTINUOUS_SHARE * continuous / constant,
                CURRENT,
            ),
            (rows.stage_current_most, peak / constant, CURRENT),
            (rows.stage_voltage_most, bus.most, VOLTAGE),
            (rows.stage_temperature_warning, STAGE_WARNING, 1.0),
            (rows.stage_temperature_most, STAGE_MOST, 1.0),
            (rows.resistor_resistance, bus.resistance, RESISTANCE),
            (rows.resistor_power, RESISTOR_POWER, 1.0),
            (rows.system_current_most, peak / constant, CURRENT),
        ];
        for (row, value, unit) in figures {
            self.show(row, value, unit);
        }
    }

    /// Torque of the motor in the direction of movement, N·m.
    pub(super) fn torque_of_motor(&self) -> f64 {
        self.servo.loops.torque() * self.servo.loops.direction()
    }

    /// Power that the motor gives, W.
    fn power(&self) -> f64 {
        self.torque_of_motor() * (self.actual_velocity() / INCREMENTS_PER_REVOLUTION) * TAU
    }

    /// Brings up to date what is a mean or a maximum over time.
    pub(super) fn publish_over_time(&mut self) {
        let power = self.power();
        let braked = self.stage().map_or(0.0, PowerStage::braked);
        self.means.advance(self.servo.now, power, braked);
        if self.stage().is_some() {
            let overload = self.means.resistor_overload;
            self.show(self.rows.resistor_overload, overload, PERCENT);
            self.publish_stage();
        }
    }

    /// Brings up to date what is measured, and the limits that hold.
    pub(super) fn publish_measured(&mut self) {
        self.publish_over_time();
        let rows = self.rows;
        let gains = self.servo.loops.cascade.gains();
        let [constant, continuous] = [gains.torque_constant, gains.continuous_torque];
        let torque = self.torque_of_motor();
        let direction = self.servo.loops.direction();
        let wanted = self.servo.loops.cascade.torque() / constant;
        let limit = self.torque_limit().min(gains.torque_limit);
        let of_stage = |stage: &PowerStage| direction * stage.current();
        let current = self.stage().map_or(torque / constant, of_stage);
        let load = current.abs() * constant / continuous;
        let most = gains.speed_limit * INCREMENTS_PER_REVOLUTION;
        let power = self.power();
        let Means {
            resistor_power,
            resistor_overload,
            power: mean,
            ..
        } = self.means;
        let encoder = self.servo.loops.encoder;
        let within = encoder.rem_euclid(TURNS * INCREMENTS_PER_REVOLUTION as i64);
        let shown = [
            (rows.current_q, current, CURRENT),
            (rows.current, current.abs(), CURRENT),
            (rows.current_q_reference, wanted, CURRENT),
            (rows.power, power, 1.0),
            (rows.power_mean, mean.max(0.0), 1.0),
            (rows.resistor_load, resistor_power / RESISTOR_POWER, PERCENT),
            (rows.resistor_overload, resistor_overload, PERCENT),
            (rows.motor_load, load, PERCENT),
            (
                rows.stage_load,
                load / PowerStage::CONTINUOUS_SHARE,
                PERCENT,
            ),
            (rows.current_limit_active, limit / constant, CURRENT),
            (rows.torque_most, limit / continuous, 0.1 * PERCENT),
            (
                rows.velocity_limit_active,
                self.user_velocity(most) as f64,
                1.0,
            ),
            (
                rows.encoder_absolute,
                self.user_position(within) as f64,
                1.0,
            ),
            (rows.device_temperature, AMBIENT, 1.0),
            (rows.operating_time, self.servo.now.as_nanos() as f64, 1e9),
        ];
        for (row, value, unit) in shown {
            self.show(row, value, unit);
        }
        self.publish_stage();
    }

    /// DC bus, voltage, I²t of power stage and motor with their peaks, and temperatures that follow it.
    fn publish_stage(&mut self) {
        let rows = self.rows;
        let [motor, drive] = self.stage().map_or([0.0; 2], PowerStage::overloads);
        let warm = |level: f64, most: f64| AMBIENT + level * (most - AMBIENT);
        self.show(rows.motor_temperature, warm(motor, MOTOR_MOST), 1.0);
        self.show(rows.stage_temperature, warm(drive, STAGE_MOST), 1.0);
        let Some(stage) = self.stage() else {
            return;
        };
        let (bus, applied) = (
            stage.voltage(),
            self.servo.loops.direction() * stage.phase_voltage(),
        );
        let most = stage.phase_voltage_most();
        for (row, value, unit) in [
            (rows.bus_voltage, bus, VOLTAGE),
            (rows.voltage_q, applied, VOLTAGE),
            (rows.phase_voltage, applied.abs(), VOLTAGE),
            (rows.voltage_used, applied.abs() / most, PERCENT),
            (rows.motor_overload, motor, PERCENT),
            (rows.drive_overload, drive, PERCENT),
        ] {
            self.show(row, value, unit);
        }
        for [now, peak] in [
            [rows.motor_overload, rows.motor_overload_peak],
            [rows.drive_overload, rows.drive_overload_peak],
            [rows.resistor_overload, rows.resistor_overload_peak],
        ] {
            let most = self.objects.get(now).max(self.objects.get(peak));
            self.objects.set(peak, most);
        }
    }

    /// A value in a row that counts it in `unit`, to the nearest.
    fn show(&mut self, row: Row, value: f64, unit: f64) {
        self.objects.set(row, nearest(value / unit));
    }
}
