//! Plans, checks and validates CNC programs on a machine of simulated CANopen drives, as the commands
//! `syncline plan`, `syncline check` and `syncline validate` do.
//!
//! Lengths are in mm, angles of A, B and C in degrees, times in s. Results come in columns that Rust owns:
//! `numpy.asarray(column)` and `pyarrow.table(columns)` look at the same memory. While a function is at work the
//! GIL is free.
//!
//!     >>> import syncline
//!     >>> result = syncline.validate("machine.toml", "part.ngc", set={"axis.X.max_jerk": 40000})
//!     >>> result.verdict, result.summary["times"]["motion_s"]
//!     >>> numpy.abs(result.trace["X_following_error"]).max()

#![forbid(unsafe_code)]

mod check;
mod columns;
mod plan;
mod settings;
mod validate;

use pyo3::create_exception;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;
use std::error::Error;
use syncline_controller::commands::with_causes;

create_exception!(
    syncline,
    SynclineError,
    PyException,
    "Bad input, with the message of `syncline check`: every mistake with file, line and column, what is allowed and \
     what to do. Also a validation that comes to no result."
);

/// An error as Python has it.
fn raised(error: &(dyn Error + 'static)) -> PyErr {
    SynclineError::new_err(with_causes(error))
}

#[pymodule(gil_used = false)]
mod syncline {
    #[pymodule_export]
    use super::SynclineError;
    #[pymodule_export]
    use super::check::check;
    #[pymodule_export]
    use super::columns::{Column, Columns};
    #[pymodule_export]
    use super::plan::{Axis, Plan, plan};
    #[pymodule_export]
    use super::validate::{Validation, validate};

    #[pymodule_export]
    #[allow(non_upper_case_globals)]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
