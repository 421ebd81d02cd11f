//! Errors that subcommands report to the user.

use std::io::ErrorKind;
use std::path::Path;

use mechid::SimulateError;
use mechid::analysis::AnalysisError;
use mechid::io::{IoError, output_name};
use mechid::signal::message;

/// Failure of a subcommand; the user sees only its message.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CliError {
    /// The analysis failed.
    #[error(transparent)]
    Analysis(#[from] AnalysisError),
    /// A figure or page cannot be made.
    #[error(transparent)]
    Report(#[from] mechid::report::ReportError),
    /// A figure cannot be drawn.
    #[error(transparent)]
    Plot(#[from] mechid::plot::PlotError),
    /// A file cannot be read, understood or written.
    #[error(transparent)]
    Io(#[from] IoError),
    /// Mode shapes without the geometry to draw them.
    #[error(
        "no mode shapes can be drawn: at least one mode must oscillate, at least two channels are needed, and \
         --geometry, if given, must have a point for each of {names}"
    )]
    NoShapes {
        /// Names of the channels.
        names: String,
    },
    /// The file with details of a measurement cannot be read.
    #[error("{file}: {source}")]
    About {
        /// The file.
        file: String,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// An option in the wrong context.
    #[error("{option} {why}")]
    MisplacedOption {
        /// The option.
        option: &'static str,
        /// Reason why the option is not allowed in this context.
        why: &'static str,
    },
    /// A time-stepping scheme fails.
    #[error(transparent)]
    Integrate(#[from] mechid::integrate::IntegrateError),
    /// The simulation failed.
    #[error(transparent)]
    Simulate(#[from] mechid::SimulateError),
    /// A record with too many numbers.
    #[error(
        "a record of {numbers} numbers is too large, the limit is {largest} numbers: use fewer --samples, \
         --periods or --inputs"
    )]
    RecordSize {
        /// Numbers in the record: samples times columns.
        numbers: usize,
        /// The limit.
        largest: usize,
    },
    /// At least two outputs are directed to standard output.
    #[error(
        "only one output can go to standard output, not {}{}",
        message::count(*files, "file"),
        if *json { " and the report: write to named files, or leave --json out" } else { ": name the others" }
    )]
    SharedOutput {
        /// Number of files for standard output.
        files: usize,
        /// `true` if the report as JSON goes to standard output, too.
        json: bool,
    },
    /// The report cannot be printed.
    #[error("cannot print the report: {0}")]
    Print(#[from] std::io::Error),
    /// The report has no JSON form.
    #[error("cannot write the report as JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// A signal cannot be used.
    #[error(transparent)]
    Signal(#[from] mechid::signal::SignalError),
    /// A model cannot be used.
    #[error(transparent)]
    Model(#[from] mechid::model::ModelError),
}

impl CliError {
    /// Returns whether the reader of standard output has closed it.
    pub fn is_closed_output(&self) -> bool {
        match self {
            Self::Print(source) => source.kind() == ErrorKind::BrokenPipe,
            Self::Io(IoError::Write { file, source }) => {
                *file == output_name(Path::new("-")) && source.kind() == ErrorKind::BrokenPipe
            }
            _ => false,
        }
    }

    /// Returns the message; `raises` states whether the command has options to raise limits, and
    /// `spelled` replaces names of settings by options.
    pub fn message(&self, raises: bool, spelled: impl Fn(&str) -> String) -> String {
        match self {
            Self::Io(error @ IoError::TooLarge { file, at, limit })
            | Self::Analysis(AnalysisError::Io(error @ IoError::TooLarge { file, at, limit })) => {
                match (raises, limit.is_memory()) {
                    (true, true) => {
                        format!("{error} with --memory-gb")
                    }
                    (true, false) => {
                        format!("{error} with --raise-limits")
                    }
                    (false, _) => format!("{file}, {at}: {limit}, which this command cannot raise"),
                }
            }
            Self::Simulate(error @ SimulateError::Io(IoError::SimulationMemory { .. })) => {
                spelled(&error.to_string())
            }
            // Text from a file is not changed.
            Self::Analysis(AnalysisError::Io(error)) => error.to_string(),
            Self::Analysis(error) => spelled(&error.to_string()),
            other => other.to_string(),
        }
    }
}
