//! `syncline sweep`: many validations with other values of the machine file's keys.

use super::output::{Claims, Target};
use super::shard::Shard;
use super::{Exit, merge, origin, report};
use crate::machine::Machine;
use crate::sweep::{Folder, Manifest, Plan, Runs, SweepError, Table, Vary, sha256};
use indicatif::{ProgressBar, ProgressStyle};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;
use syncline_gcode::Tables;

/// Validate a program many times, each time with other values of keys of the machine file.
///
/// Every so many runs are a part, a file of its own that is there once they are done: a sweep that was
/// interrupted goes on where it was. Exit code 0: all runs were made, whatever came of them; 130: Ctrl-C came before.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Machine file (TOML).
    machine: PathBuf,
    /// Part program (RS-274/NGC).
    program: PathBuf,
    /// Which keys have which values (TOML): `method` is grid, latin_hypercube or monte_carlo; each [[vary]] has
    /// a `key` as `validate --set` takes it, and `values`, or `from` and `to`, and in a grid `steps`.
    #[arg(long, value_name = "FILE")]
    vary: PathBuf,
    /// How many runs; a grid has as many as it has.
    #[arg(long, value_name = "N")]
    runs: Option<u64>,
    /// Runs at the same time; as many as there are cores if not given.
    #[arg(long, value_name = "J")]
    jobs: Option<usize>,
    /// Of all draws, and of the first run's drives; each later run has the next.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// The folder for the parts.
    #[arg(long, value_name = "FOLDER", default_value = "sweep")]
    out: PathBuf,
    /// Runs of a part.
    #[arg(long, value_name = "RUNS", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..))]
    part: u64,
    /// Make every N-th part alone, the I-th of them first: 0/4. `merge` puts all together.
    #[arg(long, value_name = "I/N", conflicts_with = "csv")]
    shard: Option<Shard>,
    /// Write all runs into this file in the end.
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
}

/// All that a sweep needs.
struct Prepared {
    runs: Runs,
    folder: Folder,
    csv: Option<Target>,
    claims: Claims,
}

impl Args {
    pub(super) fn execute(self) -> Exit {
        let prepared = match self.prepare() {
            Ok(prepared) => prepared,
            Err(error) => return super::bad_input(&*error),
        };
        match self.sweep(prepared) {
            Ok(exit) => exit,
            Err(error) => {
                report(&*error);
                Exit::Stopped
            }
        }
    }

    fn prepare(&self) -> Result<Prepared, Box<dyn Error>> {
        let vary = syncline_strict_toml::read(&self.vary);
        let text = vary.map_err(|why| format!("cannot read {}: {why}", self.vary.display()))?;
        let plan = Plan::new(Vary::parse(&self.vary, &text)?, self.runs, self.seed)?;
        let (count, vary_sha256) = (plan.runs(), sha256([text.into_bytes()]));
        let runs = Runs::new(self.machine.clone(), self.program.clone(), plan)?;
        let manifest = self.manifest(&runs, count, vary_sha256)?;
        let machine = Machine::load(&self.machine)?;
        let mut claims = Claims::of_run(&self.machine, &machine, &self.program)
            .reads_named(runs.files())
            .reads("--vary", &self.vary)
            .keeps_sweep(manifest.files(&self.out));
        let csv = claims.open("--csv", &self.csv)?;
        let folder = Folder::make(&self.out, manifest)?;
        Ok(Prepared {
            runs,
            folder,
            csv,
            claims,
        })
    }

    /// What the sweep is of, as its files are now.
    fn manifest(&self, of: &Runs, runs: u64, vary_sha256: String) -> Result<Manifest, SweepError> {
        let descriptions = of.files().iter().map(|file| digest(file));
        let descriptions = descriptions.collect::<Result<Vec<_>, _>>()?;
        Ok(Manifest {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            machine: self.machine.clone(),
            program: self.program.clone(),
            machine_sha256: sha256([digest(&self.machine)?]),
            descriptions_sha256: match descriptions.is_empty() {
                true => String::new(),
                false => sha256(descriptions),
            },
            tables_sha256: sha256(digest(&Tables::beside(&self.machine))),
            program_sha256: sha256(self.program_texts()?),
            vary_sha256,
            seed: self.seed,
            runs,
            part: self.part,
        })
    }

