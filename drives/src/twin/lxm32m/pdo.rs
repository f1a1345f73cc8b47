//! The eight PDOs: communication parameters, mapping, events (lxm32m 543-912, 3491-4524).

use super::drive::{Channel, Drive};
use syncline_canopen::dictionary::{Dictionary, Row};
use syncline_canopen::pdo::{CobIdWord, Mapped, Packer, TransmissionType, Unpacker};
use syncline_canopen::sdo::AbortCode;
use syncline_canopen::time::Duration;
use syncline_canopen::{CobId, Frame, Instant};

/// PDOs in each direction.
const PDOS: u16 = 4;

/// Objects in one PDO (D-15).
const ENTRIES: usize = 4;

/// The objects that a PDO carries, in order.
#[derive(Clone, Copy, Debug, Default)]
struct Mapping {
    entries: [Option<(Row, u8)>; ENTRIES],
    bytes: usize,
}

impl Mapping {
    /// What 16xxh or 1Axxh says now.
    fn of(objects: &Dictionary, index: u16) -> Self {
        let mut mapping = Self::default();
        let count = objects.value(index, 0).unwrap_or(0) as usize;
        for place in 0..count.min(ENTRIES) {
            let entry = objects.value(index, place as u8 + 1).unwrap_or(0) as u32;
            let mapped = Mapped::from(entry);
            mapping.entries[place] = objects
                .row(mapped.address.index, mapped.address.sub)
                .map(|row| (row, mapped.bits));
        }
        let bits: usize = mapping.objects().map(|(_, bits)| usize::from(bits)).sum();
        mapping.bytes = bits / 8;
        mapping
    }

    fn objects(&self) -> impl Iterator<Item = (Row, u8)> {
        self.entries.into_iter().flatten()
    }

    fn pack(&self, objects: &Dictionary) -> Packer {
        let mut packer = Packer::new();
        for (row, bits) in self.objects() {
            packer.push(objects.get(row), bits);
        }
        packer
    }
}

/// A PDO that the drive receives.
#[derive(Clone, Debug)]
struct Receive {
    cob_id: Option<CobId>,
    synchronous: bool,
    mapping: Mapping,
    waiting: Option<Frame>,
}

/// A PDO that the drive transmits.
#[derive(Clone, Debug)]
struct Send {
    cob_id: Option<CobId>,
    rtr: bool,
    kind: TransmissionType,
    inhibit: Duration,
    event_timer: Duration,
    event_mask: u8,
    mapping: Mapping,
    /// What the mapped objects were when an event was last seen.
    last: [i64; ENTRIES],
    event: bool,
    sampled: Packer,
    syncs: u8,
    sent_at: Option<Instant>,
}

impl Send {
    /// When this PDO is due without anything else happening.
    fn deadline(&self) -> Option<Instant> {
        self.cob_id?;
        if !self.kind.is_event_driven() {
            return None;
        }
        let sent_at = self.sent_at?;
        let event = self.event.then(|| sent_at + self.inhibit);
        let timer = (!self.event_timer.is_zero()).then(|| sent_at + self.event_timer);
        [event, timer].into_iter().flatten().min()
    }

    fn frame(&self, payload: &Packer) -> Option<Frame> {
        Frame::try_new(self.cob_id?, &payload.bytes()[..payload.len()])
    }
}

/// All PDOs of the node.
#[derive(Clone, Debug)]
pub(super) struct Pdos {
    receive: [Receive; PDOS as usize],
    send: [Send; PDOS as usize],
}

impl Pdos {
    /// As the objects say.
    pub(super) fn new(objects: &Dictionary) -> Self {
        let receive = core::array::from_fn(|n| Receive::of(objects, n as u16));
        let send = core::array::from_fn(|n| Send::of(objects, n as u16));
        Self { receive, send }
    }

    /// Takes over a changed parameter object; the PDO that it belongs to starts afresh.
    pub(super) fn reconfigure(&mut self, objects: &Dictionary, index: u16) {
        let n = index & 0xFF;
        match index {
            0x1400..=0x1403 | 0x1600..=0x1603 => {
                self.receive[usize::from(n)] = Receive::of(objects, n);
            }
            0x1800..=0x1803 | 0x1A00..=0x1A03 => {
                self.send[usize::from(n)] = Send::of(objects, n);
            }
            0x3041 => {
                for (n, send) in self.send.iter_mut().enumerate() {
                    send.event_mask = event_mask(objects, n as u16);
                }
            }
            _ => {}
        }
    }

