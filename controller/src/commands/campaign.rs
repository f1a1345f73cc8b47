//! `syncline campaign`: random machines, programs, operators and troubles, watched by checkers.

use super::log_files::LogFiles;
use super::output::{Claims, NoOutput, Output, Results, Target};
use super::shard::Shard;
use super::{Exit, report};
use crate::campaign::explore::{Explorer, Sightings};
use crate::campaign::{self, Case, Coverage, Outcome, Seen, Violation, Wanted, shrink};
use crate::control::Layout;
use crate::session::Event;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::error::Error;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use std::{fs, io, panic, thread};

/// Every so many-th seed is played twice.
const TWICE: u64 = 50;

/// Hunt for the case nobody thought of: random machines, programs, operators and troubles in virtual time.
///
/// A seed makes a machine, its programs, what operators command and what goes wrong; checkers beside the
/// simulated buses and drives watch what comes of it. A seed's run is a function of its number and of this
/// version. Exit code 1: a checker found something.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Seeds to play, from A up to and without B: 0..2000.
    #[arg(long, value_name = "A..B", required_unless_present_any = ["seed", "case", "merge"])]
    seeds: Option<Seeds>,
    /// One seed, and tell what happens.
    #[arg(long, conflicts_with_all = ["seeds", "case"])]
    seed: Option<u64>,
    /// A case from a file, and tell what happens.
    #[arg(long, value_name = "FILE", conflicts_with = "seeds")]
    case: Option<PathBuf>,
    /// Seeds that are played at the same time; as many as there are cores if not given.
    #[arg(long)]
    jobs: Option<usize>,
    /// Play every N-th of the seeds alone, the I-th of them first: 0/4.
    #[arg(long, value_name = "I/N", requires = "seeds")]
    shard: Option<Shard>,
    /// Have each case last so long from where its machine is ready, instead of a few seconds: parts with
    /// programs, operators and troubles of their own, one behind the other, as in a day at the machine.
    #[arg(long, value_name = "SECONDS", conflicts_with_all = ["case", "explore"])]
    lasting: Option<f64>,
    /// Begin no seed after so many minutes.
    #[arg(long, requires = "seeds")]
    minutes: Option<f64>,
    /// Write what all seeds came to into this file, for --merge.
    #[arg(long, value_name = "FILE", requires = "seeds")]
    sum: Option<PathBuf>,
    /// Tell what the seeds of several runs came to, of which each wrote its --sum: as if they had been one.
    #[arg(long, value_name = "FILE", num_args = 1.., conflicts_with_all = ["seeds", "seed", "case"])]
    merge: Vec<PathBuf>,
    /// Make what fails smaller, and write it to a file in this folder.
    #[arg(long, value_name = "FOLDER")]
    shrink: Option<PathBuf>,
    /// Steer towards what was not reached, and write every case that fails to a file in this folder; the
    /// numbers of --seeds count the cases.
    #[arg(long, value_name = "FOLDER", requires = "seeds", conflicts_with_all = ["shard", "sum"])]
    explore: Option<PathBuf>,
    /// Tell what was reached.
    #[arg(long)]
    coverage: bool,
    #[command(flatten)]
    output: Output,
    #[command(flatten)]
    log: LogFiles,
}

/// A range of seeds.
#[derive(Clone, Debug)]
struct Seeds(Range<u64>);

impl FromStr for Seeds {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let (first, end) = text.split_once("..").ok_or("write A..B")?;
        let number = |text: &str| text.parse().map_err(|_| "write whole numbers");
        let seeds = number(first)?..number(end)?;
        if seeds.is_empty() {
            return Err("there is no seed in it");
        }
        Ok(Self(seeds))
    }
}

/// What all seeds so far came to; whole numbers, so that it is the same in whatever order they were played.
#[derive(Debug, Default, PartialEq, Serialize, Deserialize)]
struct Sum {
    played: u64,
    /// Virtual time, µs: of all, and of what a path moved.
    micros: [u64; 2],
    coverage: Coverage,
    /// By seed: checker, and what it found.
    violations: BTreeMap<u64, Vec<(String, String)>>,
}

