//! Problems and peers for the benches in `benches/benches`, and campaigns against them.

pub mod campaign;
pub mod cases;
pub mod contours;
pub mod paths;
pub mod peer;
pub mod properties;
