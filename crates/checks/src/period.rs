//! Check of a claimed period by the force.

use std::f64::consts::SQRT_2;
use std::fmt::{self, Formatter};

use mechid_signal::Record;
use mechid_signal::measures::aperiodic_autocorrelation;

use super::finding::{Check, Finding, Names};
use super::limits::{
    PERIOD_ALIKE, PERIOD_CLEARLY, PERIOD_INTERRUPTED, PERIOD_NEIGHBOURS, PERIOD_REPEATS,
    PERIOD_ROUNDING, PERIOD_WORST,
};
use super::{Subject, Verdict};

/// Checks a claimed period (in samples) with a force (N) that covers one or several claimed
/// periods; `None` if the force does not contradict it.
///
/// Three faults are detected ([`PeriodFault`]): the force repeats better after a period that is one
/// or two samples longer or shorter; it repeats after the claimed period except at one sample,
/// where samples are missing or inserted; or it repeats after a different number of samples, and
/// the claimed period is not a multiple of it. The last fault is detected even in a single claimed
/// period, if this contains at least four thirds of the true one; the text of the finding then
/// states how many samples were compared.
pub fn claimed_period(force: &Record, period: usize) -> Option<Finding> {
    let channels: Vec<Vec<f64>> = (0..force.channels()).filter_map(|c| unit(force, c)).collect();
    if channels.is_empty() || period == 0 || period > force.len() {
        return None;
    }
    let fault = neighbour(&channels, period)
        .or_else(|| interruption(&channels, period))
        .or_else(|| another(&channels, period))?;
    Some(Finding::WrongPeriod(WrongPeriod { claimed: period, fault }))
}

/// Returns a channel without its mean, scaled to an RMS of 1; `None` if it is constant.
fn unit(force: &Record, channel: usize) -> Option<Vec<f64>> {
    let x = force.channel(channel);
    let mean = x.iter().sum::<f64>() / x.len() as f64;
    let rms = (x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / x.len() as f64).sqrt();
    let size = x.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
    (rms > PERIOD_ROUNDING * size).then(|| x.iter().map(|x| (x - mean) / rms).collect())
}

/// Returns a neighbouring period after which the force repeats significantly better than after the
/// claimed period. Mismatches are RMS differences relative to √2 times the RMS of the force. The
/// next longer and shorter periods must be worse; otherwise the true period is not a neighbour.
fn neighbour(channels: &[Vec<f64>], period: usize) -> Option<PeriodFault> {
    let longest = period + PERIOD_NEIGHBOURS + 1;
    let pairs = channels[0].len().checked_sub(longest)?;
    if period <= PERIOD_NEIGHBOURS + 1 || pairs < period / 2 {
        return None;
    }
    let differences = |lag: usize| -> Vec<f64> {
        let squared_difference = |x: &Vec<f64>| -> Vec<f64> {
            (0..pairs).map(|k| (x[k + lag] - x[k]).powi(2)).collect()
        };
        channels.iter().flat_map(squared_difference).collect()
    };
    let sum = |squares: &[f64]| squares.iter().sum::<f64>();
    let claimed = differences(period);
    let (nearest, best) = (period - PERIOD_NEIGHBOURS - 1..=longest)
        .map(|lag| (lag, differences(lag)))
        .min_by(|a, b| sum(&a.1).total_cmp(&sum(&b.1)))?;
    if nearest.abs_diff(period) > PERIOD_NEIGHBOURS {
        return None;
    }
    let gain: Vec<f64> = claimed.iter().zip(&best).map(|(a, b)| a - b).collect();
    let scatter = gain.iter().map(|g| g * g).sum::<f64>().sqrt();
    let share = |squares: &[f64]| (0.5 * sum(squares) / squares.len() as f64).sqrt();
    let clear = share(&best) <= PERIOD_REPEATS
        && share(&claimed) > PERIOD_ROUNDING.sqrt()
        && sum(&gain) > PERIOD_CLEARLY * scatter;
    clear.then(|| PeriodFault::Neighbour {
        period: nearest,
        mismatch: share(&best),
        claimed_mismatch: share(&claimed),
    })
}

