//! What is said of a program behind its first mistake.
//!
//! Whoever checks a program wants all of its mistakes, and none that is no mistake. So the interpreter goes on behind a block that was
//! refused as if that had done what can be read of it: what is wrong is left out, and the modes, the feed, the offsets and the
//! motion of the rest take effect. What cannot be read is [`Lost`], and with it whatever is refused because of it: nothing is said of
//! an arc from a place that is not known. Nor of the contour of a cutter compensation, nor of the order of blocks behind a
//! broken branch, where each is judged by itself.

use std::collections::VecDeque;
use std::io;

use super::axes::{AxisLetter, AxisSet};
use super::block::Block;
use super::error::{Error, Fault, Refusal};
use super::execute::State;
use super::flow::is_flow;
use super::interpreter::Interpreter;
use super::lexer::Columns;
use super::modal::{Group, Motion};
use super::source::{Place, Read1};
use super::words::Words;

/// So many parts of a block are left out to read the others.
const MOST_PARTS: usize = 8;

/// What is not known behind blocks that were refused.
#[derive(Debug, Default)]
pub(crate) struct Lost {
    /// Where these axes are.
    pub(crate) axes: AxisSet,
    /// Where the last motion began, or where it led.
    pub(crate) ends: bool,
    /// The feed.
    pub(crate) feed: bool,
    /// Whether positions are absolute.
    pub(crate) distance: bool,
    /// Which motion goes on.
    pub(crate) motion: bool,
    /// Where the program has its zero.
    pub(crate) offsets: bool,
    /// How the spindle turns.
    pub(crate) spindle: bool,
    /// What parameters are.
    pub(crate) parameters: bool,
}

impl Lost {
    /// Whether it is not known which places words of axes mean.
    pub(crate) fn is_meant_otherwise(&self) -> bool {
        self.distance || self.offsets
    }
}

impl Interpreter {
    /// After an error goes on behind its block, to find the program's other mistakes; what comes is
    /// not to be run. Where it is not known what comes next, as behind a mistake in a branch or a call, the rest of the
    /// file is judged block by block. `false` if nothing can be said of what is behind.
    pub fn go_on(&mut self, error: &Error) -> bool {
        if error.fault.ends_reading() {
            return false;
        }
        let flow_lost = self.reads_over || error.fault.loses_the_flow() || is_flow(&error.block);
        if flow_lost && !self.only_read {
            if self.go_behind(error).is_err() {
                return false;
            }
            self.only_read = true;
        }
        if !self.only_read && error.line == self.line && error.block == self.block.text {
            self.salvage(&error.fault);
        }
        self.actions.clear();
        (self.compensation, self.left) = (None, None);
        self.contour_lost = self.state.cutter().is_some();
        self.settled_at = self.state.at;
        self.ended = false;
        true
    }

    /// Goes behind the block of an error.
    fn go_behind(&mut self, error: &Error) -> io::Result<()> {
        let file = self.files.iter().position(|it| it.name == error.file);
        self.current = file.unwrap_or(self.current);
        let lines = &mut self.files[self.current].lines;
        lines.go_to(Place::START)?;
        while lines.place().line <= error.line && lines.read(&mut self.bytes)? != Read1::End {}
        Ok(())
    }

    /// Reads a block for mistakes that it has whatever comes before it; at the end of the program or the file there is
    /// no more.
    pub(super) fn judge_block(&mut self) -> Result<(), Refusal> {
        if !self.read_block()? || self.block.percent {
            self.ended = true;
            return Ok(());
        }
        if self.is_deleted() {
            return Ok(());
        }
        self.ended = self.state.judge(&self.block)?;
        Ok(())
    }

    /// Whether the program goes on by a parameter that is not known: from there on each block is judged by itself.
    pub(super) fn loses_the_way(&mut self) -> bool {
        let mut arguments = self.block.arguments.iter();
        let asks = arguments.any(|it| !self.block.is_constant(it));
        self.only_read |= asks && self.state.lost.parameters;
        self.only_read
    }

    /// Does what can be read of the block, which was refused.
    fn salvage(&mut self, fault: &Fault) {
        let text = self.block.text.clone();
        let mut left = text.clone();
        let mut refused = self.block.parse(&text).err();
        for _ in 0..MOST_PARTS {
            let Some(refusal) = refused else {
                break;
            };
            left = without(&left, refusal.columns);
            refused = self.block.parse(&left).err();
        }
        if refused.is_some() {
            left.clear();
        }
        if self.block.parse(&left).is_ok() {
            let read = match fault {
                // Modes that are not possible there are not in effect.
                Fault::WhileCompensated { .. } => Words::default(),
                _ => self.state.do_what_can_be_read(&self.block),
            };
            self.state.lose(&without_comments(&text), &read);
        }
        self.block.text = text;
    }

