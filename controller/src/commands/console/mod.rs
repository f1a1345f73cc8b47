//! `syncline console`: a machine that stays on, for an operator at a terminal or for lines of text.

mod lines;
mod model;
mod screen;
mod view;

use super::ports::PortChoice;
use super::run::lockstep;
use super::{Exit, bad_input, core, duration, report, told};
use crate::control::{End, Layout, State};
use crate::machine::Machine;
use crate::observe::Observers;
use crate::observe::frames::SharedFrames;
use crate::port;
use crate::program::Programs;
use crate::realtime;
use crate::run::Progress;
use crate::run::real_time::{RealTime, Timing};
use crate::session::{Command, Session};
use std::error::Error;
use std::io::{self, IsTerminal};
use std::path::PathBuf;
use std::sync::Arc;
use std::thread;
use std::time::Duration;
use syncline_drives::world::Observer;
use syncline_gcode::Tables;

/// How often it is looked after the session.
const POLL: Duration = Duration::from_millis(1);

/// Stay at a machine for a working day: jog, touch off, type lines, run programs, one after the other.
///
/// Brings up the drives to *ready* and stays there. On a terminal the screen shows positions, speeds, the
/// program and messages; `?` shows every key, and `:` begins a command. Otherwise, and with --lines,
/// lines of standard input are commands, as in files of events: `jog X+10`, `set_offset X0 Y0`, `mdi G0 Z5`, `load part.ngc`, `run`; `?` lists
/// them. A line that begins something waits until what is under way is over, and behind `wait` every
/// line does, but for `stop` and `feed_hold`. All others, as `feed_override 80`, act at once. After
/// the last line the machine is switched off as soon as it rests. Ctrl-C stops what moves; where nothing
/// moves it switches off.
///
/// Offsets and tools that are set are written to the tables beside the machine file.
///
/// This is no safety device: the emergency stop belongs in hardware.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Machine file (TOML).
    machine: PathBuf,
    #[command(flatten)]
    ports: PortChoice,
    /// Varies encoder noise, response delays and oscillator errors of simulated drives.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Make a late wake-up a fault on simulated buses too.
    #[arg(long)]
    strict: bool,
    /// Real-time priority of the cycle, 1…99.
    #[arg(long, default_value_t = 80, value_parser = clap::value_parser!(u8).range(1..=99))]
    priority: u8,
    /// Processor core of the cycle; an isolated one is best. Without it, the last one that this
    /// process may use.
    #[arg(long, value_parser = core)]
    core: Option<usize>,
    /// Stay awake that long before each wake-up, for a core of its own: 50us.
    #[arg(long, default_value = "0us", value_parser = duration)]
    spin: Duration,
    /// Lines of text on a terminal, too.
    #[arg(long)]
    lines: bool,
    /// Tell what the controller does.
    #[arg(short, long)]
    verbose: bool,
}

impl Args {
    pub(super) fn execute(self) -> Exit {
        let session = match self.switch_on() {
            Ok(session) => session,
            Err(error) => return bad_input(&*error),
        };
        self.attend(session).unwrap_or_else(|error| {
            report(&*error);
            Exit::Stopped
        })
    }

    /// Reads and checks everything, opens the buses and starts the machine.
    fn switch_on(&self) -> Result<Attended, Box<dyn Error>> {
        let mut machine = Machine::load(&self.machine)?;
        self.ports.apply(&mut machine)?;
        let layout = Arc::new(Layout::new(&machine)?);
        let tables = Tables::beside(&self.machine);
        Tables::probe(&tables)?;
        let programs = Programs::new(&machine, &self.machine)?.keep_tables(tables);
        let frames = SharedFrames::new(&machine);
        let buses = 0..machine.buses.len();
        let observers = buses.map(|bus| Box::new(frames.observer(bus)) as Observer);
        let (world, ports) = port::open(&machine, self.seed, observers.collect())?;
        for port in &ports {
            port.notes().iter().for_each(|note| eprintln!("{note}"));
        }
        let timing = Timing {
            settings: realtime::Settings {
                priority: self.priority,
                core: self.core.or_else(realtime::last_core),
            },
            spin: self.spin,
            lockstep: lockstep(&machine),
            strict: self.strict,
        };
        let timeline = RealTime::stay_on(&layout, world, ports, timing, |granted| {
            eprintln!("{granted}");
        })?;
        let observers = Observers::new(&machine, None, None, false);
        Ok(Attended {
            session: Session::staying_on(&layout, timeline, programs, observers),
            machine,
            layout,
        })
    }

    /// Has the operators heard until the machine is off.
    fn attend(&self, attended: Attended) -> Result<Exit, Box<dyn Error>> {
        let Attended {
            mut session,
            machine,
            layout,
        } = attended;
        let (signals, view) = (session.operator("signal"), session.view());
        ctrlc::set_handler(move || {
            // Where the session is over there is nothing to stop.
            let _ = signals.command(end_of(view.get().state));
        })?;
        let telling = if self.lines || !io::stdin().is_terminal() || !io::stdout().is_terminal() {
            lines::listen(&mut session, machine, layout, self.verbose)?
        } else {
            screen::listen(&mut session, &machine, layout, self.verbose)?
        };
        loop {
            match session.advance() {
                Progress::More => {}
                Progress::Idle => thread::sleep(POLL),
                Progress::Ended => break,
            }
        }
        let (timeline, _) = session.end();
        let ended = timeline.end();
        // Where it panicked, that is written.
        let _ = telling.join();
        Ok(match ended?.controller.end() {
            Some(End::SwitchedOff) => Exit::Finished,
            _ => Exit::Stopped,
        })
    }
}

/// A machine that is switched on.
struct Attended {
    session: Session<RealTime>,
    machine: Machine,
    layout: Arc<Layout>,
}

/// What stops a machine in this state for whoever wants to leave: what moves comes to rest first.
fn end_of(state: State) -> Command {
    match state {
        State::Ready | State::Disabled | State::Faulted | State::Off => Command::SwitchOff,
        _ => Command::Stop,
    }
}