/// Returns the first sample that differs from the sample one claimed period earlier, if all
/// differing samples are in one stretch of at most a period. The mismatch is the RMS difference of
/// the other samples relative to √2 times the RMS of the force.
fn interruption(channels: &[Vec<f64>], period: usize) -> Option<PeriodFault> {
    let pairs = channels[0].len().checked_sub(period)?;
    // `pairs` is the number of pairs of samples that are one claimed period apart. The interruption
    // may affect `period` of these pairs; at least as many other pairs must remain.
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
    // The sum is computed again, because the difference of large sums would consist of rounding
    // errors.
    let outside: f64 = squares[..worst].iter().chain(&squares[worst + period..]).sum();
    let outside = outside / (pairs - period) as f64;
    if within(worst) <= PERIOD_WORST * PERIOD_WORST
        || outside > (PERIOD_WORST * PERIOD_WORST).min(within(worst) / PERIOD_INTERRUPTED)
    {
        return None;
    }
    // The limit for a differing sample is needed because a single sample may agree by chance with
    // the sample one period before, or differ from this sample by noise.
    let off = outside.max(within(worst) / PERIOD_INTERRUPTED);
    let first = (worst..worst + period).find(|k| squares[*k] > off)?;
    Some(PeriodFault::Interruption { sample: first + period, mismatch: outside.sqrt() })
}

/// Returns the shortest number of samples after which all channels repeat. `None` if they repeat
/// equally well after the claimed period, or if the claimed period is a multiple of this number.
fn another(channels: &[Vec<f64>], period: usize) -> Option<PeriodFault> {
    let squares = squared_mismatches(channels);
    // The search excludes the first lags, at which a slow force resembles itself.
    let apart = (1..squares.len()).find(|lag| squares[*lag] > PERIOD_WORST * PERIOD_WORST)?;
    let best = squares[apart..].iter().copied().fold(f64::INFINITY, f64::min).max(0.0);
    let repeats_equally = |lag: &usize| squares[*lag] <= PERIOD_ALIKE * best + PERIOD_ROUNDING;
    if best > PERIOD_WORST * PERIOD_WORST
        || squares.get(period).is_some_and(|_| repeats_equally(&period))
    {
        return None;
    }
    let first = (apart..squares.len()).find(repeats_equally)?;
    let around = (first..squares.len()).take_while(repeats_equally);
    let nearest = around.min_by(|a, b| squares[*a].total_cmp(&squares[*b]))?;
    // A signal with slow drift may repeat better after several periods; this does not contradict
    // the claimed period.
    let repeats = squares.get(period).is_some_and(|square| *square <= PERIOD_WORST * PERIOD_WORST);
    if repeats && nearest % period == 0 {
        return None;
    }
    // The true period may be half a sample longer or shorter than `nearest`, and this error adds up
    // over several periods.
    let times = (period as f64 / nearest as f64).round();
    let off = (period as f64 - times * nearest as f64).abs();
    (off > 0.5 * times + 0.5).then(|| PeriodFault::Other {
        period: nearest,
        mismatch: squares[nearest].max(0.0).sqrt(),
        samples: channels[0].len(),
    })
}

/// Returns, for each lag up to three quarters of the record, the squared differences of samples at
/// this distance relative to the sum of the squares of these samples; 1 if the overlapping samples
/// hardly vary.
fn squared_mismatches(channels: &[Vec<f64>]) -> Vec<f64> {
    let len = channels[0].len();
    let mut sums = vec![(0.0, 0.0); 3 * len / 4 + 1];
    for x in channels {
        let products = aperiodic_autocorrelation(x);
        let total: f64 = x.iter().map(|v| v * v).sum();
        // Sums of the squares outside the overlap, at the end and at the beginning.
        let (mut end, mut beginning) = (0.0, 0.0);
        for (lag, (difference, overlap)) in sums.iter_mut().enumerate() {
            let power = (total - end) + (total - beginning);
            *overlap += power;
            *difference += power - 2.0 * products[lag] * len as f64;
            end += x[len - 1 - lag].powi(2);
            beginning += x[lag].powi(2);
        }
    }
    let usual = |lag: usize| (2 * (len - lag) * channels.len()) as f64;
    let ratio = |(lag, (difference, overlap)): (usize, (f64, f64))| {
        if overlap > 0.5 * usual(lag) { difference / overlap } else { 1.0 }
    };
    sums.into_iter().enumerate().map(ratio).collect()
}

