//! The window of a record, and how much of it is held in memory.

use std::ops::Range;
use std::sync::Arc;

use mechid_signal::Record;
use serde::{Deserialize, Serialize};

use super::channels::ABSENT;
use super::{Block, CHUNK_SAMPLES, IN_MEMORY_SAMPLES, Measurement, RecordSource};
use crate::AnalysisError;
use crate::limits::{STRETCH_BYTES, WHOLE_BYTES};

/// Part of a record to use.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Window {
    /// First sample, counted from 1.
    pub start: usize,
    /// Number of samples in one period; `None`: all samples from `start` on are one window.
    pub period: Option<usize>,
    /// Number of whole periods; `None`: as many as there are.
    pub periods: Option<usize>,
}

impl Default for Window {
    fn default() -> Self {
        Self { start: 1, period: None, periods: None }
    }
}

impl Window {
    /// Returns the first sample, counted from 0, and the number of samples of the window into a
    /// record of `samples` samples called `file`.
    ///
    /// # Errors
    /// [`AnalysisError::Window`] if the record does not have all of them,
    /// [`AnalysisError::Setting`] for a period of no sample.
    pub fn span(&self, file: &str, samples: usize) -> Result<(usize, usize), AnalysisError> {
        if self.period == Some(0) {
            let why = "a period has one sample or more, not 0".into();
            return Err(AnalysisError::Setting { setting: "period", why });
        }
        let start = self.start.saturating_sub(1);
        let rest = samples.saturating_sub(start);
        let period = self.period.unwrap_or(rest);
        let periods = self.periods.unwrap_or(rest.checked_div(period).unwrap_or(0)).max(1);
        let len = period.max(1).saturating_mul(periods);
        if len > rest {
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

/// Amount of a window that is held in memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hold {
    /// All of it.
    Whole,
    /// Number of whole periods that [`IN_MEMORY_SAMPLES`] samples have, one at least.
    Periods,
    /// [`IN_MEMORY_SAMPLES`] samples, or this number if it is larger.
    Samples(usize),
}

impl Hold {
    /// Number of samples to keep in memory for a window of `len` samples with period `period`.
    fn samples(self, len: usize, period: usize) -> usize {
        let held = match self {
            Hold::Whole => len,
            Hold::Periods => period * (IN_MEMORY_SAMPLES / period).max(1),
            Hold::Samples(least) => least.max(IN_MEMORY_SAMPLES),
        };
        held.min(len)
    }

    /// Bytes of memory for each number that is held.
    fn bytes(self) -> usize {
        match self {
            Hold::Whole => WHOLE_BYTES,
            Hold::Periods | Hold::Samples(_) => STRETCH_BYTES,
        }
    }
}

/// The window of a measurement, which can be gone through from beginning to end, however long it
/// is.
#[derive(Debug, Clone)]
pub struct Windowed {
    /// Samples held in memory, from the first one on.
    pub held: Block,
    source: Arc<RecordSource>,
    /// Samples, counted from 0.
    window: Range<usize>,
}

impl Windowed {
    pub(super) fn new(measurement: &Measurement, hold: Hold) -> Result<Self, AnalysisError> {
        measurement.source().channels.check_pairs()?;
        Self::of_any_layout(measurement, hold)
    }

    /// Reads a window whose forces and responses need not belong to the same degrees of freedom.
    pub(super) fn of_any_layout(
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

    /// Number of samples in the window, held or not.
    pub(crate) fn samples(&self) -> usize {
        self.window.len()
    }

    /// Refuses work on the noise of so many spectral lines that takes too much memory.
    ///
    /// # Errors
    /// [`AnalysisError::Memory`].
    pub(crate) fn check_spectra(&self, lines: usize) -> Result<(), AnalysisError> {
        self.source.check_spectra(lines)
    }

    /// Returns the samples held in memory and drops the rest.
    pub fn into_held(self) -> Block {
        self.held
    }

    /// Returns some samples of a window that is held as a whole, counted from its first, under
    /// another force.
    ///
    /// # Errors
    /// [`AnalysisError::Signal`] if the window does not have them.
    pub(crate) fn part(&self, samples: Range<usize>, force: Record) -> Result<Self, AnalysisError> {
        let held = &self.held;
        let part = |record: &Option<Record>| {
            record.as_ref().map(|r| r.window(samples.start, samples.len())).transpose()
        };
        let held = Block {
            displacement: part(&held.displacement)?,
            velocity: part(&held.velocity)?,
            acceleration: part(&held.acceleration)?,
            first_sample: held.first_sample + samples.start,
            period: samples.len(),
            periods: 1,
            force,
            file: held.file.clone(),
            driven: held.driven.clone(),
            unit_remarks: held.unit_remarks.clone(),
            unit_findings: held.unit_findings.clone(),
            names: Arc::clone(&held.names),
        };
        let start = self.window.start;
        let window = start + samples.start..start + samples.end;
        Ok(Self { held, source: Arc::clone(&self.source), window })
    }

    /// Returns how many samples to take at a time: all of a window that is held.
    pub(crate) fn at_once(&self) -> usize {
        match self.held.held_to() {
            None => self.held.force.len().max(CHUNK_SAMPLES),
            Some(_) => CHUNK_SAMPLES,
        }
    }

    /// Passes the window to `take` in chunks of `samples` samples, each beginning `advance` samples
    /// after the one before; the last may be shorter. A window that is held and fits into one chunk
    /// is not read again.
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
        let seen = held.force.channel(dof).iter().any(|f| *f != 0.0);
        let beyond = held.held_to().is_some() && peak.is_some_and(|peak| *peak > 0.0);
        (seen || beyond).then_some(dof)
    };
    source.channels.force.iter().enumerate().filter_map(acts).collect()
}
