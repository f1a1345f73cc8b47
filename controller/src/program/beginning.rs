//! A program that is begun in its middle: in which state, for a person to confirm before anything moves.

use super::{Entered, Program, ProgramError};
use crate::machine::Position;
use std::fmt;
use syncline_gcode::{self as gcode, Action, AxisSet, Interpreter};

/// What is told besides where a program begins with a tap: one that was stopped in it may have left the tap in the work.
const TAPS: &str = "; it taps from there: see that no tap is in the work, and turn one out by hand before anything moves";

impl Entered {
    /// The line at which the program is begun, and whether that is behind it.
    pub(super) fn line(&self) -> (u32, bool) {
        match *self {
            Self::AtLine(line) => (line, false),
            Self::At { place, line, .. } => match place.known {
                Some((number, line)) => (line, number < place.passed),
                None => (line, false),
            },
        }
    }
}

/// The state in which a line in the middle of a program begins, told behind the line's number: `begins with G1 …`.
#[derive(Clone, Debug)]
pub struct Beginning {
    line: u32,
    /// The program goes on behind that line.
    behind: bool,
    modes: gcode::Modes,
    axes: AxisSet,
    position: gcode::Point,
    /// What is switched on the way there, in its order.
    switched: Vec<String>,
    /// It taps from there, as it did when it was stopped.
    taps: bool,
}

/// What a command switches that leads to the line to begin at.
fn switched(action: &Action) -> Option<String> {
    Some(match action {
        Action::Stop(gcode::Stop::ToolChange { .. }) => "the tool".to_owned(),
        Action::Spindle(_) => "the spindle".to_owned(),
        Action::Coolant(change) => {
            let said =
                [("mist", change.mist), ("flood", change.flood)].map(|(name, on)| match on? {
                    true => Some(format!("{name} on")),
                    false => Some(format!("{name} off")),
                });
            said.into_iter().flatten().collect::<Vec<_>>().join(", ")
        }
        Action::Output(output) => output.to_string(),
        _ => return None,
    })
}

impl fmt::Display for Beginning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let begins = match self.behind {
            true => "behind it the program goes on",
            false => "begins",
        };
        write!(f, "{begins} with {}, at", self.modes)?;
        for axis in self.axes.iter() {
            write!(f, " {axis}{:.3}", rounded(self.position[axis]))?;
        }
        f.write_str(" in machine coordinates")?;
        match &self.switched[..] {
            [] => f.write_str("; nothing is switched on the way there")?,
            switched => write!(f, "; switched on the way there: {}", switched.join(", "))?,
        }
        match self.taps {
            true => f.write_str(TAPS),
            false => Ok(()),
        }
    }
}

impl Beginning {
    /// The line at which the program begins, or behind which it goes on.
    #[must_use]
    pub fn line(&self) -> u32 {
        self.line
    }
}

impl Program {
    /// What the line to begin at finds, for a person to confirm; `None` for the whole program.
    ///
    /// # Errors
    /// The first block that cannot be run, or no such line.
    pub fn beginning(&self, start: Position) -> Result<Option<Beginning>, ProgramError> {
        if self.entered.is_none() {
            return Ok(None);
        }
        let (interpreter, entry) = self.interpret(start)?;
        Ok(entry.and_then(|entry| self.found(&interpreter, &entry)))
    }

    /// What the place finds that the program is entered at, of an interpreter that stands there.
    pub(super) fn found(
        &self,
        interpreter: &Interpreter,
        entry: &gcode::Entry,
    ) -> Option<Beginning> {
        let (line, behind) = self.entered?.line();
        let switched = entry.set_up.iter().filter_map(switched);
        let with_motion = entry.with_motion.iter().map(ToString::to_string);
        Some(Beginning {
            line,
            behind,
            modes: interpreter.modes().clone(),
            axes: self.setup.axes,
            position: entry.at,
            switched: switched.chain(with_motion).collect(),
            taps: entry.taps,
        })
    }
}

/// A position as it is shown, to 0.001: one that is rounded to none has no sign.
pub(crate) fn rounded(position: f64) -> f64 {
    (position * 1e3).round() / 1e3 + 0.0
}
