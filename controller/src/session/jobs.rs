//! The jobs of a machine that stays on: what they have in common, what is loaded, which is at work.
//!
//! Offsets set at the machine and the length of a tool are lines that are typed in, `G10 L20` and
//! `G10 L10` with `G43`: what a program can do and what an operator can do is done in one way.

use super::{Command, Refusal};
use crate::control::{Job, JobKind, Order, Outcome, State};
use crate::machine::{COORDINATES, Position};
use crate::program::{Left, Moves, Program, Programs};
use crate::run::Work;
use std::fs::File;
use std::path::{Path, PathBuf};
use syncline_gcode::Point;

/// See the module.
pub(super) struct Jobs {
    programs: Programs,
    loaded: Option<PathBuf>,
    /// How many there were.
    count: u64,
    /// The one that was handed to the timeline and is not over.
    at_work: Option<Job>,
}

/// A job that is to begin.
pub(super) struct Begin {
    pub(super) work: Work,
    pub(super) order: Order,
    /// Where its moves come up.
    pub(super) moves: Moves,
}

impl Jobs {
    pub(super) fn new(programs: Programs) -> Self {
        Self {
            programs,
            loaded: None,
            count: 0,
            at_work: None,
        }
    }

    /// What the programs so far have left.
    pub(super) fn programs(&self) -> &Programs {
        &self.programs
    }

    /// The program that is loaded.
    pub(super) fn loaded(&self) -> Option<&Path> {
        self.loaded.as_deref()
    }

    /// The state as operators have it, who are shown `shown`: until a job has left what the next one
    /// begins with it is at work, or being stopped, also where the machine rests already.
    pub(super) fn state(&self, machine: State, shown: State) -> State {
        match self.at_work {
            Some(_) if machine == State::Ready && shown == State::Stopping => shown,
            Some(job) if machine == State::Ready => match job.kind {
                JobKind::Program => State::Running,
                JobKind::Mdi => State::Mdi,
            },
            _ => machine,
        }
    }

    /// Loads a program; it is read when it runs.
    pub(super) fn load(&mut self, file: &Path) -> Result<(), Refusal> {
        File::open(file).map_err(|error| Refusal::Unreadable {
            file: file.to_owned(),
            why: error.to_string(),
        })?;
        self.loaded = Some(file.to_owned());
        Ok(())
    }

    /// The job that a command begins, with `tool` in the spindle; `None` if it begins none.
    pub(super) fn begin(&mut self, command: &Command, tool: u32) -> Result<Option<Begin>, Refusal> {
        let (kind, program) = match command {
            Command::CycleStart => (JobKind::Program, self.run(None)?),
            Command::Run { from_line } => (JobKind::Program, self.run(*from_line)?),
            Command::Mdi(lines) => (JobKind::Mdi, self.programs.lines(lines)),
            Command::SetWorkOffset(positions) => {
                let words = self.words(positions)?;
                (
                    JobKind::Mdi,
                    self.programs.lines(&format!("G10 L20 P0{words}")),
                )
            }
            Command::SetToolLength(positions) => {
                if tool == 0 {
                    return Err(Refusal::NoTool);
                }
                let words = self.words(positions)?;
                let lines = format!("G10 L10 P{tool}{words}\nG43 H{tool}");
                (JobKind::Mdi, self.programs.lines(&lines))
            }
            _ => return Ok(None),
        };
        self.count += 1;
        let job = Job {
            number: self.count,
            kind,
            waits_for_input: program.streams(),
            homes_first: program.homes_first(),
        };
        let (upcoming, moves) = Moves::new();
        self.at_work = Some(job);
        Ok(Some(Begin {
            work: Work {
                number: job.number,
                program,
                upcoming,
            },
            order: Order::Begin(job),
            moves,
        }))
    }

    fn run(&self, from_line: Option<u32>) -> Result<Program, Refusal> {
        let file = self.loaded.as_ref().ok_or(Refusal::NoProgram)?;
        let program = self.programs.file(file).from_line(from_line);
        Ok(program.wait_at_the_line())
    }

    fn words(&self, positions: &[Option<f64>; COORDINATES]) -> Result<String, Refusal> {
        let mut given = positions.iter().flatten().peekable();
        if given.peek().is_none() {
            return Err(Refusal::NoAxis);
        }
        if given.any(|position| !position.is_finite()) {
            return Err(Refusal::NotANumber);
        }
        Ok(self.programs.memory().words(positions))
    }

    /// Of positions in work coordinates, those in machine coordinates, from `here`.
    pub(super) fn machine_coordinates(
        &self,
        positions: &[Option<f64>; COORDINATES],
        here: &Position,
    ) -> [Option<f64>; COORDINATES] {
        self.programs.coordinates().place(positions, Point(*here))
    }

    /// The job did not begin.
    pub(super) fn refused(&mut self, number: u64) {
        self.at_work.take_if(|job| job.number == number);
    }

    /// The job is over and has `left` something, if it finished, and this `tool` in the spindle.
    pub(super) fn over(&mut self, number: u64, outcome: Outcome, left: Option<Left>, tool: u32) {
        let Some(job) = self.at_work.take_if(|job| job.number == number) else {
            return;
        };
        match (left, job.kind, outcome) {
            (Some(left), ..) => self.programs.take_over(left),
            (None, JobKind::Program, _) => self.programs.forget(tool),
            // Lines that are wrong were not begun.
            (None, JobKind::Mdi, Outcome::Broken) => {}
            (None, JobKind::Mdi, _) => self.programs.stop(tool),
        }
    }
}
