//! The communication objects 1000h…1FFFh at work: each handler is named by the object it serves.

use super::r_pdo::{RPdo, Reception};
use super::t_pdo::TPdo;
use super::{
    Application, BootUp, CommunicationError, LifeGuarding, Options, Origin, ParameterRules,
};
use crate::dictionary::{Address, DataType, Dictionary, Row};
use crate::emcy::{self, Emergency};
use crate::guarding;
use crate::heartbeat;
use crate::nmt::{self, Event, State};
use crate::pdo::{CobIdWord, Mapped, TransmissionType};
use crate::sdo::AbortCode;
use crate::sync::{self, Sync};
use crate::time::Duration;
use crate::{CanId, CobId, Frame, Instant, NodeId, Transmit};

/// Objects in one PDO at most (CiA 301).
pub(super) const MAX_MAPPED: usize = 64;

/// "save", which 1010h wants to be written.
const SAVE: i64 = 0x6576_6173;
/// "load", which 1011h wants to be written.
const LOAD: i64 = 0x6461_6F6C;

/// A node's services but SDO.
#[derive(Debug)]
pub(super) struct Communication {
    options: Options,
    pub(super) nmt: nmt::Slave,
    heartbeat: heartbeat::Producer,
    /// By the subindices of 1016h.
    watched: Vec<Option<heartbeat::Consumer>>,
    guarding: guarding::Slave,
    emcy: emcy::Producer,
    emcy_id: Option<CobId>,
    /// Of heartbeat and guarding.
    error_control: CobId,
    /// 1005h, as far as it is in effect.
    sync_word: Option<CobIdWord>,
    sync_id: Option<CobId>,
    sync: Option<sync::Producer>,
    r_pdos: Vec<RPdo>,
    t_pdos: Vec<TPdo>,
    /// 1201h ff. have been written.
    pub(super) servers_changed: bool,
}

/// The 11-bit identifier in a COB-ID word, if the word says that it is in use.
pub(super) fn valid_cob_id(word: i64) -> Option<CobId> {
    let word = CobIdWord(word as u32);
    word.cob_id().filter(|_| word.is_valid())
}

/// What 1600h ff. or 1A00h ff. map.
pub(crate) fn mapping_of(objects: &Dictionary, index: u16) -> impl Iterator<Item = Mapped> {
    let count = objects
        .value(index, 0)
        .unwrap_or(0)
        .clamp(0, MAX_MAPPED as i64) as u8;
    (1..=count).filter_map(move |sub| Some(Mapped::from(objects.value(index, sub)? as u32)))
}

impl Communication {
    pub(super) fn new(id: NodeId, objects: &Dictionary, options: Options) -> Self {
        let numbers = |from: u16| {
            (0..0x200).filter_map(move |place| objects.row(from + place, 1).map(|_| place + 1))
        };
        Self {
            options,
            nmt: nmt::Slave::new(id),
            heartbeat: heartbeat::Producer::new(),
            watched: vec![None; watches(objects).count()],
            guarding: guarding::Slave::new(),
            emcy: emcy::Producer::new(),
            emcy_id: None,
            error_control: CobId::error_control(id),
            sync_word: None,
            sync_id: None,
            sync: None,
            r_pdos: numbers(0x1400).map(RPdo::new).collect(),
            t_pdos: numbers(0x1800).map(TPdo::new).collect(),
            servers_changed: false,
        }
    }

    /// Takes every parameter from the objects, as after a reset.
    pub(super) fn load(&mut self, now: Instant, objects: &Dictionary) {
        self.load_1005_sync(now, objects);
        self.guarding = guarding::Slave::new();
        self.load_100c_guarding(objects);
        self.load_100e_error_control(objects);
        self.load_1014_emcy(objects);
        self.load_1015_inhibit(objects);
        self.emcy.reset();
        self.watched.fill(None);
        self.load_1016_watched(objects);
        // The boot-up message stands for the first heartbeat.
        self.load_1017_heartbeat(now + heartbeat_period(objects), objects);
        self.r_pdos.iter_mut().for_each(|pdo| pdo.load(objects));
        for pdo in &mut self.t_pdos {
            pdo.load(objects, self.options.event_timer);
            pdo.stop();
        }
    }

