//! Why a machine does not follow: which repair alone would let it.
//!
//! A motor that is too weak, a transmission that is too soft, a load that is too heavy and loops that are set wrong all
//! end in the same following error, most of them in the same torque; a structure that sways has the tool off the path
//! as well. What tells them apart is what helps. So a run that failed because an axis did not follow is run once more
//! with one value of the machine file mended at a time, by the same controller on the same drives, as far as it failed
//! and a little further. The first repair that lets it follow names the cause, in this order:
//!
//! - `gains`: without what `sdo` sets in its drives, which have the gains then that suit the axis,
//! - `structure`: with a structure that does not sway along one axis: then the axes follow, and only an input shaper or
//!   gentler motion helps,
//! - `end_stops`: without the mechanical ends of its travel, which it met,
//! - `motor`: with the next greater generic motors. A motor changes nothing of what loops can be on an axis that
//!   gives way,
//! - `transmission`: with the usual stiffness of its kind, where the file states less,
//! - `load`: with a half, a quarter … of it. A load that neither a greater motor nor a usual transmission
//!   carries is too heavy; one that a greater motor does carry is a motor that is too weak.
//!
//! Where none of them helps alone, that is said.

use super::Inputs;
use crate::machine::{Axis, Machine, Simulation};
use crate::observe::record::Violation;
use crate::observe::summary::{Cause, Summary};
use crate::program::Program;
use crate::session::Status;
use std::error::Error;
use std::path::Path;
use syncline_drives::twin::servo::motor::MOTORS;

/// So much longer than until it failed a machine has to follow, s.
const BEYOND: f64 = 0.5;

/// What parts of a load are tried.
const LIGHTER: [f64; 4] = [2.0, 4.0, 8.0, 16.0];

/// What was validated, so that it can be again.
#[derive(Debug)]
pub struct Again<'a> {
    /// The machine file.
    pub file: &'a Path,
    /// Other values of its keys.
    pub settings: &'a [String],
    /// Other tables than those beside it.
    pub tables: Option<&'a Path>,
    /// What was run.
    pub program: &'a Program,
    /// With which seed.
    pub seed: u64,
}

/// A value of the machine file that would be another one.
struct Repair<'a> {
    what: &'static str,
    axis: &'a Axis,
    /// As [`Machine::load_with`] takes them.
    settings: Vec<String>,
    /// What is there now.
    now: String,
}

impl Again<'_> {
    /// Why the machine did not follow; `None` where it did, or where nothing is known of the axis that could be
    /// mended.
    ///
    /// # Errors
    /// The machine file or the tables cannot be read any more, or a run came to no result.
    pub fn cause(
        &self,
        machine: &Machine,
        summary: &Summary,
    ) -> Result<Option<Cause>, Box<dyn Error>> {
        let Some((time, axis)) = failed(machine, summary) else {
            return Ok(None);
        };
        let repairs = repairs(machine, summary, axis);
        let tried = !repairs.is_empty();
        for repair in repairs {
            let Some(max_torque) = self.follows(&repair, time)? else {
                continue;
            };
            return Ok(Some(Cause {
                what: repair.what,
                axis: repair.axis.name().to_owned(),
                now: repair.now,
                follows_with: repair.settings,
                max_torque_then: Some(max_torque),
            }));
        }
        Ok(tried.then(|| Cause {
            what: "several",
            axis: axis.name().to_owned(),
            now: "no other gains, motor, transmission or load alone let it follow".to_owned(),
            follows_with: Vec::new(),
            max_torque_then: None,
        }))
    }

    /// Whether the machine follows for so long with a repair, and the greatest torque of the axis's drives then, N·m.
    fn follows(&self, repair: &Repair<'_>, time: f64) -> Result<Option<f64>, Box<dyn Error>> {
        let settings = [self.settings, &repair.settings].concat();
        let inputs = Inputs::read(self.file, &settings, self.tables)?;
        let until = time + BEYOND;
        let goes_on = |status: &Status| status.time.is_none_or(|now| now < until);
        let program = self.program.clone();
        let (summary, _) = inputs.validate(program, self.seed, false, goes_on)?;
        if failed(&inputs.machine, &summary).is_some_and(|(failed, _)| failed <= until) {
            return Ok(None);
        }
        let drives = repair.axis.drives.iter();
        let drives = drives.filter_map(|&at| summary.drives.get(at));
        Ok(Some(drives.fold(0.0, |most, it| it.max_torque.max(most))))
    }
}

