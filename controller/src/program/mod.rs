//! A part program on its way into the cycle: interpreted, turned into curves, planned.
//!
//! ```text
//! file ──► gcode::Interpreter ──► Feeder ──► path::Planner ──► Instruction, to the controller
//!                                   └──► Moves, to who follows the machine along the program
//! ```
//!
//! The plan's coordinates are the letters X Y Z A B C U V W, whatever axes the machine has.
//! [`Programs`] is what all programs of a machine share, a [`Program`] one of them before it runs, a
//! [`Feeder`] the running one.

mod answers;
mod beginning;
pub mod bounds;
mod effects;
mod feed;
mod feeder;
mod interrupted;
mod mistakes;
mod moves;
mod reading;
mod setting;
mod shaped;
mod threads;
mod timetable;

pub use beginning::Beginning;
pub(crate) use beginning::rounded;
pub use feed::{counted_group, counted_speed, moved};
pub use feeder::Feeder;
pub use interrupted::Interrupted;
pub use mistakes::{Mistake, Mistakes};
pub use moves::{ModalState, Moves, ProgramMove, Upcoming};
pub use reading::Reading;
pub use setting::Setting;
pub use threads::NoThread;
pub use timetable::Timetable;

use crate::control::{Job, Signal};
use crate::machine::{
    AnalogSource, COORDINATES, InputMeaning, Machine, OutputSwitch, PathTolerances, Position,
    SpinUp,
};
use answers::Answers;
use feed::counted_length;
use moves::{Mixed, MoveSource, path_control_mode};
use shaped::{is_by_coordinates, slowed};
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;
use syncline_gcode::{
    self as gcode, Action, AxisLetter, AxisSet, Interpreter, Tables, TablesError,
};
use syncline_trajectory::path::{CurveError, Limits, PathError, Retraction};
use syncline_trajectory::sampled::Sampled;
use syncline_trajectory::shaper::{Method, Spread};
use threads::Threads;

/// What all programs of a machine have in common: axes, limits, tables, and what the programs before
/// have left.
#[derive(Clone, Debug)]
pub struct Programs {
    setup: gcode::Setup,
    limits: Limits<COORDINATES>,
    /// By coordinate: whether its axis goes point to point.
    point_to_point: [bool; COORDINATES],
    tolerances: PathTolerances,
    spindle: SpinUp,
    threads: Threads,
    user_codes: UserCodes,
    /// What can be read by name, in the order of the names.
    signals: Arc<[Signal]>,
    /// How far a shaper spreads setpoints, and by what method, where that is not each mode's own.
    shaper: Option<(Spread, Option<Method>)>,
    /// How the axes go to a path where a straight line might meet what is being machined.
    retraction: Option<Retraction>,
    /// Where what a program changes in the tables is written at its end.
    keeps: Option<PathBuf>,
    /// The tables file, if there is none.
    no_tables: Option<PathBuf>,
}

/// The M-codes of the user's that run a command, and how long that may take.
type UserCodes = Arc<[(u16, Duration)]>;

/// The inputs and outputs that programs can read, with their names.
fn signals(machine: &Machine) -> impl Iterator<Item = (&str, Signal)> {
    let inputs = machine.inputs.iter().enumerate();
    let inputs = inputs.map(|(index, input)| (&*input.name, Signal::Input(index)));
    let outputs = machine.outputs.iter();
    let outputs = outputs.map(|output| (&*output.name, Signal::Output(output.switch)));
    let analog_inputs = machine.analog_inputs.iter().enumerate();
    let analog_inputs =
        analog_inputs.map(|(index, input)| (&*input.name, Signal::AnalogInput(index)));
    let analog = machine.analog_outputs.iter();
    let analog = analog.map(|output| (&*output.name, Signal::AnalogOutput(output.source)));
    inputs.chain(outputs).chain(analog_inputs).chain(analog)
}

fn user_codes(machine: &Machine) -> UserCodes {
    let codes = machine.user_codes.iter();
    codes.map(|it| (it.code, it.within)).collect()
}

/// What a program leaves to the next one.
#[derive(Clone, Debug)]
pub struct Left {
    /// The modal state, and what else goes on.
    pub memory: gcode::Memory,
    /// Offsets, reference points and tools.
    pub tables: Tables,
}

