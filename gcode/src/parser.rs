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
use super::words::Letters;

/// How deep brackets, signs and `#` may nest.
const MAX_DEPTH: u32 = 32;
/// Where a number is not read on.
pub(crate) const CUT: char = ',';
/// So many letters in a row begin no block.
const LETTERS_OF_TEXT: usize = 4;

impl Block {
    fn clear(&mut self, line: &str) {
        self.text.clear();
        self.text.push_str(line);
        self.delete = false;
        self.percent = false;
        self.words.clear();
        self.settings.clear();
        self.flow = None;
        self.arguments.clear();
        self.steps.clear();
    }

    /// Reads `line` into the block in place of what it held.
    pub(crate) fn parse(&mut self, line: &str) -> Result<(), Refusal> {
        self.clear(line);
        self.tokens.read(&self.text)?;
        let mut parser = Parser::new(&self.text, &self.tokens.list, &mut self.steps);
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
        while parser.part(&mut self.words, &mut self.settings)? {}
        Ok(())
    }

    /// Reads what can be read of the words and settings of `line`, which is refused; what cannot.
    pub(crate) fn parse_what_can_be(&mut self, line: &str) -> Unread {
        self.clear(line);
        self.tokens.read_what_can_be(&self.text);
        let mut parser = Parser::new(&self.text, &self.tokens.list, &mut self.steps);
        let mut unread = Unread::default();
        self.delete = parser.skip(&Kind::Slash);
        self.percent = parser.skip(&Kind::Percent);
        if self.percent {
            return unread;
        }
        if parser.letter() == Some(b'N') {
            parser.at += 1;
            parser.at += usize::from(matches!(parser.peek().kind, Kind::Number(_)));
        }
        if parser.begins_text() {
            unread.is_text = true;
            return unread;
        }
        // Whether the part before is a word.
        let mut is_behind_word = None;
        loop {
            let (start, words) = (parser.at, self.words.len());
            match parser.part(&mut self.words, &mut self.settings) {
                Ok(true) if parser.tokens[start].kind == Kind::Comment => is_behind_word = None,
                Ok(true) => is_behind_word = Some(self.words.len() > words),
                Ok(false) => return unread,
                Err(_) => {
                    let spoils = parser.read_over(start, &mut unread);
                    match is_behind_word.take().filter(|_| spoils) {
                        Some(true) => {
                            let word = self.words.pop();
                            word.iter().for_each(|it| unread.word(&self.text, it));
                        }
                        Some(false) => {
                            let setting = self.settings.pop();
                            unread.settings += usize::from(setting.is_some());
                        }
                        None => {}
                    }
                }
            }
        }
    }
}

/// What could not be read of a block.
#[derive(Debug, Default)]
pub(crate) struct Unread {
    /// The line is no block but text.
    pub(crate) is_text: bool,
    /// The letters of words, `G` and `M` among them.
    pub(crate) letters: Letters,
    /// What is written behind those of G and M, as far as it may be a number: digits, and letters in the place of such; it ends
    /// with [`CUT`] where something else stands behind it.
    pub(crate) codes: Vec<(u8, String)>,
    pub(crate) settings: usize,
}

impl Unread {
    /// A word that was read means something else.
    pub(crate) fn word(&mut self, text: &str, word: &Word) {
        self.letter(text, word.letter, word.columns.start);
    }

