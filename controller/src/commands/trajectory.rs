//! `syncline validate MACHINE --trajectory FILE`: motion that others have planned or sampled, by its limits and by what
//! simulated drives make of it.

use super::output::{Claims, Target};
use super::{Exit, with_causes};
use crate::machine::{Axis, COORDINATES, Machine, Motion};
use crate::observe::sampled::{SampledMotion, Samples};
use crate::observe::summary::Summary;
use crate::program::{Program, Programs};
use crate::recording::Recording;
use crate::validate::Inputs;
use crate::validate::cause::Again;
use std::error::Error;
use std::fmt::Write as _;
use std::io::Write;
use std::path::{Path, PathBuf};
use syncline_gcode::LIMIT_NOISE;
use syncline_trajectory::sampled::Sampled;

/// Names of columns of times, s: of our own traces, of a ROS `JointTrajectory`, and of `--columns`.
const TIMES: [&str; 3] = ["t_s", TIME_FROM_START, "t"];

/// By that column a file is known that is in ROS's units.
const TIME_FROM_START: &str = "time_from_start";

/// A column that is passed over.
const PASSED: &str = "-";

#[derive(Debug, clap::Args)]
pub(super) struct Trajectory {
    /// Instead of a program, judge positions at a fixed step, and have the simulated drives follow them: a trace, a CSV
    /// file with a column for each axis, samples of LinuxCNC's halsampler, or points of a ROS JointTrajectory.
    #[arg(
        long,
        value_name = "FILE",
        conflicts_with_all = ["program", "trace", "report", "events", "commands", "time_bounds", "tables"]
    )]
    trajectory: Option<PathBuf>,
    /// What the trajectory's columns are, in their order: `t` (s), an axis, or `-` to pass one over. Without it the
    /// header says so: t_s or time_from_start, and X_set, X or X.position.
    #[arg(
        long,
        value_name = "NAMES",
        value_delimiter = ',',
        requires = "trajectory",
        allow_hyphen_values = true
    )]
    columns: Option<Vec<String>>,
    /// Seconds from sample to sample of a trajectory without a column of times.
    #[arg(long, value_name = "SECONDS", requires = "trajectory")]
    step: Option<f64>,
    /// Unit of the trajectory's positions: millimetres or inches, and degrees, or metres and radians, which
    /// a file with time_from_start has.
    #[arg(long, value_enum, requires = "trajectory")]
    unit: Option<Unit>,
    /// What the trajectory's positions are rounded to, in its unit, where that is coarser than the digits that are
    /// written; or twice the noise that they have.
    #[arg(long, value_name = "UNITS", requires = "trajectory")]
    resolution: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, clap::ValueEnum)]
enum Unit {
    /// Millimetres and degrees.
    Mm,
    /// Inches and degrees.
    Inch,
    /// Metres and radians.
    M,
}

impl Unit {
    /// How many mm or degrees one is.
    fn scale(self, axis: &Axis) -> f64 {
        match (self, axis.letter.is_linear()) {
            (Self::M, true) => 1000.0,
            (Self::M, false) => 1.0_f64.to_degrees(),
            (Self::Inch, true) => 25.4,
            (Self::Mm, _) | (Self::Inch, false) => 1.0,
        }
    }
}

impl Trajectory {
    /// There is one.
    pub(super) fn is_given(&self) -> bool {
        self.trajectory.is_some()
    }

    /// Reads the trajectory, judges it by the machine's limits, and tells.
    pub(super) fn judge(
        &self,
        machine_file: &Path,
        settings: &[String],
        seed: u64,
        json: &Option<PathBuf>,
    ) -> Result<Exit, Box<dyn Error>> {
        let Some(file) = &self.trajectory else {
            return Err("no trajectory".into());
        };
        let mut inputs = Inputs::read(machine_file, settings, None)?;
        let mut claims =
            Claims::of_machine(machine_file, &inputs.machine).reads("--trajectory", file);
        let json: Option<Target> = claims.open("--json", json)?;
        let recording = Recording::read(file, self.columns.as_deref())?;
        let mut samples = self.samples(&inputs.machine, &recording)?;
        if stand_where_they_begin(&mut inputs.machine, &mut samples) {
            inputs.programs = Programs::new(&inputs.machine, machine_file)?;
        }
        let step = self.step(&recording)?;
        let judged = SampledMotion::judge(&samples, step);
        let again = |program: &Program, summary: &Summary| {
            let again = Again {
                file: machine_file,
                settings,
                tables: None,
                program,
                seed,
            };
            again.cause(&inputs.machine, summary)
        };
        let response = match along(&inputs, samples, step) {
            Ok(program) => match inputs.validate(program.clone(), seed, false, |_| true) {
                Ok((mut summary, _)) => {
                    summary.cause = again(&program, &summary)?;
                    Ok(summary)
                }
                Err(error) => Err(with_causes(&error)),
            },
            Err(why) => Err(why),
        };
        let judged = judged.followed(response);
        if let Some(json) = json {
            let mut json = json.begin()?;
            json.write_all((serde_json::to_string_pretty(&judged)? + "\n").as_bytes())?;
            json.flush()?;
        }
        claims.tell(&judged.to_string());
        Ok(match judged.verdict {
            "pass" => Exit::Finished,
            _ => Exit::Stopped,
        })
    }

