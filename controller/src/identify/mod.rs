//! What an axis is, from how it moves, for `syncline identify`: inertia, friction and gravity where its drive tells its torque, delay
//! and lag where that is sent velocities.
//!
//! - [`excitation`]: a program that shows it
//! - [`log`]: what was seen of it
//! - [`estimate`](mod@estimate): what that says; it gets the log and what is public of the axis ([`estimate::Shaft`]), and
//!   nothing of what a simulation has behind it
//! - `windows`: what is seen of the equation of motion, without differentiating
//! - `fit`: how that is solved
//! - [`response`](mod@response): how it answers torque over frequency, without a model
//! - [`tuning`]: gains for what was found
//! - [`velocity`]: an axis whose drive is sent velocities, and the settings for what was found of it
//! - [`lag`]: how it follows them

pub mod estimate;
pub mod excitation;
mod fit;
pub mod lag;
pub mod log;
pub mod response;
pub mod tuning;
pub mod velocity;
mod windows;

pub use crate::observe::axis_log::{AxisSample, ToldTorque};

use crate::machine::{Axis, FeedForward, Machine, Motion, Simulation};
use estimate::{Estimate, Figure, Shaft};
use response::{Response, response};
use serde::Serialize;
use std::f64::consts::TAU;
use std::fmt;
use syncline_drives::model::{Ability, Drive};
use syncline_drives::twin::servo::motor::Motor;
use syncline_drives::twin::servo::stability::{Margins, Mode};
use tuning::Tuned;
use velocity::Streamed;

/// An axis that can be identified.
#[derive(Clone, Debug)]
pub enum Subject {
    /// By the torque that its drive tells.
    Moved(Box<Moved>),
    /// By the velocities that its drive is sent.
    Streamed(Streamed),
}

/// An axis whose drive tells its torque, and what is known of it: what stands on the name plates of motor and drive.
#[derive(Clone, Debug)]
pub struct Moved {
    /// Its index in [`Machine::axes`].
    pub axis: usize,
    /// What the estimator is told.
    pub shaft: Shaft,
    /// m or rad that the load goes for each radian of the shaft.
    travel: f64,
    /// What the machine file says of its motor.
    motor: Option<Known>,
    /// The unit in which it says how stiff the transmission is, N/m or N·m/rad, if it names one.
    stiffness: Option<f64>,
    /// Of two sides that a beam ties together: what another axis moves along that, kg, 0 if none does.
    carried: Option<f64>,
}

/// What is known of a motor.
#[derive(Clone, Copy, Debug)]
struct Known {
    /// Of its rotor and what is fixed to it, kg·m².
    inertia: f64,
    /// N·m.
    friction: f64,
    /// N·m·s/rad.
    viscous_friction: f64,
    /// All of it.
    motor: Motor,
}

/// Why an axis cannot be identified, and what to do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unfit {
    /// There is no such axis.
    #[error("--axis {axis}: the machine has no such axis; allowed: {}", has.join(", "))]
    NoAxis {
        /// As it was named.
        axis: String,
        /// Those that there are.
        has: Vec<&'static str>,
    },
    /// It is a gantry of two models.
    #[error(
        "axis {0} is a gantry of two models of drives, which tell position and torque at different instants: only two of one \
         model can be identified together"
    )]
    Unlike(&'static str),
    /// It is a gantry one of whose drives is sent velocities.
    #[error(
        "axis {0} is a gantry whose drives are sent velocities: of such drives only those that move an axis alone can be \
         identified"
    )]
    Gantry(&'static str),
    /// It does not follow setpoints.
    #[error("axis {0} goes point to point: only axes that follow setpoints can be identified")]
    PointToPoint(&'static str),
    /// Where its motor is nobody tells.
    #[error(
        "axis {0}: its drive tells where a scale has its load, and not where its motor is, whose motion is to be identified: take \
         `scale_step` out of its [axis.simulation]"
    )]
    Scale(&'static str),
    /// Nobody tells the torque.
    #[error(
        "axis {axis}: drive \"{drive}\" ({model}) is sent positions, and its PDOs do not tell its torque, which is needed to \
         identify it"
    )]
    NoTorque {
        /// The axis.
        axis: &'static str,
        /// Its drive.
        drive: String,
        /// What that is.
        model: &'static str,
    },
    /// A drive tells torque in parts of it.
    #[error(
        "axis {0}: the rated torque of its motor is not known: name the motor in its [axis.simulation], state \
         `feed_forward.rated_torque` of the axis where its drive is sent torques, or give --rated-torque N·m"
    )]
    RatedTorque(&'static str),
}

