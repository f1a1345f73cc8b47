//! `syncline run`: a program on a machine, in real time.

use super::keys::{self, Key, Keys};
use super::log_files::{Listeners, LogFiles};
use super::output::{Claims, Output, Results};
use super::ports::PortChoice;
use super::switches::Switches;
use super::{Exit, bad_input, duration, report};
use crate::control::{Controller, End, Event, Layout, Order, Row};
use crate::machine::{COORDINATES, Machine};
use crate::port::{self, Ports, url};
use crate::program::{Beginning, Extent, Moves, Program, counted_speed};
use crate::realtime;
use crate::run::frames::SharedFrames;
use crate::run::planning::Planning;
use crate::run::real_time::{Cycle, Link, Measured, News, Timing, late_after};
use crate::run::recorder::{Recorder, Summary};
use crate::timing::Stage;
use crossbeam::channel::{self, Receiver};
use indicatif::{ProgressBar, ProgressStyle};
use rustix::termios::{QueueSelector, tcflush};
use std::error::Error;
use std::fmt::Display;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use syncline_drives::world::{Observer, World};
use syncline_gcode::Tables;
use syncline_trajectory::path::Jog;

/// How often the outer side looks after the cycle.
const POLL: Duration = Duration::from_millis(1);

/// Run a program on a machine, in real time.
///
/// Brings up the drives, runs the program and shuts down in an orderly way, whatever happens:
/// a fault or Ctrl-C leads to a stop on the path, then the drives are disabled. At a program stop
/// (M0, M1 with --optional-stop, M6) the machine rests with its drives enabled until Enter.
///
/// On a terminal, space holds on the path and goes on, + and - change the feed override by 10 %,
/// the keys > and < the rapid override, s stops after the block, b goes back to the beginning of
/// the block, q stops as Ctrl-C does. While it is held or at a program stop, the arrows and page
/// keys jog X, Y and Z, by steps that [ and ] choose; what goes on goes back first.
///
/// A bus whose port is `sim` is simulated here, with a simulated drive for each of its nodes. If
/// all are, their time goes with the cycle: a late wake-up delays both and is counted.
///
/// This is no safety device: the emergency stop belongs in hardware.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Machine file (TOML).
    machine: PathBuf,
    /// Part program (RS-274/NGC).
    program: PathBuf,
    #[command(flatten)]
    ports: PortChoice,
    #[command(flatten)]
    output: Output,
    #[command(flatten)]
    log: LogFiles,
    /// Varies encoder noise, response delays and oscillator errors of simulated drives.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    switches: Switches,
    /// Make a late wake-up a fault on simulated buses too.
    #[arg(long)]
    strict: bool,
    /// Real-time priority of the cycle, 1…99.
    #[arg(long, default_value_t = 80, value_parser = clap::value_parser!(u8).range(1..=99))]
    priority: u8,
    /// Processor core of the cycle; an isolated one is best. Without it, the last one that this
    /// process may use.
    #[arg(long)]
    core: Option<usize>,
    /// Stay awake that long before each wake-up, for a core of its own: 50us.
    #[arg(long, default_value = "0us", value_parser = duration)]
    spin: Duration,
    /// Tell what the controller does.
    #[arg(short, long)]
    verbose: bool,
}

impl Args {
    pub(super) fn execute(self) -> Exit {
        let prepared = self.prepare();
        let Prepared {
            machine,
            layout,
            program,
            extent,
            world,
            ports,
            frames,
            listeners,
            claims,
            results,
        } = match prepared {
            Ok(prepared) => prepared,
            Err(error) => return bad_input(&*error),
        };
        let run = Run {
            args: &self,
            machine: &machine,
            layout: &layout,
            program,
            extent,
            frames,
            listeners,
            claims,
            results,
        };
        match run.execute(world, ports) {
            Ok(exit) => exit,
            Err(error) => {
                report(&*error);
                Exit::Stopped
            }
        }
    }
}

/// All that a run needs.
struct Prepared {
    machine: Machine,
    layout: Arc<Layout>,
    program: Program,
    extent: Extent,
    world: World,
    ports: Ports,
    frames: SharedFrames,
    listeners: Listeners,
    claims: Claims,
    results: Results,
}

