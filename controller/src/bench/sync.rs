//! SYNC from the cycle's thread and from the kernel's broadcast manager, one after the other on
//! one interface: how even each is, and whether it keeps to the clock.

use crate::observe::timing::Distribution;
use crate::port::PortError;
use crate::port::socketcan::{BroadcastManager, DriveSocket};
use crate::port::wire::Wire;
use crate::realtime::{self, Granted, Settings};
use std::thread;
use std::time::Duration;
use syncline_canopen::{CanId, CobId, Frame, Instant};

/// What to measure.
#[derive(Clone, Debug)]
pub struct Options {
    /// The interface.
    pub interface: String,
    /// SYNC to SYNC.
    pub period: Duration,
    /// SYNCs of either source.
    pub cycles: u32,
    /// What the thread asks for.
    pub realtime: Settings,
}

/// How one source did.
#[derive(Clone, Debug)]
pub struct Source {
    /// |from SYNC to SYNC − period|, by the kernel's stamps.
    pub jitter: Distribution,
    /// How far the last SYNC was behind the first one's grid, in ns a SYNC.
    pub drift: f64,
}

/// What was measured.
#[derive(Debug)]
pub struct Outcome {
    /// What the thread was granted.
    pub granted: Granted,
    /// When measuring began.
    pub start: Instant,
    /// The thread.
    pub thread: Source,
    /// The broadcast manager.
    pub kernel: Source,
}

/// The names of the two sources.
pub const NAMES: [&str; 2] = ["SYNC by the thread", "SYNC by the kernel"];

/// The interface, open for the thread to send.
pub struct Sender(DriveSocket);

impl Sender {
    /// Opens it.
    ///
    /// # Errors
    /// It cannot be used.
    pub fn open(options: &Options) -> Result<Self, PortError> {
        open(options).map(Self)
    }
}

fn open(options: &Options) -> Result<DriveSocket, PortError> {
    DriveSocket::open(&options.interface, 1_000_000)
}

/// Measures on a thread of its own.
///
/// # Errors
/// The interface failed.
///
/// # Panics
/// If the measuring thread does.
pub fn measure(options: &Options, sender: Sender) -> Result<Outcome, PortError> {
    let options = options.clone();
    let measured = thread::spawn(move || {
        let granted = realtime::enter(&options.realtime);
        let start = realtime::now();
        let thread = from_thread(&options, sender)?;
        let kernel = from_kernel(&options)?;
        Ok(Outcome {
            granted,
            start,
            thread,
            kernel,
        })
    });
    match measured.join() {
        Ok(outcome) => outcome,
        Err(panic) => std::panic::resume_unwind(panic),
    }
}

fn from_thread(options: &Options, mut sender: Sender) -> Result<Source, PortError> {
    let mut listener = open(options)?;
    let mut record = Record::new(NAMES[0], options);
    let start = realtime::now() + options.period;
    for cycle in 0..options.cycles {
        realtime::sleep_until(start + options.period * cycle, Duration::ZERO, || ());
        sender.0.send(&mut vec![Frame::new(CobId::SYNC, &[])])?;
        record.hear(&mut listener)?;
    }
    Ok(record.source())
}

fn from_kernel(options: &Options) -> Result<Source, PortError> {
    let mut listener = open(options)?;
    let mut record = Record::new(NAMES[1], options);
    let sync = Frame::new(CobId::SYNC, &[]);
    let _sending = BroadcastManager::start(&options.interface, &sync, options.period)?;
    let start = realtime::now();
    while record.count < options.cycles
        && realtime::now() < start + 2 * options.period * options.cycles
    {
        realtime::sleep_until(realtime::now() + options.period, Duration::ZERO, || ());
        record.hear(&mut listener)?;
    }
    Ok(record.source())
}

/// The stamps of a source's SYNCs.
struct Record {
    period: Duration,
    jitter: Distribution,
    first: Option<Instant>,
    last: Instant,
    count: u32,
}

impl Record {
    fn new(name: &'static str, options: &Options) -> Self {
        Self {
            period: options.period,
            jitter: Distribution::new(name),
            first: None,
            last: Instant::ZERO,
            count: 0,
        }
    }

    fn hear(&mut self, listener: &mut DriveSocket) -> Result<(), PortError> {
        while listener.receive(&mut |at, frame| {
            if frame.id() != CanId::from(CobId::SYNC) {
                return;
            }
            if self.first.is_some() {
                let jitter = at.saturating_since(self.last).abs_diff(self.period);
                self.jitter.record(jitter, at);
                self.count += 1;
            }
            self.first.get_or_insert(at);
            self.last = at;
        })? {}
        Ok(())
    }

    fn source(self) -> Source {
        let took = self.last.saturating_since(self.first.unwrap_or(self.last));
        let wanted = self.period.as_nanos() as f64 * f64::from(self.count);
        Source {
            drift: (took.as_nanos() as f64 - wanted) / f64::from(self.count.max(1)),
            jitter: self.jitter,
        }
    }
}
