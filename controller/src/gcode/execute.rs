//! What a block does: the modal state, the position, and the commands that come of it.
//!
//! The items of a block take effect in the order of RS-274/NGC (feed, speed, tool, spindle,
//! coolant, dwell, modes, offsets, motion, stop), with one exception: units count for the whole
//! block, so that `G20 F10` is ten inches a minute.

use std::collections::VecDeque;

use super::Setup;
use super::arc::{Arc, Direction, Plane};
use super::axes::{Axis, COORDINATE_LIMIT, Point};
use super::block::{Block, Target};
use super::command::{Action, Feed, Output, PathMode, Stop, Turning};
use super::cycles::{Cycle, Series};
use super::error::{Fault, Refusal};
use super::expression::{Scope, Value};
use super::lexer::Columns;
use super::modal::{Code, Group, Modes, Motion, ProgrammedFeed};
use super::parameters::{self, Parameters};
use super::words::{Words, out_of_range, whole};

/// Arcs beyond this radius are a mistake, or lines. mm.
const RADIUS_LIMIT: f64 = 1e7;
/// The longest dwell, s.
pub(crate) const DWELL_LIMIT: f64 = 1e6;
/// A position may be outside of the soft limits by this much: what conversions round. mm.
const LIMIT_ROUNDING: f64 = 1e-9;

/// Where the program goes on after a block.
pub(crate) enum Continuation {
    /// In the next line.
    Next,
    /// M2, M30
    End,
    /// M98
    CallSubprogram {
        number: u32,
        repeats: u32,
        columns: Columns,
    },
    /// M99
    EndSubprogram { columns: Columns },
}

/// What executing a program knows between two blocks.
pub(crate) struct State {
    pub(crate) setup: Setup,
    pub(crate) modes: Modes,
    /// The programmed position in machine coordinates.
    pub(crate) at: Point,
    /// What G43 and G43.1 added.
    pub(crate) tool_offset: Point,
    /// Whether the shift of G92 and G52 is in effect.
    pub(crate) g92_applies: bool,
    pub(crate) parameters: Parameters,
    /// What canned cycles keep from block to block.
    pub(crate) series: Series,
    /// The line of the block that is being executed.
    pub(crate) line: u32,
    /// How many subroutines deep that is.
    pub(crate) call_level: usize,
    /// Working memory: the values of an expression, and each setting's index and value.
    stack: Vec<f64>,
    settings: Vec<(f64, f64)>,
}

impl State {
    pub(crate) fn new(setup: Setup) -> State {
        State {
            at: setup.start,
            modes: Modes {
                path_mode: setup.path_mode,
                ..Modes::default()
            },
            setup,
            tool_offset: Point::ZERO,
            g92_applies: false,
            parameters: Parameters::default(),
            series: Series::default(),
            line: 0,
            call_level: 0,
            stack: Vec::new(),
            settings: Vec::new(),
        }
    }

    /// Executes the words and parameter settings of a block.
    pub(crate) fn execute(
        &mut self,
        block: &Block,
        commands: &mut VecDeque<Action>,
    ) -> Result<Continuation, Refusal> {
        let mut words = self.evaluate(block)?;
        self.speeds(&mut words, commands)?;
        self.dwell(&mut words, commands)?;
        self.set_modes(&mut words, commands)?;
        self.offsets(&mut words, commands)?;
        self.motion(block, &mut words, commands)?;
        let continuation = self.stop(&mut words, commands)?;
        words.all_used()?;
        Ok(continuation)
    }

