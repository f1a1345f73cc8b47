//! `syncline nmt`: an NMT command to one node or to all.

use super::tool::{BusChoice, node_id};
use super::{Exit, bad_input, report};
use clap::ValueEnum;
use syncline_canopen::NodeId;
use syncline_canopen::nmt::{Command, Request};

/// Send an NMT command to a node, or to all of them.
///
/// Mind that stopping or resetting a drive whose power stage is on is an error to many drives.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    bus: BusChoice,
    /// What to do.
    command: Order,
    /// Node id; all nodes if there is none.
    #[arg(value_parser = node_id)]
    node: Option<NodeId>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Order {
    Start,
    Stop,
    PreOperational,
    ResetNode,
    ResetCommunication,
}

impl Args {
    /// Sends the command.
    pub(super) fn execute(&self) -> Exit {
        let mut session = match self.bus.open() {
            Ok(session) => session,
            Err(error) => return bad_input(&error),
        };
        let request = Request {
            command: match self.command {
                Order::Start => Command::Start,
                Order::Stop => Command::Stop,
                Order::PreOperational => Command::EnterPreOperational,
                Order::ResetNode => Command::ResetNode,
                Order::ResetCommunication => Command::ResetCommunication,
            },
            node: self.node,
        };
        match session.send(request.encode()) {
            Ok(()) => Exit::Finished,
            Err(error) => {
                report(&error);
                Exit::Stopped
            }
        }
    }
}
