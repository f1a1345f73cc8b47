//! A whole CANopen slave over an object dictionary (CiA 301): NMT, SDO servers, PDOs, SYNC,
//! EMCY, heartbeat, guarding.
//!
//! Which services a [`LocalNode`] has follows from the objects in its table: a row 1017h makes a
//! heartbeat producer, a row 1401h:1 a second R_PDO, a row 1201h:1 a second SDO server. What the
//! objects of the device itself mean is the [`Application`]'s affair. A [`Dictionary`] is the
//! simplest application, a node of passive values:
//!
//! ```
//! use syncline_canopen::dictionary::{DataType::*, Dictionary, Entry, ro, rw, table};
//! use syncline_canopen::node::{LocalNode, Options};
//! use syncline_canopen::{Frame, Instant, NodeId};
//!
//! static TABLE: [Entry; 2] = table([
//!     ro(0x1000, 0, "Device type", U32),
//!     rw(0x1017, 0, "Producer heartbeat time", U16).default(100),
//! ]);
//!
//! let id = NodeId::new(5).ok_or("node")?;
//! let mut values = Dictionary::new(&TABLE, id);
//! let mut node = LocalNode::new(id, &values, Options::default());
//! let mut sent: Vec<Frame> = Vec::new();
//! node.power_on(Instant::ZERO);
//! for _ in 0..2 {
//!     let due = node.deadline().ok_or("boot-up, heartbeat")?;
//!     node.poll(due, &mut values, &mut sent);
//! }
//! assert_eq!(format!("{sent:?}"), "[705#00, 705#7F]");
//! # Ok::<(), &str>(())
//! ```

mod communication;
mod r_pdo;
mod t_pdo;

use crate::dictionary::{Address, Dictionary, Entry, Row};
use crate::emcy::{self, Emergency};
use crate::nmt::{self, State};
use crate::sdo::{AbortCode, Objects, Server};
use crate::sync::Sync;
use crate::time::Duration;
use crate::{CanId, CobId, Frame, Instant, NodeId, Transmit};
use communication::Communication;
pub(crate) use communication::mapping_of;

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

    /// Brings the values up to date before SDOs or T_PDOs read them: that of one row, or all.
    fn refresh(&mut self, now: Instant, row: Option<Row>) {
        let _ = (now, row);
    }

    /// The node id from now on: asked at power-on and at Reset Node, with the objects as they were
    /// stored. `None` leaves it as it is.
    fn node_id(&self) -> Option<NodeId> {
        None
    }

    /// Asked before an object is read by SDO.
    ///
    /// # Errors
    /// Why the device refuses it; the client gets to know.
    fn check_read(&self, row: Row) -> Result<(), AbortCode> {
        let _ = row;
        Ok(())
    }

    /// Asked before an object is written, with a number of the right length and in its range.
    ///
    /// # Errors
    /// Why the device refuses it in its present state; a client of an SDO gets to know.
    fn check_write(&self, row: Row, value: i64, origin: Origin) -> Result<(), AbortCode> {
        let _ = (row, value, origin);
        Ok(())
    }

    /// An object has been written: let it take effect. Of an R_PDO all objects have their values
    /// before this is called for the first of them.
    fn written(&mut self, now: Instant, row: Row, origin: Origin) {
        let _ = (now, row, origin);
    }

    /// SYNC has come, T_PDOs have been sampled and R_PDOs that waited for it written.
    fn on_sync(&mut self, now: Instant, sync: Sync) {
        let _ = (now, sync);
    }

    /// An NMT command changes the node's state.
    fn on_nmt(&mut self, now: Instant, event: nmt::Event) {
        let _ = (now, event);
    }

    /// Power-on or a reset has given the objects their values; the boot-up message comes next.
    fn on_reset(&mut self, now: Instant, reset: nmt::Event) {
        let _ = (now, reset);
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

    /// The NMT state that a loss of communication leads to from this one: by default what 1029h:1
    /// says, and Pre-Operational from Operational where the table lacks it.
    fn state_after_loss(&self, state: State) -> State {
        match self.objects().value(0x1029, 1).unwrap_or(0) {
            0 if state == State::Operational => State::PreOperational,
            2 => State::Stopped,
            _ => state,
        }
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

    /// An object that counts as changed although its value may be the same as before.
    fn next_event(&mut self) -> Option<Row> {
        None
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

/// How strictly the parameters of PDOs, SYNC, EMCY, guarding and SDO servers may be changed. An identifier
/// that CiA 301 restricts is never taken into use, but for guarding, whose own it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterRules {
    /// CiA 301: identifier, inhibit time and mapping only while the PDO is switched off.
    Standard,
    /// At any time; the other bits of a COB-ID word keep their value without complaint.
    Lenient {
        /// The bits that a client may change in the COB-ID word of a PDO or an SDO server.
        pdo: u32,
        /// The bits that a client may change in 1005h, 100Eh and 1014h.
        sync_and_emcy: u32,
    },
}

/// How a node tells that its initialisation is over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BootUp {
    /// By one byte 0 on 700h + id (CiA 301 V4).
    Message,
    /// By an emergency without data (DS 301 V3).
    EmptyEmergency,
    /// Not at all.
    Silent,
}

/// When a node finds that its master's guarding requests are missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LifeGuarding {
    /// When the life time has passed.
    AtExpiry,
    /// When a request comes that is later than the life time; the answer tells the new state.
    AtLateRequest,
}

