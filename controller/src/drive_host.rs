//! Simulated drives on a real bus: twins on a bus that others reach, on the host's clock.

use crate::port::PortError;
use crate::port::wire::Wire;
use crate::realtime;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use syncline_canopen::{Frame, Instant, Transmit};
use syncline_drives::bus::Node;

/// Longest sleep, so that a stop is seen.
const LOOK_UP: Duration = Duration::from_millis(50);

/// Lets `nodes`, switched on now, live on `bus` until `stop` is set.
///
/// # Errors
/// The interface cannot be used (any longer).
pub fn host<N: Node>(
    bus: &mut dyn Wire,
    nodes: &mut [N],
    stop: &AtomicBool,
) -> Result<(), PortError> {
    let mut answers: Vec<Frame> = Vec::with_capacity(64);
    let start = realtime::now();
    // The nodes' time: from their start, and never backwards.
    let mut latest = Instant::ZERO;
    let mut own_time = |at: Instant| {
        latest = latest.max(Instant::ZERO + at.saturating_since(start));
        latest
    };
    while !stop.load(Ordering::Relaxed) {
        let now = own_time(realtime::now());
        let deadline = nodes.iter().filter_map(Node::deadline).min();
        let wait = deadline.map_or(LOOK_UP, |due| due.saturating_since(now).min(LOOK_UP));
        bus.wait(wait)?;
        while bus.receive(&mut |at, frame| {
            let at = own_time(at);
            for node in &mut *nodes {
                live_until(node, at, &mut answers);
                node.on_frame(at, frame, &mut answers);
            }
        })? {
            bus.send(&mut answers)?;
        }
        let now = own_time(realtime::now());
        for node in &mut *nodes {
            live_until(node, now, &mut answers);
        }
        bus.send(&mut answers)?;
    }
    Ok(())
}

/// Lets a node do all that was due until `now`, each at its own instant.
fn live_until<N: Node>(node: &mut N, now: Instant, tx: &mut dyn Transmit) {
    while let Some(due) = node.deadline().filter(|due| *due <= now) {
        node.poll(due, tx);
    }
}
