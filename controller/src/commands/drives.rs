//! `syncline drives`: a machine's drives, simulated on real buses.

use super::ports::PortChoice;
use super::{Exit, bad_input, report};
use crate::drive_host;
use crate::machine::{Bus, Machine};
use crate::port::url::{self, BusUrl, End, NoBus};
use crate::port::wire::Wire;
use crate::port::{PortError, sim};
use crate::realtime::{self, Settings};
use std::error::Error;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

/// Below a controller's on the same host.
const PRIORITY: u8 = 50;

/// Simulate a machine's drives on real buses, until Ctrl-C.
///
/// Each drive of the machine file comes up on its bus as the device would, to be used by
/// `syncline run` elsewhere or by any other CANopen master.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Machine file (TOML).
    machine: PathBuf,
    #[command(flatten)]
    ports: PortChoice,
    /// Varies encoder noise, response delays and oscillator errors.
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

impl Args {
    /// Hosts the drives.
    pub(super) fn execute(self) -> Exit {
        let machine = match self.prepare() {
            Ok(machine) => machine,
            Err(error) => return bad_input(&*error),
        };
        match self.host(&machine) {
            Ok(()) => Exit::Finished,
            Err(error) => {
                report(&*error);
                Exit::Stopped
            }
        }
    }

    fn prepare(&self) -> Result<Machine, Box<dyn Error>> {
        let mut machine = Machine::load(&self.machine)?;
        self.ports.apply(&mut machine)?;
        if let Some(bus) = machine.buses.iter().find(|bus| bus.port == url::SIM) {
            return Err(Box::new(NotReal(bus.name.clone())));
        }
        Ok(machine)
    }

    fn host(&self, machine: &Machine) -> Result<(), Box<dyn Error>> {
        let stop = Arc::new(AtomicBool::new(false));
        let asked = Arc::clone(&stop);
        ctrlc::set_handler(move || asked.store(true, Ordering::Relaxed))?;
        let ended: Result<(), PortError> = thread::scope(|scope| {
            let hosts: Vec<_> = (machine.buses.iter().enumerate())
                .map(|(bus, spec)| {
                    let mut twins: Vec<_> = sim::twins(machine, bus, self.seed).collect();
                    let stop = &stop;
                    scope.spawn(move || {
                        let _granted = realtime::enter(&Settings {
                            priority: PRIORITY,
                            core: None,
                        });
                        let ended = open(spec)
                            .and_then(|mut bus| drive_host::host(&mut bus, &mut twins, stop));
                        // One bus gone ends the machine.
                        stop.store(true, Ordering::Relaxed);
                        ended
                    })
                })
                .collect();
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
}

/// The bus to be these drives' bus.
fn open(spec: &Bus) -> Result<Box<dyn Wire + Send>, PortError> {
    let url: BusUrl = spec.port.parse().map_err(|error: NoBus| PortError {
        bus: spec.name.clone(),
        what: error.to_string(),
    })?;
    url.open(spec.bitrate, End::Host)
}

#[derive(Debug, thiserror::Error)]
#[error("bus {0} is simulated within `run`: give it a real one, such as --bus vcan0")]
struct NotReal(String);
