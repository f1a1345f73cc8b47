//! What a block does: the modal state, the position, and the commands that come of it.
//!
//! The items of a block take effect in the order of RS-274/NGC (feed, speed, tool, spindle,
//! coolant, dwell, modes, offsets, motion, stop), with one exception: units count for the whole
//! block, so that `G20 F10` is ten inches a minute.

use std::collections::VecDeque;

use super::Setup;
use super::arc::Plane;
use super::axes::{AxisLetter, AxisSet, Point};
use super::block::{Block, Setting, Target, Word};
use super::command::{Action, PathMode, Stop};
use super::compensation::Cutter;
use super::cycles::Series;
use super::error::{Fault, Refusal};
use super::expression::{Scope, Value};
use super::lexer::Columns;
use super::lost::{Lost, Things};
use super::messages::message;
use super::modal::{Code, FeedMode, Group, Modes, ProgrammedFeed};
use super::names::is_signal;
use super::parameters::{self, INPUT_RESULT, InputResult, Parameters};
use super::saved::SavedModes;
use super::spline::Nurbs;
use super::tables::Places;
use super::words::{Words, out_of_range};

/// The least feed above 0, and what is as good as any greater one: no axis keeps up with it.
const LEAST_FEED: f64 = 0.001;
const GREATEST_FEED: f64 = 1e7;
/// The greatest distance of G64 P and Q, mm: with a greater one whole contours would go.
const GREATEST_TOLERANCE: f64 = 10.0;
/// The longest dwell, s.
pub(crate) const DWELL_LIMIT: f64 = 1e6;

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

/// Whether the tool goes beside the programmed contour.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) enum Compensated {
    #[default]
    Off,
    /// G41, G42: for this cutter, or for one without a radius.
    On(Option<Cutter>),
    /// G40 was read and the tool is still beside the contour.
    Leaving,
}

/// How far the execution of a block has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Come {
    #[default]
    Nowhere,
    /// Parameters are set.
    ToSettings,
    /// To this one of the [`STAGES`].
    ToStage(usize),
    /// It is known where it leads.
    BehindMotion,
}

/// What a block does at once.
type Stage = fn(&mut State, &Block, &mut Words, &mut VecDeque<Action>) -> Result<(), Refusal>;

/// What blocks do, in this order, each with what is not known if it is refused.
pub(crate) const STAGES: [(Stage, Things); 14] = [
    (
        |it, _, words, _| it.end_compensation_by(words),
        Things::IN_CONTOUR,
    ),
    (|it, _, words, _| it.only_nurbs(words), Things::NURBS),
    (
        |it, _, words, _| it.feeds(words),
        Things::FEED.and(Things::FEED_MODE).and(Things::UNITS),
    ),
    (
        |it, _, words, commands| it.tools(words, commands),
        Things::SELECTED.and(Things::TOOL),
    ),
    (
        |it, _, words, commands| it.spindle(words, commands),
        Things::SPINDLE,
    ),
    (
        |it, _, words, commands| it.coolant(words, commands),
        Things::NONE,
    ),
    (
        |it, _, words, commands| it.save_or_restore(words, commands),
        Things::MODES.and(Things::SAVED),
    ),
    (
        |it, _, words, commands| it.switches(words, commands),
        Things::NONE,
    ),
    (
        |it, _, words, commands| it.dwell(words, commands),
        Things::NONE,
    ),
    (
        |it, _, words, commands| it.set_modes(words, commands),
        Things::PLANE
            .and(Things::TOOL_LENGTH)
            .and(Things::WORK_OFFSET)
            .and(Things::DISTANCE)
            .and(Things::ARC_DISTANCE)
            .and(Things::CYCLE_RETURN)
            .and(Things::COMPENSATION),
    ),
    (|it, _, words, _| it.turned_axes(words), Things::NONE),
    (
        |it, _, words, commands| it.offsets(words, commands),
        Things::SHIFT.and(Things::TABLE).and(Things::REFERENCES),
    ),
    (
        |it, block, _, commands| it.follow_centre(block, commands),
        Things::SURFACE,
    ),
    (State::motion, Things::NONE),
];

