//! Probing: G38.2 to G38.5, and what the program is told of it in `#5061` to `#5070`.
//!
//! Where the machine comes to rest is not known before it has been there, so that the interpreter hands out
//! nothing behind a probing until it is told ([`Interpreter::probed`](super::Interpreter::probed)).

use std::collections::VecDeque;

use super::axes::{AxisLetter, Point};
use super::command::{Action, Probe};
use super::error::{Fault, Refusal};
use super::execute::State;
use super::lexer::Columns;
use super::modal::{FeedMode, Motion};
use super::words::Words;

/// The least distance of a probing, mm (RS-274/NGC: 0.254 mm or 0.01 inch).
const LEAST_DISTANCE: f64 = 0.254;
/// The parameter of X; those of the other axes follow, and behind them whether there was a contact.
const FIRST_RESULT: usize = 5061;

/// What came of a probing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probed {
    /// Where the contact came or went, machine coordinates; `None`: it did not.
    pub contact: Option<Point>,
    /// Where the machine rests now, machine coordinates.
    pub at: Point,
}

impl State {
    /// A probing to where the axis words lead.
    pub(super) fn probe(
        &mut self,
        probe: Probe,
        words: &mut Words,
        columns: Columns,
        commands: &mut VecDeque<Action>,
    ) -> Result<(), Refusal> {
        let code = Motion::Probe(probe).code();
        let refuse = |fault| Refusal::new(columns, fault);
        if !self.setup.has_probe {
            return Err(refuse(Fault::NoProbe { code }));
        }
        if self.cutter().is_some() {
            return Err(refuse(Fault::ProbeCompensated { code }));
        }
        if self.modes.feed_mode != FeedMode::PerMinute {
            let mode = self.modes.feed_mode.code();
            return Err(refuse(Fault::ProbeFeedMode { code, mode }));
        }
        let to = self.target(words, code, false)?;
        let mut turned = AxisLetter::ALL.into_iter().filter(|axis| !axis.is_linear());
        if let Some(axis) = turned.find(|axis| to[*axis] != self.at[*axis]) {
            return Err(words.refuse(axis.letter() as u8, Fault::ProbeTurns { code, axis }));
        }
        let squares =
            to.0.iter()
                .zip(self.at.0)
                .map(|(to, at)| (to - at) * (to - at));
        if squares.sum::<f64>().sqrt() < LEAST_DISTANCE {
            return Err(refuse(Fault::ProbeTooShort { code }));
        }
        let feed = self.feed(words, code, to).map_err(refuse)?;
        self.go(Action::Probe { to, feed, probe }, words, columns, commands)
    }

    /// Takes over what came of a probing. Without a contact the parameters have where it ended.
    pub(super) fn probed(&mut self, probed: Probed) {
        self.found_at(probed.at);
        let place = probed.contact.unwrap_or(probed.at);
        let place = self.coordinates().to_program(place);
        let places = AxisLetter::ALL.map(|axis| place[axis] / self.unit(axis));
        let success = f64::from(u8::from(probed.contact.is_some()));
        let results = places.into_iter().chain([success]);
        for (index, value) in (FIRST_RESULT..).zip(results) {
            self.parameters.show(index, value);
        }
    }
}
