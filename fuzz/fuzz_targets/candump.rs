//! Lines of candump's log: what is read is written, and read again as the same.
#![no_main]

use libfuzzer_sys::fuzz_target;
use syncline_controller::bus_log::candump::Line;

fuzz_target!(|text: &str| {
    for line in text.lines() {
        if let Ok(line) = Line::parse(line) {
            let written = line.to_string();
            let again = Line::parse(&written).expect("what was written is read");
            assert_eq!((again.bus, again.frame), (line.bus, line.frame));
            assert_eq!(again.to_string(), written);
        }
    }
});
