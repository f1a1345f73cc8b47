//! Simulated drives: a CANopen node in front, control loops and mechanics behind it.
//!
//! - [`lxm32m`]: the Lexium 32M
//! - [`plant`], [`control`], [`clock`]: shaft and encoder, control loops, what paces them
//! - [`random`]: seeded randomness for noise, delays and oscillators
//!
//! A twin is a [`Node`](crate::bus::Node): put it on a [`SimBus`](crate::bus::SimBus), or feed it
//! the frames of a real bus. It computes in `f64` with `+ - * /` and `sqrt` only, so the same
//! frames come out on every machine.

pub mod clock;
pub mod control;
pub mod lxm32m;
pub mod plant;
pub mod random;
