//! What the time of motion went into, by tool and by operation.
//!
//! An operation is what the program does with one tool at one speed and direction of the spindle: it begins where
//! either of them is changed. Every cycle of motion belongs to one, so that they add up to the time of motion.

use super::kept::Kept;
use crate::control::Row;
use crate::control::spindle::turning;
use crate::machine::COORDINATES;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;
use syncline_gcode::Spindle;

/// Motion with one tool at one speed of the spindle.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Operation {
    /// The tool in the spindle; 0 where none was loaded.
    pub tool: u32,
    /// 1/min, negative for M4.
    pub spindle: f64,
    /// The line at work when it first moved.
    pub line: u32,
    /// When that was, s.
    pub time_s: f64,
    /// Motion, s.
    pub motion_s: f64,
    /// What of that was at a programmed feed or in a thread, not in rapid, s.
    pub feed_s: f64,
}

/// Motion with one tool, all its operations together.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ToolTime {
    /// The tool in the spindle; 0 where none was loaded.
    pub tool: u32,
    /// Motion, s.
    pub motion_s: f64,
    /// What of that was at a programmed feed or in a thread, not in rapid, s.
    pub feed_s: f64,
}

/// The operations of a run so far, with their cycles of motion, and what of those was at a programmed feed or
/// in a thread.
#[derive(Debug, Default)]
pub(super) struct Operations {
    /// Tool and spindle at the last row.
    with: (u32, Spindle),
    /// The tool of the last operation, and its spindle as programmed.
    last: Option<(u32, Spindle)>,
    all: Kept<(Operation, [u64; 2])>,
    /// The cycles by tool, of all of them.
    tools: BTreeMap<u32, [u64; 2]>,
}

impl Operations {
    /// Takes a row, before which the path moved for so many cycles.
    pub(super) fn observe(&mut self, row: &Row<COORDINATES>, time: f64, line: u32, moved: u64) {
        let now = (row.functions.tool, row.functions.spindle);
        let before = std::mem::replace(&mut self.with, now);
        // What is switched where the path comes to rest is not what it came there with.
        let rests = row.plan.speed == 0.0;
        let (tool, spindle) = if rests { before } else { now };
        if moved == 0 {
            return;
        }
        let operation = Some((tool, spindle.as_programmed()));
        if std::mem::replace(&mut self.last, operation) != operation {
            let begun = Operation {
                tool,
                spindle: turning(spindle),
                line,
                time_s: time,
                motion_s: 0.0,
                feed_s: 0.0,
            };
            self.all.push((begun, [0; 2]));
        }
        let feed = row.plan.feed;
        let at_feed = row.threads || feed > 0.0 && feed.is_finite();
        let of_operation = self.all.last_mut().map(|(_, cycles)| cycles);
        let of_tool = self.tools.entry(tool).or_default();
        for cycles in of_operation.into_iter().chain([of_tool]) {
            cycles[0] += moved;
            cycles[1] += if at_feed { moved } else { 0 };
        }
    }

    /// By operation in their order, with how many of them are left off, and by tool; nothing of a program that has
    /// neither tool nor spindle.
    pub(super) fn times(
        self,
        seconds: impl Fn(u64) -> f64,
    ) -> (Vec<Operation>, u64, Vec<ToolTime>) {
        let (all, left_off) = self.all.end();
        let mut uses = all.iter();
        if !uses.any(|(it, _)| it.tool != 0 || it.spindle != 0.0) {
            return Default::default();
        }
        let tools = self.tools.into_iter().map(|(tool, cycles)| {
            let [motion_s, feed_s] = cycles.map(&seconds);
            ToolTime {
                tool,
                motion_s,
                feed_s,
            }
        });
        let operations = all.into_iter().map(|(it, cycles)| {
            let [motion_s, feed_s] = cycles.map(&seconds);
            Operation {
                motion_s,
                feed_s,
                ..it
            }
        });
        (operations.collect(), left_off, tools.collect())
    }
}

/// As a person reads it, but for the tool.
impl fmt::Display for ToolTime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            motion_s, feed_s, ..
        } = self;
        write!(
            f,
            "{motion_s:.3} s of motion, {feed_s:.3} s of it at a feed"
        )
    }
}

/// As a person reads it, but for the line.
impl fmt::Display for Operation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            tool,
            spindle,
            motion_s,
            feed_s,
            ..
        } = self;
        write!(
            f,
            "tool {tool}, spindle {spindle} 1/min: {motion_s:.3} s of motion, {feed_s:.3} s of it at a feed"
        )
    }
}
