//! Object dictionaries of the devices, each a table that reads like its manual's.

mod cia402_csp;
mod lxm32m;
mod twk_crn;

pub use cia402_csp::CIA402_CSP;
pub use lxm32m::LXM32M;
pub use twk_crn::{TWK_CRN_4096, TWK_CRN_8192, TWK_CRN_TURNS};
