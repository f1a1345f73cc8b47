//! What the tools for a bus at work share: which bus, what is known of its nodes, SDO transfers.

use crate::machine::Machine;
use crate::port::PortError;
use crate::port::url::{BusUrl, End};
use crate::port::wire::Wire;
use crate::realtime::now;
use clap::builder::RangedU64ValueParser;
use std::collections::BTreeMap;
use std::error::Error;
use std::path::PathBuf;
use std::str::FromStr;
use std::time::Duration;
use syncline_canopen::sdo::{Client, Reason};
use syncline_canopen::{Address, Frame, Instant, NodeId};
use syncline_drives::model::{MODELS, Model};
use syncline_drives::twin::{Kind, TWINS};

/// Bytes that an object may have.
pub(super) const CAPACITY: usize = 1 << 16;

/// Which bus.
#[derive(Debug, clap::Args)]
pub(super) struct BusChoice {
    /// The bus: a SocketCAN interface such as `can0`, `socketcand://HOST:PORT/BUS` or
    /// `udp://GROUP:PORT?interface=NAME`.
    #[arg(long, value_name = "PORT")]
    bus: BusUrl,
    #[command(flatten)]
    rate: BitRate,
}

/// How fast a bus is.
#[derive(Debug, clap::Args)]
pub(super) struct BitRate {
    /// Bit rate that the CAN interface must have.
    #[arg(long, value_name = "BIT/S", default_value_t = 1_000_000)]
    bitrate: u32,
}

impl BusChoice {
    /// Opens the bus.
    pub(super) fn open(&self) -> Result<Session, PortError> {
        Session::open(&self.bus, &self.rate)
    }
}

/// What is known of the nodes.
#[derive(Debug, clap::Args)]
pub(super) struct Known {
    /// Take names and types of the drives from this machine file.
    #[arg(long, value_name = "FILE")]
    machine: Option<PathBuf>,
    /// A node and what it is, such as `1:lxm32m`. Can be repeated.
    #[arg(long = "node", value_name = "ID:MODEL")]
    nodes: Vec<NodeOfModel>,
}

/// A node and what it is: `1:lxm32m`.
#[derive(Clone, Copy, Debug)]
pub(super) struct NodeOfModel {
    pub(super) node: NodeId,
    pub(super) model: &'static Model,
}

impl FromStr for NodeOfModel {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (node, model) = text.split_once(':').ok_or("write ID:MODEL")?;
        let node = node_id(node)?;
        let model = Model::by_name(model).ok_or_else(|| {
            let known: Vec<&str> = MODELS.iter().map(|model| model.name).collect();
            format!("no model `{model}`, only {}", known.join(", "))
        })?;
        can_have(model, node)?;
        Ok(Self { node, model })
    }
}

/// A node and the device that is simulated there: `5:twk_crn`.
#[derive(Clone, Copy, Debug)]
pub(super) struct NodeOfTwin {
    pub(super) node: NodeId,
    pub(super) twin: &'static Kind,
}

impl FromStr for NodeOfTwin {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (node, twin) = text.split_once(':').ok_or("write ID:DEVICE")?;
        let node = node_id(node)?;
        let twin = Kind::by_name(twin).ok_or_else(|| {
            let known: Vec<&str> = TWINS.iter().map(|twin| twin.name).collect();
            format!("no device `{twin}`, only {}", known.join(", "))
        })?;
        Model::by_name(twin.name).map_or(Ok(()), |model| can_have(model, node))?;
        Ok(Self { node, twin })
    }
}

/// Refuses a node id that a device cannot have.
fn can_have(model: &Model, node: NodeId) -> Result<(), String> {
    let (nodes, title) = (&model.nodes, model.title);
    match nodes.contains(&node.get()) {
        true => Ok(()),
        false => Err(format!(
            "a {title} has a node id from {} to {}",
            nodes.start(),
            nodes.end()
        )),
    }
}

/// How long to wait for an answer, on the command line.
pub(super) fn milliseconds() -> RangedU64ValueParser {
    clap::value_parser!(u64).range(1..=600_000)
}

/// A node id on the command line.
pub(super) fn node_id(text: &str) -> Result<NodeId, String> {
    let id = text.parse().ok().and_then(NodeId::new);
    id.ok_or_else(|| format!("`{text}` is no node id: 1 to 127"))
}

