//! Rows of results as columns.

use mechid_io::{ParquetColumn, ParquetValues, parquet_bytes};

use crate::batch::{FindingRow, ModeCell, ParameterCell};
use crate::{AnalysisError, ResultRow};

/// Returns rows of results as the bytes of a Parquet file, with the same columns as the files of a
/// fleet.
///
/// # Errors
/// As [`parquet_bytes`].
pub fn results_as_parquet(rows: &[ResultRow]) -> Result<Vec<u8>, AnalysisError> {
    Ok(parquet_bytes(&columns(rows))?)
}

/// Returns the table of results as columns. The number and names of the columns do not depend on
/// the rows.
pub(super) fn columns(rows: &[ResultRow]) -> Vec<ParquetColumn> {
    let text = |value: &dyn Fn(&ResultRow) -> Option<String>| {
        ParquetValues::Text(rows.iter().map(value).collect())
    };
    let count = |value: &dyn Fn(&ResultRow) -> Option<usize>| {
        let value = |row| value(row).and_then(|count| i64::try_from(count).ok());
        ParquetValues::Count(rows.iter().map(value).collect())
    };
    let number = |value: &dyn Fn(&ResultRow) -> Option<f64>| {
        ParquetValues::Number(rows.iter().map(value).collect())
    };
    let parameter_texts = |value: &dyn Fn(&ParameterCell) -> String| {
        texts(rows, |row| row.parameters.iter().map(value).collect())
    };
    let parameter_numbers = |value: &dyn Fn(&ParameterCell) -> Option<f64>| {
        numbers(rows, |row| row.parameters.iter().map(value).collect())
    };
    let modes = |value: &dyn Fn(&ModeCell) -> Option<f64>| {
        numbers(rows, |row| row.modes.iter().map(value).collect())
    };
    let findings = |value: &dyn Fn(&FindingRow) -> String| {
        texts(rows, |row| row.findings.iter().map(value).collect())
    };
    let columns = [
        ("record", text(&|row| Some(row.record.clone()))),
        ("record_id", text(&|row| row.record_id.clone())),
        ("error_code", text(&|row| row.error.as_ref().map(|error| error.code.clone()))),
        ("error", text(&|row| row.error.as_ref().map(|error| error.message.clone()))),
        ("estimator", text(&|row| row.estimator.clone())),
        ("sample_rate_hz", number(&|row| row.sample_rate_hz)),
        ("first_sample", count(&|row| row.first_sample)),
        ("last_sample", count(&|row| row.last_sample)),
        ("parameter", parameter_texts(&|p| p.name.clone())),
        ("unit", parameter_texts(&|p| p.unit.clone())),
        ("value", parameter_numbers(&|p| Some(p.value))),
        ("standard_error", parameter_numbers(&|p| p.standard_error)),
        ("covariance_parameter", texts(rows, covariance_parameters)),
        ("covariance", numbers(rows, covariance_entries)),
        ("degrees_of_freedom", count(&|row| row.covariance.as_ref().map(|c| c.degrees_of_freedom))),
        ("natural_frequency_hz", modes(&|mode| Some(mode.natural_frequency_hz))),
        (
            "natural_frequency_standard_error_hz",
            modes(&|mode| mode.natural_frequency_standard_error_hz),
        ),
        ("damping_ratio", modes(&|mode| Some(mode.damping_ratio))),
        ("damping_ratio_standard_error", modes(&|mode| mode.damping_ratio_standard_error)),
        ("nrmse", number(&|row| row.nrmse)),
        ("unexplained_motion", number(&|row| row.unexplained_motion)),
        ("misfit_ratio", number(&|row| row.misfit_ratio)),
        ("condition_number", number(&|row| row.condition_number)),
        ("finding", findings(&|finding| finding.code.clone())),
        ("finding_verdict", findings(&|finding| finding.verdict.to_string())),
        ("finding_value", numbers(rows, |row| row.findings.iter().map(|one| one.value).collect())),
        ("warning", texts(rows, |row| row.warnings.clone())),
        ("note", texts(rows, |row| row.notes.clone())),
        ("analysis_hash", text(&|row| Some(row.analysis_hash.clone()))),
        ("version", text(&|row| Some(row.version.clone()))),
    ];
    columns.into_iter().map(|(name, values)| ParquetColumn { name, values }).collect()
}

fn texts(rows: &[ResultRow], list: impl Fn(&ResultRow) -> Vec<String>) -> ParquetValues {
    ParquetValues::Texts(rows.iter().map(list).collect())
}

fn numbers(rows: &[ResultRow], list: impl Fn(&ResultRow) -> Vec<Option<f64>>) -> ParquetValues {
    ParquetValues::Numbers(rows.iter().map(list).collect())
}

fn covariance_parameters(row: &ResultRow) -> Vec<String> {
    row.covariance.as_ref().map(|c| c.parameters.clone()).unwrap_or_default()
}

fn covariance_entries(row: &ResultRow) -> Vec<Option<f64>> {
    let entries = row.covariance.iter().flat_map(|c| c.matrix.iter().flatten());
    entries.map(|entry| Some(*entry)).collect()
}
