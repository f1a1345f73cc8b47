//! What ties devices of a world together beside their buses: mechanics, shafts that others turn, probes, the feeding of power
//! stages and joined DC buses, all looked at on one grid.

use super::DeviceId;
use super::dc_link::DcLink;
use super::enable_chain::{Chain, EnableChain};
use super::probe::{FittedProbe, Probing};
use crate::mechanics::{Load, Mechanics, Motion};
use crate::twin::SimulatedDevice;
use crate::twin::servo::shaft::Shaft;
use syncline_canopen::Instant;
use syncline_canopen::time::Duration;

/// Where devices are found.
pub(super) trait Devices {
    fn device_mut(&mut self, device: DeviceId) -> &mut dyn SimulatedDevice;
}

/// What ties devices together, to be added to before time passes. Those that have to have a shaft are said.
pub struct Ties<'w> {
    couplings: &'w mut Couplings,
    devices: &'w mut dyn Devices,
}

impl<'w> Ties<'w> {
    pub(super) fn new(couplings: &'w mut Couplings, devices: &'w mut dyn Devices) -> Self {
        Self { couplings, devices }
    }

    /// Ties the shafts of these devices together. The mechanics are told the
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
        let mut coupling = Coupling::new(Box::new(mechanics), devices, watched);
        for (motion, &device) in coupling.motions.iter_mut().zip(devices) {
            let shaft = shaft_of(device, self.devices);
            shaft.couple(Instant::ZERO);
            *motion = shaft.motion_at(Instant::ZERO);
        }
        coupling.watch(Instant::ZERO, self.devices);
        self.couplings.couplings.push(coupling);
    }

    /// Turns the shaft of one device with the load of another, `ratio` times as far as its motor does:
    /// an encoder on the axis. It takes no torque.
    ///
    /// At each point of the world's grid it is where the load is, behind the motor by twist and play and
    /// off by lead error and expansion; in between it goes on with the
    /// velocity that it had, which under an acceleration `a` is wrong by at most `a h²/2` after `h`
    /// seconds.
    ///
    /// # Panics
    /// If one of them has no shaft.
    pub fn follow(&mut self, follower: DeviceId, leader: DeviceId, ratio: f64) {
        let load = shaft_of(leader, self.devices).load_position();
        let shaft = shaft_of(follower, self.devices);
        let zero = shaft.position() - ratio * load;
        shaft.couple(Instant::ZERO);
        self.couplings.followers.push(Follower {
            follower,
            leader: Some(leader),
            ratio,
            zero,
            parted: None,
        });
    }

    /// Turns the shaft of a device that no other one turns: so many revolutions a second, whatever
    /// happens.
    ///
    /// # Panics
    /// If it has no shaft.
    pub fn turn(&mut self, device: DeviceId, speed: f64) {
        let shaft = shaft_of(device, self.devices);
        let zero = shaft.position();
        shaft.couple(Instant::ZERO);
        self.couplings.followers.push(Follower {
            follower: device,
            leader: None,
            ratio: speed,
            zero,
            parted: None,
        });
    }

    /// Fits a probe that touches work pieces.
    ///
    /// # Panics
    /// If a device that moves it has no shaft: once time passes.
    pub fn fit_probe(&mut self, probe: FittedProbe) {
        self.couplings.probes.push(Probing::new(probe));
    }

    /// Feeds power stages through a contactor that a device closes. It is looked at at each point of the
    /// world's grid.
    pub fn feed_through(&mut self, chain: EnableChain) {
        self.couplings.chains.push(Chain::new(chain));
    }

    /// Joins the DC buses of these drives; of those that have a power stage. They have one voltage at each point
    /// of the world's grid.
    pub fn join_dc_buses(&mut self, devices: Vec<DeviceId>) {
        self.couplings.links.push(DcLink { devices });
    }
}

/// All that couples devices beside the bus, and the grid on which it is looked at.
pub(super) struct Couplings {
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
pub(super) struct Follower {
    follower: DeviceId,
    /// What turns it; `None`: time itself.
    leader: Option<DeviceId>,
    /// Revolutions for one of the leader, or for a second.
    ratio: f64,
    /// Where it is while the leader is at zero, or was at first.
    pub(super) zero: f64,
    /// Where it stays, as nothing turns it any more.
    pub(super) parted: Option<f64>,
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
    pub(super) fn new(step: Duration) -> Self {
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

    pub(super) fn is_empty(&self) -> bool {
        self.couplings.is_empty()
            && self.followers.is_empty()
            && self.probes.is_empty()
            && self.chains.is_empty()
            && self.links.is_empty()
    }

    /// The next point of the grid, if anything moves on it.
    pub(super) fn next(&self) -> Option<Instant> {
        (!self.is_empty()).then_some(self.next)
    }

    /// What ties that device to its leader.
    pub(super) fn of(&mut self, follower: DeviceId) -> impl Iterator<Item = &mut Follower> {
        (self.followers.iter_mut()).filter(move |coupled| coupled.follower == follower)
    }

    /// A shaft that mechanics move is so many revolutions further, and rests.
    pub(super) fn displace(&mut self, device: DeviceId, by: f64) {
        for coupling in &mut self.couplings {
            let Some(shaft) = coupling.devices.iter().position(|it| *it == device) else {
                continue;
            };
            coupling.motions[shaft] = coupling.motions[shaft].displaced(by);
            coupling.mechanics.displaced(shaft, by);
        }
    }

    /// Moves coupled shafts from point to point of the grid, up to `until`.
    pub(super) fn move_until(&mut self, until: Instant, devices: &mut (impl Devices + ?Sized)) {
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
        let motion = match self.parted {
            None => Motion {
                position: self.zero + self.ratio * load.position,
                velocity: self.ratio * load.velocity,
                acceleration: 0.0,
            },
            Some(position) => Motion {
                position,
                ..Motion::default()
            },
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
pub(super) fn shaft_of(device: DeviceId, all: &mut (impl Devices + ?Sized)) -> &mut Shaft {
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
