//! Plans from outside: what they promise is checked on what an executor makes of them.

mod answers;
mod clock;
mod common;
mod contour;
mod effect;
mod hold;
mod jog;
mod machine;
mod overrides;
mod path;
mod programs;
mod shaping;
mod synchronous;
mod tolerances;
mod waypoints;
