//! Table of results, read as rows.

use std::collections::hash_map::Entry;
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use mechid_checks::Verdict;
use mechid_io::{FileStamp, Limits, ParameterCovariance, ParquetCell, files_of, read_parquet_rows};

use crate::batch::{FindingRow, ModeCell, ParameterCell, RowError};
use crate::{AnalysisError, ResultRow};

/// Rows of results, one for each record.
#[derive(Debug, Clone, PartialEq)]
pub struct Results {
    /// Rows, in the order of the names of the records.
    pub rows: Vec<ResultRow>,
    /// Number of ignored older rows of the same records, computed before a record or the analysis
    /// changed.
    pub superseded: usize,
}

/// Reads the rows of all parts in a folder of results, in the order of the names of the records. If
/// a record has several rows, the row in the part written last counts.
///
/// # Errors
/// [`AnalysisError::Io`] if the folder or a part cannot be read, [`AnalysisError::NoRecord`] if
/// there is no row.
pub fn read_results(folder: impl AsRef<Path>) -> Result<Results, AnalysisError> {
    let mut parts: Vec<(u128, PathBuf)> = Vec::new();
    for path in files_of(folder.as_ref())? {
        let is_part = path
            .file_name()
            .and_then(|name| name.to_str())
            .is_some_and(|name| name.starts_with("part-") && name.ends_with(".parquet"));
        if is_part {
            let written = FileStamp::read(&path).map_or(0, |stamp| stamp.modified_ns);
            parts.push((written, path));
        }
    }
    // The newest part comes last, so its rows replace those of earlier parts.
    parts.sort();
    let (mut places, mut rows) = (HashMap::new(), Vec::<ResultRow>::new());
    let mut superseded = 0;
    for (_, path) in parts {
        for cells in read_parquet_rows(&path, &Limits::DEFAULT)? {
            let row = Cells::new(cells).row();
            match places.entry((row.record.clone(), row.record_id.clone())) {
                Entry::Occupied(place) => {
                    rows[*place.get()] = row;
                    superseded += 1;
                }
                Entry::Vacant(place) => {
                    place.insert(rows.len());
                    rows.push(row);
                }
            }
        }
    }
    // A stable sort keeps the records of one file in the order of its rows.
    rows.sort_by(|a, b| a.record.cmp(&b.record));
    if rows.is_empty() { Err(AnalysisError::NoRecord) } else { Ok(Results { rows, superseded }) }
}

/// Cells of a row by the names of their columns.
pub(super) struct Cells(BTreeMap<String, ParquetCell>);

impl Cells {
    pub fn new(cells: Vec<(String, ParquetCell)>) -> Self {
        Self(cells.into_iter().collect())
    }

    /// Returns the row of results that the cells contain.
    pub fn row(mut self) -> ResultRow {
        let error = self
            .text("error_code")
            .map(|code| RowError { code, message: self.text("error").unwrap_or_default() });
        let covariance = self.count("degrees_of_freedom").map(|degrees_of_freedom| {
            let parameters = self.texts("covariance_parameter");
            let entries: Vec<f64> = self.numbers("covariance").into_iter().flatten().collect();
            let rows = entries.chunks(parameters.len().max(1)).map(<[f64]>::to_vec);
            ParameterCovariance { matrix: rows.collect(), parameters, degrees_of_freedom }
        });
        ResultRow {
            record: self.text("record").unwrap_or_default(),
            record_id: self.text("record_id"),
            error,
            estimator: self.text("estimator"),
            sample_rate_hz: self.number("sample_rate_hz"),
            first_sample: self.count("first_sample"),
            last_sample: self.count("last_sample"),
            parameters: self.parameters(),
            covariance,
            modes: self.modes(),
            nrmse: self.number("nrmse"),
            unexplained_motion: self.number("unexplained_motion"),
            misfit_ratio: self.number("misfit_ratio"),
            condition_number: self.number("condition_number"),
            findings: self.findings(),
            warnings: self.texts("warning"),
            notes: self.texts("note"),
            analysis_hash: self.text("analysis_hash").unwrap_or_default(),
            version: self.text("version").unwrap_or_default(),
        }
    }

    fn parameters(&mut self) -> Vec<ParameterCell> {
        let names = self.texts("parameter").into_iter().zip(self.texts("unit"));
        let numbers = self.numbers("value").into_iter().zip(self.numbers("standard_error"));
        let cells = names.zip(numbers).map(|((name, unit), (value, standard_error))| {
            ParameterCell { name, unit, value: value.unwrap_or(f64::NAN), standard_error }
        });
        cells.collect()
    }

    fn modes(&mut self) -> Vec<ModeCell> {
        let frequency = self.numbers("natural_frequency_hz").into_iter();
        let frequency = frequency.zip(self.numbers("natural_frequency_standard_error_hz"));
        let damping = self.numbers("damping_ratio").into_iter();
        let damping = damping.zip(self.numbers("damping_ratio_standard_error"));
        let cells = frequency.zip(damping).map(|((hz, hz_error), (ratio, ratio_error))| ModeCell {
            natural_frequency_hz: hz.unwrap_or(f64::NAN),
            natural_frequency_standard_error_hz: hz_error,
            damping_ratio: ratio.unwrap_or(f64::NAN),
            damping_ratio_standard_error: ratio_error,
        });
        cells.collect()
    }

    fn findings(&mut self) -> Vec<FindingRow> {
        let codes = self.texts("finding").into_iter().zip(self.texts("finding_verdict"));
        let verdict = |written: &str| {
            let mut verdicts = [Verdict::Good, Verdict::Doubtful].into_iter();
            verdicts.find(|verdict| verdict.to_string() == written).unwrap_or(Verdict::Bad)
        };
        let rows = codes
            .zip(self.numbers("finding_value"))
            .map(|((code, written), value)| FindingRow { code, verdict: verdict(&written), value });
        rows.collect()
    }

    fn text(&mut self, column: &str) -> Option<String> {
        match self.0.remove(column) {
            Some(ParquetCell::Text(text)) => Some(text),
            _ => None,
        }
    }

    fn count(&mut self, column: &str) -> Option<usize> {
        match self.0.remove(column) {
            Some(ParquetCell::Count(count)) => usize::try_from(count).ok(),
            _ => None,
        }
    }

    fn number(&mut self, column: &str) -> Option<f64> {
        match self.0.remove(column) {
            Some(ParquetCell::Number(number)) => Some(number),
            _ => None,
        }
    }

    fn list(&mut self, column: &str) -> Vec<ParquetCell> {
        match self.0.remove(column) {
            Some(ParquetCell::List(cells)) => cells,
            _ => Vec::new(),
        }
    }

    fn texts(&mut self, column: &str) -> Vec<String> {
        let cells = self.list(column).into_iter();
        cells
            .map(|cell| if let ParquetCell::Text(text) = cell { text } else { String::new() })
            .collect()
    }

    fn numbers(&mut self, column: &str) -> Vec<Option<f64>> {
        let cells = self.list(column).into_iter();
        cells
            .map(|cell| if let ParquetCell::Number(number) = cell { Some(number) } else { None })
            .collect()
    }
}
