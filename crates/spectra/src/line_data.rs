//! Inputs and outputs line by line, of one record or of several.

use std::f64::consts::TAU;
use std::ops::Range;

use mechid_signal::{Record, Spectrum};
use nalgebra::{Complex, DMatrix};

use crate::noise::pulse::{PulseErrors, PulseNoise};
use crate::{LineNoise, SpectraError};

/// Effect of the initial and final states of a record on its lines.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Transient {
    /// No transient: whole periods, or measured frequency responses.
    None,
    /// Open record: its lines also contain the response to the difference between the initial and
    /// the final state.
    Open {
        /// Time between two samples, in s.
        sample_interval: f64,
    },
}

/// Complex amplitudes of inputs and outputs, one row per spectral line; the lines of several
/// records follow one another.
///
/// Amplitudes of records are unitary: Σ |X|² over all lines of both signs is Σ x² over all samples.
/// White noise of variance σ² therefore has E|X|² = σ² on every line, for any length of the record.
///
/// # Source
/// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed. (2012),
/// sections 2.3 and 6.3 (lines of open records and their transient).
#[derive(Debug, Clone, PartialEq)]
pub struct LineData {
    omega: Vec<f64>,
    inputs: DMatrix<Complex<f64>>,
    outputs: DMatrix<Complex<f64>>,
    records: Vec<(Range<usize>, Transient)>,
    noise: Option<LineNoise>,
    output_variance: Option<DMatrix<f64>>,
    pulse_errors: Vec<PulseErrors>,
}

impl LineData {
    /// Creates data from amplitudes of one record at `omega` (rad/s): `inputs` is lines × q (q may
    /// be 0), `outputs` is lines × p.
    ///
    /// # Errors
    /// [`SpectraError::Size`] if the shapes differ, [`SpectraError::NotFinite`] for a frequency
    /// that is not positive or an amplitude that is not finite.
    pub fn new(
        omega: Vec<f64>,
        inputs: DMatrix<Complex<f64>>,
        outputs: DMatrix<Complex<f64>>,
        transient: Transient,
    ) -> Result<Self, SpectraError> {
        let (rows, expected) = ([inputs.nrows(), outputs.nrows()], omega.len());
        for (what, got) in ["rows of inputs", "rows of outputs"].into_iter().zip(rows) {
            if got != expected {
                return Err(SpectraError::Size { what, expected, got });
            }
        }
        for (row, &value) in omega.iter().enumerate() {
            if !(value.is_finite() && value > 0.0) {
                return Err(SpectraError::NotFinite { row, value });
            }
            let (inputs, outputs) = (inputs.row(row), outputs.row(row));
            let sums = inputs.iter().chain(outputs.iter()).map(|z| z.re + z.im);
            if let Some(value) = sums.into_iter().find(|sum| !sum.is_finite()) {
                return Err(SpectraError::NotFinite { row, value });
            }
        }
        let records = vec![(0..omega.len(), transient)];
        let (noise, output_variance, pulse_errors) = (None, None, Vec::new());
        Ok(Self { omega, inputs, outputs, records, noise, output_variance, pulse_errors })
    }

