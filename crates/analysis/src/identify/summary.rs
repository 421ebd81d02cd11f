//! The result of an identification.

use std::fmt;
use std::path::Path;

use mechid_checks::{Finding, Subject};
use mechid_estimate::IdentifiedMode;
use mechid_io::{ParameterCovariance, SystemMatrices};
use mechid_model::ResponseQuantity;
use mechid_signal::message;
use mechid_spectra::NoiseModel;
use serde::Serialize;

use super::CONSPICUOUS;
use super::checks::{self, CheckRow, When};
use super::determined;
use super::fitted::Fitted;
use super::fitted_lines::FittedLine;
use super::force_noise::ForceNoise;
use super::keywords::Domain;
use super::nonlinear::{ExtrapolationRow, NonlinearSummary};
use super::options::{Identify, Source};
use super::prediction::Prediction;
use super::rows::{
    self, CONFIDENCE, LinesUsed, ParameterRow, ProportionalDamping, WindowRow, mode_table,
    parameter_table, parameters,
};
use super::sinusoids::SinusoidRow;
use super::unscaled::Unscaled;
use super::validation::Validation;
use crate::AnalysisError;
use crate::hits::{HitRow, heading};
use crate::measurement::{Block, Channels, Windowed};
use crate::modal::{ShapedMode, shape_table};
use crate::text::{compact, paragraph, significant, text_table};

/// Result of an identification: numbers, checks and remarks.
#[derive(Debug, Serialize)]
pub struct IdentificationSummary {
    /// The record.
    pub file: String,
    /// Domain of the fit: frequency or time.
    pub domain: Domain,
    /// Name of the estimator.
    pub estimator: &'static str,
    /// Samples used.
    pub window: WindowRow,
    /// `true` if the windows are whole periods.
    #[serde(skip)]
    pub repeats: bool,
    /// Lines used; none in the time domain.
    pub lines: Option<LinesUsed>,
    /// Level of the confidence intervals, a pure number such as 0.95.
    pub confidence: f64,
    /// Parameters, one row each, except those of [`unscaled`](Self::unscaled) equations.
    pub parameters: Vec<ParameterRow>,
    /// Equations of motion without scale, whose parameters do not follow from the data.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unscaled: Option<Unscaled>,
    /// Factors of proportional damping, if `structure` requires it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub proportional_damping: Option<ProportionalDamping>,
    /// Nonlinear terms, if there are any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nonlinear: Option<NonlinearSummary>,
    /// Modes, by rising frequency; with nonlinear terms, of the linear part.
    pub modes: Vec<ShapedMode>,
    /// Quality of the fit.
    pub fit: FitRow,
    /// Names of the channels, without units, one per degree of freedom; `"0"` for a missing
    /// channel.
    pub channels: Channels,
    /// All fitted records, including the first; for a hammer test, all hits that were used.
    pub records: Vec<RecordRow>,
    /// Every hit of a hammer test, used or left out.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub hits: Vec<HitRow>,
    /// Checks before and after the fit.
    pub checks: Vec<CheckRow>,
    /// Every line of the fit; `None` if not requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fitted_lines: Option<Vec<FittedLine>>,
    /// Prediction of a record that was not fitted.
    pub validation: Option<Validation>,
    /// Remarks to read before using the numbers.
    pub remarks: Vec<String>,
    /// M, C and K, as `mechid force --system` and other commands read them; `None` if equations
    /// have no scale.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub system: Option<SystemMatrices>,
    /// Covariance of the estimated parameters, for quantities that follow from them; `None` for
    /// more than 2,000 parameters, for which
    /// [`Identified::covariance`](super::Identified::covariance) returns it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub covariance: Option<ParameterCovariance>,
    /// Settings of the analysis; with them it can be repeated.
    pub analysis: Identify,
}

/// One of the records fitted.
#[derive(Debug, Serialize)]
pub struct RecordRow {
    /// The record.
    pub file: String,
    #[serde(flatten)]
    /// Samples used.
    pub window: WindowRow,
}

