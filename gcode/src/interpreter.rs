//! Lines in, canonical commands out.

use std::collections::VecDeque;
use std::fs::File;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

use super::Setup;
use super::axes::Point;
use super::block::Block;
use super::command::{Action, Command, Span};
use super::compensation::Compensation;
use super::coordinates::WorkCoordinates;
use super::entry::{Answer, Entry, InEffect, Passed, Place};
use super::error::{Error, Fault, Origin, Refusal};
use super::execute::{Continuation, State};
use super::flow::{At, Control};
use super::lexer::Columns;
use super::memory::Memory;
use super::modal::Modes;
use super::parameters::{INPUT_RESULT, InputResult};
use super::probe::Probed;
use super::read_ahead::{InBlock, ReadAhead};
use super::source::{Input, Lines, MAX_LINE, Read1};
use super::tables::Tables;

/// Interprets a program block by block: an iterator of its commands, with memory for one block.
///
/// The last command is [`Action::End`]; an error is the last item, and nothing of its block was
/// handed out before it. Behind [`Action::Probe`], [`Action::Home`] and [`Action::ReadSignals`] nothing comes before
/// it is known what came of that ([`probed`](Self::probed), [`homed`](Self::homed),
/// [`signals_read`](Self::signals_read)).
pub struct Interpreter {
    /// The program, then the files of subroutines that it called.
    pub(super) files: Vec<ProgramFile>,
    /// The file that is being read.
    pub(super) current: usize,
    /// Where files of subroutines are.
    pub(super) directory: Option<PathBuf>,
    pub(super) bytes: Vec<u8>,
    pub(super) block: Block,
    /// The line that `block` was read from.
    pub(super) line: u32,
    pub(super) state: State,
    pub(super) control: Control,
    /// What the block that is being executed asks for, in the program's own positions.
    pub(super) actions: VecDeque<Action>,
    pub(super) compensation: Option<Compensation>,
    /// What has ended, while the tool is still beside its contour.
    pub(super) left: Option<Compensation>,
    /// A block of a compensated contour was refused: nothing is known of the contour up to its G40.
    pub(super) contour_lost: bool,
    /// A block was refused, and what comes is not run.
    pub(super) mistaken: bool,
    /// What is wrong with blocks that were read over: it is told before the next is executed.
    pub(super) noted: VecDeque<Refusal>,
    /// Blocks are read that are not executed, up to the end of a branch, a loop or a subroutine.
    pub(super) reads_over: bool,
    /// A block was refused, behind which it is not known what comes next: the rest of its file is read and not executed.
    pub(super) only_read: bool,
    /// What is settled and not handed out.
    pending: VecDeque<Command>,
    read_ahead: ReadAhead,
    /// Where `pending` leads the machine.
    pub(super) settled_at: Point,
    executed: u64,
    /// M99 of the main program had it begin anew.
    pub(super) begins_anew: bool,
    /// Commands of the program that were handed out, or passed on the way to where it is begun.
    passed: u64,
    /// What those asked for: canned cycles ask for many moves each.
    asked: u64,
    /// Blocks since the machine moved or rested: a loop that does nothing is refused even while
    /// streaming.
    idle: u64,
    /// Where that left the machine.
    idle_at: Point,
    /// Whether something but blanks was read.
    pub(super) started: bool,
    /// Whether a block with more than comments was read.
    pub(super) words_seen: bool,
    /// Whether the program began with `%`.
    percent: bool,
    /// What was handed out, while it is not known what came of it.
    awaits: Option<Awaited>,
    /// What goes on once inputs and outputs are known.
    deferred: Option<Deferred>,
    /// M2, or what is as good.
    program_ended: bool,
    pub(super) ended: bool,
}

/// What a program cannot go on behind before it is known what came of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Awaited {
    Probing,
    Homing,
    /// What the inputs and outputs of the machine are.
    Signals,
}

/// What reads inputs and outputs of the machine, and waits for them.
pub(super) enum Deferred {
    /// The block, which begins there.
    Block(At),
    /// The condition of the block, an ELSEIF of the IF with this label, which stands there.
    Branch { label: String, columns: Columns },
}

/// A file and its name.
pub(super) struct ProgramFile {
    pub(super) name: String,
    pub(super) lines: Lines,
}

impl ProgramFile {
    pub(super) fn new(name: String, input: impl Input + 'static) -> ProgramFile {
        ProgramFile {
            name,
            lines: Lines::new(Box::new(input)),
        }
    }
}

