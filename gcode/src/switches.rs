//! What a block switches, before it moves: tool, spindle, coolant, inputs and outputs.

use std::collections::VecDeque;
use std::time::Duration;

use super::axes::AxisLetter;
use super::block::Block;
use super::command::{
    ANALOG_INPUTS, ANALOG_OUTPUTS, Action, CoolantChange, DIGITAL_INPUTS, DIGITAL_OUTPUTS,
    InputWait, Orientation, Output, Spindle, Stop, Surface, TakenInput, Turning, Until, Way,
};
use super::error::{Fault, Refusal};
use super::execute::{DWELL_LIMIT, State, missing};
use super::lexer::Columns;
use super::modal::{Code, Group, surface_unit};
use super::parameters::InputResult;
use super::tables::MOST_TOOLS;
use super::words::{Words, out_of_range, whole};

/// The greatest S under G96.
const MOST_SURFACE: f64 = 1e5;

impl State {
    /// T, M6, M61.
    pub(crate) fn tools(
        &mut self,
        words: &mut Words,
        commands: &mut VecDeque<Action>,
    ) -> Result<(), Refusal> {
        if let Some(tool) = words.take_free(b'T') {
            let Some(tool) = whole(tool, 1e-4).filter(|tool| *tool <= MOST_TOOLS) else {
                let fault = out_of_range('T', tool, "a whole number from 0 to 99999");
                return Err(words.refuse(b'T', fault));
            };
            self.modes.selected_tool = tool;
            commands.push_back(Action::SelectTool(tool));
        }
        match words.code(Group::ToolChange) {
            Some(code @ Code::M(61)) => {
                let allowed = "the number of the tool that is in the spindle";
                let Some(tool) = words.take_whole(b'Q', code, 0..=MOST_TOOLS, allowed)? else {
                    let what = "Q, the tool in the spindle";
                    return Err(missing(words, Group::ToolChange, code, what));
                };
                self.modes.tool = tool;
                commands.push_back(Action::ToolLoaded(tool));
            }
            Some(_) => {
                let tool = self.modes.selected_tool;
                self.modes.tool = tool;
                commands.push_back(Action::Stop(Stop::ToolChange { tool }));
            }
            None => {}
        }
        Ok(())
    }

    /// S, M3, M4, M5, M19.
    pub(crate) fn spindle(
        &mut self,
        words: &mut Words,
        commands: &mut VecDeque<Action>,
    ) -> Result<(), Refusal> {
        let mut spindle = self.modes.spindle;
        self.speed_mode(&mut spindle, words)?;
        if let Some(surface) = &mut spindle.surface {
            if let Some(speed) = words.take_free(b'S') {
                if !(0.0..=MOST_SURFACE).contains(&speed) {
                    let allowed = "a surface speed from 0 to 100000 m (feet under G20) a minute";
                    return Err(words.refuse(b'S', out_of_range('S', speed, allowed)));
                }
                surface.speed = speed * surface_unit(self.modes.inches);
            }
            spindle = spindle.at(self.at[AxisLetter::X]);
        } else if let Some(speed) = words.take_free(b'S') {
            if speed < 0.0 {
                return Err(words.refuse(b'S', out_of_range('S', speed, "a speed from 0")));
            }
            if let Some((least, most)) = self.setup.spindle_speeds
                && speed != 0.0
                && !(least..=most).contains(&speed)
            {
                let fault = Fault::SpindleSpeed { speed, least, most };
                return Err(words.refuse(b'S', fault));
            }
            spindle.speed = speed;
        }
        match words.code(Group::Spindle) {
            Some(code @ Code::M(19)) => {
                let columns = words.code_columns(Group::Spindle).unwrap_or_default();
                let orientation = Some(self.orientation(words, code, columns)?);
                spindle = Spindle {
                    orientation,
                    ..spindle.stopped()
                };
            }
            Some(code) => {
                spindle = spindle.stopped();
                spindle.turning = match code {
                    Code::M(3) => Turning::Clockwise,
                    Code::M(4) => Turning::Counterclockwise,
                    _ => Turning::Off,
                };
            }
            None => {}
        }
        let changed = spindle.as_programmed() != self.modes.spindle.as_programmed();
        if changed {
            self.modes.spindle = spindle;
            commands.push_back(Action::Spindle(spindle));
        }
        Ok(())
    }