    /// Seconds from sample to sample.
    fn step(&self, recording: &Recording) -> Result<f64, Box<dyn Error>> {
        let file = recording.file().display();
        let column = TIMES
            .iter()
            .find(|time| recording.names().any(|name| name == **time));
        let step = match (self.step, column) {
            (Some(_), Some(column)) => {
                return Err(format!("{file} has times in `{column}`: leave out --step").into());
            }
            (Some(step), None) => Some(step),
            (None, Some(column)) => recording.step(column)?,
            (None, None) => {
                return Err(format!("{file} has no column of times: --step says how many seconds from sample to sample").into());
            }
        };
        match step {
            Some(step) if step > 0.0 && step.is_finite() => Ok(step),
            Some(step) => Err(format!("--step {step}: a time above 0 s").into()),
            None => Err(format!("{file} has a single sample: nothing moves").into()),
        }
    }

    /// The axes that the trajectory has, in mm and degrees.
    fn samples(
        &self,
        machine: &Machine,
        recording: &Recording,
    ) -> Result<Vec<Samples>, Box<dyn Error>> {
        let is_ros = recording.names().any(|name| name == TIME_FROM_START);
        let unit = self.unit.unwrap_or(if is_ros { Unit::M } else { Unit::Mm });
        if let Some(resolution) = self.resolution.filter(|it| !(it.is_finite() && *it > 0.0)) {
            return Err(format!("--resolution {resolution}: a length above 0").into());
        }
        let axes: Vec<&str> = machine.axes.iter().map(Axis::name).collect();
        let is_known = |name: &str| name == PASSED || TIMES.contains(&name) || axes.contains(&name);
        if let Some(name) = self.columns.iter().flatten().find(|name| !is_known(name)) {
            let axes = axes.join(", ");
            return Err(format!(
                "--columns: `{name}` is neither t, - nor an axis of the machine, which are {axes}"
            )
            .into());
        }
        let column = |axis: &Axis| {
            let name = axis.name();
            let columns = ["_set", "", ".position"].map(|end| format!("{name}{end}"));
            let has = |it: &String| recording.names().any(|has| has == it);
            columns.into_iter().find(has)
        };
        let has = machine.axes.iter();
        let has: Vec<(&Axis, String)> = has.filter_map(|it| Some((it, column(it)?))).collect();
        // One that stands at 0 has no decimals: who writes the file writes all of them alike.
        let mut decimal = f64::INFINITY;
        for (_, column) in &has {
            decimal = recording.decimal(column)?.min(decimal);
        }
        let resolution = self.resolution.unwrap_or(0.0).max(decimal);
        let mut samples = Vec::new();
        for (axis, column) in has {
            let (scale, limits) = (unit.scale(axis), &axis.limits);
            let positions = recording.column(&column)?.iter();
            samples.push(Samples {
                name: axis.name().to_owned(),
                units: axis.units(),
                positions: positions.map(|it| scale * it).collect(),
                uncertainty: 0.5 * scale * resolution,
                range: limits.position,
                limits: [limits.velocity, limits.acceleration, limits.jerk],
            });
        }
        if samples.is_empty() {
            let (file, axes) = (recording.file().display(), axes.join(", "));
            return Err(format!(
                "{file} has no axis of the machine, which are {axes}: --columns says which of its columns is which"
            )
            .into());
        }
        Ok(samples)
    }
}

/// An axis may stand beside its soft limits, by what an encoder's noise is, as when a program begins: where it begins is within them
/// then. Whether there is such an axis.
fn stand_where_they_begin(machine: &mut Machine, samples: &mut [Samples]) -> bool {
    let mut any = false;
    for it in samples {
        let first = it.positions.first().copied().unwrap_or_default();
        let (least, most) = it.range;
        let beyond = (least - first).max(first - most);
        if beyond > 0.0 && beyond <= LIMIT_NOISE {
            it.range = (least.min(first), most.max(first));
            let mut axes = machine.axes.iter_mut();
            if let Some(axis) = axes.find(|axis| axis.name() == it.name) {
                axis.limits.position = it.range;
                any = true;
            }
        }
    }
    any
}

/// The program that leads to the first sample and then along all of them, or why there is none.
fn along(inputs: &Inputs, samples: Vec<Samples>, step: f64) -> Result<Program, String> {
    let mut positions: [Option<Vec<f64>>; COORDINATES] = Default::default();
    let mut to_the_first = "G21 G90 G94 G53 G0".to_owned();
    for Samples {
        name,
        positions: of_axis,
        ..
    } in samples
    {
        let axis = inputs.machine.axes.iter().find(|it| it.name() == name);
        let Some(axis) = axis.filter(|it| it.motion != Motion::PointToPoint) else {
            return Err(format!(
                "axis {name} goes point to point, and follows no samples"
            ));
        };
        let first = of_axis.first().copied().unwrap_or_default();
        // As many digits as tell it from every other number.
        let _ = write!(to_the_first, " {name}{first}");
        positions[axis.letter.index()] = Some(of_axis);
    }
    let samples = Sampled::through(positions, step).map_err(|why| with_causes(&why))?;
    let lead = to_the_first + "\nM2\n";
    let name = "the way to the first sample";
    let program = inputs.programs.text(name, lead.as_bytes());
    Ok(program.then_along(samples))
}
