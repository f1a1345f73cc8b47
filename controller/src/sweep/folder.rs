//! Where a sweep's parts are kept: `sweep.json`, which says of what they are, and `part-000003.csv`, each whole
//! from the moment that it has its name.

use super::result::Table;
use crate::observe::frames::hexadecimal;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::fs::{self, File};
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};
use syncline_strict_toml::input;
use syncline_strict_toml::replace::put_in_place;

/// Why a sweep's files cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SweepError {
    /// A file cannot be read.
    #[error("cannot read {}", file.display())]
    Read {
        /// Which.
        file: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A file cannot be written.
    #[error("cannot write {}", file.display())]
    Write {
        /// Which.
        file: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// It is none of a sweep's files.
    #[error("{}: {problem}", file.display())]
    Form {
        /// Which.
        file: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// Parts of different sweeps.
    #[error(
        "{} has parts of a sweep with another {what}: remove it, or name another folder",
        folder.display()
    )]
    Other {
        /// Where.
        folder: PathBuf,
        /// What differs.
        what: &'static str,
    },
    /// There are not all parts.
    #[error("runs {runs} are missing{}: finish the sweep first", others(*more))]
    Missing {
        /// Of the first part that is missing.
        runs: String,
        /// How many more parts are.
        more: usize,
    },
}

/// So many parts more are missing, in words.
fn others(more: usize) -> String {
    match more {
        0 => String::new(),
        1 => ", and another part".to_owned(),
        more => format!(", and {more} other parts"),
    }
}

/// What a sweep is of. Parts of equal sweeps can stand in one table.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Manifest {
    /// Of this command.
    pub version: String,
    /// The machine file, as it was named.
    pub machine: PathBuf,
    /// The program, as it was named.
    pub program: PathBuf,
    /// SHA-256 of the machine file.
    pub machine_sha256: String,
    /// Of the files that describe its devices; empty where there are none.
    #[serde(default)]
    pub descriptions_sha256: String,
    /// Of the tables beside it; of nothing where there are none.
    pub tables_sha256: String,
    /// Of the program and of all that can be called beside it.
    pub program_sha256: String,
    /// Of the file of what to vary.
    pub vary_sha256: String,
    /// Of the first run; each later one has the next.
    pub seed: u64,
    /// How many there are.
    pub runs: u64,
    /// Runs of a part; the last one may have less.
    pub part: u64,
}

impl Manifest {
    /// What differs, if they are of different sweeps. How files are named is no difference.
    fn differs(&self, other: &Self) -> Option<&'static str> {
        let differs = [
            (self.version != other.version, "version of this command"),
            (self.machine_sha256 != other.machine_sha256, "machine file"),
            (
                self.descriptions_sha256 != other.descriptions_sha256,
                "description of a device",
            ),
            (self.tables_sha256 != other.tables_sha256, "file of tables"),
            (self.program_sha256 != other.program_sha256, "program"),
            (
                self.vary_sha256 != other.vary_sha256,
                "file of what to vary",
            ),
            (self.seed != other.seed, "seed"),
            (self.runs != other.runs, "number of runs"),
            (self.part != other.part, "length of parts"),
        ];
        differs
            .iter()
            .find_map(|(differs, what)| differs.then_some(*what))
    }

    /// The files that a sweep has in a folder, be they there or to be made.
    pub fn files(&self, folder: &Path) -> impl Iterator<Item = PathBuf> {
        let parts = (0..self.parts()).map(move |part| part_in(folder, part));
        std::iter::once(manifest_in(folder)).chain(parts)
    }

    /// How many parts there are.
    #[must_use]
    pub fn parts(&self) -> u64 {
        self.runs.div_ceil(self.part.max(1))
    }

    /// The runs of a part.
    #[must_use]
    pub fn runs_of(&self, part: u64) -> Range<u64> {
        part * self.part..((part + 1) * self.part).min(self.runs)
    }
}

