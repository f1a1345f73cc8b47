//! The simulated world: buses, devices and mechanics on one clock.
//!
//! A [`World`] owns every simulated bus of a machine with the devices on it, and the mechanics that
//! tie their shafts together. Whoever drives it says how far time goes
//! ([`World::advance_to`]); it then lets happen what happens, event by event over all buses in the
//! order of time, so that no bus runs ahead of another. There is one owner and no lock.
//!
//! A shaft that nothing couples moves with the speed loop of its own drive. Shafts that are
//! [coupled](Ties::couple) move on the world's grid: at each of its points every coupled device
//! runs its loops up to there, the mechanics take the loads of the step behind, and the shafts are
//! told where they are. In between a drive reads its shaft extrapolated; the error of that is
//! stated in [`mechanics`](crate::mechanics).
//!
//! Devices on a bus that others reach, another process or real ones, have no wire of this world:
//! [`Hosted`] is such a bus's share, with the same mechanics, and is a [`BusNode`] as a whole. Time goes as far in
//! it as who waits at the bus says.
//!
//! ```
//! use syncline_canopen::{CobId, Frame, Instant, NodeId};
//! use syncline_drives::bus::{Band, BitRate};
//! use syncline_drives::twin::cia402_csp::{Twin, TwinConfig};
//! use syncline_drives::world::World;
//!
//! let mut world = World::new();
//! let bus = world.add_bus(BitRate::from_kbit(1000).ok_or("bit rate")?, |_| ());
//! let node = NodeId::new(1).ok_or("node id")?;
//! let drive = world.attach(bus, Box::new(Twin::new(TwinConfig::new(node))));
//! world.send(bus, Band::Acyclic, Frame::new(CobId::NMT, &[0x01, 1]));
//! world.advance_to(Instant::ZERO);
//! world.advance_to(Instant::from_nanos(5_000_000));
//! println!("{:?}, {:?}", world.receive(bus), world.device(drive).observe());
//! # Ok::<(), &str>(())
//! ```

mod dc_link;
mod enable_chain;
mod probe;
mod ties;

use crate::bus::{Band, BitRate, BusNode, Received, SimBus, Transmission};
use crate::twin::SimulatedDevice;
use syncline_canopen::time::Duration;
use syncline_canopen::{Frame, Instant, NodeId, Transmit};
use ties::{Couplings, Devices};

pub use enable_chain::EnableChain;
pub use probe::{FittedProbe, ProbeDrive, ProbeWire};
pub use ties::Ties;

/// Between two points of the grid on which coupled shafts move: a nominal step of a speed loop.
pub const GRID: Duration = Duration::from_nanos(62_500);

/// What sees every frame of a simulated bus, in bus order.
pub type Observer = Box<dyn FnMut(&Transmission) + Send>;

/// A bus of a world.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BusId(usize);

/// A device of a world.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DeviceId {
    bus: usize,
    place: usize,
}

/// Simulated buses with their devices, and what couples these; see the [module](self).
pub struct World {
    buses: Vec<Bus>,
    couplings: Couplings,
    /// When everything was switched on: the world's own time begins at zero.
    origin: Option<Instant>,
}

struct Bus {
    wire: SimBus<Box<dyn SimulatedDevice>>,
    observer: Observer,
    /// When anything happens next on it, in the world's own time; known while time passes.
    next: Option<Instant>,
}

impl Bus {
    /// Lets its frames travel and its nodes act, in the world's own time, which began `passed` after the origin of time.
    fn live_until(&mut self, until: Instant, passed: Duration) {
        let Self { wire, observer, .. } = self;
        wire.advance_to(until, &mut |sent| {
            observer(&Transmission {
                start: sent.start + passed,
                end: sent.end + passed,
                ..*sent
            });
        });
    }
}

impl Default for World {
    fn default() -> Self {
        Self::new()
    }
}

impl World {
    /// A world with nothing in it.
    #[must_use]
    pub fn new() -> Self {
        Self::on_grid(GRID)
    }

