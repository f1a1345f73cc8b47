//! `syncline bench`: measure this host.

use super::output::{Claims, NoOutput, Target};
use super::{Exit, bad_input, core, duration, report};
use crate::bench::cycle::{self, Buses, Outcome};
use crate::bench::offline::{self, Part};
use crate::bench::rig::Shape;
use crate::bench::sync::{self, Sender};
use crate::observe::record::Report;
use crate::observe::timing;
use crate::realtime;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args as ClapArgs, Subcommand};
use serde_json::{Value, json};
use std::error::Error;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use std::{fs, io, thread};
use syncline_drives::model::{MODELS, Model, REFERENCE};

/// Measure this host: the cycle, and the parts of a simulation.
///
/// Times are in µs; a percentile is stated only where at least ten samples lie beyond it.
#[derive(Debug, ClapArgs)]
pub(super) struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    Cycle(CycleArgs),
    Sync(SyncArgs),
    /// Simulated bus: how many cycles of frames a second
    Bus(OfflineArgs),
    /// Simulated drives: how many cycles of control loops and mechanics a second
    Plant(PlantArgs),
    /// Path planner: how many moves a second
    Plan(OfflineArgs),
}

/// The real-time cycle, stage by stage: wake-up, SYNC, receive, compute, send, and how long before
/// the next SYNC the setpoints were out.
///
/// Drives are simulated: on simulated buses, or behind SocketCAN interfaces of this host (vcan).
/// Compute is the thread's processor time, less what reading its clock takes; cycles in which the
/// processor was taken away are left out of it and counted.
#[derive(Debug, ClapArgs)]
struct CycleArgs {
    /// `sim`, or SocketCAN interfaces without drives on them, one for each bus: vcan0,vcan1
    #[arg(long, default_value = "sim", value_delimiter = ',')]
    bus: Vec<String>,
    /// Model of the drives
    #[arg(long, default_value = REFERENCE.name, value_parser = drive_model())]
    model: &'static Model,
    /// Axes, 1…64
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u8).range(1..=64))]
    axes: u8,
    /// Simulated buses to spread the axes over; as few as take them if not given
    #[arg(long, value_parser = clap::value_parser!(u8).range(1..=64), conflicts_with = "bus")]
    buses: Option<u8>,
    /// SYNC to SYNC, as the drives take it: 1ms, 2ms … 20ms
    #[arg(long, default_value = "2ms", value_parser = duration)]
    period: Duration,
    /// How long to measure
    #[arg(long, default_value = "60s", value_parser = duration)]
    duration: Duration,
    /// Keep all processors busy meanwhile
    #[arg(long)]
    load: bool,
    /// Interleave a bare wake-up loop and tell what the controller adds, with 95 % intervals; time a
    /// computation without memory in the same cycles
    #[arg(long)]
    control: bool,
    /// The core to run on
    #[arg(long, value_parser = core)]
    core: Option<usize>,
    /// SCHED_FIFO priority
    #[arg(long, default_value_t = 80, value_parser = clap::value_parser!(u8).range(1..=99))]
    priority: u8,
    /// Stay awake that long before each instant, for a core of its own; from 50us on also time
    /// enough to rehearse, for caches that went cold
    #[arg(long, default_value = "0us", value_parser = duration)]
    spin: Duration,
    #[command(flatten)]
    output: Output,
}

/// SYNC by the cycle's thread, then by the kernel's broadcast manager: how even, and whether it
/// keeps to the clock.
#[derive(Debug, ClapArgs)]
struct SyncArgs {
    /// A SocketCAN interface without drives on it
    #[arg(long)]
    bus: String,
    /// SYNC to SYNC: 500us, 1ms, 2ms …
    #[arg(long, default_value = "2ms", value_parser = duration)]
    period: Duration,
    /// How long to measure either source
    #[arg(long, default_value = "20s", value_parser = duration)]
    duration: Duration,
    /// The core to run on
    #[arg(long, value_parser = core)]
    core: Option<usize>,
    /// SCHED_FIFO priority
    #[arg(long, default_value_t = 80, value_parser = clap::value_parser!(u8).range(1..=99))]
    priority: u8,
    #[command(flatten)]
    output: Output,
}

/// What a simulation is made of, as fast as the processor allows.
#[derive(Debug, ClapArgs)]
struct OfflineArgs {
    /// Axes, 1…64
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u8).range(1..=64))]
    axes: u8,
    /// SYNC to SYNC
    #[arg(long, default_value = "2ms", value_parser = duration)]
    period: Duration,
    /// How many to measure
    #[arg(long, default_value_t = 20_000)]
    steps: u64,
    #[command(flatten)]
    output: Output,
}

