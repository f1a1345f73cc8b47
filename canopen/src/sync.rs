//! SYNC (CiA 301): the beat of synchronous PDOs, with a counter where a device takes one.

use crate::{CanId, CobId, Frame, Instant, Transmit, time::Duration};

/// A SYNC that was received.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Sync {
    /// The counter, 1 up to its overflow value, if the producer sends one.
    pub counter: Option<u8>,
}

impl Sync {
    /// The SYNC that a frame on `cob_id` is.
    #[must_use]
    pub fn decode(frame: &Frame, cob_id: CobId) -> Option<Self> {
        (frame.id() == CanId::from(cob_id) && !frame.is_remote()).then(|| Self {
            counter: frame.data().first().copied(),
        })
    }
}

/// Sends SYNC at a fixed pace (1005h, 1006h, 1019h).
#[derive(Clone, Debug)]
pub struct Producer {
    cob_id: CobId,
    period: Duration,
    /// The counter's overflow value, 2…240; 0 is a SYNC without counter.
    overflow: u8,
    counter: u8,
    next: Option<Instant>,
}

impl Producer {
    /// A producer that is still off; `overflow` 2…240 makes it count, anything else does not.
    #[must_use]
    pub const fn new(cob_id: CobId, period: Duration, overflow: u8) -> Self {
        Self {
            cob_id,
            period,
            overflow: if overflow >= 2 && overflow <= 240 {
                overflow
            } else {
                0
            },
            counter: 0,
            next: None,
        }
    }

    /// Starts with the first SYNC at `at`; the counter starts at 1.
    pub fn start(&mut self, at: Instant) {
        self.counter = 0;
        self.next = Some(at);
    }

    /// Stops.
    pub fn stop(&mut self) {
        self.next = None;
    }

    /// When the next SYNC is due.
    #[must_use]
    pub const fn deadline(&self) -> Option<Instant> {
        self.next
    }

    /// Sends the SYNC that is due, and returns it; missed ones are not made up for.
    pub fn poll(&mut self, now: Instant, tx: &mut (impl Transmit + ?Sized)) -> Option<Sync> {
        let due = self.next.filter(|&due| now >= due)?;
        let behind = now.saturating_since(due).as_nanos() / self.period.as_nanos().max(1);
        let periods = u32::try_from(behind).unwrap_or(u32::MAX).saturating_add(1);
        self.next = Some(due + self.period.max(Duration::from_nanos(1)) * periods);
        let counter = (self.overflow > 0).then(|| {
            self.counter = self.counter % self.overflow + 1;
            self.counter
        });
        tx.transmit(match counter {
            Some(counter) => Frame::new(self.cob_id, &[counter]),
            None => Frame::new(self.cob_id, &[]),
        });
        Some(Sync { counter })
    }
}
