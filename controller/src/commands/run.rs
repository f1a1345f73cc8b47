//! `syncline run`: a program on a machine, in real time.

use super::command_log::{CommandFile, CommandLog};
use super::keys::{self, Keys};
use super::log_files::LogFiles;
use super::output::{Claims, Output, Results, Target};
use super::ports::PortChoice;
use super::progress::{Console, Messages, Scale, Screen};
use super::real_time::{Buses, RealTimeArgs, Written, attend, lockstep, record_faults};
use super::state_keeper::StateKeeper;
use super::switches::Switches;
use super::user_codes::UserCodes;
use super::{Exit, bad_input, report, told};
use crate::control::{End, Event as MachineEvent, Layout};
use crate::machine::{Machine, MachineState};
use crate::observe::Observers;
use crate::observe::summary::Summary;
use crate::observe::timing::Stage;
use crate::program::{Beginning, Extent, Program, Programs};
use crate::run::real_time::{Ended, Measured, RealTime, late_after};
use crate::session::{Command, Event, Operator, Session, Subscription};
use rustix::termios::{QueueSelector, tcflush};
use std::error::Error;
use std::fmt::Display;
use std::io::{self, BufRead};
use std::path::PathBuf;
use std::sync::Arc;
use std::thread;
use std::time::Duration;
use syncline_gcode::Tables;

/// Run a program on a machine, in real time.
///
/// Brings up the drives, runs the program and shuts down in an orderly way, whatever happens:
/// a fault or Ctrl-C leads to a stop on the path, then the drives are disabled. At a program stop
/// (M0, M6, M1 while the optional stop is on) the machine rests with its drives enabled until Enter.
///
/// On a terminal, space is feed hold and resume, + and - change the feed override by 10 %, the keys >
/// and < the rapid override, s switches single block on and off and o the optional stop, b retraces to
/// the beginning of the block, q stops as Ctrl-C does. While it is held or at a program stop, the arrows and page keys jog X, Y and Z, by
/// steps that [ and ] choose; what goes on goes back first. No file or terminal that takes nothing
/// is in the way of a key, of Ctrl-C or of the motion: what could not be written is told in the end.
///
/// A bus whose port is `sim` is simulated here, with a simulated drive for each of its nodes. If
/// all are, their time goes with the cycle: a late wake-up delays both and is counted.
///
/// This is no safety device: the emergency stop belongs in hardware.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Machine file (TOML).
    machine: PathBuf,
    /// Part program (RS-274/NGC); `-` is standard input, which then answers nothing
    program: PathBuf,
    #[command(flatten)]
    ports: PortChoice,
    #[command(flatten)]
    output: Output,
    #[command(flatten)]
    log: LogFiles,
    #[command(flatten)]
    switches: Switches,
    #[command(flatten)]
    real_time: RealTimeArgs,
    #[command(flatten)]
    commands: CommandFile,
    /// Tell what the controller does.
    #[arg(short, long)]
    verbose: bool,
}

impl Args {
    pub(super) fn execute(self) -> Exit {
        let prepared = self.prepare();
        let Prepared {
            machine,
            state,
            layout,
            program,
            extent,
            buses,
            commands,
            claims,
            results,
        } = match prepared {
            Ok(prepared) => prepared,
            Err(error) => return bad_input(&*error),
        };
        let run = Run {
            args: &self,
            machine,
            state,
            layout,
            extent,
            claims,
            results,
        };
        run.execute(buses, program, commands)
            .unwrap_or_else(|error| {
                report(&*error);
                Exit::Stopped
            })
    }
}

/// All that a run needs.
struct Prepared {
    machine: Machine,
    state: MachineState,
    layout: Arc<Layout>,
    program: Program,
    extent: Extent,
    buses: Buses,
    commands: Option<Target>,
    claims: Claims,
    results: Results,
}