    /// Ends the initialisation.
    pub(super) fn boot(&mut self, tx: &mut (impl Transmit + ?Sized)) {
        match (self.options.boot_up, self.emcy_id) {
            (BootUp::Message, _) => {
                tx.transmit(heartbeat::encode(self.nmt.node(), State::Initialising));
            }
            (BootUp::EmptyEmergency, Some(id)) => tx.transmit(Frame::new(id, &[])),
            (BootUp::EmptyEmergency, None) | (BootUp::Silent, _) => {}
        }
        self.nmt.enter(State::PreOperational);
    }

    pub(super) fn deadline(&self) -> Option<Instant> {
        let mut due = self.heartbeat.deadline();
        let mut note = |at: Option<Instant>| due = sooner(due, at);
        for watched in self.watched.iter().flatten() {
            note(watched.deadline());
        }
        for t_pdo in &self.t_pdos {
            note(t_pdo.deadline());
        }
        if self.options.life_guarding == LifeGuarding::AtExpiry {
            note(self.guarding.deadline());
        }
        // Neither is sent while the node is Stopped.
        if self.nmt.state().communicates() {
            note(self.emcy.deadline());
            note(self.sync.as_ref().and_then(sync::Producer::deadline));
        }
        due
    }

    /// The number of the T_PDO with this identifier.
    pub(super) fn t_pdo(&self, id: CanId) -> Option<u16> {
        let mut pdos = self.t_pdos.iter();
        pdos.find(|pdo| pdo.has_id(id)).map(|pdo| pdo.number)
    }

    /// Whether a frame that is neither SDO nor NMT may be for this node.
    pub(super) fn concerns(&self, frame: &Frame) -> bool {
        let id = frame.id();
        let is = |of: CobId| id == CanId::from(of);
        let mut watched = self.watched.iter().flatten();
        let mut r_pdos = self.r_pdos.iter();
        frame.is_remote()
            || self.sync_id.is_some_and(is)
            || r_pdos.any(|pdo| pdo.has_id(id))
            || watched.any(|it| is(CobId::error_control(it.node())))
    }

    /// A frame that is neither SDO nor NMT.
    pub(super) fn on_frame(
        &mut self,
        now: Instant,
        frame: &Frame,
        app: &mut impl Application,
        tx: &mut (impl Transmit + ?Sized),
    ) {
        let state = self.nmt.state();
        if frame.is_remote() {
            if frame.id() == self.error_control.into() {
                if !self.heartbeat.is_on() {
                    self.watch_guarding(now, app, tx);
                    let state = self.nmt.state();
                    self.guarding.answer(now, self.error_control, state, tx);
                }
            } else if state == State::Operational {
                app.refresh(now, None);
                for pdo in &mut self.t_pdos {
                    pdo.on_request(frame, app, tx);
                }
            }
            return;
        }
        for watched in self.watched.iter_mut().flatten() {
            watched.on_frame(now, frame);
        }
        if let Some(sync) = self.sync_id.and_then(|id| Sync::decode(frame, id)) {
            if state.communicates() {
                self.on_sync(now, sync, app, tx);
            }
            return;
        }
        if state == State::Operational {
            self.on_r_pdo(now, frame, app, tx);
        }
    }

    pub(super) fn on_sync(
        &mut self,
        now: Instant,
        sync: Sync,
        app: &mut impl Application,
        tx: &mut (impl Transmit + ?Sized),
    ) {
        if self.nmt.state() == State::Operational {
            app.refresh(now, None);
            for pdo in &mut self.t_pdos {
                pdo.on_sync(sync, app, tx);
            }
            for pdo in &mut self.r_pdos {
                if let Some(payload) = pdo.take_waiting(self.options.r_pdos_count_syncs) {
                    pdo.write(now, payload, app);
                }
            }
        }
        app.on_sync(now, sync);
    }

