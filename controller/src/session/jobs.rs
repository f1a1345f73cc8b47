//! The jobs of a machine that stays on: what they have in common, what is loaded, which is at work, which was
//! interrupted.
//!
//! Offsets set at the machine and the length of a tool are lines that are typed in, `G10 L20` and
//! `G10 L10` with `G43`: what a program can do and what an operator can do is done in one way.
//!
//! A program is interrupted by a fault, by a stop, and where it is held for lines that are typed in. It is resumed where it was
//! interrupted, read anew with the offsets and tools as they are then ([`Interrupted`]).

use super::{Command, Refusal, Status};
use crate::control::{Job, JobKind, Layout, Order, Outcome, State, Switch};
use crate::machine::{COORDINATES, Position};
use crate::program::{Interrupted, Left, ModalState, Moves, Program, Programs, Setting};
use crate::run::Work;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use syncline_gcode::{AxisSet, InEffect, Memory, Modes, Place, Unlike, WorkCoordinates};

/// See the module.
pub(super) struct Jobs {
    programs: Programs,
    loaded: Option<PathBuf>,
    /// The inputs that limit switches are wired to.
    limit_switches: Vec<usize>,
    /// Those with which nothing begins to move while they are on.
    holding: Vec<usize>,
    /// How many there were.
    count: u64,
    /// The one that was handed to the timeline and is not over.
    at_work: Option<AtWork>,
    /// What came to its end and was not stopped, since an order was obeyed or the machine's state was told last.
    came_through: Option<JobKind>,
    /// The program that can be resumed.
    interrupted: Option<Interrupted>,
    /// The line at which the program was asked to begin last, where it has not.
    refused_line: Option<u32>,
    /// What is in effect in the program that is held for lines that are typed in, until such lines have left something.
    aside: Option<ModalState>,
    /// What lines have left that were typed in where that rests.
    beside: Option<Memory>,
}

/// A job that was handed to the timeline.
struct AtWork {
    job: Job,
    program: Program,
    /// Lines that are typed in where a program rests.
    is_beside: bool,
    /// What it takes the place of, until it has begun.
    before: Option<Box<AtWork>>,
    /// It resumes the program that was interrupted.
    resumes: bool,
    /// What was interrupted before it, which can be resumed still if this one does not begin.
    interrupted: Option<Interrupted>,
    /// What lines that are typed in began with before it took up what rested.
    hold: (Option<ModalState>, Option<Memory>),
    /// The cycle has begun it.
    has_begun: bool,
    /// It is over, and what it has left is not known yet.
    is_over: bool,
    /// Something of it has been done.
    has_moved: bool,
    /// What was switched off since then.
    switched_off: Vec<Switch>,
}

/// A job that is to begin.
pub(super) struct Begin {
    pub(super) work: Work,
    pub(super) order: Order,
    /// Where its moves come up.
    pub(super) moves: Moves,
}

/// Where the machine stood when a job began, and where the job is to be resumed.
pub(super) type Resumable = Option<(Position, Place)>;

impl Jobs {
    pub(super) fn new(programs: Programs, layout: &Layout) -> Self {
        let axes = layout.axes.iter();
        Self {
            programs,
            loaded: None,
            limit_switches: (axes.flat_map(|axis| axis.limit_inputs.iter().flatten()))
                .copied()
                .collect(),
            holding: (layout.inputs.iter().enumerate())
                .filter(|(_, input)| input.meaning.holds())
                .map(|(index, _)| index)
                .collect(),
            count: 0,
            at_work: None,
            came_through: None,
            interrupted: None,
            refused_line: None,
            aside: None,
            beside: None,
        }
    }

    /// What the programs so far have left.
    pub(super) fn programs(&self) -> &Programs {
        &self.programs
    }

    /// What typed lines have left that is otherwise than on a machine that was just switched on, of the program at work if it has begun at
    /// its beginning.
    pub(super) fn unlike_fresh(&self) -> Unlike {
        match &self.at_work {
            Some(AtWork {
                job,
                resumes: false,
                ..
            }) if job.kind == JobKind::Program => self.programs.memory().unlike_fresh(),
            _ => Unlike::default(),
        }
    }

    /// What lines that are typed in now begin with.
    pub(super) fn in_effect(&self) -> (WorkCoordinates, &Modes) {
        match (&self.beside, &self.aside) {
            (None, Some(aside)) => (aside.coordinates, &aside.modes),
            (beside, _) => {
                let memory = beside.as_ref().unwrap_or(self.programs.memory());
                (self.programs.coordinates(memory), memory.modes())
            }
        }
    }

