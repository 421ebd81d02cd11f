//! Result of one of many records.

use std::panic::{AssertUnwindSafe, catch_unwind};

use mechid_checks::Verdict;
use mechid_io::{ParameterCovariance, RecordFile, Table};
use serde::Serialize;

use super::settings::SavedAnalysis;
use crate::elements::{ElementRow, ElementSummary};
use crate::identify::checks::CheckRow;
use crate::identify::rows::{ModeRow, Uncertain, WindowRow};
use crate::identify::summary::{FitRow, IdentificationSummary};
use crate::modes::{ModalCheck, ModesSummary, modes};
use crate::{AnalysisError, ElementData, Measurement, identify, identify_elements, time_limit};

/// Result of one record: a machine with its uncertainty and the warnings, or an error.
///
/// With an error, lists are empty and the other numbers are `None`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ResultRow {
    /// Name of the record: its path, as it was given.
    pub record: String,
    /// Value of the column that distinguishes the records of a file; `None` if the file is one
    /// record.
    pub record_id: Option<String>,
    /// Reason why there is no result.
    pub error: Option<RowError>,
    /// Estimator that was used.
    pub estimator: Option<String>,
    /// Sampling rate, in Hz.
    pub sample_rate_hz: Option<f64>,
    /// First sample used, counted from 1.
    pub first_sample: Option<usize>,
    /// Last sample used, counted from 1.
    pub last_sample: Option<usize>,
    /// Entries of M, C and K, then the parameters of nonlinear terms.
    pub parameters: Vec<ParameterCell>,
    /// Covariance of the estimated parameters, in products of their SI units.
    pub covariance: Option<ParameterCovariance>,
    /// Modes, by rising frequency.
    pub modes: Vec<ModeCell>,
    /// RMS of the residual over the RMS of the fitted quantity, a ratio.
    pub nrmse: Option<f64>,
    /// Part of the response that the model does not explain, a ratio of RMS values.
    pub unexplained_motion: Option<f64>,
    /// Ratio of the residual power to the noise power.
    pub misfit_ratio: Option<f64>,
    /// Condition number of the column-scaled regressor, a ratio.
    pub condition_number: Option<f64>,
    /// Every check, before the fit and after it.
    pub findings: Vec<FindingRow>,
    /// Sentences of the findings with the verdict doubtful or bad.
    pub warnings: Vec<String>,
    /// Remarks to read before using the numbers.
    pub notes: Vec<String>,
    /// Hash of the analysis, in hexadecimal digits.
    pub analysis_hash: String,
    /// Version of this crate.
    pub version: String,
}

/// Reason why a record has no result.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct RowError {
    /// Code of the failure, as [`AnalysisError::code`] names it; `internal` for a panic.
    pub code: String,
    /// The failure, in a sentence.
    pub message: String,
}

/// One parameter of a row.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ParameterCell {
    /// Name, such as `k12`.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Value, in the unit of the parameter.
    pub value: f64,
    /// Standard error, in the unit of the parameter; `None` for a known value.
    pub standard_error: Option<f64>,
}

/// One mode of a row.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ModeCell {
    /// Natural frequency, in Hz.
    pub natural_frequency_hz: f64,
    /// Standard error of the natural frequency, in Hz.
    pub natural_frequency_standard_error_hz: Option<f64>,
    /// Damping ratio.
    pub damping_ratio: f64,
    /// Standard error of the damping ratio.
    pub damping_ratio_standard_error: Option<f64>,
}

/// One check of a row.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FindingRow {
    /// Kind of the finding, such as `wrong_period`, as in the JSON of an identification.
    pub code: String,
    /// Good, doubtful or bad.
    pub verdict: Verdict,
    /// Number that decides the verdict, a ratio or a probability; `None` if it is infinite.
    pub value: Option<f64>,
}

impl SavedAnalysis {
    /// Identifies the record that `source` opens; the row has the name `record`. Every failure,
    /// including a panic, becomes the error of the row. The same record and analysis always give
    /// the same row.
    pub fn row(
        &self,
        record: &str,
        source: impl FnOnce() -> Result<Measurement, AnalysisError>,
    ) -> ResultRow {
        ResultRow::from_source(record, self, source)
    }

    /// Identifies a record whose columns are in memory, as [`SavedAnalysis::row`] does.
    pub fn row_of_table(&self, record: &str, table: Table) -> ResultRow {
        let open = || {
            let file = RecordFile::from_table(table);
            Measurement::from_file(file, None, &self.record_channels()?, &self.reading)?
                .window(self.window.clone())
        };
        self.row(record, open)
    }
}

impl ResultRow {
    pub(super) fn from_source(
        record: &str,
        analysis: &SavedAnalysis,
        source: impl FnOnce() -> Result<Measurement, AnalysisError>,
    ) -> Self {
        let empty = Self {
            record: record.into(),
            record_id: None,
            error: None,
            estimator: None,
            sample_rate_hz: None,
            first_sample: None,
            last_sample: None,
            parameters: Vec::new(),
            covariance: None,
            modes: Vec::new(),
            nrmse: None,
            unexplained_motion: None,
            misfit_ratio: None,
            condition_number: None,
            findings: Vec::new(),
            warnings: Vec::new(),
            notes: Vec::new(),
            analysis_hash: analysis.hash(),
            version: env!("CARGO_PKG_VERSION").into(),
        };
        let work = || -> Result<Self, AnalysisError> {
            analysis.check()?;
            let records = [source()?];
            if let Some(how) = &analysis.elements {
                let data = ElementData::from_records(&records, how)?;
                return Ok(empty.with_elements(identify_elements(&data, how)?.summary()));
            }
            Ok(match &analysis.modes {
                None => empty.clone().with(identify(&records, &analysis.identify)?.summary()),
                Some(settings) => empty.clone().with_modes(modes(&records, settings)?.summary()),
            })
        };
        let limited = || time_limit::within(analysis.time_limit, work);
        let error = match catch_unwind(AssertUnwindSafe(limited)) {
            Ok(Ok(row)) => return row,
            Ok(Err(error)) => RowError { code: error.code(), message: error.to_string() },
            Err(panic) => RowError { code: "internal".into(), message: panic_message(&*panic) },
        };
        Self { error: Some(error), ..empty }
    }

