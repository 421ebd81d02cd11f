//! The subcommands, one file each.
//!
//! A new subcommand needs a file with an arguments struct (`#[derive(clap::Args)]`, help texts with
//! units and an example) and a method `run(&self) -> Result<Outcome, CliError>`. It also needs a
//! variant of [`Command`] and an arm in the matches below. Errors of a library crate get a variant
//! of [`CliError`].

mod bearing;
mod completions;
mod fleet;
mod force;
mod frf;
mod identify;
mod info;
mod modes;
mod multisine;
mod predict;
mod report;
mod simulate;
mod stability;
mod sweep;
mod trends;

use std::ffi::OsString;

use clap::{Parser, Subcommand};

use crate::args::ReportArgs;
use crate::error::CliError;
use crate::outcome::{Files, Outcome};

/// Identify machines from measured forces and responses.
#[derive(Debug, Parser)]
#[command(
    name = "mechid",
    version,
    max_term_width = 100,
    after_help = "Numbers are in SI units. Columns are chosen by name or by number, counted from 1. Records are \
                  text\n(CSV and similar), MATLAB or HDF5 files, universal files (dataset 58), \
                  Parquet, or any of\nthem in gzip.\n\n\
                  A file called - is standard input where it is read, standard output where it is written; the\n\
                  text report then goes to the error stream.\n\n\
                  Exit codes:\n  0    success\n  1    fleet: some of the records have no result\n  2    any other failure, wrong options included: one message on \
                  the error stream, no file written\n  141  the reader of standard output has closed it"
)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    Bearing(bearing::BearingArgs),
    Completions(completions::CompletionsArgs),
    Fleet(fleet::FleetArgs),
    Force(force::ForceArgs),
    Frf(frf::FrfArgs),
    Identify(identify::IdentifyArgs),
    Info(info::InfoArgs),
    Modes(modes::ModesArgs),
    Multisine(multisine::MultisineArgs),
    Predict(predict::PredictArgs),
    Report(report::PageArgs),
    Simulate(simulate::SimulateArgs),
    Stability(stability::StabilityArgs),
    Sweep(sweep::SweepArgs),
    Trends(trends::TrendsArgs),
}

impl Command {
    /// Runs the command and returns its result, before anything is printed or written. `words` are
    /// the arguments of the program, for a report that names the command to reproduce it.
    pub fn run(&self, words: &[OsString]) -> Result<Outcome, CliError> {
        match self {
            Command::Bearing(args) => args.run(words),
            Command::Completions(args) => args.run(),
            Command::Fleet(args) => args.run(),
            Command::Force(args) => args.run(words),
            Command::Frf(args) => args.run(words),
            Command::Identify(args) => args.run(words),
            Command::Info(args) => args.run(words),
            Command::Modes(args) => args.run(words),
            Command::Multisine(args) => args.run(words),
            Command::Predict(args) => args.run(),
            Command::Report(args) => args.run(words),
            Command::Simulate(args) => args.run(words),
            Command::Stability(args) => args.run(words),
            Command::Sweep(args) => args.run(words),
            Command::Trends(args) => args.run(words),
        }
    }

    /// Returns the time limit of the command, in s. A fleet has a limit for each record
    /// instead.
    pub fn time_limit(&self) -> Option<f64> {
        match self {
            Command::Bearing(args) => args.limit.time_limit,
            Command::Force(args) => args.limit.time_limit,
            Command::Identify(args) => args.limit.time_limit,
            Command::Modes(args) => args.limit.time_limit,
            Command::Report(args) => args.limit.time_limit,
            _ => None,
        }
    }

    /// Returns the files that the arguments name.
    pub fn files(&self) -> Files<'_> {
        match self {
            Command::Bearing(args) => args.files(),
            Command::Completions(_) => Files::default(),
            Command::Fleet(args) => args.files(),
            Command::Force(args) => args.files(),
            Command::Frf(args) => args.files(),
            Command::Identify(args) => args.files(),
            Command::Info(args) => args.files(),
            Command::Modes(args) => args.files(),
            Command::Multisine(args) => args.files(),
            Command::Predict(args) => args.files(),
            Command::Report(args) => args.files(),
            Command::Simulate(args) => args.files(),
            Command::Stability(args) => args.files(),
            Command::Sweep(args) => args.files(),
            Command::Trends(args) => args.files(),
        }
    }

    /// Returns the message shown during a long computation; `None` if the subcommand shows its
    /// progress itself, or must not show a message.
    pub fn waiting(&self) -> Option<&'static str> {
        match self {
            Command::Fleet(_) | Command::Sweep(_) => None,
            _ if self.report().quiet => None,
            Command::Multisine(_) => Some("designing the multisine"),
            Command::Simulate(_) => Some("simulating"),
            Command::Force(_) => Some("reconstructing the force"),
            Command::Bearing(_) | Command::Identify(_) | Command::Report(_) => Some("identifying"),
            _ => Some("working"),
        }
    }

    /// Returns the options for the printed result.
    pub fn report(&self) -> &ReportArgs {
        match self {
            Command::Bearing(args) => &args.report,
            Command::Completions(args) => &args.report,
            Command::Fleet(args) => &args.report,
            Command::Force(args) => &args.report,
            Command::Frf(args) => &args.report,
            Command::Identify(args) => &args.report,
            Command::Info(args) => &args.report,
            Command::Modes(args) => &args.report,
            Command::Multisine(args) => &args.report,
            Command::Predict(args) => &args.report,
            Command::Report(args) => &args.report,
            Command::Simulate(args) => &args.report,
            Command::Stability(args) => &args.report,
            Command::Sweep(args) => &args.report,
            Command::Trends(args) => &args.report,
        }
    }
}

#[cfg(test)]
mod tests;
