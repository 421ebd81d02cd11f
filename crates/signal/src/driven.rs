//! Excited lines of a periodic signal, separated from its noise.

use nalgebra::DMatrix;

use crate::error::SignalError;
use crate::limits;
use crate::lines;
use crate::record::Record;
use crate::spectrum::Spectrum;

/// Returns the lines that at least one channel drives, without DC and Nyquist; none if no channel
/// varies. The record has consecutive periods of `period` samples.
///
/// A driven line has at least a thousandth of the amplitude of the strongest one, and exceeds the
/// noise:
///
/// - In several periods the noise is the part that changes from period to period. The periodic part
///   is compared with the median scatter of the 33 lines around it by Fisher's test, at a level of
///   0.1 % for all lines of the record together.
/// - In a single period the weakest lines (at least 16) are the noise if a gap is above them: the
///   next stronger line has more than 3 times the amplitude of the strongest of them.
///
/// If the driven lines have less than half of the power of each channel, because the excitation is
/// random or the period is wrong, all lines above a thousandth of the strongest amplitude count.
///
/// # Errors
/// The errors of [`Record::period_mean`].
///
/// # Source
/// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, on periodic
/// excitations: the scatter of the periods as the noise level of their mean.
pub fn driven_lines(record: &Record, period: usize) -> Result<Vec<usize>, SignalError> {
    let mean = record.period_mean(period)?;
    let lines_of_period = lines::full(mean.sampling());
    let spectrum = Spectrum::from_record(&mean);
    let (mut above_floor, mut above_noise) =
        (vec![false; lines_of_period.len()], vec![false; lines_of_period.len()]);
    let mut periodic = false;
    for channel in 0..record.channels() {
        let amplitude: Vec<f64> =
            lines_of_period.iter().map(|n| spectrum.line(*n, channel).norm()).collect();
        let strongest = amplitude.iter().copied().fold(0.0, f64::max);
        if strongest <= limits::CONSTANT_SIGNAL * mean.column(channel).amax() {
            continue;
        }
        let limits = match record.len() / period {
            1 => {
                vec![above_gap(&amplitude, limits::EXCITED_AMPLITUDE * strongest); amplitude.len()]
            }
            count => above_scatter(&scatter(record, &mean, channel)?, count),
        };
        let mut power = 0.0;
        for (at, (a, limit)) in amplitude.iter().zip(limits).enumerate() {
            let stands_out = *a >= limit.max(limits::EXCITED_AMPLITUDE * strongest);
            above_floor[at] |= *a >= limits::EXCITED_AMPLITUDE * strongest;
            above_noise[at] |= stands_out;
            power += if stands_out { 0.5 * a * a } else { 0.0 };
        }
        periodic |= power >= 0.5 * record.column(channel).variance();
    }
    let chosen = if periodic { above_noise } else { above_floor };
    Ok(lines_of_period
        .into_iter()
        .zip(chosen)
        .filter_map(|(n, driven)| driven.then_some(n))
        .collect())
}

/// Returns the variance of each line, without DC and Nyquist, over the periods of one channel.
fn scatter(record: &Record, mean: &Record, channel: usize) -> Result<Vec<f64>, SignalError> {
    let (period, count) = (mean.len(), record.len() / mean.len());
    let mut periods =
        DMatrix::from_column_slice(period, count, &record.channel(channel)[..period * count]);
    periods.column_iter_mut().for_each(|mut one| one -= mean.column(channel));
    let spectrum = Spectrum::from_record(&Record::new(mean.sampling(), periods)?);
    let variance = |n: &usize| spectrum.lines().row(*n).norm_squared() / (count - 1) as f64;
    Ok(lines::full(mean.sampling()).iter().map(variance).collect())
}

/// Returns, for each line, the smallest amplitude at which the line counts as driven. The amplitude
/// is that of the mean over `count` periods, and `scatter` has the variance of each line over the
/// periods.
fn above_scatter(scatter: &[f64], count: usize) -> Vec<f64> {
    let noise = |at: usize| {
        let around = at.saturating_sub(limits::NOISE_NEIGHBOURS)
            ..(at + limits::NOISE_NEIGHBOURS + 1).min(scatter.len());
        let mut around = scatter[around].to_vec();
        let (width, middle) = (around.len(), around.len() / 2);
        let (_, median, _) = around.select_nth_unstable_by(middle, f64::total_cmp);
        // Wilson and Hilferty's median of a χ² variable of 2(count − 1) degrees of freedom.
        let share = (1.0 - 1.0 / (9.0 * (count - 1) as f64)).powi(3);
        // A median has the precision of a mean of about half as many lines.
        let freedom = (width * (count - 1)) as f64;
        *median / share * fisher(limits::EXCITED_LEVEL / scatter.len() as f64, freedom)
            / count as f64
    };
    (0..scatter.len()).map(|at| noise(at).sqrt()).collect()
}

/// Returns the value that Fisher's F of 2 and `freedom` degrees of freedom exceeds with this
/// probability; the distribution function is 1 − (1 + 2F/ν)^(−ν/2).
fn fisher(probability: f64, freedom: f64) -> f64 {
    0.5 * freedom * (probability.powf(-2.0 / freedom) - 1.0)
}

