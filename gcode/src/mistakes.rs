//! What is said of a program behind its first mistake.
//!
//! Whoever checks a program wants all of its mistakes, and none that is no mistake. So the interpreter goes on behind a block that was
//! refused as if that had done what can be read of it: what is wrong is left out, and the modes, the feed, the offsets and the
//! motion of the rest take effect. What cannot be read is [lost](super::lost), and with it whatever is refused because of it: nothing
//! is said of an arc from a place that is not known. Nor of the contour of a cutter compensation, nor of the order of blocks behind a
//! broken branch, where each is judged by itself.

use std::collections::VecDeque;
use std::io;

use super::axes::AxisLetter;
use super::block::{Block, Statement, Target};
use super::error::{Error, Fault, Origin, Refusal};
use super::execute::{Come, Compensated, STAGES, State};
use super::expression::Value;
use super::flow::is_flow;
use super::interpreter::Interpreter;
use super::lexer::Kind;
use super::lost::Things;
use super::modal::{Code, Group, Motion};
use super::parser::Unread;
use super::source::{Place, Read1};
use super::words::Words;

impl Interpreter {
    /// After an error goes on behind its block, to find the program's other mistakes; what comes is
    /// not to be run. Where it is not known what comes next, as behind a mistake in a branch or a call, the rest of the
    /// file is judged block by block. `false` if nothing can be said of what is behind.
    pub fn go_on(&mut self, error: &Error) -> bool {
        if error.fault.ends_reading() {
            return false;
        }
        self.mistaken = true;
        self.actions.clear();
        self.ended = false;
        if !self.only_read {
            self.go_on_executing(error);
        }
        self.actions.clear();
        (self.compensation, self.left) = (None, None);
        self.contour_lost = self.state.cutter().is_some();
        self.settled_at = self.state.at;
        true
    }

    fn go_on_executing(&mut self, error: &Error) {
        let is_this = error.line == self.line
            && error.block == self.block.text
            && error.file == self.files[self.current].name;
        let mut flow_lost =
            self.reads_over || error.fault.loses_the_flow() || is_flow(&error.block);
        if is_this && !flow_lost {
            self.salvage(&error.fault);
        }
        match self.state.stopping {
            _ if flow_lost => {}
            Some(Code::M(2 | 30)) => self.ended = true,
            Some(Code::M(98 | 99)) => flow_lost = true,
            _ => {}
        }
        if flow_lost {
            self.ended = is_this && self.go_behind(error).is_err();
            self.only_read = true;
        }
    }

