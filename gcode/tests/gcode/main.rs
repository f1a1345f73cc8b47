//! The RS-274/NGC front end from outside: programs as text, canonical commands and refusals.

mod arcs;
mod cycles;
mod flow;
mod listing;
mod motion;
mod offsets;
mod refusals;
mod resume;
