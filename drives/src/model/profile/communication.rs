//! Communication as CiA 301 has it for every device.

use crate::model::{Data, Heartbeat, Write};
use core::time::Duration;

/// The device's own heartbeat (1017h) and its watch on the controller's (1016h:1).
pub(in crate::model) fn heartbeats(heartbeat: &Heartbeat) -> [Write; 2] {
    let ms = |time: Duration| time.as_millis().min(u16::MAX.into()) as u16;
    let watch = u32::from(heartbeat.controller.get()) << 16 | u32::from(ms(heartbeat.consumer));
    [
        Write::new(0x1017, 0, Data::u16(ms(heartbeat.producer))),
        Write::new(0x1016, 1, Data::u32(watch)),
    ]
}

/// What a set-up leaves behind: the last value of each object but those that are commands, not
/// settings.
pub(in crate::model) fn read_back(setup: &[Write], is_command: fn(&Write) -> bool) -> Vec<Write> {
    let mut read_back: Vec<Write> = Vec::new();
    for write in setup {
        read_back.retain(|earlier| earlier.address != write.address);
        if !is_command(write) {
            read_back.push(*write);
        }
    }
    read_back
}

/// Whether `read` is what `written` set. Of a PDO's COB-ID a device keeps bit 31 and bits 10…0; it
/// may report the others as it likes (lxm32m 3528-3536).
pub(in crate::model) fn agrees(written: &Write, read: &[u8]) -> bool {
    let kept = match written.address.index {
        0x1400..=0x15FF | 0x1800..=0x19FF if written.address.sub == 1 => 0x8000_07FF,
        _ => u32::MAX,
    };
    read.len() == written.data.bytes().len() && {
        let mut bytes = [0; 4];
        bytes[..read.len()].copy_from_slice(read);
        u32::from_le_bytes(bytes) & kept == written.data.bits() & kept
    }
}
