//! What stands in the tables of all devices: a name, a place on a bus, a model, objects to write.

use super::described::{self, Described};
use super::files::Files;
use super::read::{BusTable, name};
use super::{Drive, Encoder, IoNode, SpindleDrive};
use std::{collections::BTreeMap, ops::Range, time::Duration};
use syncline_canopen::{Address, NodeId};
use syncline_drives::model::{Data, MODELS, Model, Scaling, Write};
use syncline_strict_toml::{Log, Table, integer};
use toml::{Spanned, de::DeValue};

/// A device of a machine, whatever it does: its place on the buses, and where it has one, on an axis.
#[derive(Clone, Copy, Debug)]
pub struct Node<'m> {
    /// As axes and messages name it.
    pub name: &'m str,
    /// Index of its bus in [`Machine::buses`](super::Machine::buses).
    pub bus: usize,
    /// Its node id, unique on the bus.
    pub id: NodeId,
    /// What it is.
    pub model: &'static Model,
    /// Where it sits; `None` of what neither moves an axis nor sees one.
    pub seat: Option<Seat<'m>>,
    /// Written after the standard set-up, in this order.
    pub objects: &'m [Write],
}

/// The axis that a device moves or sees.
#[derive(Clone, Copy, Debug)]
pub struct Seat<'m> {
    /// Its index in [`Machine::axes`](super::Machine::axes).
    pub axis: usize,
    /// The axis's millimetres and the device's own increments.
    pub scaling: &'m Scaling,
}

impl<'m> From<&'m Drive> for Node<'m> {
    fn from(drive: &'m Drive) -> Self {
        Self {
            name: &drive.name,
            bus: drive.bus,
            id: drive.node,
            model: drive.model,
            seat: Some(Seat {
                axis: drive.axis,
                scaling: &drive.scaling,
            }),
            objects: &drive.objects,
        }
    }
}

impl<'m> From<&'m Encoder> for Node<'m> {
    fn from(encoder: &'m Encoder) -> Self {
        Self {
            name: &encoder.name,
            bus: encoder.bus,
            id: encoder.node,
            model: encoder.model,
            seat: encoder.axis.map(|axis| Seat {
                axis,
                scaling: &encoder.scaling,
            }),
            objects: &encoder.objects,
        }
    }
}

impl<'m> From<&'m IoNode> for Node<'m> {
    fn from(io: &'m IoNode) -> Self {
        Self {
            name: &io.name,
            bus: io.bus,
            id: io.node,
            model: io.model,
            seat: None,
            objects: &io.objects,
        }
    }
}

/// It is not on the path, and so at no place of an axis.
impl<'m> From<&'m SpindleDrive> for Node<'m> {
    fn from(drive: &'m SpindleDrive) -> Self {
        Self {
            name: &drive.name,
            bus: drive.bus,
            id: drive.node,
            model: drive.model,
            seat: None,
            objects: &drive.objects,
        }
    }
}

/// A device's place and model, good on its own.
pub(super) struct NodeTable {
    /// `drive`
    kind: &'static str,
    pub(super) name: Spanned<String>,
    pub(super) bus: Spanned<String>,
    pub(super) node: Spanned<NodeId>,
    pub(super) model: &'static Model,
    /// What a file says of the model, if one describes it, and where it is named.
    pub(super) described: Option<Spanned<Described>>,
    pub(super) objects: Vec<Write>,
}

