//! Noise of a random signal by the part of its spectrum that it does not drive.

use std::f64::consts::TAU;

use crate::{Record, Sampling, SignalError, Spectrum};

/// Number of lines whose mean power is one level.
const LINES: usize = 64;

/// Least number of such levels, from half the sampling rate down, that are alike.
const ALIKE: usize = 3;

/// Factor within which levels are alike: of two it is more than four standard deviations.
const FACTOR: f64 = 3.0;

/// Standard deviation of the logarithm of a level, of 64 lines under Hann's window, of which neighbours share power.
const SCATTER: f64 = 0.17;

/// Standard deviations by which the upper and the lower half of the levels may differ.
const UNEVEN: f64 = 4.0;

/// Level over the largest one from which the band is driven.
const DRIVEN: f64 = 0.01;

/// Standard deviation of noise over the RMS of the signal, below which it is none: it moves no parameter.
const NOTHING: f64 = 1e-5;

/// Mean of the squares of Hann's window.
const HANN: f64 = 0.375;

/// Standard deviation of the noise of each channel, in its unit, from the lines above the band that the signal
/// drives; `None` where it drives all of them, where their spectrum falls off slowly, or where they are too few (about
/// 500 samples) to tell.
///
/// The spectrum under Hann's window, in means over 64 lines, has to be even over three of them at least below half
/// the sampling rate, and there to have less than a hundredth of the power that it has in the band. The noise is
/// taken to be as strong in the band: it is an upper bound where something else is left above the band, and a lower
/// one where a filter takes noise away there. Where any of these means is so small that noise as strong as that is
/// below 10⁻⁵ of the RMS of the signal, it is the level, even or not. A channel of zeros has no noise.
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
/// Harris (1978), Proceedings of the IEEE 66, 51–83 (noise bandwidth of Hann's window); the limits are ours.
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
    let spectrum = Spectrum::of(&Record::new(sampling, windowed)?);
    let of_channel = |channel: usize| {
        if record.channel(channel).iter().all(|x| *x == 0.0) {
            return Some(0.0);
        }
        // Without the constant and half the sampling rate.
        let powers: Vec<f64> =
            (1..samples.div_ceil(2)).map(|n| spectrum.line(n, channel).norm_sqr()).collect();
        let deviation = |level: f64| (level * samples as f64 / (4.0 * HANN)).sqrt();
        // Of noise alone no mean could be lower: what is uneven is leakage.
        let rms = record.column(channel).variance().sqrt();
        let lowest = levels(&powers).into_iter().map(deviation).reduce(f64::min);
        let none = lowest.filter(|lowest| *lowest <= NOTHING * rms);
        none.or_else(|| even_level(&levels(&powers)).map(deviation))
    };
    Ok((0..record.channels()).map(of_channel).collect())
}

fn mean(powers: &[f64]) -> f64 {
    powers.iter().sum::<f64>() / powers.len() as f64
}

/// Mean powers of lines, the highest ones first.
fn levels(powers: &[f64]) -> Vec<f64> {
    powers.rchunks_exact(LINES).map(mean).collect()
}

/// Mean power of the highest lines as far as it is even, if they are not driven.
fn even_level(levels: &[f64]) -> Option<f64> {
    let strongest = levels.iter().copied().fold(0.0, f64::max);
    let mut alike = 0;
    for level in levels {
        let so_far = mean(&levels[..alike.max(1)]);
        if *level > FACTOR * so_far || level * FACTOR < so_far {
            break;
        }
        alike += 1;
    }
    let half = alike / 2;
    if alike < ALIKE {
        return None;
    }
    // A force that falls off slowly towards half the sampling rate is no noise.
    let slope = (mean(&levels[alike - half..alike]) / mean(&levels[..half])).ln().abs();
    let level = mean(&levels[..alike]);
    let even = slope <= UNEVEN * SCATTER * (2.0 / half as f64).sqrt();
    (even && level <= DRIVEN * strongest).then_some(level)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{NoiseLevel, noise};

    /// A force up to 0.35 of the sampling rate, from a random one whose higher lines are cut off, with noise.
    fn force(samples: usize, level: f64, seed: u64) -> Record {
        let period = Sampling::new(0.002, 4 * samples).unwrap();
        let mut lines = Spectrum::of(&noise::white(period, 1, 1.0, seed).unwrap()).lines().clone();
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
        // Nor do few samples, nor a spectrum that falls all the way.
        let short = noise::white(Sampling::new(0.002, 128).unwrap(), 1, 1.0, 1).unwrap();
        assert_eq!(noise_above_band(&short).unwrap(), [None]);
        let falling =
            noise::coloured(sampling, 1, 1.0, noise::Colour::PowerLaw { exponent: 8.0 }, 1);
        let found = noise_above_band(&falling.unwrap()).unwrap()[0];
        assert!(found.is_none_or(|level| level < 1e-3), "{found:?}");
        // A force behind a filter of the second order falls by a factor of a hundred, and by none suddenly.
        for seed in 0..10 {
            let white = noise::white(sampling, 1, 1.0, seed).unwrap();
            let mut lines = Spectrum::of(&white).lines().clone();
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
