//! What servo drives share behind their bus interface.
//!
//! - [`axis`]: what a drive is put together from, as it is commissioned
//! - [`cascade`]: position loop, speed loop, torque limit; [`filter`]: its filters
//! - [`power_stage`]: current loop, voltage and DC bus, overload
//! - [`clock`]: what paces them: the drive's own oscillator, free or locked to SYNC
//! - [`encoder`], [`shaft`]: what the loops read, and what they move; [`velocity`]: what is measured of it
//! - [`motor`]: generic sets of figures
//! - [`stability`]: how far the loops are from swinging by themselves
//! - [`ramp`]: the drive's own profile generator; [`segment`]: from setpoint to setpoint
//! - [`errors`]: what is wrong, and how it is told
//! - [`firmware`]: what stands between them and the node, with the state machine of CiA 402;
//!   [`option_codes`]: how CiA 402's option codes have it stop and react; [`lasting`]: the time that something has to be so
//!
//! [`loops`] puts them together in the order of one step of its speed loop: the cascade turns the
//! last reading into a torque, the power stage makes of it what current and voltage allow, the shaft moves
//! under that for the length of the step, the encoder is read once.

pub mod axis;
pub mod cascade;
pub mod clock;
pub mod encoder;
pub mod errors;
pub mod filter;
pub mod firmware;
pub mod lasting;
pub mod loops;
pub mod motor;
pub mod option_codes;
pub mod power_stage;
pub mod ramp;
#[cfg(test)]
mod running;
pub mod segment;
pub mod shaft;
pub mod stability;
pub mod velocity;
