//! Communication as CiA 301 has it for every device.

use crate::model::{Assumed, Assumption, Data, Heartbeat, Monitoring, Write};
use core::time::Duration;
use syncline_canopen::budget::{Direction, Pdo};
use syncline_canopen::{CobId, NodeId};

/// How fast a device answers SYNC.
pub(in crate::model) const T_PDO_RESPONSE: Assumption = Assumption {
    name: "t_pdo_response_us",
    default: 100,
    allowed: 0..=1_000_000,
    meaning: "longest time in µs from the end of SYNC until the drive queues its T_PDO",
};

/// How fast a device answers an SDO request.
pub(in crate::model) const SDO_RESPONSE: Assumption = Assumption {
    name: "sdo_response_us",
    default: 1000,
    allowed: 0..=1_000_000,
    meaning: "longest time in µs from the end of an SDO request until the drive queues its answer",
};

/// Both, of a device that takes so many microseconds at most.
pub(in crate::model) const fn responses(t_pdo: u32, sdo: u32) -> [Assumption; 2] {
    let t_pdo = Assumption {
        default: t_pdo,
        ..T_PDO_RESPONSE
    };
    let sdo = Assumption {
        default: sdo,
        ..SDO_RESPONSE
    };
    [t_pdo, sdo]
}

/// The device's own heartbeat (1017h) and its watch on the controller's (1016h:1).
pub(in crate::model) fn heartbeats(heartbeat: &Heartbeat) -> [Write; 2] {
    let watch = u32::from(heartbeat.controller.get()) << 16 | u32::from(millis(heartbeat.consumer));
    [
        Write::new(0x1017, 0, Data::u16(millis(heartbeat.producer))),
        Write::new(0x1016, 1, Data::u32(watch)),
    ]
}

/// Whether a device has a heartbeat.
pub(in crate::model) const HAS_HEARTBEAT: Assumption = Assumption {
    name: "has_heartbeat",
    default: 1,
    allowed: 0..=1,
    meaning: "1: it sends a heartbeat (1017h) and watches the controller's (1016h:1); 0: it has neither, see has_guarding",
};

/// Whether a device without a heartbeat is guarded instead.
pub(in crate::model) const HAS_GUARDING: Assumption = Assumption {
    name: "has_guarding",
    default: 0,
    allowed: 0..=1,
    meaning: "1: without a heartbeat it is guarded by remote requests, and notices when they stay away (100Ch, 100Dh); \
              0: it shows by its T_PDOs alone that it is there, and does not notice that the controller is gone",
};

/// Requests in the time after which a guarded device is lost, and loses the controller (100Dh). One of them may get lost,
/// and the next answer with it, whose toggle bit does not follow.
const LIFE_TIME_FACTOR: u8 = 4;

/// By what a device shows that it is there, by what is assumed of it.
pub(in crate::model) fn monitoring(assumed: &Assumed, heartbeat: &Heartbeat) -> Monitoring {
    if assumed.value(&HAS_HEARTBEAT) != 0 {
        Monitoring::Heartbeat
    } else if assumed.value(&HAS_GUARDING) != 0 {
        // In whole milliseconds, as 100Ch counts.
        let millis = heartbeat.consumer.as_millis() as u64 / u64::from(LIFE_TIME_FACTOR);
        Monitoring::Guarding {
            every: Duration::from_millis(millis.max(1)),
        }
    } else {
        Monitoring::TPdos
    }
}

/// What a device has to be set to for that: its heartbeats, or the times of its guarding.
pub(in crate::model) fn supervision(monitoring: Monitoring, heartbeat: &Heartbeat) -> Vec<Write> {
    match monitoring {
        Monitoring::Heartbeat => heartbeats(heartbeat).to_vec(),
        Monitoring::Guarding { every } => vec![
            Write::new(0x100C, 0, Data::u16(millis(every))),
            Write::new(0x100D, 0, Data::u8(LIFE_TIME_FACTOR)),
        ],
        Monitoring::TPdos | Monitoring::Poll(_) => Vec::new(),
    }
}

/// Takes life guarding back, so that a device that is switched off does not miss the controller.
pub(in crate::model) fn end_of_supervision(monitoring: Monitoring) -> Vec<Write> {
    match monitoring {
        Monitoring::Guarding { .. } => vec![Write::new(0x100C, 0, Data::u16(0))],
        Monitoring::Heartbeat | Monitoring::TPdos | Monitoring::Poll(_) => Vec::new(),
    }
}

/// As 100Ch, 1016h and 1017h have it.
fn millis(time: Duration) -> u16 {
    time.as_millis().min(u16::MAX.into()) as u16
}

/// The device's T_PDO with that number, at its identifier of the predefined connection set.
pub(in crate::model) fn t_pdo(number: u8, node: NodeId, bytes: u8) -> Pdo {
    Pdo {
        direction: Direction::Transmit,
        cob_id: CobId::t_pdo(number, node),
        bytes,
    }
}

/// The same of an R_PDO.
pub(in crate::model) fn r_pdo(number: u8, node: NodeId, bytes: u8) -> Pdo {
    Pdo {
        direction: Direction::Receive,
        cob_id: CobId::r_pdo(number, node),
        bytes,
    }
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
