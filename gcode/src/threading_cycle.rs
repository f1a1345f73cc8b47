//! G76: a thread along Z in passes of G33, each deeper than the one before.
//!
//! The passes are those of LinuxCNC's cycle of that name. Its tapers (E, L) are not: a pass is one line in step with
//! the spindle, with a rest at each of its ends.

use std::collections::VecDeque;

use super::arc::Plane;
use super::axes::{AxisLetter, Point};
use super::command::{Action, PathMode};
use super::error::{Fault, Refusal};
use super::execute::State;
use super::lexer::Columns;
use super::modal::{Code, Motion};
use super::words::{Words, out_of_range};

/// How many passes one block may make: a slip in J or R, not a part.
const MAX_PASSES: usize = 1000;

/// A thread and how it is cut, lengths in mm.
struct Passes {
    lead: f64,
    /// Which way along X is into the work, 1 or -1.
    inwards: f64,
    /// From the line along which the tool comes back to the thread's crest.
    crest: f64,
    /// Of the first pass beyond that, and of the whole thread.
    first: f64,
    whole: f64,
    degression: f64,
    /// How far a pass goes along Z for each mm that it is deeper.
    slope: f64,
    spring: u32,
}

impl Passes {
    /// How deep each pass is beyond the crest.
    fn depths(&self) -> Option<Vec<f64>> {
        let pass = |number: usize| self.first * libm::pow(number as f64, self.degression.recip());
        let deeper = (1..=MAX_PASSES).map(pass);
        let mut depths: Vec<f64> = deeper.take_while(|depth| *depth < self.whole).collect();
        depths.resize(depths.len() + 1 + self.spring as usize, self.whole);
        (depths.len() <= MAX_PASSES).then_some(depths)
    }
}

impl State {
    /// A thread from where the axes are to Z.
    pub(super) fn threading_cycle(
        &mut self,
        words: &mut Words,
        columns: Columns,
        commands: &mut VecDeque<Action>,
    ) -> Result<(), Refusal> {
        let code = Motion::ThreadingCycle.code();
        let refuse = |fault| Err(Refusal::new(columns, fault));
        self.may_follow_spindle(code, columns)?;
        if self.modes.plane != Plane::Zx {
            return refuse(Fault::ThreadingPlane { code });
        }
        self.plane_of_axes(code, columns)?;
        let end = self.target(words, code, false)?;
        let mut others = AxisLetter::ALL
            .into_iter()
            .filter(|axis| *axis != AxisLetter::Z);
        if let Some(axis) = others.find(|axis| end[*axis] != self.at[*axis]) {
            return Err(words.refuse(axis.letter() as u8, Fault::ThreadingAxis { code, axis }));
        }
        if end == self.at {
            return refuse(Fault::ThreadNowhere { code });
        }
        let passes = self.passes(code, words, columns)?;
        let Some(depths) = passes.depths() else {
            let allowed = MAX_PASSES;
            return refuse(Fault::TooManyPasses { code, allowed });
        };
        // A blend would cut the corners between the passes.
        let blends = matches!(self.modes.path_mode, PathMode::Blend { .. });
        if blends {
            commands.push_back(Action::PathMode(PathMode::ExactPath));
        }
        let start = self.at;
        let along = (end[AxisLetter::Z] - start[AxisLetter::Z]).signum();
        for depth in depths {
            let mut to = start;
            to[AxisLetter::Z] += along * passes.slope * depth;
            self.rapid_to(to, words, columns, commands)?;
            to[AxisLetter::X] += passes.inwards * (passes.crest + depth);
            self.rapid_to(to, words, columns, commands)?;
            to[AxisLetter::Z] = end[AxisLetter::Z];
            let lead = passes.lead;
            self.go(Action::Thread { to, lead }, words, columns, commands)?;
            to[AxisLetter::X] = start[AxisLetter::X];
            self.rapid_to(to, words, columns, commands)?;
        }
        if blends {
            commands.push_back(Action::PathMode(self.modes.path_mode));
        }
        Ok(())
    }

    fn rapid_to(
        &mut self,
        to: Point,
        words: &Words,
        columns: Columns,
        commands: &mut VecDeque<Action>,
    ) -> Result<(), Refusal> {
        match to == self.at {
            true => Ok(()),
            false => self.go(Action::Rapid { to }, words, columns, commands),
        }
    }

    /// Takes the cycle's words.
    fn passes(&self, code: Code, words: &mut Words, columns: Columns) -> Result<Passes, Refusal> {
        let unit = self.modes.unit();
        let mut need = |letter: u8, needs: &'static str| {
            let missing = Fault::MissingWord { code, words: needs };
            let value = words.take(letter, code)?;
            value.ok_or_else(|| Refusal::new(columns, missing))
        };
        let pitch = need(b'P', "P, the distance in a turn of the spindle")?;
        let crest = need(
            b'I',
            "I, from where the tool is to the thread's crest along X, negative outside",
        )?;
        let first = need(b'J', "J, the depth of the first pass")?;
        let whole = need(b'K', "K, the depth of the thread")?;
        let lead = self.lead(pitch, b'P', words)?;
        for (letter, value) in [(b'J', first), (b'K', whole)] {
            if value <= 0.0 {
                let fault = out_of_range(char::from(letter), value, "a depth above 0");
                return Err(words.refuse(letter, fault));
            }
        }
        if crest == 0.0 {
            let fault = out_of_range('I', crest, "a distance, below 0 outside of the work");
            return Err(words.refuse(b'I', fault));
        }
        for letter in [b'E', b'L'] {
            if words.take(letter, code)?.is_some_and(|value| value != 0.0) {
                return Err(words.refuse(letter, Fault::ThreadingTaper { code }));
            }
        }
        let degression = words.take(b'R', code)?.unwrap_or(1.0);
        if degression < 1.0 {
            let fault = out_of_range('R', degression, "a number from 1");
            return Err(words.refuse(b'R', fault));
        }
        let angle = words.take(b'Q', code)?.unwrap_or(0.0);
        if !(0.0..=80.0).contains(&angle) {
            return Err(words.refuse(b'Q', out_of_range('Q', angle, "an angle from 0 to 80°")));
        }
        let allowed = "a whole number of passes from 0 to 1000";
        let spring = words.take_whole(b'H', code, 0..=MAX_PASSES as u32, allowed)?;
        Ok(Passes {
            lead,
            inwards: crest.signum(),
            crest: crest.abs() * unit,
            first: first * unit,
            whole: whole * unit,
            degression,
            slope: libm::tan(angle.to_radians()),
            spring: spring.unwrap_or_default(),
        })
    }
}
