//! Hits of an instrumented hammer, found in the force that it measures.

use std::fmt;
use std::ops::Range;

use crate::error::{not_negative, positive};
use crate::{Record, SignalError, clipping, message};

/// Part of its own peak above which a force belongs to the pulse of a hit.
const PULSE: f64 = 0.1;

/// Least peak, in standard deviations of the noise: of 10⁵ samples of Gaussian noise the largest and the
/// smallest are 9 of them apart.
const ABOVE_NOISE: f64 = 12.0;

/// Least peak, in steps of the converter: a force at rest flickers between two of its levels.
const ABOVE_STEP: f64 = 4.0;

/// Least part of the largest peak at which a peak counts for the usual one: between good hits there may be
/// many light ones.
const USUAL: f64 = 0.1;

/// Standard deviation of Gaussian noise over the median of its magnitude.
const GAUSSIAN: f64 = 1.482_602;

/// Least number of samples of a window that ends with the next one, over the median of all.
const SHORTEST: f64 = 0.25;

/// Samples before a pulse, over those of the pulse, where no number is given.
const BEFORE: usize = 2;

/// Rule by which hits are found in a force and bad ones are told from good ones.
///
/// ```
/// use mechid_signal::{HitRule, Sampling, excitation::HalfSine, hits};
///
/// let sampling = Sampling::from_rate_hz(1000.0, 4000)?;
/// let pulse = |peak, start| HalfSine::new(peak, start, 0.008)?.sample(sampling);
/// let pulses = [pulse(100.0, 0.5)?, pulse(4.0, 1.5)?, pulse(80.0, 2.5)?, pulse(30.0, 2.53)?];
/// let force: Vec<f64> = (0..4000).map(|k| pulses.iter().map(|p| p.channel(0)[k]).sum()).collect();
/// let found = hits(&force, sampling.dt(), &HitRule::default())?;
/// assert_eq!(found.all.len(), 3);
/// assert!(found.all[0].faults.is_empty());
/// assert_eq!(found.all[1].faults[0].to_string(), "weak hit: its peak is 4.0 % of the median peak");
/// assert_eq!(found.all[2].faults[0].to_string(), "double hit: a second peak of 37.5 % after 30.0 ms");
/// # Ok::<(), mechid_signal::SignalError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct HitRule {
    /// Force that begins a hit, in per cent of the largest force of the record. What is below does not end
    /// the window of the hit before it, although the machine responds to it.
    pub trigger_percent: f64,
    /// Least second peak of a double hit, in per cent of the first.
    pub double_percent: f64,
    /// Least peak of a hit, in per cent of the median of all peaks of a tenth of the largest or more.
    pub weak_percent: f64,
    /// Time after the trigger within which a force belongs to the same hit, in s. A hammer that bounces is
    /// struck by the machine some milliseconds to some hundredths of a second later, and the filters before
    /// the converter have come to rest by then.
    pub bounce_s: f64,
    /// Number of samples of a window before its pulse; `None`: twice those of the pulse.
    pub before: Option<usize>,
    /// Number of samples of a window; `None`: up to the window of the next hit.
    pub samples: Option<usize>,
}

impl Default for HitRule {
    fn default() -> Self {
        Self {
            trigger_percent: 0.5,
            double_percent: 5.0,
            weak_percent: 25.0,
            bounce_s: 0.1,
            before: None,
            samples: None,
        }
    }
}

impl HitRule {
    fn check(&self) -> Result<(), SignalError> {
        let percentages = [
            ("trigger in per cent", self.trigger_percent),
            ("second peak in per cent", self.double_percent),
            ("weak hit in per cent", self.weak_percent),
        ];
        for (what, value) in percentages {
            positive(what, value)?;
            if value > 100.0 {
                return Err(SignalError::Range { what, value, low: 0.0, high: 100.0 });
            }
        }
        not_negative("bounce", self.bounce_s)?;
        match self.samples {
            Some(0) => Err(SignalError::Empty),
            _ => Ok(()),
        }
    }
}

/// Hits of a record of force.
#[derive(Debug, Clone, PartialEq)]
pub struct Hits {
    /// Median of the force, in its unit: the offset of its transducer.
    pub offset: f64,
    /// Standard deviation of the force between the hits, in its unit.
    pub noise: f64,
    /// Every hit, good or bad, in order of time.
    pub all: Vec<Hit>,
}