    /// The same with another step for coupled shafts.
    #[must_use]
    pub fn on_grid(step: Duration) -> Self {
        Self {
            buses: Vec::new(),
            couplings: Couplings::new(step),
            origin: None,
        }
    }

    // ---- what is in it ----

    /// Adds a bus; `observer` sees every frame on it, in bus order.
    pub fn add_bus(
        &mut self,
        bit_rate: BitRate,
        observer: impl FnMut(&Transmission) + Send + 'static,
    ) -> BusId {
        self.buses.push(Bus {
            wire: SimBus::new(bit_rate),
            observer: Box::new(observer),
            next: None,
        });
        BusId(self.buses.len() - 1)
    }

    /// Puts a device on a bus.
    pub fn attach(&mut self, bus: BusId, device: Box<dyn SimulatedDevice>) -> DeviceId {
        let place = self.buses[bus.0].wire.attach(device);
        DeviceId { bus: bus.0, place }
    }

    /// What ties its devices together beside their buses, to be added to before time passes.
    pub fn ties(&mut self) -> Ties<'_> {
        Ties::new(&mut self.couplings, &mut self.buses)
    }

    /// The coupling between a [follower](Ties::follow) and its leader slips, or somebody [turns](Ties::turn) the shaft by
    /// hand besides: it jumps by so many revolutions.
    pub fn slip(&mut self, follower: DeviceId, by: f64) {
        for coupled in self.couplings.of(follower) {
            coupled.zero += by;
        }
    }

    /// The coupling between a [follower](Ties::follow) and its leader breaks: the follower's shaft
    /// stays where it is.
    pub fn part(&mut self, follower: DeviceId) {
        let shaft = self.device_mut(follower).shaft_mut();
        let position = shaft.map_or(0.0, |shaft| shaft.position());
        for coupled in self.couplings.of(follower) {
            coupled.parted = Some(position);
        }
    }

    /// A coupling that broke is made whole: the shaft is where it would be if that had held.
    pub fn join(&mut self, follower: DeviceId) {
        for coupled in self.couplings.of(follower) {
            coupled.parted = None;
        }
    }

    /// Somebody brings what a device moves by hand so many revolutions of its shaft further, where it stays. Nothing at a
    /// device that has no shaft, nor at a [follower](Ties::follow), which goes with its leader.
    pub fn displace(&mut self, device: DeviceId, by: f64) {
        if let Some(shaft) = self.device_mut(device).shaft_mut() {
            shaft.displace(by);
        }
        self.couplings.displace(device, by);
    }

    /// Pushes from now on at what a device moves, with a torque in N·m at its shaft; nothing at one that has no shaft.
    pub fn push(&mut self, device: DeviceId, torque: f64) {
        if let Some(shaft) = self.device_mut(device).shaft_mut() {
            shaft.push(torque);
        }
    }

    /// The device with this node id on a bus.
    #[must_use]
    pub fn find(&self, BusId(bus): BusId, node: NodeId) -> Option<DeviceId> {
        let mut nodes = self.buses.get(bus)?.wire.nodes();
        let place = nodes.position(|device| device.node() == node)?;
        Some(DeviceId { bus, place })
    }

    /// A device, to look at it.
    #[must_use]
    pub fn device(&self, device: DeviceId) -> &dyn SimulatedDevice {
        &**self.buses[device.bus].wire.node(device.place)
    }

    /// A device, to interfere with it.
    pub fn device_mut(&mut self, device: DeviceId) -> &mut dyn SimulatedDevice {
        self.buses.device_mut(device)
    }

    // ---- the controller's side ----

    /// Queues a frame of the controller at the present instant.
    pub fn send(&mut self, bus: BusId, band: Band, frame: Frame) {
        self.buses[bus.0].wire.send(band, frame);
    }

    /// Queues a frame of nobody that is attached, as of another master, at the present instant.
    pub fn intrude(&mut self, bus: BusId, frame: Frame) {
        self.buses[bus.0].wire.intrude(frame);
    }

    /// The next frame that came to the controller on that bus, its own included.
    pub fn receive(&mut self, bus: BusId) -> Option<Received> {
        let passed = self.origin.unwrap_or(Instant::ZERO) - Instant::ZERO;
        let received = self.buses[bus.0].wire.receive()?;
        Some(Received {
            at: received.at + passed,
            ..received
        })
    }

    // ---- time ----

    /// Lets time pass up to and including `now`. The first call switches everything on.
    pub fn advance_to(&mut self, now: Instant) {
        let origin = *self.origin.get_or_insert(now);
        let until = Instant::ZERO + (now - origin);
        let passed = origin - Instant::ZERO;
        // One bus alone need not be held back.
        if self.buses.len() > 1 || !self.couplings.is_empty() {
            self.live_by_events(until, passed);
        }
        for bus in &mut self.buses {
            bus.live_until(until, passed);
        }
        self.couplings.move_until(until, &mut self.buses);
    }

    /// Lets what happens until then happen in the order of time. Only where something happens is anything looked at.
    fn live_by_events(&mut self, until: Instant, passed: Duration) {
        for bus in &mut self.buses {
            bus.next = bus.wire.next_event();
        }
        loop {
            let buses = self.buses.iter().filter_map(|bus| bus.next);
            let next = buses.chain(self.couplings.next()).min();
            let Some(event) = next.filter(|event| *event <= until) else {
                return;
            };
            for bus in &mut self.buses {
                if bus.next.is_some_and(|next| next <= event) {
                    bus.live_until(event, passed);
                    bus.next = bus.wire.next_event();
                }
            }
            self.couplings.move_until(event, &mut self.buses);
        }
    }
}

