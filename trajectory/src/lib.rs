//! Jerk-limited trajectories: planned exactly, certified by a checker that does not trust the planner.
//!
//! One axis from state to state:
//!
//! ```
#![doc = include_str!("../examples/plan_a_move.rs")]
//! ```
//!
//! Along a path the plan goes to an executor, which the cycle asks for one setpoint after another:
//!
//! ```
#![doc = include_str!("../examples/plan_a_path.rs")]
//! ```
//!
//! This crate knows nothing of CAN. It opens no socket, starts no thread, reads no clock.
//!
//! - [`profile`]: motions of one axis as constant-jerk segments; evaluation and exact extrema.
//! - [`state_to_state`]: one axis from any state to any state, as fast as its [`limits`] allow.
//! - [`synchronise`]: several axes on a line, together, or each on its own.
//! - [`synchronous`]: along a line in step with a spindle that is measured.
//! - [`path`]: motion of all axes along programmed geometry, and its execution.
//! - [`sampled`]: motion that is known by positions at a fixed step.
//! - [`shaper`]: input shaping, against vibrations that a motion would excite.
//! - [`verify`]: certifies plans, in arithmetic of its own, `double`.
//!
//! Beneath `state_to_state` are the `extremal` plans: for every duration the one that gets furthest.
#![forbid(unsafe_code)]

mod double;
mod extremal;
pub mod limits;
pub mod path;
pub mod profile;
pub mod sampled;
pub mod shaper;
pub mod state_to_state;
pub mod synchronise;
pub mod synchronous;
pub mod verify;
