//! What the frames on a bus mean, told to a person: service, node, objects by name.
//!
//! A [`Monitor`] sees every frame in turn. It knows the identifiers of the pre-defined connection
//! set (CiA 301); of nodes whose table it was given it also knows names and types, and it follows
//! the PDO parameters that masters write:
//!
//! ```
//! use syncline_canopen::dictionary::{DataType::*, Entry, ro, rw, table};
//! use syncline_canopen::monitor::Monitor;
//! use syncline_canopen::{CobId, Frame, NodeId};
//!
//! static TABLE: [Entry; 5] = table([
//!     rw(0x1800, 1, "COB-ID T_PDO1", U32).default_plus_node(0x180),
//!     rw(0x1A00, 0, "T_PDO1 mapping: number", U8).default(1),
//!     rw(0x1A00, 1, "1st mapped object", U32).default(0x6041_0010),
//!     rw(0x6040, 0, "Controlword", U16).r_pdo(),
//!     ro(0x6041, 0, "Statusword", U16).t_pdo(),
//! ]);
//!
//! let node = NodeId::new(3).ok_or("node")?;
//! let mut monitor = Monitor::new();
//! monitor.add(node, &TABLE);
//! let frame = Frame::new(CobId::t_pdo(1, node), &[0x37, 0x42]);
//! assert_eq!(
//!     monitor.decode(&frame),
//!     "node 3 T_PDO1: Statusword 4237h (Operation Enabled)"
//! );
//! # Ok::<(), &str>(())
//! ```

use crate::cia402::Statusword;
use crate::dictionary::{Address, DataType, Dictionary, Entry, Row};
use crate::emcy::Emergency;
use crate::nmt::{Command, Request, State};
use crate::node::mapping_of;
use crate::pdo::{CobIdWord, Unpacker};
use crate::sdo::AbortCode;
use crate::{CanId, Frame, NodeId, heartbeat};
use core::fmt::Write;

/// Nodes that a bus can have.
const NODES: usize = 127;

/// Bytes of a segmented transfer that are kept, however many come.
const KEPT: usize = 1 << 16;

/// Follows a bus.
#[derive(Debug)]
pub struct Monitor {
    nodes: Vec<Watched>,
}

/// What is known of a node.
#[derive(Debug)]
struct Watched {
    id: NodeId,
    /// Its values as far as they went over the bus; `None` if its table is not known.
    objects: Option<Dictionary>,
    /// The indices of its PDO parameters, 1400h ff. and 1800h ff.
    pdo_parameters: Vec<u16>,
    sdo: Transfer,
}

/// The SDO transfer that a node's default server was last seen in.
#[derive(Clone, Debug, Default)]
struct Transfer {
    address: Address,
    /// What is being written, until the node confirms it.
    pending: Option<(Row, i64)>,
    /// Segments' bytes so far.
    data: Vec<u8>,
    /// How many there are to be, if that was told.
    told: Option<usize>,
    /// The toggle bit that the next segment must have.
    toggle: bool,
    blocks: Blocks,
}

/// Who sends block segments now, whose first byte is a number and no command.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Blocks {
    #[default]
    None,
    FromClient,
    FromServer,
    /// The last segment has been sent, under this number; it may have to be sent again.
    Complete {
        from_client: bool,
        last: u8,
    },
}

impl Default for Monitor {
    fn default() -> Self {
        Self::new()
    }
}

impl Monitor {
    /// A monitor that knows no device.
    #[must_use]
    pub fn new() -> Self {
        let ids = (1..=NODES as u8).filter_map(NodeId::new);
        let watched = |id| Watched {
            id,
            objects: None,
            pdo_parameters: Vec::new(),
            sdo: Transfer::default(),
        };
        Self {
            nodes: ids.map(watched).collect(),
        }
    }