    /// Reads the lines of an open record in `band_hz` (Hz), without a window, and without the lines
    /// at zero and at half the sampling rate.
    ///
    /// `inputs` is samples × q, or `None` for a record without measured inputs; `outputs` is
    /// samples × p.
    ///
    /// # Errors
    /// [`SpectraError::Size`] if the records differ in length, [`SpectraError::NoLine`] if the band
    /// has no line.
    pub fn from_open_record(
        inputs: Option<&Record>,
        outputs: &Record,
        band_hz: [f64; 2],
    ) -> Result<Self, SpectraError> {
        let (sampling, expected) = (outputs.sampling(), outputs.len());
        if let Some(got) = inputs.map(Record::len).filter(|len| *len != expected) {
            return Err(SpectraError::Size { what: "samples of the inputs", expected, got });
        }
        let spacing_hz = 1.0 / (expected as f64 * sampling.dt());
        let highest = expected.saturating_sub(1) / 2;
        let [from_hz, to_hz] = band_hz;
        let first = ((from_hz / spacing_hz).ceil().max(1.0)) as usize;
        let last = ((to_hz / spacing_hz).floor().min(highest as f64)) as usize;
        if first > last {
            let highest_hz = highest as f64 * spacing_hz;
            return Err(SpectraError::NoLine { from_hz, to_hz, spacing_hz, highest_hz });
        }
        let lines = last - first + 1;
        // The spectrum has amplitudes, 2/N times the transform; a unitary transform has the factor
        // 1/√N.
        let scale = Complex::from((expected as f64).sqrt() / 2.0);
        let read =
            |record: &Record| Spectrum::from_record(record).lines().rows(first, lines) * scale;
        let omega = (first..=last).map(|line| TAU * line as f64 * spacing_hz).collect();
        let inputs = inputs.map_or_else(|| DMatrix::zeros(lines, 0), read);
        let transient = Transient::Open { sample_interval: sampling.dt() };
        Self::new(omega, inputs, read(outputs), transient)
    }

    /// Returns the same lines with the covariance of their noise.
    ///
    /// # Errors
    /// [`SpectraError::Size`] unless there is one covariance per line, and it has one row and one
    /// column for each output and input.
    pub fn with_noise(self, noise: LineNoise) -> Result<Self, SpectraError> {
        let channels = self.outputs.ncols() + self.inputs.ncols();
        let size = noise.covariance().first().map_or(channels, DMatrix::nrows);
        let sizes = [
            ("covariances", self.len(), noise.covariance().len()),
            ("channels of a covariance", channels, size),
        ];
        for (what, expected, got) in sizes {
            if expected != got {
                return Err(SpectraError::Size { what, expected, got });
            }
        }
        Ok(Self { noise: Some(noise), ..self })
    }

    /// Returns the same lines with the variance E|n|² of each output's noise n (lines × p, in the
    /// squares of the units of the outputs). This noise is uncorrelated between outputs, and is not
    /// part of [`LineData::noise`].
    ///
    /// # Errors
    /// [`SpectraError::Size`] for another number of lines or outputs, [`SpectraError::NotFinite`]
    /// for a variance that is not positive and finite.
    pub fn with_output_variance(self, variance: DMatrix<f64>) -> Result<Self, SpectraError> {
        let sizes = [
            ("rows of variances", self.len(), variance.nrows()),
            ("columns of variances", self.outputs.ncols(), variance.ncols()),
        ];
        for (what, expected, got) in sizes {
            if expected != got {
                return Err(SpectraError::Size { what, expected, got });
            }
        }
        let is_positive = |value: f64| value.is_finite() && value > 0.0;
        let mut values = variance.iter().enumerate();
        match values.find(|(_, value)| !is_positive(**value)) {
            Some((at, &value)) => {
                Err(SpectraError::NotFinite { row: at % variance.nrows(), value })
            }
            None => Ok(Self { output_variance: Some(variance), ..self }),
        }
    }

    /// Returns the same lines with the noise of inputs that act only for a few samples; this noise
    /// replaces earlier noise of the same kind. The rows of a pulse are the rows of its record, and
    /// the channel of a pulse is an input.
    ///
    /// # Errors
    /// [`SpectraError::Size`] for an input that does not exist or rows that are not those of one
    /// record, [`SpectraError::Numerics`] if the decomposition of the noise fails.
    pub fn with_pulse_noise(self, pulses: &[PulseNoise]) -> Result<Self, SpectraError> {
        for pulse in pulses {
            let (what, expected, got) = ("inputs", pulse.channel + 1, self.inputs.ncols());
            if expected > got {
                return Err(SpectraError::Size { what, expected, got });
            }
            if self.records.iter().all(|(rows, _)| *rows != pulse.rows) {
                let (what, expected, got) = ("rows of a pulse", self.len(), pulse.rows.len());
                return Err(SpectraError::Size { what, expected, got });
            }
        }
        // The amplitudes are those of a unitary transform, which has the factor 1/√N.
        let unit = |samples: usize| (samples as f64).sqrt().recip();
        let pulse_errors = PulseErrors::all(pulses, &self.omega, unit)?;
        Ok(Self { pulse_errors, ..self })
    }

