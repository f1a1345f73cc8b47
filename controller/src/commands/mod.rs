//! The `syncline` command line: one module a subcommand, each with its `Args` and an `execute`.

/// As the standard library's macro of this name, but what cannot be written is told at the end: least
/// of all while axes move is it a reason to panic. Control characters, as a file's name may have
/// them, are shown and not obeyed.
macro_rules! print {
    ($($text:tt)*) => { $crate::commands::to_stdout(&format!($($text)*)) };
}

/// See [`print`].
macro_rules! println {
    ($($text:tt)*) => { print!("{}\n", format_args!($($text)*)) };
}

/// See [`print`]; nobody is told of what cannot be written here.
macro_rules! eprint {
    ($($text:tt)*) => { $crate::commands::to_stderr(&format!($($text)*)) };
}

/// See [`print`].
macro_rules! eprintln {
    () => { eprint!("\n") };
    ($($text:tt)*) => { eprint!("{}\n", format_args!($($text)*)) };
}

mod bench;
mod budget;
mod calendar;
mod campaign;
mod check;
mod command_log;
mod compare;
mod console;
mod doctor;
mod drives;
mod eds;
mod events;
mod identify;
mod keys;
mod log_files;
mod merge;
mod monitor;
mod nmt;
mod origin;
mod output;
mod plan;
mod ports;
mod progress;
mod real_time;
mod record;
mod repeats;
mod replay;
mod run;
mod scan;
mod scripted;
mod sdo;
mod shard;
mod state_keeper;
mod sweep;
mod switches;
mod tool;
mod trajectory;
mod unmet;
mod user_codes;
mod validate;
mod writers;

#[cfg(fuzzing)]
pub use self::{events::fuzz as fuzz_events, plan::fuzz as fuzz_cases};

use crate::control::{self, Layout};
use crate::realtime;
use crate::text::shown;
use clap::{Parser, Subcommand};
use std::io::{self, Write};
use std::process::ExitCode;
use std::sync::OnceLock;
use std::time::Duration;

/// Multi-axis motion controller for CANopen servo drives.
///
/// Exit codes: 0 finished, 1 stopped by a fault or failed validation, 2 bad input, 130 interrupted.
/// FILE to be written may be `-`, standard output, once.
#[derive(Debug, Parser)]
#[command(name = "syncline", version, max_term_width = 100)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Check(check::Args),
    Run(run::Args),
    Validate(validate::Args),
    Sweep(sweep::Args),
    Merge(merge::Args),
    Compare(compare::Args),
    Console(console::Args),
    Bench(bench::Args),
    Campaign(campaign::Args),
    Budget(budget::Args),
    Doctor(doctor::Args),
    Drives(drives::Args),
    Eds(eds::Args),
    Monitor(monitor::Args),
    Nmt(nmt::Args),
    Plan(plan::Args),
    Record(record::Args),
    Replay(replay::Args),
    Identify(identify::Args),
    Scan(scan::Args),
    Sdo(sdo::Args),
}

impl Cli {
    /// Reads the command line and runs the chosen subcommand to its end.
    #[must_use]
    pub fn main() -> Exit {
        let exit = match Self::try_parse() {
            Ok(cli) => cli.command.execute(),
            Err(shown) => {
                note(shown.print());
                match shown.use_stderr() {
                    true => Exit::BadInput,
                    // Help, or the version.
                    false => Exit::Finished,
                }
            }
        };
        note(io::stdout().flush());
        let Some(error) = UNWRITTEN.get() else {
            return exit;
        };
        eprintln!("error: cannot write standard output: {error}");
        match exit {
            Exit::Finished => Exit::Stopped,
            _ => exit,
        }
    }
}

impl Command {
    fn execute(self) -> Exit {
        match self {
            Command::Check(args) => args.execute(),
            Command::Run(args) => args.execute(),
            Command::Validate(args) => args.execute(),
            Command::Sweep(args) => args.execute(),
            Command::Merge(args) => args.execute(),
            Command::Compare(args) => args.execute(),
            Command::Console(args) => args.execute(),
            Command::Bench(args) => args.execute(),
            Command::Campaign(args) => args.execute(),
            Command::Budget(args) => args.execute(),
            Command::Doctor(args) => args.execute(),
            Command::Drives(args) => args.execute(),
            Command::Eds(args) => args.execute(),
            Command::Monitor(args) => args.execute(),
            Command::Nmt(args) => args.execute(),
            Command::Plan(args) => args.execute(),
            Command::Record(args) => args.execute(),
            Command::Replay(args) => args.execute(),
            Command::Identify(args) => args.execute(),
            Command::Scan(args) => args.execute(),
            Command::Sdo(args) => args.execute(),
        }
    }
}