    fn letter(&mut self, text: &str, letter: u8, column: u32) {
        self.letters.insert(letter);
        if !matches!(letter, b'G' | b'M') {
            return;
        }
        let behind = text.chars().skip(column as usize);
        let behind = behind.filter(|it| !matches!(it, ' ' | '\t'));
        let mut written = String::new();
        for character in behind {
            match character {
                '0'..='9' | 'o' | 'O' => written.push(character),
                'a'..='z' | 'A'..='Z' | '.' | '(' | ';' | '#' | '/' => break,
                _ => {
                    written.push(CUT);
                    break;
                }
            }
        }
        self.codes.push((letter, written));
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
    fn new(text: &'a str, tokens: &'a [Token], steps: &'a mut Vec<Step>) -> Self {
        Self {
            text,
            tokens,
            at: 0,
            depth: 0,
            steps,
        }
    }

    /// Reads a word, a setting or a comment; `false` at the end.
    fn part(
        &mut self,
        words: &mut Vec<Word>,
        settings: &mut Vec<Setting>,
    ) -> Result<bool, Refusal> {
        let token = self.peek();
        match &token.kind {
            Kind::End => return Ok(false),
            Kind::Comment => self.at += 1,
            Kind::Letter(b'N') => {
                return Err(Refusal::new(token.columns, Fault::LineNumberPlace));
            }
            Kind::Letter(b'O') => {
                // Right behind a number it is a digit that was mistyped.
                let is_behind = |it: &Token| matches!(it.kind, Kind::Number(_));
                let is_digit = self.is_joined(self.at) && is_behind(&self.tokens[self.at - 1]);
                let fault = if is_digit {
                    Fault::LetterO
                } else {
                    Fault::FlowPlace
                };
                return Err(Refusal::new(token.columns, fault));
            }
            Kind::Letter(letter) => {
                self.refuse_macro()?;
                self.at += 1;
                let value = self.value("a value")?;
                words.push(Word {
                    letter: *letter,
                    columns: token.columns.to(value.columns),
                    value,
                });
            }
            Kind::Hash => {
                self.at += 1;
                let target = match self.name() {
                    Some(name) => Target::Named(name),
                    None => Target::Numbered(self.value("a parameter's number")?),
                };
                if !self.skip(&Kind::Equals) {
                    return Err(self.expected("`=` behind the parameter"));
                }
                let value = self.value("a value")?;
                settings.push(Setting {
                    target,
                    columns: token.columns.to(value.columns),
                    value,
                });
            }
            _ => return Err(self.expected("a word, a parameter setting or a comment")),
        }
        Ok(true)
    }

    /// Whether a token stands right behind the one before it.
    fn is_joined(&self, at: usize) -> bool {
        at > 0 && self.tokens[at - 1].columns.end == self.tokens[at].columns.start
    }

    fn is_letter(&self, at: usize) -> bool {
        matches!(self.tokens[at].kind, Kind::Letter(_))
    }

    /// Whether the block begins with a word of a language.
    fn begins_text(&self) -> bool {
        let is_text = |at: usize| self.is_letter(at) && (at == self.at || self.is_joined(at));
        self.at + LETTERS_OF_TEXT < self.tokens.len()
            && (self.at..self.at + LETTERS_OF_TEXT).all(is_text)
    }

    /// Goes behind a part that begins at `start` and was refused: to where the next may begin. Whether the part before it is
    /// spoilt by it.
    fn read_over(&mut self, start: usize, unread: &mut Unread) -> bool {
        self.depth = 0;
        let refused = self.at.max(start);
        let mut open = 0_usize;
        let mut letters = vec![start];
        let mut at = start;
        loop {
            match self.tokens[at].kind {
                Kind::End => break,
                Kind::Open => open += 1,
                Kind::Close => open = open.saturating_sub(1),
                Kind::Comment | Kind::Hash if open == 0 && at > start && at >= refused => break,
                Kind::Letter(_) if at > start && at >= refused => {
                    let goes_on = self.is_letter(at - 1) && self.is_joined(at);
                    if open == 0 && !goes_on {
                        break;
                    }
                    letters.push(at);
                }
                _ => {}
            }
            at += 1;
        }
        // In brackets that close letters are of functions.
        let is_closed = open == 0;
        let mut depth = 0_usize;
        for token in start..at {
            match self.tokens[token].kind {
                Kind::Open => depth += 1,
                Kind::Close => depth = depth.saturating_sub(1),
                Kind::Letter(letter) if letters.contains(&token) && !(depth > 0 && is_closed) => {
                    unread.letter(self.text, letter, self.tokens[token].columns.start);
                }
                _ => {}
            }
        }
        unread.settings += usize::from(self.tokens[start].kind == Kind::Hash);
        self.at = at;
        let only_letters = (start..at).all(|it| self.is_letter(it));
        match self.tokens[start].kind {
            // A digit that is written as a letter.
            Kind::Letter(b'O') | Kind::Number(_) => true,
            Kind::Letter(_) => only_letters && self.is_joined(start),
            Kind::Hash => false,
            _ => self.is_joined(start),
        }
    }

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
            // No function begins with it.
            Kind::Letter(b'O') => return Err(Refusal::new(self.peek().columns, Fault::LetterO)),
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
                    // `CALL 5`, whose L is no word's.
                    let is_longer = |keyword: &str| keyword.len() == written.len() + 1;
                    let mut longer = STATEMENTS.iter().filter(|it| is_longer(it.0));
                    if longer.any(|it| self.keyword(it.0)) {
                        return Err(self.expected("what the statement is given in brackets, `[…]`"));
                    }
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
