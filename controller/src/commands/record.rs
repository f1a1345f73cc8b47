//! `syncline record`: what goes over a bus, into files.

use super::log_files::LogFiles;
use super::output::Claims;
use super::tool::{BusChoice, Session};
use super::{Exit, LONGEST, bad_input, report};
use crate::bus_log::BusLog;
use crate::counted::counted;
use crate::realtime::now;
use std::error::Error;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Record what goes over a bus, for can-utils, tshark or `syncline monitor --log`.
///
/// Ends with Ctrl-C, after so many frames or after so many seconds, and says what it recorded.
#[derive(Debug, clap::Args)]
#[command(group = clap::ArgGroup::new("file")
    .args(["candump", "pcapng"])
    .required(true)
    .multiple(true))]
pub(super) struct Args {
    #[command(flatten)]
    bus: BusChoice,
    #[command(flatten)]
    files: LogFiles,
    /// End after so many frames.
    #[arg(long, value_name = "FRAMES")]
    count: Option<u64>,
    /// End after so many seconds.
    #[arg(long, value_name = "SECONDS", value_parser = clap::value_parser!(u64).range(..=LONGEST.as_secs()))]
    seconds: Option<u64>,
}

/// The interface's name in the files.
const BUS: &str = "can0";

impl Args {
    /// Records.
    pub(super) fn execute(&self) -> Exit {
        let logs = match self.files.open(&mut Claims::default()) {
            Ok(logs) => logs,
            Err(error) => return bad_input(&error),
        };
        let session = match self.bus.open() {
            Ok(session) => session,
            Err(error) => return bad_input(&error),
        };
        let mut log = match logs.begin(vec![BUS.to_owned()]) {
            Ok(log) => log,
            Err(error) => return bad_input(&error),
        };
        match self.record(session, &mut log) {
            Ok(()) => {
                eprintln!("{}", counted(log.frames(), "frame", "frames"));
                Exit::Finished
            }
            Err(error) => {
                report(&*error);
                Exit::Stopped
            }
        }
    }

    fn record(&self, mut session: Session, log: &mut BusLog) -> Result<(), Box<dyn Error>> {
        let stop = Arc::new(AtomicBool::new(false));
        let asked = Arc::clone(&stop);
        ctrlc::set_handler(move || asked.store(true, Ordering::Relaxed))?;
        // Frames are stamped on CLOCK_MONOTONIC, files count from 1970.
        let start = now();
        let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH)?;
        let end = self
            .seconds
            .map(|seconds| start + Duration::from_secs(seconds));
        let is_full = |log: &BusLog| self.count.is_some_and(|count| log.frames() >= count);
        while !stop.load(Ordering::Relaxed) && !is_full(log) && end.is_none_or(|end| now() < end) {
            let mut ended = Ok(());
            session.receive(Duration::from_millis(50), &mut |at, frame| {
                if is_full(log) || ended.is_err() {
                    return;
                }
                let at = (since_1970 + Duration::from_nanos(at.as_nanos()))
                    .saturating_sub(Duration::from_nanos(start.as_nanos()));
                ended = log.keep(0, at, frame);
            })?;
            ended?;
        }
        Ok(log.finish()?)
    }
}
