//! What moves the origin or goes to a stored point: G10, G28, G30, G43, G49, G52, G92.

use std::collections::VecDeque;

use super::axes::{Axis, Point};
use super::command::Action;
use super::error::{Fault, Refusal};
use super::execute::{Compensated, State, missing};
use super::modal::{Code, Group};
use super::motion::RADIUS_LIMIT;
use super::words::{Words, out_of_range};

/// What is measured is known to this part of a mm or degree.
const MEASURED: f64 = 1e3;
/// What is programmed is known to this part; below there is the rounding of sums and inches.
const PROGRAMMED: f64 = 1e9;

impl State {
    /// What lies between program and machine coordinates.
    pub(crate) fn offset(&self, axis: Axis) -> f64 {
        self.origin(axis) + self.tool_offset[axis]
    }

    /// The origin of the program's coordinates without the tool.
    fn origin(&self, axis: Axis) -> f64 {
        let work = self.setup.tables.work_offsets[self.modes.work_offset][axis];
        if self.g92_applies {
            work + self.setup.tables.g92[axis]
        } else {
            work
        }
    }

    /// G43, G43.1, G43.2, G49.
    pub(crate) fn tool_length(&mut self, words: &mut Words) -> Result<(), Refusal> {
        let Some(code) = words.code(Group::ToolLength) else {
            return Ok(());
        };
        match code {
            Code::G(430 | 432) => {
                let allowed = "the number of a tool";
                let number = match words.take_whole(b'H', code, 0..=99_999, allowed)? {
                    None | Some(0) => self.modes.tool,
                    Some(number) => number,
                };
                let offset = match self.setup.tables.tools.get(&number) {
                    Some(tool) => tool.offset,
                    None if number == 0 => Point::ZERO,
                    None => {
                        let columns = words
                            .columns(b'H')
                            .or(words.code_columns(Group::ToolLength));
                        return Err(Refusal::new(
                            columns.unwrap_or_default(),
                            Fault::NoSuchTool { number },
                        ));
                    }
                };
                if code == Code::G(430) {
                    self.tool_offset = offset;
                } else {
                    let sum = self.tool_offset.0.iter_mut().zip(offset.0);
                    sum.for_each(|(value, more)| *value += more);
                }
            }
            Code::G(431) => {
                if !words.has_axes() {
                    return Err(missing(words, Group::ToolLength, code, "axis words"));
                }
                for axis in self.setup.axes.iter() {
                    if let Some(value) = self.coordinate(words, axis, code)? {
                        self.tool_offset[axis] = value;
                    }
                }
            }
            _ => self.tool_offset = Point::ZERO,
        }
        self.modes.tool_length = code != Code::G(490);
        Ok(())
    }

    /// The codes of the offsets' group.
    pub(crate) fn offsets(
        &mut self,
        words: &mut Words,
        commands: &mut VecDeque<Action>,
    ) -> Result<(), Refusal> {
        let Some(code) = words.code(Group::Offsets) else {
            return Ok(());
        };
        match code {
            Code::G(100) => self.set_table(words, code),
            Code::G(280 | 300) => self.go_to_reference(words, code, commands),
            Code::G(281) => {
                self.setup.tables.g28 = self.noted();
                Ok(())
            }
            Code::G(301) => {
                self.setup.tables.g30 = self.noted();
                Ok(())
            }
            Code::G(520 | 920) => self.shift(words, code),
            Code::G(921) => {
                self.setup.tables.g92 = Point::ZERO;
                self.g92_applies = false;
                Ok(())
            }
            _ => {
                self.g92_applies = code == Code::G(923);
                Ok(())
            }
        }
    }

    /// G52 sets the shift, G92 sets it so that the position becomes the given one.
    fn shift(&mut self, words: &mut Words, code: Code) -> Result<(), Refusal> {
        if !words.has_axes() {
            return Err(missing(words, Group::Offsets, code, "axis words"));
        }
        if !self.g92_applies {
            self.setup.tables.g92 = Point::ZERO;
            self.g92_applies = true;
        }
        for axis in self.setup.axes.iter() {
            if let Some(value) = self.coordinate(words, axis, code)? {
                let shift = if code == Code::G(520) {
                    value
                } else {
                    let work = self.setup.tables.work_offsets[self.modes.work_offset][axis];
                    self.noted()[axis] - work - self.tool_offset[axis] - value
                };
                self.setup.tables.g92[axis] = shift;
            }
        }
        Ok(())
    }

