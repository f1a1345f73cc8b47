//! How things are: one snapshot, replaced at most once a cycle.

use super::command::switched;
use super::jobs::Jobs;
use super::{Command, Desk, Event, Settings};
use crate::control::{Layout, MeasuredSample, Phase, SpindleSample, State, Switch, Waiting};
use crate::machine::{AnalogSource, COORDINATES, MEASURED, OutputSwitch};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use syncline_drives::model::PowerState;
use syncline_gcode::{Coolant, InEffect, Outputs, Point, Spindle, WorkCoordinates};

/// How square a gantry is, in the unit of its axis, mm or degrees.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Squareness {
    /// By how much the second side's switch comes on further where the gantry is square: `squareness` of the machine file.
    pub stored: f64,
    /// By how much its sides were out of square when it was homed, the second beyond the first, before that was taken
    /// out; `None` while it is not referenced, or by what another day has left.
    pub measured: Option<f64>,
}

/// A machine and its job at one instant. Arrays are by letter, X Y Z A B C U V W, in machine
/// coordinates; what has no axis stays 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Status {
    /// What may be asked of the machine depends on this.
    pub state: State,
    /// Whose positions are machine positions; what has no axis has none to home.
    pub referenced: [bool; COORDINATES],
    /// How square the gantries are that homing takes square; `None` of other axes.
    pub squareness: [Option<Squareness>; COORDINATES],
    /// The phase between power-up and the end.
    pub phase: Phase,
    /// Since the program could begin, s; `None` before.
    pub time: Option<f64>,
    /// How long the program still takes, with these overrides and without stops for an operator, s; `None` where
    /// that is not known, not asked for, or an override has it stand still.
    pub remaining: Option<f64>,
    /// The line of the program, or of what was typed in.
    pub line: u32,
    /// What was typed in, where that is at work or was last and not a program; of an offset or a length that was set
    /// nothing.
    pub typed: Option<String>,
    /// Setpoints, mm and degrees.
    pub setpoint: [f64; COORDINATES],
    /// Where the axes are, mm and degrees.
    pub actual: [f64; COORDINATES],
    /// Of the setpoints, mm/s and °/s.
    pub velocity: [f64; COORDINATES],
    /// How far the program has come, mm and degrees together.
    pub passed: f64,
    /// At rest on the path until an operator goes on: a feed hold or a program stop.
    pub waits: bool,
    /// What the job waits for, where nothing moves and no operator holds it.
    pub waiting: Option<Waiting>,
    /// Axes are jogged away from the path, or go back to it, or a program homes them.
    pub off_path: bool,
    /// Path speed that is asked for, after overrides, mm/s or °/s; `None` for a rapid.
    pub feed: Option<f64>,
    /// Where the move ends that the setpoints are on, mm and degrees; `None` where they are on none, or where that is not known.
    pub target: Option<[f64; COORDINATES]>,
    /// The tool in the spindle.
    pub tool: u32,
    /// What the tables call it.
    pub tool_name: String,
    /// M3, M4, M5, S.
    pub spindle: Spindle,
    /// What the drive of the spindle measures; `None` where none turns it.
    pub spindle_actual: Option<SpindleSample>,
    /// What the encoders on shafts of their own measure, in the order of the machine file; `None` of what has none.
    pub measured: [Option<MeasuredSample>; MEASURED],
    /// M7, M8, M9.
    pub coolant: Coolant,
    /// What lies between work and machine coordinates in the block at work, and otherwise where the next job begins, mm and
    /// degrees.
    pub offset: [f64; COORDINATES],
    /// By how much X and Y of the work are turned about there, degrees, counterclockwise.
    pub rotation: f64,
    /// The modal state of the block at work, and otherwise the one in which the next job begins, as its codes.
    pub modes: String,
    /// The program that is loaded.
    pub program: Option<PathBuf>,
    /// The line at work of the program that was interrupted and can be resumed.
    pub interrupted: Option<u32>,
    /// What the power stages of the drives do, as the drives told last, in the order of the machine file.
    pub drives: Vec<PowerState>,
    /// Which inputs of the machine are on, in the order of the machine file.
    pub inputs: Vec<bool>,
    /// Likewise of its outputs.
    pub outputs: Vec<bool>,
    /// What its analog inputs are, in the unit of their full scale, as of the last SYNC of a machine that is enabled.
    pub analog_inputs: Vec<f64>,
    /// What its analog outputs put out, in the unit of their full scale.
    pub analog_outputs: Vec<f64>,
    /// What operators have set.
    pub settings: Settings,
    /// What stopped the machine, until it is reset.
    pub stopped: Option<Stopped>,
}

