//! Flow of control: O-words, and the numbered subprograms of M98 and M99.
//!
//! Nothing of a body is kept: a jump goes back to a place in its file and reads again, a branch not
//! taken is read over. Where a subroutine is not known yet, the rest of its file is searched, then
//! a file of its name beside the program.

use std::collections::BTreeMap;
use std::fs::File;

use super::block::{Block, Flow, Label, Statement};
use super::error::{Fault, Refusal};
use super::interpreter::{Deferred, Interpreter, ProgramFile};
use super::lexer::Columns;
use super::parameters::Caller;
use super::source::Place;
use super::words::whole;

/// How deep subroutines may call each other.
const MAX_CALLS: usize = 100;
/// How deep loops and branches may nest in one subroutine.
const MAX_NESTING: usize = 100;

/// The start of a line in one of the program's files.
#[derive(Clone, Copy, Debug)]
pub(super) struct At {
    pub(super) file: usize,
    pub(super) place: Place,
}

/// An IF or a loop that has been entered and not left.
#[derive(Debug)]
struct Construct {
    label: String,
    kind: Kind,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    If,
    /// At the WHILE.
    While(At),
    /// Behind the DO.
    Do(At),
    /// Behind the REPEAT, and how often it is still to be gone through.
    Repeat {
        body: At,
        left: u32,
    },
}

/// Whether a block begins with an O-word.
pub(super) fn is_flow(block: &str) -> bool {
    let words = block.trim_start_matches(['/', ' ', '\t']);
    let words = match words.strip_prefix(['N', 'n']) {
        Some(number) => number.trim_start_matches(|c: char| c == ' ' || c.is_ascii_digit()),
        None => words,
    };
    words.starts_with(['O', 'o'])
}

impl Kind {
    /// The statement that ends it.
    fn end(self) -> Statement {
        match self {
            Kind::If => Statement::EndIf,
            Kind::While(_) => Statement::EndWhile,
            Kind::Do(_) => Statement::While,
            Kind::Repeat { .. } => Statement::EndRepeat,
        }
    }
}

/// A subroutine or subprogram that is being executed.
#[derive(Debug)]
struct Call {
    return_to: At,
    /// The caller's open constructs.
    constructs: Vec<Construct>,
    kind: CallKind,
}

#[derive(Debug)]
enum CallKind {
    /// O… CALL: its label, and the caller's own parameters.
    Subroutine { label: String, caller: Box<Caller> },
    /// M98: its body, and how often it is still to be gone through.
    Subprogram { body: At, left: u32 },
}

/// Where the program is in its loops, branches and subroutines, and which of those are known.
#[derive(Debug, Default)]
pub(super) struct Control {
    constructs: Vec<Construct>,
    calls: Vec<Call>,
    subroutines: BTreeMap<String, At>,
    subprograms: BTreeMap<u32, At>,
}

impl Interpreter {
    /// The start of the line that will be read next.
    fn next_line(&self) -> At {
        At {
            file: self.current,
            place: self.files[self.current].lines.place(),
        }
    }

    /// Whether a subroutine or subprogram is being executed.
    pub(super) fn is_called(&self) -> bool {
        !self.control.calls.is_empty()
    }

    /// Where the main program goes on behind what it has called: nothing is called any more.
    pub(super) fn first_caller(&mut self) -> Option<At> {
        let calls = std::mem::take(&mut self.control.calls);
        calls.first().map(|call| call.return_to)
    }

    pub(super) fn go_to(&mut self, at: At) -> Result<(), Refusal> {
        self.current = at.file;
        self.files[at.file]
            .lines
            .go_to(at.place)
            .map_err(|error| Refusal::new(self.block.columns(), Fault::Read(error)))
    }