/// What executing a program knows between two blocks.
pub(crate) struct State {
    pub(crate) setup: Setup,
    pub(crate) modes: Modes,
    /// The programmed position in machine coordinates.
    pub(crate) at: Point,
    /// The axes that blocks have sent somewhere; others stand where they were found.
    pub(crate) sent: AxisSet,
    /// What is not known behind a block that was refused.
    pub(crate) lost: Lost,
    /// How far [`execute`](Self::execute) has come with the block that was read last.
    pub(crate) come: Come,
    /// Its code that ends the program, or goes elsewhere.
    pub(crate) stopping: Option<Code>,
    /// What G43 and G43.1 added.
    pub(crate) tool_offset: Point,
    /// Whether the shift of G92 and G52 is in effect.
    pub(crate) g92_applies: bool,
    pub(crate) parameters: Parameters,
    pub(crate) compensated: Compensated,
    /// What canned cycles keep from block to block.
    pub(crate) series: Series,
    /// Where the last G5 led, from its end, mm: what a G5 without I and J goes on with.
    pub(crate) spline_direction: Option<[f64; 2]>,
    /// What G5.2 has begun, and where that starts.
    pub(crate) nurbs: Option<Nurbs>,
    pub(crate) nurbs_start: Option<Point>,
    /// The line of the block that is being executed.
    pub(crate) line: u32,
    /// What M70 and M73 have saved: of the main program, then of each subroutine that is open.
    pub(crate) saved: Vec<Option<SavedModes>>,
    /// What the inputs and outputs of the machine are, where the block that is being executed reads them.
    pub(crate) signals: Option<Vec<f64>>,
    /// Whether it is known what the last M66 found.
    pub(crate) input_result: InputResult,
    /// Working memory: the values of an expression, and each setting's index and value.
    stack: Vec<f64>,
    settings: Vec<(f64, f64)>,
    /// The stored points and rotations that the block sets: these take effect behind it.
    pub(crate) places: Vec<(usize, f64)>,
    /// The values of the tables that blocks have set.
    pub(crate) set: Places,
}

impl State {
    pub(crate) fn new(setup: Setup) -> State {
        State {
            at: setup.start,
            sent: AxisSet::NONE,
            lost: Lost::default(),
            come: Come::default(),
            stopping: None,
            modes: setup.memory.modes.clone(),
            tool_offset: setup.memory.tool_offset,
            g92_applies: setup.memory.g92_applies,
            parameters: setup.memory.parameters.clone(),
            saved: vec![setup.memory.saved.clone()],
            input_result: setup.memory.input_result,
            setup,
            compensated: Compensated::default(),
            series: Series::default(),
            spline_direction: None,
            nurbs: None,
            nurbs_start: None,
            line: 0,
            signals: None,
            stack: Vec::new(),
            settings: Vec::new(),
            places: Vec::new(),
            set: Places::default(),
        }
    }

    /// Another block is read.
    pub(crate) fn begin_block(&mut self) {
        (self.come, self.stopping) = (Come::default(), None);
        self.lost.begin_block();
    }

    /// Executes the words and parameter settings of a block.
    pub(crate) fn execute(
        &mut self,
        block: &Block,
        commands: &mut VecDeque<Action>,
    ) -> Result<Continuation, Refusal> {
        let mut words = self.evaluate(block)?;
        self.stopping = words.code(Group::Stopping);
        self.know(block, &words);
        self.messages(block, &words, commands);
        for (index, (stage, _)) in STAGES.iter().enumerate() {
            self.come = Come::ToStage(index);
            stage(self, block, &mut words, commands)?;
        }
        self.come = Come::BehindMotion;
        let continuation = self.stop(&mut words, commands)?;
        words.all_used()?;
        self.set_places();
        Ok(continuation)
    }

    /// What is wrong with the words of a block whatever came before it; their code that ends the program or goes elsewhere.
    pub(crate) fn judge(&self, block: &Block) -> Result<Option<Code>, Refusal> {
        let mut words = Words::default();
        for word in &block.words {
            self.has_axis_of(word)?;
            let known = block.is_constant(&word.value);
            // Which code a parameter makes is not known.
            if known || !matches!(word.letter, b'G' | b'M') {
                let value = block.evaluate(&word.value, self, &mut Vec::new());
                words.add(word.letter, value.unwrap_or_default(), word.columns)?;
            }
        }
        Ok(words.code(Group::Stopping))
    }

