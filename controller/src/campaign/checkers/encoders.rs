//! An encoder beside an axis is listened to: where it falls silent, or says something else than the drives, the machine
//! stops; where it agrees with them nobody says that it does not.
//!
//! By how much an encoder is off is known from what happened to its coupling: it has slipped, or has broken, so that the encoder stays
//! where it was as the axis goes on.

use super::super::interference::{Interference, ToDrive};
use super::reactions::{SILENT, is_up};
use super::{Checker, Found, Scene};
use crate::control::{self, Fault, Phase, fault::AxisCause};
use crate::session::Event;
use syncline_canopen::{CanId, CobId, Instant};
use syncline_drives::bus::Transmission;

const NAME: &str = "encoders";

/// Cycles, beyond those for which a T_PDO may be missing, until a difference is told.
const IN_TIME: u32 = 4;
/// So much longer, s, and at rest, that is slower than so many rev/s, where a drive is asked for its position.
const ASKED: f64 = 0.4;
const AT_REST: f64 = 0.02;
/// So many revolutions of the motor, and increments of an encoder that counts 4,096 a revolution, may be between what
/// encoder and drives say at one SYNC.
const MARGIN: (f64, f64) = (0.1, 2.0 / 4096.0);

/// See the module.
pub(super) struct Encoders(Vec<Watched>);

/// An encoder.
#[derive(Clone, Debug, Default)]
struct Watched {
    /// SYNCs without a T_PDO.
    silent: u32,
    /// How far its coupling has slipped, mm.
    slipped: f64,
    /// Where it stays as the coupling is broken, mm that what it sees has gone.
    parted: Option<f64>,
    /// It broke before anything was seen of what moves it.
    parts: bool,
    /// How far it was off as a drive of its axis learned its place from it, mm.
    learned: f64,
    /// Since when that is more than allowed while axes may move.
    since: Option<Instant>,
    /// A drive of its axis is asked for its position, which is held against it at rest alone.
    waits_for_rest: bool,
    /// Such a drive, a stepper, may have lost steps: its shaft was blocked, or it had no torque.
    loses_steps: bool,
    /// Something holds its motor, or lets go of it.
    is_held: bool,
    /// The last phase in which a drive of its axis learns its place from it; `None`: it does not.
    taught: Option<Phase>,
}

impl Watched {
    /// How far it is off, beside what drives have learned from it, while what it sees has gone so far, mm.
    fn off(&self, gone: f64) -> f64 {
        self.parted.map_or(self.slipped, |stays| stays - gone) - self.learned
    }
}

/// How far what an encoder sees has gone, mm.
fn gone(scene: &Scene<'_>, encoder: usize) -> f64 {
    let axis = scene.machine.encoders[encoder].axis;
    let seen = axis.map(|axis| scene.machine.axes[axis].drives[0]);
    let gone = seen.and_then(|drive| {
        let travel = scene.machine.drives[drive].scaling.travel_per_revolution();
        Some(scene.plants.get(drive)?.load_position * travel)
    });
    gone.unwrap_or_default()
}

impl Encoders {
    pub(super) fn new(scene: &Scene<'_>) -> Self {
        let machine = scene.machine;
        let watched = machine.encoders.iter().map(|encoder| {
            let axis = encoder.axis.map(|axis| &machine.axes[axis]);
            let mut drives = axis.into_iter().flat_map(|axis| &axis.drives);
            Watched {
                waits_for_rest: drives.any(|drive| scene.is_polled(*drive)),
                taught: encoder.axis.and_then(|axis| taught(scene, axis)),
                ..Watched::default()
            }
        });
        Self(watched.collect())
    }
}

/// By how much an encoder and its drives may differ, and by how much they seem to without a slip, mm.
fn allowed(scene: &Scene<'_>, encoder: usize) -> (f64, f64) {
    let machine = scene.machine;
    let Some(axis) = machine.encoders[encoder].axis else {
        return (f64::INFINITY, 0.0);
    };
    let limit = machine.axes[axis].feedback.map(|it| it.difference);
    let specs = scene.case.machine.axes[axis].encoder.as_ref();
    let pitch = specs.map_or(0.0, |it| it.pitch);
    let margin = MARGIN.0 * scene.case.machine.axes[axis].travel + MARGIN.1 * pitch;
    // It sees what lies behind the drives, and counts from where that stood at first.
    let margin = margin + 2.0 * scene.corrected[axis].greatest();
    (limit.unwrap_or(f64::INFINITY), margin)
}

/// The last phase in which a drive learns its place from the encoder of its axis; `None`: it does not.
fn taught(scene: &Scene<'_>, axis: usize) -> Option<Phase> {
    let machine = scene.machine;
    let axis = &machine.axes[axis];
    let counts_anew = |drive: &usize| {
        let device = machine.device(*drive);
        device
            .feedback()
            .is_some_and(|it| !it.counts_without_power())
    };
    let counts_anew = axis.drives.iter().any(counts_anew);
    let closes_loop = axis.feedback?.closes_loop;
    match closes_loop || axis.homing.tells_place() {
        true if counts_anew => Some(Phase::Disabled),
        true if closes_loop => Some(Phase::Lock),
        _ => None,
    }
}

