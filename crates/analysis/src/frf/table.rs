//! Table of frequency responses, as text for people and as data for programs.

use std::collections::BTreeSet;
use std::f64::consts::TAU;
use std::fmt::{self, Write as _};

use mechid_io::{
    ADDED_DECAY, AveragedSegments, CoherenceFunction, DERIVATIVE, FrequencyResponses,
    ResponseFunction, derivative, is_directed_point,
};
use mechid_model::ResponseQuantity;
use mechid_signal::Window;
use mechid_signal::message;
use mechid_spectra::frf::Segments;
use nalgebra::Complex;
use serde::Serialize;

use super::of_hits::OfHits;
use super::peak::Peak;
use super::{FrfSettings, Interleaved, Responses};
use crate::AnalysisError;
use crate::hits::{HitRow, heading};
use crate::measurement::{Channels, Windowed};
use crate::text::{compact, paragraph, significant, text_table};

/// Frequency responses with coherence and standard errors.
#[derive(Debug, Serialize)]
pub struct FrfTable {
    /// The record.
    pub file: String,
    /// First sample used of the record `file`, counted from 1.
    pub first_sample: usize,
    /// Last sample used of the record `file`, counted from 1.
    pub last_sample: usize,
    /// Sampling rate, in Hz.
    pub sample_rate_hz: f64,
    /// All averaged records, including `file`.
    pub records: Vec<AveragedRecord>,
    /// Name of the estimator.
    pub estimator: &'static str,
    /// Segments that were averaged.
    pub segments: SegmentRow,
    /// All hits of a hammer test, used or excluded.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub hits: Vec<HitRow>,
    /// Decay rate, in 1/s, that an exponential window adds to every mode.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub added_decay: Option<f64>,
    /// Measured quantity of the response.
    pub quantity: String,
    /// SI unit.
    pub unit: &'static str,
    /// Names of the responses.
    pub response_names: Vec<String>,
    /// Names of the forces; the number of forces may differ from the number of responses.
    pub force_names: Vec<String>,
    /// Frequencies, in Hz, one per value of a response.
    pub frequency_hz: Vec<f64>,
    /// Frequency responses, one per pair of response and force.
    pub responses: Vec<Response>,
    /// Coherence, one per response.
    pub coherence: Vec<Coherence>,
    /// Remarks to read before using the numbers.
    pub remarks: Vec<String>,
    /// Settings of the analysis; with them it can be repeated.
    pub analysis: FrfSettings,
}

/// One of the records that were averaged.
#[derive(Debug, Serialize)]
pub struct AveragedRecord {
    /// The record.
    pub file: String,
    /// First sample used, counted from 1.
    pub first_sample: usize,
    /// Last sample used, counted from 1.
    pub last_sample: usize,
    /// Number of segments, periods or hits of the record.
    pub segments: usize,
}

/// Segments of a record.
#[derive(Debug, Serialize)]
pub struct SegmentRow {
    /// Number of samples.
    pub samples: usize,
    /// Number of samples between the starts of successive segments.
    pub hop: usize,
    /// Window that weights a segment; `None` for whole periods.
    pub window: Option<Window>,
    /// Number of segments, of all records together.
    pub count: usize,
    /// Equivalent number of independent averages, a pure number.
    pub averages: f64,
}

/// The motion of one degree of freedom per unit force on another, frequency by frequency.
#[derive(Debug, Serialize)]
pub struct Response {
    /// Degree of freedom that moves, counted from 1.
    pub motion: usize,
    /// Degree of freedom that is driven, counted from 1.
    pub force: usize,
    /// Real part, one value per frequency, in the unit of the table. On lines that another force
    /// excites (interleaved lines), all values are NaN.
    pub real: Vec<f64>,
    /// Imaginary part, one value per frequency, in the unit of the table.
    pub imaginary: Vec<f64>,
    /// Magnitude, one value per frequency, in the unit of the table.
    pub magnitude: Vec<f64>,
    /// Phase, one value per frequency, in degrees.
    pub phase_deg: Vec<f64>,
    /// Standard error of the magnitude, of the real part and of the imaginary part (all equal):
    /// √(E|ΔH|²/2), one value per frequency, in the unit of the table.
    pub standard_error: Vec<f64>,
}

