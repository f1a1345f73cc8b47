//! What a CAN controller reports of its own bus, and what the machine does about it.

use std::fmt;

/// A condition on the bus that the adapter reported in an error frame, or the kernel beside one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusFault {
    /// The adapter counted 256 transmit errors and left the bus (ISO 11898-1, bus off).
    BusOff,
    /// More than 127 errors: the adapter may no longer signal errors to others.
    ErrorPassive,
    /// More than 96 errors.
    ErrorWarning,
    /// The adapter or the kernel had no room for a received frame.
    ReceiveOverrun,
    /// The adapter had no room for a frame to send.
    TransmitOverrun,
    /// The driver gave up on a frame that did not leave.
    TransmitTimeout,
    /// Nobody acknowledged a frame: the controller is alone on the bus.
    NoAcknowledge,
    /// Another frame won the arbitration; the adapter repeats ours.
    ArbitrationLost,
    /// A frame was damaged: bit, stuff, form or checksum error.
    Damaged,
    /// The adapter restarted after bus off; what it had queued is lost.
    Restarted,
}

/// What the machine does about a [`BusFault`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// Counted; what it costs shows as a late setpoint or a missing T_PDO.
    Count,
    /// Counted and told.
    Warn,
    /// The bus still carries frames, and may not for long: a coordinated stop, and all drives are
    /// disabled in order.
    Stop,
    /// The bus carries nothing, or what was queued is lost: the interface failed. A coordinated
    /// stop; drives that cannot be reached any longer are not waited for.
    Lose,
}

impl BusFault {
    /// Every fault, in the order of [`FaultCounts`].
    pub const ALL: [Self; 10] = [
        Self::BusOff,
        Self::ErrorPassive,
        Self::ErrorWarning,
        Self::ReceiveOverrun,
        Self::TransmitOverrun,
        Self::TransmitTimeout,
        Self::NoAcknowledge,
        Self::ArbitrationLost,
        Self::Damaged,
        Self::Restarted,
    ];

    /// What the machine does about it.
    #[must_use]
    pub const fn severity(self) -> Severity {
        match self {
            Self::BusOff | Self::TransmitTimeout | Self::Restarted => Severity::Lose,
            Self::ErrorPassive => Severity::Stop,
            Self::ErrorWarning => Severity::Warn,
            Self::ReceiveOverrun
            | Self::TransmitOverrun
            | Self::NoAcknowledge
            | Self::ArbitrationLost
            | Self::Damaged => Severity::Count,
        }
    }
}

impl fmt::Display for BusFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::BusOff => {
                "bus off, check cable, termination and bit rate, then `sudo ip link set DEV type can restart`"
            }
            Self::ErrorPassive => "error passive, check cable, termination and bit rate",
            Self::ErrorWarning => "error warning",
            Self::ReceiveOverrun => "receive overrun",
            Self::TransmitOverrun => "transmit overrun",
            Self::TransmitTimeout => "a frame did not leave the adapter in time",
            Self::NoAcknowledge => "no other node acknowledges",
            Self::ArbitrationLost => "arbitration lost",
            Self::Damaged => "damaged frame",
            Self::Restarted => "the adapter restarted, queued frames are lost",
        })
    }
}

/// How often each fault was seen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FaultCounts([u64; BusFault::ALL.len()]);

impl FaultCounts {
    /// One more of `fault`, or several at once.
    pub(crate) fn add(&mut self, fault: BusFault, times: u64) {
        self.0[fault as usize] += times;
    }

    /// Each fault that was seen, with its count.
    pub fn seen(&self) -> impl Iterator<Item = (BusFault, u64)> + '_ {
        BusFault::ALL
            .into_iter()
            .zip(self.0)
            .filter(|&(_, count)| count > 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stops_the_machine() {
        assert_eq!(BusFault::BusOff.severity(), Severity::Lose);
        assert_eq!(BusFault::ErrorPassive.severity(), Severity::Stop);
        assert_eq!(BusFault::ErrorWarning.severity(), Severity::Warn);
        assert_eq!(BusFault::ArbitrationLost.severity(), Severity::Count);
    }

    #[test]
    fn counts_keep_the_faults_apart() {
        let mut counts = FaultCounts::default();
        for (times, fault) in BusFault::ALL.into_iter().enumerate() {
            counts.add(fault, times as u64);
        }
        let seen: Vec<u64> = counts.seen().map(|(_, count)| count).collect();
        assert_eq!(seen, (1..10).collect::<Vec<u64>>());
    }
}