    /// Executes the flow statement of the block; `this` is where its line starts.
    pub(super) fn execute_flow(&mut self, flow: &Flow, this: At) -> Result<(), Refusal> {
        // An ELSEIF that is come to ends a branch that was taken.
        if flow.statement != Statement::ElseIf && self.wants_signals() {
            return self.read_signals(Deferred::Block(this));
        }
        let columns = flow.columns;
        let label = self.label(flow)?;
        match flow.statement {
            Statement::Program => self.program_header(&label, columns),
            Statement::Sub => {
                let body = self.next_line();
                self.define(label.clone(), body, columns)?;
                self.read_to(&label, columns, "ENDSUB", |statement| {
                    statement == Statement::EndSub
                })
            }
            Statement::Call => self.call(label, columns),
            Statement::EndSub | Statement::Return => self.return_from(&label, columns),
            Statement::If => {
                if self.condition()? {
                    self.enter(label, Kind::If, columns)
                } else {
                    self.find_branch(label, columns)
                }
            }
            Statement::ElseIf | Statement::Else => {
                self.leave(&label, columns, "IF", |kind| matches!(kind, Kind::If))?;
                self.read_to(&label, columns, "ENDIF", |s| s == Statement::EndIf)
            }
            Statement::EndIf => {
                self.leave(&label, columns, "IF", |kind| matches!(kind, Kind::If))?;
                Ok(())
            }
            Statement::While => {
                let condition = self.condition()?;
                match self.control.constructs.last() {
                    Some(Construct {
                        label: open,
                        kind: Kind::Do(body),
                    }) if *open == label => {
                        let body = *body;
                        if condition {
                            return self.go_to(body);
                        }
                        self.control.constructs.pop();
                        Ok(())
                    }
                    _ if condition => self.enter(label, Kind::While(this), columns),
                    _ => self.read_to(&label, columns, "ENDWHILE", |s| s == Statement::EndWhile),
                }
            }
            Statement::EndWhile => {
                let kind = self.leave(&label, columns, "WHILE", |kind| {
                    matches!(kind, Kind::While(_))
                })?;
                match kind {
                    Kind::While(start) => self.go_to(start),
                    _ => Ok(()),
                }
            }
            Statement::Do => {
                let body = self.next_line();
                self.enter(label, Kind::Do(body), columns)
            }
            Statement::Repeat => {
                let count = self.argument(0)?.max(0.0);
                match whole(count, 1e-4) {
                    Some(0) => {
                        self.read_to(&label, columns, "ENDREPEAT", |s| s == Statement::EndRepeat)
                    }
                    Some(count) => {
                        let body = self.next_line();
                        let left = count - 1;
                        self.enter(label, Kind::Repeat { body, left }, columns)
                    }
                    None => Err(Refusal::new(columns, Fault::RepeatCount(count))),
                }
            }
            Statement::EndRepeat => {
                let kind = self.leave(&label, columns, "REPEAT", |kind| {
                    matches!(kind, Kind::Repeat { .. })
                })?;
                match kind {
                    Kind::Repeat { body, left } if left > 0 => {
                        let left = left - 1;
                        self.enter(label, Kind::Repeat { body, left }, columns)?;
                        self.go_to(body)
                    }
                    _ => Ok(()),
                }
            }
            Statement::Break | Statement::Continue => {
                self.leave_loop(&label, flow.statement, columns)
            }
        }
    }

    /// BREAK leaves the loop, CONTINUE goes on at its test.
    fn leave_loop(
        &mut self,
        label: &str,
        statement: Statement,
        columns: Columns,
    ) -> Result<(), Refusal> {
        let open = &mut self.control.constructs;
        let found = open
            .iter()
            .rposition(|construct| construct.label == label && !matches!(construct.kind, Kind::If));
        let Some(index) = found else {
            let fault = Fault::NotOpen {
                label: label.to_owned(),
                what: "loop",
            };
            return Err(Refusal::new(columns, fault));
        };
        let kind = open[index].kind;
        let go_on = statement == Statement::Continue;
        open.truncate(index + usize::from(go_on));
        if let (true, Kind::While(start)) = (go_on, kind) {
            open.pop();
            return self.go_to(start);
        }
        let end = kind.end();
        self.read_to(label, columns, end_name(kind), |s| s == end)?;
        match self.block.flow.clone() {
            Some(flow) if go_on => {
                let this = self.next_line();
                self.execute_flow(&flow, this)
            }
            _ => Ok(()),
        }
    }

    /// Reads on to the branch of a false IF that is to be taken.
    fn find_branch(&mut self, label: String, columns: Columns) -> Result<(), Refusal> {
        loop {
            self.read_to(&label, columns, "ENDIF", |statement| {
                use Statement::{Else, ElseIf, EndIf};
                matches!(statement, ElseIf | Else | EndIf)
            })?;
            let statement = self.block.flow.as_ref().map(|flow| flow.statement);
            let taken = match statement {
                Some(Statement::ElseIf) if self.wants_signals() => {
                    return self.read_signals(Deferred::Branch { label, columns });
                }
                Some(Statement::ElseIf) if self.loses_the_way() => return Ok(()),
                Some(Statement::ElseIf) => self.condition()?,
                Some(Statement::Else) => true,
                _ => return Ok(()),
            };
            if taken {
                return self.enter(label, Kind::If, columns);
            }
        }
    }

