//! Levels, histories and mean period of all samples of a window, gathered in one pass.

use std::sync::Arc;

use mechid_signal::{Record, RunningStatistics, Sampling};
use nalgebra::DMatrix;

use crate::AnalysisError;
use crate::extremes::Extremes;
use crate::measurement::{Block, CHUNK_SAMPLES, Windowed};

/// Statistics of all samples of a window.
pub struct Whole {
    /// Force, samples × degrees of freedom, in N.
    pub force: Gathered,
    /// Measured responses, in the order of [`Block::responses`].
    pub motions: Vec<Gathered>,
    /// Mean period; `None` if the window is one period.
    pub mean: Option<Block>,
}

/// Statistics of the channels of one quantity.
#[derive(Debug)]
pub struct Gathered {
    /// Levels of each channel.
    pub levels: Vec<RunningStatistics>,
    periods: Option<Periods>,
    /// Extreme values of each channel, if not all samples are in memory.
    extremes: Vec<Extremes>,
}

impl Whole {
    /// Reads the window once.
    pub(crate) fn new(recorded: &Windowed) -> Result<Self, AnalysisError> {
        let buffered = &recorded.held;
        let mut force = Gathered::new(buffered, &buffered.force);
        let mut motions: Vec<Gathered> = buffered
            .responses()
            .iter()
            .map(|(_, motion)| Gathered::new(buffered, motion))
            .collect();
        recorded.chunks(CHUNK_SAMPLES, CHUNK_SAMPLES, &mut |chunk| {
            force.push(&chunk.force)?;
            for (gathered, (_, motion)) in motions.iter_mut().zip(chunk.responses()) {
                gathered.push(motion)?;
            }
            Ok(())
        })?;
        let mean = mean(buffered, &force, &motions)?;
        Ok(Self { force, motions, mean })
    }

    /// Returns the mean period, or the samples in memory if the window is one period.
    pub fn period<'a>(&'a self, held: &'a Block) -> &'a Block {
        self.mean.as_ref().unwrap_or(held)
    }
}

/// Returns the mean over all periods as a measurement of one period.
fn mean(
    held: &Block,
    force: &Gathered,
    motions: &[Gathered],
) -> Result<Option<Block>, AnalysisError> {
    let sampling = held.force.sampling().with_len(held.period)?;
    let mean =
        |gathered: &Gathered| gathered.periods.as_ref().map(|p| p.mean(sampling)).transpose();
    let Some(force) = mean(force)? else { return Ok(None) };
    let mut motions = motions.iter();
    let mut next = |measured: &Option<Record>| match measured {
        Some(_) => motions.next().map_or(Ok(None), mean),
        None => Ok(None),
    };
    Ok(Some(Block {
        file: held.file.clone(),
        force,
        displacement: next(&held.displacement)?,
        velocity: next(&held.velocity)?,
        acceleration: next(&held.acceleration)?,
        first_sample: held.first_sample,
        period: held.period,
        periods: 1,
        driven: held.driven.clone(),
        unit_remarks: held.unit_remarks.clone(),
        unit_findings: held.unit_findings.clone(),
        names: Arc::clone(&held.names),
    }))
}

impl Gathered {
    fn new(held: &Block, record: &Record) -> Self {
        let channels = record.channels();
        let window = held.period * held.periods;
        let extremes = match held.held_to() {
            Some(_) => vec![Extremes::new(window); channels],
            None => Vec::new(),
        };
        let periods = (held.periods > 1).then(|| Periods::new(held.period, record));
        Self { levels: vec![RunningStatistics::default(); channels], periods, extremes }
    }

    /// Adds the next samples.
    fn push(&mut self, record: &Record) -> Result<(), AnalysisError> {
        for (channel, levels) in self.levels.iter_mut().enumerate() {
            levels.push(record.channel(channel))?;
        }
        for (channel, extremes) in self.extremes.iter_mut().enumerate() {
            extremes.push(record.channel(channel));
        }
        if let Some(periods) = &mut self.periods {
            periods.push(record);
        }
        Ok(())
    }

    /// Returns the RMS deviation of one channel from its mean period, over all samples, in the unit
    /// of the channel; `None` for one period.
    pub fn scatter(&self, channel: usize) -> Option<f64> {
        self.periods.as_ref().map(|periods| periods.scatter(channel))
    }

    /// Returns times from the beginning of the window, in s, and values for a plot of one channel:
    /// all samples in memory, or the minimum and the maximum of every short chunk of a longer
    /// window.
    pub fn history(&self, held: &Record, channel: usize) -> (Vec<f64>, Vec<f64>) {
        let sampling = held.sampling();
        match self.extremes.get(channel) {
            Some(extremes) => {
                extremes.points().map(|(k, value)| (k as f64 * sampling.dt(), value)).unzip()
            }
            None => (sampling.times().collect(), held.channel(channel).to_vec()),
        }
    }
}

/// Sums over all periods: one sum for each sample of the period and each channel.
#[derive(Debug)]
struct Periods {
    sums: DMatrix<f64>,
    /// Scaled sum of squares about the mean of the samples so far. With squares about zero,
    /// cancellation would remove the scatter.
    squares: DMatrix<f64>,
    /// Scale of each channel, because squares of large or small values overflow or underflow.
    scales: Vec<f64>,
    samples: usize,
}

impl Periods {
    /// Creates empty sums for periods of `period` samples; `held` are some samples of the channels,
    /// which give their scale.
    fn new(period: usize, held: &Record) -> Self {
        let none = DMatrix::zeros(period, held.channels());
        let scale = |c: usize| Some(held.column(c).amax()).filter(|peak| *peak > 0.0);
        let scales = (0..held.channels()).map(|c| scale(c).unwrap_or(1.0)).collect();
        Self { sums: none.clone(), squares: none, scales, samples: 0 }
    }

    /// Adds the next samples, which may begin and end within a period.
    ///
    /// # Source
    /// B. P. Welford, "Note on a method for calculating corrected sums of squares and products",
    /// Technometrics 4(3), 1962.
    fn push(&mut self, record: &Record) {
        let period = self.sums.nrows();
        for (channel, scale) in self.scales.iter().enumerate() {
            let mut sums = self.sums.column_mut(channel);
            let mut squares = self.squares.column_mut(channel);
            for (k, value) in (self.samples..).zip(record.channel(channel)) {
                let (at, before) = (k % period, (k / period) as f64);
                let sum = sums[at] + value;
                if before > 0.0 {
                    let (old, new) = (sums[at] / before, sum / (before + 1.0));
                    squares[at] += ((value - old) / scale) * ((value - new) / scale);
                }
                sums[at] = sum;
            }
        }
        self.samples += record.len();
    }

    fn mean(&self, sampling: Sampling) -> Result<Record, AnalysisError> {
        let periods = (self.samples / self.sums.nrows()) as f64;
        Ok(Record::new(sampling, &self.sums / periods)?)
    }

    fn scatter(&self, channel: usize) -> f64 {
        let mean_square = self.squares.column(channel).sum() / self.samples as f64;
        self.scales[channel] * mean_square.max(0.0).sqrt()
    }
}
