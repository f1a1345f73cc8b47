//! A validation without a terminal: the controller on simulated drives in virtual time, for whoever calls it.
//!
//! ```
#![doc = include_str!("../examples/validate.rs")]
//! ```

pub mod cause;

use crate::budget::DoesNotFit;
use crate::control::Layout;
use crate::machine::{Machine, MachineState};
use crate::observe::Observers;
use crate::observe::record::Report;
use crate::observe::summary::Summary;
use crate::port::PortError;
use crate::program::{Program, ProgramError, Programs};
use crate::run::virtual_time::VirtualMachine;
use crate::run::{Progress, RunError};
use crate::session::{Command, Event, NotTaken, PassesStops, Session, Status};
use std::error::Error;
use std::io;
use std::path::Path;
use std::sync::Arc;
use syncline_gcode::Tables;

/// What programs are validated on.
pub struct Inputs {
    /// The machine.
    pub machine: Machine,
    /// Its programs, with its tables.
    pub programs: Programs,
}

/// Why a validation came to no result.
#[derive(Debug, thiserror::Error)]
pub enum NotValidated {
    /// The frames of a bus do not fit the cycle.
    #[error(transparent)]
    DoesNotFit(#[from] DoesNotFit),
    /// A bus cannot be simulated.
    #[error(transparent)]
    Port(#[from] PortError),
    /// A block of the program cannot be run.
    #[error(transparent)]
    Program(#[from] ProgramError),
    /// The program could not go on.
    #[error(transparent)]
    Run(Arc<RunError>),
    /// The session does not take its own commands.
    #[error(transparent)]
    NotTaken(#[from] NotTaken),
    /// A trace could not be written.
    #[error(transparent)]
    Io(#[from] io::Error),
}

impl Inputs {
    /// Reads a machine file with other values of keys, each as [`Machine::load_with`] takes it, and tables of
    /// work offsets and tools: those of a file, or the ones beside the machine file.
    ///
    /// # Errors
    /// Any of it cannot be read or used, or the machine's frames do not fit its cycle.
    pub fn read(
        machine_file: &Path,
        settings: &[String],
        tables: Option<&Path>,
    ) -> Result<Self, Box<dyn Error>> {
        let machine = Machine::load_with(machine_file, settings)?;
        Layout::new(&machine)?;
        let programs = match tables {
            Some(file) => {
                let text = syncline_strict_toml::read(file);
                let text = text.map_err(|why| format!("cannot read {}: {why}", file.display()))?;
                Programs::with_tables(&machine, Tables::parse(file, &text)?)
            }
            None => Programs::new(&machine, machine_file)?,
        };
        Ok(Self { machine, programs })
    }

    /// The machine as the controller has it, with its axes referenced as those of one that is simulated with this seed.
    ///
    /// # Errors
    /// The frames of a bus do not fit the cycle.
    pub fn layout(&self, seed: u64) -> Result<Arc<Layout>, DoesNotFit> {
        let state = MachineState::simulated(&self.machine, seed);
        let layout = Layout::new(&self.machine)?;
        Ok(Arc::new(layout.recalling(&self.machine, &state)))
    }

    /// Runs a program, from the same seed always with the same frames, and judges it. Program stops (M0, M1,
    /// M6) go on at once. With `rows` there is a [`Report`] with what was in every cycle. `goes_on` is asked at
    /// every wake-up; once it says no the machine is stopped as an operator stops it.
    ///
    /// # Errors
    /// There is no result.
    pub fn validate(
        &self,
        program: Program,
        seed: u64,
        rows: bool,
        mut goes_on: impl FnMut(&Status) -> bool,
    ) -> Result<(Summary, Option<Report>), NotValidated> {
        let extent = program.check(self.machine.rest())?;
        let layout = &self.layout(seed)?;
        let program_samples = program.samples().cloned();
        let (timeline, moves) =
            VirtualMachine::new(&self.machine, Arc::clone(layout), program, seed)?;
        let sent = timeline.frames().listen(&self.machine);
        let observers = Observers::new(&self.machine, Some(sent), None, rows);
        let observers = match program_samples {
            Some(samples) => observers.along(&samples),
            None => observers.of_program(Some(extent)),
        };
        let mut session = Session::new(layout, timeline, moves, observers);
        let caller = session.operator("validate");
        let mut stopped = false;
        let problem = attend(&mut session, |session, _| {
            if !stopped && !goes_on(session.status()) {
                caller.command(Command::Stop)?;
                stopped = true;
            }
            Ok::<_, NotTaken>(())
        })?;
        if let Some(error) = problem {
            return Err(NotValidated::Run(error));
        }
        let (timeline, observers) = session.end();
        let (mut summary, report) = judged(&self.machine, layout, timeline, observers)?;
        summary.seed = Some(seed);
        Ok((summary, report))
    }
}

/// Goes through the session of one program to its end; program stops (M0, M1, M6) go on at once. After every wake-up
/// `see` has the session, with what was told since the last one. Returns the first thing that could not go on, if there is one.
///
/// # Errors
/// The session does not take a command, or `see` fails.
pub(crate) fn attend<E: From<NotTaken>>(
    session: &mut Session<VirtualMachine>,
    mut see: impl FnMut(&mut Session<VirtualMachine>, Vec<Event>) -> Result<(), E>,
) -> Result<Option<Arc<RunError>>, E> {
    let told = session.subscribe();
    let passes_stops = PassesStops::new(session.operator("validate"));
    let mut problem = None;
    while session.advance() != Progress::Ended {
        let events: Vec<Event> = told.events().collect();
        for event in &events {
            passes_stops.hear(event)?;
            if let Event::Problem(error) = event {
                problem.get_or_insert_with(|| Arc::clone(error));
            }
        }
        see(session, events)?;
    }
    Ok(problem)
}

/// What came of a run that is over, with what is seen of its simulated drives behind it.
///
/// # Errors
/// The trace could not be written.
pub(crate) fn judged(
    machine: &Machine,
    layout: &Layout,
    mut timeline: VirtualMachine,
    mut observers: Observers,
) -> io::Result<(Summary, Option<Report>)> {
    observers.observe_gains(machine, |drive| timeline.gains(drive));
    let frames = Some(timeline.frames().result());
    observers.observe_rest(|| timeline.come_to_rest());
    observers.finish(machine, layout, timeline.controller(), frames)
}
