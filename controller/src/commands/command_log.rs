//! The log of a session's commands: written beside a run, read by `replay`.
//!
//! It is lines of JSON. The first ones hold the tables with which the session began, a line of their file
//! each, as what it does may change them, and what was known of the machine's state; then comes a line for
//! each command that took effect.

use super::output::{Claims, NoOutput, Target};
use crate::machine::MachineState;
use crate::observe::trace::Sink;
use crate::run::Timeline;
use crate::session::{Accepted, Event, Recorded, Session, Subscription};
use serde::{Deserialize, Serialize};
use std::io::{self, BufRead, Write};
use std::path::{Path, PathBuf};
use syncline_gcode::{Tables, TablesError};
use syncline_strict_toml::input;

/// Where the commands of operators are written.
#[derive(Debug, clap::Args)]
pub(super) struct CommandFile {
    /// Write every command of an operator that took effect, and in which cycle, as a line of JSON: with it
    /// `replay` does what operators did.
    #[arg(long, value_name = "FILE")]
    commands: Option<PathBuf>,
}

impl CommandFile {
    /// Opens the file.
    pub(super) fn open(&self, claims: &mut Claims) -> Result<Option<Target>, NoOutput> {
        claims.open("--commands", &self.commands)
    }
}

/// A line of the tables' file, as it was when the session began.
#[derive(Serialize, Deserialize)]
struct TablesLine {
    tables: String,
}

/// What was known of the machine when the session began.
#[derive(Serialize, Deserialize)]
struct StateLine {
    state: MachineState,
}

/// The log of a session that goes on.
pub(super) struct CommandLog {
    events: Subscription,
    file: Sink,
}

impl CommandLog {
    /// The log of a session that has not begun, on a machine of which that `state` is known, and whose tables
    /// are in the file `tables`.
    pub(super) fn begin<T: Timeline>(
        session: &mut Session<T>,
        file: Sink,
        tables: &Path,
        state: &MachineState,
    ) -> io::Result<Self> {
        let mut log = Self {
            events: session.subscribe(),
            file,
        };
        // Without a file they are empty, which is worth a line: by replay time there may be one.
        let text = match syncline_strict_toml::read(tables) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => String::new(),
            text => text?,
        };
        for tables in text.split('\n').map(str::to_owned) {
            write(&mut log.file, &TablesLine { tables })?;
        }
        let state = state.clone();
        write(&mut log.file, &StateLine { state })?;
        Ok(log)
    }

    /// Writes what took effect since the last call.
    pub(super) fn follow(&mut self) -> io::Result<()> {
        for event in self.events.events() {
            if let Event::Accepted(accepted) = event {
                write(&mut self.file, &accepted)?;
            }
        }
        Ok(())
    }
}

fn write(file: &mut Sink, line: &impl Serialize) -> io::Result<()> {
    let line = serde_json::to_string(line)? + "\n";
    file.write_all(line.as_bytes())?;
    // What a run that breaks off did is wanted most.
    file.flush()
}

/// What a log holds.
#[derive(Default)]
pub(super) struct Logged {
    /// The commands.
    pub(super) commands: Recorded,
    /// The tables with which the session began, if they are in it.
    pub(super) tables: Option<Tables>,
    /// What was known of the machine then.
    pub(super) state: MachineState,
}

/// A log of commands that cannot be used.
#[derive(Debug, thiserror::Error)]
pub(super) enum BadCommands {
    /// It cannot be read.
    #[error("cannot read {}", file.display())]
    Read {
        /// The file as it was named.
        file: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A line is no command that took effect.
    #[error("{}:{line}: no command as `--commands` of `run`, `validate` and `console` writes it", file.display())]
    Line {
        /// The file as it was named.
        file: PathBuf,
        /// 1-based.
        line: usize,
        /// What is wrong with it.
        source: serde_json::Error,
    },
    /// The tables in it are none.
    #[error(transparent)]
    Tables(#[from] TablesError),
    /// A command took effect before the one above it.
    #[error(
        "{}:{line}: cycle {cycle} comes behind cycle {before}: the lines are not in the order in \
         which they were written",
        file.display()
    )]
    Order {
        /// The file as it was named.
        file: PathBuf,
        /// 1-based.
        line: usize,
        /// The command's cycle.
        cycle: u64,
        /// That of the one above it.
        before: u64,
    },
}

/// Reads a log. A last line that is cut off is told and left out.
pub(super) fn read(path: &Path) -> Result<Logged, BadCommands> {
    let cannot_read = |source| BadCommands::Read {
        file: path.to_owned(),
        source,
    };
    let mut file = input::lines(path).map_err(cannot_read)?;
    let mut accepted: Vec<Accepted> = Vec::new();
    let mut tables: Vec<String> = Vec::new();
    let mut state = MachineState::default();
    let mut text = String::new();
    for line in 1.. {
        text.clear();
        if file.read_line(&mut text).map_err(cannot_read)? == 0 {
            break;
        }
        if !text.ends_with('\n') {
            let file = path.display();
            eprintln!("{file}:{line}: the last line is cut off: left out");
            break;
        }
        if let Ok(TablesLine { tables: line }) = serde_json::from_str(&text) {
            tables.push(line);
            continue;
        }
        if let Ok(StateLine { state: known }) = serde_json::from_str(&text) {
            state = known;
            continue;
        }
        let command: Accepted =
            serde_json::from_str(&text).map_err(|source| BadCommands::Line {
                file: path.to_owned(),
                line,
                source,
            })?;
        if let Some(before) = accepted.last()
            && command.cycle < before.cycle
        {
            return Err(BadCommands::Order {
                file: path.to_owned(),
                line,
                cycle: command.cycle,
                before: before.cycle,
            });
        }
        accepted.push(command);
    }
    let tables = match tables.is_empty() {
        true => None,
        false => Some(Tables::parse(path, &tables.join("\n"))?),
    };
    Ok(Logged {
        commands: Recorded::new(accepted),
        tables,
        state,
    })
}
