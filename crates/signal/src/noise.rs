//! Seeded Gaussian noise, white or coloured, at a stated level.
//!
//! Each channel has a separate stream of a ChaCha generator: the numbers depend only on the seed,
//! the channel and the sample, not on other computations or the number of threads.

use nalgebra::DMatrix;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::error::{SignalError, finite, fits_in_memory, not_negative, positive, within};
use crate::limits;
use crate::record::Record;
use crate::sampling::Sampling;
use crate::spectrum::Spectrum;

/// Level of a disturbance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NoiseLevel {
    /// Standard deviation, in the unit of the signal, the same in every channel.
    StandardDeviation(f64),
    /// Signal-to-noise ratio in dB: 20 log10 of the RMS of the channel divided by the standard
    /// deviation.
    SnrDb(f64),
    /// Standard deviation as a fraction of the RMS of the channel (0.05 is "5 % noise").
    FractionOfRms(f64),
}

impl NoiseLevel {
    /// Returns the standard deviation at this level for a signal.
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

/// Distribution of the power of a disturbance over frequency.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Colour {
    /// Constant density up to Nyquist; samples are independent.
    White,
    /// Power density proportional to 1/f^`exponent`: 1 is pink, 2 brown (a drift), −2 violet (a
    /// differentiated signal). The lowest frequency is half a cycle per record.
    PowerLaw {
        /// Exponent of 1/f, from −10 to 10, a pure number.
        exponent: f64,
    },
    /// First-order low-pass (Gauss–Markov): an autocorrelation of exp(−2π f_c |τ|), exactly.
    LowPass {
        /// Corner frequency f_c, in Hz.
        corner_hz: f64,
    },
}

/// Returns white Gaussian noise of a given standard deviation, in the unit of the record,
/// independent between channels.
///
/// # Errors
/// [`SignalError::Negative`] if the deviation is negative or not finite.
pub fn white(
    sampling: Sampling,
    channels: usize,
    standard_deviation: f64,
    seed: u64,
) -> Result<Record, SignalError> {
    coloured(sampling, channels, standard_deviation, Colour::White, seed)
}

/// Returns Gaussian noise of the given colour and standard deviation (in the unit of the record),
/// independent between channels.
///
/// The standard deviation is that of the process. The RMS of one record differs from it; the
/// difference is larger if the record has fewer independent values.
///
/// # Errors
/// [`SignalError::Negative`] for the deviation, [`SignalError::Range`] for the exponent,
/// [`SignalError::NotPositive`] for the corner frequency.
pub fn coloured(
    sampling: Sampling,
    channels: usize,
    standard_deviation: f64,
    colour: Colour,
    seed: u64,
) -> Result<Record, SignalError> {
    not_negative("standard deviation", standard_deviation)?;
    fits_in_memory(sampling.len(), channels)?;
    let mut data = DMatrix::zeros(sampling.len(), channels);
    for (channel, mut column) in data.column_iter_mut().enumerate() {
        let rng = &mut stream(seed, channel);
        let noise = match colour {
            Colour::White => white_channel(sampling, 1.0, rng),
            Colour::PowerLaw { exponent } => power_law(sampling, exponent, rng)?,
            Colour::LowPass { corner_hz } => low_pass(sampling, corner_hz, rng)?,
        };
        column.iter_mut().zip(noise).for_each(|(v, x)| *v = standard_deviation * x);
    }
    Record::new(sampling, data)
}

/// Returns the record with white Gaussian noise added to every channel.
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
/// [`SignalError::Silent`] if the level is relative to a channel of zeros.
pub fn add_white(record: &Record, level: NoiseLevel, seed: u64) -> Result<Record, SignalError> {
    add(record, level, Colour::White, seed)
}

/// Returns the record with Gaussian noise of a given colour added to every channel.
///
/// # Errors
/// The errors of [`add_white`] and [`coloured`].
pub fn add(
    record: &Record,
    level: NoiseLevel,
    colour: Colour,
    seed: u64,
) -> Result<Record, SignalError> {
    let unit = coloured(record.sampling(), record.channels(), 1.0, colour, seed)?;
    let mut data = record.data().clone();
    for (channel, mut column) in data.column_iter_mut().enumerate() {
        column.axpy(level.deviation(record, channel)?, &unit.column(channel), 1.0);
    }
    Record::new(record.sampling(), data)
}

