//! What was looked at before and after the fit, for people and for programs.

use mechid::estimate::checks::{Check, Verdict, after_fit};
use serde::Serialize;

use super::fit::{Fitted, Residual};
use crate::error::CliError;

/// Lags up to which a residual is correlated.
pub const LAGS: usize = 25;

/// Samples that a lag takes at least.
pub const SAMPLES_PER_LAG: usize = 4;

/// One thing looked at.
#[derive(Debug, Serialize)]
pub struct CheckRow {
    /// Before or after the fit.
    pub when: &'static str,
    /// Which record, where there are several.
    pub record: Option<String>,
    pub subject: String,
    /// Good, doubtful or bad.
    pub verdict: String,
    /// The number behind the verdict; nothing where it is infinite.
    pub value: Option<f64>,
    pub text: String,
}

/// Everything looked at; `files` are the names of the records.
pub fn rows(fitted: &Fitted, files: &[&str]) -> Result<Vec<CheckRow>, CliError> {
    let mut rows = Vec::new();
    let mut add = |when, at: usize, checks: &[Check]| {
        let name = (files.len() > 1).then(|| files[at].to_owned());
        rows.extend(checks.iter().map(|check| CheckRow::new(when, name.clone(), check)));
    };
    for (at, checks) in fitted.before.iter().enumerate() {
        add("before", at, checks);
    }
    for (at, checks) in fitted.after.iter().enumerate() {
        add("after", at, checks);
    }
    for (at, residual) in fitted.residuals.iter().enumerate() {
        add("after", at, &of_residual(residual)?);
    }
    Ok(rows)
}

/// Nothing if there are too few samples to tell.
fn of_residual(residual: &Residual) -> Result<Vec<Check>, CliError> {
    let Residual { left, fitted, force, noise_span } = residual;
    match LAGS.min(left.len().saturating_sub(*noise_span) / SAMPLES_PER_LAG) {
        0 => Ok(Vec::new()),
        lags => Ok(after_fit(left, fitted, force, lags, *noise_span)?),
    }
}

impl CheckRow {
    fn new(when: &'static str, record: Option<String>, check: &Check) -> Self {
        Self {
            when,
            record,
            subject: check.subject.to_string(),
            verdict: check.verdict.to_string(),
            value: check.value.is_finite().then_some(check.value),
            text: check.text.clone(),
        }
    }

    /// Whether the user must be warned.
    pub fn is_conspicuous(&self) -> bool {
        self.verdict != Verdict::Good.to_string()
    }

    /// The sentence, with the record it is about.
    pub fn sentence(&self) -> String {
        match &self.record {
            Some(record) => format!("{record}: {}", self.text),
            None => self.text.clone(),
        }
    }
}
