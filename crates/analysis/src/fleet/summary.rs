//! Summary of a run: number of records, speed, and failures with their reasons.

use std::collections::BTreeSet;
use std::fmt;
use std::path::{Path, PathBuf};

use mechid_io::files_of;
use mechid_signal::message;
use serde::Serialize;

use super::failures::FailureCount;
use super::part::PartDone;
use crate::AnalysisError;
use crate::text::compact;

/// Result of a run over many records.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FleetSummary {
    /// Number of records; each record has one row.
    pub records: usize,
    /// Number of records without a result.
    pub failed: usize,
    /// Failures by their code, the most frequent first.
    pub failures: Vec<FailureCount>,
    /// Number of parts.
    pub parts: usize,
    /// Number of parts computed now; the others existed before.
    pub computed_parts: usize,
    /// Number of records in the parts computed now.
    pub computed_records: usize,
    /// Number of parts in the folder with other records, other versions of these records, or
    /// another analysis.
    pub other_parts: usize,
    /// Paths that are not files, each with its kind: named pipes, sockets, devices.
    pub left_out: Vec<String>,
    /// Time of the run, in s.
    pub elapsed_s: f64,
}

impl FleetSummary {
    /// Summarises the parts of a run of `elapsed_s` seconds that wrote into `folder`.
    ///
    /// # Errors
    /// [`AnalysisError::Io`] if the folder cannot be listed.
    pub fn from_parts(
        parts: Vec<PartDone>,
        folder: &Path,
        elapsed_s: f64,
    ) -> Result<Self, AnalysisError> {
        let ours: BTreeSet<&str> = parts.iter().map(|part| part.file_name.as_str()).collect();
        let is_other = |path: &PathBuf| {
            let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
            name.starts_with("part-") && name.ends_with(".parquet") && !ours.contains(name)
        };
        let other_parts = files_of(folder)?.iter().filter(|path| is_other(path)).count();
        let computed = || parts.iter().filter(|part| part.computed);
        let failures = FailureCount::merged(parts.iter().flat_map(|part| part.failures.clone()));
        Ok(Self {
            records: parts.iter().map(|part| part.records).sum(),
            failed: failures.iter().map(|count| count.records).sum(),
            parts: parts.len(),
            computed_parts: computed().count(),
            computed_records: computed().map(|part| part.records).sum(),
            failures,
            other_parts,
            left_out: Vec::new(),
            elapsed_s,
        })
    }
}

impl fmt::Display for FleetSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (records, parts) = (self.records, self.parts);
        writeln!(
            f,
            "{} in {}: {} identified, {} failed",
            message::count(records, "record"),
            message::count(parts, "part"),
            records - self.failed,
            self.failed
        )?;
        for failure in &self.failures {
            let FailureCount { code, records, record, message: why } = failure;
            let count = message::count(*records, "record");
            writeln!(f, "  {code}: {count}, such as {record} ({why})")?;
        }
        for path in &self.left_out {
            writeln!(f, "  left out: {path}")?;
        }
        match self.computed_parts {
            0 => writeln!(
                f,
                "all parts were computed by an earlier run, so no record was computed again"
            )?,
            computed => {
                let rate = self.computed_records as f64 / self.elapsed_s;
                writeln!(
                    f,
                    "computed {} in {} s ({} records/s); {} computed before",
                    message::count(self.computed_records, "record"),
                    compact(self.elapsed_s, 3),
                    compact(rate, 3),
                    message::count(parts - computed, "part")
                )?;
            }
        }
        if self.other_parts > 0 {
            writeln!(
                f,
                "note: the folder also contains {} from other records or from a different analysis: a program that \
                 reads the whole folder also reads these parts",
                message::count(self.other_parts, "part")
            )?;
        }
        Ok(())
    }
}
