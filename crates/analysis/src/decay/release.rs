//! Beginning of a free decay.

use mechid_checks::limits::SIGNIFICANCE;
use mechid_signal::{Record, Spectrum};
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Minimum ratio of the sum of squares at the beginning of the decay to the largest sum.
const LEVEL: f64 = 0.8;
/// Number of equal parts of a record; the mean of a channel over the last part is its constant
/// component.
const REST: usize = 4;
/// Number of intervals of time for the trend of the amplitude.
const PARTS: usize = 8;
/// Minimum number of intervals for a trend.
const FEWEST: usize = 5;
/// Minimum of twice the log-likelihood ratio for strong evidence that the amplitude decays from the
/// first large sample on; with less evidence, the decay does not begin at this sample.
const STRONG_EVIDENCE: f64 = 6.0;

/// Returns the beginning of a decay, counted from 0. A sample is large if the sum of the squares of
/// all channels, each divided by the power of the channel, is at least [`LEVEL`] of the largest
/// sum. The decay begins at the last large sample. It begins at the first large sample if the
/// amplitude decays from there, and at the first sample of the record if the amplitude grows over
/// most of it.
///
/// The last large sample follows a static release or the last cycles of a shaker; after an impact
/// it is at the peak. The mean of the last quarter is subtracted before the squares are taken.
pub(super) fn release(record: &Record) -> usize {
    let sums = sums(record);
    let largest = sums.iter().copied().fold(0.0, f64::max);
    let is_large = |sum: &f64| *sum > 0.0 && *sum >= LEVEL * largest;
    let (Some(first), Some(last)) =
        (sums.iter().position(is_large), sums.iter().rposition(is_large))
    else {
        return 0;
    };
    // A static load or a shaker keeps the amplitude constant before the release; a lightly damped
    // decay decreases from its beginning.
    let energies = energies(record, &sums[first..=last], first);
    if trend(&energies) < 0.0 && falls_throughout(&energies) {
        return first;
    }
    // The logarithm of an amplitude that grows exponentially rises linearly.
    let logarithms: Vec<f64> = crests(&sums[..=last]).iter().map(|crest| crest.ln()).collect();
    let rises = (sums.len() - last) * PARTS < sums.len() && trend(&logarithms) > 0.0;
    if rises { 0 } else { last }
}

/// Divides the `sums` into intervals and returns the logarithm of the mean of each interval. The
/// length of an interval is a whole number of periods of the strongest spectral line. The first sum
/// belongs to the sample `first`. The result is empty for a record without such a line, or with too
/// few periods.
fn energies(record: &Record, sums: &[f64], first: usize) -> Vec<f64> {
    let Ok(part) = record.window(first, record.len() - first) else { return Vec::new() };
    let spectrum = Spectrum::from_record(&part.without_mean());
    let crests: Vec<f64> = (0..record.channels()).map(|c| part.column(c).amax()).collect();
    let power = |line: usize| -> f64 {
        let powers = crests.iter().enumerate().map(|(channel, largest)| {
            if *largest > 0.0 { (spectrum.line(line, channel) / *largest).norm_sqr() } else { 0.0 }
        });
        powers.sum()
    };
    let Some(strongest) = (1..spectrum.len()).max_by(|a, b| power(*a).total_cmp(&power(*b))) else {
        return Vec::new();
    };
    let period = part.len() as f64 / strongest as f64;
    let periods = (sums.len() as f64 / (PARTS as f64 * period)).floor().max(1.0);
    let interval = (periods * period).round() as usize;
    let mean = |part: &[f64]| (part.iter().sum::<f64>() / part.len() as f64).ln();
    let means: Vec<f64> = sums.chunks_exact(interval.max(1)).map(mean).collect();
    if means.len() < FEWEST { Vec::new() } else { means }
}

/// Returns the largest sum in each of [`PARTS`] intervals of equal length. The list is empty if
/// there are fewer sums than intervals.
fn crests(sums: &[f64]) -> Vec<f64> {
    let part = sums.len() / PARTS;
    let of_part = |part: &[f64]| part.iter().copied().fold(0.0, f64::max);
    if part == 0 { Vec::new() } else { sums.chunks_exact(part).take(PARTS).map(of_part).collect() }
}

