//! Inputs of the machine that mean something: an external enable, feed hold, cycle start, a door, and
//! those that a program waits for.
//!
//! An input acts when its level changes. One that is on when it is first seen starts nothing; but what an open door, or
//! the input for feed hold, forbids it forbids by its level: nothing begins to move. So does an enable that is off.

use super::fault::Fault;
use super::functions::MachineFunctions;
use super::{Controller, Event, Goal, Hold, HomingFailure, Phase, Request, State, Waiting};
use crate::machine::{AnalogSource, Input, InputMeaning, MOST_INPUTS, OutputSwitch};
use std::sync::Arc;
use std::time::Duration;
use syncline_gcode::{ANALOG_INPUTS, TakenInput, Until};

/// An input by its place in the machine file.
pub type InputIndex = usize;

/// The levels of the machine's inputs.
#[derive(Clone, Debug)]
pub(super) struct Inputs(Vec<Debounced>);

/// A level that has to stay before it counts.
#[derive(Clone, Copy, Debug, Default)]
struct Debounced {
    /// `None` before it was first seen.
    level: Option<bool>,
    /// For so many cycles it has been another one.
    other: u32,
    /// So many cycles count.
    most: u32,
}

/// What the level of a cycle tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Change {
    /// It is on, and was never seen before.
    Seen,
    /// It came on.
    On,
    /// It went off.
    Off,
}

impl Debounced {
    /// Takes the level of a cycle; the new one if it counts and was not known before.
    fn take(&mut self, level: bool) -> Option<Change> {
        let Some(before) = self.level else {
            self.level = Some(level);
            return level.then_some(Change::Seen);
        };
        self.other = if level == before { 0 } else { self.other + 1 };
        if self.other <= self.most {
            return None;
        }
        self.other = 0;
        self.level = Some(level);
        Some(if level { Change::On } else { Change::Off })
    }
}

impl Inputs {
    pub(super) fn new(inputs: &[Input], cycle: Duration) -> Self {
        let debounced = inputs.iter().map(|input| Debounced {
            most: input.debounce.as_nanos().div_ceil(cycle.as_nanos()) as u32,
            ..Debounced::default()
        });
        Self(debounced.collect())
    }

    /// Whether it is on; an input that was not seen yet is off.
    pub(super) fn is_on(&self, input: InputIndex) -> bool {
        self.0[input].level == Some(true)
    }
}

/// An input or output of the machine, as a program reads it by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Signal {
    /// A digital input.
    Input(InputIndex),
    /// A digital output, by what switches it.
    Output(OutputSwitch),
    /// An analog input.
    AnalogInput(usize),
    /// An analog output, by what it puts out.
    AnalogOutput(AnalogSource),
}

/// What the inputs and outputs are where the program reads them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SignalLevels {
    /// Counts the readings of a job, from 1.
    pub number: u32,
    /// A bit for each input.
    inputs: [u64; MOST_INPUTS.div_ceil(64)],
    analog_inputs: [f64; ANALOG_INPUTS],
    outputs: MachineFunctions,
    /// What the last M66 found: `#5399`.
    pub input_result: f64,
}

impl SignalLevels {
    /// What one of them is: 1 for on, 0 for off, or the value of an analog one.
    #[must_use]
    pub fn of(&self, signal: Signal) -> f64 {
        let on = match signal {
            Signal::Input(index) => self.inputs[index / 64] >> (index % 64) & 1 != 0,
            // Programs run while drives are enabled.
            Signal::Output(OutputSwitch::EnableChain) => true,
            Signal::Output(switch) => self.outputs.is_on(switch),
            Signal::AnalogInput(index) => return self.analog_inputs[index],
            Signal::AnalogOutput(source) => return self.outputs.value(source),
        };
        f64::from(u8::from(on))
    }
}

/// An input that the path rests for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InputWait {
    /// Which one.
    pub input: InputMeaning,
    /// What it has to do.
    pub until: Until,
    /// Within this time.
    pub within: Duration,
}

/// What was at speed before a change may say so for so long after it.
pub(super) const AT_SPEED_BEFORE: Duration = Duration::from_millis(100);

/// How long the path has rested for an input, or for the spindle's angle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Awaited {
    /// The cycle in which it began.
    since: u64,
    /// The level then, and in every cycle since.
    was: bool,
}

