//! What the CANopen node asks of the drive behind it.

use super::drive::Drive;
use super::fault::DriveError;
use crate::twin::node::Firmware;
use crate::twin::servo::errors::ServoError;
use crate::twin::servo::firmware::ServoFirmware;
use syncline_canopen::dictionary::{Dictionary, Row};
use syncline_canopen::emcy::{self, Emergency};
use syncline_canopen::node::{Application, CommunicationError, Origin};
use syncline_canopen::pdo::{CobIdWord, Mapped};
use syncline_canopen::sdo::AbortCode;
use syncline_canopen::sync::Sync;
use syncline_canopen::{Instant, nmt};

impl Application for Drive {
    fn objects(&self) -> &Dictionary {
        &self.objects
    }

    fn objects_mut(&mut self) -> &mut Dictionary {
        &mut self.objects
    }

    fn refresh(&mut self, now: Instant, row: Option<Row>) {
        // What can be written is what was written.
        let settled = row.is_some_and(|row| self.objects.entry(row).access.writable());
        if settled || !core::mem::take(&mut self.servo.stale) {
            return;
        }
        if row.is_none() && self.tells_little() {
            self.publish_mapped(now);
        } else {
            self.publish(now);
        }
    }

    fn check_write(&self, row: Row, value: i64, origin: Origin) -> Result<(), AbortCode> {
        let address = self.objects.entry(row).address;
        self.servo.tampering.check_write(address, origin)?;
        Drive::check_write(self, row, value, origin)
    }

    fn written(&mut self, _: Instant, row: Row, origin: Origin) {
        self.servo.stale = true;
        if origin == Origin::Sdo {
            self.tells_little = None;
        }
        Drive::written(self, row, origin);
    }

    fn on_sync(&mut self, now: Instant, _: Sync) {
        self.servo.stale = true;
        Drive::on_sync(self, now);
    }

    fn on_nmt(&mut self, _: Instant, event: nmt::Event) {
        if !self.is_powered() {
            return;
        }
        match event {
            nmt::Event::Entered(nmt::State::Stopped) => self.raise(DriveError::NMT_STOP),
            nmt::Event::Entered(_) => {}
            // D-25: Reset Node, which includes Reset Communication, is an error like it.
            nmt::Event::ResetNode | nmt::Event::ResetCommunication => {
                self.raise(DriveError::NMT_RESET);
            }
        }
    }

    fn on_reset(&mut self, _: Instant, reset: nmt::Event) {
        if reset == nmt::Event::ResetNode {
            self.restart();
        }
        self.identify();
        self.tells_little = None;
        // D-23: the default printed is 1, but there is no error.
        self.objects.put(0x1003, 0, 0);
    }

    fn on_communication_error(
        &mut self,
        _: Instant,
        error: CommunicationError,
    ) -> Option<Emergency> {
        match error {
            CommunicationError::ShortPdo(number) => {
                self.policies.emcy_on_short_pdo.then(|| Emergency {
                    vendor: [0, 0, number as u8, 0, 0],
                    ..DriveError::SHORT_PDO.emergency()
                })
            }
            CommunicationError::Heartbeat(_) | CommunicationError::LifeGuarding => {
                // 3041h:11 (lxm32m 2723) as its error class.
                let response = self.objects.get(self.rows.connection_response);
                self.raise(DriveError::CONNECTION_LOST.of_class(response));
                None
            }
        }
    }

    fn next_emergency(&mut self) -> Option<Emergency> {
        self.servo.errors.next_emergency()
    }

    /// The vendor's number if the code says nothing (lxm32m 3045-3047).
    fn error_field_info(&self, emergency: &Emergency) -> u16 {
        let [.., low, high] = emergency.vendor;
        match emergency.code {
            emcy::code::GENERIC => u16::from_le_bytes([low, high]),
            _ => 0,
        }
    }

    fn next_event(&mut self) -> Option<Row> {
        core::mem::take(&mut self.status_event).then_some(self.rows.statusword)
    }

    /// 3041h:B…E (lxm32m 804-812).
    fn event_mask(&self, number: u16) -> u64 {
        let rows = &self.rows;
        let mask = match number {
            1 => rows.event_mask_1,
            2 => rows.event_mask_2,
            3 => rows.event_mask_3,
            _ => rows.event_mask_4,
        };
        self.objects.get(mask) as u64
    }
}

impl Drive {
    /// Whether no T_PDO that is sent tells more than [`Self::MAPPED`].
    fn tells_little(&mut self) -> bool {
        let objects = &self.objects;
        *self.tells_little.get_or_insert_with(|| {
            let value = |index, sub| objects.value(index, sub).unwrap_or(0);
            let is_sent = |pdo: &u16| CobIdWord(value(0x1800 + pdo, 1) as u32).is_valid();
            let rows = (0..4).filter(is_sent).flat_map(|pdo| {
                let count = value(0x1A00 + pdo, 0).clamp(0, 8) as u8;
                (1..=count).map(move |sub| (0x1A00 + pdo, sub))
            });
            let mut mapped = rows.map(|(index, sub)| Mapped::from(value(index, sub) as u32));
            mapped.all(|it| it.address.sub == 0 && Self::MAPPED.contains(&it.address.index))
        })
    }

    /// Writes who the drive is into its objects.
    pub(super) fn identify(&mut self) {
        let (objects, identity) = (&mut self.objects, &self.identity);
        for (index, sub, value) in [
            (0x1000, 0, identity.device_type),
            (0x1018, 1, identity.vendor_id),
            (0x1018, 2, identity.product_code),
            (0x1018, 3, identity.revision),
            (0x300D, 3, identity.encoder_type.into()),
        ] {
            objects.put(index, sub, value.into());
        }
        self.publish_figures();
        let (objects, identity) = (&mut self.objects, &self.identity);
        for (index, text) in [
            (0x1008, &identity.name),
            (0x1009, &identity.hardware),
            (0x100A, &identity.software),
        ] {
            if let Some(row) = objects.row(index, 0) {
                objects.set_bytes(row, format!("{text:<8}").as_bytes());
            }
        }
    }
}
