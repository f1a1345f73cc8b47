//! `check`: is the input good?

use crate::settings::{Settings, key_values};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::error::Error;
use std::path::{Path, PathBuf};
use syncline_controller::budget::MachineBudget;
use syncline_controller::commands::with_causes;
use syncline_controller::machine::Machine;
use syncline_controller::program::{Extent, Programs};

/// Checks a machine file, the tables beside it, and a program for it, and moves nothing.
///
/// `set` has other values of keys of the machine file: `{"axis.X.max_jerk": 40000}`.
///
/// Returns what the input amounts to: `machine`, its name; `axes`, their names; `bus`, of each `name`, `bit_rate`
/// (bit/s), `cycle_s` (s) and `demand_s`, what of that is taken in the worst case (s); with a program `program`: `blocks`,
/// `length_mm` (mm), `turned_deg` where A, B and C turn alone (degrees), `capped_moves`, how many ask for a higher feed
/// than the axes can, `arc_deviation_mm`, the greatest change of an arc so that its ends are exact (mm), and
/// `known_to_line`, from which on nothing is known before the machine has probed or read its inputs.
///
/// Raises `SynclineError` with every mistake, as `syncline check` tells it.
#[pyfunction]
#[pyo3(signature = (machine, program=None, *, set=None))]
pub(crate) fn check<'py>(
    py: Python<'py>,
    machine: PathBuf,
    program: Option<PathBuf>,
    set: Option<Settings>,
) -> PyResult<Bound<'py, PyDict>> {
    let settings = key_values(set);
    let checked = py.detach(|| {
        let checked = read(&machine, program.as_deref(), &settings);
        checked.map_err(|error| with_causes(&*error))
    });
    let (machine, budget, extent) = checked.map_err(crate::SynclineError::new_err)?;
    let result = PyDict::new(py);
    result.set_item("machine", machine.name)?;
    let axes: Vec<_> = machine.axes.iter().map(|axis| axis.name()).collect();
    result.set_item("axes", axes)?;
    let mut buses = Vec::new();
    for bus in budget.buses {
        let of_bus = PyDict::new(py);
        of_bus.set_item("name", bus.bus)?;
        of_bus.set_item("bit_rate", bus.budget.bit_rate)?;
        of_bus.set_item("cycle_s", bus.budget.cycle.as_secs_f64())?;
        of_bus.set_item("demand_s", bus.budget.demand.as_secs_f64())?;
        buses.push(of_bus);
    }
    result.set_item("bus", buses)?;
    if let Some(extent) = extent {
        let program = PyDict::new(py);
        program.set_item("blocks", extent.blocks)?;
        program.set_item("length_mm", extent.length)?;
        program.set_item("turned_deg", extent.turned)?;
        program.set_item("capped_moves", extent.capped.moves)?;
        program.set_item("arc_deviation_mm", extent.arc_deviation.0)?;
        program.set_item("known_to_line", extent.known_to)?;
        result.set_item("program", program)?;
    }
    Ok(result)
}

fn read(
    file: &Path,
    program: Option<&Path>,
    settings: &[String],
) -> Result<(Machine, MachineBudget, Option<Extent>), Box<dyn Error>> {
    let machine = Machine::load_with(file, settings)?;
    let budget = MachineBudget::of(&machine);
    budget.check()?;
    let programs = Programs::new(&machine, file)?;
    let extent = program.map(|program| programs.file(program).check(machine.rest()));
    Ok((machine, budget, extent.transpose()?))
}
