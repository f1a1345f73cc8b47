//! What M-codes switch: the spindle, the coolant, the tool, outputs.
//!
//! An M-code between two moves is a waypoint of the path: the path does not stop there, and what the
//! M-code switches is switched with the first setpoint behind it. So between the M-codes of a program
//! there is what the program has between them, dwells too. What is to be switched comes into the
//! cycle in the program's order and apart from the plan, which is replaced as an operator acts: it is
//! never replaced, waits here for the path to come to its waypoint, and is executed once.
//!
//! Outputs of the machine that are wired to drives and I/O nodes follow with the setpoint of the same SYNC. Before the
//! program, and from the cycle on in which a stop begins, for whatever reason, they have their safe
//! values.
//!
//! An output that closes the enable chain is no program's: it is on from where drives are to be made ready to switch on
//! until their power stages are to be off.
//!
//! An operator may switch outputs by hand where the machine rests. In a hold the program's own state is back before
//! the path goes on; without a job what was switched by hand is what the next job begins with.

use super::Layout;
use super::{Controller, Event, Job, JobKind, Phase, Request, State, event_sink};
use crate::machine::{self, AnalogSource, OutputSwitch};
use std::collections::VecDeque;
use std::fmt;
use std::mem::take;
use std::sync::Arc;
use syncline_gcode::{AxisLetter, Coolant, CoolantChange, Output, Outputs, Spindle, Turning};

/// M-codes that the cycle has room for. Where a program has more without a stop, the path rests for
/// them to be executed.
pub const SWITCHES: usize = 16_384;

/// M-codes that are executed in a cycle at most; where more stand at one place, the others follow.
const MOST_SWITCHED: usize = 64;

/// What an M-code switches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Switch {
    /// The spindle: M3, M4, M5, S.
    Spindle(Spindle),
    /// The coolant: M7, M8, M9.
    Coolant(CoolantChange),
    /// The tool that M6 loaded.
    Tool(u32),
    /// An output: M62 … M65, M67, M68; a code of the user's is only told.
    Output(Output),
    /// Nothing: the operator is told the program's next message.
    Message,
}

/// What the program has switched.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MachineFunctions {
    /// M3, M4, M5, S.
    pub spindle: Spindle,
    /// M7, M8, M9.
    pub coolant: Coolant,
    /// The tool that M6 loaded.
    pub tool: u32,
    /// M62 … M65, M67, M68.
    pub outputs: Outputs,
    /// The line of the last M-code.
    pub line: u32,
}

impl MachineFunctions {
    /// Whether an output is on.
    pub(super) fn is_on(&self, switch: OutputSwitch) -> bool {
        match switch {
            OutputSwitch::Program(number) => self.outputs.digital >> number & 1 != 0,
            OutputSwitch::Spindle => self.spindle.turning != Turning::Off,
            OutputSwitch::SpindleReverse => self.spindle.turning == Turning::Counterclockwise,
            OutputSwitch::Mist => self.coolant.mist,
            OutputSwitch::Flood => self.coolant.flood,
            OutputSwitch::EnableChain => false,
        }
    }

    /// Switches an output; the spindle's only the program does.
    fn put(&mut self, switch: OutputSwitch, on: bool) {
        match switch {
            OutputSwitch::Program(number) => self.outputs.put(number, on),
            OutputSwitch::Mist => self.coolant.mist = on,
            OutputSwitch::Flood => self.coolant.flood = on,
            OutputSwitch::Spindle | OutputSwitch::SpindleReverse | OutputSwitch::EnableChain => {}
        }
    }

    /// What an analog output puts out.
    pub(super) fn value(&self, source: AnalogSource) -> f64 {
        match source {
            AnalogSource::Program(number) => self.outputs.analog[usize::from(number)],
            AnalogSource::SpindleSpeed if self.spindle.turning == Turning::Off => 0.0,
            AnalogSource::SpindleSpeed => self.spindle.speed,
        }
    }

    fn switch(&mut self, line: u32, switch: Switch) {
        if switch == Switch::Message {
            return;
        }
        self.line = line;
        match switch {
            Switch::Spindle(spindle) => self.spindle = spindle,
            Switch::Coolant(change) => self.coolant = change.of(self.coolant),
            Switch::Tool(tool) => self.tool = tool,
            Switch::Output(output) => self.outputs.switch(&output),
            Switch::Message => {}
        }
    }
}

