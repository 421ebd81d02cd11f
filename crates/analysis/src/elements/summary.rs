//! Result of the identification of a machine: numbers, checks, notes.

use std::f64::consts::TAU;

use mechid_checks::{
    Finding, Subject, Verdict, adjust_p_values, after_machine_fit, delay_of_sensors,
    whiteness_of_lines,
};
use mechid_estimate::likelihood::machine::{Candidate, CandidateGain, MachineEstimate};
use mechid_estimate::likelihood::{
    Combination, FoundMinimum, IntervalKind, ParameterEstimate, PriorReport,
};
use mechid_io::{ParameterCovariance, SystemMatrices};
use mechid_model::elements::{Candidates, Instruments, Sensor, Speed};
use nalgebra::DMatrix;
use serde::Serialize;

use super::data::TestRow;
use super::machine::{self, StatedMachine, degrees_of_freedom};
use super::notes::ElementNote;
use super::{ElementData, IdentifyElements};
use crate::AnalysisError;
use crate::hits::HitRow;
use crate::identify::ForceNoise;
use crate::identify::checks::{CheckRow, When};
use crate::identify::rows::ModeRow;
use crate::limits::{LISTED_MODES_DOF, PRIOR_SHARE};

/// Identified coefficients of a machine with their uncertainty, and the tests.
#[derive(Debug, Serialize)]
pub struct ElementSummary {
    /// Tests that were fitted together.
    pub tests: Vec<TestRow>,
    /// Hits of hammer tests, used or left out.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub hits: Vec<HitRow>,
    /// Names of the inputs.
    pub inputs: Vec<String>,
    /// Sensors.
    pub sensors: Vec<SensorRow>,
    /// Names of the degrees of freedom.
    pub points: Vec<String>,
    /// Number of lines of all tests.
    pub lines: usize,
    /// Lowest and highest frequency, in Hz.
    pub band_hz: [f64; 2],
    /// Number of fitted real numbers: real and imaginary parts.
    pub equations: usize,
    /// Noise that determines the weights of the lines, in words.
    pub noise: String,
    /// Noise of the forces of open records and hits, one for each record.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub force_noise: Vec<ForceNoise>,
    /// Level of the intervals, a pure number such as 0.95.
    pub confidence: f64,
    /// Unknowns, in the order of the description.
    pub parameters: Vec<ElementRow>,
    /// Covariance of the unknowns, in the products of their units.
    pub parameter_covariance: ParameterCovariance,
    /// Unknowns that the data determine only in some combinations.
    pub combinations: Vec<CombinationRow>,
    /// Logarithm of the likelihood, a pure number.
    pub log_likelihood: f64,
    /// Minima of all searches, the lowest first.
    pub minima: Vec<FoundMinimum>,
    /// Number of searches.
    pub searches: usize,
    /// Ratio of the power of the residual to its expectation; `None` if the noise comes from the
    /// residual.
    pub misfit_ratio: Option<f64>,
    /// Probability of a larger misfit if model and noise are correct.
    pub misfit_p_value: Option<f64>,
    /// Factor that multiplies the standard errors and intervals computed from the noise, a ratio.
    pub error_scale: f64,
    /// Condition number of the Jacobian with columns of unit length, a pure number.
    pub condition_number: f64,
    /// Additional measurements, the best first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub candidates: Vec<CandidateRow>,
    /// Modes of small machines, by rising frequency.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub modes: Vec<ModeRow>,
    /// Every check, before the fit and after it.
    pub checks: Vec<CheckRow>,
    /// Notes on the numbers.
    pub notes: Vec<ElementNote>,
    /// M, C (with Ω G) and K; `None` if they do not form a system.
    pub system: Option<SystemMatrices>,
    /// Covariance of those entries of M, C and K that depend on unknowns.
    pub covariance: Option<ParameterCovariance>,
    /// Settings of the analysis; with them it can be repeated.
    pub analysis: IdentifyElements,
}

