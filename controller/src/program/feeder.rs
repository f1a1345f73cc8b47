//! A running program: its commands pushed into the planner, the planner's handed out as instructions.

mod opening;
mod searches;

use super::answers::Answers;
use super::feed::{feed, programmed_speed};
use super::moves::{MoveSource, ON_THE_PATH, ProgramMove, Step, Upcoming, path_control_mode};
use super::shaped::is_by_coordinates;
use super::threads::Threads;
use super::{Entered, Left, Program, ProgramError, Scale, UserCodes, place};
use crate::control::functions::SWITCHES;
use crate::control::{
    InputWait, Instruction, Pause, Signal, SignalLevels, StopPoint, Switch, UserCall,
};
use crate::machine::{COORDINATES, InputMeaning, PathTolerances, Position, SpinUp};
use opening::{Opening, turns};
use std::collections::VecDeque;
use std::mem::take;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use syncline_gcode::{self as gcode, Action, Interpreter, Tables, TablesError};
use syncline_trajectory::limits::PositionLimits;
use syncline_trajectory::path::{
    Command as PathCommand, Curve, Feed, Limits, Move, PathControlMode, PathItem, Planner,
    ReplanRequest,
};
use syncline_trajectory::shaper::{Method, Spread};

/// Marks that can come up again when the path is planned anew: more than the planner keeps.
const MOST_MARKS: usize = 2 * Planner::<COORDINATES>::KEPT;

/// Where so many commits lie before the machine, and more moves than that besides, the program is not read on. Commits
/// are what the motion needs, whatever lies in them; the moves are what it costs to wait longer than that.
const COMMITS_AHEAD: usize = 4;
const MOVES_AHEAD: u32 = 16_384;

/// A running program: hands out one [`Instruction`] after the other.
pub struct Feeder {
    interpreter: Interpreter,
    /// What comes before the interpreter's commands.
    opening: VecDeque<Opening>,
    /// The line at which the program is begun in its middle.
    entered: u32,
    /// Where the command is that is taken, and where the next one is.
    here: gcode::Place,
    next: gcode::Place,
    /// The tables as they were at the start.
    tables: Tables,
    source: MoveSource,
    planner: Planner<COORDINATES>,
    limits: Limits<COORDINATES>,
    bounds: [PositionLimits; COORDINATES],
    /// Probings, homings and threads so far.
    searches: u32,
    /// The machine is on a thread, or before it.
    awaits_thread: bool,
    /// What tells the cycle of the next one, or that the plan goes on behind the last one.
    search: Option<Instruction<COORDINATES>>,
    /// Readings of inputs and outputs so far.
    readings: u32,
    /// What the machine has answered so far.
    answers: Answers,
    /// What the last command waits for, if it was an M66, and its line.
    awaited: Option<(gcode::InputWait, u32)>,
    /// What can be read, in the interpreter's order.
    signals: Arc<[Signal]>,
    path_control_mode: PathControlMode,
    tolerances: PathTolerances,
    scale: Scale,
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
    threads: Threads,
    user_codes: UserCodes,
    /// How far a shaper spreads setpoints, and by what method, where that is not each mode's own.
    shaper: Option<(Spread, Option<Method>)>,
    /// What is switched with the next motion.
    with_motion: Vec<(u32, Switch)>,
    upcoming: Upcoming,
    /// Of the next move.
    tag: u32,
    /// Of the last path segment that was handed out, and of the last before each of the last commits, the oldest first.
    handed_out: u32,
    committed: VecDeque<u32>,
    ended: bool,
}

/// Behind so many commands, of which nothing else is known.
fn nth(passed: u64) -> gcode::Place {
    gcode::Place {
        passed,
        known: None,
    }
}

/// A planner at the beginning of a path.
fn planner(
    limits: Limits<COORDINATES>,
    bounds: [PositionLimits; COORDINATES],
    start: Position,
    shaped: Option<(Spread, Option<Method>, f64)>,
) -> Planner<COORDINATES> {
    let mut planner = Planner::new(limits, start);
    planner.keep_within(bounds);
    if let Some((spread, method, exact)) = shaped {
        planner.shape_by(spread, method, exact);
    }
    planner
}