impl Args {
    /// Reads and checks everything, and opens files and buses, before anything moves.
    fn prepare(&self) -> Result<Prepared, Box<dyn Error>> {
        let mut machine = Machine::load(&self.machine)?;
        self.ports.apply(&mut machine)?;
        let layout = Arc::new(Layout::new(&machine)?);
        let program = (self.switches).program(&self.program, &machine, &self.machine)?;
        let extent = program.check(machine.rest())?;
        let mut claims = Claims::of_run(&self.machine, &self.program);
        let results = self.output.open(&mut claims)?;
        let logs = self.log.open(&mut claims)?;
        if extent.sets_tables {
            Tables::probe(&Tables::beside(&self.machine))?;
        }
        if let Some(beginning) = program.beginning(machine.rest())? {
            confirm(&beginning)?;
        }
        let frames = SharedFrames::new(&machine);
        let mut listeners = logs.listeners();
        let mut observers: Vec<Observer> = Vec::with_capacity(machine.buses.len());
        for bus in 0..machine.buses.len() {
            observers.push(if lockstep(&machine) {
                Box::new(frames.observer(bus))
            } else {
                listeners.overhear(bus, frames.clone())?
            });
        }
        let (world, ports) = port::open(&machine, self.seed, observers)?;
        for port in &ports {
            port.notes().iter().for_each(|note| eprintln!("{note}"));
        }
        logs.record(&machine, &frames, &mut listeners)?;
        Ok(Prepared {
            machine,
            layout,
            program,
            extent,
            world,
            ports,
            frames,
            listeners,
            claims,
            results,
        })
    }
}

/// Whether every bus is simulated: their time goes with the cycle.
fn lockstep(machine: &Machine) -> bool {
    machine.buses.iter().all(|bus| bus.port == url::SIM)
}

/// Asks whether the program is to begin in the middle.
fn confirm(beginning: &Beginning) -> Result<(), NotConfirmed> {
    // What was typed ahead answers no question. Where input is no terminal nobody typed it.
    let _ = tcflush(std::io::stdin(), QueueSelector::IFlush);
    eprintln!("{beginning}\npress Enter to begin there, Ctrl-C to give up");
    match std::io::stdin().read_line(&mut String::new()) {
        Ok(bytes) if bytes > 0 => Ok(()),
        _ => Err(NotConfirmed),
    }
}

#[derive(Debug, thiserror::Error)]
#[error("--from-line: standard input is closed, nobody can confirm: press Enter there")]
struct NotConfirmed;

/// The side of a run that is outside of the cycle.
struct Run<'a> {
    args: &'a Args,
    machine: &'a Machine,
    layout: &'a Arc<Layout>,
    program: Program,
    extent: Extent,
    frames: SharedFrames,
    listeners: Listeners,
    claims: Claims,
    results: Results,
}

/// What a person does.
struct Person {
    interrupted: Arc<AtomicBool>,
    /// At the machine's own terminal.
    keys: Option<Keys>,
    /// Lines of standard input where that is no terminal, once they are wanted.
    lines: Option<Receiver<()>>,
    /// Feed and rapid override, %.
    overrides: [i32; 2],
    /// Which of [`JOG_STEPS`] a jog by a key is.
    jog_step: usize,
    /// The path rests, so that there may be jogs.
    rests: bool,
}

/// By the keys, of X, Y and Z: mm.
const JOG_STEPS: [f64; 5] = [0.01, 0.1, 1.0, 10.0, 100.0];

impl Person {
    /// The next order by a key.
    fn order(&mut self) -> Option<Order> {
        let key = self.keys.as_ref()?.pressed()?;
        let [feed, rapid] = &mut self.overrides;
        Some(match key {
            Key::Jog(axis, direction) => Order::Jog(Jog::Step {
                axis: axis.index(),
                distance: direction * JOG_STEPS[self.jog_step],
                speed: f64::INFINITY,
            }),
            Key::JogStep(by) => {
                let step = self.jog_step.saturating_add_signed(by);
                self.jog_step = step.min(JOG_STEPS.len() - 1);
                return self.order();
            }
            Key::Hold => Order::ToggleHold,
            Key::Feed(step) => {
                *feed = (*feed + step).clamp(0, 200);
                Order::FeedOverride(f64::from(*feed) / 100.0)
            }
            Key::Rapid(step) => {
                *rapid = (*rapid + step).clamp(0, 100);
                Order::RapidOverride(f64::from(*rapid) / 100.0)
            }
            Key::StopAfterBlock => Order::StopAfterBlock,
            Key::StepBack => Order::StepBack,
            Key::Stop => Order::Interrupt,
            Key::GoOn => Order::GoOn,
        })
    }

    /// What of the programmed speeds is asked for, if it is not all of them.
    fn overridden(&self) -> String {
        let [feed, rapid] = self.overrides;
        let tell = |what: &str, percent: i32| match percent {
            100 => String::new(),
            _ => format!(", {what} {percent} %"),
        };
        tell("feed", feed) + &tell("rapid", rapid)
    }
}

