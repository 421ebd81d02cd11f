//! Frequency responses of a record: response per unit force, frequency by frequency.

mod of_hits;
mod peak;
mod segment_length;
pub mod table;
mod whole;

use std::str::FromStr;

use mechid_signal::Window;
use mechid_signal::{HitRule, Record, Spectrum, message};
use mechid_spectra::Lines;
use mechid_spectra::frf::{
    Crosstalk, Frf, FrfAverage, FrfEstimator, InterleavedResponses, Segments,
};
use serde::{Deserialize, Serialize};

pub(crate) use self::of_hits::average_of_hits;
pub use self::table::FrfTable;
use crate::AnalysisError;
use crate::identify::left_out::{LeftOut, LineRule};
use crate::identify::lines::LineChoice;
use crate::measurement::{Block, Hold, Measurement, Windowed, check_distinct};
use crate::text::significant;
use crate::words;

/// Settings of an estimate of frequency responses.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FrfSettings {
    /// Frequency response estimator.
    pub estimator: Estimator,
    /// Spectral lines of a segment.
    pub lines: LineChoice,
    /// Spectral lines to exclude from the chosen lines.
    pub without: LeftOut,
    /// Segments of the average.
    #[serde(deserialize_with = "words::written::one")]
    pub segments: Segmentation,
    /// Rule for dividing the record of a hammer test into hits, which are averaged instead of
    /// segments.
    #[serde(
        skip_serializing_if = "Option::is_none",
        deserialize_with = "words::written::optional"
    )]
    pub hits: Option<HitRule>,
    /// Weight of an exponential window on force and response at the end of a hit, in per cent of
    /// the weight at its beginning; `None`: no window.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exponential_percent: Option<f64>,
}

/// Estimates the frequency responses and the coherence of a record.
///
/// With a periodic excitation the periods of the window are the segments of the average.
///
/// # Errors
/// [`AnalysisError::NoHit`] for a hammer test without a good hit, [`AnalysisError::Setting`] for
/// invalid settings, [`AnalysisError::StillForce`], [`AnalysisError::NoExcitedLine`] or
/// [`AnalysisError::EmptyBand`] if no chosen line carries force, [`AnalysisError::Estimate`] if the
/// segments are too few or too long, and an error if a file cannot be read again.
pub fn frf(measurement: &Measurement, how: &FrfSettings) -> Result<FrfTable, AnalysisError> {
    frf_of_records(std::slice::from_ref(measurement), how)
}

/// Estimates the frequency responses and the coherence of one or several records of the same
/// machine from the averaged auto- and cross-spectra of the segments of all records.
///
/// The number of forces may differ from the number of responses. All records need the same number
/// of forces, the same number of responses, the same time step, and periods or segments of the same
/// length; the records may differ in length. Without periods and segments, records that end at rest
/// or have the same force are averaged as a whole; other records are cut into segments, as a single
/// record is. It is enough that each force acts in one record.
///
/// # Errors
/// As [`frf`]; [`AnalysisError::NoRecord`] without a record, and [`AnalysisError::Estimate`] if the
/// records do not match.
pub fn frf_of_records(
    measurements: &[Measurement],
    how: &FrfSettings,
) -> Result<FrfTable, AnalysisError> {
    let hold = if how.hits.is_some() { Hold::Whole } else { how.segments.hold() };
    let period_given = measurements.iter().any(|m| m.window_settings().period.is_some());
    let lines = LineRule { choice: &how.lines, without: &how.without };
    if let Some(rule) = &how.hits {
        if period_given {
            let why = "hits have no period: leave `hits` or `period` out".into();
            return Err(AnalysisError::Setting { setting: "hits", why });
        }
        let records = held_of(measurements, hold)?;
        let averaged = of_hits::responses_of_hits(&records, rule, lines, how)?;
        return Ok(FrfTable::from_hits(&records, averaged, how));
    }
    if how.exponential_percent.is_some() {
        let why =
            "an exponential window needs a hammer test: set `hits`, or leave the window out".into();
        return Err(AnalysisError::Setting { setting: "exponential_percent", why });
    }
    let records = held_of(measurements, hold)?;
    for record in &records {
        record.check_spectra(how.segments.segment.unwrap_or(record.held.period) / 2)?;
    }
    if let [recorded] = &records[..]
        && let Some(responses) = interleaved(recorded, how, lines)?
    {
        return Ok(FrfTable::interleaved(&records, &responses, how));
    }
    let chosen = match records.iter().min_by_key(|recorded| recorded.held.force.len()) {
        Some(shortest) if !period_given && !whole::have_no_transients(&records) => {
            how.segments.chosen(shortest, lines)?
        }
        _ => None,
    };
    let segments = chosen.as_ref().map_or(&how.segments, |(segments, _)| segments);
    let responses = Responses::new(&records, segments, how.estimator, lines)?;
    let mut table = FrfTable::new(&records, &responses, how);
    table.remarks.extend(chosen.map(|(_, remark)| remark));
    if matches!(responses.segments, Segments::Windowed { .. }) {
        table.remarks.extend(table.blunt(&responses));
    }
    Ok(table)
}

