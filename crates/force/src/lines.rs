//! Spectral lines of a measured period.

use mechid_signal::Spectrum;

use crate::error::ForceError;
use crate::measurement::{Measurement, first_repeated};

/// Returns every line of the record with a complex amplitude: from 1 to the last one below Nyquist.
pub fn inner_lines(measured: &Measurement) -> Vec<usize> {
    (1..measured.sampling().len().div_ceil(2)).collect()
}

/// Returns the variance of the real part of a line's amplitude under white noise of unit variance;
/// the variance of the imaginary part is the same.
pub(crate) fn noise_weight(len: usize, line: usize) -> f64 {
    if line == 0 || 2 * line == len { 1.0 / len as f64 } else { 2.0 / len as f64 }
}

/// Checks that these are lines of the spectrum, without repetition.
pub(crate) fn check_lines(spectrum: &Spectrum, lines: &[usize]) -> Result<(), ForceError> {
    if lines.is_empty() {
        return Err(ForceError::NoLines);
    }
    let last = spectrum.len() - 1;
    if let Some(&line) = lines.iter().find(|line| **line > last) {
        return Err(ForceError::NoSuchLine { line, last });
    }
    match first_repeated(lines) {
        Some(line) => Err(ForceError::RepeatedLine { line }),
        None => Ok(()),
    }
}
