//! `mechid fleet`: identification of the machines of many records by one saved analysis.

use std::ffi::OsString;
use std::num::NonZero;
use std::path::PathBuf;
use std::thread::available_parallelism;

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use mechid::SavedAnalysis;
use mechid::analysis::fleet::{
    Fleet, Isolation, PartDone, RECORD_MEMORY_GB, RECORD_SECONDS, RECORDS_PER_PART,
};

use crate::args::{ReportArgs, at_least_one, not_negative, positive};
use crate::error::CliError;
use crate::outcome::{Files, Outcome};
use crate::worker::worker_program;

/// Identify many records by one saved analysis, into a folder of Parquet files
///
/// Every record becomes one row: parameters, standard errors, covariance, modes, findings,
/// warnings, notes, or the error of a record that cannot be identified. The records are divided
/// into parts of --part-records records, in the order of their paths; a part is one file of the
/// folder, complete or absent. If the command is repeated, it computes only the missing parts:
/// those that were not finished, and those in which a record, the analysis or the version of the
/// program has changed.
///
/// Each worker is a separate process. A record that uses too much memory or time, or that ends its
/// process, has an error in its row, and the others continue. Named pipes, sockets and devices are
/// ignored.
#[derive(Debug, Args)]
#[command(after_help = "Exit code 1 means that all records were processed and some have no result.

Examples:
  mechid fleet day-1/ day-2/ --analysis analysis.json --output results
  mechid fleet a.csv b.mat c.parquet --analysis analysis.json --output results --workers 2 --json")]
pub struct FleetArgs {
    /// The records, of any format; a folder means all files in it
    #[arg(value_name = "RECORD", required = true)]
    records: Vec<PathBuf>,
    /// The analysis, a JSON file with the fields channels, reading, window and identify
    #[arg(long, value_name = "ANALYSIS.json")]
    analysis: PathBuf,
    /// The folder of results; it is created if it does not exist
    #[arg(long, value_name = "FOLDER", help_heading = "Output")]
    output: PathBuf,
    /// Number of records processed at a time [default: number of processors]
    #[arg(long, value_name = "COUNT", value_parser = at_least_one)]
    workers: Option<usize>,
    /// Number of records in each file of the folder of results
    #[arg(long, value_name = "COUNT", default_value_t = RECORDS_PER_PART,
          value_parser = at_least_one)]
    part_records: usize,
    /// Maximum memory for a record, in GB; a record that needs more has an error in its row (Linux
    /// only)
    #[arg(long, value_name = "GB", default_value_t = RECORD_MEMORY_GB, value_parser = positive)]
    record_memory_gb: f64,
    /// Maximum time for a record, in s; a record that needs more has an error in its row
    #[arg(long, value_name = "SECONDS", default_value_t = RECORD_SECONDS, value_parser = positive)]
    record_seconds: f64,
    /// Time limit of the searches in the analysis of each record, in s; after this time they end at
    /// their best points so far, and the row has a bad check `time_limit` [default: that of the
    /// analysis]
    #[arg(long, value_name = "SECONDS", value_parser = not_negative)]
    time_limit: Option<f64>,
    #[command(flatten)]
    pub report: ReportArgs,
}

impl FleetArgs {
    /// Returns the files that the arguments name, without the results, whose names the fleet
    /// chooses.
    pub fn files(&self) -> Files<'_> {
        Files::default().reads([&self.analysis]).reads(&self.records)
    }

    fn isolation(&self, (program, arguments): &(PathBuf, Vec<OsString>)) -> Isolation {
        Isolation {
            record_memory_gb: self.record_memory_gb,
            record_seconds: self.record_seconds,
            ..Isolation::new(program, arguments.clone())
        }
    }

    /// Computes the files of results that are missing, and summarises all files of results.
    pub fn run(&self) -> Result<Outcome, CliError> {
        let saved = SavedAnalysis::read(&self.analysis)?;
        let analysis = SavedAnalysis { time_limit: self.time_limit.or(saved.time_limit), ..saved };
        let fleet = Fleet::new(analysis, &self.records, &self.output, self.part_records)?;
        let workers =
            self.workers.unwrap_or_else(|| available_parallelism().map_or(1, NonZero::get));
        let bar = if self.report.quiet {
            ProgressBar::hidden()
        } else {
            // The bar is hidden unless the error stream is a terminal.
            ProgressBar::new(fleet.record_count() as u64)
        };
        let style =
            "{wide_bar} {pos} of {len} records, {elapsed}, {eta} left (Ctrl-C ends the run)";
        bar.set_style(
            ProgressStyle::with_template(style).expect("the template is written correctly"),
        );
        let done = |part: &PartDone| bar.inc(part.records as u64);
        let summary = match worker_program() {
            Some(words) => fleet.run_isolated(workers, &self.isolation(words), &done),
            None => fleet.run(workers, &done),
        };
        bar.finish_and_clear();
        let summary = summary?;
        let outcome = Outcome::new(summary.to_string(), &summary)?;
        Ok(if summary.failed > 0 { outcome.incomplete() } else { outcome })
    }
}
