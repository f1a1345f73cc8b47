//! Device models, their simulated twins and the simulated CAN bus.
//!
//! `twin` never imports `model`: a mistake shared by both would hide itself.
#![forbid(unsafe_code)]
