//! What the console's screen shows, and how events change it.

use super::super::told_event;
use super::signals::Signals;
use super::values;
use crate::control::{Event as MachineEvent, Layout, State, Switch};
use crate::machine::{Axis, Machine};
use crate::program::{counted_group, moved};
use crate::session::{Event, Status};
use std::array;
use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use syncline_strict_toml::input;

/// Messages that are kept.
const MESSAGES: usize = 200;
/// Of a longer program the text is not shown, bytes.
const LONGEST: u64 = 64 << 20;

/// See the module.
#[derive(Default)]
pub(super) struct Model {
    pub(super) axes: Vec<Axis>,
    pub(super) signals: Signals,
    pub(super) status: Status,
    /// What happened, the newest last.
    pub(super) messages: VecDeque<String>,
    /// What is typed behind `:`.
    pub(super) prompt: Option<String>,
    /// The keys are shown.
    pub(super) help: bool,
    /// Since the job began, s.
    pub(super) elapsed: f64,
    /// Of the tool, along its path, mm/s or °/s.
    pub(super) speed: f64,
    /// The terminal tells when a key is released: axes can be jogged for as long as one is held.
    pub(super) releases: bool,
    /// Also what happens in every run.
    pub(super) verbose: bool,
    /// The file that `text` is of.
    file: Option<PathBuf>,
    /// The program's lines.
    text: Vec<String>,
    /// When the job began.
    began: Option<f64>,
}

impl Model {
    /// Of a machine before anything is known of it.
    pub(super) fn new(machine: &Machine, verbose: bool) -> Self {
        Self {
            axes: machine.axes.clone(),
            signals: Signals::of(machine),
            verbose,
            ..Self::default()
        }
    }

    /// Takes how things are now.
    pub(super) fn take(&mut self, status: Status) {
        // Positions are told no more once the machine has come to rest without power.
        let is_off = matches!(status.state, State::Faulted | State::Disabled | State::Off);
        let before = if is_off { 0.0 } else { self.speed };
        self.speed = actual_speed(&self.status, &status).unwrap_or(before);
        let works = matches!(status.state, State::Running | State::Mdi | State::Held);
        // A file may have been changed since the last job.
        let begins = works && self.began.is_none();
        if status.program != self.file || begins {
            self.file = status.program.clone();
            let text = self.file.as_deref().and_then(read);
            self.take_text(&text.unwrap_or_default());
        }
        let time = status.time.unwrap_or_default();
        self.began = self.began.filter(|_| works).or(works.then_some(time));
        if let Some(began) = self.began {
            self.elapsed = time - began;
        }
        self.status = status;
    }

    /// Takes the program's text.
    pub(super) fn take_text(&mut self, text: &str) {
        self.text = text.lines().map(str::to_owned).collect();
    }

    /// The text of a line of the program.
    pub(super) fn text_of(&self, line: u32) -> Option<&str> {
        let place = line.checked_sub(1)?;
        self.text.get(place as usize).map(String::as_str)
    }

    /// Takes something that happened.
    pub(super) fn happened(&mut self, event: &Event, layout: &Layout) {
        match event {
            // They are in the status until a reset.
            Event::Machine(MachineEvent::Fault(_)) => {}
            // They have a place of their own, and so many of them would push out what matters.
            Event::Machine(MachineEvent::Switched {
                switch: Switch::Output(output),
                ..
            }) if !self.verbose && layout.has_output(*output) => {}
            Event::Machine(event) => {
                if let Some(text) = told_event(event, layout, self.verbose) {
                    self.tell(text);
                }
            }
            Event::Refused(refused) => self.tell(refused.reason.to_string()),
            Event::Message { line, text } => self.tell(format!("line {line}: {text}")),
            Event::Recorded(files) => self.tell(files.to_string()),
            Event::Problem(error) => self.tell(super::told(&**error)),
            Event::Accepted(_) | Event::State(_) => {}
        }
    }

    /// How far an axis goes, mm, from when the key is released that jogs it until it rests.
    pub(super) fn stopping_distance(&self, axis: &Axis) -> f64 {
        let referenced = self.status.referenced[axis.letter.index()];
        let part = self.status.settings.rapid_part();
        let speed = axis.fastest_jog(referenced) * part;
        axis.stopping_distance(speed)
    }

