//! The log of a session's commands, a line of JSON for each that took effect: written beside a run,
//! read by `replay`.

use super::input::ShortLines;
use crate::observe::trace::Sink;
use crate::run::Timeline;
use crate::session::{Accepted, Event, Recorded, Session, Subscription};
use std::fs::File;
use std::io::{self, BufRead, BufReader, Write};
use std::path::{Path, PathBuf};

/// The log of a session that goes on.
pub(super) struct CommandLog {
    events: Subscription,
    file: Sink,
}

impl CommandLog {
    /// The log of a session that has not begun.
    pub(super) fn begin<T: Timeline>(session: &mut Session<T>, file: Sink) -> Self {
        Self {
            events: session.subscribe(),
            file,
        }
    }

    /// Writes what took effect since the last call.
    pub(super) fn follow(&mut self) -> io::Result<()> {
        for event in self.events.events() {
            if let Event::Accepted(accepted) = event {
                let line = serde_json::to_string(&accepted)? + "\n";
                self.file.write_all(line.as_bytes())?;
                // What a run that breaks off did is wanted most.
                self.file.flush()?;
            }
        }
        Ok(())
    }
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
    #[error("{}:{line}: no command as `--commands` of `run` and `validate` writes it", file.display())]
    Line {
        /// The file as it was named.
        file: PathBuf,
        /// 1-based.
        line: usize,
        /// What is wrong with it.
        source: serde_json::Error,
    },
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
pub(super) fn read(path: &Path) -> Result<Recorded, BadCommands> {
    let cannot_read = |source| BadCommands::Read {
        file: path.to_owned(),
        source,
    };
    let file = File::open(path).map_err(cannot_read)?;
    let mut file = BufReader::new(ShortLines::new(file));
    let mut accepted: Vec<Accepted> = Vec::new();
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
    Ok(Recorded::new(accepted))
}
