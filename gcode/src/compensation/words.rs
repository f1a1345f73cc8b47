//! G40, G41, G42, G41.1, G42.1: the tool's radius, and what is refused meanwhile.

use super::super::cycles::Cycle;
use super::super::error::{Fault, Refusal};
use super::super::execute::{Compensated, State, missing};
use super::super::modal::{Code, FeedMode, Group};
use super::super::motion::RADIUS_LIMIT;
use super::super::tables::MOST_TOOLS;
use super::super::words::{Words, out_of_range};
use super::Cutter;

/// What would change the contour in its midst, or leave it.
const NOT_MEANWHILE: [Group; 7] = [
    Group::CutterCompensation,
    Group::Plane,
    Group::ToolLength,
    Group::WorkOffset,
    Group::ToolChange,
    Group::Offsets,
    Group::MachineCoordinates,
];

impl State {
    /// The cutter that the contour is compensated for.
    pub(crate) fn cutter(&self) -> Option<Cutter> {
        match self.compensated {
            Compensated::On(cutter) => cutter,
            Compensated::Off | Compensated::Leaving => None,
        }
    }

    /// The end of a program ends compensation too.
    pub(crate) fn end_compensation(&mut self) {
        self.compensated = match self.cutter() {
            Some(_) => Compensated::Leaving,
            None => Compensated::Off,
        };
        self.modes.compensation = None;
    }

    /// G40, before anything else of its block; or what is refused while there is none.
    pub(crate) fn end_compensation_by(&mut self, words: &Words) -> Result<(), Refusal> {
        if !matches!(self.compensated, Compensated::On(_)) {
            return Ok(());
        }
        if words.code(Group::CutterCompensation) == Some(Code::G(400)) {
            self.end_compensation();
            return Ok(());
        }
        let refused = |group: &Group| {
            let code = words.code(*group)?;
            let same = *group == Group::Plane && code == self.modes.plane.code();
            (!same).then(|| (code, words.code_columns(*group).unwrap_or_default()))
        };
        let inverse_time = words.code(Group::FeedMode) == Some(Code::G(930));
        let inverse_time = inverse_time.then(|| refused(&Group::FeedMode)).flatten();
        let cycle = words
            .code(Group::Motion)
            .is_some_and(|code| Cycle::of(code.number()).is_some());
        let cycle = cycle.then(|| refused(&Group::Motion)).flatten();
        match NOT_MEANWHILE
            .iter()
            .find_map(refused)
            .or(inverse_time)
            .or(cycle)
        {
            Some((code, columns)) => Err(Refusal::new(columns, Fault::WhileCompensated { code })),
            None => Ok(()),
        }
    }

    /// G41, G42, G41.1, G42.1.
    pub(crate) fn compensate(&mut self, words: &mut Words) -> Result<(), Refusal> {
        let code = match words.code(Group::CutterCompensation) {
            Some(code) if code != Code::G(400) => code,
            _ => return Ok(()),
        };
        let columns = words.code_columns(Group::CutterCompensation);
        let columns = columns.unwrap_or_default();
        self.plane_of_axes(code, columns)?;
        let plane = self.modes.plane;
        let needed = plane.axes();
        let lacking = needed[..2]
            .iter()
            .find(|axis| !self.setup.axes.contains(**axis));
        if let Some(axis) = lacking {
            let (axis, axes) = (*axis, self.setup.axes);
            return Err(Refusal::new(columns, Fault::NoSuchAxis { axis, axes }));
        }
        if self.modes.feed_mode == FeedMode::InverseTime {
            let code = Code::G(930);
            return Err(Refusal::new(columns, Fault::WhileCompensated { code }));
        }
        let diameter = match code {
            Code::G(411 | 421) => match words.take(b'D', code)? {
                Some(diameter) => diameter * self.modes.unit(),
                None => {
                    let group = Group::CutterCompensation;
                    return Err(missing(words, group, code, "D, the diameter"));
                }
            },
            _ => self.diameter_by_number(words, code)?,
        };
        if diameter.abs() > 2.0 * RADIUS_LIMIT {
            let allowed = "a diameter within 20 km";
            return Err(words.refuse(b'D', out_of_range('D', diameter, allowed)));
        }
        let left = matches!(code, Code::G(410 | 411));
        self.modes.compensation = Some(code);
        self.compensated = Compensated::On((diameter != 0.0).then_some(Cutter {
            plane,
            radius: diameter.abs() / 2.0,
            left: left == (diameter > 0.0),
        }));
        Ok(())
    }

    /// The diameter of tool D, with its wear; D0 has none, and no D is the tool in the spindle.
    fn diameter_by_number(&self, words: &mut Words, code: Code) -> Result<f64, Refusal> {
        let allowed = "the number of a tool; its radius is in the tool table";
        let number = match words.take_whole(b'D', code, 0..=MOST_TOOLS, allowed)? {
            Some(0) => return Ok(0.0),
            Some(number) => number,
            None => self.modes.tool,
        };
        let columns = || {
            words
                .columns(b'D')
                .or(words.code_columns(Group::CutterCompensation))
        };
        match self.setup.tables.tools.get(&number) {
            Some(tool) => Ok(tool.diameter + tool.diameter_wear),
            None => Err(Refusal::new(
                columns().unwrap_or_default(),
                match number {
                    0 => Fault::CutterNoTool { code },
                    number => Fault::NoSuchTool { number },
                },
            )),
        }
    }
}
