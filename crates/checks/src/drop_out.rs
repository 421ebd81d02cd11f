//! Channels that stand still for some samples while the structure moves.

use std::fmt::{self, Formatter};

use mechid_signal::{Record, message};

use super::finding::{Channel, Check, Finding, Names, Quantity};
use super::limits::SIGNIFICANCE;
use super::{Subject, Verdict};

/// Number of samples on either side of a run by which it is judged; a longer run is judged by as many as it has.
const NEIGHBOURS: usize = 64;

/// A channel keeps one value for some samples within its motion: the transmission dropped out.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct DropOut {
    /// The channel.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub channel: Channel,
    /// First sample of the run, counted from 0 in the window.
    #[cfg_attr(feature = "serde", serde(serialize_with = "crate::serialised::from_one"))]
    pub sample: usize,
    /// Number of samples in the run.
    pub samples: usize,
    /// Value that they have, in the unit of the channel.
    pub level: f64,
}

/// Finds the channels of a response (any unit) whose longest run of equal samples is one that chance does not make
/// ([`Finding::DropOut`]).
///
/// Equal neighbours in the samples on both sides give the probability that the next sample is equal once more; that of
/// the run, for all places where it may begin, is its p-value. A structure at rest, a coarse converter and a slow motion
/// have equal neighbours on at least one side.
///
/// # Source
/// Ours; Bonferroni's bound.
pub fn dropped_channels(quantity: Quantity, response: &Record) -> Vec<Finding> {
    let one = |index: usize| {
        let x = response.channel(index);
        let (sample, samples) = longest_run(x)?;
        let channel = Channel { quantity, index };
        let finding = DropOut { channel, sample, samples, level: x[sample] };
        (p_value(x, sample, samples)? <= SIGNIFICANCE).then_some(Finding::DropOut(finding))
    };
    (0..response.channels()).filter_map(one).collect()
}

/// First sample and length of the longest run of equal samples.
fn longest_run(x: &[f64]) -> Option<(usize, usize)> {
    let mut start = 0;
    let runs = x.chunk_by(|a, b| a == b).map(|run| {
        let first = start;
        start += run.len();
        (first, run.len())
    });
    runs.max_by_key(|(first, len)| (*len, std::cmp::Reverse(*first)))
}

/// Bound on the probability of such a run anywhere, by the side of it that has more equal neighbours; `None` without
/// samples on both sides.
fn p_value(x: &[f64], sample: usize, samples: usize) -> Option<f64> {
    let reach = NEIGHBOURS.max(samples);
    let end = sample + samples;
    let before = &x[sample.saturating_sub(reach)..sample];
    let after = &x[end..x.len().min(end + reach)];
    let least = NEIGHBOURS.min(samples);
    if before.len() < least || after.len() < least {
        return None;
    }
    let again = continuation(before).max(continuation(after));
    Some((x.len() as f64 * again.powf(samples as f64 - 1.0)).min(1.0))
}

/// Probability that a sample equals the one before, where that did so, too.
fn continuation(x: &[f64]) -> f64 {
    let equal: Vec<bool> = x.windows(2).map(|pair| pair[0] == pair[1]).collect();
    let count = equal.iter().filter(|equal| **equal).count() as f64;
    let twice = equal.windows(2).filter(|pair| pair[0] && pair[1]).count() as f64;
    // One sample more than was seen, with the frequency of equal neighbours at all.
    let rate = (count + 1.0) / (equal.len() as f64 + 1.0);
    (twice + rate) / (count + 1.0)
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
