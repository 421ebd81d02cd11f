//! Clipping by an amplifier or a converter.

use crate::limits;

/// Level at which a channel is clipped, from [`clipping`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clipping {
    /// Level at which the channel is clipped, in its unit.
    pub level: f64,
    /// Number of samples at that level, in runs of three or more.
    pub samples: usize,
}

/// Returns the level at which a channel, in any unit, is clipped: its minimum or maximum, if runs
/// of three or more samples have exactly this extreme value and a run begins or ends with a jump.
/// If the channel is clipped at its minimum and its maximum, the level with more samples is
/// returned; `None` if the channel is not clipped.
///
/// Peaks of a signal behind a coarse converter, two-level signals (binary sequences, steps), values
/// repeated over several samples, and a constant value at rest do not count as clipping.
///
/// ```
/// use mechid_signal::clipping;
///
/// let sine: Vec<f64> = (0..200).map(|k| (0.1 * k as f64).sin()).collect();
/// let cut: Vec<f64> = sine.iter().map(|x| x.min(0.8)).collect();
/// assert_eq!(clipping(&sine), None);
/// assert_eq!(clipping(&cut).unwrap().level, 0.8);
/// ```
///
/// # Source
/// Ours.
pub fn clipping(samples: &[f64]) -> Option<Clipping> {
    let (low, high) = samples
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(*x), high.max(*x)));
    let at = |level: f64| samples.iter().filter(|x| **x == level).count() as f64;
    let count = samples.len() as f64;
    let (rests, cut): (Vec<_>, Vec<_>) = [(low, at(low)), (high, at(high))]
        .into_iter()
        .partition(|end| end.1 > limits::REST_FRACTION * count);
    let time = |ends: &[(f64, f64)]| ends.iter().map(|end| end.1).sum::<f64>();
    if time(&cut) > limits::TWO_LEVEL_FRACTION * (count - time(&rests)) {
        return None;
    }
    let runs = steep_runs(samples);
    let in_runs = |level: f64| runs.iter().filter(|run| run.0 == level).map(|run| run.1).sum();
    let at_ends = runs.iter().filter(|run| run.0 == low || run.0 == high).count();
    if runs.len() >= 2 * at_ends {
        return None;
    }
    cut.into_iter()
        .map(|(level, _)| Clipping { level, samples: in_runs(level) })
        .filter(|cut| cut.samples > 0)
        .max_by_key(|cut| cut.samples)
}

/// Returns value and length of every run of equal samples that begins or ends with a jump.
fn steep_runs(samples: &[f64]) -> Vec<(f64, usize)> {
    if !samples.chunk_by(|a, b| a == b).any(|run| run.len() >= limits::CLIPPED_RUN) {
        return Vec::new();
    }
    // The smallest difference between two values is taken as one step of the converter.
    let mut levels = samples.to_vec();
    levels.sort_unstable_by(f64::total_cmp);
    let steps = levels.windows(2).map(|x| x[1] - x[0]).filter(|step| *step > 0.0);
    let steep = limits::CLIPPED_JUMP * steps.fold(f64::INFINITY, f64::min);
    let (mut runs, mut first) = (Vec::new(), 0);
    for run in samples.chunk_by(|a, b| a == b) {
        let (value, end) = (run[0], first + run.len());
        let before = first.checked_sub(1).map(|k| samples[k]);
        let sides = [before, samples.get(end).copied()];
        if run.len() >= limits::CLIPPED_RUN
            && sides.into_iter().flatten().any(|x| (x - value).abs() > steep)
        {
            runs.push((value, run.len()));
        }
        first = end;
    }
    runs
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::excitation::Prbs;
    use crate::lines;
    use crate::multisine::Multisine;
    use crate::noise::{NoiseLevel, add_white};
    use crate::phases::Phases;
    use crate::record::Record;
    use crate::sampling::Sampling;

    fn multisine(seed: u64) -> Record {
        let flat = Multisine::flat(lines::odd(60), 1.0, Phases::Random { seed }).unwrap();
        flat.sample(Sampling::new(0.001, 1000).unwrap()).unwrap()
    }

    fn noisy(seed: u64) -> Vec<f64> {
        let level = NoiseLevel::FractionOfRms(0.01);
        add_white(&multisine(seed), level, seed).unwrap().channel(0).to_vec()
    }

    fn converted(samples: &[f64], step: f64) -> Vec<f64> {
        samples.iter().map(|x| step * (x / step).round()).collect()
    }

    #[test]
    fn clipping_is_found_on_either_side_and_after_a_converter() {
        for seed in 0..20 {
            let x = noisy(seed);
            let peak = x.iter().fold(0.0_f64, |peak, x| peak.max(x.abs()));
            for step in [1e-12, 1e-4 * peak, 0.01 * peak] {
                let x = converted(&x, step);
                let level = step * (0.5 * peak / step).round();
                for upper in [true, false] {
                    let cut = |x: &f64| if upper { x.min(level) } else { x.max(-level) };
                    let cut: Vec<f64> = x.iter().map(cut).collect();
                    let found = clipping(&cut).unwrap();
                    assert_eq!(found.level, if upper { level } else { -level });
                    let there = cut.iter().filter(|x| **x == found.level).count();
                    assert!(found.samples <= there && found.samples >= 3, "{found:?} {there}");
                }
            }
        }
        // One clipped hit of a hammer.
        let blow = |k: usize| if k < 20 { (TAU * k as f64 / 40.0).sin().min(0.7) } else { 0.0 };
        let hammer: Vec<f64> = (0..500).map(blow).collect();
        assert_eq!(clipping(&hammer).unwrap().level, 0.7);
    }

    #[test]
    fn signals_that_are_not_clipped_are_left_alone() {
        for seed in 0..50 {
            let x = noisy(seed);
            for step in [1e-12, 0.001, 0.03, 0.3] {
                assert_eq!(clipping(&converted(&x, step)), None, "seed {seed}, step {step}");
            }
            // Each value of the signal is repeated over eight samples, which is not clipping.
            let held: Vec<f64> = x.iter().flat_map(|x| [*x; 8]).collect();
            assert_eq!(clipping(&held), None, "seed {seed}");
        }
        // A slow sine behind a coarse converter has many equal samples at its largest value.
        let slow: Vec<f64> = (0..5000).map(|k| (TAU * k as f64 / 1000.0).sin()).collect();
        for step in [0.2, 0.01, 0.001, 0.0001] {
            assert_eq!(clipping(&converted(&slow, step)), None, "step {step}");
        }
        let binary = Prbs::new(7, 2.0, 5).unwrap();
        let binary = binary.sample(Sampling::new(0.01, 127 * 5).unwrap()).unwrap();
        assert_eq!(clipping(binary.channel(0)), None);
        // One hit without clipping, and then zero force.
        let blow = |k: usize| if k < 20 { (TAU * k as f64 / 40.0).sin() } else { 0.0 };
        assert_eq!(clipping(&(0..500).map(blow).collect::<Vec<_>>()), None);
        for few in [&[][..], &[1.0], &[2.0; 50]] {
            assert_eq!(clipping(few), None);
        }
    }
}
