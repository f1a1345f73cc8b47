//! One run: a validation, and what of it stands in the sweep's table.

use super::Plan;
use super::result::{CAUSE, INVALID, LINE, RUN, SEED, SET, VERDICT};
use crate::machine::{Axis, Machine, MachineError};
use crate::observe::gantry::GantrySummary;
use crate::observe::summary::{AxisSummary, DriveSummary, StructureSummary, Summary};
use crate::validate::Inputs;
use std::error::Error;
use std::iter;
use std::path::PathBuf;

/// A number of a summary's part, and its name there.
type Named<T> = (&'static str, fn(&T) -> f64);

/// A number of a whole run; nothing where its program has nothing of the kind.
type OfRun = fn(&Summary) -> Option<f64>;

const OF_RUN: [(&str, OfRun); 6] = [
    ("times.motion_s", |run| Some(run.times.motion_s)),
    ("duration_s", |run| Some(run.duration_s)),
    ("path.max_contour_error_mm", |run| {
        Some(run.path.max_contour_error_mm)
    }),
    ("path.max_deviation_mm", |run| {
        Some(run.path.max_deviation_mm)
    }),
    ("path.max_drive_deviation_mm", |run| {
        Some(run.path.max_drive_deviation_mm)
    }),
    ("path.max_circular_deviation_mm", |run| {
        run.path.max_circular_deviation_mm
    }),
];
const OF_AXIS: [Named<AxisSummary>; 3] = [
    ("max_following_error_mm", |axis| axis.max_following_error_mm),
    ("rms_following_error_mm", |axis| axis.rms_following_error_mm),
    ("max_velocity", |axis| axis.max_velocity),
];
const OF_DRIVE: [Named<DriveSummary>; 3] = [
    ("max_torque", |drive| drive.max_torque),
    ("torque_reserve", |drive| drive.torque_reserve),
    ("rms_torque", |drive| drive.rms_torque),
];
const OF_GANTRY: [Named<GantrySummary>; 1] = [("max_skew_mm", |gantry| gantry.max_skew_mm)];
const OF_STRUCTURE: [Named<StructureSummary>; 2] = [
    ("max_sway_mm", |structure| structure.max_sway_mm),
    ("max_residual_mm", |structure| structure.max_residual_mm),
];

/// Where a column's number is in a summary: of which axis, drive, gantry or structure, by name.
#[derive(Clone, Debug)]
enum Number {
    Run(OfRun),
    Axis(String, fn(&AxisSummary) -> f64),
    Drive(String, fn(&DriveSummary) -> f64),
    Gantry(String, fn(&GantrySummary) -> f64),
    Structure(String, fn(&StructureSummary) -> f64),
}

impl Number {
    /// `None` where the machine or the program of a run has nothing of that name.
    fn of(&self, summary: &Summary) -> Option<f64> {
        match self {
            Self::Run(number) => number(summary),
            Self::Axis(name, number) => summary.axes.iter().find(|it| it.name == *name).map(number),
            Self::Drive(name, number) => summary
                .drives
                .iter()
                .find(|it| it.name == *name)
                .map(number),
            Self::Gantry(name, number) => summary
                .gantries
                .iter()
                .find(|it| it.axis == name)
                .map(number),
            Self::Structure(name, number) => summary
                .structures
                .iter()
                .find(|it| it.axis == name)
                .map(number),
        }
    }
}

/// The columns of an axis, drive, gantry or structure: the head of each, and where its number is.
fn columns<T, const COUNT: usize>(
    part: &str,
    name: &str,
    numbers: [Named<T>; COUNT],
    number: impl Fn(String, fn(&T) -> f64) -> Number,
) -> [(String, Number); COUNT] {
    numbers.map(|(what, of)| {
        let head = format!("{part}.{name}.{what}");
        (head, number(name.to_owned(), of))
    })
}

/// What all runs of a sweep have in common.
#[derive(Clone, Debug)]
pub struct Runs {
    machine: PathBuf,
    program: PathBuf,
    plan: Plan,
    numbers: Vec<(String, Number)>,
    files: Vec<PathBuf>,
}

impl Runs {
    /// Of a program on a machine, by a plan.
    ///
    /// # Errors
    /// The machine file is wrong; also with the first value of one of the keys, the others as the file has them.
    pub fn new(machine: PathBuf, program: PathBuf, plan: Plan) -> Result<Self, MachineError> {
        let mut files = Vec::new();
        for sample in plan.samples() {
            files.extend(Machine::load_with(&machine, &[sample])?.files);
        }
        let named = Machine::load(&machine)?;
        files.extend_from_slice(&named.files);
        files.sort();
        files.dedup();
        let mut numbers: Vec<_> = OF_RUN
            .map(|(number, of)| (number.to_owned(), Number::Run(of)))
            .into();
        for axis in &named.axes {
            let name = axis.letter.to_string();
            numbers.extend(columns("axis", &name, OF_AXIS, Number::Axis));
        }
        for drive in &named.drives {
            numbers.extend(columns("drive", &drive.name, OF_DRIVE, Number::Drive));
        }
        for axis in named.axes.iter().filter(|axis| axis.drives.len() > 1) {
            let name = axis.letter.to_string();
            numbers.extend(columns("gantry", &name, OF_GANTRY, Number::Gantry));
        }
        let sways = |axis: &&Axis| {
            let simulation = axis.simulation.as_ref();
            simulation.is_some_and(|it| !it.structure.is_empty())
        };
        for axis in named.axes.iter().filter(sways) {
            let name = axis.letter.to_string();
            numbers.extend(columns("structure", &name, OF_STRUCTURE, Number::Structure));
        }
        Ok(Self {
            machine,
            program,
            plan,
            numbers,
            files,
        })
    }

    /// The files that the machine was read from beside its own, also with the first value of one of the keys.
    #[must_use]
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }

    /// Which values each run has.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The head of the table.
    #[must_use]
    pub fn columns(&self) -> Vec<String> {
        let keys = self.plan.keys().map(|key| format!("{SET}{key}"));
        let numbers = self.numbers.iter().map(|(name, _)| name.clone());
        let before = [RUN, SEED].map(str::to_owned).into_iter().chain(keys);
        let verdict = [VERDICT, CAUSE, LINE].map(str::to_owned);
        let frames = iter::once("frames_sha256".to_owned());
        before.chain(verdict).chain(numbers).chain(frames).collect()
    }

    /// Makes a run; its row of the table. What came to no result with these values is `invalid`.
    #[must_use]
    pub fn row(&self, run: u64) -> Vec<String> {
        let mut row = vec![run.to_string(), self.plan.seed(run).to_string()];
        row.extend(self.plan.values(run));
        match self.validate(run) {
            Ok(summary) => {
                let first = summary.violations.first();
                row.push(summary.verdict.to_owned());
                row.push(cause(&summary));
                row.push(first.map_or_else(String::new, |it| it.line.to_string()));
                let number = |of: &Number| {
                    of.of(&summary)
                        .map_or_else(String::new, |it| it.to_string())
                };
                row.extend(self.numbers.iter().map(|(_, of)| number(of)));
                row.push(summary.frames_sha256.unwrap_or_default());
            }
            Err(error) => {
                let why = error.to_string();
                row.push(INVALID.to_owned());
                row.push(why.lines().next().unwrap_or_default().to_owned());
                row.resize(self.columns().len(), String::new());
            }
        }
        row
    }

    fn validate(&self, run: u64) -> Result<Summary, Box<dyn Error>> {
        let inputs = Inputs::read(&self.machine, &self.plan.settings(run), None)?;
        let program = inputs.programs.file(&self.program);
        let seed = self.plan.seed(run);
        Ok(inputs.validate(program, seed, false, |_| true)?.0)
    }
}

/// Why a run did not pass: what was wrong first.
fn cause(summary: &Summary) -> String {
    match summary.violations.first() {
        Some(violation) => match &violation.axis {
            Some(axis) => format!("{} of axis {axis}", violation.what),
            None => violation.what.clone(),
        },
        None if summary.verdict == "pass" => String::new(),
        None => summary.outcome.clone(),
    }
}