    /// Returns the same lines without the noise of pulses.
    #[must_use]
    pub fn without_pulse_noise(self) -> Self {
        Self { pulse_errors: Vec::new(), ..self }
    }

    /// Returns these lines followed by the lines of further records; the noise is kept if it is
    /// known for both sets of lines.
    ///
    /// # Errors
    /// [`SpectraError::Size`] if the number of inputs or outputs differs.
    pub fn followed_by(mut self, other: &Self) -> Result<Self, SpectraError> {
        let sizes = [
            ("inputs", self.inputs.ncols(), other.inputs.ncols()),
            ("outputs", self.outputs.ncols(), other.outputs.ncols()),
        ];
        for (what, expected, got) in sizes {
            if expected != got {
                return Err(SpectraError::Size { what, expected, got });
            }
        }
        let before = self.omega.len();
        let total = before + other.omega.len();
        self.omega.extend_from_slice(&other.omega);
        for (to, from) in [(&mut self.inputs, &other.inputs), (&mut self.outputs, &other.outputs)] {
            *to = std::mem::take(to).resize_vertically(total, Complex::default());
            to.rows_mut(before, from.nrows()).copy_from(from);
        }
        let moved = |(rows, transient): &(Range<usize>, Transient)| {
            (rows.start + before..rows.end + before, *transient)
        };
        self.records.extend(other.records.iter().map(moved));
        let moved = |pulse: &PulseErrors| {
            let rows = pulse.rows();
            pulse.with_rows(rows.start + before..rows.end + before)
        };
        self.pulse_errors.extend(other.pulse_errors.iter().map(moved));
        let variance = self.output_variance.take().zip(other.output_variance.as_ref());
        self.output_variance = variance.map(|(one, other)| {
            let mut both = one.resize_vertically(total, 0.0);
            both.rows_mut(before, other.nrows()).copy_from(other);
            both
        });
        let noise = self.noise.take().zip(other.noise.as_ref());
        self.noise = noise.map(|(one, other)| one.followed_by(other));
        Ok(self)
    }

    /// Returns the lines whose angular frequency (rad/s) `keep` accepts, record by record; `None`
    /// if it does not accept any line.
    pub fn retained(&self, keep: impl Fn(f64) -> bool) -> Option<Self> {
        let rows: Vec<usize> = (0..self.len()).filter(|row| keep(self.omega[*row])).collect();
        self.rows(&rows)
    }

    /// Returns the lines with these indices, which must be in ascending order; `None` if the list
    /// is empty.
    pub fn rows(&self, rows: &[usize]) -> Option<Self> {
        if rows.is_empty() {
            return None;
        }
        let mut records = Vec::with_capacity(self.records.len());
        let at = |row: usize| rows.partition_point(|kept| *kept < row);
        for (range, transient) in &self.records {
            let retained = at(range.start)..at(range.end);
            if !retained.is_empty() {
                records.push((retained, *transient));
            }
        }
        let moved = |pulse: &PulseErrors| {
            let rows = at(pulse.rows().start)..at(pulse.rows().end);
            (!rows.is_empty()).then(|| pulse.with_rows(rows))
        };
        Some(Self {
            omega: rows.iter().map(|row| self.omega[*row]).collect(),
            inputs: self.inputs.select_rows(rows),
            outputs: self.outputs.select_rows(rows),
            records,
            noise: self.noise.as_ref().map(|noise| noise.rows(rows)),
            output_variance: self.output_variance.as_ref().map(|v| v.select_rows(rows)),
            pulse_errors: self.pulse_errors.iter().filter_map(moved).collect(),
        })
    }

    /// Returns the number of lines of all records.
    pub fn len(&self) -> usize {
        self.omega.len()
    }

    /// Returns whether there is no line.
    pub fn is_empty(&self) -> bool {
        self.omega.is_empty()
    }

    /// Returns the angular frequency of each line, in rad/s.
    pub fn omega(&self) -> &[f64] {
        &self.omega
    }