/// What was found cannot be of the motor, and of what else is fixed to its shaft, that the machine file names.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "axis {axis}: the inertia found, {found} kg·m², is less than the {least} kg·m² that its {of} by the machine file: \
     one of these is wrong, or the rated torque of {rated_torque} N·m, of which the drive tells its torque in thousandths",
    found = number(*found),
    least = number(*least),
    of = match carriage { true => "`motor` and `carriage_mass` have", false => "`motor` has" }
)]
pub struct TooLight {
    axis: &'static str,
    /// Of all that moves, at the shaft, kg·m².
    found: f64,
    /// Of what the machine file names, kg·m².
    least: f64,
    rated_torque: f64,
    carriage: bool,
}

impl Subject {
    /// The axis of that name, made ready to tell its torque if its drive can; `rated_torque`, N·m, where the machine file
    /// names no motor or another one.
    ///
    /// # Errors
    /// It cannot be identified.
    pub fn of(machine: &mut Machine, name: &str, rated_torque: Option<f64>) -> Result<Self, Unfit> {
        let found = machine.axes.iter().position(|axis| axis.name() == name);
        let index = found.ok_or_else(|| Unfit::NoAxis {
            axis: name.to_owned(),
            has: machine.axes.iter().map(Axis::name).collect(),
        })?;
        let name = machine.axes[index].name();
        if machine.axes[index].motion == Motion::PointToPoint {
            return Err(Unfit::PointToPoint(name));
        }
        let simulation = machine.axes[index].simulation.as_ref();
        if simulation.is_some_and(|it| it.scale.is_some()) {
            return Err(Unfit::Scale(name));
        }
        let follows_velocities = |&drive: &usize| {
            let device = machine.device(drive);
            device.drive().and_then(Drive::dynamics).is_some()
        };
        match &machine.axes[index].drives[..] {
            [drive] if follows_velocities(drive) => Ok(Self::Streamed(Streamed { axis: index })),
            sides if sides.iter().any(follows_velocities) => Err(Unfit::Gantry(name)),
            [one, other]
                if machine.drives[*one].model.name != machine.drives[*other].model.name =>
            {
                Err(Unfit::Unlike(name))
            }
            _ => {
                let moved = Moved::of(machine, index, rated_torque)?;
                Ok(Self::Moved(Box::new(moved)))
            }
        }
    }

    /// Its index in [`Machine::axes`].
    #[must_use]
    pub fn axis(&self) -> usize {
        match self {
            Self::Moved(moved) => moved.axis,
            Self::Streamed(streamed) => streamed.axis,
        }
    }
}

impl Moved {
    fn of(machine: &mut Machine, index: usize, rated_torque: Option<f64>) -> Result<Self, Unfit> {
        machine.tell_torque(index);
        let axis = &machine.axes[index];
        let name = axis.name();
        let mut drives = axis.drives.iter();
        if let Some(&silent) = drives.find(|&&drive| !machine.device(drive).tells_torque()) {
            let drive = &machine.drives[silent];
            return Err(Unfit::NoTorque {
                axis: name,
                drive: drive.name.clone(),
                model: drive.model.title,
            });
        }
        let driven = axis.simulation.as_ref().and_then(Simulation::driven);
        let moved = driven.as_ref();
        let rated = moved.map(|moved| moved.motor().continuous_torque);
        let stated = axis.feed_forward.map(|it| it.rated_torque);
        let unit = match axis.letter.is_linear() {
            true => 1e-3,
            false => TAU / 360.0,
        };
        Ok(Self {
            axis: index,
            shaft: Shaft {
                cycle: machine.cycle.as_secs_f64(),
                radians: TAU / axis.mm_per_revolution,
                resolution: machine.drives[axis.drives[0]].scaling.resolution(),
                rated_torque: rated_torque
                    .or(stated)
                    .or(rated)
                    .ok_or(Unfit::RatedTorque(name))?,
                motor_viscous_friction: moved.map(|moved| moved.motor().viscous_friction),
            },
            travel: unit * axis.mm_per_revolution / TAU,
            motor: moved.map(|moved| Known {
                inertia: moved.rotor_inertia(),
                friction: moved.motor().friction,
                viscous_friction: moved.motor().viscous_friction,
                motor: moved.motor(),
            }),
            stiffness: moved
                .and_then(|moved| moved.stiffness(axis.letter.is_linear()))
                .map(|it| it.unit),
            carried: (axis.simulation.as_ref())
                .and_then(|it| it.gantry.as_ref())
                .map(|it| it.carriage.as_ref().map_or(0.0, |it| it.mass)),
        })
    }