    /// Evaluates every word and setting with the parameters as they were before the block.
    fn evaluate(&mut self, block: &Block) -> Result<Words, Refusal> {
        let mut stack = std::mem::take(&mut self.stack);
        let mut words = Words::default();
        for word in &block.words {
            if let Some(axis) = Axis::from_letter(char::from(word.letter))
                && !self.setup.axes.contains(axis)
            {
                let axes = self.setup.axes;
                return Err(Refusal::new(word.columns, Fault::NoSuchAxis { axis, axes }));
            }
            let value = block.evaluate(&word.value, self, &mut stack)?;
            words.add(word.letter, value, word.columns)?;
        }
        let mut settings = std::mem::take(&mut self.settings);
        settings.clear();
        for setting in &block.settings {
            let value = block.evaluate(&setting.value, self, &mut stack)?;
            let index = match &setting.target {
                Target::Numbered(index) => block.evaluate(index, self, &mut stack)?,
                Target::Named(_) => 0.0,
            };
            settings.push((index, value));
        }
        for (setting, (index, value)) in block.settings.iter().zip(&settings) {
            match &setting.target {
                Target::Named(name) => self.set_named(block.name(name), *value),
                Target::Numbered(_) => self.set_numbered(*index, *value),
            }
            .map_err(|fault| Refusal::new(setting.columns, fault))?;
        }
        self.settings = settings;
        self.stack = stack;
        Ok(words)
    }

    /// Evaluates one value of a block.
    pub(crate) fn value(&mut self, block: &Block, value: &Value) -> Result<f64, Refusal> {
        let mut stack = std::mem::take(&mut self.stack);
        let result = block.evaluate(value, self, &mut stack);
        self.stack = stack;
        result
    }

    fn speeds(
        &mut self,
        words: &mut Words,
        commands: &mut VecDeque<Action>,
    ) -> Result<(), Refusal> {
        if let Some(units) = words.code(Group::Units) {
            self.modes.inches = units == Code::G(200);
        }
        if let Some(mode) = words.code(Group::FeedMode) {
            let inverse_time = mode == Code::G(930);
            if inverse_time != self.modes.inverse_time {
                self.modes.feed = None;
            }
            self.modes.inverse_time = inverse_time;
        }
        if let Some(number) = words.take_free(b'F') {
            if !(0.001..=1e7).contains(&number) {
                let allowed = "a feed from 0.001 to 10000000";
                return Err(words.refuse(b'F', out_of_range('F', number, allowed)));
            }
            if !self.modes.inverse_time {
                self.modes.feed = Some(ProgrammedFeed {
                    number,
                    unit: self.modes.unit(),
                });
            }
        }
        let mut spindle = self.modes.spindle;
        if let Some(speed) = words.take_free(b'S') {
            if speed < 0.0 {
                return Err(words.refuse(b'S', out_of_range('S', speed, "a speed from 0")));
            }
            spindle.speed = speed;
        }
        if let Some(tool) = words.take_free(b'T') {
            let tool = whole(tool, 1e-4)
                .filter(|tool| *tool <= 99_999)
                .ok_or_else(|| {
                    words.refuse(
                        b'T',
                        out_of_range('T', tool, "a whole number from 0 to 99999"),
                    )
                })?;
            self.modes.selected_tool = tool;
            commands.push_back(Action::SelectTool(tool));
        }
        if words.code(Group::ToolChange).is_some() {
            self.modes.tool = self.modes.selected_tool;
            commands.push_back(Action::Stop(Stop::ToolChange {
                tool: self.modes.tool,
            }));
        }
        match words.code(Group::Spindle) {
            Some(Code::M(3)) => spindle.turning = Turning::Clockwise,
            Some(Code::M(4)) => spindle.turning = Turning::Counterclockwise,
            Some(_) => spindle.turning = Turning::Off,
            None => {}
        }
        if spindle != self.modes.spindle {
            self.modes.spindle = spindle;
            commands.push_back(Action::Spindle(spindle));
        }
        let mut coolant = self.modes.coolant;
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
        coolant.mist |= mist.is_some();
        match flood {
            Some(Code::M(8)) => coolant.flood = true,
            Some(_) => coolant = Default::default(),
            None => {}
        }
        if coolant != self.modes.coolant {
            self.modes.coolant = coolant;
            commands.push_back(Action::Coolant(coolant));
        }
        if let Some(code @ Code::M(number)) = words.code(Group::Output) {
            commands.push_back(Action::Output(Output {
                code: number,
                p: words.take(b'P', code)?,
                q: words.take(b'Q', code)?,
            }));
        }
        Ok(())
    }