/// Devices that share a bus which others reach, with the mechanics that couple them.
///
/// As a [`BusNode`] it is all of them at once: each lives up to the instant of a frame or of a poll,
/// in the order of time.
pub struct Hosted {
    devices: Vec<Box<dyn SimulatedDevice>>,
    couplings: Couplings,
}

impl Hosted {
    /// Devices that are switched on at the origin of time.
    #[must_use]
    pub fn new(devices: Vec<Box<dyn SimulatedDevice>>) -> Self {
        Self {
            devices,
            couplings: Couplings::new(GRID),
        }
    }

    /// What ties its devices together, as [`World::ties`].
    pub fn ties(&mut self) -> Ties<'_> {
        Ties::new(&mut self.couplings, &mut self.devices)
    }

    /// The device at a place among those that it was made of.
    #[must_use]
    pub fn at(place: usize) -> DeviceId {
        DeviceId { bus: 0, place }
    }

    /// Lets all that is due until `now` happen, each at its own instant.
    pub fn live_until(&mut self, now: Instant, tx: &mut dyn Transmit) {
        while let Some(due) = self.deadline().filter(|due| *due <= now) {
            self.poll(due, tx);
        }
    }
}

impl BusNode for Hosted {
    fn on_frame(&mut self, now: Instant, frame: &Frame, tx: &mut dyn Transmit) {
        self.live_until(now, tx);
        for device in &mut self.devices {
            device.on_frame(now, frame, tx);
        }
    }

    fn poll(&mut self, now: Instant, tx: &mut dyn Transmit) {
        for device in &mut self.devices {
            if device.deadline().is_some_and(|due| due <= now) {
                device.poll(now, tx);
            }
        }
        self.couplings.move_until(now, &mut self.devices);
    }

    fn deadline(&self) -> Option<Instant> {
        let devices = self.devices.iter().filter_map(|device| device.deadline());
        devices.chain(self.couplings.next()).min()
    }
}

impl Devices for Vec<Bus> {
    fn device_mut(&mut self, device: DeviceId) -> &mut dyn SimulatedDevice {
        &mut **self[device.bus].wire.node_mut(device.place)
    }
}

impl Devices for Vec<Box<dyn SimulatedDevice>> {
    fn device_mut(&mut self, device: DeviceId) -> &mut dyn SimulatedDevice {
        &mut *self[device.place]
    }
}