impl Checker for Encoders {
    fn sync(&mut self, scene: &Scene<'_>, bus: usize, found: &mut Found) {
        let drives = scene.machine.drives.len();
        for (place, (spec, watched)) in scene.machine.encoders.iter().zip(&mut self.0).enumerate() {
            if spec.bus != bus {
                continue;
            }
            watched.silent += 1;
            if !is_up(scene.state) || scene.faulted {
                watched.silent = 0;
            } else if watched.silent > scene.misses(drives + place) + SILENT
                && scene.buses_are_sound()
            {
                watched.silent = 0;
                let what = "nothing is done about a silent encoder";
                found.violate(NAME, scene, what, || spec.name.clone());
            }
        }
    }

    fn frame(&mut self, scene: &Scene<'_>, bus: usize, sent: &Transmission, _: &mut Found) {
        for (spec, watched) in scene.machine.encoders.iter().zip(&mut self.0) {
            let t_pdos = (1..=4).map(|number| CobId::t_pdo(number, spec.node));
            let mut own = t_pdos.filter(|it| CanId::from(*it) == sent.frame.id());
            if spec.bus == bus && own.next().is_some() {
                watched.silent = 0;
            }
        }
    }

    fn interfered(&mut self, scene: &Scene<'_>, what: &Interference, _: &mut Found) {
        if let Interference::Drive(drive, ToDrive::Block(held) | ToDrive::LoseTorque(held)) = what {
            for (spec, watched) in scene.machine.encoders.iter().zip(&mut self.0) {
                let axis = spec.axis.map(|axis| &scene.machine.axes[axis]);
                let moves_it = axis.is_some_and(|axis| axis.drives.contains(drive));
                if moves_it && watched.waits_for_rest {
                    watched.is_held = *held;
                    watched.loses_steps |= *held;
                }
            }
        }
        if let Interference::Slip(device, by) = what {
            let encoder = device - scene.machine.drives.len();
            // Of one that counts down as its axis goes up, a slip forwards is one back of the axis.
            let scaling = &scene.machine.encoders[encoder].scaling;
            self.0[encoder].slipped += by * scaling.travel_per_revolution();
        }
        let drives = scene.machine.drives.len();
        match what {
            Interference::Part(device) => {
                let (watched, gone) = (&mut self.0[device - drives], gone(scene, device - drives));
                watched.parts = scene.plants.is_empty();
                if !watched.parts {
                    watched.parted.get_or_insert(watched.slipped + gone);
                }
            }
            Interference::Join(device) => {
                let watched = &mut self.0[device - drives];
                (watched.parted, watched.parts) = (None, false);
            }
            _ => {}
        }
    }

    fn told(&mut self, scene: &Scene<'_>, event: &Event, found: &mut Found) {
        let Event::Machine(control::Event::Fault(Fault::Axis(
            axis,
            AxisCause::FeedbackDifference { .. },
        ))) = event
        else {
            return;
        };
        let mut encoders = scene.machine.encoders.iter();
        let Some(encoder) = encoders.position(|it| it.axis == Some(*axis)) else {
            return;
        };
        let (limit, margin) = allowed(scene, encoder);
        let (off, loses_steps) = (
            self.0[encoder].off(gone(scene, encoder)),
            self.0[encoder].loses_steps,
        );
        if off.abs() + margin < limit && !loses_steps && scene.buses_are_sound() {
            let what = "an encoder is said to disagree that does not";
            found.violate(NAME, scene, what, || {
                format!("it is {off} mm off: {event:?}")
            });
        }
    }

    fn woken(&mut self, scene: &Scene<'_>, found: &mut Found) {
        let drives = scene.machine.drives.len();
        for (encoder, watched) in self.0.iter_mut().enumerate() {
            let Some(axis) = scene.machine.encoders[encoder].axis else {
                continue;
            };
            let cycles = scene.misses(drives + encoder) + IN_TIME;
            let mut in_time = f64::from(cycles) * scene.period();
            let mut is_compared = true;
            let gone = gone(scene, encoder);
            if std::mem::take(&mut watched.parts) {
                watched.parted = Some(watched.slipped + gone);
            }
            if watched.taught.is_some_and(|last| scene.phase <= last) {
                // It loses some again while it is held.
                watched.loses_steps = watched.is_held;
                watched.learned += watched.off(gone);
            }
            if watched.waits_for_rest {
                in_time += ASKED;
                let mut drives = scene.machine.axes[axis].drives.iter();
                is_compared = drives.all(|it| scene.plants[*it].velocity.abs() < AT_REST);
            }
            let (limit, margin) = allowed(scene, encoder);
            let off = watched.off(gone);
            let is_over = off.abs() > limit + margin;
            if !is_over || !is_compared || !is_up(scene.state) || scene.faulted {
                watched.since = None;
            } else if scene.since(*watched.since.get_or_insert(scene.now)) > in_time
                && scene.buses_are_sound()
            {
                let what = "nothing is done about an encoder that disagrees";
                found.violate(NAME, scene, what, || {
                    let name = &scene.machine.encoders[encoder].name;
                    format!("{name} is {off} mm off")
                });
            }
        }
    }
}