/// What has been switched, and what is to be as soon as the path comes to its waypoint.
#[derive(Clone)]
pub(super) struct Switches {
    pub(super) functions: MachineFunctions,
    /// The tool before the one that was loaded last.
    tool_before: u32,
    /// The tool that an operator was asked to load and has not confirmed, and the one before.
    unconfirmed: Option<(u32, u32)>,
    /// Outputs have their safe values, whatever was switched.
    safe: bool,
    kept: Kept,
    /// How many were executed.
    executed: u32,
    waiting: VecDeque<(u32, Switch)>,
    /// By output of the machine: what it was switched to by hand.
    by_hand: Vec<Option<bool>>,
    /// By output of the machine, as told; `None` before the first.
    outputs: Vec<Option<bool>>,
    /// Likewise by analog output.
    analog_outputs: Vec<Option<f64>>,
}

impl Switches {
    pub(super) fn new(layout: &Layout) -> Self {
        // Written to once, so that the cycle is never the first to touch a page of it.
        let mut waiting = VecDeque::from(vec![(0, Switch::Tool(0)); SWITCHES]);
        waiting.clear();
        Self {
            functions: MachineFunctions::default(),
            tool_before: 0,
            unconfirmed: None,
            safe: true,
            kept: Kept::default(),
            executed: 0,
            waiting,
            by_hand: vec![None; layout.outputs.len()],
            outputs: vec![None; layout.outputs.len()],
            analog_outputs: vec![None; layout.analog_outputs.len()],
        }
    }

    /// Forgets what waits: another path begins.
    pub(super) fn restart(&mut self) {
        self.executed = 0;
        self.waiting.clear();
    }

    /// A job begins: from now on outputs are what M-codes make of them.
    pub(super) fn begin(&mut self, layout: &Layout, job: &Job, mut tell: impl FnMut(Switch)) {
        let coolant = self.functions.coolant;
        (self.functions, self.kept) = self.beginning(layout, job);
        self.by_hand.fill(None);
        self.safe = false;
        if self.functions.coolant != coolant {
            tell(Switch::Coolant(self.functions.coolant.into()));
        }
    }

    /// What a job begins with: outputs that were switched by hand before are as they were switched. In typed lines those that
    /// have their safe values keep them until they are switched, and so they do where a program begins in its middle: what
    /// is to be otherwise there it switches itself, once that was confirmed.
    fn beginning(&self, layout: &Layout, job: &Job) -> (MachineFunctions, Kept) {
        let (mut functions, mut kept) = (self.functions, self.kept);
        match job.kind {
            JobKind::Program if !job.is_entered => take(&mut kept).let_go(&mut functions),
            _ if self.safe => kept.keep_safe(layout, &mut functions),
            _ => {}
        }
        for (output, by_hand) in layout.outputs.iter().zip(&self.by_hand) {
            if let Some(on) = by_hand {
                functions.put(output.switch, *on);
                if let OutputSwitch::Program(number) = output.switch {
                    kept.digital &= !(1 << number);
                }
            }
        }
        (functions, kept)
    }

    /// Switches an output by hand.
    pub(super) fn by_hand(&mut self, output: usize, on: bool) {
        self.by_hand[output] = Some(on);
    }

    /// Switches off what a program leaves on, and a job that is stopped: spindle, coolant and outputs, also those that were switched
    /// by hand.
    pub(super) fn stop(&mut self, mut tell: impl FnMut(Switch)) {
        let MachineFunctions {
            spindle, coolant, ..
        } = self.functions;
        for (is_on, off) in [
            (
                spindle != spindle.stopped(),
                Switch::Spindle(spindle.stopped()),
            ),
            (
                coolant != Coolant::default(),
                Switch::Coolant(CoolantChange::OFF),
            ),
        ] {
            if is_on {
                self.functions.switch(self.functions.line, off);
                tell(off);
            }
        }
        self.functions.outputs = Outputs::default();
        self.kept = Kept::default();
        self.by_hand.fill(None);
        self.safe = true;
    }

