//! What SocketCAN's error frames say of the bus.

use crate::bus::BusFault;
use socketcan::errors::{CanError, ControllerProblems, ErrorCause};

/// The faults that an error frame reports.
pub(super) fn faults(error: &CanError) -> impl Iterator<Item = BusFault> + '_ {
    error.causes().filter_map(|cause| {
        Some(match cause {
            ErrorCause::BusOff => BusFault::BusOff,
            ErrorCause::TransmitTimeout => BusFault::TransmitTimeout,
            ErrorCause::NoAck => BusFault::NoAcknowledge,
            ErrorCause::LostArbitration(_) => BusFault::ArbitrationLost,
            ErrorCause::Protocol { .. } | ErrorCause::BusError | ErrorCause::Transceiver { .. } => {
                BusFault::Damaged
            }
            ErrorCause::Restarted => BusFault::Restarted,
            ErrorCause::Controller(problems) => of_controller(*problems)?,
            _ => return None,
        })
    })
}

/// The worst of what one status byte reports; none for the return to error active.
fn of_controller(problems: ControllerProblems) -> Option<BusFault> {
    use ControllerProblems as P;
    [
        (P::RX_PASSIVE | P::TX_PASSIVE, BusFault::ErrorPassive),
        (P::RX_OVERFLOW, BusFault::ReceiveOverrun),
        (P::TX_OVERFLOW, BusFault::TransmitOverrun),
        (P::RX_WARNING | P::TX_WARNING, BusFault::ErrorWarning),
    ]
    .into_iter()
    .find_map(|(bits, fault)| problems.intersects(bits).then_some(fault))
}

#[cfg(test)]
mod tests {
    use super::*;
    use socketcan::CanErrorFrame;

    fn decode(class: u32, data: &[u8]) -> Vec<BusFault> {
        let error = CanErrorFrame::new_error(class, data).unwrap().into_error();
        faults(&error).collect()
    }

    /// Class bits and data bytes of linux/can/error.h.
    #[test]
    fn error_frames_decode_to_typed_faults() {
        let cases: [(u32, &[u8], &[BusFault]); 12] = [
            (0x001, &[], &[BusFault::TransmitTimeout]),
            (0x002, &[7], &[BusFault::ArbitrationLost]),
            (0x004, &[0, 0x01], &[BusFault::ReceiveOverrun]),
            (0x004, &[0, 0x02], &[BusFault::TransmitOverrun]),
            (0x004, &[0, 0x0C], &[BusFault::ErrorWarning]),
            (0x004, &[0, 0x30], &[BusFault::ErrorPassive]),
            (0x004, &[0, 0x40], &[]),
            (0x008, &[0, 0, 0x04, 0x03], &[BusFault::Damaged]),
            (0x020, &[], &[BusFault::NoAcknowledge]),
            (0x040, &[], &[BusFault::BusOff]),
            (0x100, &[], &[BusFault::Restarted]),
            (
                0x024,
                &[0, 0x20],
                &[BusFault::ErrorPassive, BusFault::NoAcknowledge],
            ),
        ];
        for (class, data, faults) in cases {
            assert_eq!(decode(class, data), faults, "{class:03X} {data:02X?}");
        }
    }
}