/// Returns the smallest amplitude above the gap that separates driven lines from the noise of a
/// single period; 0 if there is no gap below an amplitude of at least `floor`.
fn above_gap(amplitude: &[f64], floor: f64) -> f64 {
    let mut sorted = amplitude.to_vec();
    sorted.sort_by(f64::total_cmp);
    let mut above = sorted.windows(2).skip(limits::NOISE_LINES - 1);
    above
        .find(|pair| pair[1] >= floor && pair[1] > limits::NOISE_GAP * pair[0])
        .map_or(0.0, |pair| pair[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::multisine::Multisine;
    use crate::noise::{NoiseLevel, add_white};
    use crate::phases::Phases;
    use crate::sampling::Sampling;

    const PERIOD: usize = 256;

    fn noisy(driven: &[usize], periods: usize, share: f64, seed: u64) -> Record {
        let sampling = Sampling::new(1.0 / 128.0, PERIOD).unwrap();
        let flat = Multisine::flat(driven.iter().copied(), 3.0, Phases::Schroeder).unwrap();
        let clean = flat.sample(sampling).unwrap().repeated(periods).unwrap();
        match share {
            0.0 => clean,
            share => add_white(&clean, NoiseLevel::FractionOfRms(share), seed).unwrap(),
        }
    }

    #[test]
    fn noise_on_a_multisine_drives_no_line() {
        let odd: Vec<usize> = (1..=61).step_by(2).collect();
        let all: Vec<usize> = (4..=60).collect();
        let every: Vec<usize> = (1..=127).collect();
        for driven in [odd, all, every] {
            for periods in [1, 2, 3, 16] {
                for share in [0.0, 1e-3, 0.01, 0.1] {
                    for seed in 0..20 {
                        let record = noisy(&driven, periods, share, seed);
                        let found = driven_lines(&record, PERIOD).unwrap();
                        assert_eq!(found, driven, "{periods} periods, noise of {share}");
                    }
                }
            }
        }
    }

    /// The amplitude of line 40 is a hundredth of the amplitude of the other lines. With noise of 2
    /// %, line 40 is significant only in the mean over many periods.
    #[test]
    fn many_periods_bring_a_weak_line_out() {
        let sampling = Sampling::new(1.0 / 128.0, PERIOD).unwrap();
        let strong = Multisine::flat(1..=30, 1.0, Phases::Schroeder).unwrap();
        let weak = Multisine::flat([40], 0.01, Phases::Schroeder).unwrap();
        let sum = strong.sample(sampling).unwrap().data() + weak.sample(sampling).unwrap().data();
        let sum = Record::new(sampling, sum).unwrap();
        let found = |periods: usize| {
            let noise = NoiseLevel::FractionOfRms(0.02);
            let record = add_white(&sum.repeated(periods).unwrap(), noise, 5).unwrap();
            driven_lines(&record, PERIOD).unwrap()
        };
        let strong: Vec<usize> = (1..=30).collect();
        assert_eq!(found(4), strong);
        assert_eq!(found(256), [strong, vec![40]].concat());
    }

    #[test]
    fn random_excitation_keeps_its_lines_and_a_constant_has_none() {
        let sampling = Sampling::new(0.01, PERIOD).unwrap();
        let still = Record::from_channel(sampling, vec![0.1; PERIOD]).unwrap();
        assert!(driven_lines(&still, PERIOD).unwrap().is_empty());
        let whole = sampling.with_len(4 * PERIOD).unwrap();
        let zero = Record::from_channel(whole, vec![0.0; 4 * PERIOD]).unwrap();
        let random = add_white(&zero, NoiseLevel::StandardDeviation(1.0), 3).unwrap();
        assert!(driven_lines(&random, PERIOD).unwrap().len() > 120);
        assert!(driven_lines(&random, 4 * PERIOD).unwrap().len() > 500);
        // If the window is not a period, the power of a multisine spreads over other lines.
        let record = noisy(&[4, 9, 16, 25, 36, 49, 64], 4, 0.01, 1);
        assert!(driven_lines(&record, 190).unwrap().len() > 80);
    }

    /// Checks that the quantile F is exceeded with the given probability. The references are the
    /// closed form of this probability and its limit e^(−F).
    #[test]
    fn fishers_quantile_has_its_probability() {
        for (probability, freedom) in [(0.05, 4.0), (1e-6, 33.0), (1e-3, 1e7)] {
            let f = fisher(probability, freedom);
            let upper = (1.0 + 2.0 * f / freedom).powf(-0.5 * freedom);
            assert!((upper / probability - 1.0).abs() < 1e-6);
        }
        assert!((fisher(1e-3, 1e7) / 1e3_f64.ln() - 1.0).abs() < 1e-5);
        // Tabulated: F(0.95; 2, 10) = 4.103.
        assert!((fisher(0.05, 10.0) - 4.103).abs() < 1e-3);
    }
}
