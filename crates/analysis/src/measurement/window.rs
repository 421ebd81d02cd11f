//! The window of a record, and the part of it that is buffered in memory.

use std::ops::Range;
use std::sync::Arc;

use mechid_signal::Record;
use serde::{Deserialize, Serialize};

use super::channels::ABSENT;
use super::{Block, CHUNK_SAMPLES, IN_MEMORY_SAMPLES, Measurement, RecordSource};
use crate::AnalysisError;
use crate::limits::{OPEN_BYTES, OPEN_DOF, OPEN_DOF_BYTES, STRETCH_BYTES, WHOLE_BYTES};

/// Part of a record to use.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Window {
    /// First sample, counted from 1.
    pub start: usize,
    /// Number of samples in one period; `None`: all samples from `start` are one window.
    pub period: Option<usize>,
    /// Number of whole periods; `None`: as many as the record contains.
    pub periods: Option<usize>,
}

impl Default for Window {
    fn default() -> Self {
        Self { start: 1, period: None, periods: None }
    }
}

impl Window {
    /// Returns the first sample, counted from 0, and the number of samples of the window in a
    /// record `file` with `samples` samples.
    ///
    /// # Errors
    /// [`AnalysisError::Window`] if the window exceeds the record, [`AnalysisError::Setting`] for a
    /// period without samples.
    pub fn span(&self, file: &str, samples: usize) -> Result<(usize, usize), AnalysisError> {
        if self.period == Some(0) {
            let why = "a period needs at least one sample".into();
            return Err(AnalysisError::Setting { setting: "period", why });
        }
        let start = self.start.saturating_sub(1);
        let available = samples.saturating_sub(start);
        let period = self.period.unwrap_or(available);
        let periods = self.periods.unwrap_or(available.checked_div(period).unwrap_or(0)).max(1);
        let len = period.max(1).saturating_mul(periods);
        if len > available {
            return Err(AnalysisError::Window {
                file: file.into(),
                first: self.start,
                last: self.start.saturating_add(len - 1),
                len: samples,
            });
        }
        Ok((start, len))
    }
}

/// Part of a window that is buffered in memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hold {
    /// The whole window.
    Whole,
    /// Whole periods, at most [`IN_MEMORY_SAMPLES`] samples in total, but at least one period.
    Periods,
    /// The given number of samples, but at least [`IN_MEMORY_SAMPLES`].
    Samples(usize),
}

impl Hold {
    /// Returns the number of samples to buffer for a window of `len` samples with period `period`.
    fn samples(self, len: usize, period: usize) -> usize {
        let buffered = match self {
            Hold::Whole => len,
            Hold::Periods => period * (IN_MEMORY_SAMPLES / period).max(1),
            Hold::Samples(least) => least.max(IN_MEMORY_SAMPLES),
        };
        buffered.min(len)
    }

    /// Returns the memory, in bytes, for each buffered number.
    fn bytes(self) -> usize {
        match self {
            Hold::Whole => WHOLE_BYTES,
            Hold::Periods | Hold::Samples(_) => STRETCH_BYTES,
        }
    }
}

/// The window of a measurement. A window of any length can be processed in chunks from beginning to
/// end.
#[derive(Debug, Clone)]
pub struct Windowed {
    /// Buffered samples, beginning with the first.
    pub held: Block,
    source: Arc<RecordSource>,
    /// Range of the samples of the window in the record, counted from 0.
    window: Range<usize>,
}

impl Windowed {
    pub(super) fn new(measurement: &Measurement, hold: Hold) -> Result<Self, AnalysisError> {
        measurement.source().channels.check_pairs()?;
        Self::from_any_layout(measurement, hold)
    }

    /// Reads a window in which forces and responses may belong to different degrees of freedom.
    pub(super) fn from_any_layout(
        measurement: &Measurement,
        hold: Hold,
    ) -> Result<Self, AnalysisError> {
        let source = Arc::clone(measurement.source());
        let (start, len) = measurement.span()?;
        let period = measurement.window_settings().period.unwrap_or(len);
        let samples = hold.samples(len, period);
        source.check_memory(samples, hold.bytes())?;
        let mut first = None;
        source.blocks(start..start + samples, samples, samples, &mut |block| {
            first = Some(source.sorted(&block, start + 1)?);
            Ok(())
        })?;
        let Some(mut held) = first else {
            let (file, first, last) = (source.name.clone(), start + 1, start + len);
            return Err(AnalysisError::Window { file, first, last, len: source.sampling.len() });
        };
        (held.period, held.periods) = (period, len / period);
        held.driven = driven(&source, &held);
        if held.driven.is_empty() {
            let columns = source.channels.force.join(", ");
            return Err(AnalysisError::ZeroForce { file: source.name.clone(), columns });
        }
        Ok(Self { held, source, window: start..start + len })
    }

