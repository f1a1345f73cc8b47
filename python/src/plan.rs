//! `plan`: moves from state to state.

use crate::columns::{Columns, Table};
use crate::{SynclineError, raised};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use syncline_trajectory::limits::{Limits, PositionLimits};
use syncline_trajectory::profile::{Profile, State};
use syncline_trajectory::state_to_state::{self, Target};
use syncline_trajectory::synchronise::{self, MAX_AXES, Synchronisation};
use syncline_trajectory::verify;

/// Beyond it there is no machine, and what is computed loses its meaning.
const LARGEST: f64 = 1e15;
/// The least that a limit may allow.
const SMALLEST: f64 = 1e-15;
/// The greatest relative error of a plan that is handed out.
const CERTIFIED: f64 = 1e-9;
/// Rows that a plan may be sampled to.
const MOST_ROWS: f64 = 1e8;

/// One axis of a move, in any unit of length: from position `p0`, velocity `v0`, acceleration `a0` to `pf`, `vf`, `af`. Without
/// `pf` it goes to the velocity `vf`, wherever that is. Limits: velocity `vmax` and `vmin`, acceleration
/// `amax` and `amin`, jerk `jmax` and `jmin`, whose minima are negative and by default minus the
/// maxima; positions `pmin` and `pmax`, by default none. Per s, s² and s³.
#[pyclass(frozen, module = "syncline")]
pub(crate) struct Axis(state_to_state::Problem);

#[pymethods]
impl Axis {
    #[new]
    #[pyo3(signature = (p0, pf=None, *, vmax, amax, jmax, v0=0.0, a0=0.0, vf=0.0, af=0.0, vmin=None, amin=None,
                        jmin=None, pmin=None, pmax=None))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        p0: f64,
        pf: Option<f64>,
        vmax: f64,
        amax: f64,
        jmax: f64,
        v0: f64,
        a0: f64,
        vf: f64,
        af: f64,
        vmin: Option<f64>,
        amin: Option<f64>,
        jmin: Option<f64>,
        pmin: Option<f64>,
        pmax: Option<f64>,
    ) -> PyResult<Self> {
        let (vmin, amin) = (vmin.unwrap_or(-vmax), amin.unwrap_or(-amax));
        let limits = [vmax, vmin, amax, amin, jmax, jmin.unwrap_or(-jmax)];
        let others = [
            Some(p0),
            pf,
            Some(v0),
            Some(a0),
            Some(vf),
            Some(af),
            pmin,
            pmax,
        ];
        let all = others.into_iter().flatten().chain(limits);
        if all
            .into_iter()
            .any(|it| it.abs() > LARGEST && it.is_finite())
        {
            return Err(SynclineError::new_err(format!(
                "a number is beyond ±{LARGEST:e}"
            )));
        }
        if limits.iter().any(|it| *it != 0.0 && it.abs() < SMALLEST) {
            return Err(SynclineError::new_err(format!(
                "a limit is within ±{SMALLEST:e}"
            )));
        }
        let [v_max, v_min, a_max, a_min, j_max, j_min] = limits;
        let bounds = (pmin.is_some() || pmax.is_some()).then(|| PositionLimits {
            min: pmin.unwrap_or(f64::NEG_INFINITY),
            max: pmax.unwrap_or(f64::INFINITY),
        });
        Ok(Self(state_to_state::Problem {
            start: State {
                p: p0,
                v: v0,
                a: a0,
            },
            target: match pf {
                Some(p) => Target::State(State { p, v: vf, a: af }),
                None => Target::Velocity { v: vf, a: af },
            },
            limits: Limits {
                v_max,
                v_min,
                a_max,
                a_min,
                j_max,
                j_min,
            },
            bounds,
        }))
    }
}

/// A certified move.
#[pyclass(frozen, module = "syncline")]
pub(crate) struct Plan {
    profiles: Vec<Profile>,
    /// Until all axes have arrived, s.
    #[pyo3(get)]
    duration: f64,
}