/// Reads the records, at least one, and checks that all have the same numbers of forces and
/// responses.
fn held_of(measurements: &[Measurement], hold: Hold) -> Result<Vec<Windowed>, AnalysisError> {
    check_distinct(measurements)?;
    let records = measurements.iter().map(|measured| {
        measured.channels().check_some()?;
        measured.hold_any(hold)
    });
    let records: Vec<Windowed> = records.collect::<Result<_, _>>()?;
    let first = &records.first().ok_or(AnalysisError::NoRecord)?.held;
    for Windowed { held, .. } in &records {
        let [got, dofs] = [held, first].map(|held| held.force.channels());
        if got != dofs {
            return Err(AnalysisError::DegreesOfFreedom { file: held.file.clone(), got, dofs });
        }
        let [(response, kind), (of_first, kind_of_first)] = [held, first].map(Block::response);
        let wrong = |what: String, of_first: String| AnalysisError::Setting {
            setting: "response",
            why: format!("{} has {what}, but the first record has {of_first}", held.file),
        };
        if kind != kind_of_first {
            return Err(wrong(format!("a {kind}"), format!("a {kind_of_first}")));
        }
        if response.channels() != of_first.channels() {
            let count = |record: &Record| message::count(record.channels(), "response");
            return Err(wrong(count(response), count(of_first)));
        }
    }
    Ok(records)
}

/// Maximum ratio of the amplitude of an unexcited force to that of the exciting force on a line.
const IDLE: f64 = 0.1;

/// Frequency responses to forces with interleaved lines.
pub(crate) struct Interleaved {
    /// Responses to each force, on the lines that only this force excites.
    parts: Vec<Responses>,
    crosstalk: Vec<Crosstalk>,
}

/// Returns the frequency responses to each force on the lines that only this force excites, and the
/// crosstalk of the other forces on these lines; `None` if the forces do not have interleaved lines
/// of whole periods.
fn interleaved(
    recorded: &Windowed,
    how: &FrfSettings,
    rule: LineRule<'_>,
) -> Result<Option<Interleaved>, AnalysisError> {
    let buffered = &recorded.held;
    let segments = how.segments.segments(buffered.period)?;
    let whole = buffered.force.len() >= buffered.period;
    let Segments::Periods(period) = segments else { return Ok(None) };
    if buffered.driven.len() < 2 || !whole {
        return Ok(None);
    }
    let chosen = rule.lines(&buffered.force, period)?;
    let spectrum = Spectrum::from_record(&buffered.force.period_mean(period)?);
    let driver = |line: &usize| -> Option<usize> {
        let amplitude = |dof: &usize| spectrum.line(*line, *dof).norm();
        let by_size = |a: &&usize, b: &&usize| amplitude(a).total_cmp(&amplitude(b));
        let shaker = *buffered.driven.iter().max_by(by_size)?;
        let idle = |dof: &usize| *dof == shaker || amplitude(dof) <= IDLE * amplitude(&shaker);
        buffered.driven.iter().all(idle).then_some(shaker)
    };
    let Some(drivers) = chosen.iter().map(driver).collect::<Option<Vec<usize>>>() else {
        return Ok(None);
    };
    if !buffered.driven.iter().all(|dof| drivers.contains(dof)) {
        return Ok(None);
    }
    let sampling = buffered.force.sampling().with_len(period)?;
    let averages = buffered.driven.iter().map(|dof| {
        let of_force = chosen.iter().zip(&drivers).filter(|(_, driver)| *driver == dof);
        let lines = Lines::new(sampling, of_force.map(|(line, _)| *line))?;
        average(recorded, &lines, segments)
    });
    let averages: Vec<FrfAverage> = averages.collect::<Result<_, AnalysisError>>()?;
    let InterleavedResponses { responses, crosstalk } =
        InterleavedResponses::from_averages(&averages, how.estimator.estimator())?;
    let parts = responses.into_iter().zip(&averages).zip(&buffered.driven);
    let parts = parts.map(|((frf, average), dof)| {
        let (lines, counts) = (average.lines().clone(), vec![average.pieces()]);
        let (idle, following) = (Vec::new(), Vec::new());
        Responses { frf, lines, driven: vec![*dof], idle, following, segments, counts }
    });
    Ok(Some(Interleaved { parts: parts.collect(), crosstalk }))
}

