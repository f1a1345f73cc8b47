//! A whole CANopen slave over an object dictionary (CiA 301): NMT, SDO servers, PDOs, SYNC,
//! EMCY, heartbeat, guarding.
//!
//! Which services a [`Node`] has follows from the objects in its table: a row 1017h makes a
//! heartbeat producer, a row 1401h:1 a second R_PDO, a row 1201h:1 a second SDO server. What the
//! objects of the device itself mean is the [`Application`]'s affair. A [`Dictionary`] is the
//! simplest application, a node of passive values:
//!
//! ```
//! use syncline_canopen::dictionary::{DataType::*, Dictionary, Entry, ro, rw, table};
//! use syncline_canopen::node::{Node, Options};
//! use syncline_canopen::{Frame, Instant, NodeId};
//!
//! static TABLE: [Entry; 2] = table([
//!     ro(0x1000, 0, "Device type", U32),
//!     rw(0x1017, 0, "Producer heartbeat time", U16).default(100),
//! ]);
//!
//! let id = NodeId::new(5).ok_or("node")?;
//! let mut values = Dictionary::new(&TABLE, id);
//! let mut node = Node::new(id, &values, Options::default());
//! let mut sent: Vec<Frame> = Vec::new();
//! node.boot(Instant::ZERO, &mut values, &mut sent);
//! let heartbeat = node.deadline().ok_or("heartbeat")?;
//! node.poll(heartbeat, &mut values, &mut sent);
//! assert_eq!(format!("{sent:?}"), "[705#00, 705#7F]");
//! # Ok::<(), &str>(())
//! ```

mod communication;
mod r_pdo;
mod t_pdo;

use crate::dictionary::{Address, Dictionary, Row};
use crate::emcy::{self, Emergency};
use crate::nmt::{self, State};
use crate::sdo::{AbortCode, Objects, Server};
use crate::sync::Sync;
use crate::time::Duration;
use crate::{CanId, CobId, Frame, Instant, NodeId, Transmit};
use communication::Communication;

/// By which service a value comes to an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Origin {
    /// An SDO download.
    Sdo,
    /// The R_PDO with this number, 1…512.
    Pdo(u16),
}

/// A loss of communication that a node notices by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CommunicationError {
    /// A watched node's heartbeat is missing (1016h).
    Heartbeat(NodeId),
    /// The master's guarding requests are missing (100Ch, 100Dh).
    LifeGuarding,
    /// An R_PDO came with fewer bytes than are mapped into it; its number.
    ShortPdo(u16),
}

/// What a device does behind its CANopen interface.
///
/// The node calls these while it handles a frame or a point in time; each has a default that
/// makes the device a passive store of values.
pub trait Application {
    /// The device's values.
    fn objects(&self) -> &Dictionary;

    /// The device's values.
    fn objects_mut(&mut self) -> &mut Dictionary;

    /// Brings a value up to date before an SDO or a T_PDO reads it.
    fn refresh(&mut self, now: Instant, row: Row) {
        let _ = (now, row);
    }

    /// Asked before any object is written, those of the communication included, with a number
    /// that is writable and of the right length.
    ///
    /// # Errors
    /// Why the device refuses it in its present state.
    fn check_write(
        &mut self,
        now: Instant,
        row: Row,
        value: i64,
        origin: Origin,
    ) -> Result<(), AbortCode> {
        let _ = (now, row, value, origin);
        Ok(())
    }

    /// Takes a number that is writable, of the right length and within its range, and stores it.
    ///
    /// # Errors
    /// Why the device refuses it; a client of an SDO gets to know.
    fn write(
        &mut self,
        now: Instant,
        row: Row,
        value: i64,
        origin: Origin,
    ) -> Result<(), AbortCode> {
        let _ = (now, origin);
        self.objects_mut().set(row, value);
        Ok(())
    }

    /// Takes a string or a domain that is writable and not too long, and stores it.
    ///
    /// # Errors
    /// Why the device refuses it.
    fn write_bytes(&mut self, now: Instant, row: Row, bytes: &[u8]) -> Result<(), AbortCode> {
        let _ = now;
        self.objects_mut().set_bytes(row, bytes);
        Ok(())
    }

    /// SYNC has come: sample what T_PDOs carry. R_PDOs received before it follow in
    /// [`Self::write`].
    fn on_sync(&mut self, now: Instant, sync: Sync) {
        let _ = (now, sync);
    }

    /// An R_PDO has written all its objects.
    fn on_r_pdo(&mut self, now: Instant, number: u16) {
        let _ = (now, number);
    }

    /// NMT has changed the node's state; on a reset the values are already those after power-on.
    fn on_nmt(&mut self, now: Instant, event: nmt::Event) {
        let _ = (now, event);
    }

