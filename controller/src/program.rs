//! A part program on its way into the cycle: interpreted, turned into curves, planned.
//!
//! ```text
//! file ──► gcode::Interpreter ──► Feeder ──► path::Planner ──► Instruction, to the controller
//!                                   └──► Moves, to who follows the machine along the program
//! ```
//!
//! The plan's coordinates are the letters X Y Z A B C U V W, whatever axes the machine has.

use crate::control::functions::SWITCHES;
use crate::control::{InputWait, Instruction, Pause, StopPoint, Switch};
use crate::machine::{COORDINATES, InputMeaning, Machine, PathTolerances, Position, SpinUp};
use crossbeam::channel::{self, Receiver, Sender};
use std::collections::VecDeque;
use std::fmt;
use std::mem::take;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use syncline_gcode::{self as gcode, Action, AxisSet, Interpreter, PathMode, Tables, TablesError};
use syncline_trajectory::limits::PositionLimits;
use syncline_trajectory::path::curve::ArcDefinition;
use syncline_trajectory::path::segment_fitting::MoveEnd;
use syncline_trajectory::path::{
    Command as PathCommand, Curve, CurveError, Feed, Limits, Move, PathControlMode, PathError,
    PathItem, Plane, Planner, ReplanRequest,
};

/// Rounding of a setpoint on a curve, mm.
const ON_THE_PATH: f64 = 1e-9;

/// What all programs of a machine have in common: axes, limits, tables, and what the programs before
/// have left.
#[derive(Clone, Debug)]
pub struct Programs {
    setup: gcode::Setup,
    limits: Limits<COORDINATES>,
    tolerances: PathTolerances,
    spindle: SpinUp,
    /// Where what a program changes in the tables is written at its end.
    keeps: Option<PathBuf>,
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
}

/// Operator switches and the place a program starts from.
#[derive(Clone, Debug)]
pub struct Program {
    source: Source,
    setup: gcode::Setup,
    limits: Limits<COORDINATES>,
    tolerances: PathTolerances,
    keeps: Option<PathBuf>,
    spindle: SpinUp,
    /// Begin there instead of at the beginning.
    from_line: Option<u32>,
    /// Not interpreted as a whole before it runs.
    stream: bool,
}

/// One programmed move, as recorders and checkers need it.
#[derive(Clone, Debug)]
pub struct ProgramMove {
    /// Program line.
    pub line: u32,
    /// Its geometry, machine coordinates.
    pub curve: Curve<COORDINATES>,
    /// How far the path may leave it, mm.
    pub tolerance: f64,
    /// Where it ends along the path, mm from the beginning, if that is in the midst of a curve: of one that
    /// stands for many moves, or of a rounding.
    pub end: Option<f64>,
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
    /// The greatest change of an arc that was made for its ends to be exact, mm, and its line.
    pub arc_deviation: (f64, u32),
}

/// How many mistakes of a program are told, and of how many lines of the same one.
const MOST_MISTAKES: usize = 50;
const MOST_LINES: usize = 12;

/// A mistake of a program, and where it is made again.
#[derive(Debug)]
pub struct Mistake {
    first: gcode::Error,
    lines: Vec<u32>,
    more: u64,
}

/// All mistakes of a program, in the order in which they are met.
#[derive(Debug, Default)]
pub struct Mistakes(Vec<Mistake>);

impl Mistakes {
    /// Adds a mistake; `false` if no more can be told.
    fn add(&mut self, error: gcode::Error) -> bool {
        // Numbers aside, the same message is the same mistake.
        let kind = |error: &gcode::Error| {
            let text = error.fault.to_string();
            text.replace(|c: char| c.is_ascii_digit() || "-.".contains(c), "")
        };
        let known = kind(&error);
        let same = |mistake: &&mut Mistake| {
            mistake.first.file == error.file && kind(&mistake.first) == known
        };
        match self.0.iter_mut().find(same) {
            Some(mistake) if mistake.lines.len() < MOST_LINES => mistake.lines.push(error.line),
            Some(mistake) => mistake.more += 1,
            None => self.0.push(Mistake {
                first: error,
                lines: Vec::new(),
                more: 0,
            }),
        }
        self.0.len() < MOST_MISTAKES
    }
}

