//! `syncline replay`: a recorded run once more.

use super::command_log;
use super::ports::PortChoice;
use super::switches::Switches;
use super::{Exit, bad_input, report};
use crate::bus_log::candump::Line;
use crate::control::{Layout, Phase};
use crate::counted::counted;
use crate::machine::Machine;
use crate::observe::Observers;
use crate::port::url::BusUrl;
use crate::program::Programs;
use crate::run::Progress;
use crate::run::replay::{Difference, Logged, Operators, Outcome, Replay, ReplayBus};
use crate::session::{Event, NotTaken, Recorded, Refused, Session};
use std::error::Error;
use std::io::BufRead;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;
use syncline_canopen::monitor::Monitor;
use syncline_canopen::{CobId, Frame, Instant};
use syncline_strict_toml::input;

/// Feed a recorded run back through the controller and compare what it sends.
///
/// LOG is a text log of all the machine's buses, as `syncline run --candump`, `syncline record` or
/// `candump -l` write it, from before the run began. Interfaces stand for the buses whose names or
/// ports they are. The machine file and the programs must be those of the run, and so must the tables beside
/// the machine file, unless the log of commands has them.
///
/// With the commands of its operators, as `--commands` of `run`, `validate` and `console` writes them, each
/// is handed in in its cycle. Without them pauses and an interruption are found in the log; what else a person
/// did is not, and setpoints differ from there on. Without PROGRAM the log is of a session of `console`: what
/// it loaded, it loads again.
///
/// Exit codes: 0 if the controller sends the same frames bit for bit, 1 with the first frame that
/// differs, 2 if the log cannot be replayed.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Recorded run (candump's log format).
    log: PathBuf,
    /// Machine file (TOML).
    machine: PathBuf,
    /// Part program (RS-274/NGC) of a run; none for a session of `console`.
    program: Option<PathBuf>,
    /// What operators commanded in the run.
    #[arg(long, value_name = "FILE", required_unless_present = "program")]
    commands: Option<PathBuf>,
    #[command(flatten)]
    ports: PortChoice,
    #[command(flatten)]
    switches: Switches,
}

/// A log that cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct BadLog(String);

impl Args {
    pub(super) fn execute(self) -> Exit {
        match self.replay() {
            Ok(exit) => exit,
            Err(error) => bad_input(&*error),
        }
    }

    fn replay(&self) -> Result<Exit, Box<dyn Error>> {
        let mut machine = Machine::load(&self.machine)?;
        self.ports.apply(&mut machine)?;
        let recorded = self.commands.as_deref().map(command_log::read);
        let recorded = recorded.transpose()?;
        let operators = recorded
            .as_ref()
            .map_or(Operators::Unknown, |_| Operators::Recorded);
        let command_log::Logged {
            commands,
            tables,
            state,
        } = recorded.unwrap_or_default();
        let layout = Arc::new(Layout::new(&machine)?.recalling(&machine, &state));
        let programs = match tables {
            Some(tables) => Programs::with_tables(&machine, tables),
            None => Programs::new(&machine, &self.machine)?,
        };
        let log = self.read(&machine)?;
        let buses = machine.buses.iter().map(|bus| {
            let url = bus.port.parse::<BusUrl>();
            ReplayBus {
                bitrate: bus.bitrate,
                echoes: matches!(url, Ok(BusUrl::Sim | BusUrl::SocketCan(_))),
                simulated: matches!(url, Ok(BusUrl::Sim)),
            }
        });
        let buses = buses.collect();
        let observers = Observers::new(&machine, None, None, false);
        let bad_log = |error| BadLog(format!("{}: {error}", self.log.display()));
        let session = match &self.program {
            Some(file) => {
                let program = self.switches.program(&programs, file)?;
                let replay =
                    Replay::new(Arc::clone(&layout), buses, operators, program, log.clone());
                let (replay, moves) = replay.map_err(bad_log)?;
                Session::new(&layout, replay, moves, observers)
            }
            None => {
                let replay = Replay::staying_on(Arc::clone(&layout), buses, log.clone());
                Session::staying_on(&layout, replay.map_err(bad_log)?, programs, observers)
            }
        };
        let (outcome, commands) = self.again(session, commands)?;
        let began = log.first().map_or(Instant::ZERO, |first| first.at);
        print(&outcome, &layout);
        // By its first frame a run is found, which is the same whatever comes.
        if outcome.difference.is_none() && outcome.same <= 1 {
            return Err(BadLog(format!(
                "{}: it ends with the controller's first frame: nothing is compared",
                self.log.display()
            ))
            .into());
        }
        if outcome.difference.is_none() && is_longer(&log, &outcome, &layout) {
            return Err(BadLog(format!(
                "{}: what comes behind the run's end is not compared: give each run a log of its own",
                self.log.display()
            ))
            .into());
        }
        // A log that was cut off may end before the last of them.
        let left = commands.left().filter(|_| outcome.end.is_some());
        Ok(match (&outcome.difference, left) {
            (None, None) => Exit::Finished,
            (None, Some((cycle, count))) => {
                let what = "NOT HANDED IN";
                println!(
                    "{what:<18} {count} commands from cycle {cycle} on: the run is over before"
                );
                Exit::Stopped
            }
            (Some(difference), _) => {
                print_difference(difference, &machine, &log, began);
                Exit::Stopped
            }
        })
    }

