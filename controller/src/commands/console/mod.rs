//! `syncline console`: a machine that stays on, for an operator at a terminal or for lines of text.

mod lines;
mod model;
mod screen;
mod signals;
mod values;
mod view;

pub(super) use lines::Teller;

use super::command_log::{CommandFile, CommandLog};
use super::log_files::LogFiles;
use super::output::Claims;
use super::ports::PortChoice;
use super::real_time::{self, Buses, RealTimeArgs, Written};
use super::state_keeper::StateKeeper;
use super::user_codes::UserCodes;
use super::{Exit, bad_input, report, told};
use crate::control::{End, Layout, State};
use crate::machine::{Machine, MachineState};
use crate::observe::Observers;
use crate::program::Programs;
use crate::run::real_time::RealTime;
use crate::session::{Command, Session};
use std::error::Error;
use std::io::{self, IsTerminal};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc;
use syncline_gcode::Tables;

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
/// Offsets and tools that are set are written to the tables beside the machine file. With --candump and
/// --commands `replay` goes through the session once more.
///
/// This is no safety device: the emergency stop belongs in hardware.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Machine file (TOML).
    machine: PathBuf,
    #[command(flatten)]
    ports: PortChoice,
    #[command(flatten)]
    real_time: RealTimeArgs,
    #[command(flatten)]
    log: LogFiles,
    #[command(flatten)]
    commands: CommandFile,
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

    /// Reads and checks everything, opens files and buses and starts the machine.
    fn switch_on(&self) -> Result<Attended, Box<dyn Error>> {
        let mut machine = Machine::load(&self.machine)?;
        self.ports.apply(&mut machine)?;
        let state = MachineState::load(&MachineState::beside(&self.machine))?;
        let layout = Arc::new(Layout::new(&machine)?.recalling(&machine, &state));
        let tables = Tables::beside(&self.machine);
        Tables::probe(&tables)?;
        let programs = Programs::new(&machine, &self.machine)?.keep_tables(tables.clone());
        let mut claims = Claims::of_machine(&self.machine, &machine);
        let logs = self.log.open(&mut claims)?;
        let commands = self.commands.open(&mut claims)?;
        let Buses {
            timing,
            world,
            ports,
            mut written,
        } = self.real_time.open(&machine, logs)?;
        let (started, granted) = mpsc::channel();
        let timeline =
            RealTime::stay_on(&machine, &layout, world, ports, timing, move |granted| {
                let _ = started.send(granted.to_string());
            })?;
        // Before a screen is drawn, over which it would be written.
        if let Ok(granted) = granted.recv() {
            eprintln!("{granted}");
        }
        let observers = Observers::new(&machine, None, None, false);
        let mut session = Session::staying_on(&layout, timeline, programs, observers);
        session.tell_remaining();
        real_time::record_faults(&mut session, &self.machine, &machine, &layout);
        let commands = commands.map(|file| {
            let file = Box::new(written.writers.begin(file)?);
            CommandLog::begin(&mut session, file, &tables, &state)
        });
        let commands = commands.transpose()?;
        let file = MachineState::beside(&self.machine);
        let keeper = StateKeeper::start(&mut session, &machine, state, file)?;
        let user_codes = UserCodes::start(&mut session, &machine)?;
        Ok(Attended {
            keeper,
            user_codes,
            commands,
            written,
            session,
            machine,
            layout,
        })
    }

    /// Has the operators heard until the machine is off.
    fn attend(&self, attended: Attended) -> Result<Exit, Box<dyn Error>> {
        let Attended {
            mut session,
            keeper,
            user_codes,
            commands,
            written,
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
        real_time::attend(&mut session, commands)?;
        let (timeline, _) = session.end();
        let ended = timeline.end();
        // Where it panicked, that is written.
        let _ = telling.join();
        user_codes.finish();
        let end = ended?.controller.end();
        let mut problems = written.finish();
        problems.extend(keeper.finish().err().map(Into::into));
        problems.iter().for_each(|problem| report(&**problem));
        Ok(match end {
            Some(End::SwitchedOff) if problems.is_empty() => Exit::Finished,
            _ => Exit::Stopped,
        })
    }
}

/// A machine that is switched on.
struct Attended {
    session: Session<RealTime>,
    keeper: StateKeeper,
    user_codes: UserCodes,
    commands: Option<CommandLog>,
    written: Written,
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
