//! Identification from frequency responses that were measured elsewhere.

use std::f64::consts::TAU;
use std::fmt;

use mechid_checks::{
    Finding, Subject, Verdict, adjust_p_values, before_spectral_fit, constant_phase, gain_symmetry,
    instability, mass_symmetry, negative_mass, unrelated_response,
};
use mechid_estimate::frequency_domain::{equation_error, output_error_of_table};
use mechid_estimate::{Estimate, ResponseEstimate, Unknowns, output_error_of_responses};
use mechid_io::{FrequencyResponses, ParameterCovariance, SystemMatrices};
use mechid_model::SecondOrderSystem;
use mechid_spectra::{FrequencyData, NoiseModel};
use nalgebra::DMatrix;
use serde::Serialize;

use super::added_decay;
use super::checks::{CheckRow, When};
use super::fitted::{Misfit, counted_explanation, unexplained_motion};
use super::other_models::better_model_of;
use super::response_settings::IdentifyResponses;
use super::responses::blunted;
use super::rows::{
    CONFIDENCE, ParameterRow, ProportionalDamping, carries_covariance, covariance, mode_table,
    omitted_covariance_remark, parameter_table, parameters,
};
use super::summary::{FitRow, verdict};
use super::tabulated::{Noise, Tabulated};
use super::{FittedLine, Method, Unscaled};
use crate::AnalysisError;
use crate::machine::Machine;
use crate::measurement::Channels;
use crate::measurement::units::doubt;
use crate::modal::{ShapedMode, shape_table};
use crate::modes::resonances;
use crate::text::{compact, paragraph, significant};

/// Identifies a machine from one or several tables of frequency responses, which are fitted
/// together; each needs the response at every point where a force acts.
///
/// Maximum likelihood weights every response by its variance: from its standard error if the table
/// has one, otherwise from coherence and averages. Without either, the noise is white, in
/// proportion to the response, or the sum of both, as the residual shows.
///
/// # Errors
/// [`AnalysisError::NoRecord`], [`AnalysisError::NoResponse`] if a response is missing,
/// [`AnalysisError::Setting`] for settings that are missing or that contradict the table,
/// [`AnalysisError::EmptyBand`], and [`AnalysisError::Estimate`] if the fit fails.
///
/// # Source
/// Bendat & Piersol, *Random Data*, 4th ed. (2010), chapter 9 (the variance from the coherence).
pub fn identify_responses(
    tables: &[FrequencyResponses],
    how: &IdentifyResponses,
) -> Result<IdentifiedResponses, AnalysisError> {
    let added_decay = added_decay::common_rate(tables)?;
    let measured = tables.iter().map(|table| Tabulated::new(table, how));
    let mut measured: Vec<Tabulated> = measured.collect::<Result<_, _>>()?;
    let mut data = joined(&measured)?;
    let driven: Vec<usize> = measured.iter().flat_map(|m| m.driven.iter().copied()).collect();
    let fit = |unknowns: &Unknowns| {
        let windowed = match added_decay {
            Some(rate) => &added_decay::unknowns(unknowns, rate)?,
            None => unknowns,
        };
        let fit = Fit::new(&data, windowed, &measured, how.method)?;
        let of_machine = match added_decay {
            Some(rate) => fit.estimate.without_added_decay(rate, unknowns.clone())?,
            None => fit.estimate.clone(),
        };
        Ok((fit, of_machine, before_spectral_fit(&data, windowed)?))
    };
    let unknowns = how.structure.apply(how.mass.unknowns(data.dof())?)?;
    let ((fit, of_machine, before), unscaled) = Unscaled::or_fitted(&unknowns, &driven, fit)?;
    if let Some(of_segments) = &fit.averaged {
        let mut responses = of_segments.responses.iter().cloned();
        measured.iter_mut().try_for_each(|one| one.replace(&mut responses))?;
        data = joined(&measured)?;
    }
    let first = measured.first().ok_or(AnalysisError::NoRecord)?;
    let unexplained = unexplained_motion(&data, &fit.estimate.system()?)?;
    let fitted = OfFit { fit: &fit, of_machine: &of_machine, data: &data, unexplained };
    let (checks, change) = fitted.checks(tables, &measured, how, before, unscaled.is_some())?;
    let mut remarks = remarks(tables, &measured, added_decay, &fit, &of_machine, unscaled.as_ref());
    remarks.extend(fitted.residual_remarks(&checks, tables, how));
    let change = change.filter(|_| added_decay.is_none() && unscaled.is_none());
    let (of_machine, remark) = with_change(of_machine, change, &checks)?;
    remarks.extend(remark);
    let (estimate, system) = (&of_machine, of_machine.system()?);
    let summary = ResponseSummary {
        files: tables.iter().map(|table| table.file.clone()).collect(),
        estimator: fit.name,
        quantity: data.measured().to_string(),
        points: first.points.clone(),
        forces: first.driven.iter().map(|dof| first.points[*dof].clone()).collect(),
        frequencies: FrequencyRow::from_table(first),
        confidence: CONFIDENCE,
        parameters: parameters(estimate, unscaled.as_ref())?,
        proportional_damping: ProportionalDamping::from_estimate(estimate)?,
        modes: ShapedMode::all(&estimate.modes()?, false)?,
        fit: fit.row(estimate, unexplained, how.method, data.len()),
        fitted_lines: None,
        checks,
        remarks,
        system: unscaled.is_none().then(|| SystemMatrices::from(&system)),
        covariance: carries_covariance(estimate).then(|| covariance(estimate, unscaled.as_ref())),
        unscaled,
        analysis: how.clone(),
    };
    Ok(IdentifiedResponses { estimate: of_machine, fitted: fit.estimate, data, summary })
}

