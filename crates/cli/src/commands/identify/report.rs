//! What an identification found, for people and for programs.

use std::path::Path;

use mechid::estimate::{self, IdentifiedMode, frequency_domain};
use mechid::io::{ParameterCovariance, SystemMatrices};
use mechid::signal::counted;
use serde::Serialize;

use super::checks::CheckRow;
use super::measurement::Measurement;
use super::validation::Validation;
use crate::error::CliError;
use crate::text_table::{compact, paragraph, significant, text_table};

/// Level of the confidence intervals.
pub const CONFIDENCE: f64 = 0.95;

/// Everything `mechid identify` has to say.
#[derive(Debug, Serialize)]
pub struct Report {
    pub file: String,
    pub domain: &'static str,
    pub estimator: &'static str,
    pub window: Window,
    /// Whether the windows are whole periods.
    #[serde(skip)]
    pub repeats: bool,
    /// Lines used; none in the time domain.
    pub lines: Option<Lines>,
    pub confidence: f64,
    pub parameters: Vec<ParameterRow>,
    pub modes: Vec<ModeRow>,
    pub fit: Fit,
    /// Every record, the first included.
    pub records: Vec<RecordRow>,
    /// What was looked at before and after the fit.
    pub checks: Vec<CheckRow>,
    /// How much of a record that was not fitted is predicted.
    pub validation: Option<Validation>,
    /// What the user should know before believing the numbers.
    pub remarks: Vec<String>,
    /// M, C and K, as `mechid force --system` and others read them back.
    pub system: SystemMatrices,
    /// Of the parameters found, for what is derived from them (`mechid modal`).
    pub covariance: ParameterCovariance,
}

/// One of the records fitted.
#[derive(Debug, Serialize)]
pub struct RecordRow {
    pub file: String,
    #[serde(flatten)]
    pub window: Window,
}

/// The samples used, counted from 1.
#[derive(Debug, Serialize)]
pub struct Window {
    pub first_sample: usize,
    pub last_sample: usize,
    pub period_samples: usize,
    pub periods: usize,
    pub sample_rate_hz: f64,
}

#[derive(Debug, Serialize)]
pub struct Lines {
    pub count: usize,
    pub first: usize,
    pub last: usize,
    pub first_hz: f64,
    pub last_hz: f64,
}

/// A value with its standard error and confidence interval.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Uncertain {
    pub value: f64,
    /// Nothing for a value that is known.
    pub standard_error: Option<f64>,
    pub interval: Option<[f64; 2]>,
}

#[derive(Debug, Serialize)]
pub struct ParameterRow {
    pub name: String,
    pub matrix: String,
    /// Counted from 1.
    pub row: usize,
    /// Counted from 1.
    pub column: usize,
    pub unit: &'static str,
    pub known: bool,
    #[serde(flatten)]
    pub estimate: Uncertain,
}

#[derive(Debug, Serialize)]
pub struct ModeRow {
    pub oscillates: bool,
    pub natural_frequency_hz: Uncertain,
    pub damped_frequency_hz: Uncertain,
    pub damping_ratio: Uncertain,
}

/// How well the model explains the record.
#[derive(Debug, Serialize)]
pub struct Fit {
    /// RMS of the residual over RMS of what was fitted: the force, or with maximum likelihood the
    /// motion.
    pub nrmse: f64,
    /// RMS of measured minus modelled motion over RMS of the measured motion: what the linear model
    /// leaves unexplained. Nothing where it was not computed.
    pub unexplained_motion: Option<f64>,
    /// Power of the residual over what the noise explains; nothing where the noise is not known.
    pub misfit_ratio: Option<f64>,
    /// Condition number of the column-scaled regressor.
    pub condition_number: f64,
    pub equations: usize,
    pub unknowns: usize,
}

impl Report {
    /// The report as a person reads it.
    pub fn text(&self) -> String {
        let mut text = self.heading();
        text.push('\n');
        text += &self.parameter_table();
        text.push('\n');
        text += &self.mode_table();
        text.push('\n');
        text += &self.fit_lines();
        if let Some(validation) = &self.validation {
            text += &format!("\n{}", validation.text());
        }
        text.push('\n');
        for check in self.checks.iter().filter(|check| !check.is_conspicuous()) {
            text += &format!("{}: {}\n", check.subject, check.sentence());
        }
        let conspicuous = self.checks.iter().filter(|check| check.is_conspicuous());
        text +=
            &paragraph(conspicuous.map(|c| format!("warning, {}: {}", c.subject, c.sentence())));
        text + &paragraph(self.remarks.iter().map(|remark| format!("note: {remark}")))
    }

