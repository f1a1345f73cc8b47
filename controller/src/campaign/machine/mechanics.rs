//! What the axes of a random machine move, and what their setpoints are corrected by for it.
//!
//! Weight, friction and what gives way are drawn at the motor's shaft, where it is known what a motor is at ease with, and carried over to
//! the load by the axis's travel per revolution, as its limits are.

use super::super::dice::Dice;
use super::axis::{AxisSpec, STEPPER, digits};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use std::fmt::Write as _;
use syncline_drives::model::Ability;
use syncline_drives::twin::servo::motor::{MOTORS, Motor};

/// Inertia of the load over that of the rotor, of an axis of which the machine file does not say it.
const USUAL_RATIO: f64 = 4.0 / 1.1;

/// Friction of a guide that holds its carriage where the axis slows down, of what is needed for that.
const HOLDS: f64 = 1.2;

/// Rows of the greatest table of a lead error.
const ROWS: u32 = 12;

/// The greatest errors that the machine file takes: of backlash mm, of a lead error µm.
const GREATEST: (f64, f64) = (1.0, 1000.0);

/// Warmth has a transmission grow by so much of a revolution at the most, inside the soft limits.
const GROWS: f64 = 0.05;

/// What racking takes of a motor's torque where the sides of a beam are as far apart as they may be, at the most.
const RACKS: f64 = 0.1;

/// Of what an encoder beside an axis may differ, as much may be errors of the transmission.
const SEEN: f64 = 0.1;

/// Errors of a transmission: what a machine file compensates, or what a simulated axis has.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ErrorSpec {
    /// From flank to flank, mm; 0: none.
    pub backlash: f64,
    /// Position, mm, and error, µm; of none there are no points.
    pub lead_error: Vec<(f64, f64)>,
}

/// What is between the motors of a simulated axis and its carriage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TransmissionSpec {
    /// Where it is off.
    pub errors: ErrorSpec,
    /// What gives way, if it has play: antiresonance, Hz, and the load's inertia, of that of the rotor.
    pub soft: Option<(f64, f64)>,
}

/// How much warmer the transmission of a simulated axis is than where its lead is right.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WarmthSpec {
    /// In the end, K.
    pub rise: f64,
    /// µm/m/K.
    pub expansion: f64,
    /// Where it does not move, mm.
    pub fixed_at: f64,
    /// With which time constant it becomes so, s.
    pub time: f64,
}

impl WarmthSpec {
    /// The furthest that it puts the carriage off between these positions, mm.
    pub(in super::super) fn greatest(&self, ends: [f64; 2]) -> f64 {
        let off = ends.map(|end| 1e-6 * self.expansion * self.rise * (end - self.fixed_at));
        off[0].abs().max(off[1].abs())
    }
}

impl ErrorSpec {
    /// Errors of any size that a machine file takes, of an axis with that travel per revolution and these soft limits.
    fn draw(dice: &mut Dice, travel: f64, [least, most]: [f64; 2]) -> Self {
        let kind = dice.weighted(&[2, 2, 3]);
        let backlash = digits((dice.decades(-4, 0) * travel).min(GREATEST.0));
        let span = most - least;
        let [from, to] = [least, most].map(|end| end + span * dice.between(-0.3, 0.3));
        let rows = dice.whole(2..=ROWS);
        let pitch = (to - from) / f64::from(rows - 1);
        let amplitude = (dice.decades(-4, -1) * 1e3 * pitch).min(GREATEST.1);
        let mut row = |row: u32| {
            let at = from + pitch * (f64::from(row) + dice.between(-0.3, 0.3));
            (digits(at), digits(amplitude * dice.between(-1.0, 1.0)))
        };
        let mut lead_error: Vec<(f64, f64)> = (0..rows).map(&mut row).collect();
        lead_error.dedup_by(|later, earlier| later.0 <= earlier.0);
        Self {
            backlash: if kind == 1 { 0.0 } else { backlash },
            lead_error: match lead_error.len() {
                2.. if kind > 0 => lead_error,
                _ => Vec::new(),
            },
        }
    }

    /// The same, so many times as large.
    fn times(&self, part: f64) -> Self {
        let row = |&(at, error)| (at, digits(part * error));
        Self {
            backlash: digits(part * self.backlash),
            lead_error: self.lead_error.iter().map(row).collect(),
        }
    }

    /// No more than an encoder beside the axis bears, which may differ by so much from its drives, mm.
    fn within(&self, difference: f64) -> Self {
        let errors = self.lead_error.iter().map(|(_, error)| 1e-3 * error.abs());
        let greatest = errors.fold(self.backlash, f64::max);
        match SEEN * difference {
            most if most < greatest => self.times(most / greatest),
            _ => self.clone(),
        }
    }

    fn has_lead_error(&self) -> bool {
        !self.lead_error.is_empty()
    }

