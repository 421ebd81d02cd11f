//! Channels that are constant for some samples while the structure moves.

use std::fmt::{self, Formatter};

use mechid_signal::{Record, message};

use super::finding::{Channel, Check, Finding, Names, Quantity};
use super::limits::{
    DROP_OUT_FORCE_ACTING, DROP_OUT_FORCE_JUMP, DROP_OUT_FORCE_PAUSE, DROP_OUT_FORCE_SAMPLES,
    DROP_OUT_LEVEL, DROP_OUT_MOTION, DROP_OUT_NEIGHBOURS,
};
use super::{Subject, Verdict};

/// Channel that keeps one value for some samples, but changes before and after them: a drop-out of
/// the transmission.
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
    /// Value of the equal samples, in the unit of the channel.
    pub level: f64,
}

/// Finds the channels of a response or a force (any unit) whose longest run of equal samples is too
/// long for chance ([`Finding::DropOut`]).
///
/// The p-value is the probability that the second longest run would continue to the length of the
/// longest run. The p-value is computed from the rate at which the other runs of the record
/// continue, because a coarse converter and a slow motion cause many runs. A structure that comes
/// to rest moves by only a few steps of the converter; therefore the channel must move by many
/// steps on both sides of the run.
///
/// A force may also be zero by intention: between the hits of a hammer, or between bursts. A run in
/// a force is therefore a drop-out only if it is long enough, if it is a small part of the record,
/// and if the force acts at nearly all other samples. The run must also begin or end with a jump; a
/// run near the mean of the force needs a larger jump.
///
/// # Source
/// Ours: runs of a Markov chain are distributed geometrically.
pub fn dropped_channels(quantity: Quantity, response: &Record) -> Vec<Finding> {
    let one = |index: usize| {
        let x = response.channel(index);
        let (sample, samples) = longest_run(x)?;
        let channel = Channel { quantity, index };
        let finding = DropOut { channel, sample, samples, level: x[sample] };
        let by_intention = quantity == Quantity::Force && may_be_intended(x, sample, samples);
        let is_drop_out = p_value(x, sample, samples)? <= DROP_OUT_LEVEL && !by_intention;
        is_drop_out.then_some(Finding::DropOut(finding))
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
/// `None` if the channel does not move before the run, or does not move after it.
fn p_value(x: &[f64], sample: usize, samples: usize) -> Option<f64> {
    let (before, after) = (&x[..sample], &x[sample + samples..]);
    let step = smallest_change(x);
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

/// Returns the smallest change from sample to sample that is not zero.
fn smallest_change(x: &[f64]) -> f64 {
    let changes = x.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    changes.filter(|change| *change > 0.0).fold(f64::INFINITY, f64::min)
}

/// Returns whether a run of equal samples of a force may be part of the excitation. A run may be
/// intended if it is short, as at a smooth peak, or long, as a pause; if the force rests at other
/// times, too; or if the force comes to rest and begins again without a jump.
fn may_be_intended(x: &[f64], sample: usize, samples: usize) -> bool {
    let (before, after) = (&x[..sample], &x[sample + samples..]);
    let (level, rest) = (x[sample], DROP_OUT_MOTION * smallest_change(x));
    let acting = before.iter().chain(after);
    let acting = acting.filter(|f| (**f - level).abs() > rest).count();
    let (mean, jump) = (x.iter().sum::<f64>() / x.len() as f64, DROP_OUT_FORCE_JUMP * deviation(x));
    let least = if (mean - level).abs() > jump { rest } else { rest.max(jump) };
    let jumps = |f: Option<&f64>| f.is_some_and(|f| (f - level).abs() > least);
    let is_smooth = !(jumps(before.last()) || jumps(after.first()));
    samples < DROP_OUT_FORCE_SAMPLES
        || samples as f64 > DROP_OUT_FORCE_PAUSE * x.len() as f64
        || (acting as f64) < DROP_OUT_FORCE_ACTING * (x.len() - samples) as f64
        || is_smooth
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
    // The counts get one additional pair of equal neighbours. This pair continues with the
    // probability `rate`, the fraction of equal neighbours among all pairs. The result is therefore
    // never zero.
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
            "{} is {} from sample {} on, for {}, but changes before and after these samples: {}; choose a window \
             without these samples",
            names.channel(self.channel),
            message::number(self.level),
            self.sample + 1,
            message::count(self.samples, "sample"),
            if self.channel.quantity == Quantity::Force {
                "a drop-out of the transmission, or a pause of the excitation"
            } else {
                "a drop-out of the transmission"
            }
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

    /// Returns a slow oscillation with noise, rounded to the steps of a converter. The unit of
    /// `amplitude` and `noise` is one step.
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
            // Hits on a structure that comes to rest between the hits, at one level of the
            // converter, are not drop-outs.
            let decay = |k: usize| {
                (1e4 * (-0.02 * (k % 1000) as f64).exp() * (0.9 * k as f64).sin()).round()
            };
            let longer = 3000 + (seed as usize) % 900;
            let hits = (0..longer).map(|k| if k < 1700 { decay(k) } else { decay(k + 300) });
            assert_eq!(found(hits.collect()), [], "{seed}");
        }
        assert_eq!(found(vec![1.0; 100]), []);
    }

    const SAMPLES: usize = 4096;

    /// Forces of usual tests, by name, as fractions of the largest; `seed` changes phases and
    /// noise.
    fn excitations(seed: u64) -> Vec<(&'static str, Vec<f64>)> {
        let sampling = Sampling::new(0.01, SAMPLES).unwrap();
        let noise = noise::white(sampling, 1, 0.25, seed).unwrap();
        let (random, phase) = (noise.channel(0), seed as f64);
        let of = |value: &dyn Fn(usize) -> f64| (0..SAMPLES).map(value).collect::<Vec<f64>>();
        let t = |k: usize| k as f64 / SAMPLES as f64;
        // A burst takes 70 % of each period; with a `shift`, the record may begin within a burst.
        let burst = |periods: usize, shift: usize| {
            let len = SAMPLES / periods;
            of(&|k| if (k + shift) % len < len * 7 / 10 { random[k] } else { 0.0 })
        };
        let sweep = |rest: f64| {
            of(&move |k| {
                let at = (2.0 * t(k)).fract();
                let x = at / (1.0 - rest);
                if x < 1.0 { (TAU * (3.0 * x + 40.0 * x * x)).sin() } else { 0.0 }
            })
        };
        let mut hits = vec![0.0; SAMPLES];
        for start in [20 + seed as usize % 50, 900, 2900 + seed as usize % 300, 2960] {
            for k in 0..12 {
                hits[start + k] = (TAU * (k as f64 + 0.5) / 24.0).sin();
            }
        }
        let multisine = of(&|k| {
            (1..40)
                .map(|n| (TAU * f64::from(n) * t(k) + f64::from(n * n) * 0.7 + phase).cos())
                .sum::<f64>()
                / 15.0
        });
        vec![
            ("random", random.to_vec()),
            ("burst random", burst(4, 0)),
            ("one burst", burst(1, 0)),
            ("pause between bursts", burst(1, SAMPLES / 2)),
            ("multisine", multisine),
            ("sweep", sweep(0.0)),
            ("sweep with rests", sweep(0.02)),
            ("hammer", hits),
            ("stepped sine", of(&|k| (TAU * (2 + k / 512) as f64 * 0.01 * k as f64).sin())),
            ("slow sine", of(&|k| 0.9 * (TAU * 3.0 * t(k) + phase).sin())),
        ]
    }

    /// Rounds to levels of a converter.
    fn converted(x: &[f64], levels: f64) -> Vec<f64> {
        x.iter().map(|x| (x * levels).round() / levels).collect()
    }

    fn force(x: Vec<f64>) -> Vec<Finding> {
        let sampling = Sampling::new(0.01, x.len()).unwrap();
        dropped_channels(Quantity::Force, &Record::from_channel(sampling, x).unwrap())
    }

    #[test]
    fn forces_that_rest_by_intention_are_not_named() {
        for seed in 0..30 {
            for (name, x) in excitations(seed) {
                for levels in [1e12, 30_000.0, 2000.0, 100.0, 20.0] {
                    assert_eq!(force(converted(&x, levels)), [], "{name}, {seed}, {levels}");
                }
            }
        }
    }

    /// The check reports at least 19 of 20 drop-outs of forces. It misses a drop-out only if the
    /// force is near its mean at both ends of the drop-out.
    #[test]
    fn drop_outs_of_forces_are_named() {
        let (mut all, mut named) = (0, 0);
        for seed in 0..20 {
            for (name, x) in excitations(seed) {
                if !["random", "multisine", "sweep", "stepped sine"].contains(&name) {
                    continue;
                }
                let start = 700 + 61 * seed as usize % 2500;
                for (samples, is_held) in [(30, false), (30, true), (90, false), (90, true)] {
                    let mut x = converted(&x, 30_000.0);
                    let level = if is_held { x[start - 1] } else { 0.0 };
                    x[start..start + samples].fill(level);
                    let found = force(x);
                    all += 1;
                    named += found.len();
                    for finding in found {
                        let Finding::DropOut(drop) = finding else { panic!("{finding:?}") };
                        assert!(drop.sample.abs_diff(start) <= 3, "{drop:?}");
                    }
                }
            }
        }
        assert!(20 * named >= 19 * all, "{named} of {all}");
    }
}