impl fmt::Display for Mistakes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut separator = "";
        for mistake in &self.0 {
            write!(f, "{separator}{}", mistake.first)?;
            separator = "\n";
            if mistake.lines.is_empty() {
                continue;
            }
            let lines: Vec<String> = mistake.lines.iter().map(u32::to_string).collect();
            write!(f, "\n  the same in line {}", lines.join(", "))?;
            if mistake.more > 0 {
                write!(f, " and {} more", mistake.more)?;
            }
        }
        if self.0.len() == MOST_MISTAKES {
            f.write_str("\nfurther mistakes are not told: correct these first")?;
        }
        Ok(())
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
    /// A move cannot be planned.
    #[error("{place}: this move cannot be planned")]
    Plan {
        /// File, line and column.
        place: String,
        /// Why.
        source: PathError,
    },
}

impl Programs {
    /// For a machine, with the tables beside its file.
    ///
    /// # Errors
    /// The tables cannot be used.
    pub fn new(machine: &Machine, machine_file: &Path) -> Result<Self, TablesError> {
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
        setup.spindle_speeds = machine.spindle.map(|spindle| spindle.speeds);
        for input in &machine.inputs {
            if let InputMeaning::Program(number) = input.meaning {
                setup.inputs |= 1 << number;
            }
        }
        setup.tables = Tables::load(&Tables::beside(machine_file))?;
        Ok(Self {
            setup,
            limits,
            tolerances: machine.path,
            spindle: SpinUp::of(machine),
            keeps: None,
        })
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
        self.program(Source::File(file.to_owned()))
    }

    /// Lines that were typed in: where they end the modal state goes on.
    #[must_use]
    pub fn lines(&self, text: &str) -> Program {
        let mut program = self.program(Source::Lines(text.to_owned()));
        program.setup.typed = true;
        program
    }

    fn program(&self, source: Source) -> Program {
        let mut setup = self.setup.clone();
        setup.abandoned = Arc::default();
        Program {
            source,
            setup,
            limits: self.limits,
            tolerances: self.tolerances,
            keeps: self.keeps.clone(),
            spindle: self.spindle,
            from_line: None,
            stream: false,
        }
    }

    /// What the programs so far have left.
    #[must_use]
    pub fn memory(&self) -> &gcode::Memory {
        &self.setup.memory
    }