    fn on_r_pdo(
        &mut self,
        now: Instant,
        frame: &Frame,
        app: &mut impl Application,
        tx: &mut (impl Transmit + ?Sized),
    ) {
        for place in 0..self.r_pdos.len() {
            let pdo = &mut self.r_pdos[place];
            match pdo.receive(frame) {
                Reception::Foreign | Reception::AtSync => {}
                Reception::Now(payload) => pdo.write(now, payload, app),
                Reception::Short => {
                    let error = CommunicationError::ShortPdo(pdo.number);
                    if let Some(emergency) = app.on_communication_error(now, error) {
                        self.emergency(now, emergency, app, tx);
                    }
                }
            }
        }
    }

    /// The node's state changes to one without reset.
    pub(super) fn enter(
        &mut self,
        now: Instant,
        from: State,
        state: State,
        app: &mut impl Application,
    ) {
        if !from.communicates() && state.communicates() {
            // SYNC starts anew, and its counter with it.
            self.start_sync(now, app.objects());
        }
        self.nmt.enter(state);
        self.r_pdos.iter_mut().for_each(RPdo::reset);
        for pdo in &mut self.t_pdos {
            if state == State::Operational {
                pdo.start(now);
            } else {
                pdo.stop();
            }
        }
        app.on_nmt(now, Event::Entered(state));
    }

    pub(super) fn poll(
        &mut self,
        now: Instant,
        app: &mut impl Application,
        tx: &mut (impl Transmit + ?Sized),
    ) {
        let state = self.nmt.state();
        self.heartbeat.poll(now, self.error_control, state, tx);
        for place in 0..self.watched.len() {
            if let Some(watched) = &mut self.watched[place]
                && watched.poll(now)
            {
                let error = CommunicationError::Heartbeat(watched.node());
                self.on_lost(now, error, app, tx);
            }
        }
        if self.options.life_guarding == LifeGuarding::AtExpiry {
            self.watch_guarding(now, app, tx);
        }
        if self.nmt.state().communicates()
            && let Some(sync) = self.sync.as_mut().and_then(|sync| sync.poll(now, tx))
        {
            self.on_sync(now, sync, app, tx);
        }
    }

    /// Whether the life time has passed without a guarding request.
    fn watch_guarding(
        &mut self,
        now: Instant,
        app: &mut impl Application,
        tx: &mut (impl Transmit + ?Sized),
    ) {
        if self.guarding.poll(now) {
            self.on_lost(now, CommunicationError::LifeGuarding, app, tx);
        }
    }

    /// 1029h: what a loss of communication makes of the node's state.
    fn on_lost(
        &mut self,
        now: Instant,
        error: CommunicationError,
        app: &mut impl Application,
        tx: &mut (impl Transmit + ?Sized),
    ) {
        if let Some(emergency) = app.on_communication_error(now, error) {
            self.emergency(now, emergency, app, tx);
        }
        let state = self.nmt.state();
        let then = app.state_after_loss(state);
        if then != state {
            self.enter(now, state, then, app);
        }
    }

    /// 1001h, 1003h and the EMCY message.
    pub(super) fn emergency(
        &mut self,
        now: Instant,
        emergency: Emergency,
        app: &mut impl Application,
        tx: &mut (impl Transmit + ?Sized),
    ) {
        let info = app.error_field_info(&emergency);
        let objects = app.objects_mut();
        objects.put(0x1001, 0, emergency.register.into());
        if emergency.code != emcy::code::NO_ERROR {
            let mut field = i64::from(info) << 16 | i64::from(emergency.code);
            let mut sub = 1;
            // Older errors move up by one; the oldest falls off the end.
            while let Some(row) = objects.row(0x1003, sub) {
                let older = objects.get(row);
                objects.set(row, field);
                if older == 0 || sub == u8::MAX {
                    break;
                }
                (field, sub) = (older, sub + 1);
            }
            let kept = (1..=sub).filter(|&sub| objects.row(0x1003, sub).is_some());
            let kept = kept.count() as i64;
            objects.put(0x1003, 0, kept);
        }
        if let Some(id) = self.emcy_id
            && self.nmt.state().communicates()
        {
            self.emcy.raise(now, id, emergency, tx);
        }
    }

