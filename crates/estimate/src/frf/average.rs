//! Cross-spectra of force and motion, averaged over pieces of records of any length.

use mechid_model::ResponseQuantity;
use mechid_signal::Record;
use nalgebra::DMatrix;

use super::cross_spectra::CrossSpectra;
use super::segments::{overlap_loss, weigh};
use super::{ComplexMatrix, Frf, FrfEstimator, Segments};
use crate::EstimateError;
use crate::frequency_domain::Lines;

/// Sums from which frequency responses are estimated, gathered stretch by stretch; memory does not grow
/// with the record.
#[derive(Debug, Clone)]
pub struct FrfAverage {
    lines: Lines,
    inputs: usize,
    outputs: usize,
    measured: ResponseQuantity,
    segments: Segments,
    weights: Option<Vec<f64>>,
    pieces: usize,
    /// Per line.
    sums: Vec<CrossSpectra>,
}

impl FrfAverage {
    /// No segments yet, of so many forces and motions; `lines` belong to one segment.
    ///
    /// # Errors
    /// [`EstimateError::Hop`], and [`EstimateError::Size`] if the lines are not those of a segment.
    pub fn new(
        lines: Lines,
        [inputs, outputs]: [usize; 2],
        measured: ResponseQuantity,
        segments: Segments,
    ) -> Result<Self, EstimateError> {
        let (expected, got) = (segments.samples(), lines.sampling().len());
        crate::least_squares::size("samples of a segment", expected, got)?;
        let weights = segments.weights()?;
        let sums = vec![CrossSpectra::new(inputs, outputs); lines.as_slice().len()];
        Ok(Self { lines, inputs, outputs, measured, segments, weights, pieces: 0, sums })
    }

    /// Adds every whole segment of a stretch of force (N) and motion, the first of which begins with
    /// it. The stretch that follows begins where the next segment does: [`Segments::hop`] samples
    /// after the last one that was whole.
    ///
    /// # Errors
    /// [`EstimateError::Signal`] if the records have not the same time axis or not the time step of
    /// the lines, [`EstimateError::Size`] for another number of channels.
    ///
    /// # Source
    /// Welch (1967), IEEE Trans. Audio Electroacoustics 15, 70–73.
    pub fn push(&mut self, force: &Record, motion: &Record) -> Result<(), EstimateError> {
        force.check_same_sampling(motion)?;
        crate::least_squares::size("channels of the force", self.inputs, force.channels())?;
        crate::least_squares::size("channels of the motion", self.outputs, motion.channels())?;
        let len = self.segments.samples();
        if force.len() < len {
            return Ok(());
        }
        crate::frequency_domain::check_sampling(
            self.lines.sampling(),
            force.sampling().with_len(len)?,
        )?;
        let mut reader = self.lines.reader();
        let amplitudes = |channels| ComplexMatrix::zeros(self.sums.len(), channels);
        let (mut forces, mut motions) = (amplitudes(self.inputs), amplitudes(self.outputs));
        for piece in 0..=(force.len() - len) / self.segments.hop() {
            let start = piece * self.segments.hop();
            for (record, amplitudes) in [(force, &mut forces), (motion, &mut motions)] {
                for (channel, mut column) in amplitudes.column_iter_mut().enumerate() {
                    let samples = &record.channel(channel)[start..start + len];
                    let weights = self.weights.as_deref();
                    reader.read(|input| weigh(samples, weights, input), column.iter_mut());
                }
            }
            for (line, sum) in self.sums.iter_mut().enumerate() {
                sum.add(&forces.row(line), &motions.row(line));
            }
            self.pieces += 1;
        }
        Ok(())
    }

    /// The frequency responses from all segments so far.
    ///
    /// # Errors
    /// As [`Frf::estimate`].
    ///
    /// # Source
    /// Bendat & Piersol, *Random Data*, 4th ed. (2010), chapters 6, 7 and 9; Welch (1967).
    pub fn frf(&self, estimator: FrfEstimator) -> Result<Frf, EstimateError> {
        let (inputs, outputs) = (self.inputs, self.outputs);
        if estimator == FrfEstimator::H2 && inputs > 1 && inputs != outputs {
            let what = "channels of the motion, for H2";
            return Err(EstimateError::Size { what, expected: inputs, got: outputs });
        }
        if self.pieces <= inputs {
            return Err(EstimateError::TooFewAverages { got: self.pieces, needed: inputs + 1 });
        }
        let loss = self
            .weights
            .as_deref()
            .map(|weights| overlap_loss(weights, self.segments.hop(), self.pieces));
        let omega = self.lines.omega();
        let mut frf = Frf {
            line_correlation: self.segments.line_correlation(self.pieces),
            lines: self.lines.as_slice().to_vec(),
            response: Vec::with_capacity(omega.len()),
            coherence: DMatrix::zeros(omega.len(), outputs),
            variance: Vec::with_capacity(omega.len()),
            omega,
            measured: self.measured,
            averages: self.pieces as f64 / loss.unwrap_or(1.0),
        };
        for (line, sum) in self.sums.iter().enumerate() {
            frf.push_line(line, &sum.mean(self.pieces), estimator)?;
        }
        Ok(frf)
    }
}
