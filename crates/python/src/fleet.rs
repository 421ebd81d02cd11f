//! Many records by one saved analysis: one part at a time, and the summary of all.

use std::path::PathBuf;

use mechid::SavedAnalysis;
use mechid::analysis::fleet::{
    Fleet, FleetRecord, FleetSummary, Part, PartDone, results_as_parquet,
};
use mechid::io::{RecordRows, Table, create_folder};
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::{failure, work};

/// A record of a fleet: its file and, of a file of many records, its name and its rows (from, to).
type Place = (PathBuf, Option<(String, usize, usize)>);

/// Values with their names.
type Named<T> = Vec<(String, T)>;

/// Checks an analysis (JSON), creates the folder of results, and returns the records of each part.
#[pyfunction]
pub fn fleet_begin(
    py: Python<'_>,
    records: Vec<PathBuf>,
    analysis: &str,
    folder: PathBuf,
    part_records: usize,
) -> PyResult<Vec<Vec<Place>>> {
    let analysis: SavedAnalysis = failure::settings(py, analysis)?;
    let fleet = work::brief(py, || Fleet::new(analysis, &records, &folder, part_records))?;
    work::brief(py, || create_folder(folder))?;
    let place = |FleetRecord { path, rows }: &FleetRecord| {
        let rows =
            rows.as_ref().map(|record| (record.id.clone(), record.rows.start, record.rows.end));
        (path.clone(), rows)
    };
    Ok(fleet.parts().iter().map(|part| part.records().iter().map(place).collect()).collect())
}

/// Computes the rows of some records unless they are there; returns what was done as JSON. The analysis
/// is JSON, too.
#[pyfunction]
pub fn fleet_part(
    py: Python<'_>,
    records: Vec<Place>,
    analysis: &str,
    folder: PathBuf,
) -> PyResult<String> {
    let record = |(path, rows): Place| FleetRecord {
        path,
        rows: rows.map(|(id, from, to)| RecordRows { id, rows: from..to }),
    };
    let records: Vec<FleetRecord> = records.into_iter().map(record).collect();
    let analysis: SavedAnalysis = failure::settings(py, analysis)?;
    // One thread: the engine above decides how many parts there are at a time.
    let done = work::watched(
        py,
        Some(1),
        || Ok(()),
        move || Part::new(&records, &analysis).run(&analysis, &folder),
    )?;
    failure::json(py, &done)
}

/// Identifies records, of which a name and named columns are given; returns their rows as the bytes of a
/// Parquet file. The analysis is JSON.
#[pyfunction]
pub fn fleet_rows<'py>(
    py: Python<'py>,
    records: Named<Named<PyReadonlyArray1<'py, f64>>>,
    analysis: &str,
) -> PyResult<Bound<'py, PyBytes>> {
    let analysis: SavedAnalysis = failure::settings(py, analysis)?;
    let copied = records.into_iter().map(|(record, columns)| {
        let columns = columns.into_iter().map(|(name, values)| (name, values.as_array().to_vec()));
        (record, columns.collect())
    });
    let copied: Named<Named<Vec<f64>>> = copied.collect();
    let rows = work::watched(
        py,
        Some(1),
        || Ok(()),
        move || {
            analysis.check()?;
            let rows = copied.into_iter().map(|(record, columns)| {
                analysis.row_of_table(&record, Table::from_columns(record.clone(), columns))
            });
            results_as_parquet(&rows.collect::<Vec<_>>())
        },
    )?;
    Ok(PyBytes::new(py, &rows))
}

/// Gathers parts (JSON) that took so many seconds; returns the summary as text and as JSON.
#[pyfunction]
pub fn fleet_summary(
    py: Python<'_>,
    parts: Vec<String>,
    folder: PathBuf,
    elapsed_s: f64,
) -> PyResult<(String, String)> {
    let parts = parts.iter().map(|part| failure::settings::<PartDone>(py, part));
    let parts = parts.collect::<PyResult<Vec<_>>>()?;
    let summary = work::brief(py, || FleetSummary::of(parts, &folder, elapsed_s))?;
    Ok((summary.to_string(), failure::json(py, &summary)?))
}