/// Fraction of the power of a response that is linear in the forces.
#[derive(Debug, Serialize)]
pub struct Coherence {
    /// Degree of freedom of the response, counted from 1.
    pub motion: usize,
    /// Values, one per frequency, pure numbers from 0 to 1.
    pub values: Vec<f64>,
}

/// Minimum number of lines within the half-power bandwidth of a peak that the window does not
/// widen.
const WIDE: usize = 4;

impl FrfTable {
    pub(super) fn new(records: &[Windowed], averaged: &Responses, how: &FrfSettings) -> Self {
        let n = records[0].held.response().0.channels();
        let mut responses = Vec::new();
        for motion in 0..n {
            for (input, dof) in averaged.driven.iter().enumerate() {
                responses.push(Response::new(averaged, (motion, input), *dof));
            }
        }
        let coherence = (0..n).map(|motion| Coherence::new(averaged, motion)).collect();
        let omega = averaged.frf.omega().to_vec();
        Self::from_parts(records, averaged, how, omega, responses, coherence)
    }

    /// Creates the table of the hits of a hammer.
    pub(super) fn from_hits(records: &[Windowed], averaged: OfHits, how: &FrfSettings) -> Self {
        let mut table = Self::new(records, &averaged.responses, how);
        table.hits = averaged.cut.rows;
        table.added_decay = averaged.added_decay;
        table.remarks.extend(averaged.remarks);
        table
    }

    /// Creates the table of forces with interleaved lines.
    pub(super) fn interleaved(
        records: &[Windowed],
        responses: &Interleaved,
        how: &FrfSettings,
    ) -> Self {
        let Interleaved { parts, crosstalk } = responses;
        let n = records[0].held.response().0.channels();
        let lines = parts.iter().enumerate().flat_map(|(part, averaged)| {
            averaged.frf.omega().iter().enumerate().map(move |(at, omega)| (*omega, part, at))
        });
        let mut places: Vec<(f64, usize, usize)> = lines.collect();
        places.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut responses = Vec::new();
        for motion in 0..n {
            for (number, averaged) in parts.iter().enumerate() {
                let indices = places.iter().map(|(_, part, at)| (*part == number).then_some(*at));
                let indices: Vec<Option<usize>> = indices.collect();
                responses.push(
                    Response::new(averaged, (motion, 0), averaged.driven[0]).spread(&indices),
                );
            }
        }
        let coherence = (0..n).map(|motion| {
            let of_parts: Vec<Coherence> =
                parts.iter().map(|averaged| Coherence::new(averaged, motion)).collect();
            let values = places.iter().map(|(_, part, at)| of_parts[*part].values[*at]).collect();
            Coherence { motion: motion + 1, values }
        });
        let coherence = coherence.collect();
        let omega = places.iter().map(|(omega, ..)| *omega).collect();
        let mut table = Self::from_parts(records, &parts[0], how, omega, responses, coherence);
        table.remarks.push(
            "the forces have separate lines: the responses to each force are estimated only on the lines of this force"
                .into(),
        );
        table.remarks.extend(crosstalk.iter().map(|one| {
            let name = |force: usize| &table.force_names[parts[force].driven[0]];
            let [force, driver] = [one.force, one.driver].map(name);
            format!(
                "on the lines of {driver}, {force} has {} % of the amplitude of {driver}: the \
                 response to {force}, interpolated from the lines of {force}, was subtracted",
                significant(100.0 * one.share, 2)
            )
        }));
        table
    }