    /// Returns the number of samples in the window, whether buffered or not.
    pub(crate) fn samples(&self) -> usize {
        self.window.len()
    }

    /// Refuses a computation on the noise of `lines` spectral lines if it needs too much memory.
    ///
    /// # Errors
    /// [`AnalysisError::Memory`].
    pub(crate) fn check_spectra(&self, lines: usize) -> Result<(), AnalysisError> {
        self.source.check_spectra(lines)
    }

    /// Returns an error if the fit of the transients needs too much memory, for all `records` from
    /// the same file together.
    ///
    /// # Errors
    /// [`AnalysisError::Memory`].
    pub(crate) fn check_transients(&self, records: &[Self]) -> Result<(), AnalysisError> {
        let same = records.iter().filter(|record| Arc::ptr_eq(&record.source, &self.source));
        let samples = same.map(|record| record.held.force.len()).sum();
        let dof = self.held.force.channels().min(OPEN_DOF);
        self.source.check_memory(samples, OPEN_BYTES.max(OPEN_DOF_BYTES * dof))
    }

    /// Returns the buffered samples and drops the rest.
    pub fn into_held(self) -> Block {
        self.held
    }

    /// Returns a range of samples, counted from the first, of a fully buffered window, with `force`
    /// in place of the measured force.
    ///
    /// # Errors
    /// [`AnalysisError::Signal`] if the range exceeds the window.
    pub(crate) fn part(&self, samples: Range<usize>, force: Record) -> Result<Self, AnalysisError> {
        let buffered = &self.held;
        let part = |record: &Option<Record>| {
            record.as_ref().map(|r| r.window(samples.start, samples.len())).transpose()
        };
        let block = Block {
            displacement: part(&buffered.displacement)?,
            velocity: part(&buffered.velocity)?,
            acceleration: part(&buffered.acceleration)?,
            first_sample: buffered.first_sample + samples.start,
            period: samples.len(),
            periods: 1,
            force,
            file: buffered.file.clone(),
            driven: buffered.driven.clone(),
            unit_remarks: buffered.unit_remarks.clone(),
            unit_findings: buffered.unit_findings.clone(),
            names: Arc::clone(&buffered.names),
        };
        let start = self.window.start;
        let window = start + samples.start..start + samples.end;
        Ok(Self { held: block, source: Arc::clone(&self.source), window })
    }

    /// Returns the number of samples to process at a time: the whole window if it is buffered.
    pub(crate) fn at_once(&self) -> usize {
        match self.held.held_to() {
            None => self.held.force.len().max(CHUNK_SAMPLES),
            Some(_) => CHUNK_SAMPLES,
        }
    }

    /// Passes the window to `take` in chunks of `samples` samples. Each chunk begins `advance`
    /// samples after the previous one; the last may be shorter. A buffered window that fits into
    /// one chunk is not read again.
    pub(crate) fn chunks(
        &self,
        samples: usize,
        advance: usize,
        take: &mut dyn FnMut(&Block) -> Result<(), AnalysisError>,
    ) -> Result<(), AnalysisError> {
        if self.held.held_to().is_none() && self.held.force.len() <= samples {
            return take(&self.held);
        }
        let mut first = self.held.first_sample;
        self.source.blocks(self.window.clone(), samples, advance, &mut |block| {
            let chunk = self.source.sorted(&block, first)?;
            first += advance;
            take(&chunk)
        })
    }
}

/// Returns the degrees of freedom whose force is not zero throughout.
fn driven(source: &RecordSource, held: &Block) -> Vec<usize> {
    let mut peaks = source.peaks.iter();
    let acts = |(dof, column): (usize, &String)| {
        let peak = if column == ABSENT { None } else { peaks.next() };
        let acts = held.force.channel(dof).iter().any(|f| *f != 0.0);
        let beyond = held.held_to().is_some() && peak.is_some_and(|peak| *peak > 0.0);
        (acts || beyond).then_some(dof)
    };
    source.channels.force.iter().enumerate().filter_map(acts).collect()
}