    /// Makes known what device a node is.
    pub fn add(&mut self, node: NodeId, table: &'static [Entry]) {
        let addresses = table.iter().map(|entry| entry.address);
        let parameters = addresses.filter(|address| {
            address.sub == 1 && matches!(address.index, 0x1400..0x1600 | 0x1800..0x1A00)
        });
        let watched = self.node(node);
        watched.pdo_parameters = parameters.map(|address| address.index).collect();
        watched.objects = Some(Dictionary::new(table, node));
    }

    /// What a frame means, in one line.
    pub fn decode(&mut self, frame: &Frame) -> String {
        if let Some(pdo) = self.nodes.iter().find_map(|node| node.pdo(frame)) {
            return pdo;
        }
        let CanId::Standard(id) = frame.id() else {
            return "unknown".into();
        };
        if let Some(request) = Request::decode(frame) {
            return self.nmt(request);
        }
        if id == 0 {
            return format!("unknown NMT command{}", raw(frame));
        }
        if let Some((node, state)) = heartbeat::state_byte(frame) {
            return self.error_control(node, state, frame);
        }
        if id == 0x080 || self.is_moved_sync(frame.id()) {
            return match frame.data() {
                [counter, ..] => format!("SYNC {counter}"),
                [] => "SYNC".into(),
            };
        }
        if let Some((node, emergency)) = Emergency::from_frame(frame) {
            return format!("node {node} {}", emcy(&emergency));
        }
        let node = NodeId::new((id & 0x7F) as u8);
        match (id & 0x780, node) {
            // An EMCY without data, as DS 301 V3 has it.
            (0x080, Some(node)) if frame.data().is_empty() && !frame.is_remote() => {
                self.boot_up(node)
            }
            (0x100, None) => "TIME".into(),
            (0x580 | 0x600, Some(node)) => match frame.data().try_into() {
                Ok(message) => {
                    let request = id & 0x780 == 0x600;
                    let text = self.node(node).sdo(request, message);
                    let side = if request { "request" } else { "answer" };
                    format!("node {node} SDO {side}: {text}")
                }
                Err(_) => format!("node {node} SDO of {} bytes", frame.dlc()),
            },
            (0x700, Some(node)) if frame.is_remote() => format!("node {node} guarding request"),
            (0x180..=0x57F, Some(node)) => {
                // T_PDO1 180h, R_PDO1 200h, T_PDO2 280h, …
                let place = (id & 0x780) / 0x80 - 3;
                let side = if place % 2 == 0 { 'T' } else { 'R' };
                format!("node {node} {side}_PDO{}{}", place / 2 + 1, raw(frame))
            }
            _ => "unknown".into(),
        }
    }

    /// Whether a node that is known was told that this is SYNC (1005h).
    fn is_moved_sync(&self, id: CanId) -> bool {
        let known = self.nodes.iter().filter_map(|node| node.objects.as_ref());
        let mut words = known.filter_map(|objects| objects.value(0x1005, 0));
        words.any(|word| CobIdWord(word as u32).can_id() == id)
    }

    fn node(&mut self, node: NodeId) -> &mut Watched {
        &mut self.nodes[usize::from(node.get()) - 1]
    }

    fn nmt(&mut self, request: Request) -> String {
        let command = match request.command {
            Command::Start => "start",
            Command::Stop => "stop",
            Command::EnterPreOperational => "enter Pre-Operational",
            Command::ResetNode => "reset node",
            Command::ResetCommunication => "reset communication",
        };
        if matches!(
            request.command,
            Command::ResetNode | Command::ResetCommunication
        ) {
            let addressed = self.nodes.iter_mut();
            for node in addressed.filter(|node| request.addresses(node.id)) {
                node.forget();
            }
        }
        match request.node {
            Some(node) => format!("NMT {command} node {node}"),
            None => format!("NMT {command} all nodes"),
        }
    }

