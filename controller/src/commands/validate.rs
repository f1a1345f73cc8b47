//! `syncline validate`: proof before metal moves.

use super::command_log::{CommandFile, CommandLog};
use super::events::{Events, Plays, When};
use super::log_files::{LogFiles, Logs};
use super::output::{Claims, Output, Results, Target};
use super::progress::Scale;
use super::repeats::{self, Repeats};
use super::scripted::Scripted;
use super::switches::Switches;
use super::trajectory::Trajectory;
use super::unmet::{SOURCE, Unmet};
use super::{Exit, report};
use crate::control::fault::Names;
use crate::control::{Event as MachineEvent, Layout};
use crate::machine::{Machine, MachineState};
use crate::observe::Observers;
use crate::observe::record::Place;
use crate::observe::summary::Summary;
use crate::program::bounds::TimeBounds;
use crate::program::{Extent, Program};
use crate::run::virtual_time::VirtualMachine;
use crate::session::{Command, Event, NotTaken, Operator, Session, Status};
use crate::validate::cause::Again;
use crate::validate::{Inputs, attend, judged};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;
use syncline_gcode::Tables;

/// A program that is held when the last event is past, and that rests so long, s, is stopped:
/// nobody is there to go on.
const PATIENCE: f64 = 1.0;

/// Run a program on simulated drives in virtual time and judge it.
///
/// The same controller that runs the machine brings up simulated drives over a simulated CAN bus
/// and runs the program, as fast as the CPU allows. The same machine, program and seed give the
/// same frames, byte for byte. Program stops (M0, M1, M6) go on at once.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Machine file (TOML).
    machine: PathBuf,
    /// Part program (RS-274/NGC).
    #[arg(required_unless_present_any = ["trajectory", "events"])]
    program: Option<PathBuf>,
    #[command(flatten)]
    trajectory: Trajectory,
    #[command(flatten)]
    output: Output,
    #[command(flatten)]
    commands: CommandFile,
    #[command(flatten)]
    log: LogFiles,
    /// Varies encoder noise, response delays and oscillator errors of the simulated drives.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    switches: Switches,
    /// Validate with another value of a key of the machine file, as TOML has it:
    /// `axis.X.max_jerk=40000`, `path.mode="G64"`. Of axes, drives, buses, inputs and outputs the name says
    /// which. May be given again.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    settings: Vec<String>,
    /// Take work offsets and tools from FILE, not from the tables beside the machine file.
    #[arg(long, value_name = "FILE")]
    tables: Option<PathBuf>,
    /// What an operator does, as CSV with the columns `t_s,event,value`: feed_override and
    /// rapid_override (%), feed_hold, resume, single_block and optional_stop (on, off), retrace,
    /// jog (X+1.5 or X-), jog_to, move_to (X10 Y20), stop, at times of the trace. Without PROGRAM the
    /// machine stays on as at a console, for home, mdi, load, run and all that `?` lists there; an
    /// event without a time comes once the machine rests, and behind the last one it is switched
    /// off. Then nothing goes on by itself, and nothing is kept for the next day.
    #[arg(long, value_name = "FILE")]
    events: Option<PathBuf>,
    /// Say what bounds the time of motion: the program is planned once more with each bound raised.
    #[arg(long, conflicts_with = "stream", requires = "program")]
    time_bounds: bool,
    /// Tell what the controller does.
    #[arg(short, long)]
    verbose: bool,
}

/// All that a validation needs.
struct Prepared {
    machine: Machine,
    layout: Arc<Layout>,
    program: Program,
    /// Unless it is read as it runs.
    extent: Option<Extent>,
    scale: Scale,
    time_bounds: Option<TimeBounds>,
    events: Events,
    claims: Claims,
    results: Results,
    commands: Option<Target>,
    logs: Logs,
}

impl Args {
    pub(super) fn execute(self) -> Exit {
        if self.trajectory.is_given() {
            let judged = (self.trajectory).judge(
                &self.machine,
                &self.settings,
                self.seed,
                self.output.json(),
            );
            return judged.unwrap_or_else(|error| super::bad_input(&*error));
        }
        let validated = match (&self.program, &self.events) {
            (None, Some(events)) => self.play(events),
            _ => self.prepare().map(|prepared| self.validate(prepared)),
        };
        let result = match validated {
            Ok(result) => result,
            Err(error) => return super::bad_input(&*error),
        };
        match result {
            Ok(summary) if summary.verdict == "pass" => Exit::Finished,
            Ok(_) => Exit::Stopped,
            Err(error) => {
                report(&*error);
                Exit::Stopped
            }
        }
    }

