//! A machine that stays on in virtual time, whose operator is a file of events: what a person does at a
//! console in a working day, the same each time, byte for byte.

use super::command_log::{CommandFile, CommandLog};
use super::console::Teller;
use super::events::{Events, Plays};
use super::log_files::LogFiles;
use super::output::{Claims, Output, Target};
use super::unmet::{SOURCE, Unmet};
use super::validate::never_come;
use crate::control::{Layout, State};
use crate::machine::MachineState;
use crate::observe::Observers;
use crate::observe::record::Place;
use crate::observe::summary::Summary;
use crate::run::Progress;
use crate::run::virtual_time::VirtualMachine;
use crate::session::{Command, NotTaken, Operator, Session, Status, Subscription, Taken};
use crate::validate::{Inputs, judged};
use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use syncline_gcode::Tables;

/// Behind an answer, until the state that a command leads to is there.
const SETTLES: Duration = Duration::from_millis(20);

/// At rest for so long behind the last event the machine is switched off: nobody is there to go on.
const PATIENCE: Duration = Duration::from_secs(1);

/// What a session is made from, and where its results go.
pub(super) struct Scripted<'a> {
    pub(super) machine: &'a Path,
    pub(super) settings: &'a [String],
    pub(super) tables: Option<&'a Path>,
    pub(super) events: &'a Path,
    pub(super) seed: u64,
    pub(super) verbose: bool,
    pub(super) output: &'a Output,
    pub(super) commands: &'a CommandFile,
    pub(super) log: &'a LogFiles,
}

impl Scripted<'_> {
    /// Goes through the session to its end and judges it; tables and the machine's state stay as they are on the disk.
    ///
    /// # Errors
    /// The outer one: what it is made from cannot be used, or a file cannot be opened; nothing has begun. The inner
    /// one: a result cannot be written.
    pub(super) fn play(&self) -> Result<Result<Summary, Box<dyn Error>>, Box<dyn Error>> {
        let inputs = Inputs::read(self.machine, self.settings, self.tables)?;
        let mut claims = Claims::of_run(self.machine, &inputs.machine, self.events);
        if let Some(file) = self.tables {
            claims = claims.reads("--tables", file);
        }
        let events = Events::load(self.events, Plays::Session)?;
        for program in events.programs() {
            claims = claims.reads("a program that is loaded", program);
        }
        let origin = (self.output).origin(self.machine, &inputs.machine, self.events);
        let mut results = self.output.open(&mut claims, origin)?;
        if results.wants_report() {
            return Err("a report is of one program: name <PROGRAM>, or leave --report out".into());
        }
        let commands = self.commands.open(&mut claims)?;
        let logs = self.log.open(&mut claims)?;
        let layout = inputs.layout(self.seed)?;
        let Inputs { machine, programs } = inputs;
        let timeline = VirtualMachine::switched_on(&machine, Arc::clone(&layout), self.seed)?;
        logs.record_virtual(&machine, timeline.frames())?;
        let sent = Some(timeline.frames().listen(&machine));
        let observers =
            Observers::new(&machine, sent, results.trace()?, false).seeing_drives(&machine);
        let mut session = Session::staying_on(&layout, timeline, programs, observers);
        let commands = commands.map(|file| {
            let beside = Tables::beside(self.machine);
            let state = MachineState::simulated(&machine, self.seed);
            let tables = self.tables.unwrap_or(&beside);
            CommandLog::begin(&mut session, Box::new(file.begin()?), tables, &state)
        });
        let commands = commands.transpose()?;
        let teller = Teller::new(&session, machine.clone(), Arc::clone(&layout), self.verbose);
        let unmet = attend(&mut session, events, commands, &teller, &layout);
        let (timeline, observers) = session.end();
        let logged = timeline.frames().finish_log();
        let result = unmet.and_then(|unmet| {
            let (mut summary, _) = judged(&machine, &layout, timeline, observers)?;
            summary.seed = Some(self.seed);
            unmet.mark(&mut summary);
            let title = String::new();
            results.write(&mut summary, None, self.events, title, Target::begin)?;
            claims.tell(&summary.to_string());
            logged?;
            Ok(summary)
        });
        Ok(result)
    }
}