/// Where a program's blocks are.
#[derive(Clone, Debug)]
enum Source {
    File(PathBuf),
    /// Typed in.
    Lines(String),
    /// What is set where the machine stands.
    Setting(Setting),
    /// In memory, and its name.
    Text(String, Arc<[u8]>),
}

/// Where a program is entered, if not at its beginning.
#[derive(Clone, Copy, Debug)]
#[allow(clippy::large_enum_variant)] // a program has one of them
enum Entered {
    /// At a line, from where the machine stands.
    AtLine(u32),
    /// Where it was interrupted.
    At {
        /// Where the machine stood when it began.
        start: Position,
        place: gcode::Place,
        /// The line that was at work.
        line: u32,
        /// What is in effect when it is entered.
        now: gcode::InEffect,
    },
}

/// Operator switches and the place a program starts from.
#[derive(Clone, Debug)]
pub struct Program {
    source: Source,
    setup: gcode::Setup,
    /// What the machine has answered it, the first one first: a program that is resumed is told again.
    answers: Answers,
    limits: Limits<COORDINATES>,
    /// By coordinate: whether its axis goes point to point.
    point_to_point: [bool; COORDINATES],
    tolerances: PathTolerances,
    keeps: Option<PathBuf>,
    no_tables: Option<PathBuf>,
    spindle: SpinUp,
    threads: Threads,
    user_codes: UserCodes,
    /// What can be read by name, in the order of the names.
    signals: Arc<[Signal]>,
    /// How far a shaper spreads setpoints, and by what method, where that is not each mode's own.
    shaper: Option<(Spread, Option<Method>)>,
    retraction: Option<Retraction>,
    scale: Scale,
    /// Begin there instead of at the beginning.
    entered: Option<Entered>,
    /// Lines that are typed in where this program rests: they begin in the modes that it has there.
    beside: Option<Box<Interrupted>>,
    /// Where it begins in the middle it waits for cycle start first.
    waits: bool,
    /// Not interpreted as a whole before it runs.
    stream: bool,
    /// Behind its end the axes go along these.
    samples: Option<Arc<Sampled<COORDINATES>>>,
}

/// What a program is planned with instead of what it says, to see what that makes of its time.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Scale {
    /// Of its feeds.
    feed: f64,
    /// Of the tolerances of its path.
    tolerance: f64,
}

/// As it says.
impl Default for Scale {
    fn default() -> Self {
        Self {
            feed: 1.0,
            tolerance: 1.0,
        }
    }
}

/// What a program amounts to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Extent {
    /// Blocks executed.
    pub blocks: u64,
    /// Length of all moves that F counts in mm.
    pub length: f64,
    /// Of those that turn A, B and C alone, degrees.
    pub turned: f64,
    /// Whether it changes the tables, as far as is known: a program that is not read as a whole
    /// may.
    pub sets_tables: bool,
    /// The line from which on nothing is known before the machine has been there: it probes, or reads inputs.
    pub known_to: Option<u32>,
    /// The greatest change of an arc that was made for its ends to be exact, mm, and its line.
    pub arc_deviation: (f64, u32),
    /// Feeds above what the axes can.
    pub capped: CappedFeeds,
    /// Feeds of arcs at which a shaper would leave them by more than their mode allows.
    pub slowed: CappedFeeds,
}

/// Feeds that a program asks for and that are not reached: moves with them are as fast as may be.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CappedFeeds {
    /// How many moves.
    pub moves: u64,
    /// The line of the one that is slowed down most.
    pub line: u32,
    /// The part of its feed that it has where it is slowest.
    pub part: f64,
}

impl CappedFeeds {
    fn add(&mut self, line: u32, part: f64) {
        if self.moves == 0 || part < self.part {
            (self.line, self.part) = (line, part);
        }
        self.moves += 1;
    }
}

/// Why a program cannot be run.
#[derive(Debug, thiserror::Error)]
pub enum ProgramError {
    /// A block is wrong or not supported.
    #[error(transparent)]
    Block(#[from] gcode::Error),
    /// Some are.
    #[error("{0}")]
    Blocks(Mistakes),
    /// A move has no curve.
    #[error("{place}: this move cannot be followed")]
    Curve {
        /// File, line and column.
        place: String,
        /// Why.
        source: CurveError,
    },
    /// A move along a path takes along an axis that follows none.
    #[error(
        "{place}: this move goes along a path, and axis {axis} goes point to point: move it in a block of its own"
    )]
    Mixed {
        /// File, line and column.
        place: String,
        /// The axis.
        axis: AxisLetter,
    },
    /// The axes cannot cut a thread.
    #[error("{place}: no thread")]
    Thread {
        /// File, line and column.
        place: String,
        /// Why.
        source: NoThread,
    },
    /// A move cannot be planned.
    #[error("{place}: this move cannot be planned")]
    Plan {
        /// File, line and column.
        place: String,
        /// Why.
        source: PathError,
    },
}