    fn from_parts(
        records: &[Windowed],
        averaged: &Responses,
        how: &FrfSettings,
        omega: Vec<f64>,
        responses: Vec<Response>,
        coherence: Vec<Coherence>,
    ) -> Self {
        let kind = averaged.frf.measured();
        let measured = &records[0].held;
        let row = |(recorded, segments): (&Windowed, &usize)| AveragedRecord {
            file: recorded.held.file.clone(),
            first_sample: recorded.held.first_sample,
            last_sample: recorded.held.last_sample(),
            segments: *segments,
        };
        let remarks = records.iter().flat_map(|recorded| recorded.held.unit_notes());
        let kinds = measured.responses().into_iter().map(|(measured, _)| measured);
        let unused = kinds.filter(|measured| *measured != kind).map(|unused| {
            format!(
                "the frequency responses were computed from the {kind}, not from the {unused}; to use the {unused}, name no other response"
            )
        });
        let remarks = remarks.chain(unused);
        let (motions, forces) = (measured.response().0.channels(), measured.force.channels());
        let names: Vec<&Channels> = records.iter().map(|recorded| &*recorded.held.names).collect();
        let names = Channels::together(&names);
        Self {
            file: measured.file.clone(),
            first_sample: measured.first_sample,
            last_sample: measured.last_sample(),
            sample_rate_hz: measured.force.sampling().rate_hz(),
            records: records.iter().zip(&averaged.counts).map(row).collect(),
            estimator: how.estimator.name(),
            segments: SegmentRow::new(averaged),
            hits: Vec::new(),
            added_decay: None,
            quantity: kind.to_string(),
            unit: match kind {
                ResponseQuantity::Displacement => "m/N",
                ResponseQuantity::Velocity => "m/(s·N)",
                ResponseQuantity::Acceleration => "m/(s²·N)",
            },
            response_names: (0..motions).map(|dof| names.response_name(kind, dof)).collect(),
            force_names: (0..forces).map(|dof| names.force_name(dof)).collect(),
            frequency_hz: omega.iter().map(|omega| omega / TAU).collect(),
            responses,
            coherence,
            remarks: remarks.chain(averaged.channel_remarks(None)).collect(),
            analysis: how.clone(),
        }
    }

    /// Returns a remark on a peak that the window widens; `averaged` are the responses of the
    /// table.
    pub(super) fn blunt(&self, averaged: &Responses) -> Option<String> {
        let peak = Peak::narrowest(&averaged.frf).filter(|peak| peak.lines < WIDE)?;
        let force = averaged.driven[peak.input] + 1;
        let response =
            self.responses.iter().find(|r| (r.motion, r.force) == (peak.motion + 1, force))?;
        Some(format!(
            "the peak of {} at {} Hz is {} wide: the window widens the peak, and a damping ratio read from this \
             peak is too large; a longer `segment` resolves the peak better",
            self.pair(response),
            significant(self.frequency_hz[peak.at], 5),
            message::count(peak.lines, "line")
        ))
    }

    /// Returns the names of a response and its force: `a1 / force`.
    pub fn pair(&self, response: &Response) -> String {
        let Response { motion, force, .. } = response;
        format!("{} / {}", self.response_names[motion - 1], self.force_names[force - 1])
    }

    /// Returns number and length of the windows that were averaged, as text.
    fn windows_text(&self) -> String {
        let s = &self.segments;
        let samples = message::count(s.samples, "sample");
        let windows = match s.window {
            None if !self.hits.is_empty() => {
                format!("{} of {samples}", message::count(s.count, "hit"))
            }
            None => format!("{} of {samples}", message::count(s.count, "period")),
            Some(window) => {
                let count = message::count(s.count, "segment");
                format!("{count} of {samples} every {} under a {window} window", s.hop)
            }
        };
        match self.records.len() {
            1 => windows,
            several => format!("{several} records, {windows}"),
        }
    }

    /// Returns the result as text for people.
    fn text(&self) -> String {
        let [low, high] = [self.frequency_hz.first(), self.frequency_hz.last()]
            .map(|hz| compact(hz.copied().unwrap_or(0.0), 5));
        let lines = match self.frequency_hz.len() {
            1 => format!("1 line, {low} Hz"),
            n => format!("{n} lines, {low} to {high} Hz"),
        };
        let rate_hz = compact(self.sample_rate_hz, 8);
        let mut text = if self.hits.is_empty() {
            let row = |r: &AveragedRecord| {
                let (file, first, last) = (&r.file, r.first_sample, r.last_sample);
                format!("{file}: samples {first} to {last}, {rate_hz} Hz\n")
            };
            self.records.iter().map(row).collect()
        } else {
            heading(&self.hits, &rate_hz)
        };
        text += &format!(
            "{} from {}, equivalent to {} averages; {lines}\n\n",
            self.estimator,
            self.windows_text(),
            compact(self.segments.averages, 4),
        );
        let mut rows = vec![
            ["response", "largest magnitude", "at", "least coherence", "median"]
                .map(String::from)
                .to_vec(),
        ];
        for r in &self.responses {
            let (at, largest) = r.peak();
            let mut sorted = self.coherence[r.motion - 1].values.clone();
            sorted.sort_by(f64::total_cmp);
            rows.push(vec![
                self.pair(r),
                format!("{} {}", significant(largest, 4), self.unit),
                format!("{} Hz", significant(self.frequency_hz[at], 5)),
                format!("{:.4}", sorted[0]),
                format!("{:.4}", sorted[sorted.len() / 2]),
            ]);
        }
        text += &text_table(&rows);
        text + &paragraph(self.remarks.iter().map(|remark| format!("note: {remark}")))
    }