    /// What lies between program and machine coordinates, mm and degrees.
    #[must_use]
    pub fn offset(&self) -> Position {
        self.setup.memory.offset(&self.setup.tables).0
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

    /// Typed lines were stopped, which switches spindle and coolant off: what they set is forgotten, but
    /// for the tool that is in the spindle.
    pub fn stop(&mut self, tool: u32) {
        self.setup.memory.stop();
        self.setup.memory.tool_is(tool);
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
        self.from_line = line;
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

    /// What the line to begin at finds, for a person to confirm; `None` for the whole program.
    ///
    /// # Errors
    /// The first block that cannot be run, or no such line.
    pub fn beginning(&self, start: Position) -> Result<Option<Beginning>, ProgramError> {
        let Some(line) = self.from_line else {
            return Ok(None);
        };
        let interpreter = self.interpret(start)?;
        Ok(Some(Beginning {
            line,
            modes: interpreter.modes().clone(),
            axes: self.setup.axes,
            position: interpreter.position(),
        }))
    }

    /// Interprets the whole program from `start` without moving anything.
    ///
    /// # Errors
    /// Every block that cannot be run.
    pub fn check(&self, start: Position) -> Result<Extent, ProgramError> {
        let mut interpreter = self.interpret(start)?;
        if self.stream {
            return Ok(Extent {
                sets_tables: true,
                ..Extent::default()
            });
        }
        let mut source = MoveSource { at: start };
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
            if !mistakes.0.is_empty() {
                continue;
            }
            if let Action::Arc { arc, .. } = &command.action
                && arc.deviation > extent.arc_deviation.0
            {
                extent.arc_deviation = (arc.deviation, command.span.line);
            }
            let motion = source.curve(&command);
            let motion = motion.map_err(|source| ProgramError::Curve {
                place: place(&interpreter, command.span),
                source,
            })?;
            match motion.map(|motion| counted_length(&motion.curve)) {
                Some((length, false)) => extent.length += length,
                Some((angle, true)) => extent.turned += angle,
                None => {}
            }
        }
        if !mistakes.0.is_empty() {
            return Err(ProgramError::Blocks(mistakes));
        }
        extent.blocks = interpreter.executed();
        extent.sets_tables = *interpreter.tables() != self.setup.tables;
        Ok(extent)
    }

    /// Whether somebody said that nobody wants the program any more.
    #[must_use]
    pub fn is_abandoned(&self) -> bool {
        self.setup.abandoned.load(Ordering::Relaxed)
    }

    /// Nobody wants the program any more: whoever reads it, in whatever thread, goes no further
    /// than the end of a block.
    pub fn abandon(&self) {
        self.setup.abandoned.store(true, Ordering::Relaxed);
    }

    /// Starts the program from `start`; its moves and switches go to `upcoming` before they come in
    /// an instruction.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn feeder(&self, start: Position, upcoming: Upcoming) -> Result<Feeder, ProgramError> {
        let mut planner = Planner::new(self.limits, start);
        planner.keep_within(self.setup.limits.map(|limits| {
            let (min, max) = limits.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
            PositionLimits { min, max }
        }));
        Ok(Feeder {
            tables: self.setup.tables.clone(),
            interpreter: self.interpret(start)?,
            source: MoveSource { at: start },
            planner,
            path_control_mode: path_control_mode(
                self.setup.memory.modes().path_mode,
                self.tolerances,
            ),
            tolerances: self.tolerances,
            keeps: self.keeps.clone(),
            marks: VecDeque::new(),
            first_mark: 0,
            switches: VecDeque::new(),
            since_stop: 0,
            spins_up: false,
            spindle: self.spindle,
            with_motion: Vec::new(),
            upcoming,
            tag: 0,
            ended: false,
        })
    }

    fn interpret(&self, start: Position) -> Result<Interpreter, ProgramError> {
        let mut setup = self.setup.clone();
        setup.start = gcode::Point(start);
        let mut interpreter = match &self.source {
            Source::File(file) => Interpreter::open(file, setup)?,
            Source::Lines(text) => Interpreter::from_text("MDI", text.as_str(), setup),
        };
        if let Some(line) = self.from_line {
            interpreter.start_at_line(line)?;
        }
        Ok(interpreter)
    }
}

/// The state in which a line in the middle of a program begins.
#[derive(Clone, Debug)]
pub struct Beginning {
    line: u32,
    modes: gcode::Modes,
    axes: AxisSet,
    position: gcode::Point,
}

impl fmt::Display for Beginning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {} begins with {}, at", self.line, self.modes)?;
        for axis in self.axes.iter() {
            write!(f, " {axis}{:.3}", self.position[axis])?;
        }
        f.write_str(" in machine coordinates")
    }
}

/// File, line and column of a command.
fn place(interpreter: &Interpreter, span: gcode::Span) -> String {
    let file = interpreter.file(span.file);
    format!("{file}:{}:{}", span.line, span.columns.start)
}

/// Turns motion commands into curves.
struct MoveSource {
    at: Position,
}

