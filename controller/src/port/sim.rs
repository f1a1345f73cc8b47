//! A simulated bus with its twins as a port.

use super::{Burst, Port, PortError, Received};
use crate::machine::Machine;
use syncline_canopen::{Frame, Instant, NodeId};
use syncline_drives::bus::{Band, BitRate, SimBus, Transmission};
use syncline_drives::twin::lxm32m::{Twin, TwinConfig};

/// What sees every frame of a simulated bus, in bus order.
pub type Observer = Box<dyn FnMut(&Transmission) + Send>;

/// A bus of the machine with a twin for each of its drives. Its time is what
/// [`Port::advance_to`] says; its drives are switched on when that is called first.
pub struct SimPort {
    bus: SimBus<Twin>,
    /// When they were: the bus's own time begins at zero.
    origin: Option<Instant>,
    observer: Observer,
}

impl SimPort {
    /// The bus with index `bus` of a machine, its axes standing as near to machine zero as their
    /// soft limits allow. `observer` sees every frame in bus order.
    ///
    /// `seed` varies encoder noise, response delays and oscillator errors.
    ///
    /// # Errors
    /// If the simulated bus cannot run at the bit rate.
    pub fn new(
        machine: &Machine,
        bus: usize,
        seed: u64,
        observer: impl FnMut(&Transmission) + Send + 'static,
    ) -> Result<Self, PortError> {
        let spec = &machine.buses[bus];
        let bit_rate = BitRate::from_kbit(spec.bitrate / 1000).ok_or_else(|| PortError {
            bus: spec.name.clone(),
            what: format!("cannot simulate {} bit/s", spec.bitrate),
        })?;
        Ok(Self::of_twins(
            bit_rate,
            twins(machine, bus, seed).map(Twin::new),
            observer,
        ))
    }

    /// A bus with these twins on it.
    pub fn of_twins(
        bit_rate: BitRate,
        twins: impl IntoIterator<Item = Twin>,
        observer: impl FnMut(&Transmission) + Send + 'static,
    ) -> Self {
        let mut bus = SimBus::new(bit_rate);
        for twin in twins {
            bus.attach(twin);
        }
        Self {
            bus,
            origin: None,
            observer: Box::new(observer),
        }
    }

    /// The twin that is the `index`-th drive of this bus, to interfere with it.
    pub fn twin(&mut self, index: usize) -> &mut Twin {
        self.bus.node_mut(index)
    }
}

/// The drives of a bus, to be switched on with their axes at rest. `seed` varies encoder noise,
/// response delays and oscillator errors.
pub fn twins(machine: &Machine, bus: usize, seed: u64) -> impl Iterator<Item = TwinConfig> {
    let drives = machine.drives.iter().enumerate();
    let drives = drives.filter(move |(_, drive)| drive.bus == bus);
    drives.map(move |(index, drive)| TwinConfig {
        initial_position: initial_position(machine, index),
        ..twin(drive.node, index, seed)
    })
}

/// The `index`-th drive of a bus or machine, its encoder at zero.
#[must_use]
pub fn twin(node: NodeId, index: usize, seed: u64) -> TwinConfig {
    TwinConfig {
        seed: seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ index as u64,
        ..TwinConfig::new(node)
    }
}

/// Where a drive's encoder stands when its axis is at rest, increments.
fn initial_position(machine: &Machine, drive: usize) -> i64 {
    let drive = &machine.drives[drive];
    // The machine file was checked: the soft limits are within the drive's range.
    let position = drive.scaling.to_increments(machine.axes[drive.axis].rest());
    position.map_or(0, |position| position.get())
}

impl Port for SimPort {
    fn advance_to(&mut self, now: Instant) {
        let origin = *self.origin.get_or_insert(now);
        let passed = origin - Instant::ZERO;
        let observer = &mut self.observer;
        (self.bus).advance_to(Instant::ZERO + (now - origin), &mut |frame| {
            observer(&Transmission {
                start: frame.start + passed,
                end: frame.end + passed,
                ..*frame
            });
        });
    }

    fn receive(&mut self, sink: &mut dyn FnMut(Received)) -> Result<(), PortError> {
        let passed = self.origin.unwrap_or(Instant::ZERO) - Instant::ZERO;
        while let Some(received) = self.bus.receive() {
            sink(Received {
                at: received.at + passed,
                frame: received.frame,
                echo: received.own,
            });
        }
        Ok(())
    }

    fn send_sync(&mut self, frame: &Frame) -> Result<(), PortError> {
        self.bus.send(Band::Sync, *frame);
        Ok(())
    }

    fn send_burst(&mut self, frames: &[Frame]) -> Result<Burst, PortError> {
        for frame in frames {
            self.bus.send(Band::Pdo, *frame);
        }
        Ok(Burst::Queued)
    }

    fn send_acyclic(&mut self, frames: &[Frame]) -> Result<(), PortError> {
        for frame in frames {
            self.bus.send(Band::Acyclic, *frame);
        }
        Ok(())
    }

    fn echoes(&self) -> bool {
        true
    }
}