    /// Returns the responses for files of other programs. `points` has the point and direction of
    /// each degree of freedom, such as `12+Z`. If `points` is empty and the names of all channels
    /// are such points, as in a universal file, these names are used; otherwise node and degree of
    /// freedom have the same number, and the direction is +X.
    ///
    /// # Errors
    /// [`AnalysisError::Setting`] if there is not one point per degree of freedom, and for forces
    /// with interleaved lines.
    pub fn to_responses(&self, points: &[String]) -> Result<FrequencyResponses, AnalysisError> {
        let motions = self.coherence.len();
        let last_force = self.responses.iter().map(|response| response.force).max();
        let dofs = motions.max(last_force.unwrap_or(0));
        if self.is_interleaved() {
            let why = "the forces have separate lines, but this format needs the same frequencies for all \
                       functions: write a .csv file";
            return Err(AnalysisError::Setting { setting: "output", why: why.into() });
        }
        if !points.is_empty() && points.len() != dofs {
            let given = message::count(points.len(), "point");
            let why = format!("{given} for {}", message::count(dofs, "degree of freedom"));
            return Err(AnalysisError::Setting { setting: "points", why });
        }
        let numbered = || (1..=dofs).map(|dof| format!("{dof}+X")).collect();
        let [motions_at, forces_at] = match points {
            [] => self.points().unwrap_or_else(|| [numbered(), numbered()]),
            given => [given.to_vec(), given.to_vec()],
        };
        let functions = self.responses.iter().map(|r| ResponseFunction {
            response: motions_at[r.motion - 1].clone(),
            reference: forces_at[r.force - 1].clone(),
            quantity: self.quantity.parse().ok(),
            values: r
                .real
                .iter()
                .zip(&r.imaginary)
                .map(|(re, im)| Complex::new(*re, *im))
                .collect(),
            standard_error: Some(r.standard_error.clone()),
        });
        let coherence = self.coherence.iter().map(|c| CoherenceFunction {
            response: motions_at[c.motion - 1].clone(),
            // With one force, the multiple coherence is the ordinary coherence.
            reference: (self.responses.len() == motions)
                .then(|| self.responses.first().map(|r| forces_at[r.force - 1].clone()))
                .flatten(),
            values: c.values.clone(),
        });
        Ok(FrequencyResponses {
            file: self.file.clone(),
            frequency_hz: self.frequency_hz.clone(),
            added_decay: self.added_decay,
            segments: Some(self.averaged()),
            functions: functions.collect(),
            coherence: coherence.collect(),
            remarks: Vec::new(),
            doubts: Vec::new(),
            memory: None,
        })
    }

    /// Returns the names of the responses and of the forces if all are points with a direction, as
    /// in universal files, and no two responses or forces have the same name.
    fn points(&self) -> Option<[Vec<String>; 2]> {
        let forces: BTreeSet<usize> = self.responses.iter().map(|r| r.force - 1).collect();
        let of_forces: BTreeSet<&str> =
            forces.iter().map(|at| self.force_names[*at].as_str()).collect();
        let of_motions: BTreeSet<&str> = self.response_names.iter().map(String::as_str).collect();
        let are_different =
            of_forces.len() == forces.len() && of_motions.len() == self.response_names.len();
        let are_points = of_motions.iter().chain(&of_forces).all(|name| is_directed_point(name));
        (are_different && are_points)
            .then(|| [self.response_names.clone(), self.force_names.clone()])
    }

    /// Returns whether the forces excite interleaved lines, so that only one force excites each
    /// line.
    fn is_interleaved(&self) -> bool {
        self.responses.iter().flat_map(|r| &r.real).any(|value| value.is_nan())
    }

    /// Returns the segments in the form in which files of frequency responses state them.
    fn averaged(&self) -> AveragedSegments {
        let SegmentRow { samples, hop, window, count, .. } = self.segments;
        AveragedSegments { samples, hop, count, window, sample_rate_hz: self.sample_rate_hz }
    }

