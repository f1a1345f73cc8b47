//! CANopen from outside: what goes over the wire, and what it takes of a bus.

mod bus_budget;
mod codecs;
mod eds;
mod monitor;
mod node;
mod node_options;
mod node_time;
mod sdo_faults;
mod sdo_server;
mod sdo_transfer;
mod supervision;
