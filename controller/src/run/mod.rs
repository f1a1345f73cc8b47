//! Drives the controller: in virtual time or in real time, over simulated or real buses.
//!
//! - [`virtual_time`]: as fast as the CPU allows, deterministic
//! - [`real_time`]: on the host's clock
//! - [`recorder`]: what a run leaves: summary, violations, trace, report
//! - [`frames`]: what the simulated buses carried: hash, utilisation

pub mod deviation;
pub mod frames;
pub mod real_time;
pub mod recorder;
pub mod virtual_time;

use crate::control::{Controller, Wake};
use crate::port::{Outbox, Port, PortError};
use crate::program::COORDINATES;
use syncline_canopen::Instant;

/// A bus whose interface failed.
type Failure = (usize, PortError);

/// Hands the controller everything that its buses received until `now`: once a cycle, before the
/// wake-up for the setpoints.
fn receive<P: Port>(
    controller: &mut Controller<COORDINATES>,
    ports: &mut [P],
    now: Instant,
) -> Result<(), Failure> {
    for (bus, port) in ports.iter_mut().enumerate() {
        port.advance_to(now);
        let received = port.receive(&mut |received| controller.receive(bus, &received));
        received.map_err(|error| (bus, error))?;
    }
    Ok(())
}

/// Wakes the controller and sends what it wants sent. Nothing stands in front of SYNC.
fn wake<P: Port>(
    controller: &mut Controller<COORDINATES>,
    ports: &mut [P],
    outboxes: &mut [Outbox],
    now: Instant,
) -> Result<(), Failure> {
    outboxes.iter_mut().for_each(Outbox::clear);
    ports.iter_mut().for_each(|port| port.advance_to(now));
    controller.wake(now, outboxes);
    for (bus, (port, outbox)) in ports.iter_mut().zip(&*outboxes).enumerate() {
        if let Some(sync) = &outbox.sync {
            port.send_sync(sync).map_err(|error| (bus, error))?;
        }
    }
    for (bus, (port, outbox)) in ports.iter_mut().zip(&*outboxes).enumerate() {
        let burst = outbox.burst.as_slice();
        if !burst.is_empty() {
            let sent = port.send_burst(burst).map_err(|error| (bus, error))?;
            controller.burst_sent(bus, burst.len(), sent, port.echoes());
        }
        let acyclic = outbox.acyclic.as_slice();
        if !acyclic.is_empty() {
            port.send_acyclic(acyclic).map_err(|error| (bus, error))?;
        }
    }
    Ok(())
}

/// Whether this wake-up supervises and sends setpoints.
fn is_setpoint(wake: Wake) -> bool {
    matches!(wake, Wake::Setpoint(_))
}
