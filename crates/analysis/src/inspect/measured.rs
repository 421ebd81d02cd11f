//! The columns of a window, gone through once.

use mechid_io::{RecordFile, Unit};
use mechid_signal::SignalError;
use rayon::prelude::*;

use super::channel::{AmplitudeSpectrum, Channel, Gathered, Measured};
use crate::AnalysisError;
use crate::extremes::Extremes;
use crate::limits::{INSPECT_BYTES, check_memory};
use crate::measurement::IN_MEMORY_SAMPLES;

/// A column to show, and what is taken away from it.
#[derive(Debug, Clone, Copy)]
pub struct Shown {
    /// Place among the columns asked for, counted from 0.
    pub place: usize,
    pub column: usize,
    pub offset: f64,
    /// Whether lines and period are looked for, which bare instants do not have.
    pub spectral: bool,
    /// Whether it is in the picture, too.
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
    /// Counted from 0.
    pub start: usize,
    pub len: usize,
    /// Number of them, from the first on, that are looked at together.
    pub hold: usize,
}

impl Span {
    /// Start and length of a window of this file.
    pub fn of((start, len): (usize, usize), file: &RecordFile) -> Self {
        Self { start, len, hold: if file.is_whole() { len } else { len.min(IN_MEMORY_SAMPLES) } }
    }

    /// First and last of the samples that period and lines come from, counted from 1, if these are
    /// not all.
    pub fn held(self) -> Option<(usize, usize)> {
        (self.hold < self.len).then_some((self.start + 1, self.start + self.hold))
    }

    /// The same, in words.
    pub fn looked_at(self, file: &str) -> Option<String> {
        let end = self.start + self.len;
        self.held().map(|(first, last)| {
            format!(
                "period, mismatch and strongest lines looked at samples {first} to {last} of {file} \
                 only; the levels count all samples up to {end}"
            )
        })
    }
}

/// Statistics of the columns asked for, gathered while a text is read to its end.
#[derive(Debug)]
pub struct OnTheWay {
    /// First sample of the window, counted from 0.
    start: usize,
    /// Most samples to hold of each column.
    hold: Vec<usize>,
    gathered: Vec<Result<Gathered, SignalError>>,
}

impl OnTheWay {
    /// Begins without a sample, with the samples to hold of each column.
    pub fn new(start: usize, hold: Vec<usize>) -> Self {
        let gathered = hold.iter().map(|_| Ok(Gathered::default())).collect();
        Self { start, hold, gathered }
    }

    /// Takes the samples of a column from `first` on, those before the window too.
    pub fn push(&mut self, column: usize, first: usize, values: &[f64]) {
        let values = &values[self.start.saturating_sub(first).min(values.len())..];
        let gathered = &mut self.gathered[column];
        if let Ok(Err(error)) = gathered.as_mut().map(|g| g.push(values, self.hold[column])) {
            *gathered = Err(error);
        }
    }

    /// The columns shown, by their places among those asked for.
    fn of(self, places: impl Iterator<Item = usize>) -> Result<Vec<Gathered>, SignalError> {
        let mut all: Vec<_> = self.gathered.into_iter().map(Some).collect();
        places.filter_map(|place| all[place].take()).collect()
    }
}

/// Measures the window of some columns, with the step and the period if they are known; of those to
/// be drawn what a picture shows, too.
pub fn measured(
    file: &RecordFile,
    shown: &[Shown],
    on_the_way: Option<OnTheWay>,
    window: Span,
    dt: Option<f64>,
    period: Option<usize>,
) -> Result<(Vec<Channel>, Vec<Drawn>), AnalysisError> {
    let held = window.hold.saturating_mul(shown.len());
    check_memory(file.head().file(), held, INSPECT_BYTES, file.memory())?;
    // A text is read once for all columns; of what is held, a copy for each thread is enough.
    let at_once = if file.is_whole() { rayon::current_num_threads() } else { shown.len() };
    let table = file.head();
    let (mut channels, mut drawn) = (Vec::new(), Vec::new());
    let mut on_the_way = on_the_way;
    for together in shown.chunks(at_once) {
        let gathered = match on_the_way.take() {
            Some(on_the_way) => on_the_way.of(together.iter().map(|shown| shown.place))?,
            None => gathered(file, together, window)?,
        };
        let of_columns = together.par_iter().zip(gathered).map(|(shown, gathered)| {
            let column = shown.column;
            let (name, about) = (table.names()[column].clone(), table.about(column).into());
            Measured::of(column + 1, name, about, gathered, dt, period)
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

/// Goes through the window of some columns.
fn gathered(
    file: &RecordFile,
    together: &[Shown],
    window: Span,
) -> Result<Vec<Gathered>, AnalysisError> {
    let columns: Vec<usize> = together.iter().map(|s| s.column).collect();
    let mut gathered: Vec<Gathered> =
        together.iter().map(|s| Gathered::of(window.len, s.drawn)).collect();
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
