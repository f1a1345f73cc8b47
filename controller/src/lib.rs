//! The machine: configuration, bring-up, SYNC cycle, supervision, programs, recording, reports.
//!
//! ```
#![doc = include_str!("../examples/validate.rs")]
//! ```
//!
//! - [`machine`]: the machine file
//! - [`budget`]: whether its frames fit its cycle
//! - [`program`]: from commands to a plan
//! - [`control`]: the controller itself, without I/O
//! - [`bus`]: one CAN bus as the controller sees it
//! - [`port`]: one CAN bus as the cycle uses it
//! - [`session`]: the machine as an operator has it: commands in, status and events out
//! - [`run`]: the controller in virtual and in real time
//! - [`validate`](mod@validate): a program on simulated drives, judged
//! - [`sweep`]: many validations with other values of the machine file's keys
//! - [`identify`]: what an axis is, from how it moves
//! - [`compare`]: two motions side by side
//! - [`recording`]: numbers over time from a file
//! - [`observe`]: what only watches: limits, deviation, statistics, trace
//! - [`doctor`]: what the host has that helps or hurts a cycle
//! - [`realtime`]: what the cycle thread asks of the kernel, and what it got
//! - [`report`]: what a run leaves to look at
//! - [`drive_host`]: simulated drives on a real bus
//! - [`bus_log`]: the traffic of a bus in files
//! - [`campaign`]: random machines, programs, operators and troubles, watched by checkers
//! - [`bench`](mod@bench): measures cycles and what simulations are made of
//! - `counted`: a number with what it counts
//! - `text`: texts of others as people are shown them
//! - [`commands`]: the `syncline` command line

#![deny(unsafe_code)]

pub mod bench;
pub mod budget;
pub mod bus;
pub mod bus_log;
pub mod campaign;
pub mod commands;
pub mod compare;
pub mod control;
mod counted;
pub mod doctor;
pub mod drive_host;
pub mod identify;
pub mod machine;
pub mod observe;
pub mod port;
pub mod program;
pub mod realtime;
pub mod recording;
pub mod report;
pub mod run;
pub mod session;
pub mod sweep;
mod text;
pub mod validate;
