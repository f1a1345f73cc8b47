//! The program that runs: where on its moves the setpoint is.

use crate::control::Row;
use crate::machine::COORDINATES;
use crate::observe::deviation::AHEAD;
use crate::program::Moves;
use std::ops::RangeInclusive;

/// The tool follows later than the setpoint: it may be on what that was on so many rows before …
const ROWS_BEHIND: usize = 8;
/// … and on so many moves before that.
const MOVES_BEHIND: u32 = AHEAD;
/// Moves that are kept behind the setpoint's: the path may go back along them.
const KEPT: u32 = 4096;

/// A program that runs.
pub(super) struct Job {
    pub(super) moves: Moves,
    /// The line of the block at work.
    pub(super) line: u32,
    /// Tags of the moves that setpoint and tool may be on; `None` off the path.
    pub(super) tags: Option<RangeInclusive<u32>>,
    /// Of the moves at the last rows, the newest first.
    last: [u32; ROWS_BEHIND],
    /// The path has rested for a block since it moved.
    rested: bool,
    /// It is over, and may still come to rest.
    over: bool,
}

impl Job {
    /// The program whose moves come up there.
    pub(super) fn new(moves: Moves) -> Self {
        Self {
            moves,
            line: 0,
            tags: None,
            last: [0; ROWS_BEHIND],
            rested: false,
            over: false,
        }
    }

    /// The job is over. From where the axes rest then, they may go anywhere, and stop there: none of its
    /// moves says where they are to be.
    pub(super) fn end(&mut self) {
        self.over = true;
    }

    /// The program goes on behind a probing or a homing, from where that ended: on none of its moves so far.
    pub(super) fn probed(&mut self) {
        self.moves.passed(self.last[0] + 1);
    }

    /// Follows the setpoint along the program.
    pub(super) fn follow(&mut self, row: &Row<COORDINATES>) {
        self.moves.take_up();
        self.tags = None;
        if self.over && row.plan.speed == 0.0 {
            self.moves = Moves::new().1;
        }
        if let Some(line) = row.rests_for {
            (self.line, self.rested) = (line, true);
        }
        if row.plan.off_path {
            return;
        }
        let tag = self.moves.at(row.plan.tag, row.plan.distance);
        self.last.rotate_right(1);
        self.last[0] = tag;
        self.moves.passed(tag.saturating_sub(KEPT));
        // Until it moves on, what it rested for was the last block.
        self.rested &= row.plan.speed == 0.0 && self.last[1] == tag;
        if let Some(motion) = self.moves.motion(tag) {
            if !self.rested {
                self.line = motion.line;
            }
            let (first, last) = self.last.iter().fold((tag, tag), |(first, last), &of| {
                (first.min(of), last.max(of))
            });
            self.tags = Some(first.saturating_sub(MOVES_BEHIND)..=last);
        }
    }
}