    /// Whether its motor is known, and so what an axis has behind that.
    #[must_use]
    pub fn names_motor(&self) -> bool {
        self.motor.is_some()
    }

    /// What is found to be lighter than what the machine file names of it.
    fn too_light(&self, axis: &'static str, estimate: &Estimate) -> Option<TooLight> {
        let Figure { value, uncertainty } = estimate.inertia;
        // Each motor of a gantry moves half of what its beam carries.
        let carried = self.carried.unwrap_or(0.0) / 2.0 * self.travel * self.travel;
        let least = self.motor?.inertia + carried;
        (value + (2.0 * uncertainty).max(NAME_PLATE * least) < least).then_some(TooLight {
            axis,
            found: value,
            least,
            rated_torque: self.shaft.rated_torque,
            carriage: carried > 0.0,
        })
    }

    /// What a simulated axis has behind a motor that is known.
    fn keys(&self, estimate: &Estimate, motor: &Known) -> Vec<Key> {
        let travel = self.travel;
        let behind = |figure: Figure, own: f64, scale: f64| Figure {
            value: (figure.value - own) / scale,
            uncertainty: figure.uncertainty / scale,
        };
        let mut keys = Vec::new();
        let mut add = |key, figure: Figure| keys.push(Key { key, figure });
        // A beam, with what it carries, is moved by both motors, and each feels half of it.
        let (key, motors, carried) = match self.carried {
            None => ("load", 1.0, 0.0),
            Some(carried) => ("mass", 2.0, carried),
        };
        let mut load = behind(estimate.inertia, motor.inertia, travel * travel / motors);
        load.value -= carried;
        if load.value > 0.0 {
            add(key, load);
        }
        // A motor that has less friction than its kind has none left for the guide.
        for (found, own, scale, [at_load, at_motor]) in [
            (
                estimate.friction,
                motor.friction,
                travel,
                ["friction", "motor_friction"],
            ),
            (
                estimate.viscous_friction,
                motor.viscous_friction,
                travel * travel,
                ["viscous_friction", "motor_viscous_friction"],
            ),
        ] {
            let rest = behind(found, own, scale);
            if rest.value >= 0.0 {
                add(at_load, rest);
            } else {
                let value = found.value.max(0.0);
                add(at_motor, Figure { value, ..found });
                add(at_load, Figure { value: 0.0, ..rest });
            }
        }
        let Figure { value, uncertainty } = behind(estimate.holding_torque, 0.0, travel / motors);
        add(
            "gravity",
            Figure {
                value: -value,
                uncertainty,
            },
        );
        // A file that names no transmission has a stiff one.
        if let (Some(unit), Some(swing)) = (self.stiffness, &estimate.swing) {
            let Figure { value: hertz, .. } = swing.antiresonance;
            let stiffness =
                (estimate.inertia.value - motor.inertia) * (TAU * hertz / travel).powi(2) / unit;
            let part = (2.0 * swing.antiresonance.part()).hypot(estimate.inertia.part());
            let stiffness = Figure {
                value: stiffness,
                uncertainty: part * stiffness,
            };
            if stiffness.value <= 0.0 {
                // A motor without a load has nothing to swing.
                return keys;
            }
            keys.push(Key {
                key: "stiffness",
                figure: stiffness,
            });
            let damping = swing.damping.filter(|it| it.value <= 1.0);
            keys.extend(damping.map(|figure| Key {
                key: "damping",
                figure,
            }));
        }
        keys
    }
}

/// What was found of an axis.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Identified {
    /// The axis.
    pub axis: &'static str,
    /// Of its motor, N·m: what the torque in the log is a part of.
    pub rated_torque: f64,
    /// What the log says.
    pub estimate: Estimate,
    /// How the motor's shaft answers torque, as the log shows it without a model, and as the estimate has it.
    pub response: Vec<Response>,
    /// Keys of `[axis.simulation]` that make a simulated axis of it; none where the machine file names no motor, or one that it
    /// cannot be.
    pub simulation: Vec<Key>,
    /// Why it cannot be what the machine file names.
    #[serde(serialize_with = "told")]
    pub too_light: Option<TooLight>,
    /// What its drive can be sent with its setpoints, if it adds that to its loops' torque.
    pub feed_forward: Option<FeedForward>,
    /// Gains that suit it; none where the machine file names no motor, or where none keep it from swinging.
    pub gains: Option<Tuned>,
    /// Gains that suit it if it is stiff, where the log shows no swing: it cannot tell one that is further up from none.
    pub gains_if_stiff: Option<Tuned>,
    /// Its drive, or both of a gantry.
    #[serde(skip)]
    drives: Vec<String>,
    #[serde(skip)]
    rotary: bool,
}

