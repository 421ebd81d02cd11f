//! Columns of a window, measured in one pass.

use mechid_io::{RecordFile, Unit};
use mechid_signal::SignalError;
use rayon::prelude::*;

use super::channel::{AmplitudeSpectrum, Channel, Gathered, Measured};
use crate::AnalysisError;
use crate::extremes::Extremes;
use crate::limits::{INSPECT_BYTES, check_memory};
use crate::measurement::IN_MEMORY_SAMPLES;

/// A column to show, and the constant to subtract.
#[derive(Debug, Clone, Copy)]
pub struct Shown {
    /// Index among the requested columns, counted from 0.
    pub index: usize,
    pub column: usize,
    pub offset: f64,
    /// `true` if spectral lines and a period are detected in this column; `false` for a column of
    /// times that was not requested.
    pub spectral: bool,
    /// `true` if the column is also plotted.
    pub drawn: bool,
}

/// Curves of a column.
#[derive(Debug)]
pub struct Drawn {
    /// Name.
    pub name: String,
    /// SI unit.
    pub unit: Option<Unit>,
    /// First sample of the window, counted from 0.
    pub start: usize,
    /// Extreme values over time.
    pub extremes: Extremes,
    /// Amplitude spectrum.
    pub lines: AmplitudeSpectrum,
}

/// The samples of a window.
#[derive(Debug, Clone, Copy)]
pub struct Span {
    /// First sample, counted from 0.
    pub start: usize,
    pub len: usize,
    /// Number of samples, beginning with the first, that are analysed together.
    pub hold: usize,
}

impl Span {
    /// Creates the window of a file from its start and length.
    pub fn new((start, len): (usize, usize), file: &RecordFile) -> Self {
        Self { start, len, hold: if file.is_whole() { len } else { len.min(IN_MEMORY_SAMPLES) } }
    }

    /// Returns the first and the last sample used for period and lines, counted from 1; `None` if
    /// all are used.
    pub fn held(self) -> Option<(usize, usize)> {
        (self.hold < self.len).then_some((self.start + 1, self.start + self.hold))
    }

    /// Returns a sentence that states which samples were used for period and lines; `None` if all
    /// samples were used.
    pub fn spectral_samples_text(self, file: &str) -> Option<String> {
        let end = self.start + self.len;
        self.held().map(|(first, last)| {
            format!(
                "period, mismatch and strongest lines were computed from samples {first} to {last} of {file} \
                 only; the levels are those of all samples up to {end}"
            )
        })
    }
}

/// Statistics of the requested columns, computed while a text is read to its end.
#[derive(Debug)]
pub struct ReadingStatistics {
    /// First sample of the window, counted from 0.
    start: usize,
    /// Maximum number of samples to store of each column.
    hold: Vec<usize>,
    gathered: Vec<Result<Gathered, SignalError>>,
}

impl ReadingStatistics {
    /// Creates empty statistics, with the number of samples to store of each column.
    pub fn new(start: usize, hold: Vec<usize>) -> Self {
        let gathered = hold.iter().map(|_| Ok(Gathered::default())).collect();
        Self { start, hold, gathered }
    }

    /// Adds the samples of a column, beginning with sample `first`; samples before the window are
    /// accepted, too.
    pub fn push(&mut self, column: usize, first: usize, values: &[f64]) {
        let values = &values[self.start.saturating_sub(first).min(values.len())..];
        let gathered = &mut self.gathered[column];
        if let Ok(Err(error)) = gathered.as_mut().map(|g| g.push(values, self.hold[column])) {
            *gathered = Err(error);
        }
    }

    /// Returns the statistics of the shown columns, by their indices among the requested ones.
    fn statistics(
        self,
        indices: impl Iterator<Item = usize>,
    ) -> Result<Vec<Gathered>, SignalError> {
        let mut columns: Vec<_> = self.gathered.into_iter().map(Some).collect();
        indices.filter_map(|index| columns[index].take()).collect()
    }
}

/// Measures the window of some columns; time step and period may be known. Plotted columns also get
/// their curves.
pub fn measured(
    file: &RecordFile,
    shown: &[Shown],
    while_reading: Option<ReadingStatistics>,
    window: Span,
    dt: Option<f64>,
    period: Option<usize>,
) -> Result<(Vec<Channel>, Vec<Drawn>), AnalysisError> {
    let stored = window.hold.saturating_mul(shown.len());
    check_memory(file.head().file(), stored, INSPECT_BYTES, file.memory())?;
    // A text file is read once for all columns together. Columns in memory are copied in groups of
    // one column per thread.
    let at_once = if file.is_whole() { rayon::current_num_threads() } else { shown.len() };
    let table = file.head();
    let (mut channels, mut drawn) = (Vec::new(), Vec::new());
    let mut while_reading = while_reading;
    for together in shown.chunks(at_once) {
        let gathered = match while_reading.take() {
            Some(while_reading) => {
                while_reading.statistics(together.iter().map(|shown| shown.index))?
            }
            None => gathered(file, together, window)?,
        };
        let of_columns = together.par_iter().zip(gathered).map(|(shown, gathered)| {
            let column = shown.column;
            let (name, about) = (table.names()[column].clone(), table.about(column).into());
            Measured::new(column + 1, name, about, gathered, dt, period)
        });
        let of_columns: Vec<_> = of_columns.collect::<Result<_, _>>()?;
        for (shown, Measured { channel, lines, extremes }) in together.iter().zip(of_columns) {
            drawn.extend(extremes.map(|extremes| Drawn {
                name: channel.title(),
                unit: table.unit(shown.column),
                start: window.start,
                extremes,
                lines,
            }));
            channels.push(channel);
        }
    }
    Ok((channels, drawn))
}

/// Reads the window of some columns in one pass.
fn gathered(
    file: &RecordFile,
    together: &[Shown],
    window: Span,
) -> Result<Vec<Gathered>, AnalysisError> {
    let columns: Vec<usize> = together.iter().map(|s| s.column).collect();
    let mut gathered: Vec<Gathered> =
        together.iter().map(|s| Gathered::new(window.len, s.drawn)).collect();
    let samples = window.start..window.start + window.len;
    file.blocks_at(&columns, samples, IN_MEMORY_SAMPLES, IN_MEMORY_SAMPLES, &mut |block| {
        let values = block.as_slice().chunks(block.nrows());
        for ((gathered, shown), values) in gathered.iter_mut().zip(together).zip(values) {
            let values: Vec<f64> = values.iter().map(|v| v - shown.offset).collect();
            gathered.push(&values, if shown.spectral { window.hold } else { 0 })?;
        }
        Ok::<_, AnalysisError>(())
    })?;
    Ok(gathered)
}