#[derive(Debug, ClapArgs)]
struct PlantArgs {
    /// Model of the drives
    #[arg(long, default_value = REFERENCE.name, value_parser = drive_model())]
    model: &'static Model,
    #[command(flatten)]
    offline: OfflineArgs,
}

/// The models that move an axis, by their names.
fn drive_model() -> impl TypedValueParser<Value = &'static Model> {
    let drives = MODELS.iter().filter(|model| model.moves_axes());
    PossibleValuesParser::new(drives.map(|model| model.name))
        .try_map(|name| Model::by_name(&name).ok_or("no such model"))
}

#[derive(Debug, ClapArgs)]
struct Output {
    /// Print JSON instead of text
    #[arg(long)]
    json: bool,
    /// Write a self-contained HTML report
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Write each distribution as a percentile table for HdrHistogram's plotter:
    /// FILE becomes FILE-<name>.hgrm
    #[arg(long, value_name = "FILE")]
    hgrm: Option<PathBuf>,
}

impl Args {
    /// Measures and prints.
    pub(super) fn execute(&self) -> Exit {
        match &self.what {
            What::Cycle(args) => args.execute(),
            What::Sync(args) => args.execute(),
            What::Bus(args) => args.execute(offline::BUS, REFERENCE),
            What::Plant(args) => args.offline.execute(offline::PLANT, args.model),
            What::Plan(args) => args.execute(offline::PLAN, REFERENCE),
        }
    }
}

/// How a measurement ended.
fn ended(measured: Result<(), Box<dyn Error>>) -> Exit {
    match measured {
        Ok(()) => Exit::Finished,
        Err(error) => {
            report(&*error);
            Exit::Stopped
        }
    }
}

impl CycleArgs {
    fn execute(&self) -> Exit {
        match self.prepare() {
            Ok((options, files, buses)) => ended(self.measure(&options, files, buses)),
            Err(error) => bad_input(&*error),
        }
    }

    /// Opens files and buses.
    fn prepare(&self) -> Result<(cycle::Options, Files, Buses), Box<dyn Error>> {
        let axes = usize::from(self.axes);
        let interfaces = if self.bus == ["sim"] {
            Vec::new()
        } else {
            self.bus.clone()
        };
        let buses = match interfaces.len() {
            0 => self.buses.map(usize::from),
            given => Some(given),
        };
        let shape = match buses {
            None => Shape::of_model(self.model, axes, self.period)?,
            Some(buses) => {
                let shape = Shape {
                    model: self.model,
                    axes,
                    buses: buses.min(axes),
                    period: self.period,
                };
                shape.check()?;
                shape
            }
        };
        let cycles = self.duration.as_nanos() / self.period.as_nanos().max(1);
        let options = cycle::Options {
            shape,
            interfaces,
            cycles: cycles.clamp(1, 1 << 32) as u64,
            control: self.control,
            realtime: realtime::Settings {
                priority: self.priority,
                core: self.core,
            },
            spin: self.spin,
        };
        let files = self.output.open(cycle::names())?;
        let buses = Buses::open(&options)?;
        Ok((options, files, buses))
    }

    fn measure(
        &self,
        options: &cycle::Options,
        files: Files,
        buses: Buses,
    ) -> Result<(), Box<dyn Error>> {
        let load = self.load.then(Load::new);
        let measured = cycle::measure(options, buses);
        let load = load.map(Load::end).unwrap_or_default();
        let outcome = measured?;
        let facts = self.facts(options, &outcome, &load);
        if self.output.json {
            println!("{:#}", cycle_json(&facts, &outcome, &load));
        } else {
            print_facts(&facts);
            println!("{}", outcome.granted);
            outcome.notes.iter().for_each(|note| println!("{note}"));
            for distribution in &outcome.distributions {
                println!("{}", distribution.line(outcome.start));
            }
        }
        Ok(files.write("bench cycle", &facts, &outcome.distributions)?)
    }