    /// Returns the inputs in their units, lines × q.
    pub fn inputs(&self) -> &DMatrix<Complex<f64>> {
        &self.inputs
    }

    /// Returns the outputs in their units, lines × p.
    pub fn outputs(&self) -> &DMatrix<Complex<f64>> {
        &self.outputs
    }

    /// Returns the covariance of the noise of outputs and inputs, if it is known.
    pub fn noise(&self) -> Option<&LineNoise> {
        self.noise.as_ref()
    }

    /// Returns the variance of each output's noise (lines × p), in the squares of the units of the
    /// outputs, if it is known.
    pub fn output_variance(&self) -> Option<&DMatrix<f64>> {
        self.output_variance.as_ref()
    }

    /// Returns the errors of the inputs due to the noise of pulses.
    pub fn pulse_errors(&self) -> &[PulseErrors] {
        &self.pulse_errors
    }

    /// Returns the number of effects of the errors of pulses: two (real and imaginary part) for
    /// each output, line and pattern.
    pub fn pulse_effects(&self) -> usize {
        let patterns = |pulse: &PulseErrors| pulse.rows().len() * pulse.count();
        2 * self.outputs.ncols() * self.pulse_errors.iter().map(patterns).sum::<usize>()
    }

    /// Returns the rows of each record and its transient.
    pub fn records(&self) -> &[(Range<usize>, Transient)] {
        &self.records
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mechid_signal::{NoiseLevel, Sampling, noise};

    #[test]
    fn white_noise_has_its_variance_on_every_line() {
        let sampling = Sampling::new(0.01, 4096).unwrap();
        let quiet = Record::new(sampling, DMatrix::zeros(4096, 2)).unwrap();
        let noisy = noise::add_white(&quiet, NoiseLevel::StandardDeviation(3.0), 5).unwrap();
        let data = LineData::from_open_record(None, &noisy, [1.0, 49.0]).unwrap();
        let power = data.outputs().iter().map(|z| z.norm_sqr()).sum::<f64>();
        let mean = power / (2 * data.len()) as f64;
        assert!((mean / 9.0 - 1.0).abs() < 4.0 / (2.0 * data.len() as f64).sqrt(), "{mean}");
    }

    #[test]
    fn amplitudes_are_those_of_a_direct_sum() {
        let sampling = Sampling::new(0.1, 31).unwrap();
        let samples: Vec<f64> = (0..31).map(|k| ((k * k) % 7) as f64).collect();
        let record = Record::from_channel(sampling, samples.clone()).unwrap();
        let data = LineData::from_open_record(Some(&record), &record, [0.0, 5.0]).unwrap();
        assert_eq!(data.len(), 15);
        for (row, omega) in data.omega().iter().enumerate() {
            let term = |k: usize| samples[k] * Complex::cis(-omega * 0.1 * k as f64);
            let direct = (0..31).map(term).sum::<Complex<f64>>() / 31f64.sqrt();
            assert!((data.inputs()[(row, 0)] - direct).norm() < 1e-12);
        }
    }

    #[test]
    fn records_stand_one_below_the_other() {
        let sampling = Sampling::new(0.1, 40).unwrap();
        let record = Record::new(sampling, DMatrix::from_fn(40, 2, |k, c| (k * (c + 1)) as f64));
        let one = LineData::from_open_record(None, &record.unwrap(), [1.0, 3.0]).unwrap();
        let two = one.clone().followed_by(&one).unwrap();
        assert_eq!(two.len(), 2 * one.len());
        assert_eq!(two.records()[1].0, one.len()..2 * one.len());
        assert_eq!(two.outputs().rows(one.len(), one.len()), one.outputs().rows(0, one.len()));
        let low = two.retained(|omega| omega < 2.0 * TAU).unwrap();
        assert_eq!(low.records().len(), 2);
        assert_eq!(low.records()[1].0, low.len() / 2..low.len());
        assert_eq!(low.outputs().row(low.len() / 2), one.outputs().row(0));
        assert_eq!(two.retained(|_| false), None);
    }
}
