//! The `mechid` program as a library, for other packages that include it: the only crate of the
//! workspace that parses arguments and prints.
//!
//! A subcommand is one file of `commands`: arguments become settings of an analysis, its result an
//! `Outcome`. Printing and the final names of files happen in `outcome` after everything has
//! succeeded, so that a failure leaves no incomplete file. Every failure ends with one message on
//! the error stream and exit code 2; a run over many records with some failures ends with exit code
//! 1.
mod args;
mod commands;
mod error;
mod options;
mod outcome;
mod progress;
mod repeat;
mod worker;

use std::ffi::OsString;
use std::io::{ErrorKind, Write as _, stderr};
use std::process::ExitCode;

use clap::Parser as _;
use mechid::analysis::time_limit;

use crate::commands::Cli;
use crate::error::CliError;
pub use crate::worker::set_worker_program;

/// Exit code of every failure; the argument parser uses the same one.
const FAILURE: u8 = 2;

/// Exit code of a run over many records if some have no result.
const INCOMPLETE: u8 = 1;

/// Exit code for a program that ends because of a closed pipe: 128 + SIGPIPE.
const BROKEN_PIPE: u8 = 141;

/// Runs the program with these arguments, beginning with its name, and returns its exit code.
///
/// ```
/// use std::process::ExitCode;
///
/// let arguments = ["mechid", "stability", "--quiet"].map(Into::into);
/// assert_eq!(mechid_cli::run(arguments), ExitCode::SUCCESS);
/// ```
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    let arguments: Vec<OsString> = arguments.into_iter().collect();
    if let Some(code) = worker::work(&arguments) {
        return code;
    }
    let cli = match Cli::try_parse_from(&arguments) {
        Ok(cli) => cli,
        Err(message) => {
            // Help and version go to standard output and are no failure.
            let printed = message.print();
            return match printed {
                _ if message.use_stderr() => ExitCode::from(FAILURE),
                Ok(()) => ExitCode::SUCCESS,
                Err(error) if error.kind() == ErrorKind::BrokenPipe => ExitCode::from(BROKEN_PIPE),
                Err(_) => ExitCode::from(FAILURE),
            };
        }
    };
    match outcome(&cli, arguments.get(1..).unwrap_or_default()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(INCOMPLETE),
        // The reader has closed the pipe (`mechid … | head`).
        Err(error) if error.is_closed_output() => ExitCode::from(BROKEN_PIPE),
        Err(error) => {
            // The exit code does not depend on whether the message can be printed.
            let command = arguments.get(1).and_then(|word| word.to_str()).unwrap_or_default();
            let raises = options::has(command, "raise-limits");
            let message = error.message(raises, options::spelled);
            let _ = writeln!(stderr(), "error: {}", outcome::shown(&message));
            ExitCode::from(FAILURE)
        }
    }
}

/// Runs the command and delivers its outcome; returns whether everything requested has a result.
fn outcome(cli: &Cli, words: &[OsString]) -> Result<bool, CliError> {
    cli.command.files().check()?;
    let run = || time_limit::within(cli.command.time_limit(), || cli.command.run(words));
    let outcome = match cli.command.waiting() {
        Some(message) => progress::watched(message, run)?,
        None => run()?,
    };
    let is_complete = outcome.is_complete();
    outcome.deliver(cli.command.report(), options::spelled)?;
    Ok(is_complete)
}