    /// Takes what is switched at the next waypoint; false if there is no room for it.
    pub(super) fn push(&mut self, line: u32, switch: Switch) -> bool {
        let room = self.waiting.len() < SWITCHES;
        if room {
            self.waiting.push_back((line, switch));
        }
        room
    }

    /// Whether any at the first `waypoints` of the path are still to be executed.
    pub(super) fn lag(&self, waypoints: u32) -> bool {
        self.executed < waypoints && !self.waiting.is_empty()
    }

    /// Executes the next M-code of those at the first `waypoints` of the path: its line, and what it does.
    pub(super) fn next(&mut self, waypoints: u32) -> Option<(u32, Switch)> {
        let due = self.executed < waypoints;
        let (line, switch) = due.then(|| self.waiting.pop_front()).flatten()?;
        self.executed += 1;
        if let Switch::Tool(_) = switch {
            self.tool_before = self.functions.tool;
        }
        self.functions.switch(line, switch);
        if let Switch::Output(output) = switch {
            self.kept.switched(output);
        }
        Some((line, switch))
    }
}

/// Outputs of the program, by number, that are on because that is safe, and not because anybody switched them: in typed lines
/// they stay so until these switch them, and in a program that begins in its middle; in one that begins at its first line
/// they are off.
#[derive(Clone, Copy, Default)]
struct Kept {
    digital: u64,
    analog: u64,
}

impl Kept {
    /// The outputs that are on as that is safe stay so.
    fn keep_safe(&mut self, layout: &Layout, functions: &mut MachineFunctions) {
        for output in &layout.outputs {
            if let OutputSwitch::Program(number) = output.switch
                && output.safe
            {
                functions.put(output.switch, true);
                self.digital |= 1 << number;
            }
        }
        for output in &layout.analog_outputs {
            if let AnalogSource::Program(number) = output.source {
                functions.outputs.analog[usize::from(number)] = output.safe;
                self.analog |= 1 << number;
            }
        }
    }

    /// The outputs that nobody has switched are off.
    fn let_go(self, functions: &mut MachineFunctions) {
        functions.outputs.digital &= !self.digital;
        for (number, value) in functions.outputs.analog.iter_mut().enumerate() {
            if self.analog >> number & 1 != 0 {
                *value = 0.0;
            }
        }
    }

    /// What was switched is not kept any more.
    fn switched(&mut self, output: Output) {
        match output {
            Output::Digital { number, .. } => self.digital &= !(1 << number),
            Output::Analog { number, .. } => self.analog &= !(1 << number),
            Output::User { .. } => {}
        }
    }
}

impl<const N: usize> Controller<N> {
    /// Executes the M-codes whose place the path has come to.
    pub(super) fn switch(&mut self) {
        if self.phase != Phase::Program {
            return;
        }
        let waypoints = self.shaping.waypoints();
        // As X is where the next setpoint has it.
        let spindle = &mut self.switches.functions.spindle;
        *spindle = spindle.at(self.planned.position[AxisLetter::X.index()]);
        for _ in 0..MOST_SWITCHED {
            let Some((line, switch)) = self.switches.next(waypoints) else {
                break;
            };
            self.tell(Event::Switched { line, switch });
            if let Switch::Spindle(_) = switch {
                self.executor.set_turns(None);
            }
        }
    }

    /// What the job at work has switched; of one that has not said anything yet, what it begins with.
    #[must_use]
    pub fn functions(&self) -> MachineFunctions {
        match self.job.filter(|_| self.awaits_instructions()) {
            Some(job) => self.switches.beginning(&self.layout, &job).0,
            None => self.switches.functions,
        }
    }

    /// The path rests for an operator to change the tool.
    pub(super) fn ask_for_tool(&mut self, asked: u32) {
        self.switches.unconfirmed = Some((asked, self.switches.tool_before));
    }

    /// The tool that was asked for is the one in the spindle.
    pub(super) fn confirm_tool(&mut self) {
        self.switches.unconfirmed = None;
    }

