//! `[spindle]`: the speeds that a program may ask for, how long they take to come, and the drive that turns it.

use super::read::{DriveTable, TURN};
use super::simulation::Simulated;
use super::{InputMeaning, Machine, Simulation, simulation};
use std::ops::Range;
use std::time::Duration;
use syncline_canopen::NodeId;
use syncline_drives::model::{Assumed, MODELS, Model, Scaling, Setpoint, Settings, Write};
use syncline_strict_toml::{Log, Table, one_of};
use syncline_trajectory::limits::Limits;
use syncline_trajectory::profile::State;
use syncline_trajectory::state_to_state;
use syncline_trajectory::synchronous::{LEAST_RISE, RAMP_PART};
use toml::Spanned;

/// The machine's spindle.
#[derive(Clone, Debug)]
pub struct Spindle {
    /// S within these, 1/min, or 0.
    pub speeds: (f64, f64),
    /// A speed is reached after so long, or within so long where an input tells when it is. A drive goes from rest to
    /// the greatest speed in this time.
    pub ramp: Duration,
    /// A cut may go on for so long after the speed is lost, where an input or a drive tells of it.
    pub loss: Duration,
    /// What turns it, where that is a drive on a bus.
    pub drive: Option<SpindleDrive>,
}

/// A drive that turns a spindle. It has no place on the path.
#[derive(Clone, Debug)]
pub struct SpindleDrive {
    /// As messages name it.
    pub name: String,
    /// Index of its bus in [`Machine::buses`].
    pub bus: usize,
    /// Its node id, unique on the bus.
    pub node: NodeId,
    /// What it is.
    pub model: &'static Model,
    /// Written after the standard set-up, in this order.
    pub objects: Vec<Write>,
    /// Degrees of the spindle and increments of the drive.
    pub scaling: Scaling,
    /// The spindle has its speed where its drive measures no other one by more than this part of it.
    pub tolerance: f64,
    /// It has come to an angle where its drive measures no other one by more, degrees.
    pub orientation_tolerance: f64,
    /// What it moves when it is simulated; `None`: what its model has.
    pub simulation: Option<Simulation>,
}

impl SpindleDrive {
    /// How fast its motor turns at a speed of the spindle, 1/min: increments/s.
    #[must_use]
    pub fn increments_per_second(&self, speed: f64) -> f64 {
        (self.scaling).to_increments_per_second(degrees_per_second(speed))
    }
}

/// A speed in 1/min.
pub(crate) const fn degrees_per_second(speed: f64) -> f64 {
    speed * TURN / 60.0
}

/// What is known of when the spindle has its speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SpinUp {
    /// Nothing.
    Unknown,
    /// So long after the change.
    After(Duration),
    /// Once an input or its drive tells so, which it does within this time.
    Told {
        /// The greatest time.
        within: Duration,
    },
}

/// What a drive may take beyond its ramps to be at speed, or to stand.
const SETTLING: Duration = Duration::from_secs(1);

impl Spindle {
    /// Longest time in which a drive has the spindle turn as it is told: from the greatest speed to the same one
    /// the other way round.
    #[must_use]
    pub fn reversal(&self) -> Duration {
        self.ramp * 2 + SETTLING
    }

    /// As fast as its drive's ramp changes its speed, 1/min in a second.
    #[must_use]
    pub fn acceleration(&self) -> f64 {
        self.speeds.1 / self.ramp.as_secs_f64()
    }

    /// What a drive's ramp allows a speed to change by that changes smoothly, in turns.
    #[must_use]
    pub fn smooth_limits(&self) -> Limits {
        let [speed, ramp] = [self.speeds.1 / 60.0, self.ramp.as_secs_f64()];
        let acceleration = RAMP_PART * speed / ramp;
        Limits::symmetric(RAMP_PART * speed, acceleration, acceleration / LEAST_RISE)
    }

    /// Longest time in which a drive brings it to an angle: from the greatest speed to rest, and a whole turn from there.
    #[must_use]
    pub fn orienting(&self) -> Duration {
        let [from, to] = [0.0, 1.0].map(State::at_rest);
        let turn = state_to_state::Problem::new(from, to, self.smooth_limits());
        let turn = state_to_state::plan(&turn, 0.0).map_or(0.0, |it| it.duration());
        self.ramp + Duration::from_secs_f64(turn) + SETTLING
    }

