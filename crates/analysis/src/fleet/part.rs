//! Unit of work: a part of the records.

use std::fs::File;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use mechid_io::{FileStamp, IoError, RecordRows, path_text, read_parquet_metadata, write_parquet};
use serde::{Deserialize, Serialize};

use super::failures::FailureCount;
use super::rows::rows_of;
use super::table::columns;
use super::worker::Worker;
use crate::batch::settings::hash;
use crate::measurement::records_of;
use crate::{AnalysisError, ResultRow, SavedAnalysis};

/// Key of the [`PartDone`] in the file of a part.
const DONE: &str = "mechid.part";

/// A record to identify: a file, or some rows of a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FleetRecord {
    /// The file.
    pub path: PathBuf,
    /// Rows of the record in a file of many records; `None`: the whole file.
    pub rows: Option<RecordRows>,
}

impl FleetRecord {
    /// Returns the records of a file: those that the record column separates, or the file itself. A
    /// file that cannot be read counts as one record; its row of results will contain the error.
    pub(super) fn from_file(path: PathBuf, analysis: &SavedAnalysis) -> Vec<Self> {
        let column = analysis.reading.record_column.as_ref();
        let column = column.filter(|_| analysis.reading.record_id.is_none());
        match column.map(|column| records_of(&path, column, &analysis.reading)) {
            Some(Ok(records)) if !records.is_empty() => {
                let one = |rows| Self { path: path.clone(), rows: Some(rows) };
                records.into_iter().map(one).collect()
            }
            _ => vec![Self { path, rows: None }],
        }
    }
}

/// Some records, with one file of results.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Part {
    records: Vec<FleetRecord>,
    file_name: String,
}

/// Callback that adds the rows of some records of a file or, if no records are given, of the whole
/// file.
type ComputeRows<'a> =
    dyn FnMut(&Path, &[RecordRows], &mut Vec<ResultRow>) -> Result<(), AnalysisError> + 'a;

/// A part that has been computed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PartDone {
    /// Name of the file with the results of the part, in the folder of results.
    pub file_name: String,
    /// Number of records; the part has one row for each.
    pub records: usize,
    /// Counts of records without a result, by the reason.
    pub failures: Vec<FailureCount>,
    /// `true` if the part was computed now, `false` if it existed before.
    pub computed: bool,
}

/// Returns whether a file cannot be changed because it is protected.
fn is_read_only(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem)
}

impl Part {
    /// Creates a part. Its name is a hash of the paths, sizes and times of modification of its
    /// records, of the analysis and of the version of this crate: a changed record or analysis
    /// gives another part.
    pub fn new(records: &[FleetRecord], analysis: &SavedAnalysis) -> Self {
        let mut state = format!("{}\n{}\n", env!("CARGO_PKG_VERSION"), analysis.hash());
        for file in records.chunk_by(|a, b| a.path == b.path) {
            let path = &file[0].path;
            let stamp = FileStamp::read(path).map(|s| (s.bytes, s.modified_ns));
            for FleetRecord { rows, .. } in file {
                // The debug format quotes and escapes the paths, so that different paths give
                // different texts.
                state += &format!("{path:?} {stamp:?} {rows:?}\n");
            }
        }
        let file_name = format!("part-{}.parquet", hash(state.as_bytes()));
        Self { records: records.to_vec(), file_name }
    }

    /// Returns the records.
    pub fn records(&self) -> &[FleetRecord] {
        &self.records
    }

    /// Returns the name of the file with the results of this part, in the folder of results.
    pub fn file_name(&self) -> &str {
        &self.file_name
    }

    /// Computes the rows and writes them into `folder`, unless the file exists.
    ///
    /// # Errors
    /// [`AnalysisError::Io`] if the file cannot be written. The error of a record is in its row.
    pub fn run(&self, analysis: &SavedAnalysis, folder: &Path) -> Result<PartDone, AnalysisError> {
        self.written(folder, &mut |path, records, rows| {
            rows_of(path, records, analysis, &mut |row| {
                rows.push(row);
                Ok(())
            })
        })
    }

    /// Computes the rows like [`Part::run`], in a separate process.
    ///
    /// # Errors
    /// As [`Part::run`]; [`AnalysisError::RecordProcess`] if the process cannot be started.
    pub fn run_isolated(
        &self,
        worker: &mut Worker,
        folder: &Path,
    ) -> Result<PartDone, AnalysisError> {
        self.written(folder, &mut |path, records, rows| {
            rows.extend(worker.rows(path, records)?);
            Ok(())
        })
    }

    /// Computes the rows of the records with `compute`, file by file, and writes them into
    /// `folder`. If the file of the part exists, only its time of modification is changed.
    fn written(
        &self,
        folder: &Path,
        compute: &mut ComputeRows<'_>,
    ) -> Result<PartDone, AnalysisError> {
        let path = folder.join(&self.file_name);
        if let Some(done) = self.done(&path) {
            // Rows of the newest part replace the rows of older parts, so a part from an earlier
            // run gets the present time.
            let touched = File::options().append(true).open(&path);
            let touched = touched.and_then(|file| file.set_modified(SystemTime::now()));
            match touched {
                // The file keeps its old time: no part can be written to its read-only folder, so
                // no part there is newer.
                Err(error) if is_read_only(&error) => {}
                touched => {
                    let file = path_text(&path).into_owned();
                    touched.map_err(|source| IoError::Write { file, source })?;
                }
            }
            return Ok(done);
        }
        let mut rows = Vec::with_capacity(self.records.len());
        for file in self.records.chunk_by(|a, b| a.path == b.path) {
            let mut records = Vec::new();
            for record in file {
                match &record.rows {
                    Some(some) => records.push(some.clone()),
                    None => compute(&record.path, &[], &mut rows)?,
                }
            }
            if !records.is_empty() {
                compute(&file[0].path, &records, &mut rows)?;
            }
        }
        let done = PartDone {
            file_name: self.file_name.clone(),
            records: rows.len(),
            failures: FailureCount::from_rows(&rows),
            computed: true,
        };
        // A later run reads this summary from the file. It does not compute the part, so `computed`
        // is false.
        let later = PartDone { computed: false, ..done.clone() };
        let later = serde_json::to_string(&later).unwrap_or_default();
        write_parquet(&path, &columns(&rows), &[(DONE, later)])?;
        Ok(done)
    }

    /// Returns the summary of a part that an earlier run wrote into this file; `None` if there is
    /// no file, or if the file does not contain such a summary.
    fn done(&self, path: &Path) -> Option<PartDone> {
        let pairs = read_parquet_metadata(path).ok()?;
        let (_, done) = pairs.iter().find(|(key, _)| key == DONE)?;
        serde_json::from_str(done).ok()
    }
}
