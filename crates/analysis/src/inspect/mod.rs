//! Inspection of a record: format, columns, sampling, levels, strongest lines, period.

pub mod channel;
mod measured;
pub mod summary;

use std::fmt;
use std::path::Path;

use mechid_io::{Inventory, IoError, RecordFile, Table, TimeAxis, escaped};
use mechid_signal::{self as signal, message};
use serde::{Deserialize, Serialize, Serializer};

pub use self::measured::Drawn;
use self::measured::{ReadingStatistics, Shown, Span, measured};
pub use self::summary::RecordSummary;
use crate::AnalysisError;
use crate::measurement::units::{contradicted_rate, doubtful_time, doubtful_unit};
use crate::measurement::{Detrend, IN_MEMORY_SAMPLES, Reading, Window};

/// Maximum number of plotted columns.
pub const DRAWN_COLUMNS: usize = 8;

/// Settings of an inspection.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct InspectSettings {
    /// Columns to show, by name or number; empty: every column that contains only numbers.
    pub columns: Vec<String>,
    /// `true` to compute the curves of a plot, for the first [`DRAWN_COLUMNS`] columns.
    pub curves: bool,
}

/// Result of an inspection: columns, time axis and contents of a record.
///
/// [`Display`](fmt::Display) formats the result for a reader, `serde` for programs.
#[derive(Debug)]
pub struct Inspected {
    summary: RecordSummary,
    drawn: Vec<Drawn>,
    held: Option<(usize, usize)>,
    dt: Option<f64>,
}

/// Inspects a record file.
///
/// For a long text, the levels include all samples of the window; period and spectral lines come
/// from its first [`IN_MEMORY_SAMPLES`] samples.
///
/// # Errors
/// [`AnalysisError::Io`] if the file cannot be read or has no such columns,
/// [`AnalysisError::Window`] if the window exceeds the record.
pub fn inspect(
    path: impl AsRef<Path>,
    reading: &Reading,
    window: &Window,
    how: &InspectSettings,
) -> Result<Inspected, AnalysisError> {
    Inspection { reading, window, columns: &how.columns, how }.run(path.as_ref())
}

impl Inspected {
    /// Returns the summary of the record: numbers and remarks.
    pub fn summary(&self) -> &RecordSummary {
        &self.summary
    }

    /// Returns the curves of a plot; empty unless requested.
    pub fn drawn(&self) -> &[Drawn] {
        &self.drawn
    }

    /// Returns the first and the last sample used for period and lines, counted from 1; `None` if
    /// all are used.
    pub fn spectral_samples(&self) -> Option<(usize, usize)> {
        self.held
    }

    /// Returns the time step, in s; `None` without a time axis.
    pub fn dt(&self) -> Option<f64> {
        self.dt
    }
}

impl fmt::Display for Inspected {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.summary.fmt(f)
    }
}

impl Serialize for Inspected {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.summary.serialize(serializer)
    }
}

/// Returns the name and value of the number in the file that states the time axis, such as `Fs =
/// 25600`; `None` if the time axis has another source.
fn stated_by(table: &Table, time: &TimeAxis<'_>) -> Option<String> {
    let (name, value) = table.stated_rate().filter(|_| *time == TimeAxis::OfFile)?;
    Some(format!("{} = {}", escaped(name), message::number(*value)))
}

/// An inspection before its computation.
struct Inspection<'a> {
    reading: &'a Reading,
    window: &'a Window,
    columns: &'a [String],
    how: &'a InspectSettings,
}