/// Frequency response estimator, by the location of the noise.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Estimator {
    /// H1, for noise on the response only.
    #[default]
    H1,
    /// H2, for noise on the force only.
    H2,
    /// Hv, for noise on both force and response.
    Hv,
}

impl Estimator {
    /// Returns the usual symbol of the estimator, such as `H1`.
    pub fn name(self) -> &'static str {
        match self {
            Estimator::H1 => "H1",
            Estimator::H2 => "H2",
            Estimator::Hv => "Hv",
        }
    }

    /// Refuses H2 for several forces unless there are as many responses: only then is the matrix of
    /// cross-spectra square, as its inverse requires.
    fn check(self, forces: usize, responses: usize) -> Result<(), AnalysisError> {
        if self != Estimator::H2 || forces <= 1 || forces == responses {
            return Ok(());
        }
        let why = format!(
            "h2 of {} needs as many responses as forces; the number of responses is {responses}: use h1 or hv",
            message::count(forces, "force")
        );
        Err(AnalysisError::Setting { setting: "estimator", why })
    }

    fn estimator(self) -> FrfEstimator {
        match self {
            Estimator::H1 => FrfEstimator::H1,
            Estimator::H2 => FrfEstimator::H2,
            Estimator::Hv => FrfEstimator::Hv,
        }
    }
}

/// Segments of a record for an average.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Segmentation {
    /// Number of samples of a segment, for a random excitation; `None`: the periods are the
    /// segments or, for records without a period, the length is chosen by the coherence.
    pub segment: Option<usize>,
    /// Window that weights the samples of a segment.
    pub window: Weight,
    /// Overlap of successive segments, in per cent, from 0 to below 100.
    pub overlap_percent: f64,
}

impl Default for Segmentation {
    fn default() -> Self {
        Self { segment: None, window: Weight::Hann, overlap_percent: 50.0 }
    }
}

impl FromStr for Segmentation {
    type Err = String;

    /// Reads `SAMPLES`, `SAMPLES:OVERLAP` with the overlap in per cent, or
    /// `SAMPLES:OVERLAP:WINDOW`.
    fn from_str(text: &str) -> Result<Self, String> {
        let parts: Vec<&str> = text.split(':').collect();
        let usual = Self::default();
        let (samples, overlap, window) = match *parts.as_slice() {
            [samples] => (samples, Ok(usual.overlap_percent), Ok(usual.window)),
            [samples, overlap] => (samples, overlap.parse(), Ok(usual.window)),
            [samples, overlap, window] => (samples, overlap.parse(), words::read(window)),
            _ => {
                return Err(format!(
                    "write SAMPLES:OVERLAP:WINDOW, such as 1024:50:hann, not {text}"
                ));
            }
        };
        let segment = match samples.parse() {
            Ok(samples) if samples > 0 => Some(samples),
            _ => return Err(format!("\"{samples}\" is not a number of samples")),
        };
        match overlap {
            Ok(overlap_percent) if (0.0..100.0).contains(&overlap_percent) => {
                Ok(Self { segment, window: window?, overlap_percent })
            }
            _ => Err(format!("an overlap must be at least 0 and below 100 %, got {}", parts[1])),
        }
    }
}

