//! What was looked at before and after the fit, for people and for programs.

use mechid_estimate::checks::{Check, Verdict, after_fit, kinematics, power, range, still};
use mechid_model::ResponseQuantity;
use serde::Serialize;

use super::spectra::{Fitted, Residual};
use crate::AnalysisError;
use crate::measurement::Block;

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
    /// Subject of the check.
    pub subject: String,
    /// Good, doubtful or bad.
    pub verdict: String,
    /// The number behind the verdict; nothing where it is infinite.
    pub value: Option<f64>,
    /// The finding, in a sentence.
    pub text: String,
}

/// Everything looked at.
pub fn rows(fitted: &Fitted, records: &[&Block]) -> Result<Vec<CheckRow>, AnalysisError> {
    let mut rows = Vec::new();
    let mut add = |when, at: usize, checks: &[Check]| {
        let name = (records.len() > 1).then(|| records[at].file.clone());
        rows.extend(checks.iter().map(|check| CheckRow::new(when, name.clone(), check)));
    };
    for (at, (record, checks)) in records.iter().zip(&fitted.before).enumerate() {
        add("before", at, checks);
        add("before", at, &of_channels(record)?);
    }
    for (at, checks) in fitted.after.iter().enumerate() {
        add("after", at, checks);
    }
    for (at, residual) in fitted.residuals.iter().enumerate() {
        add("after", at, &of_residual(residual)?);
    }
    Ok(rows)
}

/// What is wrong with the channels themselves, whatever is fitted to them.
pub fn of_channels(measured: &Block) -> Result<Vec<Check>, AnalysisError> {
    let mut checks = range("force", &measured.force);
    for (kind, motion) in measured.responses() {
        checks.extend(range(&kind.to_string(), motion));
        checks.extend(still(&kind.to_string(), motion));
    }
    checks.extend(kinematics(&measured.responses())?);
    // A velocity tells the power without its neighbours in time.
    let (motion, kind) = match &measured.velocity {
        Some(velocity) => (velocity, ResponseQuantity::Velocity),
        None => measured.response(),
    };
    checks.extend(power(&measured.force, motion, kind)?);
    Ok(checks)
}

/// Nothing if there are too few samples to tell.
fn of_residual(residual: &Residual) -> Result<Vec<Check>, AnalysisError> {
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

    /// Whether it says what is wrong.
    pub fn is_bad(&self) -> bool {
        self.verdict == Verdict::Bad.to_string()
    }

    /// The sentence, with the record it is about.
    pub fn sentence(&self) -> String {
        match &self.record {
            Some(record) => format!("{record}: {}", self.text),
            None => self.text.clone(),
        }
    }
}