/// Quality of a fit.
#[derive(Debug, Serialize)]
pub struct FitRow {
    /// Ratio of the RMS of the residual to the RMS of the fitted quantity: the force or, with
    /// maximum likelihood, the response. For the response this ratio is `unexplained_motion`.
    pub nrmse: f64,
    /// Ratio of the RMS of measured minus modelled response to the RMS of the measured response:
    /// the part that the linear model does not explain. `None` if it was not computed.
    pub unexplained_motion: Option<f64>,
    /// Ratio of the residual power to the noise power; `None` if the noise is not known.
    pub misfit_ratio: Option<f64>,
    /// Estimated noise spectra that weighted maximum likelihood: one of each record from its
    /// periods, or one from the residual.
    pub noise: Vec<NoiseModel>,
    /// Noise of the forces of each record if the spectra in `noise` are those of the response only,
    /// as for open records.
    pub force_noise: Vec<ForceNoise>,
    /// Sinusoids in the responses of open records that the forces do not cause; they were
    /// subtracted.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sinusoids: Vec<SinusoidRow>,
    /// Factor that multiplies the standard errors computed from the noise: above 1 if parts of the
    /// data disagree or the residual exceeds the noise.
    pub error_scale: f64,
    /// Condition number of the column-scaled regressor, a ratio.
    pub condition_number: f64,
    /// Number of real equations per degree of freedom.
    pub equations: usize,
    /// Number of unknowns.
    pub unknowns: usize,
}

impl IdentificationSummary {
    /// Creates the summary of a fit.
    pub(super) fn new(
        records: &[Windowed],
        fitted: &mut Fitted,
        unscaled: Option<Unscaled>,
        hits: Vec<HitRow>,
        how: &Identify,
    ) -> Result<Self, AnalysisError> {
        let records: Vec<&Block> = records.iter().map(|r| &r.held).collect();
        let system = fitted.estimate.system()?;
        let unexplained_motion = fitted.unexplained_motion(&system)?;
        let row = |r: &&Block| RecordRow { file: r.file.clone(), window: WindowRow::from_block(r) };
        let scope = checks::Scope {
            scaled: unscaled.is_none(),
            hits: matches!(how.source, Source::Hits(_)),
            unexplained: unexplained_motion,
        };
        let modes = fitted.estimate.modes()?;
        let checks = checks::rows(fitted, &modes, &records, scope)?;
        match &fitted.nonlinear {
            Some(fit) => determined::check_nonlinear(&fit.estimate)?,
            None => {
                let is_biased = fitted.least_squares || how.is_least_squares();
                determined::check(&fitted.estimate, &modes, &checks, is_biased)?;
            }
        }
        fitted.count_disagreement(&checks)?;
        let (fitted, estimate) = (&*fitted, &fitted.estimate);
        let (modes, carried) = (estimate.modes()?, rows::carries_covariance(estimate));
        let mut summary = Self {
            file: hits.first().map_or(&records[0].file, |hit| &hit.record).clone(),
            domain: fitted.domain,
            estimator: fitted.estimator,
            window: WindowRow::from_block(records[0]),
            repeats: fitted.prediction == Prediction::Steady,
            lines: fitted.frequency.as_ref().map(|(lines, _)| LinesUsed::from_lines(lines)),
            confidence: CONFIDENCE,
            parameters: parameters(estimate, unscaled.as_ref())?,
            proportional_damping: ProportionalDamping::from_estimate(estimate)?,
            nonlinear: fitted.nonlinear.as_ref().map(NonlinearSummary::from_fit).transpose()?,
            modes: ShapedMode::all(&modes, false)?,
            fit: FitRow::from_fit(fitted, unexplained_motion),
            channels: Channels::together(&records.iter().map(|r| &*r.names).collect::<Vec<_>>()),
            records: records.iter().map(row).collect(),
            hits,
            checks,
            fitted_lines: None,
            validation: None,
            remarks: Vec::new(),
            system: unscaled.is_none().then(|| SystemMatrices::from(&system)),
            covariance: carried.then(|| covariance(fitted, unscaled.as_ref())),
            unscaled,
            analysis: how.clone(),
        };
        summary.remarks = summary.all_remarks(fitted, &modes, &records);
        Ok(summary)
    }

