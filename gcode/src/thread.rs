//! Threads: G33, a line in step with the spindle.

use std::collections::VecDeque;

use super::axes::Axis;
use super::command::{Action, Turning};
use super::error::{Fault, Refusal};
use super::execute::State;
use super::lexer::Columns;
use super::modal::Motion;
use super::words::{Words, out_of_range};

/// What a lead can be, mm.
const LEADS: std::ops::RangeInclusive<f64> = 1e-3..=1e3;

impl State {
    /// A line to where the axis words lead, by K in each turn of the spindle.
    pub(super) fn thread(
        &mut self,
        words: &mut Words,
        columns: Columns,
        commands: &mut VecDeque<Action>,
    ) -> Result<(), Refusal> {
        let code = Motion::Thread.code();
        let refuse = |fault| Err(Refusal::new(columns, fault));
        if !self.setup.has_spindle_angle {
            return refuse(Fault::NoSpindleAngle { code });
        }
        if self.cutter().is_some() {
            return refuse(Fault::ThreadCompensated { code });
        }
        let spindle = self.modes.spindle;
        if spindle.turning == Turning::Off || spindle.speed == 0.0 {
            return refuse(Fault::ThreadSpindle { code });
        }
        let lead = match words.take(b'K', code)? {
            Some(lead) => lead * self.modes.unit(),
            None => {
                let words = "K, the distance in a turn of the spindle";
                return refuse(Fault::MissingWord { code, words });
            }
        };
        if !LEADS.contains(&lead) {
            let allowed = "a distance in a turn from 0.001 to 1000 mm";
            let written = lead / self.modes.unit();
            return Err(words.refuse(b'K', out_of_range('K', written, allowed)));
        }
        let to = self.target(words, code, false)?;
        let along = [Axis::X, Axis::Y, Axis::Z];
        let mut others = Axis::ALL.into_iter().filter(|axis| !along.contains(axis));
        if let Some(axis) = others.find(|axis| to[*axis] != self.at[*axis]) {
            return Err(words.refuse(axis.letter() as u8, Fault::ThreadAxis { code, axis }));
        }
        if to == self.at {
            return refuse(Fault::ThreadNowhere { code });
        }
        self.go(Action::Thread { to, lead }, words, columns, commands)
    }
}
