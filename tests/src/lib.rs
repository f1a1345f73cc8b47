//! What the end-to-end tests share.
//!
//! - [`command`]: the `syncline` command as a user runs it
//! - [`terminal`], [`screen`]: a person at a terminal of their own, and what stands there
//! - [`rig`]: a whole machine in virtual time, to interfere with
//! - [`trace`]: checks a trace against the limits, trusting no planner
//! - [`plan`]: the same for the plan between the samples
//!
//! Everything here panics at what it did not expect: it runs in tests only.

pub mod command;
pub mod corpus;
pub mod plan;
pub mod rig;
pub mod screen;
pub mod terminal;
pub mod trace;