    /// M19: the angle R, which way round by P, within Q seconds.
    fn orientation(
        &self,
        words: &mut Words,
        code: Code,
        columns: Columns,
    ) -> Result<Orientation, Refusal> {
        if !self.setup.has_spindle_angle {
            return Err(Refusal::new(columns, Fault::NoOrientation));
        }
        let angle = words.take(b'R', code)?.unwrap_or(0.0);
        if !(0.0..=360.0).contains(&angle) {
            let fault = out_of_range('R', angle, "an angle from 0 to 360 degrees");
            return Err(words.refuse(b'R', fault));
        }
        let allowed = "0 for the shorter way round, 1 for clockwise, 2 for counterclockwise";
        let way = match words.take_whole(b'P', code, 0..=2, allowed)? {
            None | Some(0) => Way::Shorter,
            Some(1) => Way::Clockwise,
            Some(_) => Way::Counterclockwise,
        };
        let within = match words.take(b'Q', code)? {
            Some(seconds) if seconds > 0.0 && seconds <= DWELL_LIMIT => {
                Some(Duration::from_secs_f64(seconds))
            }
            Some(seconds) => {
                let allowed = "a time above 0, up to 1000000 s, within which it has to come there";
                return Err(words.refuse(b'Q', out_of_range('Q', seconds, allowed)));
            }
            None => None,
        };
        Ok(Orientation {
            angle: angle % 360.0,
            way,
            within,
        })
    }

    /// G96 and G97.
    fn speed_mode(&self, spindle: &mut Spindle, words: &mut Words) -> Result<(), Refusal> {
        let Some(code) = words.code(Group::SpindleMode) else {
            return Ok(());
        };
        let columns = words.code_columns(Group::SpindleMode).unwrap_or_default();
        let refuse = |fault| Err(Refusal::new(columns, fault));
        let has_speed = words.has(b'S');
        if code == Code::G(970) {
            if spindle.surface.take().is_some() && !has_speed {
                let what = "S, in 1/min: what G96 has come to is not known here";
                return Err(missing(words, Group::SpindleMode, code, what));
            }
            return Ok(());
        }
        if !self.setup.sets_spindle_speed {
            return refuse(Fault::NoSurfaceSpeed);
        }
        if !self.setup.axes.contains(AxisLetter::X) {
            let (axis, axes) = (AxisLetter::X, self.setup.axes);
            return refuse(Fault::NoSuchAxis { axis, axes });
        }
        if !has_speed {
            let what = "S, the surface speed in m a minute, under G20 in feet";
            return Err(missing(words, Group::SpindleMode, code, what));
        }
        let (least, most) = self.setup.spindle_speeds.unwrap_or((0.0, f64::MAX));
        let most = match words.take(b'D', code)? {
            Some(limit) if limit > 0.0 && limit >= least => limit.min(most),
            Some(limit) => {
                let allowed = "the greatest speed in 1/min, above 0 and no less than `min_speed`";
                return Err(words.refuse(b'D', out_of_range('D', limit, allowed)));
            }
            None if most == f64::MAX => {
                let what = "D, the greatest speed in 1/min";
                return Err(missing(words, Group::SpindleMode, code, what));
            }
            None => most,
        };
        spindle.surface = Some(Surface {
            speed: 0.0,
            centre: self.coordinates().origin[AxisLetter::X],
            within: (least, most),
        });
        Ok(())
    }

    /// The spindle's axis is at X0 of the program, wherever that is now.
    pub(crate) fn follow_centre(
        &mut self,
        block: &Block,
        commands: &mut VecDeque<Action>,
    ) -> Result<(), Refusal> {
        let coordinates = self.coordinates();
        let mut spindle = self.modes.spindle;
        let Some(surface) = &mut spindle.surface else {
            return Ok(());
        };
        if coordinates.rotation != 0.0 {
            return Err(Refusal::new(block.columns(), Fault::SurfaceTurned));
        }
        surface.centre = coordinates.origin[AxisLetter::X];
        if spindle.surface != self.modes.spindle.surface {
            self.modes.spindle = spindle.at(self.at[AxisLetter::X]);
            commands.push_back(Action::Spindle(self.modes.spindle));
        }
        Ok(())
    }

    /// M7, M8, M9.
    pub(crate) fn coolant(
        &mut self,
        words: &Words,
        commands: &mut VecDeque<Action>,
    ) -> Result<(), Refusal> {
        let (mist, flood) = (words.code(Group::Mist), words.code(Group::Coolant));
        if let (Some(first), Some(second @ Code::M(9))) = (mist, flood) {
            let columns = words.code_columns(Group::Coolant).unwrap_or_default();
            let group = Group::Coolant.name();
            return Err(Refusal::new(
                columns,
                Fault::Conflict {
                    first,
                    second,
                    group,
                },
            ));
        }
        let on = |code: Option<Code>| code.map(|_| true);
        let change = match flood {
            Some(Code::M(9)) => CoolantChange::OFF,
            _ => CoolantChange {
                mist: on(mist),
                flood: on(flood),
            },
        };
        // An operator may have switched it by hand: each code says once more what is to be.
        if mist.is_some() || flood.is_some() {
            self.modes.coolant = change.of(self.modes.coolant);
            commands.push_back(Action::Coolant(change));
        }
        Ok(())
    }

