//! A line's characters become tokens, each with its columns.
//!
//! Blanks mean nothing outside comments and letters have no case, as in RS-274/NGC: `g0 x 1 2.5` is
//! `G0X12.5`. Letters come one by one; the parser knows where they make a name such as `SQRT`.

use std::ops::Range;

use super::error::{Fault, Refusal};

/// The columns of a token, block or word: counted in characters from 1, `end` is the one behind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Columns {
    /// First column.
    pub start: u32,
    /// The column behind the last.
    pub end: u32,
}

impl Columns {
    /// From the start of `self` to the end of `last`.
    pub(crate) fn to(self, last: Columns) -> Columns {
        Columns {
            start: self.start,
            end: last.end.max(self.end),
        }
    }
}

/// What a token is.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Kind {
    /// An upper-case ASCII letter, or `@` or `^`, which begin words as letters do.
    Letter(u8),
    /// A number without its sign.
    Number(f64),
    /// `<name>`: lower case, without blanks; a range of [`Tokens::names`].
    Name(Range<usize>),
    /// A comment.
    Comment,
    Plus,
    Minus,
    Star,
    Power,
    Slash,
    Open,
    Close,
    Hash,
    Equals,
    Percent,
    /// What is no token, where what can be read is looked for.
    Bad,
    /// The end of the line.
    End,
}

/// A token and its columns.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Token {
    pub(crate) kind: Kind,
    pub(crate) columns: Columns,
}

/// The tokens of one line; reused from line to line.
#[derive(Debug, Default)]
pub(crate) struct Tokens {
    /// Ends with exactly one [`Kind::End`].
    pub(crate) list: Vec<Token>,
    pub(crate) names: String,
    /// What stands in comments.
    pub(crate) comments: Vec<Range<usize>>,
    digits: String,
}

impl Tokens {
    /// Replaces the tokens by those of `line`.
    pub(crate) fn read(&mut self, line: &str) -> Result<(), Refusal> {
        self.read_or(line, Err)
    }

    /// As [`read`](Self::read); what is no token is [`Kind::Bad`], and a comment without an end one to the line's.
    pub(crate) fn read_what_can_be(&mut self, line: &str) {
        let _ = self.read_or(line, |_| Ok(()));
    }

    fn read_or(
        &mut self,
        line: &str,
        bad: impl Fn(Refusal) -> Result<(), Refusal>,
    ) -> Result<(), Refusal> {
        self.list.clear();
        self.names.clear();
        self.comments.clear();
        let mut cursor = Cursor {
            line,
            offset: 0,
            column: 1,
        };
        loop {
            cursor.skip_blanks();
            let start = cursor.column;
            let Some(character) = cursor.next() else {
                self.push(Kind::End, start, start + 1);
                return Ok(());
            };
            let kind = match self.token(character, start, &mut cursor) {
                Ok(kind) => kind,
                Err(refusal) => {
                    bad(refusal)?;
                    match character {
                        '(' => {
                            while cursor.next().is_some_and(|it| it != ')') {}
                            Kind::Comment
                        }
                        _ => Kind::Bad,
                    }
                }
            };
            self.push(kind, start, cursor.column);
        }
    }

    /// The token that begins with a character, behind which the cursor is.
    fn token(
        &mut self,
        character: char,
        start: u32,
        cursor: &mut Cursor<'_>,
    ) -> Result<Kind, Refusal> {
        Ok(match character {
            'a'..='z' | 'A'..='Z' | '@' | '^' => Kind::Letter(character.to_ascii_uppercase() as u8),
            '0'..='9' | '.' => self.number(character, cursor)?,
            '<' => self.name(start, cursor)?,
            '(' => {
                let from = cursor.offset;
                let comment = comment(start, cursor)?;
                self.comments.push(from..cursor.offset - 1);
                comment
            }
            ';' => {
                self.comments.push(cursor.offset..cursor.line.len());
                while cursor.next().is_some() {}
                Kind::Comment
            }
            '*' => {
                let after_star = cursor.clone();
                cursor.skip_blanks();
                if cursor.next() == Some('*') {
                    Kind::Power
                } else {
                    *cursor = after_star;
                    Kind::Star
                }
            }
            '+' => Kind::Plus,
            '-' => Kind::Minus,
            '/' => Kind::Slash,
            '[' => Kind::Open,
            ']' => Kind::Close,
            '#' => Kind::Hash,
            '=' => Kind::Equals,
            '%' => Kind::Percent,
            other => {
                // Without a number before it: `X,5`.
                let decimals = (other == ',').then(|| cursor.decimals()).flatten();
                let fault = match decimals {
                    Some(decimals) => comma("0", &decimals),
                    None => Fault::Character(other),
                };
                return Err(Refusal::new(cursor.since(start), fault));
            }
        })
    }

