//! `mechid info`: what is in a record.

mod channel;
mod report;

use std::ops::Range;

use clap::Args;
use mechid::io::{Inventory, IoError, RecordFile, Table, TimeAxis};
use mechid::signal;

use self::channel::{Channel, Gathered};
use self::report::{Report, Sampling, Scalar, Window};
use super::identify::measurement::HELD;
use crate::error::CliError;
use crate::options::{Detrend, RecordArgs, ReportArgs};
use crate::outcome::Outcome;

/// Show what is in a record: format, columns, sampling, levels, strongest lines, period
///
/// For every channel: mean, RMS and peak value in its own unit, the crest factor, the strongest
/// lines of its spectrum with their amplitudes, and the period, in samples, if it repeats. The
/// spectrum is that of whole periods where the channel repeats or --period says so, otherwise of the
/// window weighted by a Hann window. Of a text of more than 262144 rows, only the levels are those
/// of all samples of the window: lines and period are those of its first 262144 samples.
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
        let file = self.input.file(HELD)?;
        let table = file.head();
        let time = self.input.time_axis(table);
        let instants = match time {
            Some(TimeAxis::Column(name)) => table.find(name).ok(),
            _ => None,
        };
        let asked = self.asked(table)?;
        let mut inventory = file.inventory(&asked, instants)?;
        let samples = inventory.samples;
        let sampling = inventory.sampling.take();
        let (shown, len, mut left_out) = self.shown(table, &asked, inventory)?;
        let dt = self.step(&file, time, sampling, &mut left_out)?;
        let window = match len {
            0 => None,
            len => Some(self.input.span(table.file(), len)?),
        };
        let mut remarks = table.remarks().to_vec();
        let channels = match window {
            Some((start, len)) if !shown.is_empty() => {
                let hold = if file.is_whole() { len } else { len.min(HELD) };
                remarks.extend(looked_at(table.file(), start, len, hold));
                channels(&file, &shown, start..start + len, hold, (dt, self.input.period))?
            }
            _ => Vec::new(),
        };
        let report = Report {
            file: table.file().into(),
            format: table.format(),
            columns: table.width(),
            samples,
            window: window.map(|(start, len)| Window::of(start, len)),
            sampling: dt.zip(window).map(|(dt, (_, len))| Sampling::of(dt, len)),
            channels,
            scalars: table
                .scalars()
                .iter()
                .map(|(name, value)| Scalar { name: name.clone(), value: *value })
                .collect(),
            remarks,
            left_out,
        };
        Outcome::new(report.text(), &report)
    }

    /// Indices of the columns asked for, or of all that are more than a trailing delimiter.
    fn asked(&self, table: &Table) -> Result<Vec<usize>, CliError> {
        match self.columns.as_slice() {
            [] => Ok(table.filled_columns().collect()),
            named => Ok(named.iter().map(|c| table.find(c)).collect::<Result<_, _>>()?),
        }
    }

    /// The columns asked for, or those that are numbers and as long as most; how many samples they
    /// have; and what is wrong with the others.
    fn shown(
        &self,
        table: &Table,
        asked: &[usize],
        inventory: Inventory,
    ) -> Result<(Vec<Shown>, usize, Vec<String>), CliError> {
        let offset = |mean: f64| match self.input.detrend {
            Some(Detrend::Mean) => mean,
            _ => 0.0,
        };
        let (mut shown, mut len, mut left_out) = (Vec::new(), inventory.samples, Vec::new());
        for (&column, tally) in asked.iter().zip(inventory.columns) {
            match tally {
                Ok(tally) if !self.columns.is_empty() || tally.samples == inventory.samples => {
                    len = tally.samples;
                    shown.push(Shown { column, offset: offset(tally.mean) });
                }
                Ok(tally) => left_out.push(format!(
                    "column {} has {} samples, most have {}",
                    table.label(column),
                    tally.samples,
                    inventory.samples
                )),
                Err(reason) if !self.columns.is_empty() => return Err(reason.into()),
                Err(reason) => left_out.push(reason.to_string()),
            }
        }
        table.common_length(&self.columns)?;
        Ok((shown, len, left_out))
    }

    /// The time step, in s. A time axis that nobody asked for may be wrong: that is told, no error.
    fn step(
        &self,
        file: &RecordFile,
        time: Option<TimeAxis<'_>>,
        sampling: Option<Result<signal::Sampling, IoError>>,
        left_out: &mut Vec<String>,
    ) -> Result<Option<f64>, CliError> {
        let Some(time) = time else { return Ok(None) };
        let asked_for = self.input.time.is_some() || matches!(time, TimeAxis::RateHz(_));
        let sampling = match sampling {
            Some(sampling) if !file.is_whole() => sampling,
            // Of a text the beginning says it too, and other files bring more to compare.
            _ => file.head().sampling(&time, &self.columns),
        };
        match sampling {
            Ok(sampling) => Ok(Some(sampling.dt())),
            Err(reason) if asked_for => Err(reason.into()),
            Err(reason) => {
                left_out.push(format!("time axis: {reason}"));
                Ok(None)
            }
        }
    }
}

/// A column to show, and what is taken away from it.
#[derive(Debug, Clone, Copy)]
struct Shown {
    column: usize,
    offset: f64,
}

/// Which samples period and lines come from, if these are not all.
fn looked_at(file: &str, start: usize, len: usize, hold: usize) -> Option<String> {
    let (first, last, end) = (start + 1, start + hold, start + len);
    (hold < len).then(|| {
        format!(
            "period, mismatch and strongest lines looked at samples {first} to {last} of {file} \
             only; the levels count all samples up to {end}"
        )
    })
}

/// Measures the window of some columns, with the step and the period if they are known; of its
/// samples so many are looked at together.
fn channels(
    file: &RecordFile,
    shown: &[Shown],
    window: Range<usize>,
    hold: usize,
    (dt, period): (Option<f64>, Option<usize>),
) -> Result<Vec<Channel>, CliError> {
    // A text is read once for all columns; of what is held, one copy at a time is enough.
    let at_once = if file.is_whole() { 1 } else { shown.len() };
    let table = file.head();
    let mut channels = Vec::new();
    for together in shown.chunks(at_once) {
        let columns: Vec<usize> = together.iter().map(|s| s.column).collect();
        let mut gathered: Vec<Gathered> = columns.iter().map(|_| Gathered::default()).collect();
        file.blocks_at(&columns, window.clone(), HELD, HELD, &mut |block| {
            let values = block.as_slice().chunks(block.nrows());
            for ((gathered, shown), values) in gathered.iter_mut().zip(together).zip(values) {
                let values: Vec<f64> = values.iter().map(|v| v - shown.offset).collect();
                gathered.push(&values, hold)?;
            }
            Ok::<_, CliError>(())
        })?;
        for (column, gathered) in columns.into_iter().zip(gathered) {
            let (name, about) = (table.names()[column].clone(), table.about(column).into());
            channels.push(Channel::of(column + 1, name, about, gathered, dt, period)?);
        }
    }
    Ok(channels)
}
