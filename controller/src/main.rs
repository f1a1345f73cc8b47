//! The `syncline` command.
#![forbid(unsafe_code)]

use clap::Parser;
use std::process::ExitCode;
use syncline_controller::commands::Cli;

fn main() -> ExitCode {
    Cli::parse().execute().into()
}