    /// Notes what is wrong with the block that is read over.
    pub(super) fn note(&mut self, refusal: Refusal) {
        let text = self.block.text.as_str().into();
        let span = self.span();
        self.noted.push_back(Refusal {
            origin: Some(Box::new(Origin { span, text })),
            ..refusal
        });
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
    /// no more. Behind a subroutine its first caller is read on.
    pub(super) fn judge_block(&mut self) -> Result<(), Refusal> {
        if !self.read_block()? || self.block.percent {
            return self.leave_calls();
        }
        if self.is_deleted() {
            return Ok(());
        }
        let flow = self.block.flow.as_ref();
        if flow.is_some_and(|it| it.statement == Statement::EndSub) && self.is_called() {
            return self.leave_calls();
        }
        match self.state.judge(&self.block)? {
            Some(Code::M(2 | 30)) => self.ended = true,
            Some(Code::M(99)) if self.is_called() => return self.leave_calls(),
            _ => {}
        }
        Ok(())
    }

    fn leave_calls(&mut self) -> Result<(), Refusal> {
        match self.first_caller() {
            Some(at) => self.go_to(at),
            None => {
                self.ended = true;
                Ok(())
            }
        }
    }

    /// Whether the program goes on by what is not known: from there on each block is judged by itself.
    pub(super) fn loses_the_way(&mut self) -> bool {
        let Some(flow) = &self.block.flow else {
            return false;
        };
        use Statement::{ElseIf, If, Repeat, While};
        let is_lost = |value: &Value| self.state.is_lost(&self.block, value);
        let by_argument = matches!(flow.statement, If | ElseIf | While | Repeat)
            && self.block.arguments.iter().any(is_lost);
        let by_label = flow.label.computed().is_some_and(is_lost);
        self.only_read |= by_argument || by_label;
        self.only_read
    }

    /// Whether the block calls a subprogram, or goes through one so often, as is not known.
    pub(super) fn calls_what_is_lost(&self) -> bool {
        self.state.lost.letters.has_any_of(b"PL")
    }

    /// Does what can be read of the block, which was refused.
    fn salvage(&mut self, fault: &Fault) {
        let text = self.block.text.clone();
        let is_cut = matches!(fault, Fault::LineTooLong { .. });
        let unread = match is_cut {
            // So much of it was read.
            true => {
                let begin = String::from_utf8_lossy(&self.bytes).into_owned();
                self.block.parse_what_can_be(&begin)
            }
            false => self.block.parse_what_can_be(&text),
        };
        let tokens = &self.block.tokens.list;
        let is_comment = |at: usize| tokens.get(at).is_some_and(|it| it.kind == Kind::Comment);
        if is_cut && !is_comment(tokens.len().wrapping_sub(2)) {
            self.state.lost.lose_all();
            (self.state.nurbs, self.state.nurbs_start) = (None, None);
        } else if !self.is_deleted() && !self.block.percent {
            self.state.do_what_can_be_read(&self.block, unread, fault);
        }
        self.ended |= self.block.percent && self.started;
        self.block.text = text;
    }

    /// What is wrong with the block of an error whatever comes before it.
    pub(super) fn wrong_by_itself(&self, error: &Error) -> Option<Refusal> {
        let is_this = error.line == self.line && error.block == self.block.text;
        is_this
            .then(|| self.state.judge(&self.block).err())
            .flatten()
    }

    /// Whether an error may be none, by what is not known behind an earlier one.
    pub(super) fn follows(&self, error: &Error) -> bool {
        let State { lost, .. } = &self.state;
        !lost.is_nothing() && (lost.is_behind(&error.fault) || self.is_by_lost_values(error))
    }

    /// Whether the block of an error goes by values that are not known.
    fn is_by_lost_values(&self, error: &Error) -> bool {
        let block = &self.block;
        if error.block != block.text || error.line != self.line {
            return false;
        }
        let is_told = match &error.fault {
            Fault::UnknownCode(_)
            | Fault::Unsupported { .. }
            | Fault::Conflict { .. }
            | Fault::Value {
                letter: 'G' | 'M', ..
            } => self.state.judge(block).is_err(),
            Fault::UnusedWord { .. } | Fault::MissingWord { .. } | Fault::NoMotion => true,
            fault => fault.is_misspelling(),
        };
        let words = block.words.iter().map(|it| &it.value);
        let settings = block.settings.iter().flat_map(|it| {
            let index = match &it.target {
                Target::Numbered(index) => Some(index),
                Target::Named(_) => None,
            };
            index.into_iter().chain([&it.value])
        });
        let mut values = words.chain(settings).chain(&block.arguments);
        !is_told && values.any(|value| self.state.is_lost(block, value))
    }
}

impl State {
    /// Does what can be read of a block that was refused: what [`execute`](Self::execute) did of it before is not done again.
    fn do_what_can_be_read(&mut self, block: &Block, mut unread: Unread, fault: &Fault) {
        if unread.is_text {
            return self.lost.lose_axes();
        }
        let (words, may_be_any_axis) = self.words_that_can_be_read(block, &mut unread);
        let mut words = words;
        if self.come == Come::Nowhere {
            for setting in &block.settings {
                let is_set = self.set_what_can_be(block, setting);
                unread.settings += usize::from(!is_set);
            }
            self.know(block, &words);
        }
        self.stopping = words.code(Group::Stopping);
        self.lose_unread(&unread, &words);
        unread
            .letters
            .iter()
            .for_each(|it| self.lost.letters.insert(it));
        let next = match self.come {
            Come::Nowhere | Come::ToSettings => 0,
            Come::ToStage(refused) => {
                self.lose_stage(refused, &words);
                // What is not possible in a contour is not in effect.
                let is_possible = refused > 0;
                if is_possible {
                    refused + 1
                } else {
                    STAGES.len()
                }
            }
            Come::BehindMotion => STAGES.len(),
        };
        let commands = &mut VecDeque::new();
        for (index, (stage, _)) in STAGES.iter().enumerate().skip(next) {
            self.come = Come::ToStage(index);
            let done = stage(self, block, &mut words, commands);
            if done.is_err() && self.come != Come::BehindMotion {
                self.lose_stage(index, &words);
            }
        }
        self.set_places();
        // Words of axes may be those of another code: the time of a dwell, what is not possible in a contour.
        let of_others = matches!(
            fault,
            Fault::MissingWord { .. } | Fault::UnusedWord { .. } | Fault::WhileCompensated { .. }
        );
        for axis in AxisLetter::ALL {
            if of_others && words.has(axis.letter() as u8) {
                self.lost.axes.insert(axis);
            }
        }
        if self.lost.has(Things::NURBS) {
            (self.nurbs, self.nurbs_start) = (None, None);
        }
        let is_moved = words.has_axes() || words.has_polar();
        if self.lose_axes_of(&unread, may_be_any_axis) || is_moved {
            // The way off a contour is this block's.
            if self.compensated == Compensated::Leaving {
                self.compensated = Compensated::Off;
            }
        }
    }

