//! The result of an identification.

use std::fmt;
use std::path::Path;

use mechid_estimate::checks::Subject;
use mechid_estimate::frequency_domain::NoiseModel;
use mechid_estimate::{self as estimate, Estimate, IdentifiedMode, Unknowns, frequency_domain};
use mechid_io::{ParameterCovariance, SystemMatrices};
use mechid_model::{EIGENVALUE_ROUNDING, Parameter};
use mechid_signal::message;
use serde::Serialize;

use super::CONSPICUOUS;
use super::checks::{self, CheckRow, When};
use super::nonlinear::NonlinearSummary;
use super::options::Identify;
use super::prediction::Prediction;
use super::spectra::Fitted;
use super::validation::Validation;
use crate::AnalysisError;
use crate::measurement::{Block, Windowed};
use crate::text::{compact, paragraph, significant, text_table};

/// Level of the confidence intervals, a pure number such as 0.95.
pub const CONFIDENCE: f64 = 0.95;

/// Result of an identification: numbers, checks and remarks.
#[derive(Debug, Serialize)]
pub struct IdentificationSummary {
    /// The record.
    pub file: String,
    /// Domain of the fit: frequency or time.
    pub domain: &'static str,
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
    /// Parameters, one each.
    pub parameters: Vec<ParameterRow>,
    /// Nonlinear terms, if there are any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nonlinear: Option<NonlinearSummary>,
    /// Modes, by rising frequency; with nonlinear terms, of small amplitudes.
    pub modes: Vec<ModeRow>,
    /// Quality of the fit.
    pub fit: FitRow,
    /// Every record, the first included.
    pub records: Vec<RecordRow>,
    /// Checks before and after the fit.
    pub checks: Vec<CheckRow>,
    /// Prediction of a record that was not fitted.
    pub validation: Option<Validation>,
    /// Remarks to read before using the numbers.
    pub remarks: Vec<String>,
    /// M, C and K, as `mechid force --system` and others read them back.
    pub system: SystemMatrices,
    /// Covariance of the parameters, for what is derived from them.
    pub covariance: ParameterCovariance,
    /// The settings, which repeat the analysis.
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

/// The samples used, counted from 1.
#[derive(Debug, Serialize)]
pub struct WindowRow {
    /// First sample, counted from 1.
    pub first_sample: usize,
    /// Last sample, counted from 1.
    pub last_sample: usize,
    /// Number of samples in a period.
    pub period_samples: usize,
    /// Number of periods.
    pub periods: usize,
    /// Sampling rate, in Hz.
    pub sample_rate_hz: f64,
}

/// Spectral lines that were used.
#[derive(Debug, Serialize)]
pub struct LinesUsed {
    /// Number of lines.
    pub count: usize,
    /// Lowest line.
    pub first: usize,
    /// Highest line.
    pub last: usize,
    /// Lowest frequency, in Hz.
    pub first_hz: f64,
    /// Highest frequency, in Hz.
    pub last_hz: f64,
}

/// A value with its standard error and confidence interval.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Uncertain {
    /// Value, in its unit.
    pub value: f64,
    /// Standard error, in the same unit; `None` for a value that is known.
    pub standard_error: Option<f64>,
    /// Confidence interval, in the same unit; `None` for a value that is known.
    pub interval: Option<[f64; 2]>,
}

/// One entry of M, C or K.
#[derive(Debug, Serialize)]
pub struct ParameterRow {
    /// Name.
    pub name: String,
    /// Matrix of the parameter: mass, damping or stiffness.
    pub matrix: String,
    /// Counted from 1.
    pub row: usize,
    /// Counted from 1.
    pub column: usize,
    /// SI unit.
    pub unit: &'static str,
    /// `true` if it was given, not estimated.
    pub known: bool,
    #[serde(flatten)]
    /// Estimate with its uncertainty.
    pub estimate: Uncertain,
}

/// One mode of a system.
#[derive(Debug, Clone, Serialize)]
pub struct ModeRow {
    /// `true` if the mode is underdamped.
    pub oscillates: bool,
    /// `true` for a motion without restoring force: zero lies in the interval of its natural frequency.
    pub is_rigid_body: bool,
    /// Natural frequency, in Hz; of an overdamped pair that of both.
    pub natural_frequency_hz: Uncertain,
    /// Damped frequency, in Hz.
    pub damped_frequency_hz: Uncertain,
    /// Damping ratio, a pure number; of an overdamped pair that of both, above 1.
    pub damping_ratio: Uncertain,
    /// Eigenvalue of a mode that does not oscillate, in 1/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pole: Option<Uncertain>,
    /// Number, from 1, of the other mode of an overdamped pair.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub partner: Option<usize>,
    /// Rate at which the free response of an unstable mode grows, in 1/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub growth_rate: Option<Uncertain>,
}

