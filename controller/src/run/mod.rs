//! Drives the controller: in virtual time or in real time, over simulated or real buses.
//!
//! - [`driver`]: a controller on its buses
//! - [`virtual_time`]: as fast as the CPU allows, deterministic
//! - [`real_time`]: on the host's clock
//! - [`planning`]: the program on its way there, in a thread of its own
//! - [`events`]: what a person does, in a validated run
//! - [`recorder`]: what a run leaves: summary, violations, trace, report
//! - [`replay`]: a recorded run once more
//! - [`frames`]: what the simulated buses carried: hash, utilisation

pub mod deviation;
pub mod driver;
pub mod events;
pub mod frames;
pub mod planning;
pub mod real_time;
pub mod recorder;
pub mod replay;
pub mod virtual_time;
