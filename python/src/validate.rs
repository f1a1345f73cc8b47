//! `validate`: proof before metal moves.

use crate::columns::{Columns, Table};
use crate::settings::{Settings, key_values};
use crate::{SynclineError, raised};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::error::Error;
use std::path::{Path, PathBuf};
use syncline_controller::commands::with_causes;
use syncline_controller::observe::record::Report;
use syncline_controller::observe::summary::Summary;
use syncline_controller::session::Status;
use syncline_controller::validate::Inputs;

/// Wake-ups between two looks for Ctrl-C: some tenths of a second.
const WAKE_UPS: u64 = 1 << 14;

/// The result of a validation.
#[pyclass(frozen, module = "syncline")]
pub(crate) struct Validation {
    /// `pass`, `fail`, or `interrupted`.
    #[pyo3(get)]
    verdict: &'static str,
    /// What `syncline validate --json` writes: numbers with their unit in the name (`times["motion_s"]`), those of
    /// axes in mm, mm/s, mm/s² and mm/s³, of A, B and C in degrees.
    #[pyo3(get)]
    summary: Py<PyDict>,
    /// What was in every cycle, or None if it was not asked for.
    ///
    /// `t_s`: time from the first motion, s. `line`: of the program, 0 where none. `feed`: speed of the tool along the
    /// path, mm/s. `turning`: speed at which A, B and C turn alone, degrees/s. `deviation` and `contour_error`: how far the
    /// setpoint and the tool were from the programmed geometry, mm; NaN while the axes are off the path. For each axis, as X:
    /// `X_set` and `X_act`: setpoint and actual position in machine coordinates, mm. `X_velocity`, mm/s,
    /// `X_acceleration`, mm/s², and `X_jerk`, mm/s³: of the plan. `X_following_error`: setpoint minus actual
    /// position after the drive's delay, the worse side of a gantry, mm. Of A, B and C every mm is a degree.
    #[pyo3(get)]
    trace: Option<Py<Columns>>,
    text: String,
}

#[pymethods]
impl Validation {
    /// What `syncline validate` prints.
    fn __str__(&self) -> &str {
        &self.text
    }

    fn __repr__(&self) -> String {
        format!("<Validation: {}>", self.verdict)
    }
}

/// Runs a program on simulated drives in virtual time and judges it, as `syncline validate` does.
///
/// `machine` is a machine file (TOML), `program` a part program (RS-274/NGC). `set` has other values of keys of the
/// machine file: `{"axis.X.max_jerk": 40000, "path.mode": "G64"}`. `tables` is a file of work offsets and tools, taken
/// in place of the one beside the machine file. `seed` varies encoder noise, response delays and oscillator errors of
/// the simulated drives; with the same machine, program and seed every frame is the same
/// (`summary["frames_sha256"]`). Without `trace` nothing is kept of single cycles, and memory does not grow
/// with the program.
///
/// The GIL is free while it runs; Ctrl-C stops it.
///
/// Raises `SynclineError` for bad input, as `syncline check` tells it. A program that fails its validation is no
/// error: its `verdict` is `fail`.
#[pyfunction]
#[pyo3(signature = (machine, program, *, set=None, tables=None, seed=0, trace=true))]
pub(crate) fn validate(
    py: Python<'_>,
    machine: PathBuf,
    program: PathBuf,
    set: Option<Settings>,
    tables: Option<PathBuf>,
    seed: u64,
    trace: bool,
) -> PyResult<Validation> {
    let settings = key_values(set);
    let (mut wake_ups, mut interrupt) = (0, None);
    let run = |inputs: &Inputs| {
        inputs.validate(inputs.programs.file(&program), seed, trace, |_: &Status| {
            wake_ups += 1;
            if wake_ups % WAKE_UPS == 0 {
                let signals = Python::try_attach(|py| py.check_signals());
                interrupt = signals.and_then(Result::err);
            }
            interrupt.is_none()
        })
    };
    let result = py.detach(|| {
        let result = judged(&machine, &settings, tables.as_deref(), run);
        result.map_err(|error| with_causes(&*error))
    });
    if let Some(interrupt) = interrupt {
        return Err(interrupt);
    }
    let (summary, report) = result.map_err(SynclineError::new_err)?;
    let json = serde_json::to_string(&summary).map_err(|error| raised(&error))?;
    let loaded = py.import("json")?.call_method1("loads", (json,))?;
    let trace = report.map(|report| Py::new(py, columns(report)?));
    Ok(Validation {
        verdict: summary.verdict,
        summary: loaded.cast_into::<PyDict>()?.unbind(),
        trace: trace.transpose()?,
        text: summary.to_string(),
    })
}

type Judged = (Summary, Option<Report>);

fn judged<E: Error + 'static>(
    machine: &Path,
    settings: &[String],
    tables: Option<&Path>,
    run: impl FnOnce(&Inputs) -> Result<Judged, E>,
) -> Result<Judged, Box<dyn Error>> {
    let inputs = Inputs::read(machine, settings, tables)?;
    Ok(run(&inputs)?)
}

/// The rows of a report; its vectors go as they are.
fn columns(report: Report) -> PyResult<Columns> {
    let mut table = Table::default();
    table.numbers("t_s", "s", report.time);
    table.counts("line", report.line);
    table.numbers("feed", "mm/s", report.feed);
    table.numbers("turning", "°/s", report.turning);
    table.numbers("deviation", "mm", report.deviation);
    table.numbers("contour_error", "mm", report.contour_error);
    for axis in report.axes {
        let [position, velocity, acceleration, jerk] = axis.units;
        for (what, unit, values) in [
            ("set", position, axis.set),
            ("act", position, axis.act),
            ("tool", position, axis.tool),
            ("velocity", velocity, axis.velocity),
            ("acceleration", acceleration, axis.acceleration),
            ("jerk", jerk, axis.jerk),
            ("following_error", position, axis.following_error),
        ] {
            table.numbers(format!("{}_{what}", axis.name), unit, values);
        }
    }
    table.finish()
}
