//! What is said of a program behind its first mistake.
//!
//! Whoever checks a program wants all of its mistakes, and none that is no mistake. So the interpreter goes on behind a block that was
//! refused, as if that had done what can be read of it, and says nothing of what it cannot know any more: the contour
//! of a cutter compensation, which blocks come behind a broken branch, and places behind a block that was to lead elsewhere.

use std::io;

use super::axes::AxisLetter;
use super::error::{Error, Fault, Refusal};
use super::execute::State;
use super::flow::is_flow;
use super::interpreter::Interpreter;
use super::modal::Motion;
use super::source::{Place, Read1};

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
        self.lose_places(error);
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

    /// An axis that the refused block names is where that block was to lead, which is known only if its target was.
    fn lose_places(&mut self, error: &Error) {
        if self.state.target_is_known {
            return;
        }
        for axis in AxisLetter::ALL {
            let is_named = |it: char| it.eq_ignore_ascii_case(&axis.letter());
            let is_polar = axis.index() < 2 && error.block.contains(['@', '^']);
            if is_polar || error.block.contains(is_named) {
                self.state.lost.insert(axis);
            }
        }
    }

    /// Whether an error may be none, as it is not known where the axes are behind an earlier one.
    pub(super) fn follows(&self, error: &Error) -> bool {
        let State {
            lost,
            begins_lost,
            modes,
            ..
        } = &self.state;
        let is_arc_from_somewhere = *begins_lost && matches!(modes.motion, Motion::Arc(_));
        match error.fault {
            Fault::SoftLimit { axis, .. } => is_arc_from_somewhere || lost.contains(axis),
            Fault::CycleBelow { axis, .. } => lost.contains(axis),
            Fault::ArcNearlyClosed { .. }
            | Fault::ArcRadii { .. }
            | Fault::ArcNoRadius
            | Fault::ArcRadiusSamePoint
            | Fault::ArcTooFar { .. } => is_arc_from_somewhere,
            Fault::ProbeTooShort { .. } => !lost.is_empty(),
            _ => false,
        }
    }
}
