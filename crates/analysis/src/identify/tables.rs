//! Identification from frequency responses that were measured elsewhere.

use std::f64::consts::TAU;
use std::fmt;

use mechid_estimate::{Estimate, Unknowns};
use mechid_io::{FrequencyResponses, ParameterCovariance, SystemMatrices};
use mechid_model::SecondOrderSystem;
use mechid_spectra::FrequencyData;
use serde::Serialize;

use super::checks::CheckRow;
use super::counts::memory_of_tables;
use super::other_models::with_better_model;
use super::response_settings::IdentifyResponses;
use super::responses::blunted;
use super::rows::{
    CONFIDENCE, ParameterRow, ProportionalDamping, carries_covariance, covariance, mode_table,
    omitted_covariance_remark, parameter_table, parameters,
};
use super::summary::{FitRow, verdict};
use super::table_fit::{CheckedFit, TableFit};
use super::tabulated::{Tabulated, joined};
use super::{FittedLine, Unscaled, added_decay, counts};
use crate::machine::Machine;
use crate::modal::{ShapedMode, shape_table};
use crate::text::{compact, paragraph, significant};
use crate::{AnalysisError, time_limit};

/// Identifies a machine from one or several tables of frequency responses, which are fitted
/// together; each needs the response at every point where a force acts.
///
/// Maximum likelihood weights every response by its variance: from its standard error if the table
/// has one, otherwise from coherence and averages. Without standard errors and coherence, the noise
/// is estimated from the residual: white, in proportion to the response, or the sum of these two.
///
/// # Errors
/// [`AnalysisError::NoRecord`], [`AnalysisError::NoResponse`] if a response is missing,
/// [`AnalysisError::Setting`] for settings that are missing or that contradict the table,
/// [`AnalysisError::Memory`] if the fit needs more memory than the files may use,
/// [`AnalysisError::EmptyBand`], and [`AnalysisError::Estimate`] or [`AnalysisError::Unfit`] if the
/// fit fails.
///
/// # Source
/// Bendat & Piersol, *Random Data*, 4th ed. (2010), chapter 9 (the variance from the coherence).
pub fn identify_responses(
    tables: &[FrequencyResponses],
    how: &IdentifyResponses,
) -> Result<IdentifiedResponses, AnalysisError> {
    time_limit::bounded(memory_of_tables(tables), || identify_tables(tables, how))
}

fn identify_tables(
    tables: &[FrequencyResponses],
    how: &IdentifyResponses,
) -> Result<IdentifiedResponses, AnalysisError> {
    let added_decay = added_decay::common_rate(tables)?;
    counts::check_tables(tables, how)?;
    let measured = tables.iter().map(|table| Tabulated::new(table, how));
    let mut measured: Vec<Tabulated> = measured.collect::<Result<_, _>>()?;
    let mut data = joined(&measured)?;
    let driven: Vec<usize> = measured.iter().flat_map(|m| m.driven.iter().copied()).collect();
    let fit = |unknowns: &Unknowns| {
        TableFit::new(&data, unknowns, &measured, added_decay, how.method)
            .map_err(|failure| with_better_model(failure, tables, how, &data, unknowns))
    };
    let unknowns = how.structure.apply(how.mass.unknowns(data.dof())?)?;
    let (fit, unscaled) = Unscaled::or_fitted(&unknowns, &driven, fit)?;
    if let Some(of_segments) = &fit.averaged {
        let mut responses = of_segments.responses.iter().cloned();
        measured.iter_mut().try_for_each(|one| one.replace(&mut responses))?;
        data = joined(&measured)?;
    }
    let first = measured.first().ok_or(AnalysisError::NoRecord)?;
    let checked = CheckedFit::new(&fit, &data, tables, &measured, how, unscaled.is_some())?;
    let mut remarks = remarks(tables, &measured, added_decay, &fit, unscaled.as_ref());
    remarks.extend(checked.remarks(&fit, tables, how)?);
    let row = checked.row(&fit, data.len());
    let CheckedFit { mut checks, estimate, .. } = checked;
    checks.extend(time_limit::check());
    let system = estimate.system()?;
    let summary = ResponseSummary {
        files: tables.iter().map(|table| table.file.clone()).collect(),
        estimator: fit.name,
        quantity: data.measured().to_string(),
        points: first.points.clone(),
        forces: first.driven.iter().map(|dof| first.points[*dof].clone()).collect(),
        frequencies: FrequencyRow::from_table(first),
        confidence: CONFIDENCE,
        parameters: parameters(&estimate, unscaled.as_ref())?,
        proportional_damping: ProportionalDamping::from_estimate(&estimate)?,
        modes: ShapedMode::all(&estimate.modes()?, false)?,
        fit: row,
        fitted_lines: None,
        checks,
        remarks,
        system: unscaled.is_none().then(|| SystemMatrices::from(&system)),
        covariance: carries_covariance(&estimate).then(|| covariance(&estimate, unscaled.as_ref())),
        unscaled,
        analysis: how.clone(),
    };
    Ok(IdentifiedResponses { estimate, fitted: fit.estimate, data, summary })
}

fn remarks(
    tables: &[FrequencyResponses],
    measured: &[Tabulated],
    added_decay: Option<f64>,
    fit: &TableFit,
    unscaled: Option<&Unscaled>,
) -> Vec<String> {
    unscaled
            .iter()
            .map(|unscaled| unscaled.to_string())
            .chain(tables.iter().flat_map(|table| table.remarks.iter().cloned()))
            .chain(measured.iter().flat_map(|measured| measured.remarks.iter().cloned()))
            .chain(added_decay.map(|rate| {
                format!(
                    "an exponential window adds {} 1/s to the decay rate of every mode of the table: this effect was \
                     removed from damping and stiffness",
                    significant(rate, 4)
                )
            }))
            .chain(fit.averaged.as_ref().and_then(blunted))
            .chain(omitted_covariance_remark(&fit.of_machine))
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
    /// Parameters, one row each, without the entries of [`unscaled`](Self::unscaled) equations.
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
    /// M, C and K, as `mechid force --system` and other commands read them; `None` if equations
    /// have no scale.
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

    /// Returns the summary of the result: numbers, checks and remarks.
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
