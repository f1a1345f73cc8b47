//! EDS: what can be read can be written and read again.
#![no_main]

use libfuzzer_sys::fuzz_target;
use syncline_canopen::eds::Eds;

fuzz_target!(|text: &str| {
    if let Ok(eds) = Eds::parse(text) {
        let again = Eds::parse(&eds.to_string()).expect("what was written is read");
        assert!(eds.compare(&again).is_empty());
    }
});