/// One hit.
#[derive(Debug, Clone, PartialEq)]
pub struct Hit {
    /// Samples around the peak where the force is above a tenth of it, counted from 0.
    pub pulse: Range<usize>,
    /// Largest force less the offset, in its unit; negative if the hits are.
    pub peak: f64,
    /// Samples that belong to the hit, counted from 0: some before the pulse, and the response after it.
    pub window: Range<usize>,
    /// Faults that speak against it; none of a good hit.
    pub faults: Vec<HitFault>,
}

/// Reason not to use a hit.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[cfg_attr(feature = "serde", serde(tag = "fault", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum HitFault {
    /// The hammer bounces: the force has a second peak before the window ends.
    Double {
        /// Second peak, in per cent of the first.
        percent: f64,
        /// Time from the first peak to the second, in s; negative if the smaller one is first.
        after_s: f64,
    },
    /// The force is clipped.
    Overload {
        /// Level at which it is clipped, in its unit.
        level: f64,
    },
    /// A response is clipped.
    ResponseOverload {
        /// Channel of the response, counted from 0.
        channel: usize,
        /// Level at which it is clipped, in its unit.
        level: f64,
    },
    /// The peak is small against those of the others.
    Weak {
        /// Peak, in per cent of the usual one.
        percent: f64,
    },
    /// The record begins or ends within the pulse.
    Cut,
    /// The record ends too soon after the hit.
    RecordEnds {
        /// Number of samples in the window.
        samples: usize,
        /// Number of samples needed.
        needed: usize,
    },
    /// The next hit comes too soon.
    NextHit {
        /// Number of samples in the window.
        samples: usize,
        /// Number of samples needed.
        needed: usize,
    },
}

impl fmt::Display for HitFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Double { percent, after_s } => {
                let side = if after_s < 0.0 { "before" } else { "after" };
                let ms = 1e3 * after_s.abs();
                write!(f, "double hit: a second peak of {percent:.1} % {side} {ms:.1} ms")
            }
            Self::Overload { level } => {
                write!(f, "overload: the force is clipped at {}", message::number_to(level, 3))
            }
            Self::ResponseOverload { channel, level } => write!(
                f,
                "overload: response channel {} is clipped at {}",
                channel.saturating_add(1),
                message::number_to(level, 3)
            ),
            Self::Weak { percent } => {
                write!(f, "weak hit: its peak is {percent:.1} % of the median peak")
            }
            Self::Cut => f.write_str("the record begins or ends within the pulse"),
            Self::RecordEnds { samples, needed } => {
                write!(f, "the record ends after {samples} samples of its window, {needed} needed")
            }
            Self::NextHit { samples, needed } => {
                write!(
                    f,
                    "the next hit comes after {samples} samples of its window, {needed} needed"
                )
            }
        }
    }
}

/// Finds the hits of a hammer in its force, sampled every `dt` seconds.
///
/// A hit begins where the force passes the trigger level, counted from the median of all samples; its window
/// goes on to the next hit, however light, or is of the length that the rule says. What is smaller than 12
/// standard deviations of the noise between the hits, or than four steps of the converter, is noise.
///
/// # Errors
/// [`SignalError::NotPositive`], [`SignalError::Negative`], [`SignalError::Range`] and
/// [`SignalError::Empty`] for numbers of the rule that are none; [`SignalError::NotFinite`].
///
/// # Source
/// Ewins, *Modal Testing*, 2nd ed. (2000), chapter 3 (transient excitation by a hammer); the limits are ours.
pub fn hits(force: &[f64], dt: f64, rule: &HitRule) -> Result<Hits, SignalError> {
    rule.check()?;
    positive("time step", dt)?;
    if let Some((sample, value)) = force.iter().enumerate().find(|(_, f)| !f.is_finite()) {
        return Err(SignalError::NotFinite { sample, channel: 0, value: *value });
    }
    let offset = median(force.to_vec());
    let noise = GAUSSIAN * median(force.iter().map(|f| (f - offset).abs()).collect());
    let furthest = force.iter().map(|f| f - offset).max_by(|a, b| a.abs().total_cmp(&b.abs()));
    let sign = if furthest.unwrap_or(0.0) < 0.0 { -1.0 } else { 1.0 };
    let push: Vec<f64> = force.iter().map(|f| sign * (f - offset)).collect();
    let largest = furthest.unwrap_or(0.0).abs();
    // Of a pulse of few samples without noise the steps are large.
    let floor = (ABOVE_NOISE * noise).max((ABOVE_STEP * step(force)).min(USUAL * largest));
    if largest <= floor || largest == 0.0 {
        return Ok(Hits { offset, noise, all: Vec::new() });
    }
    let trigger = floor.max(0.01 * rule.trigger_percent * largest);
    let bounce = (rule.bounce_s / dt).ceil() as usize;
    let mut all: Vec<Hit> = Vec::new();
    let mut at = 0;
    while let Some(first) = (at..push.len()).find(|k| push[*k] > trigger) {
        let below = |from: usize| (from..push.len()).find(|k| push[*k] <= trigger);
        let end = first.saturating_add(bounce).max(below(first).unwrap_or(push.len()));
        at = below(end).unwrap_or(push.len());
        all.push(Hit::around(&push, first..end.min(push.len()), sign));
    }
    windows(&mut all, push.len(), rule);
    find_faults(&mut all, force, &push, dt, floor, rule);
    Ok(Hits { offset, noise, all })
}

