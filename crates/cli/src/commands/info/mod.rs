//! `mechid info`: what is in a record.

mod channel;
mod report;

use clap::Args;
use mechid::io::{Table, TimeAxis};

use self::channel::Channel;
use self::report::{Report, Sampling, Scalar, Window};
use crate::error::CliError;
use crate::options::{Detrend, RecordArgs, ReportArgs};
use crate::outcome::Outcome;

/// Show what is in a record: format, columns, sampling, levels, strongest lines, period
///
/// For every channel: mean, RMS and peak value in its own unit, the crest factor, the strongest
/// lines of its spectrum with their amplitudes, and the period, in samples, if it repeats. The
/// spectrum is that of whole periods or, where nothing repeats, of the window weighted by a Hann
/// window.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  mechid info record.csv
  mechid info rig.csv --sample-rate 610.35 --columns V1,V2 --start 10585 --period 1024
  mechid info rig.mat --columns force,acceleration[2] --json")]
pub struct InfoArgs {
    #[command(flatten)]
    pub input: RecordArgs,
    /// Columns to show, by name or number [default: every column that holds numbers only]
    #[arg(long, value_name = "COLUMN,…", value_delimiter = ',')]
    columns: Vec<String>,
    #[command(flatten)]
    pub report: ReportArgs,
}

impl InfoArgs {
    /// Reads the record and measures each of its columns.
    pub fn run(&self) -> Result<Outcome, CliError> {
        let table = self.input.table()?;
        let (shown, mut left_out) = self.shown(&table)?;
        let len = match self.columns.as_slice() {
            [] => table.len(),
            named => table.common_length(named)?,
        };
        let dt = self.step(&table, &mut left_out)?;
        let window = match len {
            0 => None,
            len => Some(self.input.span(table.file(), len)?),
        };
        let channels = match window {
            Some((start, len)) => self.channels(&table, &shown, start, len, dt)?,
            None => Vec::new(),
        };
        let report = Report {
            file: table.file().into(),
            format: table.format(),
            columns: table.width(),
            samples: table.len(),
            window: window.map(|(start, len)| Window::of(start, len)),
            sampling: dt.zip(window).map(|(dt, (_, len))| Sampling::of(dt, len)),
            channels,
            scalars: table
                .scalars()
                .iter()
                .map(|(name, value)| Scalar { name: name.clone(), value: *value })
                .collect(),
            remarks: table.remarks().to_vec(),
            left_out,
        };
        Outcome::new(report.text(), &report)
    }

    /// Indices of the columns asked for, or of those that are numbers and as long as most; and what is
    /// wrong with the others.
    fn shown(&self, table: &Table) -> Result<(Vec<usize>, Vec<String>), CliError> {
        if !self.columns.is_empty() {
            let named = self.columns.iter().map(|wanted| table.find(wanted));
            return Ok((named.collect::<Result<_, _>>()?, Vec::new()));
        }
        let (mut shown, mut left_out) = (Vec::new(), Vec::new());
        for column in table.filled_columns() {
            match table.values(column) {
                Ok(values) if values.len() == table.len() => shown.push(column),
                Ok(values) => left_out.push(format!(
                    "column {} has {} samples, most have {}",
                    table.label(column),
                    values.len(),
                    table.len()
                )),
                Err(reason) => left_out.push(reason.to_string()),
            }
        }
        Ok((shown, left_out))
    }

    /// The time step, in s. A time axis that nobody asked for may be wrong: that is told, no error.
    fn step(&self, table: &Table, left_out: &mut Vec<String>) -> Result<Option<f64>, CliError> {
        let Some(time) = self.input.time_axis(table) else { return Ok(None) };
        let asked_for = self.input.time.is_some() || matches!(time, TimeAxis::RateHz(_));
        match table.sampling(&time, &self.columns) {
            Ok(sampling) => Ok(Some(sampling.dt())),
            Err(reason) if asked_for => Err(reason.into()),
            Err(reason) => {
                left_out.push(format!("time axis: {reason}"));
                Ok(None)
            }
        }
    }

    fn channels(
        &self,
        table: &Table,
        shown: &[usize],
        start: usize,
        len: usize,
        dt: Option<f64>,
    ) -> Result<Vec<Channel>, CliError> {
        let detrend = self.input.detrend == Some(Detrend::Mean);
        let mut channels = Vec::new();
        for &column in shown {
            let values = table.values(column)?;
            let offset = if detrend { channel::mean(values) } else { 0.0 };
            let window: Vec<f64> = values[start..start + len].iter().map(|v| v - offset).collect();
            let name = table.names()[column].clone();
            channels.push(Channel::of(column + 1, name, table.about(column).into(), window, dt)?);
        }
        Ok(channels)
    }
}
