//! Part of a free decay that is large against the quantisation steps of the analogue-digital
//! converter.

use mechid_signal::{Record, quantisation_step};

/// Number of intervals into which a record is divided; the range of each channel is computed in
/// every interval.
const INTERVALS: usize = 64;
/// Minimum number of samples of an interval.
const SHORTEST: usize = 32;
/// Minimum range of a channel in an interval, in quantisation steps; with a smaller range, rounding
/// distorts the motion.
const STEPS: f64 = 12.0;
/// Minimum range of a channel, in quantisation steps, in the interval where its range is largest;
/// with a smaller range, quantisation does not end the decay.
const LARGE: f64 = 8.0 * STEPS;

/// End of the part of a decay that the analogue-digital converter resolves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LastShown {
    /// Number of samples of the resolved part of the decay.
    pub samples: usize,
    /// Index, counted from 0, of the channel that first falls to a few quantisation steps.
    pub channel: usize,
    /// Quantisation step of the channel, in the unit of the channel.
    pub step: f64,
}

/// Returns the end of the part of a decay in which all channels span more than a few quantisation
/// steps; `None` if they always do.
///
/// After this part, the rounding error is not white noise: the converter turns a sinusoid of a few
/// steps into a square wave, and a smaller sinusoid into a constant.
///
/// # Source
/// Widrow & Kollár, *Quantization Noise* (2008), for the conditions of a white rounding error; the
/// limits are ours.
pub(super) fn last_shown(record: &Record) -> Option<LastShown> {
    let interval = record.len().div_ceil(INTERVALS).max(SHORTEST);
    let of_channel = |channel: usize| {
        let samples = record.channel(channel);
        let step = quantisation_step(samples)?;
        let range = |part: &[f64]| {
            let (low, high) =
                part.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
                    (low.min(*x), high.max(*x))
                });
            (high - low) / step
        };
        let ranges: Vec<f64> = samples.chunks(interval).map(range).collect();
        let largest = ranges.iter().copied().fold(0.0, f64::max);
        let shown = ranges.iter().rposition(|range| *range >= STEPS)? + 1;
        let samples = (shown * interval).min(record.len());
        (largest >= LARGE && samples < record.len()).then_some(LastShown { samples, channel, step })
    };
    (0..record.channels()).filter_map(of_channel).min_by_key(|last| last.samples)
}

/// Returns the channels, counted from 0, that span so few quantisation steps that their rounding
/// error is never white noise. Each is returned with its number of steps.
///
/// # Source
/// As [`last_shown`].
pub(super) fn coarse(record: &Record) -> Vec<(usize, usize)> {
    let span = |channel: usize| {
        let samples = record.channel(channel);
        let [low, high] = [f64::min, f64::max].map(|of| samples.iter().copied().reduce(of));
        let steps = ((high? - low?) / smallest_step(samples)?).round();
        (steps < LARGE).then_some((channel, steps as usize))
    };
    (0..record.channels()).filter_map(span).collect()
}

/// Returns the smallest difference between two values of a channel, in its unit, if it has only a
/// few different values.
fn smallest_step(samples: &[f64]) -> Option<f64> {
    let mut values = samples.to_vec();
    values.sort_unstable_by(f64::total_cmp);
    values.dedup();
    let few = values.len() > 1 && (values.len() as f64) < LARGE;
    let distances = values.windows(2).map(|pair| pair[1] - pair[0]);
    distances.reduce(f64::min).filter(|_| few)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use mechid_signal::{NoiseLevel, Sampling, noise};

    use super::*;

    /// Returns a decay with the initial amplitude 1, 20 Hz and a damping ratio of 1 %, rounded to
    /// steps of 1 / `steps`.
    fn decay(steps: f64, noise_steps: f64) -> Record {
        let sampling = Sampling::new(1.0 / 512.0, 4096).unwrap();
        let exact = |t: f64| (-0.01 * TAU * 20.0 * t).exp() * (TAU * 20.0 * t).cos();
        let exact = Record::from_fn(sampling, exact).unwrap();
        let level = NoiseLevel::StandardDeviation((noise_steps / steps).max(1e-12));
        let noisy = noise::add_white(&exact, level, 1).unwrap();
        Record::new(sampling, noisy.data().map(|x| (x * steps).round() / steps)).unwrap()
    }

    #[test]
    fn a_decay_ends_where_a_few_steps_are_left() {
        for steps in [128.0, 1024.0, 8192.0] {
            let found = last_shown(&decay(steps, 0.0)).unwrap();
            assert!((found.step * steps - 1.0).abs() < 1e-6);
            // The expected end is the time at which the range, twice the amplitude, is `STEPS`
            // steps.
            let end = (2.0 * steps / STEPS).ln() / (0.01 * TAU * 20.0);
            let found = found.samples as f64 / 512.0;
            assert!((found - end).abs() < 0.2, "{steps}: {found} {end}");
        }
        assert_eq!(coarse(&decay(20.0, 0.0)), [(0, 39)]);
        assert_eq!(coarse(&decay(1024.0, 0.0)), []);
        // With noise of a few quantisation steps, the whole decay is used.
        assert_eq!(last_shown(&decay(1024.0, 4.0)), None);
        let sampling = Sampling::new(0.01, 500).unwrap();
        let smooth = Record::from_fn(sampling, |t| (-t).exp() * (9.0 * t).cos()).unwrap();
        assert_eq!(last_shown(&smooth), None);
    }
}