fn manifest_in(folder: &Path) -> PathBuf {
    folder.join("sweep.json")
}

fn part_in(folder: &Path, part: u64) -> PathBuf {
    folder.join(format!("part-{part:06}.csv"))
}

/// The SHA-256 of some files' texts, one after the other, each with its length before it.
#[must_use]
pub fn sha256(texts: impl IntoIterator<Item = Vec<u8>>) -> String {
    let mut digest = Sha256::new();
    for text in texts {
        digest.update((text.len() as u64).to_le_bytes());
        digest.update(text);
    }
    hexadecimal(&digest.finalize())
}

/// A folder with parts of a sweep.
#[derive(Clone, Debug)]
pub struct Folder {
    path: PathBuf,
    manifest: Manifest,
}

impl Folder {
    /// The folder for this sweep, which may have parts of it already; several processes may come at once.
    ///
    /// # Errors
    /// It cannot be read or written, or has parts of another sweep.
    pub fn make(path: &Path, manifest: Manifest) -> Result<Self, SweepError> {
        fs::create_dir_all(path).map_err(|source| SweepError::Write {
            file: path.to_owned(),
            source,
        })?;
        let file = manifest_in(path);
        if !file.exists() {
            let text =
                serde_json::to_string_pretty(&manifest).map_err(|error| SweepError::Form {
                    file: file.clone(),
                    problem: error.to_string(),
                })?;
            put(&file, (text + "\n").as_bytes())?;
        }
        let there = Self::open(path)?;
        there.check(&manifest)?;
        Ok(there)
    }

    /// Whether its parts are of this sweep.
    ///
    /// # Errors
    /// They are of another.
    pub fn check(&self, manifest: &Manifest) -> Result<(), SweepError> {
        match self.manifest.differs(manifest) {
            Some(what) => Err(SweepError::Other {
                folder: self.path.clone(),
                what,
            }),
            None => Ok(()),
        }
    }

    /// A folder that a sweep has made.
    ///
    /// # Errors
    /// It cannot be read or is none.
    pub fn open(path: &Path) -> Result<Self, SweepError> {
        let file = manifest_in(path);
        let text = input::read(&file).map_err(|source| SweepError::Read {
            file: file.clone(),
            source,
        })?;
        let manifest = serde_json::from_slice(&text).map_err(|error| SweepError::Form {
            file,
            problem: error.to_string(),
        })?;
        Ok(Self {
            path: path.to_owned(),
            manifest,
        })
    }

    /// What its parts are of.
    #[must_use]
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// The files that it has, or will have.
    pub fn files(&self) -> impl Iterator<Item = PathBuf> {
        self.manifest.files(&self.path)
    }

    fn file(&self, part: u64) -> PathBuf {
        part_in(&self.path, part)
    }

    /// Whether a part is there.
    #[must_use]
    pub fn has(&self, part: u64) -> bool {
        self.file(part).exists()
    }