    /// Refuses the word of an axis that the machine does not have.
    pub(crate) fn has_axis_of(&self, word: &Word) -> Result<(), Refusal> {
        let axes = self.setup.axes;
        match AxisLetter::from_letter(char::from(word.letter)) {
            Some(axis) if !axes.contains(axis) => {
                Err(Refusal::new(word.columns, Fault::NoSuchAxis { axis, axes }))
            }
            _ => Ok(()),
        }
    }

    /// Evaluates every word and setting with the parameters as they were before the block, and sets.
    fn evaluate(&mut self, block: &Block) -> Result<Words, Refusal> {
        let mut stack = std::mem::take(&mut self.stack);
        let mut words = Words::default();
        for word in &block.words {
            self.has_axis_of(word)?;
            let value = block.evaluate(&word.value, self, &mut stack)?;
            words.add(word.letter, value, word.columns)?;
        }
        let mut settings = std::mem::take(&mut self.settings);
        settings.clear();
        self.places.clear();
        for setting in &block.settings {
            let value = block.evaluate(&setting.value, self, &mut stack)?;
            let index = match &setting.target {
                Target::Numbered(index) => block.evaluate(index, self, &mut stack)?,
                Target::Named(_) => 0.0,
            };
            settings.push((index, value));
        }
        self.come = Come::ToSettings;
        let mut done = Ok(());
        for (setting, (index, value)) in block.settings.iter().zip(&settings) {
            let set = self.set(block, setting, *index, *value);
            done = done.and(set);
        }
        self.settings = settings;
        done?;
        self.stack = stack;
        Ok(words)
    }

    fn set(
        &mut self,
        block: &Block,
        setting: &Setting,
        index: f64,
        value: f64,
    ) -> Result<(), Refusal> {
        let set = match &setting.target {
            Target::Named(name) => self.set_named(block.name(name), value),
            Target::Numbered(_) => self.set_numbered(index, value),
        };
        set.map_err(|fault| Refusal::new(setting.columns, fault))
    }

    /// Sets a parameter of a block that was refused; `false` if it is not known to what.
    pub(crate) fn set_what_can_be(&mut self, block: &Block, setting: &Setting) -> bool {
        let stack = &mut Vec::new();
        let index = match &setting.target {
            Target::Numbered(index) if self.is_lost(block, index) => return false,
            Target::Numbered(index) => block.evaluate(index, self, stack),
            Target::Named(_) => Ok(0.0),
        };
        match (index, block.evaluate(&setting.value, self, stack)) {
            (Ok(index), Ok(value)) => {
                let _ = self.set(block, setting, index, value);
                true
            }
            _ => false,
        }
    }

    /// What the block's comments tell the operator, before it does anything.
    fn messages(&self, block: &Block, words: &Words, commands: &mut VecDeque<Action>) {
        let stops = words.code(Group::ToolChange) == Some(Code::M(6))
            || matches!(words.code(Group::Stopping), Some(Code::M(0 | 1)));
        let comments = block.tokens.comments.iter();
        let told = comments.filter_map(|at| message(&block.text[at.clone()], stops, self));
        commands.extend(told.map(Action::Message));
    }

    /// Evaluates one value of a block.
    pub(crate) fn value(&mut self, block: &Block, value: &Value) -> Result<f64, Refusal> {
        let mut stack = std::mem::take(&mut self.stack);
        let result = block.evaluate(value, self, &mut stack);
        self.stack = stack;
        result
    }

