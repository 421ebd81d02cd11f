//! Analysis of many records (a fleet) with one saved analysis: functions for one part of the
//! records, and for the summary of all parts.

use std::ffi::OsString;
use std::path::PathBuf;

use mechid::SavedAnalysis;
use mechid::analysis::fleet::{
    Fleet, FleetRecord, FleetSummary, Isolation, Part, PartDone, Worker, results_as_parquet,
};
use mechid::io::{RecordRows, Table, create_folder};
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::{failure, work};

/// Arguments with which the interpreter runs a worker process for a fleet.
const WORKER: [&str; 3] = ["-m", "mechid", "fleet-worker"];

/// Record of a fleet: its file and, in a file of many records, its name and its rows (from, to).
type Place = (PathBuf, Option<(String, usize, usize)>);

/// Values with their names.
type Named<T> = Vec<(String, T)>;

/// Checks an analysis (JSON) and creates the folder of results; returns the records of each part,
/// and the excluded paths.
#[pyfunction]
pub fn fleet_begin(
    py: Python<'_>,
    records: Vec<PathBuf>,
    analysis: &str,
    folder: PathBuf,
    part_records: usize,
) -> PyResult<(Vec<Vec<Place>>, Vec<String>)> {
    let analysis: SavedAnalysis = failure::settings(py, analysis)?;
    let fleet = work::brief(py, || Fleet::new(analysis, &records, &folder, part_records))?;
    work::brief(py, || create_folder(folder))?;
    let location = |FleetRecord { path, rows }: &FleetRecord| {
        let rows =
            rows.as_ref().map(|record| (record.id.clone(), record.rows.start, record.rows.end));
        (path.clone(), rows)
    };
    let parts = fleet.parts().iter().map(|part| part.records().iter().map(location).collect());
    Ok((parts.collect(), fleet.left_out().to_vec()))
}

/// Checks an analysis (JSON); returns the column that identifies the records of a file.
#[pyfunction]
pub fn fleet_record_column(py: Python<'_>, analysis: &str) -> PyResult<Option<String>> {
    let analysis: SavedAnalysis = failure::settings(py, analysis)?;
    Ok(analysis.reading.record_column)
}

/// Computes the result rows of some records and writes them into a file in `folder`, unless this
/// file exists. Returns a report as JSON. `analysis` is JSON, too. `isolation` is the path of the
/// Python interpreter for the worker processes, the memory limit per record, in GB, and the time
/// limit per record, in s. Without `isolation`, the records are processed in this process.
#[pyfunction]
#[pyo3(signature = (records, analysis, folder, isolation))]
pub fn fleet_part(
    py: Python<'_>,
    records: Vec<Place>,
    analysis: &str,
    folder: PathBuf,
    isolation: Option<(PathBuf, f64, f64)>,
) -> PyResult<String> {
    let record = |(path, rows): Place| FleetRecord {
        path,
        rows: rows.map(|(id, from, to)| RecordRows { id, rows: from..to }),
    };
    let records: Vec<FleetRecord> = records.into_iter().map(record).collect();
    let analysis: SavedAnalysis = failure::settings(py, analysis)?;
    let compute = move || {
        let part = Part::new(&records, &analysis);
        let Some((python, record_memory_gb, record_seconds)) = isolation else {
            return part.run(&analysis, &folder);
        };
        let words = WORKER.map(OsString::from).to_vec();
        let isolation =
            Isolation { record_memory_gb, record_seconds, ..Isolation::new(python, words) };
        part.run_isolated(&mut Worker::new(isolation, analysis)?, &folder)
    };
    // One thread is used, because the engine that calls this decides how many parts run at a time.
    let done = work::watched(py, Some(1), || Ok(()), compute)?;
    failure::json(py, &done)
}

/// Identifies records, each given as a name and named columns; returns the rows of results as the
/// bytes of a Parquet file. The analysis is JSON.
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

/// Combines the reports of parts (JSON), which took `elapsed_s` seconds in all; returns the summary
/// as text and as JSON.
#[pyfunction]
pub fn fleet_summary(
    py: Python<'_>,
    parts: Vec<String>,
    left_out: Vec<String>,
    folder: PathBuf,
    elapsed_s: f64,
) -> PyResult<(String, String)> {
    let parts = parts.iter().map(|part| failure::settings::<PartDone>(py, part));
    let parts = parts.collect::<PyResult<Vec<_>>>()?;
    let summary = work::brief(py, || FleetSummary::from_parts(parts, &folder, elapsed_s))?;
    let summary = FleetSummary { left_out, ..summary };
    Ok((summary.to_string(), failure::json(py, &summary)?))
}
