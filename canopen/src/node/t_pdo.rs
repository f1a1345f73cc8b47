//! PDOs that the node transmits (1800h…19FFh, 1A00h…1BFFh).

use super::Application;
use super::communication::{MAX_MAPPED, mapping_of};
use crate::dictionary::{Dictionary, Row};
use crate::pdo::{CobIdWord, Packer, TransmissionType};
use crate::sync::Sync;
use crate::time::Duration;
use crate::{CanId, Frame, Instant, Transmit};

/// One T_PDO: its parameters, and when it is to be sent.
#[derive(Debug)]
pub(super) struct TPdo {
    pub(super) number: u16,
    id: Option<CanId>,
    allows_rtr: bool,
    kind: TransmissionType,
    inhibit_time: Duration,
    event_time: Duration,
    sync_start: u8,
    mapping: Vec<(Row, u8)>,
    /// The payload last sent, or sampled at SYNC for a remote request.
    last: Option<Packer>,
    /// An event waits for SYNC or for the inhibit time.
    event: bool,
    /// Before this it is inhibited.
    allowed: Option<Instant>,
    /// When the event timer runs out.
    timer: Option<Instant>,
    /// SYNCs since it was sent; `None` until the counter reaches the start value.
    syncs: Option<u8>,
}

impl TPdo {
    pub(super) fn new(number: u16) -> Self {
        Self {
            number,
            id: None,
            allows_rtr: false,
            kind: TransmissionType::EventProfile,
            inhibit_time: Duration::ZERO,
            event_time: Duration::ZERO,
            sync_start: 0,
            mapping: Vec::with_capacity(MAX_MAPPED),
            last: None,
            event: false,
            allowed: None,
            timer: None,
            syncs: None,
        }
    }

    /// Takes the parameters from the objects. `event_timer` is the object with the event timer of
    /// those that have none of their own.
    pub(super) fn load(&mut self, objects: &Dictionary, event_timer: Option<u16>) {
        let parameter = 0x1800 + self.number - 1;
        let value = |sub| objects.value(parameter, sub);
        let word = CobIdWord(value(1).unwrap_or(i64::from(CobIdWord::INVALID)) as u32);
        self.id = word.is_valid().then(|| word.can_id());
        self.allows_rtr = word.allows_rtr();
        self.kind = TransmissionType::from(value(2).unwrap_or(255) as u8);
        self.inhibit_time = Duration::from_micros(100) * value(3).unwrap_or(0) as u32;
        let common = || event_timer.and_then(|index| objects.value(index, 0));
        let event_time = value(5).or_else(common).unwrap_or(0);
        self.event_time = Duration::from_millis(event_time as u64);
        self.sync_start = value(6).unwrap_or(0) as u8;
        self.mapping.clear();
        let mapping = 0x1A00 + self.number - 1;
        let rows = mapping_of(objects, mapping)
            .filter_map(|mapped| Some((objects.find(mapped.address).ok()?, mapped.bits)));
        self.mapping.extend(rows);
        self.last = None;
    }

    pub(super) fn is_valid(&self) -> bool {
        self.id.is_some()
    }

    pub(super) fn has_id(&self, id: CanId) -> bool {
        self.id == Some(id)
    }

    /// Whether events count for it.
    pub(super) fn waits_for_events(&self) -> bool {
        self.is_valid()
            && (self.kind.is_event_driven() || self.kind == TransmissionType::SyncAcyclic)
    }

    /// Whether its event timer is the object that those have in common that have none of their own.
    pub(super) fn takes_common_timer(&self, objects: &Dictionary) -> bool {
        let own = objects.row(0x1800 + self.number - 1, 5);
        own.is_none() && self.kind.is_event_driven()
    }

    /// Operational begins, or the parameters have changed while it lasts: send at the first
    /// occasion.
    pub(super) fn start(&mut self, now: Instant) {
        self.last = None;
        self.event = true;
        self.allowed = None;
        self.syncs = (self.sync_start == 0).then_some(0);
        self.start_timer(now);
    }

    /// Operational is over.
    pub(super) fn stop(&mut self) {
        self.event = false;
        self.timer = None;
    }

