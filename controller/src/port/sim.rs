//! The simulated part of a machine: its world, and ports to the buses in it.

use super::{Port, PortError};
use crate::bus::{Burst, Received};
use crate::machine::{
    Axis, COORDINATES, Gantry, Input, InputMeaning, Machine, Seat, Simulation, SpindleDrive,
};
use syncline_canopen::{Frame, NodeId};
use syncline_drives::bus::{Band, BitRate};
use syncline_drives::mechanics::rigid::Rigid;
use syncline_drives::mechanics::rigid_beam::{RigidBeam, Side};
use syncline_drives::mechanics::touch_probe::TouchProbe;
use syncline_drives::model::{Address, Increments, Model};
use syncline_drives::twin::servo::encoder::Scale;
use syncline_drives::twin::{Config, Disturbance, Kind, Sensor, SimulatedDevice};
use syncline_drives::world::{
    BusId, DeviceId, EnableChain, FittedProbe, Hosted, Observer, ProbeDrive, ProbeWire, Ties, World,
};
use syncline_gcode as gcode;

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

    fn simulated(&self) -> Option<BusId> {
        Some(self.bus)
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
    /// For each [device](Machine::nodes) of the machine, its twin.
    pub devices: Vec<Option<DeviceId>>,
}

impl Simulated {
    /// The buses for which `observers` has an observer, which sees every frame in bus order. Their
    /// axes [stand](Axis::stands) where the machine file says, once time passes.
    ///
    /// `seed` varies encoder noise, response delays and oscillator errors; `configure` may change
    /// a device, given by its index, before it is made.
    ///
    /// # Errors
    /// If a bus cannot be simulated at its bit rate, or mechanics tie a simulated drive to one
    /// that is not.
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
        let devices = machine.nodes().enumerate().map(|(index, node)| {
            let mut config = config(machine, index, seed);
            configure(index, &mut config);
            let bus = buses[node.bus]?;
            Some(world.attach(bus, released(machine, index, &config)))
        });
        let devices: Vec<Option<DeviceId>> = devices.collect();
        tie(machine, world.ties(), |device| devices[device])?;
        Ok(Self {
            world,
            buses,
            devices,
        })
    }
}

/// The devices of one bus of a machine, to be hosted where others reach them.
///
/// `seed` and `configure` are as with [`Simulated::new`].
///
/// # Errors
/// If mechanics tie one of them to a drive of another bus, which has a clock of its own.
pub fn hosted(
    machine: &Machine,
    bus: usize,
    seed: u64,
    mut configure: impl FnMut(&mut Config),
) -> Result<Hosted, PortError> {
    let nodes = machine.nodes().enumerate();
    let (drives, devices): (Vec<usize>, Vec<_>) = nodes
        .filter(|(_, node)| node.bus == bus)
        .map(|(index, _)| {
            let mut config = config(machine, index, seed);
            configure(&mut config);
            (index, released(machine, index, &config))
        })
        .unzip();
    let mut hosted = Hosted::new(devices);
    tie(machine, hosted.ties(), |device| {
        let place = drives.iter().position(|it| *it == device);
        place.map(Hosted::at)
    })?;
    Ok(hosted)
}

