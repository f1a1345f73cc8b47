//! Service data objects (CiA 301): one object of a node's dictionary up (read) or down (written).
//!
//! - [`Client`]: the master's side: starts transfers and says how they ended
//! - [`Server`]: the node's side, over anything that is an [`Objects`]
//! - [`AbortCode`]: why a transfer was refused
//! - `wire`: their eight bytes; `crc`: what block transfers are checked by

mod abort;
mod client;
mod crc;
mod server;
mod wire;

pub use abort::AbortCode;
pub use client::{Client, Direction, Failure, NotStarted, Reason};
pub use server::{Objects, Server};
