//! The encoder behind its CANopen node.

use super::fault::{EncoderError, Errors};
use super::policy::{Policies, Texts};
use super::{Commissioned, TwinConfig, Version};
use crate::bus::BitRate;
use crate::mechanics::rigid::Rigid;
use crate::twin::cia406::position::{Measure, work_area};
use crate::twin::node::Tampering;
use crate::twin::servo::shaft::Shaft;
use syncline_canopen::dictionary::{Dictionary, Row};
use syncline_canopen::node::Origin;
use syncline_canopen::sdo::AbortCode;
use syncline_canopen::{Instant, NodeId};

/// Bit rates by their number in 2001h and on switches 7 and 8 (crn S35, S15, S26).
pub(super) const BIT_RATES: [u32; 4] = [20_000, 125_000, 500_000, 1_000_000];

/// An encoder without its bus.
pub struct Encoder {
    pub(super) objects: Dictionary,
    pub(super) policies: Policies,
    pub(super) errors: Errors,
    pub(super) shaft: Shaft,
    version: Version,
    pub(super) commissioned: Commissioned,
    /// Its bit rate since the last power-on or Reset Node, by its number.
    bit_rate: u8,
    measure: Measure,
    /// What the preset adds to the position value.
    offset: u64,
    pub(super) now: Instant,
    /// The objects do not show the present position yet.
    pub(super) stale: bool,
    pub(super) tampering: Tampering,
}

impl Encoder {
    pub(super) fn new(mut objects: Dictionary, config: &TwinConfig) -> Self {
        if config.version == Version::Plug {
            objects.put(0x2000, 0, config.processor.node.get().into());
            objects.put(0x2001, 0, config.commissioned.bit_rate.into());
            objects.store(|entry| matches!(entry.address.index, 0x2000 | 0x2001));
        }
        // Somebody else turns it.
        let mut shaft = Shaft::new(Rigid::default(), config.position);
        shaft.couple(Instant::ZERO);
        Self {
            measure: Measure::of(&objects),
            objects,
            policies: config.policies,
            errors: Errors::default(),
            shaft,
            version: config.version,
            commissioned: config.commissioned,
            bit_rate: config.commissioned.bit_rate,
            offset: 0,
            now: Instant::ZERO,
            stale: true,
            tampering: Tampering::default(),
        }
    }

    /// The bit rate at which it listens and sends.
    pub(super) fn bit_rate(&self) -> Option<BitRate> {
        let rate = BIT_RATES.get(usize::from(self.bit_rate))?;
        BitRate::from_kbit(rate / 1000)
    }

    /// Whether it and its bus understand each other.
    pub(super) fn is_understood(&self) -> bool {
        let Commissioned { bus, .. } = self.commissioned;
        bus.is_none_or(|bus| self.bit_rate() == Some(bus))
    }

    pub(super) fn advance(&mut self, now: Instant) {
        let dt = now.saturating_since(self.now).as_nanos() as f64 * 1e-9;
        self.shaft.step(now, dt, 0.0, true);
        self.now = now;
        self.stale = true;
    }

    // ---- at a reset ----

    /// The plug's node id is an object, the cap's are switches (crn S7, S35, S15).
    pub(super) fn node_id(&self) -> Option<NodeId> {
        match self.version {
            Version::Plug => NodeId::new(self.objects.value(0x2000, 0)? as u8),
            Version::ConnectingCap => None,
        }
    }

    /// What was stored counts from now on.
    pub(super) fn restart(&mut self) {
        self.show_switches();
        self.bit_rate = self.objects.value(0x2001, 0).unwrap_or(0) as u8;
        self.measure = Measure::of(&self.objects);
        let offset = self.objects.value(0x6509, 0).unwrap_or(0) as u32;
        self.offset = u64::from(offset) % self.measure.modulus();
        self.stale = true;
    }

    /// 1008h…100Ah, as far as they can be read in four bytes.
    pub(super) fn show_texts(&mut self) {
        if self.policies.texts != Texts::Cut {
            return;
        }
        for index in 0x1008..=0x100A {
            if let Some(row) = self.objects.row(index, 0) {
                let text = self.objects.bytes(row).to_vec();
                self.objects.set_bytes(row, &text[..text.len().min(4)]);
            }
        }
    }