    /// Sends the emergencies that have waited long enough, and the T_PDOs that an event or their
    /// event timer asks for.
    /// Returns whether there may have been something to send.
    pub(super) fn send_events(
        &mut self,
        now: Instant,
        app: &mut impl Application,
        tx: &mut (impl Transmit + ?Sized),
    ) -> bool {
        let state = self.nmt.state();
        let waits = self.emcy.waits();
        if let Some(id) = self.emcy_id.filter(|_| state.communicates()) {
            self.emcy.poll(now, id, tx);
        }
        let changed = app.next_event();
        let watches = state == State::Operational && self.t_pdos.iter().any(TPdo::waits_for_events);
        if watches {
            app.refresh(now, None);
            for pdo in &mut self.t_pdos {
                pdo.send_event(now, changed, app, tx);
            }
        }
        waits || watches
    }

    /// A number of the right length comes by SDO to a writable object.
    pub(super) fn write(
        &mut self,
        now: Instant,
        row: Row,
        value: i64,
        app: &mut impl Application,
    ) -> Result<(), AbortCode> {
        let address = app.objects().entry(row).address;
        // A mapping's count has a code of its own for a value that is too great.
        if matches!(address.index, 0x1600..0x1800 | 0x1A00..0x1C00) {
            self.check_mapping(address, value, app.objects())?;
        }
        app.objects().check_range(row, value)?;
        app.check_write(row, value, Origin::Sdo)?;
        let objects = app.objects_mut();
        let value = match (address.index, address.sub) {
            (0x1003, _) => return self.write_1003_errors(now, row, value, app),
            (0x1010, _) => return write_1010_store(address, value, objects),
            (0x1011, _) => return write_1011_restore(address, value, objects),
            (0x1005 | 0x100E | 0x1014, 0)
            | (0x1201..=0x127F, 1 | 2)
            | (0x1400..0x1600 | 0x1800..0x1A00, 1) => {
                self.cob_id_word(address.index, objects.get(row), value)?
            }
            (0x1400..0x1600 | 0x1800..0x1A00, _) => {
                self.check_pdo_parameter(address, value)?;
                value
            }
            (0x1016, _) => {
                check_1016_watched(address, value, objects)?;
                value
            }
            _ => value,
        };
        objects.set(row, value);
        match address.index {
            0x1005 | 0x100E | 0x1014 if self.options.identifiers_at_reset => {}
            0x100E => self.load_100e_error_control(objects),
            0x1005 => self.load_1005_sync(now, objects),
            0x1006 | 0x1019 => self.start_sync(now, objects),
            0x100C | 0x100D => self.load_100c_guarding(objects),
            0x1014 => self.load_1014_emcy(objects),
            0x1015 => self.load_1015_inhibit(objects),
            0x1016 => self.load_1016_watched(objects),
            // The first heartbeat goes out as soon as the time is set (lxm32m 1100).
            0x1017 => self.load_1017_heartbeat(now, objects),
            0x1201..=0x127F => self.servers_changed = true,
            0x1400..0x1C00 => self.load_pdo(now, address.index, objects),
            index if self.options.event_timer == Some(index) => {
                self.load_event_timer(now, objects);
            }
            _ => {}
        }
        app.written(now, row, Origin::Sdo);
        Ok(())
    }