/// Ties together what a machine's mechanics and wires do, by where each of its devices is in a world.
///
/// # Errors
/// Some of what is tied together is in it and some is not, or mechanics cannot be computed.
fn tie(
    machine: &Machine,
    mut ties: Ties<'_>,
    device: impl Fn(usize) -> Option<DeviceId>,
) -> Result<(), PortError> {
    for axis in &machine.axes {
        let Some(tied) = Tied::of(machine, axis) else {
            continue;
        };
        let here = |drives: &[usize]| -> Vec<DeviceId> {
            drives.iter().filter_map(|it| device(*it)).collect()
        };
        let (sides, watched) = (here(&axis.drives), here(&tied.watched));
        if sides.len() == axis.drives.len() && watched.len() == tied.watched.len() {
            ties.couple(tied.mechanics(machine, axis)?, &sides, &watched);
        } else if !sides.is_empty() {
            return Err(tied.split(machine, axis));
        }
    }
    for shaft in Shaft::all(machine) {
        match (device(shaft.encoder), device(shaft.drive)) {
            (Some(encoder), Some(drive)) => ties.follow(encoder, drive, shaft.ratio),
            (None, None) => {}
            _ => return Err(shaft.split(machine)),
        }
    }
    for (index, speed) in turned(machine) {
        if let Some(encoder) = device(index) {
            ties.turn(encoder, speed);
        }
    }
    for touched in machine.touched.all() {
        if let Some(probe) = fitted_probe(machine, touched, &device)? {
            ties.fit_probe(probe);
        }
    }
    if let Some(chain) = enable_chain(machine, &device) {
        ties.feed_through(chain);
    }
    for bus in &machine.dc_buses {
        ties.join_dc_buses(joined(machine, bus, &device)?);
    }
    Ok(())
}

/// A [device](Machine::nodes) of a machine by its index, to be switched on where its axis
/// [stands](Axis::stands).
#[must_use]
pub fn config(machine: &Machine, index: usize, seed: u64) -> Config {
    let node = machine.node(index);
    let config = Config {
        bit_rate: BitRate::from_kbit(machine.buses[node.bus].bitrate / 1000),
        assumed: machine.assumed(node.model).0,
        analog_inputs: (machine.analog_inputs.iter())
            .filter(|input| input.node == index)
            .filter_map(|input| Some((input.place as u8, input.course()?)))
            .collect(),
        dictionary: node.model.generic.map(|_| node.model.dictionary),
        mapped: mapped(machine, index),
        ..single(node.id, index, seed)
    };
    let Some(Seat { axis, scaling }) = node.seat else {
        let spindle = machine.spindle_drive().filter(|(place, _)| *place == index);
        return spindle.map_or(config.clone(), |(_, drive)| turning(drive, config, seed));
    };
    let axis = &machine.axes[axis];
    let side = axis.drives.iter().position(|it| *it == index);
    let turns = |mm: f64| {
        let count = scaling.to_increments(mm);
        count.map_or(0.0, |count| scaling.to_revolutions(count))
    };
    let stands = match side {
        Some(side) => axis.drive_stands(side, seed),
        None => axis.stands(0, seed),
    };
    let config = Config {
        position: turns(stands),
        ..config
    };
    if !node.model.is_drive() {
        return config;
    }
    let range = |(from, to): (f64, f64)| {
        let (from, to) = (turns(from), turns(to));
        from.min(to)..from.max(to)
    };
    let simulation = axis.simulation.as_ref();
    let own = simulation.and_then(Simulation::driven);
    Config {
        axis: own.map(|it| machine.at_shaft(index, &it)),
        encoder: simulation.and_then(|it| it.encoder),
        scale: simulation.and_then(|it| it.scale).map(|step| Scale {
            step: step / scaling.travel_per_revolution().abs(),
        }),
        sensors: sensors(machine, index, turns),
        reference_switch: simulation.and_then(|it| it.switches.reference.map(range)),
        limit_switches: simulation.and_then(|it| it.switches.limits.map(range)),
        ..config
    }
}

/// What the maker of a device that a file describes has mapped into its PDOs, as the controller takes it to be.
fn mapped(machine: &Machine, index: usize) -> Vec<(Address, i64)> {
    if machine.node(index).model.generic.is_none() {
        return Vec::new();
    }
    let device = machine.device(index);
    let identity = device.spec().identity.iter();
    let mapped = identity.filter(|it| (0x1600..0x1C00).contains(&it.address.index));
    mapped.map(|it| (it.address, it.value.into())).collect()
}