impl Args {
    /// Reads and checks everything, and opens files and buses, before anything moves.
    fn prepare(&self) -> Result<Prepared, Box<dyn Error>> {
        let mut machine = Machine::load(&self.machine)?;
        self.ports.apply(&mut machine)?;
        let state = MachineState::load(&MachineState::beside(&self.machine))?;
        let layout = Arc::new(Layout::new(&machine)?.recalling(&machine, &state));
        let programs = Programs::new(&machine, &self.machine)?;
        let program = self.switches.program(&programs, &self.program)?;
        let extent = program.check(machine.rest())?;
        let mut claims = Claims::of_run(&self.machine, &machine, &self.program);
        let origin = (self.output).origin(&self.machine, &machine, &self.program);
        let results = self.output.open(&mut claims, origin)?;
        let logs = self.log.open(&mut claims)?;
        let commands = self.commands.open(&mut claims)?;
        if extent.sets_tables {
            Tables::probe(&Tables::beside(&self.machine))?;
        }
        if let Some(beginning) = program.beginning(machine.rest())? {
            confirm(&beginning)?;
        }
        let buses = self.real_time.open(&machine, logs)?;
        Ok(Prepared {
            machine,
            state,
            layout,
            program,
            extent,
            buses,
            commands,
            claims,
            results,
        })
    }
}

/// Asks whether the program is to begin in the middle.
fn confirm(beginning: &Beginning) -> Result<(), NotConfirmed> {
    // What was typed ahead answers no question. Where input is no terminal nobody typed it.
    let _ = tcflush(std::io::stdin(), QueueSelector::IFlush);
    let line = beginning.line();
    eprintln!("line {line}: {beginning}\npress Enter to begin there, Ctrl-C to give up");
    match io::stdin().lock().skip_until(b'\n') {
        Ok(bytes) if bytes > 0 => Ok(()),
        _ => Err(NotConfirmed),
    }
}

#[derive(Debug, thiserror::Error)]
#[error("--from-line: standard input is closed, nobody can confirm: press Enter there")]
struct NotConfirmed;

/// A run that is ready to begin.
struct Run<'a> {
    args: &'a Args,
    machine: Machine,
    state: MachineState,
    layout: Arc<Layout>,
    extent: Extent,
    claims: Claims,
    results: Results,
}