    fn with_elements(&self, identified: &ElementSummary) -> Self {
        let window = identified.tests.first().and_then(|test| test.window.as_ref());
        let cell = |row: &ElementRow| ParameterCell {
            name: row.estimate.name.clone(),
            unit: row.unit.to_owned(),
            value: row.estimate.value,
            standard_error: row.estimate.standard_error,
        };
        let open = identified.combinations.iter().map(|row| row.text.clone());
        let conspicuous = identified.checks.iter().filter(|check| check.is_conspicuous());
        Self {
            estimator: Some("maximum likelihood, machine of named elements".into()),
            sample_rate_hz: window.map(|window| window.sample_rate_hz),
            first_sample: window.map(|window| window.first_sample),
            last_sample: window.map(|window| window.last_sample),
            parameters: identified.parameters.iter().map(cell).collect(),
            // Undetermined unknowns have an infinite variance; a row with such unknowns has no
            // covariance.
            covariance: Some(identified.parameter_covariance.clone())
                .filter(|_| identified.combinations.is_empty()),
            modes: identified.modes.iter().map(ModeCell::from_mode).collect(),
            misfit_ratio: identified.misfit_ratio,
            condition_number: Some(identified.condition_number),
            findings: identified.checks.iter().map(FindingRow::from_check).collect(),
            warnings: conspicuous.map(CheckRow::sentence).chain(open).collect(),
            notes: identified.notes.iter().map(ToString::to_string).collect(),
            ..self.clone()
        }
    }

    fn with(&self, identification: &IdentificationSummary) -> Self {
        let WindowRow { first_sample, last_sample, sample_rate_hz, .. } = identification.window;
        let FitRow { nrmse, unexplained_motion, misfit_ratio, condition_number, .. } =
            identification.fit;
        let of_terms = identification.nonlinear.iter().flat_map(|nonlinear| &nonlinear.parameters);
        let entries = identification
            .parameters
            .iter()
            .map(|p| ParameterCell::new(&p.name, p.unit, p.estimate));
        let terms = of_terms.map(|p| ParameterCell::new(&p.name, &p.unit, p.estimate));
        let conspicuous = identification.checks.iter().filter(|check| check.is_conspicuous());
        Self {
            estimator: Some(identification.estimator.into()),
            sample_rate_hz: Some(sample_rate_hz),
            first_sample: Some(first_sample),
            last_sample: Some(last_sample),
            parameters: entries.chain(terms).collect(),
            covariance: identification.covariance.clone(),
            modes: identification.modes.iter().map(|mode| ModeCell::from_mode(&mode.row)).collect(),
            nrmse: Some(nrmse),
            unexplained_motion,
            misfit_ratio,
            condition_number: Some(condition_number),
            findings: identification.checks.iter().map(FindingRow::from_check).collect(),
            warnings: conspicuous.map(CheckRow::sentence).collect(),
            notes: identification.remarks.clone(),
            ..self.clone()
        }
    }
}

impl ResultRow {
    fn with_modes(self, summary: &ModesSummary) -> Self {
        let window = summary.records.first().and_then(|record| record.window.as_ref());
        let finding = |check: &ModalCheck| FindingRow {
            code: check.code.into(),
            verdict: if check.passed { Verdict::Good } else { Verdict::Doubtful },
            value: Some(check.value).filter(|value| value.is_finite()),
        };
        let failed = summary.checks.iter().filter(|check| !check.passed);
        let unexplained = summary.variance_explained.map(|share| (1.0 - share).max(0.0).sqrt());
        Self {
            estimator: Some("modes by maximum likelihood".into()),
            sample_rate_hz: window.map(|window| window.sample_rate_hz),
            first_sample: window.map(|window| window.first_sample),
            last_sample: window.map(|window| window.last_sample),
            modes: summary.modes.iter().map(|mode| ModeCell::from_mode(&mode.mode.row)).collect(),
            nrmse: unexplained,
            unexplained_motion: unexplained,
            findings: summary.checks.iter().map(finding).collect(),
            warnings: failed.map(|check| check.text.clone()).collect(),
            notes: summary.notes.clone(),
            ..self
        }
    }
}

impl ParameterCell {
    fn new(name: &str, unit: &str, estimate: Uncertain) -> Self {
        let Uncertain { value, standard_error, .. } = estimate;
        Self { name: name.into(), unit: unit.into(), value, standard_error }
    }
}

impl ModeCell {
    fn from_mode(mode: &ModeRow) -> Self {
        Self {
            natural_frequency_hz: mode.natural_frequency_hz.value,
            natural_frequency_standard_error_hz: mode.natural_frequency_hz.standard_error,
            damping_ratio: mode.damping_ratio.value,
            damping_ratio_standard_error: mode.damping_ratio.standard_error,
        }
    }
}

impl FindingRow {
    fn from_check(check: &CheckRow) -> Self {
        let written = serde_json::to_value(&check.finding).unwrap_or_default();
        let code = written["kind"].as_str().unwrap_or_default().to_owned();
        Self { code, verdict: check.verdict, value: check.value }
    }
}

/// Returns the message of a panic.
fn panic_message(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    let text = text.or(panic.downcast_ref::<&str>().copied());
    format!("internal error, please report it: {}", text.unwrap_or("no reason is known"))
}
