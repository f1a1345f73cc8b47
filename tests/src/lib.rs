//! What the end-to-end tests share.
//!
//! A drive of the portal fails in mid-program, and the machine comes to rest:
//!
//! ```
//! use syncline_drives::twin::{Disturbance, ErrorClass};
//! use syncline_tests::rig::Rig;
//!
//! let mut rig = Rig::portal("G1 X300 Y100 F6000\nM2\n");
//! rig.run_to_row(200);
//! rig.twin(2).disturb(Disturbance::Fault(ErrorClass::StopAndSwitchOff));
//! println!("{:?}", rig.finish_with_fault());
//! assert!(rig.ends_at_rest());
//! rig.trace().assert_within_limits();
//! ```
//!
//! - [`command`]: the `syncline` command as a user runs it
//! - [`terminal`], [`screen`]: a person at a terminal of their own, and what stands there
//! - [`rig`]: a whole machine in virtual time, to interfere with
//! - [`corpus`]: generated programs with the geometry that they stand for
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