    fn dwell(&mut self, words: &mut Words, commands: &mut VecDeque<Action>) -> Result<(), Refusal> {
        let Some(code) = words.code(Group::Dwell) else {
            return Ok(());
        };
        match words.take(b'P', code)? {
            Some(seconds) if (0.0..=DWELL_LIMIT).contains(&seconds) => {
                commands.push_back(Action::Dwell { seconds });
                Ok(())
            }
            Some(seconds) => Err(words.refuse(
                b'P',
                out_of_range('P', seconds, "a time from 0 to 1000000 s"),
            )),
            None => Err(missing(words, Group::Dwell, code, "P, the time in seconds")),
        }
    }

    fn set_modes(
        &mut self,
        words: &mut Words,
        commands: &mut VecDeque<Action>,
    ) -> Result<(), Refusal> {
        if let Some(plane) = words.code(Group::Plane) {
            self.modes.plane = match plane {
                Code::G(180) => Plane::Zx,
                Code::G(190) => Plane::Yz,
                _ => Plane::Xy,
            };
        }
        self.tool_length(words)?;
        if let Some(Code::G(tenths)) = words.code(Group::WorkOffset) {
            self.modes.work_offset = match tenths {
                591..=593 => usize::from(tenths) - 585,
                _ => usize::from(tenths / 10) - 54,
            };
        }
        if let Some(code) = words.code(Group::PathMode) {
            let mode = match code {
                Code::G(610) => PathMode::ExactPath,
                Code::G(611) => PathMode::ExactStop,
                _ => {
                    let unit = self.modes.unit();
                    let mut length = |letter| match words.take(letter, code)? {
                        Some(value) if value <= 0.0 => Err(words.refuse(
                            letter,
                            out_of_range(
                                char::from(letter),
                                value,
                                "a distance above 0; G61 keeps the path exactly",
                            ),
                        )),
                        value => Ok(value.map(|value| value * unit)),
                    };
                    PathMode::Blend {
                        tolerance: length(b'P')?,
                        merge: length(b'Q')?,
                    }
                }
            };
            self.modes.path_mode = mode;
            commands.push_back(Action::PathMode(mode));
        }
        if let Some(code) = words.code(Group::Distance) {
            self.modes.incremental = code == Code::G(910);
        }
        if let Some(code) = words.code(Group::ArcDistance) {
            self.modes.absolute_centers = code == Code::G(901);
        }
        if let Some(code) = words.code(Group::CycleReturn) {
            self.modes.retract_to_r = code == Code::G(990);
        }
        Ok(())
    }

    fn motion(
        &mut self,
        block: &Block,
        words: &mut Words,
        commands: &mut VecDeque<Action>,
    ) -> Result<(), Refusal> {
        let explicit = words.code(Group::Motion);
        if let Some(code) = explicit {
            self.modes.motion = match code {
                Code::G(0) => Motion::Rapid,
                Code::G(10) => Motion::Feed,
                Code::G(20) => Motion::Arc(Direction::Clockwise),
                Code::G(30) => Motion::Arc(Direction::Counterclockwise),
                code => Cycle::of(code.number()).map_or(Motion::None, Motion::Cycle),
            };
        }
        let motion = self.modes.motion;
        let code = motion.code();
        if !matches!(motion, Motion::Cycle(_)) {
            self.end_series();
        }
        let machine = words.code(Group::MachineCoordinates).is_some();
        if machine && !matches!(motion, Motion::Rapid | Motion::Feed) {
            let columns = words.code_columns(Group::MachineCoordinates);
            return Err(Refusal::new(
                columns.unwrap_or_default(),
                Fault::MachineCoordinatesWithout,
            ));
        }
        let arc = matches!(motion, Motion::Arc(_)) && (explicit.is_some() || words.has_arc());
        // Another code that uses the axis words suspends the motion mode for its block.
        let suspended = explicit.is_none()
            && (words.code(Group::ToolLength) == Some(Code::G(431))
                || matches!(
                    words.code(Group::Offsets),
                    Some(Code::G(100 | 280 | 300 | 520 | 920))
                ));
        let motion_columns = words
            .code_columns(Group::Motion)
            .unwrap_or_else(|| block.columns());
        if suspended || !(words.has_axes() || arc) {
            return match motion {
                Motion::Cycle(_) if explicit.is_some() => {
                    Err(Refusal::new(motion_columns, Fault::CycleNowhere { code }))
                }
                _ => Ok(()),
            };
        }
        if let Motion::Cycle(cycle) = motion {
            return self.cycle(cycle, words, motion_columns, commands);
        }
        let to = self.target(words, code, machine)?;
        let action = match motion {
            Motion::None | Motion::Cycle(_) => {
                let first = Axis::ALL
                    .iter()
                    .filter_map(|axis| words.columns(axis.letter() as u8))
                    .min_by_key(|columns| columns.start);
                return Err(Refusal::new(
                    first.unwrap_or(motion_columns),
                    Fault::NoMotion,
                ));
            }
            Motion::Rapid => Action::Rapid { to },
            Motion::Feed => Action::Feed {
                to,
                feed: self
                    .feed(words, code, to)
                    .map_err(|fault| Refusal::new(motion_columns, fault))?,
            },
            Motion::Arc(direction) => {
                let arc = self.arc(words, code, to, direction, motion_columns)?;
                Action::Arc {
                    arc,
                    feed: self
                        .feed(words, code, to)
                        .map_err(|fault| Refusal::new(motion_columns, fault))?,
                }
            }
        };
        self.go(action, words, motion_columns, commands)
    }

