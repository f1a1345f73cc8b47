//! CANopen without I/O: every protocol is a state machine that is handed frames and an
//! [`Instant`] and hands back frames and the next instant it wants to be called.
//!
//! ```
#![doc = include_str!("../examples/read_an_object.rs")]
//! ```
//!
//! - [`frame`], [`id`]: what travels on the wire (CAN 2.0A/B, CiA 301 pre-defined connection set)
//! - [`response_time`], [`budget`]: whether a cycle's frames fit their cycle (Davis et al. 2007)
//! - [`time`]: instants that are handed in, never read
//! - [`dictionary`]: a device's objects as a table, a node's values of them
//! - [`sdo`], [`pdo`], [`nmt`], [`sync`], [`emcy`], [`heartbeat`], [`guarding`]: the services,
//!   node's and master's side
//! - [`eds`]: electronic data sheets (CiA 306), read, written and compared
//! - [`node`]: a whole slave of them, for a device to be embedded in
//! - [`monitor`]: what the frames on a bus mean, told to a person
//! - [`cia402`]: a drive's words and states
//!
//! Nothing here opens a socket, starts a thread, reads a clock or logs, and no protocol allocates
//! after construction (data sheets and the monitor's texts do).
#![forbid(unsafe_code)]

pub mod budget;
pub mod cia402;
pub mod dictionary;
pub mod eds;
pub mod emcy;
pub mod frame;
pub mod guarding;
pub mod heartbeat;
pub mod id;
pub mod monitor;
pub mod nmt;
pub mod node;
pub mod pdo;
pub mod response_time;
pub mod sdo;
pub mod sync;
pub mod time;

pub use dictionary::Address;
pub use frame::{Frame, Transmit};
pub use id::{CanId, CobId, NodeId};
pub use time::Instant;

/// Bit rates of a CANopen network, bit/s: those that CiA 301 recommends, and 100 kbit/s, which devices from before it take.
pub const BIT_RATES: &[u32] = &[
    10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000,
];
