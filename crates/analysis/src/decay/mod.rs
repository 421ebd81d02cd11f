//! Modes of a free response: a record without force.

mod nonlinear;
mod release;
mod steps;
pub mod summary;

use std::fmt;
use std::ops::Range;

use mechid_checks::{Finding, Quantity, clipped_channels, dropped_channels, repeated_channels};
use mechid_modal::free_decay::{FreeDecay, FreeDecayEstimate, free_decay};
use mechid_model::ResponseQuantity;
use mechid_signal::Record;
use serde::{Deserialize, Serialize, Serializer};

pub use self::nonlinear::{BackbonePointRow, BackboneRow, Harmonic};
use self::release::release;
use self::steps::{coarse, last_shown};
pub use self::summary::DecaySummary;
use crate::identify::checks;
use crate::identify::prediction::Compared;
use crate::measurement::{Block, Measurement, Window};
use crate::modes::{all_responses, other_places};
use crate::text::significant;
use crate::{AnalysisError, time_limit};

/// Settings of an analysis of a free decay.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DecaySettings {
    /// Beginning of the decay, in s from the first sample of the window; `None`: detected in the
    /// record.
    pub from_s: Option<f64>,
    /// End of the part used, in s from the first sample of the window; `None`: the end of the
    /// window, or the time at which quantisation distorts a channel.
    pub to_s: Option<f64>,
    /// Number of modes; `None`: chosen by the Bayesian information criterion.
    pub modes: Option<usize>,
    /// Maximum number of modes if the number is not given.
    pub max_modes: usize,
    /// `true` if each channel has an unknown constant.
    pub offset: bool,
}

impl Default for DecaySettings {
    /// Returns settings without a given beginning, end and number of modes: these are detected in
    /// the record, with at most ten modes.
    fn default() -> Self {
        let FreeDecay { modes, max_modes, offset } = FreeDecay::default();
        Self { from_s: None, to_s: None, modes, max_modes, offset }
    }
}

/// Modes of a free response, and the measured response with the modelled one.
///
/// [`Display`](fmt::Display) writes the result for people, `serde` for programs.
#[derive(Debug)]
pub struct Decayed {
    summary: DecaySummary,
    estimate: FreeDecayEstimate,
    compared: Compared,
}

/// Identifies natural frequencies, damping ratios and shapes from a record without force: after a
/// release or an impact, or after a shaker was switched off.
///
/// The record needs no force column; if a force column is named, it is not read. All channels have
/// the same quantity. At each sample, the squares of all channels, each divided by the power of the
/// channel, are added. Without a given beginning, the decay begins at the last sample whose sum is
/// at least 80 % of the largest sum. It begins at the first such sample if the amplitude decays
/// from there, and at the beginning of the record if the amplitude grows over most of the record.
/// Without a given end, the decay ends where the range of a channel with quantised values has
/// fallen to twelve quantisation steps.
///
/// ```
/// use mechid_analysis::{Channels, DecaySettings, Measurement, ResponseQuantity, decay};
///
/// let rig = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/decay.csv");
/// let channels = Channels::from_responses(ResponseQuantity::Acceleration, "a1,a2,a3");
/// let decayed = decay(&Measurement::open(rig, &channels)?, &DecaySettings::default())?;
/// assert_eq!(decayed.estimate().modes().len(), 3);
/// println!("{decayed}");
/// # Ok::<(), mechid_analysis::AnalysisError>(())
/// ```
///
/// # Errors
/// [`AnalysisError::NoMotion`] without a response, [`AnalysisError::Setting`] for several
/// quantities, a period, or a beginning or end outside the window, [`AnalysisError::Window`], the
/// errors of [`free_decay`], and an error if the file cannot be read again.
pub fn decay(measurement: &Measurement, how: &DecaySettings) -> Result<Decayed, AnalysisError> {
    time_limit::bounded(measurement.memory(), || fitted(measurement, how))
}

/// Identifies the modes of a decay without a limit of its own.
pub(crate) fn fitted(
    measurement: &Measurement,
    how: &DecaySettings,
) -> Result<Decayed, AnalysisError> {
    let kind = kind_of(measurement)?;
    let whole = how.part(measurement)?.whole_block()?;
    let (_, record) = responses_of(&whole, kind)?;
    let release = match how.from_s {
        Some(_) => 0,
        None => release(record),
    };
    let record = record.window(release, record.len() - release)?;
    let coarse = coarse(&record);
    let last = if how.to_s.is_none() { last_shown(&record) } else { None };
    let record = match last {
        Some(last) => record.window(0, last.samples)?,
        None => record,
    };
    let begins_s = how.from_s.unwrap_or(0.0) + release as f64 * record.sampling().dt();
    let estimate = free_decay(&record, &how.fit()).map_err(|error| error.from_earlier(begins_s))?;
    let first_sample = whole.first_sample + release;
    let mut summary = DecaySummary::new(measurement, &whole, kind, first_sample, &estimate, how)?;
    summary.remarks.extend(last.map(|last| {
        let (column, unit) = (&summary.channels[last.channel].column, summary.unit);
        format!(
            "only the first {} s of the decay are used: afterwards {column} moves by only a few steps of its resolution (one step is {} {unit}), and rounding distorts it (`to` sets another end)",
            significant(last.samples as f64 * record.sampling().dt(), 4),
            significant(last.step, 3)
        )
    }));
    let faults = faulty_channels(kind, &record);
    summary.remarks.extend(faults.iter().map(|fault| checks::sentence(fault, &whole.names)));
    summary.remarks.extend(coarse.into_iter().map(|(channel, steps)| {
        format!(
            "the values of {} span {steps} steps of the converter: rounding to these few steps \
             does not act like noise, and may appear as modes; \
             leave the column out, or measure with a higher gain",
            summary.channels[channel].column
        )
    }));
    let predicted = estimate.fitted().clone();
    let names = summary.channels.iter().map(|channel| channel.column.clone()).collect();
    summary.remarks.extend(time_limit::remark());
    let compared = Compared { kind, names, measured: record, predicted };
    Ok(Decayed { summary, estimate, compared })
}

