//! `syncline record`: what goes over a bus, into files.

use super::tool::{BusChoice, Session};
use super::{Exit, bad_input, report};
use crate::bus_log::{candump::Line, pcapng};
use crate::realtime::now;
use std::error::Error;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use syncline_canopen::Frame;

/// Record what goes over a bus, for can-utils, tshark or `syncline monitor --log`.
///
/// Ends with Ctrl-C, after so many frames or after so many seconds, and says what it recorded.
#[derive(Debug, clap::Args)]
#[command(group = clap::ArgGroup::new("file").required(true).multiple(true))]
pub(super) struct Args {
    #[command(flatten)]
    bus: BusChoice,
    /// Write a text log as `candump -L` does (`-`: to standard output).
    #[arg(long, value_name = "FILE", group = "file")]
    candump: Option<PathBuf>,
    /// Write packets for Wireshark and tshark.
    #[arg(long, value_name = "FILE", group = "file")]
    pcapng: Option<PathBuf>,
    /// End after so many frames.
    #[arg(long, value_name = "FRAMES")]
    count: Option<u64>,
    /// End after so many seconds.
    #[arg(long, value_name = "SECONDS")]
    seconds: Option<u64>,
}

/// The interface's name in the files.
const BUS: &str = "can0";

impl Args {
    /// Records.
    pub(super) fn execute(&self) -> Exit {
        let session = match self.bus.open() {
            Ok(session) => session,
            Err(error) => return bad_input(&error),
        };
        match self.record(session) {
            Ok(frames) => {
                eprintln!("{frames} frames");
                Exit::Finished
            }
            Err(error) => {
                report(&*error);
                Exit::Stopped
            }
        }
    }

    fn record(&self, mut session: Session) -> Result<u64, Box<dyn Error>> {
        let stop = Arc::new(AtomicBool::new(false));
        let asked = Arc::clone(&stop);
        ctrlc::set_handler(move || asked.store(true, Ordering::Relaxed))?;
        let create = |file: &PathBuf| -> io::Result<Box<dyn Write>> {
            Ok(if file.as_os_str() == "-" {
                Box::new(io::stdout().lock())
            } else {
                Box::new(BufWriter::new(File::create(file)?))
            })
        };
        let mut candump = self.candump.as_ref().map(create).transpose()?;
        let mut packets = self.pcapng.as_ref().map(create).transpose()?;
        if let Some(file) = &mut packets {
            pcapng::begin(file, BUS)?;
        }
        // Frames are stamped on CLOCK_MONOTONIC, files count from 1970.
        let start = now();
        let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH)?;
        let end = self
            .seconds
            .map(|seconds| start + Duration::from_secs(seconds));
        let mut frames = 0;
        let is_full = |frames| self.count.is_some_and(|count| frames >= count);
        while !stop.load(Ordering::Relaxed) && !is_full(frames) && end.is_none_or(|end| now() < end)
        {
            let mut ended = Ok(());
            session.receive(Duration::from_millis(50), &mut |at, frame| {
                if is_full(frames) || ended.is_err() {
                    return;
                }
                let at = (since_1970 + Duration::from_nanos(at.as_nanos()))
                    .saturating_sub(Duration::from_nanos(start.as_nanos()));
                ended = keep(&mut candump, &mut packets, at, frame);
                frames += 1;
            })?;
            ended?;
        }
        for file in [candump, packets].iter_mut().flatten() {
            file.flush()?;
        }
        Ok(frames)
    }
}

fn keep(
    candump: &mut Option<Box<dyn Write>>,
    packets: &mut Option<Box<dyn Write>>,
    at: Duration,
    frame: &Frame,
) -> io::Result<()> {
    if let Some(file) = candump {
        let frame = *frame;
        let bus = BUS;
        writeln!(file, "{}", Line { at, bus, frame })?;
    }
    if let Some(file) = packets {
        pcapng::append(file, at, frame)?;
    }
    Ok(())
}
