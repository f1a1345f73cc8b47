//! `simulation` of an axis: the motors, the axis behind them and their encoders when its drives are
//! simulated. A real machine takes no notice of it.
//!
//! The file's figures are those of data sheets, at the load and in the axis's own units;
//! [`FeedAxis::at_shaft`] makes of them what one drive's motor feels at its shaft.

use super::Axis;
use std::f64::consts::TAU;
use std::ops::RangeInclusive;
use syncline_drives::mechanics::drive_train::{
    Brake, DriveTrain, Elasticity, Expansion, LeadError,
};
use syncline_drives::mechanics::friction::Friction;
use syncline_drives::mechanics::rigid_beam::{self, Beam, Racking};
use syncline_drives::mechanics::structure::StructureMode;
use syncline_drives::model::{Increments, Scaling};
use syncline_drives::twin;
use syncline_drives::twin::random::Random;
use syncline_drives::twin::servo::encoder::EncoderErrors;
use syncline_drives::twin::servo::motor::{MOTORS, Motor};
use syncline_strict_toml::{Log, Table, one_of};
use toml::Spanned;

/// What the simulated drives of an axis move.
#[derive(Clone, Debug, PartialEq)]
pub struct Simulation {
    /// What each of its motors moves alone: all of it, or the drive train in front of a beam.
    pub axis: FeedAxis,
    /// What ties a gantry's two sides together.
    pub gantry: Option<Gantry>,
    /// The file names its motor. Otherwise the sides of a beam have what their drives' models have, other axes the usual one.
    pub motor_is_named: bool,
    /// How unevenly a spindle turns; `None`: evenly.
    pub ripple: Option<twin::Ripple>,
    /// `None`: what each drive's model has.
    pub encoder: Option<EncoderErrors>,
    /// What a scale at the load tells apart, by which its drives close their position loops, mm; `None`: there is none.
    pub scale: Option<f64>,
    /// How the machine sways along the axis between tool and workpiece as it accelerates.
    pub structure: Vec<StructureMode>,
    /// Where the axis stands when it is switched on; `None`: where its homing ends, or near zero.
    pub start: Option<Start>,
    /// By how much the second side of a gantry stands further then.
    pub skew: Start,
    /// The switches by which its drives home by themselves.
    pub switches: HomeSwitches,
}

/// Where something stands when it is switched on, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start {
    /// There.
    At(f64),
    /// Anywhere from the first to the second, as the seed of the simulation draws it.
    Within(f64, f64),
}

impl Start {
    /// The place, mm, of this stream of the seed.
    #[must_use]
    pub fn drawn(self, seed: u64, stream: u64) -> f64 {
        match self {
            Self::At(place) => place,
            Self::Within(from, to) => Random::new(seed, stream).between(from, to),
        }
    }
}

/// Switches along an axis that are wired to inputs of its drives which those know for what they are.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HomeSwitches {
    /// The reference switch is on from here to there, mm.
    pub reference: Option<(f64, f64)>,
    /// Limit switches are on below the first of these places and above the second, mm.
    pub limits: Option<(f64, f64)>,
}

impl Simulation {
    /// What each of its motors moves, with a power stage of its own; `None`: what its drive's model has.
    #[must_use]
    pub fn driven(&self) -> Option<FeedAxis> {
        (self.gantry.is_none() || self.motor_is_named).then(|| self.felt())
    }

    /// What each of its motors moves, where those of a gantry move as one.
    #[must_use]
    pub fn felt(&self) -> FeedAxis {
        let Some(gantry) = &self.gantry else {
            return self.axis.clone();
        };
        let carried = gantry.carriage.as_ref().map_or(0.0, |it| it.mass);
        FeedAxis {
            load: Some(0.5 * (gantry.beam.mass + carried)),
            gravity: 0.5 * self.axis.gravity,
            ..self.axis.clone()
        }
    }
}

/// A beam between the two sides of a gantry.
#[derive(Clone, Debug, PartialEq)]
pub struct Gantry {
    /// The beam itself.
    pub beam: Beam,
    /// What runs along it.
    pub carriage: Option<Carriage>,
}

/// What another axis moves along a beam, from the first side to the second.
#[derive(Clone, Debug, PartialEq)]
pub struct Carriage {
    /// That axis's name, and where the file says it.
    axis: Spanned<String>,
    /// kg.
    pub mass: f64,
    /// Position of that axis in the middle of the beam, mm; `None`: in the middle of its soft limits.
    middle: Option<f64>,
}