    /// Hands out a motion within the soft limits.
    pub(crate) fn go(
        &mut self,
        action: Action,
        words: &Words,
        columns: Columns,
        commands: &mut VecDeque<Action>,
    ) -> Result<(), Refusal> {
        self.within_limits(&action).map_err(|(axis, fault)| {
            let word = words.columns(axis.letter() as u8);
            Refusal::new(word.unwrap_or(columns), fault)
        })?;
        match &action {
            Action::Rapid { to } | Action::Feed { to, .. } => self.at = *to,
            Action::Arc { arc, .. } => self.at = arc.to,
            _ => {}
        }
        commands.push_back(action);
        Ok(())
    }

    /// Commands that bring a machine at `start` into this state.
    pub(crate) fn resume(
        &mut self,
        start: Point,
        commands: &mut VecDeque<Action>,
    ) -> Result<(), Refusal> {
        let initial = Modes::default();
        let modes = self.modes.clone();
        if modes.tool != initial.tool {
            let tool = modes.tool;
            commands.push_back(Action::Stop(Stop::ToolChange { tool }));
        }
        if modes.selected_tool != initial.selected_tool {
            commands.push_back(Action::SelectTool(modes.selected_tool));
        }
        if modes.spindle != initial.spindle {
            commands.push_back(Action::Spindle(modes.spindle));
        }
        if modes.coolant != initial.coolant {
            commands.push_back(Action::Coolant(modes.coolant));
        }
        if modes.path_mode != self.setup.path_mode {
            commands.push_back(Action::PathMode(modes.path_mode));
        }
        let across = modes.plane.axes()[2];
        let goal = std::mem::replace(&mut self.at, start);
        let down = goal[across] < start[across];
        let mut over = if down { goal } else { start };
        over[across] = start[across].max(goal[across]);
        for to in [over, goal] {
            let action = match self.modes.feed {
                // What is below may not have been cut yet.
                Some(rate) if down && to == goal => Action::Feed {
                    to,
                    feed: Feed::Rate(rate.number * rate.unit / 60.0),
                },
                _ => Action::Rapid { to },
            };
            if to != self.at {
                let columns = Columns { start: 1, end: 2 };
                self.go(action, &Words::default(), columns, commands)?;
            }
        }
        Ok(())
    }

    /// Where the axis words lead, machine coordinates.
    pub(crate) fn target(
        &self,
        words: &mut Words,
        code: Code,
        machine: bool,
    ) -> Result<Point, Refusal> {
        let mut to = self.at;
        for axis in self.setup.axes.iter() {
            let Some(length) = self.coordinate(words, axis, code)? else {
                continue;
            };
            to[axis] = if machine {
                length
            } else if self.modes.incremental {
                self.at[axis] + length
            } else {
                length + self.offset(axis)
            };
        }
        Ok(to)
    }