    /// Its lead error, as a machine file has it.
    fn points(&self) -> String {
        let points = self.lead_error.iter();
        let points = points.map(|(at, error)| format!("[{at:?}, {error:?}]"));
        let points: Vec<_> = points.collect();
        format!("lead_error = [{}]", points.join(", "))
    }

    /// The keys of an axis that is corrected by them.
    pub(super) fn write(&self, text: &mut String) {
        if self.backlash > 0.0 {
            let _ = writeln!(text, "backlash = {:?}", self.backlash);
        }
        if self.has_lead_error() {
            let _ = writeln!(text, "{}", self.points());
        }
    }
}

impl AxisSpec {
    /// What turns it where it is simulated.
    pub(super) fn motor(&self) -> Motor {
        let simulation = self.simulation.as_deref().unwrap_or_default();
        let is_named = |motor: &&Motor| simulation.contains(&format!("\"{}\"", motor.name));
        MOTORS.iter().find(is_named).copied().unwrap_or_default()
    }

    /// Whether each of its drives can be sent torques.
    pub(super) fn takes_torques(&self) -> bool {
        let mut drives = self.drives.iter().map(|drive| drive.model());
        !self.goes
            && drives
                .all(|model| model.is_some_and(|it| it.abilities.contains(&Ability::TorqueOffset)))
    }

    /// Whether its motors are servo motors, which hold what pulls at them.
    fn is_servo(&self) -> bool {
        self.drives.iter().all(|drive| drive.model != STEPPER)
    }

    /// How far the load goes for a radian of the motor, m, or rad of a rotary axis.
    fn radius(&self) -> f64 {
        match self.is_rotary() {
            true => self.travel / 360.0,
            false => self.travel * 1e-3 / TAU,
        }
    }

    /// The greatest velocity and acceleration of its motors, rad/s and rad/s².
    fn motion(&self) -> [f64; 2] {
        [self.velocity, self.acceleration].map(|it| it / self.travel * TAU)
    }

    /// More of what its drives move.
    pub(super) fn move_too(&mut self, keys: &str) {
        let before = self.simulation.take().map_or(String::new(), |it| it + ", ");
        self.simulation = Some(before + keys);
    }

    /// Has a weight pull at it, or its guide be thick with grease, or both; and of some have its drives be sent the torques for
    /// all that it takes.
    pub(super) fn weigh(&mut self, dice: &mut Dice) {
        let (asked, kind) = (dice.chance(0.3), dice.weighted(&[2, 1, 2]));
        let (weight, grease) = (dice.between(-0.45, 0.45), dice.between(0.0, 0.3));
        let (at_motor, told) = (dice.chance(0.5), dice.chance(0.6));
        if !asked || !self.is_servo() {
            return;
        }
        let (motor, radius) = (self.motor(), self.radius());
        let [speed, _] = self.motion();
        let mut viscous = motor.viscous_friction;
        let mut weight = digits((weight * motor.continuous_torque / radius).clamp(-1e6, 1e6));
        if kind == 1 {
            weight = 0.0;
        } else {
            self.move_too(&format!("gravity = {weight:?}"));
        }
        if kind > 0 {
            let grease = grease * motor.continuous_torque / speed;
            let at_load = digits(grease / (radius * radius));
            if at_motor || at_load > 1e6 {
                viscous += grease;
                self.move_too(&format!("motor_viscous_friction = {viscous:?}"));
            } else {
                viscous += at_load * radius * radius;
                self.move_too(&format!("viscous_friction = {at_load:?}"));
            }
        }
        if told && self.takes_torques() {
            self.feed_forward = Some(format!(
                "rated_torque = {:?}, inertia = {:?}, coulomb_friction = {:?}, viscous_friction = {viscous:?}, gravity = {:?}",
                motor.continuous_torque,
                motor.rotor_inertia * (1.0 + USUAL_RATIO),
                motor.friction,
                -weight * radius,
            ));
        }
    }

    /// Has its setpoints be corrected, or its carriage be off, or both: by the same or by something else.
    pub(super) fn err(&mut self, dice: &mut Dice) {
        let errors = ErrorSpec::draw(dice, self.travel, self.soft_limits);
        let others = ErrorSpec::draw(dice, self.travel, self.soft_limits);
        let (kind, softer, larger) = (
            dice.weighted(&[5, 2, 2, 1, 1]),
            dice.chance(0.5),
            dice.between(0.0, 2.5),
        );
        let soft = (
            digits(dice.between(60.0, 400.0)),
            digits(dice.between(0.3, 1.5)),
        );
        let sees_load = self.encoder.as_ref().is_some_and(|it| it.closes_loop);
        if self.goes || sees_load || !self.is_servo() {
            return;
        }
        let within = |errors: ErrorSpec| match &self.encoder {
            Some(encoder) => errors.within(encoder.difference),
            None => errors,
        };
        let (errors, others) = (within(errors), within(others));
        let (corrected, carriage) = match kind {
            0 => (Some(errors.clone()), Some(errors)),
            1 => (Some(errors), None),
            2 => (Some(errors.clone()), Some(within(errors.times(larger)))),
            3 => (Some(errors), Some(others)),
            _ => (None, Some(others)),
        };
        self.corrected = corrected.filter(|it| *it != ErrorSpec::default());
        self.transmission = carriage.map(|errors| TransmissionSpec {
            soft: (errors.backlash > 0.0 || softer).then_some(soft),
            errors,
        });
    }