/// A mistake by its words.
fn told<S: serde::Serializer>(mistake: &Option<TooLight>, to: S) -> Result<S::Ok, S::Error> {
    mistake.as_ref().map(TooLight::to_string).serialize(to)
}

/// A key of `[axis.simulation]` with what was found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Key {
    /// Its name.
    pub key: &'static str,
    /// In the file's own units.
    #[serde(flatten)]
    pub figure: Figure,
}

impl Identified {
    /// Of an axis of a machine, from its log and what that says.
    #[must_use]
    pub fn new(
        machine: &Machine,
        subject: &Moved,
        samples: &[AxisSample],
        estimate: Estimate,
    ) -> Self {
        let axis = &machine.axes[subject.axis];
        let drive = &machine.drives[axis.drives[0]];
        let drives = axis.drives.iter();
        let names = drives.map(|&drive| machine.drives[drive].name.clone());
        let device = machine.device(axis.drives[0]);
        let too_light = subject.too_light(axis.name(), &estimate);
        let motor = subject.motor.filter(|_| too_light.is_none());
        let known = motor.zip(device.drive());
        let tuned = |tuned: fn(&Estimate, &Motor, f64, &dyn Drive) -> Option<Tuned>| {
            let (known, device) = known?;
            tuned(&estimate, &known.motor, known.inertia, device)
        };
        let [gains, gains_if_stiff] = [Tuned::of, Tuned::if_stiff].map(tuned);
        Self {
            axis: axis.name(),
            feed_forward: (drive.model.abilities.contains(&Ability::TorqueOffset))
                .then(|| feed_forward(subject, axis, &estimate)),
            gains,
            gains_if_stiff,
            drives: names.collect(),
            rated_torque: subject.shaft.rated_torque,
            response: response(samples, &subject.shaft, &estimate),
            simulation: motor.map_or_else(Vec::new, |motor| subject.keys(&estimate, &motor)),
            too_light,
            estimate,
            rotary: !axis.letter.is_linear(),
        }
    }

    /// What [`Machine::load_with`] takes to have a simulated axis like this one, key by key.
    pub fn settings(&self) -> impl Iterator<Item = String> {
        let keys = self.simulation.iter();
        keys.filter_map(|key| {
            let value = key.value()?;
            Some(format!("axis.{}.simulation.{}={value}", self.axis, key.key))
        })
    }
}

impl Key {
    /// As the file has it: what may as well be nothing is nothing, or is left as it is where a key is above 0.
    fn value(&self) -> Option<String> {
        let Self { key, figure } = self;
        if figure.differs_from_nothing() {
            return Some(rounded(figure));
        }
        (!matches!(*key, "load" | "mass" | "stiffness" | "damping")).then(|| "0.0".to_owned())
    }
}

/// What the drive of an axis is sent so: what may as well be nothing is nothing.
fn feed_forward(subject: &Moved, axis: &Axis, estimate: &Estimate) -> FeedForward {
    let sure = |figure: Figure| match figure.differs_from_nothing() {
        true => figure.value,
        false => 0.0,
    };
    let inertia = estimate.inertia.value.max(0.0);
    let motor = subject.motor.filter(|_| axis.has_backlash());
    FeedForward {
        rated_torque: subject.shaft.rated_torque,
        inertia,
        motor_inertia: motor.map_or(0.0, |it| it.inertia.min(inertia)),
        coulomb_friction: sure(estimate.friction).max(0.0),
        viscous_friction: sure(estimate.viscous_friction).max(0.0),
        gravity: sure(estimate.holding_torque),
    }
}

/// A number with as many digits as it is worth, one more than its uncertainty has.
fn rounded(figure: &Figure) -> String {
    let step = figure.uncertainty.max(1e-6 * figure.value.abs()).max(1e-12) / 10.0;
    let digits = -step.log10().floor() as i32;
    let scale = 10_f64.powi(digits);
    let value = (figure.value * scale).round() / scale;
    // TOML's floats have a point.
    format!("{:.*}", digits.clamp(1, 15) as usize, value + 0.0)
}

