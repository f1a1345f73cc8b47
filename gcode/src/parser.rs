//! Tokens become a block, by the grammar of RS-274/NGC:
//!
//! ```text
//! block      = ["/"] ["N" number] (flow | {word | setting | comment}) end
//! word       = letter value
//! setting    = "#" (name | value) "=" value
//! value      = {"+" | "-"} (number | "#" (name | value) | function | "[" expression "]")
//! function   = ("ABS" | "SIN" …) "[" expression "]" | "ATAN" "[" … "]" "/" "[" … "]"
//!            | "EXISTS" "[" "#" name "]"
//! expression = value {operator value}
//! flow       = "O" (number | name | value) [statement {"[" expression "]"}]
//! ```

use std::ops::Range;

use super::block::{Block, Flow, Label, Setting, Statement, Target, Word};
use super::error::{Fault, Refusal};
use super::expression::{Function, Operation, Operator, Step, Value};
use super::lexer::{Columns, Kind, Token};

/// How deep brackets, signs and `#` may nest.
const MAX_DEPTH: u32 = 32;

impl Block {
    /// Reads `line` into the block in place of what it held.
    pub(crate) fn parse(&mut self, line: &str) -> Result<(), Refusal> {
        self.text.clear();
        self.text.push_str(line);
        self.delete = false;
        self.percent = false;
        self.words.clear();
        self.settings.clear();
        self.flow = None;
        self.arguments.clear();
        self.steps.clear();
        self.tokens.read(&self.text)?;
        let mut parser = Parser {
            text: &self.text,
            tokens: &self.tokens.list,
            at: 0,
            depth: 0,
            steps: &mut self.steps,
        };
        if parser.skip(&Kind::Slash) {
            self.delete = true;
        }
        if parser.skip(&Kind::Percent) {
            self.percent = true;
            parser.comments();
            return parser.finish("nothing but a comment beside `%`");
        }
        if parser.letter() == Some(b'N') {
            parser.at += 1;
            match parser.peek().kind {
                Kind::Number(_) => parser.at += 1,
                _ => return Err(parser.expected("an unsigned line number after N")),
            }
        }
        parser.comments();
        if parser.letter() == Some(b'O') {
            self.flow = Some(parser.flow(&mut self.arguments)?);
            parser.comments();
            return parser.finish("nothing else in a block with an O-word");
        }
        loop {
            let token = parser.peek();
            match &token.kind {
                Kind::End => return Ok(()),
                Kind::Comment => parser.at += 1,
                Kind::Letter(b'N') => {
                    return Err(Refusal::new(token.columns, Fault::LineNumberPlace));
                }
                Kind::Letter(b'O') => return Err(Refusal::new(token.columns, Fault::FlowPlace)),
                Kind::Letter(letter) => {
                    parser.refuse_macro()?;
                    parser.at += 1;
                    let value = parser.value("a value")?;
                    self.words.push(Word {
                        letter: *letter,
                        columns: token.columns.to(value.columns),
                        value,
                    });
                }
                Kind::Hash => {
                    parser.at += 1;
                    let target = match parser.name() {
                        Some(name) => Target::Named(name),
                        None => Target::Numbered(parser.value("a parameter's number")?),
                    };
                    if !parser.skip(&Kind::Equals) {
                        return Err(parser.expected("`=` behind the parameter"));
                    }
                    let value = parser.value("a value")?;
                    self.settings.push(Setting {
                        target,
                        columns: token.columns.to(value.columns),
                        value,
                    });
                }
                _ => return Err(parser.expected("a word, a parameter setting or a comment")),
            }
        }
    }
}

struct Parser<'a> {
    text: &'a str,
    tokens: &'a [Token],
    at: usize,
    depth: u32,
    steps: &'a mut Vec<Step>,
}

