//! Object dictionaries of the devices, each a table that reads like its manual's.

mod cia301;
mod cia401;
mod cia402_csp;
mod cia406;
mod lxm32m;
mod tlc5xx;
mod tsp10;
mod twk_crn;

pub use cia401::CIA401;
pub use cia402_csp::{CIA402_CSP, CIA402_CSV, CIA402_PV, CIA402_VL};
pub use cia406::CIA406;
pub use lxm32m::LXM32M;
pub(crate) use lxm32m::units as lxm32m_units;
pub use tlc5xx::{PRINTED as TLC5XX_PRINTED, TLC5XX};
pub use tsp10::TSP10;
pub use twk_crn::{TWK_CRN_4096, TWK_CRN_8192, TWK_CRN_TURNS};
