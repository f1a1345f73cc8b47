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
//! That voltage is in phase with the current. The current in the inductance of the turning phases takes another one, `p ω L i`
//! with `p` pairs of poles, a quarter of a period before it, so that at most `√(u² − (p ω L i)²)` is left of the bus' `u`. What a
//! current does not change of that within a step is left out of its exactness. A reference that the bus could not hold is brought
//! to the nearest current that it can, driving or braking: a root of `(R i + e ω)² + (p ω L i)² = u²`. Where none is left, the
//! motor turning too fast for its bus, the current is that of a motor with its phases shorted.
//!
//! The DC bus is a capacitor that the mains hold at its nominal voltage from below. Braking charges it;
//! above a threshold the braking resistor takes energy out of it. Without mains a motor that drives takes it from the capacitor, and
//! what discharges that takes the rest.
//!
//! Where the DC buses of several drives are joined ([`Joined`]), they have one voltage: what one brakes another takes, and the resistors of
//! all share what is left. Between two points of the world's grid each goes on by itself, so that its voltage is off the
//! common one by at most what its own power makes of it in that time, P h / (C U): 1.4 V for 5 kW.
//!
//! Overload (I²t) is a temperature over its limit: it follows the square of the current over the
//! continuous one with a time constant. At 1 the current is limited to the continuous one, until it has
//! fallen by `HYSTERESIS`.

use super::motor::Motor;
use super::shaft::Shaft;
use crate::twin::device::Supply;
use crate::twin::rounding::floor;
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
    /// Of what discharges the capacitor while there are no mains, Ω.
    pub discharge: f64,
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
            discharge: 100e3,
            most: 820.0,
        }
    }
}

/// DC buses that are joined.
#[derive(Clone, Copy, Debug, Default)]
pub struct Joined {
    /// F.
    capacitance: f64,
    /// J.
    energy: f64,
}

impl Joined {
    /// With that of one more.
    pub fn add(&mut self, stage: &PowerStage) {
        self.capacitance += stage.bus.capacitance;
        self.energy += 0.5 * stage.bus.capacitance * stage.square;
    }

    /// At which their capacitors have the energy together that they had apart, V; 0 of none.
    #[must_use]
    pub fn voltage(&self) -> f64 {
        match self.capacitance > 0.0 {
            true => (2.0 * self.energy / self.capacitance).sqrt(),
            false => 0.0,
        }
    }
}

/// I²t of something that current heats.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overload {
    /// What it stands forever, A, and the inverse of that.
    continuous: f64,
    inverse: f64,
    /// s.
    time_constant: f64,
    /// 1 is the limit.
    level: f64,
    is_over: bool,
    /// A time that passed, s, and the share of the way that the level goes in it.
    step: (f64, f64),
}

impl Overload {
    /// Cold.
    #[must_use]
    pub fn new(continuous: f64, time_constant: f64) -> Self {
        Self {
            continuous,
            inverse: 1.0 / continuous,
            time_constant,
            level: 0.0,
            is_over: false,
            step: (0.0, 0.0),
        }
    }

    /// A current flows for a time that is short beside the time constant.
    pub fn heat(&mut self, current: f64, dt: f64) {
        let load = current * self.inverse;
        if self.step.0 != dt {
            self.step = (dt, dt / (self.time_constant + dt));
        }
        self.level += (load * load - self.level) * self.step.1;
        let end = if self.is_over { 1.0 - HYSTERESIS } else { 1.0 };
        self.is_over = self.level >= end;
    }

    /// Of 1.
    #[must_use]
    pub fn level(&self) -> f64 {
        self.level
    }

    /// After which time a current whose square is this one's on average limits it, from cold, s; `None` where it stands that
    /// forever. Of one that varies in times that are short beside the time constant.
    #[must_use]
    pub fn lasts(&self, current: f64) -> Option<f64> {
        let load = current / self.continuous;
        (load > 1.0).then(|| -self.time_constant * libm::log(1.0 - 1.0 / (load * load)))
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
    /// Of the DC bus' voltage, V²: its energy goes by that, and roots take their time.
    square: f64,
    has_mains: bool,
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
    /// What a step of `h` leaves of the current, what of it a volt makes, and the inverse of that.
    h: f64,
    fades: f64,
    admittance: f64,
    impedance: f64,
    /// Share of the way to its reference that the current goes in a step.
    closes: f64,
}

impl PowerStage {
    /// What it stands forever, of the motor's continuous current: an assumption.
    pub const CONTINUOUS_SHARE: f64 = 1.5;

