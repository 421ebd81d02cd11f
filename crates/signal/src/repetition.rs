//! Periods of records that repeat.

use crate::limits;
use crate::measures::aperiodic_autocorrelation;

/// Period of a record and its mismatch, from [`repetition`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Repetition {
    /// Number of samples of one period.
    pub period: usize,
    /// RMS difference of samples one period apart, divided by √2 times the RMS of the samples about
    /// their mean: 0 for exact repetition, 1 for white noise, and the noise-to-signal ratio for a
    /// periodic signal in little noise.
    pub mismatch: f64,
}

/// Returns the period of a signal (any unit) in samples: the smallest lag after which it repeats.
/// The record must contain at least two periods, and the mismatch ([`Repetition::mismatch`]) must
/// be at most 1/8.
///
/// The mismatch after two, three and more periods must be at most √2/8, for all multiples of the
/// period up to half the record.
///
/// A decaying or modulated vibration does not count: after one cycle it has the same shape, but
/// another amplitude. The difference d of two samples one period apart is then proportional to
/// their sum s; for noise, d does not depend on s. So d is fitted by κs (growth or decay) and τs′
/// (a shift in time by a fraction of a sample). If κs explains more than half of the part of d that
/// τs′ does not explain, the record does not repeat.
///
/// A slow signal also resembles itself a few samples later; the search begins at the first lag at
/// which the signal does not resemble itself. A period of a fractional number of samples is not
/// found, but an almost integer multiple may be.
///
/// ```
/// use mechid_signal::repetition;
///
/// let omega = std::f64::consts::TAU / 25.0;
/// let sine: Vec<f64> = (0..100).map(|k| (omega * k as f64).sin()).collect();
/// let repetition = repetition(&sine).unwrap();
/// assert_eq!(repetition.period, 25);
/// assert!(repetition.mismatch < 1e-14);
/// ```
///
/// # Source
/// Ours, by the autocorrelation ([`aperiodic_autocorrelation`]).
pub fn repetition(samples: &[f64]) -> Option<Repetition> {
    let len = samples.len();
    let mean = samples.iter().sum::<f64>() / len as f64;
    let centred: Vec<f64> = samples.iter().map(|x| x - mean).collect();
    let square: f64 = centred.iter().map(|x| x * x).sum();
    if square == 0.0 || !square.is_finite() {
        return None;
    }
    let differences = squared_mismatches(&centred);
    // The first lag at which a slow signal no longer resembles itself.
    let apart = (1..differences.len()).find(|lag| {
        differences[*lag]
            > limits::SLOW_SIGNAL * limits::PERIODIC_MISMATCH * limits::PERIODIC_MISMATCH
    })?;
    let best = differences[apart..].iter().copied().fold(f64::INFINITY, f64::min);
    if best > limits::PERIODIC_MISMATCH * limits::PERIODIC_MISMATCH {
        return None;
    }
    let is_equal = |lag: usize| {
        differences[lag] <= limits::EQUAL_LAGS * best.max(0.0) + limits::MISMATCH_ROUNDING
    };
    let throughout = |period: &usize| {
        let mut multiples = (*period..differences.len()).step_by(*period);
        multiples.all(|lag| {
            differences[lag]
                <= limits::EQUAL_LAGS * limits::PERIODIC_MISMATCH * limits::PERIODIC_MISMATCH
        })
    };
    let period = valleys(&differences, apart, is_equal).find(throughout)?;
    let repetition = Repetition { period, mismatch: mismatch(&centred, period) };
    (!grows_or_decays(&centred, period)).then_some(repetition)
}

/// Returns the lag of the smallest difference in each run of consecutive lags that are `alike`; the
/// search begins at the lag `first`. A run can have several lags, because a slow signal also
/// resembles itself at the lags around its period.
fn valleys(
    differences: &[f64],
    first: usize,
    alike: impl Fn(usize) -> bool,
) -> impl Iterator<Item = usize> {
    let mut at = first;
    std::iter::from_fn(move || {
        let begin = (at..differences.len()).find(|lag| alike(*lag))?;
        let end = (begin..differences.len()).find(|lag| !alike(*lag));
        at = end.unwrap_or(differences.len());
        (begin..at).min_by(|a, b| differences[*a].total_cmp(&differences[*b]))
    })
}

