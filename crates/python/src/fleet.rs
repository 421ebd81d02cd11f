//! Many records by one saved analysis: one part at a time, and the summary of all.

use std::path::PathBuf;

use mechid::SavedAnalysis;
use mechid::analysis::fleet::{FleetSummary, Part, PartDone};
use mechid::io::create_folder;
use pyo3::prelude::*;

use crate::{failure, work};

/// Checks an analysis (JSON), and creates the folder of results.
#[pyfunction]
pub fn fleet_begin(py: Python<'_>, analysis: &str, folder: PathBuf) -> PyResult<()> {
    let analysis: SavedAnalysis = failure::settings(py, analysis)?;
    work::brief(py, || analysis.check())?;
    work::brief(py, || create_folder(folder))
}

/// Computes the rows of some records unless they are there; returns what was done as JSON. The analysis
/// is JSON, too.
#[pyfunction]
pub fn fleet_part(
    py: Python<'_>,
    records: Vec<PathBuf>,
    analysis: &str,
    folder: PathBuf,
) -> PyResult<String> {
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
