//! The simulated part of a machine: its world, and ports to the buses in it.

use super::{Burst, Port, PortError, Received};
use crate::machine::Machine;
use syncline_canopen::{Frame, NodeId};
use syncline_drives::bus::{Band, BitRate};
use syncline_drives::model::Model;
use syncline_drives::twin::{Config, Kind, SimulatedDevice};
use syncline_drives::world::{BusId, DeviceId, Observer, World};

/// The controller's side of a simulated bus: what is to be sent there, and what came from there.
///
/// It is filled and emptied by [`Port::exchange`] alone, so that the world has one owner, the
/// driver, and ports stay independent of each other.
pub struct SimPort {
    bus: BusId,
    sent: Vec<(Band, Frame)>,
    received: Vec<Received>,
}

impl SimPort {
    /// The port of a bus.
    #[must_use]
    pub fn new(bus: BusId) -> Self {
        Self {
            bus,
            sent: Vec::with_capacity(128),
            received: Vec::with_capacity(256),
        }
    }
}

impl Port for SimPort {
    fn exchange(&mut self, world: &mut World) {
        for (band, frame) in self.sent.drain(..) {
            world.send(self.bus, band, frame);
        }
        while let Some(received) = world.receive(self.bus) {
            self.received.push(Received {
                at: received.at,
                frame: received.frame,
                echo: received.own,
            });
        }
    }

    fn receive(&mut self, sink: &mut dyn FnMut(Received)) -> Result<(), PortError> {
        self.received.drain(..).for_each(sink);
        Ok(())
    }

    fn send_sync(&mut self, frame: &Frame) -> Result<(), PortError> {
        self.sent.push((Band::Sync, *frame));
        Ok(())
    }

    fn send_burst(&mut self, frames: &[Frame]) -> Result<Burst, PortError> {
        let frames = frames.iter().map(|frame| (Band::Pdo, *frame));
        self.sent.extend(frames);
        Ok(Burst::Queued)
    }

    fn send_acyclic(&mut self, frames: &[Frame]) -> Result<(), PortError> {
        let frames = frames.iter().map(|frame| (Band::Acyclic, *frame));
        self.sent.extend(frames);
        Ok(())
    }

    fn echoes(&self) -> bool {
        true
    }
}

/// Buses of a machine that are simulated, with a twin for each of their drives.
pub struct Simulated {
    /// All of them.
    pub world: World,
    /// For each bus of the machine, where it is in the world.
    pub buses: Vec<Option<BusId>>,
    /// For each drive of the machine, its twin.
    pub devices: Vec<Option<DeviceId>>,
}

impl Simulated {
    /// The buses for which `observers` has an observer, which sees every frame in bus order. Their
    /// axes stand as near to machine zero as their soft limits allow, once time passes.
    ///
    /// `seed` varies encoder noise, response delays and oscillator errors; `configure` may change
    /// a drive, given by its index, before it is made.
    ///
    /// # Errors
    /// If a bus cannot be simulated at its bit rate.
    pub fn new(
        machine: &Machine,
        seed: u64,
        observers: impl IntoIterator<Item = Option<Observer>>,
        mut configure: impl FnMut(usize, &mut Config),
    ) -> Result<Self, PortError> {
        let mut world = World::new();
        let mut buses = Vec::with_capacity(machine.buses.len());
        for (spec, observer) in machine.buses.iter().zip(observers) {
            let Some(observer) = observer else {
                buses.push(None);
                continue;
            };
            let bit_rate = BitRate::from_kbit(spec.bitrate / 1000).ok_or_else(|| PortError {
                bus: spec.name.clone(),
                what: format!("cannot simulate {} bit/s", spec.bitrate),
            })?;
            buses.push(Some(world.add_bus(bit_rate, observer)));
        }
        let devices = machine.drives.iter().enumerate().map(|(index, drive)| {
            let mut config = config(machine, index, seed);
            configure(index, &mut config);
            let bus = buses[drive.bus]?;
            Some(world.attach(bus, twin(drive.model, &config)))
        });
        let devices = devices.collect();
        Ok(Self {
            world,
            buses,
            devices,
        })
    }
}

/// A drive of a machine by its index, to be switched on with its axis at rest.
#[must_use]
pub fn config(machine: &Machine, drive: usize, seed: u64) -> Config {
    let spec = &machine.drives[drive];
    // The machine file was checked: the soft limits are within the drive's range.
    let rest = machine.axes[spec.axis].rest();
    let position = spec.scaling.to_increments(rest);
    Config {
        position: position.map_or(0.0, |rest| spec.scaling.to_revolutions(rest)),
        ..single(spec.node, drive, seed)
    }
}

/// The `index`-th drive of a bus or machine, its encoder at zero.
#[must_use]
pub fn single(node: NodeId, index: usize, seed: u64) -> Config {
    Config {
        seed: seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ index as u64,
        ..Config::new(node)
    }
}

/// The twin of a model.
///
/// # Panics
/// Never: every model has one, as a test holds.
#[must_use]
pub fn twin(model: &Model, config: &Config) -> Box<dyn SimulatedDevice> {
    let kind = Kind::by_name(model.name).expect("every model has a twin");
    (kind.make)(config)
}
