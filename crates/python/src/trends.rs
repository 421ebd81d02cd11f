//! Studies by simulation, and comparison of the results of many records.

use std::path::PathBuf;

use mechid::analysis::fleet::{TrendAxis, Trends};
use mechid::io::{ExperimentStudy, StudyRuns, Table, write_all};
use mechid::report::{PageSettings, trends_page};
use mechid::{SimulateError, simulate_runs};
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;

use crate::{failure, work};

/// Simulates the runs of a study into a Parquet file. The experiment is a JSON file, or a name and
/// a JSON text; the runs are a number of seeds, or the values of some fields. Returns the summary
/// as text and as JSON.
#[pyfunction]
#[pyo3(signature = (file, text, runs, fields, out))]
pub fn fleet_simulate(
    py: Python<'_>,
    file: PathBuf,
    text: Option<&str>,
    runs: Option<usize>,
    fields: Vec<(String, PyReadonlyArray1<'_, f64>)>,
    out: PathBuf,
) -> PyResult<(String, String)> {
    let fields = fields.into_iter().map(|(name, values)| (name, values.as_array().to_vec()));
    let runs = match runs {
        Some(runs) => StudyRuns::Seeds(runs),
        None => StudyRuns::Table(Box::new(Table::from_columns("the study", fields))),
    };
    let study = work::brief(py, || match text {
        Some(text) => ExperimentStudy::parse(file.display().to_string(), text, &runs),
        None => ExperimentStudy::read(&file, &runs),
    })?;
    let simulate = move || -> Result<_, SimulateError> {
        let (file, summary) = simulate_runs(&study, out, &mut |_| ())?;
        write_all(vec![file], &[])?;
        Ok(summary)
    };
    let summary = work::watched(py, None, || Ok(()), simulate)?;
    Ok((summary.to_string(), failure::json(py, &summary)?))
}

/// Reads a folder of results; returns their trends as text, JSON, and a page with this heading.
#[pyfunction]
pub fn fleet_trends(
    py: Python<'_>,
    folder: PathBuf,
    over_number: bool,
    title: &str,
) -> PyResult<(String, String, String)> {
    let over = if over_number { TrendAxis::Number } else { TrendAxis::Order };
    let trends = work::watched(py, None, || Ok(()), move || Trends::read(folder, over))?;
    let settings = PageSettings { title: Some(title.to_owned()), ..PageSettings::default() };
    let page = work::brief(py, || trends_page(&trends, &settings))?;
    Ok((trends.to_string(), failure::json(py, &trends)?, page))
}
