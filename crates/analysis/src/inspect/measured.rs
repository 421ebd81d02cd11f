//! The columns of a window, gone through once.

use mechid_io::{RecordFile, Unit};

use super::channel::{AmplitudeSpectrum, Channel, Gathered, Measured};
use crate::AnalysisError;
use crate::extremes::Extremes;
use crate::measurement::IN_MEMORY_SAMPLES;

/// A column to show, and what is taken away from it.
#[derive(Debug, Clone, Copy)]
pub struct Shown {
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

/// Measures the window of some columns, with the step and the period if they are known; of those to
/// be drawn what a picture shows, too.
pub fn measured(
    file: &RecordFile,
    shown: &[Shown],
    window: Span,
    dt: Option<f64>,
    period: Option<usize>,
) -> Result<(Vec<Channel>, Vec<Drawn>), AnalysisError> {
    // A text is read once for all columns; of what is held, one copy at a time is enough.
    let at_once = if file.is_whole() { 1 } else { shown.len() };
    let table = file.head();
    let (mut channels, mut drawn) = (Vec::new(), Vec::new());
    for together in shown.chunks(at_once) {
        let gathered = gathered(file, together, window)?;
        for (column, gathered) in together.iter().map(|s| s.column).zip(gathered) {
            let (name, about) = (table.names()[column].clone(), table.about(column).into());
            let Measured { channel, lines, extremes } =
                Measured::of(column + 1, name, about, gathered, dt, period)?;
            drawn.extend(extremes.map(|extremes| Drawn {
                name: channel.title(),
                unit: table.unit(column),
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