impl MoveSource {
    /// The move that a command asks for; `None` if it asks for none, or for one of no length.
    fn curve(&mut self, command: &gcode::Command) -> Result<Option<ProgramMove>, CurveError> {
        let line = command.span.line;
        let (curve, to) = match &command.action {
            Action::Rapid { to } | Action::Feed { to, .. } => (Curve::line(self.at, to.0), to.0),
            Action::Arc { arc, .. } => {
                let definition = ArcDefinition {
                    start: self.at,
                    end: arc.to.0,
                    plane: match arc.plane {
                        gcode::Plane::Xy => Plane::Xy,
                        gcode::Plane::Zx => Plane::Zx,
                        gcode::Plane::Yz => Plane::Yz,
                    },
                    centre: (arc.center[0], arc.center[1]),
                    clockwise: arc.direction() == gcode::Direction::Clockwise,
                    turns: arc.turns,
                };
                (Curve::arc(definition), arc.to.0)
            }
            _ => return Ok(None),
        };
        match curve {
            Ok(curve) => {
                self.at = to;
                Ok(Some(ProgramMove {
                    line,
                    curve,
                    tolerance: ON_THE_PATH,
                    end: None,
                }))
            }
            Err(CurveError::NoLength) => Ok(None),
            Err(source) => Err(source),
        }
    }
}

/// Marks that can come up again when the path is planned anew: more than the planner keeps.
const MOST_MARKS: usize = 2 * Planner::<COORDINATES>::KEPT;

/// A running program: hands out one [`Instruction`] after the other.
pub struct Feeder {
    interpreter: Interpreter,
    /// The tables as they were at the start.
    tables: Tables,
    source: MoveSource,
    planner: Planner<COORDINATES>,
    path_control_mode: PathControlMode,
    tolerances: PathTolerances,
    keeps: Option<PathBuf>,
    /// What the planner's marks stand for, from this one on.
    marks: VecDeque<StopPoint>,
    first_mark: u32,
    /// What is switched at the planner's waypoints, on its way into the cycle.
    switches: VecDeque<(u32, Switch)>,
    /// How many of them the path passes without a stop.
    since_stop: usize,
    /// The spindle's speed has changed since the last cut.
    spins_up: bool,
    spindle: SpinUp,
    /// What is switched with the next motion.
    with_motion: Vec<(u32, Switch)>,
    upcoming: Upcoming,
    /// Of the next move.
    tag: u32,
    ended: bool,
}

/// Takes the moves that come up in a program; [`Moves`] has them.
pub struct Upcoming(Sender<Step>);

/// What becomes known of a program.
#[allow(clippy::large_enum_variant)] // most are moves
enum Step {
    Move(ProgramMove),
    End(MoveEnd),
}

impl Upcoming {
    fn tell(&self, step: Step) {
        // Nobody following is fine.
        let _ = self.0.send(step);
    }
}

/// The moves of a running program that the machine has not passed yet.
pub struct Moves {
    coming: Receiver<Step>,
    moves: VecDeque<ProgramMove>,
    /// Tag of the first of `moves`.
    first: u32,
}

/// How moves are left in this mode.
fn path_control_mode(mode: PathMode, tolerances: PathTolerances) -> PathControlMode {
    match mode {
        PathMode::ExactStop => PathControlMode::Stop,
        PathMode::ExactPath => PathControlMode::Exact(tolerances.exact),
        PathMode::Blend { tolerance, merge } => {
            let tolerance = tolerance.unwrap_or(tolerances.blend);
            merge.map_or(PathControlMode::Blend(tolerance), |within| {
                PathControlMode::Merge { tolerance, within }
            })
        }
    }
}

/// Travel below this is rounding of the program's, mm or degrees.
const ROUNDING: f64 = 1e-7;

/// What F counts is the first of these that moves: X Y Z, U V W, A B C.
const COUNTED: [[usize; 3]; 3] = [[0, 1, 2], [6, 7, 8], [3, 4, 5]];

/// Which of [`COUNTED`] are degrees.
const TURNS: usize = 2;

