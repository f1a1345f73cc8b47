//! Files of events for `syncline validate`, and with them the lines of a console.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| syncline_controller::commands::fuzz_events(text));
