//! Between the torque that the speed loop asks for and the one at the shaft: current loop, voltage,
//! DC bus, overload, and what the motor does not do evenly.
//!
//! Seen from a phase, in effective values, a synchronous motor is a resistance, an inductance and a
//! voltage that its rotation induces:
//!
//! ```text
//! u = R i + L di/dt + e ω        torque = kₜ i        e = kₜ / 3
//! ```
//!
//! (three phases of power `e ω i` are the mechanical power `kₜ i ω`). The current loop asks for the
//! voltage with which the current closes on its reference as `e^(−ω_c t)`: a PI controller whose zero
//! cancels the winding's pole. Under a voltage that is constant in a step the current is known exactly;
//! where the DC bus does not give that voltage, the current is what it gives. So torque falls with
//! speed where the back-EMF comes near to the bus.
//!
//! The DC bus is a capacitor that the mains hold at its nominal voltage from below. Braking charges it;
//! above a threshold the braking resistor takes energy out of it.
//!
//! Overload (I²t) is a temperature over its limit: it follows the square of the current over the
//! continuous one with a time constant. At 1 the current is limited to the continuous one, until it has
//! fallen by `HYSTERESIS`.

use super::motor::Motor;
use super::shaft::Shaft;
use core::f64::consts::TAU;

/// How far an overload has to fall until the peak current is there again.
const HYSTERESIS: f64 = 0.05;

/// Bandwidth of the current loop, rad/s: 1 kHz, an assumption.
pub const CURRENT_BANDWIDTH: f64 = TAU * 1000.0;

/// A power supply with its capacitor and its braking resistor. Defaults are those of a drive of some
/// kilowatts at 400 V: assumptions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcBus {
    /// What the mains hold it at, V.
    pub nominal: f64,
    /// F.
    pub capacitance: f64,
    /// Above it the resistor is on, V; it is off again 10 V lower.
    pub braking: f64,
    /// Of the braking resistor, Ω.
    pub resistance: f64,
    /// Above it the drive has to switch off, V.
    pub most: f64,
}

impl Default for DcBus {
    fn default() -> Self {
        Self {
            nominal: 560.0,
            capacitance: 390e-6,
            braking: 780.0,
            resistance: 70.0,
            most: 820.0,
        }
    }
}

/// I²t of something that current heats.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overload {
    /// What it stands forever, A.
    continuous: f64,
    /// s.
    time_constant: f64,
    /// 1 is the limit.
    level: f64,
    is_over: bool,
}

impl Overload {
    /// Cold.
    #[must_use]
    pub fn new(continuous: f64, time_constant: f64) -> Self {
        Self {
            continuous,
            time_constant,
            level: 0.0,
            is_over: false,
        }
    }

    /// A current flows for a time that is short beside the time constant.
    pub fn heat(&mut self, current: f64, dt: f64) {
        let load = current / self.continuous;
        self.level += (load * load - self.level) * (dt / (self.time_constant + dt));
        let end = if self.is_over { 1.0 - HYSTERESIS } else { 1.0 };
        self.is_over = self.level >= end;
    }

    /// Of 1.
    #[must_use]
    pub fn level(&self) -> f64 {
        self.level
    }

    /// Most current that it allows now, A, out of a peak one.
    #[must_use]
    pub fn limit(&self, peak: f64) -> f64 {
        if self.is_over {
            self.continuous.min(peak)
        } else {
            peak
        }
    }
}

/// Current loop, supply and motor of a drive.
#[derive(Clone, Debug)]
pub struct PowerStage {
    motor: Motor,
    bus: DcBus,
    /// V.
    voltage: f64,
    is_braking: bool,
    /// Energy that the braking resistor has taken, J.
    braked: f64,
    /// A.
    current: f64,
    /// At a phase, V, effective.
    applied: f64,
    of_motor: Overload,
    of_drive: Overload,
    is_limited: bool,
    /// What a step of `h` leaves of the current, and what of it a volt makes.
    h: f64,
    fades: f64,
    admittance: f64,
    /// Share of the way to its reference that the current goes in a step.
    closes: f64,
}

