//! Options that several subcommands share.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use mechid::io::{ReadOptions, RecordFile, Table, TimeAxis};

use crate::error::CliError;

/// How to tell the result.
#[derive(Debug, Default, Args)]
pub struct ReportArgs {
    /// Print the report as JSON, for programs
    #[arg(long, help_heading = "Output")]
    pub json: bool,
    /// Print nothing on success
    #[arg(long, short, help_heading = "Output", conflicts_with = "json")]
    pub quiet: bool,
}

/// Where to draw the result.
#[derive(Debug, Default, Args)]
pub struct PlotArgs {
    /// Draw the result into this file; its ending, .svg or .png, says how
    #[arg(long, value_name = "FILE.svg|.png", value_parser = plot_file, help_heading = "Output")]
    pub plot: Option<PathBuf>,
}

fn plot_file(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    match path.extension().and_then(|e| e.to_str()).map(str::to_lowercase).as_deref() {
        Some("svg" | "png") => Ok(path),
        _ => Err("the file name must end in .svg or .png".into()),
    }
}

/// Which record, and which part of it.
#[allow(rustdoc::broken_intra_doc_links, reason = "brackets of a help text")]
#[derive(Debug, Clone, Args)]
pub struct RecordArgs {
    /// The record: text with one row per sample, MATLAB .mat (up to -v7), or universal file (dataset
    /// 58); also in gzip; - is standard input
    ///
    /// The format is found by itself. Text: delimiter (comma, semicolon, tab, blanks) and header are
    /// found too; lines starting with # are left out. MATLAB: a vector is a column, of a matrix
    /// those called name[1], name[2] …, of a struct name.field. Universal file: a function of time
    /// is a column called after its node and direction, such as 12+Z, and brings its time axis.
    #[arg(value_name = "RECORD")]
    pub record: PathBuf,
    /// Lines of text above the table, such as an instrument writes them, to leave out: a count
    #[arg(long, value_name = "COUNT", default_value_t = 0)]
    pub skip_lines: u64,
    /// Time column: name or number, counted from 1; in the unit of its name (time_ms, Time [s]) or
    /// of the line of units below it, otherwise in s [default: the file's own time axis, or a
    /// column called time or t]
    #[arg(long, value_name = "COLUMN", help_heading = "Time and window")]
    pub time: Option<String>,
    /// Samples per second, in Hz, where there is no time column
    #[arg(
        long,
        value_name = "HZ",
        conflicts_with = "time",
        allow_negative_numbers = true,
        help_heading = "Time and window"
    )]
    pub sample_rate: Option<f64>,
    /// First sample of the window, counted from 1
    #[arg(long, value_name = "SAMPLE", default_value_t = 1, value_parser = at_least_one,
          help_heading = "Time and window")]
    pub start: usize,
    /// Samples in one period [default: all samples from --start on]
    #[arg(long, value_name = "SAMPLES", value_parser = at_least_one, help_heading = "Time and window")]
    pub period: Option<usize>,
    /// Whole periods in the window [default: as many as there are]
    #[arg(long, value_name = "COUNT", value_parser = at_least_one, requires = "period",
          help_heading = "Time and window")]
    pub periods: Option<usize>,
    /// What to take away from every channel first: the mean of the whole record, not only of the
    /// window
    #[arg(long, value_name = "WHAT", value_enum, help_heading = "Time and window")]
    pub detrend: Option<Detrend>,
}

/// What to take away from a channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Detrend {
    /// Nothing
    None,
    /// The mean of the whole record
    Mean,
}

pub fn at_least_one(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) => Err("counted from 1".into()),
        Ok(n) => Ok(n),
        Err(e) => Err(format!("a whole number is needed: {e}")),
    }
}

impl RecordArgs {
    /// The file, of which so many rows are held.
    pub fn file(&self, held: usize) -> Result<RecordFile, CliError> {
        let options = ReadOptions { skip_lines: self.skip_lines, ..ReadOptions::default() };
        Ok(RecordFile::open(&self.record, &options, held)?)
    }

    /// The time axis asked for, that of the file, or the time column found by its name.
    pub fn time_axis<'a>(&'a self, table: &'a Table) -> Option<TimeAxis<'a>> {
        match (self.sample_rate, &self.time) {
            (Some(rate_hz), _) => Some(TimeAxis::RateHz(rate_hz)),
            (None, Some(column)) => Some(TimeAxis::Column(column)),
            (None, None) if table.has_time_axis() => Some(TimeAxis::OfFile),
            (None, None) => table.time_column().map(TimeAxis::Column),
        }
    }

    /// The same, where there must be one.
    pub fn needed_time_axis<'a>(&'a self, table: &'a Table) -> Result<TimeAxis<'a>, CliError> {
        self.time_axis(table).ok_or_else(|| CliError::NoTimeAxis {
            file: table.file().into(),
            available: table.available(),
        })
    }

    /// First sample, counted from 0, and number of samples of the window into a record of so many
    /// samples.
    pub fn span(&self, file: &str, samples: usize) -> Result<(usize, usize), CliError> {
        let start = self.start - 1;
        let left = samples.saturating_sub(start);
        let period = self.period.unwrap_or(left);
        let periods = self.periods.unwrap_or(left.checked_div(period).unwrap_or(0)).max(1);
        let len = period.max(1).saturating_mul(periods);
        if len > left { Err(self.outside(file, len, samples)) } else { Ok((start, len)) }
    }

    /// That the window is not all there.
    pub fn outside(&self, file: &str, len: usize, samples: usize) -> CliError {
        CliError::Window {
            file: file.into(),
            first: self.start,
            last: self.start.saturating_add(len - 1),
            len: samples,
        }
    }
}