    /// What a picture of it is called: the record and its modes.
    pub fn title(&self) -> String {
        let name = Path::new(&self.file).file_name().unwrap_or_default().to_string_lossy();
        let modes: Vec<String> = self
            .modes
            .iter()
            .map(|mode| {
                let (hz, ratio) = (mode.natural_frequency_hz.value, mode.damping_ratio.value);
                format!("{} Hz, ζ = {}", significant(hz, 4), significant(ratio, 3))
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
                (_, n) => format!(", {} of {}", counted(n, "period"), window.period_samples),
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
        text + "\n"
    }

    fn parameter_table(&self) -> String {
        let mut rows = vec![self.header("parameter")];
        for p in &self.parameters {
            let mut row = vec![p.name.clone()];
            row.extend(p.estimate.cells());
            row.push(p.unit.into());
            rows.push(row);
        }
        text_table(&rows)
    }

    fn mode_table(&self) -> String {
        let mut rows = vec![self.header("mode")];
        for (number, mode) in (1..).zip(&self.modes) {
            let mut add = |name: String, value: &Uncertain, unit: &str| {
                let mut row = vec![name];
                row.extend(value.cells());
                row.push(unit.into());
                rows.push(row);
            };
            add(format!("{number} natural frequency"), &mode.natural_frequency_hz, "Hz");
            add(format!("{number} damping ratio"), &mode.damping_ratio, "–");
        }
        text_table(&rows)
    }

    fn header(&self, what: &str) -> Vec<String> {
        let interval = format!("{} % interval", compact(100.0 * self.confidence, 3));
        [what, "value", "standard error", &interval, "unit"].map(String::from).to_vec()
    }

    fn fit_lines(&self) -> String {
        let fit = &self.fit;
        let percent = |fraction: f64| format!("{} %", significant(100.0 * fraction, 3));
        let mut rows = vec![
            vec!["residual of the fit (NRMSE)".into(), percent(fit.nrmse)],
            vec!["condition number".into(), significant(fit.condition_number, 3)],
            vec!["equations / unknowns".into(), format!("{} / {}", fit.equations, fit.unknowns)],
        ];
        if let Some(unexplained) = fit.unexplained_motion {
            rows.insert(
                1,
                vec!["motion the linear model leaves unexplained".into(), percent(unexplained)],
            );
        }
        text_table(&rows)
    }
}

impl Window {
    /// The samples of a measurement.
    pub fn of(measured: &Measurement) -> Self {
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
    /// Frequencies and damping of an identified mode.
    pub fn of(found: &IdentifiedMode) -> Result<Self, CliError> {
        Ok(Self {
            oscillates: found.mode.oscillates(),
            natural_frequency_hz: Uncertain::of(&found.natural_frequency_hz)?,
            damped_frequency_hz: Uncertain::of(&found.damped_frequency_hz)?,
            damping_ratio: Uncertain::of(&found.damping_ratio)?,
        })
    }
}

impl Lines {
    /// The first, the last and the number of the lines used.
    pub fn of(used: &frequency_domain::Lines) -> Self {
        let (lines, spacing_hz) = (used.as_slice(), used.sampling().line_spacing_hz());
        let first = lines.iter().copied().min().unwrap_or(0);
        let last = lines.iter().copied().max().unwrap_or(0);
        let (first_hz, last_hz) = (first as f64 * spacing_hz, last as f64 * spacing_hz);
        Self { count: lines.len(), first, last, first_hz, last_hz }
    }
}

impl Uncertain {
    /// A value that was estimated.
    pub fn new(value: f64, standard_error: f64, interval: [f64; 2]) -> Self {
        Self { value, standard_error: Some(standard_error), interval: Some(interval) }
    }

    /// A value derived from what was estimated.
    pub fn of(found: &estimate::Uncertain) -> Result<Self, CliError> {
        Ok(Self::new(found.value, found.standard_error, found.interval(CONFIDENCE)?))
    }

    /// A value that was given.
    pub fn known(value: f64) -> Self {
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