    /// Units, feed mode and F.
    pub(crate) fn feeds(&mut self, words: &mut Words) -> Result<(), Refusal> {
        if let Some(units) = words.code(Group::Units) {
            self.modes.inches = units == Code::G(200);
        }
        if let Some(mode) = words.code(Group::FeedMode) {
            let feed_mode = FeedMode::of(mode);
            if feed_mode == FeedMode::PerTurn && !self.setup.has_spindle_angle {
                let columns = words.code_columns(Group::FeedMode).unwrap_or_default();
                return Err(Refusal::new(columns, Fault::NoFeedPerTurn));
            }
            if feed_mode != self.modes.feed_mode {
                self.modes.feed = None;
            }
            self.modes.feed_mode = feed_mode;
        }
        let Some(number) = words.take_free(b'F') else {
            return Ok(());
        };
        if number < 0.0 || (number > 0.0 && number < LEAST_FEED) {
            let allowed = "0, or a feed from 0.001";
            return Err(words.refuse(b'F', out_of_range('F', number, allowed)));
        }
        if self.modes.feed_mode != FeedMode::InverseTime {
            self.modes.feed = Some(ProgrammedFeed {
                number: number.min(GREATEST_FEED),
                unit: self.modes.unit(),
            });
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

    pub(crate) fn set_modes(
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
                    let mut length = |letter, what| {
                        let value = words.take(letter, code)?;
                        let allowed =
                            |value: f64| (0.0..=GREATEST_TOLERANCE).contains(&(value * unit));
                        match value.filter(|value| !allowed(*value)) {
                            Some(value) => {
                                let refused = out_of_range(char::from(letter), value, what);
                                Err(words.refuse(letter, refused))
                            }
                            None => Ok(value.map(|value| value * unit)),
                        }
                    };
                    let distance = "a distance up to 10 mm; 0 is the machine's own";
                    let tolerance = length(b'P', distance)?;
                    let merge = length(b'Q', "a distance up to 10 mm; 0 merges nothing")?;
                    PathMode::Blend {
                        tolerance: tolerance.filter(|within| *within > 0.0),
                        merge: merge.filter(|within| *within > 0.0),
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
        self.compensate(words)
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
            1 => commands.push_back(Action::Stop(Stop::Optional)),
            98 => {
                let allowed = "the number of a subprogram, a whole one up to 99999999";
                let Some(number) = words.take_whole(b'P', code, 0..=99_999_999, allowed)? else {
                    return Err(missing(words, Group::Stopping, code, "P, the subprogram"));
                };
                let allowed =
                    "how often the subprogram is called, a whole number from 0 to 99999999";
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
        let written = || format!("#<{name}>");
        if is_signal(name) {
            return Err(Fault::SignalSet(written()));
        }
        if name.starts_with("_ini[") {
            return Err(Fault::ParameterReadOnly(written()));
        }
        self.parameters.set_named(name, value);
        Ok(())
    }

    fn set_numbered(&mut self, index: f64, value: f64) -> Result<(), Fault> {
        let index = parameters::index(index)?;
        if self.shifts(index) && self.cutter().is_some() {
            return Err(Fault::ParameterWhileCompensated(format!("#{index}")));
        }
        if self.may_set_place(index, value)? {
            self.places.push((index, value));
            return Ok(());
        }
        self.parameters.set_numbered(index, value)
    }
}

impl Scope for State {
    fn numbered(&self, index: f64) -> Result<f64, Fault> {
        let index = parameters::index(index)?;
        if index == INPUT_RESULT {
            match self.input_result {
                InputResult::Known => {}
                InputResult::Asked => return Err(Fault::InputResult),
                InputResult::Passed => return Err(Fault::InputPassed),
            }
        }
        // Only messages are evaluated between a setting and what comes of it.
        let set = self.places.iter().rev().find(|(place, _)| *place == index);
        if let Some((_, value)) = set {
            return Ok(*value);
        }
        Ok(self
            .system(index)
            .unwrap_or_else(|| self.parameters.numbered(index)))
    }

    fn named(&self, name: &str) -> Option<f64> {
        self.parameters
            .named(name)
            .or_else(|| self.system_named(name))
            .or_else(|| self.setup.names.value(name, self.signals.as_deref()))
    }

    fn refusal(&self, name: &str) -> Option<Fault> {
        self.setup.names.refusal(name)
    }
}

pub(crate) fn missing(words: &Words, group: Group, code: Code, what: &'static str) -> Refusal {
    Refusal::new(
        words.code_columns(group).unwrap_or_default(),
        Fault::MissingWord { code, words: what },
    )
}
