//! What comes before the commands of a program that is begun in its middle.

use super::Feeder;
use crate::control::event::describe_leg;
use crate::control::{Pause, StopPoint};
use crate::machine::Position;
use crate::program::{Program, ProgramError};
use std::collections::VecDeque;
use std::mem::take;
use syncline_gcode::{self as gcode, Action, Interpreter};

/// What comes before the commands of a program that is begun in its middle.
pub(super) enum Opening {
    /// The operator is told what comes next, and goes on.
    Confirm(Pause, String),
    /// What sets the machine up, or leads it there.
    Act(Box<Action>),
    /// The spindle has its speed before the axes move.
    AtSpeed,
}

/// Whether the spindle turns where a program is begun in its middle.
pub(super) fn turns(entry: &gcode::Entry) -> bool {
    entry.spindle.turning != gcode::Turning::Off
}

impl Program {
    /// What comes before the commands of an interpreter that stands where the program is entered: what it finds, and
    /// what brings a machine at `here` there.
    pub(super) fn opening(
        &self,
        here: Position,
        interpreter: &Interpreter,
        entry: Option<&gcode::Entry>,
    ) -> VecDeque<Opening> {
        let mut opening = VecDeque::new();
        let Some(entry) = entry else {
            return opening;
        };
        let found = self.found(interpreter, entry).filter(|_| self.waits);
        if let Some(found) = &found {
            opening.push_back(Opening::Confirm(Pause::Beginning, found.to_string()));
        }
        let act = |action| Opening::Act(Box::new(action));
        opening.extend(entry.set_up.iter().cloned().map(act));
        match self.retraction.filter(|_| found.is_some()) {
            Some(retraction) => {
                if turns(entry) {
                    opening.push_back(Opening::AtSpeed);
                }
                let mut at = here;
                while let Some(leg) = retraction.leg(&at, &entry.at.0) {
                    for (at, to) in at.iter_mut().zip(leg.to) {
                        *at = to.unwrap_or(*at);
                    }
                    let to = gcode::Point(at);
                    let feed = gcode::Feed::Rate(leg.speed);
                    let act = match leg.speed.is_finite() {
                        true => Action::Feed { to, feed },
                        false => Action::Rapid { to },
                    };
                    opening.push_back(Opening::Confirm(Pause::NextLeg, describe_leg(&leg)));
                    opening.push_back(Opening::Act(Box::new(act)));
                }
            }
            None => opening.extend(entry.approach.iter().cloned().map(act)),
        }
        let with_motion = entry.with_motion.iter().copied().map(Action::Output);
        opening.extend(with_motion.map(act));
        opening
    }
}

impl Feeder {
    /// Does what comes before the program's own commands.
    pub(super) fn open(&mut self, opening: Opening) -> Result<(), ProgramError> {
        let line = self.entered;
        let span = gcode::Span {
            line,
            ..gcode::Span::default()
        };
        match opening {
            Opening::Confirm(reason, text) => {
                self.tell(line, text);
                self.stop_then(StopPoint::Pause { reason, line });
                Ok(())
            }
            Opening::Act(action) => {
                let action = *action;
                self.take(&gcode::Command { span, action })
            }
            Opening::AtSpeed if take(&mut self.spins_up) => self.await_spindle(span),
            Opening::AtSpeed => Ok(()),
        }
    }
}