    /// So much later than its drive is sent a speed that changes smoothly, one for each cycle, the spindle has it, s: half of
    /// the time in which the drive's ramp comes to each, and what the drive takes besides.
    /// `None` without a drive.
    pub(crate) fn delay(&self, machine: &Machine) -> Option<f64> {
        let (place, _) = machine.spindle_drive()?;
        let device = machine.device(place);
        let drive = device.drive()?;
        let lag = drive.dynamics().map_or(0.0, |it| it.lag);
        let cycle = machine.cycle.as_secs_f64();
        Some((0.5 * RAMP_PART + drive.latency() - 1.0) * cycle + lag)
    }

    /// What its drive is set up with.
    pub(super) fn settings(&self, common: Settings) -> Settings {
        let drive = self.drive.as_ref();
        let velocity = drive.map_or(0.0, |it| it.increments_per_second(self.speeds.1).abs());
        Settings {
            velocity,
            acceleration: velocity / self.ramp.as_secs_f64(),
            profile_velocity: true,
            ..common
        }
    }
}

impl SpinUp {
    /// What a machine's file says.
    #[must_use]
    pub fn of(machine: &Machine) -> Self {
        let Some(spindle) = &machine.spindle else {
            return Self::Unknown;
        };
        let mut inputs = machine.inputs.iter();
        let within = spindle.ramp;
        if spindle.drive.is_some() {
            let within = spindle.reversal();
            Self::Told { within }
        } else if inputs.any(|input| input.meaning == InputMeaning::AtSpeed) {
            Self::Told { within }
        } else if within > Duration::ZERO {
            Self::After(within)
        } else {
            Self::Unknown
        }
    }
}

/// A cut may go on for so long without its speed, ms.
const LOSS: i64 = 200;

/// Longest ramp, ms.
const MOST_RAMP: i64 = 600_000;

/// What a drive measures may differ by so much of the speed that is asked for.
const TOLERANCE: f64 = 0.05;

/// And by so much of the angle, degrees.
const ORIENTATION_TOLERANCE: f64 = 0.5;

/// A table good on its own.
pub(super) struct SpindleTable {
    speeds: (f64, f64),
    ramp: Duration,
    loss: Duration,
    turned: Option<Turned>,
}

/// What it says of its drive.
struct Turned {
    drive: Spanned<String>,
    /// Where `max_speed` stands.
    most: Range<usize>,
    /// Where `ramp_ms` stands, or the name of the drive that needs it.
    ramp: Range<usize>,
    gear: f64,
    tolerance: f64,
    orientation_tolerance: f64,
    simulation: Option<Simulation>,
}

pub(super) fn read(log: &mut Log<'_>, mut table: Table<'_, '_>) -> Option<SpindleTable> {
    let most = table.positive(log, "max_speed", "(1/min)");
    let least = table.number_if(log, "min_speed", "a number from 0 (1/min)", |speed| {
        speed >= 0.0
    });
    let ramp = table.integer_or(log, "ramp_ms", 0, 0..=MOST_RAMP, " (ms)");
    let loss = table.integer_or(log, "speed_loss_ms", LOSS, 20..=10_000, " (ms)");
    if let (Some(least), Some(most)) = (&least, &most)
        && least.get_ref() > most.get_ref()
    {
        log.report(
            least.span(),
            format!("spindle: `min_speed` is {}", least.get_ref()),
            format!("allowed: up to `max_speed`, {}", most.get_ref()),
        );
    }
    let drive = table.text_if(log, "drive", "the `name` of a [[drive]]", |_| true);
    let turned = match drive {
        Some(drive) => Turned::read(log, &mut table, drive, most.as_ref().map(Spanned::span)),
        None => None,
    };
    table.finish(log);
    Some(SpindleTable {
        speeds: (
            least.map_or(0.0, |least| *least.get_ref()),
            *most?.get_ref(),
        ),
        ramp: Duration::from_millis(ramp as u64),
        loss: Duration::from_millis(loss as u64),
        turned,
    })
}

