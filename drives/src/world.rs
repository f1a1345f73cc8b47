//! The simulated world: buses, devices and mechanics on one clock.
//!
//! A [`World`] owns every simulated bus of a machine with the devices on it, and the mechanics that
//! tie their shafts together. Whoever drives it says how far time goes
//! ([`World::advance_to`]); it then lets happen what happens, event by event over all buses in the
//! order of time, so that no bus runs ahead of another. There is one owner and no lock.
//!
//! A shaft that nothing couples moves with the speed loop of its own drive. Shafts that are
//! [coupled](World::couple) move on the world's grid: at each of its points every coupled device
//! runs its loops up to there, the mechanics take the loads of the step behind, and the shafts are
//! told where they are. In between a drive reads its shaft extrapolated; the error of that is
//! stated in [`mechanics`](crate::mechanics).
//!
//! Devices on a bus that others reach, another process or real ones, have no wire of this world:
//! [`Hosted`] is such a bus's share, with the same clock and the same mechanics, and is a
//! [`BusNode`] as a whole.
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

use crate::bus::{Band, BitRate, BusNode, Received, SimBus, Transmission};
use crate::mechanics::{Load, Mechanics, Motion};
use crate::twin::SimulatedDevice;
use crate::twin::servo::shaft::Shaft;
use dc_link::DcLink;
use enable_chain::Chain;
use probe::Probing;
use syncline_canopen::time::Duration;
use syncline_canopen::{Frame, Instant, NodeId, Transmit};

pub use enable_chain::EnableChain;
pub use probe::{FittedProbe, ProbeDrive, ProbeWire};

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
        });
        BusId(self.buses.len() - 1)
    }

    /// Puts a device on a bus.
    pub fn attach(&mut self, bus: BusId, device: Box<dyn SimulatedDevice>) -> DeviceId {
        let place = self.buses[bus.0].wire.attach(device);
        DeviceId { bus: bus.0, place }
    }

    /// Ties the shafts of these devices together, before time passes. The mechanics are told the
    /// motions of `watched` shafts too, behind those of the others, and do not move them.
    ///
    /// # Panics
    /// If one of them has no shaft.
    pub fn couple(
        &mut self,
        mechanics: impl Mechanics + 'static,
        devices: &[DeviceId],
        watched: &[DeviceId],
    ) {
        let coupling = Coupling::new(Box::new(mechanics), devices, watched);
        self.couplings.add(coupling, &mut self.buses[..]);
    }

    /// Turns the shaft of one device with the load of another, `ratio` times as far as its motor does,
    /// before time passes: an encoder on the axis. It takes no torque.
    ///
    /// At each point of the world's grid it is where the load is, behind the motor by twist and play and
    /// off by lead error and expansion; in between it goes on with the
    /// velocity that it had, which under an acceleration `a` is wrong by at most `a h²/2` after `h`
    /// seconds.
    ///
    /// # Panics
    /// If one of them has no shaft.
    pub fn follow(&mut self, follower: DeviceId, leader: DeviceId, ratio: f64) {
        (self.couplings).follow(follower, leader, ratio, &mut self.buses[..]);
    }

    /// Turns the shaft of a device that no other one turns, before time passes: so many revolutions a second, whatever
    /// happens.
    ///
    /// # Panics
    /// If it has no shaft.
    pub fn turn(&mut self, device: DeviceId, speed: f64) {
        self.couplings.turn(device, speed, &mut self.buses[..]);
    }

    /// The coupling between a [follower](Self::follow) and its leader slips, or somebody [turns](Self::turn) the shaft by
    /// hand besides: it jumps by so many revolutions.
    pub fn slip(&mut self, follower: DeviceId, by: f64) {
        for coupled in self.couplings.of(follower) {
            coupled.zero += by;
        }
    }

    /// The coupling between a [follower](Self::follow) and its leader breaks: the follower's shaft
    /// stays where it is.
    pub fn part(&mut self, follower: DeviceId) {
        let shaft = self.device_mut(follower).shaft_mut();
        let position = shaft.map_or(0.0, |shaft| shaft.position());
        for coupled in self.couplings.of(follower) {
            coupled.ratio = 0.0;
            coupled.zero = position;
        }
    }

    /// Fits a probe that touches work pieces, before time passes.
    ///
    /// # Panics
    /// If a device that moves it has no shaft: once time passes.
    pub fn fit_probe(&mut self, probe: FittedProbe) {
        self.couplings.probes.push(Probing::new(probe));
    }

    /// Feeds power stages through a contactor that a device closes, before time passes. It is looked at at each point of the
    /// world's grid.
    pub fn feed_through(&mut self, chain: EnableChain) {
        self.couplings.chains.push(Chain::new(chain));
    }

    /// Joins the DC buses of these drives, before time passes; of those that have a power stage. They have one voltage at each point
    /// of the world's grid.
    pub fn join_dc_buses(&mut self, devices: Vec<DeviceId>) {
        self.couplings.links.push(DcLink { devices });
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
        self.buses[..].device_mut(device)
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
        // One bus alone need not be held back.
        if self.buses.len() > 1 || !self.couplings.is_empty() {
            while let Some(event) = self.next_event().filter(|event| *event <= until) {
                self.live_until(event);
            }
        }
        self.live_until(until);
    }

    /// When anything happens next on any bus or to coupled shafts, in the world's own time.
    fn next_event(&self) -> Option<Instant> {
        let buses = self.buses.iter().filter_map(|bus| bus.wire.next_event());
        buses.chain(self.couplings.next()).min()
    }

    fn live_until(&mut self, until: Instant) {
        let passed = self.origin.unwrap_or(Instant::ZERO) - Instant::ZERO;
        for Bus { wire, observer } in &mut self.buses {
            wire.advance_to(until, &mut |sent| {
                observer(&Transmission {
                    start: sent.start + passed,
                    end: sent.end + passed,
                    ..*sent
                });
            });
        }
        self.couplings.move_until(until, &mut self.buses[..]);
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

    /// Ties the shafts of the devices at these places together, as [`World::couple`] does.
    ///
    /// # Panics
    /// If one of them has no shaft.
    pub fn couple(
        &mut self,
        mechanics: impl Mechanics + 'static,
        places: &[usize],
        watched: &[usize],
    ) {
        let devices =
            |places: &[usize]| -> Vec<DeviceId> { places.iter().copied().map(Self::at).collect() };
        let coupling = Coupling::new(Box::new(mechanics), &devices(places), &devices(watched));
        self.couplings.add(coupling, &mut self.devices[..]);
    }

    /// Turns the shaft of the device at one place with that at another, as [`World::follow`] does.
    ///
    /// # Panics
    /// If one of them has no shaft.
    pub fn follow(&mut self, follower: usize, leader: usize, ratio: f64) {
        let [follower, leader] = [follower, leader].map(Self::at);
        (self.couplings).follow(follower, leader, ratio, &mut self.devices[..]);
    }

    /// Turns the shaft of the device at one place, as [`World::turn`] does.
    ///
    /// # Panics
    /// If it has no shaft.
    pub fn turn(&mut self, place: usize, speed: f64) {
        (self.couplings).turn(Self::at(place), speed, &mut self.devices[..]);
    }

    /// Fits a probe that touches work pieces, as [`World::fit_probe`] does.
    ///
    /// # Panics
    /// If a device that moves it has no shaft: once time passes.
    pub fn fit_probe(&mut self, probe: FittedProbe) {
        self.couplings.probes.push(Probing::new(probe));
    }

    /// Feeds power stages through a contactor, as [`World::feed_through`] does.
    pub fn feed_through(&mut self, chain: EnableChain) {
        self.couplings.chains.push(Chain::new(chain));
    }

    /// Joins the DC buses of drives, as [`World::join_dc_buses`] does.
    pub fn join_dc_buses(&mut self, devices: Vec<DeviceId>) {
        self.couplings.links.push(DcLink { devices });
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
        self.couplings.move_until(now, &mut self.devices[..]);
    }

    fn deadline(&self) -> Option<Instant> {
        let devices = self.devices.iter().filter_map(|device| device.deadline());
        devices.chain(self.couplings.next()).min()
    }
}