impl Mixed {
    fn at(self, place: String) -> ProgramError {
        ProgramError::Mixed {
            place,
            axis: self.0,
        }
    }
}

impl Programs {
    /// For a machine, with the tables beside its file.
    ///
    /// # Errors
    /// The tables cannot be used.
    pub fn new(machine: &Machine, machine_file: &Path) -> Result<Self, TablesError> {
        let file = Tables::beside(machine_file);
        let programs = Self::with_tables(machine, Tables::load(&file)?);
        let no_tables = (!file.exists()).then_some(file);
        Ok(Self {
            no_tables,
            ..programs
        })
    }

    /// For a machine, with these tables.
    #[must_use]
    pub fn with_tables(machine: &Machine, tables: Tables) -> Self {
        let mut axes = AxisSet::default();
        // A coordinate without an axis never moves, and is not to slow down the others.
        let mut limits = Limits {
            velocity: [1e6; COORDINATES],
            acceleration: [1e9; COORDINATES],
            jerk: [1e12; COORDINATES],
        };
        let mut soft_limits = [None; COORDINATES];
        for axis in &machine.axes {
            axes.insert(axis.letter);
            let coordinate = axis.letter.index();
            limits.velocity[coordinate] = axis.limits.velocity;
            limits.acceleration[coordinate] = axis.limits.acceleration;
            limits.jerk[coordinate] = axis.limits.jerk;
            soft_limits[coordinate] = Some(axis.limits.position);
        }
        let mut setup = gcode::Setup::new(axes);
        setup.limits = soft_limits;
        setup.memory = gcode::Memory::in_path_mode(machine.path_mode);
        setup.spindle_speeds = machine.spindle.as_ref().map(|spindle| spindle.speeds);
        for input in &machine.inputs {
            if let InputMeaning::Program(number) = input.meaning {
                setup.inputs |= 1 << number;
            }
        }
        for input in &machine.analog_inputs {
            setup.analog_inputs |= 1 << input.number;
        }
        for axis in &machine.axes {
            let homing = &axis.homing;
            // Of a gantry with absolute encoders the sides are brought together, and it stays where it is.
            let is_homed = !homing.is_absolute() || homing.square.is_some();
            setup.homed[axis.letter.index()] = is_homed.then(|| gcode::Homed {
                at: homing.final_position(),
                unnamed: !homing.is_absolute() && !homing.is_by_hand(),
            });
        }
        // As they are where nothing is at work.
        for output in &machine.outputs {
            if let OutputSwitch::Program(number) = output.switch {
                setup.outputs.put(number, output.safe);
            }
        }
        for output in &machine.analog_outputs {
            if let AnalogSource::Program(number) = output.source {
                setup.outputs.analog[usize::from(number)] = output.safe;
            }
        }
        setup.names = Arc::new(gcode::MachineNames::new(
            signals(machine).map(|(name, _)| name),
            machine.values.iter().cloned(),
        ));
        let spindle = machine.spindle_drive();
        setup.has_spindle_angle = spindle.is_some_and(|(_, drive)| drive.model.moves_axes());
        let mut outputs = machine.analog_outputs.iter();
        setup.sets_spindle_speed =
            spindle.is_some() || outputs.any(|output| output.source == AnalogSource::SpindleSpeed);
        setup.has_probe = (machine.inputs.iter()).any(|it| it.meaning.is_probed());
        setup.tables = tables;
        Self {
            setup,
            limits,
            point_to_point: machine.point_to_point(),
            tolerances: machine.path,
            spindle: SpinUp::of(machine),
            threads: Threads::of(machine, limits),
            user_codes: user_codes(machine),
            signals: signals(machine).map(|(_, signal)| signal).collect(),
            shaper: (machine.shaper.spread(machine.cycle.as_secs_f64()))
                .map(|spread| (spread, machine.shaper_method)),
            retraction: machine.retraction,
            keeps: None,
            no_tables: None,
        }
    }

