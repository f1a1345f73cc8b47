//! Simulated devices on a bus that others reach, on the host's clock.

use crate::port::PortError;
use crate::port::wire::Wire;
use crate::realtime;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use syncline_canopen::{Frame, Instant};
use syncline_drives::bus::BusNode;
use syncline_drives::world::Hosted;

/// Longest sleep, so that a stop is seen.
const LOOK_UP: Duration = Duration::from_millis(50);

/// Lets `devices`, switched on at `start`, live on `bus` until `stop` is set. The buses of a machine have one `start`, so that
/// what their devices do over time goes together.
///
/// # Errors
/// The interface cannot be used (any longer).
pub fn host(
    bus: &mut dyn Wire,
    devices: &mut Hosted,
    start: Instant,
    stop: &AtomicBool,
) -> Result<(), PortError> {
    let mut answers: Vec<Frame> = Vec::with_capacity(64);
    // The devices' time: from their start, and never backwards.
    let mut latest = Instant::ZERO;
    let mut own_time = |at: Instant| {
        latest = latest.max(Instant::ZERO + at.saturating_since(start));
        latest
    };
    while !stop.load(Ordering::Relaxed) {
        let now = own_time(realtime::now());
        let wait =
            (devices.deadline()).map_or(LOOK_UP, |due| due.saturating_since(now).min(LOOK_UP));
        bus.wait(wait)?;
        while bus.receive(&mut |at, frame| {
            let at = own_time(at);
            devices.on_frame(at, frame, &mut answers);
        })? {
            bus.send(&mut answers)?;
        }
        let now = own_time(realtime::now());
        devices.live_until(now, &mut answers);
        bus.send(&mut answers)?;
    }
    Ok(())
}
