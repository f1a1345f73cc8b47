//! Homing from a program: G28.2, which RS-274/NGC does not have.
//!
//! Where an axis that is homed ends is stated by the machine; the interpreter goes by that where nothing moves. Where
//! something does, it hands out nothing behind a homing until it is told where the machine rests
//! ([`Interpreter::homed`](super::Interpreter::homed)).

use std::collections::VecDeque;

use super::axes::{AxisSet, Point};
use super::command::Action;
use super::error::{Fault, Refusal};
use super::execute::{Compensated, State};
use super::modal::{Code, Group};
use super::words::Words;

/// What homing does with an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Homed {
    /// Where the axis is then, machine coordinates; `None`: where it was.
    pub at: Option<f64>,
    /// It is homed also where no axis is named.
    pub unnamed: bool,
}

impl State {
    /// Homes the axes that are named, whatever their numbers are; without any those that need no name.
    pub(super) fn home(
        &mut self,
        words: &mut Words,
        code: Code,
        commands: &mut VecDeque<Action>,
    ) -> Result<(), Refusal> {
        let columns = words.code_columns(Group::Offsets).unwrap_or_default();
        if self.compensated != Compensated::Off {
            return Err(Refusal::new(columns, Fault::HomeCompensated { code }));
        }
        let mut axes = AxisSet::default();
        for axis in self.setup.axes.iter() {
            let letter = axis.letter() as u8;
            if words.take(letter, code)?.is_none() {
                continue;
            }
            if self.setup.homed[axis.index()].is_none() {
                return Err(words.refuse(letter, Fault::HomeAbsolute { code, axis }));
            }
            axes.insert(axis);
        }
        if axes.is_empty() {
            let unnamed = |homed: &Option<Homed>| homed.is_some_and(|homed| homed.unnamed);
            let all = self.setup.axes.iter();
            axes = all
                .filter(|axis| unnamed(&self.setup.homed[axis.index()]))
                .collect();
            if axes.is_empty() {
                return Err(Refusal::new(columns, Fault::HomeNothing { code }));
            }
        }
        for axis in axes.iter() {
            if let Some(at) = self.setup.homed[axis.index()].and_then(|homed| homed.at) {
                self.at[axis] = at;
                self.lost.axes.remove(axis);
            }
        }
        self.end_series();
        let to = self.at;
        commands.push_back(Action::Home { axes, to });
        Ok(())
    }

    /// Takes over where the machine rests behind a homing.
    pub(super) fn homed(&mut self, at: Point) {
        self.found_at(at);
    }
}
