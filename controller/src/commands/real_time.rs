//! What `run` and `console` have in common: a machine on the host's clock, whose operators are heard
//! until it is off.

use super::command_log::CommandLog;
use super::log_files::{Listeners, Logs};
use super::writers::Writers;
use super::{core, duration};
use crate::control::Layout;
use crate::machine::Machine;
use crate::observe::flight_recorder::FlightRecorder;
use crate::observe::frames::{SharedFrames, VIRTUAL_ORIGIN};
use crate::port::{self, Ports, url};
use crate::realtime;
use crate::run::Progress;
use crate::run::real_time::{Pace, RealTime, Timing};
use crate::session::Session;
use std::error::Error;
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::thread;
use std::time::Duration;
use syncline_drives::world::{Observer, World};

/// How often it is looked after the session.
const POLL: Duration = Duration::from_millis(1);

/// How the cycle is timed, and what simulated drives are like.
#[derive(Debug, clap::Args)]
pub(super) struct RealTimeArgs {
    /// Varies encoder noise, response delays and oscillator errors of simulated drives.
    #[arg(long, default_value_t = 0)]
    pub(super) seed: u64,
    /// Make a late wake-up a fault on simulated buses too.
    #[arg(long)]
    strict: bool,
    /// On simulated buses, let time stand still while the planner works: the frames are those of
    /// `validate`, however slow the host is.
    #[arg(long)]
    wait_for_plan: bool,
    /// Real-time priority of the cycle, 1…99.
    #[arg(long, default_value_t = 80, value_parser = clap::value_parser!(u8).range(1..=99))]
    priority: u8,
    /// Processor core of the cycle; an isolated one is best. Without it, the last one that this
    /// process may use.
    #[arg(long, value_parser = core)]
    core: Option<usize>,
    /// Stay awake that long before each wake-up, for a core of its own: 50us.
    #[arg(long, default_value = "0us", value_parser = duration)]
    spin: Duration,
}

/// A machine's buses, open, and how the cycle on them treats time.
pub(super) struct Buses {
    pub(super) timing: Timing,
    pub(super) world: World,
    pub(super) ports: Ports,
    pub(super) written: Written,
}

/// Whether every bus is simulated: their time goes with the cycle.
pub(super) fn lockstep(machine: &Machine) -> bool {
    machine.buses.iter().all(|bus| bus.port == url::SIM)
}

impl RealTimeArgs {
    /// How the cycle of a machine treats time.
    ///
    /// # Errors
    /// Time is to stand still where a bus is real.
    fn timing(&self, machine: &Machine) -> Result<Timing, String> {
        let pace = match (lockstep(machine), self.wait_for_plan) {
            (true, true) => Pace::LockstepWithPlanner,
            (true, false) => Pace::Lockstep,
            (false, false) => Pace::HostClock,
            (false, true) => {
                return Err(
                    "--wait-for-plan has time stand still, which no real bus does: leave it out, \
                     or make `port` of every bus \"sim\""
                        .to_owned(),
                );
            }
        };
        Ok(Timing {
            settings: realtime::Settings {
                priority: self.priority,
                core: self.core.or_else(realtime::last_core),
            },
            spin: self.spin,
            pace,
            strict: self.strict,
        })
    }

    /// Opens the buses of a machine, and begins their logs.
    pub(super) fn open(&self, machine: &Machine, logs: Logs) -> Result<Buses, Box<dyn Error>> {
        let timing = self.timing(machine)?;
        let frames = SharedFrames::new(machine);
        let mut listeners = logs.listeners();
        let mut observers: Vec<Observer> = Vec::with_capacity(machine.buses.len());
        for bus in 0..machine.buses.len() {
            observers.push(if lockstep(machine) {
                Box::new(frames.relay(bus))
            } else {
                listeners.overhear(bus, frames.clone())?
            });
        }
        if lockstep(machine) {
            listeners.catch_up(frames.clone())?;
        }
        let (world, ports) = port::open(machine, self.seed, observers)?;
        for port in &ports {
            port.notes().iter().for_each(|note| eprintln!("{note}"));
        }
        let mut writers = Writers::default();
        logs.record(machine, &frames, &mut listeners, &mut writers)?;
        Ok(Buses {
            timing,
            world,
            ports,
            written: Written {
                frames,
                listeners,
                writers,
            },
        })
    }
}

/// What is written beside the motion.
pub(super) struct Written {
    pub(super) frames: SharedFrames,
    pub(super) listeners: Listeners,
    pub(super) writers: Writers,
}

impl Written {
    /// Writes what is left to write; what is incomplete.
    pub(super) fn finish(self) -> Vec<Box<dyn Error>> {
        let mut problems: Vec<Box<dyn Error>> = Vec::new();
        drop(self.listeners);
        problems.extend(self.frames.finish_log().err().map(Into::into));
        problems.extend(self.writers.finish().into_iter().map(Into::into));
        problems
    }
}

/// Instant zero of a machine, since 1970. One whose buses are all simulated has a time of its own.
pub(super) fn origin(machine: &Machine) -> Duration {
    match lockstep(machine) {
        true => VIRTUAL_ORIGIN,
        false => Duration::from_nanos(realtime::wall_clock_offset()),
    }
}

/// Has what leads to a fault written beside the machine's file, unless that wants none.
pub(super) fn record_faults(
    session: &mut Session<RealTime>,
    file: &Path,
    machine: &Machine,
    layout: &Arc<Layout>,
) {
    let folder = FlightRecorder::folder(file);
    if let Some(recorder) = FlightRecorder::new(machine, layout, folder, origin(machine)) {
        session.record_faults(recorder);
    }
}

/// Has the operators heard until the machine is off, and writes what they commanded.
pub(super) fn attend(
    session: &mut Session<RealTime>,
    mut commands: Option<CommandLog>,
) -> io::Result<()> {
    loop {
        let progress = session.advance();
        commands.as_mut().map_or(Ok(()), CommandLog::follow)?;
        match progress {
            Progress::More => {}
            Progress::Idle => thread::sleep(POLL),
            Progress::Ended => return Ok(()),
        }
    }
}