/// Window that weights the samples of a segment.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Weight {
    /// Hann window, the usual choice.
    #[default]
    Hann,
    /// Hamming window: a narrower peak, more leakage from distant lines.
    Hamming,
    /// Blackman window: least leakage, a wider peak.
    Blackman,
    /// Equal weights, for bursts that begin and end at rest.
    Rectangular,
}

impl Weight {
    fn window(self) -> Window {
        match self {
            Weight::Hann => Window::Hann,
            Weight::Hamming => Window::Hamming,
            Weight::Blackman => Window::Blackman,
            Weight::Rectangular => Window::Rectangular,
        }
    }
}

impl Segmentation {
    /// Returns segments of this many samples, half overlapped under a Hann window.
    pub fn with_samples(samples: usize) -> Self {
        Self { segment: Some(samples), ..Self::default() }
    }

    /// Returns whether the segments are whole periods.
    pub fn are_periods(&self) -> bool {
        self.segment.is_none()
    }

    /// Returns how much of a record must be in memory at the same time: some whole periods, or at
    /// least one segment. Segments are averaged one after another.
    pub(crate) fn hold(&self) -> Hold {
        self.segment.map_or(Hold::Periods, Hold::Samples)
    }

    /// Returns the segments of a window with periods of `period` samples.
    ///
    /// # Errors
    /// [`AnalysisError::Setting`] for an overlap outside 0 to below 100 %.
    fn segments(&self, period: usize) -> Result<Segments, AnalysisError> {
        let Some(len) = self.segment else { return Ok(Segments::Periods(period)) };
        if !(0.0..100.0).contains(&self.overlap_percent) {
            let why = format!(
                "an overlap must be at least 0 and below 100 %, got {}",
                mechid_signal::message::number(self.overlap_percent)
            );
            return Err(AnalysisError::Setting { setting: "segment_overlap", why });
        }
        let advance = 1.0 - self.overlap_percent / 100.0;
        let hop = ((len as f64 * advance).round() as usize).clamp(1, len.max(1));
        Ok(Segments::Windowed { len, hop, window: self.window.window() })
    }
}

/// The frequency responses of a measurement.
#[derive(Debug)]
pub(crate) struct Responses {
    pub frf: Frf,
    /// Lines of a segment.
    pub lines: Lines,
    /// Degrees of freedom with a force, counted from 0.
    pub driven: Vec<usize>,
    /// Degrees of freedom with only noise in their force channels, counted from 0.
    pub idle: Vec<usize>,
    /// Forces that are coherent with another force, so that their responses cannot be separated;
    /// degrees of freedom are counted from 0.
    pub following: Vec<Crosstalk>,
    pub segments: Segments,
    /// Number of segments of each record.
    pub counts: Vec<usize>,
}

impl Responses {
    /// Estimates the responses of the first measured quantity to the forces that act in at least
    /// one record, on the lines that `rule` chooses in a segment of a force.
    pub fn new(
        records: &[Windowed],
        segments: &Segmentation,
        estimator: Estimator,
        rule: LineRule<'_>,
    ) -> Result<Self, AnalysisError> {
        let first_record = &records[0].held;
        let segments = segments.segments(first_record.period)?;
        let len = segments.samples();
        let (mut driven, mut chosen) = (Vec::new(), Vec::new());
        for Windowed { held, .. } in records {
            driven.extend(&held.driven);
            chosen.extend(match segments {
                Segments::Periods(period) => rule.lines(&held.force, period)?,
                Segments::Windowed { len, .. } => rule.lines(&held.force.window(0, len)?, len)?,
            });
        }
        for list in [&mut driven, &mut chosen] {
            list.sort_unstable();
            list.dedup();
        }
        let lines = Lines::new(first_record.force.sampling().with_len(len)?, chosen)?;
        let mut average = average_of(&records[0], &lines, segments, &driven)?;
        let mut counts = vec![average.pieces()];
        for recorded in &records[1..] {
            let next = average_of(recorded, &lines, segments, &driven)?;
            counts.push(next.pieces());
            average.merge(&next)?;
        }
        let noise = average.idle_inputs();
        let acting: Vec<usize> = (0..driven.len()).filter(|at| !noise.contains(at)).collect();
        let average = average.with_inputs(&acting);
        let following = average.following_inputs();
        let apart: Vec<usize> =
            (0..acting.len()).filter(|at| following.iter().all(|one| one.force != *at)).collect();
        let mut average = average.with_inputs(&apart);
        // Only the lines that a force drives are used. Two kinds of lines are already selected:
        // lines of periods, by the scatter of the periods, and lines that the user requests by
        // number.
        if !matches!((segments, rule.choice), (Segments::Periods(_), _) | (_, LineChoice::Lines(_)))
        {
            average = average.at(&average.driven())?;
        }
        estimator.check(apart.len(), first_record.response().0.channels())?;
        let (frf, lines) = (average.frf(estimator.estimator())?, average.lines().clone());
        let dof = |at: usize| driven[acting[at]];
        let following = following.iter().map(|one| Crosstalk {
            force: dof(one.force),
            driver: dof(one.driver),
            share: one.share,
        });
        let following = following.collect();
        let idle = noise.iter().map(|input| driven[*input]).collect();
        let driven = apart.iter().map(|at| dof(*at)).collect();
        Ok(Self { frf, lines, driven, idle, following, segments, counts })
    }

