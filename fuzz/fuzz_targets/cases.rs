//! Files of problems for `syncline plan`.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &[u8]| syncline_controller::commands::fuzz_cases(text));