    fn error_control(&mut self, node: NodeId, state: u8, frame: &Frame) -> String {
        let state = match State::from_byte(state) {
            Some(State::Initialising) => return self.boot_up(node),
            Some(State::Stopped) => "Stopped".to_owned(),
            Some(State::Operational) => "Operational".to_owned(),
            Some(State::PreOperational) => "Pre-Operational".to_owned(),
            None => format!("unknown NMT state {state:02X}h"),
        };
        // A heartbeat has no toggle bit; a guarding answer has one every other time.
        let service = match frame.data() {
            [byte] if byte & 0x80 != 0 => "guarding",
            _ => "heartbeat",
        };
        format!("node {node} {service}: {state}")
    }

    fn boot_up(&mut self, node: NodeId) -> String {
        self.node(node).forget();
        format!("node {node} boot-up")
    }
}

impl Watched {
    /// Whatever it was told before a reset is gone: of its objects the PDO parameters are what counts here.
    fn forget(&mut self) {
        self.sdo = Transfer::default();
        if let Some(objects) = &mut self.objects {
            objects.restore(|_| true);
        }
    }

    /// The PDO of this node that a frame is, with its objects.
    fn pdo(&self, frame: &Frame) -> Option<String> {
        let objects = self.objects.as_ref()?;
        let has_id = |parameter: u16| {
            let word = objects.value(parameter, 1);
            let word = word.map(|word| CobIdWord(word as u32));
            word.is_some_and(|word| word.is_valid() && word.can_id() == frame.id())
        };
        let mut parameters = self.pdo_parameters.iter().copied();
        let parameter = parameters.find(|&parameter| has_id(parameter))?;
        let (side, first) = if parameter < 0x1800 {
            ('R', 0x1400)
        } else {
            ('T', 0x1800)
        };
        let (node, number) = (self.id, parameter - first + 1);
        if frame.is_remote() {
            return Some(format!("node {node} {side}_PDO{number} request"));
        }
        let mut text = format!("node {node} {side}_PDO{number}:");
        let mut payload = Unpacker::new(frame.data());
        for (place, mapped) in mapping_of(objects, parameter + 0x200).enumerate() {
            text.push_str(if place == 0 { " " } else { ", " });
            let Some(raw) = payload.unsigned(mapped.bits) else {
                text.push_str("too short");
                return Some(text);
            };
            text.push_str(&self.name(mapped.address));
            text.push(' ');
            match objects.find(mapped.address) {
                Ok(row) => {
                    let data_type = objects.entry(row).data_type;
                    let value = data_type.extend(raw, u32::from(mapped.bits));
                    text.push_str(&value_text(mapped.address, data_type, value));
                }
                Err(_) => text.push_str(&raw.to_string()),
            }
        }
        Some(text)
    }

    /// An object's name, or its address if the name is not known.
    fn name(&self, address: Address) -> String {
        match self.entry(address) {
            Some(entry) => entry.name.into(),
            None => address.to_string(),
        }
    }

    fn row(&self, address: Address) -> Option<Row> {
        self.objects.as_ref()?.find(address).ok()
    }