impl Program {
    /// Starts the program from `start`; its moves and switches go to `upcoming` before they come in
    /// an instruction.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn feeder(&self, start: Position, upcoming: Upcoming) -> Result<Feeder, ProgramError> {
        let bounds = self.setup.limits.map(|limits| {
            let (min, max) = limits.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
            PositionLimits { min, max }
        });
        let tolerances = PathTolerances {
            exact: self.tolerances.exact * self.scale.tolerance,
            blend: self.tolerances.blend * self.scale.tolerance,
        };
        let (interpreter, entry) = self.interpret(start)?;
        self.answers
            .keep(entry.as_ref().map_or(0, |entry| entry.answered));
        // Maybe the spindle was still on its way to its speed.
        let spins_up = entry.as_ref().is_some_and(turns);
        let (begun, next) = match self.entered {
            Some(Entered::At { start, place, .. }) => (start, place),
            _ => (start, nth(interpreter.passed())),
        };
        upcoming.tell(Step::Begin(begun, next));
        Ok(Feeder {
            tables: self.setup.tables.clone(),
            here: next,
            next,
            opening: self.opening(start, &interpreter, entry.as_ref()),
            entered: self.entered.map_or(0, |entered| entered.line().0),
            interpreter,
            source: MoveSource::new(start, self.point_to_point),
            planner: planner(
                self.limits,
                bounds,
                start,
                (self.shaper).map(|(spread, method)| (spread, method, tolerances.exact)),
            ),
            limits: self.limits,
            bounds,
            searches: 0,
            awaits_thread: false,
            search: None,
            readings: 0,
            answers: self.answers.clone(),
            awaited: None,
            signals: Arc::clone(&self.signals),
            path_control_mode: path_control_mode(
                self.setup.memory.modes().path_mode,
                tolerances,
                self.scale.tolerance,
            ),
            tolerances,
            scale: self.scale,
            keeps: self.keeps.clone(),
            marks: VecDeque::new(),
            first_mark: 0,
            switches: VecDeque::new(),
            since_stop: 0,
            spins_up,
            spindle: self.spindle,
            threads: self.threads,
            user_codes: Arc::clone(&self.user_codes),
            shaper: self.shaper,
            with_motion: Vec::new(),
            upcoming,
            tag: 0,
            handed_out: 0,
            committed: VecDeque::with_capacity(COMMITS_AHEAD + 1),
            ended: false,
        })
    }
}

