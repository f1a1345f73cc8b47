//! The traffic of a bus in files that other tools read.
//!
//! - [`candump`]: text, a line a frame, as can-utils' `candump -L` writes it
//! - [`pcapng`]: packets, as tshark and Wireshark read them

pub mod candump;
pub mod pcapng;