    /// Returns the remarks on the fit, on its records and on its standard errors.
    fn all_remarks(
        &self,
        fitted: &Fitted,
        modes: &[IdentifiedMode],
        records: &[&Block],
    ) -> Vec<String> {
        let looked_at = records.iter().filter_map(|record| {
            let (first, last) = (record.first_sample, record.held_to()?);
            let file = &record.file;
            Some(format!(
                "{file}: the checks that look at single samples cover only samples {first} to {last}"
            ))
        });
        let of_units = records.iter().flat_map(|record| record.unit_remarks.iter().cloned());
        let of_scale = self.unscaled.as_ref().map(Unscaled::to_string);
        of_scale
            .into_iter()
            .chain(of_units)
            .chain(fitted.remarks.iter().cloned())
            .chain(looked_at)
            .chain(fitted.few_equations())
            .chain(fitted.disagreement.remarks(&self.checks))
            .chain(fitted.modes_alone(modes))
            .chain(self.doubts())
            .chain(least_squares_remark(fitted, &self.checks))
            .chain(rows::omitted_covariance_remark(&fitted.estimate))
            .collect()
    }

    /// Returns warnings that follow from the identified parameters and the residual.
    pub fn doubts(&self) -> Vec<String> {
        let mut doubts = Vec::new();
        let is_misfit = |check: &&CheckRow| matches!(check.finding, Finding::Misfit(_));
        let mut misfits = self.checks.iter().filter(is_misfit);
        // The checks do not warn of a growth that is within its standard errors.
        let growing = self.checks.iter().filter(|check| check.subject == Subject::Instability);
        doubts.extend(growing.filter(|check| !check.is_conspicuous()).map(CheckRow::sentence));
        // If the checks compare the residual with the noise and do not warn, the residual is noise.
        let is_noise = misfits.next().is_some_and(|check| !check.is_conspicuous())
            && misfits.all(|check| !check.is_conspicuous());
        let unexplained =
            self.fit.unexplained_motion.filter(|part| *part > CONSPICUOUS && !is_noise);
        if let Some(part) = unexplained {
            let model = if self.nonlinear.is_some() { "model" } else { "linear model" };
            doubts.push(format!(
                "{:.1} % of the motion is not explained by the {model}: noise, a nonlinearity, a \
                 missing degree of freedom, or a record that is not periodic",
                100.0 * part
            ));
        }
        // The checks already report a negative mass.
        let is_told = self.checks.iter().any(|check| check.subject == Subject::Mass);
        let negative = |p: &&ParameterRow| p.row == p.column && p.estimate.value < 0.0;
        for p in self.parameters.iter().filter(negative).filter(|p| !is_told || p.matrix != "mass")
        {
            doubts.push(format!(
                "{} is negative, which is not possible for a passive machine",
                p.name
            ));
        }
        let extrapolated = self.nonlinear.iter().flat_map(|nonlinear| &nonlinear.extrapolation);
        doubts.extend(extrapolated.filter_map(ExtrapolationRow::doubt));
        doubts
    }

    /// Returns the result as text for a reader.
    fn text(&self) -> String {
        let mut text = self.heading();
        text.push('\n');
        if !self.parameters.is_empty() {
            text += &self.parameter_table();
            text.push('\n');
        }
        if let Some(nonlinear) = &self.nonlinear {
            text += &nonlinear.text();
            text.push('\n');
        }
        text += &self.mode_table();
        text.push('\n');
        if self.unscaled.is_some() {
            // A result without scale contains no system, so the shapes cannot be computed later.
            let measured = self.channels.first_response();
            let kind = measured.unwrap_or(ResponseQuantity::Displacement);
            text += &shape_table(&self.modes, |at| self.channels.response_name(kind, at));
            text.push('\n');
        }
        text += &self.fit_lines();
        if let Some(validation) = &self.validation {
            text += &format!("\n{}", validation.text());
        }
        text.push('\n');
        text += &verdict(&self.checks);
        text + &paragraph(self.remarks.iter().map(|remark| format!("note: {remark}")))
    }

