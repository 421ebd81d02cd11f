//! `mechid info`: what is in a record.

mod channel;
mod measured;
mod picture;
mod report;

use clap::Args;
use mechid::io::{Inventory, IoError, RecordFile, Table, TimeAxis};
use mechid::signal::{self, counted};

use self::measured::{Shown, Span, measured};
use self::report::Report;
use super::identify::measurement::HELD;
use crate::error::CliError;
use crate::options::{Detrend, PlotArgs, RecordArgs, ReportArgs};
use crate::outcome::Outcome;
use crate::units::doubtful_time;

/// Show what is in a record: format, columns, sampling, levels, strongest lines, period
///
/// For every channel: mean, RMS and peak value in its own unit, the crest factor, the strongest
/// lines of its spectrum with their amplitudes, and the period, in samples, if it repeats. The
/// spectrum is that of whole periods where the channel repeats or --period says so, otherwise of the
/// window weighted by a Hann window. Of a text of more than 262144 rows, only the levels are those
/// of all samples of the window: lines and period are those of its first 262144 samples.
///
/// The picture shows columns over time, all of the window, beside their spectra, of the mean period
/// where there is one: the first eight. The column of time has a spectrum only if --columns asks for
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
    plot: PlotArgs,
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
        let (samples, open_line) = (inventory.samples, inventory.open_line);
        let sampling = inventory.sampling.take();
        let (mut shown, len, mut left_out) = self.shown(table, &asked, instants, inventory)?;
        let dt = self.step(&file, time, sampling, &mut left_out)?;
        let window = match len {
            0 => None,
            len => Some(Span::of(self.input.span(table.file(), len)?, &file)),
        };
        let mut report = Report::begin(table, samples, window, dt, left_out);
        report.remarks.extend(dt.zip(time).and_then(|(dt, time)| {
            doubtful_time(table, &time, signal::Sampling::new(dt, samples).ok()?)
        }));
        let mut drawn = Vec::new();
        if let (Some(window), false) = (window, shown.is_empty()) {
            report.remarks.extend(window.looked_at(table.file()));
            report.remarks.extend(self.choose_drawn(table, &mut shown));
            (report.channels, drawn) = measured(&file, &shown, window, (dt, self.input.period))?;
        }
        report.remarks.extend(open_line.map(|line| {
            format!(
                "line {line} is the last and no line break ends it: if the file was cut off there, so \
                 may be its last number"
            )
        }));
        let title = || picture::title(table.file(), window);
        Outcome::new(report.text(), &report)?
            .with_plot(&self.plot, || picture::figure(table.file(), &title(), &drawn, dt))
    }

    /// Says which columns are drawn, and returns what is to be told of the others.
    fn choose_drawn(&self, table: &Table, shown: &mut [Shown]) -> Option<String> {
        let path = self.plot.plot.as_ref()?;
        let mut wanted = shown.iter_mut().filter(|s| s.spectral);
        wanted.by_ref().take(picture::COLUMNS).for_each(|s| s.drawn = true);
        let others: Vec<String> = wanted.map(|s| table.label(s.column)).collect();
        (!others.is_empty()).then(|| {
            format!(
                "{} shows {} columns; not drawn, unless --columns chooses them: {}",
                path.display(),
                picture::COLUMNS,
                others.join(", ")
            )
        })
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
        instants: Option<usize>,
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
                    // Instants are no signal.
                    let spectral = !self.columns.is_empty() || Some(column) != instants;
                    let offset = offset(tally.mean);
                    shown.push(Shown { column, offset, spectral, drawn: false });
                }
                Ok(tally) => left_out.push(format!(
                    "column {} has {}, most have {}",
                    table.label(column),
                    counted(tally.samples, "sample"),
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
