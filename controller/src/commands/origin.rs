//! What a run is made from, as it was when it began.

use super::calendar::Utc;
use crate::observe::frames::hexadecimal;
use crate::observe::provenance::Provenance;
use crate::sweep::quoted;
use sha2::{Digest, Sha256};
use std::path::Path;
use std::time::{Duration, SystemTime};
use std::{env, fs};

/// Files of a run.
pub(super) struct Origin {
    pub(super) provenance: Provenance,
    /// The program's text; nothing where it is no file.
    pub(super) source: String,
}

impl Origin {
    /// Of a run that begins now.
    pub(super) fn now(machine: &Path, program: &Path, cycle: Duration) -> Self {
        let digest = |bytes: &[u8]| hexadecimal(&Sha256::digest(bytes));
        // What is no regular file can be read but once, and is not read here.
        let is_file = program.metadata().is_ok_and(|it| it.is_file());
        let text = is_file.then(|| fs::read(program).ok()).flatten();
        let command = env::args().map(|word| quoted(&word));
        let host = fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
        Self {
            provenance: Provenance {
                version: env!("CARGO_PKG_VERSION"),
                date: Utc::of(SystemTime::now()).rfc_3339(),
                host: host.trim().to_owned(),
                command: command.collect::<Vec<_>>().join(" "),
                machine_sha256: digest(&fs::read(machine).unwrap_or_default()),
                program_sha256: text.as_deref().map(digest),
                cycle_s: cycle.as_secs_f64(),
            },
            source: String::from_utf8_lossy(&text.unwrap_or_default()).into_owned(),
        }
    }
}
