//! Identification of the records of one file, one after the other, and their rows of results.

use std::path::Path;

use mechid_io::{RecordRows, path_text};

use crate::measurement::{Measurement, open_all};
use crate::{AnalysisError, ResultRow, SavedAnalysis};

/// Maximum number of rows that are read at a time from a file with many records; a record with more
/// rows is read alone.
const ROWS_AT_ONCE: usize = 1 << 20;

/// Identifies some records of a file, or the whole file if `records` is empty, and passes the rows
/// to `take` in the order of the records.
///
/// # Errors
/// As `take`. The error of a record is in its row.
pub(super) fn rows_of<E>(
    path: &Path,
    records: &[RecordRows],
    analysis: &SavedAnalysis,
    take: &mut dyn FnMut(ResultRow) -> Result<(), E>,
) -> Result<(), E> {
    let name = path_text(path);
    if records.is_empty() {
        return take(analysis.row(&name, || analysis.open(path)));
    }
    for together in read_together(records) {
        for (record, opened) in together.iter().zip(open(path, together, analysis)) {
            let row = analysis.row(&name, || opened);
            take(ResultRow { record_id: Some(record.id.clone()), ..row })?;
        }
    }
    Ok(())
}

/// Divides records of a file into groups that are read together.
fn read_together(records: &[RecordRows]) -> impl Iterator<Item = &[RecordRows]> {
    let mut remaining = records;
    std::iter::from_fn(move || {
        let start = remaining.first()?.rows.start;
        let count =
            remaining.iter().take_while(|record| record.rows.end - start <= ROWS_AT_ONCE).count();
        let (together, later) = remaining.split_at(count.max(1));
        remaining = later;
        Some(together)
    })
}

/// Opens consecutive records of a file together, or one by one if their rows cannot be read
/// together.
fn open(
    path: &Path,
    records: &[RecordRows],
    analysis: &SavedAnalysis,
) -> Vec<Result<Measurement, AnalysisError>> {
    let SavedAnalysis { reading, window, .. } = analysis;
    let channels = analysis.record_channels();
    let opened = channels.and_then(|channels| open_all(path, &channels, reading, records));
    let opened = match (opened, records) {
        (Ok(opened), _) => opened,
        (Err(error), [_]) => vec![Err(error)],
        (Err(_), several) => {
            return several
                .iter()
                .flat_map(|one| open(path, std::slice::from_ref(one), analysis))
                .collect();
        }
    };
    opened.into_iter().map(|opened| opened?.window(window.clone())).collect()
}
