//! The result of a sweep.

use std::fmt;
use std::sync::Arc;

use mechid_estimate::{Estimate, SweepPoint};
use mechid_model::SecondOrderSystem;
use mechid_signal::message;
use serde::Serialize;

use super::SweepSettings;
use super::settings::Kind;
use crate::AnalysisError;
use crate::identify::rows::{CONFIDENCE, Uncertain};
use crate::text::{compact, paged_table, paragraph, significant, text_table};

/// Result of a sweep: estimates and errors at every setting.
#[derive(Debug, Serialize)]
pub struct SweepSummary {
    /// The experiment or record.
    pub file: String,
    /// Name of the estimator.
    pub estimator: &'static str,
    /// Quantity that is swept.
    pub setting: Kind,
    /// Number of samples in a period.
    pub samples_per_period: usize,
    /// Natural frequency, in Hz; `None` for a record without a reference.
    pub natural_frequency_hz: Option<f64>,
    /// Level of the confidence intervals, a pure number such as 0.95.
    pub confidence: f64,
    /// Result at each setting.
    pub points: Vec<Point>,
    /// Setting with the smallest error, in the unit of its [`Kind`].
    pub best_setting: f64,
    /// Best setting if the settings are NPI: number of cycles in a period, a pure number.
    pub best_npi: Option<f64>,
    /// Remarks to read before using the numbers.
    pub remarks: Vec<String>,
    /// Settings of the analysis; with them it can be repeated.
    pub analysis: SweepSettings,
}

/// Result at one setting.
#[derive(Debug, Serialize)]
pub struct Point {
    /// Value of the setting, in the unit of its [`Kind`].
    pub setting: f64,
    /// Cycles of the natural frequency in a period, a pure number.
    pub npi: Option<f64>,
    /// Time step, in s.
    pub step_s: f64,
    /// Samples in one cycle of the natural frequency, a pure number.
    pub samples_per_cycle: Option<f64>,
    /// Largest ratio of the error of an entry to the largest entry of its matrix. Without a
    /// reference, the standard error of the entry replaces the error.
    pub error: Option<f64>,
    /// Parameters, one each.
    pub parameters: Vec<SweptParameter>,
    /// Reason why there is no estimate; `None` if there is one.
    pub failure: Option<String>,
}

/// A parameter at one setting.
#[derive(Debug, Serialize)]
pub struct SweptParameter {
    /// Name, such as k12.
    pub name: String,
    /// SI unit.
    pub unit: &'static str,
    /// Estimate of the parameter, in the unit `unit`.
    pub value: f64,
    /// Standard error, in the same unit.
    pub standard_error: f64,
    /// Confidence interval, in the same unit.
    pub interval: [f64; 2],
    /// Value of the reference, in the same unit; `None` without one.
    pub true_value: Option<f64>,
}

/// Failure at a setting, or at all settings that use the same samples.
pub type Failure = Arc<AnalysisError>;

/// Returns the reason why a setting (a pure number, or Hz) gave no estimate.
pub(crate) fn failure(point: &SweepPoint<f64, Failure>) -> Option<String> {
    match &point.outcome {
        Ok(estimate) => estimate.system().err().map(|reason| reason.to_string()),
        Err(reason) => Some(reason.to_string()),
    }
}

impl Point {
    pub(super) fn new(
        kind: Kind,
        point: &SweepPoint<f64, Failure>,
        reference: Option<&SecondOrderSystem>,
        step_s: f64,
        natural_frequency_hz: Option<f64>,
    ) -> Result<Self, AnalysisError> {
        let mut parameters = Vec::new();
        for p in point.outcome.iter().flat_map(Estimate::parameters).filter(|p| p.value.is_finite())
        {
            let which = p.parameter;
            let truth = |system: &SecondOrderSystem| {
                system.matrix(which.matrix())[(which.row(), which.column())]
            };
            parameters.push(SweptParameter {
                name: which.to_string(),
                unit: which.matrix().unit(),
                value: p.value,
                standard_error: p.standard_error,
                interval: p.interval(CONFIDENCE)?,
                true_value: reference.map(truth),
            });
        }
        Ok(Self {
            setting: point.setting,
            npi: (kind == Kind::Npi).then_some(point.setting),
            step_s,
            samples_per_cycle: natural_frequency_hz.map(|hz| 1.0 / (hz * step_s)),
            error: point.error,
            parameters,
            failure: failure(point),
        })
    }
}

