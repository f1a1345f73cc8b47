//! Measuring: the cycle on this host, and the parts that a simulation is made of.
//!
//! - [`rig`]: a machine of any number of axes
//! - [`cycle`]: the real-time cycle, stage by stage, against a bare wake-up loop
//! - [`offline`]: simulated bus, simulated drive, planner: how fast
//! - [`sync`]: SYNC from the thread beside SYNC from the kernel
//! - [`compare`]: differences with confidence intervals

pub mod compare;
pub mod cycle;
pub mod offline;
pub mod rig;
pub mod sync;
