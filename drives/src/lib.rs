//! Device models, their simulated twins and the simulated CAN bus.
//!
//! ```
#![doc = include_str!("../examples/bring_up_a_twin.rs")]
//! ```
//!
//! - [`bus`]: CAN in virtual time
//! - [`dictionary`]: object dictionaries that read like the manuals' tables
//! - [`twin`]: devices that a master cannot tell from the real ones
//! - [`mechanics`]: what their motors move
//! - [`world`]: buses, twins and mechanics on one clock
//! - [`model`]: what the controller knows of the devices
//!
//! `twin` never imports `model`: a mistake shared by both would hide itself.
#![forbid(unsafe_code)]

pub mod bus;
pub mod dictionary;
pub mod mechanics;
pub mod model;
pub mod twin;
pub mod world;
