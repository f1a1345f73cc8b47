//! The program that runs: where on its moves the setpoint is, and its M-codes, which are executed at
//! their place on the path.

use crate::control::Row;
use crate::machine::COORDINATES;
use crate::observe::MachineFunctions;
use crate::observe::deviation::AHEAD;
use crate::program::{Moves, Switch};
use std::ops::RangeInclusive;

/// Moves kept behind the setpoint's: the tool follows later than the setpoint.
const BEHIND: u32 = AHEAD;
/// Stretches of the plan kept behind the setpoint's, for the same reason. Many short moves may be
/// one stretch, under the tag of the last.
const STRETCHES: usize = 3;

/// A program that runs.
pub(super) struct Job {
    pub(super) moves: Moves,
    pub(super) functions: MachineFunctions,
    /// The program's line.
    pub(super) line: u32,
    /// Tags of the moves that setpoint and tool may be on; `None` off the path.
    pub(super) tags: Option<RangeInclusive<u32>>,
    /// The move of the last row, and the distance at its first.
    last: (u32, f64),
    /// Of the last stretches, the newest first.
    stretches: [u32; STRETCHES],
}

impl Job {
    /// The program whose moves come up there.
    pub(super) fn new(moves: Moves) -> Self {
        Self {
            moves,
            functions: MachineFunctions::default(),
            line: 0,
            tags: None,
            last: (0, 0.0),
            stretches: [0; STRETCHES],
        }
    }

    /// Follows the setpoint along the program: executes the M-codes whose place it has come to, and
    /// tells each.
    pub(super) fn follow(&mut self, row: &Row<COORDINATES>, mut tell: impl FnMut(Switch)) {
        self.moves.take_up();
        self.tags = None;
        if row.plan.off_path {
            return;
        }
        let tag = row.plan.tag;
        if self.last.0 != tag {
            self.last = (tag, row.plan.distance);
            self.stretches.rotate_right(1);
            self.stretches[0] = tag;
        }
        let along = row.plan.distance - self.last.1;
        while let Some(switch) = self.moves.switched(tag, &row.plan.position, along) {
            match switch {
                Switch::Spindle(spindle) => self.functions.spindle = spindle,
                Switch::Coolant(coolant) => self.functions.coolant = coolant,
                Switch::Tool(tool) => self.functions.tool = tool,
                Switch::Output(..) => {}
            }
            tell(switch);
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