impl Hits {
    /// Looks for clipped responses (samples × channels) in the window of every hit.
    ///
    /// # Errors
    /// [`SignalError::Range`] if the response ends before the last window does.
    ///
    /// # Source
    /// That of [`clipping()`].
    pub fn check_response(&mut self, response: &Record) -> Result<(), SignalError> {
        for hit in &mut self.all {
            let window = response.window(hit.window.start, hit.window.len())?;
            for channel in 0..window.channels() {
                if let Some(cut) = clipping(window.channel(channel)) {
                    let level = cut.level;
                    hit.faults.push(HitFault::ResponseOverload { channel, level });
                }
            }
        }
        Ok(())
    }

    /// Returns the force in the window of a hit, in its unit, one value per sample: less the offset, and zero
    /// away from the pulse (a *force window*), where the hammer touches nothing and the transducer shows its
    /// noise.
    ///
    /// # Panics
    /// If the window is not one of this force.
    ///
    /// # Source
    /// Ewins, *Modal Testing*, 2nd ed. (2000), the section on transient excitation.
    pub fn pulse_alone(&self, force: &[f64], hit: &Hit) -> Vec<f64> {
        let margin = hit.pulse.len();
        let kept = hit.pulse.start.saturating_sub(margin)..hit.pulse.end + margin;
        let value = |k: usize| if kept.contains(&k) { force[k] - self.offset } else { 0.0 };
        hit.window.clone().map(value).collect()
    }
}

impl Hit {
    /// The hit with its peak among some samples of a force that pushes upwards.
    fn around(push: &[f64], range: Range<usize>, sign: f64) -> Self {
        let at = largest_of(push, range);
        let limit = PULSE * push[at];
        let start = (0..at).rev().find(|k| push[*k] <= limit).map_or(0, |k| k + 1);
        let end = (at..push.len()).find(|k| push[*k] <= limit).unwrap_or(push.len());
        Self { pulse: start..end, peak: sign * push[at], window: start..end, faults: Vec::new() }
    }
}

/// Gives every hit its window, and the fault of one that is too short.
fn windows(all: &mut [Hit], samples: usize, rule: &HitRule) {
    let mut earliest = 0;
    for hit in all.iter_mut() {
        let before = rule.before.unwrap_or(BEFORE * hit.pulse.len());
        hit.window.start = hit.pulse.start.saturating_sub(before).max(earliest);
        earliest = hit.pulse.end;
    }
    let ends: Vec<usize> =
        all.iter().skip(1).map(|hit| hit.window.start).chain([samples]).collect();
    let rooms = all.iter().zip(&ends).map(|(hit, end)| (end - hit.window.start) as f64).collect();
    let least = (SHORTEST * median(rooms)).ceil() as usize;
    for (hit, end) in all.iter_mut().zip(ends) {
        let needed = rule.samples.unwrap_or(least);
        let got = end - hit.window.start;
        hit.window.end = match rule.samples {
            Some(samples) => hit.window.start + samples.min(got),
            None => end,
        };
        if hit.pulse.start == 0 || hit.pulse.end == samples {
            hit.faults.push(HitFault::Cut);
        } else if got < needed {
            hit.faults.push(match end == samples {
                true => HitFault::RecordEnds { samples: got, needed },
                false => HitFault::NextHit { samples: got, needed },
            });
        }
    }
}