impl Carriage {
    /// The axis that moves it, by its index.
    #[must_use]
    pub fn axis(&self, axes: &[Axis]) -> Option<usize> {
        (axes.iter()).position(|axis| axis.name() == self.axis.get_ref())
    }

    /// Where its axis is in the middle of the beam, mm.
    fn middle_of(&self, axis: &Axis) -> f64 {
        let (least, most) = axis.limits.position;
        self.middle.unwrap_or(0.5 * (least + most))
    }

    /// As its beam knows it, moved by a drive of its axis with that scaling.
    #[must_use]
    pub fn at_shaft(&self, axis: &Axis, scaling: &Scaling) -> rigid_beam::Carriage {
        let middle = self.middle_of(axis);
        // Its axis's positive direction is away from the first side.
        rigid_beam::Carriage {
            mass: self.mass,
            travel: -scaling.direction().sign() * axis.mm_per_revolution * 1e-3,
            middle: revolutions(scaling, axis.mm_per_revolution, middle),
        }
    }
}

/// Where a drive's shaft is at a machine position, from its encoder's zero.
fn revolutions(scaling: &Scaling, mm_per_revolution: f64, mm: f64) -> f64 {
    scaling.direction().sign() * (mm - scaling.to_mm(Increments::ZERO)) / mm_per_revolution
}

/// A feed axis as a machine file has it. N, N/m and kg of a linear axis are N·m, N·m/rad and kg·m²
/// of a rotary one.
#[derive(Clone, Debug, PartialEq)]
pub struct FeedAxis {
    motor: Motor,
    /// At the motor's shaft, kg·m².
    transmission_inertia: f64,
    /// kg; `None`: such that the motor feels [`DEFAULT_RATIO`] times its rotor.
    load: Option<f64>,
    elasticity: Option<Transmission>,
    /// Friction at the load, N and m/s.
    guide: Friction,
    /// N in the axis's positive direction.
    gravity: f64,
    brake: Brake,
    /// mm.
    end_stops: Option<(f64, f64)>,
    /// Position and error, mm.
    lead_error: Vec<(f64, f64)>,
    /// Where it is fixed in mm.
    expansion: Expansion,
}

/// Inertia of the load over that of the rotor where nothing is said: about that of 40 kg over 20 mm.
const DEFAULT_RATIO: f64 = 4.0 / 1.1;

/// What gives way between rotor and load.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Transmission {
    /// As `transmission` names it.
    name: &'static str,
    /// N/m.
    stiffness: f64,
    /// Damping ratio of the free vibration.
    damping: f64,
    /// mm.
    play: f64,
}

const fn transmission(name: &'static str, stiffness: f64, damping: f64, play: f64) -> Transmission {
    Transmission {
        name,
        stiffness,
        damping,
        play,
    }
}

/// How stiff a transmission is, as the machine file has it: N/µm of a linear axis, N·m/rad of a rotary one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stiffness {
    /// Its kind.
    pub name: &'static str,
    /// Its own.
    pub stiffness: f64,
    /// What its kind has where nothing is said.
    pub usual: f64,
    /// What one of the two is, N/m or N·m/rad.
    pub unit: f64,
}

/// N/m.
const N_PER_MICROMETRE: f64 = 1e6;

/// Most modes of a structure along an axis.
const MOST_MODES: usize = 8;

/// By how much steel grows with warmth, µm/m/K: what ISO 230-3 and the makers of ball screws reckon with lies from 11 to 12.
const STEEL: f64 = 11.5;

/// What does not give way.
const STIFF: &str = "stiff";

/// Plausible figures, of no product: a preloaded ball screw, a rack with its pinion and gear, a
/// toothed belt of some metres; a worm or planetary gear, N·m/rad and degrees.
const TRANSMISSIONS: [Transmission; 4] = [
    transmission("screw", 1e8, 0.02, 0.0),
    transmission("rack", 3e7, 0.03, 0.02),
    transmission("belt", 2e6, 0.02, 0.0),
    transmission("gear", 1e5, 0.03, 0.01),
];

const RIGID_BEAM: &str = "rigid_beam";

