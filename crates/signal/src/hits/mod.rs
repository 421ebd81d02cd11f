//! Hits of an instrumented hammer, detected in its force.

use std::fmt;
use std::ops::Range;
use std::str::FromStr;

use crate::clipping::clipping;
use crate::error::{SignalError, not_negative, positive};
use crate::limits;
use crate::message;
use crate::record::Record;

/// Ratio of the standard deviation of Gaussian noise to the median of its magnitude.
const GAUSSIAN: f64 = 1.482_602;

/// Rule that detects hits in a force and their faults.
///
/// ```
/// use mechid_signal::{HitRule, Sampling, excitation::HalfSine, hits};
///
/// let sampling = Sampling::from_rate_hz(1000.0, 4000)?;
/// let pulse = |peak, start| HalfSine::new(peak, start, 0.008)?.sample(sampling);
/// let pulses = [pulse(100.0, 0.5)?, pulse(4.0, 1.5)?, pulse(80.0, 2.5)?, pulse(30.0, 2.53)?];
/// let force: Vec<f64> = (0..4000).map(|k| pulses.iter().map(|p| p.channel(0)[k]).sum()).collect();
/// let hits = hits(&force, sampling.dt(), &HitRule::default())?.all;
/// assert_eq!(hits.len(), 3);
/// assert!(hits[0].faults.is_empty());
/// let fault = |hit: usize| hits[hit].faults[0].to_string();
/// assert_eq!(fault(1), "weak hit: its peak is 4.0 % of the median peak");
/// assert_eq!(fault(2), "double hit: a second peak of 37.5 % after 30.0 ms");
/// # Ok::<(), mechid_signal::SignalError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct HitRule {
    /// Force that begins a hit, in per cent of the largest force of the record. A smaller force
    /// does not end the window of the previous hit, although the structure responds to this force.
    pub trigger_percent: f64,
    /// Smallest second peak of a double hit, in per cent of the first.
    pub double_percent: f64,
    /// Smallest peak of a hit, in per cent of a median. This is the median of all peaks that reach
    /// at least a tenth of the largest peak.
    pub weak_percent: f64,
    /// Time after the trigger within which a force belongs to the same hit, in s. A bouncing hammer
    /// touches the structure again some milliseconds to some hundredths of a second after the
    /// trigger; the anti-aliasing filters also settle within this time.
    pub bounce_s: f64,
    /// Number of samples of a window before its pulse; `None`: twice the number of samples of the
    /// pulse.
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

impl FromStr for HitRule {
    type Err = String;

    /// Parses settings such as `trigger=0.5,double=5,weak=25,bounce=0.1,before=20,samples=512`. The
    /// first three are in per cent, `bounce` is in seconds, and the last two are in samples. Each
    /// setting is optional; an empty text gives the default rule.
    fn from_str(text: &str) -> Result<Self, String> {
        let mut rule = Self::default();
        for part in text.split(',').map(str::trim).filter(|part| !part.is_empty()) {
            let wrong = || {
                format!(
                    "\"{part}\" is not one of trigger=PERCENT, double=PERCENT, weak=PERCENT, bounce=SECONDS, \
                     before=SAMPLES, samples=SAMPLES"
                )
            };
            let (name, value) = part.split_once('=').ok_or_else(wrong)?;
            let number = || value.parse::<f64>().map_err(|_| wrong());
            let count = || value.parse::<usize>().map_err(|_| wrong());
            match name {
                "trigger" => rule.trigger_percent = number()?,
                "double" => rule.double_percent = number()?,
                "weak" => rule.weak_percent = number()?,
                "bounce" => rule.bounce_s = number()?,
                "before" => rule.before = Some(count()?),
                "samples" => rule.samples = Some(count()?),
                _ => return Err(wrong()),
            }
        }
        rule.check().map_err(|error| error.to_string())?;
        Ok(rule)
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
    /// Samples around the peak where the force is above a tenth of the peak, counted from 0.
    pub pulse: Range<usize>,
    /// Samples around the peak with a force, counted from 0: the pulse, light rebounds of the
    /// hammer, and the ringing of anti-aliasing filters as far as it exceeds the noise.
    pub contact: Range<usize>,
    /// Largest force after subtraction of the offset, in its unit; negative if the force of the
    /// hits is negative.
    pub peak: f64,
    /// Samples that belong to the hit, counted from 0: some before the pulse, and the response
    /// after it.
    pub window: Range<usize>,
    /// Faults of the hit; none for a good hit.
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
        /// Time from the first peak to the second, in s; negative if the smaller peak is first.
        after_s: f64,
    },
    /// The force is clipped.
    Overload {
        /// Level at which the force is clipped, in its unit.
        level: f64,
    },
    /// A response is clipped.
    ResponseOverload {
        /// Channel of the response, counted from 0.
        channel: usize,
        /// Level at which the channel is clipped, in its unit.
        level: f64,
    },
    /// The peak is small compared with the peaks of the other hits.
    Weak {
        /// Peak, in per cent of the median peak.
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

impl HitFault {
    /// Returns the kind of the fault in words, without its numbers.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Double { .. } => "double hit",
            Self::Overload { .. } => "overload of the force",
            Self::ResponseOverload { .. } => "overload of a response",
            Self::Weak { .. } => "weak hit",
            Self::Cut => "the record begins or ends within the pulse",
            Self::RecordEnds { .. } => "the record ends too soon",
            Self::NextHit { .. } => "the next hit comes too soon",
        }
    }
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
                write!(
                    f,
                    "this hit has {samples} samples before the record ends; {needed} are needed"
                )
            }
            Self::NextHit { samples, needed } => {
                write!(f, "this hit has {samples} samples before the next hit; {needed} are needed")
            }
        }
    }
}

