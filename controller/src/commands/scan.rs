//! `syncline scan`: who is on a bus.

use super::tool::{BusChoice, CAPACITY, Session, milliseconds};
use super::{Exit, bad_input, report};
use std::collections::BTreeMap;
use std::time::Duration;
use syncline_canopen::cia402::Statusword;
use syncline_canopen::dictionary::Preset;
use syncline_canopen::nmt::State;
use syncline_canopen::sdo::Client;
use syncline_canopen::{Address, Frame, NodeId, heartbeat};
use syncline_drives::model::{MODELS, Model};

const DEVICE_TYPE: Address = Address::new(0x1000, 0);
const NAME: Address = Address::new(0x1008, 0);
const VENDOR: Address = Address::new(0x1018, 1);
const PRODUCT: Address = Address::new(0x1018, 2);
const REVISION: Address = Address::new(0x1018, 3);
const STATUSWORD: Address = Address::new(0x6041, 0);

/// Find out who is on a bus: every node that answers, its identity and state.
///
/// Reads device type, name, identity and statusword of all 127 nodes at once; nothing is
/// written, nothing is commanded. The NMT state is shown if a heartbeat is heard meanwhile.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    bus: BusChoice,
    /// Milliseconds to wait for an answer.
    #[arg(long, value_name = "MS", default_value_t = 300, value_parser = milliseconds())]
    timeout: u64,
}

impl Args {
    /// Prints who answers.
    pub(super) fn execute(&self) -> Exit {
        let session = match self.bus.open() {
            Ok(session) => session,
            Err(error) => return bad_input(&error),
        };
        match self.scan(session) {
            Ok(()) => Exit::Finished,
            Err(error) => {
                report(&error);
                Exit::Stopped
            }
        }
    }

    fn scan(&self, mut session: Session) -> Result<(), crate::port::PortError> {
        let mut nodes: Vec<NodeId> = (1..=127).filter_map(NodeId::new).collect();
        let timeout = Duration::from_millis(self.timeout);
        let mut states: BTreeMap<u8, State> = BTreeMap::new();
        let mut ask = |nodes: &[NodeId], address| {
            let clients = nodes.iter();
            let mut clients: Vec<Client> = clients
                .map(|&node| Client::new(node, timeout, CAPACITY))
                .collect();
            session.ask(&mut clients, address, &mut |frame: &Frame| {
                if let Some((node, state)) = heartbeat::decode(frame) {
                    states.insert(node.get(), state);
                }
            })
        };
        let types = ask(&nodes, DEVICE_TYPE)?;
        let mut answered = types.iter();
        nodes.retain(|_| answered.next().is_some_and(Option::is_some));
        let types: Vec<Vec<u8>> = types.into_iter().flatten().collect();
        let names = ask(&nodes, NAME)?;
        let vendors = ask(&nodes, VENDOR)?;
        let products = ask(&nodes, PRODUCT)?;
        let revisions = ask(&nodes, REVISION)?;
        let statuswords = ask(&nodes, STATUSWORD)?;
        for (place, node) in nodes.iter().enumerate() {
            let device_type = number(&types[place]);
            let vendor = vendors[place].as_deref().map(number);
            let model = recognise(device_type, vendor).map_or("unknown", |model| model.title);
            let hex = |value: &Option<Vec<u8>>| match value {
                Some(data) => format!("{:08X}h", number(data)),
                None => "-".into(),
            };
            println!("node {node}: {model}");
            println!(
                "  device type {device_type:08X}h, vendor {}, product {}, revision {}",
                hex(&vendors[place]),
                hex(&products[place]),
                hex(&revisions[place])
            );
            if let Some(name) = &names[place] {
                println!("  name {:?}", String::from_utf8_lossy(name).trim_end());
            }
            if let Some(state) = states.get(&node.get()) {
                println!("  NMT {state:?}");
            }
            if let Some(word) = &statuswords[place] {
                println!("  statusword {}", Statusword(number(word) as u16));
            }
        }
        if nodes.is_empty() {
            println!("nobody answers");
        }
        Ok(())
    }
}

/// An unsigned number, little-endian.
fn number(data: &[u8]) -> u32 {
    let bytes = data.iter().take(4).rev();
    bytes.fold(0, |number, &byte| number << 8 | u32::from(byte))
}

/// The model whose table says the same of itself.
pub(super) fn recognise(device_type: u32, vendor: Option<u32>) -> Option<&'static Model> {
    let says = |model: &Model, address: Address, value: u32| {
        let mut entries = model.dictionary.iter();
        let entry = entries.find(|entry| entry.address == address);
        entry.is_some_and(|entry| entry.preset == Preset::Number(value.into()))
    };
    let mut models = MODELS.iter().copied();
    models.find(|model| {
        says(model, DEVICE_TYPE, device_type)
            && vendor.is_some_and(|vendor| says(model, VENDOR, vendor))
    })
}
