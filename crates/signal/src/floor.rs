//! Noise of a random signal, from the part of the spectrum that the signal does not drive.

use std::f64::consts::TAU;

use crate::error::SignalError;
use crate::limits;
use crate::record::Record;
use crate::sampling::Sampling;
use crate::spectrum::Spectrum;

/// Mean of the squares of Hann's window.
const HANN: f64 = 0.375;

/// Returns the standard deviation of the noise of each channel, in its unit, from the lines above
/// the driven band. `None` if the signal drives all lines, if the spectrum above the band falls off
/// slowly, or if the record is too short (fewer than about 500 samples).
///
/// The spectrum under Hann's window is averaged over 64 lines at a time. At least three averages,
/// from half the sampling rate downwards, must be flat and below a hundredth of the largest
/// average. The noise is assumed to have the same density in the band: the result is an upper bound
/// if another signal remains above the band, and a lower bound if a filter attenuates the noise
/// there. If the smallest average corresponds to white noise below 10⁻⁵ of the RMS of the signal,
/// this noise is the result, even if the averages are not flat. A channel of zeros has no noise.
///
/// ```
/// use mechid_signal::{NoiseLevel, Record, Sampling, noise, noise_above_band};
///
/// let sampling = Sampling::new(0.001, 4096)?;
/// let force: Vec<f64> = sampling.times().map(|t| (300.0 * t + 100.0 * t * t).sin()).collect();
/// let exact = Record::from_channel(sampling, force)?;
/// let noisy = noise::add_white(&exact, NoiseLevel::StandardDeviation(0.02), 1)?;
/// let level = noise_above_band(&noisy)?[0].expect("a band without force");
/// assert!((level / 0.02 - 1.0).abs() < 0.1);
/// # Ok::<(), mechid_signal::SignalError>(())
/// ```
///
/// # Errors
/// [`SignalError`] if the record cannot be windowed.
///
/// # Source
/// Harris (1978), Proceedings of the IEEE 66, 51–83 (noise bandwidth of Hann's window); the limits
/// are ours.
pub fn noise_above_band(record: &Record) -> Result<Vec<Option<f64>>, SignalError> {
    let samples = record.len();
    let mut windowed = record.data().clone();
    for mut column in windowed.column_iter_mut() {
        let mean = column.mean();
        for (k, x) in column.iter_mut().enumerate() {
            *x = (*x - mean) * (0.5 - 0.5 * (TAU * k as f64 / samples as f64).cos());
        }
    }
    let sampling = Sampling::new(record.sampling().dt(), samples)?;
    let spectrum = Spectrum::from_record(&Record::new(sampling, windowed)?);
    let of_channel = |channel: usize| {
        if record.channel(channel).iter().all(|x| *x == 0.0) {
            return Some(0.0);
        }
        // The lines exclude DC and half the sampling rate.
        let powers: Vec<f64> =
            (1..samples.div_ceil(2)).map(|n| spectrum.line(n, channel).norm_sqr()).collect();
        let deviation = |level: f64| (level * samples as f64 / (4.0 * HANN)).sqrt();
        // The lowest average is an upper bound of the white noise. If this bound is negligible, it
        // is the result even for a spectrum that is not flat: at such a low level, leakage makes
        // the spectrum uneven.
        let rms = record.column(channel).variance().sqrt();
        let lowest = levels(&powers).into_iter().map(deviation).reduce(f64::min);
        let none = lowest.filter(|lowest| *lowest <= limits::NEGLIGIBLE_NOISE * rms);
        none.or_else(|| even_level(&levels(&powers)).map(deviation))
    };
    Ok((0..record.channels()).map(of_channel).collect())
}

fn mean(powers: &[f64]) -> f64 {
    powers.iter().sum::<f64>() / powers.len() as f64
}

/// Returns the mean powers of groups of lines, from the highest down.
fn levels(powers: &[f64]) -> Vec<f64> {
    powers.rchunks_exact(limits::FLOOR_LINES).map(mean).collect()
}

