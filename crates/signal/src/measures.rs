//! Quantities that help to choose an excitation.
//!
//! ```
//! use mechid_signal::{Multisine, Phases, Sampling, Spectrum, measures};
//!
//! let sampling = Sampling::new(0.01, 256)?; // lines every 0.39 Hz
//! let force = Multisine::flat(1..=127, 50.0, Phases::Schroeder)?.sample(sampling)?;
//! let spectrum = Spectrum::from_record(&force);
//! assert!(measures::crest_factor(&force, 0)? < 1.8);
//! assert!(measures::spectral_flatness(&spectrum, 0, 1..128)? > 1.0 - 1e-12);
//! // 127 lines and their mirror images: enough for 254 parameters.
//! assert_eq!(measures::persistent_excitation_order(&spectrum, 0, 1e-9)?, 254);
//! let band = measures::effective_band(&spectrum, 0, 20.0)?;
//! assert!((band.high_hz - 127.0 / 2.56).abs() < 1e-9);
//! # Ok::<(), mechid_signal::SignalError>(())
//! ```

use crate::error::{SignalError, has_channel, not_negative, within};
use crate::record::Record;
use crate::spectrum::Spectrum;
use crate::transform::forward;

/// Root mean square, in the unit of the samples; 0 for no samples.
///
/// # Source
/// Bendat & Piersol, *Random Data*, 4th ed. (2010), chapter 1.
pub fn rms(samples: &[f64]) -> f64 {
    let peak = peak(samples);
    if peak == 0.0 {
        return 0.0;
    }
    // Squares of very large samples overflow, those of very small ones underflow; scaling is exact.
    let unit = power_of_two(peak);
    let sum: f64 = samples.iter().map(|x| (x / unit).powi(2)).sum();
    unit * (sum / samples.len() as f64).sqrt()
}

/// Largest absolute value, in the unit of the samples; 0 for no samples.
pub fn peak(samples: &[f64]) -> f64 {
    samples.iter().fold(0.0, |m, x| m.max(x.abs()))
}

/// Ratio of peak to RMS of the samples, a pure number: 1 for a two-level signal, √2 for a sine.
///
/// It uses only the samples; [`Multisine::crest_factor`](crate::Multisine::crest_factor) also
/// covers the values between them.
///
/// # Errors
/// [`SignalError::Silent`] if the channel is zero, [`SignalError::NoSuchChannel`].
///
/// # Source
/// Pintelon and Schoukens, *System Identification: A Frequency Domain Approach*, on the choice of
/// excitation signals.
pub fn crest_factor(record: &Record, channel: usize) -> Result<f64, SignalError> {
    has_channel(channel, record.channels())?;
    let samples = record.channel(channel);
    let peak = peak(samples);
    if peak == 0.0 {
        return Err(SignalError::Silent { channel });
    }
    Ok(peak / rms(samples))
}

/// Half the range of the samples divided by √2 times their RMS about the mean, a pure number, 1 for
/// a sine: Schroeder's relative peak factor.
///
/// # Errors
/// [`SignalError::Silent`] if the channel is constant, [`SignalError::NoSuchChannel`].
///
/// # Source
/// Schroeder (1970), *Synthesis of low-peak-factor signals and binary sequences with low
/// autocorrelation*, IEEE Trans. Inf. Theory 16, 85–89.
pub fn relative_peak_factor(record: &Record, channel: usize) -> Result<f64, SignalError> {
    has_channel(channel, record.channels())?;
    let column = record.column(channel);
    let range = column.max() - column.min();
    if range == 0.0 {
        return Err(SignalError::Silent { channel });
    }
    let mean = column.mean();
    let centred: Vec<f64> = column.iter().map(|x| x - mean).collect();
    Ok(0.5 * range / (std::f64::consts::SQRT_2 * rms(&centred)))
}

/// α_k = (1/N) Σ x_n x_{n+k}, indices modulo N, for each lag k = 0 … N − 1, in the squared unit of
/// the samples; not finite if these squares overflow.
///
/// # Source
/// Dissertation eq. (4.3.1) with cyclic indices.
pub fn circular_autocorrelation(x: &[f64]) -> Vec<f64> {
    correlate(x, x.len())
}

/// α_k = (1/N) Σ_{n ≤ N−k} x_n x_{n+k}, for each lag k = 0 … N − 1, in the squared unit of the
/// samples; not finite if these squares overflow.
///
/// # Source
/// Dissertation eq. (4.3.1), with a sum that ends with the sequence.
pub fn aperiodic_autocorrelation(x: &[f64]) -> Vec<f64> {
    // Zeros after the sequence separate its end from its beginning.
    correlate(x, fast_length(2 * x.len()))
}

/// Returns the first N lags of the circular correlation of a sequence of N values, padded with
/// zeros to `period` values, divided by N.
fn correlate(x: &[f64], period: usize) -> Vec<f64> {
    if x.is_empty() {
        return Vec::new();
    }
    // Squares of very large samples overflow, those of very small ones underflow; scaling is exact.
    let unit = power_of_two(peak(x));
    let plan = forward(period);
    let (mut samples, mut lines) = (plan.make_input_vec(), plan.make_output_vec());
    let mut scratch = plan.make_scratch_vec();
    samples.iter_mut().zip(x).for_each(|(padded, x)| *padded = x / unit);
    plan.process_with_scratch(&mut samples, &mut lines, &mut scratch).expect("buffers of the plan");
    // The power of all lines is real and even, so that its forward and backward transforms agree.
    for (n, power) in samples.iter_mut().enumerate() {
        *power = lines[n.min(period - n)].norm_sqr();
    }
    plan.process_with_scratch(&mut samples, &mut lines, &mut scratch).expect("buffers of the plan");
    let scale = 1.0 / (period as f64 * x.len() as f64);
    (0..x.len()).map(|lag| scale * lines[lag.min(period - lag)].re * unit * unit).collect()
}