impl Inspection<'_> {
    /// Reads the record and measures each of its columns.
    fn run(&self, path: &Path) -> Result<Inspected, AnalysisError> {
        let file = self.reading.open(path, IN_MEMORY_SAMPLES)?;
        let table = file.head();
        let time = self.reading.time_axis(table);
        let instants = match time {
            Some(TimeAxis::Column(name)) => table.find(name).ok(),
            _ => None,
        };
        let asked = self.asked(table)?;
        let mut while_reading = self.while_reading(&file, &asked, instants);
        let mut inventory = file.inventory(&asked, instants, &mut |column, first, values| {
            if let Some(gathered) = &mut while_reading {
                gathered.push(column, first, values);
            }
        })?;
        let (samples, open_line) = (inventory.samples, inventory.open_line);
        let sampling = inventory.sampling.take();
        let of_file = std::mem::take(&mut inventory.remarks);
        let (mut shown, len, mut left_out) = self.shown(table, &asked, instants, inventory)?;
        let dt = self.step(&file, time, sampling, &mut left_out)?;
        let window = match len {
            0 => None,
            len => Some(Span::new(self.window.span(table.file(), len)?, &file)),
        };
        let sampling = dt.zip(time.map(|time| stated_by(table, &time)));
        let mut summary =
            RecordSummary::begin(table, samples, window, sampling, left_out, self.how);
        summary.remarks.extend(of_file);
        summary.remarks.extend(dt.zip(time).and_then(|(dt, time)| {
            let sampling = signal::Sampling::new(dt, samples).ok()?;
            doubtful_time(table, &time, sampling).map(|finding| finding.to_string())
        }));
        summary.remarks.extend(contradicted_rate(table, self.reading));
        let signals = asked.iter().filter(|column| Some(**column) != instants);
        summary.remarks.extend(signals.filter_map(|column| doubtful_unit(table, *column)));
        let mut drawn = Vec::new();
        if let (Some(window), false) = (window, shown.is_empty()) {
            summary.remarks.extend(window.spectral_samples_text(table.file()));
            summary.remarks.extend(self.choose_drawn(table, &mut shown));
            let period = self.window.period;
            (summary.channels, drawn) = measured(&file, &shown, while_reading, window, dt, period)?;
        }
        summary.remarks.extend(open_line.map(|line| {
            format!(
                "the last line, {line}, has no line break: the file may be cut off there, and its last number may \
                 be incomplete"
            )
        }));
        Ok(Inspected { summary, drawn, held: window.and_then(Span::held), dt })
    }

    /// Measures the columns of a text file while its samples are counted, so that the file is read
    /// only once. This requires that the window ends with the record, and that neither the length
    /// of the record nor a mean is needed beforehand.
    fn while_reading(
        &self,
        file: &RecordFile,
        asked: &[usize],
        instants: Option<usize>,
    ) -> Option<ReadingStatistics> {
        let to_the_end = self.window.period.is_none() && self.window.periods.is_none();
        let at_once = to_the_end && self.reading.detrend == Detrend::None && !self.how.curves;
        (at_once && !file.is_whole()).then(|| {
            let hold = |column: &usize| {
                if self.is_signal(*column, instants) { IN_MEMORY_SAMPLES } else { 0 }
            };
            ReadingStatistics::new(
                self.window.start.saturating_sub(1),
                asked.iter().map(hold).collect(),
            )
        })
    }

    /// Returns whether the period and the spectral lines of a column are detected: yes for every
    /// requested column; without requested columns, yes for every column except `instants`, the
    /// column of the times.
    fn is_signal(&self, column: usize, instants: Option<usize>) -> bool {
        !self.columns.is_empty() || Some(column) != instants
    }

    /// Selects the plotted columns, and returns a remark on the other columns.
    fn choose_drawn(&self, table: &Table, shown: &mut [Shown]) -> Option<String> {
        if !self.how.curves {
            return None;
        }
        let mut wanted = shown.iter_mut().filter(|s| s.spectral);
        wanted.by_ref().take(DRAWN_COLUMNS).for_each(|s| s.drawn = true);
        let omitted: Vec<String> = wanted.map(|s| table.label(s.column)).collect();
        (!omitted.is_empty()).then(|| {
            format!(
                "the picture shows {DRAWN_COLUMNS} columns; to draw others, choose them with `columns`: {}",
                omitted.join(", ")
            )
        })
    }

    /// Returns the indices of the requested columns; by default, of all columns except an empty
    /// column after a trailing delimiter.
    fn asked(&self, table: &Table) -> Result<Vec<usize>, AnalysisError> {
        match self.columns {
            [] => Ok(table.filled_columns().collect()),
            named => Ok(named.iter().map(|c| table.find(c)).collect::<Result<_, _>>()?),
        }
    }

    /// Returns three results: the requested columns or, by default, the numeric columns that have
    /// the most common length; the number of samples of these columns; and the reasons why the
    /// other columns are omitted.
    fn shown(
        &self,
        table: &Table,
        asked: &[usize],
        instants: Option<usize>,
        inventory: Inventory,
    ) -> Result<(Vec<Shown>, usize, Vec<String>), AnalysisError> {
        let offset = |mean: f64| match self.reading.detrend {
            Detrend::Mean => mean,
            Detrend::None => 0.0,
        };
        let (mut shown, mut len, mut left_out) = (Vec::new(), inventory.samples, Vec::new());
        for (index, (&column, tally)) in asked.iter().zip(inventory.columns).enumerate() {
            match tally {
                Ok(tally) if !self.columns.is_empty() || tally.samples == inventory.samples => {
                    len = tally.samples;
                    let (offset, spectral) = (offset(tally.mean), self.is_signal(column, instants));
                    shown.push(Shown { index, column, offset, spectral, drawn: false });
                }
                Ok(tally) => left_out.push(format!(
                    "column {} has {}, but most columns have {}",
                    table.label(column),
                    message::count(tally.samples, "sample"),
                    inventory.samples
                )),
                Err(reason) if !self.columns.is_empty() => return Err(reason.into()),
                Err(reason) => left_out.push(reason.to_string()),
            }
        }
        table.common_length(self.columns)?;
        Ok((shown, len, left_out))
    }

    /// Returns the time step, in s. If the step of a default time axis cannot be determined, the
    /// step is `None`, with a remark.
    fn step(
        &self,
        file: &RecordFile,
        time: Option<TimeAxis<'_>>,
        sampling: Option<Result<signal::Sampling, IoError>>,
        left_out: &mut Vec<String>,
    ) -> Result<Option<f64>, AnalysisError> {
        let Some(time) = time else { return Ok(None) };
        let asked_for = self.reading.time.is_some() || matches!(time, TimeAxis::RateHz(_));
        let sampling = match sampling {
            Some(sampling) if !file.is_whole() => sampling,
            // `head` of a text file is its beginning, which is enough for the time step. `head` of
            // any other file has all samples, so the time step is more reliable.
            _ => file.head().sampling(&time, self.columns),
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