impl<'a> Parser<'a> {
    /// The next token; the list ends with [`Kind::End`], which is never passed.
    fn peek(&self) -> &'a Token {
        &self.tokens[self.at.min(self.tokens.len() - 1)]
    }

    fn previous(&self) -> Columns {
        self.tokens[self.at.saturating_sub(1)].columns
    }

    fn skip(&mut self, kind: &Kind) -> bool {
        let found = self.peek().kind == *kind;
        self.at += usize::from(found);
        found
    }

    fn letter(&self) -> Option<u8> {
        match self.peek().kind {
            Kind::Letter(letter) => Some(letter),
            _ => None,
        }
    }

    fn name(&mut self) -> Option<Range<usize>> {
        match &self.peek().kind {
            Kind::Name(name) => {
                self.at += 1;
                Some(name.clone())
            }
            _ => None,
        }
    }

    fn comments(&mut self) {
        while self.skip(&Kind::Comment) {}
    }

    fn finish(&self, expected: &'static str) -> Result<(), Refusal> {
        match self.peek().kind {
            Kind::End => Ok(()),
            _ => Err(self.expected(expected)),
        }
    }

    fn expected(&self, what: &'static str) -> Refusal {
        let token = self.peek();
        let found = match token.kind {
            Kind::End => "the end of the block".to_owned(),
            _ => {
                let Columns { start, end } = token.columns;
                let text: String = self
                    .text
                    .chars()
                    .skip(start as usize - 1)
                    .take((end - start) as usize)
                    .collect();
                format!("`{text}`")
            }
        };
        Refusal::new(token.columns, Fault::Expected { what, found })
    }

    /// Skips `keyword` if the next letters are it.
    fn keyword(&mut self, keyword: &str) -> bool {
        let letters = self.tokens[self.at.min(self.tokens.len())..].iter();
        let found = keyword.len() <= letters.len()
            && keyword
                .bytes()
                .zip(letters)
                .all(|(letter, token)| token.kind == Kind::Letter(letter));
        self.at += if found { keyword.len() } else { 0 };
        found
    }

    /// Refuses a statement of a controller whose macros have no O-words.
    fn refuse_macro(&mut self) -> Result<(), Refusal> {
        const MACROS: [(&str, &str); 5] = [
            ("WHILE", "`O1 WHILE […]` and `O1 ENDWHILE`"),
            ("IF", "`O1 IF […]` and `O1 ENDIF`"),
            (
                "GOTO",
                "`O1 IF […]` or `O1 WHILE […]`, as nothing jumps here",
            ),
            ("DO", "`O1 DO` and `O1 WHILE […]`"),
            ("END", "`O1 ENDWHILE`"),
        ];
        // A word is a letter and its value.
        let next = self.tokens.get(self.at + 1);
        if !next.is_some_and(|next| matches!(next.kind, Kind::Letter(_))) {
            return Ok(());
        }
        let (at, start) = (self.at, self.peek().columns);
        for (written, instead) in MACROS {
            let is_it = self.keyword(written)
                && matches!(self.peek().kind, Kind::Open | Kind::Number(_) | Kind::Hash);
            let columns = start.to(self.previous());
            self.at = at;
            if is_it {
                return Err(Refusal::new(columns, Fault::Macro { written, instead }));
            }
        }
        Ok(())
    }

    /// The letters that come next, as one word, without that of a G-code word behind it.
    fn letters(&self) -> String {
        let tokens = self.tokens[self.at.min(self.tokens.len())..].iter();
        let letters = tokens.clone().map_while(|token| match token.kind {
            Kind::Letter(letter) => Some(char::from(letter)),
            _ => None,
        });
        let mut written: String = letters.collect();
        let behind = tokens.clone().nth(written.len());
        let word = behind.is_some_and(|token| matches!(token.kind, Kind::Number(_)));
        if word && written.len() > 1 {
            written.pop();
        }
        written
    }

    /// The columns of as many letters.
    fn letters_columns(&self, count: usize) -> Columns {
        let last = &self.tokens[self.at + count - 1];
        self.peek().columns.to(last.columns)
    }

    fn emit(&mut self, operation: Operation, columns: Columns) {
        self.steps.push(Step { operation, columns });
    }

    /// A value as a range of steps.
    fn value(&mut self, what: &'static str) -> Result<Value, Refusal> {
        let first = self.steps.len();
        let start = self.peek().columns;
        self.real(what)?;
        Ok(Value {
            steps: first..self.steps.len(),
            columns: start.to(self.previous()),
        })
    }

    fn real(&mut self, what: &'static str) -> Result<(), Refusal> {
        self.depth += 1;
        if self.depth > MAX_DEPTH {
            return Err(Refusal::new(
                self.peek().columns,
                Fault::TooDeep { allowed: MAX_DEPTH },
            ));
        }
        let token = self.peek();
        let columns = token.columns;
        match &token.kind {
            Kind::Number(number) => {
                self.at += 1;
                self.emit(Operation::Number(*number), columns);
            }
            Kind::Plus => {
                self.at += 1;
                self.real(what)?;
            }
            Kind::Minus => {
                self.at += 1;
                self.real(what)?;
                self.emit(Operation::Negate, columns);
            }
            Kind::Hash => {
                self.at += 1;
                match self.name() {
                    Some(name) => {
                        self.emit(Operation::Named(name), columns.to(self.previous()));
                    }
                    None => {
                        self.real("a parameter's number or name after `#`")?;
                        self.emit(Operation::Numbered, columns.to(self.previous()));
                    }
                }
            }
            Kind::Open => self.bracket()?,
            Kind::Letter(_) => self.function(what)?,
            _ => return Err(self.expected(what)),
        }
        self.depth -= 1;
        Ok(())
    }

    fn bracket(&mut self) -> Result<(), Refusal> {
        if !self.skip(&Kind::Open) {
            return Err(self.expected("`[`"));
        }
        self.expression(0)?;
        if !self.skip(&Kind::Close) {
            return Err(self.expected("an operator or `]`"));
        }
        Ok(())
    }

    /// Values joined by operators that bind at least as strongly as `weakest`.
    fn expression(&mut self, weakest: u8) -> Result<(), Refusal> {
        self.real("a value")?;
        loop {
            let (at, columns) = (self.at, self.peek().columns);
            let Some(operator) = self.operator() else {
                return Ok(());
            };
            if operator.precedence() < weakest {
                self.at = at;
                return Ok(());
            }
            let columns = columns.to(self.previous());
            self.expression(operator.precedence() + 1)?;
            self.emit(Operation::Operator(operator), columns);
        }
    }

    fn operator(&mut self) -> Option<Operator> {
        let operator = match self.peek().kind {
            Kind::Plus => Operator::Plus,
            Kind::Minus => Operator::Minus,
            Kind::Star => Operator::Times,
            Kind::Slash => Operator::Divide,
            Kind::Power => Operator::Power,
            Kind::Letter(_) => {
                return Operator::NAMED
                    .into_iter()
                    .find(|(name, _)| self.keyword(name))
                    .map(|(_, operator)| operator);
            }
            _ => return None,
        };
        self.at += 1;
        Some(operator)
    }

    fn function(&mut self, what: &'static str) -> Result<(), Refusal> {
        let columns = self.peek().columns;
        if self.keyword("ATAN") {
            let columns = columns.to(self.previous());
            self.bracket()?;
            if !self.skip(&Kind::Slash) {
                return Err(self.expected("`/[…]` behind `ATAN[…]`"));
            }
            self.bracket()?;
            self.emit(Operation::Atan, columns);
            return Ok(());
        }
        if self.keyword("EXISTS") {
            let opened = self.skip(&Kind::Open) && self.skip(&Kind::Hash);
            let name = if opened { self.name() } else { None };
            return match name {
                Some(name) if self.skip(&Kind::Close) => {
                    self.emit(Operation::Exists(name), columns.to(self.previous()));
                    Ok(())
                }
                _ => Err(self.expected("`[#<name>]` behind `EXISTS`")),
            };
        }
        match Function::NAMED
            .into_iter()
            .find(|(name, _)| self.keyword(name))
        {
            Some((_, function)) => {
                let columns = columns.to(self.previous());
                self.bracket()?;
                self.emit(Operation::Function(function), columns);
                Ok(())
            }
            None => Err(self.expected(what)),
        }
    }

    fn flow(&mut self, arguments: &mut Vec<Value>) -> Result<Flow, Refusal> {
        let start = self.peek().columns;
        self.at += 1;
        let label = match &self.peek().kind {
            Kind::Name(name) => {
                self.at += 1;
                Label::Name(name.clone())
            }
            Kind::Number(number) => {
                let number = *number;
                if number.fract() != 0.0 || number > f64::from(u32::MAX) {
                    return Err(self.expected("a whole number after O"));
                }
                self.at += 1;
                Label::Number(number as u32)
            }
            _ => Label::Computed(self.value("a number, `<name>` or expression after O")?),
        };
        const STATEMENTS: [(&str, Statement, Range<usize>); 15] = [
            ("SUB", Statement::Sub, 0..1),
            ("ENDSUB", Statement::EndSub, 0..2),
            ("RETURN", Statement::Return, 0..2),
            ("CALL", Statement::Call, 0..31),
            ("IF", Statement::If, 1..2),
            ("ELSEIF", Statement::ElseIf, 1..2),
            ("ELSE", Statement::Else, 0..1),
            ("ENDIF", Statement::EndIf, 0..1),
            ("WHILE", Statement::While, 1..2),
            ("ENDWHILE", Statement::EndWhile, 0..1),
            ("DO", Statement::Do, 0..1),
            ("REPEAT", Statement::Repeat, 1..2),
            ("ENDREPEAT", Statement::EndRepeat, 0..1),
            ("BREAK", Statement::Break, 0..1),
            ("CONTINUE", Statement::Continue, 0..1),
        ];
        let (statement, count) = match self.peek().kind {
            Kind::Letter(_) => {
                let written = self.letters();
                let found = STATEMENTS
                    .into_iter()
                    .find(|(keyword, ..)| *keyword == written);
                let Some((keyword, statement, count)) = found else {
                    let columns = self.letters_columns(written.len());
                    // `G0`, and no statement.
                    if written.len() == 1 {
                        return Err(Refusal::new(columns, Fault::FlowPlace));
                    }
                    let nearest = STATEMENTS
                        .iter()
                        .min_by_key(|(keyword, ..)| difference(keyword, &written))
                        .map_or("", |(keyword, ..)| keyword);
                    return Err(Refusal::new(columns, Fault::Statement { written, nearest }));
                };
                self.at += keyword.len();
                (statement, count)
            }
            _ => (Statement::Program, 0..1),
        };
        let mut end = self.previous();
        self.comments();
        while self.peek().kind == Kind::Open {
            if arguments.len() + 1 >= count.end {
                return Err(self.expected("no further `[…]`"));
            }
            let value = self.value("`[`")?;
            end = value.columns;
            arguments.push(value);
            self.comments();
        }
        if arguments.len() < count.start {
            return Err(self.expected("`[…]`"));
        }
        Ok(Flow {
            label,
            statement,
            columns: start.to(end),
        })
    }
}

/// How many letters have to be added, left out or changed to make one word of another.
fn difference(a: &str, b: &str) -> usize {
    let b = b.as_bytes();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.bytes().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, y) in b.iter().enumerate() {
            let changed = diagonal + usize::from(x != *y);
            diagonal = row[j + 1];
            row[j + 1] = changed.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}