    /// Writes what a program changes in the tables to that file once it has finished.
    #[must_use]
    pub fn keep_tables(mut self, file: PathBuf) -> Self {
        self.keeps = Some(file);
        self
    }

    /// A program in a file.
    #[must_use]
    pub fn file(&self, file: &Path) -> Program {
        self.begun(Source::File(file.to_owned()))
    }

    /// A program in memory; `name` stands for it in messages.
    #[must_use]
    pub fn text(&self, name: &str, text: &[u8]) -> Program {
        self.begun(Source::Text(name.to_owned(), text.into()))
    }

    fn begun(&self, source: Source) -> Program {
        let mut program = self.program(source);
        program.setup.memory.begin_program();
        program
    }

    /// Lines that were typed in: where they end the modal state goes on.
    #[must_use]
    pub fn lines(&self, text: &str) -> Program {
        self.typed(Source::Lines(text.to_owned()))
    }

    /// What is set where the machine stands, as lines that were typed in.
    #[must_use]
    pub fn setting(&self, setting: Setting) -> Program {
        self.typed(Source::Setting(setting))
    }

    fn typed(&self, source: Source) -> Program {
        let mut program = self.program(source);
        program.setup.typed = true;
        program
    }

    fn program(&self, source: Source) -> Program {
        let mut setup = self.setup.clone();
        (setup.abandoned, setup.read) = (Arc::default(), Arc::default());
        Program {
            source,
            setup,
            answers: Answers::default(),
            limits: self.limits,
            point_to_point: self.point_to_point,
            tolerances: self.tolerances,
            keeps: self.keeps.clone(),
            no_tables: self.no_tables.clone(),
            spindle: self.spindle,
            threads: self.threads,
            user_codes: Arc::clone(&self.user_codes),
            signals: Arc::clone(&self.signals),
            shaper: self.shaper,
            retraction: self.retraction,
            scale: Scale::default(),
            entered: None,
            beside: None,
            waits: false,
            stream: false,
            samples: None,
        }
    }

    /// What the programs so far have left.
    #[must_use]
    pub fn memory(&self) -> &gcode::Memory {
        &self.setup.memory
    }

    /// The coordinates in which begins what this memory is left to.
    #[must_use]
    pub fn coordinates(&self, memory: &gcode::Memory) -> gcode::WorkCoordinates {
        memory.coordinates(&self.setup.tables)
    }

    /// The tool with this number, if the tables have it.
    #[must_use]
    pub fn tool(&self, number: u32) -> Option<&gcode::Tool> {
        self.setup.tables.tools.get(&number)
    }

    /// A program has finished, and left this.
    pub fn take_over(&mut self, left: Left) {
        self.setup.memory = left.memory;
        self.setup.tables = left.tables;
    }

    /// Lines that were typed where a program rests have finished, and left this in the tables.
    pub fn take_tables(&mut self, tables: Tables) {
        self.setup.tables = tables;
    }

    /// This tool is in the spindle.
    pub fn tool_is(&mut self, tool: u32) {
        self.setup.memory.tool_is(tool);
    }

    /// Typed lines were stopped, which switches spindle and coolant off: what they set is forgotten, but
    /// for the tool that is in the spindle.
    pub fn stop(&mut self, tool: u32) {
        self.setup.memory.stop();
        self.setup.memory.tool_is(tool);
    }

    /// What the programs so far have left, for what was switched since.
    pub(crate) fn memory_mut(&mut self) -> &mut gcode::Memory {
        &mut self.setup.memory
    }

    /// A program was stopped: what it set is forgotten, as it was read ahead of the machine, and what
    /// M2 resets is reset. The tool is the one that is in the spindle.
    pub fn forget(&mut self, tool: u32) {
        self.setup.memory.end_program();
        self.setup.memory.tool_is(tool);
    }
}

impl Program {
    /// A program for a machine, with the tables beside the machine's file.
    ///
    /// # Errors
    /// The tables cannot be used.
    pub fn new(file: &Path, machine: &Machine, machine_file: &Path) -> Result<Self, TablesError> {
        Ok(Programs::new(machine, machine_file)?.file(file))
    }