    /// The value of an axis's word, mm or degrees.
    pub(crate) fn coordinate(
        &self,
        words: &mut Words,
        axis: Axis,
        code: Code,
    ) -> Result<Option<f64>, Refusal> {
        let letter = axis.letter() as u8;
        let Some(number) = words.take(letter, code)? else {
            return Ok(None);
        };
        let value = number * self.unit(axis);
        match in_range(axis, value) {
            Ok(()) => Ok(Some(value)),
            Err(fault) => Err(words.refuse(letter, fault)),
        }
    }

    /// The unit of an axis's words, mm or degrees.
    pub(crate) fn unit(&self, axis: Axis) -> f64 {
        if axis.is_linear() {
            self.modes.unit()
        } else {
            1.0
        }
    }

    pub(crate) fn feed(&self, words: &mut Words, code: Code, to: Point) -> Result<Feed, Fault> {
        if self.modes.inverse_time {
            return match words.take_free(b'F') {
                Some(number) => Ok(Feed::Duration(60.0 / number)),
                None => Err(Fault::NoInverseTime { code }),
            };
        }
        let feed = self.modes.feed.ok_or(Fault::NoFeed { code })?;
        let moves = |axis: Axis| to[axis] != self.at[axis];
        let only_rotary = matches!(code, Code::G(10))
            && Axis::ALL.into_iter().any(moves)
            && !Axis::ALL
                .into_iter()
                .any(|axis| axis.is_linear() && moves(axis));
        let unit = if only_rotary { 1.0 } else { feed.unit };
        Ok(Feed::Rate(feed.number * unit / 60.0))
    }

    fn arc(
        &self,
        words: &mut Words,
        code: Code,
        to: Point,
        direction: Direction,
        columns: super::Columns,
    ) -> Result<Arc, Refusal> {
        let refuse = |fault| Refusal::new(columns, fault);
        let plane = self.modes.plane;
        let axes = plane.axes();
        let missing_axes = axes[..2]
            .iter()
            .find(|axis| !self.setup.axes.contains(**axis));
        if let Some(axis) = missing_axes {
            return Err(refuse(Fault::NoSuchAxis {
                axis: *axis,
                axes: self.setup.axes,
            }));
        }
        let turns = words
            .take_whole(b'P', code, 1..=100_000, "whole turns from 1 to 100000")?
            .unwrap_or(1);
        words.offsets_in_plane(plane)?;
        let letters = plane.offset_letters();
        let offsets = [words.take(letters[0], code)?, words.take(letters[1], code)?];
        let radius = words.take(b'R', code)?;
        for letter in [letters[0], letters[1], b'R'] {
            let value = words.take(letter, code)?.unwrap_or_default() * self.modes.unit();
            if value.abs() > RADIUS_LIMIT {
                let allowed = "within 10 km; write a line";
                return Err(words.refuse(letter, out_of_range(char::from(letter), value, allowed)));
            }
        }
        let unit = self.modes.unit();
        let arc = match (radius, offsets) {
            (Some(_), [Some(_), _] | [_, Some(_)]) => {
                return Err(words.refuse(b'R', Fault::ArcOverdefined));
            }
            (Some(radius), _) => {
                Arc::with_radius(plane, self.at, to, radius * unit, direction, turns)
            }
            (None, [None, None]) => {
                return Err(refuse(Fault::ArcUndefined(match plane {
                    Plane::Xy => "I and J, or R",
                    Plane::Zx => "I and K, or R",
                    Plane::Yz => "J and K, or R",
                })));
            }
            (None, [first, second]) if !self.modes.absolute_centers => {
                let offset = |value: Option<f64>| value.unwrap_or(0.0) * unit;
                let center = [
                    self.at[axes[0]] + offset(first),
                    self.at[axes[1]] + offset(second),
                ];
                Arc::about(plane, self.at, to, center, direction, turns)
            }
            (None, [Some(first), Some(second)]) => {
                let center = [
                    first * unit + self.offset(axes[0]),
                    second * unit + self.offset(axes[1]),
                ];
                Arc::about(plane, self.at, to, center, direction, turns)
            }
            (None, _) => {
                return Err(refuse(Fault::ArcUndefined(
                    "both offsets of the centre, as G90.1 asks for",
                )));
            }
        };
        arc.map_err(refuse)
    }