/// Returns the estimate with the square of a change of its parameters in its covariance, and the
/// remark on it. Under an exponential window the change would be that of other parameters.
fn with_change(
    estimate: Estimate,
    change: Option<DMatrix<f64>>,
    checks: &[CheckRow],
) -> Result<(Estimate, Option<String>), AnalysisError> {
    Ok(match change {
        Some(square) => (estimate.with_mean_square(&square)?, counted_explanation(checks)),
        None => (estimate, None),
    })
}

/// A fit with its data.
struct OfFit<'a> {
    fit: &'a Fit,
    of_machine: &'a Estimate,
    data: &'a FrequencyData,
    /// Part of the response that the fit does not explain, a ratio.
    unexplained: Option<f64>,
}

impl OfFit<'_> {
    /// Returns the remarks on the residual that its `checks` do not already contain.
    fn residual_remarks(
        &self,
        checks: &[CheckRow],
        tables: &[FrequencyResponses],
        how: &IdentifyResponses,
    ) -> Vec<String> {
        let mut remarks = Vec::new();
        if !checks.iter().any(|check| matches!(check.finding, Finding::Misfit(_))) {
            remarks.extend(self.fit.misfit.map(|misfit| misfit.to_string()));
        }
        let is_residual =
            |check: &CheckRow| check.is_conspicuous() && is_of_residual(&check.finding);
        if checks.iter().any(is_residual) && !checks.iter().any(CheckRow::is_bad) {
            remarks.extend(resonances::surplus_of_tables(tables, how));
        }
        remarks
    }

    /// Returns the checks of the tables before and after the fit, and the square of the change of
    /// the parameters by a model that explains the responses far better.
    fn checks(
        &self,
        tables: &[FrequencyResponses],
        measured: &[Tabulated],
        how: &IdentifyResponses,
        before: Vec<Finding>,
        is_unscaled: bool,
    ) -> Result<(Vec<CheckRow>, Option<DMatrix<f64>>), AnalysisError> {
        let mut findings: Vec<(When, Option<String>, Finding)> =
            before.into_iter().map(|finding| (When::Before, None, finding)).collect();
        let named = |table: &FrequencyResponses| (tables.len() > 1).then(|| table.file.clone());
        for table in tables {
            let doubts = table.doubts.iter();
            let doubts =
                doubts.filter_map(|(column, stated, wanted)| doubt(column, stated, *wanted));
            let phases = table.functions.iter().filter_map(|f| {
                constant_phase(&f.response, &f.reference, f.values.iter().copied())
            });
            let before = doubts.chain(phases);
            findings.extend(before.map(|finding| (When::Before, named(table), finding)));
        }
        let (fit, rows) = (self.fit, self.data.len());
        let settled = fit.averaged.as_ref().is_none_or(|averaged| averaged.settled);
        for (table, measured) in tables.iter().zip(measured) {
            for (when, finding) in measured.findings(&fit.estimate, rows, settled)? {
                findings.push((when, named(table), finding));
            }
        }
        let is_left =
            |finding: &Finding| finding.verdict() > Verdict::Good && is_of_residual(finding);
        let (mut after, mut change) = (Vec::new(), None);
        if findings.iter().any(|(_, _, finding)| is_left(finding)) {
            let better = better_model_of(tables, how, self.data, &fit.estimate);
            change = better.as_ref().and_then(|better| better.change.clone());
            after.extend(better.map(|better| better.finding));
        }
        let unknowns = fit.estimate.unknowns();
        let of_one = unknowns.independent().div_ceil(unknowns.dof().max(1));
        let unrelated = |part| unrelated_response(part, 2 * rows, of_one);
        after.extend(self.unexplained.and_then(unrelated));
        after.extend(instability(&self.of_machine.modes()?));
        if !is_unscaled {
            after.extend(negative_mass(self.of_machine));
            after.extend(mass_symmetry(self.of_machine));
            after.extend(gain_symmetry(self.of_machine));
        }
        findings.extend(after.into_iter().map(|finding| (When::After, None, finding)));
        adjust_p_values(findings.iter_mut().map(|(_, _, finding)| finding));
        let row = |(when, name, finding): (When, Option<String>, Finding)| {
            CheckRow::new(when, name, &finding, &Channels::default())
        };
        Ok((findings.into_iter().map(row).collect(), change))
    }
}

