//! Settings for reading a record file.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mechid_io::{Limits, ReadOptions, RecordFile, Table, TimeAxis};
use serde::{Deserialize, Serialize};

#[cfg(feature = "parquet")]
use super::many;
use super::{Channels, Measurement, Window};
use crate::AnalysisError;
use crate::limits::memory_bytes;

/// Settings for reading a record file.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Reading {
    /// Number of header lines to skip above a table of text.
    pub skip_lines: u64,
    /// Time column, by name or number counted from 1; `None`: the time axis of the file, or a
    /// column called time or t.
    pub time: Option<String>,
    /// Sampling rate, in Hz, if there is no time column.
    pub sample_rate_hz: Option<f64>,
    /// Constant to subtract from every channel.
    pub detrend: Detrend,
    /// Column that names the record of each row, in a Parquet file with many records.
    pub record_column: Option<String>,
    /// Record to read from a file with many records, by its name in `record_column`; `None`: the
    /// only record of the file.
    pub record_id: Option<String>,
    /// Units of columns, by their names or numbers; they replace those in the headers: `g`, `lbf`,
    /// `ms`.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub units: BTreeMap<String, String>,
    /// Factors that convert columns to SI units, by column name or number, in SI units per unit of
    /// the column. They replace the units in the headers.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub scales: BTreeMap<String, f64>,
    /// Factor on the memory limits for reading a file ([`mechid_io::Limits`]); `None`: 1.
    pub limits_factor: Option<usize>,
    /// Maximum memory for the numbers of a file and their analysis, in units of GB; `None`: 0.27 GB
    /// and 512 bytes for each byte of the file, 8.6 GB at most ([`crate::limits`]).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub memory_gb: Option<f64>,
}

/// Constant to subtract from a channel.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Detrend {
    /// No constant.
    #[default]
    None,
    /// The mean of the whole record, not only of the window.
    Mean,
}

impl Reading {
    /// Opens a record file; at most `rows` rows of a text are kept in memory.
    ///
    /// # Errors
    /// The errors of [`RecordFile::open`]; [`AnalysisError::RecordId`] if the file does not contain
    /// the requested record, or contains several and none is requested.
    pub fn open(&self, path: &Path, rows: usize) -> Result<RecordFile, AnalysisError> {
        let mut file = self.open_as_written(path, rows)?;
        self.state_units(&mut file)?;
        Ok(file)
    }

    /// Applies the stated units and factors to the columns of a file.
    pub(super) fn state_units(&self, file: &mut RecordFile) -> Result<(), AnalysisError> {
        for (column, unit) in &self.units {
            file.set_unit(column, unit)?;
        }
        for (column, factor) in &self.scales {
            file.set_scale(column, *factor)?;
        }
        Ok(())
    }

    fn open_as_written(&self, path: &Path, rows: usize) -> Result<RecordFile, AnalysisError> {
        #[cfg(feature = "parquet")]
        if let Some(column) = &self.record_column {
            return many::open_one(self, path, column);
        }
        #[cfg(not(feature = "parquet"))]
        if self.record_column.is_some() {
            let why = "this program was compiled without Parquet".into();
            return Err(AnalysisError::Setting { setting: "record_column", why });
        }
        let options = ReadOptions { skip_lines: self.skip_lines, limits: self.limits() };
        Ok(RecordFile::open(path, &options, rows)?)
    }

    /// Returns the limits on the file and on the memory of its analysis.
    pub fn limits(&self) -> Limits {
        let limits = Limits::DEFAULT.times(self.limits_factor.unwrap_or(1));
        match memory_bytes(self) {
            Some(bytes) => limits.with_memory(bytes),
            None => limits,
        }
    }

    /// Returns the requested time axis. Without a request, returns the time axis of the file; if
    /// the file has none, the time column identified by its name.
    pub fn time_axis<'a>(&'a self, table: &'a Table) -> Option<TimeAxis<'a>> {
        match (self.sample_rate_hz, &self.time) {
            (Some(rate_hz), _) => Some(TimeAxis::RateHz(rate_hz)),
            (None, Some(column)) => Some(TimeAxis::Column(column)),
            (None, None) if table.has_time_axis() => Some(TimeAxis::OfFile),
            (None, None) => table.time_column().map(TimeAxis::Column),
        }
    }
}

/// A record file with its channels, settings and window: the saved form of a [`Measurement`].
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RecordPlan {
    /// The file; `-` is standard input.
    pub path: PathBuf,
    /// Columns of force and response.
    pub channels: Channels,
    /// Settings for reading the file.
    pub reading: Reading,
    /// Samples to use.
    pub window: Window,
}

impl RecordPlan {
    /// Opens the record.
    ///
    /// # Errors
    /// The errors of [`Measurement::open_with`].
    pub fn open(&self) -> Result<Measurement, AnalysisError> {
        let measurement = Measurement::open_with(&self.path, &self.channels, &self.reading)?;
        Ok(Measurement { window: self.window.clone(), ..measurement })
    }
}
