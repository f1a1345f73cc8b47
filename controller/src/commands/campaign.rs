//! `syncline campaign`: random machines, programs, operators and troubles, watched by checkers.

use super::log_files::LogFiles;
use super::output::{Claims, Output, Results, Target};
use super::{Exit, report};
use crate::campaign::{self, Case, Coverage, Outcome, Seen, Violation, Wanted, shrink};
use crate::control::Layout;
use crate::session::Event;
use std::collections::BTreeMap;
use std::error::Error;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use std::{fs, panic, thread};

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
    #[arg(long, value_name = "A..B", required_unless_present_any = ["seed", "case"])]
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
    /// Begin no seed after so many minutes.
    #[arg(long, requires = "seeds")]
    minutes: Option<f64>,
    /// Make what fails smaller, and write it to a file in this folder.
    #[arg(long, value_name = "FOLDER")]
    shrink: Option<PathBuf>,
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

/// A part of a range.
#[derive(Clone, Copy, Debug)]
struct Shard {
    part: u64,
    parts: u64,
}

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

impl FromStr for Shard {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let (part, parts) = text.split_once('/').ok_or("write I/N")?;
        let number = |text: &str| text.parse().map_err(|_| "write whole numbers");
        let shard = Self {
            part: number(part)?,
            parts: number(parts)?,
        };
        if shard.part >= shard.parts {
            return Err("I is from 0 to N - 1");
        }
        Ok(shard)
    }
}

/// What all seeds so far came to.
#[derive(Default)]
struct Sum {
    played: u64,
    seconds: [f64; 2],
    coverage: Coverage,
    /// By seed.
    violations: BTreeMap<u64, Vec<Violation>>,
}

impl Args {
    pub(super) fn execute(self) -> Exit {
        // What panics is told with its seed.
        panic::set_hook(Box::new(|_| ()));
        let done = match (&self.seeds, self.seed, &self.case) {
            (Some(seeds), ..) => self.all(&seeds.0),
            (None, Some(seed), _) => self.one(&Case::of(seed)),
            (None, None, Some(file)) => match Case::load(file) {
                Ok(case) => self.one(&case),
                Err(error) => return super::bad_input(&error),
            },
            (None, None, None) => return Exit::BadInput,
        };
        match done {
            Ok(true) => Exit::Finished,
            Ok(false) => Exit::Stopped,
            Err(error) => {
                report(&*error);
                Exit::Stopped
            }
        }
    }

    /// Plays many seeds; whether nothing was found.
    fn all(&self, seeds: &Range<u64>) -> Result<bool, Box<dyn Error>> {
        let Shard { part, parts } = self.shard.unwrap_or(Shard { part: 0, parts: 1 });
        let began = Instant::now();
        let time = self
            .minutes
            .map(|minutes| Duration::from_secs_f64(minutes * 60.0));
        let next = AtomicU64::new(0);
        let sum = Mutex::new(Sum::default());
        let jobs = self.jobs.unwrap_or_else(crate::realtime::cores).max(1);
        let play = || loop {
            let seed = seeds.start + part + parts * next.fetch_add(1, Ordering::Relaxed);
            if seed >= seeds.end || time.is_some_and(|time| began.elapsed() > time) {
                return;
            }
            let case = Case::of(seed);
            let outcome = match seed % TWICE {
                0 => campaign::run_twice(&case),
                _ => campaign::run(&case, Wanted::default(), &mut |_| ()),
            };
            let mut sum = sum.lock().unwrap_or_else(PoisonError::into_inner);
            for violation in &outcome.violations {
                println!("seed {seed}: {violation}");
            }
            sum.played += 1;
            sum.seconds[0] += outcome.seconds[0];
            sum.seconds[1] += outcome.seconds[1];
            sum.coverage.merge(outcome.coverage);
            if !outcome.violations.is_empty() {
                sum.violations.insert(seed, outcome.violations);
            }
        };
        thread::scope(|scope| {
            for _ in 0..jobs {
                scope.spawn(play);
            }
        });
        let sum = sum.into_inner().unwrap_or_else(PoisonError::into_inner);
        self.conclude(&sum, began.elapsed().as_secs_f64())
    }

    fn conclude(&self, sum: &Sum, took: f64) -> Result<bool, Box<dyn Error>> {
        if self.coverage {
            print!("{}", sum.coverage);
        }
        let mut kinds: BTreeMap<(&str, &str), Vec<u64>> = BTreeMap::new();
        for (seed, violations) in &sum.violations {
            for it in violations {
                kinds.entry((it.checker, it.what)).or_default().push(*seed);
            }
        }
        for ((checker, what), seeds) in &kinds {
            println!(
                "{checker}: {what}: {} seeds, the first {}",
                seeds.len(),
                seeds[0]
            );
        }
        let [seconds, motion] = sum.seconds;
        println!(
            "{} seeds, {} with violations; {seconds:.0} s of virtual time, {motion:.0} s of them in \
             motion, in {took:.1} s: {:.0} a second",
            sum.played,
            sum.violations.len(),
            seconds / took.max(1e-9),
        );
        for seeds in kinds.values() {
            self.shrunk(&Case::of(seeds[0]), &sum.violations[&seeds[0]])?;
        }
        Ok(sum.violations.is_empty())
    }

    /// Plays one case and tells what happens.
    fn one(&self, case: &Case) -> Result<bool, Box<dyn Error>> {
        let mut claims = Claims::default();
        let mut results = self.output.open(&mut claims)?;
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
        self.shrunk(case, &outcome.violations)?;
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
            let (summary, rows) = (&played.summary, played.report);
            results.write(summary, rows, Path::new("campaign"), title, Target::begin)?;
        }
        Ok(good)
    }

    /// Writes the smallest case in which the first of these violations is found.
    fn shrunk(&self, case: &Case, violations: &[Violation]) -> Result<(), Box<dyn Error>> {
        let (Some(folder), Some(first)) = (&self.shrink, violations.first()) else {
            return Ok(());
        };
        let kind = |it: &Violation| (it.checker, it.what);
        let small = shrink::shrink(case, |case| {
            let outcome = campaign::run(case, Wanted::default(), &mut |_| ());
            outcome.violations.iter().any(|it| kind(it) == kind(first))
        });
        fs::create_dir_all(folder)?;
        let file = folder.join(format!("{}-{}.json", first.checker, case.seed));
        small.save(&file)?;
        println!("{}: {}: {}", file.display(), first.checker, first.what);
        Ok(())
    }
}
