//! The program that runs: where on its moves the setpoint is.

use crate::control::Row;
use crate::machine::COORDINATES;
use crate::observe::deviation::AHEAD;
use crate::program::Moves;
use std::ops::RangeInclusive;

/// Moves kept behind the setpoint's: the tool follows later than the setpoint.
const BEHIND: u32 = AHEAD;
/// Stretches of the plan kept behind the setpoint's, for the same reason. Many short moves may be
/// one stretch, under the tag of the last.
const STRETCHES: usize = 3;

/// A program that runs.
pub(super) struct Job {
    pub(super) moves: Moves,
    /// The program's line.
    pub(super) line: u32,
    /// Tags of the moves that setpoint and tool may be on; `None` off the path.
    pub(super) tags: Option<RangeInclusive<u32>>,
    /// The move of the last row.
    last: u32,
    /// Of the last stretches, the newest first.
    stretches: [u32; STRETCHES],
}

impl Job {
    /// The program whose moves come up there.
    pub(super) fn new(moves: Moves) -> Self {
        Self {
            moves,
            line: 0,
            tags: None,
            last: 0,
            stretches: [0; STRETCHES],
        }
    }

    /// Follows the setpoint along the program.
    pub(super) fn follow(&mut self, row: &Row<COORDINATES>) {
        self.moves.take_up();
        self.tags = None;
        if row.plan.off_path {
            return;
        }
        let tag = row.plan.tag;
        if self.last != tag {
            self.last = tag;
            self.stretches.rotate_right(1);
            self.stretches[0] = tag;
        }
        let last = self.stretches.iter().fold(tag, |last, &of| last.max(of));
        let first = self.stretches.iter().fold(tag, |first, &of| first.min(of));
        let first = first.min(tag.saturating_sub(BEHIND));
        self.moves.passed(first);
        if let Some(motion) = self.moves.motion(tag) {
            self.line = motion.line;
            self.tags = Some(first..=last);
        }
    }
}