    pub(super) fn deadline(&self) -> Option<Instant> {
        // An event timer that runs out meanwhile waits for the inhibit time as well.
        self.allowed.filter(|_| self.event).or(self.timer)
    }

    fn start_timer(&mut self, now: Instant) {
        let runs = self.is_valid() && self.kind.is_event_driven();
        self.timer = (runs && !self.event_time.is_zero()).then(|| now + self.event_time);
    }

    fn sample(&self, app: &impl Application) -> Packer {
        let mut payload = Packer::new();
        for &(row, bits) in &self.mapping {
            payload.push(app.objects().get(row), bits);
        }
        payload
    }

    fn send(&mut self, payload: Packer, tx: &mut (impl Transmit + ?Sized)) {
        if let Some(id) = self.id
            && !self.mapping.is_empty()
        {
            tx.transmit(Frame::new(id, &payload.bytes()[..payload.len()]));
        }
        self.last = Some(payload);
        self.event = false;
    }

    /// Whether an object that counts as an event has another value than when last sent, or is
    /// `changed` whatever its value.
    fn has_changed(&self, payload: Packer, changed: Option<Row>, app: &impl Application) -> bool {
        let Some(last) = self.last else {
            return true;
        };
        let differs = u64::from_le_bytes(payload.bytes()) ^ u64::from_le_bytes(last.bytes());
        if differs == 0 && changed.is_none() {
            return false;
        }
        let events = app.event_mask(self.number);
        let mut shift = 0;
        let mut objects = self.mapping.iter().enumerate();
        objects.any(|(place, &(row, bits))| {
            let object = differs.checked_shr(shift).unwrap_or(0);
            shift += u32::from(bits);
            let mask = u64::MAX >> (64 - u32::from(bits.clamp(1, 64)));
            events >> place & 1 != 0 && (object & mask != 0 || changed == Some(row))
        })
    }

    /// Sends it if its values have changed or its event timer has run out.
    pub(super) fn send_event(
        &mut self,
        now: Instant,
        changed: Option<Row>,
        app: &impl Application,
        tx: &mut (impl Transmit + ?Sized),
    ) {
        if !self.waits_for_events() {
            return;
        }
        let waits_for_sync = self.kind == TransmissionType::SyncAcyclic;
        let payload = self.sample(app);
        self.event |= self.has_changed(payload, changed, app);
        self.event |= self.timer.is_some_and(|timer| now >= timer);
        if waits_for_sync || !self.event || self.allowed.is_some_and(|allowed| now < allowed) {
            return;
        }
        self.send(payload, tx);
        self.allowed = (!self.inhibit_time.is_zero()).then(|| now + self.inhibit_time);
        self.start_timer(now);
    }

    /// Sends it if it is due at this SYNC, or samples it for a remote request.
    pub(super) fn on_sync(
        &mut self,
        sync: Sync,
        app: &impl Application,
        tx: &mut (impl Transmit + ?Sized),
    ) {
        if self.id.is_none() || !self.kind.is_synchronous() {
            return;
        }
        let payload = self.sample(app);
        match self.kind {
            TransmissionType::SyncRtr => self.last = Some(payload),
            TransmissionType::SyncAcyclic if self.event || self.has_changed(payload, None, app) => {
                self.send(payload, tx);
            }
            TransmissionType::SyncCyclic(every) => {
                // A producer without counter starts every T_PDO at once.
                if self.syncs.is_none() && sync.counter.is_none_or(|at| at == self.sync_start) {
                    self.syncs = Some(0);
                }
                if let Some(syncs) = &mut self.syncs {
                    *syncs += 1;
                    if *syncs >= every {
                        *syncs = 0;
                        self.send(payload, tx);
                    }
                }
            }
            _ => {}
        }
    }

    /// Answers a remote request if this PDO is what it asks for.
    pub(super) fn on_request(
        &mut self,
        frame: &Frame,
        app: &impl Application,
        tx: &mut (impl Transmit + ?Sized),
    ) {
        if self.id != Some(frame.id()) || !self.allows_rtr {
            return;
        }
        let payload = match (self.kind, self.last) {
            (TransmissionType::SyncRtr, Some(sampled)) => sampled,
            _ => self.sample(app),
        };
        self.send(payload, tx);
    }
}
