//! Files for the traffic of buses.

use super::output::{Claims, NoOutput, Target};
use super::real_time::origin;
use super::writers::Writers;
use crate::bus_log::{BusLog, LogFile};
use crate::machine::Machine;
use crate::observe::frames::{SharedFrames, VIRTUAL_ORIGIN};
use crate::port::url::{BusUrl, End};
use crate::port::wire::Wire;
use crate::port::{PortError, url};
use crate::realtime;
use rtrb::RingBuffer;
use std::error::Error;
use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;
use syncline_drives::bus::Transmission;
use syncline_drives::world::Observer;

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

/// The files of [`LogFiles`].
pub(super) struct Logs {
    candump: Option<Target>,
    packets: Option<Target>,
}

impl LogFiles {
    /// Opens the files.
    pub(super) fn open(&self, claims: &mut Claims) -> Result<Logs, NoOutput> {
        Ok(Logs {
            candump: claims.open("--candump", &self.candump)?,
            packets: claims.open("--pcapng", &self.pcapng)?,
        })
    }
}

impl Logs {
    /// Begins the files for buses with these names, each frame to be written at once.
    pub(super) fn begin(self, buses: Vec<String>) -> io::Result<BusLog> {
        self.begin_by(buses, |target| Ok(Box::new(target.begin()?)))
    }

    fn begin_by(
        self,
        buses: Vec<String>,
        mut begin: impl FnMut(Target) -> io::Result<LogFile>,
    ) -> io::Result<BusLog> {
        let candump = self.candump.map(&mut begin).transpose()?;
        let packets = self.packets.map(&mut begin).transpose()?;
        BusLog::begin(buses, candump, packets)
    }

    fn is_empty(&self) -> bool {
        self.candump.is_none() && self.packets.is_none()
    }

    /// Has the frames of a machine in virtual time written.
    pub(super) fn record_virtual(self, machine: &Machine, frames: &SharedFrames) -> io::Result<()> {
        if !self.is_empty() {
            frames.write_to(self.begin(names(machine))?, VIRTUAL_ORIGIN);
        }
        Ok(())
    }

    /// Who will listen to the buses that are not simulated.
    pub(super) fn listeners(&self) -> Listeners {
        Listeners {
            logs: !self.is_empty(),
            stop: Arc::default(),
            threads: Vec::new(),
        }
    }

    /// Has the frames of a machine in real time written by `writers`, and heard by listeners of
    /// their own on the buses that are not simulated: the cycle does nothing for it.
    pub(super) fn record(
        self,
        machine: &Machine,
        frames: &SharedFrames,
        listeners: &mut Listeners,
        writers: &mut Writers,
    ) -> Result<(), Box<dyn Error>> {
        if self.is_empty() {
            return Ok(());
        }
        let mut wires = Vec::new();
        for (bus, spec) in machine.buses.iter().enumerate() {
            if spec.port != url::SIM {
                let url: BusUrl = spec.port.parse()?;
                wires.push((bus, url.open(spec.bitrate, End::Client)?));
            }
        }
        let log = self.begin_by(names(machine), |target| {
            Ok(Box::new(writers.begin(target)?))
        })?;
        frames.write_to(log, origin(machine));
        for (bus, wire) in wires {
            listeners.listen(bus, wire, frames.clone())?;
        }
        Ok(())
    }
}

/// Of a machine's buses.
fn names(machine: &Machine) -> Vec<String> {
    machine.buses.iter().map(|bus| bus.name.clone()).collect()
}

/// How long a listener waits at a time, and for the last frames.
const LISTEN: Duration = Duration::from_millis(20);

/// Frames of a simulated bus on their way to its listener.
const OVERHEARD: usize = 4096;

/// Threads that write what buses carry into a machine's log, until this value goes.
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

    /// Has the frames recorded that the cycle of a machine on simulated buses relays, also while nobody looks at them.
    pub(super) fn catch_up(&mut self, frames: SharedFrames) -> io::Result<()> {
        let stop = Arc::clone(&self.stop);
        self.spawn(move || {
            while !stop.load(Ordering::Relaxed) {
                frames.catch_up();
                thread::sleep(LISTEN);
            }
        })
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
