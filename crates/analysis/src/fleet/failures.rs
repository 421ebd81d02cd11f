//! Counts of the records that failed, by their reasons.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::ResultRow;

/// Records that failed for one reason.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FailureCount {
    /// Code of the failure, as [`AnalysisError::code`](crate::AnalysisError::code) names it.
    pub code: String,
    /// Number of records.
    pub records: usize,
    /// Name of the first record that failed for this reason.
    pub record: String,
    /// Failure of the first record, in a sentence.
    pub message: String,
}

impl FailureCount {
    /// Counts the failures of some rows.
    pub(super) fn from_rows(rows: &[ResultRow]) -> Vec<Self> {
        let failed = rows.iter().filter_map(|row| {
            let error = row.error.clone()?;
            let (code, message) = (error.code, error.message);
            let record = match &row.record_id {
                Some(id) => format!("{}, record {id}", row.record),
                None => row.record.clone(),
            };
            Some(Self { code, records: 1, record, message })
        });
        Self::merged(failed)
    }

    /// Adds up the counts of each reason, the most frequent first.
    pub(super) fn merged(counts: impl IntoIterator<Item = Self>) -> Vec<Self> {
        let mut by_code: BTreeMap<String, Self> = BTreeMap::new();
        for count in counts {
            match by_code.get_mut(&count.code) {
                None => drop(by_code.insert(count.code.clone(), count)),
                Some(known) => {
                    let records = known.records + count.records;
                    if count.record < known.record {
                        *known = count;
                    }
                    known.records = records;
                }
            }
        }
        let mut merged: Vec<Self> = by_code.into_values().collect();
        merged.sort_by_key(|count| std::cmp::Reverse(count.records));
        merged
    }
}