    fn push(&mut self, kind: Kind, start: u32, end: u32) {
        self.list.push(Token {
            kind,
            columns: Columns { start, end },
        });
    }

    /// Digits with at most one decimal point and at least one digit.
    fn number(&mut self, first: char, cursor: &mut Cursor<'_>) -> Result<Kind, Refusal> {
        let start = cursor.column - 1;
        let mut point = first == '.';
        self.digits.clear();
        self.digits.push(first);
        let mut behind = cursor.clone();
        loop {
            cursor.skip_blanks();
            match cursor.next() {
                Some(digit @ '0'..='9') => self.digits.push(digit),
                Some('.') if !point => {
                    point = true;
                    self.digits.push('.');
                }
                _ => break,
            }
            behind = cursor.clone();
        }
        // Blanks behind the last digit are not the number's.
        *cursor = behind;
        if let Some(decimals) = cursor.decimals_behind_comma() {
            let fault = comma(&self.digits, &decimals);
            return Err(Refusal::new(cursor.since(start), fault));
        }
        match self.digits.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(Kind::Number(value)),
            _ => Err(Refusal::new(
                Columns {
                    start,
                    end: cursor.column,
                },
                Fault::Number(self.digits.clone()),
            )),
        }
    }

    fn name(&mut self, start: u32, cursor: &mut Cursor<'_>) -> Result<Kind, Refusal> {
        let from = self.names.len();
        loop {
            match cursor.next() {
                Some('>') => break,
                Some(' ' | '\t') => {}
                Some(character) => self.names.extend(character.to_lowercase()),
                None => return Err(Refusal::new(cursor.since(start), Fault::UnclosedName)),
            }
        }
        if self.names.len() == from {
            return Err(Refusal::new(cursor.since(start), Fault::EmptyName));
        }
        Ok(Kind::Name(from..self.names.len()))
    }
}

/// What is wrong with a number that has a comma behind these digits.
fn comma(digits: &str, decimals: &str) -> Fault {
    if digits.contains('.') || decimals.contains(['.', ',']) {
        return Fault::Commas;
    }
    Fault::Comma(format!("{digits}.{decimals}"))
}

fn comment(start: u32, cursor: &mut Cursor<'_>) -> Result<Kind, Refusal> {
    loop {
        let column = cursor.column;
        match cursor.next() {
            Some(')') => return Ok(Kind::Comment),
            Some('(') => return Err(Refusal::new(cursor.since(column), Fault::NestedComment)),
            Some(_) => {}
            None => return Err(Refusal::new(cursor.since(start), Fault::UnclosedComment)),
        }
    }
}

/// Walks over a line's characters.
#[derive(Clone)]
struct Cursor<'a> {
    line: &'a str,
    offset: usize,
    column: u32,
}

impl Cursor<'_> {
    fn next(&mut self) -> Option<char> {
        let character = self.line[self.offset..].chars().next()?;
        self.offset += character.len_utf8();
        self.column += 1;
        Some(character)
    }

    /// The digits behind a comma that comes next, with what else is written as part of a number; the cursor is behind
    /// them then.
    fn decimals_behind_comma(&mut self) -> Option<String> {
        let mut behind = self.clone();
        behind.skip_blanks();
        (behind.next()? == ',').then_some(())?;
        let decimals = behind.decimals()?;
        *self = behind;
        Some(decimals)
    }

    /// The digits that come next, with points and commas between them; the cursor is behind them then.
    fn decimals(&mut self) -> Option<String> {
        let mut decimals = String::new();
        let mut ahead = self.clone();
        loop {
            ahead.skip_blanks();
            match ahead.next() {
                Some(digit @ '0'..='9') => decimals.push(digit),
                Some(other @ ('.' | ',')) if !decimals.is_empty() => decimals.push(other),
                _ => break,
            }
            if decimals.ends_with(|last: char| last.is_ascii_digit()) {
                *self = ahead.clone();
            }
        }
        let length = decimals.trim_end_matches(['.', ',']).len();
        decimals.truncate(length);
        (!decimals.is_empty()).then_some(decimals)
    }

    fn skip_blanks(&mut self) {
        while matches!(
            self.line.as_bytes().get(self.offset),
            Some(b' ' | b'\t' | b'\x0c')
        ) {
            self.offset += 1;
            self.column += 1;
        }
    }

    fn since(&self, start: u32) -> Columns {
        Columns {
            start,
            end: self.column,
        }
    }
}