impl Known {
    /// The models by node.
    pub(super) fn models(&self) -> Result<BTreeMap<u8, &'static Model>, Box<dyn Error>> {
        let mut models = BTreeMap::new();
        if let Some(file) = &self.machine {
            let machine = Machine::load(file)?;
            models.extend(machine.nodes().map(|node| (node.id.get(), node.model)));
        }
        let nodes = self.nodes.iter();
        models.extend(nodes.map(|known| (known.node.get(), known.model)));
        Ok(models)
    }
}

/// A bus that is open.
pub(super) struct Session {
    wire: Box<dyn Wire + Send>,
    requests: Vec<Frame>,
}

impl Session {
    /// Opens a bus.
    pub(super) fn open(bus: &BusUrl, rate: &BitRate) -> Result<Self, PortError> {
        Ok(Self {
            wire: bus.open(rate.bitrate, End::Client)?,
            requests: Vec::new(),
        })
    }

    /// Sends one frame, and waits until it has left.
    pub(super) fn send(&mut self, frame: Frame) -> Result<(), PortError> {
        self.requests.push(frame);
        for _ in 0..1000 {
            self.wire.send(&mut self.requests)?;
            if self.requests.is_empty() {
                break;
            }
            self.wire.wait(Duration::from_millis(1))?;
        }
        Ok(())
    }

    /// Hands over what arrives within `most`.
    pub(super) fn receive(
        &mut self,
        most: Duration,
        sink: &mut dyn FnMut(Instant, &Frame),
    ) -> Result<(), PortError> {
        self.wire.wait(most)?;
        while self.wire.receive(sink)? {}
        Ok(())
    }

    /// Asks several nodes for an object each at once, and hands over whatever arrives meanwhile.
    pub(super) fn ask(
        &mut self,
        clients: &mut [Client],
        address: Address,
        other: &mut dyn FnMut(&Frame),
    ) -> Result<Vec<Result<Vec<u8>, Reason>>, PortError> {
        let Self { wire, requests } = self;
        for client in clients.iter_mut() {
            // A new client is idle.
            let _ = client.upload(now(), address, requests);
        }
        let mut answers = vec![Err(Reason::TimedOut); clients.len()];
        while clients.iter().any(Client::is_busy) {
            wire.send(requests)?;
            wire.wait(Duration::from_millis(5))?;
            while wire.receive(&mut |at, frame| {
                other(frame);
                for (client, answer) in clients.iter_mut().zip(&mut answers) {
                    if let Some(ended) = client.on_frame(at, frame, requests) {
                        *answer = ended.map(<[u8]>::to_vec).map_err(|failed| failed.reason);
                    }
                }
            })? {}
            for client in clients.iter_mut() {
                let _ = client.poll(now(), requests);
            }
        }
        wire.send(requests)?;
        Ok(answers)
    }

    /// Reads an object.
    pub(super) fn read(
        &mut self,
        client: &mut Client,
        address: Address,
    ) -> Result<Vec<u8>, Box<dyn Error>> {
        client.upload(now(), address, &mut self.requests)?;
        self.transfer(client)
    }

    /// Writes an object.
    pub(super) fn write(
        &mut self,
        client: &mut Client,
        address: Address,
        data: &[u8],
    ) -> Result<(), Box<dyn Error>> {
        client.download(now(), address, data, &mut self.requests)?;
        self.transfer(client).map(drop)
    }

    fn transfer(&mut self, client: &mut Client) -> Result<Vec<u8>, Box<dyn Error>> {
        let Self { wire, requests } = self;
        loop {
            wire.send(requests)?;
            wire.wait(Duration::from_millis(5))?;
            let mut ended = None;
            while wire.receive(&mut |at, frame| {
                if let Some(result) = client.on_frame(at, frame, requests) {
                    ended = Some(result.map(<[u8]>::to_vec));
                }
            })? {}
            if ended.is_none() {
                ended = client.poll(now(), requests).map(Err);
            }
            if let Some(ended) = ended {
                wire.send(requests)?;
                return Ok(ended?);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The switches of a TWK CRN tell 64 nodes apart (crn S7, S35).
    #[test]
    fn a_node_id_that_a_device_cannot_have_is_refused() {
        for (text, taken) in [
            ("64:twk_crn", true),
            ("65:twk_crn", false),
            ("65:lxm32m", true),
        ] {
            let [twin, model] = [
                text.parse::<NodeOfTwin>().map(drop),
                text.parse::<NodeOfModel>().map(drop),
            ];
            assert_eq!(twin, model);
            let refused = "a TWK CRN has a node id from 1 to 64".to_owned();
            assert_eq!(twin, if taken { Ok(()) } else { Err(refused) });
        }
    }
}