    /// Communication is lost. What is returned is sent as the node's emergency.
    fn on_communication_error(
        &mut self,
        now: Instant,
        error: CommunicationError,
    ) -> Option<Emergency> {
        let _ = now;
        let (code, pdo) = match error {
            CommunicationError::ShortPdo(number) => (emcy::code::PDO_TOO_SHORT, number as u8),
            _ => (emcy::code::LIFE_GUARD_OR_HEARTBEAT, 0),
        };
        Some(Emergency {
            code,
            register: emcy::register::GENERIC | emcy::register::COMMUNICATION,
            vendor: [0, 0, pdo, 0, 0],
        })
    }

    /// An emergency that the device wants sent; asked for until there is none.
    fn next_emergency(&mut self) -> Option<Emergency> {
        None
    }

    /// What 1003h keeps of an emergency besides its code, in bits 16…31.
    fn error_field_info(&self, emergency: &Emergency) -> u16 {
        let _ = emergency;
        0
    }

    /// Whether something has happened to an object that sends the T_PDOs it is mapped into, even
    /// if its value is the same as before.
    fn happened(&self, row: Row) -> bool {
        let _ = row;
        false
    }

    /// Which mapped objects of T_PDO `number` send it by a change of their value: bit k is the
    /// (k+1)-th object.
    fn event_mask(&self, number: u16) -> u64 {
        let _ = number;
        u64::MAX
    }
}

/// A device without any function of its own.
impl Application for Dictionary {
    fn objects(&self) -> &Dictionary {
        self
    }

    fn objects_mut(&mut self) -> &mut Dictionary {
        self
    }
}

/// How strictly PDO, SYNC and EMCY parameters may be changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterRules {
    /// CiA 301: identifier, inhibit time and mapping only while the PDO is switched off, no
    /// restricted identifier.
    Standard,
    /// At any time; the other bits of a COB-ID word keep their value without complaint.
    Lenient {
        /// The bits that a client may change in the COB-ID word of a PDO or an SDO server.
        pdo: u32,
        /// The bits that a client may change in 1005h and 1014h.
        sync_and_emcy: u32,
    },
}

/// What a node's table does not say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// How strictly PDO, SYNC and EMCY parameters may be changed.
    pub parameters: ParameterRules,
    /// Whether R_PDOs may have gaps, mapped as data types 0001h…0007h.
    pub dummy_mapping: bool,
    /// Whether the SDO servers know block transfer.
    pub block_transfer: bool,
    /// After what silence of its client an SDO server gives a transfer up.
    pub sdo_timeout: Option<Duration>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            parameters: ParameterRules::Standard,
            dummy_mapping: true,
            block_transfer: true,
            sdo_timeout: Some(Duration::from_secs(5)),
        }
    }
}

/// A CANopen slave without its application, which is handed to every call.
#[derive(Debug)]
pub struct Node {
    servers: Vec<(Channel, Server)>,
    communication: Communication,
}

/// Where an SDO server's identifiers come from.
#[derive(Clone, Copy, Debug)]
enum Channel {
    /// 600h/580h + id.
    Default,
    /// Rows 1 and 2 of 1200h ff.
    Rows(Row, Row),
}

impl Node {
    /// A node before its boot-up, with the services that the table of `objects` gives it.
    #[must_use]
    pub fn new(id: NodeId, objects: &Dictionary, options: Options) -> Self {
        let capacity = objects
            .entries()
            .iter()
            .map(|entry| entry.data_type.size())
            .max()
            .unwrap_or(0);
        let server = || {
            let server = Server::new(CobId::r_sdo(id), CobId::t_sdo(id), capacity);
            let server = match options.sdo_timeout {
                Some(timeout) => server.with_timeout(timeout),
                None => server,
            };
            if options.block_transfer {
                server
            } else {
                server.without_block_transfer()
            }
        };
        let mut servers = vec![(Channel::Default, server())];
        for index in 0x1201..=0x127F {
            if let (Some(request), Some(response)) = (objects.row(index, 1), objects.row(index, 2))
            {
                servers.push((Channel::Rows(request, response), server()));
            }
        }
        Self {
            servers,
            communication: Communication::new(id, objects, options),
        }
    }

    /// The node's id.
    #[must_use]
    pub const fn id(&self) -> NodeId {
        self.communication.nmt.node()
    }

    /// The node's NMT state.
    #[must_use]
    pub const fn state(&self) -> State {
        self.communication.nmt.state()
    }

    /// When [`Self::poll`] wants to be called at the latest.
    #[must_use]
    pub fn deadline(&self) -> Option<Instant> {
        let servers = self
            .servers
            .iter()
            .filter_map(|(_, server)| server.deadline());
        servers.chain(self.communication.deadline()).min()
    }