    /// No program is held for lines any more.
    pub(super) fn leave_hold(&mut self) {
        (self.aside, self.beside) = (None, None);
    }

    /// The program that is loaded.
    pub(super) fn loaded(&self) -> Option<&Path> {
        self.loaded.as_deref()
    }

    /// The line of the block with which the program that was interrupted can be resumed.
    pub(super) fn interrupted(&self) -> Option<u32> {
        self.interrupted.as_ref().map(Interrupted::line)
    }

    /// The state as operators have it, who are shown `shown`: until a job has left what the next one
    /// begins with it is at work, or being stopped, also where the machine rests already.
    pub(super) fn state(&self, machine: State, shown: State) -> State {
        // What the cycle may yet refuse is not at work.
        let at_work = self.at_work.as_ref().and_then(|it| match it.has_begun {
            true => Some(it),
            false => it.before.as_deref(),
        });
        match at_work {
            Some(_) if machine == State::Ready && shown == State::Stopping => shown,
            // Within a cycle it went on to its end, or was stopped where it rested.
            None | Some(AtWork { is_over: true, .. })
                if machine == State::Ready && shown == State::Held =>
            {
                self.came_through.map_or(State::Stopping, JobKind::state)
            }
            Some(AtWork { is_over: true, .. }) if machine == State::Held => State::Mdi,
            Some(AtWork { job, .. }) if machine == State::Ready => job.kind.state(),
            _ => machine,
        }
    }

    /// An order was obeyed, or the machine's state was told.
    pub(super) fn forget_ending(&mut self) {
        self.came_through = None;
    }

    /// The state in which a command is looked at that comes behind a job which has not begun yet: as if it had.
    pub(super) fn expected(&self, shown: State) -> State {
        match &self.at_work {
            Some(it) if !it.has_begun && matches!(shown, State::Ready | State::Held) => {
                it.job.kind.state()
            }
            _ => shown,
        }
    }

    /// Loads a program; it is read when it runs. One that was interrupted is given up, unless it waits in `state` to be
    /// resumed.
    pub(super) fn load(&mut self, file: &Path, state: State) -> Result<(), Refusal> {
        let found = File::open(file).and_then(|file| file.metadata());
        let readable = found.and_then(|found| match found.is_dir() {
            true => Err(io::ErrorKind::IsADirectory.into()),
            false => Ok(()),
        });
        readable.map_err(|error| Refusal::Unreadable {
            file: file.to_owned(),
            why: error.to_string(),
        })?;
        self.loaded = Some(file.to_owned());
        self.refused_line = None;
        if state != State::Held {
            self.interrupted = None;
        }
        Ok(())
    }

    /// Whether it matters which axes a job homes before it moves them: of a machine with one that is not referenced, or
    /// that stands on a limit switch, which a homing may lead off.
    fn asks_for_homing(&self, status: &Status) -> bool {
        !status.referenced.iter().all(|it| *it) || is_any_on(&self.limit_switches, status)
    }

    /// Whether a command resumes the program that was interrupted, in the state that is shown.
    pub(super) fn resumes(&self, command: &Command, state: State) -> bool {
        self.interrupted.is_some()
            && match command {
                Command::Resume if state == State::Ready => true,
                Command::Resume | Command::CycleStart | Command::ToggleFeedHold => {
                    state == State::Held && self.at_work.is_none()
                }
                _ => false,
            }
    }