/// Returns whether a finding is about the residual of a fit.
fn is_of_residual(finding: &Finding) -> bool {
    matches!(finding.subject(), Subject::Misfit | Subject::Whiteness)
}

fn remarks(
    tables: &[FrequencyResponses],
    measured: &[Tabulated],
    added_decay: Option<f64>,
    fit: &Fit,
    of_machine: &Estimate,
    unscaled: Option<&Unscaled>,
) -> Vec<String> {
    unscaled
            .iter()
            .map(|unscaled| unscaled.to_string())
            .chain(tables.iter().flat_map(|table| table.remarks.iter().cloned()))
            .chain(measured.iter().flat_map(|measured| measured.remarks.iter().cloned()))
            .chain(added_decay.map(|rate| {
                format!(
                    "an exponential window adds {} 1/s to the decay rate of every mode of the table: this was subtracted from damping and stiffness",
                    significant(rate, 4)
                )
            }))
            .chain(fit.averaged.as_ref().and_then(blunted))
            .chain(omitted_covariance_remark(of_machine))
            .collect()
}

/// A machine identified from tables of frequency responses.
///
/// [`Display`](fmt::Display) formats the result for a reader, `serde` for programs.
#[derive(Debug)]
pub struct IdentifiedResponses {
    estimate: Estimate,
    fitted: Estimate,
    data: FrequencyData,
    summary: ResponseSummary,
}

/// Result of an identification from frequency responses: numbers, checks and remarks.
#[derive(Debug, Serialize)]
pub struct ResponseSummary {
    /// The tables.
    pub files: Vec<String>,
    /// Name of the estimator.
    pub estimator: &'static str,
    /// Measured quantity of the responses.
    pub quantity: String,
    /// Points of the responses, one per degree of freedom.
    pub points: Vec<String>,
    /// Points of the forces.
    pub forces: Vec<String>,
    /// Frequencies of the first table.
    pub frequencies: FrequencyRow,
    /// Level of the confidence intervals, a pure number such as 0.95.
    pub confidence: f64,
    /// Parameters, one each, without the entries of [`unscaled`](Self::unscaled) equations.
    pub parameters: Vec<ParameterRow>,
    /// Equations of motion without scale, whose parameters do not follow from the data.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unscaled: Option<Unscaled>,
    /// Factors of proportional damping; `None` unless it was requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub proportional_damping: Option<ProportionalDamping>,
    /// Modes, by rising frequency.
    pub modes: Vec<ShapedMode>,
    /// Quality of the fit.
    pub fit: FitRow,
    /// Every line of the fit; `None` unless requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fitted_lines: Option<Vec<FittedLine>>,
    /// Checks before and after the fit.
    pub checks: Vec<CheckRow>,
    /// Remarks to read before using the numbers.
    pub remarks: Vec<String>,
    /// M, C and K, as `mechid force --system` and others read them; `None` if equations have no
    /// scale.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub system: Option<SystemMatrices>,
    /// Covariance of the estimated parameters, for quantities derived from them; `None` for more
    /// than 2,000 parameters: use [`IdentifiedResponses::covariance`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub covariance: Option<ParameterCovariance>,
    /// Settings of the analysis; with them it can be repeated.
    pub analysis: IdentifyResponses,
}