    /// The session of a file of events.
    fn play(&self, events: &Path) -> Result<Result<Summary, Box<dyn Error>>, Box<dyn Error>> {
        let scripted = Scripted {
            machine: &self.machine,
            settings: &self.settings,
            tables: self.tables.as_deref(),
            events,
            seed: self.seed,
            verbose: self.verbose,
            output: &self.output,
            commands: &self.commands,
            log: &self.log,
        };
        scripted.play()
    }

    /// The program, which is there unless a trajectory is.
    fn program(&self) -> &Path {
        self.program.as_deref().unwrap_or(Path::new(""))
    }

    /// Reads and checks everything, and opens the files, before anything else.
    fn prepare(&self) -> Result<Prepared, Box<dyn Error>> {
        let tables = self.tables.as_deref();
        let inputs = Inputs::read(&self.machine, &self.settings, tables)?;
        let layout = inputs.layout(self.seed)?;
        let Inputs { machine, programs } = inputs;
        let program = self.switches.program(&programs, self.program())?;
        let extent = program.check(machine.rest())?;
        let mut claims = Claims::of_run(&self.machine, &machine, self.program());
        if let Some(file) = &self.tables {
            claims = claims.reads("--tables", file);
        }
        let events = match &self.events {
            Some(file) => {
                claims = claims.reads("--events", file);
                Events::load(file, Plays::Program)?
            }
            None => Events::default(),
        };
        let origin = (self.output).origin(&self.machine, &machine, self.program());
        let results = self.output.open(&mut claims, origin)?;
        let commands = self.commands.open(&mut claims)?;
        let logs = self.log.open(&mut claims)?;
        if let Some(beginning) = program.beginning(machine.rest())? {
            eprintln!("line {}: {beginning}", beginning.line());
        }
        let time_bounds = self.time_bounds.then(|| program.time_bounds(&machine));
        Ok(Prepared {
            time_bounds: time_bounds.transpose()?,
            machine,
            layout,
            extent: (!program.streams()).then_some(extent),
            scale: Scale::of(&program, extent),
            program,
            events,
            claims,
            results,
            commands,
            logs,
        })
    }

    fn validate(&self, prepared: Prepared) -> Result<Summary, Box<dyn Error>> {
        let Prepared {
            machine,
            layout,
            program,
            extent,
            scale,
            time_bounds,
            events,
            claims,
            mut results,
            commands,
            logs,
        } = prepared;
        // Events and what is read once cannot be had again.
        let again = (self.events.is_none() && !program.streams()).then(|| program.clone());
        let (timeline, moves) =
            VirtualMachine::new(&machine, Arc::clone(&layout), program, self.seed)?;
        logs.record_virtual(&machine, timeline.frames())?;
        let sent = Some(timeline.frames().listen(&machine));
        let observers = Observers::new(&machine, sent, results.trace()?, results.wants_report())
            .seeing_drives(&machine)
            .of_program(extent)
            .bounded_by(time_bounds);
        let mut session = Session::new(&layout, timeline, moves, observers);
        let commands = commands.map(|file| {
            let beside = Tables::beside(&self.machine);
            let tables = self.tables.as_ref().unwrap_or(&beside);
            let state = MachineState::simulated(&machine, self.seed);
            CommandLog::begin(&mut session, Box::new(file.begin()?), tables, &state)
        });
        let mut commands = commands.transpose()?;
        self.switches.set(&session.operator("command line"))?;
        let mut script = Script {
            operator: session.operator(SOURCE),
            events,
            last_moved: 0.0,
        };
        let mut unmet = Unmet::default();
        let (bar, mut shown) = (scale.bar(), 0);
        let mut repeats = Repeats::default();
        let tell_counted = |counted: Vec<(MachineEvent, u64)>| {
            for (event, more) in counted {
                if let Some(text) = self.text(&event, &*layout) {
                    bar.suspend(|| eprintln!("{}", repeats::told(&text, more)));
                }
            }
        };
        let failure = attend(&mut session, |session, events| {
            let now = Duration::from_nanos(session.timeline().now().as_nanos());
            let status = session.status();
            bar.set_position(scale.position(status));
            if shown != status.line {
                shown = status.line;
                bar.set_message(format!("line {shown}"));
            }
            for event in events {
                match event {
                    Event::Machine(event) => {
                        if repeats.is_news(&event, now)
                            && let Some(text) = self.text(&event, &*layout)
                        {
                            bar.suspend(|| eprintln!("{text}"));
                        }
                    }
                    Event::Refused(refused) => {
                        eprintln!("{}", refused.reason);
                        unmet.refused(&refused, place(status));
                    }
                    Event::Message { line, text } => {
                        bar.suspend(|| eprintln!("line {line}: {text}"));
                    }
                    _ => {}
                }
            }
            tell_counted(repeats.due(now));
            commands.as_mut().map_or(Ok(()), CommandLog::follow)?;
            script.follow(status)?;
            Ok::<_, Box<dyn Error>>(())
        })?;
        tell_counted(repeats.due(Duration::MAX));
        bar.finish_and_clear();
        commands.as_mut().map_or(Ok(()), CommandLog::follow)?;
        script.tell_left();
        if let Some(error) = failure {
            report(&*error);
        }
        let (timeline, observers) = session.end();
        let logged = timeline.frames().finish_log();
        let (mut summary, rows) = judged(&machine, &layout, timeline, observers)?;
        self.complete(&mut summary, &machine, again.as_ref())?;
        unmet.mark(&mut summary);
        let title = format!("validated in virtual time, seed {}", self.seed);
        results.write(&mut summary, rows, self.program(), title, Target::begin)?;
        claims.tell(&summary.to_string());
        logged?;
        Ok(summary)
    }