    /// The word that writing `new` over `old` makes of a COB-ID.
    fn cob_id_word(&self, index: u16, old: i64, new: i64) -> Result<i64, AbortCode> {
        // Bit 31 says "not in use" of everything but SYNC.
        let switchable = index != 0x1005;
        let in_use = |word: CobIdWord| !switchable || word.is_valid();
        // Of those that are restricted, 100Eh has its own.
        let refused = |word| index != 0x100E && in_use(word) && is_restricted(word);
        match self.options.parameters {
            ParameterRules::Lenient { pdo, sync_and_emcy } => {
                let writable = match index {
                    0x1005 | 0x100E | 0x1014 => sync_and_emcy,
                    _ => pdo,
                };
                let value = old & !i64::from(writable) | new & i64::from(writable);
                let word = CobIdWord(value as u32);
                if refused(word) {
                    return Err(AbortCode::InvalidValue);
                }
                Ok(value)
            }
            ParameterRules::Standard => {
                let (before, after) = (CobIdWord(old as u32), CobIdWord(new as u32));
                let moved = before.can_id() != after.can_id();
                let tidy = after.cob_id().is_none() || after.0 & 0x1FFF_F800 == 0;
                if !tidy
                    || refused(after)
                    || switchable && before.is_valid() && after.is_valid() && moved
                {
                    return Err(AbortCode::InvalidValue);
                }
                Ok(new)
            }
        }
    }

    /// 1003h:0: only 0 may be written, which forgets the errors.
    fn write_1003_errors(
        &self,
        now: Instant,
        row: Row,
        value: i64,
        app: &mut impl Application,
    ) -> Result<(), AbortCode> {
        if value != 0 {
            return Err(AbortCode::InvalidValue);
        }
        for sub in 0..=u8::MAX {
            if !app.objects_mut().put(0x1003, sub, 0) {
                break;
            }
        }
        app.written(now, row, Origin::Sdo);
        Ok(())
    }

    fn load_1005_sync(&mut self, now: Instant, objects: &Dictionary) {
        let word = objects.value(0x1005, 0);
        self.sync_word = word.map(|word| CobIdWord(word as u32));
        self.start_sync(now, objects);
    }

    /// SYNC begins anew, taken or generated.
    fn start_sync(&mut self, now: Instant, objects: &Dictionary) {
        let value = |index| objects.value(index, 0);
        let word = self.sync_word;
        // Bit 31 of DS 301 V3: the device takes SYNC.
        let takes = |word: &CobIdWord| !self.options.sync_by_bit_31 || !word.is_valid();
        self.sync_id = word.filter(takes).and_then(CobIdWord::cob_id);
        let period = self.options.cycle_period_unit * value(0x1006).unwrap_or(0) as u32;
        // Bit 30: the device generates SYNC.
        let produces = word.is_some_and(|word| word.0 & CobIdWord::NO_RTR != 0);
        self.sync = word
            .and_then(CobIdWord::cob_id)
            .filter(|_| produces && !period.is_zero())
            .map(|id| {
                let overflow = value(0x1019).unwrap_or(0) as u8;
                let mut producer = sync::Producer::new(id, period, overflow);
                producer.start(now + period);
                producer
            });
    }

    fn load_100c_guarding(&mut self, objects: &Dictionary) {
        let value = |index| objects.value(index, 0).unwrap_or(0) as u32;
        let life_time = Duration::from_millis(value(0x100C).into()) * value(0x100D);
        self.guarding.set_life_time(life_time);
    }

    fn load_100e_error_control(&mut self, objects: &Dictionary) {
        let word = objects.value(0x100E, 0).and_then(valid_cob_id);
        self.error_control = word.unwrap_or(CobId::error_control(self.nmt.node()));
    }

    fn load_1014_emcy(&mut self, objects: &Dictionary) {
        self.emcy_id = objects.value(0x1014, 0).and_then(valid_cob_id);
        if self.emcy_id.is_none() {
            // What waits for the inhibit time has no identifier to go by.
            self.emcy.reset();
        }
    }

    fn load_1015_inhibit(&mut self, objects: &Dictionary) {
        let inhibit = objects.value(0x1015, 0).unwrap_or(0) as u32;
        self.emcy
            .set_inhibit_time(Duration::from_micros(100) * inhibit);
    }

    fn load_1016_watched(&mut self, objects: &Dictionary) {
        for (watched, (_, value)) in self.watched.iter_mut().zip(watches(objects)) {
            let (before, after) = (watched.as_ref(), watch(value));
            // A node that is watched as before stays so, whatever becomes of the others.
            if before.map(|it| (it.node(), it.time())) != after {
                *watched = after.map(|(node, time)| heartbeat::Consumer::new(node, time));
            }
        }
    }