/// Claimed period after which the force does not repeat.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct WrongPeriod {
    /// Claimed period, in samples.
    pub claimed: usize,
    /// Way in which the force contradicts the stated period.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub fault: PeriodFault,
}

/// Contradiction of a claimed period by the force.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize),
    serde(tag = "fault", rename_all = "snake_case")
)]
pub enum PeriodFault {
    /// The force repeats better after a period that is one or two samples longer or shorter.
    Neighbour {
        /// Number of samples after which the force repeats best.
        period: usize,
        /// RMS difference between samples `period` samples apart, relative to √2 times the RMS
        /// of the force (pure number).
        mismatch: f64,
        /// RMS difference between samples one claimed period apart, relative to √2 times the RMS of
        /// the force (pure number).
        claimed_mismatch: f64,
    },
    /// The force repeats after the claimed period except at one sample, where samples are missing
    /// or inserted.
    Interruption {
        /// First sample that does not repeat, counted from 0 in the window.
        #[cfg_attr(feature = "serde", serde(serialize_with = "crate::serialised::from_one"))]
        sample: usize,
        /// RMS difference between samples one claimed period apart, outside the interruption,
        /// relative to √2 times the RMS of the force (pure number).
        mismatch: f64,
    },
    /// The force repeats after a different number of samples, and the claimed period is not a
    /// multiple of it.
    Other {
        /// Number of samples after which the force repeats.
        period: usize,
        /// RMS difference between samples `period` samples apart, relative to √2 times the RMS
        /// of the force (pure number).
        mismatch: f64,
        /// Number of samples of the force.
        samples: usize,
    },
}

impl Check for WrongPeriod {
    fn subject(&self) -> Subject {
        Subject::Periodicity
    }

    fn verdict(&self) -> Verdict {
        Verdict::Bad
    }

    fn value(&self) -> f64 {
        let samples = match self.fault {
            PeriodFault::Neighbour { period, .. } | PeriodFault::Other { period, .. } => period,
            PeriodFault::Interruption { .. } => self.claimed,
        };
        samples as f64
    }

    fn sentence(&self, _: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        self.fault.sentence(self.claimed, f)
    }
}

impl PeriodFault {
    fn sentence(&self, claimed: usize, f: &mut Formatter<'_>) -> fmt::Result {
        // A mismatch is relative to √2 times the RMS of the force.
        let percent = |mismatch: f64| format!("{:.2} %", 100.0 * SQRT_2 * mismatch);
        match *self {
            PeriodFault::Neighbour { period, mismatch, claimed_mismatch } => write!(
                f,
                "the period is {period} samples, not {claimed}: successive periods of the force differ by {} of its \
                 RMS; with {claimed} samples they differ by {}",
                percent(mismatch),
                percent(claimed_mismatch)
            ),
            PeriodFault::Interruption { sample, mismatch } => write!(
                f,
                "the force repeats every {claimed} samples, within {} of its RMS, but not across sample {} \
                 of the window, as if samples were missing or inserted there: use the samples on one side only",
                percent(mismatch),
                sample + 1
            ),
            PeriodFault::Other { period, mismatch, samples } => {
                let mismatch = percent(mismatch);
                match samples.checked_sub(period) {
                    Some(compared) if compared < period => write!(
                        f,
                        "the first {compared} of {samples} samples of the force repeat {period} samples \
                         later, within {mismatch} of its RMS"
                    )?,
                    _ => write!(
                        f,
                        "the force repeats every {period} samples, within {mismatch} of its RMS"
                    )?,
                }
                write!(
                    f,
                    ", and {claimed} samples are not a whole number of such periods: the lines used are \
                     not those of the force"
                )
            }
        }
    }
}