    /// Whether blocks that begin with `/` are skipped.
    #[must_use]
    pub fn block_delete(mut self, skips: bool) -> Self {
        self.setup.block_delete = skips;
        self
    }

    /// The line to begin at.
    #[must_use]
    pub fn from_line(mut self, line: Option<u32>) -> Self {
        self.entered = line.map(Entered::AtLine);
        self
    }

    /// The line to begin at, if it was named.
    pub(crate) fn line_to_begin_at(&self) -> Option<u32> {
        match self.entered {
            Some(Entered::AtLine(line)) => Some(line),
            _ => None,
        }
    }

    /// Has typed lines begin with what these left, instead of with what the programs so far have.
    #[must_use]
    pub fn behind(mut self, memory: gcode::Memory) -> Self {
        self.setup.memory = memory;
        self
    }

    /// Has typed lines begin in the modes of a program where that rests.
    #[must_use]
    pub fn beside(mut self, interrupted: Interrupted) -> Self {
        self.beside = Some(Box::new(interrupted));
        self
    }

    /// Has the program tell what the line finds that it begins at, and wait for cycle start before it moves or
    /// switches anything.
    #[must_use]
    pub fn wait_at_the_line(mut self) -> Self {
        self.waits = true;
        self
    }

    /// Whether the program is read as it runs: it may be endless, and [`check`](Self::check) only
    /// opens it.
    #[must_use]
    pub fn stream(mut self, streams: bool) -> Self {
        self.stream = streams;
        self.setup.max_blocks = (!streams).then_some(gcode::MAX_BLOCKS);
        self
    }

    /// Whether the program is read as it runs.
    #[must_use]
    pub fn streams(&self) -> bool {
        self.stream
    }

    /// Behind its end, which has to be where they begin, the axes go along samples.
    #[must_use]
    pub fn then_along(mut self, samples: Sampled<COORDINATES>) -> Self {
        self.samples = Some(Arc::new(samples));
        self
    }

    /// The samples along which the axes go behind its end.
    #[must_use]
    pub fn samples(&self) -> Option<&Arc<Sampled<COORDINATES>>> {
        self.samples.as_ref()
    }

    /// Interprets the whole program from `start` without moving anything.
    ///
    /// # Errors
    /// Every block that cannot be run.
    pub fn check(&self, start: Position) -> Result<Extent, ProgramError> {
        let (mut interpreter, entry) = self.interpret(start)?;
        if self.stream {
            return Ok(Extent {
                sets_tables: true,
                ..Extent::default()
            });
        }
        let begins_at = entry.map_or(start, |entry| entry.at.0);
        let mut source = MoveSource::new(begins_at, self.point_to_point);
        let mut extent = Extent::default();
        let mut mistakes = Mistakes::default();
        while let Some(command) = interpreter.next() {
            let command = match command {
                Ok(command) => command,
                Err(error) => {
                    let goes_on = interpreter.go_on(&error);
                    if mistakes.add(error) && goes_on {
                        continue;
                    }
                    break;
                }
            };
            // Where nothing moves, axes are homed at once.
            if let Action::Home { to, .. } = command.action {
                interpreter.homed(to);
                source.homed(to.0);
            }
            if !mistakes.is_empty() {
                continue;
            }
            if let Action::Arc { arc, .. } = &command.action
                && arc.deviation > extent.arc_deviation.0
            {
                extent.arc_deviation = (arc.deviation, command.span.line);
            }
            let beside = source.point_to_point(&command.action, 1.0);
            beside.map_err(|mixed| mixed.at(place(&interpreter, command.span)))?;
            let no_curve = |source| ProgramError::Curve {
                place: place(&interpreter, command.span),
                source,
            };
            let curves = source.curves(&command).map_err(no_curve)?;
            if let Action::Thread { to, lead } | Action::Tap { to, lead } = command.action {
                let line = source.line(to.0).map_err(no_curve)?;
                let spindle = interpreter.modes().spindle;
                let taps = matches!(command.action, Action::Tap { .. });
                let thread = self.threads.thread(0, &line, lead, taps, spindle);
                thread.map_err(|source| ProgramError::Thread {
                    place: place(&interpreter, command.span),
                    source,
                })?;
                extent.length += line.length();
                if taps {
                    extent.length += line.length();
                } else {
                    source.go_on_from(line.end());
                }
            }
            let mode = interpreter.modes().path_mode;
            let mode = path_control_mode(mode, self.tolerances, 1.0);
            if let (Action::Arc { arc, .. }, Some((spread, method))) =
                (&command.action, &self.shaper)
                && is_by_coordinates(*method, mode)
            {
                let (_, spare) = mode.shared(self.tolerances.exact);
                let arc = (arc, &command.action);
                if let Some(part) = slowed(arc, &curves, &self.limits, spread, spare) {
                    extent.slowed.add(command.span.line, part);
                }
            }
            if let Some(part) = feed::reached(&curves, &command.action, &self.limits) {
                extent.capped.add(command.span.line, part);
            }
            for curve in &curves {
                match counted_length(curve) {
                    (length, false) => extent.length += length,
                    (angle, true) => extent.turned += angle,
                }
            }
        }
        if !mistakes.is_empty() {
            mistakes.without_tables(self.no_tables.as_deref());
            return Err(ProgramError::Blocks(mistakes));
        }
        extent.blocks = interpreter.executed();
        // Behind a probing, and what reads inputs, nothing is known before the machine has been there.
        extent.known_to = interpreter.awaits_machine().then(|| interpreter.line());
        let changed = *interpreter.tables() != self.setup.tables;
        extent.sets_tables = changed || interpreter.awaits_machine();
        Ok(extent)
    }

