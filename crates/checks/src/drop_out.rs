//! Channels that are constant for some samples while the structure moves.

use std::fmt::{self, Formatter};

use mechid_signal::{Record, message};

use super::finding::{Channel, Check, Finding, Names, Quantity};
use super::limits::{DROP_OUT_LEVEL, DROP_OUT_MOTION, DROP_OUT_NEIGHBOURS};
use super::{Subject, Verdict};

/// Channel that keeps one value for some samples within its motion: a drop-out of the transmission.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct DropOut {
    /// Affected channel.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub channel: Channel,
    /// First sample of the run, counted from 0 in the window.
    #[cfg_attr(feature = "serde", serde(serialize_with = "crate::serialised::from_one"))]
    pub sample: usize,
    /// Number of samples in the run.
    pub samples: usize,
    /// Value of these samples, in the unit of the channel.
    pub level: f64,
}

/// Finds the channels of a response (any unit) whose longest run of equal samples is too long for
/// chance ([`Finding::DropOut`]).
///
/// The p-value is the probability that the second longest run would continue to the length of the
/// longest, with the continuation rate of runs in the rest of the record: a coarse converter and a
/// slow motion have many runs. A structure that comes to rest moves by only a few steps of the
/// converter; therefore the channel must move by many steps on both sides of the run.
///
/// # Source
/// Ours: runs of a Markov chain are distributed geometrically.
pub fn dropped_channels(quantity: Quantity, response: &Record) -> Vec<Finding> {
    let one = |index: usize| {
        let x = response.channel(index);
        let (sample, samples) = longest_run(x)?;
        let channel = Channel { quantity, index };
        let finding = DropOut { channel, sample, samples, level: x[sample] };
        (p_value(x, sample, samples)? <= DROP_OUT_LEVEL).then_some(Finding::DropOut(finding))
    };
    (0..response.channels()).filter_map(one).collect()
}

/// Returns first sample and length of the longest run of equal samples.
fn longest_run(x: &[f64]) -> Option<(usize, usize)> {
    let mut start = 0;
    let runs = x.chunk_by(|a, b| a == b).map(|run| {
        let first = start;
        start += run.len();
        (first, run.len())
    });
    runs.max_by_key(|(first, len)| (*len, std::cmp::Reverse(*first)))
}

/// Returns the probability that the channel has a run of equal samples of this length by chance;
/// `None` unless the channel moves on both sides.
fn p_value(x: &[f64], sample: usize, samples: usize) -> Option<f64> {
    let (before, after) = (&x[..sample], &x[sample + samples..]);
    let changes = x.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|change| *change > 0.0);
    let step = changes.fold(f64::INFINITY, f64::min);
    let near = DROP_OUT_NEIGHBOURS;
    let moves =
        |side: &[f64]| side.len() >= near.min(samples) && deviation(side) >= DROP_OUT_MOTION * step;
    let near_before = &before[before.len().saturating_sub(near)..];
    if !(moves(near_before) && moves(&after[..after.len().min(near)])) {
        return None;
    }
    let runs = before.chunk_by(|a, b| a == b).chain(after.chunk_by(|a, b| a == b));
    let second = runs.map(<[f64]>::len).max()?;
    Some(continuation([before, after]).powf((samples - second) as f64))
}

/// Returns the standard deviation of samples.
fn deviation(x: &[f64]) -> f64 {
    let mean = x.iter().sum::<f64>() / x.len() as f64;
    (x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / x.len() as f64).sqrt()
}

/// Returns the probability that a run of two equal samples continues.
fn continuation(parts: [&[f64]; 2]) -> f64 {
    let (mut pairs, mut equal, mut twice) = (0_usize, 0_usize, 0_usize);
    for x in parts {
        pairs += x.len().saturating_sub(1);
        equal += x.windows(2).filter(|x| x[0] == x[1]).count();
        twice += x.windows(3).filter(|x| x[0] == x[1] && x[1] == x[2]).count();
    }
    // One additional pair, with the overall rate of equal neighbours, avoids a rate of zero.
    let rate = (equal as f64 + 1.0) / (pairs as f64 + 1.0);
    (twice as f64 + rate) / (equal as f64 + 1.0)
}

impl Check for DropOut {
    fn subject(&self) -> Subject {
        Subject::Range
    }

    fn verdict(&self) -> Verdict {
        Verdict::Bad
    }

    fn value(&self) -> f64 {
        self.samples as f64
    }

    fn sentence(&self, names: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} is {} from sample {} on, {} in a row, while it moves before and after: a drop-out of the transmission; \
             leave it out of the window",
            names.channel(self.channel),
            message::number(self.level),
            self.sample + 1,
            message::count(self.samples, "sample")
        )
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use mechid_model::ResponseQuantity;
    use mechid_signal::{Sampling, noise};

    use super::*;

    const QUANTITY: Quantity = Quantity::Response(ResponseQuantity::Displacement);

    fn found(x: Vec<f64>) -> Vec<Finding> {
        let sampling = Sampling::new(0.01, x.len()).unwrap();
        dropped_channels(QUANTITY, &Record::from_channel(sampling, x).unwrap())
    }

    /// A slow oscillation in noise, in steps of a converter; `amplitude` and `noise` count steps.
    fn motion(amplitude: f64, noise: f64, seed: u64) -> Vec<f64> {
        let sampling = Sampling::new(0.01, 4000).unwrap();
        let noise = noise::white(sampling, 1, noise.max(1e-9), seed).unwrap();
        let sine = |k: usize| amplitude * (TAU * 0.007 * k as f64).sin();
        (0..4000).map(|k| (sine(k) + noise.channel(0)[k]).round()).collect()
    }

    #[test]
    fn ten_samples_that_stand_still_are_named() {
        for (amplitude, noise) in [(20_000.0, 100.0), (20_000.0, 0.0), (300.0, 3.0)] {
            let good = motion(amplitude, noise, 1);
            for level in [0.0, good[1999]] {
                let mut x = good.clone();
                x[2000..2010].fill(level);
                let [Finding::DropOut(drop)] = &found(x)[..] else { panic!("{amplitude} {noise}") };
                assert!(drop.sample.abs_diff(2000) <= 1 && drop.samples >= 10, "{drop:?}");
            }
        }
    }

    #[test]
    fn coarse_converters_and_a_structure_at_rest_are_not() {
        for seed in 0..300 {
            for (amplitude, noise) in
                [(2.0, 0.0), (3.0, 0.3), (40.0, 0.2), (500.0, 1.0), (0.0, 0.4)]
            {
                assert_eq!(found(motion(amplitude, noise, seed)), [], "{amplitude} {noise} {seed}");
            }
            // Hits on a structure that comes to rest on one level.
            let decay = |k: usize| {
                (1e4 * (-0.02 * (k % 1000) as f64).exp() * (0.9 * k as f64).sin()).round()
            };
            let longer = 3000 + (seed as usize) % 900;
            let hits = (0..longer).map(|k| if k < 1700 { decay(k) } else { decay(k + 300) });
            assert_eq!(found(hits.collect()), [], "{seed}");
        }
        assert_eq!(found(vec![1.0; 100]), []);
    }
}
