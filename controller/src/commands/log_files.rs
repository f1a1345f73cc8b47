//! Files for the traffic of buses.

use crate::bus_log::{BusLog, LogFile};
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

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
}

fn create(file: &Path) -> Result<LogFile, NoLog> {
    if file == Path::new("-") {
        return Ok(Box::new(io::stdout()));
    }
    match File::create(file) {
        Ok(opened) => Ok(Box::new(BufWriter::new(opened))),
        Err(source) => Err(NoLog {
            file: file.to_owned(),
            source,
        }),
    }
}
