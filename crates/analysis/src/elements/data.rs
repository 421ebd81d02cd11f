//! Data of the fit of a machine: spectral lines, their noise, and descriptions of both for the
//! result.

use std::f64::consts::TAU;
use std::ops::Range;

use mechid_checks::{Finding, NoiseSource};
use mechid_estimate::likelihood::machine::MeasuredReceptance;
use mechid_io::Limits;
use mechid_model::elements::Input;
use mechid_spectra::noise::pulse::PulseNoise;
use mechid_spectra::{LineData, LineNoise, SpectraError};
use nalgebra::{Complex, DMatrix};
use serde::Serialize;

use super::IdentifyElements;
use crate::AnalysisError;
use crate::hits::{HitNoise, HitRow};
use crate::identify::ForceNoise;
use crate::identify::rows::WindowRow;
use crate::measurement::{Block, Channels};

/// Spectral lines of all tests of a machine, with their noise if it is known.
#[derive(Debug, Clone)]
pub struct ElementData {
    /// Lines of all tests, one test after the other.
    pub(super) lines: LineData,
    /// Tests, one for each record of the lines.
    pub(super) tests: Vec<TestRow>,
    /// Source of the noise, if the data state it.
    pub(super) source: Option<NoiseSource>,
    /// Description of the noise, in words.
    pub(super) noise: String,
    /// Noise of the forces of open records and hits.
    pub(super) force_noise: Vec<ForceNoise>,
    /// Findings on the channels, each with the index of its test.
    pub(super) findings: Vec<(usize, Finding)>,
    /// Names of the channels, for the findings.
    pub(super) channels: Channels,
    /// Hits of a hammer, used or left out.
    pub(super) hits: Vec<HitRow>,
    /// Remarks on the data that were read.
    pub(super) remarks: Vec<String>,
    /// Part of the machine whose receptance was measured.
    pub(super) part: Option<MeasuredReceptance>,
}

/// A test that was fitted.
#[derive(Debug, Clone, Serialize)]
pub struct TestRow {
    /// Name of the file.
    pub file: String,
    /// Kind of the lines.
    pub kind: TestKind,
    /// Samples of the record that were used; `None` for a table.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub window: Option<WindowRow>,
}

/// Kind of measurement that gave the lines of a test.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TestKind {
    /// Mean of whole periods.
    Periods,
    /// Open record, with its transient.
    Open,
    /// Hit of a hammer, as an open record.
    Hit,
    /// Frequency responses.
    Responses,
    /// Synchronous responses over the speed.
    Speeds,
}

impl ElementData {
    /// Returns the lines of all tests.
    pub fn lines(&self) -> &LineData {
        &self.lines
    }

    /// Returns the tests.
    pub fn tests(&self) -> &[TestRow] {
        &self.tests
    }

    /// Returns the memory, in bytes, that a file with the numbers of these lines may use.
    pub(super) fn memory(&self) -> usize {
        let channels = self.channels.roles().len().max(1);
        Limits::DEFAULT.memory(2 * size_of::<f64>() * self.lines.len() * channels)
    }

    /// Creates the data of one test from its lines.
    pub(super) fn from_test(lines: LineData, test: TestRow, channels: Channels) -> Self {
        Self {
            lines,
            tests: vec![test],
            source: None,
            noise: String::new(),
            force_noise: Vec::new(),
            findings: Vec::new(),
            channels,
            hits: Vec::new(),
            remarks: Vec::new(),
            part: None,
        }
    }

    /// Returns these data followed by the tests of `other`. The noise of the result is known if it
    /// is known for both.
    pub(super) fn followed_by(mut self, other: Self) -> Result<Self, SpectraError> {
        let before = self.tests.len();
        self.lines = self.lines.followed_by(&other.lines)?;
        self.tests.extend(other.tests);
        self.source = self.source.and(other.source);
        if !self.noise.contains(&other.noise) {
            self.noise = format!("{}; {}", self.noise, other.noise);
        }
        self.force_noise.extend(other.force_noise);
        let moved = other.findings.into_iter().map(|(at, finding)| (at + before, finding));
        self.findings.extend(moved);
        self.hits.extend(other.hits);
        self.remarks.extend(other.remarks);
        Ok(self)
    }

    /// Returns the lines of one record of the `block`, including the noise of the forces that act
    /// on the degrees of freedom `driven`. In the window of a `hit`, only the samples of the pulses
    /// have this noise; otherwise all samples have it.
    pub(super) fn with_force_noise(
        self,
        block: &Block,
        driven: &[usize],
        hit: Option<&HitNoise>,
        how: &IdentifyElements,
    ) -> Result<Self, AnalysisError> {
        let inputs = how.machine.instruments.inputs.iter().enumerate();
        let forces = inputs.filter(|(_, input)| matches!(input, Input::Force { .. }));
        let channels: Vec<usize> = forces.map(|(channel, _)| channel).collect();
        if channels.is_empty() {
            how.refuse_force_noise("motions of the support")?;
            return Ok(self);
        }
        let noise = ForceNoise::from_record(block, driven, how.force_noise.as_deref(), hit)?;
        let noisy = || channels.iter().enumerate().filter(|(force, _)| noise.level(*force) > 0.0);
        let lines = if let Some(pulses) = noise.pulses() {
            let of_pulse = |(force, channel): (usize, &usize), samples: &Range<usize>| PulseNoise {
                rows: 0..self.lines.len(),
                sampling: block.force.sampling(),
                channel: *channel,
                deviation: noise.level(force),
                samples: samples.clone(),
            };
            let of_force = |force| pulses.iter().map(move |samples| of_pulse(force, samples));
            let pulses: Vec<PulseNoise> = noisy().flat_map(of_force).collect();
            self.lines.with_pulse_noise(&pulses)?
        } else {
            // Lines get a covariance even if it is zero, because lines with and without known noise
            // cannot be joined.
            let (p, q) = (self.lines.outputs().ncols(), self.lines.inputs().ncols());
            let mut covariance = DMatrix::zeros(p + q, p + q);
            for (force, channel) in noisy() {
                covariance[(p + channel, p + channel)] = Complex::from(noise.level(force).powi(2));
            }
            let known = LineNoise::new(vec![covariance; self.lines.len()])?;
            self.lines.with_noise(known)?
        };
        Ok(Self { lines, force_noise: vec![noise], ..self })
    }

    /// Removes the lines that the settings exclude.
    pub(super) fn kept(
        lines: LineData,
        spacing_hz: f64,
        how: &IdentifyElements,
    ) -> Result<LineData, AnalysisError> {
        let excluded =
            |hz: f64| how.without_hz.iter().any(|disturbance| disturbance.reaches(hz, spacing_hz));
        lines.retained(|omega| !excluded(omega / TAU)).ok_or_else(|| AnalysisError::Setting {
            setting: "without_hz",
            why: format!("all lines are excluded: {0} of {0}", lines.len()),
        })
    }
}

/// Concatenates the data of several tests.
pub(super) fn joined(
    tests: impl IntoIterator<Item = Result<ElementData, AnalysisError>>,
) -> Result<ElementData, AnalysisError> {
    let mut combined: Option<ElementData> = None;
    for test in tests {
        let test = test?;
        combined = Some(match combined {
            None => test,
            Some(before) => before.followed_by(test)?,
        });
    }
    combined.ok_or(AnalysisError::NoRecord)
}
