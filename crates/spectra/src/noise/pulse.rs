//! Noise of forces that act only for a few samples.

use std::ops::Range;

use mechid_numerics::linear_algebra::hermitian_eigen;
use mechid_signal::Sampling;
use nalgebra::{Complex, DMatrix, DVector};

use crate::SpectraError;
use crate::limits::PULSE_PATTERN;

/// Noise on the samples of a pulse; the other samples of its record have none.
#[derive(Debug, Clone, PartialEq)]
pub struct PulseNoise {
    /// Rows of the record.
    pub rows: Range<usize>,
    /// Time axis of the record.
    pub sampling: Sampling,
    /// Degree of freedom on which the force acts, counted from 0.
    pub channel: usize,
    /// Standard deviation, in N.
    pub deviation: f64,
    /// Samples with noise.
    pub samples: Range<usize>,
}

impl PulseNoise {
    /// Returns the amplitude, on a line at `omega` (rad/s), of a force of 1 N on one sample, in N.
    ///
    /// # Source
    /// The shift theorem of Fourier transforms.
    pub fn impulse(&self, sample: usize, omega: f64) -> Complex<f64> {
        let turn = -omega * sample as f64 * self.sampling.dt();
        Complex::from_polar(2.0 / self.sampling.len() as f64, turn)
    }
}

/// Errors of an input of line data due to the noise of a pulse: sums of a few patterns over the
/// lines, whose amplitudes are independent and have unit variance.
#[derive(Debug, Clone, PartialEq)]
pub struct PulseErrors {
    rows: Range<usize>,
    input: usize,
    sample_interval: f64,
    first_sample: usize,
    /// Patterns over the samples of the pulse, samples × patterns, in the unit of the amplitudes of
    /// the lines.
    patterns: DMatrix<f64>,
}

impl PulseErrors {
    /// Decomposes the noise of a pulse on the lines of its record at `omega` (rad/s), with the
    /// unitary amplitudes of [`LineData`](crate::LineData). Patterns with hardly any power on these
    /// lines are omitted; `None` without noise.
    ///
    /// # Errors
    /// [`SpectraError::Numerics`] if the decomposition fails.
    pub(crate) fn new(noise: &PulseNoise, omega: &[f64]) -> Result<Option<Self>, SpectraError> {
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
        let scale = noise.deviation / (noise.sampling.len() as f64).sqrt();
        Ok(Some(Self {
            rows: noise.rows.clone(),
            input: noise.channel,
            sample_interval: dt,
            first_sample: noise.samples.start,
            patterns: eigen.eigenvectors.select_columns(&strong) * scale,
        }))
    }

    /// Returns the same errors with the record at other rows.
    pub(crate) fn with_rows(&self, rows: Range<usize>) -> Self {
        Self { rows, ..self.clone() }
    }

    /// Returns the input with these errors, counted from 0.
    pub fn input(&self) -> usize {
        self.input
    }

    /// Returns the rows of the record with the pulse.
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
        let mut turn = Complex::cis(-omega * self.sample_interval * self.first_sample as f64);
        let mut values = DVector::zeros(self.count());
        for sample in self.patterns.row_iter() {
            for (value, pattern) in values.iter_mut().zip(sample.iter()) {
                *value += turn * pattern;
            }
            turn *= step;
        }
        values
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On lines up to half the sampling rate the patterns have the whole covariance of the samples;
    /// on the lowest quarter of them few patterns have all of it but a ten-thousandth.
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
            let errors = PulseErrors::new(&noise, &omega[..lines]).unwrap().unwrap();
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