    fn entry(&self, address: Address) -> Option<&'static Entry> {
        let row = self.row(address)?;
        self.objects.as_ref().map(|objects| objects.entry(row))
    }

    /// Address and, where known, name.
    fn title(&self, address: Address) -> String {
        match self.entry(address) {
            Some(entry) => format!("{address} {}", entry.name),
            None => address.to_string(),
        }
    }

    /// The number that an object's bytes mean, if it is known to be one.
    fn number(&self, address: Address, data: &[u8]) -> Option<(Row, i64)> {
        let row = self.row(address)?;
        let objects = self.objects.as_ref()?;
        let is_number = objects.entry(row).data_type.is_number();
        Some((row, objects.number(row, data).ok().filter(|_| is_number)?))
    }

    /// An object's value from its bytes, to be read.
    fn value(&self, address: Address, data: &[u8]) -> String {
        if let (Some((_, value)), Some(entry)) = (self.number(address, data), self.entry(address)) {
            return value_text(address, entry.data_type, value);
        }
        let text = core::str::from_utf8(data).ok();
        match text.filter(|text| text.chars().all(|c| c == ' ' || c.is_ascii_graphic())) {
            Some(text) if data.len() > 4 => format!("{text:?}"),
            _ => bytes(data),
        }
    }

    /// Keeps what the node's object has become.
    fn keep(&mut self, number: Option<(Row, i64)>) {
        if let (Some((row, value)), Some(objects)) = (number, &mut self.objects) {
            objects.set(row, value);
        }
    }

    /// What an expedited transfer carries in its 4 bytes: where it does not say how many count, those of
    /// the object, if that is known to be a number.
    fn expedited<'a>(&self, address: Address, command: u8, data: &'a [u8]) -> &'a [u8] {
        let size = if command & 0x01 != 0 {
            4 - usize::from(command >> 2 & 3)
        } else {
            let types = self.entry(address).map(|entry| entry.data_type);
            types.filter(|it| it.is_number()).map_or(4, DataType::size)
        };
        &data[..size.min(4)]
    }

    /// An SDO message of the default server.
    fn sdo(&mut self, request: bool, message: [u8; 8]) -> String {
        let named = Address::new(u16::from_le_bytes([message[1], message[2]]), message[3]);
        let (command, data) = (message[0], &message[4..]);
        let word = u32::from_le_bytes([message[4], message[5], message[6], message[7]]);
        if command == 0x80 {
            self.sdo = Transfer::default();
            let code = AbortCode::from(word);
            return format!("abort {}: {code}", self.title(named));
        }
        let sender = if request {
            Blocks::FromClient
        } else {
            Blocks::FromServer
        };
        if self.sdo.blocks == sender {
            let number = command & 0x7F;
            if command & 0x80 == 0 {
                return format!("block segment {number}");
            }
            self.sdo.blocks = Blocks::Complete {
                from_client: request,
                last: number,
            };
            return format!("block segment {number}, the last");
        }
        let segment = &message[1..8 - usize::from(command >> 1 & 7)];
        let last = command & 0x01 != 0;
        let expedited = command & 0x02 != 0;
        let size = (command & 0x01 != 0).then_some(word as usize);
        match (request, command >> 5) {
            (true, 0) | (false, 0) => {
                let toggle = command & 0x10 != 0;
                if toggle != self.sdo.toggle {
                    return format!("wrong toggle bit, segment {}", bytes(segment));
                }
                self.sdo.toggle = !toggle;
                if self.sdo.data.len() < KEPT {
                    self.sdo.data.extend_from_slice(segment);
                }
                if !last {
                    return format!("segment {}", bytes(segment));
                }
                let (address, data) = (self.sdo.address, core::mem::take(&mut self.sdo.data));
                let other = |told: &usize| *told != data.len() && data.len() < KEPT;
                let size = match self.sdo.told.filter(other) {
                    Some(told) => format!("{} bytes instead of {told}, ", data.len()),
                    None => String::new(),
                };
                let number = self.number(address, &data);
                if request {
                    self.sdo.pending = number;
                } else {
                    self.keep(number);
                }
                let value = self.value(address, &data);
                format!("last segment, {size}{} = {value}", self.title(address))
            }
            (true, 1) => {
                self.start(named);
                if expedited {
                    let data = self.expedited(named, command, data);
                    self.sdo.pending = self.number(named, data);
                    let value = self.value(named, data);
                    format!("write {} = {value}", self.title(named))
                } else {
                    self.sdo.told = size;
                    format!("write {}, {}", self.title(named), length(size))
                }
            }
            (true, 2) => {
                self.start(named);
                format!("read {}", self.title(named))
            }
            (true, 3) => "next segment".into(),
            (false, 1) => {
                self.keep_pending();
                "segment taken".into()
            }
            (false, 2) => {
                self.start(named);
                if expedited {
                    let data = self.expedited(named, command, data);
                    self.keep(self.number(named, data));
                    format!("{} = {}", self.title(named), self.value(named, data))
                } else {
                    self.sdo.told = size;
                    format!("{}, {}", self.title(named), length(size))
                }
            }
            (false, 3) => {
                self.keep_pending();
                format!("written {}", self.title(named))
            }
            (_, 5 | 6) => self.block(request, command, named, &message),
            _ => "unknown command".into(),
        }
    }

    /// The node has confirmed what was being written.
    fn keep_pending(&mut self) {
        let pending = self.sdo.pending.take();
        self.keep(pending);
    }

    fn start(&mut self, address: Address) {
        self.sdo = Transfer {
            address,
            ..Transfer::default()
        };
    }

    /// A message that governs a block transfer.
    fn block(&mut self, request: bool, command: u8, named: Address, message: &[u8; 8]) -> String {
        let word = u32::from_le_bytes([message[4], message[5], message[6], message[7]]);
        let length = length((command & 0x02 != 0).then_some(word as usize));
        match (request, command >> 5, command & 0x03) {
            (true, 5, 0) => {
                self.start(named);
                format!("read {} in blocks of {}", self.title(named), message[4])
            }
            (false, 6, 0 | 2) => format!("{}, {length} in blocks", self.title(named)),
            (true, 5, 3) => {
                self.sdo.blocks = Blocks::FromServer;
                "start".into()
            }
            (true, 6, 0 | 2) => {
                self.start(named);
                format!("write {}, {length} in blocks", self.title(named))
            }
            (false, 5, 0) => {
                self.sdo.blocks = Blocks::FromClient;
                format!("written {} in blocks of {}", self.title(named), message[4])
            }
            (_, 5, 2) => {
                match self.sdo.blocks {
                    Blocks::Complete { from_client, last } if last != message[1] => {
                        self.sdo.blocks = if from_client {
                            Blocks::FromClient
                        } else {
                            Blocks::FromServer
                        };
                    }
                    _ => {}
                }
                format!("{} segments taken", message[1])
            }
            (_, 6, 1) => "end of blocks".into(),
            (_, 5, 1) => {
                self.sdo.blocks = Blocks::None;
                "blocks taken".into()
            }
            _ => "unknown command".into(),
        }
    }
}

