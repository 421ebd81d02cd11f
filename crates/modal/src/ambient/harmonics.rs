//! Sinusoids of machines in an ambient record: detection by Thomson's F-test with sine tapers, and
//! subtraction from the record.

use std::f64::consts::{PI, TAU};

use mechid_signal::{Record, transform};
use nalgebra::{Complex, DMatrix};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::error::AmbientError;
use super::limits::{HARMONIC_LEVEL, TAPERS};

/// Zero padding of the transform: frequencies are tested every quarter line.
const PADDING: usize = 4;

/// Number of steps in the refinement of a frequency; the step size is divided by 1.8 after each
/// step.
const REFINEMENTS: usize = 12;

/// Sinusoid of constant amplitude in an ambient record, usually from a machine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Harmonic {
    /// Frequency, in Hz.
    pub frequency_hz: f64,
    /// Channel that shows the sinusoid most clearly, counted from 0.
    pub channel: usize,
    /// Amplitude in the channel `channel`, in the unit of this channel.
    pub amplitude: f64,
    /// F statistic of a line relative to the neighbouring lines; it has 2 and 2 × tapers − 2
    /// degrees of freedom.
    pub statistic: f64,
    /// Probability of a statistic at least as large as this one in a record without harmonics, at
    /// any frequency of the band and in any channel (Bonferroni).
    pub p_value: f64,
    /// Excess kurtosis of the signal within two lines of the frequency: −1.5 for a sinusoid, 0 for
    /// a random response.
    pub kurtosis: f64,
}

/// Returns the harmonics of the channels in a band, by rising frequency.
///
/// A resonance does not count as a harmonic, even if its peak is sharp. Its amplitude and phase
/// vary over the record, so that the tapers give different amplitudes.
///
/// # Errors
/// [`AmbientError::Signal`] if the padded record cannot be transformed.
///
/// # Source
/// Thomson (1982), Proceedings of the IEEE 70, 1055–1096 (F-test); Riedel & Sidorenko (1995), IEEE
/// Transactions on Signal Processing 43, 188–195 (sine tapers).
pub fn harmonics(record: &Record, band_hz: [f64; 2]) -> Result<Vec<Harmonic>, AmbientError> {
    let record = record.without_mean();
    let len = record.len();
    let padded = PADDING * (len + 1);
    let step_hz = 1.0 / (padded as f64 * record.sampling().dt());
    let range = |edge: f64| (edge / step_hz).round().max(0.0) as usize;
    let guard = PADDING * TAPERS;
    let (from, to) =
        (range(band_hz[0]).max(guard), range(band_hz[1]).min((padded / 2).saturating_sub(guard)));
    if from >= to {
        return Ok(Vec::new());
    }
    let tested = ((to - from) / PADDING + 1) * record.channels();
    let distribution = FisherSnedecor::new(2.0, 2.0 * TAPERS as f64 - 2.0);
    let failed = AmbientError::Numerics { what: "the test of harmonics", size: TAPERS };
    let distribution = distribution.map_err(|_| failed)?;
    let sums = taper_sums(len);
    let mut peaks: Vec<(usize, Harmonic)> = Vec::new();
    for channel in 0..record.channels() {
        let lines = padded_lines(record.channel(channel), padded);
        for index in from..to {
            let statistic = f_statistic(&lines, index, &sums);
            // The lines of the padded record are a quarter of the line spacing of the record apart.
            // `tested` counts `PADDING` neighbouring lines as one test; the factor `PADDING` allows
            // for the best of them.
            let p_value = (PADDING as f64 * tested as f64 * distribution.sf(statistic)).min(1.0);
            if p_value < HARMONIC_LEVEL {
                let frequency_hz = index as f64 * step_hz;
                let (amplitude, kurtosis) = (0.0, 0.0);
                let harmonic =
                    Harmonic { frequency_hz, channel, amplitude, statistic, p_value, kurtosis };
                peaks.push((index, harmonic));
            }
        }
    }
    peaks.sort_by(|a, b| b.1.statistic.total_cmp(&a.1.statistic));
    let mut distinct: Vec<(usize, Harmonic)> = Vec::new();
    for (index, harmonic) in peaks {
        if distinct.iter().all(|(other, _)| index.abs_diff(*other) > guard / 2) {
            distinct.push((index, harmonic));
        }
    }
    let mut harmonics: Vec<Harmonic> =
        distinct.into_iter().map(|(_, harmonic)| measured(&record, harmonic)).collect();
    harmonics.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    Ok(harmonics)
}

/// Returns the sums of the tapers; the sums of even tapers are zero.
fn taper_sums(len: usize) -> Vec<f64> {
    let n1 = (len + 1) as f64;
    let taper =
        |j: usize, t: usize| (2.0 / n1).sqrt() * (PI * j as f64 * (t + 1) as f64 / n1).sin();
    (1..=TAPERS)
        .map(|j| if j % 2 == 1 { (0..len).map(|t| taper(j, t)).sum() } else { 0.0 })
        .collect()
}

fn padded_lines(samples: &[f64], padded: usize) -> Vec<Complex<f64>> {
    let plan = transform::forward(padded);
    let mut input = vec![0.0; padded];
    // The tapers count the samples from 1, so the record begins at index 1 of the input.
    input[1..=samples.len()].copy_from_slice(samples);
    let mut output = plan.make_output_vec();
    // The lengths match the plan, so that this cannot fail.
    let _ = plan.process(&mut input, &mut output);
    output
}

