//! When a frame arrived, by the kernel's stamp.
//!
//! A frame that is stamped when it is read says when its reader had time. What matters is when it
//! came: a T_PDO from before SYNC that is read after it answers no new SYNC. The kernel stamps what
//! comes in, on CLOCK_REALTIME, which somebody may set meanwhile; the controller counts on
//! CLOCK_MONOTONIC. What is certain whatever the clocks did: what is read now came no later than now, and no
//! earlier than the socket was last found empty. A stamp is moved by how far the clocks are apart now; where that leads
//! out of what is certain, it was made before a step, and is moved by how far they were apart when the socket was empty.
//! Without that each step had a burst counted as late whose echoes were on their way, and three in a thousand cycles
//! stopped the machine; the clock of an adapter that stamps by itself, which is set by these, was off for hours.

use crate::realtime;
use syncline_canopen::Instant;

/// The arrivals at one socket.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arrivals {
    /// When the socket was last asked in vain.
    empty: Instant,
    /// How far CLOCK_REALTIME was ahead of CLOCK_MONOTONIC then, ns.
    offset: u64,
}

/// What has been read by now.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reading {
    since: Arrivals,
    now: Instant,
    /// How far CLOCK_REALTIME is ahead now, ns.
    offset: u64,
}

impl Arrivals {
    /// At a socket that is opened now.
    pub(super) fn new() -> Self {
        Self {
            empty: realtime::now(),
            offset: realtime::wall_clock_offset(),
        }
    }

    /// The socket, asked at `at`, had nothing more.
    pub(super) fn found_empty(&mut self, at: Instant) {
        self.empty = at;
        self.offset = realtime::wall_clock_offset();
    }

    /// Something has been read, just now.
    pub(super) fn read(&self) -> Reading {
        Reading {
            since: *self,
            offset: realtime::wall_clock_offset(),
            now: realtime::now(),
        }
    }
}

impl Reading {
    /// When a frame with this stamp, in nanoseconds of CLOCK_REALTIME, arrived on CLOCK_MONOTONIC. Without a stamp it is
    /// now.
    pub(super) fn at(&self, stamp: Option<u64>) -> Instant {
        let Some(stamp) = stamp else { return self.now };
        // What was before the start of CLOCK_MONOTONIC has wrapped round.
        let moved = |offset| match stamp.wrapping_sub(offset) {
            nanos if nanos > u64::MAX / 2 => Instant::ZERO,
            nanos => Instant::from_nanos(nanos),
        };
        let at = moved(self.offset);
        let certain = self.since.empty..=self.now;
        let before = moved(self.since.offset);
        if !certain.contains(&at) && certain.contains(&before) {
            return before;
        }
        at.min(self.now).max(self.since.empty)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Far from the start of either clock.
    const START: u64 = 1_000_000_000_000_000;

    fn reading(empty: u64, now: u64, offsets: [u64; 2]) -> Reading {
        let since = Arrivals {
            empty: Instant::from_nanos(empty),
            offset: offsets[0],
        };
        Reading {
            since,
            now: Instant::from_nanos(now),
            offset: offsets[1],
        }
    }

    #[test]
    fn without_a_stamp_it_is_now() {
        let now = Instant::from_nanos(2000);
        assert_eq!(reading(1000, 2000, [0; 2]).at(None), now);
    }

    proptest! {
        /// The clock is set, forward or back, before or behind the arrival, or runs a little faster: the arrival is found
        /// again, and whatever stands in a stamp, it lies between what is certain.
        #[test]
        fn an_arrival_is_found_whenever_the_clock_is_set(
            apart in 1_u64..50_000_000,
            came in 0.0..1.0,
            set in 0.0..1.0,
            step in prop_oneof![-10_000_000_000_000_i64..10_000_000_000_000, Just(0)],
            anything: u64,
        ) {
            let after = |part: f64| START + (apart as f64 * part) as u64;
            let (came, set, offset) = (after(came), after(set), START);
            let stepped = offset.wrapping_add_signed(step);
            let stamp = came + if came < set { offset } else { stepped };
            let reading = reading(START, START + apart, [offset, stepped]);
            let found = reading.at(Some(stamp)).as_nanos();
            // A step within what is certain cannot be told from a later or an earlier arrival.
            let doubt = if step.unsigned_abs() <= apart { step.unsigned_abs() } else { 0 };
            prop_assert!(found.abs_diff(came) <= doubt, "{found} for {came}");
            let [least, most] = [START, START + apart].map(Instant::from_nanos);
            let any = reading.at(Some(anything));
            prop_assert!((least..=most).contains(&any), "{any:?}");
        }
    }
}
