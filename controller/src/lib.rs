//! The machine: configuration, bring-up, SYNC cycle, supervision, programs, recording, reports.
//!
//! - [`machine`]: the machine file
//! - [`gcode`]: RS-274/NGC programs into canonical commands
//! - [`budget`]: whether its frames fit its cycle
//! - [`port`]: one CAN bus as the cycle uses it
//! - [`realtime`]: what the cycle thread asks of the kernel, and what it got
//! - [`report`]: what a run leaves to look at
//! - [`commands`]: the `syncline` command line

#![deny(unsafe_code)]

pub mod budget;
pub mod commands;
pub mod control;
pub mod gcode;
pub mod machine;
pub mod port;
pub mod program;
pub mod realtime;
pub mod report;