/// Detects the hits of a hammer in its force, sampled every `dt` seconds.
///
/// A hit begins where the force, minus the median of all samples, exceeds the trigger level. The
/// window of the hit extends to the next hit, even a weak one, or has the length that the rule
/// states. A force below 12 standard deviations of the noise between the hits, or below four steps
/// of the converter, is noise.
///
/// # Errors
/// [`SignalError::NotPositive`], [`SignalError::Negative`], [`SignalError::Range`] and
/// [`SignalError::Empty`] for impossible numbers of the rule; [`SignalError::NotFinite`].
///
/// # Source
/// Ewins, *Modal Testing*, 2nd ed. (2000), chapter 3 (transient excitation by a hammer); the limits
/// are ours.
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
    // In a short pulse without noise, the smallest change between samples is large and not a step
    // of the converter.
    let floor = (limits::HIT_OVER_NOISE * noise)
        .max((limits::HIT_OVER_STEP * step(force)).min(limits::MEDIAN_PEAK_FRACTION * largest));
    if largest <= floor || largest == 0.0 {
        return Ok(Hits { offset, noise, all: Vec::new() });
    }
    let trigger = floor.max(0.01 * rule.trigger_percent * largest);
    let bounce = (rule.bounce_s / dt).ceil() as usize;
    let mut hits: Vec<Hit> = Vec::new();
    let mut at = 0;
    while let Some(first) = (at..push.len()).find(|k| push[*k] > trigger) {
        let below = |from: usize| (from..push.len()).find(|k| push[*k] <= trigger);
        let end = first.saturating_add(bounce).max(below(first).unwrap_or(push.len()));
        at = below(end).unwrap_or(push.len());
        let last = (first..at).rfind(|k| push[*k] > trigger).unwrap_or(first);
        let mut hit = Hit::around(&push, first..end.min(push.len()), sign);
        hit.contact = with_ringing(&push, first.min(hit.pulse.start)..last + 1, floor);
        hits.push(hit);
    }
    windows(&mut hits, push.len(), rule);
    find_faults(&mut hits, force, &push, dt, floor, rule);
    Ok(Hits { offset, noise, all: hits })
}

impl Hits {
    /// Detects clipped responses (samples × channels) in the window of every hit.
    ///
    /// # Errors
    /// [`SignalError::Range`] if the response ends before the last window.
    ///
    /// # Source
    /// The source of [`clipping()`].
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