/// Frequencies that were used.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct FrequencyRow {
    /// Number of frequencies.
    pub count: usize,
    /// Lowest frequency, in Hz.
    pub first_hz: f64,
    /// Highest frequency, in Hz.
    pub last_hz: f64,
}

impl FrequencyRow {
    fn from_table(table: &Tabulated) -> Self {
        let hz = table.data.omega().iter().map(|omega| omega / TAU);
        Self {
            count: table.data.len() / table.driven.len(),
            first_hz: hz.clone().fold(f64::INFINITY, f64::min),
            last_hz: hz.fold(0.0, f64::max),
        }
    }
}

impl IdentifiedResponses {
    /// Returns the estimate of M, C and K with its covariance. If equations have no scale
    /// ([`ResponseSummary::unscaled`]), it is one of the systems with the same modes.
    pub fn estimate(&self) -> &Estimate {
        &self.estimate
    }

    /// Returns the identified system.
    ///
    /// # Errors
    /// [`AnalysisError::Estimate`] if the data do not determine a parameter,
    /// [`AnalysisError::Unscaled`] if they determine only its modes.
    pub fn system(&self) -> Result<SecondOrderSystem, AnalysisError> {
        self.check_scale()?;
        Ok(self.estimate.system()?)
    }

    fn check_scale(&self) -> Result<(), AnalysisError> {
        Unscaled::check(self.summary.unscaled.as_ref())
    }

    /// Returns the covariance of the estimated parameters, for any number of them.
    pub fn covariance(&self) -> ParameterCovariance {
        covariance(&self.estimate, self.summary.unscaled.as_ref())
    }

    /// Returns the estimate that was fitted to [`IdentifiedResponses::data`]:
    /// [`IdentifiedResponses::estimate`] with the decay that an exponential window adds.
    pub fn fitted(&self) -> &Estimate {
        &self.fitted
    }

    /// Returns the frequency responses that were fitted: unit forces, and displacements with their
    /// noise.
    pub fn data(&self) -> &FrequencyData {
        &self.data
    }

    /// Returns the numbers, checks and remarks.
    pub fn summary(&self) -> &ResponseSummary {
        &self.summary
    }

    /// Adds every line of the fit to [`IdentifiedResponses::summary`]: measured and fitted
    /// responses with their standard errors, and the residual.
    ///
    /// # Errors
    /// [`AnalysisError::Model`] if the identified system has no response at a line.
    pub fn add_fitted_lines(&mut self) -> Result<(), AnalysisError> {
        self.summary.fitted_lines = Some(FittedLine::all(&self.data, &self.fitted)?);
        Ok(())
    }

    /// Returns the identified system with the covariance of its parameters.
    ///
    /// # Errors
    /// As [`IdentifiedResponses::system`].
    pub fn machine(&self) -> Result<Machine, AnalysisError> {
        self.check_scale()?;
        Machine::from_estimate(&self.estimate)
    }
}

impl Serialize for IdentifiedResponses {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.summary.serialize(serializer)
    }
}

