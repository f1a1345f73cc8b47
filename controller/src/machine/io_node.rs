//! `[[io]]`: devices that have inputs and outputs and nothing else.

use super::files::Files;
use super::node::NodeTable;
use syncline_canopen::NodeId;
use syncline_drives::model::{Model, Write};
use syncline_strict_toml::{Log, Table};

/// An I/O node on a bus.
#[derive(Clone, Debug)]
pub struct IoNode {
    /// As inputs, outputs and messages name it.
    pub name: String,
    /// Index of its bus in [`Machine::buses`](super::Machine::buses).
    pub bus: usize,
    /// Its node id, unique on the bus.
    pub node: NodeId,
    /// What it is.
    pub model: &'static Model,
    /// It tells its inputs when they change, not at every SYNC.
    pub by_event: bool,
    /// Written after the standard set-up, in this order.
    pub objects: Vec<Write>,
}

/// A table good on its own.
pub(super) struct IoTable {
    pub(super) node: NodeTable,
    by_event: bool,
}

impl IoTable {
    pub(super) fn read(
        log: &mut Log<'_>,
        files: &mut Files,
        mut table: Table<'_, '_>,
    ) -> Option<Self> {
        let node = NodeTable::read(log, files, &mut table, "io", Model::is_io);
        let inputs = table.choice_or(log, "inputs", "sync", ["sync", "event"].into_iter());
        table.finish(log);
        Some(Self {
            node: node?,
            by_event: inputs == "event",
        })
    }

    pub(super) fn join(self, bus: usize) -> IoNode {
        IoNode {
            name: self.node.name.into_inner(),
            bus,
            node: self.node.node.into_inner(),
            model: self.node.model,
            by_event: self.by_event,
            objects: self.node.objects,
        }
    }
}