/// What a `simulation` looks like.
const ALLOWED: &str = "a table [axis.simulation]; see docs/machine-file.md";

impl FeedAxis {
    /// The mechanical ends of its travel, mm or degrees, if it has any.
    #[must_use]
    pub fn end_stops(&self) -> Option<(f64, f64)> {
        self.end_stops
    }

    /// What turns it.
    #[must_use]
    pub fn motor(&self) -> Motor {
        self.motor
    }

    /// Whether a weight pulls at it, so that it moves where nothing holds it.
    #[must_use]
    pub fn has_weight(&self) -> bool {
        self.gravity != 0.0
    }

    /// Inertia of its rotor and of what is fixed to that, kg·m².
    #[must_use]
    pub fn rotor_inertia(&self) -> f64 {
        self.motor.rotor_inertia + self.transmission_inertia
    }

    /// What it moves, kg, where the file says so.
    #[must_use]
    pub fn load(&self) -> Option<f64> {
        self.load
    }

    /// What gives way between motor and load, if something does; of a linear axis or a rotary one.
    #[must_use]
    pub fn stiffness(&self, linear: bool) -> Option<Stiffness> {
        let own = self.elasticity?;
        let kind = TRANSMISSIONS.iter().find(|it| it.name == own.name)?;
        let unit = if linear { N_PER_MICROMETRE } else { 1.0 };
        Some(Stiffness {
            name: own.name,
            stiffness: own.stiffness / unit,
            usual: kind.stiffness / unit,
            unit,
        })
    }

    /// What a motor feels of it at its shaft, through a drive whose scaling that is, on a rotary axis
    /// or a linear one.
    #[must_use]
    pub fn at_shaft(
        &self,
        scaling: &Scaling,
        mm_per_revolution: f64,
        rotary: bool,
    ) -> twin::DrivenAxis {
        // m for a radian of the shaft; rad of a rotary axis.
        let unit = if rotary { TAU / 360.0 } else { 1e-3 };
        let travel = unit * mm_per_revolution / TAU;
        let sign = scaling.direction().sign();
        let rotor_inertia = self.rotor_inertia();
        let load = self.load.map(|load| load * travel * travel);
        let load_inertia = load.unwrap_or(DEFAULT_RATIO * self.motor.rotor_inertia);
        let elasticity = self.elasticity.map(|it| Elasticity {
            play: it.play * unit / travel,
            ..Elasticity::damped(
                it.stiffness * travel * travel,
                it.damping,
                [rotor_inertia, load_inertia],
            )
        });
        let revolutions = |mm: f64| revolutions(scaling, mm_per_revolution, mm);
        let stops = self.end_stops.map(|(least, most)| {
            let (one, other) = (revolutions(least) * TAU, revolutions(most) * TAU);
            (one.min(other), one.max(other))
        });
        let errors = self.lead_error.iter();
        let errors = errors.map(|&(at, error)| (revolutions(at), sign * error / mm_per_revolution));
        twin::DrivenAxis {
            motor: self.motor,
            train: DriveTrain {
                rotor_inertia,
                load_inertia,
                elasticity,
                bearing: Friction {
                    viscous: self.motor.viscous_friction,
                    ..Friction::coulomb(self.motor.friction)
                },
                guide: Friction {
                    coulomb: self.guide.coulomb * travel,
                    breakaway: self.guide.breakaway * travel,
                    stribeck_speed: self.guide.stribeck_speed / travel,
                    viscous: self.guide.viscous * travel * travel,
                },
                load_torque: sign * self.gravity * travel,
                brake: self.brake,
                stops,
                lead_error: LeadError::new(errors.collect()),
                expansion: Expansion {
                    fixed: revolutions(self.expansion.fixed),
                    ..self.expansion
                },
            },
        }
    }
}

/// What is simulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Simulated {
    /// An axis, which is linear or rotary, and has two drives if it is a pair.
    Axis {
        rotary: bool,
        pair: bool,
    },
    Spindle,
}

