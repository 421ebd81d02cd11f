//! Seeded Gaussian noise, white or coloured, at a stated level.
//!
//! Each channel has its own stream of a ChaCha generator: the numbers depend on the seed, the
//! channel and the sample only, not on what else is computed or on how many threads.

use nalgebra::DMatrix;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::error::{finite, not_negative};
use crate::{Record, Sampling, SignalError};

/// How strong a disturbance is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NoiseLevel {
    /// Standard deviation, in the unit of the signal, the same in every channel.
    StandardDeviation(f64),
    /// Signal-to-noise ratio in dB: 20 log10 of RMS of the channel over standard deviation.
    SnrDb(f64),
    /// Standard deviation as a fraction of the RMS of the channel (0.05 is "5 % noise").
    FractionOfRms(f64),
}

impl NoiseLevel {
    /// The standard deviation this means for a signal.
    fn deviation(self, record: &Record, channel: usize) -> Result<f64, SignalError> {
        let per_rms = match self {
            Self::StandardDeviation(std) => return not_negative("standard deviation", std),
            Self::SnrDb(db) => 10f64.powf(-finite("signal-to-noise ratio", db)? / 20.0),
            Self::FractionOfRms(fraction) => not_negative("fraction of RMS", fraction)?,
        };
        let mean_square = record.column(channel).norm_squared() / record.len() as f64;
        if mean_square == 0.0 {
            return Err(SignalError::Silent { channel });
        }
        Ok(per_rms * mean_square.sqrt())
    }
}

/// White Gaussian noise of a given standard deviation, independent between channels.
///
/// # Errors
/// [`SignalError::Negative`] if the deviation is negative or not finite.
pub fn white(
    sampling: Sampling,
    channels: usize,
    standard_deviation: f64,
    seed: u64,
) -> Result<Record, SignalError> {
    not_negative("standard deviation", standard_deviation)?;
    let mut data = DMatrix::zeros(sampling.len(), channels);
    for (channel, mut column) in data.column_iter_mut().enumerate() {
        let mut rng = stream(seed, channel);
        column.apply(|v| *v = standard_deviation * standard_normal(&mut rng));
    }
    Record::new(sampling, data)
}

/// The record with white Gaussian noise added to every channel.
///
/// ```
/// use mechid_signal::{Multisine, NoiseLevel, Phases, Sampling, noise};
///
/// let force = Multisine::flat(1..=31, 1.0, Phases::Schroeder)?.sample(Sampling::new(0.01, 64)?)?;
/// let measured = noise::add_white(&force, NoiseLevel::SnrDb(40.0), 1)?;
/// assert_eq!(measured, noise::add_white(&force, NoiseLevel::FractionOfRms(0.01), 1)?);
/// # Ok::<(), mechid_signal::SignalError>(())
/// ```
///
/// # Errors
/// [`SignalError::Negative`] or [`SignalError::Infinite`] for an impossible level,
/// [`SignalError::Silent`] if the level is relative to a channel that is zero throughout.
pub fn add_white(record: &Record, level: NoiseLevel, seed: u64) -> Result<Record, SignalError> {
    let unit = white(record.sampling(), record.channels(), 1.0, seed)?;
    let mut data = record.data().clone();
    for (channel, mut column) in data.column_iter_mut().enumerate() {
        column.axpy(level.deviation(record, channel)?, &unit.column(channel), 1.0);
    }
    Record::new(record.sampling(), data)
}

/// The generator of one channel.
pub(crate) fn stream(seed: u64, channel: usize) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(channel as u64);
    rng
}

/// One draw with mean 0 and variance 1.
pub(crate) fn standard_normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(len: usize) -> Sampling {
        Sampling::new(0.01, len).unwrap()
    }

    #[test]
    fn moments_are_those_of_the_normal_distribution() {
        let x = white(axis(100_000), 1, 2.0, 11).unwrap();
        let n = x.len() as f64;
        let moment = |p: i32| x.channel(0).iter().map(|v| (v / 2.0).powi(p)).sum::<f64>() / n;
        // Four standard errors of each moment: √(1/n), √(2/n), √(15/n), √(96/n).
        for (p, expected, variance) in
            [(1, 0.0, 1.0), (2, 1.0, 2.0), (3, 0.0, 15.0), (4, 3.0, 96.0)]
        {
            let tolerance = 4.0 * f64::sqrt(variance / n);
            assert!((moment(p) - expected).abs() < tolerance, "moment {p}: {}", moment(p));
        }
    }

    #[test]
    fn channels_are_independent_and_do_not_depend_on_their_number() {
        let one = white(axis(10_000), 1, 1.0, 5).unwrap();
        let three = white(axis(10_000), 3, 1.0, 5).unwrap();
        assert_eq!(one.channel(0), three.channel(0));
        let correlation = three.column(1).dot(&three.column(2)) / 10_000.0;
        assert!(correlation.abs() < 4.0 / 100.0, "{correlation}");
    }

    #[test]
    fn levels_mean_what_they_say() {
        let s = axis(4);
        let r = Record::from_channels(s, &[[3.0, -3.0, 3.0, -3.0], [0.0; 4]]).unwrap();
        let deviation = |level: NoiseLevel| level.deviation(&r, 0).unwrap();
        assert_eq!(deviation(NoiseLevel::StandardDeviation(0.2)), 0.2);
        assert!((deviation(NoiseLevel::SnrDb(20.0)) - 0.3).abs() < 1e-15);
        assert!((deviation(NoiseLevel::FractionOfRms(0.05)) - 0.15).abs() < 1e-15);
        let silent = add_white(&r, NoiseLevel::SnrDb(20.0), 0);
        assert_eq!(silent, Err(SignalError::Silent { channel: 1 }));
        assert!(add_white(&r, NoiseLevel::StandardDeviation(-1.0), 0).is_err());
        assert!(add_white(&r, NoiseLevel::SnrDb(f64::NAN), 0).is_err());
    }
}