/// How a command ended, as the shell sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// The program finished or the input is good.
    Finished,
    /// A fault stopped the machine, or a validation failed.
    Stopped,
    /// The input is bad; nothing moved.
    BadInput,
    /// The user stopped the machine.
    Interrupted,
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(match exit {
            Exit::Finished => 0,
            Exit::Stopped => 1,
            Exit::BadInput => 2,
            Exit::Interrupted => 130,
        })
    }
}

/// Why standard output could not be written.
static UNWRITTEN: OnceLock<io::Error> = OnceLock::new();

/// Remembers why standard output could not be written. A reader that has gone, as `head` goes, wants
/// no more: that is no failure.
fn note(written: io::Result<()>) {
    if let Err(error) = written
        && error.kind() != io::ErrorKind::BrokenPipe
    {
        // The first one counts.
        let _ = UNWRITTEN.set(error);
    }
}

fn to_stdout(text: &str) {
    note(io::stdout().write_all(shown(text).as_bytes()));
}

fn to_stderr(text: &str) {
    let _ = io::stderr().write_all(shown(text).as_bytes());
}

/// Reports input that cannot be used.
fn bad_input(error: &(dyn std::error::Error + 'static)) -> Exit {
    report(error);
    Exit::BadInput
}

/// Nothing that is waited for or measured takes longer: 31 days.
const LONGEST: Duration = Duration::from_secs(31 * 24 * 3600);

/// A duration as people write it: `500us`, `1ms`, `60s`, `2min`.
fn duration(text: &str) -> Result<Duration, String> {
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let scale = match &text[digits.len()..] {
        "us" => 1e-6,
        "ms" => 1e-3,
        "s" => 1.0,
        "min" => 60.0,
        _ => return Err("give a number and us, ms, s or min".into()),
    };
    let number: f64 = digits.parse().map_err(|_| "not a number".to_owned())?;
    let duration = Duration::try_from_secs_f64(number * scale).ok();
    let duration = duration.filter(|duration| *duration <= LONGEST);
    duration.ok_or_else(|| "give 0 to 31 days".to_owned())
}

/// A processor core of this machine, isolated or not.
fn core(text: &str) -> Result<usize, String> {
    let cores = realtime::cores();
    let core = text.parse().ok().filter(|core| *core < cores);
    core.ok_or_else(|| format!("this machine has cores 0 to {}", cores - 1))
}

/// What is told of something that happened to the machine: but for what happens in every run, and for a device's own
/// signal that an input of the machine is wired to, as that tells it by its name. `verbose` tells those, too.
fn told_event(event: &control::Event, layout: &Layout, verbose: bool) -> Option<String> {
    let once_more = match event {
        control::Event::Signal { device, signal, .. } => {
            layout.is_input(*device, *signal) || layout.is_output(*device, *signal)
        }
        _ => false,
    };
    let tells = verbose || !(event.is_routine() || once_more);
    tells.then(|| event.describe(layout)).flatten()
}

/// Prints an error with everything that caused it, one line, to standard error.
pub fn report(error: &(dyn std::error::Error + 'static)) {
    eprintln!("{}", told(error));
}

/// An error with everything that caused it, as it is told.
fn told(error: &(dyn std::error::Error + 'static)) -> String {
    format!("error: {}", with_causes(error))
}

/// An error with everything that caused it, on one line as far as these are.
#[must_use]
pub fn with_causes(error: &(dyn std::error::Error + 'static)) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text += &format!(": {error}");
        cause = error.source();
    }
    text
}

#[cfg(test)]
mod tests {
    use super::{LONGEST, duration};
    use std::time::Duration;

    #[test]
    fn durations_are_read_as_people_write_them() {
        assert_eq!(duration("500us"), Ok(Duration::from_micros(500)));
        assert_eq!(duration("1.5ms"), Ok(Duration::from_micros(1500)));
        assert_eq!(duration("2min"), Ok(Duration::from_secs(120)));
        assert!(duration("5").is_err() && duration("ms").is_err() && duration("-1s").is_err());
        assert!(
            duration("nans").is_err() && duration("1e30s").is_err() && duration("infs").is_err()
        );
        assert_eq!(duration("44640min"), Ok(LONGEST));
        assert!(duration("44641min").is_err());
    }
}
