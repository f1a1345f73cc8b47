//! Jerk-limited trajectories: planned exactly, certified by a checker that does not trust the planner.
//!
//! This crate knows nothing of CAN. It opens no socket, starts no thread, reads no clock.
//!
//! - [`profile`]: motions of one axis as constant-jerk segments; evaluation and exact extrema.
//! - [`path`]: motion of all axes along programmed geometry, and its execution.
#![forbid(unsafe_code)]

pub mod path;
pub mod profile;