impl Feeder {
    /// The next instruction; after [`StopPoint::End`] or [`StopPoint::Broken`] none, behind a probing, a homing or a thread,
    /// and where inputs are read, none before it is known what came of it ([`Feeder::found`], [`Feeder::signals_read`]),
    /// and none for now where enough lies before the machine.
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
            if let Some(search) = self.search.take() {
                return Ok(Some(search));
            }
            while let Some(end) = self.planner.move_end() {
                self.upcoming.tell(Step::End(end));
            }
            if let Some(command) = self.planner.pop() {
                self.count(&command);
                return Ok(Some(self.instruction(command)));
            }
            if self.ended || self.awaits_machine() || self.is_far_ahead() {
                return Ok(None);
            }
            let taken = if let Some(opening) = self.opening.pop_front() {
                self.open(opening)
            } else if let Some(command) = self.interpreter.next() {
                self.await_input(command.as_ref().ok().map(|command| &command.action));
                let command = command.map_err(ProgramError::from);
                command.and_then(|command| self.take_next(&command))
            } else {
                self.await_input(None);
                self.stop_then(StopPoint::End);
                self.ended = true;
                continue;
            };
            if let Err(error) = taken {
                self.stop_then(StopPoint::Broken);
                self.ended = true;
                return Err(error);
            }
        }
    }

    fn count(&mut self, command: &PathCommand<COORDINATES>) {
        match command {
            PathCommand::PathSegment(segment) => self.handed_out = segment.tag,
            PathCommand::Commit => {
                if self.committed.len() == COMMITS_AHEAD {
                    self.committed.pop_front();
                }
                self.committed.push_back(self.handed_out);
            }
            _ => {}
        }
    }

    /// Whether the machine has so much before it that the program need not be read on: a program's moves are kept
    /// from when they are read until they are passed.
    fn is_far_ahead(&self) -> bool {
        let (Some(first), Some(&oldest)) = (self.upcoming.first(), self.committed.front()) else {
            return false;
        };
        self.committed.len() == COMMITS_AHEAD && oldest > first + MOVES_AHEAD
    }

    /// Takes the program's next command.
    fn take_next(&mut self, command: &gcode::Command) -> Result<(), ProgramError> {
        let passed = self.interpreter.passed();
        let known = Some((passed - 1, command.span.line));
        self.here = gcode::Place {
            passed: passed - 1,
            known,
        };
        self.next = gcode::Place { passed, known };
        self.take(command)
    }

    fn take(&mut self, command: &gcode::Command) -> Result<(), ProgramError> {
        let line = command.span.line;
        let beside = self.source.point_to_point(&command.action, self.scale.feed);
        let beside = beside.map_err(|mixed| mixed.at(place(&self.interpreter, command.span)))?;
        let curves = self.source.curves(command);
        let curves = curves.map_err(|source| ProgramError::Curve {
            place: place(&self.interpreter, command.span),
            source,
        })?;
        if !curves.is_empty() {
            self.take_curves(curves, command)?;
        }
        if let Some(motion) = beside {
            self.switch_with_motion();
            self.stop_then(StopPoint::PointToPoint { motion, line });
        }
        match &command.action {
            Action::Rapid { .. } => {
                // It has led to where the spindle is to be faster, or slower.
                let spindle = self.interpreter.modes().spindle;
                let turns = spindle.turning != gcode::Turning::Off;
                self.spins_up |= spindle.surface.is_some() && turns;
            }
            Action::Dwell { seconds } => self.rest(*seconds + self.settling(), command.span)?,
            Action::Stop(stop) => self.take_stop(*stop, line),
            Action::AwaitInput(wait) => self.awaited = Some((*wait, line)),
            Action::TakeInput(input) => {
                let input = *input;
                self.stop_then(StopPoint::TakeInput { input, line });
            }
            Action::Probe { to, feed, probe } => {
                self.take_probe(to.0, *feed, *probe, command.span)?;
            }
            Action::Thread { to, lead } => self.take_thread(to.0, *lead, false, command.span)?,
            Action::Tap { to, lead } => self.take_thread(to.0, *lead, true, command.span)?,
            Action::Home { axes, .. } => self.take_home(*axes, line),
            Action::ReadSignals { .. } => {
                self.readings += 1;
                let number = self.readings;
                self.stop_then(StopPoint::ReadSignals { number, line });
            }
            Action::Message(text) => self.tell(line, text.clone()),
            Action::ToolLoaded(tool) => self.switch(line, Switch::Tool(*tool)),
            Action::Spindle(spindle) => {
                self.spins_up = spindle.turning != gcode::Turning::Off;
                self.switch(line, Switch::Spindle(*spindle));
                if spindle.orientation.is_some() {
                    self.stop_then(StopPoint::Orient { line });
                }
            }
            Action::Coolant(coolant) => self.switch(line, Switch::Coolant(*coolant)),
            Action::Output(output) if output.is_with_motion() => {
                self.with_motion.push((line, Switch::Output(*output)));
            }
            Action::Output(output) => {
                self.switch(line, Switch::Output(*output));
                self.run_user_code(*output, line);
            }
            Action::PathMode(mode) => {
                self.path_control_mode =
                    path_control_mode(*mode, self.tolerances, self.scale.tolerance);
            }
            Action::End => self.take_end(line),
            _ => {}
        }
        self.ended |= command.action == Action::End;
        Ok(())
    }

    /// A stop that an operator ends; a tool is told by its name.
    fn take_stop(&mut self, stop: gcode::Stop, line: u32) {
        let reason = match stop {
            gcode::Stop::Program => Pause::ProgramStop,
            gcode::Stop::Optional => Pause::OptionalStop,
            gcode::Stop::ToolChange { tool } => Pause::ToolChange(tool),
        };
        if let gcode::Stop::ToolChange { tool } = stop {
            let tools = &self.interpreter.tables().tools;
            let name = tools.get(&tool).map(|tool| tool.name.clone());
            if let Some(name) = name.filter(|name| !name.is_empty()) {
                self.tell(line, format!("tool {tool}: {name}"));
            }
            self.switch(line, Switch::Tool(tool));
        }
        self.stop_then(StopPoint::Pause { reason, line });
    }

    /// The end of a program switches off, that of typed lines does not.
    fn take_end(&mut self, line: u32) {
        let before = self.interpreter.modes().clone();
        let left = self.interpreter.memory();
        if left.modes().spindle != before.spindle {
            self.switch(line, Switch::Spindle(left.modes().spindle));
        }
        if left.modes().coolant != before.coolant {
            self.switch(line, Switch::Coolant(left.modes().coolant.into()));
        }
        self.stop_then(StopPoint::End);
    }

    /// Goes on behind a reading of inputs and outputs with what they are; those of another one change nothing.
    pub fn signals_read(&mut self, levels: &SignalLevels) {
        if self.interpreter.awaits_signals() && levels.number == self.readings {
            let signals = self.signals.iter().map(|&signal| levels.of(signal));
            let signals: Vec<f64> = signals.collect();
            let input_result = levels.input_result;
            self.answers.push(gcode::Answer::Signals {
                signals: signals.clone(),
                input_result,
            });
            self.interpreter.signals_read(signals, input_result);
        }
    }

    /// Goes along the curves of one motion, from each to the next without a stop.
    fn take_curves(
        &mut self,
        curves: Vec<Curve<COORDINATES>>,
        command: &gcode::Command,
    ) -> Result<(), ProgramError> {
        let feed = feed(&command.action);
        if feed.is_some() && take(&mut self.spins_up) {
            self.await_spindle(command.span)?;
        }
        self.switch_with_motion();
        let length: f64 = curves.iter().map(Curve::length).sum();
        let last = curves.len() - 1;
        for (index, curve) in curves.into_iter().enumerate() {
            let mode = match self.path_control_mode {
                PathControlMode::Stop if index < last => {
                    PathControlMode::Exact(self.tolerances.exact)
                }
                mode => mode,
            };
            let feed = match feed {
                Some(feed) => {
                    let speed = self.scale.feed * programmed_speed(&curve, feed, length);
                    match feed {
                        gcode::Feed::PerTurn { turns, .. } => Feed::PerTurn {
                            travel: speed / turns,
                            turns,
                        },
                        gcode::Feed::Rate(_) | gcode::Feed::Duration(_) => Feed::Rate(speed),
                    }
                }
                None => Feed::Rapid,
            };
            let item = PathItem::Move(Move {
                curve,
                feed,
                mode,
                tag: self.tag,
            });
            self.upcoming.tell_modal(self.tag, &self.interpreter);
            self.tag += 1;
            let tolerance = match self.shaper {
                Some((_, method)) if is_by_coordinates(method, mode) => {
                    let (planned, spare) = mode.shared(self.tolerances.exact);
                    planned.tolerance() + spare
                }
                _ => mode.tolerance().max(ON_THE_PATH),
            };
            (self.upcoming).tell(Step::Move(ProgramMove::new(
                command.span.line,
                self.here,
                curve,
                tolerance,
            )));
            self.push(command.span, item)?;
        }
        Ok(())
    }

    /// Before the next action of the program, if there is one, the path rests for the input of the M66 before it, if that was
    /// one.
    fn await_input(&mut self, next: Option<&Action>) {
        let Some((wait, line)) = self.awaited.take() else {
            return;
        };
        let wait = InputWait {
            input: InputMeaning::Program(wait.number),
            until: wait.until,
            within: wait.within,
        };
        let asks = matches!(next, Some(Action::ReadSignals { input_result: true }));
        self.stop_then(StopPoint::AwaitInput { wait, asks, line });
    }

    /// The path rests until the spindle has its speed.
    fn await_spindle(&mut self, span: gcode::Span) -> Result<(), ProgramError> {
        match self.spindle {
            SpinUp::Unknown => Ok(()),
            SpinUp::After(ramp) => self.rest(ramp.as_secs_f64().max(self.settling()), span),
            SpinUp::Told { within } => {
                let wait = InputWait {
                    input: InputMeaning::AtSpeed,
                    until: gcode::Until::High,
                    within,
                };
                let line = span.line;
                let asks = false;
                self.stop_then(StopPoint::AwaitInput { wait, asks, line });
                Ok(())
            }
        }
    }

    /// Where the machine has a command for an M-code of the user's the path rests until that has ended.
    fn run_user_code(&mut self, output: gcode::Output, line: u32) {
        let gcode::Output::User { code, p, q } = output else {
            return;
        };
        let known = self.user_codes.iter().find(|(known, _)| *known == code);
        if let Some(&(_, within)) = known {
            let call = UserCall { code, p, q };
            self.stop_then(StopPoint::UserCode { call, within, line });
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

    /// What waited for the next motion.
    fn switch_with_motion(&mut self) {
        for (line, switch) in take(&mut self.with_motion) {
            self.switch(line, switch);
        }
    }

    /// What the operator is told once the path has come here. The cycle only counts messages.
    fn tell(&mut self, line: u32, text: String) {
        self.upcoming.tell(Step::Message(text));
        self.switch(line, Switch::Message);
    }

    /// Rests for so many seconds, for that block.
    fn rest(&mut self, duration: f64, span: gcode::Span) -> Result<(), ProgramError> {
        let tag = self.tag.saturating_sub(1);
        let block = Some(span.line);
        self.push(
            span,
            PathItem::Dwell {
                duration,
                tag,
                block,
            },
        )
    }

    /// How far a shaper spreads setpoints, by what method, and by how much it may leave moves that end at rest, mm.
    fn shaped(&self) -> Option<(Spread, Option<Method>, f64)> {
        let exact = self.tolerances.exact;
        self.shaper.map(|(spread, method)| (spread, method, exact))
    }

    /// By how much the axes come to rest later than the path, s.
    fn settling(&self) -> f64 {
        self.shaper.map_or(0.0, |(spread, _)| spread.settling)
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
        let rests = match stop {
            StopPoint::Pause { line, .. } => Some((line, self.next)),
            _ => stop.works_on().map(|line| (line, self.here)),
        };
        if let Some((line, place)) = rests {
            (self.upcoming).tell_stop(self.tag, line, place, &self.interpreter);
        }
        if self.marks.len() == MOST_MARKS {
            self.marks.pop_front();
            self.first_mark += 1;
        }
        self.marks.push_back(stop);
        let mark = self.first_mark + self.marks.len() as u32 - 1;
        match stop {
            StopPoint::PointToPoint { .. } => self.planner.one_way_mark(mark),
            _ => self.planner.mark(mark),
        }
    }

    /// Plans the rest of the program anew where the executor wants that; the instructions of the
    /// new plan come next. A request that was answered is passed over; false then.
    pub fn replan(&mut self, request: &ReplanRequest) -> bool {
        let answered = self.planner.replan(request);
        if answered {
            self.committed.clear();
        }
        answered
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

    /// Writes back the offsets and tools that the program set.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save_tables(&self, file: &Path) -> Result<(), TablesError> {
        self.interpreter.save_tables(file, &self.tables)
    }
}