/// Returns whether there is strong evidence that values fall from the beginning, by the likelihood
/// ratio of two models: a straight line, and a constant followed by a straight line.
///
/// # Source
/// Kass & Raftery (1995), Journal of the American Statistical Association 90, 773–795, for the
/// limit of strong evidence.
fn falls_throughout(values: &[f64]) -> bool {
    let count = values.len() as f64;
    // Residual sum of squares of a model: the first `constant` values are constant, and a straight
    // line follows.
    let residual = |constant: usize| {
        let x = |at: usize| at.saturating_sub(constant) as f64;
        let [mean_x, mean] = [(0..values.len()).map(x).sum::<f64>(), values.iter().sum::<f64>()]
            .map(|sum| sum / count);
        let deviations = || values.iter().enumerate().map(|(at, y)| (x(at) - mean_x, y - mean));
        let [products, squares, total] = deviations()
            .fold([0.0; 3], |[xy, xx, yy], (x, y)| [xy + x * y, xx + x * x, yy + y * y]);
        total - products * products / squares
    };
    let later = (1..values.len().saturating_sub(2)).map(residual).fold(f64::INFINITY, f64::min);
    count * (residual(0) / later).ln() <= -STRONG_EVIDENCE
}

/// Returns the slope of a regression line through some values, and 0 if it is not significant.
///
/// # Source
/// Draper & Smith, *Applied Regression Analysis*, 3rd ed. (1998), chapter 1.
fn trend(values: &[f64]) -> f64 {
    let count = values.len() as f64;
    if values.len() < FEWEST {
        return 0.0;
    }
    let (middle, mean) = (0.5 * (count - 1.0), values.iter().sum::<f64>() / count);
    let (mut products, mut squares, mut total) = (0.0, 0.0, 0.0);
    for (at, value) in values.iter().enumerate() {
        let (x, y) = (at as f64 - middle, value - mean);
        products += x * y;
        squares += x * x;
        total += y * y;
    }
    let slope = products / squares;
    let error = ((total - slope * products).max(0.0) / (count - 2.0) / squares).sqrt();
    let student = StudentsT::new(0.0, 1.0, count - 2.0).expect("positive degrees of freedom");
    let ratio = (slope / error).abs();
    let is_scatter = ratio.is_nan() || student.sf(ratio) > SIGNIFICANCE;
    if is_scatter { 0.0 } else { slope }
}

/// Returns, at every sample, the sum of the squares of all channels, each divided by the power of
/// the channel.
fn sums(record: &Record) -> Vec<f64> {
    let len = record.len();
    let mut sums = vec![0.0; len];
    for channel in 0..record.channels() {
        let x = record.channel(channel);
        let largest = x.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
        if largest == 0.0 {
            continue;
        }
        let end = &x[len - len.div_ceil(REST)..];
        let mean = end.iter().map(|x| x / largest).sum::<f64>() / end.len() as f64;
        let squares = || x.iter().map(|x| (x / largest - mean).powi(2));
        let power: f64 = squares().sum();
        if power > 0.0 {
            sums.iter_mut().zip(squares()).for_each(|(sum, square)| *sum += square / power);
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use mechid_signal::Sampling;

    use super::*;

    fn release_of(value: impl Fn(f64) -> f64) -> f64 {
        let sampling = Sampling::new(1e-3, 4000).unwrap();
        release(&Record::from_fn(sampling, value).unwrap()) as f64 * 1e-3
    }

    /// Returns a decay that begins at 1 s, with a natural frequency of 10 Hz and a damping ratio of
    /// 2 %.
    fn after(t: f64) -> f64 {
        (-0.02 * TAU * 10.0 * (t - 1.0)).exp() * (TAU * 10.0 * (t - 1.0)).cos()
    }

    #[test]
    fn the_decay_begins_where_the_response_is_let_go() {
        // Before the release, the structure is at rest, pulled by a static load, or driven.
        let at_rest = release_of(|t| 5.0 + if t < 1.0 { 0.0 } else { after(t) });
        let pulled = release_of(|t| if t < 1.0 { 1.0 } else { after(t) });
        let driven = release_of(|t| if t < 1.0 { (TAU * 10.0 * t).cos() } else { after(t) });
        for found in [at_rest, pulled, driven] {
            assert!((1.0..1.1).contains(&found), "{found}");
        }
        // The static load acts for only 0.1 s before the release, which must still be detected.
        let shortly = release_of(|t| if t < 0.1 { 1.0 } else { after(t + 0.9) });
        assert!((0.1..0.25).contains(&shortly), "{shortly}");
        assert_eq!(release_of(|_| 0.0), 0.0);
    }

    #[test]
    fn a_light_decay_begins_at_its_first_crest_and_a_growth_at_the_first_sample() {
        let light = |t: f64| (-0.0027 * TAU * 2.0 * t).exp() * (TAU * 2.0 * t).cos();
        let found = release_of(light);
        assert!(found < 0.1, "{found}");
        let late = release_of(|t| if t < 0.5 { 0.0 } else { light(t - 0.5) });
        assert!((0.45..0.6).contains(&late), "{late}");
        let growing = release_of(|t| (0.4 * t).exp() * (TAU * 5.0 * t).cos());
        assert_eq!(growing, 0.0);
    }
}