impl Interpreter {
    /// A program in a file. Subroutines that it does not define are looked for beside it.
    ///
    /// # Errors
    /// The file cannot be opened.
    pub fn open(path: &Path, setup: Setup) -> Result<Interpreter, Error> {
        let name = path.display().to_string();
        match File::open(path) {
            Ok(file) => {
                let mut program = Interpreter::new(name, file, setup);
                program.directory = path.parent().map(Path::to_owned);
                Ok(program)
            }
            Err(error) => Err(Error {
                file: name,
                line: 1,
                columns: Columns { start: 1, end: 2 },
                block: String::new(),
                fault: Fault::Read(error),
            }),
        }
    }

    /// A program in memory.
    pub fn from_text(name: impl Into<String>, text: impl Into<String>, setup: Setup) -> Self {
        Interpreter::new(name, Cursor::new(text.into().into_bytes()), setup)
    }

    /// A program from anything that can be read and go back.
    pub fn new(name: impl Into<String>, input: impl Input + 'static, setup: Setup) -> Self {
        Interpreter {
            files: vec![ProgramFile::new(name.into(), input)],
            current: 0,
            directory: None,
            bytes: Vec::new(),
            block: Block::default(),
            line: 0,
            idle_at: setup.start,
            settled_at: setup.start,
            state: State::new(setup),
            control: Control::default(),
            actions: VecDeque::new(),
            compensation: None,
            left: None,
            contour_lost: false,
            mistaken: false,
            noted: VecDeque::new(),
            reads_over: false,
            only_read: false,
            pending: VecDeque::new(),
            read_ahead: ReadAhead::default(),
            executed: 0,
            begins_anew: false,
            passed: 0,
            asked: 0,
            idle: 0,
            started: false,
            words_seen: false,
            percent: false,
            awaits: None,
            deferred: None,
            program_ended: false,
            ended: false,
        }
    }

    /// The line that was read last.
    pub fn line(&self) -> u32 {
        self.line
    }

    /// The text of the block that was read last: of the last command, but under G41 and G42, where
    /// a block is known only with the one behind it.
    pub fn block(&self) -> &str {
        &self.block.text
    }

    /// The name of a file of the program by [`Span::file`].
    pub fn file(&self, index: u16) -> &str {
        self.files
            .get(usize::from(index))
            .map_or("", |file| &file.name)
    }

    /// The modal state after that block.
    pub fn modes(&self) -> &Modes {
        let ahead = self.read_ahead.at_work();
        ahead.map_or(&self.state.modes, |it| &it.modes)
    }

    /// How the program's coordinates lie in the machine after that block.
    pub fn coordinates(&self) -> WorkCoordinates {
        let ahead = self.read_ahead.at_work();
        ahead.map_or_else(|| self.state.coordinates(), |it| it.coordinates)
    }

    /// The programmed position after that block, machine coordinates.
    pub fn position(&self) -> Point {
        self.state.at
    }

    /// What comes next, as far as it is known.
    fn pending(&self) -> impl Iterator<Item = &Action> {
        self.pending.iter().map(|command| &command.action)
    }

    /// Whether what comes next is not known before the machine has come to where the program is.
    pub fn awaits_machine(&self) -> bool {
        self.awaits.is_some()
    }

    /// Whether a probing or a homing was handed out, and it is not known what came of it.
    pub fn awaits_search(&self) -> bool {
        matches!(self.awaits, Some(Awaited::Probing | Awaited::Homing))
    }

    /// Whether that is a homing.
    pub fn awaits_homing(&self) -> bool {
        self.awaits == Some(Awaited::Homing)
    }

    /// Goes on behind a homing that was handed out, from where the machine rests.
    pub fn homed(&mut self, at: Point) {
        self.awaits = None;
        self.state.homed(at);
        (self.settled_at, self.idle_at) = (at, at);
    }

    /// Goes on behind a probing that was handed out.
    pub fn probed(&mut self, probed: Probed) {
        self.awaits = None;
        self.state.probed(probed);
        (self.settled_at, self.idle_at) = (probed.at, probed.at);
    }

    /// Whether a block was come to that reads inputs and outputs, and it is not known what they are.
    pub fn awaits_signals(&self) -> bool {
        self.awaits == Some(Awaited::Signals)
    }

    /// Goes on with a block that reads inputs and outputs: what they are, in the order of
    /// [`MachineNames::new`](super::MachineNames::new); and what the last M66 found.
    pub fn signals_read(&mut self, signals: Vec<f64>, input_result: f64) {
        self.awaits = None;
        self.state.signals = Some(signals);
        if self.state.input_result == InputResult::Asked {
            self.state.input_result = InputResult::Known;
            self.state.parameters.show(INPUT_RESULT, input_result);
        }
    }