impl Run<'_> {
    fn execute(
        mut self,
        buses: Buses,
        program: Program,
        commands: Option<Target>,
    ) -> Result<Exit, Box<dyn Error>> {
        let Buses {
            timing,
            world,
            ports,
            mut written,
        } = buses;
        let lockstep = lockstep(&self.machine);
        let trace = self.results.trace_by(&mut written.writers)?;
        let sent = lockstep.then(|| written.frames.listen(&self.machine));
        let extent = (!program.streams()).then_some(self.extent);
        let scale = Scale::of(&program, self.extent);
        let observers = Observers::new(&self.machine, sent, trace, self.results.wants_report())
            .of_program(extent);
        let (messages, waiting) = Console::messages();
        let tell = messages.clone();
        let (timeline, moves) = RealTime::start(
            &self.machine,
            &self.layout,
            world,
            ports,
            timing,
            program,
            move |granted| {
                tell.tell(granted.to_string());
            },
        )?;
        let mut session = Session::new(&self.layout, timeline, moves, observers);
        record_faults(
            &mut session,
            &self.args.machine,
            &self.machine,
            &self.layout,
        );
        let commands = commands.map(|file| {
            let file = Box::new(written.writers.begin(file)?);
            let tables = Tables::beside(&self.args.machine);
            CommandLog::begin(&mut session, file, &tables, &self.state)
        });
        let commands = commands.transpose()?;
        let file = MachineState::beside(&self.args.machine);
        let state = std::mem::take(&mut self.state);
        let keeper = StateKeeper::start(&mut session, &self.machine, state, file)?;
        let user_codes = UserCodes::start(&mut session, &self.machine)?;
        (self.args.switches).set(&session.operator("command line"))?;
        let screen = Screen {
            events: session.subscribe(),
            view: session.view(),
            layout: Arc::clone(&self.layout),
            machine: self.machine.clone(),
            scale,
            verbose: self.args.verbose,
        };
        let console = Console::start(screen, messages.clone(), waiting)?;
        for device in 0..self.layout.devices.len() {
            messages.tell(self.layout.supervision(device));
        }
        let keys = listen(&mut session, &messages)?;
        attend(&mut session, commands)?;
        let concluded = self.conclude(session, (written, keeper), &messages, lockstep);
        user_codes.finish();
        let exit = concluded.unwrap_or_else(|error| {
            messages.tell(told(&*error));
            Exit::Stopped
        });
        console.finish();
        drop(keys);
        Ok(exit)
    }

    /// Writes what is left to write, and tells the result.
    fn conclude(
        self,
        session: Session<RealTime>,
        (mut written, keeper): (Written, StateKeeper),
        messages: &Messages,
        lockstep: bool,
    ) -> Result<Exit, Box<dyn Error>> {
        let (timeline, observers) = session.end();
        let Ended {
            controller,
            measured,
            feeder,
        } = timeline.end()?;
        let mut problems: Vec<Box<dyn Error>> = Vec::new();
        if controller.end() == Some(End::Finished)
            && let Some(feeder) = feeder
            && let Err(error) = feeder.save_tables(&Tables::beside(&self.args.machine))
        {
            problems.push(error.into());
        }
        let carried = lockstep.then(|| written.frames.result());
        let (mut summary, mut rows) =
            observers.finish(&self.machine, &self.layout, &controller, carried)?;
        if let Some(report) = &mut rows {
            report.distributions = measured.distributions().to_vec();
        }
        let text = self.text(&summary, &measured);
        let mode = if lockstep {
            "run in real time on simulated drives"
        } else {
            "run in real time"
        };
        let (program, mode) = (&self.args.program, mode.to_owned());
        let begin = |target| written.writers.begin(target);
        let put = (self.results).write(&mut summary, rows, program, mode, begin);
        problems.extend(put.err());
        if let Some(stream) = self.claims.stream() {
            messages.conclude(stream, text);
        }
        problems.extend(written.finish());
        problems.extend(keeper.finish().err().map(Into::into));
        for problem in &problems {
            messages.tell(told(&**problem));
        }
        Ok(match controller.end() {
            Some(End::Finished) if problems.is_empty() => Exit::Finished,
            Some(End::Interrupted) => Exit::Interrupted,
            _ => Exit::Stopped,
        })
    }

    /// What is told in the end.
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

/// Has the operators heard who belong to this process: signals, and the terminal's keys or, where
/// standard input is no terminal, its lines.
fn listen(
    session: &mut Session<RealTime>,
    messages: &Messages,
) -> Result<Option<Keys>, Box<dyn Error>> {
    let signals = session.operator("signal");
    ctrlc::set_handler(move || {
        // Where the session is over there is nothing to stop.
        let _ = signals.command(Command::Stop);
    })?;
    let keys = Keys::listen(session.operator("keys"), session.view())?;
    if keys.is_some() {
        messages.tell(keys::HELP.to_owned());
    } else {
        let (operator, events) = (session.operator("standard input"), session.subscribe());
        let messages = messages.clone();
        let thread = thread::Builder::new().name("lines".into());
        thread.spawn(move || obey_lines(&operator, &events, &messages))?;
    }
    Ok(keys)
}

/// At a program stop a line of standard input is cycle start, and its end stops the job.
fn obey_lines(operator: &Operator, events: &Subscription, messages: &Messages) {
    while let Ok(event) = events.wait(Duration::MAX) {
        let Some(Event::Machine(MachineEvent::Paused { .. })) = event else {
            continue;
        };
        let line = io::stdin().lock().skip_until(b'\n');
        // Nobody listening any more is fine.
        let _ = if line.is_ok_and(|bytes| bytes > 0) {
            operator.command(Command::CycleStart)
        } else {
            messages.tell("standard input is closed, nobody can go on: stopping".to_owned());
            operator.command(Command::Stop)
        };
    }
}