/// What a node's table does not say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// How strictly parameters of the communication may be changed.
    pub parameters: ParameterRules,
    /// Whether R_PDOs may have gaps, mapped as data types 0001h…0007h.
    pub dummy_mapping: bool,
    /// Whether the SDO servers know block transfer.
    pub block_transfer: bool,
    /// After what silence of its client an SDO server gives a transfer up.
    pub sdo_timeout: Option<Duration>,
    /// Whether an SDO server's confirmation of an expedited download repeats its data.
    pub sdo_echo: bool,
    /// Time from an NMT reset to the boot-up message.
    pub boot_time: Duration,
    /// How the node tells that its initialisation is over.
    pub boot_up: BootUp,
    /// When the node finds that guarding requests are missing.
    pub life_guarding: LifeGuarding,
    /// Whether the identifiers of SYNC, guarding and EMCY (1005h, 100Eh, 1014h) change at the next
    /// reset only.
    pub identifiers_at_reset: bool,
    /// Whether the node takes SYNC only while bit 31 of 1005h is set (DS 301 V3).
    pub sync_by_bit_31: bool,
    /// Whether what an R_PDO of type 1 to 240 brings waits for as many SYNCs as its type, the one that is due included; by
    /// CiA 301 it takes effect at the next one.
    pub r_pdos_count_syncs: bool,
    /// What 1006h counts.
    pub cycle_period_unit: Duration,
    /// The object whose milliseconds are the event timer of those T_PDOs that have none of their
    /// own (6200h of CiA 406).
    pub event_timer: Option<u16>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            parameters: ParameterRules::Standard,
            dummy_mapping: true,
            block_transfer: true,
            sdo_timeout: Some(Duration::from_secs(5)),
            sdo_echo: false,
            boot_time: Duration::ZERO,
            boot_up: BootUp::Message,
            life_guarding: LifeGuarding::AtExpiry,
            identifiers_at_reset: false,
            sync_by_bit_31: false,
            r_pdos_count_syncs: false,
            cycle_period_unit: Duration::from_micros(1),
            event_timer: None,
        }
    }
}

/// A CANopen slave without its application, which is handed to every call.
#[derive(Debug)]
pub struct LocalNode {
    servers: Vec<(Channel, Server)>,
    communication: Communication,
    boot_time: Duration,
    /// When the present reset ends, and which one it is.
    booting: Option<(Instant, nmt::Event)>,
}

/// Where an SDO server's identifiers come from.
#[derive(Clone, Copy, Debug)]
enum Channel {
    /// 600h/580h + id.
    Default,
    /// Rows 1 and 2 of 1200h ff.
    Rows(Row, Row),
}

