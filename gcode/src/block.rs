//! One line of a program as its words, parameter settings and flow statement.

use std::ops::Range;

use super::expression::{Step, Value};
use super::lexer::{Columns, Tokens};

/// A letter and its value.
#[derive(Clone, Debug)]
pub(crate) struct Word {
    /// Upper case.
    pub(crate) letter: u8,
    pub(crate) value: Value,
    pub(crate) columns: Columns,
}

/// What a parameter setting sets.
#[derive(Clone, Debug)]
pub(crate) enum Target {
    /// `#n`, `#[…]`, `##n`: the index.
    Numbered(Value),
    /// `#<name>`: a range of the block's names.
    Named(Range<usize>),
}

/// `#… = …`
#[derive(Clone, Debug)]
pub(crate) struct Setting {
    pub(crate) target: Target,
    pub(crate) value: Value,
    pub(crate) columns: Columns,
}

/// How an O-word names what it belongs to.
#[derive(Clone, Debug)]
pub(crate) enum Label {
    /// `O100`
    Number(u32),
    /// `O<name>`: a range of the block's names.
    Name(Range<usize>),
    /// `O#1`, `O[#1 + 2]`: only for calls.
    Computed(Value),
}

impl Label {
    pub(crate) fn computed(&self) -> Option<&Value> {
        match self {
            Label::Computed(value) => Some(value),
            Label::Number(_) | Label::Name(_) => None,
        }
    }
}

/// What an O-word says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Statement {
    /// The O-word alone: the number of a program or of a subprogram for M98.
    Program,
    Sub,
    EndSub,
    Return,
    Call,
    If,
    ElseIf,
    Else,
    EndIf,
    While,
    EndWhile,
    Do,
    Repeat,
    EndRepeat,
    Break,
    Continue,
}

/// An O-word with its statement. The condition, count, result or arguments are the block's
/// [`Block::arguments`].
#[derive(Clone, Debug)]
pub(crate) struct Flow {
    pub(crate) label: Label,
    pub(crate) statement: Statement,
    pub(crate) columns: Columns,
}

/// A parsed line; reused from line to line, so that a block costs no memory of its own.
#[derive(Debug, Default)]
pub(crate) struct Block {
    /// The line as it was read.
    pub(crate) text: String,
    pub(crate) tokens: Tokens,
    /// The line begins with `/`.
    pub(crate) delete: bool,
    /// The line is `%`.
    pub(crate) percent: bool,
    pub(crate) words: Vec<Word>,
    pub(crate) settings: Vec<Setting>,
    pub(crate) flow: Option<Flow>,
    /// What stands in brackets behind a flow statement.
    pub(crate) arguments: Vec<Value>,
    /// The steps that every [`Value`] of the block points into.
    pub(crate) steps: Vec<Step>,
}

impl Block {
    /// The columns from the first token to the last.
    pub(crate) fn columns(&self) -> Columns {
        match self.tokens.list.as_slice() {
            [first, .., last, _end] => first.columns.to(last.columns),
            [first, ..] => first.columns,
            [] => Columns { start: 1, end: 2 },
        }
    }

    pub(crate) fn name(&self, range: &Range<usize>) -> &str {
        &self.tokens.names[range.clone()]
    }
}
