//! One-sided complex amplitudes of a periodic record, and the inverse.
//!
//! The convention, everywhere in `mechid`: for one period of N samples x_k,
//!
//! ```text
//! x_k = Re Σ_{n=0}^{⌊N/2⌋} X_n exp(i 2π n k / N)
//! ```
//!
//! so that a cosine of amplitude A on line n gives X_n = A, and a sine gives X_n = −iA. With S_n
//! the unnormalised forward transform Σ x_k exp(−i 2π n k / N) this is X_n = 2 S_n / N, except at
//! DC and (N even) at Nyquist, where X_n = S_n / N. In the dissertation's real series (4.6.1),
//! X_n = X_n^c − i X_n^s. No window is applied: a multisine is measured over whole periods.

use nalgebra::{Complex, DMatrix};

use crate::error::SignalError;
use crate::record::Record;
use crate::sampling::Sampling;
use crate::transform::{forward, inverse};

/// Lines × channels of one-sided complex amplitudes, in the unit of the record; the frequency of
/// line n is n·ω0.
///
/// The [module documentation](self) defines the scaling.
///
/// # Source
/// Dissertation eqs. (4.6.1)–(4.6.5).
#[derive(Debug, Clone, PartialEq)]
pub struct Spectrum {
    sampling: Sampling,
    lines: DMatrix<Complex<f64>>,
}

impl Spectrum {
    /// Computes the spectrum of a record that is one whole period of any length.
    pub fn from_record(record: &Record) -> Self {
        let sampling = record.sampling();
        let plan = forward(sampling.len());
        let (mut input, mut output) = (plan.make_input_vec(), plan.make_output_vec());
        let mut scratch = plan.make_scratch_vec();
        let mut lines = DMatrix::zeros(sampling.lines(), record.channels());
        for (channel, mut column) in lines.column_iter_mut().enumerate() {
            input.copy_from_slice(record.channel(channel));
            plan.process_with_scratch(&mut input, &mut output, &mut scratch)
                .expect("buffers come from the plan");
            for (n, (line, s)) in column.iter_mut().zip(&output).enumerate() {
                *line = s * (line_weight(sampling.len(), n) / sampling.len() as f64);
            }
        }
        Self { sampling, lines }
    }

    /// Creates a spectrum from its lines: `sampling.lines()` rows, one column per channel.
    ///
    /// The imaginary parts of DC and (for an even length) Nyquist have no effect on samples and are
    /// set to zero.
    ///
    /// # Errors
    /// [`SignalError::SpectrumLength`] for another number of rows, [`SignalError::LineNotFinite`].
    pub fn from_lines(
        sampling: Sampling,
        mut lines: DMatrix<Complex<f64>>,
    ) -> Result<Self, SignalError> {
        let (got, expected) = (lines.nrows(), sampling.lines());
        if got != expected {
            return Err(SignalError::SpectrumLength { got, expected });
        }
        if let Some(at) = lines.iter().position(|z| !(z.re.is_finite() && z.im.is_finite())) {
            return Err(SignalError::LineNotFinite { line: at % got, channel: at / got });
        }
        for (n, mut row) in lines.row_iter_mut().enumerate() {
            if line_weight(sampling.len(), n) == 1.0 {
                row.apply(|z| z.im = 0.0);
            }
        }
        Ok(Self { sampling, lines })
    }

    /// Returns the period that has this spectrum; the exact inverse of [`Spectrum::from_record`].
    ///
    /// # Errors
    /// [`SignalError::NotFinite`] if the sum of the lines overflows.
    pub fn to_record(&self) -> Result<Record, SignalError> {
        Record::new(self.sampling, self.samples())
    }

    /// Returns the samples of the period, samples × channels.
    pub(crate) fn samples(&self) -> DMatrix<f64> {
        let len = self.sampling.len();
        let plan = inverse(len);
        let (mut input, mut output) = (plan.make_input_vec(), plan.make_output_vec());
        let mut scratch = plan.make_scratch_vec();
        let mut data = DMatrix::zeros(len, self.channels());
        for (channel, mut column) in data.column_iter_mut().enumerate() {
            for (n, (s, line)) in input.iter_mut().zip(self.lines.column(channel)).enumerate() {
                *s = line / line_weight(len, n);
            }
            plan.process_with_scratch(&mut input, &mut output, &mut scratch)
                .expect("DC and Nyquist are real");
            column.copy_from_slice(&output);
        }
        data
    }

