//! What a run is made from, as it was when it began.

use super::calendar::Utc;
use crate::machine::Machine;
use crate::observe::frames::hexadecimal;
use crate::observe::provenance::{self, Provenance};
use crate::sweep::quoted;
use sha2::{Digest, Sha256};
use std::io;
use std::path::Path;
use std::time::SystemTime;
use std::{env, fs};
use syncline_strict_toml::input;

/// Files of a run.
pub(super) struct Origin {
    pub(super) provenance: Provenance,
    /// The program's text; nothing where it is not wanted, no file, or so long that no person reads it.
    pub(super) source: String,
}

impl Origin {
    /// Of a run that begins now, with the program's text if that is wanted.
    pub(super) fn now(file: &Path, machine: &Machine, program: &Path, with_source: bool) -> Self {
        // What is no regular file can be read but once, and is not read here.
        let is_file = program.metadata().is_ok_and(|it| it.is_file());
        let source = (is_file && with_source).then(|| input::read(program).ok());
        let command = env::args().map(|word| quoted(&word));
        let descriptions = machine.files.iter().map(|file| provenance::Digest {
            file: file.display().to_string(),
            sha256: digest(file).unwrap_or_default(),
        });
        let host = fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
        Self {
            provenance: Provenance {
                version: env!("CARGO_PKG_VERSION"),
                date: Utc::of(SystemTime::now()).rfc_3339(),
                host: host.trim().to_owned(),
                command: command.collect::<Vec<_>>().join(" "),
                machine_sha256: digest(file).unwrap_or_default(),
                descriptions: descriptions.collect(),
                program_sha256: is_file.then(|| digest(program).ok()).flatten(),
                cycle_s: machine.cycle.as_secs_f64(),
            },
            source: String::from_utf8_lossy(&source.flatten().unwrap_or_default()).into_owned(),
        }
    }
}

/// The SHA-256 of a file of any length.
pub(super) fn digest(file: &Path) -> io::Result<String> {
    let mut digest = Sha256::new();
    input::parts(file, |bytes| digest.update(bytes))?;
    Ok(hexadecimal(&digest.finalize()))
}