impl PowerStage {
    /// What it stands forever, of the motor's continuous current: an assumption.
    pub const CONTINUOUS_SHARE: f64 = 1.5;

    /// A power stage that fits the motor, its supply charged.
    #[must_use]
    pub fn new(motor: Motor, bus: DcBus) -> Self {
        let continuous = motor.continuous_torque / motor.torque_constant;
        Self {
            voltage: bus.nominal,
            is_braking: false,
            braked: 0.0,
            current: 0.0,
            applied: 0.0,
            of_motor: Overload::new(continuous, motor.thermal_time),
            // It is made for the motor's peak for a few seconds.
            of_drive: Overload::new(Self::CONTINUOUS_SHARE * continuous, 4.0),
            is_limited: false,
            h: 0.0,
            fades: 0.0,
            admittance: 0.0,
            closes: 0.0,
            motor,
            bus,
        }
    }

    /// Most torque that the current may make now, N·m.
    #[must_use]
    pub fn torque_limit(&self) -> f64 {
        let peak = self.motor.peak_torque / self.motor.torque_constant;
        let limit = self.of_motor.limit(peak).min(self.of_drive.limit(peak));
        limit * self.motor.torque_constant
    }

    /// Whether the current stays behind its reference for want of voltage.
    #[must_use]
    pub fn is_voltage_limited(&self) -> bool {
        self.is_limited
    }

    /// The motor at it.
    #[must_use]
    pub fn motor(&self) -> &Motor {
        &self.motor
    }

    /// Its supply.
    #[must_use]
    pub fn bus(&self) -> &DcBus {
        &self.bus
    }

    /// Through the motor, A, effective.
    #[must_use]
    pub fn current(&self) -> f64 {
        self.current
    }

    /// At a phase of the motor, V, effective.
    #[must_use]
    pub fn phase_voltage(&self) -> f64 {
        self.applied
    }

    /// What the DC bus gives a phase at most, V: effective, of a sinusoidal one.
    #[must_use]
    pub fn phase_voltage_most(&self) -> f64 {
        self.voltage / 6.0_f64.sqrt()
    }

    /// Of the DC bus, V.
    #[must_use]
    pub fn voltage(&self) -> f64 {
        self.voltage
    }

    /// Whether the DC bus has more than it may.
    #[must_use]
    pub fn has_overvoltage(&self) -> bool {
        self.voltage > self.bus.most
    }

    /// I²t of the motor and of the drive, of 1.
    #[must_use]
    pub fn overloads(&self) -> [f64; 2] {
        [self.of_motor.level(), self.of_drive.level()]
    }

    /// Energy that the braking resistor has taken, J.
    #[must_use]
    pub fn braked(&self) -> f64 {
        self.braked
    }

    /// Torque at the shaft during a step of `h` seconds, N·m, where `wanted` is asked for; the shaft
    /// is at `position` revolutions and turns with `velocity` rev/s.
    pub fn step(&mut self, wanted: f64, position: f64, velocity: f64, h: f64) -> f64 {
        let Motor {
            torque_constant,
            resistance,
            inductance,
            cogging,
            cogging_periods,
            ripple,
            pole_pairs,
            ..
        } = self.motor;
        if self.h != h {
            self.h = h;
            self.fades = libm::exp(-resistance * h / inductance);
            self.admittance = (1.0 - self.fades) / resistance;
            self.closes = 1.0 - libm::exp(-CURRENT_BANDWIDTH * h);
        }
        let before = self.current;
        let target = before + self.closes * (wanted / torque_constant - before);
        let induced = torque_constant / 3.0 * velocity * TAU;
        let asked = (target - self.fades * before) / self.admittance + induced;
        let most = self.phase_voltage_most();
        let voltage = asked.clamp(-most, most);
        self.is_limited = voltage != asked;
        self.applied = voltage;
        self.current = match self.is_limited {
            true => self.fades * before + self.admittance * (voltage - induced),
            false => target,
        };
        let mean = 0.5 * (before + self.current);
        self.of_motor.heat(mean, h);
        self.of_drive.heat(mean, h);
        self.supply(3.0 * voltage * mean, h);
        let place = |periods: f64| {
            let phase = position * periods;
            libm::sin(TAU * (phase - phase.floor()))
        };
        let mut torque = torque_constant * mean;
        if ripple != 0.0 {
            // Six times for each pair of poles, as the commutation's harmonics have it.
            torque *= 1.0 + ripple * place(6.0 * f64::from(pole_pairs));
        }
        if cogging != 0.0 {
            torque += cogging * place(f64::from(cogging_periods));
        }
        torque
    }

