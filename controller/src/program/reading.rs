//! How far a program that is read as it runs has been read.

use super::{Program, Source};
use std::fs::Metadata;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// How far a program has been read, from any thread: ahead of the machine.
#[derive(Clone, Debug)]
pub struct Reading {
    bytes: Arc<AtomicU64>,
    /// Bytes that the program has, where that is known: of a pipe it is not.
    pub of: Option<u64>,
}

impl Reading {
    /// Bytes of the program that have been read, those of files that it calls left out.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.bytes.load(Ordering::Relaxed)
    }
}

impl Program {
    /// How far a program that is read as it runs has been read.
    #[must_use]
    pub fn reading(&self) -> Option<Reading> {
        let of = match &self.source {
            Source::File(file) => file
                .metadata()
                .ok()
                .filter(Metadata::is_file)
                .map(|it| it.len()),
            Source::Lines(text) => Some(text.len() as u64),
            // One short line or two.
            Source::Setting(_) => None,
            Source::Text(_, text) => Some(text.len() as u64),
        };
        let bytes = Arc::clone(&self.setup.read);
        self.stream.then_some(Reading { bytes, of })
    }
}