impl<const N: usize> Controller<N> {
    /// Whether an input is on, as its node has told last, before it is debounced; `None` while that has not told.
    pub(super) fn level(&self, input: &Input) -> Option<bool> {
        let level = self.nodes[input.node].signal(input.signal)?;
        Some(level != input.active_low)
    }

    /// Looks at the inputs and acts on what has changed.
    ///
    /// # Errors
    /// The machine may not be enabled.
    pub(super) fn watch_inputs(&mut self) -> Result<(), Fault> {
        let layout = Arc::clone(&self.layout);
        for (index, input) in layout.inputs.iter().enumerate() {
            if let Some(change) = self
                .level(input)
                .and_then(|level| self.inputs.0[index].take(level))
            {
                let on = change != Change::Off;
                self.tell(Event::Input { input: index, on });
                if change == Change::On {
                    self.input_came_on(index, input.meaning);
                }
            }
        }
        let off = |&index: &InputIndex| {
            layout.inputs[index].meaning == InputMeaning::Enable && !self.inputs.is_on(index)
        };
        let phase = self.phase;
        let goes_up = self.goal == Goal::Ready && (Phase::Disabled..=Phase::Stop).contains(&phase);
        let is_on = (Phase::OperationEnabled..=Phase::Stop).contains(&phase);
        let enables = self.sync_on && (goes_up || is_on);
        match (0..layout.inputs.len()).find(off) {
            Some(input) if enables => Err(Fault::NotEnabled { input }),
            _ => Ok(()),
        }
    }

    fn input_came_on(&mut self, input: InputIndex, meaning: InputMeaning) {
        let state = self.state();
        match meaning {
            // It would go on to its end.
            InputMeaning::Door if self.threading.has_begun() => self.interrupt(),
            InputMeaning::FeedHold if state == State::Homing => {
                self.interrupt_homing(HomingFailure::FeedHold);
            }
            InputMeaning::Door if state == State::Homing => {
                self.interrupt_homing(HomingFailure::DoorOpen);
            }
            InputMeaning::FeedHold | InputMeaning::Door if state.allows(Request::FeedHold) => {
                self.hold_path(Hold::Input(input));
            }
            InputMeaning::FeedHold | InputMeaning::Door if self.phase == Phase::Square => {
                self.stop_squaring();
                // What is to begin then waits for an operator.
                if self.job.is_some() {
                    self.hold_path(Hold::Input(input));
                }
            }
            InputMeaning::Probe | InputMeaning::ToolSetter => self.touched(),
            // To read it anew takes an operator, who is told what it begins with.
            InputMeaning::CycleStart if self.rests_aside() => self.tell(Event::SetAside),
            InputMeaning::CycleStart if state.allows(Request::GoOn) => {
                if let Some(input) = self.holding_input() {
                    if state == State::Held {
                        self.tell(Event::Held(Hold::Input(input)));
                    }
                    return;
                }
                if let Some(overrides) = self.rests_for_speed() {
                    return self.tell(Event::Waits(Waiting::Override(overrides)));
                }
                // A panel has no other button: an edge ends a pause, or else a hold.
                match self.awaits_cycle_start() {
                    true => self.go_on(),
                    false if self.is_path_held() && !self.executor.wants_speed() => {
                        self.resume_path();
                    }
                    false => {}
                }
            }
            _ => {}
        }
    }

    /// An input that is on and with which nothing may begin to move: a door that is open, or a feed hold.
    pub(super) fn holding_input(&self) -> Option<InputIndex> {
        let mut inputs = self.layout.inputs.iter().enumerate();
        let on = inputs.find(|(index, input)| input.meaning.holds() && self.inputs.is_on(*index));
        on.map(|(index, _)| index)
    }

    /// Whether an input of the machine is a door.
    pub(super) fn is_door(&self, input: InputIndex) -> bool {
        self.layout.inputs[input].meaning == InputMeaning::Door
    }

    /// What the inputs and outputs are, for the program's reading with this number; the path goes on. In a hold an operator
    /// may change them, so that it waits.
    pub(super) fn read_signals(&mut self, number: u32) {
        if self.executor.is_held() {
            return;
        }
        let mut levels = SignalLevels {
            number,
            inputs: [0; MOST_INPUTS.div_ceil(64)],
            analog_inputs: self.analog_inputs(),
            input_result: self.input_result,
            outputs: self.switches.functions,
        };
        for index in (0..self.layout.inputs.len()).filter(|&index| self.inputs.is_on(index)) {
            levels.inputs[index / 64] |= 1 << (index % 64);
        }
        self.signals_read = Some(levels);
        self.executor.pass();
    }

