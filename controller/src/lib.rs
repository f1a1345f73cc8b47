//! The machine: configuration, bring-up, SYNC cycle, supervision, programs, recording, reports.
//!
//! - [`port`]: one CAN bus as the cycle uses it
//! - [`commands`]: the `syncline` command line

pub mod commands;
pub mod port;
