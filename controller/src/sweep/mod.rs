//! Many validations of one program with other values of the machine file's keys.
//!
//! A [`Plan`] says which values each run has: a function of the run's number, so that runs can be made in any
//! order, by any process, and again. Runs are made in [parts](Folder) of equal length. A part is a file that appears
//! only once it is whole, so a sweep that was interrupted goes on with the parts that are missing, and processes that
//! share the work share nothing but the parts' numbers. The table of a sweep is its parts, one after the other.

mod folder;
mod plan;
mod result;
mod run;

pub use folder::{Folder, Manifest, SweepError, sha256};
pub use plan::{Method, Plan, Variable, Vary};
pub use result::{Findings, Table, quoted};
pub use run::Runs;