/// Returns whether more than half of the difference of samples one period apart is growth or decay:
/// the shape of the signal stays the same, and its amplitude changes by a factor in each period.
fn grows_or_decays(x: &[f64], period: usize) -> bool {
    let (early, late) = (&x[..x.len() - period], &x[period..]);
    let sum: Vec<f64> = early.iter().zip(late).map(|(a, b)| b + a).collect();
    let difference: Vec<f64> = early.iter().zip(late).map(|(a, b)| b - a).collect();
    let after = |k: usize| sum.get(k + 1).unwrap_or(&sum[k]);
    let slope: Vec<f64> = (0..sum.len()).map(|k| after(k) - sum[k.saturating_sub(1)]).collect();
    let stretch = limits::GROWTH_PAIRS.div_ceil(period) * period;
    let (mut shift, mut growth) = (0.0, 0.0);
    for ((d, s), t) in
        difference.chunks(stretch).zip(sum.chunks(stretch)).zip(slope.chunks(stretch))
    {
        if d.len() < limits::GROWTH_PAIRS.min(difference.len()) {
            continue;
        }
        let tt = product(t, t);
        let [of_sum, of_difference] =
            [s, d].map(|values| if tt > 0.0 { product(values, t) / tt } else { 0.0 });
        shift += of_difference * of_difference * tt;
        // A shift in time explains a part of the sums and of the differences of samples one period
        // apart; this part is removed.
        let ss = product(s, s) - of_sum * of_sum * tt;
        let ds = product(d, s) - of_difference * of_sum * tt;
        growth += if ss > limits::MISMATCH_ROUNDING * product(s, s) { ds * ds / ss } else { 0.0 };
    }
    let whole = product(&difference, &difference);
    growth > 0.5 * (whole - shift) && growth > limits::GROWTH_FRACTION * whole
}

fn product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Returns the squared mismatch for the lags 0 … ⌊N/2⌋, computed from the autocorrelation with an
/// error of the size of rounding.
fn squared_mismatches(x: &[f64]) -> Vec<f64> {
    let len = x.len();
    let products = aperiodic_autocorrelation(x);
    let total: f64 = x.iter().map(|v| v * v).sum();
    // Sums of the squares of the samples without a partner at this lag, at the end and at the
    // beginning.
    let (mut end, mut beginning) = (0.0, 0.0);
    let mut mismatches = Vec::with_capacity(len / 2 + 1);
    for lag in 0..=len / 2 {
        let overlap = (total - end) + (total - beginning);
        let difference = overlap - 2.0 * products[lag] * len as f64;
        mismatches.push(if overlap > 0.0 { difference / overlap } else { 1.0 });
        end += x[len - 1 - lag].powi(2);
        beginning += x[lag].powi(2);
    }
    mismatches
}