/// An object's number as a person reads it; a statusword with its state.
#[must_use]
pub fn value_text(address: Address, data_type: DataType, value: i64) -> String {
    match (address.index, data_type) {
        (0x6041, DataType::U16) => Statusword(value as u16).to_string(),
        (_, DataType::U16) => format!("{value} ({value:04X}h)"),
        (_, DataType::U32) => format!("{value} ({value:08X}h)"),
        (_, DataType::U64) => (value as u64).to_string(),
        _ => value.to_string(),
    }
}

fn emcy(emergency: &Emergency) -> String {
    let Emergency {
        code,
        register,
        vendor,
    } = emergency;
    format!(
        "EMCY {code:04X}h, register {register:02X}h, {}",
        bytes(vendor)
    )
}

/// Of a transfer that may say how many bytes there are to be.
fn length(told: Option<usize>) -> String {
    match told {
        Some(size) => format!("{size} bytes"),
        None => "some bytes".into(),
    }
}

fn bytes(data: &[u8]) -> String {
    let mut text = String::new();
    for (place, byte) in data.iter().enumerate() {
        let gap = if place == 0 { "" } else { " " };
        // Writing to a string does not fail.
        let _ = write!(text, "{gap}{byte:02X}");
    }
    text
}

/// The payload of a PDO whose objects are not known.
fn raw(frame: &Frame) -> String {
    if frame.is_remote() {
        " request".into()
    } else {
        format!(": {}", bytes(frame.data()))
    }
}
