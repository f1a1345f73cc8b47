//! Service data objects (CiA 301): one object of a node's dictionary up (read) or down (written).
//!
//! - [`Server`]: the node's side, over anything that is an [`Objects`]
//! - [`AbortCode`]: why a transfer was refused

mod abort;
mod crc;
mod server;
mod wire;

pub use abort::AbortCode;
pub use server::{Objects, Server};