/// Returns the mean level of the highest lines, down to the line at which the level is no longer
/// flat; `None` if these lines are too few or if the signal drives them.
fn even_level(levels: &[f64]) -> Option<f64> {
    let strongest = levels.iter().copied().fold(0.0, f64::max);
    let mut equal = 0;
    for level in levels {
        let so_far = mean(&levels[..equal.max(1)]);
        if *level > limits::FLOOR_RATIO * so_far || level * limits::FLOOR_RATIO < so_far {
            break;
        }
        equal += 1;
    }
    let half = equal / 2;
    if equal < limits::FLOOR_LEVELS {
        return None;
    }
    // A force that falls off slowly towards half the sampling rate is not noise.
    let slope = (mean(&levels[equal - half..equal]) / mean(&levels[..half])).ln().abs();
    let level = mean(&levels[..equal]);
    let even =
        slope <= limits::FLOOR_DEVIATION * limits::FLOOR_SCATTER * (2.0 / half as f64).sqrt();
    (even && level <= limits::DRIVEN_LEVEL * strongest).then_some(level)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise;
    use crate::noise::NoiseLevel;

    /// Returns a random force without lines above 0.35 of the sampling rate, with added noise.
    fn force(samples: usize, level: f64, seed: u64) -> Record {
        let period = Sampling::new(0.002, 4 * samples).unwrap();
        let mut lines =
            Spectrum::from_record(&noise::white(period, 1, 1.0, seed).unwrap()).lines().clone();
        let last = (0.35 * period.len() as f64) as usize;
        lines.rows_mut(last, lines.nrows() - last).fill(Default::default());
        let force = Spectrum::from_lines(period, lines).unwrap().to_record().unwrap();
        let window = force.window(samples / 3, samples).unwrap();
        noise::add_white(&window, NoiseLevel::StandardDeviation(level), seed + 100).unwrap()
    }

    #[test]
    fn the_level_above_the_band_is_that_of_the_noise() {
        for (samples, level, tolerance) in [(8192, 0.01, 0.1), (8192, 1e-4, 0.1), (2048, 0.02, 0.2)]
        {
            for seed in 0..20 {
                let found = noise_above_band(&force(samples, level, seed)).unwrap()[0].unwrap();
                assert!((found / level - 1.0).abs() < tolerance, "{samples} {level}: {found}");
            }
        }
    }

    #[test]
    fn without_noise_next_to_nothing_is_left() {
        let found = noise_above_band(&force(8192, 0.0, 1)).unwrap()[0];
        assert!(found.is_some_and(|level| level < 1e-6), "{found:?}");
    }

    #[test]
    fn forces_that_drive_all_lines_tell_nothing() {
        let sampling = Sampling::new(0.002, 4096).unwrap();
        let white = noise::white(sampling, 1, 1.0, 1).unwrap();
        assert_eq!(noise_above_band(&white).unwrap(), [None]);
        // A short record, or a spectrum that decreases over the whole band, gives no level.
        let short = noise::white(Sampling::new(0.002, 128).unwrap(), 1, 1.0, 1).unwrap();
        assert_eq!(noise_above_band(&short).unwrap(), [None]);
        let falling =
            noise::coloured(sampling, 1, 1.0, noise::Colour::PowerLaw { exponent: 8.0 }, 1);
        let found = noise_above_band(&falling.unwrap()).unwrap()[0];
        assert!(found.is_none_or(|level| level < 1e-3), "{found:?}");
        // White noise after a second-order filter must give no level: its spectrum falls gradually,
        // without a step.
        for seed in 0..10 {
            let white = noise::white(sampling, 1, 1.0, seed).unwrap();
            let mut lines = Spectrum::from_record(&white).lines().clone();
            for (n, mut line) in lines.row_iter_mut().enumerate() {
                line /= nalgebra::Complex::from(1.0 + (n as f64 / 300.0).powi(2));
            }
            let filtered = Spectrum::from_lines(sampling, lines).unwrap().to_record().unwrap();
            assert_eq!(noise_above_band(&filtered).unwrap(), [None]);
        }
        let still = Record::from_channel(sampling, vec![0.0; 4096]).unwrap();
        assert_eq!(noise_above_band(&still).unwrap(), [Some(0.0)]);
    }
}