    /// What the analog inputs are, in the order of the machine file.
    pub(super) fn analog_inputs(&self) -> [f64; ANALOG_INPUTS] {
        let mut values = [0.0; ANALOG_INPUTS];
        for (value, input) in values.iter_mut().zip(&self.layout.analog_inputs) {
            *value = input.scaled(self.nodes[input.node].analog_input(input.place));
        }
        values
    }

    /// Keeps what an input is that the program names by its number; the path goes on, but in a hold.
    pub(super) fn take_input(&mut self, input: TakenInput) {
        if self.executor.is_held() {
            return;
        }
        self.input_result = match input {
            TakenInput::Digital(number) => {
                f64::from(u8::from(self.is_any_on(InputMeaning::Program(number))))
            }
            TakenInput::Analog(number) => {
                let mut inputs = self.layout.analog_inputs.iter();
                let place = inputs.position(|input| input.number == number);
                place.map_or(0.0, |place| self.analog_inputs()[place])
            }
        };
        self.executor.pass();
    }

    /// What the last reading of the job found.
    #[must_use]
    pub fn signals_read(&self) -> Option<&SignalLevels> {
        self.signals_read.as_ref()
    }

    /// Whether an input of this meaning is on.
    fn is_any_on(&self, meaning: InputMeaning) -> bool {
        let mut inputs = self.layout.inputs.iter().enumerate();
        inputs.any(|(index, input)| input.meaning == meaning && self.inputs.is_on(index))
    }

    /// Whether an input tells that the spindle has its speed.
    pub(super) fn tells_at_speed(&self) -> bool {
        self.is_any_on(InputMeaning::AtSpeed)
    }

    /// For how long the path has rested for what it awaits, and whether that was there in the cycle before.
    pub(super) fn rested_for(&mut self, is_there: bool) -> (Duration, bool) {
        let begun = Awaited {
            since: self.cycle,
            was: is_there,
        };
        let Awaited { since, was } = self.awaited.unwrap_or(begun);
        self.awaited = Some(Awaited {
            since,
            was: is_there,
        });
        (self.layout.cycle * (self.cycle - since) as u32, was)
    }

    /// The cycle since which the path has rested for what it awaits.
    pub(super) fn awaited_since(&self) -> Option<u64> {
        self.awaited.map(|awaited| awaited.since)
    }

    /// Whether the input that the path rests for is there; `None` while neither it nor the time has come.
    pub(super) fn awaited(&mut self, wait: InputWait) -> Option<bool> {
        let on = self.is_any_on(wait.input);
        let at_speed = wait.input == InputMeaning::AtSpeed;
        // What its drive measures is no older than what it was told.
        let is_measured = at_speed && self.layout.spindle.is_some();
        let on = on || is_measured && self.is_spindle_at_speed();
        let (waited, was) = self.rested_for(on);
        let came = match wait.until {
            Until::Rise => on && !was,
            Until::Fall => !on && was,
            Until::High => on,
            Until::Low => !on,
        };
        let lags = at_speed && !is_measured && waited < AT_SPEED_BEFORE;
        match came && !lags {
            true => Some(true),
            false => (waited >= wait.within).then_some(false),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Levels of cycles, one a character, and in which of them a change counts.
    fn changes(debounce: u32, levels: &str) -> Vec<(usize, Change)> {
        let mut input = Debounced {
            most: debounce,
            ..Debounced::default()
        };
        let levels = levels.bytes().map(|level| level == b'1').enumerate();
        levels
            .filter_map(|(cycle, level)| Some((cycle, input.take(level)?)))
            .collect()
    }

    #[test]
    fn what_is_on_at_first_is_no_change() {
        use Change::{Off, On, Seen};
        assert_eq!(changes(0, "111"), [(0, Seen)]);
        assert_eq!(changes(0, "000"), []);
        assert_eq!(changes(0, "1101"), [(0, Seen), (2, Off), (3, On)]);
    }

    #[test]
    fn a_level_counts_once_it_has_stayed() {
        use Change::{Off, On};
        assert_eq!(changes(2, "0110110111"), [(9, On)]);
        assert_eq!(changes(2, "0111100010000"), [(3, On), (7, Off)]);
    }
}
