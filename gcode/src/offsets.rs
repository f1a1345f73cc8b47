//! What moves the origin or goes to a stored point: G10, G28, G30, G43, G49, G52, G92.

use std::collections::VecDeque;

use super::arc::Plane;
use super::axes::{AxisLetter, AxisSet, Point};
use super::command::Action;
use super::coordinates::{ROTATION_LIMIT, WorkCoordinates, less};
use super::error::{Fault, Refusal};
use super::execute::{Compensated, State, missing};
use super::lexer::Columns;
use super::modal::{Code, Group};
use super::motion::RADIUS_LIMIT;
use super::tables::MOST_TOOLS;
use super::words::{Words, out_of_range};

/// What is measured is known to this part of a mm or degree.
const MEASURED: f64 = 1e3;
/// What is programmed is known to this part; below there is the rounding of sums and inches.
const PROGRAMMED: f64 = 1e9;
/// G59.3, the work offset from which G10 L11 measures tools.
const FIXTURE: usize = 8;

impl State {
    /// The coordinates in effect.
    pub(crate) fn coordinates(&self) -> WorkCoordinates {
        self.coordinates_of(self.modes.work_offset, self.tool_offset)
    }

    /// The coordinates that a work offset would make.
    fn coordinates_of(&self, work_offset: usize, tool: Point) -> WorkCoordinates {
        (self.setup.tables).coordinates(work_offset, self.g92_applies, tool)
    }

