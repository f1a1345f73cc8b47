//! The RS-274/NGC front end from outside: programs as text, canonical commands and refusals.

mod arcs;
mod compensation;
mod cycles;
mod flow;
mod gouges;
mod homing;
mod input_results;
mod linuxcnc;
mod listing;
mod memory;
mod mistake_cases;
mod mistakes;
mod motion;
mod names;
mod offsets;
mod orientation;
mod polar;
mod probing;
mod refusals;
mod resume;
mod saved;
mod splines;
mod sweep;
mod threads;
mod turned;
mod words;