    /// Offsets, reference points and tools as the program left them so far. The caller saves them
    /// when the program has run.
    pub fn tables(&self) -> &Tables {
        &self.state.setup.tables
    }

    /// What the program leaves to the next one: everything but the [`tables`](Self::tables). Before
    /// its end, as if it went on there.
    pub fn memory(&self) -> Memory {
        let mut memory = Memory {
            modes: self.modes().clone(),
            tool_offset: self.state.tool_offset,
            g92_applies: self.state.g92_applies,
            parameters: self.state.parameters.clone(),
            saved: self.state.saved[0].clone(),
            input_result: self.state.input_result,
        };
        if self.program_ended {
            memory.end_program();
        }
        memory
    }

    /// How many blocks were read.
    pub fn executed(&self) -> u64 {
        self.executed
    }

    /// How many commands of the program were handed out so far, or passed where it is begun in its middle.
    pub fn passed(&self) -> u64 {
        self.passed
    }

    /// Begins in the middle: executes the program up to a line without handing out its commands.
    /// After this [`Interpreter::modes`] and [`Interpreter::position`] show what the line starts
    /// from, for the operator to confirm, and the next command is the line's. What sets it up is left to the caller, before
    /// that command: tool, spindle, coolant, outputs, path mode, and the way to the position, last along the axis across the
    /// plane when that goes down; codes of the user's are not repeated. In a loop or subroutine the line counts where it is
    /// met first.
    ///
    /// # Errors
    /// A block before the line is refused, or the program ends before it.
    pub fn enter_at_line(&mut self, line: u32) -> Result<Entry, Error> {
        let entry = self.skip_to(line);
        entry.map_err(|refusal| self.error(refusal))
    }

    /// Begins at a place behind the program's first commands: the next command is the one that comes there.
    /// [`Setup::start`] is where the program began; the machine is at `here` now, and this is in effect. What is to come
    /// before the next command is left to the caller. The place may be in a loop, a subroutine, a cycle or a
    /// compensated contour. If it is a homing, the axes that are homed there stay where they are up to that. What the program
    /// probes, or reads of inputs and outputs, before the place is what the machine has answered before.
    ///
    /// # Errors
    /// A block before the place is refused, or waits for more than what was answered, or the program does not come to the
    /// place any more.
    pub fn enter_at(
        &mut self,
        place: &Place,
        here: Point,
        now: &InEffect,
        answers: &[Answer],
    ) -> Result<Entry, Error> {
        let mut left = answers.iter();
        let passed = self.pass_to(place, &mut left);
        let passed = passed.map_err(|refusal| self.error(refusal))?;
        let answered = answers.len() - left.len();
        let mut at = passed.at();
        // What is homed next begins where it is, and maybe nobody knows where that is.
        if let Some(Action::Home { axes, .. }) = self.pending().next() {
            axes.iter().for_each(|axis| at[axis] = here[axis]);
        }
        let approach = self.state.approach(here, at);
        let taps = matches!(self.pending().next(), Some(Action::Tap { .. }));
        Ok(Entry {
            taps,
            answered,
            ..passed.entry(now, at, approach)
        })
    }

    /// No command yet.
    fn passed_none(&self) -> Passed {
        let setup = &self.state.setup;
        Passed::new(self.state.at, setup)
    }

