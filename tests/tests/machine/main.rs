//! Whole machines, from outside: what the `syncline` command does with programs, good and bad
//! input and faults, and what the bus sees of it.

mod bad_input;
mod beam;
mod bounds;
mod bring_up;
mod cia402_csp;
mod consoles;
mod corpus;
mod day;
mod faults;
mod feed_axes;
mod feedback;
mod fits;
mod heard;
mod homing;
mod jogs;
mod judge;
mod lines;
mod messages;
mod operator;
mod pages;
mod programs;
mod properties;
mod reactions;
mod recorder;
mod replayed;
mod results;
mod run;
mod signals;
mod splines;
mod stops;
mod switched;
mod validate;
mod validation;
mod velocity;
mod wired;
