//! What every CANopen device of a machine has, whatever it does.

use super::profile::communication::{self, SDO_RESPONSE, T_PDO_RESPONSE};
use super::{Address, Assumption, Mapping, Model, Settings, Write};
use core::{fmt, time::Duration};
use syncline_canopen::NodeId;
use syncline_canopen::budget::{Events, NodeTraffic, Pdo};

/// A device on a bus as the controller knows it.
///
/// A PDO of the device is named by its place in [`NodeSpec::t_pdos`] or [`NodeSpec::r_pdos`].
pub trait RemoteNode: fmt::Debug + Send + Sync {
    /// What does not change as long as the machine is on.
    fn spec(&self) -> &NodeSpec;

    /// What the five bytes that its maker adds to an EMCY say, for a message: `vendor error
    /// B404h: SYNC signal missing`. `None` if the maker says nothing by them.
    fn vendor_error(&self, _: [u8; 5]) -> Option<String> {
        None
    }

    /// Its PDOs that carry what their maker may have mapped; none of a device that is not by its profile alone.
    fn mapped(&self) -> Vec<&Mapping> {
        Vec::new()
    }
}

/// What tells a device from another of its model, as far as there is anything.
pub type Marks<T> = [Option<T>; 2];

/// Who a device is, how it is set up, and what it sends and takes in every cycle.
#[derive(Clone, Debug)]
pub struct NodeSpec {
    /// Its kind.
    pub model: &'static Model,
    /// Its node id.
    pub node: NodeId,
    /// The objects that tell this device from another, in the order to read them.
    pub identity: Vec<Identity>,
    /// The objects that tell this very device, with the motor and the encoder that count for it, from another of its
    /// model: read where a reference is kept from one day to the next. What a device does not have says nothing.
    pub marks: Marks<Address>,
    /// The objects to log before a reset, which would wipe them: what stopped the device last.
    pub history: Vec<Address>,
    /// What the device has to be set to before the set-up, in this order, each written only where it
    /// reads otherwise: writing it has a price.
    pub ensured: Vec<Write>,
    /// The set-up writes, in order, to a device in NMT Pre-Operational after a reset of its
    /// communication. They reset an error that is left from before, too.
    pub setup: Vec<Write>,
    /// The objects to read back after the set-up, with the value that each must have. One that
    /// refuses to be read is worth a log line, no more.
    pub read_back: Vec<Write>,
    /// Whether a message at 700h + id says that it has booted; otherwise it shows in its answering
    /// SDO requests.
    pub tells_boot_up: bool,
    /// By what the device shows that it is there and Operational.
    pub monitoring: Monitoring,
    /// How to tell that the device's clock follows SYNC, if it has one that does.
    pub clock_lock: Option<ClockLock>,
    /// Longest time between an edge of a capture input and the instant whose position is kept.
    pub capture_jitter: Duration,
    /// The writes that take the set-up's cyclic part back, after the device is disabled.
    pub release: Vec<Write>,
    /// The PDOs that the device sends.
    pub t_pdos: Vec<Pdo>,
    /// It sends them in answer to every [`sync_divider`](Self::sync_divider)th SYNC; otherwise when what they tell changes, as
    /// often as [`events`](Self::events) says, and when it becomes Operational.
    pub answers_sync: bool,
    /// How often each of them may come in a cycle where it answers no SYNC.
    pub events: Events,
    /// Which SYNCs it answers: each one if 1, every second one if 2. The device counts them.
    pub sync_divider: u32,
    /// The PDOs that the controller sends to the device in every cycle.
    pub r_pdos: Vec<Pdo>,
    /// What they bring takes effect at the next SYNC; otherwise as it arrives.
    pub latches_at_sync: bool,
    /// Longest time from the end of SYNC until the T_PDOs stand in the device's transmit queue.
    pub t_pdo_response: Duration,
    /// Longest time from the end of an SDO request until its answer stands in the device's
    /// transmit queue.
    pub sdo_response: Duration,
}