/// Returns the smallest 2ⁿ, 3·2ⁿ or 9·2ⁿ that is even and at least `least`: transforms of such
/// lengths are fast.
fn fast_length(least: usize) -> usize {
    let lengths = [1, 3, 9].map(|odd| odd * least.div_ceil(odd).max(2).next_power_of_two());
    lengths.into_iter().fold(usize::MAX, usize::min)
}

/// Returns the largest power of two up to a positive level, in the unit of the level; at least the
/// smallest normal number. Samples divided by it are near 1 and keep all digits.
pub fn power_of_two(level: f64) -> f64 {
    const EXPONENT: u64 = 0x7ff0_0000_0000_0000;
    f64::from_bits(level.to_bits() & EXPONENT).max(f64::MIN_POSITIVE)
}

/// Ratio of the geometric to the arithmetic mean of the power of some lines, a pure number: 1 if
/// all are equal, 0 if one is missing.
///
/// # Errors
/// [`SignalError::NoLines`] for an empty choice, [`SignalError::Range`] for a line outside the
/// spectrum, [`SignalError::Silent`] if none of them has power, [`SignalError::NoSuchChannel`].
///
/// # Source
/// Gray and Markel (1974), IEEE Trans. Acoustics, Speech, Signal Processing 22, 207–217.
pub fn spectral_flatness(
    spectrum: &Spectrum,
    channel: usize,
    lines: impl IntoIterator<Item = usize>,
) -> Result<f64, SignalError> {
    has_channel(channel, spectrum.channels())?;
    let highest = (spectrum.len() - 1) as f64;
    let mut power = Vec::new();
    for n in lines {
        within("line", n as f64, 0.0, highest)?;
        power.push(spectrum.line(n, channel).norm_sqr());
    }
    if power.is_empty() {
        return Err(SignalError::NoLines);
    }
    let mean = power.iter().sum::<f64>() / power.len() as f64;
    if mean == 0.0 {
        return Err(SignalError::Silent { channel });
    }
    // The sum of logarithms avoids a product that would underflow.
    let log = power.iter().map(|p| (p / mean).ln()).sum::<f64>() / power.len() as f64;
    Ok(log.exp())
}

/// Order of persistent excitation of a periodic signal: the number of parameters it can identify.
/// Each line between DC and Nyquist counts twice, DC and Nyquist once.
///
/// Lines below `floor` (a ratio) times the strongest do not count.
///
/// # Errors
/// [`SignalError::Negative`] for the floor, [`SignalError::Silent`] for a signal without power,
/// [`SignalError::NoSuchChannel`].
///
/// # Source
/// Ljung, *System Identification: Theory for the User*, section on persistence of excitation: the
/// order is the number of points of the two-sided spectrum that are not zero.
pub fn persistent_excitation_order(
    spectrum: &Spectrum,
    channel: usize,
    floor: f64,
) -> Result<usize, SignalError> {
    has_channel(channel, spectrum.channels())?;
    not_negative("floor", floor)?;
    let threshold = floor * strongest(spectrum, channel)?;
    let period = spectrum.sampling().len();
    let count = |n: usize| match spectrum.line(n, channel).norm() {
        a if a == 0.0 || a < threshold => 0,
        _ if n == 0 || 2 * n == period => 1,
        _ => 2,
    };
    Ok((0..spectrum.len()).map(count).sum())
}

/// A range of frequencies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Band {
    /// Lowest frequency, in Hz.
    pub low_hz: f64,
    /// Highest frequency, in Hz.
    pub high_hz: f64,
}

/// Returns the band from the first to the last line within `drop_db` (dB) of the strongest, without
/// DC.
///
/// # Errors
/// [`SignalError::Negative`] for the drop, [`SignalError::Silent`] for a signal without power
/// above DC, [`SignalError::NoSuchChannel`].
pub fn effective_band(
    spectrum: &Spectrum,
    channel: usize,
    drop_db: f64,
) -> Result<Band, SignalError> {
    has_channel(channel, spectrum.channels())?;
    not_negative("drop in dB", drop_db)?;
    let amplitude = |n: usize| spectrum.line(n, channel).norm();
    let strongest = (1..spectrum.len()).map(amplitude).fold(0.0, f64::max);
    let threshold = strongest * 10f64.powf(-drop_db / 20.0);
    let mut inside = (1..spectrum.len()).filter(|n| amplitude(*n) >= threshold);
    let (true, Some(first)) = (strongest > 0.0, inside.next()) else {
        return Err(SignalError::Silent { channel });
    };
    let last = inside.next_back().unwrap_or(first);
    let hz = |n| spectrum.frequency_hz(n);
    Ok(Band { low_hz: hz(first), high_hz: hz(last) })
}

/// Returns the largest amplitude of a channel, which must not be zero.
fn strongest(spectrum: &Spectrum, channel: usize) -> Result<f64, SignalError> {
    let amplitude = |n: usize| spectrum.line(n, channel).norm();
    match (0..spectrum.len()).map(amplitude).fold(0.0, f64::max) {
        0.0 => Err(SignalError::Silent { channel }),
        a => Ok(a),
    }
}
