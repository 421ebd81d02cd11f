//! `mechid trends`: the results of many records side by side.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::Args;
use mechid::analysis::fleet::{TrendAxis, Trends};
use mechid::report::{FigureStyle, PageSettings, trends_page};

use super::report::html_file;
use crate::args::word::word;
use crate::args::{PlotArgs, ReportArgs};
use crate::error::CliError;
use crate::outcome::{Files, Outcome};
use crate::{options, repeat};

/// Show the results of `mechid fleet` side by side: parameters and modes over the records,
/// outliers, failures
///
/// Rank tests find steps and drifts, each with the record where it begins and a p-value. An outlier
/// is farther than 3.5 standard deviations from the level of the records around it; the standard
/// deviation combines the scatter of the series (a robust estimate) and the standard error of the
/// value.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  mechid trends results --output trends.html
  mechid trends results --over number --plot stiffness.svg")]
pub struct TrendsArgs {
    /// The folder of results
    #[arg(value_name = "FOLDER")]
    results: PathBuf,
    /// Order of the records: order (sorted by name), or number (by the last number in the name,
    /// such as 1500 in speed-1500.csv)
    #[arg(long, value_name = "ORDER", value_parser = word::<TrendAxis>(), default_value = "order")]
    over: TrendAxis,
    /// File for a page with all series, outliers and failures (-: standard output)
    #[arg(long, short, value_name = "FILE.html", value_parser = html_file, help_heading = "Output")]
    output: Option<PathBuf>,
    /// Heading of the page [default: the folder]
    #[arg(long, value_name = "TEXT", requires = "output", help_heading = "Output")]
    title: Option<String>,
    /// File for a table with one row per value: quantity, record, value, standard error, outlier,
    /// and the change that begins at this record
    #[arg(long, value_name = "FILE.csv", help_heading = "Output")]
    table: Option<PathBuf>,
    #[command(flatten)]
    plot: PlotArgs,
    #[command(flatten)]
    pub report: ReportArgs,
}

impl TrendsArgs {
    /// Returns the files that the arguments name.
    pub fn files(&self) -> Files<'_> {
        Files::default()
            .reads([&self.results])
            .writes(&self.output)
            .writes(&self.table)
            .writes(&self.plot.plot)
    }

    /// Reads the results, and draws them.
    pub fn run(&self, words: &[OsString]) -> Result<Outcome, CliError> {
        let trends = Trends::read(&self.results, self.over)?;
        let mut outcome = Outcome::new(trends.to_string(), &trends)?;
        if let Some(file) = &self.output {
            let of_folder = || format!("Trends of {}", self.results.display());
            let title = Some(self.title.clone().unwrap_or_else(of_folder));
            let settings = PageSettings { title, ..repeat::settings(words) };
            outcome = outcome.with_file(file, options::spelled(&trends_page(&trends, &settings)?));
        }
        if let Some(file) = &self.table {
            outcome = outcome.with_file(file, trends.csv());
        }
        outcome.with_result_plot(&self.plot, words, &trends, FigureStyle::default())
    }
}