/// Quality of a fit.
#[derive(Debug, Serialize)]
pub struct FitRow {
    /// RMS of the residual over the RMS of the quantity fitted, a ratio: the force, or with maximum likelihood
    /// the response.
    pub nrmse: f64,
    /// RMS of measured minus modelled response over the RMS of the measured response, a ratio: the part that the
    /// linear model leaves unexplained. `None` where it was not computed.
    pub unexplained_motion: Option<f64>,
    /// Power of the residual over the power that the noise explains, a ratio; `None` where the noise is not
    /// known.
    pub misfit_ratio: Option<f64>,
    /// Noise spectra by which maximum likelihood was weighted where they were estimated: one of each record,
    /// from its periods, or one from the residual.
    pub noise: Vec<NoiseModel>,
    /// Condition number of the column-scaled regressor, a ratio.
    pub condition_number: f64,
    /// Number of real equations per degree of freedom.
    pub equations: usize,
    /// Number of unknowns.
    pub unknowns: usize,
}

impl IdentificationSummary {
    /// Gathers the numbers, checks and remarks of a fit.
    pub(super) fn new(
        records: &[Windowed],
        fitted: &Fitted,
        how: &Identify,
    ) -> Result<Self, AnalysisError> {
        let records: Vec<&Block> = records.iter().map(|r| &r.held).collect();
        let estimate = &fitted.estimate;
        let system = estimate.system()?;
        let unexplained_motion = fitted.unexplained_motion(&system)?;
        let row = |r: &&Block| RecordRow { file: r.file.clone(), window: WindowRow::of(r) };
        let mut summary = Self {
            file: records[0].file.clone(),
            domain: fitted.domain,
            estimator: fitted.estimator,
            window: WindowRow::of(records[0]),
            repeats: fitted.prediction == Prediction::Steady,
            lines: fitted.frequency.as_ref().map(|(lines, _)| LinesUsed::of(lines)),
            confidence: CONFIDENCE,
            parameters: parameters(estimate)?,
            nonlinear: fitted.nonlinear.as_ref().map(NonlinearSummary::of).transpose()?,
            modes: ModeRow::all(&estimate.modes()?, false)?,
            fit: FitRow {
                nrmse: match fitted.is_weighted() {
                    true => unexplained_motion.unwrap_or_else(|| fitted.nrmse()),
                    false => fitted.nrmse(),
                },
                unexplained_motion,
                misfit_ratio: fitted.misfit.map(|misfit| misfit.ratio),
                noise: fitted.noise.clone(),
                condition_number: estimate.condition(),
                equations: fitted.equations,
                unknowns: match &fitted.nonlinear {
                    Some(all) => all.found.parameters().len(),
                    None => estimate.parameters().len(),
                },
            },
            records: records.iter().map(row).collect(),
            checks: checks::rows(fitted, &records)?,
            validation: None,
            remarks: Vec::new(),
            system: SystemMatrices::from(&system),
            covariance: covariance(fitted),
            analysis: how.clone(),
        };
        let looked_at = records.iter().filter_map(|record| {
            let (first, last) = (record.first_sample, record.held_to()?);
            let file = &record.file;
            Some(format!(
                "checks of single samples looked at samples {first} to {last} of {file} only"
            ))
        });
        let of_method = of_least_squares(fitted, &summary.checks);
        let of_units = records.iter().flat_map(|record| record.unit_remarks.iter().cloned());
        let remarks = of_units.chain(fitted.remarks.iter().cloned()).chain(looked_at);
        summary.remarks = remarks.chain(summary.doubts()).chain(of_method).collect();
        Ok(summary)
    }

