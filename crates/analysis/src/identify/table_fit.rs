//! Fit of tables of frequency responses, with its checks and standard errors.

use mechid_checks::{
    Finding, RowParts, Subject, Verdict, adjust_p_values, before_spectral_fit, constant_phase,
    gain_symmetry, instability, mass_symmetry, negative_mass, unrelated_response,
};
use mechid_estimate::frequency_domain::{PartsOfFit, Split, equation_error, output_error_of_table};
use mechid_estimate::{Estimate, ResponseEstimate, Unknowns, output_error_of_responses};
use mechid_io::FrequencyResponses;
use mechid_numerics::time_limit;
use mechid_spectra::{FrequencyData, NoiseModel, NoiseSpectrum};

use super::checks::{CheckRow, When};
use super::compared::{Compared, rows_of};
use super::disagreement::Disagreement;
use super::fitted::{Misfit, unexplained_motion};
use super::other_models::better_model_of;
use super::response_settings::IdentifyResponses;
use super::summary::FitRow;
use super::tabulated::{Noise, Tabulated};
use super::{Method, added_decay, determined};
use crate::AnalysisError;
use crate::limits::CAUSE_OPERATIONS;
use crate::measurement::Channels;
use crate::measurement::units::doubt;
use crate::modes::resonances;
use crate::text::significant;

/// A fit to the data of tables.
pub(super) struct TableFit {
    pub(super) name: &'static str,
    /// Estimate from the data as measured: its decay rates include the decay of an exponential
    /// window.
    pub(super) estimate: Estimate,
    /// Estimate of the machine, without the decay of an exponential window.
    pub(super) of_machine: Estimate,
    misfit: Option<Misfit>,
    noise: Vec<NoiseModel>,
    /// Noise spectrum of the weights; `None` without weights.
    spectrum: Option<NoiseSpectrum>,
    /// Ratio of the variance of the parameters to that for independent lines.
    variance_ratio: f64,
    /// Fit of the averages; `None` unless all tables state their segments.
    pub(super) averaged: Option<ResponseEstimate>,
    /// Findings before the fit.
    before: Vec<Finding>,
    method: Option<Method>,
}

impl TableFit {
    /// Fits the `data` of the `measured` tables. `decay` is the rate, in 1/s, that an exponential
    /// window added to the decay of every mode.
    pub(super) fn new(
        data: &FrequencyData,
        unknowns: &Unknowns,
        measured: &[Tabulated],
        decay: Option<f64>,
        method: Option<Method>,
    ) -> Result<Self, AnalysisError> {
        let windowed = match decay {
            Some(rate) => &added_decay::unknowns(unknowns, rate)?,
            None => unknowns,
        };
        let fit = match method {
            Some(Method::Instrumental) => return Err(AnalysisError::InstrumentalResponses),
            Some(Method::LeastSquares) => Self::least_squares(data, windowed)?,
            _ => Self::most_likely(data, windowed, measured)?,
        };
        let of_machine = match decay {
            Some(rate) => fit.estimate.without_added_decay(rate, unknowns.clone())?,
            None => fit.estimate.clone(),
        };
        Ok(Self { of_machine, before: before_spectral_fit(data, windowed)?, method, ..fit })
    }

    fn least_squares(data: &FrequencyData, unknowns: &Unknowns) -> Result<Self, AnalysisError> {
        let estimate = equation_error(data, unknowns)?;
        Ok(Self {
            name: "least squares on frequency responses, all with equal weights",
            of_machine: estimate.clone(),
            estimate,
            misfit: None,
            noise: Vec::new(),
            spectrum: None,
            variance_ratio: 1.0,
            averaged: None,
            before: Vec::new(),
            method: None,
        })
    }

    fn most_likely(
        data: &FrequencyData,
        unknowns: &Unknowns,
        measured: &[Tabulated],
    ) -> Result<Self, AnalysisError> {
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
        Ok(Self {
            name,
            of_machine: fit.estimate.clone(),
            estimate: fit.estimate,
            misfit: noise.source().map(|noise| Misfit { ratio: fit.misfit_ratio, noise }),
            noise: fit.noise,
            spectrum: Some(fit.spectrum),
            variance_ratio: fit.variance_ratio,
            averaged,
            before: Vec::new(),
            method: None,
        })
    }

    /// Returns a remark on errors that are correlated from line to line.
    fn correlated_lines(&self) -> Option<String> {
        (self.variance_ratio > 1.0).then(|| {
            format!(
                "the errors of neighbouring lines are correlated, for example by a \
                 window: standard errors and intervals are {} times those of independent lines",
                significant(self.variance_ratio.sqrt(), 3)
            )
        })
    }

