//! What lives from one program, or typed line, to the next: the modal state, the offset of the tool
//! and the parameters. Offsets and tools themselves are in the [`Tables`](super::Tables).

use super::axes::{AxisLetter, Point};
use super::command::{Coolant, PathMode, Spindle};
use super::coordinates::WorkCoordinates;
use super::modal::{Modes, Motion};
use super::parameters::{InputResult, Parameters};
use super::saved::SavedModes;
use super::tables::Tables;

/// What lives from one program to the next. `Default` is a machine that was just switched on: the
/// modal state of [`Modes`], no tool, no parameters set.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Memory {
    pub(crate) modes: Modes,
    pub(crate) tool_offset: Point,
    pub(crate) g92_applies: bool,
    pub(crate) parameters: Parameters,
    pub(crate) input_result: InputResult,
    /// What M70 has saved outside of subroutines.
    pub(crate) saved: Option<SavedModes>,
}

/// What is in effect otherwise than on a machine that was just switched on.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Unlike {
    /// What a program does not begin with.
    pub reset: Vec<String>,
    /// What it begins with.
    pub stays: Vec<String>,
}

impl Memory {
    /// A machine that was just switched on, whose programs begin in this path mode.
    pub fn in_path_mode(path_mode: PathMode) -> Memory {
        let mut memory = Memory::default();
        memory.modes.path_mode = path_mode;
        memory
    }

    /// The modal state.
    pub fn modes(&self) -> &Modes {
        &self.modes
    }

    /// The coordinates in effect: work offset, G92 or G52, and tool.
    pub fn coordinates(&self, tables: &Tables) -> WorkCoordinates {
        tables.coordinates(self.modes.work_offset, self.g92_applies, self.tool_offset)
    }

    /// What M2, M30 and the end of a program's file reset (RS-274/NGC): G54, no shift by G92 or G52,
    /// G17, G90, G94, G40, G1, spindle and coolant off. Units, tool, tool length, path mode, F and
    /// parameters stay.
    pub fn end_program(&mut self) {
        self.reset(Motion::Feed);
        self.stop();
    }

    /// What a program begins with, whatever typed lines have left: G54, no shift by G92 or G52, G17, G90, G94, G40, G80, nothing that M70
    /// has saved, and no F of another feed mode. All else stays.
    pub fn begin_program(&mut self) {
        self.reset(Modes::default().motion);
    }

    /// What is set otherwise than on a machine that was just switched on: what [`begin_program`](Self::begin_program) resets, but for
    /// motion, and what stays, but for F, path mode, spindle, coolant and tool.
    pub fn unlike_fresh(&self) -> Unlike {
        let mut begun = self.clone();
        begun.begin_program();
        Unlike {
            reset: self.codes_unlike(&begun),
            stays: begun.codes_unlike(&Memory::default()),
        }
    }

    /// Of what is in effect, the codes of that which is otherwise in `other`.
    fn codes_unlike(&self, other: &Memory) -> Vec<String> {
        let both = self.codes().into_iter().zip(other.codes());
        let unlike = both.filter(|(code, other)| code != other);
        unlike.map(|(code, _)| code).collect()
    }

    /// What is in effect, as an operator is told it.
    fn codes(&self) -> [String; 9] {
        let modes = &self.modes;
        let one_of = |is: bool, [one, other]: [&str; 2]| if is { one } else { other }.to_owned();
        [
            modes.plane.code().to_string(),
            modes.work_offset_code().to_string(),
            one_of(modes.incremental, ["G91", "G90"]),
            modes.feed_mode.code().to_string(),
            one_of(self.g92_applies, ["the shift by G92 or G52", "no shift"]),
            one_of(modes.inches, ["G20", "G21"]),
            one_of(modes.tool_length, ["G43", "G49"]),
            one_of(modes.absolute_centers, ["G90.1", "G91.1"]),
            one_of(modes.retract_to_r, ["G99", "G98"]),
        ]
    }

    fn reset(&mut self, motion: Motion) {
        self.g92_applies = false;
        self.saved = None;
        let fresh = Modes::default();
        let modes = &mut self.modes;
        // F is no feed of G94 if it was one of another mode.
        modes.feed = modes.feed.filter(|_| modes.feed_mode == fresh.feed_mode);
        *modes = Modes {
            motion,
            plane: fresh.plane,
            incremental: fresh.incremental,
            feed_mode: fresh.feed_mode,
            work_offset: fresh.work_offset,
            compensation: fresh.compensation,
            ..modes.clone()
        };
    }

    /// Spindle and coolant were switched off by a stop.
    pub fn stop(&mut self) {
        self.stop_spindle();
        self.stop_coolant();
    }

    /// The spindle was switched off otherwise than by M5.
    pub fn stop_spindle(&mut self) {
        let spindle = self.modes.spindle.as_programmed();
        self.modes.spindle = Spindle {
            surface: None,
            ..spindle.stopped()
        };
    }

    /// The coolant was switched off otherwise than by M9.
    pub fn stop_coolant(&mut self) {
        self.modes.coolant = Coolant::default();
    }

    /// Takes over which tool is in the spindle, where that was not left by the program's own end.
    /// The length of another one is not the one that was compensated: G49.
    pub fn tool_is(&mut self, tool: u32) {
        if tool != self.modes.tool {
            self.modes.tool = tool;
            self.modes.selected_tool = tool;
            self.modes.tool_length = false;
            self.tool_offset = Point::ZERO;
        }
    }

    /// Words for these positions in the units in effect, as G10 takes them: ` X0 Y1.5`.
    pub fn words(&self, positions: &[Option<f64>; 9]) -> String {
        let word = |(axis, position): (AxisLetter, &Option<f64>)| {
            let unit = if axis.is_linear() {
                self.modes.unit()
            } else {
                1.0
            };
            position.map(|position| format!(" {axis}{}", position / unit))
        };
        AxisLetter::ALL
            .into_iter()
            .zip(positions)
            .filter_map(word)
            .collect()
    }
}
