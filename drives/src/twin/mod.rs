//! Simulated devices: a CANopen node in front, control loops and a shaft behind it.
//!
//! - [`device`]: what every twin is to a bus, to mechanics, to observers and to tests
//! - [`TWINS`]: all of them, by the name of the model that each stands for
//! - [`lxm32m`]: the Lexium 32M
//! - [`cia402_csp`]: a drive by the profile alone, sent positions or velocities
//! - [`cia406`]: an absolute encoder by the profile alone
//! - [`twk_crn`]: the absolute encoder TWK CRN
//! - [`tlc5xx`]: the positioning controller Twin Line TLC53x
//! - [`tsp10`]: the stepper controller TSP10-CBE
//! - [`cia401`]: an I/O node by the profile
//! - [`node`]: the CANopen node as a device's processor runs it: delays, losses, restarts
//! - [`cia402`]: the state machine of a drive
//! - [`servo`]: cascade, clock, encoder, shaft, ramps
//! - [`random`]: seeded randomness for noise, delays and oscillators
//! - `rounding`: numbers to whole ones
//!
//! A twin is a [`BusNode`](crate::bus::BusNode): put it on a [`SimBus`](crate::bus::SimBus) or into a
//! [`World`](crate::world::World), or feed it the frames of a real bus. It computes in `f64` with
//! `+ - * /` and `sqrt` only, so the same frames come out on every machine.
//!
//! A twin never imports `model`: both read the manual, and a mistake shared by both would hide
//! itself.

pub mod cia401;
pub mod cia402;
pub mod cia402_csp;
pub mod cia406;
pub mod device;
pub mod lxm32m;
pub mod node;
pub mod random;
mod rounding;
pub mod servo;
pub mod tlc5xx;
pub mod tsp10;
pub mod twk_crn;

pub use device::{
    Config, Course, Disturbance, DrivenAxis, ErrorClass, Kind, Observation, Ripple, Sensor,
    SimulatedDevice, Supply,
};

/// Every twin.
pub static TWINS: &[&Kind] = &[
    &lxm32m::KIND,
    &cia402_csp::KIND,
    &cia402_csp::CSV_KIND,
    &cia402_csp::PV_KIND,
    &twk_crn::KIND,
    &tlc5xx::KIND,
    &tsp10::KIND,
    &cia401::KIND,
    &cia406::KIND,
    &cia402_csp::VL_KIND,
];

impl Kind {
    /// The twin of the model with that name.
    #[must_use]
    pub fn by_name(name: &str) -> Option<&'static Self> {
        TWINS.iter().copied().find(|twin| twin.name == name)
    }
}