impl fmt::Display for IdentifiedResponses {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let s = &self.summary;
        let [low, high] = [s.frequencies.first_hz, s.frequencies.last_hz].map(|hz| compact(hz, 5));
        writeln!(
            f,
            "{}: {} at {} per force at {}\n{}; {}, {low} to {high} Hz\n",
            s.files.join(", "),
            s.quantity,
            s.points.join(", "),
            s.forces.join(", "),
            s.estimator,
            match s.frequencies.count {
                1 => "1 frequency".to_owned(),
                count => format!("{count} frequencies"),
            },
        )?;
        if !s.parameters.is_empty() {
            let factors = s.proportional_damping.iter().flat_map(ProportionalDamping::rows);
            writeln!(f, "{}", parameter_table(&s.parameters, factors))?;
        }
        writeln!(f, "{}", mode_table("mode", &ShapedMode::rows(&s.modes)))?;
        if s.unscaled.is_some() {
            writeln!(f, "{}", shape_table(&s.modes, |at| s.points[at].clone()))?;
        }
        writeln!(f, "{}", s.fit.lines("linear model"))?;
        f.write_str(&verdict(&s.checks))?;
        f.write_str(&paragraph(s.remarks.iter().map(|remark| format!("note: {remark}"))))
    }
}

/// A fit with the normalised power of its residual.
struct Fit {
    name: &'static str,
    estimate: Estimate,
    misfit: Option<Misfit>,
    noise: Vec<NoiseModel>,
    /// Fit of the averages; `None` unless all tables state their segments.
    averaged: Option<ResponseEstimate>,
}

/// Returns the data of all tables, concatenated.
pub(super) fn joined(measured: &[Tabulated]) -> Result<FrequencyData, AnalysisError> {
    let first = measured.first().ok_or(AnalysisError::NoRecord)?;
    measured[1..].iter().try_fold(first.data.clone(), |data, next| Ok(data.and(&next.data)?))
}

impl Fit {
    /// Returns the quality of the fit; `rows` is the number of rows of all tables together.
    fn row(
        &self,
        of_machine: &Estimate,
        unexplained: Option<f64>,
        method: Option<Method>,
        rows: usize,
    ) -> FitRow {
        // Least squares minimises the residual of the force, maximum likelihood the residual of the
        // response.
        let residual_nrmse = of_machine.residual_nrmse();
        let of_force = || {
            (residual_nrmse.iter().map(|e| e * e).sum::<f64>() / residual_nrmse.len() as f64).sqrt()
        };
        let of_response = unexplained.filter(|_| method != Some(Method::LeastSquares));
        FitRow {
            nrmse: of_response.unwrap_or_else(of_force),
            unexplained_motion: unexplained,
            misfit_ratio: self.misfit.map(|misfit| misfit.ratio),
            noise: self.noise.clone(),
            force_noise: Vec::new(),
            sinusoids: Vec::new(),
            error_scale: 1.0,
            condition_number: of_machine.condition(),
            equations: 2 * rows,
            unknowns: of_machine.unknowns().independent(),
        }
    }

    fn new(
        data: &FrequencyData,
        unknowns: &Unknowns,
        measured: &[Tabulated],
        method: Option<Method>,
    ) -> Result<Self, AnalysisError> {
        if method == Some(Method::Instrumental) {
            return Err(AnalysisError::InstrumentalResponses);
        }
        if method == Some(Method::LeastSquares) {
            let name = "least squares on frequency responses, all with equal weights";
            let estimate = equation_error(data, unknowns)?;
            return Ok(Self { name, estimate, misfit: None, noise: Vec::new(), averaged: None });
        }
        let averaged: Option<Vec<_>> = measured.iter().map(Tabulated::averaged).collect();
        let averaged = match averaged {
            Some(each) => {
                let records: Vec<_> = each.into_iter().flatten().cloned().collect();
                Some(output_error_of_responses(&records, unknowns)?)
            }
            None => None,
        };
        let fit = match &averaged {
            Some(of_segments) => of_segments.fit.clone(),
            None => output_error_of_table(data, unknowns)?,
        };
        let noise = measured[0].noise;
        let name = match noise {
            Noise::Stated => {
                "maximum likelihood on frequency responses, weighted by their standard errors"
            }
            Noise::Coherence => {
                "maximum likelihood on frequency responses, weighted by their coherence"
            }
            Noise::Unknown => {
                "maximum likelihood on frequency responses, with noise estimated from the residual"
            }
        };
        let misfit = noise.source().map(|noise| Misfit { ratio: fit.misfit_ratio, noise });
        Ok(Self { name, estimate: fit.estimate, misfit, noise: fit.noise, averaged })
    }
}
