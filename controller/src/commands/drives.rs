//! `syncline drives`: drives simulated on real buses.

use super::ports::PortChoice;
use super::tool::NodeOfTwin;
use super::{Exit, bad_input, report};
use crate::drive_host;
use crate::machine::Machine;
use crate::port::socketcand::Beacon;
use crate::port::url::{BusUrl, End};
use crate::port::wire::Wire;
use crate::port::{PortError, sim};
use crate::realtime::{self, Settings};
use crossbeam::channel::Receiver;
use std::error::Error;
use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};
use syncline_canopen::NodeId;
use syncline_drives::bus::BitRate;
use syncline_drives::twin::Config;
use syncline_drives::world::Hosted as Devices;

/// Below a controller's on the same host.
const PRIORITY: u8 = 50;

/// Simulate drives on real buses, until Ctrl-C.
///
/// Each drive of the machine file, or each --node, comes up on its bus as the device would, to be
/// used by `syncline run` elsewhere or by any other CANopen master. Says which drives are on which
/// bus, a line each, once they are there.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Machine file (TOML).
    #[arg(required_unless_present = "nodes")]
    machine: Option<PathBuf>,
    /// A single device instead of a machine's drives, such as 1:lxm32m or 5:twk_crn. Can be
    /// repeated.
    #[arg(
        long = "node",
        value_name = "ID:DEVICE",
        conflicts_with = "machine",
        requires = "bus"
    )]
    nodes: Vec<NodeOfTwin>,
    #[command(flatten)]
    ports: PortChoice,
    /// Bit rate of the bus with the --node drives, bit/s.
    #[arg(long, default_value_t = 1_000_000, conflicts_with = "machine")]
    bitrate: u32,
    /// For masters on ordinary computers: SYNC may come when it likes, missing setpoints are
    /// ridden out by holding the last one, the first setpoint may be anywhere.
    #[arg(long)]
    tolerant: bool,
    /// Answer at once, not after the time that a drive's processor takes.
    #[arg(long)]
    prompt: bool,
    /// Announce socketcand buses every 3 s on UDP port 42000 of their network.
    #[arg(long)]
    beacon: bool,
    /// Varies encoder noise, response delays and oscillator errors.
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

/// A bus to be, with its drives.
struct Hosted {
    url: BusUrl,
    bitrate: u32,
    /// `X1 = node 1 (LXM32M)`.
    names: Vec<String>,
    drives: Devices,
}

impl Args {
    /// Hosts the drives.
    pub(super) fn execute(self) -> Exit {
        let opened = match self.prepare().and_then(|buses| self.open(buses)) {
            Ok(opened) => opened,
            Err(error) => return bad_input(&*error),
        };
        match host(opened) {
            Ok(()) => Exit::Finished,
            Err(error) => {
                report(&*error);
                Exit::Stopped
            }
        }
    }

    fn prepare(&self) -> Result<Vec<Hosted>, Box<dyn Error>> {
        let buses = match &self.machine {
            Some(file) => {
                let mut machine = Machine::load(file)?;
                self.ports.apply(&mut machine)?;
                self.machine_buses(&machine)?
            }
            None => vec![self.single_nodes()?],
        };
        if let Some(bus) = buses.iter().find(|bus| bus.url == BusUrl::Sim) {
            return Err(NotReal(bus.names.join(", ")).into());
        }
        let served = |bus: &Hosted| matches!(bus.url, BusUrl::Socketcand { .. });
        if self.beacon && !buses.iter().any(served) {
            return Err("--beacon: no bus is served by socketcand://".into());
        }
        Ok(buses)
    }

    fn configure(&self, config: &mut Config) {
        config.tolerant = self.tolerant;
        config.prompt = self.prompt;
    }

    fn machine_buses(&self, machine: &Machine) -> Result<Vec<Hosted>, Box<dyn Error>> {
        let host = |(index, bus): (usize, &crate::machine::Bus)| {
            let nodes = machine.nodes().filter(|node| node.bus == index);
            Ok(Hosted {
                url: bus.port.parse()?,
                bitrate: bus.bitrate,
                names: nodes
                    .map(|node| format!("{} = {}", node.name, describe(node.id, node.model.title)))
                    .collect(),
                drives: sim::hosted(machine, index, self.seed, |config| self.configure(config))?,
            })
        };
        machine.buses.iter().enumerate().map(host).collect()
    }