    /// What stopped the machine, the first cause on top, and what is not completed.
    pub(super) fn faults(&self) -> Vec<String> {
        let Some(stopped) = &self.status.stopped else {
            return Vec::new();
        };
        let rest = values::not_completed(&self.status).map(|(what, resumed)| match resumed {
            Some(there) => format!(
                "{what} is not completed; once it is reset, :resume takes the program up {there}"
            ),
            None => format!("{what} is not completed"),
        });
        stopped.faults.iter().cloned().chain(rest).collect()
    }

    /// Shows them among the messages.
    pub(super) fn tell_faults(&mut self) {
        let faults = self.faults();
        if faults.is_empty() {
            self.tell("no fault".to_owned());
        }
        faults.into_iter().for_each(|fault| self.tell(fault));
    }

    /// Shows a message.
    pub(super) fn tell(&mut self, text: String) {
        if self.messages.len() == MESSAGES {
            self.messages.pop_front();
        }
        self.messages.push_back(text);
    }
}

/// The text of a file, or the beginning of a long one.
fn read(file: &Path) -> Option<String> {
    let bytes = input::beginning(file, LONGEST).ok()?;
    Some(String::from_utf8_lossy(&bytes).into_owned())
}

/// How fast those axes moved between two looks whose speed F counts in what is planned; `None` where no time has passed.
fn actual_speed(before: &Status, now: &Status) -> Option<f64> {
    let passed = now.time? - before.time?;
    let distances = moved(&array::from_fn(|at| now.actual[at] - before.actual[at]));
    let distance = distances[counted_group(&moved(&now.velocity)).unwrap_or_default()];
    (passed > 0.0).then(|| distance / passed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use syncline_gcode::Output;

    /// Degrees are not added to millimetres: what turns is told alone where nothing else moves, and not beside a path.
    #[test]
    fn the_actual_speed_is_that_which_f_counts() {
        let looked = |velocity: [f64; 2], actual: [f64; 2]| {
            let mut status = Status {
                time: Some(0.0),
                ..Status::default()
            };
            let before = status.clone();
            status.time = Some(0.5);
            (status.velocity[0], status.velocity[3]) = (velocity[0], velocity[1]);
            (status.actual[0], status.actual[3]) = (actual[0], actual[1]);
            actual_speed(&before, &status)
        };
        assert_eq!(looked([10.0, 60.0], [5.0, 30.0]), Some(10.0));
        assert_eq!(looked([0.0, 60.0], [0.001, 30.0]), Some(60.0));
        assert_eq!(looked([0.0, 0.0], [0.001, 0.5]), Some(0.002));
    }

    /// A program that switches outputs all the time pushes nothing out: the screen has a row for them. What has no row is
    /// told.
    #[test]
    fn outputs_push_no_message_out() {
        let text = include_str!("../../../../examples/portal/machine.toml");
        let wired = "[[output]]\nname = \"valve\"\ndrive = \"Y\"\nsignal = \"DQ0\"\nnumber = 1\n\n[machine]\n";
        let text = text.replacen("[machine]\n", wired, 1);
        let machine = Machine::parse(Path::new("machine.toml"), &text).unwrap();
        let layout = Layout::new(&machine).unwrap();
        let mut model = Model::new(&machine, false);
        model.tell("what matters".to_owned());
        let output = &machine.outputs[0];
        let signal = machine.device(output.node).spec().model.inputs.len() + output.signal;
        let switched = |number, on| {
            let output = Output::Digital {
                number,
                on,
                with_motion: false,
            };
            let switch = Switch::Output(output);
            Event::Machine(MachineEvent::Switched { line: 3, switch })
        };
        for on in [true, false].into_iter().cycle().take(300) {
            let device = output.node;
            model.happened(&switched(1, on), &layout);
            model.happened(
                &Event::Machine(MachineEvent::Output { output: 0, on }),
                &layout,
            );
            model.happened(
                &Event::Machine(MachineEvent::Signal { device, signal, on }),
                &layout,
            );
        }
        assert_eq!(model.messages, ["what matters"]);
        model.happened(&switched(9, true), &layout);
        assert_eq!(model.messages, ["what matters", "line 3: M64 P9"]);
    }
}