    /// The power stage is off: no current.
    pub fn off(&mut self, h: f64) {
        self.current = 0.0;
        self.applied = 0.0;
        self.is_limited = false;
        self.of_motor.heat(0.0, h);
        self.of_drive.heat(0.0, h);
        self.supply(0.0, h);
    }

    /// The motor takes a power from the DC bus, W, for a step.
    fn supply(&mut self, power: f64, h: f64) {
        let DcBus {
            nominal,
            capacitance,
            braking,
            resistance,
            ..
        } = self.bus;
        if power >= 0.0 && self.voltage <= nominal {
            // The mains give what is taken.
            return;
        }
        self.is_braking = self.voltage
            > if self.is_braking {
                braking - 10.0
            } else {
                braking
            };
        let mut taken = power * h;
        if self.is_braking {
            let heat = self.voltage * self.voltage / resistance * h;
            self.braked += heat;
            taken += heat;
        }
        let square = self.voltage * self.voltage - 2.0 * taken / capacitance;
        self.voltage = square.max(nominal * nominal).sqrt();
    }
}

/// What makes torque of what the loops ask for.
#[derive(Clone, Debug, Default)]
pub enum TorqueSource {
    /// Just that torque, at once: where nothing is known of motor and supply.
    #[default]
    Ideal,
    /// A power stage with its motor.
    PowerStage(Box<PowerStage>),
}

impl From<PowerStage> for TorqueSource {
    fn from(stage: PowerStage) -> Self {
        Self::PowerStage(Box::new(stage))
    }
}

impl TorqueSource {
    /// The power stage, if it is one.
    #[must_use]
    pub fn power_stage(&self) -> Option<&PowerStage> {
        match self {
            Self::Ideal => None,
            Self::PowerStage(stage) => Some(stage),
        }
    }

    /// Torque at a shaft during a step of `h` seconds, N·m; none while it is off.
    pub fn step(&mut self, wanted: f64, is_on: bool, shaft: &Shaft, h: f64) -> f64 {
        match self {
            Self::Ideal => wanted,
            Self::PowerStage(stage) if is_on => {
                stage.step(wanted, shaft.position(), shaft.velocity(), h)
            }
            Self::PowerStage(stage) => {
                stage.off(h);
                0.0
            }
        }
    }

    /// Whether the torque stays behind what is asked for.
    #[must_use]
    pub fn is_limited(&self) -> bool {
        self.power_stage()
            .is_some_and(PowerStage::is_voltage_limited)
    }