    /// Returns what in the numbers themselves speaks against them.
    pub fn doubts(&self) -> Vec<String> {
        let mut doubts = Vec::new();
        let mut misfits = self.checks.iter().filter(|check| check.subject == Subject::Misfit);
        // A growth within its standard errors is no warning of the checks.
        let growing = self.checks.iter().filter(|check| check.subject == Subject::Instability);
        doubts.extend(growing.filter(|check| !check.is_conspicuous()).map(CheckRow::sentence));
        // Of a residual that is noise the checks tell.
        let is_noise = misfits.next().is_some_and(|check| !check.is_conspicuous())
            && misfits.all(|check| !check.is_conspicuous());
        let unexplained =
            self.fit.unexplained_motion.filter(|part| *part > CONSPICUOUS && !is_noise);
        if let Some(part) = unexplained {
            let model = if self.nonlinear.is_some() { "model" } else { "linear model" };
            doubts.push(format!(
                "the {model} leaves {:.1} % of the motion unexplained: noise, a nonlinearity, a \
             degree of freedom more, or a record that is not periodic",
                100.0 * part
            ));
        }
        for p in self.parameters.iter().filter(|p| p.row == p.column && p.estimate.value < 0.0) {
            doubts.push(format!("{} is negative: no passive machine has that", p.name));
        }
        doubts
    }

    /// Returns the result as a person reads it.
    fn text(&self) -> String {
        let mut text = self.heading();
        text.push('\n');
        text += &self.parameter_table();
        text.push('\n');
        if let Some(nonlinear) = &self.nonlinear {
            text += &nonlinear.text();
            text.push('\n');
        }
        text += &self.mode_table();
        text.push('\n');
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
        let once = self.modes.iter().enumerate().filter(|(at, mode)| !mode.is_told_before(*at));
        let modes: Vec<String> = once
            .map(|(_, mode)| {
                let (hz, ratio) = (mode.natural_frequency_hz.value, mode.damping_ratio.value);
                match mode.is_rigid_body {
                    true => "rigid-body mode".into(),
                    false => format!("{} Hz, ζ = {}", significant(hz, 4), significant(ratio, 3)),
                }
            })
            .collect();
        format!("{name}: {}", modes.join("; "))
    }

    fn heading(&self) -> String {
        let mut text = String::new();
        for RecordRow { file, window } in &self.records {
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
        let mut rows = vec![header("parameter")];
        rows.extend(self.parameters.iter().map(ParameterRow::cells));
        for p in self.nonlinear.iter().flat_map(|nonlinear| &nonlinear.parameters) {
            let mut row = vec![p.name.clone()];
            row.extend(p.estimate.cells());
            row.push(p.unit.clone());
            rows.push(row);
        }
        text_table(&rows)
    }

    fn mode_table(&self) -> String {
        let small = self.nonlinear.is_some();
        let what = if small { "mode of small amplitude" } else { "mode" };
        mode_table(what, &self.modes)
    }

    fn fit_lines(&self) -> String {
        self.fit.lines(if self.nonlinear.is_some() { "model" } else { "linear model" })
    }
}

/// Returns how many checks passed, and each warning with its sentence.
pub(super) fn verdict(checks: &[CheckRow]) -> String {
    let all = checks.len();
    let warnings: Vec<&CheckRow> = checks.iter().filter(|check| check.is_conspicuous()).collect();
    let mut text = match warnings.len() {
        0 => format!("{all} of {} passed\n", message::count(all, "check")),
        some => format!("{some} of {}: warning\n", message::count(all, "check")),
    };
    for check in warnings {
        text += &format!("  {}: {}\n", check.subject, check.sentence());
    }
    text
}

/// Returns the header of a table of estimates.
pub(crate) fn header(what: &str) -> Vec<String> {
    let interval = format!("{} % interval", compact(100.0 * CONFIDENCE, 3));
    [what, "value", "standard error", &interval, "unit"].map(String::from).to_vec()
}

/// Returns natural frequency and damping ratio of every mode as a table.
pub(super) fn mode_table(what: &str, modes: &[ModeRow]) -> String {
    let mut rows = vec![header(what)];
    rows.extend(mode_cells(modes, false));
    text_table(&rows)
}

/// Returns the rows of a table of modes.
pub(crate) fn mode_cells(modes: &[ModeRow], damped: bool) -> impl Iterator<Item = Vec<String>> {
    ModeRow::quantities(modes, damped).into_iter().map(|(name, value, unit)| {
        let mut row = vec![name];
        row.extend(value.cells());
        row.push(unit.into());
        row
    })
}

impl ParameterRow {
    /// Name, value, standard error, interval and unit.
    pub(super) fn cells(&self) -> Vec<String> {
        let mut row = vec![self.name.clone()];
        row.extend(self.estimate.cells());
        row.push(self.unit.into());
        row
    }
}

impl FitRow {
    /// Returns the quality of the fit as a table; `model` says what explains the motion.
    pub(super) fn lines(&self, model: &str) -> String {
        let percent = |fraction: f64| format!("{} %", significant(100.0 * fraction, 3));
        let mut rows = vec![
            vec!["residual of the fit (NRMSE)".into(), percent(self.nrmse)],
            vec!["condition number".into(), significant(self.condition_number, 3)],
            vec!["equations / unknowns".into(), format!("{} / {}", self.equations, self.unknowns)],
        ];
        if let Some(unexplained) = self.unexplained_motion {
            let name = format!("motion the {model} leaves unexplained");
            rows.insert(1, vec![name, percent(unexplained)]);
        }
        text_table(&rows)
    }
}

impl fmt::Display for IdentificationSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text())
    }
}