/// What stopped a machine.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Stopped {
    /// What happened, to whom and what to do, in words: the first cause on top, then what followed.
    pub faults: Vec<String>,
    /// The line of the block that was at work and is not completed, if a job was.
    pub line: Option<u32>,
    /// Where the axes are, and in the end where they came to rest, by letter, machine coordinates, mm and
    /// degrees.
    pub position: [f64; COORDINATES],
}

impl Default for Status {
    fn default() -> Self {
        Self {
            state: State::Starting,
            referenced: [true; COORDINATES],
            squareness: [None; COORDINATES],
            phase: Phase::Survey,
            time: None,
            remaining: None,
            line: 0,
            typed: None,
            setpoint: [0.0; COORDINATES],
            actual: [0.0; COORDINATES],
            velocity: [0.0; COORDINATES],
            passed: 0.0,
            waits: false,
            waiting: None,
            off_path: false,
            feed: Some(0.0),
            target: None,
            tool: 0,
            tool_name: String::new(),
            spindle: Spindle::default(),
            spindle_actual: None,
            measured: [None; MEASURED],
            coolant: Coolant::default(),
            offset: [0.0; COORDINATES],
            rotation: 0.0,
            modes: String::new(),
            program: None,
            interrupted: None,
            drives: Vec::new(),
            inputs: Vec::new(),
            analog_inputs: Vec::new(),
            outputs: Vec::new(),
            analog_outputs: Vec::new(),
            settings: Settings::default(),
            stopped: None,
        }
    }
}

impl Status {
    /// Where the axes are in work coordinates, mm and degrees.
    #[must_use]
    pub fn work_position(&self) -> [f64; COORDINATES] {
        self.coordinates().to_program(Point(self.actual)).0
    }

    /// Whether no axis moves.
    #[must_use]
    pub fn stands(&self) -> bool {
        self.velocity.iter().all(|velocity| *velocity == 0.0)
    }

    /// How work coordinates lie in the machine.
    pub(super) fn coordinates(&self) -> WorkCoordinates {
        WorkCoordinates {
            origin: Point(self.offset),
            rotation: self.rotation,
        }
    }

    /// What is in effect of the machine, of which M-codes have made these `outputs` as far as no signals are wired to them, once
    /// what is `ordered` has taken effect.
    pub(super) fn in_effect<'a>(
        &self,
        layout: &Layout,
        mut outputs: Outputs,
        ordered: impl Iterator<Item = &'a Command>,
    ) -> InEffect {
        let Self {
            mut coolant,
            mut spindle,
            ..
        } = *self;
        // What is put out at the terminals, as far as it was told.
        let mut digital = self.outputs.clone();
        let mut analog = self.analog_outputs.clone();
        for command in ordered {
            if let Some((index, on)) = switched(layout, command)
                && let Some(output) = digital.get_mut(index)
            {
                *output = on;
            }
            if *command == Command::Stop {
                (outputs, coolant) = (Outputs::default(), Coolant::default());
                spindle = spindle.stopped();
                digital = layout.outputs.iter().map(|it| it.safe).collect();
                analog = layout.analog_outputs.iter().map(|it| it.safe).collect();
            }
        }
        for (output, on) in layout.outputs.iter().zip(digital) {
            match output.switch {
                OutputSwitch::Program(number) => outputs.put(number, on),
                OutputSwitch::Mist => coolant.mist = on,
                OutputSwitch::Flood => coolant.flood = on,
                OutputSwitch::Spindle
                | OutputSwitch::SpindleReverse
                | OutputSwitch::EnableChain => {}
            }
        }
        for (output, value) in layout.analog_outputs.iter().zip(analog) {
            if let AnalogSource::Program(number) = output.source {
                outputs.analog[usize::from(number)] = value;
            }
        }
        InEffect {
            tool: self.tool,
            spindle,
            coolant,
            outputs,
        }
    }

    /// The state, and whether axes have to be homed in it: `ready (unreferenced)`.
    #[must_use]
    pub fn state_in_words(&self) -> String {
        match self.state {
            State::Ready if self.referenced.contains(&false) => {
                format!("{} (unreferenced)", self.state)
            }
            state => state.to_string(),
        }
    }
}

