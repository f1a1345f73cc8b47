//! How a program is to be read: the switches of an operator's panel.

use crate::program::{Program, Programs};
use crate::session::{Command, NotTaken, Operator, SwitchChange};
use std::error::Error;
use std::io;
use std::path::Path;
use syncline_strict_toml::input;

/// Bytes that a program on standard input may have: it is kept in memory.
const LONGEST: u64 = 1 << 28;

/// How a program is to be read.
#[derive(Debug, clap::Args)]
pub(super) struct Switches {
    /// Begin with the optional stop on: the program waits at M1.
    #[arg(long, requires = "program")]
    optional_stop: bool,
    /// Execute blocks that begin with `/` instead of skipping them.
    #[arg(long, requires = "program")]
    no_block_delete: bool,
    /// Begin at this line, with the modes and the position that the lines before it lead to. They
    /// are shown; `run` begins when they are confirmed with Enter.
    #[arg(long, value_name = "LINE", requires = "program", value_parser = clap::value_parser!(u32).range(1..))]
    from_line: Option<u32>,
    /// Read the program as it runs, without end if need be, instead of checking it as a whole
    /// first: a bad block is a stop on the path when the machine comes to it.
    #[arg(long, requires = "program")]
    stream: bool,
}

impl Switches {
    /// A program with these switches.
    pub(super) fn program(
        &self,
        programs: &Programs,
        file: &Path,
    ) -> Result<Program, Box<dyn Error>> {
        let program = if file == Path::new("-") {
            programs.text("standard input", &standard_input()?)
        } else {
            programs.file(file)
        };
        Ok(program
            .block_delete(!self.no_block_delete)
            .from_line(self.from_line)
            .stream(self.stream))
    }

    /// Commands what these set in the session.
    pub(super) fn set(&self, operator: &Operator) -> Result<(), NotTaken> {
        if self.optional_stop {
            operator.command(Command::OptionalStop(SwitchChange::To(true)))?;
        }
        Ok(())
    }
}

/// All of standard input.
fn standard_input() -> Result<Vec<u8>, Box<dyn Error>> {
    let text = input::whole(io::stdin().lock(), LONGEST);
    Ok(text.map_err(|error| format!("cannot read standard input: {error}"))?)
}