/// The key of an axis or the spindle.
pub(super) fn read(
    log: &mut Log<'_>,
    axis: &mut Table<'_, '_>,
    what: Simulated,
) -> Option<Simulation> {
    let (rotary, gantry) = match what {
        Simulated::Axis { rotary, pair } => (rotary, pair),
        Simulated::Spindle => (true, false),
    };
    let mut table = axis.table_if(log, "simulation", ALLOWED)?;
    table.title = format!("{}: simulation", axis.title);
    let is_tied = table.span_of("mechanics").is_some();
    if is_tied && (!gantry || rotary) {
        let span = axis.span_of("simulation").unwrap_or_default();
        log.report(
            span,
            format!(
                "{}: `simulation` where nothing is tied together",
                axis.title
            ),
            "allowed: `mechanics` only of a linear axis whose `drives` name two, a gantry pair",
        );
        // What else is there may be right of a pair.
        return None;
    }
    let is_pair = gantry;
    let motor_is_named = table.span_of("motor").is_some();
    let gantry = is_tied.then(|| beam(log, &mut table));
    let feed_axis = feed_axis(log, &mut table, rotary, is_tied);
    let scale = match what {
        Simulated::Axis { .. } if !is_tied => scale_step(log, &mut table, rotary),
        Simulated::Axis { .. } | Simulated::Spindle => None,
    };
    let structure = match what {
        Simulated::Axis { rotary: false, .. } => structure(log, &mut table),
        Simulated::Axis { .. } | Simulated::Spindle => Vec::new(),
    };
    let encoder = encoder(log, &mut table);
    let position = if rotary { "(°)" } else { "(mm)" };
    let allowed = format!("a number from -10000000 to 10000000 {position}");
    let start = table.number_if(log, "start", &allowed, |start| start.abs() <= 1e7);
    let start = start.map(|it| Start::At(it.into_inner()));
    let start = drawn(log, &mut table, "start_within", "start", start);
    let skew = is_pair.then(|| {
        let skew = number_or(log, &mut table, "start_skew", 0.0, -1e3..=1e3, position);
        let given = (skew != 0.0).then_some(Start::At(skew));
        drawn(log, &mut table, "start_skew_within", "start_skew", given)
    });
    let allowed = format!("[from, to] {position}, the first below the second");
    let mut range = |key| {
        table
            .interval_if(log, key, &allowed)
            .map(Spanned::into_inner)
    };
    let switches = HomeSwitches {
        reference: range("reference_switch"),
        limits: range("limit_switches"),
    };
    let ripple = match what {
        Simulated::Spindle => ripple(log, &mut table),
        Simulated::Axis { .. } => None,
    };
    table.finish(log);
    Some(Simulation {
        ripple,
        switches,
        start,
        skew: skew.flatten().unwrap_or(Start::At(0.0)),
        axis: feed_axis,
        gantry: match gantry {
            Some(gantry) => Some(gantry?),
            None => None,
        },
        motor_is_named,
        encoder,
        scale,
        structure,
    })
}

/// A start that the seed draws, by this key, in the place of a `given` one.
fn drawn(
    log: &mut Log<'_>,
    table: &mut Table<'_, '_>,
    key: &'static str,
    fixed: &str,
    given: Option<Start>,
) -> Option<Start> {
    let allowed = "[from, to], the first below the second";
    let Some(within) = table.interval_if(log, key, allowed) else {
        return given;
    };
    if given.is_some() {
        let problem = format!("{}: `{fixed}` and `{key}`", table.title);
        let help = format!("allowed: one of `{fixed}` and `{key}`");
        log.report(within.span(), problem, help);
    }
    let (from, to) = within.into_inner();
    Some(Start::Within(from, to))
}

fn beam(log: &mut Log<'_>, table: &mut Table<'_, '_>) -> Option<Gantry> {
    let kind = table.choice(log, "mechanics", [RIGID_BEAM].into_iter());
    let mut number = |key, range: RangeInclusive<f64>, unit: &str| {
        let (least, most) = (range.start(), range.end());
        let allowed = format!("a number from {least} to {most} {unit}");
        let found = table.number(log, key, &allowed, |number| range.contains(&number));
        found.map(|number| *number.get_ref())
    };
    let mass = number("mass", 0.001..=1e6, "(kg)");
    let inertia = number(
        "inertia",
        1e-6..=1e9,
        "(kg·m², about the middle of the beam)",
    );
    let span = number("span", 1.0..=1e6, "(mm from side to side)");
    let mut number = |key, range, unit| number_or(log, table, key, 0.0, range, unit);
    let racking = Racking {
        stiffness: number("racking_stiffness", 0.0..=1e12, "(N·m/rad)"),
        damping: number("racking_damping", 0.0..=1e9, "(N·m·s/rad)"),
    };
    let carriage = carriage(log, table);
    kind?;
    Some(Gantry {
        beam: Beam {
            mass: mass?,
            inertia: inertia?,
            span: span? / 1000.0,
            racking,
        },
        carriage,
    })
}