    /// The job that a command begins at a machine as it is shown; `None` if it begins none. What is held
    /// would be resumed there.
    pub(super) fn begin(
        &mut self,
        command: &Command,
        status: &Status,
        now: InEffect,
        held: Resumable,
    ) -> Result<Option<Begin>, Refusal> {
        let tool = status.tool;
        let resumes = self.resumes(command, status.state);
        let (kind, program) = match (command, &self.interrupted) {
            (_, Some(interrupted)) if resumes => {
                let program = interrupted.resume(&self.programs, now);
                (JobKind::Program, program)
            }
            // From where it would begin, nobody has said.
            (Command::CycleStart, Some(interrupted)) => {
                return Err(Refusal::Interrupted {
                    line: interrupted.line(),
                });
            }
            // It confirms the line, and not that the whole program begins instead.
            (Command::CycleStart, None) => match self.refused_line {
                Some(line) => return Err(Refusal::NotAtLine { line }),
                None => (JobKind::Program, self.run(None, now)?),
            },
            (Command::Run { from_line }, _) => (JobKind::Program, self.run(*from_line, now)?),
            (Command::Mdi(lines), _) => (JobKind::Mdi, self.programs.lines(lines)),
            (Command::SetWorkOffset(positions), _) => {
                let setting = Setting::WorkOffset(named(positions)?);
                (JobKind::Mdi, self.programs.setting(setting))
            }
            (Command::SetToolLength(positions), _) => {
                if tool == 0 {
                    return Err(Refusal::NoTool);
                }
                let setting = Setting::ToolLength(tool, named(positions)?);
                (JobKind::Mdi, self.programs.setting(setting))
            }
            _ => return Ok(None),
        };
        let is_beside = kind == JobKind::Mdi && status.state == State::Held;
        // For lines that are misspelt the program that is held is not set aside.
        if is_beside && let Some(mistake) = program.misspelling() {
            return Err(Refusal::Misspelt(mistake.to_string()));
        }
        let program = match is_beside {
            true => self.beside(program, held, status.line),
            false => program,
        };
        self.count += 1;
        let job = Job {
            number: self.count,
            kind,
            is_entered: program.is_entered(),
            waits_for_input: program.streams(),
            homes_first: match self.asks_for_homing(status) {
                true => program.homes_first(),
                // Not asked otherwise: the answer takes reading the program up to where it resumes.
                false => AxisSet::NONE,
            },
            // Not asked where everything may move.
            is_still: kind == JobKind::Mdi
                && is_any_on(&self.holding, status)
                && program.is_still(&status.setpoint),
            leaves: match kind {
                JobKind::Mdi => {
                    program.leaves(&status.setpoint, |axis| !status.referenced[axis.index()])
                }
                JobKind::Program => AxisSet::NONE,
            },
        };
        let order = match kind {
            JobKind::Program if status.state == State::Held => Order::TakeUp(job),
            _ => Order::Begin(job),
        };
        let (upcoming, moves) = Moves::new();
        self.at_work = Some(AtWork {
            job,
            program: program.clone(),
            is_beside,
            before: self.at_work.take().map(Box::new),
            resumes,
            interrupted: self.interrupted.clone(),
            hold: (None, None),
            has_begun: false,
            is_over: false,
            has_moved: false,
            switched_off: Vec::new(),
        });
        Ok(Some(Begin {
            work: Work {
                number: job.number,
                program,
                upcoming,
            },
            order,
            moves,
        }))
    }

    /// Lines that are typed in where a program is held, or where it was for the lines before: in the modes that it has
    /// there, or that those have left.
    fn beside(&self, lines: Program, held: Resumable, line: u32) -> Program {
        match (&self.at_work, &self.beside, held) {
            (None, Some(memory), _) => lines.behind(memory.clone()),
            (Some(AtWork { program, .. }), _, Some((start, place))) => {
                lines.beside(Interrupted::new(program, start, place, line))
            }
            _ => match &self.interrupted {
                Some(interrupted) => lines.beside(interrupted.clone()),
                None => lines,
            },
        }
    }

    /// The program that is loaded. In its middle it begins with the outputs and the coolant as they are `now`.
    fn run(&self, from_line: Option<u32>, now: InEffect) -> Result<Program, Refusal> {
        let file = self.loaded.as_ref().ok_or(Refusal::NoProgram)?;
        let mut program = self.programs.file(file).from_line(from_line);
        program.begin_with(now.outputs, now.coolant);
        Ok(program.wait_at_the_line())
    }

    /// A program is asked to begin, at that line if one is named; whether it does is not known yet. What is asked in the midst of another
    /// one is refused, and says nothing of the next.
    pub(super) fn asked_for(&mut self, line: Option<u32>) {
        if self.at_work.is_none() {
            self.refused_line = line;
        }
    }

    /// The job did not begin: what it was to take the place of is at work as before.
    pub(super) fn refused(&mut self, number: u64) {
        if let Some(it) = self.at_work.take_if(|it| it.job.number == number) {
            self.at_work = it.before.map(|before| *before);
        }
    }

