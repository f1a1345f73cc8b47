//! The files that a machine file names. Their paths are made here alone, so that all of them are known: no output is written
//! over one, and a result tells what it was made from.

use std::path::{Path, PathBuf};

/// Finds the files that a machine file names, and remembers them.
pub(super) struct Files {
    folder: PathBuf,
    named: Vec<PathBuf>,
}

impl Files {
    /// For a machine file in this folder.
    pub(super) fn of(folder: &Path) -> Self {
        Self {
            folder: folder.to_owned(),
            named: Vec::new(),
        }
    }

    /// One that the machine file names, to be read.
    pub(super) fn named(&mut self, name: &str) -> PathBuf {
        let file = self.folder.join(name);
        self.remember(file)
    }

    /// One that another of these files names, from its own folder.
    pub(super) fn named_in(&mut self, by: &Path, name: &str) -> PathBuf {
        let folder = by.parent().unwrap_or(Path::new(""));
        self.remember(folder.join(name))
    }

    /// All of them, in the order in which they were named, each once.
    pub(super) fn into_all(self) -> Vec<PathBuf> {
        self.named
    }

    fn remember(&mut self, file: PathBuf) -> PathBuf {
        if !self.named.contains(&file) {
            self.named.push(file.clone());
        }
        file
    }
}
