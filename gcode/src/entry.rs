//! Where a program is begun in its middle: at a line, or behind so many of its commands. What brings the machine
//! into the state of that place is an [`Entry`].

use super::Setup;
use super::axes::Point;
use super::command::{
    Action, Coolant, CoolantChange, Output, Outputs, PathMode, Spindle, Stop, Way,
};
use super::modal::Modes;
use super::outputs::PassedOutputs;
use super::probe::Probed;

/// What brings a machine to a place in the midst of a program, in this order.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// The position that the program has come to there, machine coordinates.
    pub at: Point,
    /// Tool, spindle, coolant, outputs and path mode, as far as they are not as the program has them there.
    pub set_up: Vec<Action>,
    /// What the program has switched the spindle to there.
    pub spindle: Spindle,
    /// The way to the position, last along the axis across the plane when that goes down.
    pub approach: Vec<Action>,
    /// Outputs that wait for the program's next motion.
    pub with_motion: Vec<Output>,
    /// The program taps next, where that is known.
    pub taps: bool,
    /// How many answers of the machine the program has had up to there.
    pub answered: usize,
}

/// What a machine has answered a program that could not be read further before.
#[derive(Clone, Debug, PartialEq)]
pub enum Answer {
    /// What came of a probing.
    Probed(Probed),
    /// What inputs and outputs were, as [`Interpreter::signals_read`](crate::Interpreter::signals_read) takes it.
    Signals {
        /// By the order of their names.
        signals: Vec<f64>,
        /// What the last M66 found.
        input_result: f64,
    },
}

/// A place in a program: behind so many of its commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// How many commands come before it.
    pub passed: u64,
    /// The number of one of its commands, from 0, and the line that asked for that: the last one before the place or
    /// the first behind it. By that a program is told that does not lead there any more.
    pub known: Option<(u64, u32)>,
}

/// What is in effect of a machine that is to be brought to a place in a program.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct InEffect {
    /// The tool in the spindle.
    pub tool: u32,
    /// M3, M4, M5, S.
    pub spindle: Spindle,
    /// M7, M8, M9.
    pub coolant: Coolant,
    /// Its outputs.
    pub outputs: Outputs,
}

/// What the commands of a program have come to, one after the other.
pub(crate) struct Passed {
    initial: Modes,
    outputs: PassedOutputs,
    effect: InEffect,
    selected_tool: u32,
    path_mode: PathMode,
}

impl Passed {
    /// None, of a program that begins there.
    pub(crate) fn new(start: Point, setup: &Setup) -> Self {
        let initial = &setup.memory.modes;
        Self {
            outputs: PassedOutputs::new(start, setup.outputs),
            effect: InEffect {
                tool: initial.tool,
                spindle: initial.spindle,
                coolant: setup.coolant,
                outputs: setup.outputs,
            },
            selected_tool: initial.selected_tool,
            path_mode: initial.path_mode,
            initial: initial.clone(),
        }
    }

    /// What they have put into effect.
    pub(crate) fn effect(&self) -> InEffect {
        InEffect {
            outputs: self.outputs.outputs,
            ..self.effect
        }
    }

    /// Passes the next command.
    pub(crate) fn pass(&mut self, action: &Action) {
        self.outputs.pass(action);
        match action {
            Action::Stop(Stop::ToolChange { tool }) | Action::ToolLoaded(tool) => {
                self.effect.tool = *tool;
            }
            Action::SelectTool(tool) => self.selected_tool = *tool,
            Action::Spindle(spindle) => self.effect.spindle = *spindle,
            Action::Coolant(change) => self.effect.coolant = change.of(self.effect.coolant),
            Action::PathMode(mode) => self.path_mode = *mode,
            _ => {}
        }
    }

    /// Passes a probing that ended there.
    pub(crate) fn probed(&mut self, at: Point) {
        self.outputs.moved(at);
    }

    /// The position that the commands lead to.
    pub(crate) fn at(&self) -> Point {
        self.outputs.at()
    }

    /// What brings a machine that goes that way to `at` in which that is in effect.
    pub(crate) fn entry(self, now: &InEffect, at: Point, approach: Vec<Action>) -> Entry {
        let Self {
            initial,
            outputs,
            effect,
            selected_tool,
            path_mode,
        } = self;
        let tool = effect.tool;
        let mut spindle = effect.spindle;
        if let Some(orientation) = &mut spindle.orientation {
            // What it holds may be in the work.
            orientation.way = Way::Shorter;
        }
        let tool_change = Action::Stop(Stop::ToolChange { tool });
        let set_up = [
            (tool != now.tool).then_some(tool_change),
            (selected_tool != initial.selected_tool).then_some(Action::SelectTool(selected_tool)),
            (effect.spindle != now.spindle).then_some(Action::Spindle(spindle)),
            (effect.coolant != now.coolant)
                .then(|| Action::Coolant(CoolantChange::between(now.coolant, effect.coolant))),
        ];
        let set_up = set_up.into_iter().flatten();
        let outputs_first = outputs.outputs.unlike(&now.outputs).map(Action::Output);
        let path_mode = (path_mode != initial.path_mode).then_some(Action::PathMode(path_mode));
        Entry {
            at,
            set_up: set_up.chain(outputs_first).chain(path_mode).collect(),
            spindle: effect.spindle,
            approach,
            with_motion: outputs.await_motion,
            taps: false,
            answered: 0,
        }
    }
}
