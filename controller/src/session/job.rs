//! The program that runs: where on its moves the setpoint is.

use crate::control::Row;
use crate::machine::{COORDINATES, Position};
use crate::program::{ModalState, Moves};
use syncline_gcode::Place;

/// The tool follows later than the setpoint: it may be on what that was on so many rows before.
const ROWS_BEHIND: usize = 8;
/// Moves that are kept behind the setpoint's: the path may go back along them.
const KEPT: u32 = 4096;

/// A program that runs.
pub(super) struct Job {
    /// As the cycle knows it.
    pub(super) number: u64,
    pub(super) moves: Moves,
    /// The line of the block at work.
    pub(super) line: u32,
    /// What is in effect in it, once a move is at work.
    pub(super) modal: Option<ModalState>,
    /// Of the move that the path has come to; `None` off the path.
    pub(super) tag: Option<u32>,
    /// Of the moves at the last rows, the newest first.
    last: [u32; ROWS_BEHIND],
    /// The path has moved.
    has_moved: bool,
    /// The path has rested for a block since it moved.
    rested: bool,
    /// The line of the block that the path rests for.
    rests_for: Option<u32>,
    /// The path has dwelt for a block since it moved.
    dwelt: bool,
    /// Behind the last probing or homing.
    behind: Option<Place>,
    /// It is over, and may still come to rest.
    over: bool,
}

impl Job {
    /// The program whose moves come up there.
    pub(super) fn new(number: u64, moves: Moves) -> Self {
        Self {
            number,
            moves,
            line: 0,
            modal: None,
            tag: None,
            last: [0; ROWS_BEHIND],
            has_moved: false,
            rested: false,
            rests_for: None,
            dwelt: false,
            behind: None,
            over: false,
        }
    }

    /// The job is over. From where the axes rest then, they may go anywhere, and stop there: none of its
    /// moves says where they are to be.
    pub(super) fn end(&mut self) {
        self.over = true;
        self.modal = None;
        self.rests_for = None;
    }

    /// The program goes on behind a probing or a homing in this line, from where that ended: on none of its moves so far.
    pub(super) fn found(&mut self, line: u32) {
        let tag = self.last[0];
        self.behind = self.moves.found(tag, line).or(self.behind);
        self.moves.passed(tag + 1);
        self.rests_for = None;
    }

    /// Something of it has been done.
    pub(super) fn has_moved(&self) -> bool {
        self.has_moved || self.rested || self.behind.is_some()
    }

    /// The line of the block that the path rests for.
    pub(super) fn rests_for(&self) -> Option<u32> {
        self.rests_for
    }

    /// The program waits for an operator, for a block in this line.
    pub(super) fn pauses(&mut self, line: u32) {
        (self.line, self.rested) = (line, true);
        self.rests_for = Some(line);
    }

    /// The path goes back from where it waited: it is before that now.
    pub(super) fn steps_back(&mut self) {
        self.rests_for = None;
    }

    /// Where the machine stood when the program began, and where to resume the program so that nothing of its path is
    /// left out: where the path rests `at`, or, where axes may not have followed to there, from the first of the
    /// moves at the last rows on.
    pub(super) fn place(&self, at: Option<&Position>) -> Option<(Position, Place)> {
        let (start, begun) = self.moves.begun()?;
        let oldest = self.last.iter().min().copied();
        let tag = oldest.filter(|_| at.is_none()).unwrap_or(self.last[0]);
        let resting = self
            .rests_for
            .and_then(|line| self.moves.resting(tag, line));
        let place = resting.or_else(|| self.moves.moving(tag, at));
        Some((start, place.or(self.behind).unwrap_or(begun)))
    }

    /// Follows the setpoint along the program; whether something else comes into effect there.
    pub(super) fn follow(&mut self, row: &Row<COORDINATES>) -> bool {
        self.moves.take_up();
        self.tag = None;
        if self.over && row.plan.speed == 0.0 {
            self.moves = Moves::new().1;
        }
        if let Some(line) = row.rests_for {
            (self.line, self.rested) = (line, true);
            self.rests_for = Some(line);
        }
        if let Some(line) = row.dwells_for {
            self.line = line;
        }
        self.last.rotate_right(1);
        let tag = self.moves.at(row.plan.tag, row.plan.distance);
        // What the path rests for may have the plan begin anew, where a homing has left the axes: none of its moves is at work then.
        let is_elsewhere = row.rests_for.is_some() && tag < self.last[1];
        if row.plan.off_path || is_elsewhere {
            self.last[0] = self.last[1];
            return false;
        }
        self.last[0] = tag;
        self.has_moved |= tag > 0 || row.plan.speed > 0.0;
        // Until it moves on, what it rested for was the last block.
        let rests = row.plan.speed == 0.0 && self.last[1] == tag;
        self.rested &= rests;
        self.dwelt = row.dwells_for.is_some() || self.dwelt && rests;
        self.rests_for = self.rests_for.filter(|_| rests);
        // Before it first moves, the first move is at work no more than any other.
        let modal = match self.has_moved || self.rests_for.is_some() {
            true => self.moves.next_modal(tag, self.rests_for),
            false => None,
        };
        let modal = modal.filter(|_| !self.over);
        let changes = modal.is_some();
        self.modal = modal.or(self.modal.take());
        self.moves.passed(tag.saturating_sub(KEPT));
        if let Some(motion) = self.moves.motion(tag) {
            if !self.rested && !self.dwelt {
                self.line = motion.line;
            }
            self.tag = Some(tag);
        }
        changes
    }
}