fn find_faults(all: &mut [Hit], force: &[f64], push: &[f64], dt: f64, floor: f64, rule: &HitRule) {
    let heights = || all.iter().map(|hit| hit.peak.abs());
    let least = USUAL * heights().fold(0.0, f64::max);
    let usual = median(heights().filter(|peak| *peak >= least).collect());
    let everywhere = clipping(force).map(|cut| cut.level);
    for hit in all {
        let peak = hit.peak.abs();
        let least = floor.max(0.01 * rule.double_percent * peak);
        let window = hit.window.clone();
        let main = largest_of(push, hit.pulse.clone());
        let second = peaks(&push[window.clone()], least)
            .into_iter()
            .map(|at| window.start + at)
            .filter(|at| push[*at] >= least && *at != main)
            .max_by(|a, b| push[*a].total_cmp(&push[*b]));
        if let Some(at) = second {
            let after_s = (at as f64 - main as f64) * dt;
            hit.faults.push(HitFault::Double { percent: 100.0 * push[at] / peak, after_s });
        }
        let own = clipping(&force[window]).map(|cut| cut.level);
        let level = [everywhere, own].into_iter().flatten().find(|level| *level == force[main]);
        hit.faults.extend(level.map(|level| HitFault::Overload { level }));
        if peak < 0.01 * rule.weak_percent * usual {
            hit.faults.push(HitFault::Weak { percent: 100.0 * peak / usual });
        }
    }
}

/// Places of the maxima between which, and after which, the values fall by `prominence` or more.
fn peaks(values: &[f64], prominence: f64) -> Vec<usize> {
    let mut found = Vec::new();
    let (mut rising, mut extreme) = (true, 0);
    for (at, value) in values.iter().enumerate() {
        let further = match rising {
            true => *value > values[extreme],
            false => *value < values[extreme],
        };
        if further {
            extreme = at;
        } else if (value - values[extreme]).abs() >= prominence {
            if rising {
                found.push(extreme);
            }
            (rising, extreme) = (!rising, at);
        }
    }
    found
}

/// Smallest change from one sample to the next: a step of the converter, or next to nothing where it has very
/// many.
fn step(values: &[f64]) -> f64 {
    let changes = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|d| *d > 0.0);
    changes.fold(f64::INFINITY, f64::min)
}

/// Place of the largest value in a range that is not empty, the first of several.
fn largest_of(values: &[f64], range: Range<usize>) -> usize {
    let start = range.start;
    range.fold(start, |largest, at| if values[at] > values[largest] { at } else { largest })
}