    /// What is written to 2000h and 2001h has no effect on a connecting cap: its switches win
    /// (crn S1, S26).
    fn show_switches(&mut self) {
        if self.version == Version::ConnectingCap {
            let Commissioned { bit_rate, .. } = self.commissioned;
            let id = self.objects.value(0x100B, 0).unwrap_or(1);
            self.objects.put(0x2000, 0, id);
            self.objects.put(0x2001, 0, bit_rate.into());
        }
    }

    // ---- objects ----

    pub(super) fn check_read(&self, row: Row) -> Result<(), AbortCode> {
        let index = self.objects.entry(row).address.index;
        match index {
            0x1008..=0x100A if self.policies.texts == Texts::Refused => {
                Err(AbortCode::UnsupportedAccess)
            }
            _ => Ok(()),
        }
    }

    pub(super) fn check_write(
        &self,
        row: Row,
        value: i64,
        origin: Origin,
    ) -> Result<(), AbortCode> {
        let address = self.objects.entry(row).address;
        self.tampering.check_write(address, origin)?;
        let Measure { resolution, .. } = self.measure;
        let disc = Measure {
            parameters: 0,
            ..self.measure
        };
        let resolves = |most: u64| self.policies.scales_beyond_disc || value as u64 <= most;
        let is_fine = match (address.index, address.sub) {
            // Not while its cause is there (crn S2).
            (0x1003, 0) if self.has_cause() => return Err(AbortCode::DeviceState),
            (0x1010 | 0x1011, 1) if self.errors.has(EncoderError::Eeprom) => {
                return Err(AbortCode::Hardware);
            }
            (0x1800 | 0x1802, 2) => value != 255 || self.policies.takes_type_255,
            // Crn S25.
            (0x6000, 0) => matches!(value, 0 | 1 | 4 | 5),
            // Nothing can be measured in steps of which none makes a turn.
            (0x6001, 0) => value != 0 && resolves(resolution.into()),
            (0x6002, 0) => value != 0 && resolves(disc.modulus()),
            (0x6003, 0) => self.policies.preset_wraps || (value as u64) < self.measure.modulus(),
            _ => true,
        };
        is_fine.then_some(()).ok_or(AbortCode::InvalidValue)
    }

    /// Whether an error is there that lasts by itself.
    fn has_cause(&self) -> bool {
        let mut errors = self.errors.clone();
        errors.set(EncoderError::Communication, false);
        errors.any()
    }

    pub(super) fn written(&mut self, row: Row) {
        match self.objects.entry(row).address.index {
            0x1003 => self.errors.set(EncoderError::Communication, false),
            0x2000 | 0x2001 => self.show_switches(),
            0x6000..=0x6002 => self.measure_otherwise(),
            0x6003 => self.take_preset(),
            _ => {}
        }
        self.stale = true;
    }

    /// A change of code sequence, steps per turn or range deletes the preset (crn S40, S31).
    fn measure_otherwise(&mut self) {
        let measure = Measure::of(&self.objects);
        if measure != self.measure {
            self.measure = measure;
            self.objects.put(0x6003, 0, 0);
            self.shift(0);
        }
    }

    /// The present position is the preset from now on (crn S40, S31).
    fn take_preset(&mut self) {
        let preset = self.objects.value(0x6003, 0).unwrap_or(0) as u32;
        let unshifted = self.measure.unshifted(self.shaft.position());
        self.shift(self.measure.offset(unshifted, preset));
    }

    /// 6509h, which is stored with the rest (crn S9, S21).
    fn shift(&mut self, offset: u64) {
        self.offset = offset;
        self.objects.put(0x6509, 0, offset as i64);
    }

    /// Brings the objects up to date.
    pub(super) fn publish(&mut self) {
        let unshifted = self.measure.unshifted(self.shaft.position());
        let position = self.measure.position(unshifted, self.offset);
        let objects = &mut self.objects;
        let limit = |index| objects.value(index, 1).unwrap_or(0);
        let (low, high) = (limit(0x6401), limit(0x6402));
        let area = work_area(position, low, high, self.policies.limit_is_outside);
        objects.put(0x6004, 0, position.into());
        objects.put(0x6400, 1, area.into());
        // The same bits as 6000h (crn S27, S37).
        objects.put(0x6500, 0, self.measure.parameters.into());
        objects.put(0x6503, 0, self.errors.alarms().into());
    }

    /// Whether the position is sent by the clock, not when it changes (crn S18, S31).
    pub(super) fn sends_by_clock(&self) -> bool {
        self.objects.value(0x6200, 0).unwrap_or(0) > 0
    }
}