    /// The digest of the program, and those of what it can call, by name.
    fn program_texts(&self) -> Result<Vec<Vec<u8>>, SweepError> {
        let mut texts = vec![digest(&self.program)?];
        let mut callable = super::output::callable(&self.program);
        callable.sort();
        for file in callable {
            let name = file.file_name().unwrap_or_default();
            texts.push(name.as_encoded_bytes().to_vec());
            texts.push(digest(&file)?);
        }
        Ok(texts)
    }

    fn sweep(&self, prepared: Prepared) -> Result<Exit, Box<dyn Error>> {
        let Prepared {
            runs,
            folder,
            csv,
            claims,
        } = prepared;
        let Shard { part, parts } = self.shard.unwrap_or_default();
        let manifest = folder.manifest();
        let share = (part..manifest.parts()).step_by(parts as usize);
        let missing: Vec<u64> = share.filter(|part| !folder.has(*part)).collect();
        let runs_of = |part: &u64| manifest.runs_of(*part);
        let bar = bar(missing
            .iter()
            .map(|part| runs_of(part).count() as u64)
            .sum());
        let interrupted = Arc::new(AtomicBool::new(false));
        let asked = Arc::clone(&interrupted);
        // Asked again, the runs at work are not waited for: their part is made once more.
        ctrlc::set_handler(move || {
            if asked.swap(true, Ordering::Relaxed) {
                std::process::exit(130);
            }
        })?;
        let next = AtomicUsize::new(0);
        let work = || -> Result<(), SweepError> {
            while let Some(part) = missing.get(next.fetch_add(1, Ordering::Relaxed)) {
                let mut table = Table {
                    columns: runs.columns(),
                    rows: Vec::new(),
                };
                for run in runs_of(part) {
                    if interrupted.load(Ordering::Relaxed) {
                        return Ok(());
                    }
                    table.rows.push(runs.row(run));
                    bar.inc(1);
                }
                // Each run has read the files anew: they may be others by now.
                folder.check(&self.manifest(
                    &runs,
                    manifest.runs,
                    manifest.vary_sha256.clone(),
                )?)?;
                folder.keep(*part, &table)?;
            }
            Ok(())
        };
        let jobs = self.jobs.unwrap_or_else(crate::realtime::cores).max(1);
        thread::scope(|scope| {
            let threads: Vec<_> = (0..jobs).map(|_| scope.spawn(work)).collect();
            let ended = threads.into_iter().map(|it| it.join());
            let mut kept =
                ended.map(|it| it.unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
            kept.find(Result::is_err).unwrap_or(Ok(()))
        })?;
        bar.finish_and_clear();
        let made = missing.iter().filter(|part| folder.has(**part)).count();
        if interrupted.load(Ordering::Relaxed) && made < missing.len() {
            let (of, out) = (missing.len(), self.out.display());
            eprintln!(
                "interrupted: {made} of {of} parts were made and are kept in {out}: the same command goes on there"
            );
            return Ok(Exit::Interrupted);
        }
        if self.shard.is_some() {
            claims.tell(&format!("{} parts made\n", missing.len()));
            return Ok(Exit::Finished);
        }
        merge::conclude(&[folder], csv, &claims)?;
        Ok(Exit::Finished)
    }
}

/// What stands for a file of any length.
fn digest(file: &Path) -> Result<Vec<u8>, SweepError> {
    let digest = origin::digest(file).map_err(|source| SweepError::Read {
        file: file.to_owned(),
        source,
    })?;
    Ok(digest.into_bytes())
}

/// The bar of a sweep: how many runs are made, and when the last one will be.
fn bar(runs: u64) -> ProgressBar {
    let style = ProgressStyle::with_template("{wide_bar} {pos}/{len} runs, {eta} left");
    ProgressBar::new(runs).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}