/// What X Y Z, U V W and A B C move each.
#[must_use]
pub fn moved(change: &Position) -> [f64; 3] {
    COUNTED.map(|axes| {
        let squares = axes.map(|i| change[i] * change[i]);
        (squares[0] + squares[1] + squares[2]).sqrt()
    })
}

/// Of a velocity, the speed as F counts it, and whether that is of a turn: degrees, not mm.
#[must_use]
pub fn counted_speed(velocity: &Position) -> (f64, bool) {
    let groups = moved(velocity);
    let most = groups.into_iter().fold(0.0, f64::max);
    // The rounding of axes that rest is no movement.
    let counted = groups.iter().position(|speed| *speed > 1e-9 * most);
    counted.map_or((0.0, false), |group| (groups[group], group == TURNS))
}

/// The length of a move as F counts it, and whether it is that of a turn: degrees, not mm.
fn counted_length(curve: &Curve<COORDINATES>) -> (f64, bool) {
    let Curve::Line(_) = curve else {
        return (curve.length(), false);
    };
    let groups = moved(&change(curve));
    let counted = groups.iter().position(|travel| *travel > ROUNDING);
    counted.map_or((0.0, false), |group| (groups[group], group == TURNS))
}

fn change(curve: &Curve<COORDINATES>) -> Position {
    let (start, end) = (curve.start(), curve.end());
    std::array::from_fn(|i| end[i] - start[i])
}

/// The path speed at which a move has a programmed feed.
fn path_speed(curve: &Curve<COORDINATES>, feed: f64) -> f64 {
    let Curve::Line(_) = curve else {
        return feed;
    };
    let groups = moved(&change(curve));
    let fed = groups.into_iter().find(|travel| *travel > ROUNDING);
    match fed {
        Some(fed) if groups.iter().any(|other| *other > 0.0 && *other != fed) => {
            feed * curve.length() / fed
        }
        _ => feed,
    }
}

impl Feeder {
    /// As [`Planner::deepen`], before the first instruction.
    pub fn deepen(&mut self, times: u32) {
        self.planner.deepen(times);
    }

    /// The next instruction; after [`StopPoint::End`] or [`StopPoint::Broken`] none.
    ///
    /// # Errors
    /// The block that cannot be run. What was programmed before it still comes, and then
    /// [`StopPoint::Broken`].
    pub fn next_instruction(&mut self) -> Result<Option<Instruction<COORDINATES>>, ProgramError> {
        loop {
            // What is switched has to be there before the path comes to its place.
            if let Some((line, switch)) = self.switches.pop_front() {
                return Ok(Some(Instruction::Switch { line, switch }));
            }
            while let Some(end) = self.planner.move_end() {
                self.upcoming.tell(Step::End(end));
            }
            if let Some(command) = self.planner.pop() {
                return Ok(Some(self.instruction(command)));
            }
            if self.ended {
                return Ok(None);
            }
            let Some(command) = self.interpreter.next() else {
                self.stop_then(StopPoint::End);
                self.ended = true;
                continue;
            };
            let taken = command.map_err(ProgramError::from);
            if let Err(error) = taken.and_then(|command| self.take(&command)) {
                self.stop_then(StopPoint::Broken);
                self.ended = true;
                return Err(error);
            }
        }
    }