    /// Keeps a part.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn keep(&self, part: u64, table: &Table) -> Result<(), SweepError> {
        let (file, mut text) = (self.file(part), Vec::new());
        table.write(&mut text).map_err(|error| SweepError::Write {
            file: file.clone(),
            source: error.into(),
        })?;
        put(&file, &text)
    }

    /// The table of a sweep whose parts are in these folders.
    ///
    /// # Errors
    /// They are of different sweeps, cannot be read, or are not all there.
    pub fn merge(folders: &[Self]) -> Result<Table, SweepError> {
        let Some(first) = folders.first() else {
            return Ok(Table::default());
        };
        for folder in folders {
            folder.check(&first.manifest)?;
        }
        let places = (0..first.manifest.parts())
            .map(|part| (part, folders.iter().find(|folder| folder.has(part))));
        let missing: Vec<u64> = places
            .clone()
            .filter_map(|(part, place)| place.is_none().then_some(part))
            .collect();
        if let [part, more @ ..] = &missing[..] {
            let Range { start, end } = first.manifest.runs_of(*part);
            return Err(SweepError::Missing {
                runs: format!("{start} to {}", end - 1),
                more: more.len(),
            });
        }
        let mut table = Table::default();
        for (part, place) in places {
            if let Some(folder) = place {
                folder.read(part, &mut table)?;
            }
        }
        Ok(table)
    }

    /// Adds a part's rows.
    fn read(&self, part: u64, table: &mut Table) -> Result<(), SweepError> {
        let file = self.file(part);
        let form = |problem: String| SweepError::Form {
            file: file.clone(),
            problem,
        };
        let lines = input::lines(&file).map_err(|error| form(error.to_string()))?;
        let mut csv = csv::Reader::from_reader(lines);
        let cells = |record: &csv::StringRecord| record.iter().map(str::to_owned).collect();
        let columns: Vec<String> = cells(csv.headers().map_err(|error| form(error.to_string()))?);
        if table.columns.is_empty() {
            table.columns = columns;
        } else if table.columns != columns {
            return Err(form("other columns than the parts before".into()));
        }
        let before = table.rows.len();
        let runs = self.manifest.runs_of(part);
        // One more than there are to be says that there are too many.
        for record in csv.records().take(runs.clone().count() + 1) {
            table
                .rows
                .push(cells(&record.map_err(|error| form(error.to_string()))?));
        }
        let mut found = table.rows[before..].iter().map(|row| row.first());
        let all = runs
            .clone()
            .all(|run| found.next().flatten() == Some(&run.to_string()));
        if !all || found.next().is_some() {
            let Range { start, end } = runs;
            return Err(form(format!("not the runs {start} to {}", end - 1)));
        }
        Ok(())
    }
}

/// Writes a file that is there only once it is whole.
fn put(file: &Path, text: &[u8]) -> Result<(), SweepError> {
    let written =
        create_beside(file).and_then(|(new, writer)| put_in_place(file, &new, writer, text));
    written.map_err(|source| SweepError::Write {
        file: file.to_owned(),
        source,
    })
}

/// A new file with a name like that of `file`. Processes that share a folder may be on several hosts and have one
/// process number: the file system alone can tell whose a name is.
fn create_beside(file: &Path) -> io::Result<(PathBuf, File)> {
    let mut number = 0;
    loop {
        let mut name = file.as_os_str().to_owned();
        name.push(format!(".{number}.unfinished"));
        match File::create_new(&name) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => number += 1,
            created => return Ok((name.into(), created?)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::thread;

    /// Threads have one process number, as processes in containers have.
    #[test]
    fn many_make_one_folder_and_keep_the_same_part() {
        let folder = tempfile::tempdir().unwrap();
        let manifest = Manifest {
            version: "1".into(),
            machine: "machine.toml".into(),
            program: "part.ngc".into(),
            machine_sha256: sha256([b"machine".to_vec()]),
            descriptions_sha256: String::new(),
            tables_sha256: sha256([]),
            program_sha256: sha256([b"program".to_vec()]),
            vary_sha256: sha256([b"vary".to_vec()]),
            seed: 0,
            runs: 1,
            part: 1,
        };
        let table = Table {
            columns: vec!["run".into()],
            rows: vec![vec!["0".into()]],
        };
        for round in 0..50 {
            let path = folder.path().join(round.to_string());
            let make = || {
                let folder = Folder::make(&path, manifest.clone())?;
                folder.keep(0, &table)?;
                Folder::merge(&[folder])
            };
            thread::scope(|scope| {
                let all: Vec<_> = (0..8).map(|_| scope.spawn(make)).collect();
                for it in all {
                    assert_eq!(it.join().unwrap().unwrap(), table);
                }
            });
            assert_eq!(
                fs::read_dir(&path).unwrap().count(),
                2,
                "none is left unfinished"
            );
        }
    }
}