    /// A power stage that fits the motor, its supply charged.
    #[must_use]
    pub fn new(motor: Motor, bus: DcBus) -> Self {
        let [of_motor, of_drive] = overloads(&motor);
        Self {
            square: bus.nominal * bus.nominal,
            has_mains: true,
            is_braking: false,
            braked: 0.0,
            current: 0.0,
            applied: 0.0,
            of_motor,
            of_drive,
            is_limited: false,
            h: 0.0,
            fades: 0.0,
            admittance: 0.0,
            impedance: 0.0,
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

    /// At a phase of the motor, V, effective, in phase with the current.
    #[must_use]
    pub fn phase_voltage(&self) -> f64 {
        self.applied
    }

    /// What the DC bus gives a phase at most, V: effective, of a sinusoidal one.
    #[must_use]
    pub fn phase_voltage_most(&self) -> f64 {
        (self.square / 6.0).sqrt()
    }

    /// Of the DC bus, V.
    #[must_use]
    pub fn voltage(&self) -> f64 {
        self.square.sqrt()
    }

    /// Whether the DC bus has more than it may.
    #[must_use]
    pub fn has_overvoltage(&self) -> bool {
        self.square > self.bus.most * self.bus.most
    }

    /// I²t of the motor and of the drive, of 1.
    #[must_use]
    pub fn overloads(&self) -> [f64; 2] {
        [self.of_motor.level(), self.of_drive.level()]
    }

    /// What it is loaded with.
    #[must_use]
    pub fn supply_now(&self) -> Supply {
        let DcBus {
            nominal,
            capacitance,
            ..
        } = self.bus;
        let beyond = self.square - nominal * nominal;
        Supply {
            overloads: self.overloads(),
            voltage: self.voltage(),
            stored: 0.5 * capacitance * beyond.max(0.0),
            braked: self.braked,
        }
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
            self.impedance = 1.0 / self.admittance;
            self.closes = 1.0 - libm::exp(-CURRENT_BANDWIDTH * h);
        }
        let before = self.current;
        let reference = before + self.closes * (wanted * (1.0 / torque_constant) - before);
        let winding = Winding {
            resistance,
            reactance: f64::from(pole_pairs) * velocity * TAU * inductance,
            induced: torque_constant / 3.0 * velocity * TAU,
        };
        let (target, left) = winding.held(reference, self.square / 6.0);
        let asked = (target - self.fades * before) * self.impedance + winding.induced;
        let voltage = match asked * asked <= left {
            true => asked,
            false => asked.clamp(-left.sqrt(), left.sqrt()),
        };
        self.is_limited = voltage != asked || target != reference;
        self.applied = voltage;
        self.current = match voltage == asked {
            true => target,
            false => self.fades * before + self.admittance * (voltage - winding.induced),
        };
        let mean = 0.5 * (before + self.current);
        self.of_motor.heat(mean, h);
        self.of_drive.heat(mean, h);
        self.supply(3.0 * voltage * mean, h);
        let mut torque = torque_constant * mean;
        if ripple != 0.0 {
            // Six times for each pair of poles, as the commutation's harmonics have it.
            torque *= 1.0 + ripple * wave(position, 6 * pole_pairs);
        }
        if cogging != 0.0 {
            torque += cogging * wave(position, cogging_periods);
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

    /// Its DC bus has the voltage of those that it is [joined](Joined) to, V.
    pub fn join(&mut self, voltage: f64) {
        self.square = voltage * voltage;
    }

    /// The mains are there or not; they charge the DC bus at once.
    pub fn feed(&mut self, has_mains: bool) {
        self.has_mains = has_mains;
        if has_mains {
            let nominal = self.bus.nominal;
            self.square = self.square.max(nominal * nominal);
        }
    }

    /// The motor takes a power from the DC bus, W, for a step.
    fn supply(&mut self, power: f64, h: f64) {
        let DcBus {
            nominal,
            capacitance,
            braking,
            resistance,
            discharge,
            ..
        } = self.bus;
        if self.has_mains && power >= 0.0 && self.square <= nominal * nominal {
            // The mains give what is taken, also by drives that are joined to this one and have none.
            self.square = nominal * nominal;
            return;
        }
        let threshold = match self.is_braking {
            true => braking - 10.0,
            false => braking,
        };
        self.is_braking = self.square > threshold * threshold;
        let mut taken = power * h;
        let mut least = nominal;
        if !self.has_mains {
            taken += self.square / discharge * h;
            least = 0.0;
        }
        if self.is_braking {
            let heat = self.square / resistance * h;
            self.braked += heat;
            taken += heat;
        }
        self.square = (self.square - 2.0 * taken / capacitance).max(least * least);
    }
}

/// A phase of the motor at the speed that it has now.
struct Winding {
    /// Ω.
    resistance: f64,
    /// Of the inductance as the phases turn, `p ω L`, Ω.
    reactance: f64,
    /// V.
    induced: f64,
}

impl Winding {
    /// The current nearest to a reference, A, that a voltage holds at this speed, whose square is so many V², and the square of what
    /// that leaves of the voltage in phase with it: never less than what holds the current, so that it settles there and does not run
    /// away.
    fn held(&self, reference: f64, voltage: f64) -> (f64, f64) {
        let along = |current: f64| self.resistance * current + self.induced;
        let left = |current: f64| voltage - (self.reactance * current).powi(2);
        if along(reference).powi(2) <= left(reference) {
            return (reference, left(reference));
        }
        // Both resistance and reactance are of the whole phase's impedance; a motor has a resistance.
        let square = self.resistance.powi(2) + self.reactance.powi(2);
        let middle = -self.resistance * self.induced / square;
        let reach = square * voltage - (self.reactance * self.induced).powi(2);
        let reach = reach.max(0.0).sqrt() / square;
        let current = reference.clamp(middle - reach, middle + reach);
        (current, left(current).max(along(current).powi(2)))
    }
}

/// I²t of a motor and of the drive that fits it, cold.
fn overloads(motor: &Motor) -> [Overload; 2] {
    let continuous = motor.continuous_torque / motor.torque_constant;
    [
        Overload::new(continuous, motor.thermal_time),
        // It is made for the motor's peak for a few seconds.
        Overload::new(PowerStage::CONTINUOUS_SHARE * continuous, 4.0),
    ]
}

/// After which time a torque with this root mean square, N·m, limits a motor or the drive that fits it, as [`Overload::lasts`]
/// has it, s.
#[must_use]
pub fn lasts(motor: &Motor, torque: f64) -> Option<f64> {
    let current = torque / motor.torque_constant;
    let times = overloads(motor).into_iter();
    times
        .filter_map(|it| it.lasts(current))
        .min_by(f64::total_cmp)
}

/// A sine of the shaft's angle with so many periods in a revolution.
fn wave(position: f64, periods: u32) -> f64 {
    let phase = position * f64::from(periods);
    let turn = phase - floor(phase + 0.5);
    // Within a quarter of a period a few powers do, which are in all steps of a drive.
    let quarter = match turn.abs() > 0.25 {
        true => 0.5_f64.copysign(turn) - turn,
        false => turn,
    };
    let angle = TAU * quarter;
    let square = angle * angle;
    let powers = POWERS.iter().fold(0.0, |sum, power| sum * square + power);
    angle * powers
}

/// Of a sine, highest first: up to the 19th its error is 3·10⁻¹⁶ in a quarter of a period.
const POWERS: [f64; 10] = [
    -1.0 / 121_645_100_408_832_000.0,
    1.0 / 355_687_428_096_000.0,
    -1.0 / 1_307_674_368_000.0,
    1.0 / 6_227_020_800.0,
    -1.0 / 39_916_800.0,
    1.0 / 362_880.0,
    -1.0 / 5_040.0,
    1.0 / 120.0,
    -1.0 / 6.0,
    1.0,
];

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

    /// The same, to be joined to others.
    pub fn power_stage_mut(&mut self) -> Option<&mut PowerStage> {
        match self {
            Self::Ideal => None,
            Self::PowerStage(stage) => Some(stage),
        }
    }

    /// Whether it has its supply, as far as it knows one.
    pub fn feed(&mut self, has_mains: bool) {
        if let Self::PowerStage(stage) = self {
            stage.feed(has_mains);
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
    use super::super::motor::MOTORS;
    use super::*;
    use proptest::prelude::*;

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
    fn a_wave_is_a_sine() {
        for place in -4000..4000 {
            let position = f64::from(place) * 1.37e-3;
            let expected = libm::sin(TAU * (position * 7.0 - libm::floor(position * 7.0)));
            assert!((wave(position, 7) - expected).abs() < 2e-15, "{position}");
        }
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
        // Nothing of the voltage is across the current.
        stage.motor.pole_pairs = 0;
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
        // Beyond the speed at which the back-EMF is the whole voltage it can only brake, while what it brakes with does not
        // raise that voltage.
        stage.bus.capacitance = f64::INFINITY;
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
            let (dt, lasts) = (1e-3, overload.lasts(2.0 * factor).unwrap());
            assert_eq!(overload.lasts(2.0), None);
            let until = (1..).find(|_| {
                overload.heat(2.0 * factor, dt);
                overload.limit(6.0) < 6.0
            });
            // x² (1 − e^(−t/T)) = 1.
            let expected = -30.0 * libm::log(1.0 - 1.0 / (factor * factor));
            let found = f64::from(until.unwrap()) * dt;
            assert!((found / expected - 1.0).abs() < 1e-3, "{found} {expected}");
            assert!((lasts / expected - 1.0).abs() < 1e-9, "{lasts} {expected}");
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
        while stage.voltage() < braking - 1.0 {
            stage.supply(-500.0, H);
            energy += 500.0 * H;
        }
        let stored = 0.5 * capacitance * (stage.voltage() * stage.voltage() - nominal * nominal);
        assert!((stored / energy - 1.0).abs() < 1e-9);
        (0..32_000).for_each(|_| stage.supply(-500.0, H));
        assert!(!stage.has_overvoltage() && stage.voltage() > braking - 20.0);
        let stored = 0.5 * capacitance * (stage.voltage() * stage.voltage() - nominal * nominal);
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

    /// At the limit of the voltage `(R i + e ω)² + (p ω L i)² = u²`: what current is left at each speed, up to that without any,
    /// as the motor drives and as it brakes, turning either way.
    #[test]
    fn torque_over_speed_is_that_of_the_whole_phasor() {
        for motor in MOTORS {
            let Motor {
                torque_constant,
                resistance,
                inductance,
                pole_pairs,
                ..
            } = motor;
            let mut least = f64::INFINITY;
            for share in [0.2, 0.4, 0.6, 0.8, 0.9, 0.99] {
                let most = PowerStage::new(motor, DcBus::default()).phase_voltage_most();
                let velocity = share * motor.no_load_speed(560.0);
                let induced = torque_constant / 3.0 * velocity * TAU;
                let reactance = f64::from(pole_pairs) * velocity * TAU * inductance;
                let impedance = resistance * resistance + reactance * reactance;
                let square =
                    (resistance * induced).powi(2) + impedance * (most * most - induced * induced);
                let drives = (square.sqrt() - resistance * induced) / impedance;
                let brakes = (-square.sqrt() - resistance * induced) / impedance;
                for (torque, direction, expected) in [
                    (1e3, 1.0, drives),
                    (-1e3, -1.0, -drives),
                    (-1e3, 1.0, brakes),
                    (1e3, -1.0, -brakes),
                ] {
                    let mut stage = PowerStage::new(motor, DcBus::default());
                    // What it brakes with goes nowhere: the voltage stays.
                    stage.bus.capacitance = f64::INFINITY;
                    for _ in 0..20_000 {
                        stage.step(torque, 0.0, direction * velocity, H);
                        let (current, end) = (stage.current() / expected, 1.0 + 1e-9);
                        assert!((0.0..=end).contains(&current), "{} {share}", motor.name);
                    }
                    assert!(stage.is_voltage_limited());
                    let found = stage.current();
                    assert!(
                        (found / expected - 1.0).abs() < 1e-6,
                        "{} {share}: {found} {expected}",
                        motor.name
                    );
                }
                assert!(drives < least);
                least = drives;
            }
        }
    }

    /// The motor's work and what discharges it come out of the capacitor.
    #[test]
    fn without_mains_the_bus_is_what_is_left_of_it() {
        let mut stage = smooth();
        let DcBus {
            nominal,
            capacitance,
            discharge,
            ..
        } = stage.bus;
        stage.feed(false);
        (0..160_000).for_each(|_| stage.off(H));
        let expected = nominal * libm::exp(-10.0 / (discharge * capacitance));
        assert!(
            (stage.voltage() / expected - 1.0).abs() < 1e-6,
            "{}",
            stage.voltage()
        );
        let before = stage.voltage();
        (0..160).for_each(|_| stage.supply(500.0, H));
        let given = 0.5 * capacitance * (before * before - stage.voltage() * stage.voltage());
        assert!((given / 5.0 - 1.0).abs() < 0.05, "{given} J");
        (0..16_000).for_each(|_| stage.supply(500.0, H));
        assert_eq!(stage.voltage(), 0.0);
        // Without a voltage no current begins.
        stage.step(1.0, 0.0, 0.0, H);
        assert_eq!(stage.current(), 0.0);
        stage.feed(true);
        assert_eq!(stage.voltage(), nominal);
    }

    /// Steps stages with these powers, W, and joins their DC buses behind each.
    fn joined(stages: &mut [PowerStage], powers: &[f64]) {
        let mut all = Joined::default();
        for (stage, power) in stages.iter_mut().zip(powers) {
            stage.supply(*power, H);
            all.add(stage);
        }
        stages.iter_mut().for_each(|it| it.join(all.voltage()));
    }

    proptest! {
        /// Joined DC buses have one voltage, that of a single one with the capacitance of all and their resistors in parallel, which all
        /// their power goes to; and no energy is lost: what is braked is in the capacitors and in the resistors, beyond what the mains give.
        #[test]
        fn joined_buses_are_one(
            powers in prop::collection::vec((prop::array::uniform4(-2000.0..1500.0_f64), 1..400_u32), 1..12), count in 2..=4_usize,
        ) {
            let mut stages = vec![smooth(); count];
            let of = stages[0].bus;
            let mut single = PowerStage::new(*stages[0].motor(), DcBus {
                capacitance: of.capacitance * count as f64,
                resistance: of.resistance / count as f64,
                ..of
            });
            let stored = |stages: &[PowerStage]| -> f64 {
                stages.iter().map(|it| 0.5 * of.capacitance * it.voltage() * it.voltage() + it.braked).sum()
            };
            let mut before = stored(&stages);
            // What the powers of a step may make of a voltage, V, and the resistors' 10 V in which both are on or off.
            let apart = 8.0 * 2000.0 * H / of.capacitance / of.nominal;
            for (powers, steps) in powers {
                let powers = &powers[..count];
                let whole: f64 = powers.iter().sum();
                for _ in 0..steps {
                    let had = stages[0].voltage();
                    joined(&mut stages, powers);
                    single.supply(whole, H);
                    let now = stored(&stages);
                    let given = now - before + whole * H;
                    prop_assert!(given > -1e-9 * now, "{given} J are lost");
                    // Far above their voltage the mains give nothing.
                    prop_assert!(had < of.nominal + apart || given < 1e-9 * now, "{given} J come from nowhere");
                    before = now;
                    prop_assert!(stages.iter().all(|it| it.voltage() == stages[0].voltage()));
                    let off = (stages[0].voltage() - single.voltage()).abs();
                    let is_switching = (of.braking - 12.0..of.braking + 2.0).contains(&single.voltage());
                    prop_assert!(off < apart || is_switching || single.braked > 0.0 && off < 12.0, "{off}");
                    prop_assert_eq!(stages[0].has_overvoltage(), stages.iter().any(PowerStage::has_overvoltage));
                }
            }
        }

        /// While one of them has mains, those that have none have its voltage, but for what a step takes; behind the last one's it is lost.
        #[test]
        fn one_that_has_mains_feeds_those_joined_to_it(
            powers in prop::collection::vec((prop::array::uniform4(0.0..1500.0_f64), 1..400_u32), 1..6),
            count in 2..=4_usize, fed in 0..4_usize,
        ) {
            let mut stages = vec![smooth(); count];
            let of = stages[0].bus;
            for (place, stage) in stages.iter_mut().enumerate() {
                stage.feed(place == fed % count);
            }
            let apart = 8.0 * 1500.0 * H / of.capacitance / of.nominal;
            for (powers, steps) in &powers {
                for _ in 0..*steps {
                    joined(&mut stages, &powers[..count]);
                    prop_assert!(stages[0].voltage() > of.nominal - apart, "{}", stages[0].voltage());
                }
            }
            stages[fed % count].feed(false);
            for _ in 0..(1.0 / H) as u32 {
                joined(&mut stages, &[200.0; 4][..count]);
            }
            prop_assert!(stages[0].voltage() < 0.1 * of.nominal, "{}", stages[0].voltage());
        }

        /// Whatever is asked at whatever speed, with mains that come and go: finite, and no more torque than the peak current makes.
        #[test]
        fn a_power_stage_stays_within_its_motor(
            motor in prop::sample::select(&MOTORS[..]),
            steps in prop::collection::vec((-100.0..100.0_f64, -400.0..400.0_f64, any::<bool>()), 1..40),
        ) {
            let mut stage = PowerStage::new(motor, DcBus::default());
            for (wanted, velocity, mains) in steps {
                stage.feed(mains);
                for _ in 0..50 {
                    let wanted = wanted.clamp(-motor.peak_torque, motor.peak_torque);
                    let torque = stage.step(wanted, 0.1, velocity, H);
                    let most = motor.peak_torque * (1.0 + motor.ripple) + motor.cogging;
                    prop_assert!(torque.abs() <= most * (1.0 + 1e-9), "{torque} of {most} N·m");
                    prop_assert!(stage.voltage().is_finite() && stage.voltage() >= 0.0);
                }
            }
        }
    }
}