/// What runs along a beam; its other keys are there with `carriage` only.
fn carriage(log: &mut Log<'_>, table: &mut Table<'_, '_>) -> Option<Carriage> {
    let is_there = table.span_of("carriage").is_some();
    let allowed = "another linear axis of this machine with one drive";
    let axis = table.text_if(log, "carriage", allowed, |_| true);
    if !is_there {
        return None;
    }
    let allowed = "a number from 0.001 to 1000000 (kg)";
    let range = 0.001..=1e6;
    let mass = table.number(log, "carriage_mass", allowed, |mass| range.contains(&mass));
    let allowed = "a number from -1000000 to 1000000 (mm)";
    let middle = table.number_if(log, "carriage_middle", allowed, |at| at.abs() <= 1e6);
    Some(Carriage {
        axis: axis?,
        mass: mass?.into_inner(),
        middle: middle.map(Spanned::into_inner),
    })
}

/// Whether what runs along the beam of an axis is an axis of one drive, and on the beam.
pub(super) fn check(log: &mut Log<'_>, axis: &Axis, axes: &[Axis]) {
    let gantry = axis.simulation.as_ref().and_then(|it| it.gantry.as_ref());
    let Some((beam, carriage)) = gantry.and_then(|it| Some((&it.beam, it.carriage.as_ref()?)))
    else {
        return;
    };
    let others = axes
        .iter()
        .filter(|it| it.drives.len() == 1 && it.letter.is_linear() && it.name() != axis.name());
    let mut named = others
        .clone()
        .filter(|it| it.name() == carriage.axis.get_ref());
    if let Some(mover) = named.next() {
        let (least, most) = mover.limits.position;
        let middle = carriage.middle_of(mover);
        let furthest = (middle - least).max(most - middle);
        // In mm as the file has it, without what that was rounded by in m.
        let span = (1e9 * beam.span).round() / 1e6;
        // As far beyond an end as to it from the middle, no carriage is on its beam.
        if furthest > span {
            log.report(
                carriage.axis.span(),
                format!(
                    "axis \"{}\": simulation: axis \"{}\" goes {furthest} mm from the middle of a beam of {span} mm",
                    axis.name(),
                    mover.name()
                ),
                "allowed: at most its `span`, which is in mm; `carriage_middle` is where that axis is in the middle",
            );
        }
    } else {
        let names = others.map(Axis::name);
        log.report(
            carriage.axis.span(),
            format!(
                "axis \"{}\": simulation: axis \"{}\" cannot run along its beam",
                axis.name(),
                carriage.axis.get_ref()
            ),
            format!(
                "allowed: another linear axis of this machine with one drive: {}",
                one_of(names)
            ),
        );
    }
}

/// A number that has to be there.
pub(super) fn number(
    log: &mut Log<'_>,
    table: &mut Table<'_, '_>,
    key: &'static str,
    range: RangeInclusive<f64>,
    unit: &str,
) -> Option<f64> {
    let allowed = format!("a number from {} to {} {unit}", range.start(), range.end());
    let found = table.number(log, key, &allowed, |number| range.contains(&number));
    found.map(|number| *number.get_ref())
}

/// A number in a range, or its default.
pub(super) fn number_or(
    log: &mut Log<'_>,
    table: &mut Table<'_, '_>,
    key: &'static str,
    default: f64,
    range: RangeInclusive<f64>,
    unit: &str,
) -> f64 {
    let allowed = format!("a number from {} to {} {unit}", range.start(), range.end());
    let found = table.number_if(log, key, &allowed, |number| range.contains(&number));
    found.map_or(default, |number| *number.get_ref())
}