    /// Returns the force of consecutive hits, in its unit, one value per sample from the beginning
    /// of the first window to the end of the last window. The offset is subtracted. Outside the
    /// contacts the force is zero (a *force window*), because the hammer does not touch the
    /// structure and the transducer measures only noise. The list is empty without a hit.
    ///
    /// # Panics
    /// If a window is outside this force.
    ///
    /// # Source
    /// Ewins, *Modal Testing*, 2nd ed. (2000), the section on transient excitation.
    pub fn pulses_alone(&self, force: &[f64], hits: &[Hit]) -> Vec<f64> {
        let contacts: Vec<Range<usize>> = hits.iter().map(Hit::contact_with_margin).collect();
        let value = |k: usize| {
            let is_force = contacts.iter().any(|contact| contact.contains(&k));
            if is_force { force[k] - self.offset } else { 0.0 }
        };
        let (first, last) = (hits.first(), hits.last());
        let window = first.zip(last).map_or(0..0, |(a, b)| a.window.start..b.window.end);
        window.map(value).collect()
    }
}

impl Hit {
    /// Returns the samples of the contact, counted from 0, with a margin of the length of the pulse
    /// on either side; the range may reach beyond the end of the record.
    pub fn contact_with_margin(&self) -> Range<usize> {
        let margin = self.pulse.len();
        let first = self.pulse.start.saturating_sub(margin).min(self.contact.start);
        first..self.contact.end.max(self.pulse.end + margin)
    }

    /// Returns the hit whose peak is in `range`; `push` is the force times `sign`, positive at a
    /// hit.
    fn around(push: &[f64], range: Range<usize>, sign: f64) -> Self {
        let at = largest_of(push, range);
        let limit = limits::PULSE_FRACTION * push[at];
        let start = (0..at).rev().find(|k| push[*k] <= limit).map_or(0, |k| k + 1);
        let end = (at..push.len()).find(|k| push[*k] <= limit).unwrap_or(push.len());
        let pulse = || start..end;
        Self {
            pulse: pulse(),
            contact: pulse(),
            peak: sign * push[at],
            window: pulse(),
            faults: Vec::new(),
        }
    }
}

/// Returns a range of samples with the ringing before and after it: further positive forces above a
/// fraction of the `floor` of a hit, at most [`limits::RINGING_GAP`] samples apart.
///
/// Ringing changes sign from lobe to lobe. A long negative part alone is the undershoot of an
/// AC-coupled transducer, not a force.
fn with_ringing(push: &[f64], range: Range<usize>, floor: f64) -> Range<usize> {
    let is_loud = |k: &usize| push[*k] > limits::RINGING_OVER_FLOOR * floor;
    let Range { mut start, mut end } = range;
    while let Some(k) = (start.saturating_sub(limits::RINGING_GAP)..start).find(is_loud) {
        start = k;
    }
    while let Some(k) = (end..(end + limits::RINGING_GAP).min(push.len())).rfind(is_loud) {
        end = k + 1;
    }
    start..end
}

/// Sets the window of every hit, and the fault of a window that is too short.
fn windows(all: &mut [Hit], samples: usize, rule: &HitRule) {
    let mut earliest = 0;
    for hit in all.iter_mut() {
        let before = rule.before.unwrap_or(limits::PRE_TRIGGER * hit.pulse.len());
        hit.window.start = hit.pulse.start.saturating_sub(before).max(earliest);
        earliest = hit.pulse.end;
    }
    let ends: Vec<usize> =
        all.iter().skip(1).map(|hit| hit.window.start).chain([samples]).collect();
    let rooms = all.iter().zip(&ends).map(|(hit, end)| (end - hit.window.start) as f64).collect();
    let least = (limits::SHORTEST_WINDOW * median(rooms)).ceil() as usize;
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
            hit.faults.push(if end == samples {
                HitFault::RecordEnds { samples: got, needed }
            } else {
                HitFault::NextHit { samples: got, needed }
            });
        }
    }
}

