//! Lines in, canonical commands out.

use std::collections::VecDeque;
use std::fs::File;
use std::io::Cursor;
use std::path::Path;

use super::Setup;
use super::axes::Point;
use super::block::Block;
use super::command::{Action, Command, Span};
use super::error::{Error, Fault, Refusal};
use super::execute::State;
use super::lexer::Columns;
use super::modal::Modes;
use super::source::{Input, Lines, MAX_LINE, Read1};
use super::tables::Tables;

/// Interprets a program block by block: an iterator of its commands, with memory for one block.
///
/// The last command is [`Action::End`]; an error is the last item, and nothing of its block was
/// handed out before it.
pub struct Interpreter {
    file: String,
    lines: Lines,
    bytes: Vec<u8>,
    block: Block,
    /// The line that `block` was read from.
    line: u32,
    state: State,
    pending: VecDeque<Action>,
    executed: u64,
    /// Whether something but blanks was read.
    started: bool,
    /// Whether the program began with `%`.
    percent: bool,
    ended: bool,
}

impl Interpreter {
    /// A program in a file.
    ///
    /// # Errors
    /// The file cannot be opened.
    pub fn open(path: &Path, setup: Setup) -> Result<Interpreter, Error> {
        let name = path.display().to_string();
        match File::open(path) {
            Ok(file) => Ok(Interpreter::new(name, file, setup)),
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
            file: name.into(),
            lines: Lines::new(Box::new(input)),
            bytes: Vec::new(),
            block: Block::default(),
            line: 0,
            state: State::new(setup),
            pending: VecDeque::new(),
            executed: 0,
            started: false,
            percent: false,
            ended: false,
        }
    }

    /// The text of the block that the last command came from.
    pub fn block(&self) -> &str {
        &self.block.text
    }

    /// The modal state after the block that the last command came from.
    pub fn modes(&self) -> &Modes {
        &self.state.modes
    }

    /// The programmed position after that block, machine coordinates.
    pub fn position(&self) -> Point {
        self.state.at
    }

    /// Offsets, reference points and tools as the program left them so far. The caller saves them
    /// when the program has run.
    pub fn tables(&self) -> &Tables {
        &self.state.setup.tables
    }

    /// How many blocks were read and executed.
    pub fn executed(&self) -> u64 {
        self.executed
    }

    /// Reads and executes blocks until there is a command.
    fn advance(&mut self) -> Result<(), Refusal> {
        while self.pending.is_empty() && !self.ended {
            let line = self.lines.place().line;
            let read = self.lines.read(&mut self.bytes);
            self.line = line;
            let at_start = Columns { start: 1, end: 2 };
            if !matches!(read, Ok(Read1::Line)) {
                self.block.parse("")?;
            }
            match read {
                Ok(Read1::Line) => {}
                Ok(Read1::End) => {
                    if self.percent {
                        return Err(Refusal::new(at_start, Fault::NoEnd));
                    }
                    self.end();
                    return Ok(());
                }
                Ok(Read1::TooLong) => {
                    return Err(Refusal::new(
                        at_start,
                        Fault::LineTooLong { allowed: MAX_LINE },
                    ));
                }
                Err(error) => {
                    return Err(Refusal::new(at_start, Fault::Read(error)));
                }
            }
            let bytes = match line {
                1 => self
                    .bytes
                    .strip_prefix(b"\xef\xbb\xbf")
                    .unwrap_or(&self.bytes),
                _ => &self.bytes,
            };
            self.block.parse(&String::from_utf8_lossy(bytes))?;
            self.execute()?;
        }
        Ok(())
    }

    fn execute(&mut self) -> Result<(), Refusal> {
        if self.block.percent {
            if self.started {
                self.end();
            }
            self.percent = true;
            self.started = true;
            return Ok(());
        }
        self.started |= self.block.tokens.list.len() > 1;
        if self.block.delete && self.state.setup.block_delete {
            return Ok(());
        }
        self.executed += 1;
        if let Some(allowed) = self.state.setup.max_blocks
            && self.executed > allowed
        {
            return Err(Refusal::new(
                self.block.columns(),
                Fault::TooManyBlocks { allowed },
            ));
        }
        if let Some(flow) = &self.block.flow {
            return Err(Refusal::new(flow.columns, Fault::NoFlow));
        }
        self.state.line = self.line;
        self.state.execute(&self.block, &mut self.pending)?;
        self.ended |= self.pending.back() == Some(&Action::End);
        Ok(())
    }

    fn end(&mut self) {
        self.pending.push_back(Action::End);
        self.ended = true;
    }
}

impl Iterator for Interpreter {
    type Item = Result<Command, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        if let Err(refusal) = self.advance() {
            self.ended = true;
            self.pending.clear();
            return Some(Err(Error {
                file: self.file.clone(),
                line: self.line,
                columns: refusal.columns,
                block: self.block.text.clone(),
                fault: *refusal.fault,
            }));
        }
        let action = self.pending.pop_front()?;
        Some(Ok(Command {
            span: Span {
                file: 0,
                line: self.line,
                columns: self.block.columns(),
            },
            action,
        }))
    }
}