    /// G43, G43.1, G43.2, G49.
    pub(crate) fn tool_length(&mut self, words: &mut Words) -> Result<(), Refusal> {
        let Some(code) = words.code(Group::ToolLength) else {
            return Ok(());
        };
        match code {
            Code::G(430 | 432) => {
                let allowed = "the number of a tool";
                let number = match words.take_whole(b'H', code, 0..=MOST_TOOLS, allowed)? {
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
            Code::G(282) => self.home(words, code, commands),
            Code::G(281) => {
                self.setup.tables.g28 = self.noted();
                self.note_set("G28");
                Ok(())
            }
            Code::G(301) => {
                self.setup.tables.g30 = self.noted();
                self.note_set("G30");
                Ok(())
            }
            Code::G(520 | 920) => self.shift(words, code),
            Code::G(921) => {
                self.setup.tables.g92 = Point::ZERO;
                self.note_set("G92");
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
            self.note_set("G92");
            self.g92_applies = true;
        }
        let tables = &self.setup.tables;
        let unshifted = tables.coordinates(self.modes.work_offset, false, self.tool_offset);
        let here = unshifted.to_program(self.noted());
        for axis in self.setup.axes.iter() {
            if let Some(value) = self.coordinate(words, axis, code)? {
                self.set.reference("G92", axis);
                self.setup.tables.g92[axis] = match code {
                    Code::G(520) => value,
                    _ => here[axis] - value,
                };
            }
        }
        Ok(())
    }

    /// Notes that all axes of a reference point were set.
    fn note_set(&mut self, name: &'static str) {
        for axis in self.setup.axes.iter() {
            self.set.reference(name, axis);
        }
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
                self.set_work_offset(index, kind == 20, words, code)
            }
            1 | 10 | 11 => {
                let allowed = "the number of a tool from 1 to 99999";
                let Some(number) = words.take_whole(b'P', code, 1..=MOST_TOOLS, allowed)? else {
                    return Err(missing(words, Group::Offsets, code, allowed));
                };
                let mut tool = self
                    .setup
                    .tables
                    .tools
                    .get(&number)
                    .cloned()
                    .unwrap_or_default();
                let tables = &self.setup.tables;
                let without_tool = match kind {
                    11 => tables.coordinates(FIXTURE, false, Point::ZERO),
                    _ => self.coordinates_of(self.modes.work_offset, Point::ZERO),
                };
                let here = without_tool.to_program(self.noted());
                let (place, given) = self.placed(here, words, code)?;
                let measured = without_tool.turned(less(here, place));
                for axis in self.setup.axes.iter() {
                    if kind == 1 && given.contains(axis) {
                        tool.offset[axis] = place[axis];
                    } else if kind != 1 && without_tool.moved_by(given).contains(axis) {
                        tool.offset[axis] = measured[axis];
                    } else {
                        continue;
                    }
                    self.set.tool(number, axis);
                }
                if let Some(radius) = words.take(b'R', code)? {
                    tool.diameter = 2.0 * radius * self.modes.unit();
                    if tool.diameter.abs() > 2.0 * RADIUS_LIMIT {
                        let fault = out_of_range('R', radius, "within 10 km");
                        return Err(words.refuse(b'R', fault));
                    }
                    self.set.diameter(number);
                }
                self.setup.tables.tools.insert(number, tool);
                Ok(())
            }
            _ => Err(words.refuse(b'L', out_of_range('L', f64::from(kind), allowed))),
        }
    }

    /// G10 L2 sets a work offset and by how much it is turned; L20 sets it so that the position has the given
    /// coordinates in it.
    fn set_work_offset(
        &mut self,
        index: usize,
        by_position: bool,
        words: &mut Words,
        code: Code,
    ) -> Result<(), Refusal> {
        if let Some(degrees) = words.take(b'R', code)? {
            self.may_turn_work(degrees)
                .map_err(|fault| words.refuse(b'R', fault))?;
            self.setup.tables.rotations[index] = degrees;
            self.set.rotation(index);
        }
        if !by_position {
            let (place, given) = self.placed(Point::ZERO, words, code)?;
            for axis in given.iter() {
                self.setup.tables.work_offsets[index][axis] = place[axis];
                self.set.work(index, axis);
            }
            return Ok(());
        }
        let coordinates = self.coordinates_of(index, self.tool_offset);
        let here = coordinates.to_program(self.noted());
        let (place, given) = self.placed(here, words, code)?;
        let moved = coordinates.turned(less(here, place));
        for axis in coordinates.moved_by(given).iter() {
            self.setup.tables.work_offsets[index][axis] += moved[axis];
            self.set.work(index, axis);
        }
        Ok(())
    }

    /// Whether X and Y of a work offset can be turned so about its origin.
    pub(crate) fn may_turn_work(&self, degrees: f64) -> Result<(), Fault> {
        let axes = self.setup.axes;
        let missing = self.missing_of_turn();
        if let Some(axis) = missing.filter(|_| degrees != 0.0) {
            return Err(Fault::NoSuchAxis { axis, axes });
        }
        if degrees.abs() > ROTATION_LIMIT {
            return Err(out_of_range('R', degrees, "an angle within ±360°"));
        }
        Ok(())
    }

    /// The axis that the machine lacks to turn work in X and Y.
    fn missing_of_turn(&self) -> Option<AxisLetter> {
        let plane = [AxisLetter::X, AxisLetter::Y];
        plane
            .into_iter()
            .find(|axis| !self.setup.axes.contains(*axis))
    }

    /// Refuses words of axes where a table turns X and Y and the machine has only one of them, or none: it cannot go by such
    /// coordinates. G10 can put them right.
    pub(crate) fn turned_axes(&self, words: &Words) -> Result<(), Refusal> {
        let mut axes = self.setup.axes.iter();
        let missing = self.missing_of_turn();
        let rotation = self.coordinates().rotation;
        let sets = words.code(Group::Offsets) == Some(Code::G(100));
        match (missing, axes.find(|axis| words.has(axis.letter() as u8))) {
            (Some(axis), Some(word)) if rotation != 0.0 && !sets => {
                let fault = Fault::TurnedWithout { axis, rotation };
                Err(words.refuse(word.letter() as u8, fault))
            }
            _ => Ok(()),
        }
    }

    /// A point with the coordinates of the words in place of its own, and which these are. mm and degrees.
    pub(crate) fn placed(
        &self,
        mut point: Point,
        words: &mut Words,
        code: Code,
    ) -> Result<(Point, AxisSet), Refusal> {
        let mut given = AxisSet::default();
        for axis in self.setup.axes.iter() {
            if let Some(value) = self.coordinate(words, axis, code)? {
                point[axis] = value;
                given.insert(axis);
            }
        }
        Ok((point, given))
    }

    /// Refuses what is in the plane of G18 or G19 while the work is turned: no two axes of the machine are in it.
    pub(crate) fn plane_of_axes(&self, code: Code, columns: Columns) -> Result<(), Refusal> {
        if self.modes.plane != Plane::Xy && self.coordinates().rotation != 0.0 {
            return Err(Refusal::new(columns, Fault::TurnedPlane { code }));
        }
        Ok(())
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
        self.know_places(words, false);
        let mut to = over;
        let mut gone = AxisSet::NONE;
        for axis in self.setup.axes.iter() {
            let polar = matches!(axis, AxisLetter::X | AxisLetter::Y) && words.has_polar();
            if all || polar || words.has(axis.letter() as u8) {
                to[axis] = reference[axis];
                gone.insert(axis);
            }
        }
        for to in [over, to] {
            if to != self.at {
                self.go(Action::Rapid { to }, words, columns, commands)?;
            }
        }
        self.know_axes(gone);
        Ok(())
    }
}