    fn facts(
        &self,
        options: &cycle::Options,
        outcome: &Outcome,
        load: &[Duration],
    ) -> Vec<(String, String)> {
        let busy: Duration = load.iter().sum();
        let mut facts = vec![
            ("drives".into(), self.model.title.to_owned()),
            ("axes".into(), self.axes.to_string()),
            (
                "buses".into(),
                format!("{}, {}", options.shape.buses, outcome.stamps),
            ),
            (
                "period".into(),
                format!("{} us", timing::micros(self.period)),
            ),
            (
                "load".into(),
                match load.len() {
                    0 => "none".into(),
                    threads => format!(
                        "{threads} threads, {:.1} s of processor time",
                        busy.as_secs_f64()
                    ),
                },
            ),
            ("cycles".into(), outcome.cycles.to_string()),
            ("late wake-ups".into(), outcome.late.to_string()),
            ("late setpoints".into(), outcome.dropped.to_string()),
            ("preempted".into(), outcome.preempted.to_string()),
            ("processor".into(), processor(options, outcome)),
            (
                "clock reading".into(),
                format!("{} us, taken off compute", timing::micros(outcome.clock)),
            ),
            ("worst cycle".into(), outcome.worst.to_string()),
        ];
        for (name, difference) in outcome.control.iter().flatten() {
            facts.push((
                format!("controller − bare, {name}"),
                format!(
                    "{:.3} us, 95 % interval {:.3}…{:.3} us",
                    difference.estimate / 1e3,
                    difference.low / 1e3,
                    difference.high / 1e3
                ),
            ));
        }
        facts
    }
}

/// How much of one core the cycle's thread took.
fn processor(options: &cycle::Options, outcome: &Outcome) -> String {
    let time = options.shape.period.as_secs_f64() * outcome.cycles as f64;
    let share = 100.0 * outcome.processor.as_secs_f64() / time;
    let with = if options.interfaces.is_empty() {
        ", simulated buses and drives included"
    } else {
        ""
    };
    format!("{share:.1} % of one core{with}")
}

fn cycle_json(facts: &[(String, String)], outcome: &Outcome, load: &[Duration]) -> Value {
    let distributions: serde_json::Map<String, Value> = outcome
        .distributions
        .iter()
        .map(|it| (it.name().to_owned(), it.json(outcome.start)))
        .collect();
    let control: serde_json::Map<String, Value> = outcome
        .control
        .iter()
        .flatten()
        .map(|(name, difference)| {
            let micros = |nanos: f64| nanos / 1e3;
            (
                (*name).to_owned(),
                json!({
                    "difference_us": micros(difference.estimate),
                    "low_us": micros(difference.low),
                    "high_us": micros(difference.high),
                }),
            )
        })
        .collect();
    let granted = outcome
        .granted
        .requests()
        .iter()
        .map(|request| json!({ "what": request.what, "granted": request.refused.is_none() }));
    json!({
        "facts": facts_json(facts),
        "cycles": outcome.cycles,
        "late_wakeups": outcome.late,
        "late_setpoints": outcome.dropped,
        "preempted": outcome.preempted,
        "processor_s": outcome.processor.as_secs_f64(),
        "load_s": load.iter().map(Duration::as_secs_f64).collect::<Vec<_>>(),
        "worst_stage": outcome.worst.longest().name(),
        "realtime": granted.collect::<Vec<_>>(),
        "control": control,
        "distributions": distributions,
    })
}

fn facts_json(facts: &[(String, String)]) -> Value {
    Value::Object(
        facts
            .iter()
            .map(|(name, value)| (name.clone(), json!(value)))
            .collect(),
    )
}

fn print_facts(facts: &[(String, String)]) {
    for (name, value) in facts {
        println!("{name:<26}{value}");
    }
}

impl SyncArgs {
    fn execute(&self) -> Exit {
        let cycles = self.duration.as_nanos() / self.period.as_nanos().max(1);
        let options = sync::Options {
            interface: self.bus.clone(),
            period: self.period,
            cycles: cycles.clamp(1, u32::MAX.into()) as u32,
            realtime: realtime::Settings {
                priority: self.priority,
                core: self.core,
            },
        };
        let files = match self.output.open(sync::NAMES.into_iter()) {
            Ok(files) => files,
            Err(error) => return bad_input(&error),
        };
        match Sender::open(&options) {
            Ok(sender) => ended(self.measure(&options, files, sender)),
            Err(error) => bad_input(&error),
        }
    }

    fn measure(
        &self,
        options: &sync::Options,
        files: Files,
        sender: Sender,
    ) -> Result<(), Box<dyn Error>> {
        let outcome = sync::measure(options, sender)?;
        let sources = [outcome.thread, outcome.kernel];
        let drifts = sources.each_ref().map(|source| source.drift);
        let distributions = sources.map(|source| source.jitter);
        let mut facts = vec![(
            "period".to_owned(),
            format!("{} us", timing::micros(self.period)),
        )];
        for (distribution, drift) in distributions.iter().zip(drifts) {
            facts.push((
                distribution.name().to_owned(),
                format!("behind the clock by {drift:.1} ns a SYNC"),
            ));
        }
        if self.output.json {
            let [thread, kernel] = &distributions;
            println!(
                "{:#}",
                json!({
                    "facts": facts_json(&facts),
                    "drift_ns": { "thread": drifts[0], "kernel": drifts[1] },
                    "distributions": {
                        "thread": thread.json(outcome.start),
                        "kernel": kernel.json(outcome.start),
                    },
                })
            );
        } else {
            print_facts(&facts);
            println!("{}", outcome.granted);
            for distribution in &distributions {
                println!("{}", distribution.line(outcome.start));
            }
        }
        Ok(files.write("bench sync", &facts, &distributions)?)
    }
}