    /// Goes through the session once more; what was found, and what of the commands is left.
    fn again(
        &self,
        mut session: Session<Replay>,
        mut commands: Recorded,
    ) -> Result<(Outcome, Recorded), NotTaken> {
        let told = session.subscribe();
        if self.commands.is_none() {
            self.switches.set(&session.operator("command line"))?;
        } else {
            // How those ended is among the commands.
            session.await_user_codes();
        }
        let mut progress = Progress::More;
        while progress != Progress::Ended {
            if let Some(cycle) = session.timeline().setpoints_of() {
                commands.hand_in(&mut session, cycle);
            }
            progress = session.advance();
            for event in told.events() {
                match event {
                    Event::Problem(error) => report(&*error),
                    Event::Refused(Refused {
                        source,
                        command,
                        reason,
                    }) => eprintln!("now refused: {source}: {command:?}: {reason}"),
                    _ => {}
                }
            }
        }
        Ok((session.timeline().outcome(), commands))
    }

    /// The frames of the machine's buses.
    fn read(&self, machine: &Machine) -> Result<Vec<Logged>, BadLog> {
        let cannot_read = |error| BadLog(format!("cannot read {}: {error}", self.log.display()));
        let mut file = input::lines(&self.log).map_err(cannot_read)?;
        let mut log = Vec::new();
        let mut line = String::new();
        for number in 1.. {
            line.clear();
            if file.read_line(&mut line).map_err(cannot_read)? == 0 {
                break;
            }
            if !line.ends_with('\n') {
                let log = self.log.display();
                eprintln!("{log}:{number}: the last line is cut off: left out");
                break;
            }
            if !line.starts_with('(') {
                continue;
            }
            let Line { at, bus, frame } = Line::parse(&line)
                .map_err(|error| BadLog(format!("{}:{number}: {error}", self.log.display())))?;
            let is = |it: &crate::machine::Bus| it.name == bus || it.port == bus;
            if let Some(bus) = machine.buses.iter().position(is) {
                let at = Instant::from_nanos(at.as_nanos() as u64);
                log.push(Logged { at, bus, frame });
            }
        }
        if log.is_empty() {
            let names: Vec<&str> = machine.buses.iter().map(|bus| &*bus.name).collect();
            return Err(BadLog(format!(
                "{}: no frame of the machine's buses ({}): name the log's interfaces with --bus BUS=INTERFACE",
                self.log.display(),
                names.join(", ")
            )));
        }
        log.sort_by_key(|logged| logged.at);
        Ok(log)
    }
}

/// Whether SYNC goes on in the log for longer than the run that was replayed lasted.
fn is_longer(log: &[Logged], outcome: &Outcome, layout: &Layout) -> bool {
    let is_sync = |logged: &&Logged| logged.frame.id() == CobId::SYNC.into();
    let first = log.iter().find(is_sync);
    let last = log.iter().rev().find(is_sync);
    let Some((first, last)) = first.zip(last) else {
        return false;
    };
    // Clocks differ, and cycles may have been left out.
    let most = layout.cycle.mul_f64(10.0 + 1.02 * outcome.cycles as f64);
    last.at.saturating_since(first.at) > most
}

fn print(outcome: &Outcome, layout: &Layout) {
    let Outcome {
        same,
        cycles,
        dropped,
        interrupted,
        ..
    } = outcome;
    let seconds = (layout.cycle * *cycles as u32).as_secs_f64();
    println!(
        "replayed           {}, {seconds:.3} s",
        counted(*cycles, "cycle", "cycles")
    );
    println!("the same           {same} frames of the controller");
    if *dropped > 0 {
        println!("dropped            {dropped} bursts that never came to the bus");
    }
    if let Some(cycle) = interrupted {
        // A feed hold begins as an interruption does, and then goes on.
        let what = outcome
            .difference
            .map_or("interrupted", |_| "held, or broken off");
        println!("{what:<18} in cycle {cycle}");
    }
    match &outcome.end {
        Some(end) => println!("the run's end      {}", end.describe(layout)),
        None if outcome.difference.is_none() => println!("the log ends before the run does"),
        None => {}
    }
}

fn print_difference(difference: &Difference, machine: &Machine, log: &[Logged], began: Instant) {
    let Difference {
        at,
        bus,
        cycle,
        phase,
        logged,
        sent,
    } = difference;
    let mut monitor = Monitor::new();
    for node in machine.nodes().filter(|node| node.bus == *bus) {
        monitor.add(node.id, node.model.dictionary);
    }
    for before in log.iter().filter(|it| it.bus == *bus && it.at < *at) {
        monitor.decode(&before.frame);
    }
    println!(
        "FIRST DIFFERENCE   {:.6} s into the log, at {:.6}, bus {}, cycle {cycle}, {phase}",
        at.saturating_since(began).as_secs_f64(),
        Duration::from_nanos(at.as_nanos()).as_secs_f64(),
        machine.buses[*bus].name,
    );
    for (who, frame) in [("the log has", logged), ("syncline sends", sent)] {
        match frame {
            Some(frame) => println!("  {who:<16} {}", told(frame, &mut monitor)),
            None => println!("  {who:<16} nothing"),
        }
    }
    if *phase >= Phase::Program {
        println!(
            "  Frames do not tell of a feed hold, an override, a jog or a retrace, which --commands has, nor of \
             a plan that came late,\n  which the run told: with one of them setpoints differ from there on."
        );
    }
}

fn told(frame: &Frame, monitor: &mut Monitor) -> String {
    let raw = format!("{frame:?}");
    format!("{raw:<21}  {}", monitor.decode(frame))
}