/// Where devices are found.
trait Devices {
    fn device_mut(&mut self, device: DeviceId) -> &mut dyn SimulatedDevice;
}

impl Devices for [Bus] {
    fn device_mut(&mut self, device: DeviceId) -> &mut dyn SimulatedDevice {
        &mut **self[device.bus].wire.node_mut(device.place)
    }
}

impl Devices for [Box<dyn SimulatedDevice>] {
    fn device_mut(&mut self, device: DeviceId) -> &mut dyn SimulatedDevice {
        &mut *self[device.place]
    }
}

/// All that couples devices beside the bus, and the grid on which it is looked at.
struct Couplings {
    step: Duration,
    /// The next point of the grid.
    next: Instant,
    couplings: Vec<Coupling>,
    followers: Vec<Follower>,
    probes: Vec<Probing>,
    chains: Vec<Chain>,
    links: Vec<DcLink>,
}

/// A shaft that another one turns.
struct Follower {
    follower: DeviceId,
    /// What turns it; `None`: time itself.
    leader: Option<DeviceId>,
    /// Revolutions for one of the leader, or for a second.
    ratio: f64,
    /// Where it is while the leader is at zero, or was at first.
    zero: f64,
}

/// Shafts that are tied together.
struct Coupling {
    mechanics: Box<dyn Mechanics>,
    /// Moved.
    devices: Vec<DeviceId>,
    /// Only looked at.
    watched: Vec<DeviceId>,
    /// Of what is moved.
    loads: Vec<Load>,
    /// Of what is moved, then of what is looked at.
    motions: Vec<Motion>,
}

impl Couplings {
    fn new(step: Duration) -> Self {
        Self {
            step,
            next: Instant::ZERO + step,
            couplings: Vec::new(),
            followers: Vec::new(),
            probes: Vec::new(),
            chains: Vec::new(),
            links: Vec::new(),
        }
    }

    fn is_empty(&self) -> bool {
        self.couplings.is_empty()
            && self.followers.is_empty()
            && self.probes.is_empty()
            && self.chains.is_empty()
            && self.links.is_empty()
    }