    /// The job has begun, with what is in effect `now`. A program that was held for it is to be resumed there, in this line, with what is
    /// in effect there; one that begins is the one that can be resumed.
    pub(super) fn begun(
        &mut self,
        number: u64,
        (held, in_effect): (Resumable, Option<ModalState>),
        now: &InEffect,
        line: u32,
    ) {
        let Some(it) = self.at_work.as_mut().filter(|it| it.job.number == number) else {
            return;
        };
        it.has_begun = true;
        let (kind, is_beside) = (it.job.kind, it.is_beside);
        let before = it.before.take();
        if !it.job.is_entered {
            it.program.begin_with(now.outputs, now.coolant);
        }
        if kind == JobKind::Program {
            (self.interrupted, self.refused_line) = (None, None);
            it.hold = (self.aside.take(), self.beside.take());
        } else if let Some(before) = before
            && let Some((start, place)) = held
        {
            self.interrupted = Some(Interrupted::new(&before.program, start, place, line));
            self.aside = in_effect;
            self.programs.forget(now.tool);
        }
        if !is_beside {
            self.leave_hold();
        }
    }

    /// The job is over and has `left` something, if it finished, and this `tool` in the spindle.
    pub(super) fn over(&mut self, number: u64, outcome: Outcome, left: Option<Left>, tool: u32) {
        let Some(it) = self.at_work.take_if(|it| it.job.number == number) else {
            return;
        };
        let switched_off = it.switched_off;
        match (left, it.job.kind, outcome) {
            (Some(left), ..) if it.is_beside => {
                self.programs.take_tables(left.tables);
                self.programs.tool_is(tool);
                self.beside = Some(left.memory);
            }
            (Some(left), ..) => self.programs.take_over(left),
            (None, JobKind::Program, outcome) => {
                let is_left = outcome == Outcome::Broken && !it.has_moved;
                if is_left {
                    self.refused_line = it.program.line_to_begin_at();
                    (self.aside, self.beside) = it.hold;
                    self.programs.tool_is(tool);
                } else {
                    self.programs.forget(tool);
                }
                let before = it.interrupted.filter(|_| it.resumes || is_left);
                self.interrupted = self.interrupted.take().or(before);
            }
            // Lines that are wrong were not begun.
            (None, JobKind::Mdi, Outcome::Broken) => {}
            (None, JobKind::Mdi, _) => {
                self.programs.stop(tool);
                self.leave_hold();
            }
        }
        switched_off
            .into_iter()
            .for_each(|it| self.switched_off(it));
    }

    /// The cycle has switched off the spindle or the coolant: by an M-code, or to make the machine safe, behind what the
    /// last job has left. The next job begins so, and no S turns the spindle again.
    pub(super) fn switched_off(&mut self, switch: Switch) {
        if let Some(it) = self.at_work.as_mut().filter(|it| it.is_over) {
            it.switched_off.push(switch);
        }
        let memories = [Some(self.programs.memory_mut()), self.beside.as_mut()];
        for memory in memories.into_iter().flatten() {
            match switch {
                Switch::Spindle(_) => memory.stop_spindle(),
                Switch::Coolant(_) => memory.stop_coolant(),
                Switch::Tool(_) | Switch::Output(_) | Switch::Message => {}
            }
        }
    }

    /// The job with this number is over in the cycle. A program that was stopped can be resumed there, in this line.
    pub(super) fn ended(
        &mut self,
        number: u64,
        outcome: Outcome,
        at: Resumable,
        line: u32,
        has_moved: bool,
    ) {
        let Some(it) = self.at_work.as_mut().filter(|it| it.job.number == number) else {
            return;
        };
        (it.is_over, it.has_moved) = (true, has_moved);
        // Behind a program that cannot go on outputs are made safe, as behind a stop; behind a typed line they stay.
        let came_through = match outcome {
            Outcome::Finished => true,
            Outcome::Broken => it.job.kind == JobKind::Mdi,
            Outcome::Stopped | Outcome::SetAside => false,
        };
        self.came_through = came_through.then_some(it.job.kind);
        let resumable = outcome == Outcome::Stopped && it.job.kind == JobKind::Program;
        if let Some((start, place)) = at.filter(|_| resumable) {
            self.interrupted = Some(Interrupted::new(&it.program, start, place, line));
        }
    }
}

/// Whether one of these inputs is on.
fn is_any_on(inputs: &[usize], status: &Status) -> bool {
    let mut inputs = inputs.iter();
    inputs.any(|&input| status.inputs.get(input).is_some_and(|on| *on))
}

/// Positions of axes that an operator named.
fn named(positions: &[Option<f64>; COORDINATES]) -> Result<[Option<f64>; COORDINATES], Refusal> {
    let mut given = positions.iter().flatten().peekable();
    if given.peek().is_none() {
        return Err(Refusal::NoAxis);
    }
    if given.any(|position| !position.is_finite()) {
        return Err(Refusal::NotANumber);
    }
    Ok(*positions)
}
