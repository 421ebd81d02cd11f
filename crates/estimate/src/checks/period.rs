//! Whether the force repeats after the period that is claimed.

use mechid_signal::Record;
use mechid_signal::measures::aperiodic_autocorrelation;

use super::{Check, Subject, Verdict};

/// A force that differs by more than this part of its RMS value is not said to repeat.
const WORST: f64 = 0.1;

/// Lags of the same quality differ by this factor at most in the square of the mismatch.
const ALIKE: f64 = 2.0;

/// Squared mismatch that rounding in the Fourier transforms leaves of one that is zero.
const ROUNDING: f64 = 1e-12;

/// A period claimed is compared with those that are up to so many samples longer or shorter.
const NEIGHBOURS: usize = 2;

/// Another period fits better if the gain in squares is this many times its own scatter.
const CLEARLY: f64 = 4.0;

/// What is wrong with a claimed period (in samples) by the force (N), the samples of which are one or
/// several such periods; nothing if nothing speaks against it.
///
/// Three things are looked at: whether the force returns to itself better after one or two samples
/// more or less; whether it returns after the claimed period but in one place, where samples are
/// missing or too many; and whether it repeats after another number of samples altogether, of which
/// the claimed one is no multiple. The last shows in a single claimed period, too, if it holds four
/// thirds of the true one or more; what is said is then said of the samples compared. The verdict is
/// bad, and its value the period found, in samples.
pub fn claimed_period(force: &Record, period: usize) -> Option<Check> {
    let channels: Vec<Vec<f64>> = (0..force.channels()).filter_map(|c| unit(force, c)).collect();
    if channels.is_empty() || period == 0 || period > force.len() {
        return None;
    }
    let (found, text) = match neighbour(&channels, period) {
        Some((found, [claimed, better])) => (
            found,
            format!(
                "the force differs from one period of {period} samples to the next by {} of its RMS \
                 value, after {found} samples by {} only: the period is {found} samples",
                percent(claimed),
                percent(better),
            ),
        ),
        None => match interruption(&channels, period) {
            Some((at, mismatch)) => (
                period,
                format!(
                    "the force repeats every {period} samples, to {} of its RMS value, but not across \
                     sample {} of the window, as if samples were missing there or too many: keep to \
                     one side of it",
                    percent(mismatch),
                    at + 1
                ),
            ),
            None => {
                let (found, mismatch) = another(&channels, period)?;
                (found, other_period(found, mismatch, period, force.len()))
            }
        },
    };
    let (subject, verdict) = (Subject::Periodicity, Verdict::Bad);
    Some(Check { subject, verdict, value: found as f64, text })
}

/// What is said of another period than the claimed one: of all samples, if each was compared with one
/// a period away, otherwise of those that were.
fn other_period(found: usize, mismatch: f64, period: usize, len: usize) -> String {
    let mismatch = percent(mismatch);
    let repeats = match len.checked_sub(found) {
        Some(compared) if compared < found => format!(
            "the first {compared} of {len} samples of the force come again {found} samples later, to \
             {mismatch} of its RMS value"
        ),
        _ => format!("the force repeats every {found} samples, to {mismatch} of its RMS value"),
    };
    format!(
        "{repeats}, and {period} samples are no whole number of that: the lines used are not those of \
         the force"
    )
}

fn percent(share: f64) -> String {
    format!("{:.2} %", 100.0 * share)
}

/// A channel about its mean, of RMS value 1; nothing if it does not vary.
fn unit(force: &Record, channel: usize) -> Option<Vec<f64>> {
    let x = force.channel(channel);
    let mean = x.iter().sum::<f64>() / x.len() as f64;
    let rms = (x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / x.len() as f64).sqrt();
    let size = x.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
    (rms > ROUNDING * size).then(|| x.iter().map(|x| (x - mean) / rms).collect())
}

/// A period close by that fits clearly better, and the differences after the claimed one and it, as
/// shares of √2 times the RMS value.
fn neighbour(channels: &[Vec<f64>], period: usize) -> Option<(usize, [f64; 2])> {
    let longest = period + NEIGHBOURS;
    let pairs = channels[0].len().checked_sub(longest)?;
    if period <= NEIGHBOURS || pairs < period / 2 {
        return None;
    }
    let differences = |lag: usize| -> Vec<f64> {
        let of = |x: &Vec<f64>| -> Vec<f64> {
            (0..pairs).map(|k| (x[k + lag] - x[k]).powi(2)).collect()
        };
        channels.iter().flat_map(of).collect()
    };
    let sum = |squares: &[f64]| squares.iter().sum::<f64>();
    let claimed = differences(period);
    let (found, best) = (period - NEIGHBOURS..=longest)
        .map(|lag| (lag, differences(lag)))
        .min_by(|a, b| sum(&a.1).total_cmp(&sum(&b.1)))?;
    let gain: Vec<f64> = claimed.iter().zip(&best).map(|(a, b)| a - b).collect();
    let scatter = gain.iter().map(|g| g * g).sum::<f64>().sqrt();
    let share = |squares: &[f64]| (0.5 * sum(squares) / squares.len() as f64).sqrt();
    let clear = share(&claimed) > ROUNDING.sqrt() && sum(&gain) > CLEARLY * scatter;
    clear.then(|| (found, [share(&claimed), share(&best)]))
}