    fn pass_to<'a>(
        &mut self,
        place: &Place,
        answers: &mut impl Iterator<Item = &'a Answer>,
    ) -> Result<Passed, Refusal> {
        let mut passed = self.passed_none();
        let line = place.known.map_or(0, |(_, line)| line);
        loop {
            let at = self.passed;
            let looks = place.known.is_some_and(|(number, _)| number == at);
            if at == place.passed && !looks {
                return Ok(passed);
            }
            self.idle = 0;
            self.advance()?;
            if let Some(command) = self.pending.front() {
                self.read_ahead.come_to(command);
            }
            let refuse = |fault| Err(Refusal::new(self.block.columns(), fault));
            let Some(command) = self.pending.front() else {
                return refuse(Fault::ResumeElsewhere { line });
            };
            if looks && command.span.line != line {
                return refuse(Fault::ResumeElsewhere { line });
            }
            if at == place.passed {
                return Ok(passed);
            }
            match &command.action {
                Action::Probe { .. } => match answers.next() {
                    Some(Answer::Probed(probed)) => {
                        passed.probed(probed.at);
                        self.probed(*probed);
                    }
                    _ => return refuse(Fault::BeginProbed { line }),
                },
                Action::ReadSignals { .. } => match answers.next() {
                    Some(Answer::Signals {
                        signals,
                        input_result,
                    }) => self.signals_read(signals.clone(), *input_result),
                    _ => return refuse(Fault::BeginRead { line }),
                },
                Action::End => return refuse(Fault::ResumeElsewhere { line }),
                action => passed.pass(action),
            }
            self.pending.pop_front();
            self.passed += 1;
        }
    }

    fn skip_to(&mut self, line: u32) -> Result<Entry, Refusal> {
        let start = self.state.at;
        let mut passed = self.passed_none();
        let begun = passed.effect();
        // What is read over is not met, but where that ends the program goes on behind.
        let mut read_over = false;
        loop {
            let next = self.files[self.current].lines.place().line;
            if self.current == 0 && (next == line || read_over) {
                break;
            }
            let file = self.current;
            self.step()?;
            read_over = file == 0 && self.line == line;
            let unknown = self.pending().find_map(|action| match action {
                Action::Probe { .. } => Some(Fault::BeginProbed { line }),
                Action::ReadSignals { .. } => Some(Fault::BeginRead { line }),
                _ => None,
            });
            if let Some(fault) = unknown {
                return Err(Refusal::new(self.block.columns(), fault));
            }
            self.passed += self.pending.len() as u64;
            for command in self.pending.drain(..) {
                passed.pass(&command.action);
            }
            self.idle = 0;
            if self.ended {
                return Err(Refusal::new(
                    self.block.columns(),
                    Fault::NoSuchLine { line },
                ));
            }
        }
        let midst = if self.compensation.is_some() {
            Some(Fault::BeginCompensated { line })
        } else if self.state.nurbs.is_some() {
            Some(Fault::BeginNurbs { line })
        } else {
            None
        };
        if let Some(fault) = midst {
            // What is shown is the line that was asked for.
            if !read_over {
                self.read_block()?;
            }
            return Err(Refusal::new(self.block.columns(), fault));
        }
        if self.state.input_result == InputResult::Asked {
            self.state.input_result = InputResult::Passed;
        }
        let at = self.state.at;
        let approach = self.state.go_from(start)?;
        self.settled_at = at;
        self.read_ahead.clear();
        Ok(passed.entry(&begun, at, approach))
    }

    /// Reads and executes blocks until there is a command.
    fn advance(&mut self) -> Result<(), Refusal> {
        while self.pending.is_empty() && !self.ended {
            self.step()?;
        }
        Ok(())
    }

    /// Whether it has to be known what inputs and outputs are before the block is executed, and it is not.
    pub(super) fn wants_signals(&self) -> bool {
        self.state.signals.is_none() && (self.block.reads_signals() || self.asks_input_result())
    }

    /// Whether the block names what the last M66 found, and that is not known.
    fn asks_input_result(&self) -> bool {
        self.state.input_result == InputResult::Asked && self.block.reads_input_result()
    }

    /// Goes on once it is known what inputs and outputs are where the path comes to rest for the block.
    pub(super) fn read_signals(&mut self, deferred: Deferred) -> Result<(), Refusal> {
        let names = &self.state.setup.names;
        let unknown = |(name, columns)| Some(Refusal::new(columns, names.refusal(name)?));
        if let Some(refusal) = self.block.signals().find_map(unknown) {
            return Err(refusal);
        }
        if self.compensation.is_some() || self.state.cutter().is_some() {
            return Err(Refusal::new(self.block.columns(), Fault::ReadCompensated));
        }
        self.deferred = Some(deferred);
        let input_result = self.asks_input_result();
        (self.actions).push_back(Action::ReadSignals { input_result });
        self.settle(self.span())
    }

    /// Reads and executes one block.
    fn step(&mut self) -> Result<(), Refusal> {
        if let Some(refusal) = self.noted.pop_front() {
            return Err(refusal);
        }
        if self.only_read {
            return self.judge_block();
        }
        if let Some(deferred) = self.deferred.take() {
            let done = match deferred {
                Deferred::Block(this) => self.execute(this),
                Deferred::Branch { label, columns } => self.take_branch(label, columns),
            };
            self.state.signals = None;
            return done;
        }
        let this = At {
            file: self.current,
            place: self.files[self.current].lines.place(),
        };
        if self.read_block()? {
            return self.execute(this);
        }
        if self.percent && self.current == 0 {
            return Err(Refusal::new(self.block.columns(), Fault::NoEnd));
        }
        self.check_end_of_file()
            .map_err(|fault| Refusal::new(self.block.columns(), fault))?;
        self.program_ended |= !self.state.setup.typed;
        self.end()
    }

    /// Reads the next line of the current file into the block; `false` at the file's end.
    pub(super) fn read_block(&mut self) -> Result<bool, Refusal> {
        let lines = &mut self.files[self.current].lines;
        self.line = lines.place().line;
        self.state.begin_block();
        let read = lines.read(&mut self.bytes);
        if !matches!(read, Ok(Read1::Line)) {
            self.block.parse("")?;
        }
        if self.current == 0 {
            let come_to = self.files[0].lines.place().offset;
            (self.state.setup.read).fetch_max(come_to, Ordering::Relaxed);
        }
        let refuse = |fault| Err(Refusal::new(Columns { start: 1, end: 2 }, fault));
        match read {
            Ok(Read1::Line) => {}
            Ok(Read1::End) => return Ok(false),
            Ok(Read1::TooLong) => return refuse(Fault::LineTooLong { allowed: MAX_LINE }),
            Err(error) => return refuse(Fault::Read(error)),
        }
        let mark: &[u8] = if self.line == 1 { b"\xef\xbb\xbf" } else { b"" };
        let bytes = self.bytes.strip_prefix(mark).unwrap_or(&self.bytes);
        if bytes.contains(&0) {
            self.block.parse("")?;
            return refuse(Fault::Encoding);
        }
        self.block.parse(&String::from_utf8_lossy(bytes))?;
        self.executed += 1;
        self.idle += 1;
        let setup = &self.state.setup;
        let fault = if setup.abandoned.load(Ordering::Relaxed) {
            Fault::Abandoned
        } else if let Some(allowed) =
            (setup.max_blocks).filter(|most| self.executed.max(self.asked) > *most)
        {
            Fault::without_end(allowed, self.begins_anew)
        } else if self.idle > setup.max_idle_blocks {
            let allowed = setup.max_idle_blocks;
            Fault::IdleLoop { allowed }
        } else {
            return Ok(true);
        };
        Err(Refusal::new(self.block.columns(), fault))
    }

    /// Whether the block begins with `/` and such blocks are skipped.
    pub(super) fn is_deleted(&self) -> bool {
        self.block.delete && self.state.setup.block_delete
    }

    /// Executes the block, which starts at `this`.
    fn execute(&mut self, this: At) -> Result<(), Refusal> {
        if self.block.percent {
            if self.started {
                self.check_end_of_file()
                    .map_err(|fault| Refusal::new(self.block.columns(), fault))?;
                self.program_ended = true;
                self.end()?;
            }
            self.percent = true;
            self.started = true;
            return Ok(());
        }
        self.started |= self.block.tokens.list.len() > 1;
        if self.is_deleted() {
            return Ok(());
        }
        self.state.line = self.line;
        if let Some(flow) = self.block.flow.clone() {
            if self.loses_the_way() {
                return Ok(());
            }
            self.execute_flow(&flow, this)?;
            self.words_seen = true;
            return Ok(());
        }
        if self.wants_signals() {
            return self.read_signals(Deferred::Block(this));
        }
        self.words_seen |= !self.block.words.is_empty() || !self.block.settings.is_empty();
        let continuation = self.state.execute(&self.block, &mut self.actions)?;
        self.settle(self.span())?;
        match continuation {
            Continuation::Next => {}
            Continuation::End => {
                self.program_ended = true;
                self.end()?;
            }
            Continuation::CallSubprogram {
                number,
                repeats,
                columns,
            } => {
                self.only_read = self.calls_what_is_lost();
                if !self.only_read {
                    self.call_subprogram(number, repeats, columns)?;
                }
            }
            Continuation::EndSubprogram { columns } => self.end_subprogram(columns)?,
        }
        Ok(())
    }

    /// Takes over what a block asked for; under G41 and G42 as far as the contour is known.
    fn settle(&mut self, span: Span) -> Result<(), Refusal> {
        self.asked += self.actions.len() as u64;
        let cutter = self.state.cutter();
        self.contour_lost &= cutter.is_some();
        if self.state.lost.loses_contours() {
            self.contour_lost = cutter.is_some();
            (self.compensation, self.left) = (None, None);
        }
        let cutter = cutter.filter(|_| !self.contour_lost);
        let judge = |from: &Point, action: &Action| self.state.within_limits(from, action);
        if let Some(compensation) = &mut self.compensation
            && Some(compensation.cutter()) != cutter
        {
            compensation.finish(&judge, &mut self.pending)?;
            self.settled_at = compensation.at();
            self.left = self.compensation.take();
        }
        let block = &self.block.text;
        let origin = || Origin {
            span,
            text: block.as_str().into(),
        };
        if let Some(cutter) = cutter {
            self.left = None;
            let origin = origin();
            let start = || Compensation::new(cutter, self.settled_at);
            let compensation = self.compensation.get_or_insert_with(start);
            for action in self.actions.drain(..) {
                compensation.take(action, &origin, &judge, &mut self.pending)?;
            }
            self.read_ahead.push(InBlock::new(span, &self.state));
            return Ok(());
        }
        for action in self.actions.drain(..) {
            if let Some(to) = action.destination() {
                if let Some(left) = self.left.take() {
                    left.leave(&to, &origin())?;
                }
                self.settled_at = to;
            }
            self.pending.push_back(Command { span, action });
        }
        Ok(())
    }

    /// A call of a subroutine has ended.
    pub(super) fn leave_call(&mut self, columns: Columns) -> Result<(), Refusal> {
        self.state.leave_call(columns, &mut self.actions)?;
        self.settle(self.span())
    }

    pub(super) fn span(&self) -> Span {
        Span {
            file: u16::try_from(self.current).unwrap_or(u16::MAX),
            line: self.line,
            columns: self.block.columns(),
        }
    }

    /// The error of a refusal: the program goes no further.
    fn error(&mut self, refusal: Refusal) -> Error {
        self.ended = true;
        self.pending.clear();
        self.read_ahead.clear();
        let (file, line, block) = match refusal.origin {
            Some(origin) => {
                let file = self.file(origin.span.file).to_owned();
                (file, origin.span.line, origin.text.to_string())
            }
            None => {
                let file = self.files[self.current].name.clone();
                (file, self.line, self.block.text.clone())
            }
        };
        Error {
            file,
            line,
            columns: refusal.columns,
            block,
            fault: *refusal.fault,
        }
    }

    fn end(&mut self) -> Result<(), Refusal> {
        // Told once: whoever looks for further mistakes comes to the end all the same.
        let refuse = |fault| Err(Refusal::new(self.block.columns(), fault));
        if self.state.nurbs.take().is_some() {
            return refuse(Fault::NurbsNotEnded);
        }
        // In a compensated contour of a program that is held, G41 is in effect and nothing typed is compensated.
        let left_on = self.state.cutter().and(self.state.modes.compensation);
        self.state.end_compensation();
        if let Some(code) = left_on.filter(|_| !self.program_ended) {
            return refuse(Fault::CompensationTyped { code });
        }
        self.actions.push_back(Action::End);
        self.settle(self.span())?;
        self.ended = true;
        Ok(())
    }
}

