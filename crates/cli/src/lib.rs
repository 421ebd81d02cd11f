//! The `mechid` program as a library, so that other packages can carry it: the only argument parsing,
//! and the only printing, of the workspace.
//!
//! A subcommand is one file of `commands`: arguments become settings of an analysis, its result an
//! `Outcome`. It neither prints nor gives a file its name: that happens in `outcome`, once everything
//! has succeeded, so that a failure leaves nothing half written. Every failure ends with one message on
//! the error stream and exit code 2; a run over many records of which some failed with exit code 1.
mod args;
mod commands;
mod error;
mod options;
mod outcome;
mod progress;
mod repeat;
mod worker;

use std::ffi::OsString;
use std::io::{Write as _, stderr};
use std::process::ExitCode;

use clap::Parser as _;

use crate::commands::Cli;
use crate::error::CliError;
pub use crate::worker::set_worker_program;

/// Exit code of every failure; the argument parser uses the same one.
const FAILURE: u8 = 2;

/// Exit code of a run over many records of which some have no result.
const INCOMPLETE: u8 = 1;

/// Exit code that a shell gives a program which a closed pipe has ended: 128 and SIGPIPE.
const BROKEN_PIPE: u8 = 141;

/// Runs the program with these arguments, the first of which is its name, and returns its exit code.
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
            let failed = message.use_stderr() || message.print().is_err();
            if message.use_stderr() {
                let _ = message.print();
            }
            return if failed { ExitCode::from(FAILURE) } else { ExitCode::SUCCESS };
        }
    };
    match outcome(&cli, arguments.get(1..).unwrap_or_default()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(INCOMPLETE),
        // The reader has seen enough (`mechid … | head`).
        Err(error) if error.is_closed_output() => ExitCode::from(BROKEN_PIPE),
        Err(error) => {
            // A message that cannot be told changes nothing: the exit code stays.
            let command = arguments.get(1).and_then(|word| word.to_str()).unwrap_or_default();
            let raises = options::has(command, "raise-limits");
            let message = error.message(raises, options::spelled);
            let _ = writeln!(stderr(), "error: {}", outcome::shown(&message));
            ExitCode::from(FAILURE)
        }
    }
}

/// Runs the command and tells its outcome; returns whether all that was asked for has a result.
fn outcome(cli: &Cli, words: &[OsString]) -> Result<bool, CliError> {
    cli.command.files().check()?;
    let outcome = match cli.command.waiting() {
        Some(message) => progress::watched(message, || cli.command.run(words))?,
        None => cli.command.run(words)?,
    };
    let is_complete = outcome.is_complete();
    outcome.deliver(cli.command.report(), options::spelled)?;
    Ok(is_complete)
}