    /// Compares the bands of lines with each other and, if there are several `measured` tables,
    /// also the tables with each other.
    fn compared(
        &self,
        data: &FrequencyData,
        measured: &[Tabulated],
    ) -> Result<Compared, AnalysisError> {
        let Some(spectrum) = &self.spectrum else { return Ok(Compared::default()) };
        if self.averaged.is_some() {
            let averages = measured.iter().filter_map(Tabulated::averaged).flatten();
            let averages: Vec<_> = averages.cloned().collect();
            return Ok(Compared::from_averages(data, &averages, &self.estimate)?);
        }
        let mut splits = vec![(Split::Bands, RowParts::Records)];
        if measured.len() > 1 {
            let tables: Vec<FrequencyData> = measured.iter().map(|one| one.data.clone()).collect();
            splits.push((Split::Rows(rows_of(&tables)), RowParts::Records));
        }
        let parts = PartsOfFit::new(data, &self.estimate, None, Some(spectrum))
            .map(|parts| parts.with_variance_ratio(self.variance_ratio));
        Ok(parts.map_or_else(Compared::default, |parts| {
            Compared::new(&parts, &splits, None, &self.estimate)
        }))
    }
}

/// A checked fit. The standard errors of its estimate include the disagreement of model and data
/// that the checks show.
pub(super) struct CheckedFit {
    pub(super) checks: Vec<CheckRow>,
    disagreement: Disagreement,
    /// Part of the response that the fit does not explain, a ratio.
    unexplained: Option<f64>,
    /// Estimate of the machine.
    pub(super) estimate: Estimate,
}

impl CheckedFit {
    /// Checks a `fit` to the `data` of `measured` tables; `is_unscaled` if equations have no scale.
    ///
    /// # Errors
    /// [`AnalysisError::NothingDetermined`] if the data determine no parameter.
    pub(super) fn new(
        fit: &TableFit,
        data: &FrequencyData,
        tables: &[FrequencyResponses],
        measured: &[Tabulated],
        how: &IdentifyResponses,
        is_unscaled: bool,
    ) -> Result<Self, AnalysisError> {
        let unexplained = unexplained_motion(data, &fit.estimate.system()?)?;
        let scope = Scope { fit, data, tables, measured, how, unexplained, is_unscaled };
        let (checks, disagreement) = scope.checks()?;
        let is_biased = fit.method == Some(Method::LeastSquares);
        determined::check(&fit.of_machine, &fit.of_machine.modes()?, &checks, is_biased)?;
        let spare = fit.estimate.degrees_of_freedom();
        let disagreement = disagreement.with_warnings_only(&checks, spare);
        let estimate = disagreement.included_in(fit.of_machine.clone())?;
        Ok(Self { checks, disagreement, unexplained, estimate })
    }

    /// Returns the remarks on the residual that the checks do not already contain, and on standard
    /// errors that include more than noise.
    pub(super) fn remarks(
        &self,
        fit: &TableFit,
        tables: &[FrequencyResponses],
        how: &IdentifyResponses,
    ) -> Result<Vec<String>, AnalysisError> {
        let mut remarks = Vec::new();
        if !self.checks.iter().any(|check| matches!(check.finding, Finding::Misfit(_))) {
            remarks.extend(fit.misfit.map(|misfit| misfit.to_string()));
        }
        let is_residual =
            |check: &CheckRow| check.is_conspicuous() && is_of_residual(&check.finding);
        if self.checks.iter().any(is_residual) && !self.checks.iter().any(CheckRow::is_bad) {
            remarks.extend(resonances::surplus_of_tables(tables, how));
        }
        remarks.extend(fit.correlated_lines());
        remarks.extend(self.disagreement.remarks(&self.checks));
        remarks.extend(determined::modes_alone(&self.estimate, &self.estimate.modes()?));
        Ok(remarks)
    }

    /// Returns the quality of the fit; `rows` is the number of rows of all tables together.
    pub(super) fn row(&self, fit: &TableFit, rows: usize) -> FitRow {
        // Least squares minimises the residual of the force, maximum likelihood the residual of the
        // response.
        let residual_nrmse = self.estimate.residual_nrmse();
        let of_force = || {
            (residual_nrmse.iter().map(|e| e * e).sum::<f64>() / residual_nrmse.len() as f64).sqrt()
        };
        let of_response = self.unexplained.filter(|_| fit.method != Some(Method::LeastSquares));
        FitRow {
            nrmse: of_response.unwrap_or_else(of_force),
            unexplained_motion: self.unexplained,
            misfit_ratio: fit.misfit.map(|misfit| misfit.ratio),
            noise: fit.noise.clone(),
            force_noise: Vec::new(),
            sinusoids: Vec::new(),
            error_scale: self.disagreement.error_scale(),
            condition_number: self.estimate.condition(),
            equations: 2 * rows,
            unknowns: self.estimate.unknowns().independent(),
        }
    }
}

