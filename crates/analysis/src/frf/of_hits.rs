//! Frequency responses averaged over the hits of a hammer.

use std::ops::Range;

use mechid_signal::{HitRule, Record};
use mechid_spectra::Lines;
use mechid_spectra::frf::{FrfAverage, Segments};
use nalgebra::DVector;

use super::{FrfSettings, Responses};
use crate::AnalysisError;
use crate::hits::{Cut, Windows, cut};
use crate::identify::left_out::LineRule;
use crate::measurement::Windowed;
use crate::text::significant;

/// Number of parts of a window for the test whether the response has decayed.
pub(super) const PARTS: usize = 20;

/// Maximum RMS of a decayed response in the last part of a window, or before the pulse, relative to
/// the largest RMS in any part of the window.
const DIED_OUT: f64 = 0.02;

/// Frequency responses from hits, with remarks.
pub(super) struct OfHits {
    pub responses: Responses,
    pub cut: Cut,
    /// Decay rate of the exponential window, in 1/s.
    pub added_decay: Option<f64>,
    pub remarks: Vec<String>,
}

/// Averages over hits, with the decay of the responses in their windows.
pub(crate) struct AverageOfHits {
    pub average: FrfAverage,
    /// Lines of the shortest window.
    lines: Lines,
    /// Degrees of freedom that were struck, counted from 0.
    pub driven: Vec<usize>,
    segments: Segments,
    /// Decay rate of the exponential window, in 1/s.
    added_decay: Option<f64>,
    /// Largest RMS of the response in the last part of a window, relative to the largest RMS in any
    /// part.
    at_end: f64,
    /// Largest RMS of the response before the pulse, relative to the largest RMS in any part of a
    /// window.
    before: f64,
}

/// Averages the responses to some hits; the window of each hit is cut to the length of the shortest
/// window.
///
/// With an exponential window exp(−σt) on force and response, M, C and K become exactly M, C + 2σM
/// and K + σC + σ²M: every eigenvalue is shifted by −σ, and the response at iω equals the response
/// of the machine at iω + σ.
///
/// # Source
/// Ewins, *Modal Testing*, 2nd ed. (2000), the section on transient excitation (exponential
/// window).
pub(crate) fn average_of_hits(
    hits: &[Windowed],
    lines: LineRule<'_>,
    exponential_percent: Option<f64>,
) -> Result<AverageOfHits, AnalysisError> {
    let first = &hits[0].held;
    let mut driven: Vec<usize> = hits.iter().flat_map(|h| h.held.driven.clone()).collect();
    driven.sort_unstable();
    driven.dedup();
    let (kind, outputs) = (first.response().1, first.response().0.channels());
    let len = hits.iter().map(|hit| hit.held.force.len()).min().unwrap_or(0);
    let sampling = first.force.sampling().with_len(len)?;
    let chosen = lines.lines(&first.force.window(0, len)?, len)?;
    let lines = Lines::new(sampling, chosen)?;
    let added_decay = match exponential_percent {
        None => None,
        Some(percent) if percent > 0.0 && percent < 100.0 => {
            Some(-(0.01 * percent).ln() / sampling.duration())
        }
        Some(percent) => {
            let given = mechid_signal::message::number(percent);
            let why = format!(
                "the value of the window at its end must be above 0 and below 100 %, got {given}"
            );
            return Err(AnalysisError::Setting { setting: "exponential_percent", why });
        }
    };
    let rate = added_decay.unwrap_or(0.0);
    let weights = DVector::from_fn(len, |k, _| (-rate * sampling.time(k)).exp());
    let weighted = |record: &Record, channels: &[usize]| {
        let mut data = record.data().rows(0, len).select_columns(channels);
        data.column_iter_mut().for_each(|mut column| column.component_mul_assign(&weights));
        Record::new(sampling, data)
    };
    let segments = Segments::Periods(len);
    let mut average = FrfAverage::new(lines.clone(), [driven.len(), outputs], kind, segments)?;
    let channels: Vec<usize> = (0..outputs).collect();
    let (mut at_end, mut before) = (0.0_f64, 0.0_f64);
    for hit in hits {
        let force = weighted(&hit.held.force, &driven)?;
        let response = weighted(hit.held.response().0, &channels)?;
        let pulse = force.data().row_iter().position(|row| row.amax() > 0.0).unwrap_or(0);
        before = before.max(over_largest(&response, 0..pulse));
        at_end = at_end.max(over_largest(&response, len - len.div_ceil(PARTS)..len));
        average.push(&force, &response)?;
    }
    Ok(AverageOfHits { average, lines, driven, segments, added_decay, at_end, before })
}

/// Averages the responses to all good hits of some records.
pub(super) fn responses_of_hits(
    records: &[Windowed],
    rule: &HitRule,
    lines: LineRule<'_>,
    how: &FrfSettings,
) -> Result<OfHits, AnalysisError> {
    let cut = cut(records, rule, Windows::Separate)?;
    let averaged = average_of_hits(&cut.hits, lines, how.exponential_percent)?;
    let AverageOfHits { average, lines, driven, segments, added_decay, at_end, before } = averaged;
    how.estimator.check(driven.len(), records[0].held.response().0.channels())?;
    let frf = average.frf(how.estimator.estimator())?;
    let mut remarks = cut.remarks.clone();
    if at_end > DIED_OUT {
        remarks.push(format!(
            "at the end of a window the RMS of the response is still {} % of its largest RMS: leakage widens \
             resonances; fit the hits with `hits` of an identification, which estimates the transients, or give \
             `exponential_percent`",
            significant(100.0 * at_end, 2)
        ));
    }
    if before > DIED_OUT {
        remarks.push(format!(
            "before a hit the RMS of the response is still {} % of its largest RMS, which no window corrects: wait \
             longer between hits, or fit the hits with `hits` of an identification",
            significant(100.0 * before, 2)
        ));
    }
    if let Some(rate) = added_decay {
        remarks.push(format!(
            "the exponential window adds {} 1/s to the decay rate of every mode: a damping ratio read \
             from these responses is too large by {} Hz divided by the natural frequency",
            significant(rate, 4),
            significant(rate / std::f64::consts::TAU, 4)
        ));
    }
    let counts = cut.used.clone();
    let (idle, following) = (Vec::new(), Vec::new());
    let responses = Responses { frf, lines, driven, idle, following, segments, counts };
    Ok(OfHits { responses, cut, added_decay, remarks })
}

/// Returns the ratio of the RMS of some samples of a response to the largest RMS in any of its
/// [`PARTS`] parts. With several channels, the largest ratio counts.
pub(super) fn over_largest(response: &Record, samples: Range<usize>) -> f64 {
    let rms = |samples: &[f64]| {
        (samples.iter().map(|x| x * x).sum::<f64>() / samples.len().max(1) as f64).sqrt()
    };
    let part = response.len().div_ceil(PARTS);
    let of_channel = |channel: usize| {
        let values = response.channel(channel);
        let largest = values.chunks(part).map(rms).fold(0.0, f64::max);
        if largest > 0.0 { rms(&values[samples.clone()]) / largest } else { 0.0 }
    };
    (0..response.channels()).map(of_channel).fold(0.0, f64::max)
}