impl OfflineArgs {
    fn execute(&self, part: Part, model: &'static Model) -> Exit {
        match self.output.open(std::iter::once(part.name)) {
            Ok(files) => ended(self.measure(part, model, files).map_err(Into::into)),
            Err(error) => bad_input(&error),
        }
    }

    fn measure(&self, part: Part, model: &'static Model, files: Files) -> io::Result<()> {
        let shape = Shape {
            model,
            axes: self.axes.into(),
            buses: 1,
            period: self.period,
        };
        let throughput = (part.measure)(&shape, self.steps.max(1));
        let facts = vec![
            ("axes".to_owned(), self.axes.to_string()),
            ("speed".to_owned(), throughput.speed()),
        ];
        let distribution = &throughput.distribution;
        if self.output.json {
            println!(
                "{:#}",
                json!({
                    "facts": facts_json(&facts),
                    "steps_per_second": throughput.steps as f64 / throughput.total.as_secs_f64(),
                    "distributions": { distribution.name(): distribution.json(throughput.start) },
                })
            );
        } else {
            print_facts(&facts);
            println!("{}", distribution.line(throughput.start));
        }
        files.write(part.name, &facts, std::slice::from_ref(distribution))
    }
}

/// The files of an [`Output`].
struct Files {
    report: Option<Target>,
    /// By the name of the distribution.
    tables: Vec<(&'static str, Target)>,
}

impl Output {
    /// Opens the files for distributions of these names.
    fn open(&self, names: impl Iterator<Item = &'static str>) -> Result<Files, NoOutput> {
        let mut claims = Claims::stdout("what is printed");
        let report = claims.open("--report", &self.report)?;
        let mut tables = Vec::new();
        if let Some(file) = &self.hgrm {
            for name in names {
                let mut file = file.clone().into_os_string();
                file.push(format!("-{}.hgrm", name.replace(' ', "-")));
                tables.push((name, claims.target("--hgrm", file.as_ref())?));
            }
        }
        Ok(Files { report, tables })
    }
}

impl Files {
    fn write(
        self,
        what: &str,
        facts: &[(String, String)],
        distributions: &[timing::Distribution],
    ) -> io::Result<()> {
        if let Some(report) = self.report {
            report.put(&html(what, facts, distributions))?;
        }
        for (name, table) in self.tables {
            // Those that there was nothing of go again.
            if let Some(distribution) = distributions.iter().find(|it| it.name() == name) {
                table.put(&distribution.hgrm())?;
            }
        }
        Ok(())
    }
}

fn html(what: &str, facts: &[(String, String)], distributions: &[timing::Distribution]) -> String {
    let host = fs::read_to_string("/proc/version").unwrap_or_default();
    Report {
        machine: what.into(),
        mode: host.trim().into(),
        verdict: "pass",
        outcome: "measured".into(),
        facts: facts.to_vec(),
        distributions: distributions.to_vec(),
        ..Report::default()
    }
    .to_html(None)
}

/// Threads that keep every processor and its caches busy.
struct Load {
    stop: Arc<AtomicBool>,
    threads: Vec<thread::JoinHandle<Duration>>,
}

impl Load {
    fn new() -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let count = thread::available_parallelism().map_or(2, usize::from);
        let threads = (0..count)
            .map(|_| {
                let stop = Arc::clone(&stop);
                thread::spawn(move || {
                    let mut memory = vec![0_u64; 4 << 20];
                    let mut at = 1_usize;
                    while !stop.load(Ordering::Relaxed) {
                        for _ in 0..4096 {
                            at = at.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                            let place = (at >> 20) % memory.len();
                            memory[place] = memory[place].wrapping_add(at as u64);
                        }
                    }
                    realtime::thread_time()
                })
            })
            .collect();
        Self { stop, threads }
    }

    /// The processor time that each has taken.
    fn end(self) -> Vec<Duration> {
        self.stop.store(true, Ordering::Relaxed);
        let ended = self.threads.into_iter().map(thread::JoinHandle::join);
        ended.map(Result::unwrap_or_default).collect()
    }
}