/// A drive that turns a spindle.
fn turning(drive: &SpindleDrive, config: Config, seed: u64) -> Config {
    let simulation = drive.simulation.as_ref();
    let travel = drive.scaling.travel_per_revolution();
    let start = simulation.and_then(|it| it.start);
    let start = start.map_or(0.0, |it| it.drawn(seed, 2 * COORDINATES as u64));
    let start = drive.scaling.to_increments(start);
    Config {
        position: start.map_or(0.0, |count| drive.scaling.to_revolutions(count)),
        axis: simulation.map(|it| it.axis.at_shaft(&drive.scaling, travel.abs(), true)),
        ripple: simulation.and_then(|it| it.ripple),
        encoder: simulation.and_then(|it| it.encoder),
        ..config
    }
}

/// The probe of a machine with work pieces that it may touch, by where each of its devices is in a world.
///
/// # Errors
/// Some are in it, others are not.
fn fitted_probe(
    machine: &Machine,
    (probe, told): (&TouchProbe, InputMeaning),
    device: impl Fn(usize) -> Option<DeviceId>,
) -> Result<Option<FittedProbe>, PortError> {
    let moving = |letter: gcode::AxisLetter| machine.axes.iter().find(|axis| axis.letter == letter);
    let axes = [
        gcode::AxisLetter::X,
        gcode::AxisLetter::Y,
        gcode::AxisLetter::Z,
    ]
    .map(moving);
    let probes = machine.inputs.iter().filter(|input| input.meaning == told);
    let drives = axes.iter().flatten().flat_map(|axis| axis.drives.clone());
    let concerned: Vec<usize> = drives
        .chain(probes.clone().map(|input| input.node))
        .collect();
    let here = concerned
        .iter()
        .filter(|&&index| device(index).is_some())
        .count();
    if here == 0 {
        return Ok(None);
    }
    if here < concerned.len() {
        return Err(PortError {
            bus: machine.buses[machine.node(concerned[0]).bus].name.clone(),
            what: "the work pieces or the tool setter of [simulation] are touched by what is not simulated by one clock: let all \
                   buses be \"sim\", put all devices on one bus, or take them out"
                .to_owned(),
        });
    }
    let drives = |axis: Option<&Axis>| {
        let drives = axis.iter().flat_map(|axis| &axis.drives);
        let drives = drives.filter_map(|&drive| {
            let scaling = &machine.drives[drive].scaling;
            Some(ProbeDrive {
                device: device(drive)?,
                zero: scaling.to_mm(Increments::ZERO),
                travel: scaling.travel_per_revolution(),
            })
        });
        drives.collect()
    };
    let wires = probes.filter_map(|input| {
        Some(ProbeWire {
            device: device(input.node)?,
            input: input.signal as u8,
            inverted: input.active_low,
        })
    });
    Ok(Some(FittedProbe {
        probe: probe.clone(),
        axes: axes.map(drives),
        wires: wires.collect(),
    }))
}

/// The drives of a joined DC bus, by where each is in a world: all of them, or none.
///
/// # Errors
/// Some are elsewhere, and have another clock.
fn joined(
    machine: &Machine,
    bus: &[usize],
    device: impl Fn(usize) -> Option<DeviceId>,
) -> Result<Vec<DeviceId>, PortError> {
    let here: Vec<DeviceId> = bus.iter().filter_map(|&drive| device(drive)).collect();
    let split = !here.is_empty() && here.len() < bus.len();
    let first = bus.first().filter(|_| split);
    first.map_or(Ok(here), |&drive| {
        let drive = &machine.drives[drive];
        Err(PortError {
            bus: machine.buses[drive.bus].name.clone(),
            what: format!(
                "the DC bus of {} is joined to drives that are not simulated by the same clock",
                drive.name
            ),
        })
    })
}

