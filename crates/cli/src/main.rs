//! The `mechid` program: the only argument parsing, and the only printing, of the workspace.
//!
//! A subcommand is one file of [`commands`]. It computes an [`outcome::Outcome`] and neither prints
//! nor gives a file its name: that happens here, once everything has succeeded, so that a failure
//! leaves nothing half written. Every failure ends with one message on the error stream and exit code 2.
#![allow(clippy::print_stderr, reason = "the program talks to its user")]

mod commands;
mod error;
mod options;
mod outcome;
mod progress;
mod text_table;
mod units;

use std::process::ExitCode;

use clap::Parser as _;

use crate::commands::Cli;
use crate::error::CliError;

/// Exit code of every failure; the argument parser uses the same one.
const FAILURE: u8 = 2;

fn main() -> ExitCode {
    match run(&Cli::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(FAILURE)
        }
    }
}

fn run(cli: &Cli) -> Result<(), CliError> {
    let outcome = match cli.command.waiting() {
        Some(message) => progress::watched(message, || cli.command.run())?,
        None => cli.command.run()?,
    };
    outcome.deliver(cli.command.report())
}