    /// Returns one row per frequency; fields are empty if another force excites the line. The
    /// measured quantity, the decay that an exponential window adds, and the segments are repeated
    /// in every row.
    pub fn csv(&self) -> String {
        let mut text = String::from("frequency_hz");
        let numbers = |count: usize| (1..=count).map(|dof| dof.to_string()).collect();
        let [motions, forces] = self.points().unwrap_or_else(|| {
            [&self.response_names, &self.force_names].map(|names| numbers(names.len()))
        });
        for r in &self.responses {
            let name = format!("h_{}_{}", motions[r.motion - 1], forces[r.force - 1]);
            let _ = write!(text, ",{name}_real,{name}_imaginary,{name}_standard_error");
        }
        for c in &self.coherence {
            let _ = write!(text, ",coherence_{}", motions[c.motion - 1]);
        }
        let order = self.quantity.parse().ok().map(derivative);
        let constants = [(DERIVATIVE, order), (ADDED_DECAY, self.added_decay)];
        let constants = constants.into_iter().filter_map(|(name, value)| Some((name, value?)));
        let constants =
            constants.chain(AveragedSegments::COLUMNS.into_iter().zip(self.averaged().numbers()));
        let mut ending = String::new();
        for (name, value) in constants {
            let _ = write!(text, ",{name}");
            let _ = write!(ending, ",{value:?}");
        }
        for (at, hz) in self.frequency_hz.iter().enumerate() {
            let _ = write!(text, "\n{hz:?}");
            for r in &self.responses {
                for value in [r.real[at], r.imaginary[at], r.standard_error[at]] {
                    let _ =
                        if value.is_nan() { write!(text, ",") } else { write!(text, ",{value:?}") };
                }
            }
            for c in &self.coherence {
                let _ = write!(text, ",{:?}", c.values[at]);
            }
            text += &ending;
        }
        text + "\n"
    }
}

impl fmt::Display for FrfTable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text())
    }
}

impl Response {
    fn new(responses: &Responses, (motion, input): (usize, usize), dof: usize) -> Self {
        let frf = &responses.frf;
        let lines = 0..frf.omega().len();
        let h: Vec<_> = lines.clone().map(|at| frf.response(at)[(motion, input)]).collect();
        let error = |at| (0.5 * frf.variance(at)[(motion, input)]).sqrt();
        Self {
            motion: motion + 1,
            force: dof + 1,
            real: h.iter().map(|z| z.re).collect(),
            imaginary: h.iter().map(|z| z.im).collect(),
            magnitude: h.iter().map(|z| z.norm()).collect(),
            phase_deg: h.iter().map(|z| z.arg().to_degrees()).collect(),
            standard_error: lines.map(error).collect(),
        }
    }

    /// Returns the values at the indices `places`, one for each frequency of the result; NaN for a
    /// frequency without an index.
    fn spread(self, places: &[Option<usize>]) -> Self {
        let spread = |values: &[f64]| -> Vec<f64> {
            places.iter().map(|at| at.map_or(f64::NAN, |at| values[at])).collect()
        };
        Self {
            real: spread(&self.real),
            imaginary: spread(&self.imaginary),
            magnitude: spread(&self.magnitude),
            phase_deg: spread(&self.phase_deg),
            standard_error: spread(&self.standard_error),
            ..self
        }
    }

    /// Returns the index and the value of the largest magnitude.
    fn peak(&self) -> (usize, f64) {
        let larger = |a: (usize, f64), b: (usize, f64)| if b.1 > a.1 { b } else { a };
        self.magnitude.iter().copied().enumerate().fold((0, 0.0), larger)
    }
}

impl Coherence {
    fn new(averaged: &Responses, motion: usize) -> Self {
        let values = averaged.frf.coherence().column(motion).iter().copied().collect();
        Self { motion: motion + 1, values }
    }
}

impl SegmentRow {
    fn new(responses: &Responses) -> Self {
        let (averages, count) = (responses.frf.averages(), responses.counts.iter().sum());
        match responses.segments {
            Segments::Periods(samples) => {
                Self { samples, hop: samples, window: None, count, averages }
            }
            Segments::Windowed { len, hop, window } => {
                Self { samples: len, hop, window: Some(window), count, averages }
            }
        }
    }
}