    /// Most torque that it makes now, N·m.
    #[must_use]
    pub fn torque_limit(&self) -> f64 {
        self.power_stage()
            .map_or(f64::INFINITY, PowerStage::torque_limit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const H: f64 = 62.5e-6;

    fn smooth() -> PowerStage {
        let motor = Motor {
            cogging: 0.0,
            ripple: 0.0,
            ..Motor::default()
        };
        PowerStage::new(motor, DcBus::default())
    }

    #[test]
    fn current_closes_on_its_reference_as_the_exponential() {
        let mut stage = smooth();
        for k in 1..=16 {
            stage.step(1.0, 0.0, 0.0, H);
            let expected = 1.0 - libm::exp(-CURRENT_BANDWIDTH * f64::from(k) * H);
            let found = stage.current * stage.motor.torque_constant;
            assert!((found - expected).abs() < 1e-12, "step {k}: {found}");
        }
    }

    #[test]
    fn what_voltage_is_left_bounds_how_fast_current_rises_and_how_fast_a_motor_turns() {
        let mut stage = smooth();
        let Motor {
            torque_constant,
            resistance,
            inductance,
            peak_torque,
            ..
        } = stage.motor;
        // So little voltage is left at this speed: the current rises as the winding lets it.
        let most = 560.0 / 6.0_f64.sqrt();
        let velocity = (most - 5.0) / (torque_constant / 3.0 * TAU);
        for k in 1..=200 {
            stage.step(peak_torque, 0.0, velocity, H);
            assert!(stage.is_voltage_limited());
            let t = f64::from(k) * H;
            let expected = 5.0 / resistance * (1.0 - libm::exp(-resistance * t / inductance));
            assert!((stage.current / expected - 1.0).abs() < 1e-9);
        }
        // Beyond the speed at which the back-EMF is the whole voltage it can only brake.
        let torque = (0..4000)
            .map(|_| {
                stage.step(
                    peak_torque,
                    0.0,
                    1.02 * most / (torque_constant / 3.0 * TAU),
                    H,
                )
            })
            .last();
        assert!(torque.is_some_and(|torque| torque < 0.0));
    }

    #[test]
    fn overload_limits_after_the_time_of_its_closed_form() {
        for factor in [1.5, 2.0, 3.0] {
            let mut overload = Overload::new(2.0, 30.0);
            let dt = 1e-3;
            let until = (1..).find(|_| {
                overload.heat(2.0 * factor, dt);
                overload.limit(6.0) < 6.0
            });
            // x² (1 − e^(−t/T)) = 1.
            let expected = -30.0 * libm::log(1.0 - 1.0 / (factor * factor));
            let found = f64::from(until.unwrap()) * dt;
            assert!((found / expected - 1.0).abs() < 1e-3, "{found} {expected}");
            overload.heat(2.0, dt);
            assert_eq!(overload.limit(6.0), 2.0);
            (0..2_000).for_each(|_| overload.heat(0.0, dt));
            assert_eq!(overload.limit(6.0), 6.0);
        }
    }

    #[test]
    fn braking_charges_the_bus_and_the_resistor_holds_it() {
        let mut stage = smooth();
        let DcBus {
            nominal,
            capacitance,
            braking,
            ..
        } = stage.bus;
        // Until the resistor is on, all energy is in the capacitor.
        let mut energy = 0.0;
        while stage.voltage < braking - 1.0 {
            stage.supply(-500.0, H);
            energy += 500.0 * H;
        }
        let stored = 0.5 * capacitance * (stage.voltage * stage.voltage - nominal * nominal);
        assert!((stored / energy - 1.0).abs() < 1e-9);
        (0..32_000).for_each(|_| stage.supply(-500.0, H));
        assert!(!stage.has_overvoltage() && stage.voltage > braking - 20.0);
        let stored = 0.5 * capacitance * (stage.voltage * stage.voltage - nominal * nominal);
        energy += 500.0 * H * 32_000.0;
        assert!(((stored + stage.braked()) / energy - 1.0).abs() < 1e-9);
        // More than the resistor can take.
        (0..32_000).for_each(|_| stage.supply(-20_000.0, H));
        assert!(stage.has_overvoltage());
    }

    #[test]
    fn cogging_is_there_without_current_and_adds_to_nothing_over_a_revolution() {
        let motor = Motor {
            cogging: 0.02,
            ripple: 0.0,
            ..Motor::default()
        };
        let mut stage = PowerStage::new(motor, DcBus::default());
        let torques: Vec<f64> = (0..3600)
            .map(|k| stage.step(0.0, f64::from(k) / 3600.0, 0.0, H))
            .collect();
        let most = torques.iter().fold(0.0_f64, |most, it| most.max(it.abs()));
        assert!((most - 0.02).abs() < 1e-4, "{most}");
        assert!(torques.iter().sum::<f64>().abs() < 1e-9);
    }
}