impl Sum {
    /// What one seed came to.
    fn of(seed: u64, outcome: Outcome) -> Self {
        let kind = |it: &Violation| (it.checker.to_owned(), it.what.to_owned());
        let found: Vec<_> = outcome.violations.iter().map(kind).collect();
        let found = Some((seed, found)).filter(|(_, found)| !found.is_empty());
        Self {
            played: 1,
            micros: outcome.seconds.map(|it| (it * 1e6).round() as u64),
            coverage: outcome.coverage,
            violations: found.into_iter().collect(),
        }
    }

    /// Adds what other seeds came to.
    fn merge(&mut self, other: Self) {
        self.played += other.played;
        for (mine, other) in self.micros.iter_mut().zip(other.micros) {
            *mine += other;
        }
        self.coverage.merge(other.coverage);
        self.violations.extend(other.violations);
    }

    /// Reads what [`Args::sum`] has.
    fn load(file: &Path) -> io::Result<Self> {
        campaign::from_json(file)
    }

    fn save(&self, file: &Path) -> io::Result<()> {
        fs::write(file, serde_json::to_string_pretty(self)? + "\n")
    }
}

/// What a thread that panics leaves is used all the same.
fn lock<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Args {
    pub(super) fn execute(self) -> Exit {
        // What panics is told with its seed.
        panic::set_hook(Box::new(|_| ()));
        if !self.merge.is_empty() {
            return match self.merged() {
                Ok(sum) => Self::exit(self.conclude(&sum, None, |seed| Ok(self.case_of(seed)))),
                Err(error) => super::bad_input(&error),
            };
        }
        let done = match (&self.seeds, &self.explore, self.seed, &self.case) {
            (Some(seeds), None, ..) => self.all(&seeds.0),
            (Some(seeds), Some(folder), ..) => self.explored(&seeds.0, folder),
            (None, _, Some(seed), _) => self.one(&self.case_of(seed)),
            (None, _, None, Some(file)) => match Case::load(file) {
                Ok(case) => self.one(&case),
                Err(error) => return super::bad_input(&error),
            },
            (None, _, None, None) => return Exit::BadInput,
        };
        Self::exit(done)
    }

    /// The case of a seed, as long as it is to be.
    fn case_of(&self, seed: u64) -> Case {
        match self.lasting {
            Some(seconds) => Case::lasting(seed, seconds),
            None => Case::of(seed),
        }
    }

    /// Whether nothing was found, as an exit code.
    fn exit(done: Result<bool, Box<dyn Error>>) -> Exit {
        match done {
            Ok(true) => Exit::Finished,
            Ok(false) => Exit::Stopped,
            // Nothing was played.
            Err(error) if error.is::<NoOutput>() => super::bad_input(&*error),
            Err(error) => {
                report(&*error);
                Exit::Stopped
            }
        }
    }

    /// What several runs came to.
    fn merged(&self) -> io::Result<Sum> {
        let mut sum = Sum::default();
        for file in &self.merge {
            sum.merge(Sum::load(file)?);
        }
        Ok(sum)
    }

    /// Plays many seeds; whether nothing was found.
    fn all(&self, seeds: &Range<u64>) -> Result<bool, Box<dyn Error>> {
        let began = Instant::now();
        let sum = Mutex::new(Sum::default());
        self.each(seeds, |seed| {
            let case = self.case_of(seed);
            let outcome = match seed % TWICE {
                0 => campaign::run_twice(&case),
                _ => campaign::run(&case, Wanted::default(), &mut |_| ()),
            };
            for violation in &outcome.violations {
                println!("seed {seed}: {violation}");
            }
            lock(&sum).merge(Sum::of(seed, outcome));
        });
        let sum = sum.into_inner().unwrap_or_else(PoisonError::into_inner);
        if let Some(file) = &self.sum {
            sum.save(file)?;
        }
        let took = began.elapsed().as_secs_f64();
        self.conclude(&sum, Some(took), |seed| Ok(self.case_of(seed)))
    }

    /// Plays many cases that are steered to what was not reached; whether nothing was found.
    fn explored(&self, numbers: &Range<u64>, folder: &Path) -> Result<bool, Box<dyn Error>> {
        let began = Instant::now();
        fs::create_dir_all(folder)?;
        let file = |number: u64| folder.join(format!("{number}.json"));
        let explored = Mutex::new((Sum::default(), Explorer::new(numbers.start)));
        self.each(numbers, |number| {
            let case = {
                let (sum, explorer) = &mut *lock(&explored);
                explorer.next(number, &sum.coverage)
            };
            let mut sightings = Sightings::new(&case, number);
            let outcome = campaign::run(&case, Wanted::default(), &mut |seen| sightings.see(seen));
            for violation in &outcome.violations {
                println!("case {number}: {violation}");
            }
            if !outcome.violations.is_empty()
                && let Err(error) = case.save(&file(number))
            {
                report(&error);
            }
            let (sum, explorer) = &mut *lock(&explored);
            sum.merge(Sum::of(number, outcome));
            explorer.remember(case, sightings);
        });
        let (sum, explorer) = explored
            .into_inner()
            .unwrap_or_else(PoisonError::into_inner);
        for cell in explorer.given_up(&sum.coverage) {
            println!("given up: {cell}");
        }
        let took = began.elapsed().as_secs_f64();
        self.conclude(&sum, Some(took), |number| Case::load(&file(number)))
    }

    /// Does something with each seed that is this process's, on so many threads as are asked for.
    fn each(&self, seeds: &Range<u64>, play: impl Fn(u64) + Sync) {
        let Shard { part, parts } = self.shard.unwrap_or_default();
        let began = Instant::now();
        let time = self
            .minutes
            .map(|minutes| Duration::from_secs_f64(minutes * 60.0));
        let next = AtomicU64::new(0);
        let jobs = self.jobs.unwrap_or_else(crate::realtime::cores).max(1);
        let work = || loop {
            let seed = seeds.start + part + parts * next.fetch_add(1, Ordering::Relaxed);
            if seed >= seeds.end || time.is_some_and(|time| began.elapsed() > time) {
                return;
            }
            play(seed);
        };
        thread::scope(|scope| {
            for _ in 0..jobs {
                scope.spawn(work);
            }
        });
    }

    /// Tells what seeds came to, and how many seconds that took; `case` has the case of one of them.
    fn conclude(
        &self,
        sum: &Sum,
        took: Option<f64>,
        case: impl Fn(u64) -> io::Result<Case>,
    ) -> Result<bool, Box<dyn Error>> {
        if self.coverage {
            print!("{}", sum.coverage);
        }
        let mut kinds: BTreeMap<(&str, &str), Vec<u64>> = BTreeMap::new();
        for (seed, violations) in &sum.violations {
            for (checker, what) in violations {
                kinds.entry((checker, what)).or_default().push(*seed);
            }
        }
        for ((checker, what), seeds) in &kinds {
            println!(
                "{checker}: {what}: {} seeds, the first {}",
                seeds.len(),
                seeds[0]
            );
        }
        let [seconds, motion] = sum.micros.map(|it| it as f64 * 1e-6);
        let pace = took.map_or_else(String::new, |took| {
            format!(", in {took:.1} s: {:.0} a second", seconds / took.max(1e-9))
        });
        println!(
            "{} seeds, {} with violations; {seconds:.0} s of virtual time, {motion:.0} s of them in \
             motion{pace}",
            sum.played,
            sum.violations.len(),
        );
        for seeds in kinds.values() {
            self.shrunk(&case(seeds[0])?, sum.violations[&seeds[0]].first())?;
        }
        Ok(sum.violations.is_empty())
    }

    /// What is read is not written over.
    fn claims(&self) -> Claims {
        let merged = self.merge.iter().map(|file| ("--merge", file));
        let read = self.case.iter().map(|file| ("--case", file)).chain(merged);
        read.fold(Claims::default(), |claims, (what, file)| {
            claims.reads(what, file)
        })
    }

    /// Plays one case and tells what happens.
    fn one(&self, case: &Case) -> Result<bool, Box<dyn Error>> {
        let mut claims = self.claims();
        let mut results = self.output.open(&mut claims, None)?;
        let machine = case.machine.machine()?;
        let buses = machine.buses.iter().map(|bus| bus.name.clone());
        let wanted = Wanted {
            trace: results.trace()?,
            report: results.wants_report(),
            log: Some(self.log.open(&mut claims)?.begin(buses.collect())?),
        };
        let mut now = 0.0;
        let layout = Layout::new(&machine)?;
        let outcome = campaign::run(case, wanted, &mut |seen| match seen {
            Seen::Woken(woken) => now = woken.now.as_nanos() as f64 * 1e-9,
            Seen::Frame { .. } => {}
            Seen::Interfered(what) => println!("{now:10.6} s  trouble: {what:?}"),
            Seen::Commanded(command) => println!("{now:10.6} s  commanded: {command:?}"),
            Seen::Told(Event::Machine(event)) => {
                if let Some(text) = event.describe(&layout) {
                    println!("{now:10.6} s  {text}");
                }
            }
            Seen::Told(Event::State(state)) => println!("{now:10.6} s  machine {state}"),
            Seen::Told(Event::Accepted(it)) => println!("{now:10.6} s  accepted: {:?}", it.command),
            Seen::Told(Event::Refused(it)) => println!("{now:10.6} s  refused: {}", it.reason),
            Seen::Told(Event::Problem(error)) => println!("{now:10.6} s  {error}"),
            Seen::Told(Event::Message { line, text }) => {
                println!("{now:10.6} s  line {line}: {text}")
            }
            Seen::Told(Event::Recorded(files)) => println!("{now:10.6} s  {files}"),
        });
        if self.coverage {
            print!("{}", outcome.coverage);
        }
        for violation in &outcome.violations {
            println!("{violation}");
        }
        for (drive, spec) in machine.drives.iter().enumerate() {
            if outcome.powered.get(drive) == Some(&true) {
                println!("drive {} is left with its power stage on", spec.name);
            }
        }
        println!("frames SHA-256 {}", outcome.frames);
        let first = outcome.violations.first();
        let first = first.map(|it| (it.checker.to_owned(), it.what.to_owned()));
        self.shrunk(case, first.as_ref())?;
        self.write(case, outcome, results)
    }

    fn write(
        &self,
        case: &Case,
        outcome: Outcome,
        results: Results,
    ) -> Result<bool, Box<dyn Error>> {
        let good = outcome.violations.is_empty();
        if let Some(played) = outcome.played {
            let title = format!("a campaign's seed {}", case.seed);
            let (mut summary, rows) = (played.summary, played.report);
            results.write(
                &mut summary,
                rows,
                Path::new("campaign"),
                title,
                Target::begin,
            )?;
        }
        Ok(good)
    }

    /// Writes the smallest case in which this checker finds that.
    fn shrunk(&self, case: &Case, first: Option<&(String, String)>) -> Result<(), Box<dyn Error>> {
        let (Some(folder), Some((checker, what))) = (&self.shrink, first) else {
            return Ok(());
        };
        let small = shrink::shrink(case, |case| {
            let outcome = campaign::run(case, Wanted::default(), &mut |_| ());
            let mut found = outcome.violations.iter();
            found.any(|it| it.checker == checker && it.what == what)
        });
        fs::create_dir_all(folder)?;
        let file = folder.join(format!("{checker}-{}.json", case.seed));
        let target = self.claims().target("--shrink", &file);
        let target = target.map_err(|error| error.to_string())?;
        target.put(&small.to_json()?)?;
        println!("{}: {checker}: {what}", file.display());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn played(seeds: impl Iterator<Item = u64>) -> Sum {
        let mut sum = Sum::default();
        for seed in seeds {
            let mut case = Case::of(seed);
            case.cycles /= 8;
            let outcome = campaign::run(&case, Wanted::default(), &mut |_| ());
            sum.merge(Sum::of(seed, outcome));
        }
        sum
    }

    #[test]
    fn shards_come_to_what_one_run_comes_to() {
        let folder = std::env::temp_dir().join(format!("syncline-shards-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let mut merged = Sum::default();
        for part in [2, 0, 1] {
            let file = folder.join(format!("{part}.json"));
            played((0..6).skip(part).step_by(3)).save(&file).unwrap();
            merged.merge(Sum::load(&file).unwrap());
        }
        fs::remove_dir_all(&folder).unwrap();
        assert_eq!(merged, played(0..6));
        assert_eq!(merged.played, 6);
    }
}
