//! Noise of forces that act only for a few samples.

use std::ops::Range;

use mechid_numerics::linear_algebra::hermitian_eigen;
use mechid_signal::Sampling;
use nalgebra::{Complex, DMatrix, DVector};

use crate::SpectraError;
use crate::limits::{PULSE_PATTERN, PULSE_SAMPLES};

/// Noise on the samples of a pulse; the other samples of the record have no noise.
#[derive(Debug, Clone, PartialEq)]
pub struct PulseNoise {
    /// Rows of the data that have the lines of the record.
    pub rows: Range<usize>,
    /// Time axis of the record.
    pub sampling: Sampling,
    /// Degree of freedom on which the force acts, counted from 0.
    pub channel: usize,
    /// Standard deviation of the noise on a sample, in N.
    pub deviation: f64,
    /// Samples with noise.
    pub samples: Range<usize>,
}

/// Errors of an input due to the noise of a pulse: a sum of a few patterns over the lines of a
/// record. The amplitudes of the patterns are independent and have unit variance.
#[derive(Debug, Clone, PartialEq)]
pub struct PulseErrors {
    rows: Range<usize>,
    input: usize,
    sample_interval: f64,
    /// Instant of the first sample of the pulse, in s after the first sample of the record.
    start: f64,
    /// Patterns over the samples of the pulse, samples × patterns, in the unit of the amplitudes of
    /// the lines.
    patterns: DMatrix<f64>,
}

impl PulseErrors {
    /// Decomposes the noise of each pulse into patterns on the lines of its record; `omega` (rad/s)
    /// has the lines of all records. The amplitude of a line is the Fourier sum over the samples of
    /// the record, multiplied by a factor. `unit` returns this factor for a number of samples.
    /// Patterns with hardly any power on the lines of a record are omitted.
    ///
    /// # Errors
    /// [`SpectraError::Numerics`] if the decomposition fails.
    pub(crate) fn all(
        pulses: &[PulseNoise],
        omega: &[f64],
        unit: impl Fn(usize) -> f64,
    ) -> Result<Vec<Self>, SpectraError> {
        let mut errors = Vec::new();
        for pulse in pulses {
            // The parts of a pulse have independent noise. The division into parts limits the cost
            // of the decomposition, which grows with the cube of the length of a part.
            for start in pulse.samples.clone().step_by(PULSE_SAMPLES) {
                let samples = start..pulse.samples.end.min(start + PULSE_SAMPLES);
                let part = PulseNoise { samples, ..pulse.clone() };
                let scale = part.deviation * unit(part.sampling.len());
                errors.extend(Self::new(&part, &omega[part.rows.clone()], scale)?);
            }
        }
        Ok(errors)
    }

    /// Decomposes the noise of a pulse; `scale` is the standard deviation of the samples, times the
    /// factor of the amplitudes of the lines. `None` without noise or without lines.
    fn new(noise: &PulseNoise, omega: &[f64], scale: f64) -> Result<Option<Self>, SpectraError> {
        if noise.deviation == 0.0 {
            return Ok(None);
        }
        let (count, dt) = (noise.samples.len(), noise.sampling.dt());
        let correlation: Vec<f64> = (0..count)
            .map(|lag| omega.iter().map(|omega| (omega * lag as f64 * dt).cos()).sum())
            .collect();
        let gram = DMatrix::from_fn(count, count, |a, b| correlation[a.abs_diff(b)]);
        let eigen = hermitian_eigen(gram)?;
        let largest = eigen.eigenvalues.iter().copied().fold(0.0, f64::max);
        let strong: Vec<usize> =
            (0..count).filter(|at| eigen.eigenvalues[*at] > PULSE_PATTERN * largest).collect();
        if strong.is_empty() {
            return Ok(None);
        }
        Ok(Some(Self {
            rows: noise.rows.clone(),
            input: noise.channel,
            sample_interval: dt,
            start: dt * noise.samples.start as f64,
            patterns: eigen.eigenvectors.select_columns(&strong) * scale,
        }))
    }

    /// Returns the same errors for a record whose lines are in other rows of the data.
    pub(crate) fn with_rows(&self, rows: Range<usize>) -> Self {
        Self { rows, ..self.clone() }
    }

    /// Returns the errors of an input that is delayed by `delay` seconds.
    pub(crate) fn delayed(&self, delay: f64) -> Self {
        Self { start: self.start + delay, ..self.clone() }
    }

    /// Returns the index of the input that has these errors, counted from 0.
    pub fn input(&self) -> usize {
        self.input
    }

    /// Returns the rows of the data that have the lines of the record with the pulse.
    pub fn rows(&self) -> Range<usize> {
        self.rows.clone()
    }

    /// Returns the number of patterns.
    pub fn count(&self) -> usize {
        self.patterns.ncols()
    }

    /// Returns the values of the patterns on a line at `omega` (rad/s), in the unit of the
    /// amplitudes of the line.
    ///
    /// # Source
    /// Slepian (1978), Bell System Technical Journal 57, 1371–1430 (short sequences with their
    /// power in a band).
    pub fn at(&self, omega: f64) -> DVector<Complex<f64>> {
        let step = Complex::cis(-omega * self.sample_interval);
        let mut turn = Complex::cis(-omega * self.start);
        let mut turns = Vec::with_capacity(self.patterns.nrows());
        for _ in 0..self.patterns.nrows() {
            turns.push(turn);
            turn *= step;
        }
        let value = |pattern: &[f64]| turns.iter().zip(pattern).map(|(turn, p)| turn * p).sum();
        let patterns = self.patterns.as_slice().chunks_exact(turns.len().max(1));
        DVector::from_iterator(self.count(), patterns.map(value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The patterns of a pulse of 24 samples have the covariance of the noise on the lines, within
    /// 0.2 % of its largest value: at most 24 patterns on all lines up to half the sampling rate,
    /// and at most 12 patterns on the lowest quarter of these lines.
    #[test]
    fn patterns_have_the_covariance_of_the_noise() {
        let sampling = Sampling::new(0.01, 400).unwrap();
        let omega: Vec<f64> = (1..200).map(|line| f64::from(line) * sampling.omega0()).collect();
        let noise = PulseNoise {
            rows: 0..omega.len(),
            sampling,
            channel: 0,
            deviation: 3.0,
            samples: 50..74,
        };
        for (lines, most) in [(omega.len(), 24), (50, 12)] {
            let errors = PulseErrors::new(&noise, &omega[..lines], 3.0 / 20.0).unwrap().unwrap();
            assert!(errors.count() <= most, "{}", errors.count());
            for (a, b) in [(0, 0), (0, 1), (5, 40), (lines - 1, lines - 1)] {
                let expected: Complex<f64> = (50..74)
                    .map(|sample| {
                        let turn = (omega[b] - omega[a]) * 0.01 * f64::from(sample);
                        Complex::cis(turn) * 9.0 / 400.0
                    })
                    .sum();
                let (one, other) = (errors.at(omega[a]), errors.at(omega[b]));
                let got = other.dotc(&one);
                assert!((got - expected).norm() < 1e-3, "{lines} lines: {got}, {expected}");
            }
        }
    }
}