impl Point {
    fn error_percent(&self) -> String {
        self.error.map_or("none".into(), |e| significant(100.0 * e, 3))
    }
}

impl SweepSummary {
    /// Returns whether the errors refer to a known machine.
    pub fn has_reference(&self) -> bool {
        self.points.iter().flat_map(|p| &p.parameters).any(|p| p.true_value.is_some())
    }

    /// Returns the result as text for a reader: all settings, or the best with its intervals.
    pub fn text(&self, only_best: bool) -> String {
        let mut text = format!(
            "{}: {}, {} in a period",
            self.file,
            self.estimator,
            message::count(self.samples_per_period, "sample")
        );
        if let Some(hz) = self.natural_frequency_hz {
            text += &format!(", natural frequency {} Hz", significant(hz, 6));
        }
        text += "\n\n";
        text += &if only_best { self.best_table() } else { self.table() };
        for point in self.points.iter().filter(|_| !only_best) {
            if let Some(failure) = &point.failure {
                let (name, _) = self.setting.label();
                text += &format!("{name} {}: {failure}\n", compact(point.setting, 6));
            }
        }
        text += if self.has_reference() {
            "\nThe error is the largest error of an entry, relative to the largest entry of its matrix"
        } else {
            "\nThe error is the largest standard error, relative to the largest entry of its \
             matrix: it does not include bias"
        };
        text += if only_best { ".\n" } else { "; ± is one standard error.\n" };
        let (name, unit) = self.setting.label();
        let best = format!("Best: {name} {} {unit}", compact(self.best_setting, 6));
        text += best.trim_end();
        text + "\n" + &paragraph(self.remarks.iter().map(|remark| format!("note: {remark}")))
    }

    fn table(&self) -> String {
        let names = self.points.iter().map(|p| &p.parameters).max_by_key(|p| p.len());
        let names: Vec<&SweptParameter> = names.into_iter().flatten().collect();
        let setting = match self.setting.label() {
            (name, "") => name.to_owned(),
            (name, unit) => format!("{name} ({unit})"),
        };
        let mut header =
            vec![setting, "step (s)".into(), "samples per cycle".into(), "error (%)".into()];
        let general = header.len();
        header.extend(names.iter().map(|p| format!("{} ({})", p.name, p.unit)));
        let mut rows = vec![header];
        for point in &self.points {
            let mut row = vec![
                compact(point.setting, 6),
                significant(point.step_s, 4),
                point.samples_per_cycle.map_or("–".into(), |n| significant(n, 4)),
                point.error_percent(),
            ];
            row.extend(point.parameters.iter().map(|p| {
                format!("{} ± {}", significant(p.value, 6), significant(p.standard_error, 2))
            }));
            rows.push(row);
        }
        if self.has_reference() {
            let mut truth = vec!["true".into(), String::new(), String::new(), String::new()];
            let value = |p: &&SweptParameter| p.true_value.map_or(String::new(), |v| compact(v, 6));
            truth.extend(names.iter().map(value));
            rows.push(truth);
        }
        paged_table(&rows, general)
    }

    fn best_table(&self) -> String {
        let interval = format!("{} % interval", compact(100.0 * self.confidence, 3));
        let header = ["parameter", "value", "standard error", &interval, "true", "unit"];
        let mut rows = vec![header.map(String::from).to_vec()];
        let best = self.points.iter().filter(|p| p.setting == self.best_setting);
        for point in best.take(1) {
            for p in &point.parameters {
                let mut row = vec![p.name.clone()];
                row.extend(Uncertain::new(p.value, p.standard_error, p.interval).cells());
                row.push(p.true_value.map_or("–".into(), |v| compact(v, 6)));
                row.push(p.unit.into());
                rows.push(row);
            }
            rows.push(vec!["error".into(), format!("{} %", point.error_percent())]);
        }
        text_table(&rows)
    }
}

impl fmt::Display for SweepSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text(false))
    }
}