impl WindowRow {
    /// The samples of a measurement.
    pub(crate) fn of(measured: &Block) -> Self {
        Self {
            first_sample: measured.first_sample,
            last_sample: measured.last_sample(),
            period_samples: measured.period,
            periods: measured.periods,
            sample_rate_hz: measured.force.sampling().rate_hz(),
        }
    }
}

impl ModeRow {
    /// Returns frequencies and damping of the modes of an identified system, or of one that is exactly
    /// `known`.
    pub(crate) fn all(modes: &[IdentifiedMode], known: bool) -> Result<Vec<Self>, AnalysisError> {
        let largest = modes.iter().map(|found| found.mode.natural_frequency()).fold(0.0, f64::max);
        let rounding = EIGENVALUE_ROUNDING * largest;
        modes.iter().map(|found| Self::of(found, known, rounding)).collect()
    }

    /// Growth rates up to `rounding` (1/s) are those of rounding.
    fn of(found: &IdentifiedMode, known: bool, rounding: f64) -> Result<Self, AnalysisError> {
        let uncertain = |value: &estimate::Uncertain| match known {
            true => Ok(Uncertain::known(value.value)),
            false => Uncertain::of(value),
        };
        let grows = !found.is_rigid_body && found.growth_rate.value > rounding;
        // Real eigenvalues of opposite sign have no natural frequency in common.
        let shared = found.is_rigid_body || found.squared_frequency.value > 0.0;
        let rate = uncertain(&found.growth_rate)?;
        let frequency = &found.natural_frequency_hz;
        Ok(Self {
            oscillates: found.mode.oscillates(),
            is_rigid_body: found.is_rigid_body,
            natural_frequency_hz: match known {
                true => Uncertain::known(frequency.value),
                false => {
                    let interval = found.natural_frequency_interval_hz(CONFIDENCE)?;
                    Uncertain::new(frequency.value, frequency.standard_error, interval)
                }
            },
            damped_frequency_hz: uncertain(&found.damped_frequency_hz)?,
            damping_ratio: uncertain(&found.damping_ratio)?,
            pole: (!found.mode.oscillates()).then_some(rate),
            partner: found.partner.filter(|_| shared).map(|at| at + 1),
            growth_rate: grows.then_some(rate),
        })
    }

    /// Returns whether the mode at an index, from 0, belongs to a pair that an earlier one begins.
    fn is_told_before(&self, at: usize) -> bool {
        self.partner.is_some_and(|number| number <= at)
    }

    /// Returns what there is to tell of modes, with name and unit: natural frequency, damped frequency if
    /// asked for, damping ratio; the poles of those that do not oscillate, of an overdamped pair together.
    pub fn quantities(modes: &[Self], damped: bool) -> Vec<(String, Uncertain, &'static str)> {
        let mut all = Vec::new();
        for (at, mode) in modes.iter().enumerate().filter(|(at, mode)| !mode.is_told_before(*at)) {
            let own = (at + 1, mode.pole);
            let other = mode.partner.map(|number| (number, modes[number - 1].pole));
            let numbers = [Some(own), other].into_iter().flatten();
            for (number, pole) in numbers.clone() {
                all.extend(pole.map(|pole| (format!("{number} real pole"), pole, "1/s")));
            }
            let name: Vec<String> = numbers.map(|(number, _)| number.to_string()).collect();
            let mut add = |what: &str, value: Uncertain, unit| {
                all.push((format!("{} {what}", name.join(", ")), value, unit));
            };
            if mode.is_rigid_body {
                add("rigid-body mode, frequency", mode.natural_frequency_hz, "Hz");
            } else if mode.oscillates || mode.partner.is_some() {
                add("natural frequency", mode.natural_frequency_hz, "Hz");
                // A mode that does not oscillate has no damped frequency to speak of.
                if damped && mode.oscillates {
                    add("damped frequency", mode.damped_frequency_hz, "Hz");
                }
                add("damping ratio", mode.damping_ratio, "–");
            }
        }
        all
    }
}