    /// The overrides, which stay with the operator; outputs, and inputs that are waited for.
    pub(crate) fn switches(
        &mut self,
        words: &mut Words,
        commands: &mut VecDeque<Action>,
    ) -> Result<(), Refusal> {
        if let Some(code @ Code::M(50..=53)) = words.code(Group::Overrides)
            && words.take(b'P', code)? == Some(0.0)
        {
            return Err(words.refuse(b'P', Fault::OperatorsOverride { code }));
        }
        if let Some(code) = words.code(Group::Output) {
            commands.push_back(match code {
                Code::M(66) => {
                    self.input_result = InputResult::Asked;
                    self.input(words, code)?
                }
                _ => Action::Output(output(words, code)?),
            });
        }
        Ok(())
    }

    /// What M66 waits for, or keeps.
    fn input(&self, words: &mut Words, code: Code) -> Result<Action, Refusal> {
        let missing = |words: &Words, what| Err(missing(words, Group::Output, code, what));
        let allowed = "an analog input from 0 to 7";
        if let Some(number) = words.take_whole(b'E', code, 0..=ANALOG_INPUTS as u32 - 1, allowed)? {
            if self.setup.analog_inputs >> number & 1 == 0 {
                return Err(words.refuse(b'E', Fault::NoSuchAnalogInput { number }));
            }
            words.take_whole(b'L', code, 0..=0, "0, for what an analog input is there")?;
            return Ok(Action::TakeInput(TakenInput::Analog(number as u8)));
        }
        let allowed = "a digital input from 0 to 63";
        let Some(number) = words.take_whole(b'P', code, 0..=DIGITAL_INPUTS as u32 - 1, allowed)?
        else {
            return missing(
                words,
                "P, the number of a digital input, or E, of an analog one",
            );
        };
        if self.setup.inputs >> number & 1 == 0 {
            return Err(words.refuse(b'P', Fault::NoSuchInput { number }));
        }
        let number = number as u8;
        let allowed = "0 for what it is, 1 comes on, 2 goes off, 3 is on, 4 is off";
        let until = match words.take_whole(b'L', code, 0..=4, allowed)? {
            Some(0) => return Ok(Action::TakeInput(TakenInput::Digital(number))),
            Some(1) => Until::Rise,
            Some(2) => Until::Fall,
            Some(3) => Until::High,
            Some(_) => Until::Low,
            None => {
                let what = "L: 0 for what it is, 1 comes on, 2 goes off, 3 is on, 4 is off";
                return missing(words, what);
            }
        };
        match words.take(b'Q', code)? {
            Some(seconds) if (0.0..=DWELL_LIMIT).contains(&seconds) => {
                Ok(Action::AwaitInput(InputWait {
                    number,
                    until,
                    within: Duration::from_secs_f64(seconds),
                }))
            }
            Some(seconds) => {
                let allowed = "a time from 0 to 1000000 s";
                Err(words.refuse(b'Q', out_of_range('Q', seconds, allowed)))
            }
            None => missing(words, "Q, the time in seconds within which it has to come"),
        }
    }
}

/// What a code of the machine's outputs does.
fn output(words: &mut Words, code: Code) -> Result<Output, Refusal> {
    let missing = |words: &Words, what| Err(missing(words, Group::Output, code, what));
    match code {
        Code::M(number @ 62..=65) => {
            let allowed = "a digital output from 0 to 63";
            match words.take_whole(b'P', code, 0..=DIGITAL_OUTPUTS as u32 - 1, allowed)? {
                Some(output) => Ok(Output::Digital {
                    number: output as u8,
                    on: matches!(number, 62 | 64),
                    with_motion: number < 64,
                }),
                None => missing(words, "P, the number of the output"),
            }
        }
        Code::M(number @ (67 | 68)) => {
            let allowed = "an analog output from 0 to 3";
            let output = words.take_whole(b'E', code, 0..=ANALOG_OUTPUTS as u32 - 1, allowed)?;
            match (output, words.take(b'Q', code)?) {
                (Some(output), Some(value)) => Ok(Output::Analog {
                    number: output as u8,
                    value,
                    with_motion: number == 67,
                }),
                (None, _) => missing(words, "E, the number of the output"),
                (_, None) => missing(words, "Q, the value"),
            }
        }
        _ => Ok(Output::User {
            code: code.number(),
            p: words.take(b'P', code)?,
            q: words.take(b'Q', code)?,
        }),
    }
}
