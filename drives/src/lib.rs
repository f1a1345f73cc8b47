//! Device models, their simulated twins and the simulated CAN bus.
//!
//! ```
#![doc = include_str!("../examples/bring_up_a_twin.rs")]
//! ```
//!
//! - [`bus`]: CAN in virtual time
//! - [`dictionary`]: object dictionaries that read like the manuals' tables
//! - [`twin`]: drives that a master cannot tell from the real ones
//! - [`model`]: what the controller knows of them
//!
//! `twin` never imports `model`: a mistake shared by both would hide itself.
#![forbid(unsafe_code)]

pub mod bus;
pub mod dictionary;
pub mod model;
pub mod twin;