impl NodeTable {
    /// Reads the keys that every `kind` of device has; its models are those `of_kind`, and what `files`
    /// describe.
    pub(super) fn read(
        log: &mut Log<'_>,
        files: &mut Files,
        table: &mut Table<'_, '_>,
        kind: &'static str,
        of_kind: fn(&Model) -> bool,
    ) -> Option<Self> {
        let name = name(log, table);
        let bus = table.text(log, "bus", "the `name` of a [[bus]]", |_| true);
        let node = table.integer(log, "node", 1..=127, "");
        let (model, described) = if table.has_text("model", described::is_file) {
            let described = described::read(log, files, table, of_kind);
            described.map_or((None, None), |(model, of)| (Some(model), Some(of)))
        } else {
            let models = MODELS.iter().filter(|model| of_kind(model));
            let models = models.map(|model| model.name);
            let model = table.choice(log, "model", models);
            (model.and_then(|name| Model::by_name(name.get_ref())), None)
        };
        let entries = table.items(log, "sdo", SDO);
        let objects: Vec<_> = match model {
            Some(model) => entries
                .iter()
                .map(|entry| sdo_entry(log, &table.title, model, entry))
                .collect(),
            None => Vec::new(),
        };
        let node = node?;
        Some(Self {
            kind,
            name: name?,
            bus: bus?,
            node: Spanned::new(node.span(), node_id(*node.get_ref())?),
            model: model?,
            described,
            objects: objects.into_iter().collect::<Option<_>>()?,
        })
    }

    pub(super) fn title(&self) -> String {
        format!("{} \"{}\"", self.kind, self.name.get_ref())
    }

    /// The place of its bus among them, which names have told to be there.
    fn resolve_bus(&self, buses: &[BusTable]) -> Option<usize> {
        let mut names = buses.iter().map(|bus| bus.name.get_ref());
        names.position(|name| name == self.bus.get_ref())
    }

    /// Whether the device takes the machine's cycle.
    fn check_cycle(&self, log: &mut Log<'_>, cycle: &Spanned<i64>) {
        let model = self.model;
        if model.takes_cycle(Duration::from_micros(*cycle.get_ref() as u64)) {
            return;
        }
        log.report(
            cycle.span(),
            format!(
                "machine: `cycle_us` is {}, which {} ({}) does not take",
                cycle.get_ref(),
                self.title(),
                model.title
            ),
            format!(
                "allowed: {}…{} µs in steps of {} µs",
                model.cycles.start().as_micros(),
                model.cycles.end().as_micros(),
                model.cycle_step.as_micros()
            ),
        );
    }

    /// Whether the device can have its node id.
    fn check_node(&self, log: &mut Log<'_>) {
        let (nodes, node) = (&self.model.nodes, self.node.get_ref());
        if nodes.contains(&node.get()) {
            return;
        }
        log.report(
            self.node.span(),
            format!(
                "{}: node {node} is none that a {} can have",
                self.title(),
                self.model.title
            ),
            format!("allowed: {}…{}", nodes.start(), nodes.end()),
        );
    }

    /// Whether the device takes its bus's bit rate.
    fn check_bit_rate(&self, log: &mut Log<'_>, bus: &BusTable) {
        let rates = self.model.bitrates;
        let rate = bus.bitrate.get_ref();
        if rates.iter().any(|taken| i64::from(*taken) == *rate) {
            return;
        }
        let rates: Vec<_> = rates.iter().map(u32::to_string).collect();
        log.report(
            bus.bitrate.span(),
            format!(
                "bus \"{}\": `bitrate` is {rate}, which {} ({}) does not take",
                bus.name.get_ref(),
                self.title(),
                self.model.title
            ),
            format!("allowed: {} (bit/s)", rates.join(", ")),
        );
    }
}

/// The bus of each device, where it exists. Its node id is unique there; the controller is on every bus.
pub(super) fn places(
    log: &mut Log<'_>,
    devices: &[&NodeTable],
    buses: &[BusTable],
    cycle: &Spanned<i64>,
    controller: NodeId,
) -> Vec<Option<usize>> {
    let bus_of: Vec<_> = (devices.iter())
        .map(|device| device.resolve_bus(buses))
        .collect();
    let mut nodes = BTreeMap::new();
    for (device, bus) in devices.iter().zip(&bus_of) {
        let Some(bus) = *bus else { continue };
        let node = device.node.get_ref();
        device.check_node(log);
        let other = if *node == controller {
            Some("the controller")
        } else {
            nodes.insert((bus, *node), device.name.get_ref().as_str())
        };
        if let Some(other) = other {
            log.report(
                device.node.span(),
                format!(
                    "{}: node {node} is already {other} on bus \"{}\"",
                    device.title(),
                    buses[bus].name.get_ref()
                ),
                "allowed: 1…127, each once on a bus",
            );
        }
    }
    for (index, (device, bus)) in devices.iter().zip(&bus_of).enumerate() {
        // Of several devices of one model the first tells.
        let before = devices[..index].iter().zip(&bus_of);
        let mut alike = before.filter(|(other, _)| other.model.name == device.model.name);
        if alike.clone().next().is_none() {
            device.check_cycle(log, cycle);
        }
        if let Some(bus) = *bus
            && alike.all(|(_, other)| *other != Some(bus))
        {
            device.check_bit_rate(log, &buses[bus]);
        }
    }
    bus_of
}