/// Returns the findings on faulty channels of a decay, except coarse resolution, which has a remark
/// of its own.
fn faulty_channels(kind: ResponseQuantity, record: &Record) -> Vec<Finding> {
    let quantity = Quantity::Response(kind);
    let mut faults = clipped_channels(quantity, record);
    faults.extend(dropped_channels(quantity, record));
    faults.extend(repeated_channels(&[(quantity, record)]));
    faults
}

/// Returns the only quantity of the response columns of a record.
fn kind_of(measurement: &Measurement) -> Result<ResponseQuantity, AnalysisError> {
    let channels = measurement.channels();
    let named = |kind: &ResponseQuantity| !channels.response(*kind).is_empty();
    let kinds: Vec<ResponseQuantity> = ResponseQuantity::ALL.into_iter().filter(named).collect();
    match kinds[..] {
        [] => Err(AnalysisError::NoMotion),
        [kind] => Ok(kind),
        [first, second, ..] => {
            let why = format!(
                "a free decay is fitted to one kind of response: name the columns of {first} or those of \
                 {second}"
            );
            Err(AnalysisError::Setting { setting: "response", why })
        }
    }
}

fn responses_of(
    block: &Block,
    kind: ResponseQuantity,
) -> Result<(ResponseQuantity, &Record), AnalysisError> {
    let response = block.responses().into_iter().find(|(quantity, _)| *quantity == kind);
    response.ok_or(AnalysisError::NoMotion)
}

/// Returns the part of a record from the beginning to the end of its decay.
///
/// # Errors
/// As [`decay`].
pub(crate) fn decaying_part(
    measurement: &Measurement,
    how: &DecaySettings,
) -> Result<Measurement, AnalysisError> {
    let part = how.part(measurement)?;
    let record = all_responses(&part.whole_block()?)?;
    let begin = if how.from_s.is_some() { 0 } else { release(&record) };
    let decay = record.window(begin, record.len() - begin)?;
    let last = if how.to_s.is_none() { last_shown(&decay) } else { None };
    let samples = last.map_or(decay.len(), |last| last.samples);
    let start = part.span()?.0 + begin + 1;
    measurement.clone().window(Window { start, period: Some(samples), periods: Some(1) })
}

impl DecaySettings {
    fn fit(&self) -> FreeDecay {
        FreeDecay { modes: self.modes, max_modes: self.max_modes, offset: self.offset }
    }

    /// Returns the samples of a record from `from_s` to `to_s`; without these settings, all samples
    /// of the window.
    fn part(&self, measurement: &Measurement) -> Result<Measurement, AnalysisError> {
        if measurement.window_settings().period.is_some() {
            let why = "a free decay has no period: choose `from` and `to`".into();
            return Err(AnalysisError::Setting { setting: "period", why });
        }
        let (start, len) = measurement.span()?;
        let Range { start: first, end } = self.samples(len, measurement.sampling().dt())?;
        let window =
            Window { start: start + first + 1, period: Some(end - first), periods: Some(1) };
        measurement.clone().window(window)
    }

    /// Returns the samples between beginning and end in a window of `len` samples, `dt` seconds
    /// apart.
    fn samples(&self, len: usize, dt: f64) -> Result<Range<usize>, AnalysisError> {
        let at = |setting: &'static str, seconds: f64| {
            let sample = (seconds / dt).round();
            if (0.0..=len as f64).contains(&sample) {
                return Ok(sample as usize);
            }
            let whole = len as f64 * dt;
            let why = format!("{seconds} s is not in the window, which is {whole} s long");
            Err(AnalysisError::Setting { setting, why })
        };
        let first = self.from_s.map_or(Ok(0), |seconds| at("from", seconds))?;
        let end = self.to_s.map_or(Ok(len), |seconds| at("to", seconds))?;
        if first >= end {
            let why = "it must be after `from`".into();
            return Err(AnalysisError::Setting { setting: "to", why });
        }
        Ok(first..end)
    }
}

impl Decayed {
    /// Returns the same result with these points of its channels, such as `12+Z`. The points name
    /// the entries of the mode shapes in comparisons and in files.
    ///
    /// # Errors
    /// [`AnalysisError::Setting`] if the number of points differs from the number of channels.
    pub fn with_points(mut self, points: Vec<String>) -> Result<Self, AnalysisError> {
        let channels = self.summary.channels.len();
        if points.len() != channels {
            return Err(other_places(points.len(), channels));
        }
        self.summary.response_names = points;
        Ok(self)
    }

    /// Returns the numbers and remarks.
    pub fn summary(&self) -> &DecaySummary {
        &self.summary
    }

    /// Returns the estimate.
    pub fn estimate(&self) -> &FreeDecayEstimate {
        &self.estimate
    }

    /// Returns the measured and the fitted response, from the beginning of the decay.
    pub fn compared(&self) -> &Compared {
        &self.compared
    }
}

impl fmt::Display for Decayed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.summary.fmt(f)
    }
}

impl Serialize for Decayed {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.summary.serialize(serializer)
    }
}
