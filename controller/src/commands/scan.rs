//! `syncline scan`: who is on a bus.

use super::tool::{BusChoice, CAPACITY, Session, milliseconds};
use super::{Exit, bad_input, report};
use crate::port::PortError;
use crate::realtime::now;
use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;
use syncline_canopen::cia402::Statusword;
use syncline_canopen::dictionary::Preset;
use syncline_canopen::nmt::State;
use syncline_canopen::sdo::{Client, Reason};
use syncline_canopen::{Address, Frame, Instant, NodeId, guarding, heartbeat};
use syncline_drives::model::{MODELS, Model};

const DEVICE_TYPE: Address = Address::new(0x1000, 0);
const NAME: Address = Address::new(0x1008, 0);
const VENDOR: Address = Address::new(0x1018, 1);
const PRODUCT: Address = Address::new(0x1018, 2);
const REVISION: Address = Address::new(0x1018, 3);
const STATUSWORD: Address = Address::new(0x6041, 0);

/// Number of the device profile for drives, CiA 402, in 1000h.
const DRIVES: u32 = 402;

/// Find out who is on a bus: every node that answers or is heard, its identity and state.
///
/// Reads device type, name and identity of all 127 nodes at once, the statusword of drives of CiA 402, and listens for
/// heartbeats meanwhile. Nothing is written, nothing is commanded. A node that is Stopped and has no
/// heartbeat is found by --guarding only.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    bus: BusChoice,
    /// Milliseconds to wait for an answer.
    #[arg(long, value_name = "MS", default_value_t = 300, value_parser = milliseconds())]
    timeout: u64,
    /// Milliseconds to listen for heartbeats, at least.
    #[arg(long, value_name = "MS", default_value_t = 1100, value_parser = milliseconds())]
    listen: u64,
    /// Ask nodes that are not found otherwise for their state by node guarding, where the bus has
    /// remote frames. Mind that this starts the life guarding of a node that has a life time.
    #[arg(long)]
    guarding: bool,
}

impl Args {
    /// Prints who is there.
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

    fn scan(&self, mut session: Session) -> Result<(), PortError> {
        let end = now() + Duration::from_millis(self.listen);
        let timeout = Duration::from_millis(self.timeout);
        let mut heard = Heard::default();
        let mut ask = |nodes: &[NodeId], address| {
            let clients = nodes.iter();
            let mut clients: Vec<Client> = clients
                .map(|&node| Client::new(node, timeout, CAPACITY))
                .collect();
            let answers = session.ask(&mut clients, address, &mut |frame| heard.note(frame))?;
            Ok::<_, PortError>(nodes.iter().copied().zip(answers).collect::<Answers>())
        };
        let all: Vec<NodeId> = (1..=127).filter_map(NodeId::new).collect();
        let mut types = ask(&all, DEVICE_TYPE)?;
        types.retain(|_, answer| *answer != Err(Reason::TimedOut));
        let nodes: Vec<NodeId> = types.keys().copied().collect();
        // What 6041h holds elsewhere is another profile's affair.
        let is_drive = |answer: &Result<Vec<u8>, _>| {
            let profile = |data: &Vec<u8>| number(data) & 0xFFFF;
            answer.as_ref().is_ok_and(|data| profile(data) == DRIVES)
        };
        let drives = types.iter().filter(|(_, answer)| is_drive(answer));
        let drives: Vec<NodeId> = drives.map(|(&node, _)| node).collect();
        let objects = Objects {
            types,
            names: ask(&nodes, NAME)?,
            vendors: ask(&nodes, VENDOR)?,
            products: ask(&nodes, PRODUCT)?,
            revisions: ask(&nodes, REVISION)?,
            statuswords: ask(&drives, STATUSWORD)?,
        };
        listen(&mut session, &mut heard, end)?;
        if self.guarding {
            // Whoever a master guards has been heard by now: no toggle bit of its is disturbed.
            let is_silent = |node: &&NodeId| {
                !objects.types.contains_key(node) && !heard.states.contains_key(node)
            };
            let silent = all.iter().filter(is_silent);
            for request in silent.filter_map(|&node| guarding::request(node)) {
                session.send(request)?;
            }
            listen(&mut session, &mut heard, now() + timeout)?;
        }
        let found: BTreeSet<_> = objects.types.keys().chain(heard.states.keys()).collect();
        for &&node in &found {
            objects.print(node, heard.states.get(&node));
        }
        if found.is_empty() {
            println!("nobody answers, nobody is heard");
        }
        Ok(())
    }
}