    /// Returns every check with its verdict, in the order in which they were made.
    pub fn all_checks(&self) -> String {
        let rows = self.checks.iter();
        rows.map(|c| format!("{}, {}: {}\n", c.verdict, c.subject, c.sentence())).collect()
    }

    /// Returns the title of a figure: the record and its modes.
    pub fn title(&self) -> String {
        let name = Path::new(&self.file).file_name().unwrap_or_default().to_string_lossy();
        let rows = self.modes.iter().map(|mode| &mode.row).enumerate();
        let once = rows.filter(|(at, mode)| !mode.is_reported_before(*at));
        let modes: Vec<String> = once
            .map(|(_, mode)| {
                let (hz, ratio) = (mode.natural_frequency_hz.value, mode.damping_ratio.value);
                if mode.is_rigid_body {
                    "rigid-body mode".into()
                } else {
                    format!("{} Hz, ζ = {} %", significant(hz, 4), significant(100.0 * ratio, 3))
                }
            })
            .collect();
        format!("{name}: {}", modes.join("; "))
    }

    fn heading(&self) -> String {
        let rate_hz = compact(self.window.sample_rate_hz, 8);
        let mut text = heading(&self.hits, &rate_hz);
        let records = self.records.iter().filter(|_| self.hits.is_empty());
        for RecordRow { file, window } in records {
            let rate = compact(window.sample_rate_hz, 8);
            let periods = match (self.repeats, window.periods) {
                (false, _) => String::new(),
                (_, n) => format!(", {} of {}", message::count(n, "period"), window.period_samples),
            };
            let (first, last) = (window.first_sample, window.last_sample);
            text += &format!("{file}: samples {first} to {last}{periods}, {rate} Hz\n");
        }
        text += self.estimator;
        if let Some(l) = &self.lines {
            let [low, high] = [l.first_hz, l.last_hz].map(|hz| compact(hz, 5));
            text += &match l.count {
                1 => format!("; 1 line, {} ({low} Hz)", l.first),
                n => format!("; {n} lines, {} to {} ({low} to {high} Hz)", l.first, l.last),
            };
        }
        if let Some(nonlinear) = &self.nonlinear {
            text += &format!("\nnonlinear terms: {}", nonlinear.terms);
        }
        text + "\n"
    }

    fn parameter_table(&self) -> String {
        let factors = self.proportional_damping.iter().flat_map(ProportionalDamping::rows);
        let terms = self.nonlinear.iter().flat_map(|nonlinear| &nonlinear.parameters).map(|p| {
            let mut row = vec![p.name.clone()];
            row.extend(p.estimate.cells());
            row.push(p.unit.clone());
            row
        });
        parameter_table(&self.parameters, factors.chain(terms))
    }

    fn mode_table(&self) -> String {
        let what = if self.nonlinear.is_some() { "mode of the linear part" } else { "mode" };
        mode_table(what, &ShapedMode::rows(&self.modes))
    }

    fn fit_lines(&self) -> String {
        self.fit.lines(if self.nonlinear.is_some() { "model" } else { "linear model" })
    }
}

/// Returns the number of checks that passed or warn, and the text of each warning.
pub(crate) fn verdict(checks: &[CheckRow]) -> String {
    let total = checks.len();
    let warnings: Vec<&CheckRow> = checks.iter().filter(|check| check.is_conspicuous()).collect();
    let mut text = match warnings.len() {
        0 => format!("{total} of {} passed\n", message::count(total, "check")),
        some => format!("{some} of {}: warning\n", message::count(total, "check")),
    };
    for (at, check) in warnings.iter().enumerate() {
        let is_alike = |other: &&&CheckRow| check.has_same_kind_in_other_record(other);
        if warnings[..at].iter().any(|other| is_alike(&other)) {
            continue;
        }
        let more = match warnings[at + 1..].iter().filter(is_alike).count() {
            0 => String::new(),
            more => format!(" (likewise in {} more)", message::count(more, "record")),
        };
        text += &format!("  {}: {}{more}\n", check.subject, check.sentence());
    }
    text
}