    fn load_1017_heartbeat(&mut self, first: Instant, objects: &Dictionary) {
        self.heartbeat.start(first, heartbeat_period(objects));
        if self.heartbeat.is_on() {
            // Heartbeat and guarding exclude each other.
            self.guarding.disarm();
        }
    }

    /// 1400h ff. and 1800h ff.
    fn check_pdo_parameter(&self, address: Address, value: i64) -> Result<(), AbortCode> {
        let strict = self.options.parameters == ParameterRules::Standard;
        let refused = match TransmissionType::from(value as u8) {
            TransmissionType::Reserved(_) => true,
            // They say when a T_PDO is sent, and are reserved in an R_PDO; there are devices that take them.
            TransmissionType::SyncRtr | TransmissionType::EventRtr => {
                strict && address.index < 0x1800
            }
            _ => false,
        };
        match address.sub {
            2 if refused => Err(AbortCode::InvalidValue),
            3 | 6 if strict && self.is_active(address.index) => Err(AbortCode::InvalidValue),
            _ => Ok(()),
        }
    }

    /// 1600h ff. and 1A00h ff.
    fn check_mapping(
        &self,
        address: Address,
        value: i64,
        objects: &Dictionary,
    ) -> Result<(), AbortCode> {
        let (index, received) = (address.index, address.index < 0x1800);
        if self.options.parameters == ParameterRules::Standard && self.is_active(index) {
            return Err(AbortCode::UnsupportedAccess);
        }
        if address.sub != 0 {
            if objects.value(index, 0) != Some(0) {
                return Err(AbortCode::UnsupportedAccess);
            }
            // 0 empties a place that the count will leave out.
            return match value {
                0 => Ok(()),
                entry => self.check_mappable(Mapped::from(entry as u32), received, objects),
            };
        }
        let count = value as u8;
        if objects.row(index, count).is_none() {
            return Err(AbortCode::PdoLength);
        }
        let mut bits = 0;
        for entry in (1..=count).filter_map(|sub| objects.value(index, sub)) {
            let mapped = Mapped::from(entry as u32);
            self.check_mappable(mapped, received, objects)?;
            bits += u32::from(mapped.bits);
        }
        if bits > 64 {
            Err(AbortCode::PdoLength)
        } else {
            Ok(())
        }
    }

    fn check_mappable(
        &self,
        mapped: Mapped,
        received: bool,
        objects: &Dictionary,
    ) -> Result<(), AbortCode> {
        if let Some(bits) = dummy_bits(mapped.address)
            && received
            && self.options.dummy_mapping
        {
            return if mapped.bits == bits {
                Ok(())
            } else {
                Err(AbortCode::NotMappable)
            };
        }
        let entry = objects.entry(objects.find(mapped.address)?);
        let direction = if received {
            entry.mappable.r_pdo
        } else {
            entry.mappable.t_pdo
        };
        let fits = match entry.data_type {
            DataType::Bool => matches!(mapped.bits, 1 | 8),
            data_type => data_type.is_number() && usize::from(mapped.bits) == data_type.size() * 8,
        };
        if direction && fits {
            Ok(())
        } else {
            Err(AbortCode::NotMappable)
        }
    }

    /// Whether the PDO that an object of 1400h…1BFFh belongs to is switched on.
    fn is_active(&self, index: u16) -> bool {
        let number = (index & 0x1FF) + 1;
        if index < 0x1800 {
            let mut pdos = self.r_pdos.iter();
            pdos.any(|pdo| pdo.number == number && pdo.is_valid())
        } else {
            let mut pdos = self.t_pdos.iter();
            pdos.any(|pdo| pdo.number == number && pdo.is_valid())
        }
    }

    fn load_pdo(&mut self, now: Instant, index: u16, objects: &Dictionary) {
        let number = (index & 0x1FF) + 1;
        if index < 0x1800 {
            let mut pdos = self.r_pdos.iter_mut();
            if let Some(pdo) = pdos.find(|pdo| pdo.number == number) {
                pdo.load(objects);
            }
        } else {
            let pdos = self.t_pdos.iter_mut();
            for pdo in pdos.filter(|pdo| pdo.number == number) {
                pdo.load(objects, self.options.event_timer);
                if self.nmt.state() == State::Operational {
                    pdo.start(now);
                }
            }
        }
    }

