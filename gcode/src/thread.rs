//! Threads: G33, a line in step with the spindle; G33.1, the same there and back.

use std::collections::VecDeque;

use super::axes::AxisLetter;
use super::command::{Action, Turning};
use super::error::{Fault, Refusal};
use super::execute::State;
use super::lexer::Columns;
use super::modal::{Code, Motion};
use super::words::{Words, out_of_range};

/// What a lead can be, mm.
const LEADS: std::ops::RangeInclusive<f64> = 1e-3..=1e3;

impl State {
    /// Refuses what moves in step with the spindle where none turns whose angle is measured.
    pub(super) fn may_follow_spindle(&self, code: Code, columns: Columns) -> Result<(), Refusal> {
        let refuse = |fault| Err(Refusal::new(columns, fault));
        if !self.setup.has_spindle_angle {
            return refuse(Fault::NoSpindleAngle { code });
        }
        if self.cutter().is_some() {
            return refuse(Fault::ThreadCompensated { code });
        }
        let spindle = self.modes.spindle;
        if spindle.surface.is_some() {
            return refuse(Fault::ThreadSurface { code });
        }
        if spindle.turning == Turning::Off || spindle.speed == 0.0 {
            return refuse(Fault::ThreadSpindle { code });
        }
        Ok(())
    }

    /// A distance in a turn of the spindle as it is written, mm.
    pub(super) fn lead(&self, written: f64, letter: u8, words: &Words) -> Result<f64, Refusal> {
        let lead = written * self.modes.unit();
        if LEADS.contains(&lead) {
            return Ok(lead);
        }
        let allowed = "a distance in a turn from 0.001 to 1000 mm";
        let fault = out_of_range(char::from(letter), written, allowed);
        Err(words.refuse(letter, fault))
    }

    /// A line to where the axis words lead, by K in each turn of the spindle; tapped, there and back.
    pub(super) fn thread(
        &mut self,
        motion: Motion,
        words: &mut Words,
        columns: Columns,
        commands: &mut VecDeque<Action>,
    ) -> Result<(), Refusal> {
        let code = motion.code();
        let refuse = |fault| Err(Refusal::new(columns, fault));
        self.may_follow_spindle(code, columns)?;
        let Some(written) = words.take(b'K', code)? else {
            let words = "K, the distance in a turn of the spindle";
            return refuse(Fault::MissingWord { code, words });
        };
        let lead = self.lead(written, b'K', words)?;
        let to = self.target(words, code, false)?;
        let along = [AxisLetter::X, AxisLetter::Y, AxisLetter::Z];
        let mut others = AxisLetter::ALL
            .into_iter()
            .filter(|axis| !along.contains(axis));
        if let Some(axis) = others.find(|axis| to[*axis] != self.at[*axis]) {
            return Err(words.refuse(axis.letter() as u8, Fault::ThreadAxis { code, axis }));
        }
        if to == self.at {
            return refuse(Fault::ThreadNowhere { code });
        }
        let action = match motion {
            Motion::Tap => Action::Tap { to, lead },
            _ => Action::Thread { to, lead },
        };
        self.go(action, words, columns, commands)
    }
}