    /// The next point of the grid, if anything moves on it.
    fn next(&self) -> Option<Instant> {
        (!self.is_empty()).then_some(self.next)
    }

    fn add(&mut self, mut coupling: Coupling, all: &mut (impl Devices + ?Sized)) {
        for (motion, &device) in coupling.motions.iter_mut().zip(&coupling.devices) {
            let shaft = shaft_of(device, all);
            shaft.couple(Instant::ZERO);
            *motion = shaft.motion_at(Instant::ZERO);
        }
        coupling.watch(Instant::ZERO, all);
        self.couplings.push(coupling);
    }

    fn follow(
        &mut self,
        follower: DeviceId,
        leader: DeviceId,
        ratio: f64,
        all: &mut (impl Devices + ?Sized),
    ) {
        let load = shaft_of(leader, all).load_position();
        let zero = shaft_of(follower, all).position() - ratio * load;
        if let Some(shaft) = all.device_mut(follower).shaft_mut() {
            shaft.couple(Instant::ZERO);
        }
        self.followers.push(Follower {
            follower,
            leader: Some(leader),
            ratio,
            zero,
        });
    }

    fn turn(&mut self, device: DeviceId, speed: f64, all: &mut (impl Devices + ?Sized)) {
        let shaft = shaft_of(device, all);
        let zero = shaft.position();
        shaft.couple(Instant::ZERO);
        self.followers.push(Follower {
            follower: device,
            leader: None,
            ratio: speed,
            zero,
        });
    }

    /// What ties that device to its leader.
    fn of(&mut self, follower: DeviceId) -> impl Iterator<Item = &mut Follower> {
        (self.followers.iter_mut()).filter(move |coupled| coupled.follower == follower)
    }

    /// Moves coupled shafts from point to point of the grid, up to `until`.
    fn move_until(&mut self, until: Instant, devices: &mut (impl Devices + ?Sized)) {
        while !self.is_empty() && self.next <= until {
            for coupling in &mut self.couplings {
                coupling.step(self.next, self.step, devices);
            }
            for follower in &self.followers {
                follower.step(self.next, devices);
            }
            for probe in &mut self.probes {
                probe.step(self.next, devices);
            }
            for chain in &mut self.chains {
                chain.step(self.next, devices);
            }
            for link in &self.links {
                link.step(self.next, devices);
            }
            self.next += self.step;
        }
    }
}

impl Follower {
    fn step(&self, end: Instant, all: &mut (impl Devices + ?Sized)) {
        let load = match self.leader {
            None => Motion {
                position: (end - Instant::ZERO).as_secs_f64(),
                velocity: 1.0,
                acceleration: 0.0,
            },
            Some(leader) => {
                let leader = all.device_mut(leader);
                leader.run_until(end);
                let Some(shaft) = leader.shaft_mut() else {
                    return;
                };
                shaft.load_motion_at(end)
            }
        };
        let motion = Motion {
            position: self.zero + self.ratio * load.position,
            velocity: self.ratio * load.velocity,
            acceleration: 0.0,
        };
        let follower = all.device_mut(self.follower);
        follower.run_until(end);
        if let Some(shaft) = follower.shaft_mut() {
            shaft.moved(end, motion);
        }
    }
}

/// # Panics
/// If the device has no shaft.
fn shaft_of(device: DeviceId, all: &mut (impl Devices + ?Sized)) -> &mut Shaft {
    let shaft = all.device_mut(device).shaft_mut();
    shaft.expect("mechanics couple devices that have a shaft")
}

impl Coupling {
    fn new(mechanics: Box<dyn Mechanics>, devices: &[DeviceId], watched: &[DeviceId]) -> Self {
        Self {
            mechanics,
            devices: devices.to_vec(),
            watched: watched.to_vec(),
            loads: vec![Load::default(); devices.len()],
            motions: vec![Motion::default(); devices.len() + watched.len()],
        }
    }

    /// Looks where what is only looked at is at `now`.
    fn watch(&mut self, now: Instant, all: &mut (impl Devices + ?Sized)) {
        let motions = self.motions[self.devices.len()..].iter_mut();
        for (motion, &device) in motions.zip(&self.watched) {
            *motion = shaft_of(device, all).motion_at(now);
        }
    }

    fn step(&mut self, end: Instant, step: Duration, all: &mut (impl Devices + ?Sized)) {
        for (load, &device) in self.loads.iter_mut().zip(&self.devices) {
            let device = all.device_mut(device);
            device.run_until(end);
            if let Some(shaft) = device.shaft_mut() {
                *load = shaft.take_load();
            }
        }
        for &device in &self.watched {
            all.device_mut(device).run_until(end);
        }
        self.watch(end, all);
        let dt = step.as_nanos() as f64 * 1e-9;
        self.mechanics.step(dt, &self.loads, &mut self.motions);
        for (&motion, &device) in self.motions.iter().zip(&self.devices) {
            if let Some(shaft) = all.device_mut(device).shaft_mut() {
                shaft.moved(end, motion);
            }
        }
    }
}