impl NodeSpec {
    /// A device with this set-up, which is read back but for those writes that are commands, not
    /// settings. Its times are the assumptions [`T_PDO_RESPONSE`] and [`SDO_RESPONSE`] as its model has
    /// them; it has nothing else yet.
    pub(super) fn new(
        model: &'static Model,
        settings: &Settings,
        setup: Vec<Write>,
        is_command: fn(&Write) -> bool,
    ) -> Self {
        let time = |common: &Assumption| {
            let own = model.assumption(common.name);
            settings.assumed.time(own.unwrap_or(common))
        };
        Self {
            model,
            node: settings.node,
            identity: Vec::new(),
            marks: [None; 2],
            history: Vec::new(),
            ensured: Vec::new(),
            read_back: communication::read_back(&setup, is_command),
            setup,
            tells_boot_up: true,
            monitoring: Monitoring::Heartbeat,
            clock_lock: None,
            capture_jitter: Duration::ZERO,
            release: Vec::new(),
            t_pdos: Vec::new(),
            answers_sync: true,
            events: Events {
                any_time: 1,
                behind_r_pdo: 0,
            },
            sync_divider: 1,
            r_pdos: Vec::new(),
            latches_at_sync: true,
            t_pdo_response: time(&T_PDO_RESPONSE),
            sdo_response: time(&SDO_RESPONSE),
        }
    }

    /// Whether what was read is what `written` set, in the bits that a device has to keep.
    #[must_use]
    pub fn agrees(&self, written: &Write, read: &[u8]) -> bool {
        communication::agrees(written, read)
    }

    /// What the device adds to a cycle of its bus.
    #[must_use]
    pub fn traffic(&self) -> NodeTraffic {
        NodeTraffic {
            node: self.node,
            divider: self.sync_divider,
            response: self.t_pdo_response,
            pdos: [&self.t_pdos[..], &self.r_pdos[..]].concat(),
            events: (!self.answers_sync).then_some(self.events),
        }
    }
}

/// An object that must read as stated, or this is another device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identity {
    /// Where it stands.
    pub address: Address,
    /// Its name.
    pub name: &'static str,
    /// The bits that count.
    pub mask: u32,
    /// Their value.
    pub value: u32,
    /// What to do where a device of this model does not have the object, if that can be.
    pub if_absent: Option<&'static str>,
}

impl Identity {
    /// An object all of whose bits count.
    pub(super) const fn new(index: u16, sub: u8, name: &'static str, value: u32) -> Self {
        Self {
            address: Address::new(index, sub),
            name,
            mask: u32::MAX,
            value,
            if_absent: None,
        }
    }

    /// The same of an object that a device of this model need not have, and what to do then.
    pub(super) const fn if_absent(self, remedy: &'static str) -> Self {
        Self {
            if_absent: Some(remedy),
            ..self
        }
    }

    /// The same where these bits alone count.
    pub(super) const fn in_bits(self, mask: u32) -> Self {
        Self { mask, ..self }
    }
}

/// By what a device shows that it is there and Operational.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Monitoring {
    /// Its heartbeat, which carries its NMT state.
    Heartbeat,
    /// Its answers to guarding, remote requests that it is sent so often: they carry its NMT state, and without the
    /// requests it notices that the controller is gone.
    Guarding {
        /// From one request to the next.
        every: Duration,
    },
    /// Its T_PDOs alone, which it sends in Operational only. Such a device notices nothing when the controller dies.
    TPdos,
    /// Its answers to SDO requests for its position, 32 bits signed, that are sent all the time. Such a
    /// device notices nothing when the controller dies.
    Poll(Address),
}

impl Monitoring {
    /// Whether the device notices by it that the controller is gone.
    #[must_use]
    pub const fn is_mutual(self) -> bool {
        matches!(self, Self::Heartbeat | Self::Guarding { .. })
    }
}

/// An object to poll after SYNC has started, until the device's clock follows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClockLock {
    /// Where the status stands.
    pub address: Address,
    /// What it reads once the device's clock follows SYNC.
    pub locked: u32,
    /// By how much a SYNC may be late for the clock to follow it.
    pub tolerance: Duration,
    /// The name of the [`Assumption`](super::Assumption) that says so.
    pub assumption: &'static str,
}
