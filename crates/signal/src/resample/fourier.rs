//! Interpolation of a period by its Fourier series.

use std::f64::consts::TAU;

use nalgebra::{Complex, DMatrix};

use crate::error::SignalError;
use crate::record::Record;
use crate::sampling::Sampling;
use crate::spectrum::Spectrum;

/// Returns Re Σ X_n exp(i n ω0 t), by Horner's rule.
pub(super) fn value(spectrum: &Spectrum, channel: usize, t: f64) -> f64 {
    let turn = (t / spectrum.sampling().duration()).fract() * TAU;
    let z = Complex::from_polar(1.0, turn);
    let lines = spectrum.lines().column(channel);
    lines.iter().rev().fold(Complex::from(0.0), |sum, x| sum * z + x).re
}

/// Returns the same period on a time axis with at least as many samples as before, by a longer
/// inverse transform. `None` if the new time axis has a different duration or fewer samples.
pub(super) fn same_period(
    spectrum: &Spectrum,
    sampling: Sampling,
) -> Option<Result<Record, SignalError>> {
    let duration = spectrum.sampling().duration();
    let same = (sampling.duration() - duration).abs() <= 1e-12 * duration;
    if !same || sampling.len() < spectrum.sampling().len() {
        return None;
    }
    // One-sided amplitudes are independent of the number of samples: the old Nyquist line is an
    // ordinary cosine on the finer axis.
    let mut lines = DMatrix::zeros(sampling.lines(), spectrum.channels());
    lines.rows_mut(0, spectrum.len()).copy_from(spectrum.lines());
    Some(Spectrum::from_lines(sampling, lines).and_then(|finer| finer.to_record()))
}

/// Returns the same period, with the start later by the fraction `part` of a sampling step.
pub(super) fn later(spectrum: &Spectrum, part: f64) -> Result<Record, SignalError> {
    let sampling = spectrum.sampling();
    let mut lines = spectrum.lines().clone();
    for (n, mut line) in lines.row_iter_mut().enumerate() {
        let turn = Complex::from_polar(1.0, TAU * n as f64 * part / sampling.len() as f64);
        // At the Nyquist frequency the samples contain no sine, so the factor is real.
        let turn = if 2 * n == sampling.len() { turn.re.into() } else { turn };
        line *= turn;
    }
    Spectrum::from_lines(sampling, lines)?.to_record()
}
