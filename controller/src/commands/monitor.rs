//! `syncline monitor`: what goes over a bus, decoded.

use super::tool::{BitRate, Known, Session};
use super::{Exit, bad_input, report};
use crate::bus_log::candump::Line;
use crate::port::url::BusUrl;
use std::collections::BTreeMap;
use std::error::Error;
use std::io::{self, BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use syncline_canopen::monitor::Monitor;
use syncline_canopen::{Frame, NodeId};
use syncline_drives::model::Model;
use syncline_strict_toml::input::{self, ShortLines};

/// Show what goes over a bus, decoded: service, node, objects by name.
///
/// A line a frame: seconds since the first, the frame as candump prints it, what it means. Names
/// and types come from the dictionaries of the nodes that are known; moved and remapped PDOs are
/// followed. Ends with Ctrl-C, or with the log.
#[derive(Debug, clap::Args)]
#[command(group = clap::ArgGroup::new("source").required(true))]
pub(super) struct Args {
    /// The bus: a SocketCAN interface such as `can0`, `socketcand://HOST:PORT/BUS` or
    /// `udp://GROUP:PORT?interface=NAME`.
    #[arg(long, value_name = "PORT", group = "source")]
    bus: Option<BusUrl>,
    /// Decode this log instead, as `candump -L` or `syncline record` writes it (`-`: standard
    /// input).
    #[arg(long, value_name = "FILE", group = "source")]
    log: Option<PathBuf>,
    #[command(flatten)]
    rate: BitRate,
    #[command(flatten)]
    known: Known,
    /// End after so many frames.
    #[arg(long, value_name = "FRAMES")]
    count: Option<u64>,
}

impl Args {
    /// Prints the traffic.
    pub(super) fn execute(&self) -> Exit {
        let models = match self.known.models() {
            Ok(models) => models,
            Err(error) => return bad_input(&*error),
        };
        let ended = match (&self.bus, &self.log) {
            (Some(bus), _) => match Session::open(bus, &self.rate) {
                Ok(session) => self.follow(session, &models),
                Err(error) => return bad_input(&error),
            },
            (None, Some(log)) => match self.read(log, &models) {
                Err(error) if error.downcast_ref::<BadLine>().is_some() => {
                    return bad_input(&*error);
                }
                ended => ended,
            },
            (None, None) => Ok(()),
        };
        match ended {
            Err(error) if !is_broken_pipe(&*error) => {
                report(&*error);
                Exit::Stopped
            }
            _ => Exit::Finished,
        }
    }

    fn follow(
        &self,
        mut session: Session,
        models: &BTreeMap<u8, &'static Model>,
    ) -> Result<(), Box<dyn Error>> {
        let stop = Arc::new(AtomicBool::new(false));
        let asked = Arc::clone(&stop);
        ctrlc::set_handler(move || asked.store(true, Ordering::Relaxed))?;
        let mut monitor = monitor(models);
        let mut printer = Printer::new(self.count);
        while !stop.load(Ordering::Relaxed) && !printer.is_done() {
            let mut ended = Ok(());
            session.receive(Duration::from_millis(100), &mut |at, frame| {
                if ended.is_ok() {
                    let at = Duration::from_nanos(at.as_nanos());
                    ended = printer.print(at, frame, &monitor.decode(frame));
                }
            })?;
            ended?;
        }
        Ok(())
    }

    fn read(
        &self,
        log: &Path,
        models: &BTreeMap<u8, &'static Model>,
    ) -> Result<(), Box<dyn Error>> {
        let source: Box<dyn BufRead> = if log == Path::new("-") {
            Box::new(BufReader::new(ShortLines::new(io::stdin().lock())))
        } else {
            let lines = input::lines(log);
            Box::new(lines.map_err(|error| cannot_read(log, &error))?)
        };
        // Each interface in the log is a bus of its own.
        let mut monitors = BTreeMap::new();
        let mut printer = Printer::new(self.count);
        for (number, line) in (1..).zip(source.lines()) {
            let line = line.map_err(|error| cannot_read(log, &error))?;
            if line.trim().is_empty() || printer.is_done() {
                continue;
            }
            let entry = Line::parse(&line)
                .map_err(|error| BadLine(format!("{}:{number}: {error}", log.display())))?;
            let monitor: &mut Monitor = monitors
                .entry(entry.bus.to_owned())
                .or_insert_with(|| monitor(models));
            printer.print(entry.at, &entry.frame, &monitor.decode(&entry.frame))?;
        }
        Ok(())
    }
}

/// A log that cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct BadLine(String);

fn cannot_read(log: &Path, error: &io::Error) -> BadLine {
    BadLine(format!("cannot read {}: {error}", log.display()))
}

fn monitor(models: &BTreeMap<u8, &'static Model>) -> Monitor {
    let mut monitor = Monitor::new();
    for (&node, model) in models {
        if let Some(node) = NodeId::new(node) {
            monitor.add(node, model.dictionary);
        }
    }
    monitor
}

/// Nobody reads any more: an end, not a failure.
fn is_broken_pipe(error: &(dyn Error + 'static)) -> bool {
    let error = error.downcast_ref::<io::Error>();
    error.is_some_and(|error| error.kind() == io::ErrorKind::BrokenPipe)
}

/// Prints decoded frames.
struct Printer {
    first: Option<Duration>,
    left: Option<u64>,
}

impl Printer {
    fn new(count: Option<u64>) -> Self {
        Self {
            first: None,
            left: count,
        }
    }

    fn is_done(&self) -> bool {
        self.left == Some(0)
    }

    fn print(&mut self, at: Duration, frame: &Frame, text: &str) -> io::Result<()> {
        if self.is_done() {
            return Ok(());
        }
        let first = *self.first.get_or_insert(at);
        let seconds = at.saturating_sub(first).as_secs_f64();
        let frame = format!("{frame:?}");
        writeln!(io::stdout().lock(), "{seconds:12.6}  {frame:<21}  {text}")?;
        if let Some(left) = &mut self.left {
            *left -= 1;
        }
        Ok(())
    }
}