    /// PDOs come to life with Operational: every active one that events send is sent once.
    pub(super) fn start(&mut self) {
        for receive in &mut self.receive {
            receive.waiting = None;
        }
        for send in &mut self.send {
            send.event = true;
            send.sent_at = None;
            send.syncs = 0;
        }
    }

    /// The number of the R_PDO that a frame is, if any.
    pub(super) fn addressed(&self, frame: &Frame) -> Option<usize> {
        self.receive.iter().position(|pdo| {
            pdo.cob_id
                .is_some_and(|cob_id| frame.id() == cob_id.into() && !frame.is_remote())
        })
    }

    /// An R_PDO has come: acts on it, or keeps it for the next SYNC.
    ///
    /// # Errors
    /// It is too short for its mapping.
    pub(super) fn receive(&mut self, n: usize, frame: &Frame, drive: &mut Drive) -> Result<(), ()> {
        let pdo = &mut self.receive[n];
        if frame.data().len() < pdo.mapping.bytes {
            return Err(());
        }
        if pdo.synchronous {
            pdo.waiting = Some(*frame);
        } else {
            unpack(&pdo.mapping, frame, drive);
        }
        Ok(())
    }

    /// SYNC, first half: T_PDOs sample and are handed to `queue`.
    pub(super) fn sample(&mut self, objects: &Dictionary, mut queue: impl FnMut(Frame)) {
        for pdo in &mut self.send {
            let send = match pdo.kind {
                TransmissionType::SyncAcyclic => core::mem::take(&mut pdo.event),
                TransmissionType::SyncCyclic(every) => {
                    pdo.syncs += 1;
                    let due = pdo.syncs >= every;
                    if due {
                        pdo.syncs = 0;
                    }
                    due
                }
                TransmissionType::SyncRtr => {
                    pdo.sampled = pdo.mapping.pack(objects);
                    false
                }
                _ => false,
            };
            if send && let Some(frame) = pdo.frame(&pdo.mapping.pack(objects)) {
                queue(frame);
            }
        }
    }

    /// SYNC, second half: the R_PDOs that waited for it take effect.
    pub(super) fn apply(&mut self, drive: &mut Drive) {
        for pdo in &mut self.receive {
            if let Some(frame) = pdo.waiting.take() {
                unpack(&pdo.mapping, &frame, drive);
            }
        }
    }

    /// Looks for changes of mapped objects, and hands what is due to `queue`. `trigger` is an
    /// event of its own for PDOs with the statusword.
    pub(super) fn poll(
        &mut self,
        now: Instant,
        objects: &Dictionary,
        trigger: Option<Row>,
        mut queue: impl FnMut(Frame),
    ) {
        for pdo in self.send.iter_mut().filter(|pdo| pdo.cob_id.is_some()) {
            for (place, (row, _)) in pdo.mapping.objects().enumerate() {
                let value = objects.get(row);
                if pdo.event_mask >> place & 1 == 1
                    && (value != pdo.last[place] || trigger == Some(row))
                {
                    pdo.event = true;
                }
                pdo.last[place] = value;
            }
            let first = pdo.event && pdo.sent_at.is_none() && pdo.kind.is_event_driven();
            if first || pdo.deadline().is_some_and(|due| due <= now) {
                if let Some(frame) = pdo.frame(&pdo.mapping.pack(objects)) {
                    queue(frame);
                }
                pdo.event = false;
                pdo.sent_at = Some(now);
            }
        }
    }

    /// The answer to a remote request for a T_PDO, if it may be asked for.
    pub(super) fn requested(&self, frame: &Frame, objects: &Dictionary) -> Option<Frame> {
        let pdo = self.send.iter().find(|pdo| {
            pdo.cob_id.is_some_and(|cob_id| frame.id() == cob_id.into()) && frame.is_remote()
        })?;
        if !pdo.rtr {
            return None;
        }
        match pdo.kind {
            TransmissionType::SyncRtr => pdo.frame(&pdo.sampled),
            _ => pdo.frame(&pdo.mapping.pack(objects)),
        }
    }

    /// When [`Self::poll`] has something to do at the latest.
    pub(super) fn deadline(&self) -> Option<Instant> {
        self.send.iter().filter_map(Send::deadline).min()
    }
}

impl Receive {
    fn of(objects: &Dictionary, n: u16) -> Self {
        let kind = transmission_type(objects, 0x1400 + n);
        Self {
            cob_id: active(objects, 0x1400 + n),
            synchronous: kind.is_synchronous(),
            mapping: Mapping::of(objects, 0x1600 + n),
            waiting: None,
        }
    }
}