/// Has the operator heard until the machine is off; what was asked for and did not come about.
fn attend(
    session: &mut Session<VirtualMachine>,
    events: Events,
    mut commands: Option<CommandLog>,
    teller: &Teller,
    layout: &Layout,
) -> Result<Unmet, Box<dyn Error>> {
    let mut script = Script {
        operator: session.operator(SOURCE),
        answers: session.subscribe(),
        events,
        unanswered: 0,
        unmet: Unmet::default(),
        busy: Duration::ZERO,
        zero: None,
    };
    let told = session.subscribe();
    while session.advance() != Progress::Ended {
        let now = Duration::from_nanos(session.timeline().now().as_nanos());
        for event in told.events() {
            let at = script.place(session.status(), now);
            script.unmet.hear(&event, layout, at);
            let Some(text) = teller.text(&event) else {
                continue;
            };
            match script.time(now) {
                Some(time) => eprintln!("{time:9.3} s  {text}"),
                None => eprintln!("{:11}  {text}", ""),
            }
        }
        commands.as_mut().map_or(Ok(()), CommandLog::follow)?;
        script.follow(session.status(), now)?;
    }
    commands.as_mut().map_or(Ok(()), CommandLog::follow)?;
    if let Some(left) = script.events.left() {
        eprintln!("{}", never_come(left));
    }
    Ok(script.unmet)
}

/// The operator of a file of events.
struct Script {
    operator: Operator,
    answers: Subscription,
    events: Events,
    /// Commands that have neither taken effect nor been refused.
    unanswered: usize,
    unmet: Unmet,
    /// When the machine last did something, or a command was answered, since it was switched on.
    busy: Duration,
    /// When the time of the trace was 0, likewise, s.
    zero: Option<f64>,
}

impl Script {
    /// The time of the trace, which goes on where it has no rows, s; none before the machine is ready for the first time.
    fn time(&self, now: Duration) -> Option<f64> {
        self.zero.map(|zero| now.as_secs_f64() - zero)
    }

    /// Where the machine is now; at 0 s before it is ready for the first time.
    fn place(&self, status: &Status, now: Duration) -> Place {
        Place {
            time: self.time(now).unwrap_or_default(),
            line: status.line,
        }
    }

    /// Commands what is due; behind the last event ends what is held, and switches the machine off.
    fn follow(&mut self, status: &Status, now: Duration) -> Result<(), NotTaken> {
        let answers = self.answers.events();
        let answered = answers.filter(|event| event.answers(SOURCE)).count();
        self.unanswered = self.unanswered.saturating_sub(answered);
        if answered > 0 || self.unanswered > 0 || !rests(status) {
            self.busy = now;
        }
        let stands = now.saturating_sub(self.busy);
        if let (None, Some(time)) = (self.zero, status.time) {
            self.zero = Some(now.as_secs_f64() - time);
        }
        // A jog adds to the one that is under way.
        let adds = self.unanswered == 0
            && status.state == State::Jogging
            && matches!(self.events.next(), Some(Command::Jog(_)));
        let mut rests = stands >= SETTLES || adds;
        // A machine that is stopped before it was ready has no time of its own.
        let time = match (self.time(now), rests) {
            (None, true) => now.as_secs_f64(),
            (time, _) => time.unwrap_or(f64::NEG_INFINITY),
        };
        while let Some(command) = self.events.due(time, rests) {
            let command = command.clone();
            if !self.command(command, now)? {
                return Ok(());
            }
            self.events.pass();
            rests = false;
        }
        if self.events.left().is_none() && now.saturating_sub(self.busy) >= PATIENCE {
            let end = match status.state {
                State::Ready | State::Faulted | State::Disabled => Command::SwitchOff,
                _ => {
                    eprintln!("the events end while a job is held: stopped");
                    self.unmet.held(self.place(status, now));
                    Command::Stop
                }
            };
            self.command(end, now)?;
        }
        Ok(())
    }

    /// Whether there was room for a command.
    fn command(&mut self, command: Command, now: Duration) -> Result<bool, NotTaken> {
        match self.operator.command(command) {
            Ok(taken) => self.unanswered += usize::from(taken == Taken::Queued),
            Err(NotTaken::Busy) => return Ok(false),
            Err(over) => return Err(over),
        }
        self.busy = now;
        Ok(true)
    }
}

/// Whether nothing goes on until an operator has it go on.
fn rests(status: &Status) -> bool {
    let stands = status.stands();
    let settings = &status.settings;
    let held = settings.feed_override == 0.0 || settings.rapid_override == 0.0;
    match status.state {
        State::Ready | State::Faulted | State::Disabled => true,
        State::Held => stands,
        State::Jogging | State::Mdi | State::Running => stands && held,
        State::Off | State::Starting | State::Homing | State::Stopping => false,
    }
}
