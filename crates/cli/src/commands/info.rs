//! `mechid info`: what is in a record.

use std::ffi::OsString;

use clap::Args;
use mechid::analysis::InspectSettings;
use mechid::report::FigureStyle;

use crate::args::{FigureArgs, RecordArgs, ReportArgs};
use crate::error::CliError;
use crate::outcome::{Files, Outcome};

/// Show what is in a record: format, columns, sampling, levels, strongest lines, period
///
/// The report has, for every channel, mean, RMS and peak value in its own unit, the crest factor,
/// the strongest lines of its spectrum with their amplitudes, and the period, in samples, if the
/// channel repeats. The spectrum covers whole periods if the channel repeats or --period is given,
/// otherwise all samples of the window, weighted by a Hann function. In a text of more than 262144
/// rows, the levels cover all samples of the window; lines and period cover its first 262144
/// samples.
///
/// The picture shows the first eight columns over time, in the whole window, and their spectra,
/// from the mean period if there is one. The column of time has a spectrum only if --columns names
/// it.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  mechid info record.csv
  mechid info examples/machine.csv --plot record.svg
  mechid info rig.csv --sample-rate 610.35 --columns V1,V2 --start 10585 --period 1024
  mechid info rig.mat --columns force,acceleration[2] --json")]
pub struct InfoArgs {
    #[command(flatten)]
    pub input: RecordArgs,
    /// Columns to show, by name or number [default: every column that holds numbers only]
    #[arg(long, value_name = "COLUMN,…", value_delimiter = ',')]
    columns: Vec<String>,
    #[command(flatten)]
    page: FigureArgs,
    #[command(flatten)]
    pub report: ReportArgs,
}

impl InfoArgs {
    /// Returns the files that the arguments name.
    pub fn files(&self) -> Files<'_> {
        self.page.add_files(Files::default().reads([&self.input.record]))
    }

    /// Reads the record and measures each of its columns.
    pub fn run(&self, words: &[OsString]) -> Result<Outcome, CliError> {
        let how = InspectSettings {
            columns: self.columns.clone(),
            curves: self.page.plot.plot.is_some(),
        };
        let (reading, window) = (self.input.reading(), self.input.window());
        let inspected = mechid::inspect(&self.input.record, &reading, &window, &how)?;
        Outcome::new(inspected.to_string(), &inspected)?.with_result_page(
            &self.page,
            (&self.input.record, words),
            &inspected,
            FigureStyle::default(),
        )
    }
}