    fn take(&mut self, command: &gcode::Command) -> Result<(), ProgramError> {
        let line = command.span.line;
        let motion = self.source.curve(command);
        let motion = motion.map_err(|source| ProgramError::Curve {
            place: place(&self.interpreter, command.span),
            source,
        })?;
        if let Some(mut motion) = motion {
            let cuts = matches!(command.action, Action::Feed { .. } | Action::Arc { .. });
            if cuts && take(&mut self.spins_up) {
                self.await_spindle(command.span)?;
            }
            for (line, switch) in take(&mut self.with_motion) {
                self.switch(line, switch);
            }
            motion.tolerance = self.path_control_mode.tolerance().max(ON_THE_PATH);
            let feed = match &command.action {
                Action::Feed { feed, .. } | Action::Arc { feed, .. } => match *feed {
                    gcode::Feed::Rate(rate) => Feed::Rate(path_speed(&motion.curve, rate)),
                    gcode::Feed::Duration(seconds) => Feed::Rate(motion.curve.length() / seconds),
                },
                _ => Feed::Rapid,
            };
            let item = PathItem::Move(Move {
                curve: motion.curve,
                feed,
                mode: self.path_control_mode,
                tag: self.tag,
            });
            self.tag += 1;
            self.upcoming.tell(Step::Move(motion));
            return self.push(command.span, item);
        }
        match &command.action {
            Action::Dwell { seconds } => {
                let item = PathItem::Dwell {
                    duration: *seconds,
                    tag: self.tag.saturating_sub(1),
                };
                self.push(command.span, item)?;
            }
            Action::Stop(stop) => {
                let reason = match *stop {
                    gcode::Stop::Program => Pause::ProgramStop,
                    gcode::Stop::Optional => Pause::OptionalStop,
                    gcode::Stop::ToolChange { tool } => Pause::ToolChange(tool),
                };
                if let gcode::Stop::ToolChange { tool } = *stop {
                    self.switch(line, Switch::Tool(tool));
                }
                self.stop_then(StopPoint::Pause { reason, line });
            }
            Action::AwaitInput(wait) => {
                let wait = InputWait {
                    input: InputMeaning::Program(wait.number),
                    until: wait.until,
                    within: wait.within,
                };
                self.stop_then(StopPoint::AwaitInput { wait, line });
            }
            Action::ToolLoaded(tool) => self.switch(line, Switch::Tool(*tool)),
            Action::Spindle(spindle) => {
                self.spins_up = spindle.turning != gcode::Turning::Off;
                self.switch(line, Switch::Spindle(*spindle));
            }
            Action::Coolant(coolant) => self.switch(line, Switch::Coolant(*coolant)),
            Action::Output(output) if output.is_with_motion() => {
                self.with_motion.push((line, Switch::Output(*output)));
            }
            Action::Output(output) => self.switch(line, Switch::Output(*output)),
            Action::PathMode(mode) => {
                self.path_control_mode = path_control_mode(*mode, self.tolerances)
            }
            Action::End => {
                // The end of a program switches off, that of typed lines does not.
                let before = self.interpreter.modes().clone();
                let left = self.interpreter.memory();
                if left.modes().spindle != before.spindle {
                    self.switch(line, Switch::Spindle(left.modes().spindle));
                }
                if left.modes().coolant != before.coolant {
                    self.switch(line, Switch::Coolant(left.modes().coolant));
                }
                self.stop_then(StopPoint::End);
            }
            _ => {}
        }
        self.ended |= command.action == Action::End;
        Ok(())
    }

    /// The path rests until the spindle has its speed.
    fn await_spindle(&mut self, span: gcode::Span) -> Result<(), ProgramError> {
        match self.spindle {
            SpinUp::Unknown => Ok(()),
            SpinUp::After(ramp) => {
                let item = PathItem::Dwell {
                    duration: ramp.as_secs_f64(),
                    tag: self.tag.saturating_sub(1),
                };
                self.push(span, item)
            }
            SpinUp::Told { within } => {
                let wait = InputWait {
                    input: InputMeaning::AtSpeed,
                    until: gcode::Until::High,
                    within,
                };
                let line = span.line;
                self.stop_then(StopPoint::AwaitInput { wait, line });
                Ok(())
            }
        }
    }

    /// What is switched once the path has come here.
    fn switch(&mut self, line: u32, switch: Switch) {
        if self.since_stop == SWITCHES {
            self.stop_then(StopPoint::Rest);
        }
        self.since_stop += 1;
        self.switches.push_back((line, switch));
        self.planner.waypoint();
    }

    fn push(&mut self, span: gcode::Span, item: PathItem<COORDINATES>) -> Result<(), ProgramError> {
        self.planner
            .push(item)
            .map_err(|source| ProgramError::Plan {
                place: place(&self.interpreter, span),
                source,
            })
    }

