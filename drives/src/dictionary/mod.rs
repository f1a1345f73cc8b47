//! Object dictionaries of the devices, each a table that reads like its manual's.

mod lxm32m;

pub use lxm32m::LXM32M;
