//! A program that was interrupted, and where: what it takes to resume it there.
//!
//! The program is read once more from where it began, with the offsets and tools as they are then, up to the command
//! that was at work. So it goes on in the midst of a loop, a subroutine, a cycle or a compensated contour, in the state
//! that it has there. What was cut of the block at work is cut once more: where exactly an axis left its path is not known
//! after a fault, and with other offsets the path is another one.

use super::{Entered, Program, ProgramError, Programs};
use crate::machine::Position;
use syncline_gcode::{self as gcode, InEffect, Memory, Place};

/// See the module.
#[derive(Clone, Debug)]
pub struct Interrupted {
    program: Program,
    /// Where the machine stood when it began.
    start: Position,
    place: Place,
    line: u32,
}

impl Interrupted {
    /// A program that began at `start` and was interrupted at a place, in this line unless the place says which. It is another
    /// one's to abandon.
    #[must_use]
    pub fn new(program: &Program, start: Position, place: Place, line: u32) -> Self {
        let mut program = program.apart();
        program.entered = None;
        let line = place.known.map_or(line, |(_, line)| line);
        Self {
            program,
            start,
            place,
            line,
        }
    }

    /// The line of the block that was at work.
    #[must_use]
    pub fn line(&self) -> u32 {
        self.line
    }

    /// The rest of the program, of a machine in which this is in effect, with the tables that programs begin with now: it
    /// tells what it begins with, and waits for cycle start before it moves or switches anything.
    #[must_use]
    pub fn resume(&self, programs: &Programs, now: InEffect) -> Program {
        let mut program = self.entered(now);
        program.setup.tables = programs.setup.tables.clone();
        program.wait_at_the_line()
    }

    /// What lines that are typed in begin with where the program rests.
    pub(super) fn memory(&self) -> Result<Memory, ProgramError> {
        let program = self.entered(InEffect::default());
        let (interpreter, _) = program.interpret(gcode::Point::ZERO.0)?;
        Ok(interpreter.memory())
    }

    /// The program, entered where it was interrupted.
    fn entered(&self, now: InEffect) -> Program {
        let mut program = self.program.apart();
        program.entered = Some(Entered::At {
            start: self.start,
            place: self.place,
            line: self.line,
            now,
        });
        program
    }
}