    /// The words of a block whose values are known, and whether one of the others may be of any axis.
    fn words_that_can_be_read(&self, block: &Block, unread: &mut Unread) -> (Words, bool) {
        let mut words = Words::default();
        let mut stack = Vec::new();
        let mut may_be_any_axis = false;
        // A parameter is not any more what it was.
        let has_set = self.come != Come::Nowhere && !block.settings.is_empty();
        for word in &block.words {
            let value = block.evaluate(&word.value, self, &mut stack);
            let is_known =
                self.has_axis_of(word).is_ok() && (!has_set || block.is_constant(&word.value));
            let value = value.ok().filter(|_| is_known);
            let added = value.map(|value| words.add(word.letter, value, word.columns));
            if added.is_some_and(|it| it.is_ok()) {
                continue;
            }
            // A letter that is written twice is one that was meant to be another.
            may_be_any_axis |= words.has(word.letter);
            unread.word(&block.text, word);
        }
        let axes = self.setup.axes;
        let mut named = unread.letters.iter().map(char::from);
        may_be_any_axis |= named
            .any(|letter| AxisLetter::from_letter(letter).is_some_and(|axis| !axes.contains(axis)));
        (words, may_be_any_axis)
    }

    /// One of the [`STAGES`] was refused.
    fn lose_stage(&mut self, index: usize, words: &Words) {
        let set = Things::set_by_words(words) | Things::NURBS;
        let leads = matches!(words.code(Group::Offsets), Some(Code::G(280 | 282 | 300)));
        let things = STAGES[index].1;
        self.lost.lose(things & set);
        if leads && things.contains(Things::TABLE) {
            self.lost.lose_axes();
        }
        if index + 1 == STAGES.len() {
            self.lost.lose(Things::SERIES | Things::NURBS);
            self.lose_ends(words);
        }
    }

    /// A motion was refused before it was known where it leads.
    fn lose_ends(&mut self, words: &Words) {
        use Motion::{Arc, Feed, Probe, Rapid, Tap, Thread};
        let is_straight = matches!(
            self.modes.motion,
            Rapid | Feed | Arc(_) | Probe(_) | Thread | Tap
        );
        let is_turned = words.has_polar() || self.coordinates().rotation != 0.0;
        for axis in AxisLetter::ALL {
            let by_others = !is_straight && axis.index() < 3 || is_turned && axis.index() < 2;
            if by_others || words.has(axis.letter() as u8) {
                self.lost.axes.insert(axis);
            }
        }
    }

    /// Where axes are whose words could not be read is lost; whether there are such.
    fn lose_axes_of(&mut self, unread: &Unread, may_be_any: bool) -> bool {
        if may_be_any {
            self.lost.lose_axes();
        }
        let is_turned = self.coordinates().rotation != 0.0;
        let is_in_plane =
            unread.letters.has_any_of(b"@^") || (is_turned && unread.letters.has_any_of(b"XY"));
        let mut has_any = may_be_any;
        for axis in AxisLetter::ALL {
            if unread.letters.has(axis.letter() as u8) || (is_in_plane && axis.index() < 2) {
                self.lost.axes.insert(axis);
                has_any = true;
            }
        }
        has_any
    }
}