/// The enable chain of a machine with the drives that it has to stop, by where each of its devices is in a world. What
/// is elsewhere it does not feed.
fn enable_chain(
    machine: &Machine,
    device: impl Fn(usize) -> Option<DeviceId>,
) -> Option<EnableChain> {
    let output = machine.enable_chain()?;
    let stopped = machine.axes.iter().filter(|axis| axis.hardware_stops);
    let drives = stopped.flat_map(|axis| &axis.drives);
    Some(EnableChain {
        device: device(output.node)?,
        output: output.signal as u8,
        inverted: output.active_low,
        feeds: drives.filter_map(|&drive| device(drive)).collect(),
    })
}

/// The switches along the axis of a drive that are wired to it, their places in `turns` of its shaft.
fn sensors(machine: &Machine, drive: usize, turns: impl Fn(f64) -> f64) -> Vec<Sensor> {
    let wired = machine.inputs.iter().filter(|input| input.node == drive);
    let sensors = wired.filter_map(|input| {
        let (from, to) = input.simulated?;
        let (from, to) = (turns(from), turns(to));
        Some(Sensor {
            input: input.signal as u8,
            range: from.min(to)..from.max(to),
            inverted: input.active_low,
        })
    });
    sensors.collect()
}

/// The `index`-th drive of a bus or machine, its encoder at zero.
#[must_use]
pub fn single(node: NodeId, index: usize, seed: u64) -> Config {
    Config {
        seed: seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ index as u64,
        ..Config::new(node)
    }
}

/// The twin of a [device](Machine::nodes) of a machine. What holds the machine while it is on, and is on without
/// current, has current: nobody presses it, and no door is open.
fn released(machine: &Machine, index: usize, config: &Config) -> Box<dyn SimulatedDevice> {
    let mut device = twin(machine.node(index).model, config);
    let holds =
        |input: &&Input| matches!(input.meaning, InputMeaning::FeedHold | InputMeaning::Door);
    let wired = machine.inputs.iter().filter(|input| input.node == index);
    for input in wired.filter(holds).filter(|input| input.active_low) {
        device.disturb(Disturbance::Input(input.signal as u8, true));
    }
    device
}

/// The twin of a model.
///
/// # Panics
/// Never: every model has one, as a test holds.
#[must_use]
pub fn twin(model: &Model, config: &Config) -> Box<dyn SimulatedDevice> {
    let kind = Kind::by_name(model.generic.unwrap_or(model).name).expect("every model has a twin");
    (kind.make)(config)
}

/// One side of a beam, from the rotor to its end.
fn side(machine: &Machine, drive: usize, simulation: &Simulation) -> Side {
    let train = machine.at_shaft(drive, &simulation.felt()).train;
    let travel = machine.axes[machine.drives[drive].axis].mm_per_revolution / 1000.0;
    Side {
        travel: machine.drives[drive].scaling.direction().sign() * travel,
        rigid: Rigid {
            motor_inertia: train.rotor_inertia,
            viscous_friction: train.bearing.viscous + train.guide.viscous,
            coulomb_friction: train.bearing.coulomb + train.guide.coulomb,
            load_torque: train.load_torque,
            brake_torque: train.brake.torque,
            ..Rigid::default()
        },
    }
}

/// Encoders on shafts of their own, by their indices among the machine's devices, with how fast those turn, 1/s.
fn turned(machine: &Machine) -> impl Iterator<Item = (usize, f64)> {
    machine.measured().map(|(index, encoder)| {
        let speed = encoder.simulated_speed / encoder.scaling.travel_per_revolution();
        (index, speed)
    })
}

/// The shaft of an encoder, which the axis that it sees turns.
struct Shaft {
    /// By their indices among the machine's devices.
    encoder: usize,
    drive: usize,
    /// Revolutions of it for one of the drive's motor.
    ratio: f64,
}

