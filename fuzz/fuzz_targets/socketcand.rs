//! The byte stream of a socketcand server or client; each `|` ends a piece of it that comes at once.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    syncline_controller::port::fuzz_socketcand(bytes.split(|&byte| byte == b'|'));
});
