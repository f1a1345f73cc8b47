//! The controller from outside: its files, its commands, and other people's tools against it.

mod arrows;
mod bench;
mod campaign;
mod check;
mod eds;
mod examples;
mod fault_texts;
mod lost_bus;
mod machine_file;
mod outputs;
mod outside;
mod overrun;
mod plan;
mod python_canopen;
mod python_canopen_csp;
mod python_canopen_twins;
mod reactions;
mod replay;
mod report;
mod sizes;
mod stalled_peers;
mod states;
mod switched_on;
mod tools;
mod walks;
mod wireshark;