/// Middle value; 0 of none.
fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Sampling;
    use crate::excitation::HalfSine;
    use crate::noise;

    const DT: f64 = 1e-3;

    fn sampling(samples: usize) -> Sampling {
        Sampling::new(DT, samples).unwrap()
    }

    /// Half-sines of 9 ms, with Gaussian noise of a standard deviation in N.
    fn record(pulses: &[(f64, f64)], samples: usize, noise_n: f64, seed: u64) -> Vec<f64> {
        let mut force =
            noise::white(sampling(samples), 1, noise_n, seed).unwrap().channel(0).to_vec();
        for (peak, start) in pulses {
            let pulse = HalfSine::new(*peak, *start, 9e-3).unwrap();
            for (k, f) in force.iter_mut().enumerate() {
                *f += pulse.value(k as f64 * DT);
            }
        }
        force
    }

    fn found(force: &[f64]) -> Hits {
        hits(force, DT, &HitRule::default()).unwrap()
    }

    fn faults(force: &[f64]) -> Vec<Vec<HitFault>> {
        found(force).all.into_iter().map(|hit| hit.faults).collect()
    }

    const FOUR: [(f64, f64); 4] = [(100.0, 1.0), (140.0, 3.0), (70.0, 5.1), (110.0, 6.9)];

    #[test]
    fn good_hits_are_found_with_their_windows() {
        for seed in 0..200 {
            let force = record(&FOUR, 9000, 0.2, seed);
            let found = found(&force);
            assert!((found.noise / 0.2 - 1.0).abs() < 0.1 && found.offset.abs() < 0.02);
            assert_eq!(found.all.len(), 4);
            for (hit, (peak, start)) in found.all.iter().zip(FOUR) {
                assert_eq!(hit.faults, [], "seed {seed}");
                assert!((hit.peak / peak - 1.0).abs() < 0.03, "{hit:?}");
                assert!(hit.pulse.start.abs_diff((start / DT) as usize) <= 2, "{hit:?}");
                assert!((7..=9).contains(&hit.pulse.len()), "{hit:?}");
                let alone = found.pulse_alone(&force, hit);
                let momentum: f64 = alone.iter().sum::<f64>() * DT;
                let exact = HalfSine::new(peak, start, 9e-3).unwrap().momentum();
                assert!((momentum / exact - 1.0).abs() < 0.03, "{momentum} {exact}");
                assert!(alone.iter().filter(|f| **f != 0.0).count() <= 3 * hit.pulse.len());
            }
            let ends: Vec<usize> = found.all.iter().map(|hit| hit.window.end).collect();
            let starts: Vec<usize> = found.all.iter().map(|hit| hit.window.start).collect();
            assert_eq!((ends[3], &ends[..3]), (9000, &starts[1..]));
        }
    }

    #[test]
    fn hits_may_pull_and_stand_on_an_offset() {
        let force: Vec<f64> = record(&FOUR, 9000, 0.2, 1).iter().map(|f| 5.0 - f).collect();
        let found = found(&force);
        assert!((found.offset - 5.0).abs() < 0.1);
        assert_eq!(found.all.len(), 4);
        assert!(found.all.iter().all(|hit| hit.peak < -60.0 && hit.faults.is_empty()));
    }

    #[test]
    fn double_hits_are_found_whichever_is_larger() {
        let with = |bounce: (f64, f64), noise_n| {
            let all = [&FOUR[..1], &[bounce], &FOUR[1..]].concat();
            let found = faults(&record(&all, 9000, noise_n, 3));
            assert_eq!(found.len(), 4);
            assert!(found[1..].iter().all(Vec::is_empty), "{found:?}");
            found[0].clone()
        };
        for (peak, start) in [(8.0, 1.04), (60.0, 1.02), (130.0, 1.02), (9.0, 1.07)] {
            let [HitFault::Double { percent, after_s }] = with((peak, start), 0.1)[..] else {
                panic!("{peak} {start}")
            };
            let (expected, after) = match peak > 100.0 {
                true => (1e4 / peak, 1.0 - start),
                false => (peak, start - 1.0),
            };
            assert!((percent - expected).abs() < 3.0, "{percent} {expected}");
            assert!((after_s - after).abs() < 2.5e-3, "{after_s} {after}");
        }
        // Below the limit, and below the noise.
        assert_eq!(with((3.0, 1.04), 0.1), []);
        assert_eq!(with((8.0, 1.04), 1.0), []);
    }

    #[test]
    fn light_hits_between_good_ones_end_the_window_and_are_told() {
        // From 14 standard deviations of the noise to a fifth of the hit before.
        for peak in [1.4, 2.0, 4.0, 7.0, 12.0, 20.0] {
            let all = [&FOUR[..1], &[(peak, 2.0)], &FOUR[1..]].concat();
            for seed in 0..20 {
                let found = found(&record(&all, 9000, 0.1, seed)).all;
                assert_eq!(found.len(), 5, "{peak} N, seed {seed}");
                let [HitFault::Weak { percent }] = found[1].faults[..] else {
                    panic!("{peak} N: {:?}", found[1].faults)
                };
                // Samples miss the tip of a pulse by 3 % at most, and a peak of 20 N counts for the median.
                let expected = if peak < 14.0 { peak / 1.1 } else { peak };
                assert!((percent - expected).abs() < 0.4 + 0.04 * expected, "{percent} {peak}");
                assert!(found[0].window.end <= 2000 && found[0].window.end > 1950);
                let others = [&found[..1], &found[2..]].concat();
                assert!(others.iter().all(|hit| hit.faults.is_empty()), "{others:?}");
            }
        }
    }

    #[test]
    fn many_light_hits_do_not_make_the_usual_one() {
        let light = [1.5, 2.0, 2.5, 3.6, 4.2, 5.7].map(|start| (5.0, start));
        let mut all = [&FOUR[..], &light].concat();
        all.sort_by(|a, b| a.1.total_cmp(&b.1));
        let found = faults(&record(&all, 9000, 0.1, 8));
        assert_eq!(found.len(), 10);
        for (of, (peak, _)) in found.iter().zip(all) {
            let weak = matches!(of[..], [HitFault::Weak { .. }]);
            assert!(if peak < 50.0 { weak } else { of.is_empty() }, "{peak} {of:?}");
        }
    }

    #[test]
    fn steps_of_the_converter_are_no_hits() {
        // At rest the force mostly stays on one level of 1 N, so that its noise has no median.
        for seed in 0..20 {
            let force: Vec<f64> =
                record(&FOUR, 9000, 0.25, seed).iter().map(|f| f.round()).collect();
            let found = found(&force);
            assert_eq!((found.noise, found.all.len()), (0.0, 4), "seed {seed}");
        }
    }

    #[test]
    fn overloads_weak_hits_and_short_windows_are_told() {
        let clipped: Vec<f64> = record(&FOUR, 9000, 0.1, 4).iter().map(|f| f.min(104.0)).collect();
        let found = faults(&clipped);
        assert_eq!(found[1], [HitFault::Overload { level: 104.0 }]);
        assert_eq!(found[3], [HitFault::Overload { level: 104.0 }]);
        assert!(found[0].is_empty() && found[2].is_empty());

        let weak = [&FOUR[..3], &[(20.0, 6.9)]].concat();
        let found = faults(&record(&weak, 9000, 0.1, 5));
        assert!(
            matches!(found[3][..], [HitFault::Weak { percent }] if (15.0..25.0).contains(&percent))
        );

        // 0.3 s to the next hit, 0.1 s to the end of the record, half a pulse at its beginning.
        let near = [(90.0, -4e-3), (100.0, 2.0), (100.0, 4.0), (120.0, 4.3), (90.0, 8.9)];
        let mut force = record(&near[1..], 9000, 0.1, 6);
        for (k, f) in force.iter_mut().take(5).enumerate() {
            *f += 90.0 * (std::f64::consts::PI * (k as f64 + 4.0) / 9.0).sin();
        }
        let found = faults(&force);
        assert_eq!(found[0], [HitFault::Cut]);
        assert!(found[1].is_empty() && found[3].is_empty(), "{found:?}");
        assert!(
            matches!(found[2][..], [HitFault::NextHit { samples: 280..=320, .. }]),
            "{found:?}"
        );
        assert!(
            matches!(found[4][..], [HitFault::RecordEnds { samples: 100..=130, .. }]),
            "{found:?}"
        );
        // What is needed can be said.
        let rule = HitRule { samples: Some(110), before: Some(8), ..HitRule::default() };
        let found = hits(&force, DT, &rule).unwrap();
        let short = found.all.iter().filter(|hit| !hit.faults.is_empty()).count();
        assert_eq!(short, 2);
        assert!(found.all[1..4].iter().all(|hit| hit.window.len() == 110));
    }

    #[test]
    fn clipped_responses_speak_against_their_hit_only() {
        let force = record(&FOUR, 9000, 0.1, 7);
        let tone = |k: usize| (0.3 * k as f64).sin() * (-((k % 2000) as f64) / 500.0).exp();
        let cut = |k: usize| if (3000..5000).contains(&k) { tone(k).min(0.4) } else { tone(k) };
        let response = Record::from_channel(sampling(9000), (0..9000).map(cut).collect()).unwrap();
        let mut found = found(&force);
        found.check_response(&response).unwrap();
        let bad: Vec<bool> = found.all.iter().map(|hit| !hit.faults.is_empty()).collect();
        assert_eq!(bad, [false, true, false, false], "{:?}", found.all);
    }

    #[test]
    fn noise_is_no_hit_and_wrong_rules_are_refused() {
        for seed in 0..50 {
            assert!(found(&record(&[], 20_000, 1.0, seed)).all.is_empty(), "seed {seed}");
        }
        assert!(found(&[]).all.is_empty() && found(&[3.0; 10]).all.is_empty());
        let refused = |rule: HitRule| hits(&[0.0, 1.0, 0.0], DT, &rule).unwrap_err();
        let usual = HitRule::default();
        refused(HitRule { trigger_percent: 0.0, ..usual.clone() });
        refused(HitRule { double_percent: 101.0, ..usual.clone() });
        refused(HitRule { weak_percent: f64::NAN, ..usual.clone() });
        refused(HitRule { bounce_s: -1.0, ..usual.clone() });
        assert_eq!(refused(HitRule { samples: Some(0), ..usual.clone() }), SignalError::Empty);
        assert!(hits(&[f64::NAN], DT, &usual).is_err());
    }
}