#[pymethods]
impl Plan {
    /// For each axis its segments of constant jerk: columns `duration_s` and `jerk` (length/s³).
    fn segments(&self) -> PyResult<Vec<Columns>> {
        let profiles = self.profiles.iter().map(Profile::segments);
        let columns = profiles.map(|segments| {
            let mut table = Table::default();
            let durations = segments.iter().map(|it| it.duration).collect();
            table.numbers("duration_s", "s", durations);
            let jerks = segments.iter().map(|it| it.jerk).collect();
            table.numbers("jerk", "length/s³", jerks);
            table.finish()
        });
        columns.collect()
    }

    /// Where the axes are every `period` s, from the start to the first instant behind the end: columns `t_s` and,
    /// for each axis from 0, `p_0` (length), `v_0` (length/s), `a_0` (length/s²) and `j_0` (length/s³).
    fn sample(&self, py: Python<'_>, period: f64) -> PyResult<Columns> {
        let rows = (self.duration / period).ceil() + 1.0;
        if !(period > 0.0 && rows <= MOST_ROWS) {
            let text = format!("a period of {period} s makes no rows, or more than {MOST_ROWS:e}");
            return Err(PyValueError::new_err(text));
        }
        let times: Vec<f64> = (0..rows as usize).map(|row| row as f64 * period).collect();
        let mut table = Table::default();
        py.detach(|| {
            for (index, profile) in self.profiles.iter().enumerate() {
                let [mut p, mut v, mut a, mut j] = [const { Vec::new() }; 4];
                for (state, jerk) in times.iter().map(|t| profile.sample(*t)) {
                    p.push(state.p);
                    v.push(state.v);
                    a.push(state.a);
                    j.push(jerk);
                }
                table.numbers(format!("p_{index}"), "length", p);
                table.numbers(format!("v_{index}"), "length/s", v);
                table.numbers(format!("a_{index}"), "length/s²", a);
                table.numbers(format!("j_{index}"), "length/s³", j);
            }
        });
        table.numbers("t_s", "s", times);
        table.finish()
    }

    fn __repr__(&self) -> String {
        format!(
            "<Plan of {} axes, {} s>",
            self.profiles.len(),
            self.duration
        )
    }
}

/// Plans a move of one or more axes as fast as their limits allow, and has it certified by a checker that does not
/// trust the planner, as `syncline plan` does.
///
/// `sync`: `line` (the tool stays on the straight line), `time` (all arrive at the same instant) or `none` (each as
/// fast as it can). The move takes at least `min_duration`, s.
///
/// Raises `SynclineError` where there is no such move, with the reason.
#[pyfunction]
#[pyo3(signature = (axes, *, sync="time", min_duration=0.0))]
pub(crate) fn plan(
    py: Python<'_>,
    axes: Vec<Py<Axis>>,
    sync: &str,
    min_duration: f64,
) -> PyResult<Plan> {
    let synchronisation = match sync {
        "line" => Synchronisation::Line,
        "time" => Synchronisation::Time,
        "none" => Synchronisation::None,
        _ => return Err(PyValueError::new_err("sync is line, time or none")),
    };
    if !(1..=MAX_AXES).contains(&axes.len()) {
        let text = format!("{} axes: 1 to {MAX_AXES} are planned together", axes.len());
        return Err(PyValueError::new_err(text));
    }
    let axes: Vec<_> = axes.iter().map(|axis| axis.get().0).collect();
    let mut profiles: Vec<_> = axes.iter().map(|axis| Profile::new(axis.start)).collect();
    let duration = py
        .detach(|| synchronise::plan(&axes, synchronisation, min_duration, &mut profiles))
        .map_err(|error| raised(&error))?;
    let mut pairs = profiles.iter().zip(&axes);
    if !pairs.all(|(profile, axis)| verify::axis(profile, axis).holds(CERTIFIED)) {
        return Err(SynclineError::new_err(format!(
            "the checker finds a relative error above {CERTIFIED:e}"
        )));
    }
    Ok(Plan { profiles, duration })
}
