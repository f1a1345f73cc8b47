//! The `syncline` command.
#![forbid(unsafe_code)]

use std::process::ExitCode;
use syncline_controller::commands::Cli;

fn main() -> ExitCode {
    Cli::main().into()
}