    /// The time axis of the period.
    pub fn sampling(&self) -> Sampling {
        self.sampling
    }

    /// Number of lines, including DC.
    #[allow(clippy::len_without_is_empty, reason = "DC is always there")]
    pub fn len(&self) -> usize {
        self.lines.nrows()
    }

    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.lines.ncols()
    }

    /// Complex amplitude of line `n` of a channel.
    ///
    /// # Panics
    /// If there is no such line or channel.
    pub fn line(&self, n: usize, channel: usize) -> Complex<f64> {
        self.lines[(n, channel)]
    }

    /// All complex amplitudes: `len()` rows, `channels()` columns.
    pub fn lines(&self) -> &DMatrix<Complex<f64>> {
        &self.lines
    }

    /// Angular frequency of line `n`, in rad/s.
    pub fn omega(&self, n: usize) -> f64 {
        n as f64 * self.sampling.omega0()
    }

    /// Frequency of line `n`, in Hz.
    pub fn frequency_hz(&self, n: usize) -> f64 {
        n as f64 * self.sampling.line_spacing_hz()
    }
}

/// Returns 1 for the lines that are their own mirror image (DC, Nyquist), 2 for the others.
fn line_weight(len: usize, line: usize) -> f64 {
    if line == 0 || 2 * line == len { 1.0 } else { 2.0 }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use proptest::prelude::*;

    use super::*;

    /// Returns the amplitude of line `n` from the definition, summed term by term, as the reference
    /// for the fast transform.
    fn direct_sum(x: &[f64], n: usize) -> Complex<f64> {
        let len = x.len();
        let sum: Complex<f64> = x
            .iter()
            .enumerate()
            .map(|(k, v)| Complex::from_polar(*v, -TAU * ((n * k) % len) as f64 / len as f64))
            .sum();
        sum * line_weight(len, n) / len as f64
    }

    fn record(x: Vec<f64>) -> Record {
        Record::from_channel(Sampling::new(0.01, x.len()).unwrap(), x).unwrap()
    }

    #[test]
    fn cosine_and_sine_have_the_stated_amplitudes() {
        let s = Sampling::new(0.1, 12).unwrap();
        let x = |k: f64| 1.5 + 2.0 * (TAU * k / 4.0).cos() + 0.5 * (TAU * k / 6.0).sin();
        let spectrum = Spectrum::from_record(&record((0..s.len()).map(|k| x(k as f64)).collect()));
        for (n, expected) in [
            (0, Complex::new(1.5, 0.0)),
            (2, Complex::new(0.0, -0.5)),
            (3, Complex::new(2.0, 0.0)),
            (6, Complex::new(0.0, 0.0)),
        ] {
            assert!((spectrum.line(n, 0) - expected).norm() < 1e-14, "line {n}");
        }
    }

    proptest! {
        #[test]
        fn agrees_with_the_direct_sum_and_inverts(x in prop::collection::vec(-1e3..1e3f64, 1..200)) {
            let r = record(x.clone());
            let spectrum = Spectrum::from_record(&r);
            for n in 0..spectrum.len() {
                prop_assert!((spectrum.line(n, 0) - direct_sum(&x, n)).norm() < 1e-9);
            }
            let back = spectrum.to_record().unwrap();
            for (a, b) in back.channel(0).iter().zip(&x) {
                prop_assert!((a - b).abs() < 1e-10);
            }
        }

        #[test]
        fn parseval(x in prop::collection::vec(-1e3..1e3f64, 1..200)) {
            let spectrum = Spectrum::from_record(&record(x.clone()));
            let power: f64 = x.iter().map(|v| v * v).sum::<f64>() / x.len() as f64;
            let lines: f64 = (0..spectrum.len())
                .map(|n| spectrum.line(n, 0).norm_sqr() / line_weight(x.len(), n))
                .sum();
            prop_assert!((power - lines).abs() <= 1e-12 * power.max(1e-12));
        }
    }
}