    /// Returns the number of averages in words, such as `15 segments of 1024 samples`.
    pub fn averages(&self) -> String {
        let piece = match self.segments {
            Segments::Periods(_) => "period",
            Segments::Windowed { .. } => "segment",
        };
        let samples = message::count(self.segments.samples(), "sample");
        format!("{} of {samples}", message::count(self.counts.iter().sum(), piece))
    }

    /// Returns the remarks on force channels that contain only noise, or only a response to another
    /// force; `record` names the record.
    pub fn channel_remarks(&self, record: Option<&str>) -> Vec<String> {
        let listed: Vec<String> = self.idle.iter().map(|dof| (dof + 1).to_string()).collect();
        let of_record = record.map(|record| format!("{record}: ")).unwrap_or_default();
        let forces = if listed.len() == 1 { "force" } else { "forces" };
        let idle = (!listed.is_empty()).then(|| {
            format!(
                "{of_record}only noise in {forces} {}: the signal is weak, and not coherent with the other forces \
                 and the response, so no frequency responses are computed from it",
                listed.join(", ")
            )
        });
        let following = self.following.iter().map(|one| {
            let (force, driver) = (one.force + 1, one.driver + 1);
            format!(
                "{of_record}force {force} is coherent with force {driver} (at {} % of the amplitude of force \
                 {driver}) and has no independent part: the responses to force {driver} include this percentage of \
                 the responses to force {force}. To separate the responses, use a record in which force {force} \
                 dominates",
                significant(100.0 * one.share, 2)
            )
        });
        idle.into_iter().chain(following).collect()
    }
}

/// Averages the spectra of the acting forces and the first measured quantity over the whole window,
/// on some lines of a segment.
pub(crate) fn average(
    recorded: &Windowed,
    lines: &Lines,
    segments: Segments,
) -> Result<FrfAverage, AnalysisError> {
    average_of(recorded, lines, segments, &recorded.held.driven)
}

/// Averages like [`average`], for the forces on some degrees of freedom, counted from 0.
fn average_of(
    recorded: &Windowed,
    lines: &Lines,
    segments: Segments,
    driven: &[usize],
) -> Result<FrfAverage, AnalysisError> {
    let (motion, kind) = recorded.held.response();
    let channels = [driven.len(), motion.channels()];
    let mut average = FrfAverage::new(lines.clone(), channels, kind, segments)?;
    let (hop, at_once) = (segments.hop(), recorded.at_once().div_ceil(segments.hop()));
    let (samples, advance) = ((at_once - 1) * hop + segments.samples(), at_once * hop);
    recorded.chunks(samples, advance, &mut |chunk| {
        if driven.len() == chunk.force.channels() {
            return Ok(average.push(&chunk.force, chunk.response().0)?);
        }
        let acting: Vec<&[f64]> = driven.iter().map(|dof| chunk.force.channel(*dof)).collect();
        let acting = Record::from_channels(chunk.force.sampling(), &acting)?;
        Ok(average.push(&acting, chunk.response().0)?)
    })?;
    Ok(average)
}
