//! Files with many records, distinguished by a column.

use std::path::Path;
use std::slice::from_ref;

use mechid_io::{ParquetFile, RecordFile, RecordRows, TimeAxis, escaped};

use super::{Channels, Measurement, Reading};
use crate::AnalysisError;

/// Maximum number of records that an error lists.
const LISTED: usize = 5;

/// Returns the records of a file, in the order of their rows.
pub(crate) fn records_of(
    path: &Path,
    column: &str,
    reading: &Reading,
) -> Result<Vec<RecordRows>, AnalysisError> {
    Ok(ParquetFile::open(path, &reading.limits())?.records(column)?)
}

/// Opens the requested record, or the only record of the file.
pub(super) fn open_one(
    reading: &Reading,
    path: &Path,
    column: &str,
) -> Result<RecordFile, AnalysisError> {
    let file = ParquetFile::open(path, &reading.limits())?;
    let records = file.records(column)?;
    let chosen = match (&reading.record_id, records.as_slice()) {
        (Some(id), all) => all.iter().find(|record| record.id == *id),
        (None, [only]) => Some(only),
        (None, _) => None,
    };
    let Some(chosen) = chosen else {
        let mut available: Vec<_> =
            records.iter().take(LISTED).map(|record| escaped(&record.id)).collect();
        if records.len() > LISTED {
            available.push("…".into());
        }
        return Err(AnalysisError::RecordId {
            file: file.head().file().into(),
            id: reading.record_id.clone(),
            records: records.len(),
            available: available.join(", "),
        });
    };
    let table = file.tables(None, from_ref(chosen))?.swap_remove(0);
    Ok(RecordFile::from_table(table).with_memory(file.memory()))
}

/// Opens consecutive records of a file in one pass; only the used columns are read.
pub(crate) fn open_all(
    path: &Path,
    channels: &Channels,
    reading: &Reading,
    records: &[RecordRows],
) -> Result<Vec<Result<Measurement, AnalysisError>>, AnalysisError> {
    let file = ParquetFile::open(path, &reading.limits())?;
    let head = file.head();
    let mut wanted: Vec<usize> =
        channels.used().into_iter().map(|name| head.find(name)).collect::<Result<_, _>>()?;
    if let Some(TimeAxis::Column(column)) = reading.time_axis(head) {
        wanted.push(head.find(column)?);
    }
    let tables = file.tables(Some(&wanted), records)?.into_iter().zip(records);
    let opened = tables.map(|(table, record)| {
        let reading = Reading { record_id: Some(record.id.clone()), ..reading.clone() };
        let mut record = RecordFile::from_table(table).with_memory(file.memory());
        reading.state_units(&mut record)?;
        Measurement::from_file(record, Some(path), channels, &reading)
    });
    Ok(opened.collect())
}