impl LocalNode {
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
            let server = match options.block_transfer {
                true => server,
                false => server.without_block_transfer(),
            };
            match options.sdo_echo {
                true => server.with_echo(),
                false => server,
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
            boot_time: options.boot_time,
            booting: None,
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

    /// Which of the node's T_PDOs has this identifier; its number, 1…512.
    #[must_use]
    pub fn t_pdo(&self, id: CanId) -> Option<u16> {
        self.communication.t_pdo(id)
    }

    /// Whether one of the node's SDO servers answers on this identifier.
    #[must_use]
    pub fn is_sdo_answer(&self, id: CanId) -> bool {
        let mut servers = self.servers.iter();
        servers.any(|(_, server)| server.answers_on(id))
    }

    /// When [`Self::poll`] wants to be called at the latest.
    #[must_use]
    pub fn deadline(&self) -> Option<Instant> {
        if self.state() == State::Initialising {
            return self.booting.map(|(at, _)| at);
        }
        let servers = self.servers.iter();
        let servers = servers.filter_map(|(_, server)| server.deadline());
        servers.chain(self.communication.deadline()).min()
    }

    /// Power-on: at `at` the objects get their values as stored or by default, the boot-up
    /// message goes out, and the node is Pre-Operational.
    pub fn power_on(&mut self, at: Instant) {
        self.communication.nmt = nmt::Slave::new(self.id());
        self.booting = Some((at, nmt::Event::ResetNode));
    }

    fn end_reset(
        &mut self,
        now: Instant,
        app: &mut impl Application,
        tx: &mut (impl Transmit + ?Sized),
    ) {
        let Some((_, reset)) = self.booting.take_if(|(at, _)| now >= *at) else {
            return;
        };
        let resets = |entry: &Entry| {
            reset == nmt::Event::ResetNode || (0x1000..0x2000).contains(&entry.address.index)
        };
        app.objects_mut().restore(resets);
        if let Some(id) = app.node_id().filter(|_| reset == nmt::Event::ResetNode) {
            self.move_to(id);
            app.objects_mut().move_to(id);
            app.objects_mut().restore(resets);
        }
        app.on_reset(now, reset);
        self.communication.load(now, app.objects());
        self.reset_servers();
        self.load_servers(app.objects());
        self.communication.boot(tx);
        self.settle(now, app, tx);
    }

    /// Takes a frame from the bus, whoever it is for. Returns whether it did anything: while it did not, nothing is to be sent,
    /// and [`Self::deadline`] stays.
    pub fn on_frame(
        &mut self,
        now: Instant,
        frame: &Frame,
        app: &mut impl Application,
        tx: &mut (impl Transmit + ?Sized),
    ) -> bool {
        let state = self.state();
        if state == State::Initialising {
            return false;
        }
        // Most of what is on a bus is for others.
        if !self.concerns(frame) {
            return self.settle(now, app, tx);
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
                    self.settle(now, app, tx);
                    return true;
                }
            }
        }
        if frame.id() == CanId::from(CobId::NMT) {
            match self.communication.nmt.on_frame(frame) {
                Some(nmt::Event::Entered(to)) => self.communication.enter(now, state, to, app),
                Some(reset) => {
                    app.on_nmt(now, reset);
                    self.booting = Some((now + self.boot_time, reset));
                    self.end_reset(now, app, tx);
                    return true;
                }
                None => {}
            }
        } else {
            self.communication.on_frame(now, frame, app, tx);
        }
        self.settle(now, app, tx);
        true
    }

    /// Whether a frame may be for this node.
    fn concerns(&self, frame: &Frame) -> bool {
        let id = frame.id();
        let mut servers = self.servers.iter();
        id == CanId::from(CobId::NMT)
            || servers.any(|(_, server)| server.is_request(id))
            || self.communication.concerns(frame)
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
            return self.end_reset(now, app, tx);
        }
        for (_, server) in &mut self.servers {
            server.poll(now, tx);
        }
        self.communication.poll(now, app, tx);
        self.settle(now, app, tx);
    }

    /// Sends what the application wants said after a frame or a point in time. Returns whether there may have been something.
    fn settle(
        &mut self,
        now: Instant,
        app: &mut impl Application,
        tx: &mut (impl Transmit + ?Sized),
    ) -> bool {
        let mut says = false;
        if self.state().communicates() {
            while let Some(emergency) = app.next_emergency() {
                self.communication.emergency(now, emergency, app, tx);
                says = true;
            }
        } else {
            self.reset_servers();
        }
        self.communication.send_events(now, app, tx) || says
    }

    /// The node has another id from now on.
    fn move_to(&mut self, id: NodeId) {
        self.communication.nmt = nmt::Slave::new(id);
        for (channel, server) in &mut self.servers {
            if let Channel::Default = channel {
                server.set_channel(Some((CobId::r_sdo(id), CobId::t_sdo(id))));
            }
        }
    }

    /// Transfers under way end without a word.
    fn reset_servers(&mut self) {
        self.servers
            .iter_mut()
            .for_each(|(_, server)| server.reset());
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
        self.app.check_read(row)?;
        self.app.refresh(self.now, Some(row));
        self.app.objects().encode(row, buffer)
    }

    fn begin_download(
        &mut self,
        address: Address,
        size: Option<usize>,
    ) -> Result<usize, AbortCode> {
        self.app.objects_mut().begin_download(address, size)
    }

    fn download(&mut self, address: Address, data: &[u8]) -> Result<(), AbortCode> {
        let objects = self.app.objects();
        let row = objects.find(address)?;
        objects.check_download(row, Some(data.len()))?;
        if objects.entry(row).data_type.is_number() {
            let value = objects.number(row, data)?;
            self.communication.write(self.now, row, value, self.app)
        } else {
            self.app.objects_mut().set_bytes(row, data);
            self.app.written(self.now, row, Origin::Sdo);
            Ok(())
        }
    }
}