impl Shaft {
    /// Of all encoders of a machine. What one sees of a gantry pair is its first side.
    fn all(machine: &Machine) -> impl Iterator<Item = Self> {
        let encoders = machine.encoders.iter().enumerate();
        encoders.filter_map(|(index, encoder)| {
            let drive = machine.axes[encoder.axis?].drives[0];
            let [own, motor] = [&encoder.scaling, &machine.drives[drive].scaling];
            Some(Self {
                encoder: machine.drives.len() + index,
                drive,
                ratio: motor.travel_per_revolution() / own.travel_per_revolution(),
            })
        })
    }

    /// It is turned by a drive that does not live by its clock.
    fn split(&self, machine: &Machine) -> PortError {
        let encoder = &machine.encoders[self.encoder - machine.drives.len()];
        let drive = &machine.drives[self.drive];
        let bus = |index: usize| {
            let bus = &machine.buses[index];
            format!("bus {} (port {})", bus.name, bus.port)
        };
        PortError {
            bus: machine.buses[encoder.bus].name.clone(),
            what: format!(
                "encoder {} on {} is turned by drive {} on {}, and they are not simulated by one clock: \
                 let both buses be \"sim\", or put both on one bus",
                encoder.name,
                bus(encoder.bus),
                drive.name,
                bus(drive.bus)
            ),
        }
    }
}

/// What ties the drives of an axis together.
struct Tied<'m> {
    simulation: &'m Simulation,
    gantry: &'m Gantry,
    /// The drive whose motion the beam has to know, if there is one.
    watched: Vec<usize>,
}

impl<'m> Tied<'m> {
    /// Of an axis, if anything does.
    fn of(machine: &Machine, axis: &'m Axis) -> Option<Self> {
        let simulation = axis.simulation.as_ref()?;
        let gantry = simulation.gantry.as_ref()?;
        let carriage = gantry.carriage.as_ref();
        let mover = carriage.and_then(|carriage| carriage.axis(&machine.axes));
        Some(Self {
            simulation,
            gantry,
            watched: mover.map_or(Vec::new(), |axis| machine.axes[axis].drives.clone()),
        })
    }

    /// A beam between both sides, with what runs along it.
    ///
    /// # Errors
    /// If its numbers are beyond what can be counted with.
    fn mechanics(&self, machine: &Machine, axis: &Axis) -> Result<RigidBeam, PortError> {
        let sides = axis.drives.iter();
        let sides: Vec<Side> = sides
            .map(|&drive| side(machine, drive, self.simulation))
            .collect();
        let sides: Option<[Side; 2]> = sides.try_into().ok();
        let beam = sides.and_then(|sides| RigidBeam::new(self.gantry.beam, sides));
        let beam = beam.ok_or_else(|| {
            let why = "cannot be computed with these masses and this travel for a revolution";
            refusal(machine, axis, why)
        })?;
        Ok(match (&self.gantry.carriage, &self.watched[..]) {
            (Some(carriage), &[drive]) => {
                let drive = &machine.drives[drive];
                beam.carrying(carriage.at_shaft(&machine.axes[drive.axis], &drive.scaling))
            }
            _ => beam,
        })
    }

    /// It ties drives together which do not live by one clock.
    fn split(&self, machine: &Machine, axis: &Axis) -> PortError {
        let drives = axis.drives.iter().chain(&self.watched).map(|drive| {
            let drive = &machine.drives[*drive];
            let bus = &machine.buses[drive.bus];
            format!("{} on bus {} (port {})", drive.name, bus.name, bus.port)
        });
        let drives: Vec<String> = drives.collect();
        let why = format!(
            "ties together {}, which are not simulated by one clock: let both buses be \"sim\", put both \
             drives on one bus, or take `simulation` out",
            drives.join(" and ")
        );
        refusal(machine, axis, &why)
    }
}

fn refusal(machine: &Machine, axis: &Axis, why: &str) -> PortError {
    let bus = axis.drives.first().map(|drive| machine.drives[*drive].bus);
    PortError {
        bus: bus.map_or(String::new(), |bus| machine.buses[bus].name.clone()),
        what: format!("axis {}: rigid_beam {why}", axis.name()),
    }
}