/// A fit with the data that its checks use.
struct Scope<'a> {
    fit: &'a TableFit,
    data: &'a FrequencyData,
    tables: &'a [FrequencyResponses],
    measured: &'a [Tabulated],
    how: &'a IdentifyResponses,
    unexplained: Option<f64>,
    is_unscaled: bool,
}

/// A finding, whether it was made before or after the fit, and the name of its table if there are
/// several.
type Row = (When, Option<String>, Finding);

impl Scope<'_> {
    /// Returns the checks before and after the fit, and the additions to the standard errors if
    /// model and data disagree.
    fn checks(&self) -> Result<(Vec<CheckRow>, Disagreement), AnalysisError> {
        let mut findings = self.before();
        let (fit, rows) = (self.fit, self.data.len());
        let settled = fit.averaged.as_ref().is_none_or(|averaged| averaged.settled);
        for (table, measured) in self.tables.iter().zip(self.measured) {
            for (when, finding) in measured.findings(&fit.estimate, rows, settled)? {
                findings.push((when, self.named(table), finding));
            }
        }
        let is_left =
            |finding: &Finding| finding.verdict() > Verdict::Good && is_of_residual(finding);
        let better = findings
            .iter()
            .any(|(_, _, finding)| is_left(finding))
            .then(|| {
                time_limit::apart(CAUSE_OPERATIONS, || {
                    better_model_of(self.tables, self.how, self.data, &fit.estimate)
                })
            })
            .flatten();
        let remaining = better.as_ref().map(|better| better.remaining);
        let compared = fit.compared(self.data, self.measured)?;
        let Compared { parts, omitted } = compared.without_unlikely_term(remaining);
        let (finding, change) = better.map(|better| (better.finding, better.change)).unzip();
        let unknowns = fit.estimate.unknowns();
        let of_one = unknowns.independent().div_ceil(unknowns.dof().max(1));
        let unrelated = |part| unrelated_response(part, 2 * rows, of_one);
        let mut after = Vec::from_iter(finding);
        after.extend(parts);
        after.extend(self.unexplained.and_then(unrelated));
        after.extend(instability(&fit.of_machine.modes()?));
        if !self.is_unscaled {
            after.extend(negative_mass(&fit.of_machine));
            after.extend(mass_symmetry(&fit.of_machine));
            after.extend(gain_symmetry(&fit.of_machine));
        }
        findings.extend(after.into_iter().map(|finding| (When::After, None, finding)));
        adjust_p_values(findings.iter_mut().map(|(_, _, finding)| finding));
        let row =
            |(when, name, finding): Row| CheckRow::new(when, name, &finding, &Channels::default());
        // With an exponential window, or without a scale, the fitted parameters are not the
        // parameters of the machine. A change of the fitted parameters by another model is then not
        // a change of the machine.
        let is_same =
            !self.is_unscaled && self.tables.iter().all(|table| table.added_decay.is_none());
        let [omitted, explained] =
            [omitted, change.flatten()].map(|square| square.filter(|_| is_same));
        let disagreement = Disagreement::new(omitted, explained);
        Ok((findings.into_iter().map(row).collect(), disagreement))
    }

    /// Returns the findings before the fit.
    fn before(&self) -> Vec<Row> {
        let before = self.fit.before.iter();
        let mut findings: Vec<Row> =
            before.map(|finding| (When::Before, None, finding.clone())).collect();
        for table in self.tables {
            let before = table_findings(table).into_iter();
            findings.extend(before.map(|finding| (When::Before, self.named(table), finding)));
        }
        findings
    }

    /// Returns the name of a table if there are several.
    fn named(&self, table: &FrequencyResponses) -> Option<String> {
        (self.tables.len() > 1).then(|| table.file.clone())
    }
}

/// Returns the findings on the units and the phases of a table.
pub(crate) fn table_findings(table: &FrequencyResponses) -> Vec<Finding> {
    let doubts = table.doubts.iter();
    let doubts = doubts.filter_map(|(column, stated, wanted)| doubt(column, stated, *wanted));
    let functions = table.functions.iter();
    let phases = functions
        .filter_map(|f| constant_phase(&f.response, &f.reference, f.values.iter().copied()));
    doubts.chain(phases).collect()
}

/// Returns whether a finding is about the residual of a fit.
fn is_of_residual(finding: &Finding) -> bool {
    matches!(finding.subject(), Subject::Misfit | Subject::Whiteness)
}