/// What a `sdo` entry looks like.
const SDO: &str = "a list of [object, value] pairs such as [\"3012:3\", 5]";

/// An object and the value beside it, of a list of such pairs.
pub(super) fn pair<'e, 'i>(
    log: &mut Log<'_>,
    title: &str,
    key: &str,
    entry: &'e Spanned<DeValue<'i>>,
) -> Option<(Spanned<Address>, &'e Spanned<DeValue<'i>>)> {
    let items = entry.get_ref().as_array().map(|items| &items[..]);
    let Some([object, value]) = items else {
        let problem = "this entry is not an object with a value";
        log.report(
            entry.span(),
            format!("{title}: `{key}`: {problem}"),
            format!("allowed: {SDO}"),
        );
        return None;
    };
    let address = object.get_ref().as_str().map(str::parse::<Address>);
    let Some(Ok(address)) = address else {
        log.report(
            object.span(),
            format!("{title}: `{key}`: this is no object"),
            "allowed: \"index:sub\" in hexadecimal, such as \"3012:3\"",
        );
        return None;
    };
    Some((Spanned::new(object.span(), address), value))
}

fn sdo_entry(
    log: &mut Log<'_>,
    title: &str,
    model: &Model,
    entry: &Spanned<DeValue<'_>>,
) -> Option<Write> {
    let (object, value) = pair(log, title, "sdo", entry)?;
    let address = *object.get_ref();
    let mut refuse = |span: Range<usize>, problem: String, help: String| {
        log.report(span, format!("{title}: `sdo`: {problem}"), help);
        None
    };
    if model.r_pdo_values.iter().any(|(sent, _)| *sent == address) {
        let problem = format!("{address} is sent by R_PDO all the time");
        let help = "allowed: objects that the description has no value for in `r_pdo_values`";
        return refuse(object.span(), problem, help.into());
    }
    if (model.reserved)(address) {
        let problem = format!("{address} is the controller's own");
        let help = "allowed: objects outside communication, operating mode, cycle, scaling and \
                    synchronisation, which the controller sets from this file's keys";
        return refuse(object.span(), problem, help.into());
    }
    let known = model
        .dictionary
        .iter()
        .find(|known| known.address == address);
    let Some(known) = known.filter(|known| known.access.writable()) else {
        let problem = match known {
            Some(known) => format!("{address} ({}) is read-only", known.name),
            None => format!("the {} has no object {address}", model.title),
        };
        let help = "allowed: objects that the drive's manual lists as writable".into();
        return refuse(object.span(), problem, help);
    };
    let Some(range) = known.range.or_else(|| Data::range(known.data_type)) else {
        let problem = format!("{address} ({}) is not a number", known.name);
        return refuse(
            object.span(),
            problem,
            "allowed: objects that are numbers".into(),
        );
    };
    let data = integer(value.get_ref())
        .filter(|value| (range.0..=range.1).contains(value))
        .and_then(|value| Data::encode(known.data_type, value));
    match data {
        Some(data) => Some(Write { address, data }),
        None => {
            let problem = format!("this is no value for {address} ({})", known.name);
            let help = format!("allowed: a whole number {}…{}", range.0, range.1);
            refuse(value.span(), problem, help)
        }
    }
}

pub(super) fn node_id(number: i64) -> Option<NodeId> {
    u8::try_from(number).ok().and_then(NodeId::new)
}