impl fmt::Display for Identified {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Estimate {
            inertia,
            friction,
            viscous_friction,
            holding_torque,
            torque_delay_s,
            swing,
            seen_to_hz,
            moving_s,
        } = &self.estimate;
        writeln!(
            f,
            "axis {}: {moving_s:.1} s of motion without rests and reversals; torque told {:.2} ms later than position",
            self.axis,
            1e3 * torque_delay_s
        )?;
        let shaft = match self.drives.len() {
            1 => "the motor's shaft",
            _ => "the shaft of each motor, the mean of both",
        };
        writeln!(f, "\nat {shaft}, with 95 %")?;
        for (name, figure, unit) in [
            ("inertia", inertia, "kg·m²"),
            ("Coulomb friction", friction, "N·m"),
            ("viscous friction", viscous_friction, "N·m·s/rad"),
            ("torque to hold it", holding_torque, "N·m"),
        ] {
            row(f, name, figure, unit)?;
        }
        match swing {
            Some(swing) => {
                row(f, "antiresonance", &swing.antiresonance, "Hz")?;
                for (name, figure, unit) in [
                    ("resonance", &swing.resonance, "Hz"),
                    ("damping ratio", &swing.damping, ""),
                ] {
                    match figure {
                        Some(figure) => row(f, name, figure, unit)?,
                        None => writeln!(f, "  {name:<22} not identifiable from this log")?,
                    }
                }
            }
            None => writeln!(
                f,
                "  no resonance is identifiable from this log, which shows up to {seen_to_hz:.0} Hz"
            )?,
        }
        if let Some(feed_forward) = &self.feed_forward {
            self.tell_feed_forward(feed_forward, f)?;
        }
        if let Some(too_light) = &self.too_light {
            return writeln!(f, "\n{too_light}");
        }
        if self.simulation.is_empty() {
            return writeln!(
                f,
                "\nwith a `motor` in its [axis.simulation] there would be values for that table"
            );
        }
        let units = match self.rotary {
            false => ["kg", "N", "N·s/m", "N/µm"],
            true => ["kg·m²", "N·m", "N·m·s/rad", "N·m/rad"],
        };
        writeln!(f, "\nof the axis, as [axis.simulation] has it")?;
        for Key { key, figure } in &self.simulation {
            let unit = match *key {
                "load" | "mass" => units[0],
                "friction" | "gravity" => units[1],
                "viscous_friction" => units[2],
                "motor_friction" => "N·m",
                "stiffness" => units[3],
                "damping" => "",
                _ => "N·m·s/rad",
            };
            row(f, key, figure, unit)?;
        }
        writeln!(f, "\n[axis.simulation]  # of axis {}", self.axis)?;
        for key in &self.simulation {
            if let Some(value) = key.value() {
                writeln!(f, "{} = {value}", key.key)?;
            }
        }
        match &self.gains {
            Some(gains) => {
                writeln!(f, "\ngains, for loops as simulated drives have them")?;
                self.tell_gains(gains, f)?;
            }
            None => writeln!(f, "\nno gains keep this axis from swinging")?,
        }
        let Some(gains) = &self.gains_if_stiff else {
            return Ok(());
        };
        let others = match &self.gains {
            Some(_) => "those before are for one that may swing",
            None => "it may swing, and none are told for that,",
        };
        writeln!(
            f,
            "\ngains for a load that is stiff: {others} above {seen_to_hz:.0} Hz, where the log shows nothing; try these with care, and \
             go back where the axis hums"
        )?;
        self.tell_gains(gains, f)
    }
}

impl Identified {
    /// Its drives by their names.
    fn of_drives(&self) -> String {
        match &self.drives[..] {
            [drive] => format!("drive {drive}"),
            drives => format!("drives {}", drives.join(" and ")),
        }
    }

    fn tell_feed_forward(
        &self,
        feed_forward: &FeedForward,
        f: &mut fmt::Formatter<'_>,
    ) -> fmt::Result {
        let Estimate {
            inertia,
            friction,
            viscous_friction,
            holding_torque,
            ..
        } = &self.estimate;
        let figures = [
            ("inertia", inertia, feed_forward.inertia),
            ("motor_inertia", inertia, feed_forward.motor_inertia),
            ("coulomb_friction", friction, feed_forward.coulomb_friction),
            (
                "viscous_friction",
                viscous_friction,
                feed_forward.viscous_friction,
            ),
            ("gravity", holding_torque, feed_forward.gravity),
        ];
        let told = figures.into_iter().filter(|(.., value)| *value != 0.0);
        let told = told.map(|(key, found, value)| {
            let figure = Figure { value, ..*found };
            format!(", {key} = {}", rounded(&figure))
        });
        writeln!(
            f,
            "\nof axis {}, to be sent to {} with each setpoint\nfeed_forward = {{ rated_torque = {:?}{} }}",
            self.axis,
            self.of_drives(),
            feed_forward.rated_torque,
            told.collect::<String>()
        )
    }

