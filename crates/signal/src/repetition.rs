//! Whether a record repeats, and after how many samples.

use crate::measures::aperiodic_autocorrelation;

/// What [`repetition`] finds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Repetition {
    /// Samples in one period.
    pub period: usize,
    /// RMS difference of samples one period apart, over √2 times the RMS of the samples about their
    /// mean: 0 if they repeat exactly, 1 for white noise, and the noise-to-signal ratio for a
    /// periodic signal in little noise.
    pub mismatch: f64,
}

/// Signals that differ more from period to period do not count as periodic.
const WORST: f64 = 0.1;

/// Lags of the same quality differ by this factor at most in the square of the mismatch.
const ALIKE: f64 = 2.0;

/// Squared mismatch that rounding in the Fourier transforms leaves of one that is zero.
const ROUNDING: f64 = 1e-12;

/// The shortest whole number of samples after which a signal, in any unit, repeats, if it does so
/// at least once in full and better than to a tenth of its RMS value.
///
/// A signal that changes slowly also resembles itself a few samples later; lags up to the first at
/// which it does not are left out. A period that is no whole number of samples is not found, but a
/// multiple that nearly is may be.
///
/// ```
/// use mechid_signal::repetition;
///
/// let sine: Vec<f64> = (0..100).map(|k| (std::f64::consts::TAU * k as f64 / 25.0).sin()).collect();
/// let found = repetition(&sine).unwrap();
/// assert_eq!(found.period, 25);
/// assert!(found.mismatch < 1e-14);
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
    // Behind the lags at which a slow signal resembles itself.
    let apart = (1..differences.len()).find(|lag| differences[*lag] > WORST * WORST)?;
    let best = differences[apart..].iter().copied().fold(f64::INFINITY, f64::min);
    if best > WORST * WORST {
        return None;
    }
    let alike = |lag: &usize| differences[*lag] <= ALIKE * best.max(0.0) + ROUNDING;
    let first = (apart..differences.len()).find(alike)?;
    // Around the period a slow signal resembles itself, too.
    let around = (first..differences.len()).take_while(alike);
    let period = around.min_by(|a, b| differences[*a].total_cmp(&differences[*b]))?;
    Some(Repetition { period, mismatch: mismatch(&centred, period) })
}

/// The square of the mismatch for the lags 0 … ⌊N/2⌋, by way of the autocorrelation: to rounding.
fn squared_mismatches(x: &[f64]) -> Vec<f64> {
    let len = x.len();
    let products = aperiodic_autocorrelation(x);
    let total: f64 = x.iter().map(|v| v * v).sum();
    // Squares left out at the end and at the beginning.
    let (mut end, mut beginning) = (0.0, 0.0);
    let mut all = Vec::with_capacity(len / 2 + 1);
    for lag in 0..=len / 2 {
        let overlap = (total - end) + (total - beginning);
        let difference = overlap - 2.0 * products[lag] * len as f64;
        all.push(if overlap > 0.0 { difference / overlap } else { 1.0 });
        end += x[len - 1 - lag].powi(2);
        beginning += x[lag].powi(2);
    }
    all
}

/// The same for one lag, without the cancellation.
fn mismatch(x: &[f64], lag: usize) -> f64 {
    let (early, late) = (&x[..x.len() - lag], &x[lag..]);
    let difference: f64 = early.iter().zip(late).map(|(a, b)| (a - b).powi(2)).sum();
    let overlap: f64 = early.iter().zip(late).map(|(a, b)| a * a + b * b).sum();
    (difference / overlap).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::{NoiseLevel, add_white};
    use crate::{Multisine, Phases, Record, Sampling, lines};

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
        // A record that ends within its third period.
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
            // Noise adds to both: part/√(1 + part²). 1800 pairs scatter by 1/√3600 of it.
            let expected = part / (1.0 + part * part).sqrt();
            assert!((found.mismatch / expected - 1.0).abs() < 0.07, "{}", found.mismatch);
        }
    }

    #[test]
    fn what_does_not_repeat_has_no_period() {
        let noise = Record::from_channel(Sampling::new(1.0, 1000).unwrap(), vec![0.0; 1000]);
        let noise = add_white(&noise.unwrap(), NoiseLevel::StandardDeviation(1.0), 1).unwrap();
        assert_eq!(repetition(noise.channel(0)), None);
        let ramp: Vec<f64> = (0..1000).map(f64::from).collect();
        assert_eq!(repetition(&ramp), None);
        // One period and a half is not once in full again.
        assert_eq!(repetition(&multisine(100, 2).channel(0)[..150]), None);
        for few in [&[][..], &[1.0], &[2.0; 50]] {
            assert_eq!(repetition(few), None);
        }
    }
}