impl FitRow {
    fn from_fit(fitted: &Fitted, unexplained_motion: Option<f64>) -> Self {
        let of_response = unexplained_motion.filter(|_| fitted.fits_response());
        Self {
            nrmse: of_response.unwrap_or_else(|| fitted.nrmse()),
            unexplained_motion,
            misfit_ratio: fitted.misfit.map(|misfit| misfit.ratio),
            noise: fitted.noise.clone(),
            force_noise: fitted.force_noise.clone(),
            sinusoids: fitted.sinusoids.clone(),
            error_scale: fitted.disagreement.error_scale(),
            condition_number: fitted.estimate.condition(),
            equations: fitted.equations,
            unknowns: match &fitted.nonlinear {
                Some(all) => all.estimate.parameters().len(),
                None => fitted.estimate.unknowns().independent(),
            },
        }
    }

    /// Returns the quality of the fit as a table; the text of the table calls the model `model`.
    pub(super) fn lines(&self, model: &str) -> String {
        text_table(&self.rows(model))
    }

    /// Returns the quality of the fit as rows of a name and a value; `model` is the name of the
    /// model in the rows.
    pub fn rows(&self, model: &str) -> Vec<Vec<String>> {
        let percent = |fraction: f64| format!("{} %", significant(100.0 * fraction, 3));
        let mut rows = Vec::new();
        rows.extend(self.residual_name().map(|name| vec![name.into(), percent(self.nrmse)]));
        if let Some(unexplained) = self.unexplained_motion {
            let name = format!("motion not explained by the {model}");
            rows.push(vec![name, percent(unexplained)]);
        }
        rows.extend([
            vec!["condition number".into(), significant(self.condition_number, 3)],
            vec!["equations / unknowns".into(), format!("{} / {}", self.equations, self.unknowns)],
        ]);
        rows
    }

    /// Returns the name of the residual [`nrmse`](Self::nrmse); `None` if it is the unexplained
    /// part of the response.
    pub fn residual_name(&self) -> Option<&'static str> {
        match self.unexplained_motion {
            None => Some("residual of the fit (NRMSE)"),
            Some(unexplained) if unexplained == self.nrmse => None,
            Some(_) => Some("residual of the force (NRMSE)"),
        }
    }
}

impl fmt::Display for IdentificationSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text())
    }
}

/// Returns the remark on a residual of least squares that exceeds noise.
pub(crate) fn least_squares_remark(fitted: &Fitted, checks: &[CheckRow]) -> Option<String> {
    let warned = |when| checks.iter().any(|row| row.when == when && row.is_conspicuous());
    let explained = checks.iter().any(CheckRow::is_bad);
    (fitted.least_squares && warned(When::After) && !warned(When::Before) && !explained).then(|| {
        "least squares treats the measured response as exact, and noise on it biases the parameters; this bias \
         alone may explain the warnings after the fit. Repeat with `method` maximum-likelihood: warnings that \
         remain concern the model"
            .into()
    })
}

/// Returns the covariance of the parameters, including those of nonlinear terms.
pub(super) fn covariance(fitted: &Fitted, unscaled: Option<&Unscaled>) -> ParameterCovariance {
    let estimate = &fitted.estimate;
    if let Some(all) = &fitted.nonlinear {
        let names = all.estimate.parameters().iter().map(|p| p.name.clone()).collect();
        let freedom = estimate.degrees_of_freedom();
        return ParameterCovariance::new(names, all.estimate.covariance(), freedom);
    }
    rows::covariance(estimate, unscaled)
}