/// One unknown with its uncertainty.
#[derive(Debug, Clone, Serialize)]
pub struct ElementRow {
    /// SI unit for translations; rotations have the corresponding unit, such as N·m/rad for N/m.
    pub unit: &'static str,
    /// Value, standard error, interval, prior.
    #[serde(flatten)]
    pub estimate: ParameterEstimate,
}

/// A sensor with its residual.
#[derive(Debug, Clone, Serialize)]
pub struct SensorRow {
    /// Name of the channel.
    pub name: String,
    /// Unit of the quantity.
    pub unit: &'static str,
    /// Ratio of the root mean square of the residual to that of the response.
    pub relative_residual: f64,
}

/// Unknowns that the data determine only in some combinations.
#[derive(Debug, Clone, Serialize)]
pub struct CombinationRow {
    /// The combinations, in a sentence.
    pub text: String,
    /// The combinations in machine-readable form.
    #[serde(flatten)]
    pub combination: Combination,
}

/// An additional sensor or force.
#[derive(Debug, Clone, Serialize)]
pub struct CandidateRow {
    /// Name of the sensor or the force.
    pub name: String,
    /// Logarithm of a ratio: volume of the confidence region without the measurement, divided by
    /// its volume with the measurement; `None` if a combination becomes determined.
    pub information_gain: Option<f64>,
    /// Number of parameters or combinations that become determined.
    pub newly_determined: usize,
    /// Standard errors with the additional measurement, one for each parameter, in its SI unit;
    /// `None` if the parameter is still not determined.
    pub standard_errors: Vec<Option<f64>>,
}

impl From<CandidateGain> for CandidateRow {
    fn from(gain: CandidateGain) -> Self {
        Self {
            name: gain.name,
            information_gain: Some(gain.information_gain).filter(|gain| gain.is_finite()),
            newly_determined: gain.newly_determined,
            standard_errors: gain.standard_errors,
        }
    }
}

impl ElementSummary {
    pub(super) fn new(
        data: &ElementData,
        estimate: &MachineEstimate,
        how: &IdentifyElements,
        checks: Vec<CheckRow>,
    ) -> Result<Self, AnalysisError> {
        let (likelihood, lines) = (&estimate.likelihood, &data.lines);
        let equations = 2 * lines.outputs().len();
        let StatedMachine { system, covariance, notes } = machine::stated(estimate, equations)?;
        let of_forces =
            (!data.force_noise.is_empty()).then(|| ForceNoise::remark(&data.force_noise));
        let remarks = of_forces.into_iter().chain(data.remarks.iter().cloned());
        let remarks = remarks.map(|text| ElementNote::Read { text });
        let notes = notes_of(estimate, &checks).chain(notes).chain(remarks).collect();
        Ok(Self {
            tests: data.tests.clone(),
            hits: data.hits.clone(),
            inputs: instruments(how).inputs.iter().map(|input| input.name().to_owned()).collect(),
            sensors: sensors(estimate, how),
            points: estimate.assembly.dofs().to_vec(),
            lines: lines.len(),
            band_hz: band_hz(lines.omega()),
            equations,
            noise: data.noise.clone(),
            force_noise: data.force_noise.clone(),
            confidence: how.confidence,
            parameters: parameters(estimate),
            parameter_covariance: parameter_covariance(estimate, equations),
            combinations: likelihood.combinations.iter().map(CombinationRow::from).collect(),
            log_likelihood: likelihood.log_likelihood,
            minima: likelihood.minima.clone(),
            searches: likelihood.searches,
            misfit_ratio: likelihood.misfit_ratio,
            misfit_p_value: likelihood.misfit_p_value,
            error_scale: likelihood.error_scale,
            condition_number: likelihood.condition,
            candidates: candidates(data, estimate, how)?,
            modes: modes(estimate, equations)?,
            checks,
            notes,
            system: system.as_ref().map(SystemMatrices::from),
            covariance,
            analysis: how.clone(),
        })
    }

    /// Returns an unknown by its name.
    pub fn parameter(&self, name: &str) -> Option<&ParameterEstimate> {
        self.parameters.iter().map(|row| &row.estimate).find(|estimate| estimate.name == name)
    }
}