    /// Has its transmission be warm, or become so.
    pub(super) fn warm(&mut self, dice: &mut Dice) {
        let [least, most] = self.soft_limits;
        let mut warmth = WarmthSpec {
            rise: dice.between(-40.0, 60.0),
            expansion: digits(dice.between(5.0, 25.0)),
            fixed_at: digits(dice.between(least, most)),
            time: *dice.pick(&[0.0, 0.5, 10.0, 1000.0]),
        };
        let greatest = warmth.greatest(self.soft_limits);
        warmth.rise = digits(warmth.rise * (GROWS * self.travel / greatest).min(1.0));
        let is_watched = self.encoder.is_some() || self.goes;
        if !self.is_rotary() && !is_watched && self.is_servo() {
            self.warmth = Some(warmth);
        }
    }

    /// Has a beam tie the sides of a gantry together, and of some the carriage of another axis, with that travel, run along it.
    pub(super) fn tie(&mut self, dice: &mut Dice, carriages: &[(char, f64)]) {
        let (motor, radius) = (self.motor(), self.radius());
        let ratio = 2.0 * dice.between(0.5, 4.0);
        let mass = digits((ratio * motor.rotor_inertia / (radius * radius)).clamp(0.01, 1e5));
        let (mut span, mut carriage) = (dice.between(200.0, 3000.0), String::new());
        if !carriages.is_empty() && dice.chance(0.5) {
            let (letter, travel) = *dice.pick(carriages);
            let mass = digits(mass * dice.between(0.02, 0.2));
            carriage = format!(", carriage = \"{letter}\", carriage_mass = {mass:?}");
            // It stays between the sides.
            span = (travel * dice.between(1.1, 2.0)).clamp(100.0, 1e5);
        }
        let span = digits(span);
        let metres = 1e-3 * span;
        let inertia = mass * metres * metres / 12.0 * dice.between(0.5, 2.0);
        let skew = 1e-3 * self.skew_limit();
        let stiffest = RACKS * motor.continuous_torque * metres * metres / (skew * radius);
        let stiffness = match dice.chance(0.7) {
            true => (stiffest * dice.between(0.01, 1.0)).min(1e12),
            false => 0.0,
        };
        let damping = 2.0 * dice.between(0.05, 0.5) * (stiffness * inertia).sqrt();
        if self.drives.len() != 2 || self.is_rotary() || self.transmission.is_some() {
            return;
        }
        self.move_too(&format!(
            "mechanics = \"rigid_beam\", mass = {mass:?}, inertia = {:?}, span = {span:?}, racking_stiffness = {stiffness:?}, \
             racking_damping = {:?}{carriage}",
            inertia.clamp(1e-6, 1e9),
            damping.min(1e9),
        ));
    }

    /// Has both be half as large.
    pub(super) fn halve_errors(&mut self) {
        let transmission = self.transmission.as_mut().map(|it| &mut it.errors);
        for errors in self.corrected.iter_mut().chain(transmission) {
            *errors = errors.times(0.5);
        }
    }

    /// What is between its motors and its carriage, as the inside of `simulation`.
    pub(super) fn between(&self) -> Option<String> {
        let none = (&ErrorSpec::default(), &None);
        let transmission = self.transmission.as_ref();
        let (errors, soft) = transmission.map_or(none, |it| (&it.errors, &it.soft));
        let mut keys = Vec::new();
        if let Some(WarmthSpec {
            rise,
            expansion,
            fixed_at,
            time,
        }) = &self.warmth
        {
            keys.push(format!(
                "temperature_rise = {rise:?}, expansion = {expansion:?}, fixed_at = {fixed_at:?}, warming_time = {time:?}"
            ));
        }
        if let Some((frequency, ratio)) = soft {
            let (radius, motor) = (self.radius(), self.motor());
            let inertia = ratio * motor.rotor_inertia;
            let [_, acceleration] = self.motion();
            let stiffness = inertia * (TAU * frequency) * (TAU * frequency) / (radius * radius);
            let unit = if self.is_rotary() { 1.0 } else { 1e6 };
            let friction = HOLDS * inertia * acceleration / radius;
            keys.push(format!(
                "transmission = \"screw\", stiffness = {:?}, play = {:?}, load = {:?}, friction = {friction:?}",
                stiffness / unit,
                errors.backlash,
                inertia / (radius * radius),
            ));
        }
        if errors.has_lead_error() {
            keys.push(errors.points());
        }
        (!keys.is_empty()).then(|| keys.join(", "))
    }
}