/// The latest status of a session, from any thread.
#[derive(Clone, Debug)]
pub struct StatusView(Arc<Mutex<Status>>);

impl StatusView {
    pub(super) fn new(status: Status) -> Self {
        Self(Arc::new(Mutex::new(status)))
    }

    pub(super) fn show(&self, status: &Status) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = status.clone();
    }

    /// How things are now.
    #[must_use]
    pub fn get(&self) -> Status {
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }
}

/// What it shows of what happens.
impl Desk {
    /// Shows what is switched, also where no row follows: a quick stop switches off behind the last one.
    pub(super) fn show_switched(&mut self, line: u32, switch: Switch) {
        match switch {
            Switch::Spindle(spindle) => self.status.spindle = spindle,
            Switch::Coolant(change) => self.status.coolant = change.of(self.status.coolant),
            Switch::Message => {
                if let Some(text) = self.job.moves.next_message() {
                    self.outlets.tell(Event::Message { line, text });
                }
            }
            Switch::Tool(tool) => self.show_tool(tool),
            Switch::Output(_) => {}
        }
    }

    /// Shows the tool in the spindle, with its name.
    pub(super) fn show_tool(&mut self, tool: u32) {
        if std::mem::replace(&mut self.status.tool, tool) != tool {
            let programs = self.jobs.as_ref().map(Jobs::programs);
            let tool = programs.and_then(|programs| programs.tool(tool));
            self.status.tool_name = tool.map_or_else(String::new, |tool| tool.name.clone());
        }
    }

    /// Shows whether the positions of an axis are machine positions, and how far `apart` its homing has found the sides of
    /// a gantry.
    pub(super) fn show_reference(&mut self, axis: usize, referenced: bool, apart: Option<f64>) {
        let at = self.coordinates[axis];
        self.status.referenced[at] = referenced;
        let shown = &mut self.status.squareness[at];
        if let (Some(square), Some(_)) = (self.layout.axes[axis].homing.square, apart) {
            *shown = Some(Squareness {
                stored: square.squareness,
                measured: apart,
            });
        } else if let Some(squareness) = shown {
            squareness.measured = apart;
        }
    }

    /// Shows the state, and tells a change of it.
    pub(super) fn show_state(&mut self) {
        loop {
            let jobs = self.jobs.as_ref();
            let shown = self.status.state;
            let state = jobs.map_or(self.state, |jobs| jobs.state(self.state, shown));
            if state == shown {
                return;
            }
            self.status.state = state;
            self.outlets.tell(Event::State(state));
        }
    }

    /// Shows what is in effect in the block at work, and otherwise what the programs so far have left.
    pub(super) fn show_programs(&mut self) {
        let (coordinates, modes) = match (&self.job.modal, &self.jobs) {
            (Some(modal), _) => (modal.coordinates, &modal.modes),
            (None, Some(jobs)) => jobs.in_effect(),
            (None, None) => return,
        };
        self.status.offset = coordinates.origin.0;
        self.status.rotation = coordinates.rotation;
        self.status.modes = modes.to_string();
        if let Some(jobs) = &self.jobs {
            self.status.interrupted = jobs.interrupted();
            self.status.program = jobs.loaded().map(Path::to_owned);
        }
    }
}
