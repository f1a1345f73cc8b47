//! A controller on its buses: what one wake-up takes, in its three stages.

use super::cutting::Cutting;
use crate::bus::{Outbox, Received};
use crate::control::{Controller, Layout, Wake};
use crate::machine::{COORDINATES, Machine};
use crate::observe::flight_recorder::Carried;
use crate::port::{Port, PortError};
use rtrb::{Consumer, Producer, RingBuffer};
use std::sync::Arc;
use syncline_canopen::Instant;
use syncline_drives::world::{DeviceId, World};

/// Frames on their way to a flight recorder.
const CARRIED: usize = 16_384;

/// A controller with its ports. Nothing allocates after construction.
pub struct Driver<const N: usize, P> {
    /// The controller.
    pub controller: Controller<N>,
    /// One a bus.
    pub ports: Vec<P>,
    /// Where the simulated buses are.
    pub world: World,
    outboxes: Vec<Outbox>,
    /// What the last collection brought, by bus.
    inbox: Vec<(usize, Received)>,
    /// When it was woken last.
    woke: Instant,
    cutting: Option<Cutting>,
    tap: Option<Producer<Carried>>,
}

impl<P: Port> Driver<COORDINATES, P> {
    /// Its simulated tools cut as this machine's do, from now on.
    pub(super) fn cut(&mut self, machine: &Machine, layout: &Layout) {
        self.cutting = Cutting::new(machine, &self.twins(layout));
    }

    /// The tool pushes as it cuts at the last SYNC.
    pub(super) fn push_tool(&mut self) {
        if let Some(cutting) = &mut self.cutting {
            cutting.push(&self.controller, &mut self.world);
        }
    }

    /// No tool pushes any more.
    pub(super) fn leave_tool(&mut self) {
        if let Some(cutting) = &self.cutting {
            cutting.leave(&mut self.world);
        }
    }
}

impl<const N: usize, P: Port> Driver<N, P> {
    /// A machine on its buses, one port for each, that is switched on at `start`; simulated ones
    /// are in `world`.
    #[must_use]
    pub fn new(layout: Arc<Layout>, world: World, ports: Vec<P>, start: Instant) -> Self {
        Self {
            outboxes: vec![Outbox::default(); ports.len()],
            inbox: Vec::with_capacity(8 * layout.devices.len() + 64),
            controller: Controller::new(layout, start),
            ports,
            world,
            woke: start,
            cutting: None,
            tap: None,
        }
    }

    /// For each device of the machine its twin, where that is simulated.
    pub(super) fn twins(&self, layout: &Layout) -> Vec<Option<DeviceId>> {
        let twins = layout.devices.iter().map(|device| {
            let bus = self.ports[device.bus].simulated()?;
            self.world.find(bus, device.device.spec().node)
        });
        twins.collect()
    }

    /// The frames that the controller receives and sends from now on. Those that find no room are left out.
    pub fn tap(&mut self) -> Consumer<Carried> {
        let (tap, carried) = RingBuffer::new(CARRIED);
        self.tap = Some(tap);
        carried
    }

    /// Whether the next wake-up supervises and sends setpoints.
    #[must_use]
    pub fn setpoints_are_next(&self) -> bool {
        matches!(self.controller.next_wake(), Some(Wake::Setpoint(_)))
    }

    /// Lets the simulated world live up to `now`, and before setpoints takes what has arrived: one
    /// receive call a bus and cycle, and nothing in front of SYNC.
    ///
    /// # Errors
    /// The interface of a bus failed; the controller has been told.
    pub fn collect(&mut self, now: Instant) -> Result<&[(usize, Received)], PortError> {
        self.inbox.clear();
        let receives = self.setpoints_are_next();
        let mut failed = None;
        self.world.advance_to(now);
        if !receives {
            return Ok(&self.inbox);
        }
        for (bus, port) in self.ports.iter_mut().enumerate() {
            port.exchange(&mut self.world);
            let inbox = &mut self.inbox;
            let received = port.receive(&mut |received| {
                // Beyond the capacity is a flooded bus: dropped like a full socket would.
                if inbox.len() < inbox.capacity() {
                    inbox.push((bus, received));
                }
            });
            if let Some(fault) = port.condition() {
                self.controller.bus_reports(bus, fault);
            }
            // The other buses have what the stop on the path needs.
            if let Err(error) = received {
                self.controller.bus_failed(bus);
                failed.get_or_insert(error);
            }
        }
        failed.map_or(Ok(&self.inbox), Err)
    }

    /// What the controller does at a wake-up, and nothing else: this is its compute time.
    pub fn compute(&mut self, now: Instant) {
        for (bus, received) in &self.inbox {
            self.controller.receive(*bus, received);
        }
        self.woke = now;
        self.outboxes.iter_mut().for_each(Outbox::clear);
        self.controller.wake(now, &mut self.outboxes);
    }

    /// Sends what the controller wants sent: SYNC of all buses before anything else. A bus that
    /// fails takes nothing from the others.
    ///
    /// # Errors
    /// The interface of a bus failed, the first one's error; the controller has been told.
    pub fn send(&mut self) -> Result<(), PortError> {
        let mut failed = Ok(());
        for bus in 0..self.ports.len() {
            if let Some(sync) = &self.outboxes[bus].sync
                && let Err(error) = self.ports[bus].send_sync(sync)
            {
                self.controller.bus_failed(bus);
                failed = failed.and(Err(error));
            }
        }
        for bus in 0..self.ports.len() {
            if let Err(error) = self.send_rest(bus) {
                self.controller.bus_failed(bus);
                failed = failed.and(Err(error));
            }
        }
        for port in &mut self.ports {
            port.exchange(&mut self.world);
        }
        self.record();
        failed
    }

    /// Tells whoever taps the buses what was received, and what is sent.
    fn record(&mut self) {
        let Some(tap) = &mut self.tap else { return };
        let received = self.inbox.drain(..).filter(|(_, it)| !it.echo);
        let received = received.map(|(bus, Received { at, frame, .. })| Carried { bus, at, frame });
        let outboxes = self.outboxes.iter().enumerate();
        let at = self.woke;
        let sent = outboxes.flat_map(|(bus, outbox)| {
            let frames = outbox.sync.iter().chain(outbox.burst.as_slice());
            let frames = frames.chain(outbox.acyclic.as_slice());
            frames.map(move |&frame| Carried { bus, at, frame })
        });
        for carried in received.chain(sent) {
            // Nobody waits for a recorder that is slow: what finds no room is left out.
            let _ = tap.push(carried);
        }
    }

    fn send_rest(&mut self, bus: usize) -> Result<(), PortError> {
        let (port, outbox) = (&mut self.ports[bus], &self.outboxes[bus]);
        let burst = outbox.burst.as_slice();
        if !burst.is_empty() {
            let sent = port.send_burst(burst)?;
            (self.controller).burst_sent(bus, burst.len(), sent, port.echoes());
        }
        let acyclic = outbox.acyclic.as_slice();
        if !acyclic.is_empty() {
            port.send_acyclic(acyclic)?;
        }
        Ok(())
    }

    /// One whole wake-up. All its stages take place even if a bus fails.
    ///
    /// # Errors
    /// The interface of a bus failed; the controller has been told.
    pub fn step(&mut self, now: Instant) -> Result<(), PortError> {
        let collected = self.collect(now).map(|_| ());
        self.compute(now);
        collected.and(self.send())
    }
}
