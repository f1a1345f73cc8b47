//! Object dictionaries of the devices, each a table that reads like its manual's.

mod cia402_csp;
mod lxm32m;

pub use cia402_csp::CIA402_CSP;
pub use lxm32m::LXM32M;