    /// Power-on: values as stored or by default, boot-up message, Pre-Operational.
    pub fn boot(
        &mut self,
        now: Instant,
        app: &mut impl Application,
        tx: &mut (impl Transmit + ?Sized),
    ) {
        self.reset(now, nmt::Event::ResetNode, app, tx);
    }

    fn reset(
        &mut self,
        now: Instant,
        event: nmt::Event,
        app: &mut impl Application,
        tx: &mut (impl Transmit + ?Sized),
    ) {
        app.objects_mut().restore(|entry| {
            event == nmt::Event::ResetNode || (0x1000..0x2000).contains(&entry.address.index)
        });
        app.on_nmt(now, event);
        self.communication.load(now, app.objects());
        self.servers
            .iter_mut()
            .for_each(|(_, server)| server.reset());
        self.load_servers(app.objects());
        self.communication.nmt.boot(tx);
        self.settle(now, app, tx);
    }

    /// Takes a frame from the bus, whoever it is for.
    pub fn on_frame(
        &mut self,
        now: Instant,
        frame: &Frame,
        app: &mut impl Application,
        tx: &mut (impl Transmit + ?Sized),
    ) {
        let state = self.state();
        if state == State::Initialising {
            return;
        }
        if state.communicates() {
            let mut access = Access {
                now,
                communication: &mut self.communication,
                app,
            };
            for (_, server) in &mut self.servers {
                if server.on_frame(now, frame, &mut access, tx) {
                    if self.communication.servers_changed {
                        self.load_servers(app.objects());
                    }
                    return self.settle(now, app, tx);
                }
            }
        }
        if frame.id() == CanId::from(CobId::NMT) {
            match self.communication.nmt.on_frame(frame) {
                Some(nmt::Event::Entered(to)) => self.communication.enter(now, state, to, app),
                Some(event) => return self.reset(now, event, app, tx),
                None => {}
            }
            if !self.state().communicates() {
                self.servers
                    .iter_mut()
                    .for_each(|(_, server)| server.reset());
            }
        } else {
            self.communication.on_frame(now, frame, app, tx);
        }
        self.settle(now, app, tx);
    }

    /// Does what is due: heartbeat, missing heartbeats and requests, event timers, time-outs;
    /// and sends the T_PDOs whose values the application has changed meanwhile.
    pub fn poll(
        &mut self,
        now: Instant,
        app: &mut impl Application,
        tx: &mut (impl Transmit + ?Sized),
    ) {
        if self.state() == State::Initialising {
            return;
        }
        for (_, server) in &mut self.servers {
            server.poll(now, tx);
        }
        self.communication.poll(now, app, tx);
        self.settle(now, app, tx);
    }

    /// Sends what the application wants said after a frame or a point in time.
    fn settle(
        &mut self,
        now: Instant,
        app: &mut impl Application,
        tx: &mut (impl Transmit + ?Sized),
    ) {
        while let Some(emergency) = app.next_emergency() {
            self.communication.emergency(now, emergency, app, tx);
        }
        self.communication.send_events(now, app, tx);
    }

    /// Loads the identifiers of 1201h ff.
    fn load_servers(&mut self, objects: &Dictionary) {
        self.communication.servers_changed = false;
        for (channel, server) in &mut self.servers {
            match *channel {
                Channel::Default => {}
                Channel::Rows(request, response) => {
                    let cob_id = |row| communication::valid_cob_id(objects.get(row));
                    server.set_channel(cob_id(request).zip(cob_id(response)));
                }
            }
        }
    }
}

/// A node's objects as an SDO server reaches them.
struct Access<'a, A> {
    now: Instant,
    communication: &'a mut Communication,
    app: &'a mut A,
}

impl<A: Application> Objects for Access<'_, A> {
    fn upload(&mut self, address: Address, buffer: &mut [u8]) -> Result<usize, AbortCode> {
        let row = self.app.objects().find(address)?;
        if !self.app.objects().entry(row).access.readable() {
            return Err(AbortCode::WriteOnly);
        }
        self.app.refresh(self.now, row);
        self.app.objects().encode(row, buffer)
    }

    fn begin_download(
        &mut self,
        address: Address,
        size: Option<usize>,
    ) -> Result<usize, AbortCode> {
        let objects = self.app.objects();
        objects.check_download(objects.find(address)?, size)
    }

    fn download(&mut self, address: Address, data: &[u8]) -> Result<(), AbortCode> {
        let objects = self.app.objects();
        let row = objects.find(address)?;
        objects.check_download(row, Some(data.len()))?;
        if !objects.entry(row).data_type.is_number() {
            return self.app.write_bytes(self.now, row, data);
        }
        let value = objects.number(row, data)?;
        self.app.check_write(self.now, row, value, Origin::Sdo)?;
        self.communication.write(self.now, row, value, self.app)
    }
}