impl From<&Combination> for CombinationRow {
    fn from(combination: &Combination) -> Self {
        Self { text: combination.to_string(), combination: combination.clone() }
    }
}

fn instruments(how: &IdentifyElements) -> &Instruments {
    &how.machine.instruments
}

fn sensors(estimate: &MachineEstimate, how: &IdentifyElements) -> Vec<SensorRow> {
    let residuals = &estimate.likelihood.relative_residual;
    let rows = instruments(how).sensors.iter().zip(residuals);
    let row = |(sensor, residual): (&Sensor, &f64)| SensorRow {
        name: sensor.name.clone(),
        unit: sensor.quantity.unit(),
        relative_residual: *residual,
    };
    rows.map(row).collect()
}

fn parameters(estimate: &MachineEstimate) -> Vec<ElementRow> {
    let rows = estimate.likelihood.parameters.iter().zip(estimate.assembly.parameters());
    rows.map(|(estimate, p)| ElementRow { unit: p.unit, estimate: estimate.clone() }).collect()
}

/// Returns the lowest and the highest frequency, in Hz.
fn band_hz(omega: &[f64]) -> [f64; 2] {
    let low = omega.iter().copied().fold(f64::INFINITY, f64::min);
    let high = omega.iter().copied().fold(0.0, f64::max);
    [low / TAU, high / TAU]
}

/// Returns the covariance of the unknowns; undetermined unknowns have an infinite variance.
fn parameter_covariance(estimate: &MachineEstimate, equations: usize) -> ParameterCovariance {
    let parameters = &estimate.likelihood.parameters;
    let mut covariance: DMatrix<f64> = estimate.likelihood.covariance.clone();
    for (at, parameter) in parameters.iter().enumerate() {
        if parameter.standard_error.is_none() && !parameter.at_bound {
            covariance.row_mut(at).fill(0.0);
            covariance.column_mut(at).fill(0.0);
            covariance[(at, at)] = f64::INFINITY;
        }
    }
    let names = parameters.iter().map(|parameter| parameter.name.clone()).collect();
    ParameterCovariance::new(names, &covariance, degrees_of_freedom(estimate, equations))
}

fn candidates(
    data: &ElementData,
    estimate: &MachineEstimate,
    how: &IdentifyElements,
) -> Result<Vec<CandidateRow>, AnalysisError> {
    let Candidates { sensors, forces } = &how.machine.candidates;
    let listed: Vec<Candidate> = (sensors.iter().cloned().map(Candidate::Sensor))
        .chain(forces.iter().cloned().map(Candidate::Force))
        .collect();
    if listed.is_empty() {
        return Ok(Vec::new());
    }
    let (machine, instruments) = (&how.machine.machine, &how.machine.instruments);
    let gains = estimate.rank_candidates(&data.lines, machine, instruments, &listed)?;
    Ok(gains.into_iter().map(CandidateRow::from).collect())
}

/// Returns the modes of a small machine if all its entries are determined.
fn modes(estimate: &MachineEstimate, equations: usize) -> Result<Vec<ModeRow>, AnalysisError> {
    let is_small = estimate.assembly.dof() <= LISTED_MODES_DOF;
    // A synchronous rotor has another speed on each line. The modes change with the speed, so there
    // is no single list of modes.
    if !is_small || estimate.assembly.speed() == Speed::Synchronous {
        return Ok(Vec::new());
    }
    // A note or an undetermined combination states why the machine has no modes.
    let Ok(machine) = machine::machine(estimate, equations) else { return Ok(Vec::new()) };
    ModeRow::all(&machine.modes()?, machine.is_exact())
}

/// Returns the estimate, and whether the sensors are late by more than the noise explains. If the
/// sensors are late, the standard errors and intervals of the estimate include the change of the
/// parameters due to the delay.
pub(super) fn allowing_for_delay(
    estimate: MachineEstimate,
    checks: &[CheckRow],
) -> (MachineEstimate, bool) {
    let is_found = |check: &CheckRow| {
        let is_delay = matches!(check.finding, Finding::SensorDelay(_));
        is_delay && check.finding.verdict() != Verdict::Good
    };
    let changes = estimate.delay.as_ref().map(|score| score.changes.clone());
    let changes = changes.filter(|_| checks.iter().any(is_found));
    match changes {
        Some(changes) => (estimate.with_parameter_errors(&changes), true),
        None => (estimate, false),
    }
}

