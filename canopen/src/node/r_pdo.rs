//! PDOs that the node receives (1400h…15FFh, 1600h…17FFh).

use super::communication::{MAX_MAPPED, mapping_of};
use super::{Application, Origin};
use crate::dictionary::{Dictionary, Row};
use crate::pdo::{CobIdWord, Mapped, TransmissionType, Unpacker};
use crate::{CanId, Frame, Instant};

/// One R_PDO: its parameters, and a payload that waits for SYNC.
#[derive(Debug)]
pub(super) struct RPdo {
    pub(super) number: u16,
    id: Option<CanId>,
    kind: TransmissionType,
    /// The objects in order; `None` is a gap.
    mapping: Vec<(Option<Row>, u8)>,
    waiting: Option<[u8; 8]>,
    /// SYNCs until what waits takes effect.
    syncs: u8,
}

/// What a frame is to an R_PDO.
pub(super) enum Reception {
    /// Another message.
    Foreign,
    /// Its payload, to be written at once.
    Now([u8; 8]),
    /// Its payload, kept for the next SYNC.
    AtSync,
    /// Its payload with fewer bytes than are mapped.
    Short,
}

impl RPdo {
    pub(super) fn new(number: u16) -> Self {
        Self {
            number,
            id: None,
            kind: TransmissionType::EventProfile,
            mapping: Vec::with_capacity(MAX_MAPPED),
            waiting: None,
            syncs: 0,
        }
    }

    pub(super) fn load(&mut self, objects: &Dictionary) {
        let parameter = 0x1400 + self.number - 1;
        let value = |sub| objects.value(parameter, sub);
        let word = CobIdWord(value(1).unwrap_or(i64::from(CobIdWord::INVALID)) as u32);
        self.id = word.is_valid().then(|| word.can_id());
        self.kind = TransmissionType::from(value(2).unwrap_or(255) as u8);
        self.mapping.clear();
        let mapping = 0x1600 + self.number - 1;
        self.mapping
            .extend(mapping_of(objects, mapping).map(|mapped| {
                let Mapped { address, bits } = mapped;
                (objects.find(address).ok(), bits)
            }));
        self.waiting = None;
    }

    pub(super) fn is_valid(&self) -> bool {
        self.id.is_some()
    }

    pub(super) fn has_id(&self, id: CanId) -> bool {
        self.id == Some(id)
    }

    /// Forgets a payload that waits for SYNC.
    pub(super) fn reset(&mut self) {
        self.waiting = None;
    }

    pub(super) fn receive(&mut self, frame: &Frame) -> Reception {
        if !self.has_id(frame.id()) || self.mapping.is_empty() {
            return Reception::Foreign;
        }
        let bits: usize = self
            .mapping
            .iter()
            .map(|&(_, bits)| usize::from(bits))
            .sum();
        let data = frame.data();
        if data.len() < bits.div_ceil(8) {
            return Reception::Short;
        }
        let mut payload = [0; 8];
        payload[..data.len()].copy_from_slice(data);
        if self.kind.is_synchronous() {
            // One that comes while another one waits takes its place.
            if self.waiting.replace(payload).is_none() {
                self.syncs = match self.kind {
                    TransmissionType::SyncCyclic(every) => every,
                    _ => 1,
                };
            }
            Reception::AtSync
        } else {
            Reception::Now(payload)
        }
    }

    /// At a SYNC: what takes effect at it, of a node that counts SYNCs or takes the next one.
    pub(super) fn take_waiting(&mut self, counts: bool) -> Option<[u8; 8]> {
        self.syncs = self.syncs.saturating_sub(1);
        self.waiting.take_if(|_| self.syncs == 0 || !counts)
    }

    /// Writes a payload to the objects mapped. A value that its object refuses is dropped.
    pub(super) fn write(&self, now: Instant, payload: [u8; 8], app: &mut impl Application) {
        let origin = Origin::Pdo(self.number);
        let mut payload = Unpacker::new(&payload);
        let mut accepted = 0u64;
        for (place, &(row, bits)) in self.mapping.iter().enumerate() {
            let (Some(raw), objects) = (payload.unsigned(bits), app.objects()) else {
                break;
            };
            let Some(row) = row else { continue };
            let value = objects.entry(row).data_type.extend(raw, u32::from(bits));
            if objects.check_range(row, value).is_ok()
                && app.check_write(row, value, origin).is_ok()
            {
                app.objects_mut().set(row, value);
                accepted |= 1 << place;
            }
        }
        for (place, &(row, _)) in self.mapping.iter().enumerate() {
            if let Some(row) = row.filter(|_| accepted >> place & 1 != 0) {
                app.written(now, row, origin);
            }
        }
    }
}