    /// Goes on with an ELSEIF of a false IF once it is known what that reads.
    pub(super) fn take_branch(&mut self, label: String, columns: Columns) -> Result<(), Refusal> {
        match self.condition()? {
            true => self.enter(label, Kind::If, columns),
            false => self.find_branch(label, columns),
        }
    }

    /// The flow statement of a block that is read over, unless the block is deleted.
    fn flow_of_block(&self) -> Option<&Flow> {
        (self.block.flow.as_ref()).filter(|_| !self.is_deleted())
    }

    /// Reads over blocks up to a statement with a label.
    fn read_to(
        &mut self,
        label: &str,
        columns: Columns,
        missing: &'static str,
        wanted: impl Fn(Statement) -> bool,
    ) -> Result<(), Refusal> {
        let (line, text) = (self.line, self.block.text.clone());
        let file = self.current;
        // Behind what is refused here the program does not go on.
        self.reads_over = true;
        loop {
            match self.read_block() {
                Ok(true) if !self.block.percent => {}
                Ok(_) => break,
                Err(refusal) if refusal.fault.is_misspelling() && !is_flow(&self.block.text) => {
                    self.note(refusal);
                    continue;
                }
                Err(refusal) => return Err(refusal),
            }
            let Some(flow) = self.flow_of_block() else {
                continue;
            };
            if flow.statement == Statement::Sub && missing == "ENDSUB" {
                return Err(Refusal::new(flow.columns, Fault::NestedSub));
            }
            if wanted(flow.statement) && is_label(&self.block, flow, label) {
                self.reads_over = false;
                return Ok(());
            }
        }
        // The fault is the opening statement's; behind it each block is judged.
        self.noted.clear();
        (self.line, self.current) = (line, file);
        self.block.parse(&text)?;
        let label = label.to_owned();
        Err(Refusal::new(columns, Fault::NoEndOf { label, missing }))
    }

    fn enter(&mut self, label: String, kind: Kind, columns: Columns) -> Result<(), Refusal> {
        let open = &mut self.control.constructs;
        if open.len() >= MAX_NESTING {
            let allowed = MAX_NESTING;
            return Err(Refusal::new(columns, Fault::NestedTooDeep { allowed }));
        }
        if open.iter().any(|construct| construct.label == label) {
            return Err(Refusal::new(columns, Fault::LabelInUse { label }));
        }
        open.push(Construct { label, kind });
        Ok(())
    }

    /// Takes the innermost construct off if it is the one that a statement belongs to.
    fn leave(
        &mut self,
        label: &str,
        columns: Columns,
        what: &'static str,
        fits: impl Fn(Kind) -> bool,
    ) -> Result<Kind, Refusal> {
        match self.control.constructs.pop() {
            Some(construct) if construct.label == label && fits(construct.kind) => {
                Ok(construct.kind)
            }
            _ => {
                let label = label.to_owned();
                Err(Refusal::new(columns, Fault::NotOpen { label, what }))
            }
        }
    }

    fn define(&mut self, label: String, body: At, columns: Columns) -> Result<(), Refusal> {
        match self.control.subroutines.insert(label.clone(), body) {
            Some(known) if known.file != body.file || known.place != body.place => {
                Err(Refusal::new(columns, Fault::DefinedTwice { label }))
            }
            _ => Ok(()),
        }
    }

    fn call(&mut self, label: String, columns: Columns) -> Result<(), Refusal> {
        let mut arguments = Vec::with_capacity(self.block.arguments.len());
        for index in 0..self.block.arguments.len() {
            arguments.push(self.argument(index)?);
        }
        let body = self.subroutine(&label, columns)?;
        self.check_depth(columns)?;
        let caller = self.state.parameters.call(&arguments);
        let caller = Box::new(caller);
        let kind = CallKind::Subroutine { label, caller };
        self.push_call(kind);
        self.go_to(body)
    }

    fn check_depth(&self, columns: Columns) -> Result<(), Refusal> {
        if self.control.calls.len() >= MAX_CALLS {
            let allowed = MAX_CALLS;
            return Err(Refusal::new(columns, Fault::CallsTooDeep { allowed }));
        }
        Ok(())
    }

    fn push_call(&mut self, kind: CallKind) {
        let return_to = self.next_line();
        let constructs = std::mem::take(&mut self.control.constructs);
        self.control.calls.push(Call {
            return_to,
            constructs,
            kind,
        });
        self.state.enter_call();
    }