    /// Refuses a motion that leaves the soft limits anywhere.
    fn within_limits(&self, action: &Action) -> Result<(), (Axis, Fault)> {
        for axis in self.setup.axes.iter() {
            if let Action::Rapid { to } | Action::Feed { to, .. } = action {
                in_range(axis, to[axis]).map_err(|fault| (axis, fault))?;
            }
            let Some((least, greatest)) = self.setup.limits[axis.index()] else {
                continue;
            };
            let (low, high) = match action {
                Action::Arc { arc, .. } => arc.extent(axis),
                Action::Rapid { to } | Action::Feed { to, .. } => (to[axis], to[axis]),
                _ => continue,
            };
            // A start outside of the limits is for the caller to judge.
            let low = if low < self.at[axis] {
                low
            } else {
                low.max(least)
            };
            let high = if high > self.at[axis] {
                high
            } else {
                high.min(greatest)
            };
            let value = if low < least - LIMIT_ROUNDING {
                low
            } else if high > greatest + LIMIT_ROUNDING {
                high
            } else {
                continue;
            };
            let fault = Fault::SoftLimit {
                axis,
                value,
                least,
                greatest,
            };
            return Err((axis, fault));
        }
        Ok(())
    }

    /// The codes that stop, end or go elsewhere.
    fn stop(
        &mut self,
        words: &mut Words,
        commands: &mut VecDeque<Action>,
    ) -> Result<Continuation, Refusal> {
        let Some(code @ Code::M(number)) = words.code(Group::Stopping) else {
            return Ok(Continuation::Next);
        };
        let columns = words.code_columns(Group::Stopping).unwrap_or_default();
        match number {
            0 => commands.push_back(Action::Stop(Stop::Program)),
            1 if self.setup.optional_stop => commands.push_back(Action::Stop(Stop::Optional)),
            1 => {}
            98 => {
                let allowed = "the number of a subprogram";
                let Some(number) = words.take_whole(b'P', code, 0..=99_999_999, allowed)? else {
                    return Err(missing(words, Group::Stopping, code, "P, the subprogram"));
                };
                let allowed = "a whole number of repetitions";
                let repeats = words.take_whole(b'L', code, 0..=99_999_999, allowed)?;
                return Ok(Continuation::CallSubprogram {
                    number,
                    repeats: repeats.unwrap_or(1),
                    columns,
                });
            }
            99 => return Ok(Continuation::EndSubprogram { columns }),
            _ => return Ok(Continuation::End),
        }
        Ok(Continuation::Next)
    }

    fn set_named(&mut self, name: &str, value: f64) -> Result<(), Fault> {
        if self.system_named(name).is_some() {
            return Err(Fault::ParameterReadOnly(format!("#<{name}>")));
        }
        self.parameters.set_named(name, value);
        Ok(())
    }

    fn set_numbered(&mut self, index: f64, value: f64) -> Result<(), Fault> {
        let index = parameters::index(index)?;
        if self.set_system(index, value)? {
            return Ok(());
        }
        self.parameters.set_numbered(index, value)
    }
}

impl Scope for State {
    fn numbered(&self, index: f64) -> Result<f64, Fault> {
        let index = parameters::index(index)?;
        Ok(self
            .system(index)
            .unwrap_or_else(|| self.parameters.numbered(index)))
    }

    fn named(&self, name: &str) -> Option<f64> {
        self.parameters
            .named(name)
            .or_else(|| self.system_named(name))
    }
}

/// Refuses coordinates beyond every machine, which would lose digits, and what is no number.
pub(crate) fn in_range(axis: Axis, value: f64) -> Result<(), Fault> {
    if value.abs() <= COORDINATE_LIMIT {
        return Ok(());
    }
    Err(Fault::Coordinate {
        axis,
        value,
        allowed: COORDINATE_LIMIT,
    })
}

pub(crate) fn missing(words: &Words, group: Group, code: Code, what: &'static str) -> Refusal {
    Refusal::new(
        words.code_columns(group).unwrap_or_default(),
        Fault::MissingWord { code, words: what },
    )
}