    /// A command of the planner; its marks with what they stand for.
    fn instruction(&self, command: PathCommand<COORDINATES>) -> Instruction<COORDINATES> {
        let PathCommand::Mark { item, mark } = command else {
            return Instruction::Plan(command);
        };
        let index = mark.checked_sub(self.first_mark);
        let stop = index.and_then(|index| self.marks.get(index as usize));
        debug_assert!(stop.is_some(), "mark {mark} was forgotten");
        Instruction::Mark {
            item,
            mark,
            stop: stop.copied().unwrap_or(StopPoint::Broken),
        }
    }

    /// Comes to rest, then `stop`.
    fn stop_then(&mut self, stop: StopPoint) {
        self.since_stop = 0;
        if self.marks.len() == MOST_MARKS {
            self.marks.pop_front();
            self.first_mark += 1;
        }
        self.marks.push_back(stop);
        (self.planner).mark(self.first_mark + self.marks.len() as u32 - 1);
    }

    /// Plans the rest of the program anew where the executor wants that; the instructions of the
    /// new plan come next. A request that was answered is passed over; false then.
    pub fn replan(&mut self, request: &ReplanRequest) -> bool {
        self.planner.replan(request)
    }

    /// What the program has left, once it has finished; what it changed in the tables is written
    /// where that is wanted.
    ///
    /// # Errors
    /// The file cannot be written; what the program left counts all the same.
    pub fn finish(&self) -> (Left, Result<(), TablesError>) {
        let left = Left {
            memory: self.interpreter.memory(),
            tables: self.interpreter.tables().clone(),
        };
        let kept = (self.keeps.as_deref()).map_or(Ok(()), |file| self.save_tables(file));
        (left, kept)
    }

    /// Writes back the offsets and tools that the program changed.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save_tables(&self, file: &Path) -> Result<(), TablesError> {
        if *self.interpreter.tables() == self.tables {
            return Ok(());
        }
        self.interpreter.tables().save(file, &self.tables)
    }
}

impl Moves {
    /// None yet, and what takes them.
    #[must_use]
    pub fn new() -> (Upcoming, Self) {
        let (sender, coming) = channel::unbounded();
        let moves = Self {
            coming,
            moves: VecDeque::new(),
            first: 0,
        };
        (Upcoming(sender), moves)
    }

    /// Takes up what has come.
    pub fn take_up(&mut self) {
        for step in self.coming.try_iter() {
            match step {
                Step::Move(motion) => self.moves.push_back(motion),
                Step::End(MoveEnd { tag, at }) => {
                    let index = tag.checked_sub(self.first).map(|index| index as usize);
                    if let Some(motion) = index.and_then(|index| self.moves.get_mut(index)) {
                        motion.end = Some(at);
                    }
                }
            }
        }
    }

    /// The tag of the move at work where the path has come to `distance` under the `tag` of a setpoint: a
    /// curve that stands for many moves has the last one's, a rounding that of the move before it.
    #[must_use]
    pub fn at(&self, mut tag: u32, distance: f64) -> u32 {
        let end = |of: u32| self.motion(of)?.end;
        while let Some(before) = tag.checked_sub(1)
            && end(before).is_some_and(|end| end > distance)
        {
            tag = before;
        }
        while end(tag).is_some_and(|end| end <= distance) && self.motion(tag + 1).is_some() {
            tag += 1;
        }
        tag
    }

    /// The move behind a setpoint's tag, unless it was forgotten.
    #[must_use]
    pub fn motion(&self, tag: u32) -> Option<&ProgramMove> {
        self.moves.get(tag.checked_sub(self.first)? as usize)
    }

    /// Forgets the moves before `tag`.
    pub fn passed(&mut self, tag: u32) {
        while self.first < tag && self.moves.pop_front().is_some() {
            self.first += 1;
        }
    }
}