/// Motor, friction and brake; and what a beam takes the place of, unless there is one.
fn feed_axis(
    log: &mut Log<'_>,
    table: &mut Table<'_, '_>,
    rotary: bool,
    is_tied: bool,
) -> FeedAxis {
    let [force, speed, viscous] = if rotary {
        ["(N·m)", "(°/s)", "(N·m·s/rad)"]
    } else {
        ["(N)", "(mm/s)", "(N·s/m)"]
    };
    let default = Motor::default();
    let names = MOTORS.iter().map(|motor| motor.name);
    let name = table.choice_or(log, "motor", default.name, names);
    let mut motor = *Motor::by_name(&name).unwrap_or(&MOTORS[1]);
    let mut number = |key, default, range, unit| number_or(log, table, key, default, range, unit);
    motor.rotor_inertia = number("rotor_inertia", motor.rotor_inertia, 1e-7..=10.0, "(kg·m²)");
    motor.friction = number("motor_friction", motor.friction, 0.0..=1e3, "(N·m)");
    motor.viscous_friction = number(
        "motor_viscous_friction",
        motor.viscous_friction,
        0.0..=10.0,
        "(N·m·s/rad)",
    );
    motor.brake_torque = number("brake_torque", motor.brake_torque, 0.0..=1e5, "(N·m)");
    let mut axis = FeedAxis {
        transmission_inertia: number("transmission_inertia", 0.0, 0.0..=10.0, "(kg·m²)"),
        load: None,
        elasticity: None,
        guide: Friction {
            coulomb: number("friction", 0.0, 0.0..=1e6, force),
            viscous: number("viscous_friction", 0.0, 0.0..=1e6, viscous),
            ..Friction::default()
        },
        gravity: number("gravity", 0.0, -1e6..=1e6, force),
        brake: Brake {
            torque: motor.brake_torque,
            ..Brake::default()
        },
        end_stops: None,
        lead_error: Vec::new(),
        expansion: Expansion::default(),
        motor,
    };
    axis.guide.breakaway = axis.guide.coulomb;
    if is_tied {
        return axis;
    }
    let least = axis.guide.coulomb;
    axis.guide.breakaway = number("breakaway_friction", least, least..=1e6, force);
    let unit = if rotary { TAU / 360.0 } else { 1e-3 };
    axis.guide.stribeck_speed = unit * number("stribeck_velocity", 2.0, 1e-3..=1e4, speed);
    axis.brake.opening = 1e-3 * number("brake_opening_ms", 0.0, 0.0..=1e3, "(ms)");
    axis.brake.closing = 1e-3 * number("brake_closing_ms", 0.0, 0.0..=1e3, "(ms)");
    load(log, table, rotary, &mut axis);
    axis
}

/// What the transmission moves, and how well it does.
fn load(log: &mut Log<'_>, table: &mut Table<'_, '_>, rotary: bool, axis: &mut FeedAxis) {
    let [mass, stiffness, position] = if rotary {
        ["(kg·m², about the axis)", "(N·m/rad)", "(°)"]
    } else {
        ["(kg)", "(N/µm)", "(mm)"]
    };
    let allowed = format!("a number from 0.000001 to 1000000 {mass}");
    let range = 1e-6..=1e6;
    let found = table.number_if(log, "load", &allowed, |load| range.contains(&load));
    axis.load = found.map(|load| *load.get_ref());

    let names = TRANSMISSIONS.iter().map(|it| it.name).chain([STIFF]);
    let name = table.choice_or(log, "transmission", STIFF, names);
    if let Some(kind) = TRANSMISSIONS.iter().find(|it| it.name == name) {
        let mut number =
            |key, default, range, unit| number_or(log, table, key, default, range, unit);
        let scale = if rotary { 1.0 } else { N_PER_MICROMETRE };
        axis.elasticity = Some(Transmission {
            stiffness: scale * number("stiffness", kind.stiffness / scale, 1e-3..=1e9, stiffness),
            damping: number("damping", kind.damping, 0.0..=1.0, "(damping ratio)"),
            play: number("play", kind.play, 0.0..=100.0, position),
            ..*kind
        });
    }
    let allowed = format!("[least, greatest] position {position}, the first below the second");
    let found = table.interval_if(log, "end_stops", &allowed);
    axis.end_stops = found.map(|stops| stops.into_inner());
    let micro = if rotary { "0.001°" } else { "µm" };
    let allowed = format!(
        "[[position, error], …] {position} and {micro}, in ascending order of position, errors of at \
         most 1000000"
    );
    let accept = |[_, error]: [f64; 2]| error.abs() <= 1e6;
    let found = table.points_if(log, "lead_error", &allowed, accept);
    let points = found.map_or(Vec::new(), |points| points.into_inner());
    axis.lead_error = points.into_iter().map(|[at, it]| (at, it * 1e-3)).collect();
    if !rotary {
        axis.expansion = expansion(log, table);
    }
}