impl Run<'_> {
    fn execute(mut self, world: World, ports: Ports) -> Result<Exit, Box<dyn Error>> {
        let lockstep = lockstep(self.machine);
        let timing = Timing {
            settings: realtime::Settings {
                priority: self.args.priority,
                core: self.args.core.or_else(realtime::last_core),
            },
            spin: self.args.spin,
            lockstep,
            strict: self.args.strict,
        };
        let (trace, wants_report) = (self.results.trace()?, self.results.wants_report());
        let mut recorder = Recorder::new(self.machine, trace, wants_report)?;
        let mut person = Person {
            interrupted: Arc::new(AtomicBool::new(false)),
            keys: Keys::listen()?,
            lines: None,
            overrides: [100; 2],
            jog_step: 2,
            rests: false,
        };
        if person.keys.is_some() {
            eprintln!("{}", keys::HELP);
        }
        let interrupted = Arc::clone(&person.interrupted);
        ctrlc::set_handler(move || interrupted.store(true, Ordering::Relaxed))?;

        let (mut cycle, link, instructions) = Cycle::new(self.layout, world, ports, timing);
        if self.program.streams() {
            cycle.wait_for_input();
        }
        let (upcoming, mut moves) = Moves::new();
        let mut planning = Planning::new(self.program.clone(), upcoming, instructions)?;
        let outcome = std::thread::scope(|scope| {
            // Goes before the cycle is waited for, also by a panic: that makes the cycle stop.
            let mut link = link;
            let cycle = std::thread::Builder::new()
                .name("cycle".into())
                .spawn_scoped(scope, move || {
                    cycle.run(|granted| {
                        eprintln!("{granted}");
                        granted
                    })
                })?;
            let mut failure = None;
            let bar = self.progress_bar();
            let mut attend = |link: &mut Link, planning: &mut Planning| {
                self.attend(link, &mut person, &bar, planning)?;
                self.follow(link, &mut person, &bar, &mut recorder, &mut moves, planning)
            };
            while !cycle.is_finished() {
                let done = attend(&mut link, &mut planning).unwrap_or_else(|error| {
                    link.order(Order::Abandon);
                    failure.get_or_insert(error);
                    true
                });
                if done {
                    std::thread::sleep(POLL);
                }
            }
            while !attend(&mut link, &mut planning)? {}
            bar.finish_and_clear();
            let (controller, measured) = cycle.join().map_err(|_| CyclePanic)?;
            self.program.abandon();
            if let Some(error) = failure {
                report(&*error);
            }
            let mut saved = Ok(());
            if controller.end() == Some(End::Finished)
                && let Some(feeder) = planning.end()?
            {
                saved = feeder.save_tables(&Tables::beside(&self.args.machine));
            }
            Ok::<_, Box<dyn Error>>((controller, measured, saved))
        });
        let (controller, measured, saved) = outcome?;
        let exit = self.conclude(recorder, &controller, &measured, lockstep)?;
        saved?;
        Ok(exit)
    }
}

/// The cycle itself panicked: the drives' own supervision stops them.
#[derive(Debug, thiserror::Error)]
#[error("the cycle failed: this is a defect of syncline; the drives stop by lost heartbeat")]
struct CyclePanic;