/// Returns Thomson's F statistic. The transform under a sine taper is the difference of two lines,
/// one on either side of the tested line.
fn f_statistic(lines: &[Complex<f64>], index: usize, sums: &[f64]) -> f64 {
    let half = PADDING / 2;
    let tapered =
        |j: usize| (lines[index - half * j] - lines[index + half * j]) / Complex::new(0.0, -2.0);
    let n1 = (lines.len() - 1) as f64 * 2.0 / PADDING as f64;
    let scale = (2.0 / n1).sqrt();
    let values: Vec<Complex<f64>> = (1..=TAPERS).map(|j| tapered(j) * scale).collect();
    let power: f64 = sums.iter().map(|s| s * s).sum();
    let mean = values.iter().zip(sums).map(|(v, s)| v * *s).sum::<Complex<f64>>() / power;
    let residual: f64 = values.iter().zip(sums).map(|(v, s)| (v - mean * *s).norm_sqr()).sum();
    (TAPERS as f64 - 1.0) * mean.norm_sqr() * power / residual.max(f64::MIN_POSITIVE)
}

/// Refines the frequency and measures amplitude and kurtosis in the channel that shows the
/// harmonic.
fn measured(record: &Record, mut harmonic: Harmonic) -> Harmonic {
    let dt = record.sampling().dt();
    let samples = record.channel(harmonic.channel);
    harmonic.frequency_hz = refined(samples, harmonic.frequency_hz, dt);
    let amplitude = fitted(samples, harmonic.frequency_hz * TAU * dt, true);
    harmonic.amplitude = amplitude.norm();
    harmonic.kurtosis = narrow_kurtosis(samples, harmonic.frequency_hz * dt);
    harmonic
}

/// Returns the frequency near `frequency_hz` where the amplitude of the sinusoid is largest.
fn refined(samples: &[f64], mut frequency_hz: f64, dt: f64) -> f64 {
    let mut step = 1.0 / (PADDING as f64 * samples.len() as f64 * dt);
    for _ in 0..REFINEMENTS {
        let power = |f: f64| fitted(samples, f * TAU * dt, true).norm_sqr();
        let candidates = [frequency_hz - step, frequency_hz, frequency_hz + step];
        let best = candidates.into_iter().max_by(|a, b| power(*a).total_cmp(&power(*b)));
        frequency_hz = best.unwrap_or(frequency_hz);
        step /= 1.8;
    }
    frequency_hz
}

/// Returns the complex amplitude of a sinusoid of `angle` radians per sample, with or without a
/// Hann window, which suppresses leakage from neighbouring sinusoids.
fn fitted(samples: &[f64], angle: f64, windowed: bool) -> Complex<f64> {
    let len = samples.len() as f64;
    let (turn, slow) = (Complex::cis(-angle), Complex::cis(TAU / len));
    let depth = if windowed { 1.0 } else { 0.0 };
    let (mut phase, mut window) = (Complex::from(1.0), Complex::from(1.0));
    let mut sum = Complex::default();
    for sample in samples {
        sum += phase * (sample * (1.0 - depth * window.re));
        phase *= turn;
        window *= slow;
    }
    sum * 2.0 / len
}

/// Returns the excess kurtosis of the signal in a band of two lines on either side of a frequency,
/// which is given in cycles per sample.
fn narrow_kurtosis(samples: &[f64], cycles: f64) -> f64 {
    let len = samples.len() as f64;
    let lines: Vec<Complex<f64>> = (-2..=2)
        .map(|offset| fitted(samples, TAU * (cycles + f64::from(offset) / len), false))
        .collect();
    let instants = 8 * lines.len();
    let envelope = |k: usize| {
        let turn = TAU * k as f64 / instants as f64;
        let part = |(i, z): (usize, &Complex<f64>)| z * Complex::cis(turn * (i as f64 - 2.0));
        lines.iter().enumerate().map(part).sum::<Complex<f64>>().norm_sqr()
    };
    let powers: Vec<f64> = (0..instants).map(envelope).collect();
    let mean = powers.iter().sum::<f64>() / instants as f64;
    let square = powers.iter().map(|p| p * p).sum::<f64>() / instants as f64;
    1.5 * square / (mean * mean) - 3.0
}

/// Returns the record without the sinusoids at `frequencies_hz`, fitted to each channel by least
/// squares.
///
/// # Errors
/// [`AmbientError::Numerics`] if two frequencies are too close to be separated,
/// [`AmbientError::Signal`].
pub(super) fn subtracted(record: &Record, frequencies_hz: &[f64]) -> Result<Record, AmbientError> {
    if frequencies_hz.is_empty() {
        return Ok(record.clone());
    }
    let (dt, len) = (record.sampling().dt(), record.len());
    let columns = 2 * frequencies_hz.len() + 1;
    let basis = DMatrix::from_fn(len, columns, |t, column| {
        let Some(index) = column.checked_sub(1) else { return 1.0 };
        let phase = TAU * frequencies_hz[index / 2] * dt * t as f64;
        if index % 2 == 0 { phase.cos() } else { phase.sin() }
    });
    let failed = AmbientError::Numerics { what: "the subtraction of harmonics", size: columns };
    let factor = basis.tr_mul(&basis).cholesky().ok_or(failed)?;
    let coefficients = factor.solve(&basis.tr_mul(record.data()));
    Ok(Record::new(record.sampling(), record.data() - basis * coefficients)?)
}