impl Send {
    fn of(objects: &Dictionary, n: u16) -> Self {
        let index = 0x1800 + n;
        let time = |sub, unit: Duration| unit * objects.value(index, sub).unwrap_or(0) as u32;
        let mapping = Mapping::of(objects, 0x1A00 + n);
        let word = CobIdWord(objects.value(index, 1).unwrap_or(0) as u32);
        Self {
            cob_id: active(objects, index),
            rtr: word.allows_rtr(),
            kind: transmission_type(objects, index),
            inhibit: time(3, Duration::from_micros(100)),
            event_timer: time(5, Duration::from_millis(1)),
            event_mask: event_mask(objects, n),
            mapping,
            last: [0; ENTRIES],
            event: true,
            sampled: mapping.pack(objects),
            syncs: 0,
            sent_at: None,
        }
    }
}

/// The identifier of a PDO that is switched on.
fn active(objects: &Dictionary, index: u16) -> Option<CobId> {
    let word = CobIdWord(objects.value(index, 1).unwrap_or(0) as u32);
    word.cob_id().filter(|_| word.is_valid())
}

fn transmission_type(objects: &Dictionary, index: u16) -> TransmissionType {
    TransmissionType::from(objects.value(index, 2).unwrap_or(0) as u8)
}

/// 3041h:B…E (lxm32m 804-812).
fn event_mask(objects: &Dictionary, n: u16) -> u8 {
    objects.value(0x3041, 0x0B + n as u8).unwrap_or(0) as u8
}

/// All objects get their values before any of them takes effect: a new target counts for the
/// controlword that stands in front of it.
fn unpack(mapping: &Mapping, frame: &Frame, drive: &mut Drive) {
    let mut unpacker = Unpacker::new(frame.data());
    let mut written = [None; ENTRIES];
    for (place, (row, bits)) in mapping.objects().enumerate() {
        let signed = drive.objects.entry(row).data_type.is_signed();
        let value = if signed {
            unpacker.signed(bits)
        } else {
            unpacker.unsigned(bits).map(|value| value as i64)
        };
        // What the drive would refuse by SDO it ignores in a PDO.
        if let Some(value) = value
            && drive.objects.check_range(row, value).is_ok()
            && drive.check_write(row, value).is_ok()
        {
            drive.objects.set(row, value);
            written[place] = Some(row);
        }
    }
    for row in written.into_iter().flatten() {
        drive.written(row, Channel::Pdo);
    }
}

/// Checks a write to the PDO parameters; returns the value to store.
///
/// # Errors
/// The abort code that the manual's table gives for it (lxm32m 1966-1994).
pub(super) fn check_write(
    objects: &Dictionary,
    index: u16,
    sub: u8,
    value: i64,
) -> Result<i64, AbortCode> {
    match (index, sub) {
        // Only bit 31 and the identifier can be changed (lxm32m 3528-3536, D-05).
        (0x1400..=0x1403 | 0x1800..=0x1803, 1) => {
            let kept = objects.value(index, sub).unwrap_or(0) & !0x8000_07FF;
            Ok(kept | value & 0x8000_07FF)
        }
        (0x1400..=0x1403 | 0x1800..=0x1803, 2) => {
            match TransmissionType::from(value as u8) {
                TransmissionType::Reserved(_) => Err(AbortCode::InvalidValue), // D-12
                _ => Ok(value),
            }
        }
        (0x1600..=0x1603 | 0x1A00..=0x1A03, 0) => {
            let mut bits = 0;
            for place in 1..=value {
                let entry = objects.value(index, place as u8).unwrap_or(0);
                bits += i64::from(check_mapped(objects, index, entry)?.bits);
            }
            if bits > 64 {
                return Err(AbortCode::PdoLength);
            }
            Ok(value)
        }
        (0x1600..=0x1603 | 0x1A00..=0x1A03, _) => {
            // CiA 301: a mapping is changed while its number of entries is 0.
            if objects.value(index, 0) != Some(0) {
                return Err(AbortCode::UnsupportedAccess);
            }
            check_mapped(objects, index, value)?;
            Ok(value)
        }
        _ => Ok(value),
    }
}

fn check_mapped(objects: &Dictionary, index: u16, entry: i64) -> Result<Mapped, AbortCode> {
    let mapped = Mapped::from(entry as u32);
    let row = objects.find(mapped.address)?;
    let entry = objects.entry(row);
    let mappable = if index < 0x1800 {
        entry.mappable.r_pdo
    } else {
        entry.mappable.t_pdo
    };
    if !mappable || usize::from(mapped.bits) != entry.data_type.size() * 8 {
        return Err(AbortCode::NotMappable);
    }
    Ok(mapped)
}
