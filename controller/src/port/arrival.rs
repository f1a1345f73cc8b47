//! When a frame arrived, by the kernel's stamp.
//!
//! A frame that is stamped when it is read says when its reader had time. What matters is when it
//! came: a T_PDO from before SYNC that is read after it answers no new SYNC. The kernel stamps what
//! comes in, on CLOCK_REALTIME, which somebody may set meanwhile; the controller counts on
//! CLOCK_MONOTONIC. So a stamp is moved by how far the clocks are apart now, and then kept within
//! what is certain whatever the clocks did: what is read now came no later than now, and no
//! earlier than the socket was last found empty.

use crate::realtime;
use nix::sys::time::TimeSpec;
use syncline_canopen::Instant;

/// The arrivals at one socket.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arrivals {
    /// When the socket was last asked in vain.
    empty: Instant,
}

impl Arrivals {
    /// At a socket that is opened now.
    pub(super) fn new() -> Self {
        Self {
            empty: realtime::now(),
        }
    }

    /// The socket, asked at `at`, had nothing.
    pub(super) fn found_empty(&mut self, at: Instant) {
        self.empty = at;
    }

    /// When what has been read now arrived, on CLOCK_MONOTONIC. Without a stamp it is now.
    pub(super) fn at(&self, stamp: Option<TimeSpec>) -> Instant {
        let now = realtime::now();
        let Some(stamp) = stamp else { return now };
        let wall = stamp.tv_sec() as u64 * 1_000_000_000 + stamp.tv_nsec() as u64;
        self.bounded(wall.wrapping_sub(realtime::wall_clock_offset()), now)
    }

    /// The instant, in nanoseconds, between the last time that nothing was there and now. Anything
    /// before the start of CLOCK_MONOTONIC has wrapped round.
    fn bounded(&self, nanos: u64, now: Instant) -> Instant {
        let at = if nanos > u64::MAX / 2 { 0 } else { nanos };
        Instant::from_nanos(at).min(now).max(self.empty)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_arrival_lies_between_what_is_certain() {
        let at = Instant::from_nanos;
        let mut arrivals = Arrivals { empty: at(1000) };
        for (stamped, arrived) in [
            (1500, 1500),
            // The clock was set forward, or back, while the frame waited.
            (3, 1000),
            (0_u64.wrapping_sub(5), 1000),
            (9_000_000, 2000),
        ] {
            assert_eq!(arrivals.bounded(stamped, at(2000)), at(arrived));
        }
        arrivals.found_empty(at(1800));
        assert_eq!(arrivals.bounded(1500, at(2000)), at(1800));
    }
}