/// Hears what goes over the bus until `end`.
fn listen(session: &mut Session, heard: &mut Heard, end: Instant) -> Result<(), PortError> {
    while now() < end {
        let left = end.saturating_since(now());
        session.receive(left, &mut |_, frame| heard.note(frame))?;
    }
    Ok(())
}

/// What each node answers.
type Answers = BTreeMap<NodeId, Result<Vec<u8>, Reason>>;

/// What goes over the bus while nodes are asked.
#[derive(Default)]
struct Heard {
    /// The last byte of each node's error control, without the toggle bit.
    states: BTreeMap<NodeId, u8>,
}

impl Heard {
    fn note(&mut self, frame: &Frame) {
        self.states.extend(heartbeat::state_byte(frame));
    }
}

/// What nodes say of themselves.
struct Objects {
    types: Answers,
    names: Answers,
    vendors: Answers,
    products: Answers,
    revisions: Answers,
    statuswords: Answers,
}

impl Objects {
    fn print(&self, node: NodeId, state: Option<&u8>) {
        let of = |answers: &Answers| Some(number(answers.get(&node)?.as_ref().ok()?));
        let hex = |answers| of(answers).map_or("-".into(), |value| format!("{value:08X}h"));
        let device_type = of(&self.types);
        let model = device_type.and_then(|device_type| recognise(device_type, of(&self.vendors)));
        println!(
            "node {node}: {}",
            model.map_or("unknown", |model| model.title)
        );
        match self.types.get(&node) {
            None => println!("  does not answer, is only heard"),
            Some(answer) => {
                let device_type = match answer {
                    Ok(_) => hex(&self.types),
                    Err(reason) => reason.to_string(),
                };
                println!(
                    "  device type {device_type}, vendor {}, product {}, revision {}",
                    hex(&self.vendors),
                    hex(&self.products),
                    hex(&self.revisions)
                );
            }
        }
        if let Some(Ok(name)) = self.names.get(&node) {
            println!("  name {:?}", String::from_utf8_lossy(name).trim_end());
        }
        match state.map(|&byte| (byte, State::from_byte(byte))) {
            Some((_, Some(state))) => println!("  NMT {state:?}"),
            Some((byte, None)) => println!("  NMT state {byte:02X}h, which CiA 301 does not know"),
            None => {}
        }
        if let Some(word) = of(&self.statuswords) {
            println!("  statusword {}", Statusword(word as u16));
        }
    }
}

/// An unsigned number, little-endian.
fn number(data: &[u8]) -> u32 {
    let bytes = data.iter().take(4).rev();
    bytes.fold(0, |number, &byte| number << 8 | u32::from(byte))
}

/// The model whose table says the same of itself: a device has its vendor where the table has one.
pub(super) fn recognise(device_type: u32, vendor: Option<u32>) -> Option<&'static Model> {
    let says = |model: &Model, address: Address| {
        let mut entries = model.dictionary.iter();
        let entry = entries.find(|entry| entry.address == address);
        entry.map(|entry| entry.preset)
    };
    let told = |value: Option<u32>| value.map(|value| Preset::Number(value.into()));
    let mut models = MODELS.iter().copied();
    models.find(|model| {
        says(model, DEVICE_TYPE) == told(Some(device_type)) && says(model, VENDOR) == told(vendor)
    })
}