    fn single_nodes(&self) -> Result<Hosted, Box<dyn Error>> {
        let ids = self.nodes.iter().map(|single| single.node);
        for (index, node) in ids.clone().enumerate() {
            if ids.clone().take(index).any(|other| other == node) {
                return Err(format!("--node: two drives with node id {node}").into());
            }
        }
        Ok(Hosted {
            url: self.ports.only()?,
            bitrate: self.bitrate,
            names: (self.nodes.iter())
                .map(|single| describe(single.node, single.twin.title))
                .collect(),
            drives: Devices::new(
                (self.nodes.iter().enumerate())
                    .map(|(index, single)| {
                        let mut config = sim::single(single.node, index, self.seed);
                        self.configure(&mut config);
                        config.bit_rate = BitRate::from_kbit(self.bitrate / 1000);
                        (single.twin.make)(&config)
                    })
                    .collect(),
            ),
        })
    }

    fn open(&self, buses: Vec<Hosted>) -> Result<Opened, Box<dyn Error>> {
        let mut opened = Opened::default();
        for bus in buses {
            let mut wire = bus.url.open(bus.bitrate, End::Host)?;
            opened.notices.extend(wire.notices());
            if self.beacon
                && let BusUrl::Socketcand { address, bus } = wire.name().parse()?
            {
                opened.beacons.push(Beacon::new(&address, &bus)?);
            }
            opened.buses.push((wire, bus));
        }
        Ok(opened)
    }
}

/// Buses that are open.
#[derive(Default)]
struct Opened {
    buses: Vec<(Box<dyn Wire + Send>, Hosted)>,
    beacons: Vec<Beacon>,
    notices: Vec<Receiver<String>>,
}

fn host(opened: Opened) -> Result<(), Box<dyn Error>> {
    let Opened {
        buses,
        beacons,
        notices,
    } = opened;
    let stop = Arc::new(AtomicBool::new(false));
    let asked = Arc::clone(&stop);
    ctrlc::set_handler(move || asked.store(true, Ordering::Relaxed))?;
    let start = realtime::now();
    let ended: Result<(), PortError> = thread::scope(|scope| {
        let mut hosts = Vec::new();
        for (mut wire, bus) in buses {
            announce(&*wire, &bus);
            let stop = &stop;
            hosts.push(scope.spawn(move || {
                let _granted = realtime::enter(&Settings {
                    priority: PRIORITY,
                    core: None,
                });
                let mut drives = bus.drives;
                let ended = drive_host::host(&mut wire, &mut drives, start, stop);
                // One bus gone ends the machine.
                stop.store(true, Ordering::Relaxed);
                ended
            }));
        }
        watch(&beacons, &notices, &stop);
        for host in hosts {
            match host.join() {
                Ok(ended) => ended?,
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
        Ok(())
    });
    Ok(ended?)
}

fn describe(node: NodeId, title: &str) -> String {
    format!("node {node} ({title})")
}

/// Says what is hosted where.
fn announce(wire: &dyn Wire, bus: &Hosted) {
    let reach = match &bus.url {
        BusUrl::Udp { interface, .. } => {
            format!("; multicast on interface {interface} only, ?interface=NAME chooses")
        }
        _ => String::new(),
    };
    let drives = bus.names.join(", ");
    // Nobody reading any more is fine.
    let _ = writeln!(io::stdout(), "{} carries {drives}{reach}", wire.name());
}

/// Sends beacons and tells what buses have to say, until `stop` is set.
fn watch(beacons: &[Beacon], notices: &[Receiver<String>], stop: &AtomicBool) {
    let mut next = Instant::now();
    while !stop.load(Ordering::Relaxed) {
        if Instant::now() >= next {
            beacons.iter().for_each(Beacon::send);
            next += Beacon::INTERVAL;
        }
        for line in notices.iter().flat_map(Receiver::try_iter) {
            eprintln!("{line}");
        }
        thread::sleep(Duration::from_millis(50));
    }
}

#[derive(Debug, thiserror::Error)]
#[error("the bus of {0} is simulated within `run`: give it a real one, such as --bus vcan0")]
struct NotReal(String);