impl Iterator for Interpreter {
    type Item = Result<Command, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.awaits.is_some() {
            return None;
        }
        while let Err(refusal) = self.advance() {
            let error = self.error(refusal);
            if !self.follows(&error) {
                return Some(Err(error));
            }
            // It may be none, but what is wrong whatever was before is.
            if let Some(refusal) = self.wrong_by_itself(&error) {
                return Some(Err(self.error(refusal)));
            }
            if !self.go_on(&error) {
                return None;
            }
        }
        let command = self.pending.pop_front()?;
        self.passed += 1;
        self.read_ahead.come_to(&command);
        let (at, does) = match &command.action {
            Action::Rapid { to } | Action::Feed { to, .. } => (*to, *to != self.idle_at),
            Action::Arc { arc, .. } => (arc.to, true),
            Action::Spline { spline, .. } => (spline.to, true),
            Action::Thread { to, .. } => (*to, true),
            Action::Probe { .. } => {
                self.awaits = Some(Awaited::Probing);
                (self.idle_at, true)
            }
            Action::Home { .. } => {
                self.awaits = Some(Awaited::Homing);
                (self.idle_at, true)
            }
            Action::ReadSignals { .. } => {
                self.awaits = Some(Awaited::Signals);
                (self.idle_at, false)
            }
            Action::Dwell { .. } | Action::Stop(_) | Action::Tap { .. } => (self.idle_at, true),
            _ => (self.idle_at, false),
        };
        if does {
            (self.idle, self.idle_at) = (0, at);
        }
        Some(Ok(command))
    }
}