    /// Whether an error may be none, by what is not known behind an earlier one.
    pub(super) fn follows(&self, error: &Error) -> bool {
        let State { lost, modes, .. } = &self.state;
        let is_arc_of_unknown_ends = lost.ends && matches!(modes.motion, Motion::Arc(_));
        match error.fault {
            Fault::SoftLimit { axis, .. } => is_arc_of_unknown_ends || lost.axes.contains(axis),
            Fault::CycleBelow { axis, .. } => lost.axes.contains(axis),
            Fault::ArcNearlyClosed { .. }
            | Fault::ArcRadii { .. }
            | Fault::ArcNoRadius
            | Fault::ArcRadiusSamePoint
            | Fault::ArcTooFar { .. } => is_arc_of_unknown_ends,
            Fault::ProbeTooShort { .. } => !lost.axes.is_empty(),
            Fault::NoFeed { .. } | Fault::FeedZero { .. } => lost.feed,
            Fault::CycleSpindle { .. }
            | Fault::ThreadSpindle { .. }
            | Fault::FeedPerTurnSpindle { .. } => lost.spindle,
            Fault::ParameterUnset(_) => lost.parameters,
            Fault::UnusedWord { letter } => lost.motion && "IJKRPQL".contains(letter),
            Fault::NoMotion | Fault::ArcUndefined(_) | Fault::ArcOffsetPlane { .. } => lost.motion,
            _ => false,
        }
    }
}

impl State {
    /// Executes those words of a block that can be, in the order of [`execute`](Self::execute); a motion whose target was known already is
    /// not made again. Which words these are.
    fn do_what_can_be_read(&mut self, block: &Block) -> Words {
        let mut words = Words::default();
        let mut stack = Vec::new();
        for word in &block.words {
            let value = block.evaluate(&word.value, self, &mut stack);
            if let (Ok(()), Ok(value)) = (self.has_axis_of(word), value) {
                let _ = words.add(word.letter, value, word.columns);
            }
        }
        let mut commands = VecDeque::new();
        let commands = &mut commands;
        let _ = self.end_compensation_by(&words);
        let _ = self.feeds(&mut words);
        let _ = self.tools(&mut words, commands);
        let _ = self.spindle(&mut words, commands);
        let _ = self.coolant(&words, commands);
        let _ = self.set_modes(&mut words, commands);
        let _ = self.offsets(&mut words, commands);
        if !self.target_is_known {
            let _ = self.motion(block, &mut words, commands);
        }
        words
    }

    /// What the text of a block names and nobody could read is lost.
    fn lose(&mut self, text: &str, read: &Words) {
        let written = |letter: u8| {
            text.bytes()
                .filter(move |it| it.eq_ignore_ascii_case(&letter))
        };
        let names = |letter: u8| written(letter).next().is_some() && !read.has(letter);
        if written(b'G').count() > read.g_codes() {
            (self.lost.distance, self.lost.motion, self.lost.offsets) = (true, true, true);
        }
        let is_of_unknown_tool = read.code(Group::ToolLength).is_some() && names(b'H');
        self.lost.offsets |= is_of_unknown_tool || read.code(Group::Offsets).is_some();
        for axis in AxisLetter::ALL {
            let is_polar = axis.index() < 2 && (names(b'@') || names(b'^'));
            let letter = axis.letter() as u8;
            if is_polar || names(letter) || (self.lost.is_meant_otherwise() && read.has(letter)) {
                self.lost.axes.insert(axis);
            }
        }
        self.lost.feed |= names(b'F');
        self.lost.spindle |= names(b'S');
        self.lost.parameters |= text.contains('#') && text.contains('=');
    }
}

/// A line without its comments.
fn without_comments(line: &str) -> String {
    let line = line.split_once(';').map_or(line, |(before, _)| before);
    let parts = line.split('(').enumerate().map(|(at, part)| match at {
        0 => part,
        _ => part.split_once(')').map_or("", |(_, behind)| behind),
    });
    parts.collect()
}

/// A line without the words that these columns touch, nor the one that stands right before them.
fn without(line: &str, columns: Columns) -> String {
    let characters: Vec<char> = line.chars().collect();
    let begins_word = |it: &char| it.is_ascii_alphabetic() || matches!(it, '@' | '^' | '#');
    let end = (columns.end as usize - 1).min(characters.len());
    let start = (columns.start as usize - 1).min(end);
    let is_joined = start > 0 && !characters[start - 1].is_whitespace();
    let word_before = || characters[..start].iter().rposition(begins_word);
    let from = match is_joined {
        true => word_before().unwrap_or(0),
        false => start,
    };
    let behind = characters[end..].iter().position(begins_word);
    let to = behind.map_or(characters.len(), |it| end + it);
    characters[..from].iter().chain(&characters[to..]).collect()
}