fn find_faults(all: &mut [Hit], force: &[f64], push: &[f64], dt: f64, floor: f64, rule: &HitRule) {
    let heights = || all.iter().map(|hit| hit.peak.abs());
    let least = limits::MEDIAN_PEAK_FRACTION * heights().fold(0.0, f64::max);
    let usual = median(heights().filter(|peak| *peak >= least).collect());
    let in_record = clipping(force).map(|cut| cut.level);
    for hit in all {
        let peak = hit.peak.abs();
        let least = floor.max(0.01 * rule.double_percent * peak);
        let window = hit.window.clone();
        let main = largest_of(push, hit.pulse.clone());
        let maxima: Vec<usize> =
            peaks(&push[window.clone()], least).into_iter().map(|at| window.start + at).collect();
        let candidates = (0..maxima.len()).filter(|at| {
            let peak = maxima[*at];
            push[peak] >= least && peak != main && !rings(push, &maxima, *at, main, floor)
        });
        let second = candidates.map(|at| maxima[at]).max_by(|a, b| push[*a].total_cmp(&push[*b]));
        if let Some(at) = second {
            let after_s = (at as f64 - main as f64) * dt;
            hit.faults.push(HitFault::Double { percent: 100.0 * push[at] / peak, after_s });
        }
        let in_window = clipping(&force[window]).map(|cut| cut.level);
        let level =
            [in_record, in_window].into_iter().flatten().find(|level| *level == force[main]);
        hit.faults.extend(level.map(|level| HitFault::Overload { level }));
        if peak < 0.01 * rule.weak_percent * usual {
            hit.faults.push(HitFault::Weak { percent: 100.0 * peak / usual });
        }
    }
}

/// Returns whether a maximum is ringing of an anti-alias filter: apart from noise, the force in the
/// neighbouring lobe towards the main pulse is as negative as the maximum is positive. A hammer
/// does not pull, and ringing decays on both sides of a pulse.
fn rings(push: &[f64], maxima: &[usize], at: usize, main: usize, noise: f64) -> bool {
    let peak = maxima[at];
    let inner = if peak > main {
        at.checked_sub(1).map_or(main, |at| maxima[at].max(main))
    } else {
        maxima.get(at + 1).map_or(main, |at| (*at).min(main))
    };
    let lobe = peak.min(inner)..=peak.max(inner);
    let steps = lobe.clone().flat_map(|sample| {
        (0..limits::RINGING_STEPS)
            .map(move |step| (sample, step as f64 / limits::RINGING_STEPS as f64))
    });
    let pull = steps.map(|(sample, part)| -between_samples(push, sample, part)).fold(0.0, f64::max);
    push[peak] < pull + noise
}

/// Returns the value of a band-limited signal at the fraction `part` of a step after a sample.
///
/// # Source
/// Whittaker's interpolation formula, with its weights tapered by a raised cosine.
fn between_samples(values: &[f64], sample: usize, part: f64) -> f64 {
    let reach = limits::INTERPOLATION_REACH;
    let range = (sample + 1).saturating_sub(reach)..(sample + 1 + reach).min(values.len());
    let weight = |k: usize| {
        let t = std::f64::consts::PI * (k as f64 - sample as f64 - part);
        let sinc = if t == 0.0 { 1.0 } else { t.sin() / t };
        sinc * (0.5 * t / reach as f64).cos().powi(2)
    };
    range.map(|k| values[k] * weight(k)).sum()
}

/// Returns the indices of the maxima. Between two maxima, and after the last, the values fall by at
/// least `prominence`.
fn peaks(values: &[f64], prominence: f64) -> Vec<usize> {
    let mut maxima = Vec::new();
    let (mut rising, mut extreme) = (true, 0);
    for (at, value) in values.iter().enumerate() {
        let further = if rising { *value > values[extreme] } else { *value < values[extreme] };
        if further {
            extreme = at;
        } else if (value - values[extreme]).abs() >= prominence {
            if rising {
                maxima.push(extreme);
            }
            (rising, extreme) = (!rising, at);
        }
    }
    maxima
}

/// Returns the smallest change from one sample to the next. It is a step of the converter, or
/// almost zero if the converter has very many levels.
fn step(values: &[f64]) -> f64 {
    let changes = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|d| *d > 0.0);
    changes.fold(f64::INFINITY, f64::min)
}

/// Returns the index of the largest value in a range that is not empty; of equal values, the first.
fn largest_of(values: &[f64], range: Range<usize>) -> usize {
    let start = range.start;
    range.fold(start, |largest, at| if values[at] > values[largest] { at } else { largest })
}

/// Returns the median; 0 without values.
fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests;