    /// Adds to a result its seed and, of a program that can be had again, why an axis did not follow, by making
    /// the validation again.
    fn complete(
        &self,
        summary: &mut Summary,
        machine: &Machine,
        program: Option<&Program>,
    ) -> Result<(), Box<dyn Error>> {
        summary.seed = Some(self.seed);
        let Some(program) = program else {
            return Ok(());
        };
        let again = Again {
            file: &self.machine,
            settings: &self.settings,
            tables: self.tables.as_deref(),
            program,
            seed: self.seed,
        };
        summary.cause = again.cause(machine, summary)?;
        Ok(())
    }

    /// The line of an event that is worth one.
    fn text(&self, event: &MachineEvent, names: &impl Names) -> Option<String> {
        let is_loud = matches!(
            event,
            MachineEvent::Fault(_)
                | MachineEvent::HomingFailed { .. }
                | MachineEvent::Switched { .. }
        );
        let told = self.verbose || is_loud;
        told.then(|| event.describe(names)).flatten()
    }
}

/// Where a program is.
fn place(status: &Status) -> Place {
    Place {
        time: status.time.unwrap_or_default(),
        line: status.line,
    }
}

/// The operator of an events file.
struct Script {
    operator: Operator,
    events: Events,
    /// When the machine moved last, or did not wait for an operator, or the last event came, s.
    last_moved: f64,
}

impl Script {
    /// Commands what is due, and stops a machine that nobody will have go on.
    fn follow(&mut self, status: &Status) -> Result<(), NotTaken> {
        let Some(time) = status.time else {
            return Ok(());
        };
        if !status.waits || status.velocity.iter().any(|it| *it != 0.0) {
            self.last_moved = self.last_moved.max(time);
        }
        while let Some(command) = self.events.due(time, false) {
            self.last_moved = time;
            match self.operator.command(command.clone()) {
                Err(NotTaken::Busy) => return Ok(()),
                taken => taken?,
            };
            self.events.pass();
        }
        if self.events.left().is_none() && time - self.last_moved > PATIENCE {
            eprintln!("the events end while the program is held: stopped");
            self.last_moved = f64::INFINITY;
            self.operator.command(Command::Stop)?;
        }
        Ok(())
    }

    /// Tells what did not come.
    fn tell_left(&self) {
        if let Some(left) = self.events.left() {
            eprintln!("{}", never_come(left));
        }
    }
}

/// What is told of events that did not come, with when the first of them was to.
pub(super) fn never_come((when, count): (When, usize)) -> String {
    let from = match when {
        When::At(time) => format!(" from {time} s on"),
        When::AtRest => String::new(),
    };
    let (events, come) = match count {
        1 => ("event", "comes"),
        _ => ("events", "come"),
    };
    format!("{count} {events}{from} never {come}: the run is over before")
}
