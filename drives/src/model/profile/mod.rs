//! What models of one device profile share. A model uses what applies to it and writes the rest
//! itself; nothing here is called from outside of the models.
//!
//! - `communication`: set-up that CiA 301 has for every device
//! - `cia402`: drives
//! - `cia406`: absolute encoders
//! - `generic`: devices of whatever maker, by the profile alone

pub(super) mod cia402;
pub(super) mod cia406;
pub(super) mod communication;
pub(super) mod generic;
