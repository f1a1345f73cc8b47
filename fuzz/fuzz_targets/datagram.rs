//! Datagrams of CAN over UDP multicast.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| syncline_controller::port::fuzz_datagram(bytes));
