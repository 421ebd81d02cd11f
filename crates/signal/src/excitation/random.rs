//! Random excitation.

use crate::error::{SignalError, band, below_nyquist, fits_in_memory, not_negative, within};
use crate::noise::{stream, white_channel};
use crate::record::Record;
use crate::sampling::Sampling;
use crate::spectrum::Spectrum;

/// Gaussian random force: white, or limited to a band of the period's lines, throughout the record
/// or in a burst at its beginning.
///
/// The record is assumed to be one period. The response to a burst decays before the period ends,
/// so that the transform covers a whole transient and has no leakage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Random {
    standard_deviation: f64,
    band_hz: Option<(f64, f64)>,
    on: f64,
    seed: u64,
}

impl Random {
    /// White noise of a given standard deviation, in N.
    ///
    /// # Errors
    /// [`SignalError::Negative`] for the deviation.
    pub fn white(standard_deviation: f64, seed: u64) -> Result<Self, SignalError> {
        not_negative("standard deviation", standard_deviation)?;
        Ok(Self { standard_deviation, band_hz: None, on: 1.0, seed })
    }

    /// Creates noise on the lines between two frequencies in Hz, including the ends, without DC.
    ///
    /// # Errors
    /// [`SignalError::Negative`] for the deviation, [`SignalError::Band`] for the ends.
    pub fn band_limited(
        standard_deviation: f64,
        low_hz: f64,
        high_hz: f64,
        seed: u64,
    ) -> Result<Self, SignalError> {
        let band_hz = Some(band(low_hz, high_hz)?);
        Ok(Self { band_hz, ..Self::white(standard_deviation, seed)? })
    }

    /// Returns the same noise during the first `fraction` of the record only; the rest of the
    /// record is zero.
    ///
    /// # Errors
    /// [`SignalError::Range`] unless 0 ≤ `fraction` ≤ 1.
    pub fn burst(self, fraction: f64) -> Result<Self, SignalError> {
        Ok(Self { on: within("burst fraction", fraction, 0.0, 1.0)?, ..self })
    }

    /// The sampled excitation.
    ///
    /// # Errors
    /// [`SignalError::AboveNyquist`] for the upper end of the band, [`SignalError::EmptyBand`] if
    /// it has no line, [`SignalError::NotFinite`] if the deviation overflows.
    pub fn sample(&self, sampling: Sampling) -> Result<Record, SignalError> {
        fits_in_memory(sampling.len(), 1)?;
        let white = white_channel(sampling, 1.0, &mut stream(self.seed, 0));
        let whole = match self.band_hz {
            None => Record::from_channel(sampling, white)?,
            Some((low_hz, high_hz)) => {
                let lines = band_lines(sampling, low_hz, high_hz)?;
                keep_lines(&Record::from_channel(sampling, white)?, &lines)?
            }
        };
        let on = (self.on * sampling.len() as f64).round() as usize;
        let mut force = whole.channel(0).to_vec();
        force[on..].fill(0.0);
        force.iter_mut().for_each(|v| *v *= self.standard_deviation);
        Record::from_channel(sampling, force)
    }
}

/// Returns the lines in a band below Nyquist, at least one.
fn band_lines(sampling: Sampling, low_hz: f64, high_hz: f64) -> Result<Vec<usize>, SignalError> {
    below_nyquist(high_hz, sampling)?;
    let lines = crate::lines::band(sampling, low_hz, high_hz);
    if lines.is_empty() {
        let spacing_hz = sampling.line_spacing_hz();
        return Err(SignalError::EmptyBand { low_hz, high_hz, spacing_hz });
    }
    Ok(lines)
}

/// Removes all other lines from white noise and scales the rest to the same expected variance. Each
/// line, with its mirror image, has the fraction 2/`len` of the variance of white noise.
fn keep_lines(white: &Record, lines: &[usize]) -> Result<Record, SignalError> {
    let gain = (white.len() as f64 / (2 * lines.len()) as f64).sqrt();
    let spectrum = Spectrum::from_record(white);
    let mut lines_kept = spectrum.lines() * nalgebra::Complex::from(0.0);
    for n in lines {
        lines_kept[(*n, 0)] = spectrum.line(*n, 0) * gain;
    }
    Spectrum::from_lines(white.sampling(), lines_kept)?.to_record()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_band_is_excited_and_the_level_is_kept() {
        let s = Sampling::new(0.001, 20_000).unwrap(); // lines every 0.05 Hz
        let r = Random::band_limited(2.0, 10.0, 200.0, 3).unwrap().sample(s).unwrap();
        let spectrum = Spectrum::from_record(&r);
        for n in 0..spectrum.len() {
            let inside = (200..=4000).contains(&n);
            assert_eq!(spectrum.line(n, 0).norm() > 1e-10, inside, "line {n}");
        }
        // 3801 lines, 7602 squared Gaussians: the RMS scatters by 1/√(2·7602) = 0.8 %.
        let rms = (r.column(0).norm_squared() / s.len() as f64).sqrt();
        assert!((rms / 2.0 - 1.0).abs() < 4.0 * 0.0082, "{rms}");
    }

    #[test]
    fn a_burst_ends() {
        let s = Sampling::new(0.001, 1000).unwrap();
        let whole = Random::white(1.0, 3).unwrap();
        let burst = whole.burst(0.3).unwrap().sample(s).unwrap();
        assert_eq!(burst.channel(0)[..300], whole.sample(s).unwrap().channel(0)[..300]);
        assert!(burst.channel(0)[300..].iter().all(|v| *v == 0.0));
        assert!(matches!(whole.burst(1.5), Err(SignalError::Range { value: 1.5, .. })));
    }

    #[test]
    fn impossible_bands_are_refused() {
        let s = Sampling::new(0.1, 20).unwrap();
        let band = |low, high| Random::band_limited(1.0, low, high, 0)?.sample(s);
        assert_eq!(band(2.0, 1.0), Err(SignalError::Band { low_hz: 2.0, high_hz: 1.0 }));
        assert_eq!(
            band(1.0, 6.0),
            Err(SignalError::AboveNyquist { frequency_hz: 6.0, nyquist_hz: 5.0 })
        );
        assert!(matches!(band(1.1, 1.2), Err(SignalError::EmptyBand { .. })));
        assert!(Random::white(f64::NAN, 0).is_err());
    }
}
