//! `mechid info`: what is in a record.

use clap::Args;
use mechid::io::{IoError, Table};
use serde::Serialize;

use crate::error::CliError;
use crate::options::{Detrend, RecordArgs, ReportArgs};
use crate::outcome::Outcome;
use crate::text_table::{compact, significant, text_table};

/// Show what is in a record: columns, sampling, level and crest factor
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  mechid info record.csv --sample-rate 610.35 --columns V1,V2")]
pub struct InfoArgs {
    #[command(flatten)]
    pub input: RecordArgs,
    /// Columns to show, by name or number [default: every column that holds numbers only]
    #[arg(long, value_name = "COLUMN,…", value_delimiter = ',')]
    columns: Vec<String>,
    #[command(flatten)]
    pub report: ReportArgs,
}

#[derive(Debug, Serialize)]
struct Report {
    file: String,
    columns: usize,
    samples: usize,
    window: Window,
    sampling: Option<Sampling>,
    channels: Vec<Channel>,
    /// Columns that hold something else than numbers, and where.
    not_numeric: Vec<String>,
}

#[derive(Debug, Serialize)]
struct Window {
    first_sample: usize,
    last_sample: usize,
}

#[derive(Debug, Serialize)]
struct Sampling {
    rate_hz: f64,
    step_s: f64,
    duration_s: f64,
}

#[derive(Debug, Serialize)]
struct Channel {
    column: usize,
    name: String,
    mean: f64,
    rms: f64,
    peak: f64,
    /// Peak over RMS; 1.41 for a sine. Nothing for a channel of zeros.
    crest_factor: Option<f64>,
    minimum: f64,
    maximum: f64,
}

impl InfoArgs {
    /// Reads the record and measures each of its columns.
    pub fn run(&self) -> Result<Outcome, CliError> {
        let table = self.input.table()?;
        let (start, len) = self.input.span(table.file(), table.len())?;
        let (channels, not_numeric) = self.channels(&table, start, len)?;
        let sampling = match self.input.time_axis(&table) {
            None => None,
            Some(time) => {
                let sampling = table.record(&time, &[] as &[&str])?.sampling();
                Some(Sampling {
                    rate_hz: sampling.rate_hz(),
                    step_s: sampling.dt(),
                    duration_s: len as f64 * sampling.dt(),
                })
            }
        };
        let report = Report {
            file: table.file().into(),
            columns: table.width(),
            samples: table.len(),
            window: Window { first_sample: start + 1, last_sample: start + len },
            sampling,
            channels,
            not_numeric,
        };
        Outcome::new(report.text(), &report)
    }

    /// The columns asked for, or those that are numbers; and what is wrong with the others.
    fn channels(
        &self,
        table: &Table,
        start: usize,
        len: usize,
    ) -> Result<(Vec<Channel>, Vec<String>), CliError> {
        let detrend = self.input.detrend == Some(Detrend::Mean);
        let measure = |wanted: &str| -> Result<Channel, IoError> {
            let column = table.find(wanted)?;
            let values = table.column(wanted)?;
            let offset = if detrend { mean(values) } else { 0.0 };
            let window: Vec<f64> = values[start..start + len].iter().map(|v| v - offset).collect();
            Ok(Channel::of(column + 1, table.names()[column].clone(), &window))
        };
        if !self.columns.is_empty() {
            let channels = self.columns.iter().map(|wanted| measure(wanted));
            return Ok((channels.collect::<Result<_, _>>()?, Vec::new()));
        }
        let (mut channels, mut others) = (Vec::new(), Vec::new());
        for column in table.filled_columns() {
            match measure(&(column + 1).to_string()) {
                Ok(channel) => channels.push(channel),
                Err(reason) => others.push(reason.to_string()),
            }
        }
        Ok((channels, others))
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

impl Channel {
    fn of(column: usize, name: String, values: &[f64]) -> Self {
        let square_mean = values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64;
        let (rms, peak) = (square_mean.sqrt(), values.iter().fold(0.0_f64, |p, v| p.max(v.abs())));
        Self {
            column,
            name,
            mean: mean(values),
            rms,
            peak,
            crest_factor: (rms > 0.0).then(|| peak / rms),
            minimum: values.iter().copied().fold(f64::INFINITY, f64::min),
            maximum: values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        }
    }
}

impl Report {
    fn text(&self) -> String {
        let Window { first_sample, last_sample } = self.window;
        let mut text = format!(
            "{}: {} columns, {} samples; shown: samples {first_sample} to {last_sample}\n",
            self.file, self.columns, self.samples
        );
        text += &match &self.sampling {
            Some(s) => format!(
                "{} Hz, a step of {} s, {} s long\n\n",
                compact(s.rate_hz, 8),
                compact(s.step_s, 6),
                compact(s.duration_s, 6)
            ),
            None => "no time column: give --time or --sample-rate\n\n".into(),
        };
        let header = ["column", "mean", "RMS", "peak", "crest factor", "minimum", "maximum"];
        let mut rows = vec![header.map(String::from).to_vec()];
        for c in &self.channels {
            let mut row = vec![format!("{} {}", c.column, c.name)];
            row.extend([c.mean, c.rms, c.peak].map(|v| significant(v, 5)));
            row.push(c.crest_factor.map_or("–".into(), |v| significant(v, 4)));
            row.extend([c.minimum, c.maximum].map(|v| significant(v, 5)));
            rows.push(row);
        }
        text += &text_table(&rows);
        for reason in &self.not_numeric {
            text += &format!("left out: {reason}\n");
        }
        text
    }
}