    fn tell_gains(&self, gains: &Tuned, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Tuned {
            speed_gain,
            integral_time_s,
            position_gain,
            stability,
            swing,
            sdo,
        } = gains;
        let margins = |it: &Margins| format!("{:.0}° and {:.1} dB", it.phase, it.gain);
        writeln!(
            f,
            "  speed loop    {} N·m·s/rad, {:.2} ms, margins {}\n  position loop {:.1} 1/s, margins {}",
            number(*speed_gain),
            1e3 * integral_time_s,
            margins(&stability.speed),
            position_gain,
            margins(&stability.position)
        )?;
        if !sdo.is_empty() {
            let entries = sdo.iter().map(|(at, value)| format!("[\"{at}\", {value}]"));
            let entries = entries.collect::<Vec<_>>().join(", ");
            writeln!(f, "sdo = [{entries}]  # of {}", self.of_drives())?;
        }
        match swing {
            Some(Mode { frequency, damping }) => writeln!(
                f,
                "\n[shaper]  # what they leave swinging of axis {}\nkind = \"zvd\"\nmodes = [[{frequency:.2}, {damping:.3}]]",
                self.axis
            ),
            None => writeln!(f, "they leave nothing swinging that a shaper is needed for"),
        }
    }
}

/// A number with its uncertainty.
fn row(f: &mut fmt::Formatter<'_>, name: &str, figure: &Figure, unit: &str) -> fmt::Result {
    let Figure { value, uncertainty } = figure;
    let (value, wide) = (*value, figure.part());
    let mark = if wide > UNCERTAIN { "  uncertain" } else { "" };
    // Nothing is no part of 0.
    let part = match wide.is_finite() {
        true => format!("{:>9.2} %", 100.0 * wide),
        false => format!("{:11}", ""),
    };
    writeln!(
        f,
        "  {name:<22} {:>11} ± {:<10} {unit:<10} {part}{mark}",
        number(value),
        number(*uncertainty),
    )
}

fn number(value: f64) -> String {
    match value.abs() {
        0.01..10000.0 => format!("{value:.4}"),
        0.0 => "0".to_owned(),
        _ => format!("{value:.3e}"),
    }
}

/// What a motor's data sheet may be wrong by, as a part of it.
const NAME_PLATE: f64 = 0.1;

/// From this part of its value on, an uncertainty is told as one.
const UNCERTAIN: f64 = 0.1;

#[cfg(test)]
mod tests {
    use super::*;

    /// Nothing is written that the log does not tell from nothing.
    #[test]
    fn what_may_as_well_be_nothing_is_written_as_nothing() {
        let value = |key, value, uncertainty| {
            let figure = Figure { value, uncertainty };
            Key { key, figure }.value()
        };
        assert_eq!(value("gravity", -0.002, 0.0115).as_deref(), Some("0.0"));
        assert_eq!(value("gravity", -2.0, 0.01).as_deref(), Some("-2.000"));
        assert_eq!(value("motor_friction", 0.0, 0.1).as_deref(), Some("0.0"));
        assert_eq!(value("load", 0.5, 0.6), None);
        assert_eq!(value("load", 0.5, 0.4).as_deref(), Some("0.50"));
    }

    /// An uncertainty is no part of 0.
    #[test]
    fn a_figure_of_nothing_is_told_without_a_part() {
        struct Row(Figure);
        impl fmt::Display for Row {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                row(f, "torque to hold it", &self.0, "N·m")
            }
        }
        let told = |value| {
            let uncertainty = 0.02;
            Row(Figure { value, uncertainty }).to_string()
        };
        assert!(
            told(0.5).contains("± 0.0200     N·m             4.00 %"),
            "{}",
            told(0.5)
        );
        let of_nothing = told(0.0);
        assert!(
            !of_nothing.contains('%') && of_nothing.contains("uncertain"),
            "{of_nothing}"
        );
    }
}