    /// As the one job that a machine is switched on for.
    #[must_use]
    pub fn only_job(&self) -> Job {
        Job {
            is_entered: self.is_entered(),
            waits_for_input: self.streams(),
            homes_first: self.homes_first(),
            ..Job::ONLY
        }
    }

    /// Whether it begins in its middle.
    #[must_use]
    pub fn is_entered(&self) -> bool {
        self.entered.is_some()
    }

    /// Has the program begin with these outputs, and with this coolant running.
    pub fn begin_with(&mut self, outputs: gcode::Outputs, coolant: gcode::Coolant) {
        (self.setup.outputs, self.setup.coolant) = (outputs, coolant);
    }

    /// Whether somebody said that nobody wants the program any more.
    #[must_use]
    pub fn is_abandoned(&self) -> bool {
        self.setup.abandoned.load(Ordering::Relaxed)
    }

    /// The same program for somebody else, who may abandon it alone.
    #[must_use]
    pub fn apart(&self) -> Self {
        let mut apart = self.clone();
        (apart.setup.abandoned, apart.setup.read) = (Arc::default(), Arc::default());
        apart.answers = Answers::of(self.answers.so_far());
        apart
    }

    /// Nobody wants the program any more: whoever reads it, in whatever thread, goes no further
    /// than the end of a block.
    pub fn abandon(&self) {
        self.setup.abandoned.store(true, Ordering::Relaxed);
    }

    /// Where the machine is brought to before the interpreter's first command, if not to the program's beginning.
    fn interpret(
        &self,
        here: Position,
    ) -> Result<(Interpreter, Option<gcode::Entry>), ProgramError> {
        let mut setup = self.setup.clone();
        setup.start = gcode::Point(match self.entered {
            Some(Entered::At { start, .. }) => start,
            _ => here,
        });
        if let Some(interrupted) = &self.beside {
            setup.memory = interrupted.memory()?;
        }
        let mut interpreter = match &self.source {
            Source::File(file) => Interpreter::open(file, setup)?,
            Source::Lines(text) => Interpreter::from_text("MDI", text.as_str(), setup),
            Source::Setting(setting) => {
                Interpreter::from_text("MDI", setting.lines(&setup.memory), setup)
            }
            Source::Text(name, text) => {
                Interpreter::new(name.as_str(), Cursor::new(Arc::clone(text)), setup)
            }
        };
        let entry = match self.entered {
            None => None,
            Some(Entered::AtLine(line)) => Some(interpreter.enter_at_line(line)?),
            Some(Entered::At { place, now, .. }) => {
                let answers = self.answers.so_far();
                Some(interpreter.enter_at(&place, gcode::Point(here), &now, &answers)?)
            }
        };
        Ok((interpreter, entry))
    }
}

/// File, line and column of a command.
fn place(interpreter: &Interpreter, span: gcode::Span) -> String {
    let file = interpreter.file(span.file);
    format!("{file}:{}:{}", span.line, span.columns.start)
}