    /// Goes back behind the innermost call, with the modes that M73 saved.
    fn return_to_caller(&mut self, result: Option<f64>, columns: Columns) -> Result<(), Refusal> {
        let Some(call) = self.control.calls.pop() else {
            return Ok(());
        };
        self.control.constructs = call.constructs;
        self.leave_call(columns)?;
        if let CallKind::Subroutine { caller, .. } = call.kind {
            self.state.parameters.return_to(*caller, result);
        }
        self.go_to(call.return_to)
    }

    fn return_from(&mut self, label: &str, columns: Columns) -> Result<(), Refusal> {
        let inside = match self.control.calls.last().map(|call| &call.kind) {
            Some(CallKind::Subroutine { label: open, .. }) => open == label,
            _ => false,
        };
        if !inside {
            let (label, what) = (label.to_owned(), "SUB");
            return Err(Refusal::new(columns, Fault::NotOpen { label, what }));
        }
        let value = match self.block.arguments.len() {
            0 => None,
            _ => Some(self.argument(0)?),
        };
        self.return_to_caller(value, columns)
    }

    /// Where the body of a subroutine starts: known, further on in this file, or in its own file.
    fn subroutine(&mut self, label: &str, columns: Columns) -> Result<At, Refusal> {
        if let Some(body) = self.control.subroutines.get(label) {
            return Ok(*body);
        }
        let from = self.next_line();
        if let Some(body) = self.search(from, label, Statement::Sub)? {
            return Ok(body);
        }
        let plain = label
            .chars()
            .all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || matches!(c, '_' | '-'));
        // What came through a pipe has no files beside it.
        let has_folder = plain && self.directory.is_some();
        let remedy = match (self.state.setup.typed, has_folder) {
            (false, false) => "define it in this file".to_owned(),
            (false, true) => format!("define it in this file, or in {label}.ngc beside it"),
            (true, false) => "typed lines call what has a file of its own".to_owned(),
            (true, true) => format!("typed lines call what has a file of its own: {label}.ngc"),
        };
        let unknown = || {
            let (label, remedy) = (label.to_owned(), remedy.clone());
            Refusal::new(columns, Fault::NoSubroutine { label, remedy })
        };
        let Some(directory) = self.directory.as_ref().filter(|_| plain) else {
            return Err(unknown());
        };
        let path = directory.join(format!("{label}.ngc"));
        let file = File::open(&path).map_err(|error| match error.kind() {
            std::io::ErrorKind::NotFound => unknown(),
            _ => Refusal::new(columns, Fault::Read(error)),
        })?;
        let index = self.files.len();
        self.files
            .push(ProgramFile::new(path.display().to_string(), file));
        let from = At {
            file: index,
            place: Place::START,
        };
        self.search(from, label, Statement::Sub)?
            .ok_or_else(unknown)
    }

    /// Searches a file for a subroutine or subprogram and comes back; what stands in between is not
    /// judged. The line behind the statement is remembered.
    fn search(
        &mut self,
        from: At,
        label: &str,
        statement: Statement,
    ) -> Result<Option<At>, Refusal> {
        let (back, line) = (self.next_line(), self.line);
        let text = self.block.text.clone();
        self.go_to(from)?;
        let mut found = None;
        loop {
            match self.read_block() {
                Ok(true) => {}
                Ok(false) => break,
                Err(refusal) if matches!(*refusal.fault, Fault::Read(_) | Fault::Abandoned) => {
                    break;
                }
                Err(_) => continue,
            }
            if let Some(flow) = self.flow_of_block()
                && flow.statement == statement
                && is_label(&self.block, flow, label)
            {
                found = Some(self.next_line());
                break;
            }
        }
        self.go_to(back)?;
        self.line = line;
        self.block.parse(&text)?;
        if let Some(body) = found {
            match statement {
                Statement::Sub => {
                    self.control.subroutines.insert(label.to_owned(), body);
                }
                _ => {
                    if let Ok(number) = label.parse() {
                        self.control.subprograms.insert(number, body);
                    }
                }
            }
        }
        Ok(found)
    }

    /// An O-word alone: at the beginning the program's number, later a subprogram that the program
    /// must not run into.
    fn program_header(&mut self, label: &str, columns: Columns) -> Result<(), Refusal> {
        if self.words_seen {
            let label = label.to_owned();
            return Err(Refusal::new(columns, Fault::RunsInto { label }));
        }
        self.words_seen = true;
        Ok(())
    }

    /// M98
    pub(super) fn call_subprogram(
        &mut self,
        number: u32,
        repeats: u32,
        columns: Columns,
    ) -> Result<(), Refusal> {
        if repeats == 0 {
            return Ok(());
        }
        let body = match self.control.subprograms.get(&number) {
            Some(body) => *body,
            None => {
                let label = number.to_string();
                let start = At {
                    file: self.current,
                    place: Place::START,
                };
                let from = self.next_line();
                let found = match self.search(from, &label, Statement::Program)? {
                    None => self.search(start, &label, Statement::Program)?,
                    found => found,
                };
                let remedy = match self.state.setup.typed {
                    true => "typed lines have none: load the program that it is in".to_owned(),
                    false => format!("add it behind the end of the program{}", packed(number)),
                };
                let fault = || Fault::NoSubprogram { number, remedy };
                found.ok_or_else(|| Refusal::new(columns, fault()))?
            }
        };
        self.check_depth(columns)?;
        let left = repeats - 1;
        self.push_call(CallKind::Subprogram { body, left });
        self.go_to(body)
    }

    /// M99: ends a subprogram; in the main program goes back to its beginning.
    pub(super) fn end_subprogram(&mut self, columns: Columns) -> Result<(), Refusal> {
        match self.control.calls.last_mut().map(|call| &mut call.kind) {
            Some(CallKind::Subprogram { body, left }) if *left > 0 => {
                *left -= 1;
                let body = *body;
                self.control.constructs.clear();
                // Each pass is a call of its own to M70 and M73.
                self.leave_call(columns)?;
                self.state.enter_call();
                self.go_to(body)
            }
            Some(CallKind::Subprogram { .. }) => self.return_to_caller(None, columns),
            Some(CallKind::Subroutine { .. }) => {
                Err(Refusal::new(columns, Fault::SubprogramEndInSub))
            }
            None if self.mistaken => {
                // What is wrong is told.
                self.ended = true;
                Ok(())
            }
            None => {
                self.control.constructs.clear();
                self.begins_anew = true;
                self.started = false;
                self.words_seen = false;
                self.go_to(At {
                    file: 0,
                    place: Place::START,
                })
            }
        }
    }

    /// What is open where a file ends.
    pub(super) fn check_end_of_file(&self) -> Result<(), Fault> {
        if let Some(construct) = self.control.constructs.last() {
            return Err(Fault::NoEndOf {
                label: construct.label.clone(),
                missing: end_name(construct.kind),
            });
        }
        match self.control.calls.last().map(|call| &call.kind) {
            Some(CallKind::Subroutine { label, .. }) => Err(Fault::NoEndOf {
                label: label.clone(),
                missing: "ENDSUB",
            }),
            Some(CallKind::Subprogram { .. }) => Err(Fault::NoSubprogramEnd),
            None => Ok(()),
        }
    }

    fn condition(&mut self) -> Result<bool, Refusal> {
        Ok(self.argument(0)? != 0.0)
    }

    fn argument(&mut self, index: usize) -> Result<f64, Refusal> {
        match self.block.arguments.get(index) {
            Some(value) => self.state.value(&self.block, value),
            None => Ok(0.0),
        }
    }

    fn label(&mut self, flow: &Flow) -> Result<String, Refusal> {
        match &flow.label {
            Label::Number(number) => Ok(number.to_string()),
            Label::Name(name) => Ok(self.block.name(name).to_owned()),
            Label::Computed(value) if flow.statement == Statement::Call => {
                let number = self.state.value(&self.block, value)?;
                whole(number, 1e-4)
                    .map(|number| number.to_string())
                    .ok_or_else(|| Refusal::new(value.columns, Fault::LabelNumber(number)))
            }
            Label::Computed(value) => Err(Refusal::new(value.columns, Fault::ComputedLabel)),
        }
    }
}

fn is_label(block: &Block, flow: &Flow, label: &str) -> bool {
    match &flow.label {
        Label::Number(number) => label.parse() == Ok(*number),
        Label::Name(name) => block.name(name) == label,
        Label::Computed(_) => false,
    }
}

fn end_name(kind: Kind) -> &'static str {
    match kind {
        Kind::If => "ENDIF",
        Kind::While(_) => "ENDWHILE",
        Kind::Do(_) => "WHILE",
        Kind::Repeat { .. } => "ENDREPEAT",
    }
}

/// What is meant by a P of M98 in dialects that put the number of calls before the four digits of the subprogram.
fn packed(number: u32) -> String {
    match (number / 10_000, number % 10_000) {
        (0, _) => String::new(),
        (calls, number) => {
            format!(", or for {calls} calls of O{number} write M98 P{number} L{calls}")
        }
    }
}