/// Returns the mismatch for one lag, without cancellation.
fn mismatch(x: &[f64], lag: usize) -> f64 {
    let (early, late) = (&x[..x.len() - lag], &x[lag..]);
    let difference: f64 = early.iter().zip(late).map(|(a, b)| (a - b).powi(2)).sum();
    let overlap: f64 = early.iter().zip(late).map(|(a, b)| a * a + b * b).sum();
    (difference / overlap).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lines;
    use crate::multisine::Multisine;
    use crate::noise::{NoiseLevel, add_white};
    use crate::phases::Phases;
    use crate::record::Record;
    use crate::sampling::Sampling;

    fn multisine(period: usize, periods: usize) -> Record {
        let sampling = Sampling::new(0.01, period).unwrap();
        let m = Multisine::flat(lines::odd(9), 1.0, Phases::Random { seed: 3 }).unwrap();
        m.sample(sampling).unwrap().repeated(periods).unwrap()
    }

    #[test]
    fn the_shortest_period_is_found_whatever_the_number_of_periods() {
        for (period, periods) in [(64, 2), (100, 3), (257, 7)] {
            let found = repetition(multisine(period, periods).channel(0)).unwrap();
            assert_eq!(found.period, period);
            assert!(found.mismatch < 1e-14, "{}", found.mismatch);
        }
        // The record ends within its third period.
        let whole = multisine(100, 3);
        assert_eq!(repetition(&whole.channel(0)[..253]).unwrap().period, 100);
        // Alternating signs repeat after two samples.
        assert_eq!(repetition(&[1.0, -1.0, 1.0, -1.0, 1.0]).unwrap().period, 2);
    }

    #[test]
    fn the_mismatch_is_the_noise_to_signal_ratio() {
        let clean = multisine(200, 10);
        for part in [0.001, 0.01, 0.08] {
            let noisy = add_white(&clean, NoiseLevel::FractionOfRms(part), 7).unwrap();
            let found = repetition(noisy.channel(0)).unwrap();
            assert_eq!(found.period, 200, "noise of {part}");
            // Noise increases both the difference and the RMS, so that the mismatch is part/√(1 +
            // part²). With 1800 pairs the relative standard error of the mismatch is 1/√3600.
            let expected = part / (1.0 + part * part).sqrt();
            assert!((found.mismatch / expected - 1.0).abs() < 0.07, "{}", found.mismatch);
        }
    }

    /// Checks that the period is found with noise of 10 % of the RMS. In the slowest signals, a
    /// sample differs from its neighbours as little as from the sample one period later.
    #[test]
    fn noise_of_a_tenth_hides_no_period() {
        for (period, periods) in [(64, 3), (100, 12), (257, 7), (1024, 8)] {
            let clean = multisine(period, periods);
            for seed in 0..20 {
                let noisy = add_white(&clean, NoiseLevel::FractionOfRms(0.1), seed).unwrap();
                let found = repetition(noisy.channel(0)).map(|found| found.period);
                assert_eq!(found, Some(period), "{periods} periods, seed {seed}");
            }
        }
    }

    fn free(damping: f64, hz: f64, seconds: f64) -> impl Iterator<Item = f64> {
        let omega = std::f64::consts::TAU * hz;
        (0..(1000.0 * seconds) as usize).map(move |k| {
            let t = k as f64 / 1000.0;
            (-damping * omega * t).exp() * ((1.0 - damping * damping).sqrt() * omega * t).sin()
        })
    }

    #[test]
    fn a_free_vibration_that_decays_does_not_repeat() {
        for damping in [0.001, 0.002, 0.005, 0.01, 0.02, 0.05] {
            for hz in [5.0, 17.0, 40.0, 83.7, 250.3] {
                for seconds in [0.5, 1.0, 2.0, 5.0] {
                    let ring: Vec<f64> = free(damping, hz, seconds).collect();
                    assert_eq!(repetition(&ring), None, "{damping}, {hz} Hz, {seconds} s");
                    // The reversed signal, which grows, does not repeat either.
                    let grown: Vec<f64> = ring.into_iter().rev().collect();
                    assert_eq!(repetition(&grown), None, "{damping}, {hz} Hz, {seconds} s");
                    let second = free(1.5 * damping, 2.6 * hz, seconds);
                    let two: Vec<f64> =
                        free(damping, hz, seconds).zip(second).map(|(a, b)| a + 0.4 * b).collect();
                    assert_eq!(repetition(&two), None, "{damping}, {hz} Hz, {seconds} s");
                }
            }
        }
    }

    /// Checks that no period is found in a record with 3/8 or 3/2 of a period of the modulation,
    /// because each cycle has another amplitude.
    #[test]
    fn a_modulated_vibration_does_not_repeat_within_its_modulation() {
        for depth in [0.1, 0.3, 0.9] {
            for (hz, modulation_hz) in [(20.0, 0.375), (17.3, 0.375), (20.0, 1.5), (33.0, 1.5)] {
                let wave = |k: usize| {
                    let turn = std::f64::consts::TAU * k as f64 / 1000.0;
                    (1.0 + depth * (modulation_hz * turn).cos()) * (hz * turn).sin()
                };
                let record: Vec<f64> = (0..1000).map(wave).collect();
                assert_eq!(repetition(&record), None, "{depth}, {hz} Hz, {modulation_hz} Hz");
                // A long record repeats after a whole number of periods of the modulation.
                let long: Vec<f64> = (0..16_000).map(wave).collect();
                let found = repetition(&long).unwrap();
                let cycles = found.period as f64 * modulation_hz / 1000.0;
                assert!((cycles - cycles.round()).abs() < 0.02 && cycles > 0.9, "{cycles}");
            }
        }
    }

    /// Checks a sine with a period of 76.1 samples. At multiples of 76 samples the first periods
    /// agree, but the fortieth does not; at multiples of 761 samples all periods agree. The result
    /// must be a whole number of periods, within 0.01 periods.
    #[test]
    fn a_fractional_period_is_found_at_a_multiple() {
        let turn = |k: usize| std::f64::consts::TAU * k as f64 / 76.1;
        let sampling = Sampling::new(1.0, 8000).unwrap();
        let sine = Record::from_channel(sampling, (0..8000).map(|k| turn(k).sin()).collect());
        let noisy = add_white(&sine.unwrap(), NoiseLevel::FractionOfRms(0.01), 1).unwrap();
        let found = repetition(noisy.channel(0)).unwrap();
        let turns = found.period as f64 / 76.1;
        assert!((turns - turns.round()).abs() < 0.01, "{}", found.period);
    }

    #[test]
    fn what_does_not_repeat_has_no_period() {
        let noise = Record::from_channel(Sampling::new(1.0, 1000).unwrap(), vec![0.0; 1000]);
        let noise = add_white(&noise.unwrap(), NoiseLevel::StandardDeviation(1.0), 1).unwrap();
        assert_eq!(repetition(noise.channel(0)), None);
        let ramp: Vec<f64> = (0..1000).map(f64::from).collect();
        assert_eq!(repetition(&ramp), None);
        // One and a half periods are less than the two periods that are necessary.
        assert_eq!(repetition(&multisine(100, 2).channel(0)[..150]), None);
        for few in [&[][..], &[1.0], &[2.0; 50]] {
            assert_eq!(repetition(few), None);
        }
    }
}