/// By how much the transmission grows with warmth; its other keys are there with `temperature_rise` only.
fn expansion(log: &mut Log<'_>, table: &mut Table<'_, '_>) -> Expansion {
    let allowed = "a number from -100 to 100 (K)";
    let rise = table.number_if(log, "temperature_rise", allowed, |rise| rise.abs() <= 100.0);
    let Some(rise) = rise.map(Spanned::into_inner) else {
        return Expansion::default();
    };
    let mut number = |key, default, range, unit| number_or(log, table, key, default, range, unit);
    Expansion {
        strain: 1e-6 * rise * number("expansion", STEEL, 0.0..=100.0, "(µm/m/K)"),
        fixed: number("fixed_at", 0.0, -1e7..=1e7, "(mm)"),
        time: number("warming_time", 0.0, 0.0..=1e6, "(s)"),
    }
}

/// How unevenly a spindle turns.
fn ripple(log: &mut Log<'_>, table: &mut Table<'_, '_>) -> Option<twin::Ripple> {
    let part = number_or(
        log,
        table,
        "speed_ripple",
        0.0,
        0.0..=0.2,
        "(a part of the speed)",
    );
    let periods = table.integer_or(
        log,
        "ripple_periods",
        1,
        1..=1000,
        " (in a turn of the motor)",
    );
    (part > 0.0).then_some(twin::Ripple {
        part,
        periods: periods as u32,
    })
}

/// What a scale at the load tells apart, mm, if there is one.
fn scale_step(log: &mut Log<'_>, table: &mut Table<'_, '_>, rotary: bool) -> Option<f64> {
    let micro = if rotary { "(0.001°)" } else { "(µm)" };
    let allowed = format!("a number from 0.001 to 1000 {micro}");
    let range = 1e-3..=1e3;
    let found = table.number_if(log, "scale_step", &allowed, |step| range.contains(&step));
    found.map(|step| step.into_inner() * 1e-3)
}

/// How the machine sways along a linear axis.
fn structure(log: &mut Log<'_>, table: &mut Table<'_, '_>) -> Vec<StructureMode> {
    let allowed = format!(
        "[[frequency, damping, mass], …], at most {MOST_MODES}, in ascending order of frequency: 0.5 to 1000 Hz, damping \
         ratios from 0.001 to 0.3, 1 to 10000000 kg"
    );
    let accept = |[frequency, damping, mass]: [f64; 3]| {
        (0.5..=1e3).contains(&frequency)
            && (1e-3..=0.3).contains(&damping)
            && (1.0..=1e7).contains(&mass)
    };
    let found = table.points_if(log, "structure", &allowed, accept);
    let (span, modes) = found.map_or_else(Default::default, |it| (it.span(), it.into_inner()));
    if modes.len() > MOST_MODES {
        let problem = format!("{}: {} modes of `structure`", table.title, modes.len());
        log.report(span, problem, format!("allowed: {allowed}"));
    }
    let mode = |[frequency, damping, mass]: [f64; 3]| StructureMode {
        frequency,
        damping,
        mass,
    };
    modes.into_iter().map(mode).collect()
}

/// What makes the encoder's reading wrong, if anything is said of it.
fn encoder(log: &mut Log<'_>, table: &mut Table<'_, '_>) -> Option<EncoderErrors> {
    let keys = [
        "encoder_noise",
        "encoder_error",
        "encoder_periods",
        "encoder_steps",
    ];
    let said = keys.iter().any(|key| table.span_of(key).is_some());
    let mut number = |key| number_or(log, table, key, 0.0, 0.0..=1e6, "(increments)");
    let (noise, interpolation) = (number(keys[0]), number(keys[1]));
    let mut count = |key, default, range| table.integer_or(log, key, default, range, "");
    let periods = count(keys[2], 128, 1..=1_000_000) as u32;
    let steps = count(keys[3], 0, 0..=1 << 30) as u32;
    said.then_some(EncoderErrors {
        noise,
        steps,
        periods,
        interpolation,
    })
}
