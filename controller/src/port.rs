//! One CAN bus as the cycle uses it.
//!
//! The controller never talks to a bus: it fills an [`Outbox`](crate::bus::Outbox) and is handed
//! [`Received`] frames.
//! A [`Port`] carries both over one bus with a number of system calls that does not grow with
//! the number of frames.

mod arrival;
mod error_frame;
mod lasting;
mod network;
pub mod sim;
pub mod socketcan;
pub(crate) mod socketcand;
mod udp;
pub mod url;
pub mod wire;

#[cfg(fuzzing)]
pub use self::{socketcand::fuzz as fuzz_socketcand, udp::fuzz as fuzz_datagram};

use crate::bus::{Burst, BusFault, Received};
use crate::machine::Machine;
use lasting::Lasting;
use sim::{SimPort, Simulated};
use socketcan::SocketCan;
use syncline_canopen::{CobId, Frame};
use syncline_drives::world::{BusId, Observer, World};
use url::{BusUrl, NoBus};
use wire::WirePort;

/// A machine's ports, one a bus.
pub type Ports = Vec<Box<dyn Port + Send>>;

/// One CAN bus. Errors are those of the interface itself; what a peer does wrong is a frame.
pub trait Port {
    /// Gives the world what was sent to a simulated bus and takes what came from there, at the
    /// present instant; what is sent to a real bus has left.
    fn exchange(&mut self, _world: &mut World) {}

    /// Which bus of the world it is the port of; `None`: of none, the bus is a real one.
    fn simulated(&self) -> Option<BusId>;

    /// Whether the port tells by [`Received::echo`] that a frame has left.
    fn echoes(&self) -> bool;

    /// What is worth knowing about the bus although it was taken.
    fn notes(&self) -> &[String] {
        &[]
    }

    /// Hands over everything that arrived since the last call, oldest first.
    ///
    /// # Errors
    /// The interface is gone or reports a bus fault.
    fn receive(&mut self, sink: &mut dyn FnMut(Received)) -> Result<(), PortError>;

    /// The worst that the adapter has reported since the last call although the bus can be used on.
    fn condition(&mut self) -> Option<BusFault> {
        None
    }

    /// Sends SYNC ahead of everything else.
    ///
    /// # Errors
    /// The interface is gone or its queue is full.
    fn send_sync(&mut self, frame: &Frame) -> Result<(), PortError>;

    /// Sends one cycle's R_PDOs in the given order: all or none.
    ///
    /// # Errors
    /// The interface is gone.
    fn send_burst(&mut self, frames: &[Frame]) -> Result<Burst, PortError>;

    /// Sends acyclic frames behind everything else; what does not fit is lost and retried by its
    /// protocol's time-out.
    ///
    /// # Errors
    /// The interface is gone.
    fn send_acyclic(&mut self, frames: &[Frame]) -> Result<(), PortError>;
}

impl<P: Port + ?Sized> Port for Box<P> {
    fn exchange(&mut self, world: &mut World) {
        (**self).exchange(world);
    }

    fn simulated(&self) -> Option<BusId> {
        (**self).simulated()
    }

    fn echoes(&self) -> bool {
        (**self).echoes()
    }

    fn notes(&self) -> &[String] {
        (**self).notes()
    }

    fn receive(&mut self, sink: &mut dyn FnMut(Received)) -> Result<(), PortError> {
        (**self).receive(sink)
    }

    fn condition(&mut self) -> Option<BusFault> {
        (**self).condition()
    }

    fn send_sync(&mut self, frame: &Frame) -> Result<(), PortError> {
        (**self).send_sync(frame)
    }

    fn send_burst(&mut self, frames: &[Frame]) -> Result<Burst, PortError> {
        (**self).send_burst(frames)
    }

    fn send_acyclic(&mut self, frames: &[Frame]) -> Result<(), PortError> {
        (**self).send_acyclic(frames)
    }
}

/// Opens the buses of a machine by the names of their ports: the world of those that are
/// simulated, and a port for each bus. `seed` and `observers`, one a bus, are for simulated ones.
///
/// # Errors
/// An interface cannot be used, with what to type to mend it.
pub fn open(
    machine: &Machine,
    seed: u64,
    observers: Vec<Observer>,
) -> Result<(World, Ports), PortError> {
    let urls: Vec<BusUrl> = (machine.buses.iter())
        .map(|spec| {
            spec.port.parse().map_err(|error: NoBus| PortError {
                bus: spec.name.clone(),
                what: error.to_string(),
            })
        })
        .collect::<Result<_, _>>()?;
    let observers = urls.iter().zip(observers);
    let observers = observers.map(|(url, observer)| (*url == BusUrl::Sim).then_some(observer));
    let simulated = Simulated::new(machine, seed, observers, |_, _| ())?;
    let ports = urls.into_iter().enumerate().map(|(bus, url)| {
        Ok(match simulated.buses[bus] {
            Some(bus) => Box::new(SimPort::new(bus)),
            None => open_real(machine, bus, url)?,
        })
    });
    let ports = ports.collect::<Result<Ports, PortError>>()?;
    Ok((simulated.world, ports))
}

/// Opens a bus that is not simulated here.
fn open_real(
    machine: &Machine,
    bus: usize,
    url: BusUrl,
) -> Result<Box<dyn Port + Send>, PortError> {
    let spec = &machine.buses[bus];
    match url {
        BusUrl::SocketCan(interface) => {
            let nodes = machine.nodes().enumerate();
            let nodes = nodes.filter(|(_, node)| node.bus == bus);
            let devices: Vec<_> = nodes.map(|(index, _)| machine.device(index)).collect();
            let options = socketcan::Options {
                bit_rate: spec.bitrate,
                receive: (devices.iter())
                    .flat_map(|device| {
                        let spec = device.spec();
                        let node = spec.node;
                        let t_pdos = spec.t_pdos.iter().map(|pdo| pdo.cob_id);
                        t_pdos.chain([
                            CobId::t_sdo(node),
                            CobId::emcy(node),
                            CobId::error_control(node),
                        ])
                    })
                    .collect(),
                heartbeat: CobId::error_control(machine.controller.node),
                burst: (devices.iter())
                    .flat_map(|device| &device.spec().r_pdos)
                    .map(|pdo| pdo.cob_id)
                    .collect(),
            };
            Ok(Box::new(SocketCan::open(&interface, &options)?))
        }
        server @ BusUrl::Socketcand { .. } => Ok(Box::new(WirePort::new(Lasting::open(
            server,
            spec.bitrate,
        )?))),
        network => Ok(Box::new(WirePort::new(
            network.open(spec.bitrate, url::End::Client)?,
        ))),
    }
}

/// Why a bus cannot be used (any longer).
#[derive(Clone, Debug, thiserror::Error)]
#[error("bus {bus}: {what}")]
pub struct PortError {
    /// The bus as the machine file names it.
    pub bus: String,
    /// What happened, with what to type to mend it where that is known.
    pub what: String,
}