/// Returns white noise that was filtered in the frequency domain. The filtered period is twice as
/// long as the record, and the record is its first half. In a whole period, the last samples would
/// be correlated with the first ones, which is not so in a record of noise.
fn power_law(
    sampling: Sampling,
    exponent: f64,
    rng: &mut ChaCha8Rng,
) -> Result<Vec<f64>, SignalError> {
    within("exponent of the power law", exponent, -limits::NOISE_EXPONENT, limits::NOISE_EXPONENT)?;
    let twice = sampling.with_len(sampling.len().saturating_mul(2))?;
    let white = Record::from_channel(twice, white_channel(twice, 1.0, rng))?;
    let spectrum = Spectrum::from_record(&white);
    let gain = |n: usize| if n == 0 { 0.0 } else { (n as f64).powf(-0.5 * exponent) };
    // The period is even: all lines but DC and Nyquist count twice.
    let nyquist = twice.len() / 2;
    let power = 2.0 * (1..nyquist).map(|n| gain(n).powi(2)).sum::<f64>() + gain(nyquist).powi(2);
    let scale = (twice.len() as f64 / power).sqrt();
    let mut lines = spectrum.lines().clone();
    for (n, mut row) in lines.row_iter_mut().enumerate() {
        row *= nalgebra::Complex::from(scale * gain(n));
    }
    let shaped = Spectrum::from_lines(twice, lines)?.to_record()?;
    Ok(shaped.channel(0)[..sampling.len()].to_vec())
}

/// Returns the stationary first-order process, computed by exact steps.
fn low_pass(
    sampling: Sampling,
    corner_hz: f64,
    rng: &mut ChaCha8Rng,
) -> Result<Vec<f64>, SignalError> {
    positive("corner frequency in Hz", corner_hz)?;
    let rate = std::f64::consts::TAU * corner_hz * sampling.dt();
    let (keep, renew) = ((-rate).exp(), (-(-2.0 * rate).exp_m1()).sqrt());
    let mut noise = white_channel(sampling, 1.0, rng);
    for k in 1..noise.len() {
        noise[k] = keep * noise[k - 1] + renew * noise[k];
    }
    Ok(noise)
}

/// Returns independent normal numbers of one channel.
pub(crate) fn white_channel(
    sampling: Sampling,
    standard_deviation: f64,
    rng: &mut ChaCha8Rng,
) -> Vec<f64> {
    let draw = |_| {
        let unit: f64 = StandardNormal.sample(rng);
        standard_deviation * unit
    };
    (0..sampling.len()).map(draw).collect()
}

/// Returns the random generator of one channel.
pub(crate) fn stream(seed: u64, channel: usize) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(channel as u64);
    rng
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

    /// Mean of x_k x_{k+lag} over many records, relative to the requested variance.
    fn correlation(colour: Colour, lag: usize) -> f64 {
        let r = coloured(axis(64), 4000, 3.0, colour, 8).unwrap();
        let product = |c: usize| r.channel(c)[20] * r.channel(c)[20 + lag];
        (0..r.channels()).map(product).sum::<f64>() / (r.channels() as f64 * 9.0)
    }

    #[test]
    fn every_colour_has_the_stated_deviation() {
        let colours = [
            Colour::White,
            Colour::PowerLaw { exponent: 1.0 },
            Colour::PowerLaw { exponent: 2.0 },
            Colour::PowerLaw { exponent: -2.0 },
            Colour::LowPass { corner_hz: 2.0 },
        ];
        for colour in colours {
            // 4000 records: the mean square scatters by √(2/4000) = 2.2 %.
            let power = correlation(colour, 0);
            assert!((power - 1.0).abs() < 4.0 * 0.0224, "{colour:?}: {power}");
        }
    }

    #[test]
    fn low_pass_noise_forgets_exponentially() {
        for lag in [1, 5, 10] {
            let got = correlation(Colour::LowPass { corner_hz: 2.0 }, lag);
            let expected = (-std::f64::consts::TAU * 2.0 * 0.01 * lag as f64).exp();
            assert!((got - expected).abs() < 4.0 * 0.0224, "lag {lag}: {got}, {expected}");
        }
    }

    #[test]
    fn power_laws_fall_as_stated() {
        for exponent in [0.0, 1.0, 2.0] {
            let r = coloured(axis(4096), 40, 1.0, Colour::PowerLaw { exponent }, 2).unwrap();
            let spectrum = Spectrum::from_record(&r.without_mean());
            // Power of two octave bands, three octaves apart and far from both ends of the
            // spectrum.
            let power = |from: usize| {
                let lines = spectrum.lines().rows(from, from);
                lines.iter().map(|z| z.norm_sqr()).sum::<f64>()
            };
            let fall = (power(64) / power(512)).log2() / 3.0;
            // With a density of 1/f^a, an octave band has 2^(1 − a) times the power of the next
            // lower band. Over 40 · 64 lines the power of each band scatters by 2 %. With an
            // exponent of 2 there is some leakage, because the record is not a period.
            assert!((fall - (exponent - 1.0)).abs() < 0.06, "{exponent}: {fall}");
        }
    }

    #[test]
    fn impossible_colours_are_refused() {
        let noise = |colour| coloured(axis(8), 1, 1.0, colour, 0);
        assert!(noise(Colour::PowerLaw { exponent: f64::NAN }).is_err());
        assert!(noise(Colour::LowPass { corner_hz: 0.0 }).is_err());
    }
}