/// Beyond the stretch in which they differ, samples one period apart differ less than in it by this
/// factor at least, in the square.
const INTERRUPTED: f64 = 10.0;

/// The first sample, counted from 0, that does not follow from the one a claimed period before, if
/// that holds of one stretch of a period at most and of no other; and by how much the others differ,
/// as a share of √2 times the RMS value.
fn interruption(channels: &[Vec<f64>], period: usize) -> Option<(usize, f64)> {
    let pairs = channels[0].len().checked_sub(period)?;
    // On both sides together there must be a period at least that meets the next one.
    if pairs < 2 * period {
        return None;
    }
    let square = |k: usize| -> f64 {
        channels.iter().map(|x| (x[k + period] - x[k]).powi(2)).sum::<f64>()
            / (2 * channels.len()) as f64
    };
    let squares: Vec<f64> = (0..pairs).map(square).collect();
    let mut sums = vec![0.0];
    sums.extend(squares.iter().scan(0.0, |sum, square| {
        *sum += square;
        Some(*sum)
    }));
    let within = |first: usize| (sums[first + period] - sums[first]) / period as f64;
    let stretches = 0..=pairs - period;
    let worst = stretches.max_by(|a, b| within(*a).total_cmp(&within(*b)))?;
    // Summed anew, for what is left of a large sum is rounding.
    let others: f64 = squares[..worst].iter().chain(&squares[worst + period..]).sum();
    let others = others / (pairs - period) as f64;
    if within(worst) <= WORST * WORST || others > (WORST * WORST).min(within(worst) / INTERRUPTED) {
        return None;
    }
    // A single sample may be like the one a period before by chance, or unlike it by noise.
    let off = others.max(within(worst) / INTERRUPTED);
    let first = (worst..worst + period).find(|k| squares[*k] > off)?;
    Some((first + period, others.sqrt()))
}

/// The shortest number of samples after which all channels repeat, if the claimed period is no
/// multiple of it and does not repeat as well, and how well it does.
fn another(channels: &[Vec<f64>], period: usize) -> Option<(usize, f64)> {
    let squares = squared_mismatches(channels);
    // Behind the lags at which a slow force resembles itself.
    let apart = (1..squares.len()).find(|lag| squares[*lag] > WORST * WORST)?;
    let best = squares[apart..].iter().copied().fold(f64::INFINITY, f64::min).max(0.0);
    let alike = |lag: &usize| squares[*lag] <= ALIKE * best + ROUNDING;
    if best > WORST * WORST || squares.get(period).is_some_and(|_| alike(&period)) {
        return None;
    }
    let first = (apart..squares.len()).find(alike)?;
    let around = (first..squares.len()).take_while(alike);
    let found = around.min_by(|a, b| squares[*a].total_cmp(&squares[*b]))?;
    // Each of so many may be half a sample longer or shorter.
    let times = (period as f64 / found as f64).round();
    let off = (period as f64 - times * found as f64).abs();
    (off > 0.5 * times + 0.5).then(|| (found, squares[found].max(0.0).sqrt()))
}

/// Squared differences of samples a lag apart over the squares of both, for the lags up to three
/// quarters of the record; 1 where what overlaps is nearly still.
fn squared_mismatches(channels: &[Vec<f64>]) -> Vec<f64> {
    let len = channels[0].len();
    let mut all = vec![(0.0, 0.0); 3 * len / 4 + 1];
    for x in channels {
        let products = aperiodic_autocorrelation(x);
        let total: f64 = x.iter().map(|v| v * v).sum();
        // Squares left out at the end and at the beginning.
        let (mut end, mut beginning) = (0.0, 0.0);
        for (lag, (difference, overlap)) in all.iter_mut().enumerate() {
            let own = (total - end) + (total - beginning);
            *overlap += own;
            *difference += own - 2.0 * products[lag] * len as f64;
            end += x[len - 1 - lag].powi(2);
            beginning += x[lag].powi(2);
        }
    }
    let usual = |lag: usize| (2 * (len - lag) * channels.len()) as f64;
    let ratio = |(lag, (difference, overlap)): (usize, (f64, f64))| {
        if overlap > 0.5 * usual(lag) { difference / overlap } else { 1.0 }
    };
    all.into_iter().enumerate().map(ratio).collect()
}
