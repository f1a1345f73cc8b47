//! `syncline merge`: the parts of a sweep as one table.

use super::Exit;
use super::output::{Claims, Target};
use crate::sweep::Folder;
use std::error::Error;
use std::path::PathBuf;

/// Put the parts of a sweep together, whichever processes made them, and tell the worst cases.
///
/// What comes of it is what one process would have written.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Folders with parts, as `sweep` makes them.
    #[arg(required = true)]
    folders: Vec<PathBuf>,
    /// Write all runs into this file.
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
}

impl Args {
    pub(super) fn execute(self) -> Exit {
        match self.merge() {
            Ok(()) => Exit::Finished,
            Err(error) => super::bad_input(&*error),
        }
    }

    fn merge(&self) -> Result<(), Box<dyn Error>> {
        let folders: Result<Vec<_>, _> = self.folders.iter().map(|it| Folder::open(it)).collect();
        let folders = folders?;
        let files = folders.iter().flat_map(Folder::files);
        let mut claims = Claims::default().keeps_sweep(files);
        let csv = claims.open("--csv", &self.csv)?;
        conclude(&folders, csv, &claims)
    }
}

/// Writes all runs of a sweep, and tells what stands out.
pub(super) fn conclude(
    folders: &[Folder],
    csv: Option<Target>,
    claims: &Claims,
) -> Result<(), Box<dyn Error>> {
    let table = Folder::merge(folders)?;
    if let Some(csv) = csv {
        table.write(csv.begin()?)?;
    }
    if let Some(folder) = folders.first() {
        let manifest = folder.manifest();
        let findings = table.findings(&manifest.machine, &manifest.program);
        claims.tell(&findings.to_string());
    }
    Ok(())
}