/// When a run first showed that an axis does not follow, s, and which one. A sample that is refused says nothing of the axis.
fn failed<'a>(machine: &'a Machine, summary: &Summary) -> Option<(f64, &'a Axis)> {
    if summary.refused_a_sample_alone() {
        return None;
    }
    let rounding = summary.path.max_deviation_mm > machine.validation.contour_error;
    let is_shown = |it: &&Violation| match it.what.as_str() {
        "following_error" | "skew" => true,
        // What the planner rounds off is no drive's affair.
        "contour_error" => !rounding,
        what => what.starts_with("fault: ") && blamed(summary).is_some(),
    };
    let first = summary.violations.iter().find(is_shown)?;
    let by_name = |name: &str| machine.axes.iter().find(|axis| axis.name() == name);
    let named = first.axis.as_deref().or_else(|| blamed(summary));
    let worst = || {
        let parts = machine.axes.iter().zip(&summary.axes);
        let parts = parts.map(|(axis, of)| {
            let part = of.max_following_error_mm / axis.limits.following_error;
            (part, axis)
        });
        let worst = parts.max_by(|one, other| one.0.total_cmp(&other.0));
        worst.map(|(_, axis)| axis)
    };
    let axis = named.map_or_else(worst, by_name)?;
    Some((first.time, axis))
}

/// The axis whose fault, or whose drive's, ended a run, if that can be for not following.
fn blamed(summary: &Summary) -> Option<&str> {
    summary.stopped.as_ref().filter(|it| it.may_lag)?.axis
}

/// What may be tried where an axis did not follow, in order.
fn repairs<'a>(machine: &'a Machine, summary: &Summary, axis: &'a Axis) -> Vec<Repair<'a>> {
    let mut repairs: Vec<Repair> = gains(machine, axis).into_iter().collect();
    repairs.extend(structures(machine, summary));
    let Some(simulation) = &axis.simulation else {
        return repairs;
    };
    let key = |key: &str| format!("axis.{}.simulation.{key}", axis.name());
    if let Some((least, most)) = simulation.axis.end_stops() {
        repairs.push(Repair {
            what: "end_stops",
            axis,
            settings: vec![format!("{}=[-1e6, 1e6]", key("end_stops"))],
            now: format!("between {least} and {most} {}", axis.units()[0]),
        });
    }
    if let Some(motor) = simulation.driven().map(|it| it.motor()) {
        let greater = MOTORS
            .iter()
            .filter(|it| it.peak_torque > motor.peak_torque);
        repairs.extend(greater.map(|it| Repair {
            what: "motor",
            axis,
            settings: vec![format!("{}=\"{}\"", key("motor"), it.name)],
            now: format!("{} of {:.2} N·m", motor.name, motor.peak_torque),
        }));
    }
    let linear = axis.letter.is_linear();
    let swings = frequency(machine, axis, simulation);
    if let Some(it) = simulation.axis.stiffness(linear)
        && it.stiffness < it.usual
    {
        let unit = if linear { "N/µm" } else { "N·m/rad" };
        repairs.push(Repair {
            what: "transmission",
            axis,
            settings: vec![format!("{}={:?}", key("stiffness"), it.usual)],
            now: format!("{} of {:.4} {unit}{swings}", it.name, it.stiffness),
        });
    }
    if let Some(load) = simulation.axis.load() {
        let unit = if linear { "kg" } else { "kg·m²" };
        repairs.extend(LIGHTER.iter().map(|by| Repair {
            what: "load",
            axis,
            settings: vec![format!("{}={:?}", key("load"), load / by)],
            now: format!("{load:.3} {unit}{swings}"),
        }));
    }
    repairs
}

/// The drives of an axis as they are by themselves, where the file sets objects in them.
fn gains<'a>(machine: &Machine, axis: &'a Axis) -> Option<Repair<'a>> {
    let drives = axis.drives.iter().map(|&drive| &machine.drives[drive]);
    let set: Vec<_> = drives.filter(|it| !it.objects.is_empty()).collect();
    let objects = set.iter().flat_map(|it| &it.objects);
    let objects: Vec<_> = objects.map(|it| it.address.to_string()).collect();
    (!set.is_empty()).then(|| Repair {
        what: "gains",
        axis,
        settings: set
            .iter()
            .map(|it| format!("drive.{:?}.sdo=[]", it.name))
            .collect(),
        now: format!("the file sets {}", objects.join(", ")),
    })
}

/// Each axis along which the structure sways, without that; where it swayed most first.
fn structures<'a>(
    machine: &'a Machine,
    summary: &Summary,
) -> impl Iterator<Item = Repair<'a>> + use<'a> {
    let mut swayed: Vec<_> = summary.structures.iter().collect();
    swayed.sort_by(|one, other| other.max_sway_mm.total_cmp(&one.max_sway_mm));
    let swayed: Vec<_> = swayed
        .into_iter()
        .map(|it| (it.axis, it.max_sway_mm))
        .collect();
    swayed.into_iter().filter_map(|(name, sway)| {
        let axis = machine.axes.iter().find(|it| it.name() == name)?;
        Some(Repair {
            what: "structure",
            axis,
            settings: vec![format!("axis.{name}.simulation.structure=[]")],
            now: format!("the tool sways by {sway:.4} mm"),
        })
    })
}

/// The frequency at which the load of an axis takes up everything, in words, if something gives way.
fn frequency(machine: &Machine, axis: &Axis, simulation: &Simulation) -> String {
    let feels = machine.at_shaft(axis.drives[0], &simulation.axis);
    feels
        .train
        .resonances()
        .map_or_else(String::new, |it| format!(", antiresonance {:.1} Hz", it.0))
}
