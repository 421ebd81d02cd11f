//! The unit of work.

use std::path::{Path, PathBuf};

use mechid_io::{FileStamp, read_parquet_metadata, write_parquet};
use serde::{Deserialize, Serialize};

use super::failures::FailureCount;
use super::table::columns;
use crate::batch::settings::hash;
use crate::{AnalysisError, ResultRow, SavedAnalysis};

/// Key in a part's file under which its [`PartDone`] stands.
const DONE: &str = "mechid.part";

/// Some records, whose results become the rows of one file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Part {
    records: Vec<PathBuf>,
    file_name: String,
}

/// A part that has been computed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PartDone {
    /// Name of its file in the folder of results.
    pub file_name: String,
    /// Number of records, which is that of the rows.
    pub records: usize,
    /// Records without a result, by the reason.
    pub failures: Vec<FailureCount>,
    /// `true` if it was computed now, `false` if it was there before.
    pub computed: bool,
}

impl Part {
    /// Looks at the records and gives the part its name: a hash of their paths, sizes and times of
    /// modification, of the analysis and of the version of this crate. A record that changes, or an
    /// analysis that does, makes another part.
    pub fn new(records: &[PathBuf], analysis: &SavedAnalysis) -> Self {
        let mut all = format!("{}\n{}\n", env!("CARGO_PKG_VERSION"), analysis.hash());
        for record in records {
            let stamp = FileStamp::of(record).map(|s| (s.bytes, s.modified_ns));
            // Quoted: no path looks like two.
            all += &format!("{record:?} {stamp:?}\n");
        }
        let file_name = format!("part-{}.parquet", hash(all.as_bytes()));
        Self { records: records.to_vec(), file_name }
    }

    /// Returns the records.
    pub fn records(&self) -> &[PathBuf] {
        &self.records
    }

    /// Returns the name of its file in the folder of results.
    pub fn file_name(&self) -> &str {
        &self.file_name
    }

    /// Computes the rows and writes them into `folder`, unless the file is there.
    ///
    /// # Errors
    /// [`AnalysisError::Io`] if the file cannot be written. What is wrong with a record is in its row.
    pub fn run(&self, analysis: &SavedAnalysis, folder: &Path) -> Result<PartDone, AnalysisError> {
        let path = folder.join(&self.file_name);
        if let Some(done) = self.done(&path) {
            return Ok(done);
        }
        let row = |record: &PathBuf| -> ResultRow {
            analysis.row(&record.display().to_string(), || analysis.open(record))
        };
        let rows: Vec<ResultRow> = self.records.iter().map(row).collect();
        let done = PartDone {
            file_name: self.file_name.clone(),
            records: rows.len(),
            failures: FailureCount::of(&rows),
            computed: true,
        };
        // As the next run finds it.
        let found = PartDone { computed: false, ..done.clone() };
        let found = serde_json::to_string(&found).unwrap_or_default();
        write_parquet(&path, &columns(&rows), &[(DONE, found)])?;
        Ok(done)
    }

    /// What the file says that is there; `None` if none is, or none of ours.
    fn done(&self, path: &Path) -> Option<PartDone> {
        let pairs = read_parquet_metadata(path).ok()?;
        let (_, found) = pairs.iter().find(|(key, _)| key == DONE)?;
        serde_json::from_str(found).ok()
    }
}