    /// The position as tables note it. An axis that no move has led away from where it stood at the start was
    /// measured there: what is below a micrometre is its encoder's noise.
    fn noted(&self) -> Point {
        let mut noted = self.at;
        for axis in self.setup.axes.iter() {
            let known = if noted[axis] == self.setup.start[axis] {
                MEASURED
            } else {
                PROGRAMMED
            };
            noted[axis] = (noted[axis] * known).round() / known;
        }
        noted
    }

    /// G10
    fn set_table(&mut self, words: &mut Words, code: Code) -> Result<(), Refusal> {
        let allowed = "L1, L10 or L11 for tools, L2 or L20 for work offsets";
        let Some(kind) = words.take_whole(b'L', code, 1..=20, allowed)? else {
            return Err(missing(words, Group::Offsets, code, allowed));
        };
        match kind {
            2 | 20 => {
                let allowed = "a work offset from P1 (G54) to P9 (G59.3), P0 the active one";
                let index = match words.take_whole(b'P', code, 0..=9, allowed)? {
                    Some(0) => self.modes.work_offset,
                    Some(number) => number as usize - 1,
                    None => return Err(missing(words, Group::Offsets, code, allowed)),
                };
                if let Some(turned) = words.take(b'R', code)?
                    && turned != 0.0
                {
                    return Err(words.refuse(b'R', Fault::TurnedWork));
                }
                for axis in self.setup.axes.iter() {
                    if let Some(value) = self.coordinate(words, axis, code)? {
                        let work = self.setup.tables.work_offsets[self.modes.work_offset][axis];
                        let others = self.offset(axis) - work;
                        self.setup.tables.work_offsets[index][axis] = match kind {
                            2 => value,
                            _ => self.noted()[axis] - others - value,
                        };
                    }
                }
                Ok(())
            }
            1 | 10 | 11 => {
                let allowed = "the number of a tool from 1 to 99999";
                let Some(number) = words.take_whole(b'P', code, 1..=99_999, allowed)? else {
                    return Err(missing(words, Group::Offsets, code, allowed));
                };
                let mut tool = self
                    .setup
                    .tables
                    .tools
                    .get(&number)
                    .cloned()
                    .unwrap_or_default();
                for axis in self.setup.axes.iter() {
                    if let Some(value) = self.coordinate(words, axis, code)? {
                        tool.offset[axis] = match kind {
                            1 => value,
                            10 => self.noted()[axis] - self.origin(axis) - value,
                            _ => {
                                let work = self.setup.tables.work_offsets[8][axis];
                                self.noted()[axis] - work - value
                            }
                        };
                    }
                }
                if let Some(radius) = words.take(b'R', code)? {
                    tool.diameter = 2.0 * radius * self.modes.unit();
                    if tool.diameter.abs() > 2.0 * RADIUS_LIMIT {
                        let fault = out_of_range('R', radius, "within 10 km");
                        return Err(words.refuse(b'R', fault));
                    }
                }
                self.setup.tables.tools.insert(number, tool);
                Ok(())
            }
            _ => Err(words.refuse(b'L', out_of_range('L', f64::from(kind), allowed))),
        }
    }

    /// G28, G30: over the point that the axis words give, if any, to the stored one.
    fn go_to_reference(
        &mut self,
        words: &mut Words,
        code: Code,
        commands: &mut VecDeque<Action>,
    ) -> Result<(), Refusal> {
        let reference = match code {
            Code::G(280) => self.setup.tables.g28,
            _ => self.setup.tables.g30,
        };
        let columns = words.code_columns(Group::Offsets).unwrap_or_default();
        if self.compensated == Compensated::Leaving {
            return Err(Refusal::new(columns, Fault::CutterLeaving { code }));
        }
        let all = !words.has_axes() && !words.has_polar();
        let over = self.target(words, code, false)?;
        let mut to = over;
        for axis in self.setup.axes.iter() {
            let polar = matches!(axis, Axis::X | Axis::Y) && words.has_polar();
            if all || polar || words.has(axis.letter() as u8) {
                to[axis] = reference[axis];
            }
        }
        for to in [over, to] {
            if to != self.at {
                self.go(Action::Rapid { to }, words, columns, commands)?;
            }
        }
        Ok(())
    }
}
