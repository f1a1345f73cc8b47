//! Files for the traffic of buses.

use super::output::Named;
use crate::bus_log::{BusLog, LogFile};
use crate::machine::Machine;
use crate::port::sim::Observer;
use crate::port::url::{BusUrl, End};
use crate::port::wire::Wire;
use crate::port::{PortError, url};
use crate::realtime;
use crate::run::frames::{SharedFrames, VIRTUAL_ORIGIN};
use rtrb::RingBuffer;
use std::error::Error;
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;
use syncline_drives::bus::Transmission;

/// Where frames go.
#[derive(Debug, clap::Args)]
pub(super) struct LogFiles {
    /// Write all frames as a text log, as `candump -L` does (`-`: to standard output).
    #[arg(long, value_name = "FILE")]
    candump: Option<PathBuf>,
    /// Write all frames as packets for Wireshark and tshark.
    #[arg(long, value_name = "FILE")]
    pcapng: Option<PathBuf>,
}

/// A log that cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}", file.display())]
pub(super) struct NoLog {
    file: PathBuf,
    source: io::Error,
}

impl LogFiles {
    /// Creates the files, if any are wanted, for buses with these names.
    pub(super) fn begin(&self, buses: Vec<String>) -> Result<Option<BusLog>, NoLog> {
        let file = |path: &Option<PathBuf>| path.as_deref().map(create).transpose();
        let (candump, packets) = (file(&self.candump)?, file(&self.pcapng)?);
        if candump.is_none() && packets.is_none() {
            return Ok(None);
        }
        let log = BusLog::begin(buses, candump, packets).map_err(|source| NoLog {
            file: self.pcapng.clone().unwrap_or_default(),
            source,
        })?;
        Ok(Some(log))
    }

    fn of_machine(&self, machine: &Machine) -> Result<Option<BusLog>, NoLog> {
        self.begin(machine.buses.iter().map(|bus| bus.name.clone()).collect())
    }

    /// Has the frames of a machine in virtual time written.
    pub(super) fn record_virtual(
        &self,
        machine: &Machine,
        frames: &SharedFrames,
    ) -> Result<(), NoLog> {
        if let Some(log) = self.of_machine(machine)? {
            frames.write_to(log, VIRTUAL_ORIGIN);
        }
        Ok(())
    }

    /// Has the frames of a machine in real time written, by listeners of their own on the buses
    /// that are not simulated: the cycle does nothing for it.
    pub(super) fn record(
        &self,
        machine: &Machine,
        frames: &SharedFrames,
    ) -> Result<Listeners, Box<dyn Error>> {
        let mut listeners = Listeners::default();
        let Some(log) = self.of_machine(machine)? else {
            return Ok(listeners);
        };
        listeners.logs = true;
        let mut wires = Vec::new();
        for (bus, spec) in machine.buses.iter().enumerate() {
            if spec.port != url::SIM {
                let url: BusUrl = spec.port.parse()?;
                wires.push((bus, url.open(spec.bitrate, End::Client)?));
            }
        }
        // A machine whose buses are all simulated has a time of its own.
        let origin = if wires.is_empty() {
            VIRTUAL_ORIGIN
        } else {
            Duration::from_nanos(realtime::wall_clock_offset())
        };
        frames.write_to(log, origin);
        for (bus, wire) in wires {
            listeners.listen(bus, wire, frames.clone())?;
        }
        Ok(listeners)
    }
}

/// How long a listener waits at a time, and for the last frames.
const LISTEN: Duration = Duration::from_millis(20);

/// Frames of a simulated bus on their way to its listener.
const OVERHEARD: usize = 4096;

/// Threads that write what buses carry into a machine's log, until this value goes.
#[derive(Default)]
pub(super) struct Listeners {
    /// There is a log.
    logs: bool,
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Listeners {
    fn listen(
        &mut self,
        bus: usize,
        mut wire: Box<dyn Wire + Send>,
        frames: SharedFrames,
    ) -> io::Result<()> {
        let stop = Arc::clone(&self.stop);
        let mut listen = move |frames: &SharedFrames| -> Result<(), PortError> {
            let mut end = None;
            while end.is_none_or(|end| realtime::now() < end) {
                wire.wait(LISTEN)?;
                while wire.receive(&mut |at, frame| frames.heard(bus, at, frame))? {}
                if end.is_none() && stop.load(Ordering::Relaxed) {
                    end = Some(realtime::now() + LISTEN);
                }
            }
            Ok(())
        };
        self.spawn(move || {
            if let Err(error) = listen(&frames) {
                frames.fail(io::Error::other(error));
            }
        })
    }

    /// What sees the frames of a simulated bus beside real ones: there the cycle waits for nobody,
    /// and only hands them to a listener.
    pub(super) fn overhear(&mut self, bus: usize, frames: SharedFrames) -> io::Result<Observer> {
        if !self.logs {
            return Ok(Box::new(|_| ()));
        }
        let (mut tell, mut hear) = RingBuffer::<Transmission>::new(OVERHEARD);
        let missed = Arc::new(AtomicU64::new(0));
        let (stop, lost) = (Arc::clone(&self.stop), Arc::clone(&missed));
        self.spawn(move || {
            let mut last = false;
            while !last {
                last = stop.load(Ordering::Relaxed);
                while let Ok(frame) = hear.pop() {
                    frames.heard(bus, frame.end, &frame.frame);
                }
                let lost = lost.load(Ordering::Relaxed);
                if lost > 0 {
                    frames.fail(io::Error::other(format!("{lost} frames came too fast")));
                }
                thread::sleep(LISTEN);
            }
        })?;
        Ok(Box::new(move |frame| {
            if tell.push(*frame).is_err() {
                missed.fetch_add(1, Ordering::Relaxed);
            }
        }))
    }

    fn spawn(&mut self, listen: impl FnOnce() + Send + 'static) -> io::Result<()> {
        let thread = thread::Builder::new().name("listener".into());
        self.threads.push(thread.spawn(listen)?);
        Ok(())
    }
}

impl Drop for Listeners {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            // One that panicked has said so.
            let _ = thread.join();
        }
    }
}

fn create(file: &Path) -> Result<LogFile, NoLog> {
    if file == Path::new("-") {
        return Ok(Box::new(io::stdout()));
    }
    match File::create(file) {
        Ok(opened) => Ok(Box::new(BufWriter::new(Named::new(file, opened)))),
        Err(source) => Err(NoLog {
            file: file.to_owned(),
            source,
        }),
    }
}
