//! Parameters that show or set the state of the machine: `#5161` … `#5428`, `#<_x>`, `#<_feed>` …
//!
//! Positions are in the program's units, stored points and offsets in mm, as RS-274/NGC keeps them.

use super::axes::{AxisLetter, Point};
use super::command::Turning;
use super::error::Fault;
use super::execute::State;
use super::modal::FeedMode;
use super::motion::in_range;

/// A point that parameters can set.
enum Stored {
    G28,
    G30,
    G92,
    Work(usize),
}

impl State {
    fn stored(index: usize) -> Option<(Stored, AxisLetter)> {
        let (which, axis) = match index {
            5161..=5169 => (Stored::G28, index - 5161),
            5181..=5189 => (Stored::G30, index - 5181),
            5211..=5219 => (Stored::G92, index - 5211),
            5221..=5389 if (index - 5221) % 20 < 9 => {
                (Stored::Work((index - 5221) / 20), (index - 5221) % 20)
            }
            _ => return None,
        };
        Some((which, AxisLetter::ALL[axis]))
    }

    fn stored_point(&mut self, which: &Stored) -> &mut Point {
        let tables = &mut self.setup.tables;
        match which {
            Stored::G28 => &mut tables.g28,
            Stored::G30 => &mut tables.g30,
            Stored::G92 => &mut tables.g92,
            Stored::Work(index) => &mut tables.work_offsets[*index],
        }
    }

    /// The work offset of which a parameter is the rotation.
    fn rotation_of(index: usize) -> Option<usize> {
        (0..9).find(|work_offset| index == 5230 + 20 * work_offset)
    }

    /// Whether a parameter is that of a stored point or rotation, which may have this value.
    pub(crate) fn may_set_place(&self, index: usize, value: f64) -> Result<bool, Fault> {
        if State::rotation_of(index).is_some() {
            return self.may_turn_work(value).map(|()| true);
        }
        let Some((_, axis)) = State::stored(index) else {
            return Ok(false);
        };
        in_range(axis, value).map(|()| true)
    }

    /// Sets the stored points and rotations of the block.
    pub(crate) fn set_places(&mut self) {
        for (index, value) in std::mem::take(&mut self.places) {
            if let Some(work_offset) = State::rotation_of(index) {
                self.setup.tables.rotations[work_offset] = value;
                self.set.rotation(work_offset);
            } else if let Some((which, axis)) = State::stored(index) {
                self.stored_point(&which)[axis] = value;
                match which {
                    Stored::G28 => self.set.reference("G28", axis),
                    Stored::G30 => self.set.reference("G30", axis),
                    Stored::G92 => self.set.reference("G92", axis),
                    Stored::Work(index) => self.set.work(index, axis),
                }
            }
        }
    }

    /// Whether a parameter moves the program's coordinates.
    pub(crate) fn shifts(&self, index: usize) -> bool {
        let origin = matches!(
            State::stored(index),
            Some((Stored::G92 | Stored::Work(_), _))
        );
        origin || State::rotation_of(index).is_some()
    }

    /// A parameter that shows the machine's state.
    pub(crate) fn system(&self, index: usize) -> Option<f64> {
        let tables = &self.setup.tables;
        if let Some((which, axis)) = State::stored(index) {
            return Some(match which {
                Stored::G28 => tables.g28[axis],
                Stored::G30 => tables.g30[axis],
                Stored::G92 => tables.g92[axis],
                Stored::Work(index) => tables.work_offsets[index][axis],
            });
        }
        if let Some(work_offset) = State::rotation_of(index) {
            return Some(tables.rotations[work_offset]);
        }
        let tool = tables.tools.get(&self.modes.tool);
        Some(match index {
            5021..=5029 => self.absolute(AxisLetter::ALL[index - 5021]),
            5081..=5089 => {
                let axis = AxisLetter::ALL[index - 5081];
                self.tool_offset[axis] / self.unit(axis)
            }
            5210 => flag(self.g92_applies),
            5220 => self.modes.work_offset as f64 + 1.0,
            5400 => f64::from(self.modes.tool),
            5401..=5409 => tool.map_or(0.0, |tool| tool.offset[AxisLetter::ALL[index - 5401]]),
            5410 => tool.map_or(0.0, |tool| tool.diameter + tool.diameter_wear),
            5420..=5428 => self.relative(AxisLetter::ALL[index - 5420]),
            _ => return None,
        })
    }

    /// A named parameter that shows the machine's state.
    pub(crate) fn system_named(&self, name: &str) -> Option<f64> {
        let axis = |letters: &str| {
            let mut letters = letters.chars();
            match (letters.next(), letters.next()) {
                (Some(letter), None) => AxisLetter::from_letter(letter),
                _ => None,
            }
        };
        let name = name.strip_prefix('_')?;
        if let Some(axis) = axis(name) {
            return Some(self.relative(axis));
        }
        if let Some(axis) = name.strip_prefix("abs_").and_then(axis) {
            return Some(self.absolute(axis));
        }
        let modes = &self.modes;
        Some(match name {
            "call_level" => self.call_level() as f64,
            "value" | "value_returned" => return self.parameters.named(&format!("_{name}")),
            "line" => f64::from(self.line),
            "motion_mode" => f64::from(modes.motion.code().number()),
            "plane" => f64::from(modes.plane.code().number()),
            "ccomp" => modes
                .compensation
                .map_or(400.0, |code| f64::from(code.number())),
            "metric" => flag(!modes.inches),
            "imperial" => flag(modes.inches),
            "absolute" => flag(!modes.incremental),
            "incremental" => flag(modes.incremental),
            "inverse_time" => flag(modes.feed_mode == FeedMode::InverseTime),
            "units_per_minute" => flag(modes.feed_mode == FeedMode::PerMinute),
            "units_per_rev" => flag(modes.feed_mode == FeedMode::PerTurn),
            "coord_system" => f64::from(modes.work_offset_code().number()),
            "tool_offset" => flag(modes.tool_length),
            "retract_r_plane" => flag(modes.retract_to_r),
            "retract_old_z" => flag(!modes.retract_to_r),
            "ijk_absolute_mode" => flag(modes.absolute_centers),
            "spindle_rpm_mode" => flag(modes.spindle.surface.is_none()),
            "spindle_css_mode" => flag(modes.spindle.surface.is_some()),
            "spindle_on" => flag(modes.spindle.turning != Turning::Off),
            "spindle_cw" => flag(modes.spindle.turning == Turning::Clockwise),
            "lathe_diameter_mode" | "adaptive_feed" | "remap_level" => 0.0,
            "task" | "lathe_radius_mode" | "speed_override" | "feed_override" | "feed_hold" => 1.0,
            "mist" => flag(modes.coolant.mist),
            "flood" => flag(modes.coolant.flood),
            "feed" => modes
                .feed
                .map_or(0.0, |feed| feed.number * feed.unit / modes.unit()),
            "rpm" => modes.spindle.at(self.at[AxisLetter::X]).speed,
            "current_tool" | "current_pocket" => f64::from(modes.tool),
            "selected_tool" | "selected_pocket" => f64::from(modes.selected_tool),
            _ => return None,
        })
    }

    fn absolute(&self, axis: AxisLetter) -> f64 {
        self.at[axis] / self.unit(axis)
    }

    fn relative(&self, axis: AxisLetter) -> f64 {
        self.coordinates().to_program(self.at)[axis] / self.unit(axis)
    }
}

fn flag(condition: bool) -> f64 {
    f64::from(u8::from(condition))
}