impl Turned {
    fn read(
        log: &mut Log<'_>,
        table: &mut Table<'_, '_>,
        drive: Spanned<String>,
        most: Option<Range<usize>>,
    ) -> Option<Self> {
        let gear = table.positive_or(log, "gear", 1.0, "(motor turns per turn of the spindle)");
        let allowed = "a number from 0.001 to 0.5, a part of S";
        let tolerance = table.number_if(log, "tolerance", allowed, |part| {
            (0.001..=0.5).contains(&part)
        });
        let allowed = "a number from 0.01 to 30 (degrees)";
        let orientation_tolerance = table.number_if(log, "orientation_tolerance", allowed, |it| {
            (0.01..=30.0).contains(&it)
        });
        let simulation = simulation::read(log, table, Simulated::Spindle);
        Some(Self {
            ramp: table.span_of("ramp_ms").unwrap_or_else(|| drive.span()),
            most: most?,
            drive,
            gear,
            tolerance: tolerance.map_or(TOLERANCE, Spanned::into_inner),
            orientation_tolerance: orientation_tolerance
                .map_or(ORIENTATION_TOLERANCE, Spanned::into_inner),
            simulation,
        })
    }
}

impl SpindleTable {
    /// Takes the drive that it names out of those of axes.
    pub(super) fn take_drive(
        &self,
        log: &mut Log<'_>,
        drives: &mut Vec<DriveTable>,
    ) -> Option<DriveTable> {
        let name = &self.turned.as_ref()?.drive;
        let mut names = drives.iter().map(|drive| drive.node.name.get_ref());
        let place = names.position(|known| known == name.get_ref())?;
        let drive = drives.remove(place);
        let (divider, span) = &drive.sync_divider;
        if *divider > 1 {
            log.report(
                span.clone(),
                format!(
                    "drive \"{}\": `sync_divider` is {divider}: it turns the spindle, whose speed is looked at in every cycle",
                    name.get_ref()
                ),
                "leave the key out",
            );
        }
        Some(drive)
    }

    /// The spindle with the drive that turns it, on that bus.
    pub(super) fn join(
        self,
        log: &mut Log<'_>,
        drive: Option<(DriveTable, usize)>,
        assumed: impl Fn(&Model) -> Assumed,
    ) -> Spindle {
        let Self {
            speeds,
            ramp,
            loss,
            turned,
        } = self;
        let mut spindle = Spindle {
            speeds,
            ramp,
            loss,
            drive: None,
        };
        if let (Some((table, bus)), Some(turned)) = (drive, turned) {
            let model = table.node.model;
            let assumed = assumed(model);
            let counts = (model.increments_per_revolution)(&assumed);
            let drive = SpindleDrive {
                name: table.node.name.into_inner(),
                bus,
                node: table.node.node.into_inner(),
                model,
                objects: table.node.objects,
                scaling: Scaling::new(counts, TURN / turned.gear, table.direction, table.zero),
                tolerance: turned.tolerance,
                orientation_tolerance: turned.orientation_tolerance,
                simulation: turned.simulation,
            };
            spindle.drive = Some(drive);
            let places = [turned.drive.span(), turned.most, turned.ramp];
            spindle.check(log, assumed, places);
        }
        spindle
    }
}

impl Spindle {
    /// Whether its drive can turn it as fast, within that ramp. `places` are where the drive is named, the greatest speed
    /// and the ramp.
    fn check(&self, log: &mut Log<'_>, assumed: Assumed, places: [Range<usize>; 3]) {
        let [named, most, ramp] = places;
        let Some(drive) = &self.drive else {
            return;
        };
        let SpindleDrive { name, model, .. } = drive;
        if !model.turns_spindles() {
            let turning = MODELS.iter().filter(|model| model.turns_spindles());
            log.report(
                named,
                format!(
                    "spindle: drive \"{name}\" ({}) cannot turn at a velocity that it is sent",
                    model.title
                ),
                format!(
                    "allowed: a drive in Profile Velocity or in velocity mode: `model` {}, or one that a file describes by these",
                    one_of(turning.map(|model| model.name))
                ),
            );
            return;
        }
        if self.ramp.is_zero() {
            log.report(
                ramp,
                "spindle: `ramp_ms` is 0, and no drive takes it up to `max_speed` at once",
                "allowed: the time from rest to `max_speed`, from 1 (ms)",
            );
            return;
        }
        let device = model.device(&self.settings(Settings {
            assumed,
            ..Settings::new(drive.node, Duration::from_millis(1))
        }));
        let fastest = Setpoint {
            velocity: drive.increments_per_second(self.speeds.1),
            ..Setpoint::default()
        };
        if device.drive().is_some_and(|it| it.check(fastest).is_err()) {
            log.report(
                most,
                format!(
                    "spindle: `max_speed` {} is beyond what drive \"{name}\" can be sent",
                    self.speeds.1
                ),
                "allowed: less, or another `gear` or unit of the drive's velocity",
            );
        }
    }
}