/// Returns the estimate with larger standard errors and intervals, at the level `confidence`, if
/// parts of the data disagree by more than the standard errors allow.
pub(super) fn allowing_for_parts(
    estimate: MachineEstimate,
    checks: &[CheckRow],
    confidence: f64,
) -> MachineEstimate {
    let scatter = |check: &CheckRow| match &check.finding {
        Finding::PartsAgreement(parts) if check.finding.verdict() != Verdict::Good => {
            Some((parts.scatter, parts.degrees_of_freedom))
        }
        _ => None,
    };
    match checks.iter().find_map(scatter) {
        Some((scatter, degrees_of_freedom)) if scatter > estimate.likelihood.error_scale => {
            let factor = scatter / estimate.likelihood.error_scale;
            estimate.with_error_scale(factor, degrees_of_freedom, confidence)
        }
        _ => estimate,
    }
}

/// Returns the checks of data and fit.
pub(super) fn checks(data: &ElementData, estimate: &MachineEstimate) -> Vec<CheckRow> {
    let before =
        data.findings.iter().map(|(at, finding)| (When::Before, Some(*at), finding.clone()));
    let mut findings: Vec<(When, Option<usize>, Finding)> = before.collect();
    let after = after_machine_fit(estimate, data.source);
    let delay = delay_of_sensors(estimate);
    findings.extend(after.into_iter().chain(delay).map(|finding| (When::After, None, finding)));
    for (at, (rows, _)) in data.lines.records().iter().enumerate() {
        let white = whiteness_of_lines(estimate, &data.lines, rows);
        findings.extend(white.into_iter().map(|finding| (When::After, Some(at), finding)));
    }
    adjust_p_values(findings.iter_mut().map(|(_, _, finding)| finding));
    let several = data.tests.len() > 1;
    let name = |at: usize| data.tests.get(at).filter(|_| several).map(|test| test.file.clone());
    let row = |(when, at, finding): &(When, Option<usize>, Finding)| {
        CheckRow::new(*when, at.and_then(name), finding, &data.channels)
    };
    findings.iter().map(row).collect()
}

fn notes_of(estimate: &MachineEstimate, checks: &[CheckRow]) -> impl Iterator<Item = ElementNote> {
    let likelihood = &estimate.likelihood;
    let mut notes = Vec::new();
    if likelihood.error_scale > 1.0 {
        let is_cause = |check: &&CheckRow| {
            matches!(check.finding, Finding::Misfit(_) | Finding::PartsAgreement(_))
                && check.finding.verdict() != Verdict::Good
        };
        let mut causes: Vec<String> =
            checks.iter().filter(is_cause).map(|check| check.subject.to_string()).collect();
        causes.dedup();
        // The misfit can increase the standard errors even if the check `misfit` does not warn,
        // because that check is adjusted for the number of tests.
        if causes.is_empty() {
            causes.push(Subject::Misfit.to_string());
        }
        let (factor, checks) = (likelihood.error_scale, causes.join(", "));
        notes.push(ElementNote::ScaledErrors { factor, checks });
    }
    for parameter in &likelihood.parameters {
        let name = || parameter.name.clone();
        if parameter.interval_kind == IntervalKind::OneSided {
            notes.push(ElementNote::AtBound { parameter: name(), bound: parameter.value });
        }
        if let Some(PriorReport { share, .. }) = parameter.prior.filter(|p| p.share > PRIOR_SHARE) {
            notes.push(ElementNote::FromPrior { parameter: name(), share });
        }
    }
    if likelihood.parameters.iter().any(|parameter| parameter.at_bound) {
        notes.push(ElementNote::BoundInSystem);
    }
    notes.into_iter()
}
