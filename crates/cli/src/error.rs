//! What can go wrong between the command line and the result.

/// A failure of a subcommand; its message is all the user sees.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CliError {
    /// A file cannot be read, understood or written.
    #[error(transparent)]
    Io(#[from] mechid::io::IoError),
    /// The samples asked for are not all there.
    #[error(
        "the window needs samples {first} to {last} (counted from 1), {file} has {len}: choose \
         --start, --period and --periods to fit"
    )]
    Window {
        /// The record.
        file: String,
        /// First sample needed, counted from 1.
        first: usize,
        /// Last sample needed, counted from 1.
        last: usize,
        /// Samples there are.
        len: usize,
    },
    /// Neither a time column nor a sampling rate is known.
    #[error(
        "{file} has no column called time, time_s or t: name the time column with --time, or give \
         --sample-rate in Hz; its columns are {available}"
    )]
    #[allow(dead_code, reason = "for the subcommands that compute")]
    NoTimeAxis {
        /// The record.
        file: String,
        /// Numbers and names of the columns there are.
        available: String,
    },
    /// The report cannot be printed.
    #[error("cannot print the report: {0}")]
    Print(#[from] std::io::Error),
    /// The report has no JSON form.
    #[error("cannot write the report as JSON: {0}")]
    Json(#[from] serde_json::Error),
}