    /// The event timer of the T_PDOs that have none of their own.
    fn load_event_timer(&mut self, now: Instant, objects: &Dictionary) {
        for place in 0..self.t_pdos.len() {
            let pdo = &self.t_pdos[place];
            if pdo.takes_common_timer(objects) {
                self.load_pdo(now, 0x1800 + pdo.number - 1, objects);
            }
        }
    }
}

/// 1016h: no node is watched twice.
fn check_1016_watched(address: Address, value: i64, objects: &Dictionary) -> Result<(), AbortCode> {
    let twice = watch(value).is_some_and(|(node, _)| {
        watches(objects).any(|(sub, value)| {
            sub != address.sub && watch(value).is_some_and(|(other, _)| other == node)
        })
    });
    if twice {
        Err(AbortCode::ParameterIncompatible)
    } else {
        Ok(())
    }
}

/// 1017h.
fn heartbeat_period(objects: &Dictionary) -> Duration {
    Duration::from_millis(objects.value(0x1017, 0).unwrap_or(0) as u64)
}

/// 1010h: keeps values for the next power-on.
fn write_1010_store(
    address: Address,
    value: i64,
    objects: &mut Dictionary,
) -> Result<(), AbortCode> {
    if value != SAVE {
        return Err(AbortCode::NotStored);
    }
    objects.store(|entry| in_group(address.sub, entry.address.index));
    Ok(())
}

/// 1011h: defaults from the next reset on.
fn write_1011_restore(
    address: Address,
    value: i64,
    objects: &mut Dictionary,
) -> Result<(), AbortCode> {
    if value != LOAD {
        return Err(AbortCode::NotStored);
    }
    objects.forget(|entry| in_group(address.sub, entry.address.index));
    Ok(())
}

/// Which objects subindex `sub` of 1010h and 1011h means: all, communication, application,
/// manufacturer's.
fn in_group(sub: u8, index: u16) -> bool {
    match sub {
        1 => true,
        2 => (0x1000..0x2000).contains(&index),
        3 => (0x6000..0xA000).contains(&index),
        _ => (0x2000..0x6000).contains(&index),
    }
}

/// The values of 1016h:1 ff. with their subindices.
fn watches(objects: &Dictionary) -> impl Iterator<Item = (u8, i64)> {
    (1..=127).map_while(|sub| Some((sub, objects.value(0x1016, sub)?)))
}

/// Node and time in a value of 1016h, if it means that a node is watched.
fn watch(value: i64) -> Option<(NodeId, Duration)> {
    let time = Duration::from_millis(value as u64 & 0xFFFF);
    let node = NodeId::new((value >> 16) as u8)?;
    (!time.is_zero()).then_some((node, time))
}

/// The length of a data type 0001h…0007h mapped as a gap.
fn dummy_bits(address: Address) -> Option<u8> {
    match (address.index, address.sub) {
        (0x0001, 0) => Some(1),
        (0x0002 | 0x0005, 0) => Some(8),
        (0x0003 | 0x0006, 0) => Some(16),
        (0x0004 | 0x0007, 0) => Some(32),
        _ => None,
    }
}

/// The sooner one of what there is.
fn sooner(one: Option<Instant>, other: Option<Instant>) -> Option<Instant> {
    match (one, other) {
        (Some(one), Some(other)) => Some(one.min(other)),
        _ => one.or(other),
    }
}

/// Whether CiA 301 keeps the identifier for another service.
fn is_restricted(word: CobIdWord) -> bool {
    word.cob_id().is_some_and(|id| {
        matches!(
            id.get(),
            0x000..=0x07F
                | 0x101..=0x180
                | 0x581..=0x5FF
                | 0x601..=0x67F
                | 0x6E0..=0x6FF
                | 0x701..=0x77F
                | 0x780..=0x7FF
        )
    })
}