impl Run<'_> {
    /// Hands over what the person wants, and tells them what came of the program. Nothing here
    /// waits for anything.
    fn attend(
        &self,
        link: &mut Link,
        person: &mut Person,
        bar: &ProgressBar,
        planning: &mut Planning,
    ) -> Result<(), Box<dyn Error>> {
        if person.interrupted.swap(false, Ordering::Relaxed) {
            link.order(Order::Interrupt);
        }
        while let Some(order) = person.order() {
            link.order(order);
        }
        if let Some(lines) = &person.lines {
            match lines.try_recv() {
                Ok(()) => {
                    link.order(Order::GoOn);
                    person.lines = None;
                }
                Err(channel::TryRecvError::Disconnected) => {
                    bar.suspend(|| {
                        eprintln!("standard input is closed, nobody can go on: stopping");
                    });
                    link.order(Order::Interrupt);
                    person.lines = None;
                }
                Err(channel::TryRecvError::Empty) => {}
            }
        }
        while let Some(error) = planning.error() {
            bar.suspend(|| report(&error));
        }
        Ok(planning.check()?)
    }

    /// Takes what the cycle tells, for a while; false if there may be more of it.
    fn follow(
        &self,
        link: &mut Link,
        person: &mut Person,
        bar: &ProgressBar,
        recorder: &mut Recorder,
        moves: &mut Moves,
        planning: &Planning,
    ) -> Result<bool, Box<dyn Error>> {
        let until = Instant::now() + POLL;
        while Instant::now() < until {
            let Some(news) = link.news() else {
                return Ok(true);
            };
            match news {
                News::Event(event) => self.tell(&event, bar, person),
                News::BusFailed(error) => bar.suspend(|| eprintln!("{error}")),
                News::Ready(start) => planning.begin(start),
                News::ReplanRequest(request) => planning.replan(request),
                News::Row(row) => {
                    recorder.record(&row, moves)?;
                    while let Some((line, output)) = recorder.output() {
                        bar.suspend(|| eprintln!("line {line}: {output}"));
                    }
                    bar.set_position(recorder.passed() as u64);
                    bar.set_message(self.message(&row, recorder.line(), person));
                }
            }
        }
        Ok(false)
    }

    /// What the machine does, beside the bar.
    fn message(&self, row: &Row<COORDINATES>, line: u32, person: &Person) -> String {
        let overridden = person.overridden();
        if row.plan.off_path || person.rests {
            let axes = self.machine.axes.iter().map(|axis| axis.letter);
            let at = axes.map(|axis| {
                let unit = if axis.is_linear() { "" } else { "°" };
                format!("{axis}{:.3}{unit} ", row.plan.position[axis.index()])
            });
            let at: String = at.collect();
            let step = JOG_STEPS[person.jog_step];
            return format!("line {line}, {at}by {step} mm{overridden}");
        }
        let (speed, turns) = counted_speed(&row.plan.velocity);
        let unit = if turns { "°" } else { "mm" };
        format!("line {line}, {:.0} {unit}/min{overridden}", speed * 60.0)
    }

    fn tell(&self, event: &Event, bar: &ProgressBar, person: &mut Person) {
        if (self.args.verbose || !event.is_routine())
            && let Some(text) = event.describe(&**self.layout)
        {
            bar.suspend(|| eprintln!("{text}"));
        }
        person.rests = event.rests().unwrap_or(person.rests);
        if let Event::Paused { .. } = event {
            bar.suspend(|| eprintln!("press Enter to go on"));
            if person.keys.is_none() {
                person.lines = Some(read_lines());
            }
        }
    }

    fn progress_bar(&self) -> ProgressBar {
        let Extent { length, turned, .. } = self.extent;
        let bar = ProgressBar::new((length + turned) as u64);
        let style = ProgressStyle::with_template(if turned == 0.0 {
            "{wide_bar} {pos}/{len} mm, {msg}"
        } else {
            "{wide_bar} {pos}/{len} mm and °, {msg}"
        });
        bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
    }

    fn conclude(
        self,
        recorder: Recorder,
        controller: &Controller<COORDINATES>,
        measured: &Measured,
        lockstep: bool,
    ) -> Result<Exit, Box<dyn Error>> {
        let frames = lockstep.then(|| self.frames.result());
        let (summary, mut rows) = recorder.finish(self.machine, self.layout, controller, frames)?;
        if let Some(report) = &mut rows {
            report.distributions = measured.distributions().to_vec();
        }
        let mode = if lockstep {
            "run in real time on simulated drives"
        } else {
            "run in real time"
        };
        let text = self.text(&summary, measured);
        (self.results).write(&summary, rows, &self.args.program, mode.to_owned())?;
        self.claims.tell(&text);
        drop(self.listeners);
        self.frames.finish_log()?;
        Ok(match controller.end() {
            Some(End::Finished) => Exit::Finished,
            Some(End::Interrupted) => Exit::Interrupted,
            Some(End::Fault(_)) | None => Exit::Stopped,
        })
    }

    /// What is told at the end.
    fn text(&self, summary: &Summary, measured: &Measured) -> String {
        let mut text = summary.to_string();
        let mut line = |what: &str, told: &dyn Display| {
            text += &format!("{what:<19}{told}\n");
        };
        let late = format!(
            "{} wake-ups later than {:.3} ms{}",
            measured.late,
            late_after(self.machine.cycle).as_secs_f64() * 1e3,
            causes(measured)
        );
        line("late cycles", &late);
        line("worst wake-up", &measured.worst);
        if measured.lost > 0 {
            line("lost", &format!("{} rows or messages", measured.lost));
        }
        for distribution in measured.distributions() {
            text += &(distribution.line(measured.start) + "\n");
        }
        text
    }
}

/// What made wake-ups late, as often as it did.
fn causes(measured: &Measured) -> String {
    let stages = Stage::ALL.into_iter().zip(measured.late_by);
    let causes = stages.filter(|(_, count)| *count > 0);
    let told: Vec<_> = causes
        .map(|(stage, count)| match stage {
            Stage::WakeUp => format!("{count} by the kernel"),
            stage => format!("{count} by {} before", stage.name()),
        })
        .collect();
    if told.is_empty() {
        String::new()
    } else {
        format!(": {}", told.join(", "))
    }
}

/// Says when a line of standard input has come; disconnected at its end.
fn read_lines() -> Receiver<()> {
    let (sender, receiver) = channel::bounded(1);
    std::thread::spawn(move || {
        let mut line = String::new();
        if std::io::stdin()
            .read_line(&mut line)
            .is_ok_and(|bytes| bytes > 0)
        {
            // Nobody listening any more is fine.
            let _ = sender.send(());
        }
    });
    receiver
}