    /// A tool change that an operator has not confirmed as the job ends was none.
    pub(super) fn give_tool_change_up(&mut self) {
        if let Some((asked, tool)) = self.switches.unconfirmed.take() {
            let (line, switch) = (self.switches.functions.line, Switch::Tool(tool));
            self.switches.functions.switch(line, switch);
            self.tell(Event::Switched { line, switch });
            self.tell(Event::ToolNotChanged { asked, tool });
        }
    }

    /// Switches off what is left on, as at the end of a job.
    pub(super) fn switch_off_outputs(&mut self) {
        let Self {
            switches, events, ..
        } = self;
        let mut tell = event_sink(events);
        let line = switches.functions.line;
        switches.stop(|switch| tell(Event::Switched { line, switch }));
    }

    /// Whether drives are enabled, or on their way there or back.
    fn needs_power(&self) -> bool {
        (Phase::ReadyToSwitchOn..=Phase::ShutDown).contains(&self.phase)
    }

    /// Whether outputs have their safe values that nobody switches by hand.
    fn has_safe_outputs(&self) -> bool {
        self.phase != Phase::Program || self.switches.safe
    }

    /// Whether an output of the machine, with this index, is on at its terminal.
    fn puts_on(&self, index: usize, output: &machine::Output) -> bool {
        match self.switches.by_hand[index] {
            _ if output.switch == OutputSwitch::EnableChain => self.needs_power(),
            Some(on) => on,
            None if self.has_safe_outputs() => output.safe,
            None => self.switches.functions.is_on(output.switch),
        }
    }

    /// What is put out: what the job at work has switched, but wired outputs as they are at their terminals: as they were sent last,
    /// where they may be safe or switched by hand.
    pub(super) fn put_out(&self) -> MachineFunctions {
        let mut functions = self.switches.functions;
        for (output, sent) in self.layout.outputs.iter().zip(&self.switches.outputs) {
            functions.put(output.switch, sent.unwrap_or(output.safe));
        }
        let analog = self.layout.analog_outputs.iter();
        for (output, sent) in analog.zip(&self.switches.analog_outputs) {
            if let AnalogSource::Program(number) = output.source {
                functions.outputs.analog[usize::from(number)] = sent.unwrap_or(output.safe);
            }
        }
        functions
    }

    /// Sets the outputs of devices for the next SYNC.
    pub(super) fn set_outputs(&mut self) {
        let layout = Arc::clone(&self.layout);
        let is_safe = self.has_safe_outputs();
        let switched = self.switches.functions;
        // Typed lines may have left something on, which the next enabling is not to switch on again.
        if self.stays_on && self.phase != Phase::Program && !self.switches.safe {
            self.switch_off_outputs();
        }
        // A homing that no program asks for leaves them as they are.
        let state = self.state();
        let is_homed = state == State::Homing && self.beside_path.line().is_none();
        let keeps = state.allows(Request::Switch) || is_homed;
        if !keeps && !self.awaits_instructions() {
            self.switches.by_hand.fill(None);
        }
        for (index, output) in layout.outputs.iter().enumerate() {
            let on = self.puts_on(index, output);
            let node = &mut self.nodes[output.node];
            node.set_output(output.signal, on != output.active_low);
            // What nobody is known to have been told is not said.
            if node.is_known() && self.switches.outputs[index].replace(on) != Some(on) {
                self.tell(Event::Output { output: index, on });
            }
        }
        let speed = match self.orient(is_safe) {
            Some(speed) => speed,
            None if is_safe => 0.0,
            None => self.spindle_speed(),
        };
        self.turn_spindle(speed);
        for (index, output) in layout.analog_outputs.iter().enumerate() {
            let value = match is_safe {
                true => output.safe,
                false => switched.value(output.source),
            };
            let node = &mut self.nodes[output.node];
            node.set_analog_output(output.place, output.scaled(value));
            if node.is_known() && self.switches.analog_outputs[index].replace(value) != Some(value)
            {
                let output = index;
                self.tell(Event::AnalogOutput { output, value });
            }
        }
    }
}

impl fmt::Debug for Switches {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Switches")
            .field("functions", &self.functions)
            .field("executed", &self.executed)
            .field("waiting", &self.waiting.len())
            .finish()
    }
}