impl LinesUsed {
    /// The first, the last and the number of the lines used.
    pub(crate) fn of(used: &frequency_domain::Lines) -> Self {
        let (lines, spacing_hz) = (used.as_slice(), used.sampling().line_spacing_hz());
        let first = lines.iter().copied().min().unwrap_or(0);
        let last = lines.iter().copied().max().unwrap_or(0);
        let (first_hz, last_hz) = (first as f64 * spacing_hz, last as f64 * spacing_hz);
        Self { count: lines.len(), first, last, first_hz, last_hz }
    }
}

impl Uncertain {
    /// Returns a value that was estimated.
    pub(crate) fn new(value: f64, standard_error: f64, interval: [f64; 2]) -> Self {
        Self { value, standard_error: Some(standard_error), interval: Some(interval) }
    }

    /// Returns a value derived from the estimate.
    pub(crate) fn of(found: &estimate::Uncertain) -> Result<Self, AnalysisError> {
        Ok(Self::new(found.value, found.standard_error, found.interval(CONFIDENCE)?))
    }

    /// Returns a value that was given.
    pub(crate) fn known(value: f64) -> Self {
        Self { value, standard_error: None, interval: None }
    }

    /// Value, standard error and interval; the error tells how many digits the value deserves.
    pub fn cells(&self) -> [String; 3] {
        let (Some(error), Some([low, high])) = (self.standard_error, self.interval) else {
            return [significant(self.value, 6), "known".into(), String::new()];
        };
        let digits = digits(self.value, error);
        [
            significant(self.value, digits),
            significant(error, 2),
            format!("{} … {}", significant(low, digits), significant(high, digits)),
        ]
    }
}

/// Significant digits of `value` down to the second of its standard error, 3 to 12.
fn digits(value: f64, error: f64) -> usize {
    let ratio = (value.abs() / error).log10();
    if ratio.is_finite() { (ratio.floor() as i32 + 3).clamp(3, 12) as usize } else { 6 }
}

/// Returns the remark on a residual of least squares that is not noise.
pub(crate) fn of_least_squares(fitted: &Fitted, checks: &[CheckRow]) -> Option<String> {
    let warned = |when| checks.iter().any(|row| row.when == when && row.is_conspicuous());
    let explained = checks.iter().any(CheckRow::is_bad);
    (fitted.least_squares && warned(When::After) && !warned(When::Before) && !explained).then(|| {
        "least squares takes the measured motion as exact, and noise on it biases the parameters; \
         that alone can be what the warnings after the fit tell of. With --method \
         maximum-likelihood, which allows for noise, they speak of the machine"
            .into()
    })
}

pub(super) fn parameters(estimate: &Estimate) -> Result<Vec<ParameterRow>, AnalysisError> {
    let mut rows = Vec::new();
    let found = |parameter: Parameter| {
        let at = estimate.parameters().position(|p| p.parameter == parameter);
        at.and_then(|at| estimate.parameters().nth(at))
    };
    for parameter in Unknowns::unknown_mass(estimate.dof())?.free() {
        let (matrix, row, column) = (parameter.matrix(), parameter.row(), parameter.column());
        let value = match found(parameter) {
            Some(p) => Uncertain::new(p.value, p.standard_error, p.interval(CONFIDENCE)?),
            None => {
                Uncertain::known(estimate.unknowns().fixed(matrix, row, column).unwrap_or_default())
            }
        };
        rows.push(ParameterRow {
            name: parameter.to_string(),
            matrix: matrix.to_string(),
            row: row + 1,
            column: column + 1,
            unit: matrix.unit(),
            known: value.standard_error.is_none(),
            estimate: value,
        });
    }
    Ok(rows)
}

fn covariance(fitted: &Fitted) -> ParameterCovariance {
    let estimate = &fitted.estimate;
    if let Some(all) = &fitted.nonlinear {
        let names = all.found.parameters().iter().map(|p| p.name.clone()).collect();
        let freedom = estimate.degrees_of_freedom();
        return ParameterCovariance::new(names, all.found.covariance(), freedom);
    }
    let names = estimate.parameters().map(|p| p.parameter.to_string()).collect();
    ParameterCovariance::new(names, estimate.covariance(), estimate.degrees_of_freedom())
}
