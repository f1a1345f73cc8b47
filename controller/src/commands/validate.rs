//! `syncline validate`: proof before metal moves.

use super::log_files::{LogFiles, Logs};
use super::output::{Claims, Output, Results};
use super::switches::Switches;
use super::{Exit, report};
use crate::control::fault::Names;
use crate::control::{Controller, Event, Layout, Order};
use crate::machine::{COORDINATES, Machine};
use crate::program::Program;
use crate::run::events::Events;
use crate::run::recorder::{Recorder, Summary};
use crate::run::virtual_time::VirtualMachine;
use std::error::Error;
use std::path::PathBuf;
use std::sync::Arc;

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
    program: PathBuf,
    #[command(flatten)]
    output: Output,
    #[command(flatten)]
    log: LogFiles,
    /// Varies encoder noise, response delays and oscillator errors of the simulated drives.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    switches: Switches,
    /// What a person does, as CSV with the columns `t_s,event,value`: feed_override and
    /// rapid_override (%), hold, resume, stop_after_block, step_back, jog (X+1.5 or X-),
    /// jog_to, move_to (X10 Y20), stop, at times of the trace.
    #[arg(long, value_name = "FILE")]
    events: Option<PathBuf>,
    /// Tell what the controller does.
    #[arg(short, long)]
    verbose: bool,
}

/// All that a validation needs.
struct Prepared {
    machine: Machine,
    layout: Arc<Layout>,
    program: Program,
    events: Events,
    claims: Claims,
    results: Results,
    logs: Logs,
}

impl Args {
    pub(super) fn execute(self) -> Exit {
        let prepared = match self.prepare() {
            Ok(prepared) => prepared,
            Err(error) => return super::bad_input(&*error),
        };
        match self.validate(prepared) {
            Ok(summary) if summary.verdict == "pass" => Exit::Finished,
            Ok(_) => Exit::Stopped,
            Err(error) => {
                report(&*error);
                Exit::Stopped
            }
        }
    }

    /// Reads and checks everything, and opens the files, before anything else.
    fn prepare(&self) -> Result<Prepared, Box<dyn Error>> {
        let machine = Machine::load(&self.machine)?;
        let layout = Arc::new(Layout::new(&machine)?);
        let program = (self.switches).program(&self.program, &machine, &self.machine)?;
        program.check(machine.rest())?;
        let mut claims = Claims::of_run(&self.machine, &self.program);
        let events = match &self.events {
            Some(file) => {
                claims = claims.reads("--events", file);
                Events::load(file)?
            }
            None => Events::default(),
        };
        let results = self.output.open(&mut claims)?;
        let logs = self.log.open(&mut claims)?;
        if let Some(beginning) = program.beginning(machine.rest())? {
            eprintln!("{beginning}");
        }
        Ok(Prepared {
            machine,
            layout,
            program,
            events,
            claims,
            results,
            logs,
        })
    }

    fn validate(&self, prepared: Prepared) -> Result<Summary, Box<dyn Error>> {
        let Prepared {
            machine,
            layout,
            program,
            mut events,
            claims,
            mut results,
            logs,
        } = prepared;
        let mut virtual_machine =
            VirtualMachine::new(&machine, Arc::clone(&layout), program, self.seed)?;
        logs.record_virtual(&machine, virtual_machine.frames())?;
        let mut recorder = Recorder::new(&machine, results.trace()?, results.wants_report())?;
        let mut failure = None;
        let mut held = false;
        let mut last_moved = 0.0;
        loop {
            match virtual_machine.step() {
                Ok(true) => {}
                Ok(false) => break,
                Err(error) => failure = failure.or(Some(error)),
            }
            while let Some(event) = virtual_machine.event() {
                held = event.rests().unwrap_or(held);
                if let Event::Paused { .. } = event {
                    virtual_machine.controller().go_on();
                }
                self.tell(&event, &*layout);
            }
            let (row, moves) = virtual_machine.row();
            if let Some(row) = row {
                let time = recorder.record(row, moves)?;
                while let Some((line, output)) = recorder.output() {
                    eprintln!("line {line}: {output}");
                }
                if !held || row.plan.velocity.iter().any(|it| *it != 0.0) {
                    last_moved = time;
                }
                while let Some(order) = events.due(time) {
                    last_moved = time;
                    virtual_machine.controller().obey(order);
                }
                if events.left().is_none() && time - last_moved > PATIENCE {
                    eprintln!("the events end while the program is held: stopped");
                    last_moved = f64::INFINITY;
                    virtual_machine.controller().obey(Order::Interrupt);
                }
            }
        }
        if let Some((time, count)) = events.left() {
            let (events, come) = if count == 1 {
                ("event", "comes")
            } else {
                ("events", "come")
            };
            eprintln!("{count} {events} from {time} s on never {come}: the run is over before");
        }
        if let Some(error) = failure {
            report(&error);
        }
        let logged = virtual_machine.frames().finish_log();
        let frames = Some(virtual_machine.frames().result());
        let controller: &Controller<COORDINATES> = virtual_machine.controller();
        let (summary, rows) = recorder.finish(&machine, &layout, controller, frames)?;
        let title = format!("validated in virtual time, seed {}", self.seed);
        results.write(&summary, rows, &self.program, title)?;
        claims.tell(&summary.to_string());
        logged?;
        Ok(summary)
    }

    fn tell(&self, event: &Event, names: &impl Names) {
        if (self.verbose || matches!(event, Event::Fault(_) | Event::NoJog(_)))
            && let Some(text) = event.describe(names)
        {
            eprintln!("{text}");
        }
    }
}
